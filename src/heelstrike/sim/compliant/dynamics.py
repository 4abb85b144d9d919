"""One step of the compliant ground's equations of motion, linearly implicit in what is stiff.

State: positions q, velocities v and the bends s of the bristles, one a contact point::

    q' = v,   A v' = f,   f = B Γ + passive − H + Jᵀ F(gap, J v, s),   s' = S(F_n, J v, s)

A stage of :mod:`heelstrike.sim.compliant.rosenbrock` linearises what can be stiff in f: contact
forces, joint springs and dampers, and the gains of a controller that acts continuously. With
g = γ h, u_q = g (r_q + u_v) and the bristles, each its own equation, eliminated, a stage is::

    (A − g ∂f/∂v − g² ∂f/∂q) u_v = g A r_v + g² ∂f/∂q r_q + g Jᵀ ∂F/∂s (…)

which stays well conditioned however stiff the ground. Loops are exact here as elsewhere: their
forces λ keep ``J v̇ + J̇ v`` at zero in every evaluation, and in a stage, whose equations gain Jᵀ μ,
``J u_v = g J r_v`` (so that W is the Jacobian of what the loops let through); at the end of a step
the state is put back on them. A controller's gains matter as much as the
ground's stiffness: computed torque on a foot that is not quite flat damps the light foot with the
inertia of the whole robot.
"""

from __future__ import annotations

from math import sqrt
from typing import Any, NamedTuple

import numpy as np

from heelstrike.compiler.bundle import Bundle, array, cell, number, part
from heelstrike.compiler.bundle_type import address_of
from heelstrike.compiler.compilation import kernel
from heelstrike.compiler.separate_kernel import call_at
from heelstrike.compiler.words import copy_words
from heelstrike.dynamics.dense import solve_to_rank, substitute, triangulate
from heelstrike.dynamics.kernels import (
    bias_force,
    factorize,
    forward_kinematics,
    link_velocities,
    mass_matrix,
    passive_force,
    solve_factorized,
)
from heelstrike.dynamics.workspace import Workspace
from heelstrike.robot.model import Floats, Integers, Model
from heelstrike.robot.robot import Robot
from heelstrike.sim.compliant.corners import (
    Corners,
    allocate_corners,
    observe_sides,
    show_forces,
)
from heelstrike.sim.compliant.law import FrictionForces, NormalForces
from heelstrike.sim.compliant.rosenbrock import GAMMA, STAGES, TIMES, A, C, E, M
from heelstrike.sim.contacts.candidates import find_constraints
from heelstrike.sim.contacts.constraint import is_line
from heelstrike.sim.contacts.geometry import contact_rows, row_product, weigh
from heelstrike.sim.contacts.loops import find_loops, push_loops, respond, rows_of, speed_along
from heelstrike.sim.contacts.rows import CONSTRAINT, DRY_JOINT, Rows, most_rows
from heelstrike.sim.contacts.writers import rate_of
from heelstrike.sim.controller.asking import ask, consult
from heelstrike.sim.controller.control import Control
from heelstrike.sim.controller.guard import guarded
from heelstrike.sim.controller.interface import Contacts
from heelstrike.sim.controller.motors import motor_damping, try_torque
from heelstrike.sim.frame import Scene
from heelstrike.sim.memory import Directions, Equations, Loops, Memory, Tally
from heelstrike.sim.push import add_pushes

# Perturbation of a position (m, rad) or velocity (m/s, rad/s) that finds a controller's gains.
# They only steer the linear systems: their error costs steps, not accuracy.
PERTURBATION = 1e-6
# A torque that changes so much (of itself, and N m) is asked for again nearer by: as far away as
# this part of the perturbation it is a jump if it changes by more than half of that, and no gain.
STEEP, NEARER = 1e-2, 0.1

# Steps for which the gains of a controller are taken to last, as long as none fails.
GAINS_LAST = 20

# In steps shorter than this (s), which only a controller that changes its mind can bring about, it
# is taken at its word wherever it is asked: it decides once, not to and fro.
DECISIVE = 1e-8

# How a controller that acts continuously is called when a state is evaluated.
HELD = 0
TRIED = 1
DECIDED = 2
ACCEPTED = 3

# A bristle bent less than this (m) is straight.
NO_BEND = 1e-30


