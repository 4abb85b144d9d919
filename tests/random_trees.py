"""Random planar trees as MJCF, to hold our reader and kernels against MuJoCo.

They use everything that a planar robot may have: fixed or floating bases, hinges and slides,
branches, several joints on one body, bodies welded without a joint, bodies turned in space,
joints away from the body's origin, full inertia tensors, damping, armature, springs, and a
reference configuration that is not zero.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

# Joints of one body, in order; each choice leaves the mass matrix regular with massless links
# between them.
JOINTS = (
    ("hinge",),
    ("hinge",),
    ("hinge",),
    ("slide",),
    ("slide", "hinge"),
    ("hinge", "slide"),
    ("hinge", "hinge"),
    ("slide", "across", "hinge"),
)


def random_tree(seed: int, *, bodies: int | None = None, floating: bool | None = None) -> str:
    """Return the MJCF of a random planar tree; the same seed gives the same tree.

    Parameters
    ----------
    seed : int
        Seed of the random numbers.
    bodies : int, optional
        Number of bodies with joints (at least 1), by default 2 to 12 at random. A floating base
        counts as one of them.
    floating : bool, optional
        Whether the first body moves freely by slide x, slide z and hinge y; by default at random.
    """
    draw = np.random.default_rng(seed)
    count = int(draw.integers(2, 13)) if bodies is None else bodies
    free = bool(draw.integers(2)) if floating is None else floating
    parents = [-1] + [int(draw.integers(max(0, i - 4), i)) for i in range(1, count)]
    children: list[list[int]] = [[] for _ in range(count)]
    for child, parent in enumerate(parents[1:], start=1):
        children[parent].append(child)
    joints: list[str] = []

    def body(index: int, parent_turn: Floats) -> str:
        turn = _turn(draw)
        root = free and index == 0
        local = parent_turn.T @ turn  # world axes of the body follow from its parent's
        text = f'<body name="body{index}" pos="{_numbers(_place(draw, parent_turn))}" '
        text += f'quat="{_numbers(_quaternion(local))}">\n'
        text += _joints(draw, index, turn, root, joints)
        text += _inertial(draw) + _geom(draw, index)
        if draw.random() < 0.2:  # welded to this one
            text += f'<body pos="{_numbers(_place(draw, turn))}" '
            text += f'quat="{_numbers(_quaternion(_turn(draw)))}">{_inertial(draw)}</body>\n'
        return text + "".join(body(child, turn) for child in children[index]) + "</body>\n"

    world = body(0, np.eye(3))
    driven = [name for name in joints if not name.startswith("root") and draw.random() < 0.7]
    motors = "".join(
        f'<motor name="drive_{name}" joint="{name}" gear="{_sign(draw) * _size(draw)!r}" '
        f'ctrlrange="{-_size(draw)!r} {2 * _size(draw)!r}"/>\n'
        for name in driven
    )
    gravity = f"{float(draw.normal())!r} 0 {-9.81 + float(draw.normal())!r}"
    return (
        f'<mujoco model="tree{seed}">\n<compiler angle="radian" autolimits="true"/>\n'
        f'<option gravity="{gravity}"/>\n<worldbody>\n{world}</worldbody>\n'
        f"<actuator>\n{motors}</actuator>\n</mujoco>\n"
    )


def _joints(
    draw: np.random.Generator, index: int, turn: Floats, root: bool, names: list[str]
) -> str:
    """Joints of one body, whose world axes are the columns of `turn`."""
    if root:
        kinds: tuple[str, ...] = ("root_x", "root_z", "root_pitch")
    else:
        kinds = JOINTS[draw.integers(len(JOINTS))]
    angle = draw.uniform(0.0, 2.0 * np.pi)
    text = ""
    for k, kind in enumerate(kinds):
        anchor = turn.T @ np.array(
            [0.3 * k + draw.uniform(-0.1, 0.1), 0.0, draw.uniform(-0.1, 0.1)]
        )
        axis = {
            "root_x": np.array([1.0, 0.0, 0.0]),
            "root_z": np.array([0.0, 0.0, 1.0]),
            "root_pitch": np.array([0.0, 1.0, 0.0]),
            "hinge": np.array([0.0, _sign(draw), 0.0]),
            "slide": np.array([np.cos(angle), 0.0, np.sin(angle)]),
            "across": np.array([-np.sin(angle + 0.5), 0.0, np.cos(angle + 0.5)]),
        }[kind]
        hinge = kind in ("hinge", "root_pitch")
        name = kind if root else f"joint{index}_{k}"
        names.append(name)
        text += (
            f'<joint name="{name}" type="{"hinge" if hinge else "slide"}" '
            f'pos="{_numbers(anchor)}" axis="{_numbers(turn.T @ axis)}" '
            f'ref="{draw.uniform(-0.5, 0.5)!r}"'
        )
        if not root:
            text += f' damping="{draw.uniform(0.0, 0.5)!r}"'
            text += f' armature="{float(draw.choice([0.0, 0.02]))!r}"'
            if draw.random() < 0.3:
                text += f' stiffness="{5.0 * _size(draw)!r}" springref="{draw.uniform(-1, 1)!r}"'
            if draw.random() < 0.3:
                text += f' range="{-1.0 - _size(draw)!r} {1.0 + _size(draw)!r}"'
        text += "/>\n"
    return text


def _inertial(draw: np.random.Generator) -> str:
    """Inertia of four random point masses, so that it is a possible one."""
    points = 0.15 * draw.normal(size=(4, 3))
    masses = draw.uniform(0.1, 1.0, size=4)
    center = masses @ points / masses.sum()
    points = points - center
    inertia = sum(
        m * (p @ p * np.eye(3) - np.outer(p, p)) for m, p in zip(masses, points, strict=True)
    )
    entries = [inertia[i, j] for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]
    return (
        f'<inertial pos="{_numbers(center)}" mass="{float(masses.sum())!r}" '
        f'fullinertia="{_numbers(entries)}"/>\n'
    )


def _geom(draw: np.random.Generator, index: int) -> str:
    """A sphere or capsule that can touch the ground, on some bodies."""
    kind = draw.choice(["none", "sphere", "capsule"])
    ends = 0.2 * draw.normal(size=6)
    if kind == "sphere":
        return f'<geom name="geom{index}" type="sphere" size="0.03" pos="{_numbers(ends[:3])}"/>\n'
    if kind == "capsule":
        return f'<geom name="geom{index}" type="capsule" size="0.02" fromto="{_numbers(ends)}"/>\n'
    return ""


def _place(draw: np.random.Generator, parent_turn: Floats) -> Floats:
    """Place a body 0.2 to 0.6 m from its parent in the plane, and somewhere beside the plane."""
    angle, distance = draw.uniform(0.0, 2.0 * np.pi), draw.uniform(0.2, 0.6)
    world = [distance * np.cos(angle), 0.1 * draw.normal(), distance * np.sin(angle)]
    return np.asarray(parent_turn.T @ np.array(world), dtype=np.float64)


def _turn(draw: np.random.Generator) -> Floats:
    """World axes of a body: as the world's, turned in the plane, or turned anyhow in space."""
    kind = draw.integers(3)
    if kind == 0:
        return np.eye(3)
    quaternion = draw.normal(size=4)
    if kind == 1:
        quaternion[[1, 3]] = 0.0
    return _rotation(quaternion / np.linalg.norm(quaternion))


