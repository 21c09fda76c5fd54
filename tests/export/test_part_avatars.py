"""Half bodies, busts, heads with and without bones: what is there plays and is drawn, and a note says what does not move."""

from __future__ import annotations

import re

import numpy as np
import pytest
import soundfile

from cospeech.errors import CospeechWarning, InputError
from cospeech.export import load
from cospeech.export.avatar import Avatar, load_avatar
from cospeech.export.avatar_character import load_character
from cospeech.export.gltf import read_glb
from cospeech.export.live.vmc import avatar_offsets
from cospeech.export.mannequin.character import skin
from cospeech.export.pictures import Subject, render_motion
from cospeech.export.render.camera import find_view
from cospeech.export.render.framing import fit_view
from cospeech.export.target_skeleton import find_target
from cospeech.motion.rotations import quat_angle, quat_multiply
from cospeech.motion.skeleton import humanoid
from tests.export.test_avatar import as_vrm1, rewrite, still, world_at  # noqa: F401  a fixture
from tests.export.test_mapped_avatar import as_odd
from tests.support.command_line import type_command
from tests.support.motions import gesturing

LEGS = "(left|right)(UpperLeg|LowerLeg|Foot|Toes)"
ARMS = "(left|right)(Shoulder|UpperArm|LowerArm)"
ALL_BUT_HEAD = "(?!cospeech|face|neck|head|leftEye|rightEye|jaw).*"
INDEX = humanoid().index


def prune(document: dict, pattern: str) -> None:
    """Take out nodes whose names match; what hangs on them stays at its place. No node of our figure is turned."""
    nodes = document["nodes"]
    parent = {child: k for k, node in enumerate(nodes) for child in node.get("children", [])}

    def place(k: int) -> np.ndarray:
        return np.array(nodes[k].get("translation", (0, 0, 0))) + (place(parent[k]) if k in parent else 0)

    def above(k: int) -> int | None:
        while (k := parent.get(k)) is not None and re.fullmatch(pattern, nodes[k]["name"]):
            pass
        return k

    remaining = [k for k, node in enumerate(nodes) if not re.fullmatch(pattern, node["name"])]
    new = {k: i for i, k in enumerate(remaining)}
    result = [{key: value for key, value in nodes[k].items() if key != "children"} for k in remaining]
    for k, node in zip(remaining, result, strict=True):
        node["translation"] = (place(k) - (0 if above(k) is None else place(above(k)))).tolist()
        if above(k) is not None:
            result[new[above(k)]].setdefault("children", []).append(new[k])
    for entry in document["skins"]:
        entry["joints"] = [new.get(j, new.get(above(j), 0)) for j in entry["joints"]]
        entry.pop("skeleton")
    document["nodes"] = result
    document["scenes"] = [{"nodes": [new[k] for k in remaining if above(k) is None]}]
    meshes = sorted({node["mesh"] for node in result if "mesh" in node})
    document["meshes"] = [document["meshes"][k] for k in meshes]
    for node in result:
        if "mesh" in node:
            node["mesh"] = meshes.index(node["mesh"])


def as_half(document: dict) -> None:
    """No legs, and the origin at the hips."""
    prune(document, LEGS)
    document["nodes"][0]["translation"] = [0, 0, 0]
    document["nodes"].append({"name": "root", "translation": [0, -humanoid().tpose[0, 1], 0], "children": []})


def as_bust(document: dict) -> None:
    """Hips, spine, neck, head, and hands that hang on the chest, as a half body of Ready Player Me."""
    prune(document, f"{LEGS}|{ARMS}")
    for mesh in document["meshes"]:  # the hand of our figure hangs on an arm
        mesh["primitives"] = [p for p in mesh["primitives"] if document["materials"][p["material"]]["name"] != "hand"]


def as_head(document: dict) -> None:
    prune(document, ALL_BUT_HEAD)


def as_nodes(document: dict) -> None:
    """A head without a skin, ten times as large: a group that turns carries a head, eyes and teeth, as in facecap.glb."""
    mesh = next(node["mesh"] for node in document["nodes"] if node["name"] == "face")
    head, eye, jaw = (humanoid().tpose[INDEX[name]] for name in ("head", "leftEye", "jaw"))
    face = document["meshes"][mesh]
    for primitive in face["primitives"]:
        primitive["attributes"] = {key: at for key, at in primitive["attributes"].items() if key in ("POSITION", "NORMAL")}
    document.pop("skins")
    document["meshes"] = [face, {"primitives": face["primitives"][1:]}]
    document["nodes"] = [
        {"name": "scale", "scale": [10, 10, 10], "children": [1]},
        {"name": "grp_transform", "translation": head.tolist(), "children": [2, 4]},
        {"name": "head", "children": [3]},
        {"mesh": 0, "translation": (-head).tolist()},
        {"name": "eyeLeft", "translation": (eye - head).tolist(), "children": [5]},
        {"mesh": 1, "translation": (-jaw).tolist()},  # teeth that are an eyeball
    ]
    document["scenes"] = [{"nodes": [0]}]


