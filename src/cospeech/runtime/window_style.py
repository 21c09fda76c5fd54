"""Styles of systems that play windows: what they know of their speakers, and of an example through their style encoder."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..errors import InputError
from ..motion.motion import Motion
from ..motion.rotations import Array
from .style_measures import StyleEmbedding, StyleMixture, average_parts, standardise_example, stretches
from .window_bundle import WindowSystem
from .window_engine import STYLE_FRAMES

__all__ = ["embed_window_speaker", "example_window", "list_shares", "mixture", "plays_mixtures"]

LEAST_SHOWN = 0.005  # ours: shares of a mixture below are not reported
DIGITS = 3


def plays_mixtures(system: WindowSystem) -> bool:
    """Whether a style is to it a mixture of its speakers, by their weights (Mix-StAGE), and not a code of another kind."""
    codes = system.statistics.codes
    return bool(codes.shape[0] == codes.shape[1] and (codes == np.eye(len(codes))).all())


def embed_window_speaker(system: WindowSystem, name: str) -> StyleEmbedding:
    """One of a system's speakers."""
    s, k = system.statistics, system.styles.index(name)
    return StyleEmbedding(s.codes[k], s.speaker_mean[k], _beginnings(system), s.style_gain[k], model_mean=s.model_mean[k])


def example_window(system: WindowSystem, motion: Motion, name: str = "the example") -> StyleEmbedding:
    """What a motion shows of somebody's style: the mean of what the style encoder makes of stretches that overlap by half.

    Mix-StAGE knows styles as its speakers' weights; to it an example is the nearest mixture of them, and has its mean pose.
    Another network's code is free, and goes with the example's own mean pose.

    Args:
        system: who looks at it.
        motion: of any skeleton that is recognised; of one longer than two minutes, twelve pieces are seen.
        name: for messages.

    Raises:
        InputError: the system has no style encoder, the motion is too short for it, or its skeleton is not
            recognised.
    """
    s = system.statistics
    if not system.engine.recognises:
        raise InputError(f"this system cannot see a style in {name}", f"it has {', '.join(system.styles)}, and their mixtures")
    shown = standardise_example(system, motion, STYLE_FRAMES / system.fps, name)
    frames = min(len(poses) for poses in shown)
    if frames < STYLE_FRAMES:
        hint = f"an example of style has {STYLE_FRAMES} of them at least, {STYLE_FRAMES / system.fps:.2f} s"
        raise InputError(f"{name} has {frames} frames at {system.fps:g} a second", hint)
    shown = tuple(np.clip(poses, s.pose_low, s.pose_high) for poses in shown)
    found = [system.engine.style_of(stretch) for poses in shown for stretch in stretches(poses, STYLE_FRAMES)]
    code, centre = np.mean([each for each in found if each is not None], 0), np.concatenate(shown).mean(0)
    shares = np.full(len(s.codes), 1 / len(s.codes))
    if plays_mixtures(system):
        code = shares = _shares(code)
        centre = code @ s.speaker_mean
    gain, made = ((shares @ each).astype(np.float32) for each in (s.style_gain, s.model_mean))
    return StyleEmbedding(code.astype(np.float32), centre.astype(np.float32), _beginnings(system), gain, shown, made)


def mixture(system: WindowSystem, blend: StyleMixture) -> dict[str, float] | None:
    """Speaker → weight, the heaviest first; None for a speaker by name, and for a system whose styles are no mixtures."""
    by_name = len(blend) == 1 and not blend[0][1].poses
    if by_name or not plays_mixtures(system):
        return None
    shares = average_parts((share, embedding.code) for share, embedding in blend)
    return list_shares(dict(zip(system.styles, shares.tolist(), strict=True)))


def list_shares(shares: Mapping[str, float]) -> dict[str, float]:
    """As reports have them: the heaviest first, rounded, without those next to nothing."""
    order = sorted(shares.items(), key=lambda part: (-part[1], part[0]))
    return {name: round(share, DIGITS) for name, share in order if share >= LEAST_SHOWN}


def _shares(code: Array) -> Array:
    """Weights ≥ 0 that sum to 1, whatever an encoder gives."""
    positive = np.clip(np.nan_to_num(np.asarray(code, float)), 0, 1)
    total = positive.sum()
    return positive / total if total > 0 else np.full(len(positive), 1 / len(positive))


def _beginnings(system: WindowSystem) -> Array:
    """Windows have no past."""
    return np.zeros((0, 0, system.engine.sizes.pose), np.float32)
