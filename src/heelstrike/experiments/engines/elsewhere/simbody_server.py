"""Simbody, by way of OpenSim: points on a law of exponential springs.

OpenSim brings a CasADi of its own, beside which no other can be loaded: hence a process that
imports nothing of this package. Its plane is x-y, so that our (x, z) is its (x, y), and a turn
about our +y one about its -z.

Its contacts are compliant: `ExponentialContactForce` has a station on a body, which is a contact
point of ours, and an anchored spring for friction.
"""

from __future__ import annotations

import math
import runpy
from pathlib import Path
from typing import Any

import opensim

shared = runpy.run_path(str(Path(__file__).with_name("exchange.py")))
Server, Tree = shared["Server"], shared["Tree"]
settings_of = shared["settings_of"]

STOP, STOP_DAMPING, STOP_WIDTH = 1e3, 1.0, 0.5
"""Stiffness (N m/degree), damping (N m s/degree) and width (degrees) of the stops of joints."""

FAINT = 1e-3
"""Normal force in parts of the weight below which a point is told not to touch."""

SHAPE = (0.0065905, 0.5336, 1150.0)
"""OpenSim's own d0, d1 and d2 of the normal force."""


class Robot:
    """A robot in Simbody.

    Its settings are ``integrator``, one that OpenSim's Manager knows, whose longest step is ours
    and which takes shorter ones by itself, and its ``accuracy``; of the contacts ``shape``, d0 (m),
    d1 (N) and d2 (1/m) of the normal force d1 exp(-d2 (z - d0)), ``viscosity`` of that (s/m), and
    ``elasticity`` (N/m) and viscosity ``grip`` (N s/m) of the springs that friction is.
    """

    def __init__(self, asked: dict[str, Any]) -> None:
        known = {
            "integrator": "RungeKuttaMerson", "accuracy": 1e-3, "shape": None, "viscosity": None,
            "elasticity": None, "grip": None,
        }  # fmt: skip
        settings = settings_of(asked, known)
        opensim.Logger.setLevelString("Off")
        self.asked, self.settings = asked, settings
        self.tree = Tree(asked["links"])
        if any(point[3] for link in self.tree.links for point in link["points"]):
            raise ValueError("this engine is not given discs, only contact points")
        mass = sum(link["mass"] for link in self.tree.links)
        self.weight = mass * math.hypot(*self.tree.gravity)
        self.turns = [-turn if turn else 1.0 for turn in self.tree.turns]
        self.model = opensim.Model()
        gravity = self.tree.gravity
        self.model.setGravity(opensim.Vec3(gravity[0], gravity[1], 0.0))
        self.springs: dict[int, Any] = {}
        self._build()
        self.controller = self._drive()
        self.motors: list[Any] = []
        self.now = self.model.initSystem()
        coordinates = self.model.getCoordinateSet()
        self.coordinates = [coordinates.get(f"q{i}") for i in range(self.tree.count)]
        self.time = 0.0

    def _build(self) -> None:
        model, tree = self.model, self.tree
        zero = opensim.Vec3(0.0)
        bodies: dict[int, Any] = {}
        rest = tree.poses([0.0] * tree.count)[2]
        for i in tree.bodies:
            link = tree.links[i]
            inertia = link["inertia"]
            body = opensim.Body(
                f"link{i}", link["mass"], _vector(link["center"]),
                opensim.Inertia(inertia, inertia, inertia),
            )  # fmt: skip
            model.addBody(body)
            bodies[i] = body
            if i == 2:
                joint = opensim.PlanarJoint(
                    "joint2", model.getGround(), _vector(rest), zero, body, zero, zero
                )
                for k, name in enumerate(("q2", "q0", "q1")):
                    joint.upd_coordinates(k).setName(name)
            else:
                joint = opensim.PinJoint(
                    f"joint{i}", bodies[link["parent"]], _vector(link["place"]), zero, body, zero,
                    zero,
                )  # fmt: skip
                joint.upd_coordinates(0).setName(f"q{i}")
            model.addJoint(joint)
            if link["lower"] is not None and link["upper"] is not None:
                low, high = sorted(
                    math.degrees(self.turns[i] * link[side]) for side in ("lower", "upper")
                )
                model.addForce(
                    opensim.CoordinateLimitForce(
                        f"q{i}", high, STOP, low, STOP, STOP_DAMPING, STOP_WIDTH, False
                    )
                )
            for contact, x, z, _ in link["points"]:
                self.springs[contact] = self._spring(body, (x, z), contact)

    def _spring(self, body: Any, place: tuple[float, float], contact: int) -> Any:
        settings = self.settings
        upright = opensim.Transform(
            opensim.Rotation(-0.5 * math.pi, opensim.CoordinateAxis(0)),
            opensim.Vec3(0.0, -self._level(), 0.0),
        )
        spring = opensim.ExponentialContactForce(upright, body, _vector(place))
        spring.setName(f"contact{contact}")
        if settings["shape"] is not None:
            spring.setExponentialShapeParameters(opensim.Vec3(*settings["shape"]))
        if settings["viscosity"] is not None:
            spring.setNormalViscosity(settings["viscosity"])
        if settings["elasticity"] is not None:
            spring.setFrictionElasticity(settings["elasticity"])
        if settings["grip"] is not None:
            spring.setFrictionViscosity(settings["grip"])
        self.model.addForce(spring)
        return spring

    def _level(self) -> float:
        """Height (m) over OpenSim's plane at which a point bears half the weight.

        The force reaches beyond the plane without end; that height is where our ground is.
        """
        d0, d1, d2 = self.settings["shape"] or SHAPE
        return d0 - math.log(0.5 * self.weight / d1) / d2

    def _drive(self) -> Any:
        model, tree = self.model, self.tree
        for i in tree.bodies:
            if tree.links[i]["damping"]:
                damper = opensim.SpringGeneralizedForce(f"q{i}")
                damper.setStiffness(0.0)
                damper.setViscosity(tree.links[i]["damping"])
                model.addForce(damper)
        if not tree.actuators:
            return None
        controller = opensim.PrescribedController()
        for k, joint in enumerate(tree.actuators):
            motor = opensim.CoordinateActuator(f"q{joint}")
            motor.setName(f"motor{k}")
            motor.setOptimalForce(self.turns[joint])
            motor.setMinControl(-math.inf)
            motor.setMaxControl(math.inf)
            model.addForce(motor)
            controller.addActuator(motor)
        for k in range(len(tree.actuators)):
            controller.prescribeControlForActuator(f"motor{k}", opensim.Constant(0.0))
        model.addController(controller)
        model.finalizeConnections()
        return controller

    def place(self, q: list[float], v: list[float]) -> None:
        """Put the robot somewhere, at time 0."""
        state = self.now = self.model.initSystem()
        state.setTime(0.0)
        if self.controller is not None:
            functions = self.controller.upd_ControlFunctions()
            self.motors = [
                opensim.Constant.safeDownCast(functions.get(k)) for k in range(functions.getSize())
            ]
        for each, turn, value, rate in zip(self.coordinates, self.turns, q, v, strict=True):
            each.setValue(state, turn * value, False)
            each.setSpeedValue(state, turn * rate)
        for spring in self.springs.values():
            spring.setMuStatic(state, self.asked["friction"])
            spring.setMuKinetic(state, self.asked["friction"])
        self.model.realizePosition(state)
        for spring in self.springs.values():
            spring.resetAnchorPoint(state)
        self.manager = manager = opensim.Manager(self.model)
        manager.setIntegratorMethod(
            getattr(manager, f"IntegratorMethod_{self.settings['integrator']}")
        )
        manager.setIntegratorAccuracy(self.settings["accuracy"])
        manager.setIntegratorMaximumStepSize(self.asked["step"])
        manager.setWriteToStorage(False)
        manager.setPerformAnalyses(False)
        manager.initialize(state)
        self.steps = 0

    def step(self, torque: list[float]) -> None:
        """Simulate a step under torques of the actuators."""
        for motor, value in zip(self.motors, torque, strict=True):
            motor.setValue(value)
        self.steps += 1
        self.now = self.manager.integrate(self.steps * self.asked["step"])

    def close(self) -> None:
        """Leave nothing behind that needs to be ended."""

    def state(self) -> tuple[list[float], list[float]]:
        """Position and velocity."""
        pairs = list(zip(self.coordinates, self.turns, strict=True))
        q = [turn * each.getValue(self.now) for each, turn in pairs]
        return q, [turn * each.getSpeedValue(self.now) for each, turn in pairs]

    def forces(self) -> list[tuple[float, float]]:
        """On the contact points at the end of the last step, upwards and forward.

        The law reaches far above the ground; what is fainter than `FAINT` is told as nothing.
        """
        self.model.realizeDynamics(self.now)
        found = []
        for contact in range(self.tree.contacts):
            force = self.springs[contact].getForce(self.now, True)
            felt = force.get(1) > FAINT * self.weight
            found.append((force.get(1), force.get(0)) if felt else (0.0, 0.0))
        return found


def _vector(place: Any) -> Any:
    """Put a place (x, z) of ours into OpenSim's plane."""
    return opensim.Vec3(place[0], place[1], 0.0)


answer = Server(Robot).answer
