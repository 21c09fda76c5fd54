"""Seq2seq: what each pose is made of, and what is optimised."""

from __future__ import annotations

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="networks need torch (the train extra)")

from cospeech.errors import InputError  # noqa: E402
from cospeech.models.nn.modalities import SEEDS  # noqa: E402
from cospeech.models.seq2seq import Seq2Seq, Seq2SeqConfig  # noqa: E402
from tests.models.test_contract import batch, network, ready  # noqa: E402

torch.set_num_threads(1)


def attend(net, state: np.ndarray, read: np.ndarray) -> np.ndarray:
    """The attention of Bahdanau et al. 2015 for one row; W is one matrix, applied to [state, read]."""
    a = net.attention
    whole = np.concatenate([a.of_state.weight.detach().numpy(), a.of_read.weight.detach().numpy()], 1)
    fit = [a.v.detach().numpy() @ np.tanh(whole @ np.concatenate([state, e]) + a.of_state.bias.detach().numpy()) for e in read]
    weights = np.exp(fit) / np.exp(fit).sum()
    return weights @ read


def test_attention_is_of_state_and_reading_together():
    net = network("seq2seq")
    rng = np.random.default_rng(0)
    state, read = rng.normal(size=(2, 8)).astype(np.float32), rng.normal(size=(2, 5, 8)).astype(np.float32)
    contexts = net.attention(torch.from_numpy(state), torch.from_numpy(read)).detach().numpy()
    assert np.allclose(contexts, [attend(net, *pair) for pair in zip(state, read, strict=True)], atol=1e-6)


def test_poses_follow_from_the_four_that_are_given_and_from_words():
    net, arrays = ready("seq2seq"), batch(network("seq2seq")).arrays
    poses = net.play(arrays)["pose"]
    assert torch.equal(poses[:, 0], arrays["pose"][:, 0])
    for k in range(len(poses[0])):
        other = arrays["pose"].clone()
        other[:, k] += 1
        change = (net.play(arrays | {"pose": other})["pose"] - poses).abs().amax((0, 2))
        assert (change[k + 1 :] > 0).all() if k < SEEDS else not change.any()
        assert not change[1 : k + 1].any()  # nothing before it
    words = arrays["text"].clone()
    words[:, -1] = 5
    assert (net.play(arrays | {"text": words})["pose"] - poses)[:, 1:].abs().amax((0, 2)).min() > 0  # it reads ahead


def test_what_may_be_lacking():
    net, arrays = ready("seq2seq"), batch(network("seq2seq")).arrays
    silent = net.play(arrays | {"text": torch.zeros_like(arrays["text"])})["pose"]
    assert torch.equal(net.play(arrays, ("text",))["pose"], silent)
    assert not net.play(arrays, ("seed",))["pose"][:, 0].any()
    assert torch.equal(net.play(arrays, ("face", "emotion", "speaker"))["pose"], net.play(arrays)["pose"])
    with pytest.raises(InputError, match="no input"):
        net.play(arrays, ("speech",))


def test_the_loss_by_hand():
    net = ready("seq2seq")
    data = batch(net)
    poses, pose = net.play(data.arrays)["pose"].numpy(), data["pose"].numpy()
    rows, frames, numbers = poses.shape
    norms = sum(np.sqrt((poses[b, :, d] ** 2).sum()) for b in range(rows) for d in range(numbers))
    expected = {
        "regression": 250 * ((poses - pose) ** 2).mean(),
        "continuity": 0.1 * sum(np.abs(poses[:, t] - poses[:, t - 1]).sum() for t in range(1, frames)) / poses.size,
        "variance": -25 * norms / poses.size,
    }
    terms = {name: value.item() for name, value in net.loss(data, 0).items()}
    assert terms == pytest.approx(expected, rel=1e-4)


def test_the_size_is_that_of_the_authors_later_code():
    """By hand: a reader of 1,324,800, a decoder of 482,400 and what is around it; theirs have 300 numbers of a word too."""
    with torch.device("meta"):
        net = Seq2Seq(Seq2SeqConfig(), pose=27)
    gru = lambda inputs, hidden: 3 * hidden * (inputs + hidden + 2)  # noqa: E731
    reader = 2 * gru(300, 200) + 2 * gru(400, 200)
    decoder = gru(200, 200) + gru(200, 200)
    around = (400 * 200 + 200) + 200 + (227 * 200 + 200) + 2 * 200 + (200 * 27 + 27)
    assert sum(p.numel() for p in net.parameters()) - 2001 * 300 == reader + decoder + around
    assert (reader, decoder) == (1_324_800, 482_400)
    assert reader + decoder + around + 26_000 * 300 == 9_739_027
