"""A live simulation or a run that is looked at: what its viewers ask for, at the time they see.

One thread owns the simulation. Viewers send commands, which are carried out between two updates;
what there is to see goes to a :class:`~heelstrike.view.live.board.Board`.
"""

from __future__ import annotations

import math
import queue
import threading
import time as clock_time
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from heelstrike.errors import HeelstrikeError
from heelstrike.sim.push import Push
from heelstrike.tolerances import SAME_ROW
from heelstrike.view.live.board import Board
from heelstrike.view.live.dimension import LiveDimension, dimension_of
from heelstrike.view.live.history import History
from heelstrike.view.live.layout import FrameLayout
from heelstrike.view.live.light import NOTHING_YET
from heelstrike.view.live.live_simulation import LiveSimulation
from heelstrike.view.live.stage import Stage
from heelstrike.view.style import in_words

if TYPE_CHECKING:
    from heelstrike.sim.dimension import AnyRobot
    from heelstrike.sim.run import AnyRun
    from heelstrike.view.live.dimension import AnyEvent, AnyGround, Outline

UPDATES = 64.0
"""Updates a second that are offered to viewers."""
LONGEST_LAG = 0.1
"""Seconds of the clock that are made up for at most; what cannot keep up is slower."""
RATES = (0.001, 100.0)
"""Slowest and fastest, in simulated seconds a second."""
DENSEST = 1.0 / 60.0
"""Simulated seconds between two frames that are kept, at real time and faster."""
IDLE = 0.25
"""Seconds between two looks whether there is something to do, when there was not."""
SLOW = 0.03
"""Seconds that one update may simulate; what takes longer simulates less at a time."""
MOST_COMMANDS = 1000
"""Commands that may wait, while a gait is designed or viewers send more than can be done."""
WORDS_LAST = 0.5
"""Seconds that the words of the light stay."""
RANDOM_PUSH = (0.08, 0.25)
"""Force of a random push, as shares of the weight."""
RANDOM_PUSH_LASTS = 0.1
"""Seconds."""


class RefusedError(Exception):
    """What a viewer asked for that cannot be done, in a person's words."""


