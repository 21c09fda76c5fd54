"""Devanagari, whose consonants bring a vowel with them; Arabic and Hebrew, which seldom write short vowels.

Between two consonants of Arabic or Hebrew stands a short vowel that could be any: most of them have one.
"""

from __future__ import annotations

from .rules import Rule, compile_spelling, read_plain

__all__ = ["ARABIC", "DEVANAGARI", "HEBREW"]

_DEVANAGARI = {
    "क": "k", "ख": "k", "ग": "g", "घ": "g", "ङ": "ng", "च": "ch", "छ": "ch", "ज": "jh", "झ": "jh", "ञ": "n y",
    "ट": "t", "ठ": "t",
    "ड": "d", "ढ": "d", "ण": "n", "त": "t", "थ": "t", "द": "d", "ध": "d", "न": "n", "प": "p", "फ": "p", "ब": "b",
    "भ": "b", "म": "m",
    "य": "y", "र": "d", "ल": "l", "ळ": "l", "व": "v", "श": "sh", "ष": "sh", "स": "s", "ह": "hh", "ज़": "z", "फ़": "f", "क़": "k",
    "ख़": "hh", "ग़": "g", "ड़": "d", "ढ़": "d",
}  # fmt: skip
_SIGNS = "ािीुूृेैोौॅॉ"


def _devanagari_rules() -> list[Rule]:
    rules = read_plain(
        "अ=ah आ=aa इ=ih ई=iy उ=uh ऊ=uw ऋ=d+ih ए=eh ऐ=eh ओ=ao औ=ao ऑ=ao ा=aa ि=ih ी=iy ु=uh ू=uw ृ=d+ih े=eh ै=eh ो=ao ौ=ao "
        "ॅ=eh ॉ=ao ्= ़= ः=hh ँ="
    )
    rules += [("ं", "m", "", "[पफबभम]"), ("ं", "n", "", "")]
    for letters, phones in _DEVANAGARI.items():
        rules += [(letters, phones, "", f"़?[{_SIGNS}्]"), (letters, phones, "[^#]", "$"), (letters, f"{phones} ah", "", "")]
    return rules


DEVANAGARI = compile_spelling(
    _devanagari_rules(), digits="शून्य एक दो तीन चार पाँच छह सात आठ नौ", whole={"मैं": "m eh", "में": "m eh", "हैं": "hh eh"}
)


def _between(plain: str) -> list[Rule]:
    """Rules of consonants, with a short vowel before the next consonant."""
    rules = read_plain(plain)
    letters = "".join(rule[0] for rule in rules)
    return [(rule[0], f"{rule[1]} ax", "", f"[{letters}]") for rule in rules] + rules


ARABIC = compile_spelling(
    [
        ("و", "w", "#", ""), ("و", "w", "", "[اىةَُِ]"), ("و", "w", "[اأى]", ""), ("ي", "y", "#", ""), ("ي", "y", "", "[اىةَُِ]"),
        ("ی", "y", "", "[ا]"), ("ال", "ah l", "#", ""), *_between(
            "ب=b ت=t ث=th ج=jh ح=hh خ=hh د=d ذ=dh ر=d ز=z س=s ش=sh ص=s ض=d ط=t ظ=dh غ=g ف=f ق=k ك=k ل=l م=m ن=n ه=hh "
            "پ=p چ=ch ژ=zh گ=g "
            "ک=k ہ=hh ھ=hh ٹ=t ڈ=d ڑ=d"
        ), *read_plain(
            "ا=aa أ=aa إ=ih آ=aa ء= ؤ= ئ= ى=aa ة=ah ع=aa و=uw ي=iy ی=iy ے=eh ں=n ـ= َ=ah ُ=uh ِ=ih "
            "ً=ah+n ٌ=uh+n ٍ=ih+n ّ= ْ="
        ),
    ],
    digits="صفر واحد اثنان ثلاثة أربعة خمسة ستة سبعة ثمانية تسعة", vowels="",
)  # fmt: skip

_DAGESH = "[ְ-ֻ]*ּ"  # Unicode puts the point of a vowel before it
HEBREW = compile_spelling(
    [
        ("ב", "b", "", _DAGESH), ("פ", "p", "", _DAGESH), ("פ", "f", "", "[ְ-ֻ]"), ("וּ", "uw", "", ""), ("וֹ", "ao",
        "", ""), ("שׁ", "sh", "", ""), ("שׂ", "s", "", ""),
        ("וו", "v", "", ""), ("ו", "v", "#", ""), ("י", "y", "#", ""), ("ב", "b", "#", ""), ("ה", "aa", "[^#]", "$"),
        *_between("ב=v ג=g ד=d ז=z ח=hh ט=t כ=k ך=hh ל=l מ=m ם=m נ=n ן=n ס=s פ=p ף=f צ=t+s ץ=t+s ק=k ר=g ש=sh ת=t ה=hh"),
        *read_plain("א=aa ע=aa ו=ao י=iy ָ=aa ַ=aa ֶ=eh ֵ=eh ִ=iy ֹ=ao ֻ=uw ְ= ֲ=aa ֱ=eh ֳ=ao ּ= ׁ= ׂ="),
    ],
    whole={"אבא": "aa b aa", "לא": "l ao", "אבל": "aa v aa l", "טוב": "t ao v", "שלי": "sh eh l iy"}, vowels="",
    digits="אפס אחת שתיים שלוש ארבע חמש שש שבע שמונה תשע",
)  # fmt: skip
