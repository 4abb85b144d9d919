"""Sliding, spinning, rolling and precessing bodies in space, beside what theory says of them.

Every motion is smooth but for the instants at which sliding ends, so that time stepping is of first
order: errors halve with the step. At a millisecond they are below a millimetre.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import heelstrike as hs

G = 9.81
Floats = np.ndarray


def body(tmp_path: Path, inner: str, posture: str = "") -> hs.SpatialRobot:
    """A free body; `inner` is what its element holds, `posture` how the file has it stand."""
    path = tmp_path / "body.xml"
    path.write_text(
        f"<mujoco model='body'><worldbody><body name='body' {posture}><freejoint/>{inner}</body>"
        "</worldbody></mujoco>"
    )
    with pytest.warns(UserWarning, match="no joint has a motor"):
        robot = hs.load_robot(path, dimension=3)
    assert isinstance(robot, hs.SpatialRobot)
    return robot


def order_and_error(
    steps: tuple[float, ...], motion: Callable[[float], Floats], exact: Floats
) -> tuple[float, float]:
    """Order between the two shortest steps, and the error at a millisecond, in m."""
    errors = [float(np.linalg.norm(motion(step) - exact)) for step in steps]
    order = np.log(errors[-2] / errors[-1]) / np.log(steps[-2] / steps[-1])
    return float(order), errors[steps.index(1e-3)]


STEPS = (1e-3, 5e-4, 2.5e-4)


def run_of(
    robot: hs.SpatialRobot, q: Floats, v: Floats, ground: hs.SpatialGround, step: float,
    duration: float,
) -> Floats:  # fmt: skip
    """Position at the end of a run all of whose steps are certified."""
    run = hs.simulate(
        robot, None, state=hs.State(q, v), ground=ground, duration=duration,
        method=hs.TimeStepping(step=step), record_every=10**6,
    )  # fmt: skip
    assert run.completed
    assert run.certificates.uncertified == 0
    assert run.certificates.penetration <= 1e-6
    return run.position[-1]


def test_a_block_slides_obliquely_on_a_slope_to_rest(tmp_path: Path) -> None:
    """v' = g_t − μ g_n v/|v|: where it comes to rest is an integral along its path.

    The loads of the corners are unequal, but their resultant lies in the plane of friction and the
    centre of mass, so that nothing turns the block.
    """
    angle, mu = 0.2, 0.4
    robot = body(tmp_path, "<geom type='box' size='0.2 0.15 0.05' mass='2'/>")
    ground = hs.SpatialGround(friction=mu, normal=(-np.sin(angle), 0.0, np.cos(angle)))
    uphill = np.array([np.cos(angle), 0.0, np.sin(angle)])
    start = np.array([0.3, 1.2])  # uphill, across

    def slide(_: float, s: Floats) -> Floats:
        speed = s[2:]
        friction = mu * G * np.cos(angle) * speed / np.linalg.norm(speed)
        return np.r_[speed, np.array([-G * np.sin(angle), 0.0]) - friction]

    def stops(_: float, s: Floats) -> float:
        return float(np.linalg.norm(s[2:]) - 1e-9)

    stops.terminal = True  # type: ignore[attr-defined]
    path = solve_ivp(slide, (0.0, 5.0), np.r_[0.0, 0.0, start], events=stops, rtol=1e-12,
                     atol=1e-14, method="DOP853")  # fmt: skip
    along, across = path.y[:2, -1]
    half = 0.5 * angle
    turned = np.array([np.cos(half), 0.0, -np.sin(half), 0.0])
    normal = np.array([-np.sin(angle), 0.0, np.cos(angle)])
    q = np.r_[0.05 * normal, turned]
    v = np.r_[start[0] * uphill + [0.0, start[1], 0.0], 0.0, 0.0, 0.0]
    exact = 0.05 * normal + along * uphill + [0.0, across, 0.0]
    duration = round(path.t[-1] + 0.2, 2)
    order, error = order_and_error(
        STEPS, lambda h: run_of(robot, q, v, ground, h, duration)[:3], exact
    )
    assert order == pytest.approx(1.0, abs=0.02)
    assert error <= 1e-3


def test_a_tripod_spins_and_slides(tmp_path: Path) -> None:
    """Three points carry a third of the weight each; friction of each is against its own speed."""
    mu, mass, inertia, arm = 0.5, 1.5, 0.02, 0.2
    places = [(arm * np.cos(a), arm * np.sin(a)) for a in 2.0 * np.pi / 3.0 * np.arange(3)]
    legs = "".join(f"<geom type='sphere' size='0.01' pos='{x} {y} 0.01'/>" for x, y in places)
    robot = body(
        tmp_path,
        f"<inertial pos='0 0 0' mass='{mass}' diaginertia='0.01 0.01 {inertia}'/>{legs}",
    )

    def slide(_: float, s: Floats) -> Floats:
        yaw, vx, vy, turn = s[2:]
        force, moment = np.zeros(2), 0.0
        for px, py in places:
            ax, ay = px * np.cos(yaw) - py * np.sin(yaw), px * np.sin(yaw) + py * np.cos(yaw)
            speed = np.array([vx - turn * ay, vy + turn * ax])
            rub = -mu * mass * G / 3.0 * speed / np.linalg.norm(speed)
            force += rub
            moment += ax * rub[1] - ay * rub[0]
        return np.r_[vx, vy, turn, force / mass, moment / inertia]

    duration = 0.15  # it still slides then
    begin = np.array([0.0, 0.0, 0.0, 1.0, 0.4, 6.0])
    exact = solve_ivp(slide, (0.0, duration), begin, rtol=1e-12, atol=1e-14, method="DOP853").y
    assert np.hypot(*exact[3:5, -1]) > 0.1
    q = np.r_[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]
    v = np.r_[1.0, 0.4, 0.0, 0.0, 0.0, 6.0]

    def motion(step: float) -> Floats:
        end = run_of(robot, q, v, hs.SpatialGround(friction=mu), step, duration)
        return np.r_[end[:2], arm * 2.0 * np.arctan2(end[6], end[3])]

    order, error = order_and_error(STEPS, motion, np.r_[exact[:2, -1], arm * exact[2, -1]])
    assert order == pytest.approx(1.0, abs=0.02)
    assert error <= 1e-3


def test_a_sphere_with_side_spin_comes_to_roll(tmp_path: Path) -> None:
    """Its lowest point slides along a line, slower by 7/2 μ g each second; then the sphere rolls.

    Spin about the vertical does nothing.
    """
    mu, radius = 0.3, 0.1
    robot = body(tmp_path, f"<geom type='sphere' size='{radius}' mass='1'/>")
    velocity, spin = np.array([1.0, 0.5]), np.array([8.0, -6.0, 5.0])
    slip = velocity + radius * np.array([-spin[1], spin[0]])
    stop = 2.0 * np.linalg.norm(slip) / (7.0 * mu * G)
    slow = -mu * G * slip / np.linalg.norm(slip)
    duration = 0.5
    assert stop < 0.8 * duration
    rolling = velocity + slow * stop
    exact = velocity * stop + 0.5 * slow * stop**2 + rolling * (duration - stop)
    q = np.r_[0.0, 0.0, radius, 1.0, 0.0, 0.0, 0.0]
    v = np.r_[velocity, 0.0, spin]
    ground = hs.SpatialGround(friction=mu)
    order, error = order_and_error(
        STEPS, lambda h: run_of(robot, q, v, ground, h, duration)[:2], exact
    )
    assert order == pytest.approx(1.0, abs=0.02)
    assert error <= 1e-3


def leaning(theta: float) -> tuple[Floats, Floats, Floats]:
    """A body turned by −θ about x: its axis leans towards +y.

    Returns the horizontal direction across the axis, that up the slope of what is perpendicular to
    it, and the axes of the body, row by row; the third is the axis.
    """
    axis = np.array([0.0, np.sin(theta), np.cos(theta)])
    across = np.array([-1.0, 0.0, 0.0])
    up = np.cross(axis, across)
    assert up[2] > 0.0
    return across, up, np.array([[1.0, 0.0, 0.0], [0.0, np.cos(theta), -np.sin(theta)], axis])


def test_a_disc_rolls_leaning_in_a_circle(tmp_path: Path) -> None:
    """Steady motion of a thin disc: with θ between its axis and the vertical, turning by Ω

        Ω sin θ ((C + m a²) n − A Ω cos θ) = −m a g cos θ

    for its spin n about its axis; the centre runs round a circle of radius a n / Ω. (Angular
    momentum about the centre, and the force at the rim that it takes.)
    """
    a, mass, theta, turning = 0.3, 2.0, 1.25, 3.0
    axial, across = 0.5 * mass * a**2, 0.25 * mass * a**2
    spin = (across * turning * np.cos(theta) - mass * a * G / (turning * np.tan(theta))) / (
        axial + mass * a**2
    )
    # The other rim of the cylinder is above the one that rolls, which is in the plane of its mass.
    robot = body(
        tmp_path,
        f"<inertial pos='0 0 0' mass='{mass}' diaginertia='{across} {across} {axial}'/>"
        f"<geom type='cylinder' size='{a} 0.02' pos='0 0 0.02'/>",
        "euler='90 0 0'",  # a cylinder that lies has rims, one that stands has points
    )
    e1, e2, axes = leaning(theta)
    omega = turning * np.sin(theta) * e2 + spin * axes[2]
    q = np.r_[a * e2, np.cos(0.5 * theta), -np.sin(0.5 * theta), 0.0, 0.0]
    v = np.r_[-a * spin * e1, axes @ omega]
    duration = 0.4
    angle = turning * duration
    middle = -np.cross(v[:3], [0.0, 0.0, 1.0]) / turning  # from the centre to the axis of turning
    about = np.array([
        [np.cos(angle), -np.sin(angle), 0.0], [np.sin(angle), np.cos(angle), 0.0], [0, 0, 1.0]
    ])  # fmt: skip
    exact = a * e2 + middle - about @ middle
    ground = hs.SpatialGround(friction=2.0)
    order, error = order_and_error(
        STEPS, lambda h: run_of(robot, q, v, ground, h, duration)[:3], exact
    )
    assert order == pytest.approx(1.0, abs=0.02)
    assert error <= 1e-3


def test_a_top_precesses_on_smooth_ground(tmp_path: Path) -> None:
    """Steady: Ω (C n − A Ω cos θ) = m g l, about a centre of mass that stands still.

    Coriolis forces act as at the beginning of a step: nutation, of C n / A = 37 rad/s, gains half
    the square of 37 rad/s times the step at every step, so that the top must not be fast.
    """
    mass, length, axial, across, theta, turning = 0.4, 0.05, 1e-3, 8e-4, 0.4, 8.0
    robot = body(
        tmp_path,
        f"<inertial pos='0 0 {length}' mass='{mass}' diaginertia='{across} {across} {axial}'/>"
        "<geom type='sphere' size='0.002' pos='0 0 0.002'/>",
    )
    # Tip: a small sphere round a point above the body's origin; its lowest point moves by 2 mm.
    reach = length - 0.002
    spin = (mass * G * reach / turning + across * turning * np.cos(theta)) / axial
    _, e2, axes = leaning(theta)
    e3 = axes[2]
    omega = turning * np.sin(theta) * e2 + spin * e3
    center = np.array([0.0, 0.0, 0.002 + reach * np.cos(theta)])
    origin = center - length * e3
    q = np.r_[origin, np.cos(0.5 * theta), -np.sin(0.5 * theta), 0.0, 0.0]
    v = np.r_[np.cross(omega, origin - center), axes @ omega]
    duration = 0.2
    angle = turning * duration
    turned = np.array([-np.sin(angle) * e3[1], np.cos(angle) * e3[1], e3[2]])
    exact = center - length * turned
    order, error = order_and_error(
        STEPS, lambda h: run_of(robot, q, v, hs.SpatialGround(friction=0.0), h, duration)[:3], exact
    )
    assert order == pytest.approx(1.0, abs=0.02)
    assert error <= 1e-3
