"""Word times of text-to-speech services: read as the services send them, and refused in a line where they are damaged."""

from __future__ import annotations

import copy
import json
import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cospeech.audio.transcript_formats import json_words
from cospeech.audio.transcripts import load_words, settle
from cospeech.audio.tts_words import SERVICES
from cospeech.audio.word_json import read_documents
from cospeech.errors import InputError


def alignment(text: str, start: float = 0.0, step: float = 0.1) -> dict:
    """The alignment of a text whose characters take a tenth of a second each."""
    starts = [round(start + k * step, 3) for k in range(len(text))]
    ends = [round(begin + step, 3) for begin in starts]
    return {"characters": [*text], "character_start_times_seconds": starts, "character_end_times_seconds": ends}


ELEVENLABS = {"audio_base64": "SUQz", "alignment": alignment("Hi 5!"), "normalized_alignment": alignment("Hi five!")}
STREAM = [
    {"audio_base64": "SUQz", "alignment": alignment("Hel"), "normalized_alignment": alignment("Hel")},
    {"audio_base64": "SUQz", "alignment": None, "normalized_alignment": None},
    {"audio_base64": "SUQz", "alignment": alignment("lo you. ", 0.3), "normalized_alignment": None},
    {"audio_base64": "SUQz", "alignment": alignment("Bye", 1.1), "normalized_alignment": alignment("Bye", 1.1)},
]


def message(text: str, long: str = "charDurationsMs") -> dict:
    """A message of the WebSocket: times count from its beginning."""
    return {"chars": [*text], "charStartTimesMs": [100 * k for k in range(len(text))], long: [100] * len(text)}


SOCKET = [
    {"audio": "SUQz", "isFinal": None, "normalizedAlignment": message("Hel"), "alignment": message("Hel")},
    {"audio": "SUQz", "isFinal": None, "normalizedAlignment": None, "alignment": message("lo you. ", "charsDurationsMs")},
    {"audio": "SUQz", "isFinal": None, "normalizedAlignment": message("Bye"), "alignment": message("By3")},
    {"audio": None, "isFinal": True},
]
PYTHON = [
    {"audio_offset": 500_000, "duration": "0:00:00.2375", "text": "Hello", "text_offset": 0, "word_length": 5},
    {"audio_offset": 2_875_000, "duration": 0.1, "text": ",", "boundary_type": "SpeechSynthesisBoundaryType.Punctuation"},
    {"audio_offset": 3_000_000, "viseme_id": 4},
    {"audio_offset": 500_000, "duration": "0:00:02", "text": "Hello, you", "boundary_type": "BoundaryType.Sentence"},
    {"audio_offset": 4_000_000, "duration": 0.25, "text": "you", "boundary_type": "SpeechSynthesisBoundaryType.Word"},
]  # fmt: skip
JAVASCRIPT = [
    {"privAudioOffset": 500_000, "privDuration": 2_375_000, "privText": "Hello", "privBoundaryType": "WordBoundary"},
    {"privAudioOffset": 4_000_000, "privDuration": 2_500_000, "privText": "you", "privBoundaryType": "WordBoundary"},
]
CSHARP = [
    {"AudioOffset": 500_000, "Duration": "00:00:00.2375000", "Text": "Hello", "BoundaryType": 0},
    {"AudioOffset": 500_000, "Duration": "00:00:01", "Text": "Hello you", "BoundaryType": 2},
    {"AudioOffset": 4_000_000, "Duration": "00:00:00.2500000", "Text": "you", "BoundaryType": 0},
]
BATCH = [{"Text": "Hello", "AudioOffset": 50, "Duration": 237.5}, {"Text": "you", "AudioOffset": 400, "Duration": 250}]
CARTESIA = [
    {"type": "chunk", "data": "aSDi", "done": False, "status_code": 206, "context_id": "a"},
    {"type": "timestamps", "done": False, "context_id": "a", "word_timestamps": {"words": ["Hi,"], "start": [0], "end": [0.4]}},
    {
        "type": "timestamps",
        "context_id": "a",
        "word_timestamps": {"words": ["you", "two."], "start": [0.5, 1], "end": [0.9, 1.2]},
    },
    {"type": "done", "done": True, "context_id": "a"},
]
POLLY = [
    {"time": 0, "type": "sentence", "start": 0, "end": 23, "value": "Mary had a little lamb."},
    {"time": 6, "type": "word", "start": 0, "end": 4, "value": "Mary"},
    {"time": 6, "type": "viseme", "value": "p"},
    {"time": 373, "type": "word", "start": 5, "end": 8, "value": "had"},
    {"time": 604, "type": "word", "start": 9, "end": 10, "value": "a"},
    {"time": 643, "type": "word", "start": 11, "end": 17, "value": "little"},
    {"time": 2000, "type": "ssml", "start": 18, "end": 40, "value": "here"},
    {"time": 2882, "type": "word", "start": 41, "end": 45, "value": "lamb"},
]


