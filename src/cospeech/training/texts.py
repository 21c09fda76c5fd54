"""The words of a store as numbers for a network: subwords of a table that it learns, or vectors learnt elsewhere."""

from __future__ import annotations

from copy import copy
from dataclasses import replace
from typing import cast

import numpy as np

from ..audio.features.word_vectors import WordVectors, open_vectors
from ..audio.features.words import plain_word, subword_rows
from ..corpora.lazy_rows import LazyRows
from ..corpora.store import Store
from ..errors import InputError
from ..motion.rotations import Array

__all__ = ["with_subwords", "with_text", "with_vectors"]


def with_text(store: Store, words: str | None) -> Store:
    """The same store with the array ``text`` as a recipe has it: subwords, or vectors of the file that ``words`` names."""
    return with_subwords(store) if words is None else with_vectors(store, open_vectors(words))


def with_subwords(store: Store) -> Store:
    """The same store with the array ``text`` (N, `GRAMS`) int32 of `cospeech.audio.features.words.subwords`; its files stay.

    Raises:
        InputError: the store has no words.
    """
    return _with_text(store, subword_rows(["", *store.words[1:]]))


def with_vectors(store: Store, vectors: WordVectors) -> Store:
    """The same store with the array ``text`` (N, width) float32 of the words' vectors; zeros in silence. Its files stay.

    Raises:
        InputError: the store has no words, or the vectors cannot be read.
    """
    plain = [plain_word(word) for word in store.words]
    return _with_text(store, vectors.table(plain) * np.array([[word != ""] for word in plain], np.float32))


def _with_text(store: Store, table: Array) -> Store:
    """``text`` from a table, by ``word``. Rows without known words have that of silence, and their clips have no ``text``."""
    if "word" not in store.arrays or len(store.words) < 2:
        hint = "prepare it from a corpus with transcripts, or choose a model without text"
        raise InputError(f"the store {str(store.folder)!r} has no words", hint)
    word = np.asarray(store.arrays["word"])
    if word.max(initial=0) >= len(store.words):
        raise InputError(f"the store {str(store.folder)!r} has word {word.max()} of {len(store.words)}", "prepare it again")
    more = copy(store)
    more.arrays = store.arrays | {"text": cast(Array, LazyRows(table, np.maximum(word, 0)))}
    more.clips = tuple(replace(clip, has=(*clip.has, "text")) if "word" in clip.has else clip for clip in store.clips)
    return more
