"""Speech that comes in pieces: a check of each piece, and the motion of a session to all of them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Protocol

from ..audio.speech import Speech
from ..audio.speech_chunks import MOST_AT_ONCE
from ..errors import InputError
from ..motion.motion import Motion

__all__ = ["check_speech", "in_short", "stream_motion"]


def check_speech(speech: object) -> None:
    """Check that an object is speech.

    Raises:
        InputError: it is not a `Speech`.
    """
    if not isinstance(speech, Speech):
        is_path = isinstance(speech, str) or not hasattr(speech, "__len__")
        call = "cospeech.Speech.load('talk.wav')" if is_path else "cospeech.Speech(samples, 24000)"
        raise InputError(f"{type(speech).__name__} where speech belongs", f"{call} makes it")


def in_short(chunk: Speech) -> Iterable[Speech]:
    """A piece of speech as it is; a long one in pieces of eight seconds."""
    return chunk.chunks(MOST_AT_ONCE) if len(chunk) > MOST_AT_ONCE * chunk.rate else [chunk]


class _Pushed(Protocol):
    """The methods of a session that `stream_motion` uses."""

    def push(self, chunk: Speech) -> Iterator[Motion]: ...

    def finish(self) -> Iterator[Motion]: ...


def stream_motion(session: _Pushed, chunks: Iterable[Speech]) -> Iterator[Motion]:
    """The motion of a session to speech that comes in pieces of any size; long ones are split into pieces of eight seconds.

    Raises:
        InputError: one `Speech` in place of several, or something else than speech.
    """
    if isinstance(chunks, Speech):
        raise InputError("stream takes a list of pieces of speech, not one Speech", "stream([speech]), or generate(speech)")
    for chunk in chunks:
        check_speech(chunk)
        for piece in in_short(chunk):
            yield from session.push(piece)
    yield from session.finish()
