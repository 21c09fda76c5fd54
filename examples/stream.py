"""Generate motion piece by piece while the speech comes in. Here the speech comes from a file, cut as a microphone would."""

import sys

import cospeech
from cospeech.cli.demo import EXAMPLE

speech = cospeech.Speech.load(sys.argv[1] if len(sys.argv) > 1 else EXAMPLE)
model = cospeech.load("rules")

frames = 0
for piece in model.stream(speech.chunks(seconds=0.2), style="natural", fps=30):
    frames += len(piece)  # send piece.rotations, piece.root and piece.face to your character here
    print(f"from {piece.start:6.2f} s: {len(piece):3d} frames, jaw at {piece.face[-1, 17]:.2f}")

assert frames == speech.frames(30)
print(f"{frames} frames; each was ready at most {model.latency:.2f} s, and a piece, after its moment of speech was heard")
