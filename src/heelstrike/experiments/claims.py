"""What the paper claims, and what is measured here.

One function a claim: it says what the paper says, measures it, and judges it by a criterion that it
states. None of the figures is written down here.
"""

from __future__ import annotations

from collections.abc import Callable
from enum import StrEnum
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from heelstrike.analysis import (
    energy_balance,
    run_motion,
    single_support,
    soles,
    stances,
    summarize,
    torque_cost,
    tracking_error,
    walking_steps,
)
from heelstrike.analysis.support import pushing_feet
from heelstrike.dynamics import point_jacobian
from heelstrike.experiments.evidence import STEPS, TIME_STEP, Evidence
from heelstrike.experiments.refinement import SCHEMES
from heelstrike.field_texts import dataclass
from heelstrike.robot.model import Floats, Integers
from heelstrike.sim import EventKind, Run, RunStatus, Scheme

SETTLING = 1e-3
"""Time (s) after a touchdown in which the feedback reacts to the impact."""


class Verdict(StrEnum):
    """How a claim fares."""

    HOLDS = "holds"
    FAILS = "does not hold"


@dataclass(frozen=True)
class Claim:
    """A claim of the paper beside what is measured here."""

    source: str
    """Where the paper makes it."""
    statement: str
    """What it says."""
    measured: str
    """What is measured here."""
    criterion: str
    """When the claim counts as holding."""
    holds: bool
    """Whether it does."""
    remark: str = ""
    """What a reader should know besides."""

    @property
    def verdict(self) -> Verdict:
        """How it fares."""
        return Verdict.HOLDS if self.holds else Verdict.FAILS


def tracking(evidence: Evidence) -> Claim:
    """Figure 3: the joints follow their references."""
    error = tracking_error(evidence.run, evidence.gait)
    motion = float(np.ptp(error.reference.position, axis=0).max())
    return Claim(
        "Section 5, Figure 3",
        "Under the control law of eq. 39 the joints follow the trajectories of eq. 40.",
        f"{error.rms:.2g} rad rms and {error.max:.2g} rad at most over "
        f"{len(walking_steps(evidence.run))} steps; the joints move through up to {motion:.2g} rad",
        "largest error below 2 % of the motion",
        evidence.run.completed and error.max < 0.02 * motion,
    )


def velocities(evidence: Evidence) -> Claim:
    """Figure 4: velocities, estimated from positions by cubic interpolation."""
    exact = tracking_error(evidence.run, evidence.gait)
    estimated = tracking_error(evidence.estimated, evidence.gait)
    speed = _rms(exact.reference.velocity)
    walked = len(walking_steps(evidence.estimated))
    return Claim(
        "Section 5, Figure 4",
        "Velocities estimated from joint positions by cubic interpolation serve the control law.",
        f"velocity error {_rms(exact.velocity):.2g} rad/s rms with exact velocities, "
        f"{_rms(estimated.velocity):.2g} rad/s with estimated ones "
        f"(of {speed:.2g} rad/s rms); {walked} of {STEPS} steps walked on estimates, "
        f"tracking error {estimated.rms:.2g} rad rms",
        "all steps walked on estimates, velocity error below 10 %",
        evidence.estimated.completed and walked >= STEPS and _rms(estimated.velocity) < 0.1 * speed,
    )


def zero_moment_point(evidence: Evidence) -> Claim:
    """Figure 5: the zero moment point stays under the foot."""
    summary = summarize(evidence.run)
    heel, toe = summary.zmp_limits_m
    inside = heel <= summary.zmp_min_m and summary.zmp_max_m <= toe
    return Claim(
        "Section 5, Figure 5; eq. 45",
        "The zero moment point fulfils |p_x| < 0.5 l_f = 0.1 m; the robot keeps its balance.",
        f"{summary.zmp_min_m:+.4f} … {summary.zmp_max_m:+.4f} m over all samples of single "
        f"support, sole {heel:+.2f} … {toe:+.2f} m; {summary.steps} steps without a fall",
        "inside the sole in every sample, no fall",
        evidence.run.completed and inside,
        "Ground that only pushes keeps this point within the sole by itself. The margin is the "
        f"figure that matters: {summary.zmp_margin_min_m:.2g} m at its least.",
    )


def friction(evidence: Evidence) -> Claim:
    """Figure 6: the tangential force stays inside the cone."""
    summary = summarize(evidence.run)
    return Claim(
        "Section 5, Figure 6; eq. 9",
        f"The tangential force is within the cone of friction, μ = "
        f"{evidence.run.ground.friction:g}, and the robot does not slip.",
        f"{100.0 * summary.friction_use_max:.3g} % of the cone used at most, impacts included; "
        f"slip {summary.slip_max_m:.1g} m",
        "at most 100 %; slip below 0.1 mm",
        summary.friction_use_max <= 1.0 + 1e-9 and summary.slip_max_m < 1e-4,
    )


