"""The live view of a robot in space in a browser: pushed, looked at from elsewhere, linked to."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browsers import browser, wait_until
from live_humanoid import humanoid, standing
from live_page import PUSH, Page

import heelstrike as hs

pytestmark = pytest.mark.slow  # left to `make test` by continuous integration

pytest.importorskip("websockets", reason="the live view is not installed: heelstrike[watch]")
pytest.importorskip("playwright", reason="playwright, which drives the browser, is missing")


def drag(seen: Page, at: tuple[float, float], by: tuple[float, float]) -> None:
    box = seen.page.locator("#plane").bounding_box()
    x, y = box["x"] + at[0] * box["width"], box["y"] + at[1] * box["height"]
    seen.page.mouse.move(x, y)
    seen.page.mouse.down()
    seen.page.mouse.move(x + by[0], y + by[1], steps=4)


def test_a_robot_in_space_is_pushed_and_looked_at(tmp_path: Path) -> None:
    simulation = standing(humanoid(tmp_path), stop_when_fallen=False)
    simulation.advance(0.01)
    with (
        browser() as chromium,
        hs.watch(simulation, browser=False, block=False) as viewer,
        Page(chromium, viewer) as seen,
    ):
        wait_until(lambda: seen.data("frames") > 5, "a course")
        drag(seen, (0.5, 0.47), (80.0, 0.0))  # the trunk is in the middle of the picture
        wait_until(lambda: seen.data("pushed") > 1.0, "a push")
        wait_until(lambda: len(seen.where(PUSH)) > 30, "its arrow")
        seen.page.mouse.up()
        wait_until(lambda: seen.data("pushed") == 0.0, "its end")
        seen.halt()
        still = seen.picture()
        drag(seen, (0.08, 0.2), (150.0, 20.0))  # beside it
        seen.page.mouse.up()
        wait_until(lambda: differs(seen, still), "another side of it")
        assert seen.data("pushed") == 0.0
        turned = seen.picture()
        wait_until(
            lambda: "look=" in seen.page.evaluate("location.href"), "an address of what is seen"
        )
        with Page(chromium, viewer, first=False) as other:
            other.page.goto("about:blank")
            other.page.goto(seen.page.url)
            wait_until(lambda: other.time == seen.time, "the same time")
            wait_until(lambda: np.array_equal(other.picture(), turned), "the same picture")
        seen.page.keyboard.press("0")
        wait_until(lambda: np.array_equal(seen.picture(), still), "the usual view")
        seen.page.keyboard.press("3")
        wait_until(lambda: differs(seen, still), "the view from ahead")
        seen.page.keyboard.press("?")
        assert "turn the view" in seen.text("key-list")


def differs(seen: Page, before: Any) -> bool:
    return bool(np.mean(np.abs(seen.picture() - before).max(axis=-1) > 20) > 0.02)
