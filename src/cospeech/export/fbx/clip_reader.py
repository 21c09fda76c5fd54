"""Read animations of an FBX file, sampled at every frame; one at a time, because characters may have a hundred."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple, TypeAlias

import numpy as np

from ...motion.rotations import Array, quat_continuous
from ..reading import check_frames
from ..timing import frame_rate
from ..tracks import Curve
from .curve_writer import PERCENT, TICKS
from .document import Document, FbxModel, Object, rest_weight
from .time_modes import rate_of
from .tree import Node

__all__ = ["FbxClip", "list_clips", "read_clip"]

_CONSTANT, _CUBIC = 2, 8  # interpolation, among the flags of a key
_ON_KEY = 1e-4  # of the time between keys: so near to a key, its value counts; ours
_STEPS = (1e-3, 0.1)  # s between keys of a clip that has one on every frame; ours
_PLACES = ("Lcl Translation", "Lcl Rotation", "Lcl Scaling")
_PATHS = ("translation", "rotation", "scale")
_NODE, _PERCENT = "AnimationCurveNode", "DeformPercent"
_Curves: TypeAlias = "dict[tuple[int, str], dict[str, KeyedCurve | float]]"


class FbxClip(NamedTuple):
    """An animation: its name, and the object that has its curves."""

    name: str
    layer: Object


def list_clips(fbx: Document) -> list[FbxClip]:
    """The animations that move something."""
    clips, moving = [], dict[int, bool]()  # stacks may share a layer
    for stack in fbx.of_kind("AnimationStack"):
        layers = [layer for layer, _ in fbx.below(stack.number, "AnimationLayer")]
        if layers and layers[0].number not in moving:
            nodes = (node for node, _ in fbx.below(layers[0].number, _NODE) if _find_targets(fbx, node))
            moving[layers[0].number] = any(True for node in nodes for _ in fbx.below(node.number, "AnimationCurve"))
        if layers and moving[layers[0].number]:
            clips.append(FbxClip(stack.name, layers[0]))  # further layers only add to the first
    return clips


def read_clip(
    fbx: Document, clip: FbxClip, models: Sequence[FbxModel], targets: Mapping[int, Sequence[int]]
) -> dict[tuple[int, str], Curve]:
    """An animation, sampled at every frame.

    Args:
        fbx: the file.
        clip: which animation.
        models: node by node.
        targets: node → numbers of the blendshape channels of its mesh.

    Returns:
        (node, path) → curve, as `cospeech.export.tracks.read_animation`.

    Raises:
        InputError: it is too long.
    """
    curves = _read_curves(fbx, clip.layer)
    every = [curve for own in curves.values() for curve in own.values() if isinstance(curve, KeyedCurve)]
    fps = _frame_rate(fbx, max(every, key=lambda curve: len(curve.times)).times)
    begin, end = min(curve.times[0] for curve in every), max(curve.times[-1] for curve in every)
    frames = int(np.floor((end - begin) * fps + 1e-3)) + 1
    joints = len(models) + sum(len(channels) for channels in targets.values())
    check_frames(fbx.name, frames, joints, sum(curve.size for curve in every))
    times = begin + np.arange(frames) / fps
    tracks: dict[tuple[int, str], Curve] = {}
    for node, model in enumerate(models):
        own = [curves.get((model.object.number, name), {}) for name in _PLACES]
        if any(own):
            place = model.place(*(_sample(parts, still, times) for parts, still in zip(own, model.still, strict=True)))
            for path, values in zip(_PATHS, (place.translation, quat_continuous(place.rotation), place.scale), strict=True):
                tracks[node, path] = Curve(times - begin, values, "LINEAR", path == "rotation")
        shapes = [curves.get((number, _PERCENT), {}).get(_PERCENT) for number in targets.get(node, ())]
        if any(isinstance(curve, KeyedCurve) for curve in shapes):
            still = [rest_weight(fbx, fbx.objects[number]) for number in targets[node]]
            columns = [
                curve.at(times) / PERCENT if isinstance(curve, KeyedCurve) else np.full(len(times), rest)
                for curve, rest in zip(shapes, still, strict=True)
            ]
            weights = np.stack(columns, 1)
            tracks[node, "weights"] = Curve(times - begin, weights, "LINEAR", False)
    return tracks


def _sample(curves: Mapping[str, KeyedCurve | float], still: Array, times: Array) -> Array:
    """(T, 3) values of the curves of X, Y and Z; ``still`` for those without a curve."""
    values = np.tile(still, (len(times), 1))
    for k, part in enumerate("XYZ"):
        curve = curves.get(part, still[k])
        values[:, k] = curve.at(times) if isinstance(curve, KeyedCurve) else curve
    return values


class KeyedCurve:
    """One number over time.

    Args:
        node: the node with the keys.
    """

    def __init__(self, node: Node) -> None:
        ticks, self.values = node.array("KeyTime"), node.array("KeyValueFloat").astype(float)
        if not len(ticks) or len(ticks) != len(self.values) or (np.diff(ticks) < 0).any() or not np.isfinite(self.values).all():
            raise ValueError(f"a curve with {len(ticks)} times and {len(self.values)} values")
        self.times, self.size = ticks / TICKS, 12 * len(ticks)
        self._holds = self._bends = np.zeros(0, bool)
        if len(ticks) == 1:
            return
        flags, counts = (node.array(name).astype(np.int64) for name in ("KeyAttrFlags", "KeyAttrRefCount"))
        spread = (
            np.repeat(flags, counts) if len(flags) == len(counts) and counts.sum() == len(ticks) else np.zeros(len(ticks), int)
        )
        self._holds, self._bends = (spread & _CONSTANT) > 0, (spread & _CUBIC) > 0

    def at(self, times: Array) -> Array:
        """Its value at ``times``, s; constant before the first and after the last key.

        Where the way between two keys is cubic, the slope at a key is that of the line through its neighbours.
        """
        values = np.interp(times, self.times, self.values)
        if not (self._holds.any() or self._bends.any()) or (np.diff(self.times) <= 0).any():
            return values
        low = np.clip(np.searchsorted(self.times, times + 1e-7, side="right") - 1, 0, len(self.times) - 2)
        span = self.times[low + 1] - self.times[low]
        t = np.clip((times - self.times[low]) / span, 0, 1)
        a, b = self.values[low], self.values[low + 1]
        if (np.minimum(t, 1 - t) < _ON_KEY).all():  # a key on every frame: nothing lies in between
            return np.where(t < 0.5, a, b)
        slopes = np.gradient(self.values, self.times)
        out, into = slopes[low] * span, slopes[low + 1] * span
        cubic = a + t * out + t**2 * (3 * (b - a) - 2 * out - into) + t**3 * (2 * (a - b) + out + into)
        values = np.where(self._bends[low], cubic, values)
        holds = self._holds[low] & (t < 1 - _ON_KEY)
        return np.where(holds, a, values)


def _find_targets(fbx: Document, node: Object) -> list[tuple[Object, str]]:
    """The models and blendshape channels that a node of curves drives, and the names of the driven properties."""
    above = (target for kind in ("Model", "Deformer") for target in fbx.above(node.number, kind))
    return [(target, name) for target, name in above if name]


def _read_curves(fbx: Document, layer: Object) -> _Curves:
    """(Number of an object, name of its property) → part of it → curve, or the default of the node where there is no curve."""
    curves: _Curves = {}
    for node, _ in fbx.below(layer.number, _NODE):
        own = {name.split("|", 1)[-1]: KeyedCurve(curve.node) for curve, name in fbx.below(node.number, "AnimationCurve")}
        if own:
            defaults = {part: node.number_of(f"d|{part}", 0) for part in "XYZ" if f"d|{part}" in node.properties}
            curves |= {(target.number, name): {**defaults, **own} for target, name in _find_targets(fbx, node)}
    return curves


def _frame_rate(fbx: Document, times: Array) -> float:
    """The rate of the longest curve's keys; the rate that the file states where they are far apart."""
    step = float(np.median(np.diff(times))) if len(times) > 1 else 0.0
    if _STEPS[0] <= step <= _STEPS[1]:
        return frame_rate(times, 30.0)
    rate = rate_of(int(fbx.settings.number_of("TimeMode", 0)), fbx.settings.number_of("CustomFrameRate", 0))
    return rate if 1 <= rate <= 1000 else 30.0
