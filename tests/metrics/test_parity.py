"""Metrics as coded by the papers' authors: on arrays written here, each gives the value that the authors' functions gave.

The values were computed once with the authors' definitions (BEAT 2022 utils/metric.py with librosa 0.11 and SciPy; GFGE
cal_metrics.py; Mix-StAGE evaluation/metrics.py) on these very arrays.
"""

from __future__ import annotations

import numpy as np
import pytest

from cospeech.audio.speech import Speech
from cospeech.metrics import Sample, load_metric
from cospeech.metrics.onsets import backtrack, onset_frames, onset_strength, rms
from cospeech.motion.rotations import euler_to_quat

FPS, RATE, SECONDS = 15.0, 16000, 40


def bursts() -> np.ndarray:
    """Forty seconds of noise with 160 tones that decay."""
    rng, t = np.random.default_rng(7), np.arange(SECONDS * RATE) / RATE
    x, length = 0.002 * rng.standard_normal(len(t)), RATE // 5
    fall = np.hanning(length) ** 0.5 * np.exp(-np.arange(length) / (0.06 * RATE))
    for at in np.sort(rng.uniform(0, SECONDS - 1, 4 * SECONDS)):
        start = int(at * RATE)
        tone = np.sin(2 * np.pi * rng.uniform(150, 1200) * np.arange(length) / RATE)
        x[start : start + length] += fall * tone * rng.uniform(0.05, 0.5)
    return np.float32(x)


def swings() -> np.ndarray:
    """(600, 3) degrees: three angles, each a sum of six slow waves."""
    rng, t = np.random.default_rng(8), np.arange(SECONDS * FPS) / FPS
    waves = [
        [a * np.sin(2 * np.pi * f * t + p) for a, f, p in zip(
            rng.uniform(2, 9, 6), rng.uniform(0.2, 2.5, 6), rng.uniform(0, 6.28, 6), strict=True
        )] for _ in range(3)
    ]  # fmt: skip
    return np.stack([np.sum(wave, axis=0) for wave in waves], 1)


def joints() -> np.ndarray:
    """(5100, 10, 3) metres: 150 windows of TED's ten joints, the root at 0."""
    rng, t = np.random.default_rng(3), np.arange(5100)[:, None, None] / FPS
    rest = rng.uniform(-0.4, 0.4, (1, 10, 3))
    x = rest + 0.1 * np.sin(2 * np.pi * rng.uniform(0.1, 1.5, (10, 3)) * t + rng.uniform(0, 6, (10, 3)))
    x[:, 0] = 0
    return x


def key_points(seed: int) -> np.ndarray:
    """(640, 52, 2) pixels: PATS' points about one pose, the neck at 0."""
    rng, t = np.random.default_rng(seed), np.arange(640)[:, None, None] / FPS
    rest = np.random.default_rng(99).uniform(-300, 300, (52, 2))
    sizes, rates, phases = rng.uniform(5, 60, (52, 2)), rng.uniform(0.1, 1.5, (52, 2)), rng.uniform(0, 6, (52, 2))
    x = rest + sizes * np.sin(2 * np.pi * rates * t + phases) + rng.normal(0, 8, (640, 52, 2))
    x[:, 0] = 0
    return x


def test_beat_align_of_beat_picks_peaks_at_22050_hz_and_goes_back_on_hann_weighted_rms():
    rotations = euler_to_quat(np.radians(swings())[:, None], "XYZ")
    sample = Sample("a", FPS, rotations=rotations, names=("RightHandRing2",), speech=Speech(bursts(), RATE))
    assert load_metric("beat_align_beat")([sample]).value == pytest.approx(0.9397408830441293, abs=1e-6)
    samples = bursts()[10 * RATE :]
    strength = onset_strength(samples, RATE)
    onsets = onset_frames(strength, 22050)
    assert (len(onsets), len(onset_frames(strength, RATE))) == (105, 148)
    assert onsets[:6].tolist() == [3, 6, 15, 32, 39, 43]
    assert backtrack(onsets, rms(samples, hann=True))[:6].tolist() == [0, 4, 14, 29, 37, 41]


def test_div_of_the_flow_paper_counts_the_root():
    clips = [Sample(str(k), FPS, positions=joints()[1700 * k : 1700 * (k + 1)]) for k in range(3)]
    assert load_metric("diversity_gfge")(clips).value == pytest.approx(72.10291980361134, rel=1e-9)


def test_fid_and_diversity_of_mix_stage_leave_neck_nose_and_eyes_out():
    real, generated = (Sample("a", FPS, points=key_points(seed)) for seed in (1, 2))
    assert load_metric("fid_poses")([generated], [real]).value == pytest.approx(89.70413302663363, rel=1e-6)
    assert load_metric("diversity_mix_stage")([generated], [real]).value == pytest.approx(20.94232984488065, rel=1e-9)
