"""Clips of a study differ in nothing but their motion: length, rate, camera, loudness, faces; videos of others are checked."""

from __future__ import annotations

from fractions import Fraction
from functools import cache

import numpy as np
import pytest

from cospeech import Motion, Speech, humanoid
from cospeech.audio.level import loudest_level
from cospeech.cli.demo import EXAMPLE
from cospeech.errors import CospeechWarning, InputError
from cospeech.export.render.framing import FramedPose, Framing, PoseStage
from cospeech.motion.rotations import axis_angle_to_quat, quat_multiply
from cospeech.studio.study import make_study
from cospeech.studio.study.make import OTHER_SPEECH
from cospeech.studio.study.session import make_session

pytest.importorskip("soundfile")
pytestmark = pytest.mark.slow
av = pytest.importorskip("av", reason="videos need PyAV (the av extra)")
pytest.importorskip("pydantic", reason="studies need pydantic (the studio extra)")


def write_motion(path, seconds, fps=30.0, angle=0.0, *, face=False):
    """Somebody who stands with the upper arms turned up by ``angle`` radians."""
    body, frames = humanoid(), round(seconds * fps)
    rotations = np.zeros((frames, len(body), 4))
    rotations[..., 3] = 1
    for side, sign in (("left", 1), ("right", -1)):
        joint = body.index[f"{side}UpperArm"]
        rotations[:, joint] = quat_multiply(rotations[:, joint], axis_angle_to_quat((0, 0, 1), sign * angle))
    root = np.repeat(body.offsets[:1], frames, 0)
    path.parent.mkdir(exist_ok=True)
    Motion(fps, rotations, root, np.full((frames, 52), 0.2) if face else None).save(path)


@cache
def example():
    return Speech.load(EXAMPLE)


def write_sound(path, seconds, gain=1.0):
    import soundfile

    speech = example()
    path.parent.mkdir(exist_ok=True)
    soundfile.write(path, speech.samples[: round(seconds * speech.rate)] * gain, speech.rate)


@pytest.fixture
def videos(monkeypatch):
    """What was saved instead of videos: (motion, target, options, sound)."""
    videos, usual = [], Motion.save

    def save(motion, target, **options):
        if target.suffix != ".mp4":
            return usual(motion, target, **options)
        sound = Speech.load(options["audio"]) if "audio" in options else None
        videos.append((motion, target, options, sound))
        target.write_bytes(b"")
        return None

    monkeypatch.setattr(Motion, "save", save)
    return videos


@pytest.fixture
def clips(tmp_path):
    """Two systems on two speeches; they differ in everything that the study must hide."""
    for k, seconds in enumerate((1.0, 1.4)):
        write_motion(tmp_path / "people" / f"s{k}.bvh", 2.0, fps=60.0, angle=1.2)
        write_motion(tmp_path / "ours" / f"s{k}.glb", seconds, face=True)
        write_sound(tmp_path / "talks" / f"s{k}.wav", seconds, gain=1.0 if k else 0.1)
    return [tmp_path / "people", tmp_path / "ours"]


def test_clips_of_a_speech_have_one_length_rate_face_and_loudness(clips, videos, tmp_path):
    with pytest.warns(CospeechWarning, match="faces are hidden in all clips, because .*people/s0.bvh' has none"):
        plan = make_study(clips, tmp_path / "study", speech=tmp_path / "talks")
    by_file = {clip.file: clip for clip in plan.clips}
    lengths = {(by_file[target.name].stimulus, len(motion), motion.fps) for motion, target, _, _ in videos}
    assert lengths == {("s0", 30, 30.0), ("s1", 42, 30.0)}
    assert all(motion.face is None for motion, *_ in videos)
    for _, target, _, sound in videos:
        assert sound.duration == pytest.approx(1.0 if by_file[target.name].stimulus == "s0" else 1.4, abs=0.01)
    levels = [loudest_level(sound) for *_, sound in videos]
    assert max(levels) - min(levels) < 0.5
    assert -17 < max(levels) < -15


