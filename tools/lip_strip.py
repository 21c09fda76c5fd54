"""Close-ups of lips, for the docs: the tracked face beside ours on the same mannequin, at a few moments of a tracked clip.

    python tools/lip_strip.py RAW CLIP OUT.png [--other BUNDLE.cospeech] [--step 0.12]

RAW is what ``cospeech prepare faces`` reads, and CLIP one of its clips with words; or RAW is a sound, and CLIP its transcript
with times. Rows: the tracked face, another mouth's face by the sound where a bundle is named, ours by the sound, ours with
the words.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from cospeech import Motion, Speech
from cospeech.corpora.clip import Clip
from cospeech.corpora.faces import read
from cospeech.export.render.camera import find_view
from cospeech.export.render.frames import FrameStream
from cospeech.export.render.light import draw_backdrop
from cospeech.export.render.worker import Look
from cospeech.motion.skeleton import humanoid
from cospeech.rules import RuleBasedModel
from cospeech.runtime.mouth import SHIPPED_FACE, BundleMouth, open_mouth

SIDE, LEFT, TOP = 150, 86, 22  # pixels: a picture, the names of the rows, the words
ZOOM, CORNER = 2.4, (0.29, 0.42)  # the camera of faces is enlarged, and cut out from this corner on
BACKDROP, INK = (205, 212, 222), (52, 64, 82)
RATE = 10.0


def pictures(weights: np.ndarray) -> list[Image.Image]:
    """T pictures of the mouth, from (T, 52) weights; the faces look ahead."""
    body, side = humanoid(), round(SIDE * ZOOM)
    rotations = np.broadcast_to(body.rest, (len(weights), len(body), 4)).astype(np.float32)
    root = np.broadcast_to(body.offsets[0], (len(weights), 3)).astype(np.float32)
    motion = Motion(RATE, rotations.copy(), root.copy(), weights.astype(np.float32), body)
    with FrameStream(Look(side, side, find_view("face"), BACKDROP), RATE, RATE) as stream:
        patches = [*stream.push(motion), *stream.flush()]
    blank = draw_backdrop(side, side, BACKDROP)
    images = [Image.fromarray(patch.paste(blank.copy())) for patch in patches]
    x, y = (round(share * side) for share in CORNER)
    return [picture.crop((x, y, x + SIDE, y + SIDE)) for picture in images[: len(weights)]]


def generate_face(speech: Speech, times: np.ndarray, bundle: Path) -> np.ndarray:
    """(T, 52) weights of the whole face with this mouth; the emotion is neutral."""
    system = open_mouth(bundle)
    model = RuleBasedModel(lambda: BundleMouth(system))
    face = model.generate(speech, parts=("face",), fps=100.0, emotion="neutral").face
    return np.asarray(face)[np.clip(np.rint(times * 100).astype(int), 0, len(face) - 1)]


def draw(speech: Speech, motion: Motion | None, other: Path | None, step: float) -> Image.Image:
    """The strip of one clip, with a tracked face or without one."""
    words = speech.words or ()
    times = np.arange(words[0].start - 0.06, min(words[-1].end + 0.1, float(speech.duration)), step)
    mute = replace(speech, words=None)
    rows = {}
    if motion is not None:
        rows["tracked"] = motion.face[np.clip(np.rint(times * motion.fps).astype(int), 0, len(motion) - 1)]
    rows |= {"before,\nby the sound": generate_face(mute, times, other)} if other is not None else {}
    rows |= {
        "by the\nsound": generate_face(mute, times, SHIPPED_FACE),
        "with\nwords": generate_face(speech, times, SHIPPED_FACE),
    }
    font = ImageFont.load_default(13)
    strip = Image.new("RGB", (LEFT + len(times) * SIDE, TOP + len(rows) * SIDE), "white")
    pen = ImageDraw.Draw(strip)
    for row, (name, weights) in enumerate(rows.items()):
        pen.text((5, TOP + row * SIDE + 16), name, fill=INK, font=font)
        for column, picture in enumerate(pictures(weights)):
            strip.paste(picture, (LEFT + column * SIDE, TOP + row * SIDE))
    for column, time in enumerate(times):
        text = next((word.text for word in words if word.start - 0.06 <= time < word.end - 0.03), "")
        pen.text((LEFT + column * SIDE + 4, 4), f"{time:.2f} s  {text}", fill=INK, font=font)
    return strip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("raw")
    parser.add_argument("clip")
    parser.add_argument("out", type=Path)
    parser.add_argument("--other", type=Path)
    parser.add_argument("--step", type=float, default=0.12)
    options = parser.parse_args()
    if Path(options.raw).is_file():
        speech, motion = Speech.load(options.raw, transcript=options.clip), None
    else:
        clip = next(clip for clip in read(options.raw) if isinstance(clip, Clip) and clip.name == options.clip)
        speech, motion = clip.speech, clip.motion
    draw(speech, motion, options.other, options.step).quantize(128).save(options.out, optimize=True)


if __name__ == "__main__":
    main()
