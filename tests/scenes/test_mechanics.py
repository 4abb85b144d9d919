"""The judge's own mechanics, held against textbooks, complex steps and MuJoCo."""

from __future__ import annotations

from types import SimpleNamespace

import mujoco
import numpy as np
import pytest
from scenes.mechanics import Metric, Poses, Tree, generalised
from scenes.scene import Scene, random_scene

SEEDS = range(0, 24)


def numbers(**given: object) -> SimpleNamespace:
    n = len(np.asarray(given["parent"]))
    usual = {
        "axis": np.tile([1.0, 0.0, 0.0], (n, 1)),
        "offset": np.zeros((n, 2)),
        "gravity": np.array([0.0, -9.81]),
        "center_of_mass": np.zeros((n, 2)),
    }
    plain = dict.fromkeys(
        ("reference", "mass", "inertia", "armature", "damping", "stiffness", "rest"), np.zeros(n)
    )
    return SimpleNamespace(**{**plain, **usual, **given})


def test_double_pendulum() -> None:
    """Two point masses on rods of l1, l2, angles from the vertical, the second relative."""
    m1, m2, l1, l2, g = 1.3, 0.7, 0.9, 0.6, 9.81
    tree = Tree(
        numbers(
            parent=np.array([-1, 0]),
            offset=np.array([[0.0, 0.0], [0.0, -l1]]),
            mass=np.array([m1, m2]),
            center_of_mass=np.array([[0.0, -l1], [0.0, -l2]]),
        )
    )
    a, b, da, db = 0.4, -0.9, 1.7, -2.3
    poses = Poses(tree, np.array([[a, b]]))
    m12 = m2 * (l2**2 + l1 * l2 * np.cos(b))
    m11 = m1 * l1**2 + m2 * (l1**2 + l2**2 + 2 * l1 * l2 * np.cos(b))
    np.testing.assert_allclose(poses.mass_matrix()[0], [[m11, m12], [m12, m2 * l2**2]], rtol=1e-14)
    swing = m2 * l1 * l2 * np.sin(b)
    expected = [
        -swing * (2 * da * db + db**2)
        + (m1 + m2) * g * l1 * np.sin(a)
        + m2 * g * l2 * np.sin(a + b),
        swing * da**2 + m2 * g * l2 * np.sin(a + b),
    ]
    np.testing.assert_allclose(poses.bias_force(np.array([[da, db]]))[0], expected, rtol=1e-13)


def state_of(scene: Scene) -> tuple[object, Tree, np.ndarray, np.ndarray]:
    robot = scene.robot()
    draw = np.random.default_rng(scene.seed)
    q = scene.state(robot).q + 0.3 * draw.normal(size=robot.nq)
    return robot, Tree(robot.model), q, draw.normal(size=robot.nv)


@pytest.mark.parametrize("seed", SEEDS[:8])
def test_jacobians_are_derivatives_of_positions(seed: int) -> None:
    """A complex step differentiates to rounding."""
    _, tree, q, v = state_of(random_scene(seed))
    links = np.arange(tree.size)
    local = tree.numbers.center_of_mass
    poses = Poses(tree, q[None])
    jacobian = poses.jacobian(links, poses.center)[0]
    tiny = 1e-30
    for j in range(tree.size):
        moved = Poses(tree, (q + 1j * tiny * np.eye(tree.size)[j])[None])
        column = moved.points(links, local)[0].imag / tiny
        np.testing.assert_allclose(jacobian[:, :, j], column, atol=1e-13)
    moved = Poses(tree, (q + 1j * tiny * v)[None])
    rate = moved.jacobian(links, moved.points(links, local))[0].imag / tiny
    own = poses.bias_acceleration(v[None], links, poses.center)[0]
    np.testing.assert_allclose(own, rate @ v, atol=1e-11)
    height = Poses(tree, (q + 1j * tiny * v)[None]).potential_energy((q + 1j * tiny * v)[None])
    springs = tree.numbers.stiffness * (q - tree.numbers.rest)
    weight = poses.bias_force(np.zeros_like(v)[None])[0]
    np.testing.assert_allclose(height[0].imag / tiny, (weight + springs) @ v, rtol=1e-10)