def unilateral(evidence: Evidence) -> Claim:
    """Eq. 7, 8, 14: no penetration, no pull, complementarity."""
    run = evidence.run
    normal = run.contact_force[..., 0]
    certificates = run.certificates
    return Claim(
        "Section 2.1, eq. 7, 8, 14",
        "Vertices do not penetrate the ground, normal forces do not pull, and one of height and "
        "force is always zero.",
        f"penetration {certificates.penetration:.1g} m, least normal force {normal.min():.2g} N, "
        f"complementarity residual {certificates.complementarity:.1g} (relative); "
        f"{run.solver.failures} of {run.solver.solves} contact problems unsolved",
        "penetration and residual at most 1e-9, no pulling, none unsolved",
        certificates.penetration <= 1e-9
        and certificates.complementarity <= 1e-9
        and normal.min() >= -1e-9
        and run.solver.failures == 0,
    )


def stance_foot(evidence: Evidence) -> Claim:
    """Eq. 11: the stance foot lies flat and still."""
    run = evidence.run
    alone = single_support(run)
    feet = pushing_feet(run)
    lift = drift = 0.0
    for index, foot in enumerate(run.robot.feet):
        rows = alone & feet[:, index]
        contacts = list(foot.contacts)
        lift = max(lift, float(run.gap[rows][:, contacts].max(initial=0.0)))
        for part in _stretches(rows):
            place = run.contact_point[part][:, contacts, 0]
            drift = max(drift, float(np.ptp(place, axis=0).max()))
    return Claim(
        "Section 2.1, eq. 11, 28",
        "Both corners of the stance foot stay on the ground and do not move.",
        f"in single support a corner rises by {lift:.1g} m and moves by {drift:.1g} m at most",
        "both below 0.1 mm",
        lift < 1e-4 and drift < 1e-4,
    )


def swing_foot(evidence: Evidence) -> Claim:
    """Eq. 12: the swing foot follows its path and lands once a step."""
    run = evidence.run
    stays = stances(run)
    landed = walking_steps(run)
    middle = [
        run.gap[_row_at(run, 0.5 * (before.touchdown + after.touchdown))]
        for before, after in pairwise(landed)
    ]
    height = min((_swing_height(run, gap) for gap in middle), default=float("nan"))
    first = sum(stay.touchdown < 1.5 * TIME_STEP for stay in stays)
    return Claim(
        "Section 2.1, eq. 12",
        "The swing foot follows its desired path.",
        f"halfway through a step its lower corner is {1e3 * height:.3g} mm or more above the "
        f"ground; {len(stays) - first} landings in {len(landed)} steps",
        "no scuffing: above the ground halfway, one landing a step",
        height > 0.0 and len(stays) - first == len(landed),
        "The paper does not print its path; here the foot stays above a clearance profile and "
        "lands flat.",
    )


def symmetry(evidence: Evidence) -> Claim:
    """Eq. 13: every step is the mirror image of the one before."""
    run, gait = evidence.run, evidence.gait
    starts = tracking_error(run, gait).reference.starts
    joints = run.position[:, run.robot.model.actuator_joint]
    at_start = np.array([joints[_row_at(run, start)] for start in starts])
    mirrored = gait.mirror_sign * at_start[:-1, gait.mirror_joint] + gait.mirror_offset
    difference = float(np.abs(at_start[1:] - mirrored).max())
    settled = float(np.abs(at_start[-1] - mirrored[-1]).max())
    return Claim(
        "Section 2.1, eq. 13",
        "The gait is symmetrical: the final configuration of one leg is the initial one of the "
        "other.",
        f"joint positions at the beginning of a step differ from the mirrored ones of the step "
        f"before by {difference:.2g} rad at most, by {settled:.2g} rad at the end of the walk",
        "below 0.01 rad",
        difference < 0.01,
    )


