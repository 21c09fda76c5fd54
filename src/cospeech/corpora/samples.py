"""The input of metrics: samples of clips, and the clips of a prepared store."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from importlib import import_module
from itertools import pairwise
from os import PathLike
from typing import Any

import numpy as np

from ..audio.speech import Speech
from ..errors import InputError, nearest
from ..metrics import FeatureNet, Sample, Track
from ..metrics.sample import pose_vectors
from ..motion.motion import Motion
from ..motion.points import Points
from ..motion.poses import find_pose
from ..motion.rotations import Array
from . import CORPORA
from .clip import SPLITS, Clip, Semantic
from .derived_speakers import find_original
from .store import Entry, Store

__all__ = ["METRES", "POSE_STATISTICS", "SHOULDER", "load_stored_clips", "sample_of", "track_of"]

TRACK_FPS = 30.0  # frames per second of movement statistics
FEATURES, WINDOW, HOP = 32, 34, 10  # ours, as many as TED's network; frames of TED's and BEAT's FGD; BEAT's stride
ARMS = {"ted": (0, (4, 7), (5, 8), (6, 9)), "pats": (0, (4, 1), (5, 2), (6, 3))}
"""Key points: layout → root, and left and right shoulder, elbow, wrist (`cospeech.motion.skeletons.ted` and `pats`)."""
SHOULDER, RIGHT_SHOULDER = 167.0, 1  # pixels, key point: PATS' ``pose/normalize``, in which the published centres are
METRES = 0.175  # from neck to shoulder; `cospeech.motion.skeletons.humanoid`


def _pose_statistics(windows: Array) -> Array:
    rise = np.diff(windows, axis=1) * TRACK_FPS
    parts = np.concatenate([windows.mean(1), windows.std(1), np.sqrt(np.square(rise).mean(1))], axis=1)
    return parts @ (np.random.default_rng(0).normal(size=(parts.shape[1], FEATURES)) / np.sqrt(FEATURES))


def _in_metres(sample: Sample) -> Array:
    return pose_vectors(sample) * (1.0 if sample.positions is not None else METRES / SHOULDER)


POSE_STATISTICS = FeatureNet("pose statistics, untrained, 32-d", _pose_statistics, WINDOW, HOP, _in_metres)
"""Features where no network is passed in: mean, deviation and RMS speed of each coordinate, projected at random to 32 numbers.
Figures made with it are comparable with each other, and with no paper's."""


def track_of(points: Points) -> Track:
    """Hips, shoulders, elbows and wrists of key points, at 30 frames per second; 2-D points lie in the plane z = 0.

    Raises:
        InputError: the layout is not known.
    """
    if points.layout not in ARMS:
        raise InputError(f"key points of layout {points.layout!r}", nearest(points.layout, ARMS))
    count = max(2, int(np.ceil(len(points) * TRACK_FPS / points.fps)))
    at = np.minimum(np.arange(count) * points.fps / TRACK_FPS, len(points) - 1)
    low = np.minimum(at.astype(int), len(points) - 1)
    high, part = np.minimum(low + 1, len(points) - 1), (at - low)[:, None, None]
    values = points.values[low] * (1 - part) + points.values[high] * part
    if values.shape[2] == 2:
        values = np.concatenate([values, np.zeros((*values.shape[:2], 1))], -1)
    root, *arms = ARMS[points.layout]
    shoulders, elbows, wrists = (values[:, list(pair)] for pair in arms)
    return Track(TRACK_FPS, values[:, root], shoulders, elbows, wrists)


def _normalise_points(values: Array) -> Array:
    """PATS' key points from the neck, every frame scaled so that the right shoulder is 167 px away."""
    values = np.asarray(values - values[:, :1], np.float64)
    length = np.linalg.norm(values[:, RIGHT_SHOULDER], axis=-1)
    valid = length > 1e-6
    if not valid.any():
        return values
    return values * (SHOULDER / np.where(valid, length, np.median(length[valid])))[:, None, None]


def _semantics(stretches: Sequence[Semantic] | None, frames: int, fps: float) -> Array | None:
    if stretches is None:
        return None
    scores = np.zeros(frames)
    for stretch in stretches:
        part = slice(max(0, round(stretch.start * fps)), max(0, round(stretch.end * fps)))
        scores[part] = np.maximum(scores[part], stretch.score)
    return scores


