"""Rotations as numpy arrays: ``a_to_b`` functions over any number of leading batch dimensions.

Conventions, here and everywhere in cospeech: radians, right-handed, active rotations of column vectors,
quaternions ``xyzw`` and of unit length. Euler orders are *intrinsic*, read left to right: ``"ZXY"`` means
``R = Rz @ Rx @ Ry``, which is also how a BVH file's channel order reads.
"""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = [
    "QuatStream",
    "axis_angle_to_quat",
    "cross",
    "euler_to_quat",
    "make_continuous",
    "matrix_to_quat",
    "matrix_to_rot6d",
    "quat_angle",
    "quat_between",
    "quat_conjugate",
    "quat_continuous",
    "quat_identity",
    "quat_multiply",
    "quat_normalize",
    "quat_rotate",
    "quat_slerp",
    "quat_to_euler",
    "quat_to_matrix",
    "quat_to_rot6d",
    "quat_to_rotvec",
    "quat_twist",
    "rot6d_to_matrix",
    "rotvec_to_quat",
    "vector_normalize",
]  # fmt: skip

Array = NDArray[Any]
"""An array of any dtype: NumPy's own stubs do not follow dtypes through arithmetic."""
_AXIS = {"X": 0, "Y": 1, "Z": 2}
_SMALL = 1e-12  # ours: below this an angle or a norm counts as zero in float64
_BLOCK = 1024  # frames at once, in place [ours]
_FEW = 256  # numbers up to which one product of gathered copies is faster than sixteen products of views [ours, measured]
_OF_A = np.array([3, 0, 1, 2])
_OF_B = np.array([[0, 3, 2, 1], [1, 2, 3, 0], [2, 1, 0, 3], [3, 0, 1, 2]])
_SIGNS = np.array([[1, 1, 1, -1], [1, -1, 1, 1], [1, 1, -1, 1], [1, -1, -1, -1]], np.float32)
"""A row for each component of the Hamilton product: the component of ``b`` that is multiplied with w, x, y, z of ``a``, and the
sign of the product."""
_CYCLE, _CYCLE_BACK = np.array([1, 2, 0, 2, 0, 1]), np.array([2, 0, 1, 1, 2, 0])
"""Indices of the factors of the six products in a vector product."""


def quat_identity(*shape: int, dtype: type = np.float64) -> Array:
    """Identity quaternions of shape ``(*shape, 4)``.

    >>> quat_identity(2).tolist()
    [[0.0, 0.0, 0.0, 1.0], [0.0, 0.0, 0.0, 1.0]]
    """
    q: Array = np.zeros((*shape, 4), dtype)
    q[..., 3] = 1
    return q


def quat_multiply(a: Array, b: Array) -> Array:
    """Hamilton product ``a ⊗ b``: first rotate by ``b``, then by ``a``. Shapes ``(..., 4)`` broadcast."""
    if a.size <= _FEW and b.size <= _FEW:  # the same terms in the same order, so the same bits
        terms = a.take(_OF_A, -1)[..., None, :] * b.take(_OF_B, -1)
        few: Array = np.add.reduce(terms * _SIGNS, -1)
        return few
    ax, ay, az, aw = a[..., 0], a[..., 1], a[..., 2], a[..., 3]
    bx, by, bz, bw = b[..., 0], b[..., 1], b[..., 2], b[..., 3]
    out: Array = np.empty(np.broadcast(a, b).shape, np.result_type(a, b))
    np.subtract(aw * bx + ax * bw + ay * bz, az * by, out=out[..., 0])
    np.add(aw * by - ax * bz + ay * bw, az * bx, out=out[..., 1])
    np.add(aw * bz + ax * by - ay * bx, az * bw, out=out[..., 2])
    np.subtract(aw * bw - ax * bx - ay * by, az * bz, out=out[..., 3])
    return out


def quat_conjugate(q: Array) -> Array:
    """Inverse of unit quaternions ``(..., 4)``."""
    out = np.negative(q)
    out[..., 3] = q[..., 3]
    return out


