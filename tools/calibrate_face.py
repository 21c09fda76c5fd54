"""Brings the channels of a trained face to the size that they have in tracked faces; `tools/build_weights.py` does it.

    python tools/calibrate_face.py RUN STORE

A regression makes small what it is unsure of. Here each weight of the last step's network is stretched, ``max(0, g · y −
t)``: of all pairs whose standard deviation on the validation split is `WANTED` of the tracked one, the pair with the least
absolute error. The floor t takes off what the factor g makes of noise; a face at rest stays at rest. Channels that do not
correlate with the tracked ones, and those that move enough, stay as they are. RUN is changed.
"""

from __future__ import annotations

import argparse
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import torch

from cospeech.audio.features.reduce import reduce_audio
from cospeech.corpora.store import Store
from cospeech.motion.skeletons.arkit import ARKIT, ARKIT_INDEX
from cospeech.training.checkpoint import load_run, read_tensors, write_tensors

LIVE = 0.005  # standard deviation of a tracked channel that moves
ALIKE = 0.2  # [ours] correlation from which a channel is one and the same in both
WANTED = (0.70, 1.10)  # [ours] standard deviation, made ÷ tracked, that a channel is brought to, from below and from above
ALONE = ("jawOpen", "mouthSmile", "mouthDimple")
"""Left as they are: the jaw is good, and smiles follow the mood, not the sound."""
MOST = 3.0  # [ours] no factor is larger
FLOORS = np.linspace(0.0, 0.75, 16)  # [ours] of a channel's 0.98 quantile, made
FILE = "last.safetensors"


def pairs(run: Path, store: Store) -> dict[str, list[tuple[np.ndarray, np.ndarray]]]:
    """Speaker → clips of the validation split, made and tracked, (T, 52) each."""
    net, facts = load_run(run, "last")
    names, found = list(facts["store"]["speakers"]), defaultdict(list)
    for entry in store.clips:
        if entry.split != "validation" or entry.speaker not in names:
            continue
        clip = store.clip(entry)
        rows = torch.from_numpy(np.array(reduce_audio(np.asarray(clip["audio"]), "mel40"), np.float32))
        style = torch.eye(len(names))[names.index(entry.speaker)][None, None]
        poses = net.generate((rows - net.audio_mean)[None] / net.audio_std, style)[0] * net.pose_std + net.pose_mean
        found[entry.speaker].append((np.clip(poses[:, : len(ARKIT)].numpy(), 0, 1), np.asarray(clip["pose"])[:, : len(ARKIT)]))
    return found


def stretches(run: Path, store: Store) -> np.ndarray:
    """(52, 2) g and t of every weight; 1 and 0 where nothing is to be done, and for jawOpen."""
    speakers = [tuple(np.concatenate(side) for side in zip(*clips, strict=True)) for clips in pairs(run, store).values()]
    found = np.tile([1.0, 0.0], (len(ARKIT), 1))
    for name in {name.removesuffix("Left").removesuffix("Right") for name in ARKIT} - {*ALONE}:
        both = [ARKIT_INDEX[n] for n in (name, f"{name}Left", f"{name}Right") if n in ARKIT_INDEX]
        sides = [(made[:, k], real[:, k]) for made, real in speakers for k in both]
        sides = [(a, b) for a, b in sides if b.std() > LIVE and a.std() > 0 and np.corrcoef(a, b)[0, 1] >= ALIKE]
        if sides:
            found[both] = stretch(sides)
    return found


def ratio(sides: list[tuple[np.ndarray, np.ndarray]], g: float, t: float) -> float:
    """Standard deviation, made ÷ tracked: geometric mean over speakers."""
    return float(np.exp(np.mean([np.log(max(np.maximum(g * a - t, 0).std(), 1e-6) / b.std()) for a, b in sides])))


def stretch(sides: list[tuple[np.ndarray, np.ndarray]]) -> tuple[float, float]:
    """g and t of one channel, from what is made and tracked of each speaker."""
    goal = float(np.clip(ratio(sides, 1.0, 0.0), *WANTED))
    if goal == ratio(sides, 1.0, 0.0):
        return 1.0, 0.0
    best, high = (np.inf, 1.0, 0.0), max(float(np.quantile(a, 0.98)) for a, _ in sides)
    for floor in FLOORS:
        few, many = 0.1, MOST
        for _ in range(20):  # the deviation grows with g, as t is in units of g
            middle = (few + many) / 2
            few, many = (middle, many) if ratio(sides, middle, middle * floor * high) < goal else (few, middle)
        if ratio(sides, many, many * floor * high) < 0.98 * goal:  # more than `MOST` would be needed
            continue
        error = sum(float(np.abs(np.maximum(many * (a - floor * high), 0) - b).mean() / b.std()) for a, b in sides)
        best = min(best, (error, many, many * floor * high))
    return best[1], best[2]


def calibrate(run: Path, store: Path) -> Iterator[str]:
    """Change the run's last weights; tells g and t of the channels that were stretched."""
    found, net = stretches(run, Store(store)), load_run(run, "last")[0]
    factor, floor = torch.ones(net.pose), torch.zeros(net.pose)
    factor[: len(ARKIT)], floor[: len(ARKIT)] = torch.from_numpy(found).float().unbind(1)
    tensors, state = read_tensors(run / FILE)
    for prefix in ("model.", "ema."):
        if f"{prefix}out.weight" in tensors:
            weight, bias = tensors[f"{prefix}out.weight"], tensors[f"{prefix}out.bias"]
            tensors[f"{prefix}out.weight"] = weight * factor[:, None, None]
            tensors[f"{prefix}out.bias"] = factor * bias + ((factor - 1) * net.pose_mean - floor) / net.pose_std
    write_tensors(run / FILE, tensors, state)
    return (f"{name} {g:.2f} {t:.3f}" for name, (g, t) in zip(ARKIT, found, strict=True) if (g, t) != (1, 0))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("run", type=Path)
    parser.add_argument("store", type=Path)
    given = parser.parse_args()
    print(*calibrate(given.run, given.store), sep=", ")


if __name__ == "__main__":
    main()
