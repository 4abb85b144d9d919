"""How the live view looks: it fits, stands still, and can be read, kept and sent."""

from __future__ import annotations

import threading
from pathlib import Path
from typing import Any

import imageio_ffmpeg
import numpy as np
import pytest
import walking
from browsers import wait_until
from live_page import FORCE, LEFT_LEG, RIGHT_LEG, TRUNK, Page, pixels
from PIL import Image

import heelstrike as hs
from heelstrike.view.live.stage import Control, Stage, friction_control
from heelstrike.view.live.viewer import Viewer, view

pytestmark = pytest.mark.slow  # left to `make test` by continuous integration

pytest.importorskip("websockets", reason="the live view is not installed: heelstrike[watch]")
pytest.importorskip("playwright", reason="playwright, which drives the browser, is missing")

TABS = ("settings", "joints", "marks", "plots")
WIDTHS = {390: TABS, 640: (), 641: (), 768: TABS, 1199: (), 1200: (), 1440: (), 1700: (), 1920: ()}
"""Of windows, in pixels, and the tabs that are looked at in each."""
LAID_OUT = """() => {
  const shown = (each) => each.checkVisibility({ opacityProperty: false })
    && each.getClientRects().length;
  const wrong = [], tops = (row) => new Set([...document.querySelectorAll(row)].filter(shown)
    .map((each) => Math.round(each.getBoundingClientRect().top)));
  if (document.documentElement.scrollWidth > innerWidth) wrong.push("wider than the window");
  for (const row of ["#tools > *", ".buttons > *", ".choices > *", "#tabs > *", "#groups > *"])
    if (tops(row).size > 1) wrong.push(`${row} wraps`);
  for (const each of document.querySelectorAll("button, select, label, h1, h2, p, output, b")) {
    if (!shown(each)) continue;
    const box = each.getBoundingClientRect(), name = `${each.tagName} ${each.id}`;
    if (each.tagName === "BUTTON" && each.scrollWidth > each.clientWidth + 1)
      wrong.push(`${name} is too narrow for ${each.textContent}`);
    if (box.left < 0 || box.right > innerWidth + 0.5) wrong.push(`${name} leaves the window`);
    if (each.textContent.trim() && parseFloat(getComputedStyle(each).fontSize) < 13)
      wrong.push(`${name} has small letters`);
  }
  for (const each of document.querySelectorAll("button, select, input"))
    if (!(each.getAttribute("aria-label") || each.textContent.trim() || each.labels?.length))
      wrong.push(`${each.tagName} ${each.id} has no name`);
  for (const each of document.querySelectorAll("#sliders b"))
    if (shown(each) && each.scrollWidth > each.clientWidth)
      wrong.push(`${each.textContent} is cut`);
  const side = document.getElementById("side");
  if (innerWidth >= 1440 && side.scrollHeight > side.clientHeight) wrong.push("a panel is cut");
  const plane = document.getElementById("plane").getBoundingClientRect();
  if (plane.width < 0.4 * innerWidth || plane.height < 230) wrong.push("a small picture");
  return wrong;
}"""
PLACES = """() => Object.fromEntries(["light", "tools", "plane", "strip", "play", "event-after",
  "rate", "resume", "settings", "joints", "groups", "curves"].map((name) => {
    const { x, y, width, height } = document.getElementById(name).getBoundingClientRect();
    return [name, [x, y, width, height].map(Math.round)];
  }))"""


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_it_fits_all_windows(chromium: Any, viewer: Viewer, scheme: str) -> None:
    """From a telephone to a large screen nothing wraps, is cut off or too small to be read."""
    with Page(chromium, viewer, color_scheme=scheme) as seen:
        for width, tabs in WIDTHS.items():
            seen.page.set_viewport_size({"width": width, "height": 844 if width < 1000 else 900})
            assert seen.page.evaluate(LAID_OUT) == [], width
            for tab in tabs:
                button = seen.page.locator(f"#tabs button[data-tab={tab}]")
                if button.get_attribute("aria-pressed") == "false":
                    button.click()
                assert seen.page.evaluate(LAID_OUT) == [], (width, tab)
        letters, ink = seen.page.evaluate(
            "[getComputedStyle(document.body).color, HeelstrikeDrawing.palette("
            f"{str(scheme == 'dark').lower()}).ink]"
        )
        assert letters == f"rgb({', '.join(str(int(ink[k : k + 2], 16)) for k in (1, 3, 5))})"


