"""Kernels of somebody's that write rows of the contact problem, and what they wrote last."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from heelstrike.compiler.bundle import Bundle, array
from heelstrike.compiler.compilation import kernel
from heelstrike.compiler.separate_kernel import call_at
from heelstrike.dynamics.queries.evaluation import Evaluation
from heelstrike.dynamics.workspace import Workspace
from heelstrike.robot.model import Floats, Model
from heelstrike.robot.robot import Robot
from heelstrike.robot.state import State
from heelstrike.sim.contacts.constraint import COMPONENTS, is_line, written_by

Integers = NDArray[np.int64]


class Writers(Bundle):
    """Constraints from outside: where their kernels are, and what they wrote last."""

    kernel: Integers = array("constraints", 2, of=int, address=True)
    """Addresses of the machine code of each, and of its numbers."""
    gap: Floats = array("constraints", COMPONENTS)
    """How far each is from what holds it (m, rad)."""
    jacobian: Floats = array("constraints", COMPONENTS, "nv")
    bias: Floats = array("constraints", COMPONENTS)
    """jacobian, bias: Rows J of each, and J̇ v."""


@kernel
def write_own(
    own: int, model: Model, q: Floats, v: Floats, tree: Workspace, writers: Writers
) -> None:
    """Let a kernel write its rows of a state, whose kinematics and velocities are in `tree`."""
    gap, jacobian, bias = writers.gap[own], writers.jacobian[own], writers.bias[own]
    for k in range(COMPONENTS):
        gap[k] = 0.0
        bias[k] = 0.0
        for j in range(model.nv):
            jacobian[k, j] = 0.0
    place = writers.kernel[own]
    call_at(place[0], (place[1], model, tree, q, v, gap, jacobian, bias))


@kernel
def rate_of(own: int, component: int, v: Floats, writers: Writers) -> float:
    """Velocity along a row, or acceleration but for J̇ v."""
    total = 0.0
    for j in range(v.shape[0]):
        total += writers.jacobian[own, component, j] * v[j]
    return total


def kernels_of(robot: Robot) -> Integers:
    """Return where the kernel of each constraint is, and its numbers."""
    written = [written_by(robot, each) for each in robot.constraints]
    places = [(code, numbers.address) for code, numbers in written]
    return np.array(places, dtype=np.int64).reshape(-1, 2)


def lay_out_ties(robot: Robot) -> Integers:
    """Return the same of the constraints that never let go, and how many rows each has."""
    places = kernels_of(robot)
    lines = [
        (*places[i], each.components) for i, each in enumerate(robot.constraints) if is_line(each)
    ]
    return np.array(lines, dtype=np.int64).reshape(-1, 3)


def gaps_at(robot: Robot, state: State) -> Floats:
    """Return the gaps of the constraints of a robot in a state, a row each."""
    writers = Writers.allocate(
        constraints=len(robot.constraints), nv=robot.nv, kernel=kernels_of(robot)
    )
    for own in range(len(robot.constraints)):
        tree = Evaluation(robot, state.q, state.v).work
        write_own(own, robot.model, state.q, state.v, tree, writers)
    return writers.gap
