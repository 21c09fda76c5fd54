"""cospeech: it turns speech into a moving character.

Public names are imported on first use, so that ``import cospeech`` (and ``cospeech --help``) is fast.
"""

from __future__ import annotations

import os
import sys
from importlib import import_module
from importlib.machinery import ModuleSpec
from types import ModuleType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .audio.speech import Speech, Word
    from .errors import CospeechError, InputError
    from .evaluation import evaluate
    from .generate import open_live_session
    from .models import load
    from .motion.motion import Motion
    from .motion.skeleton import Skeleton, humanoid
    from .rules.plan_edits import Plan

__version__ = "0.1.0"

__all__ = [
    "CospeechError", "InputError", "Motion", "Plan", "Skeleton", "Speech", "Word", "__version__", "evaluate", "humanoid",
    "load", "open_live_session",
]  # fmt: skip

NO_TELEMETRY = {
    "ORT_DISABLE_TELEMETRY": "1",  # onnxruntime >= 1.31: else files in ~/.cache, and look-ups of a server of Microsoft's
    "HF_HUB_DISABLE_TELEMETRY": "1",  # huggingface-hub, of the extras wav2vec and asr
    "RAY_USAGE_STATS_ENABLED": "0",  # ray, of `prepare --backend ray`
}
"""Environment variables that switch off the telemetry of our dependencies (docs/security.md).

They are set here, because the dependencies read them once, when they are imported; child processes inherit them. They replace
what the user has set: there is no telemetry in cospeech, and none through it.
"""
os.environ.update(NO_TELEMETRY)

_HOME = {
    "CospeechError": "errors",
    "InputError": "errors",
    "Motion": "motion.motion",
    "Plan": "rules.plan_edits",
    "Skeleton": "motion.skeleton",
    "Speech": "audio.speech",
    "Word": "audio.speech",
    "evaluate": "evaluation",
    "humanoid": "motion.skeleton",
    "load": "models",
    "open_live_session": "generate",
}


_NEW_PATHS = {
    "demo": "cli.demo",
    "emotions": "audio.emotions",
    "poses": "motion.poses",
    "poses.controls": "motion.poses.controls",
    "prepare": "corpora.prepare",
    "recipe": "training.recipe",
    "robot": "motion.robot",
    "rotations": "motion.rotations",
    "runtime.gesturer": "runtime.model",
    "skeletons": "motion.skeletons",
    "skeletons.arkit": "motion.skeletons.arkit",
    "speech": "audio.speech",
    "style_mixing": "experiments.style_mixing",
    "train": "training.train",
}
"""Import paths of 0.1.0's documentation → the present paths."""


class _OldPathFinder:
    """Finds a module by its path in an earlier documentation: both names lead to the same object.

    It is finder and loader in one. The base classes of importlib.abc are not used: their import takes longer than this module.
    """

    def find_spec(self, name: str, path: object = None, target: object = None) -> ModuleSpec | None:
        is_moved = name.removeprefix(f"{__name__}.") in _NEW_PATHS
        return ModuleSpec(name, self) if is_moved else None  # type: ignore[arg-type]

    def create_module(self, spec: ModuleSpec) -> ModuleType:
        module = import_module(f".{_NEW_PATHS[spec.name.removeprefix(f'{__name__}.')]}", __name__)
        self._spec = module.__spec__
        return module

    def exec_module(self, module: ModuleType) -> None:
        module.__spec__ = self._spec  # restore the spec that the import system has replaced


sys.meta_path.insert(0, _OldPathFinder())  # before the finder of files, which would find a part of a package a second time


def __getattr__(name: str) -> object:
    if name not in _HOME:
        raise AttributeError(f"module 'cospeech' has no attribute {name!r}")
    value = getattr(import_module(f".{_HOME[name]}", __name__), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
