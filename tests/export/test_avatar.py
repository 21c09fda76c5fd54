"""Other people's characters: found, driven, written back with all else untouched; compared with a forward pass of our own."""

from __future__ import annotations

import json

import numpy as np
import pytest

from cospeech.errors import CospeechWarning, InputError
from cospeech.export import load, save
from cospeech.export.avatar import load_avatar
from cospeech.export.glb_container import split_glb
from cospeech.export.gltf import GltfFile, read_glb
from cospeech.export.gltf_build import GltfBuilder
from cospeech.motion.motion import Motion
from cospeech.motion.rotations import quat_angle, quat_rotate, quat_to_matrix
from cospeech.motion.skeleton import humanoid
from cospeech.motion.skeletons.arkit import ARKIT, ARKIT_INDEX
from cospeech.motion.skeletons.mixamo import NAMES as MIXAMO
from tests.support.motions import gesturing, stand_in


def rewrite(source, target, change) -> None:
    """A copy of a GLB whose document went through ``change``."""
    document, data = split_glb(source.read_bytes(), "'source'")
    change(document)
    builder = GltfBuilder(document, data)
    with target.open("wb") as out:
        builder.write(out)


@pytest.fixture
def still(tmp_path):
    """Our small figure, without animation."""
    path = tmp_path / "still.glb"
    save(gesturing(1), path, character=stand_in())
    rewrite(path, path, lambda document: document.pop("animations"))
    return path


def world_at(file: GltfFile, time: float) -> dict[str, np.ndarray]:
    """Name → world position of every node at a key of the first animation, from the raw document."""
    nodes = json.loads(json.dumps(file.json["nodes"]))
    weights = {}
    for channel in file.json["animations"][0]["channels"]:
        sampler = file.json["animations"][0]["samplers"][channel["sampler"]]
        keys = file.accessor(sampler["input"], 1)[:, 0]
        k = int(np.argmin(np.abs(keys - time)))
        path, node = channel["target"]["path"], channel["target"]["node"]
        if path == "weights":
            values = file.accessor(sampler["output"], 1).reshape(len(keys), -1)
            weights[node] = values[k]
        else:
            nodes[node][path] = file.accessor(sampler["output"], 4 if path == "rotation" else 3)[k].tolist()
    result: dict[str, np.ndarray] = {"weights": weights}

    def walk(k: int, above: np.ndarray) -> None:
        node, local = nodes[k], np.eye(4)
        local[:3, :3] = quat_to_matrix(np.array(node.get("rotation", (0, 0, 0, 1)))) * np.array(node.get("scale", (1, 1, 1)))
        local[:3, 3] = node.get("translation", (0, 0, 0))
        if "matrix" in node:
            local = np.array(node["matrix"]).reshape(4, 4).T
        result[node.get("name", str(k))] = (above @ local)[:3, 3]
        for child in node.get("children", []):
            walk(child, above @ local)

    for root in file.json["scenes"][0]["nodes"]:
        walk(root, np.eye(4))
    return result


def as_mixamo_from_blender(document: dict) -> None:
    """Mixamo's names under an armature in centimetres that Blender turned by −90° about X, hips with a matrix."""
    turn = np.array([-np.sqrt(0.5), 0, 0, np.sqrt(0.5)])
    names = humanoid().names
    for k, name in enumerate(names):
        node = document["nodes"][k]
        node["name"] = MIXAMO.get(name, f"extra_{name}")
        offset = 100 * np.array(node.pop("translation"))
        node["translation"] = (quat_rotate(turn * (-1, -1, -1, 1), offset) if k == 0 else offset).tolist()
    hips = document["nodes"][0]
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = quat_to_matrix(turn * (-1, -1, -1, 1)), hips.pop("translation")
    hips["matrix"] = matrix.T.reshape(-1).tolist()
    armature = document["nodes"][len(names)]
    armature |= {"name": "Armature", "rotation": turn.tolist(), "scale": [0.01] * 3}
    document["asset"]["generator"] = "another program"


def hanging_arms(document: dict) -> None:
    """An A-pose: arms rest 45° below the horizontal, all rest rotations identity."""
    names = humanoid().names
    arm = ("LowerArm", "Hand", "Thumb", "Index", "Middle", "Ring", "Little")
    for k, name in enumerate(names):
        if name.startswith(("left", "right")) and any(part in name for part in arm):
            sign = -1 if name.startswith("left") else 1
            q = np.array([0, 0, np.sin(sign * np.pi / 8), np.cos(np.pi / 8)])
            document["nodes"][k]["translation"] = quat_rotate(q, np.array(document["nodes"][k]["translation"])).tolist()


