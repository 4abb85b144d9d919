"""ODE, in a Python that has it: links as bodies, hinges, and the plane as its Plane2D joint.

ODE's plane is x-y, so that our (x, z) is its (x, y), and a turn about our +y one about its -z.
"""

from __future__ import annotations

import math
import runpy
from pathlib import Path
from typing import Any

import ode

shared = runpy.run_path(str(Path(__file__).with_name("exchange.py")))
Server, Tree = shared["Server"], shared["Tree"]
settings_of = shared["settings_of"]

AS_GOOD_AS_NONE = 1e-9
"""Mass (kg) and inertia (kg m²) that stand for none."""


class Robot:
    """A robot in ODE.

    Its settings are ``solver`` (``"step"``, exact, or ``"quick"``, iterative), ``iterations`` of
    the latter, ``erp`` and ``cfm`` of the world, ``layer``: how deep contacts may stay (m), and
    ``slip``: force-dependent slip.
    """

    def __init__(self, asked: dict[str, Any]) -> None:
        known = {
            "solver": "step", "iterations": 20, "erp": None, "cfm": None, "layer": 0.0,
            "margin": 0.0,
        }  # fmt: skip
        settings = settings_of(asked, known)
        self.tree = tree = Tree(asked["links"])
        self.h = asked["step"]
        self.settings = settings
        self.world = world = ode.World()
        world.setGravity((tree.gravity[0], tree.gravity[1], 0.0))
        world.setAutoDisableFlag(False)
        world.setContactSurfaceLayer(settings["layer"])
        world.setQuickStepNumIterations(settings["iterations"])
        if settings["erp"] is not None:
            world.setERP(settings["erp"])
        if settings["cfm"] is not None:
            world.setCFM(settings["cfm"])
        world.setLinearDamping(0.0)
        world.setAngularDamping(0.0)
        self.take = world.quickStep if settings["solver"] == "quick" else world.step
        self.group = ode.JointGroup()
        self.bodies = {i: self._body(tree.links[i]) for i in tree.bodies}
        self.q = [0.0] * tree.count
        self.place(self.q, self.q)
        self.joints: dict[int, Any] = {}
        self.planar = []
        for i in tree.bodies:
            planar = ode.Plane2DJoint(world)
            planar.attach(self.bodies[i], ode.environment)
            self.planar.append(planar)
            if tree.links[i]["parent"] >= 2:
                self.joints[i] = self._hinge(i)
        self.surface = ode.Contact()
        self.surface.setMu(asked["friction"])
        mode = ode.ContactApprox1
        if asked["restitution"] > 0.0:
            mode |= ode.ContactBounce
            self.surface.setBounce(asked["restitution"])
            self.surface.setBounceVel(0.0)
        self.surface.setMode(mode)
        self.pressed: list[tuple[int, Any]] = []
        self.told = [(0.0, 0.0)] * tree.contacts

    def _body(self, link: dict[str, Any]) -> Any:
        body = ode.Body(self.world)
        mass = ode.Mass()
        inertia = max(link["inertia"], AS_GOOD_AS_NONE)
        mass.setParameters(
            max(link["mass"], AS_GOOD_AS_NONE),
            0.0,
            0.0,
            0.0,
            inertia,
            inertia,
            inertia,
            0.0,
            0.0,
            0.0,
        )
        body.setMass(mass)
        return body

    def _hinge(self, i: int) -> Any:
        link = self.tree.links[i]
        joint = ode.HingeJoint(self.world)
        joint.attach(self.bodies[i], self.bodies[link["parent"]])
        x, z, _ = self.tree.poses([0.0] * self.tree.count)[i]
        joint.setAnchor((x, z, 0.0))
        # ODE's angle is that of the first body; our turn about +y is one about its -z.
        joint.setAxis((0.0, 0.0, -self.tree.turns[i]))
        if link["lower"] is not None:
            joint.setParam(ode.ParamLoStop, max(link["lower"], -math.pi))
        if link["upper"] is not None:
            joint.setParam(ode.ParamHiStop, min(link["upper"], math.pi))
        return joint

    def place(self, q: list[float], v: list[float]) -> None:
        """Put the robot somewhere."""
        self.q = list(q)
        poses, motions = self.tree.poses(q), self.tree.motions(q, v)
        for i, body in self.bodies.items():
            (x, z, angle), (vx, vz, rate) = poses[i], motions[i]
            cx, cz = self.tree.links[i]["center"]
            c, s = math.cos(angle), math.sin(angle)
            dx, dz = c * cx + s * cz, c * cz - s * cx
            body.setPosition((x + dx, z + dz, 0.0))
            body.setQuaternion((math.cos(-0.5 * angle), 0.0, 0.0, math.sin(-0.5 * angle)))
            body.setLinearVel((vx + rate * dz, vz - rate * dx, 0.0))
            body.setAngularVel((0.0, 0.0, -rate))

    def _poses(self) -> tuple[dict[int, Any], dict[int, Any]]:
        poses, motions = {}, {}
        for i, body in self.bodies.items():
            x, z, _ = body.getPosition()
            turn = body.getRotation()
            c, s = turn[0], turn[1]  # of our angle, which turns the other way
            angle = math.atan2(s, c)
            vx, vz, _ = body.getLinearVel()
            rate = -body.getAngularVel()[2]
            cx, cz = self.tree.links[i]["center"]
            dx, dz = c * cx + s * cz, c * cz - s * cx
            poses[i] = (x - dx, z - dz, angle)
            motions[i] = (vx - rate * dz, vz + rate * dx, rate)
        return poses, motions

    def step(self, torque: list[float]) -> None:
        """Simulate a step under torques of the actuators."""
        poses, motions = self._poses()
        self.close()
        for i in self.tree.bodies:
            for contact, x, z in self.tree.points(poses[i], i):
                if z < self.settings["margin"]:
                    self.surface.setContactGeomParams((x, z, 0.0), (0.0, 1.0, 0.0), -z)
                    joint = ode.ContactJoint(self.world, self.group, self.surface)
                    joint.attach(self.bodies[i], ode.environment)
                    joint.setFeedback(True)
                    self.pressed.append((contact, joint))
        for value, i in zip(torque, self.tree.actuators, strict=True):
            self.joints[i].addTorque(value)
        for i, joint in self.joints.items():
            damping = self.tree.links[i]["damping"]
            if damping:
                rate = motions[i][2] - motions[self.tree.links[i]["parent"]][2]
                joint.addTorque(-damping * self.tree.turns[i] * rate)
        self.take(self.h)
        for body in self.bodies.values():  # what little of a turn out of the plane rounding makes
            turn = body.getQuaternion()
            size = math.hypot(turn[0], turn[3])
            body.setQuaternion((turn[0] / size, 0.0, 0.0, turn[3] / size))
            body.setAngularVel((0.0, 0.0, body.getAngularVel()[2]))
        found = [(0.0, 0.0)] * self.tree.contacts
        for contact, joint in self.pressed:
            force = joint.getFeedback()[0]
            found[contact] = (force[1], force[0])
        self.told = found

    def close(self) -> None:
        """Take the contact joints away; what is freed later must tell no forces, or ODE aborts."""
        for _, joint in self.pressed:
            joint.setFeedback(False)
        self.group.empty()
        self.pressed = []

    def state(self) -> tuple[list[float], list[float]]:
        """Position and velocity."""
        poses, motions = self._poses()
        self.q, v = self.tree.coordinates(poses, motions, self.q)
        return self.q, v

    def forces(self) -> list[tuple[float, float]]:
        """Of the last step on the contact points, upwards and forward."""
        return self.told


answer = Server(Robot).answer
