"""A contact problem that a solver fails at: the next one tries, and without any the run ends."""

from __future__ import annotations

import numpy as np
import pytest

import heelstrike as hs
from heelstrike.compiler.compilation import uncompiled
from heelstrike.contact.solvers import certified_solve
from heelstrike.robot import read_mjcf
from heelstrike.sim import EventKind, RunStatus, Scheme
from heelstrike.sim.time_stepping.impact import allocate_impact, relax

SOLVERS = ("lemke", "fischer_burmeister", "gauss_seidel")

# Speeds (m/s, rad/s) at which bravo7, its soles on the ground, makes Gauss-Seidel try the same
# modes again and again. They are found by drawing; within 1e-3 of them it happens as well.
CIRCLING = [-1.0, -0.6, -1.3, -2.3, -10.0, -10.0, 5.9, -3.9, -3.2]

# A ball on the ground whose joint ends below where the ground begins.
PRESSED = """
<mujoco><worldbody><body name="ball" pos="0 0 0.1">
  <joint name="shaft" type="slide" axis="0 0 1" range="-1 LIMIT"/><geom size="0.1" mass="2"/>
</body></worldbody></mujoco>
"""


def test_what_one_solver_cannot_another_does_and_the_run_counts_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(certified_solve, "MODE_CORRECTIONS", 0)  # which need no solver here
    robot = hs.load_robot("bravo7")
    state = hs.State(robot.model.reference.copy(), np.array(CIRCLING))

    def run(solver: str) -> hs.Run:
        method = hs.TimeStepping(step=1e-3, solver=solver)
        ground = hs.Ground(friction=0.3)
        return hs.simulate(robot, state=state, duration=1e-3, method=method, ground=ground)

    alone, helped = run("lemke"), run("gauss_seidel")
    assert (alone.solver.fallbacks, alone.solver.failures) == (0, 0)
    assert (helped.solver.name, helped.solver.fallbacks, helped.solver.failures) == (
        "gauss_seidel",
        1,
        0,
    )
    for found in (alone, helped):
        assert found.completed
        assert found.residual.max() <= 1e-9
    assert helped.contact_force[0, :, 0].max() > 0.0
    np.testing.assert_allclose(helped.velocity[-1], alone.velocity[-1], atol=1e-9)


@pytest.mark.parametrize("solver", SOLVERS)
def test_without_a_solution_the_run_ends_and_says_so(solver: str) -> None:
    """The ground pushes up, the stop 5 cm further down; no impulse satisfies both."""
    start = hs.State(np.zeros(1), np.zeros(1))
    run = hs.simulate(
        read_mjcf(PRESSED.replace("LIMIT", "-0.05"), name="pressed"),
        state=start,
        duration=0.1,
        method=hs.TimeStepping(step=1e-3, solver=solver),
    )
    assert run.status is RunStatus.SOLVER_FAILED
    assert "no contact solver could certify a solution at t = 0 s" in run.message
    assert (run.solver.solves, run.solver.fallbacks, run.solver.failures) == (1, 3, 1)
    # What there was is kept; the step that could not be is not in it.
    assert run.steps == 0
    np.testing.assert_array_equal(run.position, [start.q])
    # The residuals say how far off the best answer was, on its row and in the run's worst.
    worst = run.residual[0].max()
    assert worst > 1e-2
    assert f"{worst:g}" in run.message
    assert run.certificates.non_penetration == worst


@pytest.mark.parametrize("scheme", [Scheme.GAP_LINEARISED, Scheme.IMPACT_RESOLVED])
def test_wedge_without_a_way_out_is_left_where_it_is(scheme: Scheme) -> None:
    """The stop is 1e-10 m below the ground: out of the one the ball only gets into the other.

    Left there it stays there, and the ground carries its weight.
    """
    run = hs.simulate(
        read_mjcf(PRESSED.replace("LIMIT", "-1e-10"), name="wedge"),
        state=hs.State(np.zeros(1), np.zeros(1)),
        duration=0.01,
        method=hs.TimeStepping(step=1e-3, scheme=scheme),
    )
    assert run.completed, run.message
    # Its weight is borne to the last digit of 1 / m: a step moves it by 1e-21 m.
    np.testing.assert_allclose(run.position, np.zeros((11, 1)), atol=1e-19)
    np.testing.assert_allclose(run.contact_force[:, 0, 0], 2.0 * 9.81, rtol=1e-9)
    told = [(event.kind, event.time) for event in run.events]
    assert told == [(EventKind.WEDGED, 0.0)]
    # The strict problem is asked when the wedge is 0, 1, 2, 4 and 8 steps old.
    assert (run.solver.failures, run.solver.relaxed) == (5, 11)
    assert run.solver.solves == 5 + 11
    assert "11 steps with a wedged point or an impact left as it was" in str(run.solver)


def test_wedge_deeper_than_turning_explains_is_no_wedge() -> None:
    run = hs.simulate(
        read_mjcf(PRESSED.replace("LIMIT", "-2e-4"), name="deep"),
        state=hs.State(np.zeros(1), np.zeros(1)),
        duration=0.01,
        method=hs.TimeStepping(step=1e-3),
    )
    assert run.status is RunStatus.SOLVER_FAILED


def test_wedge_that_goes_on_may_be_deeper() -> None:
    """What lets nothing sink but by turning explains any depth in the step after."""
    robot = read_mjcf(PRESSED.replace("LIMIT", "-1e-10"), name="wedge")
    impact = allocate_impact(robot)
    left = uncompiled(relax)
    for wedged, bounds_gaps, leaves in ((5, True, False), (6, True, True), (6, False, False)):
        impact.wedged, impact.relaxed = wedged, 0
        assert left(bounds_gaps, -2e-4, False, 7, impact) == leaves
        assert impact.relaxed == leaves
    impact.wedged, impact.relaxed = 6, 1  # nothing more can be left out
    assert not left(True, -2e-4, False, 7, impact)


def test_wedge_that_friction_holds_does_not_bounce() -> None:
    """A point falls between two faces at 45° with friction 1.5: nothing takes it up again.

    Newton's law has it leave both faces, and the friction on each is more than its push.
    """
    build = hs.RobotBuilder("puck")
    rail = build.slide("x", None, direction=(1, 0), mass=0.0)
    build.contact(build.slide("z", rail, direction=(0, 1), mass=2.0), (0.0, 0.0))
    run = hs.simulate(
        build.build(),
        state=hs.State(np.array([0.0, 0.01]), np.zeros(2)),
        duration=0.1,
        method=hs.TimeStepping(step=1e-3, scheme=Scheme.MOREAU_JEAN),
        ground=hs.Ground(
            profile=[[-1.0, 1.0], [0.0, 0.0], [1.0, 1.0]], friction=1.5, restitution=0.5
        ),
        stop_when_fallen=False,
    )
    assert run.completed, run.message
    assert EventKind.WEDGED in [event.kind for event in run.events]
    np.testing.assert_allclose(run.velocity[-1], 0.0, atol=1e-12)
    # What it fell in the step in which it arrived.
    np.testing.assert_allclose(run.position[-1], 0.0, atol=0.5e-3)
