"""The sculpted character as a file of the package: written by ``tools/build_mannequin.py``, read by `build`."""

from __future__ import annotations

from importlib.resources import files
from os import PathLike

import numpy as np

from ...files import atomic
from ...motion.skeleton import humanoid
from .character import Character, Part

__all__ = ["load", "save"]

_MORPH_STEP = 2e-6  # metres per unit of the stored int16 displacements; ours: far finer than a hair, and up to ±65 mm
_ASSET = "assets/mannequin.npz"


def save(character: Character, path: str | PathLike[str], sources: str) -> None:
    """Write all parts; displacements are kept only where they are not zero.

    Args:
        sources: digest of the code that sculpted it (``tools/build_mannequin.py``).
    """
    arrays: dict[str, np.ndarray] = {"parts": np.array([p.name for p in character.parts]), "sources": np.array(sources)}
    for part in character.parts:
        arrays |= {
            f"{part.name}/vertices": part.vertices,
            f"{part.name}/normals": np.round(part.normals * 32767).astype(np.int16),
            f"{part.name}/triangles": part.triangles.astype(np.uint16),
            f"{part.name}/joints": part.joints.astype(np.uint8),
            f"{part.name}/weights": part.weights,
            f"{part.name}/colour": part.colour,
            f"{part.name}/roughness": np.array(part.roughness, np.float32),
            f"{part.name}/morphs": np.array(list(part.morphs), dtype="U32"),
        }
        for name, delta in part.morphs.items():
            steps = np.round(delta / _MORPH_STEP)
            rows = np.flatnonzero(steps.any(1))
            arrays[f"{part.name}/morph/{name}/rows"] = rows.astype(np.uint16)
            arrays[f"{part.name}/morph/{name}/steps"] = steps[rows].astype(np.int16)
    with atomic(path) as temporary, temporary.open("wb") as out:
        np.savez_compressed(out, **arrays)  # type: ignore[arg-type]


def load() -> Character:
    """Read the character that ships with the package."""
    with files("cospeech").joinpath(_ASSET).open("rb") as source, np.load(source, allow_pickle=False) as data:
        return Character(humanoid(), tuple(_part(data, str(name)) for name in data["parts"]))


def _part(data: np.lib.npyio.NpzFile, name: str) -> Part:
    def get(key: str) -> np.ndarray:
        return data[f"{name}/{key}"]

    vertices = get("vertices")
    normals = get("normals").astype(np.float32)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-6)
    morphs = {}
    for morph in get("morphs"):
        delta = np.zeros_like(vertices)
        delta[get(f"morph/{morph}/rows")] = get(f"morph/{morph}/steps").astype(np.float32) * np.float32(_MORPH_STEP)
        morphs[str(morph)] = delta
    return Part(
        name,
        vertices,
        normals,
        get("triangles").astype(np.int32),
        get("joints").astype(np.int32),
        get("weights"),
        get("colour"),
        float(get("roughness")),
        morphs,
    )
