"""Found gaits, judged by equations and a program of their own.

    python benchmarks/gait_judge.py RESULTS.jsonl              # 21 of the 200 requests
    python benchmarks/gait_judge.py RESULTS.jsonl --most 40    # as many
    python benchmarks/gait_judge.py RESULTS.jsonl --check      # all, only checked

The requests are those of `benchmarks/gait_requests.py`, drawn so that each robot has its share
(seed 0). Each is designed, and judged three times:

- **check**: its polynomials are put into equations of motion that follow from the energies by
  Lagrange's equations. What is told is the worst violation of a limit at 1001 instants, the error
  of landing and of the impact, and how much the cost differs. Units are m, rad, weights, weights
  times m; of the point feet, which ground forces cannot turn, the unbalanced moment is told apart.
- **closes**: computed torque, event-driven, from the initial state; the state a little after the
  first touchdown against the mirror image of the one a step before.
- **more**: by how much the gait costs more than the best that another program finds, from the gait
  and from as many of the usual starts as `--starts` says. All coordinates, velocities,
  accelerations, forces and torques at 51 instants are unknowns. On flat feet joints follow one
  cubic each, as in the design, whose ranges and heights of the foot in the air are looked at at 501
  instants; on points Hermite and Simpson's rule joins them. Other limits hold at its instants only.

The package gives what the judge does not make itself: the request with its defaults, the starts,
the mirror image, and the height of the clearance profile. An error in those is not found. Requests
that are not drawn, or of which no gait was found, are not confirmed: nothing here shows that there
is no gait.

Results are added to the file line by line, and what is in it already is not done again.
"""

from __future__ import annotations

import argparse
import json
import time
from dataclasses import dataclass
from functools import cache
from itertools import islice
from pathlib import Path
from typing import Any

import casadi
import numpy as np
from gait_requests import REQUESTS, Asked, drawn, read
from gaits import ROBOTS
from rich.console import Console
from table import Table

import heelstrike as hs
from heelstrike.gait.optimize import request_of
from heelstrike.gait.starts import starts

SEGMENTS = 25
"""Of Hermite and Simpson's rule: an instant at both ends and in the middle of each."""
FINE = 1000
"""Intervals of the check."""
HEIGHTS = 500
"""Intervals between which the other program looks at the joints and at the height of a foot in the
air: a fifth of a millimetre between its 51 instants was worth 16 % of the cost of one gait."""
MOST = 21
"""Requests that are judged."""
AFTER = 0.05
"""Share of a step after a touchdown at which states are compared."""
NORMAL, SOLE = 0.1, 0.2
"""What every request leaves to the ground: a share of the weight as the least normal force, and one
of half the sole to its ends."""
LIFT = 1e-6
"""Speed (m/s) into the ground that the rear foot may have after an impact."""
EXACT = hs.EventDriven(rtol=1e-11, atol=1e-13)
SETTINGS = {"sb": "yes", "print_level": 0, "tol": 1e-8, "max_iter": 400}
NEAR = {
    "mu_init": 1e-4, "bound_push": 1e-4, "bound_frac": 1e-4, "slack_bound_push": 1e-4,
    "slack_bound_frac": 1e-4,
}  # fmt: skip
"""Settings of IPOPT; those for a start that is nearly an optimum besides."""
Array = np.ndarray


@dataclass(frozen=True)
class Equations:
    """A robot on one foot, by Lagrange's equations; level ground.

    Attributes
    ----------
    held : int
        Coordinates that follow from the others, because the foot stands: x, z and, on a flat one,
        pitch.
    balance : casadi.Function
        (q, v, a, F) to M a + h - JᵀF, springs and dampers in it: what motors have to exert.
    stand, swing : casadi.Function
        q to the places of the contact points of the feet: of a flat one the mean x and both
        heights.
    above : casadi.Function
        q to the heights of the other foot's contact points over a standing sole, wherever the trunk
        is; of flat feet only.
    rate : casadi.Function
        (q, v) to the velocity of the standing foot's places.
    bend : casadi.Function
        (q, v, a) to their acceleration.
    landing : casadi.Function
        (q, v) to the velocity of the other foot's.
    struck : casadi.Function
        (q, v⁻, v⁺, P) to M (v⁺ - v⁻) - JᵀP, with impulses P at the foot that lands.
    half : float
        Half the length of the sole; zero for a point (m).
    """

    robot: hs.Robot
    held: int
    balance: casadi.Function
    stand: casadi.Function
    swing: casadi.Function
    above: casadi.Function
    rate: casadi.Function
    bend: casadi.Function
    landing: casadi.Function
    struck: casadi.Function
    half: float


