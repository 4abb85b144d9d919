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
from typing import Any

import numpy as np

from heelstrike.compiler.bundle import Bundle, array, cell, number, part
from heelstrike.compiler.bundle_type import address_of
from heelstrike.compiler.compilation import kernel
from heelstrike.compiler.separate_kernel import call_at
from heelstrike.compiler.words import copy_words
from heelstrike.contact.ground import GroundModel
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
from heelstrike.sim.controller.motors import motor_damping, try_torque
from heelstrike.sim.memory import Loops, Memory
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


class CompliantWorkspace(Bundle):
    """State of the bristles and the scratch of a step."""

    now: Rates = part(Rates)
    base: Rates = part(Rates)
    """now, base: At the state evaluated last, and at the start of the step."""
    force: Floats = array("2 nc", "components")
    """Contact forces at the state evaluated last, in newtons: of the points, then of their second
    faces."""
    base_force: Floats = array("2 nc", "components")
    """The same at the start of the step."""
    corners: Corners = part(Corners)
    """Which points are in concave corners."""
    place: Floats = array("nc", "axes")
    """Where the resultants of both faces acted since the last sample."""
    now_words: Integers = array("words", of=int, address=True)
    base_words: Integers = array("words", of=int, address=True)
    """now_words, base_words: The memory of both."""
    torque_by_q: Floats = array("nu", "nv")
    torque_by_v: Floats = array("nu", "nv")
    """torque_by_q, torque_by_v: Derivatives of the controller's torques."""
    trial_command: Floats = array("nu")
    trial_torque: Floats = array("nu")
    """trial_command, trial_torque: Commands and torques of a perturbed state."""
    age: int = cell(int)
    """Steps since these were found."""
    base_q: Floats = array("nv")
    base_v: Floats = array("nv")
    base_rows: Floats = array("4 nc", "nv")
    base_matrix: Floats = array("nv", "nv")
    """State, contact Jacobian and A at the start of the step."""
    force_by_q: Floats = array("nv", "nv")
    """∂f/∂q of a step, bristles eliminated."""
    system: Floats = array("nv", "nv")
    """A − g ∂f/∂v − g² ∂f/∂q, then its triangular factors."""
    order: Integers = array("nv", of=int)
    """Row exchanges of the factors."""
    now_rows: Floats = array("own", "nv")
    own_rows: Floats = array("own", "nv")
    """now_rows, own_rows: Jacobian of the constraints from outside that may let go, at the state
    evaluated last and at the start of the step."""
    loop_rows: Floats = array("loop_rows", "nv")
    loop_response: Floats = array("loop_rows", "nv")
    loop_matrix: Floats = array("loop_rows", "loop_rows")
    """Jacobian of the loops at the start of the step, what the system makes of its rows, and the
    products of both."""
    stage_q: Floats = array("stages", "nv")
    stage_v: Floats = array("stages", "nv")
    stage_bristle: Floats = array("stages", "2 nc")
    """The stages u_i."""
    right_q: Floats = array("nv")
    right_v: Floats = array("nv")
    right_bristle: Floats = array("2 nc")
    """Right-hand side of a stage."""
    impulse: Floats = array("2 nc", "components")
    stop_impulse: Floats = array("nv")
    dry_impulse: Floats = array("nv")
    loop_impulse: Floats = array("loop_rows")
    own_impulse: Floats = array("own")
    """Impulses of contacts, joint stops, dry friction, loops and constraints from outside since the
    last sample, in N s (N m s)."""
    touched: Floats = array("nc")
    left: Floats = array("nc")
    """touched, left: When a contact point last came to the ground and left it since the last
    sample; negative if it did not."""
    laws: Laws = part(Laws)
    step: float = number(float)
    rtol: float = number(float)
    atol: float = number(float)
    """step, rtol, atol: Seconds between two samples; tolerated errors of a step, relative and
    absolute."""
    proposed: float = cell(float)
    """Length of the next step as far as accuracy allows (s)."""
    patience: int = cell(int)
    """Tries of the steps of a sample after which torques of a law that switches are held."""
    held_since: float = cell(float)
    held_for: float = cell(float)
    held_wrong: float = cell(float)
    """held_since, held_for, held_wrong: When that began within the sample (s), for how long in all
    (s), and the most that the torques' next jump would have changed an acceleration by, times how
    long they were held (m/s, rad/s)."""
    row: int = cell(int)
    """Row of the record for this sample, -1 for none."""


