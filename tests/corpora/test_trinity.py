"""Trinity: what is written is read again, Google's transcripts as they come, damage becomes a drop."""

from __future__ import annotations

import json
import math
import shutil

import numpy as np
import pytest
import soundfile

from cospeech.corpora import Dropped
from cospeech.corpora.trinity import read as trinity
from cospeech.errors import InputError
from cospeech.motion.skeleton import find_skeleton
from cospeech.motion.skeletons.trinity import FULL_BODY, UPPER_BODY
from tests.support.corpus_files import UNUSABLE, WORDS, clip, damage, same_turns, sort_out, unusable


@pytest.fixture(scope="module")
def raw(tmp_path_factory):
    """One recording with all its files."""
    root = tmp_path_factory.mktemp("trinity")
    assert trinity.write([clip()], root) == ["Recording_001"]
    return root


@pytest.fixture
def recording(raw, tmp_path):
    """A function: new contents of the files by folder (None removes the file) → what the reader gives."""

    def read(name="Recording_001", **changes):
        (tmp_path / "Motion").mkdir(exist_ok=True)
        for path in raw.glob("*/*"):
            new = changes.get(path.parent.name, path.read_bytes())
            if new is not None:
                place = tmp_path / path.parent.name / (name + path.suffix)
                place.parent.mkdir(exist_ok=True)
                place.write_bytes(new if isinstance(new, bytes) else new.encode())
        (item,) = trinity.read(tmp_path)
        return item

    read.bvh = (raw / "Motion" / "Recording_001.bvh").read_text()
    return read


def test_reader_gives_what_was_written(raw):
    (got,) = trinity.read(raw)
    ours = clip()
    body = ours.motion.retarget("trinity").resample(60)
    assert (got.name, got.corpus, got.speaker, got.split) == ("Recording_001", "trinity", "trinity", "train")
    assert (got.motion.fps, got.motion.skeleton.kind, len(got.motion)) == (60, "trinity", len(body))
    assert same_turns(got.motion.rotations, body.rotations) < 1e-6
    assert np.allclose(got.motion.root, body.root, atol=1e-7)
    assert np.allclose(got.motion.skeleton.offsets, body.skeleton.offsets, atol=1e-6)
    assert got.speech.words == WORDS
    assert got.speech.seconds == ours.speech.seconds
    assert np.abs(got.speech.samples - ours.speech.samples)[400:-400].max() < 1e-3  # 16 bits, resampled twice
    assert (got.face, got.emotion, got.semantics) == (None, None, None)


def test_written_again_is_the_same(raw, tmp_path):
    trinity.write(trinity.read(raw), tmp_path)
    for folder, suffix in (("Motion", "bvh"), ("Transcripts", "json")):
        name = f"{folder}/Recording_001.{suffix}"
        assert (tmp_path / name).read_bytes() == (raw / name).read_bytes()


def test_files_are_laid_out_as_trinitys_are(raw):
    lines = (raw / "Motion" / "Recording_001.bvh").read_text().splitlines()
    channels = [line.strip() for line in lines if "CHANNELS" in line]
    assert channels[0] == "CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation"
    assert set(channels[1:]) == {"CHANNELS 3 Zrotation Xrotation Yrotation"}
    joints = [line.split()[1] for line in lines if line.split()[0] in ("ROOT", "JOINT")]
    assert joints == list(find_skeleton("trinity").names)
    assert "Frame Time: 0.016667" in lines
    assert len(lines[-1].split()) == 3 * len(joints) + 3
    about = soundfile.info(raw / "Audio" / "Recording_001.wav")
    assert (about.samplerate, about.channels, about.subtype, about.frames) == (44_100, 1, "PCM_16", 44_100)
    (segment,) = json.loads((raw / "Transcripts" / "Recording_001.json").read_text())
    assert segment["alternatives"][0]["words"][1] == {"start_time": "0.300s", "end_time": "0.550s", "word": "don't"}


def test_the_papers_joints():
    names = find_skeleton("trinity").names
    assert (len(names), len(UPPER_BODY) * 3, len(FULL_BODY) * 3 + 9) == (57, 45, 69)
    assert {*UPPER_BODY, *FULL_BODY} < set(names)


def test_recording_008_is_for_tests_whatever_it_is_called(raw, tmp_path):
    names = {
        "Recording_008": "test",
        "NaturalTalking_08": "test",
        "recording_8": "test",
        "Recording_018": "train",
        "Session2_008": "train",
    }
    (tmp_path / "Motion").mkdir()
    for name in names:
        shutil.copy(raw / "Motion" / "Recording_001.bvh", tmp_path / "Motion" / f"{name}.bvh")
    assert {item.name: item.split for item in trinity.read(tmp_path)} == names


def test_a_folder_above_and_test_data(raw, tmp_path):
    for place in ("Training_data", "Test_data"):
        trinity.write([clip(f"Recording_0{len(place)}", motion=clip(frames=2).motion, speech=None)], tmp_path / place)
    assert [(item.name, item.split, item.speech) for item in trinity.read(tmp_path)] == [
        ("Recording_09", "test", None),
        ("Recording_013", "train", None),
    ]


