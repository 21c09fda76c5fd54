"""From a corpus in PATS' layout to speech that plays: every network by windows, its bundle, motion and key points."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="training needs torch (the train extra)")
pytest.importorskip("h5py", reason="PATS' reader needs cospeech[corpora]")

import cospeech  # noqa: E402
from cospeech import InputError, Motion, Speech  # noqa: E402
from cospeech.corpora import Clip  # noqa: E402
from cospeech.corpora.pats import read as pats  # noqa: E402
from cospeech.corpora.prepare import prepare  # noqa: E402
from cospeech.corpora.store import Store  # noqa: E402
from cospeech.motion.points import Points  # noqa: E402
from cospeech.motion.poses import find_pose  # noqa: E402
from cospeech.motion.poses.lift import lift  # noqa: E402
from cospeech.runtime.bundles.bundle import read_bundle  # noqa: E402
from cospeech.runtime.bundles.spec import read_spec  # noqa: E402
from cospeech.runtime.system import open_bundle  # noqa: E402
from cospeech.training.export.bundles import bundle_run  # noqa: E402
from cospeech.training.recipe import SHIPPED, load_recipe, read_recipe  # noqa: E402
from cospeech.training.train import train  # noqa: E402
from tests.support.runtime_bundles import write_small  # noqa: E402
from tests.support.windowed_networks import KINDS  # noqa: E402

ROOT = Path(__file__).resolve().parents[2]
BODY = ("body", "hands")


def talk(seconds: float, seed: int = 0, rate: int = 16_000) -> Speech:
    """Noise in bursts (synthetic)."""
    t = np.arange(round(seconds * rate)) / rate
    noise = np.random.default_rng(seed).normal(size=len(t))
    return Speech((0.1 * noise * np.maximum(np.sin(2 * np.pi * 2.5 * t), 0)).astype(np.float32), rate)


def waving(frames: int, seed: int) -> Points:
    """Key points that wander by some pixels around the T-pose's (synthetic)."""
    body = cospeech.motion.skeleton.humanoid()
    rest = Motion(15.0, np.tile([1.0, 0, 0, 0], (1, len(body), 1)), body.offsets[:1].copy())
    way = np.cumsum(np.random.default_rng(seed).normal(0, 3, (frames, 52, 2)), 0)
    way[:, 0] = 0
    values = pats.points_of(rest).values + way
    values[:, 1] = values[:, 0] + [-166, 1]
    return Points(15.0, values, "pats")


@pytest.fixture(scope="module")
def store(tmp_path_factory) -> Store:
    folder = tmp_path_factory.mktemp("pats")
    clips = [
        Clip(f"{k}", name, "made", talk(9, k), points=waving(135, k), split="validation" if k > 3 else "train")
        for k, name in enumerate(("oliver", "noah") * 3)
    ]
    pats.write(clips, folder / "raw")
    prepare("pats", folder / "raw", folder / "store")
    return Store(folder / "store")


@pytest.fixture(scope="module")
def runs(store, tmp_path_factory) -> Path:
    return tmp_path_factory.mktemp("runs")


def start_run(store: Store, folder: Path, name: str, **data: object) -> Path:
    speakers = {"speakers": ["noah"]} if name in ("cmix-gan", "speech2gesture") else {}
    settings = {"steps": 3, "batch": 4, "threads": 1, "device": "cpu", "validate_every": 0, "save_every": 3}
    recipe = {"model": {"name": name, **KINDS[name]}, "data": {"audio": "log-mel-400", **speakers, **data}, "train": settings}
    train(read_recipe(recipe), store, folder)
    return folder


@pytest.mark.parametrize("name", ["stage", "cmix-gan", "speech-to-face"])
def test_a_network_by_windows_plays_speech(store, runs, name):
    """The others are bundled with rotations: test_bundle_export.py, test_chain_bundle_export.py."""
    path = runs / f"{name}.cospeech"
    bundle_run(start_run(store, runs / name, name), path, which="last")
    system = open_bundle(path)
    assert (system.audio, system.pose, system.fps, system.main_network.signature.width("rows")) == (
        "log-mel-400",
        "keypoints2d",
        15.0,
        64,
    )
    gesturer = cospeech.load(path)
    speech = talk(4.43, 9, 44_100)
    whole = gesturer.generate(speech, parts=BODY, fps=30)
    assert len(whole) == speech.frames(30) == 133
    assert np.isfinite(whole.rotations).all()
    assert np.abs(np.linalg.norm(whole.rotations, axis=-1) - 1).max() < 1e-5
    assert np.ptp(whole.rotations, 0).max() > 1e-5, "it moves, though little was learnt in three steps"
    pieces = [Speech(speech.samples[at : at + 5000], speech.rate) for at in range(0, len(speech), 5000)]
    parts = Motion.concatenate(list(gesturer.stream(pieces, parts=BODY, fps=30)))
    np.testing.assert_array_equal(parts.rotations, whole.rotations)
    points = gesturer.points(speech)
    assert (points.layout, points.fps, points.values.shape) == ("pats", 15.0, (speech.frames(15), 52, 2))
    motion = gesturer.generate(speech, parts=BODY, fps=15)
    np.testing.assert_allclose(lift(points).rotations, motion.rotations, atol=1e-5)
    rows = find_pose("keypoints2d").encode(points)
    s = system.statistics
    assert np.abs(rows.mean(0) - s.pose_mean).max() < 6 * s.pose_std.max(), "in the pixels of the training data"


def test_a_store_has_to_have_the_columns_that_audio_names(store, tmp_path):
    with pytest.raises(
        InputError, match=r"'mel64' is made of 84 columns 'mel0' …, the store has 64, 'log_mel_400\.0'.*log-mel-400"
    ):
        start_run(store, tmp_path / "run", "stage", audio="mel64")


def test_a_bundle_whose_audio_is_of_another_width_is_refused(store, runs, tmp_path):
    path = runs / "stage.cospeech"
    if not path.exists():
        bundle_run(start_run(store, runs / "stage", "stage"), path, which="last")
    bundle = read_bundle(path)
    bundle.manifest["audio"] = "mel29"
    with pytest.raises(InputError, match="'mel29'"):
        read_spec(bundle)


def test_points_are_of_systems_of_points(tmp_path):
    gesturer = cospeech.load(write_small(tmp_path / "it.cospeech"))
    with pytest.raises(InputError, match="not key points"):
        gesturer.points(talk(1.0))


def test_recipes_for_pats_say_what_they_hear():
    recipes = {path.stem: load_recipe(path) for path in SHIPPED.glob("*_pats*.toml")}
    features = {name: recipe.data.audio for name, recipe in recipes.items() if recipe.model in KINDS}
    assert set(features.values()) == {"log-mel-400"}
    assert len(features) >= 6