def quat_normalize(q: Array) -> Array:
    """Scale ``(..., 4)`` to unit length. A zero quaternion becomes the identity."""
    norm = np.sqrt(np.einsum("...i,...i->...", q, q))[..., None]
    return np.where(norm > _SMALL, q / np.maximum(norm, _SMALL), np.array([0, 0, 0, 1], q.dtype))


def vector_normalize(v: Array) -> Array:
    """Scale ``(..., 3)`` to unit length. A zero vector stays zero."""
    return v / np.maximum(np.sqrt(np.einsum("...i,...i->...", v, v))[..., None], _SMALL)


def cross(a: Array, b: Array) -> Array:
    """The vector product of ``(..., 3)``; for few vectors five times as fast as `numpy.cross`."""
    if a.size <= _FEW and b.size <= _FEW:  # the same bits, see `quat_multiply`
        terms = a.take(_CYCLE, -1) * b.take(_CYCLE_BACK, -1)
        few: Array = terms[..., :3] - terms[..., 3:]
        return few
    ax, ay, az, bx, by, bz = a[..., 0], a[..., 1], a[..., 2], b[..., 0], b[..., 1], b[..., 2]
    out: Array = np.empty(np.broadcast(a, b).shape, np.result_type(a, b))
    np.subtract(ay * bz, az * by, out=out[..., 0])
    np.subtract(az * bx, ax * bz, out=out[..., 1])
    np.subtract(ax * by, ay * bx, out=out[..., 2])
    return out


def quat_rotate(q: Array, v: Array) -> Array:
    """Rotate vectors ``v (..., 3)`` by ``q (..., 4)``; batch dimensions broadcast."""
    if q.size <= _FEW and v.size <= _FEW:  # the same bits, see `quat_multiply`
        components = q.take(_CYCLE, -1)
        terms = components * v.take(_CYCLE_BACK, -1)
        t = 2 * (terms[..., :3] - terms[..., 3:])
        terms = components * t.take(_CYCLE_BACK, -1)
        return v + q[..., 3:] * t + (terms[..., :3] - terms[..., 3:])  # type: ignore[no-any-return]
    xyz = q[..., :3]
    t = 2 * cross(xyz, v)
    return v + q[..., 3:] * t + cross(xyz, t)


def quat_continuous(q: Array, axis: int = 0) -> Array:
    """Flip signs so that neighbours along ``axis`` (time) lie on the same half-sphere: the rotation is unchanged."""
    q = np.moveaxis(np.asarray(q), axis, 0)
    if len(q) < 2:
        return np.moveaxis(q.copy(), 0, axis)
    dots = np.einsum("t...i,t...i->t...", q[1:], q[:-1])
    signs = np.concatenate([np.ones_like(dots[:1]), np.cumprod(np.where(dots < 0, -1.0, 1.0), axis=0)])
    return np.moveaxis((q * signs[..., None]).astype(q.dtype, copy=False), 0, axis)


def make_continuous(q: Array) -> Array:
    """`quat_continuous` along the first axis, in place: a copy of hours of motion would need as much memory again.

    >>> make_continuous(np.array([[0.0, 0, 0, 1], [0, 0, 0, -1]]))[:, 3].tolist()
    [1.0, 1.0]
    """
    stream = QuatStream()
    for first in range(0, len(q), _BLOCK):
        q[first : first + _BLOCK] = stream.push(q[first : first + _BLOCK])
    return q


class QuatStream:
    """`quat_continuous` for rotations that come in pieces: the pieces together have the signs of the whole.

    >>> turn = QuatStream()
    >>> q = quat_identity(1)
    >>> np.concatenate([turn.push(q), turn.push(-q), turn.push(q)])[:, 3].tolist()
    [1.0, 1.0, 1.0]
    """

    def __init__(self) -> None:
        self._last: Array | None = None

    def push(self, q: Array) -> Array:
        """Flip the signs of the next rotations ``(T, ..., 4)`` to fit the ones before; returns a new array."""
        if not len(q):
            return q
        result = quat_continuous(q) if self._last is None else quat_continuous(np.concatenate([self._last, q]))[1:]
        self._last = result[-1:].copy()
        return result


