"""Windows of a store of PATS for which every system makes the same frames: 64 frames of the test split, one after another.

Figures are of key points in pixels, neck to right shoulder 167 px (``pose/normalize``), as the published centres are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from os import PathLike

import numpy as np

from ...corpora.clip import Clip
from ...corpora.samples import METRES, SHOULDER, load_stored_clips, sample_of
from ...corpora.store import Store, gather
from ...errors import InputError
from ...metrics import Sample, Track
from ...metrics.mode_f1 import mode_features
from ...motion.points import Points
from ...motion.poses import find_pose
from ...motion.rotations import Array
from ...training.movement_modes import find_centres

__all__ = ["FRAMES", "MODES", "MixWindows"]

FRAMES = 64  # authors' code: 4.3 s at 15 frames per second
MODES = 8  # authors' code: centres of F1, whatever the M of a network


class MixWindows:
    """The windows of a store.

    Args:
        folder: of the store.
        raw: the corpus that it was made from, for the sound; None: no sound.

    Raises:
        InputError: not a store of PATS' key points, or no test clip of so many frames.
    """

    def __init__(self, folder: str | PathLike[str], raw: str | PathLike[str] | None = None) -> None:
        self.store, self.raw = Store(folder), raw
        if self.store.pose != "keypoints2d":
            raise InputError(f"a store of {self.store.pose!r}", "these tables are of key points: prepare pats")
        self.pose = find_pose(self.store.pose)
        numbers, offsets, counts = self.store.starts(FRAMES, "test", ("pose", "audio"))
        first = [offset + np.arange(0, count, FRAMES) for offset, count in zip(offsets, counts, strict=True)]
        self.clips, self.starts = np.repeat(numbers, [len(f) for f in first]), np.concatenate(first)

    def __len__(self) -> int:
        return len(self.starts)

    def of(self, speakers: Sequence[str]) -> Array:
        """Numbers of the windows of these speakers.

        Raises:
            InputError: a speaker has none.
        """
        whose = [self.store.clips[k].speaker for k in self.clips]
        lacking = next((name for name in speakers if name not in whose), None)
        if lacking is not None:
            raise InputError(f"no test clip of {lacking!r} has {FRAMES} frames", "a longer test split")
        return np.flatnonzero([name in speakers for name in whose])

    def speaker(self, k: int) -> str:
        """Who speaks in a window."""
        return self.store.clips[self.clips[k]].speaker

    def rows(self, array: str, which: Array) -> Array:
        """(n, 64, …) of an array of the store."""
        return gather(self.store.arrays[array], self.starts[which], FRAMES)

    def body(self, vectors: Array) -> Points:
        """Poses of the store (T, D) as key points."""
        points = self.pose.decode(np.asarray(vectors, np.float64), self.store.fps)
        assert isinstance(points, Points)
        return points

    def clip(self, vectors: Array, name: str, speaker: str) -> Clip:
        """Poses of the store as a recording without sound."""
        return Clip(name, speaker, self.store.corpus, None, points=self.body(vectors))

    def samples(self, vectors: Array, which: Array) -> list[Sample]:
        """Poses for windows (n, 64, D), in the units of the store, as metrics see them."""
        clips = [self.clip(poses, str(k), self.speaker(k)) for k, poses in zip(which, vectors, strict=True)]
        return [
            replace(sample_of(clip, track=False), group=group) for clip, group in zip(clips, self.groups(which), strict=True)
        ]

    def groups(self, which: Array) -> list[str]:
        """The clip of each window: its windows are drawn together."""
        return [self.store.clips[k].name for k in self.clips[which]]

    def load_recordings(self, which: Array) -> list[Clip]:
        """The recordings of windows."""
        rows = zip(which, self.rows("pose", which), strict=True)
        return [self.clip(poses, str(k), self.speaker(k)) for k, poses in rows]

    def centres(self) -> Array:
        """(8, 240) centres of F1: of the training clips of all speakers, derived speakers (``"dan|mirror"``) left out."""
        clips = [c for c in self.store.clips if c.split == "train" and "|" not in c.speaker]
        features = []
        for entry in clips:
            points = sample_of(self.clip(self.store.clip(entry)["pose"], entry.name, entry.speaker), track=False).points
            assert points is not None
            features.append(mode_features(points))
        return find_centres(np.concatenate(features), MODES)

    # whole clips, which are heard -----------------------------------------------------------------------------------

    @cached_property
    def _sounding(self) -> dict[str, Clip]:
        return {clip.name: clip for clip in load_stored_clips(self.store.folder, split="test", raw=self.raw)}

    def load_test_clips(self, speakers: Sequence[str]) -> list[Clip]:
        """The test clips of these speakers that have speech."""
        clips = (clip for clip in self._sounding.values() if clip.speaker in speakers)
        return [clip for clip in clips if clip.speech is not None]

    def audio_of(self, name: str) -> Array:
        """(T, A) rows of a clip."""
        return np.asarray(self.store.clip(name)["audio"])

    def in_metres(self, clip: Clip) -> Sample:
        """A clip with its arms in metres, as metrics of strokes need them."""
        sample = sample_of(clip)
        track = sample.track
        assert track is not None
        scale = METRES / SHOULDER
        shrunk = Track(track.fps, track.hips * scale, track.shoulders * scale, track.elbows * scale, track.wrists * scale)
        return replace(sample, track=shrunk)
