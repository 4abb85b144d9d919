"""What event-driven simulation remembers: contact modes, the step in progress, its clock.

A bundle a purpose, each with the scratch of its own kernels. Contacts are numbered by the table of
rows (:mod:`heelstrike.sim.contacts.rows`): points, joint stops, joints with dry friction, second
faces. In the shapes below ``contacts`` counts all of these.

A dry joint is always closed, on a contact of its own (:mod:`heelstrike.sim.contacts.dry_friction`),
but for one that has friction of a brake alone (:mod:`heelstrike.sim.contacts.brakes`), which opens
and closes with it. The second faces are contacts of their own on ground with concave corners, and
none elsewhere.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from heelstrike.compiler.bundle import Bundle, array, cell, part
from heelstrike.dynamics.loops import most_rows
from heelstrike.robot.robot import Robot
from heelstrike.sim.contacts.faces import NO_FACE
from heelstrike.sim.contacts.rows import contact_count
from heelstrike.sim.event_driven.continuous_extension import Extension
from heelstrike.sim.event_driven.dormand_prince import DENSE_ROWS, SLOPES

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


class Modes(Bundle):
    """What every contact does in this phase.

    A contact point that is closed and does not slide sticks. Closed points of one link on the same
    straight piece of ground form a group, told by its first point: only the outermost two of them
    carry normal force, and one tangential force stands for all.

    Attributes
    ----------
    watched : int
        How many contacts there are on this ground: all, or those before the second faces.
    closed : (contacts,) int
        Whether each contact point is on the ground, each joint at its stop.
    slide : (contacts,) int
        Direction in which it slides along the tangent, or the joint turns: -1, 0 or 1.
    group : (contacts,) int
        First contact point of its group.
    carrier, holder : (contacts,) int
        Whether its normal force, and its tangential force, are unknowns.
    stuck : (contacts,) int
    anchor : (contacts,) float
        Whether a point has a place where it began to stick, and that place along the tangent.
    passing : (contacts,) int
        Points of a swing leg below the ground that are let pass.
    let_pass : int
        Whether swing feet may scuff without effect.
    breakaway : (nv,) float
        The most that dry friction is of each joint in this phase.
    """

    watched: int = cell(int)
    closed: Integers = array("contacts", of=int)
    slide: Integers = array("contacts", of=int)
    group: Integers = array("contacts", of=int)
    carrier: Integers = array("contacts", of=int)
    holder: Integers = array("contacts", of=int)
    stuck: Integers = array("contacts", of=int)
    anchor: Floats = array("contacts")
    passing: Integers = array("contacts", of=int)
    let_pass: int = cell(int)
    breakaway: Floats = array("nv")


class Faces(Bundle):
    """On which faces of the ground contact points are.

    Attributes
    ----------
    face : (contacts,) int
        Face of the ground that each closed contact point is on, -1 for none; the second that it
        is on, or could meet (:mod:`heelstrike.sim.event_driven.faces`).
    paired : int
        Whether the ground has concave corners, where points have second faces.
    place : (3,) float
        Scratch of :func:`~heelstrike.sim.event_driven.smooth.faces.choose_faces`.
    center, acceleration : (3,) float
        Scratch of :func:`~heelstrike.sim.event_driven.smooth.gaps.free_gap_acceleration`.
    """

    face: Integers = array("contacts", of=int)
    paired: int = cell(int)
    place: Floats = array(3)
    center: Floats = array(3)
    acceleration: Floats = array(3)


class Watch(Bundle):
    """Event functions, of which the first to vanish ends the phase.

    There are two a contact. Of a joint stop the second is always 1, of a dry joint the first. On
    ground with corners each contact point has a third, after these.

    Attributes
    ----------
    value, rate : (functions,) float
        Event functions and their rates at the last evaluation.
    fired : (functions,) int
        Event functions that ended the step.
    weight : float
        Of the robot, or its mass where there is no gravity: what forces are small or large beside.
    center : (3,) float
        Scratch of :func:`~heelstrike.sim.event_driven.smooth.faces.rate_corners`.
    """

    value: Floats = array("functions")
    rate: Floats = array("functions")
    fired: Integers = array("functions", of=int)
    weight: float = cell(float)
    center: Floats = array(3)


class Samples(Bundle):
    """Event functions and their rates at some places in a step, between which they may vanish.

    Attributes
    ----------
    before, before_rate : (functions,) float
        At the sample before.
    sample, sample_rate : (functions,) float
        At this one.
    end_value, end_rate : (functions,) float
        At the end of the step.
    state, slope : (2 nv,) float
        Scratch of :func:`~heelstrike.sim.event_driven.location.evaluate_within`.
    """

    end_value: Floats = array("functions")
    end_rate: Floats = array("functions")
    before: Floats = array("functions")
    before_rate: Floats = array("functions")
    sample: Floats = array("functions")
    sample_rate: Floats = array("functions")
    state: Floats = array("2 nv")
    slope: Floats = array("2 nv")


class Forces(Bundle):
    """The forces that keep the modes.

    Attributes
    ----------
    force : (contacts, 2) float
        Contact forces of the last evaluation (N), normal and tangent, on the robot.
    count, deficient : int
        Closed contact points at the last evaluation; whether it found their forces ambiguous.
    solvers : (3,) int
        Contact solvers in the order in which they are tried.
    """

    force: Floats = array("contacts", "components")
    count: int = cell(int)
    deficient: int = cell(int)
    solvers: Integers = array(3, of=int)


class HeldRows(Bundle):
    """Rows along which closed contacts and loops are held, and the equations of their forces.

    Attributes
    ----------
    row : (rows,) int
        Row of the Jacobian that each unknown force acts along.
    lean, scale : (rows,) float
        Tangential force that it brings along; its unit.
    system : (rows, rows + 1) float
    unknown : (rows,) float
    column : (rows,) int
        The equations, their solution, and its order.
    presses : (rows,) int
        Whether it can press only: scratch, where the forces are ambiguous.
    """

    row: Integers = array("rows", of=int)
    lean: Floats = array("rows")
    scale: Floats = array("rows")
    system: Floats = array("rows", "rows + 1")
    unknown: Floats = array("rows")
    column: Integers = array("rows", of=int)
    presses: Integers = array("rows", of=int)


class SaddlePoint(Bundle):
    """Equations of motion and of the contacts together, where those of the forces lose digits.

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
    rate : (nv,) float
        Scratch of :func:`~heelstrike.sim.event_driven.smooth.saddle_point.state_accelerations`.
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
    rate: Floats = array("nv")
    mode: Integers = array("capacity", of=int)
    impulse: Floats = array("2 capacity")
    velocity: Floats = array("2 capacity")
    residual: Floats = array(3)
    needed: int = cell(int)
    used: int = cell(int)


