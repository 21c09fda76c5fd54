"""A flow's weights as its graphs and its engine want them: from a network's arrays, in float32 or quantised; NumPy only.

Quantised, the weights of large products are whole numbers with one scale per column, −63 … 63: with 7 bits, sums of two
products with bytes fit the 16 bits in which processors without VNNI add them, so that none of these sums is cut.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields

import numpy as np

from ...errors import InputError
from ...motion.rotations import Array

__all__ = [
    "CODE", "GATES", "LEVELS", "SCALE_FLOOR", "STEP_GAIN", "FlowSizes", "check_weights", "pack_weights", "state_kinds",
    "unpack",
]  # fmt: skip

SCALE_SHIFT, SCALE_FLOOR = 2.0, 1e-6  # cospeech.models.nn.flow
CODE, STEP_GAIN = 64, 10.0  # cospeech.models.nn.conditioning
BATCH_NORM_EPS = 1e-5  # PyTorch's default
LEVELS = 63  # 7 bits, see above
LARGEST = 1e6  # ours: no weight of a trained network comes near; with it, nothing overflows
GATES = {"gru": 3, "lstm": 4}


@dataclass(frozen=True)
class FlowSizes:
    """The sizes of a flow, which decide the shape of its graphs."""

    pose: int
    """D, numbers of a pose."""
    audio: int
    """A, numbers of a frame of speech."""
    steps: int
    """K."""
    hidden: int
    layers: int
    history: int
    """τ, poses that condition a frame."""
    speech_frames: int
    """Frames of speech that condition a frame: τ + 1 + look-ahead."""
    cell: str = "gru"
    """A key of ``GATES``."""
    nu: float = 50.0
    """Degrees of freedom of the latent; 0: a normal one."""
    feature: int = 0
    """Width of the global encoder's result; 0: there is none."""
    blocks: int = 0
    """Residual blocks of the encoder."""
    channels: int = 0
    """Of the encoders of feature and style."""
    oldest: bool = False
    """Whether the encoder takes the oldest position rather than the mean."""
    encoder_relu: bool = False
    """Whether the encoder's convolutions end in a ReLU; bundles that do not say so were trained without."""
    style: int = 0
    """Width of a style code; 0: there is none."""
    residual: bool = False
    """Whether the flow gives what is added to the last pose."""
    inertia: float = 0.0
    """With ``residual``: share of the last step that is added too."""
    steps_seen: bool = False
    """Whether the couplings see a history as its last pose and `STEP_GAIN` times the steps that led there."""
    feedback_gain: float = 1.0
    """What is made is multiplied by this before it is fed back: below 1, poses are drawn to the mean one, 0."""
    latent_scale: float = 1.0
    """Scale of random latents at temperature 1."""
    int8: bool = True

    def __post_init__(self) -> None:
        for field in fields(self):
            value, (low, high) = getattr(self, field.name), _RANGES.get(field.name, (False, True))
            kinds = (int, float) if field.name in ("nu", "inertia", "feedback_gain", "latent_scale") else (type(low),)
            if field.name == "cell":
                if not isinstance(value, str) or value not in GATES:
                    raise InputError(f"the cells of a flow are {str(value)[:60]!r}", f"one of {', '.join(GATES)}")
            elif type(value) not in kinds or not low <= value <= high:
                raise InputError(f"the sizes of a flow have {field.name} = {str(value)[:60]}", f"{low} … {high}")
        if self.inertia and self.history < 2:
            raise InputError(f"a flow with inertia has a history of {self.history} poses", "2 at least")
        if self.speech_frames <= self.history:
            raise InputError(f"a flow has speech_frames = {self.speech_frames}", f"more than its history of {self.history}")

    @property
    def gates(self) -> int:
        """G, numbers of the gates of a layer."""
        return GATES[self.cell] * self.hidden

    @property
    def states(self) -> int:
        """Numbers of all hidden states of a take."""
        return self.steps * self.layers * self.hidden

    @property
    def first_half(self) -> int:
        """Numbers of z₁."""
        return self.pose // 2


