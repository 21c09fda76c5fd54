"""A network of windows in a few lines of NumPy, with all that matters to whoever plays one; nothing is learnt."""

from __future__ import annotations

from functools import cache

import numpy as np

from cospeech.audio.features.reduce import audio_width
from cospeech.motion.poses import find_pose
from cospeech.runtime.bundles.signature import STYLE_FRAMES, Signature
from cospeech.runtime.bundles.statistics import Statistics
from cospeech.runtime.sliding_window_decoder import SlidingWindowDecoder
from cospeech.runtime.styles.space import style_space
from cospeech.runtime.styles.track import StyleTrack
from cospeech.runtime.system import System

NAMES = ("ada", "ben", "cleo")


class FakeNetwork:
    """A linear filter over 2 · ``near`` + 1 frames, a mean over each ``multiple`` of frames, a gain and an offset by the style,
    an offset by softmax(noise); frames beyond the window are zeros, as a convolution has them.

    Args:
        signature: of the network; its reach is ``near`` + ``multiple`` − 1.
    """

    def __init__(self, signature: Signature) -> None:
        rng = np.random.default_rng(0)
        self.signature = s = signature
        self.near = 0 if s.reach is None else s.reach + 1 - s.multiple
        assert self.near >= 0
        audio, pose, styles = s.width("rows"), s.width("poses"), s.width("style")
        self.taps = rng.normal(0, 0.1, (2 * self.near + 1, audio, pose))
        self.pool = rng.normal(0, 0.1, (audio, pose))
        self.style_gain, self.offsets = rng.uniform(0.2, 1.5, styles), rng.normal(0, 0.5, (styles, pose))
        self.modes = rng.normal(0, 0.5, (s.width("noise"), pose))
        self.calls: list[tuple[int, int]] = []

    def run(self, rows, style=None, noise=None):
        s, rows = self.signature, rows[0]
        frames = len(rows)
        assert frames % s.multiple == 0
        assert (style is None) == (not s.width("style"))
        assert (noise is None) == (not s.width("noise"))
        takes = max(1 if x is None else len(x) for x in (style, noise))
        self.calls.append((takes, frames))
        padded = np.pad(rows.astype(float), ((self.near, self.near), (0, 0)))
        poses = sum(padded[k : k + frames] @ tap for k, tap in enumerate(self.taps))
        poses = poses + np.repeat(rows.reshape(-1, s.multiple, rows.shape[1]).mean(1), s.multiple, 0) @ self.pool
        out = np.repeat(poses[None], takes, 0)
        if style is not None:
            assert style.shape == (takes, frames, s.width("style"))
            out = poses * (1 + style @ self.style_gain)[..., None] + style @ self.offsets
        if noise is not None:
            assert noise.shape == (takes, frames, s.width("noise"))
            weights = np.exp(noise - noise.max(-1, keepdims=True))
            out = out + weights / weights.sum(-1, keepdims=True) @ self.modes
        return {"poses": out.astype(np.float32)}

    def make(self, rows, style):
        """(T, A) rows of speech and (1, T, C) styles, no noise → (1, T, D)."""
        given = {"style": style} if style.shape[-1] else {}
        quiet = np.zeros((1, len(rows), self.signature.width("noise")))
        return self.run(rows[None], **given, **({"noise": quiet} if quiet.shape[-1] else {}))["poses"]


class FakeEncoder:
    """A style encoder: that of the frame's mean pose, as a softmax."""

    def __init__(self, pose: int, styles: int) -> None:
        self.signature = Signature({"poses": (1, "T", pose)}, {"style": (1, styles)}, window=STYLE_FRAMES)
        self.matrix = np.random.default_rng(1).normal(0, 1, (pose, styles))

    def run(self, poses):
        assert poses.shape[1] >= STYLE_FRAMES
        logits = poses[0].mean(0) @ self.matrix
        return {"style": (np.exp(logits - logits.max()) / np.exp(logits - logits.max()).sum())[None].astype(np.float32)}


def fake_sizes(
    pose: int = 3, audio: int = 2, styles: int = 3, modes: int = 4, window: int = 32, multiple: int = 4, reach: int | None = 9
) -> Signature:
    ports = {"rows": (1, "T", audio), "style": ("N", "T", styles), "noise": ("N", "T", modes)}
    ports = {name: port for name, port in ports.items() if port[-1]}
    takes = "N" if len(ports) > 1 else 1
    return Signature(ports, {"poses": (takes, "T", pose)}, window=window, multiple=multiple, reach=reach)


def fake_statistics(signature: Signature, codes: np.ndarray) -> Statistics:
    """Poses near the rest pose, moving by tenths; what silence sounds like lies within the audio's range."""
    rng = np.random.default_rng(1)
    d, a = signature.width("poses"), signature.width("rows")
    arrays = {
        "pose_mean": rng.normal(0, 0.05, d), "pose_std": rng.uniform(0.05, 0.15, d), "audio_mean": np.full(a, -4.0),
        "audio_std": np.full(a, 3.0), "pose_low": np.full(d, -3.0), "pose_high": np.full(d, 3.0), "audio_low": np.full(a, -4.0),
        "audio_high": np.full(a, 4.0), "speaker_mean": rng.normal(0, 0.3, (len(codes), d)), "style_codes": codes,
        "model_mean": np.zeros((len(codes), d)), "style_gain": rng.uniform(0.6, 1.6, (len(codes), d)),
    }  # fmt: skip
    statistics = Statistics(**{name: value.astype(np.float32) for name, value in arrays.items()})
    return statistics.complete(one_hot=False)


def fake_system(
    signature: Signature | None = None,
    *,
    codes: np.ndarray | None = None,
    recognises: bool = True,
    pose: str = "expmap-humanoid",
    audio: str = "mel20-prosody",
    fps: float = 20.0,
) -> System:
    """A system of three speakers, in the place of an opened bundle; the sizes are bare ones for a decoder alone.

    Args:
        codes: (3, styles) of the speakers; their weights where not given.
    """
    signature = signature or fake_sizes()
    codes = np.eye(len(NAMES)) if codes is None else codes
    one_hot = codes.shape[1] == len(codes) and (codes == np.eye(len(codes))).all()
    networks = {"make": FakeNetwork(signature)}
    if recognises and codes.shape[1]:
        networks["style"] = FakeEncoder(signature.width("poses"), codes.shape[1])
    return System(
        name="fake.cospeech", pose=pose, fps=fps, audio=audio, smooth=1, styles=NAMES, style="ada",
        style_space="one-hot" if one_hot else "code" if codes.shape[1] else "none", controls=(), vocabulary=None, card="",
        statistics=fake_statistics(signature, codes), networks=networks,  # type: ignore[arg-type]
    )  # fmt: skip


def decoder(system: System, setting, mixture, seeds, quiet, *, temperature: float = 1.0, intensity: float = 1.0):
    """A decoder of windows that begins with this mixture."""
    style = StyleTrack(system, style_space(system), mixture, seeds, temperature=temperature)
    options = {"temperature": temperature, "intensity": intensity}
    return SlidingWindowDecoder(system, system.main_network, style, seeds, quiet, setting, **options)


@cache
def whole_system(
    *, styles: str = "weights", recognises: bool = True, modes: int = 4, reach: int | None = 12, fps: float = 20.0
) -> System:
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
