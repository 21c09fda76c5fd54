"""Write an ``.mp4`` of several characters side by side, each seen from the side of the others, as in films of conversations."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import replace
from os import PathLike
from pathlib import Path

import numpy as np

from ..errors import InputError, say_count
from ..files import atomic
from ..motion.motion import Motion
from .avatar import Avatar
from .film_encoder import MOST_RATE, FilmEncoder, import_pyav
from .pictures import Subject, background_of
from .render.camera import View
from .render.frames import FrameStream
from .render.light import draw_backdrop
from .render.patch import Patch
from .render.worker import Look

__all__ = ["MOST", "SIDE", "check_group_film", "write_group_film"]

MOST = 6
"""Characters in a film [ours: more would be too narrow]."""
_WIDTHS, _HEIGHT = (
    {2: 640, 3: 480},
    720,
)  # pixels of a pane, by the number of characters; 360 for more [ours: up to 2160 in all]
_NARROW = 360
# From the thighs up, with room for arms to both sides, so that all are of one size: the camera follows nobody's hands [ours]
_VIEW = View(("head",), (-0.62, 0.62, -0.20), (0.62, 1.84, 0.35), 0.06, 0, 3, 24)
SIDE = 26.0
"""Degrees by which the camera of the outer panes stands to the side [ours: both eyes of a face can still be seen]."""


def write_group_film(
    path: str | PathLike[str],
    moving: Iterable[Sequence[Motion]],
    *,
    fps: float,
    sounds: Sequence[str | PathLike[str]] = (),
    avatars: Sequence[Avatar | str | PathLike[str] | None],
    angle: float = 0.0,
) -> None:
    """Write a film of characters that talk to each other.

    Args:
        path: of the film.
        moving: pieces of the motion of all: the same frames of each.
        fps: of the motion.
        sounds: files that are mixed.
        avatars: one for each character, in place of our mannequin; from the left to the right.
        angle: degrees by which each of two is turned away from the other one.

    Raises:
        InputError: there are too many characters, PyAV is not installed, or a file cannot be read or written.
    """
    check_group_film(len(avatars))
    with atomic(path) as temporary:
        film = _Film(temporary, fps, sounds, avatars, angle)
        try:
            for motions in moving:
                film.add(motions)
            film.finish()
        finally:
            film.close()


def check_group_film(count: int) -> None:
    """Check that a film of so many characters can be made, before there is any motion.

    Raises:
        InputError: there are too many or too few, or PyAV is not installed.
    """
    import_pyav()
    if not 2 <= count <= MOST:
        raise InputError(
            f"a film of {say_count(count, 'character')}", f"2 … {MOST}; with {{name}} in its name, each has its own"
        )


class _Film:
    """Draws a pane for each character."""

    def __init__(
        self, temporary: Path, fps: float, sounds: Sequence[str | PathLike[str]],
        avatars: Sequence[Avatar | str | PathLike[str] | None], angle: float,
    ) -> None:  # fmt: skip
        count, rate, colour = len(avatars), min(float(fps), MOST_RATE), background_of(None)
        self._width = _WIDTHS.get(count, _NARROW)
        self._subjects = [Subject(avatar) for avatar in avatars]
        self._streams, self._waiting = list[FrameStream](), [deque[Patch]() for _ in avatars]
        side = max(SIDE - angle, 0.0)
        for k, subject in enumerate(self._subjects):
            view = replace(_VIEW, yaw=side * (2 * k / (count - 1) - 1))
            look = Look(self._width, _HEIGHT, subject.fit(view), colour, subject.path, subject.bone_map, shirt=k)
            self._streams.append(FrameStream(look, fps, rate, subject.character))
        blank = np.concatenate([draw_backdrop(self._width, _HEIGHT, colour)] * count, 1)
        self._blank = blank
        self._encoder = FilmEncoder(temporary, (self._width * count, _HEIGHT), rate, blank, sounds)

    def add(self, motions: Sequence[Motion]) -> None:
        """Take the next frames of all characters."""
        for stream, subject, waiting, motion in zip(self._streams, self._subjects, self._waiting, motions, strict=True):
            waiting.extend(stream.push(subject.pose(motion)))
        self._encode()

    def finish(self) -> None:
        """Encode the rest of the pictures, and end the file."""
        for stream, waiting in zip(self._streams, self._waiting, strict=True):
            waiting.extend(stream.flush())
        self._encode()
        self._encoder.close()

    def _encode(self) -> None:
        while all(self._waiting):
            self._encoder.add(self._join([waiting.popleft() for waiting in self._waiting]))

    def _join(self, patches: Sequence[Patch]) -> Patch:
        """Join the patches of all panes into one patch of the whole picture."""
        visible = [patch._replace(left=patch.left + k * self._width) for k, patch in enumerate(patches) if patch.pixels.size]
        if not visible:
            return patches[0]
        top, left = min(patch.top for patch in visible), min(patch.left for patch in visible)
        bottom = max(patch.top + patch.pixels.shape[0] for patch in visible)
        right = max(patch.left + patch.pixels.shape[1] for patch in visible)
        whole = self._blank[top:bottom, left:right].copy()
        for patch in visible:
            patch._replace(top=patch.top - top, left=patch.left - left).paste(whole)
        return Patch(top, left, whole)

    def close(self) -> None:
        """End all that is open, also after an error."""
        for stream in self._streams:
            with suppress(OSError):
                stream.close()
        self._encoder.discard()
