"""What a compiled loop needs to ask a controller."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from heelstrike.compiler.bundle import Bundle, array, cell
from heelstrike.robot.model import Floats
from heelstrike.sim.controller.guard import guarded

# What `Control.conduct` says of the controller: that nobody looks whether it changes state and
# contacts, or that one does; that it has; that it wrote beyond its own arrays.
TRUSTED = 0
WATCHED = 1
CHANGED = 2
OVERRAN = 3


class Control(Bundle):
    """The numbers of a controller, and how it is asked.

    Attributes
    ----------
    parameters : (n,) float
        Its numbers; guarded.
    kept, spare : (m,) float
        Its memory, and a copy for the calls that it shall forget; guarded.
    continuous : int
        Whether it acts within the steps too; otherwise its torques are held.
    in_python : int
        Whether the loop has to come back for its torques.
    conduct : int
        What it has done that it may not.
    """

    parameters: Floats = array("parameters_size")
    kept: Floats = array("memory_size")
    spare: Floats = array("memory_size")
    continuous: int = cell(int)
    in_python: int = cell(int)
    conduct: int = cell(int)


def control_with(parameters: ArrayLike, memory: ArrayLike) -> Control:
    """Return the numbers of a controller, ready for a loop."""
    return Control(
        parameters=guarded(np.asarray(parameters, dtype=np.float64)),
        kept=guarded(memory),
        spare=guarded(memory),
    )
