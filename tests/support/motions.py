"""Test data: a figure that gestures, looks around and speaks, computed by formulas; and a small character."""

from __future__ import annotations

import numpy as np

from cospeech.export.mannequin.character import Character, Part
from cospeech.face.gaze import write_looks
from cospeech.motion.motion import Motion
from cospeech.motion.rotations import axis_angle_to_quat, quat_identity, quat_multiply
from cospeech.motion.skeleton import humanoid
from cospeech.motion.skeletons.arkit import ARKIT_INDEX

__all__ = ["gesturing", "stand_in"]


def gesturing(frames: int, fps: float = 30.0) -> Motion:
    """Arms hang 75° below the T-pose, the right one comes up with a bent elbow; head, spine, fingers, eyes, face move;
    the eyeLook* of the face are those of the eyes."""
    skeleton = humanoid()
    t = np.arange(frames) / fps
    q = quat_identity(frames, len(skeleton))

    def turn(name: str, axis: tuple[float, float, float], angle: object) -> None:
        k = skeleton.index[name]
        q[:, k] = quat_multiply(q[:, k], axis_angle_to_quat(axis, np.broadcast_to(angle, frames)))

    lift = (1 - np.cos(2 * np.pi * t / 2)) / 2
    turn("leftUpperArm", (0, 0, 1), -np.radians(75))
    turn("rightUpperArm", (0, 0, 1), np.radians(75))
    turn("leftLowerArm", (0, 1, 0), -0.25)
    turn("rightLowerArm", (0, 1, 0), 0.25 + 1.4 * lift)
    turn("rightHand", (0, 0, 1), 0.3 * np.sin(2 * t))
    turn("spine", (0, 1, 0), 0.15 * np.sin(1.1 * t))
    turn("neck", (1, 0, 0), 0.1 * np.sin(1.7 * t))
    turn("head", (0, 1, 0), 0.5 * np.sin(0.9 * t))
    turn("jaw", (1, 0, 0), 0.05 * (1 + np.sin(9 * t)))
    turn("hips", (0, 1, 0), 0.1 * np.sin(0.5 * t))
    for side, sign in (("left", -1), ("right", 1)):
        turn(f"{side}Eye", (0, 1, 0), 0.2 * np.sin(1.3 * t))
        turn(f"{side}IndexProximal", (0, 0, 1), sign * 0.4 * lift)
    face = np.zeros((frames, 52))
    for k, name in enumerate(ARKIT_INDEX):
        face[:, k] = (1 + np.sin(2 * np.pi * t * (0.3 + k / 40) + k)) / 2 * (0.1 if name.startswith("mouth") else 0.6)
    yaw = np.repeat(0.2 * np.sin(1.3 * t)[:, None], 2, 1)
    face = write_looks(face, np.stack([yaw, np.zeros_like(yaw)], -1))
    root = skeleton.offsets[0] + np.stack([0.03 * np.sin(t), 0.01 * np.sin(2 * t), 0.02 * np.cos(t)], 1)
    return Motion(fps=fps, rotations=q, root=root, face=face)


def stand_in() -> Character:
    """A small figure with all that the mannequin's data can have: a skinned block per limb, and a face with five shapes."""
    skeleton = humanoid()
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], np.float32)
    faces = np.array(
        [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4],
         [1, 5, 7], [1, 7, 3]], np.int32,
    )  # fmt: skip

    def block(name: str, joint: str, size: float, colour: object, morphs: dict) -> Part:
        k = skeleton.index[joint]
        vertices = (skeleton.tpose[k] + corners * size).astype(np.float32)
        joints, weights = np.zeros((8, 4), np.int32), np.zeros((8, 4), np.float32)
        joints[:, 0], joints[:, 1], weights[:, 0], weights[:, 1] = k, skeleton.parents[k], 0.75, 0.25
        normals = (corners / np.sqrt(3)).astype(np.float32)
        return Part(name, vertices, normals, faces, joints, weights, np.array(colour, float), 0.5, morphs)

    def shape(*rows: int) -> np.ndarray:
        delta = np.zeros((8, 3), np.float32)
        delta[list(rows), 1] = -0.02
        return delta

    shapes = {"jawOpen": shape(0, 1), "eyeBlinkLeft": shape(6, 7), "tongueOut": shape(*range(8)), "browInnerUp": shape(2)}
    return Character(
        skeleton,
        (
            block("face", "head", 0.09, (0.8, 0.5, 0.4), shapes),
            block("teeth", "jaw", 0.02, np.full((8, 3), 0.9), {"jawOpen": shape(*range(8))}),
            block("hand", "rightHand", 0.05, (0.2, 0.3, 0.9), {}),
            block("chest", "upperChest", 0.15, np.linspace(0, 1, 24).reshape(8, 3), {}),
        ),
    )
