"""The judge of time stepping on records that one can write down, and on the same with one flaw.

A puck of 2 kg slides on flat ground under friction μ: ``v⁺ = v − h μ g`` until it stops, exactly as
every scheme has it. A slider of 3 kg with dry friction τ runs along a rail into a stop.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scenes.findings import Findings
from scenes.step_judge import judge_steps
from synthetic_runs import make_run

import heelstrike as hs
from heelstrike.sim import Scheme

H, G, MU, MASS, SPEED = 1e-3, 9.81, 0.5, 2.0, 0.3
ROWS = 120


def puck() -> hs.Robot:
    builder = hs.RobotBuilder("puck", gravity=G)
    rail = builder.slide("x", None, direction=(1, 0), mass=0.0)
    body = builder.slide("z", rail, direction=(0, 1), mass=MASS)
    builder.contact(body, (0.0, 0.0))
    return builder.build()


def sliding(
    friction: float = MU, *, ground: float = MU, scheme: Scheme = Scheme.GAP_LINEARISED
) -> hs.Run:
    """The puck slows down under one friction on ground of another."""
    v = np.maximum(SPEED - friction * G * H * np.arange(ROWS), 0.0)
    x = np.concatenate(([0.0], np.cumsum(H * v[1:])))
    if scheme is Scheme.PAPER_EXPLICIT:
        x = np.concatenate(([0.0], np.cumsum(H * v[:-1])))
    elif scheme is Scheme.MOREAU_JEAN:
        x = np.concatenate(([0.0], np.cumsum(0.5 * H * (v[1:] + v[:-1]))))
    tangent = np.append(np.diff(v), 0.0) * MASS / H
    force = np.stack((np.full(ROWS, MASS * G), tangent), axis=1)[:, None]
    still = np.zeros(ROWS)
    return make_run(
        puck(),
        np.arange(ROWS) * H,
        position=np.stack((x, still), axis=1),
        velocity=np.stack((v, still), axis=1),
        force=force,
        ground=hs.Ground(friction=ground),
        slip_velocity=np.append(v[1:], 0.0)[:, None],
        method=hs.TimeStepping(step=H, scheme=scheme),
    )


def changed(
    run: hs.Run, name: str, change: Callable[[Any], Any], rows: Any = slice(None)
) -> hs.Run:
    values = getattr(run, name).copy()
    values[rows] = change(values[rows])
    return dataclasses.replace(run, **{name: values})


def broken(found: Findings) -> set[str]:
    return set(found.broken())


@pytest.mark.parametrize("scheme", Scheme)
def test_right_record_is_left_in_peace(scheme: Scheme) -> None:
    found = judge_steps(sliding(scheme=scheme))
    assert not found.objections
    assert found.worst["balance"] < 1e-13
    assert found.worst["teleport"] < 1e-13
    # The work of friction is all that happened: what is left is the first order of the scheme.
    assert found.figures["energy drift"] < 1e-12


def test_scheme_moves_as_it_says() -> None:
    """Positions of one scheme are no motion of another's."""
    run = sliding(scheme=Scheme.PAPER_EXPLICIT)
    other = hs.TimeStepping(step=H, scheme=Scheme.GAP_LINEARISED)
    wrong = dataclasses.replace(run, method=other)
    assert "teleport" in broken(judge_steps(wrong))


def test_forces_one_row_late() -> None:
    run = sliding()
    late = dataclasses.replace(run, contact_force=np.roll(run.contact_force, 1, axis=0))
    assert "balance" in broken(judge_steps(late))


def test_force_one_per_mille_large() -> None:
    found = judge_steps(changed(sliding(), "contact_force", lambda f: 1.001 * f))
    assert broken(found) == {"balance", "friction opposes"} or broken(found) == {"balance"}
    assert found.objections[0].size > 1e-6


def test_friction_that_drives() -> None:
    """Consistent with momentum, but along the sliding: the ground works on the puck."""
    found = judge_steps(sliding(-MU, ground=MU))
    assert {"friction opposes", "energy made in contact"} <= broken(found)
    assert "balance" not in broken(found)


