"""Transcripts of other programs, services and languages: each format read right, and notes of what is guessed or left out."""

from __future__ import annotations

import json
import unicodedata
import warnings
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from cospeech import InputError, Speech, Word
from cospeech.audio.forced_alignment import SoundAligner, spread
from cospeech.audio.languages import with_language
from cospeech.audio.recognisers import SHAPES
from cospeech.audio.speaker_labels import drop_labels
from cospeech.audio.speech import example, open_speech
from cospeech.audio.spoken_text import list_tokens
from cospeech.audio.transcript_formats import FORMATS, SUFFIXES
from cospeech.audio.transcripts import TranscriptFile, load_words, settle
from cospeech.audio.word import LAUGHTER, is_spoken
from cospeech.cli.several import put_name
from cospeech.errors import CospeechWarning

Rows = list[tuple[str, float, float]]


def write(folder: Path, content: str | bytes, name: str) -> Path:
    path = folder / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


def rows(words: tuple[Word, ...]) -> Rows:
    return [(word.text, round(word.start, 3), round(word.end, 3)) for word in words]


def texts(words: tuple[Word, ...]) -> list[str]:
    return [word.text for word in words]


@pytest.fixture(scope="module")
def noise() -> Speech:
    """Ten seconds without a pause."""
    return Speech(np.random.default_rng(0).standard_normal(160_000).astype(np.float32) * 0.1)


# ---- what is heard and not said ----


@pytest.mark.parametrize(
    "laugh",
    ["[laughter]", "[laughs]", "(laughs)", "(she is laughing)", "*laughs*", "（笑）", "【笑い】", "［爆笑］",
     "(Lachen)", "[rires]", "(risas)", "[смех]", "(웃음)", "[हँसी]", "(haha)"],
)  # fmt: skip
def test_a_laugh_is_a_word_of_its_own(laugh):
    assert list_tokens(f"Hello {laugh}. World") == ["Hello.", LAUGHTER, "World"]
    assert list_tokens(laugh) == [LAUGHTER]


@pytest.mark.parametrize(
    ("text", "tokens"),
    [
        ("(sighs) 【拍手】 ［音楽］ *coughs* {\\an8} <i>huge</i> ♪ la ♪", ["huge", "la"]),
        ("[audience laughter] (applause)", []),
        ("（微笑）", []),
        ("it is *really* big", ["it", "is", "*really*", "big"]),
        ("a < b and c > d", ["a<", "b", "and", "c>", "d"]),
        ("we laughed, and he laughs", ["we", "laughed,", "and", "he", "laughs"]),
        ("[laughter] [laughs] so [laughter]", [LAUGHTER, "so", LAUGHTER]),
    ],
)
def test_what_is_said_of_a_text(text, tokens):
    assert list_tokens(text) == tokens


def test_a_long_aside_of_a_plain_text_is_read_aloud():
    text = "We came (my brother and I) home (sighs)"
    assert list_tokens(text) == ["We", "came", "home"]
    assert list_tokens(text, prose=True) == ["We", "came", "(my", "brother", "and", "I)", "home"]


def test_laughs_have_the_time_of_their_cue_or_of_the_pause(tmp_path):
    cues = "1\n00:00:01,000 --> 00:00:02,500\n[laughter]\n\n2\n00:00:03,000 --> 00:00:04,000\nso [laughs] well\n"
    words = load_words(write(tmp_path, cues, "a.srt"))
    assert rows(words)[0] == (LAUGHTER, 1.0, 2.5)
    assert texts(words)[1:] == ["so", LAUGHTER, "well"]
    assert words[1].end == words[2].start < words[2].end == words[3].start


@pytest.mark.slow
def test_a_laugh_of_a_plain_text_stands_in_the_pause():
    audio, words = example()
    speech, timed_words = Speech.load(audio), Speech.load(audio, transcript=words).words
    tokens = audio.with_suffix(".txt").read_text().split()
    gaps = [after.start - before.end for before, after in pairwise(timed_words)]
    longest = int(np.argmax(gaps)) + 1
    with_laugh = [*tokens[:longest], "[laughter]", *tokens[longest:]]
    aligner = SoundAligner(speech)
    laugh = next(
        w for w in settle([(" ".join(with_laugh), 0.0, aligner.seconds)], aligner.seconds, speech=speech) if w.text == LAUGHTER
    )
    assert timed_words[longest - 1].end - 0.1 < laugh.start < laugh.end < timed_words[longest].start + 0.1
    assert laugh.end - laugh.start > 0.1


def test_a_laugh_makes_the_face_laugh_and_is_not_spoken(tmp_path):
    from cospeech.audio.features.words import word_ids
    from cospeech.face.laughter import laughter
    from cospeech.face.visemes import phones_of
    from cospeech.rules.lexicon import form_for

    words = load_words(write(tmp_path, "1\n00:00:01,000 --> 00:00:02,000\n（笑）\n", "a.srt"), speech_seconds=3.0)
    assert [is_spoken(word.text) for word in words] == [False]
    assert laughter(np.array([0.5, 1.5]), words).tolist() == [0.0, 1.0]
    assert len(phones_of(words, 0.0, 3.0).centre) == 0
    assert word_ids(words, 3, 1.0) == [None] * 3
    assert form_for(words[0].text) is None


