"""Several speeches, folders and standard input; options that change nothing are told."""

from __future__ import annotations

import errno
import json
import os
import pty
import re
import shutil
import signal
import subprocess
import sys
import time
import warnings
from pathlib import Path

import numpy as np
import pytest
import soundfile

import cospeech
from cospeech import generate
from cospeech.audio.emotions import EmotionTrack
from cospeech.cli.batch import generate_speeches
from cospeech.cli.demo import EXAMPLE
from cospeech.errors import CospeechWarning, InputError
from cospeech.export import FORMATS
from cospeech.models import PARTS
from cospeech.motion.skeleton import find_skeleton
from cospeech.runtime.report import Report

pytestmark = pytest.mark.slow

COSPEECH = [sys.executable, "-m", "cospeech"]


@pytest.fixture
def place(tmp_path, monkeypatch):
    """A working folder with speeches of different lengths, one of them damaged."""
    monkeypatch.chdir(tmp_path)
    speech, rate = soundfile.read(EXAMPLE, frames=96_000, dtype="float32")
    for k, name in enumerate(("rec/me/a", "rec/me/b", "rec/you/a", "talk"), 1):
        Path(name).parent.mkdir(parents=True, exist_ok=True)
        soundfile.write(f"{name}.wav", speech[: rate // 4 * k], rate)
    Path("rec/you/notes.txt").write_text("no sound\n", encoding="utf-8")
    return tmp_path


def files(folder: str) -> list[str]:
    return sorted(path.relative_to(folder).as_posix() for path in Path(folder).rglob("*") if path.is_file())


def test_a_folder_goes_into_a_folder(cli, place):
    code, out, err = cli("generate", "rec", "-o", "out/", "--report", "r.json")
    assert (code, err) == (0, "")
    assert files("out") == [f"{name}{suffix}" for name in ("me/a", "me/b", "you/a") for suffix in (".bvh", ".glb")]
    assert out.startswith("3 speeches: 1.50 s of speech, ")
    report = json.loads(Path("r.json").read_text(encoding="utf-8"))
    assert [row["outputs"][0] for row in report["speeches"]] == ["out/me/a.bvh", "out/me/b.bvh", "out/you/a.bvh"]
    assert report["failed"] == []
    assert cli("generate", "rec/you/a.wav", "-o", "alone.bvh", "-q") == (0, "", "")
    assert Path("alone.bvh").read_bytes() == Path("out/you/a.bvh").read_bytes()  # each by itself


def test_several_files_by_a_pattern_with_takes_and_words(cli, place):
    Path("words").mkdir()
    for name in ("a", "talk"):
        Path(f"words/{name}.txt").write_text("hello all of you\n", encoding="utf-8")
    line = ["generate", "rec/me/a.wav", "talk.wav", "-o", "out/{name}-new.vrma", "-o", "out/face/{name}.csv"]
    assert cli(*line, "--takes", 2, "--transcript", "words/{name}.txt", "-q") == (0, "", "")
    assert files("out") == sorted(
        f"{name}" for speech in ("a", "talk") for k in (1, 2) for name in (f"{speech}-new.{k}.vrma", f"face/{speech}.{k}.csv")
    )


def test_one_speech_into_a_folder(cli, place):
    Path("there").mkdir()
    assert cli("generate", "talk.wav", "-o", "there", "-o", "new/{name}.npz", "-q") == (0, "", "")
    assert (files("there"), files("new")) == (["talk.bvh", "talk.glb"], ["talk.npz"])
    report = generate_speeches(["talk.wav"], ["one.bvh"], report="r.json").speeches[0]
    assert json.loads(Path("r.json").read_text(encoding="utf-8"))["outputs"] == report.outputs == ["one.bvh"]


def test_what_several_speeches_share_need_be_no_file(place):
    track = EmotionTrack.constant("anger")
    batch = generate_speeches(["rec/me/a.wav", "talk.wav"], ["out/{name}.bvh"], emotion=track, skeleton=find_skeleton("mixamo"))
    assert not batch.failed
    assert files("out") == ["a.bvh", "talk.bvh"]


def test_a_bad_one_does_not_keep_back_the_others(cli, place):
    Path("rec/me/b.wav").write_text("this is no sound\n" * 100, encoding="utf-8")
    code, out, err = cli("generate", "rec", "-o", "out/{name}.bvh", "--report", "r.json")
    assert code == 2
    assert err.startswith("error: 1 of 3 speeches failed: rec/me/b.wav: 'b.wav': not a sound file")
    assert err.count("\n") == 1
    assert files("out") == ["me/a.bvh", "you/a.bvh"]
    assert out.startswith("2 speeches: ")
    report = json.loads(Path("r.json").read_text(encoding="utf-8"))
    assert [row["speech"] for row in report["failed"]] == ["rec/me/b.wav"]
    for path in Path("rec").rglob("*.wav"):
        path.write_text("nor this\n" * 100)
    code, out, err = cli("generate", "rec", "-o", "none/{name}.bvh")
    assert (code, out) == (2, "")
    assert "3 of 3 speeches failed" in err
    assert not Path("none").exists()


def test_an_interrupted_run_goes_on(cli, place):
    line = ["generate", "rec", "-o", "out/{name}.csv", "--plan-out", "plans/{name}.json", "--parts", "face,body"]
    Path("rec/me/b.wav").rename("b.wav")
    Path("rec/me/b.wav").write_text("this is no sound\n" * 100, encoding="utf-8")
    assert cli(*line, "-q")[0] == 2
    Path("b.wav").replace("rec/me/b.wav")
    times = {path: path.stat().st_mtime_ns for path in (Path("out/me/a.csv"), Path("out/you/a.csv"))}
    code, out, err = cli(*line, "--resume")
    assert (code, err) == (0, "note: 2 of 3 speeches left out: their files are there (--resume)\n")
    assert files("out") == ["me/a.csv", "me/b.csv", "you/a.csv"]
    assert re.findall(r"out/\S+", out) == ["out/me/b.csv"]
    assert {path: path.stat().st_mtime_ns for path in times} == times
    code, out, err = cli(*line, "--resume")
    assert (code, out, err) == (0, "", "note: 3 of 3 speeches left out: their files are there (--resume)\n")
    os.utime("rec/you/a.wav", (time.time() + 9, time.time() + 9))  # it was recorded again
    Path("plans/me/a.json").unlink()
    assert "1 of 3 speeches left out" in cli(*line, "--resume", "-q")[2]
    assert files("plans") == ["me/a.json", "me/b.json", "you/a.json"]
    assert Path("out/you/a.csv").stat().st_mtime_ns > times[Path("out/you/a.csv")]


BAD = [
    ("generate talk.wav rec/me/a.wav -o x.bvh", "one file 'x.bvh' for several speeches (a folder, -o out/, or -o 'out/{na"),
    ("generate rec -o out/ --style livly", "did you mean 'lively'"),
    ("generate rec -o out/ --model rulse", "did you mean 'rules'"),
    ("generate rec -o out/ --fps 0", "fps 0"),
    ("generate rec -o out/ --transcript x.srt", "one transcript 'x.srt' for several speeches"),
    ("generate rec talk.wav -o out/ --face x.csv", "one face 'x.csv' for several speeches"),
    ("generate rec/me/a.wav rec/you/a.wav -o out/", "are both called 'a'"),
    ("generate talk.wav rec/me/a.wav -o out/{name}.xyz", "known suffixes"),
    ("generate talk.wav rec/me/a.wav -o {name}.bvh -o ./{name}.bvh", "overwrite"),
    ("generate talk.wav rec/me/a.wav -o out/ --report nowhere/r.json", "folder exist"),
    ("generate rec/me rec/you -o out/", "(name the folder above them, 'rec': names then begin with the folders below it"),
    ("generate empty -o out/", "no sound file is in the folder 'empty'"),
    ("generate talk.wav - -o out/", "standard input"),
    ("generate /dev/stdin -o x.bvh", "cannot read '/dev/stdin': it is standard input (name it -, as in `cospeech generate - "),
    ("generate talk.wav -o talk.wav/", "talk.wav"),
    ("generate talk.wav -o x.bvh --parts face", "'x.bvh' would not move"),
    ("generate talk.wav -o x.csv --parts body,hands", "'x.csv' would not move"),
    ("generate talk.wav -o x.glb -o x.json --parts hands", "'x.json' would not move"),
    ("generate talk.wav -o x.bvh --model speech-to-face", "speech-to-face makes face only"),
    ("generate talk.wav -o x.glb --model speech-to-face --parts hands", "makes no hands"),
    ("generate talk.wav -o x.glb --skeleton mixamo", "skeleton 'mixamo' would not be seen"),
    ("generate talk.wav", "'talk.bvh' is there already (-o talk.bvh writes over it; -o out/ writes to another folder)"),
    ("generate talk.wav rec", "'talk.bvh' is there already"),
    ("generate talk.wav -o x.vrm --avatar talk.bvh", "motion for it is a .vrma"),
    ("generate talk.wav -o x.bvh --gesture huge@word:tiny", "give a transcript, with times or without"),
    ("generate talk.wav -o x.bvh --transcript words.srt --plan-out words.srt", "'words.srt' would overwrite what is read"),
    ("generate talk.wav -o x.bvh --emotion moods.csv --plan-out moods.csv", "'moods.csv' would overwrite what is read"),
    ("generate talk.wav -o x.bvh --plan-out x.bvh", "'x.bvh' would overwrite another output"),
    ("generate talk.wav rec/me/a.wav -o out/ --emotion moods.csv --report moods.csv", "would overwrite what is read"),
    ("generate talk.wav rec/me/a.wav -o out/ --skeleton talk.bvh --report talk.bvh", "would overwrite what is read"),
    ("generate talk.wav rec/me/a.wav -o out/ --report out/{name}.json", "one file holds the reports of all"),
    ("generate rec/me/a.wav -o x.bvh --keep 0.6:0.9 talk.bvh", "is to be kept, is after the end (0.25 s"),
    ("generate talk.wav -o x.glb --face-gain 1,2", "has two numbers for jaw, mouth and tongue"),
    ("generate talk.wav -o x.glb --face-gain jawOpen:1,jawOpen:0.2", "has two numbers for jawOpen"),
    ("robot talk.wav moods.csv --emotion moods.csv", "would overwrite what is read"),
    ("convert talk.bvh", "missing argument: MOTION and FILE are needed"),
    ("render talk.bvh", "missing argument: MOTION and PICTURE are needed"),
    ("convert talk.bvh x.glb --from -1", "-1 s is before the motion (the motion lasts from 0 to"),
    ("convert talk.bvh x.csv", "holds body and hands only, .csv files hold face"),
    ("convert talk.bvh x.json", "would not move"),
    ("convert talk.csv x.bvh", "holds face only, .bvh files hold body and hands"),
    ("convert talk.bvh x.glb --skeleton mixamo", "would not be seen"),
    ("render talk.csv x.png --camera hands", "holds a face only"),
    ("render talk.csv x.png --camera fac", "no camera called 'fac'"),
    ("convert rec x.bvh", "no motion file is in the folder"),
    ("convert - x.bvh", "standard input"),
    ("evaluate rules --corpus x --small", "--small without --table"),
    ("evaluate --table flow-1 --corpus x --takes 3", "--takes beside --table"),
    ("evaluate --table flow-1 --corpus x --headroom --figure a.png", "--figure beside --headroom"),
    ("evaluate rules --corpus x -o nowhere/t.json", "'nowhere/t.json': No such file"),
    ("evaluate --hearing x --corpus x -o rec", "it is a folder"),
    ("evaluate rules --corpus x -o t.txt", "a table as .txt (known: .json .csv .tex)"),
    ("evaluate --hearing x --corpus x -o t.csv", "a table as .csv (known: .json)"),
    *(
        (f"evaluate --hearing x --corpus x {option}", f"{option.split()[0]} beside --hearing")
        for option in ("--metrics fgd", "--takes 9", "--seed 7", "--seed-frames 3", "--features run", "--raw rec")
    ),
    ("evaluate --table flow-1 --corpus x -o t.tex", "a table as .tex (known: .json)"),
    ("evaluate --table flow-1 --corpus x --figure a.gif", "ends in .png"),
    ("evaluate --table flow-1 --corpus x --figure nowhere/a.png", "'nowhere/a.png': No such file"),
    ("evaluate rules --corpus x --seed-frames -1", "value for '--seed-frames'"),
    ("prepare folder rec rec", "there are recordings in 'rec'"),
    ("prepare folder rec rec/me/s", "the store 'rec/me/s' would lie in the folder of the corpus 'rec'"),
    ("prepare folder rec s --scheduler tcp://x:1", "for the backend 'loky'"),
]  # fmt: skip


@pytest.mark.parametrize(("line", "message"), BAD, ids=[line for line, _ in BAD])
def test_what_cannot_be_is_one_line_and_leaves_nothing(cli, place, line, message):
    Path("empty").mkdir()
    Path("words.srt").write_text("1\n00:00:00,000 --> 00:00:00,500\nhello\n", encoding="utf-8")
    Path("moods.csv").write_text("time,emotion\n0,anger\n", encoding="utf-8")
    motion = cospeech.load("rules").generate(cospeech.Speech.load("talk.wav"))
    motion.save("talk.bvh")
    motion.save("talk.csv")
    before = sorted(place.rglob("*"))
    code, out, err = cli(*line.split())
    assert (code, out) == (2, "")
    assert err.startswith("error: ")
    assert err.count("\n") == 1
    assert message in err
    assert sorted(place.rglob("*")) == before


@pytest.mark.parametrize("suffix", FORMATS)
@pytest.mark.parametrize("part", PARTS)
def test_formats_hold_what_they_say(place, suffix, part):
    """Each part alone: a format that holds it writes two performances differently; one that does not refuses it."""
    if suffix == ".mp4":
        pytest.importorskip("av", reason="needs PyAV (cospeech[av])")
    if part not in FORMATS[suffix].holds:
        with pytest.raises(InputError, match="would not move"):
            generate_speeches(["talk.wav"], [f"x{suffix}"], parts=(part,))
        return
    for name, intensity in (("moving", 1.0), ("other", 2.0)):
        generate_speeches(["talk.wav"], [f"{name}{suffix}"], parts=(part,), seed=int(intensity), style="lively")
    assert Path(f"moving{suffix}").read_bytes() != Path(f"other{suffix}").read_bytes()


def test_without_an_output_only_what_moves_is_written(cli, place):
    assert cli("generate", "talk.wav", "--parts", "face", "-q") == (0, "", "")
    assert not Path("talk.bvh").exists()
    assert Path("talk.glb").exists()


def test_a_face_alone_is_shown_near(cli, place):
    assert cli("generate", "talk.wav", "-o", "talk.csv", "-q")[0] == 0
    assert cli("render", "talk.csv", "near.png") == cli("render", "talk.csv", "near.png", "--camera", "face")
    assert cli("render", "talk.csv", "near.png")[1] == "near.png  (any picture viewer: a strip of frames)\n"
    assert cli("convert", "talk.csv", "same.png", "-q")[0] == 0
    assert Path("near.png").read_bytes() == Path("same.png").read_bytes()


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("generate talk.wav -o a.bvh --face-gain 1.5 -q", "face_gain changes nothing"),
        ("generate talk.wav -o a.glb --parts body --face-gain 1.5 -q", "face_gain changes nothing"),
        ("render talk.bvh a.gif --audio talk.wav -q", "the speech changes nothing"),
        ("convert talk.csv a.json --map m.toml -q", "the map changes nothing"),
    ],
)
def test_what_changes_nothing_is_said(cli, place, line, message):
    motion = cospeech.load("rules").generate(cospeech.Speech.load("talk.wav"))
    motion.save("talk.bvh")
    motion.save("talk.csv")
    Path("m.toml").write_text('[bones]\nhips = "hips"\n', encoding="utf-8")
    code, out, err = cli(*line.split())
    assert (code, out) == (0, "")
    assert err.startswith("note: ")
    assert err.count("\n") == 1
    assert message in err
    with warnings.catch_warnings():
        warnings.simplefilter("error", CospeechWarning)
        assert cli("generate", "talk.wav", "-o", "b.glb", "--face-gain", "1.5", "-q") == (0, "", "")


