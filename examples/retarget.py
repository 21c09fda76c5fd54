"""Retarget the same motion to other skeletons, and print their joints and heights."""

import sys

import cospeech
from cospeech.cli.demo import EXAMPLE
from cospeech.motion.skeletons import SKELETONS

speech = cospeech.Speech.load(sys.argv[1] if len(sys.argv) > 1 else EXAMPLE)
motion = cospeech.load("rules").generate(speech)

for name in SKELETONS:
    other = motion.retarget(name)
    lowest, highest = other.positions()[..., 1].min(), other.positions()[..., 1].max()
    print(f"{name:9s} {len(other.skeleton):3d} joints, root {other.skeleton.names[0]!r}, from {lowest:.2f} to {highest:.2f} m")
