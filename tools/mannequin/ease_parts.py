"""What of each part may give way when it is eased: bare skin a little, cloth more, seams and what is sewn on with the cloth."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from cospeech.export.mannequin.character import Part
from cospeech.motion.motion import Motion
from cospeech.motion.rotations import Array, quat_to_matrix
from cospeech.motion.skeleton import humanoid
from cospeech.motion.skeletons.humanoid import MIRROR

from .ease import LEAST, Cloth, Poses, ease, place
from .net import smoothstep, vertex_normals
from .poses import build_finger_poses, build_limit_poses, build_speaking_poses
from .sculpture import mirror_part, pack_weights, sculpt_pose, unpack_weights

__all__ = ["ease_parts"]

# Stretch that costs nothing, and the price of more, in poses of the rules and at limits; ours.
SKIN_PAYS, CLOTH_PAYS = ((0.22, 30.0), (0.24, 10.0)), ((0.19, 90.0), (0.26, 4.0))
RANDOM, RANDOM_HANDS = 600, 1200  # poses at limits; ours: fingers have more ways to bend than limbs
SKIN_GIVES, SLEEVES_GIVE, SHIRT_GIVES, TROUSERS_GIVE = 0.002, 0.007, 0.005, 0.0055  # metres, along each axis; ours
STITCH = 0.018  # metres around a point that is sewn on from which it takes its weights; ours
SLEEVE = 0.20  # metres from the middle, where the sleeves begin
BELT = 0.9995  # height of the belt's lower edge, metres
TUCKED = 1.040  # height up to which the shirt is tucked in, metres
KNEES_REACH = 0.80  # height to which the weights of lower legs reach, metres; ours
MIDDLE = 0.06  # metres on the other side of the middle to which a limb's weights reach; ours


def ease_parts(parts: list[Part]) -> list[Part]:
    """The parts with bare skin and the clothes, with weights and places that stretch them less."""
    by_name = {part.name: part for part in parts}
    by_name["face"] = _ease_neck(by_name["face"])
    by_name["leftHand"] = _ease_hand(by_name["leftHand"])
    by_name["rightHand"] = mirror_part(by_name["leftHand"], "rightHand")
    clothes = ("shirt", "pocket", "trousers")
    by_name |= dict(zip(clothes, _ease_clothes([by_name[name] for name in clothes]), strict=True))
    return list(by_name.values())


def _ease_neck(face: Part) -> Part:
    """What makes faces follows the head alone, so only the neck's weights change."""
    joints = _indices(lambda name: name in ("upperChest", "neck", "head"))
    free = smoothstep(1.530, 1.500, face.vertices[:, 1])
    (result,) = _ease([face], joints, _poses(joints, build_limit_poses(RANDOM, 0), SKIN_PAYS), free, np.zeros(len(free)))
    return result


def _ease_hand(hand: Part) -> Part:
    """The left hand; the forearm stays in its sleeve."""
    fingers = ("Hand", "Thumb", "Index", "Middle", "Ring", "Little")
    joints = _indices(lambda name: name == "leftLowerArm" or name.startswith(tuple("left" + part for part in fingers)))
    out = hand.vertices[:, 0] - humanoid().tpose[humanoid().index["leftHand"], 0]
    free = smoothstep(-0.12, -0.06, out)
    limits = np.concatenate([build_limit_poses(RANDOM_HANDS, 1), build_finger_poses()])
    (result,) = _ease([hand], joints, _poses(joints, limits, SKIN_PAYS, both=True), free, SKIN_GIVES * free)
    return result


def _ease_clothes(parts: list[Part]) -> list[Part]:
    """Shirt, pocket and trousers as one cloth: the shirt's tucked rows follow the belt."""
    joints = np.flatnonzero(sum(unpack_weights(p.joints, p.weights).any(0) for p in parts))
    points, rest = _as_sculpted(parts), np.concatenate([p.vertices for p in parts]).astype(float)
    shirt = np.arange(len(points)) < len(parts[0].vertices)
    trousers = np.arange(len(points)) >= len(points) - len(parts[2].vertices)
    pieces = _pieces(parts)
    cloth, legs = (pieces == np.bincount(pieces[of]).argmax() for of in (shirt, trousers))
    is_tucked = cloth & (points[:, 1] < TUCKED) & (np.abs(points[:, 0]) < SLEEVE)
    belt, open_ = legs & (rest[:, 1] > BELT), cloth & ~is_tucked
    sewn = [(is_tucked, belt), (~cloth & ~trousers, open_), (trousers & ~legs, legs)]
    leads = open_ | legs
    follow = _follow(points, leads, sewn)
    x, y, front = np.abs(points[:, 0]), points[:, 1], points[:, 2] > 0.04
    free = smoothstep(0.55, 0.52, np.abs(rest[:, 0])) * np.where(trousers, smoothstep(0.12, 0.20, y), 1)  # cuffs stay
    plain = smoothstep(1.05, 1.08, y) * smoothstep(0.03, 0.06, x) * np.where(x < SLEEVE, smoothstep(1.40, 1.36, y), 1)
    plain *= np.where(front, 1 - 0.85 * smoothstep(0.16, 0.13, x), 1)  # the chest less: pocket and placket lie on it
    give = np.where(
        trousers, TROUSERS_GIVE * smoothstep(0.99, 0.96, y), np.where(x > SLEEVE, SLEEVES_GIVE, SHIRT_GIVES) * plain
    )
    side = np.array([{"l": 1, "r": -1}.get(humanoid().names[j][0], 0) for j in joints])
    is_barred = points[:, :1] * side < -MIDDLE
    is_barred |= (y > KNEES_REACH)[:, None] & np.array(["LowerLeg" in humanoid().names[j] for j in joints])
    twins = _twins(points, leads), np.searchsorted(joints, _mirror_joints()[joints])
    poses = _poses(joints, build_limit_poses(RANDOM, 2), CLOTH_PAYS)
    return _ease(parts, joints, poses, free * leads, give * free * leads, is_barred, follow, twins)


