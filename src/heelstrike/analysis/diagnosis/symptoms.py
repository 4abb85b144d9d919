"""What goes wrong in a walk, each kind of it found in the record by itself.

A symptom is a stretch of time in which something happened that a walk that goes well does not show:
a foot slides, tips or hits the ground in mid-swing, a torque stays at its limit. Thresholds go with
the size of the robot: lengths with the height of its centre of mass, times with the root of that.
"""

from __future__ import annotations

import enum
from collections.abc import Iterator, Mapping
from dataclasses import field
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from heelstrike.analysis.actuation import torque_bounds
from heelstrike.analysis.diagnosis.limits import REACHED
from heelstrike.analysis.friction import friction_coefficient
from heelstrike.analysis.motion import Motion, in_world, run_motion
from heelstrike.analysis.slip import slip_distance
from heelstrike.analysis.support import pushing, pushing_feet, stances, step_times
from heelstrike.analysis.tracking import reference_motion
from heelstrike.analysis.wrenches import sole_points
from heelstrike.dynamics import leg_joints
from heelstrike.field_texts import dataclass
from heelstrike.robot.model import Floats, Integers
from heelstrike.robot.sole import has_length, soles
from heelstrike.sim.closed_sets import RunStatus
from heelstrike.sim.run import AnyRun, Run

if TYPE_CHECKING:
    from heelstrike.gait.gait import Gait

Rows = NDArray[np.bool_]

SLOW = 1e-3
"""Speed up to which a foot creeps and does not slide, in heights h by √(h/g)."""
SLID = 0.01
"""How far a pressed foot slides in one go, in heights of the centre of mass."""
SLID_FAST = 0.002
"""The same of a foot that slides faster than the robot walks, and so leaves the ground again."""
TIPPED, ROLLING = 0.01, 0.03
"""How far (rad) a foot turns about its toe or heel that tips, and for how long (s) at least."""
ON_HEEL, FLAT, ON_TOE, NOTHING_PUSHES = -1, 0, 1, 9
"""What a foot stands on."""
EARLY, LATE, LATE_UNSEEN = 0.85, 1.1, 1.3
"""Parts of a step before which a foot lands early, and after which late: of a gait, or of the steps
of the run."""
ENOUGH_STEPS = 3
"""Steps of a run of no known gait from which it is known how long a step takes."""
EARLY_ON_RISE = 0.97
"""The first of them where the ground rises under the foot, which makes it land early."""
TOUCHES = 1e-3
"""How near the ground a foot is down, whether it is pressed or not, in heights of the centre of
mass."""
IN_THE_AIR = 0.1
"""Part of a step that a foot is in the air at least before it can scuff."""
FAST = 0.5
"""Forward speed of a foot that scuffs, in those of the walk."""
ABOUT = 0.05
"""How far about a foot that scuffs the ground is looked at, in heights of the centre of mass."""
HELD, HELD_UNSEEN = 0.01, 0.02
"""How long a torque stays at its limit (s): where a gait tells what it misses, and without one."""
MISSED = 0.03
"""How far a joint is from its gait for that to matter, in rad."""
LEAVES = 0.002
"""The same when it begins to leave it."""
FOOTHOLD = "foothold"
"""What laws log that plan where the next foot lands."""
CLEAR_OF_STOP = 0.02
"""How far a gait keeps off the stops of joints, in parts of their range, for them to be one."""
RUNAWAY = 8.0
"""Speed of a joint that its motor drives away, in radians over the time √(h/g)."""
WILD = 100.0
"""Speed of a joint, likewise, that no motor gives it: numbers that grow beyond all bounds."""
BEGINS_TO_RUN = 2.0
"""The same when it begins."""
SHORT_LEG, SHORTENING = 0.75, 0.92
"""Length of a leg that gave way, and of one that begins to, in that at the start."""
BRIEF = 0.02
"""Breaks shorter than this (s) do not end what goes on."""
STEP_OF_HEIGHT = 2.15
"""Duration of a step by √(h/g), where neither a gait nor steps tell it."""


