"""What else acts on the robot than motors, ground, springs and weight.

Between two calls, h apart, velocities change by what acts: with the state before them,

    A (v − v₀)/h + H = Sᵀτ + passive + Σ Jᵀλ + d,

in which all is known but d, the generalised force of pushes, and of errors of the model. What is
found is of the interval that has gone by: one call late, and with whatever noise the velocities
have, divided by h. (It is the momentum observer of A. De Luca and R. Mattone 2005, *Sensorless
robot collision detection and hybrid force/motion control*, ICRA, as a difference in time.)
"""

from __future__ import annotations

import math

from heelstrike.compiler.bundle import Bundle, array, cell
from heelstrike.compiler.compilation import kernel
from heelstrike.robot.model import Floats
from heelstrike.sim.controller.interface import Contacts
from heelstrike.sim.controller.robot import ControlledRobot, ControlState


class Disturbance(Bundle):
    """What is remembered of the call before, and what was found."""

    known: int = cell(int)
    """Whether there was a call before, and no impact since."""
    force: Floats = array("nv")
    """d, as found and filtered."""
    q: Floats = array("nq")
    v: Floats = array("nv")
    torque: Floats = array("nu")
    """q, v, torque: State and torques of the call before."""
    jacobian: Floats = array(2, "nv")
    found: Floats = array("nv")
    """jacobian, found: Scratch."""


@kernel
def observe(
    elapsed: float, bandwidth: float, state: ControlState, contacts: Contacts,
    robot: ControlledRobot, memory: Disturbance,
) -> None:  # fmt: skip
    """Find the disturbance since the call before, a time ago, below a frequency (Hz)."""
    before, found = robot.estimate, memory.found
    for j in range(robot.nq):
        before.q[j] = memory.q[j]
    for j in range(robot.nv):
        before.v[j] = memory.v[j]
        robot.acceleration[j] = (state.v[j] - memory.v[j]) / elapsed
    robot.update(before)
    robot.inverse_dynamics(before, robot.acceleration, found)
    robot.passive_force(before, robot.passive)
    for j in range(robot.nv):
        found[j] -= robot.passive[j]
    for i in range(robot.nu):
        found[robot.model.actuator_joint[i]] -= memory.torque[i]
    for i in range(robot.nc):
        if contacts.force[i, 0] != 0.0:
            robot.contact_jacobian(before, contacts, i, memory.jacobian)
            for j in range(robot.nv):
                for k in range(2):
                    found[j] -= memory.jacobian[k, j] * contacts.force[i, k]
    share = 1.0 - math.exp(-2.0 * math.pi * bandwidth * elapsed)
    for j in range(robot.nv):
        memory.force[j] += share * (found[j] - memory.force[j])


@kernel
def remember(
    state: ControlState, robot: ControlledRobot, torque: Floats, memory: Disturbance
) -> None:
    """Keep state and torques for the next call."""
    model = robot.model
    memory.known = 1
    for j in range(robot.nq):
        memory.q[j] = state.q[j]
    for j in range(robot.nv):
        memory.v[j] = state.v[j]
    for i in range(robot.nu):
        memory.torque[i] = min(max(torque[i], model.torque_lower[i]), model.torque_upper[i])
