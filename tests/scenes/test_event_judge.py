"""The judge of event-driven runs on motions in closed form, and on the same with one flaw.

A ball of 2 kg falls from 0.05 m, bounces with restitution e on a frictionless or rough ground and
flies on; a puck slides on rough ground until it stays; a slider runs into a stop. Rows are a
millisecond apart, and two stand at each impact.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scenes.event_judge import CLOSED, IN_CORNER, EventRows, judge_events
from scenes.findings import Findings
from scenes.record import Rows
from scenes.running import BETWEEN_ROWS
from scenes.table import _kind
from synthetic_runs import make_run

import heelstrike as hs
from heelstrike.sim import Event, EventKind

G, MASS, HEIGHT, E, MU = 9.81, 2.0, 0.05, 0.6, 0.3
LAND = float(np.sqrt(2.0 * HEIGHT / G))


def ball() -> hs.Robot:
    builder = hs.RobotBuilder("ball", gravity=G)
    rail = builder.slide("x", None, direction=(1, 0), mass=0.0)
    body = builder.slide("z", rail, direction=(0, 1), mass=MASS)
    builder.contact(body, (0.0, 0.0))
    return builder.build()


def broken(found: Findings) -> set[str]:
    return set(found.broken())


def bouncing(
    bounce: float = E, *, ground: float = E, speed: float = 0.8, friction: float = 0.0,
    impulse: float = 1.0, turn: float = 1.0, missing: bool = False,
) -> hs.Run:  # fmt: skip
    """The ball leaves with `bounce` times the speed it came with, from ground with another e.

    Friction takes μ times the normal impulse of its speed along the ground, `turn` times that.
    """
    down = G * LAND
    kick = MASS * (1.0 + bounce) * down
    rub = -turn * friction * kick
    grid = np.arange(0.0, 0.1801, 1e-3)
    time = np.sort(np.concatenate((grid, [LAND, LAND])))
    after = np.zeros(len(time), dtype=bool)
    after[np.flatnonzero(time == LAND)[1] :] = True
    since = time - LAND
    late = speed + rub / MASS
    x = np.where(after, speed * LAND + late * since, speed * time)
    z = np.where(after, bounce * down * since - 0.5 * G * since**2, HEIGHT - 0.5 * G * time**2)
    vx = np.where(after, late, speed)
    vz = np.where(after, bounce * down - G * since, -G * time)
    event = Event(LAND, EventKind.TOUCHDOWN, 0, (impulse * kick, impulse * rub))
    return make_run(
        ball(),
        time,
        position=np.stack((x, z), axis=1),
        velocity=np.stack((vx, vz), axis=1),
        events=() if missing else (event,),
        ground=hs.Ground(friction=max(friction, 0.0), restitution=ground),
        method=hs.EventDriven(),
    )


def test_right_bounce_is_left_in_peace() -> None:
    for run in (bouncing(), bouncing(friction=MU), bouncing(1.0, ground=1.0)):
        found = judge_events(run)
        assert not found.objections
        assert found.figures["impacts"] == 1
        assert found.figures["intervals left out"] == 0


def test_impulse_that_is_missing_or_wrong() -> None:
    assert "balance of an impact" in broken(judge_events(bouncing(missing=True)))
    assert "balance of an impact" in broken(judge_events(bouncing(impulse=1.00001)))


def test_other_restitution_than_the_ground_has() -> None:
    assert "impact: speed into it" in broken(judge_events(bouncing(0.5)))
    found = broken(judge_events(bouncing(0.7)))
    assert found == {"impact: other speed than restitution gives"}


def test_impact_that_makes_energy() -> None:
    assert "impact makes energy" in broken(judge_events(bouncing(1.05, ground=1.0)))
    run = bouncing(1.05, ground=1.0)
    named = dataclasses.replace(
        run, events=(*run.events, Event(LAND, EventKind.ENERGY_GAIN, 0, run.events[0].impulse))
    )
    found = judge_events(named)
    assert "impact makes energy" not in broken(found)  # it says so: Newton's own
    assert found.figures["energy gains named"] == 1


def test_jam_that_makes_energy() -> None:
    """Of what leads to a jump without a collision no more is asked."""
    for bounce, made in ((0.9, False), (1.05, True)):
        run = bouncing(bounce, ground=bounce if bounce <= 1.0 else 1.0)
        (event,) = run.events
        jam = dataclasses.replace(event, kind=EventKind.PAINLEVE)
        found = judge_events(dataclasses.replace(run, events=(jam,)))
        assert found.figures["jams"] == 1
        assert ("jam makes energy" in broken(found)) is made


def test_an_event_almost_at_a_jam_ends_its_interval_as_the_jam_does() -> None:
    """Of 1 ms all but 1e-9 s: forces of 1/t have grown a million times. A fifth left is no pole."""
    rows = EventRows(Rows(bouncing(), corners=IN_CORNER, instants=True), None)
    rows.instant = np.array([0.0, 1e-3, 2e-3 - 2e-9, 2e-3 - 1e-9, 2e-3, 3e-3])
    assert rows.close_to({4}) == {2, 3}  # the last interval is as short as what is left
    rows.instant = np.array([0.0, 1e-3, 2e-3 - 1e-9, 2e-3, 3e-3])
    assert rows.close_to({3}) == {2}
    rows.instant = np.array([0.0, 1e-3, 1.8e-3, 2e-3, 3e-3])
    assert rows.close_to({3}) == set()


def test_friction_of_an_impact() -> None:
    assert "impact: friction opposes" in broken(judge_events(bouncing(friction=MU, turn=0.5)))
    assert "impact: friction opposes" in broken(judge_events(bouncing(friction=MU, turn=-1.0)))
    assert "impact: cone" in broken(judge_events(bouncing(friction=MU, turn=1.1)))


def test_impact_in_the_air() -> None:
    run = bouncing()
    raised = run.position + np.array([0.0, 0.01])
    run = dataclasses.replace(
        run,
        position=raised,
        contact_point=run.contact_point + np.array([0.0, 0.01]),
        gap=run.gap + 0.01,
    )
    assert "impact: without touch" in broken(judge_events(run))


@pytest.mark.parametrize(
    ("row", "law"),
    [(20, "teleport between rows"), (102, "teleport"), (150, "teleport between rows")],
)
def test_teleport(row: int, law: str) -> None:
    """Also at the impact itself, whose two rows are one place."""
    run = bouncing()
    shift = np.zeros_like(run.position)
    shift[row:, 0] = 1e-5
    run = dataclasses.replace(
        run, position=run.position + shift, contact_point=run.contact_point + shift[:, None]
    )
    assert broken(judge_events(run)) == {law}


def test_only_what_is_between_rows_is_looked_at_with_more_of_them() -> None:
    """A toe that spins up and down within a millisecond moves as only its own steps tell."""
    assert {"balance", "energy", "teleport between rows"} == BETWEEN_ROWS
    kinds = [_kind(law) for law in ("teleport", "teleport between rows")]
    assert kinds == ["teleport", "teleport"]


def deepest(begin: float, end: float, time: float) -> float:
    """Depth under an acceleration that changes evenly, by double integration."""
    t = np.linspace(0.0, time, 20001)
    depth = 0.5 * begin * t**2 + (end - begin) * t**3 / (6.0 * time)
    return float(depth.max())


@pytest.mark.parametrize("end", [2.0, 1.0, 0.3, -0.5, -4.0, -50.0])
@pytest.mark.parametrize("share", [0.99, 1.01])
def test_how_far_an_acceleration_leads_until_the_next_row(end: float, share: float) -> None:
    """Of two rows, at which a point at rest accelerates into the ground by 1 and `end` m/s²."""
    time = float(np.sqrt(share * CLOSED / deepest(1.0, end, 1.0)))
    rows = EventRows.__new__(EventRows)
    rows.ahead, rows.next = np.array([time, 1.0]), np.array([1, 1])
    rows.goes_on = np.array([True, False])
    assert rows.seen(np.array([[1.0], [end]]))[0, 0] == (share > 1.0)


def test_velocity_that_nothing_explains() -> None:
    run = bouncing()
    shift = np.zeros_like(run.velocity)
    shift[40:, 0] = 1e-3
    found = judge_events(dataclasses.replace(run, velocity=run.velocity + shift))
    assert {"balance", "energy"} <= broken(found)


def test_time_runs_back() -> None:
    run = bouncing()
    time = run.time.copy()
    time[[30, 31]] = time[[31, 30]]
    assert "time runs back" in broken(judge_events(dataclasses.replace(run, time=time)))


# --- Sliding -------------------------------------------------------------------------------------

SPEED = 0.2


def sliding(
    friction: float = MU, *, ground: float = MU, edit: Callable[[Any], Any] = lambda f: f
) -> hs.Run:
    """The puck stays after v / μg; the run has an event there, and forces of that very instant."""
    stays = SPEED / (abs(friction) * G)
    grid = np.arange(0.0, 0.1201, 1e-3)
    time = np.sort(np.concatenate((grid, [stays]))) if friction > 0.0 else grid
    slides = (time < stays) | (friction < 0.0)
    held = np.where(slides, time, stays)
    x = SPEED * held - 0.5 * friction * G * held**2
    v = SPEED - friction * G * held
    force = np.stack(
        (np.full(len(time), MASS * G), np.where(slides, -friction * MASS * G, 0.0)), axis=1
    )
    still = np.zeros(len(time))
    return make_run(
        ball(),
        time,
        position=np.stack((x, still), axis=1),
        velocity=np.stack((v, still), axis=1),
        force=edit(force)[:, None],
        slip_velocity=v[:, None],
        events=(Event(stays, EventKind.STICK, 0, (0.0, 0.0)),) if friction > 0.0 else (),
        ground=hs.Ground(friction=ground),
        method=hs.EventDriven(),
    )


def test_right_slide_is_left_in_peace() -> None:
    found = judge_events(sliding())
    assert not found.objections
    assert found.worst["balance"] < 1e-10
    assert found.worst["energy"] < 1e-10


def test_friction_that_is_not_coulombs() -> None:
    assert "friction opposes" in broken(judge_events(sliding(0.5 * MU)))
    assert "friction cone" in broken(judge_events(sliding(1.5 * MU)))
    found = broken(judge_events(sliding(-MU)))
    assert "friction opposes" in found
    assert "balance" not in found


def test_flipped_sign_and_shifted_forces() -> None:
    flipped = judge_events(sliding(edit=lambda f: f * [1.0, -1.0]))
    assert {"balance", "friction opposes", "energy"} <= broken(flipped)
    shifted = judge_events(sliding(edit=lambda f: np.roll(f, 5, axis=0)))
    assert "friction opposes" in broken(shifted)
    small = judge_events(sliding(edit=lambda f: 0.99 * f))
    assert {"balance", "contact: acceleration into it"} <= broken(small)
    large = judge_events(sliding(edit=lambda f: 1.01 * f))
    assert {"balance", "contact: force while it lifts"} <= broken(large)


def test_scaled_slip() -> None:
    run = sliding()
    run = dataclasses.replace(run, slip_velocity=1.01 * run.slip_velocity)
    assert broken(judge_events(run)) == {"recorded slip"}


def test_sticking_point_that_slides_off() -> None:
    """It rests on a slope steeper than friction holds, and says it does not move."""
    slope, time = 0.4, np.arange(0.0, 0.02, 1e-3)
    normal = MASS * G * np.cos(slope)
    run = make_run(
        ball(),
        time,
        force=[[normal, -0.2 * normal]],
        ground=hs.Ground(friction=0.6, slope=slope),
        method=hs.EventDriven(),
    )
    assert {"balance", "sticking point slides off"} <= broken(judge_events(run))
    held = dataclasses.replace(
        run, contact_force=run.contact_force * 0 + [normal, MASS * G * np.sin(slope)]
    )
    assert not judge_events(held).objections


def test_penetration() -> None:
    run = sliding()
    run = dataclasses.replace(
        run,
        position=run.position - [0.0, 1e-5],
        contact_point=run.contact_point - [0.0, 1e-5],
        gap=run.gap - 1e-5,
    )
    assert "penetration" in broken(judge_events(run))


# --- Joints --------------------------------------------------------------------------------------


def slider(after: float, impulse: float) -> hs.Run:
    """It runs at 0.2 m/s into a stop at 0.02 m."""
    builder = hs.RobotBuilder("slider", gravity=G)
    builder.slide("x", None, direction=(1, 0), mass=3.0, limits=(-1.0, 0.02))
    time = np.sort(np.append(np.arange(0.0, 0.2001, 1e-3), 0.1))
    late = np.arange(len(time)) > int(np.flatnonzero(np.isclose(time, 0.1))[0])
    time[np.isclose(time, 0.1)] = 0.1
    return make_run(
        builder.build(),
        time,
        position=np.where(late, 0.02 + after * (time - 0.1), 0.2 * time)[:, None],
        velocity=np.where(late, after, 0.2)[:, None],
        events=(Event(0.1, EventKind.JOINT_STOP, 0, (impulse, 0.0)),),
        method=hs.EventDriven(),
    )


def test_stop() -> None:
    assert not judge_events(slider(0.0, 0.6)).objections
    assert broken(judge_events(slider(0.0, 0.5))) == {"balance of an impact"}
    assert "impact: stop gives way" in broken(judge_events(slider(-0.1, 0.9)))
    assert "upper stop: beyond it" in broken(judge_events(slider(0.05, 0.45)))


def test_dry_friction() -> None:
    """A slider of 3 kg slows down by 6 N, and by what its joint can do."""

    def run(limit: float, sign: float = 1.0) -> hs.Run:
        builder = hs.RobotBuilder("slider", gravity=G)
        builder.slide("x", None, direction=(1, 0), mass=3.0, dry_friction=limit)
        time = np.arange(0.0, 0.05, 1e-3)
        return make_run(
            builder.build(),
            time,
            position=(0.2 * time - sign * time**2)[:, None],
            velocity=(0.2 - sign * 2.0 * time)[:, None],
            friction_torque=[[-sign * 6.0]],
            method=hs.EventDriven(),
        )

    assert not judge_events(run(6.0)).objections
    assert broken(judge_events(run(5.0))) >= {"dry friction: limit"}
    assert broken(judge_events(run(7.0))) == {"dry friction: opposes"}
    assert "dry friction: opposes" in broken(judge_events(run(6.0, -1.0)))


def test_initial_state_counts() -> None:
    """A run that begins with an impact shows only what comes after it."""
    run = sliding()
    start = hs.State(run.position[0], run.velocity[0] - [0.0, 0.1])
    assert "balance of an impact" in broken(judge_events(run, start))
    hit = Event(0.0, EventKind.TOUCHDOWN, 0, (MASS * 0.1, 0.0))
    run = dataclasses.replace(run, events=(hit, *run.events))
    assert "balance of an impact" not in broken(judge_events(run, start))
