"""MUNIT: content and style come apart, its losses are those of the equation, each objective moves its own; it reconstructs."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

torch = pytest.importorskip("torch", reason="networks need torch (the train extra)")

from cospeech.corpora.store import Store  # noqa: E402
from cospeech.errors import InputError  # noqa: E402
from cospeech.models.munit import Munit, MunitConfig  # noqa: E402
from cospeech.models.nn.objective import Batch, Objective, StepRandom  # noqa: E402
from cospeech.training.checkpoint import load_run  # noqa: E402
from cospeech.training.dataset import open_set  # noqa: E402
from cospeech.training.objective_optimiser import ObjectiveOptimiser  # noqa: E402
from cospeech.training.recipe import SHIPPED, Optimiser, build, load_recipe, read_recipe  # noqa: E402
from cospeech.training.train import train  # noqa: E402
from tests.support.tiny_store import make_store  # noqa: E402

ROOT = Path(__file__).parents[2]
TINY = MunitConfig(frames=64, channels=4, style=2, mlp=8, blocks=1)
POSE, AUDIO = 6, 16


@pytest.fixture
def net():
    torch.manual_seed(0)
    return Munit(TINY, pose=POSE, audio=AUDIO)


def walks(rows=3, frames=64, seed=0):
    draw = torch.Generator().manual_seed(seed)
    pose, audio = (torch.randn(rows, frames, width, generator=draw).cumsum(1) / 5 for width in (POSE, AUDIO))
    return Batch({"pose": pose, "audio": audio}, StepRandom(0, 0))


def test_the_losses_are_those_of_the_equation(net):
    """Of the poses, one after the other, from the parts; the first style that is drawn is that of the audio."""
    net.config = replace(TINY, same=2.0, content_back=3.0, style_back=5.0, cycle=7.0, adversarial=11.0)
    data = walks()
    y, a = data["pose"].mT, data["audio"].mT
    with torch.no_grad():
        terms = net.objectives()["generator"].loss(Batch(data.arrays, StepRandom(0, 0)), 0)
        chance = StepRandom(0, 0)
        chance.normal(3, 2)
        style = chance.normal(3, 2)
        (content, audio_style), (own, own_style) = net.speech.encode(a), net.motion.encode(y)
        poses = net.motion.decode(content, style)
        content_again, style_again = net.motion.encode(poses)
        expected = {
            "pose_same": 2 * (net.motion.decode(own, own_style) - y).abs().mean(),
            "pose_content": 3 * (content_again - content).abs().mean(),
            "pose_style": 5 * (style_again - style).abs().mean(),
            "pose_cycle": 7 * (net.speech.decode(content_again, audio_style) - a).abs().mean(),
            "pose_adversarial": 11 * net.judge_moved.distance(poses, 1.0),
        }
    assert {k: terms[k].item() for k in expected} == pytest.approx({k: v.item() for k, v in expected.items()}, rel=1e-5)
    assert {*terms} == {f"{name}_{k.partition('_')[2]}" for k in expected for name in ("audio", "pose")}


def test_biases_begin_at_zero(net):
    biases = [value for name, value in net.named_parameters() if name.endswith(".bias")]
    assert biases
    assert not any(value.any() for value in biases)


def test_no_term_compares_a_speech_with_its_own_poses(net):
    """Poses in another order: all terms but the cycles, whose styles are of the rows, have the same means."""
    data = walks()
    other = Batch({"pose": data["pose"].flip(0), "audio": data["audio"]}, StepRandom(0, 0))
    with torch.no_grad():
        first, second = (net.objectives()["generator"].loss(Batch(b.arrays, StepRandom(0, 0)), 0) for b in (data, other))
    for term in ("pose_same", "audio_same", "pose_content", "pose_style", "pose_adversarial"):
        assert first[term].item() == pytest.approx(second[term].item(), rel=1e-5)


def test_each_objective_moves_its_own_and_all_of_it(net):
    sets = {name: [*objective.parameters] for name, objective in net.objectives().items()}
    for name, other in (("discriminator", "generator"), ("generator", None)):
        total = sum(net.objectives()[name].loss(walks(), 0).values())
        assert all(g.abs().max() > 0 for g in torch.autograd.grad(total, sets[name], retain_graph=True))
        if other:
            assert set(torch.autograd.grad(total, sets[other], allow_unused=True)) == {None}
    assert not {id(p) for p in sets["generator"]} & {id(p) for p in sets["discriminator"]}


def test_content_knows_no_place_and_no_size_and_style_does(net):
    poses = walks()["pose"].mT
    with torch.no_grad():
        content, style = net.motion.encode(poses)
        louder, other = net.motion.encode(3 * poses + 1)
    assert torch.allclose(content, louder, atol=2e-3)
    assert (style - other).abs().max() > 0.05
    assert content.shape == (3, 16, 16)


@pytest.mark.parametrize("frames", [1, 15, 64, 101])
def test_one_speech_in_two_styles(net, frames):
    audio = walks(2, frames)["audio"]
    styles = torch.randn(2, 2, 1, 2, generator=torch.Generator().manual_seed(1))
    first, second = (net.generate(audio, style) for style in styles)
    assert first.shape == (2, frames, POSE)
    assert first.isfinite().all()
    assert (first - second).abs().max() > 1e-3
    assert torch.equal(net.generate(audio, styles[0]), first)


def test_wrong_sizes_are_told(net):
    audio = walks(2)["audio"]
    for wrong in (audio[:, :0], audio[:1]):
        with pytest.raises(InputError, match="speech of shape"):
            net.generate(wrong, torch.zeros(2, 1, 2))
    with pytest.raises(InputError, match="31 frames"):
        net.style_of(walks(2, 31)["pose"])
    assert net.style_of(walks(2, 32)["pose"]).shape == (2, 2)
    for change in ({"frames": 63}, {"frames": 66}, {"style": 0}, {"cycle": -1.0}, {"same": float("nan")}):
        with pytest.raises(InputError, match="MUNIT"):
            replace(TINY, **change)


def test_the_recipe_is_at_the_authors_values_and_they_are_the_defaults():
    recipe = load_recipe(SHIPPED / "munit_pats.toml")
    assert build(MunitConfig, recipe.config, "model") == MunitConfig()
    assert (recipe.train.betas, recipe.train.lr, recipe.train.gamma) == ((0.5, 0.999), 1e-4, 0.5)
    assert recipe.train.weight_decay == 1e-4


def test_weight_decay_is_added_to_the_gradient_before_adam_sees_it():
    """Three steps of an objective with and without, against Adam written out (Kingma and Ba 2015, algorithm 1)."""
    target = torch.tensor([1.0, -2.0, 0.5])
    for decay in (0.0, 0.3):
        value = torch.nn.Parameter(torch.tensor([2.0, 1.0, -1.0]))
        part = ObjectiveOptimiser("x", Objective([value], dict), Optimiser(lr=0.1, betas=(0.5, 0.9), weight_decay=decay))
        x, m, v = value.detach().clone(), torch.zeros(3), torch.zeros(3)
        for step in range(1, 4):
            part.gradients((value - target).square().sum())
            part.update(step - 1)
            g = 2 * (x - target) + decay * x
            m, v = 0.5 * m + 0.5 * g, 0.9 * v + 0.1 * g * g
            x = x - 0.1 * (m / (1 - 0.5**step)) / ((v / (1 - 0.9**step)).sqrt() + 1e-8)
        assert torch.allclose(value, x, atol=1e-6)


def test_trained_it_gives_poses_back_from_content_and_style(tmp_path):
    config = {"frames": 64, "channels": 8, "style": 4, "mlp": 16, "blocks": 1}
    settings = {"steps": 50, "batch": 8, "lr": 2e-3, "threads": 1, "validate_every": 0, "betas": [0.5, 0.999]}
    recipe = read_recipe({"model": {"name": "munit", **config}, "train": settings})
    store = make_store(tmp_path / "store")
    train(recipe, store, tmp_path / "run")
    net, _ = load_run(tmp_path / "run", "last")
    windows = open_set(recipe, Store(store), torch.device("cpu")).feed(net.eval(), "train", False).at(16, 0, 0)
    pose = torch.from_numpy(windows["pose"]).mT
    with torch.no_grad():
        content, style = net.motion.encode(pose)
        back, strange = net.motion.decode(content, style), net.motion.decode(content, style.flip(0))
    assert (back - pose).abs().mean() < 0.7 * pose.abs().mean()
    assert (back - pose).abs().mean() < 0.9 * (strange - pose).abs().mean()
