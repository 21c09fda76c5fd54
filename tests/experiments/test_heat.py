"""Heat maps: arms leave ink where they move and as much as they move, the right one red, the left one blue."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from cospeech.errors import InputError
from cospeech.experiments.figures.heat import FIGURES, Figure, draw_heat, frame_of, heat
from cospeech.motion.skeletons import pats, ted

FPS = 15.0
BODY = Figure(8, 0, 1, (2, 3, 4), (5, 6, 7))
REST = np.array(
    [[0, 0], [0, 0.8], [-0.5, 0], [-0.7, -0.8], [-0.5, -1.5], [0.5, 0], [0.7, -0.8], [0.5, -1.5]], float
)  # neck, head, right shoulder, elbow, wrist, left …; shoulders 1 apart


def waving(side: str = "right", size: float = 0.4, frames: int = 90) -> np.ndarray:
    """(T, 8, 2) of which one wrist goes up and down, a period in 30 frames."""
    body = np.repeat(REST[None], frames, 0)
    wrist = {"right": 4, "left": 7}[side]
    body[:, wrist, 1] += size * np.sin(np.arange(frames) * 2 * np.pi / 30)
    return body


def mirror(body: np.ndarray) -> np.ndarray:
    return (body * [-1, 1])[:, [0, 1, 5, 6, 7, 2, 3, 4]]


def test_ink_in_all_is_the_mean_square_of_the_speed_of_the_arm():
    body = waving()
    frame = frame_of([[body]], BODY)
    right, left = heat([body], BODY, frame, FPS)
    wrist = np.square(np.diff(body[:, 4, 1]) * FPS).mean()
    along = np.linspace(0, 1, 9)  # the elbow stands still, what lies between moves in proportion
    assert right.sum() / frame.scale**2 == pytest.approx(wrist * np.square(along).mean(), rel=0.01)
    assert not left.any()


def test_trembling_leaves_less_than_a_stroke_of_the_same_way():
    wide, small = waving(size=0.4), np.repeat(REST[None], 90, 0)
    small[:, 4, 1] += 0.01 * (-1) ** np.arange(90)
    frame = frame_of([[wide], [small]], BODY)
    ratio = np.abs(np.diff(wide[:, 4, 1])).sum() / np.abs(np.diff(small[:, 4, 1])).sum()
    inks = [heat([body], BODY, frame, FPS).sum() for body in (wide, small)]
    assert inks[0] > 1.1 * ratio * inks[1]


@pytest.mark.parametrize("fps", [7.5, 30.0])
def test_the_same_movement_at_another_rate_leaves_the_same_ink(fps):
    times = np.arange(round(6 * fps)) / fps
    body = np.repeat(REST[None], len(times), 0)
    body[:, 4, 1] += 0.4 * np.sin(2 * np.pi * times / 3)
    frame = frame_of([[body]], BODY)
    steps = np.arange(6 * 120) / 120
    fine = np.repeat(REST[None], len(steps), 0)
    fine[:, 4, 1] += 0.4 * np.sin(2 * np.pi * steps / 3)
    ink, expected = heat([body], BODY, frame, fps)[0], heat([fine], BODY, frame, 120)[0]
    assert np.abs(ink - expected).sum() < 0.05 * expected.sum()


def test_neither_place_nor_size_of_the_person_matters():
    body = waving()
    frame, far = frame_of([[body]], BODY), body * 167 + np.array([640, -300])
    other = frame_of([[far]], BODY)
    assert other.size == frame.size
    np.testing.assert_allclose(heat([far], BODY, other, FPS), heat([body], BODY, frame, FPS), atol=1e-6)


def test_in_the_mirror_right_becomes_left():
    body = waving() + np.array([0.03, 0])
    frame = frame_of([[body], [mirror(body)]], BODY)
    right, left = heat([body], BODY, frame, FPS)
    also_right, also_left = heat([mirror(body)], BODY, frame, FPS)
    assert not left.any()
    assert not also_right.any()
    assert right.sum() == pytest.approx(also_left.sum())
    middle = frame.size[0] / 2
    assert right[:, : int(middle)].sum() > 0.99 * right.sum()  # seen from the front the right arm is to the left
    assert also_left[:, int(middle) :].sum() > 0.99 * also_left.sum()


def test_between_clips_nothing_moves():
    up, down = np.repeat(REST[None], 20, 0), np.repeat(REST[None], 20, 0)
    up[:, 4, 1] += 2
    frame = frame_of([[up, down]], BODY)
    assert not heat([up, down], BODY, frame, FPS).any()
    assert heat([np.concatenate([up, down])], BODY, frame, FPS)[0].sum() > 0
    body = waving()
    whole, halves = heat([body], BODY, frame, FPS), heat([body[:46], body[45:]], BODY, frame, FPS)
    np.testing.assert_allclose(halves, whole, atol=1e-9)


def test_depth_does_not_count():
    body = waving()
    deep = np.concatenate([body, np.zeros((*body.shape[:2], 1))], -1)
    deep[:, 4, 2] += np.sin(np.arange(len(body)))
    np.testing.assert_allclose(
        heat([deep], BODY, frame_of([[body]], BODY), FPS), heat([body], BODY, frame_of([[body]], BODY), FPS)
    )


def test_pictures_are_red_for_the_right_arm_and_blue_for_the_left():
    grid = [[[waving("right")], [waving("left")]], [[waving("right", 0.1)], [waving("left", 0.1)]]]
    picture = draw_heat(grid, BODY, FPS, columns=["a", "b"], rows=["much", "little"], title="two").astype(int)
    assert picture.ndim == 3
    assert picture.shape[2] == 3
    red, blue = picture[..., 0] - picture[..., 2] > 60, picture[..., 2] - picture[..., 0] > 60
    legend = picture.shape[0] - 56
    rows, columns = np.nonzero(red[:legend])
    others = np.nonzero(blue[:legend])[1]
    assert len(columns)
    assert len(others)
    assert columns.max() < others.min()
    half = (rows.min() + rows.max()) // 2
    assert red[:half].sum() > 1.5 * red[half:legend].sum()  # of one scale, so that much and little can be compared
    again = draw_heat(grid, BODY, FPS, columns=["a", "b"], rows=["much", "little"], title="two")
    np.testing.assert_array_equal(picture, again)


@pytest.mark.parametrize("layout", FIGURES)
def test_figures_name_the_arms_from_the_shoulder_on(layout):
    figure, table = FIGURES[layout], {"pats": pats, "ted": ted}[layout]
    assert figure.joints == len(table.JOINTS)
    for arm, prefix in ((figure.right, "r"), (figure.left, "l")):
        names = [table.JOINTS[k] for k in arm]
        assert all(name.lower().startswith(prefix) for name in names)
        assert [part in name for part, name in zip(("houlder", "lbow", "rist"), names, strict=False)] == [True] * 3
        assert all(table.PARENTS[b] == a for a, b in pairwise(arm[:3]))


@pytest.mark.parametrize(
    ("cells", "columns", "rows"),
    [([], [], []), ([[[waving()]]], ["a", "b"], ["r"]), ([[[waving()]]], ["a"], []), ([[[waving()[:1]]]], ["a"], ["r"]),
     ([[[waving()[:, :7]]]], ["a"], ["r"]), ([[[waving() * np.nan]]], ["a"], ["r"]), ([[[]]], ["a"], ["r"]), ([[]], [], ["r"])],
)  # fmt: skip
def test_what_cannot_be_drawn_is_refused(cells, columns, rows):
    with pytest.raises(InputError):
        draw_heat(cells, BODY, FPS, columns=columns, rows=rows)
