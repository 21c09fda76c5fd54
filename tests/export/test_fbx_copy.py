"""Copies of FBX characters that were saved in an odd state."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest

from cospeech.errors import InputError
from cospeech.export import save
from cospeech.export.character_files import read_character
from cospeech.export.fbx.document import Document
from cospeech.export.fbx.node_writer import Long, NodeWriter
from cospeech.export.fbx.tree import parse_fbx
from tests.support.motions import gesturing


def patch_figure(path: Path, old: bytes, new: bytes, times: int = 1) -> Path:
    """Our figure with other bytes at some place."""
    save(gesturing(3), path)
    data = path.read_bytes()
    assert data.count(old) >= 1
    path.write_bytes(data.replace(old, new, times))
    return path


def pack(*numbers: float) -> bytes:
    return b"".join(b"D" + struct.pack("<d", x) for x in numbers)


@pytest.mark.filterwarnings("ignore::UserWarning")
def test_a_joint_that_was_saved_out_of_place_goes_back(tmp_path):
    """A bone that an animator had pulled out when the file was saved stands where the skin is bound."""
    motion = gesturing(3)
    joint = motion.skeleton.index["leftUpperArm"]
    x, y, z = motion.skeleton.offsets[joint] * 100.0
    path = patch_figure(tmp_path / "a.fbx", pack(x, y, z), pack(x + 5, y + 6, z + 7))
    save(motion, tmp_path / "b.fbx", avatar=path)
    file = read_character(tmp_path / "b.fbx")
    (node,) = [k for k, entry in enumerate(file.list("nodes")) if entry["name"] == "leftUpperArm"]
    np.testing.assert_allclose(file.curves(0)[node, "translation"].values, [(x, y, z)] * 3, atol=1e-4)


@pytest.mark.filterwarnings("ignore::UserWarning")
def test_numbers_of_objects_that_leave_none_for_new_ones(tmp_path):
    save(gesturing(3), tmp_path / "a.fbx")
    fbx = Document(parse_fbx((tmp_path / "a.fbx").read_bytes(), "a"), "a")
    number = fbx.of_kind("Material")[0].number
    old, new = (b"L" + struct.pack("<q", k) for k in (number, (1 << 63) - 1))
    path = patch_figure(tmp_path / "a.fbx", old, new, -1)
    with pytest.raises(InputError, match="number 9223372036854775807"):
        save(gesturing(3), tmp_path / "b.fbx", avatar=path)


@pytest.mark.filterwarnings("ignore::UserWarning")
def test_connections_between_properties_are_kept(tmp_path):
    """Those of constraints, say: OP, PO and PP, with names of properties between or after the numbers."""
    save(gesturing(3), tmp_path / "a.fbx")
    fbx = Document(parse_fbx((tmp_path / "a.fbx").read_bytes(), "a"), "a")
    bone, other = (model.number for model in fbx.of_kind("Model")[:2])
    more = ("PP", Long(bone), "Lcl Rotation", Long(other), "Lcl Rotation")
    with (tmp_path / "b.fbx").open("wb") as file:
        nodes = NodeWriter(file)
        for node in fbx.root.nodes:
            if node.name != "Connections":
                nodes.copy(node)
        with nodes.node("Connections"):
            for node in fbx.connections:
                nodes.copy(node)
            nodes.leaf("C", *more)
        nodes.finish()
    save(gesturing(3), tmp_path / "c.fbx", avatar=tmp_path / "b.fbx")
    copy = Document(parse_fbx((tmp_path / "c.fbx").read_bytes(), "c"), "c")
    assert list(more) in [node.values for node in copy.connections]
