"""The decoder: a process of its own that turns sound files into blocks of float32, so that a crash in a codec stays there.

`cospeech.audio.worker` starts it for `cospeech.audio.decoding`; nothing else of the package is imported. A request ``P`` is the
path of a file. Messages that answer it:

    H  JSON {"rate", "channels", "frames",     frames is what the library expects, -1 where it does not know; lead is how many
             "lead"}                           of them are silence, because the sound begins after the picture
    B  float32 samples, channels interleaved
    E  JSON {"frames", "announced"}            the end: frames that really came; announced is what a file that was cut short
                                               says that it has, -1 where nothing is missing
    X  JSON {"problem", "hint", "ours",        it failed; `ours` where the file is not to blame; `detail` is what the library
             "detail"}                         that decodes says of it, for `--debug`

The format is found by content: libsndfile first, then, for containers it does not know (MP4, WebM, AAC, …), FFmpeg through
PyAV, with the demuxer fixed by the first bytes: FFmpeg's own probing would also follow playlists to other files and hosts.
"""

from __future__ import annotations

import os
import sys
from types import ModuleType
from typing import Any, Literal

from cospeech.audio.worker import FileRefused, requests, send, send_json

__all__ = ["serve"]

BLOCK_SAMPLES = 1 << 17  # ours: samples per message over all channels (512 KiB)
STEP_FRAMES = 2048  # ours: frames per read; at most so many are lost before a damaged place
MP3_FRAME = 64  # bytes of the first frame of an MP3 that may state its length; the format: at most 42
MOST_FRAMES = 1 << 48  # ours: a larger number means that the file does not state its length
AV_SECOND = 1_000_000  # FFmpeg's AV_TIME_BASE: units in a second, for the time at which a film begins
LATEST = 3600.0  # seconds; ours: if the sound begins later, the file is damaged
HOLE = 0.05  # seconds; ours: a shift of speech against motion by less than two frames is not seen

# First bytes → FFmpeg's name for the demuxer. Offset 4 for ISO media ("....ftyp").
CONTAINERS = (
    (4, b"ftyp", "mov"),
    (0, b"\x1a\x45\xdf\xa3", "matroska"),
    (0, b"\xff\xf1", "aac"),
    (0, b"\xff\xf9", "aac"),
    (0, b"#!AMR", "amr"),
    (0, b"\x30\x26\xb2\x75\x8e\x66\xcf\x11", "asf"),
    (8, b"AVI ", "avi"),
    (0, b"FLV\x01", "flv"),
    (0, b"wvpk", "wv"),
    (0, b"MAC ", "ape"),
    (0, b"OggS", "ogg"),
)


# A WAV whose length was not known when its header was written announces 0 bytes, or nearly 2 or 4 GiB: FFmpeg in a pipe
# 0xFFFFFFFF, SoX 0x7FFFF000, arecord 0x80000000 (their sources).
UNKNOWN_SIZE = 0x7FFF0000
CHUNKS: dict[tuple[bytes, bytes], tuple[Literal["little", "big"], bytes]] = {
    (b"RIFF", b"WAVE"): ("little", b"data"), (b"FORM", b"AIFF"): ("big", b"SSND"), (b"FORM", b"AIFC"): ("big", b"SSND"),
}  # fmt: skip
"""First bytes of formats of chunks → the order of their bytes, and the chunk of the samples."""
MOST_CHUNKS = 64  # ours: chunks of a WAV before its samples


def demuxer(head: bytes) -> str | None:
    return next((name for at, magic, name in CONTAINERS if head[at : at + len(magic)] == magic), None)


def import_soundfile() -> Any:
    """Import soundfile, without numpy if that is possible.

    When it is imported, soundfile names types of numpy; to fill a buffer it needs nothing of numpy. Importing numpy takes half
    of the time until a file is open.
    """
    if "numpy" not in sys.modules and "soundfile" not in sys.modules:
        sys.modules["numpy"] = stand_in = ModuleType("numpy")
        vars(stand_in).update(ndarray=list, dtype=list, float32=float, float64=float, int32=int, int16=int)
        try:
            import soundfile
        except (AttributeError, ImportError, TypeError):  # another version of it, which needs more
            sys.modules.pop("soundfile", None)
        finally:
            del sys.modules["numpy"]
    import soundfile

    return soundfile


