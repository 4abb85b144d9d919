"""A robot that a program moves, in the browser: each of its states is shown when it comes."""

from __future__ import annotations

import sys
import threading
import time as clock_time
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from heelstrike.robot.model import Floats
from heelstrike.robot.robot import Robot
from heelstrike.robot.state import State
from heelstrike.tolerances import SAME_ROW
from heelstrike.view.live.board import MOST_FRAMES, Board
from heelstrike.view.live.frames import Layout
from heelstrike.view.live.light import CERTIFIED, NOTHING_YET
from heelstrike.view.live.page import live_page
from heelstrike.view.live.plane import LIVE_PLANE
from heelstrike.view.live.server import Server, check_installed
from heelstrike.view.live.session import clamped_rate, finite
from heelstrike.view.live.viewer import LOOK_EVERY, Viewer

if TYPE_CHECKING:
    from heelstrike.contact.ground import Ground

OPENS_WITHIN = 10.0
"""Seconds that a browser is given to open the page, before the robot moves."""

NOT_HERE = "a program moves this robot: it can be paused and looked at, not pushed or set"


class Display:
    """Shows a robot that a program moves, in real time.

    A page shows what has been since the last beginning. Its pause halts the program where it next
    shows something; its steps let it go on once. While nobody looks nothing is halted.

    Parameters
    ----------
    robot : Robot
        The robot.
    browser : bool
        Whether to open a browser; where there is none the address is printed.

    Attributes
    ----------
    url : str
        Address of the page. It holds the token that lets in.

    Raises
    ------
    ViewError
        If the package that serves is not installed.
    """

    def __init__(self, robot: Robot, *, browser: bool = True) -> None:
        check_installed()
        self._layout, self._board = Layout(robot), Board()
        self._frames: list[Floats] = []
        self._change = threading.Condition()
        self._playing, self._closed, self._steps = True, False, 0
        self._rate, self._place, self._note = 1.0, -1, ""
        self._light = NOTHING_YET
        self._due = 0.0
        page = live_page(LIVE_PLANE.name)
        self._viewer = Viewer(self, Server(self._board, self.ask, page))
        self.url = self._viewer.url
        if browser and self._viewer.open():
            self._wait_for_viewer(OPENS_WITHIN)
        elif browser:
            print(f"watch at {self.url}", file=sys.stderr, flush=True)

    def begin(self, ground: Ground, method: str = "") -> None:
        """Forget what has been shown, and begin on some ground.

        Parameters
        ----------
        ground : Ground
            What the robot stands on from now on.
        method : str
            How it is simulated, for those who ask.
        """
        with self._change:
            self._frames, self._place = [], -1
            self._board.begin(
                {
                    "scene": LIVE_PLANE.scene(self._layout.robot, ground),
                    "layout": self._layout.described(),
                    "events": list(LIVE_PLANE.kinds),
                    "method": method,
                    "live": False,
                }
            )
        self._ground = ground

    def show(
        self, time: float, state: State, *, force: Floats, torque: Floats, residual: float
    ) -> None:  # fmt: skip
        """Show a state when its time has come, and not before a viewer lets it.

        Parameters
        ----------
        time : float
            Time since the beginning (s), not before that of the state shown last.
        state : State
            Where the robot is.
        force : (nc, 2) float
            Contact forces (N) on the robot: normal, tangential.
        torque : (nu,) float
            Torques of the motors (N m).
        residual : float
            Largest residual of a contact problem so far, relative to the size of its data.
        """
        frame = self._layout.still(state, self._ground)[0]
        begin, widths = self._layout.begin, self._layout.widths
        normal = frame[begin["normal"] :][: widths["normal"]].reshape(-1, 2)
        tangent = np.column_stack((normal[:, 1], -normal[:, 0]))
        world = force[:, :1] * normal + force[:, 1:] * tangent
        for name, numbers in (("time", time), ("force", world.ravel()), ("torque", torque)):
            frame[begin[name] : begin[name] + widths[name]] = numbers
        with self._change:
            elapsed = time - self._frames[-1][0] if self._frames else 0.0
            while not self._change.wait_for(self._goes_on, timeout=LOOK_EVERY):
                pass  # so that Ctrl-C is heard on Windows, too
            self._steps = max(self._steps - 1, 0)
            if self._playing:
                self._due = max(self._due + elapsed / self._rate, clock_time.perf_counter())
            self._frames.append(frame)
            del self._frames[: max(len(self._frames) - MOST_FRAMES, 0)]
            self._place, self._note = -1, ""
            self._light = {
                "level": "good" if residual <= CERTIFIED else "bad",
                "text": f"contact forces: residual {residual:.1g} at most",
            }
            wait = self._due - clock_time.perf_counter() if self._playing else 0.0
        if wait > 0.0:
            clock_time.sleep(wait)
        self._board.add(frame[None])
        self._tell()

    def close(self) -> None:
        """End the view; who waits goes on."""
        with self._change:
            self._closed = True
            self._change.notify_all()
        self._viewer.close()

    def start(self) -> None:
        """Begin: nothing goes on by itself."""

    def join(self, timeout: float) -> None:
        """Wait until it has ended: nothing goes on by itself."""

    def ask(self, viewer: str, command: Mapping[str, Any]) -> None:  # noqa: ARG002 - all may
        """Do what a viewer asks for; what cannot be done is told in the state's note."""
        with self._change:
            self._note = ""
            try:
                self._obey(command)
            except (LookupError, TypeError, ValueError, OverflowError) as error:
                self._note = f"command {command.get('do')!r} cannot be read: {error}"
            self._change.notify_all()
        self._tell()

    def _obey(self, command: Mapping[str, Any]) -> None:
        what, last = command.get("do"), len(self._frames) - 1
        if what == "play":
            self._playing = bool(command["on"])
            if self._playing and self._frames:
                self._look(last)
        elif what == "rate":
            self._rate = clamped_rate(command["value"])
        elif what == "step":
            ahead, self._playing = int(command["rows"]) > 0, False
            if ahead and self._place in (-1, last):
                self._steps = 1
            elif self._frames:
                place = last if self._place < 0 else self._place
                self._look(max(place + (1 if ahead else -1), 0))
        elif what == "seek":
            wanted, times = finite(command["time"]), [frame[0] for frame in self._frames]
            self._playing = False
            place = int(np.searchsorted(times, wanted + SAME_ROW)) - 1
            if times:
                self._look(min(max(place, 0), last))
        elif what == "event":
            self._note = "no events are told of a robot that a program moves"
        elif what not in ("nothing", "leave", "release"):
            self._note = NOT_HERE

    def _look(self, place: int) -> None:
        self._place = place
        self._board.look(self._frames[place])

    def _goes_on(self) -> bool:
        """Whether what is shown next may be."""
        return self._playing or self._steps > 0 or self._closed or not self._board.watched

    def _wait_for_viewer(self, most: float) -> None:
        with self._change:
            self._change.wait_for(lambda: self._board.watched, timeout=most)

    def _tell(self) -> None:
        frames = self._frames
        self._board.state(
            {
                "playing": self._playing,
                "rate": self._rate,
                "reached": self._rate,
                "from": float(frames[0][0]) if frames else 0.0,
                "end": self._place in (-1, len(frames) - 1),
                "note": self._note,
                "busy": "",
                "message": "",
                "over": False,
                "light": self._light,
                "returns": False,
                "controls": [],
                "values": {},
            }
        )
