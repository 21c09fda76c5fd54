"""The mannequin: sound geometry, weights, 52 expressions that do what they say, poses that hold their shape."""

from pathlib import Path

import numpy as np
import pytest
from build_mannequin import digest_sources
from mannequin.volume import body_volume

from cospeech.export import mannequin
from cospeech.export.mannequin.asset import save
from cospeech.motion.rotations import axis_angle_to_quat, quat_identity
from cospeech.motion.skeletons.arkit import ARKIT, ARKIT_INDEX

ASSET = Path(__file__).parents[2] / "src" / "cospeech" / "assets" / "mannequin.npz"
CLOSED = ("hair", "leftHand", "rightHand", "leftShoe", "rightShoe", "leftSole", "rightSole", "tongue", "face", "ears")
PAIRS = (("leftHand", "rightHand"), ("leftEye", "rightEye"), ("leftShoe", "rightShoe"), ("leftSole", "rightSole"))


@pytest.fixture(scope="module")
def character():
    return mannequin.build()


def pose_character(character, face=None, **turns):
    """Vertices by part of a pose given as joint → (axis, degrees)."""
    skeleton = character.skeleton
    local = quat_identity(len(skeleton))
    for name, (axis, degrees) in turns.items():
        local[skeleton.index[name]] = axis_angle_to_quat(np.array(axis, float), np.radians(degrees))
    positions, world = skeleton.forward(local, skeleton.offsets[0])
    vertices = mannequin.skin(character, world, positions, face)
    return {p.name: v for p, v in zip(character.parts, vertices, strict=True)}, positions


def volume(vertices, triangles):
    a, b, c = (vertices[triangles[:, k]].astype(float) for k in range(3))
    return np.einsum("fi,fi->f", a, np.cross(b, c)).sum() / 6


def landmark(character, name, where):
    """The face's vertex nearest to a point given in the frame of the head joint."""
    part = character[name]
    head = character.skeleton.tpose[character.skeleton.index["head"]]
    return int(np.argmin(np.linalg.norm(part.vertices - head - where, axis=1)))


def test_parts_are_sound(character):
    for part in character.parts:
        v, t = part.vertices, part.triangles
        assert np.isfinite(v).all()
        assert np.isfinite(part.normals).all()
        assert t.min() >= 0
        assert t.max() < len(v)
        assert len(np.unique(t)) == len(v), f"{part.name} has points that no triangle uses"
        np.testing.assert_allclose(part.weights.sum(1), 1, atol=1e-5)
        assert part.weights.min() >= 0
        assert part.joints.max() < len(character.skeleton)
        assert part.colour.min() >= 0
        assert part.colour.max() <= 1
        lengths = np.linalg.norm(part.normals, axis=1)
        assert np.mean(np.abs(lengths - 1) < 1e-3) > 0.99
        areas = np.linalg.norm(np.cross(v[t[:, 1]] - v[t[:, 0]], v[t[:, 2]] - v[t[:, 0]]), axis=1) / 2
        assert np.mean(areas < 1e-10) < 0.012, f"{part.name}: {np.sum(areas < 1e-10)} triangles without area"


def test_normals_agree_with_the_winding(character):
    for part in character.parts:
        a, b, c = (part.vertices[part.triangles[:, k]] for k in range(3))
        face = np.cross(b - a, c - a)
        size = np.linalg.norm(face, axis=1)
        mean = part.normals[part.triangles].mean(1)
        agree = np.einsum("fi,fi->f", face, mean) > 0
        assert np.mean(agree[size > 1e-8]) > 0.97, part.name


def test_closed_parts_have_positive_volume_and_matched_edges(character):
    for name in CLOSED:
        part = character[name]
        assert volume(part.vertices - part.vertices.mean(0), part.triangles) > 0, name
    for name in ("face", "tongue", "leftShoe", "leftHand", "ears"):
        t = character[name].triangles
        edges = np.concatenate([t[:, [0, 1]], t[:, [1, 2]], t[:, [2, 0]]])
        there = {tuple(e) for e in edges.tolist()}
        lonely = sum((b, a) not in there for a, b in there)
        assert lonely == 0, f"{name} has {lonely} open edges"


def test_mirror_symmetry(character):
    flip = np.array([-1, 1, 1], np.float32)
    for left, right in PAIRS[:1] + PAIRS[2:]:
        np.testing.assert_allclose(character[left].vertices * flip, character[right].vertices, atol=1e-5)
    for name in ("face", "brows", "ears", "shirt", "trousers", "upperTeeth"):
        v = character[name].vertices
        gaps = [np.min(np.linalg.norm(v - p, axis=1)) for p in (v * flip)[::7]]
        assert max(gaps) < 1.5e-3, name


