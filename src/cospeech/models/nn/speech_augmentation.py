"""Speech of voices and rooms that the corpus does not have: the numbers of speech are changed anew for every window.

A small corpus repeats few voices and sentences. A network can learn by heart what comes after which sound, and then does not
hear new speech. Here each number of speech is moved and stretched by amounts that stay the same throughout a window, as
another voice and another microphone do, and noise changes each frame a little. When the speech is loud stays as it was.
"""

from __future__ import annotations

from torch import Tensor, nn

from .objective import StepRandom

__all__ = ["SpeechAugmentation"]

_STRETCH = 0.5  # [ours] deviation of the stretch's logarithm, of that of the move: levels differ more than ranges
_NOISE = 0.5  # [ours] deviation of the noise of a frame, of that of the move


class SpeechAugmentation(nn.Module):
    """(B, T, A) standardised speech → the same, moved, stretched and noisy; in training alone.

    Args:
        amount: deviation of the move, in those of the corpus; 0: nothing is changed.
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
