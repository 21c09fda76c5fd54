"""Attributes of style: what is measured obeys mirrors, still arms and slow motion; derived speakers differ in one attribute."""

from __future__ import annotations

import json
from dataclasses import astuple, replace

import numpy as np
import pytest

from cospeech.corpora import attributes
from cospeech.corpora.attributes import attributes_of, body_of, speaker_attributes
from cospeech.corpora.augment import mirror_clip, mirror_motion, mirror_points
from cospeech.corpora.beat import read as beat
from cospeech.corpora.clip import Clip, Dropped
from cospeech.corpora.derived_speakers import arm_joints, derive_clip, find_original, hold_motion, mean_poses
from cospeech.corpora.pats import read as pats
from cospeech.corpora.prepare import prepare
from cospeech.corpora.prepare.derive_speakers import plan_derivations
from cospeech.corpora.samples import load_stored_clips
from cospeech.corpora.store import Store
from cospeech.errors import InputError
from cospeech.motion.points import Points
from cospeech.motion.poses import POSES, find_pose
from cospeech.motion.rotations import axis_angle_to_quat, quat_angle, quat_multiply
from cospeech.motion.skeleton import Skeleton
from cospeech.motion.skeletons.pats import JOINTS
from cospeech.training.batch_loader import check_mirror
from cospeech.training.windows import Windows, is_mirror_image
from tests.corpora.test_prepare import moving, voice

FPS = 15.0


def person(seconds: float = 60, strokes: float = 30, size: float = 0.5, seed: int = 0) -> Points:
    """PATS' key points: the right wrist goes up and down so many times a minute, the left one a third as far."""
    t = np.arange(round(seconds * FPS)) / FPS
    values = np.zeros((len(t), len(JOINTS), 2))
    values[:] = np.random.default_rng(seed).normal(0, 40, (len(JOINTS), 2))
    for side, x, share in (("R", -170, 1.0), ("L", 165, 1 / 3)):
        values[:, JOINTS.index(f"{side}Shoulder")] = x, 0
        values[:, JOINTS.index(f"{side}Wrist")] = 1.2 * x, -250
        lift = size * 335 * share * np.maximum(np.sin(2 * np.pi * strokes / 60 * t), 0)
        values[:, JOINTS.index(f"{side}Wrist"), 1] += lift
        values[:, JOINTS.index(f"{side}HandIndex4")] = values[:, JOINTS.index(f"{side}Wrist")] + [0, -20]
    values[:, 0] = 0
    return Points(FPS, values + [640, -300], "pats")


def of(points: Points) -> attributes.Attributes:
    return attributes_of(points.values, JOINTS, points.fps)


def test_what_is_measured_is_what_was_put_in():
    measures = of(person(strokes=30, size=1.0))
    assert measures.rate == pytest.approx(2 * 30, rel=0.05), "up is a stroke, and down is another"
    lift = np.maximum(np.sin(np.linspace(0, 2 * np.pi, 1000, endpoint=False)), 0)
    assert measures.amplitude == pytest.approx(np.sqrt((1 + 1 / 9) / 2) * lift.std(), rel=0.01)
    assert measures.right_share == pytest.approx(0.75, abs=0.001)
    assert measures.seated is None
    still = attributes_of(person().values[:1].repeat(50, 0), JOINTS, FPS)
    assert (still.rate, still.right_share) == (0, 0.5)
    assert still.amplitude < 1e-12


def test_a_mirror_turns_what_has_a_side():
    points = person()
    points.values[:, JOINTS.index("LWrist"), 0] += 60
    here, there = of(points), of(mirror_points(points))
    assert here.orientation > 5
    assert there.orientation == pytest.approx(-here.orientation)
    assert there.right_share == pytest.approx(1 - here.right_share)
    assert (there.rate, there.amplitude) == pytest.approx((here.rate, here.amplitude))


