"""Prepare: what the readers give is in the store, filtered, augmented, the same bytes however it was made."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import time
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
import soundfile

from cospeech.audio.features import AUDIO_NAMES, analyse, audio_features
from cospeech.audio.speech import Speech, Word
from cospeech.corpora.augment import faster, mirror_clip, mirror_motion, shift_pitch
from cospeech.corpora.beat import read as beat
from cospeech.corpora.clip import Clip, Semantic
from cospeech.corpora.prepare import DEFAULT_POSES, FILTERS, pieces, prepare
from cospeech.corpora.prepare.filters import keep
from cospeech.corpora.prepare.pieces import PreparationPlan, encode, split_of
from cospeech.corpora.samples import load_stored_clips
from cospeech.corpora.store import Store
from cospeech.errors import CospeechWarning, InputError
from cospeech.motion.motion import Motion
from cospeech.motion.points import Points
from cospeech.motion.poses import direction_vectors, find_pose
from cospeech.motion.rotations import quat_angle, quat_continuous, quat_normalize
from cospeech.motion.skeleton import Skeleton, find_skeleton
from cospeech.rules import EMOTIONS
from tests.support.leftovers import make_leftover

pytestmark = pytest.mark.slow


def voice(seconds: float, seed: int = 0, pitch: float = 140.0) -> Speech:
    """A buzz with pauses."""
    t = np.arange(round(seconds * 16_000)) / 16_000
    buzz = sum(np.sin(2 * np.pi * k * pitch * t) / k for k in range(1, 8)) * (np.sin(2 * np.pi * 1.3 * t + seed) > -0.3)
    words = (Word("So", 0.2, 0.5), Word("many", 0.6, 1.0), Word("so", 1.2, 1.3))
    return Speech((0.2 * buzz).astype(np.float32), 16_000, words)


def moving(skeleton: str, seconds: float, fps: float, seed: int = 0) -> Motion:
    joints = find_skeleton(skeleton)
    rng = np.random.default_rng(seed)
    t = np.arange(round(seconds * fps)) / fps
    phase = rng.uniform(0, 6, (len(joints), 3))
    vectors = 0.25 * np.sin(2 * np.pi * 0.7 * t[:, None, None] + phase)
    rotations = quat_normalize(np.concatenate([vectors, np.ones((*vectors.shape[:2], 1))], -1))
    root = np.stack([0.1 * np.sin(t), 0.9 + 0 * t, 0.05 * np.cos(t)], -1)
    return Motion(fps, quat_continuous(rotations), root, skeleton=joints)


@pytest.fixture(scope="module")
def raw(tmp_path_factory):
    """Four short takes in BEAT's layout; the third stands still."""
    clips = []
    for k in range(4):
        motion = moving("beat", 4.0, 120.0, k)
        if k == 2:
            motion = replace(motion, rotations=np.repeat(motion.rotations[:1], len(motion), 0))
        face = np.random.default_rng(k).random((240, 52))
        clips.append(
            Clip(
                f"clip{k}", ("ann", "bob")[k % 2], "beat", voice(4.0, k), motion, face=face, face_fps=60.0,
                emotion=EMOTIONS[k % 3], semantics=(Semantic(1.0, 2.0, 0.7, "07_iconic_h", "many"),), split="train",
            )
        )  # fmt: skip
    folder = tmp_path_factory.mktemp("raw")
    beat.write(clips, folder)
    return folder


@pytest.fixture(scope="module")
def store_and_report(raw, tmp_path_factory):
    folder = tmp_path_factory.mktemp("made") / "store"
    return folder, prepare("beat", raw, folder)


def same(a, b) -> bool:
    names = sorted(p.name for p in a.iterdir())
    return names == sorted(p.name for p in b.iterdir()) and all((a / n).read_bytes() == (b / n).read_bytes() for n in names)


def test_the_store_holds_what_the_reader_reads(raw, store_and_report):
    store, read = Store(store_and_report[0]), {clip.name: clip for clip in beat.read(raw)}
    assert store.fps == 15
    assert store.pose == "euler"
    for entry in store.clips:
        clip, values = read[entry.name], store.clip(entry)
        euler = find_pose("euler")
        expected = euler.encode(clip.motion.resample(15))[: entry.frames]
        np.testing.assert_allclose(values["pose"], expected, atol=1e-4)
        assert set(values) == {"pose", "audio", "face", "semantic", "emotion", "word"}
        assert EMOTIONS[values["emotion"][0]] == clip.emotion
        np.testing.assert_allclose(values["face"][3], clip.face[12], atol=1e-5)
        assert values["semantic"][[14, 15, 29, 30]].tolist() == pytest.approx([0, 0.7, 0.7, 0])
        texts = [store.words[k] for k in values["word"]]
        assert texts[3:8] == ["so"] * 5
        assert texts[0] == ""
        assert texts[10] == "many"


