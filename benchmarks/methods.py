"""Three ways through contact, held against what is known about each.

Every line is measured now: closed forms and published numbers (docs/methods.md says where they come
from), orders of convergence, walks of bravo7 under every method, and what they cost. A line passes
if its figure meets the one beside it; the command fails if a line does not.

Run: python benchmarks/methods.py [--number 200000] [--only walks ...] [--json FILE]
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import sys
import time
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

import heelstrike as hs
from heelstrike.analysis.energy import energy_balance
from heelstrike.contact.modes import SolveStatus
from heelstrike.robot import read_mjcf
from heelstrike.sim import BristleFriction, EventKind, Scheme

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests"))

import contact_campaign
import contact_cost
import mechanisms
import walking

G = 9.81
EXACT = hs.EventDriven(rtol=1e-10, atol=1e-12)
PASSIVE = hs.EventDriven(rtol=1e-12, atol=1e-13, swing_feet_pass=True)
STEPS = np.array([2e-3, 1e-3, 5e-4, 2.5e-4, 1.25e-4])
NUMBER = 200_000


@dataclasses.dataclass(frozen=True)
class Line:
    """One figure: what it is, what it should be, what it is."""

    check: str
    wanted: str
    figure: str
    passed: bool


def at_most(check: str, value: float, limit: float, unit: str = "") -> Line:
    """Return a figure that passes if it does not exceed a limit."""
    unit = unit and f" {unit}"
    return Line(check, f"≤ {limit:.3g}{unit}", f"{value:.3g}{unit}", bool(value <= limit))


def at_least(check: str, value: float, limit: float, digits: int = 3) -> Line:
    """Return a figure that passes if it reaches a limit."""
    return Line(check, f"≥ {limit:.6g}", f"{value:.{digits}f}", bool(value >= limit))


def holds(check: str, figure: str, passed: bool, wanted: str = "yes") -> Line:
    """Return a figure that is not a number."""
    return Line(check, wanted, figure, bool(passed))


def simulate(
    robot: hs.Robot, q: Any, v: Any, duration: float, ground: hs.Ground, method: Any = EXACT
) -> hs.Run:
    """Simulate a mechanism."""
    run = hs.simulate(
        robot,
        state=hs.State(np.array(q, dtype=float), np.array(v, dtype=float)),
        duration=duration,
        method=method,
        ground=ground,
        stop_when_fallen=False,
    )
    if not run.completed:
        raise RuntimeError(run.message)
    return run


def events(run: hs.Run, kind: EventKind) -> list[Any]:
    """Events of one kind."""
    return [event for event in run.events if event.kind is kind]


def order(steps: Any, errors: Any) -> float:
    """Slope of the errors: where in a step an event falls makes single ones jump."""
    return float(np.polyfit(np.log(steps), np.log(errors), 1)[0])


# --- The contact problem -------------------------------------------------------------------------


def problems() -> Iterator[Line]:
    """Random contact problems through every solver."""
    table = contact_campaign.campaign(NUMBER, 0, compare_solvers=True)
    for name, limit in (
        ("robots", 100.0),
        ("fischer_burmeister alone", 99.9),
        ("lemke alone", 99.99),
    ):
        share = 100.0 * table["ended"][name][SolveStatus.SOLVED.name] / NUMBER
        yield at_least(f"{NUMBER} problems solved, {name}, %", share, limit, 4)
    yield at_most("claims that the residuals do not confirm", len(table["false_certificates"]), 0)
    yield at_most("worst certified residual", table["worst_certified_residual"], 1e-9)
    yield at_most("pairs of solvers that disagree", len(table["disagreements"]), 0)


def unsolvable() -> Iterator[Line]:
    """Problems without a solution."""
    # Two stops that ask one coordinate to move both ways, and a force that nothing can resist.
    contradiction = np.array([[1.0, 0, -1, 0], [0, 0, 0, 0], [-1, 0, 1, 0], [0, 0, 0, 0]])
    for name, delassus, free in (
        ("contradicting stops", contradiction, np.array([-1.0, 0.0, -1.0, 0.0])),
        ("nothing moves it", np.zeros((2, 2)), np.array([-1.0, 0.0])),
    ):
        solution = hs.solve_contact(delassus, free, 0.0)
        status = solution.certificate.status
        right = status is not SolveStatus.SOLVED and bool(np.all(np.isfinite(solution.impulse)))
        yield holds(f"{name}: status, impulse finite", status.name.lower(), right, "not solved")


def cost() -> Iterator[Line]:
    """Cost of a solve, both feet flat."""
    figures = contact_cost.measure()
    yield at_most("lemke, 4 vertices, median", figures["lemke"]["median_us"], 3.0, "µs")
    yield at_most("warm start, 4 vertices, median", figures["warm"]["median_us"], 1.0, "µs")


# --- Closed forms --------------------------------------------------------------------------------


def slope(friction: float, angle: float, method: Any = EXACT) -> tuple[Any, Any]:
    """Speed and time of a flat block that starts at rest on a slope."""
    up = np.array([-np.sin(angle), np.cos(angle)])
    run = simulate(
        mechanisms.block(0.2, 0.1), [*(0.05 * up), -angle], np.zeros(3), 2.0,
        hs.Ground(friction=friction, slope=angle), method,
    )  # fmt: skip
    return run.velocity[:, :2] @ np.array([np.cos(angle), np.sin(angle)]), run.time


def closed_forms() -> Iterator[Line]:
    """Event driven against closed forms."""
    for friction in (0.3, 0.8):
        speed, _ = slope(friction, np.arctan(friction - 1e-2))
        yield at_most(f"creep at μ − 0.01, μ = {friction}", np.abs(speed).max(), 1e-12, "m/s")
        angle = np.arctan(friction + 1e-2)
        speed, clock = slope(friction, angle)
        exact = -G * (np.sin(angle) - friction * np.cos(angle)) * clock
        yield at_most(f"sliding at μ + 0.01, μ = {friction}", np.abs(speed - exact).max(), 1e-8)
    speed, _ = slope(0.75, np.arctan(0.75) / 2.0, hs.TimeStepping())
    yield at_most("creep at half the friction angle, time stepping", np.abs(speed).max(), 1e-12)

    run = simulate(
        mechanisms.block(0.2, 0.02), [0, 0.01, 0], [2, 0, 0], 2.0, hs.Ground(friction=0.5)
    )
    yield at_most("sliding stop, 0.407747 m", abs(run.position[-1, 0] - 4.0 / G), 1e-8, "m")
    for name, method in (("event driven", EXACT), ("time stepping", hs.TimeStepping())):
        run = simulate(
            mechanisms.block(0.1, 0.1), [0, 0.05, 0], [6, 0, 0], 2.0, hs.Ground(friction=0.5),
            method,
        )  # fmt: skip
        yield at_most(f"lift of the flat cube, {name}", np.abs(run.gap).max(), 1e-9, "m")

    for friction in (0.5, 0.1):
        angle, radius = 0.3, 0.2
        start = [-radius * np.sin(angle), radius * np.cos(angle), 0.0]
        run = simulate(
            mechanisms.disc(radius), start, np.zeros(3), 2.0,
            hs.Ground(friction=friction, slope=angle),
        )  # fmt: skip
        force = min(G * np.sin(angle) / 3.0, friction * G * np.cos(angle))
        error = np.abs(run.contact_force[:, 0, 1] - force).max()
        yield at_most(f"disc on a slope, μ = {friction}: friction force", error, 1e-8, "N")

    for height, restitution in ((1.0, 0.5), (10.0, 0.8), (1.0, 0.9)):
        first = np.sqrt(2.0 * height / G)
        end = first * (1.0 + restitution) / (1.0 - restitution)
        run = simulate(
            mechanisms.point(), [0, height], [0, 0], end + 0.5, hs.Ground(restitution=restitution),
            hs.EventDriven(),
        )  # fmt: skip
        (zeno,) = events(run, EventKind.ZENO)
        name = f"bouncing point, {height:g} m, e = {restitution}"
        limit = 1e-6 if restitution == 0.9 else 1e-8
        yield at_most(f"{name}: Zeno time {end:.8f}", abs(zeno.time - end), limit, "s")
        resting = np.abs(run.velocity[run.time > zeno.time]).max()
        yield at_most(f"{name}: speed afterwards", resting, 1e-12, "m/s")
        tops = [
            abs(run.velocity[np.flatnonzero(np.abs(run.time - e.time) < 1e-11)[-1], 1] ** 2
                / (2 * G * height) - restitution ** (2 * n))
            for n, e in enumerate(events(run, EventKind.TOUCHDOWN)[:6], start=1)
        ]  # fmt: skip
        yield at_most(f"{name}: bounce heights e²ⁿ", max(tops), 1e-8)
        yield at_most(f"{name}: computing", run.timing.wall_s, 1.0, "s")

    width, height = 0.2, 1.0
    angle = np.arctan(width / height)
    c, s = np.cos(0.5 * angle), np.sin(0.5 * angle)
    corner = 0.5 * np.array([c * width - s * height, -s * width - c * height])
    run = simulate(
        mechanisms.block(width, height), [0.5 * width - corner[0], -corner[1], 0.5 * angle],
        np.zeros(3), 5.0, hs.Ground(friction=5.0),
    )  # fmt: skip
    worst = 0.0
    for impact in [e for e in events(run, EventKind.TOUCHDOWN) if e.time > 0.0][:10]:
        rows = np.flatnonzero(np.abs(run.time - impact.time) < 1e-11)
        ratio = run.velocity[rows[-1], 2] / run.velocity[rows[0], 2]
        worst = max(worst, abs(ratio - 1.0 + 1.5 * np.sin(angle) ** 2))
    yield at_most("rocking block: 1 − (3/2) sin² α an impact", worst, 1e-8)


def dry_friction() -> Iterator[Line]:
    """Dry friction of joints against closed forms."""

    def sled(stiffness: float, friction: float) -> hs.Robot:
        return read_mjcf(
            f"""<mujoco><option gravity="0 0 0"/><worldbody><body name="sled">
              <joint name="x" type="slide" axis="1 0 0" frictionloss="{friction}"
                stiffness="{stiffness}"/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>
            </body></worldbody></mujoco>""",
            name="sled",
        )

    run = simulate(sled(0.0, 1.5), [0], [2], 2.0, hs.Ground())
    yield at_most("dry slide: stop at m v² / 2F", abs(run.position[-1, 0] - 4.0 / 3.0), 1e-8, "m")
    (stick,) = events(run, EventKind.JOINT_STICK)
    yield at_most("dry slide: stop at m v / F", abs(stick.time - 4.0 / 3.0), 1e-8, "s")
    balance = energy_balance(
        simulate(sled(0.0, 1.5), [0], [2], 2.0, hs.Ground(), hs.TimeStepping())
    )
    yield at_most("dry slide: energy, time stepping", np.abs(balance.residual).max(), 1e-12, "J")
    spring = sled(100.0, 10.0)
    run = simulate(spring, [1.03], [0], 2.0, hs.Ground())
    error = abs(run.position[-1, 0] + 0.03)
    yield at_most("dry oscillator: five swings less 2F/k each", error, 1e-8, "m")
    steps = STEPS[:4]
    errors = [
        abs(simulate(spring, [1.03], [0], 2.0, hs.Ground(), hs.TimeStepping(step=h))
            .position[-1, 0] + 0.03)
        for h in steps
    ]  # fmt: skip
    yield at_least("dry oscillator: order of time stepping", order(steps, errors), 0.9)


# --- Impacts and paradoxes -----------------------------------------------------------------------


def impacts() -> Iterator[Line]:
    """Energy, Kane's and Painlevé's paradoxes, Siconos' published digits."""
    run = simulate(
        mechanisms.point(), [0, 1], [0, 0], 1.0, hs.Ground(restitution=0.9),
        hs.TimeStepping(step=5e-3, scheme=Scheme.MOREAU_JEAN),
    )  # fmt: skip
    row = int(np.flatnonzero(run.velocity[:, 1] > 0.0)[0])
    printed = f"{run.velocity[row, 1]:.5f} m/s at {run.time[row]:.3f} s"
    yield Line("Siconos BouncingBallTS", "3.97305 m/s at 0.455 s", printed,
               printed == "3.97305 m/s at 0.455 s")  # fmt: skip

    made, silent = 0.0, 0
    inertia = (0.3**2 + 0.1**2) / 12.0
    for restitution in (0.0, 0.5, 1.0):
        for tilt in (-0.9, -0.3, 0.3, 0.9):
            run = simulate(
                mechanisms.block(0.3, 0.1), [0, 0.6, tilt], [2.5, -1, -3], 1.0,
                hs.Ground(friction=0.6, restitution=restitution),
            )  # fmt: skip
            energy = G * run.position[:, 1] + 0.5 * run.velocity**2 @ np.array([1, 1, inertia])
            gained = float(np.diff(energy).max())
            if not events(run, EventKind.ENERGY_GAIN):
                made = max(made, gained)
                silent += 1
    yield at_most(f"energy made by {silent} tumbling blocks that report none", made, 1e-7, "J")

    pitch = 0.25 * np.pi
    q = [0.5 * np.sin(pitch), 0.5 * np.cos(pitch) + 1e-3, pitch]
    told = []
    for sliding in (-0.3, 0.3, 2.0):
        run = simulate(
            mechanisms.rod(), q, [sliding, -1, 0], 2e-3, hs.Ground(friction=1, restitution=1)
        )
        energy = 0.5 * run.velocity**2 @ np.array([1, 1, 1 / 12]) + G * run.position[:, 1]
        told.append((energy[-1] - energy[0] > 1e-9, bool(events(run, EventKind.ENERGY_GAIN))))
    right = all(gained == said for gained, said in told) and sum(g for g, _ in told) == 1
    yield holds(
        "Kane's paradox: found where it is, and only there", str(right).lower(), right, "true"
    )

    for angle, critical in ((45.0, 5.0 / 3.0), (63.43494882292201, 4.0 / 3.0)):
        pitch = 0.5 * np.pi - np.radians(angle)
        q = [0.5 * np.sin(pitch), 0.5 * np.cos(pitch), pitch]
        jumps = [
            len(events(simulate(mechanisms.rod(), q, [-1, 0, 0], 1e-5,
                                hs.Ground(friction=critical + change)), EventKind.PAINLEVE))
            for change in (-1e-2, 1e-2)
        ]  # fmt: skip
        figure = f"{jumps[0]} below, {jumps[1]} above"
        name = f"Painlevé rod at {angle:.3f}°, μ = {critical:.4f} ∓ 0.01: impulses"
        yield Line(name, "0 below, 1 above", figure, jumps == [0, 1])


