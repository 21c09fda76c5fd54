"""Speech: exact lengths, alignment in time, channels, streams, and a decoder that may crash."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
import soundfile
from hypothesis import given, settings
from hypothesis import strategies as st

from cospeech import InputError, Speech, Word
from cospeech.audio import decoding
from cospeech.audio.speech import count_frames, example, open_speech

RATE = 16_000


def noise(count: int, channels: int = 1, seed: int = 0) -> np.ndarray:
    return (np.random.default_rng(seed).standard_normal((count, channels)) * 0.1).astype(np.float32)


def children() -> set[int]:
    """Processes whose parent is this one (Linux)."""
    processes = set()
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            fields = (folder / "stat").read_text().rsplit(")", 1)[1].split()
        except OSError:
            continue
        if int(fields[1]) == os.getpid():
            processes.add(int(folder.name))
    return processes


# ---- length ----


@pytest.mark.slow
@settings(max_examples=1000)
@given(
    frames=st.integers(0, 10**10),
    rate=st.sampled_from([8000, 11_025, 16_000, 22_050, 44_100, 48_000, 96_000, 384_000]) | st.integers(8000, 384_000),
    fps=st.sampled_from(
        [(30, 1), (25, 1), (60, 1), (120, 1), (24_000, 1001), (30_000, 1001), (60_000, 1001), (2997, 100), (1, 1)]
    ),
)
def test_frames_are_exactly_the_ceiling(frames, rate, fps):
    above, below = fps
    exact = -(-frames * above // (rate * below))
    for value in (Fraction(above, below), above / below):
        assert count_frames(Fraction(frames, rate), value) == exact


@pytest.mark.parametrize("fps", [0, -30, float("nan"), float("inf"), "thirty", None])
def test_a_frame_rate_that_is_none(fps):
    with pytest.raises(InputError, match="frames per second"):
        Speech(np.zeros(10, np.float32)).frames(fps)


@pytest.mark.slow
@settings(max_examples=12)
@given(st.integers(1, 5000), st.sampled_from([8000, 11_025, 16_000, 44_100, 48_000, 192_000, 384_000]))
def test_a_files_length_is_that_of_the_file(tmp_path_factory, count, rate):
    path = tmp_path_factory.mktemp("length") / "a.wav"
    soundfile.write(path, noise(count), rate)
    speech = Speech.load(path)
    assert speech.duration == Fraction(count, rate)
    assert speech.seconds == count / rate
    assert len(speech) == -(-count * RATE // rate)
    assert speech.frames(30) == -(-count * 30 // rate)


def test_one_sample_is_one_frame(tmp_path):
    soundfile.write(tmp_path / "one.wav", np.array([0.5]), 48_000)
    speech = Speech.load(tmp_path / "one.wav")
    assert len(speech) == speech.frames(30) == 1


# ---- time ----


@pytest.mark.slow
@pytest.mark.parametrize("rate", [8000, 11_025, 16_000, 44_100, 48_000, 384_000])
def test_an_impulse_stays_where_it_is(tmp_path, rate):
    samples = np.zeros(2 * rate, np.float32)
    samples[rate] = 0.9
    soundfile.write(tmp_path / "a.wav", samples, rate)
    speech = Speech.load(tmp_path / "a.wav")
    assert len(speech) == 2 * RATE
    assert abs(int(np.abs(speech.samples).argmax()) - RATE) <= 0.001 * RATE


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "subtype", "tolerance"),
    [
        ("FLAC", "PCM_16", 0.001),
        ("AIFF", "PCM_24", 0.001),
        ("OGG", "VORBIS", 0.002),
        ("OGG", "OPUS", 0.008),
        ("MP3", "MPEG_LAYER_III", 0.002),
    ],
)
def test_speech_starts_together_with_the_file(tmp_path, kind, subtype, tolerance):
    rate = 48_000
    samples = noise(2 * rate)[:, 0]
    samples[:rate] = 0
    soundfile.write(tmp_path / "a", samples, rate, format=kind, subtype=subtype)
    speech = Speech.load(tmp_path / "a")
    begin = np.flatnonzero(np.abs(speech.samples) > 0.05)[0] / speech.rate
    assert begin == pytest.approx(1.0, abs=tolerance)
    assert speech.seconds == pytest.approx(2.0, abs=tolerance)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "subtype"), [("WAV", "PCM_24"), ("FLAC", "PCM_16"), ("OGG", "VORBIS"), ("OGG", "OPUS"), ("MP3", "MPEG_LAYER_III")]
)
def test_read_in_pieces_it_is_what_one_read_gives(tmp_path, kind, subtype):
    soundfile.write(tmp_path / "a", noise(20 * RATE), RATE, format=kind, subtype=subtype)
    whole = soundfile.read(tmp_path / "a", dtype="float32")[0]
    np.testing.assert_allclose(Speech.load(tmp_path / "a").samples, whole, rtol=0, atol=1e-6)  # mpg123 rounds by a last bit


@pytest.mark.slow
def test_a_tone_keeps_its_level_and_pitch(tmp_path):
    for rate in (8000, 44_100, 384_000):
        t = np.arange(rate) / rate
        soundfile.write(tmp_path / "a.wav", 0.5 * np.sin(2 * np.pi * 1000 * t), rate, subtype="FLOAT")
        speech = Speech.load(tmp_path / "a.wav")
        expected = 0.5 * np.sin(2 * np.pi * 1000 * np.arange(RATE) / RATE)
        assert np.abs(speech.samples - expected)[1000:-1000].max() < 1e-3, rate


# ---- channels ----


def test_channels_are_averaged(tmp_path):
    stereo = noise(RATE, 2)
    soundfile.write(tmp_path / "a.wav", stereo, RATE, subtype="FLOAT")
    np.testing.assert_allclose(Speech.load(tmp_path / "a.wav").samples, stereo.mean(axis=1), atol=1e-6)


def test_channels_that_cancel_out_give_the_louder_one(tmp_path):
    mono = np.concatenate([np.zeros(3 * RATE, np.float32), noise(2 * RATE)[:, 0]])  # a silent start must not decide
    soundfile.write(tmp_path / "a.wav", np.stack([0.9 * mono, -mono], axis=1), RATE, subtype="FLOAT")
    np.testing.assert_allclose(Speech.load(tmp_path / "a.wav").samples, -mono, atol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("channels", [1, 2, 3, 6, 8, 32, 255])
def test_any_number_of_channels(tmp_path, channels):
    sound = noise(RATE // 4, channels)
    soundfile.write(tmp_path / "a.wav", sound, RATE, subtype="FLOAT")
    np.testing.assert_allclose(Speech.load(tmp_path / "a.wav").samples, sound.mean(axis=1), atol=1e-6)


# ---- formats ----


WIDTHS = [
    (kind, subtype)
    for kind in ("WAV", "WAVEX", "RF64", "AIFF")
    for subtype in ("PCM_U8", "PCM_16", "PCM_24", "PCM_32", "FLOAT", "DOUBLE", "ULAW", "ALAW", "IMA_ADPCM", "MS_ADPCM")
    if soundfile.check_format(kind, subtype)
]


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "subtype"), WIDTHS)
def test_every_width_of_uncompressed_sound(tmp_path, kind, subtype):
    tone = 0.5 * np.sin(2 * np.pi * 200 * np.arange(RATE // 4) / RATE)
    soundfile.write(tmp_path / "sound.txt", tone, RATE, format=kind, subtype=subtype)
    speech = Speech.load(tmp_path / "sound.txt")
    assert np.abs(speech.samples[: len(tone)] - tone).mean() < 0.02


def encode(path: Path, container: str, codec: str, rate: int = 48_000) -> None:
    """A second of a 440 Hz tone by FFmpeg."""
    import av

    with av.open(str(path), "w", format=container) as out:
        stream = out.add_stream(codec, rate=rate, layout="mono")
        size = stream.codec_context.frame_size or 1024
        tone = 0.5 * np.sin(2 * np.pi * 440 * np.arange(rate) / rate)
        for at in range(0, rate, size):
            frame = av.AudioFrame.from_ndarray(tone[None, at : at + size].astype(np.float32), format="fltp", layout="mono")
            frame.sample_rate, frame.pts = rate, at
            out.mux(stream.encode(frame))
        out.mux(stream.encode(None))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("container", "codec"), [("mp4", "aac"), ("ipod", "aac"), ("adts", "aac"), ("webm", "libopus"), ("matroska", "aac")]
)
def test_media_that_need_the_extra(tmp_path, container, codec):
    encode(tmp_path / "a.wav", container, codec)
    speech = Speech.load(tmp_path / "a.wav")
    assert speech.seconds == pytest.approx(1.0, abs=0.05)
    spectrum = np.abs(np.fft.rfft(speech.samples[2000:10_000]))
    assert spectrum.argmax() * RATE / 8000 == pytest.approx(440, abs=3)


def test_without_the_extra_the_message_says_what_to_install(tmp_path, monkeypatch):
    (tmp_path / "a.m4a").write_bytes(b"\0\0\0\x20ftypM4A \0\0\0\0" + bytes(100))
    stubs = tmp_path / "blocked"
    stubs.mkdir()
    (stubs / "av.py").write_text("raise ImportError('no av here')\n")
    monkeypatch.setattr(sys, "path", [str(stubs), *sys.path])
    with pytest.raises(InputError, match=r'in a clone: pip install -e "\.\[av\]"'):
        Speech.load(tmp_path / "a.m4a")


# ---- words, windows, chunks ----


def test_a_window_keeps_time_and_words():
    words = (Word("one", 0.1, 0.4), Word("two", 0.5, 0.9), Word("three", 1.2, 1.6))
    speech = Speech(noise(2 * RATE)[:, 0], words=words)
    cut = speech.window(0.8, 1.25)
    assert cut.start == pytest.approx(0.8)
    assert cut.words == words[1:]
    assert np.array_equal(cut.samples, speech.samples[12_800:20_000])
    assert cut.window(0.85, 0.9).start == pytest.approx(0.85)
    assert np.array_equal(cut.window(0.85, 9.0).samples, speech.samples[13_600:20_000])
    assert np.array_equal(speech.window(-np.inf, np.inf).samples, speech.samples)
    assert [chunk.start for chunk in cut.chunks(0.2)] == pytest.approx([0.8, 1.0, 1.2])


@pytest.mark.parametrize(
    "times", [(5, 6), (1, 1), (1.5, 1.0), (0.0, 0.4), (1.25, 2.0), (np.nan, 1.0), (1.0, np.nan), (0.8, 0.80001)]
)
def test_a_window_without_sound_is_an_error(times):
    cut = Speech(noise(2 * RATE)[:, 0]).window(0.8, 1.25)
    with pytest.raises(InputError, match=r"window|no sample"):
        cut.window(*times)


@pytest.mark.slow
@settings(max_examples=50)
@given(st.integers(1, 40_000), st.floats(0.001, 3), st.integers(0, 30))
def test_chunks_are_the_speech(count, seconds, spoken):
    words = tuple(Word(str(i), i * 0.07, i * 0.07 + 0.07) for i in range(spoken))
    words = tuple(word for word in words if word.start < count / RATE)
    speech = Speech(noise(count)[:, 0], words=words, duration=Fraction(3 * count - 1, 3 * RATE))
    chunks = list(speech.chunks(seconds))
    assert np.array_equal(np.concatenate([chunk.samples for chunk in chunks]), speech.samples)
    assert sum(chunk.duration for chunk in chunks) == speech.duration
    assert tuple(word for chunk in chunks for word in chunk.words) == words
    assert all(chunk.start == pytest.approx(sum(map(len, chunks[:i])) / RATE) for i, chunk in enumerate(chunks))


def test_chunks_of_nothing_are_refused():
    with pytest.raises(InputError, match="chunks of 0"):
        next(Speech(noise(10)[:, 0]).chunks(0))


def test_samples_given_directly():
    assert Speech(np.array([0, 16_384, -32_768], np.int16)).samples.tolist() == [0, 0.5, -1]
    for wrong in (np.zeros((10, 2)), np.array([1, 2]), np.array([0.0, np.nan]), np.array(["a"])):
        with pytest.raises(InputError):
            Speech(wrong)
    for stereo in (np.full((4, 2), 0.5), np.full((2, 4), 0.5), np.full((4, 2), 16_384, np.int16)):
        with pytest.raises(InputError, match="mixes its 2 channels") as refusal:
            Speech(stereo)
        mono = eval(refusal.value.hint.partition(" mixes")[0], {"samples": stereo})
        assert Speech(mono).samples.tolist() == [0.5] * 4
    assert Speech(np.zeros(RATE, np.float32), seconds=1.00001).frames(30) == 31


def test_the_example():
    audio, transcript = example()
    speech = Speech.load(audio, transcript=transcript)
    assert 10 <= speech.seconds <= 20
    assert audio.stat().st_size <= 400_000
    assert {"huge", "two", "I", "you", "left", "today", "nothing"} <= {word.text for word in speech.words}
    gaps = [b.start - a.end for a, b in zip(speech.words, speech.words[1:], strict=False)]
    assert min(gaps) >= 0
    assert sum(gap > 0.3 for gap in gaps) >= 4


# ---- streams ----


@pytest.mark.slow
def test_streamed_is_loaded(tmp_path):
    soundfile.write(tmp_path / "a.flac", noise(500_000, 2), 44_100)
    whole = Speech.load(tmp_path / "a.flac")
    with open_speech(tmp_path / "a.flac") as source:
        assert source.seconds is None
        with pytest.raises(InputError, match="not known"):
            source.frames(30)
        assert source.expected_seconds == pytest.approx(whole.seconds)
        first = np.concatenate(list(source.blocks()))
        assert (source.source_frames, source.source_rate, source.duration) == (500_000, 44_100, whole.duration)
        assert source.frames(30) == whole.frames(30)
        assert np.array_equal(np.concatenate(list(source.blocks())), first)  # once more
    assert np.array_equal(first, whole.samples)


MEASURE = """
import resource, sys
from cospeech.audio.speech import open_speech
from cospeech.audio.features import ProsodyStream
def run(path, analyse):
    stream = ProsodyStream()
    with open_speech(path) as source:
        for block in source.blocks():
            if analyse:
                stream.push(block)
    return source
