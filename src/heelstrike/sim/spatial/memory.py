"""Everything that time stepping in space writes to, allocated before it starts."""

from __future__ import annotations

import numpy as np

from heelstrike.compiler.bundle import Bundle, array, cell, part
from heelstrike.contact.spatial.certified_solve import block_workspace
from heelstrike.contact.spatial.workspace import (
    BlockAnswer,
    BlockProblem,
    BlockWorkspace,
    block_answer,
    block_problem,
)
from heelstrike.dynamics.spatial.workspace import SpatialWorkspace, TreeFactor
from heelstrike.robot.model import Floats, Integers
from heelstrike.robot.spatial.robot import SpatialRobot
from heelstrike.sim.controller.interface import Contacts
from heelstrike.sim.spatial.table import NEVER_TOUCHED, BlockTable, lay_out_table, most_rows_of

KNOWN_SPEED = 1e-12
"""Velocity times the root of a mass (m/s kg^(1/2)) below which nothing is known of free velocities:
rounding of gravity over a step."""

MOST_ITERATIONS = 400
"""Iterations of a contact problem in a step."""


class SpatialTally(Bundle):
    """Counts and worst values of a simulation, over every step, recorded or not."""

    steps: int = cell(int)
    """Steps, and parts of halved ones."""
    saturations: int = cell(int)
    bad_torque: int = cell(int)
    """saturations, bad_torque: Commands that limits did not let through; the actuator whose command
    was not finite."""
    halved: int = cell(int)
    uncertified: int = cell(int)
    relaxed: int = cell(int)
    """halved, uncertified, relaxed: Steps that were halved; that went on with a residual above the
    tolerance; that were not asked to leave the ground, or left their impact to the next."""
    penetration: float = cell(float)
    """Deepest penetration of a contact point (m)."""
    residual: float = cell(float)
    """Largest residual of a contact problem, rounding included."""
    unsolved: float = cell(float)
    """Residual of the step that nothing could certify and that was not taken."""
    energy_gain: float = cell(float)
    """Kinetic energy that restitution made (J)."""


class SpatialEquations(Bundle):
    """The equations of motion of a state."""

    tree: SpatialWorkspace = part(SpatialWorkspace)
    """Kinematics."""
    factor: TreeFactor = part(TreeFactor)
    """Mass matrix and its factor."""
    bias: Floats = array("nv")
    """Bias force H."""
    force: Floats = array("nv")
    rate: Floats = array("nv")
    """force, rate: Generalised force without contact, and what it comes to."""


class SpatialFeet(Bundle):
    """The contact points of an instant beside what controllers see."""

    foot: Floats = array("feet", 3)
    """Projection of each point onto the ground, then onto its wall: where its rows are taken."""
    frame: Floats = array("feet", 9)
    """Normals and tangents, row by row."""
    slip: Floats = array("nc", 2)
    """Tangential velocity at the end of the step."""


class SpatialAssembly(Bundle):
    """The contact problem of a step, how it is put together, and its answer."""

    count: int = cell(int)
    """How many candidates there are."""
    candidate: Integers = array("entries", of=int)
    """Entries of the table that take part."""
    last: Integers = array("entries", of=int)
    """Last velocity of the chain of each."""
    before: Floats = array("entries")
    """Normal velocity of each as the step begins."""
    rows: Floats = array("capacity", "longest")
    """Rows of the candidates, whitened."""
    change: Floats = array("nv")
    """What impulses do to the velocity."""
    problem: BlockProblem = part(BlockProblem)
    answer: BlockAnswer = part(BlockAnswer)
    """problem, answer: The problem of the positions."""


