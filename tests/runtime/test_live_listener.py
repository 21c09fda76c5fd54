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
from cospeech.motion.skeletons.arkit import ARKIT_INDEX
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
    motions = []
    for at in range(0, len(partner), size):
        session.listener.hear(partner[at : at + size], RATE)
        sound = np.zeros(len(partner[at : at + size]), np.float32) if own is None else own[at : at + size]
        motions += session.push(sound, RATE)
    motions += session.idle(1.0)
    return Motion.concatenate(motions)


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
    bare, motion = play(np.zeros_like(voice)), play(voice)
    nods = pitch(motion) - pitch(bare)
    assert nods.max() > 2.5, "there is a nod"
    assert (nods > 2.0).sum() < 0.4 * len(nods), "and not all the time"
    first = motion.times[np.flatnonzero(nods > 2.0)[0]]
    assert first > 0.7, "nobody nods before anything was said"
    assert np.abs(motion.face - bare.face).max() > 0.03, "the face takes part"


def test_seeds_differ_and_one_seed_is_always_alike(voice):
    first, again, other = (play(voice[: 7 * RATE], seed=seed) for seed in (1, 1, 2))
    assert np.array_equal(first.rotations, again.rotations)
    assert np.abs(pitch(first) - pitch(other)).max() > 2


@pytest.mark.parametrize("delay", [0.0, 1.0, 1.75])
def test_who_speaks_does_not_answer_its_own_voice_in_the_microphone(voice, delay):
    """The voice is heard in the room when the frames are seen, which is a latency after its sound was pushed."""
    own = np.concatenate([voice[: 8 * RATE], np.zeros(6 * RATE, np.float32)])
    late = np.concatenate([np.zeros(round(delay * RATE), np.float32), own])[: len(own)]
    alone, echo = play(np.zeros_like(own), own=own), play(0.3 * late, own=own)
    assert np.abs(pitch(alone) - pitch(echo)).max() < 0.01


def test_much_sound_at_once_is_one_row_of_nods_at_most(voice):
    session = open_live_session("rules", seed=1, fps=30, idle_after=2.0)
    bare = Motion.concatenate(list(open_live_session("rules", seed=1, fps=30, idle_after=2.0).idle(4.0)))
    session.listener.hear(np.tile(voice, 4), RATE)
    nods = pitch(Motion.concatenate(list(session.idle(4.0)))) - pitch(bare)
    assert nods.max() < 9, "no two rows at the same time"
    times = np.array([each.time for each in session.listener._layer._responses])
    assert len(times) < 2


def test_listening_ends_where_the_sound_of_the_person_ends(voice):
    brows = []
    for partner in (voice, None):
        session = open_live_session("rules", seed=1, fps=30, idle_after=2.0)
        for at in range(0, 6 * RATE, PIECE):
            if partner is not None:
                session.listener.hear(partner[at : at + PIECE], RATE)
            for _ in session.push(np.zeros(PIECE, np.float32), RATE):
                pass
        after = Motion.concatenate(list(session.idle(30.0)))
        brows.append(after.face[:, ARKIT_INDEX["browInnerUp"]])
    assert np.abs(brows[0] - brows[1])[after.times < 7].max() > 0.01, "the person was speaking"
    assert np.abs(brows[0] - brows[1])[after.times > 12].max() == 0


def test_frames_that_are_taken_back_take_back_what_was_to_be_shown_in_them(voice):
    session = open_live_session("rules", seed=1, fps=30, idle_after=2.0)
    for at in range(0, len(voice), RATE // 2):
        session.listener.hear(voice[at : at + RATE // 2], RATE)
        for _ in session.idle(0.5):
            pass
    session.interrupt(at=4.0)
    layer = session.listener._layer
    assert all(each.time < 4 for each in layer._responses)
    assert layer._listening[-1] == (4.0, np.inf), "the person is still speaking"
    for at in range(0, len(voice), RATE // 2):
        session.listener.hear(voice[at : at + RATE // 2], RATE)
        for _ in session.idle(0.5):
            pass
    times = [each.time for each in layer._responses]
    assert len(times) > 1
    assert min(np.diff(times)) >= 2.2
    assert max(times) < session.time + 1


def test_intensity_and_parts_are_those_of_the_session(voice):
    def play_with(change, voice=voice):
        session, motions = open_live_session("rules", seed=1, fps=30, idle_after=2.0), []
        change(session)
        for at in range(0, len(voice), PIECE):
            session.listener.hear(voice[at : at + PIECE], RATE)
            motions += session.push(np.zeros(PIECE, np.float32), RATE)
        return Motion.concatenate(motions)

    still, bare = (play_with(lambda session: session.set_intensity(0), sound) for sound in (voice, np.zeros_like(voice)))
    assert np.abs(pitch(still) - pitch(bare))[still.times > 1].max() < 0.01
    faceless = play_with(lambda session: session.set_parts(("body", "hands")))
    assert np.abs(faceless.face[faceless.times > 1]).max() == 0
    bodiless = play_with(lambda session: session.set_parts(("face",)))
    assert np.abs(pitch(bodiless)[bodiless.times > 1]).max() < 1e-3


def test_a_character_without_a_body_answers_with_eyes_and_face_alone(voice):
    motion = play(voice, parts=("face",))
    head = motion.rotations[:, motion.skeleton.index["head"]]
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
    assert len(listener._detector.phrases) < 10
