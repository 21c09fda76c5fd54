"""Is there life below the ribs, and are strokes those of a person? Prints each statistic beside its target.

    python benchmarks/life.py SPEECH… [--model NAME [--bare]] [--style NAME …] [--seeds N …] [--recordings K …] [--json]

SPEECH is files or folders; short utterances of one folder are joined as in movement_statistics.py. Five minutes in all are
wanted. `--model` is a name that `cospeech.load` knows (the rules where not given); without `--style` the rules play all
of theirs. A trained system plays as for files: it hears all of the speech, and has stance, holds, rests and beat alignment;
`--bare` leaves these out.
`--recordings 2 4 5` takes only these of the joined recordings (0 is the first), so that figures come from speech that nothing
was tuned on.
`cospeech.metrics.body` defines the statistics. The old rows are the 86 of movement_statistics.py, exempt ones left out.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from movement_statistics import EXAMPLE, RATE, recordings

import cospeech
from cospeech import Motion, Speech
from cospeech.metrics import REFERENCE, Track, beat_lift
from cospeech.metrics.body import BODY_TARGETS, BodyRange, body_statistics
from cospeech.metrics.movement import mean_rows, window_statistics
from cospeech.metrics.movement_signal import FPS, SMOOTH, low_pass, norm, rate
from cospeech.motion.rotations import quat_rotate
from cospeech.motion.skeleton import humanoid
from cospeech.rules import STYLES
from cospeech.rules.options import LAYERS

GROUND = 0.003  # metres: a sole point lower than this stands on the floor ([ours], as the laws of tests/rules_laws.py)
STANDING = ("hip height SD, cm", "hip travel SD, cm")  # rows that a seated body has no part in
MOST_FAR = 3.0  # a row counts as no further from the mean than this ([ours]: one row is not to outweigh all others)
WANTED = 300.0  # seconds of speech: the benchmark's demand
SHOWN = ("wrist speed 50 %, m/s", "wrist speed 90 %, m/s", "strokes per min and hand")  # old rows in which styles differ most
EXTRA = {
    "beat lift, far": BodyRange(0.35, 0.55),
    "fastest slide in contact, cm/s": BodyRange(0.0, 1.0),
    "lowest point of a sole, cm": BodyRange(-0.5, np.inf),
    "steps per minute": BodyRange(0.0, 20.0),
    "head speed median, deg/s": BodyRange(19.0, 27.0),
    "old rows inside, %": BodyRange(80.0, 100.0),
    "old rows, distance from the mean": BodyRange(0.0, 1.0),  # 1: the ends of what people do; styles need not be average
} | {name: REFERENCE[name] for name in SHOWN}
"""Rows of this table that `body_statistics` does not give; docs/models/rules.md, and the laws of the body."""


def feet_rows(motion: Motion) -> dict[str, float]:
    """Slide of soles that stand, their lowest point, and how often a foot is lifted, of a motion on our humanoid."""
    skeleton = humanoid()
    positions, world = skeleton.forward(motion.rotations, motion.root)
    ankle = skeleton.tpose[skeleton.index["leftFoot"], 1]
    soles = np.array([[0.0, -ankle, -0.03], [0.0, -ankle, 0.125]])  # below heel and ball
    slides, lows, steps = [0.0], [np.inf], 0
    for side in ("left", "right"):
        k = skeleton.index[side + "Foot"]
        points = positions[:, k, None] + quat_rotate(world[:, k, None], soles)
        down = points[..., 1] < GROUND
        slide = norm(np.diff(points[..., [0, 2]], axis=0)) * motion.fps
        slides.append(float((slide * (down[1:] & down[:-1])).max(initial=0.0)))
        lows.append(float(points[..., 1].min(initial=np.inf)))
        standing = down.any(-1)
        steps += int((~standing[1:] & standing[:-1]).sum())
    minutes = len(motion) / motion.fps / 60
    return {
        "fastest slide in contact, cm/s": max(slides) * 100,
        "lowest point of a sole, cm": min(lows) * 100,
        "steps per minute": steps / minutes,
    }


def measure(pairs: Sequence[tuple[np.ndarray, Motion]], exempt: Sequence[str] = ()) -> dict[str, float]:
    """All rows over recordings of speech and their motions: each the mean weighted by length, slides and soles the worst."""
    weights = np.array([len(motion) for _, motion in pairs], float)
    tables = [body_statistics(motion) | feet_rows(motion) for _, motion in pairs]
    rows = {name: float(np.average([t[name] for t in tables], weights=weights)) for name in tables[0]}
    rows["fastest slide in contact, cm/s"] = max(t["fastest slide in contact, cm/s"] for t in tables)
    rows["lowest point of a sole, cm"] = min(t["lowest point of a sole, cm"] for t in tables)
    rows["beat lift, far"] = beat_lift([(samples, RATE, motion) for samples, motion in pairs]).far
    old = mean_rows([w for _, motion in pairs for w in window_statistics(motion)])
    rows["head speed median, deg/s"] = old["head speed 50 %, deg/s"]
    rows |= {name: old[name] for name in SHOWN}
    names = [name for name in REFERENCE if name not in exempt]
    rows["old rows inside, %"] = 100 * float(np.mean([REFERENCE[n].holds(old.get(n, np.nan)) for n in names]))
    far = [min(REFERENCE[n].distance(old[n]), MOST_FAR) for n in names if np.isfinite(old.get(n, np.nan))]
    rows["old rows, distance from the mean"] = float(np.mean(far))
    return rows


def of_take(path: Path) -> dict[str, float]:
    """Statistics of a recorded take: BVH, or .npy of 9 joints (position, quaternion) at 60 fps, hips first."""
    if path.suffix == ".npy":
        take = np.load(path, allow_pickle=False)[::2]
        place = take[..., :3]
        pelvis = np.asarray(take[:, 0, 3:], float)
        return body_statistics(Track(FPS, place[:, 0], place[:, [6, 3]], place[:, [7, 4]], place[:, [8, 5]], pelvis=pelvis))
    motion = Motion.load(path)
    motion = motion if motion.skeleton.kind == "humanoid" else motion.retarget("humanoid")
    rows = body_statistics(motion)
    feet = Track.of(motion).feet
    assert feet is not None
    rows["fastest ankle, m/s"] = float(norm(rate(low_pass(feet, SMOOTH))).max())
    return rows


def print_table(columns: Mapping[str, Mapping[str, float]]) -> None:
    """One line per statistic, one column per style or take: * outside the target."""
    targets = BODY_TARGETS | EXTRA
    print(f"{'statistic':36s} {'target':>16s}  " + " ".join(f"{name[:11]:>11s}" for name in columns))
    for name, target in targets.items():
        cells = []
        for rows in columns.values():
            value = rows.get(name, np.nan)
            cells.append(f"{'–':>10s} " if np.isnan(value) else f"{value:10.3g}{' ' if target.holds(value) else '*'}")
        ends = f"{target.low:g} … {target.high:g}".replace("… inf", "or more")
        print(f"{name:36s} {ends:>16s}  " + " ".join(cells))
    inside = []
    for rows in columns.values():
        hits = [target.holds(rows[name]) for name, target in targets.items() if np.isfinite(rows.get(name, np.nan))]
        inside.append(f"{sum(hits)}/{len(hits)} ")
    print(f"{'inside':36s} {'':>16s}  " + " ".join(f"{cell:>11s}" for cell in inside))
    print("* outside the target")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("speech", nargs="*", type=Path, default=[EXAMPLE], help="files or folders of speech")
    parser.add_argument("--model", default="rules", help="a model by name or bundle (default: rules)")
    parser.add_argument("--style", action="append", help="only this style (may be repeated)")
    parser.add_argument("--bare", action="store_true", help="a trained model without stance, holds, rests and beat alignment")
    parser.add_argument("--seeds", type=int, nargs="+", default=[0], help="takes of each recording (default: 0)")
    parser.add_argument("--recordings", type=int, nargs="+", help="only these of the joined recordings, from 0")
    parser.add_argument("--emotion", default="neutral")
    parser.add_argument("--takes", nargs="*", type=Path, default=[], help="recorded takes (.npy, .bvh) to measure beside")
    parser.add_argument("--json", action="store_true", help="everything as JSON on stdout")
    options = parser.parse_args()
    began = time.perf_counter()
    columns: dict[str, dict[str, float]] = {path.stem: of_take(path) for path in options.takes}
    speech = recordings(options.speech)
    speech = [speech[k] for k in options.recordings] if options.recordings else speech
    seconds = sum(map(len, speech)) / RATE
    model = cospeech.load(options.model)
    styles = options.style or (list(STYLES) if options.model == "rules" else [None])
    for style in styles:
        settings = {"fps": 30.0, "emotion": options.emotion} | ({} if style is None else {"style": style})
        if options.model != "rules":
            settings |= {**model.for_files, **(dict.fromkeys(LAYERS, False) if options.bare else {})}
        takes = [(samples, seed) for seed in options.seeds for samples in speech]
        pairs = [(samples, model.generate(Speech(samples, RATE), seed=seed, **settings)) for samples, seed in takes]
        exempt = STYLES[style].exempt if style in STYLES else ()
        columns[style or options.model] = measure(pairs, exempt)
        for name in STANDING if style in STYLES and STYLES[style].seated else ():
            del columns[style][name]
    if options.json:
        print(json.dumps({"speech_seconds": seconds, "rows": columns}, indent=1, ensure_ascii=False))
        return 0
    short = "" if seconds >= WANTED else f" (at least {WANTED:g} s are wanted)"
    print(f"{seconds:.0f} s of speech in {len(speech)} recordings{short}, model {options.model}, seeds {options.seeds}\n")
    print_table(columns)
    print(f"{time.perf_counter() - began:.0f} s")
    return 0


if __name__ == "__main__":
    sys.exit(main())
