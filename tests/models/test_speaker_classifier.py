"""The classifier of the inception score: sizes, what it sees, that it learns who is who, and the score that is made with it."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="networks need torch (the train extra)")

from torch.nn import functional as F  # noqa: E402

from cospeech.corpora.store_files import Entry  # noqa: E402
from cospeech.corpora.store_writer import Piece, write_store  # noqa: E402
from cospeech.errors import InputError  # noqa: E402
from cospeech.metrics import Sample, Tools, load_metric  # noqa: E402
from cospeech.models.feature_net import classifier_net  # noqa: E402
from cospeech.models.nn.objective import Batch, StepRandom  # noqa: E402
from cospeech.models.speaker_classifier import SpeakerClassifier, SpeakerClassifierConfig  # noqa: E402
from cospeech.motion.poses.direction_vectors import DIRECTION_VECTORS as POSE  # noqa: E402
from cospeech.training.feature_networks import load_classifier, load_features  # noqa: E402
from cospeech.training.recipe import SHIPPED, build, load_recipe, read_recipe  # noqa: E402
from cospeech.training.train import train  # noqa: E402

ROOT = Path(__file__).parents[2]
torch.set_num_threads(1)
FPS = 15.0
TINY = SpeakerClassifierConfig(channels=4)


def test_layers_and_sizes_are_those_of_the_authors():
    with torch.device("meta"):
        net = SpeakerClassifier(SpeakerClassifierConfig(), pose=96, speakers=25)
    convolutions = [part for part in net.modules() if isinstance(part, torch.nn.Conv1d)]
    assert [c.out_channels for c in convolutions] == [64, 128, 128, 256, 256, 25]
    assert {(c.kernel_size, c.stride) for c in convolutions} == {((4,), (2,))}
    widths = [96, 64, 128, 128, 256, 256, 25]
    assert sum(p.numel() for p in net.parameters()) == sum(4 * a * b + 3 * b for a, b in pairwise(widths))
    recipe = load_recipe(SHIPPED / "speaker_classifier_pats.toml")
    assert build(SpeakerClassifierConfig, recipe.config, "model") == SpeakerClassifierConfig()


def test_of_64_frames_there_is_one_answer_and_of_more_their_mean():
    torch.manual_seed(0)
    net = SpeakerClassifier(TINY, pose=5, speakers=3).eval()
    poses = torch.randn(2, 64, 5)
    assert net(poses).shape == (2, 3)
    assert net.blocks(poses.mT).shape == (2, 3, 1)
    assert torch.allclose(net.probabilities(poses).sum(1), torch.ones(2), atol=1e-6)
    longer = torch.randn(2, 200, 5)
    assert torch.allclose(net(longer), net.blocks(longer.mT).mean(-1))
    assert (net(poses) >= 0).all()  # the last ReLU
    plain = SpeakerClassifier(replace(TINY, plain=True), pose=5, speakers=3).eval()
    assert (plain(longer) < 0).any()
    assert plain(poses).shape == (2, 3)
    assert sum(p.numel() for p in net.parameters()) - sum(p.numel() for p in plain.parameters()) == 2 * 3


def test_its_loss_is_the_cross_entropy_and_its_error_a_share():
    torch.manual_seed(0)
    net = SpeakerClassifier(TINY, pose=5, speakers=3).eval()
    data = Batch({"pose": torch.randn(8, 64, 5), "speaker": torch.arange(8) % 3}, StepRandom(0, 0))
    logits = net(data["pose"])
    expected = -F.log_softmax(logits, 1)[torch.arange(8), data["speaker"]].mean()
    assert net.loss(data, 0)["cross_entropy"].item() == pytest.approx(expected.item(), rel=1e-6)
    figures = net.validate(data)
    assert figures["cross_entropy"].item() == pytest.approx(expected.item(), rel=1e-6)
    wrong = sum(int(row.argmax()) != k % 3 for k, row in enumerate(logits))
    assert figures["error"].item() == pytest.approx(wrong / 8)


@pytest.mark.parametrize(("changes", "speakers"), [({"frames": 63}, 3), ({"channels": 0}, 3), ({}, 1), ({}, 0)])
def test_sizes_that_are_none_are_told(changes, speakers):
    with pytest.raises(InputError, match=f"of {speakers} speakers"):
        SpeakerClassifier(SpeakerClassifierConfig(**{"channels": 4} | changes), pose=5, speakers=speakers)


def movement(speaker: int, seed: int, frames: int = 400) -> np.ndarray:
    """(T, 27) a speaker who sways three times as often as the speaker before; all have the same mean pose."""
    draw = np.random.default_rng([speaker, seed])
    phases = draw.uniform(0, 2 * np.pi) + np.linspace(0, np.pi, 27)
    wave = np.sin(2 * np.pi * 0.25 * 3**speaker * np.arange(frames)[:, None] / FPS + phases)
    rest = POSE.encode(POSE.decode(np.random.default_rng(99).normal(size=(1, 27)), FPS))
    return rest + 0.2 * wave + 0.02 * draw.normal(size=(frames, 27))


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder, pieces = tmp_path_factory.mktemp("classifier"), []
    for k, name in enumerate(("ann", "bob", "cleo")):
        for seed, split in [*((seed, "train") for seed in range(6)), (6, "validation")]:
            poses = POSE.encode(POSE.decode(movement(k, seed), FPS)).astype(np.float32)
            entry = Entry(f"{name}-{seed}", name, split, 0, len(poses), 0.0, ("pose",))
            pieces.append(Piece(entry, (), lambda poses=poses: {"pose": poses}))
    write_store(folder / "store", pieces, corpus="ted", pose=POSE.name, fps=FPS, names={"pose": POSE.names})
    settings = {"steps": 120, "batch": 24, "lr": 1e-2, "threads": 1, "validate_every": 60, "balance": True}
    recipe = read_recipe({"model": {"name": "speaker-classifier", "channels": 8}, "train": settings})
    report = train(recipe, folder / "store", folder / "run")
    assert report.best["name"] == "cross_entropy"
    assert report.best["value"] < 0.3
    return folder / "run"


def recordings(speaker: int, seeds=range(10, 14)) -> list[Sample]:
    return [
        Sample(f"{speaker}-{seed}", FPS, positions=POSE.decode(movement(speaker, seed), FPS).values, label=str(speaker))
        for seed in seeds
    ]


def test_it_knows_who_moves_in_recordings_that_it_has_not_seen(run):
    net = load_classifier(run)
    assert (net.frames, net.name.split()[0]) == (64, "speaker-classifier")
    for speaker in range(3):
        rows = np.concatenate([net.windows(sample) for sample in recordings(speaker)])
        assert rows.shape == (4 * len(range(0, 400 - 64 + 1, net.hop)), 3)
        assert np.allclose(rows.sum(1), 1, atol=1e-6)
        assert np.mean(rows.argmax(1) == speaker) > 0.95


def test_the_inception_score_counts_the_speakers_that_it_sees(run):
    tools = Tools(classifier=load_classifier(run))
    for metric in ("inception_score", "inception_score_published"):
        score = load_metric(metric)
        one, two, three = (score([s for k in range(n) for s in recordings(k)], (), tools).value for n in (1, 2, 3))
        assert 1 <= one < 1.2
        assert one < two - 0.3
        assert two < three - 0.3
        assert three <= 3 + 1e-9


def test_other_networks_are_no_classifier_and_it_is_no_feature_network(run):
    net = SpeakerClassifier(TINY, pose=27, speakers=2)
    about = {"name": "x", "pose": POSE.name, "fps": FPS, "std": np.ones(27)}
    with pytest.raises(InputError, match="no feature network"):
        load_features(run)
    with pytest.raises(InputError, match="no classifier"):
        classifier_net(torch.nn.Linear(2, 2), mean=np.zeros(27), **about)
    with pytest.raises(InputError, match="statistics"):
        classifier_net(net, mean=np.zeros(3), **about)
    with pytest.raises(InputError, match="is not a run"):
        load_classifier(run / "nowhere")
