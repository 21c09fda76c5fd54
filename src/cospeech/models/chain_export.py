"""Exports of a Chain of Generation: ``make`` for whole windows, ``live`` for a frame at a time, ``classify``.

make      rows (1, T, A + W) of speech and words, style (N, T, S + 8), noise (N, T, Z), left out where Z is 0;
          and where it was trained with them, face (1, T, 52 + 1): weights, and to what share each is known, and
          seed (1, T, D + 1): poses, and whether each is known
          → poses (N, T, D)
live      the same of one frame, rows (1, A + W), style (N, S + 8), noise (N, Z), and states → poses (N, D), states after
classify  rows (1, T, A) → logits (1, T, S + 8)
"""

from __future__ import annotations

from copy import deepcopy
from typing import Any

import torch
from torch import Tensor, nn

from .nn.cascade import FACE, Signals
from .nn.export import ExportGraph, Shape, without_inputs
from .nn.temporal import Memory

__all__ = ["chain_graphs"]


def chain_graphs(chain: Any) -> dict[str, ExportGraph]:
    """The graphs of a chain; for a chain that plays frame by frame, ``make`` and ``classify`` are those of its teacher."""
    whole = _teacher(chain)
    frames: dict[str, Shape] = {"rows": (1, "T", whole.audio), "style": ("N", "T", whole.styles)}
    frames |= {"noise": ("N", "T", whole.modes)} if whole.modes else {}
    faces, seeds = _optional(whole)
    inputs = frames | ({"face": (1, "T", FACE + 1)} if faces else {}) | ({"seed": (1, "T", whole.pose + 1)} if seeds else {})
    graphs = {
        "make": ExportGraph(
            _Windows(whole, faces, seeds), inputs, {"poses": ("N", "T", whole.pose)}, window=whole.window,
            hop=max(1, whole.window // 2), look_ahead=whole.window // 4, seeds=seeds,
        ),
    }  # fmt: skip
    if chain is not whole:
        now = {name: (first, width) for name, (first, _, width) in frames.items()}
        live = _Frame(chain)
        graphs["live"] = ExportGraph(live, now, {"poses": ("N", chain.pose)}, live.states(), look_ahead=chain.delay)
    audio, styles = whole.speech_encoder.inputs, whole.styles
    return graphs | {
        "classify": ExportGraph(
            whole.classifier, {"rows": (1, "T", audio)}, {"logits": (1, "T", styles)}, window=2 * whole.classifier.reach + 1
        ),
    }


def _teacher(chain: Any) -> Any:
    return getattr(chain, "teacher", None) or chain


def _optional(chain: Any) -> tuple[int, int]:
    """Numbers of a face, and frames of seed poses, that are optional inputs: it was trained with and without them."""
    return FACE * chain.accepts_face, chain.config.seeds * chain.accepts_seeds


class _Windows(nn.Module):
    """``make``; without the inputs of seed poses where seed poses are no optional input."""

    def __init__(self, chain: Any, faces: int, seeds: int) -> None:
        super().__init__()
        self.speech_encoder, self.widths, self.modes = (
            chain.speech_encoder,
            (chain.speech_encoder.inputs, chain.word.width),
            chain.modes,
        )
        self.faces, self.seeds = faces, seeds
        self.cascade = _without_seeds(chain) if chain.config.seeds and not seeds else chain.cascade

    def forward(self, rows: Tensor, style: Tensor, *inputs: Tensor) -> Tensor:
        others = iter(x.mT for x in inputs)
        noise, face, seed = (next(others) if there else None for there in (self.modes, self.faces, self.seeds))
        extra = [x for x in (seed, noise) if x is not None]
        return self.poses(rows.mT, style.mT, torch.cat(extra, 1) if extra else rows.mT[:, :0], Memory(), face).mT

    def poses(self, rows: Tensor, style: Tensor, extra: Tensor, memory: Memory, face: Tensor | None = None) -> Tensor:
        """All (B, ·, T)."""

        def blend_face(own: Tensor) -> Tensor:
            """The face that TFFDec sees: FaceDec's own, blended with the given face."""
            return own if face is None else own + (face[:, :FACE] - own) * face[:, FACE:]

        speech, words = rows.split(self.widths, 1)
        poses: Tensor = self.cascade(Signals(self.speech_encoder(speech, memory), words, style, extra), memory, blend_face).pose
        return poses


class _Frame(_Windows):
    """``live``: inputs and outputs are of one frame; states are flat."""

    def __init__(self, chain: Any) -> None:
        super().__init__(chain, 0, 0)
        self.shapes = [x.shape[1:] for x in self._blank(chain.styles)]

    @torch.no_grad()
    def _blank(self, styles: int) -> list[Tensor]:
        memory = Memory()
        self.poses(torch.zeros(1, sum(self.widths), 1), torch.zeros(1, styles, 1), torch.zeros(1, self.modes, 1), memory)
        return memory.new_states

    def states(self) -> dict[str, int]:
        """Name → numbers of a take."""
        return {f"state{k}": shape.numel() for k, shape in enumerate(self.shapes)}

    def forward(self, rows: Tensor, style: Tensor, *inputs: Tensor) -> tuple[Tensor, ...]:  # type: ignore[override]
        noise, states = (inputs[0], inputs[1:]) if self.modes else (rows[:, :0], inputs)
        memory = Memory(x.unflatten(1, tuple(shape)) for x, shape in zip(states, self.shapes, strict=True))
        poses = self.poses(rows.unsqueeze(2), style.unsqueeze(2), noise.unsqueeze(2), memory)
        return poses.squeeze(2), *(x.flatten(1) for x in memory.new_states)


def _without_seeds(chain: Any) -> nn.Module:
    """The cascade without the inputs of seed poses, as if they were zeros."""
    cascade = deepcopy(chain.cascade)
    for part in (cascade.body, cascade.hands):
        part.recurrent.lstm = without_inputs(part.recurrent.lstm, chain.pose + 1)
    return cascade  # type: ignore[no-any-return]
