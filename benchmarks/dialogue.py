"""How two characters talk to each other: ``python benchmarks/dialogue.py FIRST SECOND [--models rules] [--minutes 10]``.

FIRST and SECOND are folders of recordings, of one reader each, or two sound files, or one stereo file, of a real conversation.
Of folders a conversation is put together: the readers take turns of one recording each, with pauses of .1 to .9 s, and each
microphone also hears the other reader, 18 dB softer. Nobody answers anybody in it: it tests the code, not how people converse.

For each model and person: responses in a minute of the other one's speech; the share of the other one's pauses with a nod
within a second, in own silence, and what it would be if the nods came at other times (shifted by chance, mean of 200); the
speed of the head and the share of time with the gaze within 12° of the other one, while listening and while speaking.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path
from random import Random

import numpy as np
import soundfile
from movement_statistics import RATE, utterances

from cospeech.audio.conversation import HeardSpeaker, VoiceTrack, hear_conversation
from cospeech.audio.speech_chunks import speech_chunks
from cospeech.face.gaze import direction_of, head_rotation
from cospeech.models import load
from cospeech.motion.motion import Motion
from cospeech.motion.rotations import Array, quat_multiply
from cospeech.rules.options import GenerationOptions
from cospeech.runtime.listening import DialogueRole, find_listening, plan_responses

_LEAK = 10 ** (-18 / 20)
_LEVEL = 0.1  # RMS of each recording
_WITHIN, _SHIFTS, _NEAR = 1.0, 200, 12.0


def compose(first: Path, second: Path, minutes: float) -> Array:
    """(N, 2) samples of an artificial conversation."""
    readers, rng, at, turns = [list(utterances(folder)) for folder in (first, second)], Random(1), RATE // 2, []
    while at < minutes * 60 * RATE:
        own = readers[len(turns) % 2]
        samples = own[len(turns) // 2 % len(own)]
        turns.append((at, samples * (_LEVEL / np.sqrt(np.mean(np.square(samples))))))
        at += len(samples) + round(rng.uniform(0.1, 0.9) * RATE)
    tracks = np.zeros((at + RATE, 2), np.float32)
    for k, (begin, samples) in enumerate(turns):
        tracks[begin : begin + len(samples), k % 2] = samples
    return tracks + _LEAK * tracks[:, ::-1] + np.random.default_rng(1).normal(0, 2e-4, tracks.shape).astype(np.float32)


def inside(times: Array, stretches: list[tuple[float, float]]) -> Array:
    """(T,) whether a time lies in one of the stretches."""
    is_inside = np.zeros(len(times), bool)
    for low, high in stretches:
        is_inside |= (times >= low) & (times < high)
    return is_inside


def answered(nods: Array, pauses: Array, seconds: float) -> tuple[float, float]:
    """The share of pauses with a nod soon after, and its mean over nods at other times."""
    rng = np.random.default_rng(0)

    def share(times: Array) -> float:
        after = np.searchsorted(times, pauses)
        waits = np.append(times, np.inf)[after] - pauses
        return float(np.mean(waits < _WITHIN))

    return share(nods), float(np.mean([share(np.sort((nods + rng.uniform(0, seconds)) % seconds)) for _ in range(_SHIFTS)]))


def measure(name: str, own: HeardSpeaker, other: HeardSpeaker, seed: int) -> list[str]:
    """A row of the table."""
    role, options, model = DialogueRole(own, (other,)), GenerationOptions(seed=seed), load(name)
    with role.open() as source:
        session = model.session(seed=seed, fps=30, **model.for_files)

        def play() -> object:
            for piece in speech_chunks(source):
                yield from session.push_takes(piece)
            yield from session.finish_takes()

        motion = Motion.concatenate([takes[0] for takes in role.listen(play(), options, range(1))])
    nods = np.array([each.time for each in plan_responses(own, other, seed)])
    listening = find_listening(own, other)
    on = inside(motion.times, listening)
    speaking = inside(motion.times, [(phrase.start, phrase.end) for phrase in own.phrases])
    pauses = np.array([cue.time for cue in other.cues if cue.kind == "pause" and not inside(np.array([cue.time]), [
        (phrase.start - 0.7, phrase.end) for phrase in own.phrases])[0]])  # fmt: skip
    head = head_rotation(motion.rotations)
    speed = np.degrees(np.linalg.norm(np.gradient(direction_of(head), axis=0), axis=1)) * motion.fps
    eye = motion.rotations[:, motion.skeleton.index["leftEye"]].astype(float)
    near = np.degrees(np.linalg.norm(direction_of(quat_multiply(head, eye)), axis=1)) < _NEAR
    talk = sum(phrase.end - phrase.start for phrase in other.phrases)
    real, chance = answered(nods, pauses, float(own.length))
    return [
        name, str(own.track), f"{60 * len(nods) / talk:.1f}", f"{real:.2f}", f"{chance:.2f}",
        f"{speed[on].mean():.1f}", f"{speed[speaking].mean():.1f}", f"{near[on].mean():.2f}", f"{near[speaking].mean():.2f}",
    ]  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sounds", type=Path, nargs="+")
    parser.add_argument("--models", default="rules,chain-of-generation,stylised-flow,mix-stage")
    parser.add_argument("--minutes", type=float, default=10)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        first, second = options.sounds[0], options.sounds[-1]
        tracks = (VoiceTrack(first, 0), VoiceTrack(first, 1)) if first == second else (VoiceTrack(first), VoiceTrack(second))
        if first.is_dir():
            path = Path(folder) / "conversation.wav"
            soundfile.write(path, compose(first, second, options.minutes), RATE)
            tracks = (VoiceTrack(path, 0), VoiceTrack(path, 1))
        one, other = hear_conversation(*tracks)
        print("| model | person | responses a minute | pauses with a nod | by chance | head °/s, listening | speaking | "
              "gaze at the other, listening | speaking |")  # fmt: skip
        print("|---|---|---:|---:|---:|---:|---:|---:|---:|")
        for name in options.models.split(","):
            for own, partner in ((one, other), (other, one)):
                print("| " + " | ".join(measure(name, own, partner, options.seed)) + " |", flush=True)


if __name__ == "__main__":
    main()
