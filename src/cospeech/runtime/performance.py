"""One speech under way on a trained system: features, poses of one or several takes, faces from the rules.

speech → rows of features (`FrameFeatures`, `reduce_audio`, standardised) → engine → standardised poses → smoothed and brought
to the asked rate, in the space of poses → decoded. Every number of a frame follows from its own index, so that a stream has
the bits of the whole.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from fractions import Fraction
from math import comb
from typing import Protocol

import numpy as np

from ..corpora.clip import Points
from ..errors import InputError
from ..features.frames import FrameFeatures, audio_features
from ..features.reduce import reduce_audio
from ..motion import Motion
from ..poses import Pose, find_pose
from ..poses.lift import lift
from ..rotations import Array, quat_identity
from ..rules import Session as RuleSession
from ..rules.session import check_speech
from ..skeleton import humanoid
from ..speech import Speech, count_frames
from .flow_bundle import FlowSystem

__all__ = ["PIECE", "Performance", "Source"]

_EYES = ("leftEye", "rightEye")
PIECE = 2.0  # seconds of speech worked off at once


class Source(Protocol):
    """Where a take's latents come from, and how it begins: at random, or from an example."""

    @property
    def history(self) -> Array:
        """(τ, D) standardised poses before the first frame."""
        ...

    @property
    def style(self) -> Array:
        """(style,) code, for a system that has them."""
        ...

    @property
    def centre(self) -> Array:
        """(D,) standardised mean pose of the speaker, from which ``intensity`` scales."""
        ...

    @property
    def spread(self) -> Array | None:
        """(D,) what the network's poses are multiplied by before they are added to the mean pose, so that they deviate as the
        speaker's do; None for a network that gives standardised poses themselves."""
        ...

    @property
    def drift(self) -> Array | None:
        """(D,) mean of what the network makes of these latents by itself, taken off before; None with ``spread``."""
        ...

    def draw(self, frames: int) -> Array:
        """(frames, D) the next latents; pieces of any size make the same sequence."""
        ...


class _Listener:
    """Speech → standardised rows of features, with silence before and after: as many as windows of the engine need.

    Args:
        system: whose.
        controls: (C,) standardised style controls, behind each row.
    """

    def __init__(self, system: FlowSystem, controls: Array) -> None:
        self._system, self._sizes, self._controls = system, system.engine.sizes, controls
        self._features = FrameFeatures(system.fps)
        self._quiet = self._controlled(_silence(system))
        self._rows = np.repeat(self._quiet, self._sizes.history, 0)

    @property
    def frames(self) -> int:
        """Of the model, in all that was heard."""
        return count_frames(self._features.duration, self._system.fps)

    def push(self, chunk: Speech) -> Array:
        """(F, heard, A) windows of the frames that have become certain."""
        return self._windows(self._features.push(chunk))

    def finish(self) -> Array:
        """Those of the rest."""
        after = np.repeat(self._quiet, self._sizes.heard - 1 - self._sizes.history, 0)
        return self._windows(self._features.finish(), after)

    def _windows(self, columns: Array, after: Array | None = None) -> Array:
        rows = self._controlled(_standard(self._system, columns)) if len(columns) else self._rows[:0]
        self._rows = np.concatenate([self._rows, rows, self._rows[:0] if after is None else after])
        windows = self._system.engine.windows(self._rows)
        self._rows = self._rows[len(windows) :].copy()
        return windows

    def _controlled(self, rows: Array) -> Array:
        return np.concatenate([rows, np.broadcast_to(self._controls, (len(rows), len(self._controls)))], 1)


def _standard(system: FlowSystem, columns: Array) -> Array:
    """(T, 84) columns as the network hears them; sounds louder or softer than any it has heard are as those."""
    s = system.statistics
    rows = (reduce_audio(columns, system.audio) - s.audio_mean) / s.audio_std
    return np.clip(rows, s.audio_low, s.audio_high).astype(np.float32)


def _silence(system: FlowSystem) -> Array:
    """(1, A) what silence sounds like, standardised."""
    return _standard(system, audio_features(Speech(np.zeros(16_000, np.float32)), 1, system.fps))


