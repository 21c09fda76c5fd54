"""``cospeech dialogue``: two files or a stereo file in, two characters out."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest
import soundfile

import cospeech
from cospeech.audio.speech import Speech, example
from cospeech.motion.motion import Motion

RATE = 16_000


@pytest.fixture(scope="module")
def sounds(tmp_path_factory):
    """A stereo file of 7.3 s, and its channels as files."""
    folder, speech = tmp_path_factory.mktemp("call"), Speech.load(example()[0]).samples
    tracks = np.zeros((round(7.3 * RATE), 2), np.float32)
    tracks[2_000 : 2_000 + 3 * RATE, 0] = speech[: 3 * RATE]
    tracks[60_000 : 60_000 + 3 * RATE, 1] = speech[4 * RATE : 7 * RATE]
    soundfile.write(folder / "call.wav", tracks, RATE)
    for name, track in zip(("host", "guest"), tracks.T, strict=True):
        soundfile.write(folder / f"{name}.wav", track, RATE)
    (folder / "host.srt").write_text("1\n00:00:00,200 --> 00:00:02,900\nHello there\n", "utf-8")
    (folder / "guest.srt").write_text("1\n00:00:03,900 --> 00:00:06,500\nGood morning\n", "utf-8")
    return folder


@pytest.fixture
def place(sounds, tmp_path, monkeypatch):
    for path in sounds.iterdir():
        (tmp_path / path.name).write_bytes(path.read_bytes())
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_two_files_and_a_stereo_file_give_the_same_two_characters(cli, place):
    code, out, _ = cli("dialogue", "host.wav", "guest.wav", "-o", "{name}.npz", "--seed", 4)
    assert code == 0
    assert "2 speeches: 14.60 s" in out
    code, _, _ = cli("dialogue", "call.wav", "-o", "out/{name}.npz", "--seed", 4, "-q")
    assert code == 0
    for left, right in (("host", "call.left"), ("guest", "call.right")):
        apart, together = Motion.load(f"{left}.npz"), Motion.load(f"out/{right}.npz")
        assert len(apart) == 219, "both are as long as the conversation"
        assert np.array_equal(apart.rotations, together.rotations)


def test_each_person_speaks_with_its_own_voice_and_rests_in_the_others(cli, place):
    assert cli("dialogue", "call.wav", "-o", "{name}.npz", "-q")[0] == 0
    jaws = [Motion.load(f"call.{side}.npz") for side in ("left", "right")]
    jaws = [np.abs(np.gradient(each.face[:, _jaw()])) for each in jaws]
    for own, (low, high) in enumerate(((10, 90), (120, 200))):
        assert jaws[own][low:high].mean() > 5 * jaws[1 - own][low:high].mean()


def _jaw():
    from cospeech.motion.skeletons.arkit import ARKIT_INDEX

    return ARKIT_INDEX["jawOpen"]


def test_options_are_of_both_or_of_each(cli, place):
    code, _, _ = cli(
        "dialogue", "host.wav", "guest.wav", "-o", "{name}.bvh", "--style", "calm", "--style", "lively", "--model", "rules",
        "--transcript", "{name}.srt", "--report", "report.json", "--intensity", 0.5, "-q",
    )  # fmt: skip
    assert code == 0
    speeches = json.loads((place / "report.json").read_text("utf-8"))["speeches"]
    assert [each["style"] for each in speeches] == ["calm", "lively"]
    assert [each["speech"] for each in speeches] == ["host", "guest"]
    assert [each["outputs"] for each in speeches] == [["host.bvh"], ["guest.bvh"]]
    assert [each["language"] for each in speeches] == ["en", "en"]


def test_one_recording_of_all_with_a_file_that_says_who_speaks(cli, place):
    left, right = soundfile.read("host.wav")[0], soundfile.read("guest.wav")[0]
    soundfile.write("talk.wav", left + right, RATE)
    words = [
        {"word": "Hello", "start": 0.2, "end": 1.0, "speaker": "Ann B."},
        {"word": "there", "start": 1.0, "end": 2.9, "speaker": "Ann B."},
        {"word": "morning", "start": 3.9, "end": 6.5, "speaker": "bob"},
    ]
    (place / "talk.json").write_text(json.dumps({"segments": [{"words": words}]}), "utf-8")
    code, _, err = cli("dialogue", "talk.wav", "--speakers", "talk.json", "-o", "{name}.npz", "--report", "r.json")
    assert code == 0
    assert re.search(r"2 persons: talk\.Ann_B\. [23] s, talk\.bob [23] s", err)
    names = {path.name for path in place.iterdir()}
    assert {"talk.Ann_B..npz", "talk.bob.npz"} <= names
    report = json.loads((place / "r.json").read_text("utf-8"))["speeches"]
    assert [each["language"] for each in report] == ["en", "en"], "both have words"
    jaws = [np.abs(np.gradient(Motion.load(f"talk.{name}.npz").face[:, _jaw()])) for name in ("Ann_B.", "bob")]
    assert jaws[0][10:85].mean() > 5 * jaws[1][10:85].mean()
    assert jaws[1][125:190].mean() > 5 * jaws[0][125:190].mean()


def test_a_file_that_says_who_speaks_without_words_and_long_names(cli, place):
    soundfile.write("talk.wav", soundfile.read("host.wav")[0] + soundfile.read("guest.wav")[0], RATE)
    segments = [{"start": 0.1, "end": 3.0, "speaker": "x" * 300}, {"start": 3.8, "end": 6.7, "speaker": "a/../b"}]
    (place / "talk.json").write_text(json.dumps({"segments": segments}), "utf-8")
    code, _, err = cli("dialogue", "talk.wav", "--speakers", "talk.json", "-o", "out/{name}.npz", "-q")
    assert code == 0, err
    assert {path.name for path in (place / "out").iterdir()} == {f"talk.{'x' * 40}.npz", "talk.a_.._b.npz"}


def test_one_person_of_several_is_generated_as_among_all(cli, place):
    assert cli("dialogue", "call.wav", "-o", "all/{name}.npz", "-q")[0] == 0
    assert cli("dialogue", "call.wav", "-o", "one/{name}.npz", "--person", "right", "-q")[0] == 0
    assert [path.name for path in (place / "one").iterdir()] == ["call.right.npz"]
    assert (place / "one" / "call.right.npz").read_bytes() == (place / "all" / "call.right.npz").read_bytes()


def test_a_video_without_name_shows_all_persons_and_is_written_beside_other_files(cli, place):
    av = pytest.importorskip("av", reason="needs PyAV: cospeech[av]")
    sound, _ = soundfile.read("call.wav")
    soundfile.write("short.wav", sound[30_000:70_000], RATE)
    code, out, _ = cli(
        "dialogue", "short.wav", "-o", "both.mp4", "-o", "{name}.bvh", "--report", "r.json", "--skeleton", "mixamo"
    )
    assert code == 0
    rows = json.loads((place / "r.json").read_text("utf-8"))["speeches"]
    assert [each["outputs"] for each in rows] == [["short.left.bvh", "both.mp4"], ["short.right.bvh", "both.mp4"]]
    assert "both.mp4  2 persons side by side" in out
    assert {"both.mp4", "short.left.bvh", "short.right.bvh"} <= {path.name for path in place.iterdir()}
    with av.open("both.mp4") as film:
        assert film.streams.audio
        assert (film.streams.video[0].width, film.streams.video[0].frames) == (1280, 75)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (["-o", "{name}.bvh", "--person", "left"], "a film of 1 character (2 … 6"),
        (["-o", "{name}.bvh", "--avatar", "nope.vrm"], "no avatar at 'nope.vrm'"),
        (["--avatar", "nope.vrm"], "no avatar at 'nope.vrm'"),
        (["--tail", "90"], "tail 90 is out of range (0 … 60)"),
        (["--skeleton", "nope"], "'nope'"),
        (["--skeleton", "mixamo"], "skeleton 'mixamo' would not be seen in .mp4"),
        (["--report", "r.json"], "'r.json' reports on the files of each person, and there are none (add -o '{name}.bvh')"),
    ],
)
def test_a_video_that_cannot_be_made_is_told_before_anything_is_written(cli, place, given, message):
    pytest.importorskip("av", reason="needs PyAV: cospeech[av]")
    before = {path.name for path in place.iterdir()}
    code, out, err = cli("dialogue", "call.wav", "-o", "x.mp4", *given)
    assert (code, out) == (2, "")
    assert message in err
    assert {path.name for path in place.iterdir()} == before


def test_without_output_a_bvh_and_a_glb_of_each_are_written_over_nothing(cli, place):
    assert cli("dialogue", "call.wav", "-q")[0] == 0
    assert {path.name for path in place.iterdir() if path.suffix in (".bvh", ".glb")} == {
        "call.left.bvh", "call.left.glb", "call.right.bvh", "call.right.glb"
    }  # fmt: skip
    code, _, err = cli("dialogue", "call.wav")
    assert code == 2
    assert "'call.left.bvh' is there already" in err


def test_angle_turns_the_heads_to_each_other(cli, place):
    from cospeech.face.gaze import direction_of, head_rotation

    assert cli("dialogue", "call.wav", "-o", "{name}.npz", "-q", "--angle", 40)[0] == 0
    motions = [Motion.load(f"call.{side}.npz").retarget("humanoid") for side in ("left", "right")]
    yaw = [np.median(direction_of(head_rotation(each.rotations))[:, 0]) for each in motions]
    assert np.degrees(yaw[0]) > 18
    assert np.degrees(yaw[1]) < -18


def test_three_persons_look_at_the_one_who_speaks(cli, place):
    """They are around a table: for the first one, the second one is 30° to the left and the third one 30° to the right."""
    from cospeech.face.gaze import direction_of, head_rotation

    speech, tracks = Speech.load(example()[0]).samples, np.zeros((11 * RATE, 3))
    for k, begin in enumerate((0, 4, 8)):
        tracks[begin * RATE : (begin + 3) * RATE, k] = speech[begin * RATE : (begin + 3) * RATE]
        soundfile.write(f"p{k}.wav", tracks[:, k], RATE)
    assert cli("dialogue", "p0.wav", "p1.wav", "p2.wav", "-o", "{name}.npz", "-q")[0] == 0
    head = head_rotation(Motion.load("p0.npz").retarget("humanoid").rotations)
    yaw = np.degrees(direction_of(head))[:, 0]
    second, third = np.median(yaw[165:210]), np.median(yaw[285:325])
    assert second > 5
    assert third < -5
    assert second - third > 35, "the head goes three quarters of the way of 60°"


def test_a_name_from_a_file_is_one_of_a_file_in_the_folder_that_was_named(cli, place):
    names = ["../../\ud800up", "A\x9b2J\u202egpj\x7f", "علی\u200cرضا", "con\0.", "{name}", ".."]
    turns = [{"speaker": name, "start": k, "end": k + 0.9} for k, name in enumerate(names)]
    (place / "who.json").write_text(json.dumps(turns), "utf-8")
    code, out, err = cli("dialogue", "host.wav", "--speakers", "who.json", "-o", "out/{name}.csv")
    assert code == 0
    stems = ["host..._..__up", "host.A_2J_gpj_", "host.علی\u200cرضا", "host.con_.", "host.{name}", "host..."]
    assert {path.name for path in (place / "out").iterdir()} == {f"{name}.csv" for name in stems}
    assert not re.search(r"[\x00-\x09\x0b-\x1f\x7f-\x9f\u202e]", out + err), "nothing that a terminal obeys"


def test_names_that_are_one_on_other_systems_are_told(cli, place):
    turns = [{"speaker": name, "start": k, "end": k + 0.9} for k, name in enumerate(("ZO\u00cb", "zoe\u0308"))]
    (place / "who.json").write_text(json.dumps(turns), "utf-8")
    code, _, err = cli("dialogue", "host.wav", "--speakers", "who.json", "-o", "{name}.csv")
    assert code == 2
    assert "two speakers whose files would be called 'host.ZOË' (rename one of them)" in err


def test_a_sound_file_without_a_name_writes_nothing_around_the_folder(cli, place):
    (place / "host.wav").rename("...wav")
    for command in (["dialogue", "...wav", "guest.wav"], ["generate", "...wav"]):
        code, _, err = cli(*command, "-o", "out/{name}/talk.csv")
        assert code == 2
        assert "'...wav' has no name before its suffix (rename it)" in err
    assert not list(place.rglob("talk.csv"))


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (["host.wav"], "'host.wav' has one channel (a file for each person"),
        (["host.wav", "host.wav"], "two sound files are called 'host.wav'"),
        (["call.wav", "-o", "x.glb"], "one file 'x.glb' for several persons (-o '{name}.glb'"),
        (["call.wav", "-o", "{name}.xyz"], "cannot tell the format of '{name}.xyz'"),
        (["host.wav", "guest.wav", "-o", "{name}.bvh", "-o", "guest.bvh"], "one file 'guest.bvh' for several persons"),
        (["call.wav", "--person", "lefft"], "nobody is called 'lefft' (did you mean 'left'?"),
        (["host.wav", "guest.wav", "--person", ""], "nobody is called ''"),
        (["host.wav", "guest.wav", "--speakers", "who.rttm"], "--speakers for 2 sound files"),
        (["host.wav", "--speakers", "host.srt"], "'host.srt' does not say who speaks when"),
        (["host.wav", "--speakers", "alone.rttm"], "'alone.rttm' names only 'ann'"),
        (["host.wav", "--speakers", "who.rttm", "--transcript", "a.srt", "--transcript", "b.srt"], "with --speakers (one file"),
        (["host.wav", "guest.wav", "third.wav", "--angle", "30"], "an angle between 3 persons"),
        (["call.wav", "-o", "{name}.bvh", "--style", "a", "--style", "b", "--style", "c"], "--style is given 3 times"),
        (["call.wav", "-o", "{name}.bvh", "--style", "calm", "--style", "nope"], "no style is called 'nope'"),
        (["call.wav", "-o", "{name}.bvh", "--transcript", "host.srt"], "one transcript 'host.srt' for 2 persons"),
        (["call.wav", "-o", "{name}.bvh", "--transcript", "host.srt", "--transcript", "missing.srt"], "'missing.srt'"),
        (["call.wav", "-o", "{name}.bvh", "--angle", "75"], "an angle of 75 degrees"),
        (["call.wav", "-o", "{name}.bvh", "--model", "nope"], "'nope'"),
        (["call.wav", "-o", "{name}" + 250 * "x" + ".bvh"], "too long (choose a shorter one)"),
        (["same.wav", "-o", "{name}.bvh"], "are the same sound (each person needs a track of their own"),
        (["call.wav", "-o", "missing/x/{name}.bvh", "--report", "nowhere/r.json"], "nowhere/r.json"),
    ],
)
def test_what_cannot_be_used_is_told_and_nothing_is_written(cli, place, given, message):
    mono = soundfile.read("host.wav")[0]
    soundfile.write("same.wav", np.stack([mono, mono], 1), RATE)
    soundfile.write("third.wav", mono[::-1], RATE)
    line = "SPEAKER x 1 {} 1.0 <NA> <NA> {} <NA> <NA>\n"
    (place / "alone.rttm").write_text(line.format(0.5, "ann"), "utf-8")
    (place / "who.rttm").write_text(line.format(0.5, "ann") + line.format(4.0, "bob"), "utf-8")
    before = {path.name for path in place.iterdir()}
    code, out, err = cli("dialogue", *given)
    assert (code, out) == (2, "")
    assert message in err
    assert err.count("\n") <= 2
    assert err.splitlines()[-1].startswith("error: ")
    assert {path.name for path in place.iterdir()} == before


def test_the_rig_and_the_example_that_are_read_are_not_written_over(cli, place):
    cospeech.load("rules").generate(Speech(np.zeros(RATE // 4, np.float32), RATE)).save("host.bvh")
    rig = (place / "host.bvh").read_bytes()
    for given in (["--skeleton", "host.bvh"], ["--style", "host.bvh"], ["--style", "calm:0.7,host.bvh:0.3"]):
        code, out, err = cli("dialogue", "host.wav", "guest.wav", "-o", "{name}.bvh", *given)
        assert (code, out) == (2, "")
        assert "'host.bvh' would overwrite what is read" in err
        assert (place / "host.bvh").read_bytes() == rig


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (["--style", "calm", "--style", "nope"], "no style is called 'nope'"),
        (["--emotion", "auto", "--emotion", "nope"], "'nope'"),
        (["--model", "rules", "--model", "nope"], "'nope'"),
    ],
)
def test_the_options_of_all_persons_are_checked_before_the_first_one_is_generated(cli, place, monkeypatch, given, message):
    monkeypatch.setattr("cospeech.generate.generate_files", lambda *_, **__: pytest.fail("a person was generated"))
    code, out, err = cli("dialogue", "host.wav", "guest.wav", "-o", "{name}.bvh", *given)
    assert (code, out) == (2, "")
    assert message in err
