"""Tables of Chain of Generation: published figures, windows put together, what is lacking and its cost; a store of seconds."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from cospeech.audio.features.frames import AUDIO_NAMES
from cospeech.corpora.store import Entry
from cospeech.corpora.store_writer import Piece, write_store
from cospeech.errors import InputError
from cospeech.experiments.figures.lines import Lines, Series, draw_lines
from cospeech.experiments.tables import TABLES, Runs, draw_table, make_table, to_text
from cospeech.experiments.tables.cog import BA, CAMN, CHAIN, COG, CONCATENATION, FGD, FOUR, LABELS, SRGR
from cospeech.experiments.tables.cog_bench import cost_cells, generate_clips
from cospeech.experiments.tables.cog_windows import FRAMES, SEED_FRAMES, CogWindows
from cospeech.experiments.tables.paper_tables import COSTS
from cospeech.experiments.tables.runs import FEATURES, small_scale
from cospeech.metrics.controls import CONTROLS
from cospeech.motion.poses.euler import EULER
from cospeech.motion.skeletons.arkit import ARKIT
from cospeech.training.recipe import SHIPPED, build, load_recipe
from tests.support.tiny_recipes import write_tiny_recipes

torch = pytest.importorskip("torch")

ROOT = Path(__file__).resolve().parents[2]
FPS, SPEAKERS = 15.0, ("ann", "bob")
ROWS = [row for table in COG.values() for part in table.parts for row in part.rows]
RECIPES = sorted({row.recipe for row in ROWS if row.recipe})
TINY = {
    "chain-of-generation": {
        "hidden": 4, "layers": 1, "latent": 4, "word_width": 4, "text_channels": 4, "classifier_channels": 4,
        "classifier_steps": 1,
    },
    "camn": {"hidden": 4, "layers": 1, "audio": 4, "text": 4, "face": 4, "word_width": 4},
    "multi-context": {"hidden": 4, "layers": 1, "audio": 4, "text": 4, "word_width": 4, "adversarial_from": 1},
    "speech2gesture": {"channels": 4, "discriminator_channels": 4},
    "seq2seq": {"hidden": 4, "layers": 1, "word_width": 4},
    "audio2gestures": {"channels": 8, "code": 2},
    "talkshow": {
        "frames": 36, "codes": 4, "code": 2, "hidden": 8, "heard": 8, "width": 4, "layers": 2, "latent": 4, "prior_from": 1,
    },
    "gesturediffuclip": {
        "hidden": 8, "latent": 4, "heard": 8, "text": 4, "text_channels": 4, "word_width": 4, "style": 4, "width": 4,
        "layers": 1, "heads": 1, "steps": 2, "align_from": 1, "diffusion_from": 2,
    },
    "fgd-autoencoder": {"channels": 4, "hidden": 16, "code": 4},
}  # fmt: skip


def values(frames: int, seed: int) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(seed)
    at = np.arange(frames)[:, None] / 9
    return {
        "pose": (8 * np.sin(at + rng.normal(size=EULER.dimensions) * 3)).astype(np.float32),
        "audio": rng.normal(size=(frames, len(AUDIO_NAMES))).astype(np.float32),
        "face": rng.random((frames, len(ARKIT))).astype(np.float32),
        "emotion": np.full(frames, seed % 8, np.int8),
        "word": (np.arange(frames) // 9 % 3).astype(np.int32),
        "semantic": rng.choice([0.0, 0.1, 0.6], frames).astype(np.float32),
    }


def piece(name: str, speaker: str, split: str, frames: int, seed: int, without: str = "") -> Piece:
    arrays = {key: array for key, array in values(frames, seed).items() if key != without}
    return Piece(Entry(name, speaker, split, 0, frames, 0.0, tuple(arrays)), ("hello", "there"), lambda: dict(arrays))


@pytest.fixture(scope="session")
def store(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("cog") / "beat"
    pieces = [piece(f"{n}-{s}", n, s, 130 + 40 * k, 7 * k + len(s)) for k, n in enumerate(SPEAKERS) for s in ("train", "test")]
    pieces += [piece("short", "ann", "test", 33, 5), piece("faceless", "bob", "test", 90, 6, "face")]
    names = {"pose": EULER.names, "audio": AUDIO_NAMES, "face": ARKIT}
    write_store(folder, pieces, corpus="beat", pose="euler", fps=FPS, names=names)
    return folder


@pytest.fixture(scope="session")
def recipes(tmp_path_factory) -> Path:
    """The repository's recipes, made tiny."""
    names = (*RECIPES, f"{FEATURES}_beat")
    return write_tiny_recipes(tmp_path_factory.mktemp("recipes"), names, TINY.__getitem__, steps=3, save_every=3)


