"""watch(): look at a simulation while it runs, or at a run, in a browser."""

from __future__ import annotations

import html
import os
import sys
import tempfile
import threading
import webbrowser
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Protocol

from heelstrike.errors import ViewError
from heelstrike.sim.run import Run
from heelstrike.sim.simulation import Simulation
from heelstrike.view.live.board import Board
from heelstrike.view.live.page import live_page
from heelstrike.view.live.server import Server, check_installed
from heelstrike.view.live.session import RATES, Session
from heelstrike.view.live.stage import GivenStage, Stage

if TYPE_CHECKING:
    from heelstrike.sim.run import AnyRun
    from heelstrike.sim.spatial.run import SpatialRun
    from heelstrike.sim.spatial.simulation import SpatialSimulation

LOOK_EVERY = 0.1
"""Seconds between two looks whether Ctrl-C has come, which Windows keeps from what waits."""
JOINS_WITHIN = 0.25
"""Seconds that the simulation is given to end; the design of a gait cannot be broken off."""
HEIGHT = 640
"""Pixels of the view in a notebook."""


class Watched(Protocol):
    """What is watched."""

    def start(self) -> None:
        """Begin."""

    def close(self) -> None:
        """End, soon."""

    def join(self, timeout: float) -> None:
        """Wait until it has ended, at most so long (s)."""


class Viewer:
    """A live view in the browser, until it is closed.

    Made by :func:`heelstrike.watch`. In a notebook it shows itself as the result of a cell; as a
    context manager it closes at the end of the block.

    Parameters
    ----------
    session : Session or Display
        What is watched.
    server : Server
        Who serves it.

    Attributes
    ----------
    url : str
        Address of the page. It holds the token that lets in: whoever has it can watch and push.
    port : int
        Where the server listens, on 127.0.0.1.
    """

    def __init__(self, session: Watched, server: Server) -> None:
        self._session, self._server = session, server
        self._closed = threading.Event()
        self._way: tempfile.TemporaryDirectory[str] | None = None
        server.start()
        session.start()
        self.url, self.port = server.url, server.port

    def __repr__(self) -> str:
        return f"Viewer({'closed' if self._closed.is_set() else self.url})"

    def __enter__(self) -> Viewer:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def _repr_html_(self) -> str:
        return (
            f'<iframe src="{html.escape(self.url)}" title="heelstrike" '
            f'style="width: 100%; height: {HEIGHT}px; border: 0"></iframe>'
        )

    @property
    def closed(self) -> bool:
        """Whether it has been closed."""
        return self._closed.is_set()

    def open(self) -> bool:
        """Open the page in this machine's browser; return whether there is one.

        The browser is given a file that leads to the page and that nobody else can read: arguments
        of a program are seen by all users of a machine, and the address holds the token.
        """
        if self._way is None:
            self._way = tempfile.TemporaryDirectory(prefix="heelstrike-")
        way = Path(self._way.name) / "watch.html"
        target = html.escape(self.url)
        way.write_text(
            '<!DOCTYPE html><meta charset="utf-8"><meta name="referrer" content="no-referrer">'
            f'<meta http-equiv="refresh" content="0;url={target}">'
            f'<a href="{target}">heelstrike</a>',
            encoding="utf-8",
        )
        with suppress(webbrowser.Error):
            return not _in_terminal() and webbrowser.open(way.as_uri())
        return False

    def wait(self) -> None:
        """Wait until it is closed; Ctrl-C closes it and goes on as ``KeyboardInterrupt``."""
        try:
            while not self._closed.wait(LOOK_EVERY):
                pass
        finally:
            self.close()

    def close(self) -> None:
        """End the view: the simulation stays where it is, pages say that the connection ended."""
        if self._closed.is_set():
            return
        self._closed.set()
        self._session.close()
        self._server.close()
        self._session.join(JOINS_WITHIN)
        if self._way is not None:
            self._way.cleanup()


