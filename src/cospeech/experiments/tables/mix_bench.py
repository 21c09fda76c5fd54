"""Where rows of Mix-StAGE's tables are judged: a speaker's own style kept, and styles moved to other speakers' speech."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property, partial
from os import PathLike
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ...corpora.attributes import attributes_of, body_of
from ...corpora.clip import Clip
from ...errors import say_count
from ...metrics import Tools
from ...metrics.controls import CONTROLS, control_rows
from ...motion.rotations import Array
from .controls import ORACLE, far_rows, faults_of, oracle_key
from .mix_figures import draw_styles
from .mix_scores import NAMED, mean_cells, score_cells, score_target_style
from .mix_windows import MixWindows
from .paper_tables import Cells, PaperTable, Pictures, TableSplit, TableSystem
from .runs import CLASSIFIER, PlayableRun, Runs, of_speakers
from .scores import cache_result, cell

__all__ = ["Measured", "StylePreservation", "StyleTransfer"]


Draw = Callable[[Mapping[str, PlayableRun], MixWindows], Pictures]
"""Label → system, and the windows → picture."""


class TransferOutput(NamedTuple):
    """What was made of windows: their numbers (n,), poses (n, 64, D) in the units of the store, whose style each is in."""

    which: Array
    poses: Array
    styles: list[str]


class _Windowed:
    """What all have in common."""

    columns: tuple[str, ...]

    def __init__(
        self,
        paper_table: PaperTable,
        part: TableSplit,
        runs: Runs,
        raw: str | PathLike[str] | None,
        *,
        draw: Draw = draw_styles,
    ) -> None:
        self.paper_table, self.part, self.runs, self.draw = paper_table, part, runs, draw
        self.columns, self.data = tuple(paper_table.columns), MixWindows(runs.folder, raw)

    features = ""

    @property
    def windows(self) -> str:
        """How many, of how many frames."""
        return f"{say_count(len(self.data), 'test window')} of 64 frames, one after another"

    def _cache(self, key: Sequence[object], work: Callable[[], Any]) -> Any:
        own = (type(self).__name__, self.runs.fingerprint, self.columns, self.data.raw is not None, self.features)
        return cache_result(Path(self.runs.runs) / "scores", [*own, *key], work)

    def _player(self, row: TableSystem, speakers: tuple[str, ...], seed: int) -> PlayableRun:
        assert row.recipe is not None
        return self.runs.player(row.recipe, seed, (*row.overrides, *of_speakers(speakers)))

    def _facts(self, player: PlayableRun, runs: int) -> str:
        train = player.facts["recipe"]["train"]
        each = f", {runs} networks" if runs > 1 else ""
        return (
            f"{train['steps']} steps of {train['batch']} windows, {player.facts['config']['channels']} channels, "
            f"{player.parameters:,} parameters{each}"
        )

    def play(self, player: PlayableRun, which: Array, style: str) -> TransferOutput:
        """What a system makes of windows in a speaker's style."""
        from ..playing import play, threads

        with threads(self.runs.threads):
            made = play(player.net, player.audio(self.data.rows("audio", which)), player.style(style))
        return TransferOutput(which, player.unpose(made), [style] * len(which))

    def _label(self, row: TableSystem) -> str:
        """Of the system in the figure; of rows with one label the first is shown."""
        return row.name.partition(",")[0]

    def picture(self, table: Mapping[str, Any]) -> Pictures:
        """Of each system the network with the most speakers."""
        shown: dict[str, PlayableRun] = {}
        made = [row for row in self.part.rows if table["rows"].get(row.name, {}).get("cells")]
        for row in sorted(made, key=lambda row: -len(row.runs[0])):
            if self._label(row) not in shown:
                shown[self._label(row)] = self._player(row, row.runs[0], table["seeds"][0])
        return self.draw(shown, self.data)


