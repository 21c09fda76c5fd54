"""A bundle that is ready to play: speech in, motion of our humanoid out; the same calls as `cospeech.rules.RuleBasedModel`."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from functools import cached_property
from os import PathLike
from typing import Any

import numpy as np

from ..audio.features.prosody import DELAY
from ..audio.features.shared_prosody import SharedProsody
from ..audio.speech import Speech, shift_times
from ..audio.speech_chunks import MOST_AT_ONCE
from ..errors import InputError
from ..motion.motion import Motion
from ..motion.named_numbers import read_named_numbers
from ..motion.parts import PARTS
from ..motion.points import Points
from ..motion.poses import find_pose
from ..motion.poses.controls import QUANTILES, control_row, read_controls
from ..motion.rotations import Array
from ..rules import MouthMaker, RuleBasedModel
from ..rules.foresight import LEAST_FACE
from ..rules.options import GenerationOptions, MotionLike
from ..rules.stance_layer import REACH, StanceLayer
from ..rules.streaming import check_speech, stream_motion
from .arm_limits import ArmLimits
from .beat_alignment import AccentTrack, BeatAlignment
from .conditioning import NOTHING, Conditioning, read_conditioning
from .decoder import Decoder
from .decoders import is_mouth, needs_stance, options_for_files, start_decoder
from .face_override import FaceOverride
from .flow.latent_sources import Transfer, flow_of
from .hand_holds import HandHolds
from .hand_rests import HandRests
from .motion_layers import LayerStack, MotionLayer
from .mouth import POSE, BundleMouth, open_default_mouth
from .pose_resampler import PoseResampler
from .rest_in_silence import RestInSilence
from .session import ResolvedStyle, TrainedSession, latency_of_body
from .speech_frontend import SpeechFrontend, SpeechTextFrontend
from .styles.space import style_space
from .styles.style import Styles
from .system import System, open_bundle, without_calibration

__all__ = ["BundleGesturer", "MotionLike", "TrainedModel"]


class TrainedModel:
    """A trained system: body and hands from a bundle's network, face and eyes from the rule-based model with a learnt mouth.

    Args:
        system: an opened bundle; `TrainedModel.open` takes a path.
        transfer: how styles become a flow's motion, see `cospeech.runtime.flow.latent_sources`; the best one where not given.
        mouth: makes the mouths of faces; the default one where not given. A system of faces makes its own.

    Raises:
        InputError: a transfer for a system that is no flow.
    """

    takes_at_once = 8  # ours: of a flow they cost 1.4 times one (docs/runtime.md); more would hold memory and files for little

    def __init__(self, system: System, transfer: Transfer | None = None, mouth: MouthMaker = open_default_mouth) -> None:
        self.system = system
        self.styles, self.default_style = system.styles, system.style
        self.makes = ("face",) if system.pose == POSE else PARTS
        if transfer is not None:
            flow_of(system)
        self._transfer, self._space = transfer, style_space(system)
        self._styles = Styles(system, self._space)
        self.for_files = options_for_files(system)
        self._rules, self._mouth = RuleBasedModel(mouth), mouth

    @classmethod
    def open(cls, path: str | PathLike[str]) -> TrainedModel:
        """Open a bundle's file.

        Raises:
            InputError: it cannot be read, or is no bundle of ours.
        """
        return cls(open_bundle(path))

    @cached_property
    def _bare(self) -> TrainedModel:
        return TrainedModel(without_calibration(self.system), self._transfer, self._mouth)

    @cached_property
    def _usual(self) -> TrainedSession:
        return self.session()

    @property
    def takes_example(self) -> bool:
        """Whether a clip of motion can be its style."""
        return self.system.flow is not None or "style" in self.system.networks

    @property
    def latency(self) -> float:
        """Of a session with the usual options; see `TrainedSession.latency`."""
        return self._usual.latency

    @property
    def look_ahead(self) -> float:
        """Of a session with the usual options; see `TrainedSession.look_ahead`."""
        return self._usual.look_ahead

    def session(self, options: GenerationOptions | None = None, /, **keywords: Any) -> TrainedSession:
        """A session to push speech into. For the options see `generate`; take k has the seed ``seed + k``."""
        options = GenerationOptions.of(options, keywords)
        if options.plan is not None:
            from .stretched_session import StretchedSession

            plan = options.plan.model_copy(update={"style": options.plan.style or self.default_style or None})
            return StretchedSession(self.session, replace(options, plan=plan))  # type: ignore[return-value]  # it does all that this one does
        if not options.calibrated:
            return self._bare.session(replace(options, calibrated=True))
        if options.takes > _MOST_TAKES:
            raise InputError(f"{options.takes} takes in one session are too many", f"1 … {_MOST_TAKES}")
        resolved_style, conditioning = (
            self._resolve_style(options.style),
            read_conditioning(options.face, options.continue_from),
        )
        frontend, decoder = self._start(resolved_style, options, conditioning)
        system = self.system if _has_time(options) else replace(self.system, smooth=min(self.system.smooth, _LEAST_SMOOTH))
        has_face = "face" in options.parts  # without a face, only moods are followed
        rules = self._speaking(options.style)
        of_face: dict[str, Any] = {"parts": ("face",), "emotion": decoder.moods or options.emotion, "fps": options.fps}
        of_face |= {"intensity": options.intensity, "temperature": options.temperature, "face_gain": options.face_gain}
        accents = AccentTrack() if (options.rests or options.beat_alignment) and self._has_arms(options) else None
        layers = self._layers(options, accents)
        rest = None
        if self.system.rests and self.system.pose != POSE:
            rest = RestInSilence(options.fps, latency_of_body(system, frontend, decoder, ()), options.parts)
        if options.look_ahead is not None:  # the face looks as far ahead as the body, and no further
            body = latency_of_body(system, frontend, decoder, layers)
            of_face["look_ahead"] = options.look_ahead if is_mouth(self.system) else max(body - DELAY, LEAST_FACE)
        heads = [rules.session(seed=seed, moving=has_face, aimed=False, **of_face) for seed in options.seeds]
        faces = heads if conditioning.face is None else [FaceOverride(head, conditioning.face) for head in heads]
        prosody, listeners = SharedProsody(), [listener for listener in (rest, accents) if listener is not None]
        for each in (frontend, *listeners, *faces):
            each.share(prosody)
        return TrainedSession(
            system, frontend, decoder, faces, fps=options.fps, parts=options.parts, resolved_style=resolved_style,
            direct=self._resolve_style, intensity=options.intensity, before=conditioning.before, layers=layers,
            rest=rest, listeners=listeners, prosody=prosody,
        )  # fmt: skip

    def _layers(self, options: GenerationOptions, accents: AccentTrack | None) -> list[LayerStack]:
        """What comes after the network, for each take: hands that hold still; strokes on accents; hands that rest between
        bouts; a stance, where a system needs one, the body is wanted and a stance is asked for; and limits of arms."""
        stands = options.stance and "body" in options.parts and needs_stance(self.system)
        amount, fingers = min(options.intensity, 1.5), "hands" in options.parts
        waits = REACH if _has_time(options) else 0.0
        stacks = []
        for seed in options.seeds:
            layers: list[MotionLayer] = []
            if options.holds and self._has_arms(options):
                layers.append(HandHolds(options.fps))
            if accents is not None:
                layers += [BeatAlignment(options.fps, accents)] if options.beat_alignment else []
                layers += [HandRests(options.fps, accents, seed)] if options.rests else []
            if stands:
                layers.append(StanceLayer(seed=seed, fps=options.fps, amount=amount, fingers=fingers, waits=waits))
            if options.arm_limits and self._has_arms(options):
                layers.append(ArmLimits(options.fps))
            stacks.append(LayerStack(layers))
        return stacks

    def _has_arms(self, options: GenerationOptions) -> bool:
        """Whether it makes arms, and these are wanted."""
        return "body" in options.parts and self.system.pose != POSE

    def _speaking(self, style: object) -> RuleBasedModel:
        """The model that makes the face; for a system of faces, one whose mouth is this system in that style."""
        system = self.system
        return RuleBasedModel(lambda: BundleMouth(system, style)) if is_mouth(system) else self._rules

    def _start(
        self, resolved_style: ResolvedStyle, options: GenerationOptions, conditioning: Conditioning = NOTHING
    ) -> tuple[SpeechFrontend | SpeechTextFrontend, Decoder]:
        """The front end of the speech, and the decoder."""
        kind = SpeechTextFrontend if self.system.statistics.words.size else SpeechFrontend
        frontend = kind(self.system, resolved_style.controls)
        decoder = start_decoder(
            self.system, self._space, resolved_style.blend, frontend.silence, options, conditioning, self._transfer
        )
        return frontend, decoder

    def _resolve_style(self, style: object) -> ResolvedStyle:
        """A style as the decoder needs it."""
        weights, controls = _parse_style(style, self.system)
        blend = self._styles.blend(weights)
        return ResolvedStyle(blend, controls, self._space.shares(blend))

    def generate(self, speech: Speech, **options: Any) -> Motion:
        """Gestures for a whole speech.

        Args:
            speech: any rate.
            style: a speaker of the training data by name (`styles` lists them); an example: a motion file, or a `Motion`; a
                mixture (``"ada:0.7,clip.bvh:0.3"``, or a dict), see `cospeech.runtime.styles.style.Styles.blend`; quantiles of
                style controls, for a system that has them (``"hand_height:0.9"``), alone or with the others.
            emotion: of the face, and of body and hands where a system knows emotions: one of
                `cospeech.audio.emotions.EMOTIONS`, an `EmotionTrack`, or "auto": the arousal of the voice, see docs/styles.md.
            seed: another seed, another performance; the same one, the same bytes.
            intensity: how far poses stray from the mean one, 0 … 2.
            temperature: scale of the latents, 0 (the likeliest motion) … 2; of a window's network, of the noise on the choice
                among its modes, 0 (the network's own motion) … 2.
            fps: frames per second, 1 … 240.
            parts: of face, body, hands.
            face_gain: see `cospeech.rules.RuleBasedModel.generate`.
            look_ahead: seconds of speech after a frame that the network hears. With less than is usual, what it does not hear
                is held at what it heard last, and the face looks no further ahead than the body (docs/runtime.md). A network of
                windows can hear more: that comes nearer to what the whole speech would give, ``float("inf")`` all the way.
            plan: a `cospeech.Plan`, or the file of one, whose stretches have a style, an emotion, an intensity or a seed of
                their own. It lists no gestures: those are for the rules.
            face: a `Motion` with a face, or a file of one (``.json``, ``.csv``, ``.glb`` …), from which a chain derives body
                and hands instead of from its own, and which is shown; for chains trained so, and not while they stream.
            stance: True puts the stance of the rules under a body without legs, as `cospeech generate` does for its files:
                weight shifts, steps, a trunk that follows the hands. False, the default, gives the network's own motion.
            holds: True holds the hands still between strokes, as `cospeech generate` does for its files. False, the default,
                keeps the network's own motion.
            rests: True lets the hands rest between bouts of gestures, as files of `cospeech generate` and streams do. False,
                the default, keeps the network's own motion.
            beat_alignment: True moves the arms in time, so that their strokes fall on accents, as `cospeech generate` does for
                its files. False, the default, keeps the network's own timing.
            arm_limits: True keeps the arms within the limits of their joints, as files of `cospeech generate` and streams do.
                False, the default, keeps the network's own motion.
            calibrated: False plays the network alone, without means, amplitudes and noise measured when it was bundled, and
                without hands that rest in silence.
            continue_from: a `Motion`, or a file of one, at whose last poses the motion begins, so that clips can be joined; for
                the same.

        Returns:
            Motion of exactly ceil(duration × fps) frames on our humanoid.

        Raises:
            InputError: an option is out of range or a name unknown.
        """
        return self.generate_takes(speech, takes=1, **options)[0]

    def points(
        self,
        speech: Speech,
        *,
        style: object = None,
        seed: int = 0,
        intensity: float = 1.0,
        temperature: float = 1.0,
        look_ahead: float | None = None,
    ) -> Points:
        """The key points that `generate` makes motion of, for systems that were trained on points; at the system's own rate.

        Of ``keypoints2d`` they are in pixels from the neck, y up, the shoulder at 167, as PATS' networks are published.

        Args:
            speech: any rate.
            style, seed, intensity, temperature, look_ahead: see `generate`.

        Returns:
            ceil(duration × fps) frames.

        Raises:
            InputError: a system of joint rotations, or an option is out of range.
        """
        pose = find_pose(self.system.pose)
        if pose.source != "points":
            raise InputError(f"this model makes {pose.name!r} poses, not key points", "call generate")
        options = GenerationOptions(seed=seed, intensity=intensity, temperature=temperature, look_ahead=look_ahead)
        frontend, decoder = self._start(self._resolve_style(style), options)
        check_speech(speech)
        pieces = [decoder.push(frontend.push(chunk)) for chunk in shift_times(speech, speech.start).chunks(MOST_AT_ONCE)]
        pieces += [decoder.push(frontend.finish()), decoder.finish(frontend.silence)]
        resampler = PoseResampler(1, decoder.width, smooth=self.system.smooth, step=1.0)
        poses, at = resampler.push(np.concatenate(pieces, 1), frontend.frames, frontend.frames - 1)
        points: Points = pose.decode(decoder.denormalise(poses, at)[0], self.system.fps)
        return points

    def generate_takes(self, speech: Speech, *, takes: int, **options: Any) -> list[Motion]:
        """Several takes in one pass, which costs little more than one: those of ``seed``, ``seed + 1``, …"""
        session = self.session(takes=takes, **options)
        check_speech(speech)
        pieces = [piece for chunk in speech.chunks(MOST_AT_ONCE) for piece in session.push_takes(chunk)]
        pieces += session.finish_takes()
        return [Motion.concatenate(take) for take in zip(*pieces, strict=True)]

    def stream(self, chunks: Iterable[Speech], **options: Any) -> Iterator[Motion]:
        """The same motion in pieces, from speech that comes in pieces of any size.

        Raises:
            InputError: at once, for an option; as the pieces are taken, for a piece of speech.
        """
        return stream_motion(self.session(**options), chunks)


_MOST_TAKES = 64  # ours, of one pass
_NO_WAIT = 0.4  # seconds of look-ahead below which a stance does not wait for the hands, and poses are smoothed less [ours]
_LEAST_SMOOTH = 1  # frames to either side over which they are averaged then, at most [ours]


def _has_time(options: GenerationOptions) -> bool:
    """Whether the look-ahead is long enough to wait."""
    return options.look_ahead is None or options.look_ahead >= _NO_WAIT


def _parse_style(style: object, system: System) -> tuple[object, Array]:
    """The part of a style that names speakers, or None; and (C,) standardised style controls, medians where it names none."""
    parts = (
        read_named_numbers(style, number="quantile", of="style control", hint="0 … 1", is_name=system.controls.__contains__)
        if isinstance(style, str) and system.controls
        else []
    )
    own = system.statistics.control_quantiles
    quantiles = own if own.size else np.zeros((QUANTILES, 0), np.float32)
    texts = [part.text for part in parts if part.name in system.controls]
    row = control_row(read_controls(",".join(texts)) if texts else {}, quantiles, system.controls)
    speakers = ",".join(part.text for part in parts if part.name not in system.controls) or None
    return (speakers if texts else style), row


BundleGesturer = TrainedModel  # as the first documentation called it