class Cause(enum.Enum):
    """What goes wrong first in a walk that fails, and what can follow from it.

    ``SLIPPED``
        A pressed foot slid.
    ``TIPPED_FORWARD``, ``TIPPED_BACK``
        The robot tipped over the toes, or the heels, of all feet that carried it; on point feet
        faster, or slower, than its gait.
    ``TIPPED_SIDEWAYS``
        A robot in space tipped over the outer edge of its support polygon.
    ``SCUFFED``
        The swing foot hit the ground in mid-swing.
    ``LATE_TOUCHDOWN``
        The swing foot was not down long after its time.
    ``TORQUE_LIMIT``, ``SPEED_LIMIT``
        A motor gave all it can, or all that it can at that speed, and its joint missed the gait.
    ``JOINT_STOP``
        A joint was pressed against the end of its range.
    ``LEG_GAVE_WAY``
        A leg that carried the robot folded.
    ``CONTROLLER``
        The controller drove a joint away, or asked for what is no torque.
    ``NUMERICAL``
        No contact forces could be certified, or numbers grew beyond all bounds.
    ``UNKNOWN``
        None of these was seen.
    """

    SLIPPED = "slipped"
    TIPPED_FORWARD = "tipped forward"
    TIPPED_BACK = "tipped back"
    TIPPED_SIDEWAYS = "tipped sideways"
    SCUFFED = "scuffed"
    LATE_TOUCHDOWN = "late touchdown"
    TORQUE_LIMIT = "torque limit"
    SPEED_LIMIT = "speed limit"
    JOINT_STOP = "joint stop"
    LEG_GAVE_WAY = "leg gave way"
    CONTROLLER = "controller"
    NUMERICAL = "numerical"
    UNKNOWN = "unknown"


@dataclass(frozen=True)
class Symptom:
    """Something that went wrong, with its time and place."""

    cause: Cause
    """What."""
    time: float
    end: float
    """time, end: When it began and when it was over, in s."""
    where: str = ""
    """Name of the foot or joint; nothing if it was at none."""
    evidence: Mapping[str, float] = field(default_factory=dict)
    """Numbers that show it, by names that end in their units."""


