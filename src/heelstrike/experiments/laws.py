"""The laws that a robot walks under, by name: what robots each can drive, how it is made for one.

A new controller is one line of `CONTROLLERS`, which the zoo measures; commands and the live view
know all of `LAWS`, by these names alone. Gains are those of bravo7, which go with weight and
height; nothing is tuned for a robot.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from heelstrike.analysis.stability.trial import Trial
from heelstrike.analysis.stability.zero_dynamics import zero_dynamics
from heelstrike.contact.ground import Ground
from heelstrike.control import (
    ComputedTorque,
    Encoder,
    FlatGaitLQR,
    FootstepFeedback,
    GaitLQR,
    JointPD,
    MotionLQR,
    StandingLQR,
    SteppingConstraints,
    VirtualConstraints,
    WholeBody,
    ZeroMomentPointRegulation,
)
from heelstrike.control.balance.controllers import feet_to_balance_on
from heelstrike.control.joint_feedback import JointFeedback
from heelstrike.dynamics import leg_joints, mass_matrix
from heelstrike.errors import ControllerError, GaitError, HeelstrikeError
from heelstrike.experiments.own_law import own_law
from heelstrike.experiments.walk import StepSize, design, typical_step
from heelstrike.field_texts import dataclass
from heelstrike.gait import Gait, PhasedGait, StepFamily, optimize_gait
from heelstrike.gait.sole import sole
from heelstrike.robot import Robot
from heelstrike.robot.model import Floats
from heelstrike.sim import Controller
from heelstrike.sim.controller.law import Law
from heelstrike.wording import meant

SAMPLE = 1e-3
"""Time between two calls of every controller, in s; a longer step of the method goes before."""

BRAVO7_WEIGHT, BRAVO7_STEP = 75.0, 0.30
"""Mass (kg) and step length (m, which goes with the height) of the robot whose gains are scaled."""

POINT_FEET_STEP = StepSize(2.4, 0.86, 2.4)
"""Steps on point feet, in those that suit flat feet: a slow step lets the weight tip the robot."""

SAMPLES = np.linspace(0.0, 1.0, 20)
"""Instants of a step, in its durations, at which knees are looked at."""
ON_IT = 1e-3  # rad, by which a gait may leave a range between its nodes
BENT, OTHER_WAY = (0.2, 2.6), (-2.6, -0.2)
"""Angles of knees on point feet, in rad: straight legs have nothing to give."""

MOST_DAMPING = 0.5
"""Largest damping of a joint in parts of what it moves, over `SAMPLE`: more of it, held over a
sample, makes a joint that moves little inertia chatter."""


@dataclass(frozen=True)
class Entry:
    """A controller by its name."""

    name: str
    """What it is called."""
    trial: Callable[[Robot, Gait | None], Trial]
    """Takes a robot and its gait, returns the walk that is disturbed, under a new controller."""
    needs: Callable[[Robot], str]
    """Takes a robot, returns what it lacks, in a word; nothing if the controller can drive it."""
    stands: bool = False
    """Whether it makes the robot stand, and needs no gait: None is what it is given."""
    bent_knees: bool = False
    """Whether it walks on points, by a gait with bent knees: the one of :func:`gait_for`."""
    source: str = ""
    """File of a user whose code was run for it."""


def driven(robot: Robot) -> str:
    """Say what a robot lacks that shall be moved at all."""
    if not robot.nu:
        return "no motors"
    return "" if robot.floating else "trunk is fixed"


def two_feet(robot: Robot) -> str:
    """Say what a robot lacks that shall walk on two feet of whatever kind."""
    return driven(robot) or ("" if len(robot.feet) == 2 else "not on two feet")


def flat_feet(robot: Robot) -> str:
    """Say what a robot lacks that shall stand on flat soles."""
    return two_feet(robot) or ("" if _flat(robot) else "needs flat feet")


def point_feet(robot: Robot) -> str:
    """Say what a robot lacks that shall walk on points."""
    return two_feet(robot) or ("needs point feet" if _flat(robot) else "")


def balancing(robot: Robot) -> str:
    """Say what a robot lacks whose whole body shall keep its balance."""
    missing = flat_feet(robot)
    if missing:
        return missing
    try:
        feet_to_balance_on(robot)
    except HeelstrikeError:
        return "needs legs of hip, knee and ankle, all driven"
    return ""


def walking(
    name: str,
    law: Callable[[Robot, Gait], Law | Controller],
    needs: Callable[[Robot], str] = flat_feet,
) -> Entry:
    """Enter a controller that walks a gait from its beginning.

    Parameters
    ----------
    name : str
        What it is called.
    law : callable
        Takes a robot and its gait, returns the controller; the class of one, say.
    needs : callable
        Takes a robot, returns what it lacks, in a word; by default it must have two flat feet.

    Returns
    -------
    Entry
        An entry of the zoo.
    """

    def trial(robot: Robot, gait: Gait | None) -> Trial:
        assert gait is not None
        return Trial(
            robot=robot, controller=law(robot, gait), state=gait.initial_state,
            step_length=gait.step_length, step_duration=gait.step_duration,
        )  # fmt: skip

    return Entry(name, trial, needs)


def on_points(name: str, law: Callable[[PhasedGait], Law]) -> Entry:
    """Enter a controller that walks on two point feet by the phase of a gait.

    Parameters
    ----------
    name : str
        What it is called.
    law : callable
        Takes the gait over its phase, which has its robot, and returns the controller.

    Returns
    -------
    Entry
        An entry of the zoo.
    """

    def trial(robot: Robot, gait: Gait | None) -> Trial:
        assert gait is not None
        phased = PhasedGait.from_gait(robot, gait)
        zero = zero_dynamics(phased)
        return Trial(
            robot=robot, controller=law(phased), state=zero.initial_state,
            step_length=zero.step_length, step_duration=zero.period,
        )  # fmt: skip

    return Entry(name, trial, point_feet, bent_knees=True)


def standing(name: str, law: Callable[[Robot, Floats], Law]) -> Entry:
    """Enter a controller that makes a robot stand on two flat feet, as it does on level ground.

    Parameters
    ----------
    name : str
        What it is called.
    law : callable
        Takes a robot and the coordinates (nq,) in which it stands, returns the controller.

    Returns
    -------
    Entry
        An entry of the zoo.
    """

    def trial(robot: Robot, _: Gait | None) -> Trial:
        state = robot.standing(Ground())
        return Trial(
            robot=robot, controller=law(robot, state.q), state=state, step_length=0.0,
            step_duration=typical_step(robot).duration,
        )  # fmt: skip

    return Entry(name, trial, flat_feet, stands=True)


def servo_gains(robot: Robot) -> tuple[float, Floats]:
    """Stiffness (N m/rad) and damping (N m s/rad) of servos that suit a robot's size."""
    size = _size(robot)
    return 1000.0 * size[0] * size[1], _at_most(robot, 20.0 * size[0] * size[1] ** 1.5)


