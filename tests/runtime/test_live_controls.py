"""Messages that steer a live session: an interruption drops all sound that came before it, and none that comes after it."""

from __future__ import annotations

import threading
from collections.abc import Iterator

import numpy as np
import pytest

from cospeech.audio.live_sources import PIECE, pace_pieces, read_websocket
from cospeech.audio.waiting_sound import WaitingSound
from cospeech.errors import InputError
from cospeech.runtime.live_controls import LiveControls

RATE = 8_000
SIZE = round(PIECE * RATE)


class Listener:
    """Writes down when it is interrupted, as a `LiveSession` would do it."""

    def __init__(self) -> None:
        self.heard: list[np.ndarray] = []
        self.interrupted: list[int] = []

    def interrupt(self) -> None:
        self.interrupted.append(len(self.heard))


def sound_of(value: int, count: int) -> bytes:
    return np.full(count, value, "<i2").tobytes()


def play(messages, gate: threading.Event, ready: threading.Event, *, before: int) -> tuple[Listener, list[InputError]]:
    """Hear so many pieces, let the other messages come, and hear the rest."""
    told: list[InputError] = []
    waiting = WaitingSound(100 * RATE)
    controls, session = LiveControls(waiting, told.append), Listener()
    blocks = read_websocket(messages(), "s16", controls.put)
    for piece in pace_pieces(blocks, RATE, idle=False, waiting=waiting, sleep=lambda seconds: None):
        piece = controls.steer(session, piece)
        session.heard.append(piece.samples)
        if len(session.heard) == before:
            gate.set()
            assert ready.wait(10)
    return session, told


@pytest.mark.parametrize("odd", [0, 70])  # samples of the old sound that do not fill a piece
def test_an_interruption_drops_what_was_sent_ahead_and_keeps_what_follows(odd):
    gate, ready = threading.Event(), threading.Event()

    def messages() -> Iterator[str | bytes]:
        yield sound_of(8000, 100 * SIZE + odd)  # two seconds at once, as of a text-to-speech
        yield sound_of(8000, 10 * SIZE)
        gate.wait(10)
        yield '{"interrupt": true}'
        yield sound_of(16000, 3 * SIZE)
        ready.set()

    session, _ = play(messages, gate, ready, before=5)
    heard = np.concatenate(session.heard)
    assert session.interrupted == [5]
    assert (heard == np.float32(8000 / 32768)).sum() == 5 * SIZE
    assert not heard[5 * SIZE : 6 * SIZE].any()  # the piece that was under way
    assert (heard[6 * SIZE :] == np.float32(16000 / 32768)).all()
    assert len(heard) == 9 * SIZE


def test_within_a_piece_the_old_samples_are_silent_and_the_new_ones_are_heard():
    waiting = WaitingSound(100 * RATE)
    controls = LiveControls(waiting, pytest.fail)
    waiting.put(np.full(SIZE + 70, 0.25, np.float32))
    controls.put('{"interrupt": true}')
    pieces = pace_pieces([np.full(SIZE, 0.5, np.float32)], RATE, idle=False, waiting=waiting, sleep=lambda seconds: None)
    next(pieces)
    samples = controls.steer(Listener(), next(pieces)).samples
    np.testing.assert_array_equal(samples, np.repeat(np.float32([0, 0.5]), [70, SIZE - 70]))


def test_an_interruption_that_is_refused_drops_nothing():
    gate, ready = threading.Event(), threading.Event()

    def messages() -> Iterator[str | bytes]:
        yield sound_of(8000, 10 * SIZE)
        gate.wait(10)
        yield '{"interrupt": false}'
        ready.set()

    session, told = play(messages, gate, ready, before=5)
    assert (np.concatenate(session.heard) == np.float32(8000 / 32768)).sum() == 10 * SIZE
    assert (len(told), session.interrupted) == (1, [])


def test_a_line_that_says_nothing_is_told_as_text():
    told: list[InputError] = []
    controls = LiveControls(WaitingSound(RATE), told.append)
    for line in (b"garbage\n", "gr\xfc\xdf\n".encode(), b"\xff\n"):
        controls.put(line)
    controls.steer(Listener(), None)
    assert [error.problem.split(" is no")[0] for error in told] == ["'garbage'", "'gr\xfc\xdf'", "'\ufffd'"]


def test_who_is_made_to_wait_goes_on_after_an_interruption():
    waiting = WaitingSound(100)
    waiting.put(np.ones(100, np.float32))
    late = threading.Thread(target=waiting.put, args=(np.ones(50, np.float32),), daemon=True)
    late.start()
    while waiting.received < 150:
        pass
    waiting.drop(150)
    late.join(10)
    assert not late.is_alive()
    waiting.put(np.zeros(7, np.float32))
    assert len(waiting.take(0)) == 7
    assert waiting.take(0) is None
