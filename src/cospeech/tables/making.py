"""Making a table: train what is not trained yet, score every row and seed, and put the paper's figures beside them."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import count
from os import PathLike
from pathlib import Path
from typing import Any

from ..errors import InputError, nearest
from ..files import atomic
from ..metrics import Score, Tools, load_metric
from ..metrics.controls import faults_of_order
from .designs import TABLES, Design, Part, Row
from .excerpts import Excerpts
from .figures import draw_latents, draw_poses, write_picture
from .report import summary, to_markdown, verdicts
from .scores import Cells, controls_of_latents, judge, judge_latents, kept, latents, score
from .stages import Player, Stages, make_folder

__all__ = ["draw_table", "make_table", "part_of", "write_table"]

Tell = Callable[[str], None]


def part_of(name: str, corpus: str) -> tuple[Design, Part]:
    """A table and what it is on a corpus.

    Raises:
        InputError: no such table, or not of that corpus.
    """
    if name not in TABLES:
        raise InputError(f"no table is called {name!r}", nearest(name, TABLES))
    design = TABLES[name]
    if corpus not in design.parts:
        raise InputError(f"table {name} of a store of {corpus!r}", f"it is of {' and '.join(design.parts)}")
    return design, design.parts[corpus]


@dataclass(frozen=True)
class _Judge:
    """How rows of one table are scored, and where scores are kept."""

    design: Design
    excerpts: Excerpts
    stages: Stages
    tools: Tools

    @property
    def columns(self) -> tuple[str, ...]:
        return tuple(self.design.columns)

    def _key(self, *parts: object) -> list[object]:
        name = self.tools.features.name if self.tools.features is not None else "latents"
        place = self.stages.mark
        return [self.design.name, place, self.excerpts.protocol, self.columns, name, self.excerpts.raw is not None, *parts]

    def _kept(self, key: Sequence[object], work: Callable[[], Any]) -> Any:
        return kept(Path(self.stages.runs) / "scores", self._key(*key), work)

    def row(self, player: Player, seed: int) -> Cells:
        """Scores of a system with one seed."""
        if self.design.figure == "map":
            return self._kept(
                [player.print], lambda: judge_latents(self.columns, latents(player, self.excerpts), self.excerpts, "latents")
            )  # type: ignore[no-any-return]
        return self._kept(  # type: ignore[no-any-return]
            [player.print, seed],
            lambda: score(self.columns, player, self.excerpts, self.tools, seed=seed, threads=self.stages.threads),
        )

    def controls(self) -> dict[str, Cells]:
        """Scores of the control rows."""

        def work() -> dict[str, Cells]:
            if self.design.figure == "map":
                points = controls_of_latents(self.excerpts)
                return {name: judge_latents(self.columns, p, self.excerpts, name) for name, p in points.items()}
            rows = self.excerpts.controls()
            return {name: judge(self.columns, samples, samples, self.excerpts, self.tools) for name, samples in rows.items()}

        return self._kept(["controls"], work)  # type: ignore[no-any-return]


def _facts(player: Player) -> str:
    """What a row was trained with, in a line."""
    config, train = player.facts["config"], player.facts["recipe"]["train"]
    parameters = sum(p.numel() for p in player.net.parameters())
    return (
        f"{train['steps']} steps of {train['batch']} windows, K {config['steps']}, {config['hidden']} units, "
        f"{parameters:,} parameters"
    )


def _row(row: Row, judging: _Judge, seeds: Sequence[int], tell: Tell, step: str) -> dict[str, Any]:
    """A row of the table: scores of all seeds, or the published figures alone."""
    told: dict[str, Any] = {"recipe": row.recipe, "published": dict(row.published)}
    if row.recipe is None:
        return told
    if not (Path(judging.stages.recipes) / f"{row.recipe}.toml").is_file():
        return told | {"missing": f"no recipe {row.recipe}.toml"}
    runs, facts = [], ""
    for seed in seeds:
        tell(f"{step}: {row.name}, seed {seed}")
        player = judging.stages.player(row.recipe, seed)
        runs.append(judging.row(player, seed))
        facts = _facts(player)
    return told | {"cells": {metric: summary(runs, metric) for metric in judging.columns}, "facts": facts}


def _faults(controls: Mapping[str, Cells], columns: Sequence[str]) -> dict[str, list[str]]:
    """What each metric puts in the wrong order among the control rows."""
    found = {}
    for metric in columns:
        scores: dict[str, Score | None] = {
            name: Score(cells[metric]["value"], tuple(ends) if (ends := cells[metric]["interval"]) else None)
            if "value" in cells[metric] else None
            for name, cells in controls.items()
        }  # fmt: skip
        found[metric] = faults_of_order(load_metric(metric).about, scores)
    return found


def _head(stages: Stages, excerpts: Excerpts, seeds: Sequence[int], features: str) -> str:
    """Of what and with what the table was made, in a line."""
    store = excerpts.store
    scale = (
        "SMALL SCALE (--small: narrow networks, few steps; not the paper's systems)"
        if stages.small
        else "the recipes' own scale"
    )
    more = f"; changed: {' '.join(stages.overrides)}" if stages.overrides else ""
    taken = f"{len(excerpts)}" + (f" of {excerpts.total}" if excerpts.total > len(excerpts) else "")
    what = f"{stages.about}, " if stages.about else ""
    return (
        f"Corpus: {what}store of {store.corpus!r} layout, {store.pose} at {store.fps:g} fps, {len(store.speakers)} speakers, "
        f"{excerpts.hours:.2f} h for training; {scale}{more}; {taken} test windows of {excerpts.protocol.made} frames; "
        f"seeds {', '.join(map(str, seeds))}; features: {features}"
    )


def make_table(
    name: str, stages: Stages, *, raw: str | PathLike[str] | None = None, seeds: Sequence[int] = (0, 1, 2), tell: Tell
) -> dict[str, Any]:
    """A table of `cospeech.tables.designs.TABLES`, as a plain dictionary; `report.to_text` and so on tell it.

    Args:
        name: of the table.
        stages: the store, where runs lie, and at what scale.
        raw: the corpus of the store, for metrics that hear.
        seeds: one run of every row with each.
        tell: told what is being done.

    Raises:
        InputError: no such table, a store that does not fit, a recipe that is not there, or a run that cannot be gone on with.
    """
    design, part = part_of(name, stages.store.corpus)
    if not seeds or min(seeds) < 0 or len(set(seeds)) < len(seeds):
        raise InputError(f"seeds {', '.join(map(str, seeds))}", "whole numbers, each once")
    excerpts = Excerpts(stages.folder, raw)
    tools = Tools() if design.figure == "map" else Tools(features=stages.features())
    judging = _Judge(design, excerpts, stages, tools)
    tell("control rows")
    controls = judging.controls()
    steps, total = count(1), len(part.rows)
    rows = {row.name: _row(row, judging, seeds, tell, f"row {next(steps)} of {total}") for row in part.rows}
    features = tools.features.name if tools.features is not None else "latents, mean over the frames made"
    return {
        "table": name, "title": f"{name}: {design.title} ({stages.store.corpus})", "columns": dict(design.columns),
        "head": _head(stages, excerpts, seeds, features), "corpus": stages.store.corpus, "pose": stages.store.pose,
        "small": stages.small, "seeds": list(seeds), "note": part.note, "rows": rows,
        "controls": {row: {metric: summary([cells], metric) for metric in design.columns} for row, cells in controls.items()},
        "faults": {} if design.figure == "map" else _faults(controls, judging.columns),
        "verdicts": verdicts(design, part, rows),
    }  # fmt: skip


def draw_table(
    table: Mapping[str, Any], stages: Stages, path: str | PathLike[str], *, raw: str | PathLike[str] | None = None
) -> None:
    """The figure of a table that was made, as PNG: of each row the run with the first seed.

    Raises:
        InputError: another suffix, or the picture cannot be written.
    """
    if Path(path).suffix.lower() != ".png":
        raise InputError(f"cannot draw {str(path)!r}", "name a file that ends in .png")
    design, excerpts = TABLES[table["table"]], Excerpts(stages.folder, raw)
    players = {name: stages.player(row["recipe"], table["seeds"][0]) for name, row in table["rows"].items() if row.get("cells")}
    if design.figure == "map":
        cells = {name: row["cells"] for name, row in table["rows"].items() if row.get("cells")} | dict(table["controls"])
        write_picture(draw_latents(players, excerpts, cells), path)
    else:
        write_picture(draw_poses(players, excerpts, seed=table["seeds"][0]), path)


def write_table(table: Mapping[str, Any], folder: str | PathLike[str]) -> tuple[Path, Path]:
    """``TABLE-CORPUS.json`` and ``.md`` in a folder, and which they are; of the small scale ``TABLE-CORPUS-small``."""
    stem = Path(folder) / f"{table['table']}-{table['pose']}{'-small' if table['small'] else ''}"
    make_folder(stem.parent)
    paths = (stem.with_suffix(".json"), stem.with_suffix(".md"))
    for path, text in zip(paths, (json.dumps(table, indent=1, ensure_ascii=False) + "\n", to_markdown(table)), strict=True):
        with atomic(path) as temporary:
            temporary.write_text(text, "utf-8")
    return paths
