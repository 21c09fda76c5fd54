"""Tables of Mix-StAGE: their rows on the paper's speakers and on the synthetic ones, published figures, and claims."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from itertools import pairwise

from .mix_bench import Measured, StylePreservation, StyleTransfer
from .mix_figures import draw_heat_of_pairs, draw_space
from .paper_tables import Claim, PaperTable, TableSplit, TableSystem

__all__ = ["MIX"]

PAPER = "Ahuja et al. 2020, Style Transfer for Co-Speech Gesture Animation"
S2G, CMIX, MUNIT, STAGE, MIX_STAGE = "S2G", "CMix-GAN", "MUNIT", "StAGE", "Mix-StAGE"
SINGLE = {S2G: "speech2gesture_pats", CMIX: "cmix_gan_pats"}
MULTI = {MUNIT: "munit_pats", STAGE: "stage_pats", MIX_STAGE: "mix_stage_pats"}
AUTHORS = "Mix-StAGE, authors' reading"
PCK, F1, IS = "pck_mix_stage", "mode_f1_published", "inception_score_published"
SIZES = (2, 4, 8)
MODES = (1, 4, 8, 12)
SAME_F1 = 0.01  # ours: a difference of F1 that is none
STYLES = "One speech in the styles of several speakers"
SPACE = "The gesture space of Mix-StAGE: every style with its own speaker's speech, and with that of all others"
HEAT = "Where the arms move, right in red, left in blue: a column has one style, a row one speaker's speech"


@dataclass(frozen=True)
class Attribute:
    """Two speakers who differ in one attribute of style; supplement, table 3.

    Args:
        name: of the attribute.
        poles: the value of each speaker.
        pair: the two speakers.
    """

    name: str
    poles: tuple[str, str]
    pair: tuple[str, str]


@dataclass(frozen=True)
class SpeakerSet:
    """The speakers of the tables: eight, the first of whom are the smaller sets, and the pairs of attributes."""

    eight: tuple[str, ...]
    attributes: tuple[Attribute, ...]
    ablation: tuple[str, ...]
    """Speakers over whose networks table 6 is the mean; in the paper, all 25."""
    own: bool
    """Whether the paper has figures of these single speakers."""

    @property
    def everybody(self) -> tuple[str, ...]:
        return tuple(dict.fromkeys([*self.eight, *(name for a in self.attributes for name in a.pair)]))


def _attributes(*pairs: tuple[str, str]) -> tuple[Attribute, ...]:
    names = ("sitting or standing", "gesture frequency", "body orientation", "primary arm")
    poles = (("sitting", "standing"), ("low", "high"), ("right", "left"), ("left arm", "right arm"))
    return tuple(Attribute(*each) for each in zip(names, poles, pairs, strict=True))


THEIRS = SpeakerSet(
    ("corden", "lec_cosmic", "ytch_prof", "oliver", "ellen", "noah", "lec_evol", "maher"),  # supplement, table 5
    _attributes(
        ("noah", "maher"), ("seth", "oliver"), ("chemistry", "lec_evol"),  # table 4; table 3 has oliver for the left
        ("lec_cosmic|leftarm", "lec_cosmic|rightarm"),
    ),
    ("corden", "lec_cosmic", "ytch_prof", "oliver", "ellen", "noah", "lec_evol", "maher"),
    True,
)  # fmt: skip
"""The paper's speakers."""
OURS = SpeakerSet(
    ("ada", "dan", "ben", "cleo", "elif", "femi", "gita", "hugo"),
    _attributes(("gita", "hugo"), ("ben", "ada"), ("dan|mirror", "dan"), ("cleo|leftarm", "cleo|rightarm")),
    ("ada", "dan", "ben", "cleo"),
    False,
)
"""The synthetic speakers (`cospeech.rules.styles`). First come ada, who is lively, and dan, who is left-handed: they are as
different as the paper's first two."""


def _pairs(*figures: float) -> dict[str, dict[str, float]]:
    """PCK and F1 of the five systems, in a line of tables 1, 4 and 5."""
    systems = (*SINGLE, *MULTI)
    return {name: {PCK: figures[2 * k], F1: figures[2 * k + 1]} for k, name in enumerate(systems)}


