"""The table of rows: all that may hold a robot, kind by kind, numbered once for every method.

Whatever acts on the robot from outside its tree of joints brings rows to the contact problem, with
a set in which their impulses lie (:mod:`heelstrike.contact.sets`)::

    kind           set         components   owner          gap
    POINT          cone        2            contact point  to the nearest face of the ground
    STOP           half-line   1            joint          to that end of its range
    CONSTRAINT     its own     1 or 2       constraint     as its kernel says, or none
    DRY_JOINT      interval    2            joint          none
    SECOND_FACE    cone        2            contact point  to the other face of a concave corner
    LOOP           line        1            closed loop    none: along x, then along z
    COUPLING       line        1            coupled joint  none
    TIE            line        1            constraint     none: row by row
    BRAKE          line        1            brake          none

The table is laid out before a simulation begins. An entry is whatever has one gap and one set; its
number is its place in the table, and nothing else: what it is, and of what, is looked up. Kernels
go kind by kind, ``for stop in range(rows.first[STOP], rows.end[STOP])``, so that a kind that a
robot does not have costs nothing. Contact points come first: theirs are the same numbers as those
in ``Contacts``. Constraints from outside (:mod:`heelstrike.sim.contacts.constraint`) are entries
like all others: ``TIE`` those that never let go, which are among the rows of the loops,
``CONSTRAINT`` the rest. A latch is no kind of its own: while it holds, the set of its stop is the
line.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from heelstrike.compiler.bundle import Bundle, array, part
from heelstrike.compiler.compilation import dissolved_kernel
from heelstrike.contact.sets import CONE, HALF_LINE, INTERVAL, LINE, components_of
from heelstrike.dynamics.loops import count_rows
from heelstrike.field_texts import dataclass
from heelstrike.robot.model import Model
from heelstrike.robot.robot import Robot
from heelstrike.sim.contacts.constraint import is_line, line_rows
from heelstrike.sim.contacts.writers import Writers, kernels_of

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

POINT, STOP, CONSTRAINT, DRY_JOINT, SECOND_FACE, LOOP, COUPLING, TIE, BRAKE = range(9)


@dataclass(frozen=True)
class Kind:
    """What entries of a kind have in common."""

    name: str
    set: int
    """Where their impulses lie; of constraints each has its own."""


KINDS = (
    Kind("contact point", CONE),
    Kind("joint stop", HALF_LINE),
    Kind("constraint", HALF_LINE),
    Kind("dry joint", INTERVAL),
    Kind("second face", CONE),
    Kind("loop", LINE),
    Kind("coupling", LINE),
    Kind("tie", LINE),
    Kind("brake", LINE),
)


class Rows(Bundle):
    """The table of rows of a robot."""

    first: Integers = array("kinds", of=int)
    end: Integers = array("kinds", of=int)
    """first, end: The first entry of each kind, and the one after its last."""
    set: Integers = array("entries", of=int)
    """Where impulses of each entry lie."""
    components: Integers = array("entries", of=int)
    """How many rows each brings to a contact problem. The first of an interval is the solvers'."""
    kind: Integers = array("entries", of=int)
    owner: Integers = array("entries", of=int)
    """kind, owner: What each entry is, and of what: the contact point, joint, constraint, loop,
    coupling or brake."""
    side: Floats = array("entries")
    """1 for the lower, -1 for the upper end of a joint's range; 1 for all other entries."""
    limit: Floats = array("entries")
    """Position of the joint at that end (rad, m); the most that a constraint rubs (N, N m)."""
    axis: Integers = array("entries", of=int)
    """0 for the row along x, 1 for the row along z of a loop; the row of a tie; 0 for all other
    entries."""
    gap: Floats = array("entries")
    """How far each is from what would hold it (m, rad), infinite if it has no gap: of points and
    second faces as they were located last, of stops as somebody wrote it."""
    position: Floats = array("entries", "axes")
    normal: Floats = array("entries", "axes")
    """position, normal: Where each contact point is on its face, and the normal of that, of points
    and second faces as they were located last."""
    latch_stop: Integers = array("latches", of=int)
    """The stop that each latch is."""
    outside: Writers = part(Writers)
    """The constraints, and what the kernels of those that may let go wrote last."""


