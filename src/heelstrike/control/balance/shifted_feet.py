"""Footholds of a motion of any phases, moved to where the capture point asks for them.

The motion's own capture point ξ = x + ẋ/ω lies somewhere before what stands. An error e of it grows
as exp(ω t) until the next foot lands, and a foothold that is moved by as much leaves none over
(Englsberger, Ott and Albu-Schäffer 2015, *Three-dimensional bipedal walking control based on
divergent component of motion*, IEEE Transactions on Robotics 31(2)). In flight nothing stands, and
only the error of ẋ/ω is known, which stays as it is; moving a foothold by it is what Raibert's
runners do.

A foot in the air moves away from the motion's, smoothly, as its swing goes by. One that has landed
elsewhere is brought back relative to the trunk as the trunk falls over it, by exp(−ω t). Joints of
the leg follow by the Jacobian of the foot.
"""

from __future__ import annotations

from math import exp
from typing import Any

import numpy as np

from heelstrike.compiler.bundle import array, cell, number
from heelstrike.compiler.compilation import kernel
from heelstrike.control import motion_tracking
from heelstrike.control.followed_motion import cycle_of, place_in_phase, points_of_phase
from heelstrike.dynamics import center_of_mass, contact_positions
from heelstrike.dynamics.dense import solve_to_rank
from heelstrike.gait.motion.motion import Motion, MotionPhase
from heelstrike.gait.motion.request import Repeat
from heelstrike.gait.polynomials import motion_in_piece
from heelstrike.robot.model import Floats, Integers
from heelstrike.robot.robot import Robot
from heelstrike.sim.controller.interface import Contacts
from heelstrike.sim.controller.robot import ControlledRobot, ControlState

MOST_MOVED = 0.35
"""Greatest distance by which a foothold is moved, in heights of the centre of mass."""
LEG_DAMPING = 1e-3
"""Damping (m²) of the leg that follows its foot: one that is straight cannot."""


class Parameters(motion_tracking.Parameters):
    """Numbers of footholds that move."""

    mass: Floats = array("pieces", "terms", 1)
    """Centre of mass along the ground (m), lowest power first."""
    support: Floats = array("phases")
    """Where, along the ground, the middle of what stands is (m)."""
    before: Floats = array("phases", "feet")
    spell: Floats = array("phases", "feet")
    """before, spell: For how long a foot has been in the air before a phase, and will have been as
    it lands (s); zero of one that stands, and that never lands."""
    stance: Floats = array("phases")
    after: Floats = array("phases", "feet")
    """stance, after: For how long something stands in a phase, and in those after it until a foot
    in the air lands (s)."""
    ahead: Floats = array(2)
    """Direction along the ground."""
    rate: float = number(float)
    """ω (1/s)."""
    farthest: float = number(float)
    """Greatest distance by which a foothold is moved (m)."""
    adapts: float = number(float)
    """Part of the capture point's error that a foothold answers; zero to leave it where it is."""


class Memory(motion_tracking.Memory):
    """What moving footholds remembers."""

    shift: Floats = array("feet")
    """By how much each foot is moved as it is about to land, or was as it landed (m)."""
    landed: Floats = array("feet")
    """When it landed (s)."""
    error: float = cell(float)
    """Error of the capture point (m)."""
    place: Floats = array(2)
    moving: Floats = array(3)
    foot_rows: Floats = array(3, "nv")
    normal: Floats = array("longest", "longest + 1")
    answer: Floats = array("longest")
    pivot: Integers = array("longest", of=int)
    """place, moving, foot_rows, normal, answer, pivot: Scratch."""


@kernel
def capture_error(
    t: float, state: ControlState, contacts: Contacts, robot: ControlledRobot,
    parameters: Parameters, memory: Memory,
) -> float:  # fmt: skip
    """By how much the capture point is ahead of the motion's (m)."""
    piece, inside, moves = place_in_phase(t, parameters, memory)
    x, speed, _ = motion_in_piece(parameters.mass[piece], 0, inside, moves)
    robot.center_of_mass_velocity(state, memory.place)
    error = -speed
    for k in range(2):
        error += parameters.ahead[k] * memory.place[k]
    error /= parameters.rate
    robot.center_of_mass(state, memory.place)
    own, count = 0.0, 0
    for i in range(robot.nc):
        if (
            parameters.stands[memory.phase, 2 * i] == 1
            or parameters.stands[memory.phase, 2 * i + 1] == 1
        ):
            count += 1
            for k in range(2):
                own += parameters.ahead[k] * (memory.place[k] - contacts.position[i, k])
    if count > 0:
        error += own / count - (x - parameters.support[memory.phase])
    return error


@kernel
def shift_feet(
    t: float, state: ControlState, contacts: Contacts, robot: ControlledRobot,
    parameters: Parameters, memory: Memory,
) -> None:  # fmt: skip
    """Let the legs take their feet to footholds that are moved."""
    error = capture_error(t, state, contacts, robot, parameters, memory)
    memory.error = error
    gone, rate, most = t - memory.start, parameters.rate, parameters.farthest
    stands = max(parameters.stance[memory.phase] - gone, 0.0)
    for foot in range(robot.nf):
        spell = parameters.spell[memory.phase, foot]
        if spell > 0.0:
            passed = min(parameters.before[memory.phase, foot] + gone, spell)
            grows = exp(rate * (stands + parameters.after[memory.phase, foot]))
            wanted = parameters.adapts * error * grows
            wanted = min(max(wanted, -most), most)
            share = passed / spell
            place = wanted * share**2 * (3.0 - 2.0 * share)
            speed = wanted * 6.0 * share * (1.0 - share) / spell
            bend = wanted * (6.0 - 12.0 * share) / spell**2
            memory.shift[foot], memory.landed[foot] = place, t
        else:
            place = memory.shift[foot] * exp(-rate * (t - memory.landed[foot]))
            speed, bend = -rate * place, rate * rate * place
        shift_leg(foot, place, speed, bend, state, robot, parameters, memory)