MEAN_1 = {
    2: _pairs(0.25, 0.08, 0.26, 0.27, 0.24, 0.06, 0.36, 0.21, 0.34, 0.22),
    4: _pairs(0.37, 0.18, 0.37, 0.27, 0.22, 0.05, 0.38, 0.34, 0.39, 0.35),
    8: _pairs(0.36, 0.14, 0.37, 0.26, 0.31, 0.21, 0.38, 0.32, 0.40, 0.33),
}
"""Table 1, means; table 5 has other figures for MUNIT's F1 (.03 of 4 speakers, .15 of 8)."""
IS_2 = {
    MUNIT: (1.11, 1.90, 2.06, 1.10, 2.49, 1.05, 3.32),
    STAGE: (2.17, 2.85, 3.89, 1.68, 4.38, 6.81, 3.14),
    MIX_STAGE: (2.61, 2.85, 4.48, 3.08, 4.50, 6.69, 3.32),
}
"""Table 2: 2, 4, 8 speakers, then the attributes in the order of `_attributes`."""
MEAN_4 = (
    _pairs(0.35, 0.12, 0.35, 0.25, 0.36, 0.07, 0.42, 0.18, 0.42, 0.25),
    _pairs(0.55, 0.41, 0.56, 0.44, 0.34, 0.14, 0.58, 0.51, 0.58, 0.53),
    _pairs(0.39, 0.14, 0.43, 0.25, 0.14, 0.05, 0.40, 0.42, 0.40, 0.40),
    _pairs(0.43, 0.12, 0.43, 0.33, 0.35, 0.02, 0.59, 0.30, 0.61, 0.37),
)
EACH_4 = {
    "noah": _pairs(0.45, 0.11, 0.45, 0.28, 0.34, 0.09, 0.44, 0.14, 0.44, 0.26),
    "maher": _pairs(0.25, 0.13, 0.24, 0.22, 0.22, 0.07, 0.28, 0.26, 0.26, 0.25),
    "seth": _pairs(0.56, 0.50, 0.58, 0.54, 0.22, 0.02, 0.58, 0.54, 0.59, 0.57),
    "oliver": _pairs(0.54, 0.32, 0.54, 0.34, 0.35, 0.22, 0.54, 0.38, 0.56, 0.42),
    "chemistry": _pairs(0.35, 0.23, 0.36, 0.27, 0.15, 0.05, 0.37, 0.39, 0.40, 0.39),
    "lec_evol": _pairs(0.44, 0.05, 0.50, 0.23, 0.28, 0.34, 0.50, 0.44, 0.49, 0.46),
    "lec_cosmic|leftarm": _pairs(0.41, 0.08, 0.41, 0.28, 0.32, 0.06, 0.60, 0.27, 0.62, 0.36),
    "lec_cosmic|rightarm": _pairs(0.45, 0.18, 0.45, 0.38, 0.44, 0.12, 0.58, 0.31, 0.60, 0.35),
}
EACH_5 = {
    2: {
        "corden": _pairs(0.30, 0.05, 0.32, 0.21, 0.25, 0.06, 0.36, 0.21, 0.34, 0.222),
        "lec_cosmic": _pairs(0.19, 0.12, 0.19, 0.33, 0.15, 0.19, 0.20, 0.48, 0.24, 0.49),
    },
    4: {
        "corden": _pairs(0.30, 0.05, 0.32, 0.21, 0.24, 0.07, 0.35, 0.27, 0.35, 0.30),
        "lec_cosmic": _pairs(0.19, 0.12, 0.19, 0.33, 0.19, 0.16, 0.18, 0.23, 0.20, 0.19),
        "ytch_prof": _pairs(0.43, 0.22, 0.43, 0.22, 0.15, 0.02, 0.42, 0.34, 0.40, 0.32),
        "oliver": _pairs(0.54, 0.32, 0.54, 0.34, 0.20, 0.09, 0.54, 0.47, 0.55, 0.52),
    },
    8: {
        "corden": _pairs(0.30, 0.05, 0.32, 0.21, 0.23, 0.03, 0.32, 0.28, 0.36, 0.27),
        "lec_cosmic": _pairs(0.19, 0.12, 0.19, 0.33, 0.13, 0.09, 0.23, 0.34, 0.24, 0.32),
        "ytch_prof": _pairs(0.43, 0.22, 0.43, 0.22, 0.39, 0.37, 0.44, 0.39, 0.45, 0.39),
        "oliver": _pairs(0.54, 0.32, 0.54, 0.34, 0.35, 0.30, 0.54, 0.39, 0.54, 0.46),
        "ellen": _pairs(0.29, 0.13, 0.30, 0.23, 0.33, 0.17, 0.34, 0.21, 0.33, 0.25),
        "noah": _pairs(0.45, 0.11, 0.45, 0.28, 0.40, 0.23, 0.44, 0.24, 0.44, 0.27),
        "lec_evol": _pairs(0.44, 0.05, 0.50, 0.23, 0.33, 0.42, 0.45, 0.66, 0.48, 0.66),
        "maher": _pairs(0.25, 0.13, 0.24, 0.22, 0.23, 0.17, 0.25, 0.25, 0.25, 0.25),
    },
}
TABLE_6 = {S2G: (0.189, 0.366), 1: (0.266, 0.379), 4: (0.277, 0.366), 8: (0.280, 0.367), 12: (0.278, 0.370)}
"""Table 6, F1 and PCK; there in hundredths, and of all 25 speakers."""