@pytest.fixture(scope="session")
def table_runs(store, recipes, tmp_path_factory) -> Runs:
    return Runs(store, tmp_path_factory.mktemp("runs"), recipes, threads=1, about="made up")


@pytest.fixture(scope="session")
def data(store) -> CogWindows:
    return CogWindows(store)


def quiet(text: str) -> None:
    pass


# what the paper says ------------------------------------------------------------------------------------------------------


def test_published_figures_are_the_papers(shared_folder):
    paper = (shared_folder / "papers" / "chain-of-generation_xu-2024.txt").read_text("utf-8")
    words = paper.replace("(", " ").replace(")", " ").split()
    paper_figures = {f"{float(word):g}" for word in words if word.replace(".", "", 1).isdigit()}
    figures = {f"{value:g}" for row in ROWS for value in row.published.values()}
    assert len(figures) > 40
    assert figures <= paper_figures
    best = [row.published for row in ROWS if row.name in (CHAIN, "+rhythm", "(500, 1000, 1)")]
    assert best[0] == best[1] == best[2] == {FGD: 45.87, SRGR: 0.308, BA: 0.931}


def config_of(row) -> object:
    from cospeech.training.checkpoint import network

    recipe = load_recipe(SHIPPED / f"{row.recipe}.toml", row.overrides)
    return build(network(recipe.model).Config, recipe.config, "model")


@pytest.mark.parametrize("row", [row for row in ROWS if row.recipe], ids=lambda row: row.name)
def test_every_row_has_a_recipe_that_builds(row):
    from cospeech.training.checkpoint import network

    recipe = load_recipe(SHIPPED / f"{row.recipe}.toml", row.overrides)
    config = config_of(row)
    frames = {"audio2gestures": 64, "talkshow": 88, "gesturediffuclip": 36}
    assert config.frames == frames.get(recipe.model, FRAMES)
    small = build(
        network(recipe.model).Config, {**recipe.config, **small_scale(recipe.model.removesuffix("-extended"))["model"]}, "model"
    )
    assert small != config
    assert recipe.data.corpus == "beat"
    assert recipe.data.pose == "euler"


def test_ablations_are_one_step_apart_and_end_with_the_recipe():
    from cospeech.models.chain_of_generation_extended import ChainExtendedConfig

    rows = COG["cog-2"].parts[0].rows
    configs = [config_of(row) for row in rows]
    (whole,) = [row for row in COG["cog-1"].parts[0].rows if row.name == CHAIN]
    assert configs[-1] == config_of(whole)
    assert rows[-1].overrides == whole.overrides == ()
    own = [vars(ChainExtendedConfig()) | vars(config) for config in configs]  # the first row is of the extension
    differences = [{key for key in a if a[key] != b[key]} for a, b in pairwise(own)]
    assert differences == [{"face_teacher_forcing", "face"}, {"attention"}, {"style_injection"}, {"rhythm"}]
    assert [row.lacks for row in rows] == [LABELS[1:], *[LABELS] * 4]


