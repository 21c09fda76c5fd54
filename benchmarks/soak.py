"""A day of speech through one session: ``python benchmarks/soak.py --hours 24 --model rules``.

Is memory flat, do times drift, is every frame given once? The example is said over and over, with its words, a pause after
each time and a minute of silence now and then; it comes in pieces, and nothing of the motion is kept. After every simulated
hour a row says how much memory the process has grown since the warm-up, by how much the frames' times are off those that their
number demands, and how far the sound was ahead of the motion at most. The exit code is 1 when a verdict fails.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Iterator
from fractions import Fraction

import numpy as np
from speed import machine, resident

from cospeech.audio.speech import Speech, Word, count_frames, example
from cospeech.models import load

WARM = 1 / 6  # simulated hours until everything that is kept is there
PAUSE, SILENCE, EVERY = 1.0, 60.0, 20  # seconds after each time; seconds after every so many times
MOST_GROWTH = 20.0  # MB
MOST_DRIFT = 1e-6  # seconds


def day_of_speech(hours: float, piece: float) -> Iterator[Speech]:
    """The example over and over in pieces of so many seconds; words travel with the piece in which they start."""
    audio, words = example()
    speech = Speech.load(audio, transcript=words)
    at, remaining = 0, round(hours * 3600 * speech.rate)
    step, turn = round(piece * speech.rate), 0
    while remaining > 0:
        turn += 1
        rest = round((SILENCE if turn % EVERY == 0 else PAUSE) * speech.rate)
        samples = np.concatenate([speech.samples, np.zeros(rest, np.float32)])[:remaining]
        offset = at / speech.rate
        words_here = [Word(w.text, offset + w.start, offset + w.end) for w in speech.words or ()]
        for first in range(0, len(samples), step):
            part = samples[first : first + step]
            until = offset + (first + len(part)) / speech.rate
            count = next((k for k, word in enumerate(words_here) if word.start >= until), len(words_here))
            yield Speech(part, speech.rate, tuple(words_here[:count]), start=offset + first / speech.rate)
            del words_here[:count]
        at, remaining = at + len(samples), remaining - len(samples)


def verdict(what: str, good: bool, text: str) -> bool:
    print(f"  {'pass' if good else 'FAIL'}  {what}: {text}", flush=True)
    return good


def soak(model: str, hours: float, piece: float, fps: float) -> bool:
    """Play; print a row for every hour, and the verdicts; True if all passed."""
    session = load(model).session(fps=fps, seed=1)
    samples, frames, drift, ahead, warm, most, mark = 0, 0, 0.0, 0.0, 0.0, 0.0, WARM
    began = time.process_time()
    for chunk in day_of_speech(hours, piece):
        samples += len(chunk)
        for motion in session.push(chunk):
            drift = max(drift, abs(motion.start - frames / fps))
            frames += len(motion)
        ahead = max(ahead, samples / chunk.rate - frames / fps)
        if samples >= mark * 3600 * chunk.rate:
            warm = warm or resident()
            most = max(most, resident() - warm)
            work = time.process_time() - began
            print(f"{samples / chunk.rate / 3600:7.2f} h  {frames:>9,} frames  {resident():6.1f} MB, "
                  f"{resident() - warm:+5.1f} MB since the warm-up  drift {drift:.1e} s  "
                  f"sound ahead {ahead:.3f} s  {work:.0f} s of work", flush=True)  # fmt: skip
            mark = 1.0 if mark < 1 else mark + 1.0
    most = max(most, resident() - warm) if warm else np.inf  # shorter than the warm-up: it says nothing
    for motion in session.finish():
        drift = max(drift, abs(motion.start - frames / fps))
        frames += len(motion)
    due = count_frames(Fraction(samples, chunk.rate), fps)
    late = session.latency + piece
    return all([
        verdict("frames", frames == due, f"{frames:,} of {due:,}"),
        verdict("growth of memory after the warm-up", most < MOST_GROWTH, f"{most:.1f} MB (less than {MOST_GROWTH:g} MB)"),
        verdict("drift of the frames' times", drift < MOST_DRIFT, f"{drift:.1e} s"),
        verdict("sound ahead of the motion", ahead <= late, f"{ahead:.3f} s (latency and a piece: {late:.3f} s)"),
    ])  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--hours", type=float, default=0.5, help="of simulated speech")
    parser.add_argument("--model", default="rules")
    parser.add_argument("--piece", type=float, default=1.0, help="seconds of speech that come at once")
    parser.add_argument("--fps", type=float, default=30.0)
    options = parser.parse_args()
    print(f"{options.hours:g} h of speech through {options.model}, {options.piece:g} s at once; {machine()}")
    sys.exit(0 if soak(options.model, options.hours, options.piece, options.fps) else 1)


if __name__ == "__main__":
    main()
