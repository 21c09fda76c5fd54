"""How fast a flow is stepped frame by frame on one core: ``python benchmarks/flow.py [--endless [frames]]``.

The paper's size (TED: D = 27, K = 16, GRU-800 × 2, τ = 12; 123,611,408 parameters) with random weights, the last layer of every
coupling not zero, and the bundle that ships; speech, latents and histories are normal noise. Each figure is the median of
runs that take turns, in processor time: on a quiet machine that is the time on the clock (told beside), on a busy one it
leaves out the others' turns, though not what they take of memory and caches. The paced loop goes by the clock.

Eager PyTorch, where it is installed, steps the same network with `torch.nn.GRU` and its kept state, in float32 on one thread,
with the inverse matrices kept (and, for comparison, worked out in each frame, as the authors' code does).

``--endless`` makes 10⁶ frames instead, with the bundle that ships and with a hostile small network, and looks for what is not
finite, too large, or stands still.
"""

from __future__ import annotations

import platform
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from cospeech.audio.features.frames import audio_features
from cospeech.audio.features.reduce import reduce_audio
from cospeech.audio.speech import Speech
from cospeech.cli.demo import EXAMPLE
from cospeech.models import load
from cospeech.runtime.flow.engine import FlowEngine, StudentT
from cospeech.runtime.flow.graph import build_graphs
from cospeech.runtime.flow.weights import CODE, FlowSizes, pack_weights

PAPER = FlowSizes(
    pose=27, audio=29, steps=16, hidden=800, layers=2, history=12, speech_frames=13, nu=50, feature=32, blocks=5, channels=256
)
HOSTILE = FlowSizes(pose=9, audio=24, steps=2, hidden=16, layers=2, history=5, speech_frames=11, nu=50)
BOUND = 8.0  # deviations; poses of the training data lie within
FRAMES, ROUNDS = 8, 9  # of a run; runs of each kind


def random_arrays(s: FlowSizes, seed: int = 0, strength: float = 1.0) -> dict[str, np.ndarray]:
    """Weights as PyTorch draws them for recurrent and linear layers, the couplings' last layer too (times ``strength``)."""
    rng = np.random.default_rng(seed)
    edge = s.hidden**-0.5
    context = s.first_half + s.history * s.pose + s.speech_frames * s.audio + s.feature
    out: dict[str, np.ndarray] = {}

    def uniform(*shape: int, scale: float = edge) -> np.ndarray:
        return rng.uniform(-scale, scale, shape).astype(np.float32)

    for k in range(s.steps):
        at = f"flow.steps.{k}."
        for layer in range(s.layers):
            for name, shape in (("weight_ih", (s.gates, s.hidden if layer else context)), ("weight_hh", (s.gates, s.hidden))):
                out[f"{at}coupling.net.rnn.{name}_l{layer}"] = uniform(*shape)
                out[f"{at}coupling.net.rnn.{name.replace('weight', 'bias')}_l{layer}"] = uniform(s.gates)
        second_half = s.pose - s.first_half
        out |= {f"{at}coupling.net.out.weight": uniform(2 * second_half, s.hidden) * strength}
        out |= {f"{at}coupling.net.out.bias": uniform(2 * second_half) * strength}
        # a rotation times one near it: L U with unit diagonals, and signs all positive
        lower, upper = (np.tril(rng.normal(0, 0.1, (s.pose, s.pose)), -1).astype(np.float32) for _ in range(2))
        out |= {f"{at}mix.permutation": np.eye(s.pose, dtype=np.float32)[rng.permutation(s.pose)], f"{at}mix.lower": lower}
        out |= {f"{at}mix.upper": upper.T, f"{at}mix.sign": np.ones(s.pose, np.float32)}
        out |= {f"{at}mix.log_s": uniform(s.pose, scale=0.1), f"{at}norm.bias": uniform(s.pose, scale=0.1)}
        out |= {f"{at}norm.logs": uniform(s.pose, scale=0.1)}
    return out | (_encoder(s, uniform) if s.feature else {})


