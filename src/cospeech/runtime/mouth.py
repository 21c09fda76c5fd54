"""The mouth of a network that was trained on faces (`speech-to-face`), played for a speech that comes in pieces.

speech → rows of features (`SpeechFrontend`) → windows of the network (`SlidingWindowDecoder`) → smoothed (`PoseResampler`) →
read off at any time, linearly between the network's frames. Every number follows from its frame's index alone: a stream has the
bits of the whole.
"""

from __future__ import annotations

from functools import lru_cache
from math import floor
from pathlib import Path

import numpy as np

from ..audio.features.prosody import DELAY
from ..audio.features.shared_prosody import SharedProsody
from ..audio.speech import Speech
from ..errors import InputError
from ..motion.curves import clip
from ..motion.rotations import Array
from ..motion.skeletons.arkit import ARKIT
from ..rules.foresight import MOUTH_WAITS
from .bundles.signature import Signature
from .pose_resampler import PoseResampler
from .sliding_window_decoder import SlidingWindowDecoder
from .speech_frontend import SpeechFrontend
from .styles.space import style_space
from .styles.style import Styles
from .styles.track import StyleTrack
from .system import System, open_bundle
from .window_layout import WindowLayout

__all__ = ["POSE", "SHIPPED_FACE", "BundleMouth", "choose_layout", "open_default_mouth", "open_mouth"]

POSE = "face"
"""The representation of poses that a mouth is read from: the ARKit weights come first."""
SHIPPED_FACE = Path(__file__).parents[1] / "assets" / "bundles" / "speech-to-face.cospeech"
"""The face that comes with the package."""
_HOP = 0.5  # s made at once, and heard ahead at most; ours: half of what the face waits for anyway, and windows overlap little
_LONG_HOP = 1.0  # s made at once where a window gives the very frames of the whole speech: windows overlap even less (ours)
_SHORT_HOP = 2  # frames made at once where little may be waited for (ours)
_FRAMES_AHEAD = 8  # frames ahead of a network that normalises over its window (ours)
_LONGER = "a longer look_ahead"
_FADE = 0.1  # s of one window fading into the next, where the network hears further than that; ours


def choose_layout(signature: Signature, fps: float, waits: float | None = None) -> WindowLayout:
    """How windows lie: as much ahead as matters to the network, half a second at most; fewer windows than for motion.

    Args:
        signature: of the network.
        fps: its frames per second.
        waits: seconds of speech, from a frame's own time on, that it may wait for; as long as is good where not given.

    Raises:
        InputError: the network cannot do with so little.
    """
    usual = _choose_usual_layout(signature, fps)
    if waits is None:
        return usual
    frames = floor(waits * fps + 1e-6)
    if frames < usual.waits:
        return _choose_short_layout(signature, frames)
    if usual.fade:
        return usual
    hop = min(frames - usual.ahead, round(_LONG_HOP * fps)) // signature.multiple * signature.multiple
    hop = max(hop, usual.hop)
    return WindowLayout(2 * usual.ahead + hop, hop, usual.ahead, 0)


