"""Transcripts: every format read right, forty that are wrong, and plain text laid on the sound."""

from __future__ import annotations

import json
import sys
from contextlib import nullcontext
from pathlib import Path

import numpy as np
import pytest
import soundfile
from hypothesis import given, settings
from hypothesis import strategies as st

from cospeech import InputError, Speech, Word
from cospeech.audio.features import Features, analyse
from cospeech.audio.forced_alignment import align, align_with_recogniser, count_syllables, spread, tokenise
from cospeech.audio.languages import with_language
from cospeech.audio.speech import example, open_speech
from cospeech.audio.transcripts import load_words, settle
from cospeech.errors import CospeechWarning

SRT = "1\n00:00:01,000 --> 00:00:02,500\n<i>Hello,</i> dear\nworld!\n\n2\n00:00:03,000 --> 00:00:03,400\n- No.\n"
LONG_GRID = '''File type = "ooTextFile"
Object class = "TextGrid"

xmin = 0
xmax = 3
tiers? <exists>
size = 2
item []:
    item [1]:
        class = "IntervalTier"
        name = "phones"
        xmin = 0
        xmax = 3
        intervals: size = 3
        intervals [1]:
            xmin = 0
            xmax = 1
            text = "a"
        intervals [2]:
            xmin = 1
            xmax = 2
            text = "b"
        intervals [3]:
            xmin = 2
            xmax = 3
            text = "c"
    item [2]:
        class = "IntervalTier"
        name = "words"
        xmin = 0
        xmax = 3
        intervals: size = 3
        intervals [1]:
            xmin = 0
            xmax = 0.5
            text = ""
        intervals [2]:
            xmin = 0.5
            xmax = 1.25
            text = "say ""hi"""
        intervals [3]:
            xmin = 1.25
            xmax = 3
            text = "sil"
'''
SHORT_GRID = '"ooTextFile"\n"TextGrid"\n0\n2\n<exists>\n1\n"IntervalTier"\n"Mary"\n0\n2\n2\n0\n0.5\n""\n0.5\n2\n"été"\n'
WORD_TIMES = [{"word": "hello", "start": 0.5, "end": 1.0}, {"word": "world", "start": 1, "end": 1.5}]
POCKETSPHINX = {
    "b": 0,
    "d": 2,
    "t": "hello world",
    "w": [{"t": "<sil>", "b": 0, "d": 0.5}, {"t": "hello(2)", "b": 0.5, "d": 0.5}, {"t": "world", "b": 1.0, "d": 0.5}],
}
HELLO = (Word("hello", 0.5, 1.0), Word("world", 1.0, 1.5))


def write(folder: Path, content: str | bytes, name: str) -> Path:
    path = folder / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


def texts(words: tuple[Word, ...]) -> list[str]:
    return [word.text for word in words]


# ---- formats ----


