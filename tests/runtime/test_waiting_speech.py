"""Small pieces: a body hears several as one, while the face has nothing to do. test_streams.py holds the bits."""

import numpy as np
import pytest

import cospeech
from cospeech.audio.features.at_16_khz import HeldSamples
from cospeech.audio.speech import Speech, example
from cospeech.motion.motion import Motion
from cospeech.rules.session import Session
from cospeech.runtime.session import TrainedSession
from cospeech.runtime.waiting_speech import WaitingSpeech

BODIES = ("stylised-flow", "mix-stage", "chain-of-generation")


def test_what_waits_comes_out_as_one_piece():
    pieces = list(Speech(np.arange(1000, dtype=np.float32) / 1e4, 16_000).chunks(0.013))
    waiting = WaitingSpeech()
    for piece in pieces:
        waiting.hold(piece)
    whole = waiting.take()
    np.testing.assert_array_equal(whole.samples, np.concatenate([piece.samples for piece in pieces]))
    assert whole.duration == sum(piece.duration for piece in pieces)
    assert waiting.take() is None
    assert waiting.heard == 1000


def hum(seconds: float) -> np.ndarray:
    times = np.arange(round(seconds * 16_000)) / 16_000
    return (0.3 * np.sin(2 * np.pi * 140 * times) * np.sin(np.pi * 2.3 * times) ** 2).astype(np.float32)


def test_what_waits_is_not_changed_by_a_buffer_that_is_filled_again():
    buffer = np.ones(320, np.float32)
    waiting, samples = WaitingSpeech(), HeldSamples()
    waiting.hold(Speech(buffer))
    assert samples.is_short(buffer, 1000)
    buffer[:] = 0
    assert waiting.take().samples.min() == samples.take(buffer).max() == 1


@pytest.mark.parametrize("quiet", [0.0, 0.3])
def test_a_driver_of_sound_may_use_one_buffer(quiet):
    """The frames are those of the sound that was pushed, whatever the caller does with its buffer after each push."""
    sound, buffer, motions = (
        np.concatenate([np.zeros(round(quiet * 16_000), np.float32), hum(1.0)]),
        np.empty(320, np.float32),
        [],
    )
    for has_one_buffer in (False, True):
        live, frames = cospeech.open_live_session("rules", fps=30, parts=("body", "hands")), list[Motion]()
        if quiet:
            live.interrupt()  # from now on, silence waits for sound
        for piece in sound.reshape(-1, 320):
            buffer[:] = piece
            frames += live.push(buffer if has_one_buffer else piece, 16_000)
            buffer[:] = 0
        motions.append(Motion.concatenate([*frames, *live.finish()]))
    np.testing.assert_array_equal(motions[1].rotations, motions[0].rotations)


@pytest.mark.slow
@pytest.mark.parametrize("name", BODIES)
def test_face_and_body_do_not_work_in_one_push(name, monkeypatch):
    calls = {"face": 0, "body": 0}

    def count(kind, method):
        def call(self, *values, **options):
            calls[kind] += 1
            return method(self, *values, **options)

        return call

    for kind, owner, method in (("face", Session, "_realise"), ("face", Session, "_hear"), ("body", WaitingSpeech, "take")):
        monkeypatch.setattr(owner, method, count(kind, getattr(owner, method)))
    speech = Speech.load(example()[0]).window(0, 5)
    assert speech.rate == 16_000
    session, both, bodies = cospeech.load(name).session(fps=60), 0, 0
    assert isinstance(session, TrainedSession)
    for number, piece in enumerate(speech.chunks(0.02)):
        calls.update(face=0, body=0)
        list(session.push(piece))
        if number > 100:
            both += calls["face"] > 0 and calls["body"] > 0
            bodies += calls["body"]
    assert bodies < 0.25 * (250 - 100)  # ticks of .1 s, not pieces of .02 s
    assert both <= 0.05 * bodies
