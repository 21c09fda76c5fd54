"""The options of a performance: one frozen object, which is checked when it is made."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields, replace
from numbers import Integral, Real
from os import PathLike
from typing import Any

from ..audio.emotions import Moods, emotion_track
from ..errors import InputError, nearest
from ..face.gains import face_gains
from ..motion.motion import Motion
from ..motion.parts import PARTS

__all__ = ["FPS_RANGE", "LAYERS", "MOST_TAKES", "FaceGain", "GenerationOptions", "MotionLike", "check_names", "check_range"]

FaceGain = float | str | Mapping[str, float]
MotionLike = str | PathLike[str] | Motion | None

FPS_RANGE = (1.0, 240.0)  # ours: a slide show … the fastest screens; beyond is a slip of the keyboard
INTENSITY_RANGE = (0.0, 2.0)  # ours: 0 stands still, 1 is the style as it is, beyond 2 joints only meet their limits
TEMPERATURE_RANGE = (0.0, 2.0)  # ours: 0 always the likeliest choice
MOST_TAKES = 1000  # ours: more is a slip of the keyboard too
LAYERS = ("stance", "holds", "beat_alignment", "rests", "arm_limits")
"""Options that add to what a trained network makes. Files have them; metrics measure the network without them."""
SEEDS = 2**63  # non-negative numbers of 64 bits, which every generator of random numbers takes


@dataclass(frozen=True, eq=False)
class GenerationOptions:
    """Options of a performance; the keywords of ``session``, ``generate`` and ``stream`` of every model are these.

    Raises:
        InputError: one is out of range, of the wrong kind, or an unknown name. Styles and given motion are checked by the
            model, because only the model knows which of them it can use.
    """

    style: Any = None
    """A name, a mixture, or for trained models an example; the model's default where None."""
    emotion: str | Moods = "auto"
    """One of `cospeech.audio.emotions.EMOTIONS`, an `EmotionTrack`, or "auto": the emotion of the voice."""
    seed: int = 0
    """Of the first take; take k has the seed ``seed + k``."""
    intensity: float = 1.0
    """Size of all movement, 0 … 2."""
    temperature: float = 1.0
    """How far choices stray from the likeliest, 0 … 2."""
    fps: float = 30.0
    """Frames per second, 1 … 240."""
    parts: tuple[str, ...] = PARTS
    """Of face, body, hands; text with commas, and any other iterable, become a tuple."""
    face_gain: FaceGain = 1.0
    """How strong the mouth is, or single channels are; see `cospeech.face.gains.face_gains`."""
    look_ahead: float | None = None
    """Seconds of speech after a frame that a network hears, for those that have a choice."""
    takes: int = 1
    """How many are played at once."""
    stance: bool = False
    """Whether a stance of the rules carries a body without legs (`cospeech.rules.stance_layer`). Files of `cospeech generate`
    and frames of `cospeech stream` have it. In Python it is there only when it is asked for: `generate` gives what the network
    makes, which metrics measure."""
    holds: bool = False
    """Whether the hands of a trained model hold still between strokes (`cospeech.runtime.hand_holds`). Files of
    `cospeech generate` have it. In a stream and in Python it is there only when it is asked for: it waits for 2.4 s more."""
    beat_alignment: bool = False
    """Whether the arms of a trained model are moved in time, so that their strokes fall on the accents of the speech
    (`cospeech.runtime.beat_alignment`). Files of `cospeech generate` have it. In a stream it is there only when it is asked
    for, because it waits for more speech; in Python too, because it sets what beat lift measures."""
    rests: bool = False
    """Whether the hands of a trained model rest between bouts of gestures (`cospeech.runtime.hand_rests`). Files of
    `cospeech generate` have it. So have streams with a face and the usual look-ahead, where it costs no time. In Python it is
    there only when it is asked for."""
    arm_limits: bool = False
    """Whether the arms of a trained model are kept within the limits of their joints (`cospeech.runtime.arm_limits`): elbows
    bend one way. Files of `cospeech generate` and streams have it, at no cost of time. In Python it is there only when it is
    asked for."""
    calibrated: bool = True
    """Whether a trained model uses what was measured when its bundle was made: means and amplitudes of its styles, the size of
    its noise, and hands that rest in silence. Without it, its network plays alone."""
    face: MotionLike = None
    """A face that moves body and hands, or a file of one; for chains."""
    continue_from: MotionLike = None
    """Motion at whose last poses it begins, or a file of one; for chains."""
    plan: Any = None
    """A `cospeech.Plan`, or a file of one. It has style, emotion, seed, intensity and temperature; an option that says
    something else is refused."""

    def __post_init__(self) -> None:
        if self.plan is not None:
            self._take_plan()
        emotion_track(self.emotion)  # it checks, and so does the next
        face_gains(self.face_gain)
        parts = tuple(dict.fromkeys(self.parts.split(",") if isinstance(self.parts, str) else self.parts))
        for part in parts:
            if part not in PARTS:
                raise InputError(f"no part is called {part!r}", f"some of {','.join(PARTS)}")
        if not parts:
            raise InputError("no part to generate", f"some of {','.join(PARTS)}")
        check_range("intensity", self.intensity, INTENSITY_RANGE)
        check_range("temperature", self.temperature, TEMPERATURE_RANGE)
        check_range("fps", self.fps, FPS_RANGE, " frames per second")
        check_range("takes", self.takes, (1, MOST_TAKES))
        check_range("seed", self.seed, (0, SEEDS - int(self.takes)))
        for name in ("intensity", "temperature", "fps"):
            object.__setattr__(self, name, float(getattr(self, name)))
        for name in (*LAYERS, "calibrated"):
            if not isinstance(getattr(self, name), bool):
                raise InputError(f"{name} is {getattr(self, name)!r}", "True or False")
        for name in ("seed", "takes"):
            object.__setattr__(self, name, int(getattr(self, name)))
        object.__setattr__(self, "parts", parts)

    @classmethod
    def of(cls, options: GenerationOptions | None, keywords: Mapping[str, Any]) -> GenerationOptions:
        """Options of a session: an object, keywords, or an object with some keywords changed.

        Raises:
            InputError: the object is of another kind, or a keyword is unknown.
        """
        if options is None:
            return cls.from_keywords(keywords)
        if not isinstance(options, cls):
            raise InputError(f"{type(options).__name__} where options of a session belong", "session(style='calm', seed=3)")
        check_names(keywords)
        return replace(options, **keywords) if keywords else options

    @classmethod
    def from_keywords(cls, keywords: Mapping[str, Any]) -> GenerationOptions:
        """Options by keywords.

        Raises:
            InputError: a keyword is unknown; the hint is the name most like it.
        """
        check_names(keywords)
        return cls(**keywords)

    def _take_plan(self) -> None:
        """Take over the options of the plan."""
        from .plan_edits import Plan

        plan = self.plan if isinstance(self.plan, Plan) else Plan.load(self.plan)
        object.__setattr__(self, "plan", plan)
        if self.takes != 1:
            raise InputError(f"{self.takes} takes of one plan", "a plan is of one take; generate others with other seeds")
        usual = {field.name: field.default for field in fields(self)}
        for name, value in plan.options().items():
            own = getattr(self, name)
            if own != usual[name] and own != value and not (name == "emotion" and isinstance(value, Moods)):
                other = f"a plan with {_show(value)}" if value is not None else f"a plan that has no {name}, so the default one"
                raise InputError(f"{name} {_show(own)} beside {other}", f"edit the plan's {name}")
            object.__setattr__(self, name, value)

    @property
    def track(self) -> Moods | None:
        """The given emotions over time; None: those of the voice."""
        return emotion_track(self.emotion)

    @property
    def seeds(self) -> list[int]:
        """Of the takes."""
        return [self.seed + take for take in range(self.takes)]


