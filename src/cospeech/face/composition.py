"""The face: speech on the lips, blinks, gaze, brows on accents and the emotion's expression, composed into 52 weights.

A pure function of time: nothing is remembered from call to call, so a stream in blocks gives what one call would give.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from ..audio.prosodic_events import Accent, Heard
from ..motion.curves import clip
from ..motion.noise import hash_normal, smooth_noise
from ..motion.rotations import Array
from ..motion.skeletons.arkit import ARKIT, ARKIT_INDEX
from ..motion.weighted_sum import add_weighted_rows
from .blinks import eyelids
from .delays import FaceDelays
from .expressions import EXPRESSIONS, IS_MOUTH, accent_brows, accent_swell
from .gaze import lids_and_looks
from .laughter import LAUGHS, laughter
from .lips import MouthEstimate, voice_to_mouth
from .visemes import MOUTH, phones_of, phones_to_mouth, snap_visemes

__all__ = ["Face"]


def _columns(*names: str) -> list[int] | slice:
    """Indices of channels; a slice where they are evenly spaced, which costs a third to read and write."""
    indices = [ARKIT_INDEX[name] for name in names]
    steps = {after - before for before, after in pairwise(indices)}
    return slice(indices[0], indices[-1] + 1, *steps) if len(steps) == 1 and min(steps) > 0 else indices


_BLINK = _columns("eyeBlinkLeft", "eyeBlinkRight")
_WIDE = _columns("eyeWideLeft", "eyeWideRight")
_SQUINT = _columns("eyeSquintLeft", "eyeSquintRight")
_SMILE = _columns("mouthSmileLeft", "mouthSmileRight")
_PRESS = _columns("mouthPressLeft", "mouthPressRight")
_BROWS_UP = _columns("browInnerUp", "browOuterUpLeft", "browOuterUpRight")
_BROWS_DOWN = _columns("browDownLeft", "browDownRight")
_JAW, _CLOSE = ARKIT_INDEX["jawOpen"], ARKIT_INDEX["mouthClose"]
_ROLL = _columns("mouthRollLower", "mouthRollUpper")
_TWO_SIDES = ("mouthStretch", "mouthSmile", "mouthLowerDown", "mouthUpperUp")
_SPREAD = np.zeros((len(MOUTH), len(ARKIT)))  # MOUTH → ARKit: both sides of those that have sides
for _row, _name in enumerate(MOUTH):
    _SPREAD[_row, _columns(*((_name + "Left", _name + "Right") if _name in _TWO_SIDES else (_name,)))] = 1.0
_PUCKER = MOUTH.index("mouthPucker")
_ROUND = slice(MOUTH.index("mouthFunnel"), _PUCKER + 1)
_SPREAD_LIPS = 0.8 * np.array(
    [name.startswith(("mouthStretch", "mouthSmile", "mouthDimple", "mouthLowerDown", "mouthUpperUp")) for name in ARKIT]
)  # [ours] shares of these channels that fully rounded lips take away
_PARTS = _columns("mouthLowerDownLeft", "mouthLowerDownRight", "mouthUpperUpLeft", "mouthUpperUpRight")
_TOUCH = (0.05, 0.09)  # [ours] jawOpen, and what else parts the lips, of lips that touch, and of lips that do not. Measured on
# voices outside the training data, where a learnt mouth closes less far than on GRID
_GENTLY = 0.2  # [ours] pressure of lips that close by the sound alone: tracked lips then touch, and hardly press
_SHUT, _AJAR = 0.05, 0.14  # jawOpen of a learnt mouth at which a dip of the sound closes the lips, and from which it does not
_OPENS = np.array(["LowerDown" in name or "UpperUp" in name or "Funnel" in name for name in ARKIT]) * 1.0
_OPENS += np.array(["noseSneer" in name or "mouthSmile" in name for name in ARKIT]) * 0.4  # both lift the upper lip
_OPENS += np.array(["Stretch" in name or "Pucker" in name for name in ARKIT]) * 0.35  # closed lips take a share of these away
_OPENS += np.array([name == "tongueOut" for name in ARKIT]) * 1.0

_PHONE_LAG = 0.025  # s: mouth shapes after the sound of their phone; ours, fitted to GRID (correlation peaks at 20–40 ms)
_WORDS_GAIN = 1.2  # jaw of words at effort 1; ours, so that jawOpen has the range of motion.md
_CALM, _SWELL, _DRIFT = 0.78, 0.24, 0.12  # an expression's course: its level, more on accents, slow wandering
_TALKS = (
    0.05,
    0.40,
)  # `MouthEstimate.active` at which a learnt mouth starts to open, and at which it counts fully: soft speech counts (ours)
_MOUTH_YIELDS = 0.40  # share of the mouth's expression given up while talking
_FRIENDLY = 0.11  # smile of a neutral speaker in pauses, at most about twice this
_SIDES, _NOISE = 5301, 9176  # stream and seed offset of the hash


class Face:
    """The face of one performance.

    Args:
        seed: which performance.
        intensity: 0 … about 2; scales the expression of emotion and, less, the articulation.
        expressiveness: 0 … about 2; scales brows, small signs and, less, the articulation.
        emphasis: 0 … about 2; how many accents move the brows, and how far.
        blink_rate: blinks per second without a cause; ends of phrases and gaze shifts add some.
        coupling: 0 … 1; how closely brows and blinks go along with the strokes of the hands.
        gains: (52,) factors of the final weights; None: all are 1.
        delays: how late those parts come that need to know the speech ahead.
    """

    def __init__(
        self,
        *,
        seed: int,
        intensity: float = 1.0,
        expressiveness: float = 1.0,
        emphasis: float = 1.0,
        blink_rate: float = 22.0 / 60,
        coupling: float = 0.0,
        gains: Array | None = None,
        delays: FaceDelays | None = None,
    ) -> None:
        self._delays = delays or FaceDelays()
        self._gains = np.ones(len(ARKIT)) if gains is None else gains
        self.seed, self.intensity, self.expressiveness, self.blink_rate = seed, intensity, expressiveness, blink_rate
        self.emphasis, self.coupling = emphasis, coupling
        self._articulation = 0.8 + 0.1 * intensity + 0.1 * expressiveness
        lean = 0.05 * hash_normal(seed, _SIDES, np.arange(len(ARKIT) // 2))  # nobody's face is quite even
        self._lean = np.ones(len(ARKIT))
        for k, name in enumerate(n for n in ARKIT if n.startswith(("mouth", "brow", "cheek", "nose")) and n.endswith("Left")):
            self._lean[ARKIT_INDEX[name]] += lean[k]
            self._lean[ARKIT_INDEX[name[:-4] + "Right"]] -= lean[k]

    def weights(
        self,
        times: Array,
        speech: Heard,
        *,
        accents: Sequence[Accent],
        words: Sequence,
        emotion: Array,
        gaze: Array | None = None,
        head_speed: Array | None = None,
        shifts: Sequence[tuple[float, float]] = (),
        spoken: Array | None = None,
        strokes: Sequence[float] | None = None,
    ) -> Array:
        """ARKit weights at ``times``.

        Args:
            times: (T,) seconds, ascending.
            speech: the speech from half a second before these times to half a second after them, or more; clipped at its ends.
            accents: those at most 1.5 s away (more do no harm).
            words: those at most 0.5 s away, and `laughter.AFTER` where they are laughter, each with ``text``, ``start`` and
                ``end``; or none.
            emotion: (T, 8) probabilities, in the order of `expressions.EXPRESSIONS`.
            gaze: (T, 2, 2) `gaze.eye_angles` of left and right eye; None: not known yet, `finish` adds it later.
            head_speed: (T,) rad/s; lids come down a little while the head turns fast.
            shifts: (time in s, size in rad) of large gaze shifts at most 0.6 s away; some come with a blink.
            spoken: (T, 52) weights of a `Mouth`; None: rules make the mouth.
            strokes: times of those accents that have a stroke of the hands; None: the hands are not known.

        Returns:
            (T, 52) in 0 … 1; without ``gaze`` before gains, with lids as for eyes that look straight ahead.
        """
        times = np.asarray(times, float)
        if not len(times):
            return np.zeros((0, len(ARKIT)))
        voice = voice_to_mouth(times, speech, late=self._delays.talking)
        drift = smooth_noise(self.seed + _NOISE, 6, times, 0.35, octaves=1)
        if spoken is None:
            shape, closure = self._speech(times, speech, voice, words)
            out, pressure = add_weighted_rows(shape, _SPREAD), closure
        else:
            out, closure, pressure = self._apply_mouth(times, speech, voice, words, spoken)
        out += self._expression(times, accents, np.asarray(emotion, float), voice.talking, drift)
        laughs = laughter(times, words)[:, None]
        out += laughs * np.maximum(LAUGHS - out, 0.0)
        _close_lips(out, closure, pressure)
        out *= self._lean
        self._brows(out, times, accents, drift, strokes)
        self._lids(out, times, speech, head_speed, shifts, strokes)
        out = clip(out, 0.0, 1.0)
        return out if gaze is None else self.finish(out, gaze)

    def finish(self, weights: Array, angles: Array) -> Array:
        """Complete a face that was made without its gaze: add the eyes, the lids that follow them, and the gains.

        Args:
            weights: (T, 52), as `weights` returns them without ``gaze``.
            angles: (T, 2, 2), see `gaze.eye_angles`.

        Returns:
            (T, 52) in 0 … 1.
        """
        return self._scale(lids_and_looks(weights, angles))

    def _speech(self, times: Array, speech: Heard, voice: MouthEstimate, words: Sequence) -> tuple[Array, Array]:
        """(T, len(MOUTH)) and (T,): the mouth's shape, and how far the lips are closed."""
        phones = phones_of(words, times[0], times[-1])
        if not len(phones.centre):
            return voice.shape * self._articulation, 0.7 * voice.closed  # no one knows whether a dip is a p or a t
        mouth = phones_to_mouth(times - _PHONE_LAG, snap_visemes(phones, speech))
        claim = mouth.claim * voice.active
        mouth.shape[:, 0] *= _WORDS_GAIN * voice.effort
        shape = claim[:, None] * mouth.shape + (1 - claim)[:, None] * voice.shape
        return shape * self._articulation, mouth.claim * mouth.closed + 0.7 * (1 - mouth.claim) * voice.closed

    def _apply_mouth(
        self, times: Array, speech: Heard, voice: MouthEstimate, words: Sequence, mouth_weights: Array
    ) -> tuple[Array, Array, Array]:
        """Weights of a learnt mouth during speech (T, 52), how far the lips are closed (T,), and how far they are pressed (T,).

        Words help where the sound tells little: the lips of m, b, p, of f and w, of o and u, the tongue of th. They never move
        the jaw. Where no word is known, a dip of the sound closes the lips if the mouth nearly closes them too. Lips that
        nearly touch close without a dip: trackers seldom report 0. A dull sound rounds the lips by rule.
        """
        talks = clip((voice.active - _TALKS[0]) / (_TALKS[1] - _TALKS[0]), 0.0, 1.0)
        shape = np.where(IS_MOUTH, clip(mouth_weights, 0.0, 1.0), 0.0) * (self._articulation * talks)[:, None]
        mouth = phones_to_mouth(times - _PHONE_LAG, snap_visemes(phones_of(words, times[0], times[-1]), speech))
        mouth.shape[:, 0] = 0.0
        word_shape = mouth.shape * (mouth.claim * voice.active * self._articulation)[:, None]
        rounding = np.minimum(word_shape[:, _ROUND].sum(1), 1.0)
        shape *= 1 - rounding[:, None] * _SPREAD_LIPS
        opening = shape[:, _JAW] + shape[:, _PARTS].mean(1)
        sound_closure = np.maximum(
            _ramp(_AJAR - shape[:, _JAW], _AJAR - _SHUT) * voice.closed, _ramp(_TOUCH[1] - opening, _TOUCH[1] - _TOUCH[0])
        )
        sound_closure *= talks
        word_closure, sound_closure = mouth.claim * mouth.closed, (1 - mouth.claim) * sound_closure
        share = voice.shape[:, _PUCKER] * self._articulation * talks * (1 - mouth.claim)
        word_shape[:, _ROUND] = np.maximum(word_shape[:, _ROUND], share[:, None] * voice.shape[:, _ROUND])
        face = np.maximum(shape, add_weighted_rows(word_shape, _SPREAD))
        return face, np.maximum(word_closure, sound_closure), np.maximum(word_closure, _GENTLY * sound_closure)

    def _scale(self, out: Array) -> Array:
        """The face after its gains; lips never close further than the jaw is open, which would push them through each other."""
        face: Array = clip(out * self._gains, 0.0, 1.0)
        face[:, _CLOSE] = np.minimum(face[:, _CLOSE], face[:, _JAW])
        return face

    def _expression(self, times: Array, accents: Sequence[Accent], emotion: Array, talking: Array, drift: Array) -> Array:
        """(T, 52) of the emotion, waxing and waning with stresses; a neutral speaker smiles a little in pauses."""
        course = clip(_CALM + _SWELL * accent_swell(times, accents, late=self._delays.swell) + _DRIFT * drift[:, 0], 0.2, 1.0)
        course *= self.intensity * (0.7 + 0.3 * self.expressiveness)
        out = add_weighted_rows(emotion * course[:, None], EXPRESSIONS)
        out *= 1 - IS_MOUTH * (_MOUTH_YIELDS * talking)[:, None]
        friendly = emotion[:, 0] * _FRIENDLY * self.expressiveness * (1 - 0.7 * talking) * clip(0.9 + 0.6 * drift[:, 1], 0, 2)
        out[:, _SMILE] += friendly[:, None]
        return out

    def _brows(
        self, out: Array, times: Array, accents: Sequence[Accent], drift: Array, strokes: Sequence[float] | None
    ) -> None:
        coupling = 0.0 if strokes is None else self.coupling
        options: dict[str, Any] = {"seed": self.seed, "amount": self.emphasis, "late": self._delays.brows}
        moves = accent_brows(times, accents, **options, strokes=strokes or (), coupling=coupling)
        moves *= self.expressiveness * (0.7 + 0.3 * self.intensity)
        down = out[:, _BROWS_DOWN].mean(1)
        share = np.maximum(1 - 1.2 * down, 0)[:, None]  # lowered brows stress by lowering further
        out[:, _BROWS_UP] += moves[:, :3] * share + 0.025 * self.expressiveness * (1 + drift[:, 2:5])
        out[:, _BROWS_DOWN] += (moves[:, 3] + 0.8 * down * moves[:, 0])[:, None]

    def _lids(
        self,
        out: Array,
        times: Array,
        speech: Heard,
        head_speed: Array | None,
        shifts: Sequence,
        strokes: Sequence[float] | None,
    ) -> None:
        lids = out[:, _BLINK]
        if head_speed is not None:
            lids = lids + 0.12 * clip((np.asarray(head_speed) - 0.8) / 2.0, 0, 1)[:, None]
        coupling = 0.0 if strokes is None else self.coupling
        causes: dict[str, Any] = {"shifts": shifts, "strokes": strokes or (), "coupling": coupling, "late": self._delays.blinks}
        shut = eyelids(times, speech, seed=self.seed, rate=self.blink_rate, **causes)[:, None]
        lids = np.minimum(np.maximum(lids, 0), 1)
        out[:, _BLINK] = lids + (1 - lids) * shut
        out[:, _WIDE] *= 1 - shut
        out[:, _SQUINT] *= 1 - 0.6 * shut


def _ramp(x: Array, top: float) -> Array:
    return clip(x / top, 0.0, 1.0)


def _close_lips(out: Array, closure: Array, pressure: Array) -> None:
    """Bring the lips together, whatever else the mouth does: mouthClose undoes as much as the jaw opens (ARKit)."""
    out *= 1 - closure[:, None] * _OPENS
    out[:, _JAW] *= 1 - 0.6 * closure
    out[:, _CLOSE] = clip(out[:, _CLOSE], closure * out[:, _JAW], out[:, _JAW])
    out[:, _PRESS] += 0.30 * pressure[:, None]
    out[:, _ROLL] += 0.16 * pressure[:, None]
