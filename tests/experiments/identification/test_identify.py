"""Numbers of robots from their motion: closed forms, another engine, and intervals that hold."""

from __future__ import annotations

import json
import math
import re
import tracemalloc
from dataclasses import replace
from functools import cache
from pathlib import Path

import mujoco
import numpy as np
import pytest
import walking
from typer.testing import CliRunner

import heelstrike as hs
from heelstrike.cli.main import app
from heelstrike.errors import GaitError, RobotError
from heelstrike.experiments.identification import GroundFriction, Identified, fitting
from heelstrike.experiments.identification.base_parameters import base_parameters
from heelstrike.experiments.identification.equations import Columns, Equations
from heelstrike.experiments.identification.figure import draw_identified
from heelstrike.experiments.identification.fitting import Fitting, Noise, _without_file
from heelstrike.experiments.identification.sliding import at_least, ground_friction, sliding
from heelstrike.experiments.identification.standing import pieces_of
from heelstrike.gait.recordings.robot_log import RobotLog, load_robot_log

pytestmark = pytest.mark.slow  # left to `make test` by continuous integration

GRAVITY = 9.81
NOISE = {"encoder_noise": 1e-4, "torque_noise": 0.2, "force_noise": 2.0}
EXACT = {"encoder_noise": 1e-8, "torque_noise": 1e-5, "force_noise": 1e-4, "knots": 0.02}


def pendulum(
    mass: float = 2.0, center: tuple[float, float] = (0.02, -0.4), inertia: float = 0.05
) -> hs.Robot:
    build = hs.RobotBuilder("pendulum")
    build.hinge("pivot", None, at=(0.0, 2.0), link="rod", mass=mass, inertia=inertia,
                center_of_mass=center, torque=np.inf)  # fmt: skip
    return build.build()


