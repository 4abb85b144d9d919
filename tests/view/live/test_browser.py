"""The live view in a browser: what a person sees, and does with mouse and keys."""

from __future__ import annotations

import http.server
import threading
from typing import Any

import numpy as np
import pytest
import walking
from browsers import wait_until
from live_page import CENTER, FORCE, LEFT_LEG, PRESSURE, PUSH, RIGHT_LEG, TRUNK, Page

import heelstrike as hs
from heelstrike.view.live.viewer import Viewer, view

pytest.importorskip("websockets", reason="the live view is not installed: heelstrike[watch]")
pytest.importorskip("playwright", reason="playwright, which drives the browser, is missing")


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
        assert seen.time > 0.0  # it did not start again
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


@pytest.mark.slow
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
        for name in ("strip", "curves"):
            box = seen.page.locator(f"#{name}").bounding_box()
            y = box["y"] + 30
            seen.page.mouse.move(box["x"] + 0.4 * box["width"], y)
            seen.page.mouse.down()
            times = []
            for share in (0.35, 0.3, 0.25):
                seen.page.mouse.move(box["x"] + share * box["width"], y)
                times.append(seen.settled())
            seen.page.mouse.up()
            assert times[0] > times[1] > times[2] > 0.0, name
        strip = seen.page.locator("#strip").bounding_box()
        seen.page.mouse.click(strip["x"] + 0.3 * strip["width"], strip["y"] + 8)
        wait_until(lambda: abs(seen.time - 0.3 * end) < 0.05 * end, "the place on the strip")
        session = viewer._session
        wait_until(lambda: abs(session.cursor - seen.time) < 2e-3, "that of the server, too")
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


@pytest.mark.slow
def test_curves_follow(chromium: Any, viewer: Viewer) -> None:
    with Page(chromium, viewer) as seen:
        wait_until(lambda: seen.time > 0.4, "a walk")
        seen.halt()
        shown = []
        for group in ("joints", "torques", "feet", "energy"):
            seen.page.click(f"#groups >> text={group}")
            seen.page.wait_for_timeout(200)
            shown.append(seen.page.locator("#curves").screenshot())
        assert len(set(shown)) == 4
        curve = seen.page.locator("#curves canvas").first.bounding_box()
        before = seen.time
        seen.page.mouse.click(curve["x"] + 80, curve["y"] + 60)
        wait_until(lambda: seen.time < before, "the time that was clicked at")


@pytest.mark.slow
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


@pytest.mark.slow
def test_a_page_that_stays_open_forgets_the_oldest_frames(chromium: Any, viewer: Viewer) -> None:
    with Page(chromium, viewer) as seen:
        seen.halt()
        board = viewer._session._board
        last = board._frames[-1]
        for _ in range(3):
            more = np.repeat(last[None], 15_000, axis=0)
            more[:, 0] = last[0] + 0.01 * np.arange(1, 15_001)
            last = more[-1]
            board.add(more)
        wait_until(lambda: seen.time == last[0], "the last of many frames")
        assert 15_000 <= seen.data("frames") <= 40_000


def test_a_run_is_looked_at(chromium: Any) -> None:
    with view(run=walking.walk(steps=2)) as viewer, Page(chromium, viewer) as seen:
        wait_until(lambda: seen.time > 0.1, "the run to play")
        for name in ("controls", "random", "reset", "resume"):
            assert seen.page.locator(f"#{name}").is_hidden()
        box = seen.page.locator("#plane").bounding_box()
        assert box["width"] > 400.0
        seen.halt()
        assert len(seen.where(RIGHT_LEG)) > 20


def test_joints_are_moved_when_halted(chromium: Any, viewer: Viewer) -> None:
    session = viewer._session
    with Page(chromium, viewer) as seen:
        knee = seen.page.locator("input[name=left_knee]")
        assert knee.is_disabled()
        seen.halt()
        wait_until(knee.is_enabled, "sliders that can be moved")
        before = seen.picture()
        knee.focus()
        seen.page.keyboard.press("End")
        farthest = walking.bravo7().model.upper[walking.bravo7().joint_index("left_knee")]

        def position() -> float:
            return float(walking.bravo7().positions(session.live.simulation.state)["left_knee"])

        wait_until(lambda: position() == pytest.approx(farthest, abs=0.01), "a bent knee")
        wait_until(lambda: np.abs(seen.picture() - before).max() > 100, "its picture")
        wait_until(lambda: "2.2" in knee.locator("xpath=../b").inner_text(), "its number")
        now = seen.time
        seen.page.click("#play")
        wait_until(lambda: seen.time > now, "that it goes on")
        wait_until(knee.is_disabled, "sliders that follow")


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
