"""Brings the channels of a trained face to the size that they have in tracked faces; `tools/build_weights.py` does it.

    python tools/calibrate_face.py RUN STORE OUT

A network that is told to move moves too often where it is unsure. Here each weight of each speaker is stretched, ``max(0, g · y
− t)``: of all pairs that bring its standard deviation to a share of the tracked one, the pair with the least absolute error.
The floor t takes off what the network makes of noise; a face at rest stays at rest. The share is the middle of the range that
`tools/measure_face.py` counts. Channels that few clips move need that most: a new take may have more of them or less.

The made deviation is that of the validation split, because a network moves more surely in what it was trained on. The tracked
one is that of the training takes and the validation split together, because most channels move in few clips, and few clips
tell a deviation badly. Where the validation split surely differs from the training takes (the 95 % intervals of both over clips
do not overlap), its own counts: a take by itself has a manner of its own, and a new take is more like it. The test split takes
no part. OUT is a copy of RUN with other last weights; RUN stays as it is.
"""

from __future__ import annotations

import argparse
import shutil
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from measure_face import LIVE, RATIO, deviation, moments

from cospeech.audio.features.reduce import reduce_audio
from cospeech.corpora.store import Store
from cospeech.motion.skeletons.arkit import ARKIT, ARKIT_INDEX
from cospeech.training.checkpoint import load_run, read_tensors, write_tensors
from cospeech.training.objective_optimiser import with_prefix

MIDDLE = (RATIO[0] * RATIO[1]) ** 0.5  # [ours] of the tracked standard deviation is what a channel is brought to, .88
ALONE = ("jawOpen",)
"""Channels that do not change: the jaw is good."""
MOST = 3.0  # [ours] no factor is larger: a lip that is sped up more jumps
FLOORS = np.array([0, 0.2, 0.4, 0.5, 0.6, 0.7, 0.8, 0.85])  # [ours] quantiles; beyond them, few frames are left
EVERY = 8  # [ours] every eighth training clip is played, where there are more than 80
DRAWS, ENDS = 400, (0.025, 0.975)  # [ours] of the bootstrap over clips, and the ends of its interval
FILE = "last.safetensors"


@dataclass(frozen=True, eq=False)
class Takes:
    """Tracked faces of one speaker in a split, and the faces that the network generates for them."""

    tracked: np.ndarray
    """(clips, 3, 52) `measure_face.moments` of all clips."""
    generated: np.ndarray
    """(frames, 52) of the clips that were played."""
    real: np.ndarray
    """(frames, 52) tracked, of the same clips."""


def play(run: Path, store: Store) -> dict[str, dict[str, Takes]]:
    """Play clips by a run: speaker → "train" and "validation", where there are clips → takes."""
    net, facts = load_run(run, "last")
    names, takes = list(facts["store"]["speakers"]), dict[str, dict[str, Takes]]()
    for name in names:
        for split, every in (("train", EVERY), ("validation", 1)):
            clips = [store.clip(e) for e in store.clips if e.speaker == name and e.split == split]
            if clips:
                sums = np.stack([moments(np.asarray(clip["pose"])[:, : len(ARKIT)]) for clip in clips])
                sample = clips[:: every if len(clips) > 10 * every else 1]
                pairs = [_play(net, clip, names.index(name)) for clip in sample]
                generated, real = (np.concatenate(side) for side in zip(*pairs, strict=True))
                takes.setdefault(name, {})[split] = Takes(sums, generated, real)
    return takes


def _play(net: Any, clip: Any, speaker: int) -> tuple[np.ndarray, np.ndarray]:
    rows = torch.from_numpy(np.array(reduce_audio(np.asarray(clip["audio"]), "mel40"), np.float32))
    style = torch.eye(net.styles)[speaker][None, None]
    poses = net.generate((rows - net.audio_mean)[None] / net.audio_std, style)[0] * net.pose_std + net.pose_mean
    return np.clip(poses[:, : len(ARKIT)].numpy(), 0, 1), np.asarray(clip["pose"])[: len(poses), : len(ARKIT)]


def interval(rows: np.ndarray) -> np.ndarray:
    """(clips, 3, 52) moments → (2, 52) of the deviation: percentile bootstrap over clips."""
    chance, clips = np.random.default_rng(0), len(rows)
    draws = [deviation(rows[chance.integers(0, clips, clips)]) for _ in range(DRAWS)]
    return np.asarray(np.quantile(draws, ENDS, axis=0))