@dataclass(frozen=True, eq=False)
class Walk:
    """A run with what several symptoms are found by."""

    run: Run
    """The run, of at least one row."""
    gait: Gait | None = None
    """The gait that it followed, if it is known."""

    @cached_property
    def motion(self) -> Motion:
        """Where its links are."""
        return run_motion(self.run)

    @cached_property
    def height(self) -> float:
        """Height of the centre of mass over the lowest contact point at first, in m."""
        lowest = self.run.contact_point[0, :, 1].min(initial=np.inf)
        height = float(self.motion.center_of_mass[0, 1] - lowest)
        return height if 0.0 < height < np.inf else 1.0

    @cached_property
    def pace(self) -> float:
        """√(h/g), in s."""
        return float(np.sqrt(self.height / max(np.hypot(*self.run.robot.model.gravity), 1e-9)))

    @cached_property
    def landings(self) -> tuple[float, ...]:
        """When steps began, in s: at the start and at the touchdowns that ended one."""
        return step_times(self.run)

    @cached_property
    def step_duration(self) -> float:
        """How long a step takes, in s: of the gait, or as usual in the run."""
        usual = self.usual_in(len(self.landings) - 1)
        return usual if usual < np.inf else STEP_OF_HEIGHT * self.pace

    def usual_in(self, steps: int) -> float:
        """How long a step takes, in s: of the gait, or as usual in the first steps of the run.

        It is infinite where no gait is known and these are too few.
        """
        if self.gait is not None:
            return float(self.gait.step_duration)
        if steps < ENOUGH_STEPS:
            return np.inf
        return float(np.median(np.diff(self.landings[: steps + 1])))

    @cached_property
    def speed(self) -> float:
        """Speed of the walk, in m/s."""
        if self.gait is not None:
            return float(abs(self.gait.step_length) / self.gait.step_duration)
        center = self.motion.center_of_mass[:, 0]
        before = self.run.time <= self.landings[-1]
        went = float(np.abs(center[before][-1] - center[0]))
        return went / max(self.landings[-1] - self.landings[0], self.step_duration)

    @cached_property
    def error(self) -> Floats | None:
        """How far the actuated joints are from the gait, (nt, nu), in rad; None without one."""
        if self.gait is None:
            return None
        joints = self.run.robot.model.actuator_joint
        reference = reference_motion(self.run, self.gait).position
        return np.asarray(self.run.position[:, joints] - reference)

    @cached_property
    def on_its_gait(self) -> Rows | None:
        """When its joints are where its gait has them, on a sole that lies flat; None without one.

        Its state is then that of a walk in which nothing went wrong.
        """
        if self.error is None:
            return None
        flat = (self.edge == FLAT).any(axis=1) | (not self.has_soles)
        return np.asarray(flat & (np.abs(self.error).max(axis=1, initial=0.0) < LEAVES))

    @cached_property
    def full_torque(self) -> tuple[Rows, Floats, Rows]:
        """Where motors give all that they can; see :func:`full_torque`."""
        return full_torque(self.run)

    @cached_property
    def tilt(self) -> Floats:
        """Angle between the soles and the ground, (nt, nf), in rad; positive with the toe up.

        NaN of feet that have no length.
        """
        found = np.full((len(self.run.time), len(self.run.robot.feet)), np.nan)
        for i, sole in enumerate(soles(self.run.robot)):
            if has_length(self.run.robot, sole):
                heel, toe = sole.foot.contacts[0], sole.foot.contacts[-1]
                found[:, i] = (self.run.gap[:, toe] - self.run.gap[:, heel]) / (
                    sole.toe - sole.heel
                )
        return found

    @cached_property
    def carrying(self) -> NDArray[np.bool_]:
        """Which feet push in each row, (nt, nf)."""
        return pushing_feet(self.run)

    @cached_property
    def edge(self) -> Integers:
        """What each foot stands on, (nt, nf): its sole, its toe or heel, or nothing.

        Feet without a length stand on what they have.
        """
        run, push = self.run, pushing(self.run)
        found = np.full(self.carrying.shape, NOTHING_PUSHES)
        for i, sole in enumerate(soles(run.robot)):
            on = push[:, list(sole.foot.contacts)]
            found[on.any(axis=1), i] = FLAT
            if has_length(run.robot, sole):
                alone, middle = on.sum(axis=1) == 1, 0.5 * (on.shape[1] - 1)
                found[alone, i] = np.where(on[alone].argmax(axis=1) > middle, ON_TOE, ON_HEEL)
        return found

    @cached_property
    def has_soles(self) -> bool:
        """Whether its feet have a length, on which it can stand."""
        return bool(np.isfinite(self.tilt).any())


def full_torque(run: AnyRun) -> tuple[Rows, Floats, Rows]:
    """Where motors give all that they can, that bound, and whether their speed sets it.

    Each (nt, nu), the bound in N m; see :func:`~heelstrike.analysis.actuation.torque_bounds`.
    """
    lower, upper = torque_bounds(run)
    # Beyond the speed without load both bounds have one sign: then a motor can only brake.
    with np.errstate(invalid="ignore"):
        least = run.torque <= lower + (1.0 - REACHED) * np.abs(lower)
        most = run.torque >= upper - (1.0 - REACHED) * np.abs(upper)
    bound = np.where(most | (~least & (run.torque >= 0.0)), upper, lower)
    full = np.isfinite(bound) & (least | most)
    model = run.robot.model
    by_speed = np.where(bound == upper, upper < model.torque_upper, lower > model.torque_lower)
    return full, bound, by_speed