@cache
def equations(name: str) -> Equations:
    """Derive the equations of a robot of the library."""
    robot = hs.load_robot(name)
    model = robot.model
    q, v, a = (casadi.SX.sym(each, model.nv) for each in "qva")
    if np.any(model.dry_friction) or model.loops or model.couplings:
        raise SystemExit(f"{name}: dry friction and closed loops are not among these equations")
    angle: list[Any] = []
    origin: list[Any] = []

    def turned(by: Any, place: Any) -> Any:
        """Turn a vector about +y, which brings x towards -z."""
        c, s = casadi.cos(by), casadi.sin(by)
        return casadi.vertcat(c * place[0] + s * place[1], c * place[1] - s * place[0])

    kinetic, potential = 0.5 * casadi.dot(model.armature, v**2), 0.0
    for i, parent in enumerate(model.parent.tolist()):
        moved = q[i] - model.reference[i]
        turn, *slide = model.axis[i]
        along = casadi.DM(model.offset[i]) + casadi.DM(slide) * moved
        origin.append(along if parent < 0 else origin[parent] + turned(angle[parent], along))
        angle.append((0.0 if parent < 0 else angle[parent]) + turn * moved)
        center = origin[i] + turned(angle[i], model.center_of_mass[i])
        spin = casadi.jtimes(angle[i], q, v)
        speed = casadi.jtimes(center, q, v)
        kinetic += 0.5 * (model.mass[i] * casadi.sumsqr(speed) + model.inertia[i] * spin**2)
        potential -= model.mass[i] * casadi.dot(model.gravity, center)
    potential += 0.5 * casadi.dot(model.stiffness, (q - casadi.DM(model.rest)) ** 2)
    momentum = casadi.gradient(kinetic, v)
    mass = casadi.jacobian(momentum, v)
    rest = casadi.jtimes(momentum, q, v) - casadi.gradient(kinetic - potential, q)
    rest += casadi.DM(model.damping) * v

    def discs(number: int) -> tuple[list[Any], list[float]]:
        """Centres and radii of a foot's contact discs."""
        contacts = robot.feet[number].contacts
        link = [(i, model.contact_link[i]) for i in contacts]
        centers = [origin[j] + turned(angle[j], model.contact_position[i]) for i, j in link]
        return centers, [float(model.contact_radius[i]) for i in contacts]

    def foot(number: int) -> tuple[Any, Any, Any]:
        """Places, their Jacobian, and the Jacobian of forces: along the ground, then upwards."""
        centers, radii = discs(number)
        if len(centers) == 1 and radii[0]:
            raise SystemExit(f"{name}: a round foot rolls, which is not among these equations")
        across = sum(each[0] for each in centers) / len(centers)
        heights = [each[1] - radius for each, radius in zip(centers, radii, strict=True)]
        places = casadi.vertcat(across, *heights)
        # A force along the ground acts at the bottom of the discs, below their centres.
        turn = casadi.gradient(angle[robot.feet[number].link], q).T
        forward = casadi.jacobian(across, q) - float(np.mean(radii)) * turn
        return places, forward, casadi.vertcat(forward, casadi.jacobian(places[1:], q))

    stand, _, pushed = foot(0)
    swing, _, struck = foot(1)
    forces = casadi.SX.sym("F", stand.numel())
    after, impulse = casadi.SX.sym("after", model.nv), casadi.SX.sym("P", swing.numel())
    velocity = casadi.jtimes(stand, q, v)
    bend = casadi.jtimes(velocity, q, v) + casadi.jtimes(velocity, v, a)

    def made(of: str, inputs: list[Any], output: Any) -> casadi.Function:
        return casadi.Function(of, inputs, [casadi.cse(output)])

    contacts = model.contact_position[list(robot.feet[0].contacts)]
    centers, radii = discs(0)
    first, last = centers[0], centers[-1]
    above = casadi.SX()
    if len(radii) > 1:
        assert len({*radii, *discs(1)[1]}) == 1
        ahead = (last - first) / casadi.norm_2(last - first)
        up = casadi.vertcat(-ahead[1], ahead[0]) * float(np.sign(contacts[-1, 0] - contacts[0, 0]))
        above = casadi.vertcat(*(casadi.dot(up, each - first) for each in discs(1)[0]))
    return Equations(
        robot=robot,
        held=stand.numel(),
        balance=made("balance", [q, v, a, forces], mass @ a + rest - pushed.T @ forces),
        stand=made("stand", [q], stand),
        swing=made("swing", [q], swing),
        above=made("above", [q], above),
        rate=made("rate", [q, v], velocity),
        bend=made("bend", [q, v, a], bend),
        landing=made("landing", [q, v], struck @ v),
        struck=made("struck", [q, v, after, impulse], mass @ (after - v) - struck.T @ impulse),
        half=0.5 * float(np.linalg.norm(contacts[0] - contacts[-1])),
    )


