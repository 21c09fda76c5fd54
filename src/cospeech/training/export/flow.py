"""Makes a bundle of a flow: style codes and first poses of its speakers, and statistics of its motion when it runs freely."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields
from os import PathLike
from typing import Any

import numpy as np
import torch

from ...errors import InputError
from ...models.nn.conditioning import frame_windows
from ...models.nn.objective import StepRandom
from ...motion.poses.controls import CONTROLS
from ...motion.rotations import Array
from ...runtime.bundles.statistics import Statistics
from ...runtime.flow.weights import FlowSizes
from ...runtime.system import write_flow
from ..train import Tell

__all__ = ["bundle_flow", "control_quantiles"]

WARM = 24  # frames; ours: after these, a network has left the poses with which it began
FEEDBACK_GAINS = (1.0, 0.9975, 0.995, 0.9925, 0.99, 0.985, 0.98, 0.97)  # ours
LEAST = 0.2  # ours: a number that a network hardly moves is not magnified without limit


def bundle_flow(
    path: str | PathLike[str],
    model: Any,
    arrays: Mapping[str, Array],
    *,
    small: bool,
    facts: dict[str, Any],
    progress: Tell | None = None,
    **options: Any,
) -> None:
    """Write a flow's bundle.

    Args:
        path: file to write.
        model: the flow.
        arrays: statistics and examples of the run folder.
        small: whether the large products are quantised to whole numbers of 8 bits.
        facts: for the manifest.
        progress: is told how many frames are played, of how many.
        options: of `write_flow`.

    Raises:
        InputError: a history longer than the stretches that a run keeps.
    """
    examples = {name: torch.from_numpy(value) for name, value in arrays.items()}
    statistics, feedback_gain = _statistics(model, examples, progress)
    sizes = FlowSizes(**model.runtime_sizes(), int8=small, feedback_gain=feedback_gain)
    write_flow(path, model.export(), sizes, statistics, facts=facts, **options)


@torch.no_grad()
def _statistics(model: Any, examples: dict[str, torch.Tensor], progress: Tell | None) -> tuple[Statistics, float]:
    """The statistics that the runtime needs, with a style code and first poses for each speaker; and the feedback gain."""
    stretches = examples["stretches"]
    speakers, count = stretches.shape[:2]
    history: int = model.config.history
    if history > stretches.shape[2]:
        raise InputError(f"the run's history of {history} frames is too long for a bundle", f"at most {stretches.shape[2]}")
    codes = model.style_of(stretches.flatten(0, 1))
    feedback_gain, moments = 1.0, {}
    if "pose_spread" in examples:
        feedback_gain, moments["free_mean"], moments["free_std"] = _calibrate(model, examples, codes, progress)
        moments["speaker_std"] = examples["pose_spread"]
    tensors = {
        **{f.name: examples[f.name] for f in fields(Statistics)[:8]},
        "histories": _calmest(stretches.flatten(0, 1), history), "style_codes": codes.view(speakers, count, -1).mean(1),
        "speaker_mean": examples["pose_centre"], **moments,
    }  # fmt: skip
    if model.controls:
        tensors["control_quantiles"] = torch.from_numpy(control_quantiles(model, {n: x.numpy() for n, x in examples.items()}))
    return Statistics(
        **{name: np.ascontiguousarray(value.numpy(), np.float32) for name, value in tensors.items()}
    ), feedback_gain


def _calibrate(
    model: Any, examples: dict[str, torch.Tensor], codes: torch.Tensor, progress: Tell | None
) -> tuple[float, torch.Tensor, torch.Tensor]:
    """Measure how a network with ``per_clip_normalisation`` moves when it runs freely, with the speech of the stretches.

    A network is trained on the next frame, in which a slow return to the mean hardly shows. So when it runs freely, it strays
    too far, for too long. ``feedback_gain`` is the one of `FEEDBACK_GAINS` with which the network's means over some seconds
    vary, relative to the size of its movement, as much as those of the data. The data have mean 0 and deviation 1; the runtime
    removes the difference from these that is left, number by number.

    Returns:
        The feedback gain, (D,) mean, (D,) standard deviation.
    """
    gains = FEEDBACK_GAINS if model.runtime_sizes()["residual"] else FEEDBACK_GAINS[:1]
    takes = _generate_freely(model, examples, codes, gains, progress)
    takes = takes[:, :, min(WARM, takes.shape[2] // 2) :]
    target = _wandering(examples["stretches"].flatten(0, 1)[:, -takes.shape[2] :])  # means of fewer poses vary more
    best = min(range(len(gains)), key=lambda k: abs((_wandering(takes[k]) / target).log().item()))
    return gains[best], takes[best].mean((0, 1)), takes[best].std((0, 1)).clamp_min(LEAST)


def _calmest(stretches: torch.Tensor, history: int) -> torch.Tensor:
    """(N, L, D) → (N, τ, D): the part of each with the least movement. Speech does not begin in the middle of a gesture."""
    speeds = stretches.diff(dim=1).square().mean(-1)
    windows = stretches.unfold(1, history, 1).transpose(2, 3)
    movement = speeds.unfold(1, history - 1, 1).mean(-1) if history > 1 else stretches.square().mean(-1)
    return windows[torch.arange(len(windows)), movement.argmin(1)]


def _wandering(poses: torch.Tensor) -> torch.Tensor:
    """Standard deviation of the means of stretches (N, F, D), over that of all their poses."""
    return poses.mean(1).std(0).mean() / poses.std((0, 1)).mean()


def _generate_freely(
    model: Any, examples: dict[str, torch.Tensor], codes: torch.Tensor, gains: Sequence[float], progress: Tell | None
) -> torch.Tensor:
    """(G, N, F, D) poses with random latents, the same ones for each of G feedback gains; all are played at once."""
    stretches, audio = (examples[name].flatten(0, 1) for name in ("stretches", "speech"))
    if model.controls:
        audio = model.hear(audio, torch.zeros(*audio.shape[:2], len(CONTROLS)))
    takes, tau, states = len(gains), model.config.history, None
    windows, style = frame_windows(audio, model.speech_frames), [codes.repeat(takes, 1)] if codes.shape[1] else []
    frames = windows.shape[1]
    gain = torch.tensor(gains).repeat_interleave(len(stretches))[:, None]
    z = model.runtime_sizes().get("latent_scale", 1.0) * model.flow.latent.sample(
        StepRandom(0, 0).normal, len(stretches), frames
    )
    poses = list(stretches[:, :tau].repeat(takes, 1, 1).unbind(1))
    for t in range(frames):
        pose, states = model.step(
            z[:, t].repeat(takes, 1), torch.stack(poses[-tau:], 1), windows[:, t].repeat(takes, 1, 1), states, *style
        )
        poses.append(gain * pose.clamp(examples["pose_low"], examples["pose_high"]))
        if progress is not None:
            progress(t + 1, frames, "measuring how it moves by itself")
    return torch.stack(poses[tau:], 1).unflatten(0, (takes, -1))


def control_quantiles(model: Any, arrays: Mapping[str, Array]) -> Array:
    """(101, C) standardised quantiles of each style control of a model."""
    quantiles, mean, std = (arrays[f"control_{what}"] for what in ("quantiles", "mean", "std"))
    values: Array = ((quantiles - mean) / std)[:, [CONTROLS.index(name) for name in model.controls]]
    return values
