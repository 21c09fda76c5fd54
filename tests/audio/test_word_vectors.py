"""Word vectors of fastText, against means that are computed here from the rows of the file; and broken files."""

from __future__ import annotations

import gzip
import json
import struct
import sys
import tracemalloc
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from cospeech.audio.features.word_vectors import BinVectors, ngrams, open_vectors
from cospeech.errors import InputError

WORDS = ["</s>", "the", "gesture", "Straße", "мир", "你好", "don't", "a"]
OTHERS = ["gestures", "Straßen", "привет", "日本語", "😀😀", "x", "<a>", "zzzz", "unknown-word"]


@dataclass(frozen=True)
class Model:
    """A model of fastText, and how it is written: its ``saveModel``, in Python."""

    words: tuple[str, ...] = tuple(WORDS)
    labels: tuple[str, ...] = ()
    width: int = 7
    buckets: int = 50
    low: int = 3
    high: int = 6
    supervised: bool = False
    pruned: tuple[tuple[int, int], ...] | None = None
    version: int = 12

    @property
    def matrix(self) -> np.ndarray:
        rows = len(self.words) + (self.buckets if self.pruned is None else len(self.pruned))
        return np.random.default_rng(rows).normal(size=(rows, self.width)).astype("<f4")

    def head(self) -> bytes:
        model = 3 if self.supervised else 2
        out = struct.pack("<2i", 793712314, self.version)
        out += struct.pack("<12id", self.width, 5, 5, 1, 5, 1, 2, model, self.buckets, self.low, self.high, 100, 1e-4)
        entries = [(word, 0) for word in self.words] + [(label, 1) for label in self.labels]
        pruned_count = -1 if self.pruned is None else len(self.pruned)
        out += struct.pack("<3i2q", len(entries), len(self.words), len(self.labels), 1234, pruned_count)
        for k, (text, kind) in enumerate(entries):
            out += text.encode() + b"\0" + struct.pack("<qb", 97 + k, kind)  # counts that look like letters
        return out + b"".join(struct.pack("<2i", *pair) for pair in self.pruned or ())

    def bytes(self) -> bytes:
        outputs = len(self.labels) if self.supervised else len(self.words)
        out = self.head() + struct.pack("<?2q", False, *self.matrix.shape) + self.matrix.tobytes()
        return out + struct.pack("<?2q", False, outputs, self.width) + bytes(4 * outputs * self.width)

    def rows(self, word: str) -> list[int]:
        """Rows of a word, character by character rather than byte by byte."""
        indices = [self.words.index(word)] if word in self.words else []
        if word == "</s>" or not self.buckets:
            return indices
        text = f"<{word}>"
        for first in range(len(text)):
            for size in range(max(1, self.low), self.high + 1):
                gram = text[first : first + size]
                if len(gram) < size or (size == 1 and first in (0, len(text) - 1)):
                    continue
                value = np.uint32(2166136261)
                with np.errstate(over="ignore"):
                    for byte in np.frombuffer(gram.encode(), np.int8):
                        value = (value ^ byte.astype(np.int32).astype(np.uint32)) * np.uint32(16777619)
                bucket: int | None = int(value) % self.buckets
                if self.pruned is not None:
                    bucket = dict(self.pruned).get(bucket)
                if bucket is not None:
                    indices.append(len(self.words) + bucket)
        return indices

    def vector(self, word: str) -> np.ndarray:
        rows = self.rows(word)
        return self.matrix[rows].astype(np.float64).mean(0) if rows else np.zeros(self.width)


MODELS = {
    "skipgram": Model(),
    "five": Model(low=5, high=5, buckets=300),
    "one": Model(low=1, high=2),
    "no n-grams": Model(low=0, high=0, buckets=0),
    "n-grams of no length": Model(low=0, high=0),
    "supervised": Model(labels=("__label__a", "__label__b"), supervised=True),
    "version 11": Model(labels=("__label__a",), supervised=True, version=11),
    "pruned": Model(pruned=((3, 0), (17, 2), (40, 1))),
}


