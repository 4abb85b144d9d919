"""What a robot is, the readers of robot files, and the built-in robots."""

from heelstrike.robot.builder import RobotBuilder
from heelstrike.robot.files.options import LoadOptions
from heelstrike.robot.files.reading import read_mjcf
from heelstrike.robot.human import BodyTable, human
from heelstrike.robot.inspection import Inspection, inspect_robot
from heelstrike.robot.library import builtin_robots, load_robot
from heelstrike.robot.model import JointProperties, Model
from heelstrike.robot.named_tree import Foot
from heelstrike.robot.plausibility import Finding, FindingKind
from heelstrike.robot.robot import LockedJoint, Robot
from heelstrike.robot.shapes.outlines import Outline
from heelstrike.robot.sides.mirror import Mirror
from heelstrike.robot.spatial import JointKind, SpatialFoot, SpatialModel, SpatialRobot
from heelstrike.robot.state import State
from heelstrike.robot.warning import RobotWarning

__all__ = [
    "BodyTable",
    "Finding",
    "FindingKind",
    "Foot",
    "Inspection",
    "JointKind",
    "JointProperties",
    "LoadOptions",
    "LockedJoint",
    "Mirror",
    "Model",
    "Outline",
    "Robot",
    "RobotBuilder",
    "RobotWarning",
    "SpatialFoot",
    "SpatialModel",
    "SpatialRobot",
    "State",
    "builtin_robots",
    "human",
    "inspect_robot",
    "load_robot",
    "read_mjcf",
]
