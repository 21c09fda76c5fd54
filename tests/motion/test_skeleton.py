"""Skeletons: what is refused, forward kinematics by hand, and the tables."""

from __future__ import annotations

from dataclasses import replace
from importlib import import_module

import numpy as np
import pytest

from cospeech.errors import InputError
from cospeech.motion.rotations import axis_angle_to_quat, quat_identity, quat_multiply, quat_rotate, rotvec_to_quat
from cospeech.motion.skeleton import Skeleton, find_skeleton, humanoid
from cospeech.motion.skeletons import SKELETONS
from cospeech.motion.skeletons.humanoid import HEIGHT, MIRROR
from cospeech.motion.skeletons.vrm import FROM_VRM0, REQUIRED


def test_forward_kinematics_by_hand():
    arm = Skeleton(("a", "b", "c"), (-1, 0, 1), np.array([[0, 1, 0], [1, 0, 0], [2, 0, 0]]))
    quarter = axis_angle_to_quat((0, 0, 1), np.pi / 2)
    rotations = np.stack([quarter, quarter, quat_identity()])
    positions, world = arm.forward(rotations, np.array([5.0, 0, 0]))
    assert np.allclose(positions, [[5, 0, 0], [5, 1, 0], [3, 1, 0]])
    assert np.allclose(np.abs(world[2]), [0, 0, 1, 0])


def test_forward_kinematics_turns_and_moves_with_its_root():
    rng, body = np.random.default_rng(0), humanoid()
    local = rotvec_to_quat(rng.normal(size=(7, 55, 3)))
    positions, world = body.forward(local, np.zeros((7, 3)))
    turn, shift = rotvec_to_quat(rng.normal(size=3)), np.array([1.0, 2, 3])
    rotations = local.copy()
    rotations[:, 0] = quat_multiply(turn, local[:, 0])
    points, world_too = body.forward(rotations, np.tile(shift, (7, 1)))
    assert np.allclose(points, quat_rotate(turn, positions) + shift, atol=1e-12)
    assert np.allclose(world_too, quat_multiply(turn, world), atol=1e-12)
    lengths = np.linalg.norm(positions[:, 1:] - positions[:, list(body.parents[1:])], axis=-1)
    assert np.allclose(lengths, np.linalg.norm(body.offsets[1:], axis=-1), atol=1e-12)


def test_forward_kinematics_of_one_frame_and_of_batches():
    body = humanoid()
    local = rotvec_to_quat(np.random.default_rng(1).normal(size=(2, 3, 55, 3)))
    positions, _ = body.forward(local, np.zeros((2, 3, 3)))
    assert positions.shape == (2, 3, 55, 3)
    assert np.allclose(body.forward(local[1, 2], np.zeros(3))[0], positions[1, 2])
    with pytest.raises(InputError, match="54"):
        body.forward(local[..., :54, :], np.zeros((2, 3, 3)))


@pytest.mark.parametrize(
    ("names", "parents", "count", "message"),
    [
        ((), (), 0, "0 names"),
        (("a", "a"), (-1, 0), 2, "repeat: a"),
        (("a", "b"), (-1, 1), 2, "parents stand before"),
        (("a", "b"), (-1, -1), 2, "one root"),
        (("a", "b"), (0, -1), 2, "one root"),
        (("a", "b"), (-1,), 2, "1 parents"),
        (("a", "b"), (-1, 0), 3, "offsets"),
    ],
)
def test_trees_that_are_none(names, parents, count, message):
    with pytest.raises(InputError, match=message):
        Skeleton(names, parents, np.zeros((count, 3)))


def test_equality_is_of_what_matters():
    assert humanoid() == replace(humanoid(), kind="other")
    assert humanoid() != find_skeleton("mixamo")
    assert humanoid() != replace(humanoid(), offsets=humanoid().offsets * 1.01)
    rest = humanoid().rest.copy()
    rest[3] = axis_angle_to_quat((1, 0, 0), 0.01)
    assert humanoid() != replace(humanoid(), rest=rest)
    assert humanoid() == replace(humanoid(), rest=-humanoid().rest)


def test_groups_of_the_humanoid_are_a_partition():
    body = humanoid()
    assert len(body.left_hand) == len(body.right_hand) == 15
    parts = [*body.left_hand, *body.right_hand, *body.lower_body, *body.upper_body]
    assert sorted(parts) == list(range(55))