def read(source, target, change, note: str) -> Avatar:
    rewrite(source, target, change)
    with pytest.warns(CospeechWarning, match=re.escape(target.name) + "' has no " + note) as notes:
        avatar = load_avatar(target)
    assert len(notes) == 1
    return avatar


def list_channels(path) -> set[tuple[str, str]]:
    """(name of a node, what moves)."""
    file = read_glb(path)
    return {
        (file.list("nodes")[c["target"]["node"]].get("name", ""), c["target"]["path"])
        for c in file.json["animations"][0]["channels"]
    }


def read_rotation(path, name: str, frame: int) -> np.ndarray:
    """(4,) local rotation of a node that an animation turns."""
    file = read_glb(path)
    entry = file.json["animations"][0]
    (sampler,) = [
        entry["samplers"][c["sampler"]]
        for c in entry["channels"]
        if file.list("nodes")[c["target"]["node"]].get("name") == name and c["target"]["path"] == "rotation"
    ]
    return file.accessor(sampler["output"], 4)[frame]


def test_a_half_body_plays_where_it_stands(still, tmp_path):  # noqa: F811
    avatar = read(still, tmp_path / "half.glb", as_half, "legs: the lower body does not move")
    assert len(avatar.rig.bones) == 55 - 8
    motion = gesturing(40)
    avatar.animate(motion, tmp_path / "out.glb")
    ours = motion.positions()
    for frame in (0, 17, 39):
        theirs = world_at(read_glb(tmp_path / "out.glb"), frame / 30)
        for a, b in (("leftUpperArm", "leftHand"), ("rightLowerArm", "rightHand"), ("neck", "head")):
            expected = ours[frame, INDEX[b]] - ours[frame, INDEX[a]]
            np.testing.assert_allclose(theirs[b] - theirs[a], expected, atol=2e-3)
        np.testing.assert_allclose(theirs["hips"], ours[frame, 0] - humanoid().tpose[0], atol=1e-3)
    with pytest.warns(CospeechWarning, match="has no legs"):
        back = load(tmp_path / "out.glb").retarget("humanoid")
    np.testing.assert_allclose(back.root, motion.root, atol=2e-3)
    arms = [k for k, name in enumerate(humanoid().names) if "Arm" in name or name == "head"]
    assert quat_angle(back.rotations, motion.rotations)[:, arms].max() < 1e-3


def test_a_half_body_is_drawn_at_the_height_of_a_person(still, tmp_path):  # noqa: F811
    character = load_character(read(still, tmp_path / "half.glb", as_half, "legs"))
    assert character.skeleton.tpose[0, 1] == pytest.approx(humanoid().tpose[0, 1], abs=0.03)
    lowest = min(float(part.vertices[:, 1].min()) for part in character.parts)
    for camera in ("full", "body"):
        view = fit_view(find_view(camera), character)
        assert view.low[1] == pytest.approx(lowest - view.reach, abs=1e-5)  # no room for legs that are not there
    joints = [character.skeleton.names[k] for k in find_view("full").joints_of(character.skeleton)]
    assert not any(re.fullmatch(LEGS, name) for name in joints)
    whole = Subject(still)
    assert whole.fit(find_view("full")).low[1] < 0 < lowest


def test_a_half_vrm_plays_too(still, tmp_path):  # noqa: F811
    """Its humanoid says what is there: a skirt of two chains is no pair of legs."""

    def half_vrm(document: dict) -> None:
        as_vrm1(document)
        bones = document["extensions"]["VRMC_vrm"]["humanoid"]["humanBones"]
        for name in [name for name in bones if re.fullmatch(LEGS, name)]:
            bones.pop(name)
        for chain in range(2):
            for k in range(3):
                document["nodes"].append({"name": f"q{chain}{k}", "translation": [0.1 * chain, -0.2, 0]})
                document["nodes"][len(document["nodes"]) - 2 if k else 0].setdefault("children", []).append(
                    len(document["nodes"]) - 1
                )

    avatar = read(still, tmp_path / "half.vrm", half_vrm, "legs")
    motion = gesturing(5)
    there = motion.retarget(avatar.skeleton)
    np.testing.assert_allclose(there.root - avatar.skeleton.offsets[0], motion.root - humanoid().offsets[0], atol=1e-5)
    assert avatar_offsets(avatar).keys() == avatar.rig.bones.keys()


