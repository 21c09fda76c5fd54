"""The report of a run of ``generate``: the content of ``report.json``."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict, Field

__all__ = ["Failure", "Report", "Reports"]


class Report(BaseModel):
    """Facts of one run; ``report.model_dump_json(indent=2)`` is ``report.json``."""

    model_config = ConfigDict(frozen=True)

    model: str = Field(description="registry name of the model")
    speech_seconds: float = Field(description="length of the speech")
    frames: int = Field(description="frames of each take: exactly ceil(speech_seconds × fps)")
    fps: float = Field(description="frames per second")
    seed: int = Field(description="seed of the first take; the next takes count up from it")
    takes: int = Field(description="number of takes")
    realtime_factor: float = Field(description="seconds of work per second of motion, files included")
    emotion: dict[str, float] = Field(description="probability of each emotion that was given or heard, over the whole speech")
    played: dict[str, float] = Field(description="weight of each emotion that was played: given, or surely heard")
    arousal: float | None = Field(
        None, description="mean arousal that was heard in the voice and played, -1 … 1; none where an emotion was given"
    )
    style: str = Field(description="style in which was gestured")
    style_mixture: dict[str, float] | None = Field(
        None, description="speaker → weight, where a model plays a mixture of speakers; of an example the nearest one"
    )
    speaker: dict[str, float] | None = Field(
        None, description="probability of each speaker, where a model tells by the voice who speaks"
    )
    outputs: list[str] = Field(description="files written")
    version: str = Field(description="version of cospeech")


class Failure(BaseModel):
    """A speech that failed, of a run over several."""

    model_config = ConfigDict(frozen=True)

    speech: str = Field(description="its file")
    error: str = Field(description="what is wrong, and how to mend it")
    ours: bool = Field(description="whether it is a failure of ours, not something wrong with the speech")


class Reports(BaseModel):
    """Facts of a run over several speeches."""

    model_config = ConfigDict(frozen=True)

    speeches: list[Report] = Field(description="one of each speech, in order")
    failed: list[Failure] = Field(description="those of which nothing was made")
