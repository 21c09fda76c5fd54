"""Measures mixtures of two styles (`cospeech.experiments.style_mixing`): a table on the screen, and curves with heat maps as a
picture.

    python tools/measure_mixing.py BUNDLE SPEECH... [--pair ada,ben] [--pair cleo,dan] [--store STORE] [--out FILE]

BUNDLE is a name (``mix-stage``), a bundle or a run; SPEECH a sound file; STORE has the recordings of the styles' speakers,
which are measured too. docs/mixing.md has what came out.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from PIL import Image

import cospeech
from cospeech.audio.speech import Speech
from cospeech.corpora.attributes import speaker_attributes
from cospeech.corpora.store import Store
from cospeech.experiments.style_mixing import APART, MEASURES, TAKES, TOLERANCE, Mixing, draw_mixing, fall_back, measure_mixing
from cospeech.files import atomic
from cospeech.motion.poses import find_pose


def table(mixing: Mixing) -> str:
    """A pair as a table in Markdown: a row for each weight, the mean and its standard error, and how far it falls back."""
    a, b = mixing.pair
    lines = [f"| {a} | {b} | " + " | ".join(name for name, _ in MEASURES.values()) + " |", "| --- " * (2 + len(MEASURES)) + "|"]
    for k, w in enumerate(mixing.weights):
        cells = [
            f"{mixing.means(m)[k] * factor:.3g} ± {mixing.errors(m)[k] * factor:.2g}" for m, (_, factor) in MEASURES.items()
        ]
        lines.append(f"| {1 - w:g} | {w:g} | " + " | ".join(cells) + " |")
    backs = [f"{fall_back(mixing.means(m).tolist()):.0%}" if mixing.contrast(m) >= APART else "alike" for m in MEASURES]
    return "\n".join([*lines, "| falls back by | | " + " | ".join(backs) + " |"])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("bundle")
    parser.add_argument("speech", nargs="+", type=Path)
    parser.add_argument("--pair", action="append", metavar="A,B", help="styles; may be given more than once")
    parser.add_argument("--store", type=Path)
    parser.add_argument("--takes", type=int, default=TAKES)
    parser.add_argument("--seconds", type=float, default=60.0, help="of each speech at most")
    parser.add_argument("--title", default="Mixtures of two styles")
    parser.add_argument("--out", type=Path, default=Path("docs/media/mixing.png"))
    options = parser.parse_args()
    model = cospeech.load(options.bundle)
    speeches = [Speech.load(path) for path in options.speech]
    speeches = [speech.window(speech.start, speech.start + min(options.seconds, speech.duration)) for speech in speeches]
    seconds = float(sum(speech.duration for speech in speeches))
    print(f"{len(speeches)} speeches, {seconds:.0f} s, {options.takes} takes; tolerance {TOLERANCE:.0%}")
    mixings = []
    for pair in options.pair or ["ada,ben"]:
        a, _, b = pair.partition(",")
        mixings.append(measure_mixing(model, speeches, (a.strip(), b.strip()), takes=options.takes))
        print(f"\n{table(mixings[-1])}", flush=True)
    attributes = {}
    if options.store is not None:
        store = Store(options.store)
        attributes = speaker_attributes(store, find_pose(store.pose).decode)
        for name in sorted({name for mixing in mixings for name in mixing.pair} & {*attributes}):
            values = (f"{getattr(attributes[name], m) * factor:.3g} {text}" for m, (text, factor) in MEASURES.items())
            print(f"{name}'s recordings: {'; '.join(values)}")
    picture = draw_mixing(mixings, title=options.title, recordings=attributes)
    with atomic(options.out) as temporary:
        Image.fromarray(picture).save(temporary, "PNG", optimize=True)
    print(f"\nwrote {options.out}")


if __name__ == "__main__":
    main()