def test_flipped_sign_of_recorded_friction() -> None:
    run = changed(sliding(), "contact_force", lambda f: f * [1.0, -1.0])
    assert {"balance", "friction opposes"} <= broken(judge_steps(run))


def test_friction_beyond_the_cone() -> None:
    found = broken(judge_steps(sliding(2.0 * MU, ground=MU)))
    assert "friction cone" in found
    assert "balance" not in found


def test_friction_that_holds_back() -> None:
    """Half of what sliding costs is no Coulomb friction."""
    assert broken(judge_steps(sliding(0.5 * MU, ground=MU))) == {"friction opposes"}


@pytest.mark.parametrize("factor", [-1.0, 0.0, 1.001])
def test_scaled_slip(factor: float) -> None:
    run = changed(sliding(), "slip_velocity", lambda s: factor * s)
    assert broken(judge_steps(run)) == {"recorded slip"}


def test_teleport() -> None:
    run = sliding()
    shift = np.array([1e-6, 0.0])
    run = changed(run, "position", lambda q: q + shift, slice(60, None))
    run = changed(run, "contact_point", lambda p: p + shift, slice(60, None))
    found = judge_steps(run)
    assert broken(found) == {"teleport"}
    (objection,) = found.objections
    assert objection.time == pytest.approx(59 * H)
    assert objection.size == pytest.approx(1e-6, rel=2e-2)  # relative to 1 + |x|
    assert (objection.where, objection.count) == ("x", 1)


def test_adhesion() -> None:
    """The puck is held down against a lift: momentum balances, the ground pulls."""
    run = sliding(0.0, ground=0.0)
    lifted = dataclasses.replace(
        run, pushes=(hs.Push("z", force=(0.0, 2.0 * MASS * G), start=-1.0, duration=9.0),)
    )
    lifted = changed(lifted, "contact_force", lambda f: -f)
    found = broken(judge_steps(lifted))
    assert "contact: pull" in found
    assert "balance" not in found


def test_hovering() -> None:
    run = sliding()
    up = np.array([0.0, 0.01])
    run = changed(run, "position", lambda q: q + up)
    run = changed(run, "contact_point", lambda p: p + up)
    run = changed(run, "gap", lambda g: g + 0.01)
    assert broken(judge_steps(run)) == {"contact: force without touch"}


def test_bounce_of_a_plastic_impact() -> None:
    """It falls onto the ground in step 10 and goes up again faster: impulse and motion agree."""
    v = -0.2 - G * H * np.arange(ROWS)
    v[11:] = -1.2 * v[10] - G * H * np.arange(ROWS - 11)
    impulse = np.zeros(ROWS)
    impulse[10] = (v[11] - v[10] + G * H) * MASS
    fall = np.cumsum(H * v[1:])
    z = np.concatenate(([0.0], fall)) - fall[9]
    still = np.zeros(ROWS)
    run = make_run(
        puck(),
        np.arange(ROWS) * H,
        position=np.stack((still, z), axis=1),
        velocity=np.stack((still, v), axis=1),
        force=np.stack((impulse / H, still), axis=1)[:, None],
        method=hs.TimeStepping(step=H),
    )
    found = broken(judge_steps(run))
    assert {"contact: force without touch", "energy made in contact"} <= found
    assert "balance" not in found
    assert "teleport" not in found


def test_falling_through() -> None:
    """Free fall through the ground obeys every law but one."""
    v = -1.0 - G * H * np.arange(ROWS)
    z = 0.01 + np.concatenate(([0.0], np.cumsum(H * v[1:])))
    still = np.zeros(ROWS)
    run = make_run(
        puck(),
        np.arange(ROWS) * H,
        position=np.stack((still, z), axis=1),
        velocity=np.stack((still, v), axis=1),
        method=hs.TimeStepping(step=H),
    )
    found = judge_steps(run)
    assert {"contact: speed into it", "sunk at a corner"} <= broken(found)
    assert found.figures["penetration"] == pytest.approx(-z[-1])


