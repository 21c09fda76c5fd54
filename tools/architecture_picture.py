"""The picture of the layers (docs/media/architecture.svg), drawn from the list of layers in docs/contributing.md.

The page holds the order and a line about every package; a module's line is its docstring's first. Whether a layer needs PyTorch
is read from its imports. Every box has its own background, so that the picture is readable on light and on dark pages.
"""

from __future__ import annotations

import ast
import re
from html import escape
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "src" / "cospeech"
PAGE = ROOT / "docs" / "contributing.md"
PICTURE = ROOT / "docs" / "media" / "architecture.svg"

WIDTH, ROW, GAP, NAME, HEAD = 960, 30, 4, 130, 44  # pixels; ours
CORE, TORCH, TEXT, LINE = "#00796b", "#6a1b9a", "#ffffff", "#eceff1"
DARK = "#263238"


def layers(page: str) -> list[str]:
    """Names of the list below the heading *Layers*, lowest first."""
    match = re.search(r"## Layers\n+```text\n(.*?)```", page, re.S)
    assert match, "docs/contributing.md has no list of layers"
    return match[1].replace("<", " ").split()


def describe(name: str, page: str) -> str:
    """The package's line in the page's table, else the first line of the module's docstring."""
    row = re.search(rf"^\| `{name}` \| (.*?) \|$", page, re.M)
    if row:
        return row[1].replace("`", "")
    text = ast.get_docstring(ast.parse((PACKAGE / f"{name}.py").read_text("utf-8"))) or ""
    return re.split(r"\.(?:\s|$)", text)[0].replace("\n", " ").replace("`", "")


def needs_torch(name: str) -> bool:
    """Whether a file of the layer imports PyTorch."""
    files = [PACKAGE / f"{name}.py"] if (PACKAGE / f"{name}.py").is_file() else sorted((PACKAGE / name).rglob("*.py"))
    return any(re.search(r"^\s*(import|from) torch\b", path.read_text("utf-8"), re.M) for path in files)


def box(x: float, y: float, width: float, fill: str, text: str, colour: str, weight: str = "normal") -> str:
    """A rectangle with a line of text."""
    return (
        f'<rect x="{x:g}" y="{y:g}" width="{width:g}" height="{ROW}" rx="4" fill="{fill}"/>'
        f'<text x="{x + 10:g}" y="{y + 20:g}" fill="{colour}" font-weight="{weight}">{escape(text)}</text>\n'
    )


def architecture_svg() -> str:
    """The picture: one row for every layer, the highest first."""
    page = PAGE.read_text("utf-8")
    names = layers(page)[::-1]
    height = HEAD + len(names) * (ROW + GAP) + GAP
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height}" font-family="sans-serif" font-size="13" '
        'role="img" aria-label="The layers of cospeech, the highest first">\n',
        "<!-- Written by `make docs` from docs/contributing.md; do not edit. -->\n",
        box(GAP, GAP, 330, DARK, "A layer imports only layers below it.", TEXT),
        box(GAP + 340, GAP, 170, CORE, "needs no PyTorch", TEXT),
        box(GAP + 520, GAP, 170, TORCH, "needs PyTorch", TEXT),
    ]
    for row, name in enumerate(names):
        y = HEAD + row * (ROW + GAP)
        parts.append(box(GAP, y, NAME, TORCH if needs_torch(name) else CORE, name, TEXT, "bold"))
        parts.append(box(2 * GAP + NAME, y, WIDTH - NAME - 3 * GAP, LINE, describe(name, page), DARK))
    return "".join([*parts, "</svg>\n"])
