"""Making a table: train the runs that are missing, score every row and seed, and put the paper's figures beside them."""

from __future__ import annotations

import json
import warnings
from collections.abc import Callable, Collection, Mapping, Sequence
from hashlib import blake2b
from itertools import count
from os import PathLike
from pathlib import Path
from typing import Any

from ...audio.features.reduce import preparation_option
from ...corpora.shared_speech import describe_shared_speech, measure_shared_speech
from ...corpora.store import Store
from ...errors import CospeechWarning, InputError, nearest, say_count
from ...files import atomic, check_destination, describe_os_error
from ...training.audio_source import with_audio
from .cog import COG
from .controls import check_oracle, oracle_key
from .figures import write_picture
from .flow import FLOW
from .mix import MIX
from .paper_tables import Bench, Cells, PaperTable, TableSplit, TableSystem, replace_minus
from .report import summary, to_markdown
from .runs import SHARED, Runs, make_folder
from .verdicts import Evidence, below, headroom, judge

__all__ = ["TABLES", "check_figure", "choose_rows", "draw_table", "make_table", "part_of", "write_table"]

TABLES: dict[str, PaperTable] = {**FLOW, **MIX, **COG}
"""Name after ``--table`` → the table."""

Tell = Callable[[str], None]


def part_of(name: str, store: Store) -> tuple[PaperTable, TableSplit]:
    """A table, and its part for a store.

    Raises:
        InputError: no such table, or none for the corpus or the speakers of the store.
    """
    if name not in TABLES:
        raise InputError(f"no table is called {name!r}", nearest(name, TABLES))
    paper_table = TABLES[name]
    part = next((part for part in paper_table.parts if part.fits(store)), None)
    if part is not None:
        return paper_table, part
    near = [part for part in paper_table.parts if part.corpus == store.corpus]
    if not near:
        corpora = dict.fromkeys(part.corpus for part in paper_table.parts)
        raise InputError(f"table {name} of a store of {store.corpus!r}", f"it is of {' and '.join(corpora)}")
    lacking = min(([s for s in part.speakers if s not in store.speakers] for part in near), key=len)
    raise InputError(
        f"table {name} of a store without the speaker {lacking[0]!r}",
        f"it is of {' or of '.join(', '.join(part.speakers) for part in near)}; docs/tables.md says how such a store is made",
    )


def _row(
    row: TableSystem, bench: Bench, paper_table: PaperTable, runs: Runs, seeds: Sequence[int], tell: Tell, step: str
) -> tuple[dict[str, Any], list[Cells]]:
    """A row of the table, and its scores with each seed; without scores, the published figures alone."""
    entry: dict[str, Any] = {"recipe": row.recipe, "published": dict(row.published)}
    if row.recipe is None:
        return entry, []
    if not (Path(runs.recipes) / f"{row.recipe}.toml").is_file():
        return entry | {"missing": f"no recipe {row.recipe}.toml"}, []
    store, audio = runs.store, runs.recipe(row.recipe).data.audio
    option = "" if audio is None else preparation_option(audio)
    if option and with_audio(store, audio) is store:
        return entry | {"missing": f"the store was prepared without {option}"}, []
    scores, facts = [], ""
    for seed in seeds:
        tell(f"{step}: {row.name}, seed {seed}")
        cells, facts = bench.row(row, seed)
        scores.append(cells)
    return entry | {"cells": {metric: summary(scores, metric) for metric in paper_table.columns}, "facts": facts}, scores


def choose_rows(rows: Sequence[TableSystem], only: Sequence[str]) -> set[str]:
    """Names of the rows that are made: those that contain one of the texts, or all. A hyphen can stand for a minus.

    Raises:
        InputError: no row contains one of the texts.
    """
    names = {row.name: replace_minus(row.name) for row in rows}
    texts = [replace_minus(text) for text in only]
    for text, part in zip(texts, only, strict=True):
        if not any(text in name for name in names.values()):
            raise InputError(f"no row of the table is called {part!r}", nearest(part, names))
    return {row for row, name in names.items() if not texts or any(text in name for text in texts)}


