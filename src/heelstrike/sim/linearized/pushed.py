"""What pushes do to a robot at a time, and how that depends on where it is."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypedDict

import numpy as np

from heelstrike.dynamics.kernels import forward_kinematics
from heelstrike.dynamics.workspace import Workspace
from heelstrike.robot.model import Floats
from heelstrike.robot.robot import Robot
from heelstrike.sim.push import Push, add_push_slopes, add_pushes, pushes_on, switch_at


class Pushed(TypedDict, total=False):
    """Arguments of :func:`~heelstrike.linearize_contact`."""

    force: Floats
    force_by_q: Floats


def pushed(robot: Robot, q: Floats, pushes: Sequence[Push], time: float) -> Pushed:
    """Return the generalised force of the pushes that act from a time on, and its derivative."""
    if not pushes:
        return {}
    model, given = robot.model, pushes_on(robot, pushes)
    tree = Workspace.allocate({**model.extents, "components": 2})
    force, slopes = np.zeros(model.nv), np.zeros((model.nv, model.nq))
    switch_at(time, given)
    forward_kinematics(model, q, tree)
    add_pushes(model, tree, given, force)
    add_push_slopes(model, tree, given, slopes)
    return {"force": force, "force_by_q": slopes}


def switches(pushes: Sequence[Push], begin: float, end: float) -> list[float]:
    """Return a stretch of time cut where pushes begin or end in it."""
    within = {time for push in pushes for time in (push.start, push.end) if begin < time < end}
    return [begin, *sorted(within), end]