def to_lines(pieces: list) -> str:
    return "".join(json.dumps(piece) + "\n" for piece in pieces)


def words_of(text: str) -> list[tuple[str, float, float]]:
    return [(word.text, round(word.start, 4), round(word.end, 4)) for word in settle(json_words.read(text, print))]


def test_characters_become_words_of_the_text_that_is_spoken():
    assert words_of(json.dumps(ELEVENLABS)) == [("Hi", 0.0, 0.2), ("five", 0.3, 0.8)]
    assert words_of(json.dumps(ELEVENLABS | {"normalized_alignment": None})) == [("Hi", 0.0, 0.2), ("5", 0.3, 0.5)]
    assert words_of(json.dumps(alignment("Hi 5!"), indent=1)) == [("Hi", 0.0, 0.2), ("5", 0.3, 0.5)]


@pytest.mark.parametrize("text", [to_lines(STREAM), json.dumps(STREAM, indent=2), "\n\n".join(map(json.dumps, STREAM))])
def test_a_word_that_a_piece_of_a_stream_cuts_is_whole(text):
    assert words_of(text) == [("Hello", 0.0, 0.5), ("you", 0.6, 1.0), ("Bye", 1.1, 1.4)]


@pytest.mark.parametrize("write", [to_lines, json.dumps])
def test_messages_of_cartesia(write):
    expected = [("Hi", 0.0, 0.4), ("you", 0.5, 0.9), ("two", 1.0, 1.2)]
    assert words_of(write(CARTESIA)) == expected
    assert words_of(write(CARTESIA[1:])) == expected


def test_times_of_messages_of_the_websocket_count_from_the_end_of_the_message_before():
    assert words_of(to_lines(SOCKET)) == [("Hello", 0.0, 0.5), ("you", 0.6, 1.0), ("Bye", 1.1, 1.4)]


def test_a_word_comes_as_soon_as_it_is_certain():
    sent_pieces, word_times = [], []

    def pieces():
        for piece in STREAM:
            sent_pieces.append(piece)
            yield piece

    for text, _, _ in read_documents(pieces()):
        word_times.append((text, len(sent_pieces)))
    assert word_times == [("Hello", 3), ("you.", 3), ("Bye", 4)]


def test_signs_of_a_script_without_blanks_keep_their_times():
    assert words_of(json.dumps({"alignment": alignment("你好。")})) == [("你", 0.0, 0.1), ("好", 0.1, 0.3)]


@pytest.mark.parametrize("pieces", [PYTHON, JAVASCRIPT, CSHARP, BATCH], ids=["python", "javascript", "c#", "batch"])
@pytest.mark.parametrize("write", [to_lines, json.dumps])
def test_boundaries_of_words_of_every_sdk(pieces, write):
    assert words_of(write(pieces)) == [("Hello", 0.05, 0.2875), ("you", 0.4, 0.65)]


def test_speech_marks_end_with_the_next_word_or_as_their_syllables_do():
    expected = [
        ("Mary", 0.006, 0.373),
        ("had", 0.373, 0.604),
        ("a", 0.604, 0.643),
        ("little", 0.643, 1.243),
        ("lamb", 2.882, 3.182),
    ]
    assert words_of(to_lines(POLLY)) == expected


