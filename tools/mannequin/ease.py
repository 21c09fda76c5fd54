"""Weights and places that stretch a surface less: those that were modelled are bettered over many poses.

Linear blending moves a point by the weighted mean of its joints' transforms. So the length of every edge in every pose is a
smooth function of the weights and of where the points lie at rest, and its gradient is cheap. We descend by L-BFGS-B (Byrd et
al. 1995), on the poses that stretch some edge most; more such poses are added from round to round.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize
from scipy.sparse import csr_matrix, diags, identity

from cospeech.motion.rotations import Array

from .net import vertex_normals
from .sculpture import pack_weights, unpack_weights

__all__ = ["LEAST", "Cloth", "Poses", "ease", "place"]

# All ours, by trial: what stretches least without a joint that loses its volume or cloth that looks crumpled.
_POWER, _STEEP = 3, 100.0  # of the price of stretch beyond what is allowed: the worst edges weigh most
_PRESSED, _PUSH = 0.5, 0.05  # length, of that at rest, below which an edge counts as pressed, and the price of its square
_STIFF = 1e-3  # price of weights that change unevenly
_SLID, _RAISED = 0.01, 0.35  # prices of points that are displaced unevenly, in any way and out of the surface: folds are seen
_BENT, _RIPPLED = 0.4, 150.0  # prices of points displaced otherwise than around them, in any way and out of the surface
_HIGH = 3e4  # 1/m²: price of height above or below the surface as sculpted: what is seen of a body that stands is its outline
_SCALE = 1e-3  # price of rows of weights that do not sum to 1 before they are divided by their sum
_NEAR = 100.0  # 1/m²: price of change itself, of that of uneven change
_START, _MORE = 40, 24  # poses looked at in the first round, and added in each later one
_ROUNDS, _STEPS = 7, 160  # rounds, and steps of the descent in each
_FOUR = 2  # round from which a point has four joints
_RINGS = 12  # edges from a point to those whose joints it may follow
_LEVER = 0.02  # metres added to how far a joint carries a point from its place: the unit of its weight
LEAST = (
    1e-4  # of weights that are kept: joints far away, whose small weights still move a point by millimetres, may not drop out
)
_SHORT = 1e-4  # metres: shorter edges are creases that do not count


@dataclass(frozen=True, eq=False)
class Poses:
    """Poses to be ready for.

    Args:
        moves: (P, J, 3, 4) transforms of the joints from the T-pose.
        allowed: (P,) stretch that costs nothing.
        price: (P,) factor of the price of what is beyond.
    """

    moves: Array
    allowed: Array
    price: Array


@dataclass(frozen=True, eq=False)
class Cloth:
    """A surface to ease.

    Args:
        points: (V, 3) as sculpted, metres.
        triangles: (F, 3).
        weights: (V, J), rows sum to 1.
        sculpted: (J, 3, 4) transforms of the joints from the T-pose to the pose of sculpting.
        free: (V,) 0 … 1, how far the weights of each point may change.
        give: (V,) metres that a point may be displaced along each axis.
        barred: (V, J) joints that a point must not follow.
        follow: (V, V), rows sum to 1: of whose weights and displacements each point's are made; those points' own rows are
            of the identity. None for the identity.
        twins: the mirror image of each point (V,) and joint (J,), if the surface is to stay symmetric.
        smooth: factor of the prices of an outline that is not that of the sculpture.
    """

    points: Array
    triangles: Array
    weights: Array
    sculpted: Array
    free: Array
    give: Array
    barred: Array
    follow: csr_matrix | None = None
    twins: tuple[Array, Array] | None = None
    smooth: float = 1.0


def place(points: Array, weights: Array, transforms: Array) -> Array:
    """(V, 3) in the T-pose of points as sculpted."""
    blend = np.einsum("vj,jab->vab", weights, transforms)
    return np.linalg.solve(blend[..., :3], (points - blend[..., 3])[..., None])[..., 0]


def ease(cloth: Cloth, poses: Poses) -> tuple[Array, Array]:
    """Points (V, 3) as sculpted and weights (V, J), at most four a point that follows none, that stretch the edges less."""
    descent = _Descent(cloth, poses)
    points, weights = cloth.points, descent.share(cloth.weights)
    selection: list[int] = []
    best, least = (points, weights), np.inf
    for k in range(_ROUNDS):
        over = descent.over(points, weights)
        selection = _choose(over, [c for c in selection if over[c].any()], _MORE if k else _START)
        if k == _FOUR:
            weights = descent.keep_four(weights)
        points, weights = descent.run(points, weights, np.array(selection))
        if k >= _FOUR and (price := descent.price_all(points, weights)) < least:  # a round may leave others worse than before
            best, least = (points, weights), price
    return best


def _choose(over: Array, selection: list[int], more: int) -> list[int]:
    """Add up to ``more`` poses: each time the one with most stretch (P, E) beyond that of the selected poses."""
    cover = over[selection].max(0, initial=0)
    for _ in range(more):
        gain = np.maximum(over - cover, 0).sum(1)
        best = int(gain.argmax())
        if gain[best] <= 1e-3:
            break
        selection, cover = [*selection, best], np.maximum(cover, over[best])
    return selection


class _Descent:
    """The price of a cloth's weights and displacements, and its gradient."""

    def __init__(self, cloth: Cloth, poses: Poses) -> None:
        self.cloth, self.poses = cloth, poses
        count = len(cloth.points)
        self.follow = identity(count, format="csr") if cloth.follow is None else cloth.follow
        leads = np.asarray(self.follow.sum(0)).ravel() > 0
        rest = place(cloth.points, self.share(cloth.weights), cloth.sculpted)
        self.pairs = _pairs(cloth.triangles, rest)
        rows = np.repeat(np.arange(len(self.pairs)), 2)
        self.ends = csr_matrix((np.tile([1.0, -1.0], len(self.pairs)), (rows, self.pairs.ravel())), (len(self.pairs), count))
        self.gather = self.ends.T.tocsr().astype(np.float32)
        self.lengths = np.linalg.norm(self.ends @ rest, axis=1)
        self.uneven = (self.ends.T @ diags(self.lengths**-2) @ self.ends).tocsr()
        self.hold = np.where(leads, 1 / np.maximum(cloth.free, 1e-3) - 1, 0)
        self.may = self._reach() & (leads & (cloth.free > 0))[:, None]
        self.unit = self._units(rest)
        ripple = self._ripple(leads)
        self.bend = (ripple.T @ ripple).tocsr()
        self.out = vertex_normals(cloth.points, cloth.triangles)
        self.loose = np.flatnonzero(leads & (cloth.give > 0))

    def share(self, own: Array) -> Array:
        """Weights or displacements of all points from those of the points that follow none."""
        return self.follow @ own

    def _ripple(self, leads: Array) -> csr_matrix:
        """(V, V) by how much points are displaced otherwise than their neighbours' mean, per metre of the edges to these."""
        own = leads[self.pairs].all(1)
        ends = abs(self.ends)[own]
        near = (ends.T @ ends).tolil()
        near.setdiag(0)
        count = np.maximum(np.asarray(near.sum(1)).ravel(), 1)
        length = np.maximum(ends.T @ self.lengths[own] / count, _SHORT)
        return (diags(1 / length) @ (diags(leads.astype(float)) - diags(1 / count) @ near)).tocsr()

    def _reach(self) -> Array:
        """(V, J) joints that a point may follow: those of the points around it."""
        near = abs(self.ends.T @ self.ends) + identity(len(self.cloth.points))
        reach = self.cloth.weights > 0
        for _ in range(_RINGS):
            reach = (near @ reach.astype(float)) > 0
        return (reach & ~self.cloth.barred) | (self.cloth.weights > 0)

    def _units(self, rest: Array) -> Array:
        """(V, J) metres by which a joint carries a point from its place, root mean square over poses."""
        moves = self.poses.moves[:: max(1, len(self.poses.moves) // 80)]
        total = np.zeros(self.cloth.weights.shape)
        for move in moves:
            alone = np.einsum("jab,vb->vja", move[..., :3], rest) + move[..., 3]
            away = alone - np.einsum("vj,vja->va", self.cloth.weights, alone)[:, None]
            total += (away**2).sum(2)
        unit = np.sqrt(total / len(moves)) + _LEVER
        return unit if self.cloth.twins is None else (unit + unit[self.cloth.twins[0]][:, self.cloth.twins[1]]) / 2

    def _pose(self, rest: Array, weights: Array, moves: Array) -> tuple[Array, Array]:
        """Points (V, P, 3) in poses, and the blended transforms (V, P, 3, 4)."""
        flat = np.ascontiguousarray(moves.transpose(1, 0, 2, 3), np.float32).reshape(weights.shape[1], -1)
        blend = (weights.astype(np.float32) @ flat).reshape(len(rest), -1, 3, 4)
        return np.einsum("vpab,vb->vpa", blend[..., :3], rest.astype(np.float32)) + blend[..., 3], blend

    def ratios(self, points: Array, weights: Array, moves: Array) -> Array:
        """(P, E) lengths of the edges in poses, of those at rest."""
        rest = place(points, weights, self.cloth.sculpted)
        lengths = np.linalg.norm(self.ends @ rest, axis=1)
        parts = []
        for start in range(0, len(moves), 64):
            places, _ = self._pose(rest, weights, moves[start : start + 64])
            apart = places[self.pairs[:, 0]] - places[self.pairs[:, 1]]
            parts.append(np.sqrt(np.einsum("epa,epa->ep", apart, apart)).T / lengths)
        return np.concatenate(parts)

    def over(self, points: Array, weights: Array) -> Array:
        """(P, E) stretch beyond what is allowed, in all poses."""
        return np.maximum(self.ratios(points, weights, self.poses.moves) - 1 - self.poses.allowed[:, None], 0)

    def price_all(self, points: Array, weights: Array) -> float:
        """Of the worst that each edge has to bear in any pose, with the weights as a file keeps them."""
        weights = unpack_weights(*pack_weights(weights, LEAST), weights.shape[1])
        return float((self.poses.price[:, None] * self.over(points, weights) ** _POWER).max(0).sum())

    def keep_four(self, weights: Array) -> Array:
        """Let each point follow its four joints of most weight alone from now on."""
        order = np.argsort(-weights, axis=1, kind="stable")[:, :4]
        most = np.zeros(weights.shape, bool)
        np.put_along_axis(most, order, True, 1)
        self.may &= most & (weights > 0.002)
        weights = np.where(self.may.any(1)[:, None] & ~self.may, 0, weights)
        return self.share(weights / weights.sum(1, keepdims=True))

    def run(self, points: Array, weights: Array, selection: Array) -> tuple[Array, Array]:
        """Descend on the poses of ``selection`` (indices)."""
        first = np.concatenate([(weights * self.unit)[self.may], (points - self.cloth.points)[self.loose].ravel()])
        give = np.repeat(self.cloth.give[self.loose], 3)
        bounds = [(0.0, None)] * int(self.may.sum()) + list(zip(-give, give, strict=True))
        options = {"maxiter": _STEPS, "maxcor": 12}
        result = minimize(self._price, first, (selection,), "L-BFGS-B", jac=True, bounds=bounds, options=options)
        points, own, _ = self._unpack(result.x)
        return points, self.share(own)

    def _unpack(self, values: Array) -> tuple[Array, Array, Array]:
        """Points, weights of those that follow none, and the sums (V,) by which these were divided."""
        count, own = int(self.may.sum()), np.zeros(self.may.shape)
        own[self.may] = values[:count] / self.unit[self.may] + 1e-6  # no row of zeros in a step that is too long
        moving = self.may.any(1)
        total = np.where(moving, own.sum(1), 1)
        own = np.where(moving[:, None], own / total[:, None], self.cloth.weights)
        shifts = np.zeros(self.cloth.points.shape)
        shifts[self.loose] = values[count:].reshape(-1, 3)
        return self.cloth.points + self.share(shifts), own, total

    def _price(self, values: Array, selection: Array) -> tuple[float, Array]:
        """Price of the free values, and its gradient."""
        points, own, total = self._unpack(values)
        weights = self.share(own)
        price, by_weight, by_point = self._price_stretch(points, weights, selection)
        change, shifts = (weights - self.share(self.cloth.weights)) * self.unit, points - self.cloth.points
        back = self.uneven @ change + _NEAR * self.hold[:, None] * change
        price += _STIFF * float((change * back).sum())
        by_weight = self.follow.T @ (by_weight + 2 * _STIFF * back * self.unit)
        smooth, heights = self.cloth.smooth, (shifts * self.out).sum(1, keepdims=True)
        back = _SLID * (self.uneven @ shifts + _NEAR * shifts) + smooth * _BENT * (self.bend @ shifts)
        price, by_point = price + float((shifts * back).sum()), by_point + 2 * back
        back = _RAISED * (self.uneven @ heights + _NEAR * heights) + smooth * (
            _RIPPLED * (self.bend @ heights) + _HIGH * heights
        )
        price, by_point = price + float((heights * back).sum()), by_point + 2 * back * self.out
        by_point = self.follow.T @ by_point
        by_weight = (by_weight - (by_weight * own).sum(1, keepdims=True)) / total[:, None]
        price += _SCALE * float(((total - 1) ** 2).sum())
        by_weight = (by_weight + 2 * _SCALE * (total - 1)[:, None]) / self.unit
        if self.cloth.twins is not None:
            point, joint = self.cloth.twins
            by_weight = (by_weight + by_weight[point][:, joint]) / 2
            by_point = (by_point + by_point[point] * [-1, 1, 1]) / 2
        return price, np.concatenate([by_weight[self.may], by_point[self.loose].ravel()])

    def _price_stretch(self, points: Array, weights: Array, selection: Array) -> tuple[float, Array, Array]:
        """Price of the edges' lengths in poses, and its gradient by weights (V, J) and by points as sculpted (V, 3)."""
        moves, allowance, factor = self.poses.moves[selection], self.poses.allowed[selection], self.poses.price[selection]
        transforms = self.cloth.sculpted
        rest = place(points, weights, transforms)
        apart = self.ends @ rest
        lengths = np.linalg.norm(apart, axis=1)[:, None]
        places, blend = self._pose(rest, weights, moves)
        between = places[self.pairs[:, 0]] - places[self.pairs[:, 1]]
        now = np.sqrt(np.einsum("epa,epa->ep", between, between))
        ratio = now / lengths
        over, lack = np.maximum(ratio - 1 - allowance, 0), np.maximum(_PRESSED - ratio, 0)
        short = np.maximum(_PRESSED - lengths[:, 0] / self.lengths, 0)  # at rest, of the length as sculpted
        price = _STEEP * float((factor * over**_POWER).sum() + (short**2).sum()) + _PUSH * float((lack**2).sum())
        slope = _STEEP * _POWER * factor * over ** (_POWER - 1) - 2 * _PUSH * lack
        pull = (slope / lengths / np.maximum(now, 1e-9)).astype(np.float32)[:, :, None] * between
        force = (self.gather @ pull.reshape(len(pull), -1)).reshape(places.shape)
        tension = (slope * ratio).sum(1) / lengths[:, 0] ** 2 + 2 * _STEEP * short / (self.lengths * lengths[:, 0])
        by_rest = self.ends.T @ (-tension[:, None] * apart)
        by_rest = by_rest + np.einsum("vpab,vpa->vb", blend[..., :3], force)
        turns = np.einsum("vj,jab->vba", weights, transforms[..., :3])
        by_point = np.linalg.solve(turns, by_rest[..., None])[..., 0]
        flat = np.ascontiguousarray(moves.transpose(0, 2, 1, 3), np.float32).reshape(3 * len(moves), -1)
        torque = (force.reshape(len(force), -1) @ flat).reshape(len(force), -1, 4).astype(float)
        by_weight = np.einsum("vjb,vb->vj", torque[..., :3], rest) + torque[..., 3]
        alone = np.einsum("jab,vb->vja", transforms[..., :3], rest) + transforms[..., 3]
        return price, by_weight - np.einsum("vja,va->vj", alone, by_point), by_point


def _pairs(triangles: Array, points: Array) -> Array:
    """(E, 2) the edges of some length, each once."""
    pairs = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    pairs = np.unique(np.sort(pairs, 1), axis=0)
    return pairs[np.linalg.norm(points[pairs[:, 0]] - points[pairs[:, 1]], axis=1) > _SHORT]
