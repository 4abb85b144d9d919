"""One step of the compliant ground's equations of motion, linearly implicit in what is stiff.

State: positions q, velocities v and the bends s of the bristles, one a contact point::

    q' = v,   A v' = f,   f = B Γ + passive − H + Jᵀ F(gap, J v, s),   s' = S(F_n, J v, s)

A stage of :mod:`heelstrike.sim.compliant.rosenbrock` linearises what can be stiff in f: contact
forces, joint springs and dampers, and the gains of a controller that acts continuously. With
g = γ h, u_q = g (r_q + u_v) and the bristles, each its own equation, eliminated, a stage is::

    (A − g ∂f/∂v − g² ∂f/∂q) u_v = g A r_v + g² ∂f/∂q r_q + g Jᵀ ∂F/∂s (…)

which stays well conditioned however stiff the ground. A controller's gains matter as much as the
ground's stiffness: computed torque on a foot that is not quite flat damps the light foot with the
inertia of the whole robot.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from heelstrike.compiler.bundle import Bundle, array, cell, number, part
from heelstrike.compiler.compilation import kernel
from heelstrike.contact.ground import GroundModel
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
from heelstrike.sim.compliant.contact_law import (
    BRISTLE_BY_BRISTLE,
    BRISTLE_BY_NORMAL,
    BRISTLE_BY_SPEED,
    JOINT_SCALE,
    NORMAL_BY_GAP,
    NORMAL_BY_SPEED,
    PARTIALS,
    TANGENT_BY_BRISTLE,
    TANGENT_BY_NORMAL,
    TANGENT_BY_SPEED,
    friction_force,
    joint_friction,
    normal_force,
)
from heelstrike.sim.compliant.rosenbrock import GAMMA, STAGES, TIMES, A, C, E, M
from heelstrike.sim.contacts.geometry import contact_rows, observe, row_product
from heelstrike.sim.controller.asking import ask, consult
from heelstrike.sim.controller.control import Control
from heelstrike.sim.controller.guard import guarded
from heelstrike.sim.memory import Memory
from heelstrike.sim.push import add_pushes
from heelstrike.sim.record.recording import try_torque

# Perturbation of a position (m, rad) or velocity (m/s, rad/s) that finds a controller's gains.
# They only steer the linear systems: their error costs steps, not accuracy.
PERTURBATION = 1e-6

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
    """The contact laws as the kernels see them.

    Attributes
    ----------
    normal, friction : int
        Which laws; constants of :mod:`heelstrike.sim.compliant.contact_law`.
    numbers : (7,) float
        Their parameters.
    stop : int
    stop_numbers : (7,) float
        The law of the joint stops.
    """

    normal: int = number(int)
    friction: int = number(int)
    numbers: Floats = array("numbers")
    stop: int = number(int)
    stop_numbers: Floats = array("numbers")


class CompliantWorkspace(Bundle):
    """State of the bristles and the scratch of a step.

    Attributes
    ----------
    bristle : (nc,) float
        Bend of each bristle now, in metres.
    acceleration, bristle_rate : (nv,), (nc,) float
        Rates of v and of the bristles at the state evaluated last.
    force : (nc, 2) float
        Contact forces of the law at the state evaluated last, in newtons.
    partial : (nc, 8) float
        Their derivatives.
    stop_force : (nv,) float
        Forces of the joint stops at the state evaluated last.
    dry_force : (nv,) float
        Dry friction of the joints at the state evaluated last.
    stop_partial : (nv, 2) float
        Derivatives of both by q and v of the joint.
    torque_by_q, torque_by_v : (nu, nv) float
        Derivatives of the controller's torques.
    age : int
        Steps since these were found.
    trial_torque : (nu,) float
        Torques of a perturbed state.
    base_q, base_v, base_acceleration : (nv,) float
    base_bristle, base_rate, base_gap : (nc,) float
    base_force : (nc, 2) float
    base_stop_force, base_dry_force : (nv,) float
    base_stop_partial : (nv, 2) float
    base_partial : (nc, 8) float
    base_rows : (2 nc, nv) float
    base_matrix : (nv, nv) float
        State, rates, gaps, forces, contact Jacobian and A at the start of the step.
    force_by_q : (nv, nv) float
        ∂f/∂q of a step, bristles eliminated.
    system : (nv, nv) float
        A − g ∂f/∂v − g² ∂f/∂q, then its triangular factors.
    order : (nv,) int
        Row exchanges of the factors.
    stage_q, stage_v : (4, nv) float
    stage_bristle : (4, nc) float
        The stages u_i.
    right_q, right_v : (nv,) float
    right_bristle : (nc,) float
        Right-hand side of a stage.
    impulse : (nc, 2) float
    stop_impulse, dry_impulse : (nv,) float
        Impulses of contacts, joint stops and dry friction since the last sample, in N s (N m s).
    touched, left : (nc,) float
        When a contact point last came to the ground and left it since the last sample; negative
        if it did not.
    laws : Laws
    step, rtol, atol : float
        Seconds between two samples; tolerated errors of a step, relative and absolute.
    proposed : float
        Length of the next step as far as accuracy allows (s).
    row : int
        Row of the record for this sample, -1 for none.
    """

    bristle: Floats = array("nc")
    acceleration: Floats = array("nv")
    bristle_rate: Floats = array("nc")
    force: Floats = array("nc", "components")
    partial: Floats = array("nc", "partials")
    stop_force: Floats = array("nv")
    dry_force: Floats = array("nv")
    stop_partial: Floats = array("nv", 2)
    torque_by_q: Floats = array("nu", "nv")
    torque_by_v: Floats = array("nu", "nv")
    trial_torque: Floats = array("nu")
    age: int = cell(int)
    base_q: Floats = array("nv")
    base_v: Floats = array("nv")
    base_acceleration: Floats = array("nv")
    base_bristle: Floats = array("nc")
    base_rate: Floats = array("nc")
    base_gap: Floats = array("nc")
    base_force: Floats = array("nc", "components")
    base_stop_force: Floats = array("nv")
    base_dry_force: Floats = array("nv")
    base_stop_partial: Floats = array("nv", 2)
    base_partial: Floats = array("nc", "partials")
    base_rows: Floats = array("2 nc", "nv")
    base_matrix: Floats = array("nv", "nv")
    force_by_q: Floats = array("nv", "nv")
    system: Floats = array("nv", "nv")
    order: Integers = array("nv", of=int)
    stage_q: Floats = array("stages", "nv")
    stage_v: Floats = array("stages", "nv")
    stage_bristle: Floats = array("stages", "nc")
    right_q: Floats = array("nv")
    right_v: Floats = array("nv")
    right_bristle: Floats = array("nc")
    impulse: Floats = array("nc", "components")
    stop_impulse: Floats = array("nv")
    dry_impulse: Floats = array("nv")
    touched: Floats = array("nc")
    left: Floats = array("nc")
    laws: Laws = part(Laws)
    step: float = number(float)
    rtol: float = number(float)
    atol: float = number(float)
    proposed: float = cell(float)
    row: int = cell(int)


def compliant_workspace(
    robot: Robot, laws: Laws, step: float, rtol: float, atol: float
) -> CompliantWorkspace:
    """Allocate the scratch for a robot."""
    return CompliantWorkspace.allocate(
        nv=robot.nv, nu=robot.nu, nc=robot.nc, components=2, partials=PARTIALS, stages=STAGES,
        trial_torque=guarded(np.zeros(robot.nu)), age=GAINS_LAST, laws=laws, step=step, rtol=rtol,
        atol=atol, proposed=step,
    )  # fmt: skip


@kernel
def command(controller: Any, control: Control, time: float, model: Model, memory: Memory) -> None:
    """Ask the controller for its torques at the state now, within their limits."""
    ask(controller, time, memory.q, memory.v, model, memory, control, memory.torque)
    try_torque(model, memory.q, memory.v, memory.tally, memory.torque)


@kernel
def try_command(
    controller: Any, control: Control, time: float, model: Model, memory: Memory, torque: Floats
) -> None:
    """Torques that a controller would ask for, were this its next call; it remembers nothing."""
    consult(controller, time, memory.q, memory.v, model, memory, control, torque)
    try_torque(model, memory.q, memory.v, memory.tally, torque)


@kernel
def find_gains(
    controller: Any, control: Control, time: float, model: Model, memory: Memory,
    work: CompliantWorkspace,
) -> None:  # fmt: skip
    """Derivatives of the controller's torques at the start of the step, by differences."""
    for j in range(model.parent.shape[0]):
        memory.q[j] = work.base_q[j]
        memory.v[j] = work.base_v[j]
    forward_kinematics(model, memory.q, memory.equations.tree)
    link_velocities(model, memory.v, memory.equations.tree)
    try_command(controller, control, time, model, memory, memory.torque)
    for j in range(model.parent.shape[0]):
        difference(
            controller, control, time, model, memory, memory.q, j, work.trial_torque,
            work.torque_by_q,
        )  # fmt: skip
        difference(
            controller, control, time, model, memory, memory.v, j, work.trial_torque,
            work.torque_by_v,
        )  # fmt: skip
    work.age = 0