def test_a_text_of_laughs_alone_has_no_words(tmp_path, noise):
    with pytest.raises(InputError, match="no words in"):
        load_words(write(tmp_path, "[laughter]\n", "a.txt"), speech=noise)


# ---- TextGrid ----


def textgrid(*tiers: tuple[str, Rows]) -> str:
    lines = ['File type = "ooTextFile"', 'Object class = "TextGrid"', "0 9 <exists>", str(len(tiers))]
    for name, entries in tiers:
        lines += ['"IntervalTier"', f'"{name}"', "0", "9", str(len(entries))]
        lines += [f'{start} {end} "{text}"' for text, start, end in entries]
    return "\n".join(lines)


GUTEN = [("Guten", 0.0, 0.4), ("Abend", 0.4, 0.9), ("", 0.9, 9.0)]
SOUNDS = [(text, k / 10, k / 10 + 0.1) for k, text in enumerate(["g", "u:", "t", "@", "n", "a:", "b", "@", "n", "t"])]


@pytest.mark.parametrize(
    ("words", "sounds"),
    [("ORT-MAU", "MAU"), ("Wörter", "Laute"), ("orthographe", "API"), ("語", "音"), ("単語", "音素"), ("mots", "sons"),
     ("TokensAlign", "PhonAlign"), ("Anna - words", "Anna - phones")],
)  # fmt: skip
def test_the_tier_of_words_is_known_by_its_name(tmp_path, words, sounds):
    content = textgrid((sounds, SOUNDS), (words, GUTEN), ("KAN-MAU", [("gu:t@n", 0.0, 0.4), ("a:b@nt", 0.4, 0.9)]))
    assert rows(load_words(write(tmp_path, content, "a.TextGrid"))) == GUTEN[:2]


@pytest.mark.parametrize("names", [("utterance", "sounds"), ("Anna", "Anna 2"), ("x", "y")])
def test_a_tier_of_longer_labels_is_taken_and_named(tmp_path, names):
    path = write(tmp_path, textgrid((names[1], SOUNDS), (names[0], GUTEN)), "a.TextGrid")
    with pytest.warns(CospeechWarning, match=f"'a.TextGrid': the words are those of the tier '{names[0]}', of '{names[1]}', "):
        assert rows(load_words(path)) == GUTEN[:2]


def test_of_two_speakers_the_tier_is_named(tmp_path):
    content = textgrid(
        ("Anna - words", GUTEN), ("Bob - words", [(word, k, k + 1.0) for k, word in enumerate(("Ja", "so", "ist"))])
    )
    with pytest.warns(CospeechWarning, match="tier 'Bob - words'"):
        assert texts(load_words(write(tmp_path, content, "a.TextGrid"))) == ["Ja", "so", "ist"]


def test_the_tier_that_the_user_names_counts(tmp_path):
    bob = [("Ja", 1.0, 2.0), ("so", 2.0, 3.0)]
    content = textgrid(("Anna - words", GUTEN), ("Bob - words", bob), ("phones", SOUNDS), ("x", GUTEN), ("X", []), ("x ", bob))
    path = write(tmp_path, content, "a.TextGrid")
    for tier in ("Bob - words", " bob - WORDS"):  # without a note
        assert rows(load_words(TranscriptFile(path, tier=tier))) == bob
    assert rows(load_words(TranscriptFile(path, -1.0, "Bob - words"))) == [("Ja", 0.0, 1.0), ("so", 1.0, 2.0)]
    names = "Anna - words, Bob - words, phones, x"
    for tier, message in (
        ("Bob-words", f"'a.TextGrid': no tier is called 'Bob-words' (did you mean 'Bob - words'? known: {names}, x)"),
        ("x", f"'a.TextGrid': 2 tiers are called 'x' (rename one; the tiers are {names}, x)"),
        ("X", f"'a.TextGrid': the tier 'X' has no words (those with labels: {names}, x)"),
    ):
        with pytest.raises(InputError) as error:
            load_words(TranscriptFile(path, tier=tier))
        assert str(error.value) == message


@pytest.mark.parametrize(("name", "content"), [("a.srt", "1\n00:00:01,000 --> 00:00:02,000\nHi\n"), ("a.txt", "Hi")])
def test_a_tier_of_a_file_without_tiers_is_told(tmp_path, name, content, noise):
    with pytest.raises(InputError, match=f"a tier of '{name}', which has none"):
        load_words(TranscriptFile(write(tmp_path, content, name), tier="words"), speech=noise)


# ---- ELAN ----


def eaf(*tiers: str, slots: dict[str, int | None] | None = None) -> str:
    times = slots or {"ts1": 0, "ts2": 400, "ts3": 900, "ts4": 1500}
    order = "".join(
        f'<TIME_SLOT TIME_SLOT_ID="{key}"' + (f' TIME_VALUE="{time}"/>' if time is not None else "/>")
        for key, time in times.items()
    )
    head = '<?xml version="1.0" encoding="UTF-8"?>\n<ANNOTATION_DOCUMENT FORMAT="3.0"><HEADER TIME_UNITS="milliseconds"/>'
    return f"{head}<TIME_ORDER>{order}</TIME_ORDER>{''.join(tiers)}</ANNOTATION_DOCUMENT>"


