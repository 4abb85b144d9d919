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

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from heelstrike.compiler.bundle import Bundle, array, cell, part
from heelstrike.contact.workspace import ContactAnswer
from heelstrike.robot.robot import Robot
from heelstrike.sim.contacts.faces import NO_FACE
from heelstrike.sim.contacts.rows import contact_components, most_rows
from heelstrike.sim.controller.control import Control
from heelstrike.sim.event_driven.continuous_extension import Extension
from heelstrike.sim.event_driven.dormand_prince import DENSE_ROWS, SLOPES
from heelstrike.sim.frame import Scene
from heelstrike.sim.memory import Memory

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


class Modes(Bundle):
    """What every contact does in this phase.

    A contact point that is closed and does not slide sticks. Closed points of one link on the same
    straight piece of ground form a group, told by its first point: only the outermost two of them
    carry normal force, and one tangential force stands for all.
    """

    watched: int = cell(int)
    """How many contacts there are on this ground: all, or those before the second faces."""
    closed: Integers = array("contacts", of=int)
    """Whether each contact point is on the ground, each joint at its stop."""
    slide: Integers = array("contacts", of=int)
    """Direction in which it slides along the tangent, or the joint turns: -1, 0 or 1."""
    group: Integers = array("contacts", of=int)
    """First contact point of its group."""
    carrier: Integers = array("contacts", of=int)
    holder: Integers = array("contacts", of=int)
    """carrier, holder: Whether its normal force, and its tangential force, are unknowns."""
    stuck: Integers = array("contacts", of=int)
    anchor: Floats = array("contacts")
    """Whether a point has a place where it began to stick, and that place along the tangent."""
    passing: Integers = array("contacts", of=int)
    """Points of a swing leg below the ground that are let pass."""
    let_pass: int = cell(int)
    """Whether swing feet may scuff without effect."""
    breakaway: Floats = array("nv")
    """The most that dry friction is of each joint in this phase."""
    face: Integers = array("contacts", of=int)
    """Face of the ground that each closed contact point is on, -1 for none; the second that it is
    on, or could meet (:mod:`heelstrike.sim.event_driven.smooth.faces`)."""
    curvature: Floats = array("contacts")
    """Curvature (1/m) of the way of the centre of each disc along smooth ground."""


class Watch(Bundle):
    """Event functions, of which the first to vanish ends the phase.

    There are two a contact. Of a joint stop the second is always 1, of a dry joint the first. On
    ground with corners each contact point has a third, after these.
    """

    value: Floats = array("functions")
    rate: Floats = array("functions")
    """value, rate: Event functions and their rates at the last evaluation."""
    fired: Integers = array("functions", of=int)
    """Event functions that ended the step."""
    force_scale: float = cell(float)
    """What forces are small or large beside (N): the weight of the robot, or its mass times 1 m/s²
    where there is no gravity."""


class Samples(Bundle):
    """Event functions and their rates at some places in a step, between which they may vanish."""

    end_value: Floats = array("functions")
    end_rate: Floats = array("functions")
    """end_value, end_rate: At the end of the step."""
    before: Floats = array("functions")
    before_rate: Floats = array("functions")
    """before, before_rate: At the sample before."""
    sample: Floats = array("functions")
    sample_rate: Floats = array("functions")
    """sample, sample_rate: At this one."""
    state: Floats = array("2 nv")
    slope: Floats = array("2 nv")
    """state, slope: Scratch of :func:`~heelstrike.sim.event_driven.location.evaluate_within`."""


class Forces(Bundle):
    """The forces that keep the modes."""

    force: Floats = array("contacts", "components")
    """Contact forces of the last evaluation (N), normal and tangent, on the robot."""
    count: int = cell(int)
    deficient: int = cell(int)
    """count, deficient: Closed contact points at the last evaluation; whether it found their forces
    ambiguous."""
    solvers: Integers = array(3, of=int)
    """Contact solvers in the order in which they are tried."""


class HeldRows(Bundle):
    """Rows along which closed contacts and loops are held, and the equations of their forces."""

    place: Integers = array("rows", of=int)
    row: Integers = array("rows", of=int)
    """place, row: Candidate that each unknown force acts on, and row of the Jacobian that it acts
    along."""
    friction_ratio: Floats = array("rows")
    """Tangential force per normal force of a point that slides, of either sign; zero of others."""
    scale: Floats = array("rows")
    """Unit of the force."""
    system: Floats = array("rows", "rows + 1")
    unknown: Floats = array("rows")
    column: Integers = array("rows", of=int)
    """The equations, their solution, and its order."""
    presses: Integers = array("rows", of=int)
    """Whether it can press only: scratch, where the forces are ambiguous."""


