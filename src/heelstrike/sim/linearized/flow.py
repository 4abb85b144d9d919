"""The variational equation of a smooth motion: what becomes of small errors between two events."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.polynomial import legendre

from heelstrike.contact.linearized.motion import ActiveContacts, linearize_contact
from heelstrike.errors import SimulationError
from heelstrike.robot.model import Floats
from heelstrike.sim.controller.interface import Controller
from heelstrike.sim.linearized.collocation import collocation, stage_equations
from heelstrike.sim.linearized.inputs import NONE, TORQUE, Inputs
from heelstrike.sim.linearized.law import AskedAlong
from heelstrike.sim.linearized.pushed import pushed, switches
from heelstrike.sim.simulation import Simulation

PANEL, ALONE = 0.005, 0.05
"""Longest stretch of time (s) that is taken at once under a law, as gaits are smooth by pieces
only; and without one."""

FASTEST = 0.25
"""Longest stretch in parts of the time in which the fastest error of the closed loop changes. Light
links swing about as fast: with half of it derivatives of falls are wrong by 1e-6 of themselves."""

STAGES = 4
"""Gauss's nodes in it: collocation of order 8."""


def _rate(slope: Floats) -> float:
    """Largest rate (1/s) of errors; not zero."""
    return max(float(np.abs(np.linalg.eigvals(slope)).max()), 1.0)


NODES, MATRIX, WEIGHTS = collocation(0.5 * (legendre.leggauss(STAGES)[0] + 1.0))


class Variation:
    """A motion gone through once more, with its variational equation.

    Parameters
    ----------
    simulation : Simulation
        At its beginning; it is advanced from one node to the next.
    controller : object with ``torque(t, state, contacts)``, or None
        That of the simulation.
    inputs : Inputs
        What else may change, k numbers.
    answers : bool
        Whether its torques answer to errors, or stay what they are.

    Raises
    ------
    SimulationError
        If the controller does not act continuously.
    """

    def __init__(
        self, simulation: Simulation, controller: Controller | None, inputs: Inputs = NONE, *,
        answers: bool = True,
    ) -> None:  # fmt: skip
        self._simulation, self.inputs, self._answers = simulation, inputs, answers
        self._robot, self._ground = simulation.robot, simulation.ground
        self._law = None if controller is None else AskedAlong(simulation, controller)
        if self._law is not None and simulation.control_period > 0.0:
            raise SimulationError(
                "only a compiled controller that acts continuously can be linearised along a step; "
                "this one is sampled. hs.find_limit_cycle takes differences instead"
            )

    @property
    def braked(self) -> tuple[int, ...]:
        """Joints that brakes hold.

        Raises
        ------
        SimulationError
            If one of them slips.
        """
        model = self._robot.model
        joints = tuple(self._robot.joint_index(name) for name in self._simulation.braked)
        limits = dict(zip(model.brake_joint.tolist(), model.brake_limit.tolist(), strict=True))
        if any(limits[joint] < np.inf for joint in joints):
            raise SimulationError(
                f"brakes of {self._robot.name!r} are on that slip, which is not linearised here; "
                "hs.find_limit_cycle takes differences instead"
            )
        return joints

    def flow(self, begin: float, end: float, active: ActiveContacts) -> Floats:
        """Return what the motion from one time to another does to errors and changes of inputs.

        (nq + nv + k, nq + nv + k): inputs stay as they are.
        """
        error = np.eye(self._robot.nq + self._robot.nv + self.inputs.size)
        for start, until in pairwise(switches(self._simulation._pushes, begin, end)):
            self._through(start, until, active, error)
        if self._law is not None and self._answers:
            self._law.check_beginning()
        return error

    def _through(self, begin: float, end: float, active: ActiveContacts, error: Floats) -> None:
        """Let errors go through a smooth stretch."""
        size = self._robot.nq + self._robot.nv
        longest = ALONE if self._law is None else PANEL
        start, fastest = begin, _rate(self._slope(begin, active)[:, :size])
        while (left := end - start) > 0.0:
            span = left / np.ceil(left / min(longest, FASTEST / fastest))
            if self._law is not None and self._answers:
                self._simulation.advance(start + span * NODES[0])
                self._law.check_memory()
            slopes = [self._slope(start + span * node, active) for node in NODES]
            system = stage_equations(span * MATRIX, [slope[:, :size] for slope in slopes])
            rates = np.linalg.solve(system, np.vstack([slope @ error for slope in slopes]))
            stages = rates.reshape(STAGES, size, error.shape[1])
            error[:size] += span * np.tensordot(WEIGHTS, stages, axes=1)
            fastest = _rate(slopes[-1][:, :size])
            start = end if span == left else start + span

    def _slope(self, time: float, active: ActiveContacts) -> Floats:
        """Derivative of the closed loop's rate by the state and the inputs."""
        simulation, inputs = self._simulation, self.inputs
        simulation.advance(time)
        state, size = simulation.state, self._robot.nq + self._robot.nv
        law = None if self._law is None else self._law.now()
        torque = np.zeros(self._robot.nu) if law is None else law.torque()
        found = linearize_contact(
            self._robot, state.q, state.v, torque, active, ground=self._ground,
            numbers=inputs.numbers, **pushed(self._robot, state.q, simulation._pushes, time),
        )  # fmt: skip
        slope = np.zeros((size, size + inputs.size))
        slope[:, :size] = found.A
        if inputs.size:
            by_input = slope[:, size:]
            by_input[:, inputs.of(TORQUE)] = found.B
            by_input[:, inputs.of_numbers()] = found.by_numbers
        if law is not None and self._answers:
            slope[:, :size] += found.B @ law.gains()
            if inputs.parameters:
                by_input[:, inputs.of_parameters()] = found.B @ law.by_parameters(inputs.parameters)
        return slope
