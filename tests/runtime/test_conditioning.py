"""Faces and motion that chains are given beside speech: what they change, what is shown, where clips join, who refuses them."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from math import inf
from pathlib import Path
from tempfile import mkdtemp

import numpy as np
import pytest
import soundfile as sf

pytest.importorskip("onnx", reason="graphs are built with onnx (the train extra)")

from cospeech import generate as generating
from cospeech.errors import InputError
from cospeech.motion.motion import Motion
from cospeech.motion.poses import find_pose
from cospeech.motion.rotations import quat_angle
from cospeech.motion.skeletons.arkit import ARKIT
from cospeech.rules import RuleBasedModel
from cospeech.runtime.conditioning import FADE, ConditioningFace, poses_before
from cospeech.runtime.model import TrainedModel
from tests.support.runtime_bundles import cut, same, talk, write_small, write_small_chain

BODY, SEEDS, FPS = ("body", "hands"), 4, 15.0
WHOLE = {"look_ahead": inf, "seed": 3}


@cache
def gesturer(**kind) -> TrainedModel:
    kind = {"faces": True, "seeds": SEEDS} | kind
    return TrainedModel.open(write_small_chain(Path(mkdtemp(prefix="cospeech-test-")) / "chain.cospeech", **kind))


@cache
def make_motion(seconds: float = 3.2, fps: float = 25.0, seed: int = 8) -> Motion:
    """A motion of our rules (synthetic), with a face."""
    return RuleBasedModel().generate(talk(seconds), fps=fps, seed=seed, emotion="happiness")


def away(a: Motion, b: Motion) -> float:
    return float(np.abs(a.rotations - b.rotations).max())


def test_a_face_over_time():
    motion = make_motion(2.0)
    face, times = ConditioningFace(motion), np.arange(50) / 25
    weights, share = face.at(times)
    np.testing.assert_allclose(weights, motion.face, atol=1e-6)
    assert (share == 1).all()
    between, _ = face.at((times[:-1] + times[1:]) / 2)
    np.testing.assert_allclose(between, (motion.face[:-1] + motion.face[1:]) / 2, atol=1e-6)
    after, share = face.at(2 + np.array([0, FADE / 4, FADE / 2, FADE, 9]))
    np.testing.assert_allclose(share[:, 0], [1, 0.75, 0.5, 0, 0], atol=1e-6)
    np.testing.assert_allclose(after, np.repeat(motion.face[-1:], 5, 0), atol=1e-6)
    before, share = face.at(np.array([-3.0]))
    np.testing.assert_allclose(before, motion.face[:1], atol=1e-6)
    assert share == 1
    alone, _ = ConditioningFace(motion[:1]).at(np.array([0.0, 1.0]))
    np.testing.assert_allclose(alone, np.repeat(motion.face[:1], 2, 0), atol=1e-6)


def test_a_face_that_is_given_is_shown_and_moves_body_and_hands():
    speech, face = talk(3.2), make_motion()
    plain, motion = gesturer().generate(speech, **WHOLE), gesturer().generate(speech, face=face, **WHOLE)
    times = np.arange(len(motion)) / 30
    np.testing.assert_allclose(motion.face, ConditioningFace(face).at(times)[0], atol=1e-6)
    assert away(plain, motion) > 1e-3
    other = gesturer().generate(speech, face=make_motion(seed=9), **WHOLE)
    assert away(other, motion) > 1e-4
    body = gesturer().generate(speech, face=face, parts=BODY, **WHOLE)
    assert body.face is None
    eyes = [motion.skeleton.index[name] for name in ("leftEye", "rightEye")]
    rest = [k for k in range(len(motion.skeleton)) if k not in eyes]
    np.testing.assert_array_equal(body.rotations[:, rest], motion.rotations[:, rest])
    angles = quat_angle(motion.rotations[:, eyes], plain.rotations[:, eyes])
    assert np.degrees(angles).mean() < 15  # the gaze is that of the rules, aimed from where this head is


def test_after_a_face_that_is_shorter_comes_the_system_s_own():
    speech, face = talk(6.4), make_motion(2.0)
    plain, motion = gesturer().generate(speech, **WHOLE), gesturer().generate(speech, face=face, **WHOLE)
    over = int((2 + FADE) * 30) + 1
    window = int(gesturer().system.main_network.signature.window / FPS * 30)
    np.testing.assert_allclose(motion.face[over + window :], plain.face[over + window :], atol=1e-6)  # eyelids follow the head
    np.testing.assert_allclose(motion.rotations[over + window :], plain.rotations[over + window :], atol=1e-6)
    assert np.abs(motion.face[:60] - plain.face[:60]).max() > 0.05


@pytest.mark.parametrize("suffix", [".json", ".csv", ".glb"])
def test_a_face_out_of_a_file(suffix, tmp_path):
    path = tmp_path / f"face{suffix}"
    face = make_motion(2.0, fps=30.0)
    face.save(path)
    motion = gesturer().generate(talk(2.0), face=path, **WHOLE)
    np.testing.assert_allclose(motion.face, face.face, atol=2e-3)
    assert same(motion, gesturer().generate(talk(2.0), face=Motion.load(path), **WHOLE))


@pytest.mark.parametrize("fps", [15.0, 30.0, 24.0])
def test_poses_before_lie_a_frame_of_the_model_apart(fps):
    """The next clip's first frame would come one frame after the last."""
    motion = RuleBasedModel().generate(talk(2.0), fps=fps, seed=1, parts=BODY)
    system, poses = gesturer().system, poses_before(gesturer().system, motion, SEEDS)
    rows = find_pose(system.pose).encode(motion)
    at = len(motion) - fps / FPS * np.arange(SEEDS, 0, -1)
    low = at.astype(int)
    high = np.minimum(low + 1, len(motion) - 1)
    expected = rows[low] + (at - low)[:, None] * (rows[high] - rows[low])
    s = system.statistics
    np.testing.assert_allclose(poses, (expected - s.pose_mean) / s.pose_std, atol=2e-3)
    of_one_frame = poses_before(system, motion[:1], SEEDS)
    np.testing.assert_allclose(of_one_frame, np.repeat((rows[:1] - s.pose_mean) / s.pose_std, SEEDS, 0), atol=2e-3)


