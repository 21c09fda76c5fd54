"""Draw pieces of motion as pictures in order, on all cores and in constant memory."""

from __future__ import annotations

import os
import queue
from collections import deque
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from fractions import Fraction

import numpy as np

from ...audio.interpreter import find_interpreter
from ...errors import InputError
from ...motion.motion import Motion
from ...motion.rotations import Array
from ...motion.skeleton import humanoid
from ..mannequin.character import Character
from .framing import FramedPose, Framing, PoseStage
from .patch import Patch
from .worker import FrameRenderer, Helper, Look, pack

__all__ = ["BACKDROP", "FrameStream", "cores"]

BACKDROP = (206, 212, 220)  # sRGB: a light grey-blue; ours, by eye
_BATCH = 6  # pictures per order to a helper; ours: enough to hide the time for messages, few enough to share the work evenly
_ALONE = 24  # pictures; ours: for fewer, it takes longer to start helpers than to draw
_MOST_HELPERS = 8  # ours: with more, the video encoder is the slowest part
_SIDES = (16, 4096)  # pixels; ours


class FrameStream:
    """Draws motion of a character's skeleton.

    A context manager: leaving it ends all helper processes, also after an error or Ctrl-C.

    Args:
        look: size, view and backdrop.
        motion_fps: of the motion to come.
        fps: of the pictures to give: the frame at or before each moment is drawn.
        character: that of ``look``, if it is not the mannequin.

    Raises:
        InputError: size or fps make no sense.
    """

    def __init__(self, look: Look, motion_fps: float, fps: float, character: Character | None = None) -> None:
        for side in (look.width, look.height):
            if not _SIDES[0] <= side <= _SIDES[1]:
                raise InputError(f"pictures of {look.width} × {look.height}", f"sides of {_SIDES[0]} … {_SIDES[1]} pixels")
        if not (np.isfinite(fps) and 0 < fps <= 240):
            raise InputError(f"{fps} pictures per second", "0 … 240, such as 30")
        self.look, self.fps = look, fps
        self._step = Fraction(motion_fps).limit_denominator(1001) / Fraction(fps).limit_denominator(1001)
        skeleton = humanoid() if character is None else character.skeleton
        self._stage, self._character = PoseStage(skeleton, motion_fps), character
        self._framing = Framing(look.view, skeleton, fps)
        self._frame_count = self._picture_count = 0
        self._rows: list[Array] = []
        self._orders: deque[Future[list[Patch]]] = deque()
        self._renderer: FrameRenderer | None = None
        self._helpers: queue.SimpleQueue[Helper] = queue.SimpleQueue()
        self._all_helpers: list[Helper] = []
        self._threads: ThreadPoolExecutor | None = None

    def push(self, motion: Motion) -> Iterator[Patch]:
        """Take a piece of motion; give the patches of the pictures that are ready."""
        for pose in map(FramedPose, *self._stage.place(motion)):
            while int(self._picture_count * self._step) == self._frame_count:
                self._picture_count += 1
                self._rows.extend(pack(*pair) for pair in self._framing.push(pose))
            self._frame_count += 1
            if self._threads is not None or len(self._rows) >= _ALONE:
                yield from self._order(_BATCH)

    def flush(self) -> Iterator[Patch]:
        """Give the rest of the pictures."""
        self._rows.extend(pack(*pair) for pair in self._framing.flush())
        if self._threads is None and len(self._rows) < _ALONE:
            yield from self._draw_here()
        yield from self._order(1)
        while self._orders:
            yield from self._orders.popleft().result()

    def _order(self, least: int) -> Iterator[Patch]:
        """Give waiting rows, if there are at least so many, to helpers; give the oldest pictures where many are in work."""
        if self._threads is None and (cores() == 1 or find_interpreter() is None):
            yield from self._draw_here()
        while len(self._rows) >= least:
            if self._threads is None:
                self._hire()
            assert self._threads is not None
            batch, self._rows = np.stack(self._rows[:_BATCH]), self._rows[_BATCH:]
            self._orders.append(self._threads.submit(self._ask, batch))
            if len(self._orders) > 2 * len(self._all_helpers) + 1:
                yield from self._orders.popleft().result()

    def _draw_here(self) -> Iterator[Patch]:
        self._renderer = self._renderer or FrameRenderer(self.look, self._character)
        rows, self._rows = self._rows, []
        for row in rows:
            yield from self._renderer.draw(row[None])

    def _hire(self) -> None:
        count = min(cores(), _MOST_HELPERS)
        self._threads = ThreadPoolExecutor(count, "cospeech-frames")
        for _ in range(count):
            self._all_helpers.append(Helper(self.look))
            self._helpers.put(self._all_helpers[-1])

    def _ask(self, batch: Array) -> list[Patch]:
        helper = self._helpers.get()
        try:
            return helper.draw(batch)
        finally:
            self._helpers.put(helper)

    def __enter__(self) -> FrameStream:
        return self

    def __exit__(self, kind: object, error: object, trace: object) -> None:
        self.close()

    def close(self) -> None:
        """End all helpers, also those at work."""
        if self._threads is not None:
            self._threads.shutdown(wait=False, cancel_futures=True)
        for helper in self._all_helpers:
            helper.close()
        if self._threads is not None:
            self._threads.shutdown(wait=True)


def cores() -> int:
    """Processor cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return max(1, len(os.sched_getaffinity(0)))
    return os.cpu_count() or 1
