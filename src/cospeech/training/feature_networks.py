"""Feature networks and classifiers for metrics, from the folders of their runs."""

from __future__ import annotations

from collections.abc import Callable
from os import PathLike
from pathlib import Path

from ..errors import InputError
from ..metrics.sample import FeatureNet
from ..models.feature_net import classifier_net, feature_net
from .checkpoint import load_run, read_tensors

__all__ = ["load_classifier", "load_features"]


def _load(run: str | PathLike[str], which: str, build: Callable[..., FeatureNet]) -> FeatureNet:
    """The network of a run, with the poses, frame rate and statistics of its training."""
    net, facts = load_run(run, which)
    statistics, _ = read_tensors(Path(run) / "statistics.safetensors")
    try:
        mean, std = (statistics[f"pose_{what}"].numpy() for what in ("mean", "std"))
        name, pose, fps = str(facts["model"]), str(facts["store"]["pose"]), float(facts["store"]["fps"])
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(f"the run {str(run)!r} is damaged: {error!r}"[:200], "train it again") from None
    return build(net, name=name, pose=pose, fps=fps, mean=mean, std=std)


def load_features(run: str | PathLike[str], which: str = "best") -> FeatureNet:
    """The features of a trained autoencoder, from the folder of its run.

    Args:
        run: folder made by ``cospeech train``, of recipes/fgd_ted.toml or its like.
        which: "best" or "last".

    Raises:
        InputError: not such a run.
    """
    return _load(run, which, feature_net)


def load_classifier(run: str | PathLike[str], which: str = "best") -> FeatureNet:
    """``Tools.classifier`` of the inception score, from the run of a recipe such as recipes/speaker_classifier_pats.toml.

    Its columns are the speakers of the run, in order; arguments and errors as of `load_features`.
    """
    return _load(run, which, classifier_net)
