"""What stands in the tables of a paper: its rows, its published figures, and what the paper claims of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

__all__ = ["TABLES", "Claim", "Design", "Part", "Row"]


@dataclass(frozen=True)
class Row:
    """A row.

    Args:
        name: of the system, as the paper has it.
        recipe: file of ``recipes/`` without its suffix; None: not built yet, the row has published figures alone.
        published: metric → the paper's figure.
    """

    name: str
    recipe: str | None = None
    published: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Claim:
    """That one row is better than another by a metric; ``higher`` says which way is better *here*, as the paper reads it."""

    metric: str
    better: str
    worse: str
    higher: bool
    source: str


@dataclass(frozen=True)
class Part:
    """A table on one corpus; without ``published`` figures in its rows where the paper has not run it there."""

    rows: tuple[Row, ...]
    claims: tuple[Claim, ...]
    note: str = ""


@dataclass(frozen=True)
class Design:
    """A table of a paper.

    Args:
        name: after ``--table``.
        title: what it is.
        columns: metric → head of its column.
        parts: corpus → rows and claims.
        figure: "strip": poses over time; "map": latents in the plane.
    """

    name: str
    title: str
    columns: Mapping[str, str]
    parts: Mapping[str, Part]
    figure: str = "strip"


PAPER = "Ye et al. 2022, Audio-Driven Stylized Gesture Generation with Flow-Based Model"
OURS, MOGLOW = "stylised flow", "MoGlow"


def _figures(*values: float | None) -> dict[str, float]:
    """FGD, PCK, Div, BA, MM as in table 1; None where the paper has none."""
    names = ("fgd", "pck_gfge", "diversity_gfge", "beat_align_gfge", "multimodality")
    return {name: value for name, value in zip(names, values, strict=False) if value is not None}


_TED_1 = Part(
    rows=(
        Row("Seq2Seq", None, _figures(18.15, 0.809, 40.08, 0.319)),
        Row("Speech2Gesture", None, _figures(19.25, 0.877, 44.46, 0.620)),
        Row("JEM", None, _figures(22.08, 0.880, 44.61, 0.508)),
        Row(MOGLOW, "moglow_ted", _figures(5.15, 0.842, 50.63, 0.617, 22.56)),
        Row("Trimodal Context", None, _figures(4.40, 0.850, 48.70, 0.618)),
        Row("Speech2AffectiveGestures", None, _figures(7.22, 0.861, 47.25, 0.619)),
        Row(OURS, "flow_ted", _figures(3.30, 0.850, 52.00, 0.622, 22.63)),
    ),
    claims=tuple(
        Claim(metric, OURS, MOGLOW, higher, "table 1, TED")
        for metric, higher in (
            ("fgd", False), ("pck_gfge", True), ("pck", True), ("diversity_gfge", True), ("beat_align_gfge", True),
            ("beat_align", True), ("multimodality", True),
        )
    ),
)  # fmt: skip

_TRINITY_1 = Part(
    rows=(
        Row("Gesticulator", None, _figures(9.95, 0.701, 3.50, 0.844)),
        Row(MOGLOW, "moglow_trinity", _figures(7.61, 0.726, 3.81, 0.852, 2.12)),
        Row(OURS, "flow_trinity", _figures(6.76, 0.730, 4.34, 0.875, 1.60)),
    ),
    claims=tuple(
        Claim(metric, *((OURS, MOGLOW) if metric != "multimodality" else (MOGLOW, OURS)), higher, "table 1, Trinity")
        for metric, higher in (
            ("fgd", False), ("pck_gfge", True), ("pck", True), ("diversity_gfge", True), ("beat_align_gfge", True),
            ("beat_align", True), ("multimodality", True),
        )
    ),
)  # fmt: skip

FULL, NO_PERCEPTUAL, NO_ENCODER, BASELINE = "proposed (full)", "without L_gp", "without global encoder", "baseline"


def _ablations(corpus: str, *figures: tuple[float, float, float], source: str) -> Part:
    """Rows of table 2 with a corpus's recipes."""
    names = {FULL: "", NO_PERCEPTUAL: "_no_perceptual", NO_ENCODER: "_no_encoder", BASELINE: "_baseline"}
    values = [*figures, *[()] * (len(names) - len(figures))]
    rows = tuple(
        Row(name, f"flow_{corpus}{end}", _figures(*value)) for (name, end), value in zip(names.items(), values, strict=True)
    )
    order = ((FULL, NO_PERCEPTUAL), (NO_PERCEPTUAL, NO_ENCODER), (FULL, NO_ENCODER), (FULL, BASELINE))
    claims = [Claim("fgd", better, worse, False, source) for better, worse in order]
    claims += [Claim("diversity_gfge", FULL, worse, True, source) for worse in (NO_PERCEPTUAL, NO_ENCODER, BASELINE)]
    return Part(rows, tuple(claims), "" if figures else "The paper has this table for TED alone.")


_TED_2 = _ablations("ted", (3.30, 0.850, 52), (4.62, 0.845, 51), (6.26, 0.848, 50), (6.10, 0.850, 49), source="table 2")
_TRINITY_2 = _ablations("trinity", source="table 2, said of TED")

_TED_3 = Part(
    rows=(
        Row(MOGLOW, "moglow_ted", {"chi_gfge": 908.47, "silhouette_gfge": 0.443}),
        Row(OURS, "flow_ted", {"chi_gfge": 1149.34, "silhouette_gfge": 0.517}),
    ),
    claims=tuple(
        Claim(metric, OURS, MOGLOW, True, "table 3") for metric in ("chi", "silhouette", "chi_gfge", "silhouette_gfge")
    ),
)

TABLES: dict[str, Design] = {
    "flow-1": Design(
        "flow-1",
        f"{PAPER}: table 1, comparison",
        {
            "fgd": "FGD ↓", "pck_gfge": "PCK ↑", "pck": "PCK, made ↑", "diversity_gfge": "Div ↑",
            "diversity": "Div, all pairs →", "beat_align_gfge": "BA ↑", "beat_align": "BA, lift ↑", "multimodality": "MM →",
        },
        {"ted": _TED_1, "trinity": _TRINITY_1},
    ),
    "flow-2": Design(
        "flow-2",
        f"{PAPER}: table 2, ablations",
        {"fgd": "FGD ↓", "pck_gfge": "PCK ↑", "pck": "PCK, made ↑", "diversity_gfge": "Div ↑", "diversity": "Div, all pairs →"},
        {"ted": _TED_2, "trinity": _TRINITY_2},
    ),
    "flow-3": Design(
        "flow-3",
        f"{PAPER}: table 3, clusters of latents",
        {"chi": "CHI ↑", "silhouette": "SCoeff ↑", "chi_gfge": "CHI, t-SNE ↑", "silhouette_gfge": "SCoeff, t-SNE ↑"},
        {"ted": _TED_3},
        figure="map",
    ),
}  # fmt: skip
"""Name after ``--table`` → the table."""