class Laws(Bundle):
    """The contact laws as the kernels see them."""

    normal: Bundle = part(Bundle, address=True)
    friction: Bundle = part(Bundle, address=True)
    stop: Bundle = part(Bundle, address=True)
    """normal, friction, stop: Their numbers."""
    normal_code: int = number(int)
    friction_code: int = number(int)
    stop_code: int = number(int)
    """normal_code, friction_code, stop_code: Where their machine code is."""
    joint_speed: float = number(float)
    """Speed around which dry friction of the joints is smoothed (rad/s, m/s)."""


class Rates(Bundle):
    """What acts at a state, and how fast the state changes."""

    acceleration: Floats = array("nv")
    """Rate of v."""
    normal: NormalForces = part(NormalForces)
    friction: FrictionForces = part(FrictionForces)
    stop: NormalForces = part(NormalForces)
    """normal, friction, stop: Of contacts and joint stops; the bends of the bristles with their
    rates."""
    stop_force: Floats = array("nv")
    """Forces of the joint stops, with their signs."""
    dry_force: Floats = array("nv")
    dry_by_speed: Floats = array("nv")
    """dry_force, dry_by_speed: Dry friction in the joints, and its derivative."""
    loop: Floats = array("loop_rows")
    """Forces of the loops along their rows."""
    own: NormalForces = part(NormalForces)
    """Of the constraints from outside that may let go."""


class Start(Bundle):
    """Where a step of the integration begins, and its equations there."""

    force: Floats = array("2 nc", "components")
    """Contact forces, in newtons: of the points, then of their second faces."""
    q: Floats = array("nv")
    v: Floats = array("nv")
    rows: Floats = array("4 nc", "nv")
    matrix: Floats = array("nv", "nv")
    """q, v, rows, matrix: State, contact Jacobian and A."""
    own_rows: Floats = array("own", "nv")
    loop_rows: Floats = array("loop_rows", "nv")
    """own_rows, loop_rows: Jacobian of the constraints from outside that may let go, and that of
    the loops."""


class Evaluated(NamedTuple):
    """The same of the state evaluated last, where its kernels wrote it, and the words of its rates.

    Attributes
    ----------
    force, q, v, rows, matrix, own_rows, loop_rows
        As of :class:`Start`.
    words : (words,) int64
        The memory of its :class:`Rates`.
    """

    force: Floats
    q: Floats
    v: Floats
    rows: Floats
    matrix: Floats
    own_rows: Floats
    loop_rows: Floats
    words: Integers


class Gains(Bundle):
    """Derivatives of the controller's torques, and how they are found."""

    by_q: Floats = array("nu", "nv")
    by_v: Floats = array("nu", "nv")
    command: Floats = array("nu")
    torque: Floats = array("nu")
    """command, torque: Commands and torques of a perturbed state."""
    age: int = cell(int)
    """Steps since these were found."""


class Stages(Bundle):
    """The linear system of the stages of a step, and the stages u_i."""

    force_by_q: Floats = array("nv", "nv")
    """∂f/∂q of a step, bristles eliminated."""
    system: Floats = array("nv", "nv")
    """A − g ∂f/∂v − g² ∂f/∂q, then its triangular factors."""
    order: Integers = array("nv", of=int)
    """Row exchanges of the factors."""
    loop_response: Floats = array("loop_rows", "nv")
    loop_matrix: Floats = array("loop_rows", "loop_rows")
    """loop_response, loop_matrix: What the system makes of the rows of the loops, and the products
    of both."""
    q: Floats = array("stages", "nv")
    v: Floats = array("stages", "nv")
    bristle: Floats = array("stages", "2 nc")
    """q, v, bristle: The stages."""
    right_q: Floats = array("nv")
    right_v: Floats = array("nv")
    right_bristle: Floats = array("2 nc")
    """right_q, right_v, right_bristle: Right-hand side of a stage."""


class Sums(Bundle):
    """What has come together since the last sample."""

    contact: Floats = array("2 nc", "components")
    stop: Floats = array("nv")
    dry: Floats = array("nv")
    loop: Floats = array("loop_rows")
    own: Floats = array("own")
    """contact, stop, dry, loop, own: Impulses of contacts, joint stops, dry friction, loops and
    constraints from outside, in N s (N m s)."""
    place: Floats = array("nc", "axes")
    """Where the resultants of both faces acted."""
    touched: Floats = array("nc")
    left: Floats = array("nc")
    """touched, left: When a contact point last came to the ground and left it; negative if it did
    not."""


