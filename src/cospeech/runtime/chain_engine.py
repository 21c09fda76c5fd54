"""Runs a Chain of Generation for several takes of one speech: in windows, frame by frame; and what a voice says of itself."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any

import numpy as np

from ..audio.emotions import EMOTIONS
from ..errors import InputError
from ..motion.rotations import Array
from ..motion.skeletons.arkit import ARKIT
from .graph_check import check_onnx
from .onnx_session import open_session, run_session
from .window_engine import LIMIT, WindowEngine, WindowSizes, check_weights

__all__ = ["ChainEngine", "ChainSizes", "Live"]

_RANGES = {
    "pose": (1, 2000), "audio": (1, 4000), "words": (0, 1024), "speakers": (1, 256), "noise": (0, 256), "window": (1, 4096),
    "reach": (0, 64), "look_ahead": (0, 64), "faces": (0, len(ARKIT)), "seeds": (0, 64),
}  # fmt: skip
"""Sane sizes (ours): a bundle beyond is damaged or hostile."""
GRAPHS = {"make", "classify", "live"}


@dataclass(frozen=True)
class ChainSizes:
    """What a chain takes and gives."""

    pose: int
    """D, numbers of a pose."""
    audio: int
    """A, numbers of a frame of speech."""
    words: int
    """W, numbers of a word; 0: it reads none."""
    speakers: int
    """S."""
    noise: int
    """Z, numbers of smooth noise at every frame; 0: takes are alike."""
    window: int
    """Frames of a window in training."""
    reach: int
    """Frames to either side that the classifier hears."""
    look_ahead: int
    """Frames of speech after a pose's own that the network of frames waits for; 0 where there is none."""
    faces: int = 0
    """Numbers of a face that may be given to the network of windows; 0: none is."""
    seeds: int = 0
    """Frames of seed poses that may be given to it; 0: none are."""

    def __post_init__(self) -> None:
        for field in fields(self):
            value, (low, high) = getattr(self, field.name), _RANGES[field.name]
            if type(value) is not int or not low <= value <= high:
                raise InputError(f"{field.name} = {str(value)[:60]} of a chain", f"a whole number, {low} … {high}")

    @property
    def rows(self) -> int:
        """A + W, numbers of a row: speech, then the word."""
        return self.audio + self.words

    @property
    def style(self) -> int:
        """S + 8, weights of the speakers, then of the emotions."""
        return self.speakers + len(EMOTIONS)

    @cached_property
    def windows(self) -> WindowSizes:
        """As of any network of windows."""
        return WindowSizes(
            pose=self.pose, audio=self.rows, styles=self.style, modes=self.noise, window=self.window, multiple=1, reach=None
        )  # fmt: skip

    @property
    def optional(self) -> dict[str, int]:
        """Inputs of the network of windows that may be left out → numbers per frame, the last of them how far it is given."""
        widths = {"face": self.faces and self.faces + 1, "seed": self.seeds and self.pose + 1}
        return {name: width for name, width in widths.items() if width}


