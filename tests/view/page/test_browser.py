"""Pages in a browser: from a file, without a network, by mouse and keys, on a phone."""

from __future__ import annotations

import io
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import built_falls as falls
import numpy as np
import pytest
import walking
from PIL import Image

browsers = pytest.importorskip("browsers")
pytest.importorskip("playwright", reason="playwright, which drives the browser, is missing")

# 8-bit red, green, blue of what is drawn, on light and on dark pages.
LIGHT = {"right leg": (0, 114, 178), "left leg": (213, 94, 0), "force": (0, 120, 90)}
DARK = {"right leg": (79, 169, 226), "left leg": (240, 139, 75), "force": (53, 199, 157)}
PHONE = {"viewport": {"width": 390, "height": 844}, "is_mobile": True, "has_touch": True}


@pytest.fixture(scope="module")
def chromium() -> Iterator[Any]:
    with browsers.browser() as started:
        yield started


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("pages")
    run, gait = walking.walk(steps=2), walking.gait()
    shown = folder / "notebook.html"
    shown.write_text(run.show(gait=gait)._repr_html_(), encoding="utf-8")
    return {
        "walk": run.save_html(folder / "walk.html", gait=gait),
        "report": run.save_report(folder / "report.html", gait=gait),
        "notebook": shown,
    }


class Opened:
    """A page that was opened offline, and all that went wrong or was asked for."""

    def __init__(self, chromium: Any, path: Path, at: str = "", **options: Any) -> None:
        size = {"viewport": {"width": 1200, "height": 900}}
        self.page = chromium.new_context(offline=True, **(size | options)).new_page()
        self.wrong: list[str] = []
        self.asked: list[str] = []
        self.page.on("console", lambda message: self.wrong.append(message.text))
        self.page.on("pageerror", lambda error: self.wrong.append(str(error)))
        self.page.on("request", lambda request: self.asked.append(request.url))
        self.page.goto(path.as_uri() + at)

    def ready(self) -> Opened:
        self.page.locator("html[data-ready=yes]").wait_for(state="attached")
        return self

    @property
    def time(self) -> float:
        return float(self.page.inner_text("#clock").removesuffix(" s"))

    def share(self, selector: str, color: tuple[int, int, int]) -> float:
        """Share of the pixels of an element that have nearly a colour."""
        picture = Image.open(io.BytesIO(self.page.locator(selector).first.screenshot()))
        near = np.abs(np.asarray(picture.convert("RGB")).astype(int) - color).max(axis=-1) < 12
        return float(near.mean())

    def check(self) -> None:
        assert self.wrong == []
        assert all(url.startswith(("file:", "data:", "about:")) for url in self.asked), self.asked


@pytest.mark.parametrize(("scheme", "colors"), [("light", LIGHT), ("dark", DARK)])
def test_the_robot_is_drawn(
    chromium: Any, files: dict[str, Path], scheme: str, colors: dict[str, tuple[int, int, int]]
) -> None:
    opened = Opened(chromium, files["walk"], color_scheme=scheme).ready()
    for name, color in colors.items():
        assert opened.share("#plane", color) > 5e-4, name
    opened.page.keyboard.press("d")  # the other look
    other = DARK if colors is LIGHT else LIGHT
    assert opened.share("#plane", other["right leg"]) > 5e-4
    opened.check()


def test_keys(chromium: Any, files: dict[str, Path]) -> None:
    opened = Opened(chromium, files["walk"]).ready()
    press = opened.page.keyboard.press
    assert opened.time == 0.0
    press("ArrowRight")
    assert opened.time == 0.01
    press("ArrowLeft")
    assert opened.time == 0.0
    press("n")
    press("n")
    assert opened.time == 0.7
    assert "touchdown left foot" in opened.page.inner_text("#now")
    assert "0.700 s" in str(opened.page.get_attribute("#plane", "aria-label"))
    press("p")
    assert opened.time == 0.699
    press("End")
    assert opened.time == 1.4
    press("Home")
    press(" ")
    browsers.wait_until(lambda: opened.time > 0.2, "the robot to move")
    press(" ")
    held = opened.time
    opened.page.wait_for_timeout(150)
    assert opened.time == held
    opened.check()


