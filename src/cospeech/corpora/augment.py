"""More clips out of one: left and right exchanged, spoken faster or slower, spoken higher or lower."""

from __future__ import annotations

import re
from dataclasses import replace
from fractions import Fraction
from typing import TypeVar

import numpy as np

from ..audio.speech import Speech, Word
from ..errors import InputError
from ..motion.motion import Motion
from ..motion.points import Points
from ..motion.rotations import Array
from ..motion.skeleton import Skeleton
from ..motion.skeletons.arkit import ARKIT_MIRROR
from .clip import Clip, Semantic

__all__ = ["faster", "mirror_clip", "mirror_motion", "mirror_points", "shift_pitch"]

_SIDE = re.compile(r"(left|right)(?=[A-Z_.]|$)|Left|Right|_[lr](?=_|$)")
_SWAP = {"left": "right", "right": "left", "Left": "Right", "Right": "Left", "_l": "_r", "_r": "_l"}
_TED = (0, 1, 2, 3, 7, 8, 9, 4, 5, 6)  # ted: left arm 4–6, right arm 7–9
_PATS = (0, 4, 5, 6, 1, 2, 3, 7, 9, 8, *range(31, 52), *range(10, 31))  # pats: arms, eyes, hands
_POINTS = {"ted": _TED, "pats": _PATS}
_Timed = TypeVar("_Timed", Word, Semantic)
_WINDOW = 1024  # samples, 64 ms at 16 kHz; ours: some pitch periods of any voice, short against a syllable


def mirror_clip(clip: Clip) -> Clip:
    """Left and right exchanged, body and face; the speaker is another one then: ``"oliver|mirror"``, as PATS names them.

    Unlike PATS's own transform, which turns x around and leaves the right arm's name on the left, joints change places too.

    Raises:
        InputError: a skeleton without left and right, or key points of an unknown layout.
    """
    return replace(
        clip,
        name=f"{clip.name}|mirror",
        speaker=f"{clip.speaker}|mirror",
        motion=None if clip.motion is None else mirror_motion(clip.motion),
        points=None if clip.points is None else mirror_points(clip.points),
        face=None if clip.face is None else clip.face[:, list(ARKIT_MIRROR)],
    )


def mirror_motion(motion: Motion) -> Motion:
    """On the mirrored skeleton, so that joint positions are exactly those of a mirror at x = 0."""
    skeleton = motion.skeleton
    other = [_opposite(skeleton, name) for name in skeleton.names]
    if other == list(range(len(other))):
        raise InputError(f"a skeleton without left and right: {', '.join(skeleton.names[:6])}, …", "leave mirroring out")
    parents = tuple(skeleton.parents[k] for k in other)
    if tuple(other[p] if p >= 0 else -1 for p in parents) != skeleton.parents:
        raise InputError("a skeleton whose left and right have different joints", "leave mirroring out")
    flip = np.array([1, -1, -1, 1])
    twin = Skeleton(
        skeleton.names, skeleton.parents, skeleton.offsets[other] * (-1, 1, 1), skeleton.rest[other] * flip,
        {skeleton.names[_opposite(skeleton, name)]: (-x, y, z) for name, (x, y, z) in skeleton.ends.items()}, skeleton.kind,
    )  # fmt: skip
    return replace(
        motion,
        rotations=motion.rotations[:, other] * flip.astype(motion.rotations.dtype),
        root=motion.root * np.array([-1, 1, 1], motion.root.dtype),
        face=None if motion.face is None else motion.face[:, list(ARKIT_MIRROR)],
        skeleton=twin,
    )


def _opposite(skeleton: Skeleton, name: str) -> int:
    return skeleton.index.get(_SIDE.sub(lambda match: _SWAP[match[0]], name, count=1), skeleton.index[name])


def mirror_points(points: Points) -> Points:
    """x turned around, left and right joints exchanged."""
    if points.layout not in _POINTS:
        raise InputError(f"key points of layout {points.layout!r} have no known left and right")
    values = points.values[:, list(_POINTS[points.layout])].copy()
    values[..., 0] *= -1
    return replace(points, values=values)