def as_vrm1(document: dict) -> None:
    """VRM 1.0 with bones of other names, presets and one custom expression, looks by bone."""
    for k in range(len(humanoid())):
        document["nodes"][k]["name"] = f"J_{k:02d}"
    bones = {name: {"node": k} for k, name in enumerate(humanoid().names)}
    face = next(k for k, node in enumerate(document["nodes"]) if node.get("name") == "face")
    jaw, blink = ARKIT_INDEX["jawOpen"], ARKIT_INDEX["eyeBlinkLeft"]
    mesh = document["meshes"][document["nodes"][face]["mesh"]]
    mesh["extras"]["targetNames"] = [f"shape {k}" for k in range(52)]
    preset = {
        "aa": {"morphTargetBinds": [{"node": face, "index": jaw, "weight": 0.5}]},
        "blinkLeft": {"morphTargetBinds": [{"node": face, "index": blink, "weight": 1.0}], "isBinary": True},
    }
    document |= {"extensionsUsed": ["VRMC_vrm"]}
    document["extensions"] = {
        "VRMC_vrm": {"specVersion": "1.0", "humanoid": {"humanBones": bones}, "expressions": {"preset": preset}}
    }


def as_vrm0(document: dict) -> None:
    """VRM 0.x: faces −Z, thumbs one name off, expressions in per cent on meshes."""
    document["nodes"][len(humanoid().names)]["rotation"] = [0, 1, 0, 0]
    thumbs = {"ThumbMetacarpal": "ThumbProximal", "ThumbProximal": "ThumbIntermediate"}
    bones = []
    for k, name in enumerate(humanoid().names):
        document["nodes"][k]["name"] = f"b{k}"
        old = next((name.replace(new, old) for new, old in thumbs.items() if name.endswith(new)), name)
        bones.append({"bone": old, "node": k, "useDefaultValues": True})
    mesh = next(k for k, m in enumerate(document["meshes"]) if m["name"] == "face")
    document["meshes"][mesh].pop("extras")
    group = {"name": "A", "presetName": "a", "binds": [{"mesh": mesh, "index": ARKIT_INDEX["jawOpen"], "weight": 100}]}
    document["extensions"] = {"VRM": {"humanoid": {"humanBones": bones}, "blendShapeMaster": {"blendShapeGroups": [group]}}}
    document["extensionsUsed"] = ["VRM"]


def no_change(document: dict) -> None:
    document["asset"]["generator"] = "another program"


@pytest.mark.parametrize("change", [no_change, as_mixamo_from_blender, hanging_arms, as_vrm1, as_vrm0])
def test_limbs_point_where_the_motion_says(still, tmp_path, change):
    """Whatever the names, units, axes, rest pose and facing of a character, its limbs point as the motion's do."""
    path, out = tmp_path / "theirs.glb", tmp_path / "out.glb"
    rewrite(still, path, change)
    motion = gesturing(40)
    avatar = load_avatar(path)
    assert set(avatar.rig.bones) >= {"hips", "head", "leftHand", "rightHand", "leftIndexProximal", "leftThumbMetacarpal"}
    avatar.animate(motion, out)
    file = read_glb(out)
    names = {name: file.json["nodes"][avatar.rig.nodes[j]]["name"] for name, j in avatar.rig.bones.items()}
    ours, index = motion.positions(), humanoid().index
    turn = np.array([-1, 1, -1]) if change is as_vrm0 else np.ones(3)
    for frame in (0, 17, 39):
        theirs = world_at(file, frame / 30)
        for a, b in (
            ("leftUpperArm", "leftLowerArm"), ("rightUpperArm", "rightLowerArm"), ("rightLowerArm", "rightHand"),
            ("leftUpperLeg", "leftLowerLeg"), ("neck", "head"), ("leftIndexProximal", "leftIndexIntermediate"),
            ("rightThumbProximal", "rightThumbDistal"),
        ):  # fmt: skip
            expected = ours[frame, index[b]] - ours[frame, index[a]]
            bone = (theirs[names[b]] - theirs[names[a]]) * turn
            np.testing.assert_allclose(bone, expected, atol=2e-3, err_msg=f"{a} {frame}")
        np.testing.assert_allclose(theirs[names["hips"]] * turn, ours[frame, 0], atol=1e-3)


