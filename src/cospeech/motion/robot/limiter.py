"""Limit commands for a robot's joints in position, speed and acceleration, frame by frame."""

from __future__ import annotations

from collections import deque
from numbers import Integral

import numpy as np

from ...errors import InputError
from ..rotations import Array

__all__ = ["JointLimiter"]

_HISTORY = 60.0  # seconds of commands that can be taken back [ours: longer than an answer that is sent in advance]


class JointLimiter:
    """Follows goals as fast as the limits allow, and brakes in time, so that it does not overshoot.

    Args:
        lower, upper: (J,) radians.
        velocity: (J,) radians per second.
        acceleration: (J,) radians per second².
        fps: commands per second.
        start: (J,) radians, positions of the joints before the first command; NaN: the first goal.

    Raises:
        InputError: a lower limit above its upper one, or a speed or an acceleration that is not above 0.
    """

    def __init__(
        self, lower: Array, upper: Array, velocity: Array, acceleration: Array, *, fps: float, start: Array | None = None
    ) -> None:
        self._lower, self._upper, self._most, self._push = (np.array(x, float) for x in (lower, upper, velocity, acceleration))
        if not (self._lower <= self._upper).all() or not (self._most > 0).all() or not (self._push > 0).all() or not fps > 0:
            raise InputError("limits of joints that nothing can keep", "lower ≤ upper, velocity > 0, acceleration > 0, fps > 0")
        self._step = 1.0 / fps
        self._start = np.full_like(self._lower, np.nan) if start is None else np.clip(start, self._lower, self._upper)
        self._at: Array | None = None
        self._speed = np.zeros_like(self._lower)
        self._past = deque[tuple[Array | None, Array]](maxlen=max(round(_HISTORY * fps), 1))  # before each command

    def push(self, goals: Array) -> Array:
        """(T, J) goals → (T, J) commands; the first command is the start, or the first goal, within the limits of position.

        Raises:
            InputError: a number that is not finite, or another shape; no goal was used then.
        """
        goals = np.asarray(goals, float)
        if goals.ndim != 2 or goals.shape[1] != len(self._lower) or not np.isfinite(goals).all():
            raise InputError(f"goals of shape {goals.shape}", f"finite numbers, (frames, {len(self._lower)})")
        commands = np.empty_like(goals, float)
        for k, goal in enumerate(np.clip(goals, self._lower, self._upper)):
            self._past.append((self._at, self._speed))
            self._at = np.where(np.isnan(self._start), goal, self._start) if self._at is None else self._go(self._at, goal)
            commands[k] = self._at
        return commands

    def rewind(self, count: int) -> Array | None:
        """Take back the last commands.

        Returns:
            (J,) radians of the command before them; None if there is none.

        Raises:
            InputError: there were not so many commands, or they are too old.
        """
        if isinstance(count, bool) or not isinstance(count, Integral) or not 0 <= count <= len(self._past):
            raise InputError(f"{count!r:.40} commands cannot be taken back", f"0 … {len(self._past)}")
        for _ in range(count):
            self._at, self._speed = self._past.pop()
        return self._at

    def finish(self) -> Array:
        """(T, J) commands that stop every joint as soon as its acceleration allows; the last one repeats its place.

        T is 0 if all joints stand still already.
        """
        commands, most = [], self._push * self._step
        while self._at is not None and self._speed.any():
            self._speed = np.sign(self._speed) * np.maximum(np.abs(self._speed) - most, 0)
            self._at = np.clip(self._at + self._speed * self._step, self._lower, self._upper)
            commands.append(self._at)
        return np.array(commands).reshape(-1, len(self._lower))

    def _go(self, at: Array, goal: Array) -> Array:
        way, dt = goal - at, self._step
        # The highest speed from which the joint can still brake, one step at a time: v²/2a + v·dt = |way|.
        brake = self._push * dt
        fastest = np.minimum(np.sqrt(brake * brake + 2 * self._push * np.abs(way)) - brake, np.abs(way) / dt)
        aim = np.sign(way) * np.minimum(fastest, self._most)
        change = self._push * dt
        self._speed = np.clip(aim, self._speed - change, self._speed + change)
        self._speed = np.clip(self._speed, -self._most, self._most)
        place = at + self._speed * dt
        result = np.clip(place, self._lower, self._upper)
        self._speed = np.where(result == place, self._speed, 0.0)
        return result
