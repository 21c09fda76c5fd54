"""VRM animation 1.0 (``VRMC_vrm_animation``): one clip for any VRM avatar.

The rest pose is VRM's T-pose with identity rotations (so that the data carries over as it is), soles on the floor;
translation is keyed on the hips only and the eyes not at all: a ``lookAt`` node turns in their place. Expressions are the
X of a node's translation: the presets of `visemes.vrm_presets` for any avatar, and ARKit's names as custom expressions for
"perfect sync" avatars. An avatar that has both adds them up: leave one out with ``presets=False`` or ``arkit=False``.

The gaze is written once. The specification forbids the presets of looking, since ``lookAt`` handles them. The same holds for
ARKit's eyeLook*, which a player adds to ``lookAt`` on an avatar that has such expressions. So eyeLook* is left out; with
``look_at=False``, ``lookAt`` is. `load` computes the one from the other.
"""

from __future__ import annotations

from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError
from ..face.gaze import complete_looks, read_looks, toward
from ..motion.motion import Motion
from ..motion.rotations import Array, euler_to_quat, quat_slerp, quat_to_euler
from ..motion.skeleton import humanoid
from ..motion.skeletons.arkit import ARKIT, ARKIT_INDEX
from . import Writer as BaseWriter
from .find_humanoid import read_rig
from .gltf import GltfFile, read_glb, report_damage
from .gltf_build import GltfBuilder
from .to_humanoid import as_humanoid
from .tracks import Curve, GltfTrack, Recorder, clock_of, read_animation
from .visemes import MOODS, arkit_from_presets, vrm_presets

__all__ = ["PRESETS", "Writer", "load"]

PRESETS = ("aa", "ih", "ou", "ee", "oh", "blink", "blinkLeft", "blinkRight", *MOODS)
"""The preset expressions that are written; looks are left to ``lookAt``."""

_EYES = ("leftEye", "rightEye")
_ARKIT = {name.lower(): name for name in ARKIT}
_LOOKS = [k for name, k in ARKIT_INDEX.items() if name.startswith("eyeLook")]
_AHEAD = 1e-6  # of a quaternion's x, y, z; [ours]: rounding errors of eyes that rest


class Writer(BaseWriter):
    """Streams motion into a clip; tracks wait in a temporary file.

    Args:
        presets: write VRM's preset expressions.
        arkit: write ARKit's 52 as custom expressions.
        look_at: write the gaze as ``lookAt``; else as ARKit's eyeLook*.
    """

    _recorder: Recorder | None = None

    def __init__(
        self, path: str | PathLike[str], *, presets: bool = True, arkit: bool = True, look_at: bool = True, **common: Any
    ) -> None:
        super().__init__(path, **common)
        self._presets = PRESETS if presets else ()
        self._arkit = tuple(name for name, k in ARKIT_INDEX.items() if k not in _LOOKS or not look_at) if arkit else ()
        self._look_at = look_at

    def _begin(self, temporary: Path) -> None:
        self._temporary = temporary
        self._builder = GltfBuilder({"asset": {"version": "2.0", "generator": "cospeech"}, "scene": 0})
        joints = add_humanoid(self._builder)
        preset, custom = (
            {name: self._builder.append("nodes", {"name": f"expression {name}"}) for name in names}
            for names in (self._presets, self._arkit)
        )
        looks = [self._builder.append("nodes", {"name": "lookAt"})] if self._look_at else []
        roots = [joints["hips"], *preset.values(), *custom.values(), *looks]
        self._builder.json["scenes"] = [{"name": "cospeech", "nodes": roots}]
        expressions = {
            kind: {name: {"node": node} for name, node in nodes.items()}
            for kind, nodes in (("preset", preset), ("custom", custom))
            if nodes
        }
        animation = {
            "specVersion": "1.0",
            "humanoid": {"humanBones": {name: {"node": node} for name, node in joints.items() if name not in _EYES}},
        } | ({"expressions": expressions} if expressions else {})
        if looks:
            animation["lookAt"] = {"node": looks[0], "offsetFromHeadBone": _between_the_eyes()}
        self._builder.json |= {"extensionsUsed": ["VRMC_vrm_animation"], "extensions": {"VRMC_vrm_animation": animation}}
        turning = [node for name, node in joints.items() if name not in _EYES]
        tracks = [
            GltfTrack((joints["hips"],), "translation", 3),
            *(GltfTrack((node,), "rotation", 4) for node in [*turning, *looks]),
        ]
        tracks += [GltfTrack((node,), "translation", 3) for node in [*preset.values(), *custom.values()]]
        self._joints = [k for k, name in enumerate(humanoid().names) if name not in _EYES]
        self._recorder = Recorder(tracks, self.fps, temporary.parent)

    def _write(self, motion: Motion) -> None:
        assert self._recorder is not None
        motion = as_humanoid(motion)
        frames = len(motion)
        face = np.zeros((frames, len(ARKIT))) if motion.face is None else motion.face
        face = face if self._look_at else complete_looks(face, gaze(motion))
        presets = vrm_presets(face)
        weights = [presets[name] for name in self._presets] + [face[:, ARKIT_INDEX[name]] for name in self._arkit]
        expressions = np.zeros((frames, len(weights), 3))
        if weights:
            expressions[..., 0] = np.clip(np.stack(weights, 1), 0, 1)
        rotations = motion.rotations[:, self._joints].reshape(frames, -1)
        looks = [gaze(motion)] if self._look_at else []
        columns = [motion.root, rotations, *looks, expressions.reshape(frames, -1)]
        self._recorder.add(np.concatenate(columns, 1))

    def _finish(self) -> None:
        assert self._recorder is not None
        self._recorder.append(self._builder, "speech")
        with self._temporary.open("wb") as file:
            self._builder.write(file)

    def _discard(self) -> None:
        if self._recorder is not None:
            self._recorder.close()