@pytest.mark.parametrize("change", [as_mixamo_from_blender, hanging_arms, as_vrm1, as_vrm0])
def test_what_an_avatar_does_is_read_back(still, tmp_path, change):
    path, out = tmp_path / "theirs.glb", tmp_path / "out.glb"
    rewrite(still, path, change)
    motion = gesturing(40)
    load_avatar(path).animate(motion, out)
    back = load(out)
    again = back.retarget("humanoid")
    joints = [k for k, name in enumerate(humanoid().names) if "Arm" in name or "Index" in name or name in ("hips", "head")]
    assert quat_angle(again.rotations, motion.rotations)[:, joints].max() < 1e-3
    np.testing.assert_allclose(again.root, motion.root, atol=2e-3)


def test_faces_in_the_best_alphabet(still, tmp_path):
    body = gesturing(40)
    face = body.face * [name.startswith(("brow", "eyeBlink")) for name in ARKIT]
    face[:, ARKIT_INDEX["jawOpen"]] = 0.3  # of 0.4, which is VRM's "aa": a spread mouth, not round
    motion = Motion(fps=30, rotations=body.rotations, root=body.root, face=face)
    jaw, blink = ARKIT_INDEX["jawOpen"], ARKIT_INDEX["eyeBlinkLeft"]

    def drive(change) -> tuple[str, np.ndarray]:
        rewrite(still, tmp_path / "theirs.glb", change)
        avatar = load_avatar(tmp_path / "theirs.glb")
        avatar.animate(motion, tmp_path / "out.glb")
        weights = world_at(read_glb(tmp_path / "out.glb"), 9 / 30)["weights"]
        return avatar.face.alphabet, next(iter(weights.values())) if weights else np.zeros(0)

    alphabet, weights = drive(no_change)
    assert alphabet == "ARKit"
    np.testing.assert_allclose(weights, motion.face[9], atol=1e-6)

    def add_prefix(document: dict) -> None:
        extras = next(m["extras"] for m in document["meshes"] if "extras" in m)
        extras["targetNames"] = [
            "Head.M_" + name.replace("Left", "_L").replace("Right", "_R") for name in extras["targetNames"]
        ]

    alphabet, weights = drive(add_prefix)
    assert alphabet == "ARKit"
    np.testing.assert_allclose(weights, motion.face[9], atol=1e-6)

    alphabet, weights = drive(as_vrm1)
    assert alphabet == "VRM"
    assert weights[jaw] == pytest.approx(0.5 * 0.75, abs=1e-6)  # the expression moves its target by half
    assert weights[blink] in (0, 1)
    alphabet, weights = drive(as_vrm0)
    assert (alphabet, weights[jaw]) == ("VRM", pytest.approx(0.75, abs=1e-6))

    def oculus(document: dict) -> None:
        extras = next(m["extras"] for m in document["meshes"] if "extras" in m)
        extras["targetNames"] = ["viseme_aa", "viseme_O", "viseme_PP", "eyeBlinkLeft"] + [f"x{k}" for k in range(48)]

    alphabet, weights = drive(oculus)
    assert alphabet == "Oculus"
    assert weights[0] == pytest.approx(0.75, abs=1e-6)
    assert weights[3] == pytest.approx(motion.face[9, blink], abs=1e-6)
    assert np.abs(weights[4:]).max() == 0

    def nameless(document: dict) -> None:
        next(m for m in document["meshes"] if "extras" in m).pop("extras")

    assert drive(nameless) == ("", pytest.approx(np.zeros(0)))
    assert "body only" in load_avatar(tmp_path / "theirs.glb").describe()


def test_all_else_is_untouched(shared_folder, tmp_path):
    path, out = shared_folder / "data" / "avatars" / "Godette_vrm_v4_CC-BY-3.0.vrm", tmp_path / "out.glb"
    save(gesturing(20), out, avatar=path)
    (before, old), (after, new) = (split_glb(p.read_bytes(), "''") for p in (path, out))
    assert new[: len(old)] == old
    for key in before:
        if key in ("accessors", "bufferViews"):
            assert after[key][: len(before[key])] == before[key]
        elif key not in ("buffers", "animations"):
            assert after[key] == before[key], key
    assert set(after) == set(before) | {"animations"}


