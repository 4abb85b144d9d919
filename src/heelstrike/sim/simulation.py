"""A simulation that can be stepped, pushed, kept and taken up again; and simulate()."""

from __future__ import annotations

import inspect
import operator
import sys
import time as clock_time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from numbers import Real
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn, Unpack, overload

import numpy as np
from numpy.typing import NDArray

from heelstrike.arguments import refusal, takes
from heelstrike.compiler.bundle import Bundle
from heelstrike.compiler.mold import Mold
from heelstrike.contact.ground import Ground
from heelstrike.errors import ControllerError, HeelstrikeError, SimulationError
from heelstrike.interruption import acknowledge
from heelstrike.robot.model import Floats
from heelstrike.robot.robot import Robot
from heelstrike.robot.spatial.robot import SpatialRobot
from heelstrike.robot.state import State
from heelstrike.robot.warning import warn
from heelstrike.sim.clock import Clock
from heelstrike.sim.closed_sets import EventKind, OnError, RunStatus
from heelstrike.sim.controller.control import ReadyLaw
from heelstrike.sim.controller.in_python import AskedLaw
from heelstrike.sim.controller.interface import Contacts, Controller, Partaking, read_only
from heelstrike.sim.controller.law import Law, law_of, no_torque
from heelstrike.sim.controller.raised import EndOfRun, tell
from heelstrike.sim.controller.robot import NO_ENDING
from heelstrike.sim.controller.watch import Watch
from heelstrike.sim.dimension import AnyRobot, dimension_of
from heelstrike.sim.frame import Outcome, compiled_loop, fixed_for
from heelstrike.sim.image import Camera
from heelstrike.sim.method import Method, work_of
from heelstrike.sim.push import Push, numbers_of_pushes, pushes_of_numbers, pushes_on
from heelstrike.sim.record.record import RowsAndEvents, allocate_record
from heelstrike.sim.run import Run, Timing, joined
from heelstrike.sim.setting import Setting, Setup, checked_pushes, checked_setting, identity_of
from heelstrike.sim.snapshot import Snapshot
from heelstrike.sim.time_stepping import SimulationWarning

if TYPE_CHECKING:
    from heelstrike.contact.spatial.ground import SpatialGround
    from heelstrike.sim.spatial.run import SpatialRun

# Rows of one chunk of the record, and most steps between two looks at Ctrl-C and the progress bar.
CHUNK = 4096
# Steps before the first look, and seconds that should pass between two.
FIRST_LOOK = 256
LOOK_EVERY = 0.05
# A pause that never comes, and a time (s).
NEVER = 2**62
FAR = 1e300
# Points deeper than this (m) in ground that is laid under them are in it.
LAID = 1e-6
# Vertical part of the normal of a face above which lowering the ground gets a point out of it.
UPWARDS = 0.1

_OUTCOMES = tuple(Outcome)
_CLOCK = Mold(Clock())

CAN_GO_ON = (RunStatus.COMPLETED, RunStatus.INTERRUPTED)