# --- Limit cycles --------------------------------------------------------------------------------


def cycles() -> Iterator[Line]:
    """Rimless wheel and compass gait."""
    spoke = np.pi / 8.0
    for gravity, angle, speed, period in (
        (9.81, 0.08, 1.0954628396, 1.0345498114),
        (9.8, 0.15, 1.4972474413, 0.5266577771),
    ):
        figures = []
        for inertia in (1e-5, 2e-5):
            hub = np.cos(spoke) * np.array([np.sin(angle), np.cos(angle)])
            arm = np.array([-np.sin(spoke - angle), np.cos(spoke - angle)])
            rate = 1.1 * speed
            cycle = hs.find_limit_cycle(
                mechanisms.rimless_wheel(inertia=inertia, gravity=gravity),
                hs.State(np.array([*hub, angle]), np.array([rate * arm[1], -rate * arm[0], rate])),
                ground=hs.Ground(friction=3.0, slope=-angle),
            )
            figures.append([cycle.state.v[2], cycle.period, cycle.multipliers[0].real])
        # Smooth in the inertia about the hub, which must not be zero: the limit of two.
        limit = 2.0 * np.array(figures[0]) - np.array(figures[1])
        name = f"rimless wheel, slope {angle}"
        yield at_most(f"{name}: speed {speed}", abs(limit[0] - speed), 1e-8, "rad/s")
        yield at_most(f"{name}: period {period}", abs(limit[1] - period), 1e-8, "s")
        yield at_most(f"{name}: multiplier cos² 2α", abs(limit[2] - np.cos(2 * spoke) ** 2), 1e-5)
    stance, swing = -0.2, 0.34
    start = hs.State(
        np.array([np.sin(stance), np.cos(stance), stance, swing]),
        np.array([np.cos(stance) * 1.05, -np.sin(stance) * 1.05, 1.05, 0.35]),
    )
    for gravity, rates, period in (
        (9.8, (1.091826677, 0.377181558), 0.734720962),
        (9.81, (1.092383590, 0.377373949), 0.734346391),
    ):
        cycle = hs.find_limit_cycle(
            mechanisms.compass_gait(gravity), start,
            ground=hs.Ground(friction=3.0, slope=-np.deg2rad(3.0)), method=PASSIVE,
        )  # fmt: skip
        first = int(np.argmin(cycle.state.q[2:]))
        place = [2 + first, 3 - first]
        error = np.abs(
            [*(cycle.state.q[place] - [-0.218668803, 0.323388558]), *(cycle.state.v[place] - rates)]
        ).max()
        name = f"compass gait, g = {gravity}"
        yield at_most(f"{name}: fixed point", error, 1e-8)
        yield at_most(f"{name}: period {period}", abs(cycle.period - period), 1e-8, "s")
        published = [-0.199726 - 0.544476j, -0.199726 + 0.544476j, 0.131573]
        error = np.abs(np.sort_complex(cycle.multipliers) - published).max()
        yield at_most(f"{name}: multipliers", error, 1e-5)


