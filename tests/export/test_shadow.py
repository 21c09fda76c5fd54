"""Shadows, against those that are known from geometry."""

from __future__ import annotations

import numpy as np
import pytest

from cospeech.export.render.shadow import measure_light

HALF, HIGH = 0.2, 0.3  # metres: half the side of the plate, and how high it is above the floor
UP = np.array([0, 1, 0])


def plate_above_floor(towards):
    """Vertices, normals and triangles: a floor of 1.6 m with a point every 5 cm, a square plate above it; the floor's x and z.

    The plate stands so that its shadow lies in the middle of the floor.
    """
    x, z = (axis.ravel() for axis in np.meshgrid(np.linspace(-0.8, 0.8, 33), np.linspace(-0.8, 0.8, 33), indexing="ij"))
    off = HIGH / towards[1] * towards
    plate = np.array([(-HALF, 0, -HALF), (-HALF, 0, HALF), (HALF, 0, HALF), (HALF, 0, -HALF)]) + off
    vertices = np.concatenate([np.stack([x, 0 * x, z], 1), plate]).astype(np.float32)
    corners = len(x) + np.array([(0, 1, 2), (0, 2, 3)]).T
    return vertices, np.tile(UP, (len(vertices), 1)).astype(np.float32), corners, x, z


@pytest.mark.parametrize("direction", [(0, 1, 0), (0.5, 1, 0.3), (-0.4, 1, 0.6)])
@pytest.mark.parametrize("blur", [0.0, 0.05])
def test_the_shadow_of_a_plate(direction, blur):
    towards = (np.array(direction) / np.linalg.norm(direction)).astype(np.float32)
    vertices, normals, corners, x, z = plate_above_floor(towards)
    lit = measure_light(vertices, normals, corners, towards, blur)[: len(x)]
    edge = np.maximum(np.abs(x), np.abs(z)) - HALF  # metres from the border of the shadow, < 0 inside
    soft = 0.03 + 1.3 * blur  # two cells, and what is looked at beside the point, farther on the floor than across the light
    assert np.all(lit[edge < -soft] == 0)
    assert np.all(lit[edge > soft] == 1)
    assert np.count_nonzero(edge < -soft) > 9
    if blur:
        border = (np.abs(edge) < 1e-6) & (np.minimum(np.abs(x), np.abs(z)) < 0.11)
        assert lit[border].mean() == pytest.approx(0.5, abs=0.1)


def test_only_what_is_asked_for_is_measured():
    vertices, normals, corners, x, _ = plate_above_floor(UP)
    mask = np.arange(len(vertices)) % 3 == 0
    every = measure_light(vertices, normals, corners, UP.astype(np.float32), 0.05)
    some = measure_light(vertices, normals, corners, UP.astype(np.float32), 0.05, mask)
    assert np.array_equal(some, np.where(mask, every, 0))
    assert 0 < np.count_nonzero(every[: len(x)] < 1) < len(x) / 2