@pytest.mark.parametrize("kind", ["humanoid", "beat", "trinity", "smplx", "mixamo", "vrm", "unreal"])
def test_a_mirror_of_any_skeleton(kind):
    motion = moving(kind, 8.0, 30.0)
    turn = axis_angle_to_quat(np.array([0.0, 1.0, 0.0]), np.radians(25.0))
    motion = replace(
        motion, rotations=np.concatenate([quat_multiply(turn, motion.rotations[:, :1]), motion.rotations[:, 1:]], 1)
    )
    here, there = (attributes_of(*body_of(m), 30.0) for m in (motion, mirror_motion(motion)))
    assert there.orientation == pytest.approx(-here.orientation, abs=1e-3)
    assert there.right_share == pytest.approx(1 - here.right_share, abs=1e-3)
    assert (there.rate, there.amplitude, there.seated) == pytest.approx((here.rate, here.amplitude, here.seated), rel=1e-3)


def test_orientation_is_the_angle_to_the_own_left():
    motion = moving("humanoid", 4.0, 30.0)
    motion = replace(motion, rotations=np.zeros_like(motion.rotations) + motion.skeleton.rest)
    for degrees in (-40.0, 0.0, 18.0, 170.0):
        turn = axis_angle_to_quat(np.array([0.0, 1.0, 0.0]), np.radians(degrees))
        rotations = motion.rotations.copy()
        rotations[:, 0] = quat_multiply(turn, rotations[:, 0])
        assert attributes_of(*body_of(replace(motion, rotations=rotations)), 30.0).orientation == pytest.approx(
            degrees, abs=0.01
        )


def test_size_counts_as_size_and_scale_does_not():
    small, large = of(person(size=0.6)), of(person(size=1.2))
    assert large.amplitude == pytest.approx(2 * small.amplitude, rel=1e-6)
    points = person()
    assert astuple(of(replace(points, values=points.values * 7.5)))[:4] == pytest.approx(astuple(of(points))[:4])


def test_slow_motion_halves_the_rate():
    points = person(strokes=40, size=2.0, seconds=120)
    assert of(replace(points, fps=FPS / 2)).rate == pytest.approx(of(points).rate / 2)


def test_several_clips_are_pooled_and_jumps_between_them_are_not_strokes():
    points = person()
    halves = [points.values[:450], points.values[450:] + [3000, 0]]
    measures = attributes_of(halves, JOINTS, FPS)
    assert measures.amplitude == pytest.approx(of(points).amplitude, rel=1e-9)
    assert measures.rate == pytest.approx(of(points).rate, abs=2)


def test_who_sits_is_seen_where_there_are_legs():
    motion = moving("humanoid", 2.0, 30.0)
    rest = np.zeros_like(motion.rotations) + motion.skeleton.rest
    index = motion.skeleton.index
    sitting = rest.copy()
    for side in ("left", "right"):
        right_angle = axis_angle_to_quat(np.array([1.0, 0, 0]), -np.pi / 2)
        sitting[:, index[f"{side}UpperLeg"]] = quat_multiply(right_angle, sitting[:, index[f"{side}UpperLeg"]])
        sitting[:, index[f"{side}LowerLeg"]] = quat_multiply(
            sitting[:, index[f"{side}LowerLeg"]], axis_angle_to_quat(np.array([1.0, 0, 0]), np.pi / 2)
        )
    half = np.concatenate([rest[:15], sitting[:45]])
    assert attributes_of(*body_of(replace(motion, rotations=rest)), 30.0).seated == 0
    assert attributes_of(*body_of(replace(motion, rotations=half)), 30.0).seated == pytest.approx(0.75)


def test_what_cannot_be_measured_is_refused():
    values = person(2).values
    for clips, names, words in [
        (values, JOINTS[:-1], "joints"),
        (values * np.nan, JOINTS, "finite"),
        (values[:0], JOINTS, "no positions"),
        (values, tuple(f"x{k}" for k in range(52)), "no neck"),
        (values * 0, JOINTS, "without width"),
    ]:
        with pytest.raises(InputError, match=words):
            attributes_of(clips, names, FPS)