@kernel
def difference(
    controller: Any,
    control: Control,
    time: float,
    model: Model,
    memory: Memory,
    varied: Floats,
    j: int,
    trial: Floats,
    gains: Floats,
) -> None:
    """Change of the torques per unit of component j of `varied`, ``memory.q`` or ``memory.v``.

    The smaller of the differences to either side: where the torque jumps, as when a controller
    changes its mind, the other would be the jump over the perturbation.
    """
    kept = varied[j]
    for side in range(2):
        change = PERTURBATION if side == 0 else -PERTURBATION
        varied[j] = kept + change
        forward_kinematics(model, memory.q, memory.equations.tree)
        link_velocities(model, memory.v, memory.equations.tree)
        try_command(controller, control, time, model, memory, trial)
        for i in range(trial.shape[0]):
            slope = (trial[i] - memory.torque[i]) / change
            if side == 0 or abs(slope) < abs(gains[i, j]):
                gains[i, j] = slope
    varied[j] = kept


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
    """Forces and rates of the state in ``memory.q``, ``memory.v`` and ``work.bristle``.

    A controller that acts continuously is called, unless its torques are ``HELD``: to see what it
    would do (``TRIED``), for good (``DECIDED``), or for good with the contact forces of this very
    state, which is ``ACCEPTED``.
    """
    observe(model, ground, memory.q, memory.v, memory)
    push_contacts(model, work.laws, memory, work)
    push_stops(model, work.laws, memory, work)
    rub_joints(model, work.laws.numbers[JOINT_SCALE], memory, work)
    if control.continuous == 1 and how != HELD:
        if how == ACCEPTED:
            for contact in range(model.contact_link.shape[0]):
                memory.contacts.force[contact, 0] = work.force[contact, 0]
                memory.contacts.force[contact, 1] = work.force[contact, 1]
        if how == TRIED:
            try_command(controller, control, time, model, memory, memory.torque)
        else:
            command(controller, control, time, model, memory)
    mass_matrix(model, memory.equations.tree, memory.equations.mass_matrix)
    factorize(model, memory.equations.mass_matrix, memory.equations.factor)
    bias_force(model, memory.equations.tree, memory.equations.rate)
    passive_force(model, memory.q, memory.v, memory.equations.force)
    add_pushes(model, memory.equations.tree, memory.pushes, memory.equations.force)
    for i in range(model.actuator_joint.shape[0]):
        memory.equations.force[model.actuator_joint[i]] += memory.torque[i]
    rate = work.acceleration
    nv = model.parent.shape[0]
    for j in range(nv):
        rate[j] = (
            memory.equations.force[j]
            - memory.equations.rate[j]
            + work.stop_force[j]
            + work.dry_force[j]
        )
    for contact in range(model.contact_link.shape[0]):
        normal = work.force[contact, 0]
        tangent = work.force[contact, 1]
        if normal > 0.0:
            for j in range(nv):
                rate[j] += (
                    memory.assembly.jacobian[2 * contact, j] * normal
                    + memory.assembly.jacobian[2 * contact + 1, j] * tangent
                )
    solve_factorized(model, memory.equations.factor, rate)


