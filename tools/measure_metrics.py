"""Writes the control-row tables of docs/metrics/ from speech and the rule-based model's motion for it (synthetic).

    python tools/measure_metrics.py FOLDER_OF_SPEECH [--minutes 6] [--only PAGE …]

Files of the folder are joined into clips of about a minute, gestured in four styles by turns (the "speakers" of clustering and
inception score) at 15 frames per second, and evaluated. In docs/metrics/NAME.md what is between ``<!-- measured -->`` and
``<!-- end -->`` is replaced by the control rows of that page's metrics.
"""

from __future__ import annotations

import argparse
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.cluster.vq import kmeans2

from cospeech.audio.speech import Speech
from cospeech.corpora.clip import Clip, Semantic
from cospeech.corpora.samples import POSE_STATISTICS, sample_of
from cospeech.evaluation import evaluate_clips
from cospeech.metrics import METRICS, FeatureNet, Tools, load_metric
from cospeech.metrics.mode_f1 import mode_features
from cospeech.models import PARTS
from cospeech.motion.keypoints import joint_points
from cospeech.motion.points import Points
from cospeech.motion.skeleton import humanoid
from cospeech.motion.skeletons.pats import JOINTS
from cospeech.rules import STYLES, RuleBasedModel

PAGES = Path(__file__).parents[1] / "docs" / "metrics"
BLOCK = re.compile(r"(<!-- measured -->\n).*?(<!-- end -->)", re.S)
FPS, CLIP, PAUSE, TAKES = 15.0, 45.0, 0.5, 3  # per second; seconds; seconds; takes of each speech
POINTS = {"pck_2d", "pck_mix_stage", "pck_s2g", "mode_f1", "mode_f1_published", "w1_speed_mix_stage"}
FITTED = " The classifier of styles and the cluster centres are fitted to the same clips that they score."
PIXELS = 900.0  # per metre: shoulders of 0.175 m are then 167 px wide or nearly


def speeches(folder: Path, minutes: float) -> list[Speech]:
    files = sorted(path for path in folder.rglob("*") if path.suffix.lower() in {".wav", ".flac", ".ogg", ".mp3"})
    clips: list[Speech] = []
    parts: list[np.ndarray] = []
    for path in files:
        speech = Speech.load(path)
        parts += [speech.samples, np.zeros(int(PAUSE * speech.rate), np.float32)]
        if sum(map(len, parts)) > CLIP * speech.rate:
            clips.append(Speech(np.concatenate(parts), speech.rate, name=f"speech {len(clips)}"))
            parts = []
        if sum(float(s.duration) for s in clips) > 60 * minutes:
            break
    return clips


def recording(speech: Speech, number: int, seed: int) -> Clip:
    style = list(STYLES)[number % 4]
    session = RuleBasedModel().session(style=style, seed=seed, fps=FPS, parts=PARTS)
    pieces = [piece for chunk in speech.chunks(seconds=2.0) for piece in session.push(chunk)] + list(session.finish())
    semantics = tuple(Semantic(g.start, g.end, g.score) for g in session.gestures if g.score > 0)
    motion = type(pieces[0]).concatenate(pieces)
    return Clip(f"clip{number}", style, "synthetic", speech, motion, semantics=semantics)


def key_points(clip: Clip) -> Clip:
    """The same clip as PATS would have it: 52 points of the picture's plane."""
    part = {"Shoulder": "UpperArm", "Elbow": "LowerArm", "Wrist": "Hand", "HandRoot": "Hand", "Eye": "Eye"}
    sources, ends = [], humanoid().ends
    for name in JOINTS:
        side = {"L": "left", "R": "right"}.get(name[0], "")
        finger = re.fullmatch(r"[LR]Hand(\w+?)([1-4])", name)
        if finger:
            chain = ("Metacarpal", "Proximal", "Distal") if finger[1] == "Thumb" else ("Proximal", "Intermediate", "Distal")
            number = int(finger[2])
            joint = f"{side}{finger[1]}{chain[min(number, 3) - 1]}"
            sources.append((joint, ends[joint] if number == 4 else (0.0, 0.0, 0.0)))
        elif name in ("Neck", "Nose"):
            sources.append(("neck" if name == "Neck" else "head", (0.0, 0.0, 0.0) if name == "Neck" else (0.0, 0.06, 0.1)))
        else:
            sources.append((side + part[name[1:]], (0.0, 0.0, 0.0)))
    assert clip.motion is not None
    return replace(clip, motion=None, points=Points(FPS, joint_points(clip.motion, sources)[..., :2] * PIXELS, "pats"))


