"""A contact sheet for the docs: twelve frames over three seconds of recorded takes and of ours, on the same mannequin.

    python tools/mocap_sheet.py OUT.png --speech SPEECH ROW…

A ROW is a motion file, a style of the rules (``rules:lively``) or a model by name, each with an ``@`` and the second at which
it begins: ``13_26.bvh@4 rules:natural@8 mix-stage@8``. Trained models stand as files of `cospeech generate` do. Recorded
people are turned to the camera.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

import cospeech
from cospeech import Motion, Speech
from cospeech.export.mannequin import build
from cospeech.export.render.camera import View
from cospeech.export.render.scene import Scene
from cospeech.motion.rotations import quat_multiply, quat_rotate
from cospeech.motion.skeleton import humanoid

FRAMES, SECONDS, FPS = 12, 3.0, 30.0
SIDE, HEIGHT, TOP = 120, 190, 15  # pixels: a frame, and the name of a row above it
FROM_THE_SIDE = 25.0  # degrees
BACKDROP, INK = (228, 231, 235), (20, 20, 20)
LOW, HIGH = np.array([-0.5, -0.05, -0.3]), np.array([0.5, 1.85, 0.4])  # metres: what the camera shows


def perform(name: str, speech: Speech) -> tuple[str, Motion]:
    """What a row is called, and its motion."""
    if Path(name).suffix:
        take = Motion.load(name)
        take = take if take.skeleton.kind == "humanoid" else take.retarget("humanoid")
        return f"motion capture, take {Path(name).stem}", _face_the_camera(take.resample(FPS))
    kind, _, style = name.partition(":")
    model = cospeech.load(kind)
    more = {"style": style} if style else model.for_files
    return name.replace(":", ", "), model.generate(speech, emotion="neutral", fps=FPS, seed=0, **more)


def _face_the_camera(take: Motion) -> Motion:
    ahead = quat_rotate(take.rotations[:, 0].astype(float), np.array([0.0, 0.0, 1.0])).mean(0)
    half = -0.5 * np.arctan2(ahead[0], ahead[2])
    turn = np.array([0.0, np.sin(half), 0.0, np.cos(half)])
    rotations = take.rotations.copy()
    rotations[:, 0] = quat_multiply(turn, rotations[:, 0].astype(float))
    root = quat_rotate(turn, take.root.astype(float)).astype(np.float32)
    return Motion(take.fps, rotations, root, take.face, take.skeleton)


def draw_row(scene: Scene, motion: Motion, start: float) -> list[Image.Image]:
    """The frames of a row, with the mean place in the middle."""
    frames = np.round((start + np.arange(FRAMES) * SECONDS / FRAMES) * FPS).astype(int)
    if frames[-1] >= len(motion):
        raise SystemExit(f"error: {SECONDS:g} s from second {start:g} on, of a motion of {len(motion) / FPS:.1f} s")
    root = motion.root[frames].astype(float)
    root -= root.mean(0) * [1.0, 0.0, 1.0]
    positions, world = humanoid().forward(motion.rotations[frames].astype(float), root)
    camera = View((), (-0.42, -0.05, -0.2), (0.42, 1.8, 0.3), 0.06, FROM_THE_SIDE, 5, 22).camera(LOW, HIGH, SIDE, HEIGHT)
    faces = [None] * FRAMES if motion.face is None else motion.face[frames]
    return [Image.fromarray(scene.draw(camera, *pose)) for pose in zip(world, positions, faces, strict=True)]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("rows", nargs="+", metavar="ROW")
    parser.add_argument("--speech", type=Path, required=True, help="what ours speak")
    options = parser.parse_args()
    speech, scene = Speech.load(options.speech), Scene(build(), SIDE, HEIGHT, BACKDROP)
    sheet = Image.new("RGB", (FRAMES * SIDE, len(options.rows) * (HEIGHT + TOP)), "white")
    pen = ImageDraw.Draw(sheet)
    for row, what in enumerate(options.rows):
        name, _, start = what.partition("@")
        title, motion = perform(name, speech)
        pen.text((4, row * (HEIGHT + TOP) + 1), title, fill=INK, font=ImageFont.load_default(11))
        for column, picture in enumerate(draw_row(scene, motion, float(start or 0))):
            sheet.paste(picture, (column * SIDE, row * (HEIGHT + TOP) + TOP))
    sheet.quantize(192).save(options.out, optimize=True)


if __name__ == "__main__":
    main()
