"""Retargeting: who is who in skeletons of many makes, and motion that means the same on another body."""

from __future__ import annotations

import re
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cospeech.errors import InputError
from cospeech.motion.bone_mapping import by_names, load_map, recognise
from cospeech.motion.bone_mapping_by_shape import by_shape
from cospeech.motion.motion import Motion
from cospeech.motion.retarget import retarget
from cospeech.motion.rotations import (
    axis_angle_to_quat,
    quat_angle,
    quat_continuous,
    quat_identity,
    quat_multiply,
    quat_rotate,
    rotvec_to_quat,
)
from cospeech.motion.skeleton import Skeleton, find_skeleton, humanoid
from cospeech.motion.skeletons import SKELETONS
from cospeech.motion.soles import find_soles
from tests.support.skeletons import rename_joints, without

BONES = [("UpperArm", "LowerArm"), ("LowerArm", "Hand"), ("UpperLeg", "LowerLeg"), ("LowerLeg", "Foot"),
         ("Hand", "MiddleProximal"), ("IndexProximal", "IndexIntermediate"), ("LittleIntermediate", "LittleDistal"),
         ("ThumbProximal", "ThumbDistal")]  # fmt: skip
ALL_BONES = [*BONES, ("Shoulder", "UpperArm"), ("Foot", "Toes"), ("RingProximal", "RingIntermediate")]


def wild(frames: int = 60, seed: int = 0, amount: float = 0.05) -> Motion:
    rng = np.random.default_rng(seed)
    rotations = rotvec_to_quat(np.cumsum(rng.normal(0, amount, (frames, 55, 3)), 0))
    root = np.cumsum(rng.normal(0, 0.02, (frames, 3)), 0) + (0, 0.95, 0)
    face = rng.uniform(size=(frames, 52))
    return Motion(fps=30, rotations=quat_continuous(rotations), root=root, face=face, start=2.5)


def bone_directions(motion: Motion, bones: list[tuple[str, str]] = ALL_BONES) -> dict[str, np.ndarray]:
    """Unit vectors (T, 3) by ``leftUpperArm`` …, of those bones that the skeleton has."""
    names, positions = recognise(motion.skeleton), motion.positions()
    units = {}
    for side in ("left", "right"):
        for a, b in bones:
            if {side + a, side + b} <= set(names):
                at = [positions[:, motion.skeleton.index[names[side + n]]] for n in (a, b)]
                bone = at[1] - at[0]
                units[side + a] = bone / np.linalg.norm(bone, axis=-1, keepdims=True)
    return units


def degrees_apart(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.degrees(2 * np.arcsin(np.clip(np.linalg.norm(a - b, axis=-1) / 2, 0, 1))).max())


# --- motion


def test_to_itself_is_exact():
    motion = wild()
    assert retarget(motion, "humanoid") is motion
    again = motion.retarget(replace(humanoid(), kind="custom"))
    assert np.array_equal(again.rotations, motion.rotations)


@pytest.mark.parametrize("kind", SKELETONS)
def test_there_and_back_is_the_same_motion(kind):
    motion = wild()
    there = motion.retarget(kind)
    assert there.skeleton.kind == kind or there is motion or kind == "vrm"
    back = there.retarget("humanoid")
    ours, again = bone_directions(motion), bone_directions(back)
    assert set(ours) == set(again)
    for name in ours:
        assert degrees_apart(ours[name], again[name]) < 0.01, name
    columns = [k for k, n in enumerate(humanoid().names) if n in recognise(find_skeleton(kind))]
    world = [humanoid().forward(m.rotations, m.root)[1][:, columns] for m in (motion, back)]
    assert np.degrees(quat_angle(*world)).max() < 0.01  # twists too
    assert np.abs(back.root - motion.root).max() < 1e-9
    assert np.array_equal(back.face, motion.face)
    assert (back.start, back.fps) == (motion.start, motion.fps)


@pytest.mark.parametrize("kind", SKELETONS)
def test_bones_point_where_the_sources_point(kind):
    motion = wild(seed=3)
    there = motion.retarget(kind)
    theirs = bone_directions(there, BONES)
    for name, direction in bone_directions(motion, BONES).items():
        assert degrees_apart(direction, theirs[name]) < 0.01, name