@pytest.mark.slow
def test_names_are_given(tmp_path):
    short = {"motion": clip(frames=2).motion, "speech": None}
    clips = [clip(str(k), split="test" if k in (3, 4) else None, **short) for k in range(9)]
    names = trinity.write([*clips, Dropped("x", "y")], tmp_path)
    numbers = [1, 2, 3, 8, 4, 5, 6, 7, 9]
    assert names == [f"Recording_{k:03d}" for k in numbers]
    got, _ = sort_out(trinity.read(tmp_path), names)
    assert sorted(n for n in got if got[n].split == "test") == ["Recording_004", "Recording_008"]
    (name,) = trinity.write([clip("Recording_8", split="train", **short)], tmp_path / "other")
    assert (name, next(trinity.read(tmp_path / "other")).split) == ("Recording_001", "train")
    with pytest.raises(InputError, match="two clips"):
        trinity.write([clip("Recording_001", **short)] * 2, tmp_path)
    with pytest.raises(InputError, match="no motion"):
        trinity.write([clip(motion=None)], tmp_path)


@pytest.mark.parametrize(
    "text",
    [
        '[{"alternatives": [{"words": [{"start_time": "0.1s", "end_time": "0.4s", "word": "Well,"}]}, {"words": []}]}, {}]',
        '{"results": [{"alternatives": [{"words": [{"startTime": "0.100s", "endTime": 0.4, "word": "Well"}]}]}]}',
    ],
)
def test_transcripts_of_google(recording, text):
    ((text, *times),) = [(w.text, w.start, w.end) for w in recording(Transcripts=text).speech.words]
    assert text == "Well"
    assert times == pytest.approx([0.1, 0.4])


def test_the_dirt_of_the_published_files(recording):
    """Hips with an OFFSET of the studio's, End Sites in small letters."""
    offset = "CHANNELS 6"
    bvh = recording.bvh.replace(
        "OFFSET 0.000000 0.000000 0.000000\n\t" + offset, "OFFSET -14.6414 90.2777 -84.916\n\t" + offset
    )
    assert bvh != recording.bvh
    got = recording(Motion=bvh.replace("End Site", "End site"))
    body = clip().motion.retarget("trinity").resample(60)
    assert np.allclose(got.motion.root, body.root, atol=1e-7)
    assert np.allclose(got.motion.skeleton.offsets, body.skeleton.offsets, atol=1e-6)


def test_side_files_may_be_missing(recording):
    got = recording(Audio=None)
    assert got.speech is None
    assert got.extra["words"] == WORDS
    assert len(got.motion) == 60


@pytest.mark.parametrize(
    ("folder", "text", "message"),
    [
        (
            "Transcripts",
            '[{"alternatives": [{"words": [{"start_time": "x", "end_time": "1s", "word": "a"}]}]}]',
            "segment 0, word 0",
        ),
        (
            "Transcripts",
            '[{}, {"alternatives": [{"words": [{"start_time": "2s", "end_time": "1s", "word": "a"}]}]}]',
            "segment 1",
        ),
        (
            "Transcripts",
            '[{"alternatives": [{"words": [{"start_time": "2s", "end_time": "3s", "word": "a"}]}]}]',
            "1.00 s long",
        ),
        ("Transcripts", '[{"alternatives": [{"words": 5}]}]', "segment 0 has no list of words"),
        ("Transcripts", "[NaN]", "holds NaN"),
        ("Transcripts", "[" * 5000, "Recording_001.json"),
        ("Motion", None, "'Recording_001.bvh' is not there"),
        ("Motion", "HIERARCHY\n", "Recording_001.bvh"),
        ("Audio", b"RIFF", "Recording_001.wav"),
    ],
)
def test_damage_is_told_with_its_place(recording, folder, text, message):
    item = recording(**{folder: text})
    assert isinstance(item, Dropped)
    assert message in item.reason


def test_another_corpus_is_told(recording):
    assert "no joint 'LeftHand'" in recording(Motion=recording.bvh.replace("LeftHand\n", "LeftPaw\n")).reason
    assert "30 frames per second" in recording(Motion=recording.bvh.replace("0.016667", "0.033333")).reason


@pytest.mark.parametrize("kind", UNUSABLE)
def test_an_unusable_folder_is_an_error(tmp_path, kind):
    with pytest.raises(InputError, match="root"):
        trinity.read(unusable(tmp_path, kind, "Audio/notes.md"))


@pytest.mark.slow
def test_damaged_files_are_drops_or_sound(raw, tmp_path):
    rng = np.random.default_rng(4)
    whole = {p.parent.name: p.read_bytes() for p in raw.glob("*/*")}
    lines = whole["Motion"].split(b"\n")
    short = b"\n".join(lines[: lines.index(b"Frame Time: 0.016667") + 4]) + b"\n"
    names = []
    for folder, count in {"Motion": 110, "Transcripts": 90, "Audio": 12}.items():
        for _ in range(count):
            name = f"Recording_{len(names) + 100}"
            names.append(name)
            for place, suffix in (("Motion", "bvh"), ("Audio", "wav"), ("Transcripts", "json")):
                (tmp_path / place).mkdir(exist_ok=True)
                if place in ("Motion", folder):
                    data = short if folder == place == "Motion" else whole[place]
                    data = damage(data, rng) if place == folder else data
                    (tmp_path / place / f"{name}.{suffix}").write_bytes(data)
    assert len(names) >= 200
    clips, reasons = sort_out(trinity.read(tmp_path), names)
    assert len(reasons) > 80
    assert all(name in reason for name, reason in reasons.items())
    assert len(clips) > 5  # a nasty word in a name, a blank line: still sound
    assert math.isfinite(sum(c.duration for c in clips.values()))