def as_mjcf(scene: Scene) -> str:
    """The scene's tree in MJCF, written from the scene, not from the robot built of it."""

    def body(index: int) -> str:
        link = scene.links[index]
        ends = f'armature="{link.armature!r}" ref="{link.reference!r}"'
        if scene.floating and index == 0:
            joints = (
                '<joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 0 1"/>'
                '<joint type="hinge" axis="0 1 0"/>'
            )
        elif link.slide is None:
            joints = f'<joint type="hinge" axis="0 {link.sense} 0" {ends}/>'
        else:
            joints = f'<joint type="slide" axis="{link.slide[0]!r} 0 {link.slide[1]!r}" {ends}/>'
        inner = "".join(body(i) for i, one in enumerate(scene.links) if one.parent == index)
        x, z = link.center_of_mass
        moments = " ".join([repr(link.inertia)] * 3)
        return (
            f'<body pos="{link.at[0]!r} 0 {link.at[1]!r}">{joints}'
            f'<inertial pos="{x!r} 0 {z!r}" mass="{link.mass!r}" diaginertia="{moments}"/>'
            f"{inner}</body>"
        )

    return (
        '<mujoco><compiler angle="radian"/><option gravity="0 0 -9.81"/>'
        f"<worldbody>{body(0)}</worldbody></mujoco>"
    )


@pytest.mark.parametrize("seed", SEEDS)
def test_dynamics_are_those_of_mujoco(seed: int) -> None:
    """Links come in another order there: depth first."""
    scene = random_scene(seed)
    robot, tree, q, v = state_of(scene)
    order: list[str] = []

    def visit(index: int) -> None:
        trunk = scene.floating and index == 0
        order.extend(("root_x", "root_z", "root_pitch") if trunk else (scene.links[index].name,))
        for i, one in enumerate(scene.links):
            if one.parent == index:
                visit(i)

    visit(0)
    place = [robot.joint_names.index(name) for name in order]
    model = mujoco.MjModel.from_xml_string(as_mjcf(scene))
    data = mujoco.MjData(model)
    data.qpos, data.qvel = q[place], v[place]
    if scene.floating:  # the origin of its x and z is the world's there, the trunk's place here
        reference = robot.model.reference
        data.qpos[:2] = q[:2] - reference[:2]
    mujoco.mj_forward(model, data)
    theirs = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, theirs)
    poses = Poses(tree, q[None])
    ours = poses.mass_matrix()[0][np.ix_(place, place)]
    np.testing.assert_allclose(ours, theirs, atol=1e-11 * np.abs(theirs).max())
    bias = poses.bias_force(v[None])[0][place]
    np.testing.assert_allclose(
        bias, data.qfrc_bias, atol=1e-11 * max(np.abs(data.qfrc_bias).max(), 1.0)
    )


def test_sizes_do_not_depend_on_units() -> None:
    """A velocity that an impulse makes is as large as the impulse; rows bound what they measure."""
    _, tree, q, v = state_of(random_scene(5))
    poses = Poses(tree, q[None])
    metric = Metric(poses.mass_matrix())
    impulse = (poses.mass_matrix() @ v)[0]
    size = metric.of_velocity(v[None])[0]
    assert metric.of_force(impulse[None])[0] == pytest.approx(size, rel=1e-12)
    assert size == pytest.approx(np.sqrt(v @ impulse), rel=1e-12)
    links = np.array([tree.size - 1])
    jacobian = poses.jacobian(links, poses.center[:, links])
    weight = metric.weight(jacobian)[0, 0]
    hardest = metric.accelerated(jacobian[:, 0, 0])
    reached = float((jacobian[0, 0, 0] @ hardest[0]) / metric.of_velocity(hardest)[0])
    assert weight[0] == pytest.approx(reached, rel=1e-10)
    np.testing.assert_allclose(
        metric.joint_weight()[0], np.sqrt(np.diag(np.linalg.inv(metric.matrix[0]))), rtol=1e-8
    )
    ones = np.zeros((1, 1, 2))
    ones[0, 0, 0] = 1.0
    np.testing.assert_allclose(generalised(jacobian, ones)[0], jacobian[0, 0, 0])
