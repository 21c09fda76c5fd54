"""Which language a text is in."""

from __future__ import annotations

import numpy as np
import pytest
import soundfile

from cospeech.audio.languages import LANGUAGES, check_language, find_language, script_of, with_language
from cospeech.audio.speech import Speech, Word, shift_times
from cospeech.audio.waiting_sound import WaitingSound
from cospeech.audio.waiting_words import WaitingWords
from cospeech.errors import InputError

TEXTS = {
    "en": "Good evening. My brother may bring pies. It was huge, but nobody noticed.",
    "de": "Das will sie am Mittwoch abgeben.",
    "fr": "Le temps est long. Il a beaucoup de champs.",
    "es": "No me digas. Me gusta. No, no quiero.",
    "it": "I ragazzi non hanno mangiato i biscotti.",
    "pt": "Não sei o que dizer, mas é muito bom.",
    "nl": "Ik weet het niet, maar dat is goed.",
    "pl": "Mama i tata i babcia idą do domu.",
    "sv": "Jag vet inte vad det är, tack så mycket.",
    "tr": "Bu çok büyük, ama kimse bilmiyor.",
    "ru": "Мой папа любит мамин борщ.",
    "uk": "Мій тато їсть борщ.",
    "el": "Το νερό είναι κρύο.",
    "he": "ערב טוב, אבא.",
    "ar": "مساء الخير",
    "fa": "پدرم خانه است",
    "hi": "मेरे पापा बहुत बड़े हैं।",
    "ja": "父は本を読みます。",
    "zh": "晚上好，我的爸爸妈妈。",
    "ko": "아빠가 빵을 먹습니다.",
    "th": "สวัสดีครับ",
}


@pytest.mark.parametrize(("code", "text"), TEXTS.items())
def test_a_text_tells_its_language(code, text):
    assert code in LANGUAGES
    assert find_language(text) == code


@pytest.mark.parametrize(
    "text", ["mama papa", "Hello world", "Die!", "", "1984", "La la la", "bin blue at f two now", "A man, a plan"]
)
def test_what_is_too_short_is_of_no_language(text):
    assert find_language(text) in ("", "en")


def test_a_code_is_known_or_an_error_names_the_nearest():
    assert [check_language(code) for code in ("", "de", "de-AT", "zh_Hans", "NB", "fil")] == ["", "de", "de", "zh", "no", "tl"]
    with pytest.raises(InputError, match=r"no language has the code 'german'.*the code of German is de"):
        check_language("german")
    with pytest.raises(InputError, match=r"'xx'.*known: en"):
        check_language("xx")
    with pytest.raises(InputError, match=r"the language 'de' of no words"):
        check_language("de", has_words=False)


def test_scripts_and_what_is_of_none():
    assert [script_of(c) for c in "aéßжλאبकかパ한漢ก"] == [
        "Latn", "Latn", "Latn", "Cyrl", "Grek", "Hebr", "Arab", "Deva", "Kana", "Kana", "Hang", "Hani", "Thai"
    ]  # fmt: skip
    assert not any(map(script_of, "7 -'。!́"))


def test_words_get_the_language_of_all_of_them_or_the_one_that_is_given():
    words = [Word(text, 0.1 * k, 0.1 * k + 0.1) for k, text in enumerate(["Das", "will", "sie", "nicht"])]
    assert {word.language for word in with_language(words)} == {"de"}
    assert {word.language for word in with_language(words, "nl-BE")} == {"nl"}
    assert [word.text for word in with_language(words)] == [word.text for word in words]


def test_a_transcript_brings_its_language_and_windows_keep_it(tmp_path):
    soundfile.write(tmp_path / "a.wav", np.full(32_000, 0.1), 16_000)
    (tmp_path / "a.txt").write_text("Das will sie nicht", "utf-8")
    speech = Speech.load(tmp_path / "a.wav", transcript=tmp_path / "a.txt")
    assert {word.language for word in speech.words} == {"de"}
    assert {word.language for word in shift_times(speech.window(0.5, 1.5), 0.5).words} == {"de"}
    given = Speech.load(tmp_path / "a.wav", transcript=tmp_path / "a.txt", language="en-GB")
    assert {word.language for word in given.words} == {"en"}
    with pytest.raises(InputError, match="no language has the code"):
        Speech.load(tmp_path / "a.wav", transcript=tmp_path / "a.txt", language="zz")


def test_a_word_in_the_language_seven_is_an_error():
    with pytest.raises(InputError, match="in the language 7"):
        Speech([0.0, 0.0], words=(Word("so", 0.0, 0.1, 7),))


def test_live_words_have_the_language_that_is_given():
    waiting = WaitingWords(WaitingSound(16_000), 16_000, print, "fr")
    waiting.put([Word("temps", 0.0, 0.1), Word("time", 0.1, 0.2, "en")])
    assert [word.language for word in waiting._words] == ["fr", "en"]


def test_every_letter_belongs_to_a_language_with_words():
    from cospeech.audio.languages import _LETTERS, _WORDS

    assert {code for codes in _LETTERS.values() for code in codes.split()} <= {*_WORDS}


@pytest.mark.parametrize(
    ("text", "code"),
    [
        ("El niño come una manzana y mira a su hermano", "es"),
        ("Cześć, dzisiaj porozmawiamy o domu i psach, jak to jest", "pl"),
        ("Добры дзень, сёння мы ў горадзе", "be"),
        ("Сәлеметсіз бе, бүгін жақсы күн", "kk"),
        ("Добрий день, сьогодні ми в місті", "uk"),
    ],
)
def test_letters_of_few_languages_tell(text, code):
    assert find_language(text) == code


def test_the_language_of_a_word_is_a_code():
    from cospeech.audio.word import Word, check_words

    check_words((Word("ja", 0.0, 1.0, "de"), Word("yes", 1.0, 2.0)))
    for wrong in ("de-AT", "DE", "german"):
        with pytest.raises(InputError, match="in the language"):
            check_words((Word("ja", 0.0, 1.0, wrong),))
