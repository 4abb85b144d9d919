"""Motions put into MuJoCo's equations of motion: what they lack, and how nearly they repeat.

Mass matrix, bias force, springs and Jacobians are MuJoCo's. Of a motion only its polynomials are
taken, and of a robot the places of its contact points and which joints have motors.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import mujoco
import numpy as np
from scipy.integrate import solve_ivp

import heelstrike as hs
from heelstrike.gait import MotionPhase

Floats = np.ndarray
STAGES = 4  # Gauss points of a piece
FINE = {"method": "DOP853", "rtol": 3e-11, "atol": 1e-12}
"""How phases are integrated."""
KP, KD = 400.0, 40.0  # gains of computed torque (1/s², 1/s)
FORCES = 1e-2
"""ε (m/s²): forces give way before motion."""


@dataclass(frozen=True)
class Evaluated:
    """The equations of motion A v̇ + h = Sᵀτ + Jᵀλ at an instant."""

    mass: Floats
    force: Floats
    """h, (nv,): bias force without that of springs and dampers."""
    jacobian: Floats
    """(nc, 2, nv) Rows of every contact point, away from the ground and along it."""
    moved: Floats
    """(nc, 2) J̇v."""
    tied: Floats
    """(rows, nv) Rows of closed loops, along x and z."""
    tied_moved: Floats
    """(rows,) Their J̇v."""


class Mechanics:
    """A robot's equations of motion by MuJoCo.

    Parameters
    ----------
    robot : Robot
        The robot.
    model : mujoco.MjModel
        The same one in MuJoCo, its joints in the same order.
    slope : float
        Angle (rad) at which the ground ascends ahead.
    """

    def __init__(self, robot: hs.Robot, model: mujoco.MjModel, slope: float) -> None:
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_ACTUATION
        self.robot, self._model, self._data = robot, model, mujoco.MjData(model)
        mujoco.mj_forward(model, self._data)
        self._upright = self._data.xmat.reshape(-1, 3, 3).copy()
        self._frame = np.array(
            [[-np.sin(slope), 0.0, np.cos(slope)], [np.cos(slope), 0.0, np.sin(slope)]]
        )

    def at(self, q: Floats, v: Floats) -> Evaluated:
        """Evaluate the equations."""
        model, data, contacts = self._model, self._data, self.robot.model
        data.qpos[:], data.qvel[:] = q, v
        mujoco.mj_forward(model, data)
        mass = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, mass)
        rows, moved = np.zeros((contacts.nc, 2, model.nv)), np.zeros((contacts.nc, 2))
        jacobian, rate, unused = (np.zeros((3, model.nv)) for _ in range(3))
        for i, link in enumerate(contacts.contact_link.tolist()):
            body = int(model.jnt_bodyid[link])
            slides = model.jnt_type[link] == mujoco.mjtJoint.mjJNT_SLIDE
            # MuJoCo notes where the joint was before it moved; links move with a slide.
            gone = float(slides) * (q[link] - model.qpos0[link]) * data.xaxis[link]
            turned = data.xmat[body].reshape(3, 3) @ self._upright[body].T
            x, z = contacts.contact_position[i]
            center = data.xanchor[link] + gone + turned @ [x, 0.0, z]
            lowest = center - contacts.contact_radius[i] * self._frame[0]
            mujoco.mj_jac(model, data, jacobian, unused, lowest, body)
            # A disc rolls: what its lowest point accelerates by is that of its centre.
            mujoco.mj_jacDot(model, data, rate, unused, center, body)
            rows[i], moved[i] = self._frame @ jacobian, self._frame @ (rate @ v)
        tied, tied_moved = self._loops(v)
        return Evaluated(mass, data.qfrc_bias - data.qfrc_passive, rows, moved, tied, tied_moved)

    def _loops(self, v: Floats) -> tuple[Floats, Floats]:
        """Rows of closed loops, each of which holds two sites together."""
        model, data = self._model, self._data
        rows, moved = np.zeros((0, model.nv)), np.zeros(0)
        jacobian, rate, unused = (np.zeros((3, model.nv)) for _ in range(3))
        for loop in range(model.neq):
            assert model.eq_type[loop] == mujoco.mjtEq.mjEQ_CONNECT
            assert model.eq_objtype[loop] == mujoco.mjtObj.mjOBJ_SITE
            row, bias = np.zeros((2, model.nv)), np.zeros(2)
            for site, sign in ((model.eq_obj1id[loop], 1.0), (model.eq_obj2id[loop], -1.0)):
                body, point = int(model.site_bodyid[site]), data.site_xpos[site]
                mujoco.mj_jac(model, data, jacobian, unused, point, body)
                mujoco.mj_jacDot(model, data, rate, unused, point, body)
                row += sign * jacobian[[0, 2]]
                bias += sign * (rate @ v)[[0, 2]]
            rows, moved = np.vstack([rows, row]), np.concatenate([moved, bias])
        return rows, moved


def gauss_times(phase: MotionPhase) -> Floats:
    """Gauss points of all pieces, (K, STAGES), in s since the beginning of the phase."""
    nodes = 0.5 * (1.0 + np.polynomial.legendre.leggauss(STAGES)[0])
    return phase.breakpoints[:-1, None] + np.diff(phase.breakpoints)[:, None] * nodes


def needed(mechanics: Mechanics, phase: MotionPhase) -> Floats:
    """Forces on all coordinates that a phase needs of motors, at Gauss points, (K, STAGES, nv).

    Closed loops pull as they have to, for the coordinates without a motor.
    """
    free = np.setdiff1d(np.arange(mechanics.robot.nv), mechanics.robot.model.actuator_joint)
    times = gauss_times(phase)
    found = np.zeros((*times.shape, phase.pieces.shape[2]))
    for at in np.ndindex(times.shape):
        q, v, a = (phase.coordinates(times[at], order=order) for order in range(3))
        now = mechanics.at(q, v)
        pushed = np.einsum("ikj,ik->j", now.jacobian, phase.force[at])
        found[at] = now.mass @ a + now.force - pushed
        pulled = np.linalg.lstsq(now.tied[:, free].T, found[at][free])[0]
        found[at] -= now.tied.T @ pulled
    return found


def lacking(mechanics: Mechanics, motion: hs.Motion) -> float:
    """Largest force (N) or moment (N m) that coordinates without a motor lack."""
    free = np.setdiff1d(np.arange(mechanics.robot.nv), mechanics.robot.model.actuator_joint)
    return max(float(np.abs(needed(mechanics, each)[..., free]).max()) for each in motion.phases)


def held_rows(robot: hs.Robot, phase: MotionPhase) -> list[tuple[int, int]]:
    """Contact points and directions that are held: of a flat foot both ends, and one along it."""
    rows = []
    for link in dict.fromkeys(robot.model.contact_link.tolist()):
        stand = [robot.contact_names.index(each) for each in phase.contacts]
        stand = [i for i in stand if robot.model.contact_link[i] == link]
        stand.sort(key=lambda i: robot.model.contact_position[i, 0])
        if stand:
            rows += [(i, 0) for i in sorted({stand[0], stand[-1]})] + [(stand[0], 1)]
    return rows


def integrated(mechanics: Mechanics, motion: hs.Motion) -> tuple[Floats, Floats]:
    """State at the end of a motion that computed torque follows; before any landing.

    Contact points that stand are held by whatever force it takes. Landings are plastic impacts of
    all points that stand afterwards. Without feedback, the flat walk of bravo7 multiplies an error
    of its mesh by more than 1e6 in a step: a chain of links that nothing holds falls over.
    """
    q, v = motion.initial_state.q.copy(), motion.initial_state.v.copy()
    for p, phase in enumerate(motion.phases):
        if p:
            q, v = landed(mechanics, motion.phases[p - 1], phase, q, v)
        q, v = _through(mechanics, phase, q, v)
    return q, v


def landed(
    mechanics: Mechanics, before: MotionPhase, after: MotionPhase, q: Floats, v: Floats
) -> tuple[Floats, Floats]:
    """State after what stands in the next phase has come down."""
    if not set(after.contacts) - set(before.contacts):
        return q, v
    now = mechanics.at(q, v)
    held = held_rows(mechanics.robot, after)
    rows = np.vstack([[now.jacobian[i, k] for i, k in held], now.tied])
    v = v + _constrained(now.mass, rows, np.zeros(v.size), -rows @ v)
    return q, v


def _constrained(mass: Floats, rows: Floats, force: Floats, wanted: Floats) -> Floats:
    """Accelerations a with A a = f + Jᵀλ and J a as wanted."""
    count, held = len(mass), len(rows)
    system = np.block([[mass, -rows.T], [rows, np.zeros((held, held))]])
    return np.linalg.solve(system, np.concatenate([force, wanted]))[:count]


def _through(
    mechanics: Mechanics, phase: MotionPhase, q: Floats, v: Floats
) -> tuple[Floats, Floats]:
    for k, (begin, end) in enumerate(pairwise(phase.breakpoints)):
        # One polynomial at a time: the next one has other accelerations where both meet.
        one = replace(
            phase, breakpoints=np.array([0.0, end - begin]), pieces=phase.pieces[k : k + 1],
            force=phase.force[k : k + 1],
        )  # fmt: skip
        rate = _rate(mechanics, one)
        found = solve_ivp(rate, (0.0, end - begin), np.concatenate([q, v]), **FINE)
        q, v = np.split(found.y[:, -1], 2)
    return q, v


def _rate(mechanics: Mechanics, phase: MotionPhase) -> Callable[[float, Floats], Floats]:
    """How the state changes under computed torque in a phase."""
    held = held_rows(mechanics.robot, phase)

    def rate(t: float, state: Floats) -> Floats:
        q, v = np.split(state, 2)
        now = mechanics.at(q, v)
        points = np.array([now.jacobian[i, k] for i, k in held]).reshape(-1, q.size)
        rows = np.vstack([points, now.tied])
        still = np.array([*(-now.moved[i, k] for i, k in held), *-now.tied_moved])
        given = phase.forces(t)
        forces = np.array([given[i, k] for i, k in held])
        at, fast, bend = (phase.coordinates(t, order=order) for order in range(3))
        wanted = bend + KD * (fast - v) + KP * (at - q)
        return np.concatenate([v, _nearest(mechanics.robot, now, rows, still, wanted, forces)])

    return rate


def _nearest(
    robot: hs.Robot, now: Evaluated, rows: Floats, still: Floats, wanted: Floats, forces: Floats
) -> Floats:
    """Possible accelerations nearest to those wanted of the joints, forces of the ground given way.

    The minimum of |a_J - wanted|² + ε² |λ - given|² (forces in units of the weight) subject to the
    equations of the coordinates without a motor, in the same unit, and to those of the contacts.
    Closed loops, the last rows, pull for nothing.
    """
    n, held, weight = len(now.mass), len(rows), robot.weight
    forces = np.append(forces, np.zeros(held - forces.size))
    driven = robot.model.actuator_joint
    free = np.setdiff1d(np.arange(n), driven)
    weigh = np.zeros(n + held)
    weigh[driven], weigh[n : n + held - len(now.tied)] = 1.0, FORCES**2
    must = np.block([[now.mass[free] / weight, -rows.T[free]], [rows, np.zeros((held, held))]])
    target = np.concatenate([-now.force[free] / weight, still])
    system = np.block([[np.diag(weigh), must.T], [must, np.zeros((len(must), len(must)))]])
    known = np.concatenate([weigh * np.concatenate([wanted, forces / weight]), target])
    return np.linalg.solve(system, known)[:n]


def gap(mechanics: Mechanics, motion: hs.Motion) -> float:
    """Largest difference (m, rad, m/s, rad/s) between what follows a motion and how it goes on.

    After one that repeats comes its beginning, or the mirror image of that, a distance further on;
    after one that does not, its end.
    """
    q, v = integrated(mechanics, motion)
    if motion.repeat is hs.Repeat.NEVER:
        last = motion.phases[-1]
        q_end, v_end = (last.coordinates(last.duration, order=order) for order in range(2))
        return float(max(np.abs(q - q_end).max(), np.abs(v - v_end).max()))
    first = motion.phases[0]
    q_next, v_next = motion.initial_state.q, motion.initial_state.v
    if motion.repeat is hs.Repeat.MIRRORED:
        names, image = mechanics.robot.contact_names, motion.mirror_contact
        mirrored = tuple(names[image[names.index(each)]] for each in first.contacts)
        first = MotionPhase(
            contacts=mirrored, breakpoints=first.breakpoints, pieces=first.pieces,
            force=first.force, impulse=first.impulse,
        )  # fmt: skip
        q_next = motion.mirror_sign * q_next[motion.mirror_joint] + motion.mirror_offset
        v_next = motion.mirror_sign * v_next[motion.mirror_joint]
    q, v = landed(mechanics, motion.phases[-1], first, q, v)
    along = motion.distance * np.array([np.cos(motion.slope), np.sin(motion.slope)])
    q_next = q_next + np.pad(along, (0, q.size - 2))
    return float(max(np.abs(q - q_next).max(), np.abs(v - v_next).max()))


def mechanics_of(robot: hs.Robot, slope: float) -> Mechanics:
    """Return a robot's mechanics by MuJoCo, which reads the robot's file."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "robot.xml"
        robot.save(path)
        return Mechanics(robot, mujoco.MjModel.from_xml_path(str(path)), slope)
