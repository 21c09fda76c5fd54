"""Hands that come to rest while nobody speaks, for every system that is trained; ours.

A network moves the hands in silence as it does in speech, because it hears little. People do not: their hands come down within
a second of the end of a phrase (`docs/models/rules.md`). Here the voice says when: after 0.6 s without it, arms and fingers
are led from what the network makes to where the rules rest them, and back as soon as a voice is heard ahead. The trunk, which
carries the hands, is led most of the way. Head and legs stay the network's. Bundles say whether they are played so
(`cospeech.runtime.bundles.spec.BundleFacts.rests`).
"""

from __future__ import annotations

from collections import deque
from functools import cache
from math import floor, inf

import numpy as np

from ..audio.features.frames import FrameFeatures
from ..audio.features.shared_prosody import SharedProsody
from ..audio.speech import Speech
from ..motion.curves import smoothstep
from ..motion.part_joints import arm_joints
from ..motion.rotations import Array
from ..motion.skeleton import humanoid
from ..rules import RuleBasedModel
from ..rules.manner import mix_frames
from .frame_decisions import DECISION_RATE, FrameDecisions

__all__ = ["RestInSilence", "resting_pose"]

_SILENCE = 0.6  # s without a voice after which hands rest [ours: pauses inside a sentence are shorter; `motion.md` §1]
_PAUSE = round(_SILENCE * DECISION_RATE)  # decisions
_FORESIGHT = 0.5  # s that are looked ahead at most [ours: so long does it take to raise the hands]
_DOWN, _UP = 0.7, 0.5  # s in which hands come to rest, and from there [ours: an unhurried retraction takes .5 to .8 s]
_VOICE = 0.5  # voicing above which there is a voice (`cospeech.audio.features.prosody`)
_LOUD = 20.0  # dB below the loudest lately, above which there is speech without a voice: a whisper, an s [ours]
_FLOOR = -50.0  # dB; [ours] what is quieter is no speech unless it has a voice
_RELEASE = 3.0  # dB a second by which the loudest falls, as of `prosody.RELEASE`
_BLIP = 2  # decisions in four that must be speech: clicks are shorter [ours]
_TRUNK = ("spine", "chest", "upperChest")
_CALM = 0.7  # how far the trunk is led [ours: it moves a little, as somebody who breathes and shifts the weight]
_ENERGY, _VOICING = 80, 82  # columns of `cospeech.audio.features.frames.AUDIO_NAMES`


class RestInSilence:
    """Hears speech in pieces of any size, and says of each frame how far the hands are at rest.

    A frame depends on its own time, on what was before, and on ``ahead`` seconds of what follows.

    Args:
        fps: of the motion.
        waits: seconds of sound after a frame's time that are waited for anyway.
        parts: that are generated.
    """

    def __init__(self, fps: float, waits: float, parts: tuple[str, ...]) -> None:
        self._features, self._decisions = FrameFeatures(DECISION_RATE), FrameDecisions(fps)
        self._ahead = min(max(floor((waits - self._features.delay) * DECISION_RATE) - 1, 0), round(_FORESIGHT * DECISION_RATE))
        self._joints = arm_joints(parts)
        self._trunk = [humanoid().index[name] for name in _TRUNK] if "body" in parts else []
        self._loudest = -inf
        self._raw = deque[bool](maxlen=4)
        self._quiet = 0  # decisions since there was speech
        self._heard = 0  # decisions on whether there is speech
        self._place = 0.0

    @property
    def ahead(self) -> float:
        """Seconds of sound after a frame's time on which it depends."""
        return self._ahead / DECISION_RATE + self._features.delay

    def share(self, prosody: SharedProsody) -> None:
        """See `cospeech.audio.features.streaming.StreamingFeatures`."""
        self._features.share(prosody)

    def push(self, chunk: Speech) -> None:
        """Hear what comes next."""
        self._hear(self._features.push(chunk))

    def finish(self) -> None:
        """The speech is over: silence follows."""
        self._hear(self._features.finish())
        for _ in range(self._ahead + DECISION_RATE):  # of frames a little after the end, too
            self._decide(False)

    def split(self, rows: Array) -> tuple[Array, Array, Array]:
        """Poses of frames, those that were not given yet, by whether it is known if somebody speaks.

        Args:
            rows: (N, n, D) of the next frames.

        Returns:
            (N, k, D) of which it is known; the others; and (k,) how far the hands are at rest there, 0 … 1.
        """
        places = self._decisions.take(rows.shape[1])
        return rows[:, : len(places)], rows[:, len(places) :], smoothstep(places)

    def lead(self, rotations: Array, share: Array) -> Array:
        """Rotations (n, J, 4) of the frames that `split` gave the shares of, led to rest."""
        if not self._joints or not share.any():
            return rotations
        result = rotations.copy()
        for joints, most in ((self._joints, 1.0), (self._trunk, _CALM)):
            own = rotations[:, joints]
            rest = np.broadcast_to(resting_pose()[joints].astype(rotations.dtype), own.shape)
            blend = mix_frames([(own, share), (rest, most * share)])
            result[:, joints] = np.where(share[:, None, None] > 0, blend, own)
        return result

    def _hear(self, rows: Array) -> None:
        for energy, voicing in rows[:, [_ENERGY, _VOICING]].tolist():
            self._loudest = max(energy, self._loudest - _RELEASE / DECISION_RATE)
            loud = energy > max(self._loudest - _LOUD, _FLOOR)
            self._raw.append(loud or (voicing > _VOICE and energy > self._loudest - 1.5 * _LOUD))
            self._decide(sum(self._raw) >= _BLIP)

    def _decide(self, speech: bool) -> None:
        """The next decision, of ``ahead`` before this moment."""
        self._quiet = 0 if speech else self._quiet + 1
        self._heard += 1
        if self._heard <= self._ahead:
            return
        rests = self._quiet >= min(self._heard, _PAUSE)
        if not self._decisions.count:
            self._place = float(rests)
        else:
            self._place = min(max(self._place + (1 / _DOWN if rests else -1 / _UP) / DECISION_RATE, 0.0), 1.0)
        self._decisions.add(self._place)


@cache
def resting_pose() -> Array:
    """(J, 4) rotations of a body at rest in the rules' default style."""
    silence = Speech(np.zeros(8000, np.float32))
    still: Array = RuleBasedModel().generate(silence, emotion="neutral", fps=10.0, parts=("body", "hands")).rotations[-1]
    return still
