"""Which language a text is in: by its script, and in Latin letters by its most frequent words.

A word carries the primary subtag of BCP 47 (RFC 5646): ``de``, ``pt``. ``""`` says that nobody knows; Latin letters are then
read as English. Nothing here is learnt: the words and letters of each language are ours, from what its grammar uses most.
"""

from __future__ import annotations

import re
import unicodedata
from bisect import bisect_right
from collections import Counter
from collections.abc import Iterable
from dataclasses import replace
from functools import lru_cache

from ..errors import InputError, nearest
from .word import Word, is_spoken

__all__ = ["LANGUAGES", "check_language", "find_language", "script_of", "with_language"]

LANGUAGES = {
    "en": "English", "de": "German", "fr": "French", "es": "Spanish", "it": "Italian", "pt": "Portuguese", "nl": "Dutch",
    "af": "Afrikaans", "ca": "Catalan", "cs": "Czech", "cy": "Welsh", "da": "Danish", "et": "Estonian", "eu": "Basque",
    "fi": "Finnish", "ga": "Irish", "gl": "Galician", "hr": "Croatian", "hu": "Hungarian", "id": "Indonesian",
    "is": "Icelandic", "la": "Latin", "lt": "Lithuanian", "lv": "Latvian", "ms": "Malay", "no": "Norwegian", "pl": "Polish",
    "ro": "Romanian", "sk": "Slovak", "sl": "Slovene", "sq": "Albanian", "sv": "Swedish", "sw": "Swahili", "tl": "Tagalog",
    "tr": "Turkish", "vi": "Vietnamese", "ru": "Russian", "be": "Belarusian", "bg": "Bulgarian", "kk": "Kazakh",
    "mk": "Macedonian", "sr": "Serbian", "uk": "Ukrainian", "el": "Greek", "hy": "Armenian", "ka": "Georgian", "he": "Hebrew",
    "ar": "Arabic", "fa": "Persian", "ur": "Urdu", "hi": "Hindi", "mr": "Marathi", "ne": "Nepali", "bn": "Bengali",
    "pa": "Punjabi", "gu": "Gujarati", "ta": "Tamil", "te": "Telugu", "kn": "Kannada", "ml": "Malayalam", "si": "Sinhala",
    "th": "Thai", "lo": "Lao", "my": "Burmese", "km": "Khmer", "am": "Amharic", "ja": "Japanese", "ko": "Korean",
    "zh": "Chinese",
}  # fmt: skip
"""Codes that are known → names."""

_ALIKE = {"nb": "no", "nn": "no", "iw": "he", "in": "id", "fil": "tl", "yue": "zh", "cmn": "zh", "bs": "hr"}
"""Codes that people and programs write for some of them."""

# Blocks of Unicode: first character → script; what lies between is of no script. (unicode.org/Public/UNIDATA/Blocks.txt)
_BLOCKS = [
    (0x41, "Latn"), (0x250, ""), (0x370, "Grek"), (0x400, "Cyrl"), (0x530, "Armn"), (0x590, "Hebr"), (0x600, "Arab"),
    (0x700, ""), (0x750, "Arab"), (0x780, ""), (0x8A0, "Arab"), (0x900, "Deva"), (0x980, "Beng"), (0xA00, "Guru"),
    (0xA80, "Gujr"), (0xB00, ""), (0xB80, "Taml"), (0xC00, "Telu"), (0xC80, "Knda"), (0xD00, "Mlym"), (0xD80, "Sinh"),
    (0xE00, "Thai"), (0xE80, "Laoo"), (0xF00, ""), (0x1000, "Mymr"), (0x10A0, "Geor"), (0x1100, "Hang"), (0x1200, "Ethi"),
    (0x13A0, ""), (0x1780, "Khmr"), (0x1800, ""), (0x1E00, "Latn"), (0x1F00, "Grek"), (0x2000, ""), (0x3005, "Hani"),
    (0x3008, ""), (0x3040, "Kana"), (0x3100, ""), (0x3130, "Hang"), (0x3190, ""), (0x31F0, "Kana"), (0x3200, ""),
    (0x3400, "Hani"), (0xA000, ""), (0xA8E0, "Deva"), (0xA900, ""), (0xAC00, "Hang"), (0xD7B0, ""), (0xF900, "Hani"),
    (0xFB00, "Latn"), (0xFB13, "Armn"), (0xFB1D, "Hebr"), (0xFB50, "Arab"), (0xFE00, ""), (0xFE70, "Arab"), (0xFF00, ""),
    (0xFF21, "Latn"), (0xFF5B, ""), (0xFF66, "Kana"), (0xFFA0, "Hang"), (0xFFE0, ""), (0x20000, "Hani"), (0x323B0, ""),
]  # fmt: skip
_FIRST = [first for first, _ in _BLOCKS]