def swinging(count: int = 1500) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Time, angle, velocity and acceleration of two sines."""
    time = np.linspace(0.0, 3.0, count)
    waves = ((0.9, 4.0), (0.4, 9.0))
    return (
        time,
        sum(a * np.sin(w * time) for a, w in waves),  # type: ignore[return-value]
        sum(a * w * np.cos(w * time) for a, w in waves),
        sum(-a * w**2 * np.sin(w * time) for a, w in waves),
    )


def of_pendulum(**noise: float) -> Identified:
    """What a pendulum tells."""
    return hs.identify(pendulum(), log_of_pendulum(**noise), **noise)


def log_of_pendulum(**noise: float) -> RobotLog:
    """The motion of a pendulum whose torque is the textbook's, with friction of its pivot.

    About +y, with the centre of mass at (c_x, c_z) from the pivot as it hangs: J θ̈ = Γ − d θ̇ −
    c sign θ̇ + m g (c_x cos θ + c_z sin θ).
    """
    time, angle, velocity, acceleration = swinging()
    moment, hx, hz, damping, dry = 0.41, 0.06, -0.9, 0.3, 0.5
    weight = GRAVITY * (hx * np.cos(angle) + hz * np.sin(angle))
    torque = moment * acceleration - weight + damping * velocity + dry * np.sign(velocity)
    rng = np.random.default_rng(1)  # for intervals only
    measured = angle + noise.get("encoder_noise", 0.0) * rng.standard_normal(len(time))
    torque = torque + noise.get("torque_noise", 0.0) * rng.standard_normal(len(time))
    return RobotLog(time, measured[:, None], torque[:, None])


PENDULUM = {
    "first moment x of rod": 0.06, "first moment z of rod": -0.9, "moment of inertia of rod": 0.41,
    "damping of pivot": 0.3, "dry friction of pivot": 0.5,
}  # fmt: skip


def test_a_pendulum_has_the_base_parameters_of_the_textbook() -> None:
    """Its mass by itself never shows; the rotor turns as the rod does."""
    found = of_pendulum(**EXACT)
    values = {each.name.replace("rotor inertia of pivot", "moment of inertia of rod"): each.value
              for each in found.numbers}  # fmt: skip
    assert values == pytest.approx(PENDULUM, abs=1e-4)
    assert any("mass of rod: no motion" in each for each in found.hidden)
    inertia = next(each for each in found.numbers if "inertia" in each.name)
    assert [share for share, _ in inertia.others] == pytest.approx([1.0])


def test_intervals_of_a_pendulum_are_those_of_its_noise() -> None:
    """Of 0.1 N m on 1500 samples alone, by the normal equations of the closed form."""
    noise = {"encoder_noise": 1e-6, "torque_noise": 0.1, "knots": 0.03}
    found = of_pendulum(**noise)
    _, angle, velocity, acceleration = swinging()
    columns = {
        "first moment x of rod": -GRAVITY * np.cos(angle),
        "first moment z of rod": -GRAVITY * np.sin(angle), "inertia": acceleration,
        "damping of pivot": velocity, "dry friction of pivot": np.sign(velocity),
    }  # fmt: skip
    matrix = np.column_stack(list(columns.values()))
    spread = 0.1 * np.sqrt(np.diag(np.linalg.inv(matrix.T @ matrix)))
    expected = dict(zip(columns, spread, strict=True))
    for each in found.numbers:
        name = "inertia" if "inertia" in each.name else each.name
        assert each.deviation == pytest.approx(expected[name], rel=0.02)
        assert abs(each.value - PENDULUM.get(each.name, 0.41)) < 4.0 * each.deviation
    assert found.misfit == pytest.approx(1.0, abs=0.15)


def test_two_files_of_one_robot_give_the_same_values_and_intervals() -> None:
    """With noise so large that a file that counted as an observation would move them by 3 %."""
    noise = {"encoder_noise": 1e-4, "torque_noise": 60.0}
    one, other = (
        hs.identify(file, log_of_pendulum(**noise), **noise).numbers
        for file in (pendulum(), pendulum(1.4, center=(0.04, -0.55), inertia=0.08))
    )
    for a, b in zip(one, other, strict=True):
        assert a.name == b.name
        assert a.value == pytest.approx(b.value, abs=5e-3 * a.deviation), a.name
        assert a.deviation == pytest.approx(b.deviation, rel=5e-3), a.name
    assert any(a.assumed != b.assumed for a, b in zip(one, other, strict=True))


def test_a_joint_that_rests_tells_nothing() -> None:
    """Its dry friction may hold whatever its weight does not."""
    time = np.linspace(0.0, 2.0, 400)
    torque = np.full((400, 1), GRAVITY * 0.8)
    angle = np.full((400, 1), 0.5 * np.pi)
    found = hs.identify(pendulum(), RobotLog(time, angle, torque), **EXACT)
    assert not any(each.told for each in found.numbers)
    hidden = " ".join(found.hidden)
    for name in ("damping of pivot", "dry friction of pivot", "first moment z of rod"):
        assert f"{name}: this motion hardly depends on it" in hidden


ARM = """
<mujoco model="arm"><compiler angle="radian"/><option gravity="0 0 -9.81"/><worldbody>
  <body name="upper" pos="0 0 2"><joint name="shoulder" type="hinge" axis="0 1 0" damping="0.2"
    armature="0.03"/><inertial pos="0.02 0 -0.2" mass="1.7" diaginertia="0.06 0.06 0.06"/>
    <body name="lower" pos="0.03 0 -0.5">
      <joint name="elbow" type="hinge" axis="0 1 0" damping="0.1"/>
      <inertial pos="-0.01 0 -0.15" mass="0.9" diaginertia="0.02 0.02 0.02"/></body></body>
</worldbody><actuator><motor name="shoulder" joint="shoulder"/><motor name="elbow" joint="elbow"/>
</actuator></mujoco>
"""  # fmt: skip


def test_torques_of_another_engine_tell_its_numbers(tmp_path: Path) -> None:
    """MuJoCo's inverse dynamics of an arm, for a file that has other masses."""
    file = tmp_path / "arm.xml"
    file.write_text(ARM.replace('mass="1.7"', 'mass="1.2"').replace('mass="0.9"', 'mass="1.5"'))
    model = mujoco.MjModel.from_xml_string(ARM)
    data = mujoco.MjData(model)
    time, *first = swinging()
    second = [0.6 * np.cos(5.3 * time), -0.6 * 5.3 * np.sin(5.3 * time),
              -0.6 * 5.3**2 * np.cos(5.3 * time)]  # fmt: skip
    theta = [np.column_stack(pair) for pair in zip(first, second, strict=True)]
    torque = np.empty_like(theta[0])
    for row in range(len(time)):
        data.qpos[:], data.qvel[:], data.qacc[:] = (each[row] for each in theta)
        mujoco.mj_inverse(model, data)
        torque[row] = data.qfrc_inverse
    found = hs.identify(hs.load_robot(file), RobotLog(time, theta[0], torque), **EXACT)
    truth = hs.load_robot(_written(tmp_path / "true.xml", ARM))
    exact = hs.identify(truth, RobotLog(time, theta[0], torque), **EXACT)
    assert [each.name for each in found.numbers] == [each.name for each in exact.numbers]
    for each, true in zip(found.numbers, exact.numbers, strict=True):
        assert each.value == pytest.approx(true.assumed, abs=2e-3), each.name


