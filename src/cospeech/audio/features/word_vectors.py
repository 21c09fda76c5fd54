"""Vectors of words learnt by fastText (Bojanowski et al. 2017), read from its own files: ``.vec``, ``.vec.gz`` and ``.bin``.

A ``.vec`` is text: how many words and how wide, then a word and its numbers per line; a word that is not in it has none. A
``.bin`` is the whole model: a word's vector is the mean of its own row of the input matrix and of the rows that a hash finds
for its character n-grams; words that are not in the dictionary have those of their n-grams alone. It is mapped, never loaded: a
file of 7 GB opens at once, and only the rows that are needed are read. The layout of a ``.bin`` is that of fastText's own
``saveModel`` (little-endian, version 12; 11 differs in one default).
"""

from __future__ import annotations

import gzip
import mmap
import struct
import zlib
from array import array
from collections.abc import Sequence
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import IO, Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from ...files import describe_os_error, regular_file
from ...limits import WORD_VECTOR_WIDTH
from .mel import Floats

__all__ = ["BinVectors", "TextVectors", "WordVectors", "ngrams", "open_vectors"]

_MAGIC, _VERSIONS = 793712314, (11, 12)  # fastText's own
_ARGUMENTS = struct.Struct("<12id")  # dim ws epoch minCount neg wordNgrams loss model bucket minn maxn lrUpdateRate; t
_COUNTS = struct.Struct("<3i2q")  # entries, words, labels; tokens, pruned n-grams (-1: none)
_MATRIX = struct.Struct("<?2q")  # whether quantised; rows, columns
_SUPERVISED = 3  # model_name::sup
_SENTENCE_END = b"</s>"  # the only word without n-grams
_BASIS, _PRIME = 2166136261, 16777619  # FNV-1a of 32 bits, but for bytes with a sign, as fastText's has
_LONGEST_LINE = 1 << 20  # bytes of a line of a .vec; ours: far above what the widest vector takes
_LONGEST_GRAM = 64  # ours: fastText's n-grams have at most 6 characters


class WordVectors(Protocol):
    """Words → vectors."""

    @property
    def width(self) -> int:
        """Numbers of a vector."""
        ...

    def table(self, words: Sequence[str]) -> Floats:
        """(V, width) float32, a row for each word; zeros for one that has no vector.

        Raises:
            InputError: the file is damaged.
        """
        ...


def open_vectors(path: str | PathLike[str]) -> WordVectors:
    """Open a file of fastText's; its content shows which kind it is.

    >>> vectors = open_vectors("cc.en.300.bin")                                  # doctest: +SKIP
    >>> vectors.table(["gesture", "gesturing"]).shape                            # doctest: +SKIP
    (2, 300)

    Raises:
        InputError: it cannot be read, is none, is quantised, or is cut off.
    """
    path = regular_file(path, "word vectors")
    try:
        with path.open("rb") as file:
            head = file.read(4)
        is_packed = head[:2] == b"\x1f\x8b"
        if is_packed:
            with gzip.open(path) as stream:
                head = stream.read(4)
    except (OSError, EOFError, zlib.error) as error:
        reason = describe_os_error(error) if isinstance(error, OSError) else "is it cut off?"
        raise InputError(f"cannot read the word vectors {str(path)!r}: {reason}") from None
    if head == struct.pack("<i", _MAGIC):
        if is_packed:
            raise InputError(f"{str(path)!r} is a packed .bin, which cannot be mapped", f"unpack it: gunzip {path.name}")
        return BinVectors(path)
    return TextVectors(path, gzip.open if is_packed else open)


