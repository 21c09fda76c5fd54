"""Words that call for a gesture of their own: a small English lexicon of deictic, iconic and metaphoric gestures.

The sets are ours. A word's form comes with a semantic score (`Form.score`), so that a corpus made with the rule-based model can
carry the annotation that SRGR needs. Other languages go without: their gestures follow the sound alone.
"""

from __future__ import annotations

import re

__all__ = ["LEXICON", "form_for"]

_SETS = {
    "me": "i me my mine myself i'm i've i'll i'd",
    "you": "you your yours yourself you're you've you'll",
    "we": "we us our ours ourselves together we're we've we'll everyone everybody people",
    "here": "here this these",
    "there": "there that those far away outside over yonder distant abroad",
    "big": "big huge large great enormous giant massive wide vast long whole widest biggest largest bigger immense broad",
    "small": "small little tiny short narrow slight minor bit detail precisely exactly smallest thin subtle",
    "high": "high tall top above upper sky tower",
    "low": "low below under beneath bottom ground floor down",
    "rise": "up rise rises rising grow grows growing growth increase increases raise lift climb more better improve",
    "fall": "fall falls falling drop drops decrease decline lose lost sink reduce less worse",
    "no": "no not never don't doesn't didn't won't can't cannot isn't aren't wasn't neither nor without impossible",
    "stop": "stop wait hold enough careful against refuse",
    "all": "all every everything always entire world across around total completely everywhere",
    "nothing": "nothing none nobody empty gone zero nowhere",
    "one": "one first once single only",
    "two": "two second twice both pair double",
    "three": "three third",
    "many": "many several lots hundred hundreds thousand thousands million four five six seven eight nine ten dozens",
    "now": "now today immediately moment currently",
    "past": "before past yesterday ago behind back earlier previous formerly history",
    "future": "after tomorrow next future later ahead forward soon will become",
    "between": "between or either other versus difference compare exchange and/or",
    "think": "think thought know idea remember understand mind wonder believe imagine",
    "heart": "love feel heart thank thanks grateful sorry please happy hope friend friends",
    "wave": "hello hi goodbye bye welcome hey",
}
# Words so common that acting each one out would look like charades: used only with this chance (ours).
_FREQUENT = {
    "i": 0.35,
    "my": 0.3,
    "me": 0.5,
    "i'm": 0.4,
    "you": 0.4,
    "your": 0.3,
    "we": 0.45,
    "our": 0.3,
    "this": 0.25,
    "that": 0.12,
    "these": 0.25,
    "there": 0.3,
    "not": 0.5,
    "no": 0.7,
    "one": 0.5,
    "or": 0.2,
    "other": 0.25,
    "will": 0.12,
    "up": 0.4,
    "down": 0.5,
    "all": 0.7,
    "more": 0.4,
    "back": 0.4,
    "over": 0.3,
    "only": 0.4,
    "know": 0.4,
    "think": 0.5,
    "great": 0.5,
    "bit": 0.5,
    "people": 0.4,
    "long": 0.6,
}

LEXICON: dict[str, str] = {word: form for form, words in _SETS.items() for word in words.split()}
"""Word in lower case → name in `repertoire.LEXICAL_FORMS`."""

_TRIM = re.compile(r"^[^\w']++|(?<![^\w'])[^\w']++$")  # signs at either end, each run of them looked at once


def form_for(word: str, language: str = "") -> tuple[str, float] | None:
    """Form and chance (0 … 1) for a word, or None.

    Args:
        word: as it is written.
        language: of the word, see `cospeech.audio.languages`; without it, the word is English.

    >>> form_for("Huge!"), form_for("will", "de")
    (('big', 1.0), None)
    >>> form_for("table") is None
    True
    """
    if language not in ("", "en"):
        return None
    key = _TRIM.sub("", word).lower().replace("’", "'")
    form = LEXICON.get(key)
    return None if form is None else (form, _FREQUENT.get(key, 1.0))