def _check_changes(runs: Runs, rows: Sequence[TableSystem], names: Collection[str]) -> None:
    """Check, before training, that the table trains what each override changes.

    Raises:
        InputError: an override of another recipe, or one that its recipe cannot take.
    """
    there = [row for row in rows if row.recipe and (Path(runs.recipes) / f"{row.recipe}.toml").is_file()]
    common = [path.stem for path in Path(runs.recipes).glob(f"*_{runs.store.corpus}.toml") if path.stem.startswith(SHARED)]
    recipes = [*dict.fromkeys(row.recipe for row in there if row.recipe), *common]
    for text in runs.overrides:
        recipe, colon, _ = text.partition("=")[0].rpartition(":")
        if colon and recipe not in recipes:
            raise InputError(f"{text!r}: no row of this table has the recipe {recipe!r}", nearest(recipe, recipes))
        if recipe in common:
            runs.recipe(recipe)
    for row in there:
        if row.recipe and (not names or row.name in names):
            runs.recipe(row.recipe, 0, row.overrides)


def _head(runs: Runs, bench: Bench, seeds: Sequence[int], only: Sequence[str]) -> str:
    """The data, the scale and the settings of a table, in a line."""
    store = runs.store
    scale = (
        "SMALL SCALE (--small: narrow networks, few steps; not the paper's systems)" if runs.small else "the recipes' own scale"
    )
    more = f"; changed: {' '.join(runs.overrides)}" if runs.overrides else ""
    more += f"; only the rows of {', '.join(only)}, the others are the paper's figures alone" if only else ""
    what = f"{runs.about}, " if runs.about else ""
    hours = sum(clip.frames for clip in store.clips if clip.split == "train") / store.fps / 3600
    features = f"; features: {bench.features}" if bench.features else ""
    speakers, with_seeds = say_count(len(store.speakers), "speaker"), "seed" if len(seeds) == 1 else "seeds"
    return (
        f"Corpus: {what}store of {store.corpus!r} layout, {store.pose} at {store.fps:g} fps, {speakers}, {hours:.2f} h for "
        f"training; {scale}{more}; {bench.windows}; {with_seeds} {', '.join(map(str, seeds))}{features}"
    )


def _describe_origin(runs: Runs, bench: Bench, rows: Sequence[TableSystem], raw: str | PathLike[str] | None) -> dict[str, Any]:
    """What tells a table from others of its name, apart from the seeds: its store, the rows that are made, and the settings."""
    return {
        "store": runs.fingerprint,
        "rows": {row.name: runs.folder_of(row.recipe, 0, row.overrides).name for row in rows if row.recipe},
        "settings": [*runs.overrides, bench.features, *(["--raw"] if raw is not None else []), *oracle_key(runs.oracle)],
    }


def make_table(
    name: str,
    runs: Runs,
    *,
    raw: str | PathLike[str] | None = None,
    seeds: Sequence[int] = (0, 1, 2, 3, 4),
    only: Sequence[str] = (),
    trained: bool = True,
    tell: Tell,
) -> dict[str, Any]:
    """Make a table of `TABLES`, as a plain dictionary; `report.to_text` and `report.to_markdown` print it.

    Args:
        name: of the table.
        runs: the store, the folder of the runs, and their scale.
        raw: the corpus of the store, for metrics that hear.
        seeds: every row has one run with each of them.
        only: texts; rows whose names contain one of them are made, others have published figures alone; (): all are made.
        trained: whether rows are trained and scored; False: control rows alone, and what each metric can tell apart.
        tell: is told what is being done.

    Raises:
        InputError: no such table, a store that does not fit, a missing recipe, a run that cannot continue, or an oracle that is
            no store of the same clips.
    """
    paper_table, part = part_of(name, runs.store)
    if not seeds or min(seeds) < 0 or len(set(seeds)) < len(seeds):
        raise InputError(f"seeds {', '.join(map(str, seeds))}", "whole numbers, each once")
    if runs.oracle is not None:
        check_oracle(runs.store, Store(runs.oracle))
    names = choose_rows(part.rows, only) if trained else set()
    _check_changes(runs, part.rows, names)
    bench = paper_table.bench(paper_table, part, runs, raw)
    tell("control rows")
    controls = bench.controls()
    steps = count(1)
    rows: dict[str, dict[str, Any]] = {}
    scores: dict[str, list[Cells]] = {}
    for row in part.rows:
        if row.name in names:
            rows[row.name], scores[row.name] = _row(
                row, bench, paper_table, runs, seeds, tell, f"row {next(steps)} of {len(names)}"
            )
        else:
            rows[row.name] = {"recipe": row.recipe, "published": dict(row.published)}
    faults = bench.faults(controls)
    leak = "; ".join(describe_shared_speech({"test": measure_shared_speech(runs.store).get("test", 0.0)}))
    evidence = Evidence({name: cells for name, cells in scores.items() if cells}, controls, paper_table.columns, faults, leak)
    return {
        "table": name, "title": f"{name}: {paper_table.title} ({runs.store.corpus})", "columns": dict(paper_table.columns),
        "head": _head(runs, bench, seeds, only), "corpus": runs.store.corpus, "pose": runs.store.pose,
        "small": runs.small, "seeds": list(seeds), "note": part.note, "rows": rows, "leak": leak,
        "origin": _describe_origin(runs, bench, [row for row in part.rows if "cells" in rows[row.name]], raw),
        "controls": {row: {metric: summary([cells], metric, draws=False) for metric in paper_table.columns}
            for row, cells in controls.items()},
        "faults": faults, "headroom": {} if trained else headroom(evidence), "below": below(part.claims, evidence),
        "verdicts": judge(part.claims, evidence),
    }  # fmt: skip