def tier(name: str, *annotations: tuple[str, ...]) -> str:
    """A tier of annotations: (id, first slot, last slot, text), or (id, parent, text)."""
    body = ""
    for key, *places, text in annotations:
        kind, keys = ("ALIGNABLE", ("TIME_SLOT_REF1", "TIME_SLOT_REF2")) if len(places) == 2 else ("REF", ("ANNOTATION_REF",))
        where = " ".join(f'{name}="{place}"' for name, place in zip(keys, places, strict=True))
        body += f'<ANNOTATION><{kind}_ANNOTATION ANNOTATION_ID="{key}" {where}><ANNOTATION_VALUE>{text}</ANNOTATION_VALUE>'
        body += f"</{kind}_ANNOTATION></ANNOTATION>"
    return f'<TIER LINGUISTIC_TYPE_REF="t" TIER_ID="{name}">{body}</TIER>'


WORD_TIER = tier("words", ("a1", "ts1", "ts2", "Guten"), ("a2", "ts2", "ts3", "Abend &amp;"), ("a3", "ts3", "ts4", ""))


@pytest.mark.parametrize("name", ["a.eaf", "no_suffix"])
def test_elan(tmp_path, name):
    gestures = tier("gesture phase", *((f"g{k}", "ts1", "ts4", "stroke") for k in range(9)))
    path = write(tmp_path, eaf(gestures, WORD_TIER), name)
    assert rows(load_words(path)) == GUTEN[:2]
    with pytest.raises(InputError, match=r"no tier is called 'word' \(did you mean 'words'\? known: gesture phase, words\)"):
        load_words(TranscriptFile(path, tier="word"))


def test_a_slot_of_elan_without_a_time_lies_between_its_neighbours(tmp_path):
    slots = {"s1": 1000, "s2": None, "s3": None, "s4": 4000, "s5": None}
    words = tier(
        "words", ("a", "s1", "s2", "one"), ("b", "s2", "s3", "two"), ("c", "s3", "s4", "three"), ("d", "s4", "s5", "lost")
    )
    path = write(tmp_path, eaf(words, slots=slots), "a.eaf")
    assert rows(load_words(path)) == [("one", 1.0, 2.0), ("two", 2.0, 3.0), ("three", 3.0, 4.0)]


def test_annotations_of_elan_have_the_time_of_their_parents(tmp_path):
    above = tier("Anna", ("u1", "ts1", "ts3", "g a"), ("u2", "ts3", "ts4", "b"))
    words = tier("Anna words", ("w1", "u1", "Guten"), ("w2", "u1", "Abend"), ("w3", "u2", "Bob"), ("w4", "gone", "lost"))
    path = write(tmp_path, eaf(above, words, tier("pos", ("p1", "w3", "NOUN"))), "a.eaf")
    assert rows(load_words(path)) == [("Guten", 0.0, 0.45), ("Abend", 0.45, 0.9), ("Bob", 0.9, 1.5)]
    assert rows(load_words(TranscriptFile(path, tier="pos"))) == [("NOUN", 0.9, 1.5)]


def test_a_tier_of_speech_is_taken_before_one_with_more_labels(tmp_path):
    moves = tier("left arm", *((f"g{k}", "ts1", "ts4", "preparation") for k in range(9)))
    path = write(tmp_path, eaf(moves, tier("Speech", ("a1", "ts1", "ts2", "Hello"))), "a.eaf")
    with pytest.warns(CospeechWarning, match="tier 'Speech', of 'left arm', 'Speech'; --transcript-tier NAME takes another"):
        assert texts(load_words(path)) == ["Hello"]


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (eaf(WORD_TIER)[:-30], "no XML"),
        (eaf(WORD_TIER, slots={"ts1": None}), "no annotation has times"),
        (eaf(), "no annotation has times"),
        (eaf(WORD_TIER).replace('"400"', '"0.4"'), "'0.4' is not a time"),
        (eaf(WORD_TIER).replace('"400"', '"-4"'), "'-4' is not a time"),
        (eaf(WORD_TIER).replace('"400"', '"1000"'), "ends before it starts"),
        (eaf(WORD_TIER).replace("<ANN", '<!DOCTYPE x [<!ENTITY a "b">]><ANN', 1), "document type"),
    ],
)
def test_elan_that_is_wrong_is_told(tmp_path, content, message):
    with pytest.raises(InputError, match=rf"'a\.eaf': .*{message}"):
        load_words(write(tmp_path, content, "a.eaf"))


# ---- subtitles ----

