"""Left and right: found by name, verified on the numbers."""

from __future__ import annotations

import warnings
from dataclasses import replace

import casadi
import mujoco
import numpy as np
import pytest

from heelstrike import dynamics
from heelstrike.errors import RobotError
from heelstrike.robot import Robot, RobotWarning, State, builtin_robots, load_robot, read_mjcf

LEG = """<body name="{hip}_link" pos="0 0 0">
  <joint name="{hip}" axis="0 {sense} 0" range="{low} {high}" damping="0.1"/>
  <geom name="{hip}_shape" type="capsule" size="0.05" fromto="0 0 0 0 0 -0.4" mass="{mass}"
    contype="0" conaffinity="0"/>
  <body name="{foot}_link" pos="0 0 -0.4">
    <joint name="{foot}" axis="0 {sense} 0" stiffness="5" springref="{rest}"/>
    <geom type="box" size="{size} 0.04 0.01" pos="0.02 0 -0.05" mass="1" friction="{friction}"/>
  </body>
</body>"""


def biped_text(
    right: tuple[str, str] = ("right_hip", "right_ankle"),
    left: tuple[str, str] = ("left_hip", "left_ankle"),
    *,
    opposite: bool = False,
    motors: str = "",
    **changes: object,
) -> str:
    """Two legs on a floating trunk; `opposite` turns the joints of the left, `changes` spoil it."""
    plain: dict[str, object] = {"sense": 1, "low": -30, "high": 60, "mass": 3, "rest": 20}
    plain |= {"size": 0.1, "friction": 0.8, "hip": right[0], "foot": right[1]}
    other = plain | {"hip": left[0], "foot": left[1]} | changes
    if opposite:
        other |= {"sense": -1, "low": -60, "high": 30, "rest": -20}
    return f"""<mujoco model="two"><worldbody><body name="trunk" pos="0 0 1">
        <joint name="x" type="slide" axis="1 0 0"/><joint name="z" type="slide" axis="0 0 1"/>
        <joint name="pitch" axis="0 1 0"/>
        <geom size="0.1" contype="0" conaffinity="0"/>
        {LEG.format(**plain)}{LEG.format(**other)}
        </body></worldbody><actuator>{motors}</actuator></mujoco>"""


def biped(*names: tuple[str, str], mirror: str | None = None, **changes: object) -> Robot:
    return read_mjcf(biped_text(*names, **changes), mirror=mirror)  # type: ignore[arg-type]


@pytest.mark.parametrize("name", [name for name in builtin_robots() if name != "rimless_wheel"])
def test_built_in_robots_have_a_mirror(name: str) -> None:
    robot = load_robot(name)
    assert robot.mirror is not None
    for i, j in enumerate(robot.mirror.joint):
        swapped = robot.joint_names[i].replace("left", "R").replace("right", "left")
        assert robot.joint_names[j] == swapped.replace("R", "right")
    for i, j in enumerate(robot.mirror.contact):
        swapped = robot.contact_names[i].replace("left", "R").replace("right", "left")
        assert robot.contact_names[j] == swapped.replace("R", "right")
    np.testing.assert_array_equal(robot.mirror.foot, [1, 0])
    np.testing.assert_array_equal(robot.mirror.sign, 1.0)


def test_a_wheel_has_no_sides() -> None:
    assert load_robot("rimless_wheel").mirror is None


