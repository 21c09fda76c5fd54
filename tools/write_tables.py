"""Results of tables into the documentation, no figure by hand: ``python tools/write_tables.py FILE.json …``.

Each file is what ``cospeech evaluate --table NAME --out FILE.json`` wrote; it is kept in ``benchmarks/tables/``, and its
figure, where a PNG of the same name lies beside it, in ``docs/media/``. Without files the pages are written anew from what is
kept. ``--check`` writes nothing, and names the pages that are not as they would be written.

A table stands where a page in ``docs/results/`` has the line ``<!-- table: NAME -->``; NAME is that of the file, without
``.json``. Where two tables would have the same heading, ``<!-- table: NAME, WORDS -->`` adds words to one. The tool writes
heading and figures there. Text between the heading and ``<!-- figures -->`` is by hand, and stays.
Tables below the heading "Earlier runs" are not current. ``docs/results.md`` gets the overview and the decided claims.

``python tools/write_tables.py --join OUT.json PART.json …`` makes one table of parts: the same rows on the same corpus with
other seeds, made on several machines or one after the other. It writes nothing else; parts are kept in
``benchmarks/tables/parts/``.
"""

from __future__ import annotations

import json
import re
import shutil
import sys
from collections import Counter
from pathlib import Path
from typing import Any, NamedTuple

from cospeech.errors import InputError
from cospeech.experiments.tables import TABLES
from cospeech.experiments.tables.paper_tables import TableSplit
from cospeech.experiments.tables.report import summary, to_markdown
from cospeech.experiments.tables.verdicts import CONTRADICTED, HOLDS, WORDS, Evidence, below, judge
from cospeech.files import atomic

ROOT = Path(__file__).resolve().parents[1]
KEPT, DOCS = ROOT / "benchmarks" / "tables", ROOT / "docs"
NUMBERS = re.compile(r"\[[-+.\deE,\s]+\]")  # a list of numbers alone: it is kept in one line
MARK = re.compile(r"^(?:## (.+)|<!-- table: ([^\s,]+)(?:, (.+))? -->)$", re.M)  # a section, or a place for a table
PIECE = re.compile(r"(<!-- table: ([^\s,]+)(?:, [^\n]+)? -->)\n?(.*?)(?=<!-- table: |\Z)", re.S)
BLOCK = re.compile(r"(<!-- (overview|decided|decided earlier) -->\n).*?(<!-- end of \2 -->)", re.S)
HEADING = re.compile(r"\A\s*### .*\n")
HEADINGS = re.compile(r"^##+ .+$", re.M)
FIGURES, END, EARLIER = "<!-- figures -->", "<!-- end of figures -->", "Earlier runs"
CORPORA = {"ted": "TED", "trinity": "Trinity", "beat": "BEAT", "pats": "PATS"}
DECIDED = (HOLDS, CONTRADICTED)
NOT_RUN = "not run"
COUNTS = (*WORDS, NOT_RUN)  # what the overview counts


def judge_again(table: dict[str, Any]) -> dict[str, Any]:
    """Verdicts and note of a table that is kept, by the code of today; of figures with each seed, and of draws of clips."""
    part = find_part(table)
    rows = {name: of_seeds(row["cells"], len(table["seeds"])) for name, row in table["rows"].items() if row.get("cells")}
    controls = {
        name: {metric: {"value": cell["mean"]} for metric, cell in cells.items() if "mean" in cell}
        for name, cells in table["controls"].items()
    }
    evidence = Evidence(rows, controls, table["columns"], table["faults"], table.get("leak", ""))
    return {"note": part.note, "verdicts": judge(part.claims, evidence), "below": below(part.claims, evidence)}


def find_part(table: dict[str, Any]) -> TableSplit:
    """The part of the paper's table that a kept table is of: that with most of its rows, and where several have, its note."""
    parts = [part for part in TABLES[table["table"]].parts if part.corpus == table["corpus"]]
    return max(
        parts, key=lambda part: (len({row.name for row in part.rows} & {*table["rows"]}), part.note == table.get("note", ""))
    )


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
        for name, cells in runs.items():
            cells += of_seeds(part["rows"][name]["cells"], len(part["seeds"]))
    rows = {
        name: row | ({"cells": {metric: summary(runs[name], metric) for metric in first["columns"]}} if name in runs else {})
        for name, row in first["rows"].items()
    }
    head = re.sub(r"seeds? [\d, ]+", f"seeds {', '.join(map(str, seeds))}", first["head"])
    table = first | {"seeds": seeds, "rows": rows, "head": head}
    return table | judge_again(table)


# pages --------------------------------------------------------------------------------------------------------------------