@pytest.mark.parametrize("name", sorted(POSES))
def test_every_representation_can_be_measured(name):
    pose = find_pose(name)
    if pose.source == "points":
        layout = {"keypoints2d": "pats", "direction-vectors": "ted"}[name]
        source = person(4) if layout == "pats" else Points(FPS, np.random.default_rng(0).normal(size=(60, 10, 3)), "ted")
    else:
        source = moving(pose.skeleton, 4.0, 15.0)
        source = replace(source, face=np.full((len(source), 52), 0.5))
    measures = attributes_of(*body_of(pose.decode(pose.encode(source), 15.0)), 15.0)
    assert (measures.amplitude > 1e-6) is (name != "face")  # a face has no hands that move
    assert 0 <= measures.right_share <= 1


# derived speakers -----------------------------------------------------------------------------------------------------


def test_a_still_arm_moves_nothing_of_the_other():
    clip = Clip("a", "s", "pats", points=person())
    (mean,) = mean_poses([(clip, True)]).values()
    for derivation, still, share in (("leftarm", "R", 0.0), ("rightarm", "L", 1.0)):
        derived_clip = derive_clip(clip, derivation, mean)
        assert (derived_clip.name, derived_clip.speaker) == (f"a|derived-{derivation}", f"s|{derivation}")
        measures = of(derived_clip.points)
        assert measures.right_share == pytest.approx(share, abs=1e-6)
        arm = [k for k, name in enumerate(JOINTS) if name.startswith(still) and not name.endswith("Eye")]
        rest = sorted({*range(52)} - {*arm})
        np.testing.assert_array_equal(derived_clip.points.values[:, rest], clip.points.values[:, rest])
        np.testing.assert_allclose(derived_clip.points.values[:, arm].mean(0), clip.points.values[:, arm].mean(0))


def test_a_still_arm_is_still_in_what_networks_see_however_near_the_camera():
    near = person()
    zoom = 1 + 0.3 * np.sin(np.arange(len(near)) / 9)[:, None, None]
    clip = Clip("a", "s", "pats", points=replace(near, values=near.values * zoom))
    (mean,) = mean_poses([(clip, True)]).values()
    pose = find_pose("keypoints2d")
    for derivation, still in (("leftarm", "R"), ("rightarm", "L")):
        vectors = pose.encode(derive_clip(clip, derivation, mean).points)
        arm = [k for k, name in enumerate(pose.names) if name.startswith(still)]
        assert np.ptp(vectors[:, arm], 0).max() < 1e-9
        other = [k for k in range(96) if k not in arm]
        np.testing.assert_allclose(vectors[:, other], pose.encode(clip.points)[:, other])


@pytest.mark.parametrize("kind", ["humanoid", "beat", "trinity", "smplx", "mixamo", "vrm", "unreal"])
@pytest.mark.parametrize("side", ["left", "right"])
def test_a_still_arm_of_any_skeleton(kind, side):
    motion = moving(kind, 8.0, 15.0)
    clip = Clip("a", "s", "beat", motion=motion)
    mean = mean_poses([(clip, True)])["s"].like(motion.skeleton.names)
    still_motion = hold_motion(motion, side, mean)
    arm = arm_joints(motion.skeleton, side)
    names = [motion.skeleton.names[k] for k in arm]
    assert not {"head", "Head", "neck", "leftEye", "rightEye"} & {*names}
    assert not any(word in name.lower() for name in names for word in ("leg", "foot", "thigh", "eye", "knee", "toe"))
    assert len(arm) >= 4
    assert quat_angle(still_motion.rotations[:, arm], still_motion.rotations[:1, arm]).max() < 1e-6
    other = [k for k in range(len(motion.skeleton)) if k not in arm]
    np.testing.assert_array_equal(still_motion.rotations[:, other], motion.rotations[:, other])
    share = attributes_of(*body_of(still_motion), 15.0).right_share
    assert share == pytest.approx(1 if side == "left" else 0, abs=1e-6), "however the torso moves"


