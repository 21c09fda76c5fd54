"""The command line as its users meet it: what it writes, what it says, and how it ends."""

from __future__ import annotations

import json
import math
import re
from fractions import Fraction
from pathlib import Path
from unittest import mock

import numpy as np
import pytest
import soundfile

import cospeech
from cospeech.cli.catalogue import CATALOGUES
from cospeech.cli.demo import EXAMPLE
from cospeech.cli.unexpected import explain
from cospeech.errors import say_count
from cospeech.export import FORMATS
from cospeech.models import MODELS
from cospeech.rules import STYLES, RuleBasedModel
from cospeech.runtime.bundles.bundle import write_bundle
from cospeech.training.recipe import list_recipes

SECONDS, RATE = 1.51, 16_000


@pytest.fixture
def place(tmp_path, monkeypatch):
    """An empty working folder with a short speech in it."""
    monkeypatch.chdir(tmp_path)
    speech, rate = soundfile.read(EXAMPLE, frames=int(SECONDS * 48_000), dtype="float32")
    speech = speech[: int(SECONDS * rate)]
    soundfile.write("talk.wav", speech, rate)
    return tmp_path


def frames_of(path: Path) -> int:
    return len(cospeech.Motion.load(path))


def test_without_arguments_it_helps(cli):
    code, out, err = cli()
    assert (code, err) == (0, "")
    assert "Usage: cospeech" in out
    assert all(command in out for command in ("generate", "convert", "render", "list", "demo", "bench"))


def test_version(cli):
    assert cli("--version") == (0, f"cospeech {cospeech.__version__}\n", "")


def test_every_format_says_where_it_goes():
    assert all(entry.opens for entry in FORMATS.values())


def test_generate_writes_what_is_asked_for(cli, place):
    code, out, err = cli("generate", "talk.wav", "-o", "a.bvh", "-o", "b.npz", "--report", "r.json", "--style", "lively")
    assert (code, err) == (0, "")
    assert sorted(p.name for p in place.iterdir()) == ["a.bvh", "b.npz", "r.json", "talk.wav"]
    assert frames_of(Path("a.bvh")) == frames_of(Path("b.npz")) == math.ceil(SECONDS * 30)
    assert FORMATS[".bvh"].opens in out
    report = json.loads(Path("r.json").read_text(encoding="utf-8"))
    assert report["frames"] == math.ceil(SECONDS * 30)
    assert report["outputs"] == ["a.bvh", "b.npz"]
    assert (report["model"], report["style"], report["seed"], report["takes"]) == ("rules", "lively", 0, 1)
    assert report["speech_seconds"] == pytest.approx(SECONDS, abs=1e-9)
    assert math.isclose(sum(report["emotion"].values()), 1, abs_tol=1e-6)
    assert report["style_mixture"] is None
    assert set(report) == {
        "model", "speech", "speech_seconds", "frames", "fps", "seed", "takes", "realtime_factor", "emotion", "style", "outputs",
        "style_mixture", "speaker", "version", "played", "arousal", "language", "language_source",
    }  # fmt: skip
    assert (report["language"], report["language_source"]) == (None, None)


@pytest.mark.slow
def test_without_output_it_writes_bvh_and_glb_here(cli, place):
    (place / "voices").mkdir()
    Path("talk.wav").rename("voices/talk.wav")
    assert cli("generate", "voices/talk.wav", "--quiet") == (0, "", "")
    assert sorted(p.name for p in place.iterdir()) == ["talk.bvh", "talk.glb", "voices"]


@pytest.mark.slow
@pytest.mark.parametrize("fps", [12.5, 24, 29.97, 60, "30000/1001"])
def test_length_is_exact_at_any_rate(cli, place, fps):
    assert cli("generate", "talk.wav", "-o", "a.bvh", "--fps", fps, "-q")[0] == 0
    assert frames_of(Path("a.bvh")) == math.ceil(SECONDS * Fraction(fps))