@pytest.mark.parametrize("width", [390, 1440])
def test_nothing_jumps(chromium: Any, viewer: Viewer, width: int) -> None:
    with Page(chromium, viewer, viewport={"width": width, "height": 860}) as seen:
        places = seen.page.evaluate(PLACES)

        def stays(when: str) -> None:
            assert seen.page.evaluate(PLACES) == places, when

        seen.halt()
        stays("halted")
        seen.page.keyboard.press("p")
        wait_until(lambda: " N on " in seen.text("note"), "a note")
        stays("with a note")
        seen.page.keyboard.press("v")
        stays("while a film is made")
        seen.page.keyboard.press("v")
        viewer._session._tell_busy("designing a gait: 42 %")
        wait_until(lambda: "42 %" in seen.text("banner"), "the banner")
        stays("busy")
        viewer._session._tell_busy("")
        seen.page.select_option("#rate", "0.01")
        seen.page.click("#play")
        wait_until(lambda: viewer._session.playing, "slow motion")
        stays("in slow motion")


class Slow(Stage):
    """A stage whose simulation takes until it is let go."""

    def __init__(self) -> None:
        self.ready = threading.Event()
        robot = walking.bravo7()
        self._walk = hs.Simulation(
            robot, hs.ComputedTorque(robot, walking.gait()), state=walking.gait().initial_state
        )

    def controls(self, values: Any) -> tuple[Control, ...]:
        return (friction_control(0.75),)

    def simulation(self, values: Any, progress: Any) -> hs.Simulation:
        progress("designing a gait of 0.3 m: 42 %")
        self.ready.wait()
        return self._walk

    def ground(self, values: Any, simulation: Any) -> hs.Ground:
        return hs.Ground()


def test_from_the_first_moment_it_says_what_is_done(chromium: Any, gait: Path) -> None:
    """And nothing moves when the robot is there."""
    stage = Slow()
    try:
        with view(stage=stage) as viewer, Page(chromium, viewer, first=False) as seen:
            told = seen.page.locator("#waiting, #banner")
            wait_until(lambda: "42 %" in " ".join(told.all_inner_texts()), "what is done")
            assert seen.page.locator("input[name=friction]").is_visible()
            names = ("plane", "strip", "play", "settings")
            before = seen.page.evaluate(PLACES)
            stage.ready.set()
            wait_until(lambda: seen.time > 0.0, "the robot")
            assert seen.page.locator("#waiting").is_hidden()
            after = seen.page.evaluate(PLACES)
            assert [before[name] for name in names] == [after[name] for name in names]
    finally:
        stage.ready.set()


def test_an_impact_leaves_the_axis_as_it_is(chromium: Any, viewer: Viewer) -> None:
    """It is cut off, and marked with an arrow in the colour of its foot."""
    with Page(chromium, viewer) as seen:
        wait_until(lambda: seen.time > 0.3, "a walk")
        seen.halt()
        seen.page.click("#groups >> text=feet")
        canvas = seen.page.locator("#curves canvas[aria-label*='normal force']")
        drawn = f"{seen.time}"
        wait_until(lambda: canvas.get_attribute("data-cursor") == drawn, "the curves")
        before = canvas.get_attribute("data-span")
        session = viewer._session
        begin = session._layout.begin["pressing"]
        frames = np.repeat(session._board._frames[-1][None], 3, axis=0)
        frames[:, 0] += 0.02 * np.arange(1, 4)
        frames[1, begin] = 20_640.0
        session._board.add(frames)
        last = float(frames[-1, 0])
        wait_until(lambda: float(canvas.get_attribute("data-cursor")) == last, "the impact")
        assert canvas.get_attribute("data-span") == before
        assert float(before.split()[1]) < 2.0 * walking.bravo7().weight
        arrow = np.abs(pixels(canvas)[26:30] - RIGHT_LEG).max(axis=-1) < 16
        assert arrow.sum(axis=1).max() >= 5  # wider than a curve


