"""Everything the compiled loop writes to, allocated before it starts."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from heelstrike.compiler.bundle import Bundle
from heelstrike.contact.solvers.search import contact_workspace
from heelstrike.contact.workspace import ContactWorkspace
from heelstrike.dynamics.articulated import ArticulatedBodies, articulated_bodies
from heelstrike.dynamics.workspace import Workspace, workspace
from heelstrike.robot.robot import Robot
from heelstrike.sim.controller.guard import guarded, guarded_bundle
from heelstrike.sim.controller.interface import Contacts
from heelstrike.sim.programs import straight_line_programs, usual_points
from heelstrike.sim.push import Push, Pushes, pushes_on

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

# Places in ``Memory.tally``: counts over the whole run.
SATURATIONS = 0
STEPS = 1
BAD_TORQUE = 2
CONDUCT = 3
NOT_FINITE = 4
TALLIES = 5

# What CONDUCT says of the controller: that nobody looks whether it changes state and contacts, or
# that one does; that it has; that it wrote beyond its own arrays.
TRUSTED = 0
WATCHED = 1
CHANGED = 2
OVERRAN = 3

# Places in ``Memory.extreme``: worst values over every step, recorded or not.
PENETRATION = 0
COMPLEMENTARITY = 1
CONE = 2
NON_PENETRATION = 3
EXTREMES = 4


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
        What the loops solve with instead of the factor; see :mod:`heelstrike.sim.programs`.
    tree, scratch : Workspace
        Kinematics of the state now; a second one for controllers.
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
    delassus : (2 capacity, 2 capacity) float
    free, impulse, velocity : (2 capacity,) float
        The contact problem and its solution.
    problem_friction : (capacity,) float
    problem_mode : (capacity,) int
    residual : (3,) float
        Residuals of the certificate of the last solve.
    programs : (5,) int
        Addresses of straight-line code, zero for none; see :mod:`heelstrike.sim.programs`.
    every_point, usual_points : (nc,), (k,) int
        All contact points, and those that the programs are for.
    usual_place : (nc,) int
        Place of each contact point in `usual_points`, -1 for none.
    point_rows : (2 k, nv) float
    point_delassus : (2 k, 2 k) float
        Scratch and Delassus matrix of the usual points.
    point_velocity, point_impulse : (nc, 2) float
        Velocities and impulses of contact points.
    solver : ContactWorkspace
        Memory of the contact solvers.
    pushes : Pushes
        Forces from outside.
    tally : (5,) int
    extreme : (4,) float
        Counts and worst values of the run; their places are module constants.
    """

    q: Floats
    v: Floats
    next_v: Floats
    torque: Floats
    force: Floats
    rate: Floats
    bias: Floats
    stiffness: Floats
    damping: Floats
    mass_matrix: Floats
    factor: Floats
    added: Floats
    bodies: ArticulatedBodies
    tree: Workspace
    scratch: Workspace
    contacts: Contacts
    friction: Floats
    restitution: Floats
    slip: Floats
    mode: Integers
    closed: Integers
    slipping: Integers
    stop_torque: Floats
    stopped: Integers
    dry_joint: Integers
    friction_torque: Floats
    dry_mode: Integers
    resting: Integers
    candidate: Integers
    jacobian: Floats
    leaf: Integers
    root: Floats
    half: Floats
    delassus: Floats
    free: Floats
    impulse: Floats
    velocity: Floats
    problem_friction: Floats
    problem_mode: Integers
    residual: Floats
    programs: Integers
    every_point: Integers
    usual_points: Integers
    usual_place: Integers
    point_rows: Floats
    point_delassus: Floats
    point_velocity: Floats
    point_impulse: Floats
    solver: ContactWorkspace
    pushes: Pushes
    tally: Integers
    extreme: Floats


