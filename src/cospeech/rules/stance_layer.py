"""A stance under another system's motion: legs, pelvis, breath and a trunk that follows the hands, for systems without them.

Networks that learnt upper bodies stand on planted feet with a stiff trunk. Here a `Stance` of the rules carries them. The
pelvis goes from leg to leg over feet that step. The chest takes over a part of its turn and breathes. It bends into a stroke
downward or forward, a little before the hands. The head stays nearly where it looked, and the arms ride on the chest as they
are, but outside of the body.

Every frame depends on its own row, on the wrists within `REACH` seconds, on its time and on the seed. So a motion may be
given in pieces of any size, and comes back `StanceLayer.look_ahead` later.
"""

from __future__ import annotations

from random import Random

import numpy as np

from ..motion.kinematics.arm_clearance import keep_arms_out
from ..motion.kinematics.arms import wrists_in_chest
from ..motion.kinematics.body import NECK_SHARE, SPINE, Body
from ..motion.kinematics.legs import balance, carry, stand, weight_shift
from ..motion.motion import Motion
from ..motion.noise import smooth_noise
from ..motion.rotations import (
    Array,
    QuatStream,
    euler_to_quat,
    quat_angle,
    quat_conjugate,
    quat_multiply,
    quat_normalize,
    quat_to_rotvec,
    rotvec_to_quat,
)
from ..motion.skeleton import humanoid
from .arm_layer import move_fingers, raise_clavicles
from .arm_push import ArmPush
from .minimum_jerk import MinimumJerkTrack
from .stance import BREATH_PITCH, CONTRAPPOSTO, DRIFT, DRIFT_HZ, PELVIS_SHARE, Stance, StanceAmounts, first_body

__all__ = ["REACH", "SEATED", "StanceLayer", "add_stance"]

TICK = 0.1  # seconds between decisions, as in a session of the rules
_AT_ONCE = 240  # frames; more at a time take memory, and hardly less time
SEATED = 0.70
"""Metres; hips that are lower sit, and keep the legs that they have ([ours], half-way of `legs.plant`)."""
REACH = 0.24
"""Seconds before and after a frame of which the wrists count: half the width of the trunk's kernel, and its lead."""
_TRUNK_AND_HEAD = ("hips", *(name for name, _ in SPINE), "neck", "head")
_LEAD = 0.08  # seconds by which the trunk is before the hands (ours: as in the rules, .06 to .13)
_FOLLOWS, _BENDS = np.radians([31.0, 12.0, 40.0]), np.radians(25.0)
"""Pitch, roll and yaw of the chest per arm length that the hands are ahead, aside, and one before the other; pitch per arm
length that they come down (ours). A trunk turns to where the hands are. It bends when they move, but mostly not to where they
go: of one recorded speaker, their place explains .79 of the yaw of the shoulders, and .09 of the lean."""
_ASIDE = np.radians(18.0)  # yaw of the chest per arm length that both hands are aside (ours)
_EITHER_WAY = 0.25  # lattice points per second of the noise that says which way a trunk bends (ours)
_KNEES, _HIPS = 0.1, 0.7  # metres that knees give way per radian of bend; share of the yaw that the pelvis takes (ours)
_GOES = np.array([0.05, -0.08])  # metres that the hips go forward and to the left per radian of pitch and roll (ours)
_PART = 0.45  # of the way in `REACH` that counts as the size of a gesture: a stroke is seen in several ticks ([ours])
_LASTS = 1.2  # seconds of a gesture whose end is not known ([ours])
_TRUNK = 0.45  # share of its own bend that a motion's trunk keeps (ours: the rest is what follows the hands)
_USUAL, _HEIGHT = np.array([0.3, 0.0, 0.0]), -0.6
"""Arm lengths ahead, aside, apart, and above the shoulder at which hands turn and bend nobody (ours: medians of people)."""
_FULL = 0.2  # arm lengths from there at which the trunk has gone along nearly as far as it will (ours)
_LESS = 0.78  # share of a stance's sway that goes under hips which move by themselves ([ours])
_SWAY = np.radians([1.2, 1.08, 2.2])  # pitch, roll, yaw of a chest that is never still ([ours], as the rules')
_LOOKS = np.radians([2.6, 3.6, 6.4])
"""Pitch, roll and yaw of a head that is never still ([ours]); eyes are turned against it."""
_QUICK, _PER, _GAINS = np.radians(19.0), np.radians(5.0), (0.3, 1.8)
"""Radians per second of the motion's own head at which just that is added; more is added to one that moves less, within these
factors ([ours]: the heads of people turn by 19 to 27 degrees per second)."""
_REMEMBERS = 10.0  # seconds over which the speed of the own head counts ([ours])
_HASTY = np.radians([25.0, 33.0])
"""Radians per second of the motion's own head at which smoothing over `REACH` to either side begins, and is full ([ours]): the
chain nods at 35 degrees per second, a third faster than people."""
_STEADY, _LEAST = np.radians(31.0), 0.5
"""Radians per second of the motion's own head above which it also turns less far from its mean place, and the least share of
that way that it keeps ([ours]): smoothing alone took a fifth off the chain's."""
_RESTS, _MOVES = 0.7, 1.0
"""Share of its way by which a hasty head turns less far while the hands rest; arm lengths per second of the quicker hand from
which hands do not rest ([ours]: the chain's head went as far while its hands rested)."""
_MOSTLY = 2.0  # seconds over which the mean place of a head is taken ([ours])
_HEAD = 0.5  # share of what the chest does that the head goes along with ([ours]: so the flow's goes with the hands)
_OWN = 0.3  # share of its own travel that a motion keeps ([ours])
_FAR = 0.06  # metres at which that bends ([ours]: feet are where they are)


