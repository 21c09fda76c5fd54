"""Scores the rows of Chain of Generation's tables: clips that are made window by window, beside the recordings."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from os import PathLike
from typing import Any

import numpy as np

from ...errors import say_count
from ...metrics import Tools
from ...motion.rotations import Array
from ..figures.lines import Lines, Series, draw_lines
from .cog_windows import SEED_FRAMES, CogWindows
from .controls import ORACLE, faults_of, oracle_key
from .figures import choose_excerpt, draw_poses
from .paper_tables import COSTS, Cells, PaperTable, Pictures, TableSplit, TableSystem, replace_minus
from .runs import PlayableRun, Runs
from .scores import ScoreCache, score_columns

__all__ = ["Chains", "Lacking", "cost_cells", "generate_clips"]


def generate_clips(player: PlayableRun, data: CogWindows, lacks: Sequence[str]) -> tuple[list[Array], list[Array] | None]:
    """Poses of every clip, in the units of the store, and faces where the system makes them and is given none.

    A network of speech alone plays each clip as a whole, in the style of its speaker.
    """
    from ..playing import play, play_inputs

    if not hasattr(player.net, "play"):
        clips = []
        for k, entry in enumerate(data.entries):
            poses = play(player.net, player.audio(data.audio_of(k)[None]), player.style(entry.speaker))
            clips.append(player.unpose(poses)[0])
        return clips, None
    windows = play_inputs(player.net, data.arrays(player), lacks)
    own = "face" in windows and "face" in lacks and "face" in data.store.arrays  # else it returns the recorded face
    faces = data.join_windows(windows["face"], "face") if own else None
    return data.join_windows(player.unpose(windows["pose"]), "pose"), faces


class Chains:
    """Tables 1, 2 and 4."""

    def __init__(self, paper_table: PaperTable, part: TableSplit, runs: Runs, raw: str | PathLike[str] | None) -> None:
        self.paper_table, self.part, self.runs = paper_table, part, runs
        self.data, self._scores = CogWindows(runs.folder, raw), ScoreCache(runs, raw)
        self.columns = tuple(name for name in paper_table.columns if name not in COSTS)

    @cached_property
    def tools(self) -> Tools:
        """The feature network; it is trained if it is missing."""
        return Tools(features=self.runs.features())

    @property
    def features(self) -> str:
        """Name of the network of FGD."""
        assert self.tools.features is not None
        return self.tools.features.name

    @property
    def windows(self) -> str:
        """The number of windows and of clips, in words."""
        windows, clips = say_count(len(self.data), "test window"), say_count(len(self.data.entries), "clip")
        return f"{windows} of 34 frames, 4 of them given, joined to {clips}"

    def _cache(self, key: Sequence[object], work: Callable[[], Any]) -> Any:
        return self._scores.find(["cog", self.columns, self.features, *key], work)

    def _player(self, row: TableSystem, seed: int) -> PlayableRun:
        assert row.recipe is not None
        return self.runs.player(row.recipe, seed, row.overrides)

    def _generate(self, player: PlayableRun, lacks: Sequence[str]) -> tuple[list[Array], list[Array] | None]:
        from ..playing import threads

        with threads(self.runs.threads):
            return generate_clips(player, self.data, lacks)

    def _cells(self, player: PlayableRun, lacks: Sequence[str]) -> Cells:
        def work() -> Cells:
            samples = self.data.samples(*self._generate(player, lacks))
            return score_columns(self.columns, samples, samples, self.data, self.tools)

        cells: Cells = self._cache([player.fingerprint, *sorted(lacks)], work)
        return cells

    def row(self, row: TableSystem, seed: int) -> tuple[Cells, str]:
        """Scores of one network, played without the inputs that the row lacks."""
        player = self._player(row, seed)
        return self._cells(player, row.lacks), player.summary

    def controls(self) -> dict[str, Cells]:
        """Scores of the control rows, as in all tables."""

        def work() -> dict[str, Cells]:
            rows = {**self.data.controls()}
            if self.runs.oracle is not None:
                rows[ORACLE] = CogWindows(self.runs.oracle, self.data.raw).truth
            return {
                name: score_columns(self.columns, samples, samples, self.data, self.tools) for name, samples in rows.items()
            }

        cells: dict[str, Cells] = self._cache(["controls", *oracle_key(self.runs.oracle)], work)
        return cells

    def faults(self, controls: Mapping[str, Cells]) -> dict[str, list[str]]:
        """Faults of all columns that are metrics."""
        return faults_of(controls, self.columns)

    def picture(self, table: Mapping[str, Any]) -> Pictures:
        """Poses above speech, as figure 3."""
        entry, frames = choose_excerpt(self.data.entries, self.data.store.fps, SEED_FRAMES, 0)
        k, strips = self.data.entries.index(entry), {}
        for row in self.part.rows:
            if table["rows"][row.name].get("cells"):
                poses, _ = self._generate(self._player(row, table["seeds"][0]), row.lacks)
                strips[replace_minus(row.name)] = poses[k][SEED_FRAMES : SEED_FRAMES + frames]
        return draw_poses(strips, self.data, entry, SEED_FRAMES)


def cost_cells(cells: Cells, whole: Cells) -> Cells:
    """`COSTS` of a row, from its cells and from those of the same network with all inputs."""
    costs: Cells = {}
    for name, (metric, sign) in COSTS.items():
        lacking = next((side[metric] for side in (cells, whole) if "value" not in side[metric]), None)
        if lacking is not None:
            costs[name] = lacking
        else:
            value = sign * (cells[metric]["value"] - whole[metric]["value"])
            costs[name] = {"value": value, "interval": None, "note": ""}
            draws = [side[metric].get("draws") or [] for side in (cells, whole)]
            if draws[0] and len(draws[0]) == len(draws[1]):
                costs[name]["draws"] = (sign * np.subtract(draws[0], draws[1])).tolist()
    return costs


class Lacking(Chains):
    """Figure 1: one network with all of its inputs, and without some."""

    def row(self, row: TableSystem, seed: int) -> tuple[Cells, str]:
        """Scores of a row, and by how much they are worse than with all inputs."""
        cells, facts = super().row(row, seed)
        return cells | cost_cells(cells, self._cells(self._player(row, seed), ())), facts

    def controls(self) -> dict[str, Cells]:
        """Scores of the control rows; they have no `COSTS`."""
        why = {name: {"why": "a control row has no inputs"} for name in COSTS}
        return {name: cells | why for name, cells in super().controls().items()}

    def picture(self, table: Mapping[str, Any]) -> Pictures:
        """FGD and SRGR against the missing input, a line for each system, as figure 1."""
        systems: dict[str, list[str]] = {}
        for name, row in table["rows"].items():
            if row.get("cells"):
                systems.setdefault(name.partition(": ")[0], []).append(name)
        panels = []
        for metric, title in (("fgd", "FGD, lower is better"), ("srgr_beat", "SRGR, higher is better")):
            series = []
            for system, names in systems.items():
                cells = [table["rows"][name]["cells"][metric] for name in names]
                pairs = [
                    (replace_minus(name.partition(": ")[2]), cell)
                    for name, cell in zip(names, cells, strict=True)
                    if "mean" in cell
                ]
                halves = np.array([cell["half"] or 0.0 for _, cell in pairs])
                series.append(Series(system, [name for name, _ in pairs], np.array([c["mean"] for _, c in pairs]), halves))
            panels.append(Lines(title, series))
        return draw_lines(panels)
