"""Loops made for what a robot, a ground and a method do not have."""

from __future__ import annotations

import numpy as np
import pytest

import heelstrike as hs
from heelstrike.sim import simulation
from heelstrike.sim.frame import PLAIN, fixed_for
from heelstrike.sim.memory import allocate_memory
from heelstrike.sim.method import work_of
from heelstrike.sim.time_stepping import TimeStepping

PROFILE = hs.Ground(profile=[[-1.0, 0.0], [0.0, 0.0], [1.0, 0.0]])


def taken_for_granted(robot: hs.Robot, ground: hs.Ground, method: hs.TimeStepping) -> bool:
    work = work_of(method, robot)
    return bool(fixed_for(robot, ground.model(), work, method.usual_numbers))


def test_what_is_taken_for_granted_is_so() -> None:
    """In every bundle that a loop is handed, as the arrays of its members are."""
    robot, method = hs.load_robot("bravo7"), TimeStepping()
    fixed = dict(fixed_for(robot, hs.Ground().model(), work_of(method, robot), {}))
    assert fixed == dict(PLAIN)
    work = work_of(method, robot)
    for bundle in (robot.model, hs.Ground().model(), allocate_memory(robot), work):
        stack = [bundle]
        while stack:
            each = stack.pop()
            for name, member in each.declared.items():
                value = getattr(each, name)
                if member.role == "part":
                    stack.append(value)
                for size, (factor, extent, more) in zip(
                    np.shape(value), member.extents, strict=False
                ):
                    if extent in fixed:
                        assert size == factor * fixed[extent] + more, (name, extent)
                if member.role == "number" and name in fixed:
                    assert value == fixed[name], name


def test_what_is_rare_has_the_loop_that_knows_it() -> None:
    robot, method = hs.load_robot("bravo7"), TimeStepping()
    assert taken_for_granted(robot, hs.Ground(slope=0.1), method)
    assert not taken_for_granted(robot, PROFILE, method)
    assert not taken_for_granted(robot, hs.Ground(), TimeStepping(scheme=hs.Scheme.MOREAU_JEAN))
    rubbing = robot.model.replaced(dry_friction=np.full(robot.nv, 0.5))
    work = work_of(method, robot)
    assert fixed_for(rubbing, hs.Ground().model(), work, method.usual_numbers) == ()


@pytest.mark.slow
def test_both_loops_do_the_same_and_another_ground_brings_the_other(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    robot = hs.load_robot("bravo7")
    state = robot.placed(robot.reference_state(), hs.Ground())

    def falls() -> hs.Run:
        return hs.simulate(robot, None, state=state, duration=1.0, stop_when_fallen=False)

    plain = falls()
    begun = hs.Simulation(robot, state=state, stop_when_fallen=False)
    loop = begun._loop
    flat = begun.snapshot()
    begun.ground = PROFILE
    assert begun._loop is not loop
    begun.restore(flat)
    assert begun._loop is loop
    monkeypatch.setattr(simulation, "fixed_for", lambda *_: ())
    rare = falls()
    for name in ("position", "velocity", "contact_force", "stop_torque"):
        assert np.array_equal(getattr(plain, name), getattr(rare, name)), name
