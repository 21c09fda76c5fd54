"""Scores of one row and seed: a system plays the excerpts, and the columns of a table score them. Results are cached."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from hashlib import blake2b
from os import PathLike
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from ...errors import InputError
from ...files import atomic
from ...metrics import FeatureNet, Sample, Score, Tools, load_metric
from ...motion.rotations import Array
from .excerpts import Excerpts
from .inputs import find_context, generate_rows
from .paper_tables import Cells
from .runs import PlayableRun, Runs, make_folder
from .tsne import tsne

__all__ = [
    "Recordings",
    "ScoreCache",
    "as_cell",
    "cache_result",
    "cell",
    "controls_of_latents",
    "generate_windows",
    "latents",
    "score",
    "score_columns",
    "score_latents",
]

SCORING = 5  # counts up when the computation of scores changes, so that cached ones are not used
TAKES, SPEECHES = 5, 100  # of multimodality: performances of a window, and number of such windows; ours


def cache_result(folder: Path, key: Sequence[object], work: Callable[[], Any]) -> Any:
    """The result of ``work``, as JSON; read from ``folder`` where it was computed before with the same key."""
    name = blake2b(json.dumps([SCORING, *map(str, key)]).encode(), digest_size=10).hexdigest()
    path = folder / f"{name}.json"
    try:
        return json.loads(path.read_text("utf-8"))
    except (OSError, ValueError):
        pass
    result = work()
    make_folder(folder)
    with atomic(path) as temporary:
        temporary.write_text(json.dumps(result, indent=1) + "\n", "utf-8", newline="\n")
    return result


class ScoreCache:
    """Keeps scores in the folder of the runs of a table, by the data that they are of.

    Args:
        runs: of the table.
        raw: the corpus, for metrics that hear; None: no sound.
    """

    def __init__(self, runs: Runs, raw: str | PathLike[str] | None) -> None:
        self._runs, self._raw = runs, raw

    @cached_property
    def _data(self) -> str:
        return self._runs.digest_data(self._raw)

    def find(self, key: Sequence[object], work: Callable[[], Any]) -> Any:
        """The result of ``work``; see `cache_result`."""
        return cache_result(Path(self._runs.runs) / "scores", [self._runs.fingerprint, self._data, *key], work)


def cell(metric: str, generated: Sequence[Sample], truth: Sequence[Sample], tools: Tools) -> dict[str, Any]:
    try:
        score = load_metric(metric)(generated, truth, tools)
    except InputError as problem:
        return {"why": str(problem)}
    return as_cell(score)


def as_cell(score: Score) -> dict[str, Any]:
    """A score as a cell of a table."""
    entry = {"value": score.value, "interval": score.interval, "note": score.note}
    return entry | ({"draws": [float(f"{draw:.6g}") for draw in score.draws]} if score.draws else {})


class Recordings(Protocol):
    """Recorded windows or clips."""

    @property
    def raw(self) -> Any:
        """The corpus, for the sound; None: no sound."""
        ...

    @property
    def truth(self) -> Sequence[Sample]:
        """The recordings; the condition of each is its number."""
        ...

    @property
    def apart(self) -> Array:
        """Numbers of recordings that do not overlap."""
        ...


def score_columns(
    columns: Sequence[str], samples: Sequence[Sample], takes: Sequence[Sample], excerpts: Recordings, tools: Tools
) -> Cells:
    """Scores of motion.

    Args:
        columns: metrics.
        samples: one of every window.
        takes: several of some windows, for metrics of variety.
        excerpts: the recordings.
        tools: the feature network.
    """
    apart = {str(k) for k in excerpts.apart}
    apart_samples = [sample for sample in samples if sample.condition in apart]
    apart_truth = [sample for sample in excerpts.truth if sample.condition in apart]
    cells: Cells = {}
    for metric in columns:
        if load_metric(metric).about.hears:
            if excerpts.raw is None:
                cells[metric] = {"why": "a store keeps no sound; --raw names the corpus that it was made from"}
            else:
                cells[metric] = cell(metric, apart_samples, apart_truth, tools)
        else:
            cells[metric] = cell(metric, takes if metric == "multimodality" else samples, excerpts.truth, tools)
    return cells


def generate_windows(player: PlayableRun, excerpts: Excerpts, *, seed: int, which: Array | None = None) -> Array:
    """(N, made, D) poses of a system for the windows, in the units of the store, with ``seed``; see `generate_rows`."""
    numbers, seed_frames = np.arange(len(excerpts)) if which is None else which, excerpts.protocol.given
    excerpts.check_context(*find_context(player, seed_frames))
    everyone = excerpts.speakers()
    speakers = [everyone[k] for k in numbers]
    return generate_rows(
        player, excerpts.inputs, excerpts.starts[numbers], excerpts.protocol.made, speakers, seed_frames=seed_frames, seed=seed
    )


def score(
    columns: Sequence[str], player: PlayableRun, excerpts: Excerpts, tools: Tools, *, seed: int, threads: int = 0
) -> Cells:
    """Scores of a trained system: one performance of every window, and `TAKES` of `SPEECHES` windows."""
    from ..playing import threads as limited

    with limited(threads):
        samples = excerpts.samples(generate_windows(player, excerpts, seed=seed * TAKES))
        takes: list[Sample] = []
        if "multimodality" in columns:
            some = np.unique(np.linspace(0, len(excerpts) - 1, min(SPEECHES, len(excerpts))).round().astype(int))
            for take in range(TAKES):
                poses = generate_windows(player, excerpts, seed=seed * TAKES + take, which=some)
                takes += excerpts.samples(poses, some, take + 1)
        return score_columns(columns, samples, takes, excerpts, tools)


# latents ------------------------------------------------------------------------------------------------------------------


def latents(player: PlayableRun, excerpts: Excerpts) -> Array:
    """(N, D) latents of windows that do not overlap, each the mean over the generated frames (authors' code, 30 frames)."""
    from ..playing import codes

    before, after = player.context
    pose = player.pose(excerpts.rows("pose", before, after)[excerpts.apart])
    audio = player.audio(excerpts.rows("audio", before, after)[excerpts.apart])
    return np.asarray(codes(player.net, pose, audio).mean(1), np.float64)


def controls_of_latents(excerpts: Excerpts) -> Mapping[str, Array]:
    """Controls for the latents of a model: the mean poses themselves, and random numbers."""
    mean, std = excerpts.store.statistics("pose")
    poses = excerpts.rows("pose", 0, 0)[excerpts.apart].mean(1)
    noise = np.random.default_rng(0).normal(size=(len(poses), poses.shape[1]))
    return {"mean pose, no model": (poses - mean) / np.maximum(std, 1e-3), "white noise": noise}


def score_latents(columns: Sequence[str], points: Array, excerpts: Excerpts, name: str) -> Cells:
    """Scores of clusters: with speakers as labels; and as published, on a t-SNE picture with labels of k-means.

    Args:
        columns: metrics of `cospeech.metrics.clustering`.
        points: (N, D).
        excerpts: the windows.
        name: of the latents.
    """
    points_of, speakers = dict(zip(map(str, excerpts.apart), points, strict=True)), excerpts.speakers()
    net = FeatureNet(name, lambda windows: windows[:, 0], 1, 1, lambda sample: points_of[sample.name][None])
    still = np.zeros((1, 2, 3))
    samples = [Sample(str(k), excerpts.store.fps, positions=still, label=speakers[k]) for k in excerpts.apart]
    return {metric: cell(metric, samples, (), Tools(features=net, embedding=tsne)) for metric in columns}