# --- Orders of convergence -----------------------------------------------------------------------


def orders() -> Iterator[Line]:
    """Time stepping: how the error falls with the step."""
    errors = []
    for h in STEPS:
        run = simulate(
            mechanisms.point(), [0, 1], [0, 0], 0.9, hs.Ground(restitution=0.5),
            hs.TimeStepping(step=h, scheme=Scheme.MOREAU_JEAN),
        )  # fmt: skip
        errors.append(abs(run.gap[run.time > 0.5, 0].max() - 0.25))
    yield at_least("order: bounce height, Moreau-Jean", order(STEPS, errors), 0.9)
    errors = [
        abs(simulate(mechanisms.block(0.2, 0.02), [0, 0.01, 0], [2, 0, 0], 0.6,
                     hs.Ground(friction=0.5), hs.TimeStepping(step=h)).position[-1, 0] - 4.0 / G)
        for h in STEPS
    ]  # fmt: skip
    yield at_least("order: sliding stop", order(STEPS, errors), 0.9)
    end = 3.0 / (3.0 * 0.2 * G)
    exact = (3.0 - 0.1 * G * end) * end + 2.0 * end
    steps = [end / (count + 0.5) for count in (250, 500, 1000, 2000)]
    errors = [
        abs(simulate(mechanisms.disc(0.2), [0, 0.2, 0], [3, 0, 0], 2 * end,
                     hs.Ground(friction=0.2), hs.TimeStepping(step=h)).position[-1, 0]
            - exact)
        for h in steps
    ]  # fmt: skip
    yield at_least("order: disc that comes to roll", order(steps, errors), 0.9)