def test_standard_input(place):
    sound = Path("talk.wav").read_bytes()
    process = subprocess.run([*COSPEECH, "generate", "-", "-o", "a.bvh", "-q"], input=sound, capture_output=True)
    assert (process.returncode, process.stdout, process.stderr) == (0, b"", b"")
    subprocess.run([*COSPEECH, "generate", "talk.wav", "-o", "b.bvh", "-q"], check=True)
    assert Path("a.bvh").read_bytes() == Path("b.bvh").read_bytes()
    before = sorted(place.rglob("*"))
    for given, line, message in (
        (sound, ["-"], b"no file to write for standard input"),
        (b"", ["-", "-o", "c.bvh"], b"0 bytes"),
        (b"no sound" * 1000, ["-", "-o", "c.bvh"], b"'stdin'"),
    ):
        process = subprocess.run([*COSPEECH, "generate", *line], input=given, capture_output=True)
        assert (process.returncode, process.stdout) == (2, b"")
        assert message in process.stderr
    ours, theirs = pty.openpty()  # a terminal, at which nobody types a WAV
    process = subprocess.run([*COSPEECH, "generate", "-", "-o", "c.bvh"], stdin=theirs, capture_output=True, timeout=60)
    os.close(ours)
    os.close(theirs)
    assert b"no sound on standard input" in process.stderr
    assert sorted(place.rglob("*")) == before


