"""Optimal gaits with printed costs, beside those that `hs.optimize_motion` finds.

Run, from the top folder::

    python benchmarks/printed_optima.py

M. P. Kelly, TwoPhaseOptimalGait (2016): a hip and two feet, point masses, at the ends of massless
legs that grow and shrink, with a force along each leg, a torque at the hip between the legs, and
one at the ankle of the foot that stands, except where both do; friction 0.8. What is least is the
cost of transport ∫Σ|power| dt / (weight · step).

His limits (`GAIT_Run/Trajectory_Run.m`, `Continuous_Run.m` and `Endpoint_Run.m`; those of
`GAIT_Walk` likewise) are those here: no force or torque goes from zero to its largest in less than
0.8 s, and they jump only where phases join. Legs turn by at most 2π rad/s and grow by at most all
that they can in 0.3 s. The foot in the air keeps above ½h (1 + cos(π x / step)) while the other one
stands, h being 2 cm in the runs and 1 cm in the walk and x how far it is ahead of the one that
stands. A foot that leaves the ground is no longer pressed on it. In the walk the hip exerts no
torque while both feet stand, so that the leg behind is upright when its foot leaves.

His first run: 7.2 and 0.4 kg, legs of 0.6 to 1 m, a force of four weights along a leg, torques of
half of weight times leg at the hip and a twentieth at the ankle. The second is stored with other
limits: five weights, weight times leg, and a fifth. His walk: 6.8 and 0.6 kg, legs of 0.7 to 0.9 m,
four weights, a half and a fifth; a step of 0.05 m at 0.1 m/s, its shortest and slowest, on both
feet for 0.05 s, his shortest. These of the walk are given here; steps and durations of runs are
free near those that came out of his problem.

What differs in our robot: runs have no torque at the ankle. In the walk it is that of a flat foot
without mass, 0.36 m long, of which the ground must not pull an end. The trunk between the legs has
an inertia of 0.01 kg m², which his has not. What must be zero may be as large as `Biped.room`
(weights; weights times leg), since bounds without room between them stop the optimiser: the force
on the foot that leaves, the sum of the torques at the two hips, all torques on both feet of the
walk. For runs, our design counts the powers of both hips, which are his where one leg turns
forwards and the other backwards, and more where both turn the same way. In the walk corners of |P|
are rounded off, and feet are kept level, which costs nothing otherwise; it is designed three
times, first with more room.

The table has the costs of transport that his files tell, and those of our motions by inverse
dynamics on 400 instants of each phase, in his sense; times are of the processor. Limits hold at the
instants of the design; `printed_limits.py` tells how well between them, in his equations.
"""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass, replace
from typing import Any

import casadi
import numpy as np
from rich.console import Console
from table import Table

import heelstrike as hs
from heelstrike import ContactPhase as Phase
from heelstrike import dynamics

GRAVITY = 9.81
INSTANTS = 400
WEIGHT = 8.0 * GRAVITY
LIGHT = 1e-5
"""Mass (kg) and inertia (kg m²) of what has none."""
SLOWEST = 0.8
"""Time (s) in which forces and torques may go from zero to their largest."""
GROWS = 0.3
"""Time (s) in which a leg may grow from its shortest to its longest."""
TURNS = 2.0 * np.pi
"""Largest rate of the angle of a leg (rad/s)."""
FRICTION = 0.8
ROUNDING = 2e-5
"""How much lower (m) than asked a foot in the air may be: where it leaves and lands, both are 0."""
HELD = 1e-3
"""How much longer and shorter (m) the robot's stops let a leg be: motions keep as far from them."""