class Holding(Bundle):
    """When torques of a law that switches are held."""

    patience: int = cell(int)
    """Tries of the steps of a sample after which they are."""
    since: float = cell(float)
    span: float = cell(float)
    wrong: float = cell(float)
    """since, span, wrong: When that began within the sample (s), for how long in all (s), and the
    most that the torques' next jump would have changed an acceleration by, times how long they were
    held (m/s, rad/s)."""


class CompliantWorkspace(Bundle):
    """State of the bristles and the scratch of a step."""

    now: Rates = part(Rates)
    base: Rates = part(Rates)
    """now, base: At the state evaluated last, and at the start of the step."""
    force: Floats = array("2 nc", "components")
    """Contact forces at the state evaluated last, in newtons: of the points, then of their second
    faces."""
    now_rows: Floats = array("own", "nv")
    """Jacobian of the constraints from outside that may let go, there."""
    now_words: Integers = array("words", of=int, address=True)
    base_words: Integers = array("words", of=int, address=True)
    """now_words, base_words: The memory of both."""
    corners: Corners = part(Corners)
    """Which points are in concave corners."""
    start: Start = part(Start)
    stages: Stages = part(Stages)
    gains: Gains = part(Gains)
    sums: Sums = part(Sums)
    holding: Holding = part(Holding)
    laws: Laws = part(Laws)
    step: float = number(float)
    rtol: float = number(float)
    atol: float = number(float)
    """step, rtol, atol: Seconds between two samples; tolerated errors of a step, relative and
    absolute."""
    proposed: float = cell(float)
    """Length of the next step as far as accuracy allows (s)."""


def compliant_workspace(
    robot: Robot, laws: Laws, step: float, rtol: float, atol: float
) -> CompliantWorkspace:
    """Allocate the scratch for a robot."""
    let_go = sum(not is_line(each) for each in robot.constraints)
    extents = {
        "nv": robot.nv, "nu": robot.nu, "nc": robot.nc, "components": 2, "axes": 2,
        "stages": STAGES, "loop_rows": most_rows(robot), "own": let_go,
    }  # fmt: skip
    rates = Rates.allocate(
        extents,
        normal=NormalForces.allocate(n=2 * robot.nc),
        friction=FrictionForces.allocate(nc=2 * robot.nc),
        stop=NormalForces.allocate(n=robot.nv),
        own=NormalForces.allocate(n=let_go),
    )
    now, now_words = in_one_block(rates)
    base, base_words = in_one_block(rates)
    gains = Gains.allocate(extents, command=guarded(np.zeros(robot.nu)), age=GAINS_LAST)
    return CompliantWorkspace.allocate(
        extents, now=now, base=base, now_words=now_words, base_words=base_words, gains=gains,
        laws=laws, step=step, rtol=rtol, atol=atol, proposed=step, corners=allocate_corners(robot),
    )  # fmt: skip


def in_one_block(rates: Rates) -> tuple[Rates, Integers]:
    """Copy the arrays into one block of words, to be copied at once; return both."""
    sizes = [array.size for _, array in rates.storage()]
    words = np.zeros(sum(sizes), dtype=np.int64)
    places = iter(np.split(words, np.cumsum(sizes)[:-1]))
    copy = rates.stored(lambda _, array: next(places).view(array.dtype).reshape(array.shape))
    return copy, words


@kernel
def try_command(
    controller: Any, control: Control, time: float, model: Model, q: Floats, v: Floats,
    tree: Workspace, contacts: Contacts, tally: Tally, command: Floats, torque: Floats,
) -> None:  # fmt: skip
    """Torques that a controller would ask for, were this its next call; it remembers nothing.

    Kinematics of the state are found on the way.
    """
    forward_kinematics(model, q, tree)
    link_velocities(model, v, tree)
    consult(controller, time, q, v, model, tree, contacts, control, command)
    try_torque(model, control.voltage, q, v, tally, command, torque)


