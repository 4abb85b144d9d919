"""Robots in three dimensions: what one is, and how it is read from a file."""

from heelstrike.robot.spatial.model import JointKind, SpatialModel
from heelstrike.robot.spatial.robot import SpatialFoot, SpatialRobot

__all__ = ["JointKind", "SpatialFoot", "SpatialModel", "SpatialRobot"]
