"""From a transcript of any kind to the words that a system is given, of a file and of pieces as a microphone gives them."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import soundfile

import cospeech
from cospeech import generate
from cospeech.audio.features.words import WordStream, word_ids
from cospeech.audio.speech import Speech, Word, open_speech
from cospeech.audio.speech_chunks import speech_chunks
from cospeech.models import load

RATE = 22_050
GRID = """File type = "ooTextFile"
Object class = "TextGrid"

xmin = 0
xmax = 6
tiers? <exists>
size = 1
item []:
    item [1]:
        class = "IntervalTier"
        name = "words"
        xmin = 0
        xmax = 6
        intervals: size = 4
        intervals [1]:
            xmin = 0
            xmax = 0.5
            text = ""
        intervals [2]:
            xmin = 0.5
            xmax = 1.0
            text = "hello"
        intervals [3]:
            xmin = 1.0
            xmax = 3.1
            text = "big"
        intervals [4]:
            xmin = 3.1
            xmax = 5.5
            text = "world"
"""
WORDS_WITH_TIMES = [{"word": "hello", "start": 0.5, "end": 1.0}, {"word": "big", "start": 1.0, "end": 3.1}]
WORDS_WITH_TIMES += [{"word": "world", "start": 3.1, "end": 5.5}]
SUBTITLES = "1\n00:00:00,500 --> 00:00:01,000\nhello\n\n2\n00:00:01,000 --> 00:00:03,100\nbig\n\n"
SUBTITLES += "3\n00:00:03,100 --> 00:00:05,500\nworld\n"
KINDS = {
    "a.TextGrid": GRID,
    "a.tsv": "".join(f"{w['start']}\t{w['end']}\t{w['word']}\n" for w in WORDS_WITH_TIMES),
    "a.srt": SUBTITLES,
    "a.vtt": "WEBVTT\n\n" + SUBTITLES.replace(",", "."),
    "a.json": json.dumps({"words": WORDS_WITH_TIMES}),
    "a.txt": "Hello, big world!",
}


@pytest.fixture(scope="module")
def recording(tmp_path_factory) -> Path:
    """Six seconds of a buzz, with three syllables of it."""
    t = np.arange(6 * RATE) / RATE
    loud = sum(((a <= t) & (t < b)).astype(float) for a, b in ((0.5, 1.0), (1.1, 3.0), (3.2, 5.5)))
    path = tmp_path_factory.mktemp("recording") / "talk.wav"
    soundfile.write(path, 0.3 * loud * sum(np.sin(2 * np.pi * 130 * k * t) / k for k in range(1, 6)), RATE)
    return path


def spoken(words: tuple[Word, ...] | None) -> list[str]:
    return [word.text.lower() for word in words or ()]


class StreamingFeatures:
    """A session that stores its input and plays what another session plays."""

    def __init__(self, inner, chunks: list[Speech]) -> None:
        self._inner, self._chunks = inner, chunks

    def __getattr__(self, name: str):
        return getattr(self._inner, name)

    def push_takes(self, chunk: Speech):
        self._chunks.append(chunk)
        return self._inner.push_takes(chunk)


class Listening:
    """A gesturer whose sessions are `StreamingFeatures`."""

    def __init__(self, inner) -> None:
        self._inner, self.chunks = inner, []

    def __getattr__(self, name: str):
        return getattr(self._inner, name)

    def session(self, options):
        return StreamingFeatures(self._inner.session(options), self.chunks)


@pytest.mark.slow
@pytest.mark.parametrize("name", KINDS)
def test_words_of_a_file_reach_the_system(tmp_path, monkeypatch, recording, name):
    (tmp_path / name).write_text(KINDS[name], "utf-8")
    listening = Listening(load("rules"))
    monkeypatch.setattr(generate, "load_model", lambda *_, **__: listening)
    cospeech.generate.generate_files(recording, [tmp_path / "out.bvh"], transcript=tmp_path / name, parts=("body",))
    words = [word for chunk in listening.chunks for word in chunk.words or ()]
    assert spoken(tuple(words)) == ["hello", "big", "world"]
    whole = Speech.load(recording, transcript=tmp_path / name)
    assert spoken(whole.words) == ["hello", "big", "world"]
    for word, word_of_file in zip(words, whole.words or (), strict=True):
        assert (word.start, word.end) == pytest.approx((word_of_file.start, word_of_file.end), abs=0.02)
    if name != "a.txt":
        assert [(w.start, w.end) for w in words] == [(w["start"], w["end"]) for w in WORDS_WITH_TIMES]
    for chunk in listening.chunks:
        end = np.inf if chunk is listening.chunks[-1] else chunk.start + chunk.seconds
        assert all(chunk.start <= word.start < end for word in chunk.words or ())


@pytest.mark.slow
@pytest.mark.parametrize("name", KINDS)
def test_frames_have_the_same_words_of_a_file_and_of_a_stream(tmp_path, recording, name):
    (tmp_path / name).write_text(KINDS[name], "utf-8")
    with open_speech(recording, transcript=tmp_path / name) as source:
        expected_words = source.words
        stream, words = WordStream(15), []
        for chunk in speech_chunks(source):
            words += stream.push(chunk)
        words += stream.finish()
    assert words == word_ids(expected_words, 90, 15)
    assert [word.lower() for word in dict.fromkeys(words) if word] == ["hello", "big", "world"]
    whole = Speech.load(recording, transcript=tmp_path / name)
    for seconds in (0.04, 0.3, 10):
        stream, live = WordStream(15), []
        for chunk in whole.chunks(seconds):
            live += stream.push(chunk)
        live += stream.finish()
        assert live == word_ids(whole.words, 90, 15)


@pytest.mark.slow
def test_sessions_take_words_with_the_piece_in_which_they_start(recording, tmp_path):
    (tmp_path / "a.tsv").write_text(KINDS["a.tsv"], "utf-8")
    whole = Speech.load(recording, transcript=tmp_path / "a.tsv")
    with_words, without_words = [], []
    for speech, out in ((whole, with_words), (Speech(whole.samples, whole.rate), without_words)):
        session = load("rules").session(seed=3, fps=15)
        for chunk in speech.chunks(0.2):
            out += [motion.face for motion in session.push(chunk)]
        out += [motion.face for motion in session.finish()]
    assert np.concatenate(with_words).shape == np.concatenate(without_words).shape == (90, 52)
    assert np.abs(np.concatenate(with_words) - np.concatenate(without_words)).max() > 0.05, "lips follow the words"
