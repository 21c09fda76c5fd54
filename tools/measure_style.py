"""Compares the ways of style transfer (`cospeech.runtime.style`) on a bundle, and writes the table of docs/styles.md.

    python tools/measure_style.py BUNDLE.cospeech --store STORE --raw CORPUS [--write]

Ten seconds of a held-out recording of each of five speakers are the examples; each is played on the same held-out speeches of
other people, 20 s each. A classifier of speakers, trained here on the recordings of the training split, hears nothing and sees
windows of 4 s; the windows of a performance vote, but for its first two seconds, which the example's own poses begin. Needs
torch (the extra ``train``).
"""

from __future__ import annotations

import argparse
import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import torch
from torch import nn

from cospeech.corpora.clip import Clip
from cospeech.corpora.store import Store, gather
from cospeech.evaluation import sample_of, stored_clips
from cospeech.metrics import Tools, load_metric
from cospeech.metrics.movement import Track, wrist_speeds
from cospeech.motion import Motion
from cospeech.poses import find_pose
from cospeech.runtime.bundle import read_bundle
from cospeech.runtime.flow_bundle import FlowSystem, open_flow
from cospeech.runtime.manner import named
from cospeech.runtime.performance import PIECE, Performance, Source
from cospeech.runtime.style import Blend, CodeSource, NormalSource, SegmentSource, Styles, Transfer, best_transfer
from cospeech.speech import Speech

PAGE = Path(__file__).parents[1] / "docs" / "styles.md"
BLOCK = re.compile(r"(<!-- measured -->\n).*?(<!-- end -->)", re.S)
SPEAKERS, SPEECHES, EXAMPLE, TALK, WARM = 5, 12, 10.0, 20.0, 2.0  # the last three in seconds
WINDOW, STEPS, BATCH, NOISE = 4.0, 1000, 64, 0.1  # seconds, optimiser steps, windows, standardised
PARTS = ("body", "hands")


class Silent:
    """A face that nobody looks at."""

    def __init__(self) -> None:
        self.emotion: dict[str, float] = {}

    def push(self, chunk: Speech) -> list[Motion]:
        return []

    def finish(self) -> list[Motion]:
        return []


class Moments(nn.Module):
    """(B, C, T) → (B, 2 C): mean and deviation over time."""

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        return torch.cat([x.mean(-1), (x.var(-1) + 1e-6).sqrt()], 1)


