"""The studies of the three papers, as templates: what raters see, and the questions.

The scales and the questions are those of the papers; their words on the page are ours. Consent is a text of ours, which a
researcher replaces by that of the own ethics board.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from .plan import Question

__all__ = ["TEMPLATES", "Template"]


class Template(NamedTuple):
    """A study without clips.

    Args:
        what: one line.
        shows: as of `StudyPlan`.
        questions: what is asked.
        stimuli_each: speeches for each rater, at most.
        instructions: what raters read before the first clip.
        needs_reference: whether one system is the recording.
        mismatches: whether each system is compared with itself playing the motion of another speech.
    """

    what: str
    shows: str
    questions: tuple[Question, ...]
    stimuli_each: int
    instructions: str
    needs_reference: bool = False
    mismatches: bool = False


def _ask(name: str, kind: Any, text: str, **more: Any) -> Question:
    return Question(name=name, kind=kind, text=text, **more)


_SCALE = {"low": "not at all", "high": "completely"}

TEMPLATES: dict[str, Template] = {
    # Ahuja et al. 2020, section 5.2 and appendix C.3: a recording and a generated clip, two questions; 20 videos for a rater
    "mix-stage": Template(
        "Mix-StAGE (2020): a recording beside a system; preference, and whether the style is the same",
        "pair",
        (
            _ask("naturalness", "prefer", "Which video has more natural gestures with respect to the speech?", points=2),
            _ask("style", "same", "Do the two videos have the same style of gestures?"),
        ),
        10,
        "You will see two videos at a time. Watch both to the end, as often as you like. Then answer two questions.",
        needs_reference=True,
    ),
    # Xu et al. 2024, "User Study" and table 3: 22 raters, 10 clips of 20 seconds for each method, four scales from 1 to 5
    "chain-of-generation": Template(
        "Chain of generation (2024): one clip at a time on four scales from 1 to 5",
        "single",
        (
            _ask("naturalness", "scale", "How human-like and smooth are the movements?", **_SCALE),
            _ask("appropriateness", "scale", "How well do the gestures agree with what is said?", **_SCALE),
            _ask("style", "scale", "How well do the gestures agree with the emotion of the speech?", **_SCALE),
            _ask("synchrony", "scale", "How well do the gestures follow the rhythm of the speech?", **_SCALE),
        ),
        10,
        "You will see one video at a time. Watch it to the end, as often as you like. Then rate it on every scale.",
    ),
    # Ye et al. 2022, "User Study" and figure 7: 12 raters, six groups with a clip of each method, three ratings and a favourite
    "stylised-flow": Template(
        "Stylised flow (2022): a clip of every system together; three scales from 1 to 5, and a favourite",
        "group",
        (
            _ask("human_likeness", "scale", "How human-like are the movements?", **_SCALE),
            _ask("appropriateness", "scale", "How well do the gestures match the speech?", **_SCALE),
            _ask("diversity", "scale", "How varied are the gestures?", **_SCALE),
            _ask("favourite", "favourite", "Which video do you like most?"),
        ),
        6,
        "You will see a group of videos of the same speech. Watch all of them to the end. Then rate each of them.",
    ),
    # The GENEA leaderboard (rules of 2025-11-17): pairs, two degrees of preference, and a tie
    "preference": Template(
        "Pairs of systems, and how clearly one is preferred, as on the GENEA leaderboard",
        "pair",
        (_ask("motion_realism", "prefer", "In which video does the character move more like a real person?", points=5),),
        10,
        "You will see two videos at a time. Watch both to the end, as often as you like. Then choose one of them.",
    ),
    # GENEA challenge 2022 and 2023 (Kucherenko et al. 2023, ICMI), appropriateness for speech: the motion of the speech beside
    # motion of the same system for another speech, so that the quality of the motion does not count
    "appropriateness": Template(
        "Does the motion belong to the speech? The motion of a system beside its motion for another speech, as in GENEA 2023",
        "pair",
        (_ask("appropriateness", "prefer", "In which video do the movements fit what is said better?", points=5),),
        10,
        "You will see two videos at a time, with the same speech. Watch both to the end with sound, as often as you like. "
        "Then choose the one in which the movements fit the speech better.",
        mismatches=True,
    ),
}

CONSENT = (
    "You are invited to a study about computer-animated characters. You will watch short videos and answer questions about "
    "them.\n\n"
    "Taking part is voluntary. You may close the page at any time, without giving a reason. What is kept are your answers, the "
    "time that they took, and the code of your invitation if it had one; neither your name nor your address is kept. The "
    "answers may be published without the codes."
)
THANKS = "Thank you. Your answers are saved. You may close this page."
