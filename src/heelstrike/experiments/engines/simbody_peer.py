"""Simbody's side of a comparison, by way of OpenSim: points on a law of exponential springs.

OpenSim's plane is x-y, so that our (x, z) is its (x, y), and a turn about our +y one about its -z.
Its contacts are compliant: `ExponentialContactForce` has a station on a body, which is a contact
point of ours, and an anchored spring for friction.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import opensim

from heelstrike.experiments.engines.links import links
from heelstrike.experiments.engines.peer import Engine, InvalidRunError, Peer
from heelstrike.experiments.engines.scenario import Scenario
from heelstrike.robot.model import Floats

STOP, STOP_DAMPING, STOP_WIDTH = 1e3, 1.0, 0.5
"""Stiffness (N m/degree), damping (N m s/degree) and width (degrees) of the stops of joints."""


class SimbodyPeer(Peer):
    """A scenario in Simbody.

    Parameters
    ----------
    scenario : Scenario
    step : float
        Seconds: the longest step of its integrator, which takes shorter ones by itself.
    integrator : str
        ``"RungeKuttaMerson"``, ``"SemiExplicitEuler2"``, or another that OpenSim's Manager knows.
    accuracy : float
        Of the integrator.
    shape : (float, float, float)
        d0 (m), d1 (N) and d2 (1/m) of the normal force d1 exp(−d2 (z − d0)).
    damping : float
        Of the normal force, in s/m.
    elasticity : float
        Of the springs that friction is, in N/m.
    """

    settling = 1.0
    bounces = False

    def __init__(
        self,
        scenario: Scenario,
        step: float,
        *,
        integrator: str = "RungeKuttaMerson",
        accuracy: float = 1e-3,
        shape: tuple[float, float, float] = (0.0065905, 0.5336, 1150.0),
        damping: float = 0.5,
        elasticity: float | None = None,
    ) -> None:
        super().__init__(scenario, step)
        if not scenario.robot.floating:
            raise InvalidRunError("only robots that float are handed over to this engine")
        opensim.Logger.setLevelString("Off")
        self._shape = shape
        self._damping_of_contacts, self._elasticity = damping, elasticity
        self._model = opensim.Model()
        self._turns = np.ones(scenario.robot.nv)
        self._springs = self._build()
        self._controls = self._drive()
        self._state = self._model.initSystem()
        self._coordinates = [
            self._model.getCoordinateSet().get(f"q{i}") for i in range(scenario.robot.nv)
        ]
        self._integrator, self._accuracy = integrator, accuracy
        self._manager: Any = None
        self._time = 0.0

    def _build(self) -> dict[int, Any]:
        model, robot = self._model, self.scenario.robot
        gravity = robot.model.gravity
        model.setGravity(opensim.Vec3(float(gravity[0]), float(gravity[1]), 0.0))
        chain = links(robot)
        zero = opensim.Vec3(0.0)
        bodies: dict[int, Any] = {}
        springs: dict[int, Any] = {}
        if any(link.hinge for link in chain[:2]) or not all(link.hinge for link in chain[2:]):
            raise InvalidRunError("only a trunk that floats, with hinges, is handed over")
        for i, link in enumerate(chain):
            if i < 2:
                continue
            body = opensim.Body(
                f"link{i}", link.mass, _vector(link.center),
                opensim.Inertia(link.inertia, link.inertia, link.inertia),
            )  # fmt: skip
            model.addBody(body)
            bodies[i] = body
            self._turns[i] = -link.axis[1]
            if i == 2:
                rest = sum((each.place for each in chain[:3]), np.zeros(3))
                joint = opensim.PlanarJoint(
                    "joint2", model.getGround(), _vector(rest), zero, body, zero, zero
                )
                names = ("q2", "q0", "q1")
                for k, name in enumerate(names):
                    joint.upd_coordinates(k).setName(name)
            else:
                joint = opensim.PinJoint(
                    f"joint{i}", bodies[link.parent], _vector(link.place), zero, body, zero, zero
                )
                joint.upd_coordinates(0).setName(f"q{i}")
            model.addJoint(joint)
            if np.isfinite(link.lower) and np.isfinite(link.upper):
                ends = sorted(self._turns[i] * np.rad2deg([link.lower, link.upper]))
                model.addForce(
                    opensim.CoordinateLimitForce(
                        f"q{i}",
                        float(ends[1]),
                        STOP,
                        float(ends[0]),
                        STOP,
                        STOP_DAMPING,
                        STOP_WIDTH,
                        False,
                    )
                )
            for (center, radius), contact in zip(link.points, link.contacts, strict=True):
                if radius:
                    raise InvalidRunError("its contacts are points; discs are not handed over")
                springs[contact] = self._spring(body, center, contact)
        return springs

    def _spring(self, body: Any, center: Floats, contact: int) -> Any:
        upright = opensim.Transform(
            opensim.Rotation(-0.5 * math.pi, opensim.CoordinateAxis(0)), opensim.Vec3(0.0)
        )
        spring = opensim.ExponentialContactForce(upright, body, _vector(center))
        spring.setName(f"contact{contact}")
        spring.setExponentialShapeParameters(*self._shape)
        spring.setNormalViscosity(self._damping_of_contacts)
        if self._elasticity is not None:
            spring.setFrictionElasticity(self._elasticity)
        self._model.addForce(spring)
        return spring

    def _drive(self) -> list[Any]:
        robot = self.scenario.robot
        controller = opensim.PrescribedController()
        joints = robot.model.actuator_joint
        damping = robot.model.damping
        for i in np.flatnonzero(damping):
            self._model.addForce(
                opensim.SpringGeneralizedForce(f"q{i}")  # a spring of no stiffness, a damper
            )
            force = opensim.SpringGeneralizedForce.safeDownCast(
                self._model.getForceSet().get(self._model.getForceSet().getSize() - 1)
            )
            force.setStiffness(0.0)
            force.setViscosity(float(damping[i]))
        for k, joint in enumerate(joints):
            actuator = opensim.CoordinateActuator(f"q{joint}")
            actuator.setName(f"motor{k}")
            actuator.setOptimalForce(float(self._turns[joint]))
            actuator.setMinControl(-math.inf)
            actuator.setMaxControl(math.inf)
            self._model.addForce(actuator)
            controller.addActuator(actuator)
        self._model.addController(controller)
        self._model.finalizeConnections()
        for k in range(len(joints)):
            controller.prescribeControlForActuator(f"motor{k}", opensim.Constant(0.0))
        functions = controller.upd_ControlFunctions()
        return [opensim.Constant.safeDownCast(functions.get(k)) for k in range(len(joints))]

    def place(self, q: Floats, v: Floats) -> None:
        """Put the robot somewhere, at time 0."""
        state = self._state
        state.setTime(0.0)
        for coordinate, turn, value, rate in zip(self._coordinates, self._turns, q, v, strict=True):
            coordinate.setValue(state, float(turn * value), False)
            coordinate.setSpeedValue(state, float(turn * rate))
        friction = self.scenario.friction
        for spring in self._springs.values():
            spring.setMuStatic(state, friction)
            spring.setMuKinetic(state, friction)
            spring.resetAnchorPoint(state)
        manager = opensim.Manager(self._model)
        manager.setIntegratorMethod(getattr(manager, f"IntegratorMethod_{self._integrator}"))
        manager.setIntegratorAccuracy(self._accuracy)
        manager.setIntegratorMaximumStepSize(self.step)
        manager.setWriteToStorage(False)
        manager.setPerformAnalyses(False)
        manager.initialize(state)
        self._manager = manager

    def simulate(self, steps: int) -> None:
        """Simulate some steps, each with a call from Python."""
        feedback = self.scenario.feedback
        joints = self.scenario.robot.model.actuator_joint
        for k in range(steps):
            if feedback is not None:
                row = self.commands[min(self.done + k, len(self.commands) - 1)]
                q, v = self.coordinates()
                law = feedback.parameters
                self.hold(row - law.kp * q[joints] - law.kd * v[joints])
            self._state = self._manager.integrate((self.done + k + 1) * self.step)

    def coordinates(self) -> tuple[Floats, Floats]:
        """Where it is now."""
        state = self._state
        q = np.array([each.getValue(state) for each in self._coordinates])
        v = np.array([each.getSpeedValue(state) for each in self._coordinates])
        return self._turns * q, self._turns * v

    def hold(self, torque: Floats) -> None:
        """Apply torques from now on."""
        for function, value in zip(self._controls, torque, strict=True):
            function.setValue(float(value))

    def forces(self) -> Floats:
        """Forces on the contact points at the end of the last step."""
        found = np.zeros((self.scenario.robot.nc, 2))
        self._model.realizeDynamics(self._state)
        for contact, spring in self._springs.items():
            force = spring.getForce(self._state, True)
            found[contact] = force.get(1), force.get(0)
        return found

    def contacts(self) -> list[tuple[float, float]]:
        """Force and depth of each contact now."""
        self._model.realizeDynamics(self._state)
        found = []
        for spring in self._springs.values():
            force = spring.getForce(self._state, True).get(1)
            place = spring.getStationPosition(self._state, True)
            if force > 0.0:
                found.append((float(force), -float(place.get(1))))
        return found


def _vector(place: Floats) -> Any:
    """Put a vector of ours, (x, y, z), into OpenSim's plane."""
    return opensim.Vec3(float(place[0]), float(place[2]), 0.0)


ENGINE = Engine(
    label="Simbody",
    note="through OpenSim, a call from Python a step; its integrator takes shorter ones by itself",
    peer=SimbodyPeer,
)
