"""What a parameter of a campaign changes, by its name: numbers of robot, ground, push, start, law.

A name may end in ``*`` or ``+``: then the value multiplies what is there, or is added to it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from heelstrike.analysis.stability.trial import Trial
from heelstrike.compiler.bundle import Bundle
from heelstrike.control import Actuated, Encoders, FootSensors, InertialUnit, Sensed
from heelstrike.errors import SimulationError
from heelstrike.field_texts import dataclass
from heelstrike.robot.model import NUMBERS, Floats
from heelstrike.robot.robot import Robot
from heelstrike.sim.controller.law import Law
from heelstrike.sim.push import Push
from heelstrike.wording import meant

TRIAL = "trial"
"""Parameter that chooses among several trials by their names."""

GROUND = ("friction", "restitution", "slope", "roughness")
PUSH = {"impulse": 0.0, "angle": 0.0, "start": math.nan, "duration": 0.1}
"""Numbers of a push, and what they are if nobody says: it begins when a disturbance may."""
SENSORS = {
    "delay": "s", "encoder_noise": "rad", "pitch_noise": "rad", "rate_noise": "rad/s",
    "force_noise": "N",
}  # fmt: skip
ACTUATORS = {"delay": "s", "bandwidth": "Hz", "efficiency": ""}
GROUPS = ("robot", "state", "ground", "push", "controller", "sensors", "actuators")

MOVED_BY = ("offset", "center_of_mass", "contact_position", "contact_radius", "reference", "length")
"""Numbers of the robot that move its feet."""


@dataclass(frozen=True)
class Target:
    """Where a parameter goes."""

    group: str
    """One of `GROUPS`."""
    number: str
    """What of it."""
    where: str
    """Link, joint, motor or contact point; nothing for all, or where there is but one."""
    how: str
    """``*`` multiplies, ``+`` adds, nothing sets."""

    def applied(self, before: Any, value: float) -> Any:
        """Return what becomes of a number, or of several."""
        if self.how == "*":
            if not np.any(before):
                raise SimulationError(
                    f"{self.group}.{self.number} * would do nothing: it is zero. Set it, or add to "
                    "it with +"
                )
            return before * value
        return before + value if self.how == "+" else np.zeros_like(before) + value


@dataclass(frozen=True, eq=False)
class Laid:
    """What a trial is to be: arguments of :func:`~heelstrike.simulate`."""

    robot: Robot
    controller: Any
    state: Any
    ground: Any
    pushes: tuple[Push, ...]


def target(name: str) -> Target:
    """Return where a parameter goes.

    Raises
    ------
    SimulationError
        If its name says nothing that is known.
    """
    words = name.strip()
    how = words[-1:] if words[-1:] in ("*", "+") else ""
    group, _, rest = words.removesuffix(how).strip().partition(".")
    number, _, where = rest.partition(".")
    if group not in GROUPS or not number:
        guess = meant(group, {each: repr(each) for each in GROUPS})
        raise SimulationError(
            f"there is no parameter {name!r}.{guess} A parameter is GROUP.NUMBER or "
            f"GROUP.NUMBER.WHERE, and the group is one of {', '.join(GROUPS)}, as in "
            '"robot.mass.trunk *" or "ground.friction"'
        )
    return Target(group, number, where, how)


def laid(trial: Trial, values: Mapping[str, Any], seed: int) -> Laid:
    """Lay the values of parameters on a trial.

    Parameters
    ----------
    trial : Trial
        The trial as it is.
    values : mapping
        Values by the names of their parameters.
    seed : int
        Of rough ground and noise.

    Raises
    ------
    HeelstrikeError
        If there is no such parameter, or a value is impossible.
    """
    targets = {name: target(name) for name in values}

    def given(group: str) -> list[tuple[Target, float]]:
        return [
            (each, _number(name, values[name]))
            for name, each in targets.items()
            if each.group == group
        ]

    robot = _robot(trial.robot, given("robot"))
    ground = _ground(trial, given("ground"), seed)
    state = _state(robot, trial, given("state"))
    moves = any(
        (each.group == "state" and each.number == "q") or each.number in MOVED_BY
        for each in targets.values()
    )  # fmt: skip
    if moves:
        state = robot.placed(state, ground)
    law = _controller(trial.controller, given("controller"))
    law = _sensed(law, given("sensors"), seed)
    law = _actuated(law, given("actuators"))
    return Laid(robot, law, state, ground, _pushes(trial, given("push")))


def _number(name: str, value: Any) -> float:
    """Return the value of a parameter, or refuse one that is no number."""
    if isinstance(value, bool) or not isinstance(value, int | float | np.integer | np.floating):
        raise SimulationError(f"parameter {name!r} must be a number, got {value!r}")
    return float(value)


def _robot(robot: Robot, given: list[tuple[Target, float]]) -> Robot:
    changed: dict[str, Floats] = {}

    def now(name: str) -> Floats:
        if name not in changed:
            changed[name] = np.array(getattr(robot.model, name), dtype=np.float64)
        return changed[name]

    for each, value in given:
        if each.number == "length":
            _lengthen(robot, each, value, now)
            continue
        known = NUMBERS.get(each.number)
        if known is None or known.kind is not float:
            numbers = {name: repr(name) for name, one in NUMBERS.items() if one.kind is float}
            raise SimulationError(
                f"a robot has no number {each.number!r}.{meant(each.number, numbers)}"
            )
        rows = _rows(robot, known.shape[0] if known.shape else "", each.where)
        array = now(each.number)
        array[rows] = each.applied(array[rows], value)
        least, most = known.least, known.most
        if not ((array[rows] >= least) & (array[rows] <= most)).all():
            raise SimulationError(
                f"robot.{each.number} would be {array[rows].ravel()[0]:.6g} "
                f"({each.where or 'everywhere'}); it lies between {least:g} and {most:g}"
            )
    return replace(robot, model=robot.model.replaced(**changed)) if changed else robot


def _lengthen(robot: Robot, each: Target, value: float, now: Callable[[str], Floats]) -> None:
    """Stretch links: where joints, masses and contact points are on them."""
    if each.how != "*":
        raise SimulationError(
            f"the length of a link is changed by a factor: write 'robot.length.{each.where} *'"
        )
    links = _rows(robot, "nl", each.where)
    model = robot.model
    chosen = np.zeros(model.nl, dtype=bool)
    chosen[links] = True
    hangs = (model.parent >= 0) & chosen[np.maximum(model.parent, 0)]
    now("offset")[hangs] *= value
    now("center_of_mass")[chosen] *= value
    now("contact_position")[chosen[model.contact_link]] *= value
    if model.loops:
        now("loop_position")[(model.loop_link >= 0) & chosen[np.maximum(model.loop_link, 0)]] *= (
            value
        )


def _rows(robot: Robot, extent: str | int, where: str) -> Any:
    """Return the places of a number; all of them if nobody says which."""
    if not where:
        return ...
    names = {
        "nl": robot.link_names, "nj": robot.joint_names, "nq": robot.joint_names,
        "nv": robot.joint_names, "nu": robot.actuator_names, "nc": robot.contact_names,
        "brakes": robot.brake_names,
    }.get(str(extent), ())  # fmt: skip
    if where not in names:
        guess = meant(where, {name: repr(name) for name in names})
        raise SimulationError(
            f"robot {robot.name!r} has no {where!r} there.{guess} It has {', '.join(names)}"
        )
    return max(i for i, name in enumerate(names) if name == where)  # its links before are massless


def _state(robot: Robot, trial: Trial, given: list[tuple[Target, float]]) -> Any:
    state = trial.state
    if not given:
        return state
    q, v = state.q.copy(), state.v.copy()
    for each, value in given:
        if each.number not in ("q", "v"):
            raise SimulationError(f"a state has q and v, and no {each.number!r}")
        array, joint = (q if each.number == "q" else v), robot.joint_index(each.where)
        array[joint] = each.applied(array[joint], value)
    return type(state)(q, v)


def _ground(trial: Trial, given: list[tuple[Target, float]], seed: int) -> Any:
    numbers: dict[str, float] = {}
    known = trial.ground.model()
    for each, value in given:
        if each.number not in GROUND:
            guess = meant(each.number, {name: repr(name) for name in GROUND})
            raise SimulationError(
                f"ground has no {each.number!r}.{guess} It has {', '.join(GROUND)}"
            )
        _refuse_where(each)
        before = 0.0
        if each.number in ("friction", "restitution"):
            before = float(getattr(known, each.number)[0])
        numbers[each.number] = float(each.applied(before, value))
    return trial.other_ground(seed=seed, **numbers) if numbers else trial.ground


def _pushes(trial: Trial, given: list[tuple[Target, float]]) -> tuple[Push, ...]:
    numbers = PUSH | {"start": trial.begins}
    link: str | int = int(trial.robot.model.pivot)
    for each, value in given:
        if each.number not in numbers:
            guess = meant(each.number, {name: repr(name) for name in PUSH})
            raise SimulationError(
                f"a push has no {each.number!r}.{guess} It has {', '.join(PUSH)}; push.impulse.LINK"
                " pushes another link than the trunk"
            )
        numbers[each.number] = float(each.applied(numbers[each.number], value))
        link = each.where or link
    if numbers["impulse"] == 0.0:
        return ()
    if not numbers["duration"] > 0.0:
        raise SimulationError(f"the duration of a push must be positive, got {numbers['duration']}")
    size, angle = numbers["impulse"] / numbers["duration"], numbers["angle"]
    force = size * math.cos(angle), size * math.sin(angle)
    return (Push(link, force=force, start=numbers["start"], duration=numbers["duration"]),)


def _controller(law: Any, given: list[tuple[Target, float]]) -> Any:
    if not given:
        return law
    if not isinstance(law, Law):
        raise SimulationError(
            "numbers of a controller are those of the parameters of a compiled one; "
            f"{type(law).__name__} has none"
        )
    parameters = law.parameters
    for each, value in given:
        path = [each.number, *filter(None, each.where.split("."))]
        parameters = _changed(parameters, path, partial(each.applied, value=value))
    return law.with_parameters(parameters)


def _changed(bundle: Bundle, path: list[str], change: Callable[[Any], Any]) -> Bundle:
    """Return parameters of which one number, or an array of them, is another."""
    members, name = bundle.members(), path[0]
    now = members.get(name)
    if isinstance(now, Bundle) and len(path) > 1:
        return bundle.replaced(**{name: _changed(now, path[1:], change)})
    if not isinstance(now, float) and not (isinstance(now, np.ndarray) and now.dtype.kind == "f"):
        names = {
            name: repr(name) for name, one in members.items()
            if isinstance(one, float | Bundle) or np.asarray(one).dtype.kind == "f"
        }  # fmt: skip
        raise SimulationError(
            f"the controller has no number {'.'.join(path)!r} to change.{meant(name, names)} It "
            f"has {', '.join(names) or 'none'}"
        )
    found = np.array(now, dtype=np.float64)
    rows: Any = ...
    if len(path) > 1:
        if not path[1].isdecimal() or found.ndim == 0 or int(path[1]) >= len(found):
            raise SimulationError(
                f"{'.'.join(path)!r} of the controller: after {name!r} stands the index of one of "
                f"its {len(found) if found.ndim else 'no'} rows, from 0, or nothing"
            )
        rows = int(path[1])
    found[rows] = change(found[rows])
    return bundle.replaced(**{name: found if isinstance(now, np.ndarray) else float(found)})


def _sensed(law: Any, given: list[tuple[Target, float]], seed: int) -> Any:
    numbers = _numbers("sensors", SENSORS, given)
    if not numbers:
        return law
    unit = {name.removeprefix("pitch_"): numbers[name] for name in ("pitch_noise", "rate_noise")
            if name in numbers}  # fmt: skip
    return Sensed(
        law,
        encoders=Encoders(noise=numbers["encoder_noise"]) if "encoder_noise" in numbers else None,
        imu=InertialUnit(**unit) if unit else None,
        feet=FootSensors(noise=numbers["force_noise"]) if "force_noise" in numbers else None,
        delay=_whole(law, numbers.get("delay", 0.0)),
        seed=seed,
    )


def _actuated(law: Any, given: list[tuple[Target, float]]) -> Any:
    numbers: dict[str, Any] = _numbers("actuators", ACTUATORS, given)
    if not numbers:
        return law
    return Actuated(law, **numbers | {"delay": _whole(law, numbers.get("delay", 0.0))})


def _numbers(
    group: str, known: Mapping[str, str], given: list[tuple[Target, float]]
) -> dict[str, float]:
    for each, _ in given:
        _refuse_where(each)
        if each.number not in known or each.how:
            guess = meant(each.number, {name: repr(name) for name in known})
            raise SimulationError(
                f"{group} have no {each.number!r} to set.{guess} They have {', '.join(known)}"
            )
    return {each.number: value for each, value in given}


def _refuse_where(each: Target) -> None:
    """Refuse a place where there is but one number."""
    if each.where:
        raise SimulationError(
            f"{each.group}.{each.number} is one number for all; leave {each.where!r} out"
        )


def _whole(law: Any, delay: float) -> float:
    """Return the next whole number of periods to a delay (s): calls come no nearer together."""
    from heelstrike.control.around import own_period

    period = own_period("delayed", law, None)
    return max(round(delay / period), 0) * period
