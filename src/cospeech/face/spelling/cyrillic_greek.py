"""Cyrillic and Greek letters. Stress is not written, so that an unstressed o of Russian stays an o."""

from __future__ import annotations

from .rules import compile_spelling, read_plain

__all__ = ["CYRILLIC", "GREEK", "RUSSIAN"]

_CYRILLIC = read_plain(
    "а=aa б=b в=v г=g д=d е=eh ё=y+ao ж=zh з=z и=iy й=y к=k л=l м=m н=n о=ao п=p р=d с=s т=t у=uw ф=f х=hh ц=t+s ч=ch ш=sh "
    "щ=sh ъ= ь= ы=ih э=eh ю=y+uw я=y+aa і=iy ї=y+iy є=y+eh ґ=g ў=w ј=y љ=l+y њ=n+y ћ=ch ђ=jh џ=jh ѓ=g ќ=k ѕ=d+z "
    "ә=ae ө=ao ү=uw ұ=uw қ=k ғ=g һ=hh ң=ng"
)
_RUSSIAN = [("ого", "ax v ao", "", "$"), ("его", "eh v ao", "", "$"), ("вств", "s t v", "", ""), ("лнц", "n t s", "", "")]
_VOWELS = "аеёиоуыэюяіїєәөүұ"

CYRILLIC = compile_spelling(_CYRILLIC, vowels=_VOWELS)
"""Of other languages than Russian."""
RUSSIAN = compile_spelling(
    [*_RUSSIAN, *_CYRILLIC], digits="ноль один два три четыре пять шесть семь восемь девять", vowels=_VOWELS,
    whole={"сегодня": "s eh v ao d n y aa", "много": "m n ao g ao", "дорого": "d ao d ax g ax", "строго": "s t d ao g ax"},
)  # fmt: skip

_GREEK_BEFORE_UNVOICED = "[θκξπσςτφχψ]|$"
GREEK = compile_spelling(
    [
        ("μπ", "b", "", ""), ("ντ", "d", "", ""), ("γκ", "g", "", ""), ("γγ", "ng g", "", ""), ("γχ", "ng hh", "", ""),
        ("τζ", "d z", "", ""), ("ου", "uw", "", ""), ("ού", "uw", "", ""), ("αι", "eh", "", ""), ("αί", "eh", "", ""),
        ("ει", "iy", "", ""),
        ("εί", "iy", "", ""), ("οι", "iy", "", ""), ("οί", "iy", "", ""), ("υι", "iy", "", ""),
        *((first + second, f"{phone} f", "", _GREEK_BEFORE_UNVOICED) for first, phone in (("α", "aa"), ("ε",
        "eh")) for second in "υύ"),
        ("αυ", "aa v", "", ""), ("αύ", "aa v", "", ""), ("ευ", "eh v", "", ""), ("εύ", "eh v", "", ""), *read_plain(
            "α=aa ά=aa β=v γ=g δ=dh ε=eh έ=eh ζ=z η=iy ή=iy θ=th ι=iy ί=iy ϊ=iy ΐ=iy κ=k λ=l μ=m ν=n ξ=k+s ο=ao ό=ao π=p "
            "ρ=d σ=s ς=s τ=t υ=iy ύ=iy ϋ=iy φ=f χ=hh ψ=p+s ω=ao ώ=ao"
        ),
    ],
    digits="μηδέν ένα δύο τρία τέσσερα πέντε έξι επτά οκτώ εννέα", vowels="αεηιουω",
)  # fmt: skip