def find_symptoms(walk: Walk) -> tuple[Symptom, ...]:
    """Find what goes wrong in a run, in the order in which it began.

    Most walks show something and go on.
    """
    if not len(walk.run.time):
        return ()
    found = [each for detect in DETECTORS for each in detect(walk)]
    return tuple(sorted(found, key=lambda each: each.time))


def spells(time: Floats, mask: Rows, brief: float = BRIEF) -> list[tuple[int, int]]:
    """First and last rows of the stretches in which something holds, short breaks left out."""
    rows = np.flatnonzero(mask)
    if not len(rows):
        return []
    ends = np.flatnonzero((np.diff(rows) > 1) & (np.diff(time[rows]) > brief))
    return list(
        zip(rows[np.append(0, ends + 1)].tolist(), rows[np.append(ends, -1)].tolist(), strict=True)
    )


def _slips(walk: Walk) -> Iterator[Symptom]:
    run = walk.run
    slid = slip_distance(run)
    slow = SLOW * walk.height / walk.pace
    sliding = pushing(run) & (np.abs(run.slip_velocity) > slow)
    friction = friction_coefficient(run)
    for foot in run.robot.feet:
        contacts = list(foot.contacts)
        for first, last in spells(run.time, np.asarray(sliding[:, contacts].any(axis=1))):
            after = min(last + 1, len(slid) - 1)
            distance = float((slid[after] - slid[first])[contacts].max())
            inside = slice(first, last + 1)
            speeds = np.where(
                sliding[inside][:, contacts], run.slip_velocity[inside][:, contacts], 0
            )
            dragged = np.abs(speeds).max() > walk.speed
            if distance < (SLID_FAST if dragged else SLID) * walk.height:
                continue
            point = contacts[int(np.argmax(np.abs(run.slip_velocity[first, contacts])))]
            yield Symptom(
                Cause.SLIPPED, float(run.time[first]), float(run.time[last]), foot.name,
                {"distance_m": distance, "friction": float(friction[first, point])},
            )  # fmt: skip


def _tips(walk: Walk) -> Iterator[Symptom]:
    """Find when what carries the robot stands on its toes, or its heels, alone, and turns there.

    A foot that has lost the ground so may rattle from its toe to its heel: where it began counts.
    """
    run, edge = walk.run, walk.edge
    lost = np.asarray(~(edge == FLAT).any(axis=1))
    for first, last in spells(run.time, lost):
        on = edge[first][edge[first] != NOTHING_PUSHES]
        if run.time[last] - run.time[first] < ROLLING or not len(on) or abs(on.sum()) != len(on):
            continue
        foot = int(np.flatnonzero(edge[first] != NOTHING_PUSHES)[0])
        angle = float(np.nanmax(np.abs(walk.tilt[first : last + 1, foot])))
        if angle > TIPPED:
            cause = Cause.TIPPED_FORWARD if on[0] == ON_TOE else Cause.TIPPED_BACK
            yield Symptom(
                cause, float(run.time[first]), float(run.time[last]), run.robot.feet[foot].name,
                {"angle_rad": angle},
            )  # fmt: skip


def _pushed_over(walk: Walk) -> Iterator[Symptom]:
    """Find pushes that the robot cannot withstand on the feet that carry it, however strong it is.

    A push moves the zero moment point by its moment over the force that the feet carry then. Beyond
    their ends there is none: the robot tips, or what was to hold it gives way first.
    """
    run = walk.run
    if not walk.has_soles:
        return
    for push in run.pushes:
        row = max(int(np.searchsorted(run.time, push.start - 1e-9)) - 1, 0)
        if not walk.carrying[row].any():
            continue
        acts = (run.time >= push.start) & (run.time <= push.end)
        link, local = push.place(run.robot)
        origin, angle = walk.motion.link_origin[row, link], walk.motion.link_angle[row, link]
        normal, points = run.contact_force[row, :, 0], run.contact_point[row]
        pressed = normal @ points / normal.sum()
        away = in_world(origin, angle, np.array(local)) - pressed
        moment = float(push.force[0] * away[1] - push.force[1] * away[0])
        carried = float(normal.sum()) - push.force[1]
        if carried <= 0.0:
            continue  # it is lifted
        reached = float(pressed[0]) + moment / carried
        carrying = np.flatnonzero(walk.carrying[row]).tolist()
        ends = points[[i for foot in carrying for i in run.robot.feet[foot].contacts], 0]
        beyond = max(reached - float(ends.max()), float(ends.min()) - reached)
        if beyond > 0.0 and _gives_way(walk, acts):
            yield Symptom(
                Cause.TIPPED_FORWARD if moment > 0.0 else Cause.TIPPED_BACK, push.start, push.end,
                run.robot.feet[carrying[0]].name, {"moment_Nm": moment, "beyond_m": beyond},
            )  # fmt: skip


