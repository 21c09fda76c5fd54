"""Statistics over the global batch: layers that use them train in many processes as they would in one.

In one process everything here does what PyTorch does. Where `torch.distributed` is initialised, sums go over the rows of all
processes, and gradients flow back through these sums. Every process must then run the same layers in the same order.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import torch
from torch import Tensor, nn
from torch import distributed as dist

__all__ = ["BatchNorm1d", "batch_norm", "global_moments", "global_sum", "is_shared", "without_tracking"]


def is_shared() -> bool:
    """Whether more than one process trains."""
    return dist.is_available() and dist.is_initialized() and dist.get_world_size() > 1


class _GlobalSum(torch.autograd.Function):
    """y = Σ over processes of x; every process's loss depends on every x, so that gradients are summed likewise."""

    @staticmethod
    def forward(ctx: Any, x: Tensor) -> Tensor:
        total = x.clone(memory_format=torch.contiguous_format)
        dist.all_reduce(total)
        return total

    @staticmethod
    def backward(ctx: Any, *gradients: Tensor) -> Tensor:
        total = gradients[0].clone(memory_format=torch.contiguous_format)
        dist.all_reduce(total)
        return total


def global_sum(x: Tensor) -> Tensor:
    """The sum of a tensor of one shape over all processes, differentiable; in one process the tensor itself."""
    if not is_shared():
        return x
    total: Tensor = _GlobalSum.apply(x)
    return total


def _moments(x: Tensor, dims: tuple[int, ...]) -> tuple[Tensor, Tensor, Tensor]:
    """Mean, variance (÷ N) and N over ``dims`` and all processes; two passes, so that no digits cancel."""
    x = x.float() if x.dtype in (torch.float16, torch.bfloat16) else x
    count = global_sum(x.new_tensor(x.numel() / max(1, x.sum(dims).numel())))
    mean = global_sum(x.sum(dims, keepdim=True)) / count
    variance = global_sum((x - mean).square().sum(dims)) / count
    return mean.reshape(variance.shape), variance, count


def global_moments(x: Tensor, dims: tuple[int, ...]) -> tuple[Tensor, Tensor]:
    """Mean and standard deviation (÷ N) over ``dims`` of a tensor and over all processes, in at least float32.

    For layers that the first batch initialises. The reduced dimensions are gone: (B, T, D), (0, 1) → (D,), (D,).
    """
    mean, variance, _ = _moments(x, dims)
    return mean, variance.sqrt()


def batch_norm(x: Tensor, weight: Tensor | None, bias: Tensor | None, eps: float = 1e-5) -> Tensor:
    """(B, C, T) or (B, C) normalised per channel by the statistics of the global batch; no running average is kept.

    In one process it is `torch.nn.functional.batch_norm` in training.
    """
    if not is_shared():
        return nn.functional.batch_norm(x, None, None, weight, bias, training=True, eps=eps)
    mean, variance, _ = _moments(x, (0, *range(2, x.dim())))
    return _affine(x, mean, variance, weight, bias, eps)


def _affine(x: Tensor, mean: Tensor, variance: Tensor, weight: Tensor | None, bias: Tensor | None, eps: float) -> Tensor:
    shape = (1, -1, *[1] * (x.dim() - 2))
    y = (x - mean.view(shape)) * torch.rsqrt(variance + eps).view(shape)
    if weight is not None and bias is not None:
        y = y * weight.view(shape) + bias.view(shape)
    return y.to(x.dtype)


class BatchNorm1d(nn.BatchNorm1d):
    """`torch.nn.BatchNorm1d` for (B, C, T) or (B, C), trained with the statistics of the global batch.

    The state has the same names. In one process, or in evaluation, it is PyTorch's own to the bit.
    """

    def forward(self, x: Tensor) -> Tensor:
        if not (self.training and is_shared()):
            return super().forward(x)
        self._check_input_dim(x)
        mean, variance, count = _moments(x, (0, *range(2, x.dim())))
        if self.track_running_stats:
            self._track(mean.detach(), (variance * count / (count - 1)).detach())
        return _affine(x, mean, variance, self.weight, self.bias, self.eps)

    @torch.no_grad()
    def _track(self, mean: Tensor, variance: Tensor) -> None:
        """Running statistics as PyTorch keeps them: the variance ÷ (N − 1), momentum None: a plain average."""
        if self.running_mean is None or self.running_var is None or self.num_batches_tracked is None:
            return
        self.num_batches_tracked += 1
        share = 1 / float(self.num_batches_tracked) if self.momentum is None else self.momentum
        self.running_mean.lerp_(mean.to(self.running_mean.dtype), share)
        self.running_var.lerp_(variance.to(self.running_var.dtype), share)


@contextmanager
def without_tracking(net: nn.Module) -> Iterator[None]:
    """Within it, the batch norms of a network in training use the statistics of the batch, and keep no running ones of it."""
    norms = [module for module in net.modules() if isinstance(module, BatchNorm1d) and module.track_running_stats]
    for norm in norms:
        norm.track_running_stats = False
    try:
        yield
    finally:
        for norm in norms:
            norm.track_running_stats = True
