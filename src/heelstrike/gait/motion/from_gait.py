"""A gait as a motion: the trunk follows from the foot that stands, forces from the dynamics.

A gait gives the joints alone, as polynomials; a motion gives all coordinates. What follows from the
joints is smooth, and is interpolated at Chebyshev's points of short pieces.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from heelstrike.dynamics import (
    contact_jacobian,
    inverse_dynamics,
    link_poses,
    passive_force,
    point_position,
)
from heelstrike.errors import GaitError
from heelstrike.gait.gait import Footing, Gait, fingerprint
from heelstrike.gait.motion.motion import Motion, MotionPhase
from heelstrike.gait.motion.phases import Standing, standing
from heelstrike.gait.motion.program import STAGES
from heelstrike.gait.motion.request import Repeat
from heelstrike.gait.polynomials import gauss
from heelstrike.gait.sole import Sole, sole
from heelstrike.robot.loops import refuse_loops
from heelstrike.robot.model import Floats
from heelstrike.robot.robot import Robot

DEGREE = 7
"""Degree of the polynomials."""
SHORT = 0.03
"""Longest piece (s)."""


def motion_of_gait(robot: Robot, gait: Gait) -> Motion:
    """Return a gait as a motion of all coordinates, with the forces of the ground.

    Parameters
    ----------
    robot : Robot
        The robot that the gait was designed for.
    gait : Gait
        A gait that stands on one foot at a time.

    Raises
    ------
    GaitError
        If the gait is of another robot, or has several phases.
    """
    gait.check_joints(robot)
    if gait.fingerprint != fingerprint(robot):
        raise GaitError(
            f"this gait was designed for robot {gait.robot!r} with other numbers than robot "
            f"{robot.name!r} has. Use that robot, or design a new gait with optimize_gait."
        )
    refuse_loops(robot, "a motion of all coordinates", GaitError)
    mirror = robot.mirror
    if len(gait.phases) != 1 or len(gait.phases[0].contacts) != 1 or mirror is None:
        raise GaitError("only a gait that stands on one foot at a time is a motion of one phase")
    stance = sole(robot, gait.stance_foot)
    if (gait.phases[0].contacts[gait.stance_foot] is Footing.FLAT) != stance.flat:
        raise GaitError(
            f"this gait stands {gait.phases[0].contacts[gait.stance_foot].value}, which foot "
            f"{robot.feet[stance.foot].name!r} of robot {robot.name!r} does not"
        )
    stands = standing(robot, stance.contacts)
    ends = _short(gait.breakpoints)
    pieces = np.array([_piece(robot, gait, stance, *each) for each in pairwise(ends)])
    still = MotionPhase(
        contacts=tuple(robot.contact_names[i] for i in sorted(stands.points)),
        breakpoints=ends,
        pieces=pieces,
        force=np.zeros((len(pieces), STAGES, robot.nc, 2)),
        impulse=_impulse(robot, gait),
    )
    nodes, _ = gauss(STAGES)
    times = (ends[:-1, None] + np.diff(ends)[:, None] * nodes).ravel()
    moved = [still.coordinates(times, order=order) for order in range(3)]
    forces = [_forces(robot, gait.slope, stands, *each) for each in zip(*moved, strict=True)]
    phase = MotionPhase(
        contacts=still.contacts,
        breakpoints=ends,
        pieces=pieces,
        force=np.reshape(forces, still.force.shape),
        impulse=still.impulse,
    )
    return Motion(
        robot=gait.robot,
        fingerprint=gait.fingerprint,
        phases=(phase,),
        repeat=Repeat.MIRRORED,
        distance=gait.step_length,
        slope=gait.slope,
        rise=gait.rise,
        friction=gait.friction,
        mirror_joint=mirror.joint,
        mirror_sign=mirror.sign,
        mirror_offset=mirror.offset,
        mirror_contact=mirror.contact,
        initial_state=gait.initial_state,
        cost=gait.cost,
        spent=gait.cost if gait.spent is None else gait.spent,
        optimal=gait.optimal,
        margins={"height": gait.margins.clearance, "push": gait.margins.normal_force},
    )


def _short(breakpoints: Floats) -> Floats:
    """Times between which pieces are short, those of a gait among them."""
    parts = [
        np.linspace(begin, end, int(np.ceil((end - begin) / SHORT)), endpoint=False)
        for begin, end in pairwise(breakpoints)
    ]
    return np.concatenate([*parts, breakpoints[-1:]])


def _piece(robot: Robot, gait: Gait, stance: Sole, begin: float, end: float) -> Floats:
    """Coefficients (DEGREE + 1, nv) of all coordinates between two times."""
    share = 0.5 - 0.5 * np.cos(np.pi * np.arange(DEGREE + 1) / DEGREE)  # both ends among them
    q = [_position(robot, gait, stance, t) for t in begin + (end - begin) * share]
    powers = share[:, None] ** np.arange(DEGREE + 1)
    scale = (end - begin) ** np.arange(DEGREE + 1)
    return np.asarray(np.linalg.solve(powers, np.array(q)) / scale[:, None], np.float64)


def _position(robot: Robot, gait: Gait, stance: Sole, t: float) -> Floats:
    """All coordinates at a time of the first step."""
    up = np.array([-np.sin(gait.slope), np.cos(gait.slope)])
    ahead = np.array([up[1], -up[0]])
    q = robot.model.reference.copy()
    q[robot.model.actuator_joint] = gait.in_step(t)
    turned = robot.model.axis[2, 0]
    if stance.flat:
        q[2] += turned * (stance.angle - gait.slope - link_poses(robot, q).angle[stance.link])
    else:
        q[2] = gait.pitch(t)
    rolled = stance.radius * (link_poses(robot, q).angle[stance.link] + gait.slope)
    place = point_position(robot, q, stance.link, stance.point) - stance.radius * up
    q[:2] -= place - rolled * ahead
    return q


def _forces(
    robot: Robot, slope: float, stands: Standing, q: Floats, v: Floats, a: Floats
) -> Floats:
    """Forces of the ground (nc, 2), away from it and along it, that the free coordinates need."""
    turn = np.array([[np.cos(slope), -np.sin(slope)], [np.sin(slope), np.cos(slope)]])
    rows = (turn @ contact_jacobian(robot, q)).reshape(2 * robot.nc, robot.nv)[stands.forces]
    free = np.setdiff1d(np.arange(robot.nv), robot.model.actuator_joint)
    needed = inverse_dynamics(robot, q, v, a) - passive_force(robot, q, v)
    force = np.zeros(2 * robot.nc)
    force[stands.forces] = np.linalg.lstsq(rows[:, free].T, needed[free])[0]
    return force.reshape(robot.nc, 2)


def _impulse(robot: Robot, gait: Gait) -> Floats:
    """Impulses (nc, 2) on the ends of the sole that lands, or on its point."""
    landing = sole(robot, 1 - gait.stance_foot)
    normal, tangent, moment = gait.touchdown_impulse
    impulse = np.zeros((robot.nc, 2))
    stands = standing(robot, landing.contacts)
    impulse[list(stands.tangent), 1] = tangent
    if not landing.flat:
        impulse[list(stands.normal), 0] = normal
        return impulse
    middle = 0.5 * normal
    # A force ahead of the middle turns the foot against the positive sense about +y.
    by_moment = 0.5 * moment / landing.half_length
    heel, toe = sorted(stands.normal, key=lambda i: robot.model.contact_position[i][0])
    impulse[[heel, toe], 0] = middle + by_moment, middle - by_moment
    return impulse
