"""The rule-based model: no training, no data, no torch.

analyse (`listen`, `mood`) → plan (`plan`, `posture`, with the tables `styles`, `repertoire`, `lexicon`) → realise (`realise`,
`arms`, `legs`, `face`). It is the baseline of every table, the fallback, and the teacher of the synthetic corpus.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from ..audio.emotions import EMOTIONS
from ..audio.features.shared_prosody import SharedProsody
from ..audio.speech import Speech
from ..errors import InputError
from ..face.gains import face_gains
from ..face.mouth import Mouth, MouthMaker
from ..motion.motion import Motion
from ..motion.parts import PARTS
from .options import GenerationOptions
from .session import LATENCY, LOOK_AHEAD, Session, check_speech, in_short, stream_motion
from .strokes import Gesture
from .styles import STYLES, Style, find_style

__all__ = [
    "EMOTIONS", "LATENCY", "LOOK_AHEAD", "STYLES", "GenerationOptions", "Gesture", "Mouth", "MouthMaker", "RuleBasedModel",
    "RuleGesturer", "Session", "Style",
]  # fmt: skip


class RuleBasedModel:
    """The rule-based model: face, body and hands from speech, without training.

    >>> import numpy as np
    >>> motion = RuleBasedModel().generate(Speech(np.zeros(16000, np.float32), 16000), seed=1)
    >>> len(motion), motion.face.shape
    (30, (30, 52))

    Args:
        mouth: makes what a face speaks with; where not given, rules make its mouth, from the sound's energy and bands.
    """

    look_ahead, latency = LOOK_AHEAD, LATENCY
    default_style = next(iter(STYLES))
    takes_at_once = 1
    makes = PARTS
    for_files: Mapping[str, object] = {}

    def __init__(self, mouth: MouthMaker | None = None) -> None:
        self._mouth = mouth

    def session(
        self, options: GenerationOptions | None = None, /, *, moving: bool = True, aimed: bool = True, **keywords: Any
    ) -> Session:
        """A performance to push speech into; `stream` and `generate` are this in a loop. For the options see `generate`.

        ``moving``: False where nothing is to be made, and its `Session.emotion` alone is wanted. ``aimed``: False where
        another system turns the head, see `Session.aim`. Options that only some trained
        systems have (face, continue_from, look_ahead, takes) are refused.
        """
        options = GenerationOptions.of(options, keywords)
        for what, given in (("a face", options.face), ("motion to go on from", options.continue_from)):
            if given is not None:
                raise InputError(
                    f"the rule-based model does not take {what}", "chain-of-generation, trained with it, does: docs/runtime.md"
                )
        if options.look_ahead is not None:
            raise InputError("the rule-based model's look-ahead cannot be chosen", f"it is {LOOK_AHEAD:g} s")
        if options.takes > 1:
            raise InputError(f"{options.takes} takes of the rule-based model at once", "one session for each")
        mouth = self._mouth() if self._mouth is not None and moving and "face" in options.parts else None
        session = Session(
            find_style(options.style), emotion=options.track, seed=options.seed, intensity=options.intensity,
            temperature=options.temperature, fps=options.fps, parts=options.parts if moving else (), mouth=mouth,
            gains=face_gains(options.face_gain), aimed=aimed,
        )  # fmt: skip
        if mouth is not None:
            session.share(SharedProsody())
        return session

    def generate(self, speech: Speech, **options: Any) -> Motion:
        """Gestures for a whole speech.

        Args:
            speech: any rate; words, where it has them, call for lexical gestures and better lips.
            style: a name in `STYLES`, a mixture (``"calm:0.7,lively:0.3"``) or a `Style` of your own; None: the first one.
            emotion: one of `EMOTIONS`, an `EmotionTrack`, or "auto": the arousal of the voice, and what is surely heard.
            seed: another seed, another plausible performance; the same one, the same bytes.
            intensity: size of all movement, 0 (idle) … 2.
            temperature: freedom in the choice and place of gestures, 0 … 2.
            fps: frames per second, 1 … 240.
            parts: of face, body, hands.
            face_gain: how strong the mouth is, 0 … 2; or a number for each channel (``"1.2,jawOpen:0.8,mouthSmile:0.5"``,
                or a dict), see `cospeech.face.gains.face_gains`.

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

    def stream(self, chunks: Iterable[Speech], **options: Any) -> Iterator[Motion]:
        """The same motion in pieces, at most `LATENCY` seconds behind the speech, which may come in pieces of any size.

        Raises:
            InputError: at once, for an option; as the pieces are taken, for a piece of speech.
        """
        return stream_motion(self.session(**options), chunks)


RuleGesturer = RuleBasedModel  # as the first documentation called it
