"""Excerpts: the windows of the test split in which every system of a table makes the same frames of the same speech.

    rows of a clip   … [ history, BEFORE ][ made, `made` frames ][ look-ahead, AFTER ] …
    what is scored               [ given ][ made               ]

As in the flow paper, a system is given the first poses of a window. The last ``given`` of them are scored together with those
that it makes, as in the authors' code (34 frames of 42 for TED, `GFGE cal_metrics.py`).
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from os import PathLike

import numpy as np

from ...corpora.clip import Clip
from ...corpora.samples import load_stored_clips, sample_of
from ...corpora.store import Store, gather
from ...errors import InputError
from ...metrics import Sample
from ...motion.motion import Motion
from ...motion.poses import find_pose
from ...motion.rotations import Array
from .controls import far_rows
from .inputs import StoreInputs

__all__ = ["AFTER", "BEFORE", "PROTOCOLS", "Excerpts", "Protocol", "restrict_joints"]

BEFORE, AFTER = 12, 20
"""Frames that every window has before and after those that are made: the longest history (stylised flow, TED) and the longest
look-ahead (MoGlow; stylised flow, Trinity), so that all systems make the same frames."""
MOST = 2000  # ours: most windows, evenly spread; a pass over TED's 26,245 would take hours for the same figure


@dataclass(frozen=True)
class Protocol:
    """How a corpus is cut.

    Args:
        made: frames to make.
        given: frames before them that are scored too, as published.
        stride: frames from window to window.
        apart: every so-many-th window is used where windows must not overlap.
    """

    made: int
    given: int
    stride: int
    apart: int


PROTOCOLS: dict[str, Protocol] = {
    "ted": Protocol(made=30, given=4, stride=10, apart=4),  # section 4.1; 4 given: authors' code; stride of the published data
    "trinity": Protocol(made=95, given=5, stride=20, apart=5),  # section 4.1: slices of 120 less 5 and 20; stride: ours, 1 s
}


def restrict_joints(sample: Sample, joints: tuple[str, ...]) -> Sample:
    """The sample without the joints that a representation does not move (legs, fingers): they would always be right."""
    keep = [0, *(sample.names.index(name) for name in joints if sample.names.index(name))]
    positions, rotations = sample.positions, sample.rotations
    assert positions is not None
    assert rotations is not None
    names = tuple(sample.names[k] for k in keep)
    return replace(sample, positions=positions[:, keep], rotations=rotations[:, keep], names=names)


class Excerpts:
    """The windows of a store.

    Args:
        folder: of the store.
        raw: the corpus that it was made from, for the sound; None: no sound.
        protocol: how the corpus is cut; None: as published (`PROTOCOLS`).

    Raises:
        InputError: not a store, a corpus without a protocol, or a test split that is too short.
    """

    def __init__(
        self, folder: str | PathLike[str], raw: str | PathLike[str] | None = None, protocol: Protocol | None = None
    ) -> None:
        self.store, self.raw = Store(folder), raw
        if self.store.corpus not in PROTOCOLS:
            raise InputError(f"a store of {self.store.corpus!r}", f"these tables are of {' and '.join(PROTOCOLS)}")
        self.protocol, self.pose = protocol or PROTOCOLS[self.store.corpus], find_pose(self.store.pose)
        span = BEFORE + self.protocol.made + AFTER
        numbers, offsets, counts = self.store.starts(span, "test", ("pose", "audio"))
        first = [offset + np.arange(0, count, self.protocol.stride) for offset, count in zip(offsets, counts, strict=True)]
        clips = np.repeat(numbers, [len(f) for f in first])
        self.total = len(clips)
        which = np.unique(np.linspace(0, self.total - 1, min(self.total, MOST)).round().astype(int))
        self.clips, self.starts = clips[which], np.concatenate(first)[which] + BEFORE
        if len(self) < 2:
            raise InputError(f"{len(self)} test window of {span} frames in {str(folder)!r}", "a longer test split")

    def keep_speakers(self, names: Collection[str]) -> int:
        """Leave out the windows of all other speakers; before anything else is asked. Returns their number."""
        keep = np.array([name in names for name in self.speakers()], bool)
        self.clips, self.starts = self.clips[keep], self.starts[keep]
        return int((~keep).sum())

    def __len__(self) -> int:
        return len(self.starts)

    @property
    def apart(self) -> Array:
        """Numbers of windows that do not overlap."""
        return np.arange(0, len(self), self.protocol.apart)

    def rows(self, array: str, before: int, after: int) -> Array:
        """(N, before + made + after, …) of an array of the store.

        Raises:
            InputError: more frames before or after than the windows have.
        """
        self.check_context(before, after)
        return gather(self.store.arrays[array], self.starts - before, before + self.protocol.made + after)

    @staticmethod
    def check_context(before: int, after: int) -> None:
        """Check that every window has so many frames before and after those that are made.

        Raises:
            InputError: a system needs more.
        """
        if before > BEFORE or after > AFTER:
            raise InputError(f"a history of {before} and a look-ahead of {after} frames", f"{BEFORE} and {AFTER} at most")

    @cached_property
    def inputs(self) -> StoreInputs:
        """The inputs of systems, from the store."""
        return StoreInputs(self.store)

    def speakers(self) -> list[str]:
        """(N,) who speaks."""
        return [self.store.clips[k].speaker for k in self.clips]

    @cached_property
    def _recordings(self) -> dict[str, Clip]:
        return {clip.name: clip for clip in load_stored_clips(self.store.folder, split="test", raw=self.raw)}

    def _clip(self, k: int, vectors: Array) -> Clip:
        """Window ``k`` with these poses, ``given + made`` of them."""
        entry, fps = self.store.clips[self.clips[k]], self.store.fps
        body = self.pose.decode(np.asarray(vectors, np.float64), fps)
        speech = self._recordings[entry.name].speech if self.raw is not None else None
        if speech is not None:
            start = speech.start + (self.starts[k] - self.protocol.given - entry.offset) / fps
            speech = speech.window(start, start + len(vectors) / fps)
        kind = {"motion": body} if isinstance(body, Motion) else {"points": body}
        return Clip(f"{k}", entry.speaker, self.store.corpus, speech, **kind)

    def _sample(self, clip: Clip, condition: str, name: str = "") -> Sample:
        # only metrics that hear use the track (hips and arms), and retargeting a skeleton is slow
        hears = clip.speech is not None and int(condition) % self.protocol.apart == 0
        sample = sample_of(clip, condition=condition, seed_frames=self.protocol.given, track=hears)
        joints = getattr(self.pose, "joints", None)
        sample = sample if joints is None else restrict_joints(sample, joints)
        return replace(sample, name=name or clip.name, group=self.store.clips[self.clips[int(condition)]].name)

    def samples(self, vectors: Array, which: Array | None = None, take: int = 1) -> list[Sample]:
        """Poses that a system made, behind those that it was given, as metrics see them.

        Args:
            vectors: (N, made, D) poses in the units of the store.
            which: numbers of their windows; None: all.
            take: number of the performance.
        """
        seeds = self.rows("pose", self.protocol.given, 0)[:, : self.protocol.given]
        numbers = np.arange(len(self)) if which is None else which
        clips = [self._clip(k, np.concatenate([seeds[k], poses])) for k, poses in zip(numbers, vectors, strict=True)]
        return [self._sample(clip, clip.name, f"{clip.name}.{take}") for clip in clips]

    @cached_property
    def truth(self) -> list[Sample]:
        """The recordings themselves."""
        return [self._sample(clip, clip.name) for clip in self._true_clips]

    @cached_property
    def _true_clips(self) -> list[Clip]:
        return [self._clip(k, poses) for k, poses in enumerate(self.rows("pose", self.protocol.given, 0))]

    def controls(self) -> Mapping[str, list[Sample]]:
        """The control rows, by name."""
        rows = far_rows(self._true_clips)
        return {name: [self._sample(clip, str(n)) for n, clip in enumerate(clips)] for name, clips in rows.items()}
