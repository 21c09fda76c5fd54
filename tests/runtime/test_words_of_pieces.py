"""Words that come with pieces of speech: each is at its place, whatever times a piece counts in, and early or late."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

import cospeech
from cospeech.audio.speech import Speech, Word, example, shift_times
from cospeech.motion.motion import Motion
from cospeech.runtime.live_session import LiveSession


@cache
def load_speech() -> Speech:
    sound, words = example()
    return Speech.load(sound, transcript=words).window(0.0, 6.0)


def own_times(piece: Speech) -> Speech:
    """The same piece as a text-to-speech gives it: it begins at 0, and its words count from there."""
    words = tuple(Word(word.text, word.start - piece.start, word.end - piece.start) for word in piece.words)
    return Speech(piece.samples, piece.rate, words)


def speak(session: LiveSession, pieces: list[Speech]) -> list[Motion]:
    return [motion for piece in pieces for motion in session.push(piece)]


def words_that_call(session: LiveSession) -> list[tuple[str, float]]:
    """Each word of the last utterance that has a gesture, and when that strokes, in tenths of a second from its beginning."""
    return [(gesture.word, round(gesture.stroke, 1)) for gesture in session._last_session.gestures if gesture.word]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["rules", "chain-of-generation"])
def test_pieces_that_count_by_themselves_give_the_motion_of_the_whole(name):
    pieces, model = [own_times(piece) for piece in load_speech().chunks(1.0)], cospeech.load(name)
    motion_of_stream = Motion.concatenate(list(model.stream(pieces, seed=2)))
    session = cospeech.open_live_session(model, fps=30.0, seed=2, stance=False, arm_limits=False)
    live = Motion.concatenate(speak(session, pieces) + list(session.finish()))
    whole = model.generate(load_speech(), seed=2)
    for motion in (motion_of_stream, live):
        np.testing.assert_allclose(motion.rotations, whole.rotations, atol=1e-6)
        np.testing.assert_allclose(motion.face, whole.face, atol=1e-6)


@pytest.mark.slow
def test_stretches_of_a_plan_hear_pieces_that_count_by_themselves():
    model, plan = cospeech.load("mix-stage"), cospeech.Plan().set(1.0, 2.0, seed=5)
    short = load_speech().window(0.0, 3.0)
    pieces = model.stream([own_times(piece) for piece in short.chunks(0.5)], plan=plan)
    whole = model.generate(short, plan=plan)
    np.testing.assert_allclose(Motion.concatenate(list(pieces)).face, whole.face, atol=1e-6)


@pytest.mark.slow
def test_words_of_a_second_utterance_count_from_its_sound():
    words = []
    for by_the_clock in (True, False):
        session = cospeech.open_live_session("rules", fps=30.0)
        speak(session, list(load_speech().chunks(0.5)))
        list(session.idle(0.7))
        list(session.push(np.zeros(3200), 16_000))  # a microphone's silence, which the next utterance begins with
        pieces = list(load_speech().chunks(0.5))  # their times begin at 0 again
        speak(session, [shift_times(piece, -session.time) for piece in pieces] if by_the_clock else pieces)
        list(session.finish())
        words.append(words_that_call(session))
    assert words[0] == words[1]
    assert len(words[0]) >= 3


@pytest.mark.slow
@pytest.mark.parametrize("late", [-100.0, -1.0, 0.4])
def test_words_may_come_before_their_sound_or_a_little_later(late):
    """The manual says how much later (docs/guides/python.md)."""
    usual, words = cospeech.open_live_session("rules", fps=30.0), load_speech().words
    speak(usual, list(load_speech().chunks(0.1)))
    session, given = cospeech.open_live_session("rules", fps=30.0), 0
    for piece in load_speech().chunks(0.1):
        first, until = given, piece.start + float(piece.duration) - late
        while given < len(words) and words[given].start < until:
            given += 1
        speak(session, [own_times(Speech(piece.samples, piece.rate, words[first:given], start=piece.start))])
    assert words_that_call(session) == words_that_call(usual)
    assert len(words_that_call(session)) >= 3


@pytest.mark.slow
def test_an_empty_piece_begins_no_utterance():
    session = cospeech.open_live_session("rules", fps=30.0)
    assert not list(session.push(np.zeros(0, np.float32), 24_000))
    assert sum(map(len, session.idle(0.5))) == 15
    assert sum(map(len, session.push(load_speech().samples[:16_000], 16_000))) + sum(map(len, session.finish())) == 30


def test_sound_that_ends_before_the_first_frame_of_its_utterance_is_no_error():
    session = cospeech.open_live_session("rules", fps=30.0)
    list(session.idle(0.01))  # the frame at 0 is given; the next one is at 1/30
    assert not list(session.push(np.full(560, 0.1), 24_000))  # up to exactly there
    assert sum(map(len, session.idle(0.5))) == 15
