"""How fast a Chain of Generation plays on one core: ``python benchmarks/chain.py`` (needs the extra ``train``).

Networks of the sizes of the recipes with random weights; the speech is the example, over and over. What is timed is all that
`cospeech generate` does between samples and frames: features of speech, words, classifier, network, face (the rules with the
mouth that ships), smoothing, decoding at 30 frames per second.

* offline: ``chain_of_generation_humanoid.toml``, which is played in windows that hear both ways; a minute in one call;
* live: ``chain_live_humanoid.toml``, which is played frame by frame; a minute in pieces of 1/30 s, face, body and hands;
* the network of the paper's sizes, ``chain_of_generation_beat.toml``, in windows, alone.

Times are processor time: on a quiet machine that is the time on the clock, on a busy one it leaves out the turns of
others, though not what they take of memory and caches. Figures are the middle of several runs.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from math import inf
from typing import Any

import numpy as np
import torch
from flow import medians, processor, verdict
from mix_stage import BOUND, load, open_network, playing
from speed import resident

from cospeech.audio.features.reduce import audio_width
from cospeech.audio.features.shared_prosody import SharedProsody
from cospeech.audio.speech import RATE, Speech
from cospeech.cli.demo import EXAMPLE
from cospeech.motion.poses import find_pose
from cospeech.motion.poses.joints import hand_columns
from cospeech.rules import RuleBasedModel
from cospeech.rules.options import GenerationOptions
from cospeech.runtime.bundles.spec import VOICE
from cospeech.runtime.bundles.statistics import Statistics
from cospeech.runtime.conditioning import NOTHING
from cospeech.runtime.decoders import start_decoder
from cospeech.runtime.model import TrainedModel
from cospeech.runtime.motion_layers import LayerStack
from cospeech.runtime.mouth import open_default_mouth
from cospeech.runtime.session import ResolvedStyle, TrainedSession
from cospeech.runtime.speech_frontend import SpeechTextFrontend
from cospeech.runtime.styles.space import style_space
from cospeech.runtime.styles.style import Styles
from cospeech.runtime.system import System
from cospeech.training.checkpoint import network
from cospeech.training.export.onnx_export import export_graphs
from cospeech.training.recipe import SHIPPED, Recipe, build, load_recipe

SPEAKERS = 8
SECONDS, PIECE, FPS = 60.0, 1 / 30, 30.0
PARTS = ("face", "body", "hands")


def untrained(recipe: Recipe, **needs: Any) -> Any:
    """The network of a recipe."""
    kind, pose = network(recipe.model), find_pose(recipe.data.pose)
    sizes = {"pose": pose.dimensions, "audio": audio_width(recipe.data.audio), "speakers": SPEAKERS}
    torch.manual_seed(0)
    return kind(build(kind.Config, recipe.config, "model"), **sizes, hands=hand_columns(pose.names), text=0, **needs).eval()


def system_of(recipe: Recipe, net: Any) -> tuple[System, int]:
    """A bundle's contents, whose poses move by tenths; and the number of its parameters."""
    export = export_graphs(net.export_module())
    pose, audio = find_pose(recipe.data.pose).dimensions, audio_width(recipe.data.audio)
    d, a = np.ones(pose, np.float32), np.ones(audio, np.float32)
    words = (net.teacher if hasattr(net, "teacher") else net).word.table.weight.detach().numpy().copy()
    words[0] = 0
    statistics = Statistics(
        pose_mean=0 * d, pose_std=0.1 * d, audio_mean=-4 * a, audio_std=3 * a, pose_low=-BOUND * d, pose_high=BOUND * d,
        audio_low=-4 * a, audio_high=4 * a, speaker_mean=np.zeros((SPEAKERS, pose), np.float32), words=words,
    )  # fmt: skip
    styles, data = (*(f"speaker{k}" for k in range(SPEAKERS)), VOICE), recipe.data
    system = System(
        name="random", pose=data.pose, fps=data.fps, audio=data.audio, smooth=1, styles=styles, style=styles[0],
        style_space="speaker-emotion", controls=(), vocabulary=None, card="", statistics=statistics.complete(one_hot=True),
        networks={name: open_network(export, name, pose) for name in export.graphs},
    )  # fmt: skip
    return system, sum(value.size for value in export.weights.values())


def speech_of(seconds: float) -> Speech:
    """The example and its words, again and again, at 16 kHz."""
    example = Speech.load(EXAMPLE, rate=RATE)
    return Speech(np.resize(example.samples, int(seconds * RATE)), RATE)


class Timed:
    """Wraps an object with ``push`` and ``finish``; `taken` adds up the processor time of these calls."""

    def __init__(self, inner: Any) -> None:
        self._inner, self.taken = inner, 0.0

    def __getattr__(self, name: str) -> Any:
        return getattr(self._inner, name)

    def _measure_run(self, run: Callable[..., Any], *arguments: Any) -> Any:
        began = time.process_time()
        result = run(*arguments)
        result = list(result) if isinstance(result, Iterator) else result
        self.taken += time.process_time() - began
        return result

    def push(self, *arguments: Any) -> Any:
        return self._measure_run(self._inner.push, *arguments)

    def finish(self, *arguments: Any) -> Any:
        return self._measure_run(self._inner.finish, *arguments)