def compliant_workspace(
    robot: Robot, laws: Laws, step: float, rtol: float, atol: float
) -> CompliantWorkspace:
    """Allocate the scratch for a robot."""
    extents = {
        "nv": robot.nv, "nu": robot.nu, "nc": robot.nc, "components": 2, "axes": 2,
        "stages": STAGES, "loop_rows": most_rows(robot),
    }  # fmt: skip
    let_go = sum(not is_line(each) for each in robot.constraints)
    extents["own"] = let_go
    rates = Rates.allocate(
        extents,
        normal=NormalForces.allocate(n=2 * robot.nc),
        friction=FrictionForces.allocate(nc=2 * robot.nc),
        stop=NormalForces.allocate(n=robot.nv),
        own=NormalForces.allocate(n=let_go),
    )
    now, now_words = in_one_block(rates)
    base, base_words = in_one_block(rates)
    return CompliantWorkspace.allocate(
        extents, now=now, base=base, now_words=now_words, base_words=base_words,
        trial_command=guarded(np.zeros(robot.nu)), age=GAINS_LAST, laws=laws, step=step, rtol=rtol,
        atol=atol, proposed=step, corners=allocate_corners(robot),
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
    controller: Any, control: Control, time: float, model: Model, memory: Memory, command: Floats,
    torque: Floats,
) -> None:  # fmt: skip
    """Torques that a controller would ask for, were this its next call; it remembers nothing."""
    consult(controller, time, memory.q, memory.v, model, memory, control, command)
    try_torque(model, control, memory.q, memory.v, memory.tally, command, torque)


@kernel
def is_steep(gains: Floats, j: int, torque: Floats) -> bool:
    """Whether a torque changes so much with coordinate j that it may have jumped."""
    for i in range(torque.shape[0]):
        if PERTURBATION * abs(gains[i, j]) > STEEP * (1.0 + abs(torque[i])):
            return True
    return False


@kernel
def find_gains(
    controller: Any, control: Control, time: float, model: Model, memory: Memory,
    work: CompliantWorkspace,
) -> None:  # fmt: skip
    """Derivatives of the controller's torques at the start of the step, by differences.

    The smaller of the differences to either side: where the torque jumps, as when a controller
    changes its mind, the other would be the jump over the perturbation. Where it jumps to both
    sides, as ``sign`` at zero, it has no gain.
    """
    for j in range(model.parent.shape[0]):
        memory.q[j] = work.base_q[j]
        memory.v[j] = work.base_v[j]
    forward_kinematics(model, memory.q, memory.equations.tree)
    link_velocities(model, memory.v, memory.equations.tree)
    try_command(controller, control, time, model, memory, memory.command, memory.torque)
    for kind in range(2):
        varied = memory.q if kind == 0 else memory.v
        gains = work.torque_by_q if kind == 0 else work.torque_by_v
        for j in range(model.parent.shape[0]):
            kept = varied[j]
            for side in range(2):
                change = PERTURBATION if side == 0 else -PERTURBATION
                varied[j] = kept + change
                forward_kinematics(model, memory.q, memory.equations.tree)
                link_velocities(model, memory.v, memory.equations.tree)
                command, torque = work.trial_command, work.trial_torque
                try_command(controller, control, time, model, memory, command, torque)
                for i in range(gains.shape[0]):
                    slope = (torque[i] - memory.torque[i]) / change
                    if side == 0 or abs(slope) < abs(gains[i, j]):
                        gains[i, j] = slope
            if is_steep(gains, j, memory.torque):
                varied[j] = kept + NEARER * PERTURBATION
                forward_kinematics(model, memory.q, memory.equations.tree)
                link_velocities(model, memory.v, memory.equations.tree)
                command, torque = work.trial_command, work.trial_torque
                try_command(controller, control, time, model, memory, command, torque)
                for i in range(gains.shape[0]):
                    if abs(torque[i] - memory.torque[i]) > 0.5 * PERTURBATION * abs(gains[i, j]):
                        gains[i, j] = 0.0
            varied[j] = kept
    work.age = 0


