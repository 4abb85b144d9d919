"""The controllers that keep their balance, as a user makes them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import sqrt

import numpy as np

from heelstrike.compiler.bundle import Bundle
from heelstrike.control.arguments import check_gait, must_be, number_of
from heelstrike.control.balance.along_motion import GAINS, along_motion, keep_to_motion
from heelstrike.control.balance.constrained import constrained_programs
from heelstrike.control.balance.footsteps import Planning
from heelstrike.control.balance.law import keep_balance
from heelstrike.control.balance.numbers import Legs, Parameters, Weights
from heelstrike.control.balance.reference import reference_of
from heelstrike.control.balance.tasks import CONTACT_ROWS
from heelstrike.errors import ControllerError
from heelstrike.gait.gait import Gait
from heelstrike.gait.motion.motion import Motion
from heelstrike.gait.sole import Sole, leg, sole, standing_height
from heelstrike.robot.loops import refuse_loops
from heelstrike.robot.robot import Robot
from heelstrike.sim.controller.law import Law

HEIGHT = 0.9538
"""Standing height of bravo7 (m), with which the numbers below were found."""

WEIGHTS = {
    "pressure": 1e6,
    "height": 1.0,
    "swing": 1.0,
    "pitch": 0.15,
    "angle": 0.05,
    "posture": 2.5e-4,
    "torque": 1e-7,
}
"""How much the tasks count, of every robot."""

LINKS = 3
"""Links of a leg: thigh, shank and foot."""


def _numbers(robot: Robot, gait: Gait, feet: list[Sole]) -> tuple[dict[str, float], ...]:
    """All numbers that may be chosen: those of bravo7, by the height and the weight of a robot.

    Lengths go with the height, times with its root, forces with the weight.
    """
    size = standing_height(robot, feet[0]) / HEIGHT
    pace = sqrt(size)
    duration = gait.step_duration
    weight = float(-robot.model.mass.sum() * robot.model.gravity[1])
    half = min(foot.half_length for foot in feet)
    margin = min(0.01, 0.2 * half)
    planning = {
        "heel": margin - half,
        "toe": half - margin,
        "shortest": -0.5 * size,
        "longest": 0.65 * size,
        "earliest": 0.4 * duration,
        "latest": 1.29 * duration,
        "soon": 0.1 * pace,
        "acceleration": 60.0,
        "hurry": 3.5,
        "foothold_weight": 1.0,
        "time_weight": 0.3 * size,
        "capture_weight": 30.0,
    }
    rest = {
        "speed": gait.step_length / duration,
        "kp": 150.0 / size,
        "kd": 25.0 / pace,
        "foot_kp": 400.0 / size,
        "foot_kd": 40.0 / pace,
        "joint_kp": 150.0 / size,
        "joint_kd": 25.0 / pace,
        "knee_kp": 900.0 / size,
        "friction": 0.6,
        "least_force": 0.15 * weight,
        "weight": weight,
        "touchdown": 0.4,
        "landing": 0.02 * duration,
        "calm": 0.02 * size,
        "alarmed": 0.08 * size,
        "calming": 6.0 * pace,
        "believed": 0.6,
        "flat": 2e-3 * size,
        "crouch": 0.03 * size,
        "lift": 0.05 * size,
        "away": 0.02 * size,
        "most_raised": 0.08 * size,
        "bent_knee": 0.2,
        "straight_knee": -0.25,
        "slow": 0.15 * pace,
        "fast": pace,
        "haste": 0.08 * pace,
        "search": 0.1 * pace,
        "smoothing": 0.01 * pace,
        "hold": 0.75 * half,
    }
    return planning, dict(WEIGHTS), rest


class WholeBody(Law):
    """Follow a gait with the whole body: a quadratic programme chooses the torques.

    At every call the accelerations of the joints are found that serve best, by weight, the centre
    of pressure, the height of the hip, the trunk, the swing foot and the posture, all of which
    follow the gait, under the limits of contact and motors: unilateral force, friction cone, centre
    of pressure within the sole, torques. Errors of the capture point are answered by the centre of
    pressure. Steps are as long and as quick as the gait's, or as long as `speed` asks for.

    A robot that stops (speed zero) brings its feet together and stands, and takes a step if it
    cannot stand otherwise. See ``docs/balance.md`` for the theory and what it cannot do.

    A motion of any phases is followed by the accelerations of the joints and the rotation of the
    trunk that come nearest to it, under the same limits, by the contacts of each phase: see
    :mod:`heelstrike.control.balance.along_motion`.

    Parameters
    ----------
    robot : Robot
        A floating robot with two mirrored feet that can stand flat, and legs of thigh, shank and
        foot; all joints but the trunk's actuated. To follow a motion, any floating robot.
    gait : Gait or Motion
        The gait to follow, on flat feet, of this robot; or a motion of any phases.
    speed : float, optional
        Speed that is wanted (m/s), by steps of another length in the time of the gait's; the
        gait's own by default. ``simulation.parameters.speed`` changes it while a simulation runs.
        A motion has its own speed.
    friction : float, optional
        Coefficient of friction that it reckons with: 0.6 by default, or that of a motion.
    numbers : mapping of str to float, optional
        Any other number of the law by its name: those of
        :class:`~heelstrike.control.balance.numbers.Parameters`, of its planning and its weights.
        Of a motion: ``kp``, ``kd``, ``pitch``, ``pitch_kp``, ``pitch_kd``.

    Raises
    ------
    ControllerError
        If the robot cannot be controlled this way, or the gait or a number does not fit it.

    Examples
    --------
    >>> import heelstrike as hs
    >>> robot = hs.load_robot("bravo7")
    >>> gait = hs.optimize_gait(robot, step_length=0.30, step_duration=0.70, starts=1)
    >>> law = hs.WholeBody(robot, gait)
    >>> hs.simulate(robot, law, state=gait.initial_state, duration=1.4).completed
    True
    """

    adapts = False
    """Whether foothold and time are adapted."""

    def __init__(
        self,
        robot: Robot,
        gait: Gait | Motion,
        *,
        speed: float | None = None,
        friction: float | None = None,
        numbers: Mapping[str, float] | None = None,
    ) -> None:
        must_be(Robot, "robot", robot)
        if numbers is not None:
            must_be(Mapping, "numbers", numbers)
        given = dict(numbers or {})
        given |= {
            name: value
            for name, value in (("speed", speed), ("friction", friction))
            if value is not None
        }
        if isinstance(gait, Motion):
            self._follow(robot, gait, given)
            return
        check_gait(robot, gait)
        feet = feet_to_balance_on(robot, point_feet=gait.point_feet)
        groups = _numbers(robot, gait, feet)
        _choose(groups, given)
        planning, weights, rest = groups
        if not self.adapts:
            planning["capture_weight"] = 0.0  # the foot lands where the gait's does
        parameters = Parameters(
            reference=reference_of(robot, gait),
            planning=Planning(**planning),
            weights=Weights(**weights),
            legs=_legs(robot, gait, feet),
            constrained=np.zeros(2, np.int64),
            adapts=int(self.adapts),
            **rest,
        )
        rows = CONTACT_ROWS + 2 * robot.nu + len(feet)
        begin = {
            "stance": gait.stance_foot,
            "landed": 1,
            "rate": 1.0 / gait.step_duration,
            "n": robot.nu,
            "m": rows,
        }
        super().__init__(keep_balance, parameters, robot=robot, memory=begin)
        self.gait = gait

    def _follow(self, robot: Robot, motion: Motion, given: dict[str, float]) -> None:
        """Follow a motion of any phases."""
        refuse_loops(robot, "whole-body control", ControllerError)
        if "speed" in given:
            raise ControllerError("a motion has its own speed; design one at another speed")
        chosen = {**GAINS, "friction": motion.friction}
        _choose((chosen,), given)
        parameters, sizes = along_motion(robot, motion, chosen, adapts=self.adapts)
        super().__init__(keep_to_motion, parameters, robot=robot, memory=sizes)
        self.motion = motion

    def numbers(self, robot: Robot) -> tuple[Bundle, Bundle]:
        """Return its parameters, and a memory to begin with, for a robot; all can be set.

        Parameters
        ----------
        robot : Robot
            The robot, whose straight-line code goes with the parameters.

        Returns
        -------
        tuple of Bundle
            Parameters and memory.
        """
        parameters, memory = super().numbers(robot)
        if not isinstance(parameters, Parameters):
            return parameters, memory
        return parameters.replaced(constrained=constrained_programs(robot)), memory


class FootstepFeedback(WholeBody):
    """Walk, and step where and when balance needs it.

    What :class:`WholeBody` does as long as nothing disturbs it. A capture point that the centre of
    pressure alone does not bring back is answered by another foothold at another time, found again
    at every call; the gait is then left for a lower body and a higher swing foot, and taken up
    again as the disturbance dies away. A foot that meets the ground early stands at once, one that
    meets it late goes on looking for it, and the slope is estimated from the footholds.

    In a motion of any phases, runs among them, footholds are moved by the error of the capture
    point, not landings in time: see :mod:`heelstrike.control.balance.shifted_feet`.

    Parameters
    ----------
    robot : Robot
        A floating robot with two mirrored feet that can stand flat, and legs of thigh, shank and
        foot; all joints but the trunk's actuated. To follow a motion, any floating robot.
    gait : Gait or Motion
        The gait that is followed as long as nothing disturbs, on flat feet, of this robot; or a
        motion of any phases.
    speed : float, optional
        Speed that is wanted (m/s); the gait's own by default, zero to stop and stand. A motion has
        its own speed.
    friction : float, optional
        Coefficient of friction that it reckons with: 0.6 by default, or that of a motion.
    numbers : mapping of str to float, optional
        Any other number of the law by its name, as for :class:`WholeBody`.

    Raises
    ------
    ControllerError
        If the robot cannot be controlled this way, or the gait or a number does not fit it.

    Examples
    --------
    >>> import heelstrike as hs
    >>> robot = hs.load_robot("bravo7")
    >>> gait = hs.optimize_gait(robot, step_length=0.30, step_duration=0.70, starts=1)
    >>> law = hs.FootstepFeedback(robot, gait)
    >>> push = hs.Push("trunk", force=(400.0, 0.0), start=0.3, duration=0.1)  # 40 N s
    >>> run = hs.simulate(robot, law, state=gait.initial_state, duration=2.1, pushes=push)
    >>> run.completed
    True
    """

    adapts = True


def _choose(groups: Sequence[dict[str, float]], given: Mapping[str, float]) -> None:
    """Write numbers that were given into the group that has them, or say that there are none."""
    for name, value in given.items():
        group = next((group for group in groups if name in group), None)
        if group is None:
            known = ", ".join(sorted(set().union(*groups)))
            raise ControllerError(f"there is no number {name!r}; there are {known}")
        if not np.isfinite(number_of(name, value)):
            raise ControllerError(f"{name} must be a finite number, got {value}")
        if name == "friction" and value <= 0.0:
            raise ControllerError(f"friction must be positive, got {value}")
        if name == "pitch" and value < 0.0:
            raise ControllerError(f"pitch must not be negative, got {value}")
        group[name] = float(value)


def feet_to_balance_on(robot: Robot, *, point_feet: bool = False) -> list[Sole]:
    """Return the soles of a robot whose whole body can keep its balance.

    Parameters
    ----------
    robot : Robot
        The robot.
    point_feet : bool
        Whether its gait is one on points.

    Raises
    ------
    ControllerError
        If the laws of this room cannot control it; the message says why.
    """
    refuse_loops(robot, "whole-body control", ControllerError)
    free = robot.nv - robot.nu
    if not robot.floating or len(robot.feet) != 2 or free != 3:
        raise ControllerError(
            f"whole-body control needs a floating robot with two feet and a motor at every joint; "
            f"robot {robot.name!r} has {len(robot.feet)} feet and {free} coordinates without a "
            "motor, of which three are the trunk's"
        )
    feet = [sole(robot, foot) for foot in range(2)]
    if point_feet or not all(foot.flat for foot in feet):
        raise ControllerError(
            f"whole-body control stands on flat feet; those of robot {robot.name!r}, or of its "
            "gait, are points"
        )
    for foot in feet:
        links = leg(robot, foot)
        if len(links) != LINKS or any(robot.model.axis[link, 0] == 0.0 for link in links):
            raise ControllerError(
                f"whole-body control needs legs of hip, knee and ankle; foot "
                f"{robot.feet[foot.foot].name!r} of robot {robot.name!r} is attached to "
                f"{', '.join(robot.joint_names[link] for link in reversed(links))}"
            )
    return feet


def _legs(robot: Robot, gait: Gait, feet: list[Sole]) -> Legs:
    """Find hips, knees and the sense in which these bend."""
    model = robot.model
    actuators = model.actuator_joint.tolist()
    course = gait.in_step(np.linspace(0.0, gait.step_duration, 20))
    either = 0.5 * (course + gait.mirrored(course)).mean(axis=0)
    hips, knees, straight, bend = [], [], [], []
    for foot in feet:
        ankle, knee, hip = leg(robot, foot)
        thigh, shank = model.offset[knee], model.offset[ankle]
        # Angle from the thigh to the shank about +y as the robot is described.
        turned = np.arctan2(-shank[0], -shank[1]) - np.arctan2(-thigh[0], -thigh[1])
        at = model.reference[knee] - turned / model.axis[knee, 0]
        actuator = actuators.index(knee)
        hips.append(hip)
        knees.append(actuator)
        straight.append(at)
        bend.append(1.0 if either[actuator] >= at else -1.0)
    length = float(np.hypot(*thigh) + np.hypot(*shank))
    return Legs(
        point=np.array([foot.point for foot in feet]),
        angle=np.array([foot.angle for foot in feet]),
        hip=np.array(hips),
        knee=np.array(knees),
        straight=np.array(straight),
        bend=np.array(bend),
        length=length,
    )