YOUTUBE = """WEBVTT
Kind: captions
Language: en

00:00:00.000 --> 00:00:02.000 align:start position:0%
 
good<00:00:00.400><c> evening</c><00:00:00.900><c> my</c><00:00:01.300><c> brother</c>

00:00:02.000 --> 00:00:02.010 align:start position:0%
good evening my brother
 

00:00:02.010 --> 00:00:04.000 align:start position:0%
good evening my brother
bob<00:00:02.400><c> may</c><00:00:02.900><c> bring</c><00:00:03.300><c> pies</c>

00:00:04.000 --> 00:00:04.010 align:start position:0%
bob may bring pies
 
"""  # as YouTube writes it
TTML = '<?xml version="1.0" encoding="UTF-8"?>\n<tt xmlns="http://www.w3.org/ns/ttml" {}><body>{}</body></tt>'


def test_captions_of_youtube_are_said_once_and_have_times_of_words(tmp_path):
    assert rows(load_words(write(tmp_path, YOUTUBE, "a.vtt"))) == [
        ("good", 0.0, 0.4), ("evening", 0.4, 0.9), ("my", 0.9, 1.3), ("brother", 1.3, 2.0),
        ("bob", 2.01, 2.4), ("may", 2.4, 2.9), ("bring", 2.9, 3.3), ("pies", 3.3, 4.0),
    ]  # fmt: skip


def test_lines_that_roll_are_said_once_and_an_answer_twice(tmp_path):
    def cues(*lines: str) -> str:
        return "".join(f"{k}\n00:00:0{k},000 --> 00:00:0{k + 1},000\n{text}\n\n" for k, text in enumerate(lines, 1))

    rolling = load_words(write(tmp_path, cues("one two", "one two\nthree", "three\nfour", "four\nfive"), "a.srt"))
    assert texts(rolling) == ["one", "two", "three", "four", "five"]
    assert texts(load_words(write(tmp_path, cues("No.", "No.", "Yes.", "Yes. Go"), "b.srt"))) == [
        "No",
        "No",
        "Yes",
        "Yes",
        "Go",
    ]


LINES = ["so today we go", "to see the tree", "behind the house", "which is big", "and very old", "and green"]


def captions(*cues: tuple[float, float, str]) -> str:
    """A .vtt of (start, end, text)."""
    return "WEBVTT\n\n" + "\n".join(f"00:{start:06.3f} --> 00:{end:06.3f}\n{text}\n" for start, end, text in cues)


def rolling(gap: float, between: str = "\n") -> str:
    """Cues of 2 s that show a line and the one before it, and end ``gap`` s before the next."""
    texts = [LINES[0], *(f"{above}{between}{line}" for above, line in pairwise(LINES))]
    return captions(*((2.0 * k, 2.0 * k + 2 - gap, text) for k, text in enumerate(texts)))


@pytest.mark.parametrize(
    "content",
    [
        rolling(0.4),
        rolling(-2.0),
        rolling(0.0, " "),
        rolling(0.3, " "),
        captions(*((2.0 * k, 2.0 * k + 4, line) for k, line in enumerate(LINES))),
        captions(*((2.0 * k, 2.0 * k + 2, line) for k, line in enumerate(LINES))),
    ],
    ids=["gap", "overlap", "one line", "one line, gap", "overlap, shown once", "plain"],
)
def test_captions_that_roll_say_each_word_once_and_in_its_time(tmp_path, content, noise):
    with warnings.catch_warnings():
        warnings.simplefilter("error", CospeechWarning)
        words = load_words(write(tmp_path, content, "a.vtt"), speech=Speech(np.tile(noise.samples, 2)))
    assert texts(words) == " ".join(LINES).split()
    for k, line in enumerate(LINES):
        own, words = words[: len(line.split())], words[len(line.split()) :]
        assert 2 * k - 1e-6 <= own[0].start < own[-1].end <= 2 * k + (2 if words else 4) + 1e-6


def test_a_line_that_grows_word_by_word_is_said_once(tmp_path):
    spoken_words = " ".join(LINES[:3]).split()
    cues = [" ".join(spoken_words[max(0, k - 5) : k + 1]) for k in range(len(spoken_words))]
    cues = [text.replace("see", "<i>see</i>\n") for text in cues]
    words = load_words(write(tmp_path, captions(*((k / 2, k / 2 + 0.5, text) for k, text in enumerate(cues))), "a.vtt"))
    assert rows(words) == [(word, k / 2, k / 2 + 0.5) for k, word in enumerate(spoken_words)]


def test_what_people_say_twice_is_said_twice(tmp_path):
    answers = ["No", "No no", "no way", "Really", "Really I am", "sure", "Yes", "Yes"]
    content = captions(*((k, k + 1.0, text) for k, text in enumerate(answers)))
    assert texts(load_words(write(tmp_path, content, "a.vtt"))) == " ".join(answers).split()
    later = captions(*((5.0 * k, 5.0 * k + 2, text) for k, text in enumerate(("a b", "a b\nc d", "c d\ne f", "e f\na b"))))
    assert " ".join(texts(load_words(write(tmp_path, later, "b.vtt")))) == "a b a b c d c d e f e f a b"


def test_two_languages_at_the_same_times_are_no_rolling_captions(tmp_path, noise):
    both = [(2.0 * k, 2.0 * k + 2, line) for k in range(5) for line in ("one two", "eins zwei")]
    with pytest.warns(CospeechWarning, match="5 of 10 entries begin before the one before ends"):
        load_words(write(tmp_path, captions(*both), "a.vtt"), speech=noise)


