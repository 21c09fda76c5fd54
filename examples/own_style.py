"""Make styles of your own: a style is a small set of readable numbers."""

import sys
from dataclasses import replace

import numpy as np

import cospeech
from cospeech.cli.demo import EXAMPLE
from cospeech.rules import STYLES

speech = cospeech.Speech.load(sys.argv[1] if len(sys.argv) > 1 else EXAMPLE)
model = cospeech.load("rules")
styles = {
    "natural": STYLES["natural"],
    "small": replace(STYLES["natural"], what="close to the body", amplitude=0.6, breadth=-0.05, torso=0.5),
    "large": replace(STYLES["natural"], what="for the last row", amplitude=1.4, height=0.1, rate=0.95, torso=1.4),
}

for name, style in styles.items():
    motion = model.generate(speech, style=style, seed=1)
    hands = motion.positions()[:, [motion.skeleton.index[f"{side}Hand"] for side in ("left", "right")]]
    speed = np.linalg.norm(np.diff(hands, axis=0), axis=-1) * motion.fps
    print(f"{name:8s} hands move at {speed.mean():.2f} m/s, up to {speed.max():.2f} m/s")
