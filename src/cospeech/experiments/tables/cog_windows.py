"""The test clips of a store as Chain of Generation's tables use them: windows of 34 frames, joined to clips again.

    rows of a clip   [ given, 4 ][ made, 30 ][ made, 30 ][ made, 30 ] …
    window 0         └──────────────────────┘
    window 1                          [given]└──────────┘              its first four poses are recorded, as in training

Every frame of a clip except the first four is made once. Metrics score whole clips: BEAT's beat alignment leaves out the first
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

__all__ = ["FRAMES", "SEED_FRAMES", "CogWindows"]

FRAMES, SEED_FRAMES = 34, 4  # section 4.1
STRIDE = FRAMES - SEED_FRAMES  # ours: the frames that a window makes begin where those of the last one end
CLIP_ARRAYS = ("pose", "audio", "word", "face", "emotion", "semantic")
"""Arrays that a clip must have, as far as the store has them."""


class CogWindows:
    """The windows of a store.

    Args:
        folder: of the store.
        raw: the corpus that it was made from, for the sound; None: no sound.

    Raises:
        InputError: poses that are no rotations, or no test clip of 34 frames with all `CLIP_ARRAYS` of the store.
    """

    def __init__(self, folder: str | PathLike[str], raw: str | PathLike[str] | None = None) -> None:
        self.store, self.raw = Store(folder), raw
        self.pose = find_pose(self.store.pose)
        if self.pose.source != "motion":
            raise InputError(
                f"a store of {self.store.pose!r}", "these tables are of joint rotations: prepare beat --pose euler"
            )
        names = [name for name in CLIP_ARRAYS if name in self.store.arrays]
        numbers, offsets, counts = self.store.starts(FRAMES, "test", names)
        self.entries = tuple(self.store.clips[k] for k in numbers)
        self.windows = (counts - 1) // STRIDE + 1
        first = [offset + STRIDE * np.arange(n) for offset, n in zip(offsets, self.windows, strict=True)]
        self.starts, self._whose = np.concatenate(first), np.repeat(np.arange(len(numbers)), self.windows)
        self._inputs = StoreInputs(self.store)

    def __len__(self) -> int:
        return len(self.starts)

    @property
    def frames(self) -> Array:
        """(clips,) number of frames of each clip that are scored."""
        return np.asarray(SEED_FRAMES + STRIDE * self.windows)

    @property
    def apart(self) -> Array:
        """Numbers of the clips, none of which overlaps another."""
        return np.arange(len(self.entries))

    # what systems are given -----------------------------------------------------------------------------------------

    def arrays(self, player: PlayableRun) -> dict[str, Array]:
        """The inputs of a network of many inputs, for every window.

        Raises:
            InputError: the store lacks one of them.
        """
        return self._inputs.gather(player, self.starts, FRAMES, [self.entries[k].speaker for k in self._whose])

    def audio_of(self, k: int) -> Array:
        """(T, A) rows of the frames of a clip that are scored."""
        entry = self.entries[k]
        return np.asarray(self.store.arrays["audio"][entry.offset : entry.offset + self.frames[k]])

    def join_windows(self, windows: Array, array: str) -> list[Array]:
        """Windows (N, 34, D) in the units of the store as clips (T, D), whose first four frames are the store's ``array``."""
        clips = []
        for k, entry in enumerate(self.entries):
            seed = self.store.arrays[array][entry.offset : entry.offset + SEED_FRAMES]
            rest = windows[self._whose == k, SEED_FRAMES:]
            clips.append(np.concatenate([seed, rest.reshape(-1, rest.shape[-1])]))
        return clips

    # what metrics see -----------------------------------------------------------------------------------------------

    @cached_property
    def recordings(self) -> list[Clip]:
        """The clips, cut to the frames that are scored."""
        by_name = {clip.name: clip for clip in load_stored_clips(self.store.folder, split="test", raw=self.raw)}
        clips = []
        for k, entry in enumerate(self.entries):
            clip, frames = by_name[entry.name], int(self.frames[k])
            speech = clip.speech
            if speech is not None:
                speech = speech.window(speech.start, speech.start + frames / self.store.fps)
            assert clip.motion is not None
            clips.append(replace(clip, name=str(k), motion=clip.motion[:frames], speech=speech))
        return clips

    def samples(self, poses: Sequence[Array], faces: Sequence[Array] | None = None) -> list[Sample]:
        """Poses (T, D) and faces (T, 52) for every clip, in the units of the store, as metrics see them."""
        samples = []
        for k, vectors in enumerate(poses):
            body: Motion = self.pose.decode(np.asarray(vectors, np.float64), self.store.fps)
            face = None if faces is None else np.asarray(faces[k], np.float64)
            samples.append(self._sample(replace(self.recordings[k], motion=replace(body, face=face)), str(k)))
        return samples

    def _sample(self, clip: Clip, condition: str) -> Sample:
        # the track needs retargeting from another skeleton; only metrics that hear use it
        sample = sample_of(clip, condition=condition, seed_frames=SEED_FRAMES, track=clip.speech is not None)
        joints = getattr(self.pose, "joints", None)
        return sample if joints is None else restrict_joints(sample, joints)

    @cached_property
    def truth(self) -> list[Sample]:
        """The recordings themselves."""
        return [self._sample(clip, clip.name) for clip in self.recordings]

    def controls(self) -> Mapping[str, list[Sample]]:
        """The control rows, by name; "another clip" is a clip from far away."""
        order = order_apart(len(self.recordings))
        rows, back = control_rows([self.recordings[k] for k in order]), np.argsort(order)
        return {name: [self._sample(clips[k], str(n)) for n, k in enumerate(back)] for name, clips in rows.items()}
