"""Messages between the studio's server and its page: requests, answers and events. Those of a live session: `live_messages`.

The models are the source; ``tools/write_types.py`` makes the page's types from them.
Seconds are seconds of the speech, unless a field says otherwise. A message with a field that is not here is refused.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

from ..rules.options import INTENSITY_RANGE, SEEDS, TEMPERATURE_RANGE
from ..rules.plan_edits import Plan
from ..rules.plan_model import HeardWord

__all__ = [
    "AddGesture", "Catalogue", "ChangeGesture", "ChangedPlan", "ClearStretch", "ClipStyle", "CreatedTake", "FaceTables",
    "FormRow", "FormatRow", "LanguageChoice", "LockStretch", "MessageWords", "MixedStyle", "ModelRow", "MotionHeader",
    "MoveGesture", "NamedStyle", "OpenedPlan", "PlanEdit", "PlanEditRequest", "PlanOpenRequest", "RemoveGesture",
    "ReseedStretch", "SetStretch", "StudioLimits", "StudioMessage", "StudioProblem", "TakeEvent", "TakeRequest", "UnlockAll",
    "UploadedClip", "UploadedSpeech",
]  # fmt: skip

Number = Annotated[float, Field(allow_inf_nan=False)]
Intensity = Annotated[float, Field(ge=INTENSITY_RANGE[0], le=INTENSITY_RANGE[1], allow_inf_nan=False)]
Temperature = Annotated[float, Field(ge=TEMPERATURE_RANGE[0], le=TEMPERATURE_RANGE[1], allow_inf_nan=False)]
Seed = Annotated[int, Field(ge=0, lt=SEEDS)]
FrameRate = Annotated[float, Field(ge=1, le=240, allow_inf_nan=False)]
"""Frames per second; ours: a page draws at 240 Hz at most."""
Token = Annotated[str, Field(max_length=64)]
"""Name that the server has made: random letters and digits."""
ShortText = Annotated[str, Field(max_length=200)]
Part = Literal["face", "body", "hands"]


class StudioMessage(BaseModel):
    """Base of all messages: a message cannot be changed, and has no other fields."""

    model_config = ConfigDict(frozen=True, extra="forbid")


class StudioProblem(StudioMessage):
    """A problem, and a hint how to mend it: the body of every answer with a status from 400 on."""

    problem: str
    hint: str = ""
    entry: str | None = None
    """The entry of the request or the plan that is wrong: ``gestures[2].stroke``, ``intensity``."""


class ModelRow(StudioMessage):
    """A model that can be played."""

    name: str
    title: str
    styles: list[str]
    seated: list[str]
    """Styles that sit. All styles of a plan sit, or all stand."""
    parts: list[Part]
    takes_gestures: bool
    """Whether its plan may list gestures; a plan for other models has only seeds, styles, emotions and stretches."""
    takes_example: bool
    """Whether it can follow the style of a clip."""
    latency: float
    """Seconds by which a frame of a live session comes after its sound, without the margin of the pacing."""


class FormRow(StudioMessage):
    """A form of gesture."""

    name: str
    hands: Literal["one", "both", "any"]
    words: list[str]
    """Words of the lexicon that call for it."""


class FormatRow(StudioMessage):
    """A file format of a download."""

    suffix: str
    title: str
    parts: list[Part]


class StudioLimits(StudioMessage):
    """Limits of the server."""

    upload_bytes: int
    minutes: float
    """Length of a speech, after decoding."""
    takes: int
    """Number of takes that are kept; the oldest one is dropped."""


class FaceTables(StudioMessage):
    """Tables to find and drive faces of characters, from `cospeech.export.face_names` and `cospeech.export.visemes`."""

    arkit: dict[str, str]
    """Name in small letters without signs → ARKit's name."""
    vrm0: dict[str, str]
    """Preset of VRM 0.x → that of VRM 1.0."""
    oculus: dict[str, str]
    """Text after ``viseme_``, in small letters → viseme of Oculus."""
    longest: int
    """Letters at the end of a name that count."""
    enough: int
    """Number of ARKit's shapes that is enough: with fewer, presets or visemes are driven."""
    held: float
    """Least weight of an eye bone in a vertex of an eyeball."""
    moved: float
    """Least movement in metres by which the shape of a look turns an eyeball."""
    vowels: dict[str, str]
    """Viseme of Oculus → preset of VRM."""
    moods: dict[str, tuple[float, dict[str, float]]]
    """Preset of VRM → constant that is added to a sum of ARKit weights, and the factor of each weight."""
    scales: dict[str, float]
    """Factors of the formula of vowels."""


class Catalogue(StudioMessage):
    """Everything that the page offers."""

    version: str
    default_model: str
    models: list[ModelRow]
    emotions: list[str]
    languages: dict[str, str]
    """Code → name of each language that the words may be in."""
    forms: list[FormRow]
    formats: list[FormatRow]
    joints: list[str]
    """Names of the joints of our humanoid, in the order of the rotations."""
    parents: list[int]
    """Index of the parent of each joint; −1 of the root."""
    rest: list[tuple[float, float, float]]
    """Offset of each joint from its parent in the T-pose, metres."""
    weights: list[str]
    """The 52 names of ARKit, in the order of the face."""
    face: FaceTables
    packed: list[str]
    """Extensions of glTF by which characters are packed, so that the page cannot read them."""
    limits: StudioLimits


class UploadedSpeech(StudioMessage):
    """A speech that the server keeps."""

    speech: str
    name: str
    seconds: float
    peaks: list[float]
    """Largest sample of each piece, 0 … 1: 50 pieces a second, and 30,000 pieces at most."""
    words: list[HeardWord]
    language: str
    """Code of the language of the words; empty if there are none, or if it is not known."""


