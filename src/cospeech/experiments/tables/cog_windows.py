"""The test clips of a store as Chain of Generation's tables take them: windows of 34 frames, put together again.

    rows of a clip   [ given, 4 ][ made, 30 ][ made, 30 ][ made, 30 ] …
    window 0         └──────────────────────┘
    window 1                          [given]└──────────┘              its first four poses are recorded, as in training

Every frame but the first four of a clip is made once. What is scored is whole clips: BEAT's beat alignment leaves out the first
10 s of each, and FGD's windows are 10 frames apart.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from os import PathLike

import numpy as np

from ...corpora.clip import Clip
from ...corpora.samples import load_stored_clips, sample_of
from ...corpora.store import Store
from ...errors import InputError
from ...metrics import Sample
from ...metrics.controls import control_rows
from ...motion.motion import Motion
from ...motion.poses import find_pose
from ...motion.rotations import Array
from .controls import order_apart
from .excerpts import restrict_joints
from .inputs import StoreInputs
from .runs import PlayableRun

__all__ = ["FRAMES", "GIVEN", "CogWindows"]

FRAMES, GIVEN = 34, 4  # section 4.1
STRIDE = FRAMES - GIVEN  # ours: what one window makes begins where the last one's ends
KNOWN = ("pose", "audio", "word", "face", "emotion", "semantic")
"""Arrays that a clip must have, where the store has them at all."""


class CogWindows:
    """The windows of a store.

    Args:
        folder: of the store.
        raw: the corpus that it was made from, for the sound; None: nothing is heard.

    Raises:
        InputError: poses that are no rotations, or no test clip of so many frames that has all that the store knows.
    """

    def __init__(self, folder: str | PathLike[str], raw: str | PathLike[str] | None = None) -> None:
        self.store, self.raw = Store(folder), raw
        self.pose = find_pose(self.store.pose)
        if self.pose.source != "motion":
            raise InputError(
                f"a store of {self.store.pose!r}", "these tables are of joint rotations: prepare beat --pose euler"
            )
        known = [name for name in KNOWN if name in self.store.arrays]
        numbers, offsets, counts = self.store.starts(FRAMES, "test", known)
        self.entries = tuple(self.store.clips[k] for k in numbers)
        self.windows = (counts - 1) // STRIDE + 1
        first = [offset + STRIDE * np.arange(n) for offset, n in zip(offsets, self.windows, strict=True)]
        self.starts, self._whose = np.concatenate(first), np.repeat(np.arange(len(numbers)), self.windows)
        self._inputs = StoreInputs(self.store)

    def __len__(self) -> int:
        return len(self.starts)

    @property
    def frames(self) -> Array:
        """(clips,) frames of each that are scored."""
        return np.asarray(GIVEN + STRIDE * self.windows)

    @property
    def apart(self) -> Array:
        """Numbers of the clips, none of which overlaps another."""
        return np.arange(len(self.entries))

    # what systems are given -----------------------------------------------------------------------------------------

    def arrays(self, player: PlayableRun) -> dict[str, Array]:
        """What a network of many inputs is played with, of every window.

        Raises:
            InputError: the store lacks an input of it.
        """
        return self._inputs.gather(player, self.starts, FRAMES, [self.entries[k].speaker for k in self._whose])

    def audio_of(self, k: int) -> Array:
        """(T, A) rows of the frames of a clip that are scored."""
        entry = self.entries[k]
        return np.asarray(self.store.arrays["audio"][entry.offset : entry.offset + self.frames[k]])

    def join_windows(self, made: Array, array: str) -> list[Array]:
        """Windows (N, 34, D) in the units of the store as clips (T, D), whose first four frames are the store's ``array``."""
        found = []
        for k, entry in enumerate(self.entries):
            given = self.store.arrays[array][entry.offset : entry.offset + GIVEN]
            rest = made[self._whose == k, GIVEN:]
            found.append(np.concatenate([given, rest.reshape(-1, rest.shape[-1])]))
        return found

    # what metrics see -----------------------------------------------------------------------------------------------

    @cached_property
    def recordings(self) -> list[Clip]:
        """The clips, cut to the frames that are scored."""
        named = {clip.name: clip for clip in load_stored_clips(self.store.folder, split="test", raw=self.raw)}
        found = []
        for k, entry in enumerate(self.entries):
            clip, frames = named[entry.name], int(self.frames[k])
            speech = clip.speech
            if speech is not None:
                speech = speech.window(speech.start, speech.start + frames / self.store.fps)
            assert clip.motion is not None
            found.append(replace(clip, name=str(k), motion=clip.motion[:frames], speech=speech))
        return found

    def samples(self, poses: Sequence[Array], faces: Sequence[Array] | None = None) -> list[Sample]:
        """What was made of every clip, (T, D) and (T, 52), in the units of the store."""
        found = []
        for k, vectors in enumerate(poses):
            body: Motion = self.pose.decode(np.asarray(vectors, np.float64), self.store.fps)
            face = None if faces is None else np.asarray(faces[k], np.float64)
            found.append(self._sample(replace(self.recordings[k], motion=replace(body, face=face)), str(k)))
        return found

    def _sample(self, clip: Clip, condition: str) -> Sample:
        # arms of another skeleton have to be retargeted, which is for metrics that hear alone
        sample = sample_of(clip, condition=condition, seed_frames=GIVEN, track=clip.speech is not None)
        joints = getattr(self.pose, "joints", None)
        return sample if joints is None else restrict_joints(sample, joints)

    @cached_property
    def truth(self) -> list[Sample]:
        """The recordings themselves."""
        return [self._sample(clip, clip.name) for clip in self.recordings]

    def controls(self) -> Mapping[str, list[Sample]]:
        """The control rows, by name; "another clip" is one from far away."""
        order = order_apart(len(self.recordings))
        rows, back = control_rows([self.recordings[k] for k in order]), np.argsort(order)
        return {name: [self._sample(clips[k], str(n)) for n, k in enumerate(back)] for name, clips in rows.items()}
