"""Speakers as small, readable sets of parameters. Every number here is ours, set by eye and by the ranges of
motion-captured speakers (see the movement statistics in ``benchmarks/``), unless a line says otherwise."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from math import isfinite
from pathlib import Path
from types import MappingProxyType

from ..audio.emotions import EMOTIONS
from ..errors import InputError, nearest
from ..motion.named_numbers import read_named_numbers

__all__ = ["STYLES", "Style", "find_style", "mix_styles"]


@dataclass(frozen=True)
class Style:
    """How one speaker gestures.

    Lengths are in arm lengths (shoulder to wrist), angles in degrees, times in seconds.
    """

    what: str
    """One line for lists."""
    rate: float = 0.68
    """Share of accents that get a stroke when the hands are free, 0 … 1."""
    stillness: float = 1.0
    """How long the stretches without gestures are: 1 as in most speakers, 2 twice as long."""
    amplitude: float = 1.0
    """Size of strokes."""
    height: float = 0.0
    """Added to the height of the gesture space."""
    breadth: float = 0.0
    """Added outward of the own shoulder."""
    forward: float = 0.0
    """Added forward."""
    tempo: float = 1.0
    """Speed of movements."""
    hold: float = 0.6
    """How long hands stay up after the last stroke, 0 (drop at once) … 1 (keep them there)."""
    hand: float = 0.6
    """Share of one-handed gestures made by the right hand, 0 … 1."""
    both: float = 0.65
    """Share of gestures made with both hands, 0 … 1."""
    symmetry: float = 0.75
    """How alike both hands move, and how much the other hand takes part in one-handed gestures, 0 … 1."""
    repertoire: Mapping[str, float] = field(default_factory=dict)
    """Weights of gesture forms over the common ones (`repertoire.FORMS`)."""
    tension: float = 0.4
    """Fingers: 0 limp … 1 taut."""
    torso: float = 1.0
    """How much the torso takes part."""
    head: float = 1.0
    """How much the head moves."""
    sway: float = 1.0
    """Weight shifts and slow sway."""
    steps: float = 7.0
    """Small steps per minute while standing."""
    seated: bool = False
    turn: float = 0.0
    """Body turned away from the camera, degrees to the character's left."""
    lean: float = 0.0
    """Torso bent forward, degrees."""
    rest: str = "waist"
    """Where hands go between gestures: a name of `repertoire.RESTS`."""
    idle: str = "hang"
    """Where they go in long pauses."""
    expressiveness: float = 1.0
    """Of the face."""
    emphasis: float = 1.0
    """How much brows and head go along with accents: 0 not at all, 1 as most speakers, 2 as a show host."""
    coupling: float = 0.5
    """How closely brows, nods and blinks go along with the strokes of the hands: 0 not at all, 1 nearly always.

    In people, brows and head move with pitch accents and gestures (Cavé et al. 1996, McClave 2000, Krahmer & Swerts 2007)."""
    averted: float = 0.25
    """Share of time the gaze is not on the listener."""
    blinks: float = 22.0
    """Per minute (motion.md: 21–24 measured)."""
    variation: int = 0
    """Added to the seed of what is planned, so that two speakers do not make the same gestures. Not mixed."""
    exempt: tuple[str, ...] = ()
    """Rows of the movement statistics in which this style differs from ordinary speakers on purpose."""


_SEATED_ROWS = (
    "hip path (1 Hz), m/min",
    "hip SD, m",
    "foot speed 50 %, m/s",
    "foot speed 90 %, m/s",
    "foot speed 99 %, m/s",
    "foot moving (> 0.1 m/s)",
    "steps per min (peaks > 0.3 m/s)",
    "share of time: wrist below hip",
    "height over shoulders / arm, 5 %",  # hands lie on the thighs
)

_FOLDED_ROWS = (  # hands that rest on each other in front of the belly neither hang nor spread
    "height over shoulders / arm, 5 %",
    "outward of own shoulder / arm, 5 %",
    "outward of own shoulder / arm, 50 %",
    "SD of height / arm",
    "SD of forward / arm",
    "elbow flexion left 5 %, deg",
    "elbow flexion right 5 %, deg",
    "share of time: wrist below hip",
)

