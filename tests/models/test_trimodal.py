"""The networks of Yoon et al. 2020 and Bhattacharya et al. 2021 on TED: sizes, what each input does, and each loss by hand."""

from __future__ import annotations

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="networks need torch (the train extra)")

from cospeech.errors import InputError  # noqa: E402
from cospeech.models.joint_embedding import JointEmbedding, JointEmbeddingConfig  # noqa: E402
from cospeech.models.nn.modalities import SEEDS  # noqa: E402
from cospeech.models.nn.objective import Batch, StepRandom  # noqa: E402
from cospeech.models.nn.pose_graph import GraphConvolution, spatial_partition  # noqa: E402
from cospeech.models.nn.waveform_encoder import WaveformEncoder  # noqa: E402
from cospeech.models.speech2affective_gestures import (  # noqa: E402
    BONES,
    Speech2AffectiveGestures,
    Speech2AffectiveGesturesConfig,
)  # fmt: skip
from cospeech.models.trimodal import Trimodal, TrimodalConfig  # noqa: E402
from tests.models.test_contract import ROWS, batch, network, ready, train_windowed  # noqa: E402

torch.set_num_threads(1)
WORDS, SPEAKERS = 26_000, 1_371  # of the authors' vocabulary of TED, and its videos; 300 numbers and 16 of each
TRIO = ("trimodal", "speech2affective-gestures")


def count(part) -> int:
    return sum(value.numel() for value in part.parameters())


def build(kind, config, **sizes):
    with torch.device("meta"):
        return kind(config, pose=27, **sizes)


def log_sigmoid(scores: np.ndarray) -> np.ndarray:
    return -np.log1p(np.exp(-scores.astype(np.float64)))


def huber(a: np.ndarray, b: np.ndarray, beta: float) -> np.ndarray:
    apart = np.abs(a.astype(np.float64) - b)
    return np.where(apart < beta, apart**2 / (2 * beta), apart - beta / 2)


# sizes ---------------------------------------------------------------------------------------------------------------


def test_the_trimodal_network_is_as_large_as_the_authors():
    """The sizes are equal but for the words: ours has a table of 2,001 subwords."""
    net = build(Trimodal, TrimodalConfig(), audio=1080, speakers=SPEAKERS)
    assert count(net.discriminator) == 253_950
    assert count(net) - 253_950 - count(net.embedding) + WORDS * 300 == 15_004_939
    assert net.both_ways.gru.input_size == 28 + 32 + 32 + 16


def test_the_joint_embedding_is_as_large_as_the_authors():
    """But for the words, and for a layer of theirs without use: log σ² of the z of poses, which no loss reads."""
    net = build(JointEmbedding, JointEmbeddingConfig(), audio=1080)
    assert count(net) - count(net.embedding) + WORDS * 300 + (32 * 32 + 32) == 15_759_275


def test_the_affective_network_has_what_its_layers_have():
    """By hand of the authors' widths: no figure of theirs is public. Theirs has 70 spectra of 37 numbers for 34 of 14 here."""
    net = build(Speech2AffectiveGestures, Speech2AffectiveGesturesConfig(), audio=14, speakers=SPEAKERS)
    gcn = lambda inputs, kernels, space: (  # noqa: E731
        (inputs * 9 + 1) * 16 * kernels + 3 * 32 + (16 * 9 * space + 1) * 16 + (inputs + 1) * 16
    )
    affect = gcn(3, 5, 5) + 2 * 16 * 9 + gcn(48, 5, 3) + 2 * 48 + (48 * 5 + 1) * 16 + 32 + (16 * 3 + 1) * 8 + 16
    speech = sum((a * k + 1) * b + 2 * b for a, b, k in ((34, 64, 5), (64, 64, 5), (64, 48, 3), (48, 34, 3))) + 15 * 32
    gru = lambda inputs, hidden: 2 * 3 * hidden * (inputs + hidden + 2)  # noqa: E731
    assert (count(net.known), count(net.speech)) == (affect, speech)
    assert count(net.both_ways) == gru(8 + 32 + 32 + 16, 300) + 3 * gru(600, 300)
    assert count(net.discriminator) == affect + gru(8, 64) + 3 * gru(128, 64) + 65 + 35


# parts ---------------------------------------------------------------------------------------------------------------


