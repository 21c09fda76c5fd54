"""GLB and VRMA: what is written is read back, in pieces or at once; how curves are sampled; how strictly files are read."""

from __future__ import annotations

import base64
import io
import json
import struct
import tracemalloc

import numpy as np
import pytest

import cospeech
from cospeech.errors import InputError
from cospeech.export import load, open_writer, save
from cospeech.export.glb_container import split_glb
from cospeech.export.gltf import GltfFile, read_glb
from cospeech.export.gltf_build import GltfBuilder
from cospeech.export.tracks import Curve, clock_of
from cospeech.export.visemes import MOODS, oculus_visemes, vrm_presets
from cospeech.motion.motion import Motion
from cospeech.motion.rotations import axis_angle_to_quat, quat_angle, quat_slerp
from cospeech.motion.skeleton import humanoid
from cospeech.motion.skeletons.arkit import ARKIT, ARKIT_INDEX
from tests.support.motions import gesturing, stand_in


def small(suffix: str) -> dict:
    """Options that make a format's file small."""
    return {"character": stand_in()} if suffix == ".glb" else {}


@pytest.mark.parametrize("suffix", [".glb", ".vrma", ".fbx"])
@pytest.mark.parametrize("fps", [1, 8])
def test_few_frames_per_second_keep_their_rate(tmp_path, suffix, fps):
    path = tmp_path / f"a{suffix}"
    save(gesturing(12, fps), path, **small(suffix))
    back = load(path)
    assert (back.fps, len(back)) == (fps, 12)


@pytest.mark.parametrize(("fps", "frames"), [(24, 50_850), (30, 34_898), (120, 34_898), (60, 648_000), (30000 / 1001, 323_676)])
def test_long_motion_keeps_its_last_frame(fps, frames):
    """Times are float32: that of the last frame may be rounded down."""
    times = (np.arange(frames) / fps).astype(np.float32).astype(float)
    curve = Curve(times, np.zeros((frames, 1)), "LINEAR", False)
    file = GltfFile({}, b"", "long", size=1 << 30)
    rate, back = clock_of({(0, "translation"): curve}, file, len(humanoid()))
    assert (rate, len(back)) == (fps, frames)


