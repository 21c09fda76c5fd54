"""Linear discriminants tell classes apart that differ in one direction, whatever else varies; they learn no random labels."""

from __future__ import annotations

import numpy as np

from cospeech.experiments.discriminants import LinearDiscriminants


def rows_of(rng, labels):
    """Two features whose difference tells the class; each alone varies as much again."""
    common = rng.normal(size=len(labels))
    rows = np.stack([common + labels, common - labels, rng.normal(size=len(labels))], 1)
    return rows + 0.1 * rng.normal(size=rows.shape)


def share_right(judge, rng, labels):
    rows = rows_of(rng, labels)
    return np.mean([judge.vote(row[None]).argmax() == label for row, label in zip(rows, labels, strict=True)])


def test_what_parts_the_classes_is_found():
    rng = np.random.default_rng(0)
    labels = rng.integers(3, size=600)
    by_labels = LinearDiscriminants(rows_of(rng, labels), labels, 3)
    assert share_right(by_labels, rng, rng.integers(3, size=200)) > 0.6
    by_lot = LinearDiscriminants(rows_of(rng, labels), rng.permutation(labels), 3)
    assert share_right(by_lot, rng, rng.integers(3, size=200)) < 0.5


def test_rows_of_one_class_vote_together():
    rng = np.random.default_rng(1)
    labels = rng.integers(3, size=600)
    judge = LinearDiscriminants(rows_of(rng, labels), labels, 3)
    for label in range(3):
        votes = judge.vote(rows_of(rng, np.full(50, label)))
        assert votes.argmax() == label
        assert np.exp(votes).sum() <= 1 + 1e-9  # a mean of logarithms lies below the logarithm of the mean
