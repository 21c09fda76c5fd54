"""A run of a flow as a bundle: codes and beginnings of its speakers, and how it moves when nobody corrects it."""

from __future__ import annotations

from collections.abc import Mapping
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
from ...runtime.flow_weights import FlowSizes
from ...runtime.statistics import Statistics
from ...runtime.system import write_flow

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
    **options: Any,
) -> None:
    """Write a flow's bundle.

    Args:
        path: file to write.
        model: the flow.
        kept: statistics and examples of the run folder.
        small: quantise the large products to whole numbers of 8 bits.
        facts: for the manifest.
        options: of `write_flow`.

    Raises:
        InputError: a history longer than the stretches that a run keeps,
    """
    measured, feedback_gain = _statistics(model, {name: torch.from_numpy(value) for name, value in kept.items()})
    sizes = FlowSizes(**model.runtime_sizes(), int8=small, feedback_gain=feedback_gain)
    write_flow(path, model.export(), sizes, measured, facts=facts, **options)


@torch.no_grad()
def _statistics(model: Any, examples: dict[str, torch.Tensor]) -> tuple[Statistics, float]:
    """What the runtime has to know, with a style code and beginnings for each speaker; and the pull."""
    stretches = examples["stretches"]
    speakers, count = stretches.shape[:2]
    history: int = model.config.history
    if history > stretches.shape[2]:
        raise InputError(f"a history of {history} frames", f"at most {stretches.shape[2]} for a bundle")
    codes = model.style_of(stretches.flatten(0, 1))
    feedback_gain, made = 1.0, {}
    if "pose_spread" in examples:
        feedback_gain, made["free_mean"], made["free_std"] = _calibrate(model, examples, codes)
        made["speaker_std"] = examples["pose_spread"]
    known = {
        **{f.name: examples[f.name] for f in fields(Statistics)[:8]},
        "histories": _calmest(stretches.flatten(0, 1), history), "style_codes": codes.view(speakers, count, -1).mean(1),
        "speaker_mean": examples["pose_centre"], **made,
    }  # fmt: skip
    if model.controls:
        known["control_quantiles"] = torch.from_numpy(control_quantiles(model, {n: x.numpy() for n, x in examples.items()}))
    return Statistics(**{name: np.ascontiguousarray(value.numpy(), np.float32) for name, value in known.items()}), feedback_gain


@torch.no_grad()
def _calibrate(model: Any, examples: dict[str, torch.Tensor], codes: torch.Tensor) -> tuple[float, torch.Tensor, torch.Tensor]:
    """How a network moves when nobody corrects it, for the speech of the stretches; for one of ``per_clip_normalisation``.

    A network is trained on the next frame, in which a slow return to the mean hardly shows: left alone it strays too far, for
    too long. ``feedback_gain`` is the one of `FEEDBACK_GAINS` with which its means over some seconds wander, for the size of
    its movement, as much as those of the data do. In the data, mean and deviation are 0 and 1; the runtime takes off what is
    left of them, number by number.

    Returns:
        The feedback gain, (D,) mean, (D,) standard deviation.
    """
    wanted, found = _wandering(examples["stretches"].flatten(0, 1)), []
    for feedback_gain in FEEDBACK_GAINS if model.runtime_sizes()["residual"] else FEEDBACK_GAINS[:1]:
        made = _generate_freely(model, examples, codes, feedback_gain)
        made = made[:, min(WARM, made.shape[1] // 2) :]
        found.append((abs((_wandering(made) / wanted).log().item()), feedback_gain, made))
    _, feedback_gain, made = min(found, key=lambda one: one[0])
    return feedback_gain, made.mean((0, 1)), made.std((0, 1)).clamp_min(LEAST)


def _calmest(stretches: torch.Tensor, history: int) -> torch.Tensor:
    """(N, L, D) → (N, τ, D): where each moves least; nobody begins to speak in the middle of a gesture."""
    speeds = stretches.diff(dim=1).square().mean(-1)
    windows = stretches.unfold(1, history, 1).transpose(2, 3)
    moved = speeds.unfold(1, history - 1, 1).mean(-1) if history > 1 else stretches.square().mean(-1)
    return windows[torch.arange(len(windows)), moved.argmin(1)]


def _wandering(poses: torch.Tensor) -> torch.Tensor:
    """Deviation of the means of stretches (N, F, D), in that of all their poses."""
    return poses.mean(1).std(0).mean() / poses.std((0, 1)).mean()


def _generate_freely(model: Any, examples: dict[str, torch.Tensor], codes: torch.Tensor, feedback_gain: float) -> torch.Tensor:
    """(N, F, D) poses with random latents."""
    stretches, audio = (examples[name].flatten(0, 1) for name in ("stretches", "speech"))
    if model.controls:
        audio = model.hear(audio, torch.zeros(*audio.shape[:2], len(CONTROLS)))
    tau, poses, states = model.config.history, stretches[:, : model.config.history], None
    heard, style = frame_windows(audio, model.speech_frames), [codes] if codes.shape[1] else []
    z = model.flow.latent.sample(StepRandom(0, 0).normal, len(stretches), heard.shape[1])
    for t in range(heard.shape[1]):
        made, states = model.step(z[:, t], poses[:, -tau:], heard[:, t], states, *style)
        made = feedback_gain * made.clamp(examples["pose_low"], examples["pose_high"])
        poses = torch.cat([poses, made[:, None]], 1)
    return poses[:, tau:]


def control_quantiles(model: Any, kept: Mapping[str, Array]) -> Array:
    """(101, C) standardised, of each style control of a model."""
    quantiles, mean, std = (kept[f"control_{what}"] for what in ("quantiles", "mean", "std"))
    found: Array = ((quantiles - mean) / std)[:, [CONTROLS.index(name) for name in model.controls]]
    return found
