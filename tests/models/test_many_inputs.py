"""CaMN and the multi-context network: what each input does, what stands for a missing one, and what is optimised."""

from __future__ import annotations

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="networks need torch (the train extra)")

from cospeech.errors import InputError  # noqa: E402
from cospeech.models.camn import Camn, CamnConfig  # noqa: E402
from cospeech.models.multi_context import MultiContext, MultiContextConfig  # noqa: E402
from cospeech.models.nn.modalities import INPUTS, SEEDS, weights_of  # noqa: E402
from cospeech.models.nn.objective import Batch, StepRandom  # noqa: E402
from tests.models.test_contract import ROWS, batch, network, train_windowed  # noqa: E402

torch.set_num_threads(1)
BOTH = ("camn", "multi-context+all")
HANDS = [*range(18, 75), *range(84, 141)]  # of BEAT's 47 joints in Euler angles


def loud(name: str):
    """A network whose recurrent layers have larger input weights, so that they pass on their input."""
    net = train_windowed(name)
    with torch.no_grad():
        for key, value in net.named_parameters():
            if "weight_ih" in key or "text" in key:
                value.mul_(3)
    return net


def far(one, other) -> float:
    return (one["pose"] - other["pose"]).abs().mean().item()


@pytest.mark.parametrize("name", BOTH)
@pytest.mark.parametrize("lacking", INPUTS)
def test_every_input_is_heard_and_any_can_be_lacking(name, lacking):
    net, arrays = loud(name), batch(network(name)).arrays
    assert far(net.play(arrays), net.play(arrays, (lacking,))) > 1e-4


@pytest.mark.parametrize("name", BOTH)
def test_what_the_store_does_not_know_is_as_if_it_were_lacking(name):
    net, arrays = loud(name), dict(batch(network(name)).arrays)
    bare = net.play(arrays, ("face", "emotion"))
    unknown = {"face": torch.full_like(arrays["face"], torch.nan), "emotion": torch.full_like(arrays["emotion"], -1)}
    assert torch.equal(net.play(arrays | unknown)["pose"], bare["pose"])
    assert torch.equal(net.play({k: v for k, v in arrays.items() if k not in unknown})["pose"], bare["pose"])
    silent = net.play(arrays | {"text": torch.zeros_like(arrays["text"])})
    assert torch.equal(silent["pose"], net.play(arrays, ("text",))["pose"])


@pytest.mark.parametrize("name", BOTH)
def test_of_the_poses_the_first_four_are_looked_at(name):
    net, arrays = loud(name), batch(network(name)).arrays
    later, first = arrays["pose"].clone(), arrays["pose"].clone()
    later[:, SEEDS:] += 1
    first[:, SEEDS - 1] += 1
    assert torch.equal(net.play(arrays | {"pose": later})["pose"], net.play(arrays)["pose"])
    assert far(net.play(arrays | {"pose": first}), net.play(arrays)) > 1e-5


@pytest.mark.parametrize("name", BOTH)
def test_played_by_windows_is_played_without_face_and_seeds(name):
    net, arrays = loud(name), batch(network(name)).arrays
    rows = torch.cat([arrays["audio"], net.words(arrays["text"])], -1)
    one_hot = torch.eye(ROWS)[arrays["speaker"]].unsqueeze(1).expand(-1, net.window, -1)
    mood = torch.eye(9)[arrays["emotion"] + 1][..., 1:]
    poses = net.make(rows, torch.cat([one_hot, mood], -1), torch.zeros(*rows.shape[:2], net.modes))
    assert torch.allclose(poses, net.play(arrays, ("face", "seed"))["pose"], atol=1e-6)


@pytest.mark.parametrize("name", BOTH)
def test_an_input_that_is_none_is_told(name):
    with pytest.raises(InputError, match="face"):
        network(name).play(batch(network(name)).arrays, ("faces",))


def test_weights_of_labels():
    labels = torch.tensor([[0, 2], [-1, 1]])
    expected = torch.tensor([[[1.0, 0, 0], [0, 0, 1]], [[0, 0, 0], [0, 1, 0]]])
    assert torch.equal(weights_of(labels, 3), expected)


@pytest.mark.parametrize("name", ["camn+alone", "multi-context+regression"])
def test_a_share_of_training_windows_has_no_seeds(name):
    net, data = network(name, seed_dropout=0.25), batch(network(name), rows=400)
    flags = net.train().collect_training_inputs(data, 0.25).seed[:, 0, -1]
    assert 0.18 < 1 - flags.mean() < 0.32
    assert net.eval().collect_training_inputs(data, 0.25).seed[:, :SEEDS, -1].all()


# CaMN ----------------------------------------------------------------------------------------------------------------


def test_camn_is_as_large_as_the_authors():
    """Theirs has 16,365,225: 5,793 words of 300 numbers, a waveform encoder of 833,280, 51 numbers of a face."""
    with torch.device("meta"):
        net = Camn(CamnConfig(), pose=141, audio=84, speakers=30, hands=HANDS)
    assert (net.body.lstm.input_size, net.hands.lstm.input_size) == (446, 473)
    assert net.body_out[-1].out_channels == 27
    ours = {name: sum(p.numel() for p in part.parameters()) for name, part in net.named_children()}
    words, waveform, one_weight_of_a_face = 5793 * 300, 833_280, 2 * 7 * 16
    theirs = sum(ours.values()) - ours["embedding"] - ours["speech"] + words + waveform - one_weight_of_a_face
    assert theirs == 16_365_225


