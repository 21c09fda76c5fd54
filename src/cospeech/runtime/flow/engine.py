"""Steps a flow frame by frame for a batch of takes, and runs it backwards over an example; NumPy and onnxruntime."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ...errors import InputError
from ...motion.rotations import Array
from ..network import explain_failure, open_session, run_session
from .weights import SCALE_FLOOR, FlowSizes, check_weights, state_kinds, unpack

__all__ = ["FlowEngine", "StudentT", "Takes"]

BLOCK = 64  # ours: frames whose speech is worked off at once, which bounds the memory


class StudentT:
    """Latents of one take: N(0, 1) / √(χ²_ν / ν), one χ² per frame; normal where ν is 0.

    The same seed gives the same latents, in whatever pieces they are drawn.

    Args:
        width: D.
        nu: ν.
        seed: of the take.
        temperature: their scale.
    """

    def __init__(self, width: int, nu: float, *, seed: int, temperature: float = 1.0) -> None:
        self._normal, self._chi = (np.random.default_rng(s) for s in np.random.SeedSequence(seed).spawn(2))
        self._width, self._nu, self._temperature = width, nu, temperature

    def draw(self, frames: int) -> Array:
        """(frames, D) float32."""
        z = self._normal.standard_normal((frames, self._width))
        if self._nu:
            z /= np.sqrt(self._chi.chisquare(self._nu, frames) / self._nu)[:, None]
        return (self._temperature * z).astype(np.float32)


class FlowEngine:
    """A flow ready to run; any number of sessions may share it.

    Poses and audio are standardised vectors, as the network was trained on.

    Args:
        sizes: of the network.
        weights: of `cospeech.runtime.flow.weights.pack_weights`.
        graphs: of `cospeech.runtime.flow.graph.build_graphs`.
        low, high: (D,) bounds of every pose that is made: those of the training data and some more. What is fed back can
            therefore not run away.

    Raises:
        InputError: these do not fit together.
    """

    def __init__(
        self, sizes: FlowSizes, weights: Mapping[str, Array], graphs: Mapping[str, bytes], low: Array, high: Array
    ) -> None:
        check_weights(weights, sizes)
        self.sizes, self.weights = sizes, weights
        self.low, self.high = (np.ascontiguousarray(np.reshape(v, (1, -1)), np.float32) for v in (low, high))
        if not self.low.shape == self.high.shape == (1, sizes.pose) or not (self.low < self.high).all():
            raise InputError(
                f"the bounds of poses have the shapes {low.shape}, {high.shape}, or a lower one is not below its upper one",
                f"both ({sizes.pose},)",
            )
        missing = {"speech", "past", "frame", *(("style",) if sizes.style else ())} - set(graphs)
        if missing:
            raise InputError(f"the graph {', '.join(sorted(missing))} is missing", "is the bundle damaged?")
        self._graphs = graphs
        self.speech, self.frame = (open_session(graphs[name], weights) for name in ("speech", "frame"))
        self._check_ends()
        z = np.zeros((2, 1, sizes.pose), np.float32)  # a graph that fails, fails here
        self.begin(np.zeros((2, sizes.history, sizes.pose), np.float32)).frames(
            self.windows(np.zeros((sizes.speech_frames, sizes.audio))), z
        )

    def _check_ends(self) -> None:
        """Inputs and outputs have the names and sizes that `Takes` binds memory to."""
        s, width = self.sizes, self.sizes.steps * self.sizes.gates
        inputs = {"z": s.pose, "history": s.history * s.pose, "gates": width, "low": s.pose, "high": s.pose}
        inputs |= dict.fromkeys(state_kinds(s), s.states) | ({"code": s.channels} if s.feature else {})
        inputs |= {"style": s.style} if s.style else {}
        outputs = {"pose": s.pose} | {f"next_{kind}": s.states for kind in state_kinds(s)}
        speech_outputs = {"gates": width} | ({"code": s.channels} if s.feature else {})
        ends = [
            (self.frame.get_inputs(), inputs), (self.frame.get_outputs(), outputs),
            (self.speech.get_inputs(), {"windows": s.speech_frames * s.audio}), (self.speech.get_outputs(), speech_outputs),
        ]  # fmt: skip
        for group, due in ends:
            for end in group:
                kind = "tensor(uint8)" if end.name in ("q", "next_q") else "tensor(float)"
                if len(end.shape) != 2 or end.type != kind or end.shape[1] != due.get(end.name):
                    raise InputError(
                        f"{end.name!r} of a graph is {end.type} of shape {end.shape}"[:200], "is the bundle damaged?"
                    )
            if len(group) != len(due):
                raise InputError(f"a graph has {len(group)} inputs or outputs, expected {len(due)}", "is the bundle damaged?")

    def begin(self, histories: Array, styles: Array | None = None) -> Takes:
        """A batch of takes that begin with these poses.

        Args:
            histories: (N, τ, D), oldest first.
            styles: (N, style) codes, for a network that has them; zeros where not given.
        """
        return Takes(self, np.asarray(histories, np.float32), self._styles(styles, len(histories)))

    def _styles(self, styles: Array | None, rows: int) -> Array:
        shape = (rows, self.sizes.style)
        styles = np.zeros(shape, np.float32) if styles is None else np.array(styles, np.float32, ndmin=2)
        if styles.shape != shape:
            raise InputError(f"style codes have the shape {styles.shape}", f"expected {shape}")
        return styles

    def style_code(self, poses: Array) -> Array:
        """(S, D) any stretch of poses from 8 frames on → (style,) its code.

        Raises:
            InputError: the network has no style codes, or the poses have another shape.
        """
        if not self.sizes.style:
            raise InputError("this model has no style codes", "take one that was trained with model.style")
        if np.ndim(poses) != 2 or len(poses) < 8 or np.shape(poses)[1] != self.sizes.pose:
            raise InputError(f"an example of style has the shape {np.shape(poses)}", f"expected (8 or more, {self.sizes.pose})")
        session = open_session(self._graphs["style"], self.weights)
        return run_session(session, {"poses": np.ascontiguousarray(poses, np.float32)[None]})[0][0]

    def windows(self, audio: Array) -> Array:
        """(T, A) rows of speech → (T − heard + 1, heard, A): a window for each frame that has one whole; a view."""
        audio = np.asarray(audio, np.float32)
        length = self.sizes.speech_frames
        if len(audio) < length:
            return np.zeros((0, length, self.sizes.audio), np.float32)
        return np.lib.stride_tricks.sliding_window_view(audio, length, axis=0).transpose(0, 2, 1)

    def hear(self, windows: Array) -> list[Array]:
        """The share of the speech in the frames' gates, and the encoder's code: (F, heard, A) → (F, K·G)[, (F, channels)]."""
        flat = np.ascontiguousarray(windows, np.float32).reshape(len(windows), self.sizes.speech_frames * self.sizes.audio)
        return run_session(self.speech, {"windows": flat})

    def latents(self, poses: Array, audio: Array, style: Array | None = None) -> Array:
        """The z that give these poses after these histories under this speech: the flow's normalising direction.

        Args:
            poses: (T, D).
            audio: (T, A).
            style: (style,) code, for a network that has them; zeros where not given.

        Returns:
            (T − τ − look-ahead, D): of frame τ and those after it.

        Raises:
            InputError: shapes, or fewer frames than one window.
        """
        s = self.sizes
        poses, windows = np.asarray(poses, np.float32), self.windows(audio)
        if poses.shape != (len(audio), s.pose) or np.shape(audio)[1] != s.audio or not len(windows):
            shapes = f"(T, {s.pose}) and (T, {s.audio}), at least {s.speech_frames} of each"
            raise InputError(f"poses have the shape {poses.shape} and audio {np.shape(audio)}", f"expected {shapes}")
        frames = len(windows)
        histories = np.lib.stride_tricks.sliding_window_view(poses[: s.history + frames - 1], s.history, axis=0)
        histories = np.ascontiguousarray(histories.transpose(0, 2, 1)).reshape(frames, -1)
        session = open_session(self._graphs["past"], self.weights)
        codes = {"style": np.repeat(self._styles(style, 1), frames, 0)} if s.style else {}
        past = np.empty((frames, s.steps * s.gates), np.float32)
        for first in range(0, frames, BLOCK):
            rows = slice(first, first + BLOCK)
            inputs = dict(zip(("gates", "code"), self.hear(windows[rows]), strict=False))
            inputs |= {name: code[rows] for name, code in codes.items()}
            (past[rows],) = run_session(session, {"history": histories[rows]} | inputs)
        x = poses[s.history : s.history + frames] / np.float32(s.feedback_gain)
        if s.residual:
            last = poses[s.history - 1 : s.history + frames - 1]
            x = x - last
            if s.inertia:
                x = x - np.float32(s.inertia) * (last - poses[s.history - 2 : s.history + frames - 2])
        for k in range(s.steps):
            x = self._normalise(k, x, past[:, k * s.gates : (k + 1) * s.gates])
        return x

    def _normalise(self, k: int, x: Array, past: Array) -> Array:
        """One step of the flow backwards, for all frames."""
        s, w = self.sizes, self.weights
        second_half = s.pose - s.first_half
        x = np.linalg.solve(w[f"{k}.mix"].T.astype(np.float64), (x - w[f"{k}.mix.bias"]).T).T.astype(np.float32)
        hidden = x[:, : s.first_half] @ w[f"{k}.kept"] + past
        for layer in range(s.layers):
            if layer:
                hidden = self._quantise_states(hidden) @ unpack(w, f"{k}.{layer}.ih") + w[f"{k}.{layer}.ih.bias"]
            hidden = self._cells(hidden, unpack(w, f"{k}.{layer}.hh"), w[f"{k}.{layer}.hh.bias"])
        out = hidden @ w[f"{k}.out"] + w[f"{k}.out.bias"]
        scale = _sigmoid(out[:, second_half:]) + np.float32(SCALE_FLOOR)
        return np.concatenate([x[:, : s.first_half], (x[:, s.first_half :] + out[:, :second_half]) * scale], 1)

    def _quantise_states(self, hidden: Array) -> Array:
        """Hidden states as the products of the graphs see them."""
        return np.round(hidden * 127) / np.float32(127) if self.sizes.int8 else hidden

    def _cells(self, gates: Array, weight: Array, bias: Array) -> Array:
        """(T, G) inputs' share of the gates → (T, hidden)."""
        size = self.sizes.hidden
        out, h, cell = np.empty((len(gates), size), np.float32), np.zeros(size, np.float32), np.zeros(size, np.float32)
        for t, x in enumerate(gates):
            product = self._quantise_states(h) @ weight + bias
            if self.sizes.cell == "gru":
                both = _sigmoid(x[: 2 * size] + product[: 2 * size])
                new = np.tanh(x[2 * size :] + both[:size] * product[2 * size :])
                h = new + both[size:] * (h - new)
            else:
                take, keep, show = np.split(_sigmoid((x + product)[: 3 * size]), 3)
                cell = keep * cell + take * np.tanh((x + product)[3 * size :])
                h = show * np.tanh(cell)
            out[t] = h
        return out


