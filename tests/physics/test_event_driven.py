"""Closed forms and published limit cycles under event-driven simulation.

Unless a test says otherwise its tolerance is 1e-8, the relative tolerance of the integration; where
the exact motion is a polynomial of low degree the method makes no error at all and the tolerance is
rounding.
"""

from __future__ import annotations

import mechanisms
import numpy as np
import pytest
from numpy.typing import NDArray

import heelstrike as hs
from heelstrike.sim import Event, EventKind, RunStatus

G = 9.81


def simulate(
    robot: hs.Robot,
    q: list[float] | NDArray[np.float64],
    v: list[float] | NDArray[np.float64],
    duration: float,
    ground: hs.Ground,
    **options: object,
) -> hs.Run:
    run = hs.simulate(
        robot,
        state=hs.State(np.array(q), np.array(v)),
        duration=duration,
        method=hs.EventDriven(**options),  # type: ignore[arg-type]
        ground=ground,
        stop_when_fallen=False,
    )
    assert run.status is RunStatus.COMPLETED, run.message
    assert run.certificates.penetration <= 1e-10
    assert run.certificates.complementarity <= 1e-9
    return run


def events(run: hs.Run, kind: EventKind, contact: int | None = None) -> list[Event]:
    return [e for e in run.events if e.kind is kind and contact in (None, e.contact)]


def around(run: hs.Run, time: float) -> tuple[int, int]:
    """Rows just before and just after a jump of the velocities."""
    rows = np.flatnonzero(np.abs(run.time - time) < 1e-11)
    return int(rows[0]), int(rows[-1])


# --- Friction ------------------------------------------------------------------------------------


@pytest.mark.parametrize("friction", [0.3, 0.8])
@pytest.mark.parametrize("excess", [-1e-2, 1e-2])
def test_block_on_a_slope(friction: float, excess: float) -> None:
    """It sticks for tan θ < μ, else slides with g (sin θ - μ cos θ); the motion is quadratic."""
    slope = np.arctan(friction + excess)
    along, up = np.array([np.cos(slope), np.sin(slope)]), np.array([-np.sin(slope), np.cos(slope)])
    block = mechanisms.block(0.2, 0.1)
    ground = hs.Ground(friction=friction, slope=slope)
    run = simulate(block, [*(0.05 * up), -slope], [0.0, 0.0, 0.0], 2.0, ground)
    distance = (run.position[:, :2] - run.position[0, :2]) @ along
    speed = run.velocity[:, :2] @ along
    if excess < 0.0:
        assert np.abs(speed).max() <= 1e-12
        assert np.abs(distance).max() <= 1e-12
    else:
        acceleration = -G * (np.sin(slope) - friction * np.cos(slope))
        np.testing.assert_allclose(speed, acceleration * run.time, atol=1e-12)
        np.testing.assert_allclose(distance, 0.5 * acceleration * run.time**2, atol=1e-12)


def test_sliding_stop() -> None:
    """v0 = 2 m/s, μ = 0.5: stops after v0²/(2 μ g) = 0.407747 m at v0/(μ g), and stays."""
    run = simulate(
        mechanisms.block(0.2, 0.02), [0.0, 0.01, 0.0], [2.0, 0.0, 0.0], 2.0, hs.Ground(friction=0.5)
    )
    assert run.position[-1, 0] == pytest.approx(0.407747, abs=5e-7)
    assert run.position[-1, 0] == pytest.approx(4.0 / G, abs=1e-12)
    stops = events(run, EventKind.STICK)
    assert len(stops) == 2  # both corners
    for stop in stops:
        assert stop.time == pytest.approx(4.0 / G, abs=1e-12)
    assert np.abs(run.velocity[-1]).max() <= 1e-12


def test_cube_launched_flat_never_lifts() -> None:
    """The line of action of the ground's force stays within the base: μ h/2 < w/2."""
    run = simulate(
        mechanisms.block(0.1, 0.1), [0.0, 0.05, 0.0], [6.0, 0.0, 0.0], 2.0, hs.Ground(friction=0.5)
    )
    assert np.abs(run.gap).max() <= 1e-9
    assert run.position[-1, 0] == pytest.approx(36.0 / G, abs=1e-10)
    assert not events(run, EventKind.LIFTOFF)


