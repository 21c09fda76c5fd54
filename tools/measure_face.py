"""How near a bundle's face comes to faces that were tracked, on the takes that were held out (docs/models/speech_to_face.md).

    python tools/measure_face.py RAW [--bundle BUNDLE.cospeech] [--clips 20]

RAW is what ``cospeech prepare faces`` reads; held out is what it puts into the split "test", whole takes. Every clip's sound is
played in the style of its own speaker at the rate of its track, by what every system speaks with; a speaker whom the bundle
does not know is played in its default style, and all of their clips are held out. Figures are means over clips with 95 %
intervals (percentile bootstrap over clips); shares of a distance are quotients of such means. Lips are judged where words tell
of b, p and m: they are closed where the aperture ``jawOpen − mouthClose`` falls below .03 around the onset, or ``mouthPress``
exceeds .05. A channel that moves in few clips has a deviation with a wide interval: beside the figure of all frames stands
that about the mean of each clip, which a smile that lasts through a clip does not change. Recordings are not always good: the
same clips are played through a telephone's band, and so soft that a network which measures loudness sees silence.
"""

from __future__ import annotations

import argparse
from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from cospeech.audio.features import AUDIO_NAMES, audio_features
from cospeech.audio.features.reduce import reduce_audio
from cospeech.audio.speech import RATE
from cospeech.corpora.clip import Clip
from cospeech.corpora.faces import LOWER, read
from cospeech.corpora.prepare.pieces import split_of
from cospeech.face.visemes import VISEMES, Phones, phones_of
from cospeech.metrics.interval import bootstrap
from cospeech.models import BUNDLE, SHIPPED
from cospeech.motion.skeletons.arkit import ARKIT, ARKIT_INDEX
from cospeech.rules import RuleBasedModel
from cospeech.runtime.mouth import BundleMouth, open_mouth

JAW = ARKIT_INDEX["jawOpen"]
LIVE = 0.005  # deviation from which a channel of a tracked face counts as live: a two-hundredth of its range
LINEAR = 4  # the regression is fitted to every fourth training clip: 40 unknowns, 30,000 frames
SILENT = 35.0  # dB below the loudest frame of a clip from which a frame counts as silent
CLOSED = 0.1  # jawOpen of a mouth that counts as closed
LAGS = range(-6, 7)  # frames of 40 ms
RIDGE = 10.0  # of the linear regression; in squared deviations of a column per frame, times 100
DRAWS = 1000
APERTURE, PRESSED = 0.03, 0.05  # jawOpen − mouthClose of closed lips, mouthPress of pressed ones: 97 % of GRID's b, p and m
ONSET = (-0.06, 0.10)  # s around an onset in which the lips have to close: a track of 25 frames per second has four of them
RATIO = (0.6, 1.3)  # standard deviation, generated ÷ tracked, of a channel that moves as much as it should (issue 14)
TELEPHONE = (300.0, 3400.0)  # Hz, ITU-T G.712
SOFT = 20.0  # [ours] dB
RECORDED = "as recorded"
BILABIAL, ROUNDED = ("PP",), ("O", "U")


@dataclass(frozen=True, eq=False)
class TestClip:
    """A held-out clip: the tracked face and the generated one, at the track's rate."""

    real: np.ndarray
    generated: np.ndarray
    linear: np.ndarray
    silent: np.ndarray
    fps: float
    phones: Phones
    shown: dict[str, np.ndarray]
    """The whole face with this mouth: by the sound alone, and with the words where they are known."""
    worse: dict[str, np.ndarray]
    """Faces that are generated from worse recordings of the same speech."""


def features(clip: Clip) -> np.ndarray:
    """(T, 84) features of the frames of a clip."""
    return audio_features(clip.speech, len(clip.motion), clip.motion.fps)  # type: ignore[arg-type,union-attr]


def fit_ridge(clips: list[Clip]) -> Callable[[np.ndarray], np.ndarray]:
    """Ridge regression from the mel powers of a frame to the face of the same frame."""
    x = np.concatenate([reduce_audio(features(clip), "mel40") for clip in clips]).astype(float)
    y = np.concatenate([clip.motion.face for clip in clips])
    mean, std, middle = x.mean(0), x.std(0), y.mean(0)
    x = (x - mean) / std
    slopes = np.linalg.solve(x.T @ x + RIDGE * np.eye(x.shape[1]), x.T @ (y - middle))
    return lambda rows: np.clip((reduce_audio(rows, "mel40") - mean) / std @ slopes + middle, 0, 1)


