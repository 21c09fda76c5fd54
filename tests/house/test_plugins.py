"""Formats and models of other packages: the ones in examples/plugins are found, listed and used; broken ones are told of."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest

import cospeech
from cospeech.cli.demo import EXAMPLE
from cospeech.errors import CospeechWarning, InputError
from cospeech.export import FORMATS, Format
from cospeech.export.plugins import Registry
from cospeech.models import ENTRIES
from cospeech.runtime.bundles.bundle import read_bundle
from cospeech.studio._jobs import Jobs

pytestmark = pytest.mark.slow

ROOT = Path(__file__).resolve().parents[2]
TOYS = ROOT / "examples" / "plugins"


def install(folder: Path, name: str, groups: dict[str, dict[str, str]]) -> None:
    """What an installer writes of a package: its metadata, entry points among it."""
    info = folder / f"{name}-1.0.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
    lines = [f"[{group}]\n" + "".join(f"{key} = {value}\n" for key, value in rows.items()) for group, rows in groups.items()]
    (info / "entry_points.txt").write_text("\n".join(lines))


@pytest.fixture(scope="module")
def toys(tmp_path_factory):
    """A folder that has the package of examples/plugins, as if it were installed there."""
    place = tmp_path_factory.mktemp("toys")
    for path in TOYS.glob("*.py"):
        shutil.copy(path, place)
    project = tomllib.loads((TOYS / "pyproject.toml").read_text("utf-8"))["project"]
    install(place, project["name"].replace("-", "_"), project["entry-points"])
    return place


def run(place: Path, *arguments: str, cwd: Path, code: int = 0) -> subprocess.CompletedProcess[str]:
    """``cospeech`` where ``place`` is on the path."""
    path = os.pathsep.join([str(place), *filter(None, [os.environ.get("PYTHONPATH")])])
    process = subprocess.run(
        [sys.executable, "-m", "cospeech", *arguments], cwd=cwd, capture_output=True, text=True,
        env=os.environ | {"PYTHONPATH": path, "PYTHONIOENCODING": "utf-8"},
    )  # fmt: skip
    assert process.returncode == code, process.stderr
    return process


COMMANDS = """
import contextlib, io, json, sys
from cospeech.cli.main import main
ended = []
for arguments in json.loads(sys.argv[1]):
    sys.argv = ["cospeech", *arguments]
    with contextlib.redirect_stdout(io.StringIO()) as said, contextlib.redirect_stderr(io.StringIO()) as told:
        try:
            main()
        except SystemExit as end:
            ended.append([end.code or 0, said.getvalue(), told.getvalue()])
