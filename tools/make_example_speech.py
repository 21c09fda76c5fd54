"""Makes the example speech of the package: a monologue by Flite's voice "slt", with the word times that Flite itself used.

    apt install libflite1        # Debian, Ubuntu; any build of Flite with the cmu_us_slt voice does
    python tools/make_example_speech.py

writes example.ogg, .TextGrid and .txt into src/cospeech/assets/example. Each sentence is one utterance with a pace and a pitch
of its own, so that the monologue is livelier than Flite makes it; the pauses between them are set here.
"""

import argparse
import ctypes
import ctypes.util
from pathlib import Path
from typing import NamedTuple

import numpy as np
import soundfile

HERE = Path(__file__).resolve().parents[1] / "src" / "cospeech" / "assets" / "example"
RATE = 16_000  # Hz, of the voice


class Line(NamedTuple):
    text: str
    stretch: float  # of all durations; 1 is the voice's own pace
    pitch: float  # Hz, mean
    spread: float  # Hz, standard deviation of the intonation
    pause: float  # seconds of silence after it


LINES = (
    Line("Hi! I'm so happy to meet you.", 0.92, 205, 51, 0.40),
    Line("Yesterday, I was tiny. Only this small.", 0.93, 188, 39, 0.30),
    Line("But today, I am huge!", 0.98, 212, 63, 0.45),
    Line("I have two hands, ten fingers, and absolutely nothing to hide.", 0.88, 196, 51, 0.50),
    Line("Look up there, look left: we can all do this, together!", 0.9, 208, 57, 0.45),
    Line("Are you ready? No? Never mind, I will go first.", 0.88, 200, 51, 0.40),
)
# Features of the voice; Flite keeps the pointers, so these bytes must live as long as it does.
STRETCH, PITCH, SPREAD = b"duration_stretch", b"int_f0_target_mean", b"int_f0_target_stddev"
FADE = 0.01  # seconds, at the joins: no clicks


class Wave(ctypes.Structure):
    """cst_wave of Flite 2.x."""

    _fields_ = (
        ("type", ctypes.c_char_p),
        ("sample_rate", ctypes.c_int),
        ("num_samples", ctypes.c_int),
        ("num_channels", ctypes.c_int),
        ("samples", ctypes.POINTER(ctypes.c_short)),
    )


class Flite:
    """The few functions of libflite that are needed, with their types."""

    def __init__(self) -> None:
        self.lib = _library("flite")
        for part in ("flite_usenglish", "flite_cmulex"):
            _library(part)
        self.lib.flite_init()
        pointer, text, real = ctypes.c_void_p, ctypes.c_char_p, ctypes.c_float
        for name, result, arguments in (
            ("flite_synth_text", pointer, (text, pointer)),
            ("utt_wave", ctypes.POINTER(Wave), (pointer,)),
            ("utt_relation", pointer, (pointer, text)),
            ("relation_head", pointer, (pointer,)),
            ("item_next", pointer, (pointer,)),
            ("item_feat_float", real, (pointer, text)),
            ("ffeature_string", text, (pointer, text)),
            ("ffeature_int", ctypes.c_int, (pointer, text)),
            ("flite_feat_set_float", None, (pointer, text, real)),
            ("delete_utterance", None, (pointer,)),
        ):
            function = getattr(self.lib, name)
            function.restype, function.argtypes = result, arguments
        register = _library("flite_cmu_us_slt").register_cmu_us_slt
        register.restype, register.argtypes = pointer, (text,)
        self.voice = register(None)
        self.features = ctypes.cast(self.voice + ctypes.sizeof(pointer), ctypes.POINTER(pointer))[
            0
        ]  # cst_voice: name, features

    def speak(self, line: Line) -> tuple[np.ndarray, list[tuple[str, float, float]]]:
        """Samples and (word, start, end) in seconds."""
        for name, value in ((STRETCH, line.stretch), (PITCH, line.pitch), (SPREAD, line.spread)):
            self.lib.flite_feat_set_float(self.features, name, value)
        utterance = self.lib.flite_synth_text(line.text.encode(), self.voice)
        wave = self.lib.utt_wave(utterance).contents
        assert wave.sample_rate == RATE
        samples = np.ctypeslib.as_array(wave.samples, (wave.num_samples,)).copy()
        words = self._words(utterance)
        self.lib.delete_utterance(utterance)
        return samples, words

    def _words(self, utterance: int) -> list[tuple[str, float, float]]:
        """From the segments: each knows its end and, through its syllable, its token ("I'm" is one token of two words)."""
        words: list[tuple[str, float, float]] = []
        segment = self.lib.relation_head(self.lib.utt_relation(utterance, b"Segment"))
        start, before = 0.0, None
        while segment:
            end = self.lib.item_feat_float(segment, b"end")
            path = b"R:SylStructure.parent.parent.R:Token.parent."
            token = self.lib.ffeature_string(segment, path + b"name").decode()
            place = self.lib.ffeature_int(segment, path + b"file_pos")
            if token != "0":
                if (token, place) == before:
                    words[-1] = (token, words[-1][1], end)
                else:
                    words.append((token, start, end))
                before = (token, place)
            start, segment = end, self.lib.item_next(segment)
        return words