class Judge:
    """Tells speakers by how they move.

    Args:
        store: its training split teaches, with the poses of the bundle.
        seed: of everything random.
    """

    def __init__(self, store: Store, seed: int = 0) -> None:
        torch.manual_seed(seed)
        self.store, self.frames = store, round(WINDOW * store.fps)
        mean, std = store.statistics("pose")
        self._mean, self._std = mean, np.maximum(std, 0.02)
        width = 64
        layers = (*self._layer(len(mean), width), *self._layer(width, width), *self._layer(width, width))
        self._net = nn.Sequential(*layers, Moments(), nn.Linear(2 * width, len(store.speakers)))
        self._learn(np.random.default_rng(seed))

    @staticmethod
    def _layer(inputs: int, width: int) -> list[nn.Module]:
        return [nn.Conv1d(inputs, width, 4, 2, 1), nn.BatchNorm1d(width), nn.ReLU(), nn.Dropout(0.2)]

    def _seen(self, poses: np.ndarray) -> torch.Tensor:
        return torch.from_numpy(((poses - self._mean) / self._std).astype(np.float32)).mT

    def _learn(self, rng: np.random.Generator) -> None:
        numbers, offsets, counts = self.store.starts(self.frames, "train", ("pose",))
        labels = np.array([self.store.speakers.index(self.store.clips[k].speaker) for k in numbers])
        ends = np.cumsum(counts)
        optimiser = torch.optim.Adam(self._net.parameters(), 1e-3)
        for _ in range(STEPS):
            drawn = rng.integers(0, ends[-1], BATCH)
            clip = np.searchsorted(ends, drawn, "right")
            starts = offsets[clip] + drawn - (ends[clip] - counts[clip])
            seen = self._seen(gather(self.store.arrays["pose"], starts, self.frames))
            guess = self._net(seen + NOISE * torch.randn_like(seen))
            loss = nn.functional.cross_entropy(guess, torch.from_numpy(labels[clip]))
            optimiser.zero_grad()
            loss.backward()
            optimiser.step()
        self._net.eval()

    def votes(self, motion: Motion) -> np.ndarray:
        """(S,) mean log-probability of each speaker over the windows after the first seconds."""
        poses = find_pose(self.store.pose).encode(motion)
        starts = range(round(WARM * self.store.fps), len(poses) - self.frames + 1, self.frames // 4)
        with torch.no_grad():
            seen = torch.cat([self._seen(poses[None, start : start + self.frames]) for start in starts])
            return self._net(seen).log_softmax(1).mean(0).numpy()


def movement(motion: Motion) -> np.ndarray:
    """Mean speed of the wrists in m/s, and how far they stray from their mean place, in m."""
    track = Track.of(motion)
    away = (track.wrists - track.wrists.mean(0))[round(WARM * motion.fps) :]
    return np.array([wrist_speeds(track).mean(), np.sqrt(np.square(away).sum(-1).mean())])


def perform(system: FlowSystem, speech: Speech, sources: Sequence[Source]) -> list[Motion]:
    """A performance of each source in one pass, without faces."""
    controls = np.zeros(len(system.controls), np.float32)
    faces = [Silent() for _ in sources]
    playing = Performance(system, sources, faces, fps=system.fps, intensity=1.0, parts=PARTS, controls=controls)  # type: ignore[arg-type]
    pieces = [made for chunk in speech.chunks(PIECE) for made in playing.push_takes(chunk)]
    pieces += playing.finish_takes()
    return [Motion.concatenate(take) for take in zip(*pieces, strict=True)]


def played(
    system: FlowSystem, transfer: Callable[..., Source], blends: dict[str, Blend], speeches: Sequence[Speech]
) -> dict[str, list[Motion]]:
    """Speaker → the performances of all speeches; every performance has a seed of its own."""
    made: dict[str, list[Motion]] = {name: [] for name in blends}
    for number, speech in enumerate(speeches):
        seeds = range(number * len(blends), (number + 1) * len(blends))
        sources = [transfer(system, blend, seed=seed) for seed, blend in zip(seeds, blends.values(), strict=True)]
        for name, motion in zip(made, perform(system, speech, sources), strict=True):
            made[name].append(motion)
    return made


class Begun(CodeSource):
    """A control: the default style, which only begins with the example's poses."""

    def __init__(self, system: FlowSystem, blend: Blend, *, seed: int, temperature: float = 1.0) -> None:
        super().__init__(system, blend, seed=seed, temperature=temperature)
        plain = named(system, system.style)
        self.style, self.centre, self.spread = plain.code, plain.centre, plain.spread


class Posed(CodeSource):
    """The example's mean pose and deviation alone, with the code of the default style."""

    def __init__(self, system: FlowSystem, blend: Blend, *, seed: int, temperature: float = 1.0) -> None:
        super().__init__(system, blend, seed=seed, temperature=temperature)
        self.style = named(system, system.style).code


def row(judge: Judge, played_for: dict[str, list[Clip]], examples: dict[str, Motion]) -> list[str]:
    """Recognised, recognised among the five, beat alignment, speed and reach against the example.

    Args:
        judge: of speakers.
        played_for: speaker → the speeches, with the motion that was made for them in that speaker's style.
        examples: speaker → example.
    """
    names = judge.store.speakers
    five = [names.index(name) for name in played_for]
    right, right_of_five, ratios = [], [], []
    for name, clips in played_for.items():
        for clip in clips:
            assert clip.motion is not None
            votes = judge.votes(clip.motion)
            right.append(names[int(votes.argmax())] == name)
            right_of_five.append(names[five[int(votes[five].argmax())]] == name)
            ratios.append(np.log(movement(clip.motion) / movement(examples[name])))
    samples = [sample_of(clip) for clips in played_for.values() for clip in clips]
    score = load_metric("beat_align")(samples, samples, Tools(seed=0))
    low, high = score.interval or (np.nan, np.nan)
    mean, spread = np.exp(np.mean(ratios, 0)), np.std(ratios, 0)
    return [
        f"{np.mean(right):.0%}", f"{np.mean(right_of_five):.0%}", f"{score.value:.3f} ({low:.3f} … {high:.3f})",
        f"× {mean[0]:.2f} ± {spread[0]:.2f}", f"× {mean[1]:.2f} ± {spread[1]:.2f}",
    ]  # fmt: skip


def held_out(clips: Sequence[Clip], seconds: float) -> list[Clip]:
    return [clip for clip in clips if clip.motion is not None and clip.motion.duration >= seconds and clip.speech is not None]


def examples_of(clips: Sequence[Clip], speakers: Sequence[str]) -> dict[str, Motion]:
    """Ten seconds from each speaker's longest held-out recording."""
    found: dict[str, Motion] = {}
    for name in speakers:
        own = sorted((c for c in held_out(clips, EXAMPLE + 1) if c.speaker == name), key=lambda c: -len(c.motion or ()))
        if own and own[0].motion is not None:
            fps = own[0].motion.fps
            found[name] = own[0].motion[round(fps / 2) : round(fps / 2) + round(EXAMPLE * fps)]
    return found


def compare(system: FlowSystem, store: Store, clips: Sequence[Clip], seed: int) -> list[list[str]]:
    """The rows of the table."""
    judge = Judge(store, seed)
    examples = dict(list(examples_of(clips, store.speakers).items())[:SPEAKERS])
    talks = [
        replace(c, speech=c.speech.window(c.speech.start, c.speech.start + TALK))
        for c in held_out(clips, TALK + 1)[:SPEECHES]
        if c.speech is not None
    ]
    speeches = [clip.speech for clip in talks if clip.speech is not None]
    print(f"{len(examples)} speakers, {len(speeches)} speeches of {', '.join(sorted({c.speaker for c in talks}))}")
    known = Styles(system)
    shown = {name: known.blend(motion) for name, motion in examples.items()}
    halves = {name: known.blend({motion: 0.5}) for name, motion in examples.items()}
    by_name = {name: known.blend(name) for name in examples if name in system.styles}
    ways: dict[str, tuple[Transfer, dict[str, Blend]]] = {
        "default style": (CodeSource, {name: known.blend(None) for name in examples}),
        "begins like the example": (Begun, shown),
        "latents: in order, then stretches (paper)": (partial(SegmentSource, coded=False), shown),
        "latents: mean and covariance": (partial(NormalSource, coded=False), shown),
        "mean and deviation of the poses": (Posed, shown),
        "style code": (CodeSource, shown),
        "style code; latents: in order, then stretches": (SegmentSource, shown),
        "style code; latents: mean and covariance": (NormalSource, shown),
        "half way to the example": (best_transfer(system), halves),
        "speaker by name": (best_transfer(system), by_name),
    }
    if not system.engine.sizes.style:
        ways = {name: way for name, way in ways.items() if "code" not in name}
    if system.statistics.spreads.size:
        ways = {name.replace("style code", "poses, style code"): way for name, way in ways.items()}
    else:
        del ways["mean and deviation of the poses"]
    own = {name: [c for c in held_out(clips, WARM + WINDOW + 1) if c.speaker == name] for name in examples}
    fewest = min(map(len, own.values()))
    rows = [["recordings of the five", *row(judge, {name: found[:fewest] for name, found in own.items()}, examples)]]
    print(*rows[0], sep="  ", flush=True)
    for name, (transfer, blends) in ways.items():
        made = played(system, transfer, blends, speeches)
        as_clips = {who: [replace(c, motion=m) for c, m in zip(talks, motions, strict=True)] for who, motions in made.items()}
        rows.append([name, *row(judge, as_clips, examples)])
        print(*rows[-1], sep="  ", flush=True)
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("bundle", type=Path)
    parser.add_argument("--store", type=Path, required=True)
    parser.add_argument("--raw", type=Path, required=True)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--write", action="store_true", help="put the table into docs/styles.md")
    chosen = parser.parse_args()
    torch.set_num_threads(1)
    system, store = open_flow(read_bundle(chosen.bundle)), Store(chosen.store)
    clips = [clip for split in ("test", "validation") for clip in stored_clips(chosen.store, split=split, raw=chosen.raw)]
    rows = compare(system, store, clips, chosen.seed)
    head = ["", f"recognised of {len(store.speakers)}", f"of {SPEAKERS}", "beat alignment", "speed", "reach"]
    lines = ["| " + " | ".join(cells) + " |" for cells in [head, ["---"] * len(head), *rows]]
    print("\n".join(lines))
    if chosen.write:
        text = "\n".join(lines)
        PAGE.write_text(BLOCK.sub(lambda m: f"{m[1]}{text}\n{m[2]}", PAGE.read_text("utf-8")), "utf-8")


if __name__ == "__main__":
    main()
