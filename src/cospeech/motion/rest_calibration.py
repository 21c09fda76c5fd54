"""Correct the T-pose of a skeleton by its motion: the turn of each joint about its bone.

If all bones of a file's zero pose lie along one axis, they have directions, but no front. `cospeech.motion.tpose` then turns
each bone the shortest way, and may turn it about itself. Positions of joints stay right, but a skin is torn. The motion shows
the right turns: hips carry the line between the legs, a chest the line between the shoulders, and an elbow and a knee bend
about one axis. If a joint's rotation differs from these lines by the same turn in all frames, its T-pose is wrong by that turn.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from .limbs import lacks_limb
from .rotations import Array, matrix_to_quat, quat_angle, quat_conjugate, quat_identity, quat_multiply, quat_rotate
from .skeleton import Skeleton
from .soles import find_soles
from .tpose import on_floor

__all__ = ["calibrate_rest", "on_motions_floor"]

_X, _Y, _Z = np.eye(3)
_LEAST_BEND = np.sin(np.radians(25.0))  # ours: an elbow or a knee that bends less shows no axis
_FEWEST = 5  # ours: frames that are needed to show an axis
_SHORTEST = 30  # ours: in a shorter motion, the pose may be intended
_FRAMES = 256  # ours: frames that are examined
_LEAST = 50.0  # degrees of error that are corrected [ours: the mean turn of joints is half of that, of wrong T-poses far more]
_LEAST_OF = {"LowerArm": 75.0, "Hand": 100.0, "Distal": 100.0}  # ours: palms and fists are seldom as in a T-pose
_MANY, _LEAST_OF_MANY = 4, 15.0  # ours: if so many joints are wrong, all with an error of so many degrees are corrected
_MOST_ERROR = 40.0  # degrees that may remain [ours: more is movement, not a T-pose]
_CONTACT = 5.0  # ours: the lowest 5 % of the heights of the soles are contacts
_HIGHEST_FLOOR = 0.12  # metres [ours: feet that are always higher hang in the air on purpose]
_TRUNK = ("spine", "chest", "upperChest", "neck", "head")
_NEXT = {"UpperArm": "LowerArm", "LowerArm": "Hand", "UpperLeg": "LowerLeg", "LowerLeg": "Foot", "Shoulder": "UpperArm",
         "Foot": "Toes", "Hand": "MiddleProximal"}  # fmt: skip
_HOLDERS = {"Thumb": "Hand", "Eye": "head", "jaw": "head"}  # parts without a line of their own → the part with which they turn
_CARRIERS = {
    "LowerArm": ("UpperArm", _Y), "Hand": ("LowerArm", _Z),
    "UpperLeg": ("hips", _X), "LowerLeg": ("UpperLeg", _X), "Foot": ("LowerLeg", _X), "Toes": ("Foot", _X),
}  # fmt: skip
"""Part → the joint whose mean turn about the bone is the same, and an axis across the bone."""
for _finger in ("Index", "Middle", "Ring", "Little"):  # a thumb turns about itself, so that its mean shows nothing
    _above = "Hand"
    for _phalanx in ("Proximal", "Intermediate", "Distal"):
        _CARRIERS[_finger + _phalanx] = (_above, _Z)
        _NEXT |= {_above: _finger + _phalanx} if _above != "Hand" else {}
        _above = _finger + _phalanx


@dataclass(frozen=True)
class _Line:
    """A direction in the T-pose, the same direction in each frame, and the weight of each frame."""

    rest: Array
    frames: Array
    weight: Array


def calibrate_rest(skeleton: Skeleton, names: Mapping[str, str], rotations: Array) -> Skeleton:
    """Correct the T-pose of a skeleton so that it fits its motion.

    Args:
        skeleton: theirs, with the T-pose of `cospeech.motion.tpose.with_tpose`.
        names: our name → their name.
        rotations: (T, J, 4) local rotations.

    Returns:
        The skeleton itself if nothing is wrong, or if the motion is too short to tell.
    """
    if len(rotations) < _SHORTEST:
        return skeleton
    sample = np.unique(np.linspace(0, len(rotations) - 1, _FRAMES).astype(int))
    points, world = skeleton.forward(rotations[sample], np.zeros(3))
    tpoints, rest = skeleton.forward(skeleton.rest, np.zeros(3))
    joints = {ours: skeleton.index[theirs] for ours, theirs in names.items()}
    since = {ours: quat_multiply(world[:, j], quat_conjugate(rest[j])) for ours, j in joints.items()}
    turns = _find_turns(_Lines(joints, points, tpoints, since), _LEAST)
    if len(turns) >= _MANY:
        turns = _find_turns(_Lines(joints, points, tpoints, since), _LEAST_OF_MANY)
    if not turns:
        return skeleton
    turns |= {ours: turns[holder] for ours, holder in _name_holders(joints).items() if holder in turns}
    new_rest = rest.copy()
    for ours, turn in turns.items():
        new_rest[joints[ours]] = quat_multiply(quat_conjugate(turn), rest[joints[ours]])
    above = new_rest[[max(p, 0) for p in skeleton.parents]]
    above[0] = (0, 0, 0, 1)
    return on_floor(replace(skeleton, rest=quat_multiply(quat_conjugate(above), new_rest)), joints["hips"])


def on_motions_floor(skeleton: Skeleton, names: Mapping[str, str], rotations: Array, root: Array) -> Skeleton:
    """Put the T-pose of a skeleton on the floor that the feet of the motion touch; in many files this is not at height 0.

    Without legs, the hips get the median height of the motion's hips.

    Args:
        skeleton: theirs, in metres, with its T-pose as ``rest``.
        names: our name → their name.
        rotations, root: (T, J, 4) and (T, 3) of the motion.
    """
    soles, hips = find_soles(skeleton, names), skeleton.index[names["hips"]]
    sample = np.unique(np.linspace(0, len(rotations) - 1, _FRAMES).astype(int))
    if lacks_limb(names, "legs"):
        heights = skeleton.forward(rotations[sample], root[sample])[0][:, hips, 1]
        return on_floor(skeleton, hips, float(np.median(heights)) + skeleton.floor - float(skeleton.tpose[hips, 1]))
    if soles is None:
        return skeleton
    height = float(np.percentile(soles.heights(*skeleton.forward(rotations[sample], root[sample])), _CONTACT))
    return on_floor(skeleton, hips, height if height < _HIGHEST_FLOOR else 0.0)


def _find_turns(lines: _Lines, least: float) -> dict[str, Array]:
    """Our name → (4,) the turn that corrects the T-pose of a joint, for errors of ``least`` degrees or more."""
    turns = {}
    for ours in lines.joints:
        limit = next((limit for part, limit in _LEAST_OF.items() if ours.endswith(part)), least)
        turn = _find_turn(lines.since[ours], lines.of(ours), limit)
        if turn is not None:
            turns[ours] = turn
            lines.since[ours] = quat_multiply(lines.since[ours], turn)
    return turns


def _name_holders(joints: Mapping[str, int]) -> dict[str, str]:
    """Our name → name of the joint with which it turns, for joints without a line: a thumb is corrected with its hand."""
    holders = {}
    for ours in joints:
        side = next((s for s in ("left", "right") if ours.startswith(s)), "")
        holder = next((name for part, name in _HOLDERS.items() if ours.removeprefix(side).startswith(part)), None)
        if holder is not None:
            holders[ours] = holder if holder == "head" else side + holder
    return holders


def _find_turn(since: Array, lines: list[_Line], least: float) -> Array | None:
    """(4,) the turn between a joint's rotation since the T-pose, (T, 4), and its lines; None if it is no error."""
    if len(lines) < 2:
        return None
    back = quat_conjugate(since)
    observations = [(line.rest, quat_rotate(back, line.frames), line.weight) for line in lines]
    fit = sum(np.einsum("t,ti,j->ij", weight / len(weight), now, rest) for rest, now, weight in observations)
    u, _, v = np.linalg.svd(fit)
    turn = matrix_to_quat(u @ np.diag((1.0, 1.0, np.sign(np.linalg.det(u @ v)))) @ v)
    if np.degrees(quat_angle(turn, quat_identity())) < least:
        return None
    errors = [np.arccos(np.clip(now @ quat_rotate(turn, rest), -1, 1))[weight > 0].mean() for rest, now, weight in observations]
    return turn if np.degrees(max(errors)) < _MOST_ERROR else None