def test_subtitles_whose_times_cannot_be_read_are_told_of(tmp_path):
    subtitles = "1\n00:00:01,000 --> 00:00:02,000\none\n\n2\n00:00:02:12 --> 00:00:03:12\nlost\n\n3\n0:0:4,0 → 0:0:5\ntwo\n"
    with pytest.warns(
        CospeechWarning, match="'a.srt': 1 subtitle of 3 left out, .* cannot be read: '00:00:02:12 --> 00:00:03:12'"
    ):
        words = load_words(write(tmp_path, subtitles, "a.srt"))
    assert rows(words) == [("one", 1.0, 2.0), ("two", 4.0, 5.0)]
    with pytest.raises(InputError, match="counts frames"):
        load_words(write(tmp_path, subtitles[30:].partition("3\n0:0:4")[0], "a.srt"))


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("a.sbv", "0:00:00.500,0:00:02.000\nGood\n\n0:00:02.000,0:00:04.000\n>> ANN: brother[br]\n"),
        ("a.csv", "start,end,speaker,text\n0.5,2.0,Bob,Good\n2.0,4.0,Ann,brother\n"),
        ("b.csv", "Speaker;Text;Beginn;Dauer\nBob;Good;0,5;1,5\nAnn;brother;2,0;2,0\n"),
        ("c.csv", "word,start,end\nGood,0.5,2\nbrother,2.0,4.0\n"),
        ("d.csv", "start,end,text\n00:00:00.500,00:00:02.000,Good\n00:00:02.000,00:00:04.000,brother\n"),
        ("a.tsv", "id\tstart_ms\tend_ms\ttoken\n1\t500\t2000\tGood\n2\t2000\t4000\tbrother\n"),
        ("e.txt", "text,from,to\nGood,0.5,2.0\nbrother,2.0,4.0\n"),
    ],
)  # fmt: skip
def test_the_same_words_from_every_new_format(tmp_path, name, content):
    assert rows(load_words(write(tmp_path, content, name), speech_seconds=4.0)) == [("Good", 0.5, 2.0), ("brother", 2.0, 4.0)]


GOOD, BROTHER = '<span begin="0.5s" end="2s">Good</span>', '<span begin="2s" end="4s">brother</span>'


@pytest.mark.parametrize(
    ("name", "rates", "body"),
    [
        ("a.ttml", "", '<div><p begin="0.5s" end="00:00:02.000">Good</p>\n<p begin="2000ms" dur="2s">brother<br/></p></div>'),
        ("a.dfxp", 'frameRate="10"', '<p begin="00:00:00:05" end="00:00:02">Good</p><p begin="20f" end="40f">brother</p>'),
        ("a.xml", "", '<div begin="0.5s"><p begin="0s" end="1.5s">Good</p><p begin="1.5s" end="3.5s"> brother\n</p></div>'),
        ("a.ttml", "", f'<p begin="0.5s" end="4s">{GOOD} {BROTHER}</p>'),  # from the beginning, as lyrics have them
        ("a.ttml", "", f'<p begin="0.5s" end="4s">{GOOD} {BROTHER}</p>'.replace('"0.5s" end="2s"', '"0s" end="1.5s"')
         .replace('"2s" end="4s"', '"1.5s" end="3.5s"')),  # from that of the paragraph, as the standard says
    ],
)  # fmt: skip
def test_ttml(tmp_path, name, rates, body):
    words = load_words(write(tmp_path, TTML.format(rates, body), name))
    assert rows(words) == [("Good", 0.5, 2.0), ("brother", 2.0, 4.0)]


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("a.lrc", "[ti:Song]\n[00:00.50]Good\n[00:01.00]brother\n[00:02.50]\n"),
        ("a.txt", "[ar: X]\n[00:00.50]<00:00.50>Good <00:01.00>brother<00:02.50>\n"),
        ("b.lrc", "[offset:500]\n[00:01:00]Good\n[00:01.50]brother\n[00:03.00]\n"),
    ],
)
def test_lyrics(tmp_path, name, content):
    assert rows(load_words(write(tmp_path, content, name))) == [("Good", 0.5, 1.0), ("brother", 1.0, 2.5)]