# rows ---------------------------------------------------------------------------------------------------------------------


def _of(
    system: str, label: str, speakers: tuple[str, ...], figures: Mapping[str, float], scored_speakers: tuple[str, ...] = ()
) -> TableSystem:
    """A system that is trained on these speakers: a network for each, or one for all."""
    single = system in SINGLE
    runs = tuple((name,) for name in speakers) if single else (speakers,)
    return TableSystem(f"{system}, {label}", (SINGLE | MULTI)[system], figures, runs=runs, scored_speakers=scored_speakers)


def _size(count: int) -> str:
    return f"{count} speakers"


def _make_table_1(speaker_set: SpeakerSet) -> TableSplit:
    rows = [
        _of(system, _size(count), speaker_set.eight[:count], figures)
        for count in SIZES
        for system, figures in MEAN_1[count].items()
    ]
    rows.append(TableSystem(f"{AUTHORS}, {_size(8)}", "mix_stage_pats_authors", runs=(speaker_set.eight,)))
    orders = [(MIX_STAGE, STAGE, F1), (STAGE, MUNIT, F1), (MIX_STAGE, S2G, PCK), (MIX_STAGE, S2G, F1), (CMIX, S2G, F1)]
    words = ("holds", "not assayed", "not assayed", "holds", "undecided")  # 2026-11-22 the first, 2026-11-25 the others
    claims = tuple(
        Claim(m, f"{a}, {_size(8)}", f"{b}, {_size(8)}", True, "table 1", expected=word)
        for (a, b, m), word in zip(orders, words, strict=True)
    )
    return TableSplit("pats", tuple(rows), claims, speakers=speaker_set.eight)


def _make_table_2(speaker_set: SpeakerSet) -> TableSplit:
    sets = [(_size(count), speaker_set.eight[:count]) for count in SIZES] + [(a.name, a.pair) for a in speaker_set.attributes]
    rows = [_of(system, label, speakers, {IS: IS_2[system][k]}) for k, (label, speakers) in enumerate(sets) for system in MULTI]
    grows = [(f"{MIX_STAGE}, {_size(more)}", f"{MIX_STAGE}, {_size(few)}") for few, more in pairwise(SIZES)]
    beats = [(f"{a}, {_size(8)}", f"{b}, {_size(8)}") for a, b in ((MIX_STAGE, STAGE), (STAGE, MUNIT))]
    claims = tuple(Claim(IS, better, worse, True, "table 2") for better, worse in [*grows, *beats])
    return TableSplit("pats", tuple(rows), claims, speakers=speaker_set.everybody)


def _make_table_3(speaker_set: SpeakerSet) -> TableSplit:
    rows, columns = [], (None, "rate", "orientation", "right_share")
    claims = []
    for attribute, column in zip(speaker_set.attributes, columns, strict=True):
        names = []
        for style, pole in zip(attribute.pair, attribute.poles, strict=True):
            names.append(f"{MIX_STAGE}, {attribute.name}: {pole} ({style})")
            rows.append(TableSystem(names[-1], MULTI[MIX_STAGE], runs=(attribute.pair,), scored_speakers=(style,)))
        if column is not None:
            claims.append(Claim(column, names[1], names[0], True, "supplement, table 3"))
    note = "A system with far fewer strokes a minute than the recordings stands nearly still, and shows nothing of gestures."
    return TableSplit("pats", tuple(rows), tuple(claims), note, speaker_set.everybody)


def _make_table_4(speaker_set: SpeakerSet) -> TableSplit:
    rows, claims = [], []
    for attribute, mean in zip(speaker_set.attributes, MEAN_4, strict=True):
        for system, figures in mean.items():
            rows.append(_of(system, f"{attribute.name}, mean", attribute.pair, figures))
        for name, pole in zip(attribute.pair, attribute.poles, strict=True):
            for system in mean:
                label = f"{attribute.name}: {pole} ({name})"
                rows.append(_of(system, label, attribute.pair, EACH_4[name][system] if speaker_set.own else {}, (name,)))
        label = f"{attribute.name}, mean"
        claims += [
            Claim(m, f"{MIX_STAGE}, {label}", f"{other}, {label}", True, "supplement, table 4", expected="not assayed")
            for other, m in ((S2G, PCK), (S2G, F1), (MUNIT, F1))  # 2026-11-27: few windows of each pair, and MUNIT hardly hears
        ]
    return TableSplit("pats", tuple(rows), tuple(claims), speakers=speaker_set.everybody)


