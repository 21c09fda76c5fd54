"""Evaluation: compare a model, or motions, with recordings. The result is a table of metrics for systems and control rows.

table = evaluate("rules", "stores/beat", raw="raw/beat")
print(table.to_text())
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from importlib import import_module
from os import PathLike, fspath
from pathlib import Path
from typing import Any

import numpy as np

from .corpora.clip import Clip
from .corpora.motion_files import RecordingPart, load_motions
from .corpora.samples import POSE_STATISTICS, load_stored_clips, sample_of
from .errors import CospeechWarning, InputError, describe_extra, nearest, say_count
from .metrics import METRICS, FeatureNet, Metric, Sample, Score, Tools, load_metric
from .metrics.controls import CONTROLS, control_rows, faults_of_order
from .metrics.table import DEFAULT, Table
from .models import MODELS, Model, load, plays
from .motion.keypoints import resample_points
from .motion.motion import Motion
from .motion.points import Points
from .motion.poses import find_pose, keypoints2d
from .motion.poses.direction_vectors import DIRECTION_VECTORS
from .motion.rotations import Array

__all__ = ["evaluate", "evaluate_clips", "evaluate_store", "feature_tools", "play"]

_MOST_EXCESS = 0.5  # seconds by which a motion may be longer than the recording without a note [ours]
PADDING = 2  # frames that may be missing at the end of a motion [ours: frame rates that do not divide]
Body = Motion | Points | Clip
Motions = Mapping[str, Body | Sequence[Body]] | Sequence[Body] | str | PathLike[str]


def _ted(motion: Motion) -> Points:
    """Key points with the bone lengths of the authors' code, as in the recordings of a store: lengths are not evaluated."""
    return DIRECTION_VECTORS.decode(DIRECTION_VECTORS.encode(motion), motion.fps)


LAYOUTS: dict[str, Callable[[Motion], Points]] = {"ted": _ted, "pats": keypoints2d.points_of}
"""Layout of key points → function that converts motion on any recognised skeleton to it."""


def play(model: str | Model, clips: Sequence[Clip], *, takes: int = 1, seed: int = 0) -> dict[str, list[Motion | Clip]]:
    """Generate motion for the speech of each clip, in the form of the clip's own motion.

    Args:
        model: a model, or its name.
        clips: recordings with speech.
        takes: takes of each clip.
        seed: of the first take; the next take has the next seed.

    Returns:
        Clip name → takes.

    Raises:
        InputError: no such model, or a clip has no speech.
    """
    player, results = _load_player(model), dict[str, list[Motion | Clip]]()
    for clip in clips:
        if clip.speech is None:
            others = any(each.speech is not None for each in clips)
            hint = "its sound is not in the folder of --raw" if others else "name the corpus: --raw RAW"
            raise InputError(f"clip {clip.name!r} has no speech to play", hint)
        body = clip.motion if clip.motion is not None else clip.points
        if body is None:
            raise InputError(f"clip {clip.name!r} has no motion to compare with")
        motions = [player.generate(clip.speech, seed=seed + k, fps=body.fps) for k in range(takes)]
        results[clip.name] = [motion if clip.points is None else _fit_points(motion, clip.points, clip) for motion in motions]
    return results


def feature_tools(features: str | PathLike[str] | FeatureNet | None, clips: Sequence[Clip]) -> Tools | None:
    """The tools of metrics: a trained feature network (`cospeech.models.feature_net`), for FGD and similar metrics.

    Args:
        features: the network, the folder of its run (which needs torch), or None: `POSE_STATISTICS`.
        clips: the clips on which it is used.

    Raises:
        InputError: not the run of a feature network, a network for another body or frame rate, or torch is missing.
    """
    if features is None:
        return None
    net = features
    if not isinstance(net, FeatureNet):
        try:
            net = import_module("cospeech.training.feature_networks").load_features(net)
        except ModuleNotFoundError as error:
            if (error.name or "").partition(".")[0] != "torch":
                raise
            raise InputError("feature networks need torch, which is not installed", describe_extra("train")) from None
    assert isinstance(net, FeatureNet)
    for clip in clips[:1]:
        net.poses(sample_of(clip, track=False))
    return Tools(features=net)


