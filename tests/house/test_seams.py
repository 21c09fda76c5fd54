"""A system of the papers' tables is one file, one line of the registry, its recipe and its rows: no other module names it."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

import cospeech
from cospeech.models import ENTRIES

SOURCES = Path(cospeech.__file__).parent
SYSTEMS = (
    "seq2seq", "speech2gesture", "joint-embedding", "trimodal", "multi-context", "speech2affective-gestures", "gesticulator",
    "audio2gestures", "talkshow", "gesturediffuclip", "camn", "munit", "cmix-gan", "stage",
)  # fmt: skip
PLACES = ("models", "experiments/tables")
"""Folders of systems and of rows: there a system may build upon another, and a row is named."""


def words_of(path: Path) -> set[str]:
    """Names that a module imports, and its texts that are one word."""
    tree = ast.parse(path.read_text("utf-8"))
    words = {node.value for node in ast.walk(tree) if isinstance(node, ast.Constant) and isinstance(node.value, str)}
    imports = [node for node in ast.walk(tree) if isinstance(node, ast.Import | ast.ImportFrom)]
    return words | {alias.name.rpartition(".")[2] for node in imports for alias in node.names}


@pytest.fixture(scope="module")
def elsewhere() -> dict[str, set[str]]:
    """Module → its words, of all modules but systems and tables."""
    paths = [path.relative_to(SOURCES) for path in SOURCES.rglob("*.py")]
    return {str(path): words_of(SOURCES / path) for path in paths if not path.as_posix().startswith(PLACES)}


@pytest.mark.parametrize("name", SYSTEMS)
def test_no_other_module_names_a_system(elsewhere, name):
    module, _, kind = ENTRIES[name].where.rpartition(".")[2].partition(":")
    paths = [path for path, words in elsewhere.items() if words & {name, kind, module} - {"stage"}]
    assert paths == []


def test_the_check_finds_a_name(elsewhere):
    """The exporter knows the networks that it cannot write like the others."""
    assert "MoGlow" in elsewhere["training/export/exported_model.py"]