def test_what_is_cut_or_too_short_is_told(tmp_path):
    """Sound and motion of different lengths, a rest pose of one frame, and a difference that is too small to tell."""
    raw = tmp_path / "raw"
    raw.mkdir()
    for name, sound, motion in [("long", 4.0, 3.0), ("brief", 3.0, 4.5), ("same", 3.0, 3.2), ("rest", 3.0, 1 / 30)]:
        soundfile.write(raw / f"{name}.wav", voice(sound).samples, 16_000)
        moving("humanoid", motion, 30.0).save(raw / f"{name}.bvh")
    report = prepare("folder", raw, tmp_path / "store", fps=30.0)
    assert [entry.name for entry in Store(tmp_path / "store").clips] == ["brief", "long", "same"]
    rows = {row["name"]: row for row in report.dropped}
    assert rows.keys() == {"brief", "long", "rest"}
    assert "0.03 s long" in rows["rest"]["reason"]
    assert (rows["long"]["reason"], rows["long"]["start"], rows["long"]["end"]) == ("sound without motion", 3.0, 4.0)
    assert (rows["brief"]["reason"], rows["brief"]["start"], rows["brief"]["end"]) == ("motion without sound", 3.0, 4.5)
    assert report.cut == pytest.approx({"sound without motion": 1.0, "motion without sound": 1.5})
    assert "cut: 2.5 s" in report.summary()
    assert "filtered" not in report.summary()


def test_a_split_without_clips_is_told(store_and_report):
    folder, report = store_and_report
    assert [note.partition(" split")[0] for note in report.notes] == [f"no clip is in the {n}" for n in ("validation", "test")]
    assert "--split all" in report.notes[1]
    assert replace(report, splits={"train": 1.0, "validation": 1.0, "test": 1.0}).notes == ()
    with pytest.raises(InputError, match=r"in the test split \(--split train; --split all takes every clip\)"):
        load_stored_clips(folder)


@pytest.fixture
def nameless(tmp_path):
    """Three takes on a body whose joints have no names that say anything, and a function that gives it names."""

    def write(names):
        body = find_skeleton("humanoid")
        for k in range(3):
            motion = replace(moving("humanoid", 2.0, 30.0, k), skeleton=Skeleton(names, body.parents, body.offsets))
            motion.save(tmp_path / f"take{k}.bvh")
            soundfile.write(tmp_path / f"take{k}.wav", voice(2.0).samples, 16_000)
        return tmp_path

    return write


def test_a_note_on_several_files_is_given_once(nameless, tmp_path_factory):
    raw = nameless(tuple(f"n{k:02d}" for k in range(len(find_skeleton("humanoid")))))
    with pytest.warns(CospeechWarning) as notes:
        prepare("folder", raw, tmp_path_factory.mktemp("made") / "store")
    (note,) = [str(warning.message) for warning in notes]
    assert note.startswith("'take0.bvh' and 2 more: the names of the joints say nothing")
    assert "--map of generate, convert and render" in note


def test_an_empty_store_names_the_most_frequent_reason(tmp_path):
    raw = tmp_path / "raw"
    raw.mkdir()
    soundfile.write(raw / "a.wav", voice(2.0).samples, 16_000)
    (raw / "a.bvh").write_text("no BVH")
    for name in "bcd":
        soundfile.write(raw / f"{name}.wav", voice(2.0).samples, 16_000)
    with pytest.raises(InputError, match=r"3 of 4 for this reason; the first: b: 'b' has no motion"):
        prepare("folder", raw, tmp_path / "store")


def test_a_skeleton_that_is_not_recognised_says_what_mends_it(tmp_path):
    chain = Skeleton(("a", "b", "c"), (-1, 0, 1), np.array([[0, 1.0, 0], [0, 0.1, 0], [0, 0.1, 0]]))
    rotations = np.tile([0.0, 0, 0, 1], (60, 3, 1))
    raw = tmp_path / "raw"
    raw.mkdir()
    Motion(30.0, rotations, np.zeros((60, 3)), skeleton=chain).save(raw / "a.bvh")
    soundfile.write(raw / "a.wav", voice(2.0).samples, 16_000)
    with pytest.raises(InputError, match=r"cannot find .*cospeech convert FILE NEW.bvh --map names.toml") as refusal:
        prepare("folder", raw, tmp_path / "store")
    assert "--map file.toml" not in str(refusal.value)


