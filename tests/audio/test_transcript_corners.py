"""Transcripts with something in an unexpected place: each is read as its author meant it."""

from __future__ import annotations

import json

import numpy as np
import pytest

from cospeech import Speech
from cospeech.audio.spoken_text import list_tokens
from cospeech.audio.transcripts import load_words
from cospeech.audio.word import LAUGHTER
from cospeech.errors import CospeechWarning
from tests.audio.test_transcript_formats import rows, textgrid, texts, write

TTML = '<tt xmlns="http://www.w3.org/ns/ttml"><body><div>{}</div></body></tt>'


@pytest.mark.parametrize(
    "text",
    ["It is *breathtaking*, really", "He was *sober*", "*sobre* la mesa", "It's *musical*", "I *applaud* you",
     "Take (the latter)"],
)  # fmt: skip
def test_words_that_begin_as_sounds_do_are_said(text):
    assert LAUGHTER not in list_tokens(text)
    assert [token.strip("*,") for token in list_tokens(text.partition(" (")[0])] == [
        word.strip("*,") for word in text.partition(" (")[0].split()
    ]


@pytest.mark.parametrize(
    "sound", ["*sighs*", "*she coughs*", "*clears his throat*", "*sighs deeply*", "*applause*", "*hustet*"]
)
def test_sounds_between_asterisks_are_not_said(sound):
    assert list_tokens(f"Yes {sound} no") == ["Yes", "no"]


def test_a_clause_in_round_brackets_of_a_plain_text_is_read():
    assert [token.strip("()") for token in list_tokens("He (who laughs last) wins", prose=True)] == [
        "He",
        "who",
        "laughs",
        "last",
        "wins",
    ]


def test_a_word_alone_in_a_plain_text_lies_where_the_voice_is(tmp_path):
    rate, draw = 16_000, np.random.default_rng(1)
    samples = np.zeros(6 * rate, np.float32)
    time = np.arange(rate) / rate
    samples[3 * rate : 4 * rate] = 0.3 * np.sin(2 * np.pi * 150 * time) * (1 + 0.5 * np.sin(2 * np.pi * 4 * time))
    speech = Speech(samples + draw.normal(0, 1e-4, len(samples)).astype(np.float32), rate)
    (word,) = load_words(write(tmp_path, "Hello", "a.txt"), speech=speech)
    assert 2.7 < word.start < 3.3
    assert 3.6 < word.end < 4.4
    words = load_words(write(tmp_path, "Hello [laughs]", "b.txt"), speech=speech)
    assert texts(words) == ["Hello", LAUGHTER]
    assert words[1].end > words[1].start + 0.3


def test_a_laugh_behind_words_that_fill_their_cue_has_room(tmp_path):
    words = load_words(write(tmp_path, "2.0\t4.0\tYes [laughs]\n5.0\t8.0\t[laughs] oh no\n", "a.tsv"), speech_seconds=9.0)
    assert texts(words) == ["Yes", LAUGHTER, LAUGHTER, "oh", "no"]
    assert all(word.end - word.start > 0.5 for word in words if word.text == LAUGHTER)
    assert words[1].end <= 4.0 + 1e-9
    assert words[2].start == 5.0


@pytest.mark.parametrize(
    ("paragraph", "start"),
    [
        ('<p begin="1s" end="5s"><span begin="1s" end="1.5s">a</span> <span begin="1.5s" end="2s">b</span></p>', 1.0),
        ('<p begin="10s"><span begin="0s" end="1s">a</span> <span begin="1s" end="2s">b</span></p>', 10.0),
        ('<p begin="10s" end="12s"><span begin="0s" end="1s">a</span> <span begin="1s" end="2s">b</span></p>', 10.0),
    ],
)
def test_times_of_spans_count_from_their_paragraph_or_from_the_clock(tmp_path, paragraph, start):
    words = load_words(write(tmp_path, TTML.format(paragraph), "a.ttml"), speech_seconds=20.0)
    assert texts(words) == ["a", "b"]
    assert words[0].start == start


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ("0.0,0.5,Hello, world\n", ["Hello", "world"]),
        ("0.0,0.5,Hello,0.93\n", ["Hello"]),
        ('0.0,0.5,"Hello; there"\n0.5,0.9,you\n', ["Hello", "there", "you"]),
        ("start,end,speaker,text\n0.0,0.5,Bob,Hello, world\n", ["Hello", "world"]),
    ],
)
def test_commas_and_semicolons_of_a_text(tmp_path, table, words):
    assert [text.strip(",;") for text in texts(load_words(write(tmp_path, table, "a.csv")))] == words


def google(*results: list[dict]) -> str:
    return json.dumps({"results": [{"alternatives": [{"transcript": "x", "words": words}]} for words in results]})


def test_speakers_of_google_are_not_heard_twice(tmp_path):
    word = {"word": "hi", "startTime": "0.1s", "endTime": "0.5s"}
    path = write(tmp_path, google([word], [word | {"speakerTag": 1}]), "a.json")
    assert rows(load_words(path)) == [("hi", 0.1, 0.5)]
    first = [{"word": "hi", "end_offset": "0.5s"}, {"word": "you", "start_offset": "0.5s", "end_offset": "0.9s"}]
    assert texts(load_words(write(tmp_path, google(first), "b.json"))) == ["hi", "you"]


def test_a_token_of_whisper_that_ends_before_it_starts_lasts_no_time(tmp_path):
    tokens = [
        {"text": text, "offsets": {"from": start, "to": end}} for text, start, end in ((" a", 500, 400), (" b", 600, 900))
    ]
    document = {"transcription": [{"text": " a b", "offsets": {"from": 500, "to": 900}, "tokens": tokens}]}
    assert texts(load_words(write(tmp_path, json.dumps(document), "a.json"))) == ["a", "b"]


@pytest.mark.parametrize("other", ["Wortart", "word_stress", "word accent"])
def test_a_tier_about_words_is_not_that_of_words(tmp_path, other):
    words = [("hello", 0.0, 0.5), ("world", 0.5, 1.0)]
    about = [("NN", 0.0, 0.3), ("NN", 0.3, 0.6), ("VB", 0.6, 1.0)]
    assert rows(load_words(write(tmp_path, textgrid((other, about), ("words", words)), "a.TextGrid"))) == words


def test_a_translation_of_lyrics_is_told_and_left_out(tmp_path):
    path = write(tmp_path, "[00:01.00]bonjour\n[00:01.00]good morning\n[00:03.00]merci\n", "a.lrc")
    with pytest.warns(CospeechWarning, match="1 line left out: another one has the same time, as of a translation"):
        assert texts(load_words(path, speech_seconds=9.0)) == ["bonjour", "merci"]


def test_a_first_line_of_json_has_no_more_values_than_a_document(tmp_path):
    from cospeech.errors import InputError
    from cospeech.limits import TRANSCRIPT_JSON_VALUES

    text = "[" + "1," * (TRANSCRIPT_JSON_VALUES + 10) + "1]\n1"
    with pytest.raises(InputError):
        load_words(write(tmp_path, text, "a.json"))
