"""Draw motion in one call; checks that all formats with pictures share."""

from __future__ import annotations

from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import InputError
from ..motion.motion import Motion
from ..motion.skeleton import Skeleton, humanoid
from . import save
from .registry import FORMATS, suffixes
from .render.camera import View
from .render.frames import BACKDROP
from .render.framing import fit_view
from .to_humanoid import as_humanoid

if TYPE_CHECKING:
    from .avatar import Avatar

__all__ = ["Subject", "background_of", "render_motion", "size_of"]


def render_motion(
    motion: Motion,
    path: str | PathLike[str],
    *,
    audio: str | PathLike[str] | None = None,
    size: tuple[int, int] | None = None,
    camera: str | None = None,
    fps: float | None = None,
    background: tuple[int, int, int] | None = None,
    avatar: Avatar | str | PathLike[str] | None = None,
) -> None:
    """Draw ``motion`` of any skeleton that can be retargeted, as a video, a moving picture or a strip; the suffix decides.

    Args:
        motion: what to show.
        path: ends in ``.mp4`` (needs the extra ``av``), ``.gif`` or ``.png``.
        audio: the speech: heard in the video, drawn as a waveform in the strip.
        size: (width, height) in pixels.
        camera: ``body``, ``full``, ``face`` or ``hands``.
        fps: pictures per second of a video or moving picture.
        background: sRGB colour of the backdrop, 0 … 255 each.
        avatar: a ``.vrm`` or ``.glb`` character to show in place of our mannequin, or one that `load_avatar` has read.

    What is not given is chosen by the format.

    Raises:
        InputError: unknown suffix or camera, a size or rate out of range, the audio or the avatar cannot be read.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in FORMATS or not FORMATS[suffix].picture:
        endings = ", ".join(suffixes(lambda entry: entry.picture))
        raise InputError(f"cannot draw {str(path)!r}", f"name a file that ends in {endings}")
    if suffix == ".png" and fps is not None:
        raise InputError(f"{fps} pictures per second of a strip", "leave fps out for .png")
    options = {"audio": audio, "size": size, "camera": camera, "rate": fps, "background": background, "avatar": avatar}
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


class Subject:
    """The character that pictures show; puts motion on it.

    Args:
        avatar: a ``.vrm`` or ``.glb`` file, or one that `load_avatar` has read; our mannequin where None.

    Attributes:
        path: of the file; empty for the mannequin.
        bone_map: the map with which the file was read.
        character: that of the file; None for the mannequin.

    Raises:
        InputError: the file is no character that can be drawn.
    """

    def __init__(self, avatar: Avatar | str | PathLike[str] | None) -> None:
        from .avatar_character import load_character

        self.path = "" if avatar is None else str(Path(avatar).absolute())
        self.bone_map = dict(getattr(avatar, "bone_map", {}))
        self.character = None if avatar is None else load_character(avatar)

    @property
    def skeleton(self) -> Skeleton:
        """That of the character, with our humanoid's names."""
        return humanoid() if self.character is None else self.character.skeleton

    def fit(self, view: View) -> View:
        """Fit a view of our mannequin to this character."""
        return view if self.character is None else fit_view(view, self.character)

    def pose(self, motion: Motion) -> Motion:
        """Put motion of any skeleton that is recognised on the skeleton of the character."""
        return as_humanoid(motion) if self.skeleton is humanoid() else motion.retarget(self.skeleton)
