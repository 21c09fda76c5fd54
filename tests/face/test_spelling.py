"""Spelling → phones in other languages than English: what the lips show."""

from __future__ import annotations

import unicodedata

import numpy as np
import pytest

from cospeech.audio.languages import LANGUAGES
from cospeech.audio.speech import Word
from cospeech.errors import CospeechWarning
from cospeech.face.composition import Face
from cospeech.face.graphemes import graphemes_to_phones, note_unread_words
from cospeech.face.visemes import phones_of
from tests.face.test_face import RATE, act, channel, hear, opening, speech

WORDS = {
    "de": {"will": "v ih l", "Mittwoch": "m ih t v ao hh", "hohe": "hh ao ax", "schön": "sh ao n", "Straße": "sh t g aa s ax",
           "Quelle": "k v eh l ax", "Vater": "f aa t ah", "Pferd": "p f eh d", "zwölf": "t s v ao l f", "Bäume": "b oy m ax"},
    "fr": {"temps": "t aa", "champs": "sh aa", "plomb": "p l ao", "beaucoup": "b ow k uw", "compte": "k ao t", "homme": "ao m",
           "baptême": "b aa t eh m",
           "lune": "l uw n", "feu": "f ao", "c'est": "s eh", "obtenir": "ao b t eh n iy g"},
    "es": {"vive": "b iy b eh", "vaca": "b aa k aa", "enviar": "eh m b y aa d", "hombre": "ao m b d eh",
           "quiero": "k y eh d ao"},
    "it": {"i": "iy", "gli": "y iy", "chiesa": "k y eh z aa", "giorno": "jh ao d n ao", "vino": "v iy n ao"},
    "pt": {"também": "t aa m b eh", "bom": "b ao", "chuva": "sh uw v aa", "vinho": "v iy n y uh"},
    "nl": {"wij": "v ey", "boek": "b uw k", "vrouw": "v g aw", "huis": "hh ao iy s"},
    "pl": {"Wszystko": "v sh ih s t k ao", "łódź": "w uw d zh", "dąb": "d ao m b"},
    "da": {"Brød": "b d ao d"}, "tr": {"çok": "ch ao k", "İstanbul": "iy s t aa n b uw l", "şimdi": "sh iy m d iy"},
    "ru": {"папа": "p aa p aa", "вода": "v ao d aa", "его": "eh v ao"}, "uk": {"його": "y ao g ao"},
    "el": {"μπαμπάς": "b aa b aa s", "αυτό": "aa f t ao", "ουρανός": "uw d aa n ao s"},
    "ja": {"パパ": "p aa p aa", "ぱぱ": "p aa p aa", "ﾊﾟﾊﾟ": "p aa p aa", "しゃしん": "sh aa sh iy n",
           "しんぶん": "sh iy m b uh n",
           "ボール": "b ao ao d uh", "きって": "k iy t eh", "ヴァン": "b aa n"},
    "ko": {"밥": "b aa p", "아빠": "aa p aa", "원": "w ah n", "엄마": "ah m m aa"},
    "hi": {"पापा": "p aa p aa", "बहुत": "b ah hh uh t", "अंबर": "ah m b ah d", "फ़िल्म": "f ih l m", "मम्मी": "m ah m iy"},
    "ar": {"باب": "b aa b", "أمي": "aa m iy", "وأبي": "w aa b iy", "مُحَمَّد": "m uh hh ah m ah d"},
    "he": {"אבא": "aa b aa", "שלום": "sh ax l ao m", "אביב": "aa v iy v", "בית": "b iy t", "סוף": "s ao f"},
    "": {"слово": "s l ao v ao", "Brød": "b r aa d", "the": "dh ax", "媽媽": "", "食べます": "", "สวัสดี": ""},
}  # fmt: skip
CASES = [(language, word, phones) for language, words in WORDS.items() for word, phones in words.items()]


@pytest.mark.parametrize(("language", "word", "phones"), CASES, ids=[f"{language}-{word}" for language, word, _ in CASES])
def test_words_of_languages(language, word, phones):
    for form in ("NFC", "NFD"):
        assert graphemes_to_phones(unicodedata.normalize(form, word), language) == tuple(phones.split())