@kernel
def is_steep(gains: Floats, j: int, torque: Floats) -> bool:
    """Whether a torque changes so much with coordinate j that it may have jumped."""
    for i in range(torque.shape[0]):
        if PERTURBATION * abs(gains[i, j]) > STEEP * (1.0 + abs(torque[i])):
            return True
    return False


@kernel
def find_gains(
    controller: Any, control: Control, time: float, model: Model, start: Start, tree: Workspace,
    contacts: Contacts, tally: Tally, q: Floats, v: Floats, command: Floats, torque: Floats,
    gains: Gains,
) -> None:  # fmt: skip
    """Derivatives of the controller's torques at the start of the step, by differences.

    The smaller of the differences to either side: where the torque jumps, as when a controller
    changes its mind, the other would be the jump over the perturbation. Where it jumps to both
    sides, as ``sign`` at zero, it has no gain.
    """
    tried, answer = gains.command, gains.torque
    for j in range(model.parent.shape[0]):
        q[j] = start.q[j]
        v[j] = start.v[j]
    try_command(controller, control, time, model, q, v, tree, contacts, tally, command, torque)
    for kind in range(2):
        varied = q if kind == 0 else v
        found = gains.by_q if kind == 0 else gains.by_v
        for j in range(model.parent.shape[0]):
            kept = varied[j]
            for side in range(2):
                change = PERTURBATION if side == 0 else -PERTURBATION
                varied[j] = kept + change
                try_command(
                    controller, control, time, model, q, v, tree, contacts, tally, tried, answer
                )
                for i in range(found.shape[0]):
                    slope = (answer[i] - torque[i]) / change
                    if side == 0 or abs(slope) < abs(found[i, j]):
                        found[i, j] = slope
            if is_steep(found, j, torque):
                varied[j] = kept + NEARER * PERTURBATION
                try_command(
                    controller, control, time, model, q, v, tree, contacts, tally, tried, answer
                )
                for i in range(found.shape[0]):
                    if abs(answer[i] - torque[i]) > 0.5 * PERTURBATION * abs(found[i, j]):
                        found[i, j] = 0.0
            varied[j] = kept
    gains.age = 0


@kernel
def evaluate(
    scene: Scene, how: int, time: float, control: Control, memory: Memory, laws: Laws,
    corners: Corners, now: Rates, own_rows: Floats, force: Floats,
) -> None:  # fmt: skip
    """Forces and rates of the state in ``memory.q``, ``memory.v`` and ``now.friction.bend``.

    A controller that acts continuously is called, unless its torques are ``HELD``: to see what it
    would do (``TRIED``), for good (``DECIDED``), or for good with the contact forces of this very
    state, which is ``ACCEPTED``.
    """
    model, ground, equations, rows = scene.model, scene.ground, memory.equations, memory.rows
    contacts, loops = memory.contacts, memory.loops
    q, v, tree, acting = memory.q, memory.v, equations.tree, equations.force
    directions, first = memory.assembly.directions, memory.assembly.problem.first
    observe_sides(model, ground, q, v, tree, contacts, memory.surface, corners)
    push_contacts(
        model, laws, v, tree, contacts, memory.surface.friction, first, directions, corners,
        now.normal, now.friction, memory.reaction.slip, force,
    )  # fmt: skip
    push_stops(model, laws, q, v, loops.held, now.stop, now.stop_force)
    rub_joints(laws.joint_speed, v, memory.breakaway, rows, now.dry_force, now.dry_by_speed)
    if now.own.gap.shape[0] > 0:
        push_constraints(model, laws, q, v, tree, rows, now.own)
        write_constraint_rows(rows, own_rows)
    command, torque = memory.command, memory.torque
    if control.continuous == 1 and how != HELD:
        if how == ACCEPTED:
            show_forces(force, corners, contacts)
        if how == TRIED:
            consult(scene.controller, time, q, v, model, tree, contacts, control, command)
        else:
            ask(scene.controller, time, q, v, model, tree, contacts, control, command)
    try_torque(model, control.voltage, q, v, memory.tally, command, torque)
    mass_matrix(model, tree, equations.mass_matrix)
    factorize(model, equations.mass_matrix, equations.factor)
    bias_force(model, tree, equations.rate)
    passive_force(model, q, v, acting)
    add_pushes(model, tree, memory.pushes, acting)
    for i in range(model.actuator_joint.shape[0]):
        acting[model.actuator_joint[i]] += torque[i]
    rate, jacobian = now.acceleration, directions.jacobian
    nv = model.parent.shape[0]
    for j in range(nv):
        rate[j] = acting[j] - equations.rate[j] + now.stop_force[j] + now.dry_force[j]
    for contact in range(corners.sides):
        normal = force[contact, 0]
        tangent = force[contact, 1]
        if normal > 0.0:
            for j in range(nv):
                rate[j] += (
                    jacobian[2 * contact, j] * normal + jacobian[2 * contact + 1, j] * tangent
                )
    for own in range(now.own.gap.shape[0]):
        for j in range(nv):
            rate[j] += own_rows[own, j] * now.own.force[own]
    solve_factorized(model, equations.factor, rate)
    if now.loop.shape[0] > 0:
        hold_loops(model, q, v, equations, loops, rate)
        copy_words(loops.unknown, now.loop)


