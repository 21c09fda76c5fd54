"""``cospeech synthesise``: a synthetic corpus in the raw layout of TED, Trinity, PATS or BEAT.

The rule-based model performs real and synthesised speech as several speakers in eight emotions, which the voices act as well
(`acting`). What comes out looks, to every tool that reads the real data set, like that data set; it is there
to test, to teach and to practise with. It is **synthetic**: a network trained on it learns our rules, not people.
"""

from __future__ import annotations

import shutil
import warnings
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from importlib import import_module
from itertools import product
from os import PathLike
from pathlib import Path

import numpy as np

from ...audio.speech import Speech, example
from ...errors import CospeechWarning, InputError, nearest
from ...files import describe_os_error, workplace
from ...motion.motion import Motion
from ...rules import EMOTIONS, Gesture, RuleBasedModel, Style
from .. import CORPORA
from ..clip import SPLITS, Clip, Semantic
from .acting import Actor, act
from .silences import add_silences
from .speakers import Speaker, choose_speakers, vary_take
from .speech_splits import SPLIT_SENTENCES, split_of, split_recordings
from .voices import Voice, find_voices, pieces_of, reader_of, recordings, repeat, say, vary_voice

__all__ = ["LAYOUTS", "Layout", "SynthesisReport", "perform", "synthesise"]


@dataclass(frozen=True)
class Layout:
    """What suits a raw layout.

    Args:
        fps: at which motion is made.
        take: seconds of a take, at most.
        speakers: how many where the caller does not say.
        neutral: number of neutral takes for one take of each other emotion.
        full: whether an emotion of a speaker and split can run out of places.
        voices: whether speakers have voices of their own.
        acted: whether voices act the emotion.
        calm: whether all takes are neutral.
        variation: of the style from take to take.
        silence: share of a take that is silence put into the speech.
    """

    fps: float
    take: float
    speakers: int = 8
    neutral: int = 7
    full: bool = False
    voices: bool = False
    acted: bool = True
    calm: bool = False
    variation: float = 1.0
    silence: float = 0.0


LAYOUTS: dict[str, Layout] = {
    "ted": Layout(25.0, 12.0),
    "trinity": Layout(60.0, 60.0, speakers=1),
    "pats": Layout(15.0, 15.0),
    "beat": Layout(120.0, 30.0, neutral=2, full=True, voices=True),
}
"""Layout → frame rate of the real data, and a length of takes as in the real data; Trinity has one speaker.

Half of the takes are neutral. In BEAT's layout emotions can be learnt: it has two neutral takes for one of each other emotion,
half as long as the real ones, so that a speaker has several of each within half an hour.
"""

_TAKES = 3  # ours: fewest takes of each speaker, one for each split
_SHORTEST_TAKE = 5.0  # seconds; ours
_SHORTEST_HELD_OUT = 8.0  # seconds, of validation and test; ours: a window of 90 frames at 12 a second fits into it
_SHORTEST_STRETCH = 0.05  # seconds; ours: less than two frames of video is nothing to annotate
_MOST_SPEECH = 2 * 3600.0  # seconds of speech in memory, each of recorded and synthesised; ours: 460 MB
_TAKES_PER_SPEECH = 4  # ours: how often a synthesised speech is performed
_PLACES = {"train": 4, "validation": 1, "test": 1}  # of an emotion per speaker in BEAT's plan of recordings
_NEUTRAL = {"train": 48, "validation": 8, "test": 8}
_FULL = 0.95  # of the hours; ours: takes are not cut, so a corpus ends a little before or after


@dataclass(frozen=True)
class SynthesisReport:
    """What was made."""

    layout: str
    takes: int
    seconds: float
    speakers: dict[str, str]
    """Name → how they gesture."""
    emotions: dict[str, int]
    """Emotion → takes."""
    speeches: int
    """Different speeches that were performed; the rest are further takes of them."""

    def summary(self) -> str:
        """One line."""
        return (
            f"{self.seconds / 60:.1f} min; takes: {self.takes}, speeches: {self.speeches}, speakers: {len(self.speakers)}, "
            f"emotions: {len(self.emotions)}; layout of {self.layout}, synthetic"
        )


