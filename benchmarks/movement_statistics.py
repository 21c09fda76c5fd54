"""Does the rule-based model move like people who speak? Prints the table, and fails where it does not.

    python benchmarks/movement_statistics.py SPEECH… [--style NAME …] [--quick] [--json]

SPEECH is files or folders; short utterances of one folder are joined (half a second apart) into recordings of a minute or
more, because the reference is windows of 30 s. Exit code 1 if fewer than 80 % of the rows of a style lie inside the range
of real speakers (rows that the style declares exempt are not counted), if the hands do not follow the accents better than
time-shifted speech, or if the emotions are not in their order of speed and extent. See benchmarks/README.md.
"""

import argparse
import json
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path

import numpy as np
import soundfile
import soxr

from cospeech import Motion, Speech
from cospeech.metrics import REFERENCE, BeatLift, beat_lift
from cospeech.metrics.beat_lift import energy_envelope
from cospeech.metrics.movement import mean_rows, window_statistics
from cospeech.rules import STYLES, RuleBasedModel

SUFFIXES = {".wav", ".flac", ".ogg", ".mp3", ".aiff", ".aif"}
RATE = 16000
GAP, LONG = 0.5, 60.0  # seconds between joined utterances; recordings are closed when they are longer than this
SHORTEST = 30.0  # seconds: the window of the reference
NEEDED = 0.80  # share of rows inside the range
EMOTIONS = ("neutral", "happiness", "surprise", "anger", "fear", "sadness", "contempt", "disgust")
EXAMPLE = Path(__file__).parents[1] / "src/cospeech/assets"
ALIKE = 0.25  # contempt and disgust differ by no more than this share


def utterances(folder: Path) -> list[np.ndarray]:
    """Mono utterances of a folder's files at RATE, of one loudness; the same recording at another rate is taken once."""
    sounds = []
    for path in sorted(p for p in folder.iterdir() if p.suffix.lower() in SUFFIXES) if folder.is_dir() else [folder]:
        samples, rate = soundfile.read(path, dtype="float32", always_2d=True)
        sounds.append(soxr.resample(samples.mean(1), rate, RATE))
    unique: dict[int, np.ndarray] = {}
    heads: list[np.ndarray] = []
    for k in sorted(range(len(sounds)), key=lambda k: -len(sounds[k])):
        if len(sounds[k]) < 1.2 * RATE:
            continue
        head = energy_envelope(sounds[k][: int(1.5 * RATE)], RATE)[:115]
        if any(np.corrcoef(head, other)[0, 1] > 0.98 for other in heads):
            continue
        heads.append(head)
        unique[k] = sounds[k] * (0.05 / max(float(np.sqrt(np.mean(sounds[k] ** 2))), 1e-9))
    return [unique[k] for k in sorted(unique)]


def recordings(paths: Sequence[Path]) -> list[np.ndarray]:
    """Joined recordings of a minute or more where there is enough speech; one folder is one speaker or a few alike."""
    folders = [
        d for path in paths for d in ([path, *sorted(p for p in path.rglob("*") if p.is_dir())] if path.is_dir() else [path])
    ]
    gap = np.zeros(int(GAP * RATE), np.float32)
    result: list[np.ndarray] = []
    left_over: list[np.ndarray] = []
    for folder in folders:
        parts: list[np.ndarray] = []
        first = len(result)
        for piece in utterances(folder):
            parts += [piece, gap]
            if sum(map(len, parts)) >= LONG * RATE:
                result.append(np.concatenate(parts))
                parts = []
        if sum(map(len, parts)) >= SHORTEST * RATE:
            result.append(np.concatenate(parts))
        elif len(result) > first:
            result[-1] = np.concatenate([result[-1], *parts])
        else:
            left_over += parts
    if left_over and (sum(map(len, left_over)) >= SHORTEST * RATE or not result):
        result.append(np.concatenate(left_over))
    return result


def measure(
    speech: Sequence[np.ndarray], style: str, emotion: str, seeds: Sequence[int]
) -> Iterator[tuple[np.ndarray, Motion]]:
    """Each recording with its motion."""
    for seed in seeds:
        for samples in speech:
            yield samples, RuleBasedModel().generate(Speech(samples, RATE), style=style, emotion=emotion, seed=seed, fps=30)


def judge_style(speech: Sequence[np.ndarray], style: str, emotion: str, seed: int) -> dict:
    """Rows, what is inside and outside the ranges, beat lift, and the verdict for one style."""
    pairs = list(measure(speech, style, emotion, [seed]))
    rows = mean_rows([w for _, motion in pairs for w in window_statistics(motion)])
    exempt = set(STYLES[style].exempt)
    if unknown := exempt - set(REFERENCE):
        raise SystemExit(f"style {style!r} is exempt from rows that do not exist: {', '.join(sorted(unknown))}")
    names = [name for name in REFERENCE if name not in exempt]
    inside = [name for name in names if REFERENCE[name].holds(rows.get(name, np.nan))]
    lift = beat_lift([(samples, RATE, motion) for samples, motion in pairs])
    share = len(inside) / len(names)
    return {
        "rows": rows,
        "outside": [name for name in names if name not in inside],
        "exempt": sorted(exempt),
        "share": share,
        "lift": asdict(lift),
        "passed": share >= NEEDED and lift.interval[0] > 0 and lift.near > 0,
    }


