"""Motion for robots: joint angles of arms, head and trunk within a robot's limits of position, speed and acceleration.

>>> from cospeech.motion.motion import Motion
>>> from cospeech.motion.skeleton import humanoid
>>> import numpy as np
>>> still = Motion(50, np.tile([0.0, 0, 0, 1], (2, len(humanoid()), 1)), np.zeros((2, 3)))
>>> commands = RobotStream(ROBOTS["nao"], fps=50).push(still)
>>> commands.shape
(2, 14)
"""

from .angles import CHANNELS, BodyAngles
from .joints import RobotJoint, narrow_joints
from .limiter import JointLimiter
from .robots import ROBOTS, find_robot
from .trajectory import RobotStream, check_trajectory_file, robot_trajectory, save_trajectory
from .urdf import list_followers, list_joints, read_urdf

__all__ = [
    "CHANNELS", "ROBOTS", "BodyAngles", "JointLimiter", "RobotJoint", "RobotStream", "check_trajectory_file", "find_robot",
    "list_followers", "list_joints", "narrow_joints", "read_urdf", "robot_trajectory", "save_trajectory",
]  # fmt: skip
