"""Tables of the papers: what they claim, how rows are made and kept, verdicts, pictures; on a store of a few seconds."""

from __future__ import annotations

import json
import math
import os
import shutil
import signal
import subprocess
import sys
import tarfile
from dataclasses import replace
from functools import cache
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from PIL import Image
from typer.testing import CliRunner

from cospeech.audio.features.frames import AUDIO_NAMES
from cospeech.audio.features.waveform import WAVEFORM_NAMES
from cospeech.cli.main import app
from cospeech.corpora.store import Entry
from cospeech.corpora.store_writer import Piece, write_store
from cospeech.errors import CospeechError, InputError
from cospeech.experiments.figures.scatter import Panel, draw_map
from cospeech.experiments.figures.sticks import Sticks, draw_sticks
from cospeech.experiments.tables import TABLES, Runs, draw_table, make_table, making, to_text, write_table
from cospeech.experiments.tables.controls import ORACLE
from cospeech.experiments.tables.excerpts import AFTER, BEFORE, Excerpts
from cospeech.experiments.tables.inputs import StoreInputs, find_context, generate_rows
from cospeech.experiments.tables.likelihood import STILL
from cospeech.experiments.tables.report import summary, to_markdown
from cospeech.experiments.tables.runs import FEATURES, OMEGA, PlayableRun, small_scale
from cospeech.experiments.tables.scores import generate_windows
from cospeech.experiments.tables.tsne import tsne
from cospeech.experiments.tables.verdicts import NOT_ASSAYED, UNDECIDED
from cospeech.metrics.clustering import silhouette_coefficient
from cospeech.motion.points import Points
from cospeech.motion.poses.direction_vectors import BONES, DIRECTION_VECTORS
from cospeech.training.recipe import SHIPPED, build, load_recipe
from tests.support.tiny_recipes import cut_off, write_tiny_recipes

torch = pytest.importorskip("torch")

ROOT = Path(__file__).resolve().parents[2]
FPS, SPEAKERS = 15.0, ("ann", "bob", "cleo")
NAMES = {"pose": DIRECTION_VECTORS.names, "audio": AUDIO_NAMES, "waveform": WAVEFORM_NAMES}
FLOW = [table for table in TABLES if table.startswith("flow")]
ROWS = [row for name in FLOW for part in TABLES[name].parts for row in part.rows]
RECIPES = sorted({row.recipe for row in ROWS if row.recipe})


def poses(frames: int, seed: int) -> np.ndarray:
    """(T, 27) bones that swing about, of unit length."""
    rng = np.random.default_rng(seed)
    bones = rng.normal(size=(9, 3)) + 0.5 * np.sin(np.arange(frames)[:, None, None] / 5 + rng.normal(size=(9, 3)) * 3)
    points = np.zeros((frames, 10, 3))
    for k, (start, end, length) in enumerate(BONES):
        points[:, end] = points[:, start] + length * bones[:, k] / np.linalg.norm(bones[:, k], axis=-1, keepdims=True)
    return DIRECTION_VECTORS.encode(Points(FPS, points, "ted"))


