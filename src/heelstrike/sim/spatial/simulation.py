"""A simulation in space that can be stepped, pushed, kept and taken up again; and simulate()."""

from __future__ import annotations

import time as clock_time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import field
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from heelstrike.arguments import takes
from heelstrike.compiler.bundle import Bundle
from heelstrike.contact.ground import Ground
from heelstrike.contact.spatial.ground import SpatialGround
from heelstrike.errors import ControllerError, SimulationError
from heelstrike.field_texts import dataclass
from heelstrike.interruption import acknowledge
from heelstrike.robot.spatial.robot import SpatialRobot, checked_state
from heelstrike.robot.state import State
from heelstrike.sim.closed_sets import OnError, RunStatus, Scheme
from heelstrike.sim.controller.interface import Contacts, Controller, Partaking, read_only
from heelstrike.sim.controller.law import Law, law_of, no_torque
from heelstrike.sim.controller.raised import EndOfRun, tell
from heelstrike.sim.controller.watch import numbers_of, restored
from heelstrike.sim.frame import Outcome
from heelstrike.sim.method import Method, whole_steps
from heelstrike.sim.push import Push
from heelstrike.sim.run import Timing
from heelstrike.sim.setting import FALL_FRACTION, Setup, checked_on_error
from heelstrike.sim.spatial.controlled import GOES_ON, ReadySpatialLaw, words_in_space
from heelstrike.sim.spatial.loop import SpatialClock, height_of_mass, spatial_loop
from heelstrike.sim.spatial.memory import allocate_spatial_memory
from heelstrike.sim.spatial.pushes import spatial_pushes
from heelstrike.sim.spatial.record import SpatialRecord, allocate_spatial_record
from heelstrike.sim.spatial.run import SpatialRun, counts_of, joined_records
from heelstrike.sim.spatial.stepping import find_state
from heelstrike.sim.time_stepping import TimeStepping

ROWS = 4096
"""Most rows of one piece of the record."""

FIRST_STEPS, LOOK_AFTER = 256, 0.05
"""Steps before the first look at Ctrl-C and progress, and seconds between two."""

BY_NATURE = (
    "in space a point that begins to slide chooses among all directions, and comes to rest by "
    "stopping in two of them at once: events of that kind are not located yet"
)
SPRINGS = "its springs and dampers of the ground are written for the plane"

CAN_GO_ON_IN_SPACE = (RunStatus.COMPLETED, RunStatus.INTERRUPTED)

SCHEMES = (Scheme.IMPACT_RESOLVED, Scheme.GAP_LINEARISED)


def check_spatial_method(method: Method | None) -> TimeStepping:
    """Return the time stepping that a simulation in space goes by.

    Raises
    ------
    SimulationError
        If it is another method, or a scheme of the plane only; with the reason.
    """
    if method is None:
        return TimeStepping()
    if not isinstance(method, TimeStepping):
        why = {"EventDriven": BY_NATURE, "Compliant": SPRINGS}.get(type(method).__name__, "")
        raise SimulationError(
            f"{type(method).__name__} simulates robots in the plane only"
            f"{why and f': {why}'}. For a robot in space use TimeStepping(step=...)"
        )
    if method.scheme not in SCHEMES:
        raise SimulationError(
            f"Scheme.{method.scheme.name} is for robots in the plane; in space there are "
            f"{' and '.join(f'Scheme.{scheme.name}' for scheme in SCHEMES)}"
        )
    if method.bounded_restitution:
        raise SimulationError("bounded_restitution is for robots in the plane")
    return method


def spatial_ground(ground: Ground | SpatialGround | None) -> SpatialGround:
    """Return the ground of a simulation in space, that of the plane taken for all y."""
    if ground is None:
        return SpatialGround()
    if isinstance(ground, SpatialGround):
        return ground
    if isinstance(ground, Ground):
        return SpatialGround.of_plane(ground)
    raise SimulationError(
        f"ground must be a SpatialGround or a Ground, got {type(ground).__name__}"
    )