analyse = sys.argv[1] == "analyse"
run(sys.argv[2], analyse)
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
source = run(sys.argv[3], analyse)
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before, source.source_frames, source.frames(30))
"""


def silence(path: Path, seconds: int, rate: int) -> Path:
    with soundfile.SoundFile(path, "w", rate, 1, "PCM_16") as file:
        for _ in range(seconds // 60):
            file.write(np.zeros(60 * rate, np.int16))
    return path


def measure_growth(what: str, short: Path, long: Path, seconds: int) -> int:
    """KiB by which memory grows from the short file to the long one, in a process of its own."""
    command = [sys.executable, "-c", MEASURE, what, short, long]
    kib, frames, motion = map(int, subprocess.run(command, capture_output=True, check=True, text=True).stdout.split())
    assert frames == seconds * soundfile.info(long).samplerate
    assert motion == seconds * 30
    return kib


@pytest.mark.slow
def test_hours_in_a_megabyte_take_no_memory(tmp_path):
    long = silence(tmp_path / "long.flac", 3 * 3600, 16_000)
    assert long.stat().st_size < 1_000_000
    assert measure_growth("decode", silence(tmp_path / "short.flac", 120, 16_000), long, 3 * 3600) < 20_000
    with pytest.raises(InputError, match=r"longer than 2 hours \(stream it"):
        Speech.load(long)


@pytest.mark.slow
def test_analysing_a_stream_takes_no_memory(tmp_path):
    long = silence(tmp_path / "long.flac", 900, 44_100)
    assert measure_growth("analyse", silence(tmp_path / "short.flac", 60, 44_100), long, 900) < 20_000


# ---- a decoder that fails ----


def wav(tmp_path: Path) -> Path:
    soundfile.write(tmp_path / "a.wav", noise(300_000), RATE)
    return tmp_path / "a.wav"


HEADER = r"""
import json, os, signal, struct, sys, time
def send(kind, data): sys.stdout.buffer.write(kind + struct.pack("<I", len(data)) + data); sys.stdout.buffer.flush()
header = json.dumps({"rate": 16000, "channels": 1, "frames": 9, "lead": 0}).encode()
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("what", "message"),
    [
        ("os.kill(os.getpid(), signal.SIGSEGV)", r"crashed .*exit -11"),
        ("send(b'H', header); os.kill(os.getpid(), signal.SIGSEGV)", r"crashed"),
        ("send(b'H', header); send(b'B', bytes(64)); os.abort()", r"crashed"),
        ("send(b'H', header); sys.stdout.buffer.write(b'B'); sys.exit()", r"crashed"),
        ("sys.exit(3)", r"crashed .*exit 3"),
        ("time.sleep(60)", r"hangs .*is the computer very busy\?"),
        ("send(b'H', header); send(b'B', bytes(64)); time.sleep(60)", r"hangs .*is the computer very busy\?"),
        ("send(b'H', header); send(b'B', bytes(3))", r"sent 3 bytes"),
        ("send(b'H', b'[]')", r"makes no sense"),
        ("send(b'H', b'not json')", r"makes no sense"),
        ("send(b'H', b'{}')", r"makes no sense"),
        ("send(b'H', header.replace(b'16000', b'1'))", r"rate of 1 Hz"),
        ("send(b'H', header.replace(b': 1,', b': 0,'))", r"0 channels"),
        ("send(b'B', bytes(8))", r"before its header"),
        ("sys.stdout.buffer.write(b'H' + bytes([255] * 4))", r"announced"),
        ("send(b'H', header); send(b'E', b'{\"frames\": 7}')", r"lost samples"),
        ("send(b'X', b'{\"problem\": \"it is raining\"}')", r"it is raining"),
    ],
)
def test_whatever_the_decoder_does_it_is_one_line(tmp_path, monkeypatch, what, message):
    monkeypatch.setattr(decoding, "OPEN_TIMEOUT", 1.0)
    monkeypatch.setattr(decoding, "BLOCK_TIMEOUT", 1.0)
    monkeypatch.setattr(decoding, "_command", lambda: [sys.executable, "-I", "-S", "-c", HEADER + what])
    before = children()
    with pytest.raises(InputError, match=message) as refusal:
        Speech.load(wav(tmp_path))
    assert "\n" not in str(refusal.value)
    assert children() == before