@kernel
def shift_leg(
    foot: int, place: float, speed: float, bend: float, state: ControlState,
    robot: ControlledRobot, parameters: Parameters, memory: Memory,
) -> None:  # fmt: skip
    """Add to the accelerations that are wanted of a leg: its foot is to be elsewhere."""
    sole, link, rows = robot.foot_sole[foot], robot.foot_link[foot], memory.foot_rows
    for k in range(2):
        memory.moving[k] = 0.5 * (sole[0, k] + sole[1, k])
    robot.point_position(state, link, memory.moving, memory.place)
    robot.point_jacobian(state, link, memory.place, rows)
    joints = robot.leg_joint[foot]
    size = 0
    while size < joints.shape[0] and joints[size] >= 0:
        size += 1
    for i in range(size):
        for j in range(size):
            memory.normal[i, j] = LEG_DAMPING if i == j else 0.0
            for k in range(max(2, min(size, 3))):
                memory.normal[i, j] += rows[k, joints[i]] * rows[k, joints[j]]
        memory.normal[i, size] = 0.0
        for k in range(2):
            memory.normal[i, size] += rows[k, joints[i]] * parameters.ahead[k]
    solve_to_rank(size, memory.normal, memory.pivot, memory.answer)
    for i in range(size):
        motor = robot.motor[joints[i]]
        wanted = bend + parameters.kp[motor] * place + parameters.kd[motor] * speed
        memory.wanted[joints[i]] += memory.answer[i] * wanted


def moved_footholds(robot: Robot, motion: Motion, *, adapts: float) -> dict[str, Any]:
    """Numbers of :class:`Parameters` about a motion, beside those of tracking it."""
    cycle = cycle_of(robot, motion)
    ahead = np.array([np.cos(motion.slope), np.sin(motion.slope)])
    up = np.array([-ahead[1], ahead[0]])
    mass = np.concatenate([_mass_along(robot, phase, ahead) for phase in cycle])
    feet, heights = [set(foot.contacts) for foot in robot.feet], []
    support = np.zeros(len(cycle))
    for p, phase in enumerate(cycle):
        q = phase.coordinates(0.5 * phase.duration)
        places, points = contact_positions(robot, q), sorted(points_of_phase(robot, phase))
        heights.append(float(center_of_mass(robot, q) @ up - (places @ up).min()))
        if points:
            support[p] = float((places[points] @ ahead).mean())
    height = float(np.mean(heights))
    in_air = np.array(
        [[not (foot & points_of_phase(robot, each)) for foot in feet] for each in cycle]
    )
    durations = np.array([each.duration for each in cycle])
    stance = durations * [len(each.contacts) > 0 for each in cycle]
    repeats = motion.repeat is not Repeat.NEVER
    before, spell, after = _spells(durations, stance, in_air, repeats=repeats)
    return {
        "mass": mass[..., None],
        "support": support,
        "before": before,
        "spell": spell,
        "stance": stance,
        "after": after,
        "ahead": ahead,
        "rate": float(np.sqrt(np.hypot(*robot.model.gravity) / height)),
        "farthest": MOST_MOVED * height,
        "adapts": adapts,
    }


def _mass_along(robot: Robot, phase: MotionPhase, ahead: Floats) -> Floats:
    """Coefficients of the centre of mass along the ground, (pieces, terms), as of its pieces."""
    terms = phase.pieces.shape[1]
    share = 0.5 - 0.5 * np.cos(np.pi * np.arange(terms) / (terms - 1))
    powers = share[:, None] ** np.arange(terms)
    found = []
    for begin, length in zip(phase.breakpoints[:-1], np.diff(phase.breakpoints), strict=True):
        places = [
            center_of_mass(robot, phase.coordinates(min(begin + length * s, phase.duration)))
            @ ahead
            for s in share
        ]
        found.append(np.linalg.solve(powers, places) / length ** np.arange(terms))
    return np.array(found)


def _spells(
    durations: Floats, stance: Floats, in_air: Any, *, repeats: bool
) -> tuple[Floats, Floats, Floats]:
    """For how long feet have been in the air before phases, and will have been as they land.

    And for how long of what follows a phase until then something stands.
    """
    count, _ = in_air.shape
    before, spell, after = np.zeros((3, *in_air.shape))
    for p, foot in np.argwhere(in_air).tolist():
        first = last = p
        while in_air[(first - 1) % count, foot] and (repeats or first > 0) and p - first < count:
            first -= 1
        while in_air[(last + 1) % count, foot] and last + 1 < p + count:
            last += 1
        if in_air[(last + 1) % count, foot] or not (repeats or last + 1 < count):
            continue  # it never lands
        before[p, foot] = sum(durations[k % count] for k in range(first, p))
        spell[p, foot] = sum(durations[k % count] for k in range(first, last + 1))
        after[p, foot] = sum(stance[k % count] for k in range(p + 1, last + 1))
    return before, spell, after
