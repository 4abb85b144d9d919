"""Contact problems of a file through Siconos: run by a Python that has its package.

It is handed a file of arrays by ``spatial_contact.py --peers``, with the problems' sizes, matrices,
free terms and friction one behind the other, and leaves the impulses and seconds of each solver in
another. What they are worth is for the judge to say.

Run: python spatial_contact_siconos.py problems.npz answers.npz
"""

from __future__ import annotations

import sys
import time

import numpy as np
import siconos.numerics as sn

SOLVERS = {
    "NSN_AC": (sn.SICONOS_FRICTION_3D_NSN_AC, sn.fc3d_nonsmooth_Newton_AlartCurnier),
    "NSGS": (sn.SICONOS_FRICTION_3D_NSGS, sn.fc3d_nsgs),
}
TOLERANCE, ITERATIONS = 1e-11, 10000


def main() -> None:
    """Solve all problems by all solvers."""
    given = np.load(sys.argv[1])
    sizes = given["count"]
    answers = {}
    for name, (code, solve) in SOLVERS.items():
        impulses, seconds = [], []
        matrix_at = row_at = contact_at = 0
        for count in sizes.tolist():
            rows = 3 * count
            matrix = given["delassus"][matrix_at : matrix_at + rows * rows].reshape(rows, rows)
            free = given["free"][row_at : row_at + rows].copy()
            friction = given["friction"][contact_at : contact_at + count].copy()
            matrix_at, row_at, contact_at = (
                matrix_at + rows * rows,
                row_at + rows,
                contact_at + count,
            )
            options = sn.SolverOptions(code)
            options.dparam[sn.SICONOS_DPARAM_TOL] = TOLERANCE
            options.iparam[sn.SICONOS_IPARAM_MAX_ITER] = ITERATIONS
            problem = sn.FrictionContactProblem(3, count, np.asfortranarray(matrix), free, friction)
            impulse, velocity = np.zeros(rows), np.zeros(rows)
            begin = time.perf_counter()
            solve(problem, impulse, velocity, options)
            seconds.append(time.perf_counter() - begin)
            impulses.append(impulse)
        answers[f"{name} impulse"] = np.concatenate(impulses)
        answers[f"{name} seconds"] = np.array(seconds)
    np.savez(sys.argv[2], **answers)


if __name__ == "__main__":
    main()