def piece(name: str, speaker: str, split: str, frames: int, seed: int) -> Piece:
    audio = np.random.default_rng(seed).normal(size=(frames, len(AUDIO_NAMES))).astype(np.float32)
    words = (np.arange(frames) // 9 % 3).astype(np.int32)  # 0: silence
    waveform = np.random.default_rng(seed).normal(0, 0.1, (frames, len(WAVEFORM_NAMES))).astype(np.float16)
    values = {"pose": poses(frames, seed).astype(np.float32), "audio": audio, "word": words, "waveform": waveform}
    return Piece(Entry(name, speaker, split, 0, frames, 0.0, tuple(values)), ("hello", "there"), lambda: dict(values))


@pytest.fixture(scope="session")
def store(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("store") / "ted"
    pieces = [piece(f"{n}-{s}", n, s, 200, k * 7 + len(s)) for k, n in enumerate(SPEAKERS) for s in ("train", "test")]
    write_store(folder, pieces, corpus="ted", pose="direction-vectors", fps=FPS, names=NAMES)
    return folder


SIZES = {"steps": 2, "hidden": 8, "layers": 1, "encoder_channels": 4, "encoder_blocks": 1, "feature": 4, "frames": 8}
TINY = {
    "stylised-flow": SIZES,
    "moglow": {"steps": 2, "hidden": 8, "layers": 1, "frames": 8},
    "gesture-autoencoder": {"width": 8, "code": 4, "frames": 16},
    **{key: {"hidden": 4, "layers": 1, "word_width": 4} for key in ("trimodal", "speech2affective-gestures")},
    "joint-embedding": {"hidden": 4, "layers": 1, "word_width": 4, "speech_hidden": 4},
    "seq2seq": {"hidden": 4, "layers": 1, "word_width": 4},
    "speech2gesture": {"channels": 8, "discriminator_channels": 4},
    "fgd-autoencoder": {"channels": 4, "hidden": 16, "code": 4},
}


@pytest.fixture(scope="session")
def recipes(tmp_path_factory) -> Path:
    """The repository's recipes, made tiny."""
    names = (*(r for r in RECIPES if "_ted" in r), f"{OMEGA}_ted", f"{FEATURES}_ted")
    return write_tiny_recipes(tmp_path_factory.mktemp("recipes"), names, TINY.__getitem__)


@pytest.fixture(scope="session")
def runs(tmp_path_factory) -> Path:
    return tmp_path_factory.mktemp("runs")


@pytest.fixture
def table_runs(store, recipes, runs) -> Runs:
    return Runs(store, runs, recipes, threads=1, about="made up")


# what the papers say ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("table", sorted({*TABLES} - {"mix-3", "cog-figure-1", "flow-figure-8"}))  # no figures
def test_published_figures_bear_out_what_the_paper_claims_of_them(table):
    count = 0
    for part in TABLES[table].parts:
        figures = {row.name: row.published for row in part.rows}
        for claim in part.claims:
            assert {claim.better, claim.worse} <= {*figures}
            if claim.metric in figures[claim.better]:
                gap = figures[claim.better][claim.metric] - figures[claim.worse][claim.metric]
                assert gap * (1 if claim.higher else -1) > 0, claim
                count += 1
    assert count >= 2


def test_published_figures_are_the_papers(shared_folder):
    paper = (shared_folder / "papers" / "stylised-flow_ye-2022.txt").read_text("utf-8")
    tables = paper[paper.index("Dataset\tMethod") :]
    figures = {f"{value:g}" for row in ROWS for value in row.published.values()}
    paper_figures = {
        f"{float(word):g}" for word in tables.replace("\n", "\t").split("\t") if word.replace(".", "", 1).isdigit()
    }
    assert len(figures) > 40
    assert figures <= paper_figures


@pytest.mark.parametrize("name", RECIPES)
def test_every_row_has_a_recipe_that_builds(name):
    from cospeech.training.checkpoint import network

    recipe = load_recipe(SHIPPED / f"{name}.toml")
    config = build(network(recipe.model).Config, recipe.config, "model")
    if name == "gesticulator_trinity":
        assert (config.frames, config.history, config.look_ahead) == (40, 10, 19)
    elif recipe.model in ("stylised-flow", "moglow"):
        assert (config.steps, config.frames) == (16, 95 if "trinity" in name else 30)
        assert (config.history, config.look_ahead) == ((5, 20) if "trinity" in name else (12, 0))
    else:
        assert config.frames == 34  # of which 4 are given
    small = dict(small_scale(recipe.model)["model"])
    kind = network(small.pop("name", recipe.model))
    width = "channels" if recipe.model == "speech2gesture" else "hidden"
    narrow = build(kind.Config, {**recipe.config, **small}, "model")
    assert getattr(narrow, width) < getattr(config, width)


def test_recipes_of_the_flow_are_at_the_papers_values():
    ted, trinity = (load_recipe(SHIPPED / f"flow_{corpus}.toml") for corpus in ("ted", "trinity"))
    assert (ted.train.batch, ted.train.steps, trinity.train.batch, trinity.train.steps) == (200, 80_000, 100, 30_000)
    assert ted.config["reconstruction"] == 1
    assert ted.config["perceptual"] == 0.1
    authors = load_recipe(SHIPPED / "flow_trinity_authors.toml")
    assert (authors.config["history"], authors.config["look_ahead"], authors.train.steps) == (10, 10, 40_000)
    assert authors.config["nll_unit"] == pytest.approx(math.log(2))


# means over seeds -----------------------------------------------------------------------------------------------------


def row(*values: float) -> dict:
    return {"cells": {"fgd": summary([{"fgd": {"value": v, "interval": None, "note": ""}} for v in values], "fgd")}}


def test_intervals_are_students():
    stats = pytest.importorskip("scipy.stats")
    for count in (2, 3, 5, 20):
        values = np.random.default_rng(count).normal(size=count)
        cell = row(*values)["cells"]["fgd"]
        low, high = stats.t.interval(0.95, count - 1, values.mean(), values.std(ddof=1) / count**0.5)
        assert cell["mean"] - cell["half"] == pytest.approx(low, abs=1e-3)
        assert cell["mean"] + cell["half"] == pytest.approx(high, abs=1e-3)
    assert row(1.0)["cells"]["fgd"]["half"] is None


def test_a_seed_without_a_score_leaves_the_cell_empty():
    assert summary([{"fgd": {"value": 1.0}}, {"fgd": {"why": "too short"}}], "fgd") == {"why": "too short"}


# windows ------------------------------------------------------------------------------------------------------------------


def test_windows_lie_in_test_clips_with_room_on_both_sides(store):
    excerpts = Excerpts(store)
    assert len(excerpts) == 3 * 14
    for clip, start in zip(excerpts.clips, excerpts.starts, strict=True):
        entry = excerpts.store.clips[clip]
        assert entry.split == "test"
        assert entry.offset <= start - BEFORE
        assert start + excerpts.protocol.made + AFTER <= entry.offset + entry.frames
    long, short = excerpts.rows("pose", 12, 20), excerpts.rows("pose", 5, 0)
    np.testing.assert_array_equal(long[:, 7:42], short)
    with pytest.raises(InputError, match="13"):
        excerpts.rows("pose", 13, 0)


def test_true_frames_make_perfect_samples(store):
    excerpts = Excerpts(store)
    again = excerpts.samples(excerpts.rows("pose", 0, 0))
    for a, b in zip(again, excerpts.truth, strict=True):
        np.testing.assert_allclose(a.positions, b.positions, atol=1e-9)
        assert a.positions.shape == (34, 10, 3)
        assert (a.seed_frames, a.condition, a.label) == (4, b.name, b.label)


def test_control_rows_keep_their_places_and_other_clips_are_far(store):
    excerpts = Excerpts(store)
    rows = excerpts.controls()
    for sample, true, other in zip(rows["ground truth"], excerpts.truth, rows["another clip"], strict=True):
        np.testing.assert_array_equal(sample.positions, true.positions)
        assert other.condition == true.condition
        assert np.abs(other.positions - true.positions).max() > 0.05


def test_other_corpora_have_no_protocol(store, tmp_path):
    write_store(
        tmp_path / "pats", [piece("a", "a", "test", 110, 0)], corpus="pats", pose="direction-vectors", fps=FPS,
        names=NAMES,
    )  # fmt: skip
    with pytest.raises(InputError, match="pats"):
        Excerpts(tmp_path / "pats")


# playing ------------------------------------------------------------------------------------------------------------------


@cache
def flow():
    from cospeech.models.stylised_flow import FlowConfig, StylisedFlow

    with torch.random.fork_rng():
        torch.random.manual_seed(0)
        return StylisedFlow(FlowConfig(**SIZES, history=5), pose=6, audio=4).eval()


def test_performances_do_not_depend_on_the_batch(monkeypatch):
    from cospeech.experiments import playing

    rng = np.random.default_rng(0)
    history, audio = rng.normal(size=(7, 5, 6)), rng.normal(size=(7, 5 + 4, 4))
    whole = playing.perform(flow(), history, audio, seed=1)
    assert whole.shape == (7, 4, 6)
    assert np.abs(whole - playing.perform(flow(), history, audio, seed=2)).max() > 0.1
    monkeypatch.setattr(playing, "BATCH", 3)
    np.testing.assert_allclose(playing.perform(flow(), history, audio, seed=1), whole, atol=1e-5)
    with pytest.raises(InputError, match="2 poses"):
        playing.perform(flow(), history[:, :2], audio, seed=1)
    with pytest.raises(InputError, match="Linear"):
        playing.perform(torch.nn.Linear(1, 1), history, audio, seed=1)


def test_codes_lead_back_to_the_poses():
    from cospeech.experiments import playing

    rng = np.random.default_rng(0)
    pose, audio = rng.normal(size=(4, 5 + 4, 6)).astype(np.float32), rng.normal(size=(4, 5 + 4, 4)).astype(np.float32)
    codes = playing.codes(flow(), pose, audio)
    samples = flow().sample(torch.from_numpy(codes), torch.from_numpy(pose[:, :5]), torch.from_numpy(audio))
    np.testing.assert_allclose(samples.numpy(), pose[:, 5:], atol=1e-4)


@pytest.mark.parametrize("name", ["moglow", "gesticulator", "seq2seq", "speech2gesture"])
def test_networks_of_every_kind_make_the_frames_of_a_window(store, name):
    """A flow; one that feeds poses back, with history and look-ahead; one of words; one of windows of speech."""
    from cospeech.training.checkpoint import network

    kind, excerpts = network(name), Excerpts(store)
    config = kind.Config.tiny(**({"history": 4, "look_ahead": 2} if name == "moglow" else {}))
    with torch.random.fork_rng():
        torch.random.manual_seed(0)
        net = kind(config, pose=27, audio=len(AUDIO_NAMES)).eval()
    flat = {f"{what}_{moment}": np.full(width, value) for what, width in (("pose", 27), ("audio", len(AUDIO_NAMES)))
            for moment, value in (("mean", 0.0), ("std", 1.0))}  # fmt: skip
    facts = {"config": vars(config), "recipe": {"data": {}}, "store": {"speakers": SPEAKERS}}
    player = PlayableRun(net, facts, flat, name, np.zeros((3, 1, 64, 27)))
    which = np.array([0, 20, 41])
    windows = generate_windows(player, excerpts, seed=3, which=which)
    assert windows.shape == (3, excerpts.protocol.made, 27)
    assert np.isfinite(windows).all()
    if name != "moglow":  # which draws
        np.testing.assert_allclose(generate_windows(player, excerpts, seed=4, which=which[1:]), windows[1:], atol=1e-5)
    before, after = {"moglow": (4, 2), "gesticulator": (3, 4)}.get(name, (excerpts.protocol.given, 0))
    assert find_context(player, excerpts.protocol.given) == (before, after)

    class Blind(StoreInputs):
        """Hides all recorded poses but those before the frames that are made."""

        def gather(self, *given):
            rows = super().gather(*given)
            return rows | {"pose": np.where(np.arange(rows["pose"].shape[1])[:, None] < before, rows["pose"], 0)}

    excerpts.__dict__["inputs"] = Blind(excerpts.store)
    np.testing.assert_array_equal(generate_windows(player, excerpts, seed=3, which=which), windows)


# the way as a whole -------------------------------------------------------------------------------------------------------


def test_a_table_from_nothing_and_again_from_what_is_kept(table_runs, runs, tmp_path):
    messages: list[str] = []
    table = make_table("flow-2", replace(table_runs, tell=messages.append), seeds=(0, 1), tell=messages.append)
    assert len(table["rows"]) == 4
    for cells in (row["cells"] for row in table["rows"].values()):
        for metric in ("fgd", "pck_gfge", "pck", "diversity"):
            assert len(cells[metric]["values"]) == 2
            assert np.isfinite(cells[metric]["mean"])
        assert 0 < cells["pck"]["mean"] < cells["pck_gfge"]["mean"] <= 1  # what was given is right
        assert len(cells["nll"]["draws"]) == 200
        assert np.isfinite([cells["nll"]["mean"], cells["hearing_gain"]["mean"]]).all()
        assert "--raw" in cells["beat_align"]["why"]
    truth, noise = table["controls"]["ground truth"], table["controls"]["white noise"]
    assert truth["fgd"]["mean"] == pytest.approx(0, abs=1e-9)
    assert noise["fgd"]["mean"] > 1e-6  # of a network of two steps
    assert truth["pck"]["mean"] == 1
    assert "mean" in table["controls"][STILL]["nll"]
    assert "draws" not in table["controls"][STILL]["nll"]
    assert "likelihood" in truth["nll"]["why"]
    assert "made up" in table["head"]
    assert any("step 2 of 2" in text for text in messages)
    assert {verdict["verdict"] for verdict in table["verdicts"]} <= {UNDECIDED, NOT_ASSAYED}  # two seeds

    del messages[:]
    assert make_table("flow-2", replace(table_runs, tell=messages.append), seeds=(0, 1), tell=messages.append) == table
    assert not any("step" in text for text in messages)

    part = make_table("flow-2", table_runs, seeds=(0, 1), only=("baseline", "global"), tell=lambda text: None)
    assert {name for name, row in part["rows"].items() if "cells" in row} == {"without global encoder", "baseline"}
    assert {k: v for k, v in table["rows"].items() if "cells" in part["rows"][k]} == {
        k: v for k, v in part["rows"].items() if "cells" in v
    }
    assert "(not run)" in to_text(part)
    assert "(not run)" not in to_text(table)

    data, page = write_table(table, tmp_path)
    assert json.loads(data.read_text()) == table
    for text in (page.read_text(), to_text(table)):
        assert "(4.62)" in text
        assert "not comparable" in text
        assert NOT_ASSAYED in text or UNDECIDED in text
    draw_table(table, table_runs, tmp_path / "strip.png")
    with Image.open(tmp_path / "strip.png") as picture:
        assert picture.width == 1600
        assert len(picture.getcolors(picture.width * picture.height)) > 50


def test_headroom_is_told_before_anything_is_trained(store, table_runs, tmp_path):
    other = tmp_path / "ted"
    shutil.copytree(store, other)
    arrays = np.load(other / "pose.npy", mmap_mode="r+")
    arrays[:] = arrays[::-1].copy()
    arrays.flush()
    messages: list[str] = []
    table = make_table("flow-2", replace(table_runs, oracle=other), trained=False, tell=messages.append)
    assert not any("row" in text.split(":")[0] and "seed" in text for text in messages)
    assert all("cells" not in row for row in table["rows"].values())
    assert table["verdicts"] == []
    assert table["controls"][ORACLE]["pck"]["mean"] < 1
    assert "frozen pose" in table["headroom"]["fgd"]
    assert "headroom of FGD" in to_text(table)
    pieces = [piece(f"{n}-x", n, s, 200, 1) for n in SPEAKERS for s in ("train", "test")]
    write_store(tmp_path / "else", pieces, corpus="ted", pose="direction-vectors", fps=FPS, names=NAMES)
    for oracle, problem in (("else", "other clips"), ("nowhere", "is not a store")):
        messages.clear()
        with pytest.raises(InputError, match=problem):
            make_table("flow-2", replace(table_runs, oracle=tmp_path / oracle), trained=False, tell=messages.append)
        assert not messages  # before any work


def test_the_perceptual_loss_hears_the_fourth_layer_of_its_own_autoencoder(table_runs):
    net = table_runs.player("flow_ted").net
    assert type(net.omega[0]).__name__ == "Omega"
    assert table_runs.player("flow_ted_no_perceptual").net.omega == []


@pytest.mark.parametrize("change", ["data.per_clip_normalisation=true", "model.style=8"])
def test_what_tables_cannot_play_is_not_trained(table_runs, change):
    with pytest.raises(InputError, match=r"per_clip_normalisation or model\.style"):
        replace(table_runs, overrides=(change,)).recipe("flow_ted")


def test_a_changed_recipe_is_another_run(table_runs):
    other = replace(table_runs, overrides=("model.hidden=9",))
    assert other.folder_of("flow_ted", 0) != table_runs.folder_of("flow_ted", 0)
    assert table_runs.folder_of("flow_ted", 1) != table_runs.folder_of("flow_ted", 0)
    assert other.folder_of(f"{FEATURES}_ted", 0) == table_runs.folder_of(f"{FEATURES}_ted", 0)
    assert replace(table_runs, threads=2).folder_of("flow_ted", 0) == table_runs.folder_of("flow_ted", 0)


def test_a_change_can_be_of_one_recipe(table_runs):
    other = replace(table_runs, overrides=("model.hidden=9", "flow_ted:model.hidden=10"))
    assert [other.recipe(name).config["hidden"] for name in ("flow_ted", "flow_ted_baseline")] == [10, 9]
    assert other.recipe("flow_ted", more=("model.history=3",)).config["history"] == 3
    with pytest.raises(InputError, match=r"of no recipe.*flow_ted"):
        replace(table_runs, overrides=("flow_tet:model.hidden=9",)).recipe("moglow_ted")


def test_a_stopped_table_says_how_it_goes_on(table_runs, tmp_path, monkeypatch):
    messages: list[str] = []
    saving = replace(table_runs, runs=tmp_path, overrides=(*table_runs.overrides, "train.save_every=1"), tell=messages.append)

    def stop(_: object, run: object, end: bool) -> None:
        if run.steps_done == 2:
            signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr("cospeech.training.train._Rows.step", stop)
    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # behind an & Ctrl-C is ignored
    try:
        with pytest.raises(KeyboardInterrupt):
            saving.run("flow_ted_baseline", 5)
    finally:
        signal.signal(signal.SIGINT, before)
    assert messages[-1] == "saved at step 1: run the same command again to go on"


def test_a_run_that_was_cut_off_goes_on(table_runs, tmp_path):
    import shutil

    whole = table_runs.run("flow_ted_baseline", 5)
    other = replace(table_runs, runs=tmp_path)
    folder = other.folder_of("flow_ted_baseline", 5)
    cut_off(other, "flow_ted_baseline", 5)
    assert (folder / "last.safetensors").exists()
    assert other.run("flow_ted_baseline", 5) == folder
    assert (folder / "best.safetensors").read_bytes() == (whole / "best.safetensors").read_bytes()
    shutil.rmtree(tmp_path)


def test_what_matters_in_play_alone_tells_runs_apart(table_runs):
    changes = ("moglow_ted:model.latent_scale=0.1",)
    plain, small = (replace(table_runs, overrides=own).player("moglow_ted", 0) for own in ((), changes))
    for one, other in zip(plain.net.parameters(), small.net.parameters(), strict=True):
        assert torch.equal(one, other)
    assert plain.fingerprint != small.fingerprint


def test_a_changed_perceptual_network_makes_other_rows(table_runs):
    changed_runs = replace(table_runs, overrides=(f"{OMEGA}_ted:train.steps=3",))
    assert changed_runs.folder_of("flow_ted", 0) != table_runs.folder_of("flow_ted", 0)
    assert changed_runs.folder_of("moglow_ted", 0) == table_runs.folder_of("moglow_ted", 0)  # it needs none
    assert not changed_runs.is_done("flow_ted", 0)


def test_a_run_goes_on_where_its_folder_has_another_path(store, recipes, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    cut_off(Runs(store, "mine", recipes, threads=1), "flow_ted", 0)
    whole = Runs(store, tmp_path / "mine", recipes, threads=1)
    assert whole.run("flow_ted", 0).is_dir()
    assert whole.is_done("flow_ted", 0)


def test_scores_are_of_the_data_as_it_is(store, tmp_path):
    copy = tmp_path / "ted"
    shutil.copytree(store, copy)
    digests = [Runs(copy, tmp_path).digest_data(None)]
    sound = np.load(copy / "audio.npy")
    np.save(copy / "audio.npy", sound[::-1])
    digests.append(Runs(copy, tmp_path).digest_data(None))
    (tmp_path / "raw").mkdir()
    (tmp_path / "raw" / "a.wav").write_bytes(b"12")
    digests.append(Runs(copy, tmp_path).digest_data(tmp_path / "raw"))
    (tmp_path / "raw" / "a.wav").write_bytes(b"123")
    digests.append(Runs(copy, tmp_path).digest_data(tmp_path / "raw"))
    assert len({*digests}) == 4


def test_clusters_of_latents_and_their_map(table_runs, tmp_path):
    table = make_table("flow-3", table_runs, seeds=(0,), tell=lambda text: None)
    assert [*table["controls"]] == ["mean pose, no model", "white noise"]
    for cells in [row["cells"] for row in table["rows"].values()] + [*table["controls"].values()]:
        assert cells["chi"]["mean"] > 0
        assert -1 <= cells["silhouette"]["mean"] <= 1
    draw_table(table, table_runs, tmp_path / "map.png")
    with Image.open(tmp_path / "map.png") as picture:
        assert picture.width > 1000
    with pytest.raises(InputError, match="png"):
        draw_table(table, table_runs, tmp_path / "map.gif")


def run(*arguments: object):
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


def test_on_the_command_line(store, recipes, runs, tmp_path):
    out = tmp_path / "table.json"
    common = ["evaluate", "--store", store, "--recipes", recipes, "--runs", runs, "--threads", "1"]
    result = run(*common, "--table", "flow-2", "--seeds", "0,1", "--about", "made up", "--out", out)
    assert result.exit_code == 0, result.output
    assert "without global encoder" in result.output
    assert json.loads(out.read_text())["seeds"] == [0, 1]
    assert (runs / "flow-2-direction-vectors.md").is_file()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--table", "flow-9"], "flow-9"),
        (["--table", "flow-2", "--seeds", "0,a"], "--seeds"),
        (["--table", "flow-2", "--seeds", "0,0"], "each once"),
        (["--table", "flow-2", "--rows", "basement"], "baseline"),
        (["rules", "--table", "flow-2"], "rules"),
        (["--table", "flow-2", "--recipes", "nowhere"], "--recipes"),
        (["--table", "flow-2", "--set", "fgd_ted:train.stps=3", "--seeds", "7"], "stps"),
        (["--table", "flow-2", "--set", "camn_beat:train.steps=3", "--seeds", "7"], "no row of this table has the recipe"),
        (["--table", "flow-2", "--set", "train.stps=3", "--headroom"], "stps"),
        (["--table", "flow-2", "--set", "model.widht=3", "--seeds", "7"], "widht"),
    ],
)
def test_wrong_words_on_the_command_line(store, recipes, runs, arguments, message):
    common = ["--store", store, "--runs", runs, "--threads", "1"]
    recipes_too = [] if "--recipes" in arguments else ["--recipes", recipes]
    result = CliRunner().invoke(app, [str(a) for a in ["evaluate", *arguments, *common, *recipes_too]])
    output = result.output + str(result.exception)
    assert result.exit_code != 0
    assert message in output


def test_markdown_has_a_cell_for_every_column(table_runs):
    page = to_markdown(make_table("flow-2", table_runs, seeds=(0,), tell=lambda text: None))
    rows = [line for line in page.splitlines() if line.startswith("|")]
    assert {line.count("|") for line in rows} == {len(TABLES["flow-2"].columns) + 2}


# pictures -----------------------------------------------------------------------------------------------------------------


def test_tsne_keeps_groups_apart():
    rng = np.random.default_rng(0)
    labels = np.repeat(np.arange(4), 25)
    points = rng.normal(size=(4, 12))[labels] * 4 + rng.normal(size=(100, 12))
    picture = tsne(points)
    assert picture.shape == (100, 2)
    assert silhouette_coefficient(picture, labels) > 0.7
    np.testing.assert_array_equal(tsne(points), picture)
    assert np.isfinite(tsne(points[:8])).all()
    assert np.isfinite(tsne(np.zeros((10, 3)))).all()
    for bad in (points[:3], np.full((9, 2), np.nan), points[0]):
        with pytest.raises(InputError, match="t-SNE"):
            tsne(bad)


def test_stick_figures():
    body = DIRECTION_VECTORS.decode(poses(40, 1)).values
    from cospeech.motion.skeletons.ted import JOINTS, PARENTS

    one = Sticks("one", body, PARENTS, JOINTS)
    assert [JOINTS[k] for k in one.hands] == ["leftWrist", "rightWrist"]
    assert JOINTS[one.head] == "head"
    assert one.colour(5) != one.colour(8) != one.colour(2)
    sheet = draw_sticks([one, replace(one, label="two\nlines")], FPS, cells=4, width=700)
    assert sheet.shape[1:] == (700, 3)
    np.testing.assert_array_equal(sheet, draw_sticks([one, replace(one, label="two\nlines")], FPS, cells=4, width=700))
    with pytest.raises(InputError, match="rows of one length"):
        draw_sticks([one, replace(one, positions=body[:30])], FPS)
    with pytest.raises(InputError, match="name and parent"):
        Sticks("one", body, PARENTS, JOINTS[:3])


@pytest.mark.parametrize("name", ["expmap-upper", "expmap-full"])
def test_stick_figures_of_rotations_have_no_loose_bones(name):
    from types import SimpleNamespace

    from cospeech.experiments.tables.figures import _sticks
    from cospeech.motion.poses import find_pose

    pose = find_pose(name)
    excerpts = SimpleNamespace(pose=pose, store=SimpleNamespace(fps=20.0, pose=name))
    sticks = _sticks(excerpts, "x", np.zeros((12, pose.dimensions)))
    assert len(sticks.names) == len(pose.joints) + 1
    assert [*sticks.parents].count(-1) == 1
    assert all(parent < k for k, parent in enumerate(sticks.parents))
    assert len(sticks.hands) == 2
    assert sticks.head is not None


def test_maps_show_every_group():
    points, groups = np.random.default_rng(0).normal(size=(40, 2)), [f"s{k % 20:02}" for k in range(40)]
    sheet = draw_map([Panel("a", "", points, groups), Panel("b", "x", points * 100, groups)])
    assert sheet.shape[0] > 500
    colours = {tuple(c) for c in sheet[:, -160:].reshape(-1, 3)}
    assert len(colours) > 20
    with pytest.raises(InputError, match="group"):
        Panel("a", "", points, groups[:3])
    with pytest.raises(InputError, match="panel"):
        draw_map([])


# plans --------------------------------------------------------------------------------------------------------------------


def experiments():
    spec = spec_from_file_location("run_experiments", ROOT / "tools" / "run_experiments.py")
    module = module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def plan(store, recipes, runs, tmp_path) -> Path:
    text = f"""
runs = {json.dumps(str(runs))}
[[table]]
name = "flow-2"
store = {json.dumps(str(store))}
recipes = {json.dumps(str(recipes))}
rows = ["baseline", "global"]
seeds = [0, 1]
set = ["train.batch=3"]
"""
    (tmp_path / "plan.toml").write_text(text)
    return tmp_path / "plan.toml"


def test_the_next_run_begins_as_soon_as_one_of_several_ends(plan, monkeypatch):
    """Once, a long run held back all others, because only the oldest process was waited for."""
    tool, events = experiments(), []

    class Process:
        """A run; the first one ends after all others."""

        def __init__(self, command, **alone):
            self.job, self.returncode = int(command[-1]), None
            events.append(f"begin {self.job}")

        def poll(self):
            if self.job or len(events) == 7:
                self.returncode = 0
                events.append(f"end {self.job}")
            return self.returncode

    monkeypatch.setattr(tool.subprocess, "Popen", Process)
    monkeypatch.setattr(tool, "sleep", lambda seconds: None)
    whole_plan = tool.Plan.load(plan)
    tool.train_apart(whole_plan, whole_plan.jobs(), jobs=2)
    assert events == ["begin 0", "begin 1", "end 1", "begin 2", "end 2", "begin 3", "end 3", "end 0"]


def test_runs_end_when_one_of_them_fails(plan, monkeypatch):
    tool, ends = experiments(), []

    class Process:
        """A run; the second one fails at once."""

        def __init__(self, command, **alone):
            self.job, self.returncode = int(command[-1]), None

        def poll(self):
            self.returncode = 3 if self.job == 1 else None
            return self.returncode

        def terminate(self):
            ends.append(self.job)

        def wait(self):
            ends.append(self.job)

    monkeypatch.setattr(tool.subprocess, "Popen", Process)
    whole_plan = tool.Plan.load(plan)
    with pytest.raises(CospeechError, match="seed 0 ended with code 3"):
        tool.train_apart(whole_plan, whole_plan.jobs(), jobs=2)
    assert ends == [0, 0]


SAVING_RUN = """
import os, pathlib, signal, sys
stops = {signal.SIGINT, signal.SIGTERM, signal.SIGHUP}
signal.pthread_sigmask(signal.SIG_BLOCK, stops)
place = pathlib.Path(sys.argv[1])
place.with_name("ready").open("w" if sys.argv[-1] == "1" else "r").close()  # a pipe: both are ready
if sys.argv[-1] == "0":
    os.kill(os.getppid(), signal.Signals[place.with_name("signal").read_text()])
came = signal.sigwait(stops)
place.with_name(f"saved.{sys.argv[-1]}").write_text(f"{came.name} {os.getpgrp() == os.getpid()}")
"""


@pytest.mark.slow
@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM", "SIGHUP"])
def test_a_signal_reaches_each_run_once(plan, monkeypatch, name):
    """Ctrl-C came from the terminal and from the program; the second one ended a run before it had saved itself."""
    tool = experiments()
    os.mkfifo(plan.with_name("ready"))
    plan.with_name("signal").write_text(name)
    plan.with_name("run.py").write_text(SAVING_RUN)
    monkeypatch.setattr(tool, "__file__", str(plan.with_name("run.py")))
    monkeypatch.setattr(tool, "POLL", 0.01)
    before = signal.signal(signal.Signals[name], signal.default_int_handler)
    parsed_plan = tool.Plan.load(plan)
    try:
        with pytest.raises(KeyboardInterrupt):
            tool.train_apart(parsed_plan, parsed_plan.jobs(), jobs=2)
    finally:
        signal.signal(signal.Signals[name], before)
    assert [plan.with_name(f"saved.{k}").read_text() for k in (0, 1)] == ["SIGTERM True"] * 2


def test_windows_gets_a_group_of_its_own_and_a_signal_that_a_run_can_hear(monkeypatch):
    monkeypatch.setattr(sys, "platform", "win32")
    monkeypatch.setattr(signal, "CTRL_BREAK_EVENT", 1, raising=False)
    monkeypatch.setattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0x200, raising=False)
    tool, signals = experiments(), []
    tool.stop(SimpleNamespace(send_signal=signals.append))
    assert (tool.ALONE, signals) == ({"creationflags": 0x200}, [1])


