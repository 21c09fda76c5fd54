"""Trained networks as the functions that metrics take: codes of gesture autoencoders (FGD), speakers' probabilities (IS)."""

from __future__ import annotations

from collections.abc import Callable
from hashlib import sha256

import numpy as np
import torch
from torch import Tensor, nn

from ..errors import InputError
from ..metrics.sample import FeatureNet, Sample
from ..motion.motion import Motion
from ..motion.points import Points
from ..motion.poses import Pose, find_pose
from ..motion.rotations import Array
from ..motion.skeleton import find_skeleton
from .gesture_autoencoder import FgdAutoencoder, GestureAutoencoder
from .speaker_classifier import SpeakerClassifier

__all__ = ["classifier_net", "feature_net", "fingerprint", "vectors_of"]

HOP = 10  # frames between windows; stride of the published data of TED (and of BEAT's FGD)
RATE = 1e-3  # ours: relative difference of frame rates that does not count
BATCH = 512  # windows at a time; ours


def fingerprint(net: nn.Module) -> str:
    """Eight hexadecimal digits that identify a network: SHA-256 of its parameters and buffers."""
    digest = sha256()
    for name, value in sorted(net.state_dict().items()):
        digest.update(name.encode() + str(tuple(value.shape)).encode())
        digest.update(value.detach().cpu().contiguous().numpy().tobytes())
    return digest.hexdigest()[:8]


def vectors_of(sample: Sample, pose: Pose, fps: float) -> Array:
    """(T, D) the vectors of a sample that a network of this representation and rate sees.

    Raises:
        InputError: another frame rate, or the sample lacks key points or joints.
    """
    if abs(sample.fps / fps - 1) > RATE:
        raise InputError(f"{sample.name!r} at {sample.fps:g} frames per second", f"the feature network was made for {fps:g}")
    if pose.source == "points":
        values, layout = (sample.positions, "ted") if sample.points is None else (sample.points, "pats")
        if values is None or (layout == "ted") is not (pose.name == "direction-vectors"):
            raise InputError(f"{sample.name!r} has not the key points of {pose.name}", "a feature network of this body")
        return pose.encode(Points(sample.fps, values, layout))
    skeleton = find_skeleton(pose.skeleton)  # type: ignore[attr-defined]  # all representations of motion have one
    if sample.rotations is None or sample.positions is None:
        raise InputError(f"{sample.name!r} has no joint rotations", f"the feature network sees {pose.name}")
    rotations = np.broadcast_to(skeleton.rest, (len(sample), len(skeleton), 4)).copy()
    joints = [(k, skeleton.index[name]) for k, name in enumerate(sample.names) if name in skeleton.index]
    if len(joints) < len(sample.names):
        strange = next(name for name in sample.names if name not in skeleton.index)
        raise InputError(f"{sample.name!r} has a joint {strange!r}", f"the feature network sees {skeleton.kind} skeletons")
    rotations[:, [there for _, there in joints]] = sample.rotations[:, [here for here, _ in joints]]
    return pose.encode(Motion(sample.fps, rotations, np.array(sample.positions[:, 0]), skeleton=skeleton))


def _window_net(
    net: nn.Module,
    rows: Callable[[Tensor], Tensor],
    window: int,
    *,
    name: str,
    pose: str,
    fps: float,
    mean: Array,
    std: Array,
    hop: int,
) -> FeatureNet:
    """``rows`` of standardised windows (N, window, D) as a named function of recordings."""  # fmt: skip
    representation = find_pose(pose)
    mean, std = np.asarray(mean, np.float64), np.asarray(std, np.float64)
    if net.pose != representation.dimensions:
        raise InputError(f"{name!r} sees {net.pose} numbers a pose", f"{pose} has {representation.dimensions}")
    if mean.shape != (representation.dimensions,) or std.shape != mean.shape or not (std > 0).all():
        raise InputError(
            f"statistics of shapes {mean.shape} and {std.shape} for {pose}", f"({representation.dimensions},), > 0"
        )
    net.eval()

    @torch.no_grad()
    def features(windows: Array) -> Array:
        device = next(net.parameters()).device
        standard = torch.from_numpy(((windows - mean) / std).astype(np.float32))
        return np.concatenate([rows(part.to(device)).cpu().double().numpy() for part in standard.split(BATCH)])

    full = f"{name} {fingerprint(net)}, {pose} at {fps:g} fps"
    return FeatureNet(full, features, window, hop, lambda sample: vectors_of(sample, representation, fps))


def feature_net(net: nn.Module, *, name: str, pose: str, fps: float, mean: Array, std: Array, hop: int = HOP) -> FeatureNet:
    """The codes of a trained autoencoder, in evaluation mode, as the features of metrics.

    Args:
        net: of `cospeech.models.gesture_autoencoder`; ``net.encode`` gives the features of ``net.window`` frames.
        name: its registry name or its run; the printed name has the network's `fingerprint` too.
        pose, fps: representation and rate that it was trained on.
        mean, std: (D,) with which its vectors were standardised.
        hop: frames between windows.

    Raises:
        InputError: the statistics do not fit the representation, or the network has no codes.
    """
    if not isinstance(net, GestureAutoencoder | FgdAutoencoder):
        raise InputError(f"{name!r} is no feature network", "train the recipe fgd_ted or a similar one")
    return _window_net(net, net.encode, net.window, name=name, pose=pose, fps=fps, mean=mean, std=std, hop=hop)


def classifier_net(net: nn.Module, *, name: str, pose: str, fps: float, mean: Array, std: Array, hop: int = HOP) -> FeatureNet:
    """The class probabilities of a trained `cospeech.models.speaker_classifier`; arguments and errors as in `feature_net`."""
    if not isinstance(net, SpeakerClassifier):
        raise InputError(f"{name!r} is no classifier", "train the recipe speaker_classifier_pats or a similar one")
    return _window_net(net, net.probabilities, net.window, name=name, pose=pose, fps=fps, mean=mean, std=std, hop=hop)
