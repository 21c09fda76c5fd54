"""Sound as it comes: no gap, no sample lost or doubled, silence where nothing comes."""

from __future__ import annotations

import io
import sys
import threading
import time
import types
from itertools import pairwise

import numpy as np
import pytest

from cospeech.audio.live_sources import (
    PIECE,
    SLACK,
    decode_pcm,
    pace_pieces,
    read_microphone,
    read_pcm,
    read_websocket,
    wait_for_each,
)
from cospeech.audio.speech import Speech
from cospeech.audio.waiting_sound import WaitingSound
from cospeech.errors import InputError
from cospeech.export.live.pacing import MARGIN

RATE = 8_000


def no_wait(seconds: float) -> None:
    """Do not sleep."""


def ramp(count: int, first: int = 0) -> np.ndarray:
    return (np.arange(first, first + count) % 1000 / 1000).astype(np.float32)


@pytest.mark.parametrize("cuts", [[5000], [1, 2, 3, 4000, 994], [160] * 31 + [40]])
def test_all_samples_come_once_and_in_order(cuts):
    edges = np.cumsum([0, *cuts])
    blocks = [ramp(b - a, a) for a, b in pairwise(edges)]
    pieces = list(pace_pieces(blocks, RATE, idle=False, sleep=no_wait))
    np.testing.assert_array_equal(np.concatenate([p.samples for p in pieces]), ramp(5000))
    assert [p.start for p in pieces] == pytest.approx([k * PIECE for k in range(len(pieces))])
    assert {len(p) for p in pieces[:-1]} == {160}


def test_pieces_come_when_they_are_due():
    began, times = time.monotonic(), []
    for _ in pace_pieces([ramp(1600)], RATE):
        times.append(time.monotonic() - began)
    assert len(times) == 10
    assert (np.array(times) >= np.arange(1, 11) * PIECE - 1e-3).all()


def test_silence_comes_where_nobody_speaks():
    gate = threading.Event()

    def slow():
        yield ramp(160, 1)
        gate.wait(10)
        yield ramp(160, 1)

    pieces = []
    for piece in pace_pieces(slow(), RATE):
        pieces.append(piece)
        if len(pieces) == 4:
            gate.set()
    quiet = [not piece.samples.any() for piece in pieces]
    assert quiet[0] is False
    assert quiet[1:4] == [True] * 3  # they came although the speech did not
    assert sum(not q for q in quiet) == 2
    assert [p.start for p in pieces] == pytest.approx([k * PIECE for k in range(len(pieces))])


class Script(WaitingSound):
    """Sound that comes at given times of a clock that is set by hand."""

    def __init__(self, arrivals: list[tuple[float, np.ndarray]], end: float) -> None:
        super().__init__(RATE)
        self.arrivals, self.end_at, self.now = arrivals, end, 0.0

    def sleep(self, seconds: float) -> None:
        self.now += seconds

    def end(self, error: Exception | None = None) -> None:
        """Do nothing: there is no thread whose blocks could end."""

    @property
    def is_over(self) -> bool:
        return self.now >= self.end_at

    def take(self, timeout: float | None) -> np.ndarray | None:
        assert timeout is not None
        until = self.now + timeout
        if self.arrivals and self.arrivals[0][0] <= until:
            at, block = self.arrivals.pop(0)
            self.now = max(self.now, at)
            self.taken += len(block)
            return block
        self.now = until
        return None


def test_the_silence_of_a_pause_is_on_time():
    arrivals = [(k * PIECE, ramp(160, 1)) for k in range(1, 6)]
    arrivals += [(0.205 + k * PIECE, ramp(160, 1)) for k in range(1, 6)]  # sound again, within a piece
    script = Script(arrivals, end=0.6)
    late, quiet = [], []
    for piece in pace_pieces([], RATE, slack=0.03, waiting=script, clock=lambda: script.now, sleep=script.sleep):
        late.append(script.now - piece.start - PIECE)
        quiet.append(not piece.samples.any())
    assert quiet[:17] == [False] * 5 + [True] * 6 + [False] * 5 + [True]
    assert late[5] == pytest.approx(0.03)  # sound might have come
    assert max(late[7:16]) < 1e-9
    assert max(late) <= 0.03 + 1e-9  # which the margin of the pacing covers
    assert SLACK <= MARGIN / 2


