"""mimic(): from a recording of a person to the nearest gait on hard contact, and a walk of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from os import PathLike
from pathlib import Path

import numpy as np

from heelstrike.arguments import takes
from heelstrike.errors import GaitError
from heelstrike.experiments.people.body import BodyMotion, body_of_joints, pitch_in
from heelstrike.experiments.people.fitting import fit_markers
from heelstrike.experiments.people.moments import Moments, moments_of
from heelstrike.experiments.people.nearest import Nearest, nearest_motion
from heelstrike.experiments.people.person import BODY_MASS_INDEX, person_of
from heelstrike.experiments.people.retarget import Retargeted, retargeted
from heelstrike.experiments.people.stride import stride_of
from heelstrike.experiments.people.walking import Walked, walked
from heelstrike.field_texts import dataclass
from heelstrike.gait.recordings.forces import load_forces
from heelstrike.gait.recordings.markers import RecordedMarkers, load_markers
from heelstrike.gait.recordings.motion import motion_of
from heelstrike.gait.recordings.opensim import joints_of_opensim
from heelstrike.gait.recordings.saving import check_rate
from heelstrike.gait.recordings.table import read_table
from heelstrike.gait.recordings.units import check_unit
from heelstrike.robot.human import human
from heelstrike.robot.robot import Robot

LIBRARY = Path(__file__).parent / "library"
"""Recordings that are built in, with their licences."""
WINTER = "winter"
"""Name of Winter's recording."""
WINTER_MASS = 56.7
"""Mass (kg) of the person whom Winter recorded."""
USUAL_HEIGHT = 1.8
"""Height (m) of a person of whom nothing but angles is known."""
MARKERS = (".trc", ".c3d")
"""Endings of files of markers."""


@dataclass(frozen=True, eq=False)
class Mimicry:
    """What a person does, and the nearest gait of a robot."""

    person: BodyMotion
    """How the person moved."""
    wanted: Retargeted
    """The mean stride of the person, on the robot."""
    nearest: Nearest
    """The nearest motion that is exact on hard contact."""
    walk: Walked
    """A walk of it."""
    moments: Moments | None = None
    """Moments of the person's joints, where forces were measured."""

    @property
    def robot(self) -> Robot:
        """The robot that walks."""
        return self.wanted.robot

    def __str__(self) -> str:
        person, stride, nearest = self.person, self.wanted.stride, self.nearest
        mass = person.robot.model.mass.sum()
        lines = [
            f"person: {mass:.3g} kg, legs of {stride.leg:.3g} m, {stride.speed:.3g} m/s, strides "
            f"of {stride.length:.3g} m in {stride.duration:.3g} s ({stride.strides} averaged)"
        ]
        if person.residual:
            worst = max(person.residual, key=lambda name: person.residual[name])
            lines.append(
                f"markers: at most {1e3 * person.residual[worst]:.2g} mm rms from the human "
                f"({worst})"
            )
        if self.moments is not None:
            lines.append(
                f"moments: up to {abs(self.moments.torque).max():.3g} N m; the trunk lacks up to "
                f"{abs(self.moments.residual[:, :2]).max():.3g} N"
            )
        phases = ", ".join(
            f"{' and '.join(phase.contacts) or 'flight'} {phase.duration:.3g} s"
            for phase in nearest.motion.phases
        )
        lines += [
            f"nearest gait of {self.robot.name}: {nearest.distance:.3g} degrees rms from the "
            f"person in the joints, {nearest.pitch:.3g} in the trunk's pitch",
            f"phases of a step: {phases}",
            f"forces that it lacks: {nearest.residual:.1e} N",
            f"walked event-driven: {self.walk.steps} of {self.walk.asked} steps (kp "
            f"{self.walk.gains[0]:g}, kd {self.walk.gains[1]:g})",
        ]
        return "\n".join(lines)


