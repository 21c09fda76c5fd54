"""What ``import cospeech`` gives, and what it costs; what installing it needs."""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib
import zipfile
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

import cospeech
from cospeech.cli.demo import EXAMPLE
from cospeech.errors import InputError
from cospeech.metrics.wasserstein import distance

pytestmark = pytest.mark.slow

ROOT = Path(__file__).resolve().parents[2]


def test_public_names_resolve():
    assert all(getattr(cospeech, name) is not None for name in cospeech.__all__)
    assert set(cospeech.__all__) <= set(dir(cospeech))
    with pytest.raises(AttributeError, match="nothing_like_it"):
        _ = cospeech.nothing_like_it


def test_import_is_light():
    code = "import sys, cospeech; print(*sys.modules)"
    process = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "cospeech" in process.stdout.split()
    assert {"numpy", "onnxruntime", "pydantic", "soundfile", "torch", "typer"}.isdisjoint(process.stdout.split())


# What the core does not install (the extras and the tools of development), and who runs as if it were not there.
BEYOND_THE_CORE = {
    "dask", "distributed", "faster_whisper", "h5py", "joblib", "librosa", "lmdb", "onnx", "pandas", "pyarrow", "scipy",
    "sklearn", "starlette", "tables", "tensorboard", "torch", "uvicorn",
}  # fmt: skip
WITHOUT = """
import sys
from importlib.abc import MetaPathFinder

refused = set(sys.argv.pop(1).split(","))

class Refuse(MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in refused:
            raise AssertionError(f"imports {name}")  # no ImportError, which the program might answer

sys.meta_path.insert(0, Refuse())
"""
COMMAND = WITHOUT + "from cospeech.cli import main\nmain()"
SESSION = (
    WITHOUT
    + """
import cospeech
from cospeech.rules import RuleBasedModel
session = RuleBasedModel().session(fps=20)
speech = cospeech.Speech.load(sys.argv[1])
frames = sum(len(motion) for chunk in speech.chunks(1.0) for motion in session.push(chunk))
assert 0 < frames + sum(map(len, session.finish())) == speech.frames(20)
"""
)


def without(modules: set[str], code: str, *arguments: object, folder: Path) -> None:
    """Run Python code in a process that cannot import ``modules``; it must succeed, and warn of nothing."""
    command = [sys.executable, "-c", code, ",".join(sorted(modules)), *map(str, arguments)]
    process = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    assert (process.returncode, process.stderr) == (0, "")


@pytest.fixture(scope="module")
def core_files(tmp_path_factory) -> Path:
    """Files that ``generate`` wrote where the core alone can be imported."""
    folder = tmp_path_factory.mktemp("core")
    outputs = [part for suffix in ("bvh", "glb", "csv", "npz") for part in ("-o", f"talk.{suffix}")]
    without(BEYOND_THE_CORE, COMMAND, "generate", EXAMPLE, *outputs, "-q", folder=folder)
    return folder


@pytest.mark.parametrize(
    "line",
    ["--help", "generate --help", "convert talk.bvh other.vrma -q", "render talk.npz talk.png -q"]
    + [f"list {what}" for what in ("models", "styles", "emotions", "formats", "skeletons", "metrics", "corpora", "recipes")],
)
def test_the_core_is_enough(core_files, line):
    """Neither torch nor scipy nor anything else that `make demo` does not install is imported on the way to a motion."""
    without(BEYOND_THE_CORE, COMMAND, *line.split(), folder=core_files)


def test_the_core_is_enough_for_a_session(tmp_path):
    without(BEYOND_THE_CORE, SESSION, EXAMPLE, folder=tmp_path)


@pytest.mark.parametrize("line", ["--help", "list models", "convert talk.bvh again.bvh -q"])
def test_onnxruntime_waits_for_a_bundle(core_files, line):
    without({"onnxruntime", "safetensors"}, COMMAND, *line.split(), folder=core_files)


def test_rules_by_themselves_need_no_onnxruntime_and_without_a_plan_no_pydantic(tmp_path):
    without({"onnxruntime", "pydantic", "safetensors"}, SESSION, EXAMPLE, folder=tmp_path)


@pytest.mark.parametrize("model", ["rules", "chain-of-generation"])
def test_without_a_plan_pydantic_is_not_needed(tmp_path, model):
    code = (
        WITHOUT
        + "from cospeech.generate import generate_files\ngenerate_files(*sys.argv[1:2], ['talk.bvh'], model=sys.argv[2])"
    )
    without({"pydantic"}, code, EXAMPLE, model, folder=tmp_path)


def test_who_lacks_scipy_is_told_how_to_get_it(monkeypatch):
    assert distance(np.zeros(3), np.ones(3)) == 1.0
    monkeypatch.setitem(sys.modules, "scipy", None)
    monkeypatch.delitem(sys.modules, "scipy.stats")
    with pytest.raises(InputError, match=r'need scipy \(in a clone: pip install -e "\.\[corpora\]"\)$'):
        distance(np.zeros(3), np.ones(3))


def test_scipy_has_one_door():
    """Metrics and training ask `metrics._scipy`."""
    package = ROOT / "src" / "cospeech"
    files = {path.relative_to(package).as_posix(): path.read_text("utf-8") for path in package.rglob("*.py")}
    assert [name for name, text in files.items() if re.search(r"^\s*(from|import) scipy\b", text, re.M)] == []


