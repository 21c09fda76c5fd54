"""French: most last consonants are silent, a vowel before n or m is nasal and swallows it, and u, eu and ou round the lips."""

from __future__ import annotations

from .rules import compile_spelling, read_plain

__all__ = ["FRENCH"]

_VOWEL = "[aeiouyéèêëàâîïôûùœ]"
_NASAL = f"(?!{_VOWEL}|[nmh])"  # then n and m are not spoken
_SILENT = [(letter, "", "[^#]", "s?$") for letter in ("t", "d", "p", "g", "x", "z", "ct", "pt", "gt", "ft")]

_RULES = [
    ("eaux", "ow", "", "$"), ("eau", "ow", "", ""), ("aux", "ow", "", "$"), ("au", "ow", "", ""), ("oeu", "ao", "", ""),
    ("œu", "ao", "", ""), ("œ", "ao", "", ""), ("eu", "ao", "", ""), ("eû", "ao", "", ""), ("ou", "w", "", "[aeiéè]"),
    ("ou", "uw", "", ""), ("où", "uw", "", ""), ("oû", "uw", "", ""), ("oin", "w eh", "", _NASAL), ("oi", "w aa", "", ""),
    ("oî", "w aa", "", ""), ("oy", "w aa y", "", _VOWEL), ("oy", "w aa", "", ""),
    ("ien", "y eh", "", _NASAL), ("yen", "y eh", "", _NASAL), ("éen", "ey eh", "", _NASAL),
    *((vowel + n, "eh", "", _NASAL) for vowel in ("ai", "ei", "i", "y", "u") for n in "nm"),
    *((vowel + n, "aa", "", _NASAL) for vowel in ("a", "e") for n in "nm"), *(("o" + n, "ao", "", _NASAL) for n in "nm"),
    ("emm", "aa m", "", "ent$"), ("ment", "m aa", "[a-zéèê]{2}", "s?$"), ("ent", "", "(oi|ai|ê|è|é)[a-z]*", "$"),
    ("aill", "aa y", "", ""), ("eill", "eh y", "", ""), ("euill", "ao y", "", ""), ("ouill", "uw y", "", ""),
    ("ail", "aa y", "", "s?$"), ("eil", "eh y", "", "s?$"), ("euil", "ao y", "", "s?$"), ("ill", "iy y", "[^#]", ""),
    ("ch", "k", "", "[rl]"), ("ch", "sh", "", ""), ("ph", "f", "", ""), ("th", "t", "", ""), ("gn", "n y", "", ""),
    ("qu", "k", "", ""), ("gu", "g", "", "[eiyéèê]"), ("ge", "zh", "", "[aoâ]"), ("g", "zh", "", "[eiyéèê]"),
    ("sc", "s", "", "[eiyéèê]"), ("cc", "k s", "", "[eiéè]"), ("c", "s", "", "[eiyéèê]"), ("ss", "s", "", ""), ("s",
    "z", _VOWEL, _VOWEL),
    ("tion", "s y ao", "[^s]", "s?$"), ("ai", "eh", "", ""), ("aî", "eh", "", ""), ("ei", "eh", "", ""), ("ay", "eh y", "", ""),
    ("er", "ey", "[a-zéèê]{2}", "s?$"), ("ez", "ey", "", "$"), ("ed", "ey", "", "s?$"), ("et", "eh", "", "s?$"),
    ("ps", "s", "#", ""), ("p", "", "om|ba|scul|#se", "t"), ("b", "", "m", "s?$"), ("mn", "n", "o", ""),
    *_SILENT, ("s", "", "[^#]", "$"),
    ("es", "", "[a-zéèê]{2}", "$"), ("e", "", "[a-zéèêùîï]", "$"), ("e", "ax", "#[^aeiouyéèê]+", f"[^aeiouyéèêx]{_VOWEL}"),
    ("e", "", f"{_VOWEL}[bcdfgjklmnpqrstvz]", f"[bcdfgjklmnpqrstvz]{_VOWEL}"), ("i", "y", "[^#]", "[aoéè]|e(?!s?$)"),
    ("u", "w", "", "i"), ("y", "y", "", "[aeiouéè]"),
    *read_plain(
        "a=aa e=eh i=iy o=ao u=uw y=iy é=eh è=eh ê=eh ë=eh à=aa â=aa î=iy ï=iy ô=ow û=uw ù=uw ü=uw ç=s b=b c=k d=d f=f g=g h= "
        "j=zh k=k l=l m=m n=n p=p q=k r=g s=s t=t v=v w=w x=k+s z=z"
    ),
]  # fmt: skip
_WHOLE = {  # ours: frequent words that the rules above would misread
    "le": "l ax", "de": "d ax", "je": "zh ax", "me": "m ax", "te": "t ax", "se": "s ax", "ce": "s ax", "ne": "n ax",
    "que": "k ax", "c": "s", "g": "zh ey", "les": "l eh", "des": "d eh", "mes": "m eh", "tes": "t eh", "ses": "s eh",
    "ces": "s eh",
    "est": "eh", "es": "eh", "et": "eh", "un": "eh", "femme": "f aa m", "femmes": "f aa m", "ville": "v iy l",
    "villes": "v iy l", "mille": "m iy l", "tranquille": "t g aa k iy l", "monsieur": "m ax s y ao", "messieurs": "m eh s y ao",
    "fils": "f iy s", "mer": "m eh g", "fer": "f eh g", "hiver": "iy v eh g", "hier": "y eh g", "cap": "k aa p",
    "stop": "s t ao p", "club": "k l ao b", "pub": "p ao b", "album": "aa l b ao m", "parfum": "p aa g f eh",
    "oignon": "ao n y ao", "automne": "ow t ao n", "sud": "s uw d", "sept": "s eh t", "huit": "w iy t", "six": "s iy s",
    "dix": "d iy s", "plus": "p l uw", "tous": "t uw", "eu": "uw", "eût": "uw", "pays": "p eh iy", "examen": "eh g z aa m eh",
}  # fmt: skip
FRENCH = compile_spelling(
    _RULES, whole=_WHOLE | {"1": "eh", "7": "s eh t", "8": "w iy t", "6": "s iy s"}, vowels="aeiouéèêëàâîïôûùœ",
    digits="zéro un deux trois quatre cinq six sept huit neuf",
)  # fmt: skip
