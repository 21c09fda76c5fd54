"""Exports a trained network as graphs that play without PyTorch, with their signatures."""

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
from ...models.nn.words import SubwordTable
from ...models.stylised_flow import StylisedFlow
from ...motion.rotations import Array
from ...runtime.bundles.signature import Signature
from .onnx_export import export_graphs

__all__ = ["ExportedModel", "export_model"]


@dataclass(frozen=True)
class ExportedModel:
    """Graphs, with their signatures, weights and words."""

    signatures: Mapping[str, Signature]
    graphs: Mapping[str, bytes]
    weights: Mapping[str, Array]
    words: Array
    """(n, W) rows of subwords; of no size for a network that reads none."""


def export_model(model: Any, name: str) -> ExportedModel | None:
    """A network that makes motion, as graphs; None for a flow, which has an engine of its own.

    Args:
        model: of a run.
        name: of the model, for messages.

    Raises:
        InputError: it makes no motion, or needs something that no bundle can hold.
    """
    if isinstance(model, MoGlow | StylisedFlow):
        return None
    whole = _check_chain(model, name) if isinstance(model, ChainOfGeneration) else model
    words = _word_rows(whole, name)
    export = export_graphs(model.export_module())
    return ExportedModel(export.signatures, export.graphs, export.weights, words)


def _check_chain(model: Any, name: str) -> Any:
    """The network that reads the words for a Chain of Generation: itself, or its teacher.

    Raises:
        InputError: it lacks a teacher, attention or style.
    """
    whole = model
    if isinstance(model, ChainLive):
        if model.teacher is None:
            raise InputError(f"the run of {name!r} has no teacher", "train it with [needs] teacher = …")
        whole = model.teacher
    chains = [net.config for net in (model, whole) if isinstance(net, ChainOfGeneration)]
    if not all(config.attention and config.style_injection for config in chains):
        raise InputError(f"the run of {name!r} lacks attention or style, and cannot become a bundle", "train the whole network")
    return whole


def _word_rows(model: Any, name: str) -> Array:
    """Rows of the subwords of a network; none where it reads no words.

    Raises:
        InputError: a bundle cannot hold all that it needs.
    """
    if model.encoder_for(model.config) is not None:
        raise InputError(
            f"the run of {name!r} needs the speech encoder {model.config.speech_encoder}, which bundles cannot hold",
            "bundles play without PyTorch; train it without one",
        )
    words = model.word_embedding
    if words is None:
        return np.zeros(0, np.float32)
    if not isinstance(words, SubwordTable):
        raise InputError(f"the run of {name!r} uses ready-made word vectors", "leave out data.words, and train again")
    rows: Tensor = words.table.weight.detach().clone()
    rows[0] = 0
    return rows.numpy()