class Step(Bundle):
    """The step from now on, of the method of Dormand and Prince.

    Attributes
    ----------
    time, begin : float, (2 nv,) float
        Now (s), and the state (q, v) now, at the start of the step.
    slopes : (16, 2 nv) float
        Rates of the state at its stages; the first is that of now.
    point : (2 nv,) float
        State at a stage; scratch.
    end : (2 nv,) float
        State at its end.
    unsettled : (2 nv,) float
        The same before it is put on its constraints; scratch.
    dense : (7, 2 nv) float
        Coefficients of its dense output.
    extension : Extension
        What is more exact than that, once there are rows within the step.
    end_force : (contacts, 2) float
        Contact forces at its end (N).
    torque : (nu,) float
        Torques at its end, to see whether the controller jumps.
    length, next_length, longest : float
        Of the finished step; of the next as far as accuracy allows; at most (s).
    relative, absolute : float
        Tolerances.
    left : float
        How far from its constraints the phase began, because they cannot all be met (m).
    finished, has_fired : int
        Whether it is finished but its rows and events are not dealt with; whether it ends in an
        event.
    samples : Samples
        Event functions within it.
    """

    time: float = cell(float)
    begin: Floats = array("2 nv")
    slopes: Floats = array("stages", "2 nv")
    point: Floats = array("2 nv")
    end: Floats = array("2 nv")
    unsettled: Floats = array("2 nv")
    dense: Floats = array("dense_rows", "2 nv")
    extension: Extension = part(Extension)
    end_force: Floats = array("contacts", "components")
    torque: Floats = array("nu")
    length: float = cell(float)
    next_length: float = cell(float)
    longest: float = cell(float)
    relative: float = cell(float)
    absolute: float = cell(float)
    left: float = cell(float)
    finished: int = cell(int)
    has_fired: int = cell(int)
    samples: Samples = part(Samples)