def test_textgrid_long(tmp_path):
    words = load_words(write(tmp_path, LONG_GRID, "a.TextGrid"))
    assert texts(words) == ["say", "hi"]
    assert (words[0].start, words[-1].end) == (0.5, 1.25)


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "utf-16-be"])
@pytest.mark.parametrize("newline", ["\n", "\r\n", "\r"])
def test_textgrid_short_in_every_encoding(tmp_path, encoding, newline):
    path = write(tmp_path, SHORT_GRID.replace("\n", newline).encode(encoding), "a.TextGrid")
    assert load_words(path) == (Word("été", 0.5, 2.0),)


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("a.tsv", "0.5\t1.0\thello\n1.0\t1.5\tworld\n"),
        ("a.tsv", "start\tend\tword\n0.5\t1.0\thello\n1.0\t1.5\tworld\n"),
        ("a.tsv", "start\tend\ttext\n500\t1000\thello\n1000\t1500\tworld\n"),
        ("a.tsv", "0,5\t1,0\thello\r\n\r\n1,0\t1,5\tworld\r\n"),
        ("labels.txt", "0.500000\t1.000000\thello\n1.000000\t1.500000\tworld\n"),
        ("a.csv", "start,end,word\r\n0.5,1.0,hello\r\n1.0,1.5,world\r\n"),
        ("a.csv", 'start;end;word\n0,5;1,0;"hello"\n1,0;1,5;"world"\n'),
        ("words.txt", "0.5,1.0,hello\n1.0,1.5,world\n"),
        ("a.lab", "0.5 1.0 hello\n1.0  1.5  world\n"),
        ("a.json", json.dumps(WORD_TIMES)),
        ("a.json", json.dumps([{"text": "hello", "start": "0.5", "end": "1.0"}, {"label": "world", "begin": 1, "stop": 1.5}])),
        ("a.json", json.dumps({"words": WORD_TIMES})),  # Gentle
        ("a.json", json.dumps({"words": [WORD_TIMES[0], {"word": "lost", "case": "not-found-in-audio"}, WORD_TIMES[1]]})),
        ("a.json", json.dumps({"text": "hello world", "segments": [{"start": 0.5, "end": 1.5, "words": WORD_TIMES}]})),
        ("a.json", json.dumps({"segments": [{"start": 0.5, "end": 1.5, "text": "hello world"}]})),  # Whisper without word times
        ("a.json", json.dumps({"result": [{**word, "conf": 1.0} for word in WORD_TIMES], "text": "hello world"})),  # Vosk
        ("a.json", json.dumps(POCKETSPHINX)),
        ("a.srt", "1\n00:00:00,500 --> 00:00:01,500\nHello world\n"),
        ("a.vtt", "WEBVTT\n\n00:00.500 --> 00:01.500 align:start\n<v Mary>Hello world\n"),
        ("subtitles.txt", "1\n00:00:00,500 --> 00:00:01,500\nHello world\n"),
    ],
)  # fmt: skip
def test_the_same_words_from_every_format(tmp_path, name, content):
    words = load_words(write(tmp_path, content, name))
    assert [word.text.lower() for word in words] == texts(HELLO)
    assert (words[0].start, words[1].end) == (0.5, 1.5)
    exact = any(mark in content for mark in ("\t", "1.0", "1,0", '"wor', '"b'))
    assert words[0].end == words[1].start == pytest.approx(1.0, abs=0 if exact else 0.1)


def test_subtitles_are_spread_over_their_words(tmp_path):
    words = load_words(write(tmp_path, SRT, "a.srt"))
    assert texts(words) == ["Hello", "dear", "world", "No"]
    assert (words[0].start, words[2].end, words[3].start, words[3].end) == (1.0, 2.5, 3.0, 3.4)
    assert words[0].end == words[1].start
    assert words[2].end - words[2].start > words[1].end - words[1].start > 0.2


def test_times_past_the_end_are_cut(tmp_path):
    path = write(tmp_path, "0.5\t1\tone\n1.5\t2.5\ttwo\n3\t4\tthree\n", "a.tsv")
    assert load_words(path, speech_seconds=2.0) == (Word("one", 0.5, 1.0), Word("two", 1.5, 2.0))


def test_words_after_the_end_of_a_speech_are_noted(tmp_path, speech):
    path = write(tmp_path, "0.5\t1\tone\n500\t501\ttwo\n502\t503\tthree\n", "a.tsv")
    with pytest.warns(CospeechWarning, match=r"2 of 3 words begin after the end of the speech .* the first is 'two' at 500 s"):
        assert load_words(path, speech=speech) == (Word("one", 0.5, 1.0),)
    sound = tmp_path / "a.wav"
    soundfile.write(sound, np.zeros(16_000), 16_000)
    with (
        pytest.warns(CospeechWarning, match="2 of 3 words"),
        open_speech(sound, transcript=path) as source,
    ):  # before it is read
        assert source.words == (Word("one", 0.5, 1.0),)


@pytest.mark.parametrize(
    ("name", "text", "hint"),
    [
        ("plan.json", '{"cospeech_plan": 1, "words": []}', "it is a plan of gestures: --plan plays it"),
        ("noises.srt", "1\n00:00:01,000 --> 00:00:02,000\n[applause]\n", "leave the transcript out if nobody speaks"),
        ("list.json", "[]", "leave the transcript out if nobody speaks"),
    ],
)
def test_a_speech_takes_no_transcript_without_words(tmp_path, name, text, hint):
    path, sound = write(tmp_path, text, name), tmp_path / "a.wav"
    soundfile.write(sound, np.zeros(16_000), 16_000)
    for load in (Speech.load, open_speech):
        with pytest.raises(InputError) as refusal:
            load(sound, transcript=path)
        assert str(refusal.value) == f"no words in {name!r} ({hint})"