def _joint_pd(robot: Robot, gait: Gait) -> Law:
    kp, kd = servo_gains(robot)
    return JointPD(robot, gait, kp=kp, kd=kd, feedforward="full")


def _joint_springs(robot: Robot, q: Floats) -> Law:
    size = _size(robot)
    damping = _at_most(robot, 100.0 * size[0] * size[1] ** 1.5)
    return JointFeedback(
        robot, q[robot.model.actuator_joint], kp=2000.0 * size[0] * size[1], kd=damping
    )


CONTROLLERS: tuple[Entry, ...] = (
    walking("ComputedTorque", ComputedTorque, needs=two_feet),
    walking("JointPD", _joint_pd),
    walking("ZeroMomentPointRegulation", ZeroMomentPointRegulation),
    walking("WholeBody", WholeBody, needs=balancing),
    walking("FootstepFeedback", FootstepFeedback, needs=balancing),
    on_points("VirtualConstraints", partial(VirtualConstraints, kp=100.0, kd=40.0)),
    on_points("SteppingConstraints", lambda gait: SteppingConstraints(StepFamily.around(gait))),
    on_points("GaitLQR", GaitLQR),
    standing("JointFeedback", _joint_springs),
    standing("StandingLQR", StandingLQR),
)
"""Controllers, in the order of the table; a new one is a line here."""

BY_ENCODERS = walking(
    "ComputedTorqueByEncoders",
    lambda robot, gait: ComputedTorque(robot, gait, encoder=Encoder()),
    needs=two_feet,
)
"""The paper's law on velocities that it estimates from encoders."""

BY_PHASES = walking(
    "MotionLQR", lambda robot, gait: MotionLQR(robot, gait.motion(robot)), needs=two_feet
)
"""The regulator through touchdowns, on the gait as a motion."""

LAWS: tuple[Entry, ...] = (
    *CONTROLLERS,
    walking("FlatGaitLQR", FlatGaitLQR),
    BY_PHASES,
    BY_ENCODERS,
)
"""All laws that have a name: those of the zoo, and others."""


def law_called(words: str) -> Entry:
    """Return a law by its name, or one of a user by ``module:name`` or ``file.py:name``.

    Capitals and hyphens do not matter. The code of a module or a file is run.

    Parameters
    ----------
    words : str
        What it is called.

    Returns
    -------
    Entry
        Its line of `LAWS`, or one of its own.

    Raises
    ------
    ControllerError
        If there is none; the message has the nearest and all names.
    """
    if ":" in words:
        law, source = own_law(words)
        return replace(walking(words, law, needs=driven), source=source)
    known = {entry.name.lower(): entry for entry in LAWS}
    name = words.replace("-", "").replace("_", "").lower()
    if name in known:
        return known[name]
    if words.endswith(".py"):
        raise ControllerError(
            f"{words} is a file: say which law of it is meant, as in {words}:NAME"
        )
    guess = meant(name, {each: repr(entry.name) for each, entry in known.items()})
    raise ControllerError(
        f"there is no controller {words!r}.{guess} There are "
        f"{', '.join(entry.name for entry in LAWS)}. One of your own is MODULE:NAME or "
        "FILE.py:NAME."
    )


