"""The figures of a run show what they say, and leave nothing behind."""

from __future__ import annotations

import dataclasses
import subprocess
import sys
from functools import cache
from itertools import pairwise
from pathlib import Path

import matplotlib
import numpy as np
import pytest
import walking
from figure_text import check_text
from matplotlib.axes import Axes
from PIL import Image
from synthetic_runs import box, liftoff, make_run, pendulum, pushes, touchdown

import heelstrike as hs
from heelstrike.analysis import energy_balance, reference_motion, zero_moment_point
from heelstrike.view import FIGURES, ViewError, plot
from heelstrike.view.panels import impact_rows
from heelstrike.view.style import Picture, save_figure, styled


def curve(axes: Axes, label: str) -> tuple[np.ndarray, np.ndarray]:
    """Data of the line with a label."""
    (line,) = [line for line in axes.get_lines() if line.get_label() == label]
    return np.asarray(line.get_xdata()), np.asarray(line.get_ydata())


def panel(figure: matplotlib.figure.Figure, title: str) -> Axes:
    (axes,) = [axes for axes in figure.axes if axes.get_title(loc="left") == title]
    return axes


@pytest.mark.parametrize("what", FIGURES)
def test_every_figure_is_a_picture_with_units(what: str, tmp_path: Path) -> None:
    path = tmp_path / f"{what}.png"
    figure = plot(walking.walk(steps=4), what, gait=walking.gait(), path=path)
    with Image.open(path) as picture:
        assert picture.width > 900
        assert picture.height > 300
        colors = picture.convert("RGB").getcolors(2**24)
    assert colors is not None
    assert len(colors) > 20  # not blank
    assert "bravo7" in figure.get_suptitle()
    assert any(word.startswith("bravo7: ") for word in check_text(figure))
    for axes in figure.axes:
        if axes.axison:
            unit = axes.get_ylabel().removesuffix(")").split("(")[-1]
            assert unit in {"rad", "rad/s", "N m", "N", "J", "m"}
    if what != "snapshots":
        assert figure.axes[-1].get_xlabel() == "time (s)"


@pytest.mark.parametrize("what", FIGURES)
@pytest.mark.parametrize(
    "kind",
    [
        "fall",
        *(
            pytest.param(kind, marks=pytest.mark.slow)
            for kind in ("one row", "slope, without gait")
        ),
    ],
)
def test_unusual_runs_are_drawn_too(what: str, kind: str) -> None:
    figure = plot(unusual(kind), what)
    if kind == "fall":
        check_text(figure)


@cache
def unusual(kind: str) -> hs.Run:
    robot = walking.bravo7()
    if kind == "one row":
        return make_run(robot, [0.5])
    if kind == "fall":
        state = hs.State(robot.model.reference, np.full(robot.nv, 0.4))
        run = hs.simulate(robot, state=state, duration=3.0)
        assert not run.completed
        return run
    return hs.simulate(
        robot, state=robot.reference_state(), duration=0.2, ground=hs.Ground(slope=0.1)
    )


@pytest.mark.parametrize("what", ["tracking", "torque", "energy", "snapshots"])
def test_a_pendulum_has_these(what: str) -> None:
    plot(hs.simulate(pendulum(0.1), state=hs.State([1.0], [0.0]), duration=0.1), what)


def test_what_a_robot_has_not_is_said() -> None:
    swinging = hs.simulate(pendulum(), state=hs.State([1.0], [0.0]), duration=0.01)
    with pytest.raises(ViewError, match="no feet"):
        plot(swinging, "zmp")
    lying = hs.simulate(box(), state=box().reference_state(), duration=0.01)
    with pytest.raises(ViewError, match="no actuators"):
        plot(lying, "torque")


