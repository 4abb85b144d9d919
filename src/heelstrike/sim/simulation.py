"""simulate(): from a robot, a controller and a state to a run."""

from __future__ import annotations

import time as clock_time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from heelstrike.contact.ground import Ground
from heelstrike.dynamics.kernels import center_of_mass, forward_kinematics
from heelstrike.dynamics.workspace import Workspace, workspace
from heelstrike.errors import ControllerError, SimulationError
from heelstrike.interruption import acknowledge
from heelstrike.robot.robot import Robot
from heelstrike.robot.state import State
from heelstrike.sim.contact_geometry import observe
from heelstrike.sim.controller.checked import CheckedController
from heelstrike.sim.controller.guard import guarded
from heelstrike.sim.controller.interface import (
    CompiledController,
    Contacts,
    Controller,
    checked_kernel,
    hold_torque,
    is_stock,
    name_of,
    read_only,
)
from heelstrike.sim.controller.watch import Watch, numbers_of, restored
from heelstrike.sim.engine import (
    DIVERGED,
    DONE,
    FELL,
    PAUSED,
    RAISED,
    RECORD_FULL,
    SOLVER_FAILED,
    Engine,
    Method,
    Setting,
)
from heelstrike.sim.memory import (
    BAD_TORQUE,
    COMPLEMENTARITY,
    CONDUCT,
    CONE,
    NON_PENETRATION,
    NOT_FINITE,
    PENETRATION,
    SATURATIONS,
    STEPS,
    TRUSTED,
    WATCHED,
    Memory,
    Record,
    allocate_memory,
    allocate_record,
    joined,
)
from heelstrike.sim.push import Push
from heelstrike.sim.run import Certificates, Event, Run, SolverCount, Timing
from heelstrike.sim.status import EventKind, RunStatus
from heelstrike.sim.time_stepping.method import TimeStepping

# Rows of one chunk of the record, and most steps between two looks at Ctrl-C and the progress bar.
CHUNK = 4096
# Steps before the first look, and seconds that should pass between two.
FIRST_LOOK = 256
LOOK_EVERY = 0.05
# Calls of a controller in Python between two reports of progress.
LOOK_AFTER = 256

# The loops count in 64 bits.
MOST_EVERY = 2**62

# A walking robot has fallen when its centre of mass is below this fraction of its first height.
FALL_FRACTION = 0.5


def simulate(
    robot: Robot,
    controller: Controller | CompiledController | None = None,
    *,
    state: State,
    duration: float,
    method: Method | None = None,
    ground: Ground | None = None,
    control_period: float | None = None,
    record_every: int = 1,
    stop_when_fallen: bool | None = None,
    pushes: Sequence[Push] = (),
    checked: bool = False,
    progress: Callable[[float], None] | None = None,
) -> Run:
    """Simulate a robot on the ground under a controller.

    Parameters
    ----------
    robot : Robot
        The robot.
    controller : object with ``torque(t, state, contacts)``, or None
        Decides the joint torques (nu,) in N m. Stock controllers run compiled; None applies no
        torque.
    state : State
        Where the robot starts.
    duration : float
        Time to simulate in seconds; time stepping rounds it to a whole number of steps.
    method : Method
        Way through time; ``TimeStepping()`` by default.
    ground : Ground
        The ground; flat with μ = 0.75 and no restitution by default.
    control_period : float, optional
        Time between two calls of the controller, in which its torques are held; a whole number of
        steps where the method has steps. By default time stepping calls it every step, and under
        ``EventDriven`` and ``Compliant`` a compiled controller acts continuously; one in Python is
        called every millisecond by the former and at every sample by the latter.
    record_every : int
        Steps between two rows of the record.
    stop_when_fallen : bool, optional
        End the run when the height of the centre of mass above the ground drops below half of what
        it was at first. By default true for floating robots with several feet.
    pushes : sequence of Push
        Forces from outside, each on a point of the robot over a window of time.
    checked : bool
        Run a compiled controller in Python, some hundred times slower, and look at every index: one
        that reads or writes beyond its arrays, or writes where it may not, ends the run with a
        message that names the array and the index. Like any controller in Python it is then called
        every `control_period`.
    progress : callable, optional
        Called now and then with the simulated time. If it raises, the run ends there, with status
        ``interrupted``.

    Returns
    -------
    Run
        Everything that happened, also after a fall, a failure or Ctrl-C; see ``run.status``. A
        controller that raises anything but KeyboardInterrupt, even SystemExit, ends the run with
        status ``controller_failed``, as does one that writes beyond its arrays or changes the
        robot; what was raised is in ``run.error``. While compiling, when there is nothing to keep,
        Ctrl-C raises KeyboardInterrupt.

    Raises
    ------
    SimulationError, ControllerError
        If the arguments are not usable, or the state is not one that the method can begin with;
        raised before anything is simulated, except for a torque of the wrong shape, which ends the
        run with status ``controller_failed``.
    """
    loop = prepared(
        robot=robot,
        state=state,
        duration=duration,
        method=method,
        ground=ground,
        control_period=control_period,
        record_every=record_every,
        stop_when_fallen=stop_when_fallen,
        pushes=pushes,
        checked=checked,
        progress=progress,
    )
    return loop.run(controller)