def test_the_camera_is_the_same_and_stands_still(clips, videos, tmp_path):
    make_study(clips, tmp_path / "study", speech=tmp_path / "talks", faces="hide")
    views = {options["camera"] for _, _, options, _ in videos}
    assert len(views) == 1
    view = views.pop()
    for motion, *_ in videos:
        poses = map(FramedPose, *PoseStage(motion.skeleton, motion.fps).place(motion))
        framing = Framing(view, motion.skeleton, motion.fps)
        boxes = [box for pose in poses for _, box in framing.push(pose)] + [box for _, box in framing.flush()]
        np.testing.assert_allclose(boxes, [[*view.low, *view.high]] * len(motion), atol=1e-9)


def test_faces_are_kept_where_all_have_one_or_it_is_asked_for(clips, videos, tmp_path):
    make_study(clips[1:], tmp_path / "one", speech=tmp_path / "talks", template="chain-of-generation")
    assert all(motion.face is not None for motion, *_ in videos)
    make_study(clips, tmp_path / "two", speech=tmp_path / "talks", faces="show")
    assert [motion.face is None for motion, *_ in videos[2:]] == [True, True, False, False]


def test_a_motion_that_ends_before_its_speech_is_told(clips, videos, tmp_path):
    write_motion(tmp_path / "ours" / "s1.glb", 0.8, face=True)
    with pytest.warns(CospeechWarning, match=r"clips of 's1' end at 0.8 s, with .*ours/s1.glb'; its speech has 1.4 s"):
        make_study(clips, tmp_path / "study", speech=tmp_path / "talks", faces="hide")
    assert sorted(len(motion) for motion, *_ in videos) == [24, 24, 30, 30]


@pytest.mark.parametrize("count", [2, 3])
def test_appropriateness_compares_a_system_with_its_motion_for_another_speech(videos, tmp_path, count):
    for k in range(count):
        write_motion(tmp_path / "ours" / f"s{k}.bvh", 1 + k / 10)
        write_motion(tmp_path / "theirs" / f"s{k}.bvh", 2.0, angle=0.3)
        write_sound(tmp_path / "talks" / f"s{k}.wav", 1 + k / 10)
    folders = [tmp_path / "ours", tmp_path / "theirs"]
    plan = make_study(folders, tmp_path / "study", speech=tmp_path / "talks", template="appropriateness", seed=1)
    assert plan.mismatched == {f"{name}{OTHER_SPEECH}": name for name in ("ours", "theirs")}
    by_file = {clip.file: clip for clip in plan.clips}
    length = {name: set() for name in plan.stimuli}
    for motion, target, _, sound in videos:
        clip = by_file[target.name]
        length[clip.stimulus].add((len(motion), round(float(sound.duration), 2)))
    assert all(len(lengths) == 1 for lengths in length.values())  # the length does not tell
    pairs = {frozenset(trial.systems) for trial in make_session(plan, 0) if not trial.check}
    assert pairs == {frozenset((name, f"{name}{OTHER_SPEECH}")) for name in ("ours", "theirs")}


@pytest.mark.parametrize("count", [2, 3, 4, 7])
def test_speeches_are_exchanged_with_others_of_nearly_the_same_length(tmp_path, count):
    from cospeech.studio.study.make import _mismatch

    voices = {f"s{k}": tmp_path / "talks" / f"s{k}.wav" for k in range(count)}
    for k, path in enumerate(voices.values()):
        write_sound(path, 1 + k / 10)
    exchanges = _mismatch({"ours": {}}, voices)
    assert {*exchanges} == {*exchanges.values()} == {*voices}
    assert all(0 < abs(int(one[1:]) - int(other[1:])) <= 2 for one, other in exchanges.items())


