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
from cospeech.audio.speech import Speech
from cospeech.errors import InputError
from cospeech.motion.motion import Motion
from cospeech.motion.poses import find_pose
from cospeech.motion.poses.controls import QUANTILES
from cospeech.runtime.bundle import MANIFEST
from cospeech.runtime.flow_bundle import Statistics, write_flow
from cospeech.runtime.flow_weights import CODE, FlowSizes
from cospeech.runtime.manifest import System
from cospeech.runtime.model import TrainedModel


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
    fixed: dict[str, np.ndarray] = {}
    for k in range(s.steps):
        at, moved = f"flow.steps.{k}.", s.pose - s.first_half
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
        "styles": rng.uniform(-1, 1, (2, sizes.style)), "speaker_mean": rng.normal(0, 0.3, (2, d)),
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


# ready to play ------------------------------------------------------------------------------------------------------------


def talk(seconds: float = 3.2, rate: int = 16_000, seed: int = 0) -> Speech:
    """Noise in bursts, such as syllables are."""
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


def changed(player: TrainedModel, speech: Speech, edges: Sequence[int], changes: dict[int, object], **options) -> Motion:
    """A performance of speech in these pieces, the style changed after these samples."""
    session, made, at = player.session(**options), [], 0
    for chunk in cut(speech, sorted({*edges, *changes})):
        made += session.push(chunk)
        at += len(chunk)
        if at in changes:
            session.restyle(changes[at])
    return Motion.concatenate([*made, *session.finish()])


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
        broken, at, size = bytearray(data), int(rng.integers(len(data))), int(rng.choice([1, 1, 1, 8, 200]))
        broken[at : at + size] = rng.bytes(len(broken[at : at + size]))
        out.append((f"{size} bytes at {at}", bytes(broken)))
    tail = data.rfind(b"PK\x01\x02", 0, data.find(b"PK\x05\x06")) - 400
    for _ in range(80):  # the directory of the zip, where lengths and names are
        broken, at = bytearray(data), int(rng.integers(max(0, tail), len(data)))
        broken[at] = int(rng.integers(256))
        out.append((f"directory at {at}", bytes(broken)))
    for _ in range(30):  # pieces moved
        a, b = sorted(int(v) for v in rng.integers(0, len(data), 2))
        out.append((f"{a} … {b} gone", data[:a] + data[b:]))
        out.append((f"{a} … {b} twice", data[:b] + data[a:]))
    return out


def check_damage(opened: Callable[[bytes], System], data: bytes) -> float:
    """Damages a bundle 360 times: what opens nevertheless (bytes that a zip does not use) is what was written.

    Returns:
        the share that was refused, in one line.
    """
    whole, refused = opened(data), 0
    cases = mutations(data, np.random.default_rng(0))
    for what, broken in cases:
        try:
            system = opened(broken)
        except InputError as error:
            refused += "\n" not in str(error)
        else:
            for name, value in system.engine.weights.items():
                assert np.array_equal(value, whole.engine.weights[name]), what
    return refused / len(cases)


def check_repaired_damage(
    rewritten: Callable[[dict, dict[str, bytes]], System], data: bytes, perform: Callable[[System], object], times: int
) -> int:
    """Changes members as somebody would who knows the format: errors, or a system of finite weights that performs.

    Returns:
        how often it was refused, in one line.
    """
    rng, refused = np.random.default_rng(1), 0
    for turn in range(times):
        manifest, members = contents_of(data)
        name = sorted(members)[turn % len(members)]
        broken = bytearray(members[name])
        for _ in range(int(rng.integers(1, 4))):
            broken[int(rng.integers(min(len(broken), 3000)))] = int(rng.integers(256))
        try:
            system = rewritten(manifest, {**members, name: bytes(broken)})
        except InputError as error:
            refused += "\n" not in str(error)
            continue
        assert all(np.isfinite(value).all() for value in system.engine.weights.values())
        with suppress(InputError):
            perform(system)
    return refused