class _Poses:
    """Poses of N takes from the engine, smoothed, at the rate of the motion."""

    def __init__(self, system: FlowSystem, sources: Sequence[Source], fps: float, intensity: float) -> None:
        self._system, self._sources, self._intensity = system, sources, intensity
        styles = np.stack([source.style for source in sources])
        self._takes = system.engine.begin(np.stack([source.history for source in sources]), styles)
        self._step = system.fps / fps
        taps = 2 * system.smooth
        self._taps = [np.float32(comb(taps, n) / 2**taps) for n in range(taps + 1)]
        self._made = np.zeros((len(sources), 0, system.engine.sizes.pose), np.float32)
        self._first = 0  # index of the first pose of the model that is kept
        self._given = 0  # frames of the motion handed out

    def push(self, windows: Array, total: int | None = None, last: int | None = None) -> Array:
        """The next poses (N, n, D), standardised no more.

        Args:
            windows: of speech.
            total: frames of the motion in all, once they are known.
            last: index of the model's last pose, once it is known.
        """
        if len(windows):
            z = np.stack([source.draw(len(windows)) for source in self._sources])
            self._made = np.concatenate([self._made, self._takes.frames(windows, z)], 1)
        known = self._first + self._made.shape[1]
        end = self._given
        if total is not None:
            end = total
        else:  # frame j lies between poses m and m + 1; the cubic takes m − 1 … m + 2, each smoothed
            while int(end * self._step) + 2 + self._system.smooth < known:
                end += 1
        poses = self._sampled(np.arange(self._given, end), known - 1 if last is None else last)
        self._given = end
        keep = int(end * self._step) - 1 - self._system.smooth
        if keep > self._first and last is None:
            self._made, self._first = self._made[:, keep - self._first :].copy(), keep
        return poses

    def _sampled(self, frames: Array, last: int) -> Array:
        """Catmull-Rom through the smoothed poses; ends are held."""
        at = frames * self._step
        low = np.floor(at).astype(int)
        t = (at - low).astype(np.float32)[:, None]
        before, here, there, after = (self._smoothed(low + n, last) for n in (-1, 0, 1, 2))
        bend = 2 * before - 5 * here + 4 * there - after + (3 * (here - there) + after - before) * t
        poses = here + np.float32(0.5) * t * (there - before + t * bend)
        s, centres = self._system.statistics, np.stack([source.centre for source in self._sources])[:, None]
        return (centres + np.float32(self._intensity) * self._strayed(poses, centres)) * s.pose_std + s.pose_mean

    def _strayed(self, poses: Array, centres: Array) -> Array:
        """(N, n, D) how far poses are from the mean ones, standardised."""
        drifts, spreads = ([getattr(source, name) for source in self._sources] for name in ("drift", "spread"))
        if spreads[0] is None:  # all or none
            return poses - centres
        return (poses - np.stack(drifts)[:, None]) * np.stack(spreads)[:, None]

    def _smoothed(self, poses: Array, last: int) -> Array:
        """(N, n, D) of these indices."""
        total = np.zeros((len(self._sources), len(poses), self._made.shape[2]), np.float32)
        for n, tap in enumerate(self._taps):
            index = np.clip(poses + n - self._system.smooth, 0, last)
            total += tap * self._made[:, np.maximum(index - self._first, 0)]
        return total


