"""The live view in a browser: what a person sees, and does with mouse and keys."""

from __future__ import annotations

import http.server
import io
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import walking
from browsers import browser, wait_until
from PIL import Image

import heelstrike as hs
from heelstrike.cli.options import method_called
from heelstrike.cli.watch import METHODS
from heelstrike.experiments.watching import First, WalkStage
from heelstrike.view.live.viewer import Viewer, view

pytest.importorskip("websockets", reason="the live view is not installed: heelstrike[watch]")
pytest.importorskip("playwright", reason="playwright, which drives the browser, is missing")

# 8-bit red, green, blue of what is drawn.
RIGHT_LEG, LEFT_LEG, TRUNK = (0, 114, 178), (213, 94, 0), (34, 34, 34)
FORCE, CENTER, PRESSURE, PUSH = (0, 120, 90), (230, 159, 0), (169, 68, 127), (176, 0, 32)


@pytest.fixture(scope="module")
def chromium() -> Iterator[Any]:
    with browser() as started:
        yield started


@pytest.fixture(scope="module")
def gait(tmp_path_factory: pytest.TempPathFactory) -> Path:
    walking.walk(steps=1)  # compiled, before anybody waits for it
    path = tmp_path_factory.mktemp("gait") / "gait.json"
    walking.gait().save(path)
    return path


@pytest.fixture
def viewer(gait: Path) -> Iterator[Viewer]:
    """A live walk of bravo7 with all controls."""
    with view(stage=WalkStage("bravo7", method_called, METHODS, First(gait=gait))) as viewer:
        yield viewer


class Page:
    """A page in the browser, and all that went wrong on it."""

    def __init__(self, chromium: Any, viewer: Viewer, **options: Any) -> None:
        self.page = chromium.new_page(viewport={"width": 1280, "height": 800}, **options)
        self.wrong: list[str] = []
        self.asked: set[str] = set()
        self.page.on("console", self._heard)
        self.page.on("pageerror", lambda error: self.wrong.append(str(error)))
        self.page.on("request", lambda request: self.asked.add(request.url))
        self.page.goto(viewer.url)
        wait_until(lambda: self.time > 0.0, "the first picture")

    def _heard(self, message: Any) -> None:
        if message.type in ("error", "warning"):
            self.wrong.append(message.text)

    def __enter__(self) -> Page:
        return self

    def __exit__(self, kind: Any, *_: Any) -> None:
        self.page.close()
        if kind is None:
            assert self.wrong == []

    def data(self, name: str) -> float:
        told = self.page.evaluate(f"document.getElementById('plane').dataset.{name} || 0")
        return float(told)

    @property
    def time(self) -> float:
        return self.data("time")

    def text(self, name: str) -> str:
        return str(self.page.locator(f"#{name}").inner_text())

    def picture(self) -> np.ndarray:
        with Image.open(io.BytesIO(self.page.locator("#plane").screenshot())) as picture:
            return np.asarray(picture.convert("RGB")).astype(int)

    def where(self, color: tuple[int, int, int]) -> np.ndarray:
        """Rows and columns of the pixels of a colour, (n, 2)."""
        return np.argwhere(np.abs(self.picture() - color).max(axis=-1) < 16)

    def halt(self) -> float:
        """Pause; return the time at which it stands."""
        self.page.click("#play")
        wait_until(lambda: "play" in self.text("play"), "the pause")
        return self.settled()

    def settled(self) -> float:
        """Wait until the picture shows the same time twice."""
        seen = [self.time]

        def stands() -> bool:
            self.page.wait_for_timeout(60)
            seen.append(self.time)
            return seen[-1] == seen[-2]

        wait_until(stands, "a picture that stands still")
        return seen[-1]


def test_the_robot_moves(chromium: Any, viewer: Viewer) -> None:
    with Page(chromium, viewer) as seen:
        before, now = seen.picture(), seen.time
        wait_until(lambda: seen.time > now + 0.1, "the robot to move")
        assert np.abs(seen.picture() - before).max(axis=-1).mean() > 1.0
        seen.halt()
        for color in (RIGHT_LEG, LEFT_LEG, TRUNK, FORCE, CENTER, PRESSURE):
            assert len(seen.where(color)) > 5, color  # marks may lie on each other
        # The head is above the hip, and the forces come from the ground.
        trunk, forces = seen.where(TRUNK)[:, 0], seen.where(FORCE)[:, 0]
        assert trunk.min() < 0.5 * seen.picture().shape[0] < forces.max()
        assert "certified" in seen.text("light")
        assert seen.asked == {viewer.url}  # and the socket, which is no request