_RANGES = {
    "pose": (2, 2000), "audio": (1, 4000), "steps": (1, 64), "hidden": (1, 4096), "layers": (1, 8), "history": (1, 600),
    "speech_frames": (1, 1200), "nu": (0, 1e9), "feature": (0, 1024), "blocks": (0, 32), "channels": (0, 4096),
    "style": (0, 1024), "inertia": (0, 1), "feedback_gain": (0.5, 1), "latent_scale": (0, 2),
}  # fmt: skip
"""Sane sizes (ours): a bundle beyond is damaged or hostile."""


def state_kinds(sizes: FlowSizes) -> list[str]:
    """Of the states of `Takes`: h hidden, c cells of an LSTM, q hidden in bytes."""
    there = {"h": sizes.cell == "gru" or not sizes.int8, "c": sizes.cell == "lstm", "q": sizes.int8}
    return [kind for kind, has in there.items() if has]


def unpack(weights: Mapping[str, Array], name: str) -> Array:
    """A matrix as float32, quantised or not."""
    if name in weights:
        return weights[name]
    return weights[f"{name}.q"] * weights[f"{name}.s"]


def _put(out: dict[str, Array], name: str, matrix: Array, int8: bool) -> None:
    """A matrix (inputs, outputs), quantised per column or as it is."""
    if not int8:
        out[name] = np.ascontiguousarray(matrix, np.float32)
        return
    scale = np.maximum(np.abs(matrix).max(0), 1e-12) / LEVELS
    out[f"{name}.q"] = np.ascontiguousarray(np.round(matrix / scale), np.int8)
    out[f"{name}.s"] = scale.astype(np.float32)


def pack_weights(arrays: Mapping[str, Array], sizes: FlowSizes) -> dict[str, Array]:
    """The weights as the graphs and the engine want them.

    Args:
        arrays: by the names of the network's ``state_dict`` (`cospeech.models.stylised_flow.StylisedFlow.export`).
        sizes: of the network; ``int8``: quantise.

    Returns:
        Name → array; matrices are (inputs, outputs).

    Raises:
        InputError: an array is missing, of another shape, or not finite.
    """
    out: dict[str, Array] = {}
    try:
        heads = [_pack_step(out, k, arrays, sizes) for k in range(sizes.steps)]
        past, speech, bias = zip(*heads, strict=True)
        _put(out, "past", np.concatenate(past, 1), sizes.int8)
        _put(out, "speech", np.concatenate(speech, 1), sizes.int8)
        out["speech.bias"] = np.concatenate(bias).astype(np.float32)
        if sizes.feature:
            _pack_encoder(out, arrays, sizes)
        if sizes.style:
            _pack_stylist(out, arrays)
    except (KeyError, ValueError, IndexError, np.linalg.LinAlgError) as error:
        raise InputError(f"the weights do not fit {sizes}: {error}"[:300], "are they of another network?") from None
    check_weights(out, sizes)
    return out


def _gate_order(sizes: FlowSizes) -> Array:
    """PyTorch's gates (r, z, n; i, f, g, o) in ours: those with a sigmoid first."""
    order = (0, 1, 2) if sizes.cell == "gru" else (0, 1, 3, 2)
    return np.concatenate([np.arange(sizes.hidden) + g * sizes.hidden for g in order])