def lag(real: np.ndarray, generated: np.ndarray, fps: float) -> np.ndarray:
    """Correlation of the generated jaw with the tracked one at each of `LAGS`; positive: the generated jaw is late."""
    times, at = np.arange(len(real)) / fps, []
    for frames in LAGS:
        signal = np.interp(times + frames / 25, times, generated)
        at.append(np.corrcoef(real, signal)[0, 1] if signal.std() > 0 and real.std() > 0 else 0.0)
    return np.array(at)


def format_figure(values: np.ndarray, figure: Callable[[np.ndarray], float], unit: float = 1.0) -> str:
    """A figure of rows that each stand for a clip, with its interval."""
    ends = bootstrap(lambda k: float(figure(values[k])), [*map(str, range(len(values)))], draws=DRAWS).interval
    low, high = ends if ends is not None else (np.nan, np.nan)
    return f"{unit * figure(values):.3g} ({unit * low:.3g} … {unit * high:.3g})"


def mean(rows: np.ndarray) -> float:
    return float(rows.mean())


def quotient(top: int, under: int, begin: float = 0.0, sign: float = 1.0) -> Callable[[np.ndarray], float]:
    """``begin + sign ·`` the sum of a column over that of another."""
    return lambda rows: begin + sign * float(rows[:, top].sum() / max(rows[:, under].sum(), 1e-12))


def figures(clips: list[TestClip], middle: np.ndarray) -> dict[str, str]:
    """Rows of the table about the clips of a speaker: name → figure."""
    real = np.concatenate([clip.real for clip in clips])
    live = [k for k, n in enumerate(ARKIT) if n in LOWER and real[:, k].std() > LIVE]
    pairs = [(clip.real[:, JAW], clip.generated[:, JAW], clip.fps) for clip in clips]
    lags = np.array([lag(*pair) for pair in pairs])
    within = np.abs(np.array(LAGS)[lags.argmax(1)]) <= 1
    spread = np.array([(a.std(), b.std()) for a, b, _ in pairs])
    kinds = (lambda c: c.generated, lambda c: middle, lambda c: c.linear)
    off = np.array([[np.abs(kind(c) - c.real)[:, live].mean() for kind in kinds] for c in clips])
    closed = [[(face[:, JAW] < CLOSED) & c.silent for face in (c.generated, c.real)] for c in clips]
    shut = np.array([[*map(np.sum, pair), c.silent.sum()] for pair, c in zip(closed, clips, strict=True)])
    return {
        "held-out clips; frames; live channels": f"{len(clips)}; {len(real)}; {len(live)}",
        "correlation of jawOpen within clips": format_figure(np.array([np.corrcoef(a, b)[0, 1] for a, b, _ in pairs]), mean),
        "best lag, frames of 40 ms": format_figure(lags, lambda x: float(LAGS[int(x.mean(0).argmax())])),
        "clips whose best lag is within ± 1 frame, %": format_figure(within * 1.0, mean, 100),
        "deviation of jawOpen, of the tracked, %": format_figure(spread, quotient(1, 0), 100),
        "mean absolute error over live channels, ‰": format_figure(off[:, 0], mean, 1000),
        "that of the speaker's mean face, ‰": format_figure(off[:, 1], mean, 1000),
        "that of a ridge regression on the frame's mel, ‰": format_figure(off[:, 2], mean, 1000),
        "below the mean face by, %": format_figure(off, quotient(0, 1, 1, -1), 100),
        "below the regression by, %": format_figure(off, quotient(0, 2, 1, -1), 100),
        "mouth closed in silent frames, %": format_figure(shut, quotient(0, 2), 100),
        "that of the tracked mouth, %": format_figure(shut, quotient(1, 2), 100),
        **sizes(clips, live),
        **lips(clips),
        **recordings(clips),
        "least and greatest weight": f"{min(c.generated.min() for c in clips):.3g} … "
        f"{max(c.generated.max() for c in clips):.3g}",
    }


