"""Genesis, in a Python that has it: a tree in the coordinates of its joints, told as MJCF.

It computes in double precision, on the processor. Its kernels are compiled where a robot is made,
for minutes the first time on a machine; after that they are read from its cache.

The robot is as we have it: without the armature of 0.1 kg m² that Genesis gives to joints of MJCF
that have none. Its contact points are spheres of at least `FINEST_SPHERE`, which touch the ground
where ours do.
"""

from __future__ import annotations

import os
import runpy
import tempfile
from pathlib import Path
from time import process_time
from typing import Any

import genesis as gs
import numpy as np

shared = runpy.run_path(str(Path(__file__).with_name("exchange.py")))
Server, Tree = shared["Server"], shared["Tree"]
settings_of = shared["settings_of"]

FINEST_SPHERE = 1e-4
"""Least radius of a contact point, in m: Genesis has no points, and fails on a grid of smaller
ones."""

COMPILED = 30.0
"""Processor time (s) above which a robot's kernels have been compiled: read from the cache they
take ten seconds."""


def begin() -> None:
    """Begin with Genesis, whatever it had."""
    gs.destroy()
    gs.init(backend=gs.cpu, precision="64", logging_level="error")


begin()


class Robot:
    """A robot in Genesis.

    Its settings are those of its ``RigidOptions``: ``integrator``, ``iterations``, ``tolerance``,
    ``noslip_iterations``, ``friction_cone``, ``contact_resolution``, ``impratio`` and
    ``constraint_timeconst`` (s); 0 of the last is the least that the step allows. None is
    Genesis's own choice.
    """

    def __init__(self, asked: dict[str, Any]) -> None:
        known = {
            "integrator": None, "iterations": None, "tolerance": None, "noslip_iterations": None,
            "friction_cone": None, "contact_resolution": None, "impratio": None,
            "constraint_timeconst": None,
        }  # fmt: skip
        settings = settings_of(asked, known)
        if asked["restitution"]:
            raise ValueError("this engine is not given restitution")
        self.tree = Tree(asked["links"])
        before = process_time()
        self._build(asked, settings)
        if process_time() - before > COMPILED:
            # The cache is written when Genesis ends, and this process may be ended at any time.
            begin()
            self._build(asked, settings)

    def _build(self, asked: dict[str, Any], settings: dict[str, Any]) -> None:
        """Make the scene, and take a step, for which all kernels are needed."""
        tree = self.tree
        self.scene = gs.Scene(
            sim_options=gs.options.SimOptions(
                dt=asked["step"], substeps=1, gravity=(tree.gravity[0], 0.0, tree.gravity[1])
            ),
            rigid_options=gs.options.RigidOptions(**_options(settings)),
            show_viewer=False,
        )
        material = gs.materials.Rigid(friction=asked["friction"])
        self.scene.add_entity(gs.morphs.Plane(visualization=False), material=material)
        handle, name = tempfile.mkstemp(suffix=".xml")
        try:
            with os.fdopen(handle, "w") as file:
                file.write(mjcf(tree))
            self.robot = self.scene.add_entity(
                gs.morphs.MJCF(file=name, default_armature=None, visualization=False),
                material=material,
            )
            self.scene.build()
        finally:
            Path(name).unlink()
        joints = [self.robot.get_joint(f"q{i}") for i in range(tree.count)]
        self.dofs = [joint.dofs_idx_local[0] for joint in joints]
        self.rows = [joint.qs_idx_local[0] for joint in joints]
        self.driven = [self.dofs[i] for i in tree.actuators]
        told = [point[0] for i in self._order() for point in tree.links[i]["points"]]
        self.point = {
            geom.idx: contact for geom, contact in zip(self.robot.geoms, told, strict=True)
        }
        self.place([0.0] * tree.count, [0.0] * tree.count)
        self.step([0.0] * len(tree.actuators))
        self.forces()

    def _order(self) -> list[int]:
        """Return our links in the order of Genesis's."""
        names = [link.name for link in self.robot.links]
        return sorted(self.tree.bodies, key=lambda i: names.index(f"link{i}"))

    def place(self, q: list[float], v: list[float]) -> None:
        """Put the robot somewhere, at time 0."""
        self.robot.set_qpos(np.array(q), self.rows, zero_velocity=False)
        self.robot.set_dofs_velocity(np.array(v), self.dofs)

    def step(self, torque: list[float]) -> None:
        """Simulate a step under torques of the actuators."""
        if self.driven:
            self.robot.control_dofs_force(np.array(torque), self.driven)
        self.scene.step()

    def state(self) -> tuple[list[float], list[float]]:
        """Position and velocity."""
        q, v = self.robot.get_qpos(), self.robot.get_dofs_velocity()
        return q[self.rows].tolist(), v[self.dofs].tolist()

    def forces(self) -> list[tuple[float, float]]:
        """Of the last step on the contact points, upwards and forward."""
        found = [(0.0, 0.0)] * self.tree.contacts
        told = self.robot.get_contacts()
        first, second = told["geom_a"].tolist(), told["geom_b"].tolist()
        for a, b, force in zip(first, second, told["force_b"].tolist(), strict=True):
            sign = 1.0 if b in self.point else -1.0
            contact = self.point[b if b in self.point else a]
            up, along = found[contact]
            found[contact] = up + sign * force[2], along + sign * force[0]
        return found

    def close(self) -> None:
        """End the scene."""
        self.scene.destroy()


