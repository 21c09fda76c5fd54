"""The three shapes that training takes, each as small as it can be: a flow, a GAN, a cascade of two stages."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor, nn

from cospeech.models import ModelEntry
from cospeech.models.nn.flow import Flow, RecurrentNet
from cospeech.models.nn.norm import BatchNorm1d
from cospeech.models.nn.objective import Batch, Objective
from cospeech.models.nn.trainable import Trainable

__all__ = ["MODELS", "TinyCascade", "TinyFlow", "TinyGan", "slowly"]

MODELS = {
    f"tiny-{kind.lower()}": ModelEntry(f"tests.support.tiny_models:Tiny{kind}", "for tests", plays=False)
    for kind in ("Flow", "Gan", "Cascade")
}


@dataclass(frozen=True)
class Config:
    hidden: int = 8
    frames: int = 10
    noise: float = 0.1
    break_at: int = -1
    """Step whose loss is no number."""


SLOW = {"matrices": 0}
"""How many large products every loss of the GAN takes besides, forth and back, that change nothing."""


def slowly(terms: dict[str, Tensor], parameter: Tensor) -> dict[str, Tensor]:
    """The same terms and gradients, after products that only take time."""
    if not SLOW["matrices"]:
        return terms
    large = (torch.eye(700) + 0 * parameter.sum()).requires_grad_()
    for _ in range(SLOW["matrices"]):
        large = large @ torch.eye(700)
    name = next(iter(terms))
    return terms | {name: terms[name] + 0 * large.sum()}


class Tiny(Trainable):
    Config = Config

    def __init__(self, config: Config) -> None:
        super().__init__()
        self.config = config


class TinyFlow(Tiny):
    """One objective; ActNorm is set by the first batch; noise on the poses."""

    def __init__(self, config: Config, *, pose: int, audio: int) -> None:
        super().__init__(config)
        self.flow = Flow(pose, audio, 2, lambda a, b: RecurrentNet(nn.GRU, a, config.hidden, b, 1), 50.0)

    def objectives(self) -> dict[str, Objective]:
        return {"flow": Objective(self.parameters(), self.loss)}

    def loss(self, batch: Batch, step: int) -> dict[str, Tensor]:
        x = batch["pose"] + self.config.noise * batch.chance.normal(*batch["pose"].shape) * self.training
        loss = -self.flow.log_prob(x, batch["audio"]).mean()
        return {"nll": loss * float("nan") if step == self.config.break_at else loss}


class TinyGan(Tiny):
    """Two objectives with parameters of their own, the second through the first's network; batch normalisation."""

    dimensions = ("pose", "audio", "speakers")

    def __init__(self, config: Config, *, pose: int, audio: int, speakers: int) -> None:
        super().__init__(config)
        self.style = nn.Embedding(speakers, config.hidden)
        first = nn.Conv1d(audio, config.hidden, 3, padding=1, bias=False)
        self.encode = nn.Sequential(first, BatchNorm1d(config.hidden), nn.ReLU())
        self.decode = nn.Conv1d(config.hidden, pose, 3, padding=1)
        self.discriminator = nn.Sequential(nn.Conv1d(pose, config.hidden, 3), nn.LeakyReLU(0.2), nn.Conv1d(config.hidden, 1, 3))

    def forward(self, audio: Tensor, speaker: Tensor) -> Tensor:
        return self.decode(self.encode(audio.mT) + self.style(speaker)[..., None]).mT

    def objectives(self) -> dict[str, Objective]:
        generator = [p for name, p in self.named_parameters() if not name.startswith("discriminator")]
        return {
            "discriminator": Objective(self.discriminator.parameters(), self.discriminator_loss),
            "made": Objective(generator, self.generator_loss, every=2),
        }

    def discriminator_loss(self, batch: Batch, step: int) -> dict[str, Tensor]:
        with torch.no_grad():
            poses = self(batch["audio"], batch["speaker"])
        terms = {
            "real": (self.discriminator(batch["pose"].mT) - 1).square().mean(),
            "made": self.discriminator(poses.mT).square().mean(),
        }
        return slowly(terms, self.discriminator[0].weight)

    def generator_loss(self, batch: Batch, step: int) -> dict[str, Tensor]:
        poses = self(batch["audio"], batch["speaker"])
        terms = {
            "near": (poses - batch["pose"]).abs().mean(),
            "generator_loss": 0.1 * (self.discriminator(poses.mT) - 1).square().mean(),
        }
        return slowly(terms, self.decode.weight)


class TinyCascade(Tiny):
    """Two stages: an autoencoder of poses for ten steps, then, while it rests, its codes from the speech."""

    def __init__(self, config: Config, *, pose: int, audio: int) -> None:
        super().__init__(config)
        self.code, self.pose = nn.Linear(pose, config.hidden), nn.Linear(config.hidden, pose)
        self.heard = nn.Linear(audio, config.hidden)

    def objectives(self) -> dict[str, Objective]:
        first = [*self.code.parameters(), *self.pose.parameters()]
        second = Objective(self.heard.parameters(), self.hear, start=10)
        return {"codes": Objective(first, self.codes, stop=10), "heard": second}

    def codes(self, batch: Batch, step: int) -> dict[str, Tensor]:
        return {"pose": (self.pose(self.code(batch["pose"]).tanh()) - batch["pose"]).abs().mean()}

    def hear(self, batch: Batch, step: int) -> dict[str, Tensor]:
        return {"pose": (self.pose(self.heard(batch["audio"]).tanh()) - batch["pose"]).abs().mean()}
