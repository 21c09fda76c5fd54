"""The rule-based model: no training, no data, no torch.

analyse (`listen`, `mood`) → plan (`plan`, `posture`, with the tables `styles`, `repertoire`, `lexicon`) → realise (`realise`,
`arms`, `legs`, `face`). It is the baseline of every table, the fallback, and the teacher of the synthetic corpus.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from ..audio.emotions import EMOTIONS
from ..audio.features.shared_prosody import SharedProsody
from ..audio.speech import Speech
from ..errors import InputError
from ..face.gains import face_gains
from ..face.mouth import Mouth, MouthMaker, limit_wait
from ..motion.motion import Motion
from ..motion.parts import PARTS
from .foresight import LATENCY, LEAST_FACE, LEAST_LOOK_AHEAD, LOOK_AHEAD, foresee
from .gesture import Gesture
from .options import GenerationOptions
from .session import Session
from .streaming import check_speech, in_short, stream_motion
from .styles import STYLES, Style, find_style

if TYPE_CHECKING:
    from .plan_edits import Plan

__all__ = [
    "EMOTIONS", "LATENCY", "LOOK_AHEAD", "STYLES", "GenerationOptions", "Gesture", "Mouth", "MouthMaker", "Plan",
    "RuleBasedModel", "RuleGesturer", "Session", "Style",
]  # fmt: skip


def __getattr__(name: str) -> object:
    if name != "Plan":  # which needs pydantic, of 20 MB
        raise AttributeError(f"module 'cospeech.rules' has no attribute {name!r}")
    from .plan_edits import Plan

    return Plan


class RuleBasedModel:
    """The rule-based model: face, body and hands from speech, without training.

    >>> import numpy as np
    >>> motion = RuleBasedModel().generate(Speech(np.zeros(16000, np.float32), 16000), seed=1)
    >>> len(motion), motion.face.shape
    (30, (30, 52))

    Args:
        mouth: makes the mouth of the face; where not given, rules make it from the sound's energy and bands.
    """

    look_ahead, latency = LOOK_AHEAD, LATENCY
    styles = tuple(STYLES)
    """Names of the styles."""
    default_style = styles[0]
    seated = tuple(name for name, style in STYLES.items() if style.seated)
    """Names of the styles that sit."""
    takes_gestures = True
    """Whether a plan lists its gestures."""
    takes_at_once = 1
    makes = PARTS
    for_files: Mapping[str, object] = {}

    def __init__(self, mouth: MouthMaker | None = None) -> None:
        self._mouth = mouth

    def session(
        self, options: GenerationOptions | None = None, /, *, moving: bool = True, aimed: bool = True, **keywords: Any
    ) -> Session:
        """Open a performance, into which speech is pushed; `stream` and `generate` do this in a loop. Options: see `generate`.

        ``moving``: False if no motion is needed, but only `Session.emotion`. ``aimed``: False if another system turns the
        head, see `Session.aim`. Options that only some trained systems have (face, continue_from, takes) are refused.
        """
        options = GenerationOptions.of(options, keywords)
        for what, value in (("a face", options.face), ("motion to go on from", options.continue_from)):
            if value is not None:
                raise InputError(
                    f"the rule-based model does not take {what}", "chain-of-generation, trained with it, does: docs/runtime.md"
                )
        foresight = foresee(options.look_ahead, least=LEAST_FACE if options.parts == ("face",) else LEAST_LOOK_AHEAD)
        if options.plan is not None and not foresight.is_usual:
            raise InputError("a plan with a look-ahead of its own", "it is for a live character, and a plan is for a file")
        if options.takes > 1:
            raise InputError(f"{options.takes} takes of the rule-based model at once", "one session for each")
        mouth = self._mouth() if self._mouth is not None and moving and "face" in options.parts else None
        session = Session(
            find_style(options.style), emotion=options.track, seed=options.seed, intensity=options.intensity,
            temperature=options.temperature, fps=options.fps, parts=options.parts if moving else (), mouth=mouth,
            gains=face_gains(options.face_gain), aimed=aimed, foresight=foresight,
            plan=options.plan if moving else None,
        )  # fmt: skip
        if mouth is not None and not foresight.is_usual:
            limit_wait(mouth, foresight.mouth_waits)
        if mouth is not None:
            session.share(SharedProsody())
        return session

    def generate(self, speech: Speech, **options: Any) -> Motion:
        """Gestures for a whole speech.

        Args:
            speech: any rate; words, if it has them, give lexical gestures and better lips.
            style: a name in `STYLES`, a mixture (``"calm:0.7,lively:0.3"``) or a `Style` of your own; None: the first one.
            emotion: one of `EMOTIONS`, an `EmotionTrack`, or "auto": the arousal of the voice, and a clear emotion of it.
            seed: another seed, another plausible performance; the same one, the same bytes.
            intensity: size of all movement, 0 (idle) … 2.
            temperature: freedom in the choice and place of gestures, 0 … 2.
            fps: frames per second, 1 … 240.
            parts: of face, body, hands.
            plan: a `Plan`, or the file of one: which gestures come when; style, emotion, seed, intensity and temperature are
                then those of the plan.
            face_gain: how strong the mouth is, 0 … 2; or a number for each channel (``"1.2,jawOpen:0.8,mouthSmile:0.5"``,
                or a dict), see `cospeech.face.gains.face_gains`.
            look_ahead: seconds of speech after a frame that it depends on, 0.4 … 1.48 (0.2 … of the face alone); less makes a
                live character quicker to answer, and its strokes come later than the words (docs/runtime.md).

        Returns:
            Motion of exactly ceil(duration × fps) frames on our humanoid.

        Raises:
            InputError: an option is out of range or a name unknown.
        """
        session = self.session(**options)
        check_speech(speech)
        pieces = [piece for chunk in in_short(speech) for piece in session.push(chunk)]
        pieces += session.finish()
        return Motion.concatenate(pieces)

    def plan(self, speech: Speech, **options: Any) -> Plan:
        """The plan of what `generate` would perform. It lists all gestures; edit it, and play it with ``plan=``.

        Args:
            speech: the speech; its words become a part of the plan.
            options: as of `generate`.

        Raises:
            InputError: an option is out of range, or cannot be written down.
        """
        from .plan_edits import Plan

        request = GenerationOptions.from_keywords(options)
        session = self.session(request if request.plan is not None else replace(request, plan=Plan.of(request)))
        for _ in stream_motion(session, [speech]):
            pass
        return session.plan

    def stream(self, chunks: Iterable[Speech], **options: Any) -> Iterator[Motion]:
        """The same motion in pieces, at most `LATENCY` seconds behind the speech, which may come in pieces of any size.

        Raises:
            InputError: at once, for an option; as the pieces are taken, for a piece of speech.
        """
        return stream_motion(self.session(**options), chunks)


RuleGesturer = RuleBasedModel  # as the first documentation called it
