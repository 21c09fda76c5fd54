"""Measures a bundle's networks on its speakers' speech, and compares the motion with the speakers' own."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace

import numpy as np

from ...audio.emotions import EMOTIONS
from ...models.nn.objective import StepRandom
from ...models.nn.smooth_noise import smooth_noise
from ...motion.rotations import Array
from ...runtime.bundles.statistics import Statistics
from ...runtime.mode_noise import SECONDS
from ...runtime.network import Network
from ..train import Tell

__all__ = ["calibrate", "difference", "relative_error", "stretch_rows"]

GAINS = (0.5, 2.0)  # ours: a column that a network hardly moves is not magnified without limit
FASTER = (
    1.1  # ours: times the speaker's own speed, to which a column is magnified at most; a head that nods too fast is visible
)
APART, NOISE_GAINS = 0.7, (1.0, 2.0)
"""Target distance of takes, in standard deviations within a window, and limits of the factor of the noise that gives it; ours:
independent takes would lie √2 apart. With more than twice the noise of its training, a network follows the speech less: the
beat lift of one was .143 at 1, .144 at 2 and .100 at 3.8 (8 minutes of speech that no training had)."""
DIGITS = 6  # of the measured error


def stretch_rows(statistics: Statistics, examples: Mapping[str, Array], columns: int) -> Array:
    """(S, n, F, R) rows of the speakers' speech as a network takes them: style controls at their means, words as said.

    Args:
        statistics: of the bundle.
        examples: of the run folder.
        columns: of style controls.
    """
    speech = examples["speech"]
    rows = [speech, np.zeros((*speech.shape[:3], columns), np.float32)]
    if statistics.words.size:
        ids = examples["texts"].astype(int)
        rows.append(statistics.words[ids].sum(-2) / np.maximum((ids > 0).sum(-1, keepdims=True), 1))
    return np.concatenate(rows, -1).astype(np.float32)


def calibrate(
    networks: Mapping[str, Network], statistics: Statistics, examples: Mapping[str, Array], fps: float, *, columns: int,
    measures_noise: bool, progress: Tell | None = None,
) -> Statistics:  # fmt: skip
    """Statistics with the mean poses of each network in each style, and the gains by which its poses are multiplied.

    Args:
        networks: those that play.
        statistics: without these.
        examples: of the run folder.
        fps: of the poses.
        columns: number of style controls.
        measures_noise: whether noise gets a gain with which takes lie `APART`.
        progress: is told how many windows are played, of how many by this network.
    """
    results, gains = dict[str, Array](), np.ones(2, np.float32)
    for name, prefix, place in (("make", "", 0), ("live", "live_", 1)):
        if name not in networks:
            continue
        playback = _Playback(networks[name], statistics, examples, fps, columns, 1 + measures_noise, progress)
        if measures_noise and playback.noise.shape[-1]:
            gains[place:] = playback.find_noise_gain()
        results |= zip((f"{prefix}model_mean", f"{prefix}style_gain"), playback.compare(gains[place]), strict=True)
    return replace(statistics, noise_gain=gains, **results)


class _Playback:
    """Windows of all speakers' speech, played by a network in each style."""

    def __init__(
        self, network: Network, s: Statistics, examples: Mapping[str, Array], fps: float, columns: int, takes: int,
        progress: Tell | None,
    ) -> None:  # fmt: skip
        signature, stretches = network.signature, examples["stretches"]
        frames = stretches.shape[2]
        if signature.window is not None:
            frames = min(signature.probe, frames // signature.multiple * signature.multiple)
        self.network, self.codes = network, s.style_codes
        self.rows = _cut(stretch_rows(s, examples, columns), frames).reshape(-1, frames, signature.width("rows"))
        self.own = _cut(stretches, frames)
        emotions = examples.get("emotions", np.zeros((*stretches.shape[:3], 1)))
        labels = _cut(emotions, frames)[..., 0].reshape(-1, frames).astype(int).clip(0)
        has = signature.width("style") - self.codes.shape[1]
        self.moods = np.eye(len(EMOTIONS), dtype=np.float32)[labels][..., :has]
        width, count = signature.width("noise"), len(self.rows)
        noise = (
            smooth_noise(StepRandom(0, 0), takes * count, width, frames, SECONDS * fps, normal=signature.normal_noise)
            if width
            else np.zeros(0)
        )
        self.noise = np.asarray(noise).reshape(takes, count, width, frames).swapaxes(2, 3) if width else np.zeros((1, 1, 1, 0))
        self.position, self.progress = 0, progress
        self.plays = count * (1 if len(self.noise) == 1 else 3)  # `compare` plays each window once, `find_noise_gain` twice

    def find_noise_gain(self) -> float:
        """The factor of the noise with which two takes differ by `APART` times the movement of one; the difference grows
        nearly in proportion to the noise."""
        take, other = (np.stack([*self.play_styles(self.codes[:1], noise)]) for noise in self.noise)
        apart, spread = np.sqrt(np.square(take - other).mean()), np.sqrt(take.var(2, ddof=1).mean())
        return float(np.clip(APART * spread / max(apart, 1e-6), *NOISE_GAINS))

    def compare(self, gain: float) -> tuple[Array, Array]:
        """(S, D) mean of the network's poses in each style; and their gain: the standard deviation within a window of the
        speaker's own poses over that of the network's. No column becomes faster than `FASTER` times the speaker's."""
        poses = np.stack([*self.play_styles(self.codes, gain * self.noise[0])])  # (n, S, T, D)
        own_spread, spread = np.sqrt(self.own.var(2, ddof=1).mean(1)), np.sqrt(poses.var(2, ddof=1).mean(0))
        fast, faster = (np.sqrt(np.square(np.diff(x, axis=2)).mean((k, 2))) for k, x in ((1, self.own), (0, poses)))
        ratio = np.minimum(own_spread / np.maximum(spread, 1e-6), FASTER * fast / np.maximum(faster, 1e-6))
        return poses.mean((0, 2)).astype(np.float32), np.clip(ratio, *GAINS).astype(np.float32)

    def play_styles(self, codes: Array, noise: Array) -> Iterator[Array]:
        """(S, T, D) for each window: one take in each of these styles (S, C)."""
        for k, rows in enumerate(self.rows):
            style = [np.broadcast_to(codes[:, None], (len(codes), len(rows), codes.shape[1]))]
            style.append(np.broadcast_to(self.moods[k], (len(codes), *self.moods[k].shape)))
            each = np.broadcast_to(noise[k % len(noise)], (len(codes), len(rows), noise.shape[-1]))
            yield play(self.network, rows, np.concatenate(style, -1), each)
            self.position += 1
            if self.progress is not None:
                self.progress(self.position, self.plays, "measuring how it moves")


def play(network: Network, rows: Array, style: Array, noise: Array) -> Array:
    """(N, T, D) poses for rows (T, R) of speech, styles (N, T, C) and noise (N, T, Z), by windows or frame by frame."""
    ports = {"style": style, "noise": noise}
    ports = {name: x for name, x in ports.items() if name in network.signature.inputs}
    shape = len(style), len(rows), network.signature.width("poses")
    if network.signature.window is not None:
        return np.broadcast_to(network.run(rows=rows[None], **ports)["poses"], shape)
    state, frames = network.begin(len(style)), []
    for k, row in enumerate(rows):
        outputs = network.run(rows=row[None], **{name: x[:, k] for name, x in ports.items()}, **state)
        state = {name: outputs[f"next.{name}"] for name in state}
        frames.append(np.broadcast_to(outputs["poses"], (shape[0], shape[2])))
    return np.stack(frames, 1)


def relative_error(exact: Network, other: Network, rows: Array, styles: Array) -> float:
    """Relative error of one network's poses: RMS of the difference over RMS of the exact poses.

    Args:
        exact, other: of one signature.
        rows: (S, F, R) of speech.
        styles: (S, C) of the speakers; columns that they lack are emotions, and set to neutral.
    """
    signature, pairs = exact.signature, []
    frames = rows.shape[1] // signature.multiple * signature.multiple
    frames = signature.probe if signature.multiple == signature.window else frames  # it makes whole windows alone
    for speech, code in zip(rows[:, :frames], styles, strict=True):
        style = np.zeros((1, frames, signature.width("style")), np.float32)
        style[..., : len(code)] = code
        style[..., len(code) : len(code) + 1] = 1  # the first emotion is the neutral one
        noise = np.zeros((1, frames, signature.width("noise")), np.float32)
        pairs.append([play(network, speech, style, noise) for network in (exact, other)])
    return difference(pairs)


def difference(pairs: Iterable[Iterable[Array]]) -> float:
    """RMS of how far the second of each pair of arrays is from the first, over the RMS of the first."""
    error = size = 0.0
    for right, nearly in pairs:
        error, size = error + float(np.square(nearly - right).sum()), size + float(np.square(right).sum())
    return round((error / max(size, 1e-12)) ** 0.5, DIGITS)


def _cut(x: Array, frames: int) -> Array:
    """(S, n, F, C) → (S, n · (F // frames), frames, C)."""
    pieces = x.shape[2] // frames
    return x[:, :, : pieces * frames].reshape(len(x), -1, frames, x.shape[3])
