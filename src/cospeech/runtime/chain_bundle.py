"""Chains of Generation as bundles, and networks like them: speech, words, speaker and emotion in, poses out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from os import PathLike
from typing import Any

import numpy as np

from ..audio.features.words import BUCKETS, plain_word, subword_rows
from ..errors import InputError
from ..motion.rotations import Array
from .bundle import Bundle
from .chain_engine import ChainEngine, ChainSizes
from .manifest import (
    WEIGHTS,
    Normalisation,
    System,
    check_kind,
    check_numbers,
    pose_bounds,
    read_facts,
    read_sizes,
    read_statistics,
    write_system,
)
from .window_bundle import unpack_weights

__all__ = ["KIND", "VOICE", "ChainStatistics", "ChainSystem", "open_chain", "write_chain"]

KIND = "chain"
"""What a manifest's ``kind`` says of a bundle of this module."""
VOICE = "voice"
"""The style that a chain hears in the voice, beside its speakers' names."""
_BY_SPEAKER = ("speaker_mean", "model_mean", "style_gain", "live_model_mean", "live_style_gain")


@dataclass(frozen=True)
class ChainStatistics(Normalisation):
    """Normalisation, what stands for each speaker, and what stands for words."""

    speaker_mean: Array
    """(S, D) standardised mean pose of each speaker."""
    model_mean: Array
    """(S, D) mean of what the network of windows makes in each speaker's style, which the speaker's own takes the place of."""
    style_gain: Array
    """(S, D) by what that is multiplied, so that it deviates from its mean as the speaker does; positive."""
    live_model_mean: Array
    """(S, D) and (S, D): the same of the network of frames; those of windows again where there is none."""
    live_style_gain: Array
    noise_gain: Array
    """(2,) by what noise is multiplied when the network of windows plays, and that of frames, so that takes differ."""
    words: Array
    """(n, W) rows that stand for subwords (`cospeech.audio.features.words`), or for the words of the vocabulary; the first:
    none."""


@dataclass(frozen=True)
class ChainSystem(System):
    """A chain ready to perform."""

    engine: ChainEngine
    statistics: ChainStatistics
    vocabulary: Mapping[str, int] | None
    """Word → its row; None: words are the mean of their subwords' rows."""

    @property
    def speakers(self) -> tuple[str, ...]:
        """Names of the speakers alone."""
        return self.styles[: self.engine.sizes.speakers]

    def word_rows(self, words: list[str | None]) -> Array:
        """(T, W) what stands for the words of T frames; zeros where there is none, or one that is not known."""
        table = self.statistics.words
        if self.vocabulary is not None:
            return table[[self.vocabulary.get(plain_word(word), 0) if word else 0 for word in words]]
        ids = subword_rows(words)
        total, count = table[ids].sum(1), np.maximum((ids > 0).sum(1, keepdims=True), 1)
        return (total / count).astype(np.float32)


def write_chain(
    path: str | PathLike[str],
    weights: Mapping[str, Array],
    graphs: Mapping[str, bytes],
    sizes: ChainSizes,
    statistics: ChainStatistics,
    *,
    pose: str,
    fps: float,
    audio: str,
    smooth: int = 1,
    facts: Mapping[str, Any],
    card: str = "",
) -> None:
    """Write a chain as a bundle.

    Args:
        weights: of the graphs, float32, or some float16 (`cospeech.runtime.window_bundle.halve_weights`).
        graphs: see `ChainEngine`.
        sizes: of the networks.
        statistics: of the training data.
        pose, fps: representation and rate.
        audio: name of the reduction of audio (`cospeech.audio.features.reduce.REDUCTIONS`).
        smooth: see `cospeech.runtime.manifest.Facts`.
        facts: for the manifest; ``styles`` are the names of the speakers, and `VOICE` where there is a classifier, ``style``
            one of them; ``vocabulary``, the words of ``statistics.words``, where these are not subwords.
        card: Markdown.

    Raises:
        InputError: these do not fit together.
    """
    _check(statistics, sizes, graphs, facts["styles"], facts.get("vocabulary"))
    ChainEngine(sizes, unpack_weights(weights), graphs, *pose_bounds(statistics))
    known = {**facts, "pose": pose, "fps": fps, "audio": audio, "smooth": smooth}
    write_system(path, KIND, sizes, weights, graphs, statistics, known, card)


def open_chain(bundle: Bundle) -> ChainSystem:
    """An engine and all that it needs, out of a bundle.

    Raises:
        InputError: the bundle is of another kind, or its parts do not fit together.
    """
    check_kind(bundle, KIND, "a chain")
    sizes = read_sizes(bundle, ChainSizes)
    known = read_facts(bundle, sizes.pose, sizes.audio)
    statistics = read_statistics(bundle, ChainStatistics)
    words = bundle.fact("vocabulary", list) if "vocabulary" in bundle.manifest else None
    _check(statistics, sizes, bundle.graphs(), known.styles, words)
    engine = ChainEngine(sizes, unpack_weights(bundle.arrays(WEIGHTS)), bundle.graphs(), *pose_bounds(statistics))
    vocabulary = None if words is None else {word: k for k, word in enumerate(words, 1)}
    return ChainSystem(**vars(known), engine=engine, statistics=statistics, vocabulary=vocabulary)


def _check(
    statistics: ChainStatistics, sizes: ChainSizes, graphs: Mapping[str, bytes], styles: Any, vocabulary: list[Any] | None
) -> None:
    if len(styles) != sizes.speakers + ("classify" in graphs) or ("classify" in graphs and styles[-1] != VOICE):
        raise InputError(f"{len(styles)} styles of a chain of {sizes.speakers} speakers", "is the bundle damaged?")
    if vocabulary is not None and not all(isinstance(word, str) for word in vocabulary):
        raise InputError("a vocabulary that is not of words", "is the bundle damaged?")
    rows = BUCKETS if vocabulary is None else len(vocabulary)
    by_speaker = dict.fromkeys(_BY_SPEAKER, (sizes.speakers, sizes.pose))
    check_numbers(statistics, sizes.pose, sizes.audio, by_speaker | {"noise_gain": (2,), "words": (rows + 1, sizes.words)})
    if statistics.words[0].any():
        raise InputError("a word that is none and has numbers", "is the bundle damaged?")
    if min(statistics.style_gain.min(), statistics.live_style_gain.min()) <= 0:
        raise InputError("a gain of a style that is not positive", "is the bundle damaged?")