def aims(splits: dict[str, Takes]) -> np.ndarray:
    """(52,) target deviation of each channel; 0 for channels that do not change."""
    sums = np.concatenate([takes.tracked for takes in splits.values()])
    targets = deviation(sums)
    if len(splits) > 1:
        own = deviation(splits["validation"].tracked)
        (low, high), (least, most) = (interval(splits[name].tracked) for name in ("train", "validation"))
        targets = np.where(((least > high) | (most < low)) & (own > LIVE), own, targets)
    return np.where(targets > LIVE, MIDDLE * targets, 0.0)


def stretches(splits: dict[str, Takes]) -> np.ndarray:
    """(52, 2) g and t of every weight of one speaker; 1 and 0 for weights that do not change."""
    factors, targets = np.tile([1.0, 0.0], (len(ARKIT), 1)), aims(splits)
    for name in {name.removesuffix("Left").removesuffix("Right") for name in ARKIT} - {*ALONE}:
        both = [ARKIT_INDEX[n] for n in (name, f"{name}Left", f"{name}Right") if n in ARKIT_INDEX]
        live = [k for k in both if targets[k] > 0]
        if live:
            factors[both] = stretch([*splits.values()], live, targets)
    return factors


def ratio(weights: np.ndarray, targets: np.ndarray, g: float, t: float) -> float:
    """Standard deviation of stretched weights (frames, sides), divided by the targets: geometric mean over sides."""
    return float(np.exp(np.mean(np.log(np.maximum(np.clip(g * weights - t, 0, 1).std(0), 1e-6) / targets))))


def stretch(takes: list[Takes], sides: list[int], aim: np.ndarray) -> tuple[float, float]:
    """g and t of one channel with these sides: least error over all takes, target size in the last; 1 and 0 if none fit."""
    best, targets, weights = (np.inf, 1.0, 0.0), aim[sides], takes[-1].generated[:, sides]
    for floor in np.unique(np.quantile(np.concatenate([each.generated[:, sides] for each in takes]), FLOORS)):
        few, many = 0.02, MOST
        for _ in range(14):  # the deviation grows with g, as t is in units of g
            middle = (few * many) ** 0.5
            few, many = (middle, many) if ratio(weights, targets, middle, middle * floor) < 1 else (few, middle)
        if ratio(weights, targets, many, many * floor) < 0.98:  # more than `MOST` would be needed
            continue
        pairs = [(each.generated[:, sides], each.real[:, sides]) for each in takes]
        error = sum(float((np.abs(np.clip(many * (a - floor), 0, 1) - b).mean(0) / targets).sum()) for a, b in pairs)
        best = min(best, (error, many, many * floor))
    return best[1], best[2]


def calibrate(run: Path, store: Path, out: Path) -> Iterator[str]:
    """Write ``out``, a copy of a run with calibrated last weights; a line with g and t of each channel that was stretched."""
    (net, facts), lines = load_run(run, "last"), list[str]()
    factor, floor = torch.ones(net.styles, net.pose), torch.zeros(net.styles, net.pose)
    for name, splits in play(run, Store(store)).items():
        pairs = stretches(splits)
        row = facts["store"]["speakers"].index(name)
        factor[row, : len(ARKIT)], floor[row, : len(ARKIT)] = torch.from_numpy(pairs).float().unbind(1)
        lines += [f"{name} {n} {g:.2f} {t:.3f}" for n, (g, t) in zip(ARKIT, pairs, strict=True) if (g, t) != (1, 0)]
    change = ((factor - 1) * net.pose_mean - floor) / net.pose_std
    tensors, state = read_tensors(run / FILE)
    for prefix in ("model.", "ema."):
        if f"{prefix}out.weight" in tensors:
            weight, bias = tensors[f"{prefix}out.weight"], tensors[f"{prefix}out.bias"]
            tensors[f"{prefix}out.weight"] = weight * factor.reshape(-1, 1, 1)
            tensors[f"{prefix}out.bias"] = factor.flatten() * bias + change.flatten()
    shutil.copytree(run, out, dirs_exist_ok=True)
    write_tensors(out / FILE, tensors, state)
    average = with_prefix("model.", tensors) | with_prefix("ema.", tensors)
    write_tensors(out / "best.safetensors", average, {"step": state["step"], "best": state["best"]})  # what a bundle is made of
    return iter(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    for name in ("run", "store", "out"):
        parser.add_argument(name, type=Path)
    options = parser.parse_args()
    print(*calibrate(options.run, options.store, options.out), sep=", ")


if __name__ == "__main__":
    main()
