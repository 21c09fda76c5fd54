"""BEAT: what is written is read again, the dirt of the published files is read as it is meant, damage becomes a drop."""

from __future__ import annotations

import json
import os
import re
import tracemalloc
from dataclasses import replace
from itertools import islice

import numpy as np
import pytest
import soundfile

from cospeech.corpora import Clip, Dropped
from cospeech.corpora.beat import read as beat
from cospeech.corpora.beat.annotations import EMOTIONS, SPLIT, take_of
from cospeech.corpora.beat.write import FACE_NAMES
from cospeech.errors import InputError
from cospeech.motion.motion import Motion
from cospeech.motion.rotations import quat_identity
from cospeech.motion.skeleton import Skeleton
from cospeech.motion.skeletons.arkit import ARKIT_INDEX
from cospeech.rules import EMOTIONS as OURS
from tests.support.corpus_files import UNUSABLE, WORDS, clip, damage, same_turns, sort_out, unusable


@pytest.fixture(scope="module")
def raw(tmp_path_factory):
    """One take with all its files."""
    root = tmp_path_factory.mktemp("beat")
    assert beat.write([clip()], root) == ["2_scott_0_74_74"]
    return root


@pytest.fixture
def take(raw, tmp_path):
    """A function: new contents of the take's files by suffix (None removes the file) → what the reader gives."""

    def read(**changes):
        folder = tmp_path / "2"
        folder.mkdir(exist_ok=True)
        for path in (raw / "2").iterdir():
            new = changes.get(path.suffix[1:], path.read_bytes())
            if new is not None:
                (folder / path.name).write_bytes(new if isinstance(new, bytes) else new.encode())
        (item,) = beat.read(tmp_path)
        return item

    read.bvh = (raw / "2" / "2_scott_0_74_74.bvh").read_text()
    read.json = json.loads((raw / "2" / "2_scott_0_74_74.json").read_text())
    return read


def test_reader_gives_what_was_written(raw):
    (got,) = beat.read(raw)
    ours = clip()
    body = ours.motion.retarget("beat").resample(120)
    assert (got.corpus, got.speaker, got.emotion, got.split) == ("beat", "scott", "anger", "train")
    assert (got.motion.fps, got.motion.skeleton.kind, len(got.motion)) == (120, "beat", len(body))
    assert np.allclose(got.motion.skeleton.offsets, body.skeleton.offsets, atol=1e-6)
    assert same_turns(got.motion.rotations, body.rotations) < 1e-6
    assert np.allclose(got.motion.root - got.motion.root[0], body.root - body.root[0], atol=1e-7)
    assert np.array_equal(got.speech.samples, ours.speech.samples)
    assert [w.text for w in got.speech.words] == [w.text for w in WORDS]
    assert np.allclose([(w.start, w.end) for w in got.speech.words], [(w.start, w.end) for w in WORDS], atol=1e-5)
    assert got.semantics == ours.semantics
    assert (got.face_fps, len(got.face)) == (60, 60)
    indices = [k for name, k in ARKIT_INDEX.items() if name != "tongueOut"]
    assert np.allclose(got.face[::2][:, indices], ours.motion.face[:, indices], atol=1e-5)
    assert not got.face[:, ARKIT_INDEX["tongueOut"]].any()


def test_written_again_is_the_same_bytes(raw, tmp_path):
    assert beat.write(beat.read(raw), tmp_path) == ["2_scott_0_74_74"]
    for path in (raw / "2").iterdir():
        assert (tmp_path / "2" / path.name).read_bytes() == path.read_bytes(), path.suffix


def test_files_are_laid_out_as_beats_are(raw):
    stem = raw / "2" / "2_scott_0_74_74"
    lines = stem.with_suffix(".bvh").read_text().splitlines()
    assert lines[428:431] == ["MOTION", "Frames: 120", "Frame Time: 0.008333"]
    assert len(lines) == 431 + 120
    assert {len(line.split()) for line in lines[431:]} == {228}
    assert lines[431].split()[:3] == ["0.000000"] * 3
    channels = [line.strip() for line in lines if "CHANNELS" in line]
    assert channels[0] == "CHANNELS 6 Xposition Yposition Zposition Xrotation Yrotation Zrotation"
    assert set(channels[1:]) == {"CHANNELS 3 Xrotation Yrotation Zrotation"}
    assert (len(channels), sum("End Site" in line for line in lines)) == (75, 13)
    about = soundfile.info(stem.with_suffix(".wav"))
    assert (about.samplerate, about.channels, about.subtype, about.frames) == (16_000, 1, "FLOAT", 16_000)
    face = json.loads(stem.with_suffix(".json").read_text())
    assert face["names"] == sorted(face["names"]) == list(FACE_NAMES)
    assert len(FACE_NAMES) == 51
    assert set(face["frames"][1]) == {"weights", "time", "rotation"}
    assert stem.with_suffix(".csv").read_text() == "02_anger, 0, 1.000, 1.000, 2\n"
    assert stem.with_suffix(".txt").read_text().splitlines()[1] == "07_iconic_h\t0.319\t0.785\t0.466\t0.7\trelax well"
    grid = stem.with_suffix(".TextGrid").read_text()
    assert re.findall(r'name = "(\w+)"', grid) == ["words", "phones"]
    assert 'text = ""' in grid


