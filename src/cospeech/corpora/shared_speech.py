"""The part of the speech of validation and test that is also in training: a model that learnt it by heart scores well there."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from .store import Store

__all__ = ["describe_shared_speech", "measure_shared_speech"]

_RUN = 8  # words in a row; ours: so many in one order are the same text, and no common phrase
_MOST_SHARED = 0.15
"""Share above which figures of a split mean nothing. [ours] Where no sentence is said twice, turns of phrase in our sentences
make up to .09. Where half of eight speakers were split by chance, it was .6."""

_Runs = set[tuple[int, ...]]


def measure_shared_speech(store: Store) -> dict[str, float]:
    """Split → share of its runs of eight words that are also said in the train split.

    Clips that lack words, or say fewer than eight, do not count; a split without any that counts is missing.
    """
    runs: dict[str, _Runs] = {}
    for entry in store.clips:
        if "word" in entry.has:
            runs.setdefault(entry.split, set()).update(_find_runs(store.clip(entry)))
    train = runs.pop("train", set())
    return {split: len(own & train) / len(own) for split, own in runs.items() if own}


def describe_shared_speech(shares: Mapping[str, float]) -> list[str]:
    """A sentence on each split of which too much is also said in training.

    >>> describe_shared_speech({"validation": 0.09, "test": 0.841})
    ['84 % of the speech of the test split is also said in training']
    """
    return [
        f"{100 * share:.0f} % of the speech of the {split} split is also said in training"
        for split, share in shares.items()
        if share > _MOST_SHARED
    ]


def _find_runs(arrays: Mapping[str, np.ndarray]) -> _Runs:
    """The runs of words of a clip, each as numbers of the store's words."""
    numbers = np.asarray(arrays["word"])
    starts = np.flatnonzero(np.diff(numbers, prepend=0))
    words = [int(number) for number in numbers[starts] if number > 0]
    return {tuple(words[k : k + _RUN]) for k in range(len(words) - _RUN + 1)}
