"""A bundle on stage: speech in, motion of our humanoid out; the same calls as `cospeech.rules.RuleGesturer`."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from math import isfinite
from os import PathLike
from typing import Any

import numpy as np

from ..errors import InputError
from ..motion import Motion
from ..rotations import Array
from ..rules import RuleGesturer
from ..rules.session import check_speech
from ..speech import Speech
from .bundle import read_bundle
from .flow_bundle import FlowSystem, open_flow
from .flow_engine import StudentT
from .performance import PIECE, Performance, Source

__all__ = ["BundleGesturer", "RandomSource"]

_PARTS = ("face", "body", "hands")


class RandomSource:
    """Latents as the network was trained to, one of the beginnings of the training data, the mean of all its poses.

    Args:
        system: whose.
        seed: of the take.
        temperature: scale of the latents.
    """

    def __init__(self, system: FlowSystem, *, seed: int, temperature: float = 1.0) -> None:
        sizes, beginnings = system.engine.sizes, system.statistics.histories
        self._latents = StudentT(sizes.pose, sizes.nu, seed=seed, temperature=temperature)
        self.history: Array = beginnings[np.random.default_rng([seed, 1]).integers(len(beginnings))]
        self.style = np.zeros(sizes.style, np.float32)
        self.centre = np.zeros(sizes.pose, np.float32)

    def draw(self, frames: int) -> Array:
        return self._latents.draw(frames)


class BundleGesturer:
    """A trained system: body and hands from a bundle's network, face and eyes from the rule-based gesturer.

    Args:
        system: an opened bundle; `BundleGesturer.open` takes a path.

    Raises:
        InputError: poses of a kind that cannot be decoded in pieces.
    """

    def __init__(self, system: FlowSystem) -> None:
        if system.pose in _WHOLE:
            raise InputError(f"a system of {system.pose!r} poses", "its motion adds up from frame to frame; train on another")
        self.system = system
        self._rules = RuleGesturer()

    @classmethod
    def open(cls, path: str | PathLike[str]) -> BundleGesturer:
        """A bundle's file on stage.

        Raises:
            InputError: it cannot be read, or is no bundle of ours.
        """
        return cls(open_flow(read_bundle(path)))

    def session(
        self,
        *,
        style: object = None,
        emotion: str = "auto",
        seed: int = 0,
        intensity: float = 1.0,
        temperature: float = 1.0,
        fps: float = 30.0,
        parts: Iterable[str] = _PARTS,
        takes: int = 1,
    ) -> Performance:
        """A performance to push speech into. For the options see `generate`; take k has the seed ``seed + k``."""
        parts = tuple(parts.split(",") if isinstance(parts, str) else parts)
        _check(seed, takes, intensity, temperature)
        options: dict[str, Any] = {"emotion": emotion, "fps": fps, "intensity": intensity, "temperature": temperature}
        seeds = [int(seed) + take for take in range(takes)]
        self._rules.session(seed=seeds[0], parts=parts, **options)  # it checks them all
        faces = [self._rules.session(seed=k, parts=("face",), **options) for k in seeds]
        sources = [self._source(style, k, float(temperature)) for k in seeds]
        return Performance(self.system, sources, faces, fps=float(fps), intensity=float(intensity), parts=parts)

    def _source(self, style: object, seed: int, temperature: float) -> Source:
        """Where a take's latents come from."""
        if style is not None:
            raise InputError(f"style {str(style)[:60]!r}", "this system has none")
        return RandomSource(self.system, seed=seed, temperature=temperature)

    def generate(self, speech: Speech, **options: Any) -> Motion:
        """Gestures for a whole speech.

        Args:
            speech: any rate.
            style: None.
            emotion: of the face: one of `cospeech.rules.EMOTIONS`, or "auto": from the voice.
            seed: another seed, another performance; the same one, the same bytes.
            intensity: how far poses stray from the mean one, 0 … 2.
            temperature: scale of the latents, 0 (the likeliest motion) … 2.
            fps: frames per second, 1 … 240.
            parts: of face, body, hands.

        Returns:
            Motion of exactly ceil(duration × fps) frames on our humanoid.

        Raises:
            InputError: an option is out of range or a name unknown.
        """
        return self.generate_takes(speech, takes=1, **options)[0]

    def generate_takes(self, speech: Speech, *, takes: int, **options: Any) -> list[Motion]:
        """Several takes in one pass, which costs little more than one: those of ``seed``, ``seed + 1``, …"""
        session = self.session(takes=takes, **options)
        check_speech(speech)
        pieces = [made for chunk in speech.chunks(PIECE) for made in session.push_takes(chunk)]
        pieces += session.finish_takes()
        return [Motion.concatenate(take) for take in zip(*pieces, strict=True)]

    def stream(self, chunks: Iterable[Speech], **options: Any) -> Iterator[Motion]:
        """The same motion in pieces, from speech that comes in pieces of any size."""
        session = self.session(**options)
        for chunk in chunks:
            yield from session.push(chunk)
        yield from session.finish()


_WHOLE = frozenset({"expmap-full"})
"""Representations whose rows add up: a frame does not follow from its own row."""
_MOST_TAKES = 64  # ours, of one pass


def _check(seed: object, takes: object, intensity: object, temperature: object) -> None:
    """What the rule-based gesturer, which sees the options too, does not check."""
    if not (isinstance(takes, int | np.integer) and 1 <= takes <= _MOST_TAKES):
        raise InputError(f"{takes!r} takes", f"1 … {_MOST_TAKES}")
    if not (isinstance(seed, int | np.integer) and 0 <= seed < 2**63 - _MOST_TAKES):
        raise InputError(f"seed {seed!r}", "a whole number, 0 … 2**63 - 65")
    for name, value in (("intensity", intensity), ("temperature", temperature)):
        if not (isinstance(value, int | float | np.number) and isfinite(value)):
            raise InputError(f"{name} {value!r}", "0 … 2")
