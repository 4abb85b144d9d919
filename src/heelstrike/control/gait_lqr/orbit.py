"""The walk over a phase that repeats: states, torques, and the equations of motion about it.

All are found at the nodes of Chebyshev polynomials in the phase θ and interpolated, which for
smooth motions is exact to rounding. Where the trunk is follows from the stance foot: a disturbance
is (δp, δṗ), p all coordinates but the trunk's x and z.
"""

from __future__ import annotations

import numpy as np
from numpy.polynomial import Chebyshev
from numpy.polynomial.chebyshev import chebder, chebpts1, chebvander
from numpy.typing import ArrayLike

from heelstrike.contact import ActiveContacts, contact_inverse_dynamics, linearize_contact
from heelstrike.contact.linearized.slopes import both, following
from heelstrike.errors import ControllerError
from heelstrike.field_texts import dataclass
from heelstrike.gait.phased.phased_gait import PhasedGait
from heelstrike.gait.phased.surface import Surface, Touchdown
from heelstrike.robot.model import Floats

NODES = 48

INVARIANT = 1e-6
"""Impacts may lead this far from the beginning of the gait (rad, and in slopes)."""


@dataclass(frozen=True, eq=False)
class Course:
    """A quantity over the phase, as Chebyshev series of its entries."""

    first: float
    last: float
    """first, last: Ends of the phase (rad)."""
    coefficients: Floats
    """(NODES, ...)"""

    @classmethod
    def through(cls, first: float, last: float, values: Floats) -> Course:
        """Interpolate values at the nodes."""
        flat = values.reshape(NODES, -1)
        terms = chebvander(chebpts1(NODES), NODES - 1)
        series = np.asarray(np.linalg.solve(terms, flat), dtype=np.float64)
        return cls(first, last, series.reshape(values.shape))

    def __call__(self, theta: ArrayLike) -> Floats:
        """Values at phases, (..., entries)."""
        x = (2.0 * np.asarray(theta) - self.first - self.last) / (self.last - self.first)
        terms = chebvander(x, NODES - 1).reshape(*x.shape, NODES)
        moved: Floats = np.tensordot(terms, self.coefficients, axes=1)
        return moved

    def slope(self) -> Course:
        """Its derivative by θ."""
        derivative = np.zeros_like(self.coefficients)
        derivative[:-1] = chebder(self.coefficients, axis=0) * 2.0 / (self.last - self.first)
        return Course(self.first, self.last, derivative)


@dataclass(frozen=True, eq=False)
class Orbit:
    """The walk that repeats, from just after one touchdown to just before the next."""

    gait: PhasedGait
    touchdown: Touchdown
    """Its end."""
    q: Course
    v: Course
    torque: Course
    """q, v, torque: Course of (nq,), (nv,) and (nu,). The walk."""
    rate: Course
    """Course of (). θ̇ (rad/s)."""
    A: Course
    B: Course
    """A, B: Course of (2 p, 2 p) and (2 p, nu). d/dt (δp, δṗ) = A (δp, δṗ) + B δτ while the stance
    foot stays in place."""

    @property
    def flow(self) -> Course:
        """d/dt (p, ṗ) along the walk."""
        values = np.array([self.slope_at(theta) for theta in nodes(self.q.first, self.q.last)])
        return Course.through(self.q.first, self.q.last, values)

    def slope_at(self, theta: float) -> Floats:
        """d/dt (p, ṗ) at a phase."""
        rate = float(self.rate(theta))
        return rate * np.concatenate([self.q.slope()(theta)[2:], self.v.slope()(theta)[2:]])


def nodes(first: float, last: float) -> Floats:
    """Phases of the nodes."""
    return np.asarray(0.5 * (first + last) + 0.5 * (last - first) * chebpts1(NODES))


def orbit_of(gait: PhasedGait) -> Orbit:
    """Find the walk that repeats over a gait on level ground, and its linear equations.

    Raises
    ------
    ControllerError
        If there is none, or the impact does not lead to the gait's beginning.
    """
    surface = Surface(gait)
    end = surface.touchdown()
    driven = gait.robot.model.actuator_joint
    place = gait.joints(end.after) - end.position[driven]
    speed = gait.joints(end.after, order=1) - end.velocity[driven] / end.rate
    if max(np.abs(place).max(), np.abs(speed).max()) > INVARIANT:
        raise ControllerError(
            f"the impact of robot {gait.robot.name!r} at the end of this gait does not "
            "lead to its start; hs.make_invariant(gait) corrects that"
        )
    first, last = end.after, end.before
    theta = nodes(first, last)
    tangent = np.array([surface.tangent(each) for each in theta])
    rates = _rates(surface, end, theta)
    q = np.array([surface.position(each) for each in theta])
    bend = Course.through(first, last, tangent).slope()(theta)
    hurry = 0.5 * Course.through(first, last, rates**2).slope()(theta)  # θ̈
    acceleration = bend * rates[:, None] ** 2 + tangent * hurry[:, None]
    v = tangent * rates[:, None]
    each = [about(gait, *instant) for instant in zip(q, v, acceleration, strict=True)]
    torque, A, B = (np.array(values) for values in zip(*each, strict=True))
    courses = (q, v, torque, rates, A, B)
    return Orbit(gait, end, *(Course.through(first, last, each) for each in courses))


def _rates(surface: Surface, end: Touchdown, theta: Floats) -> Floats:
    """θ̇ of the walk that repeats: gravity adds to ½σ² what the impact takes of it."""
    domain = [end.after, end.before]
    power = Chebyshev.interpolate(
        np.vectorize(lambda each: surface.inertia(each) * surface.tipping(each)), NODES, domain
    )
    added = power.integ(lbnd=end.after)
    left = end.momentum**2
    after = left * float(added(end.before)) / (1.0 - left)
    energy = after + added(theta)
    if energy.min() <= 0.0:
        raise ControllerError(
            f"no walk of robot {surface.robot.name!r} over this gait repeats; see zero_dynamics"
        )
    return np.asarray(np.sqrt(2.0 * energy) / np.vectorize(surface.inertia)(theta))


def contacts_of(gait: PhasedGait) -> tuple[int, int]:
    """Contact points of the foot that stands and of the one that swings."""
    feet = gait.robot.feet
    return feet[gait.stance_foot].contacts[0], feet[1 - gait.stance_foot].contacts[0]


def about(
    gait: PhasedGait, q: Floats, v: Floats, acceleration: Floats
) -> tuple[Floats, Floats, Floats]:
    """Torques (nu,) of the walk at an instant, and the linear equations A, B about it.

    The trunk follows the foot, which stands: d/dt (δp, δṗ) are the rows of the robot's own
    equations, under errors of all its coordinates that are those of p.
    """
    robot, (contact, _) = gait.robot, contacts_of(gait)
    needed = contact_inverse_dynamics(robot, q, v, acceleration, contacts=[contact])
    held = ActiveContacts(resting=(contact,))
    linear = linearize_contact(robot, q, v, needed.torque, held)
    joints = range(2, robot.nv)
    rows = both(robot, joints)
    A = linear.A[rows] @ following(robot, q, v, [contact], joints)
    return needed.torque, A, linear.B[rows]