print(json.dumps(ended))
"""


def run_all(place: Path, *commands: list[str], cwd: Path) -> list[tuple[int, str, str]]:
    """Exit codes, outputs and errors of commands in one process: PyTorch takes seconds to begin."""
    path = os.pathsep.join([str(place), *filter(None, [os.environ.get("PYTHONPATH")])])
    process = subprocess.run(
        [sys.executable, "-c", COMMANDS, json.dumps(commands)], cwd=cwd, capture_output=True, text=True,
        env=os.environ | {"PYTHONPATH": path, "PYTHONIOENCODING": "utf-8"},
    )  # fmt: skip
    assert process.returncode == 0, process.stderr
    return [(code, out, err) for code, out, err in json.loads(process.stdout)]


def test_a_format_of_another_package_is_listed_and_written(toys, tmp_path):
    rows = json.loads(run(toys, "list", "formats", "--json", cwd=tmp_path).stdout)
    assert [row["name"] for row in rows] == [*FORMATS.ours, ".hands"]
    assert (rows[-1]["holds"], rows[-1]["access"]) == ("body", "write")
    process = run(toys, "generate", str(EXAMPLE), "-o", "talk.hands", "-o", "talk.bvh", cwd=tmp_path)
    assert "numpy.loadtxt" in process.stdout
    motion = cospeech.Motion.load(tmp_path / "talk.bvh")
    hands = motion.positions()[:, [motion.skeleton.index[name] for name in ("leftHand", "rightHand")]]
    np.testing.assert_allclose(np.loadtxt(tmp_path / "talk.hands").reshape(-1, 2, 3), hands, atol=2e-3)
    run(toys, "convert", "talk.bvh", "again.hands", cwd=tmp_path)
    assert (tmp_path / "again.hands").stat().st_size


def test_traits_of_another_package_count(toys, tmp_path):
    err = run(toys, "generate", str(EXAMPLE), "-o", "talk.hands", "--parts", "face", cwd=tmp_path, code=2).stderr
    assert "'talk.hands' would not move" in err
    assert list(tmp_path.iterdir()) == []
    err = run(toys, "render", "talk.bvh", "talk.hands", cwd=tmp_path, code=2).stderr
    assert "is not a picture" in err
    err = run(toys, "convert", "talk.hands", "talk.bvh", cwd=tmp_path, code=2).stderr
    assert "can be written but not read" in err


def test_without_the_package_there_is_no_such_format(tmp_path):
    assert "known suffixes: .bvh" in run(tmp_path, "convert", "a.bvh", "a.hands", cwd=tmp_path, code=2).stderr


# the registry ---------------------------------------------------------------------------------------------------------

ROW = Format("some.module", "a row", "nothing opens it")


def registry(group: str) -> Registry[Format]:
    return Registry({".ours": ROW}, group=group, kind=Format, prefix=".")


@pytest.fixture
def package(tmp_path, monkeypatch):
    """Install a package of one module in a group of its own; gives the name of the group."""

    def make(entries: dict[str, str], source: str) -> str:
        group = f"cospeech.test{len(sys.path)}"
        (tmp_path / "strange_rows.py").write_text("from cospeech.export import Format\n" + source)
        install(tmp_path, "strange", {group: entries})
        monkeypatch.syspath_prepend(tmp_path)
        monkeypatch.delitem(sys.modules, "strange_rows", raising=False)
        return group

    return make


def test_a_broken_plug_in_is_one_line_and_harms_no_other(package):
    rows = {
        "bad": "strange_rows:NOTHING",
        "worse": "no_such_module:ROW",
        "odd": "strange_rows:text",
        "good": "strange_rows:ROW",
    }
    formats = registry(package(rows, "text = 'no row'\nROW = Format(__name__, 'theirs', 'nothing')\n"))
    with pytest.warns(CospeechWarning) as notes:
        assert list(formats) == [".ours", ".good"]
    texts = [str(warning.message) for warning in notes]
    assert len(texts) == 3
    assert all("of strange (cospeech.test" in text and "cannot be used: " in text and "\n" not in text for text in texts)
    assert "no_such_module" in texts[2]
    assert list(formats) == [".ours", ".good"], "and nobody is told twice"
    assert ".bad" not in formats
    assert formats[".good"].what == "theirs"


def test_ours_win_and_so_does_the_first_of_two(package):
    formats = registry(package({"ours": "strange_rows:ROW"}, "ROW = Format(__name__, 'theirs', 'nothing')\n"))
    assert formats[".ours"] is ROW
    with pytest.warns(CospeechWarning, match=r"plug-in 'ours' of strange .* is not used: cospeech has '\.ours' already"):
        assert list(formats) == [".ours"]


def test_nothing_is_imported_for_a_name_of_ours(package):
    formats = registry(package({"good": "strange_rows:ROW", "bad": "strange_rows:ROW"}, "raise SystemError('imported')\n"))
    assert formats[".ours"] is ROW
    assert "strange_rows" not in sys.modules
    assert ".nobody" not in formats
    assert "strange_rows" not in sys.modules
    with pytest.warns(CospeechWarning, match="SystemError: imported"), pytest.raises(KeyError):
        _ = formats[".good"]


def test_a_row_that_leads_nowhere_is_an_error_of_its_package(package):
    formats = registry(
        package({"good": "strange_rows:ROW"}, "ROW = Format(__name__, 'theirs', 'nothing')\ndef load(path): pass\n")
    )
    assert formats.find_code(".good", formats[".good"].module, "load").__module__ == "strange_rows"
    with pytest.raises(InputError, match=r"plug-in 'good' .* cannot be used: AttributeError: .* no attribute 'Writer'"):
        formats.find_code(".good", formats[".good"].module, "Writer")
    with pytest.raises(InputError, match=r"cannot be used: ModuleNotFoundError: No module named 'strange_row'"):
        formats.find_code(".good", "strange_row", "Writer")
    with pytest.raises(ModuleNotFoundError):
        formats.find_code(".ours", ROW.module, "Writer")


# models ---------------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def corpus(tmp_path_factory):
    """A folder with a corpus of two synthetic speakers, `raw`, and its `store`."""
    for name in ("torch", "onnx", "scipy"):
        pytest.importorskip(name, reason="training needs cospeech[train]")
    folder = tmp_path_factory.mktemp("corpus")
    (folder / "voices").mkdir()
    shutil.copy(EXAMPLE, folder / "voices")
    voices = ["--speakers", "2", "--no-act", "--speech", "voices", "-q"]
    run(folder, "synthesise", "raw", "--hours", "0.01", *voices, cwd=folder)
    run(folder, *["prepare", "beat", "raw", "store", "--pose", "expmap-humanoid", "--fps", "15", "-q"], cwd=folder)
    return folder


PLAY = """
import cospeech
model, speech = cospeech.load("{name}"), cospeech.Speech.load({speech!r}).window(0, 3)
whole, other = (model.generate(speech, style=style, parts=("body", "hands")) for style in model.styles)
pieces = cospeech.Motion.concatenate(list(model.stream(speech.chunks(0.37), parts=("body", "hands"))))
assert whole.rotations.tobytes() == pieces.rotations.tobytes()
assert len(whole) == 90 and whole.rotations.std(0).max() > 1e-3
assert abs(whole.rotations - other.rotations).max() > 1e-3
print(model.session(parts=("body",)).look_ahead)
"""


def play(place: Path, name: str, cwd: Path) -> float:
    """Assert that a bundle streams what it generates, and that styles differ; gives how far its body hears ahead, seconds."""
    path = os.pathsep.join([str(place), *filter(None, [os.environ.get("PYTHONPATH")])])
    code = PLAY.format(name=name, speech=str(EXAMPLE))
    process = subprocess.run(
        [sys.executable, "-c", code], cwd=cwd, capture_output=True, text=True, env=os.environ | {"PYTHONPATH": path}
    )
    assert process.returncode == 0, process.stderr
    return float(process.stdout)


def test_a_model_of_another_package_is_listed_without_its_name_meaning_more(toys, tmp_path):
    rows = json.loads(run(toys, "list", "models", "--json", cwd=tmp_path).stdout)
    ours = [name for name, entry in ENTRIES.ours.items() if entry.plays]
    assert [row["name"] for row in rows] == [*ours, "toy-net"]
    assert rows[-1]["what"].startswith("A toy: two convolutions")
    assert "no weights ship" in rows[-1]["what"]
    err = run(toys, "generate", str(EXAMPLE), "-o", "a.bvh", "--model", "toy-net", cwd=tmp_path, code=2).stderr
    assert err.startswith("error: no weights of 'toy-net' ship")
    err = run(tmp_path, "generate", str(EXAMPLE), "-o", "a.bvh", "--model", "toy-net", cwd=tmp_path, code=2).stderr
    assert err.startswith("error: no model is called 'toy-net'")


STILL = """
from cospeech.models import ModelEntry

