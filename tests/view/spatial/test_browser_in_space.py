"""The page of a run in space in a browser: dragging turns it, time moves on."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import heelstrike as hs
from heelstrike.dynamics import spatial

browsers = pytest.importorskip("browsers")
pytest.importorskip("playwright", reason="playwright, which drives the browser, is missing")

ARM = """
<mujoco model="arm"><compiler angle="radian"/><worldbody><body name="base" pos="0 0 0.5">
  <freejoint name="root"/><geom type="box" size="0.1 0.1 0.1" mass="2"/>
  <body name="ball" pos="0.1 0 0.1" quat="0.9 0.1 0.3 0"><joint name="b" type="ball"/>
    <geom type="capsule" fromto="0 0 0 0.2 0 0.1" size="0.03" mass="1"/>
    <body name="slide" pos="0.2 0 0.1"><joint name="s" type="slide" axis="1 1 0"/>
      <geom type="sphere" size="0.04" mass="0.5"/>
      <body name="hinge" pos="0 0.1 0"><joint name="h" axis="0 1 1" ref="0.3"/>
        <geom type="cylinder" size="0.03 0.05" mass="0.5"/></body></body></body>
</body></worldbody></mujoco>"""


def picture(page: Any) -> np.ndarray:
    shot = page.locator("#plane").screenshot()
    return np.asarray(Image.open(io.BytesIO(shot)).convert("RGB")).astype(int)


def test_a_page_in_a_browser(tmp_path: Path) -> None:
    file = tmp_path / "arm.xml"
    file.write_text(ARM)
    robot = hs.load_robot(file, dimension=3)
    state = robot.reference_state()
    state.v[:] = np.linspace(-2.0, 2.0, robot.nv)
    run = hs.simulate(robot, state=state, duration=0.4)
    path = run.save_html(tmp_path / "run.html")
    wrong: list[str] = []
    asked: list[str] = []
    with browsers.browser() as chromium:
        page = chromium.new_context(
            offline=True, viewport={"width": 1000, "height": 800}
        ).new_page()
        page.on("console", lambda message: wrong.append(message.text))
        page.on("pageerror", lambda error: wrong.append(str(error)))
        page.on("request", lambda request: asked.append(request.url))
        page.goto(path.as_uri())
        page.locator("html[data-ready=yes]").wait_for(state="attached")
        first = picture(page)
        assert len(np.unique(first.reshape(-1, 3), axis=0)) > 30  # it is drawn, in the light
        box = page.locator("#plane").bounding_box()
        x, y = box["x"] + 300, box["y"] + 150
        page.mouse.move(x, y)
        page.mouse.down()
        page.mouse.move(x + 200, y + 30, steps=3)
        page.mouse.up()
        turned = picture(page)
        assert np.mean(np.abs(turned - first).max(axis=-1) > 20) > 0.02
        assert page.locator("#play").get_attribute("aria-pressed") == "false"  # it was no click
        page.keyboard.press("r")
        np.testing.assert_array_equal(picture(page), first)
        slider = "t => { t.value = 5000; t.dispatchEvent(new Event('input', {bubbles: true})); }"
        page.locator("#time").evaluate(slider)
        assert float(page.inner_text("#clock").removesuffix(" s")) == pytest.approx(0.2, abs=2e-3)
        page.locator("#plane").click(position={"x": 30, "y": 30})
        assert page.locator("#play").get_attribute("aria-pressed") == "true"
        page.keyboard.press(" ")
        # The page's own kinematics against the kernels', all kinds of joints among them.
        row = len(run.time) // 2
        found = page.evaluate(
            "q => HeelstrikeSpace.placed(JSON.parse(document.getElementById('run').textContent)"
            ".scene.tree, q)",
            run.position[row].tolist(),
        )
        poses = spatial.link_poses(robot, run.position[row])
        np.testing.assert_allclose(found["origin"], poses.origin, atol=1e-9)
        turns = np.array(found["rotation"]).reshape(-1, 3, 3)
        np.testing.assert_allclose(turns, poses.rotation, atol=1e-9)
    assert wrong == []
    assert all(url.startswith(("file:", "data:")) for url in asked), asked
