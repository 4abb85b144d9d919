"""SDF as Drake reads it: mass matrix and gravity force of the same text at random states."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from heelstrike import dynamics
from heelstrike.robot import Robot
from tests.robot.files.test_sdf import WAYS, quiet
from tests.robot.files.test_sdf_nesting import NESTED, knee, shin, whole

pytest.importorskip("pydrake", reason="pip install 'heelstrike[peers]'")

TOLERANCE = 1e-11
"""Of entries up to 3 kg m² and 50 N m: rounding of some hundred operations."""

REFUSED = ("a joint on a frame of the world", "joint and link of one name")  # by Drake
READ = {name: text for name, text in WAYS.items() if name not in REFUSED}


def nested_at_random(seed: int) -> str:
    """A shin two models deep, each turned in the plane, one placed by a frame, one by a link."""
    draw = np.random.default_rng(seed)

    def pose(relative: str = "") -> str:
        x, z, pitch = draw.uniform(-0.5, 0.5, size=3)
        base = f' relative_to="{relative}"' if relative else ""
        return f"<pose{base}>{x} 0 {z} 0 {pitch} 0</pose>"

    frame = f'<frame name="top">{pose("shin")}</frame>'
    inner = f'<model name="in" placement_frame="top">{pose()}{shin(pose(), frame)}</model>'
    outer = f'<model name="out">{pose("thigh")}{inner}</model>'
    return whole(outer + knee("thigh", "out::in::shin", pose()))


def assert_as_drake(text: str, robot: Robot) -> None:
    from pydrake.multibody.parsing import Parser
    from pydrake.multibody.plant import MultibodyPlant

    plant: Any = MultibodyPlant(time_step=0.0)
    Parser(plant).AddModelsFromString(text, "sdf")
    plant.Finalize()
    context = plant.CreateDefaultContext()
    order = [plant.GetJointByName(name).position_start() for name in robot.joint_names]
    draw = np.random.default_rng(1)
    for _ in range(3):
        q = draw.normal(size=robot.nq)
        plant.SetPositions(context, q[np.argsort(order)])
        theirs = plant.CalcMassMatrixViaInverseDynamics(context)[np.ix_(order, order)]
        ours = dynamics.mass_matrix(robot, q) - np.diag(robot.model.armature)
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=TOLERANCE)
        weight = -plant.CalcGravityGeneralizedForces(context)[order]
        np.testing.assert_allclose(dynamics.gravity_force(robot, q), weight, rtol=0, atol=TOLERANCE)


@pytest.mark.parametrize("way", READ)
def test_one_model(way: str) -> None:
    assert_as_drake(READ[way], quiet(READ[way]))


@pytest.mark.parametrize("way", NESTED)
def test_models_in_models(way: str) -> None:
    assert_as_drake(NESTED[way], quiet(NESTED[way]))


@pytest.mark.parametrize("seed", range(20))
def test_models_at_random(seed: int) -> None:
    text = nested_at_random(seed)
    assert_as_drake(text, quiet(text))