def write_video(path, *, codec="libx264", size=32, rate=10, frames=10, sound=True):
    path.parent.mkdir(exist_ok=True)
    with av.open(str(path), "w", format=path.suffix[1:]) as container:
        video = container.add_stream(codec, rate=Fraction(rate))
        video.width = video.height = size
        video.pix_fmt = "yuv420p"
        voice = (
            container.add_stream("aac" if path.suffix == ".mp4" else "libopus", rate=48_000, layout="mono") if sound else None
        )
        for _ in range(frames):
            picture = av.VideoFrame.from_ndarray(np.zeros((size, size, 3), np.uint8), format="rgb24")
            container.mux(video.encode(picture))
        container.mux(video.encode(None))
        if voice is not None:
            silence = av.AudioFrame.from_ndarray(
                np.zeros((1, 48_000 * frames // rate), np.float32), format="fltp", layout="mono"
            )
            silence.sample_rate = 48_000
            container.mux([*voice.encode(silence), *voice.encode(None)])


@pytest.mark.parametrize(
    ("other", "message"),
    [
        ({"size": 48}, "48 × 48 pixels"),
        ({"rate": 20, "frames": 20}, "20 pictures per second"),
        ({"sound": False}, "no sound"),
        ({"frames": 25}, "s, and"),
        ({"codec": "libvpx-vp9", "kind": ".webm"}, ".webm"),
    ],
)
def test_videos_that_differ_are_refused_or_told(tmp_path, other, message):
    write_video(tmp_path / "a" / "x.mp4")
    options = dict(other)
    write_video(tmp_path / "b" / f"x{options.pop('kind', '.mp4')}", **options)
    folders = [tmp_path / "a", tmp_path / "b"]
    with pytest.raises(InputError, match=message) as error:
        make_study(folders, tmp_path / "study")
    assert "--allow-differences" in str(error.value)
    assert not (tmp_path / "study").exists()
    with pytest.warns(CospeechWarning, match=message):
        make_study(folders, tmp_path / "study", allow_differences=True)


def test_videos_that_no_browser_plays_are_refused(tmp_path):
    for name in "ab":
        write_video(tmp_path / name / "x.mp4", codec="mpeg4")
    with pytest.raises(InputError, match=r"browsers do not play .*: its pictures are mpeg4"):
        make_study([tmp_path / "a", tmp_path / "b"], tmp_path / "study", allow_differences=True)


def test_blind_names_cannot_be_worked_out(tmp_path):
    for name in "ab":
        write_video(tmp_path / name / "x.mp4")
    folders = [tmp_path / "a", tmp_path / "b"]
    first, second, third, fourth = (
        make_study(folders, tmp_path / f"study{k}", seed=seed) for k, seed in enumerate((None, None, 4, 4))
    )
    assert {clip.file for clip in first.clips}.isdisjoint(clip.file for clip in second.clips)
    assert third == fourth


def test_what_cannot_be_exchanged_is_said(tmp_path):
    for name in ("videos", "motions"):
        (tmp_path / name).mkdir()
    write_video(tmp_path / "videos" / "x.mp4")
    write_motion(tmp_path / "motions" / "x.bvh", 1.0)
    write_sound(tmp_path / "talks" / "x.wav", 1.0)
    with pytest.raises(InputError, match="its speech cannot be exchanged"):
        make_study([tmp_path / "videos"], tmp_path / "study", template="appropriateness")
    with pytest.raises(InputError, match="one speech cannot be exchanged"):
        make_study([tmp_path / "motions"], tmp_path / "study", template="appropriateness", speech=tmp_path / "talks")
    with pytest.raises(InputError, match="speech is asked for, and there is none"):
        make_study([tmp_path / "motions"], tmp_path / "study", template="appropriateness", variant="mute")


def test_videos_beside_motion_files_must_be_as_those_are_rendered(tmp_path):
    write_motion(tmp_path / "ours" / "x.bvh", 0.3)
    write_sound(tmp_path / "talks" / "x.wav", 0.3)
    write_video(tmp_path / "theirs" / "x.mp4", rate=30, frames=9)
    folders = [tmp_path / "ours", tmp_path / "theirs"]
    with pytest.raises(InputError, match=r"theirs/x.mp4' has 32 × 32 pixels, and .*ours/x.bvh' 720 × 720 pixels"):
        make_study(folders, tmp_path / "study", speech=tmp_path / "talks")
    write_video(tmp_path / "theirs" / "x.mp4", size=720, rate=30, frames=9)
    plan = make_study(folders, tmp_path / "study", speech=tmp_path / "talks")
    assert {path.name for path in (tmp_path / "study" / "clips").iterdir()} == {clip.file for clip in plan.clips}