def _gives_way(walk: Walk, rows: Rows) -> bool:
    """Whether feet tip or slide, or motors give all they can, in some rows."""
    slow = SLOW * walk.height / walk.pace
    slides = pushing(walk.run)[rows] & (np.abs(walk.run.slip_velocity[rows]) > slow)
    tips = (walk.edge[rows] != FLAT).all(axis=1)
    return bool(slides.any() or tips.any() or walk.full_torque[0][rows].any())


def _landings_amiss(walk: Walk) -> Iterator[Symptom]:
    """Find feet that meet the ground in mid-swing, at the speed at which they swing."""
    run = walk.run
    left: dict[int, float] = {}
    landed: dict[int, float] = {}
    for stance in stances(run):
        foot, time = stance.foot, stance.touchdown
        others = [when for other, when in landed.items() if other != foot]
        if foot in left and others:
            in_the_air, phase = time - left[foot], (time - max(others)) / walk.step_duration
            row = max(int(np.searchsorted(run.time, time - 1e-9)) - 1, 0)
            contacts = list(run.robot.feet[foot].contacts)
            lowest = contacts[int(np.argmin(run.gap[row, contacts]))]
            velocity = walk.motion.contact_velocity[row, lowest]
            rise = _rise(walk, float(run.contact_point[row, lowest, 0]), row)
            rises = rise > SLID * walk.height
            if (
                in_the_air > IN_THE_AIR * walk.step_duration
                and phase < (EARLY_ON_RISE if rises else EARLY)
                and abs(velocity[0]) > FAST * walk.speed
            ):
                tips = not (walk.has_soles or rises)
                yield Symptom(
                    Cause.TIPPED_FORWARD if tips else Cause.SCUFFED, time,
                    time + IN_THE_AIR * walk.step_duration, run.robot.feet[foot].name,
                    {"step_phase": phase, "speed_m_s": float(velocity[0]), "rise_m": rise},
                )  # fmt: skip
        landed[foot], left[foot] = time, stance.liftoff


def _rise(walk: Walk, x: float, row: int) -> float:
    """How much higher the ground is about x than under the lowest contact point of a row, in m."""
    points = walk.run.contact_point[row]
    under = points[int(np.argmin(points[:, 1])), 0]
    about = x + np.linspace(-ABOUT, ABOUT, 9) * walk.height
    height = walk.run.ground.height
    return float(height(about).max() - height(np.array([under]))[0])


def _late_landings(walk: Walk) -> Iterator[Symptom]:
    run = walk.run
    for steps, (landed, following) in enumerate(pairwise((*walk.landings, float(run.time[-1])))):
        usual = walk.usual_in(steps)  # those after it may be short ones of a fall
        late = (following - landed) / usual
        if late > (LATE_UNSEEN if walk.gait is None else LATE):
            due = landed + usual
            row = min(int(np.searchsorted(run.time, due - 1e-9)), len(run.time) - 1)
            feet = [run.gap[row, list(foot.contacts)].min() for foot in run.robot.feet]
            swing = int(np.argmax(feet)) if feet else -1
            if feet and walk.has_soles and feet[swing] < TOUCHES * walk.height:
                continue  # it is down, and nothing presses it
            yield Symptom(
                Cause.LATE_TOUCHDOWN if walk.has_soles else Cause.TIPPED_BACK, due, following,
                run.robot.feet[swing].name if feet else "",
                {"step_phase": late, "gap_m": float(feet[swing]) if feet else np.nan},
            )  # fmt: skip