def test_hands_are_made_of_the_body_and_put_in_their_columns():
    net = loud("camn")
    given = net.collect_inputs(batch(net).arrays)
    poses = net(given)
    with torch.no_grad():
        net.body_out[-1].bias += 1
    change = (net(given) - poses).detach()
    body, hands = [0, 2, 3, 4], [1, 5]
    assert torch.allclose(change[..., body], torch.ones(()), atol=1e-5)
    assert change[..., hands].abs().mean() > 1e-4  # they follow
    with torch.no_grad():
        net.hands_out[-1].bias += torch.tensor([10.0, 20.0])
    second_change = net(given) - poses - change
    assert torch.allclose(second_change[..., hands], torch.tensor([10.0, 20.0]), atol=1e-4)
    assert torch.allclose(second_change[..., body], torch.zeros(()), atol=1e-5)


def test_the_loss_is_hubers_of_poses_weighted_by_what_they_mean():
    net = loud("camn")
    data = batch(net)
    poses, pose = (x.numpy() for x in (net(net.collect_inputs(data.arrays)).detach(), data["pose"]))
    weights = 1 + data["semantic"].numpy()[..., None]
    apart = np.abs(poses - pose) * weights
    expected = 500 * np.where(apart < 0.1, apart**2 / 0.2, apart - 0.05).mean()
    assert net.loss(data, 0)["huber"].item() == pytest.approx(expected, rel=1e-5)
    plain = Batch(data.arrays | {"semantic": torch.full_like(data["semantic"], torch.nan)}, data.chance)
    unknown = np.abs(poses - pose)
    expected = 500 * np.where(unknown < 0.1, unknown**2 / 0.2, unknown - 0.05).mean()
    assert net.loss(plain, 0)["huber"].item() == pytest.approx(expected, rel=1e-5)


def test_stores_without_meaning_will_do():
    assert "semantic" not in network("camn+alone").arrays
    assert "semantic" in network("camn").arrays


@pytest.mark.parametrize("hands", [[], [*range(6)], [0, *range(6)]])
def test_a_body_needs_hands_and_more(hands):
    with pytest.raises(InputError, match="CaMN of"):
        Camn(CamnConfig(hidden=4), pose=6, audio=3, speakers=2, hands=hands)


# multi-context -------------------------------------------------------------------------------------------------------


def test_the_multi_context_network_is_as_large_as_beats():
    """Theirs has 8,375,937 but for the discriminator; words and waveform as for CaMN."""
    with torch.device("meta"):
        net = MultiContext(MultiContextConfig(), pose=141, audio=84, speakers=30)
    assert net.both_ways.gru.input_size == 142 + 128 + 128 + 8
    ours = {name: sum(p.numel() for p in part.parameters()) for name, part in net.named_children()}
    theirs = sum(ours.values()) - sum(ours[name] for name in ("embedding", "speech", "discriminator"))
    assert theirs + 5793 * 300 + 833_280 == 8_375_937


def test_emotion_and_face_are_heard_where_they_are_wanted():
    plain, whole = network("multi-context"), network("multi-context+all")
    assert plain.arrays == ("pose", "audio", "text")
    assert whole.arrays == ("pose", "audio", "text", "emotion", "face")
    arrays = batch(whole).arrays
    assert torch.equal(plain.eval().play(arrays)["pose"], plain.play(arrays, ("emotion", "face"))["pose"])


def test_takes_differ_by_the_noise_of_the_speaker():
    net, arrays = loud("multi-context+all"), batch(network("multi-context+all")).arrays
    noise = torch.randn(ROWS, 1, net.config.speaker, generator=torch.Generator().manual_seed(1)).expand(-1, net.window, -1)
    assert far(net.play(arrays, noise=noise), net.play(arrays)) > 1e-4
    assert torch.equal(net.play(arrays, noise=torch.zeros_like(noise))["pose"], net.play(arrays)["pose"])


def test_the_discriminator_begins_when_it_is_told_to():
    net = network("multi-context", adversarial_from=7)
    data = batch(net)
    objectives = net.objectives()
    assert [*objectives] == ["discriminator", "generator"]
    assert [step for step in range(10) if objectives["discriminator"].is_active_at(step)] == [7, 8, 9]
    assert "adversarial" not in net.generator_loss(data, 6)
    assert "adversarial" in net.generator_loss(data, 7)
    assert [*network("multi-context+regression").objectives()] == ["generator"]


def test_each_turn_moves_its_own():
    net = network("multi-context+all").train()
    data = batch(net)
    sum(net.discriminator_loss(data, 0).values()).backward()
    assert all((p.grad is not None) is key.startswith("discriminator.") for key, p in net.named_parameters())


def test_the_divergence_is_that_of_two_gaussians():
    """KL(N(μ, σ) ‖ N(0, 1)) = E log (N(μ, σ) / N(0, 1)), here by quadrature."""
    net = network("multi-context+all").eval()
    data = batch(net)
    mean, variance = (x.detach().double().numpy() for x in net.speaker(net.collect_inputs(data.arrays).speaker))
    x = np.linspace(-30, 30, 20001)
    sigma = np.exp(variance / 2)[..., None]
    density = np.exp(-((x - mean[..., None]) ** 2) / (2 * sigma**2)) / (sigma * np.sqrt(2 * np.pi))
    ratio = -((x - mean[..., None]) ** 2) / (2 * sigma**2) - np.log(sigma) + x**2 / 2
    expected = 0.1 * ((density * ratio).sum(-1) * (x[1] - x[0])).mean()
    assert net.generator_loss(data, 0)["divergence"].item() == pytest.approx(expected, rel=1e-4)


def test_diversity_is_worth_no_more_than_it_is_cut_at():
    net = network("multi-context+all").eval()
    data = batch(net)
    with torch.no_grad():
        net.out[-1].weight *= 1e6
    terms = net.generator_loss(Batch(data.arrays, StepRandom(0, 0)), 0)
    assert terms["diversity"].item() == pytest.approx(-0.01 * 1000)