class Simulation:
    """A robot on the ground under a controller, at some instant.

    Parameters
    ----------
    robot : Robot or SpatialRobot
        The robot. Of one in space it is a
        :class:`~heelstrike.sim.spatial.SpatialSimulation`, which tells what is otherwise there.
    controller : object with ``torque(t, state, contacts)``, or None
        Decides the joint torques (nu,) in N m. Stock controllers run compiled; None applies no
        torque.
    state : State or Snapshot
        Where the robot starts; or a simulation to go on with, such as ``run.final``: its time,
        contact modes, pushes, ground and the memory of its controller are those of the snapshot.
    method : Method
        Simulation method; ``TimeStepping()`` by default.
    ground : Ground or SpatialGround
        The ground; flat with μ = 0.75 and no restitution by default.
    control_period : float, optional
        Time between two calls of the controller, in which its torques are held; a whole number of
        steps where the method has steps. By default that of the law, if it has a period; without
        one time stepping calls it every step, and under
        ``EventDriven`` and ``Compliant`` a compiled controller acts continuously; one in Python is
        called every millisecond by the former and at every sample by the latter.
    record_every : int
        Steps between two rows of the record.
    stop_when_fallen : bool, optional
        End the simulation when the height of the centre of mass above the ground drops below half
        of what it was at first. By default true for floating robots with several feet.
    pushes : sequence of Push
        Forces from outside, each on a point of the robot over a window of time.
    latched : iterable of str or int, optional
        Joints that their latches hold as it begins. By default those at rest at their latched end,
        unless the link whose touchdown lets go stands on the ground.
    braked : iterable of str or int
        Joints that their brakes hold as it begins, where they are. A controller in Python that has
        an attribute `braked`, or `latched`, says so itself at every call.
    checked : bool
        Run a compiled controller in Python and look at every index: one that reads or writes beyond
        its arrays, or writes where it may not, ends the run with a message that names the array and
        the index. Like any controller in Python it is then called every `control_period`.
    on_error : OnError or str
        What becomes of an error in the controller: ``"warn"`` tells of it in a
        :class:`~heelstrike.ControllerWarning` with its traceback, ``"raise"`` raises it, ``"stop"``
        does neither. The simulation ends in any case, and its record stays. An attribute, too.

    Attributes
    ----------
    status : RunStatus
        How it goes: ``COMPLETED`` and ``INTERRUPTED`` can go on, the others are its end.
    message : str
        The same in a person's words.
    error : BaseException or None
        What a controller or `progress` raised, or that there was no memory.

    Raises
    ------
    SimulationError, ControllerError
        If the arguments are not usable, or the state is not one that the method can begin with.

    Notes
    -----
    A simulation rests before the controller is asked: what is set acts at once. Methods whose steps
    are as long as accuracy allows end one where they are told to stop; so does their motion depend,
    within its tolerance, on where that is. Continued from ``run.final`` it does not.

    Examples
    --------
    >>> import heelstrike as hs
    >>> robot = hs.load_robot("compass_gait")
    >>> simulation = hs.Simulation(robot, state=robot.reference_state(), stop_when_fallen=False)
    >>> simulation.step().value, simulation.time
    ('completed', 0.001)
    >>> simulation.advance(0.01).value, simulation.time
    ('completed', 0.01)
    """

    def __new__(cls, robot: Any = None, *_: Any, **__: Any) -> Any:
        """Make one of space, where the robot is one in space."""
        if cls is Simulation and isinstance(robot, SpatialRobot):
            from heelstrike.sim.spatial.simulation import SpatialSimulation

            return super().__new__(SpatialSimulation)
        return super().__new__(cls)

    def __init_subclass__(cls, **options: Any) -> None:
        """Tell a subclass by the signature of its own beginning."""
        super().__init_subclass__(**options)
        cls.__signature__ = _of_init(cls.__init__)  # type: ignore[attr-defined]

    @takes(SimulationError)
    def __init__(
        self,
        robot: AnyRobot,
        controller: Controller | None = None,
        *,
        state: State | Snapshot,
        method: Method | None = None,
        ground: Ground | SpatialGround | None = None,
        control_period: float | None = None,
        record_every: int = 1,
        stop_when_fallen: bool | None = None,
        pushes: Sequence[Push] | Push = (),
        latched: Iterable[str | int] | None = None,
        braked: Iterable[str | int] = (),
        checked: bool = False,
        on_error: OnError | str = OnError.WARN,
    ) -> None:
        self._dimension = dimension_of(robot)
        begin, given = state.state if isinstance(state, Snapshot) else state, ground
        if isinstance(state, Snapshot) and ground is None:
            ground = self._ground_of(state)
        setting = checked_setting(
            robot, begin, ground=ground, control_period=control_period, record_every=record_every,
            stop_when_fallen=stop_when_fallen, pushes=pushes, latched=latched, braked=braked,
            checked=checked, on_error=on_error,
        )  # fmt: skip
        law_of(controller, begin=self._dimension.compiles_meanwhile)
        self._begin(setting, self._dimension.way(method))
        self._control_with(controller)
        if isinstance(state, Snapshot):
            self.restore(state)
            if given is not None:
                self.ground = given
            if stop_when_fallen is not None and (
                not stop_when_fallen or not np.isfinite(self._clock.fallen_height)
            ):
                self._clock.fallen_height = setting.fallen_height
            self.apply(setting.pushes)
            if latched is not None:
                self.latched = latched
            if any(setting.braked):
                self.braked = braked

    def __reduce__(self) -> NoReturn:
        """Copies would share memory that compiled code finds by address."""
        raise TypeError(
            "a simulation cannot be copied or pickled: begin another one with "
            "state=simulation.snapshot()"
        )

    def _begin(
        self, setting: Setting, way: Method, memory: Any = None, clock: Clock | None = None,
        keep_rows: bool = True,
    ) -> None:  # fmt: skip
        """Allocate everything, compile, and check what only the method can.

        Parameters
        ----------
        setting, way
            What to simulate, and how its dimension goes through time.
        memory : Memory or SpatialMemory, optional
            Memory to use, as the dimension makes it for this robot and these pushes. A batch gives
            it, which has checked everything before any of it begins.
        clock : Clock, optional
            Clock to use.
        keep_rows : bool
            Whether rows and events are kept; otherwise they are counted and forgotten.
        """
        self.robot, self._way, self._setting = setting.robot, way, setting
        self.method = way.asked_for
        self._dimension = dimension = dimension_of(self.robot)
        self._given_period = setting.control_period
        self._ground, self._pushes = setting.ground, setting.pushes
        self._has_warned = False
        if memory is None:
            self._check(setting)
        self._memory = dimension.new_memory(setting) if memory is None else memory
        dimension.begin(setting, self._memory)
        self._work = work_of(way, self.robot)
        rows, events = way.room(self.robot)
        self._clock = clock = _CLOCK.cast() if clock is None else clock
        clock.record_every, clock.fallen_height = setting.record_every, setting.fallen_height
        clock.row_margin, clock.event_margin = rows, events
        way.set_clock(setting, self._clock)
        for bundle in (self._memory, self._work, self._clock, setting.ground.model()):
            _ = bundle.address  # laid out now, not while the loop is timed
        self._compile_s, self._wall_s = self._choose_loop(), 0.0
        self._fork: Snapshot | None = None
        self._cameras: tuple[tuple[Any, Any], Any] = ((None, None), None)
        self._around: tuple[tuple[Any, Any], dict[str, Any]] = ((None, None), {})
        self._look = dimension.look(self.robot)
        self._records: list[RowsAndEvents] = []
        self._keeps_rows = keep_rows
        self._event_counts = np.zeros(len(EventKind), dtype=np.int64)
        self._recorded_until = 0.0
        self._complaint = ""
        self.on_error = setting.on_error
        self.status = RunStatus.COMPLETED
        self.message = "not begun"
        self.error: BaseException | None = None

    def _choose_loop(self) -> float:
        """Take the loop that is made for what this robot, ground and method do not have."""
        way = self._way
        fixed = fixed_for(self.robot, self._ground.model(), self._work, way)
        self._loop, compile_s = compiled_loop(way.kernels, way.work, fixed)
        return compile_s

    @property
    def time(self) -> float:
        """Simulated time now, in s."""
        return self._clock.time

    @property
    def state(self) -> State:
        """Position and velocity now; another may be set, but none with a foot in the ground."""
        return State(self._memory.q, self._memory.v)

    @state.setter
    def state(self, state: State) -> None:
        state = self._dimension.checked_state(self.robot, state)
        deep, _ = self._depth(state, self._ground)
        if deep.any():
            point = int(np.argmax(deep))
            raise SimulationError(
                f"contact point {self.robot.contact_names[point]!r} would be {deep[point]:.3g} m "
                f"in the ground; {self._dimension.way_out(self._ground)}"
            )
        self._dimension.held(self.robot, state, self._ground, self.latched, ())
        self._check(replace(self._setting, ground=self._ground, state=state))
        memory = self._memory
        memory.q[:], memory.v[:] = state.q, state.v
        self._dimension.moved(state, self.robot, memory)
        memory.contacts.force[:] = 0.0
        memory.reported.forget()
        self._way.forget_ground(self.robot, self._work, self._clock, stops=True)
        self._reconsider()

    @property
    def contacts(self) -> Contacts:
        """Contact points now, with the forces of the step before."""
        return self._look.at_contacts(self._ground, self._memory)

    @property
    def ground(self) -> Any:
        """The ground; another may be laid, but not into a foot."""
        return self._ground

    @ground.setter
    def ground(self, ground: Ground | SpatialGround) -> None:
        ground = self._dimension.checked_ground(ground)
        deep, upwards = self._depth(self.state, ground)
        if deep.any():
            point, sunk = int(np.argmax(deep)), deep > 0.0
            name = self.robot.contact_names[point]
            if np.all(upwards[sunk] > UPWARDS):
                lower = float(np.max(deep[sunk] / upwards[sunk]))
                raise SimulationError(
                    f"this ground would be {deep[point]:.3g} m above contact point {name!r}; lower "
                    f"it by {lower:.3g} m, or raise the robot first"
                )
            raise SimulationError(
                f"contact point {name!r} would be {deep[point]:.3g} m in this ground, behind a "
                "wall; move the ground or the robot away first"
            )
        self._check(replace(self._setting, ground=ground, state=self.state))
        if not _are_alike(self._ground.numbers(), ground.numbers()):
            self._dimension.check_fit(ground, self._memory)
            self._way.forget_ground(self.robot, self._work, self._clock)
            self._dimension.laid(self._memory)
            self._clock.moving = 0
        self._ground = ground
        self._choose_loop()

    def _check(self, setting: Setting) -> None:
        """Refuse what the method cannot simulate, and warn of what it can hardly, once."""
        self._dimension.check(self._way, setting)
        self._has_warned = self._has_warned or has_warned(self._way, setting)

    def _reconsider(self) -> None:
        """Decide this instant again, even if it had been: what it depends on has been changed."""
        self._clock.moving = 0
        self._way.reconsider(self._work)

    def _depth(self, state: State, ground: Any) -> tuple[Floats, Floats]:
        """How deep points would be in a ground, (nc,) in m; 0 of those no deeper than now.

        And how far up its normals point there.
        """
        gap, upwards = self._dimension.gaps(self.robot, state, ground)
        now = float(np.min(self.contacts.gap, initial=0.0))
        return np.where(gap < min(-LAID, now - LAID), -gap, 0.0), upwards

    @property
    def latched(self) -> tuple[str, ...]:
        """Joints that latches hold; when others are set, the latches of the rest let go at once."""
        return self._dimension.latched(self.robot, self._memory)

    @latched.setter
    def latched(self, joints: Iterable[str | int]) -> None:
        self._dimension.latch(self.robot, self.state, self._ground, joints, self._memory)
        self._reconsider()

    @property
    def braked(self) -> tuple[str, ...]:
        """Joints whose brakes are on; others that are set are held from now on, where they are.

        The brakes of the rest let go at once.
        """
        return self._dimension.braked(self.robot, self._memory)

    @braked.setter
    def braked(self, joints: Iterable[str | int]) -> None:
        self._dimension.brake(self.robot, self.state, joints, self._memory)
        self._reconsider()

    @property
    def controller(self) -> Controller | None:
        """What decides the torques; one that is set starts again."""
        return self._controller

    @controller.setter
    def controller(self, controller: Controller | None) -> None:
        self._control_with(controller)

    @property
    def control_period(self) -> float:
        """Seconds between two calls of the controller; zero of one that acts continuously."""
        step, clock = self._way.step_length, self._clock
        return clock.control_period if step is None else clock.control_every * step

    @property
    def parameters(self) -> Bundle:
        """Numbers of a law; what is written into them, or all when others are set, acts at once."""
        return self._numbers.parameters

    @parameters.setter
    def parameters(self, parameters: Bundle) -> None:
        self._numbers.set_parameters(parameters)

    @property
    def memory(self) -> Bundle:
        """What a law remembers now; what is written into it, it remembers at its next call."""
        return self._numbers.memory

    @property
    def log(self) -> Bundle:
        """What a controller told of itself when it was last called."""
        return self._logs.log

    @takes(SimulationError)
    def apply(self, push: Push | Sequence[Push]) -> None:
        """Let a push act, from its beginning or from now on, whichever is later.

        Parameters
        ----------
        push : Push or sequence of Push
            What pushes, with its own beginning and duration.

        Raises
        ------
        SimulationError
            If the robot has no such link, or the push would be over.
        """
        added = checked_pushes(self.robot, push)
        for each in added:
            if each.end < self.time:
                raise SimulationError(
                    f"the push on {each.link!r} ends at t = {each.end:.6g} s, before the present "
                    f"time, {self._now}: let it start later"
                )
        self._pushes += added
        pushes = pushes_on(self.robot, self._pushes)
        share = self._memory.pushes.share  # of those that act
        pushes.share[: len(share)] = share
        self._memory = self._memory.replaced(pushes=pushes)
        if added:
            self._clock.moving = 0

    def step(self) -> RunStatus:
        """Take one step of the method; return how the simulation goes.

        Raises
        ------
        SimulationError
            If the simulation has come to its end.
        Exception
            With ``on_error="raise"``, what the controller raised.
        """
        return self._advance(FAR, self._clock.index + 1)

    def advance(
        self, until: float, *, progress: Callable[[float], None] | None = None
    ) -> RunStatus:
        """Simulate until a time, or until something ends it; return how it goes.

        Parameters
        ----------
        until : float
            Simulated time to stop at, in s; time stepping rounds it to a whole number of steps.
        progress : callable, optional
            Called now and then with the simulated time. If it raises, the simulation stops there,
            with status ``interrupted``.

        Returns
        -------
        RunStatus
            ``COMPLETED`` at that time; after Ctrl-C ``INTERRUPTED``, from where it can go on.

        Raises
        ------
        SimulationError
            If the simulation has come to its end, the time is past, or there is no room for the
            record.
        Exception
            With ``on_error="raise"``, what the controller raised.
        """
        return self._advance(self._instant(until), NEVER, progress)

    def _instant(self, until: float) -> float:
        """Return the instant of the method at which what is to be simulated until a time ends."""
        instant = -np.inf
        given: object = until
        if not isinstance(given, Real):  # cheaper than a look at all arguments: calls are many
            raise SimulationError(refusal("until", given, ("float",)))
        if np.isfinite(until):
            self._way.check_span(self._setting, max(until - self.time, 0.0))
            instant = self._way.instant(self._clock, until)
        if instant < self.time:
            raise SimulationError(
                f"until must not be before the present time, {self._now}; got {until}"
            )
        return instant

    def _advance(
        self, until: float, pause: int, progress: Callable[[float], None] | None = None,
        stopped: Callable[[], bool] | None = None,
    ) -> RunStatus:  # fmt: skip
        if self.status not in CAN_GO_ON:
            raise SimulationError(
                f"the simulation has ended: {self.message}. Restore a snapshot to go on from there"
            )
        begin = clock_time.perf_counter()
        self._clock.until = until
        self._clock.forked = 0
        self._fork = None
        self._complaint = ""
        self.error = None
        try:
            self.status, self.message = self._go(pause, progress, stopped)
        except KeyboardInterrupt as interrupt:
            acknowledge(interrupt)
            self.status, self.message = RunStatus.INTERRUPTED, f"interrupted at {self._now}"
        self._wall_s += clock_time.perf_counter() - begin
        self._tell_error(self.status, self.message)
        return self.status

    def _tell_error(self, status: RunStatus, message: str) -> None:
        """Do with an error in the controller as `on_error` says."""
        if status is RunStatus.CONTROLLER_FAILED and self.error is not None:
            tell(message, self.error, self.on_error)

    def _go(
        self,
        last: int,
        progress: Callable[[float], None] | None = None,
        stopped: Callable[[], bool] | None = None,
    ) -> tuple[RunStatus, str]:
        """Run the loop, with a look now and then at progress, Ctrl-C and the controller."""
        steps = FIRST_LOOK
        while True:
            self._clock.pause = min(last, self._clock.index + steps)
            begin = clock_time.perf_counter()
            code = self._run_loop()
            elapsed = clock_time.perf_counter() - begin
            misdeed = self._watch.misdeed()
            if misdeed is not None:
                return self._failed(
                    f"{self._name} {misdeed}; noticed at {self._now}"
                    + ("" if self._python else ". simulate(..., checked=True) tells more")
                )
            self._report(progress)
            if isinstance(code, tuple):
                return code
            if code is not Outcome.PAUSED or self._clock.index >= last:
                status, message = self._ending(code)
                return status, f"{message}; {self._complaint}" if self._complaint else message
            if self._complaint or (stopped is not None and stopped()):
                more = f": {self._complaint}" if self._complaint else ""
                return RunStatus.INTERRUPTED, f"interrupted at {self._now}{more}"
            steps = int(min(CHUNK, max(1.0, steps * min(4.0, LOOK_EVERY / max(elapsed, 1e-9)))))

    def _run_loop(self) -> Outcome | tuple[RunStatus, str]:
        """Run the loop until it pauses or ends, with what it needs from Python."""
        if not self._records:
            self._new_record()
        while True:
            try:
                outcome = _OUTCOMES[
                    self._loop.call(
                        self.robot.model, self._ground.model(), self._control, self._memory,
                        self._work, self._records[-1], self._clock,
                    )
                ]  # fmt: skip
                wrong = self._ask() if outcome is Outcome.ASKING else ""
            except KeyboardInterrupt:
                raise
            except EndOfRun as end:  # of a compiled law: this instant stays undecided
                return RunStatus.STOPPED, self._stopped(str(end))
            except BaseException as error:  # of the controller: loops raise nothing
                self.error = error
                return Outcome.RAISED
            if wrong:
                return self._failed(wrong)
            if outcome is Outcome.RECORD_FULL:
                if full := self._new_record():
                    return RunStatus.INTERRUPTED, full
            elif outcome is Outcome.FORK:
                self._fork = self.snapshot() if self._can_be_kept else None
            elif outcome is not Outcome.ASKING:
                return outcome

    def _failed(self, message: str) -> tuple[RunStatus, str]:
        """Return how a controller ends the simulation that did what it may not."""
        self.error = ControllerError(message)
        return RunStatus.CONTROLLER_FAILED, message

    def _report(self, progress: Callable[[float], None] | None) -> None:
        """Report progress; keep in mind what went wrong with that, if something did."""
        if progress is None:
            return
        try:
            progress(self.time)
        except KeyboardInterrupt:
            raise
        except BaseException as error:
            self.error = error if self.error is None else self.error
            self._complaint = f"progress raised {_raised(error)}"

    def _ask(self) -> str:
        """Ask a controller in Python for torques; return what is wrong with them."""
        ending = self._control.robot
        torque: Floats = self._memory.command
        try:
            torque = np.asarray(
                self._python.torque(self.time, self.state, self._shown), dtype=np.float64
            )
        except EndOfRun as end:
            self._why_stopped, ending.ending = str(end), 0
        else:
            ending.ending = self._numbers.control.robot.ending
        if torque.shape != (self.robot.nu,):
            return (
                f"{self._name} returned shape {torque.shape} at {self._now}; robot "
                f"{self.robot.name!r} needs ({self.robot.nu},): "
                f"{', '.join(self.robot.actuator_names)}"
            )
        self._memory.command[:] = torque
        self._clock.answered = 1
        self._obey()
        told = self._numbers.log if isinstance(self._python, AskedLaw) else self._python_log
        if told is not None:
            self._logs.log.become(told)
        return ""

    def _obey(self) -> None:
        """Let the brakes and latches hold that a controller in Python names, and no others."""
        python = self._python.partner if isinstance(self._python, AskedLaw) else self._python
        braked, latched = getattr(python, "braked", None), getattr(python, "latched", None)
        if braked is not None and self._dimension.would_brake(self.robot, braked, self._memory):
            self.braked = braked
        if latched is not None:
            kept = self._dimension.still_latched(self.robot, latched, self._memory)
            if len(kept) < len(self.latched):
                self.latched = kept

    @property
    def _now(self) -> str:
        return f"t = {self.time:.6g} s"

    def _ending(self, outcome: Outcome) -> tuple[RunStatus, str]:
        if outcome in (Outcome.DONE, Outcome.PAUSED):
            return RunStatus.COMPLETED, f"completed at {self._now}"
        if outcome is Outcome.FELL:
            return RunStatus.FELL, (
                f"the robot fell at {self._now}: its centre of mass is below half its first height"
            )
        if outcome is Outcome.STOPPED:
            return RunStatus.STOPPED, self._stopped(self._why_stopped)
        if outcome is Outcome.RAISED:
            assert self.error is not None
            if isinstance(self._python, AskedLaw) and isinstance(self.error, ControllerError):
                return RunStatus.CONTROLLER_FAILED, f"{self.error} (at {self._now})"
            beyond = isinstance(self.error, IndexError) and not self._python
            more = "; simulate(..., checked=True) names the array and the index" if beyond else ""
            return RunStatus.CONTROLLER_FAILED, (
                f"{self._name} raised {_raised(self.error)} at {self._now} (the exception is in "
                f"run.error){more}"
            )
        tally = self._memory.tally
        if outcome is Outcome.DIVERGED and tally.bad_trial > 0:
            return self._not_finite(tally.bad_trial - 1, f"in the step after {self._now}")
        if outcome is Outcome.DIVERGED:
            reason = self._way.reason(self._work)
            return RunStatus.DIVERGED, (
                f"the simulation could not go on at {self._now}: {reason}"
                if reason
                else f"the state stopped being finite at {self._now}; try a smaller step or softer "
                f"gains{self._doubts}"
            )
        if outcome is Outcome.SOLVER_FAILED:
            reason = self._way.reason(self._work)
            return RunStatus.SOLVER_FAILED, (
                f"{self._dimension.unsolved(self._now, self._memory)}{reason and f'. {reason}'}"
                f"{self._doubts}"
            )
        return self._not_finite(tally.bad_torque, f"at {self._now}")

    @property
    def _doubts(self) -> str:
        doubts = self._way.doubts(self.robot, self._setting.state.q)
        return "".join(f". {doubt[0].upper()}{doubt[1:]}" for doubt in doubts)

    def _stopped(self, why: str) -> str:
        """Say that the controller ended the run, and why."""
        number = self._control.robot.ending
        if not why and number < len(self._endings):
            why = self._endings[number]
        return f"the controller ended the run at {self._now}: {why or f'ending {number}'}"

    def _not_finite(self, actuator: int, when: str) -> tuple[RunStatus, str]:
        return RunStatus.CONTROLLER_FAILED, (
            f"the controller asked for a torque that is not finite {when}, actuator "
            f"{self.robot.actuator_names[actuator]!r}"
        )

    def _new_record(self) -> str:
        """Make room for more rows and events; say what is wrong where there is none."""
        if self._records and not self._keeps_rows:
            self._count_events(self._records[-1])
            return ""
        clock = self._clock
        rows = self._way.rows_in(clock.until - clock.time, clock.record_every)
        # What goes on piece by piece makes room for as much again as there is.
        rows = max(rows, sum(record.rows for record in self._records))
        rows = min(CHUNK, rows + clock.row_margin)
        try:
            words = self._control.logged.size
            record = allocate_record(self.robot, rows, 256 + 2 * clock.event_margin, words)
        except MemoryError as error:
            if not self._records:
                raise SimulationError(
                    "there is no memory left for the record; use a larger record_every, or "
                    "the simulation's forget() from time to time"
                ) from error
            self.error = error
            return (
                f"stopped at {self._now}: there is no memory left to record more; what was "
                "recorded until then is kept. A larger record_every takes less"
            )
        self._records.append(record)
        return ""

    def _count_events(self, record: RowsAndEvents) -> None:
        """Count the events of a record and forget it."""
        kinds = record.told.event_kind[: record.told.events]
        self._event_counts += np.bincount(kinds, minlength=len(EventKind))
        record.rows = record.told.events = record.logged = 0

    def _control_with(self, controller: Controller | None) -> None:
        """Begin with a controller, or stay with the one before if this one cannot be used."""
        robot, memory, clock = self.robot, self._memory, self._clock
        law = law_of(controller)
        setting = self._setting
        own_period = None if law is None else law.period
        if self._given_period is None:
            if setting.control_period != own_period:
                setting = replace(setting, control_period=own_period)
        elif law is not None and law.keeps_period and setting.control_period != law.period:
            raise ControllerError(
                f"controller {law.function.name!r} has its own period of {law.period} s: leave "
                f"control_period = {setting.control_period} s out, or give it that period"
            )
        python: Any = controller if law is None else None
        if law is not None and controller is not None:
            in_python = setting.checked or not law.function.compiles
            python = AskedLaw(robot, law, checked=setting.checked) if in_python else None
        compiled = Law(no_torque) if law is None or python is not None else law
        told = getattr(controller, "log", None) if law is None else None
        told = told if isinstance(told, Bundle) else None
        begin = python.numbers.log if isinstance(python, AskedLaw) else told
        ready = ReadyLaw(robot, compiled, memory.equations.tree, memory.contacts, begin)
        if self._records and self._records[-1].log.shape[1] != ready.control.logged.size:
            raise SimulationError(
                "this controller has another log than the one before, and rows are recorded: "
                "start a new simulation with it, from state=simulation.state"
            )
        ready.control.function[:] = self._dimension.words_of(compiled)
        _ = ready.control.address
        voltage = self._dimension.commands_voltage(controller, robot)
        self._way.set_clock(setting, clock)
        self._setting, self._logs, self._python_log = setting, ready, told
        self._controller, self._python, self._control = controller, python, ready.control
        self._numbers = python.numbers if isinstance(python, AskedLaw) else ready
        self._endings = () if law is None else law.function.endings
        self._why_stopped = ""
        self._control.voltage = voltage
        self._name: str = f"{type(controller).__name__}.torque"
        self._decides = _place(type(controller) if law is None else law.function.python)
        self._decides += " (voltages)" if voltage else ""
        if python is not None:
            self._shown: Contacts = read_only(memory.contacts)
        if law is not None:
            self._name = f"controller {law.function.name!r}"
        self._dimension.take_gains(robot, law, voltage, memory)
        self._identity = identity_of(setting, self.method, self._decides)
        if python is None:
            self._control.continuous = setting.control_period is None and controller is not None
        else:
            self._control.in_python = 1
            if setting.control_period is None and self._way.python_period is not None:
                clock.control_period = self._way.python_period
        self._numbers.control.robot.period = self.control_period
        if self._way.step_length is not None:
            step, steps = self._way.step_length, clock.control_every
            self._dimension.doubt_gains(robot, law, memory, step, steps)
        # It is due at once, and then at the whole periods, as if it had been called all the time.
        period = clock.control_period
        clock.calls = int(clock.time / period + 1e-9) if period > 0.0 else 0
        clock.answered = 0
        known = self._numbers.robot
        self._watch = Watch((robot,) if known is robot else (robot, known), ready, memory)

    def snapshot(self) -> Snapshot:
        """Return everything that the further course depends on.

        Raises
        ------
        ControllerError
            If a controller in Python does not take part: it needs methods ``snapshot()``, which
            returns an array of numbers, and ``restore(numbers)``.
        """
        taken = self._camera(self._memory).take()
        beside: dict[str, Any] = {"time": np.array(self.time), **self._surroundings()}
        if self._python is not None:
            beside["controller"] = np.array(_partaking(self._python, self._name).snapshot())
        return Snapshot.pictured(beside, dict(self._identity), taken)

    def restore(self, snapshot: Snapshot) -> None:
        """Be again as a simulation was; the record starts again.

        Parameters
        ----------
        snapshot : Snapshot
            Of this simulation, or of one of the same robot, method and controller, in this process
            or another.

        Raises
        ------
        SimulationError, ControllerError
            If it is one of another robot, method or controller, or damaged.
        """
        if not isinstance(snapshot, Snapshot):
            raise SimulationError(f"restore takes a Snapshot, got {type(snapshot).__name__}")
        for what, mine in self._identity.items():
            its = snapshot.identity.get(what)
            if its != mine:
                raise SimulationError(
                    f"the snapshot has another {what}, {its}; the simulation has {mine}"
                )
        self._put_back(snapshot)
        self._recorded_until = snapshot.time
        self._records.clear()
        self._fork = None
        self.status, self.message = RunStatus.COMPLETED, f"restored at {self._now}"
        self.error = None

    def forget(self) -> None:
        """Forget what was: the record starts again, and pushes that are over are gone from it.

        How it goes on does not change. For simulations without an end, whose record is looked at
        piece by piece.
        """
        self._recorded_until = self.time
        self._records.clear()
        if any(push.end < self.time for push in self._pushes):
            kept = [i for i, push in enumerate(self._pushes) if push.end >= self.time]
            share = self._memory.pushes.share[kept].copy()
            self._pushes = tuple(self._pushes[i] for i in kept)
            pushes = pushes_on(self.robot, self._pushes)
            pushes.share[:] = share
            self._memory = self._memory.replaced(pushes=pushes)

    def _ground_of(self, snapshot: Snapshot) -> Any:
        try:
            return self._dimension.ground_of(snapshot.part("ground"))
        except (KeyError, ValueError) as error:
            raise SimulationError(f"the snapshot is damaged: {error}") from error

    def _put_back(self, snapshot: Snapshot) -> None:
        """Take up what a snapshot holds, or leave everything as it is."""
        beside, taken = snapshot.beside, snapshot.taken
        memory, pushes, ground = self._memory, self._pushes, self._ground
        try:
            float(beside["time"])
            now = self._surroundings()
            if not all(map(operator.is_, map(beside.get, now), now.values())):
                pushes, ground = pushes_of_numbers(snapshot.part("push")), self._ground_of(snapshot)
                self._dimension.check_fit(ground, memory)
                memory = memory.replaced(pushes=pushes_on(self.robot, pushes))
            camera = self._camera(memory)
            if taken is None or snapshot.is_named or not camera.fits(taken):
                taken = camera.image_of(snapshot.arrays, taken)
            if self._python is not None:
                _partaking(self._python, self._name).restore(beside["controller"].copy())
        except HeelstrikeError:
            raise
        except (KeyError, ValueError) as error:
            raise SimulationError(f"the snapshot is damaged: {error}") from error
        camera.put_back(taken)
        self._memory, self._pushes = memory, pushes
        if ground is not self._ground:
            self._ground = ground
            self._choose_loop()
        self._why_stopped = ""
        self._clock.finishing = 0  # of one that its controller has ended
        for numbers in (self._control, self._numbers.control):
            numbers.robot.ending = NO_ENDING

    @property
    def _bundles(self) -> dict[str, Bundle]:
        """All that changes as it goes on, by how its names begin in snapshots."""
        return {
            "clock.": self._clock, "memory.": self._memory, "work.": self._work,
            "control.": self._control,
        }  # fmt: skip

    def _camera(self, memory: Any) -> Camera:
        """Return what takes images of all that changes as a simulation goes on."""
        of, camera = self._cameras
        if of[0] is not memory or of[1] is not self._control:
            camera = Camera((self._bundles | {"memory.": memory}).items())
            self._cameras = (memory, self._control), camera
        return camera

    def _surroundings(self) -> dict[str, Any]:
        """Return ground and pushes as arrays, the same as long as they are the same."""
        of, arrays = self._around
        if of[0] is not self._ground or of[1] is not self._pushes:
            arrays = {f"ground.{name}": each for name, each in self._ground.numbers().items()}
            pushes = numbers_of_pushes(self.robot, self._pushes)
            arrays |= {f"push.{name}": each for name, each in pushes.items()}
            arrays = {name: each.view() for name, each in arrays.items()}
            for each in arrays.values():
                each.flags.writeable = False
            self._around = (self._ground, self._pushes), arrays
        return arrays

    @property
    def record(self) -> Any:
        """Everything since the simulation began or was restored, up to now.

        The last row is this instant, for which the controller is asked and forces are found. That
        is forgotten again; where a controller in Python takes no part in snapshots it is not asked,
        and the record ends a step before.
        """
        if self.status is not RunStatus.COMPLETED or not self._can_be_kept:
            return self._run(self.status, self.message)
        now = self.snapshot()
        counts = [(record.rows, record.told.events) for record in self._records]
        own = self._pushes, self._ground, self.error
        try:
            return self._run(*self._decide_last(), final=now)
        finally:
            self._put_back(now)
            self._pushes, self._ground, self.error = own
            del self._records[len(counts) :]
            for record, (rows, events) in zip(self._records, counts, strict=True):
                record.rows, record.told.events, record.logged = rows, events, rows

    @property
    def _can_be_kept(self) -> bool:
        if isinstance(self._python, AskedLaw):
            return self._python.takes_part
        return self._python is None or isinstance(self._python, Partaking)

    def _decide_last(self) -> tuple[RunStatus, str]:
        """Decide and record this instant; return how that went."""
        if self.status is not RunStatus.COMPLETED:
            return self.status, self.message
        self._clock.finishing = 1
        try:
            return self._go(NEVER)
        except KeyboardInterrupt as interrupt:  # too late for anything to be lost
            acknowledge(interrupt)
            return RunStatus.INTERRUPTED, f"interrupted at {self._now}"
        finally:
            self._clock.finishing = 0

    def _final(self) -> Snapshot | None:
        """Return what goes on as if it had not been told to stop here."""
        if not self._can_be_kept:
            return None
        final = self.snapshot() if self._fork is None else self._fork
        return final.at(self.time)

    def _run(self, status: RunStatus, message: str, final: Snapshot | None = None) -> Any:
        """Return what is recorded as a run, which goes on from `final`."""
        if not self._records:
            self._new_record()
        dimension = self._dimension
        return dimension.run(
            robot=self.robot,
            ground=self._ground,
            method=self.method,
            status=status,
            message=message,
            **joined(self._records, dimension.quantities, self._recorded_until, self._logs.log),
            **dimension.tallied(self._memory, self._way.solves_with),
            timing=Timing(self._compile_s, self._wall_s),
            error=self.error,
            pushes=self._pushes,
            final=final,
        )


