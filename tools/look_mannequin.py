"""Contact sheets of the mannequin, drawn by a small painter of our own, to be looked at.

python tools/look_mannequin.py OUT_FOLDER [body] [hands] [face] [morphs]
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from mannequin.modelling import sculpt
from PIL import Image, ImageDraw

from cospeech.export import mannequin
from cospeech.motion.rotations import euler_to_quat, quat_identity
from cospeech.motion.skeletons.arkit import ARKIT, ARKIT_INDEX

KEY = np.array([0.45, 0.6, 0.75])
FILL = np.array([-0.7, 0.1, 0.4])


def _edge(u, v, p):
    """Twice the area of the triangles u v p."""
    return (v[:, 0] - u[:, 0]) * (p[:, 1] - u[:, 1]) - (v[:, 1] - u[:, 1]) * (p[:, 0] - u[:, 0])


def rasterise(points, depth, triangles, size):
    """Index of the nearest triangle and barycentric coordinates per pixel."""
    width, height = size
    a, b, c = (points[triangles[:, k]] for k in range(3))
    area = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    low = np.floor(np.minimum(np.minimum(a, b), c)).astype(int)
    high = np.ceil(np.maximum(np.maximum(a, b), c)).astype(int)
    low, high = np.maximum(low, 0), np.minimum(high, [width - 1, height - 1])
    span = np.maximum(high - low + 1, 0)
    count = np.where(area < -1e-9, span[:, 0] * span[:, 1], 0)
    near = np.full(width * height, np.inf)
    best = np.full(width * height, -1)
    bary = np.zeros((width * height, 3))
    order = np.flatnonzero(count)
    for part in np.array_split(order, max(1, int(count.sum() // 3_000_000) + 1)):
        tri = np.repeat(part, count[part])
        k = np.arange(len(tri)) - np.repeat(np.cumsum(count[part]) - count[part], count[part])
        x, y = low[tri, 0] + k % span[tri, 0], low[tri, 1] + k // span[tri, 0]
        p = np.stack([x + 0.5, y + 0.5], 1)

        A, B, C = a[tri], b[tri], c[tri]
        w = np.stack([_edge(B, C, p), _edge(C, A, p), _edge(A, B, p)], 1) / area[tri, None]
        inside = (w >= -1e-9).all(1)
        tri, w, pixel = tri[inside], w[inside], (y * width + x)[inside]
        z = (depth[triangles[tri]] * w).sum(1)
        np.minimum.at(near, pixel, z)
        win = z <= near[pixel]
        best[pixel[win]], bary[pixel[win]] = tri[win], w[win]
    return best, bary


def paint(vertices, normals, parts, eye, target, size=(500, 700), lens=2.4, back=(0.80, 0.82, 0.85), zoom=2):
    """A picture of parts whose vertices are posed; ``lens`` is the focal length in half picture heights."""
    width, height = size[0] * zoom, size[1] * zoom
    forward = np.asarray(target, float) - eye
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, [0, 1, 0])
    right /= np.linalg.norm(right)
    view = np.stack([right, np.cross(right, forward), forward])
    starts = np.cumsum([0, *(len(p) for p in vertices)])
    points, normals = np.concatenate(vertices), np.concatenate(normals)
    colours = np.concatenate([np.broadcast_to(p.colour, p.vertices.shape) for p in parts])
    gloss = np.concatenate([np.full(len(p.vertices), 1 - p.roughness) for p in parts])
    triangles = np.concatenate([p.triangles + s for p, s in zip(parts, starts, strict=False)])
    local = (points - eye) @ view.T
    screen = local[:, :2] / local[:, 2:] * lens * height / 2 * [1, -1] + [width / 2, height / 2]
    best, bary = rasterise(screen, local[:, 2], triangles, (width, height))
    hit = best >= 0
    corner = triangles[best[hit]]

    def mix(values):
        return np.einsum("pk,pk...->p...", bary[hit], values[corner])

    n = mix(normals)
    n /= np.maximum(np.linalg.norm(n, axis=1, keepdims=True), 1e-9)
    sight = eye - mix(points)
    sight /= np.linalg.norm(sight, axis=1, keepdims=True)
    basis = np.stack([right, view[1], -forward])
    key, fill = (v / np.linalg.norm(v) @ basis for v in (KEY, FILL))
    light = 0.34 + 0.10 * n[:, 1] + 0.62 * np.maximum((n @ key) * 0.9 + 0.1, 0) + 0.16 * np.maximum(n @ fill, 0)
    half = key + sight
    half /= np.linalg.norm(half, axis=1, keepdims=True)
    shine = mix(gloss) * np.maximum((n * half).sum(1), 0) ** 40
    rim = 0.10 * (1 - np.clip((n * sight).sum(1), 0, 1)) ** 3
    image = np.empty((height * width, 3))
    image[:] = np.asarray(back) ** 2.2
    image[hit] = mix(colours) * light[:, None] + (shine + rim * 0.6)[:, None]
    image = np.clip(image, 0, 1) ** (1 / 2.2) * 255
    return Image.fromarray(image.reshape(height, width, 3).astype(np.uint8)).resize(size, Image.LANCZOS)


def pose(skeleton, **degrees):
    """World rotations and positions of a pose given as joint → intrinsic XYZ degrees."""
    rotations = quat_identity(len(skeleton))
    for name, angles in degrees.items():
        rotations[skeleton.index[name]] = euler_to_quat(np.radians(angles), "XYZ")
    positions, world = skeleton.forward(rotations, skeleton.offsets[0])
    return world, positions


def both(**left):
    """Left-side joint angles and their mirror images."""
    out = {}
    for name, (x, y, z) in left.items():
        out["left" + name], out["right" + name] = (x, y, z), (x, -y, -z)
    return out


def fingers(curl, thumb=(0, 0, 0), spread=0.0, only=("Index", "Middle", "Ring", "Little")):
    """Curl of the four fingers in degrees (three joints) and of the thumb."""
    out = {}
    for k, f in enumerate(("Index", "Middle", "Ring", "Little")):
        c = curl if f in only else (4, 4, 3)
        for joint, angle in zip(("Proximal", "Intermediate", "Distal"), c, strict=True):
            out[f + joint] = (0, spread * (1.5 - k) * -1 if joint == "Proximal" else 0, -angle)
    for joint, angle in zip(("Metacarpal", "Proximal", "Distal"), thumb, strict=True):
        out["Thumb" + joint] = (angle * 0.5, angle * 0.87, 0)
    return out


HANG = both(UpperArm=(0, -8, -76), LowerArm=(0, -22, 0), Hand=(0, 0, 0)) | both(**fingers((18, 22, 14), (10, 8, 8)))


def draw_shot(character, world, positions, face=None, only="", **camera):
    """One picture; ``only`` keeps the parts with that in their name."""
    vertices, normals = mannequin.skin_with_normals(character, world, positions, face)
    keep = [k for k, part in enumerate(character.parts) if only in part.name]
    return paint([vertices[k] for k in keep], [normals[k] for k in keep], [character.parts[k] for k in keep], **camera)


def sheet(pictures, columns, labels=None):
    w, h = pictures[0].size
    rows = -(-len(pictures) // columns)
    out = Image.new("RGB", (w * columns, h * rows), "white")
    draw = ImageDraw.Draw(out)
    for k, picture in enumerate(pictures):
        at = (k % columns * w, k // columns * h)
        out.paste(picture, at)
        if labels:
            draw.text((at[0] + 6, at[1] + 4), labels[k], fill=(20, 20, 20))
    return out


def around(target, distance, turn, lift=0.0):
    t, e = np.radians(turn), np.radians(lift)
    return np.asarray(target) + distance * np.array([np.sin(t) * np.cos(e), np.sin(e), np.cos(t) * np.cos(e)])


def body(character, folder):
    s, t = character.skeleton, np.array([0, 0.88, 0])
    hang = pose(s, **HANG)
    pictures = [
        draw_shot(character, *hang, eye=around(t, 5, a, 4), target=t, size=(420, 780), lens=5) for a in (0, 40, 90, 180)
    ]
    sheet(pictures, 4).save(folder / "body.png")
    poses = {
        "tpose": pose(s),
        "gesture": pose(
            s,
            **HANG
            | {
                "leftUpperArm": (20, -45, -50),
                "leftLowerArm": (-50, -80, 0),
                "rightUpperArm": (0, 30, 60),
                "rightLowerArm": (-70, 105, 0),
                "head": (0, 30, 5),
                "chest": (0, 12, 0),
            },
        ),
        "raise": pose(s, **HANG | {"leftUpperArm": (0, 0, 40), "rightUpperArm": (0, 70, 0), "spine": (20, 0, 8)}),
        "twist": pose(s, **HANG | both(UpperArm=(0, 0, -70), LowerArm=(0, -95, 0), Hand=(80, 0, 0)) | {"neck": (0, 40, 0)}),
    }
    pictures = [
        draw_shot(character, *p, eye=around([0, 1.25, 0], 4, 25, 4), target=[0, 1.25, 0], size=(620, 520), lens=6.2)
        for p in poses.values()
    ]
    sheet(pictures, 2, list(poses)).save(folder / "poses.png")


def hands(character, folder):
    s = character.skeleton
    poses = {
        "flat": {},
        "relaxed": both(**fingers((22, 28, 18), (12, 10, 10))),
        "fist": both(**fingers((85, 95, 60), (25, 35, 45))),
        "point": both(**fingers((85, 95, 60), (20, 30, 30), only=("Middle", "Ring", "Little"))),
        "spread": both(**fingers((2, 4, 2), (-12, -4, -4), spread=9)),
    }
    pictures, labels = [], []
    for name, degrees in poses.items():
        world, positions = pose(s, **degrees)
        t = positions[s.index["leftHand"]] + [0.07, -0.01, 0.01]
        for side, eye in {"back": [0.0, 0.5, 0.12], "palm": [0.05, -0.42, 0.30], "thumb": [0.15, 0.12, 0.5]}.items():
            pictures.append(
                draw_shot(character, world, positions, only="Hand", eye=t + eye, target=t, size=(430, 330), lens=4.2)
            )
            labels.append(f"{name} {side}")
    sheet(pictures, 3, labels).save(folder / "hands.png")


def face(character, folder):
    s = character.skeleton
    world, positions = pose(s)
    t = positions[s.index["head"]] + [0, 0.07, 0.02]
    pictures = [
        draw_shot(character, world, positions, eye=around(t, 1.1, a, e), target=t, size=(560, 600), lens=6.0)
        for a, e in ((0, 2), (35, 4), (90, 0), (-25, -18), (180, 10), (20, 40))
    ]
    sheet(pictures, 3).save(folder / "face.png")


def morphs(character, folder, names=ARKIT, file="morphs.png"):
    s = character.skeleton
    world, positions = pose(s)
    t = positions[s.index["head"]] + [0, 0.06, 0.02]
    pictures = []
    for name in names:
        weights = np.zeros(len(ARKIT))
        for one in name.split("+"):
            weights[ARKIT_INDEX[one]] = 1
        pictures.append(
            draw_shot(character, world, positions, weights, eye=around(t, 1.1, 18, 2), target=t, size=(300, 300), lens=7.4)
        )
    sheet(pictures, 6, list(names)).save(folder / file)


if __name__ == "__main__":
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    figure = sculpt() if "sculpt" in sys.argv else mannequin.build()
    for name in sys.argv[2:] or ("body", "hands", "face", "morphs"):
        if name != "sculpt":
            {"body": body, "hands": hands, "face": face, "morphs": morphs}[name](figure, folder)
