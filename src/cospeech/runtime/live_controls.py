"""Messages that steer a live session: each waits for a piece of sound, and an interruption drops the sound before it."""

from __future__ import annotations

import re
from collections.abc import Callable
from queue import SimpleQueue
from typing import TYPE_CHECKING

from ..errors import InputError

if TYPE_CHECKING:
    from ..audio.speech import Speech
    from ..audio.waiting_sound import WaitingSound
    from ..audio.waiting_words import WaitingWords
    from .live_session import LiveSession

__all__ = ["LiveControls"]

_INTERRUPTS = re.compile(r'"interrupt"\s*:')  # the key; the word may be among those that are spoken


class LiveControls:
    """Messages in the order in which they came, each with the place in the sound at which it came.

    Args:
        sound: what waits to be heard; an interruption drops it.
        tell: is called with the error of a message that makes no sense.
        words: where words wait; None where they do not come with the sound.
    """

    def __init__(self, sound: WaitingSound, tell: Callable[[InputError], object], words: WaitingWords | None = None) -> None:
        self._sound, self._tell, self._words = sound, tell, words
        self._messages: SimpleQueue[tuple[str | bytes, int]] = SimpleQueue()

    def put(self, message: str | bytes) -> bool:
        """Add a message; any thread may. Returns whether the sound before it is void: it interrupts."""
        self._messages.put((message, self._sound.received))
        return _INTERRUPTS.search(message if isinstance(message, str) else message.decode("utf-8", "replace")) is not None

    def steer(self, session: LiveSession, piece: Speech) -> Speech:
        """Do what the messages say that have come; the stream goes on after one that makes no sense.

        Returns:
            The piece that is heard now, silent where an interruption dropped it, with the words that start in it.
        """
        from .live_control import apply_control

        while not self._messages.empty():
            message, place = self._messages.get()
            try:
                keys = apply_control(session, message, put_words=self._word_putter(place))
            except InputError as error:
                self._tell(error)
                continue
            if "interrupt" in keys:
                self._sound.drop(place)
                piece = self._sound.mute_piece(piece)
        return piece if self._words is None else self._words.join(piece)

    def _word_putter(self, place: int) -> Callable[[object], None] | None:
        """A function that takes the words of a message; their times count from this place in the sound."""
        from ..audio.transcripts import settle
        from ..audio.word_json import read_documents

        if (words := self._words) is None:
            return None

        def put(value: object) -> None:
            entries = [*read_documents(iter([value]))]
            if value and not entries:
                raise InputError("no word of the message has a time", "give each word start and end, seconds")
            words.put(settle(entries), place)

        return put
