"""What a simulation method is: the contract that a new one fulfils.

A method is a frozen dataclass of its settings. It says what it cannot do (:meth:`Method.check`),
makes the bundle that it works with (:meth:`Method.new_work`) and names the kernels that the frame
(:mod:`heelstrike.sim.frame`) calls at every instant. Everything else - the loop, the calls of the
controller, pushes, the record, stopping, keeping and continuing - is the same for all.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Hashable, Mapping
from dataclasses import field
from typing import Any, ClassVar
from weakref import WeakKeyDictionary

import numpy as np

from heelstrike.compiler.bundle import Bundle
from heelstrike.compiler.mold import Mold
from heelstrike.contact import problem
from heelstrike.contact.sets import ImpulseSet
from heelstrike.errors import ContactProblemError, SimulationError
from heelstrike.field_texts import dataclass
from heelstrike.robot.model import Floats, Integers
from heelstrike.robot.robot import Robot
from heelstrike.sim.clock import Clock
from heelstrike.sim.contacts.constraint import constraint_names, is_line
from heelstrike.sim.contacts.writers import gaps_at
from heelstrike.sim.frame import Kernels
from heelstrike.sim.record.size import check_room, check_steps
from heelstrike.sim.setting import OPEN_LOOP, Setting


class Method(ABC):
    """A simulation method: :class:`~heelstrike.TimeStepping` and its like.

    A new one is a frozen dataclass, and may live outside this package. It has

    - fields, its settings, by names not used below: numbers, text, truth values, members of
      an enum, None, or frozen dataclasses of such (laws). One that is neither number nor text has a
      default of its kind, by which it is made again from a file;
    - `work`, the class of its bundle: settings that kernels read, and all that it remembers;
    - `kernels`, what the frame calls; each is a :func:`~heelstrike.sim.kernel`;
    - :attr:`solves_with`, :meth:`new_work`, :meth:`room` and :attr:`row_period`;
    - :attr:`step_length`, if all its steps are of one length;
    - whatever else below is not so with it.

    The frame handles the controller, torque limits, closed loops as a run begins, the record
    and when to stop. The kernels of the method see to

    - ``begin``: what else has to be ready for the first instant; None if nothing has;
    - ``prepare``: ``memory.equations.tree`` and ``memory.contacts`` of the state in ``memory.q``,
      ``memory.v``;
    - ``decide``: what follows from these and from ``memory.torque``: forces in
      ``memory.contacts.force`` (N), torques of stops and dry friction and slip in
      ``memory.reaction``, residuals; pushes in ``memory.pushes``; worst values and events;
    - ``report``: what goes into the record; None if that is a row when one is due;
    - ``move``: ``memory.q``, ``memory.v`` and ``clock.time`` of the next instant, not beyond
      ``clock.until`` if steps have no length of their own, and one more in ``memory.tally.steps``.

    Everything that they remember from one instant to the next is in memory or work: that is what a
    snapshot keeps. `heelstrike.sim` has the kernels that the methods of this package are made of;
    ``docs/own-method.md`` shows where to begin.
    """

    kernels: ClassVar[Kernels]
    """What it supplies to the frame."""

    work: ClassVar[Any]
    """Its own bundle: settings that kernels read, and all that it remembers."""

    usual_numbers: ClassVar[Mapping[str, int]] = {}
    """Whole numbers of its bundle as they mostly are: with these, loops have no code for others."""

    usual_extents: ClassVar[Mapping[str, int]] = {}
    """Extents of robots as they mostly are: those of these extents have a loop of their own."""

    impulses_in_events: ClassVar[bool] = False
    """Whether impulses of impacts are in the events of a run, not in the forces of its rows."""

    holds: ClassVar[frozenset[ImpulseSet]] = frozenset()
    """Sets of the constraints from outside that it can simulate. The kernels of `heelstrike.sim`
    for loops hold those that are lines."""

    python_period: ClassVar[float | None] = None
    """Seconds between two calls of a Python controller without a period of its own; None for
    every step."""

    step_length: float | None = None
    """Seconds from one instant to the next, if all steps are of one length."""

    @property
    def name(self) -> str:
        """What runs and files call it."""
        return type(self).__name__

    @property
    def asked_for(self) -> Method:
        """The method that the user asked for: of robots in space it is wrapped."""
        return self

    @property
    @abstractmethod
    def solves_with(self) -> str:
        """What finds its contact forces: a solver, or the contact law."""

    @abstractmethod
    def new_work(self, robot: Robot) -> Bundle:
        """Allocate its bundle for a robot.

        Parameters
        ----------
        robot : Robot
            The robot.

        Returns
        -------
        Bundle
            With its settings in it, and nothing remembered yet.
        """

    @abstractmethod
    def room(self, robot: Robot) -> tuple[int, int]:
        """Return how many rows and events one instant may add to the record.

        Parameters
        ----------
        robot : Robot
            The robot.

        Returns
        -------
        tuple of int
            Rows, and events.
        """

    @property
    @abstractmethod
    def row_period(self) -> tuple[str, float]:
        """Setting that says how often there is a row, and its value in seconds."""

    def doubts(
        self, robot: Robot, q: Floats, sunk: float = 0.0, past: float = 0.0,  # noqa: ARG002
    ) -> list[str]:  # fmt: skip
        """Say what makes its answers doubtful, and what to do about it.

        Parameters
        ----------
        robot : Robot
            The robot.
        q : (nq,) float
            A pose that it goes through.
        sunk : float
            How much deeper (m) in the ground it was than at the beginning.
        past : float
            How much farther (rad, m) a joint was beyond a stop than at the beginning.

        Returns
        -------
        list of str
            In a person's words; nothing if nothing is known against them.
        """
        return []

    def check(self, setting: Setting) -> None:  # noqa: B027 - most can do everything
        """Refuse what this method cannot simulate.

        Parameters
        ----------
        setting : Setting
            What is to be simulated.

        Raises
        ------
        SimulationError
            That says what, and what to do instead.
        """

    def warning(self, setting: Setting) -> str:  # noqa: ARG002 - for those that have one
        """Say what a run should not begin without being told.

        Parameters
        ----------
        setting : Setting
            What is to be simulated.

        Returns
        -------
        str
            In a person's words; nothing if there is none.
        """
        return ""

    def check_span(self, setting: Setting, duration: float) -> None:
        """Refuse a time whose steps cannot be counted, or whose record does not fit into memory.

        Parameters
        ----------
        setting : Setting
            What is to be simulated.
        duration : float
            How long it is to go on (s).

        Raises
        ------
        SimulationError
            With what would fit.
        """
        check_steps(setting, duration, *self.row_period)
        check_room(setting, duration, *self.row_period)

    def set_clock(self, setting: Setting, clock: Clock) -> None:
        """Say how often the controller is called, in steps of one length or in seconds.

        Parameters
        ----------
        setting : Setting
            What is to be simulated.
        clock : Clock
            Clock that is set.
        """
        if self.step_length is None:
            clock.control_period = setting.control_period or 0.0
        elif setting.control_period is None:
            clock.control_every = 1
        else:
            clock.control_every = whole_steps(
                "control_period", setting.control_period, self.step_length
            )

    def instant(self, clock: Clock, time: float) -> float:
        """Return the instant of the method that is nearest to a time.

        Parameters
        ----------
        clock : Clock
            Clock of the simulation.
        time : float
            A time (s).

        Returns
        -------
        float
            The instant (s).
        """
        if self.step_length is None:
            return time
        return clock.start + round((time - clock.start) / self.step_length) * self.step_length

    def forget_ground(  # noqa: B027
        self, robot: Robot, work: Any, clock: Clock, *, stops: bool = False
    ) -> None:
        """Forget what touches the ground, because another has been laid.

        Parameters
        ----------
        robot : Robot
            The robot.
        work : Bundle
            Its bundle.
        clock : Clock
            Clock of the simulation.
        stops : bool
            Forget what touches joint stops, too: the robot has been moved.
        """

    def rows_in(self, duration: float, record_every: int) -> int:
        """Return about how many rows the record of a time has.

        Parameters
        ----------
        duration : float
            The time (s).
        record_every : int
            Steps between two rows.

        Returns
        -------
        int
            Rows.
        """
        return int(min(duration / (self.row_period[1] * record_every), 2.0**62)) + 2

    def reconsider(self, work: Any) -> None:  # noqa: B027 - most methods decide at every step
        """Look again at what was decided, for it has been changed from outside; nothing by default.

        Parameters
        ----------
        work : Bundle
            Its bundle.
        """

    def reason(self, work: Any) -> str:  # noqa: ARG002 - for those who know more
        """Say why a simulation could not go on; nothing if there is no more to say.

        Parameters
        ----------
        work : Bundle
            Its bundle, as the loop has left it.

        Returns
        -------
        str
            In a person's words.
        """
        return ""


def check_constraints(method: Method, setting: Setting) -> None:
    """Refuse constraints that a method cannot simulate, or that a state breaks.

    Raises
    ------
    SimulationError
        That says which, and what to do instead.
    """
    robot = setting.robot
    if not robot.constraints:
        return
    names = constraint_names(robot)
    for name, each in zip(names, robot.constraints, strict=True):
        if each.set not in method.holds:
            told = each.set.name.lower().replace("_", "-")
            raise SimulationError(
                f"{method.name} cannot simulate constraint {name}, whose set is a {told}; "
                "TimeStepping() can"
            )
    gaps = gaps_at(robot, setting.state)
    for name, each, gap in zip(names, robot.constraints, gaps, strict=True):
        open_by = float(np.max(np.abs(gap))) if is_line(each) else -float(gap[0])
        if each.set is not ImpulseSet.INTERVAL and not open_by <= OPEN_LOOP:
            raise SimulationError(
                f"in this state constraint {name} of robot {robot.name!r} is broken by "
                f"{open_by:.3g} (m, rad); begin where it holds"
            )


def work_of(method: Method, robot: Robot) -> Any:
    """Return a new bundle of a method for a robot, cast if it had one before."""
    settings: Any = method
    if not isinstance(settings, Hashable):
        return method.new_work(robot)
    molds = _MOLDS.setdefault(robot, {})
    if method not in molds:
        molds[method] = Mold(method.new_work(robot))
    return molds[method].cast()


_MOLDS: WeakKeyDictionary[Robot, dict[Method, Mold[Any]]] = WeakKeyDictionary()


@dataclass(frozen=True)
class UnknownMethod:
    """The settings of a method in a file whose class, or whose law's class, is unknown.

    Runs made with it can be looked at, compared and saved again, but not continued.
    """

    name: str
    """Name of its class."""
    settings: Mapping[str, str | int | float] = field(hash=False)
    """Its settings as they are in the file; those of a law begin with the law's name."""
    impulses_in_events: bool = False
    """Whether impulses of impacts are in the events of a run, not in the forces of its rows."""

    def doubts(
        self, robot: Robot, q: Floats, sunk: float = 0.0, past: float = 0.0,  # noqa: ARG002
    ) -> list[str]:  # fmt: skip
        """Say nothing: nothing is known of it.

        Parameters
        ----------
        robot : Robot
            The robot.
        q : (nq,) float
            A pose that it goes through.
        sunk : float
            How much deeper (m) in the ground it was than at the beginning.
        past : float
            How much farther (rad, m) a joint was beyond a stop than at the beginning.

        Returns
        -------
        list of str
            None.
        """
        return []


def solver_order(name: str) -> Integers:
    """Codes of the contact solvers in the order in which they are tried, `name` first."""
    try:
        return problem.solver_order(name)
    except ContactProblemError as error:
        raise SimulationError(str(error)) from None


def whole_steps(name: str, value: float, step: float) -> int:
    """Return how many steps make up a time, which must be a whole number of them."""
    steps = round(value / step)
    if steps < 1 or abs(steps * step - value) > 1e-6 * step:
        raise SimulationError(f"{name} = {value} s must be a whole number of steps of {step} s")
    return steps
