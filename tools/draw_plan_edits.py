"""Pictures of the edits of a plan, for the docs: `python tools/draw_plan_edits.py [FOLDER]` writes one PNG for each kind.

The upper row is the example speech as it is generated, the lower row the same moments after the edit. Bars are gestures, from
the beginning of the preparation to the end of the stroke; those that differ are coloured.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

import cospeech
from cospeech import Motion, Plan, Speech
from cospeech.cli.demo import EXAMPLE
from cospeech.export.render.camera import find_view
from cospeech.export.render.frames import FrameStream
from cospeech.export.render.light import draw_backdrop
from cospeech.export.render.worker import Look
from cospeech.models import Model
from cospeech.runtime.motion_switch import KeptStretches

ROOT = Path(__file__).resolve().parents[1]
WIDTH, HEIGHT, LEFT, BAR = 128, 168, 70, 34  # pixels: a figure, the names of the rows, a row of bars
COUNT = 8  # figures in a row
BACKDROP, INK, GREY, CHANGED = (205, 212, 222), (52, 64, 82), (150, 160, 174), (214, 110, 40)
FPS = 30


def figures(motions: list[Motion], times: np.ndarray) -> list[list[Image.Image]]:
    """The mannequin at these times in seconds, a row for each motion; the camera stands still."""
    still = Motion.concatenate([_pick(motion, times) for motion in motions])
    with FrameStream(Look(WIDTH, HEIGHT, find_view("body"), BACKDROP), FPS, FPS) as stream:
        patches = [*stream.push(still), *stream.flush()]
    blank = draw_backdrop(WIDTH, HEIGHT, BACKDROP)
    images = [Image.fromarray(patch.paste(blank.copy())) for patch in patches[: len(still)]]
    return [images[k : k + len(times)] for k in range(0, len(still), len(times))]


def _pick(motion: Motion, times: np.ndarray) -> Motion:
    frames = np.clip(np.round(times * FPS).astype(int), 0, len(motion) - 1)
    return Motion(FPS, motion.rotations[frames], motion.root[frames], motion.face[frames], motion.skeleton)


def draw(before: tuple[Motion, Plan], after: tuple[Motion, Plan], low: float, high: float, title: str) -> Image.Image:
    """Both performances from ``low`` to ``high`` seconds."""
    font = ImageFont.load_default(13)
    page = Image.new("RGB", (LEFT + COUNT * WIDTH, 22 + 2 * (HEIGHT + BAR) + 20), "white")
    pen = ImageDraw.Draw(page)
    pen.text((6, 3), title, fill=INK, font=font)
    times = low + (np.arange(COUNT) + 0.5) * (high - low) / COUNT
    images = figures([before[0], after[0]], times)
    old_gestures = {(each.form, each.stroke, each.hands, each.size) for each in before[1].gestures}
    new_gestures = {(each.form, each.stroke, each.hands, each.size) for each in after[1].gestures}
    for row, (name, (_, plan), other) in enumerate((("before", before, new_gestures), ("after", after, old_gestures))):
        top = 22 + row * (HEIGHT + BAR)
        pen.text((6, top + HEIGHT // 2), name, fill=INK, font=font)
        for k, figure in enumerate(images[row]):
            page.paste(figure, (LEFT + k * WIDTH, top))
        for gesture in plan.gestures:
            end = gesture.stroke + 0.3 if gesture.end is None else gesture.end
            a, b = (LEFT + (at - low) / (high - low) * COUNT * WIDTH for at in (gesture.begins, end))
            if b <= LEFT or a >= page.width:
                continue
            same = (gesture.form, gesture.stroke, gesture.hands, gesture.size) in other
            pen.rectangle((max(a, LEFT), top + HEIGHT + 4, b, top + HEIGHT + 10), fill=GREY if same else CHANGED)
            pen.text((max(a, LEFT), top + HEIGHT + 12), gesture.form, fill=INK, font=font)
    for k, time in enumerate(times):
        pen.text((LEFT + (k + 0.5) * WIDTH - 14, page.height - 18), f"{time:.2f} s", fill=INK, font=font)
    return page


def main(folder: Path) -> None:
    """Write all pictures."""
    speech = Speech.load(EXAMPLE, transcript=EXAMPLE.with_suffix(".TextGrid"))
    model: Model = cospeech.load("rules")
    plan = model.plan(speech)  # type: ignore[attr-defined]
    usual = model.generate(speech), plan
    edits: dict[str, tuple[str, Callable[[Plan], Plan], float, float]] = {
        "remove": ("plan.remove('g5')", lambda p: p.remove("g5"), 4.8, 7.2),
        "move": ("plan.remove('g6').move('g5', 6.2)", lambda p: p.remove("g6").move("g5", 6.2), 4.8, 7.2),
        "add": ("plan.add('huge', at=9)", lambda p: p.add("huge", at=9.0), 7.9, 10.3),
        "change": (
            "plan.remove('g6').change('g5', form='stop_right', hold=1)",
            lambda p: p.remove("g6").change("g5", form="stop_right", hold=1.0),
            4.8,
            7.2,
        ),
        "reseed": ("plan.reseed(3.2, 5, seed=4)", lambda p: p.reseed(3.2, 5, seed=4), 2.8, 5.6),
        "stretch": ("plan.set(5, 8, intensity=0.3)", lambda p: p.set(5, 8, intensity=0.3), 4.8, 8.0),
    }
    for name, (title, edit, low, high) in edits.items():
        new_plan = edit(plan)
        after = model.generate(speech, plan=new_plan), model.plan(speech, plan=new_plan)  # type: ignore[attr-defined]
        draw(usual, after, low, high, title).quantize(160).save(folder / f"plan-{name}.png", optimize=True)
    new = model.generate(speech, seed=5)
    motion = KeptStretches(usual[0], [(0, 5.2)], FPS).push(new)
    empty_plan = plan.model_copy(update={"gestures": ()})
    title = "--keep 0:5.2 old.bvh --seed 5: old up to 5.2 s, new from there on"
    draw((usual[0], empty_plan), (motion, empty_plan), 4.4, 6.8, title).quantize(160).save(
        folder / "plan-keep.png", optimize=True
    )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "folder", nargs="?", type=Path, default=ROOT / "docs" / "media", help="where they go (default: docs/media)"
    )
    main(parser.parse_args().folder)
