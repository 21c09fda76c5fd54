"""Augmentation by other voices and rooms: the numbers of speech are changed anew for every window.

A small corpus repeats few voices and sentences. A network can learn by heart which motion follows which sound, and then does
not follow new speech. Here each number of speech is shifted and stretched by amounts that stay the same throughout a window, as
another voice and another microphone do. Noise changes each frame a little. Loud and soft moments stay where they were.
"""

from __future__ import annotations

from torch import Tensor, nn

from .objective import StepRandom

__all__ = ["SpeechAugmentation"]

_STRETCH = 0.5  # [ours] deviation of the stretch's logarithm, as a share of that of the shift: levels differ more than ranges
_NOISE = 0.5  # [ours] deviation of the noise of a frame, as a share of that of the shift


class SpeechAugmentation(nn.Module):
    """(B, T, A) standardised speech → the same, shifted, stretched and noisy; in training alone.

    Args:
        amount: standard deviation of the shift, in deviations of the corpus; 0: nothing is changed.
    """

    def __init__(self, amount: float) -> None:
        super().__init__()
        self.amount = amount

    def forward(self, audio: Tensor, chance: StepRandom) -> Tensor:
        if not self.training or not self.amount:
            return audio
        rows, frames, count = audio.shape
        move, stretch = (chance.normal(rows, 1, count) for _ in range(2))
        noise = chance.normal(rows, frames, count)
        mean = audio.mean(1, keepdim=True)
        wider = (audio - mean) * (_STRETCH * self.amount * stretch).exp()
        return mean + wider + self.amount * (move + _NOISE * noise)