def _pack_step(out: dict[str, Array], k: int, arrays: Mapping[str, Array], sizes: FlowSizes) -> tuple[Array, Array, Array]:
    """A step's own weights into ``out``; returns the shares of past and speech in its first layer, and the bias."""
    step, order, h, d = f"flow.steps.{k}.", _gate_order(sizes), sizes.hidden, sizes.pose
    rnn = {name: arrays[f"{step}coupling.net.rnn.{name}"] for name in _cell_names(sizes.layers)}
    rnn = {name: np.asarray(value, np.float64)[order].T for name, value in rnn.items()}
    first, heads = np.split(rnn["weight_ih_l0"], [sizes.first_half]), None
    for layer in range(sizes.layers):
        to_x, to_h = rnn[f"bias_ih_l{layer}"], rnn[f"bias_hh_l{layer}"]
        to_x, to_h = (to_x + to_h, 0 * to_h) if sizes.cell == "lstm" else (to_x + _but_new(to_h, h), to_h - _but_new(to_h, h))
        out[f"{k}.{layer}.hh.bias"] = to_h.astype(np.float32)
        _put(out, f"{k}.{layer}.hh", rnn[f"weight_hh_l{layer}"], sizes.int8)
        if layer == 0:
            past, speech, feature = np.split(
                first[1], [sizes.history * d, sizes.history * d + sizes.speech_frames * sizes.audio]
            )
            heads = np.concatenate([past, feature]), speech, to_x
        else:
            out[f"{k}.{layer}.ih.bias"] = to_x.astype(np.float32)
            _put(out, f"{k}.{layer}.ih", rnn[f"weight_ih_l{layer}"], sizes.int8)
    assert heads is not None
    out[f"{k}.kept"] = np.ascontiguousarray(first[0], np.float32)
    pairs = np.concatenate([np.arange(0, 2 * (d - sizes.first_half), 2), np.arange(1, 2 * (d - sizes.first_half), 2)])
    out[f"{k}.out"] = np.ascontiguousarray(arrays[f"{step}coupling.net.out.weight"][pairs].T, np.float32)
    bias = np.asarray(arrays[f"{step}coupling.net.out.bias"], np.float64)[pairs]
    bias[d - sizes.first_half :] += SCALE_SHIFT
    out[f"{k}.out.bias"] = bias.astype(np.float32)
    inverse = np.linalg.inv(_mixing(arrays, f"{step}mix."))
    out[f"{k}.mix"] = np.ascontiguousarray((np.exp(-_double(arrays, f"{step}norm.logs"))[:, None] * inverse).T, np.float32)
    out[f"{k}.mix.bias"] = (-_double(arrays, f"{step}norm.bias")).astype(np.float32)
    return heads


def _cell_names(layers: int) -> list[str]:
    return [f"{kind}_{way}_l{layer}" for layer in range(layers) for kind in ("weight", "bias") for way in ("ih", "hh")]


def _but_new(bias: Array, hidden: int) -> Array:
    """A GRU's bias without that of its new gate, which is multiplied by the reset gate before it is added."""
    return np.concatenate([bias[: 2 * hidden], np.zeros(hidden)])


def _double(arrays: Mapping[str, Array], name: str) -> Array:
    return np.asarray(arrays[name], np.float64)


def _mixing(arrays: Mapping[str, Array], at: str) -> Array:
    """W of `cospeech.models.nn.flow.InvertibleLinear` from its parts, in float64."""
    lower, upper = np.tril(_double(arrays, f"{at}lower"), -1), np.triu(_double(arrays, f"{at}upper"), 1)
    diagonal = _double(arrays, f"{at}sign") * np.exp(_double(arrays, f"{at}log_s"))
    return _double(arrays, f"{at}permutation") @ (lower + np.eye(len(lower))) @ (upper + np.diag(diagonal))


def _pack_encoder(out: dict[str, Array], arrays: Mapping[str, Array], sizes: FlowSizes) -> None:
    """The global encoder's weights, with batch norms folded into the convolutions."""
    for side in ("poses", "speech"):
        for part in ("first", *(f"blocks.{n}" for n in range(sizes.blocks)), "last"):
            conv, norm = (part, f"{part}_norm") if "." not in part else (f"{part}.conv", f"{part}.norm")
            at = f"encoder.{side}."
            gain = arrays[f"{at}{norm}.weight"] / np.sqrt(arrays[f"{at}{norm}.running_var"] + BATCH_NORM_EPS)
            out[f"{side}.{part}"] = (arrays[f"{at}{conv}.weight"] * gain[:, None, None]).astype(np.float32)
            bias = arrays[f"{at}{norm}.bias"] - arrays[f"{at}{norm}.running_mean"] * gain
            out[f"{side}.{part}.bias"] = bias.astype(np.float32)
    for number, name in ((0, "full0"), (2, "full1"), (4, "full2")):
        matrix = np.ascontiguousarray(arrays[f"encoder.full.{number}.weight"].T, np.float32)
        out[f"{name}.bias"] = np.asarray(arrays[f"encoder.full.{number}.bias"], np.float32)
        if number:
            out[name] = matrix
        else:
            out[f"{name}.poses"], out[f"{name}.speech"] = (
                np.ascontiguousarray(matrix[:CODE]),
                np.ascontiguousarray(matrix[CODE:]),
            )


