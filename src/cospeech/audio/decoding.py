"""Run the decoder: a child process (`_decode.py`) that may crash, hang or send nonsense without harm to us.

Everything that it sends is checked. A crash, ten seconds of silence or nonsense is an `InputError` about the file. The process
ends when the work is done or given up, whatever the reason. Where no process can be started, a thread does the work,
without this protection.
"""

from __future__ import annotations

import json
import os
import warnings
from collections.abc import Iterator
from pathlib import Path

from ..errors import CospeechWarning, InputError, InternalError
from ..limits import (  # fmt: skip
    BLOCK_TIMEOUT,
    CHANNELS,
    DECODER_CPU_SECONDS,
    DECODER_MEMORY,
    LONGEST_MESSAGE_BYTES,
    OPEN_TIMEOUT,
    SOUND_RATES,
)
from .interpreter import find_interpreter
from .worker import TooLong, Worker, WorkerEnded, worker_command

__all__ = ["SoundDecoder"]

_HEADER = ("rate", "channels", "frames", "lead")


def _command() -> list[str]:
    return worker_command(Path(__file__).with_name("_decode.py"), memory=DECODER_MEMORY, cpu_seconds=DECODER_CPU_SECONDS)


def _start() -> Worker:
    if find_interpreter() is not None:
        return Worker(_command())
    from ._decode import serve
    from .worker_thread import ThreadWorker

    return ThreadWorker(serve)


class SoundDecoder:
    """A decoder process for one file; `_decode.py` says what it sends.

    Args:
        path: of the file.
        name: how messages call it.
        notes: whether to warn that a file is cut short, or that its sound is late; not when it is read again.
    """

    def __init__(self, path: Path, name: str, notes: bool = True) -> None:
        self.name, self._timeout, self._notes = name, OPEN_TIMEOUT, notes
        self._worker = _start()
        self._worker.request(b"P", os.fsencode(path), last=True)

    def header(self) -> tuple[int, int, int]:
        """Rate, channels and claimed frames of the file."""
        kind, payload = self._message()
        if kind != b"H":
            raise self._make_error(f"sent {kind!r} before its header")
        self._timeout = BLOCK_TIMEOUT
        values = self._json(payload)
        try:
            rate, channels, claim, lead = (int(values[key]) for key in _HEADER)  # type: ignore[call-overload]
        except (KeyError, TypeError, ValueError):
            raise self._make_error("sent a header that makes no sense") from None
        if not SOUND_RATES[0] <= rate <= SOUND_RATES[1]:
            raise InputError(
                f"{self.name!r} has a sample rate of {rate} Hz", f"{SOUND_RATES[0]} … {SOUND_RATES[1]} Hz can be read"
            )
        if not 1 <= channels <= CHANNELS:
            raise InputError(f"{self.name!r} has {channels} channels", f"1 … {CHANNELS} can be read")
        self._width, self._rate = 4 * channels, rate
        if self._notes and lead > 0:
            late = f"{self.name!r}: its sound begins {lead / rate:.2f} s after its picture"
            warnings.warn(f"{late}; times are those of the picture", CospeechWarning, stacklevel=2)
        return rate, channels, claim

    def blocks(self) -> Iterator[bytes]:
        """Interleaved float32 of whole frames, until the decoder says that this is all. Warns if the file announced more."""
        frames = 0
        while True:
            kind, payload = self._message()
            if kind == b"E":
                end = self._json(payload)
                if end.get("frames") != frames:
                    raise self._make_error("lost samples on the way")
                claim = end.get("announced")
                if self._notes and frames and isinstance(claim, int) and claim > frames:
                    length, there = claim / self._rate, frames / self._rate
                    problem = f"{self.name!r} is cut short: its header says {length:.4g} s, and {there:.4g} s are there"
                    warnings.warn(problem, CospeechWarning, stacklevel=2)
                return
            if kind != b"B" or len(payload) % self._width:
                raise self._make_error(f"sent {len(payload)} bytes of {kind!r}")
            if payload:
                frames += len(payload) // self._width
                yield payload

    def _message(self) -> tuple[bytes, bytes]:
        try:
            kind, payload = self._worker.receive(LONGEST_MESSAGE_BYTES, self._timeout)
        except TooLong as error:
            raise self._make_error(f"announced {error}") from None
        except WorkerEnded as ended:
            if ended.late:
                problem = f"the decoder hangs on {self.name!r}: nothing for {self._timeout:g} s"
                raise InputError(problem, "is the computer very busy? then try again; else save it anew, as WAV") from None
            raise self._make_error("crashed", f" ({ended})") from None
        if kind == b"X":
            values = self._json(payload)
            failure = InternalError if values.get("ours") else InputError
            detail = RuntimeError(str(values["detail"])) if values.get("detail") else None  # shown by --debug alone
            raise failure(f"{self.name!r}: {values.get('problem')}", str(values.get("hint", ""))) from detail
        return kind, payload

    def _json(self, payload: bytes) -> dict[str, object]:
        try:
            values = json.loads(payload)
        except ValueError:
            values = None
        if not isinstance(values, dict):
            raise self._make_error("sent a message that makes no sense")
        return values

    def _make_error(self, what: str, why: str = "") -> InputError:
        return InputError(f"the decoder {what} on {self.name!r}{why}", "the file is damaged; save it anew, as WAV")

    def close(self) -> None:
        """Kill the process if it still runs, and collect it."""
        self._worker.close()