def _library(name: str) -> ctypes.CDLL:
    path = ctypes.util.find_library(name)
    if path is None:
        raise SystemExit(f"error: lib{name} is not installed (apt install libflite1)")
    return ctypes.CDLL(path, mode=ctypes.RTLD_GLOBAL)


def make() -> tuple[np.ndarray, list[tuple[str, float, float]]]:
    flite = Flite()
    parts: list[np.ndarray] = []
    words: list[tuple[str, float, float]] = []
    at = 0
    for line in LINES:
        samples, line_words = flite.speak(line)
        first = max(0, round((line_words[0][1] - 0.1) * RATE))  # Flite's own silences around an utterance are cut to 0.1 s
        last = min(len(samples), round((line_words[-1][2] + 0.1) * RATE))
        sound = samples[first:last].astype(np.float32) / 32768
        fade = np.minimum(1, np.arange(len(sound)) / (FADE * RATE))
        parts += [sound * fade * fade[::-1], np.zeros(round(line.pause * RATE), np.float32)]
        words += [(text, (at - first) / RATE + start, (at - first) / RATE + end) for text, start, end in line_words]
        at += sum(map(len, parts[-2:]))
    speech = np.concatenate(parts)
    return (speech * (0.7 / np.abs(speech).max())).astype(np.float32), words


def textgrid(words: list[tuple[str, float, float]], seconds: float) -> str:
    """Long form, one tier "words", silences as empty intervals."""
    intervals: list[tuple[float, float, str]] = []
    at = 0.0
    for text, start, end in [*words, ("", seconds, seconds)]:
        if start > at:
            intervals.append((at, start, ""))
        if text:
            intervals.append((start, end, text))
        at = end
    span = f"xmin = 0\n{{}}xmax = {seconds:.4f}\n"
    head = f'File type = "ooTextFile"\nObject class = "TextGrid"\n\n{span.format("")}tiers? <exists>\nsize = 1\n'
    tier = f'item []:\n    item [1]:\n{" " * 8}class = "IntervalTier"\n{" " * 8}name = "words"\n{" " * 8}{span.format(" " * 8)}'
    body = "".join(
        f'        intervals [{i}]:\n            xmin = {start:.4f}\n            xmax = {end:.4f}\n            text = "{text}"\n'
        for i, (start, end, text) in enumerate(intervals, 1)
    )
    return f"{head}{tier}        intervals: size = {len(intervals)}\n{body}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--out", type=Path, default=HERE, help="folder to write to")
    out = parser.parse_args().out
    speech, words = make()
    out.mkdir(parents=True, exist_ok=True)
    soundfile.write(out / "example.ogg", speech, RATE, format="OGG", subtype="VORBIS", compression_level=0.3)
    (out / "example.TextGrid").write_text(textgrid(words, len(speech) / RATE), encoding="utf-8")
    (out / "example.txt").write_text("\n".join(line.text for line in LINES) + "\n", encoding="utf-8")
    print(f"{len(speech) / RATE:.2f} s, {len(words)} words, {(out / 'example.ogg').stat().st_size / 1024:.0f} KiB in {out}")


if __name__ == "__main__":
    main()