MODEL = ModelEntry(f"{__name__}:Still", "Stands", trains=False)
GONE = ModelEntry(f"{__name__}:Gone", "Is not there", trains=False)
FAILS = ModelEntry(f"{__name__}:Fails", "Cannot be made", trains=False)


class Still:
    styles, default_style, makes, latency = ("upright",), "upright", ("body",), 0.0

    def __init__(self, mouth): ...


class Fails:
    def __init__(self, mouth):
        raise ValueError("no weights")
"""


def test_the_studio_offers_models_of_other_packages_and_leaves_out_broken_ones(tmp_path, monkeypatch):
    (tmp_path / "still_model.py").write_text(STILL)
    rows = {"still": "still_model:MODEL", "gone": "still_model:GONE", "fails": "still_model:FAILS"}
    install(tmp_path, "still", {"cospeech.models": rows})
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(InputError, match=r"plug-in 'gone' .* has no attribute 'Gone'"):
        cospeech.load("gone")
    description = Jobs().describe()
    models = {row["name"]: row for row in description["models"]}
    assert models["rules"]["takes_gestures"]
    assert models["rules"]["seated"] == ["seated"]
    assert models["still"]["styles"] == ["upright"]
    assert not models["still"]["takes_gestures"]
    assert not {"gone", "fails"} & {*models}
    fails, missing = description["left_out"]
    assert fails == "the model 'fails' is left out: ValueError('no weights')"
    assert missing.startswith(
        "the model 'gone' is left out: plug-in 'gone' of still (cospeech.models) cannot be used: AttributeError"
    )


LEAKY = """
from dataclasses import dataclass

import torch
from torch import nn

from cospeech.models import ModelEntry
from cospeech.models.nn.export import ExportGraph
from cospeech.models.nn.objective import Objective
from cospeech.models.nn.trainable import Trainable

MODEL = ModelEntry(f"{__name__}:Leaky", "A leaky memory of the speech, frame by frame")


@dataclass(frozen=True)
class LeakyConfig:
    frames: int = 24


class Leaky(Trainable):
    Config, dimensions = LeakyConfig, ("pose", "audio", "speakers")

    def __init__(self, config, *, pose, audio, speakers):
        super().__init__()
        self.config, self.pose, self.audio, self.styles = config, pose, audio, speakers
        self.heard, self.who = nn.Linear(audio, 8), nn.Linear(speakers, 8)
        self.made = nn.Linear(8, pose)

    def speaker_styles(self, stretches):
        return torch.eye(self.styles)

    def forward(self, rows, style, memory):
        memory = 0.9 * memory + self.heard(rows) + self.who(style)
        return self.made(memory.tanh()), memory

    def objectives(self):
        return {"poses": Objective(self.parameters(), self.loss)}

    def loss(self, batch, step):
        style = torch.eye(self.styles)[batch["speaker"]]
        made, memory = [], torch.zeros(len(batch), 8)
        for rows in batch["audio"].unbind(1):
            pose, memory = self(rows, style, memory)
            made.append(pose)
        return {"pose": (torch.stack(made, 1) - batch["pose"]).abs().mean()}

    def export_module(self):
        inputs = {"rows": (1, self.audio), "style": ("N", self.styles)}
        return {"live": ExportGraph(self, inputs, {"poses": ("N", self.pose)}, {"memory": 8})}