class ChainEngine:
    """A chain ready to run; any number of performances may share it.

    Args:
        sizes: of the networks.
        weights: of their graphs, float32.
        graphs: ``make``; ``classify`` where it has a classifier, ``live`` where it can be played frame by frame
            (`cospeech.training.export.chain_graph`).
        low, high: (D,) bounds of every pose that is made.

    Raises:
        InputError: these do not fit together.
    """

    def __init__(
        self, sizes: ChainSizes, weights: Mapping[str, Array], graphs: Mapping[str, bytes], low: Array, high: Array
    ) -> None:
        if not {"make"} <= set(graphs) <= GRAPHS or ("live" in graphs) != (sizes.look_ahead > 0):
            raise InputError(f"graphs {', '.join(sorted(graphs))[:60]!r}", "make, perhaps classify, live where it looks ahead")
        check_weights(weights)
        wanted = {name: {*check_onnx(graph)} for name, graph in graphs.items()}
        if set(weights) != (used := set().union(*wanted.values())):
            raise InputError(f"weights that no graph has: {sorted(set(weights) ^ used)[0]!r}"[:200], "is the bundle damaged?")
        own = {name: {key: weights[key] for key in keys} for name, keys in wanted.items()}
        self.sizes, self.weights = sizes, weights
        self.windows = WindowEngine(sizes.windows, own["make"], {"make": graphs["make"]}, low, high, sizes.optional)
        self._classify = open_session(graphs["classify"], own["classify"]) if "classify" in graphs else None
        self._live = open_session(graphs["live"], own["live"]) if "live" in graphs else None
        self._states = self._check_states()
        if self._classify is not None:
            self.classify(np.zeros((2 * sizes.reach + 1, sizes.audio)))  # a graph that fails, fails here
        if self._live is not None:
            self.live(2).frame(np.zeros(sizes.rows), np.zeros((2, sizes.style)), np.zeros((2, sizes.noise)))

    def _check_states(self) -> dict[str, tuple[bool, int]]:
        """State of the network of frames → whether each take has its own, and its width; inputs and outputs of graphs are
        looked at."""
        s = self.sizes
        ends: list[tuple[Any, dict[str, int]]] = []
        if self._classify is not None:
            ends += [(self._classify.get_inputs(), {"rows": s.audio}), (self._classify.get_outputs(), {"logits": s.style})]
        states: dict[str, tuple[bool, int]] = {}
        if self._live is not None:
            feed, made = self._live.get_inputs(), self._live.get_outputs()
            widths = {end.name: end.shape[-1] for end in feed if end.name.startswith("state")}
            after = {f"next.{name}": width for name, width in widths.items()}
            states = {end.name: (end.shape[0] != 1, end.shape[-1]) for end in feed if end.name in widths}
            taken = {"rows": s.rows, "style": s.style} | ({"mode_noise": s.noise} if s.noise else {})
            ends += [(feed, taken | widths), (made, {"poses": s.pose} | after)]
        for found, due in ends:
            for end in found:
                width = due.get(end.name)
                if end.type != "tensor(float)" or not isinstance(width, int) or end.shape[-1] != width or width > _WIDEST:
                    raise InputError(f"a graph with {end.name!r} of {end.type} {end.shape}"[:200], "is the bundle damaged?")
            if len(found) != len(due):
                raise InputError(f"a graph with {len(found)} ends, {len(due)} are due", "is the bundle damaged?")
        return states

    @property
    def classifies(self) -> bool:
        """Whether it has a classifier."""
        return self._classify is not None

    @property
    def lives(self) -> bool:
        """Whether it can be played frame by frame."""
        return self._live is not None

    def classify(self, rows: Array) -> Array:
        """What speech says of speaker and emotion, frame by frame: (n, S + 8) logits.

        Args:
            rows: (2 · reach + n, A), the frames and those around them that matter to them.
        """
        s = self.sizes
        frames = len(rows) - 2 * s.reach
        if self._classify is None or np.ndim(rows) != 2 or frames < 1 or np.shape(rows)[1] != s.audio:
            raise InputError(f"speech of shape {np.shape(rows)} to judge", f"more than {2 * s.reach} × {s.audio}, a classifier")
        (logits,) = run_session(self._classify, {"rows": _sane(rows)[None]})
        if logits.shape != (1, len(rows), s.style):
            raise InputError(f"a graph makes logits of shape {logits.shape}", "is the bundle damaged?")
        return _clip_poses(logits[0, s.reach : s.reach + frames])

    def live(self, takes: int) -> Live:
        """A performance of so many takes, frame by frame.

        Raises:
            InputError: it has no network for that.
        """
        if self._live is None:
            raise InputError("this chain cannot be played frame by frame", "its bundle has no such network")
        shapes = {name: (takes if own else 1, width) for name, (own, width) in self._states.items()}
        return Live(self, takes, {name: np.zeros(shape, np.float32) for name, shape in shapes.items()})

    def step(self, feed: Mapping[str, Array], takes: int) -> list[Array]:
        """Poses (N, D) and states after a frame, in the order of the states; see `Live.frame`."""
        assert self._live is not None
        poses, *states = run_session(self._live, feed)
        due = [(takes, self.sizes.pose), *((takes if own else 1, width) for own, width in self._states.values())]
        if [each.shape for each in (poses, *states)] != due:
            raise InputError("a graph gives other shapes than it announces", "is the bundle damaged?")
        low, high = self.windows.low, self.windows.high
        return [np.clip(np.nan_to_num(poses), low, high), *states]


@dataclass
class Live:
    """N takes under way, a frame at a time; made by `ChainEngine.live`."""

    engine: ChainEngine
    takes: int
    states: dict[str, Array]
    """Name → (N or 1, width), zeros before the first frame."""

    def frame(self, row: Array, style: Array, noise: Array) -> Array:
        """(N, D) poses of the frame that lies ``look_ahead`` before this one.

        Args:
            row: (A + W,) the frame that is heard now.
            style: (N, S + 8).
            noise: (N, Z).
        """
        s = self.engine.sizes
        wanted = [(s.rows,), (self.takes, s.style), (self.takes, s.noise)]
        if [np.shape(x) for x in (row, style, noise)] != wanted:
            raise InputError(f"a frame of shapes {[np.shape(x) for x in (row, style, noise)]}", f"{wanted}")
        feed = {"rows": _sane(row)[None], "style": _sane(style)} | ({"mode_noise": _sane(noise)} if s.noise else {})
        poses, *states = self.engine.step(feed | self.states, self.takes)
        self.states = dict(zip(self.states, states, strict=True))
        return poses


_WIDEST = 1 << 17  # ours: numbers of one state; the last 34 frames of 1,000 channels are a quarter of it


def _sane(values: Array) -> Array:
    return np.ascontiguousarray(np.clip(values, -LIMIT, LIMIT), np.float32)


def _clip_poses(values: Array) -> Array:
    """What a hostile network makes too."""
    bounded: Array = np.clip(np.nan_to_num(values, posinf=LIMIT, neginf=-LIMIT), -LIMIT, LIMIT)
    return bounded
