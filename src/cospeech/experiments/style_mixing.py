"""Mixtures of two styles, measured: do they lie between their parents? Mix-StAGE, supplement B, "Exploring Style Control".

A system plays the same speeches with weights 1 − w and w of two styles; of what it plays gesture rate, amplitude and
handedness are measured. They should move from one parent's value to the other's as w does, without falling back.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from ..audio.speech import Speech
from ..corpora.attributes import Attributes, attributes_of, body_of
from ..errors import InputError
from ..models import Model
from ..motion.motion import Motion
from ..motion.poses.keypoints2d import points_of
from ..motion.rotations import Array
from ..rules.streaming import MOST_AT_ONCE
from .figures.curves import PlottedCurve, draw_curves
from .figures.heat import FIGURES, Pictures, draw_heat, frame_of

__all__ = ["MEASURES", "TOLERANCE", "WEIGHTS", "Mixing", "draw_mixing", "fall_back", "measure_mixing"]

WEIGHTS = (0.0, 0.25, 0.5, 0.75, 1.0)
"""Of the second style; ours: the paper looks at a half alone."""
MEASURES: Mapping[str, tuple[str, float]] = {
    "rate": ("gestures per minute", 1.0),
    "amplitude": ("amplitude, shoulder widths", 1.0),
    "right_share": ("share of the right hand, %", 100.0),
}
"""Field of `Attributes` → what it is called in pictures, and the factor that it is shown with."""
TOLERANCE = 0.15
"""Of the parents' difference, that a mixture may fall back and still count as between them; ours: what is measured is a mean
over speeches and takes, and two of those differ by so much."""
TAKES = 4  # ours: of every speech; enough that a mean over a few speeches is steadier than the steps between weights
APART = 2.0  # standard errors; ours: parents that are nearer are taken to be alike, and no way leads from one to the other
BETWEEN = 1e-9
PAPER, INK = (255, 255, 255), (43, 49, 58)


def fall_back(values: Sequence[float]) -> float:
    """How far values on the way from the first to the last step back at most, or beyond an end, in units of the way itself.

    >>> fall_back([0, 1, 2, 4]), fall_back([0, 3, 1, 4]), fall_back([0, 5, 4])
    (0.0, 0.5, 0.25)

    Between ends that are equal every difference is infinitely far.
    """
    way = np.asarray(values, np.float64)
    rising = way if way[-1] >= way[0] else -way
    back = float((np.maximum.accumulate(rising) - rising).max())
    return 0.0 if back <= BETWEEN * max(1.0, float(np.abs(way).max())) else back / max(float(rising[-1] - rising[0]), 1e-300)


@dataclass(frozen=True, eq=False)
class Mixing:
    """What was measured of a pair.

    Args:
        pair: names of the styles.
        weights: (W,) of the second.
        attributes: of every weight, of every speech and take.
        motions: the performances, as ``attributes``.
    """

    pair: tuple[str, str]
    weights: tuple[float, ...]
    attributes: tuple[tuple[Attributes, ...], ...]
    motions: tuple[tuple[Motion, ...], ...]

    def values(self, measure: str) -> Array:
        """(W, N) of one of `MEASURES`, for every speech and take."""
        return np.array([[float(getattr(found, measure)) for found in row] for row in self.attributes])

    def means(self, measure: str) -> Array:
        """(W,) over speeches and takes."""
        return np.asarray(self.values(measure).mean(1))

    def errors(self, measure: str) -> Array:
        """(W,) standard errors of the means."""
        values = self.values(measure)
        return np.asarray(values.std(1, ddof=1) / np.sqrt(values.shape[1]) if values.shape[1] > 1 else np.zeros(len(values)))

    def contrast(self, measure: str) -> float:
        """How far apart the parents are, in standard errors of their difference for the same speech and take."""
        values = self.values(measure)
        gaps = values[-1] - values[0]
        error = float(gaps.std(ddof=1)) / np.sqrt(len(gaps)) if len(gaps) > 1 else 0.0
        return abs(float(gaps.mean())) / max(error, BETWEEN)

    def monotone(self, measure: str, tolerance: float = TOLERANCE) -> bool:
        """Whether the means move from one parent's to the other's, but for ``tolerance`` of the way."""
        return fall_back(self.means(measure).tolist()) <= tolerance

    @cached_property
    def points(self) -> tuple[list[Array], ...]:
        """Of every weight the key points (T, 52, 2) of each performance."""
        return tuple([points_of(motion).values for motion in row] for row in self.motions)


def _takes(model: Model, speech: Speech, style: str, takes: int, seed: int) -> list[Motion]:
    """Performances with the seeds ``seed``, ``seed + 1``, …; in one pass where the system plays several at once."""
    options = {"style": style, "parts": ("body", "hands")}
    if model.takes_at_once == 1:
        return [model.generate(speech, seed=seed + k, **options) for k in range(takes)]
    session = model.session(seed=seed, takes=takes, **options)
    pieces = [made for chunk in speech.chunks(MOST_AT_ONCE) for made in session.push_takes(chunk)]
    pieces += session.finish_takes()
    return [Motion.concatenate(take) for take in zip(*pieces, strict=True)]


def measure_mixing(
    model: Model,
    speeches: Sequence[Speech],
    pair: tuple[str, str],
    *,
    weights: Sequence[float] = WEIGHTS,
    takes: int = TAKES,
    seed: int = 0,
) -> Mixing:
    """Play and measure mixtures of two styles; every weight has the same speeches and seeds.

    Args:
        model: plays ``"a:0.75,b:0.25"`` as a style.
        speeches: to play to.
        pair: the styles.
        weights: of the second; from 0, rising, to 1.
        takes: performances of each speech.
        seed: of the first.

    Raises:
        InputError: no speech, or weights that do not go from 0 to 1.
    """
    ways = [float(w) for w in weights]
    if not speeches or len(ways) < 2 or ways[0] != 0 or ways[-1] != 1 or sorted(set(ways)) != ways or takes < 1:
        raise InputError(f"{len(speeches)} speeches, weights {ways}, {takes} takes", "weights rise from 0 to 1")
    first, second = pair
    motions = []
    for w in ways:
        style = f"{first}:{1 - w:g},{second}:{w:g}"
        motions.append(tuple(made for speech in speeches for made in _takes(model, speech, style, takes, seed)))
    found = tuple(tuple(attributes_of(*body_of(motion), motion.fps) for motion in row) for row in motions)
    return Mixing(pair, tuple(ways), found, tuple(motions))


# pictures -----------------------------------------------------------------------------------------------------------------


def _curves(mixing: Mixing, tolerance: float, recorded: Mapping[str, Attributes]) -> list[PlottedCurve]:
    curves = []
    for measure, (title, factor) in MEASURES.items():
        means, back = mixing.means(measure), fall_back(mixing.means(measure).tolist())
        good = back <= tolerance if mixing.contrast(measure) >= APART else None
        text = {
            None: "the parents are alike",
            True: "from one parent to the other",
            False: f"falls back by {back:.0%} of the way",
        }[good]
        own = [float(getattr(recorded[name], measure)) * factor for name in mixing.pair if name in recorded]
        spread, places = 1.96 * mixing.errors(measure) * factor, np.array(mixing.weights)
        marks = (own[0], own[1]) if len(own) == 2 else None
        curves.append(PlottedCurve(title, text, good, places, means * factor, spread, mixing.pair, marks))
    return curves


def draw_mixing(
    mixings: Sequence[Mixing], *, title: str, tolerance: float = TOLERANCE, recorded: Mapping[str, Attributes] | None = None
) -> Pictures:
    """Of every pair: curves of what was measured (with 95 % intervals over speeches and takes) above heat maps of the mixtures.

    Args:
        mixings: pairs.
        title: above all.
        tolerance: see `Mixing.monotone`.
        recorded: style → what was measured of its speaker's recordings, drawn as a ring.

    Raises:
        InputError: there is no pair.
    """
    if not mixings:
        raise InputError("a picture of no mixtures", "one pair at least")
    figure, blocks = FIGURES["pats"], []
    frame = frame_of([points for mixing in mixings for points in mixing.points], figure)
    for mixing in mixings:
        a, b = mixing.pair
        heads = [a if w == 0 else b if w == 1 else f"{a} {1 - w:g}, {b} {w:g}" for w in mixing.weights]
        fps = mixing.motions[0][0].fps
        rows = ["where the\narms move"]
        maps = draw_heat([mixing.points], figure, fps, columns=heads, rows=rows, frame=frame)
        blocks += [draw_curves(_curves(mixing, tolerance, recorded or {}), maps.shape[1]), maps]
    sheet = Image.new("RGB", (max(block.shape[1] for block in blocks), 46 + sum(len(block) for block in blocks)), PAPER)
    ImageDraw.Draw(sheet).text((20, 28), title, INK, ImageFont.load_default(20), anchor="lm")
    top = 46
    for block in blocks:
        sheet.paste(Image.fromarray(block), (0, top))
        top += len(block)
    return np.asarray(sheet)
