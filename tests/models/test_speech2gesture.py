"""Speech2Gesture: what its losses are and whom they move, what the discriminator sees, speech of any length; it learns."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

torch = pytest.importorskip("torch", reason="networks need torch (the train extra)")

from cospeech.corpora.store import Store  # noqa: E402
from cospeech.errors import InputError  # noqa: E402
from cospeech.models.nn.objective import Batch, StepRandom  # noqa: E402
from cospeech.models.speech2gesture import Speech2Gesture, Speech2GestureConfig  # noqa: E402
from cospeech.training.checkpoint import load_run  # noqa: E402
from cospeech.training.dataset import open_set  # noqa: E402
from cospeech.training.recipe import SHIPPED, build, load_recipe, read_recipe  # noqa: E402
from cospeech.training.train import train  # noqa: E402
from tests.support.tiny_store import make_store  # noqa: E402

ROOT = Path(__file__).parents[2]
TINY = Speech2GestureConfig(frames=32, channels=8, depth=2, decoder=1, discriminator_channels=4)
POSE, AUDIO = 6, 16
NO_STYLE = torch.zeros(3, 1, 0)


@pytest.fixture
def net():
    torch.manual_seed(0)
    return Speech2Gesture(TINY, pose=POSE, audio=AUDIO)


def walks(rows=3, frames=32, seed=0):
    draw = torch.Generator().manual_seed(seed)
    pose, audio = (torch.randn(rows, frames, width, generator=draw).cumsum(1) / 5 for width in (POSE, AUDIO))
    return Batch({"pose": pose, "audio": audio}, StepRandom(0, 0))


def test_the_losses_are_those_of_the_equations(net):
    net.eval()
    net.config = replace(TINY, adversarial=0.5, fake=3.0)
    data = walks()
    with torch.no_grad():
        output = net.generate(data["audio"], NO_STYLE)
        real, false = (net.discriminate(poses) for poses in (data["pose"], output))
        of_discriminator, of_generator = (objective.loss(data, 0) for objective in net.objectives().values())
    expected = {"real": ((real - 1) ** 2).mean(), "made": 3 * (false**2).mean()}
    assert {k: v.item() for k, v in of_discriminator.items()} == pytest.approx({k: v.item() for k, v in expected.items()})
    assert of_generator["l1"].item() == pytest.approx((output - data["pose"]).abs().sum().item() / output.numel(), rel=1e-5)
    assert of_generator["adversarial"].item() == pytest.approx(0.5 * ((false - 1) ** 2).mean().item())


def test_without_the_game_it_is_l1_alone(net):
    net.config = replace(TINY, adversarial=0)
    assert [*net.objectives()["generator"].loss(walks(), 0)] == ["l1"]


def test_each_objective_has_parameters_of_its_own_and_reaches_all_of_them(net):
    sets = {name: [*objective.parameters] for name, objective in net.objectives().items()}
    assert {id(p) for p in sets["discriminator"]} == {id(p) for p in net.discriminator.parameters()}
    assert not {id(p) for p in sets["discriminator"]} & {id(p) for p in sets["generator"]}
    net.eval()  # in training, biases before a batch norm have none
    for name, other in (("discriminator", "generator"), ("generator", None)):
        total = sum(net.objectives()[name].loss(walks(), 0).values())
        gradients = torch.autograd.grad(total, sets[name], retain_graph=True)
        assert all(gradient.abs().max() > 0 for gradient in gradients)
        if other:  # poses that were made do not learn from being judged
            assert set(torch.autograd.grad(total, sets[other], allow_unused=True)) == {None}


def test_the_discriminator_sees_motion_and_not_where_it_is(net):
    net.eval()
    poses = walks()["pose"]
    with torch.no_grad():
        scores = net.discriminate(poses)
        assert torch.allclose(net.discriminate(poses + 7), scores, atol=1e-5)
        assert not torch.allclose(net.discriminate(2 * poses), scores, atol=1e-3)
        assert net.discriminate(torch.zeros(2, 64, POSE)).shape == (2, 12)
        assert net.discriminate(torch.zeros(2, 20, POSE)).shape == (2, 1)


def test_a_patch_judges_about_a_second(net):
    """Its field: 4 of the first convolution, then strides of 2 and 4: 34 frames, 2.3 s, of which the middle counts most."""
    net.eval()
    poses = torch.zeros(1, 128, POSE, requires_grad=True)
    scores = net.discriminate(poses + torch.randn(1, 128, POSE).cumsum(1))
    (gradient,) = torch.autograd.grad(scores[0, 14], poses)
    frames = gradient.abs().sum(-1)[0].nonzero().flatten()
    assert 30 <= frames[-1] - frames[0] + 1 <= 36


@pytest.mark.parametrize("frames", [1, 2, 31, 32, 33, 100])
def test_as_many_poses_as_frames_of_speech(net, frames):
    net.eval()
    audio = walks(2, frames)["audio"]
    poses = net.generate(audio, NO_STYLE[:2])
    assert poses.shape == (2, frames, POSE)
    assert poses.isfinite().all()
    assert torch.equal(net.generate(audio, NO_STYLE[:2]), poses)
    whole = net.generate(
        torch.cat([audio, audio[:, -1:].expand(-1, -frames % 8, -1)], 1), NO_STYLE[:2]
    )  # what it is filled up with
    assert torch.equal(whole[:, :frames], poses)


@pytest.mark.parametrize("audio", [1, 5, 29, 64, 84])
def test_any_number_of_mel_bands_and_all_are_heard(audio):
    torch.manual_seed(0)
    net = Speech2Gesture(TINY, pose=POSE, audio=audio).eval()
    speech = torch.randn(1, 32, audio, requires_grad=True)
    (gradient,) = torch.autograd.grad(net(speech).square().sum(), speech)
    assert (gradient.abs().sum((0, 1)) > 0).all()


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("frames", 19),
        ("channels", 3),
        ("depth", 0),
        ("discriminator_channels", 0),
        ("adversarial", -1.0),
        ("fake", float("nan")),
    ],
)
def test_settings_that_are_none_are_told(field, value):
    with pytest.raises(InputError, match=field):
        replace(TINY, **{field: value})


def test_the_recipe_is_at_the_authors_sizes_and_the_defaults_are_its_own():
    recipe = load_recipe(SHIPPED / "speech2gesture_pats.toml")
    assert build(Speech2GestureConfig, recipe.config, "model") == Speech2GestureConfig()
    assert (recipe.train.batch, recipe.train.lr, recipe.data.audio) == (32, 1e-4, "log-mel-400")


def test_it_learns_what_follows_from_the_speech_and_a_run_of_it_opens(tmp_path):
    """Poses of the little store are a linear map of its audio; the net hears it: another window's speech is worse."""
    config = {"frames": 32, "channels": 16, "depth": 2, "decoder": 1, "discriminator_channels": 8}
    settings = {"steps": 300, "batch": 16, "lr": 2e-3, "threads": 1, "validate_every": 60, "best": "generator.l1"}
    recipe = read_recipe({"model": {"name": "speech2gesture", **config}, "train": settings})
    store = make_store(tmp_path / "store")
    report = train(recipe, store, tmp_path / "run")
    net, facts = load_run(tmp_path / "run")
    assert facts["model"] == "speech2gesture"
    assert (report.parameters, report.best["name"]) == (sum(p.numel() for p in net.parameters()), "generator.l1")
    windows = open_set(recipe, Store(store), torch.device("cpu")).feed(net.eval(), "train", False).at(64, 0, 0)
    pose, audio = (torch.from_numpy(windows[name]) for name in ("pose", "audio"))
    own, strange, mean = ((output - pose).abs().mean() for output in (net(audio), net(audio.flip(0)), torch.zeros_like(pose)))
    assert own < 0.7 * mean
    assert own < 0.7 * strange
