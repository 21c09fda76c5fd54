"""``cospeech evaluate``: the command that sets motions against the recordings of a store. As light as `cli`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from typer import Argument, Option

from .errors import InputError
from .files import atomic

__all__ = ["register"]

Store = Annotated[Path, Argument(metavar="STORE", help="Folder made by `cospeech prepare`.")]
Systems = Annotated[
    list[str] | None,
    Argument(metavar="[NAME=FOLDER]...", help="Motions to judge: CLIP.bvh or CLIP.npz for every clip; more takes: CLIP.2.bvh."),
]
Raw = Annotated[Path | None, Option("--raw", metavar="RAW", help="The corpus of the store, for metrics that hear.")]
Split = Annotated[str, Option("--split", metavar="NAME", help="train, validation, test or all.")]
Metrics = Annotated[
    list[str] | None, Option("--metric", "-m", metavar="NAME", help="See `cospeech list metrics`; several may be given.")
]
Given = Annotated[int, Option("--seed-frames", metavar="NUMBER", help="First frames that were given to the systems.")]
Out = Annotated[Path | None, Option("--out", "-o", metavar="FILE", help="Write the table as JSON.")]
Json = Annotated[bool, Option("--json", help="Print the table as JSON.")]
Debug = Annotated[bool, Option("--debug", help="Show the traceback of an error.")]


def _folders(systems: list[str]) -> dict[str, str]:
    """Name → folder, of ``NAME=FOLDER`` or of a folder alone, which is its own name."""
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
        store: Store,
        systems: Systems = None,
        raw: Raw = None,
        split: Split = "test",
        metric: Metrics = None,
        seed_frames: Given = 0,
        out: Out = None,
        as_json: Json = False,
        debug: Debug = False,
    ) -> None:
        """Motions against recordings: a table of metrics, always with control rows.

        \b
        cospeech evaluate stores/beat mine=generated --raw raw/beat -m fgd -m beat_align
        """
        from .evaluate import DEFAULT, stored_clips
        from .evaluate import evaluate as judge

        folders = _folders(systems or [])
        clips = stored_clips(store, split=None if split == "all" else split, raw=raw)
        table = judge(folders, clips, metrics=tuple(metric or DEFAULT), seed_frames=seed_frames)
        if out is not None:
            with atomic(out) as path:
                path.write_text(table.to_json() + "\n", "utf-8")
        typer.echo(table.to_json() if as_json else table.to_text())
