"""StAGE: Mix-StAGE (`cospeech.models.mix_stage`) with one sub-generator: "M = 1 in equation 2" (Ahuja et al. 2020, 5.1)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from .mix_stage import MixStage, MixStageConfig

__all__ = ["Stage", "StageConfig"]


@dataclass(frozen=True)
class StageConfig(MixStageConfig):
    """Settings of Mix-StAGE, with another default of M."""

    TINY: ClassVar[Mapping[str, Any]] = {**MixStageConfig.TINY, "modes": 1}

    modes: int = 1
    """M; section 5.1."""


class Stage(MixStage):
    """StAGE (Ahuja et al. 2020): Mix-StAGE with a single generator; one motion for one speech, in the style of a speaker.

    No mixture, and therefore no H.
    """

    Config = StageConfig