@pytest.mark.parametrize("name", MODELS)
def test_vectors_of_a_bin(tmp_path: Path, name: str):
    model = MODELS[name]
    (tmp_path / "a.bin").write_bytes(model.bytes())
    vectors = open_vectors(tmp_path / "a.bin")
    assert vectors.width == model.width
    words = [*WORDS, *OTHERS, "__label__a", ""]
    reference = Model(**vars(model) | {"high": 0}) if name == "version 11" else model  # fastText's own exception
    expected = np.array([reference.vector(word) for word in words])
    np.testing.assert_allclose(vectors.table(words), expected, atol=1e-6)
    if reference.high:
        assert expected[len(WORDS) :].any(), "words outside the dictionary have vectors"


def test_n_grams_of_fasttexts_documentation():
    grams = [gram.decode() for gram in ngrams("où".encode(), 3, 6)]
    assert grams == ["<où", "<où>", "où>"]
    assert ngrams(b"where", 3, 3) == [b"<wh", b"whe", b"her", b"ere", b"re>"]  # Bojanowski et al. 2017, section 3.2
    assert ngrams(b"a", 1, 1) == [b"a"]


def text_of(model: Model, *, end: str = " \n") -> bytes:
    """A ``.vec`` as fastText writes it, with a blank before the end of a line."""
    rows = [f"{w} {' '.join(f'{x:.9g}' for x in row)}" for w, row in zip(model.words, model.matrix, strict=False)]
    return (f"{len(rows)} {model.width}\n" + end.join([*rows, ""])).encode()


@pytest.mark.parametrize("end", [" \n", "\n", "\r\n"])
@pytest.mark.parametrize("is_packed", [False, True])
def test_vectors_of_a_vec(tmp_path: Path, end: str, is_packed: bool):
    model, path = Model(), tmp_path / ("a.vec.gz" if is_packed else "a.vec")
    data = text_of(model, end=end)
    path.write_bytes(gzip.compress(data) if is_packed else data)
    vectors = open_vectors(path)
    assert vectors.width == 7
    words = ["мир", "nowhere", "the", "the", "Straße"]
    expected = np.stack([model.matrix[model.words.index(w)] if w in model.words else np.zeros(7) for w in words])
    np.testing.assert_array_equal(vectors.table(words), expected.astype(np.float32))
    assert vectors.table([]).shape == (0, 7)


def test_names_do_not_matter(tmp_path: Path):
    (tmp_path / "a.vec").write_bytes(Model().bytes())
    (tmp_path / "a.bin").write_bytes(text_of(Model()))
    assert isinstance(open_vectors(tmp_path / "a.vec"), BinVectors)
    assert not isinstance(open_vectors(tmp_path / "a.bin"), BinVectors)


def write_quantised_model() -> bytes:
    """The beginning of a quantised model, with the mark that says so."""
    return Model(labels=("__label__a",), supervised=True).head() + struct.pack("<?2q", True, 58, 7) + bytes(500)


BAD_FILES = {
    "empty": (b"", "no word vectors|missing|is empty"),
    "quantised": (write_quantised_model(), "is quantised"),
    "packed bin": (gzip.compress(Model().bytes()), "gunzip"),
    "newer": (struct.pack("<2i", 793712314, 13) + Model().bytes()[8:], "version 13"),
    "no header": (b"the 0.1 0.2\nof 0.3 0.4\n", "no word vectors"),
    "wild sizes": (b"99999999999999999999 7\n", "missing"),
    "wide": (b"3 99999999\n", "no word vectors"),
    "negative": (b"-3 7\n", "no word vectors"),
    "cut off": (text_of(Model())[:300], "line 5|is missing"),
    "packed, cut off": (gzip.compress(text_of(Model()))[:60], "cut off"),
    "packed rubbish": (gzip.compress(text_of(Model()))[:30] + bytes(99), "cannot read"),
    "endless line": (b"2 7\nthe " + b"0.1 " * 400_000, "too long"),
    "short row": (b"1 7\nthe 1 2 3\n", "not a word and 7 numbers"),
    "letters": (b"1 3\nthe 1 x 3\n", "not a word and 3 numbers"),
    "not a number": (b"1 3\nthe 1 nan 3\n", "not a word and 3 numbers"),
}


