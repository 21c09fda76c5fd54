"""Compares ways of style transfer (`cospeech.runtime.flow.latent_sources`) on a bundle, and writes the table of docs/styles.md.

    python tools/measure_style.py BUNDLE.cospeech --store STORE --raw CORPUS [--write]

Ten seconds of a held-out neutral take of each of five speakers are the examples, those that the classifier recognises best.
Each is played on the speech of the same held-out takes, 20 s each. A classifier of speakers, trained here on the recordings of
the training split, hears nothing and sees windows of 8 s; the windows of a performance vote, but for its first two seconds,
which the example's own poses begin. The classifier sees mean pose and amplitude, which some of the ways set by themselves: the
table compares what users see of a style, not what latents carry.
"""

from __future__ import annotations

import argparse
import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from cospeech.audio.speech import Speech
from cospeech.audio.speech_chunks import MOST_AT_ONCE
from cospeech.corpora.clip import Clip
from cospeech.corpora.samples import load_stored_clips, sample_of
from cospeech.corpora.store import Store
from cospeech.experiments.discriminants import LinearDiscriminants
from cospeech.metrics import Tools, load_metric
from cospeech.metrics.movement import Track, wrist_speeds
from cospeech.motion.motion import Motion
from cospeech.motion.poses import find_pose
from cospeech.runtime.autoregressive_decoder import AutoregressiveDecoder, Source
from cospeech.runtime.flow.latent_sources import CodeSource, NormalSource, SegmentSource, Transfer, best_transfer, flow_of
from cospeech.runtime.session import ResolvedStyle, TrainedSession
from cospeech.runtime.speech_frontend import SpeechFrontend
from cospeech.runtime.styles.embedding import StyleMixture
from cospeech.runtime.styles.space import style_space
from cospeech.runtime.styles.style import Styles
from cospeech.runtime.system import System, open_bundle

PAGE = Path(__file__).parents[1] / "docs" / "styles.md"
BLOCK = re.compile(r"(<!-- measured -->\n).*?(<!-- end -->)", re.S)
SPEAKERS, SPEECHES, EXAMPLE, TALK, WARM = 5, 12, 10.0, 20.0, 2.0  # the last three in seconds
WINDOW = 8.0  # seconds
PARTS = ("body", "hands")


class Silent:
    """A face session without output."""

    def __init__(self) -> None:
        self.emotion: dict[str, float] = {}

    def push(self, chunk: Speech) -> list[Motion]:
        return []

    def finish(self) -> list[Motion]:
        return []


