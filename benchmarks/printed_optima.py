"""Optimal gaits with printed costs, beside those that `hs.optimize_motion` finds.

Run, from the top folder::

    python benchmarks/printed_optima.py

M. P. Kelly, TwoPhaseOptimalGait (2016): a hip and two feet, point masses, at the ends of massless
legs that grow and shrink, with a force along each leg up to four times the weight, a torque at the
hip up to half of weight times leg, and one at the ankle of the foot that stands; friction 0.8. What
is least is the cost of transport ∫Σ|power| dt / (weight · step). His limits on how fast forces
change, legs turn and feet move are left out, and a foot that leaves the ground may be pressed on it
until then: `printed_limits.py` tells which of them a run breaks. Speed and step are given here.

His runs: 7.2 and 0.4 kg, legs of 0.6 to 1 m, with the steps and speeds that came out of his
problem; the second is stored with other limits, a force of five weights and a hip's torque of
weight times leg. Ours have no torque at the ankle, and keep to the limits of the first.

His walk: 6.8 and 0.6 kg, legs of 0.7 to 0.9 m, ankle torque up to 0.2 weight times leg, a step of
0.05 m at 0.1 m/s, its shortest and slowest, on both feet for 0.05 s, his shortest. The foot in the
air keeps above ½h (1 + cos(π x / step)), x being how far it is ahead of the other one and h 1 cm.
The ankle torque of ours is that of a flat foot without mass, 0.36 m long, of which the ground must
not pull an end. On both feet our hips may exert torques, which his may not, so that ours is not a
gait of his problem: the last column says how large they are there.

The trunk between the legs has an inertia of 0.01 kg m², which his has not: torques at the two hips
are then opposite but for what turns it. Costs are those of the motion, by inverse dynamics on 400
instants of each phase; times are of the processor.
"""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass
from typing import Any

import casadi
import numpy as np
from rich.console import Console
from table import Table

import heelstrike as hs
from heelstrike import ContactPhase as Phase
from heelstrike import dynamics

GRAVITY = 9.81
INERTIA = 0.01
INSTANTS = 400
WEIGHT = 8.0 * GRAVITY
LIGHT = 1e-5
"""Mass (kg) and inertia (kg m²) of what has none."""


@dataclass(frozen=True)
class Biped:
    """Hip and feet as points, legs that grow and shrink."""

    hip: float
    foot: float
    """hip, foot: Masses (kg)."""
    shortest: float
    longest: float
    """shortest, longest: Of the legs (m)."""
    ankle: float = 0.0
    """Largest torque at an ankle, in units of weight times leg."""
    push: float = 4.0
    """Largest force along a leg, in units of weight."""
    turn: float = 0.5
    """Largest torque at a hip, in units of weight times leg."""
    inertia: float = INERTIA
    """Of the trunk (kg m²)."""

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
                center_of_mass=(0.0, -longest), limits=(self.shortest - longest, 0.0),
                torque=self.push * WEIGHT, link=f"{side}_shank" if self.ankle else f"{side}_foot",
            )  # fmt: skip
            if not self.ankle:
                build.contact(leg, (0.0, -longest))
                continue
            foot = build.hinge(
                f"{side}_ankle", leg, at=(0.0, -longest), link=f"{side}_foot", mass=LIGHT,
                inertia=LIGHT, torque=self.ankle * WEIGHT * longest,
            )  # fmt: skip
            half = self.ankle * longest
            build.sole(foot, heel=(-half, 0.0), toe=(half, 0.0))
        return build.build()


RUNNER, WALKER = Biped(7.2, 0.4, 0.6, 1.0), Biped(6.8, 0.6, 0.7, 0.9, ankle=0.2)
STEP, LIFTED, BOTH, ALONE = 0.05, 0.01, 0.05, 0.45
"""His walk: step and height (m), durations on both feet and on one (s)."""
SOON = 1e-3
"""Time (s) for which a foot may be low when it has left the ground, and when it comes down."""


def lifted(now: hs.gait.Instant) -> Any:
    """How much higher than asked the left foot is, while it is in the air."""
    right, left = (0.5 * casadi.sum1(now.points[i : i + 2, :]) for i in (0, 2))
    ahead = left[0] - right[0]
    in_air = casadi.fmin(now.time - BOTH, BOTH + ALONE - now.time)
    room = LIFTED * casadi.fmax(1.0 - in_air / SOON, 0.0)
    return left[1] + room - 0.5 * LIFTED * (1.0 + casadi.cos(np.pi * ahead / STEP))