@pytest.mark.parametrize("name", ["talk.marks", "talk.jsonl", "talk.txt", "talk.json"])
def test_files_are_recognised_by_what_is_in_them(tmp_path, name):
    (tmp_path / name).write_text(to_lines(POLLY))
    assert [word.text for word in load_words(tmp_path / name)] == ["Mary", "had", "a", "little", "lamb"]


def test_lines_of_plain_words_are_read():
    assert words_of('{"word": "a", "start": 0, "end": 1}\n\n[{"text": "b", "start": 1, "end": 2}]\n') == [
        ("a", 0.0, 1.0), ("b", 1.0, 2.0),
    ]  # fmt: skip


STARTS, ENDS = "character_start_times_seconds", "character_end_times_seconds"


def edit(pieces: list, at: int, *path: object, value: object = None) -> str:
    """The pieces as JSON lines, with one value replaced; None removes it."""
    pieces = copy.deepcopy(pieces)
    node = pieces[at]
    for key in path[:-1]:
        node = node[key]
    if value is None:
        del node[path[-1]]
    else:
        node[path[-1]] = value
    return to_lines(pieces)


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        (edit(STREAM, 2, "alignment", "characters"), "object 3: alignment has no characters (a list belongs there)"),
        (edit(STREAM, 2, "alignment", STARTS), f"object 3: alignment has no {STARTS} (a list"),
        (edit(STREAM, 2, "alignment", STARTS, value=3), f"object 3: {STARTS} of alignment is '3' (a list"),
        (edit(STREAM, 2, "alignment", ENDS, 7), f"object 3: {ENDS} of alignment has 7 values, and characters has 8 (one"),
        (edit(STREAM, 2, "alignment", STARTS, 1, value=-0.5), f"object 3: {STARTS}[1] of alignment is -0.5 (seconds, 0 and"),
        (edit(STREAM, 2, "alignment", STARTS, 1, value="1"), f"object 3: {STARTS}[1] of alignment is 1 (seconds"),
        (edit(STREAM, 2, "alignment", ENDS, 1, value=0.1), f"object 3: {ENDS}[1] of alignment is 0.1, before its start"),
        (edit(STREAM, 2, "alignment", "characters", 1, value=4), "object 3: characters[1] of alignment is '4' (a character"),
        (edit(STREAM, 2, "alignment", value=[1]), "object 3: alignment is '[1]' (an object with characters"),
        (edit(STREAM, 3, "normalized_alignment", STARTS, 0, value=0.0), f"object 4: {STARTS} goes back from 1.1 to 0 s"),
        (edit(STREAM, 3, "normalized_alignment", STARTS, 0, value=float("nan")), f"line 4 holds NaN in '{STARTS}' (only"),
        (to_lines(STREAM).replace("0.3]", "1e999]"), f"the transcript holds 1e999 in '{ENDS}' (only"),
        (to_lines(STREAM)[:-9], "line 4 is not JSON: "),
        (json.dumps(STREAM, indent=1)[:-30], "the transcript is not JSON: "),
        (to_lines([*STREAM, 3]), "object 5 is '3' (a JSON object"),
        (edit(SOCKET, 1, "alignment", "chars"), "object 2: alignment has no chars (a list belongs there)"),
        (edit(SOCKET, 0, "normalizedAlignment", "charDurationsMs"), "object 1: normalizedAlignment has no charDurationsMs"),
        (edit(SOCKET, 1, "alignment", "charStartTimesMs", 2, value=-1), "object 2: charStartTimesMs[2] of alignment is -1"),
        (edit(CARTESIA, 2, "word_timestamps", "end"), "object 3: word_timestamps has no list end (one value for each word)"),
        (edit(CARTESIA, 2, "word_timestamps", "end", 1), "object 3: word_timestamps has 2 words, 2 starts and 1 ends (one"),
        (edit(CARTESIA, 1, "word_timestamps", "start", 0, value="0"), "object 2: start of 'Hi,' is 0 (seconds, 0 and more)"),
        (edit(CARTESIA, 1, "word_timestamps", "words", 0, value=3), "object 2: a word is 3 (a text belongs there)"),
        (edit(CARTESIA, 1, "word_timestamps", value=[3]), "object 2: word_timestamps is '[3]' (an object with words"),
        (edit(PYTHON, 0, "text"), "object 1: there is no text (the SDK has it since version 1.21)"),
        (edit(PYTHON, 4, "duration"), "object 5: there is no duration of 'you' (ticks of 100 ns"),
        (edit(PYTHON, 4, "duration", value="soon"), "object 5: duration of 'you' is 'soon' (ticks of 100 ns, or a text"),
        (edit(PYTHON, 4, "audio_offset", value=-1), "object 5: audio_offset of 'you' is -1 (ticks of 100 ns, 0 and more)"),
        (edit(PYTHON, 4, "audio_offset"), "object 5: there is no audio_offset of 'you'"),
        (edit(PYTHON, 4, "audio_offset", value=True), "object 5: audio_offset of 'you' is True"),
        (edit(BATCH, 1, "AudioOffset", value="400"), "object 2: AudioOffset of 'you' is 400 (milliseconds, 0 and more)"),
        (edit(POLLY, 3, "time"), "object 4: there is no time of 'had' (milliseconds, 0 and more)"),
        (edit(POLLY, 3, "time", value=-6), "object 4: time of 'had' is -6 (milliseconds"),
        (edit(POLLY, 3, "type"), "object 4: a mark has no type (word, sentence, viseme, ssml)"),
        (edit(POLLY, 3, "type", value="noun"), "object 4: type is 'noun' (word, sentence"),
        (edit(POLLY, 3, "value"), "object 4: there is no value (the word belongs there)"),
    ],
)  # fmt: skip
def test_the_field_that_is_wrong_is_named(text, problem):
    with pytest.raises(InputError) as refusal:
        words_of(text)
    assert str(refusal.value).startswith(problem)


