"""Style transfer by latents: what the measures see in motion whose style is known, and what latents of an example do."""

from __future__ import annotations

from copy import deepcopy
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from cospeech.audio.features.frames import AUDIO_NAMES
from cospeech.corpora.store import Entry
from cospeech.corpora.store_writer import Piece, write_store
from cospeech.errors import InputError
from cospeech.experiments.tables import Runs, draw_table, make_table
from cospeech.experiments.tables.paper_tables import NAMED, NAMED_BY_ALL, REPLAY, SIZE, SIZE_RATIO
from cospeech.experiments.tables.runs import OMEGA, PlayableRun
from cospeech.experiments.tables.style_transfer import EXAMPLE, MADE, RANDOM, SCALED, StyleTransfers
from cospeech.motion.points import Points
from cospeech.motion.poses.direction_vectors import BONES, DIRECTION_VECTORS
from tests.support.tiny_recipes import write_tiny_recipes

torch = pytest.importorskip("torch")

FPS, FRAMES = 15.0, 2 * MADE
SPEAKERS = {"ann": (0.4, 0.2), "bob": (0.9, 0.4), "cleo": (2.0, 0.8)}  # Hz and size of their movement
SIZES = {
    "stylised-flow": {
        "steps": 2,
        "hidden": 8,
        "layers": 1,
        "encoder_channels": 4,
        "encoder_blocks": 1,
        "feature": 4,
        "frames": 8,
    },
    "gesture-autoencoder": {"width": 8, "code": 4, "frames": 16},
}


def swing(frames: int, hertz: float, size: float, seed: int) -> np.ndarray:
    """(T, 27) direction vectors of bones that swing about."""
    rng = np.random.default_rng(seed)
    phases = 2 * np.pi * hertz * np.arange(frames)[:, None, None] / FPS + rng.uniform(0, 6, (9, 3))
    bones = np.random.default_rng(0).normal(size=(9, 3)) + size * np.sin(phases) + rng.normal(0, 0.02, (frames, 9, 3))
    points = np.zeros((frames, 10, 3))
    for k, (start, end, length) in enumerate(BONES):
        points[:, end] = points[:, start] + length * bones[:, k] / np.linalg.norm(bones[:, k], axis=-1, keepdims=True)
    return DIRECTION_VECTORS.encode(Points(FPS, points, "ted"))