def evaluate_store(
    targets: Mapping[str, str | Model],
    store: str | PathLike[str],
    *,
    raw: str | PathLike[str] | None = None,
    metrics: Sequence[str] = DEFAULT,
    split: str | None = "test",
    takes: int = 1,
    seed: int = 0,
    seed_frames: int = 0,
    features: str | PathLike[str] | FeatureNet | None = None,
) -> Table:
    """Compare systems and the control rows with the recordings of a prepared store.

    Args:
        targets: name → a model, what `cospeech.load` takes, or a folder of motions named like the clips. If empty, the table
            has the control rows alone.
        store: folder made by ``prepare``.
        raw: folder of the corpus, for the sound. Without it, metrics that need speech stay empty, and no model can play.
        metrics: names in `cospeech.metrics.METRICS`.
        split: train, validation or test; ``"all"`` or None: every clip.
        takes: takes of each model, for metrics of variety.
        seed: of the first take.
        seed_frames: number of first frames of each motion that the systems were given.
        features: the network of FGD, or the folder of its run; see `feature_tools`.

    Raises:
        InputError: an argument cannot be used.
    """
    if not 1 <= takes <= 100:
        raise InputError(f"{takes} takes", "1 … 100")
    measures = _choose_metrics(metrics, targets)  # before models play, which takes long
    speech_metrics = [name for name, measure in measures.items() if "speech" in measure.about.needs] if raw is None else []
    if speech_metrics and tuple(metrics) != tuple(DEFAULT):
        raise InputError(f"{', '.join(speech_metrics)}: the sound of the corpus is needed", "name its folder: --raw RAW")
    for target in targets.values():
        if isinstance(target, str) and not plays(target) and not Path(target).is_dir():
            hint = f"models: {', '.join(MODELS)}; NAME.cospeech; the folder of a run"
            raise InputError(f"{target!r} is no folder of motions and no model", hint)
    clips = load_stored_clips(store, split=split, raw=raw)
    _check_seed_frames(seed_frames, clips)
    tools = feature_tools(features, clips)
    # all models and folders are read before the first model plays, which takes long
    systems: dict[str, Any] = {
        name: _load(target, clips) if isinstance(target, str) and not plays(target) else _load_player(target)
        for name, target in targets.items()
    }
    for name, system in systems.items():
        if not isinstance(system, dict):
            systems[name] = play(system, clips, takes=takes, seed=seed)
    return evaluate_clips(systems, clips, metrics=metrics, tools=tools, seed_frames=seed_frames)


def evaluate(
    model: str | PathLike[str] | Model | None,
    corpus: str | PathLike[str] | Sequence[Clip],
    *,
    metrics: Sequence[str] = DEFAULT,
    raw: str | PathLike[str] | None = None,
    split: str | None = "test",
    takes: int = 1,
    seed: int = 0,
    features: str | PathLike[str] | FeatureNet | None = None,
) -> Table:
    """Compare one system with recordings: ``cospeech.evaluate(model, "stores/beat", raw="raw/beat")``.

    Args:
        model: a model, or what `cospeech.load` takes; a folder of motions; or None for the control rows alone.
        corpus: a prepared store, or recordings with speech and motion.
        metrics, raw, split, takes, seed, features: see `evaluate_store`.

    Returns:
        A table of metrics with a row for the system and the control rows; ``print(table.to_text())`` shows it.

    Raises:
        InputError: an argument cannot be used; the message says which one, and why.
    """
    model = fspath(model) if isinstance(model, PathLike) else model
    if isinstance(model, str) and isinstance(corpus, str | PathLike):
        return evaluate_store(
            {Path(model).name: model}, corpus,
            raw=raw, metrics=metrics, split=split, takes=takes, seed=seed, features=features,
        )  # fmt: skip
    _choose_metrics(metrics, ())
    clips = load_stored_clips(corpus, split=split, raw=raw) if isinstance(corpus, str | PathLike) else list(corpus)
    systems: dict[str, Any] = {} if model is None else {_name(model): play(model, clips, takes=takes, seed=seed)}
    return evaluate_clips(systems, clips, metrics=metrics, tools=feature_tools(features, clips))


def _load_player(model: str | Model) -> Model:
    return load(model) if isinstance(model, str) else model


def _name(model: str | Model) -> str:
    return model if isinstance(model, str) else type(model).__name__


