"""Tables of Chain of Generation: published figures, rows, and claims (Xu et al. 2024, tables 1, 2, 4 and figure 1)."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import chain, pairwise

from .cog_bench import Chains, Lacking
from .paper_tables import Claim, PaperTable, TableSplit, TableSystem

__all__ = ["COG"]

PAPER = "Xu et al. 2024, Chain of Generation"
STRIP = "Poses of each row above the speech that they go with"
FGD, SRGR, BA = "fgd", "srgr_beat", "beat_align_beat"
CHAIN, CAMN, MULTI, S2G, CONCATENATION = "CoG", "CaMN", "MultiContext", "Speech2Gesture", "concatenation"
SEQ2SEQ, A2G, TALKSHOW, DIFFUCLIP = "Seq2Seq", "Audio2Gestures", "TalkSHOW", "GestureDiffuCLIP"
RECIPES = {
    CHAIN: "chain_of_generation_beat", CAMN: "camn_beat", MULTI: "multi_context_beat", S2G: "speech2gesture_beat",
    SEQ2SEQ: "seq2seq_beat", A2G: "audio2gestures_beat", TALKSHOW: "talkshow_beat", DIFFUCLIP: "gesturediffuclip_beat",
}  # fmt: skip
LABELS = ("face", "emotion", "speaker")
"""Inputs that Chain of Generation plays without, as published: it estimates them from the speech."""
COLUMNS = {
    FGD: "FGD ↓", SRGR: "SRGR ↑", "srgr": "SRGR, of weights 1 ↑", BA: "BeatAlign ↑", "beat_align": "BA, lift ↑",
    "face_mse": "face MSE ↓",
}  # fmt: skip
OWN = (
    "CoG takes speech and words, and estimates face, emotion and speaker from the speech. CaMN is given all of them. FGD uses "
    "a network trained on this store. It is never comparable with the paper's, which uses the first release of BEAT."
)


def _figures(*values: float | None) -> dict[str, float]:
    """FGD, SRGR and BeatAlign of a line of the paper."""
    return {name: value for name, value in zip((FGD, SRGR, BA), values, strict=True) if value is not None}


# table 1 ------------------------------------------------------------------------------------------------------------------

_COMPARISON: Mapping[str, dict[str, float]] = {
    SEQ2SEQ: _figures(261.3, 0.173, 0.729),
    S2G: _figures(256.7, 0.092, 0.751),
    MULTI: _figures(176.2, 0.195, 0.776),
    A2G: _figures(223.8, 0.097, 0.766),
    CAMN: _figures(123.7, 0.239, 0.783),
    TALKSHOW: _figures(91.00, None, 0.840),
    DIFFUCLIP: _figures(85.17, None, None),
    CHAIN: _figures(45.87, 0.308, 0.931),
}


_EXPECTATIONS = {"+face": "holds", "+rhythm": "holds"}
"""Ours, of 2026-11-22, before the first run: brows and head move with the strokes, so face and rhythm loss should help."""
_EXPECTATIONS_1 = {MULTI: "holds", CAMN: "holds", CHAIN: "contradicted"}
"""Ours, of 2026-11-25, before the first run with five seeds: CaMN sees the recorded face and the labels, the chain does not."""


def _worse_to_better(
    names: tuple[str, ...],
    source: str,
    metrics: tuple[str, ...] = (FGD, SRGR, BA),
    expectations: Mapping[str, str] = _EXPECTATIONS,
) -> tuple[Claim, ...]:
    """Claims that each is better than the one before it; ``expectations``: the better one → word, not for beat alignment."""
    return tuple(
        Claim(m, better, worse, m != FGD, source, expected=expectations.get(better, "") if m != BA else "")
        for worse, better in pairwise(names)
        for m in metrics
    )


_TABLE_1 = TableSplit(
    "beat",
    tuple(
        TableSystem(name, RECIPES.get(name), figures, lacks={CHAIN: LABELS, TALKSHOW: ("face",)}.get(name, ()))
        for name, figures in _COMPARISON.items()
    ),
    (
        *_worse_to_better((S2G, MULTI, CAMN, CHAIN), "table 1", expectations=_EXPECTATIONS_1),
        *_worse_to_better((CAMN, TALKSHOW, CHAIN), "table 1", (FGD, BA)),
    ),
    OWN + " The row of GestureDiffuCLIP is a network of ours after that paper: its code was never published.",
)

# table 2 ------------------------------------------------------------------------------------------------------------------

_STEPS = (
    (
        'model.name="chain-of-generation-extended"',
        "model.face_teacher_forcing=1.0",
        "model.face=0.0",
    ),  # it encodes the recorded face, in training and when it plays, and makes none
    ("model.attention=false",),
    ("model.style_injection=false",),
    ("model.rhythm=0.0",),
)
"""What each row of table 2 lacks, compared with the next row and all after it; section 4.4."""
_ABLATION = {
    "−face": _figures(88.50, 0.228, 0.762),
    "+face": _figures(60.44, 0.240, 0.834),
    "+cw-attn": _figures(58.74, 0.238, 0.842),
    "+style": _figures(52.36, 0.241, 0.916),
    "+rhythm": _figures(45.87, 0.308, 0.931),
}
_ORDER = tuple(_ABLATION)

_TABLE_2 = TableSplit(
    "beat",
    tuple(
        TableSystem(name, RECIPES[CHAIN], figures, tuple(chain(*_STEPS[k:])), lacks=LABELS if k else LABELS[1:])
        for k, (name, figures) in enumerate(_ABLATION.items())
    ),
    (
        *_worse_to_better(_ORDER, "table 2", (FGD, BA)),
        *(Claim(SRGR, b, a, True, "table 2") for a, b in pairwise(_ORDER) if b != "+cw-attn"),  # where the paper's own falls
        *_worse_to_better((_ORDER[0], _ORDER[-1]), "table 2"),
    ),
    "Each row adds one part to the row above it. The first row gets the recorded face and generates none. " + OWN,
)

# table 4 ------------------------------------------------------------------------------------------------------------------

_WEIGHTINGS = {
    (500, 500, 500): _figures(58.67, 0.297, 0.924),
    (1000, 500, 500): _figures(64.32, 0.290, 0.924),
    (1000, 500, 100): _figures(56.21, 0.283, 0.925),
    (500, 1000, 100): _figures(58.75, 0.296, 0.926),
    (1000, 500, 10): _figures(46.31, 0.297, 0.925),
    (500, 1000, 10): _figures(50.52, 0.295, 0.943),
    (1000, 500, 1): _figures(48.29, 0.290, 0.927),
    (500, 1000, 1): _figures(45.87, 0.308, 0.931),
}
_BEST = (500, 1000, 1)


def _vary_weights(weights: tuple[int, int, int], figures: Mapping[str, float]) -> TableSystem:
    """λ of reconstruction, face and rhythm; the best are the recipe's own."""
    changes = [f"model.{key}={value}" for key, value in zip(("reconstruction", "face", "rhythm"), weights, strict=True)]
    return TableSystem(str(weights), RECIPES[CHAIN], figures, () if weights == _BEST else tuple(changes), lacks=LABELS)


