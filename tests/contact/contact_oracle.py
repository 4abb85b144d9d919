"""Brute force: every combination of contact modes, each a linear feasibility problem."""

from __future__ import annotations

import itertools

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linprog

Floats = NDArray[np.float64]

OPEN, STICK, FORWARD, BACKWARD = range(4)


def residual(delassus: Floats, free: Floats, friction: Floats, impulse: Floats) -> float:
    """Largest relative violation of the contact laws, written down a second time and plainly."""
    velocity = delassus @ impulse + free
    speed = np.abs(free).max() + np.abs(free) + np.abs(delassus) @ np.abs(impulse)
    worst = 0.0
    for k, mu in enumerate(friction):
        n, t = 2 * k, 2 * k + 1
        wn, wt = velocity[n], velocity[t]
        ln, lt = impulse[n], impulse[t]
        vn, vt = max(speed[n], 1e-300), max(speed[t], 1e-300)
        gn, gt = delassus[n, n], delassus[t, t]
        force = ln * gn / vn if gn > 0 else np.sign(ln)
        worst = max(worst, -wn / vn, -force, min(wn / vn, force))
        size = mu * abs(ln) + abs(lt)
        unit = gt / vt if gt > 0 else (1.0 / size if size > 0 else 0.0)
        worst = max(worst, (abs(lt) - mu * ln) * unit)
        lacking = (mu * ln + lt) * unit if wt > 0 else (mu * ln - lt) * unit
        worst = max(worst, min(abs(wt) / vt, lacking))
    return float(worst)


def solutions(delassus: Floats, free: Floats, friction: Floats) -> list[Floats]:
    """All velocities that solve the problem, one for each that differs from the others."""
    count = friction.size
    diagonal = np.diag(delassus)
    scale = np.where(diagonal > 0, 1.0 / np.sqrt(np.where(diagonal > 0, diagonal, 1.0)), 1.0)
    G = scale[:, None] * delassus * scale
    size = np.abs(scale * free).max() or 1.0
    b = scale * free / size
    found: list[Floats] = []
    for modes in itertools.product(range(4), repeat=count):
        equal, inequal, offset_equal, offset_inequal = [], [], [], []

        def demand(row: Floats, offset: float, rows: list, offsets: list) -> None:
            rows.append(row)
            offsets.append(-offset)

        for k, mode in enumerate(modes):
            n, t = 2 * k, 2 * k + 1
            en, et = np.eye(2 * count)[n] * scale[n], np.eye(2 * count)[t] * scale[t]
            if mode == OPEN:
                demand(en, 0.0, equal, offset_equal)
                demand(et, 0.0, equal, offset_equal)
                demand(-G[n], -b[n], inequal, offset_inequal)
                continue
            demand(G[n], b[n], equal, offset_equal)
            demand(-en, 0.0, inequal, offset_inequal)
            if mode == STICK:
                demand(G[t], b[t], equal, offset_equal)
                demand(et - friction[k] * en, 0.0, inequal, offset_inequal)
                demand(-et - friction[k] * en, 0.0, inequal, offset_inequal)
            else:
                side = 1.0 if mode == FORWARD else -1.0
                demand(et + side * friction[k] * en, 0.0, equal, offset_equal)
                demand(-side * G[t], -side * b[t], inequal, offset_inequal)
        result = linprog(
            np.zeros(2 * count),
            A_ub=np.array(inequal) if inequal else None,
            b_ub=np.array(offset_inequal) if inequal else None,
            A_eq=np.array(equal),
            b_eq=np.array(offset_equal),
            bounds=(None, None),
            method="highs",
            options={"primal_feasibility_tolerance": 1e-10},
        )
        if result.status == 0:
            velocity = (G @ result.x + b) * size / scale
            unit = np.abs(free).max() or 1.0
            if not any(np.allclose(velocity, other, atol=1e-7 * unit) for other in found):
                found.append(velocity)
    return found
