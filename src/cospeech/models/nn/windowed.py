"""The common part of networks that make a whole window at once: speech in, the poses of the same frames out.

`make` is exported and played in pieces; everything else here is the same for all of them.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

from ...errors import InputError
from ...runtime.bundles.signature import STYLE_FRAMES
from .export import ExportGraph, Playing
from .trainable import Trainable

__all__ = ["Windowed"]


class Windowed(Trainable):
    """A network that is played by windows; a subclass sets the numbers and has `make`."""

    pose: int
    """D, numbers of a pose."""
    audio: int
    """A, numbers of a frame of speech."""
    multiple: int
    """T of `make` is a multiple of this."""
    shortest: int
    """The least T of `make`, a multiple too."""
    modes: int
    """Sub-generators whose logits can be shifted by noise; 0: none."""
    normal_noise = False
    """Whether the noise is normal in training and when it plays; else it is of a Gumbel distribution, for logits of modes."""

    def make(self, audio: Tensor, style: Tensor, mode_noise: Tensor) -> Tensor:
        """(B, T, A), (B, T, styles), (B, T, modes) → (B, T, D); T a multiple of ``multiple``, ``shortest`` at least.

        ``mode_noise`` is added to the logits of the modes.
        """
        raise NotImplementedError

    @torch.no_grad()
    def generate(self, audio: Tensor, style: Tensor) -> Tensor:
        """Motion for speech.

        Args:
            audio: (B, T, A), of any length; its last frame is repeated until `make` takes it.
            style: (B, T or 1, styles).

        Returns:
            (B, T, D).

        Raises:
            InputError: no frame, or another shape.
        """
        rows, frames = audio.shape[:2]
        if not frames or audio.shape[2:] != (self.audio,) or style.shape not in {(rows, t, self.styles) for t in (1, frames)}:
            problem = f"speech of shape {tuple(audio.shape)}, styles of shape {tuple(style.shape)}"
            raise InputError(problem, f"(B, T, {self.audio}) and (B, T or 1, {self.styles})")
        more = max(-frames % self.multiple, self.shortest - frames)
        speech, style = (torch.cat([x, x[:, -1:].expand(-1, more, -1)], 1) for x in (audio, style.expand(-1, frames, -1)))
        return self.make(speech, style, speech.new_zeros(rows, frames + more, self.modes))[:, :frames]

    def export_module(self) -> dict[str, ExportGraph]:
        """``make`` with its inputs of some width: rows, style, noise → poses; and ``style`` where it recognises styles."""
        inputs: dict[str, tuple[int | str, ...]] = {"rows": (1, "T", self.audio)}
        inputs |= {"style": ("N", "T", self.styles)} if self.styles else {}
        inputs |= {"noise": ("N", "T", self.modes)} if self.modes else {}
        poses = ("N" if len(inputs) > 1 else 1, "T", self.pose)
        frames = max(self.shortest, 4) * 2
        make = ExportGraph(
            Playing(self), inputs, {"poses": poses}, frames=frames, multiple=self.multiple, shortest=self.shortest,
            window=self.window, normal_noise=self.normal_noise,
        )  # fmt: skip
        return {"make": make, **self.style_graph()}

    def style_graph(self) -> dict[str, ExportGraph]:
        """``style``, where it recognises styles."""
        recognise = self.style_encoder()
        if recognise is None:
            return {}
        inputs, outputs = {"poses": (1, "T", self.pose)}, {"style": (1, self.styles)}
        return {"style": ExportGraph(recognise, inputs, outputs, frames=80, shortest=STYLE_FRAMES, window=STYLE_FRAMES)}

    def style_encoder(self) -> nn.Module | None:
        """A module that recognises a style: (B, T, D) poses → (B, styles); None: it recognises none."""
        return StyleOf(self) if self.encodes_style else None


class StyleOf(nn.Module):
    """``style_of`` of a network as a module."""

    def __init__(self, net: Windowed) -> None:
        super().__init__()
        self.net = net

    def forward(self, poses: Tensor) -> Tensor:
        """(B, T, D) → (B, styles)."""
        style: Tensor = self.net.style_of(poses)  # type: ignore[operator]
        return style
