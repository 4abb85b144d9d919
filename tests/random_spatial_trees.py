"""Random trees in space as MJCF, to hold our reader and kernels against MuJoCo.

They use everything that a robot in space may have: fixed or free bases, ball joints, hinges and
slides about any axes, branches, several joints on one body, bodies welded without a joint, joints
away from the body's origin, full inertia tensors, damping, armature, springs, and a reference
configuration that is not zero.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

JOINTS = (
    ("hinge",),
    ("hinge",),
    ("hinge",),
    ("slide",),
    ("ball",),
    ("slide", "hinge"),
    ("hinge", "slide"),
    ("hinge", "hinge"),
    ("hinge", "ball"),
)
"""Joints of one body, in order. Nothing turns after a ball joint, which MuJoCo has no way for."""


def random_spatial_tree(
    seed: int, *, bodies: int | None = None, base: str | None = None, springs: bool = True
) -> str:
    """Return the MJCF of a random tree in space; the same seed gives the same tree.

    Parameters
    ----------
    seed : int
        Seed of the random numbers.
    bodies : int, optional
        Number of bodies with joints, by default 2 to 12 at random.
    base : {"free", "fixed"}, optional
        Whether the first body moves freely; by default at random.
    springs : bool
        Whether joints may have springs, dampers and ranges.
    """
    draw = np.random.default_rng(seed)
    count = int(draw.integers(2, 13)) if bodies is None else bodies
    free = bool(draw.integers(2)) if base is None else base == "free"
    parents = [-1] + [int(draw.integers(max(0, i - 4), i)) for i in range(1, count)]
    children: list[list[int]] = [[] for _ in range(count)]
    for child, parent in enumerate(parents[1:], start=1):
        children[parent].append(child)
    driven: list[str] = []

    def body(index: int) -> str:
        text = f'<body name="body{index}" pos="{numbers(draw.uniform(-0.5, 0.5, 3))}" '
        text += f'quat="{numbers(unit(draw, 4))}">\n'
        if free and index == 0:
            text += '<freejoint name="base"/>\n'
        else:
            kinds = JOINTS[draw.integers(len(JOINTS))]
            text += "".join(joint(index, k, kind) for k, kind in enumerate(kinds))
        text += inertial(draw) + geom(draw, index)
        if draw.random() < 0.2:  # welded to this one
            text += f'<body pos="{numbers(draw.uniform(-0.3, 0.3, 3))}" '
            text += f'quat="{numbers(unit(draw, 4))}">{inertial(draw)}</body>\n'
        return text + "".join(body(child) for child in children[index]) + "</body>\n"

    def joint(index: int, k: int, kind: str) -> str:
        name = f"joint{index}_{k}"
        text = f'<joint name="{name}" type="{kind}" pos="{numbers(draw.uniform(-0.2, 0.2, 3))}"'
        if kind != "ball":
            text += f' axis="{numbers(unit(draw, 3))}" ref="{draw.uniform(-0.5, 0.5)!r}"'
            if draw.random() < 0.6:
                driven.append(name)
        text += f' armature="{float(draw.choice([0.0, 0.02]))!r}"'
        if springs:
            text += f' damping="{draw.uniform(0.0, 0.5)!r}"'
            if draw.random() < 0.3:
                text += f' stiffness="{draw.uniform(1.0, 10.0)!r}"'
                text += f' springref="{draw.uniform(-1, 1)!r}"' if kind != "ball" else ""
            if draw.random() < 0.3:
                low = 0.0 if kind == "ball" else -draw.uniform(1.0, 2.0)
                text += f' range="{low!r} {draw.uniform(1.0, 2.0)!r}"'
        return text + "/>\n"

    world = body(0)
    motors = "".join(
        f'<motor name="drive_{name}" joint="{name}" gear="{draw.uniform(0.5, 2.0)!r}" '
        f'ctrlrange="-1 2"/>\n'
        for name in driven
    )
    gravity = draw.normal(size=3) - np.array([0.0, 0.0, 9.81])
    return (
        f'<mujoco model="tree{seed}">\n<compiler angle="radian" autolimits="true"/>\n'
        f'<option gravity="{numbers(gravity)}"/>\n<worldbody>\n{world}</worldbody>\n'
        f"<actuator>\n{motors}</actuator>\n</mujoco>\n"
    )


def inertial(draw: np.random.Generator) -> str:
    """Inertia of four random point masses, so that it is a possible one."""
    points = 0.15 * draw.normal(size=(4, 3))
    masses = draw.uniform(0.1, 1.0, size=4)
    center = masses @ points / masses.sum()
    points = points - center
    tensor = sum(
        m * (p @ p * np.eye(3) - np.outer(p, p)) for m, p in zip(masses, points, strict=True)
    )
    entries = [tensor[i, j] for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]
    return (
        f'<inertial pos="{numbers(center)}" mass="{float(masses.sum())!r}" '
        f'fullinertia="{numbers(entries)}"/>\n'
    )


def geom(draw: np.random.Generator, index: int) -> str:
    """A sphere, capsule, box or cylinder that can touch the ground, on some bodies."""
    kind = draw.choice(["none", "sphere", "capsule", "box", "cylinder"])
    if kind == "none":
        return ""
    place = numbers(0.2 * draw.normal(size=3))
    return (
        f'<geom name="geom{index}" type="{kind}" size="0.03 0.05 0.02" pos="{place}" '
        f'quat="{numbers(unit(draw, 4))}"/>\n'
    )


def unit(draw: np.random.Generator, size: int) -> Floats:
    """Return a random vector of length one."""
    vector = draw.normal(size=size)
    return vector / np.linalg.norm(vector)


def numbers(values: object) -> str:
    """Write numbers with all their digits."""
    return " ".join(repr(float(value)) for value in np.ravel(values))
