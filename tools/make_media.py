"""`make media`: the pictures of README and docs, made from the example speech by the program itself."""

from __future__ import annotations

from pathlib import Path

import cospeech
from cospeech.demo import EXAMPLE, EXAMPLE_WORDS

MEDIA = Path(__file__).resolve().parents[1] / "docs" / "media"
SECONDS = (0.0, 9.2)  # of the example: two sentences, of greeting, and of small and huge
STYLE, SEED = "lively", 0


def main() -> None:
    speech = cospeech.Speech.load(EXAMPLE, transcript=EXAMPLE_WORDS)
    motion = cospeech.load("rules").generate(speech, style=STYLE, seed=SEED)
    first, last = (round(t * motion.fps) for t in SECONDS)
    MEDIA.mkdir(exist_ok=True)
    motion[first:last].save(MEDIA / "talk.gif", size=(420, 420), rate=12.5)
    motion.save(MEDIA / "strip.png", audio=EXAMPLE)
    for path in sorted(MEDIA.iterdir()):
        print(f"{path.name}: {path.stat().st_size / 1e6:.2f} MB")


if __name__ == "__main__":
    main()