@pytest.mark.parametrize("source", ["beat", "unreal", "smplx"])
@pytest.mark.parametrize("goal", ["mixamo", "beat", "unreal"])
def test_from_any_to_any(source, goal):
    motion = wild(seed=5).retarget(source)
    direct = motion.retarget(goal).retarget("humanoid")
    through = motion.retarget("humanoid")
    assert np.abs(direct.positions() - through.positions()).max() < 1e-6


@pytest.mark.slow
def test_the_t_pose_stays_the_t_pose():
    for source in SKELETONS:
        body = find_skeleton(source)
        still = Motion(fps=30, rotations=body.rest[None], root=body.offsets[:1], skeleton=body)
        for goal in SKELETONS:
            there = still.retarget(goal)
            arm = [n for n in recognise(there.skeleton) if re.search("Arm|Hand$|Leg", n)]
            names = recognise(there.skeleton)
            joints = [there.skeleton.index[names[n]] for n in arm]
            assert np.abs(there.positions()[0, joints] - there.skeleton.tpose[joints]).max() < 0.03
            assert np.abs(there.root[0] - there.skeleton.offsets[0]).max() < 1e-3  # legs of another build tilt a little …
            heights = find_soles(there.skeleton, names).heights(*there.skeleton.forward(there.rotations, there.root))
            assert abs(heights[0]) < 1e-6  # … and the soles stay on the floor


def test_left_stays_left():
    body = humanoid()
    rotations = quat_identity(1, 55)
    rotations[:, body.index["leftUpperArm"]] = axis_angle_to_quat((0, 0, 1), np.radians(60))  # the left arm goes up
    motion = Motion(fps=30, rotations=rotations, root=body.offsets[:1])
    for kind in SKELETONS:
        there = motion.retarget(kind)
        names, at = recognise(there.skeleton), there.positions()[0]
        hands = {side: at[there.skeleton.index[names[f"{side}Hand"]]] for side in ("left", "right")}
        assert hands["left"][1] > hands["right"][1] + 0.3
        assert hands["left"][0] > 0.2
        assert hands["right"][0] < -0.5


def test_feet_stay_on_the_floor_of_a_small_body():
    motion = wild(amount=0.01)
    ends = {name: tuple(0.6 * np.array(end)) for name, end in humanoid().ends.items()}
    child = replace(humanoid(), offsets=humanoid().offsets * 0.6, ends=ends, kind="custom")
    there = motion.retarget(child)
    assert np.allclose(there.positions(), motion.positions() * 0.6, atol=1e-9)
    in_metres = motion.retarget(child, scale_root=False)
    assert np.allclose(np.diff(in_metres.root, axis=0), np.diff(motion.root, axis=0), atol=1e-12)
    assert np.allclose(in_metres.root[:, 1] - motion.root[:, 1], 0.955 * (0.6 - 1), atol=1e-9)


def test_a_hand_that_is_modelled_spread_is_at_ease():
    ours = humanoid()
    offsets = np.array(ours.offsets)
    for side, sign in (("left", -1), ("right", 1)):
        for finger, angle in {"Index": 15, "Middle": 2, "Ring": -18, "Little": -39}.items():
            turn = axis_angle_to_quat(np.array([0.0, 1.0, 0.0]), sign * np.radians(angle))
            for part in ("Intermediate", "Distal"):
                joint = ours.index[side + finger + part]
                offsets[joint] = quat_rotate(turn, offsets[joint])
    spread = replace(ours, offsets=offsets, kind="other")
    still = Motion(fps=30, rotations=np.tile(spread.rest, (2, 1, 1)), root=np.tile(offsets[0], (2, 1)), skeleton=spread)
    there = still.retarget("humanoid")
    bones = bone_directions(there, [("IndexProximal", "IndexIntermediate"), ("LittleIntermediate", "LittleDistal")])
    for side in ("left", "right"):
        assert degrees_apart(bones[side + "IndexProximal"], bones[side + "LittleIntermediate"]) == pytest.approx(15, abs=0.1)
    assert np.degrees(quat_angle(there.retarget(spread).rotations, still.rotations)).max() < 0.01


