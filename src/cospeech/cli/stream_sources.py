"""Sources of `cospeech stream`: the sound, the words, and the messages that steer."""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import InputError
from ..files import parse_json
from ..limits import TRANSCRIPT_JSON_VALUES
from ..runtime.live_controls import LiveControls

if TYPE_CHECKING:
    from ..audio.speech import File, Speech
    from ..audio.waiting_sound import WaitingSound
    from ..audio.waiting_words import WaitingWords
    from ..runtime.live_listener import LiveListener

__all__ = ["check_partner", "check_sources", "hear_partner", "is_live", "open_pieces"]

_RATES = (8_000, 192_000)  # range of --rate, samples per second
_WORDS_LINE = 16 << 20  # bytes of a line of --words [ours: some services put a minute of sound in base64 there]


def check_sources(
    source: str, control: str | None, transcript: str | None, words: str | None, language: str, rate: int, samples: str
) -> None:
    """Check that the options about sources fit together.

    Raises:
        InputError: they do not.
    """
    from ..audio.languages import check_language
    from ..audio.live_sources import FORMATS
    from ..export.live.addresses import SOURCES, scheme_of

    _check_sound(source)
    if control is not None and control != "-" and scheme_of(control) not in SOURCES:
        raise InputError(f"cannot hear messages from {control!r}", f"known: -, {_list_addresses()}")
    if samples not in FORMATS:
        raise InputError(f"samples of kind {samples!r}", f"known: {', '.join(FORMATS)}")
    check_language(language, has_words=is_live(source) or transcript is not None)
    if control == source:
        raise InputError(f"--control and --input are both {control!r}", "a WebSocket that sends sound may send messages, too")
    if not _RATES[0] <= rate <= _RATES[1]:
        raise InputError(f"{rate} samples per second", f"{_RATES[0]} … {_RATES[1]}")
    if transcript is not None and source == "mic":
        raise InputError("a transcript of the microphone", "nobody knows yet when words are spoken: leave out --transcript")
    if words is not None:
        _check_words(words, source)


def _check_sound(source: str) -> None:
    """Check that sound can come from a source.

    Raises:
        InputError: it is an address of a kind that sends no sound.
    """
    from ..export.live.addresses import scheme_of

    if scheme_of(source) and not is_live(source):
        raise InputError(f"cannot hear sound from {source!r}", f"known: mic, a sound file, -, {_list_addresses()}")


def _list_addresses() -> str:
    """Kinds of addresses that can be sources, for hints."""
    from ..export.live.addresses import SOURCES

    return ", ".join(f"{scheme}://HOST:PORT" for scheme in SOURCES)


def check_partner(partner: str | None, source: str, control: str | None, unpaced: bool) -> None:
    """Check that the sound of the other person can be heard beside the character's own speech.

    Raises:
        InputError: it cannot.
    """
    if partner is None:
        return
    _check_sound(partner)
    if partner in (source, control):
        flag = "--input" if partner == source else "--control"
        raise InputError(f"--partner and {flag} are both {partner!r}", "each comes from a source of its own")
    if unpaced:
        raise InputError("--unpaced with --partner", "two sounds keep together by the clock; leave out --unpaced")


def _check_words(path: str, source: str) -> None:
    """Check that words can be read.

    Raises:
        InputError: there is no such file or pipe, or the speech is a sound file.
    """
    if not is_live(source):
        raise InputError("--words beside a sound file", "--transcript gives its words")
    if not Path(path).exists():
        raise InputError(f"cannot read {path!r}: there is no such file or pipe", "mkfifo words makes a pipe")
    if Path(path).is_dir() or not os.access(path, os.R_OK):
        reason = "it is a folder" if Path(path).is_dir() else "Permission denied"
        raise InputError(f"cannot read {path!r}: {reason}", "name a file or a pipe")


def is_live(source: str) -> bool:
    """Whether a source is live; else it is a sound file."""
    from ..export.live.addresses import SOURCES, scheme_of

    return source in ("mic", "-") or scheme_of(source) in SOURCES


def open_pieces(
    stack: ExitStack, source: str, transcript: File | None, words: str | None, control: str | None, *, rate: int, kind: str,
    slack: float, unpaced: bool, tell: Callable[[str], None], language: str = "",
) -> tuple[Iterator[Speech], LiveControls]:  # fmt: skip
    """Open a source. Returns its speech, piece by piece, and the messages that steer; ``stack`` closes what is opened.

    Args:
        transcript: file with the words of the whole speech.
        words: file or pipe with words that come beside live sound.
        control: a further source of messages that steer, besides the sound's source.
        slack: seconds that live sound may be late.
        unpaced: read a file as fast as possible, not as fast as it is spoken.
        tell: called with what is wrong with a message or with raw samples.
        language: of all words, see `cospeech.audio.languages`. If it is empty, that of a transcript is detected.

    Raises:
        InputError: the source or the control cannot be opened, or the transcript cannot be read.
    """
    from ..audio.languages import check_language
    from ..audio.live_sources import BEHIND, pace_pieces
    from ..audio.waiting_sound import WaitingSound
    from ..audio.waiting_words import WaitingWords

    waiting, language = WaitingSound(round(BEHIND * rate)), check_language(language)
    waiting_words = WaitingWords(waiting, rate, lambda text: tell(f"words: {text}"), language) if is_live(source) else None
    controls = LiveControls(waiting, lambda error: tell(f"control: {error}"), waiting_words)
    if waiting_words is None:
        pieces = _pieces_of_file(stack, source, transcript, language, unpaced)
    else:
        _open_words(transcript, language, words, waiting_words, tell)
        blocks = _open_blocks(stack, source, rate, kind, controls.put, tell)
        pieces = _see_that_sound_comes(pace_pieces(blocks, rate, slack=slack, waiting=waiting), waiting)
    if control is not None:
        _open_control(stack, control, controls, tell)
    return pieces, controls


