"""Kinematics and inertia of the links, against MuJoCo's own."""

from __future__ import annotations

import warnings

import mujoco
import numpy as np
import pytest
from numpy.typing import NDArray
from random_trees import random_tree

from heelstrike.errors import RobotError
from heelstrike.robot import Model, RobotWarning, read_mjcf
from heelstrike.robot.library import NO_CONTACTS, NO_MOTORS
from heelstrike.robot.model import NUMBERS

Floats = NDArray[np.float64]

FLOATING = """
  <joint name="root_x" type="slide" axis="1 0 0"/>
  <joint name="root_z" type="slide" axis="0 0 1"/>
  <joint name="root_pitch" type="hinge" axis="0 1 0"/>
"""


def one_body(content: str, more: str = "") -> str:
    return (
        f'<mujoco><worldbody><body name="trunk">{content}<geom size="0.1"/></body></worldbody>'
        f"{more}</mujoco>"
    )


def rotation(angle: float) -> Floats:
    """Turn a vector (x, z) about +y."""
    return np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])


def poses(model: Model, q: Floats) -> tuple[Floats, Floats]:
    """Angle and origin of every link, straight from the definition of `Model`."""
    angle, origin = np.zeros(len(q)), np.zeros((len(q), 2))
    for i, parent in enumerate(model.parent):
        moved = model.offset[i] + model.axis[i, 1:] * (q[i] - model.reference[i])
        base_angle, base = (angle[parent], origin[parent]) if parent >= 0 else (0.0, np.zeros(2))
        origin[i] = base + rotation(base_angle) @ moved
        angle[i] = base_angle + model.axis[i, 0] * (q[i] - model.reference[i])
    return angle, origin


def points(model: Model, q: Floats, links: NDArray[np.int64], local: Floats) -> Floats:
    angle, origin = poses(model, q)
    return np.array(
        [origin[k] + rotation(angle[k]) @ p for k, p in zip(links, local, strict=True)]
    ).reshape(-1, 2)


def mass_matrix(model: Model, q: Floats) -> Floats:
    """Sum of m JᵀJ + I ωᵀω, with Jacobians written joint by joint."""
    angle, origin = poses(model, q)
    result = np.diag(model.armature)
    for link in np.flatnonzero(model.mass):
        center = origin[link] + rotation(angle[link]) @ model.center_of_mass[link]
        velocity, turning = np.zeros((2, len(q))), np.zeros(len(q))
        joint = link
        while joint >= 0:
            parent = model.parent[joint]
            x, z = center - origin[joint]
            slide = rotation(angle[parent] if parent >= 0 else 0.0) @ model.axis[joint, 1:]
            velocity[:, joint] = slide + model.axis[joint, 0] * np.array([z, -x])
            turning[joint] = model.axis[joint, 0]
            joint = parent
        result += model.mass[link] * velocity.T @ velocity
        result += model.inertia[link] * np.outer(turning, turning)
    return result


def reference_mass_matrix(model: mujoco.MjModel, data: mujoco.MjData) -> Floats:
    result = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, result)
    return result