def _torques_at_limits(walk: Walk) -> Iterator[Symptom]:
    run, error = walk.run, walk.error
    full, bound, by_speed = walk.full_torque
    for i, name in enumerate(run.robot.actuator_names):
        for first, last in spells(run.time, full[:, i], 0.5 * HELD):
            held = float(run.time[last] - run.time[first])
            missed = np.nan
            if error is not None:
                soon = run.time <= run.time[last] + 5.0 * HELD
                missed = float(np.abs(error[first:, i][soon[first:]]).max())
                if held < HELD or missed < MISSED:
                    continue
                if not by_speed[first, i] and _drives_away(run, error, i, first, last):
                    continue
            elif held < HELD_UNSEEN:
                continue
            cause = Cause.SPEED_LIMIT if by_speed[first, i] else Cause.TORQUE_LIMIT
            joint = run.robot.model.actuator_joint[i]
            yield Symptom(
                cause, float(run.time[first]), float(run.time[last]), name,
                {"torque_Nm": float(run.torque[first, i]), "limit_Nm": float(bound[first, i]),
                 "speed_rad_s": float(run.velocity[first, joint]), "missed_rad": missed},
            )  # fmt: skip


def _drives_away(run: Run, error: Floats, i: int, first: int, last: int) -> bool:
    """Whether a motor at its limit moves its joint off the gait: it lacks no torque then.

    What it does until the joint is far from the gait decides: afterwards it may be on its way back.
    """
    far = np.flatnonzero(np.abs(error[first : last + 1, i]) >= MISSED)
    until = first + int(far[0]) if len(far) else last
    rows = slice(first, until + 1)
    return bool(run.torque[rows, i] @ error[rows, i] > 0.0)


def _joints_at_stops(walk: Walk) -> Iterator[Symptom]:
    run, model = walk.run, walk.run.robot.model
    actuator = {int(joint): i for i, joint in enumerate(model.actuator_joint)}
    for joint, name in enumerate(run.robot.joint_names):
        room = float(model.upper[joint] - model.lower[joint])
        pressed = run.stop_torque[:, joint] != 0.0
        if not pressed.any():
            continue
        planned = np.inf
        if walk.error is not None and joint in actuator:
            wanted = run.position[:, joint] - walk.error[:, actuator[joint]]
            ends = (wanted - model.lower[joint], model.upper[joint] - wanted)
            planned = float(np.minimum(*ends).min())
        if abs(planned) < CLEAR_OF_STOP * (room if np.isfinite(room) else 1.0):
            continue  # its gait goes there, and not beyond
        for first, last in spells(run.time, pressed):
            if run.time[last] - run.time[first] < HELD:
                continue
            yield Symptom(
                Cause.JOINT_STOP, float(run.time[first]), float(run.time[last]), name,
                {"position_rad": float(run.position[first, joint])},
            )  # fmt: skip


def _legs_that_fold(walk: Walk) -> Iterator[Symptom]:
    run = walk.run
    places = sole_points(run, motion=walk.motion)
    for i, joints in enumerate(leg_joints(run.robot)):
        if len(joints) < 2:
            continue
        hip = walk.motion.link_origin[:, joints[0]]
        length = np.hypot(*(hip - places[:, i]).T)
        share = length / length[0]
        folded = walk.carrying[:, i] & (share < SHORTENING)
        for first, last in spells(run.time, folded):
            shortest = float(share[first : last + 1].min())
            if shortest < SHORT_LEG:
                yield Symptom(
                    Cause.LEG_GAVE_WAY, float(run.time[first]), float(run.time[last]),
                    run.robot.feet[i].name, {"length_share": shortest},
                )  # fmt: skip


