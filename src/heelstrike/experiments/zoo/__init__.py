"""The zoo: what controllers withstand on robots, in one table and one figure.

A controller is an :class:`Entry` of `CONTROLLERS`, a line; a disturbance one of `DISTURBANCES`.
:func:`zoo` fills the cells, ``heelstrike zoo`` is its command.
"""

from heelstrike.experiments.zoo.campaign import zoo
from heelstrike.experiments.zoo.controllers import CONTROLLERS, Entry, standing, walking
from heelstrike.experiments.zoo.disturbances import DISTURBANCES, Disturbance
from heelstrike.experiments.zoo.results import Cell, Results, Settings, load_results

__all__ = [
    "CONTROLLERS",
    "DISTURBANCES",
    "Cell",
    "Disturbance",
    "Entry",
    "Results",
    "Settings",
    "load_results",
    "standing",
    "walking",
    "zoo",
]