def allocate_memory(robot: Robot, pushes: Sequence[Push] = ()) -> Memory:
    """Allocate the memory of a simulation of `robot`."""
    nv, nu, nc = robot.nv, robot.nu, robot.nc
    stops = np.isfinite(robot.model.lower).sum() + np.isfinite(robot.model.upper).sum()
    dry = np.flatnonzero(robot.model.dry_friction > 0.0)
    capacity = nc + int(stops) + len(dry)
    usual = usual_points(robot)
    place = np.full(nc, -1)
    place[usual] = np.arange(len(usual))
    return Memory(
        q=guarded(np.zeros(nv)),
        v=guarded(np.zeros(nv)),
        next_v=np.zeros(nv),
        torque=guarded(np.zeros(nu)),
        force=np.zeros(nv),
        rate=np.zeros(nv),
        bias=np.zeros(nv),
        stiffness=np.zeros(nv),
        damping=np.zeros(nv),
        mass_matrix=np.zeros((nv, nv)),
        factor=np.zeros((nv, nv)),
        added=np.zeros(nv),
        bodies=articulated_bodies(nv),
        tree=guarded_bundle(workspace(nv)),
        scratch=guarded_bundle(workspace(nv)),
        contacts=guarded_bundle(
            Contacts(np.zeros((nc, 2)), np.zeros((nc, 2)), np.zeros(nc), np.zeros((nc, 2)))
        ),
        friction=np.where(np.arange(capacity) < capacity - len(dry), 0.0, 1.0),
        restitution=np.zeros(capacity),
        slip=np.zeros(nc),
        mode=np.zeros(capacity, dtype=np.int64),
        closed=np.zeros(capacity, dtype=np.int64),
        slipping=np.zeros(capacity, dtype=np.int64),
        stop_torque=np.zeros(nv),
        stopped=np.zeros(nv, dtype=np.int64),
        dry_joint=dry.astype(np.int64),
        friction_torque=np.zeros(nv),
        dry_mode=np.zeros(len(dry), dtype=np.int64),
        resting=np.full(len(dry), -1, dtype=np.int64),
        candidate=np.zeros(capacity, dtype=np.int64),
        jacobian=np.zeros((2 * capacity, nv)),
        leaf=np.zeros(capacity, dtype=np.int64),
        root=np.zeros(nv),
        half=np.zeros((nv, 2 * capacity)),
        delassus=np.zeros((2 * capacity, 2 * capacity)),
        free=np.zeros(2 * capacity),
        impulse=np.zeros(2 * capacity),
        velocity=np.zeros(2 * capacity),
        problem_friction=np.zeros(capacity),
        problem_mode=np.zeros(capacity, dtype=np.int64),
        residual=np.zeros(3),
        programs=straight_line_programs(robot.model, usual),
        every_point=np.arange(nc),
        usual_points=usual,
        usual_place=place,
        point_rows=np.zeros((2 * len(usual), nv)),
        point_delassus=np.zeros((2 * len(usual), 2 * len(usual))),
        point_velocity=np.zeros((nc, 2)),
        point_impulse=np.zeros((nc, 2)),
        solver=contact_workspace(max(capacity, 1), ready=False),  # loops make it ready
        pushes=pushes_on(robot, pushes),
        tally=np.zeros(TALLIES, dtype=np.int64),
        extreme=np.zeros(EXTREMES),
    )


class Record(Bundle):
    """Rows of a run, filled by the compiled loop, one row an instant.

    Forces and torques of a row are those decided at its instant and acting over the step that
    follows. `row_count` and `event_count` are the numbers of rows used.
    """

    row_count: Integers
    time: Floats
    q: Floats
    v: Floats
    torque: Floats
    stop_torque: Floats
    friction_torque: Floats
    point: Floats
    normal: Floats
    gap: Floats
    force: Floats
    slip: Floats
    residual: Floats
    event_count: Integers
    event_time: Floats
    event_kind: Integers
    event_contact: Integers
    event_impulse: Floats


def allocate_record(robot: Robot, rows: int, events: int) -> Record:
    """Allocate a record of `rows` instants and `events` events."""
    nv, nu, nc = robot.nv, robot.nu, robot.nc
    return Record(
        row_count=np.zeros(1, dtype=np.int64),
        time=np.zeros(rows),
        q=np.zeros((rows, nv)),
        v=np.zeros((rows, nv)),
        torque=np.zeros((rows, nu)),
        stop_torque=np.zeros((rows, nv)),
        friction_torque=np.zeros((rows, nv)),
        point=np.zeros((rows, nc, 2)),
        normal=np.zeros((rows, nc, 2)),
        gap=np.zeros((rows, nc)),
        force=np.zeros((rows, nc, 2)),
        slip=np.zeros((rows, nc)),
        residual=np.zeros((rows, 3)),
        event_count=np.zeros(1, dtype=np.int64),
        event_time=np.zeros(events),
        event_kind=np.zeros(events, dtype=np.int64),
        event_contact=np.zeros(events, dtype=np.int64),
        event_impulse=np.zeros((events, 2)),
    )


def joined(records: list[Record]) -> Record:
    """Concatenate the used rows of consecutive records."""
    rows = [int(part.row_count[0]) for part in records]
    events = [int(part.event_count[0]) for part in records]

    def join(name: str) -> Any:
        used = events if name.startswith("event_") else rows
        return np.concatenate(
            [getattr(part, name)[:n] for part, n in zip(records, used, strict=True)]
        )

    counts = {
        "row_count": np.array([sum(rows)]),
        "event_count": np.array([sum(events)]),
    }
    names = [field.name for field in dataclasses.fields(Record)]
    return Record(**{name: counts[name] if name in counts else join(name) for name in names})
