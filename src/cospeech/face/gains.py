"""Gains of the channels of a face: ``face_gain``, read as one factor for each channel."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..errors import InputError, nearest
from ..motion.named_numbers import read_named_numbers
from ..motion.rotations import Array
from ..motion.skeletons.arkit import ARKIT, ARKIT_INDEX
from .expressions import IS_MOUTH

__all__ = ["face_gains"]

_MOST = 2.0  # ours: beyond, most weights would stand at 1
_HINT = f"0 … {_MOST:g}, as in 1.2 or 1.2,jawOpen:0.8,mouthSmile:0.5"


def _columns() -> dict[str, list[int]]:
    """Channel → its column; name without its side → both columns. What moves sideways (jawLeft, mouthLeft) has no pair."""
    columns = {name: [k] for name, k in ARKIT_INDEX.items()}
    for name in ARKIT:
        both = name.removesuffix("Left")
        if both != name and both not in ("jaw", "mouth"):
            columns[both] = [ARKIT_INDEX[both + side] for side in ("Left", "Right")]
    return columns


_COLUMNS = _columns()


def face_gains(gain: object) -> Array:
    """(52,) factors of the ARKit channels.

    >>> gains = face_gains("1.2,jawOpen:0.8,mouthSmile:0.5")
    >>> [float(gains[ARKIT_INDEX[name]]) for name in ("mouthFunnel", "jawOpen", "mouthSmileRight", "browInnerUp")]
    [1.2, 0.8, 0.5, 1.0]

    Args:
        gain: one number for jaw, mouth and tongue; or channel → number, where a name without its side means both sides; or
            text with either or both, as above. Numbers are 0 … 2; a channel's own takes the place of the mouth's.

    Raises:
        InputError: no such channel, or a number out of range.
    """
    gains = np.ones(len(ARKIT))
    for name, value in sorted(_parse_gain(gain), key=lambda pair: pair[0] in _COLUMNS):  # of the mouth first, then single ones
        if isinstance(value, bool) or not isinstance(value, int | float | np.number) or not 0 <= value <= _MOST:
            raise InputError(f"face gain {str(value)[:60]}{f' of {name}' if name else ''}", _HINT)
        if name and name not in _COLUMNS:
            raise InputError(f"no channel of the face is called {name[:60]!r}", nearest(name[:60], _COLUMNS))
        gains[_COLUMNS[name] if name else IS_MOUTH] = value
    return gains


def _parse_gain(gain: object) -> list[tuple[str, object]]:
    """(channel, or "" for the mouth; number)."""
    if isinstance(gain, Mapping):
        return [(str(name), value) for name, value in gain.items()]
    if not isinstance(gain, str):
        return [("", gain)]
    parts = read_named_numbers(gain, number="face gain", of="channel", hint=_HINT)
    gains = [("", _number(part.text)) if part.number is None else (part.name, part.number) for part in parts]
    names = [name for name, _ in gains]
    twice = next((name for k, name in enumerate(names) if name in names[:k]), None)
    if twice is not None:
        raise InputError(f"face gain {gain[:60]!r} has two numbers for {twice or 'jaw, mouth and tongue'}", _HINT)
    return gains


def _number(text: str) -> object:
    try:
        return float(text)
    except ValueError:
        return repr(text)