class Session:
    """What is watched, and where in its course viewers look.

    Parameters
    ----------
    board : Board
        Where it is shown.
    stage : Stage, optional
        Makes the simulation.
    run : Run or SpatialRun, optional
        What is looked at instead.
    rate : float
        Simulated seconds a second.
    """

    def __init__(
        self,
        board: Board,
        *,
        stage: Stage | None = None,
        run: AnyRun | None = None,
        rate: float = 1.0,
    ) -> None:
        self._board, self._stage, self._run = board, stage, run
        self.dimension: LiveDimension = (
            stage.dimension
            if stage is not None
            else dimension_of(None if run is None else run.robot)
        )
        self.values: dict[str, Any] = {}
        self._controls: list[dict[str, Any]] = []
        if stage is not None:
            self._set(stage.fitted({}))
        self.rate = rate
        self.playing = True
        self.cursor = 0.0
        self.history = History(self.dimension.quantities)
        self.live: LiveSimulation | None = None
        self._commands: queue.SimpleQueue[tuple[str, dict[str, Any]]] = queue.SimpleQueue()
        self._closing = threading.Event()
        self._random = np.random.default_rng(7)
        self._layout: FrameLayout | None = None
        self._shown = 0.0  # time of the frame that was kept last
        self._goal = 0.0
        self._reached, self._span = rate, 0.05  # of one update, in s
        self._gained = self._elapsed = 0.0
        self._note = self._busy = ""
        self._light, self._light_until = NOTHING_YET, 0.0
        self._thread = threading.Thread(target=self._go, name="heelstrike-watch", daemon=True)

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    def close(self) -> None:
        """End, soon."""
        self._closing.set()
        self._commands.put(("", {"do": "nothing"}))

    def join(self, timeout: float) -> None:
        """Wait until it has ended, at most so long (s)."""
        self._thread.join(timeout)

    def ask(self, viewer: str, command: dict[str, Any]) -> None:
        """Put a command of a viewer in line; see :meth:`obey`.

        Where `MOST_COMMANDS` wait, more are not taken, but for those that let go.
        """
        if self._commands.qsize() < MOST_COMMANDS or command.get("do") in ("release", "leave"):
            self._commands.put((viewer, command))

    def _go(self) -> None:
        try:
            self._go_on()
        except Exception as error:
            # Of ours: viewers are told, and the terminal gets the rest.
            self._board.state({"message": f"the view has failed: {error!r}", "playing": False})
            raise

    def _go_on(self) -> None:
        self.begin()
        before = due = clock_time.perf_counter()
        while not self._closing.is_set():
            going = self.playing and self._board.watched
            self._obey_until(due, wait=not going)
            now = clock_time.perf_counter()
            if going and self.playing:
                self.update(now - before)
                due = max(due + 1.0 / UPDATES, now)
            else:
                due = now
            before = now

    def _obey_until(self, due: float, *, wait: bool) -> None:
        """Carry out commands until an update is due, or wait for one a while.

        Commands that keep coming put an update off by `SLOW` and one command at most.
        """
        latest = max(due, clock_time.perf_counter()) + SLOW
        while not self._closing.is_set():
            now = clock_time.perf_counter()
            if now > latest and not wait:
                return
            left = IDLE if wait else due - now
            try:
                viewer, command = self._commands.get(timeout=max(left, 0.0))
            except queue.Empty:
                return
            self.obey(viewer, command)
            if wait:
                return

    def obey(self, viewer: str, command: Mapping[str, Any]) -> None:
        """Carry out a command; what cannot be is told in the state's note.

        Parameters
        ----------
        viewer : str
            Who asks.
        command : mapping
            What to ``do``, by the name of a method below, and its arguments.
        """
        self._note = ""
        what = command.get("do")
        do = _COMMANDS.get(what) if isinstance(what, str) else None
        try:
            if do is None:
                raise RefusedError(f"unknown command {what!r}")
            if not len(self.history) and do not in _ALWAYS:
                raise RefusedError("there is nothing to see yet")
            do(self, viewer, command)
        except (RefusedError, HeelstrikeError) as refused:
            self._note = str(refused)
        except (LookupError, TypeError, ValueError, OverflowError) as error:
            self._note = f"command {what!r} cannot be read: {error}"
        self._tell()

    # What viewers ask for

    def _play(self, _: str, command: Mapping[str, Any]) -> None:
        on = bool(command["on"])
        if on and self._at_end and (self.live is None or not self.live.can_go_on):
            if self.live is not None:
                over = f"{self.live.message}. Start again, or go on from an earlier time"
                raise RefusedError(over)
            self._move(self.history.time[0])
        self.playing = on
        self._goal = self.cursor

    def _step(self, _: str, command: Mapping[str, Any]) -> None:
        self.playing = False
        rows = 1 if int(command["rows"]) > 0 else -1
        row = self.history.row_at(self.cursor) + rows
        if row < len(self.history):
            self._move(float(self.history.time[max(row, 0)]))
        elif self.live is not None and self.live.can_go_on:
            self._advance(None)
        self._goal = self.cursor

    def _seek(self, _: str, command: Mapping[str, Any]) -> None:
        self.playing = False
        self._move(finite(command["time"]))

    def _event(self, _: str, command: Mapping[str, Any]) -> None:
        ahead = int(command["direction"]) > 0
        kinds = {str(kind) for kind in command.get("kinds", ())}
        times = sorted(
            event.time
            for event in self.history.events
            if not kinds or event.kind.name.lower() in kinds
        )
        wanted = [
            t
            for t in times
            if (t > self.cursor + SAME_ROW if ahead else t < self.cursor - SAME_ROW)
        ]
        if not wanted:
            raise RefusedError(
                f"there is no {'later' if ahead else 'earlier'} event of this kind so far"
            )
        self.playing = False
        self._move(wanted[0] if ahead else wanted[-1])
        self._note = self._happened(self.cursor)

    def _rate(self, _: str, command: Mapping[str, Any]) -> None:
        self.rate = clamped_rate(command["value"])
        self._goal = self.cursor  # what the machine owes the rate before is let go

    def _hold(self, viewer: str, command: Mapping[str, Any]) -> None:
        live = self._needs_live()
        force, place = (tuple(map(finite, command[name])) for name in ("force", "point"))
        link = int(command["link"])
        push = Push(link, force=force, start=0.0, duration=0.0, point=place)
        self.dimension.check(push, live.robot)
        if not self._at_end:
            self._go_on_from_cursor()
        live.held[viewer] = (link, place, force)

    def _release(self, viewer: str, _: Mapping[str, Any]) -> None:
        if self.live is not None:
            self.live.held.pop(viewer, None)

    def _random_push(self, *_: Any) -> None:
        live = self._needs_live()
        if not self._at_end:
            self._go_on_from_cursor()
        robot = live.robot
        link = int(self._random.choice(np.flatnonzero(robot.model.mass > 0.0)))
        size = self._random.uniform(*RANDOM_PUSH) * robot.weight
        force = tuple(size * along for along in self.dimension.somewhere(self._random))
        live.push(Push(link, force=force, start=live.time, duration=RANDOM_PUSH_LASTS))
        self._note = (
            f"{size:.3g} N on {in_words(robot.link_names[link])} for {RANDOM_PUSH_LASTS:g} s"
        )

    def _pose(self, _: str, command: Mapping[str, Any]) -> None:
        live = self._needs_live()
        joint, position = str(command["joint"]), finite(command["value"])
        self.playing = False
        if not self._at_end:
            self._go_on_from_cursor()
        if not live.can_go_on:
            raise RefusedError(f"{live.message}. Start again, or move it at an earlier time")
        live.move(joint, position)
        self.history.take(live.seen())
        assert self._layout is not None
        now = self.history.part(len(self.history) - 1, len(self.history) - 1)
        self._board.look(self._layout.frames(now, [0, 0], self._pushes)[0])
        self.cursor = self._goal = float(now.time[0])

    def _choose(self, _: str, command: Mapping[str, Any]) -> None:
        stage = self._needs_stage()
        name, value = str(command["name"]), command["value"]
        control = next((c for c in stage.controls(self.values) if c.name == name), None)
        if control is None or not control.accepts(value):
            raise RefusedError(f"{name} cannot be {value!r}")
        kept = {each: v for each, v in self.values.items() if each not in control.resets}
        chosen = stage.fitted(kept | {name: value})
        live = self.live
        if control.at_once and live is not None:
            live.lay(stage.ground(chosen, live.simulation))
            self._set(chosen)
        else:
            self.begin(chosen)

    def _set(self, values: dict[str, Any]) -> None:
        """Have other values, and the controls that go with them."""
        self.values = values
        self._controls = [c.described() for c in self._needs_stage().controls(values)]

    def _reset(self, *_: Any) -> None:
        if self._stage is None:
            self._move(self.history.time[0])
        else:
            self.begin()

    def _resume(self, *_: Any) -> None:
        self._needs_live()
        if not self._at_end:
            self._go_on_from_cursor()
        self._goal = self.cursor
        self.playing = True

    def _leave(self, viewer: str, command: Mapping[str, Any]) -> None:
        self._release(viewer, command)

    def _nothing(self, *_: Any) -> None:
        """Only look what there is."""

    # What happens by itself

    def begin(self, values: Mapping[str, Any] | None = None) -> None:
        """Begin with the simulation of some values; if there is none, stay with the one before."""
        wanted = self.values if values is None else dict(values)
        if self._stage is None:
            assert self._run is not None
            self.history.take(self._run)
            self._show_scene(self._run)
        else:
            try:
                if self.live is None:
                    self._show_outline(self._stage.outline(wanted))
                simulation = self._stage.simulation(wanted, self._tell_busy)
                self._tell_busy("loading the simulator (compiling it, once: about 20 s)")
                live = LiveSimulation(simulation, self.dimension)
                run = live.seen()
            except HeelstrikeError as error:
                self._note = str(error)
                return
            finally:
                self._tell_busy("")
            self.live, self.history = live, History(self.dimension.quantities)
            self._set(self._stage.found(wanted, simulation))
            self.history.take(run)
            self._show_scene(run)
        self._tell()

    def _begin_scene(self, robot: AnyRobot, ground: AnyGround, method: str) -> None:
        """Show a robot on its ground, of which frames are still to come."""
        self._layout = self.dimension.layout(robot)
        self._board.begin(
            {
                "scene": self.dimension.scene(robot, ground),
                "layout": self._layout.described(),
                "events": list(self.dimension.kinds),
                "method": method,
                "live": self._stage is not None,
            }
        )

    def _show_outline(self, outline: Outline | None) -> None:
        """Show where the robot is to begin, while its simulation is being made."""
        if outline is None:
            return
        robot, state, ground = outline
        self._begin_scene(robot, ground, "")
        assert self._layout is not None
        self._board.add(self._layout.still(state, ground))

    def _show_scene(self, run: AnyRun) -> None:
        """Show a course from its beginning on: of a simulation what has been of it."""
        times = self.history.time
        self._begin_scene(run.robot, run.ground, str(run.method))
        if not len(times):
            return
        shown = np.arange(times[0], times[-1], DENSEST)
        rows = np.unique([0, 0, *(self.history.row_at(t) for t in shown), len(times) - 1])
        self._keep([0, *rows.tolist()], list(run.events))
        if self.live is None:
            self.cursor = float(times[0])
            self._move(self.cursor)

    def update(self, elapsed: float) -> None:
        """Go on by what has passed on the clock (s)."""
        if not len(self.history):
            self.playing = False
            self._tell()
            return
        self._goal += self.rate * min(elapsed, LONGEST_LAG)
        end = float(self.history.time[-1])
        if self._goal <= end + SAME_ROW:
            self._move(self._goal)
        elif self.live is not None and self.live.can_go_on:
            self._simulate(elapsed)
        else:
            self._move(end)
            self.playing = False
        self._tell()

    def _simulate(self, elapsed: float) -> None:
        """Simulate up to the goal, or as much of it as leaves time for viewers."""
        assert self.live is not None
        before = self.live.time
        step = self.live.simulation.method.row_period[1]
        took = self._advance(min(self._goal, before + max(self._span, step)))
        gained = self.live.time - before
        self._span = gained * SLOW / took if took > SLOW else min(2.0 * self._span, 1e3)
        self._goal = min(self._goal, self.live.time + max(self.rate * LONGEST_LAG, step))
        self._gained, self._elapsed = self._gained + gained, self._elapsed + elapsed
        if self._elapsed >= 0.5:
            self._reached = self._gained / self._elapsed
            self._gained = self._elapsed = 0.0

    def _advance(self, until: float | None) -> float:
        """Simulate until a time (s), or one step, and show it; return what simulating took (s)."""
        assert self.live is not None
        began = clock_time.perf_counter()
        run = self.live.advance(until)
        took = clock_time.perf_counter() - began
        if run is not None:
            self._take(run)
        return took

    def _take(self, run: AnyRun) -> None:
        """Show a piece of the record that follows on what there is."""
        assert self.live is not None
        known = len(self.history)
        events = self.history.take(run)
        last = len(self.history) - 1
        if last < 0 or known == 0:
            return
        interval = min(DENSEST, max(self.rate / UPDATES, 0.0))
        count = max(int((self.history.time[-1] - self._shown) / interval - 0.5), 0)
        between = self._shown + interval * np.arange(1, min(count, 500) + 1)
        first = self.history.row_at(self._shown)
        rows = np.unique([first, *(self.history.row_at(t) for t in between), last])
        self._keep(rows.tolist() if len(rows) > 1 else [first, last], events)
        if not self.live.can_go_on:
            self.playing = False

    def _keep(self, rows: list[int], events: list[AnyEvent]) -> None:
        """Show rows of the history for good, and events with them; forces begin at the first."""
        assert self._layout is not None
        part = self.history.part(rows[0], rows[-1])
        frames = self._layout.frames(part, [row - rows[0] for row in rows], self._pushes)
        self._shown = self.cursor = float(part.time[-1])
        told = [
            [event.time, int(event.kind), self.dimension.shown_at(event, part.robot)]
            for event in events
        ]
        self._board.add(frames, told)

    def _move(self, time: float) -> None:
        """Look at a time (s) of the history."""
        times = self.history.time
        if not len(times):
            return
        assert self._layout is not None
        self.cursor = float(min(max(time, times[0]), times[-1]))
        row = self.history.row_at(self.cursor)
        # Forces since the picture before; standing still, those of the step that led here.
        before = self.history.row_at(self.cursor - self.rate / UPDATES) if self.playing else row
        since = max(min(before, row - 1), 0)
        frame = self._layout.frames(self.history.part(since, row), [0, row - since], self._pushes)[
            0
        ]
        self._goal = self.cursor
        self._board.look(frame)

    def _go_on_from_cursor(self) -> None:
        """Let the simulation be again as it was at the cursor, and forget what came after."""
        live = self._needs_live()
        row = self.history.row_at(self.cursor)
        time = float(self.history.time[row])
        live.go_back(time)
        stage = self._needs_stage()
        self._set(stage.found(self.values, live.simulation))
        self.history.cut(time)
        self._board.cut(time)
        self._shown = self._goal = self.cursor = time
        self._keep([len(self.history) - 1] * 2, [])

    @property
    def _at_end(self) -> bool:
        times = self.history.time
        return not len(times) or self.cursor >= float(times[-1]) - SAME_ROW

    @property
    def _pushes(self) -> tuple[Push, ...]:
        if self.live is not None:
            return self.live.pushes
        return () if self._run is None else self._run.pushes

    def _needs_live(self) -> LiveSimulation:
        if self.live is None:
            raise RefusedError("this is a run that is over: there is nothing to push or set")
        return self.live

    def _needs_stage(self) -> Stage:
        if self._stage is None:
            raise RefusedError("this is a run that is over: there is nothing to push or set")
        return self._stage

    def _happened(self, time: float) -> str:
        """Return in words what happened at a time (s), and where."""
        places: dict[str, list[str]] = {}
        for event in self.history.events:
            if abs(event.time - time) <= SAME_ROW:
                places.setdefault(event.kind_in_words, []).append(self._where(event))
        told = [f"{kind} ({', '.join(filter(None, each))})" for kind, each in places.items()]
        return f"at {time:.6g} s: {'; '.join(told)}".replace(" ()", "")

    def _where(self, event: AnyEvent) -> str:
        return "" if self._layout is None else in_words(event.place(self._layout.robot))

    def _tell_busy(self, what: str) -> None:
        self._busy = what
        self._tell()

    def _tell(self) -> None:
        """Show how things are, where that has changed."""
        times, run = self.history.time, self.history.newest
        self._board.state(
            {
                "playing": self.playing,
                "rate": self.rate,
                "reached": round(self._reached, 2),
                "from": float(times[0]) if len(times) else 0.0,
                "end": self._at_end,
                "note": self._note,
                "busy": self._busy,
                "message": run.message if run is not None and self._over_here else "",
                "over": self.live is not None and not self.live.can_go_on,
                "light": self._lit(),
                "returns": self.live is not None and self.live.returns,
                "controls": self._controls,
                "values": self.values,
            }
        )

    def _lit(self) -> dict[str, str]:
        """Return the light, whose words change twice a second at most while time goes on."""
        run, now = self.history.newest, clock_time.perf_counter()
        light = NOTHING_YET if run is None else self.dimension.light(run)
        waits = self.playing and light["level"] == self._light["level"]
        if not waits or now > self._light_until:
            self._light, self._light_until = light, now + WORDS_LAST
        return self._light

    @property
    def _over_here(self) -> bool:
        """Whether viewers look at the end of what cannot go on."""
        return self._at_end and (self.live is None or not self.live.can_go_on)


def clamped_rate(value: Any) -> float:
    """Simulated seconds a second that a viewer asks for, within `RATES`.

    Raises
    ------
    ValueError, TypeError
        If it is no finite number.
    """
    return min(max(finite(value), RATES[0]), RATES[1])


def finite(value: Any) -> float:
    """Return a number that a viewer sent.

    Raises
    ------
    ValueError, TypeError
        If it is no finite number.
    """
    number = float(value)
    if not math.isfinite(number):
        raise ValueError(f"{value!r} is not a finite number")
    return number


_COMMANDS: dict[str, Any] = {
    "play": Session._play,
    "step": Session._step,
    "seek": Session._seek,
    "event": Session._event,
    "rate": Session._rate,
    "hold": Session._hold,
    "release": Session._release,
    "random push": Session._random_push,
    "pose": Session._pose,
    "choose": Session._choose,
    "reset": Session._reset,
    "resume": Session._resume,
    "leave": Session._leave,
    "nothing": Session._nothing,
}
"""What viewers may ask for."""

_ALWAYS = (Session._rate, Session._choose, Session._reset, Session._leave, Session._nothing)
"""What can be asked for before there is anything to see."""
