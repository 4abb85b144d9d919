"""Every query says what it takes and gives, and is there for numbers and for symbols."""

from __future__ import annotations

import inspect

import casadi
import numpy as np
import pytest

import heelstrike as hs
from heelstrike import dynamics
from heelstrike.dynamics.queries.symbolic import TracedDynamics, symbols
from heelstrike.errors import RobotError

QUERIES = [name for name in dynamics.__all__ if hasattr(getattr(dynamics, name), "at")]
ONLY_NUMBERS = {"link_velocities"}


def test_all_but_results_and_linearisation_are_queries() -> None:
    others = set(dynamics.__all__) - set(QUERIES)
    results = {"LegPose", "Linearization", "LinkPoses", "LinkVelocities"}
    searched = {"inverse_kinematics", "leg_joints", "linearize"}
    assert others == {"CasadiDynamics", *results, *searched}
    assert {name for name in QUERIES if not hasattr(dynamics.CasadiDynamics, name)} == ONLY_NUMBERS


@pytest.mark.parametrize("name", QUERIES)
def test_documentation(name: str) -> None:
    """numpydoc, with every argument and what comes back; the signature is that of the function."""
    query = getattr(dynamics, name)
    text = inspect.getdoc(query)
    assert text is not None
    parameters, _, returns = text.partition("\nReturns\n-------\n")
    for argument in inspect.signature(query).parameters:
        assert f"\n{argument} : " in parameters
    assert query.__name__ == name
    assert "\n\nRaises\n------\nRobotError\n" in returns


def test_arguments_by_name_and_wrong_ones() -> None:
    robot = hs.load_robot("bravo7")
    q, v = robot.model.reference, np.ones(robot.nv)
    np.testing.assert_array_equal(
        dynamics.point_velocity(robot, q, v, local=(0.1, 0.2), link="right_foot"),
        dynamics.point_velocity(robot, q, v, "right_foot", (0.1, 0.2)),
    )
    with pytest.raises(TypeError, match="local"):
        dynamics.point_velocity(robot, q, v, "right_foot")  # type: ignore[call-arg]
    with pytest.raises(TypeError, match="pose"):
        dynamics.mass_matrix(robot, q, pose=q)  # type: ignore[call-arg]
    with pytest.raises(RobotError, match="acceleration of robot 'bravo7' must have 9 entries"):
        dynamics.inverse_dynamics(robot, q, v, v[:4])
    with pytest.raises(RobotError, match=r"torque of robot 'bravo7' must have 6 entries"):
        dynamics.applied_force(robot, q, v, v)
    with pytest.raises(RobotError, match=r"'right_food'\. Did you mean 'right_foot'"):
        dynamics.point_position(robot, q, "right_food", (0.0, 0.0))


def test_some_contact_points() -> None:
    robot = hs.load_robot("bravo7")
    q = robot.model.reference
    rows = dynamics.contact_jacobian(robot, q)
    assert rows.shape == (4, 2, 9)
    np.testing.assert_array_equal(
        dynamics.contact_jacobian(robot, q, [3, "right_foot_heel"]), rows[[3, 0]]
    )


def test_symbolic_states_ask_the_same_queries() -> None:
    robot = hs.load_robot("bravo7")
    traced = TracedDynamics(robot, symbols(casadi.SX.sym("q", robot.nq)))
    assert traced.center_of_mass().shape == (2,)
    with pytest.raises(AttributeError, match="no query 'colour'"):
        traced.colour()
