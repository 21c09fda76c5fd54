"""Who speaks and how, followed over a speech: against the same worked out frame by frame; pieces of any size."""

from __future__ import annotations

import numpy as np
import pytest

from cospeech.audio.emotions import EMOTIONS, EmotionTrack
from cospeech.rules.mood import SPAN
from cospeech.runtime.bundles.signature import Signature
from cospeech.runtime.speaker_emotion_tracker import BLOCK, DOUBT, VOICE, SpeakerEmotionTracker

AUDIO, SPEAKERS, REACH, FPS = 4, 3, 2, 10.0
QUIET = np.full(AUDIO, -1.0, np.float32)
WEIGHTS = np.random.default_rng(0).normal(0, 1, (2 * REACH + 1, AUDIO, SPEAKERS + 8))


NEUTRAL = np.eye(8)[EMOTIONS.index("neutral")]


class Classifier:
    """A classifier in a line of NumPy."""

    def __init__(self, reach: int) -> None:
        ports = {"rows": (1, "T", AUDIO)}, {"logits": (1, "T", SPEAKERS + 8)}
        self.signature, self.calls = Signature(*ports, window=2 * reach + 1, reach=reach), list[tuple[int, ...]]()

    def run(self, rows):
        self.calls.append(rows.shape)
        reach = self.signature.reach
        padded = np.pad(rows[0], ((reach, reach), (0, 0)))
        return {"logits": np.sum([padded[k : len(padded) - 2 * reach + k] @ WEIGHTS[k] for k in range(2 * reach + 1)], 0)[None]}


def tracker(given=None, *, judges: bool = True, reach: int = REACH) -> SpeakerEmotionTracker:
    return SpeakerEmotionTracker(Classifier(reach) if judges else None, SPEAKERS, FPS, QUIET, given)  # type: ignore[arg-type]


def speech(frames: int, seed: int = 0) -> np.ndarray:
    """Random rows of speech with pauses."""
    rows = np.random.default_rng(seed).normal(size=(frames, AUDIO)).astype(np.float32)
    rows[np.arange(frames) % 17 < 5] = QUIET
    return rows


def softmax(x: np.ndarray) -> np.ndarray:
    return np.exp(x) / np.exp(x).sum()


def by_hand(rows: np.ndarray, frame: int) -> np.ndarray:
    """(S + 8,) after this frame, from all of the speech before it: every frame's logits weighted by how long ago they were."""
    padded = np.concatenate([np.repeat(QUIET[None], REACH, 0), rows])
    sums, counts = np.zeros(SPEAKERS + 8), np.full(SPEAKERS + 8, DOUBT * FPS)
    fade = np.array([1.0] * SPEAKERS + [np.exp(-1 / (SPAN * FPS))] * 8)
    sums, counts = sums * fade ** (frame + 1), counts * fade ** (frame + 1)
    for k in range(frame + 1):
        if np.sqrt(np.square(rows[k] - QUIET).mean()) > VOICE:
            logits = sum(padded[k + j] @ WEIGHTS[j] for j in range(2 * REACH + 1))
            sums, counts = sums + logits * fade ** (frame - k), counts + fade ** (frame - k)
    who, how = np.split(sums / counts, [SPEAKERS])
    return np.concatenate([softmax(who), softmax(how)])


LAG = REACH + BLOCK


def test_the_course_is_what_the_logits_say():
    rows, who = speech(80), tracker()
    who.push(rows)
    assert who.frames == (80 - REACH) // BLOCK * BLOCK
    assert who.lag == LAG
    for frame in (LAG, LAG + 1, 20, 41, 73, 79):
        of_frame = who.shares(np.array(frame))
        np.testing.assert_allclose(of_frame[:SPEAKERS], by_hand(rows, frame - LAG)[:SPEAKERS], atol=1e-6)
        np.testing.assert_array_equal(of_frame[SPEAKERS:], NEUTRAL)  # whatever is heard
    half = (by_hand(rows, 30) + by_hand(rows, 31)) / 2
    np.testing.assert_allclose(who.shares(np.array(30.5 + LAG))[:SPEAKERS], half[:SPEAKERS], atol=1e-6)
    np.testing.assert_allclose(who.speaker, by_hand(rows, who.frames - 1)[:SPEAKERS], atol=1e-6)
    mean = np.mean([by_hand(rows, frame)[SPEAKERS:] for frame in range(who.frames)], 0)
    np.testing.assert_allclose(who.emotion, mean, atol=1e-6)
    shares = who.shares(np.linspace(-3, 90, 77))
    assert shares.min() >= 0
    np.testing.assert_allclose([shares[:, :SPEAKERS].sum(1), shares[:, SPEAKERS:].sum(1)], 1)


