"""What time stepping says of its steps: springs too stiff, links too light, feet in the ground."""

from __future__ import annotations

import dataclasses
import warnings

import numpy as np
import pytest

import heelstrike as hs
from heelstrike.sim.time_stepping.doubts import stiffest
from heelstrike.view.page.verdict import judge


def sprung(stiffness: float = 0.0, damping: float = 0.0) -> hs.Robot:
    """A foot that hangs between stops on a stiff hinge, with 1/5 of the trunk's inertia."""
    build = hs.RobotBuilder("sprung")
    x = build.slide("x", None, direction=(1, 0), mass=0.0)
    z = build.slide("z", x, direction=(0, 1), mass=0.0)
    trunk = build.hinge("pitch", z, mass=5.0, inertia=0.1)
    foot = build.hinge(
        "ankle", trunk, at=(0, -0.1), mass=0.2, inertia=0.002, center_of_mass=(0, -0.2),
        limits=(-0.5, 0.5), stiffness=stiffness, damping=damping,
    )  # fmt: skip
    build.contact(foot, (0, -0.4))
    return build.build()


def falls(robot: hs.Robot, duration: float = 0.5, **options: object) -> hs.Run:
    state = hs.State([0.0, 0.7, 0.0, 0.2], [0.5, 0.0, 0.0, 0.0])
    return hs.simulate(
        robot, state=state, duration=duration, method=hs.TimeStepping(**options),
        ground=hs.Ground(friction=0.7), stop_when_fallen=False,
    )  # fmt: skip


def energy_gain(run: hs.Run, stiffness: float) -> float:
    """Largest energy of the ankle's spring, over that at the beginning."""
    stored = 0.5 * stiffness * run.position[:, 3] ** 2
    return float(stored.max() / stored[0])


def test_springs_too_stiff_for_a_step_are_told_of_and_what_to_do_helps() -> None:
    with pytest.warns(hs.SimulationWarning, match="'ankle' is too stiff for a step of 0.001 s"):
        run = falls(sprung(5e4))
    assert "gains energy" in run.doubt
    assert not judge(run).good
    assert "LINEARLY_IMPLICIT" in judge(run).advice[0]
    assert energy_gain(run, 5e4) > 2.0
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        implicit = falls(sprung(5e4), scheme=hs.Scheme.LINEARLY_IMPLICIT)
        shorter = falls(sprung(5e4), step=float(run.doubt.split("at most ")[1].split()[0]))
    for mended in (implicit, shorter):
        assert mended.completed
        assert not mended.doubt
        assert energy_gain(mended, 5e4) <= 1.5


def test_a_batch_tells_of_them_once_a_run_at_the_line_that_asks_for_it() -> None:
    state = hs.State([0.0, 0.7, 0.0, 0.2], [0.5, 0.0, 0.0, 0.0])
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        hs.simulate_batch(sprung(5e4), state=[state] * 3, duration=0.01, stop_when_fallen=False)
    assert [warning.filename for warning in told] == [__file__] * 3


def test_a_simulation_tells_of_them_once() -> None:
    """However often a state is set, or other ground laid."""
    state = hs.State([0.0, 0.7, 0.0, 0.2], [0.5, 0.0, 0.0, 0.0])
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        simulation = hs.Simulation(sprung(5e4), state=state, stop_when_fallen=False)
        simulation.state = state
        simulation.ground = hs.Ground(friction=0.3)
    assert len(told) == 1


def test_a_joint_beyond_its_stop_is_told_of() -> None:
    """At 60 rad/s a scheme that sees a stop once it is passed is 0.06 rad beyond it after 1 ms."""

    def swung(scheme: hs.Scheme) -> hs.Run:
        build = hs.RobotBuilder("wheel", gravity=0.0)
        build.hinge("axle", None, mass=1.0, inertia=0.1, limits=(-0.5, 0.5))
        return hs.simulate(
            build.build(), state=hs.State([0.47], [60.0]), duration=0.01,
            method=hs.TimeStepping(scheme=scheme),
        )  # fmt: skip

    assert not swung(hs.Scheme.IMPACT_RESOLVED).doubt
    run = swung(hs.Scheme.MOREAU_JEAN)
    past = float(run.position.max()) - 0.5
    assert past > 0.02
    assert f"a joint {past:.2g} rad or m beyond its stop" in run.doubt
    assert not judge(run).good


