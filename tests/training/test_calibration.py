"""What a network by windows makes, sized at bundling: on the speech of its data it has each speaker's mean and movement."""

from __future__ import annotations

from dataclasses import replace

import pytest

torch = pytest.importorskip("torch", exc_type=ImportError)

import numpy as np  # noqa: E402

from cospeech.models.nn.objective import StepRandom  # noqa: E402
from cospeech.models.nn.smooth_noise import smooth_noise  # noqa: E402
from cospeech.runtime.network import Network  # noqa: E402
from cospeech.training.export.calibration import FASTER, GAINS, calibrate  # noqa: E402
from tests.support.exports import export_graphs  # noqa: E402
from tests.support.runtime_bundles import small_statistics  # noqa: E402
from tests.support.windowed_networks import KINDS, make_network  # noqa: E402

SPEAKERS, FPS = 3, 12.0  # noise lasts for a second


def examples(net) -> dict[str, torch.Tensor]:
    draw = torch.Generator().manual_seed(3)
    size = torch.tensor([0.5, 1.0, 1.5]).view(-1, 1, 1, 1)
    stretches = torch.randn(SPEAKERS, 4, 128, net.pose, generator=draw).cumsum(2) * 0.05 * size
    return {"stretches": stretches, "speech": torch.randn(SPEAKERS, 4, 128, net.audio, generator=draw)}


def calibrate_network(net, arrays_of_run, codes) -> tuple[torch.Tensor, torch.Tensor]:
    """(S, D) mean of the poses that the network makes, and (S, D) gain of each style."""
    low = export_graphs(net.export_module())
    network = Network(low.signatures["make"], low.graphs["make"], low.weights)
    plain = small_statistics((net.pose, net.audio), SPEAKERS, style_codes=codes.shape)
    plain = replace(plain, style_codes=codes.numpy().astype(np.float32))
    arrays = {name: value.numpy() for name, value in arrays_of_run.items()}
    statistics = calibrate({"make": network}, plain, arrays, FPS, columns=0, measures_noise=False)
    assert (statistics.noise_gain == 1).all()
    return torch.from_numpy(statistics.model_mean), torch.from_numpy(statistics.style_gain)


@pytest.mark.parametrize("name", KINDS)
def test_styles_have_their_speakers_mean_and_deviation_and_are_not_much_faster(name):
    net = make_network(name, speakers=SPEAKERS)
    arrays = examples(net)
    codes = net.speaker_styles(arrays["stretches"])
    means, gains = calibrate_network(net, arrays, codes)
    assert means.shape == gains.shape == (SPEAKERS, net.pose)
    speech = arrays["speech"].reshape(-1, 64, net.audio)
    noise = torch.zeros(24, 64, 0)
    if net.modes:
        noise = smooth_noise(StepRandom(0, 0), len(speech), net.modes, 64, FPS, normal=net.normal_noise).mT
    for k in range(SPEAKERS):
        with torch.no_grad():
            poses = net.make(speech, codes[k].expand(24, 64, -1), noise)
        result = gains[k] * (poses - means[k])
        torch.testing.assert_close(result.mean((0, 1)), torch.zeros(net.pose), atol=1e-4, rtol=0)
        own = arrays["stretches"][k].reshape(-1, 64, net.pose)
        within = [x.var(1).mean(0).sqrt() for x in (result, own)]
        speed = [x.diff(dim=1).square().mean((0, 1)).sqrt() for x in (result, own)]
        expected = gains[k] * torch.minimum(within[1] / within[0], FASTER * speed[1] / speed[0])
        torch.testing.assert_close(gains[k], expected.clamp(*GAINS), rtol=1e-3, atol=1e-6)
        is_free = gains[k] > GAINS[0]
        assert (speed[0][is_free] <= 1.001 * FASTER * speed[1][is_free]).all()


def test_gains_are_between_their_bounds_for_what_does_not_move():
    net = make_network("mix-stage", speakers=SPEAKERS)
    arrays = examples(net) | {"stretches": torch.zeros(SPEAKERS, 4, 128, net.pose)}
    _, gains = calibrate_network(net, arrays, torch.eye(SPEAKERS))
    assert (gains == GAINS[0]).all()
