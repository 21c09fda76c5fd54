"""Small bundles with random weights, for tests of the runtime: no network is trained, and torch is not needed. Speech for them
(synthetic), and damage to bundles of every kind."""

from __future__ import annotations

import io
import json
import zipfile
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from cospeech.audio.features.reduce import audio_width
from cospeech.audio.features.words import BUCKETS
from cospeech.audio.speech import Speech
from cospeech.errors import InputError
from cospeech.motion.motion import Motion
from cospeech.motion.poses import find_pose
from cospeech.motion.poses.controls import QUANTILES
from cospeech.runtime.bundles.bundle import MANIFEST
from cospeech.runtime.bundles.graph_builder import GraphBuilder
from cospeech.runtime.bundles.signature import STYLE_FRAMES, Signature
from cospeech.runtime.bundles.spec import VOICE, BundleSpec, half
from cospeech.runtime.bundles.statistics import Statistics
from cospeech.runtime.flow.weights import CODE, FlowSizes
from cospeech.runtime.model import TrainedModel
from cospeech.runtime.system import write_flow, write_networks

NAMES = ("ada", "ben")
CHANNELS, MODES, MULTIPLE = 8, 3, 4
REACH = 9  # of the windows, by hand: 7 to either side of content on a grid of 4 frames, and 2 more convolutions of kernel 3
HIDDEN, WORDS, NOISE, LOOK_AHEAD, REACH_OF_VOICE, WINDOW = 6, 3, 2, 3, 2, 16


def small_sizes(pose: str, audio: str) -> FlowSizes:
    sizes = {
        "pose": find_pose(pose).dimensions, "audio": audio_width(audio), "steps": 2, "hidden": 8, "layers": 2, "history": 4,
        "speech_frames": 8, "nu": 50, "feature": 3, "blocks": 1, "channels": 6, "style": 2,
    }  # fmt: skip
    return FlowSizes(**sizes)


def random_arrays(s: FlowSizes, seed: int = 0) -> dict[str, np.ndarray]:
    """By the names of a network's ``state_dict``; nothing is zero."""
    rng = np.random.default_rng(seed)
    context = s.first_half + s.history * s.pose + s.speech_frames * s.audio + s.feature + s.style
    shapes: dict[str, tuple[int, ...]] = {}
    constants: dict[str, np.ndarray] = {}
    for k in range(s.steps):
        at, second_half = f"flow.steps.{k}.", s.pose - s.first_half
        for layer in range(s.layers):
            rnn = f"{at}coupling.net.rnn."
            shapes |= {f"{rnn}weight_ih_l{layer}": (s.gates, s.hidden if layer else context)}
            shapes |= {f"{rnn}weight_hh_l{layer}": (s.gates, s.hidden)}
            shapes |= {f"{rnn}bias_{way}_l{layer}": (s.gates,) for way in ("ih", "hh")}
        shapes |= {
            f"{at}coupling.net.out.weight": (2 * second_half, s.hidden),
            f"{at}coupling.net.out.bias": (2 * second_half,),
        }
        shapes |= {f"{at}mix.{part}": (s.pose, s.pose) for part in ("lower", "upper")}
        shapes |= {f"{at}{part}": (s.pose,) for part in ("mix.log_s", "norm.bias", "norm.logs")}
        constants |= {f"{at}mix.permutation": np.eye(s.pose)[rng.permutation(s.pose)], f"{at}mix.sign": np.ones(s.pose)}
    for side, width in (("poses", s.pose), ("speech", s.audio)):
        at = f"encoder.{side}."
        blocks = {f"blocks.{n}.": (s.channels, s.channels, 3) for n in range(s.blocks)}
        for name, shape in {"first": (s.channels, width, 4), "last": (CODE, s.channels, 4), **blocks}.items():
            conv, norm = (f"{name}conv", f"{name}norm") if "." in name else (name, f"{name}_norm")
            shapes |= {f"{at}{conv}.weight": shape, f"{at}{norm}.bias": shape[:1], f"{at}{norm}.running_mean": shape[:1]}
            constants |= {f"{at}{norm}.weight": np.ones(shape[0]), f"{at}{norm}.running_var": np.ones(shape[0])}
    for number, (inputs, outputs) in {0: (2 * CODE, s.channels), 2: (s.channels,) * 2, 4: (s.channels, s.feature)}.items():
        shapes |= {f"encoder.full.{number}.weight": (outputs, inputs), f"encoder.full.{number}.bias": (outputs,)}
    for n in range(3):
        shapes |= {f"stylist.convolutions.{2 * n}.weight": (s.channels, s.channels if n else s.pose, 4)}
        shapes |= {f"stylist.convolutions.{2 * n}.bias": (s.channels,)}
    shapes |= {"stylist.full.weight": (s.style, 2 * s.channels), "stylist.full.bias": (s.style,)}
    shapes["stylist.norm.running_mean"] = (s.style,)
    constants["stylist.norm.running_var"] = np.ones(s.style)
    weights = {name: rng.normal(0, 0.3 if "mix" not in name else 0.1, shape) for name, shape in shapes.items()}
    return {name: value.astype(np.float32) for name, value in (weights | constants).items()}