def sizes(clips: list[TestClip], live: list[int]) -> dict[str, str]:
    """Rows about how far live channels move, generated ÷ tracked: all frames, about each clip's mean, face by the sound."""
    real, generated, by_sound = (
        np.stack([moments(face(c)[:, live]) for c in clips])
        for face in (lambda c: c.real, lambda c: c.generated, lambda c: c.shown["face by the sound"])
    )
    pairs, whole = np.stack([generated, real], 1), deviation(generated) / deviation(real)
    within = deviation(generated, True) / deviation(real, True)
    off = [
        f"{ARKIT[k]} " + format_figure(pairs[..., n], lambda m: float(deviation(m[:, 0]) / max(deviation(m[:, 1]), 1e-9)))
        for n, k in enumerate(live)
        if not RATIO[0] <= whole[n] <= RATIO[1]
    ]
    face = deviation(by_sound) / deviation(real)
    return {
        "channels whose deviation is .6 to 1.3 of the tracked": count(whole),
        "of those about the mean of each clip": count(within),
        "of those of the face by the sound": count(face),
        "deviation of each, of the tracked": ", ".join(f"{ARKIT[k]} {r:.2f}" for k, r in zip(live, whole, strict=True)),
        "outside .6 to 1.3, with 95 % intervals": ", ".join(off) or "none",
    }


def count(ratios: np.ndarray) -> str:
    """Text that says how many ratios lie in `RATIO`."""
    return f"{sum(RATIO[0] <= ratio <= RATIO[1] for ratio in ratios)} of {len(ratios)}"


def moments(face: np.ndarray) -> np.ndarray:
    """(frames, channels) → (3, channels): frames, sum, sum of squares."""
    return np.stack([np.full(face.shape[1], float(len(face))), face.sum(0, float), np.square(face, dtype=float).sum(0)])


def deviation(rows: np.ndarray, within: bool = False) -> np.ndarray:
    """(clips, 3, …) moments → (…) standard deviation of all frames, about the mean of all or that of each clip."""
    frames, total, squares = rows.sum(0)
    of_means = (rows[:, 1] ** 2 / rows[:, 0]).sum(0) if within else total**2 / frames
    return np.asarray(np.sqrt(np.maximum(squares - of_means, 0) / frames))


def lips(clips: list[TestClip]) -> dict[str, str]:
    """Rows about the lips at b, p and m, and at o and u; none where no words are known."""
    faces = {"tracked": lambda c: c.real, "mouth alone": lambda c: c.generated}
    faces |= {name: (lambda c, name=name: c.shown[name]) for name in clips[0].shown}
    rows = {}
    for name, face in faces.items():
        shares = [np.mean(hit) for c in clips if len(hit := closures(c, face(c)))]
        if shares:
            rows[f"lips closed at b, p, m: {name}, %"] = format_figure(np.array(shares), mean, 100)
            rounds = [roundness(c, face(c)) for c in clips]
            rows[f"pucker and funnel at o and u, of elsewhere in speech: {name}"] = f"{np.nanmean(rounds):.2f}"
    return rows


def recordings(clips: list[TestClip]) -> dict[str, str]:
    """Rows about the jaw in worse recordings; how far it opens shows whether the network understands the recording."""
    rows = {}
    for name in clips[0].worse:
        pairs = [(clip.real[:, JAW], clip.worse[name][:, JAW]) for clip in clips]
        if name != RECORDED:  # which has the rows above
            r = np.array([np.corrcoef(a, b)[0, 1] if b.std() > 0 else 0.0 for a, b in pairs])
            rows[f"{name}: correlation of jawOpen"] = format_figure(r, mean)
        openings = np.array([(b.mean(), a.mean()) for a, b in pairs])
        rows[f"{name}: mean of jawOpen, of the tracked, %"] = format_figure(openings, quotient(0, 1), 100)
    return rows


def worsen(samples: np.ndarray) -> dict[str, np.ndarray]:
    """Name → samples: the recording, and worse recordings of the same speech."""
    hertz = np.fft.rfftfreq(len(samples), 1 / RATE)
    band = (hertz >= TELEPHONE[0]) & (hertz <= TELEPHONE[1])
    telephone = np.fft.irfft(np.fft.rfft(samples) * band, len(samples)).astype(np.float32)
    return {
        "as recorded": samples,
        "telephone": telephone,
        f"{SOFT:g} dB softer": (samples * 10 ** (-SOFT / 20)).astype(np.float32),
    }


def closures(clip: TestClip, face: np.ndarray) -> np.ndarray:
    """(onsets,) whether the lips close at each b, p and m within the clip."""
    names = ("jawOpen", "mouthClose", "mouthPressLeft", "mouthPressRight")
    jaw, close, *press = (face[:, ARKIT_INDEX[name]] for name in names)
    aperture, pressure, hits = jaw - np.minimum(close, jaw), np.maximum(*press), []
    for centre, half, viseme in zip(clip.phones.centre, clip.phones.half, clip.phones.viseme, strict=True):
        first, last = (round((centre - half + way) * clip.fps) for way in ONSET)
        if VISEMES[viseme] in BILABIAL and first >= 0 and last < len(face):
            hits.append(aperture[first : last + 1].min() < APERTURE or pressure[first : last + 1].max() > PRESSED)
    return np.array(hits)