def test_a_picture_and_a_film_are_saved(chromium: Any, viewer: Viewer, tmp_path: Path) -> None:
    with Page(chromium, viewer) as seen:
        wait_until(lambda: seen.time > 0.1, "a walk")
        with seen.page.expect_download() as saved:
            seen.page.click("#shot")
        name = saved.value.suggested_filename
        assert name.startswith("bravo7-")
        assert name.endswith("s.png")
        saved.value.save_as(tmp_path / name)
        with Image.open(tmp_path / name) as picture:
            found = np.asarray(picture.convert("RGB")).astype(int)
        plane = seen.page.locator("#plane").bounding_box()
        assert found.shape[1] > 1.3 * plane["width"]  # curves beside the picture
        for color in (RIGHT_LEG, LEFT_LEG, TRUNK):
            assert (np.abs(found - color).max(axis=-1) < 16).sum() > 50
        seen.page.keyboard.press("v")
        wait_until(lambda: seen.text("recorded") == "0:01", "a second of film")
        with seen.page.expect_download() as saved:
            seen.page.keyboard.press("v")
        assert saved.value.suggested_filename.endswith(".webm")
        saved.value.save_as(tmp_path / "walk.webm")
        frames = imageio_ffmpeg.read_frames(str(tmp_path / "walk.webm"))
        wide, high = next(frames)["size"]
        first, last = np.frombuffer(next(frames), np.uint8), None
        for each in frames:
            last = np.frombuffer(each, np.uint8)
        assert abs(wide - found.shape[1]) <= 2
        assert last is not None
        moved = np.abs(first.astype(int) - last).reshape(high, wide, 3).max(axis=-1)
        assert (moved > 64).sum() > 200


def address(seen: Page) -> str:
    return str(seen.page.evaluate("location.href"))


def test_a_link_carries_what_is_seen(chromium: Any, viewer: Viewer) -> None:
    with Page(chromium, viewer) as seen:
        seen.halt()
        usual = address(seen)
        before = seen.picture()
        seen.page.uncheck("input[name=show-forces]")
        seen.page.click("#groups >> text=feet")
        seen.page.select_option("#span", "10")
        seen.page.locator("#plane").focus()
        seen.page.keyboard.press("+")
        wait_until(lambda: "zoom=1.25" in address(seen), "an address of what is seen")
        assert (
            "hide=forces&curves=feet&span=10"
            in seen.page.url.partition("#")[2].replace("zoom=1.25&", "")
            or "curves=feet&span=10&hide=forces" in seen.page.url
        )
        there, way = seen.picture(), address(seen)
        assert not len(seen.where(FORCE)) > 400
        with Page(chromium, viewer, first=False) as other:
            other.page.goto("about:blank")
            other.page.goto(way)
            wait_until(lambda: other.time == seen.time, "the same time")
            wait_until(lambda: np.array_equal(other.picture(), there), "the same picture")
            assert other.page.input_value("#span") == "10"
            assert other.page.locator("#groups [aria-pressed=true]").inner_text() == "feet"
            other.page.click("#view-reset")
            wait_until(lambda: address(other) == usual, "the usual address")
            wait_until(lambda: np.array_equal(other.picture(), before), "the usual picture")
            assert other.page.locator("#groups [aria-pressed=true]").inner_text() == "joints"


def test_numbers_can_be_read(chromium: Any, viewer: Viewer) -> None:
    """Of all frames of a second a few only change the words."""
    with Page(chromium, viewer) as seen:
        counted = seen.page.evaluate(
            """() => new Promise((done) => {
              let words = 0, frames = 0, before = "", last = 0;
              const plane = document.getElementById("plane"), began = performance.now();
              const tick = () => {
                const now = document.getElementById("clock").textContent;
                if (now !== before) words++;
                if (plane.dataset.time !== last) frames++;
                before = now;
                last = plane.dataset.time;
                const elapsed = performance.now() - began;
                if (elapsed > 1000 && frames > 8) done([words, frames, elapsed / 1000]);
                else requestAnimationFrame(tick);
              };
              tick();
            })"""
        )
        words, frames, elapsed = counted
        assert words <= 4.0 * elapsed + 2.0
        assert frames > words
