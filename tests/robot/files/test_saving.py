"""Round trips: a robot written to a file and read again moves as it did."""

from __future__ import annotations

import warnings
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
from random_trees import random_tree

from heelstrike import dynamics
from heelstrike.errors import RobotError
from heelstrike.robot import (
    Robot,
    RobotBuilder,
    RobotWarning,
    builtin_robots,
    human,
    load_robot,
    read_mjcf,
)
from heelstrike.robot.library import NO_CONTACTS, NO_MOTORS

TOLERANCE = 1e-12  # relative; all digits are written, so that only sums in another order differ


def quiet(text: str) -> Robot:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RobotWarning)
        return read_mjcf(text)


def again(robot: Robot, path: Path) -> Robot:
    """Save and load, without a warning but those that a random tree earns at any rate."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.filterwarnings("ignore", message=f".*({NO_MOTORS}|{NO_CONTACTS})")
        warnings.filterwarnings("ignore", message=".*gaits and walking controllers need them so")
        return load_robot(robot.save(path))


def assert_same_dynamics(one: Robot, other: Robot, *, states: int = 5) -> None:
    """Mass matrix, bias, passive force and contact points on the same coordinates."""
    assert (one.nv, one.nu, one.nc) == (other.nv, other.nu, other.nc)
    draw = np.random.default_rng(0)
    for _ in range(states):
        q, v = draw.normal(size=one.nv), draw.normal(size=one.nv)
        for query in (
            lambda robot, q=q: dynamics.mass_matrix(robot, q),
            lambda robot, q=q, v=v: dynamics.bias_force(robot, q, v),
            lambda robot, q=q, v=v: dynamics.passive_force(robot, q, v),
            lambda robot, q=q: dynamics.contact_positions(robot, q),
        ):
            expected, found = query(one), query(other)
            scale = max(np.abs(expected).max(initial=0.0), 1.0)
            np.testing.assert_allclose(found, expected, rtol=0, atol=TOLERANCE * scale)


EXACT = ("axis", "armature", "damping", "stiffness", "rest", "dry_friction", "lower", "upper")
ALSO_EXACT = ("speed_limit", "torque_lower", "torque_upper", "actuator_joint", "contact_radius")


@pytest.mark.parametrize("name", builtin_robots())
def test_library_through_mjcf(name: str, tmp_path: Path) -> None:
    robot = load_robot(name)
    back = again(robot, tmp_path / "r.xml")
    assert_same_dynamics(robot, back)
    for field in (*EXACT, *ALSO_EXACT, "reference", "parent", "gravity"):
        np.testing.assert_array_equal(
            getattr(back.model, field), getattr(robot.model, field), err_msg=field
        )
    for field in ("name", "joint_names", "link_names", "actuator_names", "contact_names"):
        assert getattr(back, field) == getattr(robot, field), field
    assert (back.feet, back.floating) == (robot.feet, robot.floating)
    assert back.contact_friction == robot.contact_friction
    assert (back.mirror is None) == (robot.mirror is None)
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "r.xml"))
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data)
    assert np.all(np.isfinite(data.qacc))


WITHOUT_LATCHES = [name for name in builtin_robots() if name != "kneed_walker"]
"""Latches are lost by URDF and SDF, which say so."""


@pytest.mark.parametrize("ending", ["urdf", "sdf"])
@pytest.mark.parametrize("name", WITHOUT_LATCHES)
def test_library_through_urdf_and_sdf(name: str, ending: str, tmp_path: Path) -> None:
    """walker2d has motor inertia: URDF holds it as a transmission, SDF as Drake writes it."""
    robot = replace(load_robot(name), outlines=())  # which neither can hold
    back = again(robot, tmp_path / f"r.{ending}")
    assert_same_dynamics(robot, back)
    for field in (*EXACT, *ALSO_EXACT, "parent", "gravity"):
        np.testing.assert_array_equal(
            getattr(back.model, field), getattr(robot.model, field), err_msg=field
        )
    for field in ("name", "joint_names", "actuator_names", "floating"):
        assert getattr(back, field) == getattr(robot, field), field
    if (name, ending) != ("compass_gait", "sdf"):  # whose links are called as joints are
        assert back.contact_names == robot.contact_names
        assert [foot.name for foot in back.feet] == [foot.name for foot in robot.feet]
    assert (back.mirror is None) == (robot.mirror is None)


def _changed(robot: Robot, **fields: np.ndarray) -> object:
    return type(robot.model)(**robot.model.members() | fields)


SEEDS = [*range(60), *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(60, 200))]


@pytest.mark.parametrize("seed", SEEDS)
def test_random_trees_through_all_formats(seed: int, tmp_path: Path) -> None:
    robot = with_all_properties(quiet(random_tree(seed)), seed)
    back = again(robot, tmp_path / "r.xml")
    assert_same_dynamics(robot, back, states=2)
    for field in (*EXACT, *ALSO_EXACT):
        np.testing.assert_allclose(
            getattr(back.model, field),
            getattr(robot.model, field),
            rtol=1e-15,
            atol=1e-15,
            err_msg=field,
        )
    assert back.contact_friction == robot.contact_friction
    none = np.zeros(robot.nv)
    # What neither SDF nor URDF can hold: outlines, motors that pull unequally to two sides.
    pulling = _changed(robot, torque_lower=-robot.model.torque_upper)
    even = replace(robot, model=pulling, outlines=())
    _same_through_zero(even, again(even, tmp_path / "r.sdf"), ("axis",))
    # Nor URDF: springs, armature of what has no motor.
    driven = np.isin(np.arange(robot.nv), robot.model.actuator_joint)
    without = replace(
        even,
        model=_changed(even, armature=np.where(driven, robot.model.armature, 0.0), stiffness=none),
    )
    _same_through_zero(without, again(without, tmp_path / "r.urdf"), ("rest", "axis"))


def _same_through_zero(without: Robot, back: Robot, lost: tuple[str, ...]) -> None:
    """Compare a robot with what came back through a format that begins at the zero configuration.

    Slides are seen there in another reference; of springs that are not there is no rest.
    """
    # The order of a link's points is that of x in the reference configuration, which URDF moves.
    sorted_alike = _with_contacts_of(without, back)
    assert_same_dynamics(sorted_alike, back, states=2)
    for field in (*EXACT, *ALSO_EXACT):
        if field in lost:
            continue
        np.testing.assert_allclose(
            getattr(back.model, field),
            getattr(sorted_alike.model, field),
            rtol=1e-15,
            atol=1e-15,
            err_msg=field,
        )


def with_all_properties(robot: Robot, seed: int) -> Robot:
    """Add what random trees lack: dry friction, speed limits, frictions of the contact points."""
    draw = np.random.default_rng([seed, 1])
    some = draw.random((2, robot.nv)) < 0.5
    model = _changed(
        robot,
        dry_friction=np.where(some[0], draw.uniform(0.1, 3.0, robot.nv), 0.0),
        speed_limit=np.where(some[1], draw.uniform(1.0, 20.0, robot.nv), np.inf),
        contact_radius=robot.model.contact_radius * draw.uniform(0.5, 2.0, robot.nc),
    )
    friction = tuple(draw.uniform(0.2, 1.5, robot.nc).tolist())
    return replace(robot, model=model, contact_friction=friction)


def _with_contacts_of(robot: Robot, other: Robot) -> Robot:
    """Sort the contact points of each link as another robot has them."""
    q = np.zeros(robot.nv)
    here, there = (dynamics.contact_positions(one, q) for one in (robot, other))
    apart = np.hypot(*(here[None] - there[:, None]).transpose(2, 0, 1))
    apart[other.model.contact_link[:, None] != robot.model.contact_link] = np.inf
    order = apart.argmin(axis=1) if robot.nc else np.zeros(0, dtype=np.int64)
    assert sorted(order) == list(range(robot.nc))
    changed = {
        field: getattr(robot.model, field)[order]
        for field in ("contact_link", "contact_position", "contact_radius")
    }
    return replace(robot, model=_changed(robot, **changed))


def test_what_urdf_cannot_hold_is_named(tmp_path: Path) -> None:
    build = RobotBuilder("odd")
    link = build.hinge("a", None, mass=1, inertia=1, stiffness=3, torque=(-1, 2))
    build.hinge("b", link, mass=1, inertia=1, armature=0.1)
    with pytest.warns(RobotWarning) as caught:
        build.build().save(tmp_path / "r.urdf")
    (message,) = (str(one.message) for one in caught)
    for words in ("springs of a;", "armature (motor inertia) of b;", "torque limits", "of a."):
        assert words in message


def test_limits_of_one_side_and_motors_without_limits(tmp_path: Path) -> None:
    build = RobotBuilder("one_sided", gravity=1.62)
    link = build.hinge(
        "a", None, mass=1, inertia=1, limits=(-np.inf, 0.5), torque=np.inf, speed=7, dry_friction=2
    )
    build.slide("b", link, direction=(1, 0), mass=1, inertia=0.1, limits=(0.1, np.inf), torque=3)
    robot = build.build()
    for path in (tmp_path / "r.xml", tmp_path / "r.urdf", tmp_path / "r.sdf"):
        back = again(robot, path)
        assert_same_dynamics(robot, back)
        for field in (*EXACT, *ALSO_EXACT, "gravity"):
            np.testing.assert_array_equal(
                getattr(back.model, field), getattr(robot.model, field), err_msg=field
            )


def test_everything_a_joint_and_a_motor_have(tmp_path: Path) -> None:
    """Gear and motor inertia arrive as armature; all else as it was given."""
    build = RobotBuilder("complete")
    trunk = build.floating_base(
        "trunk", (0.1, 0.9), mass=9, inertia=0.7, center_of_mass=(0.01, 0.2)
    )
    for side, sense in (("right", 1), ("left", -1)):
        leg = build.hinge(
            f"{side}_hip",
            trunk,
            link=f"{side}_leg",
            sense=sense,
            mass=2.5,
            inertia=0.1,
            center_of_mass=(0.02, -0.3),
            reference=0.05 * sense,
            limits=(-0.7, 0.8) if sense > 0 else (-0.8, 0.7),
            damping=0.3,
            stiffness=4.0,
            rest=0.2 * sense,
            dry_friction=0.6,
            torque=(-30, 40) if sense > 0 else (-40, 30),
            speed=11,
            gear=7,
            motor_inertia=0.002,
        )
        build.contact(leg, (0.03, -0.8), radius=0.05, friction=0.65)
    robot = build.build()
    assert robot.mirror is not None
    back = again(robot, tmp_path / "r.xml")
    assert_same_dynamics(robot, back)
    for field in robot.model.members():
        np.testing.assert_allclose(
            getattr(back.model, field),
            getattr(robot.model, field),
            rtol=1e-15,
            atol=1e-15,
            err_msg=field,
        )
    assert back.model.armature[3] == pytest.approx(7**2 * 0.002, rel=1e-15)
    assert (back.contact_friction, back.contact_names) == ((0.65, 0.65), robot.contact_names)


def test_a_human_through_files(tmp_path: Path) -> None:
    robot = human(62, 1.7)
    for path in (tmp_path / "h.xml", tmp_path / "h.urdf", tmp_path / "h.sdf"):
        assert_same_dynamics(robot, again(robot, path))


def test_names_that_xml_must_quote(tmp_path: Path) -> None:
    build = RobotBuilder('<a & "b">')
    build.hinge("l'é <1>", None, mass=1, inertia=1)
    for path in (tmp_path / "r.xml", tmp_path / "r.urdf", tmp_path / "r.sdf"):
        back = again(build.build(), path)
        assert (back.name, back.joint_names) == ('<a & "b">', ("l'é <1>",))


def test_another_ending(tmp_path: Path) -> None:
    with pytest.raises(RobotError, match=r"URDF \(.urdf\) or SDF \(.sdf\), not as '.json'"):
        load_robot("bravo7").save(tmp_path / "r.json")


def test_a_place_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(RobotError, match="cannot write"):
        load_robot("rabbit").save(tmp_path / "nowhere" / "rabbit.xml")


def test_names_that_xml_cannot_hold(tmp_path: Path) -> None:
    builder = RobotBuilder("bell\a")
    builder.hinge("joint", None, mass=1.0, inertia=0.1)
    with pytest.raises(RobotError, match="XML cannot hold"):
        builder.build().save(tmp_path / "bell.xml")
    assert not any(tmp_path.iterdir())


@pytest.mark.parametrize("ending", ["xml", "urdf"])
def test_a_link_of_inertia_without_mass(ending: str, tmp_path: Path) -> None:
    """A rotor: no mass is told of it, what it resists is its inertia."""
    builder = RobotBuilder("rotor")
    trunk = builder.floating_base("trunk", (0.0, 1.0), mass=5.0, inertia=1.0)
    rotor = builder.hinge("rotor", trunk, at=(0.0, -0.5), inertia=0.1, torque=10.0)
    builder.hinge("end", rotor, at=(0.0, -0.5), inertia=0.2, torque=10.0)
    robot = builder.build()
    assert_same_dynamics(robot, again(robot, tmp_path / f"rotor.{ending}"))
