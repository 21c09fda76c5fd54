"""A bundle, opened: its facts and its networks, ready to run; and a system written as a bundle."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from os import PathLike, fsdecode
from pathlib import Path
from typing import Any

import numpy as np

from ..audio.features.words import plain_word, subword_rows
from ..errors import InputError
from ..motion.rotations import Array
from .bundles.bundle import Bundle, pack_arrays, read_bundle, write_bundle
from .bundles.signature import Signature
from .bundles.spec import CARD, STATISTICS, WEIGHTS, BundleFacts, BundleSpec, read_spec
from .bundles.statistics import Statistics
from .flow.engine import FlowEngine
from .flow.graph import build_graphs
from .flow.weights import FlowSizes, pack_weights
from .network import Network

__all__ = ["System", "open_bundle", "open_system", "without_calibration", "write_flow", "write_networks"]


@dataclass(frozen=True)
class System(BundleFacts):
    """An opened bundle: its facts and its networks, ready to run."""

    networks: Mapping[str, Network]
    """See `cospeech.runtime.bundles.signature.NETWORKS`; none for a flow."""
    flow: FlowEngine | None = None

    @property
    def pose_width(self) -> int:
        """D."""
        return len(self.statistics.pose_mean)

    @property
    def main_network(self) -> Network:
        """The network of windows, or that of frames where there is no other; not of a flow."""
        return self.networks.get("make") or self.networks["live"]

    @property
    def draws(self) -> bool:
        """Whether its motion is drawn, see `cospeech.runtime.samplers`; not a flow's."""
        return "hear" in self.networks

    @property
    def has_emotions(self) -> bool:
        """Whether emotions are a part of the style."""
        return self.style_space == "speaker-emotion"

    def word_rows(self, words: list[str | None]) -> Array:
        """(T, W) what stands for the words of T frames; zeros where there is none, or one that is not known."""
        table = self.statistics.words
        if self.vocabulary is not None:
            return table[[self.vocabulary.get(plain_word(word), 0) if word else 0 for word in words]]
        ids = subword_rows(words)
        total, count = table[ids].sum(1), np.maximum((ids > 0).sum(1, keepdims=True), 1)
        return (total / count).astype(np.float32)


def open_system(spec: BundleSpec) -> System:
    """The networks of a bundle, ready to run.

    Raises:
        InputError: a graph is not what its signature says, or fails.
    """
    facts = {f.name: getattr(spec, f.name) for f in fields(BundleFacts)}
    bounds = spec.statistics.bounds
    try:
        flow = None if spec.flow is None else FlowEngine(spec.flow, spec.weights, spec.graphs, *bounds)
        networks = {
            name: Network(signature, spec.graphs[name], spec.weights, {"poses": bounds})
            for name, signature in spec.signatures.items()
        }
    except InputError as error:
        raise InputError(f"{spec.name!r}: {error.problem}", error.hint) from error
    return System(**facts, networks=networks, flow=flow)


def without_calibration(system: System) -> System:
    """The system without what was measured when its bundle was made: its networks' own poses, noise of size 1, no rest.

    A flow keeps the means and deviations of its speakers, without which it has no poses, and the factor on fed-back poses.
    """
    s = system.statistics
    bare = replace(
        s, model_mean=s.speaker_mean, live_model_mean=s.speaker_mean, style_gain=np.ones_like(s.style_gain),
        live_style_gain=np.ones_like(s.live_style_gain), noise_gain=np.ones_like(s.noise_gain),
        free_mean=np.zeros_like(s.free_mean), free_std=np.ones_like(s.free_std),
    )  # fmt: skip
    return replace(system, statistics=bare, rests=False, emotion_strength={})


def open_bundle(path: str | PathLike[str]) -> System:
    """A bundle's file, ready to play.

    Raises:
        InputError: it cannot be read, or is no bundle of ours.
    """
    return open_system(read_spec(read_bundle(path)))


def write_networks(
    path: str | PathLike[str],
    signatures: Mapping[str, Signature],
    graphs: Mapping[str, bytes],
    weights: Mapping[str, Array],
    statistics: Statistics,
    *,
    facts: Mapping[str, Any],
    card: str = "",
) -> None:
    """Write networks as a bundle.

    Args:
        path: file to write.
        signatures: network → signature.
        graphs: network → ONNX.
        weights: of the graphs, float32, or some float16 (`cospeech.runtime.bundles.spec.half`).
        statistics: of the training data.
        facts: for the manifest, those of `cospeech.runtime.bundles.spec.BundleFacts` among them.
        card: Markdown.

    Raises:
        InputError: these do not fit together, or the file cannot be written.
    """
    manifest = {**facts, "networks": {name: signature.to_dict() for name, signature in signatures.items()}}
    _write(path, manifest, graphs, weights, statistics, card)


def write_flow(
    path: str | PathLike[str],
    arrays: Mapping[str, Array],
    sizes: FlowSizes,
    statistics: Statistics,
    *,
    facts: Mapping[str, Any],
    card: str = "",
) -> None:
    """Write a flow as a bundle.

    Args:
        path: file to write.
        arrays: of the network, see `cospeech.runtime.flow.weights.pack_weights`.
        sizes: of the network; ``int8`` says how weights are kept.
        statistics, facts, card: as of `write_networks`.

    Raises:
        InputError: as of `write_networks`.
    """
    weights = pack_weights(arrays, sizes)
    manifest = {**facts, "flow": vars(sizes), "style_space": "code" if sizes.style else "none"}
    _write(path, manifest, build_graphs(weights, sizes), weights, statistics, card)


def _write(
    path: str | PathLike[str], facts: Mapping[str, Any], graphs: Mapping[str, bytes], weights: Mapping[str, Array],
    statistics: Statistics, card: str,
) -> None:  # fmt: skip
    """Write a bundle, after a check that it can be opened."""
    members = {
        WEIGHTS: pack_arrays(weights),
        STATISTICS: pack_arrays({name: value for name, value in vars(statistics).items() if value.size}),
        **{f"{name}.onnx": graph for name, graph in graphs.items()},
        CARD: card.encode(),
    }
    manifest = {"smooth": 1, **facts}
    open_system(read_spec(Bundle(Path(fsdecode(path)).name, manifest, members)))
    write_bundle(path, manifest, members)