class TextVectors:
    """A ``.vec``, read from its beginning to its end for each `table`.

    Args:
        path: of the file.
        opener: `open`, or `gzip.open` for a packed file.

    Raises:
        InputError: it does not begin with how many words it has and how wide they are.
    """

    def __init__(self, path: Path, opener: Any = open) -> None:
        self._path, self._opener = path, opener
        with self._open() as file:
            self.words, self.width = self._head(file)

    def table(self, words: Sequence[str]) -> Floats:
        """(V, width) float32; zeros for words that are not in the file.

        Raises:
            InputError: the file is cut off or damaged; the line is named.
        """
        places: dict[bytes, list[int]] = {}
        for row, word in enumerate(words):
            places.setdefault(word.encode("utf-8", "surrogatepass"), []).append(row)
        out = np.zeros((len(words), self.width), np.float32)
        with self._open() as file:
            self._head(file)
            for number in range(self.words):
                line = self._line(file, number + 2)
                rows = places.pop(line[: line.find(b" ")], None)
                if rows is not None:
                    out[rows] = self._numbers(line, number + 2)
        return out

    def _open(self) -> Any:
        return _Reading(self._path, self._opener)

    def _head(self, file: IO[bytes]) -> tuple[int, int]:
        try:
            words, width = map(int, self._line(file, 1).split())
        except ValueError as error:
            if isinstance(error, InputError):
                raise
            words = width = -1
        if words < 0 or not 1 <= width <= WORD_VECTOR_WIDTH:
            hint = "its first line is how many words, and how many numbers each has; or is it a .bin that is damaged?"
            raise InputError(f"{str(self._path)!r} holds no word vectors of fastText", hint)
        return words, width

    def _line(self, file: IO[bytes], number: int) -> bytes:
        line = file.readline(_LONGEST_LINE)
        if not line.endswith(b"\n") and (not line or len(line) == _LONGEST_LINE):
            what = "is too long" if line else "is missing"
            raise InputError(f"{str(self._path)!r}: line {number} {what}", "was the download interrupted?")
        return line

    def _numbers(self, line: bytes, number: int) -> Floats:
        fields = line.split(b" ")[1:]
        fields = fields[:-1] if not fields[-1].strip() else fields  # fastText ends lines with a blank
        try:
            with np.errstate(over="ignore"):
                values = np.array([float(field) for field in fields], np.float32)
        except (ValueError, OverflowError):
            values = np.zeros(0, np.float32)
        if len(values) != self.width or not np.isfinite(values).all():
            problem = f"{str(self._path)!r}: line {number} has not a word and {self.width} numbers"
            raise InputError(problem, "was the download interrupted?")
        return values


class _Reading:
    """Opens a file for a ``with`` block; errors of reading it become an InputError."""

    def __init__(self, path: Path, opener: Any) -> None:
        self._path, self._opener = path, opener

    def __enter__(self) -> IO[bytes]:
        try:
            self._file: IO[bytes] = self._opener(self._path, "rb")
        except OSError as error:
            self._fail(error)
        return self._file

    def __exit__(self, _kind: object, error: BaseException | None, _trace: object) -> None:
        self._file.close()
        if isinstance(error, (OSError, EOFError, zlib.error)):
            self._fail(error)

    def _fail(self, error: BaseException) -> None:
        reason = describe_os_error(error) if isinstance(error, OSError) and error.strerror else "is it cut off?"
        raise InputError(f"cannot read the word vectors {str(self._path)!r}: {reason}") from None


class _WordIndex(NamedTuple):
    """The dictionary of a ``.bin``: (N,) Python's hashes of the words in ascending order, and (N,) their rows and places."""

    hashes: NDArray[np.int64]
    rows: NDArray[np.int64]
    places: NDArray[np.int64]
    prune_index: dict[int, int] | None