def _open_words(
    transcript: File | None, language: str, path: str | None, words: WaitingWords, tell: Callable[[str], None]
) -> None:
    """Put the words of a transcript into ``words``, and start a thread that puts the words that come beside the sound."""
    from ..audio.languages import with_language
    from ..audio.transcripts import load_speech_words
    from ..face.graphemes import note_unread_words

    if transcript is not None:
        transcript_words = with_language(load_speech_words(transcript), language)
        note_unread_words(transcript_words)
        words.put(transcript_words)
    if path is not None:
        _start(_collect_words, path, words, tell)


def _see_that_sound_comes(pieces: Iterator[Speech], waiting: WaitingSound) -> Iterator[Speech]:
    """Yield the pieces; raise an InputError at the end if no sample came."""
    yield from pieces
    if not waiting.received:
        raise InputError("the input ended without sound", "send samples to it before you end it")


def hear_partner(
    stack: ExitStack, source: str | None, listener: LiveListener, *, rate: int, kind: str, tell: Callable[[str], None]
) -> None:
    """Start a thread in which a character hears the other person, if there is a source; ``stack`` closes what is opened.

    Raises:
        InputError: the source cannot be opened.
    """
    from ..audio.live_sources import pace_pieces

    if source is None:
        return
    if is_live(source):
        blocks = _open_blocks(stack, source, rate, kind, lambda text: tell("partner: texts are not heard, only sound"), tell)
        pieces = pace_pieces(blocks, rate)
    else:
        pieces = _pieces_of_file(stack, source, None, "", unpaced=False)
    _start(_collect_partner, pieces, listener, tell)


def _collect_partner(pieces: Iterator[Speech], listener: LiveListener, tell: Callable[[str], None]) -> None:
    try:
        for piece in pieces:
            listener.hear(piece)
    except (InputError, OSError) as error:
        tell(f"partner: {error}; nobody is heard any more")


def _open_blocks(
    stack: ExitStack, source: str, rate: int, kind: str, put: Callable[[str], object], tell: Callable[[str], None]
) -> Iterator[Any]:
    """Samples of a source as they come. Texts of a WebSocket go to ``put``."""
    from ..audio.live_sources import read_microphone, read_websocket

    def note(text: str) -> None:
        tell(f"note: {text}")

    if source == "mic":
        return read_microphone(rate)
    if source == "-":
        return _read_stdin(rate, kind, note)
    from ..export.live.receiver import open_receiver

    return read_websocket(stack.enter_context(open_receiver(source, note)), kind, put, note=note)


def _read_stdin(rate: int, kind: str, note: Callable[[str], None]) -> Iterator[Any]:
    """Yield samples of standard input. It is read without a buffer: the buffer's lock could abort the program at its end."""
    from ..audio.live_sources import read_pcm

    with open(sys.stdin.fileno(), "rb", buffering=0, closefd=False) as file:  # a descriptor
        yield from read_pcm(file, rate, kind, note=note)


def _pieces_of_file(stack: ExitStack, path: str, transcript: File | None, language: str, unpaced: bool) -> Iterator[Speech]:
    from ..audio.live_sources import PIECE, wait_for_each
    from ..audio.speech import open_speech
    from ..audio.speech_chunks import speech_chunks
    from ..face.graphemes import note_unread_words

    speech = stack.enter_context(open_speech(path, transcript=transcript, language=language))
    note_unread_words(speech.words)
    pieces = (piece for block in speech_chunks(speech) for piece in block.chunks(PIECE))
    return pieces if unpaced else wait_for_each(pieces)


def _open_control(stack: ExitStack, address: str, controls: LiveControls, tell: Callable[[str], None]) -> None:
    """Start to read the messages of ``--control``, besides those of the input.

    Raises:
        InputError: no server answers at the address, or we cannot listen on it.
    """
    messages: Iterable[str | bytes]
    if address == "-":
        from ..audio.live_sources import read_lines

        messages = read_lines(sys.stdin.fileno())
    else:
        from ..export.live.receiver import open_receiver

        messages = stack.enter_context(open_receiver(address, lambda text: tell(f"note: {text}")))
    _start(_collect, messages, controls)


def _start(collect: Callable[..., None], *arguments: object) -> None:
    """Call a function in a thread that ends with the program."""
    threading.Thread(target=collect, args=arguments, name=f"cospeech {collect.__name__}", daemon=True).start()


def _collect(messages: Iterable[str | bytes], controls: LiveControls) -> None:
    for message in messages:
        if message != b"":  # a client has come
            controls.put(message)


def _collect_words(path: str, words: WaitingWords, tell: Callable[[str], None]) -> None:
    """Read words from the lines of a file, or of a named pipe. A pipe is opened again after each writer."""
    from ..audio.live_sources import read_lines
    from ..audio.transcripts import settle
    from ..audio.word_json import read_documents

    while True:
        lines = filter(bytes.strip, read_lines(path, _WORDS_LINE))
        documents = map(_parse_words, lines)  # `map` goes on after an error, a generator would not
        while True:
            try:
                for entry in read_documents(documents):
                    words.put(settle([entry]))
                break
            except InputError as error:
                tell(f"words: {error}")
        if not Path(path).is_fifo():
            return


def _parse_words(line: bytes) -> object:
    return parse_json(line.decode("utf-8", "replace"), "a line", TRANSCRIPT_JSON_VALUES)
