"""The skeleton of somebody's rig as the target: --skeleton my_rig.bvh, .glb or .vrm."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cospeech.audio.speech import example
from cospeech.convert import convert_file
from cospeech.errors import CospeechWarning, InputError
from cospeech.export import load, save
from cospeech.export.target_skeleton import find_target, rig_files
from cospeech.generate import generate_files
from cospeech.motion.bone_mapping import load_map, recognise
from cospeech.motion.rotations import axis_angle_to_quat, quat_rotate
from cospeech.motion.skeleton import Skeleton, find_skeleton, humanoid
from tests.support.motions import gesturing


@pytest.fixture
def rig(tmp_path):
    """A BVH of somebody smaller, with names of their own, whose floor is at 0.4 m."""
    body = humanoid()
    ends = {f"my:{name}": tuple(0.8 * np.array(end)) for name, end in body.ends.items()}
    small = replace(body, names=tuple(f"my:{n}" for n in body.names), offsets=0.8 * body.offsets, ends=ends, kind="custom")
    motion = gesturing(40)
    path = tmp_path / "my_rig.bvh"
    save(replace(motion, skeleton=small, root=0.8 * motion.root + (0.0, 0.05, 0.0)), path)
    return path


def test_a_rig_gives_its_skeleton(rig, tmp_path):
    skeleton = find_target(rig)
    assert skeleton.names[0] == "my:hips"
    assert skeleton.floor == 0
    assert find_target("mixamo") is find_skeleton("mixamo")
    assert find_target(skeleton) is skeleton
    assert (rig_files("mixamo"), rig_files(skeleton), rig_files(None), rig_files(rig)) == ((), (), (), (rig,))


def test_convert_brings_motion_to_a_rig(rig, tmp_path):
    save(gesturing(40), tmp_path / "a.bvh")
    there = convert_file(tmp_path / "a.bvh", tmp_path / "b.bvh", skeleton=rig)
    assert there.skeleton.names[0] == "my:hips"
    assert load(tmp_path / "b.bvh").skeleton.names == there.skeleton.names
    arms = []
    for motion, prefix in ((gesturing(40), ""), (there, "my:")):
        points, index = motion.positions(), motion.skeleton.index
        arms.append(points[:, index[f"{prefix}rightHand"]] - points[:, index[f"{prefix}rightUpperArm"]])
    assert np.allclose(arms[1], 0.8 * arms[0], atol=1e-3)


def test_a_character_gives_its_skeleton(tmp_path):
    save(gesturing(5), tmp_path / "character.glb")
    skeleton = find_target(tmp_path / "character.glb")
    assert isinstance(skeleton, Skeleton)
    assert set(recognise(skeleton)) >= {"hips", "head", "leftHand", "rightToes"}


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("miximo", "did you mean 'mixamo'"),
        ("rig.obj", ".bvh .glb .gltf .vrm .fbx"),
        ("nothing.fbx", "nothing.fbx"),
        ("nothing.bvh", "nothing.bvh"),
        ("nothing.glb", "nothing.glb"),
    ],
)
def test_what_is_no_rig_is_told(name, words):
    with pytest.raises(InputError, match=words):
        find_target(name)


def test_python_is_told_how_a_rig_is_named():
    with pytest.raises(InputError, match=r"unknown skeleton '13_01.bvh' \(of a file: .*find_target\('13_01.bvh'\)"):
        gesturing(2).retarget("13_01.bvh")


def test_a_rig_is_not_overwritten(rig, tmp_path):
    save(gesturing(5), tmp_path / "a.bvh")
    with pytest.raises(InputError, match="overwrite"):
        convert_file(tmp_path / "a.bvh", rig, skeleton=rig)


@pytest.fixture
def odd(tmp_path):
    """A BVH in which nothing is recognised, with legs and arms that nobody has, and a map of it."""
    body, names = humanoid(), {name: f"node_{k:02}" for k, name in enumerate(humanoid().names)}
    limbs = [f"limb_{leg}_{k}" for leg in range(4) for k in range(4)]
    above = [len(body) + k - 1 if k % 4 else 0 for k in range(len(limbs))]
    offsets = np.array([(0.2 * (-1) ** (k // 4), 0.3, 0.1 * (k // 8)) for k in range(len(limbs))])  # wings, two on each side
    ends = {**{names[n]: end for n, end in body.ends.items()}, **{f"limb_{leg}_3": (0.0, 0.0, 0.2) for leg in range(4)}}
    skeleton = Skeleton((*names.values(), *limbs), (*body.parents, *above), np.concatenate([body.offsets, offsets]), ends=ends)
    motion = gesturing(10)
    still = np.tile((0.0, 0.0, 0.0, 1.0), (10, len(limbs), 1))
    save(replace(motion, skeleton=skeleton, rotations=np.concatenate([motion.rotations, still], 1)), tmp_path / "odd.bvh")
    table = "\n".join(f'{ours} = "{theirs}"' for ours, theirs in names.items() if "Thumb" not in ours)
    (tmp_path / "odd.toml").write_text(f"[bones]\n{table}\n")
    return tmp_path / "odd.bvh", tmp_path / "odd.toml"


def test_a_map_gives_the_joints_of_a_rig_our_names(odd, tmp_path):
    rig, names = odd
    save(gesturing(10), tmp_path / "a.bvh")
    with pytest.raises(InputError, match="cannot find"):
        convert_file(tmp_path / "a.bvh", tmp_path / "b.bvh", skeleton=rig)
    there = convert_file(tmp_path / "a.bvh", tmp_path / "b.bvh", skeleton=rig, names=names)
    arms = []
    for motion, names_there in ((gesturing(10), {}), (there, load_map(names))):
        hand, arm = (motion.skeleton.index[names_there.get(name, name)] for name in ("leftHand", "leftUpperArm"))
        arms.append(motion.positions()[:, hand] - motion.positions()[:, arm])
    assert np.allclose(*arms, atol=1e-3)
    sound, words = example()
    report = generate_files(sound, [tmp_path / "c.bvh"], transcript=words, skeleton=rig, bone_map=names)
    assert load(tmp_path / "c.bvh").skeleton.names[:2] == ("node_00", "node_01")
    assert len(load(tmp_path / "c.bvh")) == report.frames
    with pytest.warns(CospeechWarning, match="the map changes nothing"):
        generate_files(sound, [tmp_path / "d.bvh"], bone_map=names)


def test_a_map_tells_the_reader_unit_and_t_pose(odd, tmp_path):
    """A rig in metres whose zero pose has hanging arms: without a map it is a doll of centimetres that stands in that pose."""
    rig, names = odd
    table, plain = load_map(names), load(rig)
    offsets, above = 0.01 * plain.skeleton.offsets, plain.skeleton.parents  # a writer's numbers are centimetres
    for side, sign in (("left", -1), ("right", 1)):
        arm = {plain.skeleton.index[table[f"{side}UpperArm"]]}
        for joint in range(len(offsets)):
            if above[joint] in arm:
                arm.add(joint)
                offsets[joint] = quat_rotate(axis_angle_to_quat((0, 0, 1), sign * 1.2), offsets[joint])
    doll = Skeleton(plain.skeleton.names, above, offsets, ends={k: (0, 0, 0.001) for k in plain.skeleton.ends})
    save(replace(plain, skeleton=doll), tmp_path / "m.bvh")
    assert load(tmp_path / "m.bvh").skeleton.tpose[:, 1].max() < 0.1
    skeleton = load(tmp_path / "m.bvh", bone_map=table).skeleton
    assert skeleton.tpose[:, 1].max() > 1.4
    arm, hand = (skeleton.tpose[skeleton.index[table[name]]] for name in ("leftUpperArm", "leftHand"))
    assert abs(hand[1] - arm[1]) < 0.02
    assert hand[0] > arm[0] + 0.3
    with pytest.raises(InputError, match="cannot find head"):
        load(tmp_path / "m.bvh", bone_map={"hips": "node_00"})
