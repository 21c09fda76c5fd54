"""Chains that play: the calls of every model; words, emotions and speakers given or heard; streams to the bit; files."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache, partial
from itertools import pairwise
from math import inf
from pathlib import Path
from tempfile import mkdtemp

import numpy as np
import pytest
import soundfile as sf

pytest.importorskip("onnx", reason="graphs are built with onnx (the train extra)")

from cospeech import generate as generating
from cospeech.audio.emotions import EMOTIONS, EmotionTrack
from cospeech.audio.speech import Speech, Word
from cospeech.errors import InputError
from cospeech.motion.motion import Motion
from cospeech.rules import RuleBasedModel
from cospeech.rules.options import LAYERS
from cospeech.runtime.bundles.spec import VOICE
from cospeech.runtime.flow.latent_sources import CodeSource
from cospeech.runtime.model import TrainedModel
from tests.support.runtime_bundles import LOOK_AHEAD, NAMES, cut, perform_changes, same, talk, write_small_chain

BODY = ("body", "hands")
CUTS = ([], [1, 2, 7, 9000, 9001, 40_000], list(range(1600, 51_000, 1600)))
WORDS = (Word("yes", 1.0, 1.3), Word("we", 1.4, 1.6), Word("mountains", 1.65, 2.5))


@cache
def gesturer(**kind) -> TrainedModel:
    return TrainedModel.open(write_small_chain(Path(mkdtemp(prefix="cospeech-test-")) / "chain.cospeech", **kind))


def away(a: Motion, b: Motion) -> float:
    return float(np.abs(a.rotations - b.rotations).max())


def spoken(seconds: float = 3.2) -> Speech:
    return replace(talk(seconds), words=WORDS)


def cut_with_words(speech: Speech, edges) -> list[Speech]:
    """Cut a speech; a word comes with the piece that it starts in; times count from the start of the first piece."""
    bounds = [0, *edges, len(speech)]
    words_of_pieces = [tuple(w for w in speech.words if a <= w.start * speech.rate < b) for a, b in pairwise(bounds)]
    return [
        Speech(speech.samples[a:b], speech.rate, words, start=a / speech.rate)
        for (a, b), words in zip(pairwise(bounds), words_of_pieces, strict=True)
    ]


@pytest.mark.parametrize("style", ["ada", VOICE])
@pytest.mark.parametrize("look_ahead", [None, inf])
def test_pieces_do_not_show(style, look_ahead):
    speech = spoken()
    whole = gesturer().generate(speech, seed=3, style=style, look_ahead=look_ahead)
    for edges in CUTS:
        pieces = list(gesturer().stream(cut_with_words(speech, edges), seed=3, style=style, look_ahead=look_ahead))
        assert same(Motion.concatenate(pieces), whole)
        np.testing.assert_allclose([piece.start for piece in pieces], np.cumsum([0, *map(len, pieces)])[:-1] / 30)


def test_pieces_do_not_show_at_another_rate():
    speech = talk(2.0, rate=44_100)
    whole = gesturer().generate(speech, style=VOICE)
    for edges in ([1, 2, 7, 9000, 9001, 40_000], list(range(1470, 88_000, 1470))):
        assert same(Motion.concatenate(list(gesturer().stream(cut(speech, edges), style=VOICE))), whole)


@pytest.mark.parametrize(
    ("look_ahead", "frames"), [(None, LOOK_AHEAD + 1), (0.2, LOOK_AHEAD + 1), (0.3, LOOK_AHEAD + 1), (0.8, 12), (inf, 12)]
)
def test_it_is_as_late_as_it_says(look_ahead, frames):
    speech, session = talk(8.0), gesturer().session(parts=BODY, look_ahead=look_ahead)
    samples, count, late = 0, 0, []
    for chunk in cut(speech, range(160, len(speech), 160)):
        samples += len(chunk)
        count += sum(len(piece) for piece in session.push(chunk))
        late.append(samples / 16_000 - count / 30)
    assert max(late) <= session.latency
    assert max(late) > session.latency - 0.2
    assert session.latency == pytest.approx((frames + 2) / 15 + 0.065, abs=0.02)


def test_words_that_come_with_pieces_are_read():
    speech = spoken()
    plain, with_words = gesturer().generate(talk(), parts=BODY), gesturer().generate(speech, parts=BODY)
    differs = np.abs(with_words.rotations - plain.rotations).max((1, 2)) > 1e-5
    assert not differs[: int((1.0 - (LOOK_AHEAD + 3) / 15) * 30)].any()  # what it hears ahead, and smoothing
    assert differs[32:75].mean() > 0.9
    assert same(gesturer(words=0).generate(speech, parts=BODY), gesturer(words=0).generate(talk(), parts=BODY))


def test_emotions_are_heard_given_or_follow_a_track():
    speech = talk(4.0)
    motions = {name: gesturer().generate(speech, emotion=name) for name in ("auto", "anger", "happiness")}
    assert min(away(motions["auto"], motions["anger"]), away(motions["anger"], motions["happiness"])) > 1e-3
    track = EmotionTrack([0, 2, 2.1], np.eye(8)[[EMOTIONS.index(name) for name in ("anger", "anger", "happiness")]])
    motion = gesturer().generate(speech, emotion=track)
    before = int((2 - LOOK_AHEAD / 15 - 0.3) * 30)
    assert away(motion[:before], motions["anger"][:before]) < 1e-6
    assert away(motion[90:], motions["anger"][90:]) > 1e-3
    session = gesturer().session(emotion="anger")
    list(session.push(speech))
    list(session.finish())
    assert session.emotion["anger"] == pytest.approx(1)
    assert Motion.concatenate(list(gesturer().stream(cut(speech, CUTS[1]), emotion=track))).rotations.tobytes() == (
        motion.rotations.tobytes()
    )


def test_a_mood_that_is_heard_is_reported_and_not_played():
    """A category from the sound alone does harm; what the voice tells surely is its arousal."""
    session = gesturer().session()
    list(session.push(talk(5.0)))
    list(session.finish())
    np.testing.assert_allclose(sum(session.emotion.values()), 1)
    assert session.emotion["neutral"] < 0.9  # the classifier's, and not the rules'
    assert session.emotion != gesturer(judges=False).session().emotion
    assert session.expression == {name: float(name == "neutral") for name in EMOTIONS}
    assert -1 <= session.arousal <= 1
    angry = gesturer().session(emotion="anger")
    list(angry.push(talk(5.0)))
    list(angry.finish())
    assert angry.expression["anger"] == pytest.approx(1)
    assert angry.arousal is None


@pytest.mark.slow
def test_the_amplitude_follows_the_arousal_of_the_voice():
    """The example's voice is calmer than acted ones: less is moved than with a neutral voice, and nothing else changes."""
    speech, options, chain = replace(talk(18.0), words=None), {"parts": BODY, "seed": 4}, gesturer()
    auto, neutral = (chain.generate(speech, emotion=emotion, **options) for emotion in ("auto", "neutral"))
    spreads = [np.std(motion.rotations[len(motion) // 2 :, :, :3], axis=0).sum() for motion in (auto, neutral)]
    session = chain.session(**options)
    pieces = [piece for chunk in cut(speech, [1, 9000, 9001, 150_000, 250_000]) for piece in session.push(chunk)]
    assert same(Motion.concatenate([*pieces, *session.finish()]), auto)
    assert session.arousal < -0.1
    assert spreads[0] < 0.99 * spreads[1]


def test_who_speaks_is_told_and_played():
    speech, session = talk(4.0), gesturer().session(style=VOICE)
    list(session.push(speech))
    list(session.finish())
    assert set(session.speaker) == set(NAMES)
    assert sum(session.speaker.values()) == pytest.approx(1)
    assert gesturer(judges=False).session().speaker is None
    ada, ben, voice, mixture = (gesturer().generate(speech, style=s, parts=BODY) for s in (*NAMES, VOICE, "ada:0.7,ben:0.3"))
    assert min(away(ada, ben), away(voice, ada), away(voice, ben), away(mixture, ada)) > 1e-3
    assert same(mixture, gesturer().generate(speech, style={"ben": 0.3, "ada": 0.7}, parts=BODY))
    assert gesturer().session(style="ada:0.7,ben:0.3").style_mixture == {"ada": 0.7, "ben": 0.3}
    assert gesturer().session(style=f"ada:0.5,{VOICE}:0.5").style_mixture == {"ada": 0.5, VOICE: 0.5}
    assert gesturer().session(style="ben").style_mixture is gesturer().session(style=VOICE).style_mixture is None
    assert (gesturer().styles, gesturer().default_style) == ((*NAMES, VOICE), "ada")


@pytest.mark.parametrize("look_ahead", [None, inf])
def test_a_change_of_style_depends_on_the_samples_and_not_on_the_pieces(look_ahead):
    speech, changes = talk(4.0), {20_000: "ben", 23_333: "ada:0.5,voice:0.5", 41_000: VOICE}
    play = partial(perform_changes, gesturer(), speech, changes=changes, seed=2, parts=BODY, look_ahead=look_ahead)
    at_once = play([])
    assert all(same(play(edges), at_once) for edges in CUTS)
    assert away(gesturer().generate(speech, seed=2, parts=BODY, look_ahead=look_ahead), at_once) > 1e-3


def test_intensity_scales_from_the_style_s_mean_pose():
    still, half, full = (gesturer().generate(talk(2.0), parts=BODY, intensity=k, fps=15.0).root for k in (0.0, 0.5, 1.0))
    assert np.ptp(still, 0).max() < 1e-6
    np.testing.assert_allclose((half - still)[:, 0], (full - still)[:, 0] / 2, atol=1e-5)


@pytest.mark.parametrize("samples", [1, 500, 1600, 4000])
@pytest.mark.parametrize("look_ahead", [None, inf])
def test_short_speech(samples, look_ahead):
    speech = Speech(np.zeros(samples, np.float32))
    motion = gesturer().generate(speech, look_ahead=look_ahead)
    assert len(motion) == speech.frames(30.0)
    assert np.isfinite(motion.rotations).all()


def test_what_a_chain_cannot_do_is_told():
    clip = RuleBasedModel().generate(talk(3.0), parts=BODY)
    with pytest.raises(InputError, match="cannot take a style"):
        gesturer().session(style=clip)
    with pytest.raises(InputError, match="transfer"):
        TrainedModel(gesturer().system, CodeSource)


def test_memory_does_not_grow_with_the_speech():
    """The test compares what every part stores after one minute and after ten."""
    session, minute, sizes = gesturer().session(style=VOICE, parts=BODY), talk(60.0), []

    def size(thing, visits) -> int:
        if id(thing) in visits or isinstance(thing, str | int | float | type) or callable(thing):
            return 0
        visits.add(id(thing))
        if isinstance(thing, np.ndarray):
            return thing.nbytes
        inner = thing.values() if isinstance(thing, dict) else thing if isinstance(thing, list | tuple) else []
        return sum(size(each, visits) for each in [*inner, *getattr(thing, "__dict__", {}).values()])

    for number in range(10):
        for chunk in minute.chunks(2.0):
            list(session.push(chunk))
        if number in (0, 9):
            sizes.append(size({k: v for k, v in vars(session).items() if k in ("_decoder", "_frontend", "_sampled")}, set()))
    assert sizes[1] < 1.05 * sizes[0] + 10_000


def test_files_are_played_with_all_of_their_speech_heard(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(generating, "load_model", lambda name: gesturer())
    sf.write("talk.wav", talk(2.0).samples, 16_000)
    result = generating.generate_files("talk.wav", ["a.npz"], style=f"ada:0.5,{VOICE}:0.5", report="r.json", seed=3, takes=3)
    report = json.loads(Path("r.json").read_text(encoding="utf-8"))
    assert report["speaker"] == result.speaker
    assert set(report["speaker"]) == set(NAMES)
    assert report["style_mixture"] == {"ada": 0.5, VOICE: 0.5}
    generating.generate_files("talk.wav", ["alone.npz"], style=f"ada:0.5,{VOICE}:0.5", seed=4)
    assert Path("a.2.npz").read_bytes() == Path("alone.npz").read_bytes()
    alone, speech = Motion.load("alone.npz"), Speech.load("talk.wav")
    options, layers = {"style": f"ada:0.5,{VOICE}:0.5", "seed": 4}, dict.fromkeys(LAYERS, True)
    both_ways, ahead = (gesturer().generate(speech, look_ahead=seconds, **layers, **options) for seconds in (inf, None))
    for name, motion in {"both": both_ways, "ahead": ahead}.items():
        motion.save(f"{name}.npz")
    assert away(alone, Motion.load("both.npz")) < 1e-4 < 1e-2 < away(alone, Motion.load("ahead.npz"))
    assert (gesturer().for_files, RuleBasedModel().for_files) == ({"look_ahead": inf, **layers}, {})