@kernel
def push_contacts(model: Model, laws: Laws, memory: Memory, work: CompliantWorkspace) -> None:
    """Forces of the contacts and rates of the bristles at the state now."""
    jacobian = memory.assembly.jacobian
    for contact in range(model.contact_link.shape[0]):
        partial = work.partial[contact]
        gap = memory.contacts.gap[contact]
        normal = 0.0
        memory.reaction.slip[contact] = 0.0
        if gap < 0.0:
            tree = memory.equations.tree
            contact_rows(model, tree, memory.contacts, contact, contact, memory.assembly)
            memory.reaction.slip[contact] = row_product(jacobian, 2 * contact + 1, memory.v)
            normal_speed = row_product(jacobian, 2 * contact, memory.v)
            normal = normal_force(laws.normal, laws.numbers, gap, normal_speed, partial)
        tangent, bristle_rate = friction_force(
            laws.friction,
            laws.numbers,
            memory.surface.friction[contact],
            normal,
            memory.reaction.slip[contact],
            work.bristle[contact],
            partial,
        )
        work.force[contact, 0] = normal
        work.force[contact, 1] = tangent
        work.bristle_rate[contact] = bristle_rate


@kernel
def push_stops(model: Model, laws: Laws, memory: Memory, work: CompliantWorkspace) -> None:
    """Forces of the joint stops at the state now."""
    for j in range(model.parent.shape[0]):
        work.stop_force[j] = 0.0
        work.stop_partial[j, 0] = 0.0
        work.stop_partial[j, 1] = 0.0
        below = memory.q[j] - model.lower[j]
        above = model.upper[j] - memory.q[j]
        if below < 0.0:
            work.stop_force[j] = normal_force(
                laws.stop, laws.stop_numbers, below, memory.v[j], work.stop_partial[j]
            )
        elif above < 0.0:
            work.stop_force[j] = -normal_force(
                laws.stop, laws.stop_numbers, above, -memory.v[j], work.stop_partial[j]
            )


