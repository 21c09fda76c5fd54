"""Odd and damaged sound files: each gives the right speech, or an error of one line. All of them are made here."""

from __future__ import annotations

import gzip
import io
import os
import re
import struct
import sys
from collections.abc import Callable
from contextlib import nullcontext
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest
import soundfile

from cospeech import InputError, Speech
from cospeech.audio import _decode
from cospeech.audio.speech import open_speech
from cospeech.audio.worker import FileRefused
from cospeech.errors import CospeechWarning

RATE = 16_000
TONE = (0.3 * np.sin(2 * np.pi * 200 * np.arange(RATE) / RATE)).astype(np.float32)
Make = Callable[[Path], Path | str]


def encode(samples: np.ndarray = TONE, rate: int = RATE, kind: str = "WAV", subtype: str | None = None) -> bytes:
    file = io.BytesIO()
    soundfile.write(file, samples, rate, format=kind, subtype=subtype)
    return file.getvalue()


def wav(
    data: bytes = bytes(3200), *, size: int | None = None, tag: int = 1, channels: int = 1, rate: int = RATE, bits: int = 16,
    before: bytes = b"", after: bytes = b"", fmt_size: int = 16,
) -> bytes:  # fmt: skip
    """A WAV that is written by hand, so that its header can be wrong."""
    frame = max(1, channels * bits // 8)
    fmt = struct.pack("<HHIIHH", tag, channels, rate, rate * frame & 0xFFFFFFFF, frame & 0xFFFF, bits)
    chunks = b"WAVEfmt " + struct.pack("<I", fmt_size) + fmt + before
    chunks += b"data" + struct.pack("<I", len(data) if size is None else size) + data + after
    return b"RIFF" + struct.pack("<I", len(chunks)) + chunks


def holding(data: bytes, name: str = "a.wav") -> Make:
    def make(folder: Path) -> Path:
        (folder / name).write_bytes(data)
        return folder / name

    return make


def floats(at: int, value: float) -> Make:
    samples = TONE.copy()
    samples[at] = value
    return holding(encode(samples, subtype="FLOAT"))


def flip_bytes(data: bytes, at: float, count: int = 200) -> bytes:
    """The data with ``count`` bytes inverted, from the share ``at`` (0 … 1) of its length on."""
    first = int(len(data) * at)
    return data[:first] + bytes(255 - byte for byte in data[first : first + count]) + data[first + count :]


def fifo(folder: Path) -> Path:
    os.mkfifo(folder / "a.wav")
    return folder / "a.wav"


def link_to_nothing(folder: Path) -> Path:
    (folder / "a.wav").symlink_to(folder / "nothing.wav")
    return folder / "a.wav"


def looping_link(folder: Path) -> Path:
    (folder / "a.wav").symlink_to(folder / "a.wav")
    return folder / "a.wav"


def file_as_folder(folder: Path) -> Path:
    return holding(encode())(folder) / "b.wav"


def video_without_sound(folder: Path) -> Path:
    with av.open(str(folder / "a.mp4"), "w") as out:
        stream = out.add_stream("mpeg4", rate=10)
        stream.width = stream.height = 64
        for i in range(5):
            frame = av.VideoFrame.from_ndarray(np.full((64, 64, 3), i, np.uint8), format="rgb24")
            out.mux(stream.encode(frame))
        out.mux(stream.encode(None))
    return folder / "a.mp4"


def aac() -> bytes:
    file = io.BytesIO()
    with av.open(file, "w", format="mp4") as out:
        stream = out.add_stream("aac", rate=RATE, layout="mono")
        for at in range(0, RATE - 1023, 1024):
            frame = av.AudioFrame.from_ndarray(TONE[None, at : at + 1024].copy(), format="fltp", layout="mono")
            frame.sample_rate, frame.pts = RATE, at
            out.mux(stream.encode(frame))
        out.mux(stream.encode(None))
    return file.getvalue()


def big_endian() -> bytes:
    """RIFX: a WAV whose numbers are all big-endian."""
    data = np.frombuffer(encode()[44:], np.int16).astype(">i2").tobytes()
    fmt = struct.pack(">HHIIHH", 1, 1, RATE, 2 * RATE, 2, 16)
    return (
        b"RIFX"
        + struct.pack(">I", 36 + len(data))
        + b"WAVEfmt "
        + struct.pack(">I", 16)
        + fmt
        + b"data"
        + struct.pack(">I", len(data))
        + data
    )


FLAC, OGG, OPUS, MP3 = (
    encode(kind=k, subtype=s) for k, s in (("FLAC", None), ("OGG", "VORBIS"), ("OGG", "OPUS"), ("MP3", None))
)
AIFF, AAC = encode(kind="AIFF"), aac()
PAGE = b"<!DOCTYPE html><html><body>404 Not Found</body></html>\n" * 40

BAD: dict[str, tuple[Make, str]] = {
    # not a file
    "missing": (lambda folder: folder / "no.wav", "No such file"),
    "empty name": (lambda folder: "", "folder|No such file"),
    "folder": (lambda folder: folder, "folder"),
    "fifo": (fifo, "pipe"),
    "null device": (lambda folder: "/dev/null", "device"),
    "zero device": (lambda folder: "/dev/zero", "device"),
    "broken link": (link_to_nothing, "No such file"),
    "looping link": (looping_link, "symbolic links"),
    "a file used as a folder": (file_as_folder, "Not a directory"),
    "NUL in the name": (lambda folder: "a\0.wav", "null"),
    "much too long a name": (lambda folder: folder / ("a" * 5000), "too long"),
    # not sound
    "0 bytes": (holding(b""), "empty"),
    "1 byte": (holding(b"R"), "not a sound file"),
    "text": (holding(b"hello, this is a talk\n"), "not a sound file"),
    "web page": (holding(PAGE), "not a sound file"),
    "json": (holding(b'{"audio": []}'), "not a sound file"),
    "png": (holding(b"\x89PNG\r\n\x1a\n" + bytes(500)), "not a sound file"),
    "pdf": (holding(b"%PDF-1.7\n" + bytes(500)), "not a sound file"),
    "zip": (holding(b"PK\x03\x04" + bytes(500)), "not a sound file"),
    "gzipped wav": (holding(gzip.compress(encode())), "not a sound file"),
    "midi": (holding(b"MThd" + bytes(100)), "not a sound file"),
    "python": (holding(Path(__file__).read_bytes()), "not a sound file"),
    "zeros": (holding(bytes(10_000)), "not a sound file"),
    "noise": (holding(np.random.default_rng(1).bytes(10_000)), "not a sound file"),
    "playlist": (holding(b"#EXTM3U\n/etc/passwd\nhttp://127.0.0.1:9/a.wav\n", "a.m3u8"), "not a sound file"),
    "session description": (holding(b"v=0\no=- 0 0 IN IP4 127.0.0.1\nm=audio 9 RTP/AVP 0\n", "a.sdp"), "not a sound file"),
    "concat script": (holding(b"ffconcat version 1.0\nfile /etc/passwd\n"), "not a sound file"),
    # WAV with a wrong header
    "RIFF and no more": (holding(b"RIFF"), "not a sound file"),
    "RIFF of nothing": (holding(b"RIFF" + bytes(4) + b"WAVE"), "not a sound file"),
    "RIFF of something else": (holding(b"RIFF" + struct.pack("<I", 100) + b"CDXA" + bytes(100)), "not a sound file"),
    "no data chunk": (holding(wav()[:36]), "not a sound file|0 samples"),
    "no samples": (holding(encode(np.zeros(0, np.float32))), "0 samples"),
    "less than a frame of data": (holding(wav(b"\1")), "0 samples|not a sound file"),
    "format chunk cut off": (holding(wav()[:28]), "not a sound file"),
    "format chunk of 4 GB": (holding(wav(fmt_size=0xFFFFFFF0)), "not a sound file"),
    "rate 0": (holding(wav(rate=0)), "rate of 0 Hz|not a sound file"),
    "rate 1": (holding(wav(rate=1)), "rate of 1 Hz"),
    "rate 7999": (holding(wav(rate=7999)), "rate of 7999 Hz"),
    "rate 384001": (holding(wav(rate=384_001)), "rate of 384001 Hz"),
    "rate 4 GHz": (holding(wav(rate=0xFFFFFFFF)), "rate of|not a sound file"),
    "no channels": (holding(wav(channels=0)), "channels|not a sound file"),
    "65535 channels": (holding(wav(bytes(300_000), channels=65_535)), "channels|not a sound file"),
    "0 bits": (holding(wav(bits=0)), "not a sound file"),
    "255 bits": (holding(wav(bits=255)), "not a sound file"),
    "unknown coding": (holding(wav(tag=0x1234)), "not a sound file"),
    "AAC in WAV": (holding(wav(tag=0xFF)), "not a sound file"),
    "float of 8 bits": (holding(wav(tag=3, bits=8)), "not a sound file"),
    # samples that are not
    "NaN": (floats(8000, np.nan), r"at 0\.50 s is nan"),
    "infinity": (floats(4000, np.inf), r"at 0\.25 s is inf"),
    "minus infinity": (floats(15_999, -np.inf), r"at 1\.00 s is -inf"),
    "all NaN": (holding(encode(np.full(100, np.nan, np.float32), subtype="FLOAT")), r"at 0\.00 s is nan"),
    "scaled to 16 bits": (holding(encode(TONE * 32_768, subtype="FLOAT")), "full scale is ±1"),
    "1e300": (holding(encode(np.full(100, 1e300), subtype="DOUBLE")), "is inf"),
    # other formats
    "FLAC header only": (holding(FLAC[:4]), "not a sound file"),
    "FLAC without frames": (holding(FLAC[:42]), "0 samples|not a sound file|damaged"),
    "FLAC with a damaged header": (holding(flip_bytes(FLAC, 0.0, 30)), "not a sound file"),
    "OGG header only": (holding(OGG[:28]), "not a"),
    "OGG with an unknown codec": (holding(OGG.replace(b"\x01vorbis", b"\x01sobriv")), "not a"),
    "Opus header only": (holding(OPUS[:47]), "not a"),
    "AIFF header only": (holding(AIFF[:12]), "not a sound file"),
    "AIFF without samples": (holding(encode(np.zeros(0, np.float32), kind="AIFF")), "0 samples"),
    "ID3 tag and nothing": (holding(b"ID3\x03\0\0\0\0\0\x0a" + bytes(10), "a.mp3"), "not a sound file"),
    "ID3 tag of 256 MB": (holding(b"ID3\x03\0\0\x7f\x7f\x7f\x7f" + bytes(100), "a.mp3"), "not a sound file"),
    "MP4 without an index": (holding(AAC[: len(AAC) // 2], "a.m4a"), "not a mov file"),
    "MP4 head only": (holding(AAC[:32], "a.m4a"), "not a mov file"),
    "MP4 of nothing": (holding(b"\0\0\0\x18ftypmp42" + bytes(12), "a.mp4"), "not a mov file|no sound"),
    "WebM head only": (holding(b"\x1a\x45\xdf\xa3" + bytes(200), "a.webm"), "not a matroska file"),
    "AAC frame of nothing": (holding(b"\xff\xf1" + bytes(200), "a.aac"), "rate of 0 Hz"),
    "video without sound": (video_without_sound, "no sound"),
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("name", BAD)
def test_bad_files_give_one_line(tmp_path, name):
    make, message = BAD[name]
    with pytest.raises(InputError, match=message) as refusal:
        Speech.load(make(tmp_path))
    assert "\n" not in str(refusal.value)
    assert len(str(refusal.value)) < 400 or "long" in name


def test_there_are_enough_of_them():
    assert len(BAD) >= 60


# What may look wrong and is not: how many seconds, and how loud at least.
ODD: dict[str, tuple[Make, float]] = {
    "mp3 called wav": (holding(MP3), 1.0),
    "wav called mp3": (holding(encode(), "a.mp3"), 1.0),
    "wav called raw": (holding(encode(), "a.raw"), 1.0),
    "wav called vox": (holding(encode(), "a.vox"), 1.0),
    "flac called ogg": (holding(FLAC, "a.ogg"), 1.0),
    "no suffix": (holding(OGG, "talk"), 1.0),
    "newline in the name": (holding(encode(), "a\nb.wav"), 1.0),
    "emoji in the name": (holding(encode(), "🎤 été.wav"), 1.0),
    "leading dash": (holding(encode(), "-i.wav"), 1.0),
    "dots": (lambda folder: holding(encode())(folder).parent / ".." / folder.name / "a.wav", 1.0),
    "quotes and blanks": (holding(encode(), "a '\"; rm -rf .wav"), 1.0),
    "bytes that are no text": (holding(encode(), os.fsdecode(b"a\xff\xfe.wav")), 1.0),
    "data size 0xFFFFFFF0": (holding(wav(encode()[44:], size=0xFFFFFFF0)), 1.0),
    "data size 0xFFFFFFFF": (holding(wav(encode()[44:], size=0xFFFFFFFF)), 1.0),
    "odd number of bytes": (holding(wav(encode()[44:] + b"\1")), 1.0),
    "chunks before the data": (
        holding(wav(encode()[44:], before=b"LIST" + struct.pack("<I", 26) + b"INFOISFT" + bytes(18))),
        1.0,
    ),
    "chunks behind the data": (holding(wav(encode()[44:], after=b"junk" + struct.pack("<I", 0xFFFFFFF0) + bytes(9))), 1.0),
    "wav cut in half": (holding(encode()[: 44 + RATE]), 0.5),
    "wav of an interrupted recorder": (holding(wav(encode()[44 : 44 + RATE], size=10**9)), 0.5),
    "big-endian wav": (holding(big_endian()), 1.0),
    "8 bits": (holding(encode(subtype="PCM_U8")), 1.0),
    "64-bit floats": (holding(encode(subtype="DOUBLE")), 1.0),
    "a little over full scale": (holding(encode(TONE * 5, subtype="FLOAT")), 1.0),
    "AU": (holding(encode(kind="AU")), 1.0),
    "CAF": (holding(encode(kind="CAF")), 1.0),
    "m4a called wav": (holding(AAC), 1.0),
    "ID3 before the MP3": (holding(b"ID3\x03\0\0\0\0\0\x0a" + bytes(10) + MP3), 1.0),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", ODD)
def test_odd_files_are_read(tmp_path, name):
    make, seconds = ODD[name]
    cut = name in ("wav cut in half", "wav of an interrupted recorder")
    with pytest.warns(CospeechWarning, match="cut short") if cut else nullcontext():
        speech = Speech.load(make(tmp_path))
    assert speech.seconds == pytest.approx(seconds, abs=0.08 if "m4a" in name or "MP3" in name or "mp3" in name else 0.001)
    assert np.abs(speech.samples).max() > 0.25
    assert speech.frames(30) == -(-speech.duration * 30 // 1)


@pytest.mark.parametrize("level", [0.0, 1.0, -1.0])
def test_silence_and_direct_current_are_speech(tmp_path, level):
    soundfile.write(tmp_path / "a.wav", np.full(RATE, level), RATE, subtype="FLOAT")
    speech = Speech.load(tmp_path / "a.wav")
    assert speech.samples == pytest.approx(level)


def test_unreadable(tmp_path):
    path = holding(encode())(tmp_path)
    path.chmod(0)
    if os.access(path, os.R_OK):
        pytest.skip("this user may read everything (root)")
    with pytest.raises(InputError, match="Permission denied"):
        Speech.load(path)


LONG = np.tile(TONE, 10) + np.random.default_rng(0).standard_normal(10 * RATE).astype(np.float32) * 0.05


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "subtype"), [("FLAC", None), ("OGG", "VORBIS"), ("OGG", "OPUS"), ("MP3", None), ("AIFF", None)]
)
def test_a_file_cut_off_gives_what_it_holds(tmp_path, kind, subtype):
    whole = encode(LONG, kind=kind, subtype=subtype)
    with (
        nullcontext() if kind == "OGG" else pytest.warns(CospeechWarning, match="cut short")
    ):  # Ogg tells its length at its end
        speech = Speech.load(holding(whole[: len(whole) * 2 // 3])(tmp_path))
    assert 5 < speech.seconds < 7
    if kind in ("FLAC", "AIFF"):
        np.testing.assert_allclose(speech.samples, LONG[: len(speech)], atol=1e-4)


def test_a_flac_damaged_in_the_middle_says_where(tmp_path):
    data = flip_bytes(encode(LONG, kind="FLAC"), 0.5)
    with pytest.raises(InputError, match=r"damaged at (4\.[5-9]|5\.[0-5]) s"):
        Speech.load(holding(data)(tmp_path))


@pytest.mark.slow
@pytest.mark.parametrize("subtype", ["VORBIS", "OPUS"])
def test_an_ogg_with_a_hole_is_not_read_out_of_step(tmp_path, subtype):
    whole = encode(LONG, kind="OGG", subtype=subtype)
    middle = len(whole) // 2
    data = whole[:middle] + bytes(5000) + whole[middle + 5000 :]
    with pytest.raises(InputError, match=r"damaged: .* s in the midst"):
        Speech.load(holding(data)(tmp_path))


@pytest.mark.parametrize("size", [0, 1, 0xFFFFFFFF, 0xFFFFFFF8, 0x7FFFFFFF])
def test_the_info_chunk_that_hangs_libsndfile(tmp_path, size):
    """libsndfile 1.2.2, issue 1118: INFO entries whose sizes point backwards or at themselves; reading ends soon."""
    chunk = b"LIST" + struct.pack("<I", 40) + b"INFO" + (b"ISFT" + struct.pack("<I", size)) * 4
    path = holding(wav(bytes(20), before=chunk))(tmp_path)
    if size in (0, 0xFFFFFFFF):
        assert Speech.load(path).seconds == 10 / RATE
    else:  # the entry swallows the samples
        with pytest.raises(InputError, match="not a sound file that can be read") as refusal:
            Speech.load(path)
        assert "No 'data' chunk" in str(refusal.value.__cause__)


@pytest.mark.parametrize(
    ("before", "bits"), [(b"", 16), (b"LIST\x05\0\0\0abcde\0", 16), (b"", 24)], ids=["plain", "odd chunk before", "24 bits"]
)
def test_a_wav_that_is_cut_short_says_how_much_is_there(tmp_path, before, bits):
    data = bytes(range(200)) * (RATE * 3 // 2 * bits // 8 // 200)  # 1.5 s
    path = holding(wav(data, size=RATE * 6 * bits // 8, before=before, bits=bits))(tmp_path)
    with pytest.warns(CospeechWarning) as notes:
        speech = Speech.load(path)
    assert [str(each.message) for each in notes] == [f"{path.name!r} is cut short: its header says 6 s, and 1.5 s are there"]
    assert speech.seconds == 1.5


@pytest.mark.parametrize(("name", "subtype"), [("a.flac", "PCM_16"), ("a.mp3", "MPEG_LAYER_III"), ("a.aiff", "PCM_16")])
def test_other_sounds_that_are_cut_short_say_how_much_is_there(tmp_path, name, subtype):
    samples = np.random.default_rng(0).normal(0, 0.1, 8 * RATE)
    soundfile.write(tmp_path / name, samples, RATE, subtype)
    assert abs(Speech.load(tmp_path / name).seconds - 8) < 0.1
    data = (tmp_path / name).read_bytes()
    (tmp_path / name).write_bytes(data[: len(data) // 2])
    with pytest.warns(CospeechWarning) as notes:
        speech = Speech.load(tmp_path / name)
    assert len(notes) == 1
    assert re.fullmatch(
        rf"'{name}' is cut short: its header says (8|8\.0\d*) s, and [34]\.\d+ s are there", str(notes[0].message)
    )
    assert 3 < speech.seconds < 5


def test_an_mp3_that_does_not_tell_its_length_is_whole_or_refused(tmp_path, monkeypatch):
    """It begins loudly, so it looks short by the rate of its first frame. Its tag says "Info:", which no frame of it does."""
    file, samples = io.BytesIO(), np.append(np.random.default_rng(0).normal(0, 0.2, 5 * RATE), np.zeros(5 * RATE))
    soundfile.write(file, samples, RATE, format="MP3", bitrate_mode="VARIABLE", compression_level=0.5)
    data = file.getvalue()
    tells = data.index(b"Xing")
    data = data[: data.rindex(b"\xff\xf3", 0, tells)] + data[data.index(b"\xff\xf3", tells) :]  # without that frame
    tag = b"TXXX" + struct.pack(">I", 20) + b"\0\0\0Info: made by us\0\0\0"
    path = holding(b"ID3\x04\0\0\0\0\0" + bytes([len(tag)]) + tag + data, "a.mp3")(tmp_path)
    assert Speech.load(path).seconds == pytest.approx(10, abs=0.2)
    monkeypatch.setitem(sys.modules, "av", None)  # as if it were not installed
    with pytest.raises(FileRefused, match="MP3 that do not say how long they are need FFmpeg's decoders"):
        _decode.decode(os.fsencode(path))


def test_sound_that_begins_after_the_picture_is_timed_to_the_picture(tmp_path):
    path = tmp_path / "late.mp4"
    with av.open(str(path), "w") as film:
        pictures, sound = film.add_stream("mpeg4", rate=25), film.add_stream("aac", rate=48_000, layout="mono")
        pictures.width = pictures.height = 64
        for k in range(50):
            frame = av.VideoFrame.from_ndarray(np.zeros((64, 64, 3), np.uint8), "rgb24")
            frame.pts, frame.time_base = k, Fraction(1, 25)
            film.mux(pictures.encode(frame))
        for k in range(70):
            frame = av.AudioFrame.from_ndarray(np.full((1, 1024), 0.25, np.float32), "fltp", "mono")
            frame.sample_rate, frame.pts, frame.time_base = 48_000, 24_000 + 1024 * k, Fraction(1, 48_000)
            film.mux(sound.encode(frame))
        film.mux(pictures.encode(None))
        film.mux(sound.encode(None))
    with pytest.warns(CospeechWarning, match=r"'late.mp4': its sound begins 0\.48 s after its picture"):
        source = open_speech(path)
    samples = np.concatenate(list(source.blocks()))
    assert len(np.concatenate(list(source.blocks()))) == len(samples)  # and it is told once
    begins = np.flatnonzero(np.abs(samples) > 0.1)[0] / RATE
    assert begins == pytest.approx(0.5, abs=0.06)


def test_a_cut_wav_that_is_read_twice_is_told_once(tmp_path):
    source = open_speech(holding(wav(size=6400))(tmp_path))
    with pytest.warns(CospeechWarning, match="cut short"):
        list(source.blocks())
    assert len(list(source.blocks())) == 1


@pytest.mark.parametrize(
    "size", [0xFFFFFFFF, 0x7FFFF000, 0x80000000, 48_320], ids=["FFmpeg in a pipe", "SoX in a pipe", "arecord", "10 ms"]
)
def test_a_wav_whose_header_cannot_know_its_length_is_not_cut_short(tmp_path, size):
    assert Speech.load(holding(wav(bytes(range(200)) * 240, size=size))(tmp_path)).seconds == 1.5  # warnings are errors here
