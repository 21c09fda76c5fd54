"""Messages that steer a live session: an interruption drops all sound that came before it, and none that comes after it."""

from __future__ import annotations

import threading
from collections.abc import Iterator

import numpy as np
import pytest

from cospeech.audio.live_sources import PIECE, pace_pieces, read_websocket
from cospeech.audio.waiting_sound import WaitingSound
from cospeech.audio.waiting_words import WaitingWords
from cospeech.errors import InputError
from cospeech.runtime.live_controls import LiveControls

RATE = 8_000
SIZE = round(PIECE * RATE)


class Listener:
    """Records when a `LiveSession` would be interrupted."""

    def __init__(self) -> None:
        self.sound: list[np.ndarray] = []
        self.interrupts: list[int] = []

    def interrupt(self) -> None:
        self.interrupts.append(len(self.sound))


def sound_of(value: int, count: int) -> bytes:
    return np.full(count, value, "<i2").tobytes()


def play(messages, gate: threading.Event, ready: threading.Event, *, before: int) -> tuple[Listener, list[InputError]]:
    """Hear ``before`` pieces, let the other messages come, and hear the rest."""
    errors: list[InputError] = []
    waiting = WaitingSound(100 * RATE)
    controls, session = LiveControls(waiting, errors.append), Listener()
    blocks = read_websocket(messages(), "s16", controls.put)
    for piece in pace_pieces(blocks, RATE, idle=False, waiting=waiting, sleep=lambda seconds: None):
        piece = controls.steer(session, piece)
        session.sound.append(piece.samples)
        if len(session.sound) == before:
            gate.set()
            assert ready.wait(10)
    return session, errors


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
    sound = np.concatenate(session.sound)
    assert session.interrupts == [5]
    assert (sound == np.float32(8000 / 32768)).sum() == 5 * SIZE
    assert not sound[5 * SIZE : 6 * SIZE].any()  # the piece that was under way
    assert (sound[6 * SIZE :] == np.float32(16000 / 32768)).all()
    assert len(sound) == 9 * SIZE


def hear_words(*messages: str | None) -> tuple[list[tuple[str, float]], list[InputError]]:
    """Words and their starts, of messages each of which comes after three pieces of sound."""
    errors: list[InputError] = []
    waiting = WaitingSound(100 * RATE)
    controls = LiveControls(waiting, errors.append, WaitingWords(waiting, RATE, pytest.fail))
    for message in messages:
        waiting.put(np.full(3 * SIZE, 0.5, np.float32))
        if message is not None:
            assert controls.put(message) == ("true" in message)
    waiting.end()
    pieces = pace_pieces(None, RATE, idle=False, waiting=waiting, sleep=lambda seconds: None)
    pieces_of_sound = [controls.steer(Listener(), piece) for piece in pieces]
    return [(word.text, round(word.start, 6)) for piece in pieces_of_sound for word in piece.words], errors


def test_words_among_the_sound_count_from_where_their_message_stands():
    message = '{"words": [{"word": "interrupt", "start": 0.01, "end": 0.05}, {"word": "me", "start": 0.07, "end": 0.08}]}'
    assert hear_words(message, None) == ([("interrupt", 0.07)], [])  # the sound ends before the other one
    assert hear_words(None, message, None, None) == ([("interrupt", 0.13), ("me", 0.19)], [])


def test_an_interruption_drops_the_words_before_it_and_none_of_its_own_message():
    old = '{"words": [{"word": "lost", "start": 0.0, "end": 0.1}]}'
    new = '{"interrupt": true, "words": [{"word": "new", "start": 0.02, "end": 0.04}]}'
    assert hear_words(old, new, None) == ([("new", 0.04)], [])  # the piece that is heard is 0.02 s of silence


def test_words_that_are_none_are_told_and_the_sound_goes_on():
    words, errors = hear_words('{"words": [{"word": "a", "start": "soon", "end": 1}]}', '{"words": 3}', None)
    assert words == []
    assert [error.problem for error in errors] == ["'soon' is not a time", "JSON that holds '3'"]


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

    session, errors = play(messages, gate, ready, before=5)
    assert (np.concatenate(session.sound) == np.float32(8000 / 32768)).sum() == 10 * SIZE
    assert (len(errors), session.interrupts) == (1, [])


def test_a_line_that_says_nothing_is_told_as_text():
    errors: list[InputError] = []
    controls = LiveControls(WaitingSound(RATE), errors.append)
    for line in (b"garbage\n", "gr\xfc\xdf\n".encode(), b"\xff\n"):
        controls.put(line)
    controls.steer(Listener(), None)
    assert [error.problem.split(" is no")[0] for error in errors] == ["'garbage'", "'gr\xfc\xdf'", "'\ufffd'"]


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