@kernel
def evaluate(
    controller: Any,
    control: Control,
    model: Model,
    ground: GroundModel,
    how: int,
    time: float,
    memory: Memory,
    work: CompliantWorkspace,
) -> None:
    """Forces and rates of the state in ``memory.q``, ``memory.v`` and ``work.now.friction.bend``.

    A controller that acts continuously is called, unless its torques are ``HELD``: to see what it
    would do (``TRIED``), for good (``DECIDED``), or for good with the contact forces of this very
    state, which is ``ACCEPTED``.
    """
    observe_sides(model, ground, memory.q, memory.v, memory, work.corners)
    now = work.now
    push_contacts(model, memory, work)
    push_stops(model, work.laws, memory, now)
    rub_joints(work.laws.joint_speed, memory, now)
    if now.own.gap.shape[0] > 0:
        push_constraints(model, work.laws, memory, now)
        write_constraint_rows(memory.rows, work.now_rows)
    if control.continuous == 1 and how != HELD:
        if how == ACCEPTED:
            show_forces(work.force, work.corners, memory.contacts)
        q, v, command = memory.q, memory.v, memory.command
        if how == TRIED:
            consult(controller, time, q, v, model, memory, control, command)
        else:
            ask(controller, time, q, v, model, memory, control, command)
    try_torque(model, control, memory.q, memory.v, memory.tally, memory.command, memory.torque)
    mass_matrix(model, memory.equations.tree, memory.equations.mass_matrix)
    factorize(model, memory.equations.mass_matrix, memory.equations.factor)
    bias_force(model, memory.equations.tree, memory.equations.rate)
    passive_force(model, memory.q, memory.v, memory.equations.force)
    add_pushes(model, memory.equations.tree, memory.pushes, memory.equations.force)
    for i in range(model.actuator_joint.shape[0]):
        memory.equations.force[model.actuator_joint[i]] += memory.torque[i]
    rate = now.acceleration
    nv = model.parent.shape[0]
    for j in range(nv):
        rate[j] = (
            memory.equations.force[j]
            - memory.equations.rate[j]
            + now.stop_force[j]
            + now.dry_force[j]
        )
    for contact in range(work.corners.sides):
        normal = work.force[contact, 0]
        tangent = work.force[contact, 1]
        if normal > 0.0:
            for j in range(nv):
                rate[j] += (
                    memory.assembly.jacobian[2 * contact, j] * normal
                    + memory.assembly.jacobian[2 * contact + 1, j] * tangent
                )
    for own in range(now.own.gap.shape[0]):
        for j in range(nv):
            rate[j] += work.now_rows[own, j] * now.own.force[own]
    solve_factorized(model, memory.equations.factor, rate)
    if now.loop.shape[0] > 0:
        hold_loops(model, memory, now)


@kernel
def hold_loops(model: Model, memory: Memory, now: Rates) -> None:
    """Find the forces of the loops, and the accelerations under them."""
    loops, rate = memory.loops, now.acceleration
    rows = rows_of(loops)
    find_loops(model, memory.q, memory.v, memory.equations.tree, loops)
    weigh(model, memory.equations)
    respond(rows, model, loops.rows.jacobian, memory.equations, loops.response, loops.system)
    for row in range(rows):
        loops.system[row, rows] = -speed_along(row, loops, rate) - loops.rows.bias[row]
    push_loops(loops, rate)
    copy_words(loops.unknown, now.loop)


@kernel
def push_contacts(model: Model, memory: Memory, work: CompliantWorkspace) -> None:
    """Forces of the contacts and rates of the bristles at the state now."""
    laws, normal, friction = work.laws, work.now.normal, work.now.friction
    for contact in range(model.contact_link.shape[0]):
        memory.reaction.slip[contact] = 0.0
        normal.gap[contact] = memory.contacts.gap[contact]
        if normal.gap[contact] < 0.0:
            tree = memory.equations.tree
            contact_rows(model, tree, memory.contacts, contact, contact, memory.assembly)
            memory.reaction.slip[contact] = row_product(
                memory.assembly.jacobian, 2 * contact + 1, memory.v
            )
            normal.speed[contact] = row_product(memory.assembly.jacobian, 2 * contact, memory.v)
    copy_words(memory.surface.friction[: model.nc], friction.friction)
    copy_words(memory.reaction.slip, friction.speed)
    if work.corners.doubled > 0:
        meet_second_faces(model, memory, work)
    call_at(laws.normal_code, (address_of(laws.normal), normal))
    copy_words(normal.force, friction.normal)
    call_at(laws.friction_code, (address_of(laws.friction), friction))
    for contact in range(work.corners.sides):
        work.force[contact, 0] = normal.force[contact]
        work.force[contact, 1] = friction.force[contact]


