"""What every network promises, whatever it is for; the tests iterate over the registries. Flows promise more: see the end."""

from __future__ import annotations

from dataclasses import replace
from importlib import import_module

import pytest

torch = pytest.importorskip("torch", reason="networks need torch (the train extra)")

from safetensors.torch import load_file, save_file  # noqa: E402

from cospeech.errors import InputError  # noqa: E402
from cospeech.models import MODELS, NETWORKS  # noqa: E402
from cospeech.nn.objective import Batch, Chance  # noqa: E402

torch.set_num_threads(1)
POSE, AUDIO, ROWS = 6, 5, 3
FLOWS = {
    "stylised-flow": "cospeech.models.stylised_flow:StylisedFlow",
}
_FLOW = {"steps": 2, "hidden": 8, "history": 4, "look_ahead": 2, "frames": 4}
TINY = {
    "gesture-autoencoder": {"frames": 18, "width": 8, "code": 4},
    "fgd-autoencoder": {"frames": 18, "channels": 4, "hidden": 16, "code": 4},
    "stylised-flow": _FLOW | {"encoder_channels": 8, "encoder_blocks": 2, "feature": 4},
}


def network_class(name: str):
    module, _, attribute = (FLOWS | NETWORKS | MODELS)[name].partition(":")
    return getattr(import_module(module), attribute)


NAMES = sorted(name for name in FLOWS | NETWORKS | MODELS if hasattr(network_class(name), "objectives"))


def network(name: str, seed: int = 0, pose: int = POSE, audio: int = AUDIO, **changes):
    """A small network, its zeros moved a little so that no gradient is zero for that reason alone."""
    torch.manual_seed(seed)
    kind = network_class(name)
    net = kind(kind.Config(**(TINY[name] | changes)), pose=pose, audio=audio)
    with torch.no_grad():
        for value in net.parameters():
            if not value.any():
                value.normal_(0, 0.05)
    return net


def batch(net, seed: int = 0, step: int = 0, rows: int = ROWS, pose: int = POSE, audio: int = AUDIO) -> Batch:
    """Walks, not noise: something that can be learnt."""
    draw = torch.Generator().manual_seed(seed)
    widths = {"pose": pose, "audio": audio}
    arrays = {
        name: torch.randn(rows, net.window, widths.get(name, 1), generator=draw).cumsum(1) / net.window**0.5
        for name in net.arrays
    }
    return Batch(arrays, Chance(seed, step))


def part(whole: Batch, row: int, step: int = 0) -> Batch:
    """One row of a batch, as one of so many processes would have it."""
    return Batch({k: v[row : row + 1] for k, v in whole.arrays.items()}, Chance(0, step, rank=row, parts=len(whole)))


def total(net, data: Batch, step: int = 0):
    return sum(sum(objective.loss(data, step).values()) for objective in net.objectives().values())


def ready(name: str, **options):
    """A network that has seen a batch (which sets ActNorm), in evaluation mode."""
    net = network(name, **options).train()
    with torch.no_grad():
        total(net, batch(net))
    return net.eval()


def test_every_registered_network_is_tested():
    assert set(NAMES) <= set(TINY)
    assert set(NETWORKS) <= set(NAMES)


@pytest.mark.parametrize("name", NAMES)
def test_losses_are_finite_numbers_and_leave_the_batch_alone(name):
    net = network(name)
    data = batch(net)
    before = {key: value.clone() for key, value in data.arrays.items()}
    for objective in net.objectives().values():
        for term in objective.loss(data, 0).values():
            assert term.shape == ()
            assert term.isfinite()
    assert all(torch.equal(before[key], data[key]) for key in before)


@pytest.mark.parametrize("name", NAMES)
def test_gradient_reaches_every_parameter(name):
    net = ready(name)
    optimised = {id(value) for objective in net.objectives().values() for value in objective.parameters}
    assert optimised == {id(value) for value in net.parameters()}
    total(net, batch(net)).backward()
    still = [key for key, value in net.named_parameters() if value.grad is None or not value.grad.abs().max() > 0]
    assert still == []
    assert all(value.grad.isfinite().all() for value in net.parameters())


@pytest.mark.parametrize("name", NAMES)
def test_the_same_seed_gives_the_same(name):
    first, again, other = (ready(name, seed=seed) for seed in (0, 0, 1))
    data = batch(first)
    losses = [total(net, Batch(data.arrays, Chance(0, 0))).item() for net in (first, again, other)]
    assert losses[0] == losses[1]
    assert losses[0] != losses[2]


@pytest.mark.parametrize("name", NAMES)
def test_rows_are_independent_of_each_other(name):
    net = ready(name)
    data = batch(net)
    with torch.no_grad():
        whole = total(net, data)
        single = [total(net, part(data, row)) for row in range(ROWS)]
    assert torch.allclose(whole, torch.stack(single).mean(), rtol=1e-5, atol=1e-6)
    assert len({round(value.item(), 4) for value in single}) == ROWS


@pytest.mark.parametrize("name", NAMES)
def test_saved_and_loaded_it_is_the_same_to_the_bit(name, tmp_path):
    net, other = ready(name), network(name, seed=1).eval()
    save_file({key: value.contiguous() for key, value in net.state_dict().items()}, tmp_path / "net.safetensors")
    other.load_state_dict(load_file(tmp_path / "net.safetensors"))
    data = batch(net)
    assert torch.equal(*(total(one, Batch(data.arrays, Chance(0, 0))) for one in (net, other)))


@pytest.mark.parametrize("name", NAMES)
def test_twenty_steps_lower_the_loss(name):
    net = ready(name)
    data = batch(net, rows=8)
    optimisers = {
        key: torch.optim.Adam(objective.parameters, 3e-3)
        for key, objective in ((key, o._replace(parameters=list(o.parameters))) for key, o in net.objectives().items())
    }

    def now() -> float:
        with torch.no_grad():
            return total(net.eval(), Batch(data.arrays, Chance(0, 0))).item()

    before = now()
    for step in range(20):
        net.train()
        for key, objective in net.objectives().items():
            optimisers[key].zero_grad()
            sum(objective.loss(Batch(data.arrays, Chance(0, step)), step).values()).backward()
            optimisers[key].step()
    assert now() < before - 0.02 * abs(before)


@pytest.mark.parametrize("name", NAMES)
def test_sizes_that_are_none_are_told(name):
    kind = network_class(name)
    with pytest.raises(InputError):
        kind(replace(kind.Config(**TINY[name]), frames=0), pose=POSE, audio=AUDIO)


@pytest.mark.parametrize(
    ("name", "config", "pose", "audio", "count"),
    [
        # Yoon et al. 2020, authors' code: 190,691, of which 32·32 + 32 are of a layer without use (fc_logvar)
        ("fgd-autoencoder", {}, 27, 0, 190_691 - 1_056),
        # Ye et al. 2022, authors' code at 27 and 69 numbers a pose
        ("stylised-flow", {}, 27, 29, 123_611_408),
        ("stylised-flow", {"history": 10, "look_ahead": 10, "frames": 100}, 69, 27, 146_478_480),
    ],
    ids=lambda value: str(value) if isinstance(value, int | str) else "",
)
def test_parameters_at_paper_size(name, config, pose, audio, count):
    kind = network_class(name)
    with torch.device("meta"):
        net = kind(kind.Config(**config), pose=pose, audio=audio)
    assert sum(value.numel() for value in net.parameters()) == count
