"""Scenes with loops, couplings, brakes and latches, and the laws that these have to keep."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest
from scenes.compliant_judge import judge_compliant
from scenes.event_judge import judge_events
from scenes.findings import Findings
from scenes.mechanics import Poses, Tree
from scenes.methods import Setting
from scenes.scene import random_scene
from scenes.step_judge import judge_steps
from scenes.ties.description import Brake, Ties
from scenes.ties.mechanics import Tied
from scenes.ties.scene import tied_scene

import heelstrike as hs
from heelstrike import dynamics


def test_scenes_draw_what_they_drew_and_have_ties() -> None:
    """Loops are closed and nothing tears at them; the library says so of the same rows."""
    drawn: set[str] = set()
    for seed in range(25):
        scene = tied_scene(seed)
        assert repr(scene) == repr(tied_scene(seed))
        # But for what fits the ties it is the scene of the seed.
        free = random_scene(seed)
        assert repr(dataclasses.replace(scene, ties=Ties(), v=free.v)) == repr(free)
        drawn |= {each.name for each in dataclasses.fields(Ties) if getattr(scene.ties, each.name)}
        assert drawn
        robot = scene.robot()
        state = scene.state(robot)
        moving = state.v + 1.0
        own = Tied(
            robot.model, Poses(Tree(robot.model), state.q[None]), state.q[None], moving[None]
        )
        assert np.abs(own.displacement).max(initial=0.0) < 1e-12
        np.testing.assert_allclose(own.jacobian[0] @ state.v, 0.0, atol=1e-9)
        np.testing.assert_allclose(
            own.jacobian[0], dynamics.loop_jacobian(robot, state.q), atol=1e-12
        )
        bias = dynamics.loop_bias_acceleration(robot, state.q, moving)
        np.testing.assert_allclose(own.bias[0], bias, rtol=1e-9, atol=1e-9)
    assert drawn == {"loops", "couplings", "brakes", "latches"}


def test_brakes_are_switched_when_they_should_be() -> None:
    scene = dataclasses.replace(
        tied_scene(1), ties=Ties(brakes=(Brake(7, np.inf, 0.002, 0.005),)), shoves=()
    )
    run = Setting.of(scene).run("impact_resolved", duration=0.01)
    assert np.flatnonzero(run.brake_torque[:, 0]).tolist() == [2, 3, 4]


def four_bar() -> hs.Robot:
    build = hs.RobotBuilder("four_bar")
    crank = build.hinge("crank", None, mass=1.0, inertia=0.02, center_of_mass=(0, 0.1))
    coupler = build.hinge(
        "coupler", crank, at=(0, 0.2), mass=1.5, inertia=0.08, center_of_mass=(0.3, 0.15)
    )
    rocker = build.hinge(
        "rocker", None, at=(0.5, 0), mass=1.2, inertia=0.05, center_of_mass=(0, 0.2)
    )
    build.loop(coupler, rocker, at=(0.5, 0.3))
    build.contact(rocker, (0.0, 0.1))
    build.brake("crank")
    return build.build()


METHODS = {
    "time stepping": (hs.TimeStepping(step=1e-3), judge_steps),
    "the paper's": (hs.TimeStepping(step=1e-3, scheme=hs.Scheme.PAPER_EXPLICIT), judge_steps),
    "event-driven": (hs.EventDriven(output_period=1e-3), judge_events),
    "compliant": (hs.Compliant(), judge_compliant),
}


@pytest.mark.parametrize(("method", "judge"), METHODS.values(), ids=METHODS)
def test_linkages_are_judged_by_what_their_loops_do(method: Any, judge: Any) -> None:
    """Right motion is left in peace; forces that are not there, and loops that gape, are not."""
    robot = four_bar()
    state = robot.closed(robot.state({"crank": 0.3}, {"crank": 4.0}), keep=["crank"])
    simulation = hs.Simulation(
        robot, state=state, method=method, ground=hs.Ground(profile=[[-9, -5], [9, -5]])
    )
    simulation.advance(0.03)
    simulation.braked = ["crank"]
    simulation.advance(0.06)
    run = simulation.record

    def found(**changed: Any) -> Findings:
        out: Findings = judge(dataclasses.replace(run, **changed))
        return out

    assert np.abs(run.loop_force).max() > 5.0
    assert not found().objections
    off = run.position.copy()
    off[20:, 1] += 1e-6
    assert "ties: open" in found(position=off).broken()
    # What judges samples as a whole is coarse.
    strength = 40.0 if isinstance(method, hs.Compliant) else 1.01
    assert "balance" in found(loop_force=strength * run.loop_force).broken()
    assert "balance" in found(brake_torque=10.0 * strength * run.brake_torque).broken()


def test_a_latch_explains_no_force_of_a_stop_that_is_not_touched() -> None:
    """Not even next to the end at which it would hold; what it does hold there is left in peace."""
    build = hs.RobotBuilder("gate")
    build.hinge("hinge", None, mass=1.0, inertia=0.02, center_of_mass=(0, -0.5), limits=(-1.0, 0.3))
    build.latch("hinge", "upper")
    robot = build.build()
    run = hs.simulate(
        robot, state=robot.state({"hinge": 0.2999}, {"hinge": 1.0}), duration=0.01,
        method=hs.EventDriven(), stop_when_fallen=False,
    )  # fmt: skip
    assert np.all(run.stop_torque[-3:] > 0.0)  # it would fall back, but for the latch
    assert not judge_events(run).objections
    for torque in (-1.0, 1.0):
        pushed = run.stop_torque.copy()
        pushed[0] = torque
        broken = judge_events(dataclasses.replace(run, stop_torque=pushed)).broken()
        assert any("stop: force without touch" in law for law in broken)