class SpeakerVotes:
    """Tells speakers by how they move: linear discriminants of windows' mean pose, deviation, and deviation of the velocity.

    Args:
        store: its training split teaches.
    """

    def __init__(self, store: Store) -> None:
        self.store, self._frames = store, round(WINDOW * store.fps)
        mean, std = store.statistics("pose")
        self._mean, self._std = mean, np.maximum(std, 0.02)
        features, labels = [], []
        for clip in store.clips:
            if clip.split == "train" and clip.frames >= self._frames:
                rows = self._windows(np.asarray(store.clip(clip)["pose"]))
                features.append(rows)
                labels += [store.speakers.index(clip.speaker)] * len(rows)
        self._discriminants = LinearDiscriminants(np.concatenate(features), np.array(labels), len(store.speakers))

    def _windows(self, poses: np.ndarray) -> np.ndarray:
        """(W, 3 D), a window every two seconds."""
        values = (poses - self._mean) / self._std
        starts = range(0, len(poses) - self._frames + 1, self._frames // 4)
        windows = np.stack([values[start : start + self._frames] for start in starts])
        moving = np.diff(windows, axis=1) * self.store.fps
        return np.concatenate([windows.mean(1), np.log(windows.std(1) + 0.05), np.log(moving.std(1) + 0.1)], 1)

    def votes(self, motion: Motion, skip: float = WARM) -> np.ndarray:
        """(S,) mean log-probability of each speaker over the windows after the first seconds."""
        poses = find_pose(self.store.pose).encode(motion)[round(skip * self.store.fps) :]
        return self._discriminants.vote(self._windows(poses))


def movement(motion: Motion) -> np.ndarray:
    """Mean speed of the wrists in m/s, and how far they stray from their mean place, in m."""
    track = Track.of(motion)
    away = (track.wrists - track.wrists.mean(0))[round(WARM * motion.fps) :]
    return np.array([wrist_speeds(track).mean(), np.sqrt(np.square(away).sum(-1).mean())])


def perform(system: System, speech: Speech, sources: Sequence[Source]) -> list[Motion]:
    """A performance of each source in one pass, without faces."""
    resolved_style = ResolvedStyle((), np.zeros(len(system.controls), np.float32))
    frontend = SpeechFrontend(system, resolved_style.controls)
    decoder = AutoregressiveDecoder(system, flow_of(system), lambda blend: sources, resolved_style.blend, frontend.silence)
    faces: Any = [Silent() for _ in sources]
    playing = TrainedSession(
        system,
        frontend,
        decoder,
        faces,
        fps=system.fps,
        parts=PARTS,
        resolved_style=resolved_style,
        direct=lambda style: resolved_style,
    )
    pieces = [piece for chunk in speech.chunks(MOST_AT_ONCE) for piece in playing.push_takes(chunk)]
    pieces += playing.finish_takes()
    return [Motion.concatenate(take) for take in zip(*pieces, strict=True)]


def play_speeches(
    system: System, transfer: Callable[..., Source], blends: dict[str, StyleMixture], speeches: Sequence[Speech]
) -> dict[str, list[Motion]]:
    """Speaker → the performances of all speeches; every performance has a seed of its own."""
    motions: dict[str, list[Motion]] = {name: [] for name in blends}
    for number, speech in enumerate(speeches):
        seeds = range(number * len(blends), (number + 1) * len(blends))
        sources = [transfer(system, blend, seed=seed) for seed, blend in zip(seeds, blends.values(), strict=True)]
        for name, motion in zip(motions, perform(system, speech, sources), strict=True):
            motions[name].append(motion)
    return motions


class ExampleStart(CodeSource):
    """A control: the default style, which only begins with the example's poses."""

    def __init__(self, system: System, blend: StyleMixture, *, seed: int, temperature: float = 1.0) -> None:
        super().__init__(system, blend, seed=seed, temperature=temperature)
        plain = CodeSource(system, ((1.0, style_space(system).by_name(system.style)),), seed=seed)
        self.style, self.speaker_mean, self.style_gain = plain.style, plain.speaker_mean, plain.style_gain


class ExamplePose(CodeSource):
    """The example's mean pose and deviation alone, with the code of the default style."""

    def __init__(self, system: System, blend: StyleMixture, *, seed: int, temperature: float = 1.0) -> None:
        super().__init__(system, blend, seed=seed, temperature=temperature)
        self.style = style_space(system).by_name(system.style).code


def recognise_speakers(votes_of: SpeakerVotes, votes: Iterable[tuple[str, np.ndarray]], shortlist: list[str]) -> list[str]:
    """Share of performances whose speaker gets most votes: of all speakers, and of the chosen ones."""
    names = votes_of.store.speakers
    of_all, of_shortlist = [], []
    for name, vote in votes:
        of_all.append(names[int(vote.argmax())] == name)
        of_shortlist.append(max(shortlist, key=lambda who: vote[names.index(who)]) == name)
    return [f"{np.mean(of_all):.0%}", f"{np.mean(of_shortlist):.0%}"]


def row(votes_of: SpeakerVotes, played_for: dict[str, list[Clip]], examples: dict[str, Motion]) -> list[str]:
    """Recognised, recognised among the five, beat alignment, speed and reach against the example.

    Args:
        votes_of: of speakers.
        played_for: speaker → the speeches, with the motion that was made for them in that speaker's style.
        examples: speaker → example.
    """
    votes: list[tuple[str, np.ndarray]] = []
    ratios = []
    for name, clips in played_for.items():
        for clip in clips:
            assert clip.motion is not None
            votes.append((name, votes_of.votes(clip.motion)))
            ratios.append(np.log(movement(clip.motion) / movement(examples[name])))
    samples = [sample_of(clip) for clips in played_for.values() for clip in clips]
    score = load_metric("beat_align")(samples, samples, Tools(seed=0))
    low, high = score.interval or (np.nan, np.nan)
    mean, spread = np.exp(np.mean(ratios, 0)), np.std(ratios, 0)
    return [
        *recognise_speakers(votes_of, votes, list(played_for)), f"{score.value:.3f} ({low:.3f} … {high:.3f})",
        f"× {mean[0]:.2f} ± {spread[0]:.2f}", f"× {mean[1]:.2f} ± {spread[1]:.2f}",
    ]  # fmt: skip


def select_test_clips(clips: Sequence[Clip], seconds: float) -> list[Clip]:
    return [clip for clip in clips if clip.motion is not None and clip.motion.duration >= seconds and clip.speech is not None]


def examples_of(clips: Sequence[Clip], votes_of: SpeakerVotes) -> dict[str, Motion]:
    """Speaker → the ten seconds of a held-out neutral recording that the classifier recognises best.

    Recordings in other emotions would show the emotion. All count for speakers without neutral ones.
    """
    emotions = {e.name: votes_of.store.clip(e)["emotion"][0] if "emotion" in e.has else 0 for e in votes_of.store.clips}
    examples: dict[str, Motion] = {}
    for number, name in enumerate(votes_of.store.speakers):
        own = [clip for clip in select_test_clips(clips, EXAMPLE + 1) if clip.speaker == name]
        own = [clip for clip in own if emotions.get(clip.name, 0) == 0] or own
        length, stretches = round(EXAMPLE * votes_of.store.fps), []
        for clip in own:
            assert clip.motion is not None
            stretches += [clip.motion[k : k + length] for k in range(0, len(clip.motion) - length + 1, length // 2)]
        if stretches:
            examples[name] = max(stretches, key=lambda motion: votes_of.votes(motion, skip=0.0)[number])
    return examples


def compare(system: System, store: Store, clips: Sequence[Clip]) -> list[list[str]]:
    """The rows of the table."""
    votes_of = SpeakerVotes(store)
    examples = dict(list(examples_of(clips, votes_of).items())[:SPEAKERS])
    talks = [
        replace(c, speech=c.speech.window(c.speech.start, c.speech.start + TALK))
        for c in select_test_clips(clips, TALK + 1)[:: max(1, len(select_test_clips(clips, TALK + 1)) // SPEECHES)][:SPEECHES]
        if c.speech is not None
    ]
    speeches = [clip.speech for clip in talks if clip.speech is not None]
    print(f"{len(examples)} speakers, {len(speeches)} speeches of {', '.join(sorted({c.speaker for c in talks}))}")
    styles = Styles(system, style_space(system))
    mixtures = {name: styles.blend(motion) for name, motion in examples.items()}
    halves = {name: styles.blend({motion: 0.5}) for name, motion in examples.items()}
    by_name = {name: styles.blend(name) for name in examples if name in system.styles}
    ways: dict[str, tuple[Transfer, dict[str, StyleMixture]]] = {
        "default style": (CodeSource, {name: styles.blend(None) for name in examples}),
        "begins like the example": (ExampleStart, mixtures),
        "latents: in order, then stretches (paper)": (partial(SegmentSource, coded=False), mixtures),
        "latents: mean and covariance": (partial(NormalSource, coded=False), mixtures),
        "mean and deviation of the poses": (ExamplePose, mixtures),
        "style code": (CodeSource, mixtures),
        "style code; latents: in order, then stretches": (SegmentSource, mixtures),
        "style code; latents: mean and covariance": (NormalSource, mixtures),
        "half way to the example": (best_transfer(system), halves),
        "speaker by name": (best_transfer(system), by_name),
    }
    if not flow_of(system).sizes.style:
        ways = {name: way for name, way in ways.items() if "code" not in name}
    if system.statistics.speaker_std.size:
        ways = {name.replace("style code", "poses, style code"): way for name, way in ways.items()}
    else:
        del ways["mean and deviation of the poses"]
    own = {name: [c for c in select_test_clips(clips, WARM + WINDOW + 1) if c.speaker == name] for name in examples}
    fewest = min(map(len, own.values()))
    rows = [["recordings of the five", *row(votes_of, {name: takes[:fewest] for name, takes in own.items()}, examples)]]
    alone = {name: votes_of.votes(motion, skip=0.0) for name, motion in examples.items()}
    rows.append(["the examples themselves", *recognise_speakers(votes_of, alone.items(), list(examples)), "", "", ""])
    print(*rows, sep="\n", flush=True)
    for name, (transfer, blends) in ways.items():
        performances = play_speeches(system, transfer, blends, speeches)
        as_clips = {
            who: [replace(c, motion=m) for c, m in zip(talks, motions, strict=True)] for who, motions in performances.items()
        }
        rows.append([name, *row(votes_of, as_clips, examples)])
        print(*rows[-1], sep="  ", flush=True)
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("bundle", type=Path)
    parser.add_argument("--store", type=Path, required=True)
    parser.add_argument("--raw", type=Path, required=True)
    parser.add_argument("--write", action="store_true", help="put the table into docs/styles.md")
    options = parser.parse_args()
    system, store = open_bundle(options.bundle), Store(options.store)
    clips = [clip for clip in load_stored_clips(options.store, split=None, raw=options.raw) if clip.split != "train"]
    rows = compare(system, store, clips)
    head = ["", f"recognised of {len(store.speakers)}", f"of {SPEAKERS}", "beat alignment", "speed", "reach"]
    lines = ["| " + " | ".join(cells) + " |" for cells in [head, ["---"] * len(head), *rows]]
    print("\n".join(lines))
    if options.write:
        text = "\n".join(lines)
        PAGE.write_text(BLOCK.sub(lambda m: f"{m[1]}{text}\n{m[2]}", PAGE.read_text("utf-8")), "utf-8")


if __name__ == "__main__":
    main()
