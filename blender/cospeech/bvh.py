"""A rig as a BVH file, and the rotations that a BVH file holds. It needs no Blender."""

from __future__ import annotations

import re
from typing import NamedTuple

import numpy as np

__all__ = ["Frames", "read_bvh", "rig_to_bvh"]

CENTIMETRES = 100.0
NEAR_FLOOR = 0.03  # of the height; ours: the tip of a bone that is nearer to the floor is a toe, which stands on it
LEAST_COSINE = 0.5  # to the bone before; ours: fingers, toes and heads bend less than 60 degrees in a rest pose


class Frames(NamedTuple):
    """The motion of a BVH file.

    Args:
        names: of the J joints.
        rotations: (T, J, 3, 3) of each joint in the world, from the rest pose of the file.
        root: (T, 3) place of the first joint, metres.
        fps: frames per second.
    """

    names: list[str]
    rotations: np.ndarray
    root: np.ndarray
    fps: float


def rig_to_bvh(names: list[str], parents: list[int], heads: np.ndarray, tails: np.ndarray) -> str:
    """A BVH file with one frame, in which a rig has its rest pose.

    Args:
        names: of the J bones, parents first; without blanks, each once.
        parents: index of each, −1 for the first alone.
        heads, tails: (J, 3) metres, Y up.
    """
    children: list[list[int]] = [[] for _ in names]
    for bone, parent in enumerate(parents):
        if parent >= 0:
            children[parent].append(bone)
    lines = ["HIERARCHY"]

    def write(bone: int, depth: int) -> None:
        pad, parent = "  " * depth, parents[bone]
        offset = heads[bone] if parent < 0 else heads[bone] - heads[parent]
        place = "Xposition Yposition Zposition " if parent < 0 else ""
        lines.append(f"{pad}{'ROOT' if parent < 0 else 'JOINT'} {names[bone]}")
        lines.append(f"{pad}{{")
        lines.append(f"{pad}  OFFSET {_row(offset)}")
        lines.append(f"{pad}  CHANNELS {6 if place else 3} {place}Zrotation Xrotation Yrotation")
        for child in children[bone]:
            write(child, depth + 1)
        if not children[bone]:
            end = _tip(heads[bone] - heads[parent] if parent >= 0 else heads[bone], tails[bone] - heads[bone])
            low = heads[bone][1] + end[1]
            end = end - (0, low, 0) if abs(low) < NEAR_FLOOR * heads[:, 1].max() else end
            lines.extend([f"{pad}  End Site", f"{pad}  {{", f"{pad}    OFFSET {_row(end)}", f"{pad}  }}"])
        lines.append(f"{pad}}}")

    write(0, 0)
    zeros = " ".join(["0"] * (3 * len(names)))
    lines += ["MOTION", "Frames: 1", "Frame Time: 0.033333", f"{_row(heads[0])} {zeros}", ""]
    return "\n".join(lines)


def _tip(before: np.ndarray, own: np.ndarray) -> np.ndarray:
    """From the head of a last bone to its tip. Importers guess it: one that leads far off is not believed."""
    lengths = np.linalg.norm(before) * np.linalg.norm(own)
    return own if lengths and before @ own > LEAST_COSINE * lengths else before / 2


def _row(values: np.ndarray) -> str:
    return " ".join(f"{value * CENTIMETRES:.6f}" for value in values)


def read_bvh(text: str) -> Frames:
    """What a BVH file of ours holds."""
    header, motion = re.split(r"^MOTION\s*$", text, maxsplit=1, flags=re.M)  # a bone may be called LOCOMOTION
    names, parents, channels, stack = list[str](), list[int](), list[list[str]](), list[int]()
    tokens, at = header.split(), 1
    while at < len(tokens):
        word = tokens[at]
        if word in ("ROOT", "JOINT"):
            parents.append(stack[-1] if stack else -1)
            names.append(tokens[at + 1])
            channels.append([])
            at += 2
        elif word == "End":
            stack.append(-1)
            at += 3  # End Site {
        elif word == "{":
            stack.append(len(names) - 1)
            at += 1
        elif word == "CHANNELS":
            count = int(tokens[at + 1])
            channels[-1] = tokens[at + 2 : at + 2 + count]
            at += 2 + count
        elif word == "}":
            stack.pop()
            at += 1
        else:  # OFFSET x y z
            at += 4
    rows = motion.strip().splitlines()
    values = np.array([line.split() for line in rows[2:] if line.strip()], float)
    return _pose(names, parents, channels, values, 1 / float(rows[1].split(":")[1]))


def _pose(names: list[str], parents: list[int], channels: list[list[str]], values: np.ndarray, fps: float) -> Frames:
    frames = len(values)
    world, root, column = np.empty((frames, len(names), 3, 3)), np.zeros((frames, 3)), 0
    for joint, own in enumerate(channels):
        local = np.repeat(np.eye(3)[None], frames, 0)
        for name in own:
            axis = "XYZ".index(name[0])
            if name.endswith("position"):
                if parents[joint] < 0:
                    root[:, axis] = values[:, column] / CENTIMETRES
            else:
                local = local @ _about(axis, np.radians(values[:, column]))
            column += 1
        world[:, joint] = local if parents[joint] < 0 else world[:, parents[joint]] @ local
    return Frames(names, world, root, fps)


def _about(axis: int, angle: np.ndarray) -> np.ndarray:
    turn = np.zeros((len(angle), 3, 3))
    a, b = (axis + 1) % 3, (axis + 2) % 3
    turn[:, axis, axis] = 1
    turn[:, a, a] = turn[:, b, b] = np.cos(angle)
    turn[:, b, a], turn[:, a, b] = np.sin(angle), -np.sin(angle)
    return turn
