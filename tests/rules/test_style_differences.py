"""Styles are told apart by how they move: in size, speed, place and handedness, and not only by their names."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from cospeech.audio.speech import Speech
from cospeech.cli.demo import EXAMPLE
from cospeech.corpora.attributes import attributes_of, body_of
from cospeech.motion.skeleton import humanoid
from cospeech.rules import STYLES, RuleBasedModel

pytestmark = pytest.mark.slow

TAKES = 5
COLUMNS = ("speed", "rate", "amplitude", "height", "right_share", "breadth", "trunk")


@cache
def speech() -> Speech:
    """The example twice, 38 s: one phrase is too short to show a style."""
    once = Speech.load(EXAMPLE)
    return Speech(np.concatenate([once.samples, once.samples]), once.rate)


def look(style: str, seed: int) -> list[float]:
    """The numbers of a take that a viewer notices: `COLUMNS`. They leave out sitting and turning, which would be too easy."""
    motion = RuleBasedModel().generate(speech(), style=style, seed=seed, emotion="neutral", parts=("body", "hands"))
    points, names = body_of(motion)
    attributes, index = attributes_of([points], names, motion.fps), humanoid().index
    wrists = points[:, [index["leftHand"], index["rightHand"]]] - points[:, [index["chest"]]]
    speed = np.linalg.norm(np.diff(wrists, axis=0), axis=-1).mean() * motion.fps
    trunk = np.linalg.norm(np.diff(points[:, index["chest"]] - points[:, index["hips"]], axis=0), axis=-1).mean() * motion.fps
    span = np.linalg.norm(wrists[:, 0] - wrists[:, 1], axis=-1).mean()
    return [
        float(speed),
        attributes.rate,
        attributes.amplitude,
        float(wrists[..., 1].mean()),
        attributes.right_share,
        float(span),
        float(trunk),
    ]


@cache
def looks() -> np.ndarray:
    """(styles, takes, columns)."""
    return np.array([[look(style, seed) for seed in range(TAKES)] for style in STYLES])


def mean(style: str, column: str) -> float:
    return float(looks()[list(STYLES).index(style), :, COLUMNS.index(column)].mean())


def test_a_take_is_nearest_to_the_takes_of_its_style():
    every = looks()
    columns = every / np.sqrt(every.var(1).mean(0))
    right = 0
    for k in range(len(columns)):
        for take in range(TAKES):
            means = columns.mean(1)
            means[k] = np.delete(columns[k], take, 0).mean(0)
            right += int(np.argmin(np.linalg.norm(means - columns[k, take], axis=1)) == k)
    assert right / (len(columns) * TAKES) > 0.5  # chance is a tenth


def test_quiet_styles_are_slower_and_rarer_than_vivid_ones():
    for quiet in ("reserved", "calm"):
        for vivid in ("lively", "orator", "storyteller"):
            assert mean(quiet, "speed") < 0.7 * mean(vivid, "speed"), (quiet, vivid)
            assert mean(quiet, "rate") < 0.7 * mean(vivid, "rate"), (quiet, vivid)
    assert mean("reserved", "amplitude") < 0.75 * mean("natural", "amplitude")
    assert mean("reserved", "speed") < 0.5 * mean("lively", "speed")
    assert mean("reserved", "rate") < 0.7 * mean("natural", "rate")


def test_each_has_a_place_and_a_hand_of_its_own():
    assert mean("lecturer", "height") > mean("restless", "height") + 0.03  # metres
    assert mean("restless", "amplitude") < 0.8 * mean("natural", "amplitude")
    assert mean("southpaw", "right_share") < 0.45 < mean("natural", "right_share")