def test_librivox(shared_folder):
    folder = shared_folder / "data" / "speech" / "librivox"
    for path in sorted(folder.glob("*-[0-9]*.json")):
        if path.name.count(".") > 1:  # phones and states
            continue
        tokens = path.with_suffix(".txt").read_text().split()
        assert texts(load_words(path, speech=Speech.load(path.with_suffix(".flac")))) == tokens


# ---- forty that are wrong ----

POINTS = '"ooTextFile"\n"TextGrid"\n0\n1\n<exists>\n1\n"TextTier"\n"x"\n0\n1\n1\n0.5\n"a"\n'
MANY = '"ooTextFile"\n"TextGrid"\n0\n100000\n<exists>\n1\n"IntervalTier"\n"words"\n0\n100000\n100000\n' + "".join(
    f'{i}\n{i + 1}\n"w{i}"\n' for i in range(100_000)
)


def cues(*lines: str) -> str:
    """SubRip with a cue of a second for each text."""
    return "".join(f"{k}\n00:00:0{k},000 --> 00:00:0{k + 1},000\n{text}\n\n" for k, text in enumerate(lines, 1))


CASES: dict[str, tuple[str, str | bytes, str | list[str]]] = {
    # name: (file name, content, message of the error or the words that come out)
    "empty": ("a.tsv", "", "empty"),
    "blanks": ("a.txt", " \n\t\n", "no word"),
    "only punctuation": ("a.txt", "... -- !?", "no word"),
    "only silence": ("a.tsv", "0\t1\t\n1\t2\tsil\n2\t3\t<p:>\n", []),
    "only noises": ("a.srt", "1\n00:00:01,000 --> 00:00:02,000\n[applause] (coughs) ♪\n", []),
    "only laughter": ("a.srt", "1\n00:00:01,000 --> 00:00:02,000\n（笑）\n", ["[laughter]"]),
    "overlap": ("a.tsv", "0\t1\tone\n0.5\t2\ttwo\n", ["one", "two"]),
    "the same time": ("a.tsv", "1\t2\tone\n1\t2\ttwo\n1\t2\tthree\n", ["one", "two", "three"]),
    "unsorted": ("a.tsv", "2\t3\ttwo\n0\t1\tone\n", ["one", "two"]),
    "no length": ("a.tsv", "1\t1\tone\n2\t2\ttwo\n", ["one", "two"]),
    "before the start": ("a.tsv", "-3\t-2\tgone\n-1\t1\tone\n", ["one"]),
    "ends before it starts": ("a.tsv", "2\t1\tone\n", "ends before it starts"),
    "all past the end": ("a.tsv", "900\t1000\tone\n", "begins at 900 s, but the speech is 10.00 s"),
    "milliseconds": ("a.tsv", "12000\t12500\tone\n12500\t13000\ttwo\n", "in milliseconds"),
    "not a number": ("a.tsv", "nan\t1\tone\n", "nan"),
    "infinite": ("a.tsv", "0\tinf\tone\n", "inf"),
    "1e300": ("a.tsv", "0\t1e300\tone\n", "1e"),
    "a line of words": ("a.tsv", "0\t1\tone\nhello there\n", "line 2"),
    "blanks for tabs": ("a.tsv", "0 1 one\n1 2 two\n", ["one", "two"]),
    "commas in words": ("a.lab", "0.0 1.0 one, two\n1.0 2.0 three\n", ["one", "two", "three"]),
    "a face": ("a.csv", "Timecode,BlendShapeCount,JawOpen\n00:00:00:00,52,0.1\n", "line 2"),
    "a cell of a megabyte": ("a.csv", '0,1,"' + "a" * 1_000_000 + '"\n', "field"),
    "numbers that are said": ("a.txt", "1 2 3\n4 5 6\n", ["1", "2", "3", "4", "5", "6"]),
    "SubStation Alpha": ("a.ass", "[Script Info]\n\n[Events]\nDialogue: 0,0:00:00.10,0:00:02.00,,,0,0,0,,Hi\n", "ffmpeg"),
    "two columns": ("a.tsv", "0\t1\n1\t2\n", []),
    "right to left": ("a.tsv", "0\t1\tשלום\n1\t2\tمرحبا\n", ["שלום", "مرحبا"]),
    "Chinese": ("a.srt", "1\n00:00:01,000 --> 00:00:03,000\n你好，世界\n", ["你", "好", "世", "界"]),
    "an empty cue": ("a.srt", cues("one", "", "two"), ["one", "two"]),
    "no blank line": ("a.srt", cues("one", "two").replace("\n\n", "\n"), ["one", "two"]),
    "a number that is said": ("a.srt", cues("2024", "5"), ["2024", "5"]),
    "a number in WebVTT": ("a.vtt", "WEBVTT\n\n00:01.000 --> 00:02.000\n2024\n\n00:03.000 --> 00:04.000\nno\n", ["2024", "no"]),
    "names in capitals": ("a.srt", cues("ANNA: a", ">> DR. BOB: b\nc", "told YOU: d"), ["a", "b", "c", "told", "YOU", "d"]),
    "names": ("a.srt", cues("- Dr. Smith: a\n- Anna: b", "Dr. Smith: c", "Anna: d"), ["a", "b", "c", "d"]),
    "no names": ("a.srt", cues("Listen: a", "At 11: b", "NO: NEVER"), ["Listen", "a", "At", "11", "b", "NO", "NEVER"]),
    "names in plain text": ("a.txt", "Anna: one\nBob: two\n\nAnna: three\nBob: four\n", ["one", "two", "three", "four"]),
    "emoji": ("a.tsv", "0\t1\t🎉\n1\t2\twow🎉\n", ["wow"]),
    "Latin-1": ("a.tsv", "0\t1\tété\n".encode("latin-1"), "is not UTF-8 text: byte 0xe9"),
    "cut in a character": ("a.txt", "été".encode()[:-1], "UTF-8"),
    "odd UTF-16": ("a.txt", b"\xff\xfeh\0e", "UTF-16"),
    "NUL": ("a.tsv", "0\t1\tone\0\n", "NUL"),
    "sound": ("a.txt", np.random.default_rng(0).bytes(4001), "text"),
    "a WAV": ("a.wav", b"RIFF\x24\x08\0\0WAVEfmt " + bytes(2000), r"'a.wav' is .*: it is not text \(TextGrid, .eaf, .tsv"),
    "a video": ("a.mp4", b"\0\0\0\x20ftypisom" + bytes(range(256)) * 8, "'a.mp4' is no transcript"),
    "sound without a head": ("a", np.arange(2000, dtype=np.int16).tobytes() + b"\0\xd8", "no transcript"),
    "escape codes": ("a.tsv", "0\t1\t\x1b[31mred\x1b[0m\n", ["31mred", "0m"]),
    "nested JSON": ("a.json", "[" * 200_000 + "]" * 200_000, "nested"),
    "nested words": ("a.json", '{"words": [' * 50 + "1" + "]}" * 50, "nested"),
    "cut JSON": ("a.json", '[{"word": "one", "start": 0', "not JSON"),
    "JSON number": ("a.json", "42", "42"),
    "JSON of something else": ("a.json", '{"bones": 3}', "bones"),
    "JSON of numbers": ("a.json", "[1, 2]", "list of words"),
    "JSON NaN": ("a.json", '[{"word": "one", "start": NaN, "end": 1}]', "NaN"),
    "JSON with true for a time": ("a.json", '[{"word": "one", "start": true, "end": 1}]', "not a time"),
    "JSON with a word for a time": ("a.json", '[{"word": "one", "start": "soon", "end": 1}]', "'soon' is not a time"),
    "JSON with a huge time": ("a.json", '[{"word": "one", "start": 0, "end": 1' + "0" * 4000 + "}]", "time|JSON"),
    "JSON without an end": ("a.json", '[{"word": "one", "start": 0}]', "no end"),
    "JSON of null": ("a.json", "null", "None"),
    "empty JSON list": ("a.json", "[]", []),
    "cut TextGrid": ("a.TextGrid", LONG_GRID[:400], "where a"),
    "TextGrid of nothing": ("a.TextGrid", "hello", "its end"),
    "TextGrid without tiers": ("a.TextGrid", '"ooTextFile"\n"TextGrid"\n0\n1\n<absent>\n', "without tiers"),
    "TextGrid of points": ("a.TextGrid", POINTS, "interval tier"),
    "TextGrid that lies": ("a.TextGrid", SHORT_GRID.replace("0\n2\n2\n", "0\n2\n99999999\n"), "its end"),
    "TextGrid of 1e999": ("a.TextGrid", SHORT_GRID.replace("0\n2\n2\n", "0\n2\n1e999\n"), "announces"),
    "TextGrid of half an entry": ("a.TextGrid", SHORT_GRID.replace("0\n2\n2\n", "0\n2\n1.5\n"), "announces"),
    "a pitch file": ("a.TextGrid", 'File type = "ooTextFile"\nObject class = "Pitch 1"\n', "not a TextGrid"),
    "100,000 intervals": ("a.TextGrid", MANY, [f"w{i}" for i in range(10)]),
    "subtitles without times": ("a.srt", "Hello\nworld\n", "no subtitle has a time"),
    "subtitle times swapped": ("a.srt", "00:00:05,000 --> 00:00:01,000\nhello\n", "ends before"),
    "subtitle hours of a century": ("a.srt", "9999:00:00,000 --> 9999:00:01,000\nhello\n", "is at 3.59964e\\+07"),
    "a word of a megabyte": ("a.tsv", "0\t1\t" + "a" * 1_000_000 + "\n", ["a" * 1_000_000]),
    "too many words": ("a.txt", "word " * 2000, "2000 words in 10.0 s"),
}  # fmt: skip


