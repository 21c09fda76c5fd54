"""Sound that comes while somebody speaks: from a microphone, a pipe, a WebSocket, or a file at the speed of its clock.

Every source gives blocks of float32 samples; `pace_pieces` makes of them pieces of speech without a gap, with silence where
nothing comes. So the clock of the sound and the clock on the wall stay together, and a character idles while nobody speaks.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .speech import Speech
from .waiting_sound import WaitingSound

__all__ = [
    "BEHIND", "FORMATS", "PIECE", "SLACK", "decode_pcm", "pace_pieces", "read_lines", "read_microphone", "read_pcm",
    "read_websocket", "wait_for_each",
]  # fmt: skip

PIECE = 0.02  # seconds of a piece: what telephones and browsers send (ours)
FORMATS: dict[str, np.dtype[Any]] = {"s16": np.dtype("<i2"), "f32": np.dtype("<f4")}
"""Raw samples: whole numbers of 16 bits, floats of 32 bits; little-endian, one channel."""
SLACK = 0.03  # seconds that sound may be late before silence takes its place (ours: half of the pacing's margin)
_LINE = 1 << 16  # bytes of a line (ours)
BEHIND = 300.0  # seconds of sound that may wait: who sends more is made to wait (ours: longer than an answer)

Samples = NDArray[np.float32]


def pace_pieces(
    blocks: Iterable[Samples],
    rate: int,
    *,
    idle: bool = True,
    slack: float = SLACK,
    waiting: WaitingSound | None = None,
    clock: Callable[[], float] = time.monotonic,
    sleep: Callable[[float], None] = time.sleep,
) -> Iterator[Speech]:
    """Pieces of `PIECE` seconds, each when its last sample is due.

    Args:
        blocks: (n,) samples; they may come in bursts, early or late. Their end is the end of the speech.
        rate: samples per second.
        idle: put silence where no sound has come in time; else the pieces wait for it.
        slack: seconds that sound may be late. A piece leaves so late where sound ceases; the silence after it is on time.
        waiting: where the blocks wait, for who wants to drop them.

    Yields:
        Speech without a gap; the first piece begins at 0.
    """
    size = max(1, round(PIECE * rate))
    sound = WaitingSound(round(BEHIND * rate)) if waiting is None else waiting
    threading.Thread(target=_collect, args=(blocks, sound), name="cospeech sound", daemon=True).start()
    began, heard, rest, quiet = clock(), 0, np.zeros(0, np.float32), False
    while True:
        rest = rest[max(sound.dropped - (sound.taken - len(rest)), 0) :]
        due = began + (heard + size) / rate
        while len(rest) < size and not sound.is_over:
            late = 0.0 if quiet and not len(rest) else slack
            block = sound.take(max(due + late - clock(), 0.0) if idle else None)
            if block is None:
                break
            rest = np.concatenate([rest, block])
        sound.piece, quiet = sound.taken - len(rest), not len(rest)
        if len(rest) < size and not sound.is_over:
            rest = np.concatenate([rest, np.zeros(size - len(rest), np.float32)])
        piece, rest = rest[:size], rest[size:]
        if not len(piece):
            return
        if (wait := due - clock()) > 0:
            sleep(wait)
        yield Speech(piece, rate, start=heard / rate)
        heard += len(piece)


def wait_for_each(
    pieces: Iterable[Speech],
    *,
    clock: Callable[[], float] = time.monotonic,
    sleep: Callable[[float], None] = time.sleep,
) -> Iterator[Speech]:
    """Pieces of a recording, each when its last sample would have been spoken."""
    began = clock()
    for piece in pieces:
        if (wait := began + piece.start + float(piece.duration) - clock()) > 0:
            sleep(wait)
        yield piece


def _collect(blocks: Iterable[Samples], waiting: WaitingSound) -> None:
    """In a thread: what comes, to its end or to the error that ends it."""
    try:
        for block in blocks:
            waiting.put(block)
        waiting.end()
    except Exception as error:  # it is raised again where the pieces are taken
        waiting.end(error)


def read_pcm(
    file: IO[bytes], rate: int, kind: str = "s16", *, note: Callable[[str], object] = lambda text: None
) -> Iterator[Samples]:
    """Raw samples of a pipe, as they come; ``note`` is told once of each fault that they have."""
    read = getattr(file, "read1", file.read)  # what there is, without waiting for more
    dtype, rest = FORMATS[kind], b""
    check = _make_check(kind, note)
    while data := read(max(1, round(PIECE * rate)) * dtype.itemsize):
        data = rest + data
        whole = len(data) - len(data) % dtype.itemsize
        check(data[:whole])
        yield decode_pcm(data[:whole], kind)
        rest = data[whole:]
    if rest:
        note(f"the sound ends within a sample; {_bytes(len(rest))} left out (samples are {kind}, little-endian)")


def read_lines(number: int = 0) -> Iterator[bytes]:
    """Lines of standard input, or of another file descriptor, as they come; without a lock that would hold up the end."""
    with open(number, "rb", buffering=0, closefd=False) as file:
        while line := file.readline(_LINE):
            yield line


def decode_pcm(data: bytes, kind: str) -> Samples:
    """Bytes → float32 samples, full scale ±1; what is no number becomes silence."""
    values = np.frombuffer(data, FORMATS[kind])
    if kind == "s16":
        return values.astype(np.float32) / np.float32(32768)
    return np.clip(np.nan_to_num(values.astype(np.float32), posinf=0, neginf=0), -1, 1)


def read_websocket(
    connection: Iterable[str | bytes],
    kind: str = "s16",
    on_text: Callable[[str], object] | None = None,
    *,
    note: Callable[[str], object] = lambda text: None,
) -> Iterator[Samples]:
    """The binary messages of a WebSocket, each a whole number of samples; texts are given to ``on_text``.

    Bytes after the last whole sample of a message are left out. ``note`` is told once of each fault that messages have.
    """
    check = _make_check(kind, note)
    for message in connection:
        if isinstance(message, str):
            if on_text is not None:
                on_text(message)
            continue
        check(message)
        if whole := len(message) - len(message) % FORMATS[kind].itemsize:
            yield decode_pcm(message[:whole], kind)


def _make_check(kind: str, note: Callable[[str], object]) -> Callable[[bytes], None]:
    """A function that looks at raw samples, and tells of each kind of fault the first time."""
    told: set[str] = set()

    def tell(fault: str, text: str) -> None:
        if fault not in told:
            told.add(fault)
            note(text)

    def check(data: bytes) -> None:
        size = FORMATS[kind].itemsize
        if odd := len(data) % size:
            end = f"a message of {_bytes(len(data))} ends within a sample; {_bytes(odd)} left out"
            tell("odd", f"{end}, also of messages to come (samples are {kind}, little-endian)")
        values = np.frombuffer(data, FORMATS[kind], len(data) // size)
        if kind == "f32" and not np.isfinite(values).all():
            tell("number", f"samples that are NaN or infinite are heard as silence (samples are {kind}, little-endian)")

    return check


def _bytes(count: int) -> str:
    return f"{count} byte" if count == 1 else f"{count} bytes"


def read_microphone(rate: int) -> Iterator[Samples]:
    """The default microphone, until the program is interrupted (the extra ``live``). It is opened at once.

    Raises:
        InputError: there is no library, or no microphone.
    """
    try:
        import sounddevice
    except (ImportError, OSError) as error:  # OSError: the system has no PortAudio
        hint = "pip install 'cospeech[live]'" if isinstance(error, ImportError) else "apt install libportaudio2"
        raise InputError("the microphone needs the package sounddevice and PortAudio", hint) from None
    size = max(1, round(PIECE * rate))

    @contextmanager
    def explain() -> Iterator[None]:
        try:
            yield
        except sounddevice.PortAudioError as error:
            raise InputError(f"no sound from the microphone: {error}", "is one plugged in and allowed?") from None

    def read() -> Iterator[Samples]:
        with explain(), microphone:
            while True:
                samples, _ = microphone.read(size)
                yield np.ascontiguousarray(samples[:, 0])

    with explain():
        microphone = sounddevice.InputStream(samplerate=rate, channels=1, dtype="float32", blocksize=size)
    return read()