def torque_limits(robot: hs.Robot) -> tuple[Array, Array]:
    """Least and greatest torques of the joints, all of which have motors."""
    assert sorted(robot.model.actuator_joint.tolist()) == list(range(3, robot.nv))
    order = np.argsort(robot.model.actuator_joint)
    return robot.model.torque_lower[order], robot.model.torque_upper[order]


def pressed(of: Equations, forces: Any, friction: Any) -> Any:
    """Limits of forces or impulses (along the ground, then upwards): none negative. In their unit.

    Upwards; the cone, forwards and backwards; and on a sole the centre, towards its toe and heel.
    """
    along, up = forces[0], sum(forces[k] for k in range(1, of.held))
    rows = [up, friction * up - along, friction * up + along]
    if of.half:
        center, inside = 0.5 * (forces[2] - forces[1]), 0.5 * (1.0 - SOLE) * up
        # In units of the sole's length: which point is the toe's does not matter.
        rows += [inside - center, inside + center]
    return rows


def moving(of: Equations, gait: hs.Gait, shares: Array) -> tuple[Array, Array, Array]:
    """Positions, velocities and accelerations (nv, N) of all coordinates at shares of a step."""
    robot, times = of.robot, shares * gait.step_duration
    joints = robot.model.actuator_joint
    found = np.zeros((3, robot.nv, shares.size))
    for order in range(3):
        found[order][joints] = gait.in_step(times, order=order).T
        if not of.half:
            found[order][2] = gait.pitch(times, order=order)
    q, v, a = found
    x, first = casadi.SX.sym("x", robot.nv), np.arange(of.held)
    slopes = casadi.Function("slopes", [x], [casadi.jacobian(of.stand(x), x)])
    place = gait.initial_state.q.copy()
    for k in range(shares.size):
        place[of.held :] = q[of.held :, k]
        for _ in range(20):
            rows = np.array(slopes(place))[:, first]
            missing = np.array(of.stand(place)).ravel()
            place[first] -= np.linalg.solve(rows, missing)
        assert np.abs(np.array(of.stand(place))).max() < 1e-12
        q[:, k] = place
        v[first, k] = np.linalg.solve(rows, -np.array(of.rate(place, v[:, k])).ravel())
        a[first, k] = np.linalg.solve(rows, -np.array(of.bend(place, v[:, k], a[:, k])).ravel())
    return q, v, a


def exerted(of: Equations, q: Array, v: Array, a: Array) -> tuple[Array, Array, Array]:
    """Forces of the ground (held, N), torques (nu, N) and what pitch lacks (N,)."""
    nothing = np.zeros(of.held)
    forces, torques, lacks = [], [], []
    for now in zip(q.T, v.T, a.T, strict=True):
        rest = np.array(of.balance(*now, nothing)).ravel()
        columns = [rest - np.array(of.balance(*now, each)).ravel() for each in np.eye(of.held)]
        pushed = np.linalg.solve(np.transpose(columns)[: of.held], rest[: of.held])
        left = rest - np.transpose(columns) @ pushed
        forces.append(pushed)
        torques.append(left[3:])
        lacks.append(np.abs(left[of.held : 3]).max(initial=0.0))
    return np.transpose(forces), np.transpose(torques), np.array(lacks)