@kernel
def rub_joints(model: Model, scale: float, memory: Memory, work: CompliantWorkspace) -> None:
    """Dry friction of the joints at the state now, after :func:`push_stops`."""
    for place in range(memory.dry_joint.shape[0]):
        j = memory.dry_joint[place]
        work.dry_force[j], slope = joint_friction(model.dry_friction[j], scale, memory.v[j])
        work.stop_partial[j, NORMAL_BY_SPEED] += slope


@kernel
def begin_step(model: Model, memory: Memory, work: CompliantWorkspace) -> None:
    """Make the state evaluated last the start of the next step."""
    nv = model.parent.shape[0]
    for i in range(nv):
        work.base_q[i] = memory.q[i]
        work.base_v[i] = memory.v[i]
        work.base_acceleration[i] = work.acceleration[i]
        work.base_stop_force[i] = work.stop_force[i]
        work.base_dry_force[i] = work.dry_force[i]
        for k in range(2):
            work.base_stop_partial[i, k] = work.stop_partial[i, k]
        for j in range(nv):
            work.base_matrix[i, j] = memory.equations.mass_matrix[i, j]
    for contact in range(model.contact_link.shape[0]):
        work.base_bristle[contact] = work.bristle[contact]
        work.base_rate[contact] = work.bristle_rate[contact]
        work.base_gap[contact] = memory.contacts.gap[contact]
        for k in range(2):
            work.base_force[contact, k] = work.force[contact, k]
            for j in range(nv):
                work.base_rows[2 * contact + k, j] = memory.assembly.jacobian[2 * contact + k, j]
        for k in range(PARTIALS):
            work.base_partial[contact, k] = work.partial[contact, k]