@kernel
def hold_loops(
    model: Model, q: Floats, v: Floats, equations: Equations, loops: Loops, rate: Floats
) -> None:
    """Find the forces of the loops, and the accelerations under them."""
    rows = rows_of(loops)
    find_loops(model, q, v, equations.tree, loops)
    weigh(model, equations)
    respond(rows, model, loops.rows.jacobian, equations, loops.response, loops.system)
    for row in range(rows):
        loops.system[row, rows] = -speed_along(row, loops, rate) - loops.rows.bias[row]
    push_loops(loops, rate)


@kernel
def push_contacts(
    model: Model, laws: Laws, v: Floats, tree: Workspace, contacts: Contacts, frictions: Floats,
    first: Integers, directions: Directions, corners: Corners, normal: NormalForces,
    friction: FrictionForces, slip: Floats, force: Floats,
) -> None:  # fmt: skip
    """Forces of the contacts and rates of the bristles at the state now."""
    jacobian = directions.jacobian
    for contact in range(model.contact_link.shape[0]):
        slip[contact] = 0.0
        normal.gap[contact] = contacts.gap[contact]
        if normal.gap[contact] < 0.0:
            contact_rows(model, tree, contacts, contact, contact, first, directions)
            slip[contact] = row_product(jacobian, 2 * contact + 1, v)
            normal.speed[contact] = row_product(jacobian, 2 * contact, v)
    copy_words(frictions[: model.nc], friction.friction)
    copy_words(slip, friction.speed)
    if corners.doubled > 0:
        meet_second_faces(
            model, v, tree, first, directions, corners, normal.gap, normal.speed,
            friction.friction, friction.speed,
        )  # fmt: skip
    call_at(laws.normal_code, (address_of(laws.normal), normal))
    copy_words(normal.force, friction.normal)
    call_at(laws.friction_code, (address_of(laws.friction), friction))
    for contact in range(corners.sides):
        force[contact, 0] = normal.force[contact]
        force[contact, 1] = friction.force[contact]


@kernel
def meet_second_faces(
    model: Model, v: Floats, tree: Workspace, first: Integers, directions: Directions,
    corners: Corners, gap: Floats, speed: Floats, friction: Floats, slip: Floats,
) -> None:  # fmt: skip
    """Gaps and speeds of the points on their second faces, with their Jacobian rows."""
    seconds, jacobian = corners.contacts, directions.jacobian
    for point in range(corners.doubled):
        contact = corners.other[point]
        gap[contact] = seconds.gap[point]
        friction[contact] = corners.friction[point]
        slip[contact] = 0.0
        if gap[contact] < 0.0:
            contact_rows(model, tree, seconds, point, contact, first, directions)
            speed[contact] = row_product(jacobian, 2 * contact, v)
            slip[contact] = row_product(jacobian, 2 * contact + 1, v)


