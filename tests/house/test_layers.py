"""Imports go one way; the heavy libraries stay where they belong. The order stands in docs/contributing.md, "Layers"."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "src" / "cospeech"
ORDER = re.search(r"## Layers\n+```text\n(.*?)```", (ROOT / "docs" / "contributing.md").read_text("utf-8"), re.S)[1]
RANK = {name: rank for rank, name in enumerate(ORDER.replace("<", " ").split())}
# What is imported only when it is called: Motion.load and Motion.save; `load` of the folder of a run.
FACADES = {("motion", "export"), ("models", "training")}
TORCH = {"models", "training", "experiments"}
MOST_MODULES, MOST_PACKAGES = 7, 14  # at the root; `files` was a module until 400 lines were too few


def part(path: Path) -> str:
    """`export/bvh.py` → `export`; `generate.py` → `generate`."""
    return path.relative_to(PACKAGE).parts[0].removesuffix(".py")


def list_imports(tree: ast.AST, path: Path) -> set[str]:
    """Dotted names of everything that a file imports, at its top or later; relative imports made absolute."""
    package = ["cospeech", *path.relative_to(PACKAGE).parts[:-1]]
    names = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else []
            module = ".".join([*base, *([node.module] if node.module else [])])
            names |= {f"{module}.{alias.name}" for alias in node.names}
    return names


def faults(source: str, path: Path) -> list[str]:
    """Imports of a file that go upwards, or bring torch where it does not belong."""
    own, problems = part(path), []
    for name in list_imports(ast.parse(source), path):
        top, *rest = name.split(".")
        if top == "torch" and own not in TORCH:
            problems.append(f"{own} imports torch")
        if top != "cospeech" or not rest or rest[0].startswith("__") or rest[0] == own:
            continue
        if rest[0] in RANK and RANK[rest[0]] >= RANK[own] and (own, rest[0]) not in FACADES:
            problems.append(f"{own} imports {rest[0]}")
    return problems


def test_every_module_and_package_has_a_layer_and_they_are_few():
    modules = {path.stem for path in PACKAGE.glob("*.py")}
    packages = {path.parent.name for path in PACKAGE.glob("*/__init__.py")}
    assert set(RANK) == (modules | packages) - {"__init__", "__main__"}, "docs/contributing.md has the order"
    assert len(modules) <= MOST_MODULES
    assert len(packages) <= MOST_PACKAGES


def test_imports_go_downwards():
    files = [path for path in PACKAGE.rglob("*.py") if part(path) not in {"__init__", "__main__"}]
    wrong = {str(path.relative_to(PACKAGE)): problems for path in files if (problems := faults(path.read_text(), path))}
    assert wrong == {}


@pytest.mark.parametrize("pair", sorted(FACADES))
def test_facades_are_imported_only_when_called(pair):
    low, high = pair
    for path in (PACKAGE / low).rglob("*.py"):
        top = ast.Module([node for node in ast.parse(path.read_text()).body if not isinstance(node, ast.If)], [])
        at_once = {node for node in top.body if isinstance(node, ast.Import | ast.ImportFrom)}
        names = list_imports(ast.Module(list(at_once), []), path)
        assert not [name for name in names if name.startswith(f"cospeech.{high}.")], path


@pytest.mark.parametrize(
    ("file", "source", "fault"),
    [
        ("motion/skeleton.py", "from ..audio.speech import Speech", "motion imports audio"),
        ("metrics/fgd.py", "def f():\n    from ..models import load", "metrics imports models"),
        ("export/bvh.py", "import torch.nn", "export imports torch"),
        ("rules/plan.py", "from cospeech.cli import main", "rules imports cli"),
        ("training/train.py", "from ..experiments import tables", "training imports experiments"),
    ],
)
def test_the_test_would_notice(file, source, fault):
    assert faults(source, PACKAGE / file) == [fault]