@pytest.mark.slow
def test_a_tail_lets_the_hands_come_down(cli, place):
    """The motion of the speech is the same with a tail; behind it, hands that were raised sink below the hips."""
    assert cli("generate", "talk.wav", "-o", "a.npz", "--seed", "2", "-q") == (0, "", "")
    assert cli("generate", "talk.wav", "-o", "b.npz", "--seed", "2", "-q", "--tail", "3", "--report", "r.json") == (0, "", "")
    bare, with_tail = (cospeech.Motion.load(name) for name in ("a.npz", "b.npz"))
    assert len(with_tail) == json.loads(Path("r.json").read_text(encoding="utf-8"))["frames"] == math.ceil((SECONDS + 3) * 30)
    np.testing.assert_array_equal(with_tail.rotations[: len(bare) - 30], bare.rotations[:-30])
    index = with_tail.skeleton.index
    positions, _ = with_tail.skeleton.forward(with_tail.rotations, with_tail.root)
    heights = positions[:, [index["left_wrist"], index["right_wrist"]], 1].max(1) - positions[:, index["pelvis"], 1]
    assert heights[len(bare) - 1] > 0.05
    assert heights[-1] < 0


def test_same_seed_same_bytes_and_takes_differ(cli, place):
    assert cli("generate", "talk.wav", "-o", "a.bvh", "--takes", 3, "--seed", 5, "-q")[0] == 0
    assert cli("generate", "talk.wav", "-o", "b.bvh", "--seed", 6, "-q")[0] == 0
    takes = [Path(f"a.{k}.bvh").read_bytes() for k in (1, 2, 3)]
    assert len(set(takes)) == 3
    assert takes[1] == Path("b.bvh").read_bytes()
    assert not Path("a.bvh").exists()


