"""Limit cycles of walking: fixed points of the Poincaré map, and their stability.

A gait that repeats is a fixed point of the map from touchdown to touchdown; the eigenvalues of the
map's derivative there, its Floquet multipliers, tell how small disturbances grow or die from step
to step (Goswami, Thuilot, Espiau 1998; Strogatz, *Nonlinear Dynamics and Chaos*, section 8.7).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from heelstrike.analysis.poincare_map import Carried, PoincareMap, Section, check_steps
from heelstrike.analysis.stability.loop import ClosedLoop
from heelstrike.analysis.stability.repeating import Repeating, repeating_walk
from heelstrike.analysis.step_image import Derivatives, StepImage
from heelstrike.arguments import takes
from heelstrike.contact.ground import Ground
from heelstrike.errors import LimitCycleError, SimulationError
from heelstrike.field_texts import dataclass
from heelstrike.notebook import ShownInNotebooks
from heelstrike.robot.model import Floats
from heelstrike.robot.robot import Robot
from heelstrike.robot.state import State
from heelstrike.sim.controller.interface import Controller
from heelstrike.sim.event_driven.method import EventDriven
from heelstrike.sim.method import Method
from heelstrike.sim.snapshot import Snapshot

# How often a Newton step is halved when the walk does not go on after it.
HALVINGS = 6
# A step that differs by less than this part of what the one before did is not differentiated again.
FAST = 0.1


@dataclass(frozen=True, eq=False, kw_only=True)
class LimitCycle(ShownInNotebooks):
    """A walk that repeats from step to step."""

    state: State
    """State just after touchdown, relabelled so that the same foot stands at every step; the first
    contact point that stands is level with the world's origin. In the middle of a step, and where
    the walk was found, if the controller goes on from step to step."""
    period: float
    """Duration of a step in s."""
    step_length: float
    """Distance along the ground (m) by which a step moves the robot on."""
    multipliers: NDArray[np.complex128]
    """(m,) Floquet multipliers of `steps` steps, largest first: factors by which small disturbances
    of the state grow from one touchdown to the next. m is the number of disturbances that the feet
    on the ground allow; shifts along the ground are not among them."""
    residual: float
    """Largest difference between `state` and its image one step later (m, rad, m/s, rad/s), and
    between what the controller remembers then."""
    iterations: int
    """Newton steps taken."""
    memory: Floats = field(default_factory=lambda: np.zeros(0))
    """(k,) What the controller remembers just after touchdown, of what is carried from step to
    step."""
    steps: int = 1
    """Steps after which the walk repeats: one, as its legs are relabelled; two on two legs, of a
    controller that goes on from step to step."""
    snapshot: Snapshot | None = None
    """Such a walk with all that its controller remembers, to be taken up as the `state` of a
    simulation."""
    differences: str = ""
    """Why `multipliers` are those of differences of whole steps; empty where the derivative of the
    step is exact."""

    @property
    def stable(self) -> bool:
        """Whether every small disturbance dies out."""
        return bool(np.all(np.abs(self.multipliers) < 1.0))

    def __repr__(self) -> str:
        largest = np.abs(self.multipliers).max(initial=0.0)
        after = f" in {self.steps} steps" if self.steps > 1 else ""
        return (
            f"LimitCycle({self.step_length:.9g} m in {self.period:.9g} s, largest multiplier "
            f"{largest:.6g}{after}: {'stable' if self.stable else 'unstable'})"
        )


# More arguments than eight: what walks, and how its steps are told apart, are a user's to say.
@takes(SimulationError)
def find_limit_cycle(
    robot: Robot,
    state: State | Snapshot,
    controller: Controller | None = None,
    *,
    afresh: bool = True,
    ground: Ground | None = None,
    method: Method | None = None,
    control_period: float | None = None,
    memory: Sequence[str] = (),
    relabelled: Callable[[Any, float], None] | None = None,
    landing: Sequence[int] | None = None,
    symmetry: Callable[[State], State] | None = None,
    longest_step: float = 3.0,
    tolerance: float = 1e-10,
    max_iterations: int = 20,
) -> LimitCycle:
    """Find a limit cycle of a walking robot near a state, and its Floquet multipliers.

    Newton's method on the map from touchdown to touchdown, whose derivative is that of flows and
    events (:func:`~heelstrike.monodromy`). What cannot be linearised, such as a sampled controller,
    one in Python or one that carries memory on, is differentiated by differences of whole steps, of
    fourth order for the multipliers, and `differences` says why.

    Parameters
    ----------
    robot : Robot
        The robot; its first two coordinates are the world position x, z of one of its points.
    state : State or Snapshot
        Where to begin, anywhere in a step; the search starts at the first touchdown after it. A
        state up to 0.1 mm in the ground, such as time stepping leaves, is lifted out of it.
    controller : object with ``torque(t, state, contacts)``, or None
        What makes it walk.
    afresh : bool
        Whether the controller restarts at every touchdown: at time 0, with the memory it
        starts with but for the members that `memory` names. Otherwise it goes on from step to step
        with all that it remembers and on its own clock, as it does in simulations, and what repeats
        is the middle of the same foot's step.
    ground : Ground
        Flat or sloping ground; ``Ground()`` by default.
    method : Method
        Simulation method, ``EventDriven(rtol=1e-12, atol=1e-13)`` by default, or any other of a
        controller that goes on. Passive walkers whose swing foot scuffs need
        ``swing_feet_pass=True``.
    control_period : float, optional
        Seconds between two calls of the controller, whose torques are held between them; counted
        from every touchdown if it restarts there. By default that of the controller, or it
        acts continuously.
    memory : sequence of str, optional
        With `afresh`, members of the controller's memory that are carried from step to step: part
        of what repeats, and of what is disturbed. In a shell they are named as in
        ``inside.filtered``, ``own.joint_rate``.
    relabelled : callable, optional
        ``relabelled(memory, time)`` changes the memory at the end of a step, which took a time, to
        that at the beginning of the next: legs exchanged, times counted from the touchdown.
    landing : sequence of int, optional
        Contact points all of which must have come down to complete a step. By default those of
        either foot if the robot has a mirror image, else any point.
    symmetry : callable, optional
        Takes a state just after touchdown to that of the same robot with its legs relabelled. By
        default the exchange of left and right for a robot that has a mirror image, the turn by
        whole spokes for a wheel, and nothing if `landing` is given.
    longest_step : float
        Seconds after which a step without touchdown has failed.
    tolerance : float
        Largest difference between the state found and its image (m, rad, m/s, rad/s).
    max_iterations : int
        Newton steps after which the search has failed.

    Returns
    -------
    LimitCycle

    Raises
    ------
    LimitCycleError
        If the robot does not complete its steps, if other contact points stand at the end of a
        step than at its beginning, or if Newton's method does not converge.
    SimulationError
        If an argument is not usable.

    Notes
    -----
    A walk under a sampled controller that goes on repeats only if it keeps step with the samples.
    If not, touchdowns fall between two calls as they come, and ``floquet_multipliers`` tells how
    errors die. ``afresh=False`` takes some dozen returns of the walk for every number of the state
    and the memory.

    Where the order of contacts is different for different disturbances - a flat foot comes down
    heel first or toe first - the map has a kink: multipliers are then those of a mean of its sides.
    """
    if max_iterations < 0 or not tolerance > 0.0:
        raise SimulationError(
            "max_iterations must not be negative and the tolerance positive; got "
            f"{max_iterations!r}, {tolerance!r}"
        )
    ground = Ground() if ground is None else ground
    method = EventDriven(rtol=1e-12, atol=1e-13) if method is None else method
    if not afresh:
        given = {
            "memory": len(memory) > 0, "relabelled": relabelled is not None,
            "landing": landing is not None, "symmetry": symmetry is not None,
        }  # fmt: skip
        for name, told in given.items():
            if told:
                raise SimulationError(
                    f"{name} is for controllers that restart at every touchdown; without "
                    "afresh all memory is carried and no leg relabelled"
                )
        loop = ClosedLoop(
            robot, controller, state, method=method, ground=ground, control_period=control_period,
            record_every=1,
        )  # fmt: skip
        found = repeating_walk(
            loop, longest_step=longest_step, tolerance=tolerance, max_iterations=max_iterations
        )
        return _going_on(found)
    _check(robot, ground, state, method)
    assert isinstance(state, State)
    assert isinstance(method, EventDriven)
    section = Section(robot, ground)
    walked = PoincareMap(
        section, controller, method, landing, symmetry, longest_step, control_period,
        Carried(tuple(memory), relabelled),
    )  # fmt: skip
    start = state if method.swing_feet_pass else section.lifted(state)
    landed = walked(start, walked.begin(start))
    state, kept = landed.state, landed.memory
    before, derivatives = np.inf, Derivatives()
    for iteration in range(max_iterations + 1):
        image = StepImage(walked, section.chart(state), kept)
        end = walked(state, kept)
        change = image.coordinates(end)
        residual = float(np.abs(change).max(initial=0.0))
        if residual <= tolerance:
            slope = derivatives.sharp(image, state, end)
            multipliers = np.linalg.eigvals(slope).astype(np.complex128)
            return LimitCycle(
                state=state,
                period=end.time,
                step_length=end.length,
                multipliers=multipliers[np.argsort(-np.abs(multipliers), kind="stable")],
                residual=residual,
                iterations=iteration,
                memory=kept,
                differences=derivatives.why_not,
            )
        if iteration == 0 or residual > FAST * before:
            slope = derivatives.good_enough(image, state, end)
        before = residual
        newton = np.asarray(np.linalg.lstsq(np.eye(len(change)) - slope, change)[0], np.float64)
        state, kept = _moved_on(image, newton)
    raise LimitCycleError(
        f"no limit cycle of robot {robot.name!r} in {max_iterations} iterations: its state still "
        f"changes by {residual:.3g} from step to step; begin nearer to the cycle"
    )


def _going_on(found: Repeating) -> LimitCycle:
    """Tell of a walk that goes on from step to step."""
    walk = found.walk
    return LimitCycle(
        state=walk.begins[0].state,
        period=walk.duration / walk.steps,
        step_length=walk.length / walk.steps,
        multipliers=found.errors.multipliers,
        residual=found.residual,
        iterations=found.iterations,
        steps=walk.steps,
        snapshot=walk.begins[0],
        differences="its controller goes on from step to step with all that it remembers",
    )


def _check(robot: Robot, ground: Ground, state: Any, method: Any) -> None:
    """Refuse what has no limit cycles from touchdown to touchdown."""
    if not isinstance(state, State):
        raise SimulationError(
            "a controller that restarts at every touchdown needs a State to start from; "
            "to continue from a Snapshot use afresh=False"
        )
    if not isinstance(method, EventDriven):
        raise SimulationError(
            "limit cycles from touchdown to touchdown need EventDriven, got "
            f"{type(method).__name__}: other methods do not locate touchdowns exactly "
            "enough. With afresh=False every method works"
        )
    check_steps(robot, ground)


def _moved_on(image: StepImage, newton: Floats) -> tuple[State, Floats]:
    """Return state and memory after a Newton step, shortened until the walk goes on from there."""
    for halving in range(HALVINGS):
        try:
            image(0.5**halving * newton)
        except LimitCycleError:
            continue
        return image.at(0.5**halving * newton)
    return image.at(0.5**HALVINGS * newton)
