"""The zoo: what controllers withstand on robots, in one table and one figure.

A controller is an :class:`Entry` of `CONTROLLERS`, a line; a disturbance one of `DISTURBANCES`.
:func:`zoo` fills the cells, ``heelstrike zoo`` is its command.
"""

from heelstrike.experiments.laws import CONTROLLERS, Entry, on_points, standing, walking
from heelstrike.experiments.zoo.campaign import Progress, zoo
from heelstrike.experiments.zoo.disturbances import DISTURBANCES, Chance, Disturbance, Effort
from heelstrike.experiments.zoo.results import Animal, Cell, Results, Settings

__all__ = [
    "CONTROLLERS",
    "DISTURBANCES",
    "Animal",
    "Cell",
    "Chance",
    "Disturbance",
    "Effort",
    "Entry",
    "Progress",
    "Results",
    "Settings",
    "on_points",
    "standing",
    "walking",
    "zoo",
]