def test_the_report_says_what_was_dropped_and_why(store_and_report):
    folder, report = store_and_report
    still = [row for row in report.dropped if "static" in row["reason"]]
    assert len(still) == 1
    assert still[0]["end"] - still[0]["start"] == pytest.approx(4.0)
    assert sum(report.reasons.values()) == pytest.approx(4.0)
    assert report.clips == 4
    assert report.seconds == pytest.approx(12.0)
    assert json.loads((folder / "report.json").read_text())["clips"] == 4
    assert "0.2 min, clips: 4, speakers: 2, filtered: 4.0 s" in report.summary()
    assert "\n" not in report.summary()
    assert not (folder / ".parts").exists()


def test_nothing_is_filtered_if_one_says_so(raw, tmp_path):
    assert prepare("beat", raw, tmp_path / "s", filters=False).seconds == pytest.approx(16.0)


def test_stopped_and_started_again_it_makes_the_same_bytes(raw, store_and_report, tmp_path, monkeypatch):
    calls = []
    real = pieces.encode

    def dies(clip, plan):
        calls.append(clip.name)
        if len(calls) == 3:
            raise KeyboardInterrupt
        return real(clip, plan)

    monkeypatch.setattr(pieces, "encode", dies)
    with pytest.raises(KeyboardInterrupt):
        prepare("beat", raw, tmp_path / "s")
    assert not (tmp_path / "s" / "index.json").exists()
    assert len(list((tmp_path / "s" / ".parts").glob("*.npz"))) == 2
    make_leftover(tmp_path / "s")  # as a kill while the parts are put together leaves it
    prepare("beat", raw, tmp_path / "s")
    assert len(calls) == 5  # the two parts that were there were not made again
    assert same(tmp_path / "s", store_and_report[0])


def test_killed_and_started_again_it_makes_the_same_bytes(raw, store_and_report, tmp_path):
    """SIGKILL, in the middle of the third clip."""
    target = tmp_path / "s"
    code = (
        "import time\nfrom cospeech.corpora.prepare import pieces, prepare\nreal = pieces.encode\ndone = []\n"
        "def slow(clip, plan):\n    done.append(1)\n    time.sleep(60 * (len(done) == 3))\n    return real(clip, plan)\n"
        f"pieces.encode = slow\nprepare('beat', {str(raw)!r}, {str(target)!r})\n"
    )
    process = subprocess.Popen([sys.executable, "-c", code])
    try:
        limit = time.monotonic() + 30
        while len(list((target / ".parts").glob("0*.npz"))) < 2 and process.poll() is None and time.monotonic() < limit:
            time.sleep(0.05)
    finally:
        process.kill()
        process.wait()
    assert len(list((target / ".parts").glob("0*.npz"))) == 2
    prepare("beat", raw, target)
    assert same(target, store_and_report[0])


def test_parts_of_other_data_or_settings_are_made_again(raw, store_and_report, tmp_path, monkeypatch):
    real = pieces.encode
    monkeypatch.setattr(pieces, "encode", lambda clip, plan: {n: v * 0 + 1 for n, v in real(clip, plan).items()})
    with pytest.raises(InputError, match="nothing"):  # all frames alike: static
        prepare("beat", raw, tmp_path / "s")
    monkeypatch.undo()
    other = tmp_path / "raw"
    shutil.copytree(raw, other)
    prepare("beat", other, tmp_path / "s", fps=10)
    assert Store(tmp_path / "s").fps == 10


@pytest.mark.parametrize("backend", ["threading", "loky"])
def test_workers_make_the_same_bytes(raw, store_and_report, tmp_path, backend):
    steps = []
    prepare(
        "beat", raw, tmp_path / "s", jobs=2, backend=backend, progress=lambda seconds, total: steps.append((seconds, total))
    )
    assert same(tmp_path / "s", store_and_report[0])
    assert steps[-1] == (16.0, None)


@pytest.mark.filterwarnings("default")  # of the cluster's own shutdown
def test_a_dask_cluster_of_two_workers_makes_the_same_bytes(raw, store_and_report, tmp_path):
    dask = pytest.importorskip("distributed", reason="needs dask.distributed")
    with dask.LocalCluster(2, threads_per_worker=1, processes=True, dashboard_address=None) as cluster:
        prepare("beat", raw, tmp_path / "s", jobs=-1, backend="dask", scheduler=cluster.scheduler_address)
    assert same(tmp_path / "s", store_and_report[0])


