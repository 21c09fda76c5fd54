"""Stream joint commands to a robot, 50 per second, within its limits of position, speed and acceleration."""

import sys

import numpy as np

import cospeech
from cospeech.cli.demo import EXAMPLE
from cospeech.motion.robot import RobotStream, find_robot

FPS = 50
speech = cospeech.Speech.load(sys.argv[1] if len(sys.argv) > 1 else EXAMPLE)
session = cospeech.open_live_session("rules", fps=FPS, intensity=0.8, parts=("body", "hands"))
robot = RobotStream(find_robot("nao"), fps=FPS)

sent = []
for chunk in speech.chunks(seconds=0.1):  # as a microphone or a text-to-speech would give it
    for motion in session.push(chunk):
        sent.append(robot.push(motion))  # (T, J) radians: send them to your controller
sent += [robot.push(motion) for motion in session.finish()]
sent += [robot.push(motion) for motion in session.idle(1.5)]  # the hands come down
sent.append(robot.finish())  # all joints brake

commands = np.degrees(np.concatenate(sent))
for name, angles in zip(robot.names, commands.T, strict=True):
    print(f"{name:15s} {angles.min():7.1f} … {angles.max():6.1f} degrees, {len(angles)} commands")
