"""Where to start the optimiser of a gait on point feet: a step drawn by inverse kinematics."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import product
from typing import Any

import casadi
import numpy as np
from numpy.typing import NDArray

from heelstrike.dynamics.symbolic import TracedDynamics, symbols
from heelstrike.gait import cubic
from heelstrike.gait.request import Request
from heelstrike.gait.starts import BENT, DAMPING, HEIGHTS, LEANS, SWEEPS, typical_step

Floats = NDArray[np.float64]
Motion = Callable[[Any], tuple[Floats, Floats, Floats]]


def point_starts(request: Request) -> Iterator[tuple[Motion, float, float]]:
    """Motions of pitch and joints with their duration and length, the most promising ones first.

    Each goes along the parabola from the mirror image of a posture with both feet on the ground,
    through one with the swing foot passing the stance foot, to that posture.
    """
    length, duration = typical_step(request)
    mirror = request.robot.mirror
    assert mirror is not None
    reference = request.robot.model.reference
    for bend, lean, height in product((1.0, -1.0), LEANS, HEIGHTS):
        legs = height * request.height
        low = float(np.sqrt(max(legs**2 - (0.5 * length) ** 2, (0.5 * legs) ** 2)))
        lift = request.clearance + 0.02 * request.height
        end = _posture(request, (length, 0.0), (0.5 * length, low, lean), bend)
        middle = _posture(request, (0.0, lift), (0.0, legs, lean), bend)
        start = mirror.position(end, reference)
        yield _parabola(start[2:], middle[2:], end[2:], duration), duration, length


def _parabola(start: Floats, middle: Floats, end: Floats, duration: float) -> Motion:
    change = 2.0 * (end - start) / duration
    bow = 8.0 / duration * (middle - 0.5 * (start + end))
    curve = cubic.coefficients(start, end, 0.5 * (change + bow), 0.5 * (change - bow), duration)
    columns = [part[:, None] for part in curve]

    def motion(t: Any) -> tuple[Floats, Floats, Floats]:
        time = np.atleast_1d(t)[None, :]
        ones = np.ones_like(time)
        return (
            cubic.position(columns, time),
            cubic.velocity(columns, time),
            cubic.acceleration(columns, time) * ones,
        )

    return motion


def _posture(
    request: Request, swing: tuple[float, float], trunk: tuple[float, float, float], bend: float
) -> Floats:
    """All coordinates with the stance point at the origin and the rest as nearly as can be."""
    robot, model = request.robot, request.robot.model
    q = casadi.SX.sym("q", robot.nv)
    dynamics = TracedDynamics(robot, symbols(q))
    feet = [
        dynamics.point_position(foot.link, model.contact_position[foot.contacts[0]])
        for foot in (request.stance, request.swing)
    ]
    radius = float(model.contact_radius[request.stance.contacts[0]])
    places = casadi.vertcat(*feet[0], *feet[1], *dynamics.work.origin[2], dynamics.work.angle[2])
    function = casadi.Function("places", [q], [places, casadi.jacobian(places, q)])
    target = np.array([0.0, radius, swing[0], swing[1] + radius, *trunk])
    now = np.clip(model.reference, request.lower, request.upper)
    for foot in (request.stance, request.swing):
        # The joints of a leg but its first: the knees.
        link = foot.link
        while model.parent[link] > 2:
            if model.axis[link, 0] != 0.0:
                now[link] += bend * BENT * model.axis[link, 0]
            link = int(model.parent[link])
    now = np.clip(now, request.lower, request.upper)
    for _ in range(SWEEPS):
        value, jacobian = (np.array(part) for part in function(now))
        missing = target - value.ravel()
        if np.abs(missing).max() < 1e-9:
            break
        normal = jacobian.T @ jacobian + DAMPING * np.eye(now.size)
        step = np.linalg.solve(normal, jacobian.T @ missing)
        step /= max(1.0, float(np.abs(step).max()) / BENT)
        now = np.clip(now + step, request.lower, request.upper)
    return now
