"""Words beside live sound: each lies on its sound, however much silence comes in between, and whichever came first."""

from __future__ import annotations

import os
import threading
import time

import numpy as np
import pytest

from cospeech.audio import waiting_words
from cospeech.audio.live_sources import LINE, PIECE, pace_pieces, read_lines
from cospeech.audio.speech import Speech, Word
from cospeech.audio.waiting_sound import WaitingSound
from cospeech.audio.waiting_words import WaitingWords
from cospeech.errors import InputError

RATE = 8_000
SIZE = round(PIECE * RATE)
WORDS = (Word("one", 0.01, 0.03), Word("two", 0.05, 0.07), Word("three", 0.115, 0.3))


def sound(pieces: int) -> np.ndarray:
    return np.ones(pieces * SIZE, np.float32)


def hear(waiting: WaitingSound, words: WaitingWords) -> list[Speech]:
    """All pieces of sound that has ended, at once."""
    return [
        words.join(piece) for piece in pace_pieces(None, RATE, idle=False, waiting=waiting, sleep=lambda seconds: None)
    ]  # fmt: skip


def test_a_word_travels_with_the_piece_in_which_it_starts():
    waiting = WaitingSound(RATE)
    words = WaitingWords(waiting, RATE, pytest.fail)
    words.put(reversed(WORDS))
    waiting.put(sound(8))
    waiting.end()
    pieces = hear(waiting, words)
    assert [[word.text for word in piece.words] for piece in pieces] == [["one"], [], ["two"], [], [], ["three"], [], []]
    for word, original in zip((word for piece in pieces for word in piece.words), WORDS, strict=True):
        assert (word.start, word.end) == pytest.approx((original.start, original.end))


def test_words_wait_for_their_sound_through_silence():
    """On the clock, a word begins later by the silence that came before its sound."""
    waiting, clock = WaitingSound(RATE), [0.0]
    words, output = WaitingWords(waiting, RATE, pytest.fail), []
    words.put(WORDS)
    pieces = pace_pieces(
        None, RATE, slack=0.0, waiting=waiting, clock=lambda: clock[0], sleep=lambda s: clock.__setitem__(0, clock[0] + s)
    )
    for k, piece in enumerate(pieces):
        output.append(words.join(piece))
        clock[0] = max(clock[0], (k + 1) * PIECE + 1.0)  # whoever waits has waited too long already
        if k == 2:
            waiting.put(sound(2)[:-60])  # three pieces of silence before it, one and a half after it
        if k == 6:
            waiting.put(sound(6))
            waiting.end()
    begins = [piece.start for piece in output if piece.samples.any()]
    assert begins[:3] == pytest.approx([3 * PIECE, 4 * PIECE, 7 * PIECE])
    starts = {word.text: word.start for piece in output for word in piece.words}
    assert starts["one"] == pytest.approx(3 * PIECE + 0.01)
    gap = 7 * PIECE - (2 * SIZE - 60) / RATE
    assert starts["two"] == pytest.approx(0.05 + gap)
    assert starts["three"] == pytest.approx(0.115 + gap)


def test_a_late_word_lies_on_its_sound_and_a_very_late_one_is_told_once():
    waiting, notes = WaitingSound(RATE), []
    words, output = WaitingWords(waiting, RATE, notes.append), []
    waiting.put(sound(40))
    waiting.end()
    for k, piece in enumerate(pace_pieces(None, RATE, idle=False, waiting=waiting, sleep=lambda seconds: None)):
        if k == 5:
            words.put([Word("soon", 0.05, 0.2)])
        if k == 30:
            words.put([Word("late", 0.1, 0.2), Word("later", 0.15, 0.2)])
        output.append(words.join(piece))
    assert [(word.text, round(word.start, 6)) for word in output[5].words] == [("soon", 0.05)]
    assert [(word.text, round(word.start, 6)) for word in output[30].words] == [("late", 0.1), ("later", 0.15)]
    assert notes == ["'late' came 0.5 s after its sound: send words before their sound"]


def test_words_of_dropped_sound_are_forgotten_and_those_of_the_new_sound_count_from_its_beginning():
    waiting = WaitingSound(RATE)
    words = WaitingWords(waiting, RATE, pytest.fail)
    words.put(WORDS)
    waiting.put(sound(3))
    waiting.drop(3 * SIZE)
    waiting.put(sound(8))
    words.put([Word("new", 0.0, 0.4)], 3 * SIZE)
    waiting.end()
    output = [word for piece in hear(waiting, words) for word in piece.words]
    assert [word.text for word in output] == ["new", "three"]
    assert output[0].end == pytest.approx(output[1].start)  # a word ends where the next one starts


def test_words_do_not_pile_up(monkeypatch):
    monkeypatch.setattr(waiting_words, "WORDS", 2)
    words = WaitingWords(WaitingSound(RATE), RATE, pytest.fail)
    with pytest.raises(InputError, match="more than 2 words wait"):
        words.put(WORDS)


def test_lines_of_any_length_come_whole(tmp_path):
    lines = [b"a" * 200_000 + b"\n", b"\n", b"end"]
    (tmp_path / "lines").write_bytes(b"".join(lines))
    assert list(read_lines(tmp_path / "lines", 1 << 20)) == lines
    parts = list(read_lines(tmp_path / "lines"))
    assert b"".join(parts) == b"".join(lines)
    assert max(map(len, parts)) <= 2 * LINE


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes")
def test_all_who_write_to_a_named_pipe_are_heard(tmp_path):
    from cospeech.cli.stream_sources import _collect_words as collect_words

    pipe, notes, put = tmp_path / "words", [], []
    os.mkfifo(pipe)

    class Words:
        def put(self, words) -> None:
            put.extend(words)

    threading.Thread(target=collect_words, args=(str(pipe), Words(), notes.append), daemon=True).start()
    pipe.write_text('{"word": "tiny", "start": 0.5, "end": 0.9}\n\n{"wor\n')
    pipe.write_text('[{"text": "very huge", "start": 1, "end": 2}]')
    until = time.monotonic() + 30
    while len(put) < 3 and time.monotonic() < until:
        time.sleep(0.01)
    assert [word.text for word in put] == ["tiny", "very", "huge"]
    assert len(notes) == 1
    assert notes[0].startswith("words: a line is not JSON")
