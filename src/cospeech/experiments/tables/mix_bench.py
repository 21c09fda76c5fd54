"""Scores the rows of Mix-StAGE's tables: speakers in their own style, and styles transferred to the speech of others."""

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
from ...metrics import Score, Tools
from ...metrics.controls import CONTROLS, control_rows
from ...metrics.interval import SCORE_DRAWS, Resampled, draw_groups
from ...motion.rotations import Array
from .controls import ORACLE, far_rows, faults_of, oracle_key
from .mix_figures import draw_styles
from .mix_scores import OWN_COLUMNS, attach_controls, mean_cells, score_cells, score_target_style
from .mix_windows import MixWindows
from .paper_tables import Cells, PaperTable, Pictures, TableSplit, TableSystem
from .runs import CLASSIFIER, PlayableRun, Runs, of_speakers
from .scores import ScoreCache, as_cell, cache_result, cell

__all__ = ["Measured", "StylePreservation", "StyleTransfer"]


Draw = Callable[[Mapping[str, PlayableRun], MixWindows], Pictures]
"""(label → system, windows) → picture."""


class TransferOutput(NamedTuple):
    """Motion for windows: their numbers (n,), poses (n, 64, D) in the units of the store, and the speaker of each style."""

    which: Array
    poses: Array
    styles: list[str]


class _Windowed:
    """What all benches have in common."""

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
        self._scores = ScoreCache(runs, raw)

    features = ""

    @property
    def windows(self) -> str:
        """The number of windows and of their frames, in words."""
        return f"{say_count(len(self.data), 'test window')} of 64 frames, one after another"

    def _cache(self, key: Sequence[object], work: Callable[[], Any]) -> Any:
        return self._scores.find([type(self).__name__, self.columns, self.features, *key], work)

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
        """Motion of a system for windows, in the style of a speaker."""
        from ..playing import play, threads

        with threads(self.runs.threads):
            poses = play(player.net, player.audio(self.data.rows("audio", which)), player.style(style))
        return TransferOutput(which, player.unpose(poses), [style] * len(which))

    def _label(self, row: TableSystem) -> str:
        """Label of the system in the figure; of rows with the same label, the first is shown."""
        return row.name.partition(",")[0]

    def picture(self, table: Mapping[str, Any]) -> Pictures:
        """The figure: for each system, the network with the most speakers."""
        players: dict[str, PlayableRun] = {}
        rows = [row for row in self.part.rows if table["rows"].get(row.name, {}).get("cells")]
        for row in sorted(rows, key=lambda row: -len(row.runs[0])):
            if self._label(row) not in players:
                players[self._label(row)] = self._player(row, row.runs[0], table["seeds"][0])
        return self.draw(players, self.data)


class StylePreservation(_Windowed):
    """Every speaker in the own style, beside the recording: tables 1, 4, 5 and 6. Figures are plain means over speakers."""

    @cached_property
    def tools(self) -> Tools:
        """The centres of F1, from the store."""
        key = ["centres", self.runs.fingerprint]
        centres = cache_result(Path(self.runs.runs) / "scores", key, lambda: self.data.centres().tolist())
        return Tools(centres=np.asarray(centres))

    def _score(self, player: PlayableRun, speaker: str) -> Cells:
        which = self.data.of([speaker])
        samples = self.data.samples(self.play(player, which, speaker).poses, which)
        return self._score_samples(samples, which)

    def _score_samples(self, samples: Sequence[Any], which: Array) -> Cells:
        truth = self.data.samples(self.data.rows("pose", which), which)
        return {metric: cell(metric, samples, truth, self.tools) for metric in self.columns}

    def row(self, row: TableSystem, seed: int) -> tuple[Cells, str]:
        """Scores of a row: the mean over the speakers that are scored."""
        speakers = row.scored_speakers or tuple(name for run in row.runs for name in run)
        parts, runs = [], [run for run in row.runs if {*run} & {*speakers}]
        for run in runs:
            player = self._player(row, run, seed)
            for name in (name for name in run if name in speakers):
                parts.append(self._cache([player.fingerprint, name], partial(self._score, player, name)))
        return self._with_controls(mean_cells(parts), speakers), self._facts(player, len(runs))

    def _with_controls(self, cells: Cells, speakers: Sequence[str]) -> Cells:
        """Cells with the values of control rows over the same speakers, unless these are all: one who hardly moves is easy."""
        if {*speakers} == {*self.part.speakers}:
            return cells
        rows = {name: control for name, control in self._control_rows(speakers).items() if not name.startswith(ORACLE)}
        return attach_controls(cells, rows)

    def controls(self) -> dict[str, Cells]:
        """Scores of the control rows over all speakers of the table."""
        return self._control_rows(self.part.speakers)

    def _control_rows(self, speakers: Sequence[str]) -> dict[str, Cells]:
        """Means over the control rows of each speaker alone: the frozen pose is the speaker's own mean."""

        def work(speaker: str) -> dict[str, Cells]:
            which = self.data.of([speaker])
            rows = {}
            for name, clips in far_rows(self.data.load_recordings(which)).items():
                vectors = np.stack([self.data.pose.encode(clip.points) for clip in clips])
                rows[name] = self._score_samples(self.data.samples(vectors, which), which)
            if self._oracle is not None:
                rows[ORACLE] = self._score_samples(self.data.samples(self._oracle.rows("pose", which), which), which)
            return rows

        key = oracle_key(self.runs.oracle)
        each = [self._cache(["controls", name, *key], partial(work, name)) for name in speakers]
        return {name: mean_cells([cells[name] for cells in each]) for name in each[0]}

    @cached_property
    def _oracle(self) -> MixWindows | None:
        return None if self.runs.oracle is None else MixWindows(self.runs.oracle, self.data.raw)

    def faults(self, controls: Mapping[str, Cells]) -> dict[str, list[str]]:
        """Faults of all columns."""
        return faults_of(controls, self.columns)


