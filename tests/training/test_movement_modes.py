"""Modes of movement: the features of the metric, k-means, and a store that has the modes of its frames."""

from __future__ import annotations

import numpy as np
import pytest

from cospeech.corpora.store import Store
from cospeech.corpora.store_files import Entry
from cospeech.corpora.store_writer import Piece, write_store
from cospeech.errors import InputError
from cospeech.metrics.mode_f1 import mode_features, nearest_centre
from cospeech.motion.poses import find_pose
from cospeech.motion.poses.keypoints2d import KEYPOINTS2D, to_points
from cospeech.training.movement_modes import find_centres, movement, with_modes

FPS = 15.0


def vectors(frames: int, seed: int = 0, level: float = 0.0) -> np.ndarray:
    return level + np.random.default_rng(seed).normal(0, 1, (frames, 96)).cumsum(0)


def store(folder, clips: dict[str, np.ndarray]) -> Store:
    def piece(name, values):
        split = "train" if name.startswith("train") else "validation"
        entry = Entry(name, name[-1], split, 0, len(values), 0.0, ("pose",))
        return Piece(entry, (), lambda: {"pose": values.astype(np.float32)})

    names = {"pose": KEYPOINTS2D.names}
    write_store(folder, [piece(*row) for row in clips.items()], corpus="pats", pose="keypoints2d", fps=FPS, names=names)
    return Store(folder)


def test_of_key_points_they_are_the_features_of_the_metric():
    poses = vectors(20)
    assert np.allclose(movement(poses, KEYPOINTS2D, FPS), mode_features(to_points(poses)), atol=1e-9)


def test_of_a_body_they_are_metres_from_the_hips():
    pose = find_pose("rot6d-humanoid")
    still = np.zeros((5, pose.dimensions))
    still += pose.encode(_standing())[0]
    features = movement(still, pose, 20.0)
    joints = features.shape[1] // 7
    assert features.shape == (5, 7 * joints)
    assert np.abs(features[:, : 3 * joints]).max() > 0.5
    assert np.abs(features[:, 3 * joints :]).max() == 0


def _standing():
    from cospeech.motion.motion import Motion
    from cospeech.motion.skeleton import find_skeleton

    skeleton = find_skeleton("humanoid")
    rotations = np.broadcast_to(skeleton.rest, (1, len(skeleton), 4)).copy()
    return Motion(20.0, rotations, skeleton.offsets[:1].copy(), skeleton=skeleton)


def test_groups_that_lie_apart_are_found_again_and_again():
    draw = np.random.default_rng(1)
    true = draw.integers(3, size=300)
    points = 10 * np.eye(4)[true] + draw.normal(0, 0.1, (300, 4))
    centres = find_centres(points, 3)
    modes = nearest_centre(points, centres)
    assert len({*zip(true.tolist(), modes.tolist(), strict=True)}) == 3
    assert np.array_equal(centres, find_centres(points, 3))
    with pytest.raises(InputError, match="2 frames for 3 modes"):
        find_centres(points[:2], 3)
    with pytest.raises(InputError, match="for 2 modes"):
        find_centres(np.zeros((9, 4)), 2)


def test_a_store_has_the_modes_of_its_frames(tmp_path):
    clips = {"train a": vectors(40), "train b": vectors(30, 1, 500.0), "held a": vectors(20, 2, 500.0)}
    plain = store(tmp_path / "store", clips)
    more, centres = with_modes(plain, 2)
    assert "cluster" not in plain.arrays
    assert centres.shape == (2, 240)
    for k, clip in enumerate(more.clips):
        own = nearest_centre(mode_features(to_points(more.clip(clip)["pose"].astype(float))), centres)
        assert np.array_equal(more.clip(clip)["cluster"], own)
        assert len({*own.tolist()}) == 1, k
    first, second, third = (int(more.clip(clip)["cluster"][0]) for clip in more.clips)
    assert first != second == third
    # the held-out clip moves no centre
    other, _ = with_modes(store(tmp_path / "other", clips | {"held a": vectors(20, 2, -900.0)}), 2)
    assert np.array_equal(other.clip(0)["cluster"], more.clip(0)["cluster"])
    assert np.array_equal(with_modes(store(tmp_path / "third", clips | {"held a": vectors(9, 3)}), 2)[1], centres)
