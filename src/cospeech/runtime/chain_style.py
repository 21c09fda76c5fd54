"""Styles of chains: their speakers, mixtures of them, and whoever speaks."""

from __future__ import annotations

import numpy as np

from ..errors import InputError
from ..motion.motion import Motion
from .chain_bundle import VOICE, ChainSystem
from .style_measures import StyleEmbedding, StyleMixture, average_parts
from .window_style import list_shares

__all__ = ["embed_chain_speaker", "example_chain", "mixture_chain"]


def embed_chain_speaker(system: ChainSystem, name: str) -> StyleEmbedding:
    """One of a system's speakers; `VOICE` is nobody, whose share the voice decides."""
    sizes = system.engine.sizes
    code = np.zeros(sizes.speakers, np.float32)
    if name != VOICE:
        code[system.speakers.index(name)] = 1
    return StyleEmbedding(code, np.zeros(sizes.pose, np.float32), np.zeros((0, 0, sizes.pose), np.float32))


def example_chain(system: ChainSystem, motion: Motion, name: str = "the example") -> StyleEmbedding:
    """Raises:
    InputError: a chain does not see styles in motion.
    """
    raise InputError(f"this system cannot see a style in {name}", f"it has {', '.join(system.styles)}, and their mixtures")


def mixture_chain(system: ChainSystem, blend: StyleMixture) -> dict[str, float] | None:
    """Speaker → weight, the heaviest first, of a mixture; None for one speaker, and where the voice decides alone."""
    if len(blend) == 1:
        return None
    shares = average_parts((share, embedding.code) for share, embedding in blend)
    names = {**dict(zip(system.speakers, shares.tolist(), strict=True)), VOICE: 1 - float(shares.sum())}
    return list_shares(names)