@pytest.mark.parametrize(
    ("language", "digit", "phones"),
    [("de", "4", "f iy"), ("fr", "4", "k aa t g"), ("es", "9", "n w eh b eh"), ("ru", "2", "d v aa"), ("ko", "3", "s aa m"),
     ("ja", "3", "s aa n"), ("", "4", "f ao r"), ("zh", "4", "")],
)  # fmt: skip
def test_digits_are_read_in_the_language(language, digit, phones):
    assert graphemes_to_phones(digit, language) == tuple(phones.split())
    assert graphemes_to_phones(chr(ord("٠") + int(digit)), language) == tuple(phones.split())


def test_words_in_scripts_without_rules_leave_the_mouth_to_the_sound():
    voice, _ = speech(4)
    times = np.arange(120) / 30
    words = [Word("言葉", 0.5, 1.0), Word("สวัสดี", 1.0, 1.5), Word("—", 1.5, 1.6), Word("zero", 2.0, 2.0)]
    assert np.array_equal(act(Face(seed=1), times, voice, words=words), act(Face(seed=1), times, voice))


@pytest.mark.slow
def test_every_letter_of_every_language_has_a_mouth():
    latin = [chr(code) for code in range(0x61, 0x250)]
    ranges = [(0x386, 0x530), (0x5D0, 0x5EB), (0x621, 0x6D5), (0x904, 0x950), (0x3041, 0x30FF)]
    others = [chr(code) for first, last in ranges for code in range(first, last)] + [chr(c) for c in range(0xAC00, 0xD7A4, 29)]
    words = [Word(f"{a}{b}", 0, 1, language) for language in LANGUAGES for a in latin for b in ("", "aba")]
    words += [Word(f"{a}{b}", 0, 1, language) for language in ("", "uk") for a in others for b in ("", "а", "あ", "ا", "ा")]
    phones = phones_of(words, 0, 1)  # raises KeyError for a phone without a viseme
    assert len(phones.centre) > len(words)


@pytest.mark.parametrize(
    ("language", "word"),
    [("ru", "мама"), ("ja", "ぱぱ"), ("ko", "아빠"), ("hi", "पापा"), ("ar", "بابا"), ("he", "אבא"), ("es", "vive")],
)
def test_lips_close_in_every_script(language, word):
    voice, times = hear(np.full(300, 0.9)), np.arange(45, 115) / RATE
    words = [Word(word, 0.6, 1.1, language)]
    assert opening(act(Face(seed=1), times, voice, words=words)).min() < 0.012
    assert opening(act(Face(seed=1), times, voice)).min() > 0.05


def test_languages_shape_the_same_letters_otherwise():
    voice, times = hear(np.full(300, 0.85)), np.arange(60, 110) / RATE

    def most(word, language, name):
        return channel(act(Face(seed=1), times, voice, words=[Word(word, 0.6, 1.1, language)]), name).max()

    assert most("will", "en", "mouthPucker") > 0.4 > 0.1 > most("will", "de", "mouthPucker")
    assert most("will", "de", "mouthRollLower") > 0.2 > 0.05 > most("will", "en", "mouthRollLower")
    assert most("temps", "en", "mouthPressLeft") > 0.2 > 0.05 > most("temps", "fr", "mouthPressLeft")
    assert most("vive", "es", "mouthPressLeft") > 0.2 > 0.05 > most("vive", "en", "mouthPressLeft")
    assert most("schön", "de", "mouthPucker") > 0.3
    assert most("lune", "fr", "mouthPucker") > 0.4


def test_a_note_tells_that_a_spelling_does_not_say_how_words_sound():
    chinese = [Word(sign, 0.1 * k, 0.1 * k + 0.1, "zh") for k, sign in enumerate("晚上好")]
    with pytest.warns(CospeechWarning, match="the spelling of Chinese does not tell how '晚' sounds") as notes:
        note_unread_words(chinese)
    assert len(notes) == 1
    note_unread_words([*chinese, *(Word("ok", 0.5, 0.6, "zh") for _ in range(4))])  # most are read: no note
    note_unread_words(None)
    note_unread_words([Word("—", 0.0, 0.1)])
