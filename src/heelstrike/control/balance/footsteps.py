"""Where and when the next foot lands, and where the foot that stands presses meanwhile.

The capture point of a body that keeps its height over a foot pressed at p runs away from there,
ξ(t) = p + (ξ₀ − p) e^{ωt} (T. Koolen et al., *Capturability-based analysis and control of legged
locomotion*, 2012). A gait needs it at a certain place before the foot that lands. The plan is the
landing that costs least, as in M. Khadiv et al., *Walking control based on step timing adaptation*
(2020): for every time that it may take, the centre of pressure that brings the capture point
nearest to where it belongs, then the foothold, each within its limits.
"""

from __future__ import annotations

from math import exp

from heelstrike.compiler.bundle import Bundle, cell, number
from heelstrike.compiler.compilation import kernel
from heelstrike.control.balance.reference import Reference, value_at

COMMITTED = 0.06
"""A landing sooner than this, in durations of a step, is not planned again."""

TIMES = 25
"""Remaining times that a plan is chosen from, besides the gait's own."""

NEAR = 0.03
"""How far, in lengths of a step, a foot is placed beside the gait's foothold as it flies there."""


NO_PLAN = 1e30
"""Cost of a plan that is not made: more than any has."""

LEAST_TIME = 1e-4
"""Least time (s) to the landing that is reckoned with: far less than between two calls."""


class Planning(Bundle):
    """What plans are made by."""

    heel: float = number(float)
    toe: float = number(float)
    """heel, toe: Where the centre of pressure may be along the sole, from its middle (m)."""
    shortest: float = number(float)
    longest: float = number(float)
    """shortest, longest: Where a foot may land before the other (m)."""
    earliest: float = number(float)
    latest: float = number(float)
    """earliest, latest: When (s after the last)."""
    soon: float = number(float)
    """The centre of pressure is not planned for less than this (s)."""
    acceleration: float = number(float)
    """That of the swing foot at most (m/s²)."""
    hurry: float = number(float)
    """How many times faster than in the gait the swing foot may move."""
    foothold_weight: float = number(float)
    time_weight: float = number(float)
    capture_weight: float = number(float)
    """foothold_weight, time_weight, capture_weight: Costs of deviations (1/m², 1/s², 1/m²)."""


class Plan(Bundle):
    """A landing, and what it is reckoned from."""

    length: float = cell(float)
    offset: float = cell(float)
    """length, offset: Step that is wanted (m), and capture point before the foot as it lands
    (m)."""
    phase: float = cell(float)
    elapsed: float = cell(float)
    """phase, elapsed: Where the reference is, and how long the foot has stood (s)."""
    gone: float = cell(float)
    """Time since the plan before (s)."""
    capture: float = cell(float)
    """Capture point before the stance sole's middle (m)."""
    swing: float = cell(float)
    speed: float = cell(float)
    """swing, speed: Where the swing sole is, and how fast (m, m/s)."""
    foothold: float = cell(float)
    remaining: float = cell(float)
    """foothold, remaining: Where it lands, and when (m, s from now)."""
    pressure: float = cell(float)
    """Centre of pressure until then (m)."""
    error: float = cell(float)
    """How far from the wanted place the capture point would be as the gait's foot lands, if nothing
    were done (m)."""
    cost: float = cell(float)
    """What the plan costs."""


@kernel
def own_pressure(planning: Planning, reference: Reference, phase: float) -> float:
    """Centre of pressure that takes the capture point where the gait does in the rest of a step."""
    rest = (1.0 - phase) * reference.duration
    if rest < planning.soon:
        found = value_at(reference.pressure, phase)
    else:
        grown = exp(reference.rate * rest)
        found = (reference.end - value_at(reference.capture, phase) * grown) / (1.0 - grown)
    return min(max(found, planning.heel), planning.toe)


@kernel
def consider(
    planning: Planning, reference: Reference, own: float, correction: float, remaining: float,
    plan: Plan,
) -> None:  # fmt: skip
    """Take a remaining time for the plan if it costs less than the plan so far."""
    grown = exp(reference.rate * remaining)
    slow = exp(reference.rate * max(remaining, planning.soon))
    free = own + correction + (plan.capture - own) * grown
    wanted = plan.length + plan.offset
    shift = (free - wanted) / (slow - 1.0)
    shift = min(max(shift, planning.heel - own), planning.toe - own)
    end = free - shift * (grown - 1.0)
    light, heavy = planning.foothold_weight, planning.capture_weight
    foothold = (light * plan.length + heavy * (end - plan.offset)) / (light + heavy)
    reach = planning.acceleration * remaining * remaining / 6.0
    # It comes to rest there with the least effort, or flies on as the gait's foot does.
    ahead = plan.swing + 2.0 / 3.0 * plan.speed * remaining
    flies = min(plan.swing + plan.speed * remaining, plan.length)
    near = min(reach, NEAR * reference.length)
    foothold = min(max(foothold, ahead - reach), max(ahead + reach, flies + near))
    foothold = min(max(foothold, planning.shortest), planning.longest)
    off = foothold - plan.length
    late = plan.elapsed + remaining - reference.duration
    missed = end - foothold - plan.offset
    cost = light * off * off + planning.time_weight * late * late + heavy * missed * missed
    if cost < plan.cost:
        plan.cost = cost
        plan.foothold = foothold
        plan.remaining = remaining
        # What is off is gone a little before the foot lands: later, nothing could mend the rest.
        before = max(remaining - 2.0 * planning.soon, planning.soon)
        hurried = shift * (1.0 - 1.0 / slow) / (1.0 - exp(-reference.rate * before))
        plan.pressure = min(max(hurried, planning.heel - own), planning.toe - own)


@kernel
def choose_time(
    planning: Planning, reference: Reference, own: float, correction: float, soonest: float,
    plan: Plan,
) -> None:  # fmt: skip
    """Look for a remaining time that costs less: on a grid, then between its points."""
    least = max(planning.earliest - plan.elapsed, soonest)
    most = max(planning.latest - plan.elapsed, least)
    width = (most - least) / (TIMES - 1)
    for k in range(TIMES):
        consider(planning, reference, own, correction, least + width * k, plan)
    for _ in range(4):
        width *= 0.5
        middle = plan.remaining
        consider(planning, reference, own, correction, max(middle - width, least), plan)
        consider(planning, reference, own, correction, min(middle + width, most), plan)


@kernel
def make_plan(planning: Planning, reference: Reference, retimed: bool, plan: Plan) -> None:
    """Write the landing that costs least; if not `retimed`, when the gait lands."""
    own = own_pressure(planning, reference, plan.phase)
    rest = (1.0 - plan.phase) * reference.duration
    grown = exp(reference.rate * rest)
    capture = value_at(reference.capture, plan.phase)
    correction = reference.end - own - (capture - own) * grown
    plan.error = own + correction + (plan.capture - own) * grown - plan.length - plan.offset
    plan.cost = NO_PLAN
    least = COMMITTED * reference.duration
    left = plan.remaining - plan.gone
    if left < least and plan.elapsed > 0.0:
        # The foot is as good as down: what is left is too short to be worth another plan.
        consider(planning, reference, own, correction, max(left, LEAST_TIME), plan)
    else:
        rest = reference.duration - plan.elapsed
        consider(planning, reference, own, correction, max(rest, least), plan)
        if retimed:
            least = max(least, (1.0 - plan.phase) * reference.duration / planning.hurry)
            choose_time(planning, reference, own, correction, least, plan)
    plan.pressure += value_at(reference.pressure, plan.phase)
    plan.pressure = min(max(plan.pressure, planning.heel), planning.toe)