def judge_emotions(speech: Sequence[np.ndarray], style: str, seeds: Sequence[int]) -> dict:
    """Speed and extent of the eight emotions on the same speech, and which demands on their order fail."""
    table = {}
    for emotion in EMOTIONS:
        rows = mean_rows([w for _, motion in measure(speech, style, emotion, seeds) for w in window_statistics(motion)])
        extent = np.sqrt(sum(rows[f"SD of {axis} / arm"] ** 2 for axis in ("height", "lateral", "forward")))
        table[emotion] = {
            "speed 50 %": rows["wrist speed 50 %, m/s"],
            "speed 90 %": rows["wrist speed 90 %, m/s"],
            "extent": float(extent),
            "outward 95 %": rows["outward of own shoulder / arm, 95 %"],
        }
    speed, extent = ({e: table[e][key] for e in EMOTIONS} for key in ("speed 90 %", "extent"))
    demands = {
        f"{e} is wider and faster than neutral": extent[e] > extent["neutral"] and speed[e] > speed["neutral"]
        for e in ("happiness", "surprise")
    }
    demands["anger is the fastest"] = all(speed["anger"] > speed[e] for e in EMOTIONS if e != "anger")
    demands["anger is larger than neutral"] = extent["anger"] > extent["neutral"]
    for e in ("fear", "sadness"):
        demands[f"{e} is narrower and slower than neutral"] = extent[e] < extent["neutral"] and speed[e] < speed["neutral"]
    for e in ("contempt", "disgust"):
        demands[f"{e} is smaller than neutral"] = extent[e] < extent["neutral"]
    demands["contempt and disgust are alike"] = all(
        abs(np.log(x["contempt"] / x["disgust"])) < np.log(1 + ALIKE) for x in (speed, extent)
    )
    return {"table": table, "failed": [what for what, holds in demands.items() if not holds], "passed": all(demands.values())}


def print_styles(results: dict[str, dict]) -> None:
    """One line per row, one column per style: * outside the range, ~ exempt."""
    print(f"{'row':42s} {'mean (low … high)':>28s}  " + " ".join(f"{name[:10]:>10s}" for name in results))
    for name, row in REFERENCE.items():
        cells = []
        for result in results.values():
            value = result["rows"].get(name, np.nan)
            mark = "~" if name in result["exempt"] else "*" if name in result["outside"] else " "
            cells.append(f"{value:9.3g}{mark}")
        print(f"{name:42s} {f'{row.mean:g} ({row.low:g} … {row.high:g})':>28s}  " + " ".join(cells))
    print("\n* outside the range of real speakers   ~ the style says otherwise (not counted)\n")
    print(f"{'style':12s} {'rows inside':>18s} {'far lift':>9s} {'95 % interval':>16s} {'near lift':>10s} {'lag, s':>7s}")
    for name, result in results.items():
        lift = BeatLift(**result["lift"])
        count = len(REFERENCE) - len(result["exempt"])
        inside = f"{count - len(result['outside'])} of {count}, {result['share']:.0%}"
        interval = f"{lift.interval[0]:+.0%} … {lift.interval[1]:+.0%}"
        verdict = "ok" if result["passed"] else "FAILS"
        print(f"{name:12s} {inside:>18s} {lift.far:>+9.0%} {interval:>16s} {lift.near:>+10.0%} {lift.lag:>+7.2f}  {verdict}")
    print("real speaker, three takes:    +64 / +53 / +31 %              +51 / +23 / +20 %   −0.07 … −0.10\n")


def print_emotions(result: dict) -> None:
    """The table of emotions, each figure also relative to neutral."""
    neutral = result["table"]["neutral"]
    print(f"{'emotion':12s} " + " ".join(f"{key:>20s}" for key in neutral))
    for emotion, row in result["table"].items():
        print(f"{emotion:12s} " + " ".join(f"{value:12.3f} ({value / neutral[key]:4.2f}×)" for key, value in row.items()))
    for what in result["failed"]:
        print(f"FAILS: {what}")
    print("emotions in order" if result["passed"] else "")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "speech", nargs="*", type=Path, default=[EXAMPLE], help="files or folders (default: the example speech)"
    )
    parser.add_argument("--style", action="append", choices=list(STYLES), help="only this style (may be repeated)")
    parser.add_argument("--emotion", default="neutral", help="emotion of the style table (default: neutral)")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--quick", action="store_true", help="two recordings only, and emotions on one of them")
    parser.add_argument("--no-emotions", action="store_true", help="leave out the table of emotions")
    parser.add_argument("--json", action="store_true", help="everything as JSON on stdout")
    options = parser.parse_args()
    began = time.perf_counter()
    speech = sorted(recordings(options.speech), key=len, reverse=True)
    if not speech:
        parser.error(f"no speech in {', '.join(map(str, options.speech))}")
    speech = speech[:2] if options.quick else speech
    styles = {name: judge_style(speech, name, options.emotion, options.seed) for name in options.style or STYLES}
    default = (options.style or list(STYLES))[0]
    seeds = [options.seed] if options.quick else [options.seed, options.seed + 1, options.seed + 2]
    emotions = None if options.no_emotions else judge_emotions(speech[:1] if options.quick else speech[:2], default, seeds)
    seconds = sum(map(len, speech)) / RATE
    success = all(r["passed"] for r in styles.values()) and (emotions is None or emotions["passed"])
    if options.json:
        report = {
            "speech_seconds": seconds,
            "recordings": len(speech),
            "styles": styles,
            "emotions": emotions,
            "passed": success,
        }
        print(json.dumps(report, indent=1, ensure_ascii=False))
        return 0 if success else 1
    print(f"{seconds:.0f} s of speech in {len(speech)} recordings, emotion {options.emotion}, seed {options.seed}\n")
    print_styles(styles)
    if emotions:
        print(f"emotions on the same speech, style {default}:")
        print_emotions(emotions)
    print(f"{'passed' if success else 'FAILED'} in {time.perf_counter() - began:.0f} s")
    return 0 if success else 1


if __name__ == "__main__":
    sys.exit(main())