def test_unknown_names_come_with_the_nearest():
    with pytest.raises(InputError, match=r"'Mixamo' \(did you mean 'mixamo'\? known: humanoid, .*unreal"):
        find_skeleton("Mixamo")
    with pytest.raises(InputError, match="known: humanoid"):
        find_skeleton("q")


@pytest.mark.parametrize("kind", SKELETONS)
def test_tables_are_people_in_a_t_pose(kind):
    body, table = find_skeleton(kind), import_module(SKELETONS[kind])
    names = table.NAMES
    assert body.kind == kind
    assert set(names) <= set(humanoid().names)
    assert set(names.values()) <= set(body.names)
    assert len(set(names.values())) == len(names)
    assert set(REQUIRED) <= set(names)
    at = {ours: body.tpose[body.index[theirs]] for ours, theirs in names.items()}
    for side, sign in (("left", 1), ("right", -1)):
        for a, b in (("UpperArm", "LowerArm"), ("LowerArm", "Hand"), ("Hand", "MiddleProximal")):
            bone = at[side + b] - at[side + a]
            assert sign * bone[0] > 0.99 * np.linalg.norm(bone)
        for a, b in (("UpperLeg", "LowerLeg"), ("LowerLeg", "Foot")):
            bone = at[side + b] - at[side + a]
            assert -bone[1] > 0.99 * np.linalg.norm(bone)
        assert at[f"{side}Toes"][2] > at[f"{side}Foot"][2] + 0.05
        assert sign * at[f"{side}ThumbDistal"][2] * sign > at[f"{side}MiddleDistal"][2] + 0.02
        for name in names:
            if name.startswith(side):
                assert sign * at[name][0] > 0 or "Shoulder" in name  # BEAT's collar bones start in the middle
    tips = [body.tpose[body.index[n]][1] + end[1] for n, end in body.ends.items()]
    lowest = min(body.tpose[:, 1].min(), *tips) if tips else body.tpose[:, 1].min()
    assert lowest == pytest.approx(0, abs=1e-4)
    assert 1.45 < body.tpose[:, 1].max() < HEIGHT + 0.01
    for name, below in zip(body.names, body.children, strict=True):
        assert below or not body.ends or name in body.ends, f"{name} has no tip"


@pytest.mark.parametrize(("kind", "count"), [("humanoid", 55), ("vrm", 55), ("mixamo", 65), ("beat", 75), ("smplx", 55)])
def test_tables_have_the_joints_of_their_make(kind, count):
    assert len(find_skeleton(kind)) == count


def test_smplx_is_in_the_order_of_the_model():
    """``parents`` of SMPL-X's kinematic tree, as published with the model."""
    tree = [-1, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 12, 13, 14, 16, 17, 18, 19, 15, 15, 15]
    tree += [
        20,
        25,
        26,
        20,
        28,
        29,
        20,
        31,
        32,
        20,
        34,
        35,
        20,
        37,
        38,
        21,
        40,
        41,
        21,
        43,
        44,
        21,
        46,
        47,
        21,
        49,
        50,
        21,
        52,
        53,
    ]
    assert list(find_skeleton("smplx").parents) == tree


def test_beat_is_what_is_published(shared_folder):
    import json

    table = json.loads((shared_folder / "data" / "beat_speaker2_skeleton.json").read_text())
    ours = find_skeleton("beat")
    joints = [n for n in table if not n.endswith("_Nub")]
    assert list(ours.names) == joints
    for k, name in enumerate(joints):
        parent = table[name]["parent"]
        assert (ours.names[ours.parents[k]] if ours.parents[k] >= 0 else None) == parent
        if k:
            assert np.allclose(ours.offsets[k] * 100, table[name]["offset"], atol=1e-3)


def test_vrm0_thumbs_are_one_off():
    assert FROM_VRM0["leftThumbProximal"] == "leftThumbMetacarpal"
    assert FROM_VRM0["rightThumbIntermediate"] == "rightThumbProximal"
    assert set(FROM_VRM0.values()) <= set(humanoid().names)


def test_humanoid_is_symmetric():
    body = humanoid()
    for name, other in MIRROR.items():
        assert np.allclose(body.tpose[body.index[name]] * (-1, 1, 1), body.tpose[body.index[other]])
        assert MIRROR[other] == name