@pytest.mark.parametrize(
    ("right", "left"),
    [
        (("right_hip", "right_ankle"), ("left_hip", "left_ankle")),
        (("HipRight", "AnkleRight"), ("HipLeft", "AnkleLeft")),
        (("r_hip", "r_ankle"), ("l_hip", "l_ankle")),
        (("hip.R", "ankle.R"), ("hip.L", "ankle.L")),
        (("RHip", "RAnkle"), ("LHip", "LAnkle")),
        (("rhip", "rankle"), ("lhip", "lankle")),
        (("righthip", "rightankle"), ("lefthip", "leftankle")),
        (("hip", "ankle"), ("hip_left", "ankle_left")),
        (("hip_right", "ankle_right"), ("hip", "ankle")),
        (("hip_R", "ankle_R"), ("hip_L", "ankle_L")),
        (("FR_hip", "FR_foot"), ("FL_hip", "FL_foot")),
        (("hip_rr", "foot_rr"), ("hip_rl", "foot_rl")),
        (("RH_HAA", "RH_KFE"), ("LH_HAA", "LH_KFE")),
        (("RR_hip", "RR_foot"), ("LR_hip", "LR_foot")),
    ],
)
def test_words_for_left_and_right(right: tuple[str, str], left: tuple[str, str]) -> None:
    mirror = biped(right, left).mirror
    assert mirror is not None
    np.testing.assert_array_equal(mirror.joint, [0, 1, 2, 5, 6, 3, 4])


def test_names_that_say_nothing_give_no_mirror_silently() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert biped(("hip1", "ankle1"), ("hip2", "ankle2")).mirror is None


def test_names_of_links_serve_where_joints_have_none() -> None:
    text = """<mujoco><worldbody><body><joint axis="0 1 0"/><geom size="0.1"/>
      <body name="left"><joint axis="0 1 0"/><geom size="0.1"/></body>
      <body name="right"><joint axis="0 1 0"/><geom size="0.1"/></body>
      </body></worldbody></mujoco>"""
    mirror = read_mjcf(text).mirror
    assert mirror is not None
    np.testing.assert_array_equal(mirror.joint, [0, 2, 1])


def test_opposite_joints_have_sign_minus_one() -> None:
    mirror = biped(opposite=True).mirror
    assert mirror is not None
    np.testing.assert_array_equal(mirror.sign, [1, 1, 1, -1, -1, -1, -1])


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"mass": 3.1}, "mass of right_hip and left_hip (3, 3.1)"),
        ({"high": 61}, "range of right_hip and left_hip"),
        ({"rest": 21}, "rest of the spring of right_ankle and left_ankle"),
        ({"size": 0.11}, "contact points of right_ankle_link and left_ankle_link"),
        ({"sense": -1}, "range of right_hip and left_hip"),
        ({"motors": '<motor joint="left_hip"/>'}, "left_hip has an actuator, right_hip has none"),
        (
            {
                "motors": '<motor joint="left_hip" ctrlrange="-2 2"/>'
                '<motor joint="right_hip" ctrlrange="-2 3"/>'
            },
            "torque limits of right_hip and left_hip",
        ),
    ],
)
def test_a_difference_is_told_with_its_numbers(changes: dict[str, object], words: str) -> None:
    with pytest.warns(RobotWarning, match="left and right differ") as caught:
        assert biped(**changes).mirror is None
    assert words in str(caught[0].message)


def test_a_joint_without_counterpart_is_told() -> None:
    with pytest.warns(RobotWarning, match="right_ankle has no counterpart"):
        assert biped(("right_hip", "right_ankle"), ("left_hip", "ankle_port")).mirror is None


def test_a_difference_of_two_points_of_a_foot_is_told_once() -> None:
    radius = "number of contact points"
    text = biped_text().replace('type="box" size="0.1 0.04 0.01"', 'type="sphere" size="0.1"', 1)
    with pytest.warns(RobotWarning) as caught:
        read_mjcf(text)
    assert str(caught[0].message).count(radius) == 1


def test_friction_is_the_grounds_and_makes_no_difference() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert biped(friction=1.9).mirror is not None