class BinVectors:
    """A ``.bin``, mapped. Its dictionary is read once, at the first word that is looked up.

    Args:
        path: of the file.

    Raises:
        InputError: it cannot be read, is of another version, is quantised, is cut off, or its sizes do not fit.
    """

    def __init__(self, path: str | PathLike[str]) -> None:
        self._path = Path(path)
        try:
            with self._path.open("rb") as file:
                self._data = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
        except (OSError, ValueError) as error:  # ValueError: it is empty
            reason = describe_os_error(error) if isinstance(error, OSError) else str(error)
            raise InputError(f"cannot read the word vectors {str(self._path)!r}: {reason}") from None
        magic, version = self._read(struct.Struct("<2i"), 0)
        if magic != _MAGIC or version not in _VERSIONS:
            problem = f"{str(self._path)!r} is no model of fastText that we know: mark {magic}, version {version}"
            raise InputError(problem, f"{_MAGIC}, version {_VERSIONS[-1]} belongs there")
        arguments = self._read(_ARGUMENTS, 8)
        self.width, model, self._buckets, low, high = (int(arguments[k]) for k in (0, 7, 8, 9, 10))
        self._lengths = (low, 0 if version == 11 and model == _SUPERVISED else high)
        at = 8 + _ARGUMENTS.size
        self._entries, self.words, labels, _, self._prune_size = self._read(_COUNTS, at)
        self._dictionary = at + _COUNTS.size
        sizes = (self._entries, self.words, labels, self._buckets)
        if min(sizes) < 0 or self.words + labels != self._entries or not 1 <= self.width <= WORD_VECTOR_WIDTH:
            raise self._make_error(f"{self.words} words, {labels} labels, {self._buckets} buckets, {self.width} wide")
        if high > _LONGEST_GRAM:
            raise self._make_error(f"n-grams of {high} characters")
        self._matrix_at = self._find_matrix(labels if model == _SUPERVISED else self.words)
        count = self._rows * self.width
        flat = np.frombuffer(self._data, "<f4", count, self._matrix_at + _MATRIX.size)
        self._matrix = flat.reshape(self._rows, self.width)

    @property
    def _rows(self) -> int:
        """How many rows the input matrix has."""
        return self.words + (self._buckets if self._prune_size < 0 else self._prune_size)

    def table(self, words: Sequence[str]) -> Floats:
        """(V, width) float32; zeros for a word that has neither a row nor n-grams.

        Raises:
            InputError: the file is damaged.
        """
        return np.array([self.vector(word) for word in words], np.float32).reshape(-1, self.width)

    def vector(self, word: str) -> Floats:
        """(width,) float32: the mean of the rows of a word, added up in fastText's order.

        Raises:
            InputError: the file is damaged.
        """
        rows = self.rows(word)
        total = np.zeros(self.width, np.float32)
        for row in rows:
            total += self._matrix[row]
        if not np.isfinite(total).all():
            raise self._make_error(f"the vector of {word[:40]!r} is not finite")
        return total * np.float32(1 / max(1, len(rows)))

    def rows(self, word: str) -> list[int]:
        """Rows of the input matrix: the word's own, where the dictionary has it, then those of its n-grams."""
        text = word.encode("utf-8", "surrogatepass")
        own = self._row(text)
        rows = [] if own is None else [own]
        if text == _SENTENCE_END or not self._buckets:
            return rows
        hashes = [_hash(gram) % self._buckets for gram in ngrams(text, *self._lengths)]
        if (prune_index := self._word_index.prune_index) is not None:
            hashes = [prune_index[value] for value in hashes if value in prune_index]
        return rows + [self.words + value for value in hashes]

    def _row(self, text: bytes) -> int | None:
        index, key = self._word_index, hash(text)
        first, last = (int(np.searchsorted(index.hashes, key, side)) for side in ("left", "right"))  # type: ignore[call-overload]
        for k in range(first, last):
            at = int(index.places[k])
            if self._data[at : at + len(text) + 1] == text + b"\0":
                return int(index.rows[k])
        return None

    @cached_property
    def _word_index(self) -> _WordIndex:
        """Read the dictionary: each entry is a word, 0, its count in 8 bytes, and its kind in 1 byte."""
        hashes, places, find, data = array("q"), array("q"), self._data.find, self._data
        at = self._dictionary
        for _ in range(self.words):
            end = find(b"\0", at)
            if end < 0 or end + 10 > self._matrix_at or data[end + 9]:
                raise self._make_error("its dictionary does not have the words that it says")
            hashes.append(hash(data[at:end]))
            places.append(at)
            at = end + 10
        at = self._skip(self._entries - self.words, at)
        pairs = np.frombuffer(self._data, "<i4", 2 * max(0, self._prune_size), at).tolist()
        if at + 4 * len(pairs) != self._matrix_at or any(not 0 <= to < self._prune_size for to in pairs[1::2]):
            raise self._make_error("its dictionary and its matrix do not fit")
        prune_index = None if self._prune_size < 0 else dict(zip(pairs[::2], pairs[1::2], strict=True))
        keys = np.array(hashes, np.int64)
        order = np.argsort(keys, kind="stable")
        return _WordIndex(keys[order], order, np.array(places, np.int64)[order], prune_index)

    def _skip(self, entries: int, at: int) -> int:
        """The place behind some entries of the dictionary."""
        for _ in range(entries):
            end = self._data.find(b"\0", at)
            if end < 0:
                raise self._make_error("its dictionary is cut off")
            at = end + 10
        return at

    def _find_matrix(self, outputs: int) -> int:
        """Find where the input matrix begins. Usually the output matrix follows it and ends the file: then its place is counted
        from the end. Else it lies behind the dictionary, which has to be read.

        Raises:
            InputError: there is none, or it is quantised.
        """
        at = len(self._data) - self._size_of(self._rows) - self._size_of(outputs)
        if at >= self._dictionary + 10 * self._entries and self._dense(at, self._rows):
            return at
        at = self._skip(self._entries, self._dictionary) + 8 * max(0, self._prune_size)
        if self._read(_MATRIX, at)[0]:
            raise InputError(f"{str(self._path)!r} is quantised", "take the .bin of which it was made; its vectors are coarse")
        after = at + self._size_of(self._rows)
        if (
            not self._dense(at, self._rows)
            or not self._dense(after, outputs)
            or after + self._size_of(outputs) > len(self._data)
        ):
            raise self._make_error(f"no matrices of {self._rows} and {outputs} × {self.width}")
        return at

    def _size_of(self, rows: int) -> int:
        return _MATRIX.size + 4 * self.width * rows

    def _dense(self, at: int, rows: int) -> bool:
        """Whether the header of a matrix of so many rows, not quantised, is here."""
        return self._read(_MATRIX, at) == (False, rows, self.width)

    def _read(self, layout: struct.Struct, at: int) -> tuple[Any, ...]:
        if at + layout.size > len(self._data):
            raise self._make_error("it is cut off")
        return layout.unpack_from(self._data, at)

    def _make_error(self, what: str) -> InputError:
        return InputError(f"the word vectors {str(self._path)!r} are damaged: {what}", "was the download interrupted?")


def ngrams(word: bytes, low: int, high: int) -> list[bytes]:
    """The n-grams of ``<word>`` of low … high characters of UTF-8, in fastText's order; no single bracket is one.

    >>> ngrams(b"at", 3, 6)
    [b'<at', b'<at>', b'at>']
    """
    text = b"<" + word + b">"
    starts = [k for k, byte in enumerate(text) if byte & 0xC0 != 0x80] + [len(text)]
    count = len(starts) - 1
    grams = []
    for first in range(count):
        for last in range(first + max(low, 1), min(first + high, count) + 1):
            if last - first > 1 or 0 < first < count - 1:
                grams.append(text[starts[first] : starts[last]])
    return grams


def _hash(gram: bytes) -> int:
    """FNV-1a of bytes with a sign: those above 127 are extended by ones, as C++ does."""
    value = _BASIS
    for byte in gram:
        value = (value ^ (byte if byte < 128 else byte | 0xFFFFFF00)) * _PRIME & 0xFFFFFFFF
    return value