@pytest.mark.parametrize("name", BAD_FILES)
def test_broken_files_are_told(tmp_path: Path, name: str):
    data, words = BAD_FILES[name]
    (tmp_path / "a").write_bytes(data)
    with pytest.raises(InputError, match=words):
        open_vectors(tmp_path / "a").table(["the", "nowhere"])


def test_no_file_and_a_folder(tmp_path: Path):
    for path in (tmp_path / "none.bin", tmp_path):
        with pytest.raises(InputError, match="cannot read"):
            open_vectors(path)


@pytest.mark.parametrize("name", ["skipgram", "supervised", "pruned"])
def test_any_cut_of_a_bin_is_told(tmp_path: Path, name: str):
    data, path = MODELS[name].bytes(), tmp_path / "a.bin"
    for length in [*range(4, 400, 7), *range(400, len(data), 97)]:
        path.write_bytes(data[:length])
        with pytest.raises(InputError):
            open_vectors(path).table(["the", "nowhere"])


@pytest.mark.slow
def test_damage_of_any_kind_is_told_or_harmless(tmp_path: Path):
    rng, path, data = np.random.default_rng(5), tmp_path / "a.bin", Model(pruned=((3, 0), (17, 1))).bytes()
    other = Model().bytes()
    for k in range(800):
        hurt = bytearray(other if k % 2 else data)
        for _ in range(rng.integers(1, 4)):
            at = int(rng.integers(4, min(len(hurt), 260)))
            hurt[at : at + 4] = rng.choice([rng.bytes(4), b"\xff\xff\xff\x7f", b"\xff\xff\xff\xff", bytes(4)])
        path.write_bytes(hurt)
        try:
            table = open_vectors(path).table(["the", "gestures", ""])
        except InputError:
            table = np.zeros((3, 1))
        assert np.isfinite(table).all()


@pytest.mark.slow
def test_text_of_any_kind_is_told_or_harmless(tmp_path: Path):
    rng, path, data = np.random.default_rng(6), tmp_path / "a.vec", text_of(Model())
    for _ in range(500):
        hurt = bytearray(data)
        for _ in range(rng.integers(1, 6)):
            hurt[int(rng.integers(0, len(hurt)))] = rng.choice(list(b"\n 9-e.\xff\0"))
        path.write_bytes(hurt)
        try:
            assert np.isfinite(open_vectors(path).table(["the", "gesture", "a"])).all()
        except InputError:
            continue


@pytest.mark.skipif(sys.platform == "win32", reason="files have no holes by themselves")
def test_a_large_model_opens_at_once(tmp_path: Path):
    """A file of 8 GB, sparse but for the dictionary: opening it reads only its beginning and its end."""
    model = Model(width=300)
    head = bytearray(model.head())
    struct.pack_into("<i", head, 8 + 8 * 4, buckets := 7_000_000)
    rows = len(WORDS) + buckets
    with (tmp_path / "a.bin").open("wb") as file:
        file.write(head + struct.pack("<?2q", False, rows, 300))
        file.seek(rows * 300 * 4, 1)
        file.write(struct.pack("<?2q", False, len(WORDS), 300) + bytes(4 * 300 * len(WORDS)))
    tracemalloc.start()
    vectors = open_vectors(tmp_path / "a.bin")
    assert not vectors.table(["the", "nowhere"]).any()
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 2**24


def test_fixture_of_fasttext_itself():
    """Vectors that fastText 0.9.3 gave, of a model that it trained itself."""
    folder = Path(__file__).parents[1] / "data" / "fasttext"
    vectors = json.loads((folder / "vectors.json").read_text("utf-8"))
    np.testing.assert_array_equal(open_vectors(folder / "model.bin").table([*vectors]), np.float32([*vectors.values()]))