def _encoder(s: FlowSizes, uniform: Callable[..., np.ndarray]) -> dict[str, np.ndarray]:
    out: dict[str, np.ndarray] = {}
    shapes = {"first": (s.channels, 0, 4), "last": (CODE, s.channels, 4)}
    for side, width in (("poses", s.pose), ("speech", s.audio)):
        blocks = {f"blocks.{n}.conv": (s.channels, s.channels, 3) for n in range(s.blocks)}
        for name, (outputs, inputs, kernel) in (shapes | blocks).items():
            inputs = inputs or width
            norm = f"{name}_norm" if "." not in name else name.replace("conv", "norm")
            out[f"encoder.{side}.{name}.weight"] = uniform(outputs, inputs, kernel, scale=(inputs * kernel) ** -0.5)
            at = f"encoder.{side}.{norm}."
            out |= {f"{at}weight": np.ones(outputs, np.float32), f"{at}bias": uniform(outputs, scale=0.1)}
            out |= {f"{at}running_mean": uniform(outputs, scale=0.1), f"{at}running_var": np.ones(outputs, np.float32)}
    for number, (inputs, outputs) in {0: (2 * CODE, s.channels), 2: (s.channels,) * 2, 4: (s.channels, s.feature)}.items():
        out[f"encoder.full.{number}.weight"] = uniform(outputs, inputs, scale=inputs**-0.5)
        out[f"encoder.full.{number}.bias"] = uniform(outputs, scale=0.1)
    return out


def make_engine(arrays: dict[str, np.ndarray], sizes: FlowSizes) -> FlowEngine:
    weights = pack_weights(arrays, sizes)
    edge = np.full(sizes.pose, BOUND)
    return FlowEngine(sizes, weights, build_graphs(weights, sizes), -edge, edge)


class Material:
    """Random speech, histories and latents."""

    def __init__(self, s: FlowSizes, takes: int, frames: int, seed: int = 1) -> None:
        rng = np.random.default_rng(seed)
        self.audio = rng.normal(size=(frames + s.speech_frames - 1, s.audio)).astype(np.float32)
        self.history = rng.normal(size=(takes, s.history, s.pose)).astype(np.float32)
        self.z = rng.normal(size=(takes, frames, s.pose)).astype(np.float32)


def stepping(engine: FlowEngine, takes: int) -> Callable[[], object]:
    """One run of ``FRAMES`` frames, speech included."""
    material = Material(engine.sizes, takes, FRAMES)
    performance = engine.begin(material.history)
    windows = engine.windows(material.audio)
    return lambda: performance.frames(windows, material.z)


def eager(arrays: dict[str, np.ndarray], s: FlowSizes, *, keep_inverses: bool) -> Callable[[], object] | None:
    """The same network in PyTorch, frame by frame; None without PyTorch."""
    try:
        import torch

        from cospeech.models.stylised_flow import FlowConfig, StylisedFlow
    except ImportError:
        return None
    torch.set_num_threads(1)
    config = FlowConfig(
        steps=s.steps, hidden=s.hidden, layers=s.layers, history=s.history, look_ahead=s.speech_frames - s.history - 1,
        feature=s.feature, encoder_channels=s.channels, encoder_blocks=s.blocks,
    )  # fmt: skip
    model = StylisedFlow(config, pose=s.pose, audio=s.audio).eval()
    model.load_state_dict({name: torch.from_numpy(value) for name, value in arrays.items()}, strict=False)
    if keep_inverses:
        for step in model.flow.steps:
            step.mix.inverse = _kept(torch.linalg.inv(step.mix.weight().detach()).T.contiguous())
    material = Material(s, 1, FRAMES)
    z, history, audio = (torch.from_numpy(v) for v in (material.z, material.history, material.audio[None]))
    return lambda: model.sample(z, history, audio)


def _kept(inverse: Any) -> Callable[[Any], Any]:
    return lambda z: z @ inverse


