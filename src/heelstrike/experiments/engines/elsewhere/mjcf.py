"""A robot in MuJoCo's format, for scripts of other Pythons whose engines read it.

It is read by its path, and imports nothing of this package.
"""

from __future__ import annotations

from typing import Any


def mjcf(tree: Any, friction: float, *, least_radius: float) -> str:
    """Return a robot and level ground as a file in MuJoCo's format, which other engines read.

    Joints and bodies are called ``q0``, ``q1``, …, by coordinates; geoms of contact points
    ``contact0``, …; the ground ``floor``.

    Parameters
    ----------
    tree : Tree
        The robot.
    friction : float
        Coefficient of both.
    least_radius : float
        Contact points become spheres of at least this radius (m), and touch where they did.
    """

    def numbers(*values: float) -> str:
        return " ".join(repr(float(value)) for value in values)

    def joint(i: int) -> str:
        link = tree.links[i]
        along = link["axis"]
        axis = (0.0, along[0], 0.0) if link["hinge"] else (along[0], 0.0, along[1])
        kind = "hinge" if link["hinge"] else "slide"
        limits = ""
        if link["lower"] is not None and link["upper"] is not None:
            limits = f' limited="true" range="{numbers(link["lower"], link["upper"])}"'
        return (
            f'<joint name="q{i}" type="{kind}" axis="{numbers(*axis)}" '
            f'damping="{link["damping"]!r}" armature="0"{limits}/>'
        )

    def body(i: int, joints: str, place: tuple[float, float]) -> str:
        link = tree.links[i]
        mass, inertia = link["mass"], link["inertia"]
        geoms = "".join(
            f'<geom name="contact{contact}" type="sphere" size="{max(radius, least_radius)!r}" '
            f'pos="{numbers(x, 0.0, z + max(radius, least_radius) - radius)}" '
            f'friction="{numbers(friction, 0.0, 0.0)}" mass="0"/>'
            for contact, x, z, radius in link["points"]
        )
        children = "".join(
            body(k, joint(k), each["place"])
            for k, each in enumerate(tree.links)
            if k > 2 and each["parent"] == i
        )
        return (
            f'<body name="q{i}" pos="{numbers(place[0], 0.0, place[1])}">{joints}'
            f'<inertial pos="{numbers(link["center"][0], 0.0, link["center"][1])}" '
            f'mass="{mass!r}" diaginertia="{numbers(inertia, inertia, inertia)}"/>'
            f"{geoms}{children}</body>"
        )

    x, z, _ = tree.poses([0.0] * tree.count)[2]
    trunk = body(2, "".join(joint(i) for i in range(3)), (x, z))
    down = numbers(tree.gravity[0], 0.0, tree.gravity[1])
    return (
        '<mujoco model="robot"><compiler angle="radian" autolimits="false"/>'
        f'<option gravity="{down}"/><default><geom contype="1" conaffinity="2"/></default>'
        '<worldbody><geom name="floor" type="plane" size="100 100 1" contype="2" conaffinity="1" '
        f'friction="{numbers(friction, 0.0, 0.0)}"/>{trunk}</worldbody></mujoco>'
    )