@pytest.mark.slow
def test_convert_and_render(cli, place):
    assert cli("generate", "talk.wav", "-o", "a.bvh", "-q")[0] == 0
    code, out, err = cli("convert", "a.bvh", "b.vrma", "--fps", 60)
    assert (code, err) == (0, "")
    assert "b.vrma" in out
    assert frames_of(Path("b.vrma")) == pytest.approx(2 * frames_of(Path("a.bvh")), abs=1)
    assert cli("convert", "a.bvh", "c.bvh", "--skeleton", "mixamo", "-q") == (0, "", "")
    assert "mixamorig" in Path("c.bvh").read_text(encoding="utf-8")
    assert cli("render", "a.bvh", "d.png", "--audio", "talk.wav")[0] == 0
    assert Path("d.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.slow
def test_demo_has_everything(cli, place, monkeypatch):
    monkeypatch.setattr("cospeech.cli.demo.EXAMPLE", place / "talk.wav")  # short, with words of its own
    (place / "talk.tsv").write_text("0.1\t0.4\tso\n")
    monkeypatch.setattr("cospeech.cli.demo.EXAMPLE_WORDS", place / "talk.tsv")
    code, out, err = cli("demo", "--to", "show/me")
    assert (code, err) == (0, "")
    suffixes = {".bvh", ".glb", ".fbx", ".vrma", ".csv", ".json", ".npz", ".mp4", ".png"}
    assert {p.name for p in (place / "show/me").iterdir()} == {f"talk{suffix}" for suffix in suffixes} | {"report.json"}
    assert all(FORMATS[suffix].opens in out for suffix in suffixes)
    assert cli("demo", "--to", "show/me", "-q")[0] == 0, "again, over what is there"


@pytest.mark.parametrize("what", sorted(CATALOGUES))
def test_list(cli, what):
    code, out, err = cli("list", what, "--json")
    assert (code, err) == (0, "")
    rows = json.loads(out)
    assert all(row["name"] and row["what"] for row in rows)
    code, out, err = cli("list", what)
    assert (code, err) == (0, "")
    assert all(row["name"] in out for row in rows)


def test_list_has_every_model_and_format(cli):
    assert [row["name"] for row in json.loads(cli("list", "models", "--json")[1])] == list(MODELS)
    assert [row["name"] for row in json.loads(cli("list", "formats", "--json")[1])] == list(FORMATS)


@pytest.mark.parametrize(("number", "text"), [(0, "0 speeches"), (1, "1 speech"), (2, "2 speeches")])
def test_one_thing_is_no_several(number, text):
    assert say_count(number, "speech", "speeches") == text
    assert say_count(number, "frame") == text.replace("speeches", "frames").replace("speech", "frame")


@pytest.mark.slow
def test_a_clip_of_one_frame_is_told_as_one(cli, place):
    cospeech.load("rules").generate(cospeech.Speech.load("talk.wav").window(0, 0.03)).save("one.bvh")
    assert "  1 frame at 30 fps" in cli("convert", "one.bvh", "one.npz")[1]


def test_list_says_in_a_sentence_what_a_recipe_trains(cli):
    rows = {row["name"]: row["what"] for row in json.loads(cli("list", "recipes", "--json")[1])}
    assert rows.keys() == {*list_recipes()}
    assert rows["flow_ted"] == "Ye et al. 2022, stylised flow, TED: the paper's values (table 1; first row of table 2)"
    assert rows["cmix_gan_pats"].endswith("for one speaker of a store of PATS")
    assert rows["speech_classifier"].startswith("Xu et al. 2024, appendix A.4: speaker and emotion from speech")
    assert max(map(len, rows.values())) < 160


def test_list_tells_what_ships_and_whose_styles(cli, tmp_path, monkeypatch):
    monkeypatch.setattr("cospeech.models.SHIPPED", tmp_path)
    assert "no weights ship" in cli("list", "models")[1]
    write_bundle(tmp_path / "stylised-flow.cospeech", {"styles": ["ada", "ben"]}, {})
    rows = json.loads(cli("list", "models", "--json")[1])
    assert [row["name"] for row in rows if "no weights ship" in row["what"]] == [
        name for name in MODELS if name not in ("rules", "stylised-flow")
    ]
    rows = json.loads(cli("list", "styles", "--json")[1])
    assert [row["name"] for row in rows if row["model"] == "stylised-flow"] == ["ada", "ben"]
    assert [row["name"] for row in rows if row["model"] == "rules"] == [*STYLES]


def test_a_model_may_be_named_as_text_or_path():
    assert isinstance(cospeech.load(Path("rules")), RuleBasedModel)
    for name in ("rulse", "a" * 5000, "a\0b"):
        with pytest.raises(cospeech.InputError, match="no model is called"):
            cospeech.load(name)


BAD = [
    ("generate nothing.wav -o a.bvh", "nothing.wav"),
    ("generate . -o a.bvh", "folder"),
    ("generate https://example.com/a.wav -o a.bvh", "cannot read 'https://example.com/a.wav': it is an address (download"),
    ("convert https://example.com/a.bvh a.glb", "it is an address (download the file, and name it)"),
    ("generate empty.wav -o a.bvh", "empty.wav"),
    ("generate text.wav -o a.bvh", "text.wav"),
    ("generate nan.wav -o a.bvh", "nan"),
    ("generate late.wav -o a.bvh -o b.glb -o c.npz -o d.csv", "late.wav"),
    ("generate talk.wav -o a.bvh --tail 61", "0 … 60"),
    ("generate talk.wav -o a.bvh --tail nan", "0 … 60"),
    ("generate talk.wav -o a.xyz", "a.xyz"),
    ("generate talk.wav -o a", "(known suffixes"),
    ("generate talk.wav -o a.obj", "(known suffixes"),
    ("generate talk.wav -o 'a.bvh'", "use double quotes"),
    ("generate talk.wav -o /nowhere/at/all/a.bvh", "folder exist"),
    ("generate talk.wav -o folder.bvh", "folder"),
    ("generate talk.wav -o talk.wav", "talk.wav"),
    ("generate talk.bvh -o talk.bvh", "overwrite"),
    ("generate talk.wav -o a.bvh -o ./a.bvh", "overwrite"),
    ("generate talk.wav -o a.bvh --report a.bvh", "overwrite"),
    ("generate talk.wav -o a.bvh --report talk.wav", "overwrite"),
    ("generate talk.wav -o a.json --transcript a.json", "overwrite"),
    ("generate talk.wav -o a.bvh --model rule", "did you mean 'rules'"),
    ("generate talk.wav -o a.bvh --style calm --style lively", "--style is there 2 times (name it once; it takes one value)"),
    ("convert a.bvh b.glb --fps 30 --fps=60", "--fps is there 2 times"),
    ("study make a b --title A --title B", "--title is there 2 times"),
    ("generate talk.wav -o a.bvh --style livly", "did you mean 'lively'"),
    ("generate talk.wav -o a.bvh --style sadness", "(it is an emotion: --emotion sadness)"),
    ("generate talk.wav -o a.bvh --style lively --speaker calm", "calm"),
    ("generate talk.wav -o a.bvh --style lively:much", "much"),
    ("generate talk.wav -o a.bvh --style lively:0.5,livly:0.5", "did you mean 'lively'"),
    ("generate talk.wav -o a.bvh --style lively:-1", "lively:-1"),
    ("generate talk.wav -o a.bvh --emotion joyful", "known: auto"),
    ("generate talk.wav -o a.bvh --emotion hapiness", "did you mean 'happiness'"),
    ("generate talk.wav -o a.bvh --parts face,feet", "feet"),
    ("generate talk.wav -o a.bvh --language de", "the language 'de' of no words"),
    ("generate talk.wav -o a.bvh --transcript talk.txt --language german", "the code of German is de"),
    ("generate talk.wav -o a.bvh --parts ,", "no part"),
    ("generate talk.wav -o a.bvh --skeleton miximo", "did you mean 'mixamo'"),
    ("generate talk.wav -o a.bvh --fps 0", "fps 0"),
    ("generate talk.wav -o a.bvh --fps -30", "fps -30"),
    ("generate talk.wav -o a.bvh --fps nan", "fps nan"),
    ("generate talk.wav -o a.bvh --fps 30/0", "'30/0' is not a number"),
    ("generate talk.wav -o a.bvh --fps fast", "fast"),
    ("generate talk.wav -o a.bvh --takes 0", "takes 0"),
    ("generate talk.wav -o a.bvh --takes 100000", "takes 1"),
    ("generate talk.wav -o a.bvh --seed 1.5", "1.5"),
    ("generate talk.wav -o a.bvh --seed -1", "seed -1"),
    ("generate talk.wav -o a.bvh --intensity inf", "intensity inf"),
    ("generate talk.wav -o a.bvh --temperature -1", "temperature -1"),
    ("generate talk.wav -o a.bvh --transcript nothing.srt", "nothing.srt"),
    ("generate talk.wav -o a.bvh --transcript bad.TextGrid", "bad.TextGrid"),
    ("generate talk.wav -o a.bvh --transcript .", "folder"),
    ("generate talk.wav -o a.glb --avatar nothing.vrm", "nothing.vrm"),
    ("generate talk.wav -o a.bvh --avatar text.wav", "avatar"),
    ("generate talk.wav -o a.glb --avatar text.wav", "text.wav"),
    ("generate talk.wav -o a.bvh --stlye lively", "--style"),
    ("generate talk.wav -o", "-o"),
    ("generate talk.wav --output", "see `cospeech generate --help`"),
    ("generate talk.wav --keep 0:1", "see `cospeech generate --help`"),
    ("robot talk.bvh --fps", "see `cospeech robot --help`"),
    ("generate", "SPEECH"),
    ("generate talk.wav more.wav -o a.bvh", "several speeches"),
    ("generat talk.wav", "did you mean 'generate'"),
    ("convert nothing.bvh a.glb", "nothing.bvh"),
    ("convert text.wav a.glb", "text.wav"),
    ("convert bad.bvh a.glb", "bad.bvh"),
    ("convert bad.mp4 a.glb", "written but not read"),
    ("convert talk.bvh a.xyz", "a.xyz"),
    ("convert talk.bvh talk.bvh", "overwrite"),
    ("convert talk.bvh a.glb --skeleton nobody", "nobody"),
    ("convert talk.bvh a.glb --fps 0", "fps 0"),
    ("convert talk.bvh a.glb --map nothing.toml", "nothing.toml"),
    ("convert", "MOTION"),
    ("render talk.bvh a.glb", "not a picture"),
    ("render nothing.bvh a.png", "nothing.bvh"),
    ("render talk.bvh a.png --camera feet", "feet"),
    ("render talk.bvh a.png --audio nothing.wav", "nothing.wav"),
    ("list", "WHAT"),
    ("list modles", "did you mean 'models'"),
    ("demo --to text.wav", "text.wav"),
    ("bench --seconds 0", "0 seconds"),
    ("bench --seconds nan", "nan seconds"),
]


@pytest.mark.slow
@pytest.mark.parametrize(("line", "message"), BAD, ids=[line for line, _ in BAD])
def test_bad_input_is_one_line_and_leaves_nothing(cli, place, line, message):
    (place / "empty.wav").touch()
    (place / "text.wav").write_text("this is not sound\n" * 100)
    (place / "text.xyz").write_text("hello")
    (place / "bad.TextGrid").write_text('File type = "ooTextFile"\nObject class = "TextGrid"\nxmin = zero\n')
    (place / "bad.mp4").write_bytes(b"\x00" * 100)
    (place / "bad.bvh").write_text("HIERARCHY\nROOT Hips\n{\n")
    (place / "folder.bvh").mkdir()
    (place / "a.json").write_text("[]")
    soundfile.write(place / "nan.wav", np.full(RATE, np.nan, np.float32), RATE, subtype="FLOAT")
    late = np.random.default_rng(0).normal(0, 0.1, 60 * RATE).astype(np.float32)
    late[-100] = np.nan
    soundfile.write(place / "late.wav", late, RATE, subtype="FLOAT")
    cospeech.Motion(30.0, np.tile([0.0, 0, 0, 1], (3, 55, 1)), np.tile([0.0, 0.955, 0], (3, 1))).save("talk.bvh")
    before = {p.name: p.read_bytes() if p.is_file() else None for p in place.rglob("*")}
    code, out, err = cli(*line.split())
    assert (code, out) == (2, "")
    assert re.fullmatch(r"error: [^\n]+ \([^\n]+\)\n", err), err
    assert message in err
    assert {p.name: p.read_bytes() if p.is_file() else None for p in place.rglob("*")} == before


def test_debug_shows_the_traceback(cli, place):
    code, out, err = cli("generate", "nothing.wav", "-o", "a.bvh", "--debug")
    assert (code, out) == (2, "")
    assert "Traceback (most recent call last)" in err
    assert "speech.py" in err
    assert err.splitlines()[-1].startswith("error: ")


@pytest.mark.slow
def test_failure_of_ours_is_exit_1_and_leaves_nothing(cli, place, monkeypatch):
    fail = mock.Mock(side_effect=ZeroDivisionError("division by zero\nin the middle"))  # of a library: called by our code
    monkeypatch.setattr("cospeech.export.npz.Writer._finish", fail)
    code, out, err = cli("generate", "talk.wav", "-o", "a.bvh", "-o", "b.npz", "-o", "c.csv", "--report", "r.json")
    assert (code, out) == (1, "")
    assert err == "error: ZeroDivisionError: division by zero in the middle (this is a bug of ours; --debug shows where)\n"
    assert [p.name for p in place.iterdir()] == ["talk.wav"]


@pytest.mark.slow
def test_failure_of_code_of_the_users_names_the_file(cli, place, monkeypatch):
    def fail(*arguments, **options):
        raise ZeroDivisionError("in a model of one's own")

    monkeypatch.setattr("cospeech.export.npz.Writer._finish", fail)
    code, out, err = cli("generate", "talk.wav", "-o", "b.npz")
    assert (code, out) == (2, "")
    line = fail.__code__.co_firstlineno + 1
    assert err.startswith(f"error: {__file__!r}, line {line}: ZeroDivisionError: in a model of one's own (the error comes from")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("text", "says"), [("", "too little memory: MemoryError (close"), ("9 GB", "MemoryError: 9 GB (close other")]
)
def test_too_little_memory_is_told(cli, place, monkeypatch, text, says):
    monkeypatch.setattr("cospeech.export.npz.Writer._finish", mock.Mock(side_effect=MemoryError(*filter(None, [text]))))
    code, _, err = cli("generate", "talk.wav", "-o", "b.npz")
    assert code == 1
    assert says in err