def test_old_animations_are_dropped(shared_folder, tmp_path):
    path, out = shared_folder / "data" / "avatars" / "KayKit_Mage_CC0.glb", tmp_path / "out.glb"
    avatar = load_avatar(path)
    with pytest.warns(CospeechWarning, match="has 76 clips of its own"):
        avatar.animate(gesturing(20), out)
    assert [a["name"] for a in read_glb(out).json["animations"]] == ["speech"]
    assert "body only" in avatar.describe()


def test_animations_of_others_are_read(shared_folder):
    """KayKit's walk: two steps a second or so, hips level, feet on the floor; retargets to our humanoid."""
    path = shared_folder / "data" / "avatars" / "KayKit_Mage_CC0.glb"
    names = [a["name"] for a in read_glb(path).json["animations"]]
    motion = load(path, animation=names.index("Walking_A"))
    assert (motion.fps, 20 < len(motion) < 60) == (30, True)
    points = motion.positions()
    rig = load_avatar(path).rig
    left, right = (points[:, rig.bones[f"{side}Foot"]] for side in ("left", "right"))
    assert -0.05 < min(left[:, 1].min(), right[:, 1].min()) < 0.15
    assert np.corrcoef(left[:, 2] - points[:, 0, 2], right[:, 2] - points[:, 0, 2])[0, 1] < -0.8  # legs swing in turn
    ours = motion.retarget("humanoid")
    assert 0.8 < ours.root[:, 1].mean() < 1.1


@pytest.mark.parametrize("name", ["avatar_mpfb_female_arkit52_viseme15.glb", "avatar_mpfb_male_arkit52_viseme15.glb"])
def test_mpfb_humans(shared_folder, tmp_path, name):
    """A-pose, Mixamo-like names, 52 shapes on six meshes: hands go where ours go, eyes turn once."""
    avatar = load_avatar(shared_folder / "data" / "avatars" / name)
    assert (len(avatar.rig.bones), avatar.face.alphabet, avatar.eyes_by_shapes) == (55, "ARKit", True)
    motion = gesturing(61)
    avatar.animate(motion, tmp_path / "out.glb")
    file = read_glb(tmp_path / "out.glb")
    for frame in (0, 30, 60):
        theirs, ours = world_at(file, frame / 30), motion.positions()[frame]
        for bone in ("LeftHand", "RightHand"):
            arm = theirs[bone] - theirs[bone.replace("Hand", "Arm")]
            index = humanoid().index
            name = bone[0].lower() + bone[1:]
            expected = ours[index[name]] - ours[index[name.replace("Hand", "UpperArm")]]
            cosine = arm @ expected / np.linalg.norm(arm) / np.linalg.norm(expected)
            assert cosine > 0.995
        for weights in theirs["weights"].values():
            assert weights.min() >= 0
    still = Motion(fps=30, rotations=motion.rotations, root=motion.root)  # no face: the eye bones turn after all
    avatar.animate(still, tmp_path / "still.glb")
    counts = [
        len(read_glb(tmp_path / n).accessor(s["output"], 4))
        for n in ("out.glb", "still.glb")
        for s in [_sampler(read_glb(tmp_path / n), "LeftEye")]
    ]
    assert counts == [1, 61]


def _sampler(file: GltfFile, node: str) -> dict:
    animation = file.json["animations"][0]
    (channel,) = [c for c in animation["channels"] if file.json["nodes"][c["target"]["node"]]["name"] == node]
    return animation["samplers"][channel["sampler"]]


def test_characters_that_are_none(tmp_path, still):
    def no_nodes(document: dict) -> None:
        document["nodes"], document["skins"], document["scenes"] = [{"name": "table"}], [], [{"nodes": [0]}]

    rewrite(still, tmp_path / "table.glb", no_nodes)
    with pytest.raises(InputError):
        load_avatar(tmp_path / "table.glb")

    def mirror(document: dict) -> None:
        document["nodes"][len(humanoid().names)]["scale"] = [-1, 1, 1]

    rewrite(still, tmp_path / "mirrored.glb", mirror)
    with pytest.raises(InputError, match="mirrored"):
        load_avatar(tmp_path / "mirrored.glb")

    def lose_hips(document: dict) -> None:
        as_vrm1(document)
        document["extensions"]["VRMC_vrm"]["humanoid"]["humanBones"]["hips"]["node"] = 9999

    rewrite(still, tmp_path / "gone.glb", lose_hips)
    with pytest.raises(InputError, match="names bones"):
        load_avatar(tmp_path / "gone.glb")
