"""VMC protocol 2.0 and later (https://protocol.vmc.info): bones and blend shapes of a VRM avatar as OSC over UDP.

We are the *Performer*; the *Marionette* (VSeeFace, VMC4UE, EVMC4U, VMC4B for Blender, Warudo …) listens on port 39539. Each
frame is one bundle: the state, the time, the root, every bone, the blend shapes, and the order to apply these.

Bones have Unity's names and Unity's space, which is left-handed: x points to the character's right, so that positions change
the sign of x, and quaternions those of y and z. Rotations are local to the T-pose with identity rest rotations, which is how
VRM 0.x stores its avatars and how receivers hold those of VRM 1.0.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Mapping

import numpy as np

from ...errors import InputError
from ...motion.motion import Motion
from ...motion.rotations import Array, quat_identity
from ...motion.skeleton import humanoid
from ...motion.skeletons.arkit import ARKIT
from ...motion.skeletons.vrm import FROM_VRM0
from ..avatar import EYES, Avatar
from ..rig import world_matrices
from ..to_humanoid import as_humanoid
from ..visemes import vrm_presets
from . import osc

__all__ = ["FACES", "PORT", "VmcEncoder", "avatar_offsets"]

PORT = 39539
FACES = ("vrm0", "vrm1", "arkit")
"""Names of blend shapes that a user may choose; the protocol wants VRM 0.x's otherwise."""

_VRM0 = {
    "aa": "A", "ih": "I", "ou": "U", "ee": "E", "oh": "O", "blink": "Blink", "blinkLeft": "Blink_L", "blinkRight": "Blink_R",
    "happy": "Joy", "angry": "Angry", "sad": "Sorrow", "surprised": "Surprised",
}  # fmt: skip
"""VRM 1.0's presets → VRM 0.x's (the table of the protocol). 0.x has no preset of surprise: some avatars have such a shape."""
_MOST = 65_000  # bytes of a UDP datagram, a little less than is possible
_THUMBS = {new: old for old, new in FROM_VRM0.items()}  # Unity's names are those of VRM 0.x


def _unity_name(name: str) -> str:
    name = _THUMBS.get(name, name)
    return name[0].upper() + name[1:]


class VmcEncoder:
    """Frames of motion → datagrams.

    Args:
        face: one of `FACES`: which names the blend shapes have; "arkit" are those of "perfect sync" avatars.
        rest: offsets of the avatar's own bones, so that they keep their lengths (`avatar_offsets`); ours where not given.
        still_eyes: eye bones rest, because blend shapes turn the avatar's eyes (`Avatar.eyes_by_shapes`); only with "arkit",
            because the other names have no shapes for the eyes.
        most: bytes of a datagram; a frame that is longer is sent as several bundles.
    """

    def __init__(
        self, *, face: str = "vrm0", rest: Mapping[str, Array] | None = None, still_eyes: bool = False, most: int = _MOST
    ) -> None:
        self._names, self._most = face, most
        own = humanoid()
        offsets = dict(zip(own.names, own.offsets, strict=True)) if rest is None else rest
        self._bones = [k for k, name in enumerate(own.names) if name in offsets]
        names = [own.names[k] for k in self._bones]
        self._still = [k for k, name in enumerate(names) if name in EYES] if still_eyes and face == "arkit" else []
        self._scale = float(offsets["hips"][1] / own.offsets[0][1])  # hips move as much further as the legs are longer
        self._heads = [osc.message("/VMC/Ext/Bone/Pos", _unity_name(name), *[0.0] * 7)[:-28] for name in names]
        shapes = {"vrm0": _VRM0.values(), "vrm1": _VRM0, "arkit": [name[0].upper() + name[1:] for name in ARKIT]}[face]
        self._shapes = [osc.message("/VMC/Ext/Blend/Val", name, 0.0)[:-4] for name in shapes]
        self._places = _unity_place(np.array([offsets[name] for name in names], float))

    def begin(self) -> bytes:
        """Nothing: every frame is complete."""
        return b""

    end = begin

    def frames(self, motion: Motion) -> Iterator[list[bytes]]:
        """The datagrams of each frame.

        Args:
            motion: the next frames; ``start`` and ``fps`` give their times on the audio clock.
        """
        motion = as_humanoid(motion)
        rotations = motion.rotations[:, self._bones] * np.array([1, -1, -1, 1], np.float32)
        if motion.face is not None:
            rotations[:, self._still] = quat_identity(1)
        root = _unity_place(motion.root * self._scale)
        weights, shapes = self._weights(motion), [] if motion.face is None else self._shapes
        for k in range(len(motion)):
            messages = [
                osc.message("/VMC/Ext/OK", 1),
                osc.message("/VMC/Ext/T", motion.start + k / motion.fps),
                osc.message("/VMC/Ext/Root/Pos", "root", 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0),
            ]
            places = self._places.copy()
            places[0] = root[k]
            values = np.concatenate([places, rotations[k]], 1).astype(">f4")
            messages += [head + row.tobytes() for head, row in zip(self._heads, values, strict=True)]
            messages += [head + struct.pack(">f", value) for head, value in zip(shapes, weights[k], strict=True)]
            messages.append(osc.message("/VMC/Ext/Blend/Apply"))
            yield osc.split_bundles(messages, self._most)

    def _weights(self, motion: Motion) -> list[list[float]]:
        """(T, S) weights of the blend shapes, 0 … 1; (T, 0) without a face."""
        if motion.face is None:
            return [[] for _ in range(len(motion))]
        face = np.clip(motion.face, 0, 1)
        if self._names == "arkit":
            return face.tolist()  # type: ignore[no-any-return]
        presets = vrm_presets(face)
        return np.clip(np.stack([presets[name] for name in _VRM0], 1), 0, 1).tolist()  # type: ignore[no-any-return]


def avatar_offsets(avatar: Avatar) -> dict[str, Array]:
    """Bone → (3,) metres from the next bone above it, in the avatar's T-pose; of the hips from the avatar's origin.

    Raises:
        InputError: there are no hips.
    """
    own, bones, places = humanoid(), avatar.rig.bones, np.array(avatar.skeleton.tpose)
    if "hips" not in bones:
        raise InputError(f"{avatar.file.name} has no body that VMC could move", "leave --avatar out: VMC then moves the face")
    hips = bones["hips"]
    places[:, 1] += world_matrices(avatar.file)[avatar.rig.nodes[hips]][1, 3] - places[hips, 1]  # its own is from the floor
    offsets = {}
    for k, name in enumerate(own.names):
        if name not in bones:
            continue
        above = own.parents[k]
        while above >= 0 and own.names[above] not in bones:
            above = own.parents[above]
        start = np.zeros(3) if above < 0 else places[bones[own.names[above]]]
        offsets[name] = places[bones[name]] - start
    return offsets


def _unity_place(places: Array) -> Array:
    return places * np.array([-1.0, 1.0, 1.0])
