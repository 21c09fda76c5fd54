"""The face of somebody's character: its morph targets by the names of ARKit, VRM or Oculus, and what drives them.

A character is driven in the best alphabet that it has: ARKit's 52 (as morph targets, or as VRM expressions), else VRM's
presets, else Oculus' visemes with the blinks that there are.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..motion.rotations import Array
from ..motion.skeletons.arkit import ARKIT, ARKIT_INDEX
from .face_names import ARKIT_NAMES, ENOUGH, HELD, LONGEST, MOVED, OCULUS_NAMES, VRM0_NAMES
from .face_reading import Bind, read_arkit, read_presets
from .gltf import GltfFile, report_damage
from .tracks import Curve
from .visemes import oculus_visemes, vrm_presets

__all__ = ["Bind", "FaceRig", "looks_turn_eyes", "read_face", "target_names"]


@dataclass(frozen=True, eq=False)
class FaceRig:
    """The shapes that move a character's face.

    Args:
        alphabet: ``"ARKit"``, ``"VRM"``, ``"Oculus"`` or ``""`` where nothing can be driven.
        binds: from the alphabet's names to morph targets.
        base: node → (n,) weights at rest of every mesh node that is driven.
    """

    alphabet: str
    binds: tuple[Bind, ...]
    base: dict[int, Array]

    def weights(self, face: Array) -> dict[int, Array]:
        """ARKit weights (T, 52) → node → (T, n) weights of all its morph targets."""
        drivers = {name: face[:, k] for name, k in ARKIT_INDEX.items()}
        if self.alphabet == "VRM":
            drivers = vrm_presets(face)
        elif self.alphabet == "Oculus":
            drivers |= {f"viseme_{name}": weight for name, weight in oculus_visemes(face).items()}
        result = {node: np.tile(base, (len(face), 1)) for node, base in self.base.items()}
        for bind in self.binds:
            weight = drivers[bind.driver]
            result[bind.node][:, bind.target] += bind.share * (weight > 0.5 if bind.binary else weight)
        return {node: np.clip(weight, 0, 1) for node, weight in result.items()}

    def face(self, curves: dict[tuple[int, str], Curve], times: Array) -> Array | None:
        """ARKit weights (T, 52) of an animation; None where it moves none of the targets that are driven."""
        if self.alphabet == "ARKit":
            return read_arkit(self.binds, curves, times)
        return read_presets(self.binds, self.base, curves, times)


def target_names(file: GltfFile, mesh: int) -> list[str]:
    """Names of a mesh's morph targets, from the ``extras`` of the mesh or of its first primitive; "" where not named."""
    entry = file.list("meshes")[mesh]
    first = entry["primitives"][0]
    count = len(first.get("targets", []))
    for extras in (entry.get("extras"), first.get("extras")):
        names = extras.get("targetNames") if isinstance(extras, dict) else None
        if isinstance(names, list) and len(names) == count:
            return [str(name) for name in names]
    return [""] * count


def read_face(file: GltfFile, *, eyes_are_bones: bool) -> FaceRig:
    """Find what can drive the face of a character.

    Args:
        file: the character.
        eyes_are_bones: the looks of VRM's presets are left out, as the eye bones turn.
    """
    with report_damage(file.name):
        nodes = [(k, node["mesh"]) for k, node in enumerate(file.list("nodes")) if "mesh" in node]
        shapes = [(k, t, name) for k, mesh in nodes for t, name in enumerate(target_names(file, mesh))]
        arkit = [Bind(ARKIT_NAMES[key], k, t) for k, t, name in shapes if (key := _key(name)) in ARKIT_NAMES]
        expressions = list(_expressions(file))
        presets = [bind for name, bind in expressions if name in vrm_presets(np.zeros((1, len(ARKIT))))]
        if eyes_are_bones:
            presets = [bind for bind in presets if not bind.driver.startswith("look")]
        oculus = [Bind(f"viseme_{v}", k, t) for k, t, name in shapes if (v := _viseme(name))]
        if len({bind.driver for bind in arkit}) < ENOUGH:
            matches = [(ARKIT_NAMES[name.lower()], bind) for name, bind in expressions if name.lower() in ARKIT_NAMES]
            clips = [bind._replace(driver=name, binary=False) for name, bind in matches]
            arkit = clips if len({b.driver for b in clips}) > len({b.driver for b in arkit}) else arkit
        if len({bind.driver for bind in arkit}) >= ENOUGH:
            return _rig(file, "ARKit", arkit)
        if presets:
            return _rig(file, "VRM", presets)
        if oculus:
            return _rig(file, "Oculus", oculus + [b for b in arkit if b.driver.startswith(("eye", "brow"))])
        return _rig(file, "ARKit" if arkit else "", arkit)