STYLES: Mapping[str, Style] = MappingProxyType(
    {
        "natural": Style(
            "an even-tempered conversationalist; the default",
            rate=0.82,
            tempo=1.07,
            stillness=0.95,
            amplitude=1.22,
            head=1.06,
            both=0.86,
            symmetry=0.49,
            torso=0.98,
        ),
        "lively": Style(
            "many wide and quick gestures of both hands, with short rests: a show host",
            variation=1000,
            stillness=0.95,
            rate=0.8,
            amplitude=1.6,
            height=0.1,
            breadth=0.05,
            tempo=1.2,
            hold=1.0,
            both=0.9,
            symmetry=0.73,
            torso=1.15,
            head=1.15,
            sway=1.2,
            steps=8,
            expressiveness=1.3,
            averted=0.18,
            tension=0.55,
            repertoire={"spread": 2.0, "offer": 1.4, "toss": 2.0, "sweep": 1.6},
        ),
        "calm": Style(
            "few small gestures of both hands alike, close to the body; the hands are folded between them",
            variation=2000,
            stillness=1.35,
            rate=0.52,
            amplitude=0.6,
            height=-0.03,
            breadth=0.0,
            tempo=0.98,
            hold=0.7,
            both=0.88,
            symmetry=0.84,
            torso=1.35,
            head=1.11,
            sway=0.9,
            steps=5,
            expressiveness=0.75,
            rest="folded",
            repertoire={"offer": 1.5, "gather": 1.5, "beat": 1.2, "spread": 0.3},
        ),
        "lecturer": Style(
            "precise gestures, mostly of the right hand: counting, framing and pinching in front of the chest",
            variation=3000,
            stillness=1.1,
            rate=0.66,
            amplitude=0.75,
            height=0.1,
            breadth=0.0,
            forward=0.0,
            tempo=1.14,
            hold=0.9,
            hand=0.92,
            both=0.42,
            symmetry=0.42,
            tension=0.7,
            torso=1.25,
            steps=5,
            sway=0.95,
            rest="steeple",
            averted=0.35,
            repertoire={"precision": 3.0, "frame": 2.5, "count": 3.0, "point": 1.2, "chop": 1.6, "spread": 0.4},
        ),
        "orator": Style(
            "large and high gestures, mostly of the right hand, that chop, point and push: a politician",
            variation=4000,
            stillness=0.8,
            rate=0.84,
            amplitude=1.6,
            height=0.2,
            breadth=0.02,
            forward=0.08,
            tempo=1.12,
            hold=0.95,
            hand=0.9,
            both=0.42,
            symmetry=0.38,
            tension=0.65,
            torso=0.95,
            head=1.08,
            lean=2,
            averted=0.15,
            repertoire={"chop": 2.5, "point": 2.0, "push": 1.6, "frame": 1.5, "fist": 2.0, "offer": 1.5},
        ),
        "southpaw": Style(
            "left-handed, body turned to one side; the right hand rests most of the time",
            variation=5000,
            rate=0.86,
            tempo=1.1,
            amplitude=1.05,
            hand=0.06,
            both=0.22,
            symmetry=0.35,
            turn=18,
            hold=0.6,
            rest="low",
            torso=1.1,
            head=1.05,
            repertoire={"toss": 1.8, "point": 1.6, "offer": 1.5},
            exempt=("right share of speed", "left–right speed correlation"),
        ),
        "reserved": Style(
            "folded hands, gestures with one hand, gaze often averted",
            variation=6000,
            stillness=1.8,
            rate=0.45,
            amplitude=0.55,
            height=0.0,
            breadth=-0.02,
            tempo=0.92,
            hold=0.3,
            hand=0.55,
            both=0.25,
            symmetry=0.34,
            tension=0.5,
            torso=1.45,
            head=1.08,
            sway=1.0,
            steps=5,
            lean=1,
            rest="folded",
            idle="folded",
            expressiveness=0.6,
            averted=0.5,
            repertoire={"offer": 1.6, "beat": 1.6, "shrug": 1.5, "spread": 0.2, "push": 0.4},
            exempt=_FOLDED_ROWS,
        ),
        "storyteller": Style(
            "acts the story out: wide gestures at changing heights; the body moves along",
            variation=7000,
            stillness=0.9,
            rate=0.66,
            amplitude=1.5,
            height=-0.04,
            breadth=0.1,
            tempo=0.98,
            hold=1.0,
            both=0.78,
            symmetry=0.66,
            torso=1.8,
            head=1.12,
            sway=1.15,
            steps=5,
            tension=0.35,
            averted=0.4,
            expressiveness=1.4,
            repertoire={"sweep": 2.5, "arc": 2.5, "gather": 2.0, "push": 1.6, "toss": 1.4, "bowl": 1.8},
        ),
        "seated": Style(
            "relaxed on a chair, hands above the lap between phrases",
            variation=8000,
            rate=0.58,
            amplitude=1.0,
            height=0.02,
            hold=0.6,
            both=0.8,
            seated=True,
            rest="lap",
            idle="lap",
            sway=1.08,
            steps=0,
            lean=4,
            tempo=0.98,
            torso=1.55,
            head=1.07,
            exempt=_SEATED_ROWS,
        ),
        "restless": Style(
            "short, small, low beat gestures; shifts the weight from foot to foot",
            variation=9000,
            stillness=1.5,
            rate=0.6,
            amplitude=0.6,
            height=-0.04,
            breadth=-0.02,
            tempo=1.25,
            hold=1.0,
            both=0.7,
            symmetry=0.6,
            tension=0.45,
            torso=1.3,
            head=1.1,
            sway=1.15,
            steps=10,
            blinks=26,
            averted=0.35,
            repertoire={"beat": 2.5, "roll": 3.0, "precision": 1.3, "chop": 1.3},
        ),
    }
)
"""Name → style; the first is the default. ``--style`` takes these names."""


