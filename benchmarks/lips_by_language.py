"""Do lips close at b, p and m in many languages? ``python benchmarks/lips_by_language.py``, as Markdown; needs espeak-ng.

Synthetic voices say a sentence of ours. The words come from plain text. Of each b, p and m that the spelling tells, the gap
between the lips is measured (`jawOpen` − `mouthClose`, the smallest within 80 ms), once from the sound alone and once with the
words.
"""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from pathlib import Path

import numpy as np

from cospeech import Speech, load
from cospeech.face.graphemes import graphemes_to_phones
from cospeech.motion.skeletons.arkit import ARKIT_INDEX

NEAR = 0.08  # seconds
SENTENCES = {
    "en": ("en-us", "Bob may bring a big map. My mother puts pepper on the bread, and papa buys more beans."),
    "de": ("de", "Meine Mama bringt bald Brot und Butter. Papa malt im Park einen bunten Baum, aber Emma mag lieber Blumen."),
    "fr": ("fr", "Ma maman porte un beau bonbon à papa. Bob pose la pomme sur le banc, et Marie mange une banane."),
    "es": ("es", "Mi mamá vive bien en Bilbao. Papá bebe vino y mi abuela prepara pan con mermelada."),
    "it": ("it", "La mamma prepara il pane. Papà beve un bicchiere, e il bambino mangia una banana."),
    "tr": ("tr", "Benim babam bugün pazardan ekmek ve biber alıyor, annem mutfakta börek yapıyor."),
    "ru": ("ru", "Моя мама пьёт кофе с молоком. Папа любит борщ, а бабушка варит рыбу и картошку."),
    "el": ("el", "Η μαμά πίνει καφέ. Ο μπαμπάς παίζει μπάλα και μιλάει με τον παππού."),
    "ja": ("ja", "まいばん ぱぱと ままは ぶどうを たべます。ぼくは もも と ばなな も たべたい。"),
    "ko": ("ko", "엄마가 빵을 먹어요. 아빠는 밥을 많이 먹고 물을 마셔요."),
    "hi": ("hi", "मेरी माँ बाज़ार में फल खरीदती है। पापा बगीचे में पौधों को पानी देते हैं।"),
    "ar": ("ar", "أمي تشرب الماء في البيت. أبي يحب الكتب الكبيرة ويكتب كلاما جميلا."),
}
"""Language → espeak-ng's voice, and a sentence of ours."""


def speak(voice: str, text: str, path: Path) -> Speech:
    """A sentence, said and written."""
    program = shutil.which("espeak-ng")
    if program is None:
        raise SystemExit("espeak-ng is not installed")
    subprocess.run([program, "-v", voice, "-w", str(path), text], check=True)
    path.with_suffix(".txt").write_text(text, "utf-8")
    return Speech.load(path, transcript=path.with_suffix(".txt"))


def closures(speech: Speech) -> list[float]:
    """The times of b, p and m, in seconds; phones of a word share its time equally."""
    times = []
    for word in speech.words or ():
        phones = graphemes_to_phones(word.text, word.language)
        length = (word.end - word.start) / max(len(phones), 1)
        times += [word.start + (k + 0.5) * length for k, phone in enumerate(phones) if phone in ("b", "p", "m")]
    return times


def gaps(speech: Speech, times: list[float]) -> list[float]:
    """The gap between the lips at some times."""
    motion = load("rules").generate(speech, seed=0, emotion="neutral", parts=("face",))
    assert motion.face is not None
    gap = np.maximum(motion.face[:, ARKIT_INDEX["jawOpen"]] - motion.face[:, ARKIT_INDEX["mouthClose"]], 0)
    at = np.arange(len(gap)) / motion.fps
    return [float(gap[np.abs(at - time) <= NEAR].min()) for time in times if (np.abs(at - time) <= NEAR).any()]


def main() -> None:
    print("| | closures | gap, sound alone | gap, with words |\n| --- | ---: | ---: | ---: |")
    with tempfile.TemporaryDirectory() as place:
        for language, (voice, text) in SENTENCES.items():
            speech = speak(voice, text, Path(place) / f"{language}.wav")
            assert speech.words is not None
            assert {word.language for word in speech.words} == {language}, language
            times = closures(speech)
            alone = Speech(speech.samples, speech.rate)
            cells = [f"{np.mean(values):.3f}, {max(values):.3f}" for values in (gaps(alone, times), gaps(speech, times))]
            print(f"| {language} | {len(times)} | {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main()
