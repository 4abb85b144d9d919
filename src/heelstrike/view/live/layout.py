"""Where in the vector of a frame each quantity is, and what follows from that."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from heelstrike.robot.model import Floats, Integers
from heelstrike.robot.state import State
from heelstrike.sim.push import Push
from heelstrike.sim.run import AnyRun, quantities_of
from heelstrike.tolerances import SAME_ROW
from heelstrike.view.page.curves import DASHED, Plot, Trace, side_of
from heelstrike.view.style import in_words

AnyRunType = TypeVar("AnyRunType", bound=AnyRun)

MOST_PUSHES = 4
"""Pushes that are drawn at once."""
FARTHEST = 1.0
"""Metres that a slider moves a joint without ends at most, either way."""


class FrameLayout(ABC):
    """The quantities of a frame, one after the other.

    Parameters
    ----------
    robot : Robot or SpatialRobot
        The robot.
    widths : mapping of str to int
        How many numbers each quantity has, by its name; the first is the time.

    Attributes
    ----------
    robot : Robot or SpatialRobot
        The robot.
    width : int
        How many numbers a frame has.
    begin : dict of str to int
        Where each quantity begins.
    """

    def __init__(self, robot: Any, widths: Mapping[str, int]) -> None:
        self.robot = robot
        self.widths = dict(widths)
        ends = np.cumsum(list(self.widths.values())).tolist()
        self.width = int(ends[-1])
        self.begin: dict[str, int] = {
            name: end - wide for (name, wide), end in zip(self.widths.items(), ends, strict=True)
        }

    def described(self) -> dict[str, Any]:
        """Return where each quantity begins and how many numbers it has, and what is plotted."""
        return {
            "width": self.width,
            "fields": {name: [self.begin[name], wide] for name, wide in self.widths.items()},
            "panels": [plot.described() for plot in self.plots()],
            "joints": self.sliders(),
        }

    def table(self, count: int, found: Mapping[str, Any]) -> Floats:
        """Return frames, (count, width), of quantities by their names; NaN where there is none."""
        frames = np.full((count, self.width), np.nan)
        for name, numbers in found.items():
            begin, wide = self.begin[name], self.widths[name]
            frames[:, begin : begin + wide] = np.reshape(numbers, (count, wide))
        return frames

    @abstractmethod
    def frames(self, run: Any, rows: Sequence[int], pushes: Iterable[Push]) -> Floats:
        """Return the frames of some rows but the first, (len(rows) − 1, width).

        Contact forces are means since the row before, impulses of impacts included, so that what
        pushes for one step is seen; where there is no time between, those of the row itself, which
        act from it on.

        Parameters
        ----------
        run : Run or SpatialRun
            Rows and events.
        rows : sequence of int
            Their indices, in order; the first is where the means begin.
        pushes : iterable of Push
            What pushes the robot.
        """

    @abstractmethod
    def still(self, state: State, ground: Any) -> Floats:
        """Return the frame of a robot of which nothing is known but where it is, (1, width)."""

    @abstractmethod
    def plots(self) -> Iterator[Plot]:
        """Plots beside the picture, each curve with its place in a frame."""

    @abstractmethod
    def sliders(self) -> list[dict[str, Any]]:
        """Joints that a viewer can move, with the ends of their ranges."""

    def of_feet(
        self, field: str, title: str, unit: str, limits: Sequence[tuple[str, float]] = (),
        **ends: Any,
    ) -> Plot:  # fmt: skip
        """One panel with a curve for each foot."""
        names = [side_of(foot.name) for foot in self.robot.feet]
        if len(set(names)) < len(names):  # two on a side
            names = [in_words(foot.name) for foot in self.robot.feet]
        traces = [
            Trace(
                None, name.removesuffix(" foot"), i, DASHED if i else 0, at=self.begin[field] + i
            )
            for i, name in enumerate(names)
        ]  # fmt: skip
        return Plot(title, unit, traces, limits, group="feet", **ends)

    def pressing(self) -> Plot:
        """Normal forces of the feet."""
        weight = self.robot.weight
        limits = [("weight", weight)]
        return self.of_feet("pressing", "normal force", "N", limits, usual=(0.0, 1.5 * weight))

    def using(self) -> Plot:
        """Shares of their friction that the feet use."""
        limits = [("edge of the cone", 1.0)]
        return self.of_feet("used", "friction, share of cone", "1", limits, span=(-0.05, 1.1))

    def energies(self) -> Iterator[Plot]:
        """Kinetic, potential and mechanical energy."""
        begin = self.begin["energy"]
        kinetic = [Trace(None, "", color=0, at=begin)]
        others = [
            Trace(None, "potential", dash=DASHED, color=1, at=begin + 1),
            Trace(None, "mechanical", at=begin + 2),
        ]
        yield Plot("kinetic energy", "J", kinetic, group="energy")
        yield Plot("potential and mechanical energy", "J", others, group="energy")


def slider(name: str, *, hinge: bool, ends: tuple[float, float], at: int) -> dict[str, Any]:
    """Describe a joint that a viewer can move, whose position stands at a place of a frame."""
    farthest = np.pi if hinge else FARTHEST
    low, high = (float(np.clip(end, -farthest, farthest)) for end in ends)
    return {
        "name": name, "label": in_words(name).removesuffix(" joint"),
        "unit": "rad" if hinge else "m", "low": low, "high": high, "at": at,
    }  # fmt: skip


def only(run: AnyRunType, rows: Integers, **replaced: Floats) -> AnyRunType:
    """Return some rows of a run, without events and pushes, with some arrays replaced."""
    kept = {name: getattr(run, name)[rows] for name in ("time", *quantities_of(type(run)))}
    return replace(run, **kept | replaced, events=(), pushes=())


def acting_pushes(
    since: Floats, until: Floats, pushes: Iterable[Push]
) -> Iterator[tuple[int, int, Push]]:
    """Yield row, place among those that are drawn, and push, of all that acted between some times.

    Parameters
    ----------
    since, until : (n,) float
        Ends of the intervals, row by row, in s.
    pushes : iterable of Push
        All pushes.
    """
    used = np.zeros(len(until), dtype=np.int64)
    for push in pushes:
        if push.end <= since[0] or push.start >= until[-1]:
            continue
        acted = (push.start < until - SAME_ROW) & (push.end > since + SAME_ROW)
        for row in np.flatnonzero(acted & (used < MOST_PUSHES)).tolist():
            yield row, int(used[row]), push
            used[row] += 1
