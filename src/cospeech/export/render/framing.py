"""Turn motion into world poses near the origin, before the camera, and find the space that they take up."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import replace
from math import hypot
from typing import NamedTuple

import numpy as np

from ...errors import InputError
from ...motion.motion import Motion
from ...motion.rotations import Array, axis_angle_to_quat, quat_multiply, quat_rotate
from ...motion.skeleton import Skeleton, humanoid
from ...motion.skeletons.arkit import ARKIT
from ...motion.skeletons.humanoid import HEIGHT
from ..mannequin.character import Character
from .camera import View

__all__ = ["FramedPose", "Framing", "PoseStage", "box_of", "boxes_of", "fit_view"]

_SLACK = 0.12  # metres that the hips may move before the camera follows; ours: swaying is seen, walking is followed
_HURRY = 0.16  # share of the remaining distance that the camera moves in 1/30 s; ours
_TURNING = 0.5  # seconds before and after, over which the places of a followed head are averaged; ours
_ROOM = 0.03  # metres that such a head may differ from the average before the picture widens; ours
_ASTRAY = 0.30  # metres between feet and floor in the first frame, above which the floor of the file is another one


class FramedPose(NamedTuple):
    """One frame, ready to draw: world rotations (J, 4), positions (J, 3) in metres, ARKit weights (52,).

    With one more axis in front, several frames.
    """

    rotations: Array
    positions: Array
    face: Array


class PoseStage:
    """Turns the character to the camera as it stands in the first frame, puts it on the floor, and follows where it walks.

    The result for a frame depends on that frame and those before it, not on the pieces of the motion.
    """

    def __init__(self, skeleton: Skeleton, fps: float) -> None:
        self._skeleton = skeleton
        self._pace = 1 - (1 - _HURRY) ** (30 / fps)
        self._facing: Array | None = None
        self._centre, self._floor = (0.0, 0.0), 0.0

    def place(self, motion: Motion) -> FramedPose:
        """Place the T frames of ``motion``, which is on the announced skeleton: (T, J, 4), (T, J, 3) and (T, 52)."""
        positions, rotations = self._skeleton.forward(motion.rotations, motion.root)
        face = np.zeros((len(motion), len(ARKIT))) if motion.face is None else motion.face
        if self._facing is None and len(motion):
            ahead = quat_rotate(rotations[0, 0], np.array([0.0, 0.0, 1.0]))
            self._facing = axis_angle_to_quat((0, 1, 0), -np.arctan2(ahead[0], ahead[2]))
            self._centre = (float(positions[0, 0, 0]), float(positions[0, 0, 2]))
            low, soles = float(positions[0, :, 1].min()), float(self._skeleton.tpose[:, 1].min())
            self._floor = low - soles if abs(low - soles) > _ASTRAY else 0.0
        if self._facing is None or not len(motion):
            return FramedPose(rotations, positions, face)
        centres = np.full((len(motion), 1, 3), self._floor)
        centres[:, 0, [0, 2]] = [self._follow(x, z) for x, z in positions[:, 0, [0, 2]].tolist()]
        return FramedPose(quat_multiply(self._facing, rotations), quat_rotate(self._facing, positions - centres), face)

    def _follow(self, x: float, z: float) -> tuple[float, float]:
        """Move the point on the floor that the camera follows; the hips are above (x, z)."""
        away = (x - self._centre[0], z - self._centre[1])
        far = hypot(*away)
        if far > _SLACK:
            share = (far - _SLACK) / far * self._pace
            self._centre = (self._centre[0] + away[0] * share, self._centre[1] + away[1] * share)
        return self._centre


class Framing:
    """Finds, frame by frame, the box that the camera must show, so that all joints of the view stay in the picture.

    From the start, the box covers the first ten seconds. Later it widens smoothly and in time, where more room is needed. It
    moves with the joint that the view follows, if any.

    Args:
        view: what to look at.
        skeleton: of the poses.
        fps: of the poses.
    """

    SETTLE, AHEAD = 10.0, 1.5  # seconds: ours. The first is as long as a short clip: in most clips the camera never moves

    def __init__(self, view: View, skeleton: Skeleton, fps: float) -> None:
        self._view, self._skeleton = view, skeleton
        self._settle, self._ahead = max(1, round(self.SETTLE * fps)), max(1, round(self.AHEAD * fps))
        self._box: Array | None = None
        self._waiting: deque[tuple[FramedPose, Array]] = deque()
        self._tracker = _Tracker(view, skeleton, fps)
        self._boxes: deque[Array] = deque()
        self._sum = np.zeros(6)
        self._is_settled = False

    def push(self, pose: FramedPose) -> Iterator[tuple[FramedPose, Array]]:
        """Take a pose; give those whose box (6,) — low corner, high corner — is now known."""
        for pair in self._tracker.push(pose):
            yield from self._take(*pair)

    def _take(self, pose: FramedPose, place: Array) -> Iterator[tuple[FramedPose, Array]]:
        """Take a pose, and the place that the camera follows."""
        box = _box_around(self._view, self._skeleton, pose, place)
        old = box if self._box is None else self._box
        self._box = np.concatenate([np.minimum(old[:3], box[:3]), np.maximum(old[3:], box[3:])])
        self._waiting.append((pose, place))
        if self._is_settled:
            self._see()
            yield self._next()
        elif len(self._waiting) == self._settle:
            yield from self._start()

    def flush(self) -> Iterator[tuple[FramedPose, Array]]:
        """Give the rest, at the end of the motion."""
        for pair in self._tracker.flush():
            yield from self._take(*pair)
        if self._box is None:
            return
        if not self._is_settled:
            yield from self._start()
        while self._waiting:
            self._see()
            yield self._next()

    def _start(self) -> Iterator[tuple[FramedPose, Array]]:
        self._is_settled = True
        for _ in range(self._ahead):
            self._see()
        while len(self._waiting) > self._ahead:
            yield self._next()

    def _see(self) -> None:
        assert self._box is not None
        self._boxes.append(self._box)
        self._sum = self._sum + self._box
        if len(self._boxes) > self._ahead:
            self._sum = self._sum - self._boxes.popleft()

    def _next(self) -> tuple[FramedPose, Array]:
        pose, place = self._waiting.popleft()
        return pose, self._sum / len(self._boxes) + np.tile(place, 2)


class _Tracker:
    """Gives the place that the camera follows: that of the joint, averaged over a second; poses come half a second later."""

    def __init__(self, view: View, skeleton: Skeleton, fps: float) -> None:
        self._view, self._skeleton = view, skeleton
        self._half = max(1, round(_TURNING * fps)) if view.follows else 0
        share = 1 + self._half - np.abs(np.arange(-self._half, self._half + 1.0))
        self._share = share / share.sum()
        self._places: deque[Array] = deque(maxlen=len(share))
        self._waiting: deque[FramedPose] = deque()

    def push(self, pose: FramedPose) -> Iterator[tuple[FramedPose, Array]]:
        """Take a pose; give the one whose place is now known."""
        place = _place_of(self._view, self._skeleton, pose)
        self._waiting.append(pose)
        self._places.extend([place] * (1 if self._places else self._half + 1))
        yield from self._give()

    def flush(self) -> Iterator[tuple[FramedPose, Array]]:
        """Give the rest: the joint stays in its last place."""
        while self._waiting:
            self._places.append(self._places[-1])
            yield from self._give()

    def _give(self) -> Iterator[tuple[FramedPose, Array]]:
        if len(self._places) == len(self._share):
            yield self._waiting.popleft(), self._share @ np.array(self._places)


def _place_of(view: View, skeleton: Skeleton, pose: FramedPose) -> Array:
    """(3,) the middle of the view's box, which moves with the joint that it follows; the origin for views without one."""
    if not view.follows:
        return np.zeros(3)
    joint = skeleton.index[view.follows]
    middle = (np.array(view.low) + view.high) / 2 - skeleton.tpose[joint]
    return np.asarray(pose.positions[joint] + quat_rotate(pose.rotations[joint], middle))