_TABLE_4 = TableSplit(
    "beat",
    tuple(_vary_weights(weights, figures) for weights, figures in _WEIGHTINGS.items()),
    tuple(
        Claim(m, str(_BEST), str(w), m != FGD, "table 4", expected="contradicted" if m == FGD and w[2] == 500 else "undecided")
        for m in (FGD, SRGR)
        for w in _WEIGHTINGS
        if w != _BEST
    ),
    "Weights of the reconstruction, of the face and of the rhythm. " + OWN,
)

# figure 1 -----------------------------------------------------------------------------------------------------------------

FOUR = ("text", "emotion", "speaker", "face")
_CONDITIONS = {"all": (), **{f"−{name}": (name,) for name in FOUR}, "−all four": FOUR}
_SYSTEMS: Mapping[str, tuple[str, tuple[str, ...]]] = {
    CHAIN: (RECIPES[CHAIN], ()),
    CAMN: (RECIPES[CAMN], ()),
    CONCATENATION: (RECIPES[MULTI], ("model.emotion=8", "model.face=32")),  # of CaMN's widths
}

_FIGURE_1 = TableSplit(
    "beat",
    tuple(
        TableSystem(f"{system}: {what}", recipe, {}, changes, lacks=lacks)
        for system, (recipe, changes) in _SYSTEMS.items()
        for what, lacks in _CONDITIONS.items()
    ),
    tuple(
        Claim(cost, f"{CHAIN}: {what}", f"{other}: {what}", False, "figure 1", expected="holds")
        for other in (CAMN, CONCATENATION)
        for what in ("−all four", *(f"−{name}" for name in FOUR))
        for cost in ("fgd_cost", "srgr_cost")
    ),
    "All: the recorded face and the labels are handed over to every system. What is lacking CoG makes of the speech, but for "
    "words; the others get zeros. One network of each system and seed, played under all conditions. As published, CoG is "
    "trained with its own face and estimated labels alone, and never sees the faces and labels of its row of all inputs. "
    "Changes of `face_teacher_forcing` and `label_conditioning` give them to it in a share of the training clips.",
)

COG: dict[str, PaperTable] = {
    "cog-1": PaperTable("cog-1", f"{PAPER}: table 1, comparison", COLUMNS, (_TABLE_1,), Chains, STRIP),
    "cog-2": PaperTable("cog-2", f"{PAPER}: table 2, ablations", COLUMNS, (_TABLE_2,), Chains, STRIP),
    "cog-4": PaperTable("cog-4", f"{PAPER}: table 4, weights of the losses", COLUMNS, (_TABLE_4,), Chains, STRIP),
    "cog-figure-1": PaperTable(
        "cog-figure-1",
        f"{PAPER}: figure 1, what is lacking when it plays",
        COLUMNS | {"fgd_cost": "FGD, worse by ↓", "srgr_cost": "SRGR, worse by ↓"},
        (_FIGURE_1,),
        Lacking,
        "FGD and SRGR with all inputs and without some, of three systems",
    ),
}
"""Name after ``--table`` → the table."""
