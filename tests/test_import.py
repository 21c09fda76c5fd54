"""What ``import cospeech`` gives, and what it costs; what installing it needs."""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest

import cospeech

ROOT = Path(__file__).resolve().parents[1]


def test_public_names_resolve():
    assert all(getattr(cospeech, name) is not None for name in cospeech.__all__)
    assert set(cospeech.__all__) <= set(dir(cospeech))
    with pytest.raises(AttributeError, match="nothing_like_it"):
        _ = cospeech.nothing_like_it


def test_import_is_light():
    code = "import sys, cospeech; print(sorted({'numpy', 'scipy', 'soundfile', 'pydantic', 'typer'} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def locked() -> dict[str, str]:
    """Name → versions of the lock, joined."""
    found: dict[str, str] = {}
    for package in tomllib.loads((ROOT / "uv.lock").read_text("utf-8"))["package"]:
        found[package["name"]] = f"{found.get(package['name'], '')} {package.get('version', '')}"
    return found


def pinned(name: str) -> dict[str, str]:
    text = (ROOT / "requirements" / name).read_text("utf-8")
    found: dict[str, str] = {}
    for package, version in re.findall(r"^([\w.-]+)==(\S+)", text, re.M):
        found[package] = f"{found.get(package, '')} {version}"
    return found


def test_what_pip_installs_is_what_the_lock_says():
    assert pinned("core.txt")
    assert all(set(version.split()) <= set(locked()[name].split()) for name, version in pinned("core.txt").items())


def test_core_txt_is_made_from_the_lock(tmp_path):
    uv = Path(sys.executable).with_name("uv")
    if not uv.is_file():
        pytest.skip("needs uv beside this Python (`make test` installs it)")
    export = re.search(r'^EXPORT = "(.*)"$', (ROOT / "tools" / "lock.py").read_text("utf-8"), re.M)[1].split()
    done = subprocess.run([uv, *export, "--offline"], cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout == (ROOT / "requirements" / "core.txt").read_text("utf-8"), "run `make lock`"


def test_the_core_has_no_torch_and_is_small():
    """Every package of the core is decided on, none slips in: together they are some 100 MB of downloads."""
    direct = {"numpy", "scipy", "soundfile", "soxr", "pillow", "pydantic", "rich", "typer", "av"}
    of_theirs = {
        "annotated-doc", "annotated-types", "cffi", "colorama", "markdown-it-py", "mdurl", "pycparser", "pydantic-core",
        "pygments", "shellingham", "typing-extensions", "typing-inspection",
    }  # fmt: skip
    to_install = {"hatchling", "packaging", "pathspec", "pluggy", "tomlkit", "trove-classifiers"}
    assert set(pinned("core.txt")) == direct | of_theirs | to_install


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
    assert wheel.stat().st_size < 10e6