def test_a_tall_block_launched_flat_tips_at_once() -> None:
    """μ h > w: sliding on the leading corner alone; the first accelerations in closed form."""
    width, height, friction = 0.1, 0.4, 0.5
    block = mechanisms.block(width, height)
    run = simulate(
        block, [0.0, 0.5 * height, 0.0], [6.0, 0.0, 0.0], 0.01, hs.Ground(friction=friction)
    )
    # About the centre of mass: I α = f_n (μ h - w) / 2; the corner stays down: a_z = -α w / 2 ...
    inertia = (width**2 + height**2) / 12.0
    lever = 0.5 * (friction * height - width)
    force = G / (1.0 + 0.5 * width * -lever / inertia)
    assert run.contact_force[0, 1, 0] == pytest.approx(force, rel=1e-12)
    assert run.contact_force[0, 0, 0] == 0.0
    assert run.gap[-1, 0] > 1e-6


@pytest.mark.parametrize("friction", [0.5, 0.1])
def test_disc_on_a_slope(friction: float) -> None:
    """It rolls with a = g sin θ / (1 + I/mr²) if friction I/(mr²) m a allows, else slides."""
    slope, radius = 0.3, 0.2
    along, up = np.array([np.cos(slope), np.sin(slope)]), np.array([-np.sin(slope), np.cos(slope)])
    ground = hs.Ground(friction=friction, slope=slope)
    run = simulate(mechanisms.disc(radius), [*(radius * up), 0.0], [0.0, 0.0, 0.0], 2.0, ground)
    rolling = friction > np.tan(slope) / 3.0
    force = G * np.sin(slope) / 3.0 if rolling else friction * G * np.cos(slope)
    acceleration = force - G * np.sin(slope)
    distance = (run.position[:, :2] - run.position[0, :2]) @ along
    np.testing.assert_allclose(distance, 0.5 * acceleration * run.time**2, atol=1e-12)
    np.testing.assert_allclose(run.contact_force[:, 0, 1], force, atol=1e-12)
    if rolling:
        np.testing.assert_allclose(radius * run.position[:, 2], distance, atol=1e-12)


def test_disc_slides_then_rolls() -> None:
    """Launched at v0 without spin a disc slides for v0 / (3 μ g) and rolls on at 2 v0 / 3."""
    run = simulate(
        mechanisms.disc(0.2), [0.0, 0.2, 0.0], [3.0, 0.0, 0.0], 2.0, hs.Ground(friction=0.2)
    )
    (stick,) = events(run, EventKind.STICK)
    assert stick.time == pytest.approx(1.0 / (0.2 * G), abs=1e-12)
    np.testing.assert_allclose(run.velocity[-1], [2.0, 0.0, 10.0], atol=1e-12)


# --- Impacts -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("height", "restitution", "zeno"),
    [(1.0, 0.9, 8.57894918), (1.0, 0.5, 1.35457092), (10.0, 0.8, 12.85058811)],
)
def test_bouncing_point(height: float, restitution: float, zeno: float) -> None:
    """Impacts at t1 (1 + 2e + 2e² + ...), tops e²ⁿ h, an end at t1 (1 + e)/(1 - e), then rest."""
    ground = hs.Ground(restitution=restitution)
    run = simulate(mechanisms.point(), [0.0, height], [0.0, 0.0], zeno + 0.5, ground)
    first = np.sqrt(2.0 * height / G)
    assert run.timing.wall_s <= 1.0
    impacts = events(run, EventKind.TOUCHDOWN)
    powers = restitution ** np.arange(len(impacts))
    exact = first * (1.0 + 2.0 * (np.cumsum(powers) - 1.0))
    np.testing.assert_allclose([e.time for e in impacts], exact, atol=1e-9)
    # All but the last rebound, which is too short to follow.
    impulse = (1.0 + restitution) * G * first * powers
    np.testing.assert_allclose([e.impulse[0] for e in impacts[:-1]], impulse[:-1], rtol=1e-6)
    (end,) = events(run, EventKind.ZENO)
    assert end.time == pytest.approx(zeno, abs=1e-8)
    assert end.time == pytest.approx(first * (1.0 + restitution) / (1.0 - restitution), abs=1e-9)
    at_rest = run.time > end.time
    assert np.abs(run.velocity[at_rest]).max() <= 1e-12
    assert np.abs(run.gap[at_rest]).max() <= 1e-12
    np.testing.assert_allclose(run.contact_force[at_rest, 0, 0], G, atol=1e-9)
    if height == 1.0 and restitution == 0.9:
        assert impacts[0].time == pytest.approx(0.45152364, abs=1e-8)
        before, _ = around(run, impacts[0].time)
        assert run.velocity[before, 1] == pytest.approx(-4.42944692, abs=1e-8)


