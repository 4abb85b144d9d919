"""Our own simulation behind the contract of other engines: what it tells is known beforehand."""

from __future__ import annotations

from typing import Any

import numpy as np

import heelstrike as hs
from heelstrike.experiments.engines import Peer, Scenario


class OurPeer(Peer):
    """Time stepping, step by step, under torques that are held."""

    def __init__(self, scenario: Scenario, step: float) -> None:
        super().__init__(scenario, step)
        self._torque = np.zeros(scenario.robot.nu)

    def place(self, q: Any, v: Any) -> None:
        scenario = self.scenario
        self._simulation = hs.Simulation(
            scenario.robot,
            hs.HeldTorque(scenario.robot),
            state=hs.State(q + self.zero, v),
            method=hs.TimeStepping(step=self.step),
            ground=scenario.ground,
            stop_when_fallen=False,
        )

    def hold(self, torque: Any) -> None:
        self._torque = np.array(torque)

    def simulate(self, steps: int) -> None:
        self._simulation.parameters.torque[:] = self._torque
        for _ in range(steps):
            self._simulation.step()

    def coordinates(self) -> Any:
        state = self._simulation.state
        return state.q - self.zero, state.v

    def forces(self) -> Any:
        return self._simulation.contacts.force.copy()

    def contacts(self) -> Any:
        return [(float(each[0]), 0.0) for each in self.forces() if each[0] > 0.0]
