"""Brings the channels of a trained face to the size that they have in tracked faces; `tools/build_weights.py` does it.

    python tools/calibrate_face.py RUN STORE

A network that is told to move moves too often where it is unsure. Here each weight of each speaker is stretched, ``max(0, g · y
− t)``: of all pairs whose standard deviation is one of `WANTED` of the tracked one, the pair with the least absolute error. The
floor t takes off what the network makes of noise; a face at rest stays at rest. Deviations are those of the validation split,
because a network moves more surely in what it was trained on; errors are those of training takes, too. RUN is changed.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import torch

from cospeech.audio.features.reduce import reduce_audio
from cospeech.corpora.store import Store
from cospeech.motion.skeletons.arkit import ARKIT, ARKIT_INDEX
from cospeech.training.checkpoint import load_run, read_tensors, write_tensors

STILL = 0.002  # [ours] standard deviation of a tracked channel that is left as it is
WANTED = (0.8, 0.9, 1.0)  # [ours] standard deviations, made ÷ tracked, that are tried: well within .6 to 1.3
ALONE = ("jawOpen",)
"""Left as they are: the jaw is good."""
MOST = 3.0  # [ours] no factor is larger: a lip that is sped up more jumps
FLOORS = np.array([0, 0.2, 0.4, 0.5, 0.6, 0.7, 0.8, 0.85, 0.9, 0.93, 0.95, 0.97, 0.98, 0.985, 0.99])  # [ours] quantiles
EVERY = 8  # [ours] of the training clips, every so many-th is played
FILE = "last.safetensors"


Side = tuple[np.ndarray, np.ndarray]
"""(frames,) of one channel: made, and tracked."""


def play(run: Path, store: Store) -> dict[str, list[Side]]:
    """Speaker → of training takes and of the validation split, where there are clips: made and tracked, (frames, 52) each."""
    net, facts = load_run(run, "last")
    names, found = list(facts["store"]["speakers"]), dict[str, list[Side]]()
    for name in names:
        for split, every in (("train", EVERY), ("validation", 1)):
            entries = [e for e in store.clips if e.speaker == name and e.split == split]
            clips = [
                _play(net, store.clip(e), names.index(name)) for e in entries[:: every if len(entries) > 10 * every else 1]
            ]
            if clips:
                made, real = (np.concatenate(side) for side in zip(*clips, strict=True))
                found.setdefault(name, []).append((made, real))
    return found


def _play(net: Any, clip: Any, speaker: int) -> Side:
    rows = torch.from_numpy(np.array(reduce_audio(np.asarray(clip["audio"]), "mel40"), np.float32))
    style = torch.eye(net.styles)[speaker][None, None]
    poses = net.generate((rows - net.audio_mean)[None] / net.audio_std, style)[0] * net.pose_std + net.pose_mean
    return np.clip(poses[:, : len(ARKIT)].numpy(), 0, 1), np.asarray(clip["pose"])[:, : len(ARKIT)]


def stretches(splits: list[Side]) -> np.ndarray:
    """(52, 2) g and t of every weight of one speaker; 1 and 0 where nothing is to be done."""
    found = np.tile([1.0, 0.0], (len(ARKIT), 1))
    for name in {name.removesuffix("Left").removesuffix("Right") for name in ARKIT} - {*ALONE}:
        both = [ARKIT_INDEX[n] for n in (name, f"{name}Left", f"{name}Right") if n in ARKIT_INDEX]
        sides = [[(made[:, k], real[:, k]) for k in both if real[:, k].std() > STILL] for made, real in splits]
        live = [each for each in sides if each and all(a.std() > 0 for a, _ in each)]
        if live:
            found[both] = stretch([side for each in live for side in each], live[-1])
    return found


def ratio(sides: list[Side], g: float, t: float) -> float:
    """Standard deviation, made ÷ tracked: geometric mean over sides."""
    return float(np.exp(np.mean([np.log(max(np.clip(g * a - t, 0, 1).std(), 1e-6) / b.std()) for a, b in sides])))


def stretch(sides: list[Side], held: list[Side]) -> tuple[float, float]:
    """g and t of one channel, by errors of ``sides`` and deviations of ``held``; 1 and 0 where no pair reaches that size."""
    best = (np.inf, 1.0, 0.0)
    for floor in np.unique(np.quantile(np.concatenate([a for a, _ in sides]), FLOORS)):
        for goal in WANTED:
            few, many = 0.02, MOST
            for _ in range(14):  # the deviation grows with g, as t is in units of g
                middle = (few * many) ** 0.5
                few, many = (middle, many) if ratio(held, middle, middle * floor) < goal else (few, middle)
            if ratio(held, many, many * floor) < 0.98 * goal:  # more than `MOST` would be needed
                continue
            error = sum(float(np.abs(np.clip(many * (a - floor), 0, 1) - b).mean() / b.std()) for a, b in sides)
            best = min(best, (error, many, many * floor))
    return best[1], best[2]


def calibrate(run: Path, store: Path) -> Iterator[str]:
    """Change the run's last weights; tells g and t of the channels that were stretched."""
    (net, facts), told = load_run(run, "last"), list[str]()
    factor, floor = torch.ones(net.styles, net.pose), torch.zeros(net.styles, net.pose)
    for name, splits in play(run, Store(store)).items():
        found = stretches(splits)
        row = facts["store"]["speakers"].index(name)
        factor[row, : len(ARKIT)], floor[row, : len(ARKIT)] = torch.from_numpy(found).float().unbind(1)
        told += [f"{name} {n} {g:.2f} {t:.3f}" for n, (g, t) in zip(ARKIT, found, strict=True) if (g, t) != (1, 0)]
    change = ((factor - 1) * net.pose_mean - floor) / net.pose_std
    tensors, state = read_tensors(run / FILE)
    for prefix in ("model.", "ema."):
        if f"{prefix}out.weight" in tensors:
            weight, bias = tensors[f"{prefix}out.weight"], tensors[f"{prefix}out.bias"]
            tensors[f"{prefix}out.weight"] = weight * factor.reshape(-1, 1, 1)
            tensors[f"{prefix}out.bias"] = factor.flatten() * bias + change.flatten()
    write_tensors(run / FILE, tensors, state)
    return iter(told)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("run", type=Path)
    parser.add_argument("store", type=Path)
    given = parser.parse_args()
    print(*calibrate(given.run, given.store), sep=", ")


if __name__ == "__main__":
    main()