def _options(settings: dict[str, Any]) -> dict[str, Any]:
    """Return settings as Genesis has them, without those that it chooses itself."""
    found = {name: value for name, value in settings.items() if value is not None}
    for name in ("integrator", "friction_cone", "contact_resolution"):
        if name in found:
            found[name] = getattr(getattr(gs, name), found[name])
    if found.get("constraint_timeconst") == 0.0:
        found["constraint_timeconst"] = None
    return found


def mjcf(tree: Any) -> str:
    """Return a robot in MuJoCo's format: joints ``q0``, ``q1``, …, by coordinates.

    Parameters
    ----------
    tree : Tree
        The robot.
    """

    def numbers(*values: float) -> str:
        return " ".join(repr(float(value)) for value in values)

    def joint(i: int) -> str:
        link = tree.links[i]
        along = link["axis"]
        axis = (0.0, along[0], 0.0) if link["hinge"] else (along[0], 0.0, along[1])
        kind = "hinge" if link["hinge"] else "slide"
        limits = 'limited="false"'
        if link["lower"] is not None and link["upper"] is not None:
            limits = f'limited="true" range="{numbers(link["lower"], link["upper"])}"'
        return (
            f'<joint name="q{i}" type="{kind}" axis="{numbers(*axis)}" '
            f'damping="{numbers(link["damping"])}" {limits}/>'
        )

    def body(i: int, joints: str, place: tuple[float, float]) -> str:
        link = tree.links[i]
        inertia = link["inertia"]
        geoms = "".join(
            f'<geom type="sphere" size="{numbers(max(radius, FINEST_SPHERE))}" '
            f'pos="{numbers(x, 0.0, z + max(radius, FINEST_SPHERE) - radius)}"/>'
            for _, x, z, radius in link["points"]
        )
        children = "".join(
            body(k, joint(k), each["place"])
            for k, each in enumerate(tree.links)
            if k > 2 and each["parent"] == i
        )
        return (
            f'<body name="link{i}" pos="{numbers(place[0], 0.0, place[1])}">{joints}'
            f'<inertial pos="{numbers(link["center"][0], 0.0, link["center"][1])}" '
            f'mass="{numbers(link["mass"])}" diaginertia="{numbers(inertia, inertia, inertia)}"/>'
            f"{geoms}{children}</body>"
        )

    x, z, _ = tree.poses([0.0] * tree.count)[2]
    trunk = body(2, "".join(joint(i) for i in range(3)), (x, z))
    return (
        '<mujoco model="robot"><compiler angle="radian" autolimits="false"/>'
        '<default><geom contype="1" conaffinity="2"/></default>'
        f"<worldbody>{trunk}</worldbody></mujoco>"
    )


answer = Server(Robot).answer