def ten_seconds() -> Speech:
    return Speech(np.random.default_rng(0).standard_normal(160_000).astype(np.float32) * 0.1)


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_forty_transcripts_that_are_wrong(tmp_path, case):
    name, content, expected = CASES[case]
    path = write(tmp_path, content, name)
    if isinstance(expected, str):
        with pytest.raises(InputError, match=expected) as refusal:
            load_words(path, speech=ten_seconds())
        assert "\n" not in str(refusal.value)
        assert len(str(refusal.value)) < 300
        return
    warning = {"100,000 intervals": "99990 of 100000 words", "before the start": "1 of 2 words end before the beginning"}.get(
        case
    )
    with pytest.warns(CospeechWarning, match=warning) if warning else nullcontext():
        words = load_words(path, speech=ten_seconds())
    assert texts(words) == expected
    check(words, 10.0)


def check(words: tuple[Word, ...], seconds: float) -> None:
    """Assert what all callers rely on: words have a text, follow each other and lie within the speech."""
    for word, after in zip(words, [*words, Word("", seconds, seconds)][1:], strict=True):
        assert 0 <= word.start < word.end <= after.start <= seconds + 1e-9, (word, after)
        assert word.text


def test_there_are_forty():
    assert len(CASES) >= 40


@pytest.mark.parametrize("name", ["missing.tsv", ".", "a\0b.srt"])
def test_transcripts_that_are_no_files(tmp_path, name):
    with pytest.raises(InputError, match=r"cannot read"):
        load_words(tmp_path / name)