def test_the_mean_rotation_is_the_nearest_to_all():
    """Independent: no other rotation nearby has a smaller sum of squared distances (of sin of half the angle)."""
    motion = moving("humanoid", 4.0, 15.0)
    signs = np.random.default_rng(1).choice([-1, 1], (len(motion), len(motion.skeleton), 1))
    mean = mean_poses([(Clip("a", "s", "beat", motion=motion), True)])["s"].like(motion.skeleton.names)
    other_signs = replace(motion, rotations=motion.rotations * signs)
    again = mean_poses([(Clip("a", "s", "beat", motion=other_signs), True)])["s"].like(motion.skeleton.names)
    assert quat_angle(mean, again).max() < 1e-6

    def cost(q):
        return (np.sin(quat_angle(motion.rotations, q) / 2) ** 2).sum(0)

    rng = np.random.default_rng(2)
    for _ in range(20):
        nearby = quat_multiply(mean, axis_angle_to_quat(rng.normal(size=3), 0.05))
        assert (cost(nearby) >= cost(mean) - 1e-9).all()


def test_means_are_of_training_clips_where_there_are_any():
    first, second = person(10, seed=1), person(10, seed=2)
    clips = [Clip("a", "s", "pats", points=first), Clip("b", "s", "pats", points=second), Clip("c", "t", "pats", points=second)]
    means = mean_poses(zip(clips, (True, False, False), strict=True))
    only = mean_poses([(clips[0], True)])
    np.testing.assert_allclose(means["s"].like(("pats",)), only["s"].like(("pats",)))
    np.testing.assert_allclose(means["t"].like(("pats",)), mean_poses([(clips[2], True)])["t"].like(("pats",)))
    with pytest.raises(InputError, match="other joints"):
        means["s"].like(("ted",))


def test_twins_that_cannot_be_are_refused():
    clips = [Clip("a", "cleo", "pats", points=person(2)), Dropped("b", "bad")]
    for derived_speakers, mirror, words in [
        (["leftleg"], False, "did you mean 'leftarm'"),
        (["cloe|leftarm"], False, "did you mean 'cleo'"),
        (["mirror"], True, "choose one"),
    ]:
        with pytest.raises(InputError, match=words):
            plan_derivations(derived_speakers, lambda: iter(clips), mirror)
    chain = Skeleton(("a", "b"), (-1, 0), np.eye(3)[:2])
    with pytest.raises(InputError, match="without a left hand"):
        arm_joints(chain, "left")
    with pytest.raises(InputError, match="layout"):
        mean_poses([(Clip("a", "s", "x", points=replace(person(1), layout="other")), True)])
    assert plan_derivations([], lambda: pytest.fail("read for nothing"), True)(clips[0]) == []


@pytest.fixture(scope="module")
def raw(tmp_path_factory):
    """Three speakers in PATS' layout, a clip of each in every split, with sound."""
    folder = tmp_path_factory.mktemp("pats")
    clips = [
        Clip(f"{who}{k}", who, "pats", voice(3.0, k), points=person(3.0, 30 + 10 * k, seed=k), split=split)
        for who in ("ann", "cleo", "dan")
        for k, split in enumerate(("train", "validation", "test"))
    ]
    pats.write(clips, folder)
    return folder


@pytest.fixture(scope="module")
def store_and_report(raw, tmp_path_factory):
    folder = tmp_path_factory.mktemp("made") / "store"
    return folder, prepare("pats", raw, folder, derived_speakers=("cleo|leftarm", "cleo|rightarm", "dan|mirror"))


@pytest.mark.slow
def test_twins_are_speakers_in_every_split(store_and_report):
    store, report = Store(store_and_report[0]), store_and_report[1]
    assert set(store.speakers) == {"ann", "cleo", "dan", "cleo|leftarm", "cleo|rightarm", "dan|mirror"}
    for speaker in store.speakers:
        assert sorted(c.split for c in store.clips if c.speaker == speaker) == ["test", "train", "validation"]
    assert (report.clips, report.derived_speakers, report.augmented) == (9, 9, 0)
    assert "of derived speakers: 9" in report.summary()
    assert "\n" not in report.summary()
    for entry in store.clips:
        if entry.speaker != find_original(entry.speaker) or "|" in entry.name:
            np.testing.assert_array_equal(store.clip(entry)["audio"], store.clip(find_original(entry.name))["audio"])


