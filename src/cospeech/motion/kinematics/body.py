"""Channels of everything that is not a hand: hips, torso, head, gaze, feet."""

from __future__ import annotations

__all__ = ["BODY_CHANNELS", "NECK_SHARE", "SPINE", "Body"]

SPINE = (("spine", 0.28), ("chest", 0.34), ("upperChest", 0.38))  # shares of the torso's bend (ours: more towards the chest)
NECK_SHARE = 0.42  # of the head's turn


class Body:
    """Columns of the body's track. Metres and degrees; yaw to the character's left, pitch *down/forward*, roll to its right."""

    HIPS_X, HIPS_Z, HIPS_YAW = 0, 1, 2
    PITCH, ROLL, YAW = 3, 4, 5  # of the whole torso, hips to shoulders
    HEAD_PITCH, HEAD_ROLL, HEAD_YAW = 6, 7, 8  # in the world
    GAZE_YAW, GAZE_UP = 9, 10  # where the eyes look, in the world; up is positive
    LEFT_FOOT, RIGHT_FOOT = slice(11, 14), slice(14, 17)  # x, z of the ankle, yaw
    LEFT_LIFT, RIGHT_LIFT = 17, 18  # ankle above its place on the floor


BODY_CHANNELS = 19
