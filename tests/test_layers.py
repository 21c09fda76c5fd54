"""Imports go one way, downwards; the heavy libraries stay where they belong (docs/contributing.md, "Layers")."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parents[1] / "src" / "cospeech"

# Low to high: a module may import what stands before its own row, and its own package. Unknown names fail, see below.
LAYERS = [
    {"errors", "limits", "_decode"},
    {"files", "interrupts", "rotations", "skeletons"},
    {"decoding", "emotions", "recipe", "runlog"},
    {"skeleton", "speech"},
    {"motion", "features", "recognise_shape"},
    {"recognise", "tpose", "alignment"},
    {"retarget", "transcripts", "nn"},
    {"mannequin"},
    {"render"},
    {"export", "metrics", "rules", "motion_files"},
    {"corpora"},
    {"poses"},
    {"runtime"},
    {"models", "avatar"},
    {"checkpoint"},
    {"training_set"},
    {"report", "how_to_open"},
    {"prepare", "synthesise"},
    {"bundling_flow", "bundling_window"},
    {"bundling_chain"},
    {"train", "bundling", "evaluation"},
    {"contest", "style_mixing"},
    {"tables"},
    {"checks"},
    {"generate"},
    {"batch", "convert", "demo", "catalogue"},
    {"bench", "cli_corpora", "cli_evaluate", "cli_options", "cli_train"},
    {"studio", "cli"},
]
RANK = {name: rank for rank, names in enumerate(LAYERS) for name in names}
# What is imported only when called: Motion.load, .save and .retarget; Speech.load with a transcript; render_motion;
# models.load and .bundle_run of a run folder.
FACADES = {("motion", "export"), ("motion", "retarget"), ("speech", "transcripts"), ("render", "export")}
FACADES |= {("models", "checkpoint"), ("models", "bundling")}
TORCH = {
    "nn",
    "models",
    "checkpoint",
    "training_set",
    "train",
    "bundling",
    "bundling_flow",
    "bundling_window",
    "bundling_chain",
}


def part(path: Path) -> str:
    """`export/bvh.py` → `export`; `speech.py` → `speech`."""
    return path.relative_to(PACKAGE).parts[0].removesuffix(".py")


def imported(tree: ast.AST, path: Path) -> set[str]:
    """Dotted names of everything that a file imports, at its top or later; relative imports made absolute."""
    package = ["cospeech", *path.relative_to(PACKAGE).parts[:-1]]
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else []
            module = ".".join([*base, *([node.module] if node.module else [])])
            found |= {f"{module}.{alias.name}" for alias in node.names}
    return found


def faults(source: str, path: Path) -> list[str]:
    """Imports of a file that go upwards, or bring torch where it does not belong."""
    own, found = part(path), []
    for name in imported(ast.parse(source), path):
        top, *rest = name.split(".")
        if top == "torch" and own not in TORCH:
            found.append(f"{own} imports torch")
        if top != "cospeech" or not rest or rest[0].startswith("__") or rest[0] == own:
            continue
        if rest[0] in RANK and RANK[rest[0]] >= RANK[own] and (own, rest[0]) not in FACADES:
            found.append(f"{own} imports {rest[0]}")
    return found


def test_every_module_has_a_layer():
    parts = {part(path) for path in PACKAGE.rglob("*.py")} - {"__init__", "__main__"}
    assert parts <= set(RANK), f"give these a row in LAYERS: {sorted(parts - set(RANK))}"


def test_imports_go_downwards():
    files = [path for path in PACKAGE.rglob("*.py") if part(path) not in {"__init__", "__main__"}]
    wrong = {str(path.relative_to(PACKAGE)): found for path in files if (found := faults(path.read_text(), path))}
    assert wrong == {}


@pytest.mark.parametrize(
    ("file", "source", "fault"),
    [
        ("skeleton.py", "from .motion import Motion", "skeleton imports motion"),
        ("metrics/fgd.py", "def f():\n    from ..models import load", "metrics imports models"),
        ("export/bvh.py", "import torch.nn", "export imports torch"),
        ("rules/plan.py", "from cospeech.cli import main", "rules imports cli"),
    ],
)
def test_the_test_would_notice(file, source, fault):
    assert faults(source, PACKAGE / file) == [fault]
