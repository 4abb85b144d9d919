"""Closed loops and coupled joints: the equality constraints of MJCF, and URDF's ``mimic``."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.polynomial import Polynomial

from heelstrike.robot.files.links import Links
from heelstrike.robot.files.mujoco_file import MujocoFile
from heelstrike.robot.files.posture import followers
from heelstrike.robot.model import POWERS, Floats

SAME_PLACE = 1e-9
"""Metres up to which two hinges are one: in space an axis takes two points."""


def read_loops(file: MujocoFile, links: Links) -> dict[str, Any]:
    """Return loops and couplings, as numbers of :class:`~heelstrike.robot.model.Model`."""
    loops: dict[tuple[Any, ...], tuple[Any, Any]] = {}
    for ends, places in _connections(file, links):
        rounded = np.round(np.ravel(places) / SAME_PLACE).astype(np.int64)
        loops.setdefault((*ends, *rounded.tolist()), (ends, places))
    couplings = list(_couplings(file))
    return {
        "loop_link": [ends for ends, _ in loops.values()],
        "loop_position": [places for _, places in loops.values()],
        "coupling_joint": [joints for joints, _ in couplings],
        "coupling_polynomial": [factors for _, factors in couplings],
    }


def is_modelled(file: MujocoFile, one: int) -> bool:
    """Whether an equality constraint of the file is held here, or holds nothing that moves."""
    import mujoco

    model = file.model
    if int(model.eq_type[one]) == mujoco.mjtEq.mjEQ_CONNECT or not model.eq_active0[one]:
        return True
    if int(model.eq_type[one]) == mujoco.mjtEq.mjEQ_JOINT:
        moving = {each.joint for each in file.coordinates}
        joint, leader = int(model.eq_obj1id[one]), int(model.eq_obj2id[one])
        return joint not in moving or leader < 0 or leader in moving
    return False


def _connections(file: MujocoFile, links: Links) -> Iterator[tuple[tuple[int, int], Floats]]:
    """Two links of each loop, and where its hinge is on each of them."""
    import mujoco

    model, pose = file.model, file.pose
    if file.disabled("equality"):
        return
    for one in range(model.neq):
        if model.eq_type[one] != mujoco.mjtEq.mjEQ_CONNECT or not model.eq_active0[one]:
            continue
        things = int(model.eq_obj1id[one]), int(model.eq_obj2id[one])
        if model.eq_objtype[one] == mujoco.mjtObj.mjOBJ_SITE:
            bodies = tuple(int(model.site_bodyid[site]) for site in things)
            within = model.site_pos[list(things)]
        else:
            bodies, within = things, model.eq_data[one, :6].reshape(2, 3)
        ends = int(links.of_body[bodies[0]]), int(links.of_body[bodies[1]])
        if ends[0] == ends[1]:
            continue  # what is one part is together anyway
        places = np.zeros((2, 2))
        for k in range(2):
            turned = pose.xmat[bodies[k]].reshape(3, 3) @ within[k]
            places[k] = (pose.xpos[bodies[k]] + turned)[::2]
            if ends[k] >= 0:
                places[k] -= links.origin[ends[k]]
        if ends[0] < 0:  # the first is a link, the second may be the world
            ends, places = ends[::-1], places[::-1]
        yield ends, places


def _couplings(file: MujocoFile) -> Iterator[tuple[tuple[int, int], Floats]]:
    """Coordinates that follow others (-1: none), with polynomials about their references."""
    model = file.model
    place = {one.joint: i for i, one in enumerate(file.coordinates) if one.joint >= 0}
    for joint, leader, factors in followers(model):
        if joint not in place or (leader >= 0 and leader not in place):
            continue
        own = file.coordinates[place[joint]]
        zero = float(model.qpos0[model.jnt_qposadr[joint]])
        moved = own.sense * own.reference - zero
        polynomial = Polynomial(factors)
        if leader >= 0:
            its = file.coordinates[place[leader]]
            zero = float(model.qpos0[model.jnt_qposadr[leader]])
            there = its.sense * its.reference - zero
            polynomial = polynomial(Polynomial([there, its.sense]))
        else:
            polynomial = Polynomial(factors[:1])
        found = np.zeros(POWERS)
        found[: len(polynomial.coef)] = own.sense * polynomial.coef
        found[0] -= own.sense * moved
        yield (place[joint], place.get(leader, -1)), found
