"""Faces of characters that are driven in VRM's presets or Oculus' visemes: what was written is read back."""

from __future__ import annotations

import numpy as np
import pytest

from cospeech.convert import convert_file
from cospeech.export import load, save
from cospeech.export.avatar import load_avatar
from cospeech.export.visemes import oculus_visemes, vrm_presets
from cospeech.motion.motion import Motion
from cospeech.motion.skeletons.arkit import ARKIT, ARKIT_INDEX
from tests.export.test_avatar import as_vrm1, rewrite, still  # noqa: F401  a fixture
from tests.support.motions import gesturing

PRESETS = {  # target, share: happy opens the mouth a little, too, and the lids of both eyes are one preset
    "aa": [(0, 1.0)], "ih": [(1, 1.0)], "ou": [(2, 1.0)], "ee": [(3, 1.0)], "oh": [(4, 1.0)],
    "happy": [(5, 1.0), (0, 0.25)], "sad": [(6, 0.5)], "blink": [(7, 1.0), (8, 1.0)], "blinkLeft": [(7, 1.0)],
}  # fmt: skip


def talking(frames: int = 60) -> Motion:
    """A figure whose mouth, lids and smile go to and fro, each at its own pace."""
    motion, face = gesturing(frames), np.zeros((frames, len(ARKIT)))
    times = np.arange(frames) / 30
    paces = {"jawOpen": (1.1, 0.4), "mouthPucker": (0.7, 0.6), "mouthStretchLeft": (0.9, 0.2), "mouthStretchRight": (0.9, 0.2)}
    paces |= {
        "eyeBlinkLeft": (0.5, 1.0),
        "eyeBlinkRight": (0.5, 0.8),
        "mouthSmileLeft": (0.2, 0.8),
        "mouthSmileRight": (0.2, 0.8),
    }
    for name, (pace, most) in paces.items():
        face[:, ARKIT_INDEX[name]] = most * (1 - np.cos(2 * np.pi * pace * times)) / 2
    return Motion(fps=30.0, rotations=motion.rotations, root=motion.root, face=face, skeleton=motion.skeleton)


def as_presets(document: dict) -> None:
    as_vrm1(document)
    face = next(k for k, node in enumerate(document["nodes"]) if node.get("name") == "face")
    document["extensions"]["VRMC_vrm"]["expressions"]["preset"] = {
        name: {"morphTargetBinds": [{"node": face, "index": target, "weight": share} for target, share in binds]}
        for name, binds in PRESETS.items()
    }


def test_a_character_of_vrm_keeps_its_face_when_its_clip_is_read(still, tmp_path):  # noqa: F811
    rewrite(still, tmp_path / "me.glb", as_presets)
    talk, avatar = talking(), load_avatar(tmp_path / "me.glb")
    save(talk, tmp_path / "talk.glb", avatar=avatar)
    again = load(tmp_path / "talk.glb")
    (expected,), (weights,) = (avatar.face.weights(motion.face).values() for motion in (talk, again))
    assert expected.max(0)[[0, 1, 2, 3, 4, 5, 7, 8]].min() > 0.1
    assert np.abs(weights - expected).mean() < 0.005
    assert np.abs(weights - expected).max() < 0.1


def test_a_face_that_is_read_can_be_written_in_another_format(still, tmp_path):  # noqa: F811
    rewrite(still, tmp_path / "me.glb", as_presets)
    talk = talking()
    save(talk, tmp_path / "talk.glb", avatar=tmp_path / "me.glb")
    convert_file(tmp_path / "talk.glb", tmp_path / "talk.vrma")
    read, expected = vrm_presets(load(tmp_path / "talk.vrma").face), vrm_presets(talk.face)
    for name in ("aa", "ou", "oh", "blink", "happy"):
        assert np.corrcoef(read[name], expected[name])[0, 1] > 0.95, name


def test_visemes_of_oculus_are_read_and_the_lids_of_arkit_beside_them(still, tmp_path):  # noqa: F811
    names = [f"viseme_{name}" for name in ("aa", "E", "I", "O", "U", "PP")] + ["eyeBlinkLeft", "eyeBlinkRight"]

    def as_oculus(document: dict) -> None:
        extras = next(mesh for mesh in document["meshes"] if mesh["name"] == "face")["extras"]
        extras["targetNames"] = names + [f"x{k}" for k in range(52 - len(names))]

    rewrite(still, tmp_path / "me.glb", as_oculus)
    talk, avatar = talking(), load_avatar(tmp_path / "me.glb")
    assert avatar.face.alphabet == "Oculus"
    save(talk, tmp_path / "talk.glb", avatar=avatar)
    again = load(tmp_path / "talk.glb").face
    for name in ("eyeBlinkLeft", "eyeBlinkRight"):
        np.testing.assert_allclose(again[:, ARKIT_INDEX[name]], talk.face[:, ARKIT_INDEX[name]], atol=1e-5)
    read, expected = oculus_visemes(again), oculus_visemes(talk.face)
    for name in ("aa", "E", "O", "U"):
        assert np.corrcoef(read[name], expected[name])[0, 1] > 0.95, name


def test_a_clip_that_moves_no_target_has_no_face(still, tmp_path):  # noqa: F811
    rewrite(still, tmp_path / "me.glb", as_presets)
    assert load_avatar(tmp_path / "me.glb").face.face({}, np.zeros(3)) is None


@pytest.mark.parametrize("face", [True, False])
def test_a_gaze_of_eye_bones_alone_is_kept_by_expressions(tmp_path, face):
    motion = gesturing(5)
    eyes = [motion.skeleton.index[name] for name in ("leftEye", "rightEye")]
    motion.rotations[:, eyes] = [0, np.sin(0.1), 0, np.cos(0.1)]  # .2 to the left
    motion = Motion(motion.fps, motion.rotations, motion.root, np.zeros((5, 52)) if face else None, motion.skeleton)
    save(motion, tmp_path / "a.vrma", look_at=False)
    read = load(tmp_path / "a.vrma")
    np.testing.assert_allclose(read.rotations[:, eyes], motion.rotations[:, eyes], atol=0.01)
    assert read.face[:, ARKIT_INDEX["eyeLookOutLeft"]].min() > 0.1
