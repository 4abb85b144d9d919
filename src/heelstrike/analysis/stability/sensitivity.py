"""The gait sensitivity norm: what persistent small disturbances do to a walk, in one number.

D. G. E. Hobbelen, M. Wisse, *A disturbance rejection measure for limit cycle walkers: the gait
sensitivity norm*, IEEE Transactions on Robotics 23(6), 2007. Near its limit cycle a walk is a
linear system from step to step, x⁺ = A x + B e, g = C x + D e, with errors x at touchdown,
disturbances e such as the height of the next foothold, and indicators g of how near it is to
falling, such as the duration of the step. The norm is that system's H2 norm: the root mean square
of g over that of white noise e, or the size of the whole response to one disturbance of size one.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from heelstrike.arguments import takes
from heelstrike.errors import SimulationError


@takes(SimulationError)
def gait_sensitivity_norm(A: ArrayLike, B: ArrayLike, C: ArrayLike, D: ArrayLike) -> float:
    """Gait sensitivity norm of a walk that is linearised from step to step.

    ‖∂g/∂e‖₂ = √(tr(BᵀX B + DᵀD)) with X = AᵀX A + CᵀC, which is √(Σₖ ‖response k steps later‖²).

    Parameters
    ----------
    A : (m, m) array
        Errors at the next touchdown of errors at this: ``hs.monodromy(...).reduced``.
    B : (m, k) or (m,) array
        The same of k disturbances.
    C : (l, m) or (m,) array
        l indicators of the step of errors at its beginning.
    D : (l, k) array or number
        The same of the disturbances in the step.

    Returns
    -------
    float
        The norm, in units of indicator over disturbance; infinite of a walk that is not stable.

    Raises
    ------
    SimulationError
        If shapes do not fit, or a number is not finite.

    Examples
    --------
    One error that halves in a step, disturbed and seen as it is: 1/√(1 − 1/4).

    >>> from heelstrike import gait_sensitivity_norm
    >>> round(gait_sensitivity_norm([[0.5]], [1.0], [1.0], 0.0), 6)
    1.154701
    """
    from scipy.linalg import solve_discrete_lyapunov

    state = np.atleast_2d(np.asarray(A, np.float64))
    m = len(state)
    given = np.asarray(B, np.float64)
    given = given.reshape(m, -1) if given.ndim < 2 and given.size == m else given
    seen, through = np.atleast_2d(np.asarray(C, np.float64)), np.atleast_2d(np.asarray(D, float))
    fits = state.shape == (m, m) and given.ndim == 2 and given.shape[0] == seen.shape[1] == m
    if not (fits and through.shape == (len(seen), given.shape[1])):
        raise SimulationError(
            f"A (m, m), B (m, k), C (l, m) and D (l, k) do not fit: got shapes {state.shape}, "
            f"{given.shape}, {seen.shape} and {through.shape}"
        )
    if not all(np.all(np.isfinite(each)) for each in (state, given, seen, through)):
        raise SimulationError("A, B, C and D must be of finite numbers")
    if np.abs(np.linalg.eigvals(state)).max(initial=0.0) >= 1.0:
        return float("inf")
    gramian = solve_discrete_lyapunov(state.T, seen.T @ seen)
    total = np.trace(given.T @ gramian @ given) + np.trace(through.T @ through)
    return float(np.sqrt(total))