@kernel
def push_stops(
    model: Model, laws: Laws, q: Floats, v: Floats, held: Integers, stop: NormalForces,
    force: Floats,
) -> None:  # fmt: skip
    """Forces of the joint stops at the state now; `held` tells which latches are engaged."""
    for j in range(model.parent.shape[0]):
        below = q[j] - model.lower[j]
        above = model.upper[j] - q[j]
        stop.gap[j] = below if below < 0.0 else above
        stop.speed[j] = v[j] if below < 0.0 else -v[j]
    for latch in range(held.shape[0]):
        if held[latch] == 1:
            pull_back(model, latch, q, v, stop)
    call_at(laws.stop_code, (address_of(laws.stop), stop))
    for j in range(model.parent.shape[0]):
        force[j] = stop.force[j] if q[j] < model.lower[j] else -stop.force[j]
    for latch in range(held.shape[0]):
        j = model.latch_joint[latch]
        if held[latch] == 1 and model.lower[j] <= q[j] <= model.upper[j]:
            force[j] = model.latch_side[latch] * stop.force[j]


@kernel
def push_constraints(
    model: Model, laws: Laws, q: Floats, v: Floats, tree: Workspace, rows: Rows, own: NormalForces
) -> None:
    """Forces of the constraints from outside that may let go: those of stops, from their gaps."""
    find_constraints(model, q, v, tree, rows)
    for i in range(own.gap.shape[0]):
        entry = rows.first[CONSTRAINT] + i
        own.gap[i] = rows.gap[entry]
        own.speed[i] = rate_of(rows.owner[entry], 0, v, rows.outside)
    call_at(laws.stop_code, (address_of(laws.stop), own))


@kernel
def write_constraint_rows(rows: Rows, target: Floats) -> None:
    """Write the rows of the constraints from outside that may let go, one after the other."""
    for i in range(target.shape[0]):
        own = rows.owner[rows.first[CONSTRAINT] + i]
        for j in range(target.shape[1]):
            target[i, j] = rows.outside.jacobian[own, 0, j]


@kernel
def pull_back(model: Model, latch: int, q: Floats, v: Floats, stop: NormalForces) -> None:
    """Ask the law of a stop that holds for its pull: what it would press with, mirrored."""
    j = model.latch_joint[latch]
    if model.lower[j] <= q[j] <= model.upper[j]:
        side = model.latch_side[latch]
        end = model.upper[j] if side > 0 else model.lower[j]
        stop.gap[j] = -abs(end - q[j])
        stop.speed[j] = side * v[j]


@kernel
def rub_joints(
    scale: float, v: Floats, breakaway: Floats, rows: Rows, force: Floats, by_speed: Floats
) -> None:
    """Dry friction of the joints, smoothed around zero speed, and its derivative."""
    for dry in range(rows.first[DRY_JOINT], rows.end[DRY_JOINT]):
        j = rows.owner[dry]
        limit = breakaway[j]
        size = sqrt(v[j] * v[j] + scale * scale)
        force[j] = -limit * v[j] / size
        by_speed[j] = -limit * (scale / size) ** 2 / size


@kernel
def begin_step(sides: int, last: Evaluated, words: Integers, start: Start) -> None:
    """Make the state evaluated last the start of the next step; its rates go to `words`."""
    copy_words(last.words, words)
    copy_words(last.force, start.force)
    copy_words(last.q, start.q)
    copy_words(last.v, start.v)
    copy_words(last.matrix, start.matrix)
    for row in range(2 * sides):
        for j in range(start.rows.shape[1]):
            start.rows[row, j] = last.rows[row, j]
    for row in range(start.loop_rows.shape[0]):
        for j in range(start.loop_rows.shape[1]):
            start.loop_rows[row, j] = last.loop_rows[row, j]
    copy_words(last.own_rows, start.own_rows)


@kernel
def tangent_gains(friction: FrictionForces, contact: int, g: float) -> tuple[float, float, float]:
    """Change of the tangential force by normal force, by speed and by the bristle's residual.

    The bristle's own equation, ``(1/g − ∂S/∂s) u_s = r + ∂S/∂F_n dF_n + ∂S/∂v a``, is eliminated.
    """
    bend = friction.by_bend[contact] / (1.0 / g - friction.rate_by_bend[contact])
    by_normal = friction.by_normal[contact] + bend * friction.rate_by_normal[contact]
    by_speed = friction.by_speed[contact] + bend * friction.rate_by_speed[contact]
    return by_normal, by_speed, bend