def test_wrong_options_are_answered_in_one_line(raw, store_and_report, tmp_path):
    for options, words in [
        ({"corpus": "beet"}, "did you mean 'beat'"),
        ({"pose": "eular"}, "did you mean 'euler'"),
        ({"fps": 0}, "0 frames"),
        ({"speeds": [3]}, "0.5 … 2"),
        ({"jobs": 0}, "0 jobs"),
        ({"backend": "cluster", "jobs": 2}, "'cluster'"),
        ({"store": store_and_report[0]}, "overwrite"),
        ({"pose": "keypoints2d"}, "key points"),
        ({"raw": tmp_path / "nowhere"}, "nowhere"),
    ]:
        arguments = {"corpus": "beat", "raw": raw, "store": tmp_path / "s"} | options
        with pytest.raises(InputError, match=words) as error:
            prepare(**arguments)
        assert "\n" not in str(error.value)


def test_a_mirrored_clip_is_a_mirror(raw):
    clip = next(iter(beat.read(raw)))
    twin = mirror_motion(clip.motion)
    names = list(clip.motion.skeleton.names)
    other = [names.index(n.replace("Left", "#").replace("Right", "Left").replace("#", "Right")) for n in names]
    np.testing.assert_allclose(twin.positions(), clip.motion.positions()[:, other] * [-1, 1, 1], atol=1e-6)
    back = mirror_motion(twin)
    assert quat_angle(back.rotations, clip.motion.rotations).max() < 1e-6
    assert mirror_clip(clip).speaker == "ann|mirror"


@pytest.mark.parametrize("kind", ["humanoid", "trinity", "smplx", "mixamo", "vrm", "unreal"])
def test_any_skeleton_has_a_mirror(kind):
    motion = moving(kind, 1.0, 10.0)
    twin = mirror_motion(motion)
    other = [twin.skeleton.index[name] for name in motion.skeleton.names]
    here, there = motion.positions(), twin.positions()
    # every joint has a partner at its mirrored place in all frames, and none is its own off the middle
    apart = np.abs(here[:, :, None] * [-1, 1, 1] - there[:, None]).max((0, 3))
    assert apart.min(1).max() < 1e-6
    assert (apart.argmin(1) != other).sum() >= 20


def test_a_skeleton_without_sides_is_refused():
    chain = Skeleton(("a", "b", "c"), (-1, 0, 1), np.eye(3))
    motion = Motion(10.0, np.zeros((2, 3, 4)) + [0, 0, 0, 1.0], np.zeros((2, 3)), skeleton=chain)
    with pytest.raises(InputError, match="without left and right"):
        mirror_motion(motion)


def test_a_folder_of_the_user_s(tmp_path):
    """Sound and a BVH of another skeleton beside it: retargeted to our humanoid."""
    (tmp_path / "raw" / "ann").mkdir(parents=True)
    soundfile.write(tmp_path / "raw" / "ann" / "talk.wav", voice(3).samples, 16_000)
    moving("mixamo", 3.0, 30.0).save(tmp_path / "raw" / "ann" / "talk.bvh")
    soundfile.write(tmp_path / "raw" / "ann" / "only.wav", voice(2).samples, 16_000)
    report = prepare("folder", tmp_path / "raw", tmp_path / "s", filters=True)
    store = Store(tmp_path / "s")
    (entry,) = store.clips
    assert (entry.name, entry.speaker, entry.frames) == ("ann/talk", "ann", 90)
    assert entry.has == ("pose", "audio")
    assert store.arrays["pose"].shape == (90, 330)
    assert [row["name"] for row in report.dropped] == ["ann/only"]
    motion = find_pose("rot6d-humanoid").decode(store.arrays["pose"], 30.0)
    expected = moving("mixamo", 3.0, 30.0).retarget("humanoid")
    assert quat_angle(motion.rotations, expected.rotations).max() < 0.01


