"""Windows that slide over the rows of a speech, with silence before and after.

Each makes the next ``hop`` frames, hears ``ahead`` frames after them, and fills the rest of its length with frames before. The
next window fades in over ``fade`` frames, from what this one made of the frames ahead. The place of a window follows from the
frame's index: pieces of any size give the same bits.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..errors import InputError
from ..motion.rotations import Array

__all__ = ["Sliding", "WindowLayout", "check_look_ahead"]


@dataclass(frozen=True)
class WindowLayout:
    """How windows lie, in frames.

    Raises:
        InputError: the frames do not fit into the window.
    """

    window: int
    hop: int
    """New frames of each."""
    ahead: int
    """Heard after the new ones."""
    fade: int
    """Of the new ones, blended with what the window before made of them."""
    held: int = 0
    """Frames after those heard ahead whose speech is not waited for: the last row heard is repeated there."""

    def __post_init__(self) -> None:
        if not (self.hop > 0 and 0 <= self.fade <= min(self.ahead, self.hop) and self.past >= 0 <= self.held):
            raise InputError(f"{self} is not possible", "0 < hop, fade ≤ ahead, fade ≤ hop, hop + ahead + held ≤ window")

    @property
    def past(self) -> int:
        """Frames heard before the new ones."""
        return self.window - self.hop - self.ahead - self.held

    @property
    def speech_frames(self) -> int:
        """Frames of speech in a window."""
        return self.window - self.held

    @property
    def waits(self) -> int:
        """Frames of speech, from its own on, that a frame waits for at most."""
        return self.hop + self.ahead


def check_look_ahead(seconds: object) -> None:
    """Refuse a look-ahead that is no number of seconds.

    Raises:
        InputError: neither a number from 0 on nor None.
    """
    number = isinstance(seconds, int | float | np.number) and not isinstance(seconds, bool)
    if seconds is not None and not (number and seconds >= 0):  # type: ignore[operator]  # NaN fails, too
        raise InputError(f"look_ahead is {seconds!r:.60}", "seconds, 0 … inf")


class Sliding:
    """Windows under way, for N takes of one speech.

    Args:
        setting: how windows lie.
        silence: (1, A) row of silence, which is before the speech.
        draw: n → (N, n, Z) the next noise; before the speech it stands still.
        make: (window, A) rows, index of the first new frame, (N, window, Z) noise → (N, window, D) poses.
    """

    def __init__(
        self, setting: WindowLayout, silence: Array, draw: Callable[[int], Array], make: Callable[[Array, int, Array], Array]
    ) -> None:
        self.setting, self._draw, self._make = setting, draw, make
        self._rows = np.repeat(silence, setting.past, 0)
        self._mode_noise = np.repeat(draw(1), setting.past + 1, 1)
        self._before: Array | None = None  # what the last window made of the frames ahead
        self.frames, self._count = 0, 0
        """Frames that are made."""
        self.last: Array | None = None
        """(N, hop, D) the new frames of the last window."""

    def push(self, rows: Array) -> list[Array]:
        """Rows (n, A) that come next → poses (N, hop, D) of each window that they fill."""
        self._count += len(rows)
        return self._slide(rows)

    def finish(self, silence: Array) -> list[Array]:
        """The windows of the rest, up to as many frames as were heard; ``silence`` (1, A) is after the speech."""
        missing = self._count - self.frames
        windows = -(-missing // self.setting.hop)
        until = self.setting.speech_frames + (windows - 1) * self.setting.hop if windows else 0
        poses = self._slide(np.repeat(silence, max(0, until - len(self._rows)), 0))
        return [np.concatenate(poses, 1)[:, :missing]] if poses else []

    def _slide(self, rows: Array) -> list[Array]:
        self._rows = np.concatenate([self._rows, rows])
        poses = []
        while len(self._rows) >= self.setting.speech_frames:
            poses.append(self._next())
            self._rows = self._rows[self.setting.hop :]
        self._rows = self._rows.copy()
        return poses

    def _next(self) -> Array:
        """(N, hop, D) of the next window."""
        window, hop, fade, past = self.setting.window, self.setting.hop, self.setting.fade, self.setting.past
        self._mode_noise = np.concatenate([self._mode_noise, self._draw(window - self._mode_noise.shape[1])], 1)
        rows = self._rows[: self.setting.speech_frames]
        if self.setting.held:
            rows = np.concatenate([rows, np.repeat(rows[-1:], self.setting.held, 0)])
        poses = self._make(rows, self.frames, self._mode_noise)
        fresh = poses[:, past : past + hop]
        if self._before is not None and fade:
            share = (np.arange(1, fade + 1, dtype=np.float32) / np.float32(fade + 1))[:, None]
            fresh = np.concatenate([self._before + share * (fresh[:, :fade] - self._before), fresh[:, fade:]], 1)
        self._before = poses[:, past + hop : past + hop + fade]
        self.last = fresh
        self._mode_noise = self._mode_noise[:, hop:]
        self.frames += hop
        return fresh
