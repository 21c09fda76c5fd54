"""Speed of every model whose weights ship, and how far it follows speech.

    OMP_NUM_THREADS=1 python benchmarks/models.py SPEECH                    # rows for docs/benchmarks.md
    OMP_NUM_THREADS=1 python benchmarks/models.py FOLDER --follow [--bundle FILE …] [--bare]

**Speed**: real-time factor, and that of `rules` without the learnt mouth. The speech is repeated to a minute. It is in memory,
and so is the motion: the figure holds features, body, hands and face, but neither decoding nor writing. It is processor time,
so that other work on the machine disturbs it less than it does a clock; the best of five runs counts, after one that warms up.

**Follow**: the recordings of a folder, or those that a synthetic corpus of the same folder keeps for the test (``--split``),
with pauses of 1 to 4 seconds put into them. Of a folder with the ``labels.csv`` of EmoDB only the calm ones are taken (neutral
and bored). The rules, which taught the networks, are the first row. Columns:

* silence ratio: mean speed of the wrists in pauses, from 1.2 s after the voice to 0.8 s before it, by that in speech. In
  brackets that of all of the pauses of 1 s or more: hands that come down move in there.
* beat lift (`cospeech.metrics.beat_lift`), and its share of the rules'.
* own: of pairs of recordings A and B, how many motions for A go better with A than with B (correlation of the wrists' speed
  with the envelope of energy, at the best lag).
* gains: smallest, median and largest factor on a style's deviations, which bundling measured.
"""

from __future__ import annotations

import argparse
import csv
import os
import platform
import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import cospeech
from cospeech.audio.features.prosody import find_pauses
from cospeech.corpora.synthetic.silences import cut_pieces
from cospeech.corpora.synthetic.speech_splits import split_recordings
from cospeech.corpora.synthetic.voices import recordings
from cospeech.metrics.beat_lift import LAGS, RATE, beat_lift, energy_envelope
from cospeech.metrics.movement import Track, wrist_speeds
from cospeech.models import MODELS, NETWORKS, SHIPPED, Model
from cospeech.rules import RuleBasedModel
from cospeech.rules.options import LAYERS

SECONDS = 60
RUNS = 5
PIECE, SHARE = 25.0, 0.3  # seconds of a recording before pauses are put into it; share of it that is then pauses
SHORTEST, AFTER, BEFORE = 1.0, 1.2, 0.8  # s of a pause; s after and before the voice in which hands may move
CALM = ("neutral", "boredom")
SHOWN = ("chain-of-generation", "mix-stage", "stylised-flow")
Player = tuple[str, Any, dict[str, Any]]
"""Name of a row, model, and the options that it generates with."""
BODY = {"parts": ("body", "hands"), "fps": 30.0, "emotion": "neutral"}


def measure_speed(model: Model, speech: cospeech.Speech) -> tuple[float, float]:
    """(seconds of processor time per second of speech, frames per second) of a model."""
    best = np.inf
    parts = tuple(part for part in ("face", "body", "hands") if part in model.makes)
    for _ in range(RUNS + 1):
        began = time.process_time()
        motion = model.generate(speech, parts=parts)
        best = min(best, time.process_time() - began)
    return best / speech.seconds, motion.fps


def print_speeds(path: str) -> None:
    """A row for each model."""
    one = cospeech.Speech.load(path)
    samples = np.resize(one.samples, SECONDS * one.rate)
    speech = cospeech.Speech(samples, one.rate)
    print(f"{platform.processor() or platform.machine()}, load {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores\n")
    names = [name for name in MODELS if name not in NETWORKS or (SHIPPED / f"{name}.cospeech").is_file()]
    rows = {"`rules`, mouth by rule": RuleBasedModel} | {f"`{name}`": partial(cospeech.load, name) for name in names}
    for name, make in rows.items():
        factor, fps = measure_speed(make(), speech)
        print(f"| {name} | {factor:.2g} | {fps:g} |", flush=True)


def read_recordings(folder: Path) -> Iterable[cospeech.Speech]:
    """All of a folder; of one whose ``labels.csv`` names the acted emotions, as EmoDB's does, the calm ones."""
    labels = folder / "labels.csv"
    if not labels.is_file():
        return recordings(folder)
    with labels.open(encoding="utf-8") as file:
        rows = sorted((row["speaker"], row["file"]) for row in csv.DictReader(file) if row["emotion"] in CALM)
    return (replace(cospeech.Speech.load(folder / name), name=f"{actor}/{Path(name).stem}") for actor, name in rows)


def held_out(folder: Path, split: str, share: float) -> list[cospeech.Speech]:
    """Recordings of a split, in pieces, with a share of pauses put into them."""
    speeches = read_recordings(folder)
    return cut_pieces(speeches if split == "all" else split_recordings(speeches)[split], PIECE, share)


def speeds(motion: cospeech.Motion) -> np.ndarray:
    """(n,) mean speed of both wrists at `RATE` values a second."""
    track = Track.of(motion)
    own = wrist_speeds(track).mean(1)
    return np.interp(np.arange(int(motion.duration * RATE)) / RATE, np.linspace(0, motion.duration, len(own)), own)


def pauses_of(speech: cospeech.Speech) -> list[tuple[float, float]]:
    """Pauses of the speech that last `SHORTEST` at least, in seconds."""
    energy = 10 * np.log10(np.maximum(energy_envelope(speech.samples, speech.rate), 1e-10))
    return find_pauses(energy, RATE, shortest=SHORTEST)