def test_an_error_of_the_source_reaches_who_listens():
    def fail():
        yield ramp(400)
        raise InputError("the cable was pulled", "put it back")

    with pytest.raises(InputError, match="cable"):
        list(pace_pieces(fail(), RATE, idle=False, sleep=no_wait))


def test_a_recording_is_heard_at_the_speed_of_its_clock():
    clock = [5.0]

    def sleep(seconds: float) -> None:
        clock[0] += seconds

    pieces = list(Speech(ramp(4000), RATE).chunks(0.1))
    ends = [(clock[0], piece.start) for piece in wait_for_each(pieces, clock=lambda: clock[0], sleep=sleep)]
    np.testing.assert_allclose([end for end, _ in ends], 5 + np.arange(1, 6) * 0.1, atol=1e-9)


class Drip(io.RawIOBase):
    """A pipe that gives its bytes in pieces of these sizes."""

    def __init__(self, data: bytes, sizes: list[int]) -> None:
        self.data, self.sizes = data, sizes

    def read(self, most: int = -1) -> bytes:
        size = min(self.sizes.pop(0) if self.sizes else most, most)
        out, self.data = self.data[:size], self.data[size:]
        return out


@pytest.mark.parametrize("kind", ["s16", "f32"])
def test_raw_samples_of_a_pipe_that_cuts_them(kind):
    values = np.linspace(-0.99, 0.99, 999)
    data = (values * 32768).astype("<i2").tobytes() if kind == "s16" else values.astype("<f4").tobytes()
    samples = np.concatenate(list(read_pcm(Drip(data, [1, 2, 3, 7, 1, 1]), RATE, kind)))
    np.testing.assert_allclose(samples, values, atol=4e-5)
    assert samples.dtype == np.float32


def test_a_pipe_that_ends_within_a_sample_is_heard_to_there_and_told():
    notes: list[str] = []
    blocks = list(read_pcm(io.BytesIO(np.full(9, 8192, "<i2").tobytes() + b"x"), RATE, "s16", note=notes.append))
    np.testing.assert_array_equal(np.concatenate(blocks), np.full(9, 0.25, np.float32))
    assert notes == ["the sound ends within a sample; 1 byte left out (samples are s16, little-endian)"]


def test_numbers_that_are_none_are_silence():
    data = np.array([np.nan, np.inf, -np.inf, 7, -7, 0.5], "<f4").tobytes()
    np.testing.assert_array_equal(decode_pcm(data, "f32"), np.float32([0, 0, 0, 1, -1, 0.5]))


def test_messages_of_a_websocket():
    blocks = list(read_websocket([b"", "a text", np.array([16384], "<i2").tobytes()]))
    assert [block.tolist() for block in blocks] == [[0.5]]


def test_a_message_may_end_within_a_sample():
    notes: list[str] = []
    values = np.linspace(-0.9, 0.9, 200)
    data = (values * 32768).astype("<i2").tobytes()
    messages = [data[k : k + 7] for k in range(0, len(data), 7)]
    np.testing.assert_allclose(np.concatenate(list(read_websocket(messages, note=notes.append))), values, atol=4e-5)
    assert not notes


@pytest.mark.parametrize("border", [b"", "interrupt"])
def test_a_new_voice_begins_with_a_whole_sample(border):
    notes: list[str] = []
    whole = np.full(4, 8192, "<i2").tobytes()
    messages = [whole + b"x", border, whole, whole + b"z", border, whole]
    blocks = list(read_websocket(messages, on_text=lambda text: text == "interrupt", note=notes.append))
    np.testing.assert_array_equal(np.concatenate(blocks), np.full(16, 0.25, np.float32))
    assert notes == ["the sound ends within a sample; 1 byte left out (samples are s16, little-endian)"]