def prepared(
    *,
    robot: Robot,
    state: State,
    duration: float,
    method: Method | None,
    ground: Ground | None,
    control_period: float | None,
    record_every: int,
    stop_when_fallen: bool | None,
    pushes: Sequence[Push],
    checked: bool = False,
    progress: Callable[[float], None] | None = None,
    work: Workspace | None = None,
) -> Loop:
    """Check the arguments of :func:`simulate` and return the simulation, not yet begun.

    `work` is scratch for the robot's kinematics.
    """
    method = TimeStepping() if method is None else method
    ground = Ground() if ground is None else ground
    if not isinstance(method, Method):
        raise SimulationError(
            f"method must be a way through time such as TimeStepping(), got {type(method).__name__}"
        )
    if not isinstance(ground, Ground):
        raise SimulationError(f"ground must be a Ground, got {type(ground).__name__}")
    _check_state(robot, state)
    if not (np.isfinite(duration) and duration >= 0.0):
        raise SimulationError(f"duration must be a finite number ≥ 0, got {duration}")
    if control_period is not None and not 0.0 < control_period < np.inf:
        raise SimulationError(f"control_period must be a positive number, got {control_period}")
    if not (hasattr(record_every, "__index__") and 1 <= record_every <= MOST_EVERY):
        raise SimulationError(f"record_every must be a whole number ≥ 1, got {record_every!r}")
    if stop_when_fallen is None:
        stop_when_fallen = robot.floating and len(robot.feet) > 1
    fallen_height = -np.inf
    if stop_when_fallen:
        work = workspace(robot.nv) if work is None else work
        center = np.zeros(2)
        forward_kinematics(robot.model, state.q, work)
        center_of_mass(robot.model, work, center)
        fallen_height = FALL_FRACTION * (center[1] - float(ground.height(center[0])))
    return Loop(
        robot=robot,
        ground=ground,
        method=method,
        state=state,
        duration=duration,
        control_period=control_period,
        record_every=record_every,
        fallen_height=fallen_height,
        pushes=_checked_pushes(robot, pushes),
        checked=checked,
        progress=progress,
    )


def _checked_pushes(robot: Robot, pushes: Sequence[Push]) -> tuple[Push, ...]:
    if isinstance(pushes, Push):
        return _checked_pushes(robot, (pushes,))
    for push in pushes:
        if not isinstance(push, Push):
            raise SimulationError(f"pushes must be Push(...), got {push!r}")
        push.place(robot)
    return tuple(pushes)


def _check_state(robot: Robot, state: State) -> None:
    for name, vector, size in (("q", state.q, robot.nq), ("v", state.v, robot.nv)):
        if vector.shape != (size,):
            raise SimulationError(
                f"state.{name} must have {size} entries for robot {robot.name!r}, "
                f"got shape {vector.shape}"
            )
        if not np.all(np.isfinite(vector)):
            joint = robot.joint_names[int(np.flatnonzero(~np.isfinite(vector))[0])]
            raise SimulationError(f"state.{name} of joint {joint!r} is not finite")


def compiled_form(
    robot: Robot, controller: Controller | CompiledController | None
) -> CompiledController | None:
    """Return a controller in the form that runs inside the compiled loop, None if it has none.

    Raises
    ------
    ControllerError
        If it is no controller at all, or one that loops cannot call.
    """
    if controller is None:
        return CompiledController(hold_torque, np.zeros(robot.nu), np.zeros(0))
    if isinstance(controller, CompiledController):
        return checked_kernel(controller)
    make = getattr(controller, "compiled", None)
    compiled = make() if callable(make) else None
    if isinstance(compiled, CompiledController):
        return checked_kernel(compiled)
    if not callable(getattr(controller, "torque", None)):
        raise ControllerError(
            f"a controller needs a method torque(t, state, contacts), "
            f"{type(controller).__name__} has none"
        )
    return None