def test_weights_are_those_of_the_row():
    for row in COG["cog-4"].parts[0].rows:
        config = config_of(row)
        assert row.name == str(tuple(int(getattr(config, key)) for key in ("reconstruction", "face", "rhythm")))


def test_one_network_serves_all_conditions_of_figure_1():
    rows = COG["cog-figure-1"].parts[0].rows
    for system in (CHAIN, CAMN, CONCATENATION):
        own = [row for row in rows if row.name.startswith(f"{system}:")]
        assert len({(row.recipe, row.overrides) for row in own}) == 1
        assert [row.lacks for row in own] == [(), *((name,) for name in FOUR), FOUR]
    concatenation = config_of(next(row for row in rows if row.name.startswith(CONCATENATION)))
    assert concatenation.emotion > 0
    assert concatenation.face > 0
    assert {claim.metric for claim in COG["cog-figure-1"].parts[0].claims} == {*COSTS}


# windows ------------------------------------------------------------------------------------------------------------------


def test_clips_that_lack_something_or_are_short_are_left_out(data):
    assert [entry.name for entry in data.entries] == ["ann-test", "bob-test"]
    np.testing.assert_array_equal(data.frames, [SEED_FRAMES + 30 * ((frames - SEED_FRAMES) // 30) for frames in (130, 170)])
    assert len(data) == 4 + 5


def test_windows_put_together_are_the_clip(data):
    for array in ("pose", "face"):
        rows = data.store.arrays[array]
        windows = np.stack([rows[k : k + FRAMES] for k in data.starts])
        for entry, whole, frames in zip(data.entries, data.join_windows(windows, array), data.frames, strict=True):
            np.testing.assert_array_equal(whole, rows[entry.offset : entry.offset + frames])
        spoilt = windows.copy()
        spoilt[:, :SEED_FRAMES] = np.nan  # what was given to a window is never taken from it
        for a, b in zip(data.join_windows(spoilt, array), data.join_windows(windows, array), strict=True):
            np.testing.assert_array_equal(a, b)


def test_recordings_are_perfect(data):
    poses = [data.store.clip(e)["pose"][:n] for e, n in zip(data.entries, data.frames, strict=True)]
    faces = [data.store.clip(e)["face"][:n] for e, n in zip(data.entries, data.frames, strict=True)]
    for sample, true in zip(data.samples(poses, faces), data.truth, strict=True):
        np.testing.assert_allclose(sample.rotations, true.rotations, atol=1e-6)
        np.testing.assert_allclose(sample.face, true.face)
        assert (sample.condition, sample.seed_frames) == (true.condition, SEED_FRAMES)
        assert len(sample.names) == 48  # the root, and the 47 that move
        assert sample.semantics.max() == pytest.approx(0.6)


def test_key_points_are_refused(tmp_path):
    from cospeech.motion.poses.keypoints2d import KEYPOINTS2D

    arrays = {"pose": np.zeros((90, KEYPOINTS2D.dimensions), np.float32)}
    pieces = [Piece(Entry("a", "a", "test", 0, 90, 0.0, ("pose",)), (), lambda: dict(arrays))]
    write_store(tmp_path / "s", pieces, corpus="pats", pose="keypoints2d", fps=FPS, names={"pose": KEYPOINTS2D.names})
    with pytest.raises(InputError, match="keypoints2d"):
        CogWindows(tmp_path / "s")


# what is lacking ----------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="session")
def players(table_runs) -> dict:
    return {name: table_runs.player(f"{name}_beat") for name in ("chain_of_generation", "camn")}


def test_what_is_lacking_is_not_looked_at(players, data, monkeypatch):
    for name, player in players.items():
        whole = generate_clips(player, data, ())[0]
        for lacking, array in (("face", "face"), ("text", "text"), ("emotion", "emotion"), ("speaker", "speaker")):
            without = generate_clips(player, data, (lacking,))[0]
            assert any(np.abs(a - b).max() > 1e-6 for a, b in zip(whole, without, strict=True)), (name, lacking)
            arrays = CogWindows.arrays

            def other(self, player, array=array, arrays=arrays):
                inputs = arrays(self, player)
                blank = inputs[array][::-1].copy() if array != "face" else 1 - inputs[array]
                return inputs | {array: blank if array != "emotion" else (blank + 3) % 8}

            with monkeypatch.context() as patch:
                patch.setattr(CogWindows, "arrays", other)
                again = generate_clips(player, data, (lacking,))[0]
                with_other = generate_clips(player, data, ())[0]
            for a, b in zip(without, again, strict=True):
                np.testing.assert_array_equal(a, b)
            assert any(np.abs(a - b).max() > 1e-6 for a, b in zip(whole, with_other, strict=True)), (name, lacking)


def test_what_a_row_of_table_2_leaves_out_plays_no_part(table_runs, data):
    for k, row in enumerate(COG["cog-2"].parts[0].rows):
        player = table_runs.player(row.recipe, 0, row.overrides)
        parts = {name.split(".")[1] for name, _ in player.net.named_parameters() if name.startswith("cascade.")}
        assert ("body_attention" in parts) is ("hand_attention" in parts) is (k >= 2)
        assert ("body_style" in parts) is ("hand_style" in parts) is (k >= 3)
        with_labels, without_labels = (generate_clips(player, data, lacks)[0] for lacks in (("face",), LABELS))
        assert all(np.array_equal(a, b) for a, b in zip(with_labels, without_labels, strict=True)) is (k < 3)  # who, and how
        of_row, speech_only = (generate_clips(player, data, lacks)[0] for lacks in (row.lacks, LABELS))
        assert all(np.array_equal(a, b) for a, b in zip(of_row, speech_only, strict=True)) is (k > 0)


def test_a_chain_makes_faces_and_others_do_not(players, data):
    _, faces = generate_clips(players["chain_of_generation"], data, LABELS)
    assert [len(face) for face in faces] == [*data.frames]
    assert all(face.min() >= 0 and face.max() <= 1 for face in faces)
    assert generate_clips(players["chain_of_generation"], data, ())[1] is None  # the recorded one, which it was given
    assert generate_clips(players["camn"], data, ())[1] is None


def test_costs_are_differences_to_all_inputs():
    def cells(fgd: float, srgr: float) -> dict:
        return {FGD: {"value": fgd, "interval": None, "note": ""}, SRGR: {"value": srgr, "interval": None, "note": ""}}

    cost = cost_cells(cells(7.0, 0.2), cells(4.0, 0.5))
    assert cost["fgd_cost"]["value"] == 3.0
    with_draws = [{name: cell | {"draws": [cell["value"] + k for k in by]} for name, cell in cells(*values).items()}
             for values, by in (((7.0, 0.2), (0, 1)), ((4.0, 0.5), (0, 2)))]  # fmt: skip
    assert cost_cells(*with_draws)["fgd_cost"]["draws"] == [3, 2]
    assert cost["srgr_cost"]["value"] == pytest.approx(0.3)
    assert cost_cells(cells(1, 1) | {FGD: {"why": "too short"}}, cells(1, 1))["fgd_cost"] == {"why": "too short"}


# the way as a whole -------------------------------------------------------------------------------------------------------


def test_a_wrong_recipe_is_told_with_each_known_one_once(table_runs):
    with pytest.raises(InputError, match="recipe 'camn_beat'") as refusal:
        make_table("cog-2", replace(table_runs, overrides=("camn_beat:train.steps=3",)), tell=quiet)
    assert str(refusal.value).count("chain_of_generation_beat") == 1


@pytest.mark.parametrize("name", ["cog-1", "cog-2", "cog-4"])
def test_a_table_from_nothing(table_runs, name, tmp_path):
    table = make_table(name, table_runs, seeds=(0,), tell=quiet)
    cells_of_rows = {row: cells["cells"] for row, cells in table["rows"].items() if cells.get("cells")}
    assert len(cells_of_rows) == {"cog-1": 8, "cog-2": 5, "cog-4": 8}[name]
    for row, cells in cells_of_rows.items():
        for metric in (FGD, SRGR, "srgr"):
            assert np.isfinite(cells[metric]["mean"])
        assert ("mean" in cells["face_mse"]) is (
            row not in ("−face", "Seq2Seq", "Speech2Gesture", "MultiContext", "Audio2Gestures", "CaMN", "GestureDiffuCLIP")
        )
        assert "--raw" in cells[BA]["why"]
    truth, noise = table["controls"][CONTROLS[0]], table["controls"]["white noise"]
    assert truth[FGD]["mean"] == pytest.approx(0, abs=1e-9)
    assert truth["srgr"]["mean"] == 1
    assert truth["face_mse"]["mean"] == 0
    assert noise[FGD]["mean"] > 1e-6
    assert "9 test windows of 34 frames" in table["head"]
    assert "not comparable" in to_text(table)
    draw_table(table, table_runs, tmp_path / "strip.png")
    with Image.open(tmp_path / "strip.png") as picture:
        assert len(picture.getcolors(picture.width * picture.height)) > 50


def test_figure_1_trains_three_networks_and_plays_them_under_six_conditions(table_runs, tmp_path):
    messages: list[str] = []
    table = make_table("cog-figure-1", replace(table_runs, runs=tmp_path, tell=messages.append), seeds=(0,), tell=quiet)
    ends = [sum(f"step {k} of {k}" in text for text in messages) for k in (3, 4)]
    assert ends == [2 + 1, 1]  # the network of FGD too; the classifier of CoG has a step of its own
    for system in (CHAIN, CAMN, CONCATENATION):
        whole = table["rows"][f"{system}: all"]["cells"]
        assert whole["fgd_cost"]["mean"] == whole["srgr_cost"]["mean"] == 0
        without = table["rows"][f"{system}: −all four"]["cells"]
        assert without["fgd_cost"]["mean"] == pytest.approx(without[FGD]["mean"] - whole[FGD]["mean"])
        assert without["srgr_cost"]["mean"] == pytest.approx(whole[SRGR]["mean"] - without[SRGR]["mean"])
    assert "why" in table["controls"][CONTROLS[0]]["fgd_cost"]
    assert len(table["verdicts"]) == 20
    draw_table(table, replace(table_runs, runs=tmp_path), tmp_path / "lines.png")
    with Image.open(tmp_path / "lines.png") as picture:
        assert picture.width > 1000


def test_tables_are_of_beat(table_runs):
    assert {part.corpus for name in COG for part in TABLES[name].parts} == {"beat"}


# pictures -----------------------------------------------------------------------------------------------------------------


def test_lines_reach_as_high_as_what_is_drawn():
    names = ["all", "−text", "−face"]
    low = Series("a", names, np.array([1.0, 2.0, 3.0]), np.array([0.1, 0.2, 0.3]))
    high = Series("b", names[:2], np.array([5.0, 9.0]), np.array([1.0, 2.0]))
    sheet = draw_lines([Lines("one", [low, high]), Lines("two", [low])])
    np.testing.assert_array_equal(sheet, draw_lines([Lines("one", [low, high]), Lines("two", [low])]))
    other = draw_lines([Lines("one", [low, replace(high, y=high.y + 0.5)]), Lines("two", [low])])
    half = sheet.shape[1] // 2 + 10
    assert (sheet[:, :half] != other[:, :half]).any()
    np.testing.assert_array_equal(sheet[:, half:], other[:, half:])
    with pytest.raises(InputError, match="conditions"):
        Series("a", names, np.zeros(2), np.zeros(2))
    for nothing in ([], [Lines("one", [])]):
        with pytest.raises(InputError, match="lines"):
            draw_lines(nothing)
