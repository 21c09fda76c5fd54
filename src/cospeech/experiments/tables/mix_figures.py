"""Figures of Mix-StAGE's tables: one speech in the styles of several speakers, gesture spaces, heat maps (figures 2 and 7)."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ...corpora.samples import METRES, SHOULDER
from ...motion.rotations import Array
from ...motion.skeletons.pats import JOINTS, PARENTS
from ..figures.sticks import Sticks, draw_sticks
from .gesture_space import draw_gesture_space
from .heatmaps import draw_heatmaps
from .mix_windows import FRAMES, MixWindows
from .paper_tables import Pictures
from .runs import PlayableRun

__all__ = ["draw_heat_of_pairs", "draw_space", "draw_styles"]

STYLES, CELLS = 4, 10  # number of styles of each system, and of moments; ours
_SIDES = {"R": "right", "L": "left"}


def _name(joint: str) -> str:
    """Name of a joint as stick figures know sides, heads and wrists."""
    return "head" if joint == "Nose" else _SIDES[joint[0]] + joint[1:] if joint[0] in _SIDES and joint[1].isupper() else joint


def _sticks(data: MixWindows, label: str, vectors: Array) -> Sticks:
    flat = data.body(vectors).values * (METRES / SHOULDER)
    body = np.concatenate([flat - flat[:, :1], np.zeros((*flat.shape[:2], 1))], -1)
    return Sticks(label, body, PARENTS, [_name(joint) for joint in JOINTS])


def draw_styles(players: Mapping[str, PlayableRun], data: MixWindows) -> Pictures:
    """The first test window as it was recorded, and in the first styles of each system.

    Args:
        players: label → system of several speakers.
        data: the windows.
    """
    from ..playing import play

    which = np.array([0])
    rows = [_sticks(data, f"{data.speaker(0)}, recorded", data.rows("pose", which)[0])]
    for label, player in players.items():
        for style in player.speakers[:STYLES]:
            poses = play(player.net, player.audio(data.rows("audio", which)), player.style(style))
            rows.append(_sticks(data, f"{label}\nas {style}", player.unpose(poses)[0]))
    assert len(rows[0].positions) == FRAMES
    return draw_sticks(rows, data.store.fps, cells=CELLS)


def draw_space(players: Mapping[str, PlayableRun], data: MixWindows) -> Pictures:
    """The gesture space of the last system, which is that of the paper: figure 2."""
    return draw_gesture_space([*players.values()][-1], data.store)


def draw_heat_of_pairs(players: Mapping[str, PlayableRun], data: MixWindows) -> Pictures:
    """Heat maps of all systems, one below the other: figure 7."""
    sheets = [draw_heatmaps(player, data.store, title=label) for label, player in players.items()]
    width = max(sheet.shape[1] for sheet in sheets)
    padded = [np.pad(s, ((0, 0), (0, width - s.shape[1]), (0, 0)), constant_values=255) for s in sheets]
    return np.concatenate(padded)
