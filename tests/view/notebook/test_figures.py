"""Figures in notebooks: shown once, sharp, and by themselves."""

from __future__ import annotations

import io
import pickle

import matplotlib
import nbformat
import numpy as np
import pytest
import walking
from IPython.core.formatters import DisplayFormatter
from matplotlib.figure import Figure
from nbclient import NotebookClient
from PIL import Image

from heelstrike.view.comparison_figure import draw_comparison

pytestmark = pytest.mark.slow  # left to `make test` by continuous integration

SETUP = """
import heelstrike as hs
robot = hs.load_robot("bravo7")
run = hs.simulate(robot, state=robot.reference_state(), duration=0.01)
run.plot("zmp")
"""


def test_a_kernel_shows_each_figure_once() -> None:
    """First without a magic line; then where matplotlib shows figures by itself, ours too."""
    cells = [
        SETUP,
        "figure = run.plot('zmp')",
        "%matplotlib inline\nimport matplotlib.pyplot as plt\nrun.plot('zmp')",
        "_ = run.plot('zmp')\nplt.show()",
    ]
    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(each) for each in cells])
    NotebookClient(notebook, kernel_name="python3", timeout=600).execute()
    shown = [[set(output.get("data", ())) for output in cell.outputs] for cell in notebook.cells]
    assert shown == [[{"image/png", "text/plain"}], [], [{"image/png", "text/plain"}], []]
    for cell in (0, 2):
        (output,) = notebook.cells[cell].outputs
        assert output.output_type == "execute_result"


def every_figure() -> dict[str, Figure]:
    """What public functions return that draw."""
    run = walking.walk(steps=1)
    both = ("a", "b")
    series = dict.fromkeys(both, dict.fromkeys(("position", "energy", "zmp"), run.time))
    times = dict.fromkeys(both, run.time)
    return {
        "plot": run.plot("zmp"),
        "quantity": run.plot("torque"),
        "comparison": draw_comparison(run.robot, "a", times, series),
    }


@pytest.mark.parametrize("name", ["plot", "quantity", "comparison"])
def test_a_picture_is_twice_as_sharp_as_its_place(name: str) -> None:
    figure = every_figure()[name]
    assert isinstance(figure, Figure)
    data, about = DisplayFormatter().format(figure)
    size = about["image/png"]
    assert size["width"] == pytest.approx(100.0 * figure.get_size_inches()[0], abs=1.0)
    with Image.open(io.BytesIO(data["image/png"])) as picture:
        assert picture.size == (2 * size["width"], 2 * size["height"])


def test_it_is_matplotlibs_figure_still() -> None:
    """It is changed, written and kept like any other."""
    figure = walking.walk(steps=1).plot("zmp")
    copy = pickle.loads(pickle.dumps(figure))
    np.testing.assert_array_equal(pixels(copy), pixels(figure))
    copy.axes[0].set_title("mine")
    assert not np.array_equal(pixels(copy), pixels(figure))


def test_late_ticks_have_our_look_too() -> None:
    """Ticks are made when a figure is drawn, long after it was."""
    run = walking.walk(steps=1)
    expected = pixels(run.plot("forces"))
    figure = run.plot("forces")
    with matplotlib.rc_context({"xtick.labelsize": 25.0, "ytick.color": "red", "font.size": 30.0}):
        drawn = pixels(figure)
    np.testing.assert_array_equal(drawn, expected)


def pixels(figure: Figure) -> np.ndarray:
    written = io.BytesIO()
    figure.savefig(written, dpi=50)
    with Image.open(written) as picture:
        return np.asarray(picture.convert("RGB"))
