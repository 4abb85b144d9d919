"""The server behind a live view: one page and one socket, on this machine only."""

from __future__ import annotations

import asyncio
import json
import logging
import threading
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from http import HTTPStatus
from typing import TYPE_CHECKING, Any

from heelstrike.errors import ViewError
from heelstrike.view.live.board import Board, Message
from heelstrike.view.live.gate import PAGE, Gate

if TYPE_CHECKING:
    from websockets.asyncio.server import ServerConnection
    from websockets.http11 import Request, Response

ADDRESS = "127.0.0.1"
MOST_VIEWERS = 16
LONGEST_MESSAGE = 2**16
"""Bytes of a message from a viewer."""
MOST_WAITING = 5000
"""Messages that may wait for a viewer; one that is slower is sent away."""
CLOSES_WITHIN = 0.3
"""Seconds that viewers are given to say goodbye."""

MISSING = (
    "the live view needs the package websockets, which is not installed: "
    "pip install 'heelstrike[watch]'"
)


def check_installed() -> None:
    """Refuse to begin without the package that serves.

    Raises
    ------
    ViewError
        That says how to install it.
    """
    try:
        import websockets.asyncio.server  # noqa: F401
    except ImportError:
        raise ViewError(MISSING) from None


class Server:
    """Serves a page and tells its viewers what is on a board.

    Parameters
    ----------
    board : Board
        What viewers see.
    obey : callable
        Is given a viewer's name and its command.
    page : str
        The page, HTML.
    port : int
        Where to listen; 0 for any free port.

    Attributes
    ----------
    listens_at : list of (str, int)
        Addresses and ports.
    """

    def __init__(
        self,
        board: Board,
        obey: Callable[[str, dict[str, Any]], None],
        page: str,
        *,
        port: int = 0,
    ) -> None:
        self._board, self._obey, self._page = board, obey, page
        self._gate = Gate()
        self.port = port
        self.listens_at: list[tuple[str, int]] = []
        self._viewers = 0
        self._begun = threading.Event()
        self._trouble: OSError | None = None
        self._loop = asyncio.new_event_loop()
        self._over = asyncio.Event()
        self._thread = threading.Thread(target=self._go, name="heelstrike-serve", daemon=True)

    @property
    def url(self) -> str:
        """Address of the page, with the token that lets in."""
        return f"http://{ADDRESS}:{self.port}{PAGE}?token={self._gate.token}"

    def start(self) -> None:
        """Begin to listen.

        Raises
        ------
        ViewError
            If the port cannot be had.
        """
        self._thread.start()
        self._begun.wait()
        if self._trouble is not None:
            raise ViewError(
                f"port {self.port} of {ADDRESS} cannot be had "
                f"({self._trouble.strerror or self._trouble}); choose another, or leave the port "
                "out and a free one is taken"
            ) from self._trouble

    def close(self) -> None:
        """Send all viewers away and listen no longer."""
        if self._thread.is_alive():
            self._loop.call_soon_threadsafe(self._over.set)
            self._thread.join(2.0 * CLOSES_WITHIN)

    def _go(self) -> None:
        asyncio.set_event_loop(self._loop)
        try:
            self._loop.run_until_complete(self._serve())
        except OSError as error:
            self._trouble = error
        finally:
            self._begun.set()
            self._loop.close()

    async def _serve(self) -> None:
        from websockets.asyncio.server import serve

        quiet = logging.getLogger("heelstrike.view.live")
        quiet.addHandler(logging.NullHandler())
        quiet.propagate = False
        async with serve(
            self._attend, ADDRESS, self.port, process_request=self._answer,
            max_size=LONGEST_MESSAGE, compression=None, close_timeout=CLOSES_WITHIN,
            server_header=None, logger=quiet,
        ) as server:  # fmt: skip
            self.listens_at = [each.getsockname() for each in server.sockets]
            self.port = self.listens_at[0][1]
            self._begun.set()
            await self._over.wait()

    def _answer(self, connection: ServerConnection, request: Request) -> Response | None:
        """Answer a request that is not one for the socket, or that may not come in."""

        def header(name: str) -> str | None:
            several = request.headers.get_all(name)
            return several[0] if len(several) == 1 else None if not several else ""

        path = self._gate.admits(request.path, header, self.port)
        if path is None:
            return connection.respond(HTTPStatus.FORBIDDEN, "")
        if path != PAGE:
            if self._viewers < MOST_VIEWERS:
                return None
            return connection.respond(HTTPStatus.SERVICE_UNAVAILABLE, "")
        response = connection.respond(HTTPStatus.OK, self._page)
        del response.headers["Content-Type"]  # of plain text
        for name, value in {
            "Content-Type": "text/html; charset=utf-8",
            "Cache-Control": "no-store",
            "Referrer-Policy": "no-referrer",
            "X-Content-Type-Options": "nosniff",
            "Cross-Origin-Resource-Policy": "same-origin",
        }.items():
            response.headers[name] = value
        return response

    async def _attend(self, connection: ServerConnection) -> None:
        """Tell a viewer what is on the board, and pass on what it asks for."""
        from websockets.exceptions import ConnectionClosed

        waiting: deque[Message] = deque()
        there = asyncio.Event()

        def put(message: Message) -> None:
            waiting.append(message)
            there.set()

        def listener(message: Message) -> None:
            with suppress(RuntimeError):  # the server has just ended
                self._loop.call_soon_threadsafe(put, message)

        async def tell() -> None:
            with suppress(ConnectionClosed):
                while True:
                    await there.wait()
                    there.clear()
                    if len(waiting) > MOST_WAITING:
                        await connection.close(1013, "too slow")
                        return
                    while waiting:
                        await connection.send(waiting.popleft())

        name = connection.id.hex
        self._viewers += 1
        self._board.join(listener)
        teller = asyncio.create_task(tell())
        try:
            self._obey(name, {"do": "nothing"})
            with suppress(ConnectionClosed):
                async for message in connection:
                    command = _command(message)
                    if command is not None:
                        self._obey(name, command)
        finally:
            self._viewers -= 1
            self._board.leave(listener)
            teller.cancel()
            self._obey(name, {"do": "leave"})


def _command(message: str | bytes) -> dict[str, Any] | None:
    """Read a command; None if it is none."""
    try:
        command = json.loads(message)
    except (ValueError, RecursionError):
        return None
    return command if isinstance(command, dict) and isinstance(command.get("do"), str) else None
