"""Layers after a network, one after the other: each takes frames as they come, and gives those that are certain."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from ..motion.rotations import Array

__all__ = ["LayerStack", "MotionLayer"]


class MotionLayer(Protocol):
    """Frames in, frames out, a little later."""

    @property
    def look_ahead(self) -> float:
        """Seconds of motion after a frame that it waits for."""
        ...

    @property
    def sound_ahead(self) -> float:
        """Seconds of 16 kHz sound after a frame that it waits for; 0 where it does not listen."""
        ...

    def push(self, rotations: Array, root: Array) -> tuple[Array, Array]:
        """The next frames, (n, J, 4) and (n, 3); gives those that have become certain."""
        ...

    def finish(self) -> tuple[Array, Array]:
        """The frames that are left."""
        ...


class LayerStack:
    """Layers of one take, the first one next to the network."""

    def __init__(self, layers: Sequence[MotionLayer] = ()) -> None:
        self._layers = layers

    @property
    def look_ahead(self) -> float:
        """Seconds of motion after a frame that all of them together wait for."""
        return sum(layer.look_ahead for layer in self._layers)

    @property
    def sound_ahead(self) -> float:
        """Seconds of 16 kHz sound after a frame that all of them together wait for."""
        ahead = 0.0
        for layer in self._layers:
            ahead = max(ahead + layer.look_ahead, layer.sound_ahead)
        return ahead

    def push(self, rotations: Array, root: Array) -> tuple[Array, Array]:
        """See `MotionLayer.push`."""
        for layer in self._layers:
            rotations, root = layer.push(rotations, root)
        return rotations, root

    def finish(self) -> list[tuple[Array, Array]]:
        """The frames that are left, in pieces: what each layer kept goes through those after it."""
        rest = []
        for k, layer in enumerate(self._layers):
            rest.append(LayerStack(self._layers[k + 1 :]).push(*layer.finish()))
        return rest