def looks_turn_eyes(file: GltfFile, face: FaceRig, eyes: set[int]) -> bool:
    """Whether the shapes of looking turn the eyeballs themselves; then eye bones (nodes ``eyes``) have to rest."""
    with report_damage(file.name):
        for bind in face.binds:
            entry = file.list("nodes")[bind.node]
            if not bind.driver.startswith(("eyeLook", "look")) or "skin" not in entry:
                continue
            joints = file.list("skins")[entry["skin"]]["joints"]
            own = [k for k, joint in enumerate(joints) if joint in eyes]
            for primitive in file.list("meshes")[entry["mesh"]]["primitives"]:
                attributes, target = primitive["attributes"], primitive["targets"][bind.target]
                on_eye = np.isin(file.accessor(attributes["JOINTS_0"], 4), own)
                eyeball = np.sum(file.accessor(attributes["WEIGHTS_0"], 4) * on_eye, 1) > HELD
                if np.any(np.abs(file.accessor(target["POSITION"], 3)[eyeball]) > MOVED):
                    return True
        return False


def _rig(file: GltfFile, alphabet: str, binds: list[Bind]) -> FaceRig:
    base = {}
    for node in sorted({bind.node for bind in binds}):
        entry = file.list("nodes")[node]
        mesh = file.list("meshes")[entry["mesh"]]
        count = len(mesh["primitives"][0].get("targets", []))
        rest = np.array(entry.get("weights", mesh.get("weights", [0] * count)), float).reshape(-1)
        base[node] = rest if len(rest) == count and np.isfinite(rest).all() else np.zeros(count)
    fits = [b for b in binds if 0 <= b.target < len(base[b.node]) and np.isfinite(b.share)]
    return FaceRig(alphabet if fits else "", tuple(fits), base if fits else {})


def _key(name: str) -> str:
    """``"Face.M_eyeBlink_L"`` → ``"eyeblinkl"``: without a prefix of ARKit's name, and without signs."""
    pieces = [piece for piece in re.split(r"[.:|_\s-]+", name[-LONGEST:]) if piece]
    for first in range(len(pieces)):
        key = "".join(pieces[first:]).lower()
        if key in ARKIT_NAMES:
            return key
    return ""


def _viseme(name: str) -> str:
    match = re.search(r"viseme[._\s-]*([a-z]+)$", name[-LONGEST:], re.IGNORECASE)
    return OCULUS_NAMES.get(match[1].lower(), "") if match else ""


def _expressions(file: GltfFile) -> Iterator[tuple[str, Bind]]:
    """VRM expressions with their morph target binds, under VRM 1.0's names."""
    extensions = file.json.get("extensions", {})
    of_mesh: dict[int, list[int]] = {}
    for k, node in enumerate(file.list("nodes")):
        if "mesh" in node:
            of_mesh.setdefault(node["mesh"], []).append(k)
    groups: dict[str, Any] = extensions.get("VRMC_vrm", {}).get("expressions", {})
    for kind in ("preset", "custom"):
        for name, entry in groups.get(kind, {}).items():
            for bind in entry.get("morphTargetBinds", []):
                if "mesh" in file.list("nodes")[bind["node"]]:
                    binary = bool(entry.get("isBinary"))
                    yield name, Bind(name, int(bind["node"]), int(bind["index"]), float(bind.get("weight", 1)), binary)
    for group in extensions.get("VRM", {}).get("blendShapeMaster", {}).get("blendShapeGroups", []):
        preset = str(group.get("presetName", "")).lower()
        name = str(group.get("name", ""))
        name = VRM0_NAMES.get(preset) or VRM0_NAMES.get(name.lower(), name)
        for bind in group.get("binds", []):
            for k in of_mesh.get(bind["mesh"], []):
                share = float(bind.get("weight", 100)) / 100  # VRM 0.x counts in per cent
                yield name, Bind(name, k, int(bind["index"]), share, bool(group.get("isBinary")))
