"""Small bundles with random weights, for tests of the runtime: no network is trained, and torch is not needed."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from cospeech.features.reduce import audio_width
from cospeech.poses import find_pose
from cospeech.poses.controls import QUANTILES
from cospeech.runtime.flow_bundle import Statistics, write_flow
from cospeech.runtime.flow_weights import CODE, FlowSizes


def small_sizes(pose: str, audio: str) -> FlowSizes:
    sizes = {
        "pose": find_pose(pose).dimensions, "audio": audio_width(audio), "steps": 2, "hidden": 8, "layers": 2, "history": 4,
        "heard": 8, "nu": 50, "feature": 3, "blocks": 1, "channels": 6, "style": 2,
    }  # fmt: skip
    return FlowSizes(**sizes)


def random_arrays(s: FlowSizes, seed: int = 0) -> dict[str, np.ndarray]:
    """By the names of a network's ``state_dict``; nothing is zero."""
    rng = np.random.default_rng(seed)
    context = s.kept + s.history * s.pose + s.heard * s.audio + s.feature + s.style
    shapes: dict[str, tuple[int, ...]] = {}
    fixed: dict[str, np.ndarray] = {}
    for k in range(s.steps):
        at, moved = f"flow.steps.{k}.", s.pose - s.kept
        for layer in range(s.layers):
            rnn = f"{at}coupling.net.rnn."
            shapes |= {f"{rnn}weight_ih_l{layer}": (s.gates, s.hidden if layer else context)}
            shapes |= {f"{rnn}weight_hh_l{layer}": (s.gates, s.hidden)}
            shapes |= {f"{rnn}bias_{way}_l{layer}": (s.gates,) for way in ("ih", "hh")}
        shapes |= {f"{at}coupling.net.out.weight": (2 * moved, s.hidden), f"{at}coupling.net.out.bias": (2 * moved,)}
        shapes |= {f"{at}mix.{part}": (s.pose, s.pose) for part in ("lower", "upper")}
        shapes |= {f"{at}{part}": (s.pose,) for part in ("mix.log_s", "norm.bias", "norm.logs")}
        fixed |= {f"{at}mix.permutation": np.eye(s.pose)[rng.permutation(s.pose)], f"{at}mix.sign": np.ones(s.pose)}
    for side, width in (("poses", s.pose), ("speech", s.audio)):
        at = f"encoder.{side}."
        blocks = {f"blocks.{n}.": (s.channels, s.channels, 3) for n in range(s.blocks)}
        for name, shape in {"first": (s.channels, width, 4), "last": (CODE, s.channels, 4), **blocks}.items():
            conv, norm = (f"{name}conv", f"{name}norm") if "." in name else (name, f"{name}_norm")
            shapes |= {f"{at}{conv}.weight": shape, f"{at}{norm}.bias": shape[:1], f"{at}{norm}.running_mean": shape[:1]}
            fixed |= {f"{at}{norm}.weight": np.ones(shape[0]), f"{at}{norm}.running_var": np.ones(shape[0])}
    for number, (taken, made) in {0: (2 * CODE, s.channels), 2: (s.channels,) * 2, 4: (s.channels, s.feature)}.items():
        shapes |= {f"encoder.full.{number}.weight": (made, taken), f"encoder.full.{number}.bias": (made,)}
    for n in range(3):
        shapes |= {f"stylist.convolutions.{2 * n}.weight": (s.channels, s.channels if n else s.pose, 4)}
        shapes |= {f"stylist.convolutions.{2 * n}.bias": (s.channels,)}
    shapes |= {"stylist.full.weight": (s.style, 2 * s.channels), "stylist.full.bias": (s.style,)}
    drawn = {name: rng.normal(0, 0.3 if "mix" not in name else 0.1, shape) for name, shape in shapes.items()}
    return {name: value.astype(np.float32) for name, value in (drawn | fixed).items()}


def statistics(sizes: FlowSizes, seed: int = 1, controls: int = 0) -> Statistics:
    """Poses near the rest pose, moving by tenths; what silence sounds like lies within the audio's range."""
    rng = np.random.default_rng(seed)
    d, a = sizes.pose, sizes.audio - controls
    arrays = {
        "pose_mean": rng.normal(0, 0.05, d), "pose_std": rng.uniform(0.05, 0.15, d), "audio_mean": np.full(a, -4.0),
        "audio_std": np.full(a, 3.0), "pose_low": np.full(d, -3.0), "pose_high": np.full(d, 3.0),
        "audio_low": np.full(a, -4.0), "audio_high": np.full(a, 4.0), "histories": rng.normal(size=(2 * 3, sizes.history, d)),
        "styles": rng.uniform(-1, 1, (2, sizes.style)), "centres": rng.normal(0, 0.3, (2, d)),
        "controls": np.sort(rng.normal(size=(QUANTILES, controls)), 0),
    }  # fmt: skip
    return Statistics(**{name: value.astype(np.float32) for name, value in arrays.items()})


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
    facts = {"model": "stylised-flow", "styles": ["ada", "ben"], "style": "ada", "controls": list(controls)}
    write_flow(
        path, random_arrays(sizes), sizes, statistics(sizes, controls=len(controls)), pose=pose, fps=fps, audio=audio,
        facts=facts, card="# Random weights\n",
    )  # fmt: skip
    return path
