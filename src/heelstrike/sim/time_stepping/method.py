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

Where positions move with v + θ Δv, joint springs K and dampers D pull with −K (q + θ Δq) and
−D (v + θ Δv) at that part θ of the step. With Δq = h (v + θ Δv) and all other forces f as at its
beginning, springs and dampers among them::

    (A + θ h D + θ² h² K) Δv = h (f − θ h K v)

Moreau and Jean have θ = 1/2: with constant A a spring keeps its energy exactly, for the spring does
the work K (q + Δq/2) Δq. The linearly implicit scheme has θ = 1.
"""

# ruff: noqa: ARG001 - the kernels of all methods have the same arguments

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar

import numpy as np

from heelstrike.arguments import check_fields
from heelstrike.compiler.bundle import Bundle, array, number, part
from heelstrike.compiler.compilation import dissolved_kernel, kernel
from heelstrike.compiler.straight_line import play
from heelstrike.contact.ground import GroundModel
from heelstrike.contact.modes import SOLVED
from heelstrike.contact.problem import solve_contact_kernel
from heelstrike.contact.sets import INTERVAL, ImpulseSet
from heelstrike.contact.workspace import ContactProblem
from heelstrike.dynamics.kernels import integrate, passive_force
from heelstrike.dynamics.workspace import Workspace
from heelstrike.errors import SimulationError
from heelstrike.field_texts import dataclass
from heelstrike.robot.model import Floats, Integers, Model
from heelstrike.robot.robot import Robot
from heelstrike.sim.clock import Clock
from heelstrike.sim.closed_sets import Scheme
from heelstrike.sim.contacts.brakes import find_loops_of_step, note_brakes, share_friction
from heelstrike.sim.contacts.candidates import (
    are_there,
    find_constraints,
    hold_latched,
    list_candidate,
    list_dry_joints,
    locate_stops,
    note_answer,
    note_group,
    write_rows,
)
from heelstrike.sim.contacts.geometry import (
    add_impulse,
    assemble_delassus,
    bend_acceleration,
    contact_rows,
    contact_velocity,
    evaluate_equations,
    locate_contacts,
    row_product,
    solve_mass_matrix,
    weigh,
)
from heelstrike.sim.contacts.latches import react
from heelstrike.sim.contacts.loops import (
    append_loops,
    close_loops,
    free_loops,
    rows_of,
    speed_along,
    steady_loops,
)
from heelstrike.sim.contacts.points import point_velocities
from heelstrike.sim.contacts.rows import (
    CONSTRAINT,
    DRY_JOINT,
    LOOP,
    POINT,
    SECOND_FACE,
    STOP,
    Rows,
    lay_out_rows,
)
from heelstrike.sim.contacts.straight_line import DELASSUS, PUSH, SOLVE, VELOCITIES
from heelstrike.sim.contacts.writers import Writers, rate_of
from heelstrike.sim.controller.control import Control
from heelstrike.sim.controller.interface import Contacts
from heelstrike.sim.frame import DIVERGED, DONE, SOLVER_FAILED, Kernels, Scene
from heelstrike.sim.memory import Assembly, Equations, Memory, UsualPoints
from heelstrike.sim.method import Method, solver_order
from heelstrike.sim.push import add_pushes, share_over_step
from heelstrike.sim.record.record import Record
from heelstrike.sim.record.recording import (
    log_event,
    note_event,
    note_events,
    note_extremes,
    note_row_when_due,
)
from heelstrike.sim.setting import Setting
from heelstrike.sim.time_stepping.corners import join_forces, locate_corners
from heelstrike.sim.time_stepping.doubts import hardly_told, too_light, too_stiff
from heelstrike.sim.time_stepping.impact import (
    ENERGY_GAIN,
    NEVER,
    WEDGED,
    Impact,
    allocate_impact,
    call,
    close_gaps,
    deepest_point,
    dismiss,
    falls_into,
    find_members,
    hardest_point,
    left_alone,
    modes_change,
    note_touching,
    note_wedge,
    pose_impact,
    pose_way_out,
    relax,
    solve_impact,
    solve_restitution,
    speed_before,
    stays_wedged,
)
from heelstrike.tolerances import CLOSED_GAP

GAP_LINEARISED = int(Scheme.GAP_LINEARISED)
PAPER_EXPLICIT = int(Scheme.PAPER_EXPLICIT)
PAPER_SYMPLECTIC = int(Scheme.PAPER_SYMPLECTIC)
MOREAU_JEAN = int(Scheme.MOREAU_JEAN)
LINEARLY_IMPLICIT = int(Scheme.LINEARLY_IMPLICIT)
IMPACT_RESOLVED = int(Scheme.IMPACT_RESOLVED)

# A contact point enters the problem when it could close within a step at this speed (m/s) or at
# twice its free speed. Those that stay open get zero impulse from the solver, so that the choice
# costs time but not the answer. Gaps that would take 100 m/s to close are not looked at.
CLOSING_SPEED = 5.0
FAR_STEPS = 20.0
# The same for joint stops (rad/s or m/s).
CLOSING_RATE = 20.0
# Contact points deeper in the ground (m) than this, and than the run began, put it in doubt.
SUNK = 1e-2
# The same of joints beyond their stops (rad, m): 20 rad/s for a millisecond.
PAST = 2e-2


class Stepping(Bundle):
    """What the kernels of time stepping read."""

    step: float = number(float)
    """Length of a step (s)."""
    scheme: int = number(int)
    activation: float = number(float)
    """Gap up to which a contact point takes part, for schemes that decide by it (m)."""
    order: Integers = array("solvers", of=int)
    """Contact solvers in the order in which they are tried."""
    impact: Impact = part(Impact)
    """What closes in a step."""


@dataclass(frozen=True, kw_only=True)
class TimeStepping(Method):
    """Fixed steps whose contact impulses decide the velocity at the end of the step.

    Raises
    ------
    SimulationError
        If the step is not a positive finite number, the activation is negative, or scheme or
        solver are unknown.

    Notes
    -----
    First order in the step, whatever the scheme.
    """

    holds: ClassVar[frozenset[ImpulseSet]] = frozenset(ImpulseSet)

    step: float = 1e-3
    """Length of the step h in seconds."""
    scheme: Scheme = Scheme.IMPACT_RESOLVED
    """Discretisation; see :class:`~heelstrike.sim.closed_sets.Scheme`."""
    solver: str = "lemke"
    """Contact solver tried first: ``"lemke"``, ``"fischer_burmeister"`` or ``"gauss_seidel"``; the
    others follow as fallbacks, each use counted in the run."""
    activation: float = 0.0
    """Gap in metres up to which a contact point takes part, for the schemes that decide by the gap
    alone (the paper's two and Moreau-Jean). With the literal zero, a foot at rest loses and regains
    the ground through round-off."""
    bounded_restitution: bool = False
    """Whether restitution is scaled back in an impact in which it would make energy (with friction
    it may, Kane's paradox). Such impacts are told of either way, by events ``ENERGY_GAIN``."""

    def __post_init__(self) -> None:
        check_fields(self, SimulationError)
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

    def new_work(self, robot: Robot) -> Stepping:
        """Return what its kernels read."""
        return Stepping(
            step=self.step,
            scheme=int(self.scheme),
            activation=self.activation,
            order=solver_order(self.solver),
            impact=allocate_impact(robot, bounded=self.bounded_restitution),
        )

    def room(self, robot: Robot) -> tuple[int, int]:
        """Return how many rows and events a step may add to the record."""
        events = (
            2 * (robot.nc + robot.nv)
            + len(robot.joint_names)
            + robot.model.latches
            + robot.model.brakes
            + 2 * len(robot.constraints)
            + 2
        )
        return 1, events

    def forget_ground(
        self, robot: Robot, work: Stepping, clock: Clock, *, stops: bool = False
    ) -> None:
        """What touched other ground says nothing of this one."""
        rows = lay_out_rows(robot)
        stood = work.impact.touching[rows.first[STOP] : rows.end[STOP]].copy()
        work.impact.touching[:] = NEVER
        if stops:
            clock.begun = 0  # loops are closed again
        else:
            work.impact.touching[rows.first[STOP] : rows.end[STOP]] = stood
        work.impact.corner.near = 0

    def check(self, setting: Setting) -> None:
        """Refuse ground with restitution where the scheme knows plastic impacts only."""
        bounces = self.scheme in (Scheme.MOREAU_JEAN, Scheme.IMPACT_RESOLVED)
        if not bounces and np.any(setting.ground.model().restitution > 0.0):
            raise SimulationError(
                f"{self.scheme.name} knows plastic impacts only, and this ground has "
                f"restitution; use Scheme.IMPACT_RESOLVED or Scheme.MOREAU_JEAN"
            )

    def warning(self, setting: Setting) -> str:
        """Say which spring is too stiff for the step."""
        return self._too_stiff(setting.robot, setting.state.q)

    def doubts(self, robot: Robot, q: Floats, sunk: float = 0.0, past: float = 0.0) -> list[str]:
        """Say what is too stiff or too light, and how far a step went too far."""
        deep = (
            f"a step ended with a contact point {sunk:.2g} m in the ground: it turned too far in a "
            f"step of {self.step:g} s, which has to be shorter"
        )
        beyond = (
            f"a step ended with a joint {past:.2g} rad or m beyond its stop: "
            f"Scheme.{self.scheme.name} sees a stop once it is passed. Use a shorter step than "
            f"{self.step:g} s, or Scheme.IMPACT_RESOLVED"
        )
        found = (
            self._too_stiff(robot, q), self._too_stiff(robot, q, hardly_told),
            too_light(robot, q), deep if sunk > SUNK else "",
            beyond if past > PAST else "",
        )  # fmt: skip
        return [doubt for doubt in found if doubt]

    def _too_stiff(
        self, robot: Robot, q: Floats, asked: Callable[[Robot, Floats, float], str] = too_stiff
    ) -> str:
        implicit = self.scheme in (Scheme.MOREAU_JEAN, Scheme.LINEARLY_IMPLICIT)
        return "" if implicit else asked(robot, q, self.step)


@dissolved_kernel
def is_linearised(scheme: int) -> bool:
    """Whether a scheme bounds the gap at the end of the step."""
    return scheme in (GAP_LINEARISED, LINEARLY_IMPLICIT, IMPACT_RESOLVED)


@dissolved_kernel
def begin(model: Model, ground: GroundModel, memory: Memory, work: Stepping, record: Record) -> int:
    """Begin with closed loops."""
    if rows_of(memory.loops) > 0:
        equations, loops, q = memory.equations, memory.loops, memory.q
        if not close_loops(model, equations, loops, q):
            return DIVERGED
        steady_loops(model, q, equations, loops, memory.v)
    return DONE


@kernel
def add_springs(
    model: Model, ahead: float, stiffness: Floats, damping: Floats, added: Floats
) -> None:
    """Write what springs and dampers that act a time ahead add to the mass matrix."""
    for i in range(model.nv):
        added[i] = ahead * (damping[i] + ahead * stiffness[i])


@dissolved_kernel
def prepare(model: Model, ground: GroundModel, memory: Memory, work: Stepping) -> None:
    """Kinematics, contact points, mass matrix and bias force of the state now."""
    equations = memory.equations
    if work.scheme == LINEARLY_IMPLICIT:  # with the gains of the controller
        add_springs(model, work.step, memory.stiffness, memory.damping, equations.added)
    elif work.scheme == MOREAU_JEAN:
        add_springs(model, 0.5 * work.step, model.stiffness, model.damping, equations.added)
    evaluate_equations(model, memory.q, memory.v, equations)
    locate_contacts(model, ground, equations.tree, memory.contacts, memory.surface)
    if memory.loops.unknown.shape[0] > 0:
        find_loops_of_step(model, memory)
    if memory.rows.outside.kernel.shape[0] > 0:
        find_constraints(model, memory.q, memory.v, equations.tree, memory.rows)
    if ground.concave == 1:
        locate_corners(
            model, ground, equations.tree, memory.rows, memory.seconds, memory.surface,
            work.impact.corner,
        )  # fmt: skip


@dissolved_kernel
def free_velocity(model: Model, work: Stepping, time: float, memory: Memory) -> None:
    """Velocity at the end of the step if there were no ground, into ``memory.next_v``.

    Springs and dampers that a scheme takes later in the step are added to the mass matrix, as if
    they were armature.
    """
    step, equations, v, next_v = work.step, memory.equations, memory.v, memory.next_v
    force, rate = equations.force, equations.rate
    passive_force(model, memory.q, v, force)
    for i in range(model.nu):
        force[model.actuator_joint[i]] += memory.torque[i]
    if work.scheme in (LINEARLY_IMPLICIT, MOREAU_JEAN):
        halved = work.scheme == MOREAU_JEAN
        ahead = 0.5 * step if halved else step
        stiffness = model.stiffness if halved else memory.stiffness
        added = 0.0
        for i in range(model.nv):
            force[i] -= ahead * stiffness[i] * v[i]
            added += equations.added[i]
        if (added > 0.0 or not halved) and equations.programs[SOLVE] != 0:
            weigh(model, equations)  # the program has not heard of it
    for i in range(model.nv):
        rate[i] = step * (force[i] - equations.bias[i])
    solve_mass_matrix(model, equations, rate)
    for i in range(model.nv):
        next_v[i] = v[i] + rate[i]
    if share_over_step(time, step, memory.pushes):
        for i in range(model.nv):
            rate[i] = 0.0
        add_pushes(model, equations.tree, memory.pushes, rate)
        solve_mass_matrix(model, equations, rate)
        for i in range(model.nv):
            next_v[i] += step * rate[i]


@dissolved_kernel
def find_velocities(
    model: Model, contacts: Contacts, v: Floats, straight: bool, tree: Workspace, usual: UsualPoints
) -> None:
    """Velocities of the usual points by their program, or of all by the loops."""
    velocity = usual.point_velocity
    if straight:
        play(usual.programs[VELOCITIES], (model, usual.usual_points, contacts, v, tree, velocity))
    else:
        point_velocities(model, usual.every_point, contacts, v, tree, velocity)


@kernel
def are_usual(candidate: Integers, near: int, program: int, usual: UsualPoints) -> bool:
    """Whether there is a program for the contact points among the candidates, the first `near`."""
    straight = usual.programs[program] != 0
    if usual.usual_points.shape[0] < usual.usual_place.shape[0]:
        for place in range(near):
            straight = straight and usual.usual_place[candidate[place]] >= 0
    return straight


@dissolved_kernel
def select_candidates(model: Model, curved: bool, work: Stepping, memory: Memory) -> int:
    """List the contact points that could act in this step, with their free terms.

    On curved ground a gap is linearised along the chord of the step, as loops are: with half of
    what turning normals add to its rate.
    """
    contacts, assembly, step = memory.contacts, memory.assembly, work.step
    candidate, problem = assembly.candidate, assembly.problem
    linearised, calls = is_linearised(work.scheme), work.impact.calls
    farthest = FAR_STEPS * CLOSING_SPEED * step
    if work.scheme in (PAPER_EXPLICIT, PAPER_SYMPLECTIC):
        farthest = work.activation
    near = 0
    for contact in range(model.nc):
        if contacts.gap[contact] <= farthest:
            candidate[near] = contact
            near += 1
    if near == 0:
        return 0
    straight = are_usual(candidate, near, VELOCITIES, memory.usual)
    tree = memory.equations.tree
    find_velocities(model, contacts, memory.next_v, straight, tree, memory.usual)
    velocity = memory.usual.point_velocity
    count = 0
    for place in range(near):
        contact = candidate[place]
        gap = contacts.gap[contact]
        normal = velocity[contact, 0]
        if curved and linearised:
            bend = memory.surface.bend[contact]
            normal += 0.5 * step * bend_acceleration(model, tree, contacts, contact, bend)
        if linearised:
            far = gap > step * max(CLOSING_SPEED, -2.0 * normal)
            if far and (calls == 0 or work.impact.called[contact] == 0):
                continue
            normal += gap / step
        elif work.scheme == MOREAU_JEAN:
            before, _ = contact_velocity(model, tree, contacts, contact)
            if gap + 0.5 * step * before > work.activation:
                continue
            if work.impact.relaxed == 0:
                work.impact.bounce[count] = memory.surface.restitution[contact] * before
                normal += work.impact.bounce[count]
        row = list_candidate(contact, count, 2, memory)
        problem.free[row] = normal
        problem.free[row + 1] = velocity[contact, 1]
        count += 1
    return count


@dissolved_kernel
def stops_are_near(model: Model, step: float, q: Floats, v: Floats) -> bool:
    """Whether any joint stop could act in a step that bounds the gap at its end."""
    near = 0
    for joint in range(model.nv):
        reach = step * max(CLOSING_RATE, 2.0 * abs(v[joint]))
        near += (q[joint] - model.lower[joint] < reach) | (model.upper[joint] - q[joint] < reach)
    return near > 0


@dissolved_kernel
def select_stops(model: Model, work: Stepping, count: int, memory: Memory) -> int:
    """Append the joint stops that could act in this step: contacts without friction."""
    problem, step, rows = memory.assembly.problem, work.step, memory.rows
    linearised, calls = is_linearised(work.scheme), work.impact.calls
    if linearised and calls == 0 and not stops_are_near(model, step, memory.q, memory.next_v):
        return count
    locate_stops(memory.q, rows)
    for stop in range(rows.first[STOP], rows.end[STOP]):
        joint, side, gap = rows.owner[stop], rows.side[stop], rows.gap[stop]
        normal = side * memory.next_v[joint]
        if linearised:
            far = not gap < step * max(CLOSING_RATE, -2.0 * normal)
            if far and (calls == 0 or work.impact.called[stop] == 0):
                continue
            normal += gap / step
        elif work.scheme == MOREAU_JEAN:
            if not gap + 0.5 * step * side * memory.v[joint] <= work.activation:
                continue
        elif not gap <= work.activation:
            continue
        problem.free[list_candidate(stop, count, 1, memory)] = normal
        count += 1
    return count


@kernel
def select_corners(model: Model, count: int, work: Stepping, memory: Memory) -> int:
    """Append the second faces of corners that could act in this step."""
    assembly, rows, step = memory.assembly, memory.rows, work.step
    problem, tree = assembly.problem, memory.equations.tree
    for second in range(rows.first[SECOND_FACE], rows.end[SECOND_FACE]):
        gap = rows.gap[second]
        if gap > FAR_STEPS * CLOSING_SPEED * step:
            continue
        contact_rows(model, tree, memory.seconds, rows.owner[second], count, assembly)
        row = problem.first[count]
        normal = row_product(assembly.jacobian, row, memory.next_v)
        if is_linearised(work.scheme):
            if gap > step * max(CLOSING_SPEED, -2.0 * normal):
                continue
            normal += gap / step
        elif work.scheme == MOREAU_JEAN:
            before = row_product(assembly.jacobian, row, memory.v)
            if gap + 0.5 * step * before > work.activation:
                continue
            if work.impact.relaxed == 0:
                work.impact.bounce[count] = memory.surface.restitution[second] * before
                normal += work.impact.bounce[count]
        elif gap > work.activation:
            continue
        row = list_candidate(second, count, 2, memory)
        problem.free[row] = normal
        problem.free[row + 1] = row_product(assembly.jacobian, row + 1, memory.next_v)
        count += 1
    return count


@kernel
def select_constraints(count: int, work: Stepping, memory: Memory) -> int:
    """Append the constraints from outside that could act in this step, and may let go.

    As with loops, half of what turning rows add to a rate is in the free term: to second order that
    is the chord of the step.
    """
    rows, problem, step = memory.rows, memory.assembly.problem, work.step
    outside, calls = rows.outside, work.impact.calls
    for entry in range(rows.first[CONSTRAINT], rows.end[CONSTRAINT]):
        own = rows.owner[entry]
        normal = rate_of(own, 0, memory.next_v, outside)
        if rows.set[entry] == INTERVAL:
            row = list_candidate(entry, count, 2, memory)
            problem.free[row + 1] = normal
            problem.bound[count] = step * rows.limit[entry]
            count += 1
            continue
        gap = outside.gap[own, 0]
        if is_linearised(work.scheme):
            normal += 0.5 * step * outside.bias[own, 0]
            far = gap > step * max(CLOSING_SPEED, -2.0 * normal)
            if far and (calls == 0 or work.impact.called[entry] == 0):
                continue
            normal += gap / step
        elif work.scheme == MOREAU_JEAN:
            before = rate_of(own, 0, memory.v, outside)
            if gap + 0.5 * step * before > work.activation:
                continue
            if work.impact.relaxed == 0:
                work.impact.bounce[count] = memory.surface.restitution[entry] * before
                normal += work.impact.bounce[count]
        elif gap > work.activation:
            continue
        row = list_candidate(entry, count, rows.components[entry], memory)
        problem.free[row] = normal
        if rows.components[entry] == 2:
            problem.free[row + 1] = rate_of(own, 1, memory.next_v, outside)
        count += 1
    return count


@kernel
def joint_row(rows: Rows, assembly: Assembly, place: int) -> tuple[int, int, float]:
    """Row of a candidate that is a stop or a dry joint, its joint, and the sign of the two."""
    entry = assembly.candidate[place]
    row = assembly.problem.first[place + 1] - 1
    return row, rows.owner[entry], rows.side[entry]


@dissolved_kernel
def gather_delassus(
    model: Model, contacts: Contacts, rows: Rows, near: int, count: int, equations: Equations,
    usual: UsualPoints, assembly: Assembly,
) -> None:  # fmt: skip
    """Delassus matrix of all usual points; that of the candidates too, if these are others."""
    candidate, usual_place = assembly.candidate, usual.usual_place
    if near > 0:
        play(
            usual.programs[DELASSUS],
            (
                model, usual.usual_points, equations.tree, contacts, equations.factor,
                usual.point_rows, usual.usual_problem.delassus,
            ),
        )  # fmt: skip
    if near == count == usual.usual_points.shape[0]:
        return
    whole, delassus = usual.usual_problem.delassus, assembly.problem.delassus
    if near == usual.usual_points.shape[0]:  # they are listed in the same order
        for row in range(2 * near):
            for column in range(2 * near):
                delassus[row, column] = whole[row, column]
    else:
        for place in range(near):
            row = 2 * usual_place[candidate[place]]
            for other in range(near):
                column = 2 * usual_place[candidate[other]]
                for i in range(2):
                    for j in range(2):
                        delassus[2 * place + i, 2 * other + j] = whole[row + i, column + j]
    for place in range(near, assembly.until[DRY_JOINT]):
        add_joint(model, contacts, rows, near, place, equations, usual, assembly)


@dissolved_kernel
def add_joint(
    model: Model, contacts: Contacts, rows: Rows, near: int, place: int, equations: Equations,
    usual: UsualPoints, assembly: Assembly,
) -> None:  # fmt: skip
    """Add the stop or dry joint at a place to the Delassus matrix of the candidates before.

    What a unit impulse along its row does to the joint velocities, A⁻¹ e, goes to that row of
    ``assembly.jacobian``. The other row of a dry joint is the solvers'.
    """
    candidate, delassus = assembly.candidate, assembly.problem.delassus
    row, joint, sign = joint_row(rows, assembly, place)
    change = assembly.jacobian[row]
    for j in range(model.nv):
        change[j] = 0.0
    change[joint] = sign
    solve_mass_matrix(model, equations, change)
    if near > 0:
        find_velocities(model, contacts, change, True, equations.tree, usual)
    for other in range(near):
        for i in range(2):
            entry = usual.point_velocity[candidate[other], i]
            delassus[row, 2 * other + i] = entry
            delassus[2 * other + i, row] = entry
    for other in range(near, place + 1):
        column, its_joint, its_sign = joint_row(rows, assembly, other)
        entry = its_sign * change[its_joint]
        delassus[row, column] = entry
        delassus[column, row] = entry


@kernel
def add_loop(model: Model, near: int, joints: int, place: int, memory: Memory) -> None:
    """Add the row of a loop at a place to the Delassus matrix, after all points and joints.

    As with joints, A⁻¹ Jᵀ goes to that row of ``assembly.jacobian``.
    """
    assembly, usual, first = memory.assembly, memory.usual, memory.assembly.problem.first
    candidate, delassus = assembly.candidate, assembly.problem.delassus
    row = first[place]
    change = assembly.jacobian[row]
    solve_mass_matrix(model, memory.equations, change)
    if near > 0:
        find_velocities(model, memory.contacts, change, True, memory.equations.tree, usual)
    for other in range(near):
        for i in range(2):
            entry = usual.point_velocity[candidate[other], i]
            delassus[row, 2 * other + i] = entry
            delassus[2 * other + i, row] = entry
    for other in range(near, place + 1):
        column = first[other]
        if other < joints:
            column, joint, sign = joint_row(memory.rows, assembly, other)
            entry = sign * change[joint]
        else:
            entry = speed_along(other - joints, memory.loops, change)
        delassus[row, column] = entry
        delassus[column, row] = entry


@dissolved_kernel
def push_candidates(
    model: Model, contacts: Contacts, rows: Rows, assembly: Assembly, near: int, count: int,
    equations: Equations, usual: UsualPoints, v: Floats,
) -> None:  # fmt: skip
    """Add what the impulses of the candidates do to a velocity, after `gather_delassus`."""
    impulse = assembly.answer.impulse
    for contact in range(model.nc):
        for k in range(2):
            usual.point_impulse[contact, k] = 0.0
    for place in range(near):
        for k in range(2):
            usual.point_impulse[assembly.candidate[place], k] = impulse[2 * place + k]
    if near > 0:
        play(
            usual.programs[PUSH],
            (
                model, usual.usual_points, contacts, equations.factor, usual.point_impulse,
                equations.tree, equations.rate, v,
            ),
        )  # fmt: skip
    for place in range(near, count):
        row, _, _ = joint_row(rows, assembly, place)
        for j in range(model.nv):
            v[j] += impulse[row] * assembly.jacobian[row, j]


@kernel
def push_all(
    model: Model, near: int, count: int, straight: bool, memory: Memory, v: Floats
) -> None:
    """Add what the impulses of the candidates do to a velocity."""
    contacts, assembly = memory.contacts, memory.assembly
    equations, usual = memory.equations, memory.usual
    if straight:
        joints = count - rows_of(memory.loops)
        push_candidates(model, contacts, memory.rows, assembly, near, joints, equations, usual, v)
        for row in range(assembly.problem.first[joints], assembly.problem.first[count]):
            for j in range(model.nv):
                v[j] += assembly.answer.impulse[row] * assembly.jacobian[row, j]
    else:
        add_impulse(model, assembly, count, equations, v)


@dissolved_kernel
def solve_candidates(model: Model, near: int, count: int, work: Stepping, memory: Memory) -> bool:
    """Find the impulses of the candidates and add what they do to the velocity; return success.

    Points are the first `near` of `count`.
    """
    assembly, contacts, rows = memory.assembly, memory.contacts, memory.rows
    equations, usual, problem = memory.equations, memory.usual, memory.assembly.problem
    impact, step = work.impact, work.step
    others = are_there(SECOND_FACE, assembly) or are_there(CONSTRAINT, assembly)
    straight = not others and are_usual(assembly.candidate, near, DELASSUS, usual)
    if straight:
        gather_delassus(model, contacts, rows, near, count, equations, usual, assembly)
        loops = count - rows_of(memory.loops)
        for place in range(loops, count):
            add_loop(model, near, loops, place, memory)
        if near == count == usual.usual_points.shape[0]:
            problem = usual.usual_problem
    else:
        write_rows(model, equations.tree, contacts, memory.seconds, rows, assembly)
        assemble_delassus(model, count, equations, assembly)
    problem.count = count
    if work.scheme == MOREAU_JEAN:
        status = solve_restitution(work.order, problem, memory.solver, impact, assembly.answer)
        solved = status == SOLVED
    else:
        status = solve_contact_kernel(work.order, problem, memory.solver, assembly.answer)
        solved = status == SOLVED
    resolves = solved and work.scheme == IMPACT_RESOLVED
    gap, before = rows.gap, memory.tally.steps - 1
    if resolves and falls_into(step, before, gap, impact.touching, problem, assembly):
        impact.happens = 1
        arriving = impact.arriving
        for j in range(model.nv):
            arriving[j] = memory.next_v[j]
        push_all(model, near, count, straight, memory, arriving)
        if impact.relaxed == 1:
            push_out(model, near, count, straight, problem, work, memory)
        members = find_members(step, before, gap, impact.touching, problem, assembly, impact.member)
        for place in range(members):
            entry = assembly.candidate[impact.member[place]]
            restitution = memory.surface.restitution[entry]
            impact.bounce[place] = 0.0
            if impact.relaxed == 0 and restitution > 0.0:
                impact.bounce[place] = restitution * speed_before(
                    model, entry, memory.v, rows, equations.tree, contacts, memory.seconds
                )
        pose_impact(step, members, assembly.candidate, gap, assembly.answer.mode, problem, impact)
        solved = solve_impact(work.order, members, problem, memory.solver, impact, assembly)
    push_all(model, near, count, straight, memory, memory.next_v)
    return solved


@kernel
def push_out(
    model: Model, near: int, count: int, straight: bool, problem: ContactProblem, work: Stepping,
    memory: Memory,
) -> None:  # fmt: skip
    """Let the positions of a wedge come out of the ground, where a way without friction leads."""
    impact, answer = work.impact, memory.assembly.answer
    pose_way_out(
        work.step, memory.assembly.candidate, memory.rows.gap, answer.velocity, problem, impact
    )
    solver, its = memory.solver, impact.answer
    if solve_contact_kernel(work.order, impact.problem, solver, its) == SOLVED:
        for row in range(problem.first[count]):
            answer.impulse[row] = its.impulse[row]
        push_all(model, near, count, straight, memory, impact.arriving)


@dissolved_kernel
def may_go_through(
    model: Model, work: Stepping, near: int, count: int, v: Floats, memory: Memory
) -> bool:
    """Whether the velocity that was found could take something through a stop or the ground.

    What is no candidate is too far away to get there at its free velocity: it has to be thrown. A
    stop has to be reached faster than any that is out of reach can be.
    """
    if count == 0:
        return False
    thrown = 0
    for joint in range(model.nv):
        thrown += abs(v[joint]) > CLOSING_RATE
    if thrown > 0 or memory.rows.outside.kernel.shape[0] > 0:
        return True
    known = near == count and work.impact.happens == 0
    for contact in range(model.nc):
        gap = memory.contacts.gap[contact]
        if work.step * CLOSING_SPEED < gap <= work.step * CLOSING_SPEED * FAR_STEPS and not (
            known and stays_above(work.step, contact, gap, near, memory.assembly, memory.usual)
        ):
            return True
    return False


@kernel
def stays_above(
    step: float, contact: int, gap: float, near: int, assembly: Assembly, usual: UsualPoints
) -> bool:
    """Whether it is known that the impulses of the candidates leave a contact point above ground.

    All of them are contact points. Of a usual one the Delassus matrix is there, and the free
    velocity.
    """
    row = 2 * usual.usual_place[contact]
    if usual.programs[DELASSUS] == 0 or row < 0:
        return False
    delassus, impulse = usual.usual_problem.delassus, assembly.answer.impulse
    normal = usual.point_velocity[contact, 0]
    for place in range(near):
        column = 2 * usual.usual_place[assembly.candidate[place]]
        if column < 0:
            return False
        normal += delassus[row, column] * impulse[2 * place]
        normal += delassus[row, column + 1] * impulse[2 * place + 1]
    return gap + step * normal >= -0.5 * CLOSED_GAP


@dissolved_kernel
def far_beyond(step: float, own: int, outside: Writers) -> float:
    """How far beyond its limit the tangent of a step may lead, whose chord does not."""
    return CLOSED_GAP + max(0.5 * step * step * outside.bias[own, 0], 0.0)


@kernel
def call_missed(model: Model, step: float, v: Floats, memory: Memory, impact: Impact) -> bool:
    """Call what would go through at the velocity that was found; return if any is new."""
    calls = impact.calls
    usual, contacts = memory.usual, memory.contacts
    straight = are_usual(usual.every_point, model.nc, VELOCITIES, usual)
    find_velocities(model, contacts, v, straight, memory.equations.tree, usual)
    for contact in range(model.nc):
        if contacts.gap[contact] + step * usual.point_velocity[contact, 0] < -CLOSED_GAP:
            call(contact, impact)
    rows = memory.rows
    for stop in range(rows.first[STOP], rows.end[STOP]):
        joint, side = rows.owner[stop], rows.side[stop]
        if side * (memory.q[joint] + step * v[joint]) < side * rows.limit[stop] - CLOSED_GAP:
            call(stop, impact)
    for entry in range(rows.first[CONSTRAINT], rows.end[CONSTRAINT]):
        own = rows.owner[entry]
        ahead = rows.outside.gap[own, 0] + step * rate_of(own, 0, v, rows.outside)
        if rows.set[entry] != INTERVAL and ahead < -far_beyond(step, own, rows.outside):
            call(entry, impact)
    return impact.calls > calls


@dissolved_kernel
def solve_step(model: Model, curved: bool, time: float, work: Stepping, memory: Memory) -> bool:
    """Find the velocity at the end of the step; return success.

    What an impulse elsewhere throws against the ground or a stop, though it was too far away to be
    a candidate, is called and the step solved again. So it is where nothing pushes all candidates
    out of where they are already, or lets them bounce; they are left there, then, and in a wedge
    that lasts at once.
    """
    assembly, impact = memory.assembly, work.impact
    gap, restitution = memory.rows.gap, memory.surface.restitution
    again = True
    solved = True
    near = count = 0
    impact.relaxed = int(stays_wedged(memory.tally.steps, impact))
    at_once = impact.relaxed == 1
    while again:
        free_velocity(model, work, time, memory)
        impact.happens = impact.gains = 0
        for place in range(impact.bounce.shape[0] if work.scheme == MOREAU_JEAN else 0):
            impact.bounce[place] = 0.0
        for i in range(3):
            assembly.answer.residual[i] = 0.0
        near = select_candidates(model, curved, work, memory)
        note_group(POINT, 0, near, assembly)
        count = select_stops(model, work, near, memory)
        count = hold_latched(model, count, memory.next_v, memory)
        first = note_group(STOP, near, count, assembly)
        if memory.rows.outside.kernel.shape[0] > 0:
            count = select_constraints(count, work, memory)
        first = note_group(CONSTRAINT, first, count, assembly)
        count = list_dry_joints(count, work.step, memory.next_v, memory)
        first = note_group(DRY_JOINT, first, count, assembly)
        if impact.corner.near > 0:
            count = select_corners(model, count, work, memory)
        first = note_group(SECOND_FACE, first, count, assembly)
        count = append_loops(count, 1, memory.loops, assembly)
        note_group(LOOP, first, count, assembly)
        free_loops(count, memory.loops, memory.next_v, 0.5 * work.step, assembly)
        if at_once:
            deepest, bounces = left_alone(count, assembly.candidate, gap, restitution)
            if deepest == 0.0 and not bounces:  # the wedge is over
                impact.relaxed = 0
        if impact.relaxed == 1 and is_linearised(work.scheme):
            close_gaps(work.step, count, gap, assembly)
        if count > 0:
            solved = solve_candidates(model, near, count, work, memory)
        v = impact.arriving if impact.happens == 1 else memory.next_v
        if not solved:
            deepest, bounces = left_alone(count, assembly.candidate, gap, restitution)
            again = relax(is_linearised(work.scheme), deepest, bounces, memory.tally.steps, impact)
        elif at_once and impact.relaxed == 1 and modes_change(assembly, memory.reaction.mode):
            at_once, impact.relaxed = False, 0
        elif is_linearised(work.scheme):
            again = may_go_through(model, work, near, count, v, memory) and call_missed(
                model, work.step, v, memory, impact
            )
        else:
            again = False
    if impact.calls > 0:
        dismiss(impact)
    if work.scheme == IMPACT_RESOLVED:
        note_touching(work.step, count, memory.tally.steps, assembly, impact.touching)
    note_answer(model, work.step, memory)
    if are_there(SECOND_FACE, assembly):
        join_forces(model, memory.seconds, memory.contacts)
    return solved


@dissolved_kernel
def decide(
    scene: Scene, control: Control, memory: Memory, work: Stepping, record: Record, clock: Clock
) -> int:
    """Find the velocity at the end of the step, and note what happens in it."""
    model = scene.model
    solved = solve_step(model, scene.ground.curved == 1, clock.time, work, memory)
    note_extremes(model, memory)
    if work.impact.relaxed == 1:
        memory.solver.tally.relaxed += 1
        if note_wedge(memory.tally.steps, work.impact):
            log_event(clock.time, WEDGED, deepest_point(memory.contacts.gap), 0.0, 0.0, record)
    first = record.events
    end = clock.start + (clock.index + 1) * work.step
    note_events(model, clock.time, end, work.step, memory, record)
    react(model, first, memory.q, record, memory.loops)
    share_friction(
        model, memory.breakaway, memory.reaction.friction_torque, memory.loops.brake_force
    )
    note_brakes(model, clock.time, work.step, record, memory.loops)
    if work.impact.gains == 1:
        force = memory.contacts.force
        note_event(end, ENERGY_GAIN, hardest_point(force), work.step, force, record)
        memory.tally.energy_gain += work.impact.gain
    return DONE if solved else SOLVER_FAILED


@dissolved_kernel
def report(
    scene: Scene, control: Control, memory: Memory, work: Stepping, record: Record, clock: Clock
) -> None:
    """Append a row if one is due."""
    note_row_when_due(memory, clock, record)


@dissolved_kernel
def move(
    scene: Scene, control: Control, memory: Memory, work: Stepping, record: Record, clock: Clock
) -> int:
    """Move on by a step."""
    model = scene.model
    q, v, next_v = memory.q, memory.v, memory.next_v
    memory.tally.steps += 1
    if work.scheme == MOREAU_JEAN:
        for i in range(model.nv):
            v[i] += next_v[i]
        integrate(model, q, v, 0.5 * work.step, q)
    elif work.impact.happens == 1:
        integrate(model, q, work.impact.arriving, work.step, q)
    elif work.scheme == PAPER_EXPLICIT:
        integrate(model, q, v, work.step, q)
    else:
        integrate(model, q, next_v, work.step, q)
    for i in range(model.nv):
        v[i] = next_v[i]
    has_loops = rows_of(memory.loops) > 0
    if has_loops and not close_loops(model, memory.equations, memory.loops, q):
        return DIVERGED
    clock.time = clock.start + (clock.index + 1) * work.step
    return DONE


TimeStepping.work = Stepping
TimeStepping.usual_numbers = {"scheme": IMPACT_RESOLVED}
TimeStepping.kernels = Kernels(begin, prepare, decide, report, move)