@pytest.mark.parametrize(("layout", "joints", "axes"), [("ted", 10, 3), ("pats", 52, 2)])
def test_mirrored_points_change_places(layout, joints, axes):
    values = np.random.default_rng(0).normal(size=(5, joints, axes))
    points = mirror_clip(Clip("a", "s", layout, points=Points(15, values, layout))).points
    names = __import__(f"cospeech.motion.skeletons.{layout}", fromlist=["JOINTS"]).JOINTS
    left, right = ("leftWrist", "rightWrist") if layout == "ted" else ("LHandThumb3", "RHandThumb3")
    np.testing.assert_array_equal(points.values[:, names.index(left), 0], -values[:, names.index(right), 0])
    np.testing.assert_array_equal(points.values[:, names.index(left), 1], values[:, names.index(right), 1])
    again = mirror_clip(Clip("a", "s", layout, points=points)).points
    np.testing.assert_array_equal(again.values, values)


def pitch_of(speech: Speech) -> float:
    pitch = analyse(speech).pitch
    return float(np.median(pitch[pitch > 0]))


def test_faster_and_higher():
    clip = Clip("a", "s", "beat", voice(4), moving("beat", 4, 120), semantics=(Semantic(1, 2, 0.5),))
    quick = faster(clip, 1.25)
    assert quick.duration == pytest.approx(4 / 1.25)
    assert float(quick.speech.duration) == pytest.approx(4 / 1.25, abs=1e-3)
    assert quick.speech.words[1].start == pytest.approx(0.6 / 1.25)
    assert quick.semantics[0].end == pytest.approx(1.6)
    assert pitch_of(quick.speech) == pytest.approx(140 * 1.25, rel=0.02)
    silent = faster(replace(clip, speech=None, extra={"words": clip.speech.words}), 1.25)
    assert [word.start for word in silent.extra["words"]] == pytest.approx([word.start / 1.25 for word in clip.speech.words])
    for semitones in (-3, 4):
        high = shift_pitch(clip, semitones)
        assert high.speech.duration == clip.speech.duration == Fraction(4)
        assert high.motion is clip.motion
        assert pitch_of(high.speech) == pytest.approx(140 * 2 ** (semitones / 12), rel=0.02)


def test_augmented_clips_are_in_the_train_split_only(raw, tmp_path):
    report = prepare("beat", raw, tmp_path / "s", mirror=True, speeds=[1.1], pitches=[2], filters=False)
    store = Store(tmp_path / "s")
    assert report.augmented == 12
    assert {clip.split for clip in store.clips} == {"train"}
    assert set(store.speakers) == {"ann", "bob", "ann|mirror", "bob|mirror"}
    base = Clip("talk", "s", "folder", split="test")
    assert split_of(base) == "test"
    splits = [split_of(replace(base, name=f"talk{k}", split=None)) for k in range(2000)]
    assert 0.77 < splits.count("train") / 2000 < 0.83
    assert 0.08 < splits.count("test") / 2000 < 0.12


def test_ted_filters_find_what_they_are_for():
    still = np.repeat(direction_vectors.MEAN[None], 100, 0)
    stretches, losses = keep(still, FILTERS["ted"])
    assert stretches == []
    assert "mean pose" in losses[0].reason
    assert "wrists" in losses[0].reason
    rng = np.random.default_rng(2)
    lively = still + 0.6 * np.sin(np.arange(100)[:, None] / 3 + rng.uniform(0, 6, 27)) * (np.arange(27) > 11)
    assert keep(lively, FILTERS["ted"])[0] == [(0, 100)]
    stooping = lively.copy()
    stooping[:, :3] = [0.7, -0.71, 0]
    assert "spine" in keep(stooping, FILTERS["ted"])[1][0].reason
    half = np.concatenate([lively, np.repeat(still[:1], 100, 0)])
    ((first, end),) = keep(half, FILTERS["ted"])[0]
    assert first == 0
    assert 100 <= end < 145
    assert keep(still[:5], None) == ([(0, 5)], [])


def test_audio_features_are_those_of_the_frames_own_time():
    speech = voice(3.0)
    analysis = analyse(speech, mel=True)
    features = audio_features(speech, 45, 15.0)
    assert features.shape == (45, len(AUDIO_NAMES))
    rows = slice(round(19.5 / 15 * 100), round(20.5 / 15 * 100))
    np.testing.assert_allclose(features[20, :80], analysis.mel[rows].mean(0), rtol=1e-4)
    voiced = analysis.pitch[rows][analysis.pitch[rows] > 0]
    assert features[20, 81] == pytest.approx(voiced.mean() if len(voiced) else 0, rel=1e-4)


