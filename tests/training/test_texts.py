"""Words as numbers: subwords, the word of every frame, whole or in pieces, and the array of a store that is made of them."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as some

from cospeech.audio.features.words import BUCKETS, GRAMS, WordStream, plain_word, subword_rows, subwords, word_ids
from cospeech.audio.speech import Speech, Word, open_speech
from cospeech.audio.speech_chunks import speech_chunks
from cospeech.corpora.lazy_rows import LazyRows
from cospeech.corpora.store import Entry, Store, gather
from cospeech.corpora.store_writer import Piece, write_store
from cospeech.errors import InputError
from cospeech.training.texts import with_subwords, with_vectors
from cospeech.training.windows import Windows


def fnv(data: bytes) -> int:
    """FNV-1a, 32 bits, in unsigned arithmetic of NumPy."""
    value = np.uint32(2166136261)
    with np.errstate(over="ignore"):
        for byte in data:
            value = (value ^ np.uint32(byte)) * np.uint32(16777619)
    return int(value)


def test_subwords_are_the_hashes_of_the_word_and_its_grams():
    assert fnv(b"foobar") == 0xBF9CF968  # of the FNV authors' test vectors
    grams = ["<ca", "cat", "at>", "<cat", "cat>"]
    rows = subwords("Cat!")
    assert rows.dtype == np.int32
    assert rows[0] == 1 + fnv(b"<cat>") % BUCKETS
    assert sorted(rows[1:6]) == sorted(1 + fnv(gram.encode()) % BUCKETS for gram in grams)
    assert not rows[6:].any()


def test_long_words_keep_the_grams_with_the_smallest_hashes():
    word = "<extraordinary>"
    grams = {word[k : k + n] for n in (3, 4, 5) for k in range(len(word) - n + 1)}
    smallest = sorted(fnv(gram.encode()) for gram in grams)[: GRAMS - 1]
    assert list(subwords("extraordinary")[1:]) == [1 + value % BUCKETS for value in smallest]


def test_like_words_share_rows():
    def count_shared_rows(a: str, b: str) -> int:
        return len({*subwords(a)} & {*subwords(b)} - {0})

    assert count_shared_rows("gesture", "gestures") >= 6
    assert count_shared_rows("remember", "remembered") >= 6
    assert count_shared_rows("gesture", "wonderful") <= 2


@pytest.mark.slow
@given(some.text(max_size=300))
def test_any_text_has_subwords(text):
    rows = subwords(text)
    assert rows.shape == (GRAMS,)
    assert rows.min() >= 0
    assert rows.max() <= BUCKETS
    plain = plain_word(text)
    assert len(plain) <= 64
    assert (rows.any()) == bool(plain)
    if rows.any():
        count = np.count_nonzero(rows)
        assert rows[:count].all()
        assert not rows[count:].any()


@pytest.mark.parametrize("word", ["Straße", "où", "ПРИВЕТ", "你好", "नमस्ते", "don't", "İstanbul", "\ud800x", "1984"])
def test_plain_words_stay_as_they_are(word):
    plain = plain_word(f"  «{word}»… ")
    assert plain
    assert plain == plain_word(plain)
    np.testing.assert_array_equal(subwords(word), subwords(plain))


def test_composed_and_decomposed_letters_are_the_same_word():
    np.testing.assert_array_equal(subwords("cafe\u0301"), subwords("café"))


@pytest.mark.parametrize("nothing", [None, "", "…", "—", "  ", "😀"])
def test_no_word_is_all_zero(nothing):
    assert not subwords(nothing).any()


def test_very_long_words_take_no_time():
    assert subwords("a" * 10_000_000).any()


ROWS = (("one", 0.0, 0.31), ("two", 0.31, 0.33), ("three", 0.9, 1.6), ("four", 1.2, 1.3), ("five", 2.9, 3.4))
WORDS = tuple(Word(*row) for row in ROWS)


def test_the_word_of_each_frame():
    words = word_ids(WORDS, 45, 15)
    for frame, text in enumerate(words):
        near = [w.text for w in WORDS if round(w.start * 15) <= frame < max(round(w.end * 15), round(w.start * 15) + 1)]
        assert text == (near[-1] if near else None)
    assert words[5] == "two", "a short word has a frame"
    assert words[16:25] == ["three", "three", "four", "four", *["three"] * 4, None]
    assert word_ids(WORDS, 3, 15) == words[:3]
    assert word_ids((), 4, 15) == [None] * 4


@pytest.mark.parametrize("seconds", [0.01, 0.0375, 0.2, 1.0, 10])
@pytest.mark.parametrize("fps", [15, 20, 30000 / 1001, 60])
def test_pieces_give_the_same_words(seconds, fps):
    speech = Speech(np.zeros(48_000, np.float32), 16_000, WORDS)
    stream, ids = WordStream(fps), []
    for chunk in speech.chunks(seconds):
        ids += stream.push(chunk)
        certain = float(stream.duration) - stream.delay
        assert len(ids) >= certain * fps - 1e-3, "a frame is told as soon as its word is certain"
    ids += stream.finish()
    assert ids == word_ids(WORDS, speech.frames(fps), fps)
    assert stream.finish() == []


@pytest.mark.slow
@given(
    some.lists(some.tuples(some.integers(0, 4000), some.integers(1, 900)), max_size=30),
    some.lists(some.integers(1, 4000), min_size=1, max_size=40),
    some.sampled_from([12.5, 15.0, 24.0, 30.0]),
)
def test_any_cut_gives_the_same_words(words, cuts, fps):
    spoken = sorted((Word(str(k), at / 1000, (at + long) / 1000) for k, (at, long) in enumerate(words)), key=lambda w: w.start)
    stream, ids, at = WordStream(fps), [], 0
    for cut in cuts:
        mine = tuple(w for w in spoken if at / 1000 <= w.start < (at + cut) / 1000)
        ids += stream.push(Speech(np.zeros(cut, np.float32), 1000, mine, start=at / 1000))
        at += cut
    past = [w for w in spoken if w.start < at / 1000]
    ids += stream.finish()
    assert ids == word_ids(past, -(-at * Fraction(fps) // 1000), fps)


def test_waiting_words_are_forgotten():
    stream = WordStream(15)
    for second in range(200):
        words = tuple(Word("so", second + k / 10, second + k / 10 + 0.1) for k in range(10))
        stream.push(Speech(np.zeros(1000, np.float32), 1000, words, start=float(second)))
    assert len(stream._waiting) <= 2


def test_files_in_blocks_give_the_same_words(tmp_path):
    import soundfile

    soundfile.write(tmp_path / "a.wav", np.zeros(44_100 * 4), 44_100)
    with open_speech(tmp_path / "a.wav") as source:
        source.words = WORDS
        stream, ids = WordStream(15), []
        for chunk in speech_chunks(source):
            ids += stream.push(chunk)
        ids += stream.finish()
        assert ids == word_ids(WORDS, source.frames(15), 15)


def test_speech_without_words_is_silence():
    stream = WordStream(15)
    assert stream.push(Speech(np.zeros(16_000, np.float32))) + stream.finish() == [None] * 15
    with pytest.raises(InputError, match="frames per second"):
        WordStream(0)


def piece(name: str, frames: int, words: tuple[str, ...] | None) -> Piece:
    rng = np.random.default_rng(frames)
    values = {"pose": rng.normal(size=(frames, 3)).astype(np.float32)}
    if words is not None:
        values["word"] = rng.integers(0, len(words) + 1, frames).astype(np.int32)
    return Piece(Entry(name, "ann", "train", 0, frames, 0.0, tuple(values)), words or (), lambda: dict(values))


@pytest.fixture
def store(tmp_path: Path) -> Store:
    pieces = [piece("a", 40, ("Hello", "you")), piece("b", 30, None), piece("c", 25, ("you", "…", "gesture"))]
    write_store(tmp_path, pieces, corpus="beat", pose="none", fps=15.0, names={"pose": ("x", "y", "z")})
    return Store(tmp_path)


def test_a_store_with_subwords(store):
    more = with_subwords(store)
    assert "text" not in store.arrays
    assert "text" not in store.clip("a")
    assert more.arrays["text"].shape == (95, GRAMS)
    for name in ("a", "c"):
        rows = more.clip(name)
        expected = subword_rows([store.words[k] if k else None for k in rows["word"]])
        np.testing.assert_array_equal(rows["text"], expected)
    assert "text" not in more.clip("b"), "a clip whose words are not known has no text"
    assert not np.asarray(more.arrays["text"])[40:70].any()


def test_windows_of_words(store):
    windows = Windows(with_subwords(store), 12, ("pose", "word", "text"))
    batch = windows.at(32, 0, 0)
    assert batch["text"].shape == (32, 12, GRAMS)
    assert batch["text"].dtype == np.int32
    expected = subword_rows([store.words[k] if k else None for k in batch["word"].ravel()])
    np.testing.assert_array_equal(batch["text"].reshape(-1, GRAMS), expected)
    assert set(batch["clip"]) == {0, 2}


class Letters:
    """Vectors that count letters."""

    width = 26

    def table(self, words: Sequence[str]) -> np.ndarray:
        return np.array([[1 + word.count(chr(97 + k)) for k in range(26)] for word in words], np.float32)


def test_a_store_with_vectors(store):
    more = with_vectors(store, Letters())
    assert more.arrays["text"].dtype == np.float32
    assert more.arrays["text"].shape == (95, 26)
    rows = more.clip("a")
    for number, row in zip(rows["word"], rows["text"], strict=True):
        np.testing.assert_array_equal(row, Letters().table([store.words[number].lower()])[0] if number else np.zeros(26))
    assert Windows(more, 12, ("text",)).at(4, 0, 0)["text"].shape == (4, 12, 26)


def test_a_store_without_words(tmp_path):
    write_store(tmp_path, [piece("b", 30, None)], corpus="beat", pose="none", fps=15.0, names={"pose": ("x", "y", "z")})
    with pytest.raises(InputError, match="no words"):
        with_subwords(Store(tmp_path))


def test_a_lookup_reads_like_the_array():
    rng = np.random.default_rng(0)
    table, index = rng.normal(size=(7, 3)), rng.integers(0, 7, 50)
    lookup, laid_out = LazyRows(table, index), table[index]
    assert lookup.shape == (50, 3)
    assert len(lookup) == 50
    assert lookup.dtype == np.float64
    for rows in (3, slice(4, 20, 3), np.array([1, 40, 1])):
        np.testing.assert_array_equal(lookup[rows], laid_out[rows])
    np.testing.assert_array_equal(np.asarray(lookup), laid_out)
    np.testing.assert_array_equal(gather(lookup, np.array([0, 30]), 20), gather(laid_out, np.array([0, 30]), 20))
    with pytest.raises(InputError, match="outside"):
        gather(lookup, np.array([31]), 20)
