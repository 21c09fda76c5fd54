"""A run of a flow as a bundle: codes and beginnings of its speakers, and how it moves when it runs freely."""

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

WARM = 24  # frames; ours: after which a network has left the poses that it was begun with
FEEDBACK_GAINS = (1.0, 0.9975, 0.995, 0.9925, 0.99, 0.985, 0.98, 0.97)  # ours
LEAST = 0.2  # ours: a number that a network hardly moves is not magnified without end


def bundle_flow(
    path: str | PathLike[str],
    model: Any,
    kept: Mapping[str, Array],
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
        kept: statistics and examples of the run folder.
        small: quantise the large products to whole numbers of 8 bits.
        facts: for the manifest.
        progress: is told how many frames are played, of how many.
        options: of `write_flow`.

    Raises:
        InputError: a history longer than the stretches that a run keeps.
    """
    examples = {name: torch.from_numpy(value) for name, value in kept.items()}
    measured, feedback_gain = _statistics(model, examples, progress)
    sizes = FlowSizes(**model.runtime_sizes(), int8=small, feedback_gain=feedback_gain)
    write_flow(path, model.export(), sizes, measured, facts=facts, **options)


@torch.no_grad()
def _statistics(model: Any, examples: dict[str, torch.Tensor], progress: Tell | None) -> tuple[Statistics, float]:
    """What the runtime has to know, with a style code and beginnings for each speaker; and the feedback gain."""
    stretches = examples["stretches"]
    speakers, count = stretches.shape[:2]
    history: int = model.config.history
    if history > stretches.shape[2]:
        raise InputError(f"the run's history of {history} frames is too long for a bundle", f"at most {stretches.shape[2]}")
    codes = model.style_of(stretches.flatten(0, 1))
    feedback_gain, made = 1.0, {}
    if "pose_spread" in examples:
        feedback_gain, made["free_mean"], made["free_std"] = _calibrate(model, examples, codes, progress)
        made["speaker_std"] = examples["pose_spread"]
    known = {
        **{f.name: examples[f.name] for f in fields(Statistics)[:8]},
        "histories": _calmest(stretches.flatten(0, 1), history), "style_codes": codes.view(speakers, count, -1).mean(1),
        "speaker_mean": examples["pose_centre"], **made,
    }  # fmt: skip
    if model.controls:
        known["control_quantiles"] = torch.from_numpy(control_quantiles(model, {n: x.numpy() for n, x in examples.items()}))
    return Statistics(**{name: np.ascontiguousarray(value.numpy(), np.float32) for name, value in known.items()}), feedback_gain


def _calibrate(
    model: Any, examples: dict[str, torch.Tensor], codes: torch.Tensor, progress: Tell | None
) -> tuple[float, torch.Tensor, torch.Tensor]:
    """How a network moves when it runs freely, for the speech of the stretches; for one of ``per_clip_normalisation``.

    A network is trained on the next frame, in which a slow return to the mean hardly shows: left alone it strays too far, for
    too long. ``feedback_gain`` is the one of `FEEDBACK_GAINS` with which its means over some seconds wander, for the size of
    its movement, as much as those of the data do. In the data, mean and deviation are 0 and 1; the runtime takes off what is
    left of them, number by number.

    Returns:
        The feedback gain, (D,) mean, (D,) standard deviation.
    """
    gains = FEEDBACK_GAINS if model.runtime_sizes()["residual"] else FEEDBACK_GAINS[:1]
    wanted, takes = _wandering(examples["stretches"].flatten(0, 1)), _generate_freely(model, examples, codes, gains, progress)
    takes = takes[:, :, min(WARM, takes.shape[2] // 2) :]
    best = min(range(len(gains)), key=lambda k: abs((_wandering(takes[k]) / wanted).log().item()))
    return gains[best], takes[best].mean((0, 1)), takes[best].std((0, 1)).clamp_min(LEAST)


def _calmest(stretches: torch.Tensor, history: int) -> torch.Tensor:
    """(N, L, D) → (N, τ, D): the part of each in which it moves least. Speech does not begin in the middle of a gesture."""
    speeds = stretches.diff(dim=1).square().mean(-1)
    windows = stretches.unfold(1, history, 1).transpose(2, 3)
    moved = speeds.unfold(1, history - 1, 1).mean(-1) if history > 1 else stretches.square().mean(-1)
    return windows[torch.arange(len(windows)), moved.argmin(1)]


def _wandering(poses: torch.Tensor) -> torch.Tensor:
    """Standard deviation of the means of stretches (N, F, D), over that of all their poses."""
    return poses.mean(1).std(0).mean() / poses.std((0, 1)).mean()


def _generate_freely(
    model: Any, examples: dict[str, torch.Tensor], codes: torch.Tensor, gains: Sequence[float], progress: Tell | None
) -> torch.Tensor:
    """(G, N, F, D) poses with random latents, the same ones with each of G feedback gains; all are played at once."""
    stretches, audio = (examples[name].flatten(0, 1) for name in ("stretches", "speech"))
    if model.controls:
        audio = model.hear(audio, torch.zeros(*audio.shape[:2], len(CONTROLS)))
    takes, tau, states = len(gains), model.config.history, None
    heard, style = frame_windows(audio, model.speech_frames), [codes.repeat(takes, 1)] if codes.shape[1] else []
    frames = heard.shape[1]
    gain = torch.tensor(gains).repeat_interleave(len(stretches))[:, None]
    z = model.runtime_sizes().get("latent_scale", 1.0) * model.flow.latent.sample(
        StepRandom(0, 0).normal, len(stretches), frames
    )
    poses = list(stretches[:, :tau].repeat(takes, 1, 1).unbind(1))
    for t in range(frames):
        made, states = model.step(
            z[:, t].repeat(takes, 1), torch.stack(poses[-tau:], 1), heard[:, t].repeat(takes, 1, 1), states, *style
        )
        poses.append(gain * made.clamp(examples["pose_low"], examples["pose_high"]))
        if progress is not None:
            progress(t + 1, frames, "measuring how it moves by itself")
    return torch.stack(poses[tau:], 1).unflatten(0, (takes, -1))


def control_quantiles(model: Any, kept: Mapping[str, Array]) -> Array:
    """(101, C) standardised, of each style control of a model."""
    quantiles, mean, std = (kept[f"control_{what}"] for what in ("quantiles", "mean", "std"))
    found: Array = ((quantiles - mean) / std)[:, [CONTROLS.index(name) for name in model.controls]]
    return found