def _written(path: Path, text: str) -> Path:
    path.write_text(text)
    return path


def test_columns_along_a_walk_are_the_torques_and_forces_of_the_walk() -> None:
    """Of a simulated walk, whose torques and contact forces the simulator wrote."""
    found = hs.identify(walking.bravo7(), measured_walk(), **NOISE)
    assert found.misfit < 0.01
    for _, torque, made in found.torque:
        assert np.abs(torque - made).max() < 0.1


@pytest.mark.parametrize("foot", [0, 1])
def test_slopes_are_differences_of_columns(foot: int) -> None:
    """Wherever the numbers are: of links off their axes and joints with rotors and dampers, too."""
    equations, rng = Equations(walking.bravo7()), np.random.default_rng(foot)
    theta = [scale * rng.standard_normal((3, 6)) for scale in (0.5, 2.0, 8.0)]
    known = equations.unknowns.of(walking.bravo7().model)
    values = known + 0.2 * rng.uniform(0.5, 1.0, len(known))
    at = equations.columns((theta[0], theta[1], theta[2]), foot)
    slopes = equations.slopes(at, values, foot)
    held = equations.held_rows(foot)
    forces = np.linalg.pinv(trunk_rows(at, held)) @ (at.ground @ values)[:, :, None]
    step = 1e-6
    for order in range(3):
        for joint in range(6):
            ends = []
            for sign in (-1.0, 1.0):
                moved = [np.array(each) for each in theta]
                moved[order][:, joint] += sign * step
                there = equations.columns((moved[0], moved[1], moved[2]), foot)
                lacks = there.ground @ values - (trunk_rows(there, held) @ forces)[:, :, 0]
                ends.append((there.motors @ values, lacks))
            motors, ground = ((ends[1][k] - ends[0][k]) / (2.0 * step) for k in range(2))
            np.testing.assert_allclose(slopes.motors[order][:, :, joint], motors, atol=2e-5)
            np.testing.assert_allclose(slopes.ground[order][:, :, joint], ground, atol=2e-5)


def trunk_rows(at: Columns, held: list[int]) -> np.ndarray:
    """What forces of the contact points of a foot do to the trunk, (n, 3, held)."""
    return np.swapaxes(at.rows[:, held, :3], 1, 2)


STEPS, RATE = 4, 250.0


@cache
def measured_walk() -> RobotLog:
    """A walk without noise, event-driven: its accelerations are those of the equations."""
    run = hs.simulate(
        walking.bravo7(), hs.ComputedTorque(walking.bravo7(), walking.gait()),
        state=walking.gait().initial_state, duration=STEPS * walking.STEP_DURATION,
        method=hs.EventDriven(output_period=1.0 / RATE), ground=hs.Ground(friction=0.75),
    )  # fmt: skip
    log = RobotLog.of(run)
    rows = np.abs(log.time * RATE - np.round(log.time * RATE)) < 1e-6
    return replace(log, **{name: getattr(log, name)[rows] for name in
                           ("time", "joints", "torque", "force", "trunk")})  # fmt: skip


def noisy(log: RobotLog, seed: int, times: float = 1.0) -> RobotLog:
    rng = np.random.default_rng(seed)
    size = {"joints": 1e-4, "torque": 0.2, "force": 2.0, "trunk": 1e-4}
    return replace(log, **{name: getattr(log, name) + times * each * rng.standard_normal(
        getattr(log, name).shape) for name, each in size.items()})  # fmt: skip


def wrong_file() -> hs.Robot:
    robot, rng = walking.bravo7(), np.random.default_rng(0)
    wrong = ("mass", "center_of_mass", "inertia")
    numbers = {name: each * rng.uniform(0.8, 1.2, each.shape)
               for name, each in robot.model.members().items() if name in wrong}  # fmt: skip
    return replace(robot, model=robot.model.replaced(**numbers))


def test_a_noisy_walk_tells_a_robot_whose_file_is_wrong() -> None:
    """Errors are as large as their intervals say; most of them are far less than the file's."""
    known = hs.identify(walking.bravo7(), measured_walk(), **NOISE)
    true = [each.assumed for each in known.numbers]
    found = hs.identify(wrong_file(), noisy(measured_walk(), 3), **NOISE)
    errors = np.array([(each.value - t) / each.deviation
                       for each, t in zip(found.numbers, true, strict=True)])  # fmt: skip
    assert np.abs(errors).max() < 4.5
    assert np.mean(errors**2) == pytest.approx(1.0, abs=0.9)
    assert found.misfit == pytest.approx(1.0, abs=0.05)
    assert not found.friction.samples
    assert "not visible" in str(found.friction)
    assert str(found).count("±") == sum(each.told for each in found.numbers)


