"""Trains what hears emotion in a voice, prints how well it does on voices that it never heard, and writes the weights.

    python tools/train_voice_emotion.py EMODB SPEECH WORK [--write]

EMODB is a folder with EmoDB's ``labels.csv`` and clips (Burkhardt et al. 2005, CC0). SPEECH holds recordings of readers, in a
folder each; ``a2f_emotional`` in it is a test alone. Functionals are kept in WORK. ``--write`` replaces the shipped weights.

Voices that act by rule (`cospeech.corpora.synthetic.acting`) are made of the readers and of the neutral clips of the actors.
Ten folds leave out an actor each, with the voices made of the actor, and of a reader where there is one left.
"""

from __future__ import annotations

import argparse
import csv
import re
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.optimize import minimize_scalar
from sklearn.linear_model import LogisticRegression, Ridge
from sklearn.metrics import confusion_matrix, f1_score, recall_score, roc_auc_score

from cospeech.audio.emotions import EMOTIONS
from cospeech.audio.features.prosody import Features, analyse
from cospeech.audio.speech import Speech
from cospeech.audio.voice_emotion import (
    CATEGORIES,
    LOOKS,
    WINDOW,
    ConfidentEmotion,
    RunningLevel,
    VoiceEmotion,
    VoiceWeights,
    judge_voice,
)
from cospeech.audio.voice_functionals import LEVELS, measure_voice
from cospeech.corpora.synthetic.acting import Actor, act
from cospeech.files import atomic

Array = np.ndarray
ASSET = Path(__file__).parents[1] / "src" / "cospeech" / "assets" / "voice_emotion.npz"
AROUSAL = {"anger": 1.0, "happiness": 1.0, "fear": 1.0, "surprise": 1.0, "neutral": 0.0, "sadness": -1.0, "boredom": -1.0}
"""Emotion → target of the arousal; the literature says nothing certain of disgust and contempt."""
STRENGTH = 0.02  # of the prior of the logistic regression [ours: the best of .005, .02, .08 within the training actors]
RIDGE = 300.0  # penalty of the arousal [ours]
COPIES = 3  # histories of each clip of EmoDB in training [ours]
HISTORY = 60  # most windows of a history [ours: 2 min]
GAIN = 8.0  # dB, standard deviation of microphones [ours]
PIECE, PARTS = 8.0, 2  # seconds of an acted recording; actors by rule that each reader is [ours]
SHUFFLES = 3  # orders in which the clips of an actor are heard [ours]


@dataclass(frozen=True)
class Clips:
    """Windows of speech: functionals (N, F), emotions, voices, and which recording each is of."""

    rows: Array
    emotions: Array
    voices: Array
    recordings: Array

    def of(self, selection: Array) -> Clips:
        """The selected windows."""
        return Clips(self.rows[selection], self.emotions[selection], self.voices[selection], self.recordings[selection])


def read_windows(samples: Array, hop: float | None) -> list[Array]:
    """Functionals of the windows of a recording; of the whole where there is no hop."""
    features = analyse(np.asarray(samples, np.float32), mel=True)
    size, step = round(WINDOW * features.fps), round((hop or WINDOW) * features.fps)
    starts = range(0, max(len(features) - size + 2, 1), step) if hop else [0]
    rows = [measure_voice(features[a : a + size]) for a in starts]
    return [row for row in rows if row is not None]


def gather(recordings: list[tuple[Array, str, str]], hop: float | None) -> Clips:
    """Windows of recordings (samples, emotion, voice)."""
    rows, facts = list[Array](), list[tuple[str, str, int]]()
    for number, (samples, emotion, voice) in enumerate(recordings):
        own = read_windows(samples, hop)
        rows += own
        facts += [(emotion, voice, number)] * len(own)
    emotions, voices, numbers = zip(*facts, strict=True)
    return Clips(np.array(rows), np.array(emotions), np.array(voices), np.array(numbers))


def read_emodb(folder: Path) -> list[tuple[Array, str, str]]:
    """(samples, emotion, actor) of every clip."""
    with (folder / "labels.csv").open(encoding="utf-8") as file:
        return [(load(folder / row["file"]), row["emotion"], row["speaker"]) for row in csv.DictReader(file)]


def read_readers(folder: Path) -> dict[str, list[Array]]:
    """Reader → recordings."""
    readers: dict[str, list[Array]] = {}
    for path in sorted(folder.glob("*/*.flac")):
        if path.parent.name != "a2f_emotional" and not path.stem.startswith("single-mic") and path.stem != "jfk":
            speaker = re.search(r"spk\d+", path.stem)
            readers.setdefault(path.parent.name + (f"-{speaker[0]}" if speaker else ""), []).append(load(path))
    return readers