def test_budget_and_bounds(character):
    triangles = sum(len(p.triangles) for p in character.parts)
    assert triangles <= 16_000
    everything = np.concatenate([p.vertices for p in character.parts])
    low, high = everything.min(0), everything.max(0)
    assert abs(low[1]) < 1e-3
    assert 1.70 < high[1] < 1.76
    assert abs(high[0] + low[0]) < 1e-4
    assert 1.7 < high[0] - low[0] < 1.85
    sparse = sum(12 * np.count_nonzero(d.any(1)) for p in character.parts for d in p.morphs.values())
    assert sparse < 400_000
    assert sum(len(p.vertices) for p in character.parts if p.morphs) <= 2_200


def test_building_is_cached(character):
    assert mannequin.build() is character


def test_the_kept_file_is_of_this_code():
    with np.load(ASSET) as asset:
        assert str(asset["sources"]) == digest_sources(), "run tools/build_mannequin.py"


def test_a_part_is_kept_as_it_was_sculpted(tmp_path, character):
    """Saving the parts again gives the same file; normals may be rounded otherwise."""
    save(character, tmp_path / "again.npz", "")
    with np.load(tmp_path / "again.npz") as again, np.load(ASSET) as asset:
        assert {*again.files} == {*asset.files}
        for name in {*asset.files} - {"sources"}:
            if name.endswith("normals"):  # they are rounded and made one long each time
                np.testing.assert_allclose(again[name].astype(int), asset[name].astype(int), atol=2, err_msg=name)
            else:
                np.testing.assert_array_equal(again[name], asset[name], err_msg=name)


def test_all_52_expressions_move_the_face(character):
    face = character["face"]
    assert set(face.morphs) == set(ARKIT)
    for name, delta in face.morphs.items():
        assert 0.0009 < np.linalg.norm(delta, axis=1).max() < 0.06, name
    twins = [n for n in ARKIT if n.endswith("Left") and n not in ("jawLeft", "mouthLeft")]
    for name in twins:
        left, right = face.morphs[name], face.morphs[name[:-4] + "Right"]
        assert np.abs(np.linalg.norm(left, axis=1).sum() / np.linalg.norm(right, axis=1).sum() - 1) < 1e-3
        distances = np.linalg.norm(left, axis=1)
        assert distances @ face.vertices[:, 0] > 0, f"{name} moves the wrong side"


@pytest.mark.parametrize(
    ("name", "where", "axis", "least"),
    [
        ("jawOpen", (0, -0.018, 0.088), 1, -0.018),
        ("jawForward", (0, -0.012, 0.092), 2, 0.005),
        ("jawLeft", (0, -0.012, 0.092), 0, 0.005),
        ("jawRight", (0, -0.012, 0.092), 0, -0.005),
        ("mouthSmileLeft", (0.024, 0.0165, 0.09), 1, 0.006),
        ("mouthSmileLeft", (0.024, 0.0165, 0.09), 0, 0.005),
        ("mouthFrownRight", (-0.024, 0.0165, 0.09), 1, -0.006),
        ("mouthStretchLeft", (0.024, 0.0165, 0.09), 0, 0.006),
        ("mouthDimpleLeft", (0.024, 0.0165, 0.09), 0, 0.004),
        ("mouthPucker", (0.024, 0.0165, 0.09), 0, -0.006),
        ("mouthFunnel", (0, 0.010, 0.105), 2, 0.004),
        ("mouthLeft", (0, 0.010, 0.105), 0, 0.006),
        ("mouthRight", (0, 0.010, 0.105), 0, -0.006),
        ("mouthShrugLower", (0, 0.010, 0.105), 1, 0.003),
        ("mouthShrugUpper", (0, 0.022, 0.105), 1, 0.002),
        ("mouthRollLower", (0, 0.008, 0.105), 2, -0.002),
        ("mouthRollUpper", (0, 0.0235, 0.105), 2, -0.002),
        ("mouthLowerDownLeft", (0.010, 0.010, 0.103), 1, -0.004),
        ("mouthUpperUpRight", (-0.010, 0.022, 0.103), 1, 0.004),
        ("browInnerUp", (0.014, 0.106, 0.09), 1, 0.006),
        ("browDownLeft", (0.014, 0.106, 0.09), 1, -0.004),
        ("browOuterUpLeft", (0.042, 0.106, 0.08), 1, 0.005),
        ("cheekPuff", (0.042, 0.018, 0.07), 0, 0.004),
        ("cheekSquintLeft", (0.038, 0.056, 0.08), 1, 0.003),
        ("noseSneerLeft", (0.013, 0.048, 0.10), 1, 0.002),
        ("eyeWideLeft", (0.031, 0.089, 0.09), 1, 0.002),
        ("eyeLookUpLeft", (0.031, 0.089, 0.09), 1, 0.001),
        ("eyeLookDownLeft", (0.031, 0.089, 0.09), 1, -0.003),
        ("eyeSquintLeft", (0.031, 0.075, 0.09), 1, 0.002),
    ],
)
def test_expressions_do_what_they_say(character, name, where, axis, least):
    delta = character["face"].morphs[name][landmark(character, "face", where)]
    assert delta[axis] * np.sign(least) > abs(least), delta


