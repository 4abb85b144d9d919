"""How compiled loops ask a compiled controller for torques."""

from __future__ import annotations

from typing import Any

import numpy as np

from heelstrike.compiler.compilation import dissolved_kernel
from heelstrike.robot.model import Floats, Model
from heelstrike.sim.controller.guard import imprint, intact
from heelstrike.sim.memory import CHANGED, CONDUCT, OVERRAN, WATCHED, Memory


@dissolved_kernel
def ask(
    controller: Any,
    time: float,
    q: Floats,
    v: Floats,
    model: Model,
    memory: Memory,
    parameters: Floats,
    kept: Floats,
    torque: Floats,
) -> None:
    """Ask a compiled controller for torques; they are no number if it wrote where it may not.

    Parameters
    ----------
    parameters, kept, torque : float arrays
        The controller's numbers, its memory, and where to write the torques; all guarded.
    """
    watched = memory.tally[CONDUCT] == WATCHED
    before = imprint(q, v, memory.contacts) if watched else 0
    controller(
        time, q, v, memory.contacts, model, memory.tree, memory.scratch, parameters, kept, torque
    )
    spoilt = not (intact(torque) and intact(kept) and intact(parameters))
    if spoilt:
        memory.tally[CONDUCT] = OVERRAN
    if watched and imprint(q, v, memory.contacts) != before:
        memory.tally[CONDUCT] = CHANGED
        spoilt = True
    if spoilt and torque.size > 0:
        torque[0] = np.nan
