"""New parameters by name: leaving a module out leaves the others as they were."""

from __future__ import annotations

import pytest

torch = pytest.importorskip("torch")
from torch import nn  # noqa: E402

from cospeech.models.chain_of_generation import ChainConfig, ChainOfGeneration  # noqa: E402
from cospeech.models.nn.named_initialisation import initialise_by_name  # noqa: E402


class Net(nn.Module):
    """A network with modules in an order, and a parameter of its own."""

    def __init__(self, *parts: str) -> None:
        super().__init__()
        self.parts = nn.ModuleDict()
        for part in parts:
            self.parts[part] = nn.Sequential(nn.Linear(3, 4), nn.GRU(4, 2))
        self.last = nn.Linear(3, 3)
        nn.init.normal_(self.last.weight, 0.0, 0.01)
        nn.init.zeros_(self.last.bias)


def test_an_ablated_network_begins_as_the_whole_one():
    whole = initialise_by_name(lambda: Net("face", "hands", "body"), 3).state_dict()
    some = initialise_by_name(lambda: Net("body", "hands"), 3).state_dict()
    other = initialise_by_name(lambda: Net("face", "hands", "body"), 4).state_dict()
    assert set(some) < set(whole)
    assert all(torch.equal(some[name], whole[name]) for name in some)
    assert not torch.equal(other["parts.body.0.weight"], whole["parts.body.0.weight"])
    assert not torch.equal(whole["parts.body.0.weight"], whole["parts.hands.0.weight"])
    assert whole["last.weight"].std() < 0.02  # what the network does to its parts stays
    assert not whole["last.bias"].any()


def test_nothing_is_left_behind():
    begin = nn.Module.__init__
    with pytest.raises(ZeroDivisionError):
        initialise_by_name(lambda: 1 / 0, 0)
    assert nn.Module.__init__ is begin


def test_the_steps_of_a_chains_classifier_come_on_top():
    config = ChainConfig.tiny()
    net = ChainOfGeneration(config, pose=9, audio=5, speakers=2, hands=[2, 3])
    parts = net.objectives()
    total = 20 + net.preliminary_steps
    assert net.preliminary_steps == config.classifier_steps > 0
    gesture = [name for name in parts if name != "classifier"]
    assert sum(parts[gesture[0]].is_active_at(step) for step in range(total)) == 20
    assert sum(parts["classifier"].is_active_at(step) for step in range(total)) == config.classifier_steps
