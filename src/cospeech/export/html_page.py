"""``.html``: character, motion and speech in one page that opens from disk, without a network.

The page holds the viewer that ``make studio`` builds from ``web/src/share.ts``, the animated ``.glb`` of `cospeech.export.glb`
packed by deflate, the speech as MP3, and the licences of the libraries in the viewer. A Content-Security-Policy lets it run
this viewer alone and load nothing.
"""

from __future__ import annotations

import base64
import hashlib
import html
import zlib
from collections.abc import Iterator
from os import PathLike
from pathlib import Path
from typing import IO, Any

import numpy as np

from ..audio.speech import open_speech
from ..errors import InputError
from ..files import repair_text
from ..motion.motion import Motion
from . import Writer as BaseWriter
from .avatar import Avatar, load_avatar
from .character_files import check_packing
from .glb import Writer as GlbWriter

__all__ = ["Writer"]

VIEWER = Path(__file__).parents[1] / "assets" / "studio"
"""Folder of ``viewer.js``, ``viewer.css`` and ``viewer-licenses.txt``."""
_SOUND_RATE = 32_000  # Hz; ours: speech has next to no sound above 16 kHz, and MPEG-1 Layer III has this rate
_BLOCK = 3 * 2**18  # bytes that are turned into base64 at once; three bytes make four letters
_PAGE = """<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta http-equiv="Content-Security-Policy" content="{policy}">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="generator" content="cospeech">
<title>{title}</title>
<style>{style}</style>
</head>
<body>
<main>
<h1>{title}</h1>
<canvas id="view" tabindex="0" role="img" aria-label="The character. Drag to turn it, scroll to come nearer."></canvas>
<p id="problem" role="alert"></p>
<div class="bar" role="group" aria-label="Playing">
<button type="button" id="play">Play</button>
<span id="clock" role="timer" aria-live="off" aria-label="Time"></span>
<input type="range" id="scrub" min="0" max="1" step="any" value="0" aria-label="Place in the speech">
<button type="button" id="loop" aria-pressed="false">Loop</button>
<label>Speed <select id="speed"></select></label>
<button type="button" id="frame">Whole</button>
</div>
</main>
"""


class Writer(BaseWriter):
    """Writes the page.

    Args:
        avatar: somebody's character in place of ours: a ``.vrm`` or ``.glb`` file, or one that `load_avatar` has read.

    Raises:
        InputError: the viewer has not been built, or the audio or the avatar cannot be read, here or by the viewer.
    """

    _inner: GlbWriter | None = None

    def __init__(self, path: str | PathLike[str], *, avatar: Avatar | str | PathLike[str] | None = None, **common: Any) -> None:
        super().__init__(path, **common)
        self._avatar = avatar
        self._script, self._style = _read_viewer("viewer.js"), _read_viewer("viewer.css")
        self._licenses = _read_viewer("viewer-licenses.txt")

    def _begin(self, temporary: Path) -> None:
        self._temporary = temporary
        self._character, self._sound = temporary.with_suffix(".character.glb"), temporary.with_suffix(".sound.mp3")
        avatar = self._avatar
        if avatar is not None:
            avatar = avatar if isinstance(avatar, Avatar) else load_avatar(avatar)
            check_packing(avatar.file, in_page=True)
        inner = GlbWriter(self._character, skeleton=self.skeleton, fps=self.fps, avatar=avatar)
        inner.__enter__()
        self._inner = inner
        if self.audio is not None:  # a file that cannot be read is reported before the work
            open_speech(self.audio).close()

    def _write(self, motion: Motion) -> None:
        assert self._inner is not None
        self._inner.write(motion)

    def _finish(self) -> None:
        assert self._inner is not None
        inner, self._inner = self._inner, None
        inner.__exit__(None, None, None)
        head = _PAGE.format(policy=_policy(self._script, self._style), title=self._title(), style=self._style)
        with self._temporary.open("w", encoding="utf-8", newline="") as page:
            page.write(head)
            _embed(page, "character", _pack(self._character), f'data-packed data-fps="{self.fps:g}"')
            if self.audio is not None:
                _write_mp3(self.audio, self._sound, (self.frames - 1) / self.fps)
                _embed(page, "sound", _blocks(self._sound), 'data-kind="audio/mpeg"')
            page.write(f'<script type="text/plain" id="licenses">\n{self._licenses}</script>\n')
            page.write(f"<script>{self._script}</script>\n</body>\n</html>\n")

    def _title(self) -> str:
        """Name of the speech."""
        return html.escape(repair_text(Path(self.audio).stem) if self.audio is not None else "cospeech")

    def _discard(self) -> None:
        if self._inner is not None:
            inner, self._inner = self._inner, None
            inner.__exit__(InputError, InputError("the page is not written"), None)
        for path in (self._character, self._sound):
            path.unlink(missing_ok=True)


def _read_viewer(name: str) -> str:
    """A file of the viewer, as text that does not end a script of the page."""
    try:
        return (VIEWER / name).read_text("utf-8").replace("</script", "<\\/script")
    except OSError:
        raise InputError("the viewer of share files has not been built", "in the repository: make studio") from None


def _write_mp3(audio: str | PathLike[str], path: Path, seconds: float) -> None:
    """Write the speech, mono, with a variable bit rate, whose header lets players seek exactly. Silence follows it up to
    ``seconds``, the time of the last frame: the page's clock is the sound's."""
    import soundfile

    options = {"format": "MP3", "subtype": "MPEG_LAYER_III", "bitrate_mode": "VARIABLE", "compression_level": 0.5}
    with open_speech(audio, rate=_SOUND_RATE) as source, soundfile.SoundFile(path, "w", _SOUND_RATE, 1, **options) as sound:
        rest = round(seconds * _SOUND_RATE)
        for block in source.blocks():
            sound.write(block)
            rest -= len(block)
        for first in range(0, rest, _SOUND_RATE):
            sound.write(np.zeros(min(_SOUND_RATE, rest - first), np.float32))


def _policy(script: str, style: str) -> str:
    """A policy that allows only this script and this style, and nothing from elsewhere (CSP level 3, hash sources)."""
    sources = {"script": script, "style": style}
    hashes = {name: base64.b64encode(hashlib.sha256(text.encode()).digest()).decode() for name, text in sources.items()}
    own = "; ".join(f"{name}-src 'sha256-{digest}'" for name, digest in hashes.items())
    blobs = "img-src blob: data:; media-src blob:; connect-src blob: data:"  # the viewer makes them of the page's own bytes
    return f"default-src 'none'; {own}; {blobs}; base-uri 'none'; form-action 'none'"


def _embed(page: IO[str], name: str, blocks: Iterator[bytes], attributes: str) -> None:
    """Write bytes as the text of an element that no browser runs."""
    page.write(f'<script type="text/plain" id="{name}" {attributes}>')
    rest = b""
    for block in blocks:
        rest += block
        whole = len(rest) - len(rest) % 3
        page.write(base64.b64encode(rest[:whole]).decode("ascii"))
        rest = rest[whole:]
    page.write(base64.b64encode(rest).decode("ascii") + "</script>\n")


def _pack(path: Path) -> Iterator[bytes]:
    deflate = zlib.compressobj(9)
    for block in _blocks(path):
        yield deflate.compress(block)
    yield deflate.flush()


def _blocks(path: Path) -> Iterator[bytes]:
    with path.open("rb") as file:
        while block := file.read(_BLOCK):
            yield block
