"""Evaluate: motions against recordings, as a table of systems and control rows by metrics.

    table = evaluate({"rules": "generated/"}, clips)
    print(table.to_text())

It takes any sequence of clips (`cospeech.corpora.Clip`): what a reader yields, or `stored_clips` of a store.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from importlib import import_module
from itertools import pairwise
from os import PathLike
from typing import Any

import numpy as np

from ..audio.speech import Speech
from ..corpora import CORPORA
from ..corpora.clip import SPLITS, Clip, Points, Semantic
from ..corpora.derived_speakers import heard_of
from ..corpora.motion_files import load_motions
from ..corpora.store import Entry, Store
from ..errors import InputError, nearest
from ..motion.motion import Motion
from ..motion.poses import find_pose
from ..motion.rotations import Array
from . import METRICS, FeatureNet, Sample, Score, Tools, Track, load_metric
from .controls import CONTROLS, WRONG, control_rows, faults_of_order
from .sample import pose_vectors

__all__ = ["DEFAULT", "POSE_STATISTICS", "Table", "evaluate", "sample_of", "stored_clips", "track_of"]

DEFAULT = (
    "movement", "beat_align", "fgd", "fid_poses", "pck", "pck_2d", "ape", "srgr", "cca", "diversity", "l1_div", "multimodality",
    "w1_speed", "w1_acceleration", "jerk", "hellinger_speed",
)  # fmt: skip
"""The metrics of a table where none are named: the corrected forms. What a corpus has no data for stays empty."""

PADDED = 2  # frames; ours: so many may be missing at the end of a motion (frame rates that do not divide)
TRACK_FPS = 30.0  # frames per second of movement statistics
FEATURES, WINDOW, HOP = 32, 34, 10  # ours, as many as TED's network; frames of TED's and BEAT's FGD; BEAT's stride
ARMS = {"ted": (0, (4, 7), (5, 8), (6, 9)), "pats": (0, (4, 1), (5, 2), (6, 3))}
"""Key points: layout → root, and left and right shoulder, elbow, wrist (`cospeech.motion.skeletons.ted` and `pats`)."""
SHOULDER, RIGHT_SHOULDER = 167.0, 1  # pixels, key point: PATS' ``pose/normalize``, in which the published centres are
METRES = 0.175  # from neck to shoulder; `cospeech.motion.skeletons.humanoid`

Motions = Mapping[str, Motion | Clip | Sequence[Motion | Clip]] | Sequence[Motion | Clip] | str | PathLike[str]


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


def _normalised(values: Array) -> Array:
    """PATS' key points from the neck, every frame scaled so that the right shoulder is 167 px away."""
    values = np.asarray(values - values[:, :1], np.float64)
    length = np.linalg.norm(values[:, RIGHT_SHOULDER], axis=-1)
    seen = length > 1e-6
    if not seen.any():
        return values
    return values * (SHOULDER / np.where(seen, length, np.median(length[seen])))[:, None, None]


def _semantics(stretches: Sequence[Semantic] | None, frames: int, fps: float) -> Array | None:
    if stretches is None:
        return None
    scores = np.zeros(frames)
    for stretch in stretches:
        part = slice(max(0, round(stretch.start * fps)), max(0, round(stretch.end * fps)))
        scores[part] = np.maximum(scores[part], stretch.score)
    return scores