@pytest.mark.slow
def test_the_report_says_how_each_speaker_gestures(store_and_report):
    measures = json.loads((store_and_report[0] / "report.json").read_text())["attributes"]
    assert measures["cleo|leftarm"]["right_share"] < 0.01
    assert measures["cleo|rightarm"]["right_share"] > 0.99
    assert measures["dan|mirror"]["right_share"] == pytest.approx(1 - measures["dan"]["right_share"], abs=0.001)
    assert measures["ann"]["seated"] is None
    store = Store(store_and_report[0])
    again = speaker_attributes(store, find_pose(store.pose).decode)
    assert again["cleo"].rate == measures["cleo"]["rate"]
    whole = np.concatenate(
        [find_pose("keypoints2d").decode(store.clip(c)["pose"]).values for c in store.clips if c.speaker == "cleo"]
    )
    assert again["cleo"].amplitude == pytest.approx(attributes_of(whole, JOINTS, FPS).amplitude, rel=1e-5)


def test_twins_are_not_taken_for_augmented_clips(store_and_report):
    store = Store(store_and_report[0])
    names = [clip.name for clip in store.clips]
    assert not any(map(is_mirror_image, names))
    assert is_mirror_image(mirror_clip(Clip("a", "s", "pats", points=person(1))).name)
    everything = Windows(store, 30)
    assert np.array_equal(Windows(store, 30, mirror=False).clips, everything.clips)
    with pytest.raises(InputError, match="no mirrored clips"):
        check_mirror(store, True)
    held_out, rest = (Windows(store, 30, split=split, held_out=0.4) for split in ("validation", "train"))
    names_of_parts = [{find_original(store.clips[k].name) for k in part.clips} for part in (held_out, rest)]
    assert not names_of_parts[0] & names_of_parts[1], "what is held out is heard in no derived speaker either"


@pytest.mark.slow
def test_twins_are_augmented_like_anybody(raw, tmp_path):
    report = prepare("pats", raw, tmp_path / "s", derived_speakers=["cleo|leftarm"], mirror=True)
    store = Store(tmp_path / "s")
    assert report.augmented == 4
    assert "cleo|leftarm|mirror" in store.speakers
    assert {c.split for c in store.clips if c.speaker.endswith("|mirror")} == {"train"}


@pytest.mark.slow
def test_the_sound_of_a_twin_is_found(store_and_report, raw):
    clips = {clip.name: clip for clip in load_stored_clips(store_and_report[0], split="test", raw=raw)}
    derived_speakers = [name for name in clips if "|derived-" in name]
    assert len(derived_speakers) == 3
    for name in derived_speakers:
        np.testing.assert_array_equal(clips[name].speech.samples, clips[find_original(name)].speech.samples)


@pytest.mark.slow
def test_stopped_with_twins_and_started_again(raw, store_and_report, tmp_path, monkeypatch):
    from cospeech.corpora.prepare import pieces

    calls, real = [], pieces.encode

    def dies(clip, plan):
        calls.append(clip.name)
        if len(calls) == 8:
            raise KeyboardInterrupt
        return real(clip, plan)

    derived_speakers = ("cleo|leftarm", "cleo|rightarm", "dan|mirror")
    monkeypatch.setattr(pieces, "encode", dies)
    with pytest.raises(KeyboardInterrupt):
        prepare("pats", raw, tmp_path / "s", derived_speakers=derived_speakers)
    prepare("pats", raw, tmp_path / "s", derived_speakers=derived_speakers)
    assert len(calls) == 8 + 18 - 7
    assert len(set(calls)) == 18
    for path in store_and_report[0].iterdir():
        assert path.read_bytes() == (tmp_path / "s" / path.name).read_bytes()


@pytest.mark.slow
def test_twins_of_rotations(tmp_path):
    clips = [
        Clip(f"{who}{k}", who, "beat", voice(4.0, k), moving("beat", 4.0, 60.0, k), split="train")
        for k in range(2)
        for who in ("a", "b")
    ]
    beat.write(clips, tmp_path / "raw")
    report = prepare("beat", tmp_path / "raw", tmp_path / "s", derived_speakers=["leftarm", "mirror"], filters=False)
    assert report.derived_speakers == 8
    for who in ("a", "b"):
        assert report.attributes[f"{who}|leftarm"].right_share < 0.01
        assert report.attributes[f"{who}|mirror"].right_share == pytest.approx(1 - report.attributes[who].right_share, abs=0.02)
