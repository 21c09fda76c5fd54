"""Whether trained models move in the styles that they are asked for: a judge that sees neither mean pose nor amplitude.

    OMP_NUM_THREADS=1 python benchmarks/styles.py FOLDER_OF_SPEECH [--bundle FILE …] [--bare]

The rules taught the networks that ship, in the styles of eight speakers. A judge learns these speakers from performances of the
rules on every other piece of speech in the folder. Then each model performs the rest in each style, and the judge names the
speaker. It should not see what bundling sets: so every number of a pose is standardised within each window of 8 s, by its own
mean and deviation. What is left, and what the judge sees of six parts of the body:

* the shares of five bands of frequency in the velocity;
* how the parts' speeds correlate, and how the two arms mirror each other;
* how long a part rests, and how uneven its speed is;
* which arm does more, as the ratio of both arms' deviations. Bundling bears on this one:
  its gains scale each number of a pose.

Linear discriminants with a shrunk covariance; the windows of a performance vote, but for its first two seconds. The rules with
other seeds are the first row: what can be reached. The second row is the control: the styles are drawn by lot.

The second column asks less: a judge that learns from the model's own performances on the same pieces. It tells whether the
styles of a model differ from each other in manner, be it that of their speakers or another.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from models import BODY, Player, held_out, players

import cospeech
from cospeech.corpora.synthetic.speakers import Speaker, choose_speakers, vary_take
from cospeech.experiments.discriminants import LinearDiscriminants
from cospeech.motion.poses import find_pose
from cospeech.rules import RuleBasedModel

SPEAKERS, SEED = 8, 0  # as tools/build_weights.py
FPS, WINDOW, STEP, WARM = 15, 8.0, 2.0, 2.0  # frames a second; s
BANDS = (0.0, 0.3, 0.6, 1.2, 2.4, 7.5)  # Hz
TAKES = 4  # of each piece in each style, that the judge learns from
TINY = 1e-4  # rad; a number that varies by less is still
ARM, HAND = ("Shoulder", "UpperArm", "LowerArm"), ("Hand", "Grip")
PARTS = {"trunk": ("hips", "spine", "chest", "upperChest"), "head": ("neck", "head")} | {
    f"{side} {part}": tuple(side + bone for bone in bones)
    for side in ("left", "right")
    for part, bones in (("arm", ARM), ("hand", HAND))
}
LEFT_ARM, RIGHT_ARM = (list(PARTS).index(f"{side} arm") for side in ("left", "right"))


def columns_of(names: Iterable[str]) -> list[np.ndarray]:
    """Columns of each part of `PARTS`."""
    bones = np.array([name.split(".")[0] for name in names])
    return [np.flatnonzero(np.isin(bones, parts)) for parts in PARTS.values()]


def describe(window: np.ndarray, parts: list[np.ndarray]) -> np.ndarray:
    """What the judge sees of (F, D) poses."""
    spread = window.std(0)
    blind = np.where(spread > TINY, (window - window.mean(0)) / np.maximum(spread, TINY), 0.0)
    power = np.square(np.abs(np.fft.rfft(np.diff(blind, axis=0), axis=0)))
    hertz = np.fft.rfftfreq(len(window) - 1, 1 / FPS)
    bands = np.stack([power[(hertz >= low) & (hertz < high)].sum(0) for low, high in pairwise(BANDS)])
    found = list[np.ndarray]()
    speeds = list[np.ndarray]()
    for columns in parts:
        shares = bands[:, columns].sum(1)
        found.append(np.log(shares / max(shares.sum(), 1e-9) + 0.01))
        speed = np.sqrt(np.square(np.diff(blind[:, columns], axis=0)).mean(1))
        speeds.append(speed)
        mean = max(float(speed.mean()), 1e-9)
        found.append(np.array([(speed < 0.3 * mean).mean(), np.log(speed.std() / mean + 0.05)]))
    together = np.corrcoef(np.stack(speeds) + 1e-9 * np.arange(len(speeds[0])))
    found.append(together[np.triu_indices(len(speeds), 1)])
    left, right = parts[LEFT_ARM], parts[RIGHT_ARM]
    found.append((blind[:, left] * blind[:, right]).mean(0))
    ratio = np.log((spread[left].mean() + 0.01) / (spread[right].mean() + 0.01))
    return np.concatenate([*found, [ratio]])


class Judge:
    """Names the speaker of a motion.

    Args:
        performed: speaker's number and motion, to learn from.
    """

    def __init__(self, performed: Iterable[tuple[int, cospeech.Motion]]) -> None:
        self._pose = find_pose("expmap-humanoid")
        self._parts = columns_of(self._pose.names)
        pairs = [(who, self._windows(motion)) for who, motion in performed]
        rows, whose = np.concatenate([own for _, own in pairs]), np.concatenate([[who] * len(own) for who, own in pairs])
        self._discriminants = LinearDiscriminants(rows, whose, SPEAKERS)

    def _windows(self, motion: cospeech.Motion) -> np.ndarray:
        poses = self._pose.encode(motion.resample(FPS))[round(WARM * FPS) :]
        frames = round(WINDOW * FPS)
        starts = range(0, max(len(poses) - frames, 0) + 1, round(STEP * FPS))
        return np.stack([describe(poses[start : start + frames], self._parts) for start in starts])

    def name(self, motion: cospeech.Motion) -> int:
        """The speaker's number."""
        return int(self._discriminants.vote(self._windows(motion)).argmax())


