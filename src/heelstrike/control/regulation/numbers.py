"""Numbers, memory and log of the law that regulates the zero moment point."""

from __future__ import annotations

from heelstrike.compiler.bundle import Bundle, array, cell, number, part
from heelstrike.control.followed_gait import FollowedGait
from heelstrike.control.regulation.disturbance import Disturbance
from heelstrike.robot.model import Floats, Integers
from heelstrike.sim.controller.stance_clock import StanceClock

MOMENTS, CONDITIONS = 2, 5
"""Conditions on the ground's wrench: toe and heel, then normal force and both ends of friction."""

PERIOD = 1e-3
"""Seconds between two calls."""


class Parameters(FollowedGait):
    """Numbers of the law; `earliest` and `latest` are times of the gait's clock.

    Attributes
    ----------
    kp, kd : (nu,) float
        Gains (1/s², 1/s).
    ankle : (2,) int
        Actuator of the ankle of each foot.
    margin : float
        How far the zero moment point stays inside the sole (m).
    friction : float
        Coefficient of friction that is reckoned with.
    least_force : float
        Least normal force (N).
    returning : float
        T_r, in which the clock comes back to the pace of time (s).
    hurry : float
        Greatest |s̈| (1/s).
    slowest, fastest : float
        Bounds of ṡ.
    bandwidth : float
        Frequency (Hz) up to which disturbances are felt; negative for not at all.
    """

    kp: Floats = array("nu")
    kd: Floats = array("nu")
    ankle: Integers = array(2, of=int)
    margin: float = number(float)
    friction: float = number(float)
    least_force: float = number(float)
    returning: float = number(float)
    hurry: float = number(float)
    slowest: float = number(float)
    fastest: float = number(float)
    bandwidth: float = number(float)


class Choice(Bundle):
    """What the ground exerts on the stance foot, and the motion, for numbers to be chosen.

    Attributes
    ----------
    position, slope, curvature : (nu,) float
        q_d, q_d′ and q_d″.
    joints : (3, nu) float
        Accelerations of the joints as nothing is chosen, and what s̈ and w add to them.
    force : (3, nv) float
        Generalised forces of motors and ground for these.
    conditions : (5, 3) float
        Numbers that must not be negative, likewise.
    """

    position: Floats = array("nu")
    slope: Floats = array("nu")
    curvature: Floats = array("nu")
    joints: Floats = array(3, "nu")
    force: Floats = array(3, "nv")
    conditions: Floats = array(CONDITIONS, 3)


class Memory(StanceClock):
    """What the law remembers.

    Attributes
    ----------
    time : float
        Of the last call (s).
    clock, rate, hurry : float
        s, ṡ and s̈ (s, 1, 1/s).
    choice : Choice
    disturbance : Disturbance
    """

    time: float = cell(float)
    clock: float = cell(float)
    rate: float = cell(float)
    hurry: float = cell(float)
    choice: Choice = part(Choice)
    disturbance: Disturbance = part(Disturbance)


class Log(Bundle):
    """What the law tells of itself.

    Attributes
    ----------
    clock, rate, hurry : float
        s, ṡ and s̈.
    slowest_hurry, fastest_hurry : float
        The interval of s̈; both the same if it is empty.
    ankle : float
        w, what the stance ankle accelerates besides (rad/s²).
    pressure : float
        Zero moment point that is expected, from the middle of the sole towards the toe (m).
    given_up : int
        0: all conditions are met. 1: normal force or friction are not. 2: s̈ alone would not keep
        the zero moment point, the ankle does. 3: neither does.
    """

    clock: float = cell(float, unit="s", label="Clock of the gait")
    rate: float = cell(float, label="Rate of the clock")
    hurry: float = cell(float, unit="1/s", label="Change of the clock's rate")
    slowest_hurry: float = cell(float, unit="1/s", label="Least change of the clock's rate")
    fastest_hurry: float = cell(float, unit="1/s", label="Greatest change of the clock's rate")
    ankle: float = cell(float, unit="rad/s²", label="Acceleration that the ankle gives up")
    pressure: float = cell(float, unit="m", label="Expected zero moment point")
    given_up: int = cell(int, label="Conditions given up")