@dataclass(frozen=True, eq=False)
class SpatialSnapshot:
    """A simulation in space at some instant, to be taken up again in the same process."""

    time: float
    """Simulated time (s)."""
    robot: SpatialRobot
    """The robot."""
    controller: Controller | None = field(repr=False)
    """What decided its torques."""
    arrays: Mapping[str, NDArray[Any]] = field(repr=False)
    """All numbers of the simulation, by name."""
    surroundings: Mapping[str, Any] = field(repr=False)
    """What its simulation began with, by name: method, ground, pushes, control period."""
    ground: SpatialGround = field(repr=False)
    pushes: tuple[Push, ...] = field(repr=False)
    """ground, pushes: What it had then: others may have been laid and applied since it began."""
    numbers: NDArray[Any] | None = field(default=None, repr=False)
    """The memory of a controller in Python."""


class SpatialSimulation:
    """A robot in space on the ground under a controller, at some instant.

    ``Simulation(robot, ...)`` is one where the robot is one in space.

    Parameters
    ----------
    robot : SpatialRobot
        The robot.
    controller : object with ``torque(t, state, contacts)``, or None
        Decides the joint torques (nu,) in N m. Laws made by ``@controller`` run compiled.
    state : State
        Where the robot starts.
    method : TimeStepping, optional
        Its step, and whether impacts are resolved within it.
    ground : SpatialGround or Ground, optional
        The ground; a level plane with μ = 0.75 by default.
    control_period : float, optional
        Time between two calls of the controller, a whole number of steps; every step by default.
    record_every : int
        Steps between two rows of the record.
    stop_when_fallen : bool, optional
        End when the centre of mass above the plane of the ground is below half of what it was. By
        default true for floating robots with several feet.
    pushes : sequence of Push
        Forces (x, y, z) from outside, each on a point of the robot over a window of time.
    on_error : OnError or str
        What becomes of an error in the controller, as for :class:`~heelstrike.Simulation`.
    **others
        Options that only the plane has; each is refused by its name.

    Attributes
    ----------
    status : RunStatus
        How it goes: ``COMPLETED`` and ``INTERRUPTED`` can go on, the others are its end.
    message : str
        The same in a person's words.
    error : BaseException or None
        What a controller or `progress` raised.

    Raises
    ------
    SimulationError, ControllerError, RobotError
        If the arguments are not usable.
    """

    def __init__(
        self,
        robot: SpatialRobot,
        controller: Controller | None = None,
        *,
        state: State,
        method: Method | None = None,
        ground: Ground | SpatialGround | None = None,
        control_period: float | None = None,
        record_every: int = 1,
        stop_when_fallen: bool | None = None,
        pushes: Sequence[Push] | Push = (),
        on_error: OnError | str = OnError.WARN,
        **others: Any,
    ) -> None:
        for name in others:
            if name in Setup.__annotations__:
                raise SimulationError(f"a simulation in space has no option {name!r} yet")
            raise SimulationError(f"unknown option {name!r} of a simulation in space")
        if not isinstance(robot, SpatialRobot):
            raise SimulationError(f"robot must be a SpatialRobot, got {type(robot).__name__}")
        if not (isinstance(record_every, int | np.integer) and record_every >= 1):
            raise SimulationError(f"record_every must be a whole number ≥ 1, got {record_every!r}")
        self.robot, self.method = robot, check_spatial_method(method)
        self.on_error = checked_on_error(on_error)
        self._ground = spatial_ground(ground)
        self._pushes = (pushes,) if isinstance(pushes, Push) else tuple(pushes)
        begin = checked_state(robot, state)
        self._memory = allocate_spatial_memory(
            robot, spatial_pushes(robot, self._pushes), walls=len(self._ground.boxes) > 0
        )
        self._memory.q[:], self._memory.v[:] = begin.q, begin.v
        self._clock = clock = SpatialClock.allocate()
        clock.step, clock.record_every = self.method.step, int(record_every)
        clock.control_every = (
            1
            if control_period is None
            else whole_steps("control_period", control_period, self.method.step)
        )
        clock.resolves = int(self.method.scheme is Scheme.IMPACT_RESOLVED)
        clock.event_margin = 2 * len(self._memory.blocks.kind) + 4
        self._control_with(controller)
        self._loop, self._compile_s = spatial_loop()
        self._wall_s = 0.0
        self._records: list[SpatialRecord] = []
        self._find_state()
        if stop_when_fallen is None:
            stop_when_fallen = robot.floating and len(robot.feet) > 1
        height = height_of_mass(robot.model, self._ground.model(), self._memory.equations)
        clock.fallen_height = FALL_FRACTION * height if stop_when_fallen else -np.inf
        self._begun_with = self._surroundings()
        self.status: RunStatus = RunStatus.COMPLETED
        self.message = "not begun"
        self.error: BaseException | None = None

    def __reduce__(self) -> NoReturn:
        """Copies would share memory that compiled code finds by address."""
        raise TypeError(
            "a simulation cannot be copied or pickled: begin another one with "
            "state=simulation.state, or keep simulation.snapshot() and restore it here"
        )

    def _find_state(self) -> None:
        memory = self._memory
        find_state(
            self.robot.model, self._ground.model(), memory.q, memory.v, memory.equations,
            memory.blocks, memory.contacts, memory.feet,
        )  # fmt: skip

    def _control_with(self, controller: Controller | None) -> None:
        """Begin with a controller."""
        law = law_of(controller)
        self._python: Any = controller if law is None else None
        if law is not None and not law.function.compiles:
            raise ControllerError(
                f"controller {law.function.name!r} is not compiled, and in space laws are; make it "
                "without compile=False, or write a class with torque(t, state, contacts)"
            )
        compiled = Law(no_torque) if law is None else law
        words = words_in_space(compiled.function)
        self._law = ReadySpatialLaw(self.robot, compiled, words, self._memory)
        self._control = self._law.control
        self._control.in_python = int(law is None)
        self._control.robot.period = self._clock.control_every * self._clock.step
        self._endings = () if law is None else law.function.endings
        self._controller = controller
        self._name = (
            f"{type(controller).__name__}.torque" if law is None
            else f"controller {law.function.name!r}"
        )  # fmt: skip
        robot: Any = self.robot
        self._robot_numbers = {} if self._python is None else numbers_of(robot)
        self._shown: Contacts = read_only(self._memory.contacts)

    @property
    def time(self) -> float:
        """Simulated time now, in s."""
        return self._clock.start + self._clock.index * self._clock.step

    @property
    def state(self) -> State:
        """Position and velocity now."""
        return State(self._memory.q, self._memory.v)

    @state.setter
    def state(self, state: State) -> None:
        begin = checked_state(self.robot, state)
        self._memory.q[:], self._memory.v[:] = begin.q, begin.v
        self._clock.answered = 0

    @property
    def contacts(self) -> Contacts:
        """Contact points now, with the forces of the step before."""
        self._find_state()
        return read_only(self._memory.contacts)

    @property
    def ground(self) -> SpatialGround:
        """The ground; one of the same shape but another friction or restitution may be laid."""
        return self._ground

    @ground.setter
    def ground(self, ground: SpatialGround) -> None:
        if not isinstance(ground, SpatialGround):
            raise SimulationError(f"ground must be a SpatialGround, got {type(ground).__name__}")
        if not ground.has_shape_of(self._ground):
            raise SimulationError(
                "in space the shape of the ground stays while a simulation goes on: lay one that "
                "differs in friction and restitution only, as dataclasses.replace(ground, "
                "friction=...) makes it, or begin another simulation"
            )
        self._ground = ground

    @takes(SimulationError)
    def apply(self, push: Push | Sequence[Push]) -> None:
        """Let a push act; see :meth:`heelstrike.Simulation.apply`.

        Parameters
        ----------
        push : Push or sequence of Push
            What pushes, with its own beginning and duration.

        Raises
        ------
        SimulationError
            If the robot has no such link, or the push would be over.
        """
        added = (push,) if isinstance(push, Push) else tuple(push)
        spatial_pushes(self.robot, added)  # which refuses what cannot be
        for each in added:
            if each.end < self.time:
                raise SimulationError(
                    f"the push on {each.link!r} would be over since t = {each.end:.6g} s: now is "
                    f"{self._now}. Let it start later"
                )
        self._push_by((*self._pushes, *added))

    def forget(self) -> None:
        """Forget what was; see :meth:`heelstrike.Simulation.forget`."""
        self._records.clear()
        self._push_by(tuple(push for push in self._pushes if push.end >= self.time))

    def _push_by(self, pushes: tuple[Push, ...]) -> None:
        """Let these pushes act and no others."""
        if pushes != self._pushes:
            self._pushes = pushes
            self._memory = self._memory.replaced(pushes=spatial_pushes(self.robot, pushes))

    @property
    def controller(self) -> Controller | None:
        """What decides the torques."""
        return self._controller

    @property
    def _now(self) -> str:
        return f"t = {self.time:.6g} s"

    def _kept(self) -> dict[str, Bundle]:
        """All that its further course depends on, beside a controller in Python."""
        law = self._law
        return {
            "memory.": self._memory, "clock.": self._clock, "parameters.": law.parameters,
            "law.": law.memory, "log.": law.log,
        }  # fmt: skip

    def snapshot(self) -> SpatialSnapshot:
        """Return everything that the further course depends on, in this process.

        Raises
        ------
        ControllerError
            If a controller in Python does not take part: it needs methods ``snapshot()``, which
            returns an array of numbers, and ``restore(numbers)``.
        """
        numbers = None if self._python is None else np.array(self._partaking().snapshot())
        arrays = {
            name: values.copy()
            for prefix, bundle in self._kept().items()
            for name, values in bundle.storage(prefix)
        }
        return SpatialSnapshot(
            self.time, self.robot, self._controller, arrays, self._begun_with, self._ground,
            self._pushes, numbers,
        )  # fmt: skip

    def _surroundings(self) -> dict[str, Any]:
        """What a snapshot must have been simulated with, too, in numbers that compare."""
        parts = {"ground": self._ground.model(), "pushes": self._memory.pushes}
        return {
            "method": repr(self.method),
            "control period": self._clock.control_every * self._clock.step,
            **{
                name: [(each, array.shape, array.tobytes()) for each, array in bundle.storage()]
                for name, bundle in parts.items()
            },
        }

    def restore(self, snapshot: SpatialSnapshot) -> None:
        """Be again as a simulation was; the record starts again.

        Parameters
        ----------
        snapshot : SpatialSnapshot
            Of this simulation, or of one that began with the same robot, controller, method,
            ground, pushes and control period, in this process. Ground and pushes are again those
            of the snapshot, and the rows of the record as far apart as they were.

        Raises
        ------
        SimulationError
            If it is one of another of these.
        ControllerError
            If a controller in Python does not take part in snapshots.
        """
        if not isinstance(snapshot, SpatialSnapshot):
            raise SimulationError(f"restore takes a SpatialSnapshot, got {type(snapshot).__name__}")
        same = {
            "robot": snapshot.robot is self.robot,
            "controller": snapshot.controller is self._controller,
        } | {
            what: snapshot.surroundings.get(what) == mine for what, mine in self._begun_with.items()
        }
        for what, alike in same.items():
            if not alike:
                raise SimulationError(
                    f"the snapshot is one of another {what}: restore it into a simulation with "
                    f"the same {what}"
                )
        now = self._ground, self._pushes
        self._push_by(snapshot.pushes)
        self._ground = snapshot.ground
        mine = {
            name: values
            for prefix, bundle in self._kept().items()
            for name, values in bundle.storage(prefix)
        }
        fits = mine.keys() == snapshot.arrays.keys() and all(
            values.shape == snapshot.arrays[name].shape for name, values in mine.items()
        )
        if not fits:
            self._ground = now[0]
            self._push_by(now[1])
            raise SimulationError("the snapshot is damaged: its arrays are not those of this one")
        if self._python is not None and snapshot.numbers is not None:
            self._partaking().restore(snapshot.numbers.copy())
        for name, values in mine.items():
            values[...] = snapshot.arrays[name]
        self._control.robot.ending = GOES_ON
        self._records.clear()
        self.status, self.message = RunStatus.COMPLETED, f"restored at {self._now}"
        self.error = None

    def _partaking(self) -> Partaking:
        python: Any = self._python
        if not isinstance(python, Partaking):
            raise ControllerError(
                f"{self._name} takes no part in snapshots: give its class methods snapshot(), "
                "which returns an array of numbers, and restore(numbers)"
            )
        return python

    def step(self) -> RunStatus:
        """Take one step; return how the simulation goes.

        Raises
        ------
        SimulationError
            If the simulation has come to its end.
        Exception
            With ``on_error="raise"``, what the controller raised.
        """
        return self._advance(self._clock.index + 1, None)

    def advance(
        self, until: float, *, progress: Callable[[float], None] | None = None
    ) -> RunStatus:
        """Simulate until a time, or until something ends it; return how it goes.

        Parameters
        ----------
        until : float
            Simulated time to stop at, in s, rounded to a whole number of steps.
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
            If the simulation has come to its end, or the time is past.
        Exception
            With ``on_error="raise"``, what the controller raised.
        """
        if not np.isfinite(until) or until < self.time - 0.5 * self._clock.step:
            raise SimulationError(f"until must be a time from now, {self._now}, on; got {until}")
        return self._advance(round((until - self._clock.start) / self._clock.step), progress)

    def _advance(self, last: int, progress: Callable[[float], None] | None) -> RunStatus:
        if self.status not in CAN_GO_ON_IN_SPACE:
            raise SimulationError(f"the simulation has ended: {self.message}")
        begin = clock_time.perf_counter()
        self._forget_error()
        try:
            self.status, self.message = self._go(last, progress)
        except KeyboardInterrupt as interrupt:
            acknowledge(interrupt)
            self.status, self.message = RunStatus.INTERRUPTED, f"interrupted at {self._now}"
        self._wall_s += clock_time.perf_counter() - begin
        self._tell_error()
        return self.status

    def _tell_error(self) -> None:
        """Do with an error in the controller as `on_error` says."""
        if self.status is RunStatus.CONTROLLER_FAILED and self.error is not None:
            tell(self.message, self.error, self.on_error)

    def _forget_error(self) -> None:
        self.error = None

    def _go(self, last: int, progress: Callable[[float], None] | None) -> tuple[RunStatus, str]:
        """Run the loop, with a look now and then at progress and Ctrl-C."""
        steps = FIRST_STEPS
        while True:
            self._clock.last = min(last, self._clock.index + steps)
            begin = clock_time.perf_counter()
            ended = self._run_loop()
            elapsed = clock_time.perf_counter() - begin
            if progress is not None:
                try:
                    progress(self.time)
                except Exception as error:
                    self.error = error
                    told = f"progress raised {type(error).__name__}: {error}"
                    return RunStatus.INTERRUPTED, f"interrupted at {self._now}: {told}"
            if ended is not None:
                return ended
            if self._clock.index >= last:
                return RunStatus.COMPLETED, f"completed at {self._now}"
            more = steps * min(4.0, LOOK_AFTER / max(elapsed, 1e-9))
            steps = int(min(ROWS, max(1.0, more)))

    def _run_loop(self) -> tuple[RunStatus, str] | None:
        """Run the loop until it pauses or ends; a robot that was changed meanwhile is put back."""
        ended = self._run_unwatched()
        robot: Any = self.robot
        if changed := restored(robot, self._robot_numbers):
            wrong = f"{self._name} changed the robot: {changed}; noticed at {self._now}"
            self.error = ControllerError(wrong)
            return RunStatus.CONTROLLER_FAILED, wrong
        return ended

    def _run_unwatched(self) -> tuple[RunStatus, str] | None:
        """Run the loop until it pauses or ends, with what it needs from Python."""
        if not self._records:
            self._new_record()
        while True:
            try:
                outcome = Outcome(
                    self._loop(
                        self.robot.model, self._ground.model(), self._control, self._memory,
                        self._records[-1], self._clock,
                    )
                )  # fmt: skip
                wrong = self._ask() if outcome is Outcome.ASKING else ""
            except KeyboardInterrupt:
                raise
            except EndOfRun as end:
                return RunStatus.STOPPED, f"the controller ended the run at {self._now}: {end}"
            except BaseException as error:  # of the controller: the loop raises nothing
                self.error = error
                words = f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
                return RunStatus.CONTROLLER_FAILED, (
                    f"{self._name} raised {words} at {self._now} (the exception is in run.error)"
                )
            if wrong:
                self.error = ControllerError(wrong)
                return RunStatus.CONTROLLER_FAILED, wrong
            if outcome is Outcome.RECORD_FULL:
                self._new_record()
            elif outcome in (Outcome.PAUSED, Outcome.DONE):
                return None
            elif outcome is not Outcome.ASKING:
                return self._ending(outcome)

    def _ask(self) -> str:
        """Ask a controller in Python for torques; return what is wrong with them."""
        torque = np.asarray(
            self._python.torque(self.time, self.state, self._shown), dtype=np.float64
        )
        if torque.shape != (self.robot.nu,):
            return (
                f"{self._name} returned shape {torque.shape} at {self._now}; robot "
                f"{self.robot.name!r} needs ({self.robot.nu},): "
                f"{', '.join(self.robot.actuator_names)}"
            )
        self._memory.command[:] = torque
        self._clock.answered = 1
        return ""

    def _ending(self, outcome: Outcome) -> tuple[RunStatus, str]:
        tally = self._memory.tally
        if outcome is Outcome.FELL:
            return RunStatus.FELL, (
                f"the robot fell at {self._now}: its centre of mass is below half its first height"
            )
        if outcome is Outcome.STOPPED:
            number = self._control.robot.ending
            why = self._endings[number] if number < len(self._endings) else f"ending {number}"
            return RunStatus.STOPPED, f"the controller ended the run at {self._now}: {why}"
        if outcome is Outcome.BAD_CONTROLLER:
            return RunStatus.CONTROLLER_FAILED, (
                f"the controller asked for a torque that is not finite at {self._now}, actuator "
                f"{self.robot.actuator_names[tally.bad_torque]!r}"
            )
        if outcome is Outcome.DIVERGED:
            return RunStatus.DIVERGED, (
                f"the state stopped being finite at {self._now}; try a smaller step or softer gains"
            )
        return RunStatus.SOLVER_FAILED, (
            f"no contact impulses could be certified at {self._now}, nor in parts of the step: "
            f"residual {tally.unsolved:.3g}. A smaller step may "
            "get past it"
        )

    def _new_record(self) -> None:
        """Make room for more rows and events."""
        room = min(ROWS, max(64, sum(each.rows for each in self._records)))
        events = 256 + 2 * self._clock.event_margin
        self._records.append(allocate_spatial_record(self.robot, room, events))

    @property
    def record(self) -> SpatialRun:
        """Everything since the simulation began, up to now; the last row is the instant before."""
        if not self._records:
            self._new_record()
        return SpatialRun(
            robot=self.robot,
            ground=self._ground,
            method=self.method,
            status=self.status,
            message=self.message,
            **joined_records(self._records),
            **counts_of(self._memory),
            timing=Timing(self._compile_s, self._wall_s),
            error=self.error,
            pushes=self._pushes,
        )

    def _decide_last(self) -> None:
        """Decide and record this instant, without leaving it."""
        if self.status is not RunStatus.COMPLETED:
            return
        self._clock.finishing = 1
        begin = clock_time.perf_counter()
        try:
            ended = self._run_loop()
        except KeyboardInterrupt as interrupt:  # too late for anything to be lost
            acknowledge(interrupt)
            ended = RunStatus.INTERRUPTED, f"interrupted at {self._now}"
        finally:
            self._wall_s += clock_time.perf_counter() - begin
            self._clock.finishing = 0
        if ended is not None:
            self.status, self.message = ended
            self._tell_error()


def simulate_in_space(
    robot: SpatialRobot, controller: Controller | None = None, *, duration: float,
    progress: Callable[[float], None] | None = None, **setup: Any,
) -> SpatialRun:  # fmt: skip
    """Simulate a robot in space on the ground under a controller.

    Parameters
    ----------
    robot, controller, duration, progress
        As for :func:`heelstrike.simulate`.
    **setup
        As for :class:`SpatialSimulation`.

    Returns
    -------
    SpatialRun
        Everything that happened, also after a fall, a failure or Ctrl-C.

    Raises
    ------
    SimulationError, ControllerError, RobotError
        If the arguments are not usable.
    """
    simulation = SpatialSimulation(robot, controller, **setup)
    simulation.advance(duration, progress=progress)
    simulation._decide_last()
    return simulation.record
