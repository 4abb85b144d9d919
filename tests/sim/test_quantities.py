"""A recorded quantity is declared once: one that is new is followed through all it appears in."""

from __future__ import annotations

import inspect
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from fresh_python import fresh_python
from harness import Pin
from mechanisms import braked, four_bar, geared
from stored_files import run_file
from synthetic_runs import box, make_run

import heelstrike as hs
from heelstrike.errors import ViewError
from heelstrike.sim.files.dataset import DIMENSIONS
from heelstrike.sim.run import QUANTITIES

PACKAGE = Path(hs.__file__).parent
ROOT = PACKAGE.parents[1]

DECLARATION = """
    link_angle: Floats = recorded(
        "nl", of="equations.tree.angle", unit="rad", label="angles of links", later=True
    )
"""

# What a user of the package with this declaration sees; kernels run as plain Python.
USE = """
import sys
import plain_kernels
import numpy as np
import heelstrike as hs
from synthetic_runs import box
assert hs.__file__.startswith(sys.argv[1]), hs.__file__
for method in (hs.TimeStepping(), hs.EventDriven(), hs.Compliant()):
    robot = box()
    start = hs.State(robot.model.reference + [0.0, 0.5, 0.0], [0.1, 0.0, 3.0])  # it falls
    run = hs.simulate(robot, state=start, duration=3e-3, method=method)
    assert run.completed, run.message
    np.testing.assert_allclose(run.link_angle[:, -1], run.position[:, 2], rtol=0, atol=1e-12)
    assert run.link_angle[-1, -1] > 5e-3
    data = run.to_dataset()["link_angle"]
    assert data.dims == ("time", "coordinate")
    assert data.attrs == {"units": "rad", "long_name": "angles of links"}
    np.testing.assert_array_equal(data, run.link_angle)
    again = hs.load_run(run.save(sys.argv[2]))
    np.testing.assert_array_equal(again.link_angle, run.link_angle)
figure = run.plot("link_angle")
(axes,) = figure.axes
assert "angles of links" in figure.get_suptitle()
assert axes.get_ylabel() == "rad"
assert [line.get_label() for line in axes.lines] == [n.replace("_", " ") for n in robot.joint_names]
np.testing.assert_array_equal(axes.lines[-1].get_ydata(), run.link_angle[:, -1])
old = hs.load_run(sys.argv[3])
assert old.link_angle.shape == old.position.shape and not old.link_angle.any()
"""


@pytest.mark.slow
def test_a_quantity_is_recorded_saved_and_drawn_by_its_declaration(tmp_path: Path) -> None:
    copy = tmp_path / "heelstrike"
    shutil.copytree(PACKAGE, copy)
    declared = (copy / "sim" / "run.py").read_text(encoding="utf-8")
    before = "    events: tuple[Event, ...]\n"
    assert declared.count(before) == 1
    added = declared.replace(before, DECLARATION + before)
    (copy / "sim" / "run.py").write_text(added, encoding="utf-8")
    places = [str(tmp_path), str(ROOT / "tests"), str(ROOT / "benchmarks" / "mutations")]
    script = f"import sys; sys.path[:0] = {places!r}\n{USE}"
    old = run_file("time_stepping", tmp_path)
    fresh_python("-c", script, str(tmp_path), str(tmp_path / "run.nc"), str(old))


@pytest.mark.parametrize("name", QUANTITIES)
def test_every_quantity_is_documented_and_has_its_dimensions(name: str) -> None:
    quantity = QUANTITIES[name]
    assert quantity.unit
    assert quantity.label
    assert set(quantity.shape) <= DIMENSIONS.keys()
    told = re.search(rf"^{name} : \(nt, (.*)\) float$", inspect.getdoc(hs.Run) or "", re.MULTILINE)
    assert told is not None
    assert told[1] == ", ".join(quantity.shape)


@pytest.mark.parametrize("name", [name for name in QUANTITIES if name != "torque"])
def test_every_quantity_is_drawn_by_its_name(name: str) -> None:
    of = {
        "loop_force": four_bar, "coupling_force": geared, "brake_torque": braked,
        "constraint_force": pinned,
    }  # fmt: skip
    robot = of.get(name, box)()
    run = make_run(robot, [0.0, 0.5, 1.0])
    getattr(run, name)[...] = np.arange(getattr(run, name).size).reshape(getattr(run, name).shape)
    figure = run.plot(name, span=(0.5, 1.0))
    assert QUANTITIES[name].label in figure.get_suptitle()
    drawn = [[line.get_ydata() for line in axes.lines] for axes in figure.axes]
    shape = getattr(run, name).shape
    values = getattr(run, name)[1:].reshape(2, shape[1], -1)
    np.testing.assert_array_equal(np.array(drawn), values.transpose(2, 1, 0))
    on_hinges = {"coupling_force": "N m", "brake_torque": "N m"}
    assert {axes.get_ylabel() for axes in figure.axes} == {
        on_hinges.get(name, QUANTITIES[name].unit)
    }


def pinned() -> hs.Robot:
    return hs.constrained(box(), Pin())


def test_a_quantity_of_nothing_is_not_drawn() -> None:
    from synthetic_runs import pendulum

    run = make_run(pendulum(), [0.0, 1.0])
    with pytest.raises(ViewError, match="'pendulum' has no contacts: there is nothing to show"):
        run.plot("gap")