class StylePreservation(_Windowed):
    """Every speaker in their own style, beside the recording: tables 1, 4, 5 and 6. Figures are plain means over speakers."""

    @cached_property
    def tools(self) -> Tools:
        """The centres of F1, of the store."""
        key = ["centres", self.runs.fingerprint]
        found = cache_result(Path(self.runs.runs) / "scores", key, lambda: self.data.centres().tolist())
        return Tools(centres=np.asarray(found))

    def _score(self, player: PlayableRun, speaker: str) -> Cells:
        which = self.data.of([speaker])
        samples = self.data.samples(self.play(player, which, speaker).poses, which)
        return self._score_samples(samples, which)

    def _score_samples(self, samples: Sequence[Any], which: Array) -> Cells:
        truth = self.data.samples(self.data.rows("pose", which), which)
        return {metric: cell(metric, samples, truth, self.tools) for metric in self.columns}

    def row(self, row: TableSystem, seed: int) -> tuple[Cells, str]:
        """The mean over the speakers that are judged."""
        judged = row.scored_speakers or tuple(name for run in row.runs for name in run)
        parts, runs = [], [run for run in row.runs if {*run} & {*judged}]
        for run in runs:
            player = self._player(row, run, seed)
            for name in (name for name in run if name in judged):
                parts.append(self._cache([player.fingerprint, name], partial(self._score, player, name)))
        return self._with_controls(mean_cells(parts), judged), self._facts(player, len(runs))

    def _with_controls(self, cells: Cells, judged: Sequence[str]) -> Cells:
        """With values of control rows over the same speakers, where those are not all: one who hardly moves is easily met."""
        if {*judged} == {*self.part.speakers}:
            return cells
        values = {name: known for name, known in self._control_rows(judged).items() if not name.startswith(ORACLE)}
        found = {
            metric: {name: known[metric]["value"] for name, known in values.items() if "value" in known[metric]}
            for metric in cells
        }
        return {metric: {**cell, "controls": found[metric]} for metric, cell in cells.items()}

    def controls(self) -> dict[str, Cells]:
        """Of all speakers of the table."""
        return self._control_rows(self.part.speakers)

    def _control_rows(self, speakers: Sequence[str]) -> dict[str, Cells]:
        """Of each speaker alone: the frozen pose is the speaker's own mean."""

        def work(speaker: str) -> dict[str, Cells]:
            which = self.data.of([speaker])
            found = {}
            for name, clips in far_rows(self.data.load_recordings(which)).items():
                vectors = np.stack([self.data.pose.encode(clip.points) for clip in clips])
                found[name] = self._score_samples(self.data.samples(vectors, which), which)
            if self._oracle is not None:
                found[ORACLE] = self._score_samples(self.data.samples(self._oracle.rows("pose", which), which), which)
            return found

        key = oracle_key(self.runs.oracle)
        each = [self._cache(["controls", name, *key], partial(work, name)) for name in speakers]
        return {name: mean_cells([cells[name] for cells in each]) for name in each[0]}

    @cached_property
    def _oracle(self) -> MixWindows | None:
        return None if self.runs.oracle is None else MixWindows(self.runs.oracle, self.data.raw)

    def faults(self, controls: Mapping[str, Cells]) -> dict[str, list[str]]:
        """Of all columns."""
        return faults_of(controls, self.columns)


