"""Pictures, films and pages of runs in space: what is drawn, and where."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import imageio_ffmpeg
import numpy as np
import pytest
from figure_text import check_text
from PIL import Image

import heelstrike as hs
from heelstrike.errors import ViewError
from heelstrike.sim.spatial.run import RECORDED
from heelstrike.view import robot_picture
from heelstrike.view.spatial import figures
from heelstrike.view.spatial.camera import Camera
from heelstrike.view.spatial.film import SpatialFilm
from heelstrike.view.spatial.stage import grid_spacing
from heelstrike.view.style import styled

BIPED = """
<mujoco model="strider"><compiler angle="radian"/><worldbody><body name="hips" pos="0 0 0.9">
  <freejoint name="root"/><geom type="box" size="0.1 0.15 0.1" mass="10"/>
  <body name="left_leg" pos="0 0.1 -0.1"><joint name="left_hip" axis="1 0 0" range="-1 1"/>
    <geom type="capsule" fromto="0 0 0 0 0 -0.7" size="0.04" mass="3" contype="0" conaffinity="0"/>
    <geom type="box" pos="0 0 -0.77" size="0.12 0.06 0.03" mass="0.1"/></body>
  <body name="right_leg" pos="0 -0.1 -0.1"><joint name="right_hip" axis="1 0 0" range="-1 1"/>
    <geom type="capsule" fromto="0 0 0 0 0 -0.7" size="0.04" mass="3" contype="0" conaffinity="0"/>
    <geom type="box" pos="0 0 -0.77" size="0.12 0.06 0.03" mass="0.1"/></body>
