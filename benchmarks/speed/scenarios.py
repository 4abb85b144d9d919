"""What is timed and counted: robots, postures and laws of control for every engine alike."""

from __future__ import annotations

from functools import cache
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from heelstrike.contact.ground import Ground
from heelstrike.contact.queries.inverse_dynamics import contact_inverse_dynamics
from heelstrike.control.computed_torque import ComputedTorque
from heelstrike.control.joint_feedback import JointFeedback
from heelstrike.dynamics import center_of_mass, contact_positions
from heelstrike.experiments.engines import Scenario
from heelstrike.gait import Gait, optimize_gait
from heelstrike.robot import Robot, State, load_robot
from heelstrike.sim import EventDriven

Floats = NDArray[np.float64]

FRICTION = 0.75

# Rotations about +y of (thigh, shank) that bend the knees.
BENT = {"bravo7": (-0.3, 0.6), "walker2d": (0.1, 0.4)}
STIFFNESS, DAMPING = 3000.0, 50.0
"""Gains of the joints of bravo7 when it stands, N m/rad and N m s/rad."""
WALKING_STIFFNESS, WALKING_DAMPING = 300.0, 15.0
"""Gains with which it follows the reference of a walk."""

STEP_LENGTH, STEP_DURATION = 0.30, 0.45
"""The steps of the walk of the work-precision study: touchdowns at 0.45 and 0.90 s."""
FEEDFORWARD_ORDER = 9
"""Degree of the polynomials that stand for the torques of a step."""


def posture(robot: Robot, thigh: float, shank: float) -> Floats:
    """Positions of a robot that stands on flat feet, its centre of mass over their middle.

    `thigh` and `shank` are the rotations about +y of hip and knee; ankles and trunk follow.
    """
    turn = robot.model.axis[:, 0]

    def stand(pitch: float) -> Floats:
        q = robot.model.reference.copy()
        for i, name in enumerate(robot.joint_names):
            for part, angle in (
                ("hip", thigh),
                ("knee", shank),
                ("ankle", -thigh - shank - pitch),
                ("pitch", pitch),
            ):
                if part in name:
                    q[i] += turn[i] * angle
        feet = contact_positions(robot, q)
        q[:2] -= feet[:, 0].mean(), (feet[:, 1] - robot.model.contact_radius).min()
        return q

    pitch = brentq(lambda angle: center_of_mass(robot, stand(angle))[0], -0.5, 0.5)
    return stand(float(pitch))


def standing(name: str, *, bent: bool = True, duration: float = 20.0) -> Scenario:
    """Return a robot that stands still on both feet, its joints held."""
    robot = load_robot(name)
    q = posture(robot, *(BENT[name] if bent else (0.0, 0.0)))
    rest = np.zeros(robot.nv)
    torque = contact_inverse_dynamics(robot, q, rest, rest, ground=Ground(friction=FRICTION)).torque
    scale = robot.total_mass / 75.0
    feedback = JointFeedback(
        robot,
        q[robot.model.actuator_joint],
        torque=torque,
        kp=STIFFNESS * scale,
        kd=DAMPING * scale,
    )
    knees = "bent" if bent else "straight"
    return Scenario(
        f"{name} standing, knees {knees}", robot, State(q, rest), duration, feedback, contacts=4
    )


def falling(name: str, *, duration: float = 0.5) -> Scenario:
    """Return a robot left alone on bent knees, moving forward: it folds up and falls."""
    robot = load_robot(name)
    v = np.zeros(robot.nv)
    return Scenario(f"{name} falling", robot, State(posture(robot, *BENT[name]), v), duration)


@cache
def walk_gait() -> tuple[Robot, Gait]:
    """Return bravo7 and the gait of the work-precision study."""
    robot = load_robot("bravo7")
    gait = optimize_gait(
        robot,
        step_length=STEP_LENGTH,
        step_duration=STEP_DURATION,
        friction=0.8 * FRICTION,
    )
    return robot, gait


def walking_law() -> ComputedTorque:
    """Return what heelstrike walks by: its own law asks more of it than that of the others."""
    return ComputedTorque(*walk_gait())


@cache
def walking(*, duration: float = 1.0) -> Scenario:
    """Return bravo7 on a walk that springs, dampers and a torque schedule keep going for 1 s.

    What their law needs of the dynamics is precomputed.
    """
    robot, gait = walk_gait()
    model = Scenario("the model", robot, gait.initial_state, 1.98 * STEP_DURATION)
    model_walk = model.run(EventDriven(), controller=walking_law(), record_every=1)
    begins = STEP_DURATION * np.arange(3)
    sides = [gait.coefficients, gait.mirrored_coefficients(robot)]
    pieces = []
    for begin, end in pairwise(begins):
        inside = (model_walk.time > begin + 1e-6) & (model_walk.time < end - 1e-6)
        time = model_walk.time[inside] - begin
        fitted = np.polynomial.polynomial.polyfit(
            time, model_walk.torque[inside], FEEDFORWARD_ORDER
        )
        pieces.append(fitted.T)
    feedback = JointFeedback(
        robot,
        np.stack([sides[0].T, sides[1].T, sides[0].T]),
        torque=np.stack([*pieces, pieces[0]]),
        kp=WALKING_STIFFNESS,
        kd=WALKING_DAMPING,
        begins=begins,
    )
    return Scenario("bravo7 walking", robot, gait.initial_state, duration, feedback)


def chain(joints: int) -> str:
    """Return a planar chain of hinges that is attached to the world, as MJCF: no contacts."""
    body = ""
    for i in range(joints, 0, -1):
        place = "0 0 -0.1" if i > 1 else "0 0 0"
        body = (
            f'<body name="link{i}" pos="{place}"><joint name="joint{i}" type="hinge" axis="0 1 0"/>'
            '<inertial pos="0 0 -0.05" mass="0.2" diaginertia="2e-4 2e-4 2e-4"/>'
            f"{body}</body>"
        )
    return f'<mujoco model="chain"><compiler angle="radian"/><worldbody>{body}</worldbody></mujoco>'


def plank(contacts: int) -> str:
    """Return a plank on that many points along its sole, as MJCF."""
    places = np.linspace(-0.5, 0.5, contacts) if contacts > 1 else np.zeros(contacts)
    points = "".join(
        f'<geom name="point{i}" type="sphere" size="1e-6" pos="{x} 0 -0.05" contype="1"'
        ' conaffinity="0"/>'
        for i, x in enumerate(places)
    )
    height = 0.05 + 1e-6 if contacts else 1000.0
    return (
        '<mujoco model="plank"><compiler angle="radian"/>'
        '<worldbody><geom name="floor" type="plane" size="9 9 1" contype="0" conaffinity="1"/>'
        f'<body name="plank" pos="0 0 {height}">'
        '<joint name="x" type="slide" axis="1 0 0"/><joint name="z" type="slide" axis="0 0 1"/>'
        '<joint name="pitch" type="hinge" axis="0 1 0"/>'
        '<inertial pos="0 0 0" mass="5" diaginertia="0.4 0.4 0.4"/>'
        '<geom type="box" size="0.5 0.1 0.05" contype="0" conaffinity="0"/>'
        f"{points}</body></worldbody></mujoco>"
    )
