"""Time stepping: contact impulses decide the velocity at the end of each step (paper section 3).

One step of length h from (q, v), with λ the contact impulses of the step::

    v_free = v + h A⁻¹ (B Γ + passive − H)          motion without contact
    w      = G λ + b,   G = J A⁻¹ Jᵀ                contact velocities at the end of the step
    v⁺     = v_free + A⁻¹ Jᵀ λ

The gap-linearised scheme asks ``gap + h J_n v⁺ ≥ 0``, that is b_n = J_n v_free + gap / h, for
every contact point that could close within the step, and moves on with the new velocity. The
paper's own ordering (eq. 23-26) asks ``J_n v⁺ ≥ 0`` of the points whose gap is not positive; as
printed it moves the positions with the old velocity. Its text has the old velocity move the
positions first and the new velocity computed there, which is the same sequence of states as moving
them with the new velocity at the end of each step.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from heelstrike.compiler.bundle import Bundle, array, number
from heelstrike.compiler.compilation import dissolved_kernel, kernel
from heelstrike.compiler.straight_line import play
from heelstrike.contact.ground import GroundModel
from heelstrike.contact.modes import SOLVED
from heelstrike.contact.problem import solve_contact_kernel
from heelstrike.contact.sets import CONE, HALF_LINE
from heelstrike.dynamics.kernels import passive_force
from heelstrike.errors import SimulationError
from heelstrike.robot.model import Integers, Model
from heelstrike.robot.robot import Robot
from heelstrike.sim.clock import Clock
from heelstrike.sim.closed_sets import Scheme
from heelstrike.sim.contacts.dry_friction import note_dry_joint, press_dry_joints, select_dry_joints
from heelstrike.sim.contacts.geometry import (
    add_impulse,
    assemble_delassus,
    contact_rows,
    contact_velocity,
    evaluate_equations,
    locate_contacts,
    solve_mass_matrix,
    weigh,
    write_unit_row,
)
from heelstrike.sim.contacts.points import point_velocities
from heelstrike.sim.contacts.straight_line import DELASSUS, PUSH, SOLVE, VELOCITIES
from heelstrike.sim.controller.control import Control
from heelstrike.sim.frame import DONE, SOLVER_FAILED, Kernels
from heelstrike.sim.memory import Memory
from heelstrike.sim.method import Method, solver_order
from heelstrike.sim.push import add_pushes, share_over_step
from heelstrike.sim.record.record import Record
from heelstrike.sim.record.recording import note_events, note_extremes, note_row_when_due
from heelstrike.sim.setting import Setting

GAP_LINEARISED = int(Scheme.GAP_LINEARISED)
PAPER_EXPLICIT = int(Scheme.PAPER_EXPLICIT)
PAPER_SYMPLECTIC = int(Scheme.PAPER_SYMPLECTIC)
MOREAU_JEAN = int(Scheme.MOREAU_JEAN)
LINEARLY_IMPLICIT = int(Scheme.LINEARLY_IMPLICIT)

# A contact point enters the problem when it could close within a step at this speed (m/s) or at
# twice its free speed. Those that stay open get zero impulse from the solver, so that the choice
# costs time but not the answer. Gaps that would take 100 m/s to close are not looked at.
CLOSING_SPEED = 5.0
FAR_STEPS = 20.0
# The same for joint stops (rad/s or m/s).
CLOSING_RATE = 20.0


class Stepping(Bundle):
    """What the kernels of time stepping read.

    Attributes
    ----------
    step : float
        Length of a step (s).
    scheme : int
    activation : float
        Gap up to which a contact point takes part, for schemes that decide by it (m).
    order : (solvers,) int
        Contact solvers in the order in which they are tried.
    """

    step: float = number(float)
    scheme: int = number(int)
    activation: float = number(float)
    order: Integers = array("solvers", of=int)


@dataclass(frozen=True, kw_only=True)
class TimeStepping(Method):
    """Fixed steps whose contact impulses decide the velocity at the end of the step.

    Parameters
    ----------
    step : float
        Length of the step h in seconds.
    scheme : Scheme
        Discretisation; see :class:`~heelstrike.sim.closed_sets.Scheme`.
    solver : str
        Contact solver tried first: ``"lemke"``, ``"fischer_burmeister"`` or ``"gauss_seidel"``;
        the others follow as fallbacks, each use counted in the run.
    activation : float
        Gap in metres up to which a contact point takes part, for the schemes that decide by the
        gap alone (the paper's two and Moreau-Jean). With the literal zero, a foot at rest loses
        and regains the ground through round-off.

    Raises
    ------
    SimulationError
        If the step is not a positive finite number, the activation is negative, or scheme or
        solver are unknown.

    Notes
    -----
    First order in the step, whatever the scheme.
    """

    step: float = 1e-3
    scheme: Scheme = Scheme.GAP_LINEARISED
    solver: str = "lemke"
    activation: float = 0.0

    def __post_init__(self) -> None:
        if not 0.0 < self.step < float("inf"):
            raise SimulationError(f"the time step must be a positive number, got {self.step}")
        if not 0.0 <= self.activation < float("inf"):
            raise SimulationError(f"the activation gap must be ≥ 0, got {self.activation}")
        try:
            object.__setattr__(self, "scheme", Scheme(self.scheme))
        except ValueError:
            names = ", ".join(f"Scheme.{scheme.name}" for scheme in Scheme)
            raise SimulationError(
                f"unknown scheme {self.scheme!r}; choose one of {names}"
            ) from None
        solver_order(self.solver)

    @property
    def step_length(self) -> float:  # type: ignore[override]
        """Length of every step."""
        return self.step

    @property
    def row_period(self) -> tuple[str, float]:
        """A row a step."""
        return "step", self.step

    @property
    def solves_with(self) -> str:
        """Contact solver tried first."""
        return self.solver

    def new_work(self, robot: Robot) -> Stepping:  # noqa: ARG002
        """Return what its kernels read."""
        return Stepping(
            step=self.step,
            scheme=int(self.scheme),
            activation=self.activation,
            order=solver_order(self.solver),
        )

    def room(self, robot: Robot) -> tuple[int, int]:
        """Return how many rows and events a step may add to the record."""
        return 1, 2 * (robot.nc + robot.nv) + len(robot.joint_names)

    def check(self, setting: Setting) -> None:
        """Refuse ground with restitution where the scheme knows plastic impacts only."""
        if self.scheme is not Scheme.MOREAU_JEAN and np.any(
            setting.ground.model().restitution > 0.0
        ):
            raise SimulationError(
                f"{self.scheme.name} knows plastic impacts only, and this ground has "
                f"restitution; use Scheme.MOREAU_JEAN"
            )


@dissolved_kernel
def begin(
    model: Model,  # noqa: ARG001
    ground: GroundModel,  # noqa: ARG001
    memory: Memory,  # noqa: ARG001
    work: Stepping,  # noqa: ARG001
    record: Record,  # noqa: ARG001
) -> int:
    """Begin: there is nothing to prepare."""
    return DONE


@dissolved_kernel
def prepare(model: Model, ground: GroundModel, memory: Memory, work: Stepping) -> None:
    """Kinematics, contact points, mass matrix and bias force of the state now."""
    if work.scheme == LINEARLY_IMPLICIT:
        for i in range(memory.added.shape[0]):
            memory.added[i] = work.step * (memory.damping[i] + work.step * memory.stiffness[i])
    evaluate_equations(model, memory.q, memory.v, memory)
    locate_contacts(model, ground, memory)


@dissolved_kernel
def free_velocity(model: Model, step: float, scheme: int, memory: Memory) -> None:
    """Velocity at the end of the step if there were no ground, into ``memory.next_v``.

    The linearly implicit scheme takes the joint forces −K q − D v at the end of the step. To first
    order that adds h D + h² K to the mass matrix, as if it were armature, and −h K v to the force.
    """
    nv = model.parent.shape[0]
    passive_force(model, memory.q, memory.v, memory.force)
    for i in range(model.actuator_joint.shape[0]):
        memory.force[model.actuator_joint[i]] += memory.torque[i]
    if scheme == LINEARLY_IMPLICIT:
        for i in range(nv):
            memory.force[i] -= step * memory.stiffness[i] * memory.v[i]
        if memory.programs[SOLVE] != 0:
            weigh(model, memory)  # the program has not heard of it
    for i in range(nv):
        memory.rate[i] = step * (memory.force[i] - memory.bias[i])
    solve_mass_matrix(model, memory, memory.rate)
    for i in range(nv):
        memory.next_v[i] = memory.v[i] + memory.rate[i]


@dissolved_kernel
def push_robot(model: Model, time: float, step: float, memory: Memory) -> None:
    """Add to the free velocity what pushes do in this step."""
    if not share_over_step(memory.pushes, time, step):
        return
    nv = model.parent.shape[0]
    for i in range(nv):
        memory.rate[i] = 0.0
    add_pushes(model, memory.tree, memory.pushes, memory.rate)
    solve_mass_matrix(model, memory, memory.rate)
    for i in range(nv):
        memory.next_v[i] += step * memory.rate[i]


@dissolved_kernel
def select_candidates(
    model: Model, step: float, scheme: int, activation: float, memory: Memory
) -> int:
    """List the contact points that could act in this step, with their free terms."""
    contacts = memory.contacts
    linearised = scheme in (GAP_LINEARISED, LINEARLY_IMPLICIT)
    farthest = FAR_STEPS * CLOSING_SPEED * step
    if scheme in (PAPER_EXPLICIT, PAPER_SYMPLECTIC):
        farthest = activation
    count = 0
    usual = memory.programs[VELOCITIES] != 0
    for contact in range(model.contact_link.shape[0]):
        if contacts.gap[contact] <= farthest:
            memory.candidate[count] = contact
            usual = usual and memory.usual_place[contact] >= 0
            count += 1
    if count == 0:
        return 0
    near = count
    velocity = memory.point_velocity
    if usual:
        play(
            memory.programs[VELOCITIES],
            (
                model, memory.usual_points, memory.tree, contacts.position, contacts.normal,
                memory.next_v, velocity,
            ),
        )  # fmt: skip
    else:
        point_velocities(
            model, memory.every_point, memory.tree, contacts.position, contacts.normal,
            memory.next_v, velocity,
        )  # fmt: skip
    count = 0
    for place in range(near):
        contact = memory.candidate[place]
        gap = contacts.gap[contact]
        normal = velocity[contact, 0]
        if linearised:
            if gap > step * max(CLOSING_SPEED, -2.0 * normal):
                continue
            normal += gap / step
        elif scheme == MOREAU_JEAN:
            before, _ = contact_velocity(
                model.contact_link[contact],
                contacts.position[contact],
                contacts.normal[contact],
                memory.tree,
            )
            if gap + 0.5 * step * before > activation:
                continue
            normal += memory.restitution[contact] * before
        memory.problem.free[2 * count] = normal
        memory.problem.free[2 * count + 1] = velocity[contact, 1]
        memory.problem.set[count] = CONE
        memory.problem.friction[count] = memory.friction[contact]
        memory.answer.mode[count] = memory.mode[contact]
        memory.candidate[count] = contact
        count += 1
    return count


@dissolved_kernel
def select_stops(
    model: Model, step: float, scheme: int, activation: float, count: int, memory: Memory
) -> int:
    """Append the joint stops that could act in this step: contacts without friction."""
    points = model.contact_link.shape[0]
    linearised = scheme in (GAP_LINEARISED, LINEARLY_IMPLICIT)
    for joint in range(model.parent.shape[0]):
        for end in range(2):
            sign = 1.0 - 2.0 * end
            limit = model.upper[joint] if end == 1 else model.lower[joint]
            gap = sign * (memory.q[joint] - limit)
            normal = sign * memory.next_v[joint]
            before = sign * memory.v[joint]
            if linearised:
                if not gap < step * max(CLOSING_RATE, -2.0 * normal):
                    continue
                normal += gap / step
            elif scheme == MOREAU_JEAN:
                if not gap + 0.5 * step * before <= activation:
                    continue
            elif not gap <= activation:
                continue
            memory.problem.free[2 * count] = normal
            memory.problem.free[2 * count + 1] = 0.0
            memory.problem.set[count] = HALF_LINE
            memory.problem.friction[count] = 0.0
            memory.answer.mode[count] = memory.stop_mode[joint, end]
            memory.candidate[count] = points + 2 * joint + end
            count += 1
    return count


@kernel
def write_rows(model: Model, memory: Memory, count: int) -> None:
    """Write the Jacobian rows of contact points and stops; those of dry joints are written.

    A stop has a normal row ±1 at its joint and a tangent row of zeros.
    """
    points = model.contact_link.shape[0]
    for place in range(count - memory.dry_joint.shape[0]):
        candidate = memory.candidate[place]
        if candidate < points:
            contact_rows(model, memory, candidate, place)
            continue
        stop = candidate - points
        write_unit_row(memory, stop // 2, 2 * place, 1.0 - 2.0 * (stop % 2))


@dissolved_kernel
def are_usual(memory: Memory, near: int) -> bool:
    """Whether there are programs for the contact points among the candidates, the first `near`."""
    usual = memory.programs[DELASSUS] != 0
    for place in range(near):
        usual = usual and memory.usual_place[memory.candidate[place]] >= 0
    return usual


@kernel
def joint_row(model: Model, memory: Memory, place: int) -> tuple[int, int, float]:
    """Row of a candidate that is a stop or a dry joint, its joint, and the sign of the two."""
    stop = memory.candidate[place] - model.contact_link.shape[0]
    dry = stop - 2 * model.parent.shape[0]
    if dry >= 0:
        return 2 * place + 1, memory.dry_joint[dry], 1.0
    return 2 * place, stop // 2, 1.0 - 2.0 * (stop % 2)


@dissolved_kernel
def gather_delassus(model: Model, memory: Memory, near: int, count: int) -> None:
    """Delassus matrix of all usual points; that of the candidates too, if these are others."""
    contacts = memory.contacts
    if near > 0:
        play(
            memory.programs[DELASSUS],
            (
                model, memory.usual_points, memory.tree, contacts.position, contacts.normal,
                memory.factor, memory.point_rows, memory.usual_problem.delassus,
            ),
        )  # fmt: skip
    if near == count == memory.usual_points.shape[0]:
        return
    for place in range(near):
        row = 2 * memory.usual_place[memory.candidate[place]]
        for other in range(near):
            column = 2 * memory.usual_place[memory.candidate[other]]
            for i in range(2):
                for j in range(2):
                    entry = memory.usual_problem.delassus[row + i, column + j]
                    memory.problem.delassus[2 * place + i, 2 * other + j] = entry
    for place in range(near, count):
        add_joint(model, memory, near, place)


@dissolved_kernel
def add_joint(model: Model, memory: Memory, near: int, place: int) -> None:
    """Add the stop or dry joint at a place to the Delassus matrix of the candidates before.

    What a unit impulse along its row does to the joint velocities, A⁻¹ e, goes to that row of
    ``memory.jacobian``.
    """
    contacts, delassus, velocity = memory.contacts, memory.problem.delassus, memory.point_velocity
    row, joint, sign = joint_row(model, memory, place)
    change = memory.jacobian[row]
    for j in range(model.parent.shape[0]):
        change[j] = 0.0
    change[joint] = sign
    solve_mass_matrix(model, memory, change)
    for other in range(2 * place + 2):
        for own in range(2 * place, 2 * place + 2):
            delassus[own, other] = 0.0
            delassus[other, own] = 0.0
    if near > 0:
        play(
            memory.programs[VELOCITIES],
            (
                model, memory.usual_points, memory.tree, contacts.position, contacts.normal,
                change, velocity,
            ),
        )  # fmt: skip
    for other in range(near):
        for i in range(2):
            entry = velocity[memory.candidate[other], i]
            delassus[row, 2 * other + i] = entry
            delassus[2 * other + i, row] = entry
    for other in range(near, place + 1):
        column, its_joint, its_sign = joint_row(model, memory, other)
        entry = its_sign * change[its_joint]
        delassus[row, column] = entry
        delassus[column, row] = entry


@dissolved_kernel
def push_candidates(model: Model, memory: Memory, near: int, count: int) -> None:
    """Add what the impulses of the candidates do to the velocity, after `gather_delassus`."""
    contacts = memory.contacts
    for contact in range(model.contact_link.shape[0]):
        memory.point_impulse[contact, 0] = 0.0
        memory.point_impulse[contact, 1] = 0.0
    for place in range(near):
        memory.point_impulse[memory.candidate[place], 0] = memory.answer.impulse[2 * place]
        memory.point_impulse[memory.candidate[place], 1] = memory.answer.impulse[2 * place + 1]
    if near > 0:
        play(
            memory.programs[PUSH],
            (
                model, memory.usual_points, memory.tree, contacts.position, contacts.normal,
                memory.factor, memory.point_impulse, memory.rate, memory.next_v,
            ),
        )  # fmt: skip
    for place in range(near, count):
        row, _, _ = joint_row(model, memory, place)
        for j in range(model.parent.shape[0]):
            memory.next_v[j] += memory.answer.impulse[row] * memory.jacobian[row, j]


@dissolved_kernel
def solve_contacts(
    model: Model, step: float, scheme: int, activation: float, order: Integers, memory: Memory
) -> bool:
    """Turn the free velocity into the velocity at the end of the step; return success."""
    near = select_candidates(model, step, scheme, activation, memory)
    count = select_stops(model, step, scheme, activation, near, memory)
    count = select_dry_joints(model, count, memory)
    nv = model.parent.shape[0]
    points = model.contact_link.shape[0]
    dry = points + 2 * nv
    for j in range(nv):
        memory.stop_torque[j] = 0.0
        memory.stop_mode[j, 0] = 0
        memory.stop_mode[j, 1] = 0
    contacts = memory.contacts
    for contact in range(model.contact_link.shape[0]):
        contacts.force[contact, 0] = 0.0
        contacts.force[contact, 1] = 0.0
        memory.slip[contact] = 0.0
        memory.mode[contact] = 0
    for i in range(3):
        memory.answer.residual[i] = 0.0
    if count == 0:
        return True
    straight = are_usual(memory, near)
    problem = memory.problem
    if straight:
        gather_delassus(model, memory, near, count)
        if near == count == memory.usual_points.shape[0]:
            problem = memory.usual_problem
    else:
        write_rows(model, memory, count)
        assemble_delassus(model, memory, count)
    press_dry_joints(model, step, count, memory)
    problem.count = count
    status = solve_contact_kernel(problem, order, memory.solver, memory.answer)
    if straight:
        push_candidates(model, memory, near, count)
    else:
        add_impulse(model, memory, count, memory.next_v)
    for place in range(count):
        contact = memory.candidate[place]
        if contact >= dry:
            impulse = memory.answer.impulse[2 * place + 1]
            note_dry_joint(contact - dry, impulse, step, memory.answer.mode[place], memory)
            continue
        if contact >= points:
            joint = (contact - points) // 2
            sign = 1.0 - 2.0 * ((contact - points) % 2)
            memory.stop_torque[joint] += sign * memory.answer.impulse[2 * place] / step
            memory.stop_mode[joint, (contact - points) % 2] = memory.answer.mode[place] != 0
            continue
        contacts.force[contact, 0] = memory.answer.impulse[2 * place] / step
        contacts.force[contact, 1] = memory.answer.impulse[2 * place + 1] / step
        memory.slip[contact] = memory.answer.velocity[2 * place + 1]
        memory.mode[contact] = memory.answer.mode[place]
    return status == SOLVED


@dissolved_kernel
def decide(
    controller: Any,  # noqa: ARG001 - asked by the frame
    control: Control,  # noqa: ARG001
    model: Model,
    ground: GroundModel,  # noqa: ARG001
    memory: Memory,
    work: Stepping,
    record: Record,
    clock: Clock,
) -> int:
    """Find the velocity at the end of the step, and note what happens in it."""
    free_velocity(model, work.step, work.scheme, memory)
    push_robot(model, clock.time, work.step, memory)
    solved = solve_contacts(model, work.step, work.scheme, work.activation, work.order, memory)
    note_extremes(model, memory)
    note_events(model, record, clock.time, work.step, memory)
    return DONE if solved else SOLVER_FAILED


@dissolved_kernel
def report(
    controller: Any,  # noqa: ARG001
    control: Control,  # noqa: ARG001
    model: Model,  # noqa: ARG001
    ground: GroundModel,  # noqa: ARG001
    memory: Memory,
    work: Stepping,  # noqa: ARG001
    record: Record,
    clock: Clock,
) -> None:
    """Append a row if one is due."""
    note_row_when_due(record, memory, clock)


@dissolved_kernel
def move(
    controller: Any,  # noqa: ARG001
    control: Control,  # noqa: ARG001
    model: Model,
    ground: GroundModel,  # noqa: ARG001
    memory: Memory,
    work: Stepping,
    record: Record,  # noqa: ARG001
    clock: Clock,
) -> int:
    """Move on by a step."""
    memory.tally.steps += 1
    for i in range(model.parent.shape[0]):
        if work.scheme == PAPER_EXPLICIT:
            memory.q[i] += work.step * memory.v[i]
        elif work.scheme == MOREAU_JEAN:
            memory.q[i] += 0.5 * work.step * (memory.v[i] + memory.next_v[i])
        else:
            memory.q[i] += work.step * memory.next_v[i]
        memory.v[i] = memory.next_v[i]
    clock.time = clock.start + (clock.index + 1) * work.step
    return DONE


TimeStepping.work = Stepping
TimeStepping.kernels = Kernels(begin, prepare, decide, report, move)