def by_part(system: System, speech: Speech) -> dict[str, float]:
    """Part → seconds of processor time for a whole speech, offline, built as by `TrainedModel.session`."""
    space = style_space(system)
    resolved_style = ResolvedStyle(Styles(system, space).blend(None), np.zeros(0))
    frontend = SpeechTextFrontend(system, resolved_style.controls)
    options = GenerationOptions(look_ahead=inf)
    decoder = start_decoder(system, space, resolved_style.blend, frontend.silence, options, NOTHING)
    face = RuleBasedModel(open_default_mouth).session(parts=("face",), fps=FPS, emotion=decoder.moods or "auto", aimed=False)
    prosody = SharedProsody()
    for each in (frontend, face):
        each.share(prosody)
    timers = {"features and words": Timed(frontend), "classifier and network": Timed(decoder), "face": Timed(face)}
    session: Any = TrainedSession(
        system,
        *list(timers.values())[:2],
        [timers["face"]],
        fps=FPS,
        parts=PARTS,
        resolved_style=resolved_style,
        direct=lambda style: resolved_style,
        layers=[LayerStack()],
        prosody=prosody,
    )  # type: ignore[arg-type]
    began = time.process_time()
    for chunk in speech.chunks(2.0):
        list(session.push(chunk))
    list(session.finish())
    whole = time.process_time() - began
    seconds = {name: each.taken for name, each in timers.items()}
    return seconds | {"smoothing and decoding": whole - sum(seconds.values()), "all": whole}


def live(gesturer: TrainedModel, speech: Speech, **options: Any) -> tuple[np.ndarray, np.ndarray, float]:
    """Milliseconds of every piece in processor time and on the clock; and the latency that is promised."""
    session = gesturer.session(fps=FPS, **options)
    work, clock = [], []
    for chunk in speech.chunks(PIECE):
        clock_start, work_start = time.perf_counter(), time.process_time()
        list(session.push(chunk))
        work.append((time.process_time() - work_start) * 1e3)
        clock.append((time.perf_counter() - clock_start) * 1e3)
    list(session.finish())
    return np.array(work[60:]), np.array(clock[60:]), session.latency  # two seconds on, all parts are at work


def eager(net: Any) -> Callable[[], object]:
    """One window by PyTorch."""
    inputs = [torch.randn(1, net.window, width) for width in (net.audio, net.styles, net.modes)]
    return torch.no_grad()(lambda: net.make(*inputs))


def report_live(gesturer: TrainedModel, speech: Speech) -> None:
    live(gesturer, speech.window(0, 5))
    for what, parts in (("face, body and hands", PARTS), ("body and hands", ("body", "hands"))):
        runs = [live(gesturer, speech, parts=parts) for _ in range(3)]
        middle, late = (float(np.median([np.percentile(run[0], share) for run in runs])) for share in (50, 99))
        most, clock = max(run[0].max() for run in runs), float(np.median([np.percentile(run[1], 99) for run in runs]))
        print(f"        live, {what}, a piece of {1e3 * PIECE:.0f} ms: {middle:.3g} ms, at most {most:.3g} ms; "
              f"99th percentile on the clock {clock:.3g} ms; latency {1e3 * runs[0][2]:.0f} ms")  # fmt: skip
        verdict(f"live, {what}, 99th percentile of a piece", late, 4, " ms")


def memory(gesturer: TrainedModel, minutes: int = 10) -> None:
    """Print the memory of this process over a long speech that comes in pieces of a second."""
    session, second, megabytes = gesturer.session(fps=FPS), speech_of(60), []
    for _ in range(minutes):
        for chunk in second.chunks(1.0):
            list(session.push(chunk))
        megabytes.append(resident())
    print(f"        memory after {1} and {minutes} minutes of speech: {megabytes[0]:.0f} and {megabytes[-1]:.0f} MB")
    verdict("memory that 9 more minutes take", megabytes[-1] - megabytes[0], 5, " MB")


def main() -> None:
    torch.set_num_threads(1)
    print(f"Chain of Generation, one core of {processor()}, onnxruntime; {load()}")
    recipes = {
        name: load_recipe(SHIPPED / f"{name}.toml", ["model.gain_augmentation=0"])
        for name in ("chain_of_generation_humanoid", "chain_live_humanoid")
    }
    teacher = untrained(recipes["chain_of_generation_humanoid"])
    net = untrained(recipes["chain_live_humanoid"], teacher=teacher)
    system, size = system_of(recipes["chain_live_humanoid"], net)
    gesturer, speech = TrainedModel(system), speech_of(SECONDS)
    print(
        f"        {size:,} parameters to play, of both networks and classifier, and {system.statistics.words.size:,} of words"
    )
    by_part(system, speech.window(0, 5))
    rounds = [by_part(system, speech) for _ in range(5)]
    factor = {name: float(np.median([each[name] for each in rounds])) / SECONDS for name in rounds[0]}
    for name, value in factor.items():
        print(f"        offline, {name}: real-time factor {value:.4f}")
    verdict("real-time factor, offline, everything but files", factor["all"], 0.01, "")
    report_live(gesturer, speech)
    large = load_recipe(SHIPPED / "chain_of_generation_beat.toml")
    paper = untrained(large)
    network = open_network(export_graphs(paper.export_module()), "make", find_pose(large.data.pose).dimensions)
    ms = medians({"a window, paper's size": playing(network, paper.window, 1), "by PyTorch eager": eager(paper)}, 15, 1)
    seconds = paper.window / large.data.fps
    parameters = sum(p.numel() for p in paper.parameters())
    print(f"        the paper's sizes, {parameters:,} parameters: a window of {paper.window} frames lasts {seconds:.2f} s")
    factor["paper"] = ms["a window, paper's size"] / 1e3 / (seconds / 2)
    print(f"        of which half are new; real-time factor of the network alone {factor['paper']:.4f}")
    verdict("faster than PyTorch eager", ms["by PyTorch eager"] / ms["a window, paper's size"], 1, "×", at_least=True)
    memory(gesturer)
    print(f"at the end: {load()}")


if __name__ == "__main__":
    main()