@pytest.mark.slow
def test_a_page_in_a_frame_may_play_at_once(chromium: Any, files: dict[str, Path]) -> None:
    """Not for people who asked their system for stillness."""
    opened = Opened(chromium, files["walk"], "#autoplay").ready()
    browsers.wait_until(lambda: opened.time > 0.1, "the robot to move")
    opened.check()
    still = Opened(chromium, files["walk"], "#autoplay", reduced_motion="reduce").ready()
    still.page.wait_for_timeout(150)
    assert still.time == 0.0
    still.check()


@pytest.mark.slow
def test_a_page_in_a_frame_leaves_the_page_around_it_at_its_top(
    chromium: Any, files: dict[str, Path]
) -> None:
    """What stands behind # in an address must be no element's name: browsers scroll to those."""
    around = files["walk"].with_name("around.html")
    frame = '<iframe src="walk.html#autoplay" style="width:80%;height:700px"></iframe>'
    around.write_text(f'<p style="height:600px">Above.</p>{frame}', encoding="utf-8")
    opened = Opened(chromium, around)
    inside = opened.page.frame_locator("iframe")
    inside.locator("#play[aria-pressed=true]").wait_for()
    assert opened.page.evaluate("scrollY") == 0
    opened.check()


def test_mouse(chromium: Any, files: dict[str, Path]) -> None:
    """A curve, an event of the list, a choice of what is drawn."""
    opened = Opened(chromium, files["walk"]).ready()
    page = opened.page
    curve = page.locator("#curves canvas").first
    box = curve.bounding_box()
    curve.click(position={"x": 58 + 0.5 * (box["width"] - 68), "y": 80})
    assert opened.time == pytest.approx(0.7, abs=0.01)
    page.click("summary")
    page.click("#list button:has-text('touchdown') >> nth=-1")
    assert opened.time == 1.4
    page.keyboard.press("Home")
    with_forces = opened.share("#plane", LIGHT["force"])
    page.uncheck("#show-forces")
    page.uncheck("#show-cones")
    assert opened.share("#plane", LIGHT["force"]) < 0.1 * with_forces
    opened.check()


@pytest.mark.slow
@pytest.mark.parametrize("name", ["walk", "report"])
def test_on_a_phone(chromium: Any, files: dict[str, Path], name: str) -> None:
    opened = Opened(chromium, files[name], **PHONE).ready()
    assert opened.page.evaluate("document.documentElement.scrollWidth") <= 390
    assert opened.share("canvas", LIGHT["right leg"]) > 5e-4
    heights = opened.page.eval_on_selector_all(
        ".limits tr", "all => all.map(row => row.getBoundingClientRect().height)"
    )
    assert all(height < 120.0 for height in heights)  # no column is a letter wide
    opened.check()


def test_a_report_plays_its_film(chromium: Any, files: dict[str, Path]) -> None:
    opened = Opened(chromium, files["report"]).ready()
    start = opened.time
    opened.page.click("#play")
    browsers.wait_until(lambda: opened.time > start + 0.1, "the film to play")
    sizes = opened.page.eval_on_selector_all("img", "all => all.map(one => one.naturalWidth)")
    assert len(sizes) == 9
    assert min(sizes) > 300  # every figure is there
    opened.check()


@pytest.mark.slow
def test_a_report_of_a_fall_begins_where_it_went_wrong(chromium: Any, tmp_path: Path) -> None:
    """A click on what happened takes the film there."""
    run, gait = falls.run_of("pushed forwards"), walking.gait()
    opened = Opened(chromium, run.save_report(tmp_path / "fall.html", gait=gait)).ready()
    assert 0.85 < opened.time < 1.0
    opened.page.click(".happened tr:last-child button")
    assert opened.time == pytest.approx(float(run.time[-1]), abs=1e-3)
    assert opened.share("canvas", LIGHT["right leg"]) > 5e-4
    opened.check()


def test_a_notebook_shows_the_page_in_place(chromium: Any, files: dict[str, Path]) -> None:
    opened = Opened(chromium, files["notebook"])
    frame = opened.page.frame_locator("iframe")
    frame.locator("html[data-ready=yes]").wait_for(state="attached")
    frame.locator("#play").click()
    opened.check()
