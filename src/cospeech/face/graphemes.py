"""English spelling → rough phones: enough to choose mouth shapes, not to pronounce.

Letter-to-sound rules in the manner of Elovitz et al. 1976 (NRL Report 7948), written anew and far fewer: at each place the
first rule whose letters and contexts match gives its phones. Vowels that look alike on the lips are not told apart.
"""

from __future__ import annotations

import re
import unicodedata
from functools import lru_cache

__all__ = ["graphemes_to_phones"]

_WHOLE_WORDS = {  # ours: frequent words that the rules below would misread
    "a": "ax", "the": "dh ax", "of": "ah v", "to": "t uw", "do": "d uw", "who": "hh uw", "two": "t uw", "one": "w ah n",
    "once": "w ah n s", "was": "w ah z", "were": "w er", "are": "aa r", "you": "y uw", "your": "y ao r",
    "said": "s eh d", "says": "s eh z", "have": "hh ae v", "give": "g ih v", "live": "l ih v", "some": "s ah m",
    "come": "k ah m", "done": "d ah n", "none": "n ah n", "gone": "g ao n", "love": "l ah v", "move": "m uw v",
    "above": "ax b ah v", "what": "w ah t", "there": "dh eh r", "their": "dh eh r", "where": "w eh r", "they": "dh ey",
    "people": "p iy p ax l", "women": "w ih m ax n", "woman": "w uh m ax n", "people's": "p iy p ax l z",
    "could": "k uh d", "would": "w uh d", "should": "sh uh d", "any": "eh n iy", "many": "m eh n iy", "been": "b ih n",
    "does": "d ah z", "goes": "g ow z", "very": "v eh r iy", "every": "eh v r iy", "other": "ah dh er",
    "mother": "m ah dh er", "nothing": "n ah th ih ng", "only": "ow n l iy", "both": "b ow th", "most": "m ow s t",
    "eye": "ay", "eyes": "ay z", "i": "ay", "i'm": "ay m", "though": "dh ow", "through": "th r uw",
    "thought": "th ao t", "enough": "ih n ah f", "rough": "r ah f", "tough": "t ah f", "laugh": "l ae f",
    "cough": "k ao f", "thorough": "th er ow", "into": "ih n t uw", "today": "t ax d ey", "world": "w er l d",
    "word": "w er d", "work": "w er k", "heart": "hh aa r t", "great": "g r ey t", "put": "p uh t", "full": "f uh l",
    "sure": "sh uh r", "sugar": "sh uh g er", "island": "ay l ax n d", "hour": "aw er", "honest": "aa n ax s t",
    "business": "b ih z n ax s", "busy": "b ih z iy", "friend": "f r eh n d", "again": "ax g eh n",
    "against": "ax g eh n s t", "us": "ah s", "is": "ih z", "his": "hh ih z", "as": "ae z", "has": "hh ae z",
    "because": "b ih k ah z", "this": "dh ih s", "no": "n ow", "so": "s ow", "go": "g ow", "ago": "ax g ow",
    "me": "m iy", "we": "w iy", "he": "hh iy", "she": "sh iy", "be": "b iy", "my": "m ay", "by": "b ay", "why": "w ay",
    "try": "t r ay", "b": "b iy", "c": "s iy", "d": "d iy", "e": "iy", "f": "eh f", "g": "jh iy", "h": "ey ch",
    "j": "jh ey", "k": "k ey", "l": "eh l", "m": "eh m", "n": "eh n", "o": "ow", "p": "p iy", "q": "k y uw",
    "r": "aa r", "s": "eh s", "t": "t iy", "u": "y uw", "v": "v iy", "w": "d ah b ax l y uw", "x": "eh k s",
    "y": "w ay", "z": "z iy", "0": "z ih r ow", "2": "t uw", "1": "w ah n", "3": "th r iy", "4": "f ao r",
    "5": "f ay v", "6": "s ih k s", "7": "s eh v ax n", "8": "ey t", "9": "n ay n",
}  # fmt: skip