class Impact(Bundle):
    """Impulses of this instant.

    Attributes
    ----------
    hit : (contacts,) int
        Points that reach the ground in this instant.
    impulse : (contacts, 2) float
        Impulses in this instant (N s).
    meets : (nc,) int
        Whether each point meets a second face in this instant, and is recorded in its frame.
    before : (2 nv,) float
        State before velocities jump.
    momentum : (3,) float
        Scratch of :func:`~heelstrike.sim.event_driven.events.meet_event`.
    """

    hit: Integers = array("contacts", of=int)
    impulse: Floats = array("contacts", "components")
    meets: Integers = array("nc", of=int)
    before: Floats = array("2 nv")
    momentum: Floats = array(3)


class Bounces(Bundle):
    """How points have bounced, and when bounces that grow ever shorter will have ended.

    Attributes
    ----------
    plastic : (contacts,) int
        Points whose rebound in this instant is too short to follow.
    last_impact, accumulation : (contacts,) float
        When each point hit the ground last; when its accumulating impacts come to rest (s).
    last_blow : float
        When the robot was hit last (s).
    """

    plastic: Integers = array("contacts", of=int)
    last_impact: Floats = array("contacts")
    accumulation: Floats = array("contacts")
    last_blow: float = cell(float)


class BridgeSeries(Bundle):
    """Bridges that follow each other.

    Attributes
    ----------
    count, begin, last_end : int, float, float
        How many there were in the series; when that began; when the last of them ended (s).
    length : float
        Of the last bridge (s).
    reason : int
        Why the simulation could not go on.
    """

    count: int = cell(int)
    begin: float = cell(float)
    last_end: float = cell(float)
    length: float = cell(float)
    reason: int = cell(int)


class Bridge(Bundle):
    """A bridge over an instant where time does not move on.

    Attributes
    ----------
    end : (2 nv,) float
        State at the end of the bridge at hand.
    after : (2 nv,) float
        State behind its impulses, at its beginning.
    free_end : (2 nv,) float
        Velocities at its end without impulses.
    added : (capacity,) float
        What is no velocity of the normal free term of each candidate.
    kept : (2 capacity,) float
        Scratch of :func:`~heelstrike.sim.event_driven.bridge.put_in_place`.
    lent : (contacts,) int
        Second faces that are kept until the bridge is found.
    here, halved, quartered : (2 nv,) float
        Where it begins, and where two bridges of half its length lead, and four of a quarter.
    """

    end: Floats = array("2 nv")
    after: Floats = array("2 nv")
    free_end: Floats = array("2 nv")
    added: Floats = array("capacity")
    kept: Floats = array("2 capacity")
    lent: Integers = array("contacts", of=int)
    here: Floats = array("2 nv")
    halved: Floats = array("2 nv")
    quartered: Floats = array("2 nv")