def landed(of: Equations, q: Array, before: Array, after: Array) -> tuple[Array, float]:
    """Impulse (held, N s) of a landing between two velocities, and what of it no impulse gives."""
    nothing = np.zeros(of.held)
    rest = np.array(of.struck(q, before, after, nothing)).ravel()
    columns = np.transpose(
        [rest - np.array(of.struck(q, before, after, each)).ravel() for each in np.eye(of.held)]
    )
    impulse = np.linalg.lstsq(columns, rest)[0]
    return impulse, float(np.abs(rest - columns @ impulse).max())


def check(of: Equations, asked: Asked, gait: hs.Gait) -> dict[str, float]:
    """Judge a gait as it is: errors, and the worst violations of what was asked."""
    robot, weight = of.robot, of.robot.weight
    mirror = robot.mirror
    shares = np.linspace(0.0, 1.0, FINE + 1)
    q, v, a = moving(of, gait, shares)
    forces, torques, lacks = exerted(of, q, v, a)
    least, most = torque_limits(robot)
    lower, upper = robot.model.lower[3:, None], robot.model.upper[3:, None]
    heights = np.array(of.swing.map(shares.size)(q))[1:]
    hump = asked.clearance * gait.clearance_profile.height(shares)
    limits = {
        "force": np.concatenate(pressed(of, forces / weight, asked.friction)),
        "normal": forces[1:].sum(axis=0) / weight - NORMAL,
        "torque": np.minimum(most - torques.T, torques.T - least) / weight,
        "range": np.minimum(upper - q[3:], q[3:] - lower),
        "clearance": (heights - hump)[:, 1:-1],
    }
    end, before = q[:, -1], v[:, -1]
    after = mirror.velocity(v[:, 0])
    impulse, unbalanced = landed(of, end, before, after)
    place = np.array(of.swing(end)).ravel() - [asked.length, *np.zeros(of.held - 1)]
    away = np.array(of.rate(end, after)).ravel()[1:]
    down = np.array(of.landing(end, before)).ravel()[1:]
    limits |= {
        "impulse": np.array(pressed(of, impulse / weight, asked.friction)),
        "lift": away + LIFT,
        "landing": -down,
    }
    bare = {name: max(0.0, -float(np.min(each))) for name, each in limits.items()}
    worst = max(bare, key=lambda name: bare[name])
    inner = np.ones(FINE + 1)
    inner[1:-1:2], inner[2:-1:2] = 4.0, 2.0
    cost = float((torques**2).sum(axis=0) @ inner) * gait.step_duration / FINE / 3.0
    periodic = np.abs(mirror.position(q[:, 0]) - end)[of.held :].max()
    return {
        "violated": bare[worst],
        "limit": worst if bare[worst] else "",
        "lands": float(max(np.abs(place).max(), periodic)),
        "impact": float(unbalanced / weight),
        "lacks": float(lacks.max() / weight),
        "cost": cost,
    }


def closes(gait: hs.Gait, robot: hs.Robot, friction: float) -> float:
    """How the state after a touchdown differs from the mirror image of the one a step before."""
    ground = hs.Ground(friction=friction)
    simulation = hs.Simulation(
        robot, hs.ComputedTorque(robot, gait), state=gait.initial_state, method=EXACT, ground=ground
    )
    late = AFTER * gait.step_duration
    simulation.advance(late)
    begun = robot.mirror.state(simulation.state).vector
    simulation.advance(gait.step_duration + late)
    gone = simulation.state.vector.copy()
    gone[0] -= gait.step_length
    return float(np.abs(gone - begun).max())


def settings(**more: float) -> dict[str, Any]:
    """Return settings of the solver."""
    return {"print_time": False, "ipopt": SETTINGS | more}


