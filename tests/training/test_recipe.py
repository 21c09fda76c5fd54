"""Recipes: what is read is what was written, and what is wrong is told with what was meant."""

from __future__ import annotations

import re
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

from cospeech.audio.features.reduce import REDUCTIONS
from cospeech.errors import InputError
from cospeech.training.recipe import SHIPPED, Data, Train, build, list_changes, load_recipe, read_recipe

ROOT = Path(__file__).resolve().parents[2]
TEXT = """
[model]
name = "stylised-flow"
hidden = 64

[needs]
omega = "runs/ae"

[data]
corpus = "ted"
fps = 15
audio = "mel29"

[train]
steps = 500
lr = 1
betas = [0.5, 0.9]
clip_value = 5

[train.discriminator]
lr = 1e-4
schedule = "exponential"
"""


@pytest.fixture
def path(tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text(TEXT)
    return file


def test_the_page_names_every_reduction_of_audio():
    (row,) = [line for line in (ROOT / "docs" / "training.md").read_text("utf-8").splitlines() if line.startswith("| `audio`")]
    assert set(REDUCTIONS) <= set(re.findall(r"[\w-]+", row))


def test_a_recipe_is_read(path):
    recipe = load_recipe(path)
    assert recipe.model == "stylised-flow"
    assert recipe.config == {"hidden": 64}
    assert recipe.needs == {"omega": "runs/ae"}
    assert recipe.data == Data(corpus="ted", fps=15.0, audio="mel29")
    assert recipe.train.steps == 500
    assert (recipe.train.lr, type(recipe.train.lr)) == (1.0, float)
    assert recipe.train.betas == (0.5, 0.9)


def test_an_objective_has_what_the_others_have_and_its_own(path):
    own = load_recipe(path).train.of("discriminator")
    assert (own.lr, own.schedule) == (1e-4, "exponential")
    assert (own.betas, own.clip_value) == ((0.5, 0.9), 5.0)
    assert load_recipe(path).train.of("generator").lr == 1.0


def test_as_a_dict_it_is_the_same_recipe(path):
    recipe = load_recipe(path)
    assert read_recipe(recipe.to_dict()) == recipe


def test_overrides_take_the_place_of_what_the_file_says(path):
    recipe = load_recipe(
        path, ["train.steps=2000", "data.audio=mel27", "model.nu = 50", "train.discriminator.lr=2e-4", 'data.pose="x"']
    )
    assert (recipe.train.steps, recipe.data.audio, recipe.data.pose) == (2000, "mel27", "x")
    assert recipe.config == {"hidden": 64, "nu": 50}
    assert recipe.train.of("discriminator").lr == 2e-4


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ("train.stpes=3", "no key train.stpes (did you mean 'steps'?"),
        ("trian.steps=3", "no section [trian] in a recipe (did you mean 'train'?"),
        ("train.steps=many", "train.steps is 'many' (it takes a whole number)"),
        ("train.steps=1.5", "train.steps is 1.5 (it takes a whole number)"),
        ("train.steps=true", "train.steps is True (it takes a whole number)"),
        ("train.steps=0", "train.steps is 0 (at least 1)"),
        ("train.lr=nan", "train.lr is nan"),
        ("train.lr=-1", "train.lr is -1.0 (at least 0)"),
        ("train.ema=1", "train.ema is 1.0"),
        ("train.betas=[0.9]", "train.betas is [0.9] (it takes a list of 2)"),
        ("train.betas=[0.9, 1.0]", "train.betas is [0.9, 1.0]"),
        ("train.balance=1", "train.balance is 1 (it takes true or false)"),
        ("train.precision=bf16", "train.precision is 'bf16' (did you mean 'bfloat16'?"),
        ("train.objectives=1", "no key train.objectives"),
        ("train.discriminator.steps=3", "no key train.discriminator.steps"),
        ("train.lr.peak=3", "--set 'train.lr.peak=3' (lr is no section)"),
        ("data.audio=3", "data.audio is 3 (it takes text in quotes)"),
        ("data.validation=2", "data.validation is 2.0"),
        ("needs.omega=3", "needs.omega is 3"),
        ("model.name=3", "the recipe names no model"),
        ("train=3", "--set 'train=3'"),
        ("train.steps", "--set 'train.steps'"),
    ],
)
def test_what_is_wrong_is_told(path, change, says):
    with pytest.raises(InputError) as error:
        load_recipe(path, [change])
    assert says in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("data", [b"[model", b"\xff\xfe", b"a = 1", b"[model]\nname = 3", b"", b"x" * (1 << 21)])
def test_what_is_no_recipe_is_refused(tmp_path, data):
    (tmp_path / "bad.toml").write_bytes(data)
    with pytest.raises(InputError):
        load_recipe(tmp_path / "bad.toml")
    with pytest.raises(InputError, match="cannot read"):
        load_recipe(tmp_path / "none.toml")