def quat_angle(a: Array, b: Array) -> Array:
    """Angle between two rotations, ``(...)`` in radians, 0 … π; accurate for small angles, too."""
    d = quat_multiply(quat_conjugate(a), b)
    return 2 * np.arctan2(np.linalg.norm(d[..., :3], axis=-1), np.abs(d[..., 3]))


def quat_slerp(a: Array, b: Array, t: ArrayLike) -> Array:
    """Shortest-arc interpolation from ``a`` (t = 0) to ``b`` (t = 1); ``t (...)`` broadcasts over ``(..., 4)``."""
    t = np.asarray(t)[..., None]
    dot = np.einsum("...i,...i->...", a, b)[..., None]
    b = np.where(dot < 0, -b, b)
    dot = np.clip(np.abs(dot), 0.0, 1.0)
    angle = np.arccos(dot)
    sin = np.sin(angle)
    near = sin < 1e-6
    safe = np.where(near, 1.0, sin)
    wa = np.where(near, 1 - t, np.sin((1 - t) * angle) / safe)
    wb = np.where(near, t, np.sin(t * angle) / safe)
    return quat_normalize(wa * a + wb * b)


def axis_angle_to_quat(axis: ArrayLike, angle: ArrayLike) -> Array:
    """Quaternions turning by ``angle (...)`` about the *unit* ``axis (..., 3)``."""
    half = np.asarray(angle, float)[..., None] / 2
    axis = np.asarray(axis, float)
    return np.concatenate(np.broadcast_arrays(axis * np.sin(half), np.cos(half) + 0 * axis[..., :1]), -1)[..., :4]


def rotvec_to_quat(v: Array) -> Array:
    """Exponential map: rotation vectors ``(..., 3)`` (axis × angle) → quaternions; stable near zero."""
    v = np.asarray(v)
    angle = np.sqrt(np.einsum("...i,...i->...", v, v))[..., None]
    k = 0.5 * np.sinc(angle / (2 * np.pi))  # sin(a/2)/a, also at 0
    return np.concatenate([k * v, np.cos(angle / 2)], -1)


def quat_to_rotvec(q: Array) -> Array:
    """Logarithm: quaternions → rotation vectors ``(..., 3)`` of length 0 … π."""
    q = np.where(q[..., 3:] < 0, -q, q)
    sin = np.sqrt(np.einsum("...i,...i->...", q[..., :3], q[..., :3]))[..., None]
    angle = 2 * np.arctan2(sin, q[..., 3:])
    return q[..., :3] * np.where(sin > _SMALL, angle / np.maximum(sin, _SMALL), 2.0)


def quat_to_matrix(q: Array) -> Array:
    """Quaternions ``(..., 4)`` → rotation matrices ``(..., 3, 3)``."""
    x, y, z, w = np.moveaxis(np.asarray(q), -1, 0)
    m = np.empty((*x.shape, 3, 3), x.dtype)
    m[..., 0, 0], m[..., 0, 1], m[..., 0, 2] = 1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)
    m[..., 1, 0], m[..., 1, 1], m[..., 1, 2] = 2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)
    m[..., 2, 0], m[..., 2, 1], m[..., 2, 2] = 2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)
    return m


def matrix_to_quat(m: Array) -> Array:
    """Rotation matrices ``(..., 3, 3)`` → quaternions, through the largest of the four components (Shepperd 1978)."""
    m = np.asarray(m)
    d = m[..., 0, 0], m[..., 1, 1], m[..., 2, 2]
    trace = d[0] + d[1] + d[2]
    table = np.empty((*trace.shape, 4, 4), trace.dtype)
    for k, rest in enumerate(((m[..., 2, 1], m[..., 1, 2]), (m[..., 0, 2], m[..., 2, 0]), (m[..., 1, 0], m[..., 0, 1]))):
        table[..., k, 3] = table[..., 3, k] = rest[0] - rest[1]
    table[..., 0, 1] = table[..., 1, 0] = m[..., 1, 0] + m[..., 0, 1]
    table[..., 0, 2] = table[..., 2, 0] = m[..., 2, 0] + m[..., 0, 2]
    table[..., 1, 2] = table[..., 2, 1] = m[..., 2, 1] + m[..., 1, 2]
    table[..., 0, 0], table[..., 1, 1] = 1 + d[0] - d[1] - d[2], 1 - d[0] + d[1] - d[2]
    table[..., 2, 2], table[..., 3, 3] = 1 - d[0] - d[1] + d[2], 1 + trace
    best = np.argmax(np.stack([*d, trace]), 0)
    rows = table.reshape(-1, 4, 4)[np.arange(best.size), best.ravel()]
    return quat_normalize(rows.reshape(*trace.shape, 4))