</body></worldbody><actuator><motor name="left" joint="left_hip"/>
<motor name="right" joint="right_hip"/></actuator></mujoco>"""

LEFT, RIGHT, FORCE, PRESSURE = (0, 114, 178), (213, 94, 0), (0, 158, 115), (204, 121, 167)


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> hs.SpatialRobot:
    path = tmp_path_factory.mktemp("robot") / "strider.xml"
    path.write_text(BIPED)
    return hs.load_robot(path, dimension=3)


@pytest.fixture(scope="module")
def run(robot: hs.SpatialRobot) -> hs.sim.spatial.SpatialRun:
    law = hs.HoldPosture(robot, kp=2000.0, kd=50.0)
    state = robot.reference_state()
    state.v[0] = 0.1
    box = hs.Box(center=(1.5, 0.0, 0.1), size=(0.4, 0.6, 0.2))
    ground = hs.SpatialGround(boxes=(box,))
    return hs.simulate(robot, law, state=state, duration=0.4, ground=ground)


def share(picture: np.ndarray, color: tuple[int, int, int], within: int = 25) -> float:
    near = np.abs(picture[..., :3].astype(int) - color).max(axis=-1) < within
    return float(near.mean())


def hue(picture: np.ndarray, color: tuple[int, int, int]) -> float:
    """Share of the pixels of the hue of a colour, however bright."""
    pixels = picture[..., :3].astype(float)
    known = np.array(color, dtype=float) / np.linalg.norm(color)
    along = pixels @ known
    aside = np.linalg.norm(pixels - along[..., None] * known, axis=-1)
    return float(np.mean((aside < 0.12 * along) & (along > 60.0)))


def test_a_frame_shows_robot_forces_and_support(run: hs.sim.spatial.SpatialRun) -> None:
    with styled():
        film = SpatialFilm(run, (640, 360), 30.0, 1.0)
        picture = np.array(film.draw(len(film) - 1))
    assert picture.shape == (360, 640, 4)
    assert len(film) == 13
    for color in (LEFT, RIGHT):
        assert hue(picture, color) > 2e-3, color
    assert share(picture, FORCE) > 5e-4
    assert share(picture, PRESSURE) > 1e-4


def test_a_frame_stands_where_the_robot_does(run: hs.sim.spatial.SpatialRun) -> None:
    """The camera follows: in the middle of every frame is the robot, not what it left."""
    with styled():
        film = SpatialFilm(run, (640, 360), 30.0, 1.0)
        first, last = np.array(film.draw(0)), np.array(film.draw(len(film) - 1))
    for picture in (first, last):
        pixels = picture[..., :3].astype(int)
        legs = (np.ptp(pixels, axis=-1) > 90)[:, 60:580]
        assert abs(60 + np.flatnonzero(legs.any(axis=0)).mean() - 320) < 60


def test_mp4_and_gif(run: hs.sim.spatial.SpatialRun, tmp_path: Path) -> None:
    path = run.animate(tmp_path / "run.mp4", size=(320, 180), fps=20.0)
    meta = next(imageio_ffmpeg.read_frames(str(path)))
    assert meta["size"] == (320, 180)
    assert imageio_ffmpeg.count_frames_and_secs(str(path))[0] == 9
    path = run.animate(tmp_path / "run.gif", size=(320, 180), fps=20.0)
    with Image.open(path) as film:
        assert film.n_frames == 9
    with pytest.raises(ViewError, match=r"ends in \.mp4 or \.gif"):
        run.animate(tmp_path / "run.avi")


@pytest.mark.parametrize("what", ["forces", "zmp", "torque", "slip", "residual"])
def test_figures_have_units(run: hs.sim.spatial.SpatialRun, what: str) -> None:
    figure = run.plot(what)
    assert figure.get_suptitle().startswith("strider: ")
    for axes in figure.axes:
        assert axes.get_ylabel()
        for line in axes.get_lines():
            assert len(line.get_xdata()) in (2, len(run.time))
    check_text(figure)


def test_forces_of_feet_are_those_of_the_run(run: hs.sim.spatial.SpatialRun) -> None:
    upright = run.plot("forces").axes[2]
    total = sum(np.asarray(line.get_ydata()) for line in upright.get_lines())
    np.testing.assert_allclose(total, run.contact_force[..., 0].sum(axis=1), atol=1e-9)


def test_an_unknown_figure_is_refused_with_what_there_is(run: hs.sim.spatial.SpatialRun) -> None:
    with pytest.raises(ViewError, match="Did you mean 'torque'") as caught:
        run.plot("torqe")
    for name in ("forces", "zmp", *RECORDED):
        assert name in str(caught.value)
    with pytest.raises(ViewError, match="no rows from 5"):
        run.plot("gap", span=(5.0, 6.0))
    with pytest.raises(ViewError, match="a span is a pair of times"):
        run.plot("gap", span=0.5)


@pytest.mark.parametrize("size", [0.001, 0.66, 0.67, 0.92, 1.0, 1.7, 6.6, 6.7, 9.99, 40.0])
def test_the_ground_has_lines_for_a_robot_of_any_size(size: float) -> None:
    spacing = grid_spacing(size)
    assert 0.3 * size < spacing < size
    assert f"{spacing:.0e}"[0] in "125"


def test_a_portrait(robot: hs.SpatialRobot, tmp_path: Path) -> None:
    path = robot_picture(robot, tmp_path / "strider.png")
    with Image.open(path) as picture:
        pixels = np.array(picture.convert("RGB"))
    for color in (LEFT, RIGHT):
        assert hue(pixels, color) > 5e-3
    with pytest.raises(ViewError, match="in the plane only"):
        robot_picture(robot, path, ground=hs.Ground())


def test_a_camera() -> None:
    """What is level with it keeps its size; what is nearer is larger."""
    target = np.array([1.0, 2.0, 0.5])
    camera = Camera(target, 4.0, azimuth=0.0, elevation=0.0)  # ahead on x
    np.testing.assert_allclose(camera.place, [5.0, 2.0, 0.5])
    places = np.array([[1.0, 2.0, 0.5], [1.0, 3.0, 1.5], [3.0, 3.0, 1.5]])
    seen, near = camera.seen(places)
    np.testing.assert_allclose(seen, [[0.0, 0.0], [1.0, 1.0], [2.0, 2.0]])
    np.testing.assert_allclose(near, [0.0, 0.0, 2.0])


def embedded(path: Path) -> dict[str, object]:
    found = re.search(r'id="run">(.*?)</script>', path.read_text(encoding="utf-8"), re.S)
    assert found is not None
    return json.loads(found[1])


@pytest.mark.slow
def test_a_page_holds_the_run(run: hs.sim.spatial.SpatialRun, tmp_path: Path) -> None:
    path = run.save_html(tmp_path / "run.html", command="heelstrike simulate <x>")
    text = path.read_text(encoding="utf-8")
    assert len(text.encode()) < 1.5e6
    assert "heelstrike simulate &lt;x&gt;" in text
    assert "<x>" not in text
    assert not re.search(r'(src|href)="(?!data:)', text)
    held = embedded(path)
    assert held["recorded"] == len(run.time)
    scene = held["scene"]
    assert [foot["name"] for foot in scene["feet"]] == ["left leg", "right leg"]
    assert len(scene["ground"]["boxes"]) == 1
    corners = sum(len(solid["corners"]) // 3 for solid in scene["solids"])
    assert corners > 3 * 8  # boxes and capsules
    with pytest.raises(ViewError, match=r"ends in \.html"):
        run.save_html(tmp_path / "run.pdf")


def test_a_long_run_has_a_page_of_fewer_rows(
    run: hs.sim.spatial.SpatialRun, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from heelstrike.view.spatial import page

    whole = run.save_html(tmp_path / "whole.html")
    monkeypatch.setattr(page, "FEWEST_ROWS", 12)
    monkeypatch.setattr(page, "MOST_ROWS", 40)
    monkeypatch.setattr(page, "LARGEST", 1000)
    small = run.save_html(tmp_path / "small.html")
    rows = embedded(small)["data"]["rows"]
    assert 10 <= rows <= 12 < embedded(whole)["data"]["rows"]


def test_of_many_points_the_lowest_of_each_link_is_drawn(
    run: hs.sim.spatial.SpatialRun, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(figures, "MOST_NAMED", run.robot.nc - 1)
    figure = run.plot("gap")
    (axes,) = figure.axes
    drawn = {line.get_label(): line.get_ydata() for line in axes.get_lines()}
    links = np.array([name.rsplit("_", 1)[0] for name in run.robot.contact_names])
    for link in set(links.tolist()):
        lowest = run.gap[:, links == link].min(axis=1)
        np.testing.assert_array_equal(drawn[link.replace("_", " ")], lowest)
    assert "lowest point of each link" in figure.get_suptitle()
    assert axes.get_ylabel() == "m"


def test_torques_of_hinges_have_one_unit(run: hs.sim.spatial.SpatialRun) -> None:
    assert run.plot("torque").axes[0].get_ylabel() == "N m"


def test_friction_is_used_by_each_foot(run: hs.sim.spatial.SpatialRun) -> None:
    """Feet that press against each other use friction, though their forces cancel."""
    force = np.zeros_like(run.contact_force)
    for foot, sideways in zip(run.robot.feet, (2.0, -2.0), strict=True):
        force[:, foot.contacts[0]] = 10.0, 0.0, sideways
    spread = replace(run, contact_force=force)
    assert spread.summary().friction_use_max == pytest.approx(0.2 / run.ground.friction, rel=1e-12)
