"""Where `cospeech stream` hears from: the sound, and the messages that steer."""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack
from typing import TYPE_CHECKING, Any

from ..errors import InputError
from ..runtime.live_controls import LiveControls

if TYPE_CHECKING:
    from ..audio.speech import Speech
    from ..audio.waiting_sound import WaitingSound

__all__ = ["check_sources", "is_live", "open_control", "open_pieces"]

_RATES = (8_000, 192_000)  # samples per second of raw sound that can be said


def check_sources(source: str, control: str | None, transcript: str | None, rate: int, samples: str) -> None:
    """See that what was asked for goes together.

    Raises:
        InputError: it does not.
    """
    from ..audio.live_sources import FORMATS
    from ..export.live.addresses import SOURCES, scheme_of

    addresses = ", ".join(f"{scheme}://HOST:PORT" for scheme in SOURCES)
    if scheme_of(source) and not is_live(source):
        raise InputError(f"cannot hear sound from {source!r}", f"known: mic, a sound file, -, {addresses}")
    if control is not None and control != "-" and scheme_of(control) not in SOURCES:
        raise InputError(f"cannot hear messages from {control!r}", f"known: -, {addresses}")
    if samples not in FORMATS:
        raise InputError(f"samples of kind {samples!r}", f"known: {', '.join(FORMATS)}")
    if control == source:
        raise InputError(f"--control and --input are both {control!r}", "a WebSocket that sends sound may send messages, too")
    if not _RATES[0] <= rate <= _RATES[1]:
        raise InputError(f"{rate} samples per second", f"{_RATES[0]} … {_RATES[1]}")
    if transcript is not None and is_live(source):
        raise InputError("a transcript of live speech", "leave out --transcript, or give a sound file")


def is_live(source: str) -> bool:
    """Whether somebody speaks now; else it is a sound file."""
    from ..export.live.addresses import SOURCES, scheme_of

    return source in ("mic", "-") or scheme_of(source) in SOURCES


def open_pieces(
    stack: ExitStack, source: str, transcript: str | None, *, rate: int, kind: str, slack: float, unpaced: bool,
    tell: Callable[[str], None],
) -> tuple[Iterator[Speech], LiveControls]:  # fmt: skip
    """The speech of a source, piece by piece, and the messages that steer; what it opens is closed with ``stack``.

    Args:
        slack: seconds that live sound may be late.
        unpaced: read a file as fast as it can be played.
        tell: told what is wrong with a message or with raw samples.

    Raises:
        InputError: the source cannot be opened.
    """
    from ..audio.live_sources import BEHIND, pace_pieces
    from ..audio.waiting_sound import WaitingSound

    waiting = WaitingSound(round(BEHIND * rate))
    controls = LiveControls(waiting, lambda error: tell(f"control: {error}"))
    if not is_live(source):
        return _pieces_of_file(stack, source, transcript, unpaced), controls
    blocks = _open_blocks(stack, source, rate, kind, controls, tell)
    return _see_that_sound_comes(pace_pieces(blocks, rate, slack=slack, waiting=waiting), waiting), controls


def _see_that_sound_comes(pieces: Iterator[Speech], waiting: WaitingSound) -> Iterator[Speech]:
    """The pieces; an error at their end if no sample came."""
    yield from pieces
    if not waiting.received:
        raise InputError("the input ended without sound", "send samples to it before you end it")


def _open_blocks(
    stack: ExitStack, source: str, rate: int, kind: str, controls: LiveControls, tell: Callable[[str], None]
) -> Iterator[Any]:
    """Samples as they come; texts of a WebSocket are messages that steer."""
    from ..audio.live_sources import read_microphone, read_websocket

    def note(text: str) -> None:
        tell(f"note: {text}")

    if source == "mic":
        return read_microphone(rate)
    if source == "-":
        return _read_stdin(rate, kind, note)
    from ..export.live.receiver import open_receiver

    return read_websocket(stack.enter_context(open_receiver(source, note)), kind, controls.put, note=note)


def _read_stdin(rate: int, kind: str, note: Callable[[str], None]) -> Iterator[Any]:
    """Samples of standard input, without its buffer, whose lock would abort the program if it ends while nothing comes."""
    from ..audio.live_sources import read_pcm

    with open(sys.stdin.fileno(), "rb", buffering=0, closefd=False) as file:  # a descriptor
        yield from read_pcm(file, rate, kind, note=note)


def _pieces_of_file(stack: ExitStack, path: str, transcript: str | None, unpaced: bool) -> Iterator[Speech]:
    from ..audio.live_sources import PIECE, wait_for_each
    from ..audio.speech import open_speech
    from ..audio.speech_chunks import speech_chunks

    opened = stack.enter_context(open_speech(path, transcript=transcript))
    pieces = (piece for block in speech_chunks(opened) for piece in block.chunks(PIECE))
    return pieces if unpaced else wait_for_each(pieces)


def open_control(stack: ExitStack, address: str, controls: LiveControls, tell: Callable[[str], None]) -> None:
    """Hear the messages of ``--control``, besides those of the input.

    Raises:
        InputError: nobody answers at the address, or it cannot be listened on.
    """
    messages: Iterable[str | bytes]
    if address == "-":
        from ..audio.live_sources import read_lines

        messages = read_lines(sys.stdin.fileno())
    else:
        from ..export.live.receiver import open_receiver

        messages = stack.enter_context(open_receiver(address, lambda text: tell(f"note: {text}")))
    threading.Thread(target=_collect, args=(messages, controls), name="cospeech control", daemon=True).start()


def _collect(messages: Iterable[str | bytes], controls: LiveControls) -> None:
    """In a thread."""
    for message in messages:
        controls.put(message)
