"""Running the decoder: a child process (`_decode.py`) that may crash, hang or lie without harm to us.

Everything that it sends is checked; a crash, ten seconds of silence or nonsense is an `InputError` about the file. The process
is gone when the work is done or given up, whatever the reason.
"""

from __future__ import annotations

import json
import os
import struct
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from ..errors import InputError, InternalError
from ..limits import (  # fmt: skip
    BLOCK_TIMEOUT,
    CHANNELS,
    DECODER_CPU_SECONDS,
    DECODER_MEMORY,
    LONGEST_MESSAGE_BYTES,
    OPEN_TIMEOUT,
    SOUND_RATES,
)

__all__ = ["SoundDecoder"]


def _command() -> list[str]:
    """How the decoder is started: isolated (-I), without site-packages hooks (-S), with our own search path and limits."""
    if not sys.executable:
        raise InternalError("no Python executable to run the decoder with", "run cospeech in an ordinary Python")
    script, paths = str(Path(__file__).with_name("_decode.py")), os.pathsep.join(sys.path)
    return [sys.executable, "-I", "-S", script, paths, str(DECODER_MEMORY), str(DECODER_CPU_SECONDS)]


class SoundDecoder:
    """One decoder process at work on one file; see `_decode.py` for what it sends."""

    def __init__(self, path: Path, name: str) -> None:
        self.name = name
        self._waiting_since: float | None = None
        self._timeout, self._late = OPEN_TIMEOUT, False
        self._done = threading.Event()
        environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}  # each thread of NumPy's BLAS would reserve address space
        self._process = subprocess.Popen(
            _command(), stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, env=environment
        )
        threading.Thread(target=self._watch, daemon=True).start()
        assert self._process.stdin is not None
        with suppress(OSError):  # it is dead already: reading will say so
            self._process.stdin.write(os.fsencode(path) + b"\0")
            self._process.stdin.close()

    def _watch(self) -> None:
        """Kill the decoder when it keeps us waiting; pipes cannot be read with a timeout on every system."""
        while not self._done.wait(0.2):
            since = self._waiting_since
            if since is not None and time.monotonic() - since > self._timeout:
                self._late = True
                self._process.kill()
                return

    def header(self) -> tuple[int, int, int]:
        """Rate, channels and claimed frames of the file."""
        kind, payload = self._message()
        if kind != b"H":
            raise self._make_error(f"sent {kind!r} before its header")
        self._timeout = BLOCK_TIMEOUT
        values = self._json(payload)
        try:
            rate, channels, claim = (int(values[key]) for key in ("rate", "channels", "frames"))  # type: ignore[call-overload]
        except (KeyError, TypeError, ValueError):
            raise self._make_error("sent a header that makes no sense") from None
        if not SOUND_RATES[0] <= rate <= SOUND_RATES[1]:
            raise InputError(
                f"{self.name!r} has a sample rate of {rate} Hz", f"{SOUND_RATES[0]} … {SOUND_RATES[1]} Hz can be read"
            )
        if not 1 <= channels <= CHANNELS:
            raise InputError(f"{self.name!r} has {channels} channels", f"1 … {CHANNELS} can be read")
        self._width = 4 * channels
        return rate, channels, claim

    def blocks(self) -> Iterator[bytes]:
        """Interleaved float32 of whole frames, until the decoder says that this is all."""
        frames = 0
        while True:
            kind, payload = self._message()
            if kind == b"E":
                if self._json(payload).get("frames") != frames:
                    raise self._make_error("lost samples on the way")
                return
            if kind != b"B" or len(payload) % self._width:
                raise self._make_error(f"sent {len(payload)} bytes of {kind!r}")
            if payload:
                frames += len(payload) // self._width
                yield payload

    def _message(self) -> tuple[bytes, bytes]:
        head = self._read(5)
        kind, size = head[:1], struct.unpack("<I", head[1:])[0]
        if size > LONGEST_MESSAGE_BYTES:
            raise self._make_error(f"announced {size} bytes")
        payload = self._read(size)
        if kind == b"X":
            values = self._json(payload)
            failure = InternalError if values.get("ours") else InputError
            detail = RuntimeError(str(values["detail"])) if values.get("detail") else None  # shown by --debug alone
            raise failure(f"{self.name!r}: {values.get('problem')}", str(values.get("hint", ""))) from detail
        return kind, payload

    def _read(self, size: int) -> bytes:
        assert self._process.stdout is not None
        self._waiting_since = time.monotonic()
        data = self._process.stdout.read(size)
        self._waiting_since = None
        if len(data) == size:
            return data
        if self._late:
            raise InputError(f"the decoder hangs on {self.name!r}: nothing for {self._timeout:g} s", "save it anew, as WAV")
        self._process.wait()
        code = self._process.returncode
        raise InputError(f"the decoder crashed on {self.name!r} (exit {code})", "the file is damaged; save it anew, as WAV")

    def _json(self, payload: bytes) -> dict[str, object]:
        try:
            values = json.loads(payload)
        except ValueError:
            values = None
        if not isinstance(values, dict):
            raise self._make_error("sent a message that makes no sense")
        return values

    def _make_error(self, what: str) -> InputError:
        return InputError(f"the decoder {what} on {self.name!r}", "the file is damaged; save it anew, as WAV")

    def close(self) -> None:
        """Kill the process if it still runs, and collect it."""
        self._done.set()
        self._process.kill()
        self._process.wait()
        for pipe in (self._process.stdin, self._process.stdout):
            if pipe is not None:
                with suppress(OSError):
                    pipe.close()
