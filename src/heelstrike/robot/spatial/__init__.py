"""Robots in three dimensions: what one is, and how it is read from a file."""

from heelstrike.robot.spatial.model import JointKind, SpatialModel
from heelstrike.robot.spatial.robot import SpatialFoot, SpatialRobot
from heelstrike.robot.spatial.solids import Solid

__all__ = ["JointKind", "Solid", "SpatialFoot", "SpatialModel", "SpatialRobot"]
