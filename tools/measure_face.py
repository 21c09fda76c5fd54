"""How near a bundle's face comes to faces that were tracked, on the clips that were held out (docs/models/speech_to_face.md).

    python tools/measure_face.py RAW [--bundle BUNDLE.cospeech] [--clips 20]

RAW is what ``cospeech prepare faces`` reads; held out is what it puts into the split "test". Every clip's sound is played in
the style of its own speaker at the rate of its track, as `cospeech.load(bundle).generate` plays it. Figures are means over clips
with 95 % intervals (percentile bootstrap over clips); shares of a distance are quotients of such means.
"""

from __future__ import annotations

import argparse
from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

import cospeech
from cospeech.corpora.clip import Clip
from cospeech.corpora.faces import LOWER, read
from cospeech.features import AUDIO_NAMES, audio_features
from cospeech.features.reduce import reduce_audio
from cospeech.metrics.interval import bootstrap
from cospeech.models import BUNDLE, SHIPPED
from cospeech.prepare.pieces import split_of
from cospeech.skeletons.arkit import ARKIT, ARKIT_INDEX

JAW = ARKIT_INDEX["jawOpen"]
LIVE = 0.005  # deviation from which a channel of a tracked face counts as live: a two-hundredth of its range
LINEAR = 4  # of the training clips, every so many-th is what the regression is fitted to: 40 unknowns, 30,000 frames
SILENT = 35.0  # dB below the loudest frame of a clip from which a frame counts as silent
CLOSED = 0.1  # jawOpen of a mouth that counts as closed
LAGS = range(-6, 7)  # frames of 40 ms
RIDGE = 10.0  # of the linear regression; in squared deviations of a column per frame, times 100
DRAWS = 1000


@dataclass(frozen=True, eq=False)
class Played:
    """A held-out clip: tracked and made, at the track's rate."""

    real: np.ndarray
    made: np.ndarray
    linear: np.ndarray
    silent: np.ndarray
    fps: float


def features(clip: Clip) -> np.ndarray:
    """(T, 84) of a clip's frames."""
    return audio_features(clip.speech, len(clip.motion), clip.motion.fps)  # type: ignore[arg-type,union-attr]


def fitted(clips: list[Clip]) -> Callable[[np.ndarray], np.ndarray]:
    """Ridge regression from the mel powers of a frame to the face of the same frame."""
    x = np.concatenate([reduce_audio(features(clip), "mel40") for clip in clips]).astype(float)
    y = np.concatenate([clip.motion.face for clip in clips])
    mean, std, middle = x.mean(0), x.std(0), y.mean(0)
    x = (x - mean) / std
    slopes = np.linalg.solve(x.T @ x + RIDGE * np.eye(x.shape[1]), x.T @ (y - middle))
    return lambda rows: np.clip((reduce_audio(rows, "mel40") - mean) / std @ slopes + middle, 0, 1)


def lag(real: np.ndarray, made: np.ndarray, fps: float) -> np.ndarray:
    """Correlation of the jaw with the tracked one, moved by `LAGS` frames of 25 a second; later ones positive."""
    times, at = np.arange(len(real)) / fps, []
    for frames in LAGS:
        moved = np.interp(times + frames / 25, times, made)
        at.append(np.corrcoef(real, moved)[0, 1] if moved.std() > 0 and real.std() > 0 else 0.0)
    return np.array(at)


def told(values: np.ndarray, figure: Callable[[np.ndarray], float] = np.mean) -> str:  # type: ignore[assignment]
    """A figure of rows that each stand for a clip, with its interval."""
    ends = bootstrap(lambda chosen: float(figure(values[chosen])), len(values), draws=DRAWS, seed=0)
    low, high = ends if ends is not None else (np.nan, np.nan)
    return f"{figure(values):.3f} ({low:.3f} … {high:.3f})"


def report(name: str, clips: list[Played], mean: np.ndarray) -> None:
    real = np.concatenate([clip.real for clip in clips])
    live = [k for k, n in enumerate(ARKIT) if n in LOWER and real[:, k].std() > LIVE]
    pairs = [(clip.real[:, JAW], clip.made[:, JAW]) for clip in clips]
    print(f"\n{name}: {len(clips)} clips, {len(real)} frames; live: {', '.join(ARKIT[k] for k in live)}")
    print("jawOpen, correlation     ", told(np.array([np.corrcoef(a, b)[0, 1] for a, b in pairs])))
    lags = np.array([lag(a, b, clip.fps) for (a, b), clip in zip(pairs, clips, strict=True)])
    best = np.array(LAGS)[lags.argmax(1)]
    print("best lag, frames of 40 ms", told(lags, lambda x: float(LAGS[int(x.mean(0).argmax())])), end="; ")
    print("of clips within ±1:", told(np.abs(best) <= 1))
    print("jawOpen, deviation made / tracked", told(np.array([(a.std(), b.std()) for a, b in pairs]), quotient(1, 0)))

    def off(made: Callable[[Played], np.ndarray]) -> np.ndarray:
        return np.array([np.abs(made(clip) - clip.real)[:, live].mean() for clip in clips])

    kinds = [off(lambda c: c.made), off(lambda c: mean), off(lambda c: c.linear)]
    for title, values in zip(("made", "mean face", "ridge regression"), kinds, strict=True):
        print(f"mean absolute error, {title:17}", told(values * 100), "/ 100")
    both = np.stack(kinds, 1)
    print("below the mean face by   ", told(both, lambda x: 1 - float(quotient(0, 1)(x))))
    print("below the regression by  ", told(both, lambda x: 1 - float(quotient(0, 2)(x))))
    quiet = np.array(
        [((c.made[:, JAW] < CLOSED) @ c.silent, (c.real[:, JAW] < CLOSED) @ c.silent, c.silent.sum()) for c in clips]
    )
    print("closed in silent frames  ", told(quiet.astype(float), quotient(0, 2)), f"; of {quiet[:, 2].sum()} frames")
    print("  the tracked mouth      ", told(quiet.astype(float), quotient(1, 2)))
    print(f"values: {min(c.made.min() for c in clips):.3f} … {max(c.made.max() for c in clips):.3f}")


def quotient(top: int, under: int) -> Callable[[np.ndarray], float]:
    return lambda rows: float(rows[:, top].sum() / max(rows[:, under].sum(), 1e-12))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("raw")
    parser.add_argument("--bundle", default=str(SHIPPED / f"speech-to-face{BUNDLE}"))
    parser.add_argument("--clips", type=int, default=10_000, help="held-out clips of each speaker at most")
    given = parser.parse_args()
    model, every = cospeech.load(given.bundle), defaultdict(list)
    for clip in read(given.raw):
        if isinstance(clip, Clip):
            every[clip.speaker, split_of(clip)].append(clip)
    for speaker in sorted({name for name, _ in every}):
        train = every[speaker, "train"]
        linear, mean = fitted(train[::LINEAR]), np.concatenate([clip.motion.face for clip in train]).mean(0)
        played = []
        for clip in every[speaker, "test"][: given.clips]:
            made = model.generate(clip.speech, style=speaker, fps=clip.motion.fps, parts=("face", "body"))
            rows, frames = features(clip), min(len(made), len(clip.motion))
            energy = rows[:, AUDIO_NAMES.index("energy")]
            silent = energy < energy.max() - SILENT
            parts = (clip.motion.face, made.face, linear(rows), silent)
            played.append(Played(*(x[:frames] for x in parts), clip.motion.fps))
        report(speaker, played, mean)


if __name__ == "__main__":
    main()