def test_what_is_missing_is_absent():
    clip = Clip("a", "s", "beat", motion=moving("beat", 2, 30))
    assert set(encode(clip, PreparationPlan("beat", "euler", 15.0))) == {"pose"}
    with pytest.raises(InputError, match="no motion"):
        encode(replace(clip, motion=None), PreparationPlan("beat", "euler", 15.0))
    points = Points(15.0, np.zeros((30, 52, 2)), "pats")
    with pytest.raises(InputError, match="no joint rotations"):
        encode(replace(clip, motion=None, points=points), PreparationPlan("beat", "euler", 15.0))


def test_every_corpus_has_a_default_pose():
    from cospeech.corpora import CORPORA

    assert set(DEFAULT_POSES) == set(CORPORA)
    assert all(find_pose(name) for name in DEFAULT_POSES.values())


def test_pats_brings_its_own_spectra_and_words():
    values = np.random.default_rng(0).normal(size=(30, 52, 2)) * 50
    ready = np.repeat(np.arange(206.0)[:, None], 64, 1)
    extra = {"audio/log_mel_400": ready, "words": (Word("Yes", 0.5, 0.8),), "video_fn": "x"}
    clip = Clip("1", "oliver", "pats", points=Points(15.0, values, "pats"), extra=extra)
    arrays = encode(clip, PreparationPlan("pats", "keypoints2d", 15.0))
    assert arrays["audio"].shape == (30, len(pieces.audio_names("pats")))
    np.testing.assert_array_equal(arrays["audio"][:, 0], (np.arange(30) / 15 * 103).astype(int))
    assert arrays["word"][7:13].tolist() == [0, 1, 1, 1, 1, 0]
    assert set(pieces.select_extra(clip)) == {"audio/log_mel_400", "words"}
    with pytest.raises(InputError, match="ready-made"):
        faster(clip, 1.1)
    lacking = replace(clip, extra={})
    assert set(encode(lacking, PreparationPlan("pats", "keypoints2d", 15.0))) == {"pose"}


@pytest.mark.parametrize("corpus", sorted(DEFAULT_POSES))
def test_a_wrong_folder_leaves_nothing(tmp_path, corpus):
    (tmp_path / "wrong" / "deeper").mkdir(parents=True)
    (tmp_path / "wrong" / "notes.txt").write_text("no corpus\n")
    before = sorted(tmp_path.rglob("*"))
    with pytest.raises(InputError):
        prepare(corpus, tmp_path / "wrong", tmp_path / "stores" / "mine")
    assert sorted(tmp_path.rglob("*")) == before
    (tmp_path / "there").mkdir()
    (tmp_path / "there" / "mine.txt").touch()
    with pytest.raises(InputError):
        prepare(corpus, tmp_path / "wrong", tmp_path / "there")
    assert [path.name for path in (tmp_path / "there").iterdir()] == ["mine.txt"]


@pytest.mark.parametrize("corpus", sorted(DEFAULT_POSES))
@pytest.mark.parametrize("where", ["store", "deeper/store", "other/../store", "link/store"])
def test_a_store_does_not_lie_in_the_folder_of_the_corpus(tmp_path, corpus, where):
    raw = tmp_path / "raw"
    (raw / "other").mkdir(parents=True)
    (raw / "link").symlink_to(raw / "other")
    before = sorted(tmp_path.rglob("*"))
    with pytest.raises(
        InputError, match=r"the store '.*' would lie in the folder of the corpus '.*' \(name a folder outside it"
    ):
        prepare(corpus, raw, raw / where, overwrite=True, wav2vec="nosuch")
    assert sorted(tmp_path.rglob("*")) == before


def test_a_corpus_of_which_nothing_is_left_leaves_nothing(tmp_path):
    (tmp_path / "raw").mkdir()
    soundfile.write(tmp_path / "raw" / "a.wav", np.zeros(16_000), 16_000)  # sound without motion
    (tmp_path / "raw" / "b.wav").write_bytes(b"no sound")
    with pytest.raises(InputError, match="nothing of this folder corpus is left"):
        prepare("folder", tmp_path / "raw", tmp_path / "stores" / "mine")
    assert [path.name for path in tmp_path.iterdir()] == ["raw"]


@pytest.mark.parametrize("overwrite", [False, True])
def test_a_store_does_not_go_among_recordings(raw, tmp_path, overwrite):
    folder = next(path.parent for path in raw.rglob("*.bvh"))
    before = sorted(raw.rglob("*"))
    for target in (raw, folder):
        with pytest.raises(InputError, match="recordings in"):
            prepare("beat", raw, target, overwrite=overwrite)
    assert sorted(raw.rglob("*")) == before
