"""A network of frames, played over speech that comes in pieces: it keeps a state, and waits only for its look-ahead."""

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
        ahead: frames of speech after a frame that are waited for, where they are fewer than the network's. From its state the
            network then goes on as if the last row came again, up to the frame that is due; the states of these steps are
            dropped. Each frame costs so many steps more.
    """

    def __init__(self, *args: Any, ahead: int | None = None, **options: Any) -> None:
        super().__init__(*args, **options)
        usual = self._network.signature.look_ahead
        self._look_ahead = usual if ahead is None else min(ahead, usual)
        self._extra_steps = usual - self._look_ahead
        self._state = self._network.begin(self.takes)
        self._rows_in = self._frames_out = 0

    @property
    def latency(self) -> float:
        """See `Decoder`."""
        return (self._look_ahead + 1) / self._system.fps

    def push(self, rows: Array) -> Array:
        """See `Decoder`."""
        self._style.forget(self._frames_out)
        poses = [self._none()]
        for row in rows:
            self._hear(row[None])
            style = self._style.codes(np.array([self._rows_in]))[:, 0]
            ports = {"rows": row[None], "style": np.broadcast_to(style, (self.takes, style.shape[1]))}
            ports["noise"] = self._draw_noise(1)[:, 0]
            outputs = self._run(ports | self._state)
            self._state = {name: outputs[f"next.{name}"] for name in self._state}
            self._rows_in += 1
            for _ in range(self._extra_steps if self._rows_in > self._look_ahead else 0):
                outputs = self._run(ports | {name: outputs[f"next.{name}"] for name in self._state})
            if self._rows_in > self._look_ahead:
                poses.append(outputs["poses"][:, None])
                self._frames_out += 1
        return np.concatenate(poses, 1)

    def finish(self, silence: Array) -> Array:
        """See `Decoder`."""
        return self.push(np.repeat(silence, self._look_ahead if self._rows_in else 0, 0))
