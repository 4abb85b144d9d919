"""What the lanes of a batch are to be: arguments that are for all or one a lane, checked."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any, NamedTuple

import numpy as np

from heelstrike.arguments import are_numbers, refusal
from heelstrike.compiler.bundle import Bundle
from heelstrike.errors import ControllerError, RobotError, SimulationError
from heelstrike.robot.model import Floats
from heelstrike.robot.robot import Robot
from heelstrike.robot.spatial.robot import SpatialRobot
from heelstrike.robot.state import State
from heelstrike.sim.clock import Clock
from heelstrike.sim.contacts.latches import is_one, several
from heelstrike.sim.controller.interface import Controller
from heelstrike.sim.controller.law import Law, law_of
from heelstrike.sim.dimension import AnyRobot, dimension_of
from heelstrike.sim.frame import compiled_loop, fixed_for
from heelstrike.sim.method import Method, work_of
from heelstrike.sim.push import Push
from heelstrike.sim.setting import Setting, checked_setting
from heelstrike.sim.simulation import has_warned
from heelstrike.sim.snapshot import Snapshot

Joints = str | int | Iterable[str | int]


class Plan(NamedTuple):
    """What one lane of a batch is to be.

    Attributes
    ----------
    setting : Setting
    law : Law
    latched : iterable of str or int, optional
        Joints that its latches hold as it begins, as they were asked for.
    """

    setting: Setting
    law: Law
    latched: Any


def planned(
    method: Method, setup: Mapping[str, Any], *,
    robot: AnyRobot | Sequence[AnyRobot], controller: Controller | Sequence[Controller] | None,
    state: State | Snapshot | Sequence[State], parameters: Any, pushes: Any,
    ground: Any, latched: Any, braked: Any,
    **more: Sequence[Any],
) -> tuple[list[Plan], list[dict[str, Any]]]:  # fmt: skip
    """Check what the lanes of a batch are to be.

    Parameters
    ----------
    method : Method
        Simulation method.
    setup : mapping
        What is the same for all.
    robot, controller, state, parameters, pushes, ground, latched, braked
        For all, or one entry a lane.
    **more : sequence
        Other arguments, of one entry or one a lane.

    Returns
    -------
    plans : list of Plan
        Of each lane.
    asked : list of dict
        The arguments of each, by name.

    Raises
    ------
    SimulationError, ControllerError
        That names the lane if there are several.
    """
    asked = _one_a_run(
        robot=_listed(robot),
        controller=_listed(controller),
        state=_states(state),
        **more,
        parameters=_parameters(parameters),
        pushes=_pushes(pushes),
        ground=_listed(ground),
        latched=[None] if latched is None else _joints("latched", latched),
        braked=_joints("braked", braked),
    )
    begin = dimension_of(asked[0]["robot"]).compiles_meanwhile
    laws = {id(each): _law(each, begin=begin) for each in _listed(controller)}
    plans = []
    for index, each in enumerate(asked):
        with naming(index, len(asked)):
            arguments = {name: value for name, value in each.items() if name not in more}
            law = laws[id(arguments.pop("controller"))]
            plans.append(_plan(method, law, setup, **arguments))
    return plans, asked


def _plan(
    method: Method, law: Law, setup: Mapping[str, Any], *, robot: AnyRobot, state: State,
    parameters: Any, **about: Any,
) -> Plan:  # fmt: skip
    setting = checked_setting(robot, state, **setup, **about)
    dimension_of(robot).check(method, setting)
    has_warned(method, setting)
    method.set_clock(setting, Clock())
    if isinstance(parameters, Mapping):
        try:
            parameters = law.parameters.replaced(**parameters)
        except TypeError as error:
            raise SimulationError(f"parameters: {error}") from error
    law = law if parameters is None else law.with_parameters(parameters)
    law.numbers(robot)
    return Plan(setting, law, about["latched"])


def compile_all(method: Method, plans: Sequence[Plan]) -> float:
    """Compile, or load, what moves some lanes; return the seconds that the loops took."""
    seconds = 0.0
    settings = {(id(plan.setting.robot), id(plan.setting.ground)): plan.setting for plan in plans}
    found = set()
    for setting in settings.values():
        work = work_of(method, setting.robot)
        found.add(fixed_for(setting.robot, setting.ground.model(), work, method))
    for fixed in found:
        seconds += compiled_loop(method.kernels, method.work, fixed)[1]
    for plan in {plan.law.function: plan for plan in plans}.values():
        dimension_of(plan.setting.robot).words_of(plan.law)
    return seconds


def _one_a_run(**entries: Sequence[Any]) -> list[dict[str, Any]]:
    """Return the arguments of each run, where those with one entry are for all."""
    sizes = {name: len(values) for name, values in entries.items()}
    for name, size in sizes.items():
        if size == 0:
            raise SimulationError(f"{name} is empty: there is nothing to simulate")
    several = {name: size for name, size in sizes.items() if size > 1}
    if len(set(several.values())) > 1:
        described = ", ".join(f"{name} for {size}" for name, size in several.items())
        raise SimulationError(
            f"the arguments are for different numbers of runs: {described}. Each must have one "
            "entry for all runs, or as many as the others"
        )
    return [
        {name: values[index % len(values)] for name, values in entries.items()}
        for index in range(max(sizes.values()))
    ]


def _listed(value: Any) -> Sequence[Any]:
    return value if isinstance(value, Sequence) else [value]


def _states(state: State | Snapshot | Sequence[State]) -> Sequence[State]:
    if any(isinstance(each, Snapshot) for each in _listed(state)):
        raise SimulationError(
            "a batch starts from states, not from snapshots; to continue one snapshot "
            "use simulate(state=snapshot)"
        )
    if isinstance(state, Sequence):
        return state
    if not isinstance(state, State):
        raise SimulationError(f"state must be a State or several, got {type(state).__name__}")
    if state.q.ndim == 1 and state.v.ndim == 1:
        return [state]
    for name, array in (("q", state.q), ("v", state.v)):
        if array.ndim not in (1, 2):
            raise SimulationError(
                f"state.{name} must have shape (n{name},) or (runs, n{name}), got {array.shape}"
            )
    q, v = np.atleast_2d(state.q), np.atleast_2d(state.v)
    if len(q) != len(v) and 1 not in (len(q), len(v)):
        raise SimulationError(f"state.q is for {len(q)} runs and state.v for {len(v)}")
    size = max(len(q), len(v))
    return [State(q[i % len(q)], v[i % len(v)]) for i in range(size)]


def _parameters(parameters: Any) -> Sequence[Bundle | Mapping[str, Floats] | None]:
    """Parameters run by run: bundles, or members by name."""
    if parameters is None:
        return [None]
    bundles = _listed(parameters)
    if all(isinstance(each, Bundle) for each in bundles):
        return bundles
    if not isinstance(parameters, Mapping):
        raise SimulationError(
            "parameters are a bundle, one bundle a run, or a mapping of names to arrays with one "
            f"entry a run; got {type(parameters).__name__}"
        )
    for name, values in parameters.items():
        if not are_numbers(values):
            raise SimulationError(refusal(f"parameters: {name}", values, ("ArrayLike",)))
    columns = {name: np.asarray(values, dtype=np.float64) for name, values in parameters.items()}
    shapes = {name: values.shape for name, values in columns.items()}
    if len({shape[:1] for shape in shapes.values()} | {()}) != 2:
        raise SimulationError(f"parameters must have one entry a run, got arrays of shape {shapes}")
    for name, values in columns.items():
        if not np.all(np.isfinite(values)):
            raise SimulationError(f"parameters: {name} must be finite")
    rows = zip(*columns.values(), strict=True)
    return [
        {name: np.array(value) for name, value in zip(columns, row, strict=True)} for row in rows
    ]


def _pushes(pushes: Any) -> Sequence[Sequence[Push]]:
    if isinstance(pushes, Push):
        return [(pushes,)]
    if not isinstance(pushes, Sequence):
        raise SimulationError(f"pushes must be Push(...) or several, got {pushes!r}")
    if all(isinstance(each, Push) for each in pushes):
        return [tuple(pushes)]
    if all(isinstance(each, Sequence) for each in pushes):
        return [tuple(each) for each in pushes]
    raise SimulationError(
        "pushes are either a sequence of Push for all runs, or one such sequence a run; this "
        "mixes the two"
    )


def _joints(name: str, joints: Any) -> Sequence[Any]:
    """Joints run by run: those of a plain sequence are for all."""
    listed = list(several(name, joints))
    single = [is_one(each) for each in listed]
    if all(single):
        return [tuple(listed)]
    if any(single):
        raise SimulationError(
            f"{name} are either joints for all runs, or several such lists, one a run; this mixes "
            "the two. The list of a run with one joint has one entry, that of a run without is []"
        )
    return [each if each is None else tuple(several(name, each)) for each in listed]


_ALIKE = {
    "nv": "coordinates", "nq": "positions", "nu": "actuators", "nc": "contact points",
    "loops": "closed loops", "couplings": "coupled joints", "latches": "latches",
    "brakes": "brakes",
}  # fmt: skip


def _check_robots(robots: Sequence[Any]) -> None:
    for index, robot in enumerate(robots):
        if not isinstance(robot, Robot | SpatialRobot):
            raise SimulationError(f"robot must be a Robot or several, got {robot!r}")
        if type(robot) is not type(robots[0]):
            raise SimulationError(
                "the robots of a batch live all in the plane or all in space: robot "
                f"{index} is a {type(robot).__name__}, the first a {type(robots[0]).__name__}"
            )
        for name, what in _ALIKE.items():
            first, other = (getattr(each.model, name, 0) for each in (robots[0], robot))
            if first != other:
                raise SimulationError(
                    f"the robots of a batch must be built alike: robot {index} has {other} "
                    f"{what}, the first has {first}"
                )


def way_of(robot: AnyRobot | Sequence[AnyRobot], method: Method | None) -> Method:
    """Return how the robots of a batch go through time as a method says, or refuse it."""
    robots = _listed(robot)
    if not robots:
        raise SimulationError("robot is empty: there is nothing to simulate")
    _check_robots(robots)
    return dimension_of(robots[0]).way(method)


def _law(controller: Any, *, begin: bool) -> Law:
    """Return the law that a controller is, which must be one that can be compiled."""
    law = law_of(controller, begin=begin)
    if law is None or not law.function.compiles:
        raise ControllerError(
            f"{type(controller).__name__} runs in Python, so a batch of it would run one at a "
            "time. Write it as a function and compile that with heelstrike.controller, or call "
            "simulate for each run"
        )
    return law


@contextmanager
def naming(index: int, count: int) -> Iterator[None]:
    """Tell which of several runs an error is about."""
    try:
        yield
    except (RobotError, SimulationError) as error:
        if count == 1:
            raise
        raise type(error)(f"run {index}: {error}") from error