def powers(shares: Array, order: int) -> Array:
    """Powers of shares of a step up to the third, or their derivatives, (4, N)."""
    return np.array([
        np.prod(np.arange(k, k - order, -1)) * shares ** max(k - order, 0) for k in range(4)
    ])  # fmt: skip


@dataclass(frozen=True)
class Unknowns:
    """Of the other program, a column an instant; forces and torques in weights."""

    q: Any
    v: Any
    a: Any
    forces: Any
    torques: Any
    after: Any
    """(nv,) Velocity after the impact."""
    impulse: Any
    """(held,) Impulse over the weight (s)."""
    cubics: Any
    """(nv - held, 4) Of the free coordinates, by the share of the step; of flat feet only."""

    def stacked(self) -> Any:
        """All of them in one column."""
        return casadi.veccat(*self.__dict__.values())


class Other:
    """The other program of a robot; step, friction and clearance are its parameters."""

    def __init__(self, name: str) -> None:
        of = self.of = equations(name)
        robot, count = of.robot, 2 * SEGMENTS + 1
        weight, nv, held = robot.weight, robot.nv, of.held
        sizes = {
            "q": (nv, count), "v": (nv, count), "a": (nv, count), "forces": (held, count),
            "torques": (robot.nu, count), "after": (nv, 1), "impulse": (held, 1),
            "cubics": (nv - held, 4 if of.half else 0),
        }  # fmt: skip
        x = Unknowns(**{each: casadi.MX.sym(each, *size) for each, size in sizes.items()})
        length, duration, friction = (casadi.MX.sym(each) for each in "LTm")
        self.heights = np.linspace(0.0, 1.0, (HEIGHTS if of.half else 2 * SEGMENTS) + 1)
        hump = casadi.MX.sym("hump", 1, self.heights.size)
        least, most = torque_limits(robot)
        equal, positive = [], []
        motor = casadi.vertcat(casadi.MX.zeros(3, count), x.torques)
        pushed = weight * x.forces
        balance = of.balance.map(count)(x.q, x.v, x.a, pushed) / weight - motor
        equal += [balance, of.stand.map(count)(x.q)]
        equal += [of.rate.map(count)(x.q, x.v), of.bend.map(count)(x.q, x.v, x.a)]
        begin, middle, end = (slice(k, count - 2 + k, 2) for k in range(3))
        free, h = slice(held, None), duration / SEGMENTS
        if of.half:
            shares = np.linspace(0.0, 1.0, count)
            for order, motion in enumerate((x.q, x.v, x.a)):
                rate = x.cubics @ casadi.sparsify(casadi.DM(powers(shares, order)))
                equal.append(motion[free, :] - rate / duration**order)
            joints = x.cubics @ casadi.DM(powers(self.heights, 0))
            posture = casadi.vertcat(casadi.MX.zeros(held, self.heights.size), joints)
            heights = of.above.map(self.heights.size)(posture)
            positive += [joints - robot.model.lower[3:], robot.model.upper[3:] - joints]
        else:
            for motion, rate in ((x.q, x.v), (x.v, x.a)):
                y, f = motion[free, :], rate[free, :]
                y0, y1, y2, f0, f1, f2 = (
                    each[:, part] for each in (y, f) for part in (begin, middle, end)
                )
                equal.append(y2 - y0 - h / 6.0 * (f0 + 4.0 * f1 + f2))
                equal.append(y1 - 0.5 * (y0 + y2) - h / 8.0 * (f0 - f2))
            heights = of.swing.map(count)(x.q)[1:, :]
        positive += pressed(of, [x.forces[k, :] for k in range(held)], friction)
        positive.append(casadi.sum1(x.forces[1:, :]) - NORMAL)
        positive += [heights[k, 1:-1] - hump[1:-1] for k in range(held - 1)]
        last, before = x.q[:, -1], x.v[:, -1]
        equal.append(of.struck(last, before, x.after, weight * x.impulse) / weight)
        equal.append(of.landing(last, x.after))
        equal.append(of.swing(last) - casadi.vertcat(length, casadi.DM.zeros(held - 1)))
        mirror = robot.mirror.among(range(nv))
        image, about = mirror.joint.tolist(), casadi.DM(mirror.reference)
        signs = casadi.DM(mirror.sign)
        reflected = signs * (last[image] - about[image]) + about
        equal.append(reflected[free] - x.q[free, 0])
        equal.append((signs * x.after[image])[free] - x.v[free, 0])
        positive += pressed(of, [x.impulse[k] for k in range(held)], friction)
        positive += [-of.landing(last, before)[1:], of.rate(last, x.after)[1:] + LIFT]
        weights = np.full(count, 2.0)
        weights[1::2], weights[0], weights[-1] = 4.0, 1.0, 1.0
        cost = duration / SEGMENTS / 6.0 * (casadi.sum1(x.torques**2) @ casadi.DM(weights))
        given = casadi.veccat(length, duration, friction, hump)
        equal_rows, more_rows = (casadi.veccat(*each) for each in (equal, positive))
        rows = casadi.vertcat(equal_rows, more_rows)
        program = {"x": x.stacked(), "p": given, "f": cost, "g": rows}
        self.far = casadi.nlpsol("far", "ipopt", program, settings())
        self.near = casadi.nlpsol("near", "ipopt", program, settings(**NEAR))
        self.high = np.concatenate(
            [np.zeros(equal_rows.numel()), np.full(more_rows.numel(), np.inf)]
        )
        free_of_bounds = Unknowns(**{each: np.full(s, np.inf) for each, s in sizes.items()})
        low, high = (
            Unknowns(**{each: sign * size for each, size in free_of_bounds.__dict__.items()})
            for sign in (-1.0, 1.0)
        )
        for bounds, joints, torques in (
            (low, robot.model.lower, least), (high, robot.model.upper, most)
        ):  # fmt: skip
            bounds.q[3:] = joints[3:, None]
            bounds.torques[:] = torques[:, None] / weight
        self.bounds = [np.array(each.stacked()).ravel() for each in (low, high)]

    def found(
        self, solver: casadi.Function, asked: Asked, profile: Any, guess: Unknowns
    ) -> tuple[float, bool]:
        """Cost of the optimum from a guess (N²m²s), and whether it is one."""
        hump = asked.clearance * profile.height(self.heights)
        result = solver(
            x0=guess.stacked(), p=np.array([asked.length, asked.duration, asked.friction, *hump]),
            lbx=self.bounds[0], ubx=self.bounds[1], lbg=0.0, ubg=self.high,
        )  # fmt: skip
        cost = float(result["f"]) * self.of.robot.weight**2
        return cost, solver.stats()["return_status"] == "Solve_Succeeded"

    def guess(self, motion: tuple[Array, Array, Array]) -> Unknowns:
        """Guess of a motion of all coordinates."""
        of, weight = self.of, self.of.robot.weight
        q, v, a = motion
        forces, torques, _ = exerted(of, q, v, a)
        shares = np.linspace(0.0, 1.0, q.shape[1])
        cubics = np.zeros((q.shape[0] - of.held, 0))
        if of.half:
            cubics = np.polynomial.polynomial.polyfit(shares, q[of.held :].T, 3).T
        after = of.robot.mirror.velocity(v[:, 0])
        impulse = landed(of, q[:, -1], v[:, -1], after)[0] / weight
        return Unknowns(q, v, a, forces / weight, torques / weight, after, impulse, cubics)


