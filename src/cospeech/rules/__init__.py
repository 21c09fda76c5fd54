"""The rule-based gesturer: no training, no data, no torch.

analyse (`listen`, `mood`) → plan (`plan`, `posture`, with the tables `styles`, `repertoire`, `lexicon`) → realise (`realise`,
`arms`, `legs`, `face`). It is the baseline of every table, the fallback, and the teacher of the synthetic corpus.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from math import isfinite
from numbers import Integral, Real

from ..audio.emotions import EMOTIONS, EmotionTrack, emotion_track
from ..audio.features.shared_prosody import SharedProsody
from ..audio.speech import Speech
from ..errors import InputError, nearest
from ..face.gains import face_gains
from ..face.mouth import Mouth, MouthMaker
from ..motion.motion import Motion
from .plan import Gesture
from .session import LATENCY, LOOK_AHEAD, Session, check_speech, streamed
from .styles import STYLES, Style, mix_styles

__all__ = ["EMOTIONS", "LATENCY", "LOOK_AHEAD", "STYLES", "Gesture", "Mouth", "MouthMaker", "RuleGesturer", "Session", "Style"]

_PARTS = ("face", "body", "hands")


class RuleGesturer:
    """The rule-based gesturer: face, body and hands from speech, without training.

    >>> import numpy as np
    >>> motion = RuleGesturer().generate(Speech(np.zeros(16000, np.float32), 16000), seed=1)
    >>> len(motion), motion.face.shape
    (30, (30, 52))

    Args:
        mouth: makes what a face speaks with; where not given, rules make its mouth, from the sound's energy and bands.
    """

    look_ahead, latency = LOOK_AHEAD, LATENCY
    default_style = next(iter(STYLES))
    takes_at_once = 1
    makes = _PARTS
    for_files: Mapping[str, object] = {}

    def __init__(self, mouth: MouthMaker | None = None) -> None:
        self._mouth = mouth

    def session(
        self,
        *,
        style: str | Style | None = None,
        emotion: str | EmotionTrack = "auto",
        seed: int = 0,
        intensity: float = 1.0,
        temperature: float = 1.0,
        fps: float = 30.0,
        parts: Iterable[str] = _PARTS,
        face_gain: float | str | Mapping[str, float] = 1.0,
        moving: bool = True,
        face: object = None,
        continue_from: object = None,
    ) -> Session:
        """A performance to push speech into; `stream` and `generate` are this in a loop. For the options see `generate`.

        ``moving``: False where nothing is to be made, and its `Session.emotion` alone is wanted. ``face`` and
        ``continue_from``, which some trained systems can be given, are refused.
        """
        for what, given in (("a face", face), ("motion to go on from", continue_from)):
            if given is not None:
                raise InputError(f"the rule-based gesturer cannot be given {what}", "chains can, see docs/runtime.md")
        parts = tuple(parts.split(",") if isinstance(parts, str) else parts)
        unknown = [p for p in parts if p not in _PARTS]
        if unknown or not parts:
            raise InputError(f"parts {','.join(parts)!r}", f"some of {','.join(_PARTS)}")
        for name, value, most in (("intensity", intensity, 2.0), ("temperature", temperature, 2.0)):
            if not (isinstance(value, Real) and isfinite(value) and 0 <= value <= most):
                raise InputError(f"{name} {value}", f"0 … {most:g}")
        if not (isinstance(fps, Real) and isfinite(fps) and 1 <= fps <= 240):
            raise InputError(f"{fps} frames per second", "1 … 240")
        track = emotion_track(emotion)
        if not (isinstance(seed, Integral) and 0 <= seed < 2**63):
            raise InputError(f"seed {seed!r}", "a whole number, 0 … 2**63 - 1")
        gains = face_gains(face_gain)
        mouth = self._mouth() if self._mouth is not None and moving and "face" in parts else None
        session = Session(
            _find_style(style), emotion=track, seed=int(seed), intensity=float(intensity),
            temperature=float(temperature), fps=float(fps), parts=parts if moving else (), mouth=mouth, gains=gains,
        )  # fmt: skip
        if mouth is not None:
            session.share(SharedProsody())
        return session

    def generate(
        self,
        speech: Speech,
        *,
        style: str | Style | None = None,
        emotion: str | EmotionTrack = "auto",
        seed: int = 0,
        intensity: float = 1.0,
        temperature: float = 1.0,
        fps: float = 30.0,
        parts: Iterable[str] = _PARTS,
        face_gain: float | str | Mapping[str, float] = 1.0,
    ) -> Motion:
        """Gestures for a whole speech.

        Args:
            speech: any rate; words, where it has them, call for lexical gestures and better lips.
            style: a name in `STYLES`, a mixture (``"calm:0.7,lively:0.3"``) or a `Style` of your own; None: the first one.
            emotion: one of `EMOTIONS`, an `EmotionTrack`, or "auto": from the voice.
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
        session = self.session(
            style=style, emotion=emotion, seed=seed, intensity=intensity, temperature=temperature, fps=fps, parts=parts,
            face_gain=face_gain,
        )  # fmt: skip
        check_speech(speech)
        pieces = [piece for chunk in speech.chunks(seconds=2.0) for piece in session.push(chunk)]
        pieces += session.finish()
        return Motion.concatenate(pieces)

    def stream(
        self,
        chunks: Iterable[Speech],
        *,
        style: str | Style | None = None,
        emotion: str | EmotionTrack = "auto",
        seed: int = 0,
        intensity: float = 1.0,
        temperature: float = 1.0,
        fps: float = 30.0,
        parts: Iterable[str] = _PARTS,
        face_gain: float | str | Mapping[str, float] = 1.0,
    ) -> Iterator[Motion]:
        """The same motion in pieces, at most `LATENCY` seconds behind the speech, which may come in pieces of any size.

        Raises:
            InputError: at once, for an option; as the pieces are taken, for a piece of speech.
        """
        session = self.session(
            style=style, emotion=emotion, seed=seed, intensity=intensity, temperature=temperature, fps=fps, parts=parts,
            face_gain=face_gain,
        )  # fmt: skip
        return streamed(session, chunks)


def _find_style(style: object) -> Style:
    """A style by name, a mixture such as ``"calm:0.7,lively:0.3"``, or a `Style` as it is."""
    if style is None:
        return next(iter(STYLES.values()))
    if isinstance(style, Style):
        return style
    if not isinstance(style, str) or style.lower().endswith((".bvh", ".glb", ".vrma", ".npz")):
        hint = f"trained models can, see `cospeech list models`; of its own it has {', '.join(STYLES)}"
        raise InputError("the rule-based gesturer cannot learn a style from an example", hint)
    weights: dict[str, float] = {}
    for part in style.split(","):
        name, _, weight = (piece.strip() for piece in part.partition(":"))
        if name not in STYLES:
            raise InputError(f"no style is called {name!r}", nearest(name, STYLES))
        try:
            weights[name] = weights.get(name, 0.0) + (float(weight) if weight else 1.0)
        except ValueError:
            raise InputError(f"weight {weight!r} of style {name!r}", "a number, as in calm:0.7,lively:0.3") from None
    if not all(isfinite(w) and w >= 0 for w in weights.values()) or not 0 < sum(weights.values()) < 1e9:
        raise InputError(f"style weights {style!r}", "positive numbers, as in calm:0.7,lively:0.3")
    return STYLES[next(iter(weights))] if len(weights) == 1 else mix_styles(weights)