def test_a_finger_without_length_says_nothing():
    ours, stub = humanoid(), "leftLittleProximal"
    source = without(replace(ours, ends={**ours.ends, stub: (0.0, 0.0, 0.0)}), "leftLittle(Intermediate|Distal)")
    rotations = quat_identity(2, len(source))
    for joint in (stub, "leftRingProximal"):
        rotations[1, source.index[joint]] = axis_angle_to_quat(np.array([1.0, 0.0, 0.0]), np.radians(120))
    there = Motion(fps=30, rotations=rotations, root=np.tile(ours.offsets[0], (2, 1)), skeleton=source).retarget("humanoid")
    degrees = np.degrees(quat_angle(there.rotations[1], there.rotations[0]))
    assert degrees[ours.index[stub]] == pytest.approx(0, abs=1e-3)
    assert degrees[ours.index["leftRingProximal"]] == pytest.approx(120)


def test_a_fingertip_on_the_wrong_side_of_its_joint_does_not_fold_the_finger():
    ours = humanoid()
    ends = {name: tuple(-np.array(end)) if name.endswith("IndexDistal") else end for name, end in ours.ends.items()}
    source = replace(ours, offsets=ours.offsets * 1.1, ends=ends)
    still = Motion(fps=30, rotations=np.tile(ours.rest, (2, 1, 1)), root=np.tile(ours.offsets[0], (2, 1)), skeleton=source)
    assert np.degrees(quat_angle(still.retarget("humanoid").rotations, still.rotations)).max() < 0.01


def with_axes(skeleton: Skeleton, seed: int = 1) -> Skeleton:
    """The same body, the axes of its bones lying anyhow: only ``rest`` tells the T-pose."""
    frames = rotvec_to_quat(np.random.default_rng(seed).normal(0, 2, (len(skeleton), 3)))
    above = frames[[max(p, 0) for p in skeleton.parents]] * (-1, -1, -1, 1)
    above[0] = (0, 0, 0, 1)
    ends = {n: tuple(quat_rotate(frames[skeleton.index[n]] * (-1, -1, -1, 1), np.array(e))) for n, e in skeleton.ends.items()}
    return replace(skeleton, offsets=quat_rotate(above, skeleton.offsets), rest=quat_multiply(above, frames), ends=ends)


def test_axes_of_bones_do_not_matter():
    motion, odd = wild(), with_axes(humanoid())
    there = motion.retarget(odd)
    assert np.allclose(there.positions(), motion.positions(), atol=1e-9)
    assert np.allclose(there.retarget("humanoid").positions(), motion.positions(), atol=1e-9)


def test_a_root_that_is_not_the_hips():
    body = find_skeleton("mixamo")
    rig = Skeleton(
        ("Armature", *body.names),
        (-1, *(p + 1 for p in body.parents)),
        np.concatenate([np.zeros((1, 3)), body.offsets]),
        kind="custom",
    )
    motion = wild()
    there = motion.retarget(rig)
    assert np.allclose(there.positions()[:, 1:], motion.retarget("mixamo").positions(), atol=1e-9)
    assert np.allclose(there.retarget("humanoid").positions(), motion.positions(), atol=1e-9)


@pytest.mark.parametrize(
    "pattern",
    [
        "(left|right)Shoulder",
        "chest|upperChest",
        "chest",
        "neck",
        "jaw|.*Eye",
        ".*Distal",
        ".*(Thumb|Index|Middle|Ring|Little).*",
        "(left|right)(Hand|Foot|Toes|Thumb.*|Index.*|Middle.*|Ring.*|Little.*)",
        "spine|chest|upperChest",
    ],
)  # fmt: skip
def test_missing_bones_are_absorbed(pattern):
    motion, less = wild(amount=0.02), without(humanoid(), pattern)
    assert len(less) < 55
    there = motion.retarget(less)
    theirs = bone_directions(there, BONES)
    assert len(theirs) >= 4
    for name, direction in bone_directions(motion, BONES).items():
        assert name not in theirs or degrees_apart(direction, theirs[name]) < 0.01, name
    back = there.retarget("humanoid")
    again = bone_directions(back, BONES)
    for name, direction in bone_directions(there, BONES).items():
        assert degrees_apart(direction, again[name]) < 0.01, name


