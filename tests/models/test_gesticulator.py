"""Gesticulator: what each pose is made of, where in a word a frame is, what is fed back when, and what is optimised."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="networks need torch (the train extra)")

from cospeech.errors import InputError  # noqa: E402
from cospeech.models.gesticulator import TEMPO, Gesticulator, GesticulatorConfig, mark_words, word_timing  # noqa: E402
from tests.models.test_contract import ROWS, batch, network, ready  # noqa: E402

torch.set_num_threads(1)


def test_the_core_is_as_large_as_the_authors():
    """The authors' network has 64 numbers of sound, 768 of BERT, 5 of timing, 45 of a pose; measured without BERT."""
    with torch.device("meta"):
        net = Gesticulator(GesticulatorConfig(), pose=45, audio=64, text=768)
        ours = Gesticulator(GesticulatorConfig(), pose=45, audio=64)
    assert sum(p.numel() for p in net.parameters()) == 2_756_147
    fewer, table = (768 - 300) * 248, 2001 * 300  # numbers of a word that enter the first layer; rows that are learnt
    assert sum(p.numel() for p in ours.parameters()) == 2_756_147 - fewer + table
    assert net.window == 10 + 40 + 19


def test_where_in_a_word_a_frame_is():
    words = [0, 0, 1, 1, 1, 2, 0, 3, 3, 3, 3]  # 0: silence
    vectors = torch.tensor([[0.0, 0.0], [0.3, 0.1], [0.3, 0.2], [-1.0, 0.0]])[words]
    starts = [k for k, word in enumerate(words) if k == 0 or word != words[k - 1]] + [len(words)]
    expected = np.zeros((len(words), 5))
    for begin, end in pairwise(starts):
        for k in range(begin, end) if words[begin] else ():
            since, left, whole = TEMPO * (k - begin + 1), TEMPO * (end - k), TEMPO * (end - begin)
            expected[k] = since, left, whole, since / whole, 1 / whole
    marks = mark_words(vectors[None])
    assert marks[0, :, 0].tolist() == [float(word > 0) for word in words]
    assert torch.equal(mark_words(vectors[None, 3:], vectors[None, 2:3]), marks[:, 3:])
    assert np.allclose(word_timing(marks[0]), expected, atol=1e-6)
    assert np.allclose(word_timing(marks.repeat(2, 3, 1, 1)), expected, atol=1e-6)
    cut = word_timing(marks[0, 3:8])  # a stretch shows no more of a word than it holds
    assert np.allclose(cut[:2, :3], [[TEMPO, 2 * TEMPO, 2 * TEMPO], [2 * TEMPO, TEMPO, 2 * TEMPO]])
    assert np.allclose(cut[-1], [TEMPO, TEMPO, TEMPO, 1, 1 / TEMPO])


def linear(layer, x):
    return layer.weight.detach().numpy() @ x + layer.bias.detach().numpy()


def test_a_pose_by_hand():
    net = ready("gesticulator")
    data = batch(net)
    rows = torch.cat([data["audio"], net.embedding(data["text"])], -1).detach()
    stretch, before = rows[1, : net.length], torch.randn(3 * net.pose)
    with_timing = np.concatenate([stretch, word_timing(mark_words(stretch[None, :, net.audio :])[0])], 1)
    first = torch.nn.Linear(net.rows + 5, 1)  # both halves of the first layer as one
    first.weight = torch.nn.Parameter(torch.cat([net.entry.weight, net.timing.weight], 1))
    first.bias = net.timing.bias
    codes = [np.tanh(linear(net.frame[2], np.tanh(linear(first, row)))) for row in with_timing]
    h = np.tanh(linear(net.stretch[3], np.tanh(linear(net.stretch[0], np.concatenate(codes)))))
    gain, shift = np.split(np.tanh(linear(net.film[0], before.numpy())), 2)
    expected = linear(net.out[3], np.tanh(linear(net.out[0], h * (1 + gain) + shift)))
    pose = net.move(net.hear(net.enter(stretch[None])), before[None])[0].detach()
    assert np.allclose(pose, expected, atol=1e-5)
    plain = linear(net.out[3], np.tanh(linear(net.out[0], h)))
    assert np.allclose(net.move(net.hear(net.enter(stretch[None])), None)[0].detach(), plain, atol=1e-5)


def test_the_schedule_is_that_of_the_authors_code():
    config = GesticulatorConfig(epoch=10, plain_epochs=7, forcing=16)
    assert [config.forcing_at(10 * epoch + 9) for epoch in range(12)] == [None] * 7 + [16, 8, 4, 2, 2]
    assert GesticulatorConfig(plain_epochs=0, forcing=2).forcing_at(10**9) == 2


