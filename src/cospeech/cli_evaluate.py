"""``cospeech evaluate``: the command that sets motions against the recordings of a store. As light as `cli`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from typer import Argument, Option

from .errors import InputError
from .files import atomic

__all__ = ["register"]

Systems = Annotated[
    list[str] | None,
    Argument(
        metavar="[SYSTEM]...",
        help="A model, or FOLDER or NAME=FOLDER of motions: CLIP.bvh or CLIP.npz for every clip; more takes: CLIP.2.bvh.",
    ),
]
Store = Annotated[Path, Option("--corpus", metavar="STORE", help="Folder made by `cospeech prepare`.")]
Raw = Annotated[Path | None, Option("--raw", metavar="RAW", help="The corpus of the store, for models and metrics that hear.")]
Split = Annotated[str, Option("--split", metavar="NAME", help="train, validation, test or all.")]
Metrics = Annotated[str | None, Option("--metrics", metavar="LIST", help="Separated by commas; see `cospeech list metrics`.")]
Takes = Annotated[int, Option("--takes", metavar="NUMBER", help="Performances of a model, for metrics of variety.")]
Seed = Annotated[int, Option("--seed", metavar="NUMBER", help="Of a model's first performance.")]
Given = Annotated[int, Option("--seed-frames", metavar="NUMBER", help="First frames that were given to the systems.")]
Features = Annotated[
    Path | None, Option("--features", metavar="RUN", help="Network of FGD: the folder of a trained one (recipes/fgd_ted.toml).")
]
Out = Annotated[Path | None, Option("--out", "-o", metavar="FILE", help="Write the table as JSON.")]
Json = Annotated[bool, Option("--json", help="Print the table as JSON.")]
Debug = Annotated[bool, Option("--debug", help="Show the traceback of an error.")]


def _named(systems: list[str]) -> dict[str, str]:
    """Name → model or folder, of ``NAME=FOLDER`` or of a model or folder alone, which is its own name."""
    found: dict[str, str] = {}
    for system in systems:
        name, equals, folder = system.partition("=")
        name, folder = (name, folder) if equals else (Path(system).name, system)
        if not name or not folder or name in found:
            raise InputError(f"system {system!r}", "NAME=FOLDER, each name once")
        found[name] = folder
    return found


def register(app: typer.Typer) -> None:
    """Add the command to ``app``."""

    @app.command()
    def evaluate(
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
        out: Out = None,
        as_json: Json = False,
        debug: Debug = False,
    ) -> None:
        """A table of metrics: systems beside the ground truth and the control rows that a metric must put in order.

        \b
        cospeech evaluate rules --corpus stores/beat --raw raw/beat --metrics fgd,beat_align
        cospeech evaluate mine=generated --corpus stores/beat --raw raw/beat
        """
        from .contest import contest
        from .evaluation import DEFAULT

        table = contest(
            _named(systems or []), corpus, raw=raw, split=None if split == "all" else split, takes=takes, seed=seed,
            metrics=DEFAULT if metrics is None else [name.strip() for name in metrics.split(",") if name.strip()],
            seed_frames=seed_frames, features=features,
        )  # fmt: skip
        if out is not None:
            with atomic(out) as path:
                path.write_text(table.to_json() + "\n", "utf-8")
        typer.echo(table.to_json() if as_json else table.to_text())
