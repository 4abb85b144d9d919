"""Everything that time stepping in space writes to, allocated before it starts."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np

from heelstrike.compiler.bundle import Bundle, array, cell, part
from heelstrike.compiler.mold import Mold
from heelstrike.contact.spatial.certified_solve import block_workspace
from heelstrike.contact.spatial.workspace import (
    BlockAnswer,
    BlockProblem,
    BlockSettings,
    BlockTally,
    BlockWorkspace,
    block_answer,
    block_problem,
)
from heelstrike.dynamics.spatial.workspace import SpatialWorkspace, TreeFactor
from heelstrike.robot.model import Floats, Integers
from heelstrike.robot.spatial.model import SpatialModel
from heelstrike.robot.spatial.robot import SpatialRobot
from heelstrike.sim.controller.guard import guarded
from heelstrike.sim.controller.interface import Contacts
from heelstrike.sim.memory import CommonTally
from heelstrike.sim.push import Push, Pushes, pushes_on
from heelstrike.sim.spatial.table import (
    NEVER_TOUCHED,
    WALLS,
    BlockTable,
    lay_out_table,
    most_rows_of,
)

KNOWN_SPEED = 1e-12
"""Velocity times the root of a mass (m/s kg^(1/2)) below which nothing is known of free velocities:
rounding of gravity over a step."""

MOST_ITERATIONS = 400
"""Iterations of a contact problem in a step."""


class SpatialTally(CommonTally):
    """Counts and worst values of a simulation in space, over every step, recorded or not."""

    residual: float = cell(float)
    """Largest residual of a contact problem, rounding included."""
    unsolved: float = cell(float)
    """Residual of the step that nothing could certify and that was not taken."""
    uncertified: int = cell(int)
    halved: int = cell(int)
    relaxed: int = cell(int)
    """uncertified, halved, relaxed: Steps that went on with a residual above the tolerance; that
    were halved; that were not asked to leave the ground or to come down to it, or whose impact did
    not bounce or was left to the next."""
    energy_gain: float = cell(float)
    """Kinetic energy that restitution made (J)."""


class SpatialStep(Bundle):
    """What a step adds to the tally, once it is taken."""

    parts: int = cell(int)
    """How many parts it was taken in."""
    uncertified: int = cell(int)
    halved: int = cell(int)
    relaxed: int = cell(int)
    energy_gain: float = cell(float)
    """uncertified, halved, relaxed, energy_gain: As in the tally."""
    q: Floats = array("nq")
    v: Floats = array("nv")
    """q, v: The state at its end."""


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
    """Projection of each point onto the ground, then onto its walls: where its rows are taken."""
    frame: Floats = array("feet", 9)
    """Normals and tangents, row by row."""


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
    complete: int = cell(int)
    """Whether the Delassus matrix of the problem has been written."""
    change: Floats = array("nv")
    """What impulses do to the velocity."""
    problem: BlockProblem = part(BlockProblem)
    answer: BlockAnswer = part(BlockAnswer)
    """problem, answer: The problem of the positions."""


class SpatialHolding(Bundle):
    """The equations of what holds as in the step before, in the velocities."""

    tree: TreeFactor = part(TreeFactor)
    """Their matrix and its factor."""
    part: Floats = array("nv")
    along: Floats = array("nv")
    """part, along: A term of the impulses along the velocities, and the sum of all terms."""
    change: Floats = array("nv")
    """Change of the velocities that impulses make."""
    weighted: Floats = array("capacity")
    """Impulses, or velocities, of the rows in other units."""


class SpatialWedge(Bundle):
    """Which steps were not asked to come out of the ground, or down to it."""

    relaxed: int = cell(int)
    wedged: int = cell(int)
    since: int = cell(int)
    """relaxed, wedged, since: Whether this one is not; the last step that was not; the first of
    those without a break."""


class SpatialImpact(Bundle):
    """The impact of a step: what closes in it."""

    happens: int = cell(int)
    """Whether there is one."""
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


class SpatialReaction(Bundle):
    """What else came of the contact problem of a step."""

    stop_torque: Floats = array("nv")
    friction_torque: Floats = array("nv")
    """stop_torque, friction_torque: Generalised forces of stops and of dry friction."""
    slip: Floats = array("nc", 2)
    """Tangential velocity of the contact points at the end of the step; zero of those that take no
    part."""
    residual: float = cell(float)
    """Of the problem of the positions, rounding included; zero where there was none."""


class SpatialReported(Bundle):
    """What events have told of."""

    closed: Integers = array("entries", of=int)
    slipping: Integers = array("entries", of=int)
    """closed, slipping: Whether each entry was on the ground or at its stop, and whether it slid or
    moved."""

    def forget(self) -> None:
        """Be as at the beginning."""
        self.closed[:] = self.slipping[:] = 0


class SpatialMemory(Bundle):
    """State of a simulation in space and all that its kernels write to.

    What has an address of its own is written again before it is read, and is not kept.
    """

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
    blocks: BlockTable = part(BlockTable)
    equations: SpatialEquations = part(SpatialEquations)
    contacts: Contacts = part(Contacts)
    feet: SpatialFeet = part(SpatialFeet)
    reaction: SpatialReaction = part(SpatialReaction)
    step: SpatialStep = part(SpatialStep)
    """What is decided of the step that follows."""
    wedge: SpatialWedge = part(SpatialWedge)
    assembly: SpatialAssembly = part(SpatialAssembly, address=True)
    holding: SpatialHolding = part(SpatialHolding, address=True)
    impact: SpatialImpact = part(SpatialImpact, address=True)
    solver: BlockWorkspace = part(BlockWorkspace, address=True)
    settings: BlockSettings = part(BlockSettings)
    solves: BlockTally = part(BlockTally)
    """settings, solves: Of the solver."""
    pushes: Pushes = part(Pushes)
    reported: SpatialReported = part(SpatialReported)
    tally: SpatialTally = part(SpatialTally)


class SpatialScratch(NamedTuple):
    """What the solvers of a simulation scribble on.

    Attributes
    ----------
    assembly : SpatialAssembly
    holding : SpatialHolding
    impact : SpatialImpact
    solver : BlockWorkspace
    """

    assembly: SpatialAssembly
    holding: SpatialHolding
    impact: SpatialImpact
    solver: BlockWorkspace


def spatial_scratch(entries: int, rows: int, models: Sequence[SpatialModel]) -> SpatialScratch:
    """Allocate room for problems of so many entries and rows, of any of some robots."""
    blocks, most = max(entries, 1), max(rows, 1)
    largest = {name: max(model.extents[name] for model in models) for name in models[0].extents}
    extents = {**largest, "entries": entries, "capacity": most}

    def both() -> dict[str, Any]:
        return {"problem": block_problem(blocks, most), "answer": block_answer(blocks, most)}

    return SpatialScratch(
        SpatialAssembly.allocate(extents, **both()),
        SpatialHolding.allocate(extents),
        SpatialImpact.allocate(extents, **both()),
        block_workspace(blocks, most, ready=False),
    )


def allocate_spatial_memory(
    robot: SpatialRobot, pushes: Sequence[Push] = (), *, walls: bool = False
) -> SpatialMemory:
    """Allocate the memory of a simulation of a robot in space, on ground with walls or without."""
    memory = spatial_mold(robot, walls=walls).cast()
    table = memory.blocks
    scratch = spatial_scratch(len(table.kind), most_rows_of(table), [robot.model])
    return beside_scratch(memory, scratch).replaced(pushes=pushes_on(robot, pushes))


def beside_scratch(memory: SpatialMemory, scratch: SpatialScratch) -> SpatialMemory:
    """Return a memory whose solvers scribble there."""
    solver = scratch.solver.replaced(settings=memory.settings, tally=memory.solves)
    parts = {**scratch._asdict(), "solver": solver}
    return memory.replaced(**parts)


def spatial_mold(robot: SpatialRobot, *, walls: bool) -> Mold[SpatialMemory]:
    """Return the mold of the memory of a robot's simulations, with nothing to scribble on."""
    molds = _MOLDS.setdefault(robot, {})
    if walls not in molds:
        molds[walls] = Mold(_laid_out(robot, walls=walls))
    return molds[walls]


_MOLDS: WeakKeyDictionary[SpatialRobot, dict[bool, Mold[SpatialMemory]]] = WeakKeyDictionary()


def _laid_out(robot: SpatialRobot, *, walls: bool) -> SpatialMemory:
    table = lay_out_table(robot, walls=walls)
    nothing = spatial_scratch(0, 0, [robot.model])
    extents = {
        **robot.model.extents, "entries": len(table.kind), "axes": 3, "components": 3,
        "feet": (1 + WALLS if walls else 1) * robot.model.nc,
    }  # fmt: skip
    memory = SpatialMemory.allocate(
        extents, command=guarded(np.zeros(robot.nu)), blocks=table, pushes=pushes_on(robot, ()),
        **nothing._asdict(),
    )  # fmt: skip
    settings = memory.settings
    settings.become(nothing.solver.settings)
    settings.floor, settings.effort = KNOWN_SPEED, MOST_ITERATIONS
    memory.wedge.wedged = NEVER_TOUCHED
    return memory
