"""What a table of a paper consists of: rows with published figures, claims, and the bench on which rows are judged."""

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
    "COSTS", "HEARING", "LIKELIHOOD", "Bench", "Cells", "Claim", "PaperTable", "Pictures", "TableSplit", "TableSystem",
    "replace_minus",
]  # fmt: skip

Pictures = NDArray[np.uint8]
Cells = dict[str, dict[str, Any]]
"""Metric → ``value``, ``interval`` over windows and ``note``, or ``why`` there is none."""

COSTS = {"fgd_cost": ("fgd", 1.0), "srgr_cost": ("srgr_beat", -1.0)}
"""Column → metric and sign: by how much it is worse than with all inputs, of one network; no metric of its own."""

LIKELIHOOD, HEARING = "nll", "hearing_gain"
"""Columns of networks that have an exact likelihood: no metrics of motion, see `likelihood`."""


@dataclass(frozen=True)
class TableSystem:
    """A row.

    Args:
        name: of the system, as the paper has it.
        recipe: name of a recipe; None: not run here, the row has published figures alone.
        published: metric → the paper's figure.
        overrides: ``"model.modes=4"``, what is changed in the recipe.
        runs: speakers of each run that the row is made of; ``((),)``: one run of all.
        scored_speakers: speakers whose mean the figures are; (): all of its runs.
        lacks: inputs that it is played without.
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
    """That one row is better than another by a metric; ``higher`` says which way is better *here*, as the paper reads it.

    Args:
        metric: by which.
        better, worse: names of rows.
        higher: whether more is better.
        source: where the paper claims it.
        margin: 0, or the claim is an equality: the rows differ by less than this.
        expected: what was expected before the first run of the design, a word of `verdicts`; "": nothing.
    """

    metric: str
    better: str
    worse: str
    higher: bool
    source: str
    margin: float = 0.0
    expected: str = ""

    @property
    def alike(self) -> bool:
        """Whether the claim is an equality."""
        return self.margin > 0


@dataclass(frozen=True)
class TableSplit:
    """A table on one corpus; without ``published`` figures in its rows where the paper has not run it there.

    Args:
        corpus: of the store.
        rows, claims: of the table.
        note: below it.
        speakers: that the store must have; the first part of a table whose speakers it has is what is made.
    """

    corpus: str
    rows: tuple[TableSystem, ...]
    claims: tuple[Claim, ...] = ()
    note: str = ""
    speakers: tuple[str, ...] = ()

    def fits(self, store: Store) -> bool:
        """Whether it can be made on a store."""
        return store.corpus == self.corpus and {*self.speakers} <= {*store.speakers}


def replace_minus(name: str) -> str:
    """The name of a row with the minus that a keyboard has, and the letters of pictures, in place of U+2212.

    >>> replace_minus("−face")
    '-face'
    """
    return name.replace("−", "-")


class Bench(Protocol):
    """How rows are judged and drawn, on one store."""

    @property
    def windows(self) -> str:
        """Of what figures are, in words."""
        ...

    @property
    def features(self) -> str:
        """With which network or measure, in words; "": none."""
        ...

    def row(self, row: TableSystem, seed: int) -> tuple[Cells, str]:
        """Scores of a row with one seed, and with what it was trained."""
        ...

    def controls(self) -> dict[str, Cells]:
        """Scores of the control rows."""
        ...

    def faults(self, controls: Mapping[str, Cells]) -> dict[str, list[str]]:
        """What each metric puts in the wrong order among them."""
        ...

    def picture(self, table: Mapping[str, Any]) -> Pictures:
        """The figure of a table that was made."""
        ...


@dataclass(frozen=True)
class PaperTable:
    """A table of a paper.

    Args:
        name: after ``--table``.
        title: what it is.
        columns: metric → head of its column.
        parts: what it is on each corpus, or set of speakers.
        bench: (table, part, runs, raw corpus or None) → what scores its rows.
        shown: what its figure shows.
    """

    name: str
    title: str
    columns: Mapping[str, str]
    parts: tuple[TableSplit, ...]
    bench: Callable[[PaperTable, TableSplit, Runs, Any], Bench]
    shown: str