def test_before_anything_is_heard_it_may_be_anybody_and_is_neutral():
    first = tracker().shares(np.array([0.0, 3.0]))
    np.testing.assert_allclose(first[:, :SPEAKERS], 1 / SPEAKERS)
    np.testing.assert_array_equal(first[:, SPEAKERS:], [NEUTRAL, NEUTRAL])
    who = tracker()
    who.push(speech(40))
    np.testing.assert_array_equal(who.shares(np.array([0, LAG - 1])), first)


def test_silence_says_nothing():
    who = tracker()
    who.push(np.repeat(QUIET[None], 400, 0))
    np.testing.assert_allclose(who.shares(np.array([100, 390])), tracker().shares(np.array([0, 0])), atol=1e-9)
    assert who._classifier.calls == []


@pytest.mark.parametrize("sizes", [[1], [3], [7, 1], [64], [0, 2, 0, 5]], ids=str)
def test_pieces_do_not_show(sizes):
    """What is said of a frame is the same as soon as that frame was heard, whatever came with it."""
    rows, whole, parts, at, turn = speech(90), tracker(), tracker(), 0, 0
    whole.push(rows)
    while at < len(rows):
        piece = rows[at : at + sizes[turn % len(sizes)]]
        parts.push(piece)
        at, turn = at + len(piece), turn + 1
        frames = np.array([max(at - 1, 0), max(at - 1.5, 0), max(at - 20, 0)])
        if at:
            assert parts.shares(frames).tobytes() == whole.shares(frames).tobytes()
    assert parts.speaker.tobytes() == whole.speaker.tobytes()
    assert set(whole._classifier.calls) == {(1, 2 * REACH + BLOCK, AUDIO)}  # always the same blocks


def test_the_voice_is_followed_over_seconds():
    """A classifier that is sure: the speaker is judged over all that was heard, the mood over its last seconds."""
    who, logits = tracker(reach=0), np.zeros((200, SPEAKERS + 8))
    logits[:100, [0, SPEAKERS + 2]] = 9
    logits[100:, [1, SPEAKERS + 4]] = 9
    rows = np.zeros((200, AUDIO), np.float32)
    place = iter(range(0, 200, BLOCK))
    who._classifier.run = lambda rows: {"logits": logits[None, (k := next(place)) : k + BLOCK]}
    who.push(rows)
    course = who.shares(np.arange(200))
    assert (course[:, SPEAKERS:] == NEUTRAL).all()  # no mood that is heard is played
    emotions = np.array(who._course)[-200:, SPEAKERS:]
    assert (emotions[99].argmax(), emotions[199].argmax()) == (2, 4)
    seconds = np.flatnonzero(emotions[100:, 4] > emotions[100:, 2])[0] / FPS
    assert 1 < seconds < SPAN
    np.testing.assert_allclose(who.speaker[0], who.speaker[1], rtol=1e-6)
    change = np.abs(np.diff(course[BLOCK:], axis=0)).max(1)
    assert (change[change > 1e-3] < 0.3).all()  # it does not jump, not even between blocks


def test_what_is_given_is_played_and_not_heard():
    track = EmotionTrack([0, 4], np.eye(8)[[1, 3]])
    who = tracker(track)
    who.push(speech(60))
    np.testing.assert_allclose(who.shares(np.array([20.0, 55.0]))[:, SPEAKERS:], track.at(np.array([2.0, 5.5])))
    np.testing.assert_allclose(who.at(np.array([1.0, 3.0])), track.at(np.array([1.0, 3.0])))
    plain = tracker()
    plain.push(speech(60))
    np.testing.assert_array_equal(who.shares(np.arange(60))[:, :SPEAKERS], plain.shares(np.arange(60))[:, :SPEAKERS])
    np.testing.assert_allclose(plain.at(np.arange(60) / FPS), plain.shares(np.arange(60))[:, SPEAKERS:], atol=1e-12)


def test_without_a_classifier_nobody_is_heard():
    who = tracker(judges=False)
    who.push(speech(60))
    np.testing.assert_allclose(who.shares(np.arange(60)), np.broadcast_to(tracker().shares(np.array(0)), (60, SPEAKERS + 8)))
    assert not who.knows
    assert not tracker().knows  # what is heard is not what is played
    assert tracker(EmotionTrack.constant("anger"), judges=False).knows


@pytest.mark.slow
def test_memory_is_bounded_and_forgetting_does_not_show():
    whole, short, rows = tracker(), tracker(), speech(6000)
    whole.push(rows)
    for at in range(0, 6000, 50):
        short.push(rows[at : at + 50])
        short.forget(at - 100)
        assert len(short._course) < 170
        assert len(short._rows) < 2 * REACH + BLOCK
        recent = np.arange(max(0, at - 50), at + 50)
        assert short.shares(recent).tobytes() == whole.shares(recent).tobytes()
    assert np.isfinite(short.shares(np.array([0, 5999]))).all()  # what is forgotten: the oldest that is kept