@pytest.mark.parametrize("restitution", [0.5, 0.9])
def test_bounce_heights(restitution: float) -> None:
    """Top n is e²ⁿ h, read off half-way between impacts from the velocity after each of them."""
    ground = hs.Ground(restitution=restitution)
    run = simulate(mechanisms.point(), [0.0, 1.0], [0.0, 0.0], 1.3, ground)
    for n, impact in enumerate(events(run, EventKind.TOUCHDOWN)[:6], start=1):
        _, after = around(run, impact.time)
        top = run.velocity[after, 1] ** 2 / (2.0 * G)
        assert top == pytest.approx(restitution ** (2 * n), abs=1e-8)


def test_perfectly_elastic_point_keeps_its_energy() -> None:
    run = simulate(mechanisms.point(), [0.0, 1.0], [0.0, 0.0], 30.0, hs.Ground(restitution=1.0))
    energy = 0.5 * np.sum(run.velocity**2, axis=1) + G * run.position[:, 1]
    np.testing.assert_allclose(energy, energy[0], rtol=1e-8)
    assert not events(run, EventKind.ZENO)


@pytest.mark.parametrize(("width", "height"), [(0.2, 1.0), (0.1, 1.0)])
def test_rocking_block(width: float, height: float) -> None:
    """Plastic corners: each impact leaves 1 - (3/2) sin² α of the angular speed (Housner 1963)."""
    angle = np.arctan(width / height)
    ratio = 1.0 - 1.5 * np.sin(angle) ** 2
    tilt = 0.5 * angle
    block = mechanisms.block(width, height)
    c, s = np.cos(tilt), np.sin(tilt)
    corner = np.array([0.5 * (c * width - s * height), -0.5 * (s * width + c * height)])
    q = [0.5 * width - corner[0], -corner[1], tilt]
    run = simulate(block, q, [0.0, 0.0, 0.0], 10.0, hs.Ground(friction=5.0), output_period=0.1)
    impacts = [e for e in events(run, EventKind.TOUCHDOWN) if e.time > 0.0]
    assert len(impacts) > 10
    for impact in impacts[:10]:
        before, after = around(run, impact.time)
        expected = ratio * run.velocity[before, 2]
        assert run.velocity[after, 2] == pytest.approx(expected, rel=1e-9)
    assert [e.contact for e in impacts[:6]] == [0, 1, 0, 1, 0, 1]


def test_rocking_ends_on_the_flat_base() -> None:
    """The impacts of a rocking block accumulate too; it comes to rest on both corners."""
    width, height = 0.2, 1.0
    tilt = 0.02
    c, s = np.cos(tilt), np.sin(tilt)
    corner = np.array([0.5 * (c * width - s * height), -0.5 * (s * width + c * height)])
    q = [0.5 * width - corner[0], -corner[1], tilt]
    run = simulate(mechanisms.block(width, height), q, [0.0] * 3, 4.0, hs.Ground(friction=5.0))
    assert events(run, EventKind.ZENO)
    assert abs(run.position[-1, 2]) <= 1e-12
    assert np.abs(run.velocity[-1]).max() <= 1e-12
    np.testing.assert_allclose(run.contact_force[-1, :, 0], 0.5 * G, rtol=1e-9)


def test_flat_landing_of_a_block_is_one_impact_of_two_points() -> None:
    run = simulate(
        mechanisms.block(0.2, 0.1), [0.0, 1.05, 0.0], [0.0, 0.0, 0.0], 1.0, hs.Ground(friction=0.5)
    )
    landings = events(run, EventKind.TOUCHDOWN)
    assert [e.contact for e in landings] == [0, 1]
    speed = np.sqrt(2.0 * G)
    for landing in landings:
        assert landing.time == pytest.approx(speed / G, abs=1e-12)
        assert landing.impulse[0] == pytest.approx(0.5 * speed, rel=1e-12)
    assert np.abs(run.velocity[-1]).max() <= 1e-12


