"""T-poses of files whose zero pose says nothing about the turn of a bone about itself, and the floor under them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cospeech.export import load, save
from cospeech.motion.bone_mapping import recognise
from cospeech.motion.motion import Motion
from cospeech.motion.rest_calibration import calibrate_rest
from cospeech.motion.rotations import (
    axis_angle_to_quat,
    quat_angle,
    quat_between,
    quat_conjugate,
    quat_identity,
    quat_multiply,
    quat_rotate,
)
from cospeech.motion.skeleton import Skeleton, humanoid
from cospeech.motion.soles import find_soles
from cospeech.motion.tpose import directions, on_floor
from tests.support.motions import gesturing

TRUNK = ("hips", "spine", "chest", "upperChest", "neck", "head", "leftShoulder", "rightShoulder")
LEGS = [side + part for side in ("left", "right") for part in ("UpperLeg", "LowerLeg", "Foot", "Toes")]


def along_x(seed: int) -> Skeleton:
    """Our body as some exporters have it: every bone lies along X in its own axes, turned about itself by chance."""
    body, rng = humanoid(), np.random.default_rng(seed)
    along = directions(body, {name: name for name in body.names})
    bones = [along.get(name, np.array([0.0, 1, 0])) for name in body.names]
    axes = np.array([quat_between(np.array([1.0, 0, 0]), bone / np.linalg.norm(bone)) for bone in bones])
    axes = quat_multiply(axes, axis_angle_to_quat((1.0, 0, 0), rng.uniform(-np.pi, np.pi, len(axes))))
    above = quat_conjugate(axes[[max(p, 0) for p in body.parents]])
    above[0] = quat_identity()
    ends = {name: tuple(quat_rotate(quat_conjugate(axes[body.index[name]]), np.array(e))) for name, e in body.ends.items()}
    return replace(
        body, offsets=quat_rotate(above, body.offsets), rest=quat_multiply(above, axes), ends=ends, kind="custom"
    )  # fmt: skip


def rename(motion: Motion) -> Motion:
    """The same skeleton, with names that no table has, and without a statement about its zero pose."""
    body = motion.skeleton
    ends = {f"my:{name}": end for name, end in body.ends.items()}
    other = replace(body, names=tuple(f"my:{name}" for name in body.names), ends=ends, rest=None)
    return replace(motion, skeleton=other)


def turn_between(a: Motion, b: Motion, joint: str) -> float:
    """Degrees on the average between a joint's world rotations of two motions of our humanoid."""
    worlds = [humanoid().forward(m.rotations, m.root)[1][:, humanoid().index[joint]] for m in (a, b)]
    return float(np.degrees(quat_angle(*worlds)).mean())


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_turns_of_bones_are_told_from_the_motion(tmp_path, seed):
    motion = gesturing(120)
    save(rename(motion.retarget(along_x(seed))), tmp_path / "x.bvh")
    back = load(tmp_path / "x.bvh").retarget("humanoid")
    assert (
        max(turn_between(motion, back, joint) for joint in (*TRUNK, *LEGS)) < 20
    )  # what the motion itself turns on the average
    assert turn_between(motion, back, "rightUpperArm") < 20  # its elbow bends; the left one does not, and tells nothing


def test_a_tpose_that_fits_is_kept(tmp_path):
    motion = gesturing(120)
    save(rename(motion), tmp_path / "x.bvh")
    read = load(tmp_path / "x.bvh")
    assert read.skeleton.kind == "custom"
    assert np.abs(np.sum(read.skeleton.rest * humanoid().rest, -1)).min() > 1 - 1e-9


def test_a_thumb_is_set_right_with_its_hand():
    body, rest = humanoid(), humanoid().rest.copy()
    rest[body.index["leftHand"]] = axis_angle_to_quat((1.0, 0, 0), np.radians(120))
    twist = replace(body, rest=rest, kind="custom")
    right = calibrate_rest(twist, {name: name for name in body.names}, gesturing(120).rotations)
    for joint in ("leftHand", "leftThumbMetacarpal", "leftThumbDistal"):
        off = quat_angle(right.rest[body.index[joint]], body.rest[body.index[joint]])
        assert np.degrees(off) < 25, joint  # what the motion itself turns on the average