def test_the_network_sees_poses_as_it_would_have_made_them(monkeypatch):
    """In its own numbers: what is made of them is what came before."""
    motion, calls = make_motion(), []
    system = gesturer(words=2).system
    network, width = system.networks["make"], system.pose_width
    run = network.run
    monkeypatch.setattr(network, "run", lambda **given: calls.append(given) or run(**given))
    session = gesturer(words=2).session(continue_from=motion, parts=BODY, style="ada", **WHOLE)
    list(session.push(talk(3.2)))
    list(session.finish())
    (first, *later), frames = calls, calls[0]["rows"].shape[1]
    assert first["seed"].shape == (1, frames, width + 1)
    given = first["seed"][0]
    np.testing.assert_array_equal(given[:, -1], np.arange(frames) < SEEDS)
    assert not given[SEEDS:].any()
    assert not [ports for ports in later if {"seed", "face"} & set(ports)]
    assert later
    centre, mean, gain = session._decoder._style.scales(np.zeros(1, int))
    back = centre + gain * (given[:SEEDS, :-1] - mean)
    poses = poses_before(system, motion, SEEDS)
    inside = np.abs(given[:SEEDS, :-1]) < 2.9  # not at the bounds of what is made
    np.testing.assert_allclose(back[inside], poses[inside], atol=1e-3)
    assert inside.mean() > 0.5


def test_motion_to_go_on_from_moves_the_beginning_and_no_more():
    speech, first = talk(9.6), make_motion()
    plain, motion = (gesturer().generate(speech, parts=BODY, continue_from=m, **WHOLE) for m in (None, first))
    window = int(gesturer().system.main_network.signature.window / FPS * 30)
    assert away(plain[:10], motion[:10]) > 1e-4
    np.testing.assert_array_equal(plain.rotations[window:], motion.rotations[window:])
    with_file = gesturer().generate(speech, parts=BODY, continue_from=first, face=first, **WHOLE)
    assert away(with_file, motion) > 1e-4


