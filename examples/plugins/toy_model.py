"""A model of one's own, in a package of one's own: speech in, the poses of the same frames out."""

from __future__ import annotations

from dataclasses import dataclass

from torch import Tensor, nn

from cospeech import InputError
from cospeech.models import ModelEntry
from cospeech.models.nn.export import ExportGraph
from cospeech.models.nn.objective import Batch, Objective
from cospeech.models.nn.trainable import Trainable

MODEL = ModelEntry(
    where=f"{__name__}:ToyNet",
    what="A toy: two convolutions over time, one motion for one speech",
)


@dataclass(frozen=True)
class ToyConfig:
    """What a recipe may say in [model], with its defaults."""

    frames: int = 32
    """T, frames of a training window."""
    channels: int = 16
    """Between the two convolutions."""
    reach: int = 4
    """Frames to either side that each convolution sees."""

    def __post_init__(self) -> None:
        if min(self.frames, self.channels) < 1 or self.reach < 0:
            raise InputError(f"frames, channels, reach of a ToyNet: {self}", "1, 1 and 0 at least")


class ToyNet(Trainable):
    """Two convolutions.

    Args:
        config: sizes, of the recipe.
        pose: D, numbers of a pose; of the store, as the next.
        audio: A, numbers of a frame of speech.
    """

    Config = ToyConfig

    def __init__(self, config: ToyConfig, *, pose: int, audio: int) -> None:
        super().__init__()
        self.config, self.pose, self.audio = config, pose, audio
        width = 2 * config.reach + 1
        self.heard = nn.Conv1d(audio, config.channels, width, padding="same")
        self.moved = nn.Conv1d(config.channels, pose, width, padding="same")

    def forward(self, audio: Tensor) -> Tensor:
        """(B, T, A) standardised speech → (B, T, D) standardised poses."""
        poses: Tensor = self.moved(self.heard(audio.mT).relu()).mT
        return poses

    def objectives(self) -> dict[str, Objective]:
        """One: name → parameters, and the loss that moves them."""
        return {"poses": Objective(self.parameters(), self.loss)}

    def loss(self, batch: Batch, step: int) -> dict[str, Tensor]:
        """Named terms; the loop adds them up, and logs each."""
        poses = self(batch["audio"])
        return {
            "pose": (poses - batch["pose"]).abs().mean(),
            "velocity": (poses.diff(dim=1) - batch["pose"].diff(dim=1)).abs().mean(),
        }

    def export_module(self) -> dict[str, ExportGraph]:
        """What a bundle holds: one network of windows, whose output is the same for all takes."""
        inputs = {"rows": (1, "T", self.audio)}
        return {"make": ExportGraph(self, inputs, {"poses": (1, "T", self.pose)}, window=self.window)}