def decode(path: bytes) -> tuple[int, int]:
    """Send the header and blocks of one file; give the number of frames, and the number that it announces (-1 if not more)."""
    soundfile = import_soundfile()

    class Straight(soundfile.SoundFile):  # type: ignore[name-defined]  # imported there
        """Reads from start to end. After every read, soundfile seeks to its place, which shifts the sound in MP3 and Vorbis."""

        def seekable(self) -> bool:
            return False

    # Opened by number: libsndfile would trust the suffix of a name.
    with os.fdopen(os.open(path, os.O_RDONLY | getattr(os, "O_BINARY", 0)), "rb") as file:
        head = file.read(16)
        factor, is_exact = find_overstatement(file, head), has_length(file)
        file.seek(0)
        container = demuxer(head)
        try:
            sound = Straight(file)
        except soundfile.LibsndfileError as error:
            file.seek(0)
            if container:
                return decode_container(file, container)
            raise FileRefused("not a sound file that can be read", "WAV, FLAC, OGG, MP3 and AIFF can", detail=error) from None
        with sound:
            if sound.format == "MP3" and not is_exact:  # libsndfile guesses its end, often too early
                file.seek(0)
                return decode_container(file, "mp3")
            frames = decode_sound(sound, file)
            claim = sound.frames * (factor if factor > 1 else is_exact)
            return frames, round(claim) if HOLE * sound.samplerate < claim - frames < MOST_FRAMES else -1


def has_length(file) -> bool:  # type: ignore[no-untyped-def]
    """Whether a FLAC or an MP3 states its length; libsndfile guesses the length of other MP3."""
    file.seek(0)
    head, at = file.read(10), 0
    if head[:3] == b"ID3":  # a tag before the sound, whose size has seven bits in each byte
        at = 10 + sum(byte << shift for byte, shift in zip(head[6:10], (21, 14, 7, 0), strict=True))
    file.seek(at)
    start = file.read(MP3_FRAME)
    return head[:4] == b"fLaC" or (start[:1] == b"\xff" and (b"Xing" in start or b"Info" in start))


def find_overstatement(file, head: bytes) -> float:  # type: ignore[no-untyped-def]
    """The length that a WAV or AIFF states, over the length that it has; 1 where nothing is missing, or nobody can tell."""
    if (head[:4], head[8:12]) not in CHUNKS:
        return 1.0
    order, name = CHUNKS[head[:4], head[8:12]]
    at, end = 12, os.fstat(file.fileno()).st_size
    for _ in range(MOST_CHUNKS):
        file.seek(at)
        chunk = file.read(8)
        if len(chunk) < 8:
            break
        size = int.from_bytes(chunk[4:], order)
        if chunk[:4] == name:
            there = end - at - 8
            return size / there if 0 < there < size < UNKNOWN_SIZE else 1.0
        at += 8 + size + size % 2
    return 1.0