@kernel
def meet_second_faces(model: Model, memory: Memory, work: CompliantWorkspace) -> None:
    """Gaps and speeds of the points on their second faces, with their Jacobian rows."""
    seconds, jacobian = work.corners.contacts, memory.assembly.jacobian
    normal, friction = work.now.normal, work.now.friction
    for point in range(work.corners.doubled):
        contact = work.corners.other[point]
        normal.gap[contact] = seconds.gap[point]
        friction.friction[contact] = work.corners.friction[point]
        friction.speed[contact] = 0.0
        if normal.gap[contact] < 0.0:
            tree = memory.equations.tree
            contact_rows(model, tree, seconds, point, contact, memory.assembly)
            normal.speed[contact] = row_product(jacobian, 2 * contact, memory.v)
            friction.speed[contact] = row_product(jacobian, 2 * contact + 1, memory.v)


@kernel
def push_stops(model: Model, laws: Laws, memory: Memory, now: Rates) -> None:
    """Forces of the joint stops at the state now."""
    stop = now.stop
    for j in range(model.parent.shape[0]):
        below = memory.q[j] - model.lower[j]
        above = model.upper[j] - memory.q[j]
        stop.gap[j] = below if below < 0.0 else above
        stop.speed[j] = memory.v[j] if below < 0.0 else -memory.v[j]
    held = memory.loops.held
    for latch in range(held.shape[0]):
        if held[latch] == 1:
            pull_back(model, latch, memory, stop)
    call_at(laws.stop_code, (address_of(laws.stop), stop))
    for j in range(model.parent.shape[0]):
        now.stop_force[j] = stop.force[j] if memory.q[j] < model.lower[j] else -stop.force[j]
    for latch in range(held.shape[0]):
        j = model.latch_joint[latch]
        if held[latch] == 1 and model.lower[j] <= memory.q[j] <= model.upper[j]:
            now.stop_force[j] = model.latch_side[latch] * stop.force[j]


@kernel
def push_constraints(model: Model, laws: Laws, memory: Memory, now: Rates) -> None:
    """Forces of the constraints from outside that may let go: those of stops, from their gaps."""
    rows, own = memory.rows, now.own
    find_constraints(model, memory.q, memory.v, memory.equations.tree, rows)
    for i in range(own.gap.shape[0]):
        entry = rows.first[CONSTRAINT] + i
        own.gap[i] = rows.gap[entry]
        own.speed[i] = rate_of(rows.owner[entry], 0, memory.v, rows.outside)
    call_at(laws.stop_code, (address_of(laws.stop), own))


@kernel
def write_constraint_rows(rows: Rows, target: Floats) -> None:
    """Write the rows of the constraints from outside that may let go, one after the other."""
    for i in range(target.shape[0]):
        own = rows.owner[rows.first[CONSTRAINT] + i]
        for j in range(target.shape[1]):
            target[i, j] = rows.outside.jacobian[own, 0, j]


@kernel
def pull_back(model: Model, latch: int, memory: Memory, stop: NormalForces) -> None:
    """Ask the law of a stop that holds for its pull: what it would press with, mirrored."""
    j = model.latch_joint[latch]
    if model.lower[j] <= memory.q[j] <= model.upper[j]:
        side = model.latch_side[latch]
        end = model.upper[j] if side > 0 else model.lower[j]
        stop.gap[j] = -abs(end - memory.q[j])
        stop.speed[j] = side * memory.v[j]


