"""Siconos, in a Python that has it: a Lagrangian system in coordinates of the joints.

Siconos asks whoever uses it for the mass matrix, the forces and the relations of the contacts; they
are computed here from the links, at the beginning of each step. What it does itself is the rest:
Moreau-Jean's time stepping with its index sets, Newton's impact law with Coulomb's friction in the
plane, and the solver.
"""

from __future__ import annotations

import runpy
from pathlib import Path
from typing import Any

import numpy as np
import siconos.kernel as kernel
import siconos.numerics as numerics

shared = runpy.run_path(str(Path(__file__).with_name("exchange.py")))
Server, Tree = shared["Server"], shared["Tree"]
settings_of = shared["settings_of"]

SOLVERS = {
    "lemke": numerics.SICONOS_FRICTION_2D_LEMKE,
    "nsgs": numerics.SICONOS_FRICTION_2D_NSGS,
    "enum": numerics.SICONOS_FRICTION_2D_ENUM,
}
FOREVER = 1e6
"""End of a simulation that nobody reaches, in s."""


class Chain:
    """Mass matrix, forces and Jacobians of a robot in the coordinates of its joints.

    Parameters
    ----------
    tree : Tree
        The robot.
    """

    def __init__(self, tree: Any) -> None:
        self.tree = tree
        self.above = np.zeros((tree.count, tree.count))
        for i, link in enumerate(tree.links):
            if link["parent"] >= 0:
                self.above[i] = self.above[link["parent"]]
            self.above[i, i] = 1.0
        self.hinge = np.array([float(link["hinge"]) for link in tree.links])
        self.turn = np.array(tree.turns)
        self.slide = np.array([[0.0, 0.0] if k["hinge"] else k["axis"] for k in tree.links])
        self.mass = np.array([link["mass"] for link in tree.links])
        self.inertia = np.array([link["inertia"] for link in tree.links])
        self.center = np.array([link["center"] for link in tree.links])
        self.damping = np.array([link["damping"] for link in tree.links])
        self.gravity = np.array(tree.gravity)
        self.parent = [link["parent"] for link in tree.links]
        owned = [(p[0], i, p[1], p[2], p[3]) for i, k in enumerate(tree.links) for p in k["points"]]
        owned.sort()
        self.point_link = np.array([p[1] for p in owned], dtype=int)
        self.point = np.array([[p[2], p[3]] for p in owned]).reshape(-1, 2)
        self.radius = np.array([p[4] for p in owned])

    def look(self, q: Any, v: Any) -> None:
        """Place the links, with their velocities and what accelerates them without v̇."""
        poses = np.array(self.tree.poses(q))
        self.origin, angle = poses[:, :2], poses[:, 2]
        self.cos, self.sin = np.cos(angle), np.sin(angle)
        self.rate = self.above @ (self.turn * v)
        self.bias = np.zeros_like(self.origin)
        for i, parent in enumerate(self.parent):
            if parent >= 0:
                arm = self.origin[i] - self.origin[parent]
                self.bias[i] = self.bias[parent] - self.rate[parent] ** 2 * arm

    def turned(self, vectors: Any, links: Any) -> Any:
        """Vectors (n, 2) of link frames in world axes."""
        c, s = self.cos[links], self.sin[links]
        x, z = vectors[:, 0], vectors[:, 1]
        return np.stack((c * x + s * z, c * z - s * x), axis=-1)

    def jacobian(self, places: Any, links: Any) -> Any:
        """Velocities (x, z) of points of links by the rates of the coordinates, (n, 2, nv)."""
        arm = places[:, None, :] - self.origin[None, :, :]
        moved = self.above[links][:, None, :] * (
            self.turn * np.stack((arm[..., 1], -arm[..., 0]), axis=1) + self.slide.T[None]
        )
        return moved

    def equations(self, v: Any, torque: Any) -> tuple[Any, Any]:
        """Mass matrix and the forces that are not inertia's."""
        every = np.arange(len(self.mass))
        arm = self.turned(self.center, every)
        places = self.origin + arm
        moved = self.jacobian(places, every)
        turning = self.above * self.turn
        matrix = np.einsum("i,ikm,ikn->mn", self.mass, moved, moved)
        matrix += np.einsum("i,im,in->mn", self.inertia, turning, turning)
        bias = self.bias - self.rate[:, None] ** 2 * arm
        force = np.einsum("i,ikm,ik->m", self.mass, moved, self.gravity - bias)
        force -= self.damping * v
        force[self.tree.actuators] += torque
        return matrix, force

    def contacts(self) -> tuple[Any, Any]:
        """Gaps and places along the ground of the contact points, (n, 2), and their rates."""
        places = self.origin[self.point_link] + self.turned(self.point, self.point_link)
        places[:, 1] -= self.radius
        return places[:, ::-1], self.jacobian(places, self.point_link)[:, ::-1]