class SaddlePoint(Bundle):
    """Equations of motion and of the contacts together, where those of the forces lose digits.

    They are solved in :mod:`heelstrike.sim.event_driven.saddle_point`.
    """

    system: Floats = array("unknowns", "unknowns + 1")
    unknown: Floats = array("unknowns")
    scale: Floats = array("unknowns")
    order: Integers = array("unknowns", of=int)
    """The equations, the right-hand side last; their solution, the unit of each unknown, and their
    order. The coordinates come first, then forces."""
    force: Floats = array("nv")
    bias: Floats = array("rows")
    """Known force of the state that was evaluated last, and acceleration of the rows of the
    candidates without any of the coordinates."""
    answer: ContactAnswer = part(ContactAnswer)
    """That of the contact solvers, kept while a better one is looked for."""
    needed: int = cell(int)
    used: int = cell(int)
    """needed, used: Whether the last evaluation took these equations; whether the answer of the
    contact problem is of them."""


class Step(Bundle):
    """The step from now on, of the method of Dormand and Prince."""

    time: float = cell(float)
    begin: Floats = array("2 nv")
    """time, begin: Now (s), and the state (q, v) now, at the start of the step."""
    slopes: Floats = array("stages", "2 nv")
    """Rates of the state at its stages; the first is that of now."""
    point: Floats = array("2 nv")
    """State at a stage; scratch."""
    end: Floats = array("2 nv")
    """State at its end."""
    unsettled: Floats = array("2 nv")
    """The same before it is put on its constraints; scratch."""
    dense: Floats = array("dense_rows", "2 nv")
    """Coefficients of its dense output."""
    extension: Extension = part(Extension)
    """What is more exact than that, once there are rows within the step."""
    end_force: Floats = array("contacts", "components")
    """Contact forces at its end (N)."""
    torque: Floats = array("nu")
    """Torques at its end, to see whether the controller jumps."""
    length: float = cell(float)
    next_length: float = cell(float)
    longest: float = cell(float)
    """length, next_length, longest: Of the finished step; of the next as far as accuracy allows; at
    most (s)."""
    relative: float = cell(float)
    absolute: float = cell(float)
    """relative, absolute: Tolerances."""
    left: float = cell(float)
    """How far from its constraints the phase began, because they cannot all be met (m)."""
    finished: int = cell(int)
    has_fired: int = cell(int)
    """finished, has_fired: Whether it is finished but its rows and events are not dealt with;
    whether it ends in an event."""
    samples: Samples = part(Samples)
    """Event functions within it."""


class Impact(Bundle):
    """Impulses of this instant."""

    hit: Integers = array("contacts", of=int)
    """Points that reach the ground in this instant."""
    impulse: Floats = array("contacts", "components")
    """Impulses in this instant (N s)."""
    meets: Integers = array("nc", of=int)
    """Whether each point meets a second face in this instant, and is recorded in its frame."""
    before: Floats = array("2 nv")
    """State before velocities jump."""
    momentum: Floats = array(3)
    """Scratch of :func:`~heelstrike.sim.event_driven.events.meet_event`."""


class Bounces(Bundle):
    """How points have bounced, and when bounces that grow ever shorter will have ended."""

    plastic: Integers = array("contacts", of=int)
    """Points whose rebound in this instant is too short to follow."""
    last_impact: Floats = array("contacts")
    accumulation: Floats = array("contacts")
    """last_impact, accumulation: When each point hit the ground last; when its accumulating impacts
    come to rest (s)."""
    last_blow: float = cell(float)
    """When the robot was hit last (s)."""


class BridgeSeries(Bundle):
    """Bridges that follow each other."""

    count: int = cell(int)
    begin: float = cell(float)
    last_end: float = cell(float)
    """count, begin, last_end: How many there were in the series; when that began; when the last of
    them ended (s)."""
    length: float = cell(float)
    """Of the last bridge (s)."""
    reason: int = cell(int)
    """Why the simulation could not go on."""