def test_bends_are_spread_over_more_spine_bones():
    body = humanoid()
    rotations = quat_identity(1, 55)
    for name, angle in (("spine", 20), ("chest", 10), ("upperChest", 30), ("neck", 20), ("head", 20)):
        rotations[:, body.index[name]] = axis_angle_to_quat((1, 0, 0), np.radians(angle))
    there = Motion(fps=30, rotations=rotations, root=body.offsets[:1]).retarget("unreal")
    world = there.skeleton.forward(there.rotations, there.root)[1][0]

    def bend(name: str) -> float:
        return float(np.degrees(Rotation.from_quat(world[there.skeleton.index[name]]).as_rotvec()[0]))

    expected = {"pelvis": 0, "spine_01": 20, "spine_02": 25, "spine_03": 30, "spine_04": 45, "spine_05": 60, "neck_01": 80}
    assert {name: round(bend(name), 6) for name in expected} == expected
    assert bend("neck_02") == pytest.approx(90)
    assert bend("head") == pytest.approx(100)


def test_pieces_are_retargeted_as_the_whole_is():
    motion = wild(50)
    whole = motion.retarget("beat")
    pieces = [motion[a : a + 7].retarget("beat") for a in range(0, 50, 7)]
    motion_of_pieces = Motion.concatenate(pieces)
    assert np.allclose(motion_of_pieces.rotations, whole.rotations, atol=1e-12)
    assert np.allclose(motion_of_pieces.root, whole.root)
    assert pieces[2].start == pytest.approx(motion.start + 14 / 30)


def test_types_are_kept_and_signs_are_continuous():
    motion = wild()
    small = replace(motion, rotations=motion.rotations.astype(np.float32), root=motion.root.astype(np.float32))
    there = small.retarget("mixamo")
    assert there.rotations.dtype == there.root.dtype == np.float32
    assert (np.sum(there.rotations[1:] * there.rotations[:-1], -1) > 0).all()
    assert np.allclose(np.linalg.norm(there.rotations, axis=-1), 1, atol=1e-6)
    assert len(motion[:0].retarget("mixamo")) == 0


def test_it_is_fast():
    """Wanted ≤ 2 ms per second of motion; the bound is larger, for slow machines."""
    motion = wild(900)
    motion.retarget("mixamo")
    start = time.process_time()
    motion.retarget("mixamo")
    assert time.process_time() - start < 30 * 0.006


# --- files of others


def test_files_of_others_on_our_body(shared_folder):
    files = sorted((shared_folder / "data" / "bvh").glob("*.bvh"))
    count = 0
    for path in files:
        motion = Motion.load(path)
        if path.name in ("fairmotion_sinusoidal.bvh", "pybvh_tests_fixtures_rotation_first_root.bvh"):
            with pytest.raises(InputError, match=r"cannot find .*--map"):
                motion.retarget("humanoid")
            continue
        ours = motion.retarget("humanoid")
        count += 1
        theirs = bone_directions(motion, BONES[:4])
        assert len(theirs) == 8, path.name
        for name, direction in bone_directions(ours, BONES[:4]).items():
            assert degrees_apart(direction, theirs[name]) < 0.1, (path.name, name)
        names, at = recognise(motion.skeleton), motion.positions()
        across = {}
        for body, where, who in (
            (motion.skeleton, at, names),
            (humanoid(), ours.positions(), {n: n for n in humanoid().names}),
        ):
            pair = [where[:, body.index[who[f"{side}UpperLeg"]]] for side in ("left", "right")]
            across[len(across)] = (pair[0] - pair[1]) / np.linalg.norm(pair[0] - pair[1], axis=-1, keepdims=True)
        assert degrees_apart(across[0], across[1]) < 20, path.name  # hips face the same way
        if len(motion) > 10:
            soles = find_soles(humanoid(), {n: n for n in humanoid().names})
            low = soles.heights(*humanoid().forward(ours.rotations, ours.root))
            assert abs(np.quantile(low, 0.05)) < 0.01, path.name  # what stands, stands on the floor
    assert count == 12


# --- who is who


def pair(left: str, right: str, parts: dict[str, str]) -> dict[str, str]:
    """Names of both sides: ``{}`` in ``left`` and ``right`` stands for the part."""
    return {s + ours: mark.format(part) for s, mark in (("left", left), ("right", right)) for ours, part in parts.items()}


FINGERS = {"Index": "Index", "Middle": "Middle", "Ring": "Ring", "Little": "Pinky"}
FINGERS_123 = {f"{f}{p}": f"{name}{k}" for f, name in FINGERS.items()
               for k, p in enumerate(("Proximal", "Intermediate", "Distal"), 1)}  # fmt: skip
