"""What work explains of the energy of motions in closed form, and of the same with a flaw."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scenes.checks.energy import EXPLAINED, Balance, balance, energy_of_scene
from scenes.checks.work import work_of
from synthetic_runs import make_run

import heelstrike as hs
from heelstrike.sim import Event, EventKind

G, MASS, SPEED, MU, E = 9.81, 2.0, 0.2, 0.3, 0.6
HEIGHT = 0.05


def ball(damping: float = 0.0) -> hs.Robot:
    builder = hs.RobotBuilder("ball", gravity=G)
    rail = builder.slide("x", None, direction=(1, 0), mass=0.0, damping=damping)
    body = builder.slide("z", rail, direction=(0, 1), mass=MASS)
    builder.contact(body, (0.0, 0.0))
    return builder.build()


def sliding(friction: float = MU) -> hs.Run:
    """It slides until it stays, and one row stands at that event: with the force behind it."""
    stays = SPEED / (MU * G)
    time = np.sort(np.concatenate((np.arange(0.0, 0.1201, 1e-3), [stays])))
    held = np.minimum(time, stays)
    zero = np.zeros(len(time))
    tangent = np.where(time < stays, -friction * MASS * G, 0.0)
    return make_run(
        ball(),
        time,
        position=np.stack((SPEED * held - 0.5 * MU * G * held**2, zero), axis=1),
        velocity=np.stack((SPEED - MU * G * held, zero), axis=1),
        force=np.stack((np.full(len(time), MASS * G), tangent), axis=1)[:, None],
        events=(Event(stays, EventKind.STICK, 0, (0.0, 0.0)),),
        ground=hs.Ground(friction=MU),
        method=hs.EventDriven(),
    )


def bouncing(told: float = 1.0, *, names: bool = False, bounce: float = E) -> hs.Run:
    """It falls and leaves with a part of its speed; the event tells so much of the impulse."""
    land = float(np.sqrt(2.0 * HEIGHT / G))
    down = G * land
    time = np.sort(np.concatenate((np.arange(0.0, 0.1501, 1e-3), [land, land])))
    after = np.zeros(len(time), dtype=bool)
    after[np.flatnonzero(time == land)[1] :] = True
    late = time - land
    z = np.where(after, bounce * down * late - 0.5 * G * late**2, HEIGHT - 0.5 * G * time**2)
    v = np.where(after, bounce * down - G * late, -G * time)
    zero = np.zeros(len(time))
    impulse = (told * MASS * (1.0 + bounce) * down, 0.0)
    events = [Event(land, EventKind.TOUCHDOWN, 0, impulse)]
    if names:
        events.append(Event(land, EventKind.ENERGY_GAIN, 0, impulse))
    return make_run(
        ball(),
        time,
        position=np.stack((zero, z), axis=1),
        velocity=np.stack((zero, v), axis=1),
        events=events,
        ground=hs.Ground(friction=0.0, restitution=E),
        method=hs.EventDriven(),
    )


def explained(run: hs.Run) -> Balance:
    return balance(work_of(run))


def test_work_of_friction_explains_what_sliding_loses() -> None:
    """Half m v² is lost to μ m g on the way, up to the event whose row shows no such force."""
    assert explained(sliding()).missing < 1e-12
    short = explained(sliding(0.999 * MU))
    assert short.missing == pytest.approx(1e-3, rel=1e-6)  # of the kinetic energy at the start


def test_work_of_impulses_explains_jumps() -> None:
    assert explained(bouncing()).missing < 1e-12
    assert explained(bouncing(1.001)).missing > 1e-4


def test_energy_that_impacts_make_is_named_or_not() -> None:
    lost = explained(bouncing())
    assert (lost.gained, lost.unsaid, lost.gains) == (0.0, 0.0, 0)
    made = 0.5 * MASS * 2.0 * G * HEIGHT * (1.1**2 - 1.0)
    unsaid = explained(bouncing(bounce=1.1))
    assert unsaid.unsaid == pytest.approx(made)
    named = explained(bouncing(bounce=1.1, names=True))
    assert (named.gained, named.unsaid, named.gains) == (pytest.approx(made), 0.0, 1)


def test_energy_that_nothing_explains_is_found_where_it_is() -> None:
    run = sliding()
    velocity = run.velocity.copy()
    velocity[30:] += [1e-3, 0.0]
    found = explained(dataclasses.replace(run, velocity=velocity))
    assert found.missing > EXPLAINED
    assert found.places()[0]["time"] == pytest.approx(run.time[30])


def test_work_of_pushes_ends_within_an_interval() -> None:
    """A push of 3 N for 10.4 ms on a ball that flies: its edges have no rows."""
    robot, until = ball(), 0.0104
    run = hs.simulate(
        robot, state=hs.State([0.0, 1.0], [0.5, 0.0]), duration=0.03, method=hs.EventDriven(),
        pushes=[hs.Push("z", force=(3.0, 0.0), start=0.0046, duration=until)],
    )  # fmt: skip
    assert run.velocity[-1, 0] == pytest.approx(0.5 + 3.0 * until / MASS)
    assert explained(run).missing < 1e-9


def test_a_scene_is_explained_and_a_jam_needs_a_closer_look() -> None:
    """Before 0.55074 s a force of 4022 grows a thousandfold in microseconds, until it sticks."""
    plain = energy_of_scene("energy", 2)
    assert plain["passes"]
    assert plain["looks"] == 0
    jam = energy_of_scene("energy", 4022)
    assert jam["passes"]
    assert jam["looks"] > 0