def evaluate_clips(
    systems: Mapping[str, Motions],
    reference: Sequence[Clip],
    *,
    metrics: Sequence[str] = DEFAULT,
    tools: Tools | None = None,
    seed_frames: int = 0,
) -> Table:
    """Compare ``systems`` and the control rows with recordings.

    Args:
        systems: name → a folder (`load_motions`), a motion per clip in the clips' order, or clip name → motion or takes. A
            motion is a `Motion` on any recognised skeleton, or a `Points` for recordings of key points. If the recordings are
            key points, a `Motion` is converted to them.
        reference: recordings with speech and motion (or key points), all of one skeleton.
        metrics: names in `cospeech.metrics.METRICS`.
        tools: feature network and so on; without a network, `POSE_STATISTICS` is used.
        seed_frames: number of first frames of each motion that the systems were given.

    Raises:
        InputError: a name is unknown, motions and clips do not match, or there is nothing to evaluate against.
    """
    measures = _choose_metrics(metrics, systems)
    tools = Tools(features=POSE_STATISTICS) if tools is None else tools
    tools = replace(tools, features=POSE_STATISTICS) if tools.features is None else tools
    _check_seed_frames(seed_frames, reference)
    track = any("track" in measure.about.needs for measure in measures.values())
    truth = [sample_of(clip, track=track) for clip in reference]
    rows = {name: _system(motions, reference, seed_frames, track) for name, motions in systems.items()}
    for name, clips in control_rows(reference, seed=tools.seed).items():
        rows[name] = [sample_of(clip, seed_frames=seed_frames, track=track) for clip in clips]
    cells: dict[str, dict[str, Score | None]] = {row: {} for row in rows}
    why: dict[str, dict[str, str]] = {}
    for row, samples in rows.items():
        for column, measure in measures.items():
            try:
                cells[row][column] = measure(samples, truth, tools)
            except InputError as problem:
                cells[row][column] = None
                why.setdefault(row, {})[column] = str(problem)
    faults = {c: faults_of_order(m.about, {row: cells[row][c] for row in CONTROLS}) for c, m in measures.items()}
    minutes = sum(clip.duration for clip in reference) / 60
    assert tools.features is not None
    about = f"{say_count(len(reference), 'clip')}, {minutes:.1f} min; features: {tools.features.name}"
    return Table(tuple(rows), tuple(measures), cells, why, {c: f for c, f in faults.items() if f}, about, len(reference))


def _choose_metrics(metrics: Sequence[str], systems: Collection[str]) -> dict[str, Metric]:
    """Name → metric; raise an InputError for an unknown name, or a system with the name of a control row."""
    if isinstance(metrics, str):
        raise InputError(f"metrics {metrics[:60]!r}", f"a list of names: metrics=[{metrics[:60]!r}]")
    measures = {name: load_metric(name) for name in metrics}
    if not measures:
        raise InputError("no metrics", f"known: {', '.join(METRICS)}")
    for name in systems:
        if name in CONTROLS:
            raise InputError(f"a system called {name!r}", f"another name: {', '.join(CONTROLS)} are control rows")
    return measures


def _check_seed_frames(seed_frames: int, clips: Sequence[Clip]) -> None:
    """Raise an InputError if the number of seed frames is negative, or leaves no frame of any clip to evaluate."""
    bodies = [clip.motion if clip.motion is not None else clip.points for clip in clips]
    longest = max((len(body) for body in bodies if body is not None), default=0)
    if seed_frames < 0 or 0 < longest <= seed_frames:
        hint = f"0 … {max(longest - 1, 0)}: the longest clip has {say_count(longest, 'frame')}"
        raise InputError(say_count(seed_frames, "seed frame"), hint)


def _fit(body: Motion | Points, clip: Clip) -> Clip:
    """A clip with a generated motion in place of the recorded one, converted to its form, frame rate and length.

    Raises:
        InputError: the motion is shorter than the recording, or cannot be converted to its form.
    """
    if clip.motion is None and clip.points is not None:
        return _fit_points(body, clip.points, clip)
    if clip.motion is None:
        raise InputError(f"clip {clip.name!r} has no motion to compare with")
    if isinstance(body, Points):
        raise InputError(
            f"key points for {clip.name!r}, whose recording has joint rotations",
            "give a Motion; cospeech.motion.poses.lift.lift makes one of key points",
        )
    motion = body if body.skeleton == clip.motion.skeleton else body.retarget(clip.motion.skeleton)
    motion = motion.resample(clip.motion.fps)
    frames = _rows(len(motion), len(clip.motion), clip.motion.fps, clip.name)
    face = None if motion.face is None else motion.face[frames]
    motion = replace(motion, rotations=motion.rotations[frames], root=motion.root[frames], face=face)
    return replace(clip, motion=_keep_as(motion, clip))


def _keep_as(motion: Motion, clip: Clip) -> Motion:
    """The motion in the pose representation of the clip's store: what this leaves out, such as legs, counts for no row."""
    pose = None if clip.pose is None else find_pose(clip.pose)
    if pose is None or pose.source != "motion" or (pose.name == "face" and motion.face is None):
        return motion
    reconstruction: Motion = pose.decode(pose.encode(motion), motion.fps)
    return replace(reconstruction, face=motion.face)


