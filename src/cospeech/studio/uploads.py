"""Receive files from a page: they are written to disk as they come, within limits that are checked first."""

from __future__ import annotations

import asyncio
import time
from collections.abc import AsyncIterator
from pathlib import Path

__all__ = ["MOST_UPLOADS", "UPLOAD_BYTES", "UploadRefused", "Uploads"]

UPLOAD_BYTES = 64 << 20
"""Bytes of one file [ours: half an hour of speech as WAV at 16 kHz]."""
MOST_UPLOADS = 8 * UPLOAD_BYTES
"""Bytes of all files that are being received [ours: 512 MiB of the disk]."""
_SLOWEST = 16_384  # bytes per second, on average [ours: a poor mobile line]
_GRACE = 10.0  # seconds until the average counts, and longest silence; as `cospeech.studio.server.REQUEST_SECONDS`


class UploadRefused(Exception):
    """A file was refused; ``status``: HTTP status of the answer."""

    def __init__(self, status: int, problem: str, hint: str = "") -> None:
        super().__init__(problem)
        self.status, self.problem, self.hint = status, problem, hint


class Uploads:
    """Receives files; a server has one.

    Args:
        grace: seconds of silence after which a file is refused; its average speed is checked after the same time.
    """

    def __init__(self, grace: float = _GRACE) -> None:
        self._grace, self._bytes = grace, 0

    async def receive(self, pieces: AsyncIterator[bytes], length: str | None, path: Path) -> int:
        """Write a body to a file.

        Args:
            pieces: of the body.
            length: value of the header ``Content-Length``.
            path: a new file.

        Returns:
            Number of bytes.

        Raises:
            UploadRefused: it is too large, too slow, empty, or not complete; no file is left.
        """
        _check_length(length)
        size, start = 0, time.monotonic()
        try:
            with path.open("wb") as file:
                async for piece in self._in_time(pieces):
                    size += len(piece)
                    self._bytes += len(piece)
                    seconds = time.monotonic() - start
                    if size > UPLOAD_BYTES:
                        raise UploadRefused(413, f"at most {UPLOAD_BYTES >> 20} MiB", "cut the file into pieces")
                    if self._bytes > MOST_UPLOADS:
                        raise UploadRefused(503, "too many files are on their way", "try again in a minute")
                    if seconds > self._grace and size < _SLOWEST * seconds:
                        raise UploadRefused(408, "the file comes too slowly")
                    file.write(piece)
            if not size:
                raise UploadRefused(422, "the file is empty", "was it saved, recorded or downloaded to its end?")
            return size
        except BaseException:
            path.unlink(missing_ok=True)
            raise
        finally:
            self._bytes -= size

    async def _in_time(self, pieces: AsyncIterator[bytes]) -> AsyncIterator[bytes]:
        while True:
            try:
                async with asyncio.timeout(self._grace):
                    piece = await anext(pieces)
            except StopAsyncIteration:
                return
            except TimeoutError:
                raise UploadRefused(408, "the file comes too slowly") from None
            yield piece


def _check_length(length: str | None) -> None:
    """Check the length in the header, before anything is read."""
    if length is None:
        return
    if not (length.isascii() and length.isdigit()):
        raise UploadRefused(400, "the length cannot be read")
    if len(length) > 15 or int(length) > UPLOAD_BYTES:
        raise UploadRefused(413, f"at most {UPLOAD_BYTES >> 20} MiB", "cut the file into pieces")
