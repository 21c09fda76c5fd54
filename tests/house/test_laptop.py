"""The tutorial docs/tutorials/train_a_model.md: typed as it stands, but smaller, it goes from nothing to a model that plays."""

from __future__ import annotations

from pathlib import Path

import pytest
import soundfile

from cospeech.cli.demo import EXAMPLE
from cospeech.errors import InputError
from cospeech.motion.motion import Motion
from cospeech.training.recipe import SHIPPED, list_recipes, load_recipe
from tests.house.test_docs import FENCE, ROOT
from tests.support.command_line import change_options, type_command

pytestmark = pytest.mark.slow

PAGE = ROOT / "docs" / "tutorials" / "train_a_model.md"
LESS = {
    "synthesise": "--hours 0.03 --speakers 2 --no-act",
    "train": "--set train.steps=6 --set train.validate_every=3 --set train.batch=4",
}


def lines() -> list[str]:
    """Commands of the block, without comments."""
    first = next(text for kind, text in FENCE.findall(PAGE.read_text("utf-8")) if kind == "bash")
    return [line.partition("#")[0].strip() for line in first.splitlines()]


def test_the_block_of_the_page_runs(tmp_path, monkeypatch):
    for name in ("torch", "onnx"):
        pytest.importorskip(name, reason=f"training needs {name} (cospeech[train])")
    soundfile.write(tmp_path / "talk.wav", *soundfile.read(EXAMPLE, frames=96_000))
    commands = [line.split()[1] for line in lines()]
    assert commands == ["synthesise", "prepare", "train", "bundle", "generate"]
    monkeypatch.setenv("PATH", str(tmp_path))  # no espeak-ng, no flite
    for line in lines():
        _, err = type_command(change_options(line, LESS.get(line.split()[1], "")), tmp_path)
        if "synthesise" in line:
            assert err.startswith("note: neither espeak-ng nor flite is installed")
    assert len(Motion.load(tmp_path / "talk.bvh")) == 180
    assert (tmp_path / "talk.glb").stat().st_size > 1000


def test_recipes_that_come_with_the_program(tmp_path, monkeypatch):
    assert "laptop" in list_recipes()
    for name in list_recipes():
        recipe = load_recipe(name)
        assert recipe == load_recipe(SHIPPED / f"{name}.toml")
        assert {Path(run).name for run in recipe.needs.values()} <= set(list_recipes()), "what it needs can be trained, too"
    monkeypatch.chdir(tmp_path)
    Path("laptop").write_text((SHIPPED / "laptop.toml").read_text("utf-8").replace("batch = 32", "batch = 7"), "utf-8")
    assert load_recipe("laptop").train.batch == 7, "a file of the user's comes first"
    names = ", ".join(list_recipes())
    message = rf"'latpop': .* \(did you mean 'laptop'\? a TOML file, or one that comes with the program: {names}\)"
    with pytest.raises(InputError, match=message):
        load_recipe("latpop")
    with pytest.raises(InputError, match=r"directory \(a TOML file"):
        load_recipe("latpop.toml")
