"""What a command walks: a saved gait, one that is designed, or the walk of a passive walker."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from heelstrike.cli.options import Method, Reading, Walking, method_called
from heelstrike.cli.terminal import stage, tell
from heelstrike.cli.values import ground_called, pushes_called

if TYPE_CHECKING:
    from heelstrike.analysis.limit_cycle import LimitCycle
    from heelstrike.experiments.laws import Entry
    from heelstrike.experiments.space import SpatialLaw
    from heelstrike.experiments.walk import Case
    from heelstrike.gait import Gait
    from heelstrike.robot import Robot, SpatialRobot
    from heelstrike.sim import Run
    from heelstrike.sim.method import Method as TimeMethod

FIRST_TIME = "(compiling the simulator, once: about 20 s)"


def law_asked(words: str | None, robot: Robot | None = None) -> Entry | None:
    """Return the law of an option, and tell whose code was run for it.

    Refused is one that cannot drive the robot; None is what nobody asked for.
    """
    from heelstrike.experiments.laws import check_law, law_called

    if words is None:
        return None
    law = law_called(words)
    if law.source:
        tell(f"controller {law.name}: the code of {law.source} has been run")
    if robot is not None:
        check_law(law, robot)
    return law


def spatial_law_asked(words: str) -> SpatialLaw:
    """Return the law of an option for robots in space, and tell whose code was run for it."""
    from heelstrike.experiments.space import spatial_law_called

    law = spatial_law_called(words)
    if law.source:
        tell(f"controller {law.name}: the code of {law.source} has been run")
    return law


def planar_robot_called(name: str, how: Reading) -> Robot:
    """Load a robot of the plane."""
    from heelstrike.robot.library import load_planar_robot

    return load_planar_robot(name, **how.keywords())


def robots_named(
    names: Sequence[str], dimension: int | None, how: Reading
) -> tuple[dict[str, SpatialRobot], dict[str, Robot]]:
    """Load robots in space by their names or files; or, of the plane, the first if it is a file.

    All are lifted into space if the first is there, by its file or because that was asked for.
    """
    from heelstrike.robot.library import builtin_robots, load_robot
    from heelstrike.robot.spatial.robot import SpatialRobot

    options: Any = how.keywords()
    if dimension is None and names[0] in builtin_robots():
        return {}, {}
    first: Any = load_robot(names[0], **options | {"dimension": dimension})
    if not isinstance(first, SpatialRobot):
        return {}, {names[0]: first}
    # Options say how files are read; of built-in robots only one that comes first means them.
    own = {name: {} if name in builtin_robots() else options for name in names[1:]}
    others: Any = {name: load_robot(name, dimension=3, **how) for name, how in own.items()}
    return {names[0]: first, **others}, {}


def hint_of_balance(*runs: Run) -> None:
    """Name a law that looks after the balance, where computed torque was pushed or fell."""
    from heelstrike.experiments.laws import law_that_balances
    from heelstrike.sim import RunStatus

    if any(run.pushes or run.status is RunStatus.FELL for run in runs):
        law = law_that_balances(runs[0].robot)
        if law is not None:
            tell(
                "ComputedTorque follows the gait and does not look after the robot's balance; "
                f"--controller {law.name} does."
            )


def asked_for(
    robot: str, how: Reading, walking: Walking, *, steps: int, restitution: float = 0.0
) -> Case:
    """Make of options what is walked, but for its gait, which may take long to find."""
    from heelstrike.experiments.walk import Case

    ground = ground_called(walking.ground, friction=walking.friction, restitution=restitution)
    pushes = pushes_called(walking.push)
    machine = planar_robot_called(robot, how)
    for each in pushes:
        each.place(machine)
    law = law_asked(walking.controller, machine)
    return Case(robot=machine, gait=None, law=law, ground=ground, pushes=pushes, steps=steps)


def with_gait(case: Case, path: Path | None, **size: float | None) -> Case:
    """Load a gait, or design one; what is None of the size of its steps suits the robot.

    Of a robot without motors it is the limit cycle on the ground; for a law that makes it stand
    there is none.
    """
    given = {name: value for name, value in size.items() if value is not None}
    return replace(case, gait=_gait(case, path, given))


def methods_asked(case: Case, ways: Sequence[Method], step: float) -> dict[str, TimeMethod]:
    """Return methods by their names; where none is asked for, the usual one for a robot."""
    passive = not case.robot.nu
    ways = ways or [Method.EVENT_DRIVEN if passive else Method.TIME_STEPPING]
    return {way.value: method_called(way, step, passive=passive) for way in ways}


def _gait(case: Case, path: Path | None, given: dict[str, float]) -> Gait | LimitCycle | None:
    from heelstrike.experiments.laws import gait_for
    from heelstrike.experiments.walk import design, typical_step
    from heelstrike.gait import load_gait

    robot, law = case.robot, case.law
    if law is not None and law.stands:
        if path is not None or given:
            raise typer.BadParameter(
                f"{law.name} makes the robot stand, by no gait: leave --gait and the sizes of "
                "steps out",
                param_hint="--controller",
            )
        return None
    if robot.nu == 0 and robot.nc:
        return _passive(case, path, given)
    if path is not None:
        if given:
            raise typer.BadParameter(
                "a saved gait has its own step length, duration and clearance; leave these options "
                "out, or design a gait without --gait",
                param_hint="--gait",
            )
        return load_gait(path, robot)
    if law is not None and law.bent_knees and not given:
        with stage("designing a gait with bent knees"):
            return gait_for(robot)
    chosen = replace(typical_step(robot), **given)
    friction = float(case.ground.model().friction.min())
    with stage(f"designing a gait of {chosen.length:g} m in {chosen.duration:g} s") as designing:
        gait = design(robot, chosen, friction=friction, progress=designing.reached)
        designing.outcome = (
            f"gait: {gait.step_length:.3g} m in {gait.step_duration:.3g} s, "
            f"cost {gait.cost:.4g} N²m²s"
        )
    return gait


def _passive(case: Case, path: Path | None, size: Mapping[str, float]) -> LimitCycle:
    from heelstrike.errors import GaitError
    from heelstrike.experiments.passive import passive_walk

    if path is not None or size:
        raise GaitError(
            f"robot {case.robot.name!r} has no motors to follow a gait: leave --gait, "
            "--step-length, --step-duration and --clearance out; the slope says how it walks."
        )
    with stage("looking for a walk that repeats") as looking:
        cycle = passive_walk(case.robot, case.ground)
        looking.outcome = str(cycle)
    return cycle
