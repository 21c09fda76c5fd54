"""Vector quantisation with a codebook that follows running averages (van den Oord et al. 2017, section 3.1 and appendix A.1).

    k(z) = argmin_k ‖z − e_k‖₂,   z_q = z + sg[e_k − z],   L = β E (z − sg[e_k])²

z_q has the value of the nearest code, and passes its gradient to z as it is (straight through). A code is the running average
of the vectors that it stands for, so that no gradient moves it. A code that is hardly ever used is set to a vector of the batch
(as Dhariwal et al. 2020, Jukebox, do); otherwise most of 2,048 codes are never used.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch import distributed as dist
from torch.nn import functional as F

from .norm import global_sum, is_shared

__all__ = ["Quantiser"]

LEAST = 1e-5  # added to the number of vectors of a code; authors' code of Yi et al. 2023
SELDOM = 0.03  # [ours] share of the mean use of a code, below which the code is replaced


class Quantiser(nn.Module):
    """A codebook.

    Args:
        codes: K.
        width: C, numbers of a code.
        commitment: β; van den Oord et al. 0.25.
        decay: of the running averages, per step.
    """

    codes: Tensor
    uses: Tensor
    sums: Tensor
    steps: Tensor

    def __init__(self, codes: int, width: int, commitment: float = 0.25, decay: float = 0.99) -> None:
        super().__init__()
        self.commitment, self.decay = commitment, decay
        self.register_buffer("codes", nn.init.xavier_uniform_(torch.empty(codes, width)))
        self.register_buffer("uses", torch.zeros(codes))
        self.register_buffer("sums", torch.zeros(codes, width))
        self.register_buffer("steps", torch.zeros((), dtype=torch.long))

    def indices(self, z: Tensor) -> Tensor:
        """(B, C, T) → (B, T), the number of the nearest code."""
        flat = z.mT
        distances = self.codes.square().sum(1) - 2 * flat @ self.codes.mT  # ‖z‖² is the same for all codes
        return distances.argmin(-1)

    def embed(self, indices: Tensor) -> Tensor:
        """(B, T) → (B, C, T)."""
        return F.embedding(indices, self.codes).mT

    def forward(self, z: Tensor) -> tuple[Tensor, Tensor]:
        """(B, C, T) → z_q (B, C, T) and the commitment loss (); in training the codes then follow the vectors."""
        indices = self.indices(z)
        nearest = self.embed(indices)
        if self.training:
            self._follow(z.detach().mT.flatten(0, 1), indices.flatten())
        return z + (nearest - z).detach(), self.commitment * (z - nearest.detach()).square().mean()

    @torch.no_grad()
    def _follow(self, vectors: Tensor, indices: Tensor) -> None:
        """(n, C) vectors and the (n,) codes that stand for them, of all processes together."""
        one_hot = F.one_hot(indices, len(self.codes)).to(vectors)
        self.steps += 1
        share = 1 - self.decay
        self.uses.lerp_(global_sum(one_hot.sum(0)), share)
        self.sums.lerp_(global_sum(one_hot.mT @ vectors), share)
        bias_correction = 1 - self.decay ** int(self.steps)  # the averages begin with zeros
        total = self.uses.sum()
        self._revive_codes(vectors, total)
        size = (self.uses + LEAST * bias_correction) / (total + len(self.codes) * LEAST * bias_correction) * total
        self.codes.copy_(self.sums / size.unsqueeze(1))

    def _revive_codes(self, vectors: Tensor, total: Tensor) -> None:
        """Set codes that are seldom used to vectors of the batch; all processes draw the same."""
        processes, rank = (dist.get_world_size(), dist.get_rank()) if is_shared() else (1, 0)
        mean = total / len(self.codes)
        draw = torch.Generator().manual_seed(int(self.steps))
        places = torch.randint(processes * len(vectors), (len(self.codes),), generator=draw).to(vectors.device)
        own = (places // len(vectors) == rank).unsqueeze(1)
        replacements = global_sum(torch.where(own, vectors[places % len(vectors)], 0.0))
        seldom = self.uses < SELDOM * mean
        self.uses.copy_(torch.where(seldom, mean, self.uses))
        self.sums.copy_(torch.where(seldom.unsqueeze(1), mean * replacements, self.sums))