def _indices(predicate: Callable[[str], bool]) -> Array:
    return np.array([k for k, name in enumerate(humanoid().names) if predicate(name)])


def _mirror_joints() -> Array:
    """(J,) the joint on the other side."""
    index = humanoid().index
    return np.array([index[MIRROR.get(name, name)] for name in humanoid().names])


def _poses(joints: Array, limits: Array, pays: tuple[tuple[float, float], ...], both: bool = False) -> Poses:
    """Of the rules, mirrored too if ``both``, and ``limits``; only the joints (J',) move."""
    speaking = build_speaking_poses()
    if both:
        motion = Motion(30.0, speaking, np.tile(humanoid().offsets[0], (len(speaking), 1)))
        speaking = np.concatenate([speaking, motion.mirror().rotations])
    local = np.concatenate([speaking, limits])
    still = np.ones(len(humanoid()), bool)
    still[joints[1:]] = False  # the chain's first joint carries it all
    local[:, still] = [0, 0, 0, 1]
    allowance, price = (np.repeat(pair, (len(speaking), len(limits))) for pair in zip(*pays, strict=True))
    positions, world = humanoid().forward(local, np.tile(humanoid().offsets[0], (len(local), 1)))
    return Poses(_moves(positions, quat_to_matrix(world))[:, joints], allowance, price)


def _moves(positions: Array, turns: Array) -> Array:
    """(..., J, 3, 4) transforms from the T-pose of joints at positions (..., J, 3) with rotation matrices (..., J, 3, 3)."""
    shift = positions - np.einsum("...jab,jb->...ja", turns, humanoid().tpose)
    return np.concatenate([turns, shift[..., None]], -1)


def _sculpted() -> Array:
    return _moves(sculpt_pose().positions, sculpt_pose().turns)


def _as_sculpted(parts: list[Part]) -> Array:
    """(V, 3) points of all parts in the pose of sculpting."""
    blend = np.concatenate([np.einsum("vj,jab->vab", unpack_weights(p.joints, p.weights), _sculpted()) for p in parts])
    rest = np.concatenate([p.vertices for p in parts])
    return np.einsum("vab,vb->va", blend[..., :3], rest) + blend[..., 3]


def _triangles(parts: list[Part]) -> Array:
    starts = np.cumsum([0, *(len(p.vertices) for p in parts)])
    return np.concatenate([p.triangles + start for p, start in zip(parts, starts, strict=False)])


def _pieces(parts: list[Part]) -> Array:
    """(V,) the number of the connected piece of each point."""
    triangles, count = _triangles(parts), sum(len(p.vertices) for p in parts)
    pairs = np.concatenate([triangles[:, :2], triangles[:, 1:]])
    return connected_components(csr_matrix((np.ones(len(pairs)), pairs.T), (count, count)))[1]


def _follow(points: Array, leads: Array, sewn: list[tuple[Array, Array]]) -> csr_matrix:
    """`Cloth.follow`: points that lead, and points (V,) bool that are sewn to others (V,) bool."""
    own = np.flatnonzero(leads)
    rows, columns, shares = [own], [own], [np.ones(len(own))]
    for sewn_on, below in sewn:
        distance, nearest = cKDTree(points[below]).query(points[sewn_on], 4)
        share = np.exp(-((distance / STITCH) ** 2)) + 1e-9
        rows.append(np.repeat(np.flatnonzero(sewn_on), 4))
        columns.append(np.flatnonzero(below)[nearest].ravel())
        shares.append((share / share.sum(1, keepdims=True)).ravel())
    entries = np.concatenate(shares), (np.concatenate(rows), np.concatenate(columns))
    return csr_matrix(entries, (len(points), len(points)))


