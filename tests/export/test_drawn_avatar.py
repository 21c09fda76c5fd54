"""Somebody's character in pictures: its body, face, textures and holes, against our mannequin and against colours by hand."""

from __future__ import annotations

import base64
import io

import numpy as np
import pytest
from PIL import Image

from cospeech.errors import InputError
from cospeech.export import save
from cospeech.export.avatar_character import load_character
from cospeech.export.glb_container import split_glb
from cospeech.export.gltf_build import GltfBuilder
from cospeech.export.mannequin.character import skin
from cospeech.export.pictures import render_motion
from cospeech.export.render import raster
from cospeech.export.render.camera import find_view
from cospeech.export.render.frames import BACKDROP
from cospeech.export.render.framing import FramedPose, Framing, PoseStage, fit_view
from cospeech.export.render.scene import Scene
from cospeech.motion.motion import Motion
from cospeech.motion.rotations import axis_angle_to_quat
from cospeech.motion.skeleton import humanoid
from cospeech.motion.skeletons.arkit import ARKIT_INDEX
from tests.export.test_avatar import as_vrm0, as_vrm1, hanging_arms, no_change, rewrite
from tests.support.motions import gesturing, stand_in


@pytest.fixture
def still(tmp_path):
    """Our small figure as a character without animation."""
    path = tmp_path / "still.glb"
    save(gesturing(1), path, character=stand_in())
    rewrite(path, path, lambda document: document.pop("animations"))
    return path


def rewrite_to(source, target, change):
    rewrite(source, target, change)
    return target


def picture(character, motion, view="face", size=96):
    """The first frame, (size, size, 3)."""
    pose = FramedPose(*(values[0] for values in PoseStage(character.skeleton, motion.fps).place(motion)))
    [(_, box)] = [*(framing := Framing(find_view(view), character.skeleton, 30)).push(pose), *framing.flush()]
    camera = find_view(view).camera(box[:3], box[3:], size, size)
    return Scene(character, size, size, BACKDROP).draw(camera, pose.rotations, pose.positions, pose.face)


def of_head(path):
    """Mean colour of the middle of the head, 8-bit sRGB."""
    return picture(load_character(path), gesturing(1))[40:56, 40:56].reshape(-1, 3).mean(0)


def png(colour, size=(4, 4)) -> str:
    out = io.BytesIO()
    Image.new("RGBA", size, colour).save(out, "PNG")
    return "data:image/png;base64," + base64.b64encode(out.getvalue()).decode()


def with_texture(uri, **material):
    """A change of the document: white heads with that texture; all places of it are (0, 0)."""

    def change(document):
        document["images"], document["textures"] = [{"uri": uri}], [{"source": 0}]
        for entry in document["materials"]:
            entry["pbrMetallicRoughness"] |= {"baseColorFactor": [1, 1, 1, 1], "baseColorTexture": {"index": 0}}
            entry |= material

    return change


@pytest.mark.parametrize("change", [no_change, hanging_arms, as_vrm0])
def test_a_character_of_ours_comes_back_as_it_was(still, tmp_path, change):
    """Whatever names, units, axes, rest pose and facing the file has."""
    character, ours = load_character(rewrite_to(still, tmp_path / "theirs.glb", change)), stand_in()
    assert character.skeleton.names == humanoid().names
    assert character.skeleton.offsets[1:] == pytest.approx(humanoid().offsets[1:], abs=2e-3)
    lift = character.skeleton.tpose[0] - humanoid().tpose[0]
    motion = gesturing(20)
    positions, rotations = humanoid().forward(motion.rotations[10], motion.root[10])
    their_motion = motion.retarget(character.skeleton)
    theirs = character.skeleton.forward(their_motion.rotations[10], their_motion.root[10])
    expected = np.concatenate(skin(ours, rotations, positions))
    got = np.concatenate(skin(character, theirs[1], theirs[0]))
    if change is not hanging_arms:  # there the surface of the arms was not modelled for that rest
        shift = (got - expected).mean(0)
        assert np.abs(got - expected - shift).max() < 4e-3
        assert np.abs(shift - lift).max() < 0.02
    assert len(got) == len(expected)