@pytest.mark.parametrize("fps", [15.0, 30.0])
@pytest.mark.parametrize("style", ["ada", "ada:0.5,ben:0.5"])
def test_clips_join(fps, style):
    """The first pose is nearly the last one of what came before, and what is added is gone after half a second."""
    options = WHOLE | {"fps": fps, "parts": BODY, "style": style}
    first = RuleBasedModel().generate(talk(2.0), fps=fps, seed=2, parts=BODY)
    plain, joint_motion = (gesturer().generate(talk(4.8), continue_from=m, **options) for m in (None, first))
    pose, s = find_pose(gesturer().system.pose), gesturer().system.statistics
    last = poses_before(gesturer().system, first, SEEDS)[-1] * s.pose_std + s.pose_mean
    arms = [k for k, name in enumerate(pose.names) if "Arm" in name]
    gaps = [np.abs(pose.encode(motion[:1])[0] - last)[arms].max() for motion in (joint_motion, plain)]
    assert gaps[0] < 0.2 * gaps[1]
    speed = np.abs(np.diff(pose.encode(joint_motion), axis=0))[:, arms].max(1)
    assert speed[: round(fps / 2)].max() < 0.5 * gaps[1]


def test_pieces_and_takes_do_not_show():
    speech = talk(3.2)
    given = {"face": make_motion(1.2), "continue_from": make_motion(), **WHOLE}
    whole = gesturer().generate(speech, **given)
    for edges in ([1, 2, 7, 9000, 9001, 40_000], list(range(1600, 51_000, 1600))):
        assert same(Motion.concatenate(list(gesturer().stream(cut(speech, edges), **given))), whole)
    takes = gesturer().generate_takes(speech, takes=3, **(given | {"seed": 2}))
    assert same(takes[1], whole)
    assert away(takes[0], takes[2]) > 1e-4


def test_old_bundles_and_those_trained_without():
    for kind in ({"faces": False, "seeds": 0}, {"faces": False}, {"seeds": 0}):
        player = gesturer(**kind)
        if not kind.get("faces", True):
            with pytest.raises(InputError, match="does not take a face"):
                player.session(face=make_motion(), **WHOLE)
        if not kind.get("seeds", True):
            with pytest.raises(InputError, match="continue from"):
                player.session(continue_from=make_motion(), **WHOLE)
        assert len(player.generate(talk(1.0), **WHOLE)) == 30
    signature = gesturer(faces=False, seeds=0).system.main_network.signature
    assert not {"face", "seed"} & set(signature.inputs)
    assert signature.seeds == 0


@pytest.mark.parametrize("option", ["face", "continue_from"])
def test_who_cannot_is_told(option, tmp_path):
    given, flow = {option: make_motion()}, TrainedModel.open(write_small(tmp_path / "flow.cospeech"))
    with pytest.raises(InputError, match="look_ahead=inf"):
        gesturer().session(**given)
    for player in (flow, RuleBasedModel()):
        with pytest.raises(InputError, match="does not take"):
            player.session(**given)
    for wrong in (7, tmp_path / "none.json", tmp_path, replace(make_motion(), face=None)[:0]):
        with pytest.raises(InputError, match=r"^[^\n]*$"):
            gesturer().session(**{option: wrong}, **WHOLE)
    with pytest.raises(InputError, match="has no face"):
        gesturer().session(face=replace(make_motion(), face=None), **WHOLE)


def test_files(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(generating, "load_model", lambda name: gesturer())
    speech = talk(2.0)
    sf.write("talk.wav", speech.samples, 16_000)
    make_motion().save("face.json")
    make_motion().save("before.bvh")
    generating.generate_files("talk.wav", ["a.npz"], face="face.json", continue_from="before.bvh", seed=3)
    generating.generate_files("talk.wav", ["plain.npz"], seed=3)
    motion, plain = Motion.load("a.npz"), Motion.load("plain.npz")
    assert away(motion, plain) > 1e-3
    times = np.arange(len(motion)) / 30
    np.testing.assert_allclose(motion.face, ConditioningFace(Motion.load("face.json")).at(times)[0], atol=1e-3)
    with pytest.raises(InputError, match="overwrite"):
        generating.generate_files("talk.wav", ["face.json"], face="face.json")
    with pytest.raises(InputError, match="overwrite"):
        generating.generate_files("talk.wav", ["before.bvh"], continue_from="before.bvh")
    assert len(ARKIT) == 52
    monkeypatch.setattr(generating, "load_model", lambda name: RuleBasedModel())
    with pytest.raises(InputError, match="does not take a face"):
        generating.generate_files("talk.wav", ["b.npz"], face="face.json")
