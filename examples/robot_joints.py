"""Compute the elbow and head angles of a robot, 50 per second, clamped to the robot's limits of position and speed."""

import sys

import numpy as np

import cospeech
from cospeech.cli.demo import EXAMPLE
from cospeech.motion.rotations import quat_to_euler

FPS = 50
LIMITS = {"leftElbow": (-1.5, 0.0), "headPan": (-1.0, 1.0), "headTilt": (-0.4, 0.3)}  # radians: of your robot
FASTEST = 4.0  # radians per second: of your motors

speech = cospeech.Speech.load(sys.argv[1] if len(sys.argv) > 1 else EXAMPLE)
motion = cospeech.load("rules").generate(speech, fps=FPS, intensity=0.7, parts=("body",))
joint = motion.skeleton.index

elbow = quat_to_euler(motion.rotations[:, joint["leftLowerArm"]], "YXZ")
head = quat_to_euler(motion.rotations[:, joint["head"]], "YXZ")
wanted = {"leftElbow": elbow[:, 0], "headPan": head[:, 0], "headTilt": head[:, 1]}

for name, angles in wanted.items():
    command = np.clip(angles, *LIMITS[name])
    for k in range(1, len(command)):  # never faster than the motor
        step = np.clip(command[k] - command[k - 1], -FASTEST / FPS, FASTEST / FPS)
        command[k] = command[k - 1] + step
    print(f"{name:9s} {np.degrees(command.min()):6.1f} … {np.degrees(command.max()):5.1f} degrees, {len(command)} commands")