@pytest.mark.slow
def test_a_short_motion_keeps_the_zero_pose(tmp_path):
    motion = gesturing(120)
    save(rename(motion.retarget(along_x(0)))[:20], tmp_path / "short.bvh")
    save(rename(motion.retarget(along_x(0))), tmp_path / "long.bvh")
    rests = [load(tmp_path / name).skeleton.rest for name in ("short.bvh", "long.bvh")]
    assert not np.allclose(*rests)


def test_feet_that_hover_are_put_on_the_floor(tmp_path):
    motion = gesturing(120)
    high = replace(motion, root=motion.root + (0.0, 0.06, 0.0))
    save(rename(high), tmp_path / "high.bvh")
    read = load(tmp_path / "high.bvh")
    assert np.allclose(read.root, high.root, atol=1e-5)  # nothing of the file is changed …
    there = read.retarget("humanoid")  # … but what is made of it stands
    assert abs(np.percentile(heights(there), 5)) < 0.01
    assert np.percentile(heights(there.retarget(read.skeleton)), 5) == pytest.approx(0.06, abs=0.01)


def heights(motion: Motion) -> np.ndarray:
    soles = find_soles(motion.skeleton, recognise(motion.skeleton))
    return soles.heights(*motion.skeleton.forward(motion.rotations, motion.root))


def test_soles_are_as_high_on_longer_shins():
    body = humanoid()
    offsets = body.offsets.copy()
    for side in ("left", "right"):
        offsets[body.index[f"{side}Foot"], 1] *= 1.25
        offsets[body.index[f"{side}LowerLeg"], 1] *= 0.9
    tall = replace(body, offsets=offsets, kind="custom")
    motion = gesturing(120)
    crouch = motion.rotations.copy()
    for part, angle in (("UpperLeg", -0.7), ("LowerLeg", 1.2), ("Foot", -0.5)):
        for side in ("left", "right"):
            crouch[:, body.index[side + part]] = axis_angle_to_quat((1.0, 0, 0), angle)
    motion = replace(motion, rotations=crouch)
    motion = replace(motion, root=motion.root - np.outer(heights(motion), (0, 1, 0)))
    assert np.abs(heights(motion)).max() < 1e-9
    there = motion.retarget(on_floor(tall, 0, 0.25))
    assert np.abs(heights(there) - 0.25).max() < 1e-9


def test_heads_of_poser_files_are_heads(shared_folder):
    """An eye is no head: files with ``lShldr`` and eyes were read with the head turned by a right angle."""
    motion = load(shared_folder / "data" / "mocap_cmu" / "14_04.bvh")
    assert recognise(motion.skeleton)["head"] == "head"


def test_other_peoples_files_face_where_they_go(shared_folder):
    """The head faces as the shoulders do on the average, and the chest carries them."""
    for path in sorted((Path(shared_folder) / "data" / "bvh").glob("*.bvh")) + [
        shared_folder / "data" / "mocap_cmu" / "13_01.bvh"
    ]:
        try:
            motion = load(path)
            there = motion.retarget("humanoid")
        except ValueError:
            continue
        if len(there) < 30:
            continue
        points, world = there.skeleton.forward(there.rotations, there.root)
        at = {name: points[:, there.skeleton.index[name]] for name in ("leftUpperArm", "rightUpperArm")}
        shoulders = at["leftUpperArm"] - at["rightUpperArm"]
        shoulders /= np.linalg.norm(shoulders, axis=-1, keepdims=True)
        for joint, most in (("upperChest", 25), ("head", 50)):
            left = quat_rotate(world[:, there.skeleton.index[joint]], np.array([1.0, 0, 0]))
            angle = np.degrees(np.arccos(np.clip(np.sum(left * shoulders, -1), -1, 1)))
            assert np.median(angle) < most, (path.name, joint)
