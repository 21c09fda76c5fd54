"""Conditioning of autoregressive flows: windows of poses and speech, blanked histories, the global encoder."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from .norm import BatchNorm1d
from .objective import StepRandom

__all__ = ["TCN", "GlobalEncoder", "StyleEncoder", "as_steps", "blank_history", "drop_history", "frame_windows"]

STEP_GAIN = 10.0  # ours: brings steps at 12 … 20 poses a second to a deviation near 1
CODE = 64  # width of a TCN's result; flow paper: not stated, authors' code 64


def frame_windows(values: Tensor, length: int) -> Tensor:
    """(B, T, D) → (B, T − length + 1, length, D): for each frame the window that begins with it; a view."""
    return values.unfold(1, length, 1).transpose(2, 3)


def drop_history(histories: Tensor, probability: float, chance: StepRandom) -> Tensor:
    """(B, F, τ, D) with whole poses blanked (the mean pose), each slot of each frame by itself (MoGlow's data dropout)."""
    if probability <= 0:
        return histories
    keep = chance.uniform(*histories.shape[:3]) >= probability
    return histories * keep.unsqueeze(-1)


def blank_history(histories: Tensor, probability: float, chance: StepRandom) -> Tensor:
    """(B, F, τ, D) with the whole history of a frame replaced by its last pose: the position stays, the movement goes."""
    if probability <= 0:
        return histories
    keep = chance.uniform(*histories.shape[:2]) >= probability
    return torch.where(keep[..., None, None], histories, histories[:, :, -1:])


def as_steps(histories: Tensor) -> Tensor:
    """(B, F, τ, D) poses → (B, F, τ, D): the last pose, then every step from one to the next, times `STEP_GAIN`."""
    return torch.cat([histories[:, :, -1:], STEP_GAIN * histories.diff(dim=2)], 2)


class _Residual(nn.Module):
    def __init__(self, channels: int) -> None:
        super().__init__()
        self.conv = nn.Conv1d(channels, channels, 3, padding=1, bias=False)
        self.norm = BatchNorm1d(channels)

    def forward(self, x: Tensor) -> Tensor:
        return torch.relu(x + self.norm(self.conv(x)))


class TCN(nn.Module):
    """A window of vectors → `CODE` numbers: convolution, batch norm, ReLU; residual blocks; the same three again; pooling.

    (N, D, W) → (N, 64). Kernels 4 with stride 2 at both ends, 3 between (authors’ code; the paper says residual blocks
    of convolution, batch norm and ReLU).

    Args:
        inputs: D.
        channels, blocks: width and number of the residual blocks.
        oldest: take the first position of the result, not the mean over all.
        relu: whether there is a ReLU before the pooling; networks that were trained without one have none.
    """

    def __init__(self, inputs: int, *, channels: int, blocks: int, oldest: bool, relu: bool) -> None:
        super().__init__()
        self.first = nn.Conv1d(inputs, channels, 4, stride=2, padding=1, bias=False)
        self.first_norm = BatchNorm1d(channels)
        self.blocks = nn.Sequential(*(_Residual(channels) for _ in range(blocks)))
        self.last = nn.Conv1d(channels, CODE, 4, stride=2, padding=1, bias=False)
        self.last_norm = BatchNorm1d(CODE)
        self.oldest, self.relu = oldest, relu
        for part in self.modules():
            if isinstance(part, nn.Conv1d):
                nn.init.kaiming_normal_(part.weight)

    def forward(self, x: Tensor) -> Tensor:
        x = self.blocks(torch.relu(self.first_norm(self.first(x))))
        x = self.last_norm(self.last(x))
        x = torch.relu(x) if self.relu else x
        return x[..., 0] if self.oldest else x.mean(-1)


class GlobalEncoder(nn.Module):
    """f_t of the flow paper (section 3.2, figure 4): two TCNs over history and speech, then three fully connected layers."""

    def __init__(self, pose: int, audio: int, *, channels: int, blocks: int, feature: int, oldest: bool, relu: bool) -> None:
        super().__init__()
        self.poses, self.speech = (
            TCN(inputs, channels=channels, blocks=blocks, oldest=oldest, relu=relu) for inputs in (pose, audio)
        )
        self.full = nn.Sequential(
            nn.Linear(2 * CODE, channels), nn.ReLU(), nn.Linear(channels, channels), nn.ReLU(), nn.Linear(channels, feature)
        )

    def forward(self, poses: Tensor, audio: Tensor) -> Tensor:
        """(B, F, τ, D), (B, F, W, A) → (B, F, feature)."""
        rows, frames = poses.shape[:2]
        codes = [tcn(window.flatten(0, 1).transpose(1, 2)) for tcn, window in ((self.poses, poses), (self.speech, audio))]
        return self.full(torch.cat(codes, -1)).view(rows, frames, -1)


class StyleEncoder(nn.Module):
    """A stretch of poses of any length from 8 frames on → a style code: (B, S, D) → (B, style). Ours.

    Three convolutions with stride 2, then mean and deviation over the remaining frames. The code says how people hold
    themselves, and how much and how fast they move, but not when. A batch norm keeps the code where tanh has a slope: means and
    deviations are all positive, so that without it the first steps of a flow move all codes the same way, to the same ends.

    Args:
        pose: D, numbers of a pose.
        channels: of the convolutions.
        style: numbers of the code.
        norm: whether there is that batch norm. A loss that contrasts codes keeps them apart without it.
    """

    def __init__(self, pose: int, *, channels: int, style: int, norm: bool = True) -> None:
        super().__init__()
        self.convolutions = nn.Sequential(
            nn.Conv1d(pose, channels, 4, stride=2, padding=1), nn.ReLU(),
            nn.Conv1d(channels, channels, 4, stride=2, padding=1), nn.ReLU(),
            nn.Conv1d(channels, channels, 4, stride=2, padding=1), nn.ReLU(),
        )  # fmt: skip
        self.full = nn.Linear(2 * channels, style)
        self.norm = BatchNorm1d(style, affine=False) if norm else nn.Identity()

    def forward(self, poses: Tensor) -> Tensor:
        x = self.convolutions(poses.transpose(1, 2))
        moments = torch.cat([x.mean(-1), (x.var(-1, unbiased=False) + 1e-6).sqrt()], -1)
        return torch.tanh(self.norm(self.full(moments)))