# --- Walks ---------------------------------------------------------------------------------------


@cache
def walk(method: Any, duration: float, ground: hs.Ground | None = None, every: int = 1) -> hs.Run:
    """Walk bravo7's reference gait."""
    return hs.simulate(
        walking.bravo7(),
        hs.ComputedTorque(walking.bravo7(), walking.gait()),
        state=walking.gait().initial_state,
        duration=duration,
        method=method,
        ground=ground or hs.Ground(friction=walking.FRICTION),
        record_every=every,
    )


def walks() -> Iterator[Line]:
    """bravo7 walks 20 steps under every method."""
    methods: dict[str, Any] = {
        "event driven": hs.EventDriven(),
        **{
            f"{scheme.name.lower()}, h = {h:g}": hs.TimeStepping(step=h, scheme=scheme)
            for scheme, h in (
                (Scheme.IMPACT_RESOLVED, 1e-3),
                (Scheme.GAP_LINEARISED, 1e-3),
                (Scheme.LINEARLY_IMPLICIT, 1e-3),
                (Scheme.MOREAU_JEAN, 1e-4),
                (Scheme.PAPER_EXPLICIT, 1e-4),
                (Scheme.PAPER_SYMPLECTIC, 1e-4),
            )
        },
        "Hunt-Crossley": hs.Compliant(law=hs.HuntCrossley()),
        "Kelvin-Voigt": hs.Compliant(law=hs.KelvinVoigt()),
    }
    for name, method in methods.items():
        run = walk(method, 20.1 * 0.7)
        summary = run.summary(gait=walking.gait())
        figure = (
            f"{run.status.value}, {summary.steps} steps, tracking {summary.tracking_rms_rad:.1e}"
        )
        ok = run.completed and summary.steps == 20 and run.certificates.complementarity <= 1e-9
        yield Line(f"walk, {name}", "completed, 20 steps", figure, ok)
    exact = walk(hs.EventDriven(), 20.1 * 0.7)
    row = int(np.flatnonzero(np.abs(exact.time - 1.0) < 1e-9)[-1])
    numbers = np.array([5_000, 10_000, 20_000, 40_000, 80_000])  # steps in the first second
    for scheme in Scheme:
        # Where in a step the touchdown falls makes single errors jump: mean of eight near steps.
        means = []
        for number in numbers:
            errors = []
            for count in np.round(number * (1.0 + np.arange(8) / 40.0)):
                run = walk(hs.TimeStepping(step=1.0 / count, scheme=scheme), 1.0, every=10**6)
                errors.append(np.abs(run.position[-1] - exact.position[row])[3:].max())
            means.append(np.sqrt(np.mean(np.square(errors))))
        name = f"walk, {scheme.name.lower()} to event driven: order"
        yield at_least(name, order(1.0 / numbers, means), 0.9)

    hard = walk(hs.EventDriven(), 0.65).position[-1]
    stiffness = np.array([1e6, 1e7, 1e8])
    errors = []
    for k in stiffness:
        law = hs.KelvinVoigt(stiffness=k, damping=6e-3 * k)
        friction = BristleFriction(stiffness=k, damping=6e-3 * k)
        soft = walk(hs.Compliant(law=law, friction=friction, step=1e-4), 0.65)
        errors.append(np.abs(soft.position[-1] - hard).max())
    yield at_least(
        "walk, compliant to event driven: order in 1/k", order(1 / stiffness, errors), 0.9
    )
    yield at_most("walk, compliant at k = 1e8 N/m: difference", errors[-1], 1e-5)