def _make_table_5(speaker_set: SpeakerSet) -> TableSplit:
    rows, claims = [], []
    for count in SIZES:
        speakers = speaker_set.eight[:count]
        rows += [_of(system, f"{_size(count)}, mean", speakers, figures) for system, figures in MEAN_1[count].items()]
        for name in speakers:
            for system in MEAN_1[count]:
                figures = EACH_5[count][name][system] if speaker_set.own else {}
                rows.append(_of(system, f"{_size(count)}: {name}", speakers, figures, (name,)))
    for name in speaker_set.eight:
        label = f"{_size(8)}: {name}"
        rows_compared = f"{MIX_STAGE}, {label}", f"{S2G}, {label}"
        claims.append(
            Claim(F1, *rows_compared, True, "supplement, table 5", expected="undecided")
        )  # 2026-11-25: few windows each
    return TableSplit("pats", tuple(rows), tuple(claims), "Means as in table 1.", speaker_set.eight)


def _make_table_6(speaker_set: SpeakerSet) -> TableSplit:
    def of(key: str | int) -> dict[str, float]:
        f1, pck = TABLE_6[key]  # type: ignore[index]
        return {F1: f1, PCK: pck}

    runs = tuple((name,) for name in speaker_set.ablation)
    rows = [TableSystem(S2G, SINGLE[S2G], of(S2G), runs=runs)]
    for modes in MODES:
        change = () if modes == 8 else (f"model.modes={modes}",)  # 8 is the recipe's own, of table 1
        rows.append(TableSystem(_modes(modes), SINGLE[CMIX], of(modes), change, runs))
    claims = [  # expected on 2026-11-27, before the first run of the design: S2G is below another clip, as in mix-1
        Claim(F1, _modes(1), S2G, True, "table 6", expected="not assayed"),
        Claim(F1, _modes(8), _modes(1), True, "table 6", expected="undecided"),
        Claim(F1, _modes(8), _modes(12), True, "section 6.1", margin=SAME_F1, expected="undecided"),
    ]
    note = f"Means over networks of {', '.join(speaker_set.ablation)}; the paper's over 25 speakers."
    return TableSplit("pats", tuple(rows), tuple(claims), note, speaker_set.eight)


def _modes(count: int) -> str:
    return f"{CMIX} (M = {count})"


# tables -------------------------------------------------------------------------------------------------------------------

PRESERVATION = {PCK: "PCK ↑", F1: "F1 ↑", "pck_2d": "PCK, plain mean ↑", "mode_f1": "F1, clips apart ↑"}


def _paper_tables() -> Iterator[PaperTable]:
    title = f"{PAPER}: "
    parts = {k: tuple(make(speaker_set) for speaker_set in (THEIRS, OURS)) for k, make in enumerate(
        (_make_table_1, _make_table_2, _make_table_3, _make_table_4, _make_table_5, _make_table_6), 1
    )}  # fmt: skip
    yield PaperTable("mix-1", f"{title}table 1, style preservation", PRESERVATION, parts[1], StylePreservation, STYLES)
    transfer = {
        IS: "IS ↑", "inception_score": "IS, in parts ↑", "score_of_set": "IS, of the set ↑",
        "named": "clips named right ↑", "named_windows": "windows named right ↑", "beat_align": "BA, lift ↑",
    }  # fmt: skip
    yield PaperTable(
        "mix-2", f"{title}table 2, style transfer", transfer, parts[2], partial(StyleTransfer, draw=draw_space), SPACE
    )
    attributes = {
        "rate": "strokes a minute",
        "amplitude": "amplitude",
        "right_share": "right arm's share",
        "orientation": "turned left, °",
    }
    yield PaperTable(
        "mix-3",
        f"{title}supplement, table 3, attributes of style",
        attributes,
        parts[3],
        partial(Measured, draw=draw_heat_of_pairs),
        HEAT,
    )
    few = {name: PRESERVATION[name] for name in (PCK, F1)}
    yield PaperTable(
        "mix-4", f"{title}supplement, table 4, style preservation by attribute", few, parts[4], StylePreservation, STYLES
    )
    yield PaperTable(
        "mix-5", f"{title}supplement, table 5, style preservation by speaker", few, parts[5], StylePreservation, STYLES
    )
    yield PaperTable(
        "mix-6", f"{title}supplement, table 6, number of sub-generators", PRESERVATION, parts[6], StylePreservation, STYLES
    )


MIX: dict[str, PaperTable] = {paper_table.name: paper_table for paper_table in _paper_tables()}
"""Name after ``--table`` → the table."""