def _choose_usual_layout(signature: Signature, fps: float) -> WindowLayout:
    """Windows that half a second is made of at once."""
    hop = max(signature.multiple, round(_HOP * fps) // signature.multiple * signature.multiple)
    far = round(_HOP * fps)
    if signature.reach is not None and signature.reach <= far:  # exact: what one pass over the whole speech would make
        around = -(-signature.reach // signature.multiple) * signature.multiple
        return WindowLayout(2 * around + hop, hop, around, 0)
    window = -(-max(signature.window or 0, hop + far) // signature.multiple) * signature.multiple
    return WindowLayout(window, hop, far, min(round(_FADE * fps), far, hop))


def _choose_short_layout(signature: Signature, frames: int) -> WindowLayout:
    """Windows of which a frame waits for so many frames; what is not heard yet is held at what was heard last."""
    step, far = signature.multiple, signature.reach if signature.reach is not None else _FRAMES_AHEAD
    hop = -(-_SHORT_HOP // step) * step
    if frames < hop:
        raise InputError(f"the mouth's network needs {hop} frames of speech ahead, and {max(frames, 0)} are heard", _LONGER)
    far = -(-far // step) * step
    ahead = min(frames - hop, far)
    past = far if signature.reach is not None else max((signature.window or 0) - hop - far, 0)
    return WindowLayout(-(-(past + hop + far) // step) * step, hop, ahead, 0, far - ahead)


class BundleMouth:
    """The mouth of one speech; see `cospeech.face.mouth.Mouth`.

    Args:
        system: a bundle of poses "face", opened.
        style: of the mouth, as `Styles.blend` understands it; the bundle's own choice where not given.

    Raises:
        InputError: a bundle of other poses, or one that waits longer for the speech than a face can.
    """

    def __init__(self, system: System, style: object = None) -> None:
        if system.pose != POSE:
            raise InputError(
                f"a bundle of {system.pose!r} poses cannot make the mouth",
                f"take one of {POSE!r} poses, such as speech-to-face",
            )
        self._fps = system.fps
        self._frontend = SpeechFrontend(system, np.zeros(0, np.float32))
        network, space = system.networks.get("make"), style_space(system)
        if network is None or system.has_emotions:
            hint = "take one that has the network 'make' and no emotions, such as speech-to-face"
            raise InputError("this bundle cannot make the mouth", hint)
        track = StyleTrack(system, space, Styles(system, space).blend(style), [0], temperature=0.0)
        self._system, self._network, self._track = system, network, track
        needs = choose_layout(network.signature, system.fps).waits / system.fps + self._waits
        if not needs <= MOUTH_WAITS:
            raise InputError(f"the mouth's network needs {needs:.2f} s of speech ahead", f"at most {MOUTH_WAITS:.2f} s")
        self._open(choose_layout(network.signature, system.fps, MOUTH_WAITS - self._waits))
        self._first, self._weights = 0, np.zeros((0, len(ARKIT)), np.float32)  # index of the first frame kept; the frames
        self._is_over = False

    def _open(self, layout: WindowLayout) -> None:
        system = self._system
        self._decoder = SlidingWindowDecoder(
            system, self._network, self._track, [0], self._frontend.silence, layout, temperature=0.0
        )  # fmt: skip
        self._resampler = PoseResampler(1, self._decoder.width, smooth=system.smooth, step=1.0)
        self.latency = self._decoder.latency + self._waits
        """Seconds of speech after a time that have been heard, at most, when it is known."""

    @property
    def _waits(self) -> float:
        """Seconds of the latency that are not the network's."""
        return self._frontend.delay + (self._system.smooth + 2) / self._system.fps

    def limit_wait(self, seconds: float) -> None:
        """See `cospeech.face.mouth.WaitLimited`."""
        if self.latency > seconds + DELAY:
            self._open(choose_layout(self._network.signature, self._system.fps, seconds + DELAY - self._waits))

    def share(self, prosody: SharedProsody) -> None:
        """See `cospeech.face.mouth.Sharing`."""
        self._frontend.share(prosody)

    @property
    def certain_until(self) -> float:
        """See `Mouth`."""
        return np.inf if self._is_over else (self._first + len(self._weights) - 1) / self._fps

    def push(self, samples: Array) -> None:
        """See `Mouth`."""
        if len(samples):
            self._keep(self._decoder.push(self._frontend.push(Speech(samples))))

    def finish(self) -> None:
        """See `Mouth`."""
        rest = self._decoder.push(self._frontend.finish())
        rest = np.concatenate([rest, self._decoder.finish(self._frontend.silence)], 1)
        self._keep(rest, self._frontend.frames, self._frontend.frames - 1)
        self._is_over = True

    def at(self, times: Array) -> Array:
        """See `Mouth`.

        Raises:
            RuntimeError: some are not known yet.
        """
        places = np.asarray(times, float) * self._fps
        if not len(places) or (self._is_over and not len(self._weights)):
            return np.zeros((len(places), len(ARKIT)))
        if not places[-1] <= self.certain_until * self._fps + 1e-6:
            raise RuntimeError(f"the mouth is known until {self.certain_until:.3f} s, not at {times[-1]:.3f} s")
        low = np.floor(places + 1e-6).astype(int)
        share = np.maximum(places - low, 0.0)[:, None]
        here, there = (self._weights[clip(low + n - self._first, 0, len(self._weights) - 1)].astype(float) for n in (0, 1))
        count = min(int(low[0]) - self._first, len(self._weights) - 1)
        if count > 0:
            self._first, self._weights = self._first + count, self._weights[count:].copy()
        return here + share * (there - here)

    def _keep(self, rows: Array, total: int | None = None, last: int | None = None) -> None:
        """Weights of what further frames of the network make certain."""
        poses, at = self._resampler.push(rows, total, last)
        if len(at):
            weights = clip(self._decoder.denormalise(poses, at)[0, :, : len(ARKIT)], 0.0, 1.0)
            self._weights = np.concatenate([self._weights, weights.astype(np.float32)])


def open_mouth(path: Path) -> System:
    """A bundle of faces, for any number of mouths.

    Raises:
        InputError: it cannot be read, is damaged, or no mouth can be made of it.
    """
    system = open_bundle(path)
    BundleMouth(system)  # one that does not fit says so
    return system


@lru_cache(maxsize=1)
def _open_default() -> System:
    if not SHIPPED_FACE.is_file():
        raise InputError(
            f"{SHIPPED_FACE.name}, which makes the mouth, is missing from the installation", "install cospeech again"
        )
    return open_mouth(SHIPPED_FACE)


def open_default_mouth() -> BundleMouth:
    """A mouth of the face that ships.

    Raises:
        InputError: it is missing or damaged.
    """
    return BundleMouth(_open_default())
