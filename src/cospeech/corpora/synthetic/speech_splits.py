"""Which speech is of which split, so that no sentence, recording or text of validation or test occurs in training.

A recording is of one split, whoever performs it, and so are all recordings with the same words. If a reader has fewer than
three recordings, each is cut into three stretches, one for each split. The sentences of synthesised speech are divided too.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import pairwise

from ...audio.speech import Speech, Word
from ..clip import SPLITS
from .texts import EVERYDAY, TOPICS
from .voices import reader_of

__all__ = ["SPLIT_SENTENCES", "split_of", "split_recordings"]

_SHARES = (0.6, 0.2, 0.2)  # [ours] of a recording that is cut: train, validation, test
_SHORTEST = 1.0  # seconds; [ours] a shorter stretch is no speech to gesture to


def split_of(number: int) -> str:
    """The split of item ``number``: of ten items, one is for the test and one for validation."""
    return {1: "test", 2: "validation"}.get(number % 10, "train")


SPLIT_SENTENCES: dict[str, tuple[str, ...]] = {
    split: (
        *(text for k, text in enumerate(EVERYDAY) if split_of(k) == split),
        *(text for k, topic in enumerate(TOPICS) if split_of(k) == split for text in topic),
    )
    for split in SPLITS
}
"""Split → the sentences that its synthesised speech consists of. A topic belongs to one split."""


def split_recordings(speeches: Iterable[Speech]) -> dict[str, list[Speech]]:
    """Recordings by split; those of readers with fewer than three, in stretches."""
    readers: dict[str, list[Speech]] = {}
    for speech in speeches:
        readers.setdefault(reader_of(speech), []).append(speech)
    by_split: dict[str, list[Speech]] = {split: [] for split in SPLITS}
    text_splits: dict[str, str] = {}
    few: list[Speech] = []
    for own in readers.values():
        texts = dict.fromkeys(map(_text, own))
        if len(texts) < len(SPLITS):
            few += own
            continue
        new = [text for text in texts if text not in text_splits]
        text_splits |= {text: split_of(k) for k, text in enumerate(new)}
        for speech in own:
            by_split[text_splits[_text(speech)]].append(speech)
    for speech in few:
        if (whole := text_splits.get(_text(speech))) is not None:
            by_split[whole].append(speech)
            continue
        for split, stretch in zip(SPLITS, _cut(speech), strict=True):
            if float(stretch.duration) >= _SHORTEST:
                by_split[split].append(stretch)
    return by_split


def _text(speech: Speech) -> str:
    """What a recording says, or its name where the words are not known."""
    return " ".join(word.text.lower() for word in speech.words) if speech.words else f"\0{speech.name}"


def _cut(speech: Speech) -> list[Speech]:
    """Three stretches, cut between words where they are known, so that the same words are cut at the same places."""
    ends, words = [sum(_SHARES[: k + 1]) for k in range(len(_SHARES))], speech.words or ()
    if len(words) >= len(SPLITS):
        last = [round(end * len(words)) for end in ends]
        times = [0.0, *((words[k - 1].end + words[k].start) / 2 for k in last[:-1]), float(speech.duration)]
    else:
        times = [0.0, *(end * float(speech.duration) for end in ends)]
    return [_stretch(speech, a, b, words) for a, b in pairwise(times)]


def _stretch(speech: Speech, start: float, end: float, words: Sequence[Word]) -> Speech:
    first, last = round(start * speech.rate), round(end * speech.rate)
    own = tuple(
        replace(word, start=max(word.start - start, 0.0), end=word.end - start)
        for word in words
        if start <= (word.start + word.end) / 2 < end
    )
    return Speech(speech.samples[first:last], speech.rate, None if speech.words is None else own, name=speech.name)
