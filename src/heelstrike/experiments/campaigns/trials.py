"""The trials of a block, simulated together and judged one by one."""

from __future__ import annotations

import hashlib
import io
import json
import math
import pickle
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from time import thread_time
from typing import Any

import numpy as np

from heelstrike.analysis.stability.trial import ROWS, Trial
from heelstrike.compiler.bundle import Bundle
from heelstrike.errors import HeelstrikeError, SimulationError
from heelstrike.experiments.campaigns.outcome import CRASHED, REFUSED, Outcome, judged
from heelstrike.experiments.campaigns.targets import TRIAL, Laid, laid, target
from heelstrike.field_texts import dataclass
from heelstrike.robot.named_tree import NamedTree
from heelstrike.sim.batch.runs import simulate_batch
from heelstrike.sim.closed_sets import OnError
from heelstrike.sim.controller.law import Law, law_of
from heelstrike.sim.run import Run
from heelstrike.sim.simulation import simulate

_PROTOCOL = 4
"""Of pickles in digests: versions of Python choose others, whose bytes differ."""


@dataclass(frozen=True, eq=False)
class Block:
    """Some trials of a campaign, which go to a worker together."""

    trials: Mapping[str, Trial]
    """Trials as they are before anything differs, by their names."""
    numbers: tuple[int, ...]
    """Numbers of the trials in the campaign."""
    values: tuple[Mapping[str, Any], ...]
    """What is other in each, by the names of the parameters."""
    seeds: tuple[int, ...]
    """What is random in each follows from it."""
    duration: float
    """How long each lasts, in s."""
    limit: float | None
    """Seconds of a processor after which one is given up."""


def run_block(block: Block, stopped: Callable[[], bool] | None = None) -> list[Outcome]:
    """Simulate the trials of a block.

    Parameters
    ----------
    block : Block
        The trials.
    stopped : callable, optional
        Whether to stop; what is returned then is of no use.

    Returns
    -------
    list of Outcome
        What each came to. One that cannot begin is refused, and the others run.
    """
    found: dict[int, Outcome] = {}
    lanes: dict[str, list[tuple[int, Laid]]] = {}
    for index, (values, seed) in enumerate(zip(block.values, block.seeds, strict=True)):
        try:
            name, trial = chosen(block.trials, values)
            lanes.setdefault(name, []).append((index, laid_out(trial, values, seed)))
        except Exception as error:
            found[index] = failed(error)
    for name, some in lanes.items():
        found |= _simulated(block, block.trials[name], some, stopped)
    return [found[index] for index in range(len(block.numbers))]


def failed(error: Exception) -> Outcome:
    """Return the outcome of a trial that an error ended: one of ours refuses it."""
    if isinstance(error, HeelstrikeError):
        return Outcome(REFUSED, str(error), success=False)
    return Outcome(CRASHED, f"{type(error).__name__}: {error}", success=False)


def chosen(trials: Mapping[str, Trial], values: Mapping[str, Any]) -> tuple[str, Trial]:
    """Return the trial that values choose, the first if they choose none, and its name."""
    name = str(values.get(TRIAL, next(iter(trials))))
    if name not in trials:
        raise SimulationError(f"there is no trial {name!r}; there are {', '.join(trials)}")
    return name, trials[name]


def laid_out(trial: Trial, values: Mapping[str, Any], seed: int) -> Laid:
    """Lay values on a trial; see :func:`~heelstrike.experiments.campaigns.targets.laid`."""
    return laid(trial, {name: each for name, each in values.items() if name != TRIAL}, seed)


def replayed(
    trial: Trial, lane: Laid, duration: float, record_every: int = ROWS,
    progress: Callable[[float], None] | None = None,
) -> Run:  # fmt: skip
    """Simulate a trial alone, to the last bit as in its block."""
    return simulate(
        lane.robot, lane.controller, state=lane.state, duration=duration, method=trial.method,
        ground=lane.ground, pushes=lane.pushes, control_period=trial.control_period,
        on_error=OnError.STOP, record_every=record_every, progress=progress,
    )  # fmt: skip


def _alone(
    block: Block, trial: Trial, lane: Laid, stopped: Callable[[], bool] | None
) -> Outcome:  # fmt: skip
    """Simulate one trial under a controller in Python, until it has taken too long."""
    end = math.inf if block.limit is None else thread_time() + block.limit

    def look(_: float) -> None:
        if thread_time() > end or (stopped is not None and stopped()):
            raise KeyboardInterrupt  # which ends a run quietly, as that of a person

    found = judged_as_in(trial, replayed(trial, lane, block.duration, progress=look))
    if found.given_up and thread_time() > end:
        told = f"took more than {block.limit:g} s of the processor: {found.message}"
        return replace(found, message=told)
    return found


