"""Learning: tasks on exact contact, environments of Gymnasium for them, and a trainer."""

from heelstrike.experiments.learning.ranges import Ranges
from heelstrike.experiments.learning.walk_task import WalkTask

__all__ = ["Ranges", "WalkTask"]
