"""Measures how well emotions are heard in speech, and whether gestures show them (docs/emotion_from_speech.md).

    python tools/measure_emotion.py voices STORE WORK [--recipe FILE] [--held-out 2] [--steps N]
    python tools/measure_emotion.py recordings FOLDER [RUN ...]
    python tools/measure_emotion.py gestures MODEL SPEECH... [--seeds 3] [--seconds 20]

``voices`` trains a speech classifier on all but two speakers of a store, tests it on these, and goes on to the next two; runs
are kept in WORK. ``recordings`` tests such runs, and the rules' mood, on sound files whose names say the emotion
(``claire_anger.wav``; joy is happiness; names without one, or with "outofbreath", are passed over). ``gestures`` compares the
wrists of what a model makes in each emotion with what it makes neutrally.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch

import cospeech
from cospeech.audio.features import analyse, audio_features, reduce_audio
from cospeech.audio.features.mel import FPS
from cospeech.audio.speech import Speech
from cospeech.corpora.store import Store
from cospeech.metrics.macro_f1 import macro_f1
from cospeech.metrics.sample import Score
from cospeech.metrics.wrists import Wrists, against, wrists_of
from cospeech.rules import EMOTIONS, RuleBasedModel
from cospeech.training.checkpoint import load_run, read_tensors
from cospeech.training.recipe import load_recipe
from cospeech.training.train import train

PIECE = 3.5  # seconds; ours: as long as a sentence, and what a listener needs to hear a mood
SPOKEN = {"neutral": "neutral", "anger": "anger", "joy": "happiness", "sadness": "sadness"}
"""Word in the name of a file → emotion."""

Array = np.ndarray
Hear = Callable[[Speech], Array]
"""Speech → (8,) logarithms of how likely the emotions are."""


def format_score(score: Score) -> str:
    ends = "" if score.interval is None else f" ({score.interval[0]:.2f} … {score.interval[1]:.2f})"
    return f"{score.value:.2f}{ends}"


def pieces(length: int, size: int) -> Iterator[slice]:
    """Cut a length into pieces of one size, one at least; the last piece has the rest, too."""
    count = max(1, length // size)
    for k in range(count):
        yield slice(k * size, length if k == count - 1 else (k + 1) * size)


class Run:
    """A trained speech classifier: rows of features as a store has them → logits of the emotions."""

    def __init__(self, folder: Path) -> None:
        self.model, self.facts = load_run(folder)
        self.statistics = read_tensors(folder / "statistics.safetensors")[0]
        self.fps = float(self.facts["store"]["fps"])
        self.size = round(PIECE * self.fps)

    @torch.no_grad()
    def __call__(self, rows: Array) -> Array:
        """(T, 84) → (T, 8) logits."""
        features = torch.from_numpy(np.asarray(reduce_audio(rows, self.facts["recipe"]["data"]["audio"]), np.float32))
        features = (features - self.statistics["audio_mean"]) / self.statistics["audio_std"]
        logits: Array = self.model(features[None])[0, :, -len(EMOTIONS) :].numpy()
        return logits

    def hear(self, speech: Speech) -> Array:
        return self(audio_features(speech, speech.frames(self.fps), self.fps)).mean(0)


def confusion(true: list[int], answers: list[int]) -> str:
    """Counts as lines of text: a row for each true emotion, a column for each answer."""
    lines = [" " * 11 + " ".join(f"{name[:7]:>7}" for name in EMOTIONS)]
    for k, name in enumerate(EMOTIONS):
        counts = [sum(t == k and s == j for t, s in zip(true, answers, strict=True)) for j in range(len(EMOTIONS))]
        if sum(counts):
            lines.append(f"{name:11}" + " ".join(f"{count:7d}" for count in counts))
    return "\n".join(lines)


def voices(store: Store, work: Path, recipe_file: Path, held_out: int, steps: int | None) -> None:
    """Print macro-F1 on speakers that the classifier was not trained on; each is left out once."""
    recipe = load_recipe(recipe_file)
    if steps is not None:
        recipe = replace(recipe, train=replace(recipe.train, steps=steps))
    true: dict[str, list[int]] = {"piece": [], "clip": []}
    answers: dict[str, list[int]] = {"piece": [], "clip": []}
    names: dict[str, list[str]] = {"piece": [], "clip": []}
    for first in range(0, len(store.speakers), held_out):
        new = store.speakers[first : first + held_out]
        folder = work / ("without-" + "-".join(new))
        if not (folder / "best.safetensors").is_file():
            speakers = tuple(name for name in store.speakers if name not in new)
            train(replace(recipe, data=replace(recipe.data, speakers=speakers)), store, folder)
        run = Run(folder)
        for entry in store.clips:
            if entry.speaker not in new or "emotion" not in entry.has:
                continue
            arrays = store.clip(entry)
            logits, emotion = run(np.asarray(arrays["audio"])), int(arrays["emotion"][0])
            for what, size in (("piece", run.size), ("clip", len(logits))):
                for part in pieces(len(logits), size):
                    true[what].append(emotion)
                    answers[what].append(int(logits[part].mean(0).argmax()))
                    names[what].append(entry.name)
        print(f"without {', '.join(new)}: {len(names['clip'])} clips so far", flush=True)
    for what, words in (("piece", f"pieces of {PIECE} s"), ("clip", "clips")):
        score = macro_f1(true[what], answers[what], names[what], classes=len(EMOTIONS))
        always = macro_f1(true[what], [0] * len(true[what]), names[what], classes=len(EMOTIONS))
        print(f"{words}: macro-F1 {format_score(score)} of {score.count}, {score.note}; always neutral {always.value:.2f}")
    print(confusion(true["clip"], answers["clip"]))


def mood(speech: Speech) -> Array:
    """(8,) logarithms of the emotions that the rules detect in the whole speech."""
    session = RuleBasedModel().session(emotion="auto", seed=0, fps=15.0)
    for chunk in speech.chunks(2.0):
        session.push(chunk)
    session.finish()
    return np.log([session.emotion[name] + 1e-9 for name in EMOTIONS])


def find_recordings(folder: Path) -> list[tuple[str, int, Speech]]:
    """(name, emotion, speech) of recordings with an emotion in their names, without the loops of one (``…_16khz_20_sec``)."""
    rows = []
    for path in sorted(folder.iterdir()):
        words = path.stem.lower().split("_")
        emotion = next((SPOKEN[word] for word in words if word in SPOKEN), None)
        if emotion is not None and "khz" not in path.stem and path.suffix in (".flac", ".wav"):
            rows.append((path.stem, EMOTIONS.index(emotion), Speech.load(path)))
    return rows


def cues(speech: Speech) -> str:
    """A row about the spoken frames: level and range of pitch, brightness, how fast the loudness changes."""
    features = analyse(speech)
    loud = features.energy > np.percentile(features.energy, 95) - 25
    octaves = np.log2(features.pitch[loud & (features.pitch > 0)])
    spread = np.subtract(*np.percentile(octaves, [90, 10]))
    bright = features.bands[loud, 3:].mean() - features.bands[loud, 1].mean()
    quick = np.abs(np.diff(features.energy[loud])).mean() * FPS
    return f"{2 ** np.median(octaves):.0f} Hz | {spread:.2f} octaves | {bright:.1f} dB | {quick:.0f} dB/s"


def recordings(folder: Path, runs: list[Path]) -> None:
    """Macro-F1 on acted recordings of people: among all emotions, and among those that occur."""
    ways: dict[str, Hear] = {"the rules' mood": mood} | {str(run): Run(run).hear for run in runs}
    clips = find_recordings(folder)
    print("| | pitch | range of 80 % | above 1.5 kHz | change of loudness |\n| --- | ---: | ---: | ---: | ---: |")
    for clip, _, speech in clips:
        print(f"| {clip} | {cues(speech)} |")
    there = sorted({emotion for _, emotion, _ in clips})
    for name, hear in ways.items():
        true, names, whole = [], [], []
        logits = []
        for clip, emotion, speech in clips:
            whole.append(hear(speech))
            for part in pieces(len(speech), round(PIECE * speech.rate)):
                logits.append(hear(Speech(speech.samples[part], speech.rate)))
                true.append(emotion)
                names.append(clip)
        print(f"{name}")
        parts = [("clips", whole, [e for _, e, _ in clips], [c for c, _, _ in clips]), ("pieces", logits, true, names)]
        for what, outputs, right, own in parts:
            for among, labels in (("all eight", list(range(len(EMOTIONS)))), (f"the {len(there)} that occur", there)):
                answers = [labels[int(np.argmax(row[labels]))] for row in outputs]
                score = macro_f1(right, answers, own, classes=len(EMOTIONS))
                print(f"  {what}, among {among}: macro-F1 {format_score(score)} of {score.count}")
        print(confusion([e for _, e, _ in clips], [int(np.argmax(row)) for row in whole]), flush=True)


def gestures(name: str, paths: list[Path], seeds: int, seconds: float) -> None:
    """Print a table that compares the wrists in each emotion with those in neutral."""
    model = cospeech.load(name)
    speeches = [Speech.load(path) for path in paths]
    speeches = [speech.window(speech.start, speech.start + seconds) for speech in speeches]
    wrists: dict[str, list[Wrists]] = {
        emotion: [wrists_of(model.generate(s, emotion=emotion, seed=k)) for s in speeches for k in range(seeds)]
        for emotion in EMOTIONS
    }
    print(f"{name}: {len(speeches)} speeches, {seeds} seeds; times neutral\n")
    print("| | wrists from the body | box of the wrists | speed |\n| --- | --- | --- | --- |")
    for emotion in EMOTIONS[1:]:
        print(
            f"| {emotion} | "
            + " | ".join(format_score(score) for score in against(wrists[emotion], wrists["neutral"]).values())
            + " |"
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parts = parser.add_subparsers(dest="what", required=True)
    part = parts.add_parser("voices")
    part.add_argument("store", type=Path)
    part.add_argument("work", type=Path)
    part.add_argument("--recipe", default="speech_classifier")
    part.add_argument("--held-out", type=int, default=2)
    part.add_argument("--steps", type=int)
    part = parts.add_parser("recordings")
    part.add_argument("folder", type=Path)
    part.add_argument("runs", type=Path, nargs="*")
    part = parts.add_parser("gestures")
    part.add_argument("model")
    part.add_argument("speech", type=Path, nargs="+")
    part.add_argument("--seeds", type=int, default=3)
    part.add_argument("--seconds", type=float, default=20.0)
    options = parser.parse_args()
    if options.what == "voices":
        voices(Store(options.store), options.work, options.recipe, options.held_out, options.steps)
    elif options.what == "recordings":
        recordings(options.folder, options.runs)
    else:
        gestures(options.model, options.speech, options.seeds, options.seconds)


if __name__ == "__main__":
    main()
