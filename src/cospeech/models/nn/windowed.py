"""What networks have in common that make a whole window at once: speech in, the poses of the same frames out.

`make` is what is exported and played in pieces; all else here is the same for every one of them.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

from ...errors import InputError

__all__ = ["Windowed"]


class Windowed(nn.Module):
    """A network that is played by windows; a subclass sets the numbers and has `make`.

    Where it has a style encoder it also has ``style_of``: (B, T, D) poses, T ≥ 64, → (B, styles).
    """

    pose: int
    """D, numbers of a pose."""
    audio: int
    """A, numbers of a frame of speech."""
    multiple: int
    """What T has to be a multiple of in `make`."""
    shortest: int
    """The least T of `make`, a multiple too."""
    styles: int
    """Numbers of a style: speakers' weights, or a code; 0: there is nothing to choose."""
    modes: int
    """Sub-generators whose logits can be shifted by noise; 0: none."""
    literal: bool = False
    """Whether each number that it makes is meant; else its motion is brought to the speakers' mean poses and deviations."""

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
        heard, style = (torch.cat([x, x[:, -1:].expand(-1, more, -1)], 1) for x in (audio, style.expand(-1, frames, -1)))
        return self.make(heard, style, heard.new_zeros(rows, frames + more, self.modes))[:, :frames]

    @torch.no_grad()
    def speaker_styles(self, stretches: Tensor) -> Tensor:
        """The style of each speaker, as `generate` takes it.

        Args:
            stretches: (S, n, T, D) standardised poses of each, T ≥ 64.

        Returns:
            (S, styles).
        """
        return stretches.new_zeros(len(stretches), self.styles)
