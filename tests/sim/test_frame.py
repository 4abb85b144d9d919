"""Loops made for what a robot, a ground and a method do not have."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, ClassVar

import numpy as np
import pytest

import heelstrike as hs
from heelstrike.sim import simulation
from heelstrike.sim.frame import PLAIN, fixed_for
from heelstrike.sim.memory import allocate_memory
from heelstrike.sim.method import work_of
from heelstrike.sim.time_stepping import TimeStepping
from heelstrike.sim.time_stepping.method import SEVEN_LINKS

PROFILE = hs.Ground(profile=[[-1.0, 0.0], [0.0, 0.0], [1.0, 0.0]])


def taken_for_granted(robot: hs.Robot, ground: hs.Ground, method: hs.TimeStepping) -> bool:
    work = work_of(method, robot)
    return bool(fixed_for(robot, ground.model(), work, method))


def contradictions(bundles: list[Any], fixed: dict[str, int]) -> list[tuple[str, str]]:
    """Members that are not as a loop takes for granted, in bundles and their parts."""
    found, stack = [], list(bundles)
    while stack:
        each = stack.pop()
        for name, member in each.declared.items():
            value = getattr(each, name)
            if member.role == "part":
                stack.append(value)
            sizes = zip(np.shape(value), member.extents, strict=False)
            good = all(
                size == factor * fixed[extent] + more
                for size, (factor, extent, more) in sizes
                if extent in fixed
            )
            if member.role == "number" and name in fixed:
                good = value == fixed[name]
            if not good:
                found.append((type(each).__name__, name))
    return found


@pytest.mark.parametrize("name", ["bravo7", "walker2d", "rabbit"])
@pytest.mark.parametrize(
    "method", [TimeStepping(), hs.EventDriven(), hs.Compliant()], ids=lambda it: type(it).__name__
)
def test_what_is_taken_for_granted_is_so(method: hs.sim.Method, name: str) -> None:
    """In every bundle that a loop is handed, as the arrays of its members are."""
    robot, ground = hs.load_robot(name), hs.Ground().model()
    work = work_of(method, robot)
    fixed = dict(fixed_for(robot, ground, work, method))
    seven_links = method.usual_extents == SEVEN_LINKS and name != "rabbit"
    extents = SEVEN_LINKS if seven_links else {}
    assert fixed == {**dict(PLAIN), **method.usual_numbers, **extents}
    assert not contradictions([robot.model, ground, allocate_memory(robot), work], fixed)
    other = dict.fromkeys(fixed, 3)
    assert contradictions([robot.model, ground, allocate_memory(robot), work], other)


class Other(hs.Bundle):
    """Part of a method from outside: names of the package for things of its own."""

    components: int = hs.number(int)
    nc_values: Any = hs.array("nc")


class Outside(hs.Bundle):
    """A method from outside."""

    own: Other = hs.part(Other)


@pytest.mark.parametrize(("components", "nc"), [(2, 4), (3, 4), (2, 8)])
def test_a_method_from_outside_may_use_the_same_names(components: int, nc: int) -> None:
    work = Outside.allocate(own=Other.allocate(nc=nc, components=components))
    robot, ground = hs.load_robot("bravo7"), hs.Ground().model()
    fixed = dict(fixed_for(robot, ground, work, replaced_numbers()))
    assert ("components" in fixed) == (components == 2)
    assert ("nc" in fixed) == (components == 2 and nc == 4)


def replaced_numbers() -> TimeStepping:
    """Time stepping without numbers of its own, but with its extents."""

    class Extents(TimeStepping):
        usual_numbers: ClassVar[dict[str, int]] = {}

    return Extents()


def test_what_is_rare_has_the_loop_that_knows_it() -> None:
    robot, method = hs.load_robot("bravo7"), TimeStepping()
    assert taken_for_granted(robot, hs.Ground(slope=0.1), method)
    assert not taken_for_granted(robot, PROFILE, method)
    assert not taken_for_granted(robot, hs.Ground(), TimeStepping(scheme=hs.Scheme.MOREAU_JEAN))
    rubbing = replace(robot, model=robot.model.replaced(dry_friction=np.full(robot.nv, 0.5)))
    work = work_of(method, robot)
    assert fixed_for(rubbing, hs.Ground().model(), work, method) == ()


@pytest.mark.slow
def test_all_loops_do_the_same_and_another_ground_brings_the_other(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    robot = hs.load_robot("bravo7")
    state = robot.placed(robot.reference_state(), hs.Ground())

    def falls() -> hs.Run:
        return hs.simulate(robot, None, state=state, duration=1.0, stop_when_fallen=False)

    usual = falls()
    begun = hs.Simulation(robot, state=state, stop_when_fallen=False)
    begun._new_record()
    bundles = [begun._control, begun._memory, begun._work, begun._records[-1]]
    assert not contradictions(bundles, dict(PLAIN) | SEVEN_LINKS)
    loop = begun._loop
    flat = begun.snapshot()
    begun.ground = PROFILE
    assert begun._loop is not loop
    begun.restore(flat)
    assert begun._loop is loop
    scheme = tuple(TimeStepping.usual_numbers.items())
    for fixed in (PLAIN + scheme, ()):
        monkeypatch.setattr(simulation, "fixed_for", lambda *_, fixed=fixed: fixed)
        other = falls()
        for name in ("position", "velocity", "contact_force", "stop_torque"):
            assert np.array_equal(getattr(usual, name), getattr(other, name)), name
