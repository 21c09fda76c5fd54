"""cospeech: speech in, a moving character out.

Public names are resolved on first use, so that ``import cospeech`` (and ``cospeech --help``) stays light.
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
"""Variables of the environment that keep our dependencies from reporting home (docs/security.md).

They are set here, because the dependencies read them once, when they are imported, and their child processes inherit them.
What the user has set is overruled: there is no telemetry in cospeech, and none through it.
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


_MOVED = {
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
"""Import paths of 0.1.0's documentation → where they lead now."""


class _Moved:
    """Finds a module by the path that it had in an earlier documentation: the same object, under both names.

    Finder and loader in one, without the base classes of importlib.abc, whose import takes longer than all the rest here.
    """

    def find_spec(self, name: str, path: object = None, target: object = None) -> ModuleSpec | None:
        moved = name.removeprefix(f"{__name__}.") in _MOVED
        return ModuleSpec(name, self) if moved else None  # type: ignore[arg-type]

    def create_module(self, spec: ModuleSpec) -> ModuleType:
        module = import_module(f".{_MOVED[spec.name.removeprefix(f'{__name__}.')]}", __name__)
        self._own = module.__spec__
        return module

    def exec_module(self, module: ModuleType) -> None:
        module.__spec__ = self._own  # its own, which the import system has replaced


sys.meta_path.insert(0, _Moved())  # before the one of files, which would find a part of a package a second time


def __getattr__(name: str) -> object:
    if name not in _HOME:
        raise AttributeError(f"module 'cospeech' has no attribute {name!r}")
    value = getattr(import_module(f".{_HOME[name]}", __name__), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
