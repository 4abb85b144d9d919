"""The server of a live view, over real sockets of this machine."""

from __future__ import annotations

import http.client
import json
import socket
import threading
import time
from collections.abc import Iterator
from typing import Any
from urllib.parse import urlsplit

import numpy as np
import pytest
import walking

import heelstrike as hs
from heelstrike.view import ViewError
from heelstrike.view.live import server as served
from heelstrike.view.live.viewer import view

pytest.importorskip("websockets", reason="the live view is not installed: heelstrike[watch]")
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import ClientConnection, connect

PATIENCE = 60.0  # seconds, for a machine under load


@pytest.fixture
def viewer() -> Iterator[hs.view.live.Viewer]:
    with view(run=walking.walk(steps=1)) as viewer:
        yield viewer


def get(viewer: Any, path: str, **headers: str) -> tuple[int, bytes, dict[str, str]]:
    """Ask as a browser does that a page, or a person, told to."""
    asked = http.client.HTTPConnection("127.0.0.1", viewer.port, timeout=PATIENCE)
    asked.request("GET", path, headers=headers)
    answer = asked.getresponse()
    return answer.status, answer.read(), dict(answer.getheaders())


def query(viewer: Any) -> str:
    return urlsplit(viewer.url).query


def entered(viewer: Any, *, origin: str | None = "", token: str = "") -> ClientConnection:
    """Open the socket as the page does, but for what is given."""
    address = f"127.0.0.1:{viewer.port}"
    return connect(
        f"ws://{address}/live?{token or query(viewer)}",
        origin=f"http://{address}" if origin == "" else origin,
        max_size=None,
        open_timeout=PATIENCE,
    )


def told(connection: ClientConnection, kind: str) -> Any:
    """Wait for the next message of a kind."""
    while True:
        message = connection.recv(timeout=PATIENCE)
        if isinstance(message, bytes):
            if kind == "frames":
                return np.frombuffer(message)
        elif json.loads(message)["kind"] == kind:
            return json.loads(message)


def test_the_page_asks_for_nothing_but_its_own_socket(viewer: Any) -> None:
    status, page, headers = get(viewer, f"/?{query(viewer)}")
    assert status == 200
    text = page.decode()
    assert "connect-src 'self'" in text
    assert "default-src 'none'" in text
    assert "unsafe" not in text.partition("</head>")[0]
    assert "http://" not in text
    assert "https://" not in text
    assert headers["Content-Type"] == "text/html; charset=utf-8"
    assert headers["Cache-Control"] == "no-store"
    assert headers["Referrer-Policy"] == "no-referrer"
    assert "Access-Control-Allow-Origin" not in headers
    assert query(viewer).partition("=")[2] not in text


def test_who_may_not_come_in_gets_nothing(viewer: Any) -> None:
    good = f"/?{query(viewer)}"
    for path, headers in (
        ("/", {}),
        ("/?token=guess", {}),
        ("/live", {}),
        (good, {"Host": f"evil.example:{viewer.port}"}),
        (good, {"Origin": "http://evil.example"}),
        ("/other" + good[1:], {}),
    ):
        status, body, _ = get(viewer, path, **headers)
        assert (status, body) == (403, b""), (path, headers)
    for wrong in ({"token": "token=guess"}, {"origin": "http://evil.example"}, {"origin": None}):
        with pytest.raises(InvalidStatus, match="403"):
            entered(viewer, **wrong)


def test_it_listens_on_this_machine_only(viewer: Any) -> None:
    assert viewer._server.listens_at == [("127.0.0.1", viewer.port)]


def test_a_viewer_is_told_everything_and_obeyed(viewer: Any) -> None:
    run = walking.walk(steps=1)
    with entered(viewer) as one:
        scene = told(one, "scene")
        assert scene["scene"]["robot"] == "bravo7"
        width = scene["layout"]["width"]
        frames = told(one, "frames")[1:].reshape(-1, width)
        assert frames[0, 0] == 0.0
        assert frames[-1, 0] == run.time[-1]
        one.send("no JSON")
        one.send(b"\x00")
        one.send("[1]")
        one.send(json.dumps({"do": "seek", "time": 0.25}))
        with entered(viewer) as other:  # who sees the same
            told(other, "scene")
            for each in (one, other):
                while told(each, "frames")[1] != pytest.approx(0.25):
                    pass
            other.send(json.dumps({"do": "rate", "value": 0.5}))
            while told(one, "state").get("rate") != 0.5:
                pass
    # Close and come again: it is as it was left.
    with entered(viewer) as again:
        told(again, "scene")
        told(again, "frames")
        assert told(again, "frames")[1] == pytest.approx(0.25)


def test_long_messages_and_crowds_are_sent_away(
    viewer: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    with entered(viewer) as one:
        one.send("x" * (2 * served.LONGEST_MESSAGE))
        with pytest.raises(ConnectionClosed):
            told(one, "nothing")
    monkeypatch.setattr(served, "MOST_VIEWERS", 1)
    with entered(viewer), pytest.raises(InvalidStatus, match="503"):
        entered(viewer)


def assert_no_thread_is_left() -> None:
    """Of ours: what others run here, such as an executor's workers, come and go as they like."""
    end = time.monotonic() + PATIENCE
    while ours := [one.name for one in threading.enumerate() if one.name.startswith("heelstrike")]:
        assert time.monotonic() < end, ours
        time.sleep(0.02)


def test_closing_ends_it() -> None:
    viewer = view(run=walking.walk(steps=1))
    with entered(viewer) as one:
        viewer.close()
        viewer.close()
        assert viewer.closed
        assert "closed" in repr(viewer)
        with pytest.raises(ConnectionClosed):
            told(one, "nothing")
        with pytest.raises(OSError, match=r"refused|actively"):
            socket.create_connection(("127.0.0.1", viewer.port), timeout=PATIENCE)
    assert_no_thread_is_left()


def test_a_port_that_is_taken() -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        with pytest.raises(ViewError, match=f"port {port} of 127.0.0.1 cannot be had"):
            view(run=walking.walk(steps=1), port=port)


def test_a_port_of_choice() -> None:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    with view(run=walking.walk(steps=1), port=port) as viewer:
        assert viewer.port == port
        assert f"127.0.0.1:{port}/" in viewer.url


def test_what_cannot_be_served_is_not_silent(monkeypatch: pytest.MonkeyPatch) -> None:
    """Such as by a package that is older or newer than all that was tried."""
    monkeypatch.setattr("websockets.asyncio.server.serve", lambda *_, **__: 1 / 0)
    with pytest.raises(ViewError, match=r"cannot be served: ZeroDivisionError.*websockets"):
        view(run=walking.walk(steps=1))
    assert_no_thread_is_left()