def decode_sound(sound, file) -> int:  # type: ignore[no-untyped-def]  # soundfile is imported where it is needed
    """Send a sound in whole messages, and count its frames. It is read in small steps: an error costs one step."""
    channels, frames = sound.channels, 0
    send_json(b"H", rate=sound.samplerate, channels=channels, frames=min(sound.frames, 1 << 62), lead=0)
    steps = max(1, BLOCK_SAMPLES // (channels * STEP_FRAMES))
    buffer = memoryview(bytearray(steps * STEP_FRAMES * channels * 4))
    while True:
        size, more = fill(sound, file, buffer, frames)
        frames += size // (channels * 4)
        if size:
            send(b"B", buffer[:size])
        if not more:
            break
    # An Ogg file states its length at its end. If a part is missing, the sound after it would come too early.
    gap = (sound.frames - frames) / sound.samplerate if sound.format == "OGG" else 0
    if frames and gap > HOLE:
        raise FileRefused(f"damaged: {gap:.1f} s in the midst of it cannot be decoded", "re-save it from its source")
    return frames


def fill(sound, file, buffer: memoryview, before: int) -> tuple[int, bool]:  # type: ignore[no-untyped-def]
    """Fill the buffer; give the number of bytes, and whether there may be more.

    An error behind the last byte of the file means that the file is cut off: the samples before the error count.
    """
    import soundfile

    width = sound.channels * 4
    size = 0
    while size < len(buffer):
        try:
            count = sound.buffer_read_into(buffer[size : size + STEP_FRAMES * width], dtype="float32")
        except soundfile.LibsndfileError as error:
            if file.tell() >= os.fstat(file.fileno()).st_size and before + size > 0:
                return size, False
            at = (before + size // width) / max(sound.samplerate, 1)
            raise FileRefused(f"damaged at {at:.1f} s", "re-save it from its source, or cut it there", detail=error) from None
        size += count * width
        if count <= 0:  # a smaller count than asked for may be a hole in a damaged Vorbis stream
            return size, False
    return size, True


def decode_container(file, container: str) -> tuple[int, int]:  # type: ignore[no-untyped-def]
    """Decode MP4, WebM and the like by PyAV: the first audio stream, with silence until it begins."""
    try:
        import av
    except ImportError:
        what = "MP3 that do not say how long they are" if container == "mp3" else f"{container} media"
        raise FileRefused(f"{what} need FFmpeg's decoders", 'in a clone: pip install -e ".[av]"; or save it as WAV') from None
    frames = lead = 0
    try:
        with av.open(file, format=container, mode="r") as media:
            if not media.streams.audio:
                raise FileRefused("it has no sound in it", "export it with its audio track")
            stream = media.streams.audio[0]
            stream.codec_context.thread_count = 1
            rate, channels = stream.codec_context.sample_rate, stream.codec_context.channels
            lead = find_lead(media, stream)
            claim = -1 if stream.duration is None else round(float(stream.duration * stream.time_base) * rate) + lead
            send_json(b"H", rate=rate, channels=channels, frames=claim, lead=lead)
            for start in range(0, lead, BLOCK_SAMPLES // channels):
                send(b"B", bytes(min(BLOCK_SAMPLES // channels, lead - start) * channels * 4))
            frames += lead
            resampler = av.AudioResampler(format="flt", layout=stream.codec_context.layout, rate=rate)
            for frame in media.decode(stream):
                for piece in resampler.resample(frame):
                    frames += piece.samples
                    send(b"B", memoryview(piece.planes[0])[: piece.samples * channels * 4])
            return frames, -1
    except av.FFmpegError as error:
        problem = f"damaged at {frames / rate:.1f} s" if frames > lead else f"not a {container} file that can be read"
        raise FileRefused(problem, "re-save it from its source, or save it as WAV", detail=error) from None


def find_lead(media, stream) -> int:  # type: ignore[no-untyped-def]
    """Samples by which the sound of a film begins after the film."""
    if stream.start_time is None or media.start_time is None or not media.streams.video:
        return 0
    late = float(stream.start_time * stream.time_base) - media.start_time / AV_SECOND
    return round(late * stream.codec_context.sample_rate) if HOLE < late < LATEST else 0


def serve() -> None:
    """Decode the files that are asked for."""
    for _, path in requests():
        try:
            frames, claim = decode(path)
            send_json(b"E", frames=frames, announced=claim)
        except Exception as error:  # a damaged file may bring a library to raise anything
            send_json(b"X", **refusal(error).message)


def refusal(error: Exception) -> FileRefused:
    """Make a message for the user of any error."""
    if isinstance(error, FileRefused):
        return error
    if isinstance(error, OSError):
        return FileRefused(f"cannot be read: {error.strerror or error}")
    if isinstance(error, MemoryError):
        return FileRefused("its decoder wants more memory than a sound file should", "save it as WAV")
    if isinstance(error, ImportError):
        return FileRefused(f"the decoder cannot start: {error}", "reinstall cospeech", ours=True)
    return FileRefused("cannot be decoded", "save it as WAV", detail=f"{type(error).__name__}: {error}")
