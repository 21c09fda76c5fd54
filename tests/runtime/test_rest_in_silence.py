"""Hands of trained systems come to rest while there is no speech."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

pytest.importorskip("onnx", reason="graphs are built with onnx (the train extra)")

from cospeech.audio.speech import Speech
from cospeech.motion.motion import Motion
from cospeech.motion.rotations import quat_angle
from cospeech.motion.skeleton import humanoid
from cospeech.runtime.model import TrainedModel
from cospeech.runtime.rest_in_silence import RestInSilence, resting_pose
from tests.support.fake_windows import whole_system
from tests.support.runtime_bundles import cut, same, talk, write_small, write_small_chain

ARMS = [k for k, name in enumerate(humanoid().names) if name.endswith(("UpperArm", "LowerArm"))]
REST = slice(60, 80)  # frames of 20 a second, 3 to 4 s: of `spoken` more than 1.3 s after the voice


@cache
def model_of(kind: str, folder: object) -> TrainedModel:
    writers = {"flow": write_small, "chain": write_small_chain}
    if kind == "window":
        return TrainedModel(replace(whole_system(), rests=True))
    model = TrainedModel.open(writers[kind](folder / "a.cospeech"))
    return TrainedModel(replace(model.system, rests=True))


@pytest.fixture(params=["flow", "window", "chain"])
def model(request, tmp_path_factory):
    return model_of(request.param, tmp_path_factory.getbasetemp())


@cache
def spoken() -> Speech:
    """1.7 s of voice, 3 s of silence, 1 s of voice."""
    return Speech(np.concatenate([talk(1.7).samples, np.zeros(48_000, np.float32), talk(1.0).samples]))


def test_hands_rest_in_silence_and_move_in_speech(model):
    motion = model.generate(spoken(), fps=20, parts=("body", "hands"))
    bare = model.generate(spoken(), fps=20, parts=("body", "hands"), calibrated=False)
    away, away_bare = (quat_angle(m.rotations[:, ARMS].astype(float), resting_pose()[ARMS]) for m in (motion, bare))
    assert away[REST].max() < 1e-5
    assert away_bare[REST].max() > 0.01
    assert away[10].max() > 0.01


def test_a_bundle_that_does_not_rest_is_as_before(model):
    moving = TrainedModel(replace(model.system, rests=False)).generate(spoken(), fps=20)
    resting = model.generate(spoken(), fps=20)
    rest = [k for k in range(len(humanoid())) if humanoid().names[k] in ("hips", "neck", "head", "leftUpperLeg")]
    assert np.array_equal(moving.rotations[:, rest], resting.rotations[:, rest])
    assert np.array_equal(moving.rotations[:20], resting.rotations[:20])  # nothing changes while there is a voice


@pytest.mark.parametrize("fps", [30.0, 7.3])
def test_pieces_make_what_the_whole_makes(model, fps):
    pieces = [*model.stream(cut(spoken(), [999, 20_000, 20_441, 50_000, 70_001]), fps=fps)]
    assert same(Motion.concatenate(pieces), model.generate(spoken(), fps=fps))


def test_it_waits_for_nothing_more(model):
    usual = TrainedModel(replace(model.system, rests=False))
    assert model.session(look_ahead=0.2).latency == usual.session(look_ahead=0.2).latency
    session, speech, given = model.session(fps=20, parts=("body",)), spoken(), 0
    for k in range(0, len(speech.samples), 320):
        given += sum(len(m) for m in session.push(Speech(speech.samples[k : k + 320])))
        seconds = (k + 320) / 16_000
        assert given / 20 >= min(seconds, speech.seconds) - session.latency - 0.12  # a piece, a frame, the resampler


def test_a_frame_depends_on_what_it_says(model):
    rest = RestInSilence(20.0, 0.4, ("body", "hands"))
    assert 0.3 < rest.ahead <= 0.4
    assert RestInSilence(20.0, 0.0, ("body",)).ahead < 0.06


def test_noise_of_a_room_is_silence_and_a_whisper_is_not():
    rng = np.random.default_rng(0)
    shares = {}
    for name, level in (("room", 1e-4), ("whisper", 0.05)):
        rest = RestInSilence(20.0, 0.4, ("body",))
        rest.push(Speech((level * rng.standard_normal(48_000)).astype(np.float32)))
        rest.finish()
        shares[name] = rest.split(np.zeros((1, 60, 3), np.float32))[2]
    assert shares["room"].min() == 1
    assert shares["whisper"].max() == 0