def test_noise_of_the_motion_tells_nothing() -> None:
    """Intervals are as wide as along the true motion; of a foot's inertia they are the file's.

    Feet hardly turn. Along motions that noise moves they do, and columns seem to tell a moment of
    inertia seven times as well; other numbers of the foot would then be told too well by half.
    """
    clean = hs.identify(walking.bravo7(), measured_walk(), **NOISE)
    found = hs.identify(wrong_file(), noisy(measured_walk(), 6), **NOISE)
    for told, true in zip(found.numbers, clean.numbers, strict=True):
        assert told.deviation == pytest.approx(true.deviation, rel=0.2 if not true.told else 0.05)
    size = {"moment of inertia of right_foot", "moment of inertia of left_foot"}
    assert size == {each.name for each in found.numbers if not each.told} & size
    assert size <= {each.partition(":")[0] for each in found.hidden}


@pytest.mark.parametrize("times", [1.0, 2.0])
def test_errors_are_as_large_as_the_covariance_without_the_file_says(times: float) -> None:
    """Of a linear problem by chance: three numbers, of which a motion tells two combinations.

    The true motion has information D; noise of the curves seems to add C, on the third by far
    more than the file knows. All noise is larger than told by a factor, so that the curves move
    by as much, too.
    """
    rng, variance = np.random.default_rng(4), times**2
    ways = rng.standard_normal((3, 3))
    true = ways.T @ np.diag([2e5, 9e5, 0.0]) @ ways
    noise = ways.T @ np.diag([2.0, 9.0, 400.0]) @ ways
    spread = rng.standard_normal((3, 3))
    file = np.linalg.inv(spread @ spread.T)
    seen, begun = true + variance * noise, rng.standard_normal(3)
    shaken = times * np.linalg.cholesky(seen)
    squares = []
    for _ in range(2000):
        real = begun + spread @ rng.standard_normal(3)
        pull = true @ real - shaken @ rng.standard_normal(3)
        likeliest = np.linalg.solve(true + file, pull + file @ begun)
        found, covariance = _without_file(seen, noise, file, likeliest, begun, variance)
        squares.append((found - real) @ np.linalg.solve(covariance, found - real))
    assert np.mean(squares) == pytest.approx(3.0, rel=0.05)


def test_what_curves_alone_seem_to_tell_stays_as_the_file_has_it() -> None:
    """Its value and its tolerance; what the motion tells moves by a thousandth of the file."""
    seen, noise, file = np.diag([1000.0, 20.0]), np.diag([1.0, 19.0]), np.diag([1.0, 2.0])
    begun, seems = np.array([0.3, 0.7]), np.array([1.0, 5.0])
    likeliest = np.linalg.solve(seen + file, seen @ seems + file @ begun)
    found, covariance = _without_file(seen, noise, file, likeliest, begun, 1.0)
    assert found == pytest.approx([1.0, 0.7], abs=1e-5)
    assert covariance == pytest.approx(np.diag([1e-3, 0.5]), rel=3e-3)


def known_of(robot: hs.Robot) -> np.ndarray:
    return Equations(robot).unknowns.of(robot.model)


def fitting_of(robot: hs.Robot, log: RobotLog, noise: float, again: int = 1) -> Fitting:
    """The fit of a walk, with noise a number of times as large, of its pieces again and again."""
    equations = Equations(robot)
    return Fitting(
        equations, log, pieces_of(equations, measured_walk(), 2.0) * again,
        base_parameters(equations, [0, 1], ground=True),
        Noise(np.full(6, noise * 1e-4), noise * 0.2, noise * 2.0), knots=0.06, longest_delay=0.0,
    )  # fmt: skip


@pytest.mark.slow
def test_the_work_of_a_long_motion_takes_hardly_more_memory() -> None:
    """Beyond the recording: for each second of it, what is compared and the curves."""
    robot, log, peaks = walking.bravo7(), measured_walk(), []
    for again in (1, 1, 6):  # once before, so that what is kept once and for all is there
        tracemalloc.start()
        fitting_of(robot, log, 1.0, again).solve(known_of(robot))
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    pieces = pieces_of(Equations(robot), log, 2.0)
    seconds = sum(float(log.time[each.end - 1] - log.time[each.first]) for each in pieces)
    assert (peaks[2] - peaks[1]) / (5.0 * seconds) < 4e5  # bytes