@dataclass(frozen=True)
class Config:
    width: int
    sizes: tuple[int, ...] = (1, 2)
    name: str | None = None


def test_a_config_is_built_of_a_section():
    assert build(Config, {"width": 3, "sizes": [4, 5, 6], "name": "x"}, "model") == Config(3, (4, 5, 6), "x")
    with pytest.raises(InputError, match=r"no model\.width"):
        build(Config, {}, "model")
    with pytest.raises(InputError, match=r"model\.sizes is"):
        build(Config, {"width": 3, "sizes": [1.5]}, "model")
    with pytest.raises(InputError, match="text in quotes"):
        build(Config, {"width": 3, "name": 3}, "model")


def test_what_may_change_and_what_may_not(path):
    old = load_recipe(path).to_dict()
    assert list_changes(old, load_recipe(path, ["train.steps=9000", "train.device=cuda", "train.threads=4"]).to_dict()) == []
    assert list_changes(old, load_recipe(path, ["train.lr=0.5"]).to_dict()) == ["train.lr: 1.0, now 0.5"]
    assert list_changes(old, load_recipe(path, ["model.nu=9"]).to_dict()) == ["model.nu: nothing, now 9"]


def test_every_recipe_of_ours_is_one():
    recipes = sorted(SHIPPED.glob("*.toml"))
    assert recipes
    for file in recipes:
        assert isinstance(load_recipe(file).train, Train)


def test_recipes_need_no_torch():
    code = "import sys, cospeech.training.recipe, cospeech.cli.train; sys.exit('torch' in sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True)


def test_recipes_of_the_tables_are_at_the_values_of_their_networks_and_say_so():
    pytest.importorskip("torch", reason="networks need torch (the train extra)")
    from cospeech.training.checkpoint import network

    theirs = {
        "soft": True,
        "curriculum": 1000,
        "adversarial_loss": "distance",
        "growth": 0.1,
        "id_freezes": True,
        "alternate": True,
    }
    names = ("mix_stage", "stage", "cmix_gan", "speech2gesture", "munit", "speaker_classifier", "mix_stage_authors")
    for name in names:
        base = name.removesuffix("_authors")
        recipe = load_recipe(SHIPPED / f"{base}_pats{'_authors' if name != base else ''}.toml")
        assert recipe.model == base.replace("_", "-")
        kind = network(recipe.model).Config
        assert build(kind, recipe.config, "model") == kind(**(theirs if name != base else {}))
        assert recipe.data.pose == "keypoints2d"
        assert recipe.data.speakers == ()
        hears = "audio" in network(recipe.model).arrays
        assert recipe.data.audio == ("log-mel-400" if hears else None)  # the 64 bands that a store of PATS has
    family = {name: load_recipe(SHIPPED / f"{name}.toml").train for name in
              ("mix_stage_pats", "stage_pats", "cmix_gan_pats", "mix_stage_pats_authors")}  # fmt: skip
    for name, train in family.items():
        assert (train.steps, train.batch, train.gamma, train.gamma_every) == (60_000, 16, 0.99, 3000)
        assert train.lr == (1e-4 if name.endswith("authors") else 1e-3)
        assert train.balance is (name != "cmix_gan_pats")  # of one speaker there is nothing to balance


def test_speakers_are_a_list_of_names(path):
    assert load_recipe(path).data.speakers == ()
    recipe = load_recipe(path, ['data.speakers=["ann", "bob"]', "train.weight_decay=1e-4"])
    assert recipe.data.speakers == ("ann", "bob")
    assert recipe.train.of("discriminator").weight_decay == 1e-4
    assert read_recipe(recipe.to_dict()) == recipe
    assert list_changes(load_recipe(path).to_dict(), recipe.to_dict())[0] == "data.speakers: [], now ['ann', 'bob']"
    for wrong in ('data.speakers="ann"', "data.speakers=[1]", "data.speakers=ann", "train.weight_decay=-1"):
        with pytest.raises(InputError, match=r"data\.speakers is|train\.weight_decay is"):
            load_recipe(path, [wrong])


def test_a_setting_of_ours_names_the_network_that_has_it():
    pytest.importorskip("torch")
    from cospeech.training.checkpoint import build_config

    for name, key, value in (
        ("chain-of-generation", "adversarial", 1.0), ("mix-stage", "pose_discriminator", True),
        ("stylised-flow", "residual", True),
    ):  # fmt: skip
        with pytest.raises(InputError, match=f'"{name}-extended" has it'):
            build_config(name, {key: value})
        with pytest.raises(InputError, match="has it, as 'speech_swap'"):
            build_config("chain-of-generation", {"borrowed": 0.5})  # old name
        assert vars(build_config(f"{name}-extended", {key: value}))[key] == value
        with pytest.raises(InputError, match=f"no key model.{key}s"):
            build_config(name, {f"{key}s": value})
