"""How well words of subtitles lie on the sound: ``python benchmarks/transcripts.py SHARED``, as Markdown.

Subtitles are made of known word times: with exact times, and with those that people write, early and late. Then the readers
place the words: by their length, without the sound, and aligned, with it. The errors are those of the starts of words, median
and 90 %. SHARED is a folder with ``data/speech/librivox`` and ``data/face_grid_s1``; without it, only our example is read.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np

from cospeech import Speech
from cospeech.audio.speech import Word, example
from cospeech.audio.transcripts import load_words

PAUSE = 0.6  # seconds, at which a subtitle ends
EVERY = slice(5, None, 60)  # of the clips of GRID


class Cutting(NamedTuple):
    """How words become subtitles: letters, and seconds that one begins early and ends late."""

    letters: int
    early: float
    late: float


CUTTINGS = {
    "one line, exact times": Cutting(42, 0.0, 0.0),
    "one line, .2 s early and .5 s late": Cutting(42, 0.2, 0.5),
    "two lines, .1 s early and .3 s late": Cutting(84, 0.1, 0.3),
    "all in one, exact times": Cutting(10**6, 0.0, 0.0),
}


def recordings(folder: Path | None) -> Iterator[tuple[str, Speech, list[Word]]]:
    """(set, speech, words with their true times)."""
    sound, grid = example()
    speech = Speech.load(sound, transcript=grid)
    texts = sound.with_suffix(".txt").read_text("utf-8").split()
    assert speech.words is not None
    assert len(texts) == len(speech.words)
    yield "our example", speech, [Word(text, w.start, w.end) for text, w in zip(texts, speech.words, strict=True)]
    if folder is None:
        return
    for path in sorted((folder / "data" / "speech" / "librivox").glob("*.json")):
        if not path.with_suffix(".txt").is_file():  # phones
            continue
        rows = json.loads(path.read_text("utf-8").splitlines()[0])["w"]
        words = [Word(r["t"].split("(")[0], r["b"], r["b"] + r["d"]) for r in rows if r["t"][0] not in "<["]
        tokens = path.with_suffix(".txt").read_text("utf-8").split()
        if len(tokens) == len(words):  # with the signs that end sentences
            words = [Word(text, w.start, w.end) for text, w in zip(tokens, words, strict=True)]
        yield "LibriVox", Speech.load(path.with_suffix(".flac")), words
    grid = folder / "data" / "face_grid_s1"
    for path in sorted((grid / "words").glob("*.align"))[EVERY]:
        lines = [line.split() for line in path.read_text("utf-8").splitlines()]
        words = [Word(text, int(a) / 25_000, int(b) / 25_000) for a, b, text in lines if text not in ("sil", "sp")]
        yield "GRID", Speech.load(grid / "audio" / f"{path.stem}.flac"), words


def cut(words: list[Word], cutting: Cutting) -> list[list[Word]]:
    """Words by subtitles: these end with a sentence, at a pause, and where the letters do not suffice."""
    cues: list[list[Word]] = [[words[0]]]
    for before, word in pairwise(words):
        letters = len(" ".join(each.text for each in [*cues[-1], word]))
        ends = before.text[-1] in ".?!" or word.start - before.end > PAUSE
        if letters > cutting.letters or (ends and cutting.letters < 1000):
            cues.append([])
        cues[-1].append(word)
    return cues


def write(path: Path, cues: list[list[Word]], cutting: Cutting) -> None:
    """The subtitles as .srt; none reaches into the next one's first word, or begins before the last one's end."""
    lines, free = [], 0.0
    for k, cue in enumerate(cues):
        start = max(cue[0].start - cutting.early, free if free <= cue[0].start else cue[0].start, 0.0)
        end = cue[-1].end + cutting.late
        if k + 1 < len(cues):
            end = min(end, max(cue[-1].end, cues[k + 1][0].start - cutting.early))
        free = end
        lines.append(f"{k + 1}\n{clock(start)} --> {clock(end)}\n{' '.join(word.text for word in cue)}\n")
    path.write_text("\n".join(lines), "utf-8")


def clock(seconds: float) -> str:
    """A time as .srt writes it."""
    ms = round(seconds * 1000)
    return f"{ms // 3_600_000:02d}:{ms // 60_000 % 60:02d}:{ms // 1000 % 60:02d},{ms % 1000:03d}"


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("shared", type=Path, nargs="?")
    errors: dict[tuple[str, str], dict[str, list[list[float]]]] = {}
    with tempfile.TemporaryDirectory() as place:
        path = Path(place) / "talk.srt"
        for name, speech, words in recordings(parser.parse_args().shared):
            for label, cutting in CUTTINGS.items():
                write(path, cut(words, cutting), cutting)
                ways = {
                    "by length": load_words(path, speech_seconds=speech.seconds),
                    "aligned": load_words(path, speech=speech),
                }
                for way, guesses in ways.items():
                    assert len(guesses) == len(words), (name, label)
                    own = [abs(a.start - b.start) for a, b in zip(guesses, words, strict=True)]
                    errors.setdefault((label, way), {}).setdefault(name, []).append(own)
    sets = next(iter(errors.values()))
    counts = [f"{name}: {len(own)}, {sum(map(len, own))} words" for name, own in sets.items()]
    print(f"| subtitles | {' | '.join(counts)} |\n|---|{'---|' * len(sets)}")
    for (label, way), by_set in errors.items():
        cells = [", ".join(f"{q:.3f}" for q in np.quantile(np.concatenate(own), (0.5, 0.9))) for own in by_set.values()]
        print(f"| {label}: {way} | {' | '.join(cells)} |")
    for label in CUTTINGS:
        worse = {
            name: sum(
                bool(np.median(a) > np.median(b) + 0.005) for a, b in zip(own, errors[label, "by length"][name], strict=True)
            )
            for name, own in errors[label, "aligned"].items()
        }
        print(f"\n{label}: recordings whose median is worse by more than 5 ms: {worse}")


if __name__ == "__main__":
    main()