@pytest.mark.parametrize("share", [0.0, 0.7, 1.0])
def test_where_a_spring_or_damper_becomes_too_stiff(share: float) -> None:
    """A wheel I on a spring k and a damper c swings up where h² k / 4 I + h c / 2 I > 1.

    Below it swings by no more than 1 / √(1 − 0.98) = 7 times what it began with.
    """

    def told_and_largest(times: float) -> tuple[bool, float]:
        build = hs.RobotBuilder("wheel", gravity=0.0)
        build.hinge(
            "axle", None, mass=1.0, inertia=0.5, stiffness=times * share * 4.0 * 0.5e6,
            damping=times * (1.0 - share) * 2.0 * 0.5e3,
        )  # fmt: skip
        with warnings.catch_warnings(record=True) as told:
            warnings.simplefilter("always")
            run = hs.simulate(
                build.build(), state=hs.State([1e-6], [1e-6]), duration=0.4,
                method=hs.TimeStepping(), stop_when_fallen=False,
            )  # fmt: skip
        return bool(told), float(np.abs(run.position).max() * 1e6)

    told, largest = told_and_largest(0.98)
    assert not told
    assert largest <= 10.0
    told, largest = told_and_largest(1.02)
    assert told
    assert largest >= 1e3


@pytest.mark.parametrize(("share", "doubtful"), [(0.32, False), (0.35, True)])
def test_how_wrong_the_energy_of_a_spring_may_be(share: float, doubtful: bool) -> None:
    """With s = h ω / 2 the energy of a swing goes to and fro between E and (1 + s) / (1 − s) E."""
    inertia, stiffness = 0.5, 0.5 * (2.0 * share / 1e-3) ** 2
    build = hs.RobotBuilder("wheel", gravity=0.0)
    build.hinge("axle", None, mass=1.0, inertia=inertia, stiffness=stiffness)
    run = hs.simulate(
        build.build(), state=hs.State([1e-3], [0.0]), duration=0.4, method=hs.TimeStepping(),
        stop_when_fallen=False,
    )  # fmt: skip
    energy = 0.5 * inertia * run.velocity[:, 0] ** 2 + 0.5 * stiffness * run.position[:, 0] ** 2
    told = (1.0 + share) / (1.0 - share)
    assert energy.max() / energy.min() == pytest.approx(told, rel=1e-2)
    assert (f"tells up to {told:.2g} times its energy" in run.doubt) == doubtful


def test_no_robot_of_the_library_is_in_doubt() -> None:
    for name in hs.builtin_robots():
        robot = hs.load_robot(name)
        assert not hs.TimeStepping().doubts(robot, robot.reference_state().q)


def test_a_step_that_ends_deep_in_the_ground_is_no_good_run() -> None:
    """Moreau and Jean foresee half a step: at 1.3 m/s and 40 ms the foot gets 2 cm into it.

    A robot that begins there is no such run.
    """
    run = falls(sprung(), step=4e-2, scheme=hs.Scheme.MOREAU_JEAN)
    assert run.completed
    assert run.certificates.penetration > 1e-2
    assert "m in the ground" in run.doubt
    assert run.doubt in " ".join(str(run.summary()).split())
    assert not judge(run).good
    sunk = dataclasses.replace(run, gap=np.full_like(run.gap, -run.certificates.penetration))
    assert "m in the ground" not in sunk.doubt


def test_a_link_with_next_to_no_inertia_fails_in_words_and_what_to_do_helps() -> None:
    """The impulse that stops the rod is 2e9 times smaller in G than what turns it."""

    def rod(inertia: float) -> hs.Robot:
        build = hs.RobotBuilder("rod")
        x = build.slide("x", None, direction=(1, 0), mass=0.0)
        z = build.slide("z", x, direction=(0, 1), mass=0.0)
        body = build.hinge("pitch", z, mass=1.0, inertia=inertia)
        build.contact(body, (-1.5, 0.0))
        build.contact(body, (1.5, 0.0))
        return build.build()

    def drops(inertia: float, method: hs.TimeStepping | hs.EventDriven) -> hs.Run:
        return hs.simulate(
            rod(inertia), state=hs.State([0.0, 0.8, 0.3], [0.2, 0.0, 0.0]), duration=0.6,
            method=method, ground=hs.Ground(friction=0.5), stop_when_fallen=False,
        )  # fmt: skip

    run = drops(1e-9, hs.TimeStepping())
    assert run.status is hs.RunStatus.SOLVER_FAILED
    assert "Link 'pitch' has so little inertia (1e-09 kg m²)" in run.message
    assert "2e+09 times easier to move than the robot" in run.message
    enough = float(run.message.split("inertia of ")[1].split()[0])
    assert drops(enough, hs.TimeStepping()).completed
    # A drop from 0.8 m less what the rod hangs down: it lies flat at the end.
    other = drops(1e-9, hs.EventDriven())
    assert other.completed
    assert np.abs(other.final_state.q[1:]).max() <= 1e-9


def test_what_has_no_spring_names_no_joint() -> None:
    """Whose spring is stiff is told with how stiff it is for the step."""
    robot = sprung()
    assert stiffest(robot, robot.reference_state().q, 1e-3) == (0.0, "")
    value, joint = stiffest(sprung(4e3), robot.reference_state().q, 1e-3)
    assert joint == "ankle"
    assert value > 0.0
