"""Animation tracks of glTF files: write spooled frames as samplers and channels, and read them.

Keys lie on every frame with LINEAR interpolation; a track that never changes keeps one key. Times are float32, as the
format demands: after three hours they are good to half a millisecond.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..errors import InputError
from ..motion.rotations import Array, quat_continuous, quat_normalize
from .curve import Curve
from .frame_buffer import FrameBuffer
from .gltf import GltfFile, report_damage
from .gltf_build import GltfBuilder
from .reading import check_frames
from .timing import are_frames, frame_rate

__all__ = ["Curve", "GltfTrack", "Recorder", "clock_of", "read_animation"]

_KINDS = {"rotation": ("VEC4", 4), "translation": ("VEC3", 3), "scale": ("VEC3", 3)}
_BLOCK = 4096
_ROUNDING = 2.0**-24  # share by which a float32 is smaller than the time that it stands for, at most (IEEE 754)


class GltfTrack(NamedTuple):
    """The target of some columns of numbers: nodes, their property, and the number of values per frame."""

    nodes: tuple[int, ...]
    path: str
    width: int


class Recorder:
    """Takes frames of all tracks and appends them to a document as its animation.

    Args:
        tracks: in the order of the columns that `add` gets; the first one keeps all keys, so that the length is kept.
        fps: frames per second.
        folder: for the temporary file.
    """

    def __init__(self, tracks: Sequence[GltfTrack], fps: float, folder: Path) -> None:
        self.tracks, self.fps = tuple(tracks), fps
        self._spool = FrameBuffer([t.width for t in tracks], folder)
        starts = np.concatenate([[0], np.cumsum([t.width for t in tracks])])
        self._rotations = np.array([int(s) for s, t in zip(starts, tracks, strict=False) if t.path == "rotation"], int)
        self._last = np.empty((0, len(self._rotations), 4), np.float32)  # the frame before, once there is one

    def add(self, rows: Array) -> None:
        """Append frames (T, sum of widths); quaternion signs follow the frames before."""
        if not len(rows):
            return
        rows = np.array(rows, np.float32)
        columns = self._rotations[:, None] + np.arange(4)
        q = rows[:, columns]  # (T, tracks, 4)
        q = quat_continuous(np.concatenate([self._last, q]))[len(self._last) :]
        self._last = q[-1:]
        rows[:, columns] = quat_normalize(q)
        self._spool.add(rows)

    def append(self, builder: GltfBuilder, name: str) -> None:
        """Add samplers and channels as an animation called ``name``."""
        spool = self._spool
        last = np.float32((spool.frames - 1) / self.fps)
        limits = (np.zeros(1, np.float32), np.array([last]))
        clock = builder.add_blocks(lambda: _clock(spool.frames, self.fps), spool.frames, "SCALAR", "<f4", limits=limits)
        once = builder.add(np.zeros((1, 1), np.float32), "SCALAR", bounds=True)
        samplers: list[dict[str, Any]] = []
        channels: list[dict[str, Any]] = []
        for k, track in enumerate(self.tracks):
            still = k > 0 and spool.constant(k)
            kind, width = _KINDS.get(track.path, ("SCALAR", 1))
            count = (1 if still else spool.frames) * track.width // width
            values = builder.add_blocks(lambda k=k, still=still: self._values(k, still), count, kind, "<f4")  # type: ignore[misc]
            samplers.append({"input": once if still else clock, "output": values, "interpolation": "LINEAR"})
            channels += [{"sampler": k, "target": {"node": node, "path": track.path}} for node in track.nodes]
        builder.append("animations", {"name": name, "channels": channels, "samplers": samplers})

    def _values(self, track: int, still: bool) -> Iterator[bytes]:
        for block in self._spool.blocks(track):
            yield np.ascontiguousarray(block[:1] if still else block).tobytes()
            if still:
                return

    def close(self) -> None:
        """Remove the temporary file."""
        self._spool.close()


def _clock(frames: int, fps: float) -> Iterator[bytes]:
    for first in range(0, frames, _BLOCK):
        yield (np.arange(first, min(first + _BLOCK, frames)) / fps).astype("<f4").tobytes()


def read_animation(file: GltfFile, index: int = 0) -> dict[tuple[int, str], Curve]:
    """The curves of an animation: (node, path) → curve; ``weights`` have one column per morph target.

    Raises:
        InputError: there is no such animation, or it is damaged.
    """
    with report_damage(file.name):
        animations = file.list("animations")
        if not animations:
            raise InputError(f"{file.name} holds no animation", "to drive this character, use it as an avatar")
        animation = animations[index]
        if (ready := file.curves(index)) is not None:
            return ready
        curves: dict[tuple[int, str], Curve] = {}
        cache: dict[tuple[int, str], Curve] = {}
        clocks: dict[int, Array] = {}
        for channel in animation["channels"]:
            node, path = channel["target"].get("node"), channel["target"]["path"]
            if not isinstance(node, int) or path not in (*_KINDS, "weights"):
                continue
            if not 0 <= node < len(file.list("nodes")):
                raise InputError(f"{file.name} is damaged: animation of node {node}", "export it again")
            k = channel["sampler"]
            if (k, path) not in cache:
                cache[k, path] = _curve(file, animation["samplers"][k], path, clocks)
            curves[node, path] = cache[k, path]
        return curves


def _curve(file: GltfFile, sampler: dict[str, Any], path: str, clocks: dict[int, Array]) -> Curve:
    """A curve. ``clocks``: accessor → times; most curves share them."""
    clock = sampler["input"]
    if clock not in clocks:
        clocks[clock] = file.accessor(clock, 1)[:, 0].astype(np.float64)
    times, kind = clocks[clock], sampler.get("interpolation", "LINEAR")
    values = file.accessor(sampler["output"], _KINDS.get(path, ("", 1))[1])
    values = values if values.dtype == np.float32 else values.astype(np.float64)
    rows = len(times) * (3 if kind == "CUBICSPLINE" else 1)
    if not len(times) or np.any(np.diff(times) < 0) or kind not in ("LINEAR", "STEP", "CUBICSPLINE") or abs(times).max() > 1e6:
        raise InputError(f"{file.name} is damaged: an animation has {len(times)} keys, {str(kind)[:20]}", "export it again")
    if path == "weights":
        values = values.reshape(rows, -1)
    if len(values) != rows:
        raise InputError(f"{file.name} is damaged: {len(times)} keys for {len(values)} values", "export it again")
    if path == "rotation" and kind != "CUBICSPLINE" and values.dtype == np.float64:
        values = quat_normalize(values)
    return Curve(times, values, kind, path == "rotation")


def clock_of(curves: dict[tuple[int, str], Curve], file: GltfFile, joints: int) -> tuple[float, Array]:
    """Frames per second of an animation, and the times (T,) of its frames from 0 to the last key.

    The rate is that of the curve with the most keys; 30 where every curve has one key, or where keys are far apart and set by
    hand.

    Args:
        curves: of the animation.
        file: that holds them.
        joints: onto which it is read; they bound how long it may last.

    Raises:
        InputError: it moves nothing, or is too long for so many joints.
    """
    longest = max(curves.values(), key=lambda curve: len(curve.times), default=None)
    if longest is None:
        raise InputError(f"{file.name} holds an animation without channels", "export it again")
    end = max(float(curve.times[-1]) for curve in curves.values())
    step = float(np.median(np.diff(longest.times))) if len(longest.times) > 1 else 0.0
    straight = all(curve.interpolation != "CUBICSPLINE" for curve in curves.values())
    regular = 1e-3 <= step <= 0.1 or (straight and are_frames([curve.times for curve in curves.values()], longest.times, step))
    fps = frame_rate(longest.times, 30.0) if regular else 30.0  # ours: sparse hand-set keys are sampled at 30
    frames = int(np.floor(end * fps * (1 + _ROUNDING) + 1e-3)) + 1
    check_frames(file.name, frames, joints, file.size)
    return fps, np.arange(frames) / fps