class StyleTransfer(_Windowed):
    """The speech of every speaker in the style of every other: table 2."""

    @cached_property
    def classifier(self) -> PlayableRun:
        """The classifier of all speakers of the store, derived ones among them; it is trained if it is missing."""
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
        """All windows of these speakers, in the styles of all others of them."""
        parts = []
        for style in speakers:
            which = self.data.of([name for name in speakers if name != style])
            parts.append(self.play(player, which, style))
        which, poses = (np.concatenate([part[k] for part in parts]) for k in (0, 1))  # type: ignore[misc]
        return TransferOutput(which, poses, [name for part in parts for name in part.styles])

    def score(self, output: TransferOutput, speakers: Sequence[str]) -> Cells:
        """Scores without those of metrics that hear."""
        classes, names = self.classes(output.poses), self.classifier.speakers
        own = classes[:, [names.index(name) for name in speakers]]
        own = own / np.maximum(own.sum(1, keepdims=True), 1e-12)
        clips = self.data.groups(output.which)
        target = np.array([[*speakers].index(style) for style in output.styles])
        performances = list(zip(clips, output.styles, strict=True))
        return score_cells(classes, own, self.classifier.fingerprint, clips) | score_target_style(own, target, performances)

    def _score_sound(self, clips: Sequence[Clip]) -> dict[str, Any]:
        if self.data.raw is None:
            return {"why": "a store keeps no sound; --raw names the corpus that it was made from"}
        return cell("beat_align", [self.data.in_metres(clip) for clip in clips], (), Tools())

    def _speaking(self, player: PlayableRun, speakers: Sequence[str]) -> list[Clip]:
        """Whole test clips, each in the style of the next speaker."""
        from ..playing import play, threads

        if self.data.raw is None:
            return []
        clips = []
        for clip in self.data.load_test_clips(speakers):
            style = speakers[([*speakers].index(clip.speaker) + 1) % len(speakers)]
            with threads(self.runs.threads):
                poses = play(player.net, player.audio(self.data.audio_of(clip.name)[None]), player.style(style))
            points = self.data.clip(player.unpose(poses)[0], clip.name, style).points
            clips.append(replace(clip, points=points))
        return clips

    def row(self, row: TableSystem, seed: int) -> tuple[Cells, str]:
        """Scores of one network."""
        (speakers,) = row.runs
        player = self._player(row, speakers, seed)

        def work() -> Cells:
            cells = self.score(self.transfer(player, speakers), speakers)
            return cells | {"beat_align": self._score_sound(self._speaking(player, speakers))}

        cells: Cells = self._cache([player.fingerprint], work)
        return self._with_controls(cells, speakers), self._facts(player, 1)

    def _with_controls(self, cells: Cells, speakers: Sequence[str]) -> Cells:
        """Cells with the values of control rows of the same speakers, unless these are the largest set: fewer are easier."""
        if speakers == self._largest:
            return cells
        return attach_controls(cells, self._cache(["controls", speakers], partial(self._score_recordings, speakers)))

    @property
    def _largest(self) -> tuple[str, ...]:
        return max((row.runs[0] for row in self.part.rows), key=len)

    def _score_recordings(self, speakers: Sequence[str]) -> dict[str, Cells]:
        """Scores of the control rows of a set of speakers, each in the own style and beside the own speech."""
        outputs: dict[str, list[TransferOutput]] = {name: [] for name in CONTROLS}
        sounds: dict[str, list[Clip]] = {name: [] for name in CONTROLS}
        for speaker in speakers:
            which = self.data.of([speaker])
            for name, clips in control_rows(self.data.load_recordings(which)).items():
                poses = np.stack([self.data.pose.encode(clip.points) for clip in clips])
                outputs[name].append(TransferOutput(which, poses, [speaker] * len(which)))
            if self.data.raw is not None:
                for name, clips in control_rows(self.data.load_test_clips([speaker])).items():
                    sounds[name] += clips
        rows = {}
        for name, parts in outputs.items():
            which, poses = np.concatenate([p.which for p in parts]), np.concatenate([p.poses for p in parts])
            output = TransferOutput(which, poses, [style for p in parts for style in p.styles])
            rows[name] = self.score(output, speakers) | {"beat_align": self._score_sound(sounds[name])}
        return rows

    def controls(self) -> dict[str, Cells]:
        """Scores of all control rows of the largest set; of the other sets, those of the recordings alone."""
        sets = list(dict.fromkeys(row.runs[0] for row in self.part.rows))
        largest = self._largest
        rows: dict[str, Cells] = self._cache(["controls", largest], lambda: self._score_recordings(largest))
        for speakers in sets:
            if speakers != largest:
                truth = self._cache(["controls", speakers], partial(self._score_recordings, speakers))[CONTROLS[0]]
                rows[f"{CONTROLS[0]}, {' and '.join(speakers)}"] = truth
        return rows

    def faults(self, controls: Mapping[str, Cells]) -> dict[str, list[str]]:
        """Faults on the largest set, of the columns that are metrics."""
        own = {name: cells for name, cells in controls.items() if name in CONTROLS}
        return faults_of(own, [name for name in self.columns if name not in OWN_COLUMNS])