def _show(value: object) -> str:
    """A value of an option, for an error."""
    return repr(value[:40]) if isinstance(value, str) else str(value) if isinstance(value, int | float) else "over time"


def check_names(keywords: Iterable[str]) -> None:
    """Check that keywords of a user are names of options.

    Raises:
        InputError: one is not.
    """
    names = [field.name for field in fields(GenerationOptions)]
    for name in keywords:
        if name not in names:
            raise InputError(f"no option is called {name[:40]!r}", nearest(name, names))


def check_range(name: str, value: object, bounds: tuple[float, float], unit: str = "") -> None:
    """Check a number of a user.

    Args:
        name: of the option.
        value: what was given.
        bounds: the least and the largest that it may be; whole numbers where it has to be one.
        unit: for the hint.

    Raises:
        InputError: it is no number, or out of range.
    """
    whole = isinstance(bounds[0], int)
    low, high = (str(n) if isinstance(n, int) else f"{n:g}" for n in bounds)
    if not isinstance(value, Integral if whole else Real):
        raise InputError(f"{name} {value!r:.60} is no {'whole ' * whole}number", f"{low} … {high}{unit}")
    if not bounds[0] <= value <= bounds[1]:  # type: ignore[operator]  # false for NaN, too
        number = str(value) if isinstance(value, Integral) else f"{value:g}"
        raise InputError(f"{name} {number} is out of range", f"{low} … {high}{unit}")
