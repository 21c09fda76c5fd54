"""Thousands of damaged files: each is refused in one line, or read as a valid motion; none crashes, hangs or fills memory."""

from __future__ import annotations

import json
import random
import struct

import numpy as np
import pytest

from cospeech.errors import InputError
from cospeech.export import load, save
from cospeech.export.avatar import load_avatar
from cospeech.export.glb_container import split_glb
from cospeech.export.gltf_build import GltfBuilder
from cospeech.motion.motion import Motion
from cospeech.motion.skeleton import humanoid
from tests.support.motions import gesturing, stand_in

pytestmark = pytest.mark.filterwarnings(
    "ignore:.*the shape of the tree was used:cospeech.errors.CospeechWarning"
)  # names may break

EACH = 170
STRANGE = (
    None, True, -1, 0, 1, 3, 255, 65536, 1 << 31, 1 << 40, 1 << 70, 0.5, -1e30, 1e308, "", "x", "VEC4", "rotation", "\u0000",
    [], [0], [1e9] * 4, {}, {"a": 1}, [[[]]],
)  # fmt: skip


def flip_bytes(data: bytes, chance: random.Random) -> bytes:
    """Bytes changed, cut, doubled or moved."""
    out = bytearray(data)
    for _ in range(chance.choice((1, 1, 2, 5, 20))):
        at = chance.randrange(len(out)) if out else 0
        kind = chance.randrange(6)
        if kind == 0 and len(out) > 1:
            del out[at : at + chance.choice((1, 2, 16, 200))]
        elif kind == 1:
            out[at:at] = bytes(chance.randrange(256) for _ in range(chance.choice((1, 4, 40))))
        elif kind == 2:
            out[at:at] = out[at : at + 64]
        elif kind == 3 and len(out) > 8:
            del out[chance.randrange(4, len(out)) :]
        elif out:
            at = min(at, len(out) - 1)
            out[at] = chance.choice((0, 9, 44, 45, 48, 57, 127, 128, 255, out[at] ^ (1 << chance.randrange(8))))
    return bytes(out)


def bend_json(value: object, chance: random.Random) -> object:
    """The same JSON with a few values replaced, removed or repeated."""
    places: list[tuple[object, object]] = []

    def walk(item: object) -> None:
        for key in item if isinstance(item, dict) else range(len(item)) if isinstance(item, list) else ():
            places.append((item, key))
            walk(item[key])

    walk(value)
    for _ in range(chance.choice((1, 1, 2, 4))):
        item, key = chance.choice(places)
        if (isinstance(item, list) and key >= len(item)) or (isinstance(item, dict) and key not in item):
            continue
        if chance.random() < 0.15:
            del item[key]
        else:
            other, name = chance.choice(places)
            here = (isinstance(other, dict) and name in other) or (isinstance(other, list) and name < len(other))
            copy = json.loads(json.dumps(other[name])) if here else None
            item[key] = chance.choice(STRANGE) if chance.random() < 0.7 else copy
    return value


@pytest.fixture(scope="module")
def sources(tmp_path_factory) -> dict[str, bytes]:
    folder, motion = tmp_path_factory.mktemp("good"), gesturing(6)
    contents = {}
    for suffix in (".glb", ".fbx", ".vrma", ".csv", ".json", ".npz"):
        save(motion, folder / f"a{suffix}", **({"character": stand_in()} if suffix == ".glb" else {}))
        contents[suffix] = (folder / f"a{suffix}").read_bytes()
    return contents


def read(load_one, path) -> str:
    """``"refused"`` or ``"read"``; anything else is a failure of the test."""
    try:
        motion = load_one(path)
    except InputError as error:
        text = str(error)
        assert "\n" not in text and len(text) < 400, text  # noqa: PT018
        return "refused"
    assert isinstance(motion, Motion)
    assert np.isfinite(motion.rotations).all()
    assert len(motion) < 1e6
    return "read"


@pytest.mark.slow
@pytest.mark.parametrize("suffix", [".glb", ".fbx", ".vrma", ".csv", ".json", ".npz"])
def test_bytes(sources, tmp_path, suffix):
    chance, outcomes = random.Random(suffix), []
    for _ in range(EACH):
        path = tmp_path / f"a{suffix}"
        path.write_bytes(flip_bytes(sources[suffix], chance))
        outcomes.append(read(load, path))
    assert outcomes.count("refused") > EACH / 20
    assert outcomes.count("read") > (0 if suffix == ".npz" else EACH / 50)


def glb_of(document: dict, data: bytes) -> bytes:
    """A container around any JSON, sensible or not."""
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    header = struct.pack("<5I", 0x46546C67, 2, 28 + len(text) + len(data), len(text), 0x4E4F534A)
    return header + text + struct.pack("<II", len(data), 0x004E4942) + data


@pytest.mark.slow
@pytest.mark.parametrize("suffix", [".glb", ".vrma", ".json"])
def test_documents(sources, tmp_path, suffix):
    chance, outcomes = random.Random(suffix + "d"), []
    for _ in range(EACH):
        path = tmp_path / f"a{suffix}"
        if suffix == ".json":
            path.write_text(json.dumps(bend_json(json.loads(sources[suffix]), chance)))
        else:
            document, data = split_glb(sources[suffix], "")
            path.write_bytes(glb_of(bend_json(document, chance), data))
        outcomes.append(read(load, path))
    assert outcomes.count("refused") > EACH / 20
    assert outcomes.count("read") > EACH / 20


@pytest.mark.slow
@pytest.mark.parametrize("version", [0, 1])
def test_vrm_extensions(sources, tmp_path, version):
    """The extension alone is damaged; what is still taken for a character is also driven."""
    chance, outcomes = random.Random(version), []
    motion = gesturing(2)
    bones, face = list(humanoid().names), 56
    document, data = split_glb(sources[".glb"], "")
    bind = {"node": face, "mesh": 0, "index": 3, "weight": 1}
    if version:
        humans = {name: {"node": k} for k, name in enumerate(bones)}
        preset = {"aa": {"morphTargetBinds": [bind]}, "blink": {"morphTargetBinds": [bind], "isBinary": True}}
        good: dict = {"VRMC_vrm": {"humanoid": {"humanBones": humans}, "expressions": {"preset": preset, "custom": preset}}}
    else:
        bone_list = [{"bone": name, "node": k} for k, name in enumerate(bones)]
        groups = [{"name": "A", "presetName": "a", "binds": [bind]}, {"name": "B", "presetName": "blink", "binds": [bind]}]
        good = {"VRM": {"humanoid": {"humanBones": bone_list}, "blendShapeMaster": {"blendShapeGroups": groups}}}
    document.pop("animations")
    for mesh in document["meshes"]:
        mesh.pop("extras", None)
    for k, node in enumerate(document["nodes"]):
        node["name"] = f"n{k}"
    for _ in range(EACH // 2):
        extension = bend_json(json.loads(json.dumps(good)), chance)
        (tmp_path / "a.vrm").write_bytes(glb_of(document | {"extensions": extension}, data))

        def drive(path) -> Motion:
            avatar = load_avatar(path)
            avatar.animate(motion, tmp_path / "out.glb")
            return load(tmp_path / "out.glb")

        outcomes.append(read(drive, tmp_path / "a.vrm"))
    assert min(outcomes.count("refused"), outcomes.count("read")) > EACH / 50


def test_the_builder_makes_what_the_container_reads(sources):
    document, data = split_glb(sources[".glb"], "")
    assert split_glb(glb_of(document, data), "") == (document, data)
    assert GltfBuilder(document, data).json is document