def test_lyrics_that_are_sung_again_and_the_last_line(tmp_path):
    words = load_words(write(tmp_path, "[00:01.00][00:03.00]<00:01.00>la <00:01.50>lo\n[00:02.00]na\n", "a.lrc"))
    assert rows(words) == [("la", 1.0, 1.5), ("lo", 1.5, 2.0), ("na", 2.0, 3.0), ("la", 3.0, 4.0), ("lo", 4.0, 5.0)]


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.sub", "{0}{25}Good evening\n{50}{75}My brother|Bob\n", "MicroDVD, which count frames .*ffmpeg -i a.sub a.srt"),
        ("b.ass", "; by Aegisub\n[Script Info]\nDialogue: 0,0:00:00.50,0:00:02.00,,,0,0,0,,Hi\n", "SubStation Alpha"),
        ("a.smi", "<SAMI><BODY><SYNC Start=1>Hi</SAMI>", "SAMI"),
        ("a.html", "<!DOCTYPE html><html><p>Hi", "a page of HTML"),
        ("a.rtf", "{\\rtf1 Hi}", "rich text"),
        ("a.xml", "<?xml version='1.0'?><words><w>Hi</w></words>", "holds XML"),
        ("a.txt", "0:00\nhello there\n0:04\nmy friend\n", "its lines have time codes: '0:00'"),
        ("b.txt", "[00:01:02] Anna: Hello\n[00:01:04] Bob: Hi\n", "time codes"),
        ("a.csv", "a,b,c,d\n0,1,x,hello\n", "a table with the columns a, b, c, d"),
        ("a.ttml", '<!DOCTYPE tt [<!ENTITY a "b">]><tt/>', "a document type"),
        ("b.ttml", TTML.format("", "<p>Hi</p>"), "no paragraph has times"),
        ("c.ttml", TTML.format("", '<p begin="soon" end="1s">Hi</p>'), "'soon' is not a time"),
        ("d.ttml", TTML.format("", "<div>" * 300), "nested too deeply"),
        ("e.ttml", TTML.format("", "<div>"), "no XML"),
        ("f.ttml", TTML.format('ttp:frameRate="0"', ""), "its rates"),
        ("a.lrc", "Hello\nworld\n", "no line of the lyrics has a time"),
        ("a.sbv", "Hello\n", "no subtitle has a time"),
        ("e.srt", "1\n00:00:00,000 --> 00:00:01,500\nGröße".encode("cp1252"), r"iconv -f CP1252 -t UTF-8 e.srt > utf8.srt"),
    ],
)  # fmt: skip
def test_what_is_not_read_is_told_with_a_way_out(tmp_path, name, content, message):
    with pytest.raises(InputError, match=message) as refusal:
        load_words(write(tmp_path, content, name), speech_seconds=9.0)
    assert "\n" not in str(refusal.value)
    assert len(str(refusal.value)) < 300


def test_a_clock_in_a_text_is_read_aloud(tmp_path, noise):
    words = load_words(write(tmp_path, "10:30 is when we meet\nand at noon we eat\nand so on\n", "a.txt"), speech=noise)
    assert texts(words)[:3] == ["10:30", "is", "when"]


def test_lines_and_paragraphs_without_times_are_told_of(tmp_path):
    with pytest.warns(CospeechWarning, match="1 of 2 lines left out, they have no time: 'lost'"):
        load_words(write(tmp_path, "[00:01.00]one\nlost\n", "a.lrc"))
    with pytest.warns(CospeechWarning, match="1 of 2 paragraphs left out"):
        load_words(write(tmp_path, TTML.format("", '<p>lost</p><p begin="0s" end="1s">one</p>'), "a.ttml"))


def test_signs_of_other_programs_are_not_said(tmp_path):
    content = "1\n00:00:01,000 --> 00:00:02,000\n{\\an8}Hallo\\NWelt\n"
    assert texts(load_words(write(tmp_path, content, "a.srt"))) == ["Hallo", "Welt"]


def test_every_suffix_has_one_format():
    assert len(set(SUFFIXES)) == len(SUFFIXES) == sum(len(each.suffixes) for each in FORMATS.values()) + 1
    page = (Path(__file__).parents[2] / "web" / "index.html").read_text("utf-8")
    assert all(f"{suffix}" in page for suffix in SUFFIXES)


# ---- times that cannot belong ----


def test_words_before_the_beginning_are_told_of(tmp_path, noise):
    path = write(tmp_path, "-3\t-2\tgone\n-2\t-1\ttoo\n-1\t1\tone\n", "a.tsv")
    with pytest.warns(
        CospeechWarning, match="2 of 3 words end before the beginning of the speech .* the first is 'gone' at -3 s"
    ):
        assert texts(load_words(path, speech=noise)) == ["one"]
    with pytest.raises(InputError, match="before the speech begins"):
        load_words(write(tmp_path, "-3\t-2\tgone\n", "b.tsv"), speech=noise)


def test_more_words_than_somebody_says_are_told_of(tmp_path, noise):
    path = write(tmp_path, f"1\n00:00:01,000 --> 00:00:05,000\n{'word ' * 60}\n", "a.srt")
    with pytest.warns(CospeechWarning, match=r"60 syllables for 4\.0 s, faster than people speak"):
        load_words(path, speech=noise)


@pytest.mark.parametrize("hours", [1, 10])
def test_the_clock_of_a_broadcast_is_named(tmp_path, noise, hours):
    path = write(tmp_path, f"1\n{hours:02d}:00:01,000 --> {hours:02d}:00:02,000\nHi\n", "my talk.srt")
    with pytest.raises(InputError, match=rf"its clock begins at {hours:02d}:00:00, .*: --transcript-offset -{hours * 3600} "):
        load_words(path, speech=noise)
    assert rows(load_words(TranscriptFile(path, -3600.0 * hours), speech=noise)) == [("Hi", 1.0, 2.0)]