@pytest.mark.slow
def test_a_plan_is_trained_scored_and_packed_and_then_there_is_nothing_left(plan, runs, capsys):
    tool = experiments()
    assert tool.main([str(plan), "--list"]) == 0
    assert [line.split()[0] for line in capsys.readouterr().out.splitlines()] == ["left"] * 4
    assert tool.main([str(plan), "--pack", str(plan.parent / "kept.tar.gz")]) == 0
    out, err = capsys.readouterr()
    assert "0 of 4 runs are there" in err
    assert "run 4 of 4" in err
    assert "without global encoder" in out
    (table,) = runs.glob("flow-2-*-part.json")
    assert len(json.loads(table.read_text())["rows"]["baseline"]["cells"]["fgd"]["values"]) == 2
    with tarfile.open(plan.parent / "kept.tar.gz") as archive:
        names = archive.getnames()
    assert table.name in names
    assert not any(name.endswith(".safetensors") for name in names)
    assert tool.main([str(plan), "--list"]) == 0
    assert [line.split()[0] for line in capsys.readouterr().out.splitlines()] == ["done"] * 4


def test_tables_of_a_plan_can_be_chosen(plan, capsys):
    tool = experiments()
    text = plan.read_text()
    plan.write_text(
        text + text.partition("\n[[table]]")[2].join(["[[table]]", ""]).replace("flow-2", "flow-3").replace("rows", "#")
    )
    whole = tool.Plan.load(plan)
    assert [entry["name"] for entry in whole.only([]).tables] == ["flow-2", "flow-3"]
    assert [entry["name"] for entry in whole.only(["flow-3"]).tables] == ["flow-3"]
    assert tool.main([str(plan), "--only", "flow-9", "--list"]) == 2
    assert "flow-9" in capsys.readouterr().err
    assert tool.main([str(plan), "--only", "flow-3", "--list"]) == 0
    assert "flow-2" not in capsys.readouterr().out


