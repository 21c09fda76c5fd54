"""The weights of a bundle of the stylised flow, back in the network that was bundled: to train it further.

`cospeech.runtime.flow.weights.pack_weights` joins layers that only training needs apart. What it joined has no other trace in
a bundle, so one of the many networks that give the same motion comes back: batch norms do nothing until `calibrate_norms`, and
actnorms only shift. 8-bit products stay rounded.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn

from ..models.nn.norm import BatchNorm1d, global_moments
from ..motion.rotations import Array
from ..runtime.flow.weights import SCALE_SHIFT, FlowSizes, unpack

__all__ = ["calibrate_norms", "unpack_flow"]

_ENDS = (("weight", ""), ("bias", ".bias"))


def unpack_flow(weights: Mapping[str, Array], sizes: FlowSizes) -> dict[str, Tensor]:
    """Parameters by name, as `cospeech.models.stylised_flow.StylisedFlow.state_dict` has them.

    Args:
        weights: of a bundle.
        sizes: of the same bundle; its cells are GRUs.
    """
    out: dict[str, Array] = {}
    past = np.split(unpack(weights, "past"), sizes.steps, 1)
    speech = np.split(unpack(weights, "speech"), sizes.steps, 1)
    bias = np.split(weights["speech.bias"], sizes.steps)
    for k in range(sizes.steps):
        at, net = f"flow.steps.{k}.", f"flow.steps.{k}.coupling.net."
        poses, feature = np.split(past[k], [sizes.history * sizes.pose])
        first = np.concatenate([weights[f"{k}.kept"], poses, speech[k], feature])
        for layer in range(sizes.layers):
            inputs = first if layer == 0 else unpack(weights, f"{k}.{layer}.ih")
            out[f"{net}rnn.weight_ih_l{layer}"] = inputs.T
            out[f"{net}rnn.bias_ih_l{layer}"] = bias[k] if layer == 0 else weights[f"{k}.{layer}.ih.bias"]
            out[f"{net}rnn.weight_hh_l{layer}"] = unpack(weights, f"{k}.{layer}.hh").T
            out[f"{net}rnn.bias_hh_l{layer}"] = weights[f"{k}.{layer}.hh.bias"]
        out |= _coupling_ends(weights, k, sizes, net) | _mixing(weights, k, at)
    if sizes.feature:
        out |= dict(_encoder(weights, sizes))
    if sizes.style:
        out |= {f"stylist.convolutions.{2 * n}.{kind}": weights[f"style.{n}{end}"] for n in range(3) for kind, end in _ENDS}
        out |= {"stylist.full.weight": weights["style.full"].T, "stylist.full.bias": weights["style.full.bias"]}
        out |= dict(_idle_norm("stylist.norm", sizes.style))
    return {name: torch.from_numpy(np.array(value, np.float32)) for name, value in out.items()}


def _coupling_ends(weights: Mapping[str, Array], k: int, sizes: FlowSizes, net: str) -> dict[str, Array]:
    """The last layer of a coupling, whose shifts and scales alternate in the network."""
    width = sizes.pose - sizes.first_half
    pairs = np.concatenate([np.arange(0, 2 * width, 2), np.arange(1, 2 * width, 2)])
    bias = weights[f"{k}.out.bias"].copy()
    bias[width:] -= SCALE_SHIFT
    back = np.argsort(pairs)
    return {f"{net}out.weight": weights[f"{k}.out"].T[back], f"{net}out.bias": bias[back]}


def _mixing(weights: Mapping[str, Array], k: int, at: str) -> dict[str, Any]:
    """Actnorm and 1×1 convolution of a step; the scale of the first is in the second."""
    matrix = torch.from_numpy(np.linalg.inv(weights[f"{k}.mix"].T.astype(np.float64)))
    permutation, lower, upper = torch.linalg.lu(matrix)
    diagonal = upper.diagonal()
    parts = {
        "permutation": permutation, "lower": lower.tril(-1), "upper": upper.triu(1), "sign": diagonal.sign(),
        "log_s": diagonal.abs().log(),
    }  # fmt: skip
    norm = {"bias": -weights[f"{k}.mix.bias"], "logs": np.zeros(len(matrix)), "initialised": np.array(1.0)}
    return {f"{at}mix.{n}": part.numpy() for n, part in parts.items()} | {f"{at}norm.{n}": value for n, value in norm.items()}


def _encoder(weights: Mapping[str, Array], sizes: FlowSizes) -> Iterator[tuple[str, Array]]:
    """The global encoder; its batch norms do nothing but add a bias."""
    for side in ("poses", "speech"):
        for part in ("first", *(f"blocks.{n}" for n in range(sizes.blocks)), "last"):
            conv, norm = (part, f"{part}_norm") if "." not in part else (f"{part}.conv", f"{part}.norm")
            yield f"encoder.{side}.{conv}.weight", weights[f"{side}.{part}"]
            yield f"encoder.{side}.{norm}.bias", (bias := weights[f"{side}.{part}.bias"])
            yield from _idle_norm(f"encoder.{side}.{norm}", len(bias))
            yield f"encoder.{side}.{norm}.weight", np.ones(len(bias))
    yield "encoder.full.0.weight", np.concatenate([weights["full0.poses"], weights["full0.speech"]]).T
    for number, name in ((2, "full1"), (4, "full2")):
        yield f"encoder.full.{number}.weight", weights[name].T
    for number, name in ((0, "full0"), (2, "full1"), (4, "full2")):
        yield f"encoder.full.{number}.bias", weights[f"{name}.bias"]


def _idle_norm(at: str, channels: int) -> Iterator[tuple[str, Array]]:
    """Statistics of a batch norm that does nothing."""
    yield f"{at}.running_mean", np.zeros(channels)
    yield f"{at}.running_var", np.ones(channels)


@torch.no_grad()
def calibrate_norms(encoder: nn.Module, run: Callable[[], object]) -> None:
    """Give the batch norms of an encoder the statistics of what they receive in a run; what the encoder gives stays the same.

    Args:
        encoder: in evaluation mode.
        run: lets the network encode a batch once.
    """

    def set_statistics(norm: nn.Module, arguments: tuple[Tensor, ...]) -> None:
        assert isinstance(norm, BatchNorm1d)
        assert norm.running_mean is not None
        assert norm.running_var is not None
        mean, std = global_moments(arguments[0], (0, 2))
        gain = norm.weight / (norm.running_var + norm.eps).sqrt()
        norm.bias.add_((mean - norm.running_mean) * gain)
        norm.running_mean.copy_(mean)
        norm.running_var.copy_(std.square())
        norm.weight.copy_(gain * (norm.running_var + norm.eps).sqrt())

    hooks = [part.register_forward_pre_hook(set_statistics) for part in encoder.modules() if isinstance(part, BatchNorm1d)]
    run()
    for hook in hooks:
        hook.remove()