def test_without_forces_the_ground_is_eliminated() -> None:
    log = replace(noisy(measured_walk(), 5), force=None, trunk=None)
    true = hs.identify(walking.bravo7(), log, **NOISE).numbers
    found = hs.identify(wrong_file(), log, **NOISE).numbers
    for each, t in zip(found, true, strict=True):
        assert abs(each.value - t.assumed) < 4.5 * each.deviation, each.name


def test_the_noise_of_encoders_is_told_by_their_roughness() -> None:
    known = hs.identify(walking.bravo7(), noisy(measured_walk(), 3), **NOISE)
    told = hs.identify(walking.bravo7(), noisy(measured_walk(), 3), torque_noise=0.2)
    for one, other in zip(known.numbers, told.numbers, strict=True):
        assert other.deviation == pytest.approx(one.deviation, rel=0.2)


def test_noise_that_is_twice_as_large_as_told_makes_the_intervals_of_its_true_size(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Of what only seems to be told, too: curves move twice as far as they are said to.

    Of the same samples: where a foot stands and a joint rests is looked for by the noise that is
    told.
    """
    monkeypatch.setattr(fitting, "RESTING", 0.0)
    log, known = noisy(measured_walk(), 3, 2.0), known_of(wrong_file())
    honest, proud = (fitting_of(wrong_file(), log, times).solve(known) for times in (2.0, 1.0))
    assert proud.misfit == pytest.approx(4.0, rel=0.05)
    spread = np.sqrt(np.diag(honest.covariance))
    np.testing.assert_allclose(np.sqrt(np.diag(proud.covariance)), spread, rtol=0.05)
    np.testing.assert_array_less(np.abs(proud.values - honest.values), 0.1 * spread)


@pytest.mark.slow
def test_noise_that_is_larger_than_told_widens_intervals() -> None:
    log = noisy(measured_walk(), 3)
    honest = hs.identify(walking.bravo7(), log, **NOISE)
    proud = hs.identify(walking.bravo7(), log, **NOISE | {"torque_noise": 0.1, "force_noise": 1.0})
    assert proud.misfit > 1.3
    assert np.median([p.deviation / h.deviation for p, h in
                      zip(proud.numbers, honest.numbers, strict=True)]) > 0.5  # fmt: skip


def test_a_delay_of_the_motors_is_found() -> None:
    """Commands come 4 ms before what they do: a row of the table at 250 rows a second."""
    log = noisy(measured_walk(), 4)
    early = replace(log, torque=np.vstack([log.torque[1:], log.torque[-1:]]))
    found = hs.identify(walking.bravo7(), early, longest_delay=0.02, **NOISE)
    assert found.delay == pytest.approx(1.0 / RATE, abs=4.0 * found.delay_deviation)
    assert found.delay_deviation < 1e-3
    assert "delay of the motors: 4" in str(found)


@pytest.mark.parametrize("friction", [0.1, 0.15])
def test_friction_shows_where_a_foot_slides(friction: float) -> None:
    """A walk on ground that is too slippery for it."""
    run = hs.simulate(
        walking.bravo7(), hs.ComputedTorque(walking.bravo7(), walking.gait()),
        state=walking.gait().initial_state, duration=3 * walking.STEP_DURATION,
        ground=hs.Ground(friction=friction),
    )  # fmt: skip
    found = hs.identify(walking.bravo7(), noisy(RobotLog.of(run), 1), **NOISE).friction
    assert found.samples > 10
    assert found.value == pytest.approx(friction, rel=0.05)


def on_two_feet(speed: float, lasts: int, stops: int = 0) -> RobotLog:
    """Bravo7 stands, and slides forward from sample 30 on for so many; in the middle it may stop.

    The ground's friction of 0.4 is used while it slides, a quarter of it while it stands.
    """
    robot, count, rate = walking.bravo7(), 90, 125.0
    goes = np.zeros(count - 1, dtype=bool)
    goes[30 : 30 + lasts] = True
    middle = 30 + (lasts - stops) // 2
    goes[middle : middle + stops] = False
    slides = np.append(goes, False) | np.insert(goes, 0, False)
    q = np.tile(robot.reference_state().q, (count, 1))
    q[1:, 0] += np.cumsum(goes * speed / rate)
    normal = np.full((count, robot.nc), robot.total_mass * GRAVITY / robot.nc)
    force = np.stack([normal, -np.where(slides, 0.4, 0.1)[:, None] * normal], axis=2)
    torque = np.zeros((count, robot.nu))
    return RobotLog(np.arange(count) / rate, q[:, 3:], torque, force, q[:, :3])


def seen_of(log: RobotLog, seed: int, robot: hs.Robot | None = None) -> GroundFriction:
    """What is told of the ground, with noise."""
    equations, measured = Equations(robot or walking.bravo7()), noisy(log, seed)
    senses = sliding(equations, measured, np.full(6, 1e-4), 2.0)
    return ground_friction(equations, measured, senses, 2.0)


@pytest.mark.parametrize(("speed", "lasts"), [(0.6, 2), (-0.4, 3), (0.2, 6), (0.1, 12)])
def test_short_slides_show_friction(speed: float, lasts: int) -> None:
    """Of 16 ms and more, at 125 samples a second: within 5 %, and nothing where it stands."""
    log = on_two_feet(abs(speed), lasts)
    if speed < 0.0:
        assert log.trunk is not None
        assert log.force is not None
        start = log.trunk[0] * [1.0, 0.0, 0.0]
        log = replace(log, trunk=log.trunk * [-1.0, 1.0, 1.0] + 2.0 * start,
                      force=log.force * [1.0, -1.0])  # fmt: skip
    for seed in range(5):
        found = seen_of(log, seed)
        assert 4 <= found.samples <= 4 * (lasts - 1)
        assert found.value == pytest.approx(0.4, rel=0.05)
        assert abs(found.value - 0.4) < 4.0 * found.deviation


def test_a_stop_between_two_slides_is_not_taken_for_a_slide() -> None:
    """It lasts for two samples, in which the ground needs less than its friction."""
    for seed in range(5):
        found = seen_of(on_two_feet(0.2, 12, stops=2), seed)
        assert found.value == pytest.approx(0.4, rel=0.02)


@pytest.mark.parametrize(("speed", "lasts"), [(0.6, 0), (0.6, 1), (0.01, 50)])
def test_friction_that_does_not_show_is_bounded(speed: float, lasts: int) -> None:
    """Nothing slides, or for one sample only, or as slowly as feet that stand."""
    found = seen_of(on_two_feet(speed, lasts), 1)
    assert found.samples == 0
    bound = float(re.findall(r"it is ([0-9.]+) at least", str(found))[0])
    used = 0.4 if lasts else 0.1
    assert used - 0.1 < bound <= found.at_least <= used
    assert "no foot slides so far and so fast that it shows" in str(found)


def test_friction_is_hardly_ever_less_than_what_forces_are_said_to_have_used() -> None:
    """A minute at 125 Hz of four points that use it to the full, lightly loaded: 95 % and more."""
    true, force = 0.396, np.zeros((7500, 4, 2))
    scale = np.array([1.0, 1.0, 0.5, 0.0])
    force[:, :, 0], force[:, :, 1] = 60.0, -60.0 * true * scale
    force[::2] = 0.0  # in the air
    bounds = []
    for seed in range(100):
        noise = 2.0 * np.random.default_rng(seed).standard_normal(force.shape)
        bounds.append(at_least(force + noise, scale, 2.0))
    assert np.count_nonzero(np.array(bounds) > true) <= 5
    assert min(bounds) > true - 0.08


def test_a_bound_is_told_in_two_digits_of_which_none_is_rounded_up() -> None:
    told = str(GroundFriction(math.nan, math.nan, 0, "for nothing", 0.3979))
    assert told.endswith("not visible, for nothing; it is 0.39 at least, which forces have used")


def test_friction_has_a_bound_where_nobody_knows_where_the_trunk_is() -> None:
    log = replace(on_two_feet(0.6, 9), trunk=None)
    found = ground_friction(Equations(walking.bravo7()), log, None, 2.0)
    assert found.samples == 0
    assert 0.3 < found.at_least < 0.4
    assert "where the trunk is is not in the recording; it is 0.3" in str(found)
    without = ground_friction(Equations(walking.bravo7()), replace(log, force=None), None, 2.0)
    assert math.isnan(without.at_least)
    assert "at least" not in str(without)


@pytest.mark.filterwarnings("error")
def test_points_without_friction_tell_nothing_of_it() -> None:
    """Two of four wheels that roll: what slides are the others."""
    robot, log = walking.bravo7(), on_two_feet(0.6, 6)
    assert log.force is not None
    for scale, samples in (([1.0, 0.0, 1.0, 0.0], 10), ([0.0] * 4, 0)):
        rolls = replace(robot, model=robot.model.replaced(friction_scale=np.array(scale)))
        force = log.force * np.stack([np.ones(4), scale], axis=1)
        for seed in range(5):
            found = seen_of(replace(log, force=force), seed, rolls)
            assert found.samples <= samples
            assert (found.samples == 0) == (samples == 0)
            if samples:
                assert abs(found.value - 0.4) < 4.0 * found.deviation


def test_a_table_of_a_run_is_read_as_the_run_is(tmp_path: Path) -> None:
    run = walking.walk(steps=2)
    file = tmp_path / "run.csv"
    run.save(file)
    read, own = load_robot_log(file, walking.bravo7()), RobotLog.of(run)
    for name in ("time", "joints", "torque", "force", "trunk"):
        np.testing.assert_array_equal(getattr(read, name), getattr(own, name), err_msg=name)
    figure = tmp_path / "f.png"
    told = CliRunner().invoke(app, ["identify", str(file), "--json", "--figure", str(figure)])
    assert told.exit_code == 0, told.output
    assert {"numbers", "friction", "not_told", "misfit"} <= json.loads(told.stdout).keys()
    assert figure.stat().st_size > 10_000


def test_its_figure_names_every_number_that_is_told() -> None:
    found = of_pendulum(**EXACT)
    figure = draw_identified(found)
    words = {text.get_text() for axes in figure.axes for text in axes.get_yticklabels()}
    assert {each.name for each in found.numbers if each.told} <= words


@pytest.mark.parametrize(
    ("given", "error", "words"),
    [
        ({"torque_noise": 0.0}, hs.SimulationError, "torque_noise must be a positive number"),
        ({"longest_delay": -1.0}, hs.SimulationError, "longest_delay"),
    ],
)
def test_what_makes_no_sense_is_refused(
    given: dict[str, float], error: type[Exception], words: str
) -> None:
    with pytest.raises(error, match=words):
        hs.identify(walking.bravo7(), measured_walk(), **given)


def test_robots_that_it_does_not_know_are_refused(tmp_path: Path) -> None:
    compass = hs.load_robot("rabbit")
    time = np.linspace(0.0, 1.0, 50)
    log = RobotLog(time, np.zeros((50, compass.nv - 3)), np.zeros((50, compass.nu)))
    with pytest.raises(RobotError, match="feet must be flat"):
        hs.identify(compass, log)
    standing = replace(measured_walk(), joints=np.zeros_like(measured_walk().joints))
    with pytest.raises(hs.SimulationError, match="never stands flat on one foot"):
        hs.identify(walking.bravo7(), standing)
    file = tmp_path / "lacks.csv"
    file.write_text("time,right_hip\n" + "".join(f"{i},0\n" for i in range(9)))
    with pytest.raises(GaitError, match="no column 'position right_knee'"):
        load_robot_log(file, walking.bravo7())


def a_table(path: Path, columns: dict[str, np.ndarray]) -> Path:
    rows = zip(*(each.tolist() for each in columns.values()), strict=True)
    lines = [",".join(columns), *(",".join(map(repr, row)) for row in rows)]
    path.write_text("\n".join(lines) + "\n")
    return path


def test_a_table_of_an_event_driven_run_has_rows_at_one_time(tmp_path: Path) -> None:
    gait = walking.gait()
    run = hs.simulate(
        walking.bravo7(), hs.ComputedTorque(walking.bravo7(), gait), state=gait.initial_state,
        duration=1.1 * gait.step_duration, method=hs.EventDriven(),
    )  # fmt: skip
    assert np.any(np.diff(run.time) == 0.0)
    run.save(tmp_path / "run.csv")
    read, own = load_robot_log(tmp_path / "run.csv", walking.bravo7()), RobotLog.of(run)
    for name in ("time", "joints", "torque", "force", "trunk"):
        np.testing.assert_array_equal(getattr(read, name), getattr(own, name), err_msg=name)


def slide_and_hinge() -> hs.Robot:
    build = hs.RobotBuilder("cart")
    build.slide("rail", None, direction=(1.0, 0.0), link="cart", mass=1.0, torque=9.0)
    build.hinge("pole", "cart", link="rod", mass=0.2, inertia=0.01, torque=9.0)
    return build.build()


def of_cart() -> dict[str, np.ndarray]:
    time = np.linspace(0.0, 1.0, 20)
    return {"time": time, "rail": time, "pole": 2.0 * time, "torque rail": time,
            "torque pole": time}  # fmt: skip


def test_degrees_are_of_hinges_only(tmp_path: Path) -> None:
    columns = of_cart()
    file = a_table(tmp_path / "cart.csv", columns)
    log = load_robot_log(file, slide_and_hinge(), unit="deg")
    np.testing.assert_allclose(log.joints[:, 0], columns["rail"], rtol=1e-15)
    np.testing.assert_allclose(log.joints[:, 1], np.radians(columns["pole"]), rtol=1e-15)


@pytest.mark.parametrize("name", ["pole [mm]", "rail [deg]", "torque pole [s]", "time [deg]"])
def test_units_of_another_kind_are_refused(tmp_path: Path, name: str) -> None:
    plain = name.partition(" [")[0]
    columns = {name if each == plain else each: of for each, of in of_cart().items()}
    with pytest.raises(GaitError, match="is wanted"):
        load_robot_log(a_table(tmp_path / "cart.csv", columns), slide_and_hinge())


@pytest.mark.parametrize("lacks", ["position root_z", "contact_force right_foot_heel tangent"])
def test_some_columns_of_forces_or_of_the_trunk_are_not_enough(tmp_path: Path, lacks: str) -> None:
    robot, log = walking.bravo7(), measured_walk()
    assert log.force is not None
    assert log.trunk is not None
    columns = {"time": log.time}
    columns |= dict(zip(robot.joint_names[3:], log.joints.T, strict=True))
    columns |= {f"torque {n}": t for n, t in zip(robot.actuator_names, log.torque.T, strict=True)}
    columns |= {f"position {n}": t for n, t in zip(robot.joint_names[:3], log.trunk.T, strict=True)}
    for i, point in enumerate(robot.contact_names):
        for k, component in enumerate(("normal", "tangent")):
            columns[f"contact_force {point} {component}"] = log.force[:, i, k]
    whole = load_robot_log(a_table(tmp_path / "all.csv", columns), robot)
    assert whole.force is not None
    del columns[lacks]
    with pytest.raises(GaitError, match=f"no column '{lacks}'"):
        load_robot_log(a_table(tmp_path / "some.csv", columns), robot)


def test_a_run_on_a_slope_is_refused() -> None:
    robot = walking.bravo7()
    run = hs.simulate(
        robot, state=robot.standing(hs.Ground()), duration=0.01, ground=hs.Ground(slope=0.05)
    )
    with pytest.raises(hs.SimulationError, match="level ground"):
        hs.identify(robot, run)


def of_textbook(count: int = 300) -> RobotLog:
    """A pendulum of 0.9 kg m and 0.41 kg m² without friction."""
    time, angle, _, acceleration = swinging(count)
    torque = 0.41 * acceleration + GRAVITY * 0.9 * np.sin(angle)
    return RobotLog(time, angle[:, None], torque[:, None])


FINE = of_textbook()
BROKEN = {
    "log must be a RobotLog or a Run, got dict": {"time": FINE.time},
    "the log's joints must have shape": replace(FINE, joints=FINE.joints[:, 0]),
    "the log's torque must have shape": replace(FINE, torque=FINE.torque[:-1]),
    "the log's joints has no number in row 7": replace(
        FINE, joints=np.where(np.arange(300) == 7, np.nan, FINE.joints.T).T
    ),
    "does not go on in row 1": replace(FINE, time=FINE.time[::-1]),
    "the log has 9 rows": of_textbook(9),
    "at least 10 are wanted in each second": of_textbook(20),
    "joint 'pivot' reads the same all along": replace(FINE, joints=0.0 * FINE.joints + 0.3),
}


@pytest.mark.parametrize("words", BROKEN)
def test_what_is_no_log_of_the_robot_is_refused(words: str) -> None:
    with pytest.raises(hs.SimulationError, match=words):
        hs.identify(pendulum(), BROKEN[words])  # type: ignore[arg-type]


def test_delays_are_shorter_than_half_a_piece_and_one_at_the_bound_is_told() -> None:
    exact = {"encoder_noise": 1e-6, "torque_noise": 1e-3, "knots": 0.02}
    with pytest.raises(hs.SimulationError, match="longest piece of the motion lasts"):
        hs.identify(pendulum(), FINE, longest_delay=0.6, **exact)
    late = 20  # samples of 2 ms, which torques are told too early
    log = of_textbook(1500)
    early = RobotLog(log.time[late:], log.joints[late:], log.torque[:-late])
    ahead = RobotLog(log.time[:-late], log.joints[:-late], log.torque[late:])
    for each in (early, ahead):
        found = hs.identify(pendulum(), each, longest_delay=0.004, **exact)
        assert abs(found.delay) == 0.004
        assert any("give a larger longest_delay" in line for line in found.hidden)
    found = hs.identify(pendulum(), log, longest_delay=0.004, **exact)
    assert not any("longest_delay" in line for line in found.hidden)