def test_a_bust_moves_head_and_trunk(still, tmp_path):  # noqa: F811
    avatar = read(still, tmp_path / "bust.glb", as_bust, "arms and no legs: head and trunk move")
    there = {"hips", "spine", "chest", "upperChest", "neck", "head", "leftEye", "rightEye", "jaw"}
    assert {*avatar.rig.bones} == there
    motion = gesturing(40)
    avatar.animate(motion, tmp_path / "out.glb")
    assert list_channels(tmp_path / "out.glb") == {(name, "rotation") for name in there} | {
        ("hips", "translation"),
        ("face", "weights"),
    }
    assert quat_angle(read_rotation(tmp_path / "out.glb", "head", 20), motion.rotations[20, INDEX["head"]]) < 1e-3
    theirs, ours = world_at(read_glb(tmp_path / "out.glb"), 20 / 30), motion.positions()[20]
    np.testing.assert_allclose(theirs["head"] - theirs["hips"], ours[INDEX["head"]] - ours[0], atol=1e-3)
    character = load_character(avatar)
    view, points = fit_view(find_view("body"), character), np.concatenate([part.vertices for part in character.parts])
    np.testing.assert_allclose([view.low[0], view.high[0]], [points[:, 0].min() - 0.06, points[:, 0].max() + 0.06], atol=1e-5)


@pytest.mark.parametrize("change", [as_head, as_nodes])
def test_a_head_turns_in_its_place(still, tmp_path, change):  # noqa: F811
    """It turns as our head does in the world: the turns of the trunk are in it."""
    avatar = read(still, tmp_path / "head.glb", change, "body: head and face move")
    eye, top = ("leftEye", "head") if change is as_head else ("eyeLeft", "grp_transform")
    motion = gesturing(40)
    avatar.animate(motion, tmp_path / "out.glb")
    channels = {("neck", "rotation"), ("rightEye", "rotation"), ("jaw", "rotation"), ("face", "weights")}
    channels = channels if change is as_head else {("", "weights")}
    assert list_channels(tmp_path / "out.glb") == channels | {(eye, "rotation"), (top, "rotation")}
    world = humanoid().forward(motion.rotations, motion.root)[1]
    turn = read_rotation(tmp_path / "out.glb", top, 20)
    turn = quat_multiply(read_rotation(tmp_path / "out.glb", "neck", 20), turn) if change is as_head else turn
    assert quat_angle(turn, world[20, INDEX["head"]]) < 1e-3
    assert quat_angle(read_rotation(tmp_path / "out.glb", eye, 20), motion.rotations[20, INDEX["leftEye"]]) < 1e-3
    weights = world_at(read_glb(tmp_path / "out.glb"), 20 / 30)["weights"]
    np.testing.assert_allclose(next(iter(weights.values())), motion.face[20], atol=1e-6)
    with pytest.raises(InputError, match="nothing of this character is where the camera looks"):
        render_motion(motion, tmp_path / "a.png", camera="hands", avatar=avatar)
    theirs = Subject(avatar).pose(motion)  # the picture shows the same
    assert np.ptp(theirs.root, 0).max() == 0
    rotations = theirs.skeleton.forward(theirs.rotations, theirs.root)[1]
    assert quat_angle(rotations[:, INDEX["head"]], world[:, INDEX["head"]]).max() < 1e-6


def test_a_head_is_drawn_as_large_as_a_persons(still, tmp_path):  # noqa: F811
    """In the middle of the picture, and it turns about its own pivot."""
    character = load_character(read(still, tmp_path / "head.glb", as_nodes, "body"))
    points = np.concatenate([part.vertices for part in character.parts])
    assert 0.1 < np.ptp(points[:, 1]) < 0.5
    assert points[:, 1].max() == pytest.approx(1.72, abs=0.1)
    view = fit_view(find_view("body"), character)
    assert (np.array(view.low)[:2] >= points.min(0)[:2] - 0.061).all()
    pose = Subject(load_avatar_quietly(tmp_path / "head.glb")).pose(gesturing(40))
    positions, rotations = character.skeleton.forward(pose.rotations[35], pose.root[35])
    vertices = np.concatenate(skin(character, rotations, positions))
    assert np.linalg.norm(vertices.mean(0) - points.mean(0)) < 0.05
    assert np.abs(vertices - points).max() > 0.01