def uneven() -> Iterator[Line]:
    """Grounds that bravo7's gait was not made for."""
    rise = float(np.tan(np.deg2rad(5.0)))
    for name, ground in (
        ("stairs down", hs.Ground.stairs(rise=-0.01, tread=0.3, count=20, start=0.15)),
        ("5° up", hs.Ground(profile=[[-1, 0], [0.15, 0], [10.15, 10 * rise]])),
        ("5° down", hs.Ground(profile=[[-1, 0], [0.15, 0], [10.15, -10 * rise]])),
        (
            "rough ± 5 mm",
            hs.Ground.rough(amplitude=5e-3, spacing=0.1, length=10, seed=1, start=0.15),
        ),
    ):
        run = walk(hs.EventDriven(), 4.0, ground)
        landings = len(events(run, EventKind.TOUCHDOWN))
        figure = (
            f"{run.status.value} at {run.time[-1]:.2f} s, {landings} touchdowns, penetration "
            f"{run.certificates.penetration:.0e} m"
        )
        ok = run.status.value in ("completed", "fell") and run.certificates.penetration <= 1e-10
        ok = ok and run.solver.failures == 0 and run.certificates.complementarity <= 1e-9
        yield Line(f"event driven, {name}", "penetration ≤ 1e-10 m", figure, ok)


