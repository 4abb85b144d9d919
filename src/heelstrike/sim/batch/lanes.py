"""The memory of many lanes, laid out in rows of one block."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from heelstrike.compiler.bundle import address_of_array
from heelstrike.compiler.mold import Mold
from heelstrike.errors import SimulationError
from heelstrike.robot.model import Floats, Integers
from heelstrike.sim.batch.lane import Lane
from heelstrike.sim.batch.moving import PLACES, put_back_lanes
from heelstrike.sim.batch.planning import Plan
from heelstrike.sim.clock import Clock
from heelstrike.sim.closed_sets import EventKind
from heelstrike.sim.dimension import dimension_of
from heelstrike.sim.method import Method
from heelstrike.sim.push import pushes_on
from heelstrike.sim.setting import Setting


class Lanes:
    """The lanes of a batch in one block of memory.

    What the solvers scribble on is one for all lanes of a thread: that is most of the memory of a
    simulation, and nothing of it is read before it is written.

    Parameters
    ----------
    plans : sequence of Plan
        What they are to be.
    method : Method
        Simulation method of all.
    threads : int
        Threads that will work on them.
    keep_rows : bool
        Whether they are recorded.

    Attributes
    ----------
    lanes : list of Lane
    places : (n, columns) int
        What compiled code finds each by.
    events : (n, kinds) int
        Events of each kind so far.
    thread : (n,) int
        The thread that works on each.
    """

    def __init__(
        self, plans: Sequence[Plan], method: Method, threads: int, *, keep_rows: bool
    ) -> None:
        count = len(plans)
        self._method, self._keep_rows = method, keep_rows
        settings = [plan.setting for plan in plans]
        self._dimension = dimension_of(settings[0].robot)
        sizes = {self._dimension.mold(setting).size for setting in settings}
        self._clock_mold = Mold(Clock())
        self._scratch = [self._dimension.scratch(settings) for _ in range(threads)]
        width = self._clock_mold.size + max(sizes)
        self._block = np.zeros((count, width), dtype=np.int64)
        self.thread = np.arange(count) * threads // max(count, 1)
        self.events = np.zeros((count, len(EventKind)), dtype=np.int64)
        self.places = np.zeros((count, PLACES), dtype=np.int64)
        self.lanes: list[Lane] = [self._new(i, plan) for i, plan in enumerate(plans)]
        self._images: dict[bytes, NDArray[np.int64]] = {}
        self._image_at = np.zeros(count, dtype=np.int64)
        self._spots: Integers = np.zeros((count, 0, 2), dtype=np.int64)

    def lay(self, index: int, plan: Plan) -> None:
        """Let a lane be another from now on."""
        self.events[index] = 0
        self.lanes[index] = self._new(index, plan)
        self.find(index)
        self._keep(index)

    def take(self, index: int) -> Lane:
        """Return a lane, and let go of it: it will not move again."""
        lane = self.lanes[index]
        self.lanes[index] = None  # type: ignore[call-overload]
        return lane

    def refuse_others(self, plans: Sequence[Plan]) -> None:
        """Refuse robots and grounds whose memory would not lie in columns."""
        wanted = self._block.shape[1] - self._clock_mold.size

        def fits(setting: Setting) -> bool:
            return bool(self._dimension.mold(setting).size == wanted)

        others = [plan.setting for plan in plans if not fits(plan.setting)]
        if not others:
            return
        if any(fits(replace(others[0], ground=lane.ground)) for lane in self.lanes):
            raise SimulationError(
                "the grounds of a batch must all have boxes, or none of them may; one of these "
                "differs. Use simulate_batch for such grounds"
            )
        raise SimulationError(
            "the robots of a batch must have the same structure, joint by joint; one of these "
            "differs. Use simulate_batch for such robots"
        )

    def find(self, index: int) -> None:
        """Find what a lane is moved with, which may be elsewhere now."""
        self.places[index] = self.lanes[index].places

    def put_back(self, lanes: Integers, new: tuple[Floats, Floats], state: Any) -> None:
        """Let lanes be as they began, but for ground, pushes and parameters, in new states.

        ``new`` are positions and velocities, a row for each of them; ``state`` are those of all.
        """
        put_back_lanes()(lanes, self._spots, self._image_at, *new, *state, self.events)

    def make_ready(self) -> None:
        """Find what the lanes are moved with, and keep how they begin, to be put back."""
        arrays = max(len(lane.changing()) for lane in self.lanes)
        self._spots = np.zeros((len(self.lanes), arrays, 2), dtype=np.int64)
        for index in range(len(self.lanes)):
            self.find(index)
            self._keep(index)

    def column(self, array: NDArray[Any], *, written: bool = False) -> NDArray[Any]:
        """Return what lies in all lanes where an array lies in the first, (n, ...), not copied."""
        offset = address_of_array(array) - address_of_array(self._block)
        found: NDArray[Any] = np.ndarray(
            (len(self._block), *array.shape), array.dtype, self._block.reshape(-1), offset,
            (self._block.strides[0], *array.strides),
        )  # fmt: skip
        found.flags.writeable = written
        return found

    def _new(self, index: int, plan: Plan) -> Lane:
        setting, row = plan.setting, self._block[index]
        mold, first = self._dimension.mold(setting), self._clock_mold.size
        memory = mold.cast(row[first : first + mold.size])
        memory = self._dimension.with_scratch(memory, self._scratch[self.thread[index]])
        memory = memory.replaced(pushes=pushes_on(setting.robot, setting.pushes))
        clock = self._clock_mold.cast(row[:first])
        return Lane(
            plan, self._method, memory, clock, self.events[index], keep_rows=self._keep_rows
        )

    def _keep(self, index: int) -> None:
        """Keep the image of a lane, once for all that begin alike."""
        named = self.lanes[index].changing()
        arrays = [array for _, array in named]
        spots = [(address_of_array(each), each.size) for each in arrays]
        lacking = max(len(spots) - self._spots.shape[1], 0)
        self._spots = np.pad(self._spots, ((0, 0), (0, lacking), (0, 0)))  # no words: nothing
        self._spots[index] = 0
        self._spots[index, : len(spots)] = spots
        image = np.concatenate(
            [
                each.reshape(-1).view(np.int64) * (name not in ("memory.q", "memory.v"))
                for name, each in named
            ]
        )
        kept = self._images.setdefault(image.tobytes(), image)
        self._image_at[index] = address_of_array(kept)
        if len(self._images) > 2 * len(self.lanes):  # those of lanes that were laid again since
            used = set(self._image_at.tolist())
            images = self._images.items()
            self._images = {k: each for k, each in images if address_of_array(each) in used}
