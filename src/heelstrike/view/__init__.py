"""Pictures of robots and runs: figures, portraits, animations."""

from heelstrike.errors import ViewError
from heelstrike.view.animation import animate
from heelstrike.view.drawing import robot_picture
from heelstrike.view.figures import FIGURES, plot

__all__ = ["FIGURES", "ViewError", "animate", "plot", "robot_picture"]
