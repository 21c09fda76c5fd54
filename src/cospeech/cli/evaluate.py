"""``cospeech evaluate``: it compares motions with the recordings of a store. Imports are late, as in `cli.main`."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Annotated

import typer
from typer import Argument, Option

from ..errors import InputError
from ..files import atomic, check_destination
from .options import Debug, check_idle

__all__ = ["register"]

Systems = Annotated[
    list[str] | None,
    Argument(
        metavar="SYSTEM",
        help="A model; or FOLDER or NAME=FOLDER with a motion for each clip, CLIP.bvh or CLIP.npz. Further takes: CLIP.2.bvh.",
    ),
]
Store = Annotated[Path, Option("--corpus", "--store", metavar="STORE", help="Folder made by `cospeech prepare`.")]
Raw = Annotated[
    Path | None,
    Option("--raw", metavar="RAW", help="Folder of the corpus. Models and some metrics need its sound."),
]
Split = Annotated[str, Option("--split", metavar="NAME", help="Split to evaluate on: train, validation, test or all.")]
Metrics = Annotated[
    str | None, Option("--metrics", metavar="LIST", help="Metrics, separated by commas; see `cospeech list metrics`.")
]
Takes = Annotated[int, Option("--takes", metavar="NUMBER", help="Takes of each model, for metrics of variety.")]
Seed = Annotated[int, Option("--seed", metavar="NUMBER", help="Seed of a model's first take.")]
SeedFrames = Annotated[
    int, Option("--seed-frames", metavar="NUMBER", min=0, help="Number of first frames that the systems were given.")
]
Features = Annotated[
    Path | None,
    Option("--features", metavar="RUN", help="Feature network of FGD: the folder of its run (recipe fgd_ted, for example)."),
]
HearingGain = Annotated[
    bool,
    Option("--hearing", help="Measure how well runs follow speech: loss with another window's speech minus loss with its own."),
]
Out = Annotated[
    Path | None,
    Option(
        "--out",
        "-o",
        metavar="FILE",
        help="Also write the table to this file: .json, .csv (a line for each score) or .tex (LaTeX, with the package "
        "booktabs). With --table and --hearing: .json.",
    ),
]
Json = Annotated[bool, Option("--json", help="Print the table as JSON.")]
Table = Annotated[
    str | None,
    Option("--table", metavar="NAME", help="Reproduce a table of a paper: flow-1, mix-1, cog-1 and so on; see docs/tables.md."),
]
Seeds = Annotated[
    str, Option("--seeds", metavar="LIST", help="With --table: seeds; each row has one run per seed. A verdict needs five.")
]
Rows = Annotated[
    list[str] | None,
    Option(
        "--rows", metavar="TEXT", help="With --table: make only rows whose names contain this. Repeat the option for several."
    ),
]
Runs = Annotated[Path, Option("--runs", metavar="FOLDER", help="With --table: folder of the runs and of the table's files.")]
Recipes = Annotated[
    Path | None, Option("--recipes", metavar="FOLDER", help="With --table: folder of recipes that replace those that ship.")
]
Oracle = Annotated[
    Path | None,
    Option(
        "--oracle",
        metavar="STORE",
        help="With --table: store of the same synthetic speech with other gestures (`synthesise --gestures 1`), a control row.",
    ),
]
Headroom = Annotated[
    bool,
    Option("--headroom", help="With --table: the control rows alone, and what each metric can tell apart; no row is trained."),
]
Small = Annotated[bool, Option("--small", help="With --table: narrow networks and few steps, about two minutes per run.")]
Change = Annotated[
    list[str] | None,
    Option(
        "--set",
        metavar="[RECIPE:]KEY=VALUE",
        help="With --table: change a key in the recipe of every row, or of one recipe. To change a network that rows share, "
        "such as fgd_beat, write its recipe before the key.",
    ),
]
Threads = Annotated[
    int, Option("--threads", metavar="NUMBER", min=0, help="With --table: threads of PyTorch. 0: PyTorch chooses.")
]
About = Annotated[
    str, Option("--about", metavar="TEXT", help="With --table: text for the head that describes the store, such as synthetic.")
]
Figure = Annotated[Path | None, Option("--figure", metavar="FILE", help="With --table: draw its figure into this PNG.")]


def _parse_source(systems: list[str]) -> dict[str, str]:
    """Name → model or folder, from ``NAME=FOLDER``. A model or a folder alone is its own name."""
    sources: dict[str, str] = {}
    for system in systems:
        name, equals, folder = system.partition("=")
        name, folder = (name, folder) if equals else (Path(system).name, system)
        if not name or not folder or name in sources:
            raise InputError(f"system {system!r}", "NAME=FOLDER, each name once")
        sources[name] = folder
    return sources


def _numbers(text: str) -> list[int]:
    """Whole numbers separated by commas."""
    try:
        return [int(part) for part in text.split(",")]
    except ValueError:
        raise InputError(f"--seeds {text!r}", "whole numbers separated by commas, such as 0,1,2,3,4") from None


def _table(
    name: str, store: Path, out: Path | None, as_json: bool, *, raw: Path | None, seeds: str, rows: list[str], runs: Path,
    recipes: Path | None, small: bool, changes: list[str], threads: int, oracle: Path | None, headroom: bool, about: str,
    figure: Path | None,
) -> None:  # fmt: skip
    """Make a table of a paper, its files and its figure, and print it."""
    from ..experiments.tables import Runs, check_figure, draw_table, make_table, to_text, write_table
    from ..training.recipe import SHIPPED

    if figure is not None:
        check_figure(figure)

    def tell(text: str) -> None:
        typer.echo(text, err=True)

    table_runs = Runs(store, runs, SHIPPED if recipes is None else recipes, small, tuple(changes), threads, oracle, about, tell)
    table = make_table(name, table_runs, raw=raw, seeds=_numbers(seeds), only=rows, trained=not headroom, tell=tell)
    for path in () if headroom else write_table(table, runs):
        tell(f"wrote {path}")
    if figure is not None:
        draw_table(table, table_runs, figure, raw=raw)
        tell(f"wrote {figure}")
    _show({".json": lambda: json.dumps(table, indent=1, ensure_ascii=False)}, to_text(table), out, as_json)


def _hearing(systems: Mapping[str, str], store: Path, split: str, out: Path | None, as_json: bool) -> None:
    """Measure the hearing gain of runs, and print it."""
    from ..experiments.hearing import describe_hearing, measure_hearing

    if not systems:
        raise InputError("--hearing without a run", "name the folders of some runs")
    results = {name: measure_hearing(folder, store, split=split) for name, folder in systems.items()}
    rows = {name: [each._asdict() for each in terms] for name, terms in results.items()}
    _show({".json": lambda: json.dumps(rows, indent=1)}, describe_hearing(results), out, as_json)


def _names(metrics: str | None) -> list[str]:
    """Names separated by commas; for None, the default ones."""
    from ..metrics.table import DEFAULT

    return [*DEFAULT] if metrics is None else [name.strip() for name in metrics.split(",") if name.strip()]


_OF_TABLES = frozenset(
    {"seeds", "rows", "runs", "recipes", "small", "changes", "threads", "oracle", "headroom", "about", "figure"}
)
_OF_SCORES = frozenset({"metrics", "takes", "seed", "seed_frames", "features"})
_OF_CONTESTS = _OF_SCORES | {"hearing", "split"}


def _check_options(context: typer.Context, table: str | None, systems: list[str], *, headroom: bool, hearing: bool) -> None:
    """Check that each option that is given changes something, and that no system is given beside a table.

    Raises:
        InputError: an option changes nothing, or there is such a system.
    """
    if table is not None and systems:
        raise InputError(f"system {systems[0]!r} beside --table", "leave it out: the table has its own rows")
    if table is None:
        check_idle(context, _OF_TABLES, "without --table, to which it belongs")
        if hearing:
            check_idle(context, _OF_SCORES | {"raw"}, "beside --hearing, which measures losses on the windows of the store")
    else:
        check_idle(context, _OF_CONTESTS, "beside --table, which sets this itself")
        if headroom:
            check_idle(context, ("figure",), "beside --headroom, which makes no row")


def _check_out(out: Path, has_scores: bool) -> None:
    """Check that the file for the table can be written, and that this table has the format of its suffix.

    Raises:
        InputError: it cannot be written, or the table has no such format.
    """
    check_destination(out)
    suffixes = (".json", ".csv", ".tex") if has_scores else (".json",)
    if out.suffix.lower() not in suffixes:
        raise InputError(f"a table as {out.suffix or 'a file without suffix'}", f"known: {' '.join(suffixes)}")


def _show(files: Mapping[str, Callable[[], str]], text: str, out: Path | None, as_json: bool) -> None:
    """Print a table, and write it to ``out``, if any; ``files``: suffix → function that makes the text of the file."""
    typer.echo(files[".json"]() if as_json else text)  # print first: the table is not lost if the file cannot be written
    if out is not None:
        with atomic(out) as path:
            path.write_text(files[out.suffix.lower()]() + "\n", "utf-8", newline="\n")


def register(app: typer.Typer) -> None:
    """Add the command to ``app``."""

    @app.command()
    def evaluate(
        context: typer.Context,
        systems: Systems = None,
        *,
        corpus: Store,
        raw: Raw = None,
        metrics: Metrics = None,
        split: Split = "test",
        takes: Takes = 1,
        seed: Seed = 0,
        seed_frames: SeedFrames = 0,
        features: Features = None,
        hearing: HearingGain = False,
        table: Table = None,
        seeds: Seeds = "0,1,2,3,4",
        rows: Rows = None,
        runs: Runs = Path("runs/tables"),
        recipes: Recipes = None,
        small: Small = False,
        changes: Change = None,
        threads: Threads = 0,
        oracle: Oracle = None,
        headroom: Headroom = False,
        about: About = "",
        figure: Figure = None,
        out: Out = None,
        as_json: Json = False,
        debug: Debug = False,
    ) -> None:
        """Compare systems with recordings in a table of metrics.

        The table also has the ground truth and control rows. Do not trust a metric that puts these in the wrong order.

        \b
        cospeech evaluate rules --corpus stores/beat --raw raw/beat --metrics fgd,beat_align
        cospeech evaluate mine=generated --corpus stores/beat --raw raw/beat -o table.tex
        cospeech evaluate --table flow-2 --store stores/ted --raw raw/ted --small
        """
        _check_options(context, table, systems or [], headroom=headroom, hearing=hearing)
        if out is not None:
            _check_out(out, has_scores=table is None and not hearing)
        if table is not None:
            _table(
                table, corpus, out, as_json, raw=raw, seeds=seeds, rows=rows or [], runs=runs, recipes=recipes, small=small,
                changes=changes or [], threads=threads, oracle=oracle, headroom=headroom, about=about, figure=figure,
            )  # fmt: skip
            return
        if hearing:
            _hearing(_parse_source(systems or []), corpus, split, out, as_json)
            return
        from ..evaluation import evaluate_store

        result = evaluate_store(
            _parse_source(systems or []), corpus, raw=raw, split=split, takes=takes, seed=seed,
            metrics=_names(metrics), seed_frames=seed_frames, features=features,
        )  # fmt: skip
        _show({".json": result.to_json, ".csv": result.to_csv, ".tex": result.to_latex}, result.to_text(), out, as_json)