def test_tracking_shows_simulated_and_reference() -> None:
    run, gait = walking.walk(steps=4), walking.gait()
    axes = panel(plot(run, "tracking", gait=gait), "left knee")
    joint = run.robot.joint_names.index("left_knee")
    np.testing.assert_array_equal(curve(axes, "simulated")[1], run.position[:, joint])
    reference = reference_motion(run, gait).position[:, run.robot.actuator_names.index("left_knee")]
    np.testing.assert_array_equal(curve(axes, "reference")[1], reference)
    without = panel(plot(run, "tracking"), "left knee")
    assert [line.get_label() for line in without.get_lines()] == ["simulated"]


def test_zero_moment_point_with_the_ends_of_the_sole() -> None:
    run = walking.walk(steps=4)
    (axes,) = plot(run, "zmp").axes
    np.testing.assert_array_equal(
        curve(axes, "right foot")[1],
        np.where(zero_moment_point(run).single_support, zero_moment_point(run).foot[:, 0], np.nan),
    )
    bounds = [line for line in axes.get_lines() if len(np.asarray(line.get_xdata())) == 2]
    assert sorted(float(np.asarray(line.get_ydata())[0]) for line in bounds) == [-0.1, 0.1]
    assert {line.get_linestyle() for line in bounds} == {"--"}
    assert axes.get_ylim()[0] < -0.1 < 0.1 < axes.get_ylim()[1]


def test_zero_moment_point_of_a_robot_that_stands_on_both_feet() -> None:
    """It is there, thin: each foot's own. Only a foot that pushes alone is drawn as such."""
    robot = walking.bravo7()
    run = make_run(robot, 0.1 * np.arange(4), force=pushes(robot, [[0, 1], [0, 1], [0], [1]]))
    (axes,) = plot(run, "zmp").axes
    thin = [line for line in axes.get_lines() if line.get_linewidth() < 1.0]
    own = zero_moment_point(run).foot
    for line, expected, alone in zip(thin, own.T, (2, 3), strict=False):
        np.testing.assert_array_equal(line.get_ydata(), expected)
        assert np.isfinite(expected).sum() == 3
        shown = curve(axes, "right foot" if alone == 2 else "left foot")[1]
        assert np.flatnonzero(np.isfinite(shown)).tolist() == [alone]
    assert len(thin) >= 2
    assert "double support" in axes.figure.get_suptitle()  # type: ignore[union-attr]


def snapshot_times(figure: matplotlib.figure.Figure) -> list[float]:
    (axes,) = figure.axes
    words = [text.get_text() for text in axes.texts]
    return [float(word.removesuffix(" s")) for word in words if word.endswith(" s")]


def stumbling() -> hs.Run:
    """Make a run of bravo7: steps of 0.7 s, then both feet land within 10 ms, and it falls."""
    robot = walking.bravo7()
    right, left = (foot.contacts for foot in robot.feet)
    happened = [
        (touchdown, 0.7, left),
        (liftoff, 0.71, right),
        (touchdown, 1.4, right),
        (liftoff, 1.0, left),
        (touchdown, 1.41, left),
        (liftoff, 1.411, right),
        (touchdown, 1.413, right),
        (liftoff, 1.414, left),
        (touchdown, 1.416, left),
    ]
    events = [what(when, contact) for what, when, foot in happened for contact in foot]
    time = 1e-3 * np.arange(1800)
    force = pushes(robot, [[0]] * len(time))
    return make_run(robot, time, force=force, events=sorted(events, key=lambda e: e.time))


def test_snapshots_show_a_step_and_no_stumble() -> None:
    figure = plot(stumbling(), "snapshots")
    assert figure.get_suptitle() == "bravo7: from 0.70 s to 1.40 s"


def test_snapshots_are_in_the_order_of_time() -> None:
    """Also where hardly any row is without an impact."""
    for span in (None, (1.39, 1.42), (1.411, 1.417)):
        times = snapshot_times(plot(stumbling(), "snapshots", span=span))
        assert len(times) == 7
        assert times == sorted(times)
    robot = walking.bravo7()
    state = hs.State(robot.model.reference, np.full(robot.nv, 0.4))
    times = snapshot_times(plot(hs.simulate(robot, state=state, duration=3.0), "snapshots"))
    assert times == sorted(times)
    assert times[-1] > times[0]