def lid_gap(face, head, weight):
    """Vertical distance of the lids' edges before the left pupil: the two vertices between which the eye is open."""
    neutral = face.vertices - head
    on_lid = np.linalg.norm(neutral - [0.031, 0.082, 0.072], axis=1) < 0.0182
    near = np.flatnonzero(on_lid & (np.abs(neutral[:, 0] - 0.031) < 0.002) & (neutral[:, 2] > 0.08))
    near = near[np.argsort(neutral[near, 1])]
    widest = int(np.argmax(np.diff(neutral[near, 1])))
    edges = (neutral + weight * face.morphs["eyeBlinkLeft"])[near[widest : widest + 2]]
    return edges[1, 1] - edges[0, 1]


def test_a_blink_closes_the_lids(character):
    face = character["face"]
    head = character.skeleton.tpose[character.skeleton.index["head"]]
    assert lid_gap(face, head, 0.0) > 0.010
    assert abs(lid_gap(face, head, 1.0)) < 0.0015
    for weight in (0.25, 0.5, 0.75, 1.0):  # and the lid stays on the ball
        v = face.vertices + weight * face.morphs["eyeBlinkLeft"] - head
        moving = np.linalg.norm(face.morphs["eyeBlinkLeft"], axis=1) > 1e-3
        moving &= np.abs(v[:, 0] - 0.031) < 0.0105
        radius = np.linalg.norm(v[moving] - [0.031, 0.082, 0.072], axis=1)
        assert radius.min() > (0.0158 if weight == 1.0 else 0.0146)  # the chord of a linear morph cuts in by 1 mm at most


def test_mouth_is_closed_in_neutral_and_at_jaw_open_with_mouth_close(character):
    face = character["face"]
    head = character.skeleton.tpose[character.skeleton.index["head"]]

    def gap(**weights):
        v = face.vertices + sum(w * face.morphs[k] for k, w in weights.items()) if weights else face.vertices
        line = np.flatnonzero((np.abs(face.vertices - head - [0, 0.0165, 0]) < [0.0005, 0.0004, 0.2]).all(1))
        line = line[face.vertices[line, 2] > 0.08]
        return np.ptp(v[line, 1])

    assert gap() < 5e-4
    assert gap(jawOpen=1) > 0.012
    assert gap(jawOpen=1, mouthClose=1) < 0.002


def test_teeth_and_tongue_follow_the_jaw_and_no_bone_doubles_it(character):
    jaw = character.skeleton.index["jaw"]
    for part in character.parts:
        assert not part.weights[part.joints == jaw].any()
    assert character["lowerTeeth"].morphs["jawOpen"][:, 1].max() < -0.004
    assert character["tongue"].morphs["tongueOut"][:, 2].max() > 0.02
    assert not character["upperTeeth"].morphs


def test_eyeballs_follow_the_eye_bones(character):
    aside, _ = pose_character(character, leftEye=((0, 1, 0), 25))
    flat, _ = pose_character(character)
    front = int(np.argmax(flat["leftEye"][:, 2]))
    assert aside["leftEye"][front, 0] - flat["leftEye"][front, 0] > 0.005
    assert np.array_equal(aside["face"], flat["face"])


def distance_to_segment(p, a, b):
    t = np.clip((p - a) @ (b - a) / ((b - a) @ (b - a)), 0, 1)
    return np.linalg.norm(p - a - t[:, None] * (b - a), axis=1)


@pytest.mark.parametrize("down", [45, 80])
def test_hanging_arms_keep_their_shape(character, down):
    turns = {"leftUpperArm": ((0, 0, 1), -down), "rightUpperArm": ((0, 0, 1), down), "leftLowerArm": ((0, 1, 0), -20)}
    parts, positions = pose_character(character, **turns)
    shirt, index = character["shirt"], character.skeleton.index
    arm = np.where(np.isin(shirt.joints, [index["leftUpperArm"], index["leftLowerArm"]]), shirt.weights, 0).sum(1) > 0.85
    shoulder, elbow, hand = (positions[index["left" + n]] for n in ("UpperArm", "LowerArm", "Hand"))
    v = parts["shirt"][arm]
    distance = np.minimum(distance_to_segment(v, shoulder, elbow), distance_to_segment(v, elbow, hand))
    assert distance.max() < 0.075
    assert np.percentile(distance, 2) > 0.026
    top = parts["shirt"][np.linalg.norm(parts["shirt"] - shoulder, axis=1) < 0.08]
    assert top[:, 1].max() > shoulder[1] + 0.02  # the shoulder does not cave in