@pytest.mark.parametrize("seed", range(20))
def test_random_tree_moves_and_weighs_as_in_mujoco(seed: int) -> None:
    """Positions, masses and the mass matrix of any planar tree, at random configurations.

    Both sides evaluate the same closed expressions, so they differ by round-off alone: some 30
    links of at most 1 m, hence 1e-12.
    """
    text = random_tree(seed)
    robot = read_mjcf(text)
    model, data = mujoco.MjModel.from_xml_string(text), None
    data = mujoco.MjData(model)
    draw = np.random.default_rng(seed)
    assert robot.total_mass == pytest.approx(model.body_mass.sum(), rel=1e-13)
    np.testing.assert_array_equal(robot.model.reference, model.qpos0)
    np.testing.assert_allclose(robot.model.gravity, model.opt.gravity[::2])
    for _ in range(5):
        data.qpos[:] = draw.normal(size=model.nq)
        data.qvel[:] = draw.normal(size=model.nv)
        mujoco.mj_forward(model, data)
        q, v = data.qpos.copy(), data.qvel.copy()
        joints = np.arange(robot.nv)
        hinges = np.flatnonzero(robot.model.axis[:, 0])
        origins = points(robot.model, q, joints, np.zeros((robot.nv, 2)))
        np.testing.assert_allclose(origins[hinges], data.xanchor[hinges][:, ::2], atol=1e-12)
        centers = points(robot.model, q, joints, robot.model.center_of_mass)
        center = robot.model.mass @ centers / robot.total_mass
        # Body 0 is the world, which has no mass of its own here.
        np.testing.assert_allclose(center, data.subtree_com[0, ::2], atol=1e-12)
        expected = reference_mass_matrix(model, data)
        np.testing.assert_allclose(
            mass_matrix(robot.model, q), expected, atol=1e-12 * np.abs(expected).max()
        )
        passive = -robot.model.damping * v - robot.model.stiffness * (q - robot.model.rest)
        np.testing.assert_allclose(passive, data.qfrc_passive, atol=1e-12)


@pytest.mark.parametrize("seed", range(20))
def test_contact_discs_are_where_mujoco_has_the_geoms(seed: int) -> None:
    text = random_tree(seed)
    robot = read_mjcf(text)
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    data.qpos[:] = np.random.default_rng(seed).normal(size=model.nq)
    mujoco.mj_kinematics(model, data)
    expected = []
    for geom in range(model.ngeom):
        half = model.geom_size[geom, 1] if model.geom_type[geom] == 3 else 0.0
        along = half * data.geom_xmat[geom].reshape(3, 3)[:, 2]
        for sign in {-1.0, 1.0} if half else {1.0}:
            expected.append((*(data.geom_xpos[geom] + sign * along)[::2], model.geom_size[geom, 0]))
    ours = points(robot.model, data.qpos, robot.model.contact_link, robot.model.contact_position)
    found = np.column_stack([ours, robot.model.contact_radius])
    assert len(found) == len(expected)
    for disc in expected:
        assert np.abs(found - disc).max(axis=1).min() < 1e-12


def test_arrays_are_what_kernels_want() -> None:
    robot = read_mjcf(random_tree(3))
    for name, values in robot.model.members().items():
        if name == "pivot":
            assert type(values) is int
            continue
        assert values.dtype == NUMBERS[name].dtype, name
        assert values.flags.c_contiguous, name
        assert values.flags.writeable, name


def test_pivot_is_the_first_hinge() -> None:
    assert read_mjcf(one_body(FLOATING)).model.pivot == 2
    assert read_mjcf(one_body('<joint type="slide" axis="1 0 0"/>')).model.pivot == 0


def test_several_joints_make_massless_links() -> None:
    robot = read_mjcf(one_body(FLOATING))
    assert robot.link_names == ("trunk", "trunk", "trunk")
    np.testing.assert_array_equal(robot.model.parent, [-1, 0, 1])
    np.testing.assert_array_equal(robot.model.mass[:2], 0.0)
    assert robot.total_mass == pytest.approx(1000.0 * 4.0 / 3.0 * np.pi * 0.1**3)


def test_welded_bodies_combine_by_the_parallel_axis_theorem() -> None:
    """Two equal spheres, 2a apart: mass 2m, inertia 2(I + m a²) about the middle."""
    text = """<mujoco><worldbody><body name="rod"><joint axis="0 1 0"/>
      <inertial pos="0 0 0" mass="3" diaginertia="0.2 0.2 0.2"/>
      <body name="end" pos="0.8 0 0" euler="40 20 70">
        <inertial pos="0 0 0" mass="3" diaginertia="0.2 0.2 0.2"/>
      </body></body></worldbody></mujoco>"""
    model = read_mjcf(text).model
    np.testing.assert_allclose(model.mass, [6.0])
    np.testing.assert_allclose(model.center_of_mass, [[0.4, 0.0]], atol=1e-15)
    np.testing.assert_allclose(model.inertia, [2.0 * (0.2 + 3.0 * 0.4**2)])


