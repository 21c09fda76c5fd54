"""Who speaks when, from the files that tell it."""

from __future__ import annotations

import json

import pytest

from cospeech.audio.diarisation import read_speakers
from cospeech.errors import InputError

RTTM = """SPEAKER talk 1 0.50 2.00 <NA> <NA> ann <NA> <NA>
SPKR-INFO talk 1 <NA> <NA> <NA> unknown ann <NA> <NA>
SPEAKER talk 1 3.00 1.00 <NA> <NA> bob <NA> <NA>
SPEAKER talk 1 2.60 0.30 <NA> <NA> ann <NA> <NA>
"""
DOCUMENTS = {
    "WhisperX": {"segments": [
        {"start": 0.5, "end": 2.9, "speaker": "ann", "words": [{"word": "a", "start": 0.5, "end": 2.5, "speaker": "ann"}]},
        {"start": 3.0, "end": 4.0, "speaker": "bob", "words": []},
    ]},
    "Deepgram": {"results": {"channels": [{"alternatives": [{"words": [
        {"word": "a", "start": 0.5, "end": 2.9, "speaker": "ann"}, {"word": "b", "start": 3.0, "end": 4.0, "speaker": "bob"},
    ]}]}]}},
    "AssemblyAI": {"utterances": [
        {"speaker": "ann", "start": 500, "end": 2900, "text": "a"}, {"speaker": "bob", "start": 3000, "end": 4000, "text": "b"},
    ]},
    "AWS": {"results": {"speaker_labels": {"segments": [
        {"start_time": "0.5", "end_time": "2.9", "speaker_label": "ann", "items": []},
        {"start_time": "3.0", "end_time": "4.0", "speaker_label": "bob", "items": []},
    ]}}},
    "Azure": {"recognizedPhrases": [
        {"speaker": "ann", "offsetInTicks": 5000000, "durationInTicks": 24000000},
        {"speaker": "bob", "offsetInTicks": 30000000, "durationInTicks": 10000000},
    ]},
    "Google": {"results": [{"alternatives": [{"words": [
        {"startTime": "0.500s", "endTime": "2.900s", "word": "a", "speakerTag": "ann"},
        {"startTime": "3s", "endTime": "4s", "word": "b", "speakerTag": "bob"},
    ]}]}]},
    "Rev": {"monologues": [
        {"speaker": "ann", "elements": [{"ts": 0.5, "end_ts": 2.9, "value": "a"}]},
        {"speaker": "bob", "elements": [{"ts": 3.0, "end_ts": 4.0, "value": "b"}, {"value": "."}]},
    ]},
    "ElevenLabs": {"words": [
        {"text": "a", "start": 0.5, "end": 2.9, "speaker_id": "ann"},
        {"text": "b", "start": 3.0, "end": 4.0, "speaker_id": "bob"},
    ]},
    "clock": [
        {"speaker": "ann", "start": "00:00:00.500", "end": "00:00:02.900"},
        {"speaker": "bob", "start": "00:00:03,000", "end": "00:00:04,000"},
    ],
}  # fmt: skip
VTT = """WEBVTT

00:00.500 --> 00:02.900
<v ann>Hello there

00:03.000 --> 00:04.000
<v.loud bob>Hi</v>
"""
SRT = """1
00:00:00,500 --> 00:00:01,500
ANN: Hello

2
00:00:01,600 --> 00:00:02,900
there.

3
00:00:03,000 --> 00:00:04,000
BOB: Hi
"""


def check(path, names=("ann", "bob")):
    speakers = read_speakers(path, 60.0)
    assert list(speakers) == list(names)
    assert [tuple(round(time, 6) for time in phrase) for phrase in speakers[names[0]]] == [(0.5, 2.9)]
    assert [tuple(round(time, 6) for time in phrase) for phrase in speakers[names[1]]] == [(3.0, 4.0)]


def write(folder, name, text):
    (folder / name).write_text(text, "utf-8")
    return folder / name


def test_rttm(tmp_path):
    check(write(tmp_path, "a.rttm", RTTM))


@pytest.mark.parametrize("service", DOCUMENTS)
def test_json_of_recognisers(tmp_path, service):
    check(write(tmp_path, "a.json", json.dumps(DOCUMENTS[service])))


def test_voices_of_webvtt_and_labels_of_subrip(tmp_path):
    check(write(tmp_path, "a.vtt", VTT))
    check(write(tmp_path, "a.srt", SRT), ("ANN", "BOB"))


def test_speaker_is_a_label_of_subtitles_too(tmp_path):
    check(write(tmp_path, "a.srt", SRT.replace("ANN", "SPEAKER 1").replace("BOB", "SPEAKER 2")), ("SPEAKER 1", "SPEAKER 2"))


def test_signs_of_webvtt_in_names_are_read(tmp_path):
    speakers = read_speakers(write(tmp_path, "a.vtt", VTT.replace("<v ann>", "<v A &amp; B>")), 60.0)
    assert next(iter(speakers)) == "A & B"


def test_numbers_are_names_and_0_is_one(tmp_path):
    document = {"words": [{"w": "a", "start": 0, "end": 1, "speaker": 0}, {"w": "b", "start": 2, "end": 3, "speaker": 1}]}
    assert list(read_speakers(write(tmp_path, "a.json", json.dumps(document)), 10.0)) == ["0", "1"]


@pytest.mark.parametrize(
    "text",
    [
        "", "hello", "{}", "[]", '{"words": [{"word": "a", "start": 1, "end": 2}]}',
        '{"speaker": "ann"}', '{"speaker": "ann", "start": 2, "end": 1}', "1\n00:00:01,000 --> 00:00:02,000\nHello\n",
        "SPEAKER talk 1 -1 2 <NA> <NA> ann", '{"speaker": true, "start": 1, "end": 2}',
    ],
)  # fmt: skip
def test_a_file_that_names_nobody_is_told(tmp_path, text):
    with pytest.raises(InputError, match=r"empty|does not say who speaks when"):
        read_speakers(write(tmp_path, "a.json", text), 60.0)


def test_a_broken_line_is_named(tmp_path):
    with pytest.raises(InputError, match=r"line 2 of 'a\.rttm' has 4 fields"):
        read_speakers(write(tmp_path, "a.rttm", "SPEAKER t 1 0 1 <NA> <NA> ann\nSPEAKER t 1 0\n"), 60.0)
    with pytest.raises(InputError, match="soon"):
        read_speakers(write(tmp_path, "a.rttm", "SPEAKER t 1 soon 1 <NA> <NA> ann\n"), 60.0)


def test_json_that_is_nested_for_ever_ends(tmp_path):
    brackets = "[" * 900 + "]" * 900
    with pytest.raises(InputError):
        read_speakers(write(tmp_path, "a.json", brackets), 60.0)
