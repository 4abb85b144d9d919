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
    """Numbers of the law; `earliest` and `latest` are times of the gait's clock."""

    kp: Floats = array("nu")
    kd: Floats = array("nu")
    """kp, kd: Gains (1/s², 1/s)."""
    ankle: Integers = array(2, of=int)
    """Actuator of the ankle of each foot."""
    margin: float = number(float)
    """How far the zero moment point stays inside the sole (m)."""
    friction: float = number(float)
    """Coefficient of friction that is reckoned with."""
    least_force: float = number(float)
    """Least normal force (N)."""
    returning: float = number(float)
    """T_r, in which the clock comes back to the pace of time (s)."""
    hurry: float = number(float)
    """Greatest |s̈| (1/s)."""
    slowest: float = number(float)
    fastest: float = number(float)
    """slowest, fastest: Bounds of ṡ."""
    bandwidth: float = number(float)
    """Frequency (Hz) up to which disturbances are felt; negative for not at all."""


class Choice(Bundle):
    """What the ground exerts on the stance foot, and the motion, for numbers to be chosen."""

    position: Floats = array("nu")
    slope: Floats = array("nu")
    curvature: Floats = array("nu")
    """position, slope, curvature: q_d, q_d′ and q_d″."""
    joints: Floats = array(3, "nu")
    """Accelerations of the joints as nothing is chosen, and what s̈ and w add to them."""
    force: Floats = array(3, "nv")
    """Generalised forces of motors and ground for these."""
    conditions: Floats = array(CONDITIONS, 3)
    """Numbers that must not be negative, likewise."""


class Memory(StanceClock):
    """What the law remembers."""

    time: float = cell(float)
    """Of the last call (s)."""
    clock: float = cell(float)
    rate: float = cell(float)
    hurry: float = cell(float)
    """clock, rate, hurry: s, ṡ and s̈ (s, 1, 1/s)."""
    choice: Choice = part(Choice)
    disturbance: Disturbance = part(Disturbance)


class Log(Bundle):
    """What the law tells of itself."""

    clock: float = cell(float, unit="s", label="Clock of the gait")
    rate: float = cell(float, label="Rate of the clock")
    hurry: float = cell(float, unit="1/s", label="Change of the clock's rate")
    """clock, rate, hurry: s, ṡ and s̈."""
    slowest_hurry: float = cell(float, unit="1/s", label="Least change of the clock's rate")
    fastest_hurry: float = cell(float, unit="1/s", label="Greatest change of the clock's rate")
    """slowest_hurry, fastest_hurry: The interval of s̈; both the same if it is empty."""
    ankle: float = cell(float, unit="rad/s²", label="Acceleration that the ankle gives up")
    """w, at the stance ankle."""
    pressure: float = cell(float, unit="m", label="Expected zero moment point")
    """From the middle of the sole towards the toe."""
    given_up: int = cell(int, label="Conditions given up")
    """0: all conditions are met. 1: normal force or friction are not. 2: s̈ alone would not keep
    the zero moment point, the ankle does. 3: neither does."""
