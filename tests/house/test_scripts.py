"""What the scripts in benchmarks/ and tools/ import is there: most of them run seldom, and nobody else would notice."""

from __future__ import annotations

import ast
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
SCRIPTS = sorted(path for folder in ("benchmarks", "tools") for path in (ROOT / folder).rglob("*.py"))


def exists(module: str) -> bool:
    try:
        return find_spec(module) is not None
    except ModuleNotFoundError:  # the package that it would be in
        return False


def missing(source: str, folder: Path) -> list[str]:
    """What a script in this folder imports of the package, or of the scripts beside it, and does not find."""
    names = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            names += [n.name for n in node.names if n.name.split(".")[0] == "cospeech" and not exists(n.name)]
        elif isinstance(node, ast.ImportFrom) and node.module:
            names += [f"{node.module}.{n.name}" for n in node.names if not has(node.module, n.name, folder)]
    return names


def has(module: str, name: str, folder: Path) -> bool:
    """Whether a module has a name; a module of other people's has them all."""
    beside = folder.joinpath(*module.split(".")).with_suffix(".py")
    if beside.is_file():
        return name in names_of(beside)
    if module.split(".")[0] != "cospeech":
        return True
    return exists(f"{module}.{name}") or (exists(module) and hasattr(import_module(module), name))


def names_of(path: Path) -> set[str]:
    """What a script binds at its top."""
    body = ast.parse(path.read_text("utf-8")).body
    names = {node.name for node in body if isinstance(node, ast.FunctionDef | ast.ClassDef)}
    for node in body:
        targets = node.targets if isinstance(node, ast.Assign) else [node.target] if isinstance(node, ast.AnnAssign) else []
        names |= {name.id for target in targets for name in ast.walk(target) if isinstance(name, ast.Name)}
        if isinstance(node, ast.Import | ast.ImportFrom):
            names |= {alias.asname or alias.name for alias in node.names}
    return names


@pytest.mark.torch
@pytest.mark.parametrize("path", SCRIPTS, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_a_script_imports_only_what_there_is(path):
    assert not missing(path.read_text("utf-8"), path.parent)


@pytest.mark.slow
def test_what_is_not_there_is_found():
    folder = ROOT / "benchmarks"
    assert missing("from cospeech.audio.speech import Speech, nothing", folder) == ["cospeech.audio.speech.nothing"]
    assert missing("from cospeech.nowhere.at_all import Speech", folder) == ["cospeech.nowhere.at_all.Speech"]
    assert missing("import numpy, cospeech.nowhere", folder) == ["cospeech.nowhere"]
    assert missing("from flow import verdict, nothing", folder) == ["flow.nothing"]
    assert missing("from mannequin.hands import nothing", ROOT / "tools") == ["mannequin.hands.nothing"]
    assert not missing("from cospeech import motion\nfrom numpy import array", folder)