@cache
def other(name: str) -> Other:
    """Return the other program of a robot."""
    return Other(name)


def of_start(of: Equations, gait: hs.Gait, start: Any) -> tuple[Array, Array, Array]:
    """Motion of all coordinates of one of the usual starts: only its trunk is reckoned here."""

    class Drawn:
        """What `moving` reads of a gait."""

        step_duration = gait.step_duration
        initial_state = gait.initial_state

        def at(self, times: Array, order: int) -> Array:
            return start.motion(times / self.step_duration)[order]

        def in_step(self, times: Array, *, order: int) -> Array:
            joints = self.at(times, order)[-of.robot.nu :]
            return joints[of.robot.model.actuator_joint - 3].T

        def pitch(self, times: Array, *, order: int) -> Array:
            return self.at(times, order)[0]

    return moving(of, Drawn(), np.linspace(0.0, 1.0, 2 * SEGMENTS + 1))  # type: ignore[arg-type]


def compared(asked: Asked, gait: hs.Gait, count: int) -> dict[str, Any]:
    """Look for a cheaper gait with the other program."""
    program = other(asked.robot)
    of, profile = program.of, gait.clearance_profile
    shares = np.linspace(0.0, 1.0, 2 * SEGMENTS + 1)
    motions = [moving(of, gait, shares)]
    request = request_of(of.robot, **asked.arguments())
    motions += [of_start(of, gait, start) for start in islice(starts(request), count)]
    costs = []
    for motion in motions:
        solver = program.far if costs else program.near
        cost, optimal = program.found(solver, asked, profile, program.guess(motion))
        costs.append(cost if optimal else None)
    known = [each for each in costs if each is not None]
    more = gait.cost / min(known) - 1.0 if known else None
    return {"others": costs, "more": more}


