"""German and Dutch. The r of both is in the throat and leaves the lips alone; German w, and Dutch w too, bite the lip."""

from __future__ import annotations

from .rules import compile_spelling, read_plain

__all__ = ["DUTCH", "GERMAN"]

_VOWEL = "[aeiouyäöü]"
_TWO = "[bcdfghjklmnpqrstvwxyz]{2}"

_GERMAN = [
    ("tsch", "ch", "", ""), ("ssch", "s sh", "", ""), ("rr", "g", "", ""), ("sch", "sh", "", ""), ("tion",
    "t s y ao n", "", ""), ("ch", "k", "", "s"), ("ch", "hh", "", ""),
    ("ck", "k", "", ""), ("st", "sh t", "#|#(an|auf|aus|be|ein|er|ge|ver|vor|zu)", ""), ("ss", "s", "", ""),
    ("sp", "sh p", "#|#(an|auf|aus|be|ein|er|ge|ver|vor|zu)", ""), ("pf", "p f", "", ""), ("ph", "f", "", ""),
    ("qu", "k v", "", ""), ("tz", "t s", "", ""), ("th", "t", "", ""), ("ng", "ng", "", ""), ("nk", "ng k", "", ""),
    ("eu", "oy", "", ""), ("äu", "oy", "", ""), ("ei", "ay", "", ""), ("ai", "ay", "", ""), ("ie", "iy", "", ""),
    ("au", "aw", "", ""), ("h", "", _VOWEL, ""), ("er", "ah", "[a-zäöüß]{2}", "(n|s|t)?$"), ("r", "", _VOWEL, "[^aeiouyäöü]|$"),
    ("e", "ax", "[a-zäöüß]{2}", "(n|l|m|s|t|st)?$"), ("e", "ax", "#(g|b)", "[^aeiouyäöüi]"), ("u", "uh", "", _TWO),
    ("s", "z", "", _VOWEL), *read_plain(
        "a=aa e=eh i=ih o=ao u=uw ä=eh ö=ao ü=uw y=uw b=b c=k d=d f=f g=g h=hh j=y k=k l=l m=m n=n p=p q=k r=g s=s t=t v=f "
        "w=v x=k+s z=t+s ß=s"
    ),
]  # fmt: skip
GERMAN = compile_spelling(
    _GERMAN, vowels="aeiouäöü", digits="null eins zwei drei vier fünf sechs sieben acht neun",
    whole={"e": "eh", "vase": "v aa z ax", "und": "uh n t", "mann": "m aa n"},
)  # fmt: skip

_DUTCH = [
    ("sch", "s", "", "$"), ("sch", "s hh", "", ""), ("ch", "hh", "", ""), ("ng", "ng", "", ""), ("nk", "ng k", "", ""),
    ("sj", "sh", "", ""), ("tj", "ch", "", ""), ("ph", "f", "", ""), ("th", "t", "", ""), ("qu", "k v", "", ""),
    ("eeuw", "ey w", "", ""), ("ieuw", "iy w", "", ""), ("ouw", "aw", "", ""), ("uw", "uw", "", "$"), ("ij", "ax",
    "[a-z]{2}l", "k"), ("ij", "ey", "", ""),
    ("ei", "ey", "", ""), ("oe", "uw", "", ""), ("ui", "ao iy", "", ""), ("eu", "ao", "", ""), ("ou", "aw", "", ""),
    ("au", "aw", "", ""), ("ie", "iy", "", ""), ("aa", "aa", "", ""), ("ee", "ey", "", ""), ("oo", "ow", "", ""),
    ("uu", "uw", "", ""), ("u", "uw", "", "[bcdfgklmnprstvz][aeiou]"), ("en", "ax", "[a-z]{2}", "$"),
    ("e", "ax", "[a-z]{2}", "(r|l|n|s)?$"), ("c", "s", "", "[eiy]"), *read_plain(
        "a=aa e=eh i=ih o=ao u=uh y=iy b=b c=k d=d f=f g=hh h=hh j=y k=k l=l m=m n=n p=p q=k r=g s=s t=t v=v w=v x=k+s z=z "
        "ë=eh ï=iy"
    ),
]  # fmt: skip
DUTCH = compile_spelling(
    _DUTCH, digits="nul een twee drie vier vijf zes zeven acht negen", vowels="aeiouëï",
    whole={"de": "d ax", "het": "hh ax t", "een": "ax n", "t": "t", "je": "y ax", "we": "v ax", "ze": "z ax", "me": "m ax",
           "te": "t ax", "k": "k", "s": "s"},
)  # fmt: skip