def watch(
    what: Run | Simulation | SpatialRun | SpatialSimulation,
    *,
    rate: float = 1.0,
    port: int = 0,
    browser: bool | None = None,
    block: bool | None = None,
) -> Viewer:
    """Look at a simulation while it goes on, or at a run, in a browser.

    A simulation goes on as long as somebody looks: it can be halted, stepped, taken back, pushed
    with the mouse. The view has it to itself until it is closed, and begins its record again again
    and again. An error in its controller ends it with a warning. The server listens on 127.0.0.1
    only, and lets in who has the token in the address.

    Parameters
    ----------
    what : Run, Simulation, SpatialRun or SpatialSimulation
        What is shown.
    rate : float
        Simulated seconds a second, at first.
    port : int
        Where to listen; by default any free port.
    browser : bool, optional
        Whether to open a browser; by default unless in a notebook, which shows the view itself.
    block : bool, optional
        Whether to wait until Ctrl-C; by default in a script, and not in a notebook or at a prompt.

    Returns
    -------
    Viewer
        The view, to be closed; closed already if this waited.

    Raises
    ------
    ViewError
        If the package that serves is not installed, the port cannot be had, the run is empty, or an
        argument is of another kind.

    Examples
    --------
    >>> import heelstrike as hs
    >>> robot = hs.load_robot("compass_gait")
    >>> simulation = hs.Simulation(robot, state=robot.reference_state())
    >>> viewer = hs.watch(simulation)  # doctest: +SKIP
    """
    runs, simulations = _of_dimension(what)
    if isinstance(what, runs):
        if not len(what.time):
            raise ViewError(f"there is nothing to watch: the run has no rows ({what.message})")
        viewer = view(run=what, rate=rate, port=port)
    elif isinstance(what, simulations):
        viewer = view(stage=GivenStage(what), rate=rate, port=port)
    else:
        raise ViewError(f"watch takes a Run or a Simulation, got {type(what).__name__}")
    notebook = _in_notebook()
    if browser or (browser is None and not notebook):
        viewer.open()
    if block or (block is None and not (notebook or _at_prompt())):
        print(f"watching at {viewer.url}\nCtrl-C ends it", file=sys.stderr, flush=True)
        with suppress(KeyboardInterrupt):
            viewer.wait()
    return viewer


def view(
    *, stage: Stage | None = None, run: AnyRun | None = None, rate: float = 1.0, port: int = 0
) -> Viewer:
    """Begin to serve what a stage makes, or a run, without opening anything.

    Raises
    ------
    ViewError
        As :func:`watch`.
    """
    check_installed()
    if not RATES[0] <= rate <= RATES[1]:
        raise ViewError(f"rate must lie between {RATES[0]:g} and {RATES[1]:g}, got {rate}")
    if not 0 <= port <= 65535:
        raise ViewError(f"a port is a number from 0 to 65535, got {port}")
    board = Board()
    session = Session(board, stage=stage, run=run, rate=rate)
    return Viewer(session, Server(board, session.ask, live_page(session.dimension.name), port=port))


def _of_dimension(what: object) -> tuple[Any, Any]:
    """Classes of runs and simulations that can be watched, in the dimension of one."""
    if isinstance(what, Run | Simulation):
        return Run, Simulation
    from heelstrike.sim.spatial.run import SpatialRun
    from heelstrike.sim.spatial.simulation import SpatialSimulation

    return SpatialRun, SpatialSimulation


def _in_terminal() -> bool:
    """Whether the browser found is one of texts, which would take the terminal and draw nothing."""
    return type(webbrowser.get()) is webbrowser.GenericBrowser and "BROWSER" not in os.environ


def _in_notebook() -> bool:
    """Whether this runs in the kernel of a notebook."""
    ipython = sys.modules.get("IPython")
    shell = ipython.get_ipython() if ipython is not None else None
    return type(shell).__name__ == "ZMQInteractiveShell"


def _at_prompt() -> bool:
    """Whether somebody types at a prompt of Python."""
    ipython = sys.modules.get("IPython")
    typed = ipython is not None and ipython.get_ipython() is not None
    return typed or hasattr(sys, "ps1") or bool(sys.flags.interactive)
