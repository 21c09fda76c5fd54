"""The network that recognises styles: who learns from what, and which style self-play is to have."""

from __future__ import annotations

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="networks need torch (the train extra)")
from torch.nn import functional as F  # noqa: E402

from cospeech.errors import InputError  # noqa: E402
from cospeech.models.nn.objective import Batch, StepRandom  # noqa: E402
from cospeech.models.nn.style_recogniser import StyleRecogniser  # noqa: E402
from cospeech.models.stylised_flow_extended import FlowExtendedConfig, StylisedFlowExtended  # noqa: E402

SMALL = {
    "steps": 2, "hidden": 16, "layers": 1, "history": 5, "look_ahead": 3, "frames": 24, "encoder_channels": 8,
    "encoder_blocks": 1, "residual": True, "inertia": 0.7, "steps_seen": True, "reconstruction": 0.0, "perceptual": 0.0,
    "style": 4, "style_window": 24, "style_gap": 10,
}  # fmt: skip


def network(**settings) -> StylisedFlowExtended:
    torch.manual_seed(0)
    return StylisedFlowExtended(FlowExtendedConfig(**(SMALL | settings)), pose=4, audio=2, speakers=4)


def waves(rows: int, frames: int, seed: int) -> torch.Tensor:
    """Motion whose style is its frequency, between .5 and 3 rad a frame; phases are by chance."""
    rng = np.random.default_rng(seed)
    rates, phases = np.linspace(0.2, 1.2, rows)[:, None, None], rng.uniform(0, 2 * np.pi, (rows, 1, 4))
    return torch.from_numpy(np.sin(rates * np.arange(frames)[None, :, None] + phases).astype(np.float32))


