"""Time stepping resolves an impact of several contacts within the step it falls into."""

from __future__ import annotations

import numpy as np
import pytest
from impact_order import one_impact, simplified
from scenes.methods import Setting
from scenes.scene import random_scene
from scenes.step_judge import judge_steps

import heelstrike as hs
from heelstrike.sim import Scheme

LENGTH, SPIN, GRAVITY = 1.2, 0.8, 9.81


def rod() -> hs.Robot:
    """Return a uniform rod with a contact at either end."""
    builder = hs.RobotBuilder("rod", gravity=GRAVITY)
    builder.floating_base("rod", (0.0, 0.0), mass=3.0, inertia=3.0 * LENGTH**2 / 12.0)
    builder.contact("rod", (-LENGTH / 2.0, 0.0))
    builder.contact("rod", (LENGTH / 2.0, 0.0))
    return builder.build()


@pytest.mark.parametrize("restitution", [0.0, 0.4])
@pytest.mark.parametrize("phase", [0.02, 0.37, 0.5, 0.98])
def test_a_rod_lands_on_its_other_end(phase: float, restitution: float) -> None:
    """One end lies on the ground without friction, the other comes down at the speed s = ω l.

    With m the mass, the rod's Delassus matrix is (1/m) ((4, −2), (−2, 4)). Newton's law asks that
    the end that lies stay and the other leave with e s: λ = (1 + e) m s (1/6, 1/3), both positive.
    So does the step's velocity, whatever the phase of the step in which it lands, to the speed that
    gravity gives in a step.
    """
    step = 1e-5
    tilt = SPIN * step * (3.0 + phase)
    # A positive pitch leans forward: the front end is down and lies, the rear end is up.
    height = LENGTH / 2.0 * np.sin(tilt)
    fall = -SPIN * LENGTH / 2.0 * np.cos(tilt)
    run = hs.simulate(
        rod(),
        state=hs.State([0.0, height, tilt], [0.0, fall, -SPIN]),
        duration=8 * step,
        method=hs.TimeStepping(step=step),
        ground=hs.Ground(friction=0.0, restitution=restitution),
    )
    landed = np.flatnonzero(run.contact_force[:, 0, 0] * step > 1e-2)
    assert landed.tolist() == [3]
    speed = SPIN * LENGTH
    impulse = run.contact_force[3, :, 0] * step
    expected = (1.0 + restitution) * 3.0 * speed * np.array([1.0 / 3.0, 1.0 / 6.0])
    slack = 3.0 * (GRAVITY * 8 * step + SPIN**2 * LENGTH * 8 * step)
    np.testing.assert_allclose(impulse, expected, atol=slack)
    ends = run.velocity[4, 1] + LENGTH / 2.0 * run.velocity[4, 2] * np.array([1.0, -1.0])
    np.testing.assert_allclose(ends, [restitution * speed, 0.0], atol=slack)


@pytest.mark.parametrize("left", [5e-8, 9e-10, 5e-10, 0.0, -5e-10])
def test_a_ball_that_all_but_arrives_in_a_step_bounces(left: float) -> None:
    """However near to the ground (m) the end of a step is. Newton: up with e times its speed."""
    step, speed, restitution = 1e-3, 1.0, 0.5
    builder = hs.RobotBuilder("ball", gravity=0.0)
    builder.floating_base("ball", (0.0, 0.0), mass=1.0, inertia=0.1)
    builder.contact("ball", (0.0, 0.0))
    run = hs.simulate(
        builder.build(),
        state=hs.State([0.0, 5.0 * step * speed + left, 0.0], [0.0, -speed, 0.0]),
        duration=10 * step,
        method=hs.TimeStepping(step=step),
        ground=hs.Ground(friction=0.0, restitution=restitution),
    )
    assert run.velocity[-1, 1] == pytest.approx(restitution * speed, rel=1e-12)


@pytest.mark.parametrize("seed", [65, 139, 301])
def test_first_order_where_impacts_strike_several_contacts(seed: int) -> None:
    """The worst error of 8 phases of the step falls with it; that of split impacts does not.

    Seeds are those of scenes in which the gap-linearised scheme has no limit. Over one decade the
    order is uneven, since the phases are few.
    """
    impact = one_impact(simplified(random_scene(seed)))
    assert impact is not None
    coarse, fine = (impact.error(Scheme.IMPACT_RESOLVED, step) for step in (1e-4, 1e-6))
    assert np.log10(coarse / fine) >= 0.9 * 2
    assert impact.error(Scheme.GAP_LINEARISED, 1e-6) > 100.0 * fine


@pytest.mark.parametrize("seed", [126, 254])
def test_no_impact_throws_a_joint_through_its_stop(seed: int) -> None:
    """In these scenes a stop that is far away at the start of a step is met at its end."""
    setting = Setting.of(random_scene(seed))
    run = setting.run("impact_resolved")
    model = run.robot.model
    assert np.min(run.position - model.lower) >= -1e-9
    assert np.min(model.upper - run.position) >= -1e-9


@pytest.mark.parametrize("seed", [3, 11, 40, 43, 51])
def test_no_contact_solve_makes_kinetic_energy(seed: int) -> None:
    """Nor does any of its steps break another law, as far as a judge apart from it can see."""
    scene = random_scene(seed)
    setting = Setting.of(scene)
    run = setting.run("impact_resolved")
    found = judge_steps(run, scene.controller(setting.robot))
    assert {one.law for one in found.objections} <= {"sunk at a corner"}