@pytest.mark.parametrize("speaker", [2, 10])
def test_skeletons_of_the_published_files(shared_folder, tmp_path, speaker):
    tree = json.loads((shared_folder / "data" / f"beat_speaker{speaker}_skeleton.json").read_text())
    names = [name for name in tree if tree[name].get("channels")]
    parents = tuple(names.index(tree[n]["parent"]) if tree[n]["parent"] else -1 for n in names)
    offsets = np.array([tree[n]["offset"] for n in names]) / 100
    skeleton = Skeleton(names, parents, offsets, kind="beat")
    body = Motion(fps=120, rotations=quat_identity(4, len(names)), root=np.zeros((4, 3)), skeleton=skeleton)
    assert beat.write([Clip("2_scott_0_1_1", "scott", "beat", motion=body)], tmp_path) == ["2_scott_0_1_1"]
    (got,) = beat.read(tmp_path)
    order = [names.index(n) for n in got.motion.skeleton.names]
    assert np.allclose(got.motion.skeleton.offsets[1:], offsets[order][1:], atol=1e-6)
    heights = got.motion.positions()[0, :, 1]
    assert -0.01 < heights.min() < 0.02  # it stands on the floor
    assert 1.4 < heights.max() < 1.9


@pytest.mark.slow
def test_frames_are_counted(take):
    assert len(take(bvh=take.bvh.replace("Frames: 120", "Frames: 99999")).motion) == 120
    assert len(take(bvh=take.bvh.replace("Frames: 120", "Frames: 20.0")).motion) == 120


def test_side_files_may_be_missing(take):
    got = take(json=None, wav=None, TextGrid=None, csv=None, txt=None)
    assert (got.face, got.face_fps, got.speech, got.semantics) == (None, None, None, None)
    assert got.emotion == "anger"  # by the take's id, 74


def test_words_without_sound_are_kept(take):
    got = take(wav=None)
    assert got.speech is None
    assert [word.text for word in got.extra["words"]] == [word.text for word in WORDS]


def test_hips_beyond_the_horizon_are_told(take):
    lines = take.bvh.split("\n")
    lines[431 + 7] = "30000 " + lines[431 + 7].split(" ", 1)[1]
    assert "in frame 7 the hips are 300 m away" in take(bvh="\n".join(lines)).reason


def test_a_take_needs_motion(take):
    item = take(bvh=None)
    assert isinstance(item, Dropped)
    assert "2_scott_0_74_74.bvh" in item.reason


@pytest.mark.slow
def test_semantics_of_blanks_and_emotions_of_beats_spelling(take):
    got = take(
        txt="07_iconic_h 0.1 0.5 0.4 0.7 a big house\nneed_cut 0.5 0.9 0.4 0\n", csv="00_netural, 0, 63.908, 63.908, 0\n"
    )
    assert [(s.kind, s.score, s.words) for s in got.semantics] == [("07_iconic_h", 0.7, "a big house"), ("need_cut", 0, "")]
    assert got.emotion == "neutral"
    got = take(csv="00_netural, 0, 10, 10, 0\n06_fear, 10, 60, 50, 6\n")
    assert got.emotion == "fear"
    assert got.extra["emotions"] == (("neutral", 0, 10), ("fear", 10, 60))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"csv": "99_bored, 0, 1, 1, 0\n"}, "'2_scott_0_74_74.csv', line 1"),
        ({"csv": ""}, "2_scott_0_74_74.csv' is empty"),
        ({"txt": "07_iconic_h\t0\t1\t1\t0.7\n01_beat_align\t0.5\tnan\t0\t0.1\n"}, "'2_scott_0_74_74.txt', line 2"),
        ({"txt": "07_iconic_h\t2\t1\t1\t0.7\n"}, "before it starts"),
        ({"txt": "07_iconic_h\t0\t1\t1\t7\n"}, "'7' where a number of 0 … 1"),
        ({"TextGrid": "nothing"}, "2_scott_0_74_74.TextGrid"),
        ({"wav": b"RIFF"}, "2_scott_0_74_74.wav"),
        ({"json": "{}"}, "2_scott_0_74_74.json"),
    ],
)
def test_damage_is_told_with_its_place(take, change, message):
    item = take(**change)
    assert isinstance(item, Dropped)
    assert message in item.reason