def test_rounding_is_no_difference() -> None:
    """Four digits of a mass, hundredths of a millimetre of a length, as drawings are exported."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert biped(mass=3.0002, size=0.100003, high=60.004).mirror is not None
    with pytest.warns(RobotWarning, match="left and right differ"):
        assert biped(mass=3.001).mirror is None


def test_feet_whose_points_nearly_coincide_are_matched_one_to_one() -> None:
    """Points a hundredth of a millimetre apart: the nearest one of both would be the same."""
    many = "".join(
        f'<geom type="sphere" size="0.01" mass="0" pos="{0.1 + 8e-6 * k:.6f} 0 -0.05"/>'
        for k in range(4)
    )
    box = '<geom type="box"'
    assert read_mjcf(biped_text().replace(box, many + box)).mirror is not None
    head, _, tail = biped_text().replace(box, many + box).rpartition("0.100024")
    mirror = read_mjcf(f"{head}0.100023{tail}").mirror
    assert mirror is not None
    np.testing.assert_array_equal(mirror.contact[mirror.contact], np.arange(len(mirror.contact)))


def test_left_and_right_are_made_equal() -> None:
    """Every number is the mean, and what was changed is said."""
    motors = '<motor joint="left_hip" ctrlrange="-2 2"/><motor joint="right_hip" ctrlrange="-2 3"/>'
    changes = {"mass": 3.2, "high": 62, "rest": 24, "size": 0.12, "motors": motors}
    words = (
        r"made equal by their means. They differed in mass by 0.2 \(right_hip\), "
        r".*upper by .* rest by .*torque upper by 1 .*contact position by 0.02"
    )
    with pytest.warns(RobotWarning, match=words) as caught:
        robot = biped(mirror="average", **changes)
    assert len(caught) == 1
    model, mirror = robot.model, robot.mirror
    assert mirror is not None
    np.testing.assert_allclose(model.mass[[3, 5]], 3.1)
    np.testing.assert_allclose(model.upper[[3, 5]], np.radians(61.0))
    np.testing.assert_allclose(model.rest[[4, 6]], np.radians(22.0))
    np.testing.assert_array_equal(model.torque_upper, 2.5)
    places = model.contact_position
    np.testing.assert_array_equal(places, mirror.at_contacts(places))
    np.testing.assert_allclose(np.ptp(places[:2, 0]), 0.22)


def test_joints_of_opposite_senses_are_made_equal() -> None:
    with pytest.warns(RobotWarning, match="made equal"):
        robot = biped(mirror="average", opposite=True, mass=3.2)
    np.testing.assert_allclose(robot.model.mass[[3, 5]], 3.1)
    assert robot.mirror is not None
    np.testing.assert_allclose(robot.model.lower[3:], -robot.model.upper[[5, 6, 3, 4]], atol=1e-15)


def test_an_average_that_changes_nothing_says_nothing() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        robot = load_robot("bravo7", mirror="average")
    for name, values in load_robot("bravo7").model.members().items():
        np.testing.assert_allclose(robot.model.members()[name], values, rtol=1e-15, err_msg=name)


@pytest.mark.parametrize(
    ("names", "changes", "words"),
    [
        (
            (("hip1", "ankle1"), ("hip2", "ankle2")),
            {},
            "needs to know left from right by the names",
        ),
        (
            (),
            {"motors": '<motor joint="left_hip"/>'},
            "left_hip has an actuator, right_hip has none",
        ),
        ((("right_hip", "right_ankle"), ("left_hip", "ankle_port")), {}, "has no counterpart"),
    ],
)
def test_what_has_no_mean(
    names: tuple[tuple[str, str], ...], changes: dict[str, object], words: str
) -> None:
    with pytest.raises(RobotError, match=words):
        biped(*names, mirror="average", **changes)


def test_the_warning_points_at_the_caller() -> None:
    with pytest.warns(RobotWarning) as caught:
        biped(mass=4)
    assert caught[0].filename == __file__


@pytest.mark.parametrize("opposite", [False, True])
def test_a_mirrored_state_has_the_energy_of_the_state(opposite: bool) -> None:
    """Energies by MuJoCo of a random state and its mirror image, which is its own mirror's image.

    Mirroring renames the legs, so both energies are the same sums in another order: 1e-13.
    """
    text = biped_text(opposite=opposite)
    robot = read_mjcf(text)
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    model.opt.enableflags |= int(mujoco.mjtEnableBit.mjENBL_ENERGY)
    mirror = robot.mirror
    assert mirror is not None
    draw = np.random.default_rng(0)
    q, v = draw.normal(size=robot.nq), draw.normal(size=robot.nv)
    mirrored = mirror.position(q), mirror.velocity(v)
    energies = []
    for position, velocity in ((q, v), mirrored):
        data.qpos[:], data.qvel[:] = position, velocity
        mujoco.mj_forward(model, data)
        energies.append(data.energy.copy())
    np.testing.assert_allclose(energies[0], energies[1], rtol=1e-13)
    np.testing.assert_allclose(mirror.position(mirrored[0]), q)
    np.testing.assert_allclose(mirror.velocity(mirrored[1]), v)


@pytest.mark.parametrize("opposite", [False, True])
def test_mirrored_torques_accelerate_the_mirrored_robot_in_the_mirror(opposite: bool) -> None:
    motors = "".join(
        f'<motor joint="{joint}"/>'
        for joint in ("left_ankle", "right_hip", "left_hip", "right_ankle")
    )
    robot = read_mjcf(biped_text(opposite=opposite, motors=motors))
    mirror = robot.mirror
    assert mirror is not None
    motors_mirror = mirror.among(robot.model.actuator_joint)
    draw = np.random.default_rng(1)
    state = State(draw.normal(size=robot.nq), draw.normal(size=robot.nv))
    torque = draw.normal(size=robot.nu)

    def acceleration(at: State, by: np.ndarray) -> np.ndarray:
        force = dynamics.applied_force(robot, at.q, at.v, by)
        return dynamics.forward_dynamics(robot, at.q, at.v, force)

    image = mirror.state(state)
    expected = mirror.velocity(acceleration(state, torque))
    found = acceleration(image, motors_mirror.velocity(torque))
    np.testing.assert_allclose(found, expected, rtol=1e-9)
    np.testing.assert_array_equal(motors_mirror.joint, [3, 2, 1, 0])
    # Places of the contact points, and the driven coordinates by themselves.
    np.testing.assert_allclose(
        dynamics.contact_positions(robot, image.q),
        mirror.at_contacts(dynamics.contact_positions(robot, state.q)),
        atol=1e-14,
    )
    driven = robot.model.actuator_joint
    np.testing.assert_array_equal(motors_mirror.position(state.q[driven]), image.q[driven])
    np.testing.assert_allclose(
        motors_mirror.sign * state.q[driven][motors_mirror.joint] + motors_mirror.offset,
        image.q[driven],
        atol=1e-14,
    )


def test_ranges_and_symbols_are_mirrored_as_numbers_are() -> None:
    robot = read_mjcf(biped_text(opposite=True))
    mirror = robot.mirror
    assert mirror is not None
    lower, upper = mirror.ranges(robot.model.lower, robot.model.upper)
    np.testing.assert_allclose(lower, robot.model.lower)  # left and right are alike
    np.testing.assert_allclose(upper, robot.model.upper)
    legs = mirror.among(range(3, robot.nq))
    q = np.arange(1.0, robot.nq - 2.0)
    column = casadi.SX.sym("q", robot.nq - 3)
    image = casadi.Function("image", [column], [legs.position(column)])
    np.testing.assert_array_equal(np.array(image(q)).ravel(), legs.position(q))


def test_the_mirror_is_about_the_reference_of_its_robot() -> None:
    robot = load_robot("bravo7")
    reference = robot.model.reference + 0.1
    other = replace(robot, model=robot.model.replaced(reference=reference))
    assert other.mirror is not None
    np.testing.assert_array_equal(other.mirror.position(reference), reference)
