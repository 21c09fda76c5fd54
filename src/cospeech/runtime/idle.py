"""A character that listens and waits: the rules hear silence, and the head nods now and then.

The rules breathe, look, blink, and shift the weight in silence. All of it is drawn or hashed from a seed, so nothing repeats.
"""

from __future__ import annotations

from dataclasses import replace
from math import ceil

import numpy as np

from ..audio.features.mel import RATE
from ..audio.speech import Speech
from ..motion.motion import Motion
from ..motion.noise import hash_uniform
from ..motion.parts import PARTS
from ..motion.rotations import Array, axis_angle_to_quat, quat_multiply
from ..motion.skeleton import humanoid
from ..rules import RuleBasedModel
from ..rules.options import GenerationOptions
from ..rules.session import Session
from ..rules.stance_layer import SEATED
from ..rules.styles import STYLES, Style, find_style
from .nods import nod_curve
from .pose_transition import PoseTransition

__all__ = ["LONGEST", "TO_REST", "IdleSource", "append_idle", "find_seated_style", "nod_angles"]

LONGEST = 60.0
"""Seconds of idling at once [ours: its frames are all made before the first is given]."""
TO_REST = 1.5
"""Seconds in which hands that gesture come to rest [ours]."""

_PIECE = 0.1  # seconds of silence that are heard at once: a tick of the rules
_SLOT = 9.0  # seconds in which there is one row of nods, or none [ours: listeners nod some six times a minute]
_CHANCE = 0.75  # that there is one [ours]
_NOD = 0.42  # seconds of a nod [ours, as nods on accents in the rules]
_SIZE = (2.5, 5.5)  # degrees [ours: small nods of listeners]
_BLINKS = 15.0  # a minute, and some more as the gaze moves: people at rest blink 17 times (Bentivoglio et al. 1997)
_STREAM = 7703  # of the hash


class IdleSource:
    """Frames of somebody who does not speak, one after the other.

    Args:
        options: of the session that idles; its emotion, intensity, parts and seed count, and its style, one of the rules.
    """

    def __init__(self, options: GenerationOptions) -> None:
        self._seed, self._fps = options.seed, options.fps
        style = replace(find_style(options.style), blinks=_BLINKS)
        self._session: Session = RuleBasedModel().session(options, style=style, aimed=False)
        self._nods = "body" in options.parts
        self._pieces: list[Motion] = []
        self._frame = 0

    @property
    def session(self) -> Session:
        """The session of the rules, for its controls."""
        return self._session

    def take(self, frames: int) -> Motion:
        """The next frames; there are always some."""
        while sum(map(len, self._pieces)) < frames:
            self._pieces += self._session.push(Speech(np.zeros(round(_PIECE * RATE), np.float32), RATE))
        whole = self._pieces[0] if len(self._pieces) == 1 else Motion.concatenate(self._pieces)
        motion, rest = whole[:frames], whole[frames:]
        self._pieces = [rest] if len(rest) else []
        if self._nods:
            angles = nod_angles(self._seed, (self._frame + np.arange(frames)) / self._fps)
            rotations, head = motion.rotations.copy(), humanoid().index["head"]
            nods = axis_angle_to_quat(np.array([1.0, 0.0, 0.0]), angles)
            rotations[:, head] = quat_multiply(rotations[:, head].astype(float), nods)
            motion = replace(motion, rotations=rotations)
        self._frame += frames
        return self._session.aim(motion)


def append_idle(motion: Motion, seconds: float, *, seed: int = 0, intensity: float = 1.0) -> Motion:
    """The same motion, and so many seconds more in which the character idles: the hands come down within 1.5 s.

    Args:
        motion: on our humanoid, or on a skeleton that is recognised; the result is on our humanoid.
        seconds: 0 leaves it as it is.
        seed, intensity: of the idling.
    """
    frames = ceil(seconds * motion.fps)
    if not frames or not len(motion):
        return motion
    motion = motion if motion.skeleton.kind == "humanoid" else motion.retarget("humanoid")
    style, parts = find_seated_style(motion), ("body", "hands") if motion.face is None else PARTS
    idle = IdleSource(GenerationOptions(style=style, seed=seed, intensity=intensity, fps=motion.fps, parts=parts))
    transition = PoseTransition(motion[-2:], idle.take(min(len(motion), 2)))
    rest = transition.apply(idle.take(frames))
    return Motion.concatenate([motion, rest])


def find_seated_style(motion: Motion) -> Style | None:
    """The style in which a character goes on sitting, where it sits at the end of a motion."""
    return next(each for each in STYLES.values() if each.seated) if float(motion.root[-1, 1]) < SEATED else None


def nod_angles(seed: int, times: Array) -> Array:
    """(n,) radians by which a listener's head is lowered at ``times (n,)`` seconds; a function of time alone."""
    slot = np.floor(times / _SLOT).astype(np.int64)
    draws = hash_uniform(seed, _STREAM + np.arange(4)[:, None], slot)
    begin = (slot + 0.05 + 0.6 * draws[0]) * _SLOT
    count = 1 + np.floor(3 * draws[1])
    size = np.radians(_SIZE[0] + (_SIZE[1] - _SIZE[0]) * draws[2]) * (draws[3] < _CHANCE)
    return nod_curve(times, begin, count, size, _NOD)