@pytest.mark.slow
def test_pictures_of_the_mannequin_as_an_avatar_are_those_of_the_mannequin(tmp_path):
    motion = gesturing(2)
    motion.save(tmp_path / "me.glb")
    for name, options in (("a", {}), ("b", {"avatar": tmp_path / "me.glb"})):
        render_motion(motion, tmp_path / f"{name}.png", size=(400, 200), camera="body", **options)
    first, second = (np.asarray(Image.open(tmp_path / f"{name}.png")).astype(int) for name in "ab")
    assert np.abs(first - second).mean() < 0.2
    assert (np.abs(first - second).max(2) > 24).mean() < 0.005


@pytest.mark.parametrize("change", [no_change, as_vrm1, as_vrm0])
def test_faces_of_every_alphabet_move(still, tmp_path, change):
    character = load_character(rewrite_to(still, tmp_path / "theirs.glb", change))
    face = np.zeros(52)
    face[ARKIT_INDEX["jawOpen"]] = 1
    pose = humanoid().forward(gesturing(1).rotations[0], gesturing(1).root[0])
    rest, open_jaw = (np.concatenate(skin(character, pose[1], pose[0], weights)) for weights in (np.zeros(52), face))
    moving = np.abs(open_jaw - rest).max(1) > 1e-4
    assert 0 < moving.sum() < len(moving) / 2
    assert (open_jaw - rest)[moving, 1].max() < 0  # down


def test_what_moves_with_a_bone_that_is_not_ours_goes_with_the_nearest_that_is(still, tmp_path):
    def with_ribbon(document):
        head = humanoid().index["head"]
        document["nodes"].append({"name": "ribbon", "translation": [0, 0.1, -0.1]})
        document["nodes"][head].setdefault("children", []).append(len(document["nodes"]) - 1)
        for skin_entry in document["skins"]:
            skin_entry["joints"][head] = len(document["nodes"]) - 1

    character = load_character(rewrite_to(still, tmp_path / "theirs.glb", with_ribbon))
    assert humanoid().index["head"] in character.parts[0].joints[:, 0]


def test_fingers_that_are_missing_leave_the_hand(still, tmp_path):
    def without_fingers(document):
        for node in document["nodes"][:55]:
            if any(word in node["name"] for word in ("Thumb", "Index", "Middle", "Ring", "Little", "Eye", "jaw", "Toes")):
                node["name"] = f"extra {node['name']}"

    character = load_character(rewrite_to(still, tmp_path / "theirs.glb", without_fingers))
    motion = gesturing(3).retarget(character.skeleton)
    positions, rotations = character.skeleton.forward(motion.rotations[2], motion.root[2])
    assert all(np.isfinite(part).all() for part in skin(character, rotations, positions))
    assert character.skeleton.offsets == pytest.approx(humanoid().offsets, abs=0.05)


def test_textures_give_the_colour(still, tmp_path):
    red = of_head(rewrite_to(still, tmp_path / "a.glb", with_texture(png((255, 0, 0, 255)))))
    plain = of_head(rewrite_to(still, tmp_path / "b.glb", with_texture(png((255, 255, 255, 255)))))
    assert red[0] == pytest.approx(plain[0], abs=12)
    assert red[1:].max() < plain[1:].min() - 40  # what is left are the highlights


@pytest.mark.slow
@pytest.mark.parametrize(
    ("mode", "opacity", "share"), [("MASK", 100, 0.0), ("MASK", 140, 1.0), ("BLEND", 128, 0.5), ("OPAQUE", 0, 1.0)]
)
def test_one_sees_through_holes(still, tmp_path, mode, opacity, share):
    """A black head before the light backdrop: how dark the picture is tells how much of it is there."""
    with_hole = of_head(rewrite_to(still, tmp_path / "a.glb", with_texture(png((0, 0, 0, opacity)), alphaMode=mode))).mean()
    black = of_head(rewrite_to(still, tmp_path / "b.glb", with_texture(png((0, 0, 0, 255))))).mean()
    nothing = of_head(rewrite_to(still, tmp_path / "c.glb", with_texture(png((0, 0, 0, 0)), alphaMode="MASK"))).mean()
    linear = (np.array([with_hole, black, nothing]) / 255) ** 2.2
    assert (linear[2] - linear[0]) / (linear[2] - linear[1]) == pytest.approx(share, abs=0.2)