def _box_around(view: View, skeleton: Skeleton, pose: FramedPose, place: Array) -> Array:
    """Low and high corner (6,), relative to ``place``, of the box that the camera must show for one pose."""
    if not view.follows:
        return box_of(view, skeleton, pose.positions[None])
    half = (np.array(view.high) - view.low) / 2
    off = _place_of(view, skeleton, pose) - place
    return np.concatenate([np.minimum(-half, off - half + _ROOM), np.maximum(half, off + half - _ROOM)])


def boxes_of(view: View, skeleton: Skeleton, poses: Sequence[FramedPose]) -> list[Array]:
    """A box (6,) for each of a few poses that are shown side by side: one for all, or that of the joint the view follows."""
    if not view.follows:
        return [box_of(view, skeleton, np.stack([pose.positions for pose in poses]))] * len(poses)
    half = (np.array(view.high) - view.low) / 2
    return [np.concatenate([place - half, place + half]) for place in (_place_of(view, skeleton, pose) for pose in poses)]


def fit_view(view: View, character: Character) -> View:
    """Fit a view to a character whose size or head differs from our mannequin's.

    The box of a view that follows the head spans from below its chin to above its crown, hair and hat included. For a part of a
    character, such as a half body, the other boxes end where its surface ends.

    Raises:
        InputError: nothing of the character is in the view.
    """
    skeleton = character.skeleton
    if skeleton is humanoid():
        return view
    joints = [skeleton.index[name] for name in ("head", "jaw", "leftEye", "rightEye")]
    mine = [p.vertices[np.isin(p.joints[np.arange(len(p.joints)), p.weights.argmax(1)], joints)] for p in character.parts]
    points, base = np.concatenate(mine), skeleton.tpose[skeleton.index["head"]]
    crown = float(points[:, 1].max()) if len(points) else HEIGHT
    if not view.follows:
        low, high = crown / HEIGHT * np.array(view.low), crown / HEIGHT * np.array(view.high)
        if len(points) and (not view.joints or "head" in view.joints):  # a hat may be wider than the room for the arms
            low[0], high[0] = min(low[0], points[:, 0].min()), max(high[0], points[:, 0].max())
        if skeleton.bone_map:
            _cut_box(low, high, character, view.reach)
        return replace(view, low=tuple(low.tolist()), high=tuple(high.tolist()))
    ours = humanoid().tpose[humanoid().index["head"]]
    scale = max((crown - base[1]) / (HEIGHT - ours[1]), 0.1)
    low, high = base + scale * (np.array(view.low) - ours), base + scale * (np.array(view.high) - ours)
    for axis in (0, 2) if len(points) else ():  # a high hat or hairdo is not as wide
        low[axis] = max(low[axis], float(points[:, axis].min()) - _ROOM)
        high[axis] = min(high[axis], float(points[:, axis].max()) + _ROOM)
    return replace(view, low=tuple(low.tolist()), high=tuple(high.tolist()))


def _cut_box(low: Array, high: Array, character: Character, reach: float) -> None:
    """Cut a box at the bottom of the surface in the T-pose, less ``reach`` metres; without arms, cut its sides, too."""
    points = np.concatenate([part.vertices for part in character.parts])
    low[1] = max(low[1], float(points[:, 1].min()) - reach)
    if not character.skeleton.bone_map["leftUpperArm"] and not character.skeleton.bone_map["rightUpperArm"]:
        low[0], high[0] = points[:, 0].min() - reach, points[:, 0].max() + reach
    if not (low < high).all():
        raise InputError("nothing of this character is where the camera looks", "use the camera body, full or face")


def box_of(view: View, skeleton: Skeleton, positions: Array) -> Array:
    """Low and high corner (6,) of the box that the camera must show: the view's own box and the room of its joints.

    Args:
        positions: (T, J, 3) metres.
    """
    at = positions[:, view.joints_of(skeleton)]
    low = np.minimum(view.low, at.min((0, 1), initial=np.inf) - view.reach)
    return np.concatenate([low, np.maximum(view.high, at.max((0, 1), initial=-np.inf) + view.reach)])