def laws_of(robot: Robot) -> tuple[Entry, ...]:
    """Laws of `LAWS` that can drive a robot, as far as its build tells."""
    return tuple(entry for entry in LAWS if not entry.needs(robot))


def check_law(law: Entry, robot: Robot) -> None:
    """Refuse a law that cannot drive a robot.

    Raises
    ------
    ControllerError
        That names the laws that can.
    """
    lacks = law.needs(robot)
    if not lacks:
        return
    others = ", ".join(each.name for each in laws_of(robot))
    raise ControllerError(
        f"{law.name} cannot drive robot {robot.name!r} ({lacks}). "
        + (f"It can have {others}." if others else "No law by name can.")
    )


def law_that_steps(robot: Robot) -> Entry | None:
    """Return the law that steps where balance needs it; None if the robot cannot have it."""
    return _first_of(robot, "FootstepFeedback")


def law_that_balances(robot: Robot) -> Entry | None:
    """Return a law that looks after the balance of a robot on whatever feet; None if none does."""
    return _first_of(robot, "FootstepFeedback", "VirtualConstraints")


def _first_of(robot: Robot, *names: str) -> Entry | None:
    return next((law for law in map(law_called, names) if not law.needs(robot)), None)


def gait_for(robot: Robot) -> Gait:
    """Design the gait that every controller of a robot follows; on point feet with bent knees.

    Raises
    ------
    GaitError
        If there is none.
    """
    size = typical_step(robot)
    if point_feet(robot):
        return design(robot, size)
    size = StepSize(
        length=round(POINT_FEET_STEP.length * size.length, 2),
        duration=round(POINT_FEET_STEP.duration * size.duration, 2),
        clearance=round(POINT_FEET_STEP.clearance * size.clearance, 3),
    )
    gait = design(robot, size)
    try:
        return optimize_gait(
            robot, step_length=size.length, step_duration=size.duration, clearance=size.clearance,
            friction=gait.friction, joint_ranges=_knee_ranges(robot, gait),
        )  # fmt: skip
    except GaitError:  # a zero of the knees that is not straight, say
        return gait


def bent_knees(robot: Robot, gait: Gait) -> dict[str, tuple[float, float]]:
    """Ranges (rad) that a gait keeps its knees bent in, by their names; none if it straightens one.

    Parameters
    ----------
    robot : Robot
        A robot.
    gait : Gait
        Its gait.
    """
    if not gait.point_feet:
        return {}
    ranges = _knee_ranges(robot, gait)
    knees = [robot.joint_index(name) for name in ranges]
    columns = [robot.model.actuator_joint.tolist().index(knee) for knee in knees]
    course = gait.in_step(SAMPLES * gait.step_duration)
    both = np.concatenate((course, gait.mirrored(course)))[:, columns]
    low, high = np.transpose(list(ranges.values())) if ranges else np.zeros((2, 0))
    within = np.all((both >= low - ON_IT) & (both <= high + ON_IT))
    return ranges if within else {}


def _knee_ranges(robot: Robot, gait: Gait) -> dict[str, tuple[float, float]]:
    """Ranges in which the knees stay bent as they are in a gait, in rad; zero is straight."""
    course = gait.in_step(SAMPLES * gait.step_duration)
    either = 0.5 * (course + gait.mirrored(course)).mean(axis=0)
    actuators = robot.model.actuator_joint.tolist()
    knees = [leg[1] for leg in leg_joints(robot) if len(leg) > 1]
    return {
        robot.joint_names[knee]: BENT if either[actuators.index(knee)] > 0.0 else OTHER_WAY
        for knee in knees
    }


def _flat(robot: Robot) -> bool:
    try:
        return all(sole(robot, foot).flat for foot in range(len(robot.feet)))
    except HeelstrikeError:
        return False


def _size(robot: Robot) -> tuple[float, float]:
    """Weight and height of a robot, in those of bravo7."""
    return robot.total_mass / BRAVO7_WEIGHT, typical_step(robot).length / BRAVO7_STEP


def _at_most(robot: Robot, damping: float) -> Floats:
    """Return a damping of all joints (N m s/rad) that none of them takes amiss."""
    moved = np.diag(mass_matrix(robot, robot.model.reference))[robot.model.actuator_joint]
    most: Floats = MOST_DAMPING * moved / SAMPLE
    return np.minimum(damping, most)
