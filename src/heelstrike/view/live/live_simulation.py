"""A simulation that goes on, is pushed, and can be taken back to where it was."""

from __future__ import annotations

from bisect import bisect_right
from typing import TYPE_CHECKING, Any

from heelstrike.errors import SimulationError
from heelstrike.sim.closed_sets import OnError
from heelstrike.sim.push import Push
from heelstrike.sim.simulation import CAN_GO_ON
from heelstrike.view.live.dimension import LiveDimension, dimension_of
from heelstrike.view.live.stage import snapshot_of

if TYPE_CHECKING:
    from heelstrike.sim.dimension import AnyRobot
    from heelstrike.sim.run import AnyRun
    from heelstrike.view.live.dimension import AnyGround, AnySimulation

KEEP_EVERY = 0.25
"""Simulated seconds between two snapshots."""
MOST_SNAPSHOTS = 400
"""Of some 0.2 MB each."""
MOST_PUSHES = 2000

Hold = tuple[int, tuple[float, ...], tuple[float, ...]]


class LiveSimulation:
    """A simulation with its pushes and with snapshots of its past.

    Parameters
    ----------
    simulation : Simulation or SpatialSimulation
        The simulation; its record is taken from it piece by piece.
    dimension : LiveDimension, optional
        That of its robot.

    Attributes
    ----------
    held : dict
        Link, point in its axes (m) and force (N) of what each viewer pulls at.
    """

    def __init__(self, simulation: AnySimulation, dimension: LiveDimension | None = None) -> None:
        self.simulation: Any = simulation
        self._dimension = dimension or dimension_of(simulation.robot)
        if simulation.on_error is OnError.RAISE:  # nobody is there to catch it
            simulation.on_error = OnError.WARN
        self.held: dict[str, Hold] = {}
        self._given: tuple[Push, ...] | None = None
        self._added: tuple[Push, ...] = ()
        self._snapshots: list[tuple[Any, tuple[Push, ...]]] = []
        """Snapshots, with the pushes that had been added until then."""
        self._last = self.time
        self._keep()

    @property
    def robot(self) -> AnyRobot:
        """The robot."""
        robot: AnyRobot = self.simulation.robot
        return robot

    @property
    def time(self) -> float:
        """Now, in s."""
        return float(self.simulation.time)

    @property
    def can_go_on(self) -> bool:
        """Whether it has not come to its end."""
        return self.simulation.status in CAN_GO_ON

    @property
    def returns(self) -> bool:
        """Whether it can be taken back."""
        return bool(self._snapshots)

    @property
    def pushes(self) -> tuple[Push, ...]:
        """All that pushed or will, of those added the last `MOST_PUSHES`."""
        return (*(self._given or ()), *self._added)

    @property
    def message(self) -> str:
        """How it goes, in words."""
        return str(self.simulation.message)

    def record(self) -> AnyRun:
        """Return what it has recorded since it was last asked."""
        run: AnyRun = self.simulation.record
        if self._given is None:
            self._given = run.pushes
        self.simulation.forget()
        return run

    def seen(self) -> AnyRun:
        """Return how it is now.

        Where the record ends a step before now, a step is taken and taken back; of a controller
        that takes no part in snapshots it is not taken back.
        """
        run = self.record()
        if len(run.time) or not self.can_go_on:
            return run
        before = snapshot_of(self.simulation)
        self.simulation.step()
        run = self.record()
        if before is not None:
            self.simulation.restore(before)
        return run

    def advance(self, until: float | None) -> AnyRun | None:
        """Go on to about a time (s), or by one step; return what was recorded.

        None if the next step ends later than that.
        """
        method = self.simulation.method
        if until is None:
            until = self.time + method.row_period[1]
        elif method.step_length is not None:
            steps = int((until - self.time) / method.step_length + 1e-6)
            until = self.time + steps * method.step_length
        if until <= self.time:
            return None
        for link, point, force in self.held.values():
            lasts = until - self.time
            self.push(Push(link, force=force, start=self.time, duration=lasts, point=point))
        self.simulation.advance(until)
        if self.time >= self._last + KEEP_EVERY and self.can_go_on:
            self._keep()
        return self.record()

    def push(self, push: Push) -> None:
        """Let a push act, by the index of its link."""
        self.simulation.apply(push)
        self._added = (*self._added[-MOST_PUSHES:], push)

    def lay(self, ground: AnyGround) -> None:
        """Lay another ground."""
        self.simulation.ground = ground
        self._keep()

    def move(self, joint: str, position: float) -> None:
        """Put a joint elsewhere (rad or m) while all else stays, velocities too.

        A robot that stands, or would stand in the ground, is lifted or lowered on it.

        Raises
        ------
        HeelstrikeError
            If there is no such joint, or the robot cannot be like that.
        """
        self.simulation.state = self._dimension.moved(self.simulation, joint, position)
        self._keep()

    def go_back(self, time: float) -> None:
        """Be again as at an earlier instant (s), and forget what came after.

        Raises
        ------
        SimulationError
            If its controller takes no part in snapshots, or that is too long ago.
        """
        times = [snapshot.time for snapshot, _ in self._snapshots]
        place = bisect_right(times, time + 1e-9) - 1
        if place < 0:
            raise SimulationError(
                "it cannot go on from there: "
                + (
                    f"the earliest instant that is kept is {times[0]:.2f} s"
                    if times
                    else "the controller takes no part in snapshots"
                )
            )
        del self._snapshots[place + 1 :]
        snapshot, known = self._snapshots[place]
        self.simulation.restore(snapshot)
        self._last = snapshot.time
        self._added = tuple(push for push in self._added if push.start < time - 1e-9)
        self.simulation.apply([p for p in self._added if p.end > snapshot.time and p not in known])
        if time > snapshot.time + 1e-9:
            self.simulation.advance(time)
        self.simulation.forget()

    def _keep(self) -> None:
        """Keep how it is now, if it can be kept."""
        self._last = self.time
        kept = snapshot_of(self.simulation)
        if kept is not None:
            if self._snapshots and self._snapshots[-1][0].time >= kept.time:
                self._snapshots.pop()  # a slider sets many values at one instant, the last holds
            self._snapshots.append((kept, self._added))
            del self._snapshots[: max(len(self._snapshots) - MOST_SNAPSHOTS, 0)]