def test_a_slow_consumer_is_not_a_hanging_decoder(tmp_path, monkeypatch):
    monkeypatch.setattr(decoding, "BLOCK_TIMEOUT", 0.5)
    with open_speech(wav(tmp_path)) as source:
        for _ in source.blocks():
            time.sleep(0.7)
    assert source.source_frames == 300_000


@pytest.mark.slow
def test_no_process_is_left(tmp_path):
    path, before = wav(tmp_path), children()
    with open_speech(path) as source:
        next(source.blocks())
    assert children() == before
    blocks = open_speech(path).blocks()
    next(blocks)
    blocks.close()
    assert children() == before
    with pytest.raises(KeyboardInterrupt), open_speech(path) as source:
        raise KeyboardInterrupt
    assert children() == before


def test_the_decoder_imports_little():
    """So it starts fast: numpy and onnxruntime would take half of a second."""
    code = "import sys, cospeech.audio.worker, cospeech.audio._decode; print(*sys.modules)"
    modules = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    assert not {"numpy", "onnxruntime", "scipy", "torch", "cospeech.audio.speech"} & set(modules)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ([("huge", 0.1, 0.2)], "\"('huge', 0.1, 0.2)\" among the words of a speech"),
        (["huge"], "'huge' among the words of a speech"),
        ("huge", "'huge' among the words of a speech"),
        ([Word(None, 0.1, 0.2)], "among the words of a speech"),
        ([Word("huge", "0.1", 0.2)], "the word 'huge' from 0.1 to 0.2 (seconds, and the start first)"),
        ([Word("huge", 0.1, float("nan"))], "the word 'huge' from 0.1 to nan"),
        ([Word("huge", 0.2, 0.1)], "the word 'huge' from 0.2 to 0.1"),
    ],
)
def test_what_is_no_word_is_told_at_once(words, message):
    with pytest.raises(InputError) as refusal:
        Speech(np.zeros(16000, np.float32), words=words)
    assert message in str(refusal.value)


@pytest.mark.parametrize(("module", "imports_numpy"), [("", False), ("import numpy\nnumpy.linspace(0, 1)\n", True)])
def test_the_decoder_imports_numpy_only_for_a_soundfile_that_needs_it(tmp_path, module, imports_numpy):
    if module:
        (tmp_path / "soundfile.py").write_text(module)
    paths = os.pathsep.join([str(tmp_path), *sys.path])
    code = "import sys; from cospeech.audio._decode import import_soundfile; import_soundfile(); print('numpy' in sys.modules)"
    process = subprocess.run([sys.executable, "-c", code], env={**os.environ, "PYTHONPATH": paths}, capture_output=True)
    assert process.stdout.split() == [str(imports_numpy).encode()]


def test_numbers_of_numpy_are_numbers():
    samples, one = np.zeros(16_000, np.float32), np.float32(1)
    speech = Speech(samples, seconds=one, start=one)
    assert (speech.duration, type(speech.start), speech.frames(np.float32(30))) == (1, float, 30)
    assert count_frames(Fraction(1), np.float64(29.97)) == 30