class Shown(NamedTuple):
    """A table on the page that shows it.

    Args:
        name: of its file.
        page: name of the page.
        section: the heading above it.
        table: with today's verdicts.
        words: the end of its heading.
    """

    name: str
    page: str
    section: str
    table: dict[str, Any]
    words: str = ""

    @property
    def title(self) -> str:
        """Text of its heading; no two tables have the same."""
        hours = re.findall(r"[\d.]+ h(?= for training)", self.table["head"])[:1]
        what = ", ".join(filter(None, [*hours, say_seeds(self.table["seeds"]), self.words]))
        return f"{self.table['table']} on {CORPORA[self.table['corpus']]}: {what}"

    @property
    def link(self) -> str:
        """Link to its heading from the page of all results."""
        anchor = re.sub(r"[-\s]+", "-", re.sub(r"[^a-z0-9\s-]", "", self.title.lower()))
        return f"results/{self.page}#{anchor}"


def say_seeds(seeds: list[int]) -> str:
    """Seeds in words."""
    if len(seeds) > 2 and seeds == [*range(seeds[0], seeds[-1] + 1)]:
        return f"seeds {seeds[0]} to {seeds[-1]}"
    return f"seed{'s' * (len(seeds) > 1)} {', '.join(map(str, seeds))}"


def find_shown() -> list[Shown]:
    """All tables that are kept, in the order of the pages that show them.

    Raises:
        InputError: a table has no place or two, a place has no table or is in the wrong section, or two titles are the same.
    """
    tables = {path.stem: json.loads(path.read_text("utf-8")) for path in sorted(KEPT.glob("*.json"))}
    entries: list[Shown] = []
    for path in sorted((DOCS / "results").glob("*.md")):
        section = ""
        for heading, name, words in MARK.findall(path.read_text("utf-8")):
            section = heading or section
            if name and name not in tables:
                raise InputError(f"<!-- table: {name} --> in {path.name}", f"there is no benchmarks/tables/{name}.json")
            if name and section not in (tables[name]["table"], EARLIER):
                raise InputError(f"<!-- table: {name} --> in {path.name}", f"move it below '## {tables[name]['table']}'")
            if name:
                entries.append(Shown(name, path.name, section, tables[name] | judge_again(tables[name]), words))
    places = Counter(each.name for each in entries)
    for name in tables:
        if places[name] != 1:
            do = f"one page in docs/results/ must have the line <!-- table: {name} -->; {places[name]} have"
            raise InputError(f"benchmarks/tables/{name}.json", do)
    titles: dict[str, str] = {}
    for each in entries:
        other = titles.setdefault(each.title, each.name)
        if other != each.name:
            raise InputError(f"{other} and {each.name}", f"both would be called {each.title!r}")
    return entries


def fill(text: str, entries: dict[str, Shown]) -> str:
    """Write the tables of a page into its text."""

    def write_piece(match: re.Match[str]) -> str:
        place, name, content = match.groups()
        head, mark, after = content.partition(FIGURES)
        words = HEADING.sub("", head).strip() if mark else ""
        _, end, rest = after.partition(END)
        if mark and not end:
            raise InputError(place, f"{END} is missing")
        each = entries[name]
        lines = [f"{place}\n\n### {each.title}\n", *([f"{words}\n"] if words else []), f"{FIGURES}\n"]
        lines.append(to_markdown(each.table).partition("\n\n")[2])
        if (DOCS / "media" / f"{each.name}.png").is_file():
            lines.append(f"![{TABLES[each.table['table']].shown}](../media/{each.name}.png)\n")
        return "\n".join([*lines, END]) + (rest if mark else f"\n{content}")

    return PIECE.sub(write_piece, text)


def find_verdicts(runs: list[Shown]) -> dict[str, tuple[Shown, dict[str, Any]]]:
    """Claim → the run that judges it, and the verdict; where several runs judge it, the first one."""
    verdicts: dict[str, tuple[Shown, dict[str, Any]]] = {}
    for run in runs:
        for verdict in run.table["verdicts"]:
            verdicts.setdefault(verdict["claim"], (run, verdict))
    return verdicts


def current_runs(entries: list[Shown]) -> dict[tuple[str, str], list[Shown]]:
    """(table, corpus) → its current runs, in the order of the papers."""
    runs: dict[tuple[str, str], list[Shown]] = {(name, part.corpus): [] for name in TABLES for part in TABLES[name].parts}
    for each in entries:
        if each.section != EARLIER:
            runs[each.table["table"], each.table["corpus"]].append(each)
    return runs