def check_figure(path: str | PathLike[str]) -> None:
    """Check, before a figure is made, that it can be written.

    Raises:
        InputError: another suffix than ``.png``, or no file can be written there.
    """
    if Path(path).suffix.lower() != ".png":
        raise InputError(f"cannot draw {str(path)!r}", "name a file that ends in .png")
    check_destination(path)


def draw_table(
    table: Mapping[str, Any], runs: Runs, path: str | PathLike[str], *, raw: str | PathLike[str] | None = None
) -> None:
    """Draw the figure of a table as PNG: for each row, the run with the first seed.

    Raises:
        InputError: another suffix, or the picture cannot be written.
    """
    check_figure(path)
    paper_table, part = part_of(table["table"], runs.store)
    write_picture(paper_table.bench(paper_table, part, runs, raw).picture(table), path)


def _find_differences(path: Path, table: Mapping[str, Any]) -> list[str]:
    """What the table in a file has, in words, that a new table of the same name lacks; empty if it lacks nothing."""
    own = table["origin"]
    try:
        other = json.loads(path.read_text("utf-8"))
        old = other["origin"]
        if old["store"] != own["store"]:
            return ["another store"]
        differences = {
            "other rows or recipes": not old["rows"].items() <= own["rows"].items(),
            "other seeds": not {*other["seeds"]} <= {*table["seeds"]},
            "other settings": old["settings"] != own["settings"],
        }
    except (OSError, ValueError, LookupError, TypeError, AttributeError):  # no table, or one of an older version
        return ["an unknown store"]
    return [word for word, differs in differences.items() if differs]


def _keep_other(table: Mapping[str, Any], paths: Sequence[Path]) -> None:
    """Rename the files of another table where the new one takes their names; a warning says so.

    Raises:
        InputError: they cannot be renamed.
    """
    path = paths[0]
    there = [each for each in paths if each.is_file()]
    if not there or not (differences := _find_differences(path, table)):
        return
    try:
        digest = blake2b(there[0].read_bytes(), digest_size=4).hexdigest()  # ours: short, and some ten tables share a name
        for old in reversed(there):  # the JSON last: the table is found as long as it exists
            old.replace(old.with_name(f"{old.stem}-kept-{digest}{old.suffix}"))
    except OSError as error:
        hint = "move it elsewhere, or name another folder with --runs"
        raise InputError(f"{str(path)!r} holds another table and cannot be renamed: {describe_os_error(error)}", hint) from None
    name = f"{path.stem}-kept-{digest}{path.suffix}"
    what = f"{str(path)!r} held a table of {' and '.join(differences)}"
    warnings.warn(f"{what}; it is kept as {name!r}", CospeechWarning, stacklevel=3)


def write_table(table: Mapping[str, Any], folder: str | PathLike[str]) -> tuple[Path, Path]:
    """Write ``TABLE-POSE.json`` and ``.md`` to a folder, and return their paths.

    At the small scale, ``-small`` is added to the name; where not all rows are made, ``-part``. Files of that name that hold
    another table (of another store, or with rows, seeds or settings that this one lacks) are renamed to ``…-kept-DIGEST``, and
    a warning says so.

    Raises:
        InputError: the folder cannot be made, or files of another table cannot be renamed.
    """
    part = any(row["recipe"] and not row.keys() & {"cells", "missing"} for row in table["rows"].values())
    scale, share = "-small" if table["small"] else "", "-part" if part else ""
    stem = Path(folder) / f"{table['table']}-{table['pose']}{scale}{share}"
    make_folder(stem.parent)
    paths = (stem.with_suffix(".json"), stem.with_suffix(".md"))
    _keep_other(table, paths)
    for path, text in zip(paths, (json.dumps(table, indent=1, ensure_ascii=False) + "\n", to_markdown(table)), strict=True):
        with atomic(path) as temporary:
            temporary.write_text(text, "utf-8", newline="\n")
    return paths