def mix_styles(parts: Mapping[str, float]) -> Style:
    """A speaker between speakers: numbers and repertoires are averaged by weight, the rest comes from the heaviest.

    >>> mix_styles({"calm": 1, "lively": 1}).tempo == (STYLES["calm"].tempo + STYLES["lively"].tempo) / 2
    True
    """
    total = sum(parts.values())
    share = {name: weight / total for name, weight in parts.items() if weight > 0}
    main = STYLES[max(share, key=lambda name: share[name])]
    values: dict[str, object] = {}
    for name in (f.name for f in fields(Style) if f.type == "float"):
        values[name] = sum(getattr(STYLES[style], name) * weight for style, weight in share.items())
    forms = {form for style in share for form in STYLES[style].repertoire}
    values["repertoire"] = {f: sum(STYLES[s].repertoire.get(f, 1.0) * w for s, w in share.items()) for f in sorted(forms)}
    values["exempt"] = tuple(sorted({row for style in share for row in STYLES[style].exempt}))
    return replace(main, what=", ".join(f"{weight:.0%} {name}" for name, weight in share.items()), **values)  # type: ignore[arg-type]


def find_style(style: object) -> Style:
    """A style by name, a mixture such as ``"calm:0.7,lively:0.3"`` or a dict, or a `Style` as it is; the first one where None.

    Raises:
        InputError: none of these.
    """
    if style is None:
        return next(iter(STYLES.values()))
    if isinstance(style, Style):
        return style
    if isinstance(style, Mapping) and style and all(isinstance(name, str) for name in style):
        style = ",".join(f"{name}:{weight}" for name, weight in style.items())
    parts = (
        []
        if not isinstance(style, str)
        else read_named_numbers(
            style, number="weight", of="style", hint="a number, as in calm:0.7,lively:0.3", is_name=STYLES.__contains__
        )
    )
    if not parts or any(Path(part.name).suffix for part in parts):
        hint = f"trained models can, see `cospeech list models`; of its own it has {', '.join(STYLES)}"
        raise InputError("the rule-based model cannot learn a style from an example", hint)
    weights: dict[str, float] = {}
    for name, weight, _ in parts:
        if name not in STYLES:
            hint = f"it is an emotion: --emotion {name}" if name in EMOTIONS else nearest(name, STYLES)
            raise InputError(f"no style is called {name!r}", hint)
        weights[name] = weights.get(name, 0.0) + (1.0 if weight is None else weight)
    if not all(isfinite(w) and w >= 0 for w in weights.values()) or not 0 < sum(weights.values()) < 1e9:
        raise InputError(f"style weights {style!r}", "positive numbers, as in calm:0.7,lively:0.3")
    return STYLES[next(iter(weights))] if len(weights) == 1 else mix_styles(weights)
