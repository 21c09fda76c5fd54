"""Keys of recipes and runs whose names have changed since 0.1.0, for errors that say the new ones."""

from __future__ import annotations

from collections.abc import Iterable

from ..errors import nearest

__all__ = ["RENAMED", "suggest_key"]

RENAMED = {
    "ear": ("speech_encoder",), "wordless": ("word_dropout",), "unseeded": ("seed_dropout",),
    "labelled": ("label_conditioning",),
    "faced": ("face_teacher_forcing",), "borrowed": ("speech_swap",), "manner": ("motion_statistics",),
    "gain": ("gain_augmentation",), "taught": ("distillation",), "pooled": ("pooling_window",), "styled": ("style_injection",),
    "judging": ("adversarial_loss",), "judge_poses": ("pose_discriminator",), "judge_channels": ("discriminator_channels",),
    "judge": ("discriminator_channels", "discriminator"), "by_clip": ("per_clip_normalisation",),
}  # fmt: skip
"""Key, or objective, of recipes and runs of 0.1.0 → its names since, of which a model has one."""


def suggest_key(name: str, known: Iterable[str]) -> str:
    """A hint for a key or an objective that there is not: its new name, or the most similar one.

    >>> suggest_key("by_clip", ["corpus", "per_clip_normalisation"])
    "it is called 'per_clip_normalisation' now; change the name in the recipe, or train the run again"
    """
    known = list(known)
    for new in RENAMED.get(name, ()):
        if new in known:
            return f"it is called {new!r} now; change the name in the recipe, or train the run again"
    return nearest(name, known)