@kernel
def factorize_step(
    model: Model, g: float, answers: bool, voltage: int, command: Floats, sides: int, base: Rates,
    start: Start, gains: Gains, stages: Stages,
) -> None:  # fmt: skip
    """Factorise the linear system of all stages of a step of length g / γ.

    `answers` tells whether a controller acts within the step.
    """
    nv = model.parent.shape[0]
    system, by_q = stages.system, stages.force_by_q
    for i in range(nv):
        for j in range(nv):
            system[i, j] = start.matrix[i, j]
            by_q[i, j] = 0.0
        system[i, i] += g * (model.damping[i] - (base.stop.by_speed[i] + base.dry_by_speed[i]))
        by_q[i, i] = base.stop.by_gap[i] - model.stiffness[i]
    for i in range(model.actuator_joint.shape[0]):
        joint = model.actuator_joint[i]
        if answers:
            for j in range(nv):
                system[joint, j] -= g * gains.by_v[i, j]
                by_q[joint, j] += gains.by_q[i, j]
        else:
            system[joint, joint] += g * motor_damping(model, i, voltage, command[i], start.v)
    for contact in range(sides):
        if base.normal.force[contact] <= 0.0:
            continue
        by_normal, by_speed, _ = tangent_gains(base.friction, contact, g)
        normal_row = start.rows[2 * contact]
        tangent_row = start.rows[2 * contact + 1]
        for i in range(nv):
            # What normal force and sliding speed do to coordinate i.
            pressing = normal_row[i] + by_normal * tangent_row[i]
            rubbing = by_speed * tangent_row[i]
            for j in range(nv):
                system[i, j] -= g * (
                    pressing * base.normal.by_speed[contact] * normal_row[j]
                    + rubbing * tangent_row[j]
                )
                by_q[i, j] += pressing * base.normal.by_gap[contact] * normal_row[j]
    for own in range(start.own_rows.shape[0]):
        row = start.own_rows[own]
        for i in range(nv):
            for j in range(nv):
                system[i, j] -= g * row[i] * base.own.by_speed[own] * row[j]
                by_q[i, j] += row[i] * base.own.by_gap[own] * row[j]
    for i in range(nv):
        for j in range(nv):
            system[i, j] -= g * g * by_q[i, j]
    triangulate(nv, nv, False, system, stages.order)
    for row in range(start.loop_rows.shape[0]):
        copy_words(start.loop_rows[row], stages.loop_response[row])
        substitute(nv, system, stages.order, stages.loop_response[row])
        for other in range(start.loop_rows.shape[0]):
            stages.loop_matrix[other, row] = dot(start.loop_rows[other], stages.loop_response[row])


@kernel
def dot(a: Floats, b: Floats) -> float:
    """Scalar product."""
    total = 0.0
    for j in range(b.shape[0]):
        total += a[j] * b[j]
    return total


@kernel
def solve_stage(
    model: Model, g: float, stage: int, sides: int, base: Rates, start: Start, loop_system: Floats,
    loop_order: Integers, loop_force: Floats, stages: Stages,
) -> None:  # fmt: skip
    """Solve for a stage from its right-hand side."""
    nv = model.parent.shape[0]
    u_q, u_v, u_s = stages.q[stage], stages.v[stage], stages.bristle[stage]
    for i in range(nv):
        u_v[i] = g * (
            dot(start.matrix[i], stages.right_v) + g * dot(stages.force_by_q[i], stages.right_q)
        )
    for contact in range(sides):
        if base.normal.force[contact] <= 0.0:
            continue
        _, _, bend = tangent_gains(base.friction, contact, g)
        push = g * bend * stages.right_bristle[contact]
        for j in range(nv):
            u_v[j] += push * start.rows[2 * contact + 1, j]
    substitute(nv, stages.system, stages.order, u_v)
    keep_loops(g, start.loop_rows, stages, loop_system, loop_order, loop_force, u_v)
    for j in range(nv):
        u_q[j] = g * (stages.right_q[j] + u_v[j])
    for contact in range(sides):
        change = stages.right_bristle[contact]
        if base.normal.force[contact] > 0.0:
            normal_row = start.rows[2 * contact]
            pressing = base.normal.by_speed[contact] * dot(normal_row, u_v)
            pressing += base.normal.by_gap[contact] * dot(normal_row, u_q)
            sliding = dot(start.rows[2 * contact + 1], u_v)
            change += base.friction.rate_by_normal[contact] * pressing
            change += base.friction.rate_by_speed[contact] * sliding
        u_s[contact] = change / (1.0 / g - base.friction.rate_by_bend[contact])


