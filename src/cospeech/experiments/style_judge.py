"""A judge that names the style of a motion. It sees neither mean pose nor amplitude, which bundling sets for each style.

Each number of a pose is standardised within each window by its own mean and deviation. Of six parts of the body, the judge
then sees:

* the shares of five frequency bands in the velocity;
* how the speeds of the parts correlate, and how the two arms mirror each other;
* how long a part rests, and how uneven its speed is;
* which arm moves more, as the ratio of the deviations of both arms. Bundling can change this ratio, because its gains scale
  each number of a pose; so it can be left out.

Linear discriminants with a shrunk covariance name the style. All windows of a motion vote, except for its first two seconds.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import partial
from itertools import pairwise

import numpy as np

from ..errors import InputError
from ..motion.motion import Motion
from ..motion.poses import find_pose
from ..motion.rotations import Array
from .discriminants import LinearDiscriminants

__all__ = ["FPS", "WARM", "StyleJudge", "WindowJudge", "describe_manner"]

FPS, WINDOW, STEP, WARM = 15, 8.0, 2.0, 2.0  # frames a second; s; [ours]: some phrases of speech
BANDS = (0.0, 0.3, 0.6, 1.2, 2.4, 7.5)  # Hz; [ours]: octaves about the rate of strokes
STILL = 1e-4  # rad; [ours]: a number that varies by less is still
_RESTING = 0.3  # of the mean speed; [ours]: a part that is slower is at rest
_ARM, _HAND = ("Shoulder", "UpperArm", "LowerArm"), ("Hand", "Grip")
_PARTS = {"trunk": ("hips", "spine", "chest", "upperChest"), "head": ("neck", "head")} | {
    f"{side} {part}": tuple(side + bone for bone in bones)
    for side in ("left", "right")
    for part, bones in (("arm", _ARM), ("hand", _HAND))
}


def describe_manner(window: Array, parts: Mapping[str, Array], *, arms: bool = True) -> Array:
    """The features of a window that the judge sees.

    Args:
        window: (F, D) poses.
        parts: part of the body → its columns. "left arm" and "right arm" are among them, with as many columns each.
        arms: whether the ratio of the arms' deviations is among the features.
    """
    spread = window.std(0)
    blind = np.where(spread > STILL, (window - window.mean(0)) / np.maximum(spread, STILL), 0.0)
    power = np.square(np.abs(np.fft.rfft(np.diff(blind, axis=0), axis=0)))
    hertz = np.fft.rfftfreq(len(window) - 1, 1 / FPS)
    bands = np.stack([power[(hertz >= low) & (hertz < high)].sum(0) for low, high in pairwise(BANDS)])
    features, speeds = list[Array](), list[Array]()
    for own in parts.values():
        shares = bands[:, own].sum(1)
        features.append(np.log(shares / max(shares.sum(), 1e-9) + 0.01))
        speed = np.sqrt(np.square(np.diff(blind[:, own], axis=0)).mean(1))
        speeds.append(speed)
        mean = max(float(speed.mean()), 1e-9)
        features.append(np.array([(speed < _RESTING * mean).mean(), np.log(speed.std() / mean + 0.05)]))
    together = np.corrcoef(np.stack(speeds) + 1e-9 * np.arange(len(speeds[0])))
    features.append(together[np.triu_indices(len(speeds), 1)])
    left, right = parts["left arm"], parts["right arm"]
    features.append((blind[:, left] * blind[:, right]).mean(0))
    if arms:
        features.append(np.log([(spread[left].mean() + 0.01) / (spread[right].mean() + 0.01)]))
    return np.concatenate(features)


class WindowJudge:
    """Names the style of poses, by features of windows.

    Args:
        performances: to learn from: the number of a style (from 0 on, without gaps), and (F, D) poses in it, 15 a second.
        describe: the features that it sees of (window · 15, D) poses, such as `describe_manner` of some parts.
        window: s.

    Raises:
        InputError: there are fewer than two styles, or a performance is too short.
    """

    def __init__(
        self, performances: Iterable[tuple[int, Array]], describe: Callable[[Array], Array], *, window: float = WINDOW
    ) -> None:
        self._describe, self._window = describe, window
        pairs = [(style, self._windows(poses)) for style, poses in performances]
        styles = {style for style, _ in pairs}
        if len(styles) < 2 or styles != {*range(len(styles))}:
            raise InputError(f"a judge of the styles {sorted(styles)}", "two at least, numbered from 0 on")
        labels = np.concatenate([[style] * len(own) for style, own in pairs])
        self._discriminants = LinearDiscriminants(np.concatenate([own for _, own in pairs]), labels, len(styles))

    def name(self, poses: Array) -> int:
        """The number of the style that (F, D) poses have.

        Raises:
            InputError: they are too short.
        """
        return int(self._discriminants.vote(self._windows(poses)).argmax())

    def _windows(self, poses: Array) -> Array:
        frames = round(self._window * FPS)
        if len(poses) < frames:
            raise InputError(f"poses of {len(poses) / FPS:.1f} s", f"a judge sees {self._window:g} s or more")
        starts = range(0, len(poses) - frames + 1, round(STEP * FPS))
        return np.stack([self._describe(poses[k : k + frames]) for k in starts])


class StyleJudge:
    """Names the style of a motion of our humanoid.

    Args:
        performances: to learn from: the number of a style (from 0 on, without gaps), and a motion in it.
        arms: of `describe_manner`.

    Raises:
        InputError: there are fewer than two styles, or a motion is too short.
    """

    def __init__(self, performances: Iterable[tuple[int, Motion]], *, arms: bool = True) -> None:
        self._pose = find_pose("expmap-humanoid")
        bones = np.array([name.split(".")[0] for name in self._pose.names])
        parts = {part: np.flatnonzero(np.isin(bones, own)) for part, own in _PARTS.items()}
        pose_pairs = ((style, self._encode(motion)) for style, motion in performances)
        self._judge = WindowJudge(pose_pairs, partial(describe_manner, parts=parts, arms=arms))

    def name(self, motion: Motion) -> int:
        """The number of the style that a motion has.

        Raises:
            InputError: it is too short.
        """
        return self._judge.name(self._encode(motion))

    def _encode(self, motion: Motion) -> Array:
        poses = self._pose.encode(motion.resample(FPS))[round(WARM * FPS) :]
        if len(poses) < round(WINDOW * FPS):
            raise InputError(f"a motion of {motion.duration:.1f} s", f"a judge sees {WARM + WINDOW:g} s or more")
        return poses
