"""How much motion stretches the mannequin: of the rules on the example speech, and of BVH files.

python tools/measure_stretch.py [TAKE.bvh ...]

The rules speak in each of their styles. For each part the greatest stretch of an edge in any frame, and the share of the
edges that are ever stretched by more than 30 %. Six frames a second are looked at. All edges count that are longer than 0.1 mm,
against their length in the T-pose, which is the mesh that files hold. A viewer sees cloth and skin that are longer than that
mesh, not edges that are shorter.
"""

from __future__ import annotations

import sys
from pathlib import Path

from mannequin.stretch import measure_stretch

import cospeech
from cospeech.cli.demo import EXAMPLE, EXAMPLE_WORDS
from cospeech.errors import InputError
from cospeech.export import bvh_reader, mannequin
from cospeech.export.to_humanoid import as_humanoid
from cospeech.motion.motion import Motion
from cospeech.rules import STYLES

PARTS = (
    "shirt", "pocket", "trousers", "face", "leftHand", "rightHand", "leftShoe", "rightShoe", "leftSole", "rightSole",
)  # fmt: skip
RATE = 6.0  # frames looked at, per second


def print_row(name: str, motion: Motion) -> None:
    """One line of the table."""
    stretches = measure_stretch(mannequin.build(), motion, PARTS, max(1, round(motion.fps / RATE)))
    cells = "  ".join(f"{100 * s.most:4.0f} % {100 * s.ever:5.1f} %" for s in stretches.values())
    print(f"{name[:36]:36}  {cells}")


def main() -> None:
    print(f"{'':36}  " + "  ".join(f"{part:>14}" for part in PARTS))
    speech = cospeech.Speech.load(EXAMPLE, transcript=EXAMPLE_WORDS)
    for style in STYLES:
        print_row(f"rules, {style}", cospeech.load("rules").generate(speech, style=style, seed=3))
    for path in map(Path, sys.argv[1:]):
        try:
            print_row(path.stem, as_humanoid(bvh_reader.load(path)))
        except InputError as error:
            print(f"{path.stem[:36]:36}  left out: {error}")


if __name__ == "__main__":
    main()
