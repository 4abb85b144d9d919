"""What a robot is, the readers of robot files, and the built-in robots."""

from heelstrike.robot.library import builtin_robots, load_robot
from heelstrike.robot.mjcf import read_mjcf
from heelstrike.robot.model import Model
from heelstrike.robot.robot import Foot, Mirror, Robot
from heelstrike.robot.state import State
from heelstrike.robot.warning import RobotWarning

__all__ = [
    "Foot",
    "Mirror",
    "Model",
    "Robot",
    "RobotWarning",
    "State",
    "builtin_robots",
    "load_robot",
    "read_mjcf",
]