def _silence(kind: str, shape: tuple[int, int]) -> Array:
    """States before the first frame: zeros, which as bytes are 128."""
    return np.full(shape, 128, np.uint8) if kind == "q" else np.zeros(shape, np.float32)


def _sigmoid(x: Array) -> Array:
    with np.errstate(over="ignore"):
        return 1 / (1 + np.exp(-x))  # type: ignore[no-any-return]


class Takes:
    """N takes of one speech under way, in one pass; none depends on the others.

    Memory is bound once; states go to and fro between two halves of it. ``history`` (N, τ·D) are the poses made last and
    ``styles`` (N, style) the codes; what is written into them conditions the next frame.
    """

    def __init__(self, engine: FlowEngine, histories: Array, styles: Array) -> None:
        s = engine.sizes
        if histories.ndim != 3 or histories.shape[1:] != (s.history, s.pose) or not len(histories):
            raise InputError(f"histories have the shape {histories.shape}", f"expected (takes, {s.history}, {s.pose})")
        self._engine, self.styles, takes = engine, styles, len(histories)
        self.history: Array = np.clip(histories, engine.low, engine.high).reshape(takes, -1)
        self._z, self._pose = np.zeros((takes, s.pose), np.float32), np.zeros((takes, s.pose), np.float32)
        self._speech_buffers = [np.zeros((1, s.steps * s.gates), np.float32)]
        self._speech_buffers += [np.zeros((1, s.channels), np.float32)] if s.feature else []
        kinds = state_kinds(s)
        states = [{kind: _silence(kind, (takes, s.states)) for kind in kinds} for _ in range(2)]
        self._bindings = [self._bind(*pair) for pair in (states, states[::-1])]

    def _bind(self, before: dict[str, Array], after: dict[str, Array]) -> tuple[Any, object]:
        """Inputs and outputs of a frame; the memory is kept beside, for onnxruntime knows only addresses."""
        binding, engine = self._engine.frame.io_binding(), self._engine
        inputs = {"z": self._z, "history": self.history, "low": engine.low, "high": engine.high}
        inputs |= dict(zip(("gates", "code"), self._speech_buffers, strict=False)) | before
        inputs |= {"style": self.styles} if engine.sizes.style else {}
        for name, array in inputs.items():
            binding.bind_input(name, "cpu", 0, array.dtype, array.shape, array.ctypes.data)
        for name, array in {"pose": self._pose, **{f"next_{kind}": array for kind, array in after.items()}}.items():
            binding.bind_output(name, "cpu", 0, array.dtype, array.shape, array.ctypes.data)
        return binding, (inputs, after)

    def frames(self, windows: Array, z: Array) -> Array:
        """The next poses of every take.

        Args:
            windows: (F, heard, A) of speech, one per frame; see `FlowEngine.windows`.
            z: (N, F, D) latents.

        Returns:
            (N, F, D).
        """
        width, run, feedback_gain = (
            self._engine.sizes.pose,
            self._engine.frame.run_with_iobinding,
            np.float32(self._engine.sizes.feedback_gain),
        )
        out = np.empty((len(self._pose), len(windows), width), np.float32)
        if np.shape(z) != out.shape:
            raise InputError(f"latents have the shape {np.shape(z)}", f"expected {out.shape}")
        for first in range(0, len(windows), BLOCK):
            speech = self._engine.hear(windows[first : first + BLOCK])
            for t in range(len(speech[0])):
                self._z[:] = z[:, first + t]
                for buffer, rows in zip(self._speech_buffers, speech, strict=True):
                    buffer[0] = rows[t]
                try:
                    run(self._bindings[0][0])
                except Exception as error:  # classes of onnxruntime's own
                    raise explain_failure() from error
                self._bindings.reverse()
                if feedback_gain != 1:
                    self._pose *= feedback_gain
                out[:, first + t] = self._pose
                self.history[:, :-width] = self.history[:, width:]
                self.history[:, -width:] = self._pose
        return out
