"""Manner: a classifier that names who moves, and sees neither the mean nor the size of poses."""

from __future__ import annotations

import pytest

torch = pytest.importorskip("torch", reason="networks need torch (the train extra)")

from cospeech.models.nn.manner import MannerClassifier  # noqa: E402
from tests.models.test_chain_of_generation import batch, chain  # noqa: E402

torch.set_num_threads(1)


def walk(*shape: int, seed: int = 0):
    return torch.randn(*shape, generator=torch.Generator().manual_seed(seed))


def test_manner_is_blind_to_mean_and_size_and_sees_which_parts_move_together():
    torch.manual_seed(0)
    net, pose = MannerClassifier(4, 8, 3), walk(2, 4, 64).cumsum(2)
    size = torch.tensor([0.5, 1.0, 2.0, 4.0]).view(1, 4, 1)
    with torch.no_grad():
        plain = net(pose)
        assert plain.shape == (2, 3)
        same = (net(size * pose + 7 * size) - plain).abs().max()  # not 0: numbers that hardly vary count as still
        others = [(net(other) - plain).abs().max() for other in (pose.flip(1), pose[:, :, ::2].repeat_interleave(2, 2))]
        assert min(others) > 20 * same
        assert torch.isfinite(net(torch.zeros(1, 4, 64))).all()


def test_manner_learns_from_recordings_alone_and_moves_what_is_generated():
    torch.manual_seed(0)
    net, recorded, speaker = MannerClassifier(4, 8, 3), walk(3, 4, 64).cumsum(2), torch.arange(3)
    made = walk(3, 4, 64, seed=1).cumsum(2).requires_grad_()
    terms = net.terms(2.0, recorded, made, speaker)
    terms["manner"].backward(retain_graph=True)
    assert all(value.grad is None for value in net.parameters())
    assert made.grad.abs().amax() > 0
    terms["manner_recorded"].backward()
    assert all(value.grad.abs().max() > 0 for value in net.parameters())
    assert net.terms(2.0, recorded, recorded, speaker)["manner"] == 2 * terms["manner_recorded"]


def test_manner_tells_two_kinds_of_movement_apart():
    """The same numbers, in the same range; in one kind the second follows the first, in the other it goes against it."""
    torch.manual_seed(0)
    net, kinds = MannerClassifier(2, 8, 2), torch.tensor([1.0, -1.0]).repeat(16)

    def draw(seed: int):
        steps = walk(32, 1, 64, seed=seed).cumsum(2)
        return torch.cat([steps, kinds.view(-1, 1, 1) * steps + 0.1 * walk(32, 1, 64, seed=seed + 1)], 1)

    learner = torch.optim.Adam(net.parameters(), 3e-3)
    for step in range(60):
        learner.zero_grad()
        pose = draw(2 * step)
        net.terms(0.0, pose, pose, (kinds < 0).long())["manner_recorded"].backward()
        learner.step()
    with torch.no_grad():
        assert (net(draw(1001)).argmax(1) == (kinds < 0)).float().mean() > 0.9


def test_the_chain_is_told_whose_manner_it_should_have_and_the_classifier_learns_beside_it():
    net, plain = chain(manner=2.0, frames=22).train(), chain(frames=22).train()
    terms, before = (each.gesture_loss(batch(each), 0) for each in (net, plain))
    assert terms.keys() - before.keys() == {"manner", "manner_recorded"}
    learning = net.objectives()["gestures"].parameters
    names = {id(value): name.split(".")[0] for name, value in net.named_parameters()}
    for term, moved in (("manner_recorded", {"manner"}), ("manner", {"speech_encoder", "word", "cascade"})):
        found = torch.autograd.grad(terms[term], learning, allow_unused=True, retain_graph=True)
        pairs = zip(learning, found, strict=True)
        assert {names[id(value)] for value, g in pairs if g is not None and g.abs().max() > 0} == moved
