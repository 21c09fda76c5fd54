"""Messages of a live session between the studio's server and its page; see `messages`."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from .messages import FrameRate, Intensity, Part, ShortText, StudioMessage

__all__ = ["ChangeLive", "InterruptLive", "LiveMessage", "LiveStatus", "StartLive", "StopLive", "TargetStatus"]


class StartLive(StudioMessage):
    """Opens a live session; binary messages of int16 samples, one channel, little-endian, follow."""

    type: Literal["start"]
    model: ShortText
    style: ShortText | None = None
    emotion: ShortText = "auto"
    intensity: Intensity = 1.0
    fps: FrameRate = 30.0
    targets: list[ShortText] = Field(default_factory=list, max_length=8)
    """Addresses as of ``cospeech stream --to``."""
    rate: Annotated[int, Field(ge=8_000, le=192_000)]
    """Samples per second."""


class ChangeLive(StudioMessage):
    """Steers a live session; only what is given changes."""

    type: Literal["change"]
    style: ShortText | None = None
    emotion: ShortText | None = None
    intensity: Intensity | None = None
    parts: Annotated[list[Part], Field(max_length=3)] | None = None


class InterruptLive(StudioMessage):
    """The character stops speaking at once."""

    type: Literal["interrupt"]


class StopLive(StudioMessage):
    """Ends the live session; the connection stays, and another one may be started."""

    type: Literal["stop"]


LiveMessage = Annotated[StartLive | ChangeLive | InterruptLive | StopLive, Field(discriminator="type")]


class TargetStatus(StudioMessage):
    """A receiver of a live session."""

    url: str
    sent: int
    """Frames."""
    problem: str
    """Reason why no frames are received now; else empty."""
    note: str
    """A note about it, such as that a page was refused."""


class LiveStatus(StudioMessage):
    """How a live session goes; sent when it starts, once a second, when something goes wrong, and when it ends.

    A frame is sent as bytes: float64 time in seconds, then float32 root (3), rotations (joints, 4) and face (52).
    """

    type: Literal["status"] = "status"
    running: bool
    latency: float
    """Seconds by which frames leave after their sound."""
    look_ahead: float
    """Seconds of sound on which a frame depends."""
    late: int
    """Frames that left late."""
    dropped: int
    """Frames that this client was too slow for."""
    targets: list[TargetStatus]
    problem: str = ""
    hint: str = ""