def medians(runs: dict[str, Callable[[], object]], rounds: int = ROUNDS, frames: int = FRAMES) -> dict[str, float]:
    """Milliseconds of processor time a frame, runs taking turns; prints them with quickest and slowest, and beside the time on
    the clock.

    Args:
        runs: name → what is timed.
        rounds: turns of each.
        frames: of a run; 1: what is told is a whole run's time.
    """
    times: dict[str, list[tuple[float, float]]] = {name: [] for name in runs}
    for turn in range(rounds + 1):
        for name, run in runs.items():
            work, clock = time.process_time(), time.perf_counter()
            run()
            if turn:  # the first one warms up
                times[name].append((time.process_time() - work, time.perf_counter() - clock))
    result = {}
    for name, values in times.items():
        ms = np.array(values) * 1e3 / frames
        (result[name], clock), least, most = np.median(ms, 0).tolist(), ms[:, 0].min(), ms[:, 0].max()
        each = " a frame" if frames > 1 else ""
        print(f"        {name}: {result[name]:.4g} ms{each} ({least:.4g} … {most:.4g}; {clock:.4g} on the clock)")
    return result


def errors(engines: dict[bool, FlowEngine], frames: int = 30) -> tuple[float, float]:
    """Relative errors |int8 − float32| / |float32| of generated poses: a free run, and each frame after the true history."""
    s = engines[True].sizes
    material = Material(s, 1, frames, seed=2)
    free, stepwise = {}, {}
    for kind, engine in engines.items():
        windows = engine.windows(material.audio)
        free[kind] = engine.begin(material.history).frames(windows, material.z)
    truth = np.concatenate([material.history, free[False]], 1)
    for kind, engine in engines.items():
        windows = engine.windows(material.audio)
        takes = engine.begin(material.history)
        rows = []
        for t in range(frames):
            takes.history[:] = truth[:, t : t + s.history].reshape(1, -1)
            rows.append(takes.frames(windows[t : t + 1], material.z[:, t : t + 1]))
        stepwise[kind] = np.concatenate(rows, 1)
    return tuple(float(np.linalg.norm(x[True] - x[False]) / np.linalg.norm(x[False])) for x in (free, stepwise))  # type: ignore[return-value]


def paced(engine: FlowEngine, fps: float = 60.0, seconds: float = 10.0) -> tuple[float, float]:
    """Median and 99th percentile of milliseconds a frame in a loop that sleeps until each is due, as in a live show."""
    s, count = engine.sizes, int(fps * seconds)
    material = Material(s, 1, count)
    takes, windows = engine.begin(material.history), engine.windows(material.audio)
    times, due = [], time.perf_counter()
    for t in range(count):
        due += 1 / fps
        time.sleep(max(0.0, due - time.perf_counter()))
        began = time.perf_counter()
        takes.frames(windows[t : t + 1], material.z[:, t : t + 1])
        times.append((time.perf_counter() - began) * 1e3)
    return float(np.median(times)), float(np.percentile(times, 99))


def processor() -> str:
    """Name of the processor, and its extensions that matter here."""
    try:
        text = Path("/proc/cpuinfo").read_text(encoding="utf-8")
    except OSError:
        return platform.processor() or platform.machine()
    name = next((line.split(":")[1].strip() for line in text.splitlines() if line.startswith("model name")), platform.machine())
    extensions = [
        e for e in ("avx2", "avx512f", "avx512_vnni", "avx_vnni", "amx_int8") if f" {e} " in f"{text.replace(chr(10), ' ')} "
    ]
    return f"{name} ({', '.join(extensions)})"


def verdict(what: str, value: float, target: float, unit: str, *, at_least: bool = False) -> None:
    good = value >= target if at_least else value <= target
    print(f"  {'pass' if good else 'FAIL'}  {what}: {value:.3g}{unit} (target {'≥' if at_least else '≤'} {target:g}{unit})")


def paper_size() -> None:
    arrays = random_arrays(PAPER)
    engines = {int8: make_engine(arrays, replace(PAPER, int8=int8)) for int8 in (True, False)}
    runs = {
        "int8": stepping(engines[True], 1),
        "int8, 8 takes": stepping(engines[True], 8),
        "float32": stepping(engines[False], 1),
    }
    for name, keep in (("PyTorch eager, inverses kept", True), ("PyTorch eager, inverses each frame", False)):
        run = eager(arrays, PAPER, keep_inverses=keep)
        runs |= {name: run} if run else {}
    print("paper size (TED), random weights")
    ms = medians(runs)
    if "PyTorch eager, inverses kept" in ms:
        verdict("faster than PyTorch eager", ms["PyTorch eager, inverses kept"] / ms["int8"], 4, "×", at_least=True)
    else:
        print("  skip  faster than PyTorch eager: PyTorch is not installed")
    verdict("a frame", ms["int8"], 14, " ms")
    verdict("8 takes, in single ones", ms["int8, 8 takes"] / ms["int8"], 2.5, "×")
    free, stepwise = errors(engines)
    verdict("relative error of int8, 30 frames running free", 100 * free, 2, " %")
    verdict("relative error of int8, a frame after the true history", 100 * stepwise, 2, " %")