def _pack_stylist(out: dict[str, Array], arrays: Mapping[str, Array]) -> None:
    """The style encoder's weights, with its batch norm in the last of them."""
    for n in range(3):
        for kind, end in (("weight", ""), ("bias", ".bias")):
            out[f"style.{n}{end}"] = np.asarray(arrays[f"stylist.convolutions.{2 * n}.{kind}"], np.float32)
    gain = 1 / np.sqrt(arrays["stylist.norm.running_var"] + BATCH_NORM_EPS)
    out["style.full"] = np.ascontiguousarray(arrays["stylist.full.weight"].T * gain, np.float32)
    bias = (arrays["stylist.full.bias"] - arrays["stylist.norm.running_mean"]) * gain
    out["style.full.bias"] = np.asarray(bias, np.float32)


def _matrix_shapes(sizes: FlowSizes) -> dict[str, tuple[int, ...]]:
    """Shapes of the large matrices, which are quantised or not."""
    g, h = sizes.gates, sizes.hidden
    shapes: dict[str, tuple[int, ...]] = {
        "past": (sizes.history * sizes.pose + sizes.feature + sizes.style, sizes.steps * g),
        "speech": (sizes.speech_frames * sizes.audio, sizes.steps * g),
    }
    for k in range(sizes.steps):
        shapes |= {f"{k}.{layer}.hh": (h, g) for layer in range(sizes.layers)}
        shapes |= {f"{k}.{layer}.ih": (h, g) for layer in range(1, sizes.layers)}
    return shapes


def _shapes(sizes: FlowSizes) -> dict[str, tuple[int, ...]]:
    """Shape of every array of `pack_weights`."""
    g, d, half, c = sizes.gates, sizes.pose, sizes.pose - sizes.first_half, sizes.channels
    shapes: dict[str, tuple[int, ...]] = {"speech.bias": (sizes.steps * g,)}
    for name, shape in _matrix_shapes(sizes).items():
        shapes |= {f"{name}.q": shape, f"{name}.s": shape[1:]} if sizes.int8 else {name: shape}
        if name not in ("past", "speech"):
            shapes[f"{name}.bias"] = (g,)
    for k in range(sizes.steps):
        shapes |= {f"{k}.kept": (sizes.first_half, g), f"{k}.out": (sizes.hidden, 2 * half), f"{k}.out.bias": (2 * half,)}
        shapes |= {f"{k}.mix": (d, d), f"{k}.mix.bias": (d,)}
    if sizes.feature:
        for side, width in (("poses", d), ("speech", sizes.audio)):
            shapes |= {f"{side}.first": (c, width, 4), f"{side}.first.bias": (c,)}
            shapes |= {f"{side}.last": (CODE, c, 4), f"{side}.last.bias": (CODE,), f"full0.{side}": (CODE, c)}
            for n in range(sizes.blocks):
                shapes |= {f"{side}.blocks.{n}": (c, c, 3), f"{side}.blocks.{n}.bias": (c,)}
        shapes |= {"full0.bias": (c,), "full1": (c, c), "full1.bias": (c,)}
        shapes |= {"full2": (c, sizes.feature), "full2.bias": (sizes.feature,)}
    if sizes.style:
        for n in range(3):
            shapes |= {f"style.{n}": (c, c if n else d, 4), f"style.{n}.bias": (c,)}
        shapes |= {"style.full": (2 * c, sizes.style), "style.full.bias": (sizes.style,)}
    return shapes


def check_weights(weights: Mapping[str, Array], sizes: FlowSizes) -> None:
    """Refuse weights whose names, types, shapes or values are wrong.

    Raises:
        InputError: they are not those of a network of these sizes.
    """
    shapes = _shapes(sizes)
    if set(weights) != set(shapes):
        odd = sorted(set(weights) ^ set(shapes))
        raise InputError(f"{len(odd)} names of weights differ, such as {odd[0]!r}"[:200], "are they of another network?")
    for name, shape in shapes.items():
        value = weights[name]
        kind = np.int8 if name.endswith(".q") else np.float32
        if value.shape != shape or value.dtype != kind:
            raise InputError(
                f"weights {name!r} are {value.dtype} of shape {value.shape}", f"expected {np.dtype(kind)} of shape {shape}"
            )
        if kind is np.float32 and not np.abs(value).max(initial=0) <= LARGEST:  # not a number fails this too
            raise InputError(f"weights {name!r} hold numbers that are not finite or too large", "did the training diverge?")
