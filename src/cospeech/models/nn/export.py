"""Exports of a network: modules with named inputs and outputs, and its layers as they run after training."""

from __future__ import annotations

from collections.abc import Mapping
from copy import deepcopy
from dataclasses import dataclass, field
from typing import Any

import torch
from torch import Tensor, nn
from torch.nn.utils import parametrize

__all__ = ["ExportGraph", "Playing", "fold_norm", "inference_copy", "without_inputs"]

Shape = tuple[int | str, ...]
"""Numbers, and the names of sizes that vary: N takes, T frames, S steps of ``multiple`` frames each."""


@dataclass(frozen=True)
class ExportGraph:
    """A module, and the names and shapes of its inputs and outputs.

    In PyTorch every input has N takes. An input whose first size is 1 is the same for all takes. Results that depend on
    such inputs alone are then computed once for all takes.
    """

    module: nn.Module
    """Called with the inputs, then the states, in their order; gives the outputs, then the states after it."""
    inputs: Mapping[str, Shape]
    outputs: Mapping[str, Shape]
    states: Mapping[str, int] = field(default_factory=dict)
    """Name → numbers of a take; after a call the state is the output ``next.NAME``."""
    frames: int = 64
    """An example of T, a multiple of ``multiple``."""
    multiple: int = 1
    """T is a multiple of this."""
    shortest: int = 1
    """The least T."""
    window: int | None = None
    """For this field and those below see `cospeech.runtime.bundles.signature.Signature`."""
    look_ahead: int = 0
    hop: int | None = None
    seeds: int = 0
    groups: int = 1
    steps: int = 0
    normal_noise: bool = False
    fixed: bool = False
    """Whether T is always ``window``."""


class Playing(nn.Module):
    """``make`` of a network, without the inputs that have no width."""

    def __init__(self, net: Any) -> None:
        super().__init__()
        self.net = net

    def forward(self, rows: Tensor, *inputs: Tensor) -> Tensor:
        others = iter(inputs)
        nothing = rows[..., :0]
        style, mode_noise = (next(others) if width else nothing for width in (self.net.styles, self.net.modes))
        poses: Tensor = self.net.make(rows, style, mode_noise)
        return poses


def inference_copy(net: nn.Module) -> nn.Module:
    """A copy with the same outputs that is cheaper to run: norms lie in the layers before them, parametrised weights are plain.

    A module with a method ``for_inference`` is replaced by the result of that method.
    """
    copy = deepcopy(net).eval()
    for part in copy.modules():
        if parametrize.is_parametrized(part):
            _make_plain(part)
    return _simplify(copy)


def _make_plain(part: Any) -> None:
    """Make parametrised weights plain. PyTorch's own removal would change the class, which the original shares."""
    values = {name: getattr(part, name).detach() for name in part.parametrizations}
    del part.parametrizations
    part.__class__ = type(part).__bases__[0]
    for name, value in values.items():
        setattr(part, name, nn.Parameter(value))


def _simplify(net: Any) -> Any:
    if hasattr(net, "for_inference"):
        return _simplify(net.for_inference())
    for name, child in [*net.named_children()]:
        setattr(net, name, _simplify(child))
    if isinstance(net, nn.Sequential):
        for k, (layer, after) in enumerate(zip([*net], [*net][1:], strict=False)):
            if isinstance(layer, nn.Conv1d | nn.ConvTranspose1d | nn.Linear) and isinstance(after, nn.BatchNorm1d):
                net[k], net[k + 1] = fold_norm(layer, after), nn.Identity()
    return net


@torch.no_grad()
def fold_norm(conv: Any, norm: Any) -> Any:
    """A copy of a convolution or a linear layer, with the batch norm after it in its weights; folded in double precision."""
    layer = deepcopy(conv)
    gain = norm.weight.double() / (norm.running_var.double() + norm.eps).sqrt()
    sizes = [1] * conv.weight.ndim
    sizes[isinstance(conv, nn.ConvTranspose1d)] = -1  # whose weights are (inputs, outputs, kernel)
    layer.weight.copy_(conv.weight.double() * gain.reshape(sizes))
    bias = (conv.bias.double() - norm.running_mean.double()) * gain + norm.bias.double()
    layer.bias.copy_(bias)
    return layer


@torch.no_grad()
def without_inputs(net: Any, count: int) -> Any:
    """A copy of an LSTM or a GRU without its first inputs, which are zeros."""
    if not count:
        return net
    cut = type(net)(
        net.input_size - count, net.hidden_size, net.num_layers, batch_first=net.batch_first, bidirectional=net.bidirectional
    )
    for name, value in net.named_parameters():
        getattr(cut, name).copy_(value[:, count:] if name.startswith("weight_ih_l0") else value)
    return cut