def test_a_vector_of_each_frame_hears_the_waveform_around_it():
    """One for each frame, of 3,025 samples, from 1,600 before the frame's first on, as the authors' padding has it."""
    torch.manual_seed(0)
    encoder = WaveformEncoder(1080, (5, 6, 6, 6), 4).eval()
    assert encoder.padding == (1600, 345)
    silent = torch.zeros(1, 5, 1080)
    with torch.no_grad():
        still = encoder(silent)
        assert still.shape == (1, 4, 5)
        for sample in (0, 1079):
            loud = silent.clone()
            loud[0, 2, sample] = 100
            has_changed = (encoder(loud) - still).abs().amax((0, 1)) > 1e-4
            place = 2 * 1080 + sample
            is_near = [k * 1080 - 1600 <= place < k * 1080 - 1600 + 3025 for k in range(5)]
            assert has_changed.tolist() == is_near
    with pytest.raises(InputError, match="samples"):
        WaveformEncoder(1000, (5, 6, 6, 6), 4)


def test_nodes_are_partitioned_by_distance_and_by_who_is_nearer_to_the_middle():
    """Yan et al. 2018, spatial configuration, of a chain 0 – 1 – 2."""
    third = np.float32(1 / 3)
    same, level, nearer, level_2, nearer_2 = spatial_partition(3, [(0, 1), (1, 2)])
    assert np.allclose(same, np.eye(3) / 3)
    assert np.allclose(level, [[0, 0, 0], [third, 0, 0], [0, third, 0]])  # rows further out, or as far
    assert np.allclose(nearer, [[0, third, 0], [0, 0, third], [0, 0, 0]])
    assert np.allclose(level_2[2, 0], third)
    assert np.allclose(nearer_2[0, 2], third)
    whole = spatial_partition(9, BONES)
    assert np.allclose(whole.sum((0, 1)), 1)
    assert not whole[:, 2, 5].any()  # head and left hand are four bones apart


def test_a_graph_convolution_by_hand():
    torch.manual_seed(0)
    net = GraphConvolution(2, 3, spatial_partition(3, [(0, 1), (1, 2)]), 3, 3).eval()
    x = torch.randn(2, 2, 5, 3)
    parts = net.over_time(x).reshape(2, 5, 3, 5, 3)
    sums = torch.einsum("nkctv,kvw->nctw", parts, net.adjacency)
    scale = 1 / (1 + 1e-5) ** 0.5
    expected = (net.over_both((sums * scale).relu()) * scale + net.short(x) * scale).relu()
    assert torch.allclose(net(x), expected, atol=1e-5)


# inputs --------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", [*TRIO, "joint-embedding"])
@pytest.mark.parametrize("lacking", ["text", "speaker", "seed"])
def test_every_input_is_heard_and_any_can_be_lacking(name, lacking):
    net, arrays = train_windowed(name), batch(network(name)).arrays
    with torch.no_grad():
        for key, value in net.named_parameters():
            if "weight_ih" in key or "text" in key:
                value.mul_(3)
    gap = (net.play(arrays)["pose"] - net.play(arrays, (lacking,))["pose"]).abs().mean()
    assert (gap > 1e-4) == (lacking != "speaker" or name != "joint-embedding")
    with pytest.raises(InputError, match="no input"):
        net.play(arrays, ("speech",))


@pytest.mark.parametrize("name", [*TRIO, "joint-embedding", "speech2gesture+seeded"])
def test_of_the_poses_the_first_four_are_looked_at(name):
    net, arrays = train_windowed(name), batch(network(name)).arrays
    later, first = arrays["pose"].clone(), arrays["pose"].clone()
    later[:, SEEDS:] += 1
    first[:, SEEDS - 1] += 1
    assert torch.equal(net.play(arrays | {"pose": later})["pose"], net.play(arrays)["pose"])
    assert (net.play(arrays | {"pose": first})["pose"] - net.play(arrays)["pose"]).abs().mean() > 1e-6


@pytest.mark.parametrize("name", TRIO)
def test_a_style_is_the_distribution_of_a_speaker(name):
    net, arrays = train_windowed(name), batch(network(name)).arrays
    codes = net.speaker_styles(torch.zeros(ROWS, 1, 1, 6))
    mean, variance = net.speaker(torch.eye(ROWS).unsqueeze(1))
    assert torch.allclose(codes, torch.cat([mean, variance], 1).squeeze(2))
    given = net.collect_inputs(arrays)
    assert torch.allclose(given.style[:, 0], codes[arrays["speaker"]])
    rows = torch.cat([arrays["audio"], net.embedding(arrays["text"])], -1)
    poses = net.make(rows, given.style, torch.zeros(ROWS, net.window, net.modes), given.seed)
    assert torch.allclose(poses, net.play(arrays)["pose"], atol=1e-6)