def sample_of(clip: Clip, *, condition: str = "", seed_frames: int = 0, track: bool = True) -> Sample:
    """The sample of a clip for metrics: our humanoid without its legs, which stand still; other bodies whole.

    Args:
        clip: of a reader, of a store, or with generated motion.
        condition: which speech the motion is for; the clip's name else.
        seed_frames: number of first frames that were given and not generated.
        track: whether hips and arms are wanted, for which other skeletons than ours have to be retargeted.

    Raises:
        InputError: the clip has no motion and no key points.
    """
    common: dict[str, Any] = {
        "name": clip.name, "speech": clip.speech, "label": clip.speaker, "condition": condition or clip.name,
        "seed_frames": seed_frames,
    }  # fmt: skip
    if clip.motion is not None and len(clip.motion):
        motion, skeleton = clip.motion, clip.motion.skeleton
        keep = list(range(len(skeleton)))
        if skeleton.kind == "humanoid":
            keep = [k for k in keep if k == 0 or k not in skeleton.lower_body]
        try:
            body = motion if skeleton.kind == "humanoid" or not track else motion.retarget("humanoid")
            arms = Track.of(body) if track else None
        except InputError:
            arms = None  # a body without arms that we know; metrics that need them say so
        return Sample(
            fps=motion.fps, positions=motion.positions()[:, keep], rotations=np.asarray(motion.rotations[:, keep], np.float64),
            names=tuple(skeleton.names[k] for k in keep), face=motion.face, track=arms,
            semantics=_semantics(clip.semantics, len(motion), motion.fps), **common,
        )  # fmt: skip
    if clip.points is not None and len(clip.points):
        points = clip.points
        values = _normalise_points(points.values) if points.layout == "pats" else points.values
        coordinates = {"positions" if values.shape[2] == 3 else "points": values}
        arms = track_of(points) if track and points.layout in ARMS else None
        semantics = _semantics(clip.semantics, len(points), points.fps)
        return Sample(fps=points.fps, track=arms, semantics=semantics, **(common | coordinates))
    raise InputError(f"clip {clip.name!r} has no motion", "metrics need joint rotations or key points")


def load_stored_clips(
    folder: str | PathLike[str], *, split: str | None = "test", raw: str | PathLike[str] | None = None
) -> list[Clip]:
    """The recordings of a prepared store, decoded from its poses, as `evaluate` takes them.

    Args:
        folder: a store made by ``prepare``.
        split: of `cospeech.corpora.clip.SPLITS`; ``"all"`` or None: every clip.
        raw: the corpus it was made from; a store keeps no sound, and metrics that hear need it.

    Raises:
        InputError: not a store, an unknown split, no clip in it; a corpus that is not known, cannot be read, or is another one.
    """
    store, split = Store(folder), None if split == "all" else split
    if split not in (None, *SPLITS):
        raise InputError(f"no split is called {split!r}", nearest(str(split), (*SPLITS, "all")))
    entries = [entry for entry in store.clips if split in (None, entry.split)]
    if not entries:
        there = [name for name in SPLITS if any(entry.split == name for entry in store.clips)]
        hint = f"--split {' or '.join(there)}; --split all takes every clip"
        raise InputError(f"no clip of {str(folder)!r} is in the {split or 'whole'} split", hint)
    pose = find_pose(store.pose)
    sounds = {} if raw is None else _sounds(store, entries, raw)
    clips = []
    for entry in entries:
        arrays = store.clip(entry)
        body = pose.decode(np.asarray(arrays["pose"], np.float64), store.fps)
        if isinstance(body, Motion) and "face" in arrays:
            body = replace(body, face=np.asarray(arrays["face"], np.float64))
        kind = {"motion": body} if isinstance(body, Motion) else {"points": body}
        semantics = _stretches(arrays["semantic"], store.fps) if "semantic" in arrays else None
        speech = sounds.get(entry.name)
        clips.append(
            Clip(
                entry.name,
                entry.speaker,
                store.corpus,
                speech,
                semantics=semantics,
                split=entry.split,
                start=entry.start,
                pose=store.pose,
                **kind,
            )
        )
    return clips


def _stretches(scores: Array, fps: float) -> tuple[Semantic, ...]:
    """Runs of frames of one score above 0."""
    edges = [0, *(np.flatnonzero(np.diff(scores)) + 1).tolist(), len(scores)]
    return tuple(Semantic(a / fps, b / fps, float(scores[a])) for a, b in pairwise(edges) if scores[a] > 0)


def _sounds(store: Store, entries: Sequence[Entry], raw: str | PathLike[str]) -> dict[str, Speech]:
    """Entry → the speech of its own stretch, ``NAME@FRAME``. A derived speaker says what its original says."""
    if store.corpus not in CORPORA:
        hint = "import the module of its reader first: docs/add_a_corpus.md says how"
        raise InputError(f"the store is of corpus {store.corpus!r}, which is not known here", hint)
    by_name: dict[str, list[Entry]] = {}
    for entry in entries:
        for name in {entry.name, entry.name.partition("@")[0], find_original(entry.name.partition("@")[0])}:
            by_name.setdefault(name, []).append(entry)
    speeches, has_match = {}, False
    for clip in import_module(CORPORA[store.corpus].module).read(raw):
        if not isinstance(clip, Clip):
            continue
        has_match = has_match or clip.name in by_name
        if clip.speech is not None:
            for entry in by_name.get(clip.name, ()):
                start = clip.speech.start + entry.start - clip.start
                speeches[entry.name] = clip.speech.window(start, start + entry.frames / store.fps)
    if not has_match:
        problem = f"{str(raw)!r} has none of the recordings of the store {str(store.folder)!r}, such as {entries[0].name!r}"
        raise InputError(problem, f"name the {store.corpus} corpus that the store was prepared from")
    return speeches
