"""Results of tables into the documentation, no figure by hand: ``python tools/write_tables.py FILE.json …``.

``python tools/write_tables.py --join OUT.json PART.json …`` makes one table of parts: the same rows on the same corpus with
other seeds, made on several machines or one after the other. It writes nothing else; parts are kept in
``benchmarks/tables/parts/``.

Each file is what ``cospeech evaluate --table NAME --out FILE.json`` wrote; it is kept in ``benchmarks/tables/``, and its
figure, where a PNG of the same name lies beside it, in ``docs/media/``. Without files the page is written anew from what is
kept.
"""

from __future__ import annotations

import json
import re
import shutil
import sys
from pathlib import Path
from typing import Any

from cospeech.errors import InputError
from cospeech.experiments.tables import TABLES
from cospeech.experiments.tables.report import summary, to_markdown
from cospeech.experiments.tables.verdicts import Evidence, below, judge
from cospeech.files import atomic

ROOT = Path(__file__).resolve().parents[1]
KEPT, MEDIA, PAGE = ROOT / "benchmarks" / "tables", ROOT / "docs" / "media", ROOT / "docs" / "results.md"
NUMBERS = re.compile(r"\[[-+.\deE,\s]+\]")  # a list of numbers alone: it is kept in one line
BLOCK = re.compile(r"(<!-- results -->\n).*?(<!-- end of results -->)", re.S)


def judge_again(table: dict[str, Any]) -> dict[str, Any]:
    """Verdicts and note of a table that is kept, by the code of today; of figures with each seed, and of draws of clips."""
    parts = [part for part in TABLES[table["table"]].parts if part.corpus == table["corpus"]]
    part = max(parts, key=lambda part: len({row.name for row in part.rows} & {*table["rows"]}))
    rows = {name: of_seeds(row["cells"], len(table["seeds"])) for name, row in table["rows"].items() if row.get("cells")}
    controls = {
        name: {metric: {"value": cell["mean"]} for metric, cell in cells.items() if "mean" in cell}
        for name, cells in table["controls"].items()
    }
    evidence = Evidence(rows, controls, table["columns"], table["faults"], table.get("leak", ""))
    return {"note": part.note, "verdicts": judge(part.claims, evidence), "below": below(part.claims, evidence)}


def own(cell: dict[str, Any]) -> dict[str, Any]:
    """The control rows over the clips of a row alone, where a cell has them."""
    return {"controls": cell["controls"]} if "controls" in cell else {}


def of_seeds(cells: dict[str, Any], seeds: int) -> list[dict[str, Any]]:
    """Cells of a row with each seed, from those over all of them; the draws of clips are the means over seeds."""
    return [
        {
            metric: {"value": cell["values"][k], "draws": cell.get("draws", ()), "note": cell["note"], **own(cell)}
            if "values" in cell
            else {"why": cell["why"]}
            for metric, cell in cells.items()
        }
        for k in range(seeds)
    ]


def join(parts: list[dict[str, Any]]) -> dict[str, Any]:
    """One table of parts with other seeds.

    Raises:
        InputError: they are not of the same table, rows and corpus, or a seed is in two of them.
    """
    first, seeds = parts[0], [seed for part in parts for seed in part["seeds"]]
    if len(set(seeds)) < len(seeds):
        raise InputError(f"seeds {', '.join(map(str, seeds))}", "each part has its own")
    runs: dict[str, list[dict[str, Any]]] = {name: [] for name, row in first["rows"].items() if row.get("cells")}
    for part in parts:
        alike = all(part[key] == first[key] for key in ("table", "columns", "corpus", "pose", "small", "controls"))
        rows = {name: row["facts"] for name, row in part["rows"].items() if row.get("cells")}
        if not alike or rows != {name: first["rows"][name]["facts"] for name in runs}:
            raise InputError("parts of different tables, rows or corpora", "join what one plan made")
        for name, found in runs.items():
            found += of_seeds(part["rows"][name]["cells"], len(part["seeds"]))
    rows = {
        name: row | ({"cells": {metric: summary(runs[name], metric) for metric in first["columns"]}} if name in runs else {})
        for name, row in first["rows"].items()
    }
    head = re.sub(r"seeds? [\d, ]+", f"seeds {', '.join(map(str, seeds))}", first["head"])
    table = first | {"seeds": seeds, "rows": rows, "head": head}
    return table | judge_again(table)


def results() -> str:
    """The tables that are kept, as markdown."""
    parts = []
    for path in sorted(KEPT.glob("*.json")):
        table = json.loads(path.read_text("utf-8"))
        parts.append(to_markdown(table | judge_again(table)))
        if (MEDIA / f"{path.stem}.png").is_file():
            parts.append(f"![{TABLES[table['table']].shown}](media/{path.stem}.png)\n")
    return "\n".join(parts) if parts else "None yet.\n"


def page() -> str:
    """The page with its results."""
    text = PAGE.read_text("utf-8")
    return BLOCK.sub(lambda found: f"{found[1]}\n{results()}\n{found[2]}", text)


def main(files: list[Path]) -> None:
    KEPT.mkdir(exist_ok=True)
    for path in files:
        text = path.read_text("utf-8")
        json.loads(text)["rows"]  # it is a table
        write(KEPT / path.name, NUMBERS.sub(lambda found: " ".join(found[0].split()), text))
        picture = path.with_suffix(".png")
        if picture.is_file():
            shutil.copyfile(picture, MEDIA / picture.name)
    write(PAGE, page())


def write(path: Path, text: str) -> None:
    """A file, whole or not at all."""
    with atomic(path) as part:
        part.write_text(text, "utf-8")


if __name__ == "__main__":
    if sys.argv[1:2] == ["--join"]:
        whole = join([json.loads(Path(name).read_text("utf-8")) for name in sys.argv[3:]])
        write(Path(sys.argv[2]), json.dumps(whole, indent=1, ensure_ascii=False) + "\n")
    else:
        main([Path(name) for name in sys.argv[1:]])
