"""FBX that we write: its objects hang together, its curves have a key on every frame, and it is read back as it was."""

from __future__ import annotations

import numpy as np
import pytest

from cospeech.errors import InputError
from cospeech.export import load, open_writer, save
from cospeech.export.avatar import load_avatar
from cospeech.export.fbx import node_writer
from cospeech.export.fbx.document import Document
from cospeech.export.fbx.time_modes import find_mode
from cospeech.export.fbx.tree import Node, parse_fbx
from cospeech.motion.rotations import axis_angle_to_quat
from cospeech.motion.skeleton import find_skeleton
from cospeech.motion.skeletons.arkit import ARKIT
from tests.support.motions import gesturing


def parse_file(path) -> Node:
    return parse_fbx(path.read_bytes(), path.name)


@pytest.fixture(scope="module")
def ours(tmp_path_factory):
    path = tmp_path_factory.mktemp("fbx") / "a.fbx"
    save(gesturing(90), path)
    return path


def test_our_humanoid_comes_back(ours):
    motion, again = gesturing(90), load(ours)
    assert (again.fps, len(again), again.skeleton.names) == (30.0, 90, motion.skeleton.names)
    np.testing.assert_allclose(again.positions(), motion.positions(), atol=1e-6)
    np.testing.assert_allclose(again.face, motion.face, atol=1e-6)


@pytest.mark.parametrize("name", ["mixamo", "unreal"])
def test_another_skeleton_comes_back_with_its_names(tmp_path, name):
    motion = gesturing(40).retarget(find_skeleton(name))
    save(motion, tmp_path / "a.fbx")
    again = load(tmp_path / "a.fbx")
    joints = [again.skeleton.index[joint] for joint in motion.skeleton.names if joint in again.skeleton.index]
    indices = [motion.skeleton.index[again.skeleton.names[joint]] for joint in joints]
    assert len(joints) > 50
    places, expected = again.positions()[:, joints], motion.positions()[:, indices]
    off = places - expected  # a rig that is read stands on its lowest joint
    np.testing.assert_allclose(off, np.broadcast_to(off[:1, :1], off.shape), atol=1e-5)
    assert np.abs(off).max() < 0.03


def test_bones_alone_carry_the_face_as_numbers_of_the_root(tmp_path):
    motion = gesturing(20).retarget(find_skeleton("mixamo"))
    save(motion, tmp_path / "a.fbx")
    fbx = Document(parse_file(tmp_path / "a.fbx"), "a")
    root = next(model for model in fbx.of_kind("Model") if model.name == "mixamorig:Hips")
    assert {*ARKIT} <= root.properties.keys()
    (node,) = [child for child, name in fbx.below(root.number, "AnimationCurveNode") if name == "jawOpen"]
    ((curve, name),) = fbx.below(node.number, "AnimationCurve")
    assert name == "d|jawOpen"
    np.testing.assert_allclose(curve.node.array("KeyValueFloat"), motion.face[:, ARKIT.index("jawOpen")], atol=1e-6)
    assert not fbx.of_kind("Geometry")


def test_objects_are_counted_and_connections_lead_somewhere(ours):
    root = parse_file(ours)
    fbx, kinds = Document(root, "a"), root.find("Definitions")
    counts = {node.values[0]: node.value("Count") for node in kinds.all("ObjectType")}
    assert counts.pop("GlobalSettings") == 1
    assert counts == {kind: len(fbx.of_kind(kind)) for kind in counts}
    assert sum(counts.values()) == len(fbx.objects)
    for node in fbx.connections:
        assert {*node.values[1:3]} <= {0, *fbx.objects}