def euler_to_quat(angles: Array, order: str = "XYZ") -> Array:
    """Intrinsic Euler angles ``(..., n)`` in radians → quaternions; ``order`` names one axis per angle, e.g. ``"ZXY"``."""
    angles = np.asarray(angles, float)
    sin, cos = np.sin(angles / 2), np.cos(angles / 2)
    out = np.zeros((*angles.shape[:-1], 4))
    for k, letter in enumerate(order):
        axis, s, c = _AXIS[letter], sin[..., k], cos[..., k]
        if k:
            before, after = (axis + 1) % 3, (axis + 2) % 3  # the product with a turn about one axis: half of its terms are 0
            x, y, z, w = out[..., axis], out[..., before], out[..., after], out[..., 3]
            product = w * s + x * c, y * c + z * s, z * c - y * s, w * c - x * s
            out[..., axis], out[..., before], out[..., after], out[..., 3] = product
        else:
            out[..., axis], out[..., 3] = s, c
        out += 0.0  # no zero is negative
    return out


def quat_to_euler(q: Array, order: str = "XYZ") -> Array:
    """Quaternions → intrinsic Euler angles ``(..., n)`` in radians, for the orders of one to three different axes.

    The middle one of three angles lies in −π/2 … π/2. At the poles the third angle is set to zero, so the result is always a
    valid (if not unique) answer. One or two angles are those of the nearest rotation about such axes.
    """
    if len(order) < 3:
        return _nearest_euler(q, order)
    i, j, k = (_AXIS[letter] for letter in order)
    sign = 1.0 if (j - i) % 3 == 1 else -1.0
    m = quat_to_matrix(q)
    s = np.clip(sign * m[..., i, k], -1, 1)
    middle = np.arctan2(s, np.hypot(m[..., i, i], m[..., i, j]))
    pole = np.hypot(m[..., i, i], m[..., i, j]) < 1e-9
    first = np.arctan2(-sign * m[..., j, k], m[..., k, k])
    first = np.where(pole, np.arctan2(sign * m[..., k, j], m[..., j, j]), first)
    # Computed from the rest after the first turn, so that both fit each other near the poles, where they are ill-determined.
    cos, sin = np.cos(first), sign * np.sin(first)
    third = np.arctan2(sign * (cos * m[..., j, i] + sin * m[..., k, i]), cos * m[..., j, j] + sin * m[..., k, j])
    return np.stack([first, middle, np.where(pole, 0.0, third)], -1)


def _nearest_euler(q: Array, order: str) -> Array:
    """Angles (..., 1 or 2) whose quaternion has the largest product with ``q``."""
    i, w = _AXIS[order[0]], q[..., 3]
    if len(order) == 1:
        halves = np.arctan2(q[..., i], w)[..., None]
    else:  # (cos a, sin a) M (cos b, sin b)ᵀ of the half angles is the product; the first singular vectors make it largest
        j = _AXIS[order[1]]
        sign = 1.0 if (j - i) % 3 == 1 else -1.0
        m = np.stack([np.stack([w, q[..., j]], -1), np.stack([q[..., i], sign * q[..., 3 - i - j]], -1)], -2)
        u, _, v = np.linalg.svd(m)
        halves = np.stack([np.arctan2(u[..., 1, 0], u[..., 0, 0]), np.arctan2(v[..., 0, 1], v[..., 0, 0])], -1)
    return np.remainder(2 * halves + np.pi, 2 * np.pi) - np.pi