class _Lines:
    """Directions that are known both in the T-pose and in each frame.

    Args:
        joints: our name → index, parents first.
        points: (T, J, 3) joints in the frames.
        tpoints: (J, 3) joints in the T-pose.
        since: our name → (T, 4) rotations since the T-pose; they are corrected as errors become known.
    """

    def __init__(self, joints: Mapping[str, int], points: Array, tpoints: Array, since: Mapping[str, Array]) -> None:
        self.joints, self._points, self._tpoints, self.since = joints, points, tpoints, dict(since)

    def of(self, ours: str) -> list[_Line]:
        """At most two lines of a joint: the direction of its bone, and one across it."""
        side = next((s for s in ("left", "right") if ours.startswith(s)), "")
        part = ours.removeprefix(side)
        if ours == "hips":
            return self._drop_missing(self._between("rightUpperLeg", "leftUpperLeg", _X), self._up("hips"))
        if ours in _TRUNK:
            across = self._between("rightUpperArm", "leftUpperArm", _X)
            eyes = self._between("rightEye", "leftEye", _X) if ours == "head" else None
            return self._drop_missing(eyes or across, self._up(ours))
        bone = self._between(ours, side + _NEXT[part]) if part in _NEXT else None
        if part == "Shoulder":
            top = next((name for name in ("upperChest", "chest", "spine") if name in self.joints), "hips")
            return self._drop_missing(bone, self._carry_axis(top, _Z))
        if part not in _CARRIERS and part != "UpperArm":
            return []
        carrier, axis = _CARRIERS.get(part, ("", _Z))
        carrier = carrier if carrier == "hips" else side + carrier
        across = None
        if part in ("UpperArm", "LowerArm"):
            across = self._hinge(side, ("UpperArm", "LowerArm", "Hand"), _Y if side == "right" else -_Y)
        elif part in ("UpperLeg", "LowerLeg"):
            across = self._hinge(side, ("UpperLeg", "LowerLeg", "Foot"), _X)
        elif part == "Hand":
            across = self._between(side + "LittleProximal", side + "IndexProximal", _Z)
        return self._drop_missing(bone or self._between(carrier, ours), across or self._carry_axis(carrier, axis))

    def _carry_axis(self, ours: str, axis: Array) -> _Line | None:
        """An axis of the T-pose that turns with another joint."""
        if ours not in self.since:
            return None
        return _Line(axis, quat_rotate(self.since[ours], axis), np.ones(len(self._points)))

    @staticmethod
    def _drop_missing(*lines: _Line | None) -> list[_Line]:
        return [line for line in lines if line is not None]

    def _between(self, start: str, end: str, rest: Array | None = None) -> _Line | None:
        """The line from one joint to another; ``rest``: its direction in every T-pose; None: that of this T-pose."""
        if not {start, end} <= set(self.joints):
            return None
        a, b = self.joints[start], self.joints[end]
        here, frames = self._tpoints[b] - self._tpoints[a], self._points[:, b] - self._points[:, a]
        if np.linalg.norm(here) < 1e-6 * np.ptp(self._tpoints):
            return None
        return _Line(_unit(here) if rest is None else rest, _unit(frames), np.ones(len(frames)))

    def _up(self, ours: str) -> _Line | None:
        """The line from a joint of the trunk to the next one above it at another place; for a head, from the one below."""
        order = ["hips", *_TRUNK]
        above = [name for name in order[order.index(ours) + 1 :] if name in self.joints]
        below = [name for name in order[: order.index(ours)] if name in self.joints]
        lines = (self._between(ours, name) for name in above)
        from_below = (self._between(name, ours) for name in reversed(below))
        return next((line for line in (*lines, *from_below) if line is not None), None)

    def _hinge(self, side: str, chain: tuple[str, str, str], axis: Array) -> _Line | None:
        """The line of the axis about which an elbow or a knee bends; ``axis``: its direction in the T-pose."""
        if not {side + part for part in chain} <= set(self.joints):
            return None
        a, b, c = (self._points[:, self.joints[side + part]] for part in chain)
        normal = np.cross(_unit(b - a), _unit(c - b))
        bend = np.linalg.norm(normal, axis=-1)
        weight = np.where(bend > _LEAST_BEND, bend, 0.0)
        return _Line(axis, _unit(normal), weight) if np.count_nonzero(weight) >= _FEWEST else None


def _unit(v: Array) -> Array:
    return v / np.maximum(np.linalg.norm(v, axis=-1, keepdims=True), 1e-12)
