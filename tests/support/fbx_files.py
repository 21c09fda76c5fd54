"""Small FBX files that say what ours never say: pivots, turns before and after, other orders, axes, units and versions."""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from cospeech.export.fbx.node_writer import CREATION_TIME, FILE_ID, Long, NodeWriter
from cospeech.export.fbx.tree import MAGIC

__all__ = ["Tree", "record", "wide_file", "write_bones", "write_objects"]

Tree = tuple[str, list, list]
"""A node: its name, its values, the nodes in it."""

TICKS = 46_186_158_000


def write_bones(
    path: Path,
    bones: Sequence[tuple[str, int, Mapping[str, tuple[float, ...]]]],
    keys: Mapping[tuple[int, str, str], tuple[Sequence[float], Sequence[float]]] | None = None,
    settings: Mapping[str, float] | None = None,
    flags: int = 4,
    *,
    empty_clip: bool = False,
    constants: Mapping[str, float] | None = None,
    poses: Mapping[str, tuple[float, float, float]] | None = None,
) -> Path:
    """A file of bones, with curves.

    Args:
        path: of the file.
        bones: name, which of the bones it hangs on (-1: none), and properties with one or three numbers.
        keys: (bone, property, part) → times in s, and values.
        settings: of the whole file.
        flags: of all keys; 2 steps, 4 straight lines, 8 bends.
        empty_clip: write a clip also where there are no curves.
        constants: part → what nodes of curves say of it.
        poses: kind of a pose → where it has the first bone.
    """
    with path.open("wb") as file:
        nodes = NodeWriter(file)
        nodes.leaf("FileId", FILE_ID)
        nodes.leaf("CreationTime", CREATION_TIME)
        with nodes.node("GlobalSettings"):
            nodes.properties(*((name, "double", "Number", "", float(x)) for name, x in (settings or {}).items()))
        connections: list[tuple[object, ...]] = []
        with nodes.node("Objects"):
            for k, (name, parent, properties) in enumerate(bones):
                with nodes.node("Model", Long(k + 1), f"{name}\0\1Model", "LimbNode"):
                    nodes.properties(*((key, "Vector", "", "A", *map(float, x)) for key, x in properties.items()))
                connections.append(("OO", Long(k + 1), Long(parent + 1)))
            connections += _write_clip(nodes, keys or {}, flags, constants or {}) if keys or empty_clip else []
            for k, (kind, place) in enumerate((poses or {}).items()):
                with nodes.node("Pose", Long(800 + k), "pose\0\1Pose", kind), nodes.node("PoseNode"):
                    nodes.leaf("Node", Long(1))
                    nodes.leaf("Matrix", np.array([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, *place, 1], float))
        with nodes.node("Connections"):
            for connection in connections:
                nodes.leaf("C", *connection)
        nodes.finish()
    return path


def _write_clip(nodes: NodeWriter, keys: Mapping, flags: int, constants: Mapping[str, float]) -> list[tuple[object, ...]]:
    connections: list[tuple[object, ...]] = [("OO", Long(901), Long(900))]
    for number, kind in ((900, "Stack"), (901, "Layer")):
        with nodes.node(f"Animation{kind}", Long(number), f"clip\0\1Anim{kind}", ""):
            pass
    for k, ((bone, name, part), (times, values)) in enumerate(keys.items()):
        curve, holder = 1000 + 2 * k, 1001 + 2 * k
        with nodes.node("AnimationCurveNode", Long(holder), "R\0\1AnimCurveNode", ""):
            nodes.properties(*((f"d|{other}", "Number", "", "A", float(x)) for other, x in constants.items()))
        with nodes.node("AnimationCurve", Long(curve), "\0\1AnimCurve", ""):
            nodes.leaf("KeyTime", np.round(np.asarray(times, float) * TICKS).astype(np.int64))
            nodes.leaf("KeyValueFloat", np.asarray(values, np.float32))
            nodes.leaf("KeyAttrFlags", np.array([flags], np.int32))
            nodes.leaf("KeyAttrRefCount", np.array([len(times)], np.int32))
        connections += [("OO", Long(holder), Long(901)), ("OP" if name else "OO", Long(holder), Long(bone + 1), name)]
        connections += [("OP", Long(curve), Long(holder), f"d|{part}")]
    return connections


def write_objects(path: Path, objects: Sequence[Tree], connections: Sequence[tuple[object, ...]]) -> Path:
    """A file of any objects, as trees of nodes."""

    def write(tree: Tree) -> None:
        with nodes.node(tree[0], *tree[1]):
            for inner in tree[2]:
                write(inner)

    with path.open("wb") as file:
        nodes = NodeWriter(file)
        write(("Objects", [], list(objects)))
        write(("Connections", [], [("C", list(connection), []) for connection in connections]))
        nodes.finish()
    return path


def record(name: bytes, values: bytes, count: int, inside: bytes, at: int, *, wide: bool = False) -> bytes:
    """A node that begins at byte ``at``, made by hand."""
    head = struct.Struct("<QQQB" if wide else "<IIIB")
    end = at + head.size + len(name) + len(values) + len(inside)
    return head.pack(end, count, len(values), len(name)) + name + values + inside


def wide_file() -> bytes:
    """A file of version 7.5, whose places have 64 bits: one bone."""
    first = MAGIC + struct.pack("<I", 7500)
    label = b"only\0\1Model"
    values = (
        b"L" + struct.pack("<q", 1) + b"S" + struct.pack("<I", len(label)) + label + b"S" + struct.pack("<I", 8) + b"LimbNode"
    )
    start = len(first) + 25 + len(b"Objects")
    model = record(b"Model", values, 3, b"", start, wide=True)
    return first + record(b"Objects", b"", 0, model + bytes(25), len(first), wide=True) + bytes(25)
