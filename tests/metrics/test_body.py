"""Body statistics: constructed motions have the figures that they were made with."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cospeech.errors import InputError
from cospeech.metrics.body import BODY_TARGETS, body_statistics
from cospeech.metrics.movement import Track
from cospeech.motion.motion import Motion
from cospeech.motion.rotations import axis_angle_to_quat, quat_identity, quat_multiply
from cospeech.motion.skeleton import humanoid

FPS = 30.0
TIMES = np.arange(1800) / FPS
STILL = np.zeros((len(TIMES), 3))


def track(left: np.ndarray = STILL, right: np.ndarray = STILL, body: np.ndarray = STILL, **parts: np.ndarray) -> Track:
    """A body whose wrists move by ``left`` and ``right (T, 3)`` against hips that move by ``body (T, 3)``."""
    shoulders = np.array([[0.18, 1.4, 0.0], [-0.18, 1.4, 0.0]]) + body[:, None]
    wrists = np.array([[0.2, 1.1, 0.3], [-0.2, 1.1, 0.3]]) + body[:, None] + np.stack([left, right], 1)
    hips = np.array([0.0, 0.9, 0.0]) + body
    return Track(FPS, hips, shoulders, (wrists + shoulders) / 2 + [0.0, -0.05, -0.1], wrists, **parts)


def path(progress: np.ndarray, bulge: float = 0.0) -> np.ndarray:
    """(T, 3) to and fro over 0.4 m in 0.5 s, every 1.5 s; ``progress`` maps 0 … 1 to 0 … 1; off the chord by ``bulge`` m."""
    phase = np.clip((TIMES % 1.5) / 0.5, 0, 1)
    u = np.interp(phase, np.linspace(0, 1, len(progress)), progress)
    u = np.where((TIMES // 1.5) % 2 == 0, u, 1 - u)
    return np.stack([0.4 * u, 4 * bulge * u * (1 - u), 0 * u], -1)


def ease(peak: float = 0.5) -> np.ndarray:
    """Progress whose speed rises in a straight line to ``peak`` of the time, and falls in one."""
    u = np.linspace(0, 1, 200)
    speed = np.interp(u, [0, peak, 1], [0, 1, 0])
    return np.cumsum(speed) / speed.sum()


def test_a_straight_stroke_is_straight_and_an_arched_one_is_not():
    straight, arc = (body_statistics(track(path(ease(), bulge)))["stroke straightness"] for bulge in (0.0, 0.09))
    assert straight > 0.99
    chord, length = 0.4, np.linalg.norm(np.diff(path(ease(), 0.09)[:16], axis=0), axis=1).sum()
    assert arc == pytest.approx(chord / length, abs=0.02)


def test_strokes_of_one_ease_peak_at_one_place_and_others_do_not():
    one = body_statistics(track(path(ease())))["time to peak, SD over strokes"]
    two = body_statistics(track(path(ease(0.25)), path(ease(0.75))))["time to peak, SD over strokes"]
    assert one < 0.05  # a frame of fifteen is 0.07
    assert two > 0.1


def test_travel_height_and_speed_of_the_body():
    sway = np.stack([0.08 * np.sin(2 * np.pi * 0.2 * TIMES), 0.01 * np.sin(2 * np.pi * 0.3 * TIMES), 0 * TIMES], -1)
    rows = body_statistics(track(body=sway))
    assert rows["hip travel SD, cm"] == pytest.approx(8 / np.sqrt(2), rel=0.02)
    assert rows["hip height SD, cm"] == pytest.approx(1 / np.sqrt(2), rel=0.02)
    speed = np.linalg.norm(np.gradient(sway, axis=0), axis=-1) * FPS
    assert rows["mid-shoulder speed, mm/s"] == pytest.approx(1000 * np.median(speed), rel=0.03)


def test_turns_of_pelvis_and_clavicles_add_over_axes():
    a, b = (np.radians(size) * np.sin(2 * np.pi * rate * TIMES) for size, rate in ((8.0, 0.2), (6.0, 0.3)))
    turns = quat_multiply(axis_angle_to_quat([0.0, 1.0, 0.0], a), axis_angle_to_quat([0.0, 0.0, 1.0], b))
    rows = body_statistics(track(pelvis=turns, clavicles=np.stack([turns, quat_identity(len(TIMES))], 1)))
    assert rows["pelvis rotation SD, deg"] == pytest.approx(np.hypot(8, 6) / np.sqrt(2), rel=0.02)
    assert rows["clavicle rotation SD, deg"] == pytest.approx(np.hypot(8, 6) / np.sqrt(2) / 2, rel=0.02)


def test_spells_of_stillness_are_as_long_as_the_pauses():
    rows = body_statistics(track(path(ease()), path(ease())))
    assert rows["still spells 90 %, s"] == pytest.approx(1.1, abs=0.12)  # a second of rest, and slow beginnings and ends


def test_hands_that_mirror_each_other_and_hands_that_do_not():
    rng = np.random.default_rng(0)
    kernel = np.exp(-0.5 * (np.arange(-20, 21) / 8.0) ** 2)
    a, b = (0.02 * np.stack([np.convolve(x, kernel, "same") for x in rng.normal(size=(3, len(TIMES)))], -1) for _ in "ab")
    flip = np.array([-1.0, 1.0, 1.0])
    assert body_statistics(track(a, a * flip))["mirror correlation of the hands"] == pytest.approx(1, abs=0.01)
    assert body_statistics(track(a, a))["mirror correlation of the hands"] < 0.5
    assert abs(body_statistics(track(a, b))["mirror correlation of the hands"]) < 0.2


def test_a_trunk_that_goes_with_the_hands_correlates_and_a_still_one_does_not_count():
    moves = path(ease())
    body = 0.2 * moves
    with_them = body_statistics(track(moves, moves, body))["r of wrist and mid-shoulder speed"]
    against = body_statistics(track(moves, moves, np.roll(body, 22, axis=0)))["r of wrist and mid-shoulder speed"]
    assert with_them > 0.95
    assert against < 0.2
    assert np.isnan(body_statistics(track(moves, moves))["r of wrist and mid-shoulder speed"])


def test_every_row_of_a_whole_body_has_a_target():
    rng = np.random.default_rng(1)
    turns = np.cumsum(rng.normal(0, 0.01, (300, len(humanoid()))), 0)
    rotations = axis_angle_to_quat([0.3, 0.9, 0.2], turns)
    motion = Motion(FPS, rotations, np.tile(humanoid().offsets[0], (300, 1)))
    assert list(body_statistics(motion)) == list(BODY_TARGETS)
    assert all(low < high for low, high in BODY_TARGETS.values())
    assert not BODY_TARGETS["pelvis rotation SD, deg"].holds(np.nan)


def test_bad_input():
    for wrong in (replace(track(), fps=25.0), Motion(FPS, quat_identity(20, len(humanoid())), np.zeros((20, 3)))):
        with pytest.raises(InputError, match="frames"):
            body_statistics(wrong)


def test_a_real_speaker_and_the_printed_figures(shared_folder):
    """The take at hand has the figures of real people, and lies in all ranges but two."""
    take = np.load(shared_folder / "data/reference_motion/003_Neutral_2.npy", allow_pickle=False)[::2].astype(float)
    place = take[..., :3]
    real = Track(FPS, place[:, 0], place[:, [6, 3]], place[:, [7, 4]], place[:, [8, 5]], pelvis=take[:, 0, 3:])
    rows = body_statistics(real)
    assert rows["mid-shoulder speed, mm/s"] == pytest.approx(85, abs=2)
    assert rows["stroke straightness"] == pytest.approx(0.90, abs=0.02)
    assert rows["time to peak, SD over strokes"] == pytest.approx(0.118, abs=0.005)
    outside = [name for name, value in rows.items() if not BODY_TARGETS[name].holds(value)]
    assert set(outside) <= {"r of wrist and mid-shoulder speed", "mirror correlation of the hands"}
