"""Other languages in Latin letters: each letter has its most common value, and some languages have rules of their own."""

from __future__ import annotations

from .rules import Rule, compile_spelling, read_plain

__all__ = ["LATIN", "OWN_LATIN"]

_COMMON = [
    ("sh", "sh", "", ""), ("ch", "ch", "", ""), ("ph", "f", "", ""), ("th", "t", "", ""), ("qu", "k v", "", ""),
    ("c", "s", "", "[eiy]"), *read_plain(
        "a=aa e=eh i=iy o=ao u=uw y=iy b=b c=k d=d f=f g=g h=hh j=y k=k l=l m=m n=n p=p q=k r=d s=s t=t v=v w=v x=k+s z=z "
        "š=sh ş=sh ș=sh ś=sh ž=zh ź=zh ż=zh č=ch ć=ch ç=s ñ=n+y ń=n+y ň=n+y ğ= ı=ih ö=ao ő=ao ø=ao ü=uw ű=uw å=ao æ=eh ä=eh "
        "ð=dh þ=th ț=t+s ţ=t+s ř=zh ł=l ß=s œ=ao ə=ax ơ=ao ư=uh ă=ah ë=ax"
    ),
]  # fmt: skip
_NORTH = [("sj", "sh", "", ""), ("skj", "sh", "", ""), ("kj", "hh", "", "")]
_SOUTH_SLAVIC = [("c", "t s", "", ""), ("lj", "l y", "", ""), ("nj", "n y", "", ""), ("dž", "jh", "", ""), ("đ", "jh", "", "")]
_CZECH = [("ch", "hh", "", ""), ("c", "t s", "", ""), ("ou", "ow", "", ""), ("ď", "d y", "", ""), ("ť", "t y", "", "")]
_MALAY = [
    ("c", "ch", "", ""),
    ("ng", "ng", "", ""),
    ("ny", "n y", "", ""),
    ("sy", "sh", "", ""),
    ("j", "jh", "", ""),
    ("w", "w", "", ""),
]
_OWN: dict[str, list[Rule]] = {
    "pl": [("cz", "ch", "", ""), ("sz", "sh", "", ""), ("rz", "zh", "", ""), ("ch", "hh", "", ""), ("dz", "d z", "", ""),
           ("dż", "jh", "", ""), ("ci", "ch", "", "[aeouąęó]"), ("si", "sh", "", "[aeouąęó]"), ("c", "t s", "", ""),
           ("ł", "w", "", ""), ("ó", "uw", "", ""), ("ą", "ao m", "", "[pb]"), ("ę", "eh m", "", "[pb]"), ("ą", "ao", "", ""),
           ("ę", "eh", "", ""), ("y", "ih", "", "")],
    "cs": _CZECH, "sk": _CZECH, "hr": _SOUTH_SLAVIC, "sl": _SOUTH_SLAVIC,
    "tr": [("c", "jh", "", ""), ("ç", "ch", "", ""), ("j", "zh", "", "")],
    "hu": [("sz", "s", "", ""), ("zs", "zh", "", ""), ("cs", "ch", "", ""), ("gy", "d y", "", ""), ("ny", "n y", "", ""),
           ("ly", "y", "", ""), ("ty", "t y", "", ""), ("s", "sh", "", ""), ("c", "t s", "", ""), ("a", "ao", "", ""),
           ("á", "aa", "", "")],
    "ro": [("ch", "k", "", ""), ("gh", "g", "", ""), ("c", "ch", "", "[ei]"), ("g", "jh", "", "[ei]"), ("j", "zh", "", "")],
    "sv": [*_NORTH, ("stj", "sh", "", ""), ("tj", "hh", "", ""), ("y", "uw", "", ""), ("o", "uw", "", "$"), ("u",
    "uw", "", "")],
    "da": [*_NORTH, ("y", "uw", "", ""), ("v", "w", "[aeioæøå]", "$|n")], "no": [*_NORTH, ("y", "uw", "", ""), ("o",
    "uw", "", "$")],
    "fi": [("y", "uw", "", ""), ("ä", "ae", "", "")], "et": [("ä", "ae", "", ""), ("õ", "ah", "", "")],
    "id": _MALAY, "ms": _MALAY, "sw": [("j", "jh", "", ""), ("w", "w", "", "")],
    "tl": [("ng", "ng", "", ""), ("w", "w", "", ""), ("ts", "ch", "", "")],
    "vi": [("tr", "ch", "", ""), ("nh", "n y", "", ""), ("ng", "ng", "", ""), ("kh", "k", "", ""), ("gi", "z", "", "[^$]"),
           ("x", "s", "", ""), ("c", "k", "", ""), ("d", "z", "", ""), ("đ", "d", "", "")],
    "ca": [("ny", "n y", "", ""), ("ll", "y", "", ""), ("x", "sh", "", ""), ("j", "zh", "", ""), ("g", "zh", "",
    "[ei]"), ("v", "b", "", "")],
    "gl": [("x", "sh", "", ""), ("v", "b", "", ""), ("ll", "y", "", ""), ("h", "", "", "")],
    "eu": [("x", "sh", "", ""), ("z", "s", "", ""), ("v", "b", "", ""), ("h", "", "", "")],
    "cy": [("w", "w", "", "[aeiouyâêîôû]"), ("w", "uw", "", ""), ("dd", "dh", "", ""), ("ff", "f", "", ""), ("f", "v", "", ""),
           ("th", "th", "", ""), ("u", "ih", "", ""), ("ch", "hh", "", ""), ("c", "k", "", "")],
    "ga": [("bh", "v", "", ""), ("mh", "v", "", ""), ("dh", "", "", ""), ("gh", "", "", ""), ("fh", "", "", ""),
    ("th", "hh", "", ""),
           ("c", "k", "", "")],
    "af": [("oe", "uw", "", ""), ("v", "f", "", ""), ("g", "hh", "", ""), ("eu", "ao", "", ""), ("ie", "iy", "", "")],
    "la": [("c", "k", "", ""), ("v", "w", "", "")],
    "sq": [("ç", "ch", "", ""), ("x", "z", "", ""), ("c", "t s", "", ""), ("y", "uw", "", "")],
    "is": [("y", "iy", "", ""), ("th", "th", "", "")], "lt": [("y", "iy", "", ""), ("c", "t s", "", "")],
    "lv": [("c", "t s", "", "")],
}  # fmt: skip
_DIGITS = {
    "pl": "zero jeden dwa trzy cztery pięć sześć siedem osiem dziewięć",
    "tr": "sıfır bir iki üç dört beş altı yedi sekiz dokuz",
    "sv": "noll ett två tre fyra fem sex sju åtta nio", "da": "nul en to tre fire fem seks syv otte ni",
    "no": "null en to tre fire fem seks sju åtte ni",
    "fi": "nolla yksi kaksi kolme neljä viisi kuusi seitsemän kahdeksan yhdeksän",
    "cs": "nula jedna dva tři čtyři pět šest sedm osm devět", "ro": "zero unu doi trei patru cinci șase șapte opt nouă",
    "hu": "nulla egy kettő három négy öt hat hét nyolc kilenc",
    "id": "nol satu dua tiga empat lima enam tujuh delapan sembilan",
}  # fmt: skip

LATIN = compile_spelling(_COMMON)
"""Of a language that has no rules of its own."""
OWN_LATIN = {code: compile_spelling([*rules, *_COMMON], digits=_DIGITS.get(code, "")) for code, rules in _OWN.items()}
"""Language → its spelling."""