@kernel
def tangent_gains(partial: Floats, g: float) -> tuple[float, float, float]:
    """Change of the tangential force by normal force, by speed and by the bristle's residual.

    The bristle's own equation, ``(1/g − ∂S/∂s) u_s = r + ∂S/∂F_n dF_n + ∂S/∂v a``, is eliminated.
    """
    bend = partial[TANGENT_BY_BRISTLE] / (1.0 / g - partial[BRISTLE_BY_BRISTLE])
    by_normal = partial[TANGENT_BY_NORMAL] + bend * partial[BRISTLE_BY_NORMAL]
    by_speed = partial[TANGENT_BY_SPEED] + bend * partial[BRISTLE_BY_SPEED]
    return by_normal, by_speed, bend


@kernel
def factorize_step(model: Model, control: Control, g: float, work: CompliantWorkspace) -> None:
    """Factorise the linear system of all stages of a step of length g / γ."""
    nv = model.parent.shape[0]
    system = work.system
    by_q = work.force_by_q
    for i in range(nv):
        for j in range(nv):
            system[i, j] = work.base_matrix[i, j]
            by_q[i, j] = 0.0
        system[i, i] += g * (model.damping[i] - work.base_stop_partial[i, NORMAL_BY_SPEED])
        by_q[i, i] = work.base_stop_partial[i, NORMAL_BY_GAP] - model.stiffness[i]
    if control.continuous == 1:
        for i in range(model.actuator_joint.shape[0]):
            joint = model.actuator_joint[i]
            for j in range(nv):
                system[joint, j] -= g * work.torque_by_v[i, j]
                by_q[joint, j] += work.torque_by_q[i, j]
    for contact in range(model.contact_link.shape[0]):
        if work.base_force[contact, 0] <= 0.0:
            continue
        partial = work.base_partial[contact]
        by_normal, by_speed, _ = tangent_gains(partial, g)
        normal_row = work.base_rows[2 * contact]
        tangent_row = work.base_rows[2 * contact + 1]
        for i in range(nv):
            # What normal force and sliding speed do to coordinate i.
            pressing = normal_row[i] + by_normal * tangent_row[i]
            rubbing = by_speed * tangent_row[i]
            for j in range(nv):
                system[i, j] -= g * (
                    pressing * partial[NORMAL_BY_SPEED] * normal_row[j] + rubbing * tangent_row[j]
                )
                by_q[i, j] += pressing * partial[NORMAL_BY_GAP] * normal_row[j]
    for i in range(nv):
        for j in range(nv):
            system[i, j] -= g * g * by_q[i, j]
    eliminate(nv, system, work.order)


@kernel
def eliminate(size: int, matrix: Floats, order: Integers) -> None:
    """Replace a matrix by its triangular factors, exchanging rows."""
    for k in range(size):
        best = k
        for i in range(k + 1, size):
            if abs(matrix[i, k]) > abs(matrix[best, k]):
                best = i
        order[k] = best
        if best != k:
            for j in range(size):
                kept = matrix[k, j]
                matrix[k, j] = matrix[best, j]
                matrix[best, j] = kept
        for i in range(k + 1, size):
            matrix[i, k] /= matrix[k, k]
            for j in range(k + 1, size):
                matrix[i, j] -= matrix[i, k] * matrix[k, j]


@kernel
def substitute(size: int, matrix: Floats, order: Integers, x: Floats) -> None:
    """Replace x by the solution of the system that was eliminated."""
    for k in range(size):
        best = order[k]
        if best != k:
            kept = x[k]
            x[k] = x[best]
            x[best] = kept
    for i in range(size):
        for j in range(i):
            x[i] -= matrix[i, j] * x[j]
    for i in range(size - 1, -1, -1):
        for j in range(i + 1, size):
            x[i] -= matrix[i, j] * x[j]
        x[i] /= matrix[i, i]


@kernel
def dot(a: Floats, b: Floats) -> float:
    """Scalar product."""
    total = 0.0
    for j in range(b.shape[0]):
        total += a[j] * b[j]
    return total


