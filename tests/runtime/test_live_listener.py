"""A live character that listens to who speaks to it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cospeech.audio.speech import Speech, example
from cospeech.errors import InputError
from cospeech.face.gaze import direction_of, head_rotation
from cospeech.generate import open_live_session
from cospeech.motion.motion import Motion
from cospeech.runtime.live_listener import LiveListener
from tests.support.motions import gesturing

RATE, PIECE = 16_000, 1600


@pytest.fixture(scope="module")
def voice():
    """Twelve seconds of speech."""
    return Speech.load(example()[0]).samples[: 12 * RATE]


def play(partner, own=None, *, size=PIECE, seed=1, **options):
    """Frames of a session that hears its own sound, or silence, and a partner, in pieces of both."""
    session = open_live_session("rules", seed=seed, fps=30, idle_after=2.0, **options)
    made = []
    for at in range(0, len(partner), size):
        session.listener.hear(partner[at : at + size], RATE)
        sound = np.zeros(len(partner[at : at + size]), np.float32) if own is None else own[at : at + size]
        made += session.push(sound, RATE)
    made += session.idle(1.0)
    return Motion.concatenate(made)


def pitch(motion):
    """Degrees by which the head looks down."""
    return -np.degrees(direction_of(head_rotation(motion.rotations)))[:, 1]


def test_nobody_who_speaks_leaves_the_frames_as_they_are(voice):
    silent = play(np.zeros_like(voice))
    session = open_live_session("rules", seed=1, fps=30, idle_after=2.0)
    bare = [motion for at in range(0, len(voice), PIECE) for motion in session.push(np.zeros(PIECE, np.float32), RATE)]
    bare = Motion.concatenate([*bare, *session.idle(1.0)])
    assert np.abs(pitch(silent) - pitch(bare)).max() < 0.01


def test_a_character_that_is_spoken_to_nods_soon_after_pauses(voice):
    bare, shown = play(np.zeros_like(voice)), play(voice)
    nods = pitch(shown) - pitch(bare)
    assert nods.max() > 2.5, "there is a nod"
    assert (nods > 2.0).sum() < 0.4 * len(nods), "and not all the time"
    first = shown.times[np.flatnonzero(nods > 2.0)[0]]
    assert first > 0.7, "nobody nods before anything was said"
    assert np.abs(shown.face - bare.face).max() > 0.03, "the face takes part"


def test_seeds_differ_and_one_seed_is_always_alike(voice):
    first, again, other = (play(voice[: 7 * RATE], seed=seed) for seed in (1, 1, 2))
    assert np.array_equal(first.rotations, again.rotations)
    assert np.abs(pitch(first) - pitch(other)).max() > 2


def test_who_speaks_does_not_answer_its_own_voice_in_the_microphone(voice):
    alone = play(np.zeros_like(voice), own=voice)
    echo = play(0.3 * voice, own=voice)
    assert np.abs(pitch(alone) - pitch(echo)).max() < 0.01


def test_a_character_without_a_body_answers_with_eyes_and_face_alone(voice):
    shown = play(voice, parts=("face",))
    head = shown.rotations[:, shown.skeleton.index["head"]]
    assert np.abs(head - head[0]).max() < 1e-6


def test_the_person_may_stand_to_a_side(voice):
    left, ahead = play(voice[: 4 * RATE], angle=40.0), play(voice[: 4 * RATE])
    yaw = [np.degrees(direction_of(head_rotation(each.rotations)))[:, 0] for each in (left, ahead)]
    assert 20 < np.median(yaw[0] - yaw[1]) < 40


def test_samples_need_a_rate_and_one_rate(voice):
    session = open_live_session("rules")
    with pytest.raises(InputError, match=r"without a rate.*listener\.hear"):
        session.listener.hear(voice)
    session.listener.hear(voice[:1000], RATE)
    with pytest.raises(InputError, match="8000 Hz"):
        session.listener.hear(voice[:1000], 8_000)


def test_hours_of_listening_keep_little(voice):
    listener, frames = LiveListener(seed=1), gesturing(30)
    for k in range(30):
        for second in range(12):
            listener.hear(voice[second * RATE : (second + 1) * RATE], RATE)
            listener.apply(replace(frames, start=12.0 * k + second))
    assert len(listener._layer._responses) + len(listener._layer._listening) < 40
    assert len(listener._detector.phrases) < 200