class SpatialImpact(Bundle):
    """The impact of a step: what closes in it."""

    happens: int = cell(int)
    """Whether there is one."""
    relaxed: int = cell(int)
    wedged: int = cell(int)
    since: int = cell(int)
    """relaxed, wedged, since: Whether the step is not asked to come out of the ground; the last
    step that was not; the first of those without a break."""
    gain: float = cell(float)
    """Kinetic energy that restitution made in it (J)."""
    member: Integers = array("entries", of=int)
    """Candidates that take part."""
    bounce: Floats = array("entries")
    """What restitution asks of each (m/s)."""
    impulse: Floats = array("capacity")
    """Impulses of the members, in the rows of the candidates."""
    arriving: Floats = array("nv")
    """Velocity that positions move with."""
    problem: BlockProblem = part(BlockProblem)
    answer: BlockAnswer = part(BlockAnswer)
    """problem, answer: The impact."""


class SpatialPushes(Bundle):
    """Forces from outside as the kernels see them."""

    link: Integers = array("np", of=int)
    point: Floats = array("np", 3)
    force: Floats = array("np", 3)
    """point, force: Points in the axes of their links; forces in world axes."""
    start: Floats = array("np")
    end: Floats = array("np")
    row: Floats = array(3, "longest")
    """Scratch."""


class SpatialReported(Bundle):
    """What events have told of."""

    closed: Integers = array("entries", of=int)
    slipping: Integers = array("entries", of=int)
    """closed, slipping: Whether each entry was on the ground or at its stop, and whether it slid or
    moved."""


class SpatialMemory(Bundle):
    """State of a simulation in space and all that its kernels write to."""

    q: Floats = array("nq")
    v: Floats = array("nv")
    """q, v: Position and velocity now."""
    next_v: Floats = array("nv")
    """Velocity at the end of the step."""
    kept_q: Floats = array("nq")
    kept_v: Floats = array("nv")
    """kept_q, kept_v: State to return to."""
    command: Floats = array("nu")
    torque: Floats = array("nu")
    """command, torque: What the controller asks for, and what acts of it."""
    stop_torque: Floats = array("nv")
    friction_torque: Floats = array("nv")
    """stop_torque, friction_torque: Generalised forces of stops and of dry friction."""
    blocks: BlockTable = part(BlockTable)
    equations: SpatialEquations = part(SpatialEquations)
    contacts: Contacts = part(Contacts)
    feet: SpatialFeet = part(SpatialFeet)
    assembly: SpatialAssembly = part(SpatialAssembly)
    impact: SpatialImpact = part(SpatialImpact)
    solver: BlockWorkspace = part(BlockWorkspace)
    pushes: SpatialPushes = part(SpatialPushes)
    reported: SpatialReported = part(SpatialReported)
    tally: SpatialTally = part(SpatialTally)


def allocate_spatial_memory(
    robot: SpatialRobot, pushes: SpatialPushes, *, walls: bool = False
) -> SpatialMemory:
    """Allocate the memory of a simulation of a robot in space, on ground with walls or without."""
    table = lay_out_table(robot, walls=walls)
    entries, rows = len(table.kind), max(most_rows_of(table), 1)
    extents = {
        **robot.model.extents, "entries": entries, "capacity": rows, "axes": 3, "components": 3,
        "feet": (2 if walls else 1) * robot.model.nc,
    }  # fmt: skip
    blocks = max(entries, 1)
    assembly = SpatialAssembly.allocate(
        extents, problem=block_problem(blocks, rows), answer=block_answer(blocks, rows)
    )
    impact = SpatialImpact.allocate(
        extents,
        wedged=NEVER_TOUCHED,
        problem=block_problem(blocks, rows),
        answer=block_answer(blocks, rows),
    )
    solver = block_workspace(blocks, rows, ready=False)
    solver.settings.floor = KNOWN_SPEED
    solver.settings.effort = MOST_ITERATIONS
    return SpatialMemory.allocate(
        extents, blocks=table, assembly=assembly, impact=impact, solver=solver, pushes=pushes
    )


def no_pushes(robot: SpatialRobot) -> SpatialPushes:
    """Return the arrays of no pushes at all."""
    return SpatialPushes.allocate(robot.model.extents, np=0, link=np.zeros(0, dtype=np.int64))
