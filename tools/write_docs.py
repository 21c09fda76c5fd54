"""`make docs`: writes what the documentation takes from the code, so that it cannot drift; a test compares.

``docs/cli.md`` and ``docs/media/architecture.svg`` are written whole. In other pages (README.md too) the lines between
``<!-- table: NAME -->`` and ``<!-- end -->`` are, and those after ``<!-- file: PATH -->``, which are the file. In mkdocs.yml
the pages of the models are.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

from architecture_picture import PICTURE, architecture_svg

from cospeech.cli.catalogue import catalogue
from cospeech.limits import LIMITS, Limit
from cospeech.models import ENTRIES

ROOT = Path(__file__).resolve().parents[1]
NAVIGATION = ROOT / "mkdocs.yml"
COMMANDS = (
    "generate",
    "dialogue",
    "stream",
    "convert",
    "render",
    "robot",
    "list",
    "demo",
    "bench",
    "prepare",
    "synthesise",
    "evaluate",
    "studio",
    "study",
    "study make",
    "study serve",
    "study export",
    "study import",
    "study report",
    "train",
    "bundle",
)
BINARY = {30: "GiB", 20: "MiB", 10: "KiB", 0: "bytes"}
BLOCK = re.compile(r"(<!-- table: ([a-z_]+) -->\n).*?(<!-- end -->)", re.S)
NAV = re.compile(r"(      # models: .*\n)(?:.*\n)*?(      # end\n)")
FILE = re.compile(r"(<!-- file: (\S+) -->\n```\w+\n).*?(^```\n<!-- end -->)", re.S | re.M)

CLI_HEAD = """\
# Command line

<!-- Written by `make docs` from the program itself; do not edit. -->

Every error is one line, `error: what is wrong (how to mend it)`. Exit codes: 0 done; 1 a failure of ours;
2 something that you gave cannot be used, and nothing was written for it (of several speeches, the good ones are written);
130 interrupted, and nothing half-written is left.
"""


def cli_page() -> str:
    """All of ``--help``, as a page."""
    parts = [CLI_HEAD]
    for command in ("", *COMMANDS):
        title = f"cospeech {command}".strip()
        parts.append(f"\n## {title}\n\n```text\n{help_of(command)}```\n")
    return "".join(parts)


def help_of(command: str) -> str:
    """What ``cospeech COMMAND --help`` prints, on a terminal of 100 columns."""
    environment = os.environ | {"COLUMNS": "100", "PYTHONIOENCODING": "utf-8", "NO_COLOR": "1"}
    arguments = [sys.executable, "-m", "cospeech", *command.split(), "--help"]
    process = subprocess.run(arguments, capture_output=True, check=True, env=environment)
    return "\n".join(line.rstrip() for line in process.stdout.decode().strip().splitlines()) + "\n"


def table(head: list[str], rows: list[list[str]]) -> str:
    """A Markdown table."""
    lines = [head, ["---"] * len(head), *rows]
    return "".join(f"| {' | '.join(cell.replace('|', '&#124;') for cell in line)} |\n" for line in lines)


def write_names(what: str) -> Callable[[], str]:
    """A table of everything of a kind: name and one line."""
    return lambda: table([what[:-1], ""], [[f"`{row['name']}`", row["what"]] for row in catalogue(what)])


def styles() -> str:
    """A table of the styles, by model; speakers of whom no more is known share a row."""
    rows: dict[tuple[str, str], list[str]] = {}
    for row in catalogue("styles"):
        rows.setdefault((row["model"], row["what"]), []).append(f"`{row['name']}`")
    return table(["style", "model", ""], [[", ".join(names), f"`{model}`", what] for (model, what), names in rows.items()])


def models() -> str:
    """A table of the models: whose they are, what they do, what training needs, and whether they play at once."""
    rows = []
    for row in catalogue("models"):
        what = row["what"].rpartition("; ")[0]
        rows.append([f"`{row['name']}`", row["paper"] or "ours", what, row["needs"], row["ready"]])
    return table(["model", "paper", "what it does", "it is trained on", "ready to use"], rows)


def formats() -> str:
    rows = [[f"[`{r['name']}`](#{r['name'][1:]})", r["what"], r["access"], r["opens"]] for r in catalogue("formats")]
    return table(["suffix", "what it holds", "cospeech can", "where it goes"], rows)


def overview(place: str) -> Callable[[], str]:
    """The table of models: name, paper, what it does, whether weights ship, speed; ``place`` is the folder of the pages."""

    def rows() -> str:
        page = (ROOT / "docs" / "benchmarks.md").read_text("utf-8")
        lines = []
        for row in catalogue("models"):
            name = row["name"]
            first, ready = row["what"].split("; ready to use")[0].split("; no weights")[0], "ready to use" in row["what"]
            match = re.fullmatch(r"(.*?)(?: \(([^)]*)\))?: (.*)", first)
            assert match, f"the docstring of {name} begins with 'Name (paper): what it does'"
            speed = re.search(rf"^\| `{name}` \| ([\d.]+) \|", page, re.M)
            assert speed or not ready, f"docs/benchmarks.md has no speed of {name}: benchmarks/models.py"
            link = f"[`{name}`]({place}models/{name.replace('-', '_')}.md)"
            lines.append([link, match[2] or "ours", match[3], "yes" if ready else "no", speed[1] if speed else "–"])
        return table(["model", "paper", "what it does", "weights ship", "real-time factor"], lines)

    return rows


def limits() -> str:
    return table(["what", "limit", "why"], [[row.what, amount(row), row.why] for row in LIMITS])


def amount(limit: Limit) -> str:
    """A limit as people read it: ``256 MiB``, ``40,000,000 frames × joints``."""
    if limit.unit.startswith("bytes"):
        power = next(n for n in (30, 20, 10, 0) if limit.value >= 1 << n)
        return f"{limit.value / (1 << power):g} {BINARY[power]}{limit.unit[5:]}"
    return f"{limit.value:,.10g} {limit.unit}"


TABLES: dict[str, Callable[[], str]] = {
    "limits": limits,
    "models": models,
    "models_of_the_readme": overview("docs/"),
    "models_of_the_index": overview(""),
    "styles": styles,
    "emotions": write_names("emotions"),
    "skeletons": write_names("skeletons"),
    "metrics": write_names("metrics"),
    "formats": formats,
}


def pages() -> dict[Path, str]:
    """Path → text of every page, as it should be."""
    texts = {ROOT / "docs" / "cli.md": cli_page(), PICTURE: architecture_svg(), NAVIGATION: navigation()}
    for path in [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]:
        if path not in texts:
            text = path.read_text("utf-8")
            text = BLOCK.sub(lambda match: match[1] + TABLES[match[2]]() + match[3], text)
            texts[path] = FILE.sub(lambda match: match[1] + (ROOT / match[2]).read_text("utf-8") + match[3], text)
    return texts


def navigation() -> str:
    """mkdocs.yml with a line for the page of each model, in the order of the registry; a page gives its own title."""
    names = (name.replace("-", "_") for name in ENTRIES if name != "rules")  # whose page stands apart
    lines = [f"      - models/{name}.md\n" for name in names if (ROOT / "docs" / "models" / f"{name}.md").is_file()]
    return NAV.sub(lambda match: match[1] + "".join(lines) + match[2], NAVIGATION.read_text("utf-8"))


def main() -> None:
    for path, text in pages().items():
        if not path.exists() or path.read_text("utf-8") != text:
            path.write_text(text, "utf-8")
            print(f"wrote {path.relative_to(ROOT)}")


if __name__ == "__main__":
    main()
