"""A trained network as graphs that play without PyTorch, with their signatures."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from torch import Tensor

from ...errors import InputError
from ...models.chain_live import ChainLive
from ...models.chain_of_generation import ChainOfGeneration
from ...models.moglow import MoGlow
from ...models.nn.modalities import ManyInputs
from ...models.nn.seeded_windows import SeededWindows
from ...models.nn.words import SubwordTable
from ...models.stylised_flow import StylisedFlow
from ...motion.rotations import Array
from ...runtime.bundles.signature import Signature
from .onnx_export import export_graphs

__all__ = ["ExportedModel", "export_model"]


@dataclass(frozen=True)
class ExportedModel:
    """Graphs, and what a bundle says of them."""

    signatures: Mapping[str, Signature]
    graphs: Mapping[str, bytes]
    weights: Mapping[str, Array]
    words: Array
    """(n, W) rows of subwords; of no size for a network that reads none."""


def export_model(model: Any, name: str) -> ExportedModel | None:
    """A network that makes motion, as graphs; None for a flow, whose step is an engine of its own.

    Args:
        model: of a run.
        name: of the model, for messages.

    Raises:
        InputError: it makes no motion, or what no bundle can hold.
    """
    if isinstance(model, MoGlow | StylisedFlow):
        return None
    reads = isinstance(model, ChainOfGeneration | ManyInputs) or (
        isinstance(model, SeededWindows) and model.embedding is not None
    )
    words = _check_inputs(model, name) if reads else np.zeros(0, np.float32)
    exported = export_graphs(model.export_module())
    return ExportedModel(exported.signatures, exported.graphs, exported.weights, words)


def _check_inputs(model: Any, name: str) -> Array:
    """Rows of subwords of a network of many inputs, of which a bundle can hold all that it needs."""
    whole = model
    if isinstance(model, ChainLive):
        if model.teacher is None:
            raise InputError(f"the run of {name!r} has no teacher", "train it with [needs] teacher = …")
        whole = model.teacher
    if whole.encoder_for(whole.config) is not None:
        raise InputError(
            f"the run of {name!r} needs the speech encoder {whole.config.speech_encoder}, which bundles cannot hold",
            "bundles play without PyTorch; train it without one",
        )
    chains = [net.config for net in (model, whole) if isinstance(net, ChainOfGeneration)]
    if not all(config.attention and config.style_injection for config in chains):
        raise InputError(f"the run of {name!r} lacks attention or style, and cannot become a bundle", "train the whole network")
    words = whole.word if isinstance(whole, ChainOfGeneration) else whole.embedding
    if not isinstance(words, SubwordTable):
        raise InputError(f"the run of {name!r} uses ready-made word vectors", "leave out data.words, and train again")
    rows: Tensor = words.table.weight.detach().clone()
    rows[0] = 0
    return rows.numpy()