@dataclass(frozen=True)
class Biped:
    """Hip and feet as points, legs that grow and shrink."""

    hip: float
    foot: float
    """hip, foot: Masses (kg)."""
    shortest: float
    longest: float
    """shortest, longest: Of the legs (m)."""
    lifted: float
    """Greatest height asked of the foot in the air (m)."""
    ankle: float
    """Largest torque at an ankle, in units of weight times leg."""
    push: float = 4.0
    """Largest force along a leg, in units of weight."""
    turn: float = 0.5
    """Largest torque at a hip, in units of weight times leg."""
    soles: bool = False
    """Whether ours has feet for the torque at the ankle."""
    inertia: float = 0.01
    """Of the trunk (kg m²)."""
    room: float = 1e-3
    """How large may be what must be zero, in units of weight, or of weight times leg."""

    def robot(self) -> hs.Robot:
        """Return the robot."""
        build, longest = hs.RobotBuilder("telescoping", gravity=GRAVITY), self.longest
        trunk = build.floating_base("hip", (0.0, longest), mass=self.hip, inertia=self.inertia)
        for side in ("right", "left"):
            hip = build.hinge(
                f"{side}_hip", trunk, limits=(-0.5 * np.pi, 0.5 * np.pi),
                torque=self.turn * WEIGHT * longest,
            )  # fmt: skip
            leg = build.slide(
                f"{side}_leg", hip, direction=(0.0, -1.0), mass=self.foot,
                center_of_mass=(0.0, -longest),
                limits=(self.shortest - longest - HELD, HELD), torque=self.push * WEIGHT,
                link=f"{side}_shank" if self.soles else f"{side}_foot",
            )  # fmt: skip
            if not self.soles:
                build.contact(leg, (0.0, -longest))
                continue
            foot = build.hinge(
                f"{side}_ankle", leg, at=(0.0, -longest), link=f"{side}_foot", mass=LIGHT,
                inertia=LIGHT, torque=self.ankle * WEIGHT * longest,
            )  # fmt: skip
            half = self.ankle * longest
            build.sole(foot, heel=(-half, 0.0), toe=(half, 0.0))
        return build.build()

    @property
    def sizes(self) -> np.ndarray:
        """Largest torques and forces, (nu,) in N m and N."""
        moment = WEIGHT * self.longest
        of_leg = [self.turn * moment, self.push * WEIGHT, self.ankle * moment]
        return np.array((of_leg if self.soles else of_leg[:2]) * 2)

    def powers(self, torque: Any, velocity: Any) -> list[Any]:
        """Powers in his sense of torques and rates of all motors: at the hip, that of both legs."""
        left = self.sizes.size // 2
        between = 0.5 * (torque[0] - torque[left]) * (velocity[0] - velocity[left])
        others = [k for k in range(2 * left) if k % left]
        return [between, *(torque[k] * velocity[k] for k in others)]

    def spent(self, now: hs.gait.Instant) -> Any:
        """Power that is spent, its corners rounded off, and a little for what is idle otherwise."""
        found = self.powers(now.torque, now.motor_velocity)
        trunk, left = now.position[2], 3 + self.sizes.size // 2
        feet = (trunk + casadi.sum1(now.position[k : k + left - 3]) for k in (3, left))
        tilted = 0.1 * trunk**2 + sum(angle**2 for angle in feet)
        return tilted + sum(casadi.sqrt(power**2 + EASED**2) - EASED for power in found)

    def kept(self, now: hs.gait.Instant, step: float) -> Any:
        """What his limits keep from being negative, in a gait of such steps (m)."""
        left, points = self.sizes.size // 2, 2 if self.soles else 1
        both, alone = now.stands[points], 1.0 - now.stands[points]
        stands = now.stands[0]
        rates = now.torque_rate * SLOWEST / self.sizes
        growth = now.motor_velocity[[1, left + 1]] * GROWS / (self.longest - self.shortest)
        turning = (now.velocity[2] + now.motor_velocity[[0, left]]) / TURNS
        small = self.room * WEIGHT * self.longest
        trunk = (now.torque[0] + now.torque[left]) / small
        within = [rates, growth, turning, trunk]
        if self.soles:  # a walk, on both feet at times
            idle = [0, 2, left + 2]
            within.append(both * (now.torque[idle] - trunk * small * np.eye(3)[0] / 2.0) / small)
        right_place, left_place = (
            casadi.sum1(now.points[k : k + points, :]) / points for k in (0, points)
        )
        ahead = (left_place[0] - right_place[0]) / step
        room = left_place[1] + ROUNDING - 0.5 * self.lifted * (1.0 + casadi.cos(np.pi * ahead))
        leaving = (
            both if self.soles else stands
        )  # in the walk the left foot, in a run the right one
        first = points if self.soles else 0
        load = casadi.sum1(now.point_force[first : first + points, 0]) / WEIGHT
        return casadi.vertcat(
            *(1.0 - sign * each for each in within for sign in (1.0, -1.0)),
            room / self.lifted * alone * stands + (1.0 - alone * stands),
            self.room - load + FAR * (1.0 - now.share) + FAR * (1.0 - leaving),
        )


