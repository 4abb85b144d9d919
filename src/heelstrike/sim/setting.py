"""What is to be simulated, checked before anything is."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any, Required, TypedDict

import numpy as np

from heelstrike.arguments import one_of, positive
from heelstrike.contact.ground import Ground
from heelstrike.dynamics.loops import count_rows
from heelstrike.dynamics.queries.loops import loop_displacement
from heelstrike.errors import SimulationError
from heelstrike.field_texts import dataclass
from heelstrike.once_each import once_each
from heelstrike.robot.loops import row_names
from heelstrike.robot.model import SCALES, Model
from heelstrike.robot.robot import Robot
from heelstrike.robot.state import State
from heelstrike.sim.closed_sets import OnError
from heelstrike.sim.dimension import AnyRobot, dimension_of
from heelstrike.sim.push import Push
from heelstrike.sim.snapshot import Snapshot

if TYPE_CHECKING:
    from heelstrike.contact.spatial.ground import SpatialGround
    from heelstrike.robot.spatial.model import SpatialModel
    from heelstrike.sim.method import Method

# The loops count in 64 bits.
MOST_EVERY = 2**62

# Loops that are open by no more than this (m, rad) are closed as a simulation begins.
OPEN_LOOP = 1e-6

# A walking robot has fallen when its centre of mass is below this fraction of its first height.
FALL_FRACTION = 0.5


class Setup(TypedDict, total=False):
    """Arguments of a simulation beside robot and controller; see :class:`heelstrike.Simulation`."""

    state: Required[State | Snapshot]
    method: Method | None
    ground: Ground | SpatialGround | None
    control_period: float | None
    record_every: int
    stop_when_fallen: bool | None
    pushes: Sequence[Push] | Push
    latched: Iterable[str | int] | None
    braked: Iterable[str | int]
    checked: bool
    on_error: OnError | str


@dataclass(frozen=True)
class Setting:
    """What is to be simulated."""

    robot: Any
    state: State
    """Where the robot begins."""
    ground: Any
    control_period: float | None
    """Seconds between two calls of the controller; None for as often as the method can."""
    record_every: int
    """Steps between two rows of the record."""
    fallen_height: float
    """Height of the centre of mass above the ground (m) below which the robot has fallen."""
    pushes: tuple[Push, ...]
    held: tuple[bool, ...]
    """Which latches of the robot are engaged as it begins."""
    braked: tuple[bool, ...]
    """Which of its brakes are on as it begins."""
    checked: bool
    """Whether compiled controllers run in Python, every index looked at."""
    on_error: OnError
    """What becomes of an error in the controller."""


def checked_setting(
    robot: AnyRobot,
    state: State,
    *,
    ground: Ground | SpatialGround | None = None,
    control_period: float | None = None,
    record_every: int = 1,
    stop_when_fallen: bool | None = None,
    pushes: Sequence[Push] | Push = (),
    latched: Iterable[str | int] | None = None,
    braked: Iterable[str | int] = (),
    checked: bool = False,
    on_error: OnError | str = OnError.WARN,
) -> Setting:
    """Check what is to be simulated.

    Raises
    ------
    SimulationError
        If something is not usable.
    """
    dimension = dimension_of(robot)
    ground = dimension.checked_ground(ground)
    state = dimension.checked_state(robot, state)
    if control_period is not None:
        positive("control_period", control_period, SimulationError)
    if not (hasattr(record_every, "__index__") and 1 <= record_every <= MOST_EVERY):
        raise SimulationError(f"record_every must be a whole number ≥ 1, got {record_every!r}")
    if stop_when_fallen is None:
        stop_when_fallen = robot.floating and len(robot.feet) > 1
    fallen_height = -np.inf
    if stop_when_fallen:
        fallen_height = FALL_FRACTION * dimension.height(robot, state, ground)
    held, on = dimension.held(robot, state, ground, latched, braked)
    return Setting(
        robot=robot,
        state=state,
        ground=ground,
        control_period=control_period,
        record_every=int(record_every),
        fallen_height=fallen_height,
        pushes=checked_pushes(robot, pushes),
        held=held,
        braked=on,
        checked=checked,
        on_error=one_of(OnError, "on_error", on_error, SimulationError),
    )


def checked_pushes(robot: AnyRobot, pushes: Sequence[Push] | Push) -> tuple[Push, ...]:
    """Return some pushes that act on links of the robot, or refuse them."""
    if isinstance(pushes, Push):
        pushes = (pushes,)
    for push in pushes:
        if not isinstance(push, Push):
            raise SimulationError(f"pushes must be Push(...), got {push!r}")
        push.place(robot)
    return tuple(pushes)


def identity_of(setting: Setting, method: Method, controller: str) -> dict[str, str]:
    """Say what a snapshot is one of: a simulation that is the same in this can take it up."""
    return {
        "robot": f"{setting.robot.name} {model_digest(setting.robot.model)}{_held_by(setting)}",
        "method": repr(method),
        "controller": controller + (", checked" if setting.checked else ""),
        "control_period": str(setting.control_period),
        "record_every": str(setting.record_every),
    }


def _held_by(setting: Setting) -> str:
    held = getattr(setting.robot, "constraints", ())  # of the plane only
    return f", {held}" if held else ""


@once_each
def model_digest(model: Model | SpatialModel) -> str:
    """Return what tells the numbers of a robot from those of others."""
    digest = hashlib.sha256()
    for name, value in model.members().items():
        number: Any = model.declared[name]
        usual = name in SCALES and np.all(value == number.default)
        if number.later and (np.size(value) == 0 or usual):
            continue  # snapshots that are older than the number stay good
        digest.update(f"{name} {np.shape(value)} ".encode() + np.asarray(value).tobytes())
    return digest.hexdigest()[:16]


def check_state(robot: Robot, state: State) -> None:
    """Refuse what is no state of a robot."""
    if not isinstance(state, State):
        raise SimulationError(
            f"state must be a State, got {type(state).__name__}; write State(q, v) with positions "
            "q and velocities v, or robot.reference_state()"
        )
    for name, vector, size in (("q", state.q, robot.nq), ("v", state.v, robot.nv)):
        if vector.shape != (size,):
            raise SimulationError(
                f"state.{name} must have {size} entries for robot {robot.name!r}, "
                f"got shape {vector.shape}"
            )
        if not np.all(np.isfinite(vector)):
            joint = robot.joint_names[int(np.flatnonzero(~np.isfinite(vector))[0])]
            raise SimulationError(f"state.{name} of joint {joint!r} is not finite")
    if count_rows(robot.model) == 0:
        return
    open_by = np.abs(loop_displacement(robot, state.q))
    if np.any(open_by > OPEN_LOOP):
        row = int(np.argmax(open_by))
        raise SimulationError(
            f"in this state the {row_names(robot)[row]} of robot {robot.name!r} is open by "
            f"{open_by[row]:.3g}; robot.closed(state) is the nearest state in which all hold"
        )
