"""Robots put where they can be: on the ground and in no part of it, their loops closed."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from heelstrike import dynamics
from heelstrike.contact.ground import Ground, GroundModel, ground_contact, ground_height
from heelstrike.contact.queries.kinematics import contact_kinematics
from heelstrike.contact.workspace import Floats, Integers
from heelstrike.errors import RobotError
from heelstrike.robot.coordinates import checked, index_of
from heelstrike.robot.robot import Robot
from heelstrike.robot.state import State
from heelstrike.tolerances import LEVEL_SOLE

TRUNK = (0, 1, 2)  # coordinates of a floating trunk: x, z, pitch
PLACED_GAP = 1e-12  # m; gaps that small are closed
MOST_ITERATIONS = 60
LARGEST_CHANGE = 0.2  # rad, m; of a joint in one iteration
MOST_TILT = 0.6  # rad, m; of all joints together, beyond which a foot is not made to fit the ground


def placed(robot: Robot, state: State, ground: Ground) -> State:
    """Move a robot up or down until it touches the ground; see :meth:`Robot.placed`."""
    state = checked(robot, state)
    lift = _lift(robot)
    centers = dynamics.contact_positions(robot, state.q)
    touching = [
        touching_height(ground, float(x), float(radius))
        for (x, _), radius in zip(centers, robot.model.contact_radius, strict=True)
    ]
    q = state.q.copy()
    q[lift] += robot.model.axis[lift, 2] * float(np.max(touching - centers[:, 1]))
    return State(q, state.v)


def standing(robot: Robot, ground: Ground) -> State:
    """Stand a robot on the ground with its soles on it; see :meth:`Robot.standing`."""
    start = placed(robot, robot.reference_state(), ground)
    start = closed(robot, start) if robot.model.loops + robot.model.couplings > 0 else start
    sole = _soles(robot)
    lift = _lift(robot)
    held = {*_above(robot, lift), *(TRUNK if robot.floating else ())} - {lift}
    free = np.array([joint for joint in range(robot.nq) if joint not in held])
    low, high = np.minimum(robot.model.lower, start.q), np.maximum(robot.model.upper, start.q)
    # Where little mass moves, as at ankles, much may change.
    ease = 1.0 / np.sqrt(np.diag(dynamics.mass_matrix(robot, start.q)))
    q = start.q.copy()
    for _ in range(MOST_ITERATIONS if sole else 0):
        at = contact_kinematics(robot, q, start.v, ground)
        gap = np.concatenate([at.gap[sole], dynamics.loop_displacement(robot, q)])
        if np.abs(gap).max() < PLACED_GAP:
            break
        # The least change that closes the gaps, were the ground straight around each point.
        along = np.vstack([at.jacobian[sole, 0], dynamics.loop_jacobian(robot, q)])
        rows = along[:, free] * ease[free]
        change = ease[free] * np.linalg.lstsq(rows, -gap, rcond=1e-9)[0]
        wanted = q[free] + np.clip(change, -LARGEST_CHANGE, LARGEST_CHANGE)
        q[free] = np.clip(wanted, low[free], high[free])
        free = free[q[free] == wanted]  # a joint that comes to its stop stays there
        if np.any(np.abs(np.delete(q - start.q, lift)) > MOST_TILT):
            return start
    return placed(robot, State(q, start.v), ground)


def closed(robot: Robot, state: State, keep: Iterable[str | int] = ()) -> State:
    """Close the loops of a robot; see :meth:`Robot.closed`."""
    state = checked(robot, state)
    kept = [index_of(robot, "joint", robot.joint_names, joint) for joint in keep]
    free = np.setdiff1d(np.arange(robot.nq), kept)
    q, v = state.q.copy(), state.v.copy()
    low, high = np.minimum(robot.model.lower, q), np.maximum(robot.model.upper, q)
    moves, before = free, np.inf
    for _ in range(MOST_ITERATIONS):
        open_by = dynamics.loop_displacement(robot, q)
        worst = float(np.abs(open_by).max(initial=0.0))
        if worst < PLACED_GAP and (before == np.inf or not worst < 0.5 * before):
            break  # closed as it came, or as well as can be
        before = worst
        change = _least(robot, q, moves, -open_by)
        wanted = q[moves] + np.clip(change, -LARGEST_CHANGE, LARGEST_CHANGE)
        q[moves] = np.clip(wanted, low[moves], high[moves])
        moves = moves[q[moves] == wanted]  # a joint that comes to its stop stays there
    rates = dynamics.loop_jacobian(robot, q) @ v
    v[free] += _least(robot, q, free, -rates)
    left = np.abs(dynamics.loop_jacobian(robot, q) @ v).max(initial=0.0)
    if not worst < PLACED_GAP or left > PLACED_GAP * max(1.0, float(np.abs(v).max(initial=0.0))):
        names = [f"{name} along {axis}" for name in robot.loop_names for axis in "xz"]
        names += [f"coupling of {name}" for name in robot.coupling_names]
        place = int(np.argmax(np.abs(open_by)))
        told = f" while {', '.join(robot.joint_names[j] for j in kept)} stay" if kept else ""
        raise RobotError(
            f"robot {robot.name!r} cannot close its loops{told}: {names[place]} stays open by "
            f"{abs(open_by[place]):.3g}. Begin nearer to where they are closed"
            + (", or let more joints move." if kept else ".")
        )
    return State(q, v)


def _least(robot: Robot, q: Floats, free: Integers, wanted: Floats) -> Floats:
    """Change of some coordinates, least by the masses, that moves the loops as wanted."""
    ease = np.linalg.cholesky(np.linalg.inv(dynamics.mass_matrix(robot, q)[np.ix_(free, free)]))
    rows = dynamics.loop_jacobian(robot, q)[:, free] @ ease
    change: Floats = ease @ np.linalg.lstsq(rows, wanted, rcond=1e-9)[0]
    return change


def _lift(robot: Robot) -> int:
    """Coordinate that moves the whole robot straight up or down."""
    model = robot.model
    for joint in range(robot.nv):
        slides = not np.any(model.axis[_above(robot, joint), 0])
        carried = [joint in _above(robot, link) for link in set(model.contact_link.tolist())]
        if slides and model.axis[joint, 1] == 0.0 and carried and all(carried):
            return joint
    raise RobotError(
        f"robot {robot.name!r} cannot be put on the ground: it "
        + ("has no joint that lifts all of it." if robot.nc else "has no contact points.")
    )


def _above(robot: Robot, link: int) -> list[int]:
    """Links from one up to the world, itself first."""
    found = [link]
    while (parent := int(robot.model.parent[found[-1]])) >= 0:
        found.append(parent)
    return found


def touching_height(ground: Ground, x: float, radius: float) -> float:
    """Height of the centre of a disc above x that touches the ground and lies in no part of it."""
    model = ground.model()
    if ground.shape is not None:
        return _touching_curve(model, x, radius)
    left, right = model.vertices[:-1], model.vertices[1:]
    heights = [float(ground.height(x)) + radius]
    for corner in model.vertices[np.abs(model.vertices[:, 0] - x) <= radius]:
        heights.append(float(corner[1] + np.sqrt(radius**2 - (corner[0] - x) ** 2)))
    for k in np.flatnonzero(model.normal[:, 1] > 0.0):
        foot = x - radius * model.normal[k, 0]  # where the disc would touch this segment
        first, last = k == 0, k == len(left) - 1  # which go on forever
        if (first or left[k, 0] <= foot) and (last or foot <= right[k, 0]):
            slope = -model.normal[k, 0] / model.normal[k, 1]
            base = left[k, 1] + slope * (x - left[k, 0])
            heights.append(float(base + radius / model.normal[k, 1]))
    return max(heights)


def _touching_curve(model: GroundModel, x: float, radius: float) -> float:
    """Height of the centre of a disc above x that touches smooth ground: its gap is zero."""
    normal = np.zeros(2)
    height = ground_height(model, x) + radius
    for _ in range(MOST_ITERATIONS):
        gap = ground_contact(model, x, height, radius, normal)[0]
        height -= gap / normal[1]
        if abs(gap) < PLACED_GAP:
            break
    return float(height)


def _soles(robot: Robot) -> list[int]:
    """First and last of the contact points on which each foot stands in the reference."""
    bottoms: Floats = dynamics.contact_positions(robot, robot.model.reference)[:, 1]
    bottoms = bottoms - robot.model.contact_radius
    ends: list[int] = []
    for foot in robot.feet:
        contacts = np.array(foot.contacts)
        low = contacts[bottoms[contacts] <= bottoms[contacts].min() + LEVEL_SOLE]
        ends += sorted({int(low[0]), int(low[-1])})
    return ends
