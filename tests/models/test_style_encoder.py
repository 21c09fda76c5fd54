"""The style code of the flow: what it is in training, and by what a bundle is calibrated."""

from __future__ import annotations

import pytest

torch = pytest.importorskip("torch", reason="networks need torch (the train extra)")

from cospeech.models.nn.conditioning import StyleEncoder  # noqa: E402
from cospeech.training.export import flow  # noqa: E402


def test_a_gradient_that_is_alike_in_all_rows_does_not_push_the_codes_to_their_ends():
    """Of motions that differ in size: the loss wants all codes larger, as the first steps of a training do."""
    torch.manual_seed(0)
    encoder = StyleEncoder(4, channels=8, style=6)
    optimiser = torch.optim.Adam(encoder.parameters(), 0.01)
    motions = torch.rand(64, 1, 1).add(0.2) * torch.randn(64, 48, 4).cumsum(1)
    for _ in range(100):
        optimiser.zero_grad()
        (1 - encoder(motions)).sum().backward()
        optimiser.step()
    codes = encoder.eval()(motions)
    assert codes.abs().max() <= 1
    assert codes.std(0).min() > 0.2
    assert (1 - codes.square()).mean() > 0.3  # the slope of tanh


def test_the_feedback_gain_is_chosen_by_stretches_of_one_length(monkeypatch):
    """Means of short stretches vary more: takes are compared with as many frames of the recordings."""
    torch.manual_seed(0)
    slow = 4 * torch.nn.functional.avg_pool1d(torch.randn(400, 3, 128 + 30), 31, 1).mT  # (N, 128, D)
    tail = slow[:, -94:]
    wander = tail.mean(1, keepdim=True)
    gains = len(flow.FEEDBACK_GAINS)
    takes = torch.stack([tail + 0.06 * (3 - k) * wander for k in range(gains)])  # the fourth is as the recordings are
    takes = torch.cat([torch.zeros(gains, 400, flow.WARM, 3), takes], 2)
    monkeypatch.setattr(flow, "_generate_freely", lambda *arguments: takes)

    class Residual:
        def runtime_sizes(self):
            return {"residual": True}

    gain, mean, deviation = flow._calibrate(Residual(), {"stretches": slow[None]}, torch.zeros(0), None)
    assert gain == flow.FEEDBACK_GAINS[3]
    torch.testing.assert_close(mean, tail.mean((0, 1)))
    torch.testing.assert_close(deviation, tail.std((0, 1)))
