"""What a law asks for in states near one, against the same law in each of these states."""

from __future__ import annotations

import numpy as np
import pytest
import walking

import heelstrike as hs
from heelstrike.sim.linearized.law import AskedAlong


@hs.controller
def looks(state, contacts, torque):
    """Ask for what tells where the points of the first foot are, and how fast a joint is."""
    for i in range(torque.shape[0]):
        torque[i] = state.joint_velocity[i] * state.joint_position[i]
    torque[0] += contacts.position[0, 0] + 3.0 * contacts.position[1, 1] + 10.0 * contacts.gap[1]


@hs.controller
def leans(contacts, torque):
    """Ask for what the foot is pressed with."""
    torque[0] = 1e-3 * contacts.force[0, 0]


def test_a_law_that_acts_on_forces_is_refused() -> None:
    """Errors change forces as well; what that does would be left out."""
    robot = walking.bravo7()
    simulation = hs.Simulation(robot, leans(), state=robot.reference_state())
    simulation.advance(0.002)
    with pytest.raises(hs.SimulationError, match="depend on forces"):
        hs.step_derivatives(simulation)
    hs.step_derivatives(simulation, answers=False)


def test_a_law_sees_its_contact_points_where_a_changed_state_has_them() -> None:
    """On a slope, where places along it and gaps are in neither axis of the world."""
    robot, ground, law = walking.bravo7(), hs.Ground(slope=0.3), looks()
    state = robot.perturbed(robot.reference_state(), position=0.1, velocity=0.5, seed=2)
    high = hs.State(state.q + np.eye(robot.nq)[1], state.v)
    simulation = hs.Simulation(robot, law, state=high, ground=ground, stop_when_fallen=False)

    def asked(x: np.ndarray) -> np.ndarray:
        q, v = x[: robot.nq], x[robot.nq :]
        at = hs.contact_kinematics(robot, q, v, ground)
        joints = robot.model.actuator_joint
        torque = v[joints] * q[joints]
        torque[0] += at.position[0, 0] + 3.0 * at.position[1, 1] + 10.0 * at.gap[1]
        return torque

    now = AskedAlong(simulation, law).now()
    np.testing.assert_allclose(now.torque(), asked(high.vector), rtol=1e-12)
    sides = [(asked(high.vector + d) - asked(high.vector - d)) / 2e-4 for d in 1e-4 * np.eye(18)]
    np.testing.assert_allclose(now.gains(), np.transpose(sides), atol=1e-7)