def plastic_impact(evidence: Evidence) -> Claim:
    """Eq. 20-22: the landing foot comes to rest, as the impact law says, without an impact law."""
    run = evidence.run
    velocity = run_motion(run).contact_velocity
    rebound = 0.0
    impulses = []
    for stay in walking_steps(run):
        contacts = list(run.robot.feet[stay.foot].contacts)
        landed = _row_at(run, stay.touchdown)  # the impact takes the steps before and after it
        rebound = max(rebound, float(np.abs(velocity[landed + 1, contacts]).max()))
        force = run.contact_force[landed - 1 : landed + 1][:, contacts, 0]
        impulses.append(TIME_STEP * float(force.sum()))
    predicted = float(evidence.gait.touchdown_impulse[0])
    measured = float(np.mean(impulses)) if impulses else float("nan")
    return Claim(
        "Section 2.2, eq. 20-22; Section 3",
        "Impacts are plastic, and time stepping needs no impact law for them.",
        f"two time steps bring the corners of the landing foot to rest within {rebound:.1g} m/s; "
        f"their normal impulse is {measured:.4g} N s on average, {predicted:.4g} N s by eq. 22 for "
        f"the gait as designed",
        "at rest within 1 mm/s, impulses alike within 5 %",
        rebound < 1e-3 and abs(measured - predicted) < 0.05 * abs(predicted),
        "Of the two, the first closes the gap and the second ends the motion.",
    )


def energy(evidence: Evidence) -> Claim:
    """Contact and impact take energy, they never give any."""
    balance = energy_balance(evidence.run)
    gained = float(np.diff(balance.contacts).max())
    lost = -float(balance.contacts[-1]) / max(len(walking_steps(evidence.run)), 1)
    return Claim(
        "Section 2.2",
        "The ground is completely inelastic.",
        f"the ground takes {lost:.3g} J a step; in no time step does it give more than "
        f"{gained:.1g} J",
        "never gives more than a millionth of what it takes a step",
        gained < 1e-6 * lost,
    )


def shock_accumulation(evidence: Evidence) -> Claim:
    """Conclusions: shocks do not accumulate in time stepping."""
    run = evidence.drop
    landings = sorted({e.time for e in run.events if e.kind is EventKind.TOUCHDOWN})
    asked = round(float(run.time[-1]) / TIME_STEP)
    apart = landings[-1] - landings[0] if len(landings) > 1 else float("nan")
    return Claim(
        "Sections 2.2 and 6",
        "When the vertices of a foot do not land together, shocks accumulate and block "
        "variable-step methods; the fixed step of time stepping rules this out.",
        f"dropped on tilted feet, toes and heels land {1e3 * apart:.3g} ms apart, in "
        f"{len(landings)} instants; the run ended {run.status.value} after {run.steps} of {asked} "
        f"time steps",
        "two landings or more, and exactly as many time steps as asked for",
        run.completed and len(landings) >= 2 and run.steps == asked,
    )


def small_steps(evidence: Evidence) -> Claim:
    """Introduction and conclusions: time stepping may need prohibitively small steps."""
    outcomes = []
    stable = []
    for scheme in SCHEMES:
        walked = [
            row
            for row in evidence.refinement
            if row.scheme is scheme
            and row.summary.status == RunStatus.COMPLETED.value
            and row.summary.steps == STEPS
        ]
        if not walked:
            outcomes.append(f"{scheme.label}: none of the steps tried")
            continue
        coarsest = max(walked, key=lambda row: row.step)
        stable.append(coarsest)
        outcomes.append(
            f"{scheme.label}: {1e3 * coarsest.step:g} ms "
            f"({coarsest.summary.real_time_factor:.0f} × real time)"
        )
    return Claim(
        "Sections 1 and 6",
        "Time stepping may require step sizes prohibitively small for numerical stability.",
        f"largest time step with which {STEPS} steps are walked: " + "; ".join(outcomes),
        "the claim holds if a scheme walks with no step that runs in real time",
        len(stable) < len(SCHEMES) or any(row.summary.real_time_factor < 1.0 for row in stable),
        "See the table of steps and schemes.",
    )


def first_order(evidence: Evidence) -> Claim:
    """Introduction: Euler's methods are of first order."""
    standing = {each.scheme: each.order for each in evidence.convergence if each.lost == 0.0}
    falling = {each.scheme: each.lost for each in evidence.convergence if each.lost > 0.0}
    return Claim(
        "Section 1",
        "Time stepping is restricted to first-order methods with a fixed step.",
        "measured order of convergence: "
        + ", ".join(f"{scheme.label} {value:.2f}" for scheme, value in standing.items())
        + "".join(
            f"; {scheme.label} loses the ground in {100.0 * share:.2g} % of its time steps"
            for scheme, share in falling.items()
        ),
        "schemes that keep the stance foot on the ground, the default among them, have an order "
        "between 0.8 and 1.2",
        Scheme.IMPACT_RESOLVED in standing
        and all(0.8 < order < 1.2 for order in standing.values()),
        "The paper's orderings lose and regain contact by round-off. Their errors are uneven and "
        "another processor's are others, so that no order is read from them.",
    )