class StanceLayer:
    """Layers a stance under frames as they come.

    Args:
        seed: of this take; another one, another stance.
        fps: of the frames.
        amount: factor on sway, steps and the following trunk, 0 … 2; 0 leaves the motion alone but for its planted feet.
        steps: per minute at an amount of 1.
        fingers: whether they are moved; False where no hands are wanted.
        waits: seconds of motion after a frame that it waits for; with less than `REACH` the trunk follows the hands later.
    """

    sound_ahead = 0.0
    """It does not listen (`cospeech.runtime.motion_layers.MotionLayer`)."""

    def __init__(
        self, *, seed: int, fps: float, amount: float = 1.0, steps: float = 9.0, fingers: bool = True, waits: float = REACH
    ) -> None:
        self._seed, self._fps, self._amount, self._steps, self._fingers = seed, fps, amount, steps, fingers
        self._stance: Stance | None = None
        self._frame, self._ticks = 0, 0
        self._ahead, self._behind = int(min(waits, REACH) * fps), int(REACH * fps)
        taps, lead = np.arange(-self._behind, self._ahead + 1) / fps, min(_LEAD, waits - (REACH - _LEAD))
        kernel = np.maximum(np.cos(np.pi / 2 * np.clip((taps - lead) / (REACH - _LEAD), -1.0, 1.0)), 0.0) ** 2 + 1e-9
        self._kernel = kernel / kernel.sum()
        s = humanoid()
        self._q, self._place, self._wrists = np.zeros((0, len(s), 4)), np.zeros((0, 3)), np.zeros((0, 2, 3))
        self._quick, self._count = float(_QUICK), 0
        self._head, self._heads, self._mean = np.zeros((0, 4)), np.zeros((0, 4)), np.zeros(4)
        self._calm = np.cos(np.pi / 2 * np.arange(-self._ahead, self._ahead + 1) / (self._ahead + 1)) ** 2
        self._calm /= self._calm.sum()
        self._gains, self._shares, self._means = np.zeros(0), np.zeros((0, 2)), np.zeros((0, 4))
        self._signs = QuatStream()
        self._arms = ArmPush(self._behind, self._ahead, min(amount, 1.0))

    @property
    def look_ahead(self) -> float:
        """Seconds of motion after a frame that it waits for."""
        return self._ahead / self._fps

    def push(self, rotations: Array, root: Array) -> tuple[Array, Array]:
        """The next frames.

        Args:
            rotations: (n, J, 4) of our humanoid, local.
            root: (n, 3) of its hips, metres.

        Returns:
            Those that have become certain, with a stance under them, in float32.
        """
        if not len(rotations):
            return self._layer(0)
        q = np.asarray(rotations, float)
        wrists = wrists_in_chest(q)
        if self._stance is None:
            self._begin(seated=float(root[0, 1]) < SEATED)
            self._wrists = np.repeat(wrists[:1], self._behind, 0)
        self._q, self._place = np.concatenate([self._q, q]), np.concatenate([self._place, np.asarray(root, float)])
        self._wrists = np.concatenate([self._wrists, wrists])
        self._arms.add(q)
        self._follow_head(q)
        return self._layer(max(len(self._q) - self._ahead, 0))

    def finish(self) -> tuple[Array, Array]:
        """The frames that are left, after the last one was pushed: its hands stay where they are."""
        if len(self._q):
            self._wrists = np.concatenate([self._wrists, np.repeat(self._wrists[-1:], self._ahead, 0)])
            self._heads = np.concatenate([self._heads, np.repeat(self._heads[-1:], self._ahead, 0)])
            self._arms.finish()
        return self._layer(len(self._q))

    def _layer(self, count: int) -> tuple[Array, Array]:
        """The first frames of those that wait."""
        q, place = self._q[:count].copy(), self._place[:count].copy()
        self._q, self._place = self._q[count:], self._place[count:]
        for first in range(0, count, _AT_ONCE):
            part = slice(first, first + _AT_ONCE)
            times = (self._frame + np.arange(len(q[part]))) / self._fps
            self._frame += len(times)
            self._write(q[part], place[part], self._body(times), times)
            self._gains = self._gains[len(times) :]
        return self._signs.push(q.astype(np.float32)), place.astype(np.float32)

    def _follow_head(self, q: Array) -> None:
        """Note the heads of frames that are pushed; how much is added to them, and how far they are smoothed."""
        heads = _chain([q[:, humanoid().index[name]] for name in _TRUNK_AND_HEAD])
        before = self._heads if len(self._head) else np.repeat(heads[:1], self._ahead, 0)
        self._heads = np.concatenate([before, heads])
        heads = np.concatenate([self._head, heads])
        self._head = heads[-1:]
        speeds = (quat_angle(heads[:-1], heads[1:]) * self._fps).tolist()
        gains, shares = np.ones(len(q)), np.zeros((len(q), 2))
        for k, speed in enumerate(speeds, len(q) - len(speeds)):
            self._count += 1
            self._quick += (speed - self._quick) / min(self._count + self._fps, _REMEMBERS * self._fps)
            gains[k] = min(max(1.0 + (float(_QUICK) - self._quick) / float(_PER), _GAINS[0]), _GAINS[1])
            shares[k, 0] = min(max((self._quick - float(_HASTY[0])) / float(_HASTY[1] - _HASTY[0]), 0.0), 1.0)
            shares[k, 1] = 1.0 - min(max(float(_STEADY) / max(self._quick, 1e-6), _LEAST), 1.0)
        means = self._follow_mean(heads[-len(q) :])
        self._gains, self._shares = np.concatenate([self._gains, gains]), np.concatenate([self._shares, shares])
        self._means = np.concatenate([self._means, means])

    def _follow_mean(self, heads: Array) -> Array:
        """The running mean of a head (n, 4), frame by frame; in plain numbers, which is quicker than arrays of four."""
        (x, y, z, w), many, means = self._mean.tolist(), max(_MOSTLY * self._fps, 1.0), []
        for a, b, c, d in heads.tolist():
            if not (x or y or z or w):
                x, y, z, w = a, b, c, d
            else:
                if x * a + y * b + z * c + w * d < 0:
                    x, y, z, w = -x, -y, -z, -w
                x, y, z, w = x + (a - x) / many, y + (b - y) / many, z + (c - z) / many, w + (d - w) / many
            means.append((x, y, z, w))
        result = np.array(means)
        self._mean = result[-1]
        return result

    def _calm_head(self, head: Array, rest: Array) -> Array:
        """The heads (n, 4) of the next frames; hasty ones are smoothed, and nearer to their mean.

        ``rest``: (n,) 0 … 1, how little the hands move meanwhile: a hasty head is calmer then.
        """
        count = len(head)
        near = np.zeros((count, 4))
        for k, weight in enumerate(self._calm):  # one after the other: the same bits in pieces of any size
            near += weight * _like(self._heads[k : k + count], head)
        smooth, less = (min(self._amount, 1.0) * self._shares[:count]).T
        smooth, less = smooth[:, None], np.minimum(less + smooth * _RESTS * rest, 1.0)[:, None]
        calm = head + smooth * (near - head)
        calm += less * (_like(self._means[:count], head) - calm)
        self._heads, self._shares, self._means = self._heads[count:], self._shares[count:], self._means[count:]
        return quat_normalize(calm)

    def _begin(self, *, seated: bool) -> None:
        random = Random(f"{self._seed}/stance")
        track = MinimumJerkTrack(first_body(random, seated=seated))
        steps = 0.0 if seated else self._steps * self._amount
        self._stance = Stance(track, random, StanceAmounts(_LESS * self._amount, steps, seated))

    def _body(self, times: Array) -> Array:
        """(n, channels) of the stance at the times, sway included."""
        assert self._stance is not None
        while self._ticks * TICK <= times[-1]:
            now = self._ticks * TICK
            self._stance.begin_gesture(now, now, _LASTS, self._measure_way(self._behind + int(np.searchsorted(times, now))))
            self._stance.decide(now)
            self._ticks += 1
        b = self._stance.track.at(times)
        self._stance.track.forget(times[-1] - 0.5)
        noise = smooth_noise(self._seed + 21, 5, times, 0.42, octaves=3, gain=0.55) * self._amount
        still = 0.15 if self._stance.amounts.seated else 1.0
        columns = [Body.HIPS_X, Body.HIPS_Z, Body.HIPS_YAW, Body.HIPS_PITCH, Body.HIPS_ROLL]
        b[:, columns] += noise * [0.004 * still, 0.004 * still, 4.3, 1.1, 0.9]
        drift = smooth_noise(self._seed + 27, 2, times, DRIFT_HZ, octaves=1) * self._amount
        b[:, Body.PLACE] += DRIFT * still * drift
        return b

    def _measure_way(self, frame: int) -> float:
        """Arm lengths that the quicker hand goes around a frame of the wrists that are kept: a part of a stroke's way."""
        way = self._wrists[frame + self._ahead] - self._wrists[frame + self._ahead - self._behind]
        return _PART * float(np.sqrt((way * way).sum(-1).max()))

    def _measure_speeds(self, count: int) -> Array:
        """(n, 2) speeds of both hands in the next frames, arm lengths per second."""
        wide = self._behind // 2  # frames to either side of which the mean speed counts: a stroke, and not its jerks
        last = self._behind + min(wide, self._ahead)
        way = self._wrists[last : last + count] - self._wrists[last - 2 * wide : last - 2 * wide + count]
        return np.asarray(np.sqrt(np.einsum("nsi,nsi->ns", way, way)) * (self._fps / max(2 * wide, 1)))

    def _move_arms(self, q: Array, breath: Array, times: Array, speeds: Array) -> None:
        """Clavicles and fingers of the next frames."""
        behind, near = self._behind, self._wrists[: len(q) + self._behind + self._ahead]
        raise_clavicles(q, near[behind : behind + len(q)], breath, times, self._seed, self._amount)
        if self._fingers:
            move_fingers(q, speeds, times, self._seed, self._amount)

    def _follow(self, times: Array) -> Array:
        """(n, 3) pitch, roll and yaw by which the chest goes along with the hands at the times of the next frames, radians."""
        count = len(times)
        near = np.zeros((count, 2, 3))
        for k, weight in enumerate(self._kernel):  # one after the other: the same bits in pieces of any size
            near += weight * self._wrists[k : k + count]
        self._wrists = self._wrists[count:]
        left, right = near[:, 0], near[:, 1]
        ahead = np.stack([left[:, 2] + right[:, 2], -(left[:, 0] + right[:, 0]), right[:, 2] - left[:, 2]], -1) / 2
        turns = np.tanh((ahead - _USUAL) / _FULL) * _FULL * _FOLLOWS
        height = 0.5 * (left[:, 1] + right[:, 1]) - _HEIGHT
        down = -np.tanh(height / _FULL) * _FULL * _BENDS
        ways = np.tanh(6 * smooth_noise(self._seed + 26, 3, times, _EITHER_WAY, octaves=1))
        turns[:, 0] = ways[:, 0] * turns[:, 0] + ways[:, 1] * down
        turns[:, 2] -= np.tanh(ahead[:, 1] / _FULL) * _FULL * _ASIDE
        turns[:, 1] *= ways[:, 2]
        return turns * min(self._amount, 1.0)

    def _write(self, q: Array, place: Array, b: Array, times: Array) -> None:
        """Write pelvis, trunk, head and, for a standing body, legs."""
        assert self._stance is not None
        joint, seated = humanoid().index, self._stance.amounts.seated
        old = [q[:, joint[name]] for name in _TRUNK_AND_HEAD]
        chest = _chain(old[:4])
        speeds = self._measure_speeds(len(q))
        rest = np.maximum(1.0 - speeds.max(1) / _MOVES, 0.0)
        head = self._calm_head(quat_multiply(chest, quat_multiply(old[4], old[5])), rest)
        self._arms.apply(q)
        self._move_arms(q, b[:, Body.BREATH], times, speeds)
        follow = self._follow(times)
        if not seated:
            b[:, Body.SINK] += _KNEES * np.abs(follow[:, 0])
            b[:, Body.HIPS_YAW] += np.degrees(_HIPS * follow[:, 2])
            b[:, [Body.HIPS_Z, Body.HIPS_X]] += _GOES * follow[:, :2]
            b[:, Body.PLACE] = balance(b[:, Body.PLACE], b)
        pelvis, root = stand(b, seated, None)
        lead = self._lead(follow, b, times)
        hips = quat_multiply(pelvis, old[0])
        q[:, joint["hips"]] = hips
        trunk = quat_multiply(lead, rotvec_to_quat((1 - (1 - _TRUNK) * min(self._amount, 1.0)) * quat_to_rotvec(chest)))
        bend = quat_to_rotvec(quat_multiply(quat_conjugate(hips), trunk))
        for name, share in SPINE:
            q[:, joint[name]] = rotvec_to_quat(bend * share)
        turns = smooth_noise(self._seed + 23, 3, times, 0.7, octaves=3, gain=0.55) * _LOOKS * self._amount
        turns *= self._gains[: len(q), None]
        looks = quat_multiply(rotvec_to_quat(quat_to_rotvec(lead) * _HEAD), quat_multiply(_euler(turns), head))
        nod = quat_to_rotvec(quat_multiply(quat_conjugate(trunk), looks))
        q[:, joint["neck"]] = rotvec_to_quat(nod * NECK_SHARE)
        q[:, joint["head"]] = rotvec_to_quat(nod * (1 - NECK_SHARE))
        keep_arms_out(q, min(self._amount, 1.0))
        if seated:
            place[:, [0, 2]] += b[:, [Body.HIPS_X, Body.HIPS_Z]]
            return
        place[:, [0, 2]] = balance(root[:, [0, 2]] + np.tanh(_OWN * place[:, [0, 2]] / _FAR) * _FAR, b)
        joints, legs, height = carry(hips, place, b)
        q[:, joints], place[:, 1] = legs, height

    def _lead(self, follow: Array, b: Array, times: Array) -> Array:
        """(n, 4) by which the chest turns in the world: its share of the pelvis, breath, sway, and the way after the hands."""
        assert self._stance is not None
        turns = follow + smooth_noise(self._seed + 22, 3, times, 0.42, octaves=3, gain=0.55) * _SWAY * self._amount
        turns[:, 0] -= np.radians(BREATH_PITCH) * b[:, Body.BREATH]
        yaw = b[:, Body.HIPS_YAW]
        if not self._stance.amounts.seated:
            yaw = yaw + 0.5 * (b[:, Body.LEFT_FOOT.stop - 1] + b[:, Body.RIGHT_FOOT.stop - 1])
            turns[:, 1] -= np.radians(CONTRAPPOSTO) * weight_shift(b)
        turns[:, 2] += PELVIS_SHARE * np.radians(yaw)
        return _euler(turns)


def _euler(turns: Array) -> Array:
    """(n, 4) of (n, 3) pitch, roll and yaw in radians."""
    return euler_to_quat(turns[:, [2, 0, 1]], "YXZ")


def _like(rotations: Array, others: Array) -> Array:
    """The quaternions (n, 4) with the signs with which they are near others."""
    return np.where(np.sum(rotations * others, -1, keepdims=True) < 0, -rotations, rotations)


def _chain(rotations: list[Array]) -> Array:
    """The product of local rotations, from the root on."""
    world = rotations[0]
    for local in rotations[1:]:
        world = quat_multiply(world, local)
    return world


def add_stance(motion: Motion, *, seed: int = 0, amount: float = 1.0) -> Motion:
    """A whole motion on our humanoid with a stance under it; see `StanceLayer`."""
    layer = StanceLayer(seed=seed, fps=motion.fps, amount=amount)
    first, rest = layer.push(motion.rotations, motion.root), layer.finish()
    rotations, root = (np.concatenate(parts) for parts in zip(first, rest, strict=True))
    return Motion(motion.fps, rotations, root, motion.face, motion.skeleton, motion.start)