def batch(net: StylisedFlowExtended, step: int, rows: int = 12) -> Batch:
    poses = waves(rows, net.window, step)
    arrays = {"pose": poses, "audio": torch.zeros(rows, net.window, 2), "speaker": torch.arange(rows) // 3}
    return Batch(arrays, StepRandom(0, step))


def test_of_self_play_the_motion_learns_alone():
    torch.manual_seed(0)
    recogniser, speaker = StyleRecogniser(4, channels=8, speakers=3), torch.arange(6) % 3
    motion, parameters = waves(6, 20, 0).requires_grad_(), list(recogniser.parameters())
    slopes = torch.autograd.grad(recogniser.of_self_play(motion, speaker), [motion, *parameters], allow_unused=True)
    assert slopes[0].abs().max() > 0
    assert [*slopes[1:]] == [None] * len(parameters)


def test_it_learns_whose_motion_it_is():
    torch.manual_seed(0)
    recogniser, speaker = StyleRecogniser(4, channels=16, speakers=4), torch.arange(12) // 3
    optimiser, losses = torch.optim.Adam(recogniser.parameters(), 1e-2), []
    for step in range(60):
        loss = F.cross_entropy(recogniser(waves(12, 24, step)), speaker)
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
        losses.append(loss.item())
    assert losses[0] > 1.2
    held_out = waves(12, 24, 10_000)
    recogniser.eval()
    assert (recogniser(held_out).argmax(1) == speaker).float().mean() > 0.9
    assert recogniser.of_self_play(held_out, speaker).item() < 0.4
    assert recogniser.of_self_play(held_out, speaker.roll(3)).item() > 2


def test_the_networks_of_styles_come_first_and_stay():
    net = network(style_recognition=2.0, style_steps=7).train()
    style, flow = net.objectives().values()
    assert list(net.objectives()) == ["style", "flow"]
    assert (net.preliminary_steps, style.stop, flow.start) == (7, 7, 7)
    first = [*net.recogniser.parameters(), *net.stylist.parameters(), *net.speaker_of_code.parameters()]
    assert {id(value) for value in style.parameters} == {id(value) for value in first}
    assert len({id(v) for part in (style, flow) for v in part.parameters}) == len(list(net.parameters()))
    terms = style.loss(batch(net, 0), 0)
    assert set(terms) == {"code", "motion"}
    assert all(slope.abs().max() > 0 for slope in torch.autograd.grad(sum(terms.values()), first))
    before = {name: value.clone() for name, value in net.state_dict().items() if name.startswith("stylist")}
    slopes = torch.autograd.grad(sum(flow.loss(batch(net, 7), 8).values()), first, allow_unused=True)
    assert slopes == (None,) * len(first)
    assert all(torch.equal(value, net.state_dict()[name]) for name, value in before.items()), "its norm keeps its statistics"
    assert (network().preliminary_steps, list(network().objectives())) == (0, ["flow"])


def test_neither_a_mean_pose_nor_an_amplitude_is_a_manner():
    torch.manual_seed(0)
    recogniser, motion = StyleRecogniser(4, channels=8, speakers=3).eval(), 20 * waves(6, 20, 0)
    others = (motion + torch.randn(6, 1, 4), motion * torch.linspace(1, 5, 4), motion.roll(1, 0))
    differences = [(recogniser(motion) - recogniser(other)).abs().max().item() for other in others]
    assert max(differences[:2]) < 0.2 * differences[2]


def test_terms_are_there_with_their_weight_and_the_second_every_so_many_steps():
    net = network(style_recognition=2.0, stroke_timing_every=3).train()
    names = [set(net.loss(batch(net, step), step)) for step in range(4)]
    assert names == [{"nll", "style_self_play"}, {"nll"}, {"nll"}, {"nll", "style_self_play"}]
    one, other = (
        each.eval().loss(batch(each, 0), 0)
        for each in (network(style_recognition=weight, stroke_timing_every=3) for weight in (2.0, 4.0))
    )
    assert other["style_self_play"].item() == pytest.approx(2 * one["style_self_play"].item(), rel=1e-4)
    assert network().recogniser is None
    assert (network().dimensions_for(network().config), net.dimensions_for(net.config)) == (
        ("pose", "audio"),
        ("pose", "audio", "speakers"),
    )


def test_half_of_self_play_has_the_styles_of_other_recordings(monkeypatch):
    """Each motion is then judged by the speaker with whose code it was played; without training, all have their own."""
    net = network(style_recognition=1.0, stroke_timing_every=1)
    codes, styles, speakers, own = torch.arange(48.0).view(12, 4), [], [], []
    play, judge = net._play_window, net.recogniser.of_self_play
    monkeypatch.setattr(net, "style", lambda poses: codes)
    monkeypatch.setattr(net, "_play_window", lambda *given: styles.append(given[2]) or play(*given))
    monkeypatch.setattr(net.recogniser, "of_self_play", lambda motion, who: speakers.append(who) or judge(motion, who))
    for step in range(12):
        given = batch(net, step)
        net.train(step < 10).loss(given, step)
        own.append(torch.equal(styles[-1], codes))
        turn = 0 if own[-1] else 1
        assert torch.equal(styles[-1], codes.roll(turn, 0))
        assert torch.equal(speakers[-1], given["speaker"].roll(turn, 0))
    assert 2 <= sum(own[:10]) <= 8
    assert own[10:] == [True, True]


@pytest.mark.parametrize("settings", [{"style": 0, "style_recognition": 1.0}, {"style_recognition": -1.0}, {"style_gap": -1}])
def test_settings_that_do_not_fit_are_told(settings):
    with pytest.raises(InputError, match="neither is negative, and the first needs style codes and speakers"):
        network(**settings)


def test_the_style_comes_from_before_the_gap():
    net = network(style_gap=10).eval()
    for each in net.flow.steps:
        torch.nn.init.normal_(each.coupling.net.out.weight, std=0.2)
    given = batch(net, 0)
    inside = {name: value.clone() for name, value in given.arrays.items()}
    inside["pose"][:, 24:34] += 5
    before = {name: value.clone() for name, value in given.arrays.items()}
    before["pose"][:, :24] += 5
    terms = [net.loss(Batch(arrays, StepRandom(0, 0)), 0)["nll"].item() for arrays in (given.arrays, inside, before)]
    assert net.window == 24 + 10 + 5 + 24 + 3
    assert terms[0] == terms[1] != terms[2]