@pytest.mark.parametrize(
    "change", [no_change, with_texture(png((200, 120, 40, 255))), with_texture(png((200, 120, 40, 140)), alphaMode="BLEND")]
)
def test_pictures_do_not_depend_on_how_many_places_are_found_at_a_time(still, tmp_path, monkeypatch, change):
    character = load_character(rewrite_to(still, tmp_path / "a.glb", change))
    whole = picture(character, gesturing(1))
    monkeypatch.setattr(raster, "_CHUNK", 100)
    assert np.array_equal(picture(character, gesturing(1)), whole)


def test_backs_are_seen_where_the_material_says_so(still, tmp_path):
    def double(document):
        for entry in document["materials"]:
            entry["doubleSided"] = True

    assert len(load_character(rewrite_to(still, tmp_path / "a.glb", double)).parts) == 2 * len(load_character(still).parts)


def bomb() -> str:
    """A PNG of 30,000 × 30,000 pixels in some 100 kB."""
    out = io.BytesIO()
    Image.new("1", (30_000, 30_000)).save(out, "PNG")
    return "data:image/png;base64," + base64.b64encode(out.getvalue()).decode()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("uri", "message"),
    [
        ("data:image/png;base64," + base64.b64encode(b"\x89PNG\r\n\x1a\n garbage").decode(), "no PNG or JPEG"),
        ("data:image/png;base64,%%%", "not base64"),
        ("../../etc/passwd", "one .glb file"),
        (bomb, "pixels"),
        (png((1, 2, 3, 4))[:80], "base64|no PNG"),
    ],
)
def test_hostile_textures_are_refused_in_a_line(still, tmp_path, uri, message):
    path = rewrite_to(still, tmp_path / "a.glb", with_texture(uri() if callable(uri) else uri))
    with pytest.raises(InputError, match=message) as error:
        load_character(path)
    assert "\n" not in str(error.value)


def far_vertex(document):
    document["nodes"][next(k for k, n in enumerate(document["nodes"]) if n.get("name") == "body")] |= {"scale": [1e4] * 3}
    document["nodes"][next(k for k, n in enumerate(document["nodes"]) if n.get("name") == "body")].pop("skin")


def no_mesh(document):
    for node in document["nodes"]:
        node.pop("mesh", None)


def require_draco(document):
    document["extensionsRequired"] = ["KHR_draco_mesh_compression"]


def wrong_corner(document):
    primitive = document["meshes"][0]["primitives"][0]
    primitive["attributes"]["POSITION"] = document["meshes"][-1]["primitives"][0]["indices"]


def wrong_joint(document):
    document["skins"][0]["joints"] = document["skins"][0]["joints"][:3]


@pytest.mark.parametrize("change", [far_vertex, no_mesh, require_draco, wrong_corner, wrong_joint])
def test_damaged_characters_are_refused_in_a_line(still, tmp_path, change):
    path = rewrite_to(still, tmp_path / "a.glb", change)
    with pytest.raises(InputError) as error:
        load_character(path)
    assert "\n" not in str(error.value)


@pytest.mark.slow
def test_damage_of_any_kind_ends_in_a_line(still, tmp_path):
    rng = np.random.default_rng(5)
    document, data = split_glb(rewrite_to(still, tmp_path / "a.glb", with_texture(png((9, 9, 9, 9)))).read_bytes(), "'a'")
    for trial in range(40):
        spoilt = bytearray(data)
        for place in rng.integers(0, len(spoilt), 30):
            spoilt[place] = rng.integers(256)
        path = tmp_path / f"{trial}.glb"
        with path.open("wb") as out:
            GltfBuilder(document, bytes(spoilt)).write(out)
        message = ""
        try:
            assert load_character(path).parts
        except InputError as error:
            message = str(error)
        assert "\n" not in message