def test_a_drag_pushes(chromium: Any, viewer: Viewer) -> None:
    with Page(chromium, viewer) as seen:
        wait_until(lambda: seen.time > 0.2, "a walk")
        seen.halt()
        rows, columns = seen.where(TRUNK).T
        box = seen.page.locator("#plane").bounding_box()
        # The upper part of the trunk, below the head.
        row = int(rows.min() + 0.45 * (rows.max() - rows.min()))
        x, y = box["x"] + columns[rows == row].mean(), box["y"] + row
        seen.page.click("#play")
        seen.page.mouse.move(x, y)
        seen.page.mouse.down()
        seen.page.mouse.move(x + 15, y, steps=3)
        wait_until(lambda: seen.data("pushed") > 10.0, "the push")
        seen.page.mouse.up()
        wait_until(lambda: seen.data("pushed") == 0.0, "the end of the push")
        pushes = viewer._session.live.pushes
        trunk, _ = hs.Push("trunk", force=(1.0, 0.0), start=0.0, duration=0.0).place(
            walking.bravo7()
        )
        assert {push.link for push in pushes} == {trunk}
        assert max(push.force[0] for push in pushes) > 10.0
        seen.halt()
        seen.page.evaluate("document.getElementById('time').focus()")
        # The arrow is there when the time of the push is looked at again.
        viewer._session.ask("test", {"do": "seek", "time": pushes[-1].end})
        wait_until(lambda: seen.data("pushed") > 0.0, "the push as it was")
        assert len(seen.where(PUSH)) > 10


def test_sliders_and_choices_act(chromium: Any, viewer: Viewer) -> None:
    session = viewer._session
    with Page(chromium, viewer) as seen:
        seen.page.locator("input[name=friction]").focus()
        seen.page.keyboard.press("ArrowLeft")
        wait_until(lambda: session.values["friction"] == 0.74, "less friction")
        assert session.live.simulation.ground.friction == 0.74
        assert seen.time > 0.0  # it did not begin anew
        seen.page.select_option("#rate", "0.25")
        wait_until(lambda: session.rate == 0.25, "slow motion")
        seen.page.select_option("select[name=step]", "2 ms")
        wait_until(lambda: session.live.simulation.method.step_length == 2e-3, "longer steps")
        seen.page.locator("input[name=slope]").focus()
        seen.page.keyboard.press("ArrowRight")
        wait_until(lambda: session.values["slope"] == 0.5, "a slope")
        assert session.live.simulation.ground.slope == pytest.approx(np.deg2rad(0.5))
        assert session.live.simulation.ground.friction == 0.74
        seen.page.select_option("select[name=controller]", "no torque")
        wait_until(lambda: session.live.simulation.controller is None, "no controller")
        seen.page.select_option("#rate", "2")
        wait_until(lambda: "fell" in seen.text("banner"), "the fall")
        seen.page.click("#reset")
        wait_until(lambda: not session.live.message.startswith("the robot fell"), "a new begin")


def test_scrub_step_back_and_jump(chromium: Any, viewer: Viewer) -> None:
    with Page(chromium, viewer) as seen:
        wait_until(lambda: seen.time > 1.0, "a walk")
        end = seen.halt()
        seen.page.click("#back")
        wait_until(lambda: seen.time == pytest.approx(end - 1e-3), "a step back")
        seen.page.click("#forth")
        wait_until(lambda: seen.time == pytest.approx(end), "a step forth")
        seen.page.click("#forth")
        wait_until(lambda: seen.time == pytest.approx(end + 1e-3), "a new step")
        strip = seen.page.locator("#time").bounding_box()
        seen.page.mouse.click(strip["x"] + 0.3 * strip["width"], strip["y"] + 8)
        wait_until(lambda: abs(seen.time - 0.3 * end) < 0.05 * end, "the place on the strip")
        seen.page.select_option("#kinds", "touchdown")
        seen.page.click("#event-after")
        wait_until(lambda: seen.time == pytest.approx(0.7), "the first touchdown")
        seen.page.click("#resume")
        wait_until(lambda: seen.time > 0.75, "that it goes on from there")
        seen.page.locator("#plane").focus()
        seen.page.keyboard.press("Space")
        wait_until(lambda: "play" in seen.text("play"), "a pause by the keyboard")
        now = seen.settled()
        seen.page.keyboard.press("ArrowLeft")
        wait_until(lambda: seen.time == pytest.approx(now - 1e-3), "a step back by the keyboard")