@takes(GaitError)
def mimic(
    path: str | PathLike[str],
    *,
    robot: Robot | None = None,
    mass: float | None = None,
    height: float | None = None,
    speed: float | None = None,
    rate: float | None = None,
    unit: str = "",
    markers: Mapping[str, str] | None = None,
    up: str | None = None,
    forward: str | None = None,
    forces: str | PathLike[str] | None = None,
    friction: float = 0.75,
    steps: int = 20,
    progress: Callable[[str, float], None] | None = None,
) -> Mimicry:
    """Find the gait nearest to a recording of a person that is exact on hard contact, and walk it.

    A planar human is scaled to the person, and its motion found by inverse kinematics over the
    whole recording. Its mean stride, left and right alike, is what a robot is to do: the same
    directions of trunk, thighs, shanks and feet, in times and lengths that go with its legs. The
    motion nearest to that which satisfies the equations of motion and of hard contact is found by
    :func:`~heelstrike.optimize_motion`, and walked event-driven under
    :class:`~heelstrike.MotionTracking`.

    Parameters
    ----------
    path : path
        Markers (.trc, .c3d, or a table with columns as ``right_heel_x``), joints (a table with
        columns as ``right_hip``, or OpenSim's .mot or .sto), or ``"winter"`` for the recording that
        is built in.
    robot : Robot, optional
        Who is to walk: two legs of hip, knee and ankle. By default the person.
    mass, height : float, optional
        Of the person (kg, m). The height follows from the legs where there are markers, and is
        1.8 m else; the mass follows from the height.
    speed : float, optional
        Walking speed (m/s); by default that of the hip, or on a treadmill, and where joints were
        recorded, that at which it moves past the foot that stands.
    rate : float, optional
        Rows a second, where the file tells none.
    unit : str
        Of joints whose columns name none: rad or deg.
    markers : mapping, optional
        Names of markers by landmark, as ``{"right_hip": "R.GTRO"}``.
    up, forward : str, optional
        Axes of the file of markers, as for
        :func:`~heelstrike.gait.recordings.markers.load_markers`.
    forces : path, optional
        Forces of the ground that were measured with markers, by their clock and in their axes.
    friction : float
        Of the ground.
    steps : int
        Steps to walk.
    progress : callable, optional
        Told what is being done, and the fraction of that.

    Returns
    -------
    Mimicry
        The person, the nearest gait with its distance in degrees, and the walk.

    Raises
    ------
    GaitError
        If the file is none that can be read, there is no whole stride in it, its joints seem to be
        in degrees and no unit is told, forces go with joints, or the robot cannot do what people
        do.
    GaitNotFoundError
        If no motion was found; the message names what is in conflict.
    """
    _check_asked(speed, friction, steps)
    if rate is not None:
        check_rate(rate)
    tell = progress or (lambda _, __: None)
    tell("reading", 0.0)
    if str(path) == WINTER:
        path = LIBRARY / "winter_table_a1.csv"
        mass = WINTER_MASS if mass is None else mass
    person, seen = _person(
        path,
        mass=mass,
        height=height,
        rate=rate,
        unit=unit,
        markers=markers,
        up=up,
        forward=forward,
    )
    moments = None
    if forces is not None:
        if seen is None:
            raise GaitError(
                f"{path}: forces go with markers only. A table of joints does not tell where the "
                "trunk moves, and without that there are no moments; leave out forces"
            )
        tell("inverse dynamics", 0.0)
        moments = moments_of(person, load_forces(forces, forward=seen.forward, up=seen.up))
    wanted = retargeted(stride_of(person, speed=speed), robot or person.robot)
    nearest = nearest_motion(
        wanted, friction=friction, progress=lambda done: tell("the nearest gait", done)
    )
    walk = walked(
        wanted.robot, nearest.motion, steps=steps, progress=lambda done: tell("walking", done)
    )
    return Mimicry(person, wanted, nearest, walk, moments)


def _check_asked(speed: float | None, friction: float, steps: int) -> None:
    """Refuse numbers that make no sense before anything is read."""
    if speed is not None and not (np.isfinite(speed) and speed > 0.0):
        raise GaitError(f"speed must be a positive number (m/s), got {speed}")
    if not (np.isfinite(friction) and friction >= 0.0):
        raise GaitError(f"friction must not be negative or infinite, got {friction}")
    if steps < 1:
        raise GaitError(f"steps must be 1 or more, got {steps}")


def _person(
    path: str | PathLike[str], *, mass: float | None, height: float | None, rate: float | None,
    unit: str, markers: Mapping[str, str] | None, up: str | None, forward: str | None,
) -> tuple[BodyMotion, RecordedMarkers | None]:  # fmt: skip
    """Motion of the person, from markers or joints, and the markers if there are."""
    check_unit(unit)
    if Path(path).suffix.lower() not in MARKERS:
        table = joints_of_opensim(read_table(path, gaps=True), unit)
        if any(table.column(f"{side}_hip") >= 0 for side in ("right", "left")):
            given = {"markers": markers, "up": up, "forward": forward}
            if of_markers := [name for name, value in given.items() if value]:
                raise GaitError(
                    f"{path}: this is a table of joints; {', '.join(of_markers)} go with markers "
                    "only: leave them out"
                )
            height = USUAL_HEIGHT if height is None else height
            robot = human(BODY_MASS_INDEX * height**2 if mass is None else mass, height)
            motion = motion_of(table, robot, rate=rate, unit=unit)
            if motion.seems_degrees(robot):
                largest = float(np.abs(motion.position).max())
                raise GaitError(
                    f"{path}: angles up to {largest:.3g} make no sense in rad, but in degrees; say "
                    "the unit: deg, or a column right_hip [deg]"
                )
            return body_of_joints(robot, motion, pitch_in(table, unit)), None
    seen = load_markers(path, names=markers, rate=rate, up=up, forward=forward)
    return fit_markers(person_of(seen, mass=mass, height=height), seen), seen