def test_force_arrows_have_a_scale() -> None:
    (axes,) = plot(walking.walk(steps=4), "snapshots").axes
    assert "736 N" in [text.get_text() for text in axes.texts]


@pytest.mark.parametrize("what", ["forces", "energy", "gaps"])
def test_no_curve_hides_another(what: str) -> None:
    """Of two that lie upon each other the lower one is wider, and its colour or stroke another."""
    for axes in plot(walking.walk(steps=1), what).axes:
        curves = [line for line in axes.get_lines() if len(np.asarray(line.get_xdata())) > 2]
        widths = [line.get_linewidth() for line in curves]
        assert len(curves) >= 2
        assert all(below > above for below, above in pairwise(widths))
        assert len({str(line.get_color()) for line in curves}) == len(curves)


def test_friction_cone() -> None:
    run = walking.walk(steps=4)
    figure = plot(run, "friction")
    axes = panel(figure, "left foot")
    _, cone = curve(axes, "cone ±μFₙ")
    _, force = curve(axes, "Fₜ")
    held = np.isfinite(cone)
    np.testing.assert_allclose(cone[held], 0.75 * run.contact_force[held][:, [2, 3], 0].sum(axis=1))
    assert np.all(np.abs(force[held]) <= cone[held])
    # An impact of 10 kN must not flatten half a kilonewton: it leaves the scale, and is mentioned.
    assert np.nanmax(cone) > 3e3
    assert 300.0 < axes.get_ylim()[1] < 2e3
    assert any("impacts leave the scale" in text.get_text() for text in figure.texts)


def test_energy_figure_is_the_balance() -> None:
    run = walking.walk(steps=4)
    axes = panel(plot(run, "energy"), "work since the start")
    np.testing.assert_array_equal(curve(axes, "ground")[1], energy_balance(run).contacts)
    assert "dampers" not in [line.get_label() for line in axes.get_lines()]  # bravo7 has none


def test_impacts_are_the_rows_around_touchdowns() -> None:
    run = walking.walk(steps=4)
    rows = np.flatnonzero(impact_rows(run))
    times = run.time[rows]
    assert 3 <= len(rows) <= 12
    assert np.all(np.abs(times / 0.7 - np.round(times / 0.7)) < 5e-3)
    # They hold the largest forces of the run.
    usual = np.delete(run.contact_force[..., 0], rows, axis=0)
    assert usual.max() < 1e3 < run.contact_force[..., 0].max()


def test_span() -> None:
    run = walking.walk(steps=4)
    for what in FIGURES:
        figure = plot(run, what, gait=walking.gait(), span=(0.7, 1.4))
        if what != "snapshots":
            assert figure.axes[0].get_xlim() == pytest.approx((0.7, 1.4))
    for span in ((1.0, 0.5), (50.0, 60.0)):
        with pytest.raises(ViewError, match="no rows from"):
            plot(run, "zmp", span=span)
    with pytest.raises(ViewError, match="pair of times"):
        plot(run, "zmp", span="all")  # type: ignore[arg-type]


def test_unknown_figure_lists_the_known_ones() -> None:
    with pytest.raises(ViewError) as caught:
        plot(walking.walk(steps=1), "traking")
    assert "Did you mean 'tracking'?" in str(caught.value)
    for name in FIGURES:
        assert name in str(caught.value)


def test_run_without_rows() -> None:
    with pytest.raises(ViewError, match="nothing to draw"):
        plot(make_run(walking.bravo7(), np.zeros(0)), "zmp")


