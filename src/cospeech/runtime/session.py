"""One speech under way on a trained system: features, poses of one or several takes, faces from the rules.

speech → standardised rows of features (`SpeechFrontend`) → standardised poses (`Decoder`) → smoothed and brought to the asked
rate (`PoseResampler`), in the space of poses → decoded. Every number of a frame follows from its own index, so that a stream
has the bits of the whole.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from math import inf

import numpy as np

from ..audio.emotions import Moods, emotion_track
from ..audio.event_detection import TICK
from ..audio.features.mel import RATE as SAMPLE_RATE
from ..audio.features.shared_prosody import SharedProsody
from ..audio.speech import Speech, count_frames
from ..audio.speech_chunks import PieceTimes
from ..errors import InputError
from ..motion.motion import Motion
from ..motion.part_joints import eye_joints, resting_joints, select_parts
from ..motion.poses import find_pose
from ..motion.rotations import Array, QuatStream
from ..motion.skeleton import humanoid
from ..rules import Session as RuleSession
from ..rules.arousal import amplitude
from ..rules.options import INTENSITY_RANGE, check_range
from ..rules.streaming import check_speech, in_short
from .beat_alignment import AccentTrack
from .conditioning import Seam
from .crossfade import Crossfade
from .decoder import Decoder
from .face_override import FaceOverride
from .motion_layers import LayerStack
from .pose_decoder import PoseDecoder
from .pose_resampler import PoseResampler
from .rest_in_silence import RestInSilence
from .session_frames import WaitingFrames
from .speech_frontend import SpeechFrontend, SpeechTextFrontend
from .styles.embedding import StyleMixture
from .system import System
from .waiting_speech import WaitingSpeech

__all__ = ["ResolvedStyle", "TrainedSession", "latency_of_body"]

_LATEST = 0.15  # seconds for which pieces wait at most, while the face is busy (ours)


@dataclass(frozen=True)
class ResolvedStyle:
    """A style in the form that the decoder needs."""

    blend: StyleMixture
    controls: Array
    """(C,) standardised style controls."""
    mixture: Mapping[str, float] | None = None
    """Speaker → weight, where the network plays a mixture of speakers."""


def latency_of_body(
    system: System, frontend: SpeechFrontend | SpeechTextFrontend, decoder: Decoder, layers: Sequence[LayerStack]
) -> float:
    """Seconds that body and hands wait: for the network, the features, smoothing, the cubic, and layers."""
    behind = (system.smooth + 1) / system.fps + max((stack.look_ahead for stack in layers), default=0.0)
    return max(decoder.latency + behind + frontend.delay, max((stack.sound_ahead for stack in layers), default=0.0))


class TrainedSession:
    """One take, or several of one speech: pushed into like `cospeech.rules.Session`.

    Args:
        system: the bundle, opened.
        frontend: of the speech.
        decoder: of the network.
        faces: a rule-based session for each take: face, eyes, and the emotion that is heard.
        fps: of the motion.
        parts: what is generated.
        resolved_style: the style that the player begins with.
        intensity: how far poses stray from the mean one, as the decoder was told.
        direct: understands a style, as `TrainedModel.generate` describes them.
        before: motion that it goes on from, where some is given.
        layers: what comes after the network, of each take.
        rest: lets the hands rest in silence; None where nothing does.
        listeners: of the speech beside the network, ``rest`` among them.
        prosody: that all of them share.
    """

    def __init__(
        self,
        system: System,
        frontend: SpeechFrontend | SpeechTextFrontend,
        decoder: Decoder,
        faces: Sequence[RuleSession | FaceOverride],
        *,
        fps: float,
        parts: tuple[str, ...],
        resolved_style: ResolvedStyle,
        direct: Callable[[object], ResolvedStyle],
        intensity: float = 1.0,
        before: Motion | None = None,
        layers: Sequence[LayerStack],
        rest: RestInSilence | None = None,
        listeners: Sequence[RestInSilence | AccentTrack] = (),
        prosody: SharedProsody,
    ) -> None:
        self._layers, self._rest, self._listeners, self._prosody = layers, rest, listeners, prosody
        self._poses = [PoseDecoder(find_pose(system.pose), fps, system.fps / fps) for _ in faces]
        self._frontend, self._decoder, self._rate_of_poses = frontend, decoder, system.fps
        self._resampler = PoseResampler(decoder.takes, decoder.width, smooth=system.smooth, step=system.fps / fps)
        self._faces, self._fps, self._parts = faces, fps, parts
        self._resolved_style, self._direct, self._intensity = resolved_style, direct, intensity
        self._sizes = Crossfade(np.ones((1, 1, 1)), system.fps)  # over the intensity of the decoder
        self._latency = self._look_ahead = body = latency_of_body(system, frontend, decoder, layers)
        if "face" in parts:
            self._latency = max(self._latency, *(face.latency for face in faces))
            self._look_ahead = max(self._look_ahead, *(face.look_ahead for face in faces))
        self._waiting, self._slack = WaitingSpeech(), self._latency - body  # seconds by which the body may be late at no cost
        self._rows: list[Array] = []  # (N, n, D) poses that are not decoded yet
        self._bodies = [WaitingFrames() for _ in faces]
        self._heads = [WaitingFrames() for _ in faces]
        self._signs = [QuatStream() for _ in faces]
        still = [joint for joint in resting_joints(parts) if "face" not in parts or joint not in eye_joints()]
        has_place = "body" in parts
        self._seams = [] if before is None else [Seam(before, fps, still=still, has_place=has_place) for _ in faces]
        self._ready: deque[list[Motion]] = deque()
        self._duration, self._frame = Fraction(0), 0
        self._rate: int | None = None
        self._times, self._over = PieceTimes(), False

    @property
    def emotion(self) -> dict[str, float]:
        """Probability of each emotion, over all that was heard."""
        return self._decoder.emotion or self._faces[0].emotion

    @property
    def expression(self) -> dict[str, float]:
        """See `cospeech.rules.Session.expression`."""
        return self._faces[0].expression

    @property
    def arousal(self) -> float | None:
        """See `cospeech.rules.Session.arousal`; a trained model strays further from its mean pose with it."""
        return self._faces[0].arousal

    @property
    def speaker(self) -> dict[str, float] | None:
        """Probability of each speaker, over all that was heard; None for systems that do not tell them apart."""
        return self._decoder.speaker

    @property
    def latency(self) -> float:
        """Seconds of sound at 16 kHz after a frame's time that must have been pushed, at most, until the frame is given.

        What the network, the features, smoothing and the cubic wait for; with a face, at least what that waits for.
        """
        return self._latency

    @property
    def look_ahead(self) -> float:
        """Seconds of sound after a frame's time on which the frame depends, at most."""
        return self._look_ahead

    @property
    def style_mixture(self) -> dict[str, float] | None:
        """Speaker → weight, the heaviest first, where a system that plays mixtures of its speakers plays one; of an example
        the nearest. None for a speaker by name, and for systems of another kind. After `restyle` that of the new style."""
        return None if self._resolved_style.mixture is None else dict(self._resolved_style.mixture)

    def restyle(self, style: object) -> None:
        """Set another style: it fades in over half a second, from the end of the speech that was pushed.

        The same speech and the same changes at the same samples give the same motion, however the speech is cut. Motion that
        was not made yet may foresee the change: by as much as the network looks ahead, smoothing and the cubic included
        (docs/runtime.md).

        Raises:
            InputError: a style that cannot be used; the old one goes on.
        """
        resolved_style = self._direct(style)
        self._catch_up()
        self._decoder.restyle(resolved_style.blend, self._frontend.frames)
        self._frontend.control(resolved_style.controls)
        self._resolved_style = resolved_style

    def set_intensity(self, intensity: float, *, faces: bool = True) -> None:
        """Another size of all movement, 0 … 2, faded in over half a second from where the speech has come to.

        The sway of a stance stays as it is.

        Raises:
            InputError: it is no number, or out of range; or the session was opened with 0.
        """
        check_range("intensity", intensity, INTENSITY_RANGE)
        if not self._intensity:
            raise InputError("a session of intensity 0 cannot be enlarged", "open it with a larger one")
        self._catch_up()
        self._sizes.change(np.full((1, 1, 1), intensity / self._intensity), self._frontend.frames)
        if faces:
            self.change_faces(intensity=intensity)

    def change_faces(self, *, emotion: str | Moods | None = None, intensity: float | None = None) -> None:
        """Another emotion or size of the faces alone, from the first frame on that is not made yet."""
        for face in self._faces:
            if emotion is not None:
                face.set_emotion(emotion)
            if intensity is not None:
                face.set_intensity(intensity)

    def set_emotion(self, emotion: str | Moods, *, faces: bool = True) -> None:
        """Another emotion, or "auto", of the face, and of the body where a network knows emotions; see
        `cospeech.rules.Session.set_emotion`.

        Raises:
            InputError: there is no such emotion.
        """
        track = emotion_track(emotion)
        self._catch_up()
        self._decoder.set_emotion(track, self._frontend.frames / self._rate_of_poses)
        if faces:
            self.change_faces(emotion=emotion)

    def push(self, chunk: Speech) -> Iterator[Motion]:
        """Hear a piece, at once; gives the motion of the first take that has become certain, as `cospeech.rules.Session.push`.

        Raises:
            InputError: no speech, or at another rate than before, or after `finish`; it was not heard.
        """
        return (takes[0] for takes in self.push_takes(chunk))

    def finish(self) -> Iterator[Motion]:
        """End the speech; gives the rest, to exactly ceil(duration × fps) frames.

        Raises:
            InputError: there was no speech at all.
        """
        return (takes[0] for takes in self.finish_takes())

    def push_takes(self, chunk: Speech) -> Iterator[list[Motion]]:
        """As `push`, of every take."""
        self._check(chunk)
        for piece in in_short(self._times.count(chunk, float(self._duration))):
            self._duration += piece.duration
            self._hear(piece)
        return self._next_frames()

    def finish_takes(self) -> Iterator[list[Motion]]:
        """As `finish`, of every take."""
        total = count_frames(self._duration, self._fps)
        if total == 0:
            raise InputError("there is no speech", "push at least one sample before finish()")
        if self._over:
            return self._next_frames()
        self._over = True
        self._catch_up()
        for face in self._faces:
            face.hear_rest()
        for listener in self._listeners:
            listener.finish()
        rest = self._decoder.push(self._frontend.finish())
        rest = np.concatenate([rest, self._decoder.finish(self._frontend.silence)], 1)
        for face, frames in zip(self._faces, self._heads, strict=True):
            self._see(frames, face.finish())
        self._keep(rest, total, self._frontend.frames - 1)
        self._decode()
        for stack, body in zip(self._layers, self._bodies, strict=True):
            for piece in stack.finish():
                body.push(piece)
        if (count := self._count()) > 0:
            self._ready.append(self._make_motions(count))
        return self._next_frames()

    def _hear(self, piece: Speech) -> None:
        """Hear a piece. At 16 kHz the body hears small pieces together, and decodes its poses while the face is quiet, if that
        makes no frame late; of other rates it is not known here what a resampler keeps. The body hears what the face has heard,
        because the prosody of that is known already."""
        self._waiting.hold(piece)
        quiet = all(face.is_quiet(self._waiting.heard) for face in self._faces)
        late = min(self._slack, _LATEST) - float(piece.duration) if piece.rate == SAMPLE_RATE else -inf
        waits = self._waiting.seconds <= late
        hears = not waits or (quiet and self._waiting.seconds >= TICK)
        ready = self._prosody.samples
        shares = ready > self._waiting.begin and (self._waiting.heard - ready) / SAMPLE_RATE <= late
        poses = self._push_body(ready if shares else inf) if hears else None
        for face, frames in zip(self._faces, self._heads, strict=True):  # after the player, in whose mood they may be
            self._see(frames, face.push(piece))
        if poses is not None:
            self._keep(poses)
        if (count := self._count(decodes=not (waits and hears))) > 0:
            self._ready.append(self._make_motions(count))
        elif (poses is None or not poses.shape[1]) and self._count_bodies() < TICK * self._fps:
            self._decode()  # a quiet moment: what is decoded now, no busy one has to decode

    def _push_body(self, until: float = inf) -> Array | None:
        """What the body's network makes of what is held up to a place in samples; None where nothing is."""
        piece = self._waiting.take(until)
        if piece is None:
            return None
        for listener in self._listeners:
            listener.push(piece)
        return self._decoder.push(self._frontend.push(piece))

    def _catch_up(self) -> None:
        """The body hears all that was pushed, before something changes."""
        if (poses := self._push_body()) is not None:
            self._keep(poses)

    def _check(self, chunk: Speech) -> None:
        """Check a piece before any listener hears it."""
        check_speech(chunk)
        if self._over or self._rate not in (None, chunk.rate):
            was = "the speech is over" if self._over else f"the speech began at {self._rate} Hz"
            raise InputError(f"a piece of speech at {chunk.rate} Hz came, but {was}", "open a new session for it")
        if self._rate is None:
            self._rate = chunk.rate

    def _next_frames(self) -> Iterator[list[Motion]]:
        """The pieces that are ready; each leaves the queue before it is yielded."""
        while self._ready:
            yield self._ready.popleft()

    def _keep(self, rows: Array, total: int | None = None, last: int | None = None) -> None:
        """Further poses of the model, and what they make certain."""
        poses, at = self._resampler.push(rows, total, last)
        if len(at):
            scale = amplitude(self._faces[0].arousal_at(at / self._rate_of_poses))[:, None]
            size = scale * self._sizes.mix(lambda factor: factor, at)[0]
            self._sizes.forget(at[0])
            self._rows.append(self._decoder.denormalise(poses, at, size.astype(np.float32)))

    def _decode(self) -> None:
        """Decode all poses that wait; many frames at once take hardly longer than few."""
        if not self._rows:
            return
        rows, self._rows = np.concatenate(self._rows, 1), []
        shares = np.zeros(rows.shape[1])
        if self._rest is not None:
            rows, later, shares = self._rest.split(rows)
            self._rows = [later] if later.shape[1] else []
        for take, (vectors, frames, signs) in enumerate(zip(rows, self._bodies, self._signs, strict=True)):
            rotations, root = self._poses[take].push(vectors)
            rotations = rotations if self._rest is None else self._rest.lead(rotations, shares)
            rotations, root = select_parts(rotations, root, self._parts)
            frames.push(self._layers[take].push(signs.push(rotations), root))

    def _see(self, frames: WaitingFrames, motions: Iterator[Motion]) -> None:
        """Keep of the motion of a face the rotations (n, 2, 4) of its eyes, and its weights, where they are wanted."""
        for head in motions:
            if "face" in self._parts and head.face is not None:
                frames.push((head.rotations[:, eye_joints()], head.face))

    def _count(self, decodes: bool = True) -> int:
        """Frames that body and face have both come to; poses that wait are decoded where the face has come further."""
        heads = len(self._heads[0]) if "face" in self._parts else None
        if decodes and (heads is None or heads > self._count_bodies()):
            self._decode()
        bodies = self._count_bodies()
        return bodies if heads is None else min(heads, bodies)

    def _count_bodies(self) -> int:
        """Frames of bodies that every take has: layers give those of one take sooner than those of another."""
        return min(map(len, self._bodies))

    def _make_motions(self, count: int) -> list[Motion]:
        """The next frames of every take, as one."""
        start = self._frame / self._fps
        self._frame += count
        motions = []
        for take, (body, head) in enumerate(zip(self._bodies, self._heads, strict=True)):
            rotations, root = body.take(count)
            face = None
            if "face" in self._parts:
                eyes, face = head.take(count)
                rotations = rotations.copy()
                rotations[:, eye_joints()] = eyes
            motion = Motion(self._fps, rotations, root, face, humanoid(), start)
            if face is not None:
                motion = self._faces[take].aim(motion)
            if self._seams:
                rotations, root = self._seams[take].blend(motion.rotations, root, self._frame - count)
                motion = replace(motion, rotations=rotations, root=root)
            motions.append(motion)
        return motions
