"""The stylised flow against the authors' code, and runs and bundles from before the ReLU at the end of its TCNs."""

from __future__ import annotations

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="networks need torch (the train extra)")

from cospeech.models import find_bundle  # noqa: E402
from cospeech.models.nn.conditioning import GlobalEncoder  # noqa: E402
from cospeech.models.stylised_flow import FlowConfig, StylisedFlow  # noqa: E402
from cospeech.runtime.flow.latent_sources import flow_of  # noqa: E402
from cospeech.runtime.flow.weights import FlowSizes  # noqa: E402
from cospeech.runtime.model import TrainedModel  # noqa: E402
from cospeech.training.checkpoint import build_model  # noqa: E402


def fill(net: torch.nn.Module) -> torch.nn.Module:
    """A network with the numbers of one generator, parameter by parameter."""
    rng = np.random.default_rng(5)
    with torch.no_grad():
        for value in net.parameters():
            shape = tuple(value.shape)
            numbers = rng.normal(size=shape) / np.sqrt(np.prod(shape[1:])) if len(shape) > 1 else rng.uniform(-0.5, 1, shape)
            value.copy_(torch.from_numpy(numbers))
    return net


@pytest.mark.parametrize(
    ("training", "first", "total"),
    [
        (True, [1.013117790222168, 0.12705349922180176, 1.5833719968795776], 30.053342819213867),
        (False, [0.9901846647262573, 0.20750129222869873, 1.4693950414657593], 30.84842300415039),
    ],
    ids=["training", "evaluation"],
)
def test_the_global_encoder_gives_what_the_authors_gives(training, first, total):
    """Values of the authors' `Global_Encoder` (GFGE glow/ae_model.py) with the same parameters, one batch seen."""
    rng = np.random.default_rng(6)
    poses, audio = (torch.from_numpy(rng.normal(size=(2, 3, *s)).astype(np.float32)) for s in ((12, 27), (13, 29)))
    net = fill(GlobalEncoder(27, 29, channels=256, blocks=5, feature=32, oldest=True, relu=True))
    with torch.no_grad():
        net(poses, audio)
        out = net.train(training)(poses, audio)
        without = fill(GlobalEncoder(27, 29, channels=256, blocks=5, feature=32, oldest=True, relu=False))(poses, audio)
    assert out[0, 0, :3].tolist() == pytest.approx(first, abs=1e-4)
    assert float(out.sum()) == pytest.approx(total, abs=1e-3)
    assert abs(float(without.sum()) - total) > 3


def test_a_tcn_ends_in_a_relu_unless_a_run_was_trained_without():
    facts = {"model": "stylised-flow", "sizes": {"pose": 4, "audio": 3}, "needs": {}}
    settings = {"steps": 1, "hidden": 4, "encoder_channels": 4, "encoder_blocks": 1}
    assert FlowConfig().encoder_relu
    assert not build_model(facts | {"config": settings}).config.encoder_relu  # a run from before the setting
    assert build_model(facts | {"config": settings | {"encoder_relu": True}}).config.encoder_relu


def test_a_bundle_says_whether_its_encoder_ends_in_a_relu():
    path = find_bundle("stylised-flow")
    assert path is not None
    assert flow_of(TrainedModel.open(path).system).sizes.encoder_relu
    sizes = StylisedFlow(FlowConfig(**FlowConfig.TINY), pose=4, audio=3).runtime_sizes()
    assert FlowSizes(**sizes).encoder_relu
    assert not FlowSizes(**{name: value for name, value in sizes.items() if name != "encoder_relu"}).encoder_relu
