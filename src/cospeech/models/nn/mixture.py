"""M sub-generators side by side, the network that weighs them, and their mixture (Ahuja et al. 2020, section 4.1).

    Ŷ = Σₘ φₘ Gₘ(Z)                                                                       (2)

All M run in one pass: the first layer is an ordinary convolution with M times the channels (each sub-generator sees all of Z),
the others are grouped, so that no weight of one sub-generator meets another's.
"""

from __future__ import annotations

from torch import Tensor, nn
from torch.nn import functional as F

from .unet1d import conv_block

__all__ = ["ModeLogits", "SubGenerators", "mix", "one_hot_priors"]

LAYERS = 4  # convolutions of a sub-generator before its 1 × 1; not stated, authors' code 4
MODE_LAYERS = 6  # of the classification network H before its 1 × 1; not stated, authors' code 6


class SubGenerators(nn.Module):
    """G₁ … G_M: (B, inputs, T) → (B, M, D, T).

    Args:
        inputs: channels of Z.
        channels: of each sub-generator.
        pose: D.
        modes: M.
    """

    def __init__(self, inputs: int, channels: int, pose: int, modes: int) -> None:
        super().__init__()
        self.modes = modes
        wide = modes * channels
        self.blocks = nn.Sequential(
            conv_block(inputs, wide), *(conv_block(wide, wide, groups=modes) for _ in range(LAYERS - 1))
        )
        self.out = nn.Conv1d(wide, modes * pose, 1, groups=modes)

    def forward(self, z: Tensor) -> Tensor:
        poses: Tensor = self.out(self.blocks(z)).unflatten(1, (self.modes, -1))
        return poses


class ModeLogits(nn.Sequential):
    """H, which estimates the priors of the mixture: (B, inputs, T) → (B, M, T) logits."""

    def __init__(self, inputs: int, channels: int, modes: int) -> None:
        blocks = [conv_block(channels if k else inputs, channels) for k in range(MODE_LAYERS)]
        super().__init__(*blocks, nn.Conv1d(channels, modes, 1))


def one_hot_priors(cluster: Tensor, modes: int) -> Tensor:
    """(B, T) numbers of the cluster that each frame belongs to → (B, M, T) φ: 1 for it, 0 for the others."""
    return F.one_hot(cluster, modes).transpose(1, 2).float()


def mix(poses: Tensor, priors: Tensor) -> Tensor:
    """Equation 2: (B, M, D, T), (B, M, T) → (B, D, T).

    Where a prior is 0 no gradient reaches that sub-generator from that frame.
    """
    return (poses * priors.unsqueeze(2)).sum(1)
