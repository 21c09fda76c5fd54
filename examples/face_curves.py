"""Print which of the 52 ARKit weights move most, and when the eyes blink."""

import sys

import numpy as np

import cospeech
from cospeech.cli.demo import EXAMPLE
from cospeech.motion.skeletons.arkit import ARKIT, ARKIT_INDEX

speech = cospeech.Speech.load(sys.argv[1] if len(sys.argv) > 1 else EXAMPLE)
motion = cospeech.load("rules").generate(speech, parts=("face",))

for k in np.argsort(-motion.face.std(0))[:8]:
    print(f"{ARKIT[k]:20s} {motion.face[:, k].mean():.3f} on average, up to {motion.face[:, k].max():.3f}")

closed = motion.face[:, ARKIT_INDEX["eyeBlinkLeft"]] > 0.6
blinks = motion.times[1:][closed[1:] & ~closed[:-1]]
print("blinks at", ", ".join(f"{t:.2f} s" for t in blinks) or "none")
