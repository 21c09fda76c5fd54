"""What no command does: write a file that nobody asked for, or open a socket to the network (docs/security.md)."""

from __future__ import annotations

import getpass
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Collection
from pathlib import Path

import pytest
import soundfile

import cospeech
from cospeech.cli.demo import EXAMPLE
from cospeech.models import BUNDLE, SHIPPED
from tests.cli.test_train import RECIPE
from tests.support.tiny_store import make_store

pytestmark = pytest.mark.slow

MODELS = ["rules", *sorted(path.stem for path in SHIPPED.glob(f"*{BUNDLE}"))]
OUTPUTS = {name: ["csv", "json"] if name == "speech-to-face" else ["bvh", "glb", "csv"] for name in MODELS}
COMMANDS = [
    *(f"generate talk.wav --model {name} {' '.join(f'-o {name}.{suffix}' for suffix in OUTPUTS[name])}" for name in OUTPUTS),
    "generate talk.wav -o talk.vrma -o talk.npz -o talk.json -o talk.gif -o talk.png --report report.json",
    "convert rules.bvh other.vrma",
    "render rules.glb other.mp4 --audio talk.wav",
    *(f"list {what}" for what in ("models", "styles", "formats", "metrics", "corpora")),
    "dialogue talk.wav guest.wav -o {name}.pair.bvh -o pair.mp4",
    "robot talk.wav robot.csv",
    "bench --seconds 2 --json",
    "synthesise raw --layout trinity --speech speech --hours 0.004 --no-tts",
    "prepare trinity raw store --fps 10 --jobs 2",
    "evaluate rules --corpus store --raw raw --metrics beat_align --split all",
]
TRAINING = "train mine.toml --store tiny --set train.tensorboard=true"
# One process runs all commands. onnxruntime 1.31 looks up its maker's server 9 s after the program begins, so it lives longer.
PROGRAM = """
import sys, time
begun = time.monotonic()
from cospeech.cli.main import main
for command in sys.argv[1:]:
    sys.argv = ["cospeech", *command.split()]
    try:
        main()
    except SystemExit as end:
        if end.code:
            sys.exit(f"{command}: {end.code}")
time.sleep(max(0, begun + 13 - time.monotonic()))
"""
OUTSIDE = re.compile(r"socket\((AF_(?!UNIX|LOCAL|NETLINK)\w+)")


@pytest.fixture
def desk(tmp_path):
    """A folder with speech in it, a fresh home, and a fresh folder for temporary files."""
    samples, rate = soundfile.read(EXAMPLE, dtype="float32")
    for folder in ("home", "temporary", "work/speech"):
        (tmp_path / folder).mkdir(parents=True)
    soundfile.write(tmp_path / "work" / "talk.wav", samples[: 2 * rate], rate)
    soundfile.write(tmp_path / "work" / "guest.wav", samples[4 * rate : 6 * rate], rate)
    soundfile.write(tmp_path / "work" / "speech" / "a.wav", samples[: 6 * rate], rate)
    return tmp_path


def watch(desk: Path, *command: str) -> str:
    """Run a command with a home of its own; its calls for sockets, where strace can be had."""
    variables = {name: value for name, value in os.environ.items() if not name.startswith(("XDG_", *cospeech.NO_TELEMETRY))}
    environment = variables | {"HOME": str(desk / "home"), "TMPDIR": str(desk / "temporary")}
    strace, trace = shutil.which("strace"), desk / "trace"
    spy = [strace, "-f", "-qq", "--seccomp-bpf", "-e", "trace=%net", "-o", str(trace)] if strace else []
    process = subprocess.run([*spy, *command], cwd=desk / "work", env=environment, capture_output=True, text=True)
    assert process.returncode == 0, process.stderr
    return trace.read_text(errors="replace") if strace else ""


def list_leftovers(desk: Path) -> list[str]:
    """Files and folders in the home and among the temporary files."""
    return sorted(str(path.relative_to(desk)) for name in ("home", "temporary") for path in (desk / name).rglob("*"))


def assert_privacy(desk: Path, command: str, trace: str, but: Collection[str] = ()) -> None:
    assert set(list_leftovers(desk)) <= set(but), command
    assert OUTSIDE.findall(trace) == [], command


def test_commands_write_what_was_asked_for_and_open_no_socket(desk):
    trace = watch(desk, sys.executable, "-c", PROGRAM, *COMMANDS)
    assert_privacy(desk, "all commands", trace)
    names = {path.name for path in (desk / "work").iterdir()}
    outputs = {part for command in COMMANDS for part in command.split() if part.startswith(("rules.", "talk.", "other."))}
    others = {"raw", "store", "report.json", "guest.pair.bvh", "pair.mp4", "robot.csv"}
    assert names >= outputs | others


def test_training_writes_its_run_and_opens_no_socket(desk):
    pytest.importorskip("torch", reason="training needs torch (cospeech[train])")
    pytest.importorskip("tensorboard", reason="needs TensorBoard (cospeech[train])")
    (desk / "work" / "mine.toml").write_text(RECIPE)
    make_store(desk / "work" / "tiny")
    trace = watch(desk, sys.executable, "-m", "cospeech", *TRAINING.split())
    # PyTorch makes an empty folder for its compiler, which we do not use.
    assert_privacy(desk, TRAINING, trace, but=[f"temporary/torchinductor_{getpass.getuser()}"])


def test_the_check_can_fail(desk):
    """A socket and a file in the home are seen; so is what onnxruntime does where nobody stops it."""
    if shutil.which("strace") is None:
        pytest.skip("needs strace, to see the calls of libraries")
    code = "import socket; socket.socket(socket.AF_INET, socket.SOCK_DGRAM)"
    assert OUTSIDE.findall(watch(desk, sys.executable, "-c", code)) == ["AF_INET"]
    watch(desk, sys.executable, "-c", "import pathlib; pathlib.Path('~/.trace').expanduser().touch()")
    assert list_leftovers(desk) == ["home/.trace"]


@pytest.mark.parametrize("first", ["", "import onnxruntime\n"])
def test_telemetry_is_off_whoever_imports_first(desk, first):
    """The variables are set by ``import cospeech``, against the user's own words too, and children inherit them."""
    code = "import os, cospeech, subprocess, sys\nassert all(os.environ[k] == v for k, v in cospeech.NO_TELEMETRY.items())\n"
    code += "child = 'import os; print(os.environ[\"ORT_DISABLE_TELEMETRY\"])'\n"
    code += "assert subprocess.check_output([sys.executable, '-c', child]).strip() == b'1'"
    environment = os.environ | {"HOME": str(desk / "home"), "ORT_DISABLE_TELEMETRY": "0"}
    subprocess.run([sys.executable, "-c", first + code], env=environment, check=True)


def test_onnxruntime_has_one_door():
    """`runtime.session` alone imports it, behind ``import cospeech``."""
    package = Path(cospeech.__file__).parent
    files = [path.relative_to(package).as_posix() for path in package.rglob("*.py")]
    users = [name for name in files if re.search(r"^\s*(from|import) onnxruntime\b", (package / name).read_text("utf-8"), re.M)]
    assert users == ["runtime/network.py"]