def test_curves_follow(chromium: Any, viewer: Viewer) -> None:
    with Page(chromium, viewer) as seen:
        wait_until(lambda: seen.time > 0.4, "a walk")
        seen.halt()
        shown = []
        for group in ("joints", "torques", "feet", "energy"):
            seen.page.click(f"text={group}")
            seen.page.wait_for_timeout(200)
            shown.append(seen.page.locator("#curves").screenshot())
        assert len(set(shown)) == 4
        curve = seen.page.locator("#curves canvas").first.bounding_box()
        before = seen.time
        seen.page.mouse.click(curve["x"] + 80, curve["y"] + 60)
        wait_until(lambda: seen.time < before, "the time that was clicked at")


def test_two_at_once_close_and_come_again(chromium: Any, viewer: Viewer) -> None:
    with Page(chromium, viewer) as one:
        with Page(chromium, viewer) as other:
            wait_until(lambda: other.time > 0.1, "both to see it")
            other.page.click("#play")
            wait_until(lambda: "play" in one.text("play"), "the pause to be seen by both")
            assert one.settled() == other.settled()
            assert np.abs(one.picture() - other.picture()).max() < 64
        now = one.time
    with Page(chromium, viewer) as again:
        assert again.settled() == now
        again.page.click("#play")
        wait_until(lambda: again.time > now, "that it goes on")


def test_it_says_so_when_the_server_stops(chromium: Any, viewer: Viewer) -> None:
    with Page(chromium, viewer) as seen:
        viewer.close()
        wait_until(lambda: "connection has ended" in seen.text("banner"), "the end")
        assert seen.page.locator("#play").is_disabled()


def test_a_run_is_looked_at(chromium: Any) -> None:
    with view(run=walking.walk(steps=2)) as viewer, Page(chromium, viewer) as seen:
        wait_until(lambda: seen.time > 0.1, "the run to play")
        for name in ("controls", "random", "reset", "resume"):
            assert seen.page.locator(f"#{name}").is_hidden()
        box = seen.page.locator("#plane").bounding_box()
        assert box["width"] > 400.0
        seen.halt()
        assert len(seen.where(RIGHT_LEG)) > 20


FOREIGN = """<!DOCTYPE html><script>
async function tries() {
  const found = [];
  await fetch("PAGE").then((answer) => found.push(answer.status), () => found.push("refused"));
  await new Promise((done) => {
    const socket = new WebSocket("SOCKET");
    socket.onopen = () => found.push("open");
    socket.onmessage = () => found.push("told");
    socket.onclose = () => { found.push("closed"); done(); };
  });
  return found;
}
</script>"""


def test_a_page_of_another_origin_gets_nothing(chromium: Any, viewer: Viewer) -> None:
    """Even one that knows the address with its token."""
    socket = viewer.url.replace("http:", "ws:").replace("/?", "/live?")
    text = FOREIGN.replace("PAGE", viewer.url).replace("SOCKET", socket).encode()

    class Foreign(http.server.BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            self.send_response(200)
            self.send_header("Content-Type", "text/html")
            self.end_headers()
            self.wfile.write(text)

        def log_message(self, *_: Any) -> None:
            pass

    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Foreign)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    page = chromium.new_page()
    try:
        page.goto(f"http://127.0.0.1:{server.server_address[1]}/")
        assert page.evaluate("tries()") == ["refused", "closed"]
    finally:
        page.close()
        server.shutdown()
        server.server_close()