class LanguageChoice(StudioMessage):
    """The language that the user gives for the words of a speech."""

    language: ShortText
    """Its code; empty: it is found from the words."""


class MessageWords(StudioMessage):
    """Words of a transcript."""

    words: list[HeardWord]
    language: str
    """As of `UploadedSpeech`."""


class UploadedClip(StudioMessage):
    """A motion that the server keeps, as an example of a style."""

    clip: str
    name: str
    seconds: float


class NamedStyle(StudioMessage):
    """A style by its name."""

    name: ShortText


class ClipStyle(StudioMessage):
    """The style of a clip that was uploaded."""

    clip: Token


class MixedStyle(StudioMessage):
    """A mixture of styles: name → weight."""

    mix: Annotated[
        dict[ShortText, Annotated[float, Field(ge=0, le=1000, allow_inf_nan=False)]], Field(min_length=1, max_length=32)
    ]


Style = NamedStyle | ClipStyle | MixedStyle


class TakeRequest(StudioMessage):
    """Request of motion for a speech."""

    speech: Token
    model: ShortText
    style: Style | None = None
    emotion: ShortText = "auto"
    intensity: Intensity = 1.0
    seed: Seed = 0
    temperature: Temperature = 1.0
    parts: Annotated[list[Part], Field(min_length=1, max_length=3)] = ["face", "body", "hands"]
    fps: FrameRate = 30.0
    plan: Plan | None = None
    """It replaces style, emotion, intensity, seed and temperature, as it has its own."""
    page: Token | None = None
    """The name with which a page listens to ``WS /api/events?page=``. When the page has left, its takes are cancelled."""


class CreatedTake(StudioMessage):
    """A take that waits for its turn."""

    take: str


class MotionHeader(StudioMessage):
    """The beginning of a motion.

    Bytes: the length of this header as uint32, the header as JSON, blanks up to a multiple of 4 of all bytes before; then
    float32 root (frames, 3), rotations (frames, joints, 4) as xyzw, and face (frames, 52). All numbers are little-endian.
    """

    fps: float
    frames: int
    joints: list[str]
    weights: list[str]


class TakeEvent(StudioMessage):
    """An event of a take."""

    type: Literal["queued", "progress", "done", "error", "cancelled"]
    take: str
    done: float = 0.0
    """Seconds of motion that are done."""
    total: float | None = None
    """Seconds of motion in all, if known."""
    seconds: float = 0.0
    """Seconds of work so far, by the clock."""
    problem: str = ""
    hint: str = ""
    realtime_factor: float | None = None
    """Seconds of work for a second of motion, when it is done."""


# plans ----------------------------------------------------------------------------------------------------------------


class _GestureFields(StudioMessage):
    """Fields of `cospeech.rules.plan_model.PlannedGesture`, which checks them; only given fields are changed."""

    start: Number | None = None
    end: Number | None = None
    hold: Number | None = None
    hands: Literal["left", "right", "both"] | None = None
    size: Number = 1.0
    place: tuple[Number, Number, Number] | None = None
    score: Number = 0.1
    seed: Seed | None = None


class AddGesture(_GestureFields):
    """`cospeech.Plan.add`: a form at a time, or on a word of the transcript."""

    kind: Literal["add"]
    form: ShortText
    at: Number | None = None
    word: ShortText | None = None


class RemoveGesture(StudioMessage):
    """`cospeech.Plan.remove`."""

    kind: Literal["remove"]
    gesture: ShortText


class MoveGesture(StudioMessage):
    """`cospeech.Plan.move`: to a time of the stroke."""

    kind: Literal["move"]
    gesture: ShortText
    to: Number


class ChangeGesture(_GestureFields):
    """`cospeech.Plan.change`."""

    kind: Literal["change"]
    gesture: ShortText
    form: ShortText = "beat"
    stroke: Number = 0.0
    word: ShortText = ""


class _StretchOfTime(StudioMessage):
    start: Number
    end: Number


class ReseedStretch(_StretchOfTime):
    """`cospeech.Plan.reseed`: another performance of a stretch."""

    kind: Literal["reseed"]
    seed: Seed | None = None


class SetStretch(_StretchOfTime):
    """`cospeech.Plan.set`: values of a stretch; only given values are set."""

    kind: Literal["set"]
    style: ShortText | None = None
    emotion: ShortText | None = None
    intensity: Intensity | None = None
    seed: Seed | None = None
    open: bool = False


class ClearStretch(_StretchOfTime):
    """`cospeech.Plan.clear`: a stretch gets the values of the plan again."""

    kind: Literal["clear"]
    names: Annotated[list[Literal["style", "emotion", "intensity", "seed"]], Field(min_length=1, max_length=4)]


class LockStretch(_StretchOfTime):
    """`cospeech.Plan.lock`."""

    kind: Literal["lock"]


class UnlockAll(StudioMessage):
    """`cospeech.Plan.unlock`."""

    kind: Literal["unlock"]


PlanEdit = Annotated[
    AddGesture
    | RemoveGesture
    | MoveGesture
    | ChangeGesture
    | ReseedStretch
    | SetStretch
    | ClearStretch
    | LockStretch
    | UnlockAll,
    Field(discriminator="kind"),
]


class PlanEditRequest(StudioMessage):
    """An edit of a plan. The words of the speech are added to a plan that has none."""

    plan: Plan
    speech: Token | None = None
    edit: PlanEdit


class PlanOpenRequest(StudioMessage):
    """Request to open a plan from a file for a speech."""

    plan: Plan
    speech: Token
    model: ShortText


class OpenedPlan(StudioMessage):
    """A plan that can be played."""

    plan: Plan
    note: str = ""
    """A note that its words are not those of the speech; else empty."""


class ChangedPlan(StudioMessage):
    """The plan after an edit."""

    plan: Plan
