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
from typing import Any, ClassVar, NamedTuple

import numpy as np

from heelstrike.arguments import check_fields
from heelstrike.compiler.bundle import Bundle, array, number, part
from heelstrike.compiler.compilation import dissolved_kernel, kernel, rare_kernel
from heelstrike.compiler.straight_line import play
from heelstrike.compiler.words import bits_of, copy_words, stay_below
from heelstrike.contact.ground import GroundModel
from heelstrike.contact.modes import SOLVED
from heelstrike.contact.problem import solve_contact_kernel
from heelstrike.contact.sets import EVERY_ROW, INTERVAL, ImpulseSet, row_of
from heelstrike.contact.workspace import PROGRAM_ROWS, ContactProblem, ContactWorkspace
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
    Listing,
    are_there,
    find_constraints,
    hold_latched,
    list_candidate,
    list_dry_joints,
    locate_stops,
    note_answer,
    note_group,
    write_contact_rows,
    write_joint_rows,
)
from heelstrike.sim.contacts.geometry import (
    add_impulse,
    assemble_delassus,
    contact_rows,
    contact_velocity,
    curvature_acceleration,
    evaluate_equations,
    locate_in_straight_line,
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
from heelstrike.sim.contacts.straight_line import DELASSUS, FREE, LOCATE, PUSH, SOLVE, VELOCITIES
from heelstrike.sim.contacts.writers import Writers, rate_of
from heelstrike.sim.controller.control import Control
from heelstrike.sim.controller.interface import Contacts
from heelstrike.sim.frame import (
    DIVERGED,
    DONE,
    SOLVER_FAILED,
    Kernels,
    Scene,
)
from heelstrike.sim.memory import (
    Assembly,
    Directions,
    Equations,
    Memory,
    Surface,
    UsualPoints,
)
from heelstrike.sim.method import Method, solver_order
from heelstrike.sim.push import Pushes, add_pushes, share_over_step
from heelstrike.sim.record.record import Record
from heelstrike.sim.record.recording import (
    log_event,
    note_event,
    note_events,
    note_extremes,
)
from heelstrike.sim.setting import Setting
from heelstrike.sim.time_stepping.corners import join_forces, locate_corners
from heelstrike.sim.time_stepping.doubts import hardly_told, too_light, too_stiff
from heelstrike.sim.time_stepping.impact import (
    ENERGY_GAIN,
    NEVER,
    WEDGED,
    Calls,
    Impact,
    allocate_impact,
    call,
    close_gaps,
    deepest_point,
    dismiss,
    falls_into,
    find_members,
    hardest_point,
    leave_others_out,
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
CLOSING_RATE_BITS = bits_of(CLOSING_RATE)
# Contact points deeper in the ground (m) than this, and than the run began, put it in doubt.
SUNK = 1e-2
# The same of joints beyond their stops (rad, m): 20 rad/s for a millisecond.
PAST = 2e-2


class Rule(NamedTuple):
    """By what a step decides who takes part in it.

    Attributes
    ----------
    step : float
        Length of the step (s).
    scheme : int
    activation : float
        Gap up to which something takes part, for schemes that decide by it (m, rad).
    calls : int
        How many there are that are called, and take part although they seemed too far away.
    relaxed : int
        Whether nothing bounces.
    """

    step: float
    scheme: int
    activation: float
    calls: int
    relaxed: int


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


def refuse_restitution(scheme: Scheme, setting: Setting, bounce: tuple[Scheme, ...]) -> None:
    """Refuse ground with restitution under a scheme that is none of those that bounce."""
    if scheme not in bounce and np.any(setting.ground.model().restitution > 0.0):
        raise SimulationError(
            f"{scheme.name} knows plastic impacts only, and this ground has restitution; use "
            f"{' or '.join(f'Scheme.{each.name}' for each in bounce)}"
        )


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
        refuse_restitution(self.scheme, setting, (Scheme.IMPACT_RESOLVED, Scheme.MOREAU_JEAN))

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
    program = equations.programs[LOCATE]
    locate_in_straight_line(model, ground, program, equations.tree, memory.contacts, memory.surface)
    if memory.loops.unknown.shape[0] > 0:
        find_loops_of_step(model, memory.q, memory.v, equations.tree, memory.loops)
    if memory.rows.outside.kernel.shape[0] > 0:
        find_constraints(model, memory.q, memory.v, equations.tree, memory.rows)
    if ground.concave == 1:
        locate_corners(
            model, ground, equations.tree, memory.rows.first[SECOND_FACE], memory.second_faces,
            memory.surface, work.impact.corner,
        )  # fmt: skip


@dissolved_kernel
def free_velocity(
    model: Model, step: float, scheme: int, time: float, q: Floats, v: Floats, torque: Floats,
    stiffness: Floats, pushes: Pushes, equations: Equations, next_v: Floats,
) -> None:  # fmt: skip
    """Velocity at the end of the step if there were no ground.

    Springs and dampers that a scheme takes later in the step are added to the mass matrix, as if
    they were armature; `stiffness` is that of the joints and of the controller.
    """
    force, rate = equations.force, equations.rate
    if equations.programs[FREE] != 0 and scheme not in (LINEARLY_IMPLICIT, MOREAU_JEAN):
        play(
            equations.programs[FREE],
            (model, q, v, torque, equations.bias, equations.factor, force, rate),
        )
        for i in range(model.nv):
            next_v[i] = v[i] + step * rate[i]
    else:
        velocity_by_loops(model, step, scheme, q, v, torque, stiffness, equations, next_v)
    if share_over_step(time, step, pushes):
        for i in range(model.nv):
            rate[i] = 0.0
        add_pushes(model, equations.tree, pushes, rate)
        solve_mass_matrix(model, equations, rate)
        for i in range(model.nv):
            next_v[i] += step * rate[i]


@kernel
def velocity_by_loops(
    model: Model, step: float, scheme: int, q: Floats, v: Floats, torque: Floats,
    stiffness: Floats, equations: Equations, next_v: Floats,
) -> None:  # fmt: skip
    """Velocity at the end of the step without ground or pushes, whatever the scheme and robot."""
    force, rate = equations.force, equations.rate
    passive_force(model, q, v, force)
    for i in range(model.nu):
        force[model.actuator_joint[i]] += torque[i]
    if scheme in (LINEARLY_IMPLICIT, MOREAU_JEAN):
        halved = scheme == MOREAU_JEAN
        ahead = 0.5 * step if halved else step
        springs = model.stiffness if halved else stiffness
        added = 0.0
        for i in range(model.nv):
            force[i] -= ahead * springs[i] * v[i]
            added += equations.added[i]
        if (added > 0.0 or not halved) and equations.programs[SOLVE] != 0:
            weigh(model, equations)  # the program has not heard of it
    for i in range(model.nv):
        rate[i] = step * (force[i] - equations.bias[i])
    solve_mass_matrix(model, equations, rate)
    for i in range(model.nv):
        next_v[i] = v[i] + rate[i]


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
def select_candidates(
    model: Model, curved: bool, rule: Rule, contacts: Contacts, surface: Surface, next_v: Floats,
    called: Integers, tree: Workspace, usual: UsualPoints, bounce: Floats, listing: Listing,
) -> int:  # fmt: skip
    """List the contact points that could act in this step, with their free terms.

    On curved ground a gap is linearised along the chord of the step, as loops are: with half of
    what turning normals add to its rate.
    """
    step, candidate, problem = rule.step, listing.candidate, listing.problem
    linearised = is_linearised(rule.scheme)
    farthest = FAR_STEPS * CLOSING_SPEED * step
    if rule.scheme in (PAPER_EXPLICIT, PAPER_SYMPLECTIC):
        farthest = rule.activation
    near = 0
    for contact in range(model.nc):
        if contacts.gap[contact] <= farthest:
            candidate[near & EVERY_ROW] = contact
            near += 1
    if near == 0:
        return 0
    straight = are_usual(candidate, near, VELOCITIES, usual)
    find_velocities(model, contacts, next_v, straight, tree, usual)
    velocity = usual.point_velocity
    count = 0
    for place in range(near):
        contact = row_of(place, candidate)
        gap = contacts.gap[contact]
        normal = velocity[contact, 0]
        if curved and linearised:
            curvature = surface.curvature[contact]
            normal += 0.5 * step * curvature_acceleration(model, tree, contacts, contact, curvature)
        if linearised:
            far = gap > step * max(CLOSING_SPEED, -2.0 * normal)
            if far and (rule.calls == 0 or called[contact] == 0):
                continue
            normal += gap / step
        elif rule.scheme == MOREAU_JEAN:
            before, _ = contact_velocity(model, tree, contacts, contact)
            if gap + 0.5 * step * before > rule.activation:
                continue
            if rule.relaxed == 0:
                bounce[count] = surface.restitution[contact] * before
                normal += bounce[count]
        row = list_candidate(contact, count, 2, listing)
        problem.free[row] = normal
        problem.free[row + 1] = velocity[contact, 1]
        count += 1
    return count


@dissolved_kernel
def stops_are_near(model: Model, step: float, q: Floats, v: Floats) -> bool:
    """Whether any joint stop could act in a step that bounds the gap at its end."""
    near: Any = 0
    for joint in range(model.nv):  # by signs, so that several are found at once
        reach = step * max(CLOSING_RATE, 2.0 * abs(v[joint]))
        near |= np.float64(q[joint] - model.lower[joint] - reach).view(np.int64)
        near |= np.float64(model.upper[joint] - q[joint] - reach).view(np.int64)
    return near < 0


@dissolved_kernel
def select_stops(
    model: Model, rule: Rule, count: int, q: Floats, v: Floats, next_v: Floats, called: Integers,
    rows: Rows, listing: Listing,
) -> int:  # fmt: skip
    """Append the joint stops that could act in this step: contacts without friction."""
    step, linearised = rule.step, is_linearised(rule.scheme)
    if linearised and rule.calls == 0 and not stops_are_near(model, step, q, next_v):
        return count
    locate_stops(q, rows)
    for stop in range(rows.first[STOP], rows.end[STOP]):
        joint, side, gap = rows.owner[stop], rows.side[stop], rows.gap[stop]
        normal = side * next_v[joint]
        if linearised:
            far = not gap < step * max(CLOSING_RATE, -2.0 * normal)
            if far and (rule.calls == 0 or called[stop] == 0):
                continue
            normal += gap / step
        elif rule.scheme == MOREAU_JEAN:
            if not gap + 0.5 * step * side * v[joint] <= rule.activation:
                continue
        elif not gap <= rule.activation:
            continue
        listing.problem.free[list_candidate(stop, count, 1, listing)] = normal
        count += 1
    return count


@kernel
def select_corners(
    model: Model, rule: Rule, count: int, first: int, v: Floats, next_v: Floats, tree: Workspace,
    second_faces: Contacts, gaps: Floats, restitution: Floats, directions: Directions,
    bounce: Floats, listing: Listing,
) -> int:  # fmt: skip
    """Append the second faces of corners that could act in this step.

    They are the entries of the table from `first` on.
    """
    step, problem, jacobian = rule.step, listing.problem, directions.jacobian
    for point in range(model.nc):
        second = first + point
        gap = gaps[second]
        if gap > FAR_STEPS * CLOSING_SPEED * step:
            continue
        contact_rows(model, tree, second_faces, point, count, problem.first, directions)
        row = problem.first[count]
        normal = row_product(jacobian, row, next_v)
        if is_linearised(rule.scheme):
            if gap > step * max(CLOSING_SPEED, -2.0 * normal):
                continue
            normal += gap / step
        elif rule.scheme == MOREAU_JEAN:
            before = row_product(jacobian, row, v)
            if gap + 0.5 * step * before > rule.activation:
                continue
            if rule.relaxed == 0:
                bounce[count] = restitution[second] * before
                normal += bounce[count]
        elif gap > rule.activation:
            continue
        row = list_candidate(second, count, 2, listing)
        problem.free[row] = normal
        problem.free[row + 1] = row_product(jacobian, row + 1, next_v)
        count += 1
    return count


@kernel
def select_constraints(
    count: int, rule: Rule, v: Floats, next_v: Floats, restitution: Floats, called: Integers,
    rows: Rows, bounce: Floats, listing: Listing,
) -> int:  # fmt: skip
    """Append the constraints from outside that could act in this step, and may let go.

    As with loops, half of what turning rows add to a rate is in the free term: to second order that
    is the chord of the step.
    """
    problem, step, outside = listing.problem, rule.step, rows.outside
    for entry in range(rows.first[CONSTRAINT], rows.end[CONSTRAINT]):
        own = rows.owner[entry]
        normal = rate_of(own, 0, next_v, outside)
        if rows.set[entry] == INTERVAL:
            row = list_candidate(entry, count, 2, listing)
            problem.free[row + 1] = normal
            problem.bound[count] = step * rows.limit[entry]
            count += 1
            continue
        gap = outside.gap[own, 0]
        if is_linearised(rule.scheme):
            normal += 0.5 * step * outside.bias[own, 0]
            far = gap > step * max(CLOSING_SPEED, -2.0 * normal)
            if far and (rule.calls == 0 or called[entry] == 0):
                continue
            normal += gap / step
        elif rule.scheme == MOREAU_JEAN:
            before = rate_of(own, 0, v, outside)
            if gap + 0.5 * step * before > rule.activation:
                continue
            if rule.relaxed == 0:
                bounce[count] = restitution[entry] * before
                normal += bounce[count]
        elif gap > rule.activation:
            continue
        row = list_candidate(entry, count, rows.components[entry], listing)
        problem.free[row] = normal
        if rows.components[entry] == 2:
            problem.free[row + 1] = rate_of(own, 1, next_v, outside)
        count += 1
    return count


@dissolved_kernel
def last_row(place: int, first: Integers) -> int:
    """Last row of a candidate: of a stop the only one, of a dry joint the one that rubs."""
    return int(first[place + 1] - 1)


@dissolved_kernel
def pick_points(near: int, candidate: Integers, usual: UsualPoints, delassus: Floats) -> None:
    """Copy what belongs to the candidates from the Delassus matrix of all usual points."""
    usual_place, whole = usual.usual_place, usual.usual_problem.delassus
    for place in range(near):
        row = 2 * row_of(candidate[place], usual_place)
        for other in range(near):
            column = 2 * row_of(candidate[other], usual_place)
            for i in range(2):
                for j in range(2):
                    delassus[2 * place + i, 2 * other + j] = whole[row + i, column + j]


@dissolved_kernel
def couple(
    near: int, joints: int, place: int, candidate: Integers, first: Integers, owner: Integers,
    side: Floats, loop_jacobian: Floats, point_velocity: Floats, change: Floats, delassus: Floats,
) -> None:  # fmt: skip
    """Write the entries of the Delassus matrix of a stop, a dry joint or a loop at a place.

    A unit impulse along its row changes the velocities of the coordinates by `change`, those of the
    points by `point_velocity`. Of the candidates the points come first, `near` of them, and the
    loops last, after `joints`. The other row of a dry joint is the solvers'.
    """
    row = last_row(place, first)
    for other in range(near):
        for i in range(2):
            entry = point_velocity[candidate[other], i]
            delassus[row, 2 * other + i] = entry
            delassus[2 * other + i, row] = entry
    for other in range(near, place + 1):
        column = last_row(other, first)
        if other < joints:
            joint = candidate[other]
            entry = side[joint] * change[owner[joint]]
        else:
            entry = row_product(loop_jacobian, other - joints, change)
        delassus[row, column] = entry
        delassus[column, row] = entry


@dissolved_kernel
def push_candidates(
    model: Model, near: int, count: int, contacts: Contacts, points: Integers,
    candidate: Integers, first: Integers, impulse: Floats, jacobian: Floats, equations: Equations,
    point_impulse: Floats, v: Floats,
) -> None:  # fmt: skip
    """Add what the impulses of the candidates do to a velocity, after `pick_points`.

    The rows of the Jacobian are A⁻¹ Jᵀ but for those of points, whose impulses the program takes.
    """
    for contact in range(model.nc):
        for k in range(2):
            point_impulse[contact, k] = 0.0
    for place in range(near):
        contact = row_of(place, candidate)
        for k in range(2):
            point_impulse[contact, k] = impulse[2 * place + k]
    if near > 0:
        play(
            equations.programs[PUSH],
            (
                model, points, contacts, equations.factor, point_impulse, equations.tree,
                equations.rate, v,
            ),
        )  # fmt: skip
    for place in range(near, count):
        row = last_row(place, first)
        for j in range(model.nv):
            v[j] += impulse[row] * jacobian[row, j]


@kernel
def push_all(
    model: Model, near: int, count: int, straight: bool, contacts: Contacts, points: Integers,
    candidate: Integers, first: Integers, impulse: Floats, directions: Directions,
    equations: Equations, point_impulse: Floats, v: Floats,
) -> None:  # fmt: skip
    """Add what the impulses of the candidates do to a velocity: the points are the first `near`."""
    if straight:
        push_candidates(
            model, near, count, contacts, points, candidate, first, impulse, directions.jacobian,
            equations, point_impulse, v,
        )  # fmt: skip
    else:
        add_impulse(model, first[count], impulse, directions, equations, v)


@dissolved_kernel
def solve_candidates(model: Model, near: int, count: int, work: Stepping, memory: Memory) -> bool:
    """Find the impulses of the candidates and add what they do to the velocity; return success.

    Points are the first `near` of `count`.
    """
    assembly, contacts, rows, loops = memory.assembly, memory.contacts, memory.rows, memory.loops
    equations, usual, problem, second_faces = (
        memory.equations, memory.usual, memory.assembly.problem, memory.second_faces,
    )  # fmt: skip
    directions, candidate, first = assembly.directions, assembly.candidate, problem.first
    answer, tree, points = assembly.answer, equations.tree, usual.usual_points
    impact, step, next_v = work.impact, work.step, memory.next_v
    joints = count - rows_of(loops)
    others = are_there(SECOND_FACE, assembly) or are_there(CONSTRAINT, assembly)
    straight = not others and are_usual(candidate, near, DELASSUS, usual)
    if straight:
        all_points = near == points.shape[0]  # they are listed in the same order
        if near > 0:
            play(
                usual.programs[DELASSUS],
                (
                    model, points, tree, contacts, equations.factor, usual.point_rows,
                    usual.usual_problem.delassus,
                ),
            )  # fmt: skip
        if all_points and first[count] <= usual.usual_problem.delassus.shape[0]:
            problem = usual.usual_problem
        else:
            if first[count] <= PROGRAM_ROWS:
                problem = memory.small_problem
            pick_points(near, candidate, usual, problem.delassus)
        delassus = problem.delassus
        for place in range(near, count):  # the rows of loops are there
            row = last_row(place, first)
            change = directions.jacobian[row]
            if place < joints:
                write_unit(rows.owner[candidate[place]], rows.side[candidate[place]], change)
            solve_mass_matrix(model, equations, change)
            if near > 0:
                find_velocities(model, contacts, change, True, tree, usual)
            couple(
                near, joints, place, candidate, first, rows.owner, rows.side, loops.rows.jacobian,
                usual.point_velocity, change, delassus,
            )  # fmt: skip
    else:
        write_contact_rows(POINT, model, tree, contacts, rows.owner, assembly)
        write_joint_rows(rows, assembly)
        write_contact_rows(SECOND_FACE, model, tree, second_faces, rows.owner, assembly)
        assemble_delassus(model, count, equations, directions, problem)
    problem.count = assembly.problem.count = count
    if work.scheme == MOREAU_JEAN:
        status = solve_restitution(work.order, problem, memory.solver, impact, answer)
    else:
        status = solve_contact_kernel(work.order, problem, memory.solver, answer)
    solved = status == SOLVED
    resolves = solved and work.scheme == IMPACT_RESOLVED
    gap, before = rows.gap, memory.tally.steps - 1
    if resolves and falls_into(step, before, gap, impact.touching, problem, assembly):
        impact.happens = 1
        arriving = impact.arriving
        for j in range(model.nv):
            arriving[j] = next_v[j]
        push_all(
            model, near, count, straight, contacts, points, candidate, first, answer.impulse,
            directions, equations, usual.point_impulse, arriving,
        )  # fmt: skip
        if impact.relaxed == 1:
            push_out(
                model, near, count, straight, step, work.order, gap, contacts, points, problem,
                equations, memory.solver, usual.point_impulse, assembly, impact,
            )  # fmt: skip
        members = find_members(step, before, gap, impact.touching, problem, assembly, impact.member)
        for place in range(members):
            entry = candidate[impact.member[place]]
            restitution = memory.surface.restitution[entry]
            impact.bounce[place] = 0.0
            if impact.relaxed == 0 and restitution > 0.0:
                impact.bounce[place] = restitution * speed_before(
                    model, entry, memory.v, rows, tree, contacts, second_faces
                )
        posed = problem
        if members < count:
            leave_others_out(members, problem, impact)
            posed = impact.problem
        pose_impact(step, candidate, gap, answer.mode, impact, posed)
        solved = solve_impact(work.order, problem, posed, memory.solver, impact, assembly)
    push_all(
        model, near, count, straight, contacts, points, candidate, first, answer.impulse,
        directions, equations, usual.point_impulse, next_v,
    )  # fmt: skip
    return solved


@dissolved_kernel
def write_unit(joint: int, sign: float, row: Floats) -> None:
    """Write the row of a Jacobian that is the velocity of a joint, with a sign."""
    for j in range(row.shape[0]):
        row[j] = 0.0
    row[joint] = sign


@rare_kernel
def push_out(
    model: Model, near: int, count: int, straight: bool, step: float, order: Integers, gap: Floats,
    contacts: Contacts, points: Integers, problem: ContactProblem, equations: Equations,
    solver: ContactWorkspace, point_impulse: Floats, assembly: Assembly, impact: Impact,
) -> None:  # fmt: skip
    """Let the positions of a wedge come out of the ground, where a way without friction leads."""
    answer, its, candidate = assembly.answer, impact.answer, assembly.candidate
    pose_way_out(step, candidate, gap, answer.velocity, problem, impact)
    if solve_contact_kernel(order, impact.problem, solver, its) == SOLVED:
        for row in range(problem.first[count]):
            answer.impulse[row] = its.impulse[row]
        push_all(
            model, near, count, straight, contacts, points, candidate, assembly.problem.first,
            answer.impulse, assembly.directions, equations, point_impulse, impact.arriving,
        )  # fmt: skip


@dissolved_kernel
def may_go_through(
    model: Model, step: float, near: int, count: int, strikes: bool, outside: bool, v: Floats,
    gaps: Floats, assembly: Assembly, usual: UsualPoints,
) -> bool:  # fmt: skip
    """Whether the velocity that was found could take something through a stop or the ground.

    What is no candidate is too far away to get there at its free velocity: it has to be thrown. A
    stop has to be reached faster than any that is out of reach can be. `strikes` tells whether an
    impact falls into the step, `outside` whether there are constraints from outside.
    """
    if count == 0:
        return False
    if not stay_below(CLOSING_RATE_BITS, v) or outside:
        return True
    known = near == count and not strikes
    for contact in range(model.nc):
        gap = gaps[contact]
        if step * CLOSING_SPEED < gap <= step * CLOSING_SPEED * FAR_STEPS and not (
            known and stays_above(step, contact, gap, near, assembly, usual)
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


@rare_kernel
def call_points(
    model: Model, step: float, v: Floats, contacts: Contacts, tree: Workspace, usual: UsualPoints,
    calls: Calls,
) -> None:  # fmt: skip
    """Call the contact points that would go through at the velocity that was found."""
    straight = are_usual(usual.every_point, model.nc, VELOCITIES, usual)
    find_velocities(model, contacts, v, straight, tree, usual)
    for contact in range(model.nc):
        if contacts.gap[contact] + step * usual.point_velocity[contact, 0] < -CLOSED_GAP:
            call(contact, calls)


@rare_kernel
def call_joints(step: float, q: Floats, v: Floats, rows: Rows, calls: Calls) -> None:
    """Call the stops and the constraints from outside that would go through at that velocity."""
    for stop in range(rows.first[STOP], rows.end[STOP]):
        joint, side = rows.owner[stop], rows.side[stop]
        if side * (q[joint] + step * v[joint]) < side * rows.limit[stop] - CLOSED_GAP:
            call(stop, calls)
    for entry in range(rows.first[CONSTRAINT], rows.end[CONSTRAINT]):
        own = rows.owner[entry]
        ahead = rows.outside.gap[own, 0] + step * rate_of(own, 0, v, rows.outside)
        if rows.set[entry] != INTERVAL and ahead < -far_beyond(step, own, rows.outside):
            call(entry, calls)


@dissolved_kernel
def solve_step(model: Model, curved: bool, time: float, work: Stepping, memory: Memory) -> bool:
    """Find the velocity at the end of the step; return success.

    What an impulse elsewhere throws against the ground or a stop, though it was too far away to be
    a candidate, is called and the step solved again. So it is where nothing pushes all candidates
    out of where they are already, or lets them bounce; they are left there, then, and in a wedge
    that lasts at once.
    """
    step, scheme, impact, calls = work.step, work.scheme, work.impact, work.impact.calls
    assembly, rows, surface, loops = memory.assembly, memory.rows, memory.surface, memory.loops
    q, v, next_v, contacts = memory.q, memory.v, memory.next_v, memory.contacts
    equations, usual, steps = memory.equations, memory.usual, memory.tally.steps
    gap, restitution, tree, called = rows.gap, surface.restitution, equations.tree, calls.called
    outside, linearised = rows.outside.kernel.shape[0] > 0, is_linearised(scheme)
    listing = Listing(
        rows.set, surface.friction, memory.reaction.mode, assembly.candidate, assembly.answer.mode,
        assembly.problem,
    )  # fmt: skip
    again = True
    solved = True
    near = count = 0
    impact.relaxed = int(stays_wedged(steps, impact))
    at_once = impact.relaxed == 1
    while again:
        free_velocity(
            model, step, scheme, time, q, v, memory.torque, memory.stiffness, memory.pushes,
            equations, next_v,
        )  # fmt: skip
        impact.happens = impact.gains = 0
        for place in range(impact.bounce.shape[0] if scheme == MOREAU_JEAN else 0):
            impact.bounce[place] = 0.0
        for i in range(3):
            assembly.answer.residual[i] = 0.0
        rule = Rule(step, scheme, work.activation, calls.count, impact.relaxed)
        near = select_candidates(
            model, curved, rule, contacts, surface, next_v, called, tree, usual, impact.bounce,
            listing,
        )  # fmt: skip
        note_group(POINT, 0, near, assembly)
        count = select_stops(model, rule, near, q, v, next_v, called, rows, listing)
        count = hold_latched(model, count, next_v, rows.latch_stop, loops.held, listing)
        first = note_group(STOP, near, count, assembly)
        if outside:
            count = select_constraints(
                count, rule, v, next_v, restitution, called, rows, impact.bounce, listing
            )
        first = note_group(CONSTRAINT, first, count, assembly)
        count = list_dry_joints(count, step, next_v, memory.breakaway, rows, listing)
        first = note_group(DRY_JOINT, first, count, assembly)
        if impact.corner.near > 0:
            count = select_corners(
                model, rule, count, rows.first[SECOND_FACE], v, next_v, tree, memory.second_faces,
                gap, restitution, assembly.directions, impact.bounce, listing,
            )  # fmt: skip
        first = note_group(SECOND_FACE, first, count, assembly)
        count = append_loops(count, loops, assembly)
        note_group(LOOP, first, count, assembly)
        free_loops(count, loops, next_v, 0.5 * step, assembly)
        if at_once:
            deepest, bounces = left_alone(count, assembly.candidate, gap, restitution)
            if deepest == 0.0 and not bounces:  # the wedge is over
                impact.relaxed = 0
        if impact.relaxed == 1 and linearised:
            close_gaps(step, count, gap, assembly)
        if count > 0:
            solved = solve_candidates(model, near, count, work, memory)
        moved = impact.arriving if impact.happens == 1 else next_v
        if not solved:
            deepest, bounces = left_alone(count, assembly.candidate, gap, restitution)
            again = relax(linearised, deepest, bounces, steps, impact)
        elif at_once and impact.relaxed == 1 and modes_change(assembly, memory.reaction.mode):
            at_once, impact.relaxed = False, 0
        else:
            again = linearised and may_go_through(
                model, step, near, count, impact.happens == 1, outside, moved, contacts.gap,
                assembly, usual,
            )  # fmt: skip
            if again:
                call_points(model, step, moved, contacts, tree, usual, calls)
                call_joints(step, q, moved, rows, calls)
                again = calls.count > rule.calls
    if calls.count > 0:
        dismiss(calls)
    if scheme == IMPACT_RESOLVED:
        note_touching(step, count, steps, assembly, impact.touching)
    note_answer(step, memory)
    if are_there(SECOND_FACE, assembly):
        join_forces(model, memory.second_faces, contacts)
    return solved


@dissolved_kernel
def decide(
    scene: Scene, control: Control, memory: Memory, work: Stepping, record: Record, clock: Clock
) -> int:
    """Find the velocity at the end of the step, and note what happens in it."""
    model = scene.model
    solved = solve_step(model, scene.ground.curved == 1, clock.time, work, memory)
    note_extremes(memory.contacts.gap, memory.assembly.answer.residual, memory.tally)
    if work.impact.relaxed == 1:
        memory.solver.tally.relaxed += 1
        if note_wedge(memory.tally.steps, work.impact):
            log_event(clock.time, WEDGED, deepest_point(memory.contacts.gap), 0.0, 0.0, record.told)
    first = record.told.events
    end = clock.start + (clock.index + 1) * work.step
    note_events(
        model, clock.time, end, work.step, memory.tally.steps, memory.q, memory.v, memory.next_v,
        memory.breakaway, memory.equations.tree, memory.contacts, memory.reaction,
        memory.loops.constraint_force, memory.rows, record.told, memory.reported,
    )  # fmt: skip
    react(model, first, memory.q, record.told, memory.loops.held)
    share_friction(
        model, memory.breakaway, memory.reaction.friction_torque, memory.loops.brake_force
    )
    force, braked = memory.loops.brake_force, memory.loops.braked
    note_brakes(model, clock.time, work.step, force, record.told, braked)
    if work.impact.gains == 1:
        force = memory.contacts.force
        note_event(end, ENERGY_GAIN, hardest_point(force), work.step, force, record.told)
        memory.tally.energy_gain += work.impact.gain
    return DONE if solved else SOLVER_FAILED


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
    copy_words(next_v, v)
    has_loops = rows_of(memory.loops) > 0
    if has_loops and not close_loops(model, memory.equations, memory.loops, q):
        return DIVERGED
    clock.time = clock.start + (clock.index + 1) * work.step
    return DONE


SEVEN_LINKS = {"nl": 9, "nj": 9, "nq": 9, "nv": 9, "nu": 6, "nc": 4}
"""Extents of a biped of seven links that stands on heels and toes, as most are.

Most loops of a step are as short as these: where they end costs as much as what they do.
"""

TimeStepping.work = Stepping
TimeStepping.usual_numbers = {"scheme": IMPACT_RESOLVED}
TimeStepping.usual_extents = SEVEN_LINKS
TimeStepping.kernels = Kernels(None, prepare, decide, None, move)