class Measured(_Windowed):
    """Gesture rate, amplitude, arm and orientation, in recordings and in styles transferred to other speech: table 3."""

    def _label(self, row: TableSystem) -> str:
        return " and ".join(row.runs[0])

    def _measure(self, poses: Array, which: Array) -> Cells:
        """Attributes of windows (n, 64, D) in the units of the store; ``which`` are their numbers."""
        bodies = [body_of(self.data.body(window)) for window in poses]

        def measure(rows: Array) -> list[float]:
            attributes = attributes_of([bodies[k][0] for k in rows], bodies[0][1], self.data.store.fps)
            return [float(getattr(attributes, name)) for name in self.columns]

        values = measure(np.arange(len(bodies)))
        draws = [measure(rows) for rows in draw_groups(self.data.groups(which), draws=SCORE_DRAWS)]
        resamples = [Resampled.of(np.array(own)) for own in zip(*draws, strict=True)] or [Resampled()] * len(values)
        return {
            name: as_cell(Score(value, own.interval, len(bodies), draws=own.draws))
            for name, value, own in zip(self.columns, values, resamples, strict=True)
        }

    def row(self, row: TableSystem, seed: int) -> tuple[Cells, str]:
        """Attributes of the other speakers' speech in the style of the speaker that is scored."""
        (speakers,), (style,) = row.runs, row.scored_speakers
        player = self._player(row, speakers, seed)

        def work() -> Cells:
            which = self.data.of([name for name in speakers if name != style])
            output = self.play(player, which, style)
            return self._measure(output.poses, output.which)

        return self._cache([player.fingerprint, style], work), self._facts(player, 1)

    def controls(self) -> dict[str, Cells]:
        """Attributes of the recordings of each speaker."""
        styles = dict.fromkeys(row.scored_speakers[0] for row in self.part.rows)

        def work(name: str) -> Cells:
            which = self.data.of([name])
            return self._measure(self.data.rows("pose", which), which)

        return {f"recordings of {name}": self._cache(["controls", name], partial(work, name)) for name in styles}

    def faults(self, controls: Mapping[str, Cells]) -> dict[str, list[str]]:
        """None: nothing here is better or worse."""
        return {}
