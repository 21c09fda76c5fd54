"""What a network need not say, because it subclasses `Trainable`; and what is no such network."""

from __future__ import annotations

from dataclasses import dataclass

import pytest

torch = pytest.importorskip("torch", reason="networks need torch (the train extra)")

from cospeech.errors import InputError  # noqa: E402
from cospeech.models import NETWORKS, ModelEntry  # noqa: E402
from cospeech.models.nn.objective import Batch, Objective, StepRandom  # noqa: E402
from cospeech.models.nn.trainable import Trainable  # noqa: E402
from cospeech.models.registry import ENTRIES  # noqa: E402
from cospeech.training.checkpoint import build_model, network  # noqa: E402
from cospeech.training.dataset import DIMENSIONS  # noqa: E402


@dataclass(frozen=True)
class Settings:
    frames: int = 7


class Least(Trainable):
    """The least that a network must define."""

    Config = Settings

    def __init__(self, config: Settings, *, pose: int, audio: int) -> None:
        super().__init__()
        self.config, self.linear = config, torch.nn.Linear(audio, pose)

    def objectives(self) -> dict[str, Objective]:
        return {"all": Objective(self.parameters(), lambda batch, step: {"one": self.linear(batch["audio"]).mean()})}


class NoConfig(Trainable):
    """A network without a class of settings."""


class NoNetwork(torch.nn.Linear):
    Config = Settings


@pytest.fixture
def register(monkeypatch):
    """Put a class of this file into the registry."""

    def add(kind: type) -> str:
        monkeypatch.setitem(ENTRIES.ours, "mine", ModelEntry(f"{__name__}:{kind.__name__}", "for this test", plays=False))
        return "mine"

    return add


def test_what_a_network_leaves_out_has_a_default(register):
    facts = {"model": register(Least), "config": {"frames": 5}, "sizes": {"pose": 3, "audio": 2, "speakers": 4}, "needs": {}}
    net = build_model(facts)
    assert (net.window, net.arrays, net.optional_arrays, net.delay, net.controls) == (5, ("pose", "audio"), (), 0, ())
    before = {name: value.clone() for name, value in net.state_dict().items()}
    net.set_statistics({"pose_mean": torch.zeros(3)})
    assert all(torch.equal(value, before[name]) for name, value in net.state_dict().items())
    assert net.validate(Batch({"audio": torch.zeros(1, 5, 2)}, StepRandom(0, 0))) == {}
    assert net.style_of(torch.zeros(2, 64, 3)).shape == (2, 0)
    assert net.speaker_styles(torch.zeros(4, 8, 64, 3)).shape == (4, 0)
    assert Least.encoder_for(net.config) is None


def test_a_network_that_says_nothing_of_what_it_takes_is_told(register):
    with pytest.raises(InputError, match=r"no network that trains .a subclass of cospeech.models.nn.trainable.Trainable is"):
        network(register(NoNetwork))
    with pytest.raises(InputError, match=r"test_trainable:NoConfig has no Config .*frozen dataclass.*add_a_model"):
        network(register(NoConfig))


def test_an_array_that_a_batch_does_not_hold_is_told():
    batch = Batch({"pose": torch.zeros(2, 5, 3), "audio": torch.zeros(2, 5, 2)}, StepRandom(0, 0))
    assert batch["audio"].shape == (2, 5, 2)
    with pytest.raises(InputError, match=r"a batch has no 'face' \(it holds audio, pose; .* `arrays`"):
        batch["face"]


@pytest.mark.parametrize("name", sorted(NETWORKS))
def test_networks_ask_for_dimensions_that_a_store_has(name):
    kind = network(name)
    assert {*kind.dimensions_for(kind.Config())} <= {*DIMENSIONS}
