"""``heelstrike simulate`` and ``heelstrike inspect --dimension 3``."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import heelstrike as hs
from heelstrike.cli.main import app
from heelstrike.control.spatial.gains import bearable_gains
from heelstrike.errors import ControllerError, SimulationError
from heelstrike.sim.spatial.placing import placed_in_space

BRAVO = ["bravo7", "--floating"]


def test_a_robot_holds_its_posture(tmp_path: Path) -> None:
    out = tmp_path / "run"
    asked = ["simulate", *BRAVO, "--duration", "0.1", "--kp", "2000", "--kd", "50"]
    result = CliRunner().invoke(app, [*asked, "--out", str(out), "--animation", "gif", "--json"])
    assert result.exit_code == 0, result.stderr
    names = {"run.nc", "summary.json", "run.html", "run.gif"}
    assert {path.name for path in out.iterdir()} == names
    told = json.loads(result.stdout)
    assert told == json.loads((out / "summary.json").read_text())
    assert told["status"] == "completed"
    assert told["duration_s"] == pytest.approx(0.1)


def test_a_limp_robot_falls(tmp_path: Path) -> None:
    asked = ["simulate", *BRAVO, "--drop", "--above", "0.05", "--duration", "2"]
    asked += ["--push", "trunk:0,400,0:0:0.3", "--out", str(tmp_path), "--animation", "none"]
    result = CliRunner().invoke(app, asked)
    assert result.exit_code == 1
    assert "fell" in result.stdout
    assert not (tmp_path / "run.mp4").exists()


def test_requests_that_are_wrong(tmp_path: Path) -> None:
    for given, words in (
        (["--push", "trunk:60:1:0.1"], "LINK:X,Y,Z:START:DURATION"),
        (["--duration", "0"], "longer than zero"),
        (["--above", "-1"], "above must be a height"),
    ):
        asked = ["simulate", *BRAVO, *given, "--out", str(tmp_path / "none")]
        result = CliRunner().invoke(app, asked, env={"COLUMNS": "200"})
        assert result.exit_code == 2, given
        assert words in result.stderr
    assert not (tmp_path / "none").exists()


def test_looking_at_a_robot_in_space(tmp_path: Path) -> None:
    picture = tmp_path / "r.png"
    asked = ["inspect", *BRAVO, "--dimension", "3", "--out", str(picture)]
    result = CliRunner().invoke(app, asked)
    assert result.exit_code == 0
    robot = hs.load_robot("bravo7", dimension=3, floating=True)
    for word in (*robot.joint_names, *robot.link_names, "right_foot (8 points)", "± 300"):
        assert word in result.stdout
    assert picture.read_bytes().startswith(b"\x89PNG")
    told = json.loads(CliRunner().invoke(app, [*asked[:5], "--json"]).stdout)
    assert told["velocities"] == list(robot.velocity_names)
    assert told["mass_kg"] == pytest.approx(robot.total_mass)


def test_a_robot_is_put_onto_the_ground() -> None:
    robot = hs.load_robot("bravo7", dimension=3, floating=True)
    ground = hs.SpatialGround(normal=(-0.2, 0.1, 1.0), height=0.3)
    for above in (0.0, 0.2):
        state = placed_in_space(robot, ground, above=above)
        simulation = hs.Simulation(robot, state=state, ground=ground)
        normal = np.array([-0.2, 0.1, 1.0]) / np.linalg.norm([-0.2, 0.1, 1.0])
        assert simulation.contacts.gap.min() == pytest.approx(above * normal[2], abs=1e-12)
    with pytest.raises(SimulationError, match="above must be"):
        placed_in_space(robot, above=-0.1)


def test_gains_that_a_step_bears() -> None:
    """On a free wheel of known inertia: the limit, and what is asked for where that is less."""
    robot = hs.load_robot("bravo7", dimension=3, floating=True)
    soft = bearable_gains(robot, 1e-3, kp=1.0, kd=0.01)
    np.testing.assert_allclose(soft[0], 1.0)
    np.testing.assert_allclose(soft[1], 0.01)
    stiff = bearable_gains(robot, 1e-3, kp=1e12, kd=1e12)
    longer = bearable_gains(robot, 2e-3, kp=1e12, kd=1e12)
    np.testing.assert_allclose(stiff[0], 4.0 * longer[0])
    np.testing.assert_allclose(stiff[1], 2.0 * longer[1])
    with pytest.raises(ControllerError, match="kp must be"):
        bearable_gains(robot, 1e-3, kp=-1.0, kd=1.0)
