"""What event-driven simulation remembers: contact modes, the step in progress, its clock."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from heelstrike.compiler.bundle import Bundle, array, cell, number, part
from heelstrike.dynamics.loops import most_rows
from heelstrike.robot.robot import Robot
from heelstrike.sim.contacts.faces import NO_FACE
from heelstrike.sim.controller.interface import Contacts
from heelstrike.sim.event_driven.continuous_extension import Extension
from heelstrike.sim.event_driven.dormand_prince import DENSE_ROWS, SLOPES
from heelstrike.sim.memory import contact_capacity, dry_joints

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


class SaddlePoint(Bundle):
    """Equations of motion and of the contacts together.

    They are solved in :mod:`heelstrike.sim.event_driven.saddle_point`.

    Attributes
    ----------
    system : (unknowns, unknowns + 1) float
    unknown, scale : (unknowns,) float
    order : (unknowns,) int
        The equations, the right-hand side last; their solution, the unit of each unknown, and their
        order. The coordinates come first, then forces.
    force : (nv,) float
    bias : (2 capacity,) float
        Known force, and acceleration of the rows of the candidates without any of the coordinates.
    mode : (capacity,) int
    impulse, velocity : (2 capacity,) float
    residual : (3,) float
        An answer of the contact solvers that is kept while a better one is looked for.
    needed, used : int
        Whether the last evaluation took these equations; whether the answer of the contact problem
        is of them.
    """

    system: Floats = array("unknowns", "unknowns + 1")
    unknown: Floats = array("unknowns")
    scale: Floats = array("unknowns")
    order: Integers = array("unknowns", of=int)
    force: Floats = array("nv")
    bias: Floats = array("2 capacity")
    mode: Integers = array("capacity", of=int)
    impulse: Floats = array("2 capacity")
    velocity: Floats = array("2 capacity")
    residual: Floats = array(3)
    needed: int = cell(int)
    used: int = cell(int)


class Phase(Bundle):
    """A smooth phase of the motion, in which every contact point keeps its mode.

    A contact point that is closed and does not slide sticks. Closed points of one link on the same
    straight piece of ground form a group, told by its first point: only the outermost two of them
    carry normal force, and one tangential force stands for all. Joint stops are numbered on from
    the contact points, joints with dry friction from these; in the shapes below nc counts all. A
    dry joint is always closed, on a contact of its own
    (:mod:`heelstrike.sim.contacts.dry_friction`), but for one that has friction of a brake alone
    (:mod:`heelstrike.sim.contacts.brakes`), which opens and closes with it.

    After all these come the second faces of the contact points, one each: contacts of their own
    on ground with concave corners, and none elsewhere.

    Attributes
    ----------
    first_dry, first_second : int
        Number of the first dry joint, and of the first second face, among the contacts.
    watched : int
        How many contacts there are on this ground.
    weight : float
        Of the robot, or its mass where there is no gravity.
    stop_joint : (ns,) int
    stop_side, stop_limit : (ns,) float
        Joint of each stop; 1 for a lower, -1 for an upper end of its range; that end.
    dry_joint : (nd,) int
        Joints that may have dry friction.
    breakaway : (nv,) float
        The most that it is of each joint in this phase.
    latch_stop : (latches,) int
        The stop that each latch is, as contacts are numbered here.
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
    face : (nc,) int
        Face of the ground that each closed contact point is on, -1 for none; the second that it
        is on, or could meet (:mod:`heelstrike.sim.event_driven.faces`).
    meets : (nc,) int
        Whether each point meets a second face in this instant, and is recorded in its frame.
    seconds : Contacts
        The contact points on their second faces; the gap is infinite where there is none.
    force : (nc, 2) float
        Contact forces of the last evaluation (N), normal and tangent, on the robot.
    end_force : (nc, 2) float
        The same at the end of the step.
    impulse : (nc, 2) float
        Impulses of the impact in this instant (N s).
    last_impact, accumulation : (nc,) float
        When each point hit the ground last; when its accumulating impacts come to rest.
    row : (forces,) int
    lean, scale : (forces,) float
    system : (forces, forces + 1) float
    unknown : (forces,) float
    column : (forces,) int
        Equations of the forces of contacts and loops: row of the Jacobian, tangential per normal
        force, unit of each, the equations themselves, their solution, and its order.
    saddle : SaddlePoint
        What they are solved with where these equations leave too few digits.
    value, rate, end_value, end_rate : (2 nc + points,) float
    before, before_rate, sample, sample_rate : (2 nc + points,) float
        Event functions, two a contact point, and their rates: at the last evaluation, at the end of
        the step, at the sample before, at this one. Of a joint stop the second is always 1, of a
        dry joint the first. On ground with corners each contact point has a third, after these.
    fired : (2 nc + points,) int
        Event functions that ended the step.
    scratch : (2, 3) float
        A place and its acceleration.
    begin, end, trial : (2 nv,) float
        State (q, v) at the start of the step, which is now; at its end; somewhere between.
    slopes : (16, 2 nv) float
    dense : (7, 2 nv) float
        Stages of the step and coefficients of its dense output.
    extension : Extension
        What is more exact than that, once there are rows within the step.
    torque : (nu,) float
        Torques at the end of the step, to see whether the controller jumps.
    time : float
        Now, s.
    next_length, length, longest : float
        Length of the next step as far as accuracy allows, of the finished one, and at most, s.
    relative, absolute : float
        Tolerances of a step.
    output_period : float
        Time between two rows of the record, zero for a row a step.
    row_every, next_row : int
        Periods, or steps, between two rows; next row, in periods.
    last_row, next_push, last_event, last_blow : float
        When the last row was, a push begins or ends next, the modes changed last, and the robot was
        hit last, s.
    burst : int
        Events since time moved on.
    started : int
        Whether the first contact modes are being, or have been, decided.
    finished, has_fired : int
        Whether a step is finished but its rows and events are not dealt with; whether it ends in an
        event.
    at_event, undecided : int
        Whether this instant is one of an event; whether the contact modes are still to be decided.
    forced, jammed : int
        Whether contact forces at their limits made it so; whether those that grow without bound.
    closed_count, deficient : int
        Closed contact points at the last evaluation; whether it found their forces ambiguous.
    left : float
        How far from its constraints the phase began, because they cannot all be met (m).
    bridging, bridges : int
        Whether this instant is left by a bridge; how many there were in the series.
    series, bridge_end : float
        When the series of bridges began, and when the last of them ended, s.
    allowance : float
        Events that are allowed for until time has moved on.
    reason : int
        Why the simulation could not go on.
    let_pass : int
        Whether swing feet may scuff without effect.
    """

    first_dry: int = number(int)
    first_second: int = number(int)
    watched: int = cell(int)
    weight: float = number(float)
    stop_joint: Integers = array("ns", of=int)
    stop_side: Floats = array("ns")
    stop_limit: Floats = array("ns")
    dry_joint: Integers = array("nd", of=int)
    breakaway: Floats = array("nv")
    latch_stop: Integers = array("latches", of=int)
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
    face: Integers = array("contacts", of=int)
    meets: Integers = array("nc", of=int)
    seconds: Contacts = part(Contacts)
    force: Floats = array("contacts", "components")
    end_force: Floats = array("contacts", "components")
    impulse: Floats = array("contacts", "components")
    last_impact: Floats = array("contacts")
    accumulation: Floats = array("contacts")
    row: Integers = array("forces", of=int)
    lean: Floats = array("forces")
    scale: Floats = array("forces")
    system: Floats = array("forces", "forces + 1")
    unknown: Floats = array("forces")
    column: Integers = array("forces", of=int)
    saddle: SaddlePoint = part(SaddlePoint)
    value: Floats = array("functions")
    rate: Floats = array("functions")
    end_value: Floats = array("functions")
    end_rate: Floats = array("functions")
    before: Floats = array("functions")
    before_rate: Floats = array("functions")
    sample: Floats = array("functions")
    sample_rate: Floats = array("functions")
    fired: Integers = array("functions", of=int)
    scratch: Floats = array("axes", 3)
    begin: Floats = array("2 nv")
    end: Floats = array("2 nv")
    trial: Floats = array("2 nv")
    slopes: Floats = array("stages", "2 nv")
    dense: Floats = array("dense_rows", "2 nv")
    extension: Extension = part(Extension)
    torque: Floats = array("nu")
    time: float = cell(float)
    next_length: float = cell(float)
    length: float = cell(float)
    longest: float = cell(float)
    relative: float = cell(float)
    absolute: float = cell(float)
    output_period: float = cell(float)
    row_every: int = cell(int)
    next_row: int = cell(int)
    last_row: float = cell(float)
    next_push: float = cell(float)
    last_event: float = cell(float)
    last_blow: float = cell(float)
    burst: int = cell(int)
    started: int = cell(int)
    finished: int = cell(int)
    has_fired: int = cell(int)
    at_event: int = cell(int)
    undecided: int = cell(int)
    forced: int = cell(int)
    jammed: int = cell(int)
    closed_count: int = cell(int)
    deficient: int = cell(int)
    left: float = cell(float)
    bridging: int = cell(int)
    bridges: int = cell(int)
    series: float = cell(float)
    bridge_end: float = cell(float)
    allowance: float = cell(float)
    reason: int = cell(int)
    let_pass: int = cell(int)


def allocate_phase(robot: Robot) -> Phase:
    """Allocate the memory of an event-driven simulation of `robot`."""
    model = robot.model
    mass, gravity = float(sum(model.mass)), np.sqrt(np.sum(model.gravity**2))
    lower = np.flatnonzero(np.isfinite(model.lower))
    upper = np.flatnonzero(np.isfinite(model.upper))
    dry = dry_joints(model)
    firsts, loops = contact_capacity(robot), most_rows(model)
    contacts = firsts + robot.nc
    forces = 2 * contacts + loops
    saddle = SaddlePoint.allocate(
        unknowns=model.nv + forces, nv=model.nv, capacity=contacts + loops
    )
    return Phase.allocate(
        model.extents, ns=len(lower) + len(upper), nd=len(dry), contacts=contacts, components=2,
        forces=forces, saddle=saddle, functions=2 * contacts + robot.nc,
        stages=SLOPES, dense_rows=DENSE_ROWS, first_dry=firsts - len(dry),
        first_second=firsts, watched=firsts,
        weight=mass * gravity if gravity > 0.0 else mass,
        stop_joint=np.concatenate((lower, upper)).astype(np.int64),
        stop_side=np.concatenate((np.ones(len(lower)), -np.ones(len(upper)))),
        stop_limit=np.concatenate((model.lower[lower], model.upper[upper])),
        dry_joint=dry,
        latch_stop=np.array(
            [
                robot.nc
                + (
                    len(lower) + int(np.searchsorted(upper, joint))
                    if side > 0
                    else int(np.searchsorted(lower, joint))
                )
                for joint, side in zip(model.latch_joint, model.latch_side, strict=True)
            ],
            dtype=np.int64,
        ),
        last_impact=np.full(contacts, -np.inf),
        accumulation=np.full(contacts, np.inf),
        value=np.ones(2 * contacts + robot.nc), face=np.full(contacts, NO_FACE),
        seconds=Contacts.allocate(
            {**model.extents, "components": 2}, gap=np.full(robot.nc, np.inf)
        ),
    )  # fmt: skip