def test_all_rows_get_a_seed_before_the_next(plan):
    jobs = experiments().Plan.load(plan).jobs()
    assert [job.seed for job in jobs] == [0, 0, 1, 1]
    assert len({job.recipe for job in jobs[:2]}) == 2


@pytest.mark.slow
@pytest.mark.parametrize("interrupt", [signal.default_int_handler, signal.SIG_IGN], ids=["foreground", "background"])
def test_a_budget_ends_a_run_and_the_next_call_goes_on(store, recipes, tmp_path, capsys, interrupt):
    text = f"""
runs = "runs"
[[table]]
name = "flow-2"
store = {json.dumps(str(store))}
recipes = {json.dumps(str(recipes))}
rows = ["baseline"]
seeds = [0]
set = ["train.steps=100000", "train.save_every=100000"]
"""
    (tmp_path / "plan.toml").write_text(text)
    tool = experiments()
    handlers = {number: signal.getsignal(number) for number in (signal.SIGALRM, signal.SIGINT)}
    signal.signal(signal.SIGINT, interrupt)
    try:
        assert tool.main([str(tmp_path / "plan.toml"), "--budget", "4s"]) == 130
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
    err = capsys.readouterr().err
    assert "saved at step" in err
    assert "goes on" in err


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("runs = 'x'", "no runs or no"),
        ("runs = 'x'\n[[table]]\nname = 'flow-2'\nstore = 's'\nseds = [1]", "seds"),
        ("runs = 'x'\n[[table]]\nname = 'flow-2'\nstore = 's'", "has no 'seeds'"),
        ("runs = ", "cannot read"),
    ],
)
def test_a_plan_with_a_mistake_says_it(tmp_path, capsys, text, problem):
    (tmp_path / "plan.toml").write_text(text)
    assert experiments().main([str(tmp_path / "plan.toml"), "--list"]) == 2
    assert problem in capsys.readouterr().err


