"""Show a motion in the output of a notebook's cell: the page of `cospeech.export.html_page` in a frame.

The page is part of the notebook, so it works without cospeech and without a network. Where the viewer has not been built, a
strip of pictures takes its place.
"""

from __future__ import annotations

import html
from os import PathLike

from ..audio.speech import Speech
from ..errors import InputError
from ..files import scratch, workplace
from ..motion.motion import Motion
from . import html_page, save

__all__ = ["NotebookView", "show"]

_HEIGHTS = (120, 4096)  # pixels; ours: below the first, the buttons leave no room for the character
_FRAME = (
    '<iframe srcdoc="{page}" sandbox="allow-scripts" allow="autoplay" title="Motion of a character" '
    'style="width: 100%; height: {height}px; border: 0"></iframe>'
)


class NotebookView:
    """The view of a motion that a notebook shows when it is the last line of a cell.

    Args:
        page: the page, or None.
        strip: a PNG in place of the page, or None.
        height: of the page, pixels.
    """

    def __init__(self, page: str | None, strip: bytes | None, height: int) -> None:
        self._page, self._strip, self._height = page, strip, height

    def __repr__(self) -> str:
        return "NotebookView (a notebook shows it; in a program, `motion.save('talk.html')` writes a page)"

    def _repr_html_(self) -> str | None:
        if self._page is None:
            return None
        plain = html.escape(self._page).encode("ascii", "xmlcharrefreplace").decode()  # whatever the encoding of the notebook
        return _FRAME.format(page=plain, height=self._height)

    def _repr_png_(self) -> bytes | None:
        return self._strip


def show(
    motion: Motion,
    audio: Speech | str | PathLike[str] | None = None,
    *,
    avatar: str | PathLike[str] | None = None,
    height: int = 480,
) -> NotebookView:
    """The view of a motion; arguments as of `Motion.show`."""
    if not _HEIGHTS[0] <= height <= _HEIGHTS[1]:
        raise InputError(f"a view {height} pixels high", f"{_HEIGHTS[0]} … {_HEIGHTS[1]}")
    has_viewer = (html_page.VIEWER / "viewer.js").is_file()
    with workplace(scratch()) as folder:
        path = folder / ("motion.html" if has_viewer else "motion.png")
        save(motion, path, audio=audio, avatar=avatar)
        if has_viewer:
            return NotebookView(path.read_text("utf-8"), None, height)
        return NotebookView(None, path.read_bytes(), height)