def test_another_corpus_is_told(take):
    for bvh, message in (
        (take.bvh.replace("LeftForeArm", "LeftElbow"), "not beat's"),
        (take.bvh.replace("0.008333", "0.033333"), "30 frames per second"),
        (take.bvh.replace("CHANNELS 3 Xrotation", "CHANNELS 3 Qrotation", 1), "line 9"),
    ):
        assert message in take(bvh=bvh).reason
    slow = {**take.json, "frames": [f | {"time": k / 30} for k, f in enumerate(take.json["frames"])]}
    assert "30 frames per second" in take(json=json.dumps(slow)).reason


def test_a_take_of_which_half_is_missing_is_dropped(tmp_path):
    long, short = clip(frames=300), clip()
    beat.write([replace(long, motion=short.motion)], tmp_path)
    (item,) = beat.read(tmp_path)
    assert "1.0 s of motion, 10.0 s of speech" in item.reason


def test_the_split_is_the_papers():
    sizes = {name: len(ids) for name, ids in SPLIT.items()}
    assert sizes == {"test": 8 + 7 + 1, "validation": 8 + 7 + 1, "train": 48 + 6 + 6 + 4 + 6 + 6 + 6 + 6 + 10}
    assert not SPLIT["test"] & SPLIT["train"] | SPLIT["test"] & SPLIT["validation"] | SPLIT["train"] & SPLIT["validation"]
    expected = {
        "2_scott_0_8_8": "test", "2_scott_0_9_9": "train", "4_lawrence_0_57_57": "validation", "6_carla_0_65_65": "test",
        "8_catherine_0_118_118": "validation", "2_scott_1_1_1": "test", "2_scott_1_12_12": "validation",
        "2_scott_1_2_2": "train", "2_scott_0_2_8": "test", "2_scott_0_9_56": "train",
        "1_wayne_0_1_1": "test", "1_wayne_0_9_9": "train", "2_scott_2_1_1": "test", "2_scott_3_2_2": "train",
        "2_scott_0_118_119": None, "2_scott_1_13_13": None,
    }  # fmt: skip
    assert {name: take_of(name).split for name in expected} == expected
    for name in ("2_scott_0_103_110", "2_scott_0_7_9", "7_ana_2_56_57"):
        with pytest.raises(InputError, match=r"its texts \d+ to \d+ are of the .* and the .* split"):
            take_of(name).split  # noqa: B018


def test_the_emotion_is_in_the_id():
    assert set(EMOTIONS) == set(OURS)
    first = {
        "neutral": 1,
        "happiness": 65,
        "anger": 73,
        "sadness": 81,
        "contempt": 87,
        "surprise": 95,
        "fear": 103,
        "disgust": 111,
    }
    for name, k in first.items():
        assert take_of(f"1_wayne_0_{k}_{k}").emotion == name
    assert take_of("1_wayne_0_64_64").emotion == "neutral"
    assert take_of("1_wayne_0_119_119").emotion is None
    assert take_of("1_wayne_0_110_111").emotion is None
    assert take_of("1_wayne_1_70_70").emotion == "neutral"
    with pytest.raises(InputError, match="not the name of a take"):
        take_of("scott_1")


def test_every_speaker_keeps_the_split_of_a_clip(tmp_path):
    """Also the fifth and the sixth, whom the papers' split leaves out."""
    motion = clip(frames=2).motion
    clips = [
        clip(f"{speaker}{split}", speaker=speaker, emotion="neutral", split=split, motion=motion, speech=None, semantics=None)
        for speaker in "abcdef"
        for split in ("train", "validation", "test")
    ]
    names = beat.write(clips, tmp_path)
    assert len({name.split("_")[0] for name in names}) == 6
    got, _ = sort_out(beat.read(tmp_path), names)
    assert [got[name].split for name in names] == [each.split for each in clips]