def test_after_two_of_so_many_frames_choose_poses_are_fed_back():
    net = network("gesticulator", dropout=0.0, pose_dropout=0.0)
    pose, tau = batch(net)["pose"], net.config.history
    true_history = net._choose_poses(pose, 4)
    assert [*true_history] == [t - tau for t in range(tau, tau + net.config.frames) if t % 4 in (0, 1)]
    for t, before in true_history.items():
        last = [pose[:, t + tau - k] for k in range(3)]
        assert torch.equal(before, torch.cat(last, 1))
    data = batch(net.train())
    losses = {step: net.loss(data, step)["pose"].item() for step in (0, 2 * 7, 2 * 10, 2 * 11)}
    assert len({round(value, 5) for value in losses.values()}) == 3  # none, two of 16, all, all
    assert losses[2 * 10] == losses[2 * 11]
    rows = torch.cat([data["audio"], net.embedding(data["text"])], -1)
    blank, true = torch.zeros(ROWS, 3 * net.pose), data["pose"][:, tau : tau + net.config.frames]
    poses = net(rows, blank, net._choose_poses(data["pose"], 2))
    assert losses[2 * 10] == pytest.approx((poses - true).square().mean().item(), rel=1e-6)


def test_the_loss_by_hand():
    net = ready("gesticulator")
    data, c = batch(net), net.config
    rows = torch.cat([data["audio"], net.embedding(data["text"])], -1)
    poses = net(rows, torch.zeros(ROWS, 3 * net.pose)).detach().numpy()
    true = data["pose"][:, c.history : c.history + c.frames].numpy()
    steps = [x[:, 1:] - x[:, :-1] for x in (poses, true)]
    expected = {"pose": ((poses - true) ** 2).mean(), "velocity": 0.6 * ((steps[0] - steps[1]) ** 2).mean()}
    assert {name: value.item() for name, value in net.loss(data, 0).items()} == pytest.approx(expected, rel=1e-4)


def test_a_pose_hears_half_a_second_before_it_and_one_after_it():
    net = ready("gesticulator")
    data, c = batch(net), net.config
    rows = torch.cat([data["audio"], net.embedding(data["text"])], -1).detach()
    poses = net(rows, None)
    for k in range(rows.shape[1]):
        other = rows.clone()
        other[:, k, : net.audio] += 1
        has_changed = (net(other, None) - poses).abs().amax((0, 2)) > 0
        t = np.arange(c.frames) + c.history
        assert np.array_equal(has_changed, (t - c.history <= k) & (k <= t + c.look_ahead))


def test_it_goes_on_from_the_poses_that_are_given():
    net, arrays = ready("gesticulator"), batch(network("gesticulator")).arrays
    tau, poses = net.config.history, net.play(arrays)["pose"]
    assert poses.shape == arrays["pose"].shape
    assert torch.equal(poses[:, :tau], arrays["pose"][:, :tau])
    later, last = arrays["pose"].clone(), arrays["pose"].clone()
    later[:, tau:] += 1
    last[:, tau - 1] += 1
    assert torch.equal(net.play(arrays | {"pose": later})["pose"], poses)
    assert (net.play(arrays | {"pose": last})["pose"] - poses)[:, tau:].abs().amax((0, 2)).min() > 0
    assert not net.play(arrays, ("seed",))["pose"][:, :tau].any()
    silent = net.play(arrays | {"text": torch.zeros_like(arrays["text"])})["pose"]
    assert torch.equal(net.play(arrays, ("text",))["pose"], silent)
    assert not torch.equal(silent, poses)
    with pytest.raises(InputError, match="no input"):
        net.play(arrays, ("speech",))


def test_frame_by_frame_it_makes_what_it_makes_of_the_whole():
    net, arrays = ready("gesticulator"), batch(network("gesticulator")).arrays
    live = net.export_module()["live"]
    rows = torch.cat([arrays["audio"], net.embedding(arrays["text"])], -1).detach()
    blank = torch.zeros(ROWS, net.length - 1, net.rows)
    whole = net(torch.cat([blank, rows], 1), torch.zeros(ROWS, 3 * net.pose)).detach()  # as if zeros were before it
    states = [torch.zeros(ROWS, width) for width in live.states.values()]
    with torch.no_grad():
        for t in range(rows.shape[1]):
            poses, *states = live.module(rows[:, t], *states)
            assert torch.allclose(poses, whole[:, t], atol=1e-5)


@pytest.mark.parametrize("wrong", [{"dropout": 1.0}, {"poses": 9}, {"forcing": 1}, {"look_ahead": -1}])
def test_settings_that_are_none_are_told(wrong):
    with pytest.raises(InputError, match="Gesticulator"):
        GesticulatorConfig.tiny(**wrong)
