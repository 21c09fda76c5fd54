"""Draws the pictures of the README and the docs from the example speech: `make media`.

talk.gif shows the body, the face in close-up, and the speech with a moving marker and the words as they are said;
strip.png is what ``-o talk.png`` gives. styles-NAME.gif and the strips styles-NAME-SPEAKER.png are the stylised flow in three
styles of the weights that ship, on the example and on a second speech: ``python tools/make_media.py SPEECH [TRANSCRIPT]``.
chain-NAME.gif and its strip are Chain of Generation on that speech, as it hears it; chain-NAME-EMOTION.png two moods of it.
Further recordings (``… SPEECH TRANSCRIPT MORE …``, of TRANSCRIPT "" where there is none) get face-NAME.png, the learnt mouth.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import soundfile
from PIL import Image, ImageDraw, ImageFont

import cospeech
from cospeech.cli.demo import EXAMPLE, EXAMPLE_WORDS
from cospeech.export.render.camera import find_view
from cospeech.export.render.frames import FrameStream
from cospeech.export.render.light import draw_backdrop
from cospeech.export.render.worker import Look

MEDIA = Path(__file__).resolve().parents[1] / "docs" / "media"
STYLE, EMOTION, SEED = "natural", "happiness", 0
SAID = 6.0  # seconds of a face in close-up
SECONDS = 7.6  # of the example: the greeting, tiny and huge
RATE = 12.5  # pictures per second
WIDE, HIGH, FACE = 440, 420, 280  # pixels: the body's picture, and the side of the face's
PEOPLE, SIDE, BELOW = ("ada", "cleo", "dan"), 300, 130  # of the weights that ship; pixels
MOODS = ("happiness", "sadness")
BACKDROP, INK, PALE, MARK = (205, 212, 222), (52, 64, 82), (150, 166, 188), (214, 84, 60)


def pictures(motion: cospeech.Motion, camera: str, width: int, height: int) -> Iterator[Image.Image]:
    """The motion as seen by one camera, at `RATE`."""
    with FrameStream(Look(width, height, find_view(camera), BACKDROP), motion.fps, RATE) as frames:
        blank = draw_backdrop(width, height, BACKDROP)
        for patch in (*frames.push(motion), *frames.flush()):
            yield Image.fromarray(patch.paste(blank.copy()))


def sound(speech: cospeech.Speech, at: float, width: int, height: int) -> Image.Image:
    """The waveform with a marker at ``at`` seconds, and the words around it."""
    image = Image.new("RGB", (width, height), (244, 246, 249))
    draw = ImageDraw.Draw(image)
    samples = np.abs(speech.samples[: int(SECONDS * speech.rate)])
    columns = np.array_split(samples, width - 24)
    middle, half = 44, 30
    for x, column in enumerate(columns):
        reach = max(1, round(half * min(1.0, float(column.max()) / 0.6)))
        is_past = x < at / SECONDS * (width - 24)
        draw.line((x + 12, middle - reach, x + 12, middle + reach), fill=INK if is_past else PALE)
    x = 12 + at / SECONDS * (width - 24)
    draw.line((x, middle - half - 6, x, middle + half + 6), fill=MARK, width=2)
    font = ImageFont.load_default(19)
    words = speech.words or ()
    now = next((k for k, word in enumerate(words) if word.start - 0.05 <= at < word.end + 0.25), None)
    if now is not None:
        draw.text((width / 2, height - 34), words[now].text, fill=MARK, font=font, anchor="mm")
        before = words[now - 1].text if now else ""
        after = words[now + 1].text if now + 1 < len(words) else ""
        room = font.getlength(words[now].text) / 2 + 12
        draw.text((width / 2 - room, height - 34), before, fill=PALE, font=font, anchor="rm")
        draw.text((width / 2 + room, height - 34), after, fill=PALE, font=font, anchor="lm")
    return image


def moving_picture(speech: cospeech.Speech, motion: cospeech.Motion, path: Path) -> None:
    """Compose and write a picture such as talk.gif."""
    part = motion[: round(SECONDS * motion.fps)]
    frames = []
    for k, (body, face) in enumerate(zip(pictures(part, "body", WIDE, HIGH), pictures(part, "face", FACE, FACE), strict=True)):
        frame = Image.new("RGB", (WIDE + FACE, HIGH))
        frame.paste(body, (0, 0))
        frame.paste(face, (WIDE, 0))
        frame.paste(sound(speech, k / RATE, FACE, HIGH - FACE), (WIDE, FACE))
        frames.append(frame)
    save_gif(frames, path)


def save_gif(frames: list[Image.Image], path: Path) -> None:
    """One palette for all pictures, so that still parts cost nothing."""
    some = Image.new("RGB", (frames[0].width, frames[0].height * 6))
    for k, frame in enumerate(frames[:: max(1, len(frames) // 6)][:6]):
        some.paste(frame, (0, k * frame.height))
    palette = some.quantize(255, method=Image.Quantize.MEDIANCUT, kmeans=1)
    flat = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames]
    flat[0].save(path, save_all=True, append_images=flat[1:], duration=round(1000 / RATE), loop=0, disposal=1)


def people(speech: cospeech.Speech, audio: Path, name: str) -> None:
    """Three styles side by side above the sound, and a strip of each."""
    model = cospeech.load("stylised-flow")
    usual = {"emotion": "neutral", **model.for_files}
    motions = [model.generate(speech, style=who, seed=SEED + k, **usual) for k, who in enumerate(PEOPLE)]
    for who, motion in zip(PEOPLE, motions, strict=True):
        motion.save(MEDIA / f"styles-{name}-{who}.png", audio=audio, words=list(speech.words or ()))
    parts = [motion[: round(SECONDS * motion.fps)] for motion in motions]
    frames, font = [], ImageFont.load_default(17)
    for k, bodies in enumerate(zip(*(pictures(part, "body", SIDE, SIDE) for part in parts), strict=True)):
        frame = Image.new("RGB", (SIDE * len(PEOPLE), SIDE + BELOW))
        for place, (who, body) in enumerate(zip(PEOPLE, bodies, strict=True)):
            frame.paste(body, (place * SIDE, 0))
            ImageDraw.Draw(frame).text(((place + 0.5) * SIDE, 16), who, fill=INK, font=font, anchor="mm")
        frame.paste(sound(speech, k / RATE, frame.width, BELOW), (0, SIDE))
        frames.append(frame)
    save_gif(frames, MEDIA / f"styles-{name}.gif")


def chain(speech: cospeech.Speech, audio: Path, name: str) -> None:
    """Chain of Generation: moving and as a strip, and as strips in other moods."""
    model = cospeech.load("chain-of-generation")
    for emotion in ("auto", *MOODS):
        motion = model.generate(speech, emotion=emotion, seed=SEED, **model.for_files)
        stem = f"chain-{name}" if emotion == "auto" else f"chain-{name}-{emotion}"
        motion.save(MEDIA / f"{stem}.png", audio=audio, words=list(speech.words or ()))
        if emotion == "auto":
            moving_picture(speech, motion, MEDIA / f"{stem}.gif")


def face(path: Path) -> None:
    """The beginning of a recording in close-up."""
    speech = cospeech.Speech.load(path).window(0, SAID)
    motion = cospeech.load("rules").generate(speech, seed=SEED)
    with TemporaryDirectory() as folder:
        sound_file = Path(folder) / "said.wav"
        soundfile.write(sound_file, speech.samples, speech.rate)
        motion.save(MEDIA / f"face-{path.stem.lower()}.png", camera="face", audio=sound_file)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("speech", nargs="?", type=Path, help="a second speech")
    parser.add_argument("transcript", nargs="?", default="", help='of it; "" where there is none')
    parser.add_argument("more", nargs="*", type=Path, help="recordings whose face is drawn")
    options = parser.parse_args()
    speech = cospeech.Speech.load(EXAMPLE, transcript=EXAMPLE_WORDS)
    motion = cospeech.load("rules").generate(speech, style=STYLE, emotion=EMOTION, seed=SEED)
    MEDIA.mkdir(exist_ok=True)
    moving_picture(speech, motion, MEDIA / "talk.gif")
    motion.save(MEDIA / "strip.png", audio=EXAMPLE, words=list(speech.words or ()))
    people(speech, EXAMPLE, "example")
    if options.speech is not None:
        other = cospeech.Speech.load(options.speech, transcript=options.transcript or None)
        people(other, options.speech, options.speech.stem)
        chain(other, options.speech, options.speech.stem)
    for more in options.more:
        face(more)
    for path in sorted(MEDIA.iterdir()):
        print(f"{path.name}: {path.stat().st_size / 1e6:.2f} MB")


if __name__ == "__main__":
    main()
