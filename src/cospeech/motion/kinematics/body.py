"""Channels of all parts but the hands: hips, torso, head, gaze, feet, breath."""

from __future__ import annotations

__all__ = ["BODY_CHANNELS", "NECK_SHARE", "SPINE", "Body"]

SPINE = (("spine", 0.28), ("chest", 0.34), ("upperChest", 0.38))  # shares of the torso's bend (ours: more towards the chest)
NECK_SHARE = 0.42  # of the head's turn


class Body:
    """Columns of the body's track. Metres and degrees; yaw to the character's left, pitch *down/forward*, roll to its right."""

    HIPS_X, HIPS_Z, HIPS_YAW = 0, 1, 2
    PLACE = slice(0, 2)  # HIPS_X and HIPS_Z
    PITCH, ROLL, YAW = 3, 4, 5  # of the whole torso, hips to shoulders
    HEAD_PITCH, HEAD_ROLL, HEAD_YAW = 6, 7, 8  # in the world
    GAZE_YAW, GAZE_UP = 9, 10  # where the eyes look, in the world; up is positive
    LEFT_FOOT, RIGHT_FOOT = slice(11, 14), slice(14, 17)  # x, z of the ankle, yaw
    LEFT_LIFT, RIGHT_LIFT = 17, 18  # sole above the floor
    LEFT_TIP, RIGHT_TIP = 19, 20  # foot rolled over: positive onto the ball, heel up; negative onto the heel, toes up
    SINK = 21  # hips below the highest place that the legs allow
    HIPS_PITCH, HIPS_ROLL = 22, 23  # of the pelvis, on top of what follows from torso and weight
    BREATH = 24  # 0 breathed out … 1 breathed in
    SHOULDERS = 25  # both shoulders up


BODY_CHANNELS = 26