def small_statistics(signature: tuple[int, int], speakers: int = 2, seed: int = 1, **more: tuple[int, ...]) -> Statistics:
    """Poses near the rest pose, moving by tenths; what silence sounds like lies within the audio's range.

    Args:
        signature: D and A.
        more: shapes of other arrays; those of gains are positive.
    """
    rng, (d, a) = np.random.default_rng(seed), signature
    arrays = {
        "pose_mean": rng.normal(0, 0.05, d), "pose_std": rng.uniform(0.05, 0.15, d), "audio_mean": np.full(a, -4.0),
        "audio_std": np.full(a, 3.0), "pose_low": np.full(d, -3.0), "pose_high": np.full(d, 3.0),
        "audio_low": np.full(a, -4.0), "audio_high": np.full(a, 4.0), "speaker_mean": rng.normal(0, 0.3, (speakers, d)),
    }  # fmt: skip
    for name, shape in more.items():
        gain = name.endswith("_gain")
        arrays[name] = rng.uniform(0.6, 1.6, shape) if gain else rng.normal(0, 1.0 if name == "histories" else 0.1, shape)
    if "words" in more:
        arrays["words"] = 10 * arrays["words"]
        arrays["words"][0] = 0
    return Statistics(**{name: value.astype(np.float32) for name, value in arrays.items()})


# flows ---------------------------------------------------------------------------------------------------------------------


def flow_statistics(sizes: FlowSizes, controls: int = 0) -> Statistics:
    statistics = small_statistics(
        (sizes.pose, sizes.audio - controls), histories=(6, sizes.history, sizes.pose), style_codes=(2, sizes.style)
    )
    quantiles = np.sort(np.random.default_rng(2).normal(size=(QUANTILES, controls)), 0).astype(np.float32)
    return replace(statistics, style_codes=10 * statistics.style_codes, control_quantiles=quantiles)


def write_small(
    path: Path,
    pose: str = "expmap-humanoid",
    audio: str = "mel20-prosody",
    fps: float = 20.0,
    controls: tuple[str, ...] = (),
) -> Path:
    """A whole bundle of two speakers."""
    sizes = small_sizes(pose, audio)
    sizes = replace(sizes, audio=sizes.audio + len(controls))
    write_flow(
        path, random_arrays(sizes), sizes, flow_statistics(sizes, len(controls)), card="# Random weights\n",
        facts=facts_of("stylised-flow", pose, audio, fps) | {"controls": list(controls)},
    )  # fmt: skip
    return path


def facts_of(model: str, pose: str = "expmap-humanoid", audio: str = "mel20-prosody", fps: float = 20.0) -> dict:
    return {"model": model, "styles": list(NAMES), "style": "ada", "pose": pose, "fps": fps, "audio": audio}


# networks ------------------------------------------------------------------------------------------------------------------

Networks = tuple[dict[str, Signature], dict[str, np.ndarray], dict[str, bytes]]
"""Signatures, weights and graphs."""


