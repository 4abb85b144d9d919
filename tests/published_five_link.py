"""The five-link problem as published, in its own coordinates and with another transcription.

M. Kelly, *An introduction to trajectory optimization: how to do your own direct collocation*, SIAM
Review 59 (2017), section 6, and the example of OptimTraj that goes with it. Absolute angles of the
links (stance tibia, stance femur, torso, swing femur, swing tibia), counter-clockwise from the
vertical; the state and the torques are unknowns; Hermite-Simpson collocation. Nothing of heelstrike
is in here: the equations of motion follow from the energies by Lagrange's equations.

The example has no constraint on the swing foot between lift-off and touchdown, none on friction and
none on the ground's pull. Its bounds are those below.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi
import numpy as np

# Of links from the stance tibia to the swing tibia: kg, kg m², m, m from its upper end to its
# centre of mass (the joint nearer to the torso; for the torso, the shoulder).
MASS = (3.2, 6.8, 20.0, 6.8, 3.2)
INERTIA = (0.93, 1.08, 2.22, 1.08, 0.93)
LENGTH = (0.4, 0.4, 0.625, 0.4, 0.4)
CENTER = (0.128, 0.163, 0.2, 0.163, 0.128)
GRAVITY = 9.81

STEP_LENGTH, STEP_DURATION = 0.5, 0.7
ANGLE, RATE, TORQUE = np.pi / 2, 10.0, 100.0  # bounds of rad, rad/s, N m
# What its authors start from, at the beginning of the step.
GUESS = (-0.3, 0.7, 0.0, -0.5, -0.6)


@dataclass(frozen=True)
class Solution:
    """Cost ∫Σu² dt in N²m²s, and the greatest backward bend of a knee in rad."""

    cost: float
    bent_back: float


def solve(segments: int, *, knees: bool = True) -> Solution:
    """Solve the problem on equal segments; without `knees`, they may bend back."""
    dynamics, impact, foot = _functions()
    count = 2 * segments + 1  # ends and middles
    state = casadi.MX.sym("state", 10, count)
    torque = casadi.MX.sym("torque", 4, count)  # the stance ankle has none
    rate = dynamics.map(count)(state, torque)
    begin, middle, end = (slice(k, count - 2 + k, 2) for k in range(3))
    h = STEP_DURATION / segments
    x0, x1, x2 = state[:, begin], state[:, middle], state[:, end]
    f0, f1, f2 = rate[:, begin], rate[:, middle], rate[:, end]
    effort = casadi.sum1(torque**2)
    cost = h / 6.0 * casadi.sum2(effort[begin] + 4.0 * effort[middle] + effort[end])
    first, last = state[:, 0], state[:, -1]
    place, speed = foot(last)
    exact = casadi.vertcat(
        casadi.vec(x2 - x0 - h / 6.0 * (f0 + 4.0 * f1 + f2)),
        casadi.vec(x1 - 0.5 * (x0 + x2) - h / 8.0 * (f0 - f2)),
        first - impact(last),
        place - casadi.DM([STEP_LENGTH, 0.0]),
    )
    bends = casadi.horzcat(state[0, :] - state[1, :], state[4, :] - state[3, :]).T
    # The foot leaves the ground, and lands; no knee bends back.
    limited = casadi.vertcat(-foot(first)[1], speed, bends if knees else casadi.MX())
    unknowns = casadi.veccat(state, torque)
    bound = np.concatenate([np.tile([ANGLE] * 5 + [RATE] * 5, count), np.full(4 * count, TORQUE)])
    solver = casadi.nlpsol(
        "solver",
        "ipopt",
        {"x": unknowns, "f": cost, "g": casadi.vertcat(exact, limited)},
        {"print_time": False, "ipopt": {"sb": "yes", "print_level": 0, "tol": 1e-9}},
    )
    share = np.linspace(0.0, 1.0, count)
    angles = np.outer(GUESS, 1.0 - share) + np.outer(GUESS[::-1], share)
    rates = np.tile(np.subtract(GUESS[::-1], GUESS)[:, None] / STEP_DURATION, count)
    guess = casadi.veccat(casadi.DM(np.vstack([angles, rates])), casadi.DM.zeros(4, count))
    low = np.concatenate([np.zeros(exact.numel()), np.full(limited.numel(), -np.inf)])
    found = solver(x0=guess, lbx=-bound, ubx=bound, lbg=low, ubg=0.0)
    assert solver.stats()["return_status"] == "Solve_Succeeded"
    bent = casadi.Function("bent", [unknowns], [bends])(found["x"])
    return Solution(float(found["f"]), float(np.max(np.array(bent))))


def _functions() -> tuple[casadi.Function, casadi.Function, casadi.Function]:
    """(x, u) to the rate of the state; the state after the impact; the swing foot's place, rise."""
    base, angle = casadi.SX.sym("base", 2), casadi.SX.sym("angle", 5)
    base_rate, angle_rate = casadi.SX.sym("base_rate", 2), casadi.SX.sym("angle_rate", 5)
    q, v = casadi.vertcat(base, angle), casadi.vertcat(base_rate, angle_rate)
    ups = [casadi.vertcat(-casadi.sin(angle[k]), casadi.cos(angle[k])) for k in range(5)]
    knee = base + LENGTH[0] * ups[0]
    hip = knee + LENGTH[1] * ups[1]
    shoulder = hip + LENGTH[2] * ups[2]
    swing_knee = hip - LENGTH[3] * ups[3]
    tip = swing_knee - LENGTH[4] * ups[4]
    tops = (knee, hip, shoulder, hip, swing_knee)
    centers = [top - c * up for top, c, up in zip(tops, CENTER, ups, strict=True)]
    kinetic: Any = 0.0
    potential: Any = 0.0
    for k, center in enumerate(centers):
        velocity = casadi.jtimes(center, q, v)
        kinetic += 0.5 * (MASS[k] * casadi.sumsqr(velocity) + INERTIA[k] * angle_rate[k] ** 2)
        potential += MASS[k] * GRAVITY * center[1]
    momentum = casadi.gradient(kinetic, v)
    mass = casadi.jacobian(momentum, v)
    rest = casadi.jtimes(momentum, q, v) - casadi.gradient(kinetic - potential, q)

    u = casadi.SX.sym("u", 4)
    force = casadi.vertcat(-u[0], u[0] - u[1], u[1] - u[2], u[2] - u[3], u[3])
    turn = casadi.solve(mass[2:, 2:], force - rest[2:])
    x = casadi.vertcat(angle, angle_rate)
    at_rest = [casadi.SX.zeros(2)] * 2  # the stance foot, at the origin

    def of_state(name: str, inputs: list[Any], outputs: list[Any]) -> casadi.Function:
        fixed = casadi.substitute(outputs, [base, base_rate], at_rest)
        return casadi.Function(name, inputs, fixed)

    dynamics = of_state("dynamics", [x, u], [casadi.vertcat(angle_rate, turn)])
    # A plastic impact of the tip while the stance foot is let go; then the legs change roles.
    rows = casadi.jacobian(tip, q)
    answer = casadi.solve(
        casadi.vertcat(casadi.horzcat(mass, -rows.T), casadi.horzcat(rows, casadi.SX.zeros(2, 2))),
        casadi.vertcat(mass @ v, casadi.SX.zeros(2)),
    )
    after = casadi.vertcat(angle[::-1], answer[2:7][::-1])
    impact = of_state("impact", [x], [after])
    foot = of_state("foot", [x], [tip, casadi.jtimes(tip, q, v)[1]])
    return dynamics, impact, foot