def test_elbow_and_forearm_hold(character):
    shirt = character["shirt"]
    flat = volume(*cut(character, pose_character(character)[0]["shirt"]))
    with_bend = pose_character(character, leftLowerArm=((0, 1, 0), -100), rightLowerArm=((0, 1, 0), 100))[0]["shirt"]
    with_twist = pose_character(character, leftHand=((1, 0, 0), 80), rightHand=((1, 0, 0), -80))[0]["shirt"]
    assert len(shirt.vertices) == len(with_bend)
    for shape in (with_bend, with_twist):
        assert 0.9 < volume(*cut(character, shape)) / flat < 1.1


def cut(character, vertices):
    return vertices, character["shirt"].triangles


def test_fist_keeps_its_volume_and_reaches_the_palm(character):
    turns = {}
    for finger in ("Index", "Middle", "Ring", "Little"):
        for joint, angle in (("Proximal", 80), ("Intermediate", 95), ("Distal", 55)):
            turns[f"left{finger}{joint}"] = ((0, 0, 1), -angle)
    fist, positions = pose_character(character, **turns)
    flat, _ = pose_character(character)
    triangles = character["leftHand"].triangles
    wrist = positions[character.skeleton.index["leftHand"]]
    ratio = volume(fist["leftHand"] - wrist, triangles) / volume(flat["leftHand"] - wrist, triangles)
    assert 0.75 < ratio < 1.25
    assert fist["leftHand"][:, 0].max() - wrist[0] < 0.135


def test_normals_of_the_skin_are_unit(character):
    skeleton = character.skeleton
    positions, world = skeleton.forward(quat_identity(len(skeleton)), skeleton.offsets[0])
    face = np.zeros(len(ARKIT))
    face[ARKIT_INDEX["jawOpen"]] = face[ARKIT_INDEX["mouthSmileLeft"]] = 0.7
    vertices, normals = mannequin.skin_with_normals(character, world, positions, face)
    for part, v, n in zip(character.parts, vertices, normals, strict=True):
        expected = part.vertices + sum(0.7 * part.morphs[k] for k in ("jawOpen", "mouthSmileLeft") if k in part.morphs)
        np.testing.assert_allclose(v, expected, atol=2e-5)
        lengths = np.linalg.norm(n, axis=1)
        assert np.mean(np.abs(lengths - 1) < 1e-3) > 0.99


def test_neutral_skinning_gives_the_t_pose(character):
    parts, _ = pose_character(character)
    for part in character.parts:
        np.testing.assert_allclose(parts[part.name], part.vertices, atol=1e-5)


def test_body_volume_is_a_slim_adult(character):
    facts = body_volume(character)
    expected = {"hips": (0.175, 0.125), "waist": (0.15, 0.108), "chest": (0.165, 0.117), "upperChest": (0.18, 0.115)}
    for name, (width, depth) in expected.items():
        section = facts.sections[name]
        assert 0.8 * width < section.half_width < 1.08 * width, (name, section)
        assert 0.8 * depth < section.half_depth < 1.08 * depth, (name, section)
    centre, radii = np.array(facts.head.centre), np.array(facts.head.radii)
    np.testing.assert_allclose(centre, (0, 0.088, 0.004), atol=0.012)
    np.testing.assert_allclose(radii, (0.083, 0.123, 0.113), atol=0.012)


def test_shirts_of_further_persons_differ_and_nothing_else_does(character):
    mean = {}
    for shirt in range(6):
        for own, other in zip(character.parts, mannequin.build(shirt).parts, strict=True):
            if own.name not in ("shirt", "pocket"):
                assert all(
                    np.array_equal(getattr(own, name), getattr(other, name)) for name in ("vertices", "colour", "triangles")
                )
                continue
            before, after = np.asarray(own.colour), np.asarray(other.colour)
            white = before[:, 2] <= 1.25 * before[:, 0]
            assert np.array_equal(before[white], after[white])
            np.testing.assert_allclose(before.mean(1), after.mean(1), atol=1e-6)
            mean[own.name, shirt] = after[~white].mean(0)
    colours = np.array([colour for (name, _), colour in mean.items() if name == "shirt"])
    apart = np.linalg.norm(colours[:, None] - colours, axis=-1)[np.triu_indices(6, 1)]
    assert apart.min() > 0.05
