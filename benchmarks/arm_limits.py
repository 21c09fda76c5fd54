"""Arms of trained models beyond the limits of their joints: ``python benchmarks/arm_limits.py SPEECH [--models mix-stage]``.

For each model, in files without and with `arm_limits`: the share of the frames in which an angle is beyond its limit by more
than 3°, and the most that it is beyond. Elbow: flexion and hinge of both sides together, and so on; the limits are those of
tests/support/rules_laws.py. Speech: files or folders, joined to recordings of a minute or more.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np
from movement_statistics import EXAMPLE, RATE, recordings

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from cospeech.audio.speech import Speech
from cospeech.models import load
from cospeech.motion.motion import Motion
from tests.support.rules_laws import SIDES, _arm_angles

GROUPS = {
    "elbow": ("elbow flexion", "elbow hinge"), "hand about the forearm": ("supination",),
    "wrist": ("wrist flexion", "wrist deviation"), "upper arm": ("upper arm inward", "upper arm backward", "upper arm roll"),
}  # fmt: skip


def measure(motions: list[Motion]) -> list[str]:
    """A cell for each group: the share of the frames, and the most."""
    cells = []
    for names in GROUPS.values():
        beyond = []
        for motion in motions:
            rows = [_arm_angles(motion, side, sign)[name] for side, sign in SIDES for name in names]
            beyond.append(np.max([np.maximum(low - angle, angle - high) for angle, low, high in rows], 0))
        over = np.concatenate(beyond)
        cells.append(f"{100 * np.mean(over > 3):.1f} %, {max(over.max(), 0):.0f}°")
    return cells


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("speech", type=Path, nargs="*", default=[EXAMPLE])
    parser.add_argument("--models", default="stylised-flow,mix-stage,chain-of-generation")
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    speech = [Speech(samples, RATE) for samples in recordings(arguments.speech)]
    print("| model | limits | " + " | ".join(GROUPS) + " |")
    print("|---|---|" + "---:|" * len(GROUPS))
    for name in arguments.models.split(","):
        model = load(name)
        for has_limits in (False, True):
            options = {**model.for_files, "arm_limits": has_limits}
            motions = [model.generate(each, seed=arguments.seed + k, **options) for k, each in enumerate(speech)]
            print("| " + " | ".join([name, "yes" if has_limits else "no", *measure(motions)]) + " |", flush=True)


if __name__ == "__main__":
    main()