def _twins(points: Array, leads: Array) -> Array:
    """(V,) the point that mirrors each; points that follow others are their own."""
    own, twins = np.flatnonzero(leads), np.arange(len(points))
    twins[own] = own[cKDTree(points[own]).query(points[own] * [-1, 1, 1])[1]]
    return twins


def _ease(
    parts: list[Part],
    joints: Array,
    poses: Poses,
    free: Array,
    give: Array,
    is_barred: Array | None = None,
    follow: csr_matrix | None = None,
    twins: tuple[Array, Array] | None = None,
) -> list[Part]:
    """The parts eased as one cloth, whose weights are all of the joints (J',)."""
    points, transforms = _as_sculpted(parts), _sculpted()
    weights = np.concatenate([unpack_weights(p.joints, p.weights) for p in parts])
    is_barred = np.zeros((len(points), len(joints)), bool) if is_barred is None else is_barred
    smooth = float(follow is not None)  # cloth; skin gives so little that it is not seen
    triangles, own_weights = _triangles(parts), weights[:, joints]
    cloth = Cloth(points, triangles, own_weights, transforms[joints], free, give, is_barred, follow, twins, smooth)
    places, own = ease(cloth, poses)
    weights = np.zeros_like(weights)
    weights[:, joints] = own
    slides = np.ones(len(points), bool) if follow is None else follow.diagonal() == 1  # what is sewn on is carried along
    weights = _keep_four(weights, _pieces(parts), slides)
    ends = np.cumsum([len(p.vertices) for p in parts])[:-1]
    return [
        _renew(part, *pieces)
        for part, *pieces in zip(parts, *(np.split(a, ends) for a in (points, places, weights, slides)), strict=True)
    ]


def _keep_four(weights: Array, pieces: Array, slides: Array) -> Array:
    """Weights (V, J) of which those of each piece that is sewn on are of the same four joints: its edges are short."""
    weights = weights.copy()
    for piece in np.setdiff1d(pieces, pieces[slides]):
        own = pieces == piece
        few = np.argsort(-weights[own].sum(0), kind="stable")[4:]
        weights[np.ix_(own, few)] = 0
    return weights / weights.sum(1, keepdims=True)


def _renew(part: Part, old: Array, points: Array, weights: Array, slides: Array) -> Part:
    """The part with other weights (V, J) and with points as sculpted that lay at ``old``; ``slides``: which slid along it."""
    joints, four = pack_weights(weights, LEAST)
    transforms, all_weights = _sculpted(), unpack_weights(joints, four)
    before, now = (
        np.einsum("vj,jab->vab", w, transforms[..., :3]) for w in (unpack_weights(part.joints, part.weights), all_weights)
    )
    normals = np.linalg.solve(before.transpose(0, 2, 1), part.normals[..., None])[..., 0]
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    total = normals + vertex_normals(points, part.triangles) - vertex_normals(old, part.triangles)
    total = np.where(slides[:, None], _slide_normals(part.triangles, old, normals, points), total)
    normals = np.einsum("vba,vb->va", now, total)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    vertices = place(points, all_weights, transforms)
    return replace(part, vertices=vertices.astype(np.float32), normals=normals.astype(np.float32), joints=joints, weights=four)


def _slide_normals(triangles: Array, old: Array, normals: Array, points: Array) -> Array:
    """(V, 3) normals of points that slid along a surface, where they lie on it now, turned as it was where points rose.

    Those of the triangles between the points would show them: they are uneven once they slid.
    """
    out = vertex_normals(old, triangles)
    shifts = points - old
    rises = (shifts * out).sum(1, keepdims=True) * out
    normals = normals + vertex_normals(old + rises, triangles) - out
    corner = csr_matrix((np.ones(triangles.size), (triangles.ravel(), np.repeat(np.arange(len(triangles)), 3))))
    corner.resize(len(old), len(triangles))
    around = (corner @ corner.T @ corner).tocsr()
    result = normals.copy()
    for k in np.flatnonzero(np.abs(shifts).max(1) > 1e-6):
        near = triangles[around.indices[around.indptr[k] : around.indptr[k + 1]]]
        a, b, c = (old[near[:, m]] for m in range(3))
        u, v, w = b - a, c - a, points[k] - rises[k] - a
        uu, uv, vv, uw, vw = ((f * g).sum(1) for f, g in ((u, u), (u, v), (v, v), (u, w), (v, w)))
        area = np.maximum(uu * vv - uv * uv, 1e-18)
        share = np.stack([vv * uw - uv * vw, uu * vw - uv * uw], 1) / area[:, None]
        share = np.maximum(np.column_stack([1 - share.sum(1), share]), 0)
        share /= share.sum(1, keepdims=True)
        away = np.linalg.norm(np.einsum("fk,fka->fa", share, old[near]) - points[k] + rises[k], axis=1)
        best = int(away.argmin())
        result[k] = share[best] @ normals[near[best]]
    return result