@pytest.mark.slow
@given(st.lists(st.tuples(st.sampled_from(["one", "two three", "", "<sil>"]), st.floats(-2, 12), st.floats(0, 3)), max_size=12))
def test_whatever_the_times_words_come_out_in_order(entries):
    try:
        words = settle([(text, start, start + length) for text, start, length in entries], 10.0)
    except InputError as error:
        assert "begins at" in error.problem or "before the speech begins" in error.problem  # noqa: PT017  # any other error would be a fault
    else:
        check(words, 10.0)


# ---- plain text ----


@pytest.fixture(scope="module")
def speech() -> Speech:
    audio, transcript = example()
    return Speech.load(audio, transcript=transcript)


@pytest.mark.slow
def test_plain_text_lies_on_the_sound(speech):
    words = load_words(example()[0].with_suffix(".txt"), speech=speech)
    assert texts(words) == texts(speech.words)
    check(words, speech.seconds)
    errors = np.abs([a.start - b.start for a, b in zip(words, speech.words, strict=True)])
    evenly = spread(texts(words), 0, speech.seconds)
    even = np.abs([a.start - b.start for a, b in zip(evenly, speech.words, strict=True)])
    assert np.median(errors) < 0.06
    assert np.quantile(errors, 0.9) < 0.25
    assert np.median(errors) < np.median(even) / 4