def test_standard_input_has_an_end(place, monkeypatch):
    monkeypatch.setattr("cospeech.cli.batch.PIPED_BYTES", 1000)
    with Path("talk.wav").open("rb") as sound:
        monkeypatch.setattr(sys, "stdin", type("Piped", (), {"buffer": sound, "isatty": lambda self: False})())
        with pytest.raises(InputError, match="on standard input"):
            generate_speeches(["-"], ["c.bvh"])


def test_no_help_is_cut(cli, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    commands = ["", *(row.split()[0] for row in COMMANDS.splitlines())]
    for command in commands:
        code, text, _ = cli(*command.split(), "--help")
        assert code == 0
        without_dots = re.sub(r"(\[ARGS\]|\{SPEECH\}|\{MOTION\}|SPEECH|\[SYSTEM\]|\])\.\.\.", "", text)  # as many as one likes
        assert "..." not in without_dots, command
        plain = [line for line in text.splitlines() if not re.match(r"  (cospeech|torchrun) ", line)]  # examples
        assert max(map(len, plain)) <= 80, command


COMMANDS = (
    "generate\nstream\nconvert\nrender\nrobot\nlist\ndemo\nbench\nprepare\nsynthesise\nevaluate\ntrain\nbundle\nstudio\nstudy"
)


def test_several_processes_make_what_one_makes(cli, place):
    Path("rec/me/bad.wav").write_bytes(b"no sound")
    for folder, jobs in (("one", "1"), ("two", "2")):
        code, _, err = cli("generate", "rec/me", "-o", f"{folder}/", "-q", "--jobs", jobs, "--report", f"{folder}.json")
        assert code == 2
        assert "1 of 3 speeches failed: rec/me/bad.wav" in err
    assert files("one") == files("two")
    assert all(Path("one", name).read_bytes() == Path("two", name).read_bytes() for name in files("one"))
    orders = [
        [row["outputs"][0][4:] for row in json.loads(Path(name).read_text(encoding="utf-8"))["speeches"]]
        for name in ("one.json", "two.json")
    ]
    assert orders == [["a.bvh", "b.bvh"]] * 2
    assert cli("generate", "rec", "-o", "four/", "--jobs", "0")[0] == 2


def test_a_pattern_that_the_shell_left_is_looked_up(cli, place):
    assert cli("generate", "rec/me/?.wav", "-o", "out/{name}.bvh", "-q") == (0, "", "")
    assert files("out") == ["a.bvh", "b.bvh"]
    code, _, err = cli("generate", "rec/*.mp3", "-o", "out/")
    assert code == 2
    assert "no file is called 'rec/*.mp3'" in err


def test_a_pattern_is_looked_up_in_all_its_parts(cli, place):
    Path("[old] rec").symlink_to("rec")
    Path("rec/none").mkdir()
    both, every = ["me/a", "you/a"], ["me/a", "me/b", "you/a"]
    for pattern, names in (("rec/*/a.wav", both), ("rec/**/a.*", both), ("rec/*", every), ("[old] rec/*/?.wav", every)):
        assert cli("generate", pattern, "-o", "out/{name}.bvh", "-q", "--parts", "body") == (0, "", "")
        assert files("out") == [f"{name}.bvh" for name in names]
        shutil.rmtree("out")


def test_patterns_take_no_file_twice_and_lead_nowhere_else(cli, place):
    shutil.copy("rec/me/a.wav", "rec/me/a.mp4")  # left out of a folder
    assert cli("generate", "rec/**", "-o", "out/{name}.npz", "-q")[0] == 0
    assert sorted(path.relative_to("out").as_posix() for path in Path("out").rglob("*.npz")) == [
        "me/a.npz", "me/b.npz", "you/a.npz",
    ]  # fmt: skip
    code, _, err = cli("generate", "rec/*/../../t*.wav", "-o", "out/{name}.npz")
    assert (code, "'..' behind a sign of the pattern" in err) == (2, True)
    Path("empty/one").mkdir(parents=True)
    assert "hold no such file" in cli("generate", "empty/*", "-o", "out/{name}.npz")[2]


def test_a_speech_that_is_given_twice_is_made_once(cli, place):
    given = ["talk.wav", "./talk.wav", "rec", "rec/me/a.wav", Path("talk.wav").absolute()]
    code, out, err = cli("generate", *given, "-o", "out/{name}.bvh")
    assert (code, err, out.startswith("4 speeches: ")) == (0, "", True)
    assert files("out") == ["me/a.bvh", "me/b.bvh", "talk.bvh", "you/a.bvh"]


def test_all_clashes_of_names_are_told(cli, place):
    for k in range(5):
        for name in ("x", "y"):
            Path(name).mkdir(exist_ok=True)
            Path(f"{name}/{k}.wav").write_bytes(b"RIFF")  # never opened
    code, _, err = cli("generate", "x", "y", "-o", "out/")
    clashes = [f"'x/{k}.wav' and 'y/{k}.wav' are both called '{k}'" for k in range(3)]
    assert (code, err.partition(" (")[0]) == (2, f"error: {'; '.join(clashes)}; and 2 more")
    assert "name the folder above them, '.'" in err


def test_two_sounds_of_one_name_in_a_folder_are_refused(cli, place):
    soundfile.write("rec/me/a.flac", *soundfile.read("rec/me/a.wav"))
    for given in ("rec/me", "rec/me/*"):
        code, _, err = cli("generate", given, "-o", "out/")
        assert code == 2
        assert "'rec/me/a.wav'" in err
        assert "'rec/me/a.flac'" in err
        assert "are both called 'a'" in err
    assert not Path("out").exists()


def test_plans_of_several_speeches(cli, place):
    assert cli("generate", "rec/me", "-o", "{name}.bvh", "--plan-out", "{name}.json", "-q") == (0, "", "")
    assert {path.name for path in place.glob("*.json")} == {"a.json", "b.json"}
    assert cli("generate", "rec/me", "-o", "again-{name}.bvh", "--plan", "{name}.json", "-q") == (0, "", "")
    assert Path("a.bvh").read_bytes() == Path("again-a.bvh").read_bytes()
    code, _, err = cli("generate", "rec/me", "-o", "out/", "--plan", "a.json")
    assert code == 2
    assert "one plan 'a.json' for several speeches" in err


def test_folders_of_plans_are_made(cli, place):
    assert cli("generate", "rec/me", "-o", "out/", "--plan-out", "plans/new/{name}.json", "-q") == (0, "", "")
    assert files("plans") == ["new/a.json", "new/b.json"]


def test_edits_of_the_command_line(cli, place):
    assert cli("generate", "talk.wav", "-o", "a.bvh", "--gesture", "huge@0.4", "--plan-out", "plan.json", "-q") == (0, "", "")
    forms = [row["form"] for row in json.loads(Path("plan.json").read_text(encoding="utf-8"))["gestures"]]
    assert "big" in forms
    assert cli("generate", "talk.wav", "-o", "b.bvh", "--plan", "plan.json", "-q") == (0, "", "")
    assert Path("a.bvh").read_bytes() == Path("b.bvh").read_bytes()
    assert cli("generate", "talk.wav", "-o", "c.bvh", "--keep", "0:0.5", "a.bvh", "--seed", "3", "-q") == (0, "", "")
    assert cli("generate", "talk.wav", "-o", "d.bvh", "--stretch", "0.2:0.6:style=lively", "--reseed", "0.7:0.9", "-q")[0] == 0
    code, _, err = cli("generate", "talk.wav", "-o", "x.bvh", "--gesture", "huge@9", "--plan-out", "x.json")
    assert code == 2
    assert "--gesture huge@9: 9 is after the end of the speech (1 s)" in err
    for wrong in (["--remove", "g9"], ["--gesture", "qqq@1"], ["--keep", "0:9", "a.bvh"], ["--plan", "a.bvh"], ["--lock", "x"]):
        code, _, err = cli("generate", "talk.wav", "-o", "x.bvh", *wrong)
        assert code == 2
        assert err.startswith("error: ")
        assert not Path("x.bvh").exists()


def test_gestures_of_the_plan_that_a_command_makes_can_be_named(cli, place):
    from cospeech.cli.demo import EXAMPLE

    words = EXAMPLE.with_suffix(".TextGrid")
    options = [EXAMPLE, "--transcript", words, "--seed", "3", "--style", "lively", "--tail", "1", "--fps", "10", "-q"]
    assert cli("generate", *options, "-o", "a.bvh", "--plan-out", "plan.json") == (0, "", "")
    ids = [row["id"] for row in json.loads(Path("plan.json").read_text(encoding="utf-8"))["gestures"]]
    edits = ["--remove", "@2.4", "--remove", ids[-1], "--move", f"{ids[3]}@6"]
    assert cli("generate", *options, "-o", "b.bvh", *edits) == (0, "", "")
    own = [EXAMPLE, "--tail", "1", "--fps", "10", "-q"]
    assert cli("generate", *own, "-o", "c.bvh", "--plan", "plan.json", *edits) == (0, "", "")
    assert Path("b.bvh").read_bytes() == Path("c.bvh").read_bytes() != Path("a.bvh").read_bytes()
    for more, message in (
        (["--remove", "g999"], "--remove g999: no gesture of the plan is called 'g999' (did you mean"),
        (["--remove", "g3", "--transcribe"], "(pass --plan plan.json, which --plan-out plan.json writes)"),
        (["--remove", "g3", "--model", "chain-of-generation"], "chain-of-generation lists no gestures to remove or to move"),
    ):
        code, _, err = cli("generate", *own, "-o", "x.bvh", *more)
        assert code == 2
        assert message in err


def test_a_video_beside_a_sound_of_its_name_is_no_second_speech(cli, place):
    for name in ("rec/me/a.mp4", "rec/me/b.webm"):  # never opened
        Path(name).write_bytes(b"\0\0\0\x20ftypisom")
    code, _, err = cli("generate", "rec/me", "-o", "out/{name}.bvh", "-q")
    assert (code, err) == (0, "note: left out: rec/me/a.mp4, rec/me/b.webm (a sound of the same name is beside it)\n")
    assert files("out") == ["a.bvh", "b.bvh"]
    Path("rec/me/a.flac").write_bytes(b"fLaC")
    code, _, err = cli("generate", "rec/me", "-o", "two/", "-q")
    assert code == 2
    assert "'rec/me/a.wav' and 'rec/me/a.flac' are both called 'a'" in err


@pytest.mark.parametrize(
    "line", ["rec/you -o rec/you/{name}.mp4", "rec -o rec/{name}.mp4", "rec/you -o out/ --plan-out rec/you/a.mp4"]
)
def test_a_video_that_is_left_out_is_not_written_over(cli, place, line):
    Path("rec/you/a.mp4").write_bytes(b"my take")
    code, out, err = cli("generate", *line.split())
    assert (code, out) == (2, "")
    assert "error: 'rec/you/a.mp4' would overwrite what is read" in err
    assert Path("rec/you/a.mp4").read_bytes() == b"my take"


@pytest.mark.slow
def test_a_film_of_ours_beside_its_sound_is_made_anew(cli, place):
    pytest.importorskip("av", reason="films need PyAV")
    for _ in range(2):
        code, _, err = cli("generate", "rec/you", "-o", "rec/you/{name}.mp4", "-q")
        assert (code, err) == (0, "")
    assert files("rec/you") == ["a.mp4", "a.wav", "notes.txt"]


def test_what_is_hidden_is_no_speech_and_what_is_left_out_is_told(cli, place):
    for name in (".cospeech-0f/0.wav", ".git/b.wav", "c.mts", "d.MOV", "e.aac", "f.caf"):
        Path("rec/you", name).parent.mkdir(exist_ok=True)
        Path("rec/you", name).write_bytes(b"no sound")
    Path("rec/you/link").symlink_to(place / "rec" / "me")
    code, _, err = cli("generate", "rec/you", "-o", "out/{name}.bvh", "-q")
    notes = sorted(line for line in err.splitlines() if line.startswith("note: "))
    assert notes == [
        "note: left out: rec/you/c.mts (media of this kind cannot be read; save it as WAV)",
        "note: left out: rec/you/link (a link to a folder; links are not followed)",
    ]
    assert code == 2
    assert [name in err for name in ("rec/you/d.MOV", "rec/you/e.aac", "rec/you/f.caf", "3 of 4 speeches")] == [True] * 4
    assert files("out") == ["a.bvh"]


def test_a_note_of_a_file_that_is_read_twice_comes_once(cli, place):
    whole = Path("talk.wav").read_bytes()
    Path("cut.wav").write_bytes(whole[: len(whole) // 2])
    code, _, err = cli("generate", "cut.wav", "-o", "a.bvh", "-o", "a.gif", "--gesture", "huge@0.3", "-q")
    assert code == 0
    assert err.count("note: 'cut.wav' is cut short: its header says 1 s, and 0.49") == 1


@pytest.mark.parametrize("jobs", [(), ("--jobs", "2")])
def test_notes_and_the_report_tell_which_speech_they_mean(place, cli, tmp_path, jobs):
    shutil.rmtree("rec")
    for folder in ("a", "b"):
        (tmp_path / "rec" / folder).mkdir(parents=True)
        soundfile.write(tmp_path / "rec" / folder / "line1.wav", np.zeros(8000), 16_000)
    code, _, err = cli("generate", "rec", "-o", "out/{name}.npz", "--report", "report.json", "-q", *jobs)
    assert code == 0
    assert [line for line in err.splitlines() if "silent" in line] == [
        f"note: rec/{folder}/line1.wav is silent; mouth and hands rest throughout" for folder in ("a", "b")
    ]
    report = json.loads((tmp_path / "report.json").read_text())
    assert [each["speech"] for each in report["speeches"]] == ["rec/a/line1.wav", "rec/b/line1.wav"]


def test_resume_without_an_output_makes_what_is_missing(cli, place):
    assert cli("generate", "rec/me", "-q") == (0, "", "")
    content = Path("b.bvh").read_bytes()
    for name in ("b.bvh", "b.glb"):
        Path(name).unlink()
    line = ["generate", "rec/me", "--resume", "-q"]
    assert cli(*line) == (0, "", "note: 1 of 2 speeches left out: their files are there (--resume)\n")
    assert Path("b.bvh").read_bytes() == content


@pytest.mark.parametrize("time", [1e9, 4e9])  # long before the speech, and after it
def test_resume_without_an_output_replaces_nothing(cli, place, time):
    Path("a.bvh").write_bytes(b"my recording")
    os.utime("a.bvh", (time, time))
    code, out, err = cli("generate", "rec/me", "--resume")
    assert (code, out) == (2, "")
    assert "error: 'a.bvh' is there already (-o a.bvh writes over it; -o out/ writes" in err
    assert Path("a.bvh").read_bytes() == b"my recording"
    assert not Path("b.bvh").exists()


def spoil(monkeypatch, name: str, error: BaseException) -> None:
    """Let the work on the speech of this name raise an error."""

    def generate_files(audio, *arguments, **options):
        if audio.name == name:
            raise error
        return generate.generate_files(audio, *arguments, **options)

    monkeypatch.setattr("cospeech.cli.batch.generate_files", generate_files)


@pytest.mark.parametrize(
    ("error", "message"),
    [
        (OSError(errno.EIO, "Input/output error", "x.bvh"), "'x.bvh': Input/output error (is there room on the disk"),
        (ZeroDivisionError("division by zero"), "ZeroDivisionError: division by zero ("),
    ],
)
def test_an_error_of_any_kind_does_not_keep_back_the_others(cli, place, monkeypatch, error, message):
    spoil(monkeypatch, "b.wav", error)
    code, _, err = cli("generate", "rec", "-o", "out/{name}.bvh", "--report", "r.json")
    assert code in (1, 2)
    assert "error: 1 of 3 speeches failed: rec/me/b.wav: " in err
    assert message in err
    assert files("out") == ["me/a.bvh", "you/a.bvh"]
    report = json.loads(Path("r.json").read_text(encoding="utf-8"))
    assert [row["speech"] for row in report["speeches"]] == ["rec/me/a.wav", "rec/you/a.wav"]
    assert [row["speech"] for row in report["failed"]] == ["rec/me/b.wav"]


def interrupt_in_a_library() -> ImportError:
    """The error of a library whose import Ctrl-C has interrupted."""
    error = ImportError("half")
    error.__context__ = KeyboardInterrupt()
    return error


@pytest.mark.parametrize("error", [OSError(errno.ENOSPC, "No space left on device"), interrupt_in_a_library()])
def test_what_ends_the_work_leaves_the_report_of_what_is_done(cli, place, monkeypatch, error):
    spoil(monkeypatch, "b.wav", error)
    with pytest.raises(type(error)):
        generate_speeches(["rec"], ["out/{name}.bvh"], report="r.json")
    assert files("out") == ["me/a.bvh"]
    report = json.loads(Path("r.json").read_text(encoding="utf-8"))
    assert [[row["speech"] for row in report[key]] for key in ("speeches", "failed")] == [["rec/me/a.wav"], ["rec/me/b.wav"]]


def generate_or_die(job, options, model):
    """In place of `_generate_alone`: the process ends at the speech b."""
    if job.name == "me/b":
        os.kill(os.getpid(), signal.SIGKILL)
    return Report(**{**REPORT, "speech": str(job.speech)}), []


REPORT = {
    "model": "rules", "speech_seconds": 1.0, "frames": 30, "fps": 30.0, "seed": 0, "takes": 1, "realtime_factor": 0.1,
    "emotion": {}, "played": {}, "style": "calm", "outputs": [], "version": "0",
}  # fmt: skip


def test_a_process_that_dies_leaves_the_report_of_what_is_done(cli, place, monkeypatch):
    monkeypatch.setattr("cospeech.cli.batch._generate_alone", generate_or_die)
    monkeypatch.setattr("cospeech.cli.batch.min", lambda *_: 1, raising=False)  # one process, so that a comes before b
    code, _, err = cli("generate", "rec", "-o", "out/{name}.bvh", "--report", "r.json", "--jobs", "2", "-q")
    assert code == 1
    assert "error: 2 of 3 speeches failed: rec/me/b.wav: a process that generates has ended" in err
    report = json.loads(Path("r.json").read_text(encoding="utf-8"))
    assert [[row["speech"] for row in report[key]] for key in ("speeches", "failed")] == [
        ["rec/me/a.wav"], ["rec/me/b.wav", "rec/you/a.wav"]
    ]  # fmt: skip


def test_a_file_called_stdin_is_a_speech_as_any_other(cli, place):
    shutil.copy("rec/me/a.wav", "stdin.wav")
    assert cli("generate", "stdin.wav", "-q") == (0, "", "")
    assert Path("stdin.bvh").exists()
