"""How fast Mix-StAGE plays and trains on one core: ``python benchmarks/mix_stage.py`` (needs the extra ``train``).

The paper's size (256 channels, five halvings, 8 sub-generators, 8 speakers, 96 numbers a pose, 64 bands of speech) with random
weights; speech, styles and the noise of the modes are normal noise. Played by onnxruntime in float32:

* offline, 10 s of speech at 15 frames per second in one pass: 150 frames, filled up to 160;
* live, as `cospeech.runtime.sliding_window_decoder.LIVE` has it: a window of 64 frames for every 4 that are new, paced as a
stage would.

The training step, discriminator and generator with Adam, 16 windows of 64 frames, is PyTorch's in float32, in float64, in which
the authors' code trains, and in the mixed precision of ``train.precision = "bfloat16"``.

Each figure is the median of runs that take turns, in processor time: on a quiet machine that is the time on the clock (told
beside), on a busy one it leaves out the others' turns, though not what they take of memory and caches. The paced loop goes by
the clock.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable

import numpy as np
import torch
from flow import medians, processor, verdict

from cospeech.models.mix_stage import MixStage, MixStageConfig
from cospeech.models.nn.objective import Batch, StepRandom
from cospeech.runtime.bundles.statistics import Statistics
from cospeech.runtime.network import Network
from cospeech.runtime.sliding_window_decoder import SlidingWindowDecoder, live
from cospeech.runtime.styles.space import style_space
from cospeech.runtime.styles.track import StyleTrack
from cospeech.runtime.system import System
from cospeech.training.export.onnx_export import Exported, export_graphs

POSE, AUDIO, SPEAKERS, FPS = 96, 64, 8, 15.0
SECONDS, FRAMES = 10.0, 160
ROWS = 16  # windows of a training step; authors' code
BOUND = 8.0  # deviations; poses of the training data lie within


def paper_size() -> MixStage:
    torch.manual_seed(0)
    return MixStage(MixStageConfig(), pose=POSE, audio=AUDIO, speakers=SPEAKERS)


def open_network(export: Exported, name: str, pose: int) -> Network:
    """One network of an export, whose poses have so many numbers."""
    edge = np.full(pose, BOUND)
    return Network(export.signatures[name], export.graphs[name], export.weights, {"poses": (-edge, edge)})


def system_of(network: Network) -> System:
    """The parts of a bundle that a decoder needs."""
    zeros, ones = np.zeros(POSE, np.float32), np.ones(POSE, np.float32)
    silence, loud = np.zeros(AUDIO, np.float32), np.ones(AUDIO, np.float32)
    statistics = Statistics(
        pose_mean=zeros, pose_std=ones, audio_mean=silence, audio_std=loud, pose_low=-BOUND * ones, pose_high=BOUND * ones,
        audio_low=-BOUND * loud, audio_high=BOUND * loud, speaker_mean=np.zeros((SPEAKERS, POSE), np.float32),
    )  # fmt: skip
    names = tuple(f"speaker{k}" for k in range(SPEAKERS))
    return System(
        name="random", pose="keypoints2d", fps=FPS, audio="mel64", smooth=1, styles=names, style=names[0],
        style_space="one-hot", controls=(), vocabulary=None, card="", statistics=statistics.complete(one_hot=True),
        networks={"make": network},
    )  # fmt: skip


def playing(network: Network, frames: int, takes: int) -> Callable[[], object]:
    """One pass over so many frames of speech."""
    rng, sizes = np.random.default_rng(0), {"N": takes, "T": frames}
    shapes = {name: tuple(sizes.get(size, size) for size in port) for name, port in network.signature.inputs.items()}
    inputs = {name: rng.normal(size=shape).astype(np.float32) for name, shape in shapes.items()}
    return lambda: network.run(**inputs)


def paced(network: Network, seconds: float = 20.0) -> tuple[float, float, float, int]:
    """Milliseconds a frame in processor time, milliseconds of a window on the clock (median and 99th percentile), frames a
    window: a loop that sleeps until the next frames of speech are due."""
    system, setting = system_of(network), live(network.signature)
    space, silence = style_space(system), np.zeros((1, AUDIO), np.float32)
    style = StyleTrack(system, space, ((1.0, space.by_name(system.style)),), [0])
    decoder = SlidingWindowDecoder(system, network, style, [0], silence, setting)
    rows = np.random.default_rng(0).normal(size=(int(seconds * FPS), AUDIO)).astype(np.float32)
    work, clock, due = [], [], time.perf_counter()
    for first in range(0, len(rows) - setting.hop + 1, setting.hop):
        due += setting.hop / FPS / 4  # four times as fast as people speak: as demanding, and over sooner
        time.sleep(max(0.0, due - time.perf_counter()))
        clock_start, work_start = time.perf_counter(), time.process_time()
        poses = decoder.push(rows[first : first + setting.hop])
        if poses.shape[1]:
            work.append((time.process_time() - work_start) * 1e3)
            clock.append((time.perf_counter() - clock_start) * 1e3)
    late = float(np.percentile(clock, 99))
    return float(np.median(work)) / setting.hop, float(np.median(clock)), late, setting.hop


def training(dtype: torch.dtype, *, mixed_precision: bool = False) -> Callable[[], object]:
    """One step, as `cospeech.training.train.train` takes it."""
    net = paper_size().to(dtype).train()
    objectives = net.objectives()
    movers = {name: torch.optim.Adam(list(objective.parameters), 1e-4) for name, objective in objectives.items()}
    draw = torch.Generator().manual_seed(1)
    frames = net.window
    arrays = {
        "pose": torch.randn(ROWS, frames, POSE, generator=draw).to(dtype),
        "audio": torch.randn(ROWS, frames, AUDIO, generator=draw).to(dtype),
        "cluster": torch.randint(net.config.modes, (ROWS, frames), generator=draw),
        "speaker": torch.arange(ROWS) % SPEAKERS,
    }

    def step() -> None:
        for name, objective in objectives.items():
            movers[name].zero_grad()
            with torch.autocast("cpu", torch.bfloat16, enabled=mixed_precision):
                terms = objective.loss(Batch(arrays, StepRandom(0, 0)), 0)
                total = torch.stack(list(terms.values())).sum()
            total.backward()
            movers[name].step()

    return step


def eager(net: MixStage) -> Callable[[], object]:
    """The pass of `playing`, by PyTorch."""
    speech, style, mode_noise = (torch.randn(1, FRAMES, width) for width in (AUDIO, SPEAKERS, net.modes))
    return torch.no_grad()(lambda: net.make(speech, style, mode_noise))


def load() -> str:
    """How busy the machine is: processes that want a core, over the last minute."""
    return f"{os.getloadavg()[0]:.1f} processes on {os.cpu_count()} cores"


def main() -> None:
    torch.set_num_threads(1)
    print(f"Mix-StAGE of the paper's size, one core of {processor()}, onnxruntime; {load()}")
    net = paper_size().eval()
    export = export_graphs(net.export_module())
    network = open_network(export, "make", POSE)
    size = sum(value.size for value in export.weights.values())
    print(f"        {sum(p.numel() for p in net.parameters()):,} parameters, {size:,} of them to play; "
          f"a frame hears {network.signature.reach} frames to either side")  # fmt: skip
    runs = {"10 s offline": playing(network, FRAMES, 1), "8 takes": playing(network, FRAMES, 8)}
    runs |= {"a window of 64 frames": playing(network, 64, 1), "10 s by PyTorch eager": eager(net)}
    ms = medians(runs, 15, 1)
    verdict("real-time factor, 10 s offline, float32", ms["10 s offline"] / 1e3 / SECONDS, 0.006, "")
    verdict("faster than PyTorch eager", ms["10 s by PyTorch eager"] / ms["10 s offline"], 1, "×", at_least=True)
    print(f"        8 takes cost {ms['8 takes'] / ms['10 s offline']:.2f} times one")
    each, middle, late, hop = paced(network)
    print(f"        live: {each:.3g} ms a frame; a window of {hop} new frames takes {middle:.3g} ms on the clock, "
          f"99th percentile {late:.3g} ms, and has {1e3 * hop / FPS:.0f} ms")  # fmt: skip
    verdict("live, 99th percentile of a window, of the time that its frames last", 100 * late / (1e3 * hop / FPS), 100, " %")
    print(f"training step; {load()}")
    runs = {"float32": training(torch.float32), "float64": training(torch.float64)}
    ms = medians(runs | {"bfloat16, mixed": training(torch.float32, mixed_precision=True)}, 5, 1)
    verdict("float32 faster than float64", ms["float64"] / ms["float32"], 3, "×", at_least=True)
    verdict("bfloat16 faster than float64", ms["float64"] / ms["bfloat16, mixed"], 3, "×", at_least=True)


if __name__ == "__main__":
    main()
