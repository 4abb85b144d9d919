"""The surface that virtual constraints leave to a robot on a point: one motion, one momentum.

On it the robot is a point on a curve q(θ), and moves along its tangent. A plastic impact at the end
of the curve leads to the beginning of its mirror image; if it leads on to that curve with its
tangent, the surface is invariant under the impact.
"""

from __future__ import annotations

import numpy as np
from numpy.polynomial import Chebyshev
from scipy.optimize import brentq

from heelstrike import dynamics
from heelstrike.arguments import takes
from heelstrike.contact.ground import Ground
from heelstrike.dynamics.queries.evaluation import Evaluation
from heelstrike.dynamics.queries.held import HeldRobot
from heelstrike.errors import GaitError
from heelstrike.field_texts import dataclass
from heelstrike.gait.phased.phased_gait import PhasedGait
from heelstrike.robot.model import Floats

# A touchdown is looked for within this much of the range of the phase about its end.
NEAR_THE_END = 0.05
LOOKS = 21
# Phases at which κ₁ and κ₂ are evaluated: series of analytic functions end long before.
NODES = 96


@dataclass(frozen=True, eq=False, kw_only=True)
class Touchdown:
    """What the impact that ends a step does to motion along the surface, per unit of θ̇ before."""

    before: float
    """Phase at which the swing foot meets the ground (rad)."""
    after: float
    """Phase just after, of the foot that then stands (rad)."""
    position: Floats
    """(nq,) Relabelled position just after, that foot at the origin."""
    velocity: Floats
    """(nv,) Relabelled velocity just after, for θ̇ = 1 before."""
    rate: float
    """θ̇ just after, for θ̇ = 1 before."""
    momentum: float
    """Factor of the angular momentum about the foot that stands: σ⁺ = momentum · σ⁻."""
    impulse: Floats
    """(2,) Impulse of the ground (normal, tangential) on the landing foot, for θ̇ = 1 (N s per
    rad/s)."""
    lift: float
    """Speed at which the other foot leaves the ground, for θ̇ = 1 (m/s per rad/s)."""
    approach: float
    """Rate of the swing foot's gap before, for θ̇ = 1 (m/s per rad/s)."""


