"""Scores of Mix-StAGE's tables that do not compare pairs of clips: means over speakers, and those of a classifier."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ...metrics import FeatureNet, Sample, Score, Tools
from ...metrics.inception_score import EPS, score_of_classes
from ...metrics.interval import SCORE_DRAWS, bootstrap, mean_score
from ...motion.rotations import Array
from .paper_tables import Cells
from .scores import as_cell, cell

__all__ = ["OWN_COLUMNS", "attach_controls", "mean_cells", "score_cells", "score_target_style"]

OWN_COLUMNS = ("score_of_set", "named", "named_windows")
"""Columns that are no metric of `cospeech.metrics.METRICS`."""


def mean_cells(parts: Sequence[Cells]) -> Cells:
    """The plain mean of each metric over speakers; no figure where a speaker has none."""
    means: Cells = {}
    for metric in parts[0]:
        lacking = next((part[metric] for part in parts if "value" not in part[metric]), None)
        if lacking is not None:
            means[metric] = lacking
        elif len(parts) == 1:
            means[metric] = parts[0][metric]
        else:
            value = float(np.mean([part[metric]["value"] for part in parts]))
            means[metric] = {"value": value, "interval": None, "note": parts[0][metric]["note"]}
            draws = [part[metric].get("draws") or [] for part in parts]
            if draws[0] and len({*map(len, draws)}) == 1:
                means[metric]["draws"] = np.mean(draws, 0).tolist()
    return means


def attach_controls(cells: Cells, rows: Mapping[str, Cells]) -> Cells:
    """Cells with the values of control rows over the same speakers."""
    return {
        metric: cell | {"controls": {name: own[metric]["value"] for name, own in rows.items() if "value" in own[metric]}}
        for metric, cell in cells.items()
    }


def score_cells(classes: Array, own: Array, name: str, clips: Sequence[str]) -> Cells:
    """Inception scores of windows.

    Args:
        classes: (N, C) probabilities of all speakers of the classifier.
        own: (N, S) probabilities of the speakers of the system alone, which sum to 1.
        name: of the classifier.
        clips: (N,) the clip of each window; the bootstrap draws clips.
    """
    net = FeatureNet(name, lambda windows: windows[:, 0], 1, 1, lambda sample: classes[int(sample.name)][None])
    still = np.zeros((1, 2, 3))
    samples = [Sample(str(k), 15.0, positions=still, group=clip) for k, clip in enumerate(clips)]
    tools = Tools(classifier=net)
    scores = {metric: cell(metric, samples, (), tools) for metric in ("inception_score_published", "inception_score")}
    resamples = bootstrap(lambda k: score_of_classes(own[k], EPS), clips, draws=SCORE_DRAWS)
    whole = Score(score_of_classes(own, EPS), resamples.interval, len(own), draws=resamples.draws)
    return scores | {"score_of_set": as_cell(whole)}


def score_target_style(own: Array, target: Array, groups: Sequence[tuple[str, str]]) -> Cells:
    """Shares of windows, and of clips (by the mean over their windows), whose style is the most probable one.

    Args:
        own: (N, S) probabilities.
        target: (N,) number of the style.
        groups: (N,) clip and style of each window.
    """
    right = (own.argmax(1) == target).astype(float)
    performances: dict[tuple[str, str], list[int]] = {}
    for k, group in enumerate(groups):
        performances.setdefault(group, []).append(k)
    hits = [float(own[rows].mean(0).argmax() == target[rows[0]]) for rows in performances.values()]
    by_performance = mean_score(hits, groups=[clip for clip, _ in performances])
    return {
        "named": as_cell(by_performance),
        "named_windows": as_cell(mean_score([*right], groups=[clip for clip, _ in groups])),
    }
