"""Messages that steer a live session: JSON objects, one after the other.

{"interrupt": true}
{"emotion": "happiness", "intensity": 1.2}
{"style": "calm"}
{"parts": ["face", "body"]}
{"words": [{"word": "huge", "start": 0.2, "end": 0.6}]}
"""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

from ..errors import InputError
from .live_session import LiveSession

__all__ = ["CONTROLS", "apply_control"]

CONTROLS: dict[str, Callable[[LiveSession, Any], None]] = {
    "style": lambda session, value: session.restyle(value),
    "emotion": lambda session, value: session.set_emotion(value),
    "intensity": lambda session, value: session.set_intensity(value),
    "parts": lambda session, value: session.set_parts(value),
    "interrupt": lambda session, value: session.interrupt(),
}
"""Key → what it does; they are done in this order."""
_LONGEST = 1 << 16  # characters of a message [ours: a thousand words with their times]


def apply_control(session: LiveSession, text: str | bytes, *, put_words: Callable[[object], object] | None = None) -> set[str]:
    """Do what a message says.

    Args:
        session: that it steers.
        text: the message.
        put_words: takes the value of ``words``, where words are wanted; it raises InputError if they are none.

    Returns:
        The keys that it had, of `CONTROLS` and ``words``.

    Raises:
        InputError: it is no message of this kind; what comes before the wrong value is done.
    """
    text = text if isinstance(text, str) else text.decode("utf-8", "replace")
    keys = [*CONTROLS] if put_words is None else [*CONTROLS, "words"]
    try:
        message = json.loads(text) if len(text) <= _LONGEST else None
    except (ValueError, RecursionError):
        message = None
    if not isinstance(message, dict) or not message:
        raise InputError(f"{text.strip()[:60]!r} is no control message", f"a JSON object with some of {', '.join(keys)}")
    for key in message:
        if key == "words" and put_words is None:
            raise InputError("words are not taken here", "words come with raw samples; a sound file has its --transcript")
        if key not in keys:
            raise InputError(f"no control is called {key[:40]!r}", f"known: {', '.join(keys)}")
    _check(message)
    for key, control in CONTROLS.items():
        if key in message:
            control(session, message[key])
    if put_words is not None and "words" in message:
        put_words(message["words"])
    return {*message}


def _check(message: dict[str, Any]) -> None:
    """Kinds of values; what they say is checked by the session."""
    kinds: dict[str, tuple[type, ...]] = {"style": (str,), "emotion": (str,), "intensity": (int, float), "parts": (str, list)}
    for key, value in message.items():
        if key == "interrupt" and value is not True:
            raise InputError(f"interrupt is {str(value)[:40]!r}", "true, or leave it out")
        wrong = key in kinds and (not isinstance(value, kinds[key]) or isinstance(value, bool))
        if wrong or (key == "parts" and isinstance(value, list) and not all(isinstance(part, str) for part in value)):
            raise InputError(f"{key} is {str(value)[:40]!r}", "text" if key != "intensity" else "a number")
