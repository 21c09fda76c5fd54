"""Scores the rows of the flow paper's tables: performances of windows (tables 1 and 2), latents of windows (table 3)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from os import PathLike
from typing import Any

import numpy as np

from ...errors import say_count
from ...metrics import Tools
from .controls import ORACLE, faults_of, oracle_key
from .excerpts import AFTER, BEFORE, Excerpts
from .figures import choose_excerpt, draw_latents, draw_poses
from .inputs import generate_rows
from .likelihood import COLUMNS, STILL, score_likelihood, score_still
from .paper_tables import Cells, PaperTable, Pictures, TableSplit, TableSystem
from .runs import PlayableRun, Runs
from .scores import ScoreCache, controls_of_latents, latents, score, score_columns, score_latents

__all__ = ["Latents", "Performances"]


class _Flows:
    """What both benches have in common."""

    def __init__(self, paper_table: PaperTable, part: TableSplit, runs: Runs, raw: str | PathLike[str] | None) -> None:
        self.paper_table, self.runs = paper_table, runs
        self.columns = tuple(name for name in paper_table.columns if name not in COLUMNS)
        self.likely = len(self.columns) < len(paper_table.columns)
        self.excerpts = Excerpts(runs.folder, raw)
        self._scores = ScoreCache(runs, raw)

    @property
    def windows(self) -> str:
        """The number of windows and of their frames, in words."""
        count, total = len(self.excerpts), self.excerpts.total
        some = f"{count} of " if total > count else ""
        return f"{some}{say_count(total, 'test window')} of {self.excerpts.protocol.made} frames"

    def _cache(self, name: str, key: Sequence[object], work: Callable[[], Any]) -> Any:
        return self._scores.find([self.paper_table.name, self.excerpts.protocol, self.columns, name, *key], work)

    def _players(self, table: Mapping[str, Any]) -> dict[str, PlayableRun]:
        """For each row, the run with the first seed."""
        rows = {name: row["recipe"] for name, row in table["rows"].items() if row.get("cells")}
        return {name: self.runs.player(recipe, table["seeds"][0]) for name, recipe in rows.items()}


class Performances(_Flows):
    """Motion that systems make for every window, beside the recordings."""

    @cached_property
    def tools(self) -> Tools:
        """The feature network; it is trained if it is missing."""
        return Tools(features=self.runs.features())

    @property
    def features(self) -> str:
        """Name of the network of FGD."""
        assert self.tools.features is not None
        return self.tools.features.name

    def row(self, row: TableSystem, seed: int) -> tuple[Cells, str]:
        """Scores of one performance of every window, and of several performances of some."""
        assert row.recipe is not None
        player, runs = self.runs.player(row.recipe, seed), self.runs

        def work() -> Cells:
            return score(self.columns, player, self.excerpts, self.tools, seed=seed, threads=runs.threads)

        cells: Cells = self._cache(self.features, [player.fingerprint, seed], work)
        if self.likely:
            cells |= self._cache(
                "likelihood", [player.fingerprint], lambda: score_likelihood(player, self.excerpts, threads=runs.threads)
            )
        return cells, player.summary

    def controls(self) -> dict[str, Cells]:
        """Scores as in all tables; where rows have a likelihood, also of a predictor that knows the last pose alone."""

        def work() -> dict[str, Cells]:
            rows = {**self.excerpts.controls()}
            if self.runs.oracle is not None:
                rows[ORACLE] = Excerpts(self.runs.oracle, self.excerpts.raw).truth
            return {
                name: score_columns(self.columns, samples, samples, self.excerpts, self.tools) for name, samples in rows.items()
            }

        scores: dict[str, Cells] = self._cache(self.features, ["controls", *oracle_key(self.runs.oracle)], work)
        if not self.likely:
            return scores
        still = self._cache("likelihood", ["controls"], lambda: score_still(self.excerpts))
        motionless = {name: {"why": "it foretells motion and makes none"} for name in self.columns}
        unlikely = {name: {"why": "motion alone has no likelihood"} for name in COLUMNS}
        return {name: cells | unlikely for name, cells in scores.items()} | {STILL: motionless | still}

    def faults(self, controls: Mapping[str, Cells]) -> dict[str, list[str]]:
        """Faults of all columns except the likelihood."""
        return faults_of(controls, self.columns)

    def picture(self, table: Mapping[str, Any]) -> Pictures:
        """Poses above speech, as figure 5."""
        store, seed = self.excerpts.store, table["seeds"][0]
        clips = [clip for clip in store.clips if clip.split == "test" and "audio" in clip.has]
        entry, frames = choose_excerpt(clips, store.fps, BEFORE, AFTER)
        first, seed_frames = np.array([entry.offset + BEFORE]), self.excerpts.protocol.given
        poses = {
            name: generate_rows(
                player, self.excerpts.inputs, first, frames, [entry.speaker], seed_frames=seed_frames, seed=seed
            )[0]
            for name, player in self._players(table).items()
        }
        return draw_poses(poses, self.excerpts, entry, BEFORE)


class Latents(_Flows):
    """Where the recordings lie among the latents of a system."""

    features = "latents, mean over the frames made"

    def row(self, row: TableSystem, seed: int) -> tuple[Cells, str]:
        """Scores of the clusters of windows that do not overlap."""
        assert row.recipe is not None
        player = self.runs.player(row.recipe, seed)

        def work() -> Cells:
            return score_latents(self.columns, latents(player, self.excerpts), self.excerpts, "latents")

        return self._cache("latents", [player.fingerprint], work), player.summary

    def controls(self) -> dict[str, Cells]:
        """Scores of the mean poses themselves, and of random numbers."""

        def work() -> dict[str, Cells]:
            points = controls_of_latents(self.excerpts)
            return {name: score_latents(self.columns, p, self.excerpts, name) for name, p in points.items()}

        scores: dict[str, Cells] = self._cache("latents", ["controls"], work)
        return scores

    def faults(self, controls: Mapping[str, Cells]) -> dict[str, list[str]]:
        """None: these control rows have no order."""
        return {}

    def picture(self, table: Mapping[str, Any]) -> Pictures:
        """Latents by t-SNE, as figure 8."""
        cells = {name: row["cells"] for name, row in table["rows"].items() if row.get("cells")} | dict(table["controls"])
        return draw_latents(self._players(table), self.excerpts, cells)