def bowing(frames=300, fps=30.0):
    """Somebody who bows deeply and comes up again, and leans to a side."""
    motion = gesturing(frames, fps)
    rotations, index, t = motion.rotations.copy(), humanoid().index, np.arange(frames) / fps
    bow = np.where((t > 3) & (t < 6), np.sin((t - 3) / 3 * np.pi) ** 2, 0)
    for name in ("spine", "chest", "upperChest"):
        rotations[:, index[name]] = axis_angle_to_quat((1, 0, 0), 0.4 * bow)
    root = motion.root + np.stack([0.3 * np.sin(0.6 * t), 0 * t, 0 * t], 1)
    return Motion(fps=fps, rotations=rotations, root=root, face=motion.face)


def frame_poses(motion, view, pieces=1):
    stage, framing, frames = PoseStage(humanoid(), motion.fps), Framing(view, humanoid(), motion.fps), []
    for piece in range(pieces):
        part = motion[len(motion) * piece // pieces : len(motion) * (piece + 1) // pieces]
        for pose in map(FramedPose, *stage.place(part)):
            frames += framing.push(pose)
    return [*frames, *framing.flush()]


@pytest.mark.slow
def test_the_face_camera_follows_the_head():
    motion, view = bowing(), find_view("face")
    frames = frame_poses(motion, view)
    assert len(frames) == len(motion)
    head = humanoid().index["head"]
    for pose, box in frames:
        skull = pose.positions[head] + np.array([0.0, 0.08, 0.0])  # near enough at any tilt
        x, y, inverse = view.camera(box[:3], box[3:], 100, 100).project(skull[None])[0]
        assert inverse > 0
        assert 25 < x < 75
        assert 20 < y < 80
    middles = np.array([(box[:3] + box[3:]) / 2 for _, box in frames])
    sizes = np.array([box[3:] - box[:3] for _, box in frames])
    assert np.ptp(middles[:, 1]) > 0.15  # it goes down with the bow
    assert np.abs(np.diff(middles, 2, axis=0)).max() < 0.003  # without jerks
    assert sizes.max() < 0.75


@pytest.mark.parametrize("pieces", [3, 50])
def test_the_face_camera_does_not_depend_on_pieces(pieces):
    motion, view = bowing(200), find_view("face")
    for (_, one), (_, other) in zip(frame_poses(motion, view), frame_poses(motion, view, pieces), strict=True):
        assert np.array_equal(one, other)


def test_shared_avatars_are_drawn(shared_folder, tmp_path):
    """Each stands where the camera looks, in more than one colour, and none fills the picture."""
    for name in ("Godette_vrm_v4_CC-BY-3.0.vrm", "KayKit_Mage_CC0.glb", "avatar_mpfb_female_arkit52_viseme15.glb"):
        path = shared_folder / "data" / "avatars" / name
        render_motion(gesturing(2), tmp_path / "a.png", size=(360, 240), camera="full", avatar=path)
        pixels = np.asarray(Image.open(tmp_path / "a.png")).astype(int)
        figure = (np.abs(np.diff(pixels, axis=1)).max(2) > 20).mean()
        assert 0.01 < figure < 0.5
        character = load_character(path)
        feet = min(float(part.vertices[:, 1].min()) for part in character.parts)
        assert -0.05 < feet < 0.02
        view = fit_view(find_view("face"), character)
        assert view.low[1] < character.skeleton.tpose[humanoid().index["head"], 1] < view.high[1]


@pytest.mark.slow
def test_a_film_of_an_avatar_is_the_same_by_helpers(still, tmp_path, monkeypatch):
    motion = gesturing(30)
    for name in ("a", "b"):
        render_motion(motion, tmp_path / f"{name}.gif", size=(64, 64), avatar=still)
        monkeypatch.setattr("cospeech.export.render.frames._ALONE", 99)
    assert (tmp_path / "a.gif").read_bytes() == (tmp_path / "b.gif").read_bytes()
