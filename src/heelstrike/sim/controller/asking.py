"""How compiled loops ask a compiled controller for torques."""

from __future__ import annotations

from typing import Any

import numpy as np

from heelstrike.compiler.compilation import dissolved_kernel
from heelstrike.robot.model import Floats, Model
from heelstrike.sim.controller.control import CHANGED, OVERRAN, WATCHED, Control
from heelstrike.sim.controller.guard import imprint, intact
from heelstrike.sim.memory import Memory


@dissolved_kernel
def ask(
    controller: Any, control: Control, time: float, q: Floats, v: Floats, model: Model,
    memory: Memory, torque: Floats,
) -> None:  # fmt: skip
    """Ask a controller for its torques; they are no number if it wrote where it may not."""
    _ask(controller, control, control.kept, time, q, v, model, memory, torque)


@dissolved_kernel
def consult(
    controller: Any, control: Control, time: float, q: Floats, v: Floats, model: Model,
    memory: Memory, torque: Floats,
) -> None:  # fmt: skip
    """Ask a controller for the torques it would want, were this its next call; it forgets that."""
    for i in range(control.kept.shape[0]):
        control.spare[i] = control.kept[i]
    _ask(controller, control, control.spare, time, q, v, model, memory, torque)


@dissolved_kernel
def _ask(
    controller: Any, control: Control, kept: Floats, time: float, q: Floats, v: Floats,
    model: Model, memory: Memory, torque: Floats,
) -> None:  # fmt: skip
    watched = control.conduct == WATCHED
    before = imprint(q, v, memory.contacts) if watched else 0
    controller(
        time, q, v, memory.contacts, model, memory.tree, memory.scratch, control.parameters, kept,
        torque,
    )  # fmt: skip
    spoilt = not (intact(torque) and intact(kept) and intact(control.parameters))
    if spoilt:
        control.conduct = OVERRAN
    if watched and imprint(q, v, memory.contacts) != before:
        control.conduct = CHANGED
        spoilt = True
    if spoilt and torque.size > 0:
        torque[0] = np.nan