@dataclass(frozen=True)
class Printed:
    """A gait with its printed cost of transport."""

    cost: float
    seconds: float
    """What he says it took."""
    biped: Biped
    phases: tuple[Phase, ...]
    asked: dict[str, Any]


STANCE = Phase("right_foot", duration=(0.02, 2.0), pieces=4)
RUN = (STANCE, Phase(duration=(0.02, 2.0), pieces=2))
WALK = (
    Phase("right_foot", "left_foot", duration=BOTH, pieces=2),
    Phase("right_foot", duration=ALONE, pieces=8),
)
PRINTED = {
    "run": Printed(
        0.338762, 114.0, RUNNER, RUN, {"distance": 0.66523, "speed": 1.542, "clearance": 0.02}
    ),
    "run, the other": Printed(
        0.285669, 255.0, RUNNER, RUN, {"distance": 0.5605, "speed": 1.6024, "clearance": 0.02}
    ),
    "walk": Printed(
        0.0744744, 95.0, WALKER, WALK, {"distance": STEP, "clearance": 0.0, "constraint": lifted}
    ),
}


def cost_of_transport(robot: hs.Robot, motion: hs.Motion) -> float:
    """∫Σ|power| dt over weight times distance, by inverse dynamics."""
    driven, total = robot.model.actuator_joint, 0.0
    for phase in motion.phases:
        times = phase.duration * (np.arange(INSTANTS) + 0.5) / INSTANTS
        moved = [phase.coordinates(times, order=order) for order in range(3)]
        for q, v, a, force in zip(*moved, phase.forces(times), strict=True):
            pushed = np.einsum("ikj,ik->j", dynamics.contact_jacobian(robot, q), force)
            needed = dynamics.inverse_dynamics(robot, q, v, a) - pushed
            total += phase.duration / INSTANTS * float(np.abs(needed * v)[driven].sum())
    return total / (robot.weight * motion.distance)


def hips_on_both(robot: hs.Robot, motion: hs.Motion) -> float:
    """Largest torque (N m) at a hip while both feet stand."""
    hips, largest = [robot.joint_names.index(f"{side}_hip") for side in ("right", "left")], 0.0
    for phase in motion.phases:
        if len(phase.contacts) < robot.nc:
            continue
        for t in phase.duration * (np.arange(INSTANTS) + 0.5) / INSTANTS:
            q, v, a = (phase.coordinates(t, order=order) for order in range(3))
            pushed = np.einsum("ikj,ik->j", dynamics.contact_jacobian(robot, q), phase.forces(t))
            needed = dynamics.inverse_dynamics(robot, q, v, a) - pushed
            largest = max(largest, float(np.abs(needed[hips]).max()))
    return largest


def found(name: str) -> hs.Motion:
    """Find the gait that stands beside a printed one."""
    printed = PRINTED[name]
    return hs.optimize_motion(
        printed.biped.robot(), printed.phases, **printed.asked, friction=0.8,
        cost="mechanical_energy", starts=1, refine=False,
    )  # fmt: skip


def main() -> None:
    """Print the table."""
    body = []
    for name in sys.argv[1:] or PRINTED:
        printed = PRINTED[name]
        robot = printed.biped.robot()
        begin = time.process_time()
        motion = found(name)
        spent = time.process_time() - begin
        cells = [name, f"{printed.cost:.6f}", f"{cost_of_transport(robot, motion):.6f}"]
        cells += [f"{motion.spent / (robot.weight * motion.distance):.6f}"]
        durations = ", ".join(f"{each.duration:.3f}" for each in motion.phases)
        cells += [durations, f"{printed.seconds:.0f}", f"{spent:.1f}"]
        body.append([*cells, f"{hips_on_both(robot, motion):.2g}"])
    head = [
        "gait", "printed", "found", "by the design", "phases (s)", "he took (s)", "we (s)",
        "hips on both feet (N m)",
    ]  # fmt: skip
    Console(width=160).print(Table("cost of transport", head, body))


if __name__ == "__main__":
    main()