class Surface:
    """Motions of a robot that obeys a gait over its phase, the stance foot at the origin.

    Parameters
    ----------
    gait : PhasedGait
        The gait.
    ground : Ground, optional
        Level or sloping ground; level if not given.
    """

    def __init__(self, gait: PhasedGait, ground: Ground | None = None) -> None:
        self.gait = gait
        self.robot = gait.robot
        terrain = (Ground() if ground is None else ground).model()
        if len(terrain.friction) > 1 or terrain.curved:
            raise GaitError("a gait that repeats needs level or sloping ground")
        along = np.diff(terrain.vertices[:2], axis=0)[0]
        along = along / np.hypot(*along)
        self.axes = np.array([[-along[1], along[0]], along])  # normal, tangent
        self._stance = self.robot.feet[gait.stance_foot].contacts[0]
        self._swing = self.robot.feet[1 - gait.stance_foot].contacts[0]

    def position(self, theta: float) -> Floats:
        """Position (nq,) at a phase."""
        gait, robot = self.gait, self.robot
        q = np.zeros(robot.nq)
        q[robot.model.actuator_joint] = gait.joints(theta)
        q[2] = (theta - gait.phase[3:] @ q[3:]) / gait.phase[2]
        q[:2] -= dynamics.contact_positions(robot, q)[self._stance]
        return q

    def tangent(self, theta: float) -> Floats:
        """Velocity (nv,) at a phase whose rate is 1."""
        gait, robot = self.gait, self.robot
        v = np.zeros(robot.nv)
        v[robot.model.actuator_joint] = gait.joints(theta, order=1)
        v[2] = (1.0 - gait.phase[3:] @ v[3:]) / gait.phase[2]
        return self._on_its_foot(self.position(theta)).velocity(v)

    def _on_its_foot(self, q: Floats) -> HeldRobot:
        """The robot with its stance foot held, where the trunk is following from the rest."""
        return HeldRobot.on(Evaluation(self.robot, q), [self._stance], dependent=(0, 1))

    def _rows(self, q: Floats, contact: int) -> Floats:
        """Jacobian (2, nv) of a contact point, x and z."""
        jacobian = dynamics.contact_jacobian(self.robot, q)[contact]
        return np.asarray(jacobian[::-1], dtype=np.float64)

    def turning(self, q: Floats) -> Floats:
        """Velocity (nv,) of the robot as one body that turns about its stance foot at 1 rad/s."""
        v = np.zeros(self.robot.nv)
        v[2] = self.robot.model.axis[2, 0]
        return self._on_its_foot(q).velocity(v)

    def inertia(self, theta: float) -> float:
        """Angular momentum about the stance foot for a rate 1 of the phase (kg m²)."""
        q = self.position(theta)
        return float(self.turning(q) @ dynamics.mass_matrix(self.robot, q) @ self.tangent(theta))

    def tipping(self, theta: float) -> float:
        """Moment of gravity about the stance foot (N m), which is σ̇."""
        q = self.position(theta)
        return float(-self.turning(q) @ dynamics.gravity_force(self.robot, q))

    def motion(self, end: Touchdown) -> tuple[Chebyshev, Chebyshev]:
        """1/κ₁, and what gravity has added to σ²/2 since the touchdown before, over the phase.

        Parameters
        ----------
        end : Touchdown
            Of this surface: the step goes from one to the next.
        """
        domain = [end.after, end.before]
        inertia = Chebyshev.interpolate(np.vectorize(self.inertia), NODES, domain)
        power = Chebyshev.interpolate(
            np.vectorize(lambda theta: self.inertia(theta) * self.tipping(theta)), NODES, domain
        )
        return inertia, power.integ(lbnd=end.after)

    def swing_gap(self, theta: float) -> float:
        """Height of the swing foot above the ground (m)."""
        return float(
            self.axes[0] @ dynamics.contact_positions(self.robot, self.position(theta))[self._swing]
        )

    def feet(self, q: Floats) -> Floats:
        """Places of the stance foot and the swing foot, (2, 2): x and z (m)."""
        return dynamics.contact_positions(self.robot, q)[[self._stance, self._swing]]

    def touchdown(self) -> Touchdown:
        """Find where the swing foot comes down near the end of the gait, and what that does.

        Raises
        ------
        GaitError
            If it does not come down there.
        """
        before = self._end()
        robot, gait = self.robot, self.gait
        mirror = robot.mirror
        assert mirror is not None
        q, v = self.position(before), self.tangent(before)
        rows = self._rows(q, self._swing)
        after, impulse = HeldRobot.on(Evaluation(robot, q), [self._swing]).stopped(v)
        q_after, v_after = mirror.position(q), mirror.velocity(after)
        q_after[:2] -= dynamics.contact_positions(robot, q_after)[self._stance]
        inertia = dynamics.mass_matrix(robot, q_after)
        momentum = self.turning(q_after) @ inertia @ v_after
        stance = self.axes @ self._rows(q, self._stance)
        return Touchdown(
            before=before,
            after=gait.phase_at(q_after),
            position=q_after,
            velocity=v_after,
            rate=float(gait.phase @ v_after),
            momentum=float(momentum / self.inertia(before)),
            impulse=self.axes @ impulse,
            lift=float(stance[0] @ after),
            approach=float(self.axes[0] @ rows @ v),
        )

    def _end(self) -> float:
        first, last = self.gait.phase_range
        reach = NEAR_THE_END * (last - first)
        phases = np.linspace(last - reach, last + reach, LOOKS)
        gaps = np.array([self.swing_gap(theta) for theta in phases])
        down = np.flatnonzero((gaps[:-1] > 0.0) & (gaps[1:] <= 0.0))
        if not len(down):
            raise GaitError(
                f"the swing foot of robot {self.robot.name!r} does not come down near the end of "
                f"the gait: at θ = {last:.6g} rad it is {self.swing_gap(last):.4g} m above the "
                "ground"
            )
        place = min(down, key=lambda k: abs(phases[k] - last))
        return float(
            brentq(self.swing_gap, phases[place], phases[place + 1], xtol=1e-15, rtol=1e-15)
        )


@takes(GaitError)
def make_invariant(gait: PhasedGait, ground: Ground | None = None) -> PhasedGait:
    """Change the beginning of a gait so that its own impact leads there, with the right slopes.

    After Westervelt, Grizzle and Koditschek (2003), theorem 4: the first two coefficients of the
    constraints follow from the last two by the impact map.

    Parameters
    ----------
    gait : PhasedGait
        A gait that nearly repeats.
    ground : Ground, optional
        Level or sloping ground; level if not given.

    Returns
    -------
    PhasedGait
        The gait with a cubic added that vanishes, with its slope, at the end.

    Raises
    ------
    GaitError
        If the swing foot does not come down near the end, or its impact turns the phase back.
    """
    end = Surface(gait, ground).touchdown()
    if not end.rate > 0.0:
        raise GaitError("the impact at the end of the gait turns its phase back; it cannot repeat")
    driven = gait.robot.model.actuator_joint
    start = end.position[driven], end.velocity[driven] / end.rate
    return gait.with_end(end.before).with_start(end.after, *start)