def _fit_points(body: Motion | Points, true: Points, clip: Clip) -> Clip:
    """A clip with generated key points in place of the recorded ones, converted to their layout, frame rate and length."""
    if isinstance(body, Motion):
        if true.layout not in LAYOUTS:
            raise InputError(f"clip {clip.name!r} has key points of layout {true.layout!r}", nearest(true.layout, LAYOUTS))
        body = LAYOUTS[true.layout](body)
    if body.layout != true.layout or body.values.shape[1:] != true.values.shape[1:]:
        raise InputError(
            f"key points for {clip.name!r} of layout {body.layout!r} and shape {body.values.shape}",
            f"the recording has layout {true.layout!r} and shape {true.values.shape}",
        )
    values = resample_points(body.values, body.fps, true.fps)
    return replace(clip, points=Points(true.fps, values[_rows(len(values), len(true), true.fps, clip.name)], true.layout))


def _rows(length: int, frames: int, fps: float, name: str) -> Array:
    """(frames,) indices of the frames to compare; the last frame stands in for the few that may be missing.

    Raises:
        InputError: more than `PADDING` frames are missing.
    """
    if frames - length > PADDING or not length:
        problem = (
            f"motion for {name!r} has {length} frames ({length / fps:.2f} s), the recording {frames} ({frames / fps:.2f} s)"
        )
        raise InputError(
            problem, f"{PADDING} frames ({PADDING / fps:.2f} s) may be missing; was it made for another clip, or cut off?"
        )
    return np.minimum(np.arange(frames), length - 1)


def _note_longer(takes: Mapping[str, Sequence[Body]], reference: Sequence[Clip]) -> None:
    """Warn of motions that are longer than their recording: the frame rate or the take may be wrong."""
    longer = []
    for clip in reference:
        seconds = max((take.duration for take in takes[clip.name]), default=0.0)
        if seconds > clip.duration + _MOST_EXCESS:
            longer.append(f"{clip.name!r}: {seconds:.1f} s, recorded {clip.duration:.1f} s")
    if longer:
        what = f"{len(longer)} of {say_count(len(reference), 'clip')} have motion that goes on after the recording"
        hint = "what comes after it does not count. Are frame rate and take right?"
        warnings.warn(f"{what} ({longer[0]}): {hint}", CospeechWarning, stacklevel=3)


def _load(folder: str | PathLike[str], reference: Sequence[Clip]) -> dict[str, list[Motion]]:
    """Load the motions of a folder. A part of a recording without a file of its own is cut from the file of the whole."""
    parts, fps = dict[str, RecordingPart](), 30.0
    for clip in reference:
        body = clip.motion if clip.motion is not None else clip.points
        recording, _, first = clip.name.rpartition("@")
        if body is None or clip.pose is None or not recording or not first.isdecimal():
            continue
        fps = body.fps
        # readers of corpora may put an @ into a name, too: only a part begins with the frame of its name
        if clip.points is not None or abs(clip.start * fps - int(first)) < 1:
            parts[clip.name] = RecordingPart(recording, int(first), len(body))
    return load_motions(folder, [clip.name for clip in reference], parts, fps)


def _system(motions: Motions, reference: Sequence[Clip], seed_frames: int, track: bool) -> list[Sample]:
    names = [clip.name for clip in reference]
    if isinstance(motions, str | PathLike):
        motions = _load(motions, reference)
    if not isinstance(motions, Mapping):
        if len(motions) != len(reference):
            raise InputError(f"{len(motions)} motions for {say_count(len(reference), 'clip')}", "one for each, in their order")
        motions = dict(zip(names, motions, strict=True))
    unknown = sorted(set(motions) - set(names))
    if unknown or set(names) - set(motions):
        raise InputError(f"motions and clips do not match: {(unknown or sorted(set(names) - set(motions)))[0]!r}")
    takes = {name: [body] if isinstance(body, Body) else body for name, body in motions.items()}
    _note_longer(takes, reference)
    samples = []
    for clip in reference:
        for number, take in enumerate(takes[clip.name], 1):
            body = take if isinstance(take, Clip) else _fit(take, clip)
            body = replace(body, name=f"{clip.name}.{number}", speech=clip.speech, semantics=clip.semantics)
            samples.append(sample_of(body, condition=clip.name, seed_frames=seed_frames, track=track))
    return samples