def load(path: Path) -> Array:
    """Samples at 16 kHz."""
    samples: Array = Speech.load(path, rate=16_000).samples
    return samples


def act_voices(readers: dict[str, list[Array]]) -> list[tuple[Array, str, str]]:
    """Each reader as `PARTS` actors by rule, in each emotion, twice neutral."""
    clips = []
    for who, (reader, recordings) in enumerate(readers.items()):
        pause = np.zeros(3200, np.float32)
        sound, size = np.concatenate([part for each in recordings[:9] for part in (each, pause)]), round(PIECE * 16_000)
        pieces = [sound[a : a + size] for a in range(0, max(len(sound) - size // 2, 1), size)]
        count = 0
        for part in range(PARTS):
            actor = Actor(5, who * PARTS + part)
            for emotion in ("neutral", *EMOTIONS):
                speech, seed = Speech(pieces[count % len(pieces)], 16_000), 1000 * who + count
                clips.append((act(speech, actor.acting(emotion, seed), seed).samples, emotion, reader))
                count += 1
    return clips


def load_clips(path: Path, make: object) -> Clips:
    """Load windows from a file; where there is none, make and write them first."""
    if not path.is_file():
        clips: Clips = make()  # type: ignore[operator]
        with atomic(path) as temporary, temporary.open("wb") as out:
            np.savez(out, **vars(clips))
    with np.load(path, allow_pickle=False) as arrays:
        return Clips(*(arrays[name] for name in ("rows", "emotions", "voices", "recordings")))


def draw_histories(clips: Clips, usual: VoiceWeights, rng: np.random.Generator) -> Array:
    """(N, F) rows, standardised by the level of the voice after some random windows, through a random microphone."""
    out = np.empty_like(clips.rows)
    for voice in np.unique(clips.voices):
        own, gain = np.flatnonzero(clips.voices == voice), np.zeros(clips.rows.shape[1])
        for k in own:
            gain[list(LEVELS)] = rng.normal(0, GAIN)
            level = RunningLevel(usual)
            for other in rng.choice(own, int(np.exp(rng.uniform(0, np.log(HISTORY)))) - 1):
                level.standardise(clips.rows[other] + gain)
            out[k] = level.standardise(clips.rows[k] + gain)
    return out


def play_session(clips: Clips, usual: VoiceWeights, rng: np.random.Generator) -> tuple[Array, Array]:
    """(N, F) rows and (N,) places: recordings of each voice in random order, standardised by what was heard so far."""
    out, places = np.empty_like(clips.rows), np.empty(len(clips.rows), int)
    for voice in np.unique(clips.voices):
        own, level = np.flatnonzero(clips.voices == voice), RunningLevel(usual)
        order = [k for n in rng.permutation(np.unique(clips.recordings[own])) for k in own[clips.recordings[own] == n]]
        for place, k in enumerate(order):
            out[k], places[k] = level.standardise(clips.rows[k]), place
    return out, places


def fit(real: Clips, synthetic: Clips, seed: int) -> VoiceWeights:
    """Train on real and synthetic clips; each class of each of the two weighs the same."""
    rng = np.random.default_rng(seed)
    rows = np.concatenate([real.rows, synthetic.rows])
    nothing = np.zeros((0, 0))
    usual = VoiceWeights(rows.mean(0), rows.std(0) + 1e-6, nothing, nothing)
    inputs = np.concatenate([*(draw_histories(real, usual, rng) for _ in range(COPIES)), draw_histories(synthetic, usual, rng)])
    emotions = [np.tile(real.emotions, COPIES), synthetic.emotions]
    names, weights = np.concatenate(emotions), np.concatenate([balance(each) for each in emotions])
    model = LogisticRegression(C=STRENGTH, max_iter=1000).fit(inputs, names, sample_weight=weights)
    place = [list(model.classes_).index(name) for name in CATEGORIES]
    has_arousal = np.isin(names, list(AROUSAL))
    arousals = [AROUSAL[name] for name in names[has_arousal]]
    line = Ridge(RIDGE).fit(inputs[has_arousal], arousals, sample_weight=weights[has_arousal])
    categories = np.concatenate([model.coef_, model.intercept_[:, None]], 1)[place]
    return replace(usual, categories=categories, arousal=np.append(line.coef_, line.intercept_))


def balance(emotions: Array) -> Array:
    """Weights: each emotion alike, 500 in all."""
    names, counts = np.unique(emotions, return_counts=True)
    return np.array([500 / len(names) / counts[np.searchsorted(names, one)] for one in emotions])


def cool(weights: VoiceWeights, temperature: float) -> VoiceWeights:
    """Logits divided by a temperature."""
    return replace(weights, categories=weights.categories / temperature)


def judge(rows: Array, weights: VoiceWeights) -> tuple[Array, Array]:
    """(N,) arousal and (N, C) logarithms of probabilities."""
    looks = [judge_voice(row, weights) for row in rows]
    return np.array([look.arousal for look in looks]), np.array([look.logits for look in looks])


def among(logits: Array, names: list[str]) -> Array:
    """(N, n) logarithms of probabilities among some categories."""
    own = logits[:, [CATEGORIES.index(name) for name in names]]
    log_shares: Array = own - np.log(np.exp(own).sum(1, keepdims=True))
    return log_shares


def best_temperature(logits: Array, emotions: Array, names: list[str]) -> float:
    """At which the probabilities have the least cross-entropy (Guo et al. 2017, "On calibration of modern neural networks")."""
    true, weights = np.array([names.index(one) for one in emotions]), balance(emotions)

    def loss(temperature: float) -> float:
        return -float(weights @ among(logits / temperature, names)[np.arange(len(true)), true])

    return float(minimize_scalar(loss, bounds=(0.3, 5.0), method="bounded").x)


def calibration_error(shares: Array, right: Array) -> float:
    """Mean difference of confidence and accuracy over ten bins of confidence, weighted by their counts."""
    sure = shares.max(1)
    bins = np.minimum((sure * 10).astype(int), 9)
    return float(sum(abs((sure - right)[bins == k].sum()) for k in range(10)) / len(sure))


def neutral_share(samples: Array, weights: VoiceWeights) -> tuple[int, int]:
    """Seconds of a speech in which neutral is played, and seconds of the whole speech."""
    looks = follow(analyse(samples, mel=True), weights)
    return round(LOOKS * sum(shares[0] >= 0.5 for shares, _, _ in looks)), round(LOOKS * len(looks))


def follow(frames: Features, weights: VoiceWeights) -> list[tuple[Array, Array, float]]:
    """(emotion that is played, emotion that is heard, arousal) of each look, as in a stream."""
    voice, emotion, rows = VoiceEmotion(weights), ConfidentEmotion(), []
    for k in range(1, int(len(frames) / frames.fps / LOOKS) + 1):
        until = k * LOOKS
        voice.push(frames[round((until - LOOKS) * frames.fps) : round(until * frames.fps)])
        look = voice.look(until)
        rows.append((emotion.follow(look), emotion.probabilities, 0.0 if look is None else look.arousal))
    return rows


@dataclass
class Folds:
    """Results on the voices that were left out of the training."""

    real: list[tuple[Clips, Array, Array, Array]]
    synthetic: list[tuple[Clips, Array]]
    weights: dict[str, VoiceWeights]
    """Voice → weights that were trained without it."""


def leave_out(real: Clips, synthetic: Clips) -> Folds:
    """Train ten folds, and test each on the voices that it leaves out."""
    actors, readers = np.unique(real.voices), [name for name in np.unique(synthetic.voices) if name not in real.voices]
    folds = Folds([], [], {})
    for k, actor in enumerate(actors):
        out = [str(actor), *readers[k :: len(actors)]]
        weights = fit(real.of(real.voices != actor), synthetic.of(~np.isin(synthetic.voices, out)), k)
        folds.weights |= dict.fromkeys(out, weights)
        rng = np.random.default_rng(100 + k)
        for _ in range(SHUFFLES):
            own = real.of(real.voices == actor)
            rows, places = play_session(own, weights, rng)
            folds.real.append((own, *judge(rows, weights), places))
        own = synthetic.of(np.isin(synthetic.voices, out))
        folds.synthetic.append((own, judge(play_session(own, weights, rng)[0], weights)[1]))
        print(f"without {', '.join(out)}", flush=True)
    return folds


def print_real(folds: Folds, temperature: float) -> None:
    """Print the results on EmoDB; each actor is left out in turn."""
    names = sorted({str(name) for clips, *_ in folds.real for name in clips.emotions})
    true = np.concatenate([clips.emotions for clips, *_ in folds.real])
    arousal, places = (np.concatenate([each[k] for each in folds.real]) for k in (1, 3))
    shares = np.exp(among(np.concatenate([each[2] for each in folds.real]) / temperature, names))
    answers = np.array(names)[shares.argmax(1)]
    high, low = np.isin(true, ["anger", "happiness", "fear"]), np.isin(true, ["sadness", "boredom"])
    has_arousal = high | low
    first = places < 5
    print(f"EmoDB: UAR {recall_score(true, answers, average='macro'):.3f} of {len(names)} emotions")
    print(f"  first five clips of a voice {recall_score(true[first], answers[first], average='macro'):.3f}", end=", ")
    print(f"later ones {recall_score(true[~first], answers[~first], average='macro'):.3f}")
    print(
        f"  arousal: AUC {roc_auc_score(high[has_arousal], arousal[has_arousal]):.3f}; "
        f"of neutral {arousal[true == 'neutral'].mean():+.2f}"
    )
    print(f"  calibration error {calibration_error(shares, answers == true):.3f} at temperature {temperature:.2f}")
    for least in (0.5, 0.75):
        sure = shares.max(1) >= least
        right = np.mean(answers[sure] == true[sure])
        print(f"  probability of {least} or more: {sure.mean():.2f} of the clips, {right:.2f} of them right")
    print(names, confusion_matrix(true, answers, labels=names, normalize="true").round(2), sep="\n")


def print_acted(folds: Folds, temperature: float) -> None:
    """Print the results on voices that act by rule; they are left out in turn."""
    names = list(EMOTIONS)
    logits = np.concatenate([among(own / temperature, names) for _, own in folds.synthetic])
    true, numbers = (
        np.concatenate([getattr(clips, what) for clips, _ in folds.synthetic]) for what in ("emotions", "recordings")
    )
    answers = np.array(names)[logits.argmax(1)]
    each = [np.flatnonzero(numbers == n) for n in np.unique(numbers)]
    clips = [true[own[0]] for own in each]
    clip_answers = [names[int(logits[own].mean(0).argmax())] for own in each]
    print(f"acting by rule: macro-F1 of windows {f1_score(true, answers, average='macro'):.3f} ({len(true)})", end=", ")
    print(f"of recordings {f1_score(clips, clip_answers, average='macro'):.3f} ({len(clips)})")
    print(dict(zip(names, f1_score(clips, clip_answers, average=None, labels=names).round(2).tolist(), strict=True)))


def print_neutral(folds: Folds, readers: dict[str, list[Array]], temperature: float) -> None:
    """Print the seconds of neutral speech in which neutral is played, by weights that were trained without the voice."""
    total = np.zeros(2, int)
    for name, recordings in readers.items():
        own = neutral_share(np.concatenate(recordings), cool(folds.weights[name], temperature))
        total += own
        print(f"  {name}: neutral in {own[0]} of {own[1]} s")
    print(f"neutral speech: neutral in {total[0] / total[1]:.1%} of {total[1]} s")


def print_recordings(folder: Path, weights: VoiceWeights) -> None:
    """Print each recording of an actress who is not in the training data."""
    for path in sorted(folder.glob("*.flac")):
        if "hz" not in path.stem:
            looks = follow(analyse(load(path), mel=True), weights)
            probabilities, mix = (np.mean([look[k] for look in looks], 0) for k in (1, 0))
            best = int(np.argmax(probabilities))
            level = np.mean([look[2] for look in looks])
            print(f"  {path.stem}: arousal {level:+.2f}, heard {EMOTIONS[best]} {probabilities[best]:.2f}, ", end="")
            print(f"played {EMOTIONS[int(mix.argmax())]} {mix.max():.2f}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("emodb", type=Path)
    parser.add_argument("speech", type=Path)
    parser.add_argument("work", type=Path)
    parser.add_argument("--write", action="store_true")
    options = parser.parse_args()
    options.work.mkdir(parents=True, exist_ok=True)
    clips, readers = read_emodb(options.emodb), read_readers(options.speech)
    calm = {actor: [s for s, emotion, who in clips if (emotion, who) == ("neutral", actor)] for _, _, actor in clips}
    real = load_clips(options.work / "real.npz", lambda: gather(clips, None))
    synthetic = load_clips(options.work / "acted.npz", lambda: gather(act_voices(readers | calm), WINDOW / 2))
    folds = leave_out(real, synthetic)
    names = sorted({str(name) for name in real.emotions})
    outputs = [(each[2], each[0].emotions) for each in folds.real]
    temperature = best_temperature(*(np.concatenate(part) for part in zip(*outputs, strict=True)), names)
    print_real(folds, temperature)
    print_acted(folds, temperature)
    print_neutral(folds, readers, temperature)
    weights = cool(fit(real, synthetic, 99), temperature)
    print_recordings(options.speech / "a2f_emotional", weights)
    if options.write:
        with atomic(ASSET) as temporary, temporary.open("wb") as out:
            np.savez(out, **{name: value.astype(np.float32) for name, value in vars(weights).items()})


if __name__ == "__main__":
    main()