def silence_ratios(speeches: Sequence[cospeech.Speech], movements: Sequence[np.ndarray]) -> tuple[float, float]:
    """Speed in settled pauses and speed in all pauses, both divided by the speed in speech."""
    in_settled, in_pauses, in_speech = list[np.ndarray](), list[np.ndarray](), list[np.ndarray]()
    for speech, speed in zip(speeches, movements, strict=True):
        where = np.zeros(len(speed), int)
        for start, end in pauses_of(speech):
            where[round(start * RATE) : round(end * RATE)] = 1
            first = 0.0 if start < 0.1 else start + AFTER
            last = end if end > speech.seconds - 0.1 else end - BEFORE
            where[round(first * RATE) : round(max(last, first) * RATE)] = 2
        for values, kinds in ((in_settled, (2,)), (in_pauses, (1, 2)), (in_speech, (0,))):
            values.append(speed[np.isin(where, kinds)])
    speech_speed = np.concatenate(in_speech).mean()
    still, all_pauses = (
        np.concatenate(values).mean() if sum(map(len, values)) else np.nan for values in (in_settled, in_pauses)
    )
    return float(still / speech_speed), float(all_pauses / speech_speed)


def own_beats_others(speeches: Sequence[cospeech.Speech], movements: Sequence[np.ndarray]) -> float:
    """Share of pairs in which motion goes better with its own speech."""
    envelopes = [energy_envelope(speech.samples, speech.rate) for speech in speeches]
    wins = [
        match(speed, envelopes[a][: len(envelopes[b])]) > match(speed, envelopes[b][: len(envelopes[a])])
        for a, speed in enumerate(movements)
        for b in range(len(envelopes))
        if a != b
    ]
    return float(np.mean(wins))


def match(speed: np.ndarray, envelope: np.ndarray) -> float:
    """Best correlation of a speed with an envelope of energy, both at `RATE`, over the lags of beat lift."""
    correlations = []
    for lag in np.round(LAGS * RATE).astype(int):
        a, b = (speed[: len(speed) + lag], envelope[-lag:]) if lag < 0 else (speed[lag:], envelope)
        count = min(len(a), len(b))
        correlations.append(np.corrcoef(a[:count], b[:count])[0, 1])
    return float(np.nanmax(correlations))


def describe_gains(model: Any) -> str:
    """Gains of a network as text; flows have a deviation for each speaker instead."""
    system = getattr(model, "system", None)
    if system is None or system.flow is not None:
        return "–"
    s = system.statistics
    texts = []
    for gains in [s.style_gain] + ([s.live_style_gain] if {"make", "live"} <= set(system.networks) else []):
        texts.append(f"{gains.min():.2f} / {np.median(gains):.2f} / {gains.max():.2f}")
    return ", ".join(texts)


def players(bundles: Sequence[str] | None, options: dict[str, Any]) -> Iterator[Player]:
    """Each bundle (those that ship where none is given) as files have it, and live where it has a network for that."""
    for file in bundles or [SHIPPED / f"{name}.cospeech" for name in SHOWN]:
        model: Any = cospeech.load(str(file))
        two = {"make", "live"} <= set(model.system.networks)
        alone = options | model.for_files | dict.fromkeys(LAYERS, False)
        yield f"{Path(file).stem}{', offline' if two else ''}", model, alone
        if two:
            yield f"{Path(file).stem}, live", model, options


def print_following(arguments: argparse.Namespace) -> None:
    """A row for each model, the rules first."""
    speeches = held_out(Path(arguments.speech), arguments.split, arguments.pauses)
    seconds = sum(speech.seconds for speech in speeches)
    print(f"{len(speeches)} recordings, {seconds / 60:.1f} min with pauses, split {arguments.split}\n")
    bare = {"temperature": arguments.temperature, "calibrated": not arguments.bare}
    rows: list[Player] = [("rules", RuleBasedModel(), {}), *players(arguments.bundle, bare)]
    print("| | silence ratio | beat lift | of the rules' | own | gains |\n|---|---|---|---|---|---|")
    first, count, takes = 0.0, len(speeches), speeches * arguments.takes
    for name, model, options in rows:
        motions = [model.generate(speech, seed=k, **BODY, **options) for k, speech in enumerate(takes)]
        movements = [speeds(motion) for motion in motions]
        lift = beat_lift([(s.samples, s.rate, m) for s, m in zip(takes, motions, strict=True)])
        first = first or lift.far
        settled_ratio, pause_ratio = silence_ratios(takes, movements)
        own = np.mean([own_beats_others(speeches, movements[k : k + count]) for k in range(0, len(movements), count)])
        half = (lift.interval[1] - lift.interval[0]) / 2
        figures = f"{settled_ratio:.3f} ({pause_ratio:.3f}) | {lift.far:.3f} ± {half:.2g} | {lift.far / first:.0%} | {own:.0%}"
        print(f"| {name} | {figures} | {describe_gains(model)} |", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("speech", help="a file; a folder of recordings with --follow")
    parser.add_argument("--follow", action="store_true", help="how far models follow speech, not how fast they are")
    parser.add_argument("--bundle", action="append", help="a file; those that ship where not given")
    parser.add_argument("--split", choices=("all", "train", "validation", "test"), default="all")
    parser.add_argument("--pauses", type=float, default=SHARE, help="share of the speech that is pauses put into it")
    parser.add_argument("--takes", type=int, default=1, help="of each recording, with other seeds")
    parser.add_argument("--temperature", type=float, default=1.0, help="of the trained models")
    parser.add_argument("--bare", action="store_true", help="networks alone, without what was measured at bundling")
    arguments = parser.parse_args()
    if arguments.follow:
        print_following(arguments)
    else:
        print_speeds(arguments.speech)


if __name__ == "__main__":
    main()