def judged(seed: int, count: int | None) -> dict[str, Any]:
    """Design the gait of a request, and judge it; `count` is of the usual starts, None: check."""
    asked = drawn(seed)
    of = equations(asked.robot)
    begin = time.process_time()
    try:
        gait = hs.optimize_gait(of.robot, **asked.arguments())
    except hs.GaitError as error:
        return {"robot": asked.robot, "message": str(error)}
    own = check(of, asked, gait)
    result = {
        "robot": asked.robot, "design": gait.cost, **own, "optimal": gait.optimal,
        "differs": abs(own["cost"] / gait.cost - 1.0),
        "closes": closes(gait, of.robot, asked.friction),
    }  # fmt: skip
    if count is not None:
        result |= compared(asked, gait, count)
    return {**result, "seconds": time.process_time() - begin}


def sample(most: int) -> list[int]:
    """Seeds of requests, so many of each robot as of the others, in a random order."""
    seeds = np.random.default_rng(0).permutation(REQUESTS).tolist()
    own: dict[str, list[int]] = {name: [] for name in ROBOTS}
    for seed in seeds:
        own[drawn(seed).robot].append(seed)
    turn = [
        each for row in range(REQUESTS) for own_ in own.values() for each in own_[row : row + 1]
    ]
    return turn[:most]


def table(results: dict[int, dict[str, Any]]) -> Table:
    """Show the worst of each robot."""
    body = []
    for name in (*ROBOTS, "all"):
        own = [each for each in results.values() if name in (each["robot"], "all")]
        good = [each for each in own if "message" not in each]
        if not good:
            continue
        worst = [
            f"{max(each[key] for each in good):.0e}"
            for key in ("violated", "lands", "impact", "differs", "closes")
        ]
        more = [100.0 * each["more"] for each in good if each.get("more") is not None]
        within = f"{sum(each <= 1.0 for each in more)} of {len(more)}"
        told = [f"{np.median(more):.3f}", f"{max(more):.2f}"] if more else ["", ""]
        body.append([name, str(len(own)), str(len(good)), *worst, within, *told])
    head = ["robot", "requests", "found", "violated", "lands", "impact", "cost differs", "closes"]
    return Table("", [*head, "within 1 %", "more (%): median", "most"], body)


def main() -> None:
    """Judge, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("results", type=Path)
    parser.add_argument("--most", type=int, help=f"requests, {MOST} by default; all with --check")
    parser.add_argument("--starts", type=int, default=1, help="of the other program; 1 by default")
    parser.add_argument("--check", action="store_true", help="without the other program")
    given = parser.parse_args()
    results = read(given.results)
    most = given.most or (REQUESTS if given.check else MOST)
    with given.results.open("a", encoding="utf-8") as file:
        for seed in sample(most):
            if seed in results and (given.check or "more" in results[seed]):
                continue
            results[seed] = {"seed": seed, **judged(seed, None if given.check else given.starts)}
            file.write(json.dumps(results[seed]) + "\n")
            file.flush()
    Console(width=180).print(table(results))


if __name__ == "__main__":
    main()