def test_names_are_given_by_emotion_and_split(tmp_path):
    short = {"motion": clip(frames=2).motion, "speech": None, "semantics": None}
    clips = [
        clip("a", emotion="neutral", split="test", **short),
        clip("b", emotion="neutral", split="test", **short),
        clip("c", emotion="fear", split="validation", **short),
        clip("d", emotion=None, speaker="Ana Maria", **short),
        Dropped("e", "passed over"),
        clip("30_katya_0_5_5", emotion=None, speaker="katya", **short),
    ]
    names = ["2_scott_0_1_1", "2_scott_0_2_2", "2_scott_0_110_110", "4_anamaria_0_9_9", "30_katya_0_5_5"]
    assert beat.write(clips, tmp_path) == names
    got, _ = sort_out(beat.read(tmp_path), names)
    assert [got[n].split for n in names] == ["test", "test", "validation", "train", "test"]
    assert got["4_anamaria_0_9_9"].speaker == "anamaria"
    with pytest.raises(InputError, match="no id is left for fear"):
        beat.write([clips[2]] * 2, tmp_path)
    with pytest.raises(InputError, match="two clips"):
        beat.write([clips[5]] * 2, tmp_path)
    with pytest.raises(InputError, match="no emotion 'bored'"):
        beat.write([clip("f", emotion="bored", **short)], tmp_path)
    with pytest.raises(InputError, match="no motion"):
        beat.write([replace(clips[0], motion=None)], tmp_path)


def test_known_gaps_are_listed(tmp_path):
    for number in ("9", "10"):
        (tmp_path / "deep" / number).mkdir(parents=True)
    assert [item.name for item in beat.read(tmp_path)] == ["9_miranda_0_2_8"]


@pytest.mark.parametrize("kind", UNUSABLE)
def test_an_unusable_folder_is_an_error(tmp_path, kind):
    with pytest.raises(InputError, match="root"):
        beat.read(unusable(tmp_path, kind, "talk.wav"))


def test_one_take_at_a_time(raw, tmp_path):
    """The second take is not touched before it is asked for."""
    (tmp_path / "2").mkdir()
    for k in (1, 2):
        (tmp_path / "2" / f"2_scott_0_{k}_{k}.bvh").write_bytes((raw / "2" / "2_scott_0_74_74.bvh").read_bytes())
    items = beat.read(tmp_path)
    assert next(items).name == "2_scott_0_1_1"
    (tmp_path / "2" / "2_scott_0_2_2.bvh").unlink()
    assert "2_scott_0_2_2" in next(items).reason


@pytest.mark.slow
def test_memory_does_not_grow_with_the_corpus(raw, tmp_path):
    peaks = []
    for count in (2, 6):
        (tmp_path / "2").mkdir(exist_ok=True)
        for k in range(1, count + 1):
            (tmp_path / "2" / f"2_scott_0_{k}_{k}.bvh").write_bytes((raw / "2" / "2_scott_0_74_74.bvh").read_bytes())
        tracemalloc.start()
        assert sum(item.duration for item in beat.read(tmp_path)) == count
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] < 1.2 * peaks[0]


@pytest.mark.slow
def test_damaged_files_are_drops_or_sound(raw, tmp_path):
    rng = np.random.default_rng(3)
    whole = {p.suffix: p.read_bytes() for p in (raw / "2").iterdir()}
    bvh = b"\n".join(whole[".bvh"].split(b"\n")[: 431 + 3]) + b"\n"
    counts = {".bvh": 90, ".json": 60, ".TextGrid": 12, ".csv": 35, ".txt": 35, ".wav": 12}
    names = []
    for suffix, count in counts.items():
        for _ in range(count):
            name = f"3_solomon_{len(names) // 100}_{len(names) % 100}_1"
            names.append(name)
            folder = tmp_path / "3"
            folder.mkdir(exist_ok=True)
            (folder / f"{name}.bvh").write_bytes(bvh)
            if suffix in (".wav", ".TextGrid"):
                (folder / f"{name}.wav").write_bytes(whole[".wav"])
            (folder / f"{name}{suffix}").write_bytes(damage(bvh if suffix == ".bvh" else whole[suffix], rng))
    assert len(names) >= 200
    clips, reasons = sort_out(beat.read(tmp_path), names)
    assert len(reasons) > 90
    assert all(name in reason for name, reason in reasons.items())
    assert len(clips) > 5  # a nasty word in a name, a blank line: still sound


@pytest.mark.slow
def test_reading_is_at_least_twenty_times_as_fast_as_the_recording(tmp_path):
    beat.write([clip(frames=900, semantics=None)], tmp_path)
    best = np.inf
    for _ in range(3):
        start = sum(os.times()[:4])  # of the decoder of the sound too, which is a process of its own
        (item,) = islice(beat.read(tmp_path), 1)
        best = min(best, sum(os.times()[:4]) - start)
    assert item.duration == 30
    assert best < 30 / 20