def add_humanoid(builder: GltfBuilder) -> dict[str, int]:
    """Add our humanoid's T-pose as the first nodes; name → node."""
    skeleton = humanoid()
    for k, name in enumerate(skeleton.names):
        node: dict[str, Any] = {"name": name, "translation": skeleton.offsets[k].tolist()}
        if skeleton.children[k]:
            node["children"] = list(skeleton.children[k])
        builder.append("nodes", node)
    return dict(skeleton.index)


def gaze(motion: Motion) -> Array:
    """(T, 4) the common gaze of both eyes, relative to the head: yaw and pitch, no roll. Where eye bones rest and eyeLook* do
    not, as in a face that was recorded alone, eyeLook* count."""
    left, right = (motion.rotations[:, motion.skeleton.index[name]].astype(np.float64) for name in _EYES)
    angles = quat_to_euler(quat_slerp(left, right, np.full(len(left), 0.5)), "YXZ")
    eyes = euler_to_quat(angles[:, :2], "YX")
    if motion.face is None:
        return eyes
    resting = np.abs(np.stack([left, right], 1)[..., :3]).max((1, 2)) < _AHEAD
    return np.where(resting[:, None], toward(read_looks(motion.face).mean(1)), eyes)


def _between_the_eyes() -> list[float]:
    skeleton = humanoid()
    left, right = (skeleton.offsets[skeleton.index[name]] for name in _EYES)
    return ((left + right) / 2).tolist()


def load(path: str | PathLike[str]) -> Motion:
    """Read a clip onto our humanoid; the face from custom expressions with ARKit's names, else from the presets.

    Raises:
        InputError: damaged, without animation, or not a VRM animation.
    """
    file = read_glb(path)
    extension = file.json.get("extensions", {})
    if not isinstance(extension, dict) or "VRMC_vrm_animation" not in extension:
        raise InputError(f"{file.name} is no VRM animation", "an animated character is read as .glb")
    with report_damage(file.name):
        rig = read_rig(file)
        curves = read_animation(file)
        fps, times = clock_of(curves, file, max(rig.joints, len(humanoid())))
        rotations, root = rig.motion(curves, times)
        face = _face(file, curves, times, extension["VRMC_vrm_animation"])
        look = curves.get((extension["VRMC_vrm_animation"].get("lookAt", {}).get("node"), "rotation"))
        eyes = None if look is None else look.at(times)[:, None]
        if eyes is None:
            eyes = None if face is None else toward(read_looks(face))
        elif face is not None:
            face = complete_looks(face, eyes[:, 0])
        motion = as_humanoid(Motion(fps=fps, rotations=rotations, root=root, face=face, skeleton=rig.skeleton))
        if eyes is not None:
            motion.rotations[:, [motion.skeleton.index[name] for name in _EYES]] = eyes
    return motion


def _face(file: GltfFile, curves: dict[tuple[int, str], Curve], times: Array, extension: dict[str, Any]) -> Array | None:
    """ARKit weights (T, 52) of the clip's expressions; None where it has none."""
    expressions = extension.get("expressions", {})

    def weights(kind: str) -> dict[str, Array]:
        values = {}
        for name, entry in expressions.get(kind, {}).items():
            curve, rest = curves.get((entry["node"], "translation")), file.list("nodes")[entry["node"]].get("translation")
            still = np.full(len(times), float(rest[0]) if rest else 0.0)
            values[str(name)] = np.clip(still if curve is None else curve.at(times)[:, 0], 0, 1)
        return values

    custom = {_ARKIT[name.lower()]: weight for name, weight in weights("custom").items() if name.lower() in _ARKIT}
    if custom:
        face = np.zeros((len(times), len(ARKIT)))
        for name, weight in custom.items():
            face[:, ARKIT_INDEX[name]] = weight
        return face
    preset = weights("preset")
    return arkit_from_presets(preset) if preset else None
