"""The repository's recipes, made so small that a run takes seconds."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from pathlib import Path

import pytest

from cospeech.experiments.tables.runs import Runs
from cospeech.training.recipe import SHIPPED, load_recipe

__all__ = ["cut_off", "write_tiny_recipes"]


def write_tiny_recipes(
    folder: Path, names: Iterable[str], sizes: Callable[[str], Mapping[str, object]], *, steps: int = 2, save_every: int = 1
) -> Path:
    """Recipes of a few steps; ``sizes`` gives what changes in the section of a model. The folder."""
    for name in names:
        sections = load_recipe(SHIPPED / f"{name}.toml").to_dict()
        sections["model"] |= sizes(sections["model"]["name"])
        sections["train"] = {
            "steps": steps,
            "save_every": save_every,
            "batch": 4,
            "validate_every": 0,
            "threads": 1,
            "lr": 1e-4,
        }
        lines = []
        for section, values in sections.items():
            plain = {key: [*value] if isinstance(value, tuple) else value for key, value in values.items()}
            lines += [f"[{section}]", *(f"{key} = {json.dumps(value)}" for key, value in plain.items()), ""]
        (folder / f"{name}.toml").write_text("\n".join(lines))
    return folder


def cut_off(runs: Runs, *arguments: object) -> None:
    """Begin a run and end it after its first step."""

    class Cut(Exception):
        pass

    def cut(text: str) -> None:
        if "step 1 " in text:
            raise Cut

    with pytest.raises(Cut):
        replace(runs, tell=cut).run(*arguments)