def matrix_to_rot6d(m: Array) -> Array:
    """First two columns of ``(..., 3, 3)``, flattened to ``(..., 6)`` (Zhou et al. 2019)."""
    return np.concatenate([m[..., :, 0], m[..., :, 1]], -1)


def rot6d_to_matrix(r: Array) -> Array:
    """Gram–Schmidt back from ``(..., 6)`` to ``(..., 3, 3)`` (Zhou et al. 2019)."""
    a, b = r[..., :3], r[..., 3:]
    x = a / np.maximum(np.linalg.norm(a, axis=-1, keepdims=True), _SMALL)
    b = b - np.einsum("...i,...i->...", x, b)[..., None] * x
    y = b / np.maximum(np.linalg.norm(b, axis=-1, keepdims=True), _SMALL)
    return np.stack([x, y, cross(x, y)], -1)


def quat_to_rot6d(q: Array) -> Array:
    """Quaternions → 6-d representation."""
    return matrix_to_rot6d(quat_to_matrix(q))


def quat_between(a: Array, b: Array) -> Array:
    """Shortest rotation taking the direction of ``a (..., 3)`` to that of ``b``; opposite vectors turn about some normal."""
    a = a / np.maximum(np.linalg.norm(a, axis=-1, keepdims=True), _SMALL)
    b = b / np.maximum(np.linalg.norm(b, axis=-1, keepdims=True), _SMALL)
    dot = np.einsum("...i,...i->...", a, b)[..., None]
    smallest = np.eye(3)[np.argmin(np.abs(a), -1)]
    normal = cross(a, smallest)
    normal = normal / np.maximum(np.linalg.norm(normal, axis=-1, keepdims=True), _SMALL)
    opposite = dot < -1 + 1e-9
    q = np.concatenate([np.where(opposite, normal, cross(a, b)), np.where(opposite, 0.0, 1 + dot)], -1)
    return quat_normalize(q)


def quat_twist(q: Array, axis: ArrayLike) -> Array:
    """Twist part of ``q`` about the unit ``axis (3,)``: ``q = swing ⊗ twist`` with the swing's axis at right angles."""
    axis = np.asarray(axis, q.dtype)
    along = np.einsum("...i,i->...", q[..., :3], axis)[..., None]
    return quat_normalize(np.concatenate([along * axis, q[..., 3:]], -1))


def continuous_euler(angles: Array, last: Array | None = None) -> Array:
    """Choose, among equivalent Euler angles, those without jumps from row to row.

    ``(a, b, c)`` and ``(a + π, π − b, c + π)`` are the same rotation, and so is any angle plus 2π. Which of the two triples is
    nearer to the row before does not depend on the choice in that row, so that the choices add up (modulo two).

    Args:
        angles: (T, …, n) radians, of one to three different axes.
        last: (…, n) the row before, for which the choice has been made.
    """
    rows = angles if last is None else np.concatenate([last[None], angles])
    rows = np.unwrap(_nearer_twins(rows) if rows.shape[-1] == 3 else rows, axis=0)
    return rows if last is None else rows[1:]


def _nearer_twins(rows: Array) -> Array:
    """Of the two triples of each rotation, the one that is nearer to the row before."""
    twin = np.stack([rows[..., 0] + np.pi, np.pi - rows[..., 1], rows[..., 2] + np.pi], -1)

    def distance(a: Array, b: Array) -> Array:
        return np.abs(np.remainder(a - b + np.pi, 2 * np.pi) - np.pi).sum(-1)

    swap = distance(twin[1:], rows[:-1]) + 1e-9 < distance(rows[1:], rows[:-1])  # 1e-9: ours, ties stay
    odd = (
        np.concatenate([np.zeros_like(swap[:1]), np.cumsum(swap, 0) % 2 == 1]) if len(swap) else np.zeros(rows.shape[:-1], bool)
    )
    return np.where(odd[..., None], twin, rows)
