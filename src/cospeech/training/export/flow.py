"""A run of a flow as a bundle: codes and beginnings of its speakers, and how it moves when nobody corrects it."""

from __future__ import annotations

from os import PathLike
from typing import Any

import numpy as np
import torch

from ...errors import InputError
from ...models.nn.conditioning import frame_windows
from ...models.nn.objective import StepRandom
from ...motion.poses.controls import CONTROLS, QUANTILES
from ...runtime.flow_bundle import Statistics, write_flow
from ...runtime.flow_weights import FlowSizes

__all__ = ["bundle_flow"]

WARM = 24  # frames; ours: after which a network has left the poses that it was begun with
FEEDBACK_GAINS = (1.0, 0.9975, 0.995, 0.9925, 0.99, 0.985, 0.98, 0.97)  # ours
LEAST = 0.2  # ours: a number that a network hardly moves is not magnified without end


def bundle_flow(
    path: str | PathLike[str],
    model: Any,
    statistics: dict[str, torch.Tensor],
    examples: dict[str, torch.Tensor],
    *,
    small: bool,
    facts: dict[str, Any],
    **options: Any,
) -> None:
    """Write a flow's bundle.

    Args:
        path: file to write.
        model: the flow.
        statistics, examples: of the run folder.
        small: quantise the large products to whole numbers of 8 bits.
        facts: for the manifest.
        options: of `write_flow`.

    Raises:
        InputError: a history longer than the stretches that a run keeps, or a run from before it kept their speech.
    """
    if "pose_spread" in examples and "speech" not in examples:
        raise InputError(f"a run of {facts['model']!r} that is of another version", "train it anew")
    measured, feedback_gain = _statistics(model, statistics, examples)
    sizes = FlowSizes(**model.runtime_sizes(), int8=small, feedback_gain=feedback_gain)
    write_flow(path, model.export(), sizes, measured, facts=facts | {"controls": _controls(model)}, **options)


@torch.no_grad()
def _statistics(model: Any, statistics: dict[str, torch.Tensor], examples: dict[str, torch.Tensor]) -> tuple[Statistics, float]:
    """What the runtime has to know, with a style code and beginnings for each speaker; and the pull."""
    stretches = examples["stretches"]
    speakers, count = stretches.shape[:2]
    history: int = model.config.history
    if history > stretches.shape[2]:
        raise InputError(f"a history of {history} frames", f"at most {stretches.shape[2]} for a bundle")
    codes = model.style(stretches.flatten(0, 1)) if hasattr(model, "style") else None
    codes = torch.zeros(speakers * count, 0) if codes is None else codes
    feedback_gain, made = 1.0, {}
    if "pose_spread" in examples:
        feedback_gain, made["model_mean"], made["model_std"] = _calibrate(model, examples, codes)
        made["style_gain"] = examples["pose_spread"]
    known = {
        **{name: statistics[name] for name in ("pose_mean", "pose_std", "audio_mean", "audio_std")},
        **{name: examples[name] for name in ("pose_low", "pose_high", "audio_low", "audio_high")},
        "histories": _calmest(stretches.flatten(0, 1), history), "styles": codes.view(speakers, count, -1).mean(1),
        "speaker_mean": examples["pose_centre"], "controls": _quantiles(model, statistics), **made,
    }  # fmt: skip
    return Statistics(**{name: np.ascontiguousarray(value.numpy(), np.float32) for name, value in known.items()}), feedback_gain


@torch.no_grad()
def _calibrate(model: Any, examples: dict[str, torch.Tensor], codes: torch.Tensor) -> tuple[float, torch.Tensor, torch.Tensor]:
    """Calibrate a network that was trained with ``per_clip_normalisation``, by the motion that it makes for known speech.

    A network is trained on the next frame. A slow return to the mean hardly shows there, so that its own motion drifts too far
    from the mean, for too long. ``feedback_gain`` is the one of `FEEDBACK_GAINS` with which its means over some seconds vary,
    for the size of its movement, as much as those of the data do. The runtime removes the mean and the standard deviation that
    remain, number by number; in the data they are 0 and 1.

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
    if _controls(model):
        audio = model.hear(audio, torch.zeros(*audio.shape[:2], len(CONTROLS)))
    tau, poses, states = model.config.history, stretches[:, : model.config.history], None
    heard, style = frame_windows(audio, model.speech_frames), [codes] if codes.shape[1] else []
    z = model.flow.latent.sample(StepRandom(0, 0).normal, len(stretches), heard.shape[1])
    for t in range(heard.shape[1]):
        made, states = model.step(z[:, t], poses[:, -tau:], heard[:, t], states, *style)
        made = feedback_gain * made.clamp(examples["pose_low"], examples["pose_high"])
        poses = torch.cat([poses, made[:, None]], 1)
    return poses[:, tau:]


def _controls(model: Any) -> list[str]:
    """Names of the style controls that it was trained with."""
    return list(getattr(model.config, "controls", ()))


def _quantiles(model: Any, statistics: dict[str, torch.Tensor]) -> torch.Tensor:
    """(101, C) standardised, of each."""
    if not _controls(model):
        return torch.zeros(QUANTILES, 0)
    quantiles, mean, std = (statistics[f"control_{what}"] for what in ("quantiles", "mean", "std"))
    return ((quantiles - mean) / std)[:, [CONTROLS.index(name) for name in _controls(model)]]