def test_plain_text_on_people(shared_folder):
    errors = []
    folder = shared_folder / "data" / "speech" / "librivox"
    for path in sorted(folder.glob("*-[0-9][0-9][0-9][0-9].json")):
        speech = Speech.load(path.with_suffix(".flac"))
        words = load_words(path.with_suffix(".txt"), speech=speech)
        errors += [abs(a.start - b.start) for a, b in zip(words, load_words(path, speech=speech), strict=True)]
    grid = shared_folder / "data" / "face_grid_s1"
    for path in sorted((grid / "words").glob("*.align"))[5::30]:
        lines = [line.split() for line in path.read_text().splitlines()]
        spoken = [(text, int(start) / 25_000) for start, _, text in lines if text not in ("sil", "sp")]
        words = align([text for text, _ in spoken], Speech.load(grid / "audio" / f"{path.stem}.flac"))
        errors += [abs(word.start - start) for word, (_, start) in zip(words, spoken, strict=True)]
    assert np.median(errors) < 0.08
    assert np.quantile(errors, 0.9) < 0.3


@pytest.mark.slow
def test_a_stream_a_speech_and_its_features_give_the_same(speech):
    text = example()[0].with_suffix(".txt").read_text()
    with open_speech(example()[0], transcript=example()[0].with_suffix(".txt")) as source:
        assert source.words == with_language(load_words(example()[0].with_suffix(".txt"), speech=speech))
        assert source.words == with_language(align(text, analyse(speech)))


@pytest.mark.parametrize("level", [0.0, 0.1])
def test_words_on_a_sound_without_any_speech(level):
    samples = level * np.random.default_rng(0).standard_normal(48_000).astype(np.float32)
    words = align("eins zwei drei", Speech(samples))
    assert texts(words) == ["eins", "zwei", "drei"]
    check(words, 3.0)


@pytest.mark.slow
@settings(max_examples=60)
@given(st.integers(0, 2**32 - 1), st.integers(1, 60), st.floats(0.02, 20))
@pytest.mark.filterwarnings("ignore:the transcript has:cospeech.errors.CospeechWarning")
def test_any_words_on_any_sound(seed, count, seconds):
    rng = np.random.default_rng(seed)
    frames = int(seconds * 100) + 1
    loud = np.repeat(rng.choice([-90, -30, -20], frames), rng.integers(1, 40, frames))[:frames] + rng.normal(0, 3, frames)
    none = np.zeros(frames, np.float32)
    features = Features(loud.astype(np.float32), none, none, none, np.zeros((frames, 5), np.float32))
    tokens = rng.choice(["a", "incomprehensibilities", "no,", "stop.", "你", "1999"], count).tolist()
    try:
        words = align(tokens, features)
    except InputError as error:
        assert f"{count} words in" in error.problem  # noqa: PT017  # any other error would be a fault
    else:
        assert len(words) == count
        check(words, max(1, frames - 1) / 100)


def test_plain_text_alone_has_no_times(tmp_path):
    path = write(tmp_path, "Hello there", "a.txt")
    with pytest.raises(InputError, match="without times"):
        load_words(path)
    assert texts(load_words(path, speech_seconds=2)) == ["Hello", "there"]


@pytest.mark.parametrize(
    ("word", "syllables"),
    [("time", 1), ("little", 2), ("everything", 4), ("played", 1), ("wanted", 2), ("boxes", 2), ("you", 1), ("BBC", 3),
     ("你", 1), ("молоко", 3), ("ありがとう", 5), ("안녕", 2), ("42", 3), ("été,", 2), ("the", 1)],
)  # fmt: skip
def test_syllables(word, syllables):
    assert count_syllables(word) == syllables


def test_tokens():
    assert tokenise("Well — don't 'quote' me: 10 % of 3.5!") == ["Well—", "don't", "'quote'", "me:", "10%", "of", "3.5!"]
    assert tokenise("") == tokenise("—") == []