def test_bodies_of_the_world_are_no_part_of_the_robot() -> None:
    text = """<mujoco><worldbody>
      <body name="pedestal" pos="1 0 2"><geom size="0.5" contype="0" conaffinity="0"/>
        <body name="arm"><joint axis="0 1 0"/><geom size="0.1" mass="2"/></body>
      </body></worldbody></mujoco>"""
    robot = read_mjcf(text)
    assert robot.total_mass == pytest.approx(2.0)
    np.testing.assert_allclose(robot.model.offset, [[1.0, 2.0]])
    assert robot.model.parent[0] == -1


@pytest.mark.parametrize(
    ("joint", "words"),
    [
        ('<joint name="roll" axis="1 0 0"/>', ["'roll'", "'trunk'", "turns about (1, 0, 0)"]),
        (
            '<joint name="side" type="slide" axis="0 1 0"/>',
            ["'side'", "slides along (0, 1, 0)"],
        ),
        ('<joint name="hip" type="ball"/>', ["'hip'", "ball joint"]),
        ('<freejoint name="root"/>', ["'root'", "free joint", "slide along x", "hinge about y"]),
        ('<joint name="a" axis="0 1 3e-3"/>', ["'a'"]),
    ],
)
def test_a_joint_that_leaves_the_plane_is_named(joint: str, words: list[str]) -> None:
    with pytest.raises(RobotError) as caught:
        read_mjcf(one_body(joint), forward="x")
    for word in words:
        assert word in str(caught.value)


def test_many_spatial_joints_are_counted_not_listed() -> None:
    chain = "".join(
        f'<body><joint name="j{k}" axis="{k} 1 0"/><geom size="0.1"/>' for k in range(9)
    )
    with pytest.raises(RobotError, match=r"'j1'.*'j4'.*and 4 more"):
        read_mjcf(f"<mujoco><worldbody>{chain}{'</body>' * 9}</worldbody></mujoco>")


def test_a_robot_in_another_plane_is_told_to_turn() -> None:
    with pytest.raises(RobotError, match=r"parallel: turn the robot .* by -30 degrees about z"):
        read_mjcf(one_body('<joint name="a" axis="-0.5 0.866025403784 0"/>'))
    with pytest.raises(RobotError, match="None of its joints turns about a level axis"):
        read_mjcf(one_body('<joint name="a" axis="0 0 1"/>'))


def test_a_robot_without_joints_is_refused() -> None:
    with pytest.raises(RobotError, match="no joints"):
        read_mjcf(one_body(""))


def test_a_body_turned_in_space_is_planar_if_its_axis_is() -> None:
    """The local axis is z, the body turned so that z is the world's -y: sign -1, not refused."""
    text = """<mujoco><worldbody><body euler="90 0 0"><joint axis="0 0 1"/><geom size="0.1"/>
      </body></worldbody></mujoco>"""
    np.testing.assert_array_equal(read_mjcf(text).model.axis, [[-1.0, 0.0, 0.0]])


def test_gravity_must_stay_in_the_plane() -> None:
    joint = '<joint axis="0 1 0"/>'
    with pytest.raises(RobotError, match="gravity is"):
        read_mjcf(one_body(joint, '<option gravity="0 -9.81 0"/>'))
    tilted = read_mjcf(one_body(joint, '<option gravity="1 0 -9"/>'))
    np.testing.assert_array_equal(tilted.model.gravity, [1.0, -9.0])
    off = read_mjcf(one_body(joint, '<option><flag gravity="disable"/></option>'))
    np.testing.assert_array_equal(off.model.gravity, [0.0, 0.0])


