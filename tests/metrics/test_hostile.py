"""Metrics on what is hardly motion at all: an `InputError` or a score, never another exception, warning or hang."""

from __future__ import annotations

import numpy as np
import pytest

from cospeech.audio.speech import Speech
from cospeech.errors import InputError
from cospeech.metrics import METRICS, FeatureNet, Sample, Score, Tools, Track, load_metric

pytestmark = pytest.mark.slow

FPS = 15.0
NET = FeatureNet("means", lambda w: np.concatenate([w.mean(1), w.std(1)], 1)[:, :5], 10, 5)
TOOLS = Tools(
    features=NET,
    classifier=FeatureNet("halves", lambda w: np.full((len(w), 2), 0.5), 10, 5),
    embedding=lambda x: np.pad(x, ((0, 0), (0, 2)))[:, :2],
    centres=np.random.default_rng(0).normal(size=(8, 240)),
)


def sample(name: str, frames: int, joints: int, fill: str, seed: int = 0, sound: str = "noise") -> Sample:
    rng = np.random.default_rng(seed)
    make = {
        "zeros": lambda *shape: np.zeros(shape),
        "noise": lambda *shape: rng.normal(size=shape),
        "huge": lambda *shape: rng.normal(size=shape) * 1e12,
        "tiny": lambda *shape: rng.normal(size=shape) * 1e-200,
    }[fill]
    rotations = rng.normal(size=(frames, joints, 4))
    speech = {"noise": rng.normal(size=int(frames / FPS * 8000)) * 0.1, "silence": np.zeros(int(frames / FPS * 8000))}[sound]
    parts = {part: make(2 * frames, 2, 3) for part in ("shoulders", "elbows", "wrists")}
    return Sample(
        name,
        FPS,
        positions=make(frames, joints, 3),
        points=make(frames, 52, 2),
        rotations=rotations / np.linalg.norm(rotations, axis=-1, keepdims=True),
        face=make(frames, 52),
        track=Track(30.0, make(2 * frames, 3), **parts),
        speech=Speech(speech.astype(np.float32), 8000),
        semantics=rng.choice([0.0, 1.0], frames),
        label="ab"[seed % 2],
    )


CASES = {
    "no frame": lambda: [sample("a", 0, 3, "noise")],
    "one frame": lambda: [sample("a", 1, 3, "noise"), sample("b", 1, 3, "noise", 1)],
    "nine frames": lambda: [sample("a", 9, 3, "noise"), sample("b", 9, 3, "noise", 1)],
    "one joint": lambda: [sample("a", 60, 1, "noise"), sample("b", 60, 1, "noise", 1)],
    "no joint": lambda: [sample("a", 60, 0, "noise")],
    "all zero": lambda: [sample("a", 240, 3, "zeros"), sample("b", 240, 3, "zeros", 1)],
    "silence": lambda: [sample("a", 240, 3, "noise", sound="silence"), sample("b", 240, 3, "noise", 1, "silence")],
    "huge": lambda: [sample("a", 240, 3, "huge"), sample("b", 240, 3, "huge", 1)],
    "tiny": lambda: [sample("a", 240, 3, "tiny"), sample("b", 240, 3, "tiny", 1)],
    "one clip": lambda: [sample("a", 240, 3, "noise")],
    "all given": lambda: [Sample("a", FPS, positions=np.zeros((9, 3, 3)), rotations=np.ones((9, 3, 4)) / 2,
                                 semantics=np.ones(9), seed_frames=50)],
}  # fmt: skip


@pytest.mark.parametrize("case", CASES)
def test_a_score_or_an_input_error(case):
    samples, scores, problems = CASES[case](), {}, []
    for name in METRICS:
        try:
            scores[name] = load_metric(name)(samples, samples, TOOLS)
        except InputError as problem:
            problems.append(str(problem))
    assert not [p for p in problems if "\n" in p]
    assert all(isinstance(score, Score) and np.isfinite(score.value) for score in scores.values())
    assert all(score.interval is None or np.isfinite(score.interval).all() for score in scores.values())
    assert len(scores) > 10 or case in ("no frame", "one frame", "no joint", "nine frames", "one joint", "all given")
