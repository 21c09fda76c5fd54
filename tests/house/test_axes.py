"""The table of axes in the guide to Python: places and quaternions of a row belong together."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from cospeech.motion.rotations import quat_rotate

PAGE = Path(__file__).parents[2] / "docs" / "guides" / "python.md"
ROW = re.compile(r"^\| (right|left)-handed, (Y|Z) up[^|]*\| ([^|]*) \| ([^|]*) \|$", re.MULTILINE)


def numbers(cell: str, **values: float) -> np.ndarray:
    """The numbers that a cell such as ``100 z, −x`` stands for."""
    text = re.sub(r"(\d) ([xyzw])", r"\1 * \2", cell.replace("−", "-"))
    return np.array(eval(f"[{text}]", {}, values))


@pytest.mark.parametrize("row", ROW.findall(PAGE.read_text("utf-8")), ids=" ".join)
def test_a_converted_rotation_turns_converted_places(row):
    hand, up, place, quaternion = row
    rng = np.random.default_rng(0)
    turn, point = rng.normal(size=4), rng.normal(size=3)
    turn /= np.linalg.norm(turn)

    def carry(at: np.ndarray) -> np.ndarray:
        return numbers(place, **dict(zip("xyz", at, strict=True)))

    there = numbers(quaternion, **dict(zip("xyzw", turn, strict=True)))
    np.testing.assert_allclose(quat_rotate(there, carry(point)), carry(quat_rotate(turn, point)), atol=1e-6)
    axes = np.stack([carry(axis) for axis in np.eye(3)], 1)
    assert np.sign(np.linalg.det(axes)) == (1 if hand == "right" else -1)
    assert axes["XYZ".index(up), 1] > 0


def test_the_table_has_its_rows():
    assert len(ROW.findall(PAGE.read_text("utf-8"))) == 4