def synthesise(
    raw: str | PathLike[str],
    layout: str = "beat",
    *,
    speech: str | PathLike[str] | None = None,
    hours: float = 0.5,
    speakers: int | None = None,
    seed: int = 0,
    gestures: int = 0,
    tts: bool = True,
    act: bool = True,
    neutral: bool = False,
    coupling: float | None = None,
    variation: float = 1.0,
    silence: float = 0.0,
    progress: Callable[[float, float | None], None] | None = None,
) -> SynthesisReport:
    """Make a synthetic corpus.

    Args:
        raw: the folder to be; it appears when everything is in it.
        layout: a name of `LAYOUTS`.
        speech: a folder of recordings, words beside them; alternates with synthesised speech. Without it, and without an
            engine that speaks, the example speech that comes with the program is performed again and again.
        hours: of motion, roughly (takes are not cut). BEAT's plan has 106 places for takes of a speaker; where they are full,
            the corpus is shorter, and a warning says so.
        speakers: how many; those of `LAYOUTS` where not given.
        seed: another seed, another corpus; the same one on the same machine, the same bytes.
        gestures: seed of the motion alone: with another one the same speakers say the same and move otherwise.
        tts: whether espeak-ng and flite speak, as far as they are installed.
        act: whether voices act the emotions. Without it they cannot be heard.
        neutral: whether all takes are neutral, so that everything in the motion can be heard or is by chance.
        coupling: how closely brows, nods and blinks go along with strokes, 0 … 1; that of the styles where not given.
        variation: of tempo, amplitude and preferred hand from take to take (`vary_take`), 0 … 2; not audible.
        silence: share of a take that is silence put into the speech, 0 … 0.8 (`silences.add_silences`).
        progress: called with seconds done and seconds in all.

    Returns:
        What was made.

    Raises:
        InputError: an unknown layout, an option out of range, no speech, or a folder that is not empty.
        InternalError: a speech engine failed.
    """
    if layout not in LAYOUTS:
        raise InputError(f"no layout is called {layout!r}", nearest(layout, LAYOUTS))
    if not 0 < hours <= 1000:
        raise InputError(f"{hours} hours", "more than 0, at most 1000")
    for name, value, most in (("coupling", coupling or 0.0, 1), ("variation", variation, 2), ("silence", silence, 0.8)):
        if not 0 <= value <= most:
            raise InputError(f"{name} {value}", f"0 … {most}")
    target, settings = Path(raw), LAYOUTS[layout]
    people = choose_speakers(settings.speakers if speakers is None else speakers, seed)
    if coupling is not None:
        people = [person._replace(style=replace(person.style, coupling=coupling)) for person in people]
    take = max(_SHORTEST_TAKE, min(settings.take, hours * 3600 / len(people) / _TAKES))
    engines = find_voices(seed) if tts else []
    speeches = _up_to(_find_recordings(speech, tts and not engines), min(hours * 3600, _MOST_SPEECH))
    real = {
        split: [repeat(piece, _SHORTEST_TAKE if split == "train" else _SHORTEST_HELD_OUT) for piece in pieces_of(own, take)]
        for split, own in split_recordings(speeches).items()
    }
    if not any(real.values()) and not engines:
        raise InputError("there is no speech to use", "name a folder of speech, --speech FOLDER, or install espeak-ng or flite")
    tally = _Tally()
    pools = _pools(settings, len(people), real, engines, take, hours * 3600, seed)
    take_settings = replace(settings, acted=act, calm=neutral, variation=variation, silence=silence)
    clips = _clips(take_settings, layout, people, pools, hours * 3600, (seed, gestures), tally, progress)
    write = import_module(CORPORA[layout].module).write
    try:
        if target.exists() and (not target.is_dir() or any(target.iterdir())):
            raise InputError(f"{str(target)!r} is not empty", "name a new folder")
        target.parent.mkdir(parents=True, exist_ok=True)
        with workplace(target.parent) as place:
            write(clips, place / "raw")
            if target.exists():
                target.rmdir()
            shutil.move(str(place / "raw"), str(target))
    except OSError as error:
        raise InputError(f"cannot write {str(target)!r}: {describe_os_error(error)}") from None
    if settings.full and tally.seconds < _FULL * hours * 3600:
        note = f"BEAT's plan is full: {tally.seconds / 3600:.1f} of {hours:g} hours are made"
        warnings.warn(f"{note}; more speakers make more (--speakers)", CospeechWarning, stacklevel=2)
    styles = {person.name: person.style.what for person in people}
    return SynthesisReport(layout, tally.takes, tally.seconds, styles, dict(tally.emotions), len(tally.speeches))