# losses --------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", TRIO)
def test_the_generators_loss_by_hand(name):
    net = ready(name)
    data, c = batch(net), net.config
    terms = {key: value.item() for key, value in net.generator_loss(data, c.adversarial_from).items()}
    with torch.no_grad():
        given, chance = net.collect_inputs(data.arrays), StepRandom(0, 0)
        style, frames = given.style, net.window
        noise = chance.normal(ROWS, 1, c.speaker)
        poses = net.poses(given, noise)
        speakers = (chance.uniform(ROWS) * ROWS).long()
        other_style = net.speaker_style(speakers)[:, None].expand(-1, frames, -1)
        other_noise = chance.normal(ROWS, 1, c.speaker)
        other = net.poses(given._replace(style=other_style), other_noise).numpy()
        scores = net.discriminator(poses).numpy()
    z, other_z = (
        (s[:, 0, : c.speaker] + (s[:, 0, c.speaker :] / 2).exp() * n[:, 0]).numpy()
        for s, n in ((style, noise), (other_style, other_noise))
    )
    poses, mean, variance = poses.numpy(), style[:, 0, : c.speaker].numpy(), style[:, 0, c.speaker :].numpy()
    apart = huber(other, poses, 0.05).sum((1, 2)) / (np.abs(other_z - z).mean(1) + 1e-5)
    expected = {
        "huber": 500 * huber(poses, data["pose"].numpy(), 0.1).mean(),
        "adversarial": -5 * log_sigmoid(scores).mean(),
        "diversity": -0.05 * np.minimum(apart, 1000).mean(),
        "divergence": -0.1 * 0.5 * (1 + variance - mean**2 - np.exp(variance)).mean(),
    }
    assert terms == pytest.approx(expected, rel=1e-3)
    assert ("adversarial" in net.generator_loss(data, c.adversarial_from - 1)) is (
        name != "trimodal" and c.adversarial_from < 0
    )


@pytest.mark.parametrize("name", TRIO)
def test_the_discriminators_loss_by_hand_moves_it_alone(name):
    net = ready(name)
    data = batch(net)
    terms = net.discriminator_loss(data, 0)
    with torch.no_grad():
        poses = net.poses(net.collect_inputs(data.arrays), StepRandom(0, 0).normal(ROWS, 1, net.config.speaker))
        true, false = (net.discriminator(x).numpy() for x in (data["pose"], poses))
    expected = {"true": -log_sigmoid(true).mean(), "false": -log_sigmoid(-false).mean()}
    assert {key: value.item() for key, value in terms.items()} == pytest.approx(expected, rel=1e-4)
    sum(terms.values()).backward()
    assert all((p.grad is not None) is key.startswith("discriminator.") for key, p in net.named_parameters())


def test_the_discriminator_begins_when_it_is_told_to():
    net = network("trimodal", adversarial_from=7)
    data, objectives = batch(net), net.objectives()
    assert [step for step in range(10) if objectives["discriminator"].is_active_at(step)] == [7, 8, 9]
    assert ["adversarial" in net.generator_loss(data, step) for step in (6, 7)] == [False, True]
    assert [*network("trimodal+regression").objectives()] == ["generator"]


def test_the_joint_embeddings_loss_by_hand():
    """z of each window is that of its speech or of its poses, by a coin."""
    net = ready("joint-embedding")
    data = batch(net, rows=6)
    chance = StepRandom(0, 0)
    coin, noise = chance.uniform(6, 1) < 0.5, chance.normal(6, net.config.code)
    assert 0 < coin.sum() < 6
    with torch.no_grad():
        given = net.collect_inputs(data.arrays)
        mean, variance = net.speech_encoder(given.audio, given.words)
        z = torch.where(coin, net.pose_encoder(data["pose"]), mean + (variance / 2).exp() * noise)
        poses = net.decoder(z, data["pose"][:, :SEEDS], data["pose"])
    expected = np.abs(poses.numpy() - data["pose"].numpy()).mean()
    assert net.loss(Batch(data.arrays, StepRandom(0, 0)), 0)["l1"].item() == pytest.approx(expected, rel=1e-5)
    spoken = net.decoder(mean, data["pose"][:, :SEEDS], data["pose"])
    figure = (spoken - data["pose"]).abs().mean().item()
    assert net.validate(data)["speech_l1"].item() == pytest.approx(figure, rel=1e-5)


def test_poses_that_are_no_bones_are_told():
    with pytest.raises(InputError, match="graph of 9 bones"):
        Speech2AffectiveGestures(Speech2AffectiveGesturesConfig(hidden=4), pose=30, audio=14, speakers=2)