def test_a_recogniser_is_a_function(monkeypatch):
    assert align_with_recogniser("a.wav", lambda path: [Word(path, 0, 1)]) == (Word("a.wav", 0, 1),)
    monkeypatch.setitem(sys.modules, "faster_whisper", None)
    with pytest.raises(InputError, match=r'in a clone: pip install -e "\.\[asr\]"'):
        align_with_recogniser("a.wav")


@pytest.mark.slow
def test_transcribe_takes_the_words_of_the_recogniser(tmp_path, monkeypatch):
    """A stand-in for faster-whisper: the real one fetches weights from a hub."""
    import sys
    from types import ModuleType, SimpleNamespace

    from cospeech.audio.speech import example
    from cospeech.generate import generate_files

    class WhisperModel:
        def __init__(self, name: str, **options: object) -> None: ...

        def transcribe(self, path: str, *, word_timestamps: bool):
            assert word_timestamps
            words = [SimpleNamespace(word=" Huge!", start=0.3, end=0.8), SimpleNamespace(word=" no", start=1.0, end=1.2)]
            return [SimpleNamespace(words=words)], None

    fake = ModuleType("faster_whisper")
    fake.WhisperModel = WhisperModel
    monkeypatch.setitem(sys.modules, "faster_whisper", fake)
    plain, with_words = (tmp_path / name for name in ("plain.json", "heard.json"))
    generate_files(example()[0], [plain])
    generate_files(example()[0], [with_words], transcribe=True)
    assert plain.read_bytes() != with_words.read_bytes()

    def offline(self, path, *, word_timestamps):
        raise OSError("cannot reach the hub\nmore")

    monkeypatch.setattr(WhisperModel, "transcribe", offline)
    with pytest.raises(InputError, match="cannot reach the hub"):
        generate_files(example()[0], [with_words], transcribe=True)


def test_transcribe_without_the_extra_says_what_to_install(tmp_path):
    from cospeech.audio.speech import example
    from cospeech.generate import generate_files

    with pytest.raises(InputError, match=r"\.\[asr\]"):
        generate_files(example()[0], [tmp_path / "x.json"], transcribe=True)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("wrong", [{"style": "nope"}, {"speaker": "nope"}, {"face": "nope.csv"}, {"continue_from": "nope.bvh"}])
def test_options_are_checked_before_the_speech_is_recognised(tmp_path, monkeypatch, wrong):
    from cospeech.audio.speech import example
    from cospeech.generate import generate_files

    monkeypatch.setattr("cospeech.generate.align_with_recogniser", lambda path: pytest.fail("the speech was recognised"))
    with pytest.raises(InputError):
        generate_files(example()[0], [tmp_path / "x.glb"], transcribe=True, **wrong)


def test_a_text_that_is_too_long_for_the_speech_is_told_of(tmp_path):
    sound, words = example()
    text = words.with_suffix(".txt")
    whole = Speech.load(sound, transcript=text)  # it fits: nothing is told
    part = Speech(whole.samples[: 8 * whole.rate], whole.rate)
    soundfile.write(tmp_path / "part.wav", part.samples, part.rate)
    with pytest.warns(CospeechWarning, match=r"68 syllables for 5\.\d s of voice, faster than people speak: does it belong"):
        Speech.load(tmp_path / "part.wav", transcript=text)


def test_sentences_of_a_long_text_are_found_though_the_speaker_becomes_quicker():
    random, energy, tokens, starts = np.random.default_rng(0), [], [], []
    for k in range(40):
        starts.append((len(tokens), len(energy) / 100))
        for _ in range(random.integers(4, 12)):
            tokens.append("banana")
            energy += [
                -50.0,
                *[-20.0] * (20 - 2 * (k // 8)),
                -45.0,
            ] * 3  # a syllable takes .22 s at first, and .14 s at the end
        tokens[-1] += "."
        energy += [-90.0] * int(random.integers(30, 60))
    levels = np.array(energy)
    none = np.zeros(len(levels))
    words = align(tokens, Features(levels, none, none, none, np.zeros((len(levels), 5)), fps=100.0))
    off = np.abs([words[first].start - time for first, time in starts])
    assert (np.median(off), off.max()) == (pytest.approx(0, abs=0.1), pytest.approx(0, abs=0.5))