@kernel
def keep_loops(
    g: float, loop_rows: Floats, stages: Stages, system: Floats, order: Integers, force: Floats,
    u_v: Floats,
) -> None:  # fmt: skip
    """Add to a stage what the loops make of it; their equations, and forces, are scratch."""
    rows = loop_rows.shape[0]
    for row in range(rows):
        for other in range(rows):
            system[row, other] = stages.loop_matrix[row, other]
        along = loop_rows[row]
        system[row, rows] = g * dot(along, stages.right_v) - dot(along, u_v)
    solve_to_rank(rows, system, order, force)
    for row in range(rows):
        for j in range(u_v.shape[0]):
            u_v[j] += force[row] * stages.loop_response[row, j]


@kernel
def attempt_step(
    scene: Scene, time: float, h: float, held: bool, control: Control, memory: Memory,
    work: CompliantWorkspace,
) -> float:  # fmt: skip
    """Go from the start of the step, at `time`, to its end; return the error over the tolerance.

    A controller that acts continuously is asked within it, unless its torques are `held`.
    """
    model, rtol, atol, now, base = scene.model, work.rtol, work.atol, work.now, work.base
    start, stages, loops = work.start, work.stages, memory.loops
    q, v, bend = memory.q, memory.v, now.friction.bend
    how = DECIDED if h <= DECISIVE else TRIED
    if held:
        how = HELD
    nv = model.parent.shape[0]
    nc = work.corners.sides
    g = GAMMA * h
    answers = control.continuous == 1 and not held
    factorize_step(
        model, g, answers, control.voltage, memory.command, nc, base, start, work.gains, stages
    )
    for stage in range(STAGES):
        if stage > 0:
            for i in range(nv):
                q[i] = start.q[i]
                v[i] = start.v[i]
                for k in range(stage):
                    q[i] += A[stage, k] * stages.q[k, i]
                    v[i] += A[stage, k] * stages.v[k, i]
            for i in range(nc):
                bend[i] = base.friction.bend[i]
                for k in range(stage):
                    bend[i] += A[stage, k] * stages.bristle[k, i]
            evaluate(
                scene, how, time + TIMES[stage] * h, control, memory, work.laws, work.corners, now,
                work.now_rows, work.force,
            )  # fmt: skip
        for i in range(nv):
            stages.right_q[i] = start.v[i] if stage == 0 else v[i]
            stages.right_v[i] = base.acceleration[i] if stage == 0 else now.acceleration[i]
            for k in range(stage):
                stages.right_q[i] += C[stage, k] / h * stages.q[k, i]
                stages.right_v[i] += C[stage, k] / h * stages.v[k, i]
        for i in range(nc):
            stages.right_bristle[i] = base.friction.rate[i] if stage == 0 else now.friction.rate[i]
            for k in range(stage):
                stages.right_bristle[i] += C[stage, k] / h * stages.bristle[k, i]
        solve_stage(
            model, g, stage, nc, base, start, loops.system, loops.order, loops.unknown, stages
        )
    worst = 0.0
    for i in range(nv):
        worst = larger(worst, finish(start.q, stages.q, rtol, atol, q, i))
        worst = larger(worst, finish(start.v, stages.v, rtol, atol, v, i))
    for i in range(nc):
        worst = larger(worst, finish(base.friction.bend, stages.bristle, rtol, atol, bend, i))
        # A bristle in the air goes to zero; spare the processor the numbers next to it.
        if abs(bend[i]) < NO_BEND:
            bend[i] = 0.0
    return worst


@kernel
def finish(base: Floats, stages: Floats, rtol: float, atol: float, result: Floats, i: int) -> float:
    """Write one component at the end of the step; return its error over the tolerance."""
    change = 0.0
    error = 0.0
    for k in range(STAGES):
        change += M[k] * stages[k, i]
        error += E[k] * stages[k, i]
    result[i] = base[i] + change
    return abs(error) / (atol + rtol * max(abs(base[i]), abs(result[i])))


@kernel
def larger(a: float, b: float) -> float:
    """Maximum that keeps a NaN, wherever it stands."""
    return b if not b <= a else a