def test_an_offset_moves_times_before_what_is_outside_is_left_out(tmp_path, noise):
    path = write(tmp_path, "0\t1\tgone\n2\t4\tcut\n6\t7\twhole\n12\t13\tlate\n", "a.tsv")
    with pytest.warns(CospeechWarning, match="1 of 4 words end before the beginning of the speech .* 'gone' at -3 s"):
        assert rows(load_words(TranscriptFile(path, -3.0), speech=noise)) == [
            ("cut", 0.0, 1.0), ("whole", 3.0, 4.0), ("late", 9.0, 10.0)
        ]  # fmt: skip
    with pytest.warns(CospeechWarning, match="begin after the end"):
        assert rows(load_words(TranscriptFile(path, 0.5), speech=noise))[0] == ("gone", 0.5, 1.5)


def test_an_offset_that_would_change_nothing_or_is_no_time(tmp_path, noise):
    with pytest.raises(InputError, match=r"an offset for 'a\.txt', which has no times"):
        load_words(TranscriptFile(write(tmp_path, "Hello", "a.txt"), 2.0), speech=noise)
    for offset in (float("nan"), float("inf"), 1e8):
        with pytest.raises(InputError, match="is in seconds"):
            TranscriptFile("a.srt", offset)


def test_subtitles_at_the_same_time_are_told_of(tmp_path, noise):
    cues = "1\n00:00:00,000 --> 00:00:03,000\none two three\n\n2\n00:00:01,500 --> 00:00:03,000\nuno dos\n"
    with pytest.warns(
        CospeechWarning, match="1 of 2 entries begin before the one before ends, the first is 'uno dos' at 1.5 s"
    ):
        load_words(write(tmp_path, cues, "a.srt"), speech=noise)


# ---- names of speakers ----


@pytest.mark.parametrize(
    ("lines", "speech"),
    [
        (["田中：こんにちは", "田中：はい"], ["こんにちは", "はい"]),
        (["राम: नमस्ते", "राम: हाँ"], [" नमस्ते", " हाँ"]),
        (["أحمد: مرحبا", "أحمد: نعم"], [" مرحبا", " نعم"]),
        (["Bob\u00a0: Salut", "Bob\u202f: Oui"], [" Salut", " Oui"]),
        ([">> Bob: hello", "Remember: hands"], [" hello", "Remember: hands"]),
        (["NARRATOR (V.O.): hello"], [" hello"]),
        (["[laughs] ANNA: hello"], ["[laughs]  hello"]),
        (["注意：気をつけて", "それはとても大切なこと：はい"], ["注意：気をつけて", "それはとても大切なこと：はい"]),
    ],
)
def test_names_in_other_typography(lines, speech):
    assert [line.strip() for line in drop_labels(lines)] == [line.strip() for line in speech]


# ---- words of a cue on the sound ----


def cues_of(words: tuple[Word, ...], count: int) -> str:
    """Subtitles of so many words, which begin up to .2 s before their sound and stay for up to .4 s."""
    cues, last = [], 0.0
    for k in range(0, len(words), count):
        part, after = words[k : k + count], words[k + count : k + count + 1]
        start, end = max(last, part[0].start - 0.2), part[-1].end + 0.4
        last = min(end, max(part[-1].end, after[0].start - 0.2)) if after else end
        clock = " --> ".join(f"00:00:{seconds:06.3f}".replace(".", ",") for seconds in (start, last))
        cues.append(f"{k}\n{clock}\n{' '.join(word.text for word in part)}\n")
    return "\n".join(cues)


@pytest.mark.slow
@pytest.mark.parametrize("count", [6, 15])
def test_words_of_subtitles_lie_on_the_sound(tmp_path, count):
    audio, words = example()
    speech = Speech.load(audio, transcript=words)
    path = write(tmp_path, cues_of(speech.words, count), "a.srt")
    on_sound, alone = load_words(path, speech=speech), load_words(path, speech_seconds=speech.seconds)
    assert texts(on_sound) == texts(alone) == texts(speech.words)
    on_sound_error, alone_error = (
        np.median([abs(a.start - b.start) for a, b in zip(cue_words, speech.words, strict=True)])
        for cue_words in (on_sound, alone)
    )
    assert on_sound_error < 0.06
    assert on_sound_error < alone_error / 2
    with open_speech(audio, transcript=path) as source:  # before it is read
        assert source.words == with_language(on_sound)


def test_a_sound_is_not_searched_again_and_again(noise):
    aligner = SoundAligner(noise)
    apart = [aligner.align_within(["a", "incomprehensible"], 0.0, 9.0) for _ in range(4)]
    assert apart[3] == spread(["a", "incomprehensible"], 0.0, 9.0)
    assert apart[0] == apart[1] != apart[3]


def test_times_of_single_words_stay_as_they_are(tmp_path, noise):
    path = write(tmp_path, "0.5\t3.5\thello\n3.5\t9.0\tworld\n", "a.tsv")
    assert rows(load_words(path, speech=noise)) == [("hello", 0.5, 3.5), ("world", 3.5, 9.0)]


# ---- recognisers ----