def tools_for(clips: list[Clip], flat: list[Clip]) -> Tools:
    """Centres by k-means, t-SNE, and a classifier of styles by the nearest mean: all fitted to these very clips."""
    from sklearn.manifold import TSNE

    frames = np.concatenate([mode_features(sample_of(clip).points) for clip in flat])
    centres = kmeans2(frames, 8, minit="++", rng=np.random.default_rng(0))[0]
    rows = [POSE_STATISTICS.windows(sample_of(clip)) for clip in clips]
    styles = sorted({clip.speaker for clip in clips})
    means = np.stack([np.concatenate([r for r, c in zip(rows, clips, strict=True) if c.speaker == s]).mean(0) for s in styles])
    spread = np.concatenate(rows).std(0)

    def classify(windows: np.ndarray) -> np.ndarray:
        gap = np.square((POSE_STATISTICS.function(windows)[:, None] - means) / spread).mean(-1)
        odds = np.exp(4 * (gap.min(1, keepdims=True) - gap))
        return odds / odds.sum(1, keepdims=True)

    classifier = FeatureNet("nearest mean of style", classify, POSE_STATISTICS.frames, POSE_STATISTICS.hop)
    return Tools(
        features=POSE_STATISTICS, classifier=classifier, centres=centres,
        embedding=lambda x: TSNE(2, init="pca", random_state=7, perplexity=min(30, len(x) // 4)).fit_transform(x),
    )  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--minutes", type=float, default=6.0)
    parser.add_argument("--only", nargs="+", metavar="PAGE", help="write these pages alone: wrist_height")
    options = parser.parse_args()
    if wrong := {*(options.only or ())} - {path.stem for path in PAGES.glob("*.md")}:
        parser.error(f"there is no page docs/metrics/{min(wrong)}.md")
    talks = speeches(options.folder, options.minutes)
    if len(talks) < 4:
        parser.error(f"{len(talks)} clips of {CLIP:g} s in {options.folder}: four are wanted, one of each style")
    clips = [recording(speech, k, k) for k, speech in enumerate(talks)]
    flat = [key_points(clip) for clip in clips]
    takes = [[recording(speech, k, 100 * take + k) for take in range(1, TAKES + 1)] for k, speech in enumerate(talks)]
    motions = {clip.name: [take.motion for take in group] for clip, group in zip(clips, takes, strict=True)}
    flat_motions = {clip.name: [key_points(take) for take in group] for clip, group in zip(clips, takes, strict=True)}
    tools, name = tools_for(clips, flat), f"rules, {TAKES} other seeds"
    solid = evaluate_clips({name: motions}, clips, metrics=[n for n in METRICS if n not in POINTS], tools=tools)
    planar = evaluate_clips({name: flat_motions}, flat, metrics=sorted(POINTS), tools=tools)
    for path in sorted(PAGES.glob("*.md")):
        names = [n for n, where in METRICS.items() if where.split(":")[0].endswith(f".{path.stem}")]
        text = path.read_text("utf-8")
        if not names or (options.only and path.stem not in options.only):
            continue
        if not BLOCK.search(text):
            print(f"left {path.name}: it has no lines <!-- measured --> and <!-- end -->")
            continue
        rows = {row: [(planar if n in POINTS else solid)._cell(row, n) for n in names] for row in solid.rows}
        faults = {n: (planar if n in POINTS else solid).faults.get(n, ()) for n in names}
        arrows = {"higher": "↑", "lower": "↓", "reference": "→"}
        lines = ["| |" + "".join(f" `{n}` {arrows[load_metric(n).about.better]} |" for n in names)]
        lines += ["| --- |" + " ---: |" * len(names)]
        lines += [f"| {row} |" + "".join(f" {cell} |" for cell in rows[row]) for row in rows]
        note = FITTED if {"classifier", "centres"} & {need for n in names for need in load_metric(n).about.needs} else ""
        lines += ["", f"Synthetic: {solid.about}; rule-based model, {FPS:g} frames per second, 4 styles.{note}"]
        lines += (
            ["", *(f"* `{n}`: {'; '.join(reasons)}." for n, reasons in faults.items() if reasons)]
            if any(faults.values())
            else []
        )
        block = "\n".join(lines) + "\n"
        path.write_text(BLOCK.sub(lambda match, block=block: match[1] + block + match[2], text), "utf-8")
        print(f"wrote {path.name}")


if __name__ == "__main__":
    main()