def _of_init(function: Callable[..., Any]) -> inspect.Signature:
    """Signature of a class by that of what begins one, not by what chooses between classes."""
    whole = inspect.signature(function)
    return whole.replace(parameters=list(whole.parameters.values())[1:])


Simulation.__signature__ = _of_init(Simulation.__init__)  # type: ignore[attr-defined]


@overload
def simulate(
    robot: Robot, controller: Controller | None = None, *, duration: float,
    progress: Callable[[float], None] | None = None, **setup: Unpack[Setup],
) -> Run: ...  # fmt: skip


@overload
def simulate(
    robot: SpatialRobot, controller: Controller | None = None, *, duration: float,
    progress: Callable[[float], None] | None = None, **setup: Unpack[Setup],
) -> SpatialRun: ...  # fmt: skip


@takes(SimulationError)
def simulate(
    robot: AnyRobot,
    controller: Controller | None = None,
    *,
    duration: float,
    progress: Callable[[float], None] | None = None,
    **setup: Any,
) -> Run | SpatialRun:
    """Simulate a robot on the ground under a controller.

    Parameters
    ----------
    robot : Robot or SpatialRobot
        The robot.
    controller : object with ``torque(t, state, contacts)``, or None
        Decides the joint torques; None applies none.
    duration : float
        Time to simulate in seconds; time stepping rounds it to a whole number of steps.
    progress : callable, optional
        Called now and then with the simulated time. If it raises, the run ends there, with status
        ``interrupted``.
    **setup
        How it begins and what it is simulated with: `state`, which has to be given, `method`,
        `ground`, `control_period`, `record_every`, `stop_when_fallen`, `pushes`, `latched`,
        `braked`, `checked`, `on_error`; see :class:`Simulation`.

    Returns
    -------
    Run or SpatialRun
        Everything that happened, also after a fall, a failure or Ctrl-C; see ``run.status``. A
        controller that raises anything but KeyboardInterrupt, even SystemExit, ends the run with
        status ``controller_failed``, as does one that writes beyond its arrays, changes the robot,
        or returns torques of the wrong shape; the error is in ``run.error``, and `on_error` says
        what else becomes of it. Torques that are not finite end the run with that status, too, but
        are no error. While compiling, when there is nothing to keep, Ctrl-C raises
        KeyboardInterrupt.

    Raises
    ------
    SimulationError, ControllerError
        If the arguments are not usable, or the state is not one that the method can begin with;
        raised before anything is simulated.
    Exception
        With ``on_error="raise"``, what the controller raised.
    """
    check_duration(duration)
    simulation = Simulation(robot, controller, **setup)
    going = simulation.advance(simulation._recorded_until + duration, progress=progress)
    final = simulation._final()
    status, message = simulation._decide_last()
    if status is not going:  # the last call of the controller is one more
        simulation._tell_error(status, message)
    return simulation._run(status, message, final=final)