_CONSONANT = "[bcdfghjklmnpqrstvwxz]"
_RULES = [  # (letters, phones, must match before, must match after); "#" and "$" are the ends of the word
    ("tion", "sh ax n", "[^s#]", ""), ("ch", "k", "#|s|te|psy", "ara|or|em|ni|no|ool"), ("beau", "b y uw", "", "t"),
    ("a", "ey", "", "tion|[bd]les?$|cious|sis"), ("ou", "ah", "", "ch|ble|ple|ntry|ng|sin"),
    ("ow", "ow", "[aeiou][a-z]+", "s?$"), ("sion", "zh ax n", "[aeiour]", ""), ("sion", "sh ax n", "", ""),
    ("ssion", "sh ax n", "", ""), ("cious", "sh ax s", "", ""), ("tious", "sh ax s", "", ""),
    ("ture", "ch er", "[^#]", ""), ("cial", "sh ax l", "", ""), ("tial", "sh ax l", "", ""),
    ("cian", "sh ax n", "", ""), ("sure", "zh er", "[aeiou]", ""), ("eigh", "ey", "", ""), ("aigh", "ey", "", ""),
    ("augh", "ao", "", ""), ("ough", "ow", "", "$"), ("ough", "ao", "", ""), ("igh", "ay", "", ""),
    ("tch", "ch", "", ""), ("dge", "jh", "", ""), ("sch", "s k", "", ""), ("chr", "k r", "", ""),
    ("chine", "sh iy n", "", "s?$"), ("ch", "ch", "", ""), ("sh", "sh", "", ""), ("ph", "f", "", ""),
    ("th", "dh", "", "(e|er|ers|ing)$"), ("th", "dh", "#", "(is|at|.se|em|en|an)$"), ("th", "th", "", ""),
    ("wh", "hh", "", "o[^a-z]?"), ("wh", "w", "", ""), ("gh", "g", "#", ""), ("gh", "", "", ""), ("ck", "k", "", ""),
    ("qu", "k w", "", ""), ("kn", "n", "#", ""), ("gn", "n", "#", ""), ("gn", "n", "", "$"), ("wr", "r", "#", ""),
    ("ps", "s", "#", ""), ("mb", "m", "", "s?$"), ("mn", "m", "", "$"), ("sc", "s", "", "[eiy]"),
    ("ng", "ng", "", "(s|ed|ing|er)?$"), ("ng", "n jh", "", "[eiy]"), ("ng", "ng g", "", ""), ("nk", "ng k", "", ""),
    ("les", "ax l z", "[bcdfgkpstz]", "$"), ("fly", "f l ay", "", "$"), ("le", "ax l", "[bcdfgkpstz]", "$"),
    ("led", "ax l d", "[bcdfgkpstz]", "$"), ("ed", "ax d", "[td]", "$"), ("ed", "t", "[pkfsxc]|[sc]h", "$"),
    ("ed", "d", "[a-z]{2}", "$"), ("es", "ax z", "[sxz]|[sc]h", "$"), ("es", "z", "[a-z]{2}", "$"),
    ("ly", "l iy", "", "$"), ("ment", "m ax n t", "", "s?$"), ("ness", "n ax s", "", "$"),
    ("ing", "ih ng", "[a-z]{2}", "s?$"), ("ous", "ax s", "", "$"), ("ful", "f ax l", "", "$"), ("eer", "ih r", "", ""),
    ("ear", "er", "", "[nlt]"), ("ear", "ih r", "", ""), ("air", "eh r", "", ""), ("are", "eh r", "", "s?$"),
    ("ere", "ih r", "", "$"), ("ire", "ay r", "", ""), ("ore", "ao r", "", ""), ("our", "ao r", "", ""),
    ("oor", "ao r", "", ""), ("oar", "ao r", "", ""), ("ure", "uh r", "", ""), ("wor", "w er", "", _CONSONANT),
    ("war", "w ao r", "", ""), ("wa", "w aa", "", "[tsn]"), ("err", "eh r", "", "[aeiouy]"),
    ("ar", "eh r", "", "r[aeiy]"), ("ar", "aa r", "", ""), ("er", "er", "", ""), ("ir", "er", "", ""),
    ("ur", "er", "", ""), ("or", "er", "[t]", "s?$"), ("or", "ao r", "", ""), ("ee", "iy", "", ""),
    ("ea", "eh", "", "(d|th|lth|sur)"), ("ea", "iy", "", ""), ("eau", "ow", "", ""), ("ei", "iy", "c", ""),
    ("ei", "ey", "", ""), ("ey", "iy", "[a-z]{2}", "s?$"), ("ey", "ey", "", ""), ("eu", "y uw", "", ""),
    ("ew", "uw", "", ""), ("ai", "ey", "", ""), ("ay", "ey", "", ""), ("au", "ao", "", ""), ("aw", "ao", "", ""),
    ("al", "ao", "", "k"), ("all", "ao l", "", "s?$"), ("al", "ao l", "#", "[sdmrt]"), ("ie", "ay", "#.", "[sd]?$"),
    ("ies", "iy z", "", "$"), ("ied", "iy d", "", "$"), ("ie", "iy", "", ""), ("io", "iy ow", "", ""),
    ("ia", "iy ax", "", ""), ("oo", "uh", "", "[kd]"), ("oo", "uw", "", ""), ("oa", "ow", "", ""), ("oe", "ow", "", ""),
    ("oi", "oy", "", ""), ("oy", "oy", "", ""), ("old", "ow l d", "", ""), ("ould", "uh d", "", ""),
    ("ou", "aw", "", ""), ("ow", "ow", "[lrn]|sh|kn", "n?s?$"), ("ow", "aw", "", ""), ("ue", "uw", "[rl]", "s?$"),
    ("ue", "", "g", "$"), ("ue", "y uw", "", "s?$"), ("ui", "uw", "[rlj]", ""), ("ui", "ih", "", "ld"),
    ("uy", "ay", "", ""), ("ind", "ay n d", "", "s?$"), ("ild", "ay l d", "", "$"), ("ign", "ay n", "", ""),
    ("a", "ey", "", _CONSONANT + "(e|es|ed|ing)$"), ("e", "iy", "", "[^vrwx](e|es)$"),
    ("i", "ay", "", _CONSONANT + "(e|es|ed|ing)$"), ("o", "ow", "", _CONSONANT + "(e|es|ed|ing)$"),
    ("u", "uw", "[rlj]", _CONSONANT + "(e|es|ed|ing)$"), ("u", "y uw", "", _CONSONANT + "(e|es|ed|ing)$"),
    ("a", "ax", "[a-z]{2}", "$"), ("a", "ax", "[a-z]{2}", "(l|n|nt|nce)$"), ("a", "ax", "#", "(b|c|g|l|w|r)[aeiou]"),
    ("a", "ae", "", ""), ("e", "iy", "#[^aeiou]?", "$"), ("e", "", "", "$"),
    ("e", "ax", "[a-z]{2}", "(n|nt|nce|l|t|m)$"), ("e", "eh", "", ""), ("i", "iy", "", "[aou$]"), ("i", "ih", "", ""),
    ("o", "ow", "", "$"), ("o", "ax", "[a-z]{2}", "(n|m)$"), ("o", "ao", "", "(ng|ff|st|ss)"), ("o", "aa", "", ""),
    ("u", "uw", "[rljs]", "[^aeiou][aeiou]"), ("u", "uh", "[pbf]", "(l|sh)"), ("u", "ah", "", ""), ("y", "y", "#", ""),
    ("y", "ay", "#[^aeiou]?[^aeiou]?", "$"), ("y", "iy", "", "$"), ("y", "ih", "", ""), ("c", "s", "", "[eiy]"),
    ("c", "k", "", ""), ("g", "jh", "", "[eiy]"), ("g", "g", "", ""), ("j", "jh", "", ""), ("x", "z", "#", ""),
    ("x", "k s", "", ""), ("s", "z", "[aeiou]|#..*[bdgvmnlr]", "$"), ("s", "z", "[aeiou]", "[aeiou]"),
    ("s", "s", "", ""), ("h", "hh", "", "[aeiouy]"), ("h", "", "", ""), ("q", "k", "", ""), ("w", "w", "", "[aeiouy]"),
    ("w", "", "", ""), *((letter, letter, "", "") for letter in "bdfklmnprtvz"),
]  # fmt: skip

