"""Drawing motion in one call, and the checks that all formats with pictures share."""

from __future__ import annotations

from os import PathLike
from pathlib import Path

from ..errors import InputError
from ..motion.motion import Motion
from . import save
from .registry import FORMATS, suffixes
from .render.frames import BACKDROP

__all__ = ["background_of", "no_avatar", "render_motion", "size_of"]


def render_motion(
    motion: Motion,
    path: str | PathLike[str],
    *,
    audio: str | PathLike[str] | None = None,
    size: tuple[int, int] | None = None,
    camera: str | None = None,
    fps: float | None = None,
    background: tuple[int, int, int] | None = None,
) -> None:
    """Draw ``motion`` of any skeleton that can be retargeted, as a video, a moving picture or a strip; the suffix decides.

    Args:
        motion: what to show.
        path: ends in ``.mp4`` (needs ``cospeech[av]``), ``.gif`` or ``.png``.
        audio: the speech: heard in the video, drawn as a waveform in the strip.
        size: (width, height) in pixels.
        camera: ``body``, ``full``, ``face`` or ``hands``.
        fps: pictures per second of a video or moving picture.
        background: sRGB colour of the backdrop, 0 … 255 each.

    What is not given is chosen by the format.

    Raises:
        InputError: unknown suffix or camera, a size or rate out of range, or the audio cannot be read.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in FORMATS or not FORMATS[suffix].picture:
        known = ", ".join(suffixes(lambda entry: entry.picture))
        raise InputError(f"cannot draw {str(path)!r}", f"name a file that ends in {known}")
    if suffix == ".png" and fps is not None:
        raise InputError(f"{fps} pictures per second of a strip", "leave fps out for .png")
    options = {"audio": audio, "size": size, "camera": camera, "rate": fps, "background": background}
    save(motion, path, **{name: value for name, value in options.items() if value is not None})


def size_of(size: tuple[int, int]) -> tuple[int, int]:
    """Check a size given by the user.

    Raises:
        InputError: it is not two whole numbers.
    """
    try:
        width, height = (int(side) for side in size)
    except (TypeError, ValueError, OverflowError):
        raise InputError(f"a picture size of {size!r}", "width and height in pixels, such as 720 and 720") from None
    return width, height


def background_of(colour: tuple[int, int, int] | None) -> tuple[int, int, int]:
    """Check a colour given by the user; ours where none was.

    Raises:
        InputError: it is not three whole numbers of 0 … 255.
    """
    if colour is None:
        return BACKDROP
    try:
        red, green, blue = (int(part) for part in colour)
    except (TypeError, ValueError, OverflowError):
        red = green = blue = -1
    if not 0 <= min(red, green, blue) <= max(red, green, blue) <= 255:
        raise InputError(f"a background of {colour!r}", "red, green and blue, 0 … 255 each")
    return red, green, blue


def no_avatar(avatar: str | PathLike[str] | None) -> None:
    """Pictures show our own character only.

    Raises:
        InputError: another one was asked for.
    """
    if avatar is not None:
        raise InputError(f"cannot draw {str(avatar)!r}", "pictures show our mannequin; write a .glb to see other avatars move")