_OF_SCRIPT = {
    "Grek": "el", "Cyrl": "ru", "Armn": "hy", "Hebr": "he", "Arab": "ar", "Deva": "hi", "Beng": "bn", "Guru": "pa",
    "Gujr": "gu", "Taml": "ta", "Telu": "te", "Knda": "kn", "Mlym": "ml", "Sinh": "si", "Thai": "th", "Laoo": "lo",
    "Mymr": "my", "Geor": "ka", "Hang": "ko", "Ethi": "am", "Khmr": "km", "Kana": "ja", "Hani": "zh",
}  # fmt: skip
"""Script → the language with most speakers that is written in it."""
_TELLING = [("be", "ў"), ("kk", "әөүұқғ"), ("uk", "іїєґ"), ("sr", "ћђ"), ("mk", "ѓќѕ"), ("ur", "ٹڈڑےں"), ("fa", "پچژگ")]
"""Letters by which other languages of a script are known; the first that is found counts."""
_KANA_SHARE = 0.05  # of kana among kana and Chinese signs from which on a text is Japanese [ours]

# Frequent words of languages in Latin letters, without those that are rare in speech. Ours.
_WORDS = {
    "en": "the of and to is was it that for on are with they be at one have this from by not what all were we when your can "
    "there an which she how their if will up about out then them would so has he her his him my me you do does did "
    "don't it's i'm been who no but in as or a here please where why good",
    "de": "der die das und ist nicht ein eine einen einem einer zu den dem des mit sich auf für von im am sie er es wir ihr "
    "ich du hat haben war sind wie auch noch nur wenn oder aber bei nach so was hier kann sehr mein meine kein keine "
    "schon dann uns mir mich dir dich ja nein doch man guten danke bitte will in an",
    "fr": "le la les des un une et est de du que qui dans pour pas ne se ce il elle je tu nous vous ils elles on sur avec "
    "plus mais son sa ses par au aux c'est cette ces n'est d'un d'une j'ai qu'il mon ma mes être avoir était sont "
    "très bien tout comme ou où si y a à me te lui moi en oui non bonjour merci",
    "es": "el la los las un una y es de del que en no se por con para su sus lo le al como más pero este esta esto está yo tú "
    "él ella nosotros mi me te si sí ya muy hay todo todos nadie son ser fue a o porque cuando qué eso bien tu buenas "
    "buenos gracias hola usted quiero gusta tengo",
    "it": "il lo la i gli le un uno una di che è e non per con si sono ho hai ha abbiamo hanno mi ti ci vi del della dei delle "
    "nel nella al alla dal questo questa come ma più anche se io tu lui lei noi a da in molto tutto bene quando cosa "
    "perché no sì ciao grazie era",
    "pt": "o a os as um uma de do da dos das em no na nos nas que e é não por com para se mais como mas foi ele ela eu você "
    "nós meu minha seu sua isso este esta está são ser tem muito também já quando bem ao à te me lhe obrigado olá sim",
    "nl": "de het een en van ik je dat die niet is in te zijn op met voor er maar om hem ze wij we jij hij ook als bij of dan "
    "nog naar heeft hebben wat aan uit worden deze dit mijn geen wel goed zo heel kan moet daar hier dag dank",
    "af": "die het 'n en van ek jy nie is in te op met vir maar om hy sy ons ook as by of dan nog na wat aan uit hierdie my "
    "geen goed baie kan moet daar",
    "sv": "och att det i en jag hon som han på den med var sig för så till är men ett om hade de av icke mig du henne "
    "då sin nu "
    "har inte hans honom skulle hennes där min man ej vid kunde något från ut vi mycket god tack",
    "da": "og i jeg det at en den til er som på de med han af for ikke der var mig sig men et har om vi min havde ham hun nu "
    "over da fra du ud sin dem os op man hans hvor eller hvad skal selv meget god tak",
    "no": "og i jeg det at en et den til er som på de med han av ikke der så var meg seg men ett har om vi min mitt ha hadde "
    "hun nå over da ved fra du ut sin dem oss opp man kan hans hvor eller hva skal selv sjøl her alle mye god takk",
    "is": "og að er í á sem ekki það ég þú hann hún við um með en var til af fyrir ekkert",
    "fi": "ja on ei että se hän minä sinä oli mutta niin kun kuin ovat jos myös tämä mitä nyt sitten vain joka siis hyvää "
    "kiitos en me te he ole minun",
    "et": "ja on ei et see ta ma sa oli aga nii kui ka mis nüüd siis oma mina sina tere",
    "pl": "i w nie na się z do to że jest jak o a ale po co tak za od jego jej go mu przez być był była są już tylko dla czy "
    "ja ty my wy mnie mi te ten ta dzień dobry",
    "cs": "a v na se že je to s z do o i ale jako za po pro jsem jsi není jsou byl by tak co jak si už já ty my mi ten ta",
    "sk": "a v na sa že je to s z do o i ale ako za po pre som si nie sú bol by tak čo ja ty my mi ten tá",
    "hr": "i u je se na da za od su s sam nije ne što kao to a ali će bio po ja ti mi vi koji dobro hvala",
    "sl": "in je v na se da za so z s ne sem to kot bi pa tudi ki ali po jaz ti mi dobro hvala",
    "hu": "a az és hogy nem is egy van volt meg de ez csak már ha mint én te mi ki el még kell köszönöm jó nagyon azt",
    "ro": "și de la în nu o cu pe să un este a că ce mai din care sunt am ai au dar eu tu el ea noi voi foarte bine pentru",
    "tr": "ve bir bu da de için çok ne o ben sen biz siz ama gibi daha var yok mi mı değil ile her şey iyi kadar olan",
    "id": "yang dan di ini itu dengan untuk tidak dari dalam akan pada juga saya ke karena ada kita mereka sudah bisa kami dia "
    "apa aku kamu selamat terima",
    "vi": "là và của có không được một người những cho trong các đã với này tôi bạn rất cũng khi đó anh em",
    "ca": "el la els les un una i és de del que en no es per amb al com més però aquest aquesta jo tu ell ella nosaltres molt "
    "tot són",
    "sw": "na ya wa kwa ni katika la za hii hiyo kuwa cha vya lakini mimi wewe yeye sisi sana asante habari",
    "tl": "ang ng sa na mga ay at ko mo siya ako ikaw hindi ito para kami tayo po salamat",
    "lt": "ir yra ne į kad su iš kaip tai bet aš tu jis ji mes buvo labai ačiū",
    "lv": "un ir ne uz ka ar no kā tas bet es tu viņš viņa mēs bija ļoti paldies",
    "la": "et in est non ad ut cum sed quod qui sunt ex enim esse nec",
    "cy": "y yn yr a i mae o ar ei ac wedi oedd fi ti eu hi ni nid diolch",
    "ga": "an agus na is ar a tá bhí sé sí mé tú le ní go do",
}  # fmt: skip
_LETTERS = {
    "ß": "de", "ñ": "es", "¿": "es", "¡": "es", "ã": "pt", "õ": "pt et", "ł": "pl", "ż": "pl", "ź": "pl", "ą": "pl lt",
    "ś": "pl", "ć": "pl hr", "ń": "pl",
    "ę": "pl lt", "ş": "tr", "ı": "tr", "ğ": "tr", "ő": "hu", "ű": "hu", "ř": "cs", "ě": "cs", "ů": "cs", "ľ": "sk",
    "ţ": "ro", "ț": "ro", "ș": "ro", "ă": "ro vi", "đ": "hr vi", "ơ": "vi", "ư": "vi", "ø": "da no", "æ": "da no is",
    "å": "sv da no", "ð": "is", "þ": "is", "œ": "fr", "è": "fr it ca", "ê": "fr pt", "ç": "fr pt tr ca", "ò": "it ca",
    "ì": "it", "ä": "de sv fi et sk", "ö": "de sv fi et hu tr", "ü": "de et hu tr",
}  # fmt: skip
"""Letters and signs that few languages have: each counts once for a text, as a frequent word does."""
_TOKEN = re.compile(r"[^\W\d_]+(?:'[^\W\d_]+)*")
_MARGIN = 1.2  # by how many times a text has more words of another language than of English, which many languages share [ours]
_MOST = 20_000  # characters of a text that are looked at [ours: more changes nothing]

