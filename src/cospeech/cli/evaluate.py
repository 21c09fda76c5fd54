"""``cospeech evaluate``: the command that sets motions against the recordings of a store. As light as `cli`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any

import typer
from typer import Argument, Option

from ..errors import InputError
from ..files import atomic

__all__ = ["register"]

Systems = Annotated[
    list[str] | None,
    Argument(
        metavar="[SYSTEM]...",
        help="A model, or FOLDER or NAME=FOLDER of motions: CLIP.bvh or CLIP.npz for every clip; more takes: CLIP.2.bvh.",
    ),
]
Store = Annotated[Path, Option("--corpus", "--store", metavar="STORE", help="Folder made by `cospeech prepare`.")]
Raw = Annotated[Path | None, Option("--raw", metavar="RAW", help="The corpus of the store, for models and metrics that hear.")]
Split = Annotated[str, Option("--split", metavar="NAME", help="train, validation, test or all.")]
Metrics = Annotated[str | None, Option("--metrics", metavar="LIST", help="Separated by commas; see `cospeech list metrics`.")]
Takes = Annotated[int, Option("--takes", metavar="NUMBER", help="Performances of a model, for metrics of variety.")]
Seed = Annotated[int, Option("--seed", metavar="NUMBER", help="Of a model's first performance.")]
Given = Annotated[int, Option("--seed-frames", metavar="NUMBER", help="First frames that were given to the systems.")]
Features = Annotated[
    Path | None,
    Option("--features", metavar="RUN", help="Network of FGD: the folder of a trained one (of the recipe fgd_ted)."),
]
Out = Annotated[Path | None, Option("--out", "-o", metavar="FILE", help="Write the table as JSON.")]
Json = Annotated[bool, Option("--json", help="Print the table as JSON.")]
Table = Annotated[
    str | None,
    Option("--table", metavar="NAME", help="Make a table of a paper again: flow-1, mix-1, cog-1 and so on; docs/tables.md."),
]
Seeds = Annotated[str, Option("--seeds", metavar="LIST", help="Of --table: one run of every row with each.")]
Rows = Annotated[
    list[str] | None, Option("--rows", metavar="TEXT", help="Of --table: make only rows whose names hold this; repeatable.")
]
Runs = Annotated[Path, Option("--runs", metavar="FOLDER", help="Of --table: where its runs lie, or are made, and its files.")]
Recipes = Annotated[
    Path | None, Option("--recipes", metavar="FOLDER", help="Of --table: recipes of your own, in place of those that ship.")
]
Small = Annotated[bool, Option("--small", help="Of --table: narrow networks and few steps, about two minutes a run.")]
Change = Annotated[list[str] | None, Option("--set", metavar="KEY=VALUE", help="Of --table: change every row's recipe.")]
Threads = Annotated[int, Option("--threads", metavar="NUMBER", min=0, help="Of --table: of PyTorch; 0: as many as it likes.")]
About = Annotated[
    str, Option("--about", metavar="TEXT", help="Of --table: what the store is, such as synthetic, for its head.")
]
Figure = Annotated[Path | None, Option("--figure", metavar="FILE", help="Of --table: draw its figure, a PNG.")]
Debug = Annotated[bool, Option("--debug", help="Show the traceback of an error.")]


def _parse_source(systems: list[str]) -> dict[str, str]:
    """Name → model or folder, of ``NAME=FOLDER`` or of a model or folder alone, which is its own name."""
    found: dict[str, str] = {}
    for system in systems:
        name, equals, folder = system.partition("=")
        name, folder = (name, folder) if equals else (Path(system).name, system)
        if not name or not folder or name in found:
            raise InputError(f"system {system!r}", "NAME=FOLDER, each name once")
        found[name] = folder
    return found


def _numbers(text: str) -> list[int]:
    """Whole numbers separated by commas."""
    try:
        return [int(part) for part in text.split(",")]
    except ValueError:
        raise InputError(f"--seeds {text!r}", "whole numbers separated by commas, such as 0,1,2") from None


def _table(
    name: str, store: Path, *, raw: Path | None, seeds: str, rows: list[str], runs: Path, recipes: Path | None, small: bool,
    changes: list[str], threads: int, about: str, figure: Path | None,
) -> dict[str, Any]:  # fmt: skip
    """Make a table of a paper, its files and its figure."""
    from ..experiments.tables import Runs, draw_table, make_table, write_table
    from ..training.recipe import SHIPPED

    def tell(text: str) -> None:
        typer.echo(text, err=True)

    table_runs = Runs(store, runs, SHIPPED if recipes is None else recipes, small, tuple(changes), threads, about, tell)
    table = make_table(name, table_runs, raw=raw, seeds=_numbers(seeds), only=rows, tell=tell)
    for path in write_table(table, runs):
        tell(f"wrote {path}")
    if figure is not None:
        draw_table(table, table_runs, figure, raw=raw)
        tell(f"wrote {figure}")
    return table


_OF_TABLES = frozenset({"seeds", "rows", "runs", "recipes", "small", "changes", "threads", "about", "figure"})
_OF_CONTESTS = frozenset({"metrics", "split", "takes", "seed", "seed_frames", "features"})


def _check_options(context: typer.Context, table: str | None) -> None:
    """No option is given that would change nothing.

    Raises:
        InputError: one is.
    """
    idle = _OF_TABLES if table is None else _OF_CONTESTS
    for option in context.command.params:
        if option.name in idle and str(context.get_parameter_source(option.name)).endswith("COMMANDLINE"):
            where = "without --table, whose it is" if table is None else "beside --table, which has its own"
            raise InputError(f"{option.opts[0]} {where}", "it would change nothing; leave it out")


def _show(data: str, text: str, out: Path | None, as_json: bool) -> None:
    """Print a table, and write it where that is wanted."""
    if out is not None:
        with atomic(out) as path:
            path.write_text(data + "\n", "utf-8")
    typer.echo(data if as_json else text)


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
        seed_frames: Given = 0,
        features: Features = None,
        table: Table = None,
        seeds: Seeds = "0,1,2",
        rows: Rows = None,
        runs: Runs = Path("runs/tables"),
        recipes: Recipes = None,
        small: Small = False,
        changes: Change = None,
        threads: Threads = 0,
        about: About = "",
        figure: Figure = None,
        out: Out = None,
        as_json: Json = False,
        debug: Debug = False,
    ) -> None:
        """Compare systems with recordings: a table of metrics.

        Beside them stand the ground truth and control rows, which a metric must put in order to be trusted.

        \b
        cospeech evaluate rules --corpus stores/beat --raw raw/beat --metrics fgd,beat_align
        cospeech evaluate mine=generated --corpus stores/beat --raw raw/beat
        cospeech evaluate --table flow-2 --store stores/ted --raw raw/ted --small
        """
        _check_options(context, table)
        if table is not None:
            if systems:
                raise InputError(f"system {systems[0]!r} in a table of a paper", "leave it out: the table has its own rows")
            from ..experiments.tables import to_text

            made = _table(
                table, corpus, raw=raw, seeds=seeds, rows=rows or [], runs=runs, recipes=recipes, small=small,
                changes=changes or [], threads=threads, about=about, figure=figure,
            )  # fmt: skip
            _show(json.dumps(made, indent=1, ensure_ascii=False), to_text(made), out, as_json)
            return
        from ..evaluation import evaluate_store
        from ..metrics.table import DEFAULT

        result = evaluate_store(
            _parse_source(systems or []), corpus, raw=raw, split=None if split == "all" else split, takes=takes, seed=seed,
            metrics=DEFAULT if metrics is None else [name.strip() for name in metrics.split(",") if name.strip()],
            seed_frames=seed_frames, features=features,
        )  # fmt: skip
        _show(result.to_json(), result.to_text(), out, as_json)