class Output(Bundle):
    """When rows of the record are due.

    Attributes
    ----------
    period : float
        Time between two rows of the record, zero for a row a step.
    every, next_row : int
        Periods, or steps, between two rows; next row, in periods.
    last_row : float
        When the last row was (s).
    state, slope : (2 nv,) float
        State that becomes a row, put on its constraints; its rate, which nobody asks for.
    dense_state : (2 nv,) float
        The same as dense output has it.
    """

    period: float = cell(float)
    every: int = cell(int)
    next_row: int = cell(int)
    last_row: float = cell(float)
    state: Floats = array("2 nv")
    slope: Floats = array("2 nv")
    dense_state: Floats = array("2 nv")


class Decision(Bundle):
    """What is open in this instant, and how often it has been decided.

    Attributes
    ----------
    started : int
        Whether the first contact modes are being, or have been, decided.
    at_event, undecided : int
        Whether this instant is one of an event; whether the contact modes are still to be decided.
    forced, jammed : int
        Whether contact forces at their limits made it so; whether those that grow without bound.
    bridging : int
        Whether this instant is left by a bridge.
    next_push, last_event : float
        When a push begins or ends next; when the modes changed last (s).
    burst : int
        Events since time moved on.
    allowance : float
        Events that are allowed for until time has moved on.
    state, slope : (2 nv,) float
        State at which modes are tried, and its rate: scratch of
        :func:`~heelstrike.sim.event_driven.deciding.decide_modes`.
    before : (2 nv,) float
        Scratch of :func:`~heelstrike.sim.event_driven.deciding.begin_phase`.
    """

    started: int = cell(int)
    at_event: int = cell(int)
    undecided: int = cell(int)
    forced: int = cell(int)
    jammed: int = cell(int)
    bridging: int = cell(int)
    next_push: float = cell(float)
    last_event: float = cell(float)
    burst: int = cell(int)
    allowance: float = cell(float)
    state: Floats = array("2 nv")
    slope: Floats = array("2 nv")
    before: Floats = array("2 nv")


class Phase(Bundle):
    """A smooth phase of the motion, in which every contact keeps its mode.

    Attributes
    ----------
    modes : Modes
    faces : Faces
    watch : Watch
    held : HeldRows
    forces : Forces
    saddle : SaddlePoint
    """

    modes: Modes = part(Modes)
    faces: Faces = part(Faces)
    watch: Watch = part(Watch)
    held: HeldRows = part(HeldRows)
    forces: Forces = part(Forces)
    saddle: SaddlePoint = part(SaddlePoint)


class Motion(Bundle):
    """Phase after phase: what steps, impacts, bridges and rows remember.

    Attributes
    ----------
    phase : Phase
    step : Step
    impact : Impact
    bounces : Bounces
    bridge : Bridge
    series : BridgeSeries
    output : Output
    decision : Decision
    """

    phase: Phase = part(Phase)
    step: Step = part(Step)
    impact: Impact = part(Impact)
    bounces: Bounces = part(Bounces)
    bridge: Bridge = part(Bridge)
    series: BridgeSeries = part(BridgeSeries)
    output: Output = part(Output)
    decision: Decision = part(Decision)


def allocate_motion(robot: Robot) -> Motion:
    """Allocate the memory of an event-driven simulation of `robot`."""
    model = robot.model
    contacts, loops = contact_count(model), most_rows(model)
    rows = 2 * contacts + loops
    extents = model.extents | {
        "contacts": contacts, "components": 2, "rows": rows, "unknowns": model.nv + rows,
        "capacity": contacts + loops, "functions": 2 * contacts + robot.nc,
        "stages": SLOPES, "dense_rows": DENSE_ROWS,
    }  # fmt: skip
    phase = Phase.allocate(extents)
    mass, gravity = float(sum(model.mass)), np.sqrt(np.sum(model.gravity**2))
    phase.watch.weight = mass * gravity if gravity > 0.0 else mass
    phase.watch.value[:] = 1.0
    phase.faces.face[:] = NO_FACE
    motion = Motion.allocate(extents, phase=phase)
    motion.bounces.last_impact[:] = -np.inf
    motion.bounces.accumulation[:] = np.inf
    return motion