"""
RECIPE = """
[model]
name = "leaky"
[data]
audio = "mel20-prosody"
[train]
steps = 20
batch = 8
lr = 1e-2
validate_every = 20
"""


@pytest.fixture(scope="module")
def bundles(toys, corpus):
    """Runs and bundles of the toy and of the leaky memory: in folders `toy` and `leaky`."""
    place = shutil.copytree(toys, corpus / "packages")
    (place / "leaky_model.py").write_text(LEAKY)
    (place / "leaky.toml").write_text(RECIPE)
    install(place, "leaky", {"cospeech.models": {"leaky": "leaky_model:MODEL"}})
    recipes = {"toy": str(TOYS / "toy_net.toml"), "leaky": str(place / "leaky.toml")}
    wrong = [["train", recipes["toy"], "--store", "store", "--set", "model.reach=-1"]]
    good = []
    for name, recipe in recipes.items():
        good += [["train", recipe, "--store", "store", "--out", name], ["bundle", name, "-o", f"{name}.cospeech"]]
    *results, refusal = run_all(place, *good, *wrong, cwd=corpus)
    for code, _, err in results:
        assert code == 0, err
    assert "20 steps" in results[0][1]
    assert refusal[0] == 2
    assert refusal[2].startswith("error: frames, channels, reach of a ToyNet")
    return corpus


def test_a_model_of_another_package_is_trained_bundled_played_and_evaluated(toys, bundles, tmp_path):
    toy = bundles / "toy.cospeech"
    facts = json.loads((bundles / "toy" / "config.json").read_text())
    assert (facts["model"], facts["config"]["channels"], facts["config"]["reach"]) == ("toy-net", 32, 4)
    assert [json.loads(line) for line in (bundles / "toy" / "log.jsonl").read_text().splitlines()]
    make = read_bundle(toy).manifest["networks"]["make"]
    assert (make["window"], make["reach"]) == (32, 8), "how far it hears is measured"
    run(tmp_path, "generate", str(EXAMPLE), "-o", "talk.bvh", "--model", str(toy), cwd=tmp_path)  # without the package
    assert len(cospeech.Motion.load(tmp_path / "talk.bvh")) == 571
    assert play(toys, str(toy), tmp_path) > 0
    evaluation = ["evaluate", "toy.cospeech", "--corpus", "store", "--raw", "raw", "--split", "all", "--metrics", "beat_align"]
    table = run(toys, *evaluation, cwd=bundles).stdout
    assert {"toy.cospeech", "ground truth", "frozen pose"} <= {line.split("  ")[0] for line in table.splitlines()}
    recipe = ["train", str(TOYS / "toy_net.toml"), "--store", str(bundles / "store")]
    assert run(tmp_path, *recipe, cwd=tmp_path, code=2).stderr.startswith("error: no network is called 'toy-net'")


def test_a_network_of_another_package_with_a_memory_plays_frame_by_frame(bundles, tmp_path):
    live = read_bundle(bundles / "leaky.cospeech").manifest["networks"]["live"]
    assert live["state"] == {"memory": ["N", 8]}
    assert play(tmp_path, str(bundles / "leaky.cospeech"), tmp_path) < 0.5, "it waits for features and smoothing alone"


GESTURER = """
from dataclasses import replace

from cospeech.models import ModelEntry
from cospeech.rules import GenerationOptions, RuleBasedModel

MODEL = ModelEntry(f"{__name__}:Calm", "Our rules at half their size", trains=False)


class Calm(RuleBasedModel):
    def session(self, options=None, /, **keywords):
        options = GenerationOptions.of(options, keywords)
        return super().session(replace(options, intensity=options.intensity / 2))
"""


def test_a_model_without_a_network_plays_at_once(tmp_path):
    (tmp_path / "calm_model.py").write_text(GESTURER)
    install(tmp_path, "calm", {"cospeech.models": {"calm-rules": "calm_model:MODEL"}})
    for name, options in {"theirs": ("--model", "calm-rules"), "ours": ("--intensity", "0.5")}.items():
        run(tmp_path, "generate", str(EXAMPLE), "-o", f"{name}.bvh", *options, cwd=tmp_path)
    assert (tmp_path / "theirs.bvh").read_bytes() == (tmp_path / "ours.bvh").read_bytes()
    assert "calm-rules" in run(tmp_path, "list", "models", cwd=tmp_path).stdout