OLD_PATHS = """
cospeech.corpora Clip Dropped
cospeech.corpora.attributes attributes_of speaker_attributes
cospeech.corpora.store Store
cospeech.demo EXAMPLE
cospeech.emotions EmotionTrack read_emotion_track
cospeech.evaluation evaluate
cospeech.generate generate_files
cospeech.metrics Tools load_metric
cospeech.motion Motion
cospeech.poses find_pose
cospeech.poses.controls control_row read_controls
cospeech.prepare prepare
cospeech.recipe load_recipe
cospeech.rotations quat_to_euler
cospeech.rules RuleGesturer STYLES
cospeech.runtime.gesturer BundleGesturer
cospeech.runtime.mouth SHIPPED_FACE BundleMouth open_mouth
cospeech.skeletons SKELETONS
cospeech.skeletons.arkit ARKIT ARKIT_INDEX
cospeech.speech open_speech
cospeech.style_mixing measure_mixing
"""
OLD_PATHS_OF_TRAINING = """
cospeech.models.chain_of_generation ChainConfig ChainOfGeneration
cospeech.models.cmix_gan CMixGan
cospeech.models.mix_stage MixGanConfig MixStage MixStageConfig
cospeech.models.munit Munit MunitConfig
cospeech.models.speech_classifier SpeechClassifier SpeechClassifierConfig
cospeech.train train
"""


@pytest.mark.parametrize("line", OLD_PATHS.strip().splitlines())
def test_import_paths_of_the_first_documentation_work(line):
    module, *names = line.split()
    result = import_module(module)
    assert all(hasattr(result, name) for name in names)


@pytest.mark.parametrize("line", OLD_PATHS_OF_TRAINING.strip().splitlines())
def test_import_paths_of_the_first_documentation_of_training_work(line):
    pytest.importorskip("torch", reason="networks need torch (the train extra)")
    test_import_paths_of_the_first_documentation_work(line)


def test_a_module_under_its_old_path_is_the_same_object():
    assert import_module("cospeech.speech") is import_module("cospeech.audio.speech")
    assert import_module("cospeech.audio.speech").__spec__.name == "cospeech.audio.speech"


def read_lock() -> dict[str, str]:
    """Name → versions of the lock, joined."""
    versions: dict[str, str] = {}
    for package in tomllib.loads((ROOT / "uv.lock").read_text("utf-8"))["package"]:
        versions[package["name"]] = f"{versions.get(package['name'], '')} {package.get('version', '')}"
    return versions


def read_pins(name: str) -> dict[str, str]:
    text = (ROOT / "requirements" / name).read_text("utf-8")
    versions: dict[str, str] = {}
    for package, version in re.findall(r"^([\w.-]+)==(\S+)", text, re.M):
        versions[package] = f"{versions.get(package, '')} {version}"
    return versions


@pytest.mark.parametrize("name", ["core.txt", "studio.txt", "node.txt"])
def test_what_pip_installs_is_what_the_lock_says(name):
    assert read_pins(name)
    assert all(set(version.split()) <= set(read_lock()[package].split()) for package, version in read_pins(name).items())


@pytest.mark.parametrize(("name", "command"), [("core.txt", "EXPORT"), ("studio.txt", "STUDIO"), ("node.txt", "NODE")])
def test_lists_for_pip_are_made_from_the_lock(name, command):
    uv = Path(sys.executable).with_name("uv")
    if not uv.is_file():
        pytest.skip("needs uv beside this Python (`make test` installs it)")
    export = re.search(rf'^{command} = "(.*)"$', (ROOT / "tools" / "lock.py").read_text("utf-8"), re.M)[1].split()
    process = subprocess.run([uv, *export, "--offline"], cwd=ROOT, capture_output=True, text=True, check=True)
    assert process.stdout == (ROOT / "requirements" / name).read_text("utf-8"), "run `make lock`"


def test_the_core_has_no_torch_and_is_small():
    """Every package of the core is decided on, none slips in: together they are some 90 MB of downloads."""
    direct = {"numpy", "onnxruntime", "safetensors", "soundfile", "soxr", "pillow", "pydantic", "rich", "typer", "av"}
    of_theirs = {
        "annotated-doc", "annotated-types", "cffi", "colorama", "flatbuffers", "markdown-it-py", "mdurl", "packaging",
        "protobuf", "pycparser", "pydantic-core", "pygments", "shellingham", "typing-extensions", "typing-inspection",
    }  # fmt: skip
    of_intel_macs = {"coloredlogs", "humanfriendly", "mpmath", "sympy"}  # wanted by the last onnxruntime for them
    to_install = {"hatchling", "pathspec", "pluggy", "tomlkit", "trove-classifiers"}
    assert set(read_pins("core.txt")) == direct | of_theirs | of_intel_macs | to_install


def test_the_wheel_is_complete(tmp_path):
    """Everything in the package travels with it: assets too; and the licence."""
    pytest.importorskip("hatchling")
    command = [sys.executable, "-m", "hatchling", "build", "--target", "wheel", "--directory", tmp_path]
    subprocess.run(command, cwd=ROOT, check=True, capture_output=True)
    (wheel,) = tmp_path.glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        names = set(archive.namelist())
    source = ROOT / "src"
    files = {path.relative_to(source).as_posix() for path in (source / "cospeech").rglob("*") if path.is_file()}
    assert {name for name in files if "__pycache__" not in name} <= names
    assert any(name.endswith("licenses/LICENSE") for name in names)
    # ours: weights of four systems are 10 MB of it; what a slow line fetches within a minute (20 MB were allowed)
    assert wheel.stat().st_size < 13e6