JUNK = (None, True, -3, 0, 7, 10**20, 0.5, -0.5, float("nan"), float("inf"), "", "a", "0:00:01", [], {}, [[1]], {"a": 1})


@pytest.mark.parametrize("pieces", [[ELEVENLABS], STREAM, SOCKET, PYTHON, JAVASCRIPT, CSHARP, BATCH, POLLY, CARTESIA])
@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_damaged_objects_give_words_or_a_line_of_error(pieces, seed):
    draw, pieces = random.Random(seed), copy.deepcopy(pieces)
    for _ in range(draw.randint(1, 3)):
        node, key = pieces, draw.randrange(len(pieces))
        while isinstance(node[key], dict | list) and node[key] and draw.random() < 0.7:
            node = node[key]
            key = draw.choice([*node] if isinstance(node, dict) else range(len(node)))
        if isinstance(node, dict) and draw.random() < 0.3:
            del node[key]
        else:
            node[key] = copy.deepcopy(draw.choice(JUNK))
    text = draw.choice([json.dumps(pieces), json.dumps(pieces, indent=1), to_lines(pieces)])
    text = text[: draw.randint(0, len(text))] if draw.random() < 0.3 else text
    try:
        words = words_of(text)
    except InputError as error:
        assert "\n" not in str(error)  # noqa: PT017  # any other error would be a fault
        assert len(str(error)) < 300  # noqa: PT017
    else:
        assert all(0 <= start < end for _, start, end in words)


def test_every_service_is_found_by_one_row_alone():
    rows = [ELEVENLABS, STREAM[1], alignment("a"), PYTHON[2], JAVASCRIPT[0], CSHARP[0], BATCH[0], POLLY[0]]
    services = [[name for name, service in SERVICES.items() if service.has_fields(row)] for row in rows]
    assert services == [["ElevenLabs"]] * 3 + [["Azure Speech"]] * 4 + [["Amazon Polly"]]