def dry_joints(model: Model) -> Integers:
    """Return the joints that may have dry friction, of their own or of a brake that slips."""
    slipping = model.brake_joint[np.isfinite(model.brake_limit)]
    return np.union1d(np.flatnonzero(model.dry_friction > 0.0), slipping).astype(np.int64)


def contact_components(robot: Robot) -> list[int]:
    """Return the components of all entries but those that never let go, which come last."""
    model = robot.model
    stops = np.isfinite(model.lower).sum() + np.isfinite(model.upper).sum()
    let_go = [components_of(each.set) for each in robot.constraints if not is_line(each)]
    return 2 * model.nc * [2] + int(stops) * [1] + let_go + len(dry_joints(model)) * [2]


def most_rows(robot: Robot) -> int:
    """Return how many rows never let go while all brakes are on."""
    return count_rows(robot.model) + line_rows(robot) + robot.model.brakes


@dissolved_kernel
def is_of_ground(entry: int, rows: Rows) -> bool:
    """Whether an entry is a contact point, on either face."""
    return bool(rows.kind[entry] == POINT or rows.kind[entry] == SECOND_FACE)


@dissolved_kernel
def second_of(point: int, rows: Rows) -> int:
    """Entry of the second face of a contact point."""
    return int(rows.first[SECOND_FACE] + point)


def lay_out_rows(robot: Robot) -> Rows:
    """Lay the table of a robot out."""
    model, outside = (
        robot.model,
        Writers.allocate(constraints=len(robot.constraints), nv=robot.nv, kernel=kernels_of(robot)),
    )
    lines = [i for i, each in enumerate(robot.constraints) if is_line(each)]
    others = [i for i, each in enumerate(robot.constraints) if not is_line(each)]
    count = np.array([robot.constraints[i].components for i in lines], dtype=np.int64)
    ends = np.column_stack((model.lower, model.upper))
    joint, upper = np.nonzero(np.isfinite(ends))
    points = np.arange(model.nc)
    owners = (
        points, joint, np.array(others, dtype=np.int64), dry_joints(model), points,
        np.repeat(np.arange(model.loops), 2), np.arange(model.couplings),
        np.repeat(np.array(lines, dtype=np.int64), count), np.arange(model.brakes),
    )  # fmt: skip
    sizes = [len(owner) for owner in owners]
    end = np.cumsum(sizes)
    first = end - sizes
    stops = slice(first[STOP], end[STOP])
    rows = Rows.allocate(
        kinds=len(KINDS),
        entries=int(end[-1]),
        latches=model.latches,
        axes=model.axes,
        first=first,
        end=end,
        set=np.repeat([kind.set for kind in KINDS], sizes),
        outside=outside,
        kind=np.repeat(np.arange(len(KINDS)), sizes),
        owner=np.concatenate(owners).astype(np.int64),
        latch_stop=first[STOP]
        + np.searchsorted(2 * joint + upper, 2 * model.latch_joint + (model.latch_side > 0)),
    )
    rows.side[:] = 1.0
    rows.side[stops] = 1.0 - 2.0 * upper
    rows.limit[stops] = ends[joint, upper]
    rows.set[first[CONSTRAINT] : end[CONSTRAINT]] = [robot.constraints[i].set for i in others]
    rows.limit[first[CONSTRAINT] : end[CONSTRAINT]] = [robot.constraints[i].bound for i in others]
    rows.components[:] = [components_of(each) for each in rows.set]
    rows.axis[first[LOOP] : end[LOOP]] = np.tile((0, 1), model.loops)
    rows.axis[first[TIE] : end[TIE]] = [row for each in count for row in range(each)]
    rows.gap[:] = np.inf
    return rows
