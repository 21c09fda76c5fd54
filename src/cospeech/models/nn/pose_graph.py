"""Convolutions on the graph of a pose and over time: spatial temporal graph convolutional networks (Yan et al. 2018)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn import functional as F

from .norm import BatchNorm1d

__all__ = ["GraphConvolution", "GraphNorm", "spatial_partition"]

Edges = Sequence[tuple[int, int]]


def _hops(nodes: int, edges: Edges, most: int) -> NDArray[np.float64]:
    """(V, V) number of edges between two nodes; infinite beyond ``most``."""
    near = np.eye(nodes, dtype=bool)
    for a, b in edges:
        near[a, b] = near[b, a] = True
    hops, reachable = np.full((nodes, nodes), np.inf), np.eye(nodes, dtype=bool)
    for k in range(most + 1):
        hops[reachable & np.isinf(hops)] = k
        reachable = reachable @ near
    return hops


def spatial_partition(nodes: int, edges: Edges, most: int = 2) -> NDArray[np.float32]:
    """(1 + 2 · most, V, V) adjacency matrices by distance, and by which of two nodes is nearer to node 0.

    A column's sum over all of them is 1. Of nodes k edges apart, one matrix has the pairs whose first node is as far from node
    0 as the second or further, another those whose first node is nearer.

    Args:
        nodes: V.
        edges: pairs of nodes.
        most: edges between nodes that matter to each other.
    """
    hops = _hops(nodes, edges, most)
    weight = np.isfinite(hops) / np.isfinite(hops).sum(0)
    nearer = hops[:, :1] < hops[:, :1].T
    matrices = [np.where(hops == 0, weight, 0)]
    for k in range(1, most + 1):
        matrices += [np.where((hops == k) & ~nearer, weight, 0), np.where((hops == k) & nearer, weight, 0)]
    return np.stack(matrices).astype(np.float32)


class GraphNorm(BatchNorm1d):
    """Batch norm of (B, C, T, V), per channel, or per channel and node.

    Args:
        channels: C.
        nodes: V; 1: all nodes of a channel have one mean and deviation.
    """

    def __init__(self, channels: int, nodes: int = 1) -> None:
        super().__init__(channels * nodes)
        self.nodes = nodes

    def forward(self, x: Tensor) -> Tensor:
        if self.nodes == 1:
            return super().forward(x.flatten(2)).reshape(x.shape)
        y = super().forward(x.transpose(2, 3).flatten(1, 2))
        return y.unflatten(1, (-1, self.nodes)).transpose(2, 3)

    def for_inference(self) -> nn.Module:
        """The same as a product and a sum."""
        return _Affine(self)


class _Affine(nn.Module):
    """A norm after training, computed in double precision."""

    scale: Tensor
    shift: Tensor

    @torch.no_grad()
    def __init__(self, norm: GraphNorm) -> None:
        super().__init__()
        mean, variance = norm.running_mean, norm.running_var
        assert mean is not None
        assert variance is not None
        scale = norm.weight.double() / (variance.double() + norm.eps).sqrt()
        shift = norm.bias.double() - mean.double() * scale
        for name, value in (("scale", scale), ("shift", shift)):
            self.register_buffer(name, value.float().reshape(1, -1, 1, norm.nodes))

    def forward(self, x: Tensor) -> Tensor:
        return x * self.scale + self.shift


class GraphConvolution(nn.Module):
    """(B, inputs, T, V) → (B, outputs, T, V): a convolution over time for each adjacency matrix, their weighted sum over nodes,
    a convolution over time and nodes, and a residual.

    Args:
        inputs, outputs: channels.
        adjacency: (K, V, V) of `spatial_partition`.
        time, space: odd kernels over frames and over nodes.
    """

    adjacency: Tensor

    def __init__(self, inputs: int, outputs: int, adjacency: NDArray[np.float32], time: int, space: int) -> None:
        super().__init__()
        self.register_buffer("adjacency", torch.from_numpy(adjacency), persistent=False)
        self.over_time = nn.Conv2d(inputs, outputs * len(adjacency), (time, 1), padding=(time // 2, 0))
        self.first_norm, self.second_norm, self.short_norm = (GraphNorm(outputs) for _ in range(3))
        self.over_both = nn.Conv2d(outputs, outputs, (time, space), padding=(time // 2, space // 2))
        self.short = nn.Conv2d(inputs, outputs, 1)

    def forward(self, x: Tensor) -> Tensor:
        count, nodes = self.adjacency.shape[:2]
        parts = self.over_time(x).unflatten(1, (count, -1)).permute(0, 1, 4, 2, 3).flatten(1, 2)
        weights = self.adjacency.permute(2, 0, 1).reshape(nodes, -1, 1, 1)
        y = F.conv2d(parts, weights).permute(0, 2, 3, 1)  # of the nodes of all matrices, as a bundle may compute it
        y = self.over_both(self.first_norm(y).relu())
        whole: Tensor = (self.second_norm(y) + self.short_norm(self.short(x))).relu()
        return whole
