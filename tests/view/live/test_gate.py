"""Who is let in to a live view."""

from __future__ import annotations

import pytest

from heelstrike.view.live.gate import Gate

PORT = 8123
HOST = f"127.0.0.1:{PORT}"
ORIGIN = f"http://{HOST}"


def admitted(target: str, **headers: str | None) -> str | None:
    """Path that a request may enter, with the headers of a browser on our page but for some."""
    sent = {"Host": HOST, "Origin": ORIGIN} | headers
    return GATE.admits(target.replace("TOKEN", GATE.token), sent.get, PORT)


GATE = Gate()


def test_a_browser_that_was_told_the_token_comes_in() -> None:
    assert admitted("/?token=TOKEN", Origin=None) == "/"
    assert admitted("/live?token=TOKEN") == "/live"
    tunnel = f"localhost:{PORT}"
    assert admitted("/live?token=TOKEN", Host=tunnel, Origin=f"http://{tunnel}") == "/live"


@pytest.mark.parametrize("path", ["/", "/live"])
@pytest.mark.parametrize(
    "query",
    [
        "",
        "?token=",
        "?token=TOKENx",
        "?token=TOKEN&token=TOKEN",
        "?token=%ff",
        "?Token=TOKEN",
        "#token=TOKEN",
    ],
)
def test_without_the_token_nothing(path: str, query: str) -> None:
    assert admitted(path + query) is None


@pytest.mark.parametrize("path", ["/", "/live"])
@pytest.mark.parametrize(
    "host",
    [
        None,
        "",
        "127.0.0.1",
        "127.0.0.1:8124",
        f"evil.example:{PORT}",
        f"127.0.0.1.evil.example:{PORT}",
        f"127.0.0.1:{PORT}, evil.example",
        f"0.0.0.0:{PORT}",
    ],
)
def test_by_another_name_nothing(path: str, host: str | None) -> None:
    """A name that its owner lets lead to this machine, as DNS rebinding does."""
    assert admitted(f"{path}?token=TOKEN", Host=host) is None
    assert admitted(f"{path}?token=TOKEN", Host=host, Origin=f"http://{host}") is None


@pytest.mark.parametrize("path", ["/", "/live"])
@pytest.mark.parametrize(
    "origin",
    ["null", "", "http://evil.example", "http://127.0.0.1", "http://127.0.0.1:8124",
     f"https://{HOST}", f"http://localhost:{PORT}", f"{ORIGIN}/"],
)  # fmt: skip
def test_from_a_page_of_another_origin_nothing(path: str, origin: str) -> None:
    assert admitted(f"{path}?token=TOKEN", Origin=origin) is None


def test_a_socket_without_an_origin_is_no_browser_of_ours() -> None:
    assert admitted("/live?token=TOKEN", Origin=None) is None


@pytest.mark.parametrize(
    "path", ["//live", "//[", "http://[/live", "/live/", "/../live", "/favicon.ico", "", "/LIVE"]
)
def test_there_are_no_other_paths(path: str) -> None:
    assert admitted(f"{path}?token=TOKEN") is None


def test_tokens_differ_and_are_long() -> None:
    other = Gate().token
    assert other != GATE.token
    assert len(other) >= 43  # 256 bits in base64
