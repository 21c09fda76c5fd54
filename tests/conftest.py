"""What tests share: where outside material and outside programs are, and a clear word when they are not there."""

from __future__ import annotations

import inspect
import os
import re
import sys
import tempfile
from functools import cache
from importlib.util import find_spec
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

ROOT = Path(__file__).resolve().parents[1]

# Where an image forbids bytecode, every process of a test compiles every module again: seconds for one that imports torch.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False
# Workers share the cores: torch and BLAS with threads of their own would stand in each other's way.
os.environ.setdefault("OMP_NUM_THREADS", "1")
# librosa is compiled when it is first called. Two workers that write one cache spoil it, and what reads it then crashes.
# A worker inherits the environment of the process that starts it. So each one names a folder of its own, which ends with it.
_numba_cache = tempfile.TemporaryDirectory(prefix="cospeech-numba-", ignore_cleanup_errors=True)
os.environ["NUMBA_CACHE_DIR"] = _numba_cache.name
os.environ.setdefault("NUMBA_OPT", "0")  # to optimise what is called a few times takes a third of the time of these tests

# PyTorch takes seconds to export a network. All workers share what they exported (tests/support/exports.py).
if "COSPEECH_TEST_EXPORTS" not in os.environ:
    _exports = tempfile.TemporaryDirectory(prefix="cospeech-exports-", ignore_cleanup_errors=True)
    os.environ["COSPEECH_TEST_EXPORTS"] = _exports.name

# Machines that run tests are slow at times: no per-example deadline, and the same examples on every run.
settings.register_profile("cospeech", deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("cospeech")

# A fixture that reaches for outside material → the marker of the tests that use it.
OUTSIDE = {"shared_folder": "shared", "blender_python": "blender", "node": "node"}
ASKS = r"pytest\.importorskip\(\"(?:torch|onnx)\""  # onnx: to write graphs, which is training's
WHOLE = re.compile(rf"^(?:(?:\w+ = )?{ASKS}|(?:import|from) torch\b)", re.M)  # at the top of a module


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Skip modules of torch before they import it, where no test of torch is wanted."""
    is_left_out = "not torch" in config.getoption("markexpr") and collection_path.name.startswith("test_")
    return True if is_left_out and WHOLE.search(collection_path.read_text("utf-8")) else None


@cache
def source_of(thing: object) -> str:
    return inspect.getsource(thing)  # type: ignore[arg-type]


def needs_torch(item: pytest.Item) -> bool:
    """Whether the module of a test, the test or a fixture that it uses asks for torch."""
    fixtures = [definitions[-1].func for definitions in item._fixtureinfo.name2fixturedefs.values()]
    return bool(WHOLE.search(source_of(item.module))) or any(
        re.search(ASKS, source_of(part)) for part in (item.function, *fixtures)
    )


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark each test with what it needs. Only `slow`, and `torch` where a command needs it, are written at the test."""
    for item in items:
        needs = {marker for fixture, marker in OUTSIDE.items() if fixture in item.fixturenames}
        needs |= {"browser"} if "open_chromium(" in source_of(item.function) or "chromium" in item.fixturenames else set()
        for marker in sorted(needs | ({"torch"} if needs_torch(item) else set())):
            item.add_marker(marker)


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    if item.get_closest_marker("torch") and find_spec("torch") and find_spec("onnx"):
        from tests.support.exports import share_exports

        share_exports()


@pytest.fixture(scope="session")
def shared_folder() -> Path:
    """The folder of recordings and motion files that cannot be shipped: $COSPEECH_SHARED, or ``../shared`` beside the repo."""
    folder = Path(os.environ.get("COSPEECH_SHARED", ROOT.parent / "shared"))
    if not (folder / "data").is_dir():
        pytest.skip(f"needs the shared data, and there is none at {folder} (set COSPEECH_SHARED)")
    return folder


def program(variable: str, what: str) -> str:
    """The path in an environment variable; where it is unset the test is skipped, where it is wrong the test fails."""
    path = os.environ.get(variable)
    if not path:
        pytest.skip(f"needs {what}: {variable} is not set (`make test` sets it)")
    if not Path(path).is_file():
        pytest.fail(f"{variable}={path} does not exist")
    return path


@pytest.fixture(scope="session")
def blender_python() -> str:
    """A Python that can ``import bpy``."""
    return program("COSPEECH_BLENDER_PYTHON", "Blender as a Python module")


@pytest.fixture(scope="session")
def node() -> str:
    """Node ≥ 18, with ``tests/node/node_modules`` installed."""
    return program("COSPEECH_NODE", "Node.js")


@pytest.fixture
def cli(monkeypatch, capsys):
    """Run ``cospeech ARGUMENTS`` in this process; (exit code, stdout, stderr)."""
    from cospeech.cli.main import main

    def run(*arguments: object) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["cospeech", *map(str, arguments)])
        with pytest.raises(SystemExit) as exit_info:
            main()
        output = capsys.readouterr()
        return int(exit_info.value.code or 0), output.out, output.err

    return run


@pytest.fixture(scope="session")
def long_speech(tmp_path_factory) -> Path:
    """Five minutes of speech: enough to be killed or interrupted in, and to be worked at for some seconds."""
    import soundfile

    from cospeech.cli.demo import EXAMPLE

    samples, rate = soundfile.read(EXAMPLE, dtype="float32")
    path = tmp_path_factory.mktemp("long") / "long.wav"
    with soundfile.SoundFile(path, "w", rate, 1) as file:
        for _ in range(int(300 / (len(samples) / rate))):
            file.write(samples)
    return path