class Performance:
    """One take, or several of one speech: pushed into like `cospeech.rules.Session`.

    Args:
        system: the bundle, opened.
        sources: of the takes.
        faces: a rule-based session for each take: face, eyes, and the emotion that is heard.
        fps: of the motion.
        intensity: see `BundleGesturer.generate`.
        parts: what is generated.
        controls: (C,) standardised style controls.
    """

    def __init__(
        self,
        system: FlowSystem,
        sources: Sequence[Source],
        faces: Sequence[RuleSession],
        *,
        fps: float,
        intensity: float,
        parts: tuple[str, ...],
        controls: Array,
    ) -> None:
        self._pose: Pose = find_pose(system.pose)
        self._listener = _Listener(system, controls)
        self._poses = _Poses(system, sources, fps, intensity)
        self._faces, self._fps, self._parts = faces, fps, parts
        self._bodies: list[list[Motion]] = [[] for _ in sources]
        self._heads: list[list[Motion]] = [[] for _ in sources]
        self._duration = Fraction(0)
        self._frame = 0

    @property
    def emotion(self) -> dict[str, float]:
        """Probability of each emotion, over all that was heard."""
        return self._faces[0].emotion

    def push(self, chunk: Speech) -> Iterator[Motion]:
        """Hear a piece; yields the motion of the first take that has become certain."""
        for takes in self.push_takes(chunk):
            yield takes[0]

    def finish(self) -> Iterator[Motion]:
        """The rest, to exactly ceil(duration × fps) frames.

        Raises:
            InputError: there was no speech at all.
        """
        for takes in self.finish_takes():
            yield takes[0]

    def push_takes(self, chunk: Speech) -> Iterator[list[Motion]]:
        """As `push`, of every take."""
        check_speech(chunk)
        for piece in chunk.chunks(PIECE) if chunk.duration > PIECE else [chunk]:
            for face, kept in zip(self._faces, self._heads, strict=True):
                kept += face.push(piece)
            self._duration += piece.duration
            self._keep(self._poses.push(self._listener.push(piece)))
            yield from self._ready()

    def finish_takes(self) -> Iterator[list[Motion]]:
        """As `finish`, of every take."""
        total = count_frames(self._duration, self._fps)
        if total == 0:
            raise InputError("there is no speech to gesture to", "give at least one sample")
        for face, kept in zip(self._faces, self._heads, strict=True):
            kept += face.finish()
        windows = self._listener.finish()
        self._keep(self._poses.push(windows, total, self._listener.frames - 1))
        yield from self._ready()

    def _keep(self, poses: Array) -> None:
        """Decode the next poses of every take, and let parts rest that were not asked for."""
        if not poses.shape[1]:
            return
        for rows, kept in zip(poses, self._bodies, strict=True):
            kept.append(_chosen(_moving(self._pose, rows, self._fps), self._parts))

    def _ready(self) -> Iterator[list[Motion]]:
        """What body and face have both come to, as one."""
        wanted = [*self._bodies, *(self._heads if "face" in self._parts else ())]
        count = min(sum(map(len, pieces)) for pieces in wanted)
        if count:
            bodies = [_cut(pieces, count) for pieces in self._bodies]
            if "face" in self._parts:
                bodies = [_faced(body, _cut(head, count)) for body, head in zip(bodies, self._heads, strict=True)]
            start = self._frame / self._fps
            self._frame += count
            yield [replace(body, start=start) for body in bodies]
        if "face" not in self._parts:
            for head in self._heads:
                head.clear()


def _moving(pose: Pose, vectors: Array, fps: float) -> Motion:
    """Vectors of any representation as motion of our humanoid, in float32."""
    made = pose.decode(vectors, fps)
    if isinstance(made, Points):
        made = lift(made)
    if made.skeleton != humanoid():
        made = made.retarget("humanoid")
    return replace(made, rotations=made.rotations.astype(np.float32), root=made.root.astype(np.float32))  # type: ignore[no-any-return]


def _chosen(motion: Motion, parts: tuple[str, ...]) -> Motion:
    """The motion with neutral rotations, and the hips at their place, for parts that were not asked for."""
    s = humanoid()
    fingers = {*s.left_hand, *s.right_hand}
    resting = [] if "hands" in parts else sorted(fingers)
    rotations, root = motion.rotations.copy(), motion.root
    if "body" not in parts:
        resting += [k for k in range(len(s)) if k not in fingers]
        root = np.broadcast_to(s.offsets[0].astype(np.float32), root.shape).copy()
    rotations[:, resting] = quat_identity(1)
    return replace(motion, rotations=rotations, root=root)


def _cut(pieces: list[Motion], count: int) -> Motion:
    """Take the first frames off a list of pieces."""
    whole = pieces[0] if len(pieces) == 1 else Motion.concatenate(pieces)
    pieces[:] = [whole[count:]] if len(whole) > count else []
    return whole[:count]


def _faced(body: Motion, head: Motion) -> Motion:
    """Face and eyes of the one on the other."""
    eyes = [humanoid().index[name] for name in _EYES]
    rotations = body.rotations.copy()
    rotations[:, eyes] = head.rotations[:, eyes]
    return replace(body, rotations=rotations, face=head.face)