def speed() -> Iterator[Line]:
    """Seven seconds of walking, event driven, at the default tolerance."""
    best = np.inf
    for _ in range(5):
        walk.cache_clear()
        run = walk(hs.EventDriven(rtol=1e-8), 7.0)
        best = min(best, run.timing.wall_s)
    yield at_most("bravo7, 7 s event driven, rtol 1e-8", best, 0.2, "s")


SECTIONS: dict[str, Callable[[], Iterator[Line]]] = {
    each.__name__: each
    for each in (
        problems,
        unsolvable,
        cost,
        closed_forms,
        dry_friction,
        impacts,
        cycles,
        orders,
        walks,
        uneven,
        speed,
    )
}


def main() -> None:
    """Print the table; fail if a line does."""
    global NUMBER
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--number", type=int, default=NUMBER, help="contact problems")
    parser.add_argument("--only", nargs="+", choices=list(SECTIONS), default=list(SECTIONS))
    parser.add_argument("--json", type=Path, help="write the lines there, too")
    options = parser.parse_args()
    NUMBER = options.number
    lines: list[Line] = []
    for name in options.only:
        begin = time.perf_counter()
        for line in SECTIONS[name]():
            lines.append(line)
            mark = "   " if line.passed else "!!!"
            print(f"{mark} {line.check:66s} {line.wanted:24s} {line.figure}", flush=True)
        print(f"    ({name}: {time.perf_counter() - begin:.0f} s)", flush=True)
    if options.json:
        options.json.write_text(json.dumps([dataclasses.asdict(each) for each in lines], indent=2))
    missed = sum(not line.passed for line in lines)
    print(f"{len(lines) - missed} of {len(lines)} figures met")
    sys.exit(1 if missed else 0)


if __name__ == "__main__":
    main()