THUMB_123 = {f"Thumb{p}": f"Thumb{k}" for k, p in enumerate(("Metacarpal", "Proximal", "Distal"), 1)}
CONVENTIONS = {
    "3ds Max Biped": {"hips": "Bip01 Pelvis", "spine": "Bip01 Spine", "chest": "Bip01 Spine1", "upperChest": "Bip01 Spine2",
                      "neck": "Bip01 Neck", "head": "Bip01 Head"}
    | pair("Bip01 L {}", "Bip01 R {}", {"Shoulder": "Clavicle", "UpperArm": "UpperArm", "LowerArm": "Forearm", "Hand": "Hand",
            "UpperLeg": "Thigh", "LowerLeg": "Calf", "Foot": "Foot", "Toes": "Toe0",
            **{f"{f}{p}": f"Finger{i}{k}" for i, f in enumerate(("Thumb", "Index", "Middle", "Ring", "Little"))
               for k, p in zip(("", "1", "2"), ("Metacarpal", "Proximal", "Distal") if i == 0 else
                               ("Proximal", "Intermediate", "Distal"), strict=True)}}),
    "VRoid": {"hips": "J_Bip_C_Hips", "spine": "J_Bip_C_Spine", "chest": "J_Bip_C_Chest", "upperChest": "J_Bip_C_UpperChest",
              "neck": "J_Bip_C_Neck", "head": "J_Bip_C_Head", "leftEye": "J_Adj_L_FaceEye", "rightEye": "J_Adj_R_FaceEye"}
    | pair("J_Bip_L_{}", "J_Bip_R_{}", {"Shoulder": "Shoulder", "UpperArm": "UpperArm", "LowerArm": "LowerArm", "Hand": "Hand",
            "UpperLeg": "UpperLeg", "LowerLeg": "LowerLeg", "Foot": "Foot", "Toes": "ToeBase",
            **{k: v.replace("Pinky", "Little") for k, v in (FINGERS_123 | THUMB_123).items()}}),
    "Rigify": {"hips": "DEF-spine", "spine": "DEF-spine.001", "chest": "DEF-spine.002", "upperChest": "DEF-spine.003",
               "neck": "DEF-spine.004", "head": "DEF-spine.006"}
    | pair("DEF-{}.L", "DEF-{}.R", {"Shoulder": "shoulder", "UpperArm": "upper_arm", "LowerArm": "forearm", "Hand": "hand",
            "UpperLeg": "thigh", "LowerLeg": "shin", "Foot": "foot", "Toes": "toe", "ThumbMetacarpal": "thumb.01",
            "ThumbProximal": "thumb.02", "ThumbDistal": "thumb.03",
            **{f"{f}{p}": f"f_{f.lower().replace('little', 'pinky')}.0{k}" for f in ("Index", "Middle", "Ring", "Little")
               for k, p in enumerate(("Proximal", "Intermediate", "Distal"), 1)}}),
    "KayKit": {"hips": "hips", "spine": "spine", "upperChest": "chest", "head": "head"}
    | pair("{}.l", "{}.r", {"UpperArm": "upperarm", "LowerArm": "lowerarm", "Hand": "wrist", "UpperLeg": "upperleg",
            "LowerLeg": "lowerleg", "Foot": "foot", "Toes": "toes"}),
    "avatars with an armature's suffix": {"hips": "hips_Armature", "spine": "spine_Armature", "neck": "neck_Armature",
                                          "head": "head_Armature"}
    | pair("{}.l_Armature", "{}.r_Armature", {"Shoulder": "shoulder", "UpperArm": "upper_arm", "LowerArm": "lower_arm",
            "Hand": "hand", "UpperLeg": "upper_leg", "LowerLeg": "lower_leg", "Foot": "foot", "Toes": "toes"}),
    "Acclaim": {"hips": "root", "spine": "lowerback", "chest": "upperback", "upperChest": "thorax", "neck": "lowerneck",
                "head": "head"}
    | pair("l{}", "r{}", {"Shoulder": "clavicle", "UpperArm": "humerus", "LowerArm": "radius", "Hand": "wrist",
            "UpperLeg": "femur", "LowerLeg": "tibia", "Foot": "foot", "Toes": "toes"}),
    "joints instead of bones": {"hips": "Hips", "spine": "Chest", "neck": "Neck", "head": "Head"}
    | pair("Left{}", "Right{}", {"Shoulder": "Collar", "UpperArm": "Shoulder", "LowerArm": "Elbow", "Hand": "Wrist",
            "UpperLeg": "Hip", "LowerLeg": "Knee", "Foot": "Ankle", "Toes": "Toe"}),
    "Mixamo without its prefix": {"hips": "Hips", "spine": "Spine", "chest": "Spine1", "upperChest": "Spine2", "neck": "Neck",
                                  "head": "Head", "leftEye": "LeftEye", "rightEye": "RightEye"}
    | pair("Left{}", "Right{}", {"Shoulder": "Shoulder", "UpperArm": "Arm", "LowerArm": "ForeArm", "Hand": "Hand",
            "UpperLeg": "UpLeg", "LowerLeg": "Leg", "Foot": "Foot", "Toes": "ToeBase",
            **{k: f"Hand{v}" for k, v in (FINGERS_123 | THUMB_123).items()}}),
    "capitals": {n: re.sub(r"(?<=[a-z])(?=[A-Z])", "_", n).upper() for n in humanoid().names},
    "small letters": {n: n.lower() for n in humanoid().names if not re.search("Metacarpal|Proximal|Intermediate|Distal", n)},
    "sides at the end": {n: n for n in ("hips", "spine", "chest", "upperChest", "neck", "head")}
    | pair("{}-Left", "{}-Right", {"Shoulder": "Clavicle", "UpperArm": "Upper-Arm", "LowerArm": "Fore-Arm", "Hand": "Hand",
            "UpperLeg": "Upper-Leg", "LowerLeg": "Lower-Leg", "Foot": "Foot", "Toes": "Toes"}),
}  # fmt: skip


