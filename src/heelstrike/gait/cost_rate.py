"""The rate at which a gait spends what it is to spend least of, in symbols."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields
from typing import Any

import casadi
import numpy as np

from heelstrike.arguments import shown
from heelstrike.dynamics.queries.symbolic import expression
from heelstrike.errors import GaitError
from heelstrike.gait.cost import Cost, Instant, OwnCost
from heelstrike.gait.support import Support, Symbols
from heelstrike.robot.model import Floats, Model

ROUNDED = 1e-3
"""Power, in units of weight times height over the pendulum time, below which |x| is rounded off to
√(x² + ε²) − ε: IPOPT needs second derivatives everywhere. An integral of it is at most this
power times the duration too small, for each motor."""


def rate_of(
    costs: dict[Cost, float] | OwnCost, now: Instant, heat: Floats | None,
    unit_of_power: float,
) -> Any:  # fmt: skip
    """Return the rate of the costs at an instant, as an expression.

    Parameters
    ----------
    costs : dict or function
        What :func:`costs_of` returned.
    now : Instant
        The instant.
    heat : (nu,) array, optional
        ω₀/τ₀ of the motors (rad/s per N m): the heat of a unit of torque squared.
    unit_of_power : float
        Weight times height over the pendulum time (W).

    Raises
    ------
    GaitError
        If the motors have no such numbers, or a function returns no number.
    """
    total = smooth_rate_of(costs, now)
    for weight, width, one, other in powers_of(costs, now, heat):
        apart, small = one - other, width * ROUNDED * unit_of_power
        total += 0.5 * weight * casadi.sum1(one + other + casadi.sqrt(apart**2 + small**2) - small)
    return total


def smooth_rate_of(costs: dict[Cost, float] | OwnCost, now: Instant) -> Any:
    """Return the rate of those costs that have derivatives everywhere, as an expression."""
    if not isinstance(costs, dict):
        return _own_rate(costs, now)
    return costs.get(Cost.TORQUE, 0.0) * casadi.sumsqr(now.torque)


def powers_of(
    costs: dict[Cost, float] | OwnCost, now: Instant, heat: Floats | None
) -> list[tuple[float, float, Any, Any]]:
    """Return the costs that have corners.

    Of each its weight, how widely its corners are rounded off, in units of `ROUNDED`, and two
    powers of every motor, (nu,). What a motor spends is the greater of the two: P and −P, or P with
    its heat and zero. The first differ by 2 P, so that their corner is as wide as the other's at
    twice the width.

    Raises
    ------
    GaitError
        If the motors have no such numbers.
    """
    powers: list[tuple[float, float, Any, Any]] = []
    if not isinstance(costs, dict):
        return powers
    power = now.torque * now.motor_velocity
    for cost, weight in costs.items():
        if cost is Cost.MECHANICAL_ENERGY:
            powers.append((weight, 2.0, power, -power))
        elif cost is Cost.ELECTRICAL_ENERGY:
            if heat is None:
                raise GaitError(
                    "cost 'electrical_energy' needs motors: stall_torque and no_load_speed of "
                    "every driven joint. Give them to the robot, or ask for 'mechanical_energy'."
                )
            spent = power + casadi.DM(heat) * now.torque**2
            powers.append((weight, 1.0, spent, 0.0 * power))
    return powers


def heat_of(model: Model) -> Floats | None:
    """ω₀/τ₀ of all motors (rad/s per N m), in the order of the actuators; None if some lack it."""
    stall, free = (each[model.actuator_joint] for each in (model.stall_torque, model.no_load_speed))
    return free / stall if np.all(np.isfinite(stall)) and np.all(stall > 0.0) else None


def _own_rate(cost: OwnCost, now: Instant) -> Any:
    rate = own_expression("cost", cost, now)
    if rate.numel() != 1:
        raise GaitError(f"the cost function must return one number, got {rate.numel()}")
    return rate


def own_expression(what: str, function: Callable[[Instant], Any], now: Instant) -> Any:
    """Return what a function of one's own makes of an instant, as an expression.

    Parameters
    ----------
    what : str
        What it is: a cost, a constraint.
    function : callable
        Takes an instant.
    now : Instant
        The instant.

    Raises
    ------
    GaitError
        If it fails, or uses symbols of its own.
    """
    absent = [each.name for each in fields(now) if getattr(now, each.name) is None]
    try:
        value = function(now)
    except Exception as error:
        said = f"the {what} function failed: {type(error).__name__}: {error}"
        if absent and "None" in str(error):
            said += (
                f". Only instants of motions (optimize_motion) have {', '.join(absent)}; in gaits "
                "of one step these are None."
            )
        raise GaitError(said) from error
    try:
        found = casadi.SX(value)
    except (TypeError, ValueError, NotImplementedError):
        raise GaitError(
            f"the {what} function must return a number or an expression of CasADi, got "
            f"{shown(value)}"
        ) from None
    if any(each.is_constant() and not each.is_regular() for each in found.elements()):
        raise GaitError(f"the {what} function returns what is no finite number: {found}")
    known = casadi.vertcat(now.position, now.velocity, now.torque, now.force)
    for each in (now.acceleration, now.time, now.stands, now.share, now.torque_rate):
        if each is not None:
            known = casadi.vertcat(known, each)
    unknown = {s.name() for s in casadi.symvar(found)} - {s.name() for s in casadi.symvar(known)}
    if unknown:
        raise GaitError(
            f"the {what} function uses symbols that no instant has: {', '.join(sorted(unknown))}"
        )
    return found


def undefined(what: str, where: str) -> GaitError:
    """Error of a function of one's own that has no value.

    Parameters
    ----------
    what : str
        What it is: a cost, a constraint.
    where : str
        Of which motion it has none.
    """
    return GaitError(
        f"the {what} function is no finite number {where}. It must be one for every motion, those "
        "that break limits included: look at its roots, logarithms and quotients."
    )


def instant_of(
    support: Support, pressure: Symbols, driven: list[int], actuators: list[int]
) -> Instant:
    """Return the instant of a robot on one foot.

    Parameters
    ----------
    support : Support
        The robot.
    pressure : (2,) or (3,) object array
        Force along the ground and away from it.
    driven : list of int
        The joints of `support.torque`, in that order.
    actuators : list of int
        The joints with motors, in the order of the actuators.
    """
    order = [driven.index(joint) for joint in actuators]
    return Instant(
        position=expression(support.q),
        velocity=expression(support.v),
        torque=expression(support.torque[order]),
        motor_velocity=expression(support.v[actuators]),
        force=expression(pressure[:2]),
    )