def piece(name: str, speaker: str, split: str, seed: int, manner: tuple[float, float], words: tuple[str, ...]) -> Piece:
    audio = np.random.default_rng(seed).normal(size=(FRAMES, len(AUDIO_NAMES))).astype(np.float32)
    values = {"pose": swing(FRAMES, *manner, seed).astype(np.float32), "audio": audio}
    if words:
        values["word"] = (1 + np.arange(FRAMES) * len(words) // FRAMES).astype(np.int32)  # 0 is silence
    return Piece(Entry(name, speaker, split, 0, FRAMES, 0.0, tuple(values)), words, lambda: dict(values))


def write(
    folder: Path, manners: dict[str, tuple[float, float]], fps: float = FPS, without_training: tuple[str, ...] = (),
    texts: int = 0, pieces: int = 2,
) -> Path:  # fmt: skip
    """A store of some pieces by each speaker in each split; piece k says text k, if there are texts."""
    rows = [
        piece(f"{name}-{split}-{k}", name, split, 100 * who + 10 * k + len(split), manner,
              tuple(f"{split}{k}word{n}" for n in range(20)) if texts else ())
        for who, (name, manner) in enumerate(manners.items())
        for split in ("train", "test")
        for k in range(pieces)
        if split == "test" or name not in without_training
    ]  # fmt: skip
    names = {"pose": DIRECTION_VECTORS.names, "audio": AUDIO_NAMES}
    write_store(folder, rows, corpus="ted", pose="direction-vectors", fps=fps, names=names)
    return folder


@pytest.fixture(scope="module")
def table_runs(tmp_path_factory) -> Runs:
    folder = tmp_path_factory.mktemp("transfer")
    recipes = folder / "recipes"
    recipes.mkdir()
    write_tiny_recipes(recipes, ("flow_ted", f"{OMEGA}_ted"), SIZES.__getitem__)
    return Runs(write(folder / "ted", SPEAKERS), folder / "runs", recipes, threads=1, about="made up")


def bench(runs: Runs) -> StyleTransfers:
    return StyleTransfers(None, None, runs, None)  # type: ignore[arg-type]


def attentive(player: PlayableRun) -> PlayableRun:
    """The run with other weights, so that its motion depends on history and speech; after two steps it hardly does."""
    net = deepcopy(player.net)
    generator = torch.Generator().manual_seed(0)
    with torch.no_grad():
        for weights in net.flow.parameters():
            if weights.ndim == 2 and weights.shape[0] != weights.shape[1]:
                weights += 0.1 * torch.randn(weights.shape, generator=generator)
    return replace(player, net=net)


def test_an_example_is_by_another_speaker_than_the_speech(table_runs):
    pieces = bench(table_runs).pieces
    assert len(pieces.speech) == 30  # six pieces, five examples for each, by two other speakers
    assert {int((pieces.who[pieces.example[k : k + 5]] == who).sum()) for k in range(0, 30, 5) for who in range(3)} == {0, 2, 3}
    assert (pieces.who[pieces.speech] != pieces.who[pieces.example]).all()
    assert (pieces.who[pieces.other] == pieces.who[pieces.example]).all()
    assert (pieces.other != pieces.example).all()
    again = bench(table_runs).pieces
    np.testing.assert_array_equal(pieces.example, again.example)


def test_an_example_says_other_words_than_the_speech(tmp_path):
    """All speakers say the same two texts."""
    folder = write(tmp_path / "ted", SPEAKERS, texts=2)
    pieces = bench(Runs(folder, tmp_path / "runs")).pieces
    clips = [pieces.excerpts.store.clips[k].name for k in pieces.excerpts.clips]
    assert all(clips[a][-1] != clips[b][-1] for a, b in zip(pieces.speech, pieces.example, strict=True))
    with pytest.raises(InputError, match="no other speaker says other words"):
        bench(Runs(write(tmp_path / "one", SPEAKERS, texts=1, pieces=1), tmp_path / "runs"))


def test_recordings_are_told_apart_by_manner_and_size(table_runs):
    transfers = bench(table_runs)
    controls = transfers.controls()
    for column in (NAMED, NAMED_BY_ALL):
        assert controls["ground truth"][column]["value"] == 1
        assert controls["another clip"][column]["value"] == 0
    assert controls["ground truth"][SIZE]["value"] > 0.95
    assert controls["another clip"][SIZE]["value"] < 0
    assert abs(controls["another clip"][REPLAY]["value"]) < 0.2
    assert controls["ground truth"][SIZE_RATIO]["value"] == pytest.approx(1, abs=0.05)
    assert transfers.faults(controls) == {}


def test_speakers_that_move_alike_decide_nothing(tmp_path):
    alike = Runs(write(tmp_path / "ted", dict.fromkeys(SPEAKERS, (1.0, 0.4))), tmp_path / "runs")
    transfers = bench(alike)
    faults = transfers.faults(transfers.controls())
    assert faults == {column: ["another clip is too near to tell from ground truth"] for column in (NAMED, NAMED_BY_ALL)}


def test_latents_of_an_example_give_it_back_under_its_own_speech_and_beginning(table_runs):
    pieces, player = bench(table_runs).pieces, attentive(table_runs.player("flow_ted", 0))
    speech, pieces.speech = pieces.speech, pieces.example
    np.testing.assert_allclose(pieces.perform(player, EXAMPLE, 0), pieces.poses[pieces.example], atol=0.003)
    assert pieces.score(pieces.perform(player, EXAMPLE, 0))[REPLAY].value > 0.99
    pieces.speech = speech
    assert np.abs(pieces.perform(player, EXAMPLE, 0) - pieces.poses[pieces.example]).mean() > 0.02


def test_a_motion_knows_the_example_by_its_latents_alone(table_runs):
    pieces, player = bench(table_runs).pieces, attentive(table_runs.player("flow_ted", 0))
    pieces.example = np.zeros_like(pieces.example)
    motions = pieces.perform(player, EXAMPLE, 0).reshape(6, 5, MADE, 27)  # five performances of each of six pieces of speech
    np.testing.assert_allclose(motions[:, 0], motions[:, 1], atol=1e-5)
    assert np.abs(motions[0, 0] - motions[1, 0]).mean() > 0.01


def test_latents_are_scaled_like_random_ones_in_one_row(table_runs):
    changes = ('model.name="stylised-flow-extended"', "model.latent_scale=0.5")
    changed_runs = replace(table_runs, overrides=tuple(f"flow_ted:{change}" for change in changes))
    pieces, plain, half = bench(table_runs).pieces, table_runs.player("flow_ted", 0), changed_runs.player("flow_ted", 0)
    first = [pieces.perform(player, SCALED, 0) for player in (plain, half)]
    np.testing.assert_array_equal(first[0], pieces.perform(plain, EXAMPLE, 0))
    assert not np.allclose(first[1], pieces.perform(half, EXAMPLE, 0), atol=0.01)


def test_the_table(table_runs, tmp_path):
    table = make_table("flow-figure-8", table_runs, seeds=(0,), tell=lambda text: None)
    assert [*table["rows"]] == [EXAMPLE, SCALED, RANDOM]
    for row in table["rows"].values():
        assert 0 <= row["cells"][NAMED]["mean"] <= 1
        assert -1 <= row["cells"][SIZE]["mean"] <= 1
    assert [verdict["verdict"] for verdict in table["verdicts"]] == ["not assayed"] * 4
    assert all("--raw" in verdict["because"] for verdict in table["verdicts"])  # nobody knows whether they follow the speech
    draw_table(table, table_runs, tmp_path / "poses.png")
    with Image.open(tmp_path / "poses.png") as picture:
        assert picture.width > 800


def test_speakers_whom_the_judges_cannot_know_are_left_out(table_runs, tmp_path):
    folder = write(tmp_path / "ted", SPEAKERS, without_training=("bob",))
    transfers = bench(replace(table_runs, folder=folder))
    assert transfers.pieces.speakers == ["ann", "cleo"]
    assert len(transfers.pieces.who) == 4
    assert "(2 of speakers without training recordings are left out)" in transfers.windows
    assert transfers.controls()["ground truth"][NAMED]["value"] == 1


def test_stores_that_do_not_fit(table_runs, tmp_path):
    one = replace(table_runs, folder=write(tmp_path / "one", {"ann": (1.0, 0.4)}))
    with pytest.raises(InputError, match=r"test pieces of 1 speaker .* \(two speakers at least\)"):
        bench(one)
    slow = replace(table_runs, folder=write(tmp_path / "slow", SPEAKERS, fps=12.0))
    with pytest.raises(InputError, match=r"at 12 fps \(direction-vectors at 15\)"):
        bench(slow)