def test_joint_properties() -> None:
    robot = read_mjcf(
        one_body(
            '<joint name="a" axis="0 1 0" damping="0.3" armature="0.02" stiffness="4" '
            'frictionloss="0.7" '
            'springref="10" range="-30 60"/><joint name="b" axis="0 1 0" pos="1 0 0"/>'
        )
    )
    model = robot.model
    np.testing.assert_allclose(model.damping, [0.3, 0.0])
    np.testing.assert_allclose(model.armature, [0.02, 0.0])
    np.testing.assert_array_equal(model.dry_friction, [0.7, 0.0])
    np.testing.assert_allclose(model.stiffness, [4.0, 0.0])
    np.testing.assert_allclose(model.rest, np.radians([10.0, 0.0]))
    np.testing.assert_allclose(model.lower, [np.radians(-30.0), -np.inf])
    np.testing.assert_allclose(model.upper, [np.radians(60.0), np.inf])


def test_what_the_file_switches_off_is_off() -> None:
    joint = '<joint axis="0 1 0" damping="0.3" stiffness="4" frictionloss="2" range="-30 60"/>'
    flags = (
        '<option><flag spring="disable" damper="disable" limit="disable" frictionloss="disable"/>'
        "</option>"
    )
    model = read_mjcf(one_body(joint, flags)).model
    assert model.damping[0] == 0.0
    assert model.stiffness[0] == 0.0
    assert model.upper[0] == np.inf
    assert model.dry_friction[0] == 0.0


@pytest.mark.parametrize("number", ["nan", "inf", "1e999", "1e300"])
def test_numbers_that_are_none_are_refused(number: str) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RobotWarning)  # MuJoCo also remarks on NaN
        with pytest.raises(RobotError):
            read_mjcf(one_body(f'<joint axis="0 1 0" damping="{number}"/>'))


@pytest.mark.parametrize(
    ("content", "more", "words"),
    [
        (
            '<joint name="a" axis="0 1 0"/>',
            '<equality><weld body1="trunk"/></equality>',
            "equality constraints other than connect and joint",
        ),
        (
            '<joint name="a" axis="0 1 0"/>',
            '<tendon><fixed stiffness="3"><joint joint="a" coef="1"/></fixed></tendon>',
            "tendons",
        ),
        ('<joint name="a" axis="0 1 0"/>', '<option viscosity="1e-5"/>', "air"),
    ],
)
def test_what_is_not_simulated_is_said(content: str, more: str, words: str) -> None:
    with pytest.warns(RobotWarning, match=words):
        read_mjcf(one_body(content, more))


def test_a_tendon_that_only_measures_is_silent() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.filterwarnings("ignore", message=f".*({NO_MOTORS}|{NO_CONTACTS})")
        read_mjcf(
            one_body(
                '<joint name="a" axis="0 1 0"/>',
                '<tendon><fixed><joint joint="a" coef="1"/></fixed></tendon>',
            )
        )


def test_names_of_nameless_joints_come_from_the_body() -> None:
    assert read_mjcf(one_body('<joint axis="0 1 0"/>')).joint_names == ("trunk",)
    two = one_body('<joint axis="0 1 0"/><joint axis="0 1 0" pos="1 0 0"/>')
    assert read_mjcf(two).joint_names == ("trunk_0", "trunk_1")


def test_floating_needs_slide_x_slide_z_hinge_y_in_this_order() -> None:
    assert read_mjcf(one_body(FLOATING)).floating
    swapped = """<joint type="slide" axis="0 0 1"/><joint type="slide" axis="1 0 0"/>
      <joint type="hinge" axis="0 1 0"/>"""
    with pytest.warns(RobotWarning, match="slide along x, slide along z, hinge about y"):
        assert read_mjcf(one_body(swapped)).floating  # put in order, and said
    tilted = swapped.replace("1 0 0", "1 0 1")
    with pytest.warns(RobotWarning, match="slide along x, slide along z, hinge about y"):
        assert not read_mjcf(one_body(tilted)).floating
    assert not read_mjcf(one_body('<joint axis="0 1 0"/>')).floating
    driven = FLOATING, '<actuator><motor joint="root_x"/></actuator>'
    assert not read_mjcf(one_body(*driven)).floating