def lemke(evidence: Evidence) -> Claim:
    """Introduction: Lemke's algorithm has a low computational cost."""
    run = evidence.run
    cost = 1e6 * run.timing.wall_s / max(run.steps, 1)
    return Claim(
        "Section 1",
        "The contact problem is solved at low computational cost by Lemke's algorithm.",
        f"{cost:.2g} µs a time step in all: dynamics, controller, contact and record; "
        f"{run.solver.solves} contact problems, {run.solver.shortcuts} of them answered by the "
        f"contact modes of the step before, verified; {run.solver.fallbacks} fallbacks",
        "faster than real time",
        1e-6 * cost < TIME_STEP,
    )


def cost(evidence: Evidence) -> Claim:
    """Eq. 40: the torque cost of the gait is what the walk spends."""
    run, gait = evidence.run, evidence.gait
    starts = tracking_error(run, gait).reference.starts
    steps = max(len(starts) - 1, 1)
    spent = torque_cost(run, start=starts[0], end=starts[-1]) / steps
    impacts = sum(
        torque_cost(run, start=start - TIME_STEP / 2, end=start + SETTLING)
        for start in starts[1:-1]
    )
    smooth = spent - impacts / steps
    return Claim(
        "Section 4.2, eq. 40",
        "The trajectories minimise J = ∫ΓᵀΓ dt over a step.",
        f"{gait.cost:.4g} N²m²s by design; in the simulation {spent:.4g} N²m²s a step, of which "
        f"{spent - smooth:.3g} in the {1e3 * SETTLING:g} ms after touchdowns",
        "alike within 5 % but for those",
        abs(smooth - gait.cost) < 0.05 * gait.cost,
        "Of the optimum itself only this can be measured; it is a local one.",
    )


def underactuated(evidence: Evidence) -> Claim:
    """Conclusions: six actuators, underactuated in single support."""
    robot, gait = evidence.robot, evidence.gait
    sole = soles(robot)[gait.stance_foot]
    jacobian = point_jacobian(robot, gait.initial_state.q, sole.foot.link, sole.reference)
    freedoms = robot.nv - int(np.linalg.matrix_rank(jacobian))
    return Claim(
        "Section 6",
        "With only six actuators the robot is underactuated during single support.",
        f"{robot.nv} coordinates, of which a flat foot at rest leaves {freedoms} free; "
        f"{robot.nu} actuators",
        "fewer actuators than free coordinates",
        robot.nu < freedoms,
        "True in flight, and when the foot tips; not while it lies flat, which is what eq. 37 "
        "rests on.",
    )


def other_robots(evidence: Evidence) -> Claim:
    """Conclusions: other robots, given their complete model."""
    run = evidence.other
    steps = len(walking_steps(run))
    return Claim(
        "Section 6",
        "A complete mathematical model is needed, which limits the simulator; other robots are "
        "future work.",
        f"{run.robot.name} ({run.robot.total_mass:.3g} kg, its equations of motion made from its "
        f"file): {steps} of {STEPS} steps, {run.status.value}",
        "the claim of a limit holds if the other robot does not walk",
        steps < STEPS or not run.completed,
    )


CLAIMS: tuple[Callable[[Evidence], Claim], ...] = (
    tracking,
    velocities,
    zero_moment_point,
    friction,
    unilateral,
    stance_foot,
    swing_foot,
    symmetry,
    plastic_impact,
    energy,
    shock_accumulation,
    small_steps,
    first_order,
    lemke,
    cost,
    underactuated,
    other_robots,
)
"""One function a claim, in the order of the page."""


def judge(evidence: Evidence) -> tuple[Claim, ...]:
    """Measure every claim of the paper."""
    return tuple(claim(evidence) for claim in CLAIMS)


def _rms(values: Floats) -> float:
    return float(np.sqrt((values**2).mean()))


def _row_at(run: Run, time: float) -> int:
    """Row nearest to a time."""
    return int(np.abs(run.time - time).argmin())


def _stretches(rows: NDArray[np.bool_]) -> list[Integers]:
    """Consecutive true entries, as arrays of indices."""
    indices = np.flatnonzero(rows)
    return [
        part for part in np.split(indices, np.flatnonzero(np.diff(indices) > 1) + 1) if len(part)
    ]


def _swing_height(run: Run, gap: Floats) -> float:
    """Height of the lower corner of the foot that is up, from the gaps of one row."""
    return max(float(gap[list(foot.contacts)].min()) for foot in run.robot.feet)