def _runaways(walk: Walk) -> Iterator[Symptom]:
    """Find joints that their motors drive faster and faster."""
    run = walk.run
    for i, name in enumerate(run.robot.actuator_names):
        speed = run.velocity[:, run.robot.model.actuator_joint[i]]
        driven = (np.abs(speed) * walk.pace > BEGINS_TO_RUN) & (run.torque[:, i] * speed > 0.0)
        for first, last in spells(run.time, driven, 0.25 * HELD):
            fastest = float(np.abs(speed[first : last + 1]).max())
            if fastest * walk.pace > RUNAWAY:
                yield Symptom(
                    Cause.CONTROLLER, float(run.time[first]), float(run.time[last]), name,
                    {"speed_rad_s": fastest, "torque_Nm": float(run.torque[first, i])},
                )  # fmt: skip


def _departures(walk: Walk) -> Iterator[Symptom]:
    """Find joints that leave the gait while their motors do nothing against it, or help."""
    run, error = walk.run, walk.error
    if (
        error is None or FOOTHOLD in run.log
    ):  # a law that plans its steps leaves the gait on purpose
        return
    away = np.abs(error)
    full, _, _ = walk.full_torque  # what is no fault of who asks for more
    off = (away > LEAVES) & (run.torque * error >= 0.0)
    let = off & ~full
    found = []
    for i, name in enumerate(run.robot.actuator_names):
        for first, last in spells(run.time, let[:, i], 0.5 * HELD):
            rest = off[last:, i]  # it may go on at the limit
            end = last + (len(rest) if rest.all() else int(np.argmin(rest)))
            if away[first : end + 1, i].max() < MISSED or _is_pushed(run, float(run.time[first])):
                continue
            soon = run.time[first : last + 1] <= run.time[first] + 4.0 * HELD
            helped = float((run.torque * error)[first : last + 1, i][soon].sum())
            found.append((first, last, i, name, helped))
    found.sort()
    while found:
        first = found[0][0]
        same = [each for each in found if run.time[each[0]] - run.time[first] <= 2.0 * HELD]
        found = found[len(same) :]
        begin, last, i, name, _ = max(same, key=lambda each: each[-1])
        before = run.time < run.time[begin] - 2.0 * HELD
        usual = float(np.abs(run.torque[before, i]).max(initial=0.0))
        driven = float(np.abs(run.torque[begin, i])) / usual if usual > 0.0 else 0.0
        yield Symptom(
            Cause.CONTROLLER, float(run.time[first]), float(run.time[last]), name,
            {"missed_rad": float(away[first : last + 1, i].max()),
             "torque_Nm": float(run.torque[last, i]), "in_usual_torques": driven},
        )  # fmt: skip


def _is_pushed(run: Run, time: float) -> bool:
    return any(push.start <= time <= push.end + 5.0 * HELD for push in run.pushes)


def _ends(walk: Walk) -> Iterator[Symptom]:
    """Find what the simulation itself says of its end."""
    run, end = walk.run, float(walk.run.time[-1])
    if run.status is RunStatus.CONTROLLER_FAILED:
        yield Symptom(Cause.CONTROLLER, end, end)
    elif run.status in (RunStatus.DIVERGED, RunStatus.SOLVER_FAILED):
        speed = np.abs(run.velocity[:, run.robot.model.actuator_joint]).max(axis=1, initial=0.0)
        wild = spells(run.time, ~(speed * walk.pace <= WILD))
        begin = wild[-1][0] if wild and wild[-1][1] == len(run.time) - 1 else len(run.time) - 1
        yield Symptom(Cause.NUMERICAL, float(run.time[begin]), end)


DETECTORS = (
    _ends,
    _departures,
    _runaways,
    _pushed_over,
    _joints_at_stops,
    _landings_amiss,
    _slips,
    _late_landings,
    _tips,
    _torques_at_limits,
    _legs_that_fold,
)
"""Each finds one kind; of what begins together, what an earlier one finds comes first."""