def _find_recordings(speech: str | PathLike[str] | None, alone: bool) -> Iterator[Speech]:
    """The recordings to perform; where there are none, and nothing else can speak, the one that comes with the program."""
    if speech is not None:
        yield from recordings(speech)
    elif alone:
        sound, words = example()
        note = "neither espeak-ng nor flite is installed, and no --speech is named: everybody performs the example speech"
        warnings.warn(note, CospeechWarning, stacklevel=3)
        yield Speech.load(sound, transcript=words)


def _up_to(speeches: Iterator[Speech], seconds: float) -> list[Speech]:
    """The first speeches of so many seconds."""
    first: list[Speech] = []
    total = 0.0
    while total < seconds and (speech := next(speeches, None)) is not None:
        first.append(speech)
        total += float(speech.duration)
    return first


@dataclass
class _Tally:
    takes: int = 0
    seconds: float = 0.0

    def __post_init__(self) -> None:
        self.emotions: Counter[str] = Counter()
        self.speeches: set[tuple[int, int]] = set()


class _Pool:
    """Speeches of one split by number: even numbers are recordings, odd ones synthesised, as far as there are both."""

    def __init__(self, real: list[Speech], engines: list[Voice], seconds: float, synthetic: int, seed: int, split: str) -> None:
        self._real, self._engines, self._seconds, self._seed = real, engines, seconds, seed
        self._sentences = SPLIT_SENTENCES[split]
        self._speeches: dict[int, Speech] = {}
        self._synthetic = synthetic if engines else 0

    def __getitem__(self, number: int) -> tuple[int, Speech]:
        """The speech of that number, counted round, and which one it is."""
        if self._real and (not self._synthetic or number % 2 == 0):
            which = (number // 2 if self._synthetic else number) % len(self._real)
            return which, self._real[which]
        which = (number // 2 if self._real else number) % self._synthetic
        if which not in self._speeches:
            seed = self._seed * 1_000_003 + which
            voice = vary_voice(self._engines[which % len(self._engines)], seed)
            self._speeches[which] = say(voice, 0.85 * self._seconds, seed, self._sentences)
        return -1 - which, self._speeches[which]


_Pools = dict[str, _Pool]
"""Split → what a speaker says in it; a split without speech is not there."""


def _pools(
    layout: Layout, people: int, real: dict[str, list[Speech]], engines: list[Voice], take: float, seconds: float, seed: int
) -> list[_Pools]:
    """The speech of each speaker: the same for all, or by voices and readers of its own, as far as there are enough."""
    count = min(seconds / _TAKES_PER_SPEECH, _MOST_SPEECH) / take
    splits = [split for split in SPLITS if real[split] or engines]
    shares = {"train": 0.8, "validation": 0.1, "test": 0.1}

    def pool(split: str, own: list[Speech], voices: list[Voice], among: int, seed: int) -> _Pool:
        number = max(2, int(count * shares[split] / among))
        return _Pool(own, voices, take, number, seed + SPLITS.index(split) * 10_007, split)

    if not layout.voices:
        return [{split: pool(split, real[split], engines, 1, seed) for split in splits}] * people
    readers = [*dict.fromkeys(reader_of(speech) for own in real.values() for speech in own)]
    pools = []
    for who in range(people):
        own_readers, voices = readers[who::people], engines[who::people]
        if not own_readers and not voices:
            own_readers, voices = ([readers[who % len(readers)]], []) if readers else ([], [engines[who % len(engines)]])
        own = {split: [speech for speech in real[split] if reader_of(speech) in own_readers] for split in splits}
        own = {split: own[split] or ([] if voices else real[split]) for split in splits}
        own_pools = {
            split: pool(split, own[split], voices, people, _take_seed(seed, who)) for split in splits if own[split] or voices
        }
        pools.append(own_pools)
    return pools


def _clips(
    settings: Layout, layout: str, people: list[Speaker], pools: list[_Pools], seconds: float, seeds: tuple[int, int],
    tally: _Tally, progress: Callable[[float, float | None], None] | None,
) -> Iterator[Clip]:  # fmt: skip
    """Takes, speaker by speaker, each until the speaker's share is full and each split has one; each split has its own speech.

    ``seeds`` are those of all, and of the gestures.
    """
    seed, gestures = seeds
    places: Counter[tuple[int, str, str]] = Counter()
    for who, person in enumerate(people):
        actor = Actor(seed, who)
        emotions = _emotions(settings.neutral, seed, who)
        length, k, counts = 0.0, 0, Counter[str]()
        while length < seconds / len(people) or k < len(SPLITS):
            emotion = "neutral" if settings.calm else next(emotions)
            split = split_of(k) if split_of(k) in pools[who] else next(iter(pools[who]))
            if settings.full:
                place = _place(places, who, emotion, split, ("neutral",) if settings.calm else EMOTIONS)
                if place is None:
                    break
                emotion, split = place
            which, speech = pools[who][split][counts[split] + 3 * who]  # 3: ours, speakers begin at different speeches
            counts[split] += 1
            own = _take_seed(seed, who, k)
            if settings.acted:
                speech = act(speech, actor.acting(emotion, own), own)
            speech = add_silences(speech, settings.silence, own)
            motion_seed = _take_seed(seed, who, k, gestures) if gestures else own
            style = vary_take(person.style, motion_seed, settings.variation)
            clip = perform(speech, style, emotion=emotion, seed=motion_seed, fps=settings.fps)
            yield replace(clip, name=f"{person.name}-{k:04d}", speaker=person.name, corpus=layout, split=split)
            length, k = length + clip.duration, k + 1
            tally.takes, tally.seconds = tally.takes + 1, tally.seconds + clip.duration
            tally.emotions[emotion] += 1
            tally.speeches.add((id(pools[who][split]), which))
            if progress is not None:
                progress(tally.seconds, seconds)


def _emotions(neutral: int, seed: int, who: int) -> Iterator[str]:
    """Endless emotions: shuffled rounds of one each and ``neutral`` neutral ones, so that nothing else depends on it."""
    rng = np.random.default_rng([seed, who, 14])
    cards = [*EMOTIONS[1:], *["neutral"] * neutral]
    while True:
        yield from (cards[k] for k in rng.permutation(len(cards)))


def _take_seed(*parts: int) -> int:
    """A seed of a take, from the corpus's seed, the speaker's number and the take's."""
    return int(np.random.SeedSequence(parts).generate_state(1)[0])


def _place(
    places: Counter[tuple[int, str, str]], who: int, emotion: str, split: str, others: Sequence[str]
) -> tuple[str, str] | None:
    """An emotion and a split that still have a place in BEAT's plan, as near to the wanted ones as there are; or none."""
    near = product((emotion, "neutral"), (split, "train"))
    for feeling, part in (*near, *product(others, SPLITS)):
        if places[who, feeling, part] < (_NEUTRAL if feeling == "neutral" else _PLACES)[part]:
            places[who, feeling, part] += 1
            return feeling, part
    return None


def perform(speech: Speech, style: Style, *, emotion: str, seed: int, fps: float) -> Clip:
    """One take: a humanoid clip with motion, face, words and the semantic scores of the gestures that were planned."""
    session = RuleBasedModel().session(style=style, emotion=emotion, seed=seed, fps=fps)
    pieces, gestures = list[Motion](), dict[Gesture, None]()
    for chunk in speech.chunks(2.0):
        pieces += session.push(chunk)
        gestures |= dict.fromkeys(session.gestures)  # of hours, a session remembers the last minutes only
    pieces += session.finish()
    motion = Motion.concatenate(pieces)
    return Clip(
        "take",
        "speaker",
        "synthetic",
        speech,
        motion,
        face=motion.face,
        face_fps=fps,
        emotion=emotion,
        semantics=_semantics([*gestures, *(g for g in session.gestures if g not in gestures)], float(speech.duration)),
    )


def _semantics(gestures: list[Gesture], end: float) -> tuple[Semantic, ...]:
    """One stretch after the other; where both hands do different things at once, the more meaningful one counts."""
    stretches: list[Semantic] = []
    for gesture in sorted(gestures, key=lambda g: (g.start, -g.score)):
        stretch = Semantic(max(gesture.start, 0.0), min(gesture.end, end), round(float(gesture.score), 1), "", gesture.word)
        if stretches and stretch.start < stretches[-1].end:
            if stretch.score > stretches[-1].score:
                stretches[-1] = replace(stretches[-1], end=stretch.start)
            else:
                stretch = replace(stretch, start=stretches[-1].end)
        if stretches and stretches[-1].end - stretches[-1].start < _SHORTEST_STRETCH:
            stretches.pop()
        if stretch.end - stretch.start >= _SHORTEST_STRETCH:
            stretches.append(stretch)
    return tuple(stretches)