def faster(clip: Clip, factor: float) -> Clip:
    """Everything played ``factor`` times as fast, the voice like a tape: its pitch rises with it."""
    _check(factor, "times as fast")
    _check_sound(clip)
    motion, points, speech = clip.motion, clip.points, clip.speech

    def hasten(entries: tuple[_Timed, ...]) -> tuple[_Timed, ...]:
        return tuple(replace(each, start=each.start / factor, end=each.end / factor) for each in entries)

    if speech is not None:
        words = speech.words and hasten(speech.words)
        rate = Fraction(factor).limit_denominator(1000) * speech.rate
        samples = _resample(speech.samples, float(rate), speech.rate)
        speech = Speech(samples, speech.rate, words, name=speech.name)
    semantics = clip.semantics
    if semantics is not None:
        semantics = hasten(semantics)
    extra, words_alone = dict(clip.extra), clip.extra.get("words")
    if isinstance(words_alone, tuple):  # of a clip without sound
        extra["words"] = hasten(words_alone)
    return replace(
        clip,
        name=f"{clip.name}|x{factor:g}",
        extra=extra,
        speech=speech,
        motion=None if motion is None else replace(motion, fps=motion.fps * factor),
        points=None if points is None else replace(points, fps=points.fps * factor),
        face_fps=None if clip.face_fps is None else clip.face_fps * factor,
        semantics=semantics,
    )


def shift_pitch(clip: Clip, semitones: float) -> Clip:
    """The voice higher (or lower) by so many semitones, at the same speed; nothing else changes."""
    factor = 2 ** (semitones / 12)
    _check(factor, f"higher ({semitones:g} semitones)")
    _check_sound(clip)
    if clip.speech is None:
        raise InputError(f"{clip.name!r} has no speech to shift", "leave pitches out")
    longer = _stretch(clip.speech.samples.astype(np.float64), factor)
    samples = _resample(longer.astype(np.float32), clip.speech.rate * factor, clip.speech.rate)
    count = len(clip.speech.samples)
    samples = np.pad(samples, (0, max(count - len(samples), 0)))[:count]
    return replace(clip, name=f"{clip.name}|{semitones:+g}st", speech=replace(clip.speech, samples=samples))


def _check(factor: float, what: str) -> None:
    if not (np.isfinite(factor) and 0.5 <= factor <= 2):
        raise InputError(f"{factor:g} times {what}", "0.5 … 2")


def _check_sound(clip: Clip) -> None:
    """Spectra that come with the data (PATS) cannot be changed with the voice."""
    if any(name.startswith("audio/") for name in clip.extra):
        raise InputError(f"{clip.name!r} has ready-made spectra, whose tempo and pitch cannot be changed", "leave it out")


def _resample(samples: Array, rate: float, to: int) -> Array:
    from soxr import resample

    return np.clip(resample(samples, rate, to, "HQ"), -1.0, 1.0).astype(np.float32)


def _stretch(samples: Array, factor: float) -> Array:
    """``factor`` times as long at the same pitch: a phase vocoder (Flanagan & Golden 1966), Hann windows at a quarter's hop."""
    hop = _WINDOW // 4
    signal = np.pad(samples, (_WINDOW, 2 * _WINDOW))
    window = np.hanning(_WINDOW + 1)[:-1]
    bins = 2 * np.pi * np.arange(_WINDOW // 2 + 1) / _WINDOW
    count = int((len(samples) + _WINDOW) * factor) // hop
    out, weight = np.zeros(count * hop + _WINDOW), np.full(count * hop + _WINDOW, 1e-9)
    phase = np.zeros(len(bins))
    for k in range(count):
        at = min(int(k * hop / factor), len(signal) - _WINDOW - hop)
        now, after = (np.fft.rfft(signal[at + d : at + d + _WINDOW] * window) for d in (0, hop))
        phase = np.angle(now) if k == 0 else phase
        out[k * hop : k * hop + _WINDOW] += np.fft.irfft(np.abs(now) * np.exp(1j * phase)) * window
        weight[k * hop : k * hop + _WINDOW] += window**2
        turn = np.angle(after) - np.angle(now) - bins * hop
        phase = phase + bins * hop + np.remainder(turn + np.pi, 2 * np.pi) - np.pi
    first = round(_WINDOW * factor)
    return (out / np.maximum(weight, 1e-3))[first : first + int(np.ceil(len(samples) * factor))]
