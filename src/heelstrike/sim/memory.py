"""Everything the compiled loop writes to, allocated before it starts."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from heelstrike.compiler.bundle import Bundle, array, cell, part
from heelstrike.contact.solvers.certified_solve import contact_workspace
from heelstrike.contact.workspace import ContactAnswer, ContactProblem, ContactWorkspace
from heelstrike.dynamics.articulated import ArticulatedBodies
from heelstrike.dynamics.workspace import Workspace
from heelstrike.robot.robot import Robot
from heelstrike.sim.contacts.straight_line import straight_line_programs, usual_points
from heelstrike.sim.controller.guard import guarded
from heelstrike.sim.controller.interface import Contacts
from heelstrike.sim.push import Push, Pushes, pushes_on

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


class Tally(Bundle):
    """Counts and worst values of a simulation, over every step, recorded or not.

    Attributes
    ----------
    steps, saturations : int
        Steps taken; torques clipped to their limits.
    bad_torque : int
        Actuator whose torque was not finite.
    bad_trial : int
        One more than the actuator whose torque was not finite when asked for within a step.
    penetration : float
        Deepest penetration of a contact point (m).
    complementarity, cone, non_penetration : float
        Largest residuals of the contact problems.
    """

    steps: int = cell(int)
    saturations: int = cell(int)
    bad_torque: int = cell(int)
    bad_trial: int = cell(int)
    penetration: float = cell(float)
    complementarity: float = cell(float)
    cone: float = cell(float)
    non_penetration: float = cell(float)


class Memory(Bundle):
    """State of a simulation and the scratch of its step.

    Attributes
    ----------
    q, v : (nv,) float
        Position and velocity now.
    next_v : (nv,) float
        Velocity at the end of the step.
    torque : (nu,) float
        Joint torques of this step, within their limits.
    force, rate, bias : (nv,) float
        Generalised force without contact; scratch; bias force H.
    stiffness, damping : (nv,) float
        Gains of joint springs, dampers and controller that an implicit scheme takes at the end of
        the step (N m, N m s).
    mass_matrix, factor : (nv, nv) float
        Mass matrix and its factor, for straight-line programs and compliant contact.
    added : (nv,) float
        What an implicit scheme adds to the diagonal of the mass matrix.
    bodies : ArticulatedBodies
        What the loops solve with instead of the factor; see
        :mod:`heelstrike.sim.contacts.straight_line`.
    tree : Workspace
        Kinematics of the state now.
    contacts : Contacts
        Contact points now; their forces are those of the last solve.
    friction, restitution : (capacity,) float
        Coefficients of the ground under each contact point; zero for the joint stops after them,
        and friction 1 for the dry joints after these.
    slip : (nc,) float
        Tangential velocity of each contact point at the end of the step.
    mode : (capacity,) int
        Contact mode found by the last solve, the guess of the next.
    closed, slipping : (capacity,) int
        Whether each contact point is on the ground, and whether it slips.
    stop_torque : (nv,) float
        Generalised force of the joint stops in the last solve.
    stop_mode : (nv, 2) int
        Contact mode of each joint's lower and upper stop in the last solve.
    stopped : (nv,) int
        Whether each joint pressed against a stop.
    dry_joint : (nd,) int
        Joints with dry friction.
    friction_torque : (nv,) float
        Generalised force of dry joint friction in the last solve.
    dry_mode, resting : (nd,) int
        Contact mode of each dry joint in the last solve; whether it was reported at rest, -1
        before the first report.
    candidate : (capacity,) int
        Contact points in the contact problem of this step; after them the joint stops, numbered
        on from nc: twice the joint, plus one for its upper end; last the dry joints. The capacity
        has room for all.
    jacobian : (2 capacity, nv) float
        Contact Jacobian of the candidates.
    leaf : (capacity,) int
        Link that each candidate acts on: only its joint and those before have a part in its rows.
    root : (nv,) float
    half : (nv, 2 capacity) float
        D^(-1/2) and D^(-1/2) L⁻ᵀ Jᵀ, with A = Lᵀ D L.
    problem, usual_problem : ContactProblem
        The contact problem of the candidates, and with the matrix of the usual points.
    answer : ContactAnswer
        Its solution.
    programs : (5,) int
        Addresses of straight-line code, zero for none; see
        :mod:`heelstrike.sim.contacts.straight_line`.
    every_point, usual_points : (nc,), (k,) int
        All contact points, and those that the programs are for.
    usual_place : (nc,) int
        Place of each contact point in `usual_points`, -1 for none.
    point_rows : (2 k, nv) float
        Scratch of the Delassus matrix of the usual points.
    point_velocity, point_impulse : (nc, 2) float
        Velocities and impulses of contact points.
    solver : ContactWorkspace
        Memory of the contact solvers.
    pushes : Pushes
        Forces from outside.
    tally : Tally
        Counts and worst values of the run.
    """

    q: Floats = array("nq")
    v: Floats = array("nv")
    next_v: Floats = array("nv")
    torque: Floats = array("nu")
    force: Floats = array("nv")
    rate: Floats = array("nv")
    bias: Floats = array("nv")
    stiffness: Floats = array("nv")
    damping: Floats = array("nv")
    mass_matrix: Floats = array("nv", "nv")
    factor: Floats = array("nv", "nv")
    added: Floats = array("nv")
    bodies: ArticulatedBodies = part(ArticulatedBodies)
    tree: Workspace = part(Workspace)
    contacts: Contacts = part(Contacts)
    friction: Floats = array("capacity")
    restitution: Floats = array("capacity")
    slip: Floats = array("nc")
    mode: Integers = array("capacity", of=int)
    closed: Integers = array("capacity", of=int)
    slipping: Integers = array("capacity", of=int)
    stop_torque: Floats = array("nv")
    stop_mode: Integers = array("nv", 2, of=int)
    stopped: Integers = array("nv", of=int)
    dry_joint: Integers = array("nd", of=int)
    friction_torque: Floats = array("nv")
    dry_mode: Integers = array("nd", of=int)
    resting: Integers = array("nd", of=int)
    candidate: Integers = array("capacity", of=int)
    jacobian: Floats = array("2 capacity", "nv")
    leaf: Integers = array("capacity", of=int)
    root: Floats = array("nv")
    half: Floats = array("nv", "2 capacity")
    programs: Integers = array("programs", of=int, address=True)
    every_point: Integers = array("nc", of=int)
    problem: ContactProblem = part(ContactProblem)
    usual_problem: ContactProblem = part(ContactProblem)
    answer: ContactAnswer = part(ContactAnswer)
    usual_points: Integers = array("usual", of=int)
    usual_place: Integers = array("nc", of=int)
    point_rows: Floats = array("2 usual", "nv")
    point_velocity: Floats = array("nc", "components")
    point_impulse: Floats = array("nc", "components")
    solver: ContactWorkspace = part(ContactWorkspace)
    pushes: Pushes = part(Pushes)
    tally: Tally = part(Tally)


def capacity(robot: Robot) -> int:
    """How many contact points, joint stops and dry joints a robot has in one contact problem."""
    model = robot.model
    stops = np.isfinite(model.lower).sum() + np.isfinite(model.upper).sum()
    return robot.nc + int(stops) + int(np.sum(model.dry_friction > 0.0))


def allocate_memory(robot: Robot, pushes: Sequence[Push] = ()) -> Memory:
    """Allocate the memory of a simulation of `robot`."""
    nv, nu, nc = robot.nv, robot.nu, robot.nc
    stops = np.isfinite(robot.model.lower).sum() + np.isfinite(robot.model.upper).sum()
    dry = np.flatnonzero(robot.model.dry_friction > 0.0)
    capacity = nc + int(stops) + len(dry)
    usual = usual_points(robot)
    place = np.full(nc, -1)
    place[usual] = np.arange(len(usual))
    problem = ContactProblem.allocate(nc=capacity)
    usual_problem = ContactProblem.allocate(
        nc=len(usual),
        free=problem.free[: 2 * len(usual)],
        friction=problem.friction[: len(usual)],
    )
    answer = ContactAnswer.allocate(nc=capacity)
    return Memory.allocate(
        nl=nv, nq=robot.nq, nv=nv, nu=nu, nc=nc, nd=len(dry), capacity=capacity, usual=len(usual),
        axes=2, components=2,
        torque=guarded(np.zeros(nu)),
        friction=np.where(np.arange(capacity) < capacity - len(dry), 0.0, 1.0),
        dry_joint=dry.astype(np.int64),
        resting=np.full(len(dry), -1, dtype=np.int64),
        problem=problem,
        usual_problem=usual_problem,
        answer=answer,
        programs=straight_line_programs(robot.model, usual),
        every_point=np.arange(nc),
        usual_points=usual,
        usual_place=place,
        solver=contact_workspace(max(capacity, 1), ready=False),  # loops make it ready
        pushes=pushes_on(robot, pushes),
    )  # fmt: skip
