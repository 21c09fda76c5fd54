"""Makes the styles of a bundle that ships as quick and as wide as those of the rules, which taught it.

    python tools/size_styles.py mix-stage --speech FOLDER_OF_SPEECH [--out BUNDLE] [--check]

Bundling gives each number of a pose the deviation of the speaker's own. Hands still end up slower or quicker than the
speaker's, because a network makes fewer or more strokes, and because the rules have changed since it learnt from them. So here
the bundle and the rules perform the same speech in each style, as files have them. The numbers of each arm and its fingers are
multiplied until the wrist is as quick as in the rules. This is done a few times, because holds, rest and arms that stay out of
the body bear on it, too.

With ``--keep-mean`` the bundle keeps its mean speed over all styles, and only the ratios between the styles become those of the
rules: for a network whose hands are as quick as people's without it.

Every other piece of the speech is used. ``--check`` changes nothing: it measures on the other pieces, and prints the mean speed
of the wrists (m/s) in each style, in the rules and in the bundle.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from cospeech.audio.speech import Speech
from cospeech.corpora.synthetic.silences import cut_pieces
from cospeech.corpora.synthetic.speakers import choose_speakers
from cospeech.corpora.synthetic.voices import recordings
from cospeech.models import BUNDLE, SHIPPED, Model, load
from cospeech.motion.motion import Motion
from cospeech.motion.poses import find_pose
from cospeech.runtime.bundles.bundle import Bundle, pack_arrays, read_bundle, write_bundle
from cospeech.runtime.bundles.spec import STATISTICS, read_spec

SPEAKERS, SEED = 8, 0  # as tools/build_weights.py
PIECE, SHARE = 25.0, 0.3  # s of speech before pauses are put into it; share of it that is then pauses, as benchmarks/models.py
ROUNDS = 3
STEP = 0.8  # exponent of the ratio of speeds: a hold makes slow hands slower still, so the whole ratio would be too much
LEAST, MOST = 0.4, 1.6  # times as large as it was; further out, arms go where no recording has them
SIDES = ("left", "right")


def name_arrays(bundle: Bundle) -> list[str]:
    """Arrays of a bundle's statistics that are sized: for files, and for streams where another network plays them."""
    arrays = bundle.arrays(STATISTICS)
    return [name for name in ("speaker_std", "style_gain", "live_style_gain") if name in arrays]


def options_of(array: str, model: Model) -> Mapping[str, Any]:
    """Options of a model whose motion an array changes."""
    return {} if array.startswith("live") else model.for_files


def wrist_speeds(motion: Motion) -> np.ndarray:
    """(2,) mean speed of the left and the right wrist from the upper chest, m/s."""
    index, places = motion.skeleton.index, motion.positions()
    ways = np.diff(places[:, [index[f"{side}Hand"] for side in SIDES]] - places[:, [index["upperChest"]]], axis=0)
    return np.linalg.norm(ways, axis=-1).mean(0) * motion.fps


def measure(model: Model, styles: Sequence[object], pieces: Sequence[Speech], options: Mapping[str, Any]) -> np.ndarray:
    """(S, 2) mean speeds of the wrists in each style, m/s."""
    options = {"parts": ("body", "hands"), "emotion": "neutral", **options}
    return np.array([
        np.mean([wrist_speeds(model.generate(piece, style=style, seed=k, **options)) for k, piece in enumerate(pieces)], 0)
        for style in styles
    ])  # fmt: skip


def size(
    path: Path, targets: np.ndarray, names: Sequence[str], pieces: Sequence[Speech], out: Path, keep_mean: bool = False
) -> None:
    """Write the bundle with sized styles; ``targets`` (S, 2) are the speeds of the rules."""
    bundle = read_bundle(path)
    bones = [number.split(".")[0] for number in find_pose(read_spec(bundle).pose).names]
    columns = [np.array([bone.startswith(side) for bone in bones]) for side in SIDES]
    manifest = {key: value for key, value in bundle.manifest.items() if key not in ("members", "format")}
    for array in name_arrays(bundle):
        first = bundle.arrays(STATISTICS)[array]
        aim, factors = targets, np.ones_like(targets)
        for turn in range(ROUNDS):
            write_bundle(out, manifest, bundle.members)
            model = load(out)
            speeds = measure(model, names, pieces, options_of(array, model))
            if keep_mean and turn == 0:
                aim = targets * speeds.mean() / targets.mean()
            print(f"{array}, round {turn}: {compare(aim, speeds)}", flush=True)
            factors = (factors * (aim / speeds) ** STEP).clip(LEAST, MOST)
            arrays = dict(bundle.arrays(STATISTICS))
            gains = [factors[:, k : k + 1] ** own for k, own in enumerate(columns)]
            arrays[array] = (first * gains[0] * gains[1]).astype(np.float32)
            bundle = replace(bundle, members={**bundle.members, STATISTICS: pack_arrays(arrays)})
    write_bundle(out, manifest, bundle.members)


def compare(targets: np.ndarray, speeds: np.ndarray) -> str:
    """Text that compares speeds (S, 2) of a bundle with the targets, which are those of the rules."""
    a, b = targets.mean(1), speeds.mean(1)
    return f"{' '.join(f'{x:.2f}' for x in b)} (rules {' '.join(f'{x:.2f}' for x in a)}), r {np.corrcoef(a, b)[0, 1]:.2f}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("name", choices=["stylised-flow", "mix-stage", "chain-of-generation"])
    parser.add_argument("--speech", type=Path, required=True, help="folder of recordings")
    parser.add_argument("--out", type=Path, help="of the bundle; where it ships, else")
    parser.add_argument("--keep-mean", action="store_true", help="set the ratios between the styles alone")
    parser.add_argument("--check", action="store_true", help="measure --out on the other pieces of the speech")
    options = parser.parse_args()
    path = SHIPPED / f"{options.name}{BUNDLE}"
    out, pieces = options.out or path, cut_pieces(recordings(options.speech), PIECE, SHARE)[options.check :: 2]
    people = choose_speakers(SPEAKERS, SEED)
    targets = measure(load("rules"), [person.style for person in people], pieces, {})
    names = [person.name for person in people]
    if not options.check:
        size(path, targets, names, pieces, out, options.keep_mean)
        return
    model = load(out)
    for array in name_arrays(read_bundle(out)):
        print(f"{array}: {compare(targets, measure(model, names, pieces, options_of(array, model)))}")


if __name__ == "__main__":
    main()
