"""Who may come in: whoever knows the token, by the name of this machine, from our own page.

A page that a browser has open can send requests to any address of the machine it runs on, and make
its own name lead there. What it cannot do is forge the ``Host`` and ``Origin`` that the browser
adds, or know a token that it was not told.
"""

from __future__ import annotations

import secrets
from collections.abc import Callable
from urllib.parse import parse_qs, urlsplit

Header = Callable[[str], str | None]

PAGE, SOCKET = "/", "/live"
NAMES = ("127.0.0.1", "localhost")
"""By which a browser on this machine calls it, one that comes through a tunnel of ssh too."""


class Gate:
    """What a request has to show.

    Attributes
    ----------
    token : str
        256 random bits that every request carries.
    """

    def __init__(self) -> None:
        self.token = secrets.token_urlsafe(32)

    def admits(self, target: str, header: Header, port: int) -> str | None:
        """Return which path may be entered; None if none.

        Parameters
        ----------
        target : str
            Path and query of the request.
        header : callable
            Returns a header of the request by its name; None where it is not there once.
        port : int
            Where the server listens.
        """
        host = header("Host")
        if host not in [f"{name}:{port}" for name in NAMES]:
            return None
        try:
            parts = urlsplit(target)
        except ValueError:  # no address at all
            return None
        given = parse_qs(parts.query).get("token", [""])
        if len(given) != 1 or not secrets.compare_digest(given[0].encode(), self.token.encode()):
            return None
        origin = header("Origin")
        # Browsers always say where the script comes from that opens a socket.
        if parts.path == SOCKET and origin == f"http://{host}":
            return SOCKET
        if parts.path == PAGE and origin in (None, f"http://{host}"):
            return PAGE
        return None
