"""Pictures of motion, without a display, a browser or a graphics card."""

from __future__ import annotations

from os import PathLike
from pathlib import Path

from ..errors import InputError
from ..motion import Motion

__all__ = ["PICTURES", "render_motion"]

PICTURES = (".mp4", ".gif", ".png")


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
    from ..export import save

    suffix = Path(path).suffix.lower()
    if suffix not in PICTURES:
        raise InputError(f"cannot draw {str(path)!r}", f"name a file that ends in {', '.join(PICTURES)}")
    if suffix == ".png" and fps is not None:
        raise InputError(f"{fps} pictures per second of a strip", "leave fps out for .png")
    options = {"audio": audio, "size": size, "camera": camera, "rate": fps, "background": background}
    save(motion, path, **{name: value for name, value in options.items() if value is not None})