def test_plans_that_come_with_the_project_are_whole(capsys):
    tool = experiments()
    for path in sorted((ROOT / "benchmarks" / "experiments").glob("*.toml")):
        for entry in tool.Plan.load(path).tables:
            assert entry["name"] in TABLES
            assert len(entry["seeds"]) >= 4
            for change in entry.get("set", ()):
                assert "=" in change


# systems of windows -------------------------------------------------------------------------------------------------------

WINDOW_SYSTEMS = ("Seq2Seq", "Speech2Gesture", "JEM", "Trimodal Context", "Speech2AffectiveGestures")


@pytest.mark.slow
def test_systems_of_windows_make_the_frames_that_flows_make(table_runs):
    table = make_table("flow-1", table_runs, seeds=(0,), only=WINDOW_SYSTEMS, tell=lambda text: None)
    for name in WINDOW_SYSTEMS:
        cells = table["rows"][name]["cells"]
        assert all("mean" in cells[metric] for metric in ("fgd", "pck_gfge", "pck", "diversity", "multimodality")), name
        assert (cells["multimodality"]["mean"] > 0) is (name in ("JEM", "Trimodal Context", "Speech2AffectiveGestures"))
    assert "not built" not in to_text(table)
    excerpts = Excerpts(table_runs.folder)
    player = table_runs.player("seq2seq_ted", 0)
    which = np.arange(3)
    one, other = (generate_windows(player, excerpts, seed=seed, which=which) for seed in (0, 1))
    assert one.shape == (3, 30, 27)
    assert np.array_equal(one, other)  # it has no noise
    cut = table_runs.player("trimodal_ted", 0)
    speakers = [excerpts.speakers()[k] for k in which]
    longer = generate_rows(cut, excerpts.inputs, excerpts.starts[:3], 75, speakers, seed_frames=4, seed=0)
    assert longer.shape == (3, 75, 27)
    np.testing.assert_allclose(longer[:, :30], generate_windows(cut, excerpts, seed=0, which=which), atol=1e-5)


def test_a_store_without_samples_says_so_in_the_rows_that_need_them(store, table_runs, tmp_path):
    bare = tmp_path / "bare"
    shutil.copytree(store, bare)
    index = json.loads((bare / "index.json").read_text())
    del index["arrays"]["waveform"], index["names"]["waveform"]
    for clip in index["clips"]:
        clip["has"].remove("waveform")
    (bare / "index.json").write_text(json.dumps(index))
    runs = replace(table_runs, folder=bare)
    row = next(row for row in ROWS if row.name == "JEM")
    result, _ = making._row(row, None, TABLES["flow-1"], runs, (0,), lambda text: None, "row 1 of 1")
    assert result["missing"] == "the store was prepared without --waveform"
