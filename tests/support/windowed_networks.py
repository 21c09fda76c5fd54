"""Small window networks of every kind with random weights and batch norms that do something, for tests of what plays them."""

from __future__ import annotations

from inspect import signature
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn

from cospeech.training.checkpoint import network
from cospeech.training.recipe import build

__all__ = ["KINDS", "given", "make_network", "run_network"]

_MIX = {"modes": 4, "channels": 16, "depth": 3, "style": 4, "patch_channels": 4}
KINDS: dict[str, dict[str, Any]] = {
    "mix-stage": _MIX,
    "stage": _MIX | {"modes": 1, "style_first": True},
    "cmix-gan": {name: value for name, value in _MIX.items() if name != "style"},
    "speech2gesture": {"frames": 64, "channels": 8, "depth": 4, "decoder": 2, "discriminator_channels": 4},
    "audio2gestures": {"frames": 64, "channels": 16, "code": 3},
    "munit": {"frames": 64, "channels": 4, "style": 2, "mlp": 8, "blocks": 2},
    "speech-to-face": {"frames": 64, "channels": 8, "dilations": [1, 3], "ahead": [2, 1]},
}


def make_network(name: str, *, pose: int = 96, audio: int = 20, speakers: int = 3, seed: int = 0, **changes: Any) -> Any:
    """In evaluation mode; weights are large enough that every layer matters to what is made."""
    kind = network(name)
    sizes = {"pose": pose, "audio": audio, "speakers": 1 if name == "cmix-gan" else speakers}
    sizes = {key: size for key, size in sizes.items() if key in signature(kind.__init__).parameters}
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        net = kind(build(kind.Config, KINDS[name] | changes, "model"), **sizes)
        for part in net.modules():
            if isinstance(part, nn.BatchNorm1d):
                part.running_mean.normal_(0, 0.3)
                part.running_var.uniform_(1, 5)
                if part.affine:
                    nn.init.uniform_(part.weight, 0.5, 1.5)
                    nn.init.normal_(part.bias, 0, 0.3)
            elif isinstance(part, nn.Conv1d | nn.Conv2d) and name != "munit":
                nn.init.kaiming_normal_(part.weight)
    return net.eval()


def given(net: Any, takes: int, frames: int, seed: int = 0) -> list[np.ndarray]:
    """Speech (T, A), styles (N, T, styles) and mode noise (N, T, modes) of normal noise; one style throughout where the network
    takes one."""
    rng = np.random.default_rng(seed)
    shapes = [(frames, net.audio), (takes, frames, net.styles), (takes, frames, net.modes)]
    rows, style, mode_noise = (rng.normal(size=shape).astype(np.float32) for shape in shapes)
    if hasattr(net, "moved"):
        style[:] = style[:, :1]
    return [rows, style, mode_noise]


@torch.no_grad()
def run_network(net: Any, rows: np.ndarray, style: np.ndarray, mode_noise: np.ndarray) -> np.ndarray:
    """The poses that PyTorch gives for these inputs: (N, T, D)."""
    speech = torch.from_numpy(rows)[None].expand(len(style), -1, -1)
    poses: Tensor = net.make(speech, torch.from_numpy(style), torch.from_numpy(mode_noise))
    return poses.numpy()
