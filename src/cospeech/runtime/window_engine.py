"""Runs a network that makes a whole window of poses at once, for several takes of one speech; NumPy and onnxruntime."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from ..errors import InputError
from ..motion.rotations import Array
from .graph_check import check_onnx
from .onnx_session import open_session, run_session

__all__ = ["STYLE_FRAMES", "WindowEngine", "WindowSizes", "check_weights"]

LIMIT = 1e3  # ours: standardised speech, style weights and noise are far smaller; absurd values stay out of the network
LARGEST = 1e6  # ours: no weight of a trained network comes near
STYLE_FRAMES = 64  # frames of an example of a style at least: six halvings by Mix-StAGE's encoder leave one


@dataclass(frozen=True)
class WindowSizes:
    """What a network takes and gives."""

    pose: int
    """D, numbers of a pose."""
    audio: int
    """A, numbers of a frame of speech."""
    styles: int
    """Numbers of a style: speakers' weights, or a code; 0: there is none."""
    modes: int
    """Sub-generators whose logits can be shifted by noise; 0: there are none."""
    window: int
    """Frames of a window in training."""
    multiple: int
    """What a number of frames has to be a multiple of."""
    reach: int | None
    """Frames to either side of a frame beyond which speech does not matter to it; None: all of a window matters, for the
    network normalises over its frames."""

    def __post_init__(self) -> None:
        for field in fields(self):
            value, (low, high) = getattr(self, field.name), _RANGES[field.name]
            if field.name == "reach" and value is None:
                continue
            if type(value) is not int or not low <= value <= high:
                raise InputError(f"{field.name} = {str(value)[:60]} of a window network", f"a whole number, {low} … {high}")

    @property
    def probe(self) -> int:
        """Frames that can be made: the window, filled up to the multiple."""
        return -(-self.window // self.multiple) * self.multiple


_RANGES = {
    "pose": (1, 2000), "audio": (1, 4000), "styles": (0, 1024), "modes": (0, 256), "window": (1, 4096), "multiple": (1, 1024),
    "reach": (0, 1 << 16),
}  # fmt: skip
"""Sane sizes (ours): a bundle beyond is damaged or hostile."""


class WindowEngine:
    """A network ready to run; any number of performances may share it.

    Poses and audio are standardised vectors, as the network was trained on.

    Args:
        sizes: of the network.
        weights: of its graphs, float32.
        graphs: ``make``, and ``style`` where it recognises styles (`cospeech.training.export.window_graph`).
        low, high: (D,) bounds of every pose that is made.
        optional: inputs of ``make`` that may be left out, the same for all takes → numbers per frame.

    Raises:
        InputError: these do not fit together.
    """

    def __init__(
        self, sizes: WindowSizes, weights: Mapping[str, Array], graphs: Mapping[str, bytes], low: Array, high: Array,
        optional: Mapping[str, int] | None = None,
    ) -> None:  # fmt: skip
        self.sizes, self.weights, self.optional = sizes, weights, dict(optional or {})
        self.low, self.high = (np.ascontiguousarray(v, np.float32) for v in (low, high))
        if not self.low.shape == self.high.shape == (sizes.pose,) or not (self.low < self.high).all():
            raise InputError(f"bounds of poses of shapes {low.shape}, {high.shape}", f"({sizes.pose},), the lower ones lower")
        if not {"make"} <= set(graphs) <= {"make", "style"} or ("style" in graphs and not sizes.styles):
            raise InputError(f"graphs {', '.join(sorted(graphs))[:60]!r}", "make, and style where there are styles")
        check_weights(weights)
        if set(weights) != (used := {name for graph in graphs.values() for name in check_onnx(graph)}):
            raise InputError(f"weights that no graph has: {sorted(set(weights) ^ used)[0]!r}"[:200], "is the bundle damaged?")
        self._make = open_session(graphs["make"], weights)
        self._style = open_session(graphs["style"], weights) if "style" in graphs else None
        self._check_ends()
        frames = sizes.probe  # a graph that fails, fails here
        self.make(np.zeros((frames, sizes.audio)), *(np.zeros((2, frames, width)) for width in (sizes.styles, sizes.modes)))
        if self._style is not None:
            self.style_of(np.zeros((STYLE_FRAMES, sizes.pose)))

    def _check_ends(self) -> None:
        """Inputs and outputs have the names, types and widths that are due."""
        s = self.sizes
        wanted = {"rows": s.audio} | ({"style": s.styles} if s.styles else {}) | ({"mode_noise": s.modes} if s.modes else {})
        wanted |= self.optional
        ends = [(self._make.get_inputs(), 3, wanted), (self._make.get_outputs(), 3, {"poses": s.pose})]
        if self._style is not None:
            ends += [(self._style.get_inputs(), 3, {"poses": s.pose}), (self._style.get_outputs(), 2, {"style": s.styles})]
        for found, rank, due in ends:
            for end in found:
                if len(end.shape) != rank or end.type != "tensor(float)" or end.shape[-1] != due.get(end.name):
                    raise InputError(f"a graph with {end.name!r} of {end.type} {end.shape}"[:200], "is the bundle damaged?")
            if len(found) != len(due):
                raise InputError(f"a graph with {len(found)} ends, {len(due)} are due", "is the bundle damaged?")

    @property
    def recognises(self) -> bool:
        """Whether it has a style encoder."""
        return self._style is not None

    def make(self, rows: Array, style: Array, mode_noise: Array, *, more: Mapping[str, Array] | None = None) -> Array:
        """Poses of N takes of one speech.

        Args:
            rows: (F, A), F a multiple of ``sizes.multiple``.
            style: (N, F, styles).
            mode_noise: (N, F, modes), added to the logits of the modes.
            more: of ``optional``, (F, width); zeros where not given.

        Returns:
            (N, F, D) float32, within the bounds; numbers for whatever finite numbers go in.

        Raises:
            InputError: other shapes.
        """
        s, takes, frames = self.sizes, len(style), len(rows)
        wanted = [(frames, s.audio), (takes, frames, s.styles), (takes, frames, s.modes)]
        if [np.shape(x) for x in (rows, style, mode_noise)] != wanted or not takes or not frames or frames % s.multiple:
            problem = f"speech {np.shape(rows)}, styles {np.shape(style)}, mode noise {np.shape(mode_noise)}"
            raise InputError(problem, f"(F, {s.audio}), (N, F, {s.styles}), (N, F, {s.modes}), F a multiple of {s.multiple}")
        feed = {"rows": _sane(rows)[None]}
        feed |= {"style": _sane(style)} if s.styles else {}
        feed |= {"mode_noise": _sane(mode_noise)} if s.modes else {}
        feed |= self._more(more or {}, frames)
        (made,) = run_session(self._make, feed)
        if made.shape != (takes if s.styles or s.modes else 1, frames, s.pose):
            raise InputError(f"a graph makes poses of shape {made.shape}", "is the bundle damaged?")
        return np.array(np.broadcast_to(_clip_poses(made, self.low, self.high), (takes, frames, s.pose)))

    def _more(self, more: Mapping[str, Array], frames: int) -> dict[str, Array]:
        """All of ``optional``, zeros for what is not given.

        Raises:
            InputError: others are given, or of other shapes.
        """
        made = {name: more.get(name, np.zeros((frames, width))) for name, width in self.optional.items()}
        if not set(more) <= set(made) or any(np.shape(x) != (frames, self.optional[name]) for name, x in made.items()):
            raise InputError(f"{[(name, np.shape(x)) for name, x in more.items()]}"[:200], f"{frames} × {self.optional}")
        return {name: _sane(x)[None] for name, x in made.items()}

    def style_of(self, poses: Array) -> Array | None:
        """(F, D) poses, 64 at least → (styles,), how they move; None without a style encoder.

        Raises:
            InputError: another shape.
        """
        if self._style is None:
            return None
        if np.ndim(poses) != 2 or len(poses) < STYLE_FRAMES or np.shape(poses)[1] != self.sizes.pose:
            raise InputError(f"an example of shape {np.shape(poses)}", f"at least {STYLE_FRAMES} × {self.sizes.pose}")
        (style,) = run_session(self._style, {"poses": _sane(poses)[None]})
        if style.shape != (1, self.sizes.styles):
            raise InputError(f"a graph makes a style of shape {style.shape}", "is the bundle damaged?")
        return _clip_poses(style[0], -LIMIT, LIMIT)


def check_weights(weights: Mapping[str, Array]) -> None:
    """Types and values.

    Raises:
        InputError: some are not float32, not finite or absurd.
    """
    for name, value in weights.items():
        if value.dtype != np.float32:
            raise InputError(f"weights {name[:60]!r} of {value.dtype}", "float32")
        if not np.abs(value).max(initial=0) <= LARGEST:  # not a number fails this too
            raise InputError(f"weights {name[:60]!r} hold numbers that are not finite or absurd", "did the training diverge?")


def _sane(values: Array) -> Array:
    return np.ascontiguousarray(np.clip(values, -LIMIT, LIMIT), np.float32)


def _clip_poses(values: Array, low: Any, high: Any) -> Array:
    """What a hostile network makes too: infinities at the bounds, what is no number at 0."""
    bounded: Array = np.clip(np.nan_to_num(values, posinf=np.inf, neginf=-np.inf), low, high)
    return bounded