def shipped_size() -> None:
    engine = load("stylised-flow").system.flow  # type: ignore[attr-defined]  # a bundle
    print(f"the bundle that ships, K = {engine.sizes.steps}, {engine.sizes.hidden} units, {engine.sizes.pose} numbers a pose")
    ms = medians({"int8": stepping(engine, 1), "int8, 8 takes": stepping(engine, 8)}, rounds=60)
    verdict("a frame", ms["int8"], 0.6, " ms")
    middle, late = paced(engine)
    verdict(f"60 frames a second, paced (median {middle:.2f} ms): 99th percentile", late, 2, " ms")


def endless(frames: int) -> None:
    """Run a network with far too large weights on loud noise."""
    sizes = HOSTILE
    arrays = {name: v * (30 if "rnn" in name else 1) for name, v in random_arrays(sizes, strength=10).items()}
    engine = make_engine(arrays, sizes)
    draw, block = StudentT(sizes.pose, 1, seed=0), 1000
    takes = engine.begin(np.zeros((1, sizes.history, sizes.pose)))
    began, still = time.perf_counter(), 0
    for number in range(frames // block):
        audio = 100 * Material(sizes, 1, block, seed=number).audio
        poses = takes.frames(engine.windows(audio), draw.draw(block)[None])[0]
        if not np.isfinite(poses).all() or np.abs(poses).max() > BOUND:
            sys.exit(f"FAIL  frame {number * block} … : not finite or beyond the bounds")
        still += int((poses.std(0) < 1e-3).any())
    seconds = time.perf_counter() - began
    print(f"  {'pass' if not still else 'FAIL'}  {frames:,} frames of a hostile network: all finite and within bounds, "
          f"{still} of {frames // block} stretches stood still, {seconds:.0f} s")  # fmt: skip


def endless_speech(frames: int) -> None:
    """Run the bundle that ships on the example speech, over and over."""
    decoder = load("stylised-flow")
    system = decoder.system  # type: ignore[attr-defined]  # a bundle
    s, sizes = system.statistics, system.flow.sizes
    speech = Speech.load(EXAMPLE)
    rows = reduce_audio(audio_features(speech, int(speech.duration * system.fps), system.fps), system.audio)
    windows = system.flow.windows(np.concatenate([(rows - s.audio_mean) / s.audio_std] * 2))[: len(rows)]
    takes, draw = system.flow.begin(s.histories[:1], s.style_codes[:1]), StudentT(sizes.pose, sizes.nu, seed=0)
    spreads, began, total = [], time.perf_counter(), 0
    while total < frames:
        poses = np.concatenate([takes.frames(windows, draw.draw(len(windows))[None])[0] for _ in range(20)])
        if not np.isfinite(poses).all():
            sys.exit(f"FAIL  not finite before frame {total + len(poses)}")
        spreads.append(poses.std(0).mean())
        total += len(poses)
    first, last = np.mean(spreads[:5]), np.mean(spreads[-5:])
    verdict(f"deviation of the poses at the end of {total:,} frames, of that at the beginning ({first:.2f})", last / first, 0.8,
            "×", at_least=True)  # fmt: skip
    print(f"        least of all stretches {min(spreads):.2f}, most {max(spreads):.2f}; {time.perf_counter() - began:.0f} s")


def main() -> None:
    print(f"flow, one core of {processor()}, onnxruntime")
    if "--endless" in sys.argv:
        frames = next((int(a) for a in sys.argv[1:] if a.isdigit()), 1_000_000)
        endless_speech(frames)
        endless(frames)
        return
    shipped_size()
    paper_size()


if __name__ == "__main__":
    main()
