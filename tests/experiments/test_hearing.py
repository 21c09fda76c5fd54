"""Hearing gain: a network that follows the speech of its corpus has one, a network that never saw the speech move has none."""

from __future__ import annotations

import json
import shutil

import numpy as np
import pytest
from typer.testing import CliRunner

from cospeech.audio.features.frames import AUDIO_NAMES
from cospeech.cli.main import app
from cospeech.corpora.store import Entry
from cospeech.corpora.store_writer import Piece, write_store
from cospeech.errors import CospeechWarning, InputError
from cospeech.motion.poses.direction_vectors import DIRECTION_VECTORS

torch = pytest.importorskip("torch")

from cospeech.experiments.hearing import describe_hearing, measure_hearing  # noqa: E402
from cospeech.training.recipe import SHIPPED, load_recipe  # noqa: E402
from cospeech.training.train import train  # noqa: E402

pytestmark = pytest.mark.slow

SMALL = ["model.steps=2", "model.hidden=16", "model.layers=1", "model.frames=8", "train.batch=32"]
BRIEF = ["train.steps=150", "train.schedule='constant'", "train.lr=0.01", "train.validate_every=0", "train.save_every=150"]


@pytest.fixture(scope="module", params=[1.0, 0.0], ids=["follows", "deaf"])
def run(request, tmp_path_factory):
    """A store whose poses follow the speech, or do not; and a small MoGlow that was trained on it."""
    folder = tmp_path_factory.mktemp("hearing")
    towards = np.random.default_rng(0).normal(size=(len(AUDIO_NAMES), len(DIRECTION_VECTORS.names))) / 6

    def piece(speaker: str, split: str, seed: int) -> Piece:
        rng = np.random.default_rng(seed)
        audio = rng.normal(size=(600, len(AUDIO_NAMES)))
        noise = rng.normal(size=(600, len(DIRECTION_VECTORS.names)))
        pose = request.param * audio @ towards + (0.2 if request.param else 1.0) * noise
        values = {"pose": pose.astype(np.float32), "audio": audio.astype(np.float32)}
        return Piece(Entry(f"{speaker}-{split}", speaker, split, 0, 600, 0.0, tuple(values)), (), lambda: dict(values))

    pieces = [piece(name, split, k) for k, (name, split) in enumerate((n, s) for n in "abc" for s in ("train", "test"))]
    names = {"pose": DIRECTION_VECTORS.names, "audio": AUDIO_NAMES}
    write_store(folder / "store", pieces, corpus="ted", pose="direction-vectors", fps=15.0, names=names)
    recipe = load_recipe(SHIPPED / "moglow_ted.toml", [*SMALL, *BRIEF])
    train(recipe, folder / "store", folder / "run")
    return folder, bool(request.param)


def test_a_network_that_follows_the_speech_has_a_gain_and_one_that_cannot_has_none(run):
    folder, follows = run
    measures = measure_hearing(folder / "run", folder / "store", batches=6, rows=32)
    assert measures == measure_hearing(folder / "run", folder / "store", batches=6, rows=32)
    (likelihood,) = [each for each in measures if "nll" in each.term]
    assert likelihood.gain == pytest.approx(likelihood.other - likelihood.own)
    if follows:
        assert likelihood.gain > 3 * likelihood.half
    else:
        assert likelihood.gain < 2 * likelihood.half


def test_the_command_prints_it(run):
    folder, _ = run
    call = ["evaluate", f"mine={folder / 'run'}", "--corpus", str(folder / "store"), "--hearing"]
    result = CliRunner().invoke(app, [*call, "--json"])
    assert result.exit_code == 0, result.output
    assert {"term", "own", "other", "gain", "half"} == {*json.loads(result.output)["mine"][0]}
    result = CliRunner().invoke(app, ["evaluate", "--corpus", str(folder / "store"), "--hearing"])
    assert "without a run" in str(result.exception)


def test_what_cannot_be_measured_is_said(run, tmp_path):
    folder, _ = run
    with pytest.raises(InputError, match="two of each"):
        measure_hearing(folder / "run", folder / "store", batches=1)
    with pytest.raises(InputError, match="not a run"):
        measure_hearing(tmp_path, folder / "store")
    config = json.loads((folder / "run" / "config.json").read_text("utf-8"))
    config["store"]["speakers"] = ["x", "y", "z"]
    shutil.copytree(folder / "run", tmp_path / "run")
    (tmp_path / "run" / "config.json").write_text(json.dumps(config))
    with pytest.warns(CospeechWarning, match="'run' was trained with the speakers x, y, z; this store has a, b, c: "):
        measure_hearing(tmp_path / "run", folder / "store", batches=2, rows=8)
    assert "no loss depends" in describe_hearing({"still": []})
