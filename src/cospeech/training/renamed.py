"""Keys of recipes and runs that changed after 0.1.0: new names, for error messages, and former values of new settings."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from ..errors import nearest

__all__ = ["RENAMED", "add_former_values", "suggest_key"]

RENAMED = {
    "ear": ("speech_encoder",), "wordless": ("word_dropout",), "unseeded": ("seed_dropout",),
    "labelled": ("label_conditioning",),
    "faced": ("face_teacher_forcing",), "borrowed": ("speech_swap",), "manner": ("motion_statistics",),
    "gain": ("gain_augmentation",), "taught": ("distillation",), "pooled": ("pooling_window",), "styled": ("style_injection",),
    "judging": ("adversarial_loss",), "judge_poses": ("pose_discriminator",), "judge_channels": ("discriminator_channels",),
    "judge": ("discriminator_channels", "discriminator"), "by_clip": ("per_clip_normalisation",),
}  # fmt: skip
"""Key, or objective, of recipes and runs of 0.1.0 → its new names; each model has one of them."""

_FORMER = {"stylised-flow": {"encoder_relu": False}, "stylised-flow-extended": {"encoder_relu": False}}
"""Network → new setting → the value that its runs had before the setting existed."""


def add_former_values(name: str, config: Mapping[str, Any]) -> dict[str, Any]:
    """The settings of a run, and the former values of those settings that did not exist when it was trained.

    >>> add_former_values("stylised-flow", {"steps": 8})
    {'encoder_relu': False, 'steps': 8}
    """
    return _FORMER.get(name, {}) | dict(config)


def suggest_key(name: str, names: Iterable[str]) -> str:
    """A hint for an unknown key or objective: its new name, or the most similar one.

    >>> suggest_key("by_clip", ["corpus", "per_clip_normalisation"])
    "it is called 'per_clip_normalisation' now; change the name in the recipe, or train the run again"
    """
    names = list(names)
    for new in RENAMED.get(name, ()):
        if new in names:
            return f"it is called {new!r} now; change the name in the recipe, or train the run again"
    return nearest(name, names)
