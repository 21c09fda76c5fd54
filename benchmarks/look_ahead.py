"""What a short look-ahead costs: ``python benchmarks/look_ahead.py --speech FOLDER [--models rules] [--minutes 6]``.

Every setting of `look_ahead` plays the same speech. Each row says how long a frame comes after its sound, the
lift of beat alignment over chance (benchmarks/README.md) with its 95 % interval, by how much wrists are behind the accents, how
fast they move, and how alike the poses are to those of the usual setting: the correlation over time of joint angles that
move. Rules decide anew at each setting, so theirs are other performances.

`--face`: the faces of the settings. Each row compares the mouth with the one of the usual setting.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from movement_statistics import EXAMPLE, RATE, recordings
from speed import machine

from cospeech.audio.speech import Speech
from cospeech.metrics import Track, beat_lift
from cospeech.metrics.movement import wrist_speeds
from cospeech.models import load
from cospeech.motion.motion import Motion
from cospeech.motion.rotations import Array, quat_to_rotvec
from cospeech.motion.skeletons.arkit import ARKIT, ARKIT_INDEX

SETTINGS: dict[str, tuple[float | None, ...]] = {
    "rules": (None, 1.0, 0.8, 0.6, 0.5, 0.4),
    "stylised-flow": (None, 0.25, 0.16, 0.0),
    "mix-stage": (float("inf"), None, 0.34, 0.16, 0.0),
    "chain-of-generation": (float("inf"), None, 0.27, 0.2, 0.13),
}
FACES = (None, 0.35, 0.3, 0.25, 0.2)
MOVES = 1e-3  # radians of standard deviation from which an angle moves
BODY = ("body", "hands")


def play(name: str, look_ahead: float | None, speech: Sequence[Array], parts: tuple[str, ...]) -> tuple[list[Motion], float]:
    """The motion of every recording, and the latency."""
    model, motions = load(name), list[Motion]()
    for seed, samples in enumerate(speech):
        session = model.session(seed=seed, fps=30, parts=parts, look_ahead=look_ahead)
        pieces = [motion for piece in Speech(samples, RATE).chunks(1.0) for motion in session.push(piece)]
        motions.append(Motion.concatenate([*pieces, *session.finish()]))
    return motions, session.latency


def alike(a: Array, b: Array) -> float:
    """Mean correlation over time of the columns (T, C) that move."""
    a, b = a - a.mean(0), b - b.mean(0)
    moving = a.std(0) > MOVES
    scale = np.sqrt((a * a).sum(0) * (b * b).sum(0))[moving]
    return float(np.mean((a * b).sum(0)[moving] / np.maximum(scale, 1e-12)))


def angles(motion: Motion) -> Array:
    """(T, 3 J) of the joints."""
    return quat_to_rotvec(motion.rotations.astype(float)).reshape(len(motion), -1)


def report_body(name: str, speech: Sequence[Array]) -> None:
    usual: list[Motion] | None = None
    for setting in SETTINGS.get(name, (None,)):
        motions, latency = play(name, setting, speech, BODY)
        lift = beat_lift([(samples, RATE, motion) for samples, motion in zip(speech, motions, strict=True)])
        speed = np.mean([wrist_speeds(Track.of(motion)).mean() for motion in motions])
        usual = motions if usual is None else usual
        same = np.mean([alike(angles(a), angles(b)) for a, b in zip(usual, motions, strict=True)])
        label = "usual" if setting is None else f"{setting:g} s"
        print(f"| {name} | {label} | {latency:.2f} s | {lift.far:+.0%} ({lift.interval[0]:+.0%} … {lift.interval[1]:+.0%}) "
              f"| {lift.near:+.0%} | {lift.lag:+.2f} s | {speed:.2f} | {same:.2f} |", flush=True)  # fmt: skip


def report_face(speech: Sequence[Array]) -> None:
    usual: list[Array] = []
    mouth = [k for k, name in enumerate(ARKIT) if name.startswith(("jaw", "mouth"))]
    for setting in FACES:
        motions, latency = play("rules", setting, speech, ("face",))
        faces = [motion.face[:, mouth].astype(float) for motion in motions if motion.face is not None]
        usual = usual or faces
        jaw = mouth.index(ARKIT_INDEX["jawOpen"])
        off = np.mean([np.abs(a - b).mean() for a, b in zip(usual, faces, strict=True)])
        jaws = np.mean([np.corrcoef(a[:, jaw], b[:, jaw])[0, 1] for a, b in zip(usual, faces, strict=True)])
        jerks = np.mean([np.abs(np.diff(face, 2, 0)).mean() for face in faces])
        label = "usual" if setting is None else f"{setting:g} s"
        print(f"| face | {label} | {latency:.2f} s | jaw {jaws:.3f} | mouth {off:.4f} | second differences {jerks:.5f} |",
              flush=True)  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--speech", nargs="+", type=Path, default=[EXAMPLE], help="files and folders; one folder, one speaker")
    parser.add_argument("--models", nargs="*", default=list(SETTINGS))
    parser.add_argument("--minutes", type=float, default=6.0, help="of speech, at most")
    parser.add_argument("--face", action="store_true")
    options = parser.parse_args()
    speech, remaining = list[Array](), options.minutes * 60 * RATE
    for samples in recordings(options.speech):
        if remaining > 0:
            speech.append(samples[: int(remaining)])
            remaining -= len(samples)
    print(f"{sum(map(len, speech)) / RATE / 60:.1f} minutes of speech; {machine()}\n")
    if options.face:
        report_face(speech)
        return
    print("| model | look-ahead | behind the sound | beat lift | near | wrists after accents | wrist speed | like the first |")
    print("|---|---|---:|---:|---:|---:|---:|---:|")
    for name in options.models:
        report_body(name, speech)


if __name__ == "__main__":
    main()