@pytest.mark.parametrize("restitution", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("tilt", [-0.9, -0.3, 0.3, 0.9])
def test_energy_is_never_created_unless_the_run_says_so(restitution: float, tilt: float) -> None:
    """Oblique impacts of a tilted block: Newton's law with friction may gain energy (Kane)."""
    ground = hs.Ground(friction=0.6, restitution=restitution)
    block = mechanisms.block(0.3, 0.1)
    run = simulate(block, [0.0, 0.6, tilt], [2.5, -1.0, -3.0], 1.0, ground, output_period=1e-2)
    inertia = (0.3**2 + 0.1**2) / 12.0
    energy = G * run.position[:, 1] + 0.5 * run.velocity**2 @ np.array([1.0, 1.0, inertia])
    confessed = events(run, EventKind.ENERGY_GAIN)
    assert len(events(run, EventKind.TOUCHDOWN)) > 0
    if not confessed:
        assert np.all(np.diff(energy) <= 1e-7)


def test_kanes_paradox_is_reported() -> None:
    """An elastic impact of an inclined rod that stops its end from sliding.

    With a = -w_n before and t = w_t before, and g the inverse of the Delassus matrix, the energy
    made is (2 a t g_nt - t² g_tt) / 2: positive for slow sliding towards the side it leans to.
    """
    found = 0
    for sliding in (-0.3, 0.3, 2.0):
        pitch = 0.25 * np.pi
        q = [0.5 * np.sin(pitch), 0.5 * np.cos(pitch) + 1e-3, pitch]
        run = simulate(
            mechanisms.rod(), q, [sliding, -1.0, 0.0], 2e-3, hs.Ground(friction=1, restitution=1)
        )
        energy = 0.5 * run.velocity**2 @ np.array([1.0, 1.0, 1.0 / 12.0]) + G * run.position[:, 1]
        gained = energy[-1] - energy[0] > 1e-9
        assert gained == bool(events(run, EventKind.ENERGY_GAIN))
        found += gained
    assert found == 1


# --- Painlevé ------------------------------------------------------------------------------------


@pytest.mark.parametrize("angle", [45.0, np.degrees(np.arctan(2.0))])
def test_painleve_rod(angle: float) -> None:
    """A sliding rod at θ to the ground has no consistent force from μ = (k + cos²θ)/(sin θ cos θ).

    k = I/(m l²) = 1/3 for a uniform rod, l from its end to its centre: 5/3 at 45°, at least 4/3 at
    63.435°. Below, the force is finite; above, an impulse stops the end at once.
    """
    theta = np.radians(angle)
    critical = (1.0 / 3.0 + np.cos(theta) ** 2) / (np.sin(theta) * np.cos(theta))
    assert critical == pytest.approx(5.0 / 3.0 if angle == 45.0 else 4.0 / 3.0, rel=1e-12)
    pitch = 0.5 * np.pi - theta
    q = [0.5 * np.sin(pitch), 0.5 * np.cos(pitch), pitch]

    below = simulate(
        mechanisms.rod(), q, [-1.0, 0.0, 0.0], 1e-5, hs.Ground(friction=critical - 1e-2)
    )
    assert not events(below, EventKind.PAINLEVE)
    assert below.velocity[-1, 0] < -0.5

    friction = critical + 1e-2
    above = simulate(mechanisms.rod(), q, [-1.0, 0.0, 0.0], 1e-2, hs.Ground(friction=friction))
    (jump,) = events(above, EventKind.PAINLEVE)
    normal, tangent = jump.impulse
    assert 0.0 < tangent < friction * normal
    # The impulse that stops the end: G λ = -w with the rod's own Delassus matrix.
    a, b = 0.5 * np.sin(pitch), 0.5 * np.cos(pitch)
    rows = np.array([[0.0, 1.0, a], [1.0, 0.0, -b]])
    delassus = rows @ np.diag([1.0, 1.0, 12.0]) @ rows.T
    exact = np.linalg.solve(delassus, [0.0, 1.0])
    np.testing.assert_allclose([normal, tangent], exact, atol=1e-8)
    energy = 0.5 * above.velocity**2 @ np.array([1.0, 1.0, 1.0 / 12.0]) + G * above.position[:, 1]
    assert np.all(energy <= 0.5 + G * q[1])


def test_several_solutions_are_reported() -> None:
    """Turning fast enough the rod's end may leave the ground or be jammed: it leaves, and says so.

    The end is lifted by l ω² cos φ - g > 0 without contact, while μ is beyond the critical one.
    """
    pitch, spin = 0.25 * np.pi, 9.0
    q = [0.5 * np.sin(pitch), 0.5 * np.cos(pitch), pitch]
    v = [-5.0, -0.5 * spin * np.sin(pitch), spin]
    run = simulate(mechanisms.rod(), q, v, 1e-3, hs.Ground(friction=1.8))
    (choice,) = events(run, EventKind.PAINLEVE)
    assert choice.impulse == (0.0, 0.0)
    assert 0.5 * spin**2 * np.cos(pitch) > G
    assert run.gap[-1, 0] > 1e-7


# --- Limit cycles --------------------------------------------------------------------------------


def wheel_cycle(gravity: float, slope: float, inertia: float) -> float:
    """Angular speed of the rimless wheel just after an impact, on its limit cycle.

    Angular momentum about the new foot, m l² cos 2α + I of what it will be about it, is kept; the
    speed lost is regained by 2 m g l sin α sin γ a step.
    """
    alpha = np.pi / 8.0
    kept = (inertia + np.cos(2.0 * alpha)) / (inertia + 1.0)
    gain = 4.0 * gravity * np.sin(alpha) * np.sin(slope) / (inertia + 1.0)
    return float(kept * np.sqrt(gain / (1.0 - kept**2)))


def roll(gravity: float, slope: float, inertia: float, speed: float, duration: float) -> hs.Run:
    """Roll the wheel downhill, starting just after an impact."""
    up = np.array([np.sin(slope), np.cos(slope)])
    hub = np.cos(np.pi / 8.0) * up
    foot_angle = np.pi / 8.0 - slope
    arm = -np.array([np.sin(foot_angle), -np.cos(foot_angle)])
    return simulate(
        mechanisms.rimless_wheel(inertia=inertia, gravity=gravity),
        [*hub, slope],
        [speed * arm[1], -speed * arm[0], speed],
        duration,
        hs.Ground(friction=3.0, slope=-slope),
        rtol=1e-11,
        atol=1e-13,
    )


def wheel_steps(run: hs.Run) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Durations of the steps, and speeds after their impacts."""
    times = [e.time for e in events(run, EventKind.TOUCHDOWN) if e.time > 1e-6]
    speeds = [run.velocity[around(run, time)[1], 2] for time in times]
    return np.diff([0.0, *times]), np.array(speeds)


@pytest.mark.parametrize(
    ("gravity", "slope", "speed", "period"),
    [(9.81, 0.08, 1.0954628396, 1.0345498114), (9.8, 0.15, 1.4972474413, 0.5266577771)],
)
def test_rimless_wheel(gravity: float, slope: float, speed: float, period: float) -> None:
    """Speed and period of the limit cycle, and the published ones of a wheel without inertia.

    Without inertia about its hub the wheel would have a singular mass matrix; speed and period are
    smooth in the inertia, so the published numbers are met by extrapolation from two small ones.
    """
    exact = wheel_cycle(gravity, slope, 0.01)
    periods, speeds = wheel_steps(roll(gravity, slope, 0.01, exact, 3.0 * period))
    np.testing.assert_allclose(speeds, exact, atol=1e-8)
    np.testing.assert_allclose(periods, periods[0], atol=1e-8)

    assert wheel_cycle(gravity, slope, 0.0) == pytest.approx(speed, abs=1e-10)
    small = []
    for inertia in (1e-5, 2e-5):
        start = wheel_cycle(gravity, slope, inertia)
        periods, speeds = wheel_steps(roll(gravity, slope, inertia, start, 1.2 * period))
        small.append((periods[0], speeds[0]))
    np.testing.assert_allclose(2.0 * np.array(small[0]) - small[1], [period, speed], atol=1e-8)


def test_multiplier_of_the_rimless_wheel() -> None:
    """In ω² the return map is linear with slope cos² 2α, and so at the fixed point in ω."""
    inertia = 0.01
    kept = (inertia + np.cos(np.pi / 4.0)) / (inertia + 1.0)
    fixed = wheel_cycle(9.81, 0.08, inertia)
    after = [
        wheel_steps(roll(9.81, 0.08, inertia, fixed + change, 1.3))[1][0]
        for change in (-1e-4, 1e-4)
    ]
    assert (after[1] - after[0]) / 2e-4 == pytest.approx(kept**2, abs=1e-5)


def compass_state(x: NDArray[np.float64]) -> hs.State:
    """State of the compass gait with its stance foot at the origin: (stance, swing, rates)."""
    stance, swing, stance_rate, swing_rate = x
    return hs.State(
        np.array([np.sin(stance), np.cos(stance), stance, swing]),
        np.array(
            [np.cos(stance) * stance_rate, -np.sin(stance) * stance_rate, stance_rate, swing_rate]
        ),
    )


def compass_step(
    x: NDArray[np.float64], gravity: float
) -> tuple[NDArray[np.float64], float, float]:
    """One step: the state after the next impact with legs exchanged, its time and length."""
    run = simulate(
        mechanisms.compass_gait(gravity),
        compass_state(x).q,
        compass_state(x).v,
        0.9,
        hs.Ground(friction=3.0, slope=-np.deg2rad(3.0)),
        rtol=1e-12,
        atol=1e-13,
        swing_feet_pass=True,
    )
    impact = events(run, EventKind.TOUCHDOWN, 1)[0]
    _, row = around(run, impact.time)
    q, v = run.position[row], run.velocity[row]
    stride = run.contact_point[row, 1] - run.contact_point[row, 0]
    return np.array([q[3], q[2], v[3], v[2]]), impact.time, float(np.hypot(*stride))


@pytest.mark.parametrize("angles", [(0.1, 0.3, -0.2, -1.0), (-0.1, -0.3, 0.5, 2.0)])
def test_legs_of_one_length_pass_wherever_they_are(angles: tuple[float, ...]) -> None:
    """The swing foot reaches the ground beside the stance foot, to rounding ahead or behind it.

    What rounding says is another thing at every place, and in the mirror.
    """
    for place in range(8):
        for side in (1.0, -1.0):
            state = compass_state(side * np.array(angles))
            run = simulate(
                mechanisms.compass_gait(), state.q + 0.37 * place * np.eye(4)[0], state.v, 0.4,
                hs.Ground(friction=3.0), swing_feet_pass=True,
            )  # fmt: skip
            assert not [e for e in run.events if e.time > 0.0], (place, side)


@pytest.mark.parametrize(
    ("gravity", "rates", "period"),
    [
        (9.8, (1.091826677, 0.377181558), 0.734720962),
        (9.81, (1.092383590, 0.377373949), 0.734346391),
    ],
)
def test_compass_gait(gravity: float, rates: tuple[float, float], period: float) -> None:
    """The published limit cycle is a fixed point; its numbers have nine decimals."""
    x = np.array([-0.218668803, 0.323388558, *rates])
    after, time, stride = compass_step(x, gravity)
    np.testing.assert_allclose(after, x, atol=1e-8)
    assert time == pytest.approx(period, abs=1e-8)
    assert stride == pytest.approx(0.535445415, abs=1e-8)


def test_multipliers_of_the_compass_gait() -> None:
    """Central differences of the return map on the section where both feet are on the ground."""
    slope = np.deg2rad(3.0)
    fixed = np.array([-0.218668803, 1.091826677, 0.377181558])

    def returned(y: NDArray[np.float64]) -> NDArray[np.float64]:
        x = np.array([y[0], -y[0] + 2.0 * slope, y[1], y[2]])
        after, _, _ = compass_step(x, 9.8)
        return after[[0, 2, 3]]

    change = 1e-4
    columns = [
        (returned(fixed + change * unit) - returned(fixed - change * unit)) / (2.0 * change)
        for unit in np.eye(3)
    ]
    multipliers = np.sort_complex(np.linalg.eigvals(np.array(columns).T))
    published = [-0.199726 - 0.544476j, -0.199726 + 0.544476j, 0.131573]
    np.testing.assert_allclose(multipliers, published, atol=1e-5)