def _rotation(quaternion: Floats) -> Floats:
    w, x, y, z = quaternion
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def _quaternion(turn: Floats) -> Floats:
    """Quaternion (w, x, y, z) of a rotation matrix, by the eigenvector that never divides by 0."""
    m = turn
    symmetric = np.array(
        [
            [m[0, 0] + m[1, 1] + m[2, 2], 0.0, 0.0, 0.0],
            [m[2, 1] - m[1, 2], m[0, 0] - m[1, 1] - m[2, 2], 0.0, 0.0],
            [m[0, 2] - m[2, 0], m[0, 1] + m[1, 0], m[1, 1] - m[0, 0] - m[2, 2], 0.0],
            [m[1, 0] - m[0, 1], m[0, 2] + m[2, 0], m[1, 2] + m[2, 1], m[2, 2] - m[0, 0] - m[1, 1]],
        ]
    )
    return np.asarray(np.linalg.eigh(symmetric)[1][:, -1], dtype=np.float64)  # lower triangle


def _sign(draw: np.random.Generator) -> float:
    return float(draw.choice([-1.0, 1.0]))


def _size(draw: np.random.Generator) -> float:
    return float(draw.uniform(0.5, 2.0))


def _numbers(values: Floats | list[float]) -> str:
    return " ".join(repr(float(value)) for value in values)
