"""Spanish, Italian and Portuguese. Spanish has one sound for b and v, and both lips make it; their r is at the tongue's tip."""

from __future__ import annotations

from .rules import compile_spelling, read_plain

__all__ = ["ITALIAN", "PORTUGUESE", "SPANISH"]

_SPANISH = [
    ("ch", "ch", "", ""), ("ll", "y", "", ""), ("rr", "d", "", ""), ("qu", "k", "", ""), ("gu", "g", "", "[eiéí]"),
    ("hu", "w", "", "[aeoáéó]"), ("ps", "s", "#", ""), ("g", "hh", "", "[eiéí]"), ("c", "s", "", "[eiéí]"),
    ("n", "m", "", "[pbvm]"),
    ("y", "iy", "", "$"), ("i", "y", "[gq]u|[^aeiouáéíóú#]", "[aeoáéó]"), ("u", "w", "[^q#]", "[aeioáéíó]"),
    ("x", "s", "#", ""), *read_plain(
        "a=aa e=eh i=iy o=ao u=uw á=aa é=eh í=iy ó=ao ú=uw ü=w b=b c=k d=d f=f g=g h= j=hh k=k l=l m=m n=n ñ=n+y p=p q=k r=d "
        "s=s t=t v=b w=w x=k+s y=y z=s"
    ),
]  # fmt: skip
SPANISH = compile_spelling(
    _SPANISH, digits="cero uno dos tres cuatro cinco seis siete ocho nueve", vowels="aeiouáéíóú", whole={"y": "iy"}
)

_ITALIAN = [
    ("gli", "y", "", "[aeouàèéòù]"), ("gli", "y iy", "", ""), ("gn", "n y", "", ""), ("sci", "sh", "", "[aeouàòù]"),
    ("sc", "sh", "", "[eièéì]"), ("ch", "k", "", ""), ("gh", "g", "", ""), ("ci", "ch", "", "[aeouàòù]"),
    ("gi", "jh", "", "[aeouàòù]"), ("cc", "ch", "", "[eièéì]"), ("gg", "jh", "", "[eièéì]"), ("c", "ch", "", "[eièéì]"),
    ("g", "jh", "", "[eièéì]"), ("qu", "k w", "", ""), ("n", "m", "", "[pbm]"), ("i", "y", "[^aeiou#]", "[aeoàèéò]"),
    ("u", "w", "[^#]", "[aeioàèéìò]"), ("s", "z", "[aeiou]", "[aeiouàèéìòù]"), *read_plain(
        "a=aa e=eh i=iy o=ao u=uw à=aa è=eh é=eh ì=iy ò=ao ù=uw b=b c=k d=d f=f g=g h= j=y k=k l=l m=m n=n p=p q=k r=d s=s t=t "
        "v=v w=v x=k+s y=iy z=t+s"
    ),
]  # fmt: skip
ITALIAN = compile_spelling(
    _ITALIAN, digits="zero uno due tre quattro cinque sei sette otto nove", whole={"c": "ch"}, vowels="aeiouàèéìòù"
)

_VOWEL = "[aeiouáéíóúâêôãõà]"
_PORTUGUESE = [
    ("lh", "l y", "", ""), ("nh", "n y", "", ""), ("ch", "sh", "", ""), ("ph", "f", "", ""), ("qu", "k", "", "[eiéíê]"),
    ("qu", "k w", "", ""), ("gu", "g", "", "[eiéíê]"), ("ss", "s", "", ""), ("rr", "hh", "", ""), ("r", "hh", "#", ""),
    ("ão", "aw", "", ""), ("õe", "oy", "", ""), ("ãe", "ay", "", ""), ("ou", "ow", "", ""), ("ei", "ey", "", ""),
    ("ai", "ay", "", ""), ("au", "aw", "", ""), ("oi", "oy", "", ""), ("m", "", _VOWEL, "s?$|[^aeiouáéíóúâêôãõàpbm]"),
    ("n", "", _VOWEL, "[cdfgjqstvxz]"), ("sc", "s", "", "[eiéíê]"), ("c", "s", "", "[eiéíê]"), ("g", "zh", "", "[eiéíê]"),
    ("s", "z", _VOWEL, _VOWEL), ("o", "uh", "[a-zç]", "s?$"), ("e", "ih", "[a-zç]{2}", "s?$"), ("i", "y", "[^aeiou#]",
    "[aoáó]"),
    *read_plain(
        "a=aa e=eh i=iy o=ao u=uw á=aa à=aa â=ah ã=ah é=eh ê=eh í=iy ó=ao ô=ao õ=ao ú=uw b=b c=k ç=s d=d f=f g=g h= j=zh k=k "
        "l=l m=m n=n p=p q=k r=d s=s t=t v=v w=v x=sh y=iy z=z"
    ),
]  # fmt: skip
PORTUGUESE = compile_spelling(
    _PORTUGUESE, digits="zero um dois três quatro cinco seis sete oito nove", whole={"o": "uh", "os": "uh s", "e": "iy"},
    vowels="aeiouáéíóúâêôãõà",
)  # fmt: skip
