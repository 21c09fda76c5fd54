"""Words that call for a gesture of their own: small lexicons of deictic, iconic and metaphoric gestures.

The sets are ours. A word's form comes with a semantic score (`Form.score`), so that a corpus made with the rule-based model can
carry the annotation that SRGR needs. English has the most; German, French and Spanish have words that mean one thing alone, so
that "morgen" (morning, tomorrow), "personne" and "me" are not among them. Other languages go without: their gestures follow the
sound alone.
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

_OTHERS = {
    "de": {
        "me": "ich mich mir mein meine meinen meiner", "you": "du dich dir dein deine euch euer", "here": "hier",
        "we": "wir uns unser unsere unseren gemeinsam", "there": "dort drüben",
        "big": "groß große großer großes großen größer größte größten riesig riesige riesigen riesengroß enorm gewaltig",
        "small": "klein kleine kleiner kleines kleinen winzig winzige winzigen",
        "no": "nein nicht nie niemals kein keine keinen keiner keinem unmöglich", "all": "alles überall",
        "nothing": "nichts niemand niemanden leer nirgends", "one": "eins erstens", "two": "zwei zweite zweiten beide beiden",
        "three": "drei dritte dritten", "many": "viele hunderte tausende hundert tausend vier fünf sechs zehn",
        "now": "jetzt heute sofort", "past": "gestern früher", "future": "später bald", "heart": "danke dankbar",
        "wave": "hallo tschüss servus willkommen",
    },
    "fr": {
        "me": "je moi mon mes j'ai", "you": "tu toi vous votre vos", "we": "nous notre nos ensemble", "here": "ici",
        "big": "grand grande grands grandes énorme énormes immense immenses gigantesque", "there": "là-bas",
        "small": "petit petite petits petites minuscule minuscules", "no": "non jamais aucun aucune impossible pas",
        "all": "toujours partout tous toutes", "nothing": "rien", "one": "premier première", "two": "deux deuxième",
        "three": "trois troisième", "many": "beaucoup plusieurs cent mille quatre cinq dix", "now": "maintenant aujourd'hui",
        "past": "hier autrefois", "future": "demain bientôt", "heart": "merci", "wave": "bonjour bonsoir salut bienvenue",
    },
    "es": {
        "me": "yo mi mis mí conmigo", "you": "tú usted ustedes ti contigo", "here": "aquí", "there": "allí allá",
        "we": "nosotros nosotras nuestro nuestra nuestros nuestras juntos",
        "big": "grande grandes enorme enormes gigante inmenso inmensa", "small": "pequeño pequeña pequeños pequeñas diminuto",
        "no": "no nunca jamás ningún ninguna imposible", "all": "todo todos todas siempre", "nothing": "nada nadie",
        "one": "primero primera", "two": "dos ambos ambas", "three": "tres tercero tercera",
        "many": "muchos muchas cien mil cuatro cinco diez", "now": "ahora hoy", "past": "ayer", "future": "pronto",
        "heart": "gracias", "wave": "hola adiós bienvenido bienvenidos bienvenida",
    },
}  # fmt: skip
"""Language → form → words, of other languages than English."""
_OTHERS_FREQUENT = {
    "de": {"ich": 0.35, "mich": 0.4, "mir": 0.4, "mein": 0.3, "meine": 0.3, "du": 0.4, "dein": 0.3, "wir": 0.45, "uns": 0.4,
           "hier": 0.3, "nicht": 0.5, "kein": 0.5, "keine": 0.5, "nein": 0.7, "alles": 0.7},
    "fr": {"je": 0.35, "j'ai": 0.3, "moi": 0.5, "mon": 0.3, "mes": 0.3, "tu": 0.4, "vous": 0.4, "votre": 0.3, "nous": 0.45,
           "ici": 0.4, "non": 0.7, "pas": 0.4, "tous": 0.7, "petit": 0.5, "petite": 0.5},
    "es": {"yo": 0.35, "mi": 0.3, "mis": 0.3, "tú": 0.4, "usted": 0.4, "aquí": 0.3, "no": 0.5, "todo": 0.6, "todos": 0.7},
}  # fmt: skip
"""As `_FREQUENT`."""

LEXICON: dict[str, str] = {word: form for form, words in _SETS.items() for word in words.split()}
"""English word in lower case → name in `repertoire.LEXICAL_FORMS`."""
_OF_LANGUAGES = {"": (LEXICON, _FREQUENT), "en": (LEXICON, _FREQUENT)} | {
    code: ({word: form for form, words in sets.items() for word in words.split()}, _OTHERS_FREQUENT[code])
    for code, sets in _OTHERS.items()
}

_TRIM = re.compile(r"^[^\w']++|(?<![^\w'])[^\w']++$")  # signs at either end, each run of them looked at once


def form_for(word: str, language: str = "") -> tuple[str, float] | None:
    """Form and chance (0 … 1) for a word, or None.

    Args:
        word: as it is written.
        language: of the word, see `cospeech.audio.languages`; without it, the word is English.

    >>> form_for("Huge!"), form_for("riesig", "de"), form_for("will", "de")
    (('big', 1.0), ('big', 1.0), None)
    >>> form_for("table") is None
    True
    """
    lexicon, frequent = _OF_LANGUAGES.get(language, ({}, {}))
    key = _TRIM.sub("", word).lower().replace("’", "'")
    form = lexicon.get(key)
    return None if form is None else (form, frequent.get(key, 1.0))