SKETCHED = (1e-3, 3e-4)
"""Room with which a walk is designed first: with less at once, the optimiser finds none."""
EASED = 0.05
"""Power (W) below which its corner is rounded off in the walk."""
FAR = 10.0
"""Weights that a foot may bear where it may bear any."""
RUNNER = Biped(7.2, 0.4, 0.6, 1.0, lifted=0.02, ankle=0.05)
OTHER = replace(RUNNER, ankle=0.2, push=5.0, turn=1.0)
WALKER = Biped(
    6.8, 0.6, 0.7, 0.9, lifted=0.01, ankle=0.2, soles=True, room=1e-4
)  # fmt: skip


@dataclass(frozen=True)
class Printed:
    """A gait with its printed cost of transport."""

    cost: float
    seconds: float
    """What he says it took."""
    biped: Biped
    phases: tuple[Phase, ...]
    step: float
    """Its length (m)."""
    asked: dict[str, Any]


def run(shortest: float, longest: float) -> tuple[Phase, ...]:
    """Stance, for so long (s), and flight, of which his lasts 0.02 s, his shortest."""
    return (
        Phase("right_foot", duration=(shortest, longest), pieces=6),
        Phase(duration=(0.02, 0.05), pieces=1),
    )


PRINTED = {
    "run": Printed(
        0.338762, 114.0, RUNNER, run(0.38, 0.42), 0.66523, {"distance": (0.6, 0.7)}
    ),
    "run, the other": Printed(
        0.285669, 255.0, OTHER, run(0.3, 0.34), 0.5605, {"distance": (0.5, 0.6)}
    ),
    "walk": Printed(
        0.0744744, 95.0, WALKER,
        (
            Phase("right_foot", "left_foot", duration=0.05, pieces=1),
            Phase("right_foot", duration=0.45, pieces=6),
        ),
        0.05, {"distance": 0.05},
    ),
}  # fmt: skip


def cost_of_transport(biped: Biped, motion: hs.Motion) -> float:
    """∫Σ|power| dt over weight times distance, by inverse dynamics."""
    robot, total = biped.robot(), 0.0
    driven = robot.model.actuator_joint
    for phase in motion.phases:
        times = phase.duration * (np.arange(INSTANTS) + 0.5) / INSTANTS
        moved = [phase.coordinates(times, order=order) for order in range(3)]
        for q, v, a, force in zip(*moved, phase.forces(times), strict=True):
            pushed = np.einsum("ikj,ik->j", dynamics.contact_jacobian(robot, q), force)
            needed = dynamics.inverse_dynamics(robot, q, v, a) - pushed
            powers = biped.powers(needed[driven], v[driven])
            total += phase.duration / INSTANTS * float(np.abs(powers).sum())
    return total / (robot.weight * motion.distance)


def designed(printed: Printed, biped: Biped, begun: hs.Motion | None = None) -> hs.Motion:
    """Design the gait of a biped that stands beside a printed one, perhaps from another."""
    return hs.optimize_motion(
        biped.robot(), printed.phases, **printed.asked, friction=FRICTION, clearance=0.0,
        cost=biped.spent if biped.soles else "mechanical_energy", warm_start=begun,
        constraint=lambda now: biped.kept(now, printed.step), starts=1, refine=False,
    )  # fmt: skip


def found(name: str) -> hs.Motion:
    """Find the gait that stands beside a printed one; a walk first with more room."""
    printed, motion = PRINTED[name], None
    for room in SKETCHED if printed.biped.soles else ():
        motion = designed(printed, replace(printed.biped, room=room), motion)
    return designed(printed, printed.biped, motion)


def main() -> None:
    """Print the table."""
    body = []
    for name in sys.argv[1:] or PRINTED:
        printed = PRINTED[name]
        begin = time.process_time()
        motion = found(name)
        spent = time.process_time() - begin
        cells = [name, f"{printed.cost:.6f}", f"{cost_of_transport(printed.biped, motion):.6f}"]
        cells += [f"{motion.distance:.4f}", f"{motion.speed:.4f}"]
        durations = ", ".join(f"{each.duration:.4f}" for each in motion.phases)
        body.append([*cells, durations, f"{printed.seconds:.0f}", f"{spent:.1f}"])
    head = ["gait", "printed", "found", "step (m)", "m/s", "phases (s)", "he took (s)", "we (s)"]
    Console(width=160).print(Table("cost of transport", head, body))


if __name__ == "__main__":
    main()