@pytest.mark.parametrize("name", ["gap", "contact_point", "contact_normal"])
def test_record_of_the_geometry(name: str) -> None:
    tilt = {
        "gap": lambda g: g + 1e-6,
        "contact_point": lambda p: p + np.array([1e-6, 0.0]),
        "contact_normal": lambda n: n @ np.array([[np.cos(1e-3), 0.001], [-0.001, np.cos(1e-3)]]),
    }[name]
    run = changed(sliding(), name, tilt, slice(5, 6))
    law = {"gap": "gap", "contact_point": "place", "contact_normal": "normal"}[name]
    assert f"recorded {law}" in broken(judge_steps(run))


def test_not_a_number_is_no_excuse() -> None:
    run = changed(sliding(), "contact_force", lambda f: np.full_like(f, np.nan), slice(7, 8))
    found = judge_steps(run)
    assert "balance" in broken(found)
    assert found.worst["balance"] == np.inf


def test_huge_forces_prove_nothing() -> None:
    """Two points of one body may not balance each other with 1e12 N against a wrong velocity."""
    builder = hs.RobotBuilder("plank", gravity=G)
    rail = builder.slide("x", None, direction=(1, 0), mass=0.0)
    body = builder.slide("z", rail, direction=(0, 1), mass=MASS)
    builder.contact(body, (-0.1, 0.0))
    builder.contact(body, (0.1, 0.0))
    still = np.zeros(5)
    run = make_run(
        builder.build(),
        np.arange(5) * H,
        velocity=np.stack((0.1 * np.arange(5), still), axis=1),
        position=np.stack((H * 0.1 * np.array([0, 1, 3, 6, 10]), still), axis=1),
        force=np.array([[0.5 * MASS * G, 1e12], [0.5 * MASS * G, -1e12]]),
        ground=hs.Ground(friction=1.0),
        method=hs.TimeStepping(step=H),
    )
    found = judge_steps(run)
    assert {"balance", "friction cone"} <= broken(found)
    assert found.worst["balance"] > 0.1


# --- Joints ----------------------------------------------------------------------------------


def slider(**properties: Any) -> hs.Robot:
    builder = hs.RobotBuilder("slider", gravity=G)
    builder.slide("x", None, direction=(1, 0), mass=3.0, **properties)
    return builder.build()


def rubbing(torque: float, limit: float) -> hs.Run:
    v = np.maximum(0.2 - H * torque / 3.0 * np.arange(ROWS), 0.0)
    friction = np.append(np.diff(v), 0.0) * 3.0 / H
    return make_run(
        slider(dry_friction=limit),
        np.arange(ROWS) * H,
        position=np.concatenate(([0.0], np.cumsum(H * v[1:])))[:, None],
        velocity=v[:, None],
        friction_torque=friction[:, None],
        method=hs.TimeStepping(step=H),
    )


def test_dry_friction() -> None:
    assert not judge_steps(rubbing(6.0, 6.0)).objections
    assert broken(judge_steps(rubbing(6.0, 5.0))) >= {"dry friction: limit"}
    assert broken(judge_steps(rubbing(6.0, 7.0))) == {"dry friction: opposes"}
    assert "dry friction: opposes" in broken(judge_steps(rubbing(-6.0, 6.0)))


def stopping(after: float) -> hs.Run:
    """It runs at 0.2 m/s into a stop at 0.02 m, and goes on with another velocity."""
    v = np.full(ROWS, 0.2)
    v[101:] = after
    stop = np.zeros(ROWS)
    stop[100] = (after - 0.2) * 3.0 / H
    return make_run(
        slider(limits=(-1.0, 0.02)),
        np.arange(ROWS) * H,
        position=np.concatenate(([0.0], np.cumsum(H * v[1:])))[:, None],
        velocity=v[:, None],
        stop_torque=stop[:, None],
        method=hs.TimeStepping(step=H),
    )


def test_stops() -> None:
    assert not judge_steps(stopping(0.0)).objections
    assert "upper stop: speed into it" in broken(judge_steps(stopping(0.1)))
    assert "upper stop: force without touch" in broken(judge_steps(stopping(-0.1)))