def _simulated(
    block: Block, trial: Trial, lanes: list[tuple[int, Laid]], stopped: Callable[[], bool] | None
) -> dict[int, Outcome]:
    """Simulate trials of one kind; where one of several is refused, each half by itself."""
    if law_of(lanes[0][1].controller) is None:  # controllers in Python run one at a time
        found = {}
        for index, lane in lanes:
            try:
                found[index] = _alone(block, trial, lane, stopped)
            except Exception as error:
                found[index] = failed(error)
        return found

    def look(*_: int) -> None:
        if stopped is not None and stopped():
            raise KeyboardInterrupt  # which ends a batch quietly, as that of a person

    each = [lane for _, lane in lanes]
    try:
        result = simulate_batch(
            _same([lane.robot for lane in each]), _same([lane.controller for lane in each]),
            state=[lane.state for lane in each], duration=block.duration, method=trial.method,
            ground=_same([lane.ground for lane in each]), pushes=[lane.pushes for lane in each],
            control_period=trial.control_period, record_every=ROWS, on_error=OnError.STOP,
            threads=1, time_limit=block.limit, progress=look,
        )  # fmt: skip
        return {i: judged_as_in(trial, result.run(k)) for k, (i, _) in enumerate(lanes)}
    except Exception as error:
        if len(lanes) == 1 or (stopped is not None and stopped()):
            return {index: failed(error) for index, _ in lanes}
        half = len(lanes) // 2
        return _simulated(block, trial, lanes[:half], stopped) | _simulated(
            block, trial, lanes[half:], stopped
        )


def judged_as_in(trial: Trial, run: Run) -> Outcome:
    """Judge the run of a trial, by the gait that its law follows, if it follows one."""
    return judged(run, getattr(trial.controller, "gait", None))


def _same(several: list[Any]) -> Any:
    """Return what all lanes have, once; else all of them."""
    return several[0] if all(each is several[0] for each in several) else several


def inputs_digest(trial: Trial, duration: float) -> str:
    """Digest of all that the runs of a trial follow from, but for what differs among them.

    Of a controller in Python its class counts, and what its attributes are, pickled; of robots in
    them, as of that of the trial, names and numbers.
    """
    from heelstrike import __version__

    digest = hashlib.sha256(__version__.encode())
    robot, law = trial.robot, trial.controller
    control = type(law).__module__, type(law).__qualname__, getattr(law, "period", None)
    digest.update(
        repr((*_named(robot), control, trial.method, duration,
              trial.control_period, trial.begins, trial.edge, trial.speed,
              trial.settling)).encode()
    )  # fmt: skip
    bundles: list[Bundle] = [robot.model]
    if isinstance(law, Law):
        digest.update(f"{law.function.python.__module__}.{law.function.name}".encode())
        bundles += law.numbers(robot)
        digest.update(_code_of(law.function.python))
    else:
        digest.update(_attributes_of(law))
    arrays = [*trial.ground.numbers().items(), ("q", trial.state.q), ("v", trial.state.v)]
    arrays += [each for bundle in bundles for each in bundle.storage()]
    _add(digest, arrays)
    return digest.hexdigest()


def _named(robot: NamedTree) -> tuple[Any, ...]:
    names = robot.link_names, robot.joint_names, robot.actuator_names, robot.contact_names
    return robot.name, names, getattr(robot, "constraints", ())


def _add(digest: Any, arrays: Iterable[tuple[str, Any]]) -> None:
    for name, array in arrays:
        digest.update(f"{name} {array.dtype} {array.shape};".encode())
        digest.update(np.ascontiguousarray(array).tobytes())


class _Digesting(pickle.Pickler):
    """Pickles a robot as its names and numbers, wherever its classes are."""

    def persistent_id(self, held: Any) -> str | None:
        if not isinstance(held, NamedTree):
            return None
        feet = [(foot.name, foot.link, foot.contacts) for foot in held.feet]
        digest = hashlib.sha256(repr((*_named(held), feet)).encode())
        _add(digest, held.model.storage())
        return digest.hexdigest()


def _code_of(function: Any) -> bytes:
    """What a function does: its code, its constants, and what it names."""
    code = getattr(function, "__code__", None)
    if code is None:
        return b""
    named = [repr(getattr(function, "__globals__", {}).get(name)) for name in code.co_names]
    plain = [text for text in named if " at 0x" not in text]  # addresses differ from run to run
    return b"\0".join(
        [code.co_code, repr(code.co_consts).encode(), repr(code.co_names).encode(),
         *(text.encode() for text in plain)]
    )  # fmt: skip


def _attributes_of(law: Any) -> bytes:
    """What a controller in Python holds, as bytes that differ where it does."""
    torque, held = getattr(type(law), "torque", None), io.BytesIO()
    try:
        _Digesting(held, _PROTOCOL).dump(getattr(law, "__dict__", None))
    except Exception:
        raise SimulationError(
            f"controller {type(law).__name__} cannot be told from others of its class, since it "
            "cannot be pickled; a campaign would take outcomes of one for those of another. Give "
            "it attributes that pickle takes, or write it with @hs.controller"
        ) from None
    return _code_of(torque) + held.getvalue()


def trial_digest(base: str, values: Mapping[str, Any], seed: int) -> bytes:
    """Digest of all that the run of one trial follows from."""
    text = json.dumps([base, dict(values), seed], sort_keys=True)
    return hashlib.sha256(text.encode()).digest()[:16]


def check_parameters(trials: Mapping[str, Trial], values: Sequence[Mapping[str, Any]]) -> None:
    """Refuse parameters that no trial has, before anything runs.

    Raises
    ------
    SimulationError
        If one is not known.
    """
    seen: set[str] = set()
    targets = [target(name) for name in sorted(set().union(*values) - {TRIAL})]
    pushes = [each.number for each in targets if each.group == "push"]
    if pushes and "impulse" not in pushes:
        raise SimulationError(f"push.{pushes[0]} is of a push that has no push.impulse. Give one.")
    for each in values:
        _, trial = chosen(trials, each)
        for name in each.keys() - seen - {TRIAL}:
            laid(trial, {name: each[name]}, 0)
            seen.add(name)