def perform(model: Any, speeches: list[cospeech.Speech], people: list[Speaker], seed: int, **options: Any) -> Any:
    """(number of the speaker, motion) of each speech in each style; styles of the rules vary from take to take."""
    for k, speech in enumerate(speeches):
        for who, person in enumerate(people):
            own = seed + 1000 * k + who
            style = vary_take(person.style, own, 1.0) if isinstance(model, RuleBasedModel) else person.name
            yield who, model.generate(speech, style=style, seed=own, **BODY, **options)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("speech", type=Path, help="a folder of recordings")
    parser.add_argument("--bundle", action="append", help="a file; those that ship where not given")
    parser.add_argument("--bare", action="store_true", help="networks alone, without what was measured at bundling")
    chosen = parser.parse_args()
    people = choose_speakers(SPEAKERS, SEED)
    pieces = held_out(chosen.speech, "all", 0.0)
    taught, tested = pieces[::2], pieces[1::2]
    if not tested:
        parser.error(f"{chosen.speech} has fewer than two pieces of 13 s or more")
    judge = teach_judge(RuleBasedModel(), taught, people)
    print(f"the judge learnt from {len(taught)} pieces; {len(tested)} others in {SPEAKERS} styles\n")
    print("| | named | named by a judge of its own | chance |\n|---|---|---|---|")
    bare = {"calibrated": not chosen.bare, "stance": False}
    rows: list[Player] = [("rules, other seeds", RuleBasedModel(), {}), *players(chosen.bundle, bare)]
    for name, model, options in rows:
        own = judge if isinstance(model, RuleBasedModel) else teach_judge(model, taught, people, **options)
        performed = list(perform(model, tested, people, 50_000, **options))
        said = [[(who, each.name(motion)) for who, motion in performed] for each in (judge, own)]
        print(f"| {name} | {' | '.join(map(share_right, said))} | {1 / SPEAKERS:.0%} |", flush=True)
        if isinstance(model, RuleBasedModel):
            lot = np.random.default_rng(0).permutation([who for who, _ in performed])
            by_lot = share_right(list(zip(lot, (named for _, named in said[0]), strict=True)))
            print(f"| the same, styles by lot | {by_lot} | | |", flush=True)


def teach_judge(model: Any, speeches: list[cospeech.Speech], people: list[Speaker], **options: Any) -> Judge:
    """A judge that has seen some takes of a model."""
    takes = (perform(model, speeches, people, 7919 * take + 1, **options) for take in range(TAKES))
    return Judge(pair for take in takes for pair in take)


def share_right(pairs: list[tuple[int, int]]) -> str:
    """How often a judge was right, with its interval of 95 %."""
    right = np.array([who == said for who, said in pairs])
    return f"{right.mean():.0%} ± {1.96 * right.std() / len(right) ** 0.5:.0%}"


if __name__ == "__main__":
    main()
