"""What a robot is, from what it measured as it moved: masses, moments, friction, delay."""

from heelstrike.experiments.identification.identify import (
    Identified,
    IdentifiedNumber,
    identify,
)
from heelstrike.experiments.identification.sliding import GroundFriction
from heelstrike.gait.recordings.robot_log import RobotLog, load_robot_log

__all__ = [
    "GroundFriction",
    "Identified",
    "IdentifiedNumber",
    "RobotLog",
    "identify",
    "load_robot_log",
]