@pytest.mark.parametrize(
    ("head", "name"),
    [
        (b"RIFF", "a WAV"), (b"fLaC", "a FLAC"), (b"OggS", "an Ogg"), (b"ID3", "an MP3"), (b"\x1a\x45\xdf\xa3", "a WebM"),
        (b"\0\0\0\x1cftypM4A ", "an MP4"), ((b"\xff\xf3\x44\xc4" + bytes(92)) * 2, "an MP3"),
        ((b"\xff\xfb\x90\xc4" + bytes(413)) * 2, "an MP3"),
    ],
)  # fmt: skip
def test_a_sound_file_is_not_taken_for_raw_samples(head, name):
    data = head + bytes(2000)
    with pytest.raises(InputError, match=f"this is {name} file, not raw samples"):
        list(read_pcm(io.BytesIO(data), RATE))
    with pytest.raises(InputError, match=f"this is {name} file, not raw samples"):
        list(read_websocket([data]))
    assert len(np.concatenate(list(read_pcm(io.BytesIO(bytes(100) + data), RATE)))) > 1000  # in mid-sound it is sound


def test_samples_that_begin_as_a_frame_of_mp3_does_are_samples():
    data = np.full(1000, -1025, "<i2").tobytes()  # FF FB FF FB …
    assert len(np.concatenate(list(read_websocket([data])))) == 1000
    assert len(np.concatenate(list(read_websocket([b"\xff\xfb\x90\xc4" + bytes(2000)])))) == 1002


def test_a_sound_file_of_a_later_client_is_told_and_not_heard():
    notes: list[str] = []
    whole = np.full(4, 8192, "<i2").tobytes()
    messages = [b"", whole, b"", b"RIFF" + bytes(100), whole, b"", whole]
    assert len(np.concatenate(list(read_websocket(messages, note=notes.append)))) == 8
    assert len(notes) == 1
    assert notes[0].startswith("this is a WAV file, not raw samples")
    assert notes[0].endswith("it is not heard")


def test_samples_that_are_no_numbers_are_told_once():
    notes: list[str] = []
    data = np.full(4000, np.nan, "<f4").tobytes()
    list(read_pcm(io.BytesIO(data), RATE, "f32", note=notes.append))
    assert notes == ["samples that are NaN or infinite are heard as silence (samples are f32, little-endian)"]
    list(read_websocket([data, data, data[:-1]], "f32", note=notes.append))
    assert len(notes) == 3
    assert "3 bytes left out" in notes[2]


def test_a_microphone_that_is_not_there_is_told(monkeypatch):
    monkeypatch.setitem(sys.modules, "sounddevice", None)
    with pytest.raises(InputError, match=r"\.\[live\]"):
        read_microphone(RATE)

    class Silent:
        PortAudioError = RuntimeError

        @staticmethod
        def InputStream(**options: object) -> object:
            raise RuntimeError("no device")

    monkeypatch.setitem(sys.modules, "sounddevice", Silent)
    with pytest.raises(InputError, match="no device"):
        read_microphone(RATE)


def test_what_a_microphone_gives(monkeypatch):
    class Stream:
        def __init__(self, **options: object) -> None:
            assert (options["samplerate"], options["channels"]) == (RATE, 1)

        def __enter__(self):
            return self

        def __exit__(self, *error: object) -> None:
            pass

        def read(self, size: int) -> tuple[np.ndarray, bool]:
            return ramp(size)[:, None], False

    module = types.SimpleNamespace(InputStream=Stream, PortAudioError=RuntimeError)
    monkeypatch.setitem(sys.modules, "sounddevice", module)
    np.testing.assert_array_equal(next(read_microphone(RATE)), ramp(160))
