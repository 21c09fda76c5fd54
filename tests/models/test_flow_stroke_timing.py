"""The flow's own play in training: that it is what generation plays, and that strokes can learn from it when to come."""

from __future__ import annotations

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="networks need torch (the train extra)")

from cospeech.errors import InputError  # noqa: E402
from cospeech.models.nn.objective import Batch, StepRandom  # noqa: E402
from cospeech.models.nn.speed_distance import timing_distance  # noqa: E402
from cospeech.models.stylised_flow_extended import FlowExtendedConfig, StylisedFlowExtended  # noqa: E402
from cospeech.runtime.flow.weights import FlowSizes  # noqa: E402

SMALL = {
    "steps": 2, "hidden": 16, "layers": 1, "history": 5, "look_ahead": 3, "frames": 32, "encoder_channels": 8,
    "encoder_blocks": 1, "residual": True, "inertia": 0.7, "steps_seen": True, "reconstruction": 0.0, "perceptual": 0.0,
    "pose_noise": 0.01,
}  # fmt: skip


def network(**settings) -> StylisedFlowExtended:
    torch.manual_seed(0)
    return StylisedFlowExtended(FlowExtendedConfig(**(SMALL | settings)), pose=4, audio=2)


def batch(net: StylisedFlowExtended, step: int, rows: int = 24) -> Batch:
    """Poses that jump to another place where the speech has an accent, and rest between."""
    rng = np.random.default_rng(step)
    accents = (rng.random((rows, net.window)) < 0.08).astype(np.float32)
    poses = np.zeros((rows, net.window, 4), np.float32)
    for row in range(rows):
        place = rng.normal(size=4)
        for t in range(net.window):
            if accents[row, t]:
                place = rng.normal(size=4)
            poses[row, t] = place if t == 0 else 0.5 * poses[row, t - 1] + 0.5 * place
    audio = np.stack([accents, rng.normal(size=accents.shape).astype(np.float32)], -1)
    return Batch({"pose": torch.from_numpy(poses), "audio": torch.from_numpy(audio)}, StepRandom(0, step))


def terms(net: StylisedFlowExtended, step: int) -> dict[str, float]:
    return {name: float(term.detach()) for name, term in net.loss(batch(net, step), step).items()}


def test_the_term_is_there_every_so_many_steps_and_not_by_itself():
    assert set(terms(network(), 0)) == {"nll"}
    net = network(stroke_timing=2.0, stroke_timing_every=3)
    assert [set(terms(net, step)) for step in range(4)] == [
        {"nll", "stroke_timing"},
        {"nll"},
        {"nll"},
        {"nll", "stroke_timing"},
    ]


def test_norms_can_keep_the_statistics_of_histories_without_hidden_poses():
    """The statistics are then those of a network that hides nothing; what is learnt from a batch stays the same."""

    def train(**settings) -> tuple[dict[str, float], torch.Tensor]:
        net = network(stroke_timing=2.0, steps_seen=False, **settings).train()
        for each in net.flow.steps:
            torch.nn.init.normal_(each.coupling.net.out.weight, std=0.2)
        figures = [terms(net, step) for step in range(2)]
        return figures[0], torch.cat([value for name, value in net.named_buffers() if "running" in name])

    _, of_whole_histories = train(history_dropout=0.0)
    first, usual = train(history_dropout=0.6)
    first_of_ours, ours = train(history_dropout=0.6, whole_history_norms=True)
    assert torch.equal(ours, of_whole_histories)
    assert float((usual - of_whole_histories).abs().max()) > 0.01
    assert first_of_ours["nll"] == first["nll"]
    assert first_of_ours["stroke_timing"] != first["stroke_timing"]  # self-play has these statistics
    with pytest.raises(InputError, match="with steps_seen"):
        network(steps_seen=True, whole_history_norms=True)


@pytest.mark.parametrize("style", [0, 3])
def test_it_judges_what_generation_plays(style):
    net = network(stroke_timing=2.0, style=style, style_window=12).eval()
    for each in net.flow.steps:
        each.norm.logs.data.fill_(3.0)  # small steps: poses stay where none is cut off
    given = batch(net, 5)
    pose, audio, tau = given["pose"][:, net.style_frames :], given["audio"][:, net.style_frames :], net.config.history
    z = net.flow.latent.sample(StepRandom(0, 5).normal, len(pose), net.config.frames)
    code = net.style(given["pose"][:, : net.style_frames])
    with torch.no_grad():
        poses = net.sample(z, pose[:, :tau], audio, code)
        term = 2.0 * timing_distance(poses.mT, pose[:, tau : tau + net.config.frames].mT)
        assert float(net.loss(given, 0)["stroke_timing"]) == pytest.approx(float(term), rel=1e-4)


def test_its_means_of_batches_are_left_as_they_are():
    net = network(stroke_timing=2.0)
    net.loss(batch(net, 0), 0)
    once = net.encoder.speech.first_norm.running_mean.clone()
    net._play_window(
        batch(net, 0)["pose"], net._windows(*map(batch(net, 0).arrays.get, ("pose", "audio")))[2], None, StepRandom(0, 0)
    )
    assert torch.equal(once, net.encoder.speech.first_norm.running_mean)
    assert net.encoder.training


def test_its_slope_reaches_through_what_was_played():
    net = network(stroke_timing=1.0)
    given, optimiser, losses = batch(net, 3), torch.optim.Adam(net.parameters(), 1e-2), []
    for _ in range(15):
        optimiser.zero_grad()
        term = net.loss(Batch(given.arrays, StepRandom(0, 3)), 0)["stroke_timing"]
        term.backward()
        optimiser.step()
        losses.append(float(term.detach()))
    assert losses[-1] < losses[0] - 0.2


def test_a_bundle_is_told_the_scale_of_its_latents():
    assert network().runtime_sizes()["latent_scale"] == 1.0
    net = network(latent_scale=0.7)
    assert FlowSizes(**net.runtime_sizes()).latent_scale == 0.7
    assert terms(net, 1) == terms(network(), 1), "training does not know it"
