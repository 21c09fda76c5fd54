"""Small bundles of window networks with random weights, for tests of the runtime: no network is trained, torch is not needed.

The network is a small Mix-StAGE: content at a quarter of the rate and its skip, speakers' weights, modes that are mixed.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from cospeech.audio.features.reduce import audio_width
from cospeech.motion.poses import find_pose
from cospeech.runtime.window_bundle import WindowStatistics, halve_weights, write_window
from cospeech.runtime.window_engine import WindowSizes
from cospeech.training.export.conv_graph import ConvGraph, Signal

__all__ = ["REACH", "small_network", "small_statistics", "write_small_window"]

CHANNELS, MODES, MULTIPLE = 8, 3, 4
REACH = 9  # by hand: 7 to either side of content on a grid of 4 frames, and 2 more convolutions of kernel 3
NAMES = ("ada", "ben")


def small_network(pose: int, audio: int, seed: int = 0) -> tuple[WindowSizes, dict[str, np.ndarray], dict[str, bytes]]:
    """Sizes, weights and graphs."""
    rng, weights = np.random.default_rng(seed), {}

    def conv(b: ConvGraph, x: Signal, made: int, frames: int = 3, stride: int = 1, groups: int = 1) -> Signal:
        taken = x.channels // groups
        weight = rng.normal(0, (2 / (taken * frames)) ** 0.5, (made, taken, 1, frames))
        pad = (frames - 1) // 2
        found = b.conv(x, weight, rng.normal(0, 0.1, made), stride=(1, stride), pads=(0, pad, 0, pad), groups=groups)
        return b.leaky(found, 0.2)

    b = ConvGraph(weights, "make", MULTIPLE)
    x = conv(b, b.rows("rows", audio), CHANNELS)
    low = conv(b, conv(b, x, CHANNELS, 4, 2), CHANNELS, 4, 2)
    x = b.add(b.upsample_nearest(b.upsample_nearest(low)), x)
    z = b.add(conv(b, x, MODES * CHANNELS), conv(b, b.rows("style", len(NAMES)), MODES * CHANNELS))
    made = conv(b, conv(b, z, MODES * CHANNELS, groups=MODES), MODES * pose, 1, groups=MODES)
    logits = b.add(conv(b, x, MODES, 1), b.rows("mode_noise", MODES))
    made = b.mix_generators(made, b.softmax(logits))
    b.as_rows(made, "poses")
    inputs = {"rows": (1, "T", audio), "style": ("N", "T", len(NAMES)), "mode_noise": ("N", "T", MODES)}
    graphs = {"make": b.serialise(inputs, {"poses": ("N", "T", pose)})}
    b = ConvGraph(weights, "style", MULTIPLE)
    seen = conv(b, conv(b, b.rows("poses", pose), CHANNELS, 4, 2), len(NAMES))
    b.node("Softmax", b.over_frames(seen), outputs=("style",), axis=1)
    graphs["style"] = b.serialise({"poses": (1, "T", pose)}, {"style": (1, len(NAMES))})
    sizes = WindowSizes(
        pose=pose, audio=audio, styles=len(NAMES), modes=MODES, window=64, multiple=MULTIPLE, reach=int(made.reach)
    )
    return sizes, weights, graphs


def small_statistics(sizes: WindowSizes, seed: int = 1) -> WindowStatistics:
    """Poses near the rest pose, moving by tenths; what silence sounds like lies within the audio's range."""
    rng = np.random.default_rng(seed)
    d, a = sizes.pose, sizes.audio
    arrays = {
        "pose_mean": rng.normal(0, 0.05, d), "pose_std": rng.uniform(0.05, 0.15, d), "audio_mean": np.full(a, -4.0),
        "audio_std": np.full(a, 3.0), "pose_low": np.full(d, -3.0), "pose_high": np.full(d, 3.0),
        "audio_low": np.full(a, -4.0), "audio_high": np.full(a, 4.0), "speaker_mean": rng.normal(0, 0.3, (len(NAMES), d)),
        "codes": np.eye(len(NAMES)), "model_mean": rng.normal(0, 0.1, (len(NAMES), d)),
        "style_gain": rng.uniform(0.6, 1.6, (len(NAMES), d)),
    }  # fmt: skip
    return WindowStatistics(**{name: value.astype(np.float32) for name, value in arrays.items()})


def write_small_window(
    path: Path, pose: str = "expmap-humanoid", audio: str = "mel20-prosody", fps: float = 20.0, *, small: bool = True
) -> Path:
    """A whole bundle of two speakers."""
    sizes, weights, graphs = small_network(find_pose(pose).dimensions, audio_width(audio))
    write_window(
        path, halve_weights(weights) if small else weights, graphs, sizes, small_statistics(sizes), pose=pose, fps=fps,
        audio=audio, facts={"model": "mix-stage", "styles": list(NAMES), "style": "ada"}, card="# Random weights\n",
    )  # fmt: skip
    return path