def roundness(clip: TestClip, face: np.ndarray) -> float:
    """Mean of pucker and funnel within o and u, over that within other phones."""
    lips = face[:, ARKIT_INDEX["mouthPucker"]] + face[:, ARKIT_INDEX["mouthFunnel"]]
    at = np.rint(clip.phones.centre * clip.fps).astype(int)
    inside = (at >= 0) & (at < len(face))
    is_round = np.array([VISEMES[v] in ROUNDED for v in clip.phones.viseme], bool)
    here, there = (lips[at[inside & which]] for which in (is_round, ~is_round))
    return float(here.mean() / max(there.mean(), 1e-3)) if len(here) and len(there) else np.nan


def faces(clip: Clip, mouth: Callable[[], BundleMouth], frames: int) -> dict[str, np.ndarray]:
    """The whole face at the track's rate, without the words, and with them where they are known."""
    assert clip.speech is not None
    assert clip.motion is not None
    options = {"parts": ("face",), "emotion": "neutral", "fps": clip.motion.fps}
    kinds = {"face by the sound": replace(clip.speech, words=None)} | (
        {"face with words": clip.speech} if clip.speech.words else {}
    )
    return {name: RuleBasedModel(mouth).generate(speech, **options).face[:frames] for name, speech in kinds.items()}


def play(clip: Clip, linear: Callable[[np.ndarray], np.ndarray], make: Callable[[], BundleMouth]) -> TestClip:
    """Play a held-out clip, also from worse recordings."""
    assert clip.speech is not None
    assert clip.motion is not None
    rows, frames = features(clip), min(len(clip.motion), clip.speech.frames(clip.motion.fps))
    times = np.arange(frames) / clip.motion.fps
    worse = {name: hear(make(), sound, times) for name, sound in worsen(clip.speech.samples).items()}
    generated = worse[RECORDED]
    energy = rows[:, AUDIO_NAMES.index("energy")]
    parts = (clip.motion.face, generated, linear(rows), energy < energy.max() - SILENT)
    phones = phones_of(clip.speech.words or (), 0.0, clip.duration)
    return TestClip(*(x[:frames] for x in parts), clip.motion.fps, phones, faces(clip, make, frames), worse)


def hear(mouth: BundleMouth, samples: np.ndarray, times: np.ndarray) -> np.ndarray:
    """(times, 52) weights of a mouth that plays a speech."""
    mouth.push(samples)
    mouth.finish()
    return mouth.at(times)


def measure_faces(raw: str | Path, bundle: str | Path, clips: int = 10_000) -> str:
    """The table, in Markdown: a row per figure, a column per speaker; ``clips``: held-out ones of each at most."""
    system, every, columns = open_mouth(Path(bundle)), defaultdict(list), {}
    for clip in read(raw):
        if isinstance(clip, Clip):
            every[clip.speaker, split_of(clip)].append(clip)
    for speaker in sorted({name for name, _ in every}):
        train, style = every[speaker, "train"], speaker if speaker in system.styles else None
        test_clips = (
            every[speaker, "test"] if style else [clip for (name, _), own in every.items() if name == speaker for clip in own]
        )
        linear = fit_ridge(train[::LINEAR])
        results = [play(clip, linear, lambda style=style: BundleMouth(system, style)) for clip in test_clips[:clips]]
        title = speaker if style else f"{speaker}, never heard"
        columns[title] = figures(results, np.concatenate([clip.motion.face for clip in train]).mean(0))
    rows = dict.fromkeys(row for own in columns.values() for row in own)
    lines = ["| | " + " | ".join(columns) + " |", "|---" * (1 + len(columns)) + "|"]
    lines += [f"| {row} | " + " | ".join(own.get(row, "–") for own in columns.values()) + " |" for row in rows]
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("raw")
    parser.add_argument("--bundle", default=SHIPPED / f"speech-to-face{BUNDLE}")
    parser.add_argument("--clips", type=int, default=10_000, help="held-out clips of each speaker at most")
    options = parser.parse_args()
    print(measure_faces(options.raw, options.bundle, options.clips))


if __name__ == "__main__":
    main()
