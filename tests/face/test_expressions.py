"""Expressions that leave speech alone: closures under every emotion, laughter from words, accents that move brows and head."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from cospeech import models
from cospeech.audio.prosodic_events import Accent
from cospeech.audio.speech import Speech, Word
from cospeech.audio.spoken_text import list_tokens
from cospeech.audio.word import LAUGHTER
from cospeech.cli.demo import EXAMPLE, EXAMPLE_WORDS
from cospeech.face.expressions import accent_brows, couple
from cospeech.face.laughter import AFTER, LAUGHS, laughter
from cospeech.face.visemes import VISEMES, phones_of
from cospeech.motion.motion import Motion
from cospeech.motion.skeletons.arkit import ARKIT_INDEX
from tests.face.test_face import EMOTIONS, channel

FPS = 60.0


@cache
def talk(words: bool = True) -> Speech:
    speech = Speech.load(EXAMPLE, transcript=EXAMPLE_WORDS if words else None)
    return speech


@cache
def show_emotion(emotion: str, words: bool = True) -> Motion:
    """The face that ships, with the words of the example."""
    return models.load("rules").generate(talk(words), parts=("face",), emotion=emotion, fps=FPS, seed=2)


def onsets(*names: str) -> list[slice]:
    """Frames around the onsets of phones of these visemes."""
    phones = phones_of(talk().words, 0.0, float(talk().duration))
    starts = [c - h for c, h, v in zip(phones.centre, phones.half, phones.viseme, strict=True) if VISEMES[v] in names]
    return [slice(round((t - 0.06) * FPS), round((t + 0.1) * FPS) + 1) for t in starts if t > 0.1]


def aperture(face: np.ndarray) -> np.ndarray:
    """(T,) how far the mouth is open: by the jaw, and by the lips beyond what the jaw does."""
    lips = [channel(face, name + side) for name in ("mouthLowerDown", "mouthUpperUp") for side in ("Left", "Right")]
    return channel(face, "jawOpen") - channel(face, "mouthClose") + np.mean(lips, 0)


@pytest.mark.slow
@pytest.mark.parametrize("emotion", EMOTIONS)
def test_lips_close_for_every_b_p_and_m_whatever_is_felt(emotion):
    apart = aperture(show_emotion(emotion).face)
    closures = onsets("PP")
    assert len(closures) >= 4
    assert max(apart[at].min() for at in closures) < 0.05
    assert np.quantile(apart, 0.9) > 0.15  # the mouth speaks


@pytest.mark.slow
def test_by_the_sound_alone_most_of_them_close():
    apart = aperture(show_emotion("neutral", words=False).face)
    assert np.mean([apart[at].min() < 0.05 for at in onsets("PP")]) >= 0.5


def test_known_words_round_the_lips_for_o_and_u():
    def measure_rounding(motion, names):
        lips = channel(motion.face, "mouthPucker") + channel(motion.face, "mouthFunnel")
        return np.mean([lips[at].max() for at in onsets(*names)])

    with_words = show_emotion("neutral")
    assert measure_rounding(with_words, ("O", "U")) > max(0.4, 1.6 * measure_rounding(with_words, ("I",)))
    assert measure_rounding(with_words, ("O", "U")) > measure_rounding(show_emotion("neutral", words=False), ("O", "U"))


def test_emotions_change_more_than_the_mouth_and_differ_from_each_other():
    """Brows, lids and cheeks alone tell any two emotions apart."""
    upper = [k for name, k in ARKIT_INDEX.items() if name.startswith(("brow", "cheek", "nose", "eyeSquint", "eyeWide"))]
    mean = {emotion: show_emotion(emotion).face[:, upper].mean(0) for emotion in EMOTIONS}
    for one in EMOTIONS:
        for other in set(EMOTIONS) - {one}:
            assert np.abs(mean[one] - mean[other]).max() > 0.15


def test_happiness_lifts_cheeks_and_leaves_the_eyes_open():
    """A smile below lowered lids looks smug."""
    happy = show_emotion("happiness").face
    assert channel(happy, "cheekSquintLeft").mean() > 0.5
    assert channel(happy, "eyeSquintLeft").mean() < 0.25 * channel(happy, "cheekSquintLeft").mean()
    assert channel(happy, "mouthDimpleLeft").mean() < 0.05


@pytest.mark.parametrize(
    ("text", "laughs"),
    [("haha", True), ("Hahaha!", True), ("hehe", True), ("[laughter]", True), ("(laughs)", True), ("laughter", False),
     ("laughs", False), ("ha", False), ("aha", False), ("banana", False), ("he", False), ("", False)],
)  # fmt: skip
def test_laughter_is_told_from_words(text, laughs):
    times = np.arange(0, 5, 0.05)
    weights = laughter(times, [Word(text, 1.0, 1.6)])
    assert (weights.max() > 0) == laughs
    if laughs:
        assert weights[(times > 1.0) & (times < 1.6)].min() > 0.95
        assert 0 < weights[np.searchsorted(times, 2.0)] < 1
        assert not weights[(times < 0.8) | (times > 1.6 + AFTER)].any()


@pytest.mark.parametrize(
    ("language", "laughing", "plain"),
    [("de", "haha hihi Hehehe [Lachen] (lacht) ahaha ha-ha", "hohe hoho-Wort jaja jajaja Lachen hatte höhe"),
     ("fr", "hahaha [rires] (rit)", "rires rit ha"), ("es", "jaja jejeje jajajaj [risas]", "jaula risas jota"),
     ("en", "haha jajaja", "jaja hohe heha hah www"), ("ru", "хаха ахаха ха-ха (смех)", "хата уха смех хахе"),
     ("ja", "ハハハ ははは あはは ｗｗｗ [笑い] （笑） 【笑】", "はは 笑 笑い はな"), ("zh", "哈哈 哈哈哈 （笑）", "哈 笑"),
     ("ko", "하하 ㅋㅋ ㅎㅎㅎ [웃음]", "하 웃음 하루"), ("ar", "ههه هههه هاها [ضحك]", "هه ها ضحك"),
     ("", "haha [laughter]", "hohe laugh [] ()")],
)  # fmt: skip
def test_laughter_in_other_languages(language, laughing, plain):
    def laughs(text):
        return laughter(np.arange(0, 5, 0.05), [Word(text, 1.0, 1.6, language)]).max() > 0

    assert [text for text in laughing.split() if not laughs(text)] == []
    assert [text for text in plain.split() if laughs(text)] == []


@pytest.mark.parametrize(
    ("names", "others"),
    [("laughs|Laughing hard|chuckles|haha|Lachen|kichert|rit|rires|risas|riem|latter|ler|смех|хохочет|笑い|웃음|ㅋㅋ|ضحكات|हँसी",
      "audience laughter|hohe Berge|sighs|微笑|Wort|behave|publikum lacht")],
)  # fmt: skip
def test_a_transcript_and_the_face_know_the_same_names_of_laughter(names, others):
    for text in (*names.split("|"), *others.split("|")):
        laughs = text in names.split("|")
        assert (list_tokens(f"[{text}]") == [LAUGHTER]) is laughs, text
        assert (laughter(np.array([1.3]), [Word(f"[{text}]", 1.0, 1.6)]).item() > 0) is laughs, text


def test_a_laugh_shows_in_the_face():
    speech = Speech(talk().samples[:64_000], 16_000, (Word("haha", 1.0, 1.6),))
    face = models.load("rules").generate(speech, parts=("face",), emotion="neutral", fps=FPS).face
    smile = channel(face, "mouthSmileLeft")
    assert smile[70:90].min() > 0.8 * LAUGHS[ARKIT_INDEX["mouthSmileLeft"]]
    assert smile[200:].max() < 0.4


def test_emphasis_says_how_many_accents_move_the_brows_and_how_far():
    accents = [Accent(2.0 + 3.0 * k, 0.8) for k in range(300)]
    peaks = np.array([a.time for a in accents])
    rises = {amount: accent_brows(peaks, accents, seed=7, amount=amount)[:, :3].max(1) for amount in (0.0, 0.5, 1.0, 2.0)}
    shares = {amount: (rise > 0.05).mean() for amount, rise in rises.items()}
    assert rises[0.0].max() == 0
    assert 0 < shares[0.5] < shares[1.0] < shares[2.0]
    assert np.median(rises[2.0][rises[2.0] > 0.05]) > 1.2 * np.median(rises[1.0][rises[1.0] > 0.05])


def test_brows_go_along_with_strokes_as_closely_as_they_are_coupled():
    accents = [Accent(2.0 * k, 0.6) for k in range(1, 400)]
    peaks, strokes = np.array([a.time for a in accents]), [a.time for a in accents[::2]]
    shares = {}
    for amount in (0.0, 0.5, 1.0):
        up = accent_brows(peaks, accents, seed=3, strokes=strokes, coupling=amount)[:, :3].max(1) > 0.05
        shares[amount] = up[::2].mean(), up[1::2].mean()
    assert abs(shares[0.0][0] - shares[0.0][1]) < 0.1
    assert shares[0.5][0] > shares[0.5][1] + 0.3
    assert shares[1.0][0] > 0.85
    assert shares[1.0][1] < 0.1
    assert abs(np.mean(shares[0.5]) - np.mean(shares[0.0])) < 0.1  # how often is as before
    assert couple(0.3, True, 0.0) == couple(0.3, False, 0.0) == 0.3
