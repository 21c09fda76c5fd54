"""Small bundles of chains with random weights, for tests of the runtime: no network is trained, torch is not needed.

The network of windows is a convolution and an LSTM both ways, that of frames the same with memory, and attention over what
passed; the classifier is one convolution.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from cospeech.audio.features.reduce import audio_width
from cospeech.audio.features.words import BUCKETS
from cospeech.motion.poses import find_pose
from cospeech.runtime.chain_bundle import VOICE, ChainStatistics, write_chain
from cospeech.runtime.chain_engine import ChainSizes
from cospeech.runtime.window_bundle import halve_weights
from cospeech.training.export.recurrent_graph import RecurrentGraph, Wave

__all__ = ["LOOK_AHEAD", "NAMES", "REACH", "WORDS", "small_chain", "small_chain_statistics", "write_small_chain"]

CHANNELS, HIDDEN, WORDS, NOISE, LOOK_AHEAD, REACH, POOLED, WINDOW = 8, 6, 3, 2, 3, 2, 5, 16
NAMES = ("ada", "ben")
EMOTIONS = 8


def _recurrent_weights(rng: np.random.Generator, inputs: int, ways: int) -> dict[str, np.ndarray]:
    """By PyTorch's names, two layers."""
    found = {}
    for layer, width in enumerate((inputs, ways * HIDDEN)):
        for end in ("", "_reverse")[:ways]:
            shapes = {"weight_ih": (4 * HIDDEN, width), "weight_hh": (4 * HIDDEN, HIDDEN), "bias_ih": (4 * HIDDEN,)}
            found |= {f"{n}_l{layer}{end}": rng.normal(0, 0.4, s) for n, s in (shapes | {"bias_hh": (4 * HIDDEN,)}).items()}
    return found


def small_chain(
    pose: int, audio: int, *, live: bool = True, noise: int = NOISE, words: int = WORDS, judges: bool = True,
    faces: bool = False, seeds: int = 0, seed: int = 0,
) -> tuple[ChainSizes, dict[str, np.ndarray], dict[str, bytes]]:  # fmt: skip
    """Sizes, weights and graphs; ``faces`` and ``seeds``: whether it may be given some."""
    rng, weights, style = np.random.default_rng(seed), {}, len(NAMES) + EMOTIONS
    graphs: dict[str, bytes] = {}

    def conv(b: RecurrentGraph, x: Wave, made: int, frames: int, **options) -> Wave:
        weight = rng.normal(0, (2 / (x.channels * frames)) ** 0.5, (made, x.channels, frames))
        return b.conv(x, weight, rng.normal(0, 0.1, made), **options)

    for name in ("make", "live")[: 1 + live]:
        b, whole = RecurrentGraph(weights, name), name == "make"
        own = ("T",) if whole else ()
        shapes = {"rows": (1, *own, audio + words), "style": ("N", *own, style)} | (
            {"mode_noise": ("N", *own, noise)} if noise else {}
        )
        rows, who, *mode_noise = (b.rows(key, shape[-1], many=key != "rows", frames=whole) for key, shape in shapes.items())
        beyond = {"face": 53 * faces, "seed": (pose + 1) * (seeds > 0)} if whole else {}
        beyond = {key: b.rows(key, width, many=False) for key, width in beyond.items() if width}
        shapes |= {key: (1, "T", x.channels) for key, x in beyond.items()}
        heard = conv(b, rows, CHANNELS, 3, pads=(1, 1)) if whole else conv(b, b.behind(rows, 2), CHANNELS, 3)
        heard = b.each("LeakyRelu", heard, alpha=0.2)
        pool = b.pool(heard, "ReduceMean") if whole else b.sliding(b.behind(heard, POOLED - 1), "AveragePool", POOLED)
        heard = b.both("Mul", heard, b.each("Sigmoid", conv(b, pool, CHANNELS, 1)))
        x = b.concatenate(*mode_noise, *beyond.values(), heard, conv(b, who, CHANNELS, 1))
        ways = 2 if whole else 1
        x = b.lstm(x, _recurrent_weights(rng, x.channels, ways), ways=ways, layers=2, stateful=not whole)
        b.as_rows(conv(b, x, pose, 1), "poses", frames=whole)
        graphs[name] = b.serialise(shapes, {"poses": ("N", *own, pose)})
    if judges:
        b = RecurrentGraph(weights, "classify")
        b.as_rows(conv(b, b.rows("rows", audio, many=False), style, 2 * REACH + 1, pads=(REACH, REACH)), "logits")
        graphs["classify"] = b.serialise({"rows": (1, "T", audio)}, {"logits": (1, "T", style)})
    sizes = ChainSizes(
        pose=pose, audio=audio, words=words, speakers=len(NAMES), noise=noise, window=WINDOW, reach=REACH if judges else 0,
        look_ahead=LOOK_AHEAD if live else 0, faces=52 * faces, seeds=seeds,
    )  # fmt: skip
    return sizes, weights, graphs


def small_chain_statistics(sizes: ChainSizes, seed: int = 1, vocabulary: int = BUCKETS) -> ChainStatistics:
    """Poses near the rest pose, moving by tenths; what silence sounds like lies within the audio's range."""
    rng = np.random.default_rng(seed)
    d, a, by_speaker = sizes.pose, sizes.audio, (len(NAMES), sizes.pose)
    words = rng.normal(0, 1, (vocabulary + 1, sizes.words))
    words[0] = 0
    arrays = {
        "pose_mean": rng.normal(0, 0.05, d), "pose_std": rng.uniform(0.05, 0.15, d), "audio_mean": np.full(a, -4.0),
        "audio_std": np.full(a, 3.0), "pose_low": np.full(d, -3.0), "pose_high": np.full(d, 3.0),
        "audio_low": np.full(a, -4.0), "audio_high": np.full(a, 4.0), "speaker_mean": rng.normal(0, 0.3, by_speaker),
        "model_mean": rng.normal(0, 0.1, by_speaker), "style_gain": rng.uniform(0.6, 1.6, by_speaker),
        "live_model_mean": rng.normal(0, 0.1, by_speaker), "live_style_gain": rng.uniform(0.6, 1.6, by_speaker), "words": words,
        "noise_gain": np.array([1.5, 2.0]),
    }  # fmt: skip
    return ChainStatistics(**{name: value.astype(np.float32) for name, value in arrays.items()})


def write_small_chain(
    path: Path,
    pose: str = "expmap-humanoid",
    audio: str = "mel20-prosody",
    fps: float = 15.0,
    *,
    small: bool = True,
    vocabulary: tuple[str, ...] | None = None,
    **kind,
) -> Path:
    """A whole bundle of two speakers."""
    sizes, weights, graphs = small_chain(find_pose(pose).dimensions, audio_width(audio), **kind)
    facts = {"model": "chain-of-generation", "styles": [*NAMES, *([VOICE] if "classify" in graphs else [])], "style": "ada"}
    facts |= {} if vocabulary is None else {"vocabulary": list(vocabulary)}
    statistics = small_chain_statistics(sizes, vocabulary=BUCKETS if vocabulary is None else len(vocabulary))
    write_chain(
        path, halve_weights(weights) if small else weights, graphs, sizes, statistics, pose=pose, fps=fps, audio=audio,
        facts=facts, card="# Random weights\n",
    )  # fmt: skip
    return path
