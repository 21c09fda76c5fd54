"""Messages that steer a live session, from a WebSocket or from standard input."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import numpy as np
import pytest

from cospeech.audio.live_sources import read_lines, read_websocket
from cospeech.audio.speech import example
from cospeech.errors import InputError
from cospeech.runtime.live_control import apply_control


class Listener:
    """Records the calls that a `LiveSession` would carry out."""

    def __init__(self) -> None:
        self.calls: list[tuple] = []

    def __getattr__(self, name: str):
        return lambda *given: self.calls.append((name, *given))


def test_messages_call_the_session():
    session = Listener()
    apply_control(session, '{"interrupt": true, "emotion": "anger"}')
    apply_control(session, b'{"parts": ["face"], "intensity": 1, "style": "calm"}\n')
    assert session.calls == [
        ("set_emotion", "anger"), ("interrupt",), ("restyle", "calm"), ("set_intensity", 1), ("set_parts", ["face"]),
    ]  # fmt: skip


@pytest.mark.parametrize(
    "text",
    ["", "{", "[]", "{}", '"interrupt"', '{"stop": true}', '{"interrupt": false}', '{"emotion": 3}', '{"intensity": "big"}',
     '{"intensity": true}', '{"parts": [1]}', '{"style": null}', "[" * 5000, '{"style": "' + "a" * 70_000 + '"}',
     '{"words": []}', b"\xff\xfe"],
)  # fmt: skip
def test_a_message_that_says_nothing_sensible_is_refused_whole(text):
    session = Listener()
    with pytest.raises(InputError):
        apply_control(session, text)
    assert session.calls == []


def test_words_of_a_message_go_where_words_are_wanted():
    session, words = Listener(), []
    keys = apply_control(session, '{"words": [{"word": "no"}], "style": "calm"}', put_words=words.append)
    assert (keys, words, session.calls) == ({"words", "style"}, [[{"word": "no"}]], [("restyle", "calm")])
    with pytest.raises(InputError, match=r"words are not taken here .*--transcript"):
        apply_control(session, '{"words": []}')
    with pytest.raises(InputError, match="interrupt, words"):
        apply_control(session, '{"word": "no"}', put_words=words.append)


def test_lines_and_texts_arrive_as_they_come():
    out, into = os.pipe()
    os.write(into, b'{"interrupt": true}\n{"emotion"')
    lines = read_lines(out)
    assert next(lines) == b'{"interrupt": true}\n'
    os.write(into, b': "fear"}\n')
    assert next(lines) == b'{"emotion": "fear"}\n'
    os.close(into)
    assert list(lines) == []
    os.close(out)
    texts = []
    blocks = list(read_websocket(["{}", np.zeros(4, "<i2").tobytes(), ""], "s16", texts.append))
    assert [len(block) for block in blocks] == [4]
    assert texts == ["{}", ""]


@pytest.mark.slow
def test_a_stream_is_interrupted_by_a_line():
    command = [sys.executable, "-m", "cospeech", "stream", "-i", example()[0], "--to", "-", "--fps", "30", "--control", "-"]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as stream:
        for line in stream.stdout:
            message = json.loads(line)
            if message.get("frame") == 90:
                stream.stdin.write(b'{"interrupt": true}\n{"emotion": "joy"}\n')
                stream.stdin.flush()
            if message.get("frame") == 150:
                stream.terminate()
                break
        assert b"control: no emotion is called 'joy'" in stream.stderr.read()


def test_sound_and_messages_come_from_two_places(cli):
    code, _, err = cli("stream", "--quiet", "-i", "-", "--control", "-")
    assert code == 2
    assert "--control and --input are both '-'" in err
