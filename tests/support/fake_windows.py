"""A network of windows in a few lines of NumPy, with all that matters to whoever plays one; nothing is learnt."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np

from cospeech.audio.features.reduce import audio_width
from cospeech.motion.poses import find_pose
from cospeech.runtime.window_bundle import WindowStatistics, WindowSystem
from cospeech.runtime.window_engine import WindowSizes

NAMES = ("ada", "ben", "cleo")


class FakeEngine:
    """A linear filter over 2 · ``near`` + 1 frames, a mean over each ``multiple`` of frames, a gain and an offset by the style,
    an offset by softmax(mode_noise); frames beyond the window are zeros, as a convolution has them.

    Args:
        sizes: of the network; its reach is ``near`` + ``multiple`` − 1.
        recognises: whether there is a style encoder: that of the frame's mean pose, as a softmax.
    """

    def __init__(self, sizes: WindowSizes, *, recognises: bool = True) -> None:
        rng = np.random.default_rng(0)
        self.sizes, self.recognises = sizes, recognises
        self.near = 0 if sizes.reach is None else sizes.reach + 1 - sizes.multiple
        assert self.near >= 0
        self.taps = rng.normal(0, 0.1, (2 * self.near + 1, sizes.audio, sizes.pose))
        self.pooled = rng.normal(0, 0.1, (sizes.audio, sizes.pose))
        self.style_gain, self.offsets = rng.uniform(0.2, 1.5, sizes.styles), rng.normal(0, 0.5, (sizes.styles, sizes.pose))
        self.modes = rng.normal(0, 0.5, (sizes.modes, sizes.pose))
        self.seen = rng.normal(0, 1, (sizes.pose, sizes.styles))
        self.calls: list[tuple[int, int]] = []

    def make(self, rows, style, mode_noise):
        s, frames = self.sizes, len(rows)
        assert frames % s.multiple == 0
        assert style.shape == (len(style), frames, s.styles)
        assert mode_noise.shape == (len(style), frames, s.modes)
        self.calls.append((len(style), frames))
        padded = np.pad(rows.astype(float), ((self.near, self.near), (0, 0)))
        heard = sum(padded[k : k + frames] @ tap for k, tap in enumerate(self.taps))
        heard = heard + np.repeat(rows.reshape(-1, s.multiple, s.audio).mean(1), s.multiple, 0) @ self.pooled
        gain = 1 + style @ self.style_gain if s.styles else np.ones(style.shape[:2])
        out = heard * gain[..., None] + style @ self.offsets
        if s.modes:
            weights = np.exp(mode_noise - mode_noise.max(-1, keepdims=True))
            out = out + weights / weights.sum(-1, keepdims=True) @ self.modes
        return out.astype(np.float32)

    def style_of(self, poses):
        if not self.recognises:
            return None
        assert len(poses) >= 64
        logits = poses.mean(0) @ self.seen
        return (np.exp(logits - logits.max()) / np.exp(logits - logits.max()).sum()).astype(np.float32)


def fake_sizes(**changed: int | None) -> WindowSizes:
    return replace(WindowSizes(pose=3, audio=2, styles=3, modes=4, window=32, multiple=4, reach=9), **changed)


def fake_statistics(sizes: WindowSizes, codes: np.ndarray) -> WindowStatistics:
    """Poses near the rest pose, moving by tenths; what silence sounds like lies within the audio's range."""
    rng = np.random.default_rng(1)
    d, a = sizes.pose, sizes.audio
    arrays = {
        "pose_mean": rng.normal(0, 0.05, d), "pose_std": rng.uniform(0.05, 0.15, d), "audio_mean": np.full(a, -4.0),
        "audio_std": np.full(a, 3.0), "pose_low": np.full(d, -3.0), "pose_high": np.full(d, 3.0), "audio_low": np.full(a, -4.0),
        "audio_high": np.full(a, 4.0), "speaker_mean": rng.normal(0, 0.3, (len(codes), d)), "codes": codes,
        "model_mean": np.zeros((len(codes), d)), "style_gain": rng.uniform(0.6, 1.6, (len(codes), d)),
    }  # fmt: skip
    return WindowStatistics(**{name: value.astype(np.float32) for name, value in arrays.items()})


def fake_system(
    sizes: WindowSizes | None = None,
    *,
    codes: np.ndarray | None = None,
    recognises: bool = True,
    pose: str = "expmap-humanoid",
    audio: str = "mel20-prosody",
    fps: float = 20.0,
) -> WindowSystem:
    """A system of three speakers, in the place of an opened bundle; the sizes are bare ones for a player alone.

    Args:
        codes: (3, styles) of the speakers; their weights where not given.
    """
    sizes = sizes or fake_sizes()
    engine = FakeEngine(sizes, recognises=recognises)
    statistics = fake_statistics(sizes, np.eye(len(NAMES)) if codes is None else codes)
    return WindowSystem(pose, fps, audio, 1, NAMES, "ada", "", engine, statistics)  # type: ignore[arg-type]


@cache
def whole_system(
    *, styles: str = "weights", recognises: bool = True, modes: int = 4, reach: int | None = 12, fps: float = 20.0
) -> WindowSystem:
    """As `fake_system`, of a size that can be performed.

    Args:
        styles: "weights" of the speakers, or a "code" of two numbers, or "none".
    """
    codes = {"weights": np.eye(3), "code": np.array([[1.0, 0], [0, 2], [-1, 1]]), "none": np.zeros((3, 0))}[styles]
    sizes = fake_sizes(
        pose=find_pose("expmap-humanoid").dimensions, audio=audio_width("mel20-prosody"), styles=codes.shape[1], modes=modes,
        window=64, reach=reach,
    )  # fmt: skip
    return fake_system(sizes, codes=codes, recognises=recognises, fps=fps)