@pytest.mark.parametrize("suffix", [".pdf", ".svg", ".PNG"])
def test_kinds_of_picture(suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"figure{suffix}"
    plot(walking.walk(steps=1), "zmp", path=path)
    assert path.stat().st_size > 3000


def test_where_a_picture_cannot_go(tmp_path: Path) -> None:
    run = walking.walk(steps=1)
    with pytest.raises(ViewError, match="no folder"):
        plot(run, "zmp", path=tmp_path / "nowhere" / "zmp.png")
    with pytest.raises(ViewError, match="it is a folder"):
        plot(run, "zmp", path=tmp_path)
    with pytest.raises(ViewError, match=r"\.png, \.pdf or \.svg"):
        plot(run, "zmp", path=tmp_path / "zmp.docx")


def test_pictures_repeat_to_the_last_pixel(tmp_path: Path) -> None:
    run = walking.walk(steps=1)
    for name in ("a.png", "b.png"):
        plot(run, "forces", path=tmp_path / name)
    with Image.open(tmp_path / "a.png") as a, Image.open(tmp_path / "b.png") as b:
        np.testing.assert_array_equal(np.asarray(a), np.asarray(b))


def test_the_callers_own_settings_neither_matter_nor_change() -> None:
    with matplotlib.rc_context({"font.size": 31.0, "axes.grid": False}):
        before = dict(matplotlib.rcParams)
        figure = plot(walking.walk(steps=1), "zmp")
        assert dict(matplotlib.rcParams) == before
        assert figure.axes[0].yaxis.label.get_fontsize() == 10.0


def test_no_window_and_no_global_list_of_figures() -> None:
    script = (
        "import sys, heelstrike as hs; from heelstrike.view import plot;"
        "r = hs.load_robot('bravo7');"
        "plot(hs.simulate(r, state=r.reference_state(), duration=0.01), 'zmp');"
        "print('matplotlib.pyplot' in sys.modules)"
    )
    result = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    )
    assert result.stdout.strip() == "False"


def test_a_long_legend_stays_on_the_sheet_and_tells_all_curves_apart() -> None:
    """Nine coordinates: more than colours, more than fit side by side."""
    figure = plot(walking.walk(steps=1), "position")
    (axes,) = figure.axes
    figure.draw_without_rendering()
    legend = axes.get_legend()
    assert legend is not None
    box = legend.get_window_extent()
    assert 0.0 <= box.x0 < box.x1 <= figure.bbox.x1
    looks = {(line.get_color(), line.get_linestyle()) for line in axes.get_lines()}
    assert len(looks) == len(axes.get_lines()) == 9
    assert axes.get_position().x1 > 0.95  # the legend does not press the curves together


def test_point_feet_and_walkers_without_motors() -> None:
    """Feet of one point called by a number; nothing of actuators that there are not."""
    robot = hs.load_robot("compass_gait")
    run = make_run(robot, [0.0, 0.1], force=pushes(robot, [[0], [0]]))
    (zmp,) = plot(run, "zmp").axes
    assert zmp.get_ylim() == (-0.05, 0.05)
    assert "points" in zmp.get_title(loc="right")
    labels = [line.get_label() for line in plot(run, "gaps").axes[0].get_lines()]
    assert labels == ["point 0"]
    works = panel(plot(run, "energy"), "work since the start")
    assert "actuators" not in [line.get_label() for line in works.get_lines()]


def test_a_dollar_in_a_name_is_a_dollar(tmp_path: Path) -> None:
    """Read as a formula, such a name would keep the figure from being drawn."""
    robot = dataclasses.replace(box(), name=r"$\frac$ of a_b^c")
    plot(make_run(robot, np.linspace(0.0, 1.0, 5)), "gaps", path=tmp_path / "box.svg")
    assert r"$\frac$ of a_b^c" in (tmp_path / "box.svg").read_text()


def test_a_picture_is_drawn_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """matplotlib draws a figure twice to lay it out; what is written is the same, bit by bit."""
    figure = plot(walking.walk(steps=4), "energy")
    with styled():
        figure.savefig(tmp_path / "twice.png")
    draws, draw = [], Picture.draw
    monkeypatch.setattr(Picture, "draw", lambda *given: (draws.append(1), draw(*given)))
    once = save_figure(figure, tmp_path / "once.png")
    assert once.read_bytes() == (tmp_path / "twice.png").read_bytes()
    assert len(draws) == 1
    assert figure.get_layout_engine() is not None
