"""Pinocchio's contact solvers in a loop of ours: it has none of its own.

Each step is semi-implicit: the mass matrix, the bias force and the Jacobians of the contact points
are Pinocchio's, at the beginning of the step; its solver finds the impulses with which points do
not sink and friction holds or slips; positions move with the new velocity.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio

from heelstrike.experiments.engines.links import links
from heelstrike.experiments.engines.peer import Engine, Peer
from heelstrike.experiments.engines.pinocchio_peer import model_of
from heelstrike.experiments.engines.scenario import Scenario
from heelstrike.robot.model import Floats

NEAR = 0.02
"""Gap (m) from which on a point is left out of the contact problem."""

SIDEWAYS = 1.0
"""What stands in the rows out of the plane, where nothing moves, in 1/kg: any number but zero."""


class PinocchioContactPeer(Peer):
    """A scenario with Pinocchio's dynamics and solvers.

    Parameters
    ----------
    scenario : Scenario
    step : float
        Seconds.
    solver : str
        ``"pgs"`` or ``"admm"``.
    tolerance : float
        Absolute and relative, of its residuals.
    iterations : int
        At most, of a solve.
    correction : float
        Part of a penetration that is taken back in a step.
    """

    bounces = False

    def __init__(
        self,
        scenario: Scenario,
        step: float,
        *,
        solver: str = "pgs",
        tolerance: float = 1e-6,
        iterations: int = 1000,
        correction: float = 1.0,
    ) -> None:
        super().__init__(scenario, step)
        self._correction = correction
        self._model = model_of(scenario)
        self._data = self._model.createData()
        self._frames = self._add_points()
        self._data = self._model.createData()
        kind = {"pgs": "PGS", "admm": "ADMM"}[solver]
        self._solver = getattr(pinocchio, f"{kind}ConstraintSolver")()
        self._settings = getattr(pinocchio, f"{kind}SolverSettings")()
        for name in ("absolute", "relative"):
            for what in ("feasibility", "complementarity"):
                setattr(self._settings, f"{name}_{what}_tol", tolerance)
        self._settings.max_iterations = iterations
        self._result: Any = getattr(pinocchio, f"{kind}SolverResult")
        self._q = self._v = np.zeros(scenario.robot.nv)
        self._torque = np.zeros(scenario.robot.nu)
        self._impulse = np.zeros((scenario.robot.nc, 2))
        self._gap = np.zeros(scenario.robot.nc)

    def _add_points(self) -> list[tuple[int, float]]:
        """Add the contact points as frames; return them and their radii, in their order."""
        frames: dict[int, tuple[int, float]] = {}
        for i, link in enumerate(links(self.scenario.robot)):
            for (center, radius), contact in zip(link.points, link.contacts, strict=True):
                frame = pinocchio.Frame(
                    f"contact{contact}", i + 1, pinocchio.SE3(np.eye(3), center),
                    pinocchio.FrameType.OP_FRAME,
                )  # fmt: skip
                frames[contact] = self._model.addFrame(frame), radius
        return [frames[i] for i in range(len(frames))]

    def place(self, q: Floats, v: Floats) -> None:
        """Put the robot somewhere, at time 0."""
        self._q, self._v = np.array(q, dtype=np.float64), np.array(v, dtype=np.float64)
        self._impulse[:] = 0.0

    def hold(self, torque: Floats) -> None:
        """Apply torques from now on."""
        model = self.scenario.robot.model
        self._torque = np.clip(torque, model.torque_lower, model.torque_upper)

    def simulate(self, steps: int) -> None:
        """Simulate some steps in Python."""
        for k in range(steps):
            self.hold_by_law(k)
            self._take()

    def _take(self) -> None:
        robot, h = self.scenario.robot, self.step
        model, data = self._model, self._data
        pinocchio.computeAllTerms(model, data, self._q, self._v)
        pinocchio.updateFramePlacements(model, data)
        mass = np.triu(data.M) + np.triu(data.M, 1).T
        force = -data.nle - robot.model.damping * self._v
        force[robot.model.actuator_joint] += self._torque
        free = self._v + h * np.linalg.solve(mass, force)
        self._gap = np.array(
            [data.oMf[frame].translation[2] - radius for frame, radius in self._frames]
        )
        near = np.flatnonzero(self._gap < NEAR)
        self._impulse = np.zeros((robot.nc, 2))
        if len(near):
            free = free + self._pushed(near, mass, free)
        self._v = free
        self._q = self._q + h * free

    def _pushed(self, near: Any, mass: Floats, free: Floats) -> Floats:
        """Change of the velocity by what the solver finds."""
        model, data, h = self._model, self._data, self.step
        rows = []
        for i in near:
            frame, radius = self._frames[i]
            whole = pinocchio.getFrameJacobian(
                model, data, frame, pinocchio.ReferenceFrame.LOCAL_WORLD_ALIGNED
            )
            point = whole[:3].copy()
            point[0] -= radius * whole[4]  # the lowest point of a disc
            rows.append(point)
        jacobian = np.concatenate(rows)  # x, y, z of each: two tangents and the normal
        answer = np.linalg.solve(mass, jacobian.T)
        delassus = jacobian @ answer
        delassus[1::3, 1::3] += SIDEWAYS * np.eye(len(near))
        gap = self._gap[near]
        drift = jacobian @ free
        drift[2::3] += np.where(gap > 0.0, gap, self._correction * gap) / h
        constraints, datas = pinocchio.StdVec_ConstraintModel(), pinocchio.StdVec_ConstraintData()
        for _ in near:
            one = pinocchio.PointContactConstraintModel(model, 1)
            one.setFriction(self.scenario.friction)
            constraints.append(pinocchio.ConstraintModel(one))
            datas.append(pinocchio.ConstraintData(one.createData()))
        result = self._result()
        self._solver.solve(
            pinocchio.DelassusOperatorDense(delassus), drift, constraints, datas, self._settings,
            result,
        )  # fmt: skip
        impulse = np.asarray(result.retrieveConstraintImpulses())
        self._impulse[near, 0] = impulse[2::3]
        self._impulse[near, 1] = impulse[0::3]
        return np.asarray(answer @ impulse)

    def coordinates(self) -> tuple[Floats, Floats]:
        """Where it is now."""
        return self._q, self._v

    def forces(self) -> Floats:
        """Forces on the contact points in the last step."""
        return self._impulse / self.step

    def contacts(self) -> list[tuple[float, float]]:
        """Force of each contact in the last step, and how deep it was at its beginning."""
        return [
            (float(force), -float(gap))
            for (force, _), gap in zip(self.forces(), self._gap, strict=True)
            if force > 0.0
        ]


ENGINE = Engine(
    label="Pinocchio",
    note="a loop of ours in Python round its dynamics and its solver",
    peer=PinocchioContactPeer,
)
