"""The judge of compliant ground on motions in closed form, and on the same with one flaw."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scenes.compliant_judge import judge_compliant
from scenes.findings import Findings
from synthetic_runs import make_run

import heelstrike as hs

G, MASS = 9.81, 2.0
LAWS = (hs.HuntCrossley(stiffness=1e6, dissipation=0.2), hs.KelvinVoigt(stiffness=1e5, damping=1e2))


def broken(found: Findings) -> set[str]:
    return set(found.broken())


def block() -> hs.Robot:
    builder = hs.RobotBuilder("block", gravity=G)
    body = builder.floating_base("body", (0, 0), mass=MASS, inertia=0.01)
    builder.contact(body, (-0.1, 0.0))
    builder.contact(body, (0.1, 0.0))
    return builder.build()


def resting(law: hs.HuntCrossley | hs.KelvinVoigt) -> hs.Run:
    sink = law.sink(0.5 * MASS * G)
    return make_run(
        block(),
        np.arange(50) * 1e-3,
        position=[[0.0, -sink, 0.0]],
        force=[[0.5 * MASS * G, 0.0]],
        method=hs.Compliant(law=law),
    )


def sliding(friction: float, ground: float = 0.4) -> hs.Run:
    """It slides at its sink and slows down; forces are means over the samples."""
    law = LAWS[1]
    time = np.arange(50) * 1e-3
    force = 0.5 * MASS * G
    still = np.zeros(50)
    x, v = 0.5 * time - 0.5 * friction * G * time**2, 0.5 - friction * G * time
    sink = np.full(50, -law.sink(force))
    return make_run(
        block(),
        time,
        position=np.stack((x, sink, still), axis=1),
        velocity=np.stack((v, still, still), axis=1),
        force=[[force, -friction * force]],
        ground=hs.Ground(friction=ground),
        method=hs.Compliant(law=law),
    )


@pytest.mark.parametrize("law", LAWS, ids=["hunt-crossley", "kelvin-voigt"])
def test_right_rest_is_left_in_peace(law: hs.HuntCrossley | hs.KelvinVoigt) -> None:
    found = judge_compliant(resting(law))
    assert not found.objections
    assert found.worst["law of the ground"] < 1e-12


def test_right_slide_is_left_in_peace() -> None:
    assert not judge_compliant(sliding(0.4)).objections


def test_wrong_law_of_the_ground() -> None:
    run = resting(LAWS[0])
    other = dataclasses.replace(run, method=hs.Compliant(law=LAWS[1]))
    assert broken(judge_compliant(other)) == {"law of the ground"}


def test_forces_that_do_not_carry_it() -> None:
    run = sliding(0.4)
    for factor in ([0.0, 1.0], [2.0, 1.0], [1.0, -30.0]):
        wrong = dataclasses.replace(run, contact_force=run.contact_force * factor)
        assert "linear momentum" in broken(judge_compliant(wrong))


def test_friction_beyond_the_cone() -> None:
    assert "friction cone" in broken(judge_compliant(sliding(0.4, ground=0.3)))


def test_force_in_the_air() -> None:
    run = resting(LAWS[1])
    up = np.array([0.0, 0.01])
    run = dataclasses.replace(
        run,
        position=run.position + np.array([0.0, 0.01, 0.0]),
        contact_point=run.contact_point + up,
        gap=run.gap + 0.01,
    )
    assert "contact: force without touch" in broken(judge_compliant(run))


def test_teleport_and_energy() -> None:
    run = resting(LAWS[1])
    shift = np.zeros_like(run.position)
    shift[20:, 0] = 1e-3
    jumped = dataclasses.replace(
        run, position=run.position + shift, contact_point=run.contact_point + shift[:, None, :2]
    )
    assert broken(judge_compliant(jumped)) == {"teleport"}
    push = np.zeros_like(run.velocity)
    push[20:, 0] = 0.05
    moved = np.cumsum(push * 1e-3, axis=0)
    faster = dataclasses.replace(
        run,
        velocity=run.velocity + push,
        position=run.position + moved,
        contact_point=run.contact_point + moved[:, None, :2],
    )
    assert {"linear momentum", "energy made"} <= broken(judge_compliant(faster))