@kernel
def solve_stage(model: Model, g: float, stage: int, work: CompliantWorkspace) -> None:
    """Solve for a stage from its right-hand side."""
    nv = model.parent.shape[0]
    u_q = work.stage_q[stage]
    u_v = work.stage_v[stage]
    u_s = work.stage_bristle[stage]
    for i in range(nv):
        u_v[i] = g * (
            dot(work.base_matrix[i], work.right_v) + g * dot(work.force_by_q[i], work.right_q)
        )
    for contact in range(u_s.shape[0]):
        if work.base_force[contact, 0] <= 0.0:
            continue
        _, _, bend = tangent_gains(work.base_partial[contact], g)
        push = g * bend * work.right_bristle[contact]
        for j in range(nv):
            u_v[j] += push * work.base_rows[2 * contact + 1, j]
    substitute(nv, work.system, work.order, u_v)
    for j in range(nv):
        u_q[j] = g * (work.right_q[j] + u_v[j])
    for contact in range(u_s.shape[0]):
        partial = work.base_partial[contact]
        change = work.right_bristle[contact]
        if work.base_force[contact, 0] > 0.0:
            normal_row = work.base_rows[2 * contact]
            pressing = partial[NORMAL_BY_SPEED] * dot(normal_row, u_v) + partial[
                NORMAL_BY_GAP
            ] * dot(normal_row, u_q)
            sliding = dot(work.base_rows[2 * contact + 1], u_v)
            change += partial[BRISTLE_BY_NORMAL] * pressing + partial[BRISTLE_BY_SPEED] * sliding
        u_s[contact] = change / (1.0 / g - partial[BRISTLE_BY_BRISTLE])


@kernel
def attempt_step(
    controller: Any,
    control: Control,
    model: Model,
    ground: GroundModel,
    time: float,
    h: float,
    memory: Memory,
    work: CompliantWorkspace,
) -> float:
    """Go from the start of the step, at `time`, to its end; return the error over the tolerance."""
    rtol, atol = work.rtol, work.atol
    how = DECIDED if h <= DECISIVE else TRIED
    nv = model.parent.shape[0]
    nc = model.contact_link.shape[0]
    g = GAMMA * h
    factorize_step(model, control, g, work)
    for stage in range(STAGES):
        if stage > 0:
            for i in range(nv):
                memory.q[i] = work.base_q[i]
                memory.v[i] = work.base_v[i]
                for k in range(stage):
                    memory.q[i] += A[stage, k] * work.stage_q[k, i]
                    memory.v[i] += A[stage, k] * work.stage_v[k, i]
            for i in range(nc):
                work.bristle[i] = work.base_bristle[i]
                for k in range(stage):
                    work.bristle[i] += A[stage, k] * work.stage_bristle[k, i]
            evaluate(controller, control, model, ground, how, time + TIMES[stage] * h, memory, work)
        for i in range(nv):
            work.right_q[i] = work.base_v[i] if stage == 0 else memory.v[i]
            work.right_v[i] = work.base_acceleration[i] if stage == 0 else work.acceleration[i]
            for k in range(stage):
                work.right_q[i] += C[stage, k] / h * work.stage_q[k, i]
                work.right_v[i] += C[stage, k] / h * work.stage_v[k, i]
        for i in range(nc):
            work.right_bristle[i] = work.base_rate[i] if stage == 0 else work.bristle_rate[i]
            for k in range(stage):
                work.right_bristle[i] += C[stage, k] / h * work.stage_bristle[k, i]
        solve_stage(model, g, stage, work)
    worst = 0.0
    for i in range(nv):
        worst = larger(worst, finish(work.base_q, work.stage_q, rtol, atol, memory.q, i))
        worst = larger(worst, finish(work.base_v, work.stage_v, rtol, atol, memory.v, i))
    for i in range(nc):
        worst = larger(
            worst, finish(work.base_bristle, work.stage_bristle, rtol, atol, work.bristle, i)
        )
        # A bristle in the air goes to zero; spare the processor the numbers next to it.
        if abs(work.bristle[i]) < NO_BEND:
            work.bristle[i] = 0.0
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