_OWNERS: dict[str, list[str]] = {}
for _code, _words in _WORDS.items():
    for _word in _words.split():
        _OWNERS.setdefault(_word, []).append(_code)


@lru_cache(maxsize=4096)
def script_of(character: str) -> str:
    """The script of a letter, by its code of ISO 15924 (``Kana`` for both kinds of kana); ``""`` for other signs.

    >>> script_of("a"), script_of("ж"), script_of("ぱ"), script_of("7")
    ('Latn', 'Cyrl', 'Kana', '')
    """
    place = bisect_right(_FIRST, ord(character)) - 1
    return _BLOCKS[place][1] if place >= 0 and unicodedata.category(character)[0] in "LM" else ""


def check_language(code: str, *, has_words: bool = True) -> str:
    """The primary subtag of a language tag: ``de`` of ``de-AT``; ``""`` stays as it is.

    Args:
        code: the tag.
        has_words: whether there are words that could be in it.

    >>> check_language("pt-BR"), check_language("NB")
    ('pt', 'no')

    Raises:
        InputError: the language is not known, or a language is given and there are no words.
    """
    if code and not has_words:
        raise InputError(f"the language {code[:40]!r} of no words", "a transcript goes with it; a plan knows that of its words")
    subtag = re.split(r"[-_]", code.strip().lower(), maxsplit=1)[0]
    subtag = _ALIKE.get(subtag, subtag)
    if subtag in LANGUAGES or not code:
        return subtag
    match = next((tag for tag, name in LANGUAGES.items() if name.lower() == subtag), None)
    hint = f"the code of {LANGUAGES[match]} is {match}" if match else nearest(subtag[:40], LANGUAGES)
    raise InputError(f"no language has the code {code[:40]!r}", hint)