@kernel
def rub_joints(scale: float, memory: Memory, now: Rates) -> None:
    """Dry friction of the joints, smoothed around zero speed."""
    rows = memory.rows
    for dry in range(rows.first[DRY_JOINT], rows.end[DRY_JOINT]):
        j = rows.owner[dry]
        limit = memory.breakaway[j]
        size = sqrt(memory.v[j] * memory.v[j] + scale * scale)
        now.dry_force[j] = -limit * memory.v[j] / size
        now.dry_by_speed[j] = -limit * (scale / size) ** 2 / size


@kernel
def begin_step(model: Model, memory: Memory, work: CompliantWorkspace) -> None:
    """Make the state evaluated last the start of the next step."""
    copy_words(work.now_words, work.base_words)
    copy_words(work.force, work.base_force)
    copy_words(memory.q, work.base_q)
    copy_words(memory.v, work.base_v)
    copy_words(memory.equations.mass_matrix, work.base_matrix)
    for row in range(2 * work.corners.sides):
        for j in range(model.parent.shape[0]):
            work.base_rows[row, j] = memory.assembly.jacobian[row, j]
    for row in range(work.loop_rows.shape[0]):
        for j in range(model.parent.shape[0]):
            work.loop_rows[row, j] = memory.loops.rows.jacobian[row, j]
    copy_words(work.now_rows, work.own_rows)


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
    model: Model, control: Control, g: float, held: bool, command: Floats, work: CompliantWorkspace
) -> None:
    """Factorise the linear system of all stages of a step of length g / γ."""
    nv = model.parent.shape[0]
    system, by_q, base = work.system, work.force_by_q, work.base
    for i in range(nv):
        for j in range(nv):
            system[i, j] = work.base_matrix[i, j]
            by_q[i, j] = 0.0
        system[i, i] += g * (model.damping[i] - (base.stop.by_speed[i] + base.dry_by_speed[i]))
        by_q[i, i] = base.stop.by_gap[i] - model.stiffness[i]
    if control.continuous == 1 and not held:
        for i in range(model.actuator_joint.shape[0]):
            joint = model.actuator_joint[i]
            for j in range(nv):
                system[joint, j] -= g * work.torque_by_v[i, j]
                by_q[joint, j] += work.torque_by_q[i, j]
    else:
        for i in range(model.actuator_joint.shape[0]):
            joint = model.actuator_joint[i]
            damping = motor_damping(model, i, control.voltage, command[i], work.base_v)
            system[joint, joint] += g * damping
    for contact in range(work.corners.sides):
        if base.normal.force[contact] <= 0.0:
            continue
        by_normal, by_speed, _ = tangent_gains(base.friction, contact, g)
        normal_row = work.base_rows[2 * contact]
        tangent_row = work.base_rows[2 * contact + 1]
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
    for own in range(work.own_rows.shape[0]):
        row = work.own_rows[own]
        for i in range(nv):
            for j in range(nv):
                system[i, j] -= g * row[i] * base.own.by_speed[own] * row[j]
                by_q[i, j] += row[i] * base.own.by_gap[own] * row[j]
    for i in range(nv):
        for j in range(nv):
            system[i, j] -= g * g * by_q[i, j]
    triangulate(nv, nv, False, system, work.order)
    for row in range(work.loop_rows.shape[0]):
        copy_words(work.loop_rows[row], work.loop_response[row])
        substitute(nv, system, work.order, work.loop_response[row])
        for other in range(work.loop_rows.shape[0]):
            work.loop_matrix[other, row] = dot(work.loop_rows[other], work.loop_response[row])


@kernel
def dot(a: Floats, b: Floats) -> float:
    """Scalar product."""
    total = 0.0
    for j in range(b.shape[0]):
        total += a[j] * b[j]
    return total