class Bridge(Bundle):
    """A bridge over an instant where time does not move on."""

    end: Floats = array("2 nv")
    """State at the end of the bridge at hand."""
    after: Floats = array("2 nv")
    """State behind its impulses, at its beginning."""
    free_end: Floats = array("2 nv")
    """Velocities at its end without impulses."""
    added: Floats = array("capacity")
    """What is no velocity of the normal free term of each candidate."""
    kept: Floats = array("rows")
    """Scratch of :func:`~heelstrike.sim.event_driven.bridge.put_in_place`."""
    lent: Integers = array("contacts", of=int)
    """Second faces that are kept until the bridge is found."""
    here: Floats = array("2 nv")
    halved: Floats = array("2 nv")
    quartered: Floats = array("2 nv")
    """here, halved, quartered: Where it begins, and where two bridges of half its length lead, and
    four of a quarter."""


class Output(Bundle):
    """When rows of the record are due."""

    period: float = cell(float)
    """Time between two rows of the record, zero for a row a step."""
    every: int = cell(int)
    next_row: int = cell(int)
    """every, next_row: Periods, or steps, between two rows; next row, in periods."""
    last_row: float = cell(float)
    """When the last row was (s)."""
    state: Floats = array("2 nv")
    slope: Floats = array("2 nv")
    """state, slope: State that becomes a row, put on its constraints; its rate, which nobody asks
    for."""
    dense_state: Floats = array("2 nv")
    """The same as dense output has it."""


class Decision(Bundle):
    """What is open in this instant, and how often it has been decided."""

    started: int = cell(int)
    """Whether the first contact modes are being, or have been, decided."""
    at_event: int = cell(int)
    undecided: int = cell(int)
    """at_event, undecided: Whether this instant is one of an event; whether the contact modes are
    still to be decided."""
    forced: int = cell(int)
    jammed: int = cell(int)
    """forced, jammed: Whether contact forces at their limits made it so; whether those that grow
    without bound."""
    bridging: int = cell(int)
    """Whether this instant is left by a bridge."""
    next_push: float = cell(float)
    last_event: float = cell(float)
    """next_push, last_event: When a push begins or ends next; when the modes changed last (s)."""
    burst: int = cell(int)
    """Events since time moved on."""
    allowance: float = cell(float)
    """Events that are allowed for until time has moved on."""
    state: Floats = array("2 nv")
    slope: Floats = array("2 nv")
    """state, slope: State at which modes are tried, and its rate: scratch of
    :func:`~heelstrike.sim.event_driven.deciding.decide_modes`."""
    before: Floats = array("2 nv")
    """Scratch of :func:`~heelstrike.sim.event_driven.deciding.begin_phase`."""


class Phase(Bundle):
    """A smooth phase of the motion, in which every contact keeps its mode."""

    modes: Modes = part(Modes)
    watch: Watch = part(Watch)
    held: HeldRows = part(HeldRows)
    forces: Forces = part(Forces)
    saddle: SaddlePoint = part(SaddlePoint)


class Motion(Bundle):
    """Phase after phase: what steps, impacts, bridges and rows remember."""

    phase: Phase = part(Phase)
    step: Step = part(Step)
    impact: Impact = part(Impact)
    bounces: Bounces = part(Bounces)
    bridge: Bridge = part(Bridge)
    series: BridgeSeries = part(BridgeSeries)
    output: Output = part(Output)
    decision: Decision = part(Decision)


class Integration(NamedTuple):
    """A step of the smooth motion, and all that tells the rates of the states within it."""

    scene: Scene
    control: Control
    memory: Memory
    phase: Phase
    step: Step


def allocate_motion(robot: Robot) -> Motion:
    """Allocate the memory of an event-driven simulation of `robot`."""
    model = robot.model
    components, loops = contact_components(robot), most_rows(robot)
    contacts, rows = len(components), sum(components) + loops
    extents = model.extents | {
        "contacts": contacts, "components": 2, "rows": rows, "unknowns": model.nv + rows,
        "capacity": contacts + loops, "functions": 2 * contacts + robot.nc,
        "stages": SLOPES, "dense_rows": DENSE_ROWS,
    }  # fmt: skip
    phase = Phase.allocate(extents)
    mass, gravity = float(sum(model.mass)), np.sqrt(np.sum(model.gravity**2))
    phase.watch.force_scale = mass * gravity if gravity > 0.0 else mass
    phase.watch.value[:] = 1.0
    phase.modes.face[:] = NO_FACE
    motion = Motion.allocate(extents, phase=phase)
    motion.bounces.last_impact[:] = -np.inf
    motion.bounces.accumulation[:] = np.inf
    return motion