def test_memory_of_a_training_names_the_batch():
    for error in (MemoryError(), RuntimeError("DefaultCPUAllocator: can't allocate memory: you tried to allocate 9 bytes")):
        assert "train.batch" in explain(error, "train").hint
    assert "bug of ours" in explain(RuntimeError("size mismatch"), "train").hint


@pytest.mark.slow
def test_interrupted_is_130_and_leaves_nothing(cli, place, monkeypatch):
    def interrupt(*arguments, **options):
        raise KeyboardInterrupt

    monkeypatch.setattr("cospeech.export.bvh.Writer._write", interrupt)
    code, out, err = cli("generate", "talk.wav", "-o", "a.bvh", "-o", "b.npz")
    assert (code, out, err) == (130, "", "interrupted\n")
    assert [p.name for p in place.iterdir()] == ["talk.wav"]


def test_interrupted_before_the_command_begins(cli, monkeypatch):
    def interrupt(*arguments, **options):
        raise KeyboardInterrupt

    monkeypatch.setattr("typer.main.get_command", interrupt)  # it makes the commands, and takes a while
    assert cli("list", "formats") == (130, "", "interrupted\n")


@pytest.mark.slow
def test_what_was_there_stays_when_it_fails(cli, place, monkeypatch):
    Path("a.bvh").write_text("mine", encoding="utf-8")
    assert cli("generate", "talk.wav", "-o", "a.bvh", "--style", "nobody")[0] == 2
    assert Path("a.bvh").read_text(encoding="utf-8") == "mine"
    assert cli("generate", "talk.wav", "-o", "a.bvh", "-q")[0] == 0
    assert Path("a.bvh").read_text(encoding="utf-8") != "mine"