def test_curves_have_a_key_on_every_frame_and_no_jumps(ours):
    fbx = Document(parse_file(ours), "a")
    longest = 0
    for curve in fbx.of_kind("AnimationCurve"):
        times, values = curve.node.array("KeyTime"), curve.node.array("KeyValueFloat")
        assert len(times) == len(values) == int(curve.node.array("KeyAttrRefCount")[0])
        assert len(times) in (1, 90)
        longest = max(longest, len(times))
        if len(times) > 1:
            np.testing.assert_allclose(np.diff(times), node_ticks(), atol=1)
            assert np.abs(np.diff(values)).max() < 90  # degrees, centimetres, per cent
    assert longest == 90


def node_ticks() -> float:
    return 46_186_158_000 / 30


def test_a_turn_beyond_180_degrees_goes_on(tmp_path):
    motion = gesturing(60)
    motion.rotations[:, 0] = axis_angle_to_quat((0, 1, 0), np.linspace(0, 4 * np.pi, 60))
    save(motion, tmp_path / "a.fbx")
    np.testing.assert_allclose(load(tmp_path / "a.fbx").positions(), motion.positions(), atol=1e-5)
    fbx = Document(parse_file(tmp_path / "a.fbx"), "a")
    most = max(np.ptp(curve.node.array("KeyValueFloat")) for curve in fbx.of_kind("AnimationCurve"))
    assert most == pytest.approx(720, abs=1e-2)


@pytest.mark.parametrize(
    ("fps", "mode"), [(30, 6), (24, 11), (60, 3), (30000 / 1001, 9), (24000 / 1001, 13), (15, 14), (12.5, 14)]
)
def test_frame_rates_are_told_by_number_or_as_they_are(tmp_path, fps, mode):
    assert find_mode(fps) == (mode, fps if mode == 14 else -1.0)
    save(gesturing(12, fps), tmp_path / "a.fbx")
    assert load(tmp_path / "a.fbx").fps == pytest.approx(fps, rel=1e-4)


def test_pieces_make_the_bytes_of_the_whole(ours, tmp_path):
    motion = gesturing(90)
    with open_writer(tmp_path / "a.fbx", skeleton=motion.skeleton, fps=30.0) as writer:
        for start, end in ((0, 1), (1, 40), (40, 90)):
            writer.write(motion[start:end])
    assert (tmp_path / "a.fbx").read_bytes() == ours.read_bytes()


def test_a_character_is_copied_with_our_clip_in_the_place_of_its_own(ours, tmp_path):
    motion, first = gesturing(50), Document(parse_file(ours), "a")
    with pytest.warns(UserWarning, match="clip"):
        save(motion, tmp_path / "b.fbx", avatar=ours)
    second = Document(parse_file(tmp_path / "b.fbx"), "b")
    for kind in ("Model", "Geometry", "Deformer", "Material", "Pose"):
        assert [item.number for item in second.of_kind(kind)] == [item.number for item in first.of_kind(kind)]
    assert len(second.of_kind("AnimationStack")) == 1
    again = load(tmp_path / "b.fbx")
    np.testing.assert_allclose(again.positions(), motion.positions(), atol=1e-6)
    np.testing.assert_allclose(again.face, motion.face, atol=1e-6)


def test_a_character_of_another_format_is_refused(tmp_path):
    save(gesturing(5), tmp_path / "a.glb")
    with pytest.raises(InputError, match=r"is no FBX.*name an \.fbx character"):
        save(gesturing(5), tmp_path / "a.fbx", avatar=tmp_path / "a.glb")
    assert not (tmp_path / "a.fbx").exists()


def test_an_fbx_character_is_drawn_and_written_as_glb(ours, tmp_path):
    assert len(load_avatar(ours).rig.bones) == 55
    with pytest.warns(UserWarning, match="clip"):
        save(gesturing(5), tmp_path / "a.glb", avatar=ours)
    np.testing.assert_allclose(load(tmp_path / "a.glb").positions(), gesturing(5).positions(), atol=1e-5)


def test_a_file_beyond_four_gibibytes_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(node_writer, "_MOST", 100_000)
    with pytest.raises(InputError, match="4 GiB"):
        save(gesturing(5), tmp_path / "a.fbx")
    assert not (tmp_path / "a.fbx").exists()