def overview(entries: list[Shown]) -> str:
    """How many claims of each table got which verdict."""
    lines = [
        "| table | of | corpus | " + " | ".join(COUNTS) + " | current runs |",
        "|---|---|---|" + "---:|" * len(COUNTS) + "---|",
    ]
    totals: Counter[str] = Counter()
    for (name, corpus), runs in current_runs(entries).items():
        authors, _, what = TABLES[name].title.partition(",")
        counts = Counter(verdict["verdict"] for _, verdict in find_verdicts(runs).values())
        part = find_part(runs[0].table) if runs else next(p for p in TABLES[name].parts if p.corpus == corpus)
        counts[NOT_RUN] = len(part.claims) - counts.total()
        totals += counts
        where = f"[{name}](results/{runs[0].page}#{name})" if runs else name
        links = "; ".join(f"[{run.title.partition(': ')[2]}]({run.link})" for run in runs)
        lines.append(row([where, f"{authors}: {what.rpartition(': ')[2]}", CORPORA[corpus]], counts, links))
    return "\n".join([*lines, row(["**all**", "", ""], totals, "")]) + "\n"


def row(heads: list[str], counts: Counter[str], links: str) -> str:
    """A row of the overview; decided verdicts are in bold type."""
    cells = [f"**{counts[word]}**" if counts[word] and word in DECIDED else str(counts[word]) for word in COUNTS]
    return "| " + " | ".join([*heads, *cells, links]) + " |"


def list_decided(pairs: list[tuple[Shown, dict[str, Any]]]) -> str:
    """The claims that hold or are contradicted, a line each."""
    lines = [
        f"* **{verdict['verdict']}**: {verdict['claim']}"
        + (f" [expected: {verdict['expected']}]" if "expected" in verdict else "")
        + f": {verdict['because']} ([{run.title}]({run.link}))"
        for run, verdict in pairs
        if verdict["verdict"] in DECIDED
    ]
    return "\n".join(lines or ["None."]) + "\n"


def pages() -> dict[Path, str]:
    """Path → text of every page of results, as it should be.

    Raises:
        InputError: a page has a heading twice; or as `find_shown`.
    """
    entries = find_shown()
    earlier = [(each, verdict) for each in entries if each.section == EARLIER for verdict in each.table["verdicts"]]
    current = [pair for runs in current_runs(entries).values() for pair in find_verdicts(runs).values()]
    blocks = {"overview": overview(entries), "decided": list_decided(current), "decided earlier": list_decided(earlier)}
    index = DOCS / "results.md"
    text = BLOCK.sub(lambda match: f"{match[1]}\n{blocks[match[2]]}\n{match[3]}", index.read_text("utf-8"))
    by_name = {each.name: each for each in entries}
    texts = {index: text} | {path: fill(path.read_text("utf-8"), by_name) for path in sorted((DOCS / "results").glob("*.md"))}
    for path, each in texts.items():
        heading, times = Counter(HEADINGS.findall(each)).most_common(1)[0] if HEADINGS.search(each) else ("", 1)
        if times > 1:
            raise InputError(f"{path.name} has the heading {heading!r} {times} times", "each has its text below it, once")
    return texts


def stale() -> dict[Path, str]:
    """Path → text of the pages that are not as they should be."""
    return {path: text for path, text in pages().items() if path.read_text("utf-8") != text}


def main(files: list[Path]) -> None:
    KEPT.mkdir(exist_ok=True)
    for path in files:
        text = path.read_text("utf-8")
        json.loads(text)["rows"]  # it is a table
        write(KEPT / path.name, NUMBERS.sub(lambda match: " ".join(match[0].split()), text))
        picture = path.with_suffix(".png")
        if picture.is_file():
            shutil.copyfile(picture, DOCS / "media" / picture.name)
    for path, text in stale().items():
        write(path, text)
        print(f"wrote {path.relative_to(ROOT)}")


def write(path: Path, text: str) -> None:
    """Write a file, whole or not at all."""
    with atomic(path) as part:
        part.write_text(text, "utf-8", newline="\n")


if __name__ == "__main__":
    if {"-h", "--help"} & {*sys.argv[1:]}:
        print(__doc__)
    elif sys.argv[1:2] == ["--join"]:
        whole = join([json.loads(Path(name).read_text("utf-8")) for name in sys.argv[3:]])
        write(Path(sys.argv[2]), json.dumps(whole, indent=1, ensure_ascii=False) + "\n")
    elif sys.argv[1:] == ["--check"]:
        if wrong := [str(path.relative_to(ROOT)) for path in stale()]:
            sys.exit(f"not as python tools/write_tables.py writes them: {', '.join(wrong)}")
    else:
        main([Path(name) for name in sys.argv[1:]])