_LONGEST, _WHOLE = (
    64,
    256,
)  # letters of a part, and of a word; what is longer is none, and must not take long
_BY_LETTER: dict[str, list[tuple[str, tuple[str, ...], re.Pattern[str], re.Pattern[str]]]] = {}
for _letters, _phones, _before, _after in sorted(_RULES, key=lambda rule: -len(rule[0])):
    _compiled = (re.compile(f"(?:{_before})$"), re.compile(_after))
    _BY_LETTER.setdefault(_letters[0], []).append((_letters, tuple(_phones.split()), *_compiled))


def _spell(word: str) -> list[str]:
    phones: list[str] = []
    at = 0
    while at < len(word):
        if at and word[at] == word[at - 1] and word[at] not in "aeiou":  # a doubled consonant sounds once
            at += 1
            continue
        sofar = ("#" + word[:at])[-12:]
        for letters, sounds, before, after in _BY_LETTER.get(word[at], ()):
            # "#" stands before the word so that a left context can ask for its beginning
            if word.startswith(letters, at) and after.match(word, at + len(letters)) and before.search(sofar):
                phones += sounds
                at += len(letters)
                break
        else:
            at += 1
    return phones


@lru_cache(maxsize=4096)
def graphemes_to_phones(word: str) -> tuple[str, ...]:
    """Rough phones of one written word, as lower-case ARPAbet names without stress.

    Diacritics are dropped; digits are read one by one; a word in another alphabet gives ``()``.

    >>> graphemes_to_phones("bishop")
    ('b', 'ih', 'sh', 'aa', 'p')
    >>> graphemes_to_phones("слово")
    ()
    """
    plain = unicodedata.normalize("NFKD", word[:_WHOLE].casefold()).replace("’", "'")
    phones: list[str] = []
    for part in re.findall(r"[a-z']+|[0-9]", plain):
        part = part.strip("'")[:_LONGEST]
        known = _WHOLE_WORDS.get(part)
        phones += known.split() if known else _spell(part.replace("'", ""))
    return tuple(phones)
