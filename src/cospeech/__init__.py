"""cospeech: speech in, a moving character out.

Public names are resolved on first use, so that ``import cospeech`` (and ``cospeech --help``) stays light.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .contest import evaluate
    from .errors import CospeechError, InputError
    from .models import load
    from .motion import Motion
    from .skeleton import Skeleton, humanoid
    from .speech import Speech, Word

__version__ = "0.1.0"

__all__ = [
    "CospeechError", "InputError", "Motion", "Skeleton", "Speech", "Word", "__version__", "evaluate", "humanoid", "load",
]  # fmt: skip

_HOME = {
    "CospeechError": "errors",
    "InputError": "errors",
    "Motion": "motion",
    "Skeleton": "skeleton",
    "Speech": "speech",
    "Word": "speech",
    "evaluate": "contest",
    "humanoid": "skeleton",
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
