"""Mixtures of two styles, measured: do they lie between their parents? Mix-StAGE, supplement B, "Exploring Style Control".

A system plays the same speeches with weights 1 − w and w of two styles, the parents. Gesture rate, amplitude and handedness are
measured. As w grows, they should move from the value of one parent to that of the other, without moving back.
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
"""Weights of the second style; ours: the paper uses a half alone."""
MEASURES: Mapping[str, tuple[str, float]] = {
    "rate": ("gestures per minute", 1.0),
    "amplitude": ("amplitude, shoulder widths", 1.0),
    "right_share": ("share of the right hand, %", 100.0),
}
"""Field of `Attributes` → its label in pictures, and the factor by which pictures multiply it."""
TOLERANCE = 0.15
"""Share of the parents' difference by which a mixture may move back and still count as between them; ours: the values are means
over speeches and takes, and two such means differ by so much."""
TAKES = 4  # ours: of every speech; enough that a mean over a few speeches varies less than the steps between weights
APART = 2.0  # standard errors; ours: parents that are nearer count as alike, and nothing can lie between them
BETWEEN = 1e-9
PAPER, INK = (255, 255, 255), (43, 49, 58)


def fall_back(values: Sequence[float]) -> float:
    """The largest step back, or beyond an end, of values that lead from the first to the last, in units of the whole way.

    >>> fall_back([0, 1, 2, 4]), fall_back([0, 3, 1, 4]), fall_back([0, 5, 4])
    (0.0, 0.5, 0.25)

    Where the ends are equal, any difference counts as infinite.
    """
    way = np.asarray(values, np.float64)
    rising = way if way[-1] >= way[0] else -way
    back = float((np.maximum.accumulate(rising) - rising).max())
    return 0.0 if back <= BETWEEN * max(1.0, float(np.abs(way).max())) else back / max(float(rising[-1] - rising[0]), 1e-300)


@dataclass(frozen=True, eq=False)
class Mixing:
    """Measures of the mixtures of a pair of styles.

    Args:
        pair: names of the styles.
        weights: (W,) of the second style.
        attributes: for every weight, of every speech and take.
        motions: the performances, in the order of ``attributes``.
    """

    pair: tuple[str, str]
    weights: tuple[float, ...]
    attributes: tuple[tuple[Attributes, ...], ...]
    motions: tuple[tuple[Motion, ...], ...]

    def values(self, measure: str) -> Array:
        """(W, N) of one of `MEASURES`, for every speech and take."""
        return np.array([[float(getattr(take, measure)) for take in row] for row in self.attributes])

    def means(self, measure: str) -> Array:
        """(W,) means over speeches and takes."""
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
        """Whether the means move from one parent to the other, and back by ``tolerance`` of the way at most."""
        return fall_back(self.means(measure).tolist()) <= tolerance

    @cached_property
    def points(self) -> tuple[list[Array], ...]:
        """For every weight, the key points (T, 52, 2) of each performance."""
        return tuple([points_of(motion).values for motion in row] for row in self.motions)


def _takes(model: Model, speech: Speech, style: str, takes: int, seed: int) -> list[Motion]:
    """Performances with the seeds ``seed``, ``seed + 1``, …; in one pass where the system can play several at once."""
    options = {"style": style, "parts": ("body", "hands")}
    if model.takes_at_once == 1:
        return [model.generate(speech, seed=seed + k, **options) for k in range(takes)]
    session = model.session(seed=seed, takes=takes, **options)
    pieces = [motion for chunk in speech.chunks(MOST_AT_ONCE) for motion in session.push_takes(chunk)]
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
        speeches: what it plays.
        pair: the styles.
        weights: of the second style; they rise from 0 to 1.
        takes: performances of each speech.
        seed: of the first take.

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
        motions.append(tuple(take for speech in speeches for take in _takes(model, speech, style, takes, seed)))
    attributes = tuple(tuple(attributes_of(*body_of(motion), motion.fps) for motion in row) for row in motions)
    return Mixing(pair, tuple(ways), attributes, tuple(motions))


# pictures -----------------------------------------------------------------------------------------------------------------


def _curves(mixing: Mixing, tolerance: float, recordings: Mapping[str, Attributes]) -> list[PlottedCurve]:
    curves = []
    for measure, (title, factor) in MEASURES.items():
        means, back = mixing.means(measure), fall_back(mixing.means(measure).tolist())
        good = back <= tolerance if mixing.contrast(measure) >= APART else None
        text = {
            None: "the parents are alike",
            True: "from one parent to the other",
            False: f"falls back by {back:.0%} of the way",
        }[good]
        own = [float(getattr(recordings[name], measure)) * factor for name in mixing.pair if name in recordings]
        spread, places = 1.96 * mixing.errors(measure) * factor, np.array(mixing.weights)
        marks = (own[0], own[1]) if len(own) == 2 else None
        curves.append(PlottedCurve(title, text, good, places, means * factor, spread, mixing.pair, marks))
    return curves


def draw_mixing(
    mixings: Sequence[Mixing], *, title: str, tolerance: float = TOLERANCE, recordings: Mapping[str, Attributes] | None = None
) -> Pictures:
    """For every pair, curves of the measures (with 95 % intervals over speeches and takes) above heat maps of the mixtures.

    Args:
        mixings: of the pairs.
        title: of the whole picture.
        tolerance: see `Mixing.monotone`.
        recordings: style → measures of the recordings of its speaker, drawn as a ring.

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
        blocks += [draw_curves(_curves(mixing, tolerance, recordings or {}), maps.shape[1]), maps]
    sheet = Image.new("RGB", (max(block.shape[1] for block in blocks), 46 + sum(len(block) for block in blocks)), PAPER)
    ImageDraw.Draw(sheet).text((20, 28), title, INK, ImageFont.load_default(20), anchor="lm")
    top = 46
    for block in blocks:
        sheet.paste(Image.fromarray(block), (0, top))
        top += len(block)
    return np.asarray(sheet)