@pytest.mark.parametrize("make", CONVENTIONS)
def test_names_of_many_makes(make):
    names = CONVENTIONS[make]
    absent = "|".join(n for n in humanoid().names if n not in names)
    body = without(humanoid(), absent) if absent else humanoid()
    bones = recognise(rename_joints(body, names))
    expected = {n: names[n] for n in body.names}
    if "chest" not in names and "upperChest" in names:  # two bones of spine are called spine and chest
        expected["chest"] = expected.pop("upperChest")
    assert bones == expected


def test_bones_on_the_way_do_not_disturb():
    """Twist bones, helpers, tips, IK targets and a mesh's root among the rest."""
    body = find_skeleton("unreal")
    names, parents, offsets = list(body.names), list(body.parents), list(body.offsets)
    extra = [("upperarm_twist_01_l", "upperarm_l"), ("lowerarm_twist_02_l", "lowerarm_l"), ("thigh_twist_01_r", "thigh_r"),
             ("ik_hand_l", "pelvis"), ("ik_foot_l", "pelvis"), ("hand_l_end", "hand_l"), ("head_end", "head"),
             ("calf_twist_02_l", "calf_l"), ("upperarm_correctiveRoot_r", "upperarm_r")]  # fmt: skip
    for name, above in extra:
        names.append(name)
        parents.append(body.index[above])
        offsets.append(np.array([0.01, 0.02, 0.03]))
    more = Skeleton(tuple(names), tuple(parents), np.array(offsets), ends=body.ends)
    assert recognise(more) == recognise(body)
    motion = wild()
    there = motion.retarget(more)
    assert np.allclose(there.positions()[:, : len(body)], motion.retarget("unreal").positions(), atol=1e-9)
    assert np.array_equal(there.rotations[:, len(body) :], np.broadcast_to(more.rest[len(body) :], (60, len(extra), 4)))


@pytest.mark.parametrize("kind", SKELETONS)
def test_shape_alone_is_enough(kind):
    body = find_skeleton(kind)
    nameless = rename_joints(body, {n: f"joint{k}" for k, n in enumerate(body.names)})
    assert by_names(nameless) == {}
    bones, true = recognise(nameless), recognise(body)
    back = {f"joint{k}": n for k, n in enumerate(body.names)}
    exact = [
        n for n in bones if not (kind in ("beat", "trinity") and re.search("Toes|head", n))
    ]  # these have a second neck and half a foot
    assert {n: back[bones[n]] for n in exact} == {n: true[n] for n in exact}
    assert len(bones) >= 18
    motion = wild(amount=0.02)
    theirs = bone_directions(motion.retarget(nameless), BONES[:4])
    assert len(theirs) == 8
    for name, direction in bone_directions(motion, BONES[:4]).items():
        assert degrees_apart(direction, theirs[name]) < 0.01