@pytest.mark.slow
@pytest.mark.parametrize("suffix", [".glb", ".vrma"])
@pytest.mark.parametrize("fps", [15, 30, 30000 / 1001, 60])
@pytest.mark.parametrize("frames", [1, 2, 31, 1500])
def test_round_trip(tmp_path, suffix, fps, frames):
    motion = gesturing(frames, fps)
    path = tmp_path / f"a{suffix}"
    save(motion, path, **small(suffix))
    back = load(path)
    assert (len(back), back.skeleton.names) == (frames, humanoid().names)
    assert frames == 1 or back.fps == pytest.approx(fps, rel=1e-9)
    assert quat_angle(back.rotations, motion.rotations).max() < 1e-5
    np.testing.assert_allclose(back.root, motion.root, atol=1e-6)
    shapes = ARKIT if suffix == ".vrma" else ("jawOpen", "eyeBlinkLeft", "tongueOut", "browInnerUp", "mouthPucker")
    for name in shapes:  # all 52 targets are there, also those that move nothing
        np.testing.assert_allclose(back.face[:, ARKIT_INDEX[name]], motion.face[:, ARKIT_INDEX[name]], atol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("suffix", [".glb", ".vrma", ".npz"])
def test_pieces_make_the_same_bytes(tmp_path, suffix):
    motion = gesturing(2500)
    whole, pieces = tmp_path / f"a{suffix}", tmp_path / f"b{suffix}"
    save(motion, whole, **small(suffix))
    with open_writer(pieces, skeleton=motion.skeleton, fps=motion.fps, **small(suffix)) as writer:
        for first, last in ((0, 1), (1, 1), (1, 1024), (1024, 1100), (1100, 2500)):
            part = motion[first:last]
            opposite = Motion(fps=30, rotations=-part.rotations, root=part.root, face=part.face)  # the same rotations
            writer.write(opposite if first == 1024 and suffix != ".npz" else part)
    assert whole.read_bytes() == pieces.read_bytes()


@pytest.mark.parametrize("suffix", [".glb", ".vrma", ".npz", ".csv", ".json"])
def test_nothing_is_left_behind_on_failure(tmp_path, suffix):
    def interrupt() -> None:
        motion = gesturing(10)
        with open_writer(tmp_path / f"a{suffix}", skeleton=motion.skeleton, fps=30) as writer:
            writer.write(motion)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupt()
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("suffix", [".glb", ".vrma"])
def test_no_frames_is_an_error(tmp_path, suffix):
    with pytest.raises(InputError, match="no motion"):
        save(gesturing(3)[:0], tmp_path / f"a{suffix}", **small(suffix))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_long_motion_does_not_sit_in_memory(tmp_path):
    """25 minutes are 17 MB of moving tracks here; the writer may hold a block of them."""
    piece, path = gesturing(900), tmp_path / "a.glb"
    tracemalloc.start()
    with open_writer(path, skeleton=piece.skeleton, fps=30, character=stand_in()) as writer:
        for _ in range(50):
            writer.write(piece)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert path.stat().st_size > 17e6
    assert peak < 12e6


def test_constant_tracks_have_one_key(tmp_path):
    still = gesturing(1)
    motion = Motion(
        fps=30, rotations=np.repeat(still.rotations, 90, 0), root=np.repeat(still.root, 90, 0), face=np.zeros((90, 52))
    )
    save(motion, tmp_path / "a.glb", character=stand_in())
    file = read_glb(tmp_path / "a.glb")
    animation = file.json["animations"][0]
    counts = [file.json["accessors"][s["input"]]["count"] for s in animation["samplers"]]
    assert counts == [90] + [1] * (len(counts) - 1)
    back = load(tmp_path / "a.glb")
    assert len(back) == 90
    assert quat_angle(back.rotations, motion.rotations).max() < 1e-5


def test_mannequin_is_small_and_complete(tmp_path):
    save(gesturing(1), tmp_path / "a.glb")
    file = read_glb(tmp_path / "a.glb")
    assert (tmp_path / "a.glb").stat().st_size <= 2_000_000
    assert len(file.json["skins"]) == 1
    (face,) = [mesh for mesh in file.json["meshes"] if "extras" in mesh]
    assert face["extras"]["targetNames"] == list(ARKIT)
    assert all(len(primitive["targets"]) == 52 for primitive in face["primitives"])


def test_vrma_follows_its_specification(tmp_path):
    """Translation on the hips only, no eyes, no scale, identity rests, feet on the floor, X of the expression nodes."""
    save(gesturing(20), tmp_path / "a.vrma")
    file = read_glb(tmp_path / "a.vrma")
    extension = file.json["extensions"]["VRMC_vrm_animation"]
    bones = {name: entry["node"] for name, entry in extension["humanoid"]["humanBones"].items()}
    assert extension["specVersion"] == "1.0"
    assert set(bones) == set(humanoid().names) - {"leftEye", "rightEye"}
    expressions = {e["node"] for kind in extension["expressions"].values() for e in kind.values()}
    channels = [(c["target"]["node"], c["target"]["path"]) for c in file.json["animations"][0]["channels"]]
    assert {node for node, path in channels if path == "translation"} == {bones["hips"]} | expressions
    assert {node for node, path in channels if path == "rotation"} == {*bones.values(), extension["lookAt"]["node"]}
    assert all("rotation" not in node and "scale" not in node for node in file.json["nodes"])
    assert set(extension["expressions"]["preset"]) == {"aa", "ih", "ou", "ee", "oh", "blink", "blinkLeft", "blinkRight", *MOODS}
    assert set(extension["expressions"]["custom"]) == {name for name in ARKIT if not name.startswith("eyeLook")}


@pytest.mark.parametrize("options", [{}, {"presets": False}, {"arkit": False}])
def test_vrma_says_the_gaze_once(tmp_path, options):
    """A player adds eyeLook* to lookAt where an avatar has both. So a clip has one of them, and we read both from either."""
    motion = gesturing(60)
    for look_at in (True, False):
        save(motion, tmp_path / "a.vrma", look_at=look_at, **options)
        extension = read_glb(tmp_path / "a.vrma").json["extensions"]["VRMC_vrm_animation"]
        looks = [name for name in extension["expressions"].get("custom", {}) if name.startswith("eyeLook")]
        assert ("lookAt" in extension, len(looks)) == (look_at, 0 if look_at or "arkit" in options else 8)
        back = load(tmp_path / "a.vrma")
        if look_at or looks:
            assert quat_angle(back.rotations, motion.rotations).max() < 1e-5
            columns = [ARKIT_INDEX[name] for name in ARKIT if name.startswith("eyeLook")]
            np.testing.assert_allclose(back.face[:, columns], motion.face[:, columns], atol=1e-5)


def test_a_face_that_was_recorded_alone_keeps_its_gaze_as_vrma(tmp_path):
    """Its eyes rest, and its eyeLook* tell where it looks."""
    motion = gesturing(60)
    still = Motion(fps=30, rotations=np.tile([0.0, 0, 0, 1], (60, len(humanoid()), 1)), root=motion.root, face=motion.face)
    save(still, tmp_path / "a.vrma")
    eye = humanoid().index["leftEye"]
    assert quat_angle(load(tmp_path / "a.vrma").rotations[:, eye], motion.rotations[:, eye]).max() < 1e-5


def test_presets_are_modest():
    """The vowels never add up to more than one; lids close once; a closed smile says nothing; a dropped jaw says "aa"."""
    rng = np.random.default_rng(0)
    face = np.concatenate([rng.uniform(0, 1, (3000, 52)), np.eye(52)])
    presets, visemes = vrm_presets(face), oculus_visemes(face)
    assert sum(presets[v] for v in ("aa", "ih", "ou", "ee", "oh")).max() <= 1 + 1e-9
    assert sum(visemes.values()) == pytest.approx(np.ones(len(face)))
    for weights in (*presets.values(), *visemes.values()):
        assert weights.min() >= 0
    np.testing.assert_allclose(presets["blink"] + presets["blinkLeft"], face[:, ARKIT_INDEX["eyeBlinkLeft"]])
    smile = np.zeros((1, 52))
    smile[0, [ARKIT_INDEX["mouthSmileLeft"], ARKIT_INDEX["mouthSmileRight"]]] = 1
    assert sum(vrm_presets(smile)[v].sum() for v in ("aa", "ih", "ou", "ee", "oh")) == 0
    jaw = np.zeros((1, 52))
    jaw[0, ARKIT_INDEX["jawOpen"]] = 0.8
    assert vrm_presets(jaw)["aa"] == 1


@pytest.mark.parametrize(
    ("emotion", "mood"),
    [("happiness", "happy"), ("anger", "angry"), ("sadness", "sad"), ("surprise", "surprised"), ("fear", "surprised"),
     ("disgust", "angry"), ("neutral", None)],
)  # fmt: skip
def test_an_emotion_is_a_mood_of_avatars_that_have_presets_alone(emotion, mood):
    speech = cospeech.Speech(np.random.default_rng(0).normal(0, 0.1, 3 * 16_000).astype(np.float32), 16_000)
    presets = vrm_presets(cospeech.load("rules").generate(speech, emotion=emotion, parts=["face"]).face)
    weights = {name: np.median(presets[name]) for name in MOODS}
    others = [weight for name, weight in weights.items() if name != mood]
    assert max(others) < 0.2
    assert mood is None or weights[mood] > max(0.25, max(others) + 0.1)


def test_curves_are_sampled_as_the_specification_says():
    keys, at = np.array([0.0, 1.0, 3.0]), np.array([-1.0, 0.0, 0.25, 1.0, 2.0, 2.999, 3.0, 9.0])
    values = np.array([[0.0], [4.0], [0.0]])
    np.testing.assert_allclose(Curve(keys, values, "LINEAR", False).at(at)[:, 0], [0, 0, 1, 4, 2, 0.002, 0, 0], atol=1e-9)
    np.testing.assert_allclose(Curve(keys, values, "STEP", False).at(at)[:, 0], [0, 0, 0, 4, 4, 4, 0, 0])
    # f = t³ with its own derivatives as tangents is met exactly by a cubic spline
    cubic = np.stack([3 * keys**2, keys**3, 3 * keys**2], 1).reshape(-1, 1)
    np.testing.assert_allclose(Curve(keys, cubic, "CUBICSPLINE", False).at(at)[:, 0], np.clip(at, 0, 3) ** 3, atol=1e-9)
    a, b = axis_angle_to_quat((0, 1, 0), 0.2), -axis_angle_to_quat((0, 1, 0), 1.8)  # the short way round
    rotation = Curve(np.array([0.0, 1.0]), np.stack([a, b]), "LINEAR", True).at(np.array([0.25]))
    assert quat_angle(rotation, quat_slerp(a, -b, 0.25)[None]).max() < 1e-9


def document(accessor: dict, views: list[dict], data: bytes, **more: object) -> GltfFile:
    base = {"asset": {"version": "2.0"}, "buffers": [{"byteLength": len(data)}], "bufferViews": views, "accessors": [accessor]}
    return GltfFile(base | more, data, "'test'")


def test_accessors_of_all_kinds():
    ints = np.arange(12, dtype="<i2").reshape(3, 4)
    view = {"buffer": 0, "byteOffset": 4, "byteLength": 24}
    plain = {"bufferView": 0, "componentType": 5122, "count": 3, "type": "VEC4"}
    np.testing.assert_array_equal(document(plain, [view], b"....%b" % ints.tobytes()).accessor(0, 4), ints)
    shares = document(plain | {"normalized": True}, [view], b"....%b" % ints.tobytes()).accessor(0, 4)
    np.testing.assert_allclose(shares, ints / 32767, rtol=1e-6)
    rows = np.zeros((3, 8), "<f4")
    rows[:, 1:4] = np.arange(9).reshape(3, 3)
    view = {"buffer": 0, "byteLength": 96, "byteStride": 32}
    entry = {"bufferView": 0, "byteOffset": 4, "componentType": 5126, "count": 3, "type": "VEC3"}
    got = document(entry, [view], rows.tobytes())
    np.testing.assert_array_equal(got.accessor(0, 3), rows[:, 1:4])


def test_sparse_accessors_and_empty_ones():
    builder = GltfBuilder({"asset": {"version": "2.0"}})
    displacements = np.zeros((700, 3), np.float32)
    displacements[[3, 650]] = [[1, 2, 3], [4, 5, 6]]
    dense = np.random.default_rng(0).normal(size=(70000, 3)).astype(np.float32)
    indices = [builder.add_sparse(a) for a in (displacements, np.zeros((5, 3)), dense)]
    out = io.BytesIO()
    builder.write(out)
    file = GltfFile(*split_glb(out.getvalue(), "'test'"), "'test'")
    for index, expected in zip(indices, (displacements, np.zeros((5, 3)), dense), strict=True):
        np.testing.assert_array_equal(file.accessor(index, 3), expected)
    empty = document({"componentType": 5126, "count": 4, "type": "VEC3"}, [], b"")
    np.testing.assert_array_equal(empty.accessor(0, 3), np.zeros((4, 3)))


@pytest.mark.parametrize(
    ("accessor", "view"),
    [
        ({"count": 4}, {}),
        ({"byteOffset": 4}, {}),
        ({"count": 1 << 40}, {}),
        ({"count": -1}, {}),
        ({"count": 2.5}, {}),
        ({"componentType": 77}, {}),
        ({"type": "VEC2"}, {}),
        ({"bufferView": 5}, {}),
        ({"bufferView": -1}, {}),
        ({}, {"byteLength": 1000}),
        ({}, {"byteOffset": 1 << 60}),
        ({}, {"byteStride": 1}),
        ({}, {"buffer": 3}),
        ({"sparse": {"count": 1, "indices": {"bufferView": 0, "componentType": 5123}, "values": {"bufferView": 9}}}, {}),
    ],
)
def test_accessors_beyond_their_data_are_refused(accessor, view):
    entry = {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"} | accessor
    with pytest.raises(InputError):
        document(entry, [{"buffer": 0, "byteLength": 36} | view], bytes(36)).accessor(0, 3)


def test_where_data_may_lie(tmp_path):
    data = np.arange(3, dtype="<f4").tobytes()
    entry, view = {"bufferView": 0, "componentType": 5126, "count": 1, "type": "VEC3"}, {"buffer": 0, "byteLength": 12}
    uri = "data:application/octet-stream;base64," + base64.b64encode(data).decode()
    file = document(entry, [view], b"", buffers=[{"byteLength": 12, "uri": uri}])
    np.testing.assert_array_equal(file.accessor(0, 3), [[0, 1, 2]])
    for bad in ("other.bin", "../../secret", "http://example.org/a.bin", "data:x;base64,!!!!", "file:///etc/passwd"):
        with pytest.raises(InputError):
            document(entry, [view], b"", buffers=[{"byteLength": 12, "uri": bad}]).accessor(0, 3)


@pytest.mark.parametrize(
    "nodes",
    [
        [{"children": [1]}, {"children": [0]}],
        [{"children": [0]}],
        [{"children": [2]}, {"children": [2]}, {}],
        [{"children": [7]}],
        [{"children": ["a"]}],
        [3],
    ],
)
def test_trees_that_are_none_are_refused(nodes):
    with pytest.raises(InputError):
        GltfFile({"asset": {"version": "2.0"}, "nodes": nodes}, b"", "'test'")


def test_containers_that_are_broken(tmp_path):
    save(gesturing(2), tmp_path / "a.glb", character=stand_in())
    good = (tmp_path / "a.glb").read_bytes()
    bad = [b"", b"glTF", good[:19], good[:100], good[:-50], b"BVH" + good[3:], good[:4] + struct.pack("<I", 1) + good[8:]]
    bad += [good[:12] + struct.pack("<I", 1 << 31) + good[16:], b"{}", b"[]", b"{" * 5000, b'{"asset": {"version": "1.0"}}']
    for k, data in enumerate(bad):
        path = tmp_path / f"{k}.glb"
        path.write_bytes(data)
        with pytest.raises(InputError) as refusal:
            load(path)
        assert "\n" not in str(refusal.value)


def test_character_without_animation_says_so(tmp_path):
    save(gesturing(2), tmp_path / "a.glb", character=stand_in())
    file = read_glb(tmp_path / "a.glb")
    del file.json["animations"]
    builder = GltfBuilder(json.loads(json.dumps(file.json)), file.buffer(0))
    with (tmp_path / "b.glb").open("wb") as out:
        builder.write(out)
    with pytest.raises(InputError, match="no animation"):
        load(tmp_path / "b.glb")
    (tmp_path / "c.vrma").write_bytes((tmp_path / "a.glb").read_bytes())
    with pytest.raises(InputError, match="no VRM animation"):
        load(tmp_path / "c.vrma")
