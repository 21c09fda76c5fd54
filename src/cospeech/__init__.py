"""cospeech: speech in, a moving character out.

Public names are resolved on first use, so that ``import cospeech`` (and ``cospeech --help``) stays light.
"""

from __future__ import annotations

import os
from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .audio.speech import Speech, Word
    from .errors import CospeechError, InputError
    from .evaluation import evaluate
    from .models import load
    from .motion.motion import Motion
    from .motion.skeleton import Skeleton, humanoid

__version__ = "0.1.0"

__all__ = [
    "CospeechError", "InputError", "Motion", "Skeleton", "Speech", "Word", "__version__", "evaluate", "humanoid", "load",
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
    "Skeleton": "motion.skeleton",
    "Speech": "audio.speech",
    "Word": "audio.speech",
    "evaluate": "evaluation",
    "humanoid": "motion.skeleton",
    "load": "models",
}


def __getattr__(name: str) -> object:
    if name not in _HOME:
        raise AttributeError(f"module 'cospeech' has no attribute {name!r}")
    value = getattr(import_module(f".{_HOME[name]}", __name__), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