class Robot:
    """A robot in Siconos.

    Its settings are ``theta`` of Moreau-Jean's scheme, ``solver`` (of `SOLVERS`), ``tolerance`` and
    ``iterations`` of that.
    """

    def __init__(self, asked: dict[str, Any]) -> None:
        known = {
            "theta": 0.5, "solver": "lemke", "tolerance": 1e-8, "iterations": 1000,
        }  # fmt: skip
        settings = settings_of(asked, known)
        self.asked, self.settings = asked, settings
        self.tree = Tree(asked["links"])
        self.chain = Chain(self.tree)
        self.torque = np.zeros(len(self.tree.actuators))
        zero = [0.0] * self.tree.count
        self.place(zero, zero)

    def place(self, q: list[float], v: list[float]) -> None:
        """Put the robot somewhere: a simulation of its own begins there."""
        asked, settings = self.asked, self.settings
        self.body = kernel.LagrangianDS(q, v, np.eye(len(q)))
        self.body.setFExtPtr(np.zeros(len(q)))
        model = kernel.NonSmoothDynamicalSystem(0.0, FOREVER)
        model.insertDynamicalSystem(self.body)
        law = kernel.NewtonImpactFrictionNSL(asked["restitution"], 0.0, asked["friction"], 2)
        self.points = [
            kernel.LagrangianLinearTIR(np.zeros((2, len(q))), np.zeros(2))
            for _ in range(self.tree.contacts)
        ]
        self.interactions = [kernel.Interaction(law, point) for point in self.points]
        for each in self.interactions:
            model.link(each, self.body)
        scheme = kernel.MoreauJeanOSI(settings["theta"])
        clock = kernel.TimeDiscretisation(0.0, asked["step"])
        self._refresh()
        solver = kernel.FrictionContact(2, SOLVERS[settings["solver"]])
        options = solver.numericsSolverOptions()
        options.dparam[numerics.SICONOS_DPARAM_TOL] = settings["tolerance"]
        options.iparam[numerics.SICONOS_IPARAM_MAX_ITER] = settings["iterations"]
        self.simulation = kernel.TimeStepping(model, clock, scheme, solver)
        self.simulation.initialize()
        self.kept = model, law, scheme, clock, solver

    def _refresh(self) -> None:
        """Hand over mass matrix, forces and relations of where it is."""
        q, v = np.array(self.body.q()), np.array(self.body.velocity())
        self.chain.look(q, v)
        self.body.mass()[:, :], self.body.fExt()[:] = self.chain.equations(v, self.torque)
        if self.points:
            gaps, rates = self.chain.contacts()
            for point, gap, rate in zip(self.points, gaps, rates, strict=True):
                point.C()[:, :] = rate
                point.e()[:] = gap - rate @ q

    def step(self, torque: list[float]) -> None:
        """Simulate a step under torques of the actuators."""
        self.torque[:] = torque
        self._refresh()
        self.simulation.computeOneStep()
        self.told = self._forces()
        self.simulation.nextStep()

    def _forces(self) -> list[tuple[float, float]]:
        found = []
        for each in self.interactions:
            impulse = each.lambda_(1)
            found.append((impulse[0] / self.asked["step"], impulse[1] / self.asked["step"]))
        return found

    def close(self) -> None:
        """Leave nothing behind that needs to be ended."""

    def state(self) -> tuple[list[float], list[float]]:
        """Position and velocity."""
        return list(self.body.q()), list(self.body.velocity())

    def forces(self) -> list[tuple[float, float]]:
        """Of the last step on the contact points, upwards and forward."""
        return self.told


answer = Server(Robot).answer
