"""A network of frames, played over speech that comes in pieces: it remembers, and waits for its look-ahead alone."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..motion.rotations import Array
from .network_decoder import NetworkDecoder

__all__ = ["CausalStreamDecoder"]


class CausalStreamDecoder(NetworkDecoder):
    """Frame by frame: every row of speech makes the pose of the frame that lies ``look_ahead`` before it certain.

    For the arguments see `NetworkDecoder`.

    Args:
        ahead: frames of speech after a frame that are waited for, where they are fewer than the network's. From the state that
            the speech has led to, the network then goes on alone as if the last row were heard again, up to the frame that is
            due; what it goes through is forgotten. This costs as many steps more for each frame.
    """

    def __init__(self, *given: Any, ahead: int | None = None, **options: Any) -> None:
        super().__init__(*given, **options)
        usual = self._network.signature.look_ahead
        self._look_ahead = usual if ahead is None else min(ahead, usual)
        self._guessed = usual - self._look_ahead
        self._state = self._network.begin(self.takes)
        self._heard = self._made = 0

    @property
    def latency(self) -> float:
        """See `Decoder`."""
        return (self._look_ahead + 1) / self._system.fps

    def push(self, rows: Array) -> Array:
        """See `Decoder`."""
        self._style.forget(self._made)
        made = [self._none()]
        for row in rows:
            self._hear(row[None])
            style = self._style.codes(np.array([self._heard]))[:, 0]
            ports = {"rows": row[None], "style": np.broadcast_to(style, (self.takes, style.shape[1]))}
            ports["noise"] = self._draw_noise(1)[:, 0]
            found = self._run(ports | self._state)
            self._state = {name: found[f"next.{name}"] for name in self._state}
            self._heard += 1
            for _ in range(self._guessed if self._heard > self._look_ahead else 0):
                found = self._run(ports | {name: found[f"next.{name}"] for name in self._state})
            if self._heard > self._look_ahead:
                made.append(found["poses"][:, None])
                self._made += 1
        return np.concatenate(made, 1)

    def finish(self, silence: Array) -> Array:
        """See `Decoder`."""
        return self.push(np.repeat(silence, self._look_ahead if self._heard else 0, 0))