class Graph(GraphBuilder):
    """A few layers with random weights, over waves (n, C, T).

    Args:
        name: of the network, and before the names of its weights.
        weights: where they are put.
    """

    def __init__(self, name: str, weights: dict[str, np.ndarray]) -> None:
        super().__init__(weights)
        self.name, self.rng = name, np.random.default_rng(len(name))

    def random(self, *shape: int, size: float | None = None) -> str:
        name = f"{self.name}.{len(self.weights)}"
        size = (2 / np.prod(shape[1:])) ** 0.5 if size is None else size
        self.weights[name] = self.rng.normal(0, size, shape).astype(np.float32)
        return self.weight(name)

    def wave(self, name: str) -> str:
        return self.node("Transpose", name, perm=[0, 2, 1])

    def conv(self, x: str, inputs: int, outputs: int, frames: int = 3, pad: int = 1, **options) -> str:
        weight = self.random(outputs, inputs // options.get("group", 1), frames)
        x = self.node("Conv", x, weight, self.random(outputs, size=0.1), pads=[pad, pad], **options)
        return self.node("LeakyRelu", x, alpha=0.2)

    def poses(self, x: str, name: str = "poses") -> None:
        self.node("Transpose", x, outputs=(name,), perm=[0, 2, 1])

    def model(self, signature: Signature) -> bytes:
        after = {f"next.{name}": port for name, port in signature.state.items()}
        return self.file(self.name, {**signature.inputs, **signature.state}, {**signature.outputs, **after})


def small_windows(pose: int, audio: int) -> Networks:
    """A small Mix-StAGE: content at a quarter of the rate and its skip, speakers' weights, modes that are mixed."""
    weights: dict[str, np.ndarray] = {}
    b, c, styles = Graph("make", weights), CHANNELS, len(NAMES)
    x = b.conv(b.wave("rows"), audio, c)
    low = b.conv(b.conv(x, c, c, 4, strides=[2]), c, c, 4, strides=[2])
    low = b.node(
        "Resize", low, "", b.const([1, 1, 4]), mode="nearest", coordinate_transformation_mode="asymmetric", nearest_mode="floor"
    )
    x = b.node("Add", low, x)
    z = b.node("Add", b.conv(x, c, MODES * c), b.conv(b.wave("style"), styles, MODES * c))
    modes = b.conv(b.conv(z, MODES * c, MODES * c, group=MODES), MODES * c, MODES * pose, 1, 0, group=MODES)
    share = b.node("Softmax", b.node("Add", b.conv(x, c, MODES, 1, 0), b.wave("noise")), axis=1)
    apart = b.const([0, MODES, 1, -1], np.int64)
    products = b.node("Mul", b.node("Reshape", modes, b.const([0, MODES, pose, -1], np.int64)), b.node("Reshape", share, apart))
    total = b.node("ReduceMean", products, b.const([1], np.int64), keepdims=0)
    b.poses(b.node("Mul", total, b.const(3 * MODES)))
    ports = {"rows": (1, "T", audio), "style": ("N", "T", styles), "noise": ("N", "T", MODES)}
    make = Signature(ports, {"poses": ("N", "T", pose)}, window=64, multiple=MULTIPLE, reach=REACH)
    graphs = {"make": b.model(make)}
    b = Graph("style", weights)
    logits = b.conv(b.conv(b.wave("poses"), pose, c, 4, strides=[2]), c, styles)
    b.node("Softmax", b.node("ReduceMean", logits, b.const([2], np.int64), keepdims=0), outputs=("style",), axis=1)
    style = Signature({"poses": (1, "T", pose)}, {"style": (1, styles)}, window=STYLE_FRAMES)
    return {"make": make, "style": style}, weights, graphs | {"style": b.model(style)}


def small_chain(
    pose: int, audio: int, *, live: bool = True, noise: int = NOISE, words: int = WORDS, judges: bool = True,
    faces: bool = False, seeds: int = 0, emotions: bool = True,
) -> Networks:  # fmt: skip
    """A network of windows that hears both ways, one of frames with a memory, and a classifier that is one convolution.

    Args:
        faces, seeds: whether it may be given some.
        emotions: whether they are a part of the style.
    """
    weights: dict[str, np.ndarray] = {}
    graphs, signatures, style = dict[str, bytes](), dict[str, Signature](), len(NAMES) + 8 * emotions
    widths = {"rows": audio + words, "style": style, "noise": noise, "face": 53 * faces, "seed": (pose + 1) * (seeds > 0)}
    b = Graph("make", weights)
    ports = {name: (1 if name in ("rows", "face", "seed") else "N", "T", w) for name, w in widths.items() if w}
    x, wide = b.conv(b.wave("rows"), audio + words, CHANNELS), CHANNELS
    for name in [*ports][1:]:
        x = b.node("Add", x, b.conv(b.wave(name), widths[name], wide))
    wave = b.node("Transpose", x, perm=[2, 0, 1])
    parameters = (
        b.random(2, 4 * HIDDEN, wide, size=0.4),
        b.random(2, 4 * HIDDEN, HIDDEN, size=0.4),
        b.random(2, 8 * HIDDEN, size=0.3),
    )
    out = b.node("LSTM", wave, *parameters, hidden_size=HIDDEN, direction="bidirectional")
    out = b.node("Reshape", b.node("Transpose", out, perm=[2, 1, 3, 0]), b.const([0, 2 * HIDDEN, -1], np.int64))
    b.poses(b.conv(out, 2 * HIDDEN, pose, 1, 0))
    signatures["make"] = Signature(
        ports, {"poses": ("N", "T", pose)}, window=WINDOW, hop=WINDOW // 2, look_ahead=WINDOW // 4, seeds=seeds
    )
    graphs["make"] = b.model(signatures["make"])
    if live:
        signatures["live"], graphs["live"] = small_frames(weights, pose, widths)
    if judges:
        b = Graph("classify", weights)
        weight = b.random(style, audio, 2 * REACH_OF_VOICE + 1)
        b.poses(b.node("Conv", b.wave("rows"), weight, pads=[REACH_OF_VOICE] * 2), "logits")
        signatures["classify"] = Signature(
            {"rows": (1, "T", audio)}, {"logits": (1, "T", style)}, window=2 * REACH_OF_VOICE + 1, reach=REACH_OF_VOICE
        )
        graphs["classify"] = b.model(signatures["classify"])
    return signatures, weights, graphs


def small_frames(weights: dict[str, np.ndarray], pose: int, widths: dict[str, int]) -> tuple[Signature, bytes]:
    """The network of frames: the last three rows, which all takes share, and a leaky memory of each take."""
    b = Graph("live", weights)
    ports = {name: (1 if name == "rows" else "N", widths[name]) for name in ("rows", "style", "noise") if widths[name]}
    state = {"state0": (1, 2 * widths["rows"]), "state1": ("N", CHANNELS)}
    frames = b.node("Concat", "state0", "rows", axis=1)
    rest = b.split(frames, widths["rows"], 2 * widths["rows"])[1]
    b.node("Add", rest, b.const(0.0), outputs=("next.state0",))
    x = b.node("Gemm", frames, b.random(3 * widths["rows"], CHANNELS, size=0.2), b.random(CHANNELS, size=0.1))
    for name in [*ports][1:]:
        x = b.node("Add", x, b.node("Gemm", name, b.random(widths[name], CHANNELS, size=0.7), b.random(CHANNELS, size=0.1)))
    memory = b.node("Tanh", b.node("Add", x, b.node("Mul", "state1", b.const(0.9))))
    b.node("Add", memory, b.const(0.0), outputs=("next.state1",))
    b.node("Gemm", memory, b.random(CHANNELS, pose, size=0.5), b.random(pose, size=0.1), outputs=("poses",))
    signature = Signature(ports, {"poses": ("N", pose)}, state, look_ahead=LOOK_AHEAD)
    return signature, b.model(signature)


def chain_statistics(signatures: dict[str, Signature], words: int = WORDS, vocabulary: int = BUCKETS) -> Statistics:
    make = signatures["make"]
    d, by_speaker = make.width("poses"), (len(NAMES), make.width("poses"))
    more = dict.fromkeys(("model_mean", "style_gain", "live_model_mean", "live_style_gain"), by_speaker)
    statistics = small_statistics((d, make.width("rows") - words), **more, words=(vocabulary + 1, words))
    return replace(statistics, noise_gain=np.array([1.5, 2.0], np.float32))


def window_statistics(signatures: dict[str, Signature]) -> Statistics:
    make = signatures["make"]
    by_speaker = len(NAMES), make.width("poses")
    return small_statistics((make.width("poses"), make.width("rows")), model_mean=by_speaker, style_gain=by_speaker)


def write_small_window(
    path: Path, pose: str = "expmap-humanoid", audio: str = "mel20-prosody", fps: float = 20.0, *, small: bool = True
) -> Path:
    """A whole bundle of two speakers."""
    signatures, weights, graphs = small_windows(find_pose(pose).dimensions, audio_width(audio))
    facts = facts_of("mix-stage", pose, audio, fps) | {"style_space": "one-hot"}
    weights = half(weights) if small else weights
    write_networks(path, signatures, graphs, weights, window_statistics(signatures), facts=facts, card="# Random weights\n")
    return path


def write_small_chain(
    path: Path, pose: str = "expmap-humanoid", audio: str = "mel20-prosody", fps: float = 15.0, *, small: bool = True,
    vocabulary: tuple[str, ...] | None = None, **kind,
) -> Path:  # fmt: skip
    """A whole bundle of two speakers."""
    signatures, weights, graphs = small_chain(find_pose(pose).dimensions, audio_width(audio), **kind)
    facts = facts_of("chain-of-generation", pose, audio, fps) | {"style_space": "speaker-emotion"}
    facts["styles"] += [VOICE] if "classify" in graphs else []
    facts |= {} if vocabulary is None else {"vocabulary": list(vocabulary)}
    statistics = chain_statistics(signatures, kind.get("words", WORDS), BUCKETS if vocabulary is None else len(vocabulary))
    weights = half(weights) if small else weights
    write_networks(path, signatures, graphs, weights, statistics, facts=facts, card="# Random weights\n")
    return path


# ready to play ------------------------------------------------------------------------------------------------------------


def talk(seconds: float = 3.2, rate: int = 16_000, seed: int = 0) -> Speech:
    """Noise in bursts that are like syllables."""
    rng = np.random.default_rng(seed)
    t = np.arange(round(seconds * rate)) / rate
    sound = np.sin(2 * np.pi * 140 * t) * np.maximum(np.sin(2 * np.pi * 2.5 * t), 0) * (t % 1.7 < 1.2)
    return Speech((0.3 * sound + 0.001 * rng.normal(size=len(t))).astype(np.float32), rate)


def same(a: Motion, b: Motion) -> bool:
    face = a.face is b.face is None or (a.face is not None and b.face is not None and a.face.tobytes() == b.face.tobytes())
    return a.rotations.tobytes() == b.rotations.tobytes() and a.root.tobytes() == b.root.tobytes() and face


def cut(speech: Speech, edges: Sequence[int]) -> list[Speech]:
    bounds = [0, *edges, len(speech)]
    return [Speech(speech.samples[a:b], speech.rate) for a, b in pairwise(bounds)]


def perform_changes(
    player: TrainedModel, speech: Speech, edges: Sequence[int], changes: dict[int, object], **options
) -> Motion:
    """Perform speech in these pieces, and change the style after these samples."""
    session, pieces, at = player.session(**options), [], 0
    for chunk in cut(speech, sorted({*edges, *changes})):
        pieces += session.push(chunk)
        at += len(chunk)
        if at in changes:
            session.restyle(changes[at])
    return Motion.concatenate([*pieces, *session.finish()])


# damage -------------------------------------------------------------------------------------------------------------------


def contents_of(data: bytes) -> tuple[dict, dict[str, bytes]]:
    """Manifest and members of a bundle, to be changed."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    return json.loads(members.pop(MANIFEST)), members


def mutations(data: bytes, rng: np.random.Generator) -> list[tuple[str, bytes]]:
    """Damage of every kind, at random places."""
    out = [(f"cut at {n}", data[:n]) for n in rng.integers(0, len(data), 60)]
    for _ in range(160):  # bits and stretches anywhere
        copy, at, size = bytearray(data), int(rng.integers(len(data))), int(rng.choice([1, 1, 1, 8, 200]))
        copy[at : at + size] = rng.bytes(len(copy[at : at + size]))
        out.append((f"{size} bytes at {at}", bytes(copy)))
    tail = data.rfind(b"PK\x01\x02", 0, data.find(b"PK\x05\x06")) - 400
    for _ in range(80):  # the directory of the zip, where lengths and names are
        copy, at = bytearray(data), int(rng.integers(max(0, tail), len(data)))
        copy[at] = int(rng.integers(256))
        out.append((f"directory at {at}", bytes(copy)))
    for _ in range(30):  # pieces moved
        a, b = sorted(int(v) for v in rng.integers(0, len(data), 2))
        out.append((f"{a} … {b} gone", data[:a] + data[b:]))
        out.append((f"{a} … {b} twice", data[:b] + data[a:]))
    return out


def check_damage(open_bundle: Callable[[bytes], BundleSpec], data: bytes) -> float:
    """Damage a bundle 360 times. One that still opens (the zip does not use these bytes) has the weights of the whole.

    Returns:
        the share that was refused, in one line.
    """
    whole, refusals = open_bundle(data), 0
    cases = mutations(data, np.random.default_rng(0))
    for what, copy in cases:
        try:
            system = open_bundle(copy)
        except InputError as error:
            refusals += "\n" not in str(error)
        else:
            for name, value in system.weights.items():
                assert np.array_equal(value, whole.weights[name]), what
    return refusals / len(cases)


def check_repaired_damage(
    rewrite: Callable[[dict, dict[str, bytes]], BundleSpec], data: bytes, perform: Callable[[BundleSpec], object], times: int
) -> int:
    """Change members and repair the hashes: the result is an error, or a system of finite weights that performs.

    Returns:
        how often it was refused, in one line.
    """
    rng, refusals = np.random.default_rng(1), 0
    for turn in range(times):
        manifest, members = contents_of(data)
        name = sorted(members)[turn % len(members)]
        copy = bytearray(members[name])
        for _ in range(int(rng.integers(1, 4))):
            copy[int(rng.integers(min(len(copy), 3000)))] = int(rng.integers(256))
        try:
            system = rewrite(manifest, {**members, name: bytes(copy)})
        except InputError as error:
            refusals += "\n" not in str(error)
            continue
        assert all(np.isfinite(value).all() for value in system.weights.values())
        with suppress(InputError):
            perform(system)
    return refusals