WORDS = [
    {"word": "guten", "punctuated_word": "Guten", "start": 0.5, "end": 0.9},
    {"word": "Abend", "start": 0.9, "end": 1.4},
]
CPP = [{"offsets": {"from": 500, "to": 1400}, "text": " Guten Abend", "tokens": [
    {"text": "[_BEG_]", "offsets": {"from": 0, "to": 0}}, {"text": " Gut", "offsets": {"from": 500, "to": 700}},
    {"text": "en", "offsets": {"from": 700, "to": 900}}, {"text": " Abend", "offsets": {"from": 900, "to": 1400}},
]}]  # fmt: skip
DOCUMENTS = {
    "whisper.cpp": {"result": {"language": "de"}, "transcription": CPP},
    "Transformers": {"text": "x", "chunks": [
        {"timestamp": [0.5, 0.9], "text": " Guten"}, {"timestamp": [0.9, 1.4], "text": " Abend"}]},
    "Deepgram": {"results": {"channels": [{"alternatives": [{"transcript": "x", "words": WORDS}]}]}},
    "Amazon Transcribe": {"results": {"transcripts": [], "items": [
        {"start_time": "0.5", "end_time": "0.9", "alternatives": [{"content": "Guten"}], "type": "pronunciation"},
        {"start_time": "0.9", "end_time": "1.4", "alternatives": [{"content": "Abend"}], "type": "pronunciation"},
        {"alternatives": [{"content": "."}], "type": "punctuation"}]}},
    "Google Speech-to-Text": {"results": [{"alternatives": [{"transcript": "x", "words": [
        {"startTime": "0.500s", "endTime": "0.9s", "word": "Guten"},
        {"startTime": {"nanos": 900000000}, "endTime": {"seconds": "1", "nanos": 400000000}, "word": "Abend"}]}]}]},
    "Speechmatics": {"results": [
        {"type": "word", "start_time": 0.5, "end_time": 0.9, "alternatives": [{"content": "Guten"}]},
        {"type": "word", "start_time": 0.9, "end_time": 1.4, "alternatives": [{"content": "Abend"}]},
        {"type": "punctuation", "start_time": 1.4, "end_time": 1.4, "alternatives": [{"content": "."}]}]},
    "Rev": {"monologues": [{"speaker": 0, "elements": [
        {"type": "text", "value": "Guten", "ts": 0.5, "end_ts": 0.9}, {"type": "punct", "value": " "},
        {"type": "text", "value": "Abend", "ts": 0.9, "end_ts": 1.4}]}]},
    "Azure Speech to Text": {"RecognitionStatus": "Success", "NBest": [{"Words": [
        {"Word": "Guten", "Offset": 5000000, "Duration": 4000000},
        {"Word": "Abend", "Offset": 9000000, "Duration": 5000000}]}]},
    "AssemblyAI": {"id": "1", "text": "x", "words": [
        {"text": "Guten", "start": 500, "end": 900}, {"text": "Abend", "start": 900, "end": 1400}]},
}  # fmt: skip


@pytest.mark.parametrize("name", SHAPES)
def test_the_words_of_every_recogniser(tmp_path, name):
    path = write(tmp_path, json.dumps(DOCUMENTS[name]), "a.json")
    assert rows(load_words(path)) == [("Guten", 0.5, 0.9), ("Abend", 0.9, 1.4)]


def test_an_end_that_a_pipeline_leaves_out(tmp_path):
    chunks = [{"timestamp": [0.0, 1.0], "text": " Guten"}, {"timestamp": [1.0, None], "text": " Abend"}]
    assert rows(load_words(write(tmp_path, json.dumps({"chunks": chunks}), "a.json")))[1] == ("Abend", 1.0, 1.6)


@pytest.mark.parametrize(
    ("document", "message"),
    [
        ({"transcription": [{"offsets": {"from": 0}, "text": "a"}]}, "no offsets.to"),
        ({"chunks": [{"timestamp": 3, "text": "a"}]}, "timestamp of 'a' is 3"),
        ({"results": {"channels": [1]}}, "'1' in channels"),
        ({"results": {"items": 7}}, "results is '7'"),
        ({"results": [{"alternatives": [{"words": [{"word": "a", "startTime": "soon"}]}]}]}, "'soon' is not a time"),
        ({"monologues": [{"elements": [{"type": "text", "value": 1, "ts": 0}]}]}, "value is 1"),
        ({"NBest": [{"Words": [{"Word": "a", "Offset": -1}]}]}, "Offset is -1"),
    ],
)
def test_a_field_that_makes_no_sense_is_named(tmp_path, document, message):
    with pytest.raises(InputError, match=message):
        load_words(write(tmp_path, json.dumps(document), "a.json"))


def test_a_name_in_another_normal_form_is_found(tmp_path):
    nfd, nfc = (unicodedata.normalize(form, "père") for form in ("NFD", "NFC"))
    there = write(tmp_path, "x", f"{nfc}.srt")
    assert put_name(f"{tmp_path}/{{name}}.srt", nfd) == str(there)
    assert put_name(f"{tmp_path}/{{name}}.txt", nfd) == f"{tmp_path}/{nfd}.txt"
