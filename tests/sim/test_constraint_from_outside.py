"""Kinds of row of one's own, under every method, against textbook motion.

A mass on an inextensible cable falls until that is taut, loses what was along the cable (or
gives back e of it), and swings on as a pendulum, whose energy stays. So do cables in
:mod:`harness`, a user's file: no line of the package knows of them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import walking
from harness import Cable, Pin, Rub, Table
from scipy.special import ellipk

import heelstrike as hs
from heelstrike.robot import Robot

G, MASS = 9.81, 2.0
STEPPING = hs.TimeStepping(step=1e-3)
EXACT = hs.EventDriven(rtol=1e-10, atol=1e-12)


@lru_cache
def mass() -> Robot:
    """A point mass with coordinates x and z, and a pitch that nothing turns."""
    builder = hs.RobotBuilder("mass", gravity=G)
    rail = builder.slide("x", None, direction=(1, 0), mass=0.0)
    fall = builder.slide("z", rail, direction=(0, 1), mass=0.0)
    body = builder.hinge("body", fall, mass=MASS, inertia=0.1)
    builder.contact(body, (0.0, -50.0))
    return builder.build()


def run(
    *constraints: hs.Constraint, q: Any, v: Any = (0.0, 0.0, 0.0), duration: float = 0.5,
    method: hs.Method = STEPPING, robot: Robot | None = None,
) -> hs.Run:  # fmt: skip
    found = hs.simulate(
        hs.constrained(mass() if robot is None else robot, *constraints),
        state=hs.State(q, v), duration=duration, method=method, ground=hs.Ground(profile=LOW),
    )  # fmt: skip
    assert found.completed, found.message
    return found


LOW = ((-9.0, -100.0), (9.0, -100.0))
CABLE = Cable("body", length=1.0)


def energy(found: hs.Run) -> np.ndarray:
    return 0.5 * MASS * np.sum(found.velocity[:, :2] ** 2, axis=1) + MASS * G * found.position[:, 1]


@pytest.mark.parametrize(
    ("method", "within"), [(STEPPING, 2e-3), (EXACT, 1e-8), (hs.Compliant(), 5e-3)], ids=str
)
def test_a_taut_cable_is_a_pendulum(method: hs.Method, within: float) -> None:
    """From 1 rad it is back after 4 √(l/g) K(sin² 1/2), its energy kept, the cable at its length.

    The force in the lowest place is m g (3 − 2 cos 1).
    """
    once = 4.0 * math.sqrt(1.0 / G) * ellipk(math.sin(0.5) ** 2)
    start = [math.sin(1.0), -math.cos(1.0), 0.0]
    found = run(CABLE, q=start, duration=math.floor(once * 1e3) * 1e-3, method=method)
    np.testing.assert_allclose(found.position[-1, :2], start[:2], atol=within + 1e-3 * 1e-3 * G)
    total = energy(found)
    np.testing.assert_allclose(total - total[0], 0.0, atol=within * MASS * G)
    long = np.hypot(*found.position[:, :2].T)
    np.testing.assert_allclose(long, 1.0, atol=max(within, 1e-9))
    assert found.constraint_force.shape == (len(found.time), 1, 2)
    most = found.constraint_force[:, 0, 0].max()
    assert most == pytest.approx(MASS * G * (3.0 - 2.0 * math.cos(1.0)), rel=max(within, 1e-3))
    assert max(found.certificates.complementarity, found.certificates.non_penetration) < 1e-9


@pytest.mark.parametrize("restitution", [0.0, 0.6])
@pytest.mark.parametrize(("method", "within"), [(STEPPING, 1e-2), (EXACT, 1e-7)], ids=str)
def test_a_slack_cable_becomes_taut_with_an_impact(
    method: hs.Method, within: float, restitution: float
) -> None:
    """Dropped from (0.6, 0): taut at z = −0.8 after √(1.6/g) with √(1.6 g) down.

    Of that, 0.8 is along the cable and lost but for e; 0.6 is across and stays.
    """
    cable = Cable("body", length=1.0, restitution=restitution)
    found = run(cable, q=[0.6, 0.0, 0.0], duration=0.42, method=method)
    taut = next(event for event in found.events if event.kind.name == "CONSTRAINT_HOLDS")
    speed = math.sqrt(1.6 * G)
    assert taut.time == pytest.approx(speed / G, abs=2e-3 if method is STEPPING else 1e-9)
    assert taut.place(found.robot) == "Cable"
    impulse = MASS * 0.8 * speed * (1.0 + restitution)
    assert taut.impulse[0] == pytest.approx(impulse, rel=within)
    after = found.velocity[int(np.searchsorted(found.time, taut.time + 1.5e-3))]
    across = np.array([-0.8, -0.6])
    assert after[:2] @ across == pytest.approx(0.6 * speed, rel=max(within, 1e-2))
    inwards = after[:2] @ np.array([-0.6, 0.8])
    assert inwards == pytest.approx(0.8 * restitution * speed, abs=0.02 * speed)
    assert np.all(found.constraint_force[found.time < taut.time - 2e-3] == 0.0)
    if restitution:
        kinds = [event.kind.name for event in found.events]
        assert method is EXACT or "CONSTRAINT_LETS_GO" in kinds


@pytest.mark.parametrize("method", [STEPPING, EXACT], ids=str)
def test_a_cable_lets_go_of_what_rises(method: hs.Method) -> None:
    """A pendulum at 0.3 m/s more than √(2 g l) at the bottom goes slack above the level of its end.

    There v² = v₀² − 2 g l (1 + sin φ), and the force vanishes where v² = g l sin φ.
    """
    first = math.sqrt(2.0 * G) + 0.3
    found = run(CABLE, q=[0.0, -1.0, 0.0], v=[first, 0.0, 0.0], duration=0.7, method=method)
    height = (first**2 - 2.0 * G) / (3.0 * G)
    slack = next(event for event in found.events if event.kind.name == "CONSTRAINT_LETS_GO")
    row = int(np.searchsorted(found.time, slack.time - 1e-9))
    assert found.position[row, 1] == pytest.approx(height, abs=5e-3 if method is STEPPING else 1e-7)


@pytest.mark.parametrize(
    ("method", "within"), [(STEPPING, 1e-4), (EXACT, 1e-9), (hs.Compliant(), 1e-6)], ids=str
)
def test_a_pin_is_a_hinge(method: hs.Method, within: float) -> None:
    """A robot pinned to the world against one whose hinge is there by its tree."""
    loose, fixed = (hs.RobotBuilder("rod", gravity=G) for _ in range(2))
    rail = loose.slide("x", None, direction=(1, 0), mass=0.0)
    fall = loose.slide("z", rail, direction=(0, 1), mass=0.0)
    for build, parent in ((loose, fall), (fixed, None)):
        body = build.hinge("swing", parent, mass=MASS, inertia=0.05, center_of_mass=(0.0, -0.4))
        build.contact(body, (0.0, -50.0))
    pinned = run(Pin(link=2), q=[0.0, 0.0, 1.2], duration=0.4, method=method, robot=loose.build())
    state = hs.State([1.2], [0.0])
    ground = hs.Ground(profile=LOW)
    tree = hs.simulate(fixed.build(), state=state, duration=0.4, method=method, ground=ground)
    assert pinned.final_state.q[2] == pytest.approx(tree.final_state.q[0], abs=within)
    np.testing.assert_allclose(pinned.position[:, :2], 0.0, atol=1e-9)
    turn = pinned.position[:, 2]
    force = pinned.constraint_force[0, 0]
    assert np.all(np.isfinite(force))
    assert abs(force[1]) > 1.0
    assert np.ptp(turn) > 0.5


def test_what_rubs_and_what_carries_in_time_stepping() -> None:
    """Sliding stops after v / a: on a guide a = F / m, on a table a = μ g, by its impulse."""
    for constraint, slows in ((Rub(bound=2.0), 2.0 / MASS), (Table(friction=0.5), 0.5 * G)):
        found = run(constraint, q=[0.0, 0.0, 0.0], v=[0.4, 0.0, 0.0], duration=0.6)
        stopped = 0.4 / slows
        at_rest = np.abs(found.velocity[:, 0]) < 1e-12
        first = found.time[at_rest][0] if at_rest.any() else math.inf
        assert first == pytest.approx(stopped, abs=3e-3)
        if isinstance(constraint, Table):
            np.testing.assert_allclose(found.position[:, 1], 0.0, atol=1e-12)
            normal, tangent = found.constraint_force[5, 0]
            assert normal == pytest.approx(MASS * G)
            assert tangent == pytest.approx(-0.5 * MASS * G)


def test_a_biped_in_a_harness_does_not_fall() -> None:
    """Held by a slack leash at its trunk it hangs there, and the leash carries its weight."""
    robot = walking.bravo7()
    begin = robot.reference_state()
    trunk = robot.link_names[2]
    high = float(begin.q[1]) + 0.5
    held = hs.constrained(robot, Cable(trunk, float(begin.q[0]), high, 0.6))
    found = hs.simulate(held, state=begin, duration=1.5, stop_when_fallen=False)
    assert found.completed, found.message
    reach = np.hypot(found.position[:, 0] - begin.q[0], found.position[:, 1] - high)
    assert reach.max() < 0.6 + 1e-6
    assert found.constraint_force[:, 0, 0].max() > 0.5 * robot.weight
    assert max(found.certificates.complementarity, found.certificates.non_penetration) < 1e-9


def test_a_run_is_kept_and_gone_on_with(tmp_path: Path) -> None:
    found = run(CABLE, q=[0.6, -0.8, 0.0], duration=0.05)
    path = found.save(tmp_path / "run.nc")
    again = hs.load_run(path, classes=[Cable])
    assert again.robot.constraints == (CABLE,)
    np.testing.assert_array_equal(again.constraint_force, found.constraint_force)
    with pytest.raises(hs.RunFileError, match=r"constraint 'Cable'.*classes=\[Cable\]"):
        hs.load_run(path)
    assert found.final is not None
    more = hs.simulate(found.robot, state=found.final, duration=0.05, method=STEPPING)
    whole = run(CABLE, q=[0.6, -0.8, 0.0], duration=0.1)
    np.testing.assert_array_equal(more.position[-1], whole.position[-1])
    longer = hs.constrained(mass(), Cable("body", length=2.0))
    with pytest.raises(hs.SimulationError):
        hs.simulate(longer, state=found.final, duration=0.01, method=STEPPING)


def test_what_cannot_be_is_refused_in_words() -> None:
    class Bare(hs.Constraint):
        pass

    @dataclass(frozen=True)
    class Twice(Rub):
        components = 2

    for wrong, words in (
        (3.0, "derives from Constraint"),
        (dataclass(frozen=True)(Bare)(), "Bare has no kernel: write rows"),
        (Twice(), "has set .* and 2 components"),
        (Cable("body", restitution=2.0), "restitution of constraint Cable cannot be 2"),
    ):
        with pytest.raises(hs.SimulationError, match=words):
            hs.constrained(mass(), wrong)  # type: ignore[arg-type]
    for method, constraint in ((EXACT, Rub()), (hs.Compliant(), Table())):
        with pytest.raises(hs.SimulationError, match=r"cannot simulate constraint .* TimeStepping"):
            run(constraint, q=[0.0, 0.0, 0.0], method=method)
    with pytest.raises(hs.SimulationError, match="constraint Cable of robot 'mass' is broken by 1"):
        run(CABLE, q=[2.0, 0.0, 0.0])
