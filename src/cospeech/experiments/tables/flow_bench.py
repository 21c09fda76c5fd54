"""Where rows of the flow paper's tables are judged: performances of windows (tables 1 and 2), latents of windows (table 3)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from ...metrics import Tools
from ...motion.rotations import Array
from .controls import ORACLE, check_oracle, faults_of, oracle_key
from .excerpts import AFTER, BEFORE, Excerpts
from .figures import choose_excerpt, draw_latents, draw_poses
from .paper_tables import Cells, PaperTable, Pictures, TableSplit, TableSystem
from .played_windows import NEW, play_windows, plays_windows
from .runs import PlayableRun, Runs
from .scores import cache_result, controls_of_latents, latents, score, score_columns, score_latents

__all__ = ["Latents", "Performances"]


def _facts(player: PlayableRun) -> str:
    """What a row was trained with, in a line."""
    config, train = player.facts["config"], player.facts["recipe"]["train"]
    flow = f"K {config['steps']}, " if "steps" in config else ""
    width = next(f"{config[name]} {what}, " for name, what in (("hidden", "units"), ("channels", "channels")) if name in config)
    return f"{train['steps']} steps of {train['batch']} windows, {flow}{width}{player.parameters:,} parameters"


def _join(windows: Array, starts: Array, frames: int) -> Array:
    """(N, `NEW`, D) windows → (frames, D), each from its start on; the last one ends with the frames."""
    made = np.zeros((frames, windows.shape[2]), windows.dtype)
    for start, window in zip(starts, windows, strict=True):
        end = min(start + NEW, frames)
        made[start:end] = window[start - end :]
    return made


class _Flows:
    """What both have in common."""

    def __init__(self, paper_table: PaperTable, part: TableSplit, runs: Runs, raw: str | PathLike[str] | None) -> None:
        self.paper_table, self.runs = paper_table, runs
        self.columns, self.excerpts = tuple(paper_table.columns), Excerpts(runs.folder, raw)

    @property
    def windows(self) -> str:
        """How many, of how many frames."""
        count, total = len(self.excerpts), self.excerpts.total
        return f"{count}{f' of {total}' if total > count else ''} test windows of {self.excerpts.protocol.made} frames"

    def _cache(self, name: str, key: Sequence[object], work: Callable[[], Any]) -> Any:
        own = (
            self.paper_table.name,
            self.runs.fingerprint,
            self.excerpts.protocol,
            self.columns,
            name,
            self.excerpts.raw is not None,
        )
        return cache_result(Path(self.runs.runs) / "scores", [*own, *key], work)

    def _players(self, table: Mapping[str, Any]) -> dict[str, PlayableRun]:
        """Of each row the run with the first seed."""
        rows = {name: row["recipe"] for name, row in table["rows"].items() if row.get("cells")}
        return {name: self.runs.player(recipe, table["seeds"][0]) for name, recipe in rows.items()}


class Performances(_Flows):
    """Motion that is made of every window, beside the recordings."""

    @cached_property
    def tools(self) -> Tools:
        """The feature network, trained where it is not there."""
        return Tools(features=self.runs.features())

    @property
    def features(self) -> str:
        """Name of the network of FGD."""
        assert self.tools.features is not None
        return self.tools.features.name

    def row(self, row: TableSystem, seed: int) -> tuple[Cells, str]:
        """One performance of every window, and several of some."""
        assert row.recipe is not None
        player, runs = self.runs.player(row.recipe, seed), self.runs

        def work() -> Cells:
            return score(self.columns, player, self.excerpts, self.tools, seed=seed, threads=runs.threads)

        return self._cache(self.features, [player.fingerprint, seed], work), _facts(player)

    def controls(self) -> dict[str, Cells]:
        """As in all tables."""

        def work() -> dict[str, Cells]:
            rows = {**self.excerpts.controls()}
            if self.runs.oracle is not None:
                other = Excerpts(self.runs.oracle, self.excerpts.raw)
                check_oracle(self.excerpts.store, other.store)
                rows[ORACLE] = other.truth
            return {
                name: score_columns(self.columns, samples, samples, self.excerpts, self.tools) for name, samples in rows.items()
            }

        found: dict[str, Cells] = self._cache(self.features, ["controls", *oracle_key(self.runs.oracle)], work)
        return found

    def faults(self, controls: Mapping[str, Cells]) -> dict[str, list[str]]:
        """Of all columns."""
        return faults_of(controls, self.columns)

    def picture(self, table: Mapping[str, Any]) -> Pictures:
        """Poses above speech, as figure 5."""
        from ..playing import perform

        store, made = self.excerpts.store, {}
        clips = [clip for clip in store.clips if clip.split == "test" and "audio" in clip.has]
        entry, frames = choose_excerpt(clips, store.fps, BEFORE, AFTER)
        first = entry.offset + BEFORE
        for label, player in self._players(table).items():
            if plays_windows(player):
                starts = first + np.arange(0, frames, NEW)
                windows = play_windows(player, store, np.minimum(starts, first + frames - NEW), NEW, seed=table["seeds"][0])
                made[label] = _join(windows, starts - first, frames)
                continue
            before, after = player.context
            history = player.pose(np.asarray(store.arrays["pose"][first - before : first])[None])
            heard = player.audio(np.asarray(store.arrays["audio"][first - before : first + frames + after])[None])
            made[label] = player.unpose(perform(player.net, history, heard, seed=table["seeds"][0]))[0]
        return draw_poses(made, self.excerpts, entry, BEFORE)


class Latents(_Flows):
    """Where the recordings lie in a system's latents."""

    features = "latents, mean over the frames made"

    def row(self, row: TableSystem, seed: int) -> tuple[Cells, str]:
        """Clusters of windows that do not overlap."""
        assert row.recipe is not None
        player = self.runs.player(row.recipe, seed)

        def work() -> Cells:
            return score_latents(self.columns, latents(player, self.excerpts), self.excerpts, "latents")

        return self._cache("latents", [player.fingerprint], work), _facts(player)

    def controls(self) -> dict[str, Cells]:
        """Mean poses themselves, and numbers that know nothing."""

        def work() -> dict[str, Cells]:
            points = controls_of_latents(self.excerpts)
            return {name: score_latents(self.columns, p, self.excerpts, name) for name, p in points.items()}

        found: dict[str, Cells] = self._cache("latents", ["controls"], work)
        return found

    def faults(self, controls: Mapping[str, Cells]) -> dict[str, list[str]]:
        """None: these rows are no order."""
        return {}

    def picture(self, table: Mapping[str, Any]) -> Pictures:
        """Latents by t-SNE, as figure 8."""
        cells = {name: row["cells"] for name, row in table["rows"].items() if row.get("cells")} | dict(table["controls"])
        return draw_latents(self._players(table), self.excerpts, cells)