@kernel
def solve_stage(model: Model, g: float, stage: int, loops: Loops, work: CompliantWorkspace) -> None:
    """Solve for a stage from its right-hand side."""
    nv = model.parent.shape[0]
    u_q = work.stage_q[stage]
    u_v = work.stage_v[stage]
    u_s = work.stage_bristle[stage]
    base = work.base
    for i in range(nv):
        u_v[i] = g * (
            dot(work.base_matrix[i], work.right_v) + g * dot(work.force_by_q[i], work.right_q)
        )
    for contact in range(work.corners.sides):
        if base.normal.force[contact] <= 0.0:
            continue
        _, _, bend = tangent_gains(base.friction, contact, g)
        push = g * bend * work.right_bristle[contact]
        for j in range(nv):
            u_v[j] += push * work.base_rows[2 * contact + 1, j]
    substitute(nv, work.system, work.order, u_v)
    keep_loops(g, u_v, loops, work)
    for j in range(nv):
        u_q[j] = g * (work.right_q[j] + u_v[j])
    for contact in range(work.corners.sides):
        change = work.right_bristle[contact]
        if base.normal.force[contact] > 0.0:
            normal_row = work.base_rows[2 * contact]
            pressing = base.normal.by_speed[contact] * dot(normal_row, u_v)
            pressing += base.normal.by_gap[contact] * dot(normal_row, u_q)
            sliding = dot(work.base_rows[2 * contact + 1], u_v)
            change += base.friction.rate_by_normal[contact] * pressing
            change += base.friction.rate_by_speed[contact] * sliding
        u_s[contact] = change / (1.0 / g - base.friction.rate_by_bend[contact])


@kernel
def keep_loops(g: float, u_v: Floats, loops: Loops, work: CompliantWorkspace) -> None:
    """Add to a stage what the loops make of it."""
    rows = work.loop_rows.shape[0]
    for row in range(rows):
        for other in range(rows):
            loops.system[row, other] = work.loop_matrix[row, other]
        along = work.loop_rows[row]
        loops.system[row, rows] = g * dot(along, work.right_v) - dot(along, u_v)
    solve_to_rank(rows, loops.system, loops.order, loops.unknown)
    for row in range(rows):
        for j in range(u_v.shape[0]):
            u_v[j] += loops.unknown[row] * work.loop_response[row, j]


@kernel
def attempt_step(
    controller: Any,
    control: Control,
    model: Model,
    ground: GroundModel,
    time: float,
    h: float,
    held: bool,
    memory: Memory,
    work: CompliantWorkspace,
) -> float:
    """Go from the start of the step, at `time`, to its end; return the error over the tolerance.

    A controller that acts continuously is asked within it, unless its torques are `held`.
    """
    rtol, atol, now, base = work.rtol, work.atol, work.now, work.base
    how = DECIDED if h <= DECISIVE else TRIED
    if held:
        how = HELD
    nv = model.parent.shape[0]
    nc = work.corners.sides
    g = GAMMA * h
    factorize_step(model, control, g, held, memory.command, work)
    for stage in range(STAGES):
        if stage > 0:
            for i in range(nv):
                memory.q[i] = work.base_q[i]
                memory.v[i] = work.base_v[i]
                for k in range(stage):
                    memory.q[i] += A[stage, k] * work.stage_q[k, i]
                    memory.v[i] += A[stage, k] * work.stage_v[k, i]
            for i in range(nc):
                now.friction.bend[i] = base.friction.bend[i]
                for k in range(stage):
                    now.friction.bend[i] += A[stage, k] * work.stage_bristle[k, i]
            evaluate(controller, control, model, ground, how, time + TIMES[stage] * h, memory, work)
        for i in range(nv):
            work.right_q[i] = work.base_v[i] if stage == 0 else memory.v[i]
            work.right_v[i] = base.acceleration[i] if stage == 0 else now.acceleration[i]
            for k in range(stage):
                work.right_q[i] += C[stage, k] / h * work.stage_q[k, i]
                work.right_v[i] += C[stage, k] / h * work.stage_v[k, i]
        for i in range(nc):
            work.right_bristle[i] = base.friction.rate[i] if stage == 0 else now.friction.rate[i]
            for k in range(stage):
                work.right_bristle[i] += C[stage, k] / h * work.stage_bristle[k, i]
        solve_stage(model, g, stage, memory.loops, work)
    worst = 0.0
    for i in range(nv):
        worst = larger(worst, finish(work.base_q, work.stage_q, rtol, atol, memory.q, i))
        worst = larger(worst, finish(work.base_v, work.stage_v, rtol, atol, memory.v, i))
    for i in range(nc):
        worst = larger(
            worst, finish(base.friction.bend, work.stage_bristle, rtol, atol, now.friction.bend, i)
        )
        # A bristle in the air goes to zero; spare the processor the numbers next to it.
        if abs(now.friction.bend[i]) < NO_BEND:
            now.friction.bend[i] = 0.0
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