@dataclass
class Loop:
    """One simulation in progress.

    With `keep_rows` false, rows and events are counted and forgotten. `stopped` is asked now and
    then whether to end early.
    """

    robot: Robot
    ground: Ground
    method: Method
    state: State
    duration: float
    control_period: float | None
    record_every: int
    fallen_height: float
    pushes: tuple[Push, ...]
    checked: bool
    progress: Callable[[float], None] | None
    keep_rows: bool = True
    stopped: Callable[[], bool] | None = None

    def run(self, controller: Controller | CompiledController | None) -> Run:
        """Simulate from beginning to end."""
        self.begin()
        status, message, timing = self.advance(controller)
        try:
            return self.result(status, message, timing)
        except KeyboardInterrupt as interrupt:  # too late for anything to be lost
            acknowledge(interrupt)
            return self.result(RunStatus.INTERRUPTED, self._interrupted(), timing)

    def begin(self, memory: Memory | None = None, record: Record | None = None) -> None:
        """Allocate everything, compile, and check what only the method can.

        Parameters
        ----------
        memory : Memory, optional
            Memory to use, as `allocate_memory` makes it for this robot and these pushes.
        record : Record, optional
            Empty record of an earlier simulation of this robot, to be used again.
        """
        if memory is None:
            memory = allocate_memory(self.robot, self.pushes)
        self.memory: Memory = memory
        self.memory.stiffness[:] = self.robot.model.stiffness
        self.memory.damping[:] = self.robot.model.damping
        self.ground_model = self.ground.model()
        self.engine: Engine = self.new_engine(memory)
        self.event_counts = np.zeros(len(EventKind), dtype=np.int64)
        self.error: BaseException | None = None
        self.controller = "the controller"
        self.records: list[Record] = [] if record is None else [record]
        if record is None:
            self._new_record()
        # Bundles look up where their arrays are when first asked; the loop shall not wait for it.
        for bundle in (self.robot.model, self.ground_model, self.memory, self.records[-1]):
            _ = bundle.address

    def new_engine(self, memory: Memory) -> Engine:
        """Put the initial state into a memory and make an engine, which checks what it needs."""
        memory.q[:] = self.state.q
        memory.v[:] = self.state.v
        return self.method.engine(
            Setting(
                robot=self.robot,
                ground=self.ground.model(),
                memory=memory,
                duration=self.duration,
                control_period=self.control_period,
                record_every=self.record_every,
                fallen_height=self.fallen_height,
            )
        )

    def advance(
        self, controller: Controller | CompiledController | None
    ) -> tuple[RunStatus, str, Timing]:
        """Simulate to the end; return how that came and how long it took."""
        begin = clock_time.perf_counter()
        try:
            status, message = self._walk(controller)
        except KeyboardInterrupt as interrupt:
            acknowledge(interrupt)
            status = RunStatus.INTERRUPTED
            message = self._interrupted()
        self.final_state = self._state_now()
        if not self.keep_rows:
            self._count_events()
        wall_s = clock_time.perf_counter() - begin
        return status, message, Timing(self.engine.compile_s, wall_s)

    def _state_now(self) -> State:
        """State of the row just written, if one was; event-driven rows lie on the constraints."""
        record = self.records[-1]
        row = int(record.row_count[0]) - 1
        if row >= 0 and record.time[row] == self.engine.time:
            return State(record.q[row], record.v[row])
        return State(self.memory.q, self.memory.v)

    def _interrupted(self) -> str:
        return f"interrupted at t = {self.engine.time:.6g} s"

    def _count_events(self) -> None:
        """Count the events of the record and forget it."""
        record = self.records[-1]
        kinds = record.event_kind[: record.event_count[0]]
        self.event_counts += np.bincount(kinds, minlength=len(EventKind))
        record.row_count[0] = record.event_count[0] = 0

    def _new_record(self) -> None:
        if self.records and not self.keep_rows:
            self._count_events()
            return
        rows = min(CHUNK, self.engine.rows_left + 2)
        self.records.append(
            allocate_record(self.robot, rows, max(256, 64 * (self.robot.nc + 3 * self.robot.nv)))
        )

    def _walk(self, controller: Controller | CompiledController | None) -> tuple[RunStatus, str]:
        compiled = compiled_form(self.robot, controller)
        if compiled is None:
            return self._run_python(controller)  # type: ignore[arg-type]
        driven = self.robot.model.actuator_joint
        if compiled.stiffness is not None:
            self.memory.stiffness[driven] += compiled.stiffness
        if compiled.damping is not None:
            self.memory.damping[driven] += compiled.damping
        if self.checked and controller is not None:
            return self._run_python(CheckedController(self.robot, compiled))
        return self._run_compiled(compiled)

    def _run_compiled(self, controller: CompiledController) -> tuple[RunStatus, str]:
        self.controller = f"controller {name_of(controller)!r}"
        parameters = guarded(controller.parameters)
        controller_memory = guarded(controller.memory)
        self.memory.tally[CONDUCT] = TRUSTED if is_stock(controller) else WATCHED
        watch = Watch(self.robot, self.engine, self.memory, parameters, controller_memory)
        steps = FIRST_LOOK
        while True:
            begin = clock_time.perf_counter()
            code = self._run(steps, controller.kernel, parameters, controller_memory)
            elapsed = clock_time.perf_counter() - begin
            misdeed = watch.misdeed()
            if misdeed is not None:
                return RunStatus.CONTROLLER_FAILED, (
                    f"{self.controller} {misdeed}; noticed at t = {self.engine.time:.6g} s. "
                    "simulate(..., checked=True) tells more"
                )
            complaint = self._report()
            if code != PAUSED:
                status, message = self._ending(code)
                return status, f"{message}; {complaint}" if complaint else message
            if complaint:
                return RunStatus.INTERRUPTED, f"{self._interrupted()}: {complaint}"
            if self.stopped is not None and self.stopped():
                return RunStatus.INTERRUPTED, self._interrupted()
            steps = int(min(CHUNK, max(1.0, steps * min(4.0, LOOK_EVERY / max(elapsed, 1e-9)))))

    def _report(self) -> str:
        """Report progress; say what went wrong with that, if something did."""
        if self.progress is None:
            return ""
        try:
            self.progress(self.engine.time)
        except KeyboardInterrupt:
            raise
        except BaseException as error:
            self.error = error
            return f"progress raised {_raised(error)}"
        return ""

    def _run(
        self,
        steps: int | None,
        kernel: Callable[..., None],
        parameters: NDArray[np.float64],
        controller_memory: NDArray[np.float64],
    ) -> int:
        """Advance by a number of steps, or by one control period; return how it came back."""
        self.engine.pause_after(steps)
        while True:
            try:
                code = self.engine.advance(kernel, parameters, controller_memory, self.records[-1])
            except KeyboardInterrupt:
                raise
            except BaseException as error:  # of a compiled controller: loops raise nothing
                self.error = error
                return RAISED
            if code != RECORD_FULL:
                return code
            self._new_record()

    def _run_python(self, controller: Controller) -> tuple[RunStatus, str]:
        self.controller = f"{type(controller).__name__}.torque"
        empty, held = guarded(()), guarded(np.zeros(self.robot.nu))
        contacts = read_only(self.memory.contacts)
        numbers = numbers_of(self.robot)
        calls = 0
        while True:
            ending = self._ask(controller, contacts, held)
            code = PAUSED if ending else self._run(None, hold_torque, held, empty)
            calls += 1
            if calls % LOOK_AFTER != 0 and code == PAUSED and ending is None:
                continue
            changed = restored(self.robot, numbers)
            if changed:
                return RunStatus.CONTROLLER_FAILED, (
                    f"{self.controller} changed the robot: {changed}; noticed at "
                    f"t = {self.engine.time:.6g} s"
                )
            if ending is not None:
                return ending
            complaint = self._report()
            if code != PAUSED:
                status, message = self._ending(code)
                return status, f"{message}; {complaint}" if complaint else message
            if complaint:
                return RunStatus.INTERRUPTED, f"{self._interrupted()}: {complaint}"

    def _ask(
        self, controller: Controller, contacts: Contacts, held: NDArray[np.float64]
    ) -> tuple[RunStatus, str] | None:
        """Ask for the torques to hold; return how the controller ended the run, if it did."""
        observe(self.robot.model, self.ground_model, self.memory)
        now = f"t = {self.engine.time:.6g} s"
        try:
            torque = np.asarray(
                controller.torque(self.engine.time, State(self.memory.q, self.memory.v), contacts),
                dtype=np.float64,
            )
        except KeyboardInterrupt:
            raise
        except BaseException as error:
            self.error = error
            if isinstance(controller, CheckedController) and isinstance(error, ControllerError):
                return RunStatus.CONTROLLER_FAILED, f"{error} (at {now})"
            return RunStatus.CONTROLLER_FAILED, (
                f"{self.controller} raised {_raised(error)} at {now} (the exception is in "
                "run.error)"
            )
        if torque.shape != (self.robot.nu,):
            return RunStatus.CONTROLLER_FAILED, (
                f"{self.controller} returned shape {torque.shape} at {now}; robot "
                f"{self.robot.name!r} needs ({self.robot.nu},): "
                f"{', '.join(self.robot.actuator_names)}"
            )
        held[:] = torque
        return None

    def _ending(self, code: int) -> tuple[RunStatus, str]:
        now = f"t = {self.engine.time:.6g} s"
        if code == DONE:
            return RunStatus.COMPLETED, f"completed at {now}"
        if code == FELL:
            return RunStatus.FELL, (
                f"the robot fell at {now}: its centre of mass is below half its first height"
            )
        if code == RAISED:
            assert self.error is not None
            more = "; simulate(..., checked=True) names the array and the index"
            return RunStatus.CONTROLLER_FAILED, (
                f"{self.controller} raised {_raised(self.error)} at {now} (the exception is in "
                f"run.error){more if isinstance(self.error, IndexError) else ''}"
            )
        tally = self.memory.tally
        if code == DIVERGED and tally[NOT_FINITE] > 0:
            return self._not_finite(int(tally[NOT_FINITE]) - 1, f"in the step after {now}")
        reason = getattr(self.engine, "reason", "")
        if code == DIVERGED and reason:
            return RunStatus.DIVERGED, f"the simulation could not go on at {now}: {reason}"
        if code == DIVERGED:
            return RunStatus.DIVERGED, (
                f"the state stopped being finite at {now}; try a smaller step or softer gains"
            )
        if code == SOLVER_FAILED:
            return RunStatus.SOLVER_FAILED, (
                f"no contact solver could certify a solution at {now}; residuals "
                f"{self.memory.residual.tolist()}"
            )
        return self._not_finite(int(tally[BAD_TORQUE]), f"at {now}")

    def _not_finite(self, actuator: int, when: str) -> tuple[RunStatus, str]:
        return RunStatus.CONTROLLER_FAILED, (
            f"the controller asked for a torque that is not finite {when}, actuator "
            f"{self.robot.actuator_names[actuator]!r}"
        )

    def result(self, status: RunStatus, message: str, timing: Timing) -> Run:
        """Return the record of the simulation."""
        rows = joined(self.records)
        tally = self.memory.solver.tally
        extreme = self.memory.extreme
        return Run(
            robot=self.robot,
            ground=self.ground,
            method=self.method,
            status=status,
            message=message,
            time=rows.time,
            position=rows.q,
            velocity=rows.v,
            torque=rows.torque,
            stop_torque=rows.stop_torque,
            friction_torque=rows.friction_torque,
            contact_point=rows.point,
            contact_normal=rows.normal,
            gap=rows.gap,
            contact_force=rows.force,
            slip_velocity=rows.slip,
            residual=rows.residual,
            events=tuple(
                Event(
                    time=float(rows.event_time[i]),
                    kind=EventKind(int(rows.event_kind[i])),
                    contact=int(rows.event_contact[i]),
                    impulse=(float(rows.event_impulse[i, 0]), float(rows.event_impulse[i, 1])),
                )
                for i in np.argsort(rows.event_time, kind="stable")
            ),
            certificates=Certificates(
                penetration=float(extreme[PENETRATION]),
                complementarity=float(extreme[COMPLEMENTARITY]),
                cone=float(extreme[CONE]),
                non_penetration=float(extreme[NON_PENETRATION]),
            ),
            solver=SolverCount(
                name=self.engine.solver,
                solves=tally.solves,
                shortcuts=tally.shortcuts,
                fallbacks=tally.fallbacks,
                failures=tally.failures,
            ),
            steps=int(self.memory.tally[STEPS]),
            saturations=int(self.memory.tally[SATURATIONS]),
            timing=timing,
            error=self.error,
            pushes=self.pushes,
        )


def _raised(error: BaseException) -> str:
    """Return kind and words of an exception."""
    return f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
