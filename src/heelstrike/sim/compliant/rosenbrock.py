"""A linearly implicit method of third order that forgives an approximate Jacobian.

A Rosenbrock method solves one linear system a stage, always with the same matrix, where an implicit
Runge-Kutta method iterates. A W-method keeps its order whatever stands in for the Jacobian: here
the contact forces and the joints' own springs and dampers, everything that can be stiff, and
nothing else. The coefficients are those of ROS34PW2 of J. Rang and L. Angermann, "New Rosenbrock
W-methods of order 3 for partial differential algebraic equations of index 1", *BIT Numerical
Mathematics* 45 (2005): four stages, order 3, embedded order 2, L-stable, stiffly accurate.

For y' = f(y) and W ≈ ∂f/∂y the stages u_i of a step h are::

    (1 / (γ h) − W) u_i = f(y + Σ_{j<i} a_ij u_j) + Σ_{j<i} c_ij u_j / h
    y⁺ = y + Σ m_i u_i          error ≈ Σ e_i u_i
"""

from __future__ import annotations

import numpy as np

STAGES = 4
ORDER = 3

GAMMA = 0.43586652150845900

# The method as its authors write it: α_ij, γ_ij (with γ on the diagonal), weights of order 3 and 2.
ALPHA = np.array(
    [
        [0.0, 0.0, 0.0, 0.0],
        [0.87173304301691801, 0.0, 0.0, 0.0],
        [0.84457060015369423, -0.11299064236484185, 0.0, 0.0],
        [0.0, 0.0, 1.0, 0.0],
    ]
)
GAMMAS = np.array(
    [
        [GAMMA, 0.0, 0.0, 0.0],
        [-0.87173304301691801, GAMMA, 0.0, 0.0],
        [-0.90338057013044082, 0.054180672388095326, GAMMA, 0.0],
        [0.24212380706095346, -1.2232505839045147, 0.54526025533510214, GAMMA],
    ]
)
WEIGHTS = np.array([0.24212380706095346, -1.2232505839045147, 1.5452602553351020, GAMMA])
EMBEDDED = np.array([0.37810903145819369, -0.096042292212423178, 0.5, 0.21793326075422950])

# The same in the form above, which needs no product with W.
_INVERSE = np.linalg.inv(GAMMAS)
A = np.ascontiguousarray(ALPHA @ _INVERSE)
C = np.ascontiguousarray(np.diag(1.0 / np.diag(GAMMAS)) - _INVERSE)
M = np.ascontiguousarray(WEIGHTS @ _INVERSE)
E = np.ascontiguousarray((WEIGHTS - EMBEDDED) @ _INVERSE)

# Times of the stages, as parts of the step.
TIMES = np.ascontiguousarray(ALPHA.sum(axis=1))
