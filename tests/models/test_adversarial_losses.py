"""The parts of adversarial training that are no networks: the losses of scores, and the noise that takes are drawn with."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from cospeech.models.nn.adversarial_losses import ADVERSARIAL_LOSSES
from cospeech.models.nn.objective import StepRandom
from cospeech.models.nn.smooth_noise import smooth_noise
from cospeech.runtime.mode_noise import SECONDS, SmoothNoise


@pytest.mark.parametrize("name", ADVERSARIAL_LOSSES)
def test_losses_draw_scores_the_way_they_say(name):
    judging = ADVERSARIAL_LOSSES[name]
    for loss, rises in ((judging.true, False), (judging.false, True), (judging.generator_loss, False)):
        scores = torch.tensor([0.4], requires_grad=True)
        loss(scores).backward()
        assert (scores.grad > 0) == rises


def test_logarithms_are_those_of_equation_7():
    scores = torch.linspace(-3, 3, 7)
    share = torch.sigmoid(scores)
    losses = ADVERSARIAL_LOSSES["logarithm"]
    torch.testing.assert_close(losses.true(scores), -torch.log(share).mean())
    torch.testing.assert_close(losses.false(scores), -torch.log(1 - share).mean())
    torch.testing.assert_close(losses.generator_loss(scores), torch.log(1 - share).mean())


def test_a_perfect_judge_loses_nothing():
    for name in ("distance", "squares"):
        assert ADVERSARIAL_LOSSES[name].true(torch.ones(3)) == ADVERSARIAL_LOSSES[name].false(torch.zeros(3)) == 0


def test_the_largest_logit_under_the_noise_is_drawn_as_the_softmax_says():
    logits = torch.tensor([1.0, 0.0, -1.0])
    noise = smooth_noise(StepRandom(0, 0), 20_000, 3, 2, 6.0)
    frequencies = (logits[:, None] + noise).argmax(1)[:, 0].bincount() / 20_000
    np.testing.assert_allclose(frequencies, torch.softmax(logits, 0), atol=0.015)


@pytest.mark.parametrize(
    ("normal", "mean", "deviation"), [(False, np.euler_gamma, np.pi / np.sqrt(6)), (True, 0, 1)], ids=["gumbel", "normal"]
)
def test_training_and_playing_have_the_same_noise(normal, mean, deviation):
    """Both have the same mean, deviation and correlation over time, although they are drawn by different code."""
    fps, frames = 12.0, 48
    training_noise = smooth_noise(StepRandom(1, 0), 3000, 1, frames, SECONDS * fps, normal=normal)[:, 0].numpy()
    played_noise = SmoothNoise(3000, fps, seed=1, normal=normal).draw(frames).T
    for rows in (training_noise, played_noise):
        assert abs(rows.mean() - mean) < 0.03
        assert abs(rows.std() - deviation) < 0.03
    for lag in (1, 4, 12):
        both = [np.corrcoef(rows[:, 20], rows[:, 20 + lag])[0, 1] for rows in (training_noise, played_noise)]
        assert abs(both[0] - both[1]) < 0.06
        assert (both[0] > 0.9) == (lag == 1)


def test_noise_is_finite_for_any_persistence():
    for persistence in (0.01, 1.0, 1e4):
        assert torch.isfinite(smooth_noise(StepRandom(0, 0), 2, 3, 64, persistence)).all()
