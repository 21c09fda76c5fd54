"""The animation of an FBX file: a stack with one layer, and curves with a key on every frame.

Keys lie on every frame, with straight lines between them; a curve that never changes keeps one key. Angles do not jump, because
programs go straight from key to key.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ...motion.rotations import Array, continuous_euler, quat_to_euler
from ..frame_buffer import FrameBuffer
from .node_writer import Long, NodeWriter
from .scene_writer import DrivenProperty, SceneWriter, sort_axes

__all__ = ["PERCENT", "TICKS", "AngleRecorder", "FrameRecorder"]

TICKS = 46_186_158_000
"""Ticks of FBX's clock in a second."""
_KEY_VERSION = 4008
_LINEAR = 4  # interpolation, among the flags of a key
PERCENT = 100.0
"""A blendshape is driven in per cent."""


class AngleRecorder:
    """Turns quaternions into angles that do not jump, also between pieces.

    Args:
        orders: of each joint's rotation, intrinsic, such as ``"ZXY"``.
    """

    def __init__(self, orders: Sequence[str]) -> None:
        self._columns = {order: np.flatnonzero([order == own for own in orders]) for order in dict.fromkeys(orders)}
        self._last: dict[str, Array] = {}

    def degrees(self, rotations: Array) -> Array:
        """Quaternions (T, J, 4) → angles (T, J, 3) about X, Y and Z, degrees."""
        result = np.empty((*rotations.shape[:2], 3))
        for order, own in self._columns.items():
            angles = continuous_euler(quat_to_euler(np.asarray(rotations[:, own], float), order), self._last.get(order))
            self._last[order] = angles[-1]
            result[:, own] = np.degrees(sort_axes(angles, order))
        return result


class FrameRecorder:
    """Takes frames as they come, and writes them as curves at the end; they wait in a temporary file.

    Args:
        widths: numbers of each channel in a frame.
        fps: frames per second.
        folder: for the temporary file.
    """

    def __init__(self, widths: Sequence[int], fps: float, folder: Path) -> None:
        self.fps = fps
        self._buffer = FrameBuffer(widths, folder)

    def add(self, rows: Array) -> None:
        """Append frames (T, sum of the widths), in the units of the file."""
        self._buffer.add(rows)

    @property
    def end(self) -> int:
        """Ticks from the first frame to the last."""
        return round((self._buffer.frames - 1) * TICKS / self.fps)

    def write_curves(self, nodes: NodeWriter, scene: SceneWriter, name: str, channels: Sequence[DrivenProperty]) -> None:
        """Write all that was added.

        Args:
            nodes: to write to, inside of the node ``Objects``.
            scene: the objects.
            name: of the animation.
            channels: in the order of the numbers of `add`.
        """
        stack, layer = scene.number("AnimationStack"), scene.number("AnimationLayer")
        with nodes.node("AnimationStack", Long(stack), f"{name}\0\1AnimStack", ""):
            nodes.properties(
                *((f"{what}{edge}", "KTime", "Time", "", Long(ticks))
                  for what in ("Local", "Reference") for edge, ticks in (("Start", 0), ("Stop", self.end)))
            )  # fmt: skip
        with nodes.node("AnimationLayer", Long(layer), f"{name}\0\1AnimLayer", ""):
            pass
        scene.connect(layer, stack)
        times = np.round(np.arange(self._buffer.frames) * (TICKS / self.fps)).astype(np.int64)
        for track, channel in enumerate(channels):
            node = scene.number("AnimationCurveNode")
            with nodes.node("AnimationCurveNode", Long(node), f"{channel.node}\0\1AnimCurveNode", ""):
                nodes.properties(
                    *((f"d|{part}", "Number", "", "A", value) for part, value in zip(channel.parts, channel.still, strict=True))
                )
            scene.connect(node, layer)
            scene.connect(node, channel.number, channel.name)
            values = np.concatenate(list(self._buffer.blocks(track)))
            for part, keys in zip(channel.parts, values.T, strict=True):
                self._write_curve(nodes, scene, node, part, times, keys)

    def _write_curve(self, nodes: NodeWriter, scene: SceneWriter, parent: int, part: str, times: Array, keys: Array) -> None:
        count = len(keys) if len(keys) and (keys != keys[0]).any() else 1
        number = scene.number("AnimationCurve")
        with nodes.node("AnimationCurve", Long(number), "\0\1AnimCurve", ""):
            nodes.leaf("Default", float(keys[0]))
            nodes.leaf("KeyVer", _KEY_VERSION)
            nodes.leaf("KeyTime", times[:count])
            nodes.leaf("KeyValueFloat", np.ascontiguousarray(keys[:count], np.float32))
            nodes.leaf("KeyAttrFlags", np.array([_LINEAR], np.int32))
            nodes.leaf("KeyAttrDataFloat", np.zeros(4, np.float32))
            nodes.leaf("KeyAttrRefCount", np.array([count], np.int32))
        scene.connect(number, parent, f"d|{part}")

    def close(self) -> None:
        """Remove the temporary file."""
        self._buffer.close()
