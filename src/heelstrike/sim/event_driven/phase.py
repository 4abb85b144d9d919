"""What event-driven simulation remembers: contact modes, the step in progress, its clock."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from heelstrike.compiler.bundle import Bundle, array
from heelstrike.robot.robot import Robot
from heelstrike.sim.event_driven.dormand_prince import DENSE_ROWS, SLOPES

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

# Places in ``Phase.clock``, in seconds unless something else is said.
TIME = 0  # now
STEP = 1  # length of the next step as far as accuracy allows
LENGTH = 2  # length of the finished step whose rows are still to be written
END = 3  # when the simulation ends
PAUSE = 4  # when to pause
OUTPUT_PERIOD = 5  # between two rows of the record; 0 for a row a step
SAMPLE_PERIOD = 6  # between two calls of the controller; 0 for always
LONGEST = 7  # longest step
LAST_EVENT = 8  # when the modes changed last
LAST_IMPACT = 9  # when the robot was hit last
RELATIVE = 10
ABSOLUTE = 11
FALLEN = 12  # height of the centre of mass below which the robot has fallen, m
LAST_ROW = 13  # time of the last row of the record
NEXT_PUSH = 14  # when a push begins or ends next
CLOCKS = 15

# Places in ``Phase.count``.
STARTED = 0  # whether the first contact modes are being, or have been, decided
FINISHED = 1  # whether a step is finished but its rows and events are not dealt with
FIRED = 2  # whether the finished step ends in an event
CLOSED = 3  # closed contact points at the last evaluation
DEFICIENT = 4  # whether the last evaluation found them ambiguous
ROW = 5  # next row of the record, in output periods
ROW_EVERY = 6  # steps between two rows
SAMPLE = 7  # next call of the controller, in sample periods
PAUSE_STEP = 8  # steps after which to pause
BURST = 9  # events since time moved on
REASON = 10  # why the loop gave up
UNDECIDED = 11  # whether the contact modes are still to be decided
FORCED = 12  # whether contact forces at their limits made it so
JAMMED = 13  # whether it was forces that grow without bound
LET_PASS = 14  # whether swing feet may scuff without effect
COUNTS = 15


class Phase(Bundle):
    """A smooth phase of the motion, in which every contact point keeps its mode.

    A contact point that is closed and does not slide sticks. Closed points of one link on the same
    straight piece of ground form a group, told by its first point: only the outermost two of them
    carry normal force, and one tangential force stands for all. Joint stops are numbered on from
    the contact points, joints with dry friction from these; in the shapes below nc counts all. A
    dry joint is always closed, on a contact of its own (:mod:`heelstrike.sim.dry_friction`).

    Attributes
    ----------
    stop_joint : (ns,) int
    stop_side, stop_limit : (ns,) float
        Joint of each stop; 1 for a lower, -1 for an upper end of its range; that end.
    dry_joint : (nd,) int
        Joints with dry friction.
    order : (3,) int
        Contact solvers in the order in which they are tried.
    closed : (nc,) int
        Whether each contact point is on the ground, each joint at its stop.
    slide : (nc,) int
        Direction in which it slides along the tangent, or the joint turns: -1, 0 or 1.
    group : (nc,) int
        First contact point of its group.
    carrier, holder : (nc,) int
        Whether its normal force, and its tangential force, are unknowns.
    stuck : (nc,) int
    anchor : (nc,) float
        Whether a point has a place where it began to stick, and that place along the tangent.
    hit, plastic : (nc,) int
        Points that reach the ground in this instant; those whose rebound is too short to follow.
    passing : (nc,) int
        Points of a swing leg below the ground that are let pass.
    force : (nc, 2) float
        Contact forces of the last evaluation (N), normal and tangent, on the robot.
    end_force : (nc, 2) float
        The same at the end of the step.
    impulse : (nc, 2) float
        Impulses of the impact in this instant (N s).
    last_impact, accumulation : (nc,) float
        When each point hit the ground last; when its accumulating impacts come to rest.
    row : (2 nc,) int
    lean : (2 nc,) float
    system : (2 nc, 2 nc + 1) float
    unknown : (2 nc,) float
    column : (2 nc,) int
        Equations of the contact forces: row of the Jacobian, tangential per normal force, the
        equations themselves, their solution, and its order.
    value, rate, end_value, end_rate : (2 nc,) float
    before, before_rate, sample, sample_rate : (2 nc,) float
        Event functions, two a contact point, and their rates: at the last evaluation, at the end of
        the step, at the sample before, at this one. Of a joint stop the second is always 1, of a
        dry joint the first.
    fired : (2 nc,) int
        Event functions that ended the step.
    scratch : (2, 3) float
        A place and its acceleration.
    begin, end, trial : (2 nv,) float
        State (q, v) at the start of the step, which is now; at its end; somewhere between.
    slopes : (16, 2 nv) float
    dense : (7, 2 nv) float
        Stages of the step and coefficients of its dense output.
    torque : (nu,) float
        Torques at the end of the step, to see whether the controller jumps.
    clock : (15,) float
    count : (15,) int
        Their places are module constants.
    """

    stop_joint: Integers = array("ns", of=int)
    stop_side: Floats = array("ns")
    stop_limit: Floats = array("ns")
    dry_joint: Integers = array("nd", of=int)
    order: Integers = array(3, of=int)
    closed: Integers = array("contacts", of=int)
    slide: Integers = array("contacts", of=int)
    group: Integers = array("contacts", of=int)
    carrier: Integers = array("contacts", of=int)
    holder: Integers = array("contacts", of=int)
    stuck: Integers = array("contacts", of=int)
    anchor: Floats = array("contacts")
    hit: Integers = array("contacts", of=int)
    plastic: Integers = array("contacts", of=int)
    passing: Integers = array("contacts", of=int)
    force: Floats = array("contacts", "rows")
    end_force: Floats = array("contacts", "rows")
    impulse: Floats = array("contacts", "rows")
    last_impact: Floats = array("contacts")
    accumulation: Floats = array("contacts")
    row: Integers = array("2 contacts", of=int)
    lean: Floats = array("2 contacts")
    system: Floats = array("2 contacts", "2 contacts + 1")
    unknown: Floats = array("2 contacts")
    column: Integers = array("2 contacts", of=int)
    value: Floats = array("2 contacts")
    rate: Floats = array("2 contacts")
    end_value: Floats = array("2 contacts")
    end_rate: Floats = array("2 contacts")
    before: Floats = array("2 contacts")
    before_rate: Floats = array("2 contacts")
    sample: Floats = array("2 contacts")
    sample_rate: Floats = array("2 contacts")
    fired: Integers = array("2 contacts", of=int)
    scratch: Floats = array("axes", 3)
    begin: Floats = array("2 nv")
    end: Floats = array("2 nv")
    trial: Floats = array("2 nv")
    slopes: Floats = array("stages", "2 nv")
    dense: Floats = array("dense_rows", "2 nv")
    torque: Floats = array("nu")
    clock: Floats = array("clocks")
    count: Integers = array("counts", of=int)


def allocate_phase(robot: Robot) -> Phase:
    """Allocate the memory of an event-driven simulation of `robot`."""
    model, nv, nu = robot.model, robot.nv, robot.nu
    lower = np.flatnonzero(np.isfinite(model.lower))
    upper = np.flatnonzero(np.isfinite(model.upper))
    dry = np.flatnonzero(model.dry_friction > 0.0)
    nc = robot.nc + len(lower) + len(upper) + len(dry)
    return Phase.allocate(
        nv=nv, nu=nu, ns=len(lower) + len(upper), nd=len(dry), contacts=nc, axes=2, rows=2,
        stages=SLOPES, dense_rows=DENSE_ROWS, clocks=CLOCKS, counts=COUNTS,
        stop_joint=np.concatenate((lower, upper)).astype(np.int64),
        stop_side=np.concatenate((np.ones(len(lower)), -np.ones(len(upper)))),
        stop_limit=np.concatenate((model.lower[lower], model.upper[upper])),
        dry_joint=dry.astype(np.int64),
        closed=(np.arange(nc) >= nc - len(dry)).astype(np.int64),
        last_impact=np.full(nc, -np.inf),
        accumulation=np.full(nc, np.inf),
        value=np.ones(2 * nc),
    )  # fmt: skip