def load_avatar_quietly(path) -> Avatar:
    with pytest.warns(CospeechWarning):
        return load_avatar(path)


def test_a_face_without_a_head_that_can_turn_moves_alone(still, tmp_path):  # noqa: F811
    """No node is called head; or it lies far from all that is seen; or something hangs beside it that would stay behind."""

    def nameless(document: dict) -> None:
        as_nodes(document)
        document["nodes"][2]["name"] = "mesh_2"

    def far(document: dict) -> None:
        as_nodes(document)
        nodes = document["nodes"]
        nodes[4]["translation"] = (np.array(nodes[4]["translation"]) + nodes[1]["translation"]).tolist()
        nodes[1]["translation"] = nodes[3]["translation"] = [0, 0, 0]

    def beside(document: dict) -> None:
        as_head(document)
        document["nodes"].append({"name": "hat", "mesh": 0})
        document["scenes"][0]["nodes"].append(len(document["nodes"]) - 1)

    motion = gesturing(10)
    for change in (nameless, far, beside):
        avatar = read(still, tmp_path / "face.glb", change, "body: its face moves, its head does not turn")
        assert avatar.rig.bones == {}
        avatar.animate(motion, tmp_path / "out.glb")
        assert {path for _, path in list_channels(tmp_path / "out.glb")} == {"weights"}
        pose = Subject(avatar).pose(motion)
        assert np.ptp(pose.rotations, 0).max() == np.ptp(pose.root, 0).max() == 0
        with pytest.warns(CospeechWarning, match="has no body"):
            back = load(tmp_path / "out.glb")
        np.testing.assert_allclose(back.face, motion.face, atol=1e-6)
        with pytest.raises(InputError, match="VMC"):
            avatar_offsets(avatar)
        with pytest.warns(CospeechWarning), pytest.raises(InputError, match="has no bones to carry motion to"):
            find_target(tmp_path / "face.glb")


def test_a_map_names_a_head(still, tmp_path):  # noqa: F811
    def strange(document: dict) -> None:
        as_head(document)
        next(node for node in document["nodes"] if node["name"] == "head")["name"] = "Bone.001"

    avatar = read(still, tmp_path / "head.glb", strange, "body: its face moves, its head does not turn")
    with pytest.warns(CospeechWarning, match="head and face move"):
        avatar = load_avatar(tmp_path / "head.glb", {"head": "Bone.001"})
    assert {"head", "leftEye"} <= {*avatar.rig.bones}


def test_a_body_that_is_not_recognised_is_no_head(still, tmp_path):  # noqa: F811
    """A face does not hide limbs whose names say nothing; without face and body a file is no character."""
    rewrite(still, tmp_path / "odd.glb", as_odd)
    assert len(read_glb(tmp_path / "odd.glb").list("meshes")[0]["extras"]["targetNames"]) == 52
    with pytest.raises(InputError, match=r"cannot find hips, head, .*--map"):
        load_avatar(tmp_path / "odd.glb")

    def table(document: dict) -> None:
        as_nodes(document)
        for mesh in document["meshes"]:
            mesh.pop("extras", None)

    rewrite(still, tmp_path / "table.glb", table)
    with pytest.raises(InputError, match="cannot find hips"):
        load_avatar(tmp_path / "table.glb")


@pytest.mark.slow
@pytest.mark.parametrize(("change", "note"), [(as_half, "no legs"), (as_bust, "no arms and no legs"), (as_nodes, "no body")])
def test_the_command_line_writes_files_and_pictures_of_a_part(still, tmp_path, change, note):  # noqa: F811
    rewrite(still, tmp_path / "part.glb", change)
    soundfile.write(tmp_path / "talk.wav", 0.1 * np.sin(np.arange(16000) * 0.05), 16000)
    _, err = type_command("generate talk.wav -o t.glb -o t.png --avatar part.glb -q", tmp_path)
    assert err.count("note: ") == err.count(note) == 1
    assert (tmp_path / "t.png").read_bytes()[:4] == b"\x89PNG"
    _, err = type_command("render t.glb r.png --avatar part.glb --camera face", tmp_path)
    assert err.count(note) == 2  # of the motion and of the avatar
