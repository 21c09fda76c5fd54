"""Sound that comes while somebody speaks: from a microphone, a pipe, a WebSocket, or a file at the speed of its clock.

Every source gives blocks of float32 samples. `pace_pieces` turns them into pieces of speech without a gap, with silence where
nothing comes. So the sound keeps up with the clock, and a character idles while nobody speaks.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from os import PathLike
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, describe_extra, say_count
from .speech import Speech
from .waiting_sound import WaitingSound

__all__ = [
    "BEHIND", "FORMATS", "LINE", "PIECE", "SLACK", "decode_pcm", "pace_pieces", "read_lines", "read_microphone", "read_pcm",
    "read_websocket", "wait_for_each",
]  # fmt: skip

PIECE = 0.02  # seconds of a piece: what telephones and browsers send (ours)
FORMATS: dict[str, np.dtype[Any]] = {"s16": np.dtype("<i2"), "f32": np.dtype("<f4")}
"""Raw samples: whole numbers of 16 bits, floats of 32 bits; little-endian, one channel."""
SLACK = 0.03  # seconds that sound may be late before silence takes its place (ours: half of the pacing's margin)
_HEADS = {
    (0, b"RIFF"): "a WAV", (0, b"fLaC"): "a FLAC", (0, b"OggS"): "an Ogg", (0, b"ID3"): "an MP3",
    (0, b"\x1a\x45\xdf\xa3"): "a WebM", (4, b"ftyp"): "an MP4",
}  # fmt: skip
"""Place and first bytes of sound files → what they are. As samples of 16 bits they would be above a fifth of full scale."""
_MP3_KBPS = {
    0xFB: (0, 32, 40, 48, 56, 64, 80, 96, 112, 128, 160, 192, 224, 256, 320, 0),
    0xF3: (0, 8, 16, 24, 32, 40, 48, 56, 64, 80, 96, 112, 128, 144, 160, 0),
}
"""Second byte of a frame of MP3 (layer III of MPEG-1 and MPEG-2, without a checksum) → bit rates (ISO/IEC 11172-3, 13818-3)."""
_MP3_RATES = {0xFB: (44100, 48000, 32000), 0xF3: (22050, 24000, 16000)}
LINE = 1 << 16  # bytes of a line (ours)
_FIRST = 2048  # bytes of the first piece of a pipe [ours: more than a frame of MP3 of 320 kbit/s]
_READ = 1 << 16  # bytes that are read at once: what a pipe of Linux holds
BEHIND = 300.0  # seconds of sound that may wait; a sender of more has to wait (ours: longer than an answer)

Samples = NDArray[np.float32]


def pace_pieces(
    blocks: Iterable[Samples] | None,
    rate: int,
    *,
    idle: bool = True,
    slack: float = SLACK,
    waiting: WaitingSound | None = None,
    clock: Callable[[], float] = time.perf_counter,
    sleep: Callable[[float], None] = time.sleep,
) -> Iterator[Speech]:
    """Pieces of `PIECE` seconds, each when its last sample is due.

    Args:
        blocks: (n,) samples; they may come in bursts, early or late. Their end is the end of the speech. None: somebody else
            puts them into ``waiting``.
        rate: samples per second.
        idle: put silence where no sound has come in time; else the pieces wait for it.
        slack: seconds that sound may be late. Where sound ceases, one piece is late by so much; the silence after it is on
            time.
        waiting: the queue of the blocks, for a caller that puts or drops some.

    Yields:
        Speech without a gap; the first piece begins at 0.
    """
    size = max(1, round(PIECE * rate))
    sound = WaitingSound(round(BEHIND * rate)) if waiting is None else waiting
    if blocks is not None:
        threading.Thread(target=_collect, args=(blocks, sound), name="cospeech sound", daemon=True).start()
    began, count, rest, quiet = clock(), 0, np.zeros(0, np.float32), False
    while True:
        rest = rest[max(sound.dropped - (sound.taken - len(rest)), 0) :]
        due = began + (count + size) / rate
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
        yield Speech(piece, rate, start=count / rate)
        count += len(piece)


def wait_for_each(
    pieces: Iterable[Speech],
    *,
    clock: Callable[[], float] = time.perf_counter,
    sleep: Callable[[float], None] = time.sleep,
) -> Iterator[Speech]:
    """Pieces of a recording, each when its last sample would have been spoken."""
    began = clock()
    for piece in pieces:
        if (wait := began + piece.start + float(piece.duration) - clock()) > 0:
            sleep(wait)
        yield piece


def _collect(blocks: Iterable[Samples], waiting: WaitingSound) -> None:
    """Queue all blocks, in a thread, up to the end or to an error."""
    try:
        for block in blocks:
            waiting.put(block)
        waiting.end()
    except Exception as error:  # it is raised again where the pieces are taken
        waiting.end(error)


def read_pcm(
    file: IO[bytes], rate: int, kind: str = "s16", *, note: Callable[[str], object] = lambda text: None
) -> Iterator[Samples]:
    """Raw samples of a pipe, as they come; ``note`` is called once for each kind of fault.

    Raises:
        InputError: it is a sound file, not raw samples.
    """
    read = getattr(file, "read1", file.read)  # what there is, without waiting for more
    decoder, size = _Decoder(kind, note), max(1, round(PIECE * rate)) * FORMATS[kind].itemsize
    while data := read(size if decoder.has_begun else max(size, _FIRST)):
        yield decoder.decode(data)
    decoder.end()


def read_lines(source: int | str | PathLike[str] = 0, longest: int = LINE) -> Iterator[bytes]:
    """Lines of standard input, of another file descriptor, or of a file or pipe, as they come; no lock delays the end of the
    program.

    Args:
        source: a descriptor, which stays open, or a path.
        longest: bytes of a line; a longer one comes in parts.
    """
    rest = b""
    with open(source, "rb", buffering=0, closefd=not isinstance(source, int)) as file:
        while data := file.read(_READ):
            *lines, rest = (rest + data).split(b"\n")
            yield from (line + b"\n" for line in lines)
            if len(rest) >= longest:
                yield rest
                rest = b""
    if rest:
        yield rest


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
    """Samples of the binary messages of a WebSocket; texts are given to ``on_text``.

    A message may end within a sample: the next one goes on there. After an empty message, or a text for which ``on_text``
    returns True, a new sample begins; after an empty one somebody else may speak. ``note`` is called once for each kind of
    fault, and for each sound file that comes later.

    Raises:
        InputError: the first message is the head of a sound file, not raw samples.
    """
    decoder = _Decoder(kind, note)
    for message in connection:
        if isinstance(message, str):
            if on_text is not None and on_text(message) is True:
                decoder.end()
        elif not message:
            decoder.begin_anew()
        elif len(samples := decoder.decode(message)):
            yield samples
    decoder.end()


class _Decoder:
    """Decodes raw samples in pieces of any size; the rest of a cut sample goes before the next piece."""

    def __init__(self, kind: str, note: Callable[[str], object]) -> None:
        self._kind, self._size, self._note = kind, FORMATS[kind].itemsize, note
        self._rest, self._faults = b"", set[str]()
        self.has_begun, self._has_sound, self._skips = False, False, False
        self._layout = f"samples are {kind}, little-endian"

    def decode(self, data: bytes) -> Samples:
        """The whole samples up to the end of this piece."""
        if not self.has_begun:
            self.has_begun = True
            self._check(data)
        if self._skips:
            return np.zeros(0, np.float32)
        data = self._rest + data
        whole = len(data) - len(data) % self._size
        self._rest, data = data[whole:], data[:whole]
        if self._kind == "f32" and not np.isfinite(np.frombuffer(data, FORMATS[self._kind])).all():
            self._tell("number", f"samples that are NaN or infinite are heard as silence ({self._layout})")
        return decode_pcm(data, self._kind)

    def _check(self, data: bytes) -> None:
        """Check the first bytes of a sound. A sound file is refused; after other sound, it is noted and skipped."""
        try:
            _check_raw(data)
        except InputError as error:
            if not self._has_sound:
                raise
            self._skips = True
            self._note(f"{error}; it is not heard")
        self._has_sound = True

    def begin_anew(self) -> None:
        """Begin the sound of another speaker."""
        self.end()
        self.has_begun = self._skips = False

    def end(self) -> None:
        """End a sound; note a sample that is cut."""
        if self._rest:
            self._tell("odd", f"the sound ends within a sample; {say_count(len(self._rest), 'byte')} left out ({self._layout})")
        self._rest = b""

    def _tell(self, fault: str, text: str) -> None:
        if fault not in self._faults:
            self._faults.add(fault)
            self._note(text)


def _check_raw(data: bytes) -> None:
    """See that the first bytes of a sound are samples.

    Raises:
        InputError: they are the head of a sound file.
    """
    name = next((name for (place, head), name in _HEADS.items() if data.startswith(head, place)), None)
    if name is None and _is_mp3(data):
        name = "an MP3"
    if name is not None:
        hint = "give the file's name to --input, or send raw samples: ffmpeg -i talk.wav -f s16le -ac 1 -ar 16000 -"
        raise InputError(f"this is {name} file, not raw samples", hint)


def _is_mp3(data: bytes) -> bool:
    """Whether two frames of MP3 follow each other, without tags before them."""
    if len(data) < 4 or data[0] != 0xFF or data[1] not in _MP3_KBPS or data[2] & 0x0C == 0x0C:
        return False
    kbps, rate = _MP3_KBPS[data[1]][data[2] >> 4], _MP3_RATES[data[1]][data[2] >> 2 & 3]
    length = (144 if data[1] == 0xFB else 72) * 1000 * kbps // rate + (data[2] >> 1 & 1)
    return kbps > 0 and data[length : length + 2] == data[:2]


def read_microphone(rate: int) -> Iterator[Samples]:
    """The default microphone, until the program is interrupted (the extra ``live``). It is opened at once.

    Raises:
        InputError: there is no library, or no microphone.
    """
    try:
        import sounddevice
    except (ImportError, OSError) as error:  # OSError: the system has no PortAudio
        hint = describe_extra("live") if isinstance(error, ImportError) else "apt install libportaudio2"
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
