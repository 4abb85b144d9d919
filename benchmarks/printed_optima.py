"""Optimal gaits with printed costs, beside those that `hs.optimize_motion` finds.

Run, from the top folder::

    python benchmarks/printed_optima.py

M. P. Kelly, TwoPhaseOptimalGait (2016): a hip of 7.2 kg and two feet of 0.4 kg at the ends of
massless legs of 0.6 to 1 m, with a force along each leg up to four times the weight and a torque at
the hip up to half of weight times leg; friction 0.8. What is least is the cost of transport
∫Σ|power| dt / (weight · step). Ours has no torque at the ankle, which his may have up to a
twentieth of weight times leg: every gait of ours is one of his problem. His has limits on how fast
forces change, which ours does not. Speed and step are given here, from within his bounds.

His walk (0.0744744; 0.6 kg at each foot, legs of 0.7 to 0.9 m, a step of 0.05 m at 0.1 m/s) is not
reached: more than a third of its work is done by an ankle torque up to 0.2 weight times leg, and
what `hs.optimize_motion` finds without one swings torques between the instants at which it looks at
the power.

The trunk between the legs has an inertia of 0.01 kg m², which his has not: torques at the two hips
are then opposite but for what turns it. Costs are those of the motion, by inverse dynamics on 400
instants of each phase; times are of the processor.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

import numpy as np
from rich.console import Console
from table import Table

import heelstrike as hs
from heelstrike import ContactPhase as Phase
from heelstrike import dynamics

HIP, FOOT, GRAVITY = 7.2, 0.4, 9.81
SHORTEST, LONGEST = 0.6, 1.0
INERTIA = 0.01
INSTANTS = 400
WEIGHT = (HIP + 2.0 * FOOT) * GRAVITY


def telescoping_biped() -> hs.Robot:
    """Hip and feet as points, legs that grow and shrink."""
    biped = hs.RobotBuilder("telescoping", gravity=GRAVITY)
    trunk = biped.floating_base("hip", (0.0, LONGEST), mass=HIP, inertia=INERTIA)
    for side in ("right", "left"):
        hip = biped.hinge(
            f"{side}_hip", trunk, limits=(-0.5 * np.pi, 0.5 * np.pi), torque=0.5 * WEIGHT * LONGEST
        )
        foot = biped.slide(
            f"{side}_leg", hip, direction=(0.0, -1.0), link=f"{side}_foot", mass=FOOT,
            center_of_mass=(0.0, -LONGEST), limits=(SHORTEST - LONGEST, 0.0), torque=4.0 * WEIGHT,
        )  # fmt: skip
        biped.contact(foot, (0.0, -LONGEST))
    return biped.build()


@dataclass(frozen=True)
class Printed:
    """A gait with its printed cost of transport."""

    cost: float
    seconds: float
    """What he says it took."""
    phases: tuple[Phase, ...]
    asked: dict[str, Any]


STANCE = Phase("right_foot", duration=(0.02, 2.0), pieces=4)
RUN = (STANCE, Phase(duration=(0.02, 2.0), pieces=2))
PRINTED = {
    "run": Printed(0.338762, 114.0, RUN, {"distance": 0.5, "speed": 1.6}),
    "run, the other": Printed(0.285669, 255.0, RUN, {"distance": 0.5605, "speed": 1.6024}),
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


def found(name: str) -> hs.Motion:
    """Find the gait that stands beside a printed one."""
    printed = PRINTED[name]
    return hs.optimize_motion(
        telescoping_biped(), printed.phases, **printed.asked, friction=0.8, clearance=0.02,
        cost="mechanical_energy", starts=1, refine=False,
    )  # fmt: skip


def main() -> None:
    """Print the table."""
    robot, body = telescoping_biped(), []
    for name, printed in PRINTED.items():
        begin = time.process_time()
        motion = found(name)
        spent = time.process_time() - begin
        cells = [name, f"{printed.cost:.6f}", f"{cost_of_transport(robot, motion):.6f}"]
        durations = ", ".join(f"{each.duration:.3f}" for each in motion.phases)
        body.append([*cells, durations, f"{printed.seconds:.0f}", f"{spent:.1f}"])
    head = ["gait", "printed", "found", "phases (s)", "he took (s)", "we (s)"]
    Console(width=160).print(Table("cost of transport", head, body))


if __name__ == "__main__":
    main()