def sample_of(clip: Clip, *, condition: str = "", seed_frames: int = 0, track: bool = True) -> Sample:
    """What metrics see of a clip: of our humanoid without the legs, which stand; of other bodies all.

    Args:
        clip: of a reader, of a store, or with generated motion.
        condition: which speech the motion is for; the clip's name else.
        seed_frames: so many first frames were given.
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
        values = _normalised(points.values) if points.layout == "pats" else points.values
        known = {"positions" if values.shape[2] == 3 else "points": values}
        arms = track_of(points) if track and points.layout in ARMS else None
        semantics = _semantics(clip.semantics, len(points), points.fps)
        return Sample(fps=points.fps, track=arms, semantics=semantics, **(common | known))
    raise InputError(f"clip {clip.name!r} has no motion", "metrics need joint rotations or key points")


def _fit(motion: Motion, clip: Clip) -> Clip:
    """The clip with a generated motion in place of its own: on its skeleton, at its rate, of its length."""
    if clip.motion is None:
        raise InputError(f"clip {clip.name!r} has key points only", "give systems as clips with points")
    if motion.skeleton != clip.motion.skeleton:
        motion = motion.retarget(clip.motion.skeleton)
    motion = motion.resample(clip.motion.fps)
    missing = len(clip.motion) - len(motion)
    if missing > PADDED or not len(motion):
        raise InputError(f"motion for {clip.name!r} has {len(motion)} frames, the recording {len(clip.motion)}")
    frames = np.minimum(np.arange(len(clip.motion)), len(motion) - 1)
    face = None if motion.face is None else motion.face[frames]
    return replace(clip, motion=replace(motion, rotations=motion.rotations[frames], root=motion.root[frames], face=face))


def _system(motions: Motions, reference: Sequence[Clip], seed_frames: int, track: bool) -> list[Sample]:
    names = [clip.name for clip in reference]
    if isinstance(motions, str | PathLike):
        motions = load_motions(motions, names)
    if not isinstance(motions, Mapping):
        if len(motions) != len(reference):
            raise InputError(f"{len(motions)} motions for {len(reference)} clips", "one for each, in their order")
        motions = dict(zip(names, motions, strict=True))
    unknown = sorted(set(motions) - set(names))
    if unknown or set(names) - set(motions):
        raise InputError(f"motions and clips do not match: {(unknown or sorted(set(names) - set(motions)))[0]!r}")
    samples = []
    for clip in reference:
        takes = motions[clip.name]
        for number, take in enumerate([takes] if isinstance(takes, Motion | Clip) else takes, 1):
            made = take if isinstance(take, Clip) else _fit(take, clip)
            made = replace(made, name=f"{clip.name}.{number}", speech=clip.speech, semantics=clip.semantics)
            samples.append(sample_of(made, condition=clip.name, seed_frames=seed_frames, track=track))
    return samples


def _mark(faults: Sequence[str]) -> str:
    return "!" if any(WRONG in fault for fault in faults) else "~" if faults else ""


def stored_clips(
    folder: str | PathLike[str], *, split: str | None = "test", raw: str | PathLike[str] | None = None
) -> list[Clip]:
    """The recordings of a prepared store, decoded from its poses, as `evaluate` takes them.

    Args:
        folder: a store made by ``prepare``.
        split: of `cospeech.corpora.clip.SPLITS`, or None: all.
        raw: the corpus it was made from; a store keeps no sound, and metrics that hear need it.

    Raises:
        InputError: not a store, an unknown split, no clip in it, or a corpus that cannot be read.
    """
    store = Store(folder)
    if split not in (None, *SPLITS):
        raise InputError(f"no split is called {split!r}", nearest(str(split), SPLITS))
    entries = [entry for entry in store.clips if split in (None, entry.split)]
    if not entries:
        raise InputError(f"no clip of {str(folder)!r} is in the {split or 'whole'} split")
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
                **kind,
            )
        )
    return clips


def _stretches(scores: Array, fps: float) -> tuple[Semantic, ...]:
    """Runs of frames of one score above 0."""
    edges = [0, *(np.flatnonzero(np.diff(scores)) + 1).tolist(), len(scores)]
    return tuple(Semantic(a / fps, b / fps, float(scores[a])) for a, b in pairwise(edges) if scores[a] > 0)


def _sounds(store: Store, entries: Sequence[Entry], raw: str | PathLike[str]) -> dict[str, Speech]:
    """Entry → the speech of its own stretch; a stretch is called ``NAME@FRAME``, and a twin says what its original says."""
    wanted: dict[str, list[Entry]] = {}
    for entry in entries:
        for name in {entry.name, entry.name.partition("@")[0], heard_of(entry.name.partition("@")[0])}:
            wanted.setdefault(name, []).append(entry)
    found = {}
    for clip in import_module(CORPORA[store.corpus].module).read(raw):
        if isinstance(clip, Clip) and clip.speech is not None:
            for entry in wanted.get(clip.name, ()):
                start = clip.speech.start + entry.start - clip.start
                found[entry.name] = clip.speech.window(start, start + entry.frames / store.fps)
    return found


@dataclass(frozen=True)
class Table:
    """Scores of systems and control rows.

    Args:
        rows: names, systems first.
        columns: names of metrics.
        cells: row → column → score; None where the data for it are not there.
        why: row → column → why there is none.
        faults: column → what the metric puts in the wrong order among the control rows.
        about: of what and with what the table was made.
    """

    rows: tuple[str, ...]
    columns: tuple[str, ...]
    cells: Mapping[str, Mapping[str, Score | None]]
    why: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    faults: Mapping[str, Sequence[str]] = field(default_factory=dict)
    about: str = ""

    def to_json(self) -> str:
        """All of it; values that are not numbers are null."""

        def plain(score: Score | None) -> dict[str, object] | None:
            if score is None:
                return None
            ends = None if score.interval is None else [x if np.isfinite(x) else None for x in score.interval]
            value = score.value if np.isfinite(score.value) else None
            return {"value": value, "interval": ends, "count": score.count, "note": score.note}

        units = {name: load_metric(name).about for name in self.columns}
        return json.dumps(
            {
                "about": self.about,
                "metrics": {
                    n: {"better": a.better, "unit": a.unit, "faults": list(self.faults.get(n, ()))} for n, a in units.items()
                },
                "rows": {row: {column: plain(self.cells[row][column]) for column in self.columns} for row in self.rows},
                "why": {row: dict(reasons) for row, reasons in self.why.items()},
            },
            indent=2,
            ensure_ascii=False,
        )

    def _cell(self, row: str, column: str) -> str:
        score = self.cells[row][column]
        if score is None:
            return "–"
        half = "" if score.interval is None else f" ± {(score.interval[1] - score.interval[0]) / 2:.2g}"
        return f"{score.value:.3g}{half}"

    def to_text(self, *, width: int = 120) -> str:
        """Aligned columns, in blocks that fit into ``width`` characters; the faults of metrics below."""
        arrows = {"higher": "↑", "lower": "↓", "reference": "→"}
        marks = {name: _mark(self.faults.get(name, ())) for name in self.columns}
        heads = {name: f"{name} {arrows[load_metric(name).about.better]}{marks[name]}" for name in self.columns}
        sizes = {n: max(len(heads[n]), *(len(self._cell(row, n)) for row in self.rows)) for n in self.columns}
        first = max(map(len, self.rows))
        blocks: list[list[str]] = [[]]
        for name in self.columns:
            if blocks[-1] and first + sum(sizes[n] + 2 for n in [*blocks[-1], name]) > width:
                blocks.append([])
            blocks[-1].append(name)
        lines = [self.about] if self.about else []
        for block in blocks:
            lines += ["", " " * first + "".join(f"  {heads[n]:>{sizes[n]}}" for n in block)]
            lines += [f"{row:<{first}}" + "".join(f"  {self._cell(row, n):>{sizes[n]}}" for n in block) for row in self.rows]
        lines += [
            "",
            "± half of the 95 % interval; ↑ higher is better, ↓ lower, → nearest to the ground truth",
            "! the control rows are in the wrong order; ~ they are too near to each other to tell, on so few clips",
        ]
        lines += [f"{_mark(found)} {name}: {'; '.join(found)}" for name, found in self.faults.items() if found]
        return "\n".join(lines)


def evaluate(
    systems: Mapping[str, Motions],
    reference: Sequence[Clip],
    *,
    metrics: Sequence[str] = DEFAULT,
    tools: Tools | None = None,
    seed_frames: int = 0,
) -> Table:
    """Scores of ``systems`` and of the control rows against recordings.

    Args:
        systems: name → a folder (`load_motions`), a motion per clip in the clips' order, or clip name → motion or takes.
        reference: recordings with speech and motion (or key points), all of one skeleton.
        metrics: names in `cospeech.metrics.METRICS`.
        tools: feature network and so on; `POSE_STATISTICS` stands in where there is no network.
        seed_frames: so many first frames of each motion were given to the system.

    Raises:
        InputError: a name is unknown, motions and clips do not match, or there is nothing to evaluate against.
    """
    chosen = {name: load_metric(name) for name in metrics}
    tools = Tools(features=POSE_STATISTICS) if tools is None else tools
    tools = replace(tools, features=POSE_STATISTICS) if tools.features is None else tools
    both = sorted(set(systems) & set(CONTROLS))
    if not chosen or both:
        raise InputError(f"a system called {both[0]!r}" if both else "no metrics", f"known: {', '.join(METRICS)}")
    track = any("track" in measure.about.needs for measure in chosen.values())
    truth = [sample_of(clip, track=track) for clip in reference]
    rows = {name: _system(motions, reference, seed_frames, track) for name, motions in systems.items()}
    for name, clips in control_rows(reference, seed=tools.seed).items():
        rows[name] = [sample_of(clip, seed_frames=seed_frames, track=track) for clip in clips]
    cells: dict[str, dict[str, Score | None]] = {row: {} for row in rows}
    why: dict[str, dict[str, str]] = {}
    for row, samples in rows.items():
        for column, measure in chosen.items():
            try:
                cells[row][column] = measure(samples, truth, tools)
            except InputError as problem:
                cells[row][column] = None
                why.setdefault(row, {})[column] = str(problem)
    faults = {c: faults_of_order(m.about, {row: cells[row][c] for row in CONTROLS}) for c, m in chosen.items()}
    minutes = sum(clip.duration for clip in reference) / 60
    assert tools.features is not None
    about = f"{len(reference)} clips, {minutes:.1f} min; features: {tools.features.name}"
    return Table(tuple(rows), tuple(chosen), cells, why, {c: f for c, f in faults.items() if f}, about)