class StyleTransfer(_Windowed):
    """Every speaker's speech in every other speaker's style: table 2."""

    @cached_property
    def classifier(self) -> PlayableRun:
        """Of all speakers of the store, derived speakers among them; trained where it is not there."""
        return self.runs.player(f"{CLASSIFIER}_pats")

    @property
    def features(self) -> str:  # type: ignore[override]
        """Name of the classifier."""
        return f"speaker-classifier {self.classifier.fingerprint} of {len(self.classifier.speakers)} speakers"

    def classes(self, poses: Array) -> Array:
        """(n, 64, D) in the units of the store → (n, speakers of the store) probabilities."""
        from ..playing import recognise

        return recognise(self.classifier.net, self.classifier.pose(poses))

    def transfer(self, player: PlayableRun, speakers: Sequence[str]) -> TransferOutput:
        """All windows of these speakers in the styles of all others of them."""
        parts = []
        for style in speakers:
            which = self.data.of([name for name in speakers if name != style])
            parts.append(self.play(player, which, style))
        which, poses = (np.concatenate([part[k] for part in parts]) for k in (0, 1))  # type: ignore[misc]
        return TransferOutput(which, poses, [name for part in parts for name in part.styles])

    def score(self, made: TransferOutput, speakers: Sequence[str]) -> Cells:
        """All but what is heard."""
        classes, names = self.classes(made.poses), self.classifier.speakers
        own = classes[:, [names.index(name) for name in speakers]]
        own = own / np.maximum(own.sum(1, keepdims=True), 1e-12)
        groups = [(int(clip), style) for clip, style in zip(self.data.clips[made.which], made.styles, strict=True)]
        target = np.array([[*speakers].index(style) for style in made.styles])
        return score_cells(classes, own, self.classifier.fingerprint) | score_target_style(own, target, groups)

    def _score_sound(self, clips: Sequence[Clip]) -> dict[str, Any]:
        if self.data.raw is None:
            return {"why": "a store keeps no sound; --raw names the corpus that it was made from"}
        return cell("beat_align", [self.data.in_metres(clip) for clip in clips], (), Tools())

    def _speaking(self, player: PlayableRun, speakers: Sequence[str]) -> list[Clip]:
        """Whole test clips, each in the style of the speaker after its own."""
        from ..playing import play, threads

        if self.data.raw is None:
            return []
        made = []
        for clip in self.data.load_test_clips(speakers):
            style = speakers[([*speakers].index(clip.speaker) + 1) % len(speakers)]
            with threads(self.runs.threads):
                poses = play(player.net, player.audio(self.data.audio_of(clip.name)[None]), player.style(style))
            points = self.data.clip(player.unpose(poses)[0], clip.name, style).points
            made.append(replace(clip, points=points))
        return made

    def row(self, row: TableSystem, seed: int) -> tuple[Cells, str]:
        """Of one network."""
        (speakers,) = row.runs
        player = self._player(row, speakers, seed)

        def work() -> Cells:
            cells = self.score(self.transfer(player, speakers), speakers)
            return cells | {"beat_align": self._score_sound(self._speaking(player, speakers))}

        return self._cache([player.fingerprint], work), self._facts(player, 1)

    def _score_recordings(self, speakers: Sequence[str]) -> dict[str, Cells]:
        """Control rows of a set of speakers: everyone in their own style, and beside their own speech."""
        found: dict[str, list[TransferOutput]] = {name: [] for name in CONTROLS}
        heard: dict[str, list[Clip]] = {name: [] for name in CONTROLS}
        for speaker in speakers:
            which = self.data.of([speaker])
            for name, clips in control_rows(self.data.load_recordings(which)).items():
                poses = np.stack([self.data.pose.encode(clip.points) for clip in clips])
                found[name].append(TransferOutput(which, poses, [speaker] * len(which)))
            if self.data.raw is not None:
                for name, clips in control_rows(self.data.load_test_clips([speaker])).items():
                    heard[name] += clips
        rows = {}
        for name, parts in found.items():
            which, poses = np.concatenate([p.which for p in parts]), np.concatenate([p.poses for p in parts])
            made = TransferOutput(which, poses, [style for p in parts for style in p.styles])
            rows[name] = self.score(made, speakers) | {"beat_align": self._score_sound(heard[name])}
        return rows

    def controls(self) -> dict[str, Cells]:
        """Of the largest set all, of the others the recordings alone."""
        sets = list(dict.fromkeys(row.runs[0] for row in self.part.rows))
        largest = max(sets, key=len)
        rows: dict[str, Cells] = self._cache(["controls", largest], lambda: self._score_recordings(largest))
        for speakers in sets:
            if speakers != largest:
                truth = self._cache(["controls", speakers], partial(self._score_recordings, speakers))[CONTROLS[0]]
                rows[f"{CONTROLS[0]}, {' and '.join(speakers)}"] = truth
        return rows

    def faults(self, controls: Mapping[str, Cells]) -> dict[str, list[str]]:
        """Of the largest set, and of what is a metric of its own."""
        own = {name: cells for name, cells in controls.items() if name in CONTROLS}
        return faults_of(own, [name for name in self.columns if name not in NAMED])


class Measured(_Windowed):
    """How often, how large, with which arm, turned where: in speakers' recordings, and moved to another's speech. Table 3."""

    def _label(self, row: TableSystem) -> str:
        return " and ".join(row.runs[0])

    def _measure(self, poses: Array) -> Cells:
        """Of windows (n, 64, D) in the units of the store."""
        bodies = [body_of(self.data.body(window)) for window in poses]
        found = attributes_of([body for body, _ in bodies], bodies[0][1], self.data.store.fps)
        return {name: {"value": float(getattr(found, name)), "interval": None, "note": ""} for name in self.columns}

    def row(self, row: TableSystem, seed: int) -> tuple[Cells, str]:
        """The other speakers' speech in the style of the one who is judged."""
        (speakers,), (style,) = row.runs, row.scored_speakers
        player = self._player(row, speakers, seed)

        def work() -> Cells:
            which = self.data.of([name for name in speakers if name != style])
            return self._measure(self.play(player, which, style).poses)

        return self._cache([player.fingerprint, style], work), self._facts(player, 1)

    def controls(self) -> dict[str, Cells]:
        """The recordings of each."""
        styles = dict.fromkeys(row.scored_speakers[0] for row in self.part.rows)

        def work(name: str) -> Cells:
            return self._measure(self.data.rows("pose", self.data.of([name])))

        return {f"recordings of {name}": self._cache(["controls", name], partial(work, name)) for name in styles}

    def faults(self, controls: Mapping[str, Cells]) -> dict[str, list[str]]:
        """None: nothing here is better or worse."""
        return {}
