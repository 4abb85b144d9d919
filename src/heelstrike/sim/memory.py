"""Everything the compiled loop writes to, allocated before it starts."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from heelstrike.compiler.bundle import Bundle, array, cell, part
from heelstrike.compiler.mold import Mold
from heelstrike.contact.modes import STICK
from heelstrike.contact.solvers.certified_solve import contact_workspace
from heelstrike.contact.workspace import (
    PROGRAM_ROWS,
    ContactAnswer,
    ContactProblem,
    ContactWorkspace,
    contact_problem,
)
from heelstrike.dynamics.articulated import ArticulatedBodies
from heelstrike.dynamics.loops import LoopRows
from heelstrike.dynamics.workspace import Workspace
from heelstrike.once_each import once_each
from heelstrike.robot.model import Floats, Integers
from heelstrike.robot.robot import Robot
from heelstrike.sim.contacts.constraint import friction_of
from heelstrike.sim.contacts.rows import (
    BRAKE,
    CONSTRAINT,
    DRY_JOINT,
    LOOP,
    POINT,
    SECOND_FACE,
    Rows,
    lay_out_rows,
    most_rows,
)
from heelstrike.sim.contacts.straight_line import (
    room_of,
    straight_line_programs,
    usual_points,
)
from heelstrike.sim.contacts.writers import lay_out_ties
from heelstrike.sim.controller.guard import guarded
from heelstrike.sim.controller.interface import Contacts
from heelstrike.sim.push import Push, Pushes, pushes_on


class CommonTally(Bundle):
    """Counts and worst values of a simulation, in the plane or in space."""

    steps: int = cell(int)
    saturations: int = cell(int)
    """steps, saturations: Steps taken; commands that motors or their limits did not let through."""
    bad_torque: int = cell(int)
    """Actuator whose torque was not finite."""
    bad_trial: int = cell(int)
    """One more than the actuator whose torque was not finite when asked for within a step."""
    penetration: float = cell(float)
    """Deepest penetration of a contact point (m)."""


class Tally(CommonTally):
    """Counts and worst values of a simulation, over every step, recorded or not."""

    complementarity: float = cell(float)
    cone: float = cell(float)
    non_penetration: float = cell(float)
    """complementarity, cone, non_penetration: Largest residuals of the contact problems."""
    energy_gain: float = cell(float)
    """Kinetic energy that restitution made (J)."""


class Equations(Bundle):
    """The equations of motion of a state, and what their mass matrix is solved with.

    A short robot's programs leave a factor of the mass matrix behind, a long one's loops
    articulated bodies; see :mod:`heelstrike.sim.contacts.straight_line`.
    """

    tree: Workspace = part(Workspace)
    """Kinematics."""
    bias: Floats = array("nv")
    """Bias force H."""
    mass_matrix: Floats = array("nv", "nv")
    factor: Floats = array("nv", "nv")
    """mass_matrix, factor: Mass matrix and its factor."""
    added: Floats = array("nv")
    """What an implicit scheme adds to the diagonal of the mass matrix."""
    bodies: ArticulatedBodies = part(ArticulatedBodies)
    """What the loops solve with instead of the factor."""
    programs: Integers = array("programs", of=int, address=True)
    """Addresses of straight-line code, zero for none."""
    force: Floats = array("nv")
    rate: Floats = array("nv")
    """force, rate: Generalised force without contact, and the acceleration from it; scratch."""


class Surface(Bundle):
    """What the ground is like under each contact."""

    friction: Floats = array("capacity")
    restitution: Floats = array("capacity")
    """friction, restitution: Of contact points and their second faces; of joint stops zero, of
    constraints their own, and friction 1 of dry joints and what else rubs. Numbered by the table of
    rows."""
    curvature: Floats = array("nc")
    """Curvature (1/m) of the way along the ground of the centre of each contact point's disc,
    positive over a hill: zero but on smooth ground."""


class Directions(Bundle):
    """The directions along which candidates act."""

    jacobian: Floats = array("2 capacity", "nv")
    """Contact Jacobian of the candidates."""
    leaf: Integers = array("capacity", of=int)
    """Link that each candidate acts on: only its joint and those before have a part in its rows;
    ``EVERYWHERE`` for one that acts on several."""
    root: Floats = array("nv")
    half: Floats = array("nv", "2 capacity")
    """D^(-1/2) and D^(-1/2) L⁻ᵀ Jᵀ, with A = Lᵀ D L."""


class Assembly(Bundle):
    """The contact problem of an instant, how it is put together, and its answer."""

    candidate: Integers = array("capacity", of=int)
    """Entries of the table of rows that take part, kind by kind. The capacity has room for all."""
    begin: Integers = array("kinds", of=int)
    until: Integers = array("kinds", of=int)
    """begin, until: Places of the first candidate of each kind, and of the one after its last."""
    directions: Directions = part(Directions, flat=True)
    """Along what they act."""
    problem: ContactProblem = part(ContactProblem)
    """The contact problem of the candidates."""
    answer: ContactAnswer = part(ContactAnswer)
    """Its solution."""


class UsualPoints(Bundle):
    """The contact points that straight-line programs are for, and what these work on."""

    usual_problem: ContactProblem = part(ContactProblem)
    """The contact problem with the matrix of these points."""
    usual_points: Integers = array("points", of=int)
    """Which they are."""
    usual_place: Integers = array("nc", of=int)
    """Place of each contact point among them, -1 for none."""
    every_point: Integers = array("nc", of=int)
    """All contact points."""
    point_rows: Floats = array("2 points", "nv")
    """Scratch of the Delassus matrix."""
    point_velocity: Floats = array("nc", "components")
    point_impulse: Floats = array("nc", "components")
    """point_velocity, point_impulse: Velocities and impulses of contact points."""
    programs: Integers = array("programs", of=int, address=True)
    """Addresses of straight-line code, those of the equations of motion."""


class Reaction(Bundle):
    """What contacts and joints did in the last solve, beside the contact forces."""

    slip: Floats = array("nc")
    """Tangential velocity of each contact point at the end of the step."""
    mode: Integers = array("capacity", of=int)
    """Contact mode, the guess of the next solve; numbered by the table of rows."""
    stop_torque: Floats = array("nv")
    friction_torque: Floats = array("nv")
    """stop_torque, friction_torque: Generalised forces of joint stops and of dry joint friction."""


class Loops(Bundle):
    """What holds besides the joints: closed loops, coupled joints, latches, brakes and ties."""

    rows: LoopRows = part(LoopRows)
    """Their equations in the state now."""
    response: Floats = array("loop_rows", "nv")
    """What a unit force of each does to the coordinates."""
    system: Floats = array("loop_rows", "loop_rows + 1")
    unknown: Floats = array("loop_rows")
    order: Integers = array("loop_rows", of=int)
    """Equations of the forces where there is no contact problem, their solution, and its order."""
    loop_force: Floats = array("loops", "axes")
    coupling_force: Floats = array("couplings")
    """Forces of the last solve."""
    multiple: Floats = array("loops", "axes")
    """What a row of each loop is of the other, where both say the same; see
    :func:`heelstrike.sim.contacts.loops.leave_one`."""
    entry: Integers = array("loop_rows", of=int)
    """Which entry of the table of rows each row is now."""
    held: Integers = array("latches", of=int)
    """Whether each latch is engaged."""
    braked: Integers = array("brakes", of=int)
    """Whether each brake is on; see :mod:`heelstrike.sim.contacts.brakes`."""
    brake_entry: Integers = array("brakes", of=int)
    """Which entry of the table of rows each brake is."""
    brake_position: Floats = array("brakes")
    """Where those that are on hold their joints (rad, m)."""
    brake_force: Floats = array("brakes")
    """What they held them with in the last solve."""
    tie: Integers = array("ties", 3, of=int, address=True)
    """Of each constraint that never lets go where its machine code is, and its numbers; and how
    many rows it has."""
    constraint_force: Floats = array("constraints", "components")
    """Forces of all constraints along their rows in the last solve."""


class Reported(Bundle):
    """The contact modes that events have told of.

    Attributes
    ----------
    Those of (capacity,) are numbered by the table of rows.
    """

    closed: Integers = array("capacity", of=int)
    slipping: Integers = array("capacity", of=int)
    """closed, slipping: Whether each contact point is on the ground, and whether it slips."""
    stopped: Integers = array("nv", of=int)
    """Whether each joint pressed against a stop."""
    resting: Integers = array("capacity", of=int)
    """Whether each dry joint was at rest, -1 before the first report."""

    def forget(self) -> None:
        """Be as at the beginning."""
        for each in (self.closed, self.slipping, self.stopped):
            each[:] = 0
        self.resting[:] = -1


class Memory(Bundle):
    """State of a simulation and all that its kernels write to, in the bundles that they receive.

    Flat parts are stored under the names of their members: files do not know of the bundles.
    """

    q: Floats = array("nq")
    v: Floats = array("nv")
    """q, v: Position and velocity now."""
    next_v: Floats = array("nv")
    """Velocity at the end of the step."""
    command: Floats = array("nu")
    """What the controller asks for: torques, or voltages as parts of the full one."""
    torque: Floats = array("nu")
    """What acts of it; see :mod:`heelstrike.sim.controller.motors`."""
    stiffness: Floats = array("nv")
    damping: Floats = array("nv")
    """stiffness, damping: Gains of joint springs, dampers and controller that an implicit scheme
    takes at the end of the step (N m, N m s)."""
    breakaway: Floats = array("nv")
    """The most that dry friction is of each joint now (N m, N)."""
    rows: Rows = part(Rows, address=True)
    """The table of all that may hold the robot."""
    equations: Equations = part(Equations, flat=True)
    """Equations of motion of the state now."""
    contacts: Contacts = part(Contacts)
    """Contact points now; their forces are those of the last solve."""
    second_faces: Contacts = part(Contacts)
    """The same points on their second faces, in concave corners."""
    surface: Surface = part(Surface, flat=True)
    """The ground under them."""
    assembly: Assembly = part(Assembly, flat=True)
    """The contact problem."""
    small_problem: ContactProblem = part(ContactProblem)
    """The contact problem in as little room as programs ask for."""
    solver: ContactWorkspace = part(ContactWorkspace)
    """Memory of the contact solvers."""
    usual: UsualPoints = part(UsualPoints, flat=True)
    """What straight-line programs make it of."""
    reaction: Reaction = part(Reaction, flat=True)
    """What else came of it."""
    loops: Loops = part(Loops)
    """What holds between coordinates."""
    reported: Reported = part(Reported, flat=True)
    """What events have told of it."""
    pushes: Pushes = part(Pushes)
    """Forces from outside."""
    tally: Tally = part(Tally)
    """Counts and worst values of the run."""


def allocate_memory(robot: Robot, pushes: Sequence[Push] = ()) -> Memory:
    """Allocate the memory of a simulation of `robot`."""
    memory = _mold_of(robot).cast()
    return memory.replaced(pushes=pushes_on(robot, pushes)) if pushes else memory


def _contacts_of(kind: int, rows: Rows, extents: dict[str, int]) -> Contacts:
    """Return the contact points on one of their faces, whose places are those of the table."""
    its = slice(rows.first[kind], rows.end[kind])
    gap, position, normal = rows.gap[its], rows.position[its], rows.normal[its]
    return Contacts.allocate(extents, gap=gap, position=position, normal=normal)


def _in_room(problem: ContactProblem, rows: int) -> ContactProblem:
    """Return a contact problem with the arrays of another, but a matrix of its own."""
    shared = {
        name: getattr(problem, name) for name in ("first", "free", "friction", "bound", "set")
    }
    return contact_problem(len(problem.set), room=rows, **shared)


@once_each
def _mold_of(robot: Robot) -> Mold[Memory]:
    nc, model = robot.nc, robot.model
    rows = lay_out_rows(robot)
    points = usual_points(robot)
    place = np.full(nc, -1)
    place[points] = np.arange(len(points))
    most = len(rows.kind)
    extents = {
        **model.extents, "kinds": len(rows.first), "capacity": most,
        "points": len(points), "components": 2, "loop_rows": most_rows(robot),
    }  # fmt: skip
    programs = straight_line_programs(model, points)
    assembly = Assembly.allocate(
        extents,
        problem=contact_problem(most),
        answer=ContactAnswer.allocate(capacity=most),
    )
    problem = assembly.problem
    memory = Memory.allocate(
        extents,
        command=guarded(np.zeros(robot.nu)),
        breakaway=model.dry_friction.copy(),
        rows=rows,
        equations=Equations.allocate(extents, programs=programs),
        contacts=_contacts_of(POINT, rows, extents),
        second_faces=_contacts_of(SECOND_FACE, rows, extents),
        assembly=assembly,
        small_problem=_in_room(problem, PROGRAM_ROWS),
        solver=contact_workspace(max(most, 1), ready=False),  # loops make it ready
        usual=UsualPoints.allocate(
            extents,
            usual_problem=_in_room(problem, room_of(len(points))),
            usual_points=points,
            programs=programs,
            usual_place=place,
            every_point=np.arange(nc),
        ),
        loops=Loops.allocate(
            extents, constraints=len(robot.constraints), tie=lay_out_ties(robot),
            entry=np.arange(rows.first[LOOP], most),
            brake_entry=np.arange(rows.first[BRAKE], rows.end[BRAKE]),
        ),
        pushes=pushes_on(robot, ()),
    )  # fmt: skip
    memory.surface.friction[rows.first[DRY_JOINT] : rows.end[DRY_JOINT]] = 1.0
    for entry in range(rows.first[CONSTRAINT], rows.end[CONSTRAINT]):
        constraint = robot.constraints[rows.owner[entry]]
        memory.surface.restitution[entry] = constraint.restitution
        memory.surface.friction[entry] = friction_of(constraint)
    memory.reaction.mode[rows.first[LOOP] :] = STICK
    memory.reported.resting[:] = -1
    return Mold(memory)