def test_shape_of_what_is_no_person():
    table = Skeleton(
        tuple("tabcd"), (-1, 0, 0, 0, 0), np.array([[0, 1, 0], [1, -1, 1], [1, -1, -1], [-1, -1, 1], [-1, -1, -1]])
    )
    snake = Skeleton(tuple(f"s{k}" for k in range(30)), tuple(range(-1, 29)), np.tile([0, 0, 0.1], (30, 1)))
    point = Skeleton(("p",), (-1,), np.zeros((1, 3)))
    spider = Skeleton(
        ("o", *(f"l{k}" for k in range(8))),
        (-1, *[0] * 8),
        np.array([[0, 0, 0], *np.eye(3), *-np.eye(3), [1, 1, 0], [1, 0, 1]]),
    )
    for thing in (table, snake, point, spider):
        assert by_shape(thing) == {}
        with pytest.raises(InputError, match=r"cannot find hips, head, .*\(.*--map file.toml"):
            recognise(thing)


def test_an_error_names_what_is_missing():
    body = without(humanoid(), ".*Eye|jaw")
    odd = rename_joints(body, {"leftLowerLeg": "qqq", "leftFoot": "ppp"})
    offsets = odd.offsets.copy()
    offsets[odd.names.index("qqq")] *= 1.7  # not alike any more, so that the shape does not help either
    with pytest.raises(InputError, match="cannot find leftLowerLeg among the 52 joints"):
        recognise(replace(odd, offsets=offsets))


# --- maps


def test_a_map_helps_and_wins(tmp_path):
    body = rename_joints(humanoid(), {"leftLowerArm": "qqq", "leftUpperArm": "zzz", "jaw": "mandibula"})
    file = tmp_path / "map.toml"
    file.write_text('[bones]\nleftUpperArm = "zzz"\nleftLowerArm = "qqq"\njaw = "mandibula"\nleftEye = ""\n')
    bone_map = load_map(file)
    bones = recognise(body, bone_map)
    assert bones["leftLowerArm"] == "qqq"
    assert bones["jaw"] == "mandibula"
    assert "leftEye" not in bones
    assert bones["rightEye"] == "rightEye"
    motion = wild()
    there = motion.retarget(body, bone_map=bone_map)
    eye = body.index["leftEye"]
    others = [k for k in range(55) if k != eye]
    assert np.abs(np.sum(there.rotations[:, others] * motion.rotations[:, others], -1)).min() > 1 - 1e-12
    assert np.allclose(np.abs(there.rotations[:, eye]), [0, 0, 0, 1])
    back = there.retarget("humanoid", bone_map=bone_map)
    assert np.allclose(back.positions(), motion.positions(), atol=1e-9)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "is empty"),
        ("# nothing", "holds no table"),
        ("bones = 3", "holds no table"),
        ("[bones]\nleftHand = 3", "holds no table"),
        ("[bones\n", "not TOML"),
        ("\xff\xfe", "not TOML"),
        ("[bones]\nleftHand = 'a'\nleftHand = 'b'", "not TOML"),
    ],
)
def test_maps_that_are_none(tmp_path, text, message):
    (tmp_path / "map.toml").write_bytes(text.encode("latin-1"))
    with pytest.raises(InputError, match=message) as error:
        load_map(tmp_path / "map.toml")
    assert "\n" not in str(error.value)


def test_maps_with_unknown_names(tmp_path):
    with pytest.raises(InputError, match=r"'leftHnd' is none of our joints \(did you mean 'leftHand'"):
        recognise(humanoid(), {"leftHnd": "leftHand"})
    with pytest.raises(InputError, match=r"'lefthand' is none of their joints \(did you mean 'leftHand'"):
        recognise(humanoid(), {"leftHand": "lefthand"})
    with pytest.raises(InputError, match="cannot read"):
        load_map(tmp_path / "absent.toml")
    with pytest.raises(InputError, match="cannot read"):
        load_map(Path(tmp_path))