def has_warned(method: Method, setting: Setting) -> bool:
    """Warn of what a run should not begin without being told; return whether there is any."""
    doubt = method.warning(setting)
    if doubt:
        warn(doubt, SimulationWarning)
    return bool(doubt)


def check_duration(duration: float) -> None:
    """Refuse a duration that is none."""
    if not (np.isfinite(duration) and duration >= 0.0):
        raise SimulationError(f"duration must be a finite number ≥ 0, got {duration}")


def _are_alike(mine: Mapping[str, NDArray[Any]], its: Mapping[str, NDArray[Any]]) -> bool:
    """Whether two grounds have the same numbers; NaN, which a box has of its ground, is one."""
    return mine.keys() == its.keys() and all(
        np.array_equal(mine[name], its[name], equal_nan=mine[name].dtype.kind == "f")
        for name in mine
    )


def _place(thing: Any) -> str:
    """Say where a class or function is defined: the same in any process."""
    module = thing.__module__
    if module == "__main__":  # a script, which others may import
        module = Path(getattr(sys.modules[module], "__file__", None) or module).stem
    return f"{module}.{thing.__qualname__}"


def _partaking(controller: Any, name: str) -> Partaking:
    asked = controller.partner if isinstance(controller, AskedLaw) else None
    if not isinstance(controller if asked is None else asked, Partaking):
        raise ControllerError(
            f"{name} takes no part in snapshots: give its class methods snapshot(), which returns "
            "an array of numbers, and restore(numbers)"
        )
    return controller


def _raised(error: BaseException) -> str:
    """Return kind and words of an exception."""
    return f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
