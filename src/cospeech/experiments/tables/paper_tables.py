"""The parts of a paper's table: rows with published figures, claims, and the bench that scores the rows."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ...corpora.store import Store

if TYPE_CHECKING:
    from .runs import Runs

__all__ = [
    "COSTS", "HEARING", "LIKELIHOOD", "NAMED", "NAMED_BY_ALL", "REPLAY", "SIZE", "SIZE_RATIO", "Bench", "Cells", "Claim",
    "PaperTable", "Pictures", "TableSplit", "TableSystem", "replace_minus",
]  # fmt: skip

Pictures = NDArray[np.uint8]
Cells = dict[str, dict[str, Any]]
"""Metric → ``value``, ``interval`` over windows and ``note``, or ``why`` there is none."""

COSTS = {"fgd_cost": ("fgd", 1.0), "srgr_cost": ("srgr_beat", -1.0)}
"""Column → metric and sign: by how much a network is worse by this metric than with all inputs."""

LIKELIHOOD, HEARING = "nll", "hearing_gain"
"""Columns of networks with an exact likelihood. They are no metrics of motion, see `likelihood`."""

NAMED, NAMED_BY_ALL, SIZE, SIZE_RATIO = "style_named", "style_named_by_all", "size_correlation", "size_ratio"
REPLAY = "velocity_correlation"
"""Columns of style transfer, see `style_transfer`: the share of performances that a judge gives to the speaker of the example,
by manner alone or by all that it sees; r of their size and that of the example; their size as a multiple of the example's; r of
their velocities and those of the example, frame by frame: 1 where the example is only played again."""


@dataclass(frozen=True)
class TableSystem:
    """A row.

    Args:
        name: of the system, as the paper has it.
        recipe: name of a recipe; None: the row is not run here and has published figures alone.
        published: metric → the paper's figure.
        overrides: changes of the recipe, such as ``"model.modes=4"``.
        runs: speakers of each run of the row; ``((),)``: one run with all.
        scored_speakers: the figures are means over these speakers; (): over all of its runs.
        lacks: inputs without which it is played.
    """

    name: str
    recipe: str | None = None
    published: Mapping[str, float] = field(default_factory=dict)
    overrides: tuple[str, ...] = ()
    runs: tuple[tuple[str, ...], ...] = ((),)
    scored_speakers: tuple[str, ...] = ()
    lacks: tuple[str, ...] = ()


@dataclass(frozen=True)
class Claim:
    """The claim that one row is better than another by a metric, as the paper reads this metric.

    Args:
        metric: name of the metric.
        better, worse: names of rows.
        higher: whether the paper takes more as better.
        source: where the paper claims it.
        margin: above 0: the claim is an equality, the rows differ by less than this.
        expected: the verdict that we expected before the first run of the design, a word of `verdicts`; "": none.
        follows: the row that must follow the speech, and be better than the control rows; "": both rows of the claim.
    """

    metric: str
    better: str
    worse: str
    higher: bool
    source: str
    margin: float = 0.0
    expected: str = ""
    follows: str = ""

    @property
    def alike(self) -> bool:
        """Whether the claim is an equality."""
        return self.margin > 0


@dataclass(frozen=True)
class TableSplit:
    """A table on one corpus. Its rows have no ``published`` figures where the paper has none for this corpus.

    Args:
        corpus: of the store.
        rows, claims: of the table.
        note: text below it.
        speakers: those that the store must have; the first part of a table that fits the store is made.
    """

    corpus: str
    rows: tuple[TableSystem, ...]
    claims: tuple[Claim, ...] = ()
    note: str = ""
    speakers: tuple[str, ...] = ()

    def fits(self, store: Store) -> bool:
        """Whether the table can be made on a store."""
        return store.corpus == self.corpus and {*self.speakers} <= {*store.speakers}


def replace_minus(name: str) -> str:
    """The name of a row with the minus of keyboards and of picture fonts in place of U+2212.

    >>> replace_minus("−face")
    '-face'
    """
    return name.replace("−", "-")


class Bench(Protocol):
    """Scores and draws the rows of a table, on one store."""

    @property
    def windows(self) -> str:
        """The data that the figures are computed from, in words."""
        ...

    @property
    def features(self) -> str:
        """The feature network or measure, in words; "": none."""
        ...

    def row(self, row: TableSystem, seed: int) -> tuple[Cells, str]:
        """Scores of a row with one seed, and facts of its training."""
        ...

    def controls(self) -> dict[str, Cells]:
        """Scores of the control rows."""
        ...

    def faults(self, controls: Mapping[str, Cells]) -> dict[str, list[str]]:
        """What each metric puts in the wrong order among the control rows."""
        ...

    def picture(self, table: Mapping[str, Any]) -> Pictures:
        """The figure of a table that was made."""
        ...


@dataclass(frozen=True)
class PaperTable:
    """A table of a paper.

    Args:
        name: after ``--table``.
        title: of the table.
        columns: metric → head of its column.
        parts: the table on each corpus, or set of speakers.
        bench: (table, part, runs, raw corpus or None) → the bench that scores its rows.
        shown: what its figure shows, as caption.
    """

    name: str
    title: str
    columns: Mapping[str, str]
    parts: tuple[TableSplit, ...]
    bench: Callable[[PaperTable, TableSplit, Runs, Any], Bench]
    shown: str
