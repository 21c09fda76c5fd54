"""Kana, whose signs are syllables, and Hangul, whose syllables are taken apart by arithmetic.

Chinese signs do not say how they sound; a table of them would be larger than the rest of the program.
"""

from __future__ import annotations

from .rules import Rule, compile_spelling

__all__ = ["KANA", "spell_hangul", "to_katakana"]

_VOWELS = ("aa", "iy", "uh", "eh", "ao")  # of Japanese; u is hardly rounded
_ROWS = {
    "": "アイウエオ", "k": "カキクケコ", "g": "ガギグゲゴ", "s": "サシスセソ", "z": "ザジズゼゾ", "t": "タチツテト",
    "d": "ダヂヅデド", "n": "ナニヌネノ", "hh": "ハヒフヘホ", "b": "バビブベボ", "p": "パピプペポ", "m": "マミムメモ",
    "y": "ヤ・ユ・ヨ", "d ": "ラリルレロ", "w": "ワヰ・ヱヲ",
}  # fmt: skip
_ODD = {"シ": "sh", "ジ": "jh", "チ": "ch", "ヂ": "jh", "ツ": "t s", "ヅ": "z", "フ": "hh w", "ヲ": "", "ヰ": "", "ヱ": ""}
_SMALL = {"ャ": "y aa", "ュ": "y uh", "ョ": "y ao"}
_SMALL_VOWELS = dict(zip("ァィゥェォ", _VOWELS, strict=True))


def _kana_rules() -> list[Rule]:
    rules: list[Rule] = [("ン", "m", "", "[バビブベボパピプペポマミムメモ]"), ("ン", "n", "", ""), ("ッ", "", "", "")]
    for row, signs in _ROWS.items():
        for sign, vowel in zip(signs, _VOWELS, strict=True):
            if sign == "・":
                continue
            consonant = _ODD.get(sign, row.strip())
            rules.append((sign, f"{consonant} {vowel}", "", ""))
            glides = {
                small: phones.split()[1] if consonant in ("sh", "jh", "ch") else phones for small, phones in _SMALL.items()
            }
            rules += [(sign + small, f"{consonant} {glide}", "", "") for small, glide in glides.items() if vowel == "iy"]
            rules += [
                (sign + small, f"{'w' if sign == 'ウ' else consonant} {own}", "", "") for small, own in _SMALL_VOWELS.items()
            ]
    rules += [("ヴ" + small, f"b {vowel}", "", "") for small, vowel in _SMALL_VOWELS.items()] + [("ヴ", "b uh", "", "")]
    rules += [(small, phones, "", "") for small, phones in (_SMALL | _SMALL_VOWELS).items()]
    for k, vowel in enumerate(_VOWELS):  # a bar makes the vowel before it longer
        before = "".join(signs[k] for signs in _ROWS.values()).replace("・", "")
        small = {0: "ャァ", 1: "ィ", 2: "ュゥ", 3: "ェ", 4: "ョォ"}[k]
        rules.append(("ー", vowel, f"[{before}{small}]", ""))
    return rules


KANA = compile_spelling(
    _kana_rules(),
    digits="ゼロ イチ ニ サン ヨン ゴ ロク ナナ ハチ キュウ",
    vowels="".join("".join(row) for row in _ROWS.values()),
)
_HIRAGANA = {ord("ぁ") + k: ord("ァ") + k for k in range(86)}


def to_katakana(text: str) -> str:
    """Hiragana as katakana; all else stays.

    >>> to_katakana("ぱパ-")
    'パパ-'
    """
    return text.translate(_HIRAGANA)


# Order of Unicode: 0xAC00 + (initial · 21 + vowel) · 28 + final (The Unicode Standard, section 3.12)
_INITIALS = ("k", "k", "n", "d", "t", "d", "m", "b", "p", "s", "s", "-", "jh", "jh", "ch", "k", "t", "p", "hh")
_MEDIALS = (
    "aa", "eh", "y aa", "y eh", "ah", "eh", "y ah", "y eh", "ao", "w aa", "w eh", "w eh", "y ao", "uw", "w ah", "w eh", "w iy",
    "y uw", "ih", "ih iy", "iy",
)  # fmt: skip
_FINALS = (
    "-", "k", "k", "k", "n", "n", "n", "t", "l", "k", "m", "l", "l", "l", "p", "l", "m", "p", "p", "t", "t", "ng", "t", "t",
    "k", "t", "p", "t",
)  # fmt: skip
_FIRST_SYLLABLE, _SYLLABLES = 0xAC00, 11_172
_DIGITS = "영일이삼사오육칠팔구"


def spell_hangul(word: str) -> list[str]:
    """The phones of syllables of Hangul; single letters and all other signs have none.

    >>> spell_hangul("밥")
    ['b', 'aa', 'p']
    """
    phones = list[str]()
    for character in word:
        at = ord(_DIGITS[int(character)] if character.isdecimal() else character) - _FIRST_SYLLABLE
        if 0 <= at < _SYLLABLES:
            for part in (_INITIALS[at // 588], _MEDIALS[at % 588 // 28], _FINALS[at % 28]):
                phones += [] if part == "-" else part.split()
    return phones
