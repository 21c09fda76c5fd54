"""Derived speakers: further speakers, made of a corpus' own, for attributes of style (Ahuja et al. 2020, supplement A.2).

``"cleo|leftarm"`` is cleo gesturing with the left arm alone: the right one stands still at cleo's mean. ``"dan|mirror"`` is dan
with left and right exchanged. A derived speaker says what its original says, so their clips differ in one attribute only.

The mean is taken over the speaker's training clips, as the authors take it. A mean of each clip would differ from clip to clip
and reveal which one it is. PATS' transform of the same name holds the arm that it names; see
`cospeech.corpora.pats.read.hold_arm`. Here, as in the paper's table, the name says which arm is used.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from ..errors import InputError
from ..motion.motion import Motion
from ..motion.points import Points
from ..motion.rotations import Array, quat_continuous
from ..motion.skeleton import Skeleton
from ..motion.skeletons import pats, ted
from .augment import mirror_clip
from .clip import Clip

__all__ = ["DERIVATIONS", "MeanPose", "arm_joints", "derive_clip", "find_original", "hold_motion", "hold_points", "mean_poses"]

_SIDES = {
    "ted": {side: tuple(k for k, n in enumerate(ted.JOINTS) if n.startswith(side)) for side in ("left", "right")},
    "pats": {
        "left": tuple(k for k in pats.LEFT if k != pats.JOINTS.index("LEye")),  # the authors hold that eye, too
        "right": tuple(k for k in pats.RIGHT if k != pats.JOINTS.index("REye")),
    },
}
_NECK = {"ted": ted.JOINTS.index("neck"), "pats": pats.JOINTS.index("Neck")}
_HAND = re.compile(r"(?i)hand|wrist")
_LEFT = re.compile(r"left(?=[A-Z_.]|$)|Left|_l(?=_|$)")
_RIGHT = re.compile(r"right(?=[A-Z_.]|$)|Right|_r(?=_|$)")


@dataclass(frozen=True)
class MeanPose:
    """Where a speaker's joints are on average, by layout or names of the joints.

    Args:
        of: (J, 2 or 3) from the neck, as `hold_points` takes it, or (J, 4) local rotations.
    """

    of: Mapping[tuple[str, ...], Array]

    def like(self, layout: tuple[str, ...]) -> Array:
        """The mean for a layout of key points, or for joints of these names."""
        if layout not in self.of:
            raise InputError("the speaker's mean pose is of other joints", "clips of one speaker shall have one skeleton")
        return self.of[layout]


def derive_clip(clip: Clip, derivation: str, mean: MeanPose) -> Clip:
    """The clip of a derived speaker. Its name ends on ``|derived-…``; that of an augmented training clip ends on ``|mirror``.

    Raises:
        InputError: no such derived speaker (`DERIVATIONS`), or a body without arms.
    """
    return replace(
        DERIVATIONS[derivation](clip, mean), name=f"{clip.name}|derived-{derivation}", speaker=f"{clip.speaker}|{derivation}"
    )


def find_original(name: str) -> str:
    """The clip whose sound a clip has: itself, or the original of a derived speaker.

    >>> find_original("1000|derived-leftarm"), find_original("1000")
    ('1000', '1000')
    """
    return re.sub(r"\|derived-[a-z]+", "", name)


def _one_arm(clip: Clip, still: str, mean: MeanPose) -> Clip:
    return replace(
        clip,
        motion=None if clip.motion is None else hold_motion(clip.motion, still, mean.like(clip.motion.skeleton.names)),
        points=None if clip.points is None else hold_points(clip.points, still, mean.like((clip.points.layout,))),
    )


DERIVATIONS: dict[str, Callable[[Clip, MeanPose], Clip]] = {
    "leftarm": lambda clip, mean: _one_arm(clip, "right", mean),
    "rightarm": lambda clip, mean: _one_arm(clip, "left", mean),
    "mirror": lambda clip, mean: mirror_clip(clip),
}
"""Name → what makes a derived speaker: one arm alone, or left and right exchanged; ``prepare --derive-speaker`` takes these."""


def hold_points(points: Points, side: str, mean: Array) -> Points:
    """The arm of a side held at ``mean`` (J, 2 or 3) from the neck; PATS': in lengths of the frame's own right shoulder.

    Raises:
        InputError: key points of unknown layout.
    """
    neck, unit = _neck_and_unit(points)
    values, joints = points.values.copy(), list(_SIDES[points.layout][side])
    values[:, joints] = neck + unit * mean[joints]
    return replace(points, values=values)


def hold_motion(motion: Motion, side: str, mean: Array) -> Motion:
    """The arm of a side, from collar bone to finger tips, held at the rotations ``mean`` (J, 4)."""
    joints, rotations = list(arm_joints(motion.skeleton, side)), motion.rotations.copy()
    rotations[:, joints] = mean[joints]
    return replace(motion, rotations=quat_continuous(rotations))


def arm_joints(skeleton: Skeleton, side: str) -> tuple[int, ...]:
    """Indices of an arm: all below the highest joint of that side above a hand.

    Raises:
        InputError: no joint of that side is a hand.
    """
    pattern = _LEFT if side == "left" else _RIGHT
    hand = next((k for k, name in enumerate(skeleton.names) if _HAND.search(name) and pattern.search(name)), -1)
    if hand < 0:
        raise InputError(f"a skeleton without a {side} hand: {', '.join(skeleton.names[:6])}, …", "leave derived speakers out")
    while pattern.search(skeleton.names[skeleton.parents[hand]]):
        hand = skeleton.parents[hand]
    joints = {hand}
    for k, parent in enumerate(skeleton.parents):
        joints |= {k} if parent in joints else set()
    return tuple(sorted(joints))


def mean_poses(clips: Iterable[tuple[Clip, bool]]) -> dict[str, MeanPose]:
    """Speaker → mean pose, in one pass.

    Args:
        clips: each clip, and whether it counts. If no clip of a speaker counts, all of them do.
    """
    sums: dict[tuple[str, tuple[str, ...], bool], tuple[Array, int]] = {}
    for clip, counts in clips:
        for layout, array, frames in _sums(clip):
            for key in {(clip.speaker, layout, counts), (clip.speaker, layout, False)}:
                total, number = sums.get(key, (np.zeros(()), 0))
                sums[key] = total + array, number + frames
    means: dict[str, dict[tuple[str, ...], Array]] = {}
    for (speaker, layout, is_counted), (total, number) in sorted(sums.items(), key=lambda item: item[0][2]):
        if number or not is_counted:
            means.setdefault(speaker, {})[layout] = _mean(total, number)
    return {speaker: MeanPose(of) for speaker, of in means.items()}


def _sums(clip: Clip) -> list[tuple[tuple[str, ...], Array, int]]:
    """Layout, sum over the frames and their number: of key points, and of the outer products of rotations (J, 4, 4)."""
    sums: list[tuple[tuple[str, ...], Array, int]] = []
    if clip.points is not None:
        neck, unit = _neck_and_unit(clip.points)
        good = unit[:, 0, 0] > 1e-6  # a detection that failed
        values = (clip.points.values - neck)[good] / unit[good]
        sums.append(((clip.points.layout,), values.sum(0), int(good.sum())))
    if clip.motion is not None:
        q = np.asarray(clip.motion.rotations, np.float64)
        sums.append((clip.motion.skeleton.names, np.einsum("tja,tjb->jab", q, q), len(q)))
    return sums


def _mean(total: Array, number: int) -> Array:
    """The mean of key points; of rotations the mean quaternion of Markley et al. 2007, which does not depend on their signs."""
    if total.ndim == 3:
        return np.linalg.eigh(total)[1][..., -1]
    return total / max(number, 1)


def _neck_and_unit(points: Points) -> tuple[Array, Array]:
    """(T, 1, 2 or 3) the neck, and (T, 1, 1) what lengths are measured in: PATS' right shoulder, metres for TED."""
    if points.layout not in _NECK:
        raise InputError(f"key points of layout {points.layout!r} have no known arms", "leave derived speakers out")
    neck = points.values[:, _NECK[points.layout], None]
    if points.layout == "ted":
        return neck, np.ones((len(points), 1, 1))
    shoulder = points.values[:, pats.JOINTS.index("RShoulder"), None] - neck
    return neck, np.linalg.norm(shoulder, axis=-1, keepdims=True)
