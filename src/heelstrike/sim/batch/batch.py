"""Batch: many simulations that live in compiled memory and move on together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np
from numpy.typing import ArrayLike, NDArray

from heelstrike.arguments import are_numbers, one_of, refusal, takes
from heelstrike.compiler.bundle import Bundle, address_of_array
from heelstrike.contact.ground import Ground
from heelstrike.errors import SimulationError
from heelstrike.robot.model import Floats, Integers
from heelstrike.robot.robot import Robot
from heelstrike.robot.spatial.robot import SpatialRobot
from heelstrike.robot.state import State
from heelstrike.sim.batch.crew import Crew
from heelstrike.sim.batch.lanes import Lanes
from heelstrike.sim.batch.moving import move_lanes
from heelstrike.sim.batch.planning import Joints, Plan, compile_all, naming, planned, way_of
from heelstrike.sim.closed_sets import OnError, RunStatus
from heelstrike.sim.contacts.brakes import put_on
from heelstrike.sim.contacts.latches import latches_at
from heelstrike.sim.contacts.loops import HOLDS
from heelstrike.sim.controller.interface import Controller
from heelstrike.sim.dimension import dimension_of
from heelstrike.sim.frame import Outcome
from heelstrike.sim.method import Method
from heelstrike.sim.push import Push
from heelstrike.sim.setting import checked_setting
from heelstrike.sim.simulation import CAN_GO_ON, FAR, Simulation
from heelstrike.sim.snapshot import Snapshot
from heelstrike.sim.time_stepping import TimeStepping

if TYPE_CHECKING:
    from heelstrike.contact.spatial.ground import SpatialGround


NO_ROWS = 2**62
"""Steps between two rows of runs that are not recorded: more than any run has."""

LOOK_EVERY = 4096
"""Steps of all lanes of a thread between two looks at Ctrl-C."""

WENT_ON = int(Outcome.PAUSED)
"""The last of the outcomes, ``DONE`` and ``PAUSED``, of lanes that can go on."""


class Batch:
    """Many simulations of one robot, method and kind of controller that advance together.

    Each argument is either for all lanes or has one entry a lane; n is their number. Lane i is
    :class:`~heelstrike.Simulation` of the same arguments to the last bit, whatever n, the number of
    threads, and what becomes of the others: a lane that ends stops by itself.

    Parameters
    ----------
    robot : Robot or SpatialRobot, or sequence of n
        Robots may differ in every number, but must be built alike.
    controller : controller, sequence of n, or None
        :class:`~heelstrike.HeldTorque`, whose torques are in `command`; another stock controller,
        or one made with :func:`heelstrike.controller`. Each lane has a memory of its own.
    state : State, or sequence of n
        Where the lanes start: `q` (nq,) or (n, nq), `v` (nv,) or (n, nv).
    lanes : int, optional
        How many, where no argument has one entry a lane.
    parameters : Bundle, sequence of n, or mapping of str to (n, ...) array, optional
        Numbers of the controller, in the place of its own.
    pushes : Push, sequence of Push, or sequence of n sequences of Push
        Forces from outside.
    ground : Ground or SpatialGround, or sequence of n
        The ground; flat with μ = 0.75 and no restitution by default.
    method : Method
        Simulation method of all lanes; ``TimeStepping()`` by default.
    control_period, stop_when_fallen
        See :class:`~heelstrike.Simulation`.
    latched : joints, or sequence of n of them or None, optional
        Joints that their latches hold as a lane begins.
    braked : joints, or sequence of n of them
        Joints that their brakes hold as a lane begins.
    on_error : OnError or str
        What becomes of an error in a controller; see :class:`~heelstrike.Simulation`.
    threads : int
        Threads that the lanes are shared out to. One does best until a call takes milliseconds.

    Attributes
    ----------
    time : (n,) float
        Time of each lane (s).
    position, velocity : (n, nq) and (n, nv) float
        States (m, rad; m/s, rad/s).
    torque : (n, nu) float
        Torques that act (N m).
    gap : (n, nc) float
        Height of the contact points over the ground (m), at the beginning of the last step.
    contact_force : (n, nc, 2) float
        Normal and tangential force on the robot in the last step (N), axes of the ground below;
        (n, nc, 3) in space.
    steps, saturations : (n,) int
        Steps taken; torques that were clipped.
    penetration, complementarity, cone, non_penetration, energy_gain : (n,) float
        Worst values since the lane began; see :class:`~heelstrike.sim.run.Certificates`. In space
        there are `residual`, `uncertified`, `halved` and `relaxed` in the place of the three
        residuals; see :class:`~heelstrike.sim.spatial.SpatialCertificates`.
    events : (n, kinds) int
        Events of each kind, in the order of :class:`~heelstrike.sim.closed_sets.EventKind`.
    outcome : (n,) int
        How each lane came back, 0 or 1 of those that can go on: an
        :class:`~heelstrike.sim.frame.Outcome`.
    command : (n, nu) float
        Torques (N m) that :class:`~heelstrike.HeldTorque` holds; write into it. Laws that are
        commanded with something else (:attr:`~heelstrike.control.Law.commanded`) have as many
        columns as that.

    Raises
    ------
    SimulationError, ControllerError
        If the arguments are not usable; raised before anything is simulated.

    Notes
    -----
    All arrays are views of the memory that compiled code works in: what is read is always how the
    lanes are now. They are read-only but for `command`. Ctrl-C between two steps raises
    KeyboardInterrupt; no lane is then more than a few steps ahead of the others.

    Examples
    --------
    >>> import heelstrike as hs
    >>> robot = hs.load_robot("bravo7")
    >>> batch = hs.Batch(
    ...     robot, hs.HeldTorque(robot), state=robot.reference_state(), lanes=3
    ... )
    >>> batch.command[:, 0] = [-1.0, 0.0, 1.0]
    >>> batch.step(10)
    >>> batch.time.tolist(), batch.going.all()
    ([0.01, 0.01, 0.01], np.True_)
    """

    steps: Integers
    saturations: Integers
    penetration: Floats
    complementarity: Floats
    cone: Floats
    non_penetration: Floats
    energy_gain: Floats
    residual: Floats
    uncertified: Integers
    halved: Integers
    relaxed: Integers

    @takes(SimulationError)
    def __init__(
        self,
        robot: Robot | SpatialRobot | Sequence[Robot] | Sequence[SpatialRobot],
        controller: Controller | Sequence[Controller] | None = None,
        *,
        state: State | Sequence[State],
        lanes: int | None = None,
        parameters: Any = None,
        pushes: Push | Sequence[Push] | Sequence[Sequence[Push]] = (),
        ground: Ground | SpatialGround | Sequence[Ground] | Sequence[SpatialGround] | None = None,
        method: Method | None = None,
        control_period: float | None = None,
        stop_when_fallen: bool | None = None,
        latched: Joints | Sequence[Joints | None] | None = None,
        braked: Joints | Sequence[Joints] = (),
        on_error: OnError | str = OnError.WARN,
        threads: int = 1,
    ) -> None:
        if lanes is not None and lanes < 1:
            raise SimulationError(f"lanes must be at least 1, got {lanes}")
        way = way_of(robot, method)
        self._setup: dict[str, Any] = {
            "control_period": control_period, "record_every": NO_ROWS,
            "stop_when_fallen": stop_when_fallen,
            "on_error": one_of(OnError, "on_error", on_error, SimulationError),
        }  # fmt: skip
        plans, _ = planned(
            way, self._setup, robot=robot, controller=controller, state=state,
            parameters=parameters, pushes=pushes, ground=ground, latched=latched, braked=braked,
        )  # fmt: skip
        if lanes is not None and len(plans) == 1:
            plans *= lanes
        if lanes is not None and lanes != len(plans):
            raise SimulationError(
                f"lanes is {lanes}, but the other arguments are for {len(plans)} lanes"
            )
        self.robot: Any = plans[0].setting.robot
        self._way, self.method = way, way.asked_for
        self._dimension = dimension_of(self.robot)
        self._lay_out(plans, checked_threads(threads, len(plans)))

    def _lay_out(self, plans: list[Plan], threads: int) -> None:
        self.compile_s = compile_all(self._way, plans)
        self._plans = plans
        self._lanes = Lanes(plans, self._way, threads, keep_rows=False)
        self._lanes.refuse_others(plans)
        self._lanes.make_ready()
        self._crew = Crew(threads)
        self._lent: set[int] = set()
        self._has_ended = False
        count = len(plans)
        self._until = np.full(count, FAR)
        self._outcome = np.full(count, WENT_ON, dtype=np.int64)
        self.outcome: Integers = _read_only(self._outcome)
        self.events: Integers = _read_only(self._lanes.events)
        width = commanded_width(plans)
        self.command: Floats = np.zeros((count, width))
        for row, lane in zip(self.command, self._lanes.lanes, strict=True):
            if lane.commanded is not None:
                row[:] = lane.commanded
        self._command = np.array([address_of_array(self.command), width], dtype=np.int64)
        self._find_columns()
        self._tell_apart()

    def _find_columns(self) -> None:
        """Find what is looked at from outside."""
        first, column = self._lanes.lanes[0], self._lanes.column
        memory = first._memory
        found = {name: array for name, _, array in memory.views()}
        clock = {name: array for name, _, array in first._clock.views()}
        self._q, self._v = column(memory.q, written=True), column(memory.v, written=True)
        self.time: Floats = column(clock["time"])
        self.position: Floats = column(memory.q)
        self.velocity: Floats = column(memory.v)
        self.torque: Floats = column(memory.torque)
        self.gap: Floats = column(memory.contacts.gap)
        self.contact_force: Floats = column(memory.contacts.force)
        for name in self._dimension.tallied_names:
            setattr(self, name, column(found[f"tally.{name}"]))

    def __len__(self) -> int:
        return len(self._plans)

    def __reduce__(self) -> NoReturn:
        """Copies would share memory that compiled code finds by address."""
        raise TypeError(
            "a batch cannot be copied or pickled: keep batch.snapshot(), make another batch of the "
            "same arguments, and call its restore"
        )

    def __repr__(self) -> str:
        return (
            f"<Batch of {len(self)} lanes of {self.robot.name!r}, "
            f"{int(np.count_nonzero(self.going))} going>"
        )

    @property
    def going(self) -> NDArray[np.bool_]:
        """Which lanes have not ended, (n,)."""
        return self._outcome <= WENT_ON

    @property
    def status(self) -> tuple[RunStatus, ...]:
        """How each lane goes: those that ``going`` names are ``COMPLETED`` up to now."""
        return tuple(lane.status for lane in self._lanes.lanes)

    def message(self, lane: int) -> str:
        """Say in a person's words how a lane goes, or why it has ended.

        Parameters
        ----------
        lane : int
            Which.

        Returns
        -------
        str
            The words.
        """
        going = self._outcome[lane] <= WENT_ON
        return f"going on at t = {self.time[lane]:.6g} s" if going else self.lane(lane).message

    def lane(self, index: int) -> Simulation:
        """Return one lane, to be pushed, given other ground, kept, or moved by itself.

        Parameters
        ----------
        index : int
            Which.

        Returns
        -------
        Simulation
            The lane itself, which goes on with the batch afterwards. It is not recorded.

        Raises
        ------
        IndexError
            If there is no such lane.
        """
        if not -len(self) <= index < len(self):
            raise IndexError(f"there is no lane {index} in a batch of {len(self)}")
        index = int(index) % len(self)
        self._lent.add(index)
        return self._lanes.lanes[index]

    def step(self, steps: int = 1, mask: ArrayLike | None = None) -> None:
        """Take steps of the method in all lanes that have not ended.

        Parameters
        ----------
        steps : int
            How many.
        mask : (n,) bool, optional
            Which lanes move; all by default.

        Raises
        ------
        SimulationError
            If that is not a whole number ≥ 1, or the mask is not a mask.
        """
        given: object = steps
        if not (isinstance(given, int | np.integer) and given >= 1):
            raise SimulationError(f"steps must be a whole number ≥ 1, got {given!r}")
        if self._lent:
            self._look_at_lent()
        shares = self._shares
        if mask is not None:
            chosen = self._checked(mask)
            shares = [share[chosen[share]] for share in shares]
        left = int(steps)
        self._until.fill(FAR)
        while left > self._steps_at_once:
            self._move(shares, self._steps_at_once)
            left -= self._steps_at_once
        self._move(shares, left)

    def advance(self, until: ArrayLike) -> None:
        """Simulate all lanes that have not ended until a time of each.

        Parameters
        ----------
        until : float, or (n,) float
            Times to stop at (s); time stepping rounds them to a whole number of steps. Lanes that
            are later stay as they are.

        Raises
        ------
        SimulationError
            If a time is not finite.
        """
        if not are_numbers(until):
            raise SimulationError(refusal("until", until, ("ArrayLike",)))
        times = np.broadcast_to(np.asarray(until, dtype=np.float64), len(self))
        if not np.isfinite(times).all():
            raise SimulationError(f"until must be finite, got {until!r}")
        self._look_at_lent()
        lanes = self._lanes.lanes
        self._until[:] = [
            self._way.instant(lane._clock, time)
            for lane, time in zip(lanes, times.tolist(), strict=True)
        ]
        early = (self.time < self._until) & self.going
        while True:
            shares = [share[early[share]] for share in self._shares]
            if not any(share.size for share in shares):
                return
            self._move(shares, self._steps_at_once)
            early &= (self._outcome == WENT_ON) & (self.time < self._until)

    def reset(self, mask: ArrayLike | None = None, state: State | None = None) -> None:
        """Let lanes start again at t = 0, those that have ended too.

        Their ground, pushes and parameters stay as they are now; memory of laws, contact modes and
        counts are as at first. For other ground, pushes, parameters or robots see :meth:`lay`.

        Parameters
        ----------
        mask : (n,) bool, optional
            Which lanes; all by default.
        state : State, optional
            Where they begin: `q` (nq,) for all, or one row a lane that is reset, or one a lane of
            the batch; `v` likewise. By default where each began first.

        Raises
        ------
        SimulationError
            If mask or states are not usable; nothing has changed then.
        """
        chosen = self._chosen(mask)
        q, v = self._states(chosen, state)
        q, v = self._checked_states(chosen, q, v)
        if chosen.size:
            self._begin_anew(chosen, q, v)

    def _begin_anew(self, chosen: Integers, q: Floats, v: Floats) -> None:
        """Let lanes start again in states that are good."""
        lanes = self._lanes
        lanes.put_back(chosen, (q, v), (self._q, self._v))
        if self._lent or self._any_special or self._has_ended:
            for index in chosen.tolist():
                lanes.lanes[index].begin_anew()
                self._hold(index)
            self._outcome[chosen] = WENT_ON
            self._has_ended = bool((self._outcome > WENT_ON).any())

    def _renew(
        self, index: int, *, pushes: Sequence[Push] | None = None, ground: Any = None
    ) -> None:
        """Give a lane that is about to start again other pushes, as many as it has, or ground.

        That is some thirty times as quick as :meth:`lay`: nothing else of the lane is looked at.
        """
        lane, setting = self._lanes.lanes[index], self._plans[index].setting
        if pushes is not None:
            if len(pushes) != len(setting.pushes):
                raise SimulationError(
                    f"lane {index} has {len(setting.pushes)} pushes, and is given {len(pushes)}"
                )
            setting = replace(setting, pushes=tuple(pushes))
        if ground is not None:
            setting = replace(setting, ground=ground)
        lane.renew(setting)
        self._lanes.find(index)
        self._plans[index] = self._plans[index]._replace(setting=setting)

    def lay(
        self,
        index: int,
        *,
        robot: Robot | SpatialRobot | None = None,
        controller: Controller | None = None,
        state: State | None = None,
        parameters: Bundle | None = None,
        pushes: Sequence[Push] | None = None,
        ground: Ground | SpatialGround | None = None,
        latched: Sequence[str | int] | None = None,
        braked: Sequence[str | int] | None = None,
    ) -> None:
        """Let a lane be another, which starts again; what is left out stays as it was laid before.

        Parameters
        ----------
        index : int
            Which.
        robot : Robot, optional
            Built as those of the other lanes.
        controller : controller, optional
            Compiled.
        state : State, optional
            Where it begins.
        parameters : Bundle, optional
            Numbers of the controller, in the place of its own.
        pushes : sequence of Push, optional
            Forces from outside.
        ground : Ground, optional
            The ground.
        latched, braked : sequence of str or int, optional
            Joints that latches and brakes hold as it begins.

        Raises
        ------
        SimulationError, ControllerError
            If they are not usable; nothing has changed then.
        IndexError
            If there is no such lane.
        """
        index = range(len(self))[index]
        before = self._plans[index]
        setting = before.setting
        known = {
            "robot": setting.robot, "controller": before.law, "state": setting.state,
            "parameters": None, "pushes": (setting.pushes,), "ground": setting.ground,
            "latched": before.latched,
            "braked": [setting.robot.brake_names[i] for i, on in enumerate(setting.braked) if on],
        }  # fmt: skip
        given = {
            "robot": robot, "controller": controller, "state": state, "parameters": parameters,
            "pushes": None if pushes is None else (tuple(pushes),), "ground": ground,
            "latched": latched, "braked": braked,
        }  # fmt: skip
        about: Any = known | {name: each for name, each in given.items() if each is not None}
        with naming(index, 2):
            plans, _ = planned(self._way, self._setup, **about)
            if len(plans) != 1:
                raise SimulationError(
                    f"lay changes one lane at a time, got arguments for {len(plans)}"
                )
            self._lanes.refuse_others(plans)
            commanded_width(plans, (self.command.shape[1],))
            compile_all(self._way, plans)
            self._lanes.lay(index, plans[0])
        self._plans[index] = plans[0]
        commanded = self._lanes.lanes[index].commanded
        self.command[index] = 0.0 if commanded is None else commanded
        self._outcome[index] = WENT_ON
        self._tell_apart()

    def snapshot(self) -> tuple[Snapshot, ...]:
        """Return everything that the further course of each lane depends on, (n,)."""
        self._command_all()
        return tuple(lane.snapshot() for lane in self._lanes.lanes)

    def restore(self, snapshots: Sequence[Snapshot], mask: ArrayLike | None = None) -> None:
        """Be again as a batch was.

        Parameters
        ----------
        snapshots : sequence of Snapshot
            One a lane, of this batch or of one of the same robots, method and controllers, in this
            process or another; or of single simulations of the same.
        mask : (n,) bool, optional
            The lanes that are restored; all by default.

        Raises
        ------
        SimulationError, ControllerError
            If there are not as many as lanes, or one does not fit.
        """
        if len(snapshots) != len(self):
            raise SimulationError(
                f"a batch of {len(self)} lanes is restored from as many snapshots, got "
                f"{len(snapshots)}"
            )
        for index in self._chosen(mask).tolist():
            lane = self._lanes.lanes[index]
            with naming(index, len(self)):
                lane.restore(snapshots[index])
            if lane.commanded is not None:
                self.command[index] = lane.commanded
            self._lent.add(index)
        self._look_at_lent()

    def close(self) -> None:
        """Let its threads go; it can go on with new ones."""
        self._crew.close()

    def _command_all(self) -> None:
        """Let the lanes know what is commanded, as the next step would."""
        for row, lane in zip(self.command, self._lanes.lanes, strict=True):
            if lane.commanded is not None:
                lane.commanded[:] = row

    def _chosen(self, mask: ArrayLike | None) -> Integers:
        """Return the lanes of a mask."""
        if mask is None:
            return np.arange(len(self))
        return np.flatnonzero(self._checked(mask))

    def _checked(self, mask: ArrayLike) -> NDArray[np.bool_]:
        """Return a mask, or refuse what is none."""
        array = np.asarray(mask)
        if array.dtype != np.bool_ or array.shape != (len(self),):
            raise SimulationError(
                f"mask must have one truth value a lane, ({len(self)},) bool, got shape "
                f"{array.shape} of {array.dtype}"
            )
        return array

    def _states(self, chosen: Integers, state: State | None) -> tuple[Floats, Floats]:
        """Return positions and velocities of the lanes that are reset."""
        if state is None:
            states = [plan.setting.state for plan in self._plans]
            q, v = (np.array([getattr(each, name) for each in states]) for name in "qv")
            return q[chosen], v[chosen]
        if not isinstance(state, State):
            raise SimulationError(f"state must be a State, got {type(state).__name__}")
        found = []
        for name, array, size in (("q", state.q, self.robot.nq), ("v", state.v, self.robot.nv)):
            if array.shape == (len(self), size):
                array = array[chosen]
            if array.shape not in ((size,), (len(chosen), size)):
                raise SimulationError(
                    f"state.{name} must have shape ({size},), ({len(chosen)}, {size}) for the "
                    f"lanes that are reset, or ({len(self)}, {size}), got {array.shape}"
                )
            found.append(np.broadcast_to(array, (len(chosen), size)))
        return found[0], found[1]

    def _checked_states(self, chosen: Integers, q: Floats, v: Floats) -> tuple[Floats, Floats]:
        """Return states that lanes can begin with, or refuse others."""
        finite = np.isfinite(q).all(axis=1) & np.isfinite(v).all(axis=1)
        if not finite.all():
            lane = int(chosen[np.flatnonzero(~finite)[0]])
            raise SimulationError(f"the state of lane {lane} is not finite")
        if not self._dimension.is_free(self.robot):
            q, v = q.copy(), v.copy()
            for place, index in enumerate(chosen.tolist()):
                with naming(index, len(self)):
                    robot, at = self._plans[index].setting.robot, State(q[place], v[place])
                    good = self._dimension.checked_state(robot, at)
                q[place], v[place] = good.q, good.v
        if not isinstance(self.method, TimeStepping):
            for index, *state in zip(chosen.tolist(), q, v, strict=True):
                lane, at = self._lanes.lanes[index], State(*state)
                setting = replace(self._plans[index].setting, state=at, ground=lane.ground)
                with naming(index, len(self)):
                    self._way.check(setting)
        return q, v

    def _hold(self, index: int) -> None:
        """Let what follows from the state follow from the one that a lane begins with now."""
        plan, lane = self._plans[index], self._lanes.lanes[index]
        setting = plan.setting
        falls = np.isfinite(setting.fallen_height)
        if not (falls or setting.held or setting.braked):
            return
        state = lane.state
        if falls:
            again = checked_setting(
                setting.robot, state, ground=lane.ground, **self._setup | {"stop_when_fallen": True}
            )
            lane._clock.fallen_height = again.fallen_height
        if setting.held:
            held = latches_at(setting.robot, state, lane.ground, plan.latched)
            lane._memory.loops.held[:] = held
        if setting.braked:
            put_on(setting.robot, setting.braked, state, HOLDS, lane._memory)

    def _tell_apart(self) -> None:
        """Find lanes that move by themselves, and whether any takes more than its memory to begin.

        Latches, brakes and the height at which it has fallen follow from its state.
        """
        self._alone = np.array([lane.moves_alone for lane in self._lanes.lanes], dtype=bool)
        self._any_alone = bool(self._alone.any())
        settings = [plan.setting for plan in self._plans]
        self._any_special = any(
            each.held or each.braked or each.pushes or np.isfinite(each.fallen_height)
            for each in settings
        )
        thread = self._lanes.thread
        self._shares = [np.flatnonzero(thread == each) for each in range(self._crew.threads)]
        longest = max(share.size for share in self._shares)
        self._steps_at_once = max(LOOK_EVERY // longest, 1)
        self._has_ended = bool((self._outcome > WENT_ON).any())

    def _look_at_lent(self) -> None:
        """See what has become of lanes that somebody has in hand."""
        if not self._lent:
            return
        for index in self._lent:
            lane = self._lanes.lanes[index]
            self._lanes.find(index)
            if lane.status in CAN_GO_ON and self._outcome[index] > WENT_ON:
                self._outcome[index] = WENT_ON
            elif lane.status not in CAN_GO_ON and self._outcome[index] <= WENT_ON:
                self._outcome[index] = _OUTCOME_OF[lane.status]
        self._tell_apart()

    def _move(self, shares: list[Integers], steps: int) -> None:
        """Move lanes that have not ended by so many steps, or until the times that are set."""
        lanes, outcome = self._lanes, self._outcome
        if self._has_ended:
            shares = [share[outcome[share] <= WENT_ON] for share in shares]
        together = shares
        if self._any_alone:
            together = [share[~self._alone[share]] for share in shares]
        move, ended = move_lanes(), 0
        if len(together) == 1:
            share = together[0]
            ended = move(
                lanes.places, share, self._until, steps, self._command, outcome, lanes.events
            )
        else:
            counts = [0] * len(together)

            def work(thread: int) -> None:
                counts[thread] = move(
                    lanes.places, together[thread], self._until, steps, self._command, outcome,
                    lanes.events,
                )  # fmt: skip

            self._crew.work(work)
            ended = sum(counts)
        if ended:
            self._has_ended = True
            for index in np.concatenate(together).tolist():
                if outcome[index] > WENT_ON:
                    lanes.lanes[index].came_to(int(outcome[index]))
        if self._any_alone:
            for index in np.concatenate([share[self._alone[share]] for share in shares]).tolist():
                self._move_alone(index, steps)

    def _move_alone(self, index: int, steps: int) -> None:
        """Move a lane whose controller has to be looked at."""
        lane = self._lanes.lanes[index]
        lane.move(float(self._until[index]), steps)
        lane.count_events()
        if lane.status is RunStatus.INTERRUPTED:
            raise KeyboardInterrupt
        if lane.status not in CAN_GO_ON:
            self._outcome[index] = _OUTCOME_OF[lane.status]
            self._has_ended = True


_OUTCOME_OF = {
    RunStatus.FELL: int(Outcome.FELL),
    RunStatus.STOPPED: int(Outcome.STOPPED),
    RunStatus.DIVERGED: int(Outcome.DIVERGED),
    RunStatus.SOLVER_FAILED: int(Outcome.SOLVER_FAILED),
    RunStatus.CONTROLLER_FAILED: int(Outcome.BAD_CONTROLLER),
}


def commanded_width(plans: Sequence[Plan], others: Sequence[int] = ()) -> int:
    """Return how many numbers each lane is commanded with, or refuse lanes that differ in it."""
    laws = [plan.law for plan in plans if plan.law.commanded]
    found = {*others, *(int(getattr(law.parameters, law.commanded).size) for law in laws)}
    if len(found) > 1:
        raise SimulationError(
            f"the controllers of all lanes must take equally many commands, got {sorted(found)}"
        )
    return found.pop() if found else plans[0].setting.robot.nu


def checked_threads(threads: int, lanes: int) -> int:
    """Return how many threads there is work for, or refuse what is no number of them."""
    if threads < 1:
        raise SimulationError(f"threads must be at least 1, got {threads}")
    return min(threads, lanes)


def _read_only(array: Any) -> Any:
    seen = array[...]
    seen.flags.writeable = False
    return seen
