"""Options of ``cospeech generate`` that read, edit and write a plan of gestures, or keep old motion."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from .options import option

__all__ = ["AddGesture", "Keep", "Lock", "MoveGesture", "PlanFile", "PlanOut", "RemoveGesture", "Reseed", "SetStretch"]

PlanFile = Annotated[
    str | None,
    option(
        "--plan",
        metavar="FILE",
        help="Play this plan (.json) of gestures, which --plan-out has written and you may have edited.",
    ),
]
PlanOut = Annotated[
    str | None,
    option("--plan-out", metavar="FILE", help="Write the plan of the gestures (.json). You can edit it and play it again."),
]
AddGesture = Annotated[
    list[str] | None,
    option(
        "--gesture",
        metavar="FORM@TIME",
        help="Add a gesture to the plan: huge@2.4 (seconds), huge@37:10, point_left@word:there. Repeat the option for several.",
    ),
]
RemoveGesture = Annotated[
    list[str] | None,
    option(
        "--remove",
        metavar="ID|@TIME|FROM:TO",
        help="Remove a gesture of the plan: g3; @2.4 for the one nearest to 2.4 s; 15:30 for all from 15 to 30 s. "
        "With minutes: @37:10, or 37m10s:37m25s.",
    ),
]
MoveGesture = Annotated[
    list[str] | None,
    option("--move", metavar="ID@TIME", help="Move a gesture of the plan, so that its stroke is at this time: g3@2.6."),
]
Reseed = Annotated[
    list[str] | None,
    option("--reseed", metavar="FROM:TO[:SEED]", help="Plan a stretch anew with another seed: 3.2:5. The rest stays."),
]
SetStretch = Annotated[
    list[str] | None,
    option(
        "--stretch",
        metavar="FROM:TO:VALUES",
        help="Give the speech from 3.2 to 5 s its own style, emotion, intensity or seed: 3.2:5:style=lively,intensity=1.3. For "
        "all models.",
    ),
]
Lock = Annotated[
    list[str] | None,
    option(
        "--lock", metavar="FROM:TO", help="Protect the gestures of a stretch: no edit changes them, and --reseed keeps them."
    ),
]
Keep = Annotated[
    tuple[str, Path] | None,
    option(
        "--keep",
        metavar="FROM:TO OLD",
        help="Keep a stretch of an old motion file, and generate the rest: 0:3.2 old.bvh. Several: 0:3.2,5:7 old.bvh.",
    ),
]
