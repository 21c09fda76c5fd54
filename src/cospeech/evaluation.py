"""Contest: a model plays the recordings of a corpus, so that `evaluate` can compare it with them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from importlib import import_module
from os import PathLike, fspath
from pathlib import Path
from typing import Any

import numpy as np

from .corpora.clip import Clip, Points
from .corpora.keypoints import resample_points
from .errors import InputError
from .metrics import FeatureNet, Tools
from .metrics.evaluation import DEFAULT, Table, sample_of, stored_clips
from .metrics.evaluation import evaluate as judge
from .models import MODELS, Gesturer, load, plays
from .motion.motion import Motion

__all__ = ["contest", "evaluate", "feature_tools", "play"]


def _pats(motion: Motion) -> Points:
    from .corpora.pats.points import points_of

    return points_of(motion)


def _ted(motion: Motion) -> Points:
    from .corpora.ted.write import points_of

    return points_of(motion)


LAYOUTS: dict[str, Callable[[Motion], Points]] = {"ted": _ted, "pats": _pats}
"""Layout of key points → how motion of our humanoid is seen in it."""


def play(model: str | Gesturer, clips: Sequence[Clip], *, takes: int = 1, seed: int = 0) -> dict[str, list[Motion | Clip]]:
    """Clip name → what a model makes of its speech, ``takes`` times with seeds from ``seed`` on, in the clip's own form.

    Raises:
        InputError: no such model, or a clip has no speech.
    """
    player, played = load(model) if isinstance(model, str) else model, dict[str, list[Motion | Clip]]()
    for clip in clips:
        if clip.speech is None:
            raise InputError(f"clip {clip.name!r} has no speech to play", "name the corpus: --raw RAW")
        body = clip.motion if clip.motion is not None else clip.points
        if body is None:
            raise InputError(f"clip {clip.name!r} has no motion to compare with")
        made = [player.generate(clip.speech, seed=seed + k, fps=body.fps) for k in range(takes)]
        played[clip.name] = [motion if clip.points is None else _seen(motion, clip) for motion in made]
    return played


def _seen(motion: Motion, clip: Clip) -> Clip:
    """The clip with the key points of a generated motion, at its rate and of its length."""
    assert clip.points is not None
    points = LAYOUTS[clip.points.layout](motion)
    values = resample_points(points.values, points.fps, clip.points.fps)
    frames = np.minimum(np.arange(len(clip.points)), len(values) - 1)
    return replace(clip, points=Points(clip.points.fps, values[frames], clip.points.layout))


def feature_tools(features: str | PathLike[str] | FeatureNet | None, clips: Sequence[Clip]) -> Tools | None:
    """What metrics get: a feature network that was trained (`cospeech.models.feature_net`), for FGD and its like.

    Args:
        features: the network, the folder of its run (which needs torch), or None: what `cospeech.metrics.evaluation` has without any.
        clips: what it has to see.

    Raises:
        InputError: not the run of a feature network, one for other bodies or rates than the clips', or torch is missing.
    """
    if features is None:
        return None
    net = features
    if not isinstance(net, FeatureNet):
        try:
            net = import_module("cospeech.models.feature_net").load_features(net)
        except ModuleNotFoundError as error:
            if (error.name or "").partition(".")[0] != "torch":
                raise
            raise InputError("feature networks need torch, which is not installed", "pip install 'cospeech[train]'") from None
    assert isinstance(net, FeatureNet)
    for clip in clips[:1]:
        net.poses(sample_of(clip, track=False))
    return Tools(features=net)


def contest(
    targets: Mapping[str, str | Gesturer],
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
    """A table of systems and the control rows on the recordings of a prepared store.

    Args:
        targets: name → what `cospeech.load` takes or gives, or a folder of motions named like the clips; none: the control rows
            alone.
        store: made by ``prepare``.
        raw: the corpus it was made from, for the sound; without it, metrics that hear stay empty and no model can play.
        metrics: names in `cospeech.metrics.METRICS`.
        split: train, validation or test; None: all.
        takes: so many performances of a model, for metrics of variety.
        seed: of the first.
        seed_frames: so many first frames of each motion were given to the systems.
        features: the network of FGD, or the run folder of one; see `feature_tools`.

    Raises:
        InputError: anything of these cannot be used.
    """
    if not 1 <= takes <= 100:
        raise InputError(f"{takes} takes", "1 … 100")
    for target in targets.values():
        if isinstance(target, str) and not plays(target) and not Path(target).is_dir():
            hint = f"models: {', '.join(MODELS)}; NAME.cospeech; the folder of a run"
            raise InputError(f"{target!r} is no folder of motions and no model", hint)
    clips = stored_clips(store, split=split, raw=raw)
    tools = feature_tools(features, clips)
    systems: dict[str, Any] = {
        name: target if isinstance(target, str) and not plays(target) else play(target, clips, takes=takes, seed=seed)
        for name, target in targets.items()
    }
    return judge(systems, clips, metrics=metrics, tools=tools, seed_frames=seed_frames)


def evaluate(
    model: str | PathLike[str] | Gesturer | None,
    corpus: str | PathLike[str] | Sequence[Clip],
    *,
    metrics: Sequence[str] = DEFAULT,
    raw: str | PathLike[str] | None = None,
    split: str | None = "test",
    takes: int = 1,
    seed: int = 0,
    features: str | PathLike[str] | FeatureNet | None = None,
) -> Table:
    """A table of one system and the control rows: ``cospeech.evaluate(model, "stores/beat", raw="raw/beat")``.

    Args:
        model: what `cospeech.load` gives or takes, a folder of motions, or None: the control rows alone.
        corpus: a prepared store, or recordings with speech and motion.
        metrics, raw, split, takes, seed, features: see `contest`.

    Raises:
        InputError: anything of these cannot be used.
    """
    model = fspath(model) if isinstance(model, PathLike) else model
    if isinstance(model, str) and isinstance(corpus, str | PathLike):
        return contest(
            {Path(model).name: model}, corpus,
            raw=raw, metrics=metrics, split=split, takes=takes, seed=seed, features=features,
        )  # fmt: skip
    clips = stored_clips(corpus, split=split, raw=raw) if isinstance(corpus, str | PathLike) else list(corpus)
    systems: dict[str, Any] = {} if model is None else {_name(model): play(model, clips, takes=takes, seed=seed)}
    return judge(systems, clips, metrics=metrics, tools=feature_tools(features, clips))


def _name(model: str | Gesturer) -> str:
    return model if isinstance(model, str) else type(model).__name__
