"""Finds the array of a store that a reduction of audio needs."""

from __future__ import annotations

from copy import copy
from dataclasses import replace

from ..audio.features.reduce import audio_columns
from ..corpora.store import Store

__all__ = ["with_audio"]


def with_audio(store: Store, audio: str | None) -> Store:
    """The same store, with an array ``audio`` of the columns that a reduction takes, where any array has them; its files stay.

    Args:
        store: with ``audio``, and perhaps other arrays of speech, such as ``waveform``.
        audio: name of the reduction; None: all columns of ``audio``.

    Raises:
        InputError: no such reduction.
    """
    columns = () if audio is None else audio_columns(audio)
    array = next((name for name in store.arrays if name != "audio" and columns and store.names.get(name) == columns), None)
    if array is None:
        return store
    more = copy(store)
    more.arrays = store.arrays | {"audio": store.arrays[array]}
    more.names = {**store.names, "audio": store.names[array]}
    more.clips = tuple(replace(clip, has=_exchange(clip.has, array)) for clip in store.clips)
    return more


def _exchange(has: tuple[str, ...], array: str) -> tuple[str, ...]:
    """The arrays of a clip when ``array`` is its audio."""
    others = tuple(name for name in has if name != "audio")
    return (*others, "audio") if array in has else others
