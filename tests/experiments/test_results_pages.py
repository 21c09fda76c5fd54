"""Pages of results: every table that is kept stands where its line is, and the overview counts what the verdicts say."""

from __future__ import annotations

import json
import re
import shutil
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import pytest

from cospeech.errors import InputError
from cospeech.experiments.tables import TABLES

ROOT = Path(__file__).resolve().parents[2]
INDEX = "# Results\n\n<!-- overview -->\n<!-- end of overview -->\n<!-- decided -->\n<!-- end of decided -->\n"
INDEX += "<!-- decided earlier -->\n<!-- end of decided earlier -->\nby hand\n"
FRESH, FIRST, STYLES = "mix-1-pats-fresh", "mix-1-pats-extended", "mix-3-pats"


def load_tool():
    spec = spec_from_file_location("write_tables", ROOT / "tools" / "write_tables.py")
    tool = module_from_spec(spec)
    spec.loader.exec_module(tool)
    return tool


@pytest.fixture
def tool(tmp_path, monkeypatch):
    """The tool, on a folder of its own with three tables that are kept and no page of a paper."""
    tool = load_tool()
    monkeypatch.setattr(tool, "ROOT", tmp_path)
    monkeypatch.setattr(tool, "KEPT", tmp_path / "kept")
    monkeypatch.setattr(tool, "DOCS", tmp_path / "docs")
    for folder in ("kept", "docs/results", "docs/media"):
        (tmp_path / folder).mkdir(parents=True)
    for name in (FRESH, FIRST, STYLES):
        shutil.copyfile(ROOT / "benchmarks" / "tables" / f"{name}.json", tmp_path / "kept" / f"{name}.json")
    (tmp_path / "docs" / "results.md").write_text(INDEX)
    return tool


def write_page(tool, *lines: str) -> Path:
    """A page of the paper; names of tables become the lines that show them."""
    page = tool.DOCS / "results" / "mix.md"
    page.write_text("\n".join(f"<!-- table: {line} -->" if "pats" in line else line for line in lines) + "\n")
    return page


def overview_of(tool) -> dict[str, list[str]]:
    """Table → its four verdicts and what was not run."""
    rows = re.findall(
        r"^\| (?:\[([\w-]+)\]\S+|\*\*(all)\*\*) \|.*?\|.*?\| (.*) \|.*?\|$", (tool.DOCS / "results.md").read_text(), re.M
    )
    return {name or total: verdicts.replace("*", "").split(" | ") for name, total, verdicts in rows}


def test_the_pages_are_what_the_tool_writes():
    assert [path.name for path in load_tool().stale()] == [], "run tools/write_tables.py"
    how = (ROOT / "docs" / "tables.md").read_text("utf-8")
    assert all(f"| `{name}` |" in how for name in TABLES)


def test_links_of_the_overview_lead_to_headings():
    links = re.findall(r"\]\(results/(\w+\.md)#([\w-]+)\)", (ROOT / "docs" / "results.md").read_text("utf-8"))
    assert len(links) > len(TABLES)
    for page, anchor in set(links):
        headings = re.findall(r"^##+ (.*)$", (ROOT / "docs" / "results" / page).read_text("utf-8"), re.M)
        slugs = [re.sub(r"[^\w-]", "", heading.lower().replace(" ", "-")) for heading in headings]
        assert slugs.count(anchor) == 1, f"{page}#{anchor}"


def test_a_heading_that_occurs_twice_is_told(tool):
    write_page(tool, "## mix-1", FRESH, "## mix-1", FIRST, "## mix-3", STYLES)
    with pytest.raises(InputError, match=r"mix\.md has the heading '## mix-1' 2 times"):
        tool.stale()


def test_one_line_shows_a_table_and_text_by_hand_stays(tool):
    page = write_page(tool, "## mix-1", "before", FRESH, "after", FIRST, "## mix-3", STYLES, "the end")
    tool.main([])
    text = page.read_text()
    assert text.count("\n### mix-1 on PATS: 2.71 h, seeds 5 to 12\n") == 1
    assert text.index("before") < text.index("seeds 5 to 12\n") < text.index("| StAGE, 8 speakers |") < text.index("\nafter\n")
    assert text.endswith("the end\n")
    page.write_text(text.replace("seeds 5 to 12\n", "another title\n\nwhy it was made\n", 1))
    tool.main([])
    assert page.read_text() == text.replace("seeds 5 to 12\n", "seeds 5 to 12\n\nwhy it was made\n", 1)
    assert tool.stale() == {}
    assert (tool.DOCS / "results.md").read_text().endswith("by hand\n")


def test_the_first_run_of_a_claim_counts_and_earlier_runs_do_not(tool):
    write_page(tool, "## mix-1", FRESH, FIRST, "## mix-3", STYLES)
    tool.main([])
    overview = overview_of(tool)
    assert overview["mix-1"] == ["0", "0", "0", "1", "4"]  # of the fresh seeds; in the first ones it is undecided
    assert overview["mix-3"] == ["2", "0", "1", "0", "0"]
    write_page(tool, "## mix-1", FIRST, FRESH, "## Earlier runs", STYLES)
    tool.main([])
    overview, index = overview_of(tool), (tool.DOCS / "results.md").read_text()
    assert overview["mix-1"] == ["0", "0", "1", "0", "4"]
    assert "mix-3" not in overview
    assert overview["all"][:4] == ["0", "0", "1", "0"]
    current, earlier = index.split("<!-- end of decided -->")
    assert "<!-- decided -->\n\nNone." in current
    assert earlier.count("* **holds**: ") == 2


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        (("## mix-1", FRESH, FIRST), rf"{STYLES}\.json .*0 have"),
        (("## mix-1", FRESH, FIRST, FIRST, "## mix-3", STYLES), rf"{FIRST}\.json .*2 have"),
        (
            ("## mix-1", FRESH, FIRST, "## mix-3", STYLES, "mix-9-pats"),
            r"mix-9-pats --> in mix\.md .*no benchmarks/tables/mix-9",
        ),
        (("## mix-1", FRESH, FIRST, STYLES), rf"{STYLES} --> in mix\.md .*below '## mix-3'"),
        (("## mix-1", FRESH, "<!-- figures -->", FIRST, "## mix-3", STYLES), rf"{FRESH} --> .*end of figures"),
    ],
    ids=["no place", "two places", "no table", "another section", "no end"],
)
def test_tables_and_places_that_do_not_go_together_are_named(tool, lines, message):
    write_page(tool, *lines)
    with pytest.raises(InputError, match=message):
        tool.pages()


def test_two_tables_have_two_titles(tool):
    shutil.copyfile(tool.KEPT / f"{STYLES}.json", tool.KEPT / "again-pats.json")
    write_page(tool, "## mix-1", FRESH, FIRST, "## mix-3", STYLES, "again-pats")
    with pytest.raises(InputError, match=r"mix-3-pats and again-pats .*'mix-3 on PATS: 2\.71 h, seeds 0 to 4'"):
        tool.pages()


def test_the_note_of_a_table_is_of_its_speakers():
    """Rows of mix-6 are alike on the paper's speakers and on the synthetic ones; its note names them."""
    tool = load_tool()
    table = json.loads((ROOT / "benchmarks" / "tables" / "mix-6-pats.json").read_text("utf-8"))
    assert "networks of ada, dan, ben, cleo;" in tool.judge_again(table)["note"]