def find_language(text: str) -> str:
    """The language of a text, a code of `LANGUAGES`; ``""`` where it is too short to tell.

    >>> find_language("Guten Abend, das ist nicht gut."), find_language("Добрый вечер"), find_language("mama papa")
    ('de', 'ru', '')
    """
    text = unicodedata.normalize("NFC", text[:_MOST]).replace("’", "'")
    scripts = Counter(filter(None, map(script_of, text)))
    if not scripts:
        return ""
    script = max(scripts, key=lambda each: scripts[each])
    if script in ("Hani", "Kana"):
        return "ja" if scripts["Kana"] > _KANA_SHARE * scripts["Hani"] else "zh"
    if script != "Latn":
        return next((code for code, letters in _TELLING if any(c in letters for c in text.lower())), _OF_SCRIPT[script])
    return _find_latin(text)


def _find_latin(text: str) -> str:
    """The language of which a text has most words; a word that many languages have decides nothing between them."""
    hits, kinds, shares = Counter[str](), Counter[str](), dict.fromkeys(_WORDS, 0.0)
    tokens = Counter(token if token == "I" else token.lower() for token in _TOKEN.findall(text))
    signs = {letter: _LETTERS[letter].split() for letter in sorted(_LETTERS.keys() & set(text.lower()))}
    for evidence, count in (tokens | Counter(signs.keys())).items():
        owners = signs.get(evidence) or _OWNERS.get(evidence.lower(), [])
        for code in {*owners, "en"} if evidence == "I" else owners:
            hits[code] += count
            kinds[code] += 1
            shares[code] += count / len(owners)
    english = hits.pop("en", 0)
    others = [code for code, count in hits.items() if count > _MARGIN * english and kinds[code] > 1]
    if others:
        return max(others, key=lambda code: (hits[code] + shares[code], code))
    return "en" if kinds["en"] > 1 else ""


def with_language(words: Iterable[Word], language: str = "") -> tuple[Word, ...]:
    """The words, each with its language.

    Args:
        words: of one speech.
        language: of all of them, a code of `LANGUAGES`; found from all the words where not given.

    Raises:
        InputError: the language is not known.
    """
    words = tuple(words)
    code = check_language(language) or find_language(" ".join(word.text for word in words if is_spoken(word.text)))
    return tuple(word if word.language == code else replace(word, language=code) for word in words)
