"""The memory of the contact solvers, allocated once and reused by every solve."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from heelstrike.compiler.bundle import Bundle, array
from heelstrike.contact.solvers.elimination import LARGEST, elimination_programs

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

# Places in ``ContactWorkspace.counters``. The first three describe the last solve, the others
# accumulate over all solves until the caller clears them.
ITERATIONS = 0
SUCCEEDED = 1
LAST_FALLBACKS = 2
SOLVES = 3
FALLBACKS = 4
FAILURES = 5
SHORTCUTS = 6
COUNTERS = 8

# Places in row ``SETTINGS`` of ``ContactWorkspace.vectors``.
TOLERANCE = 0
SKEWED = 1
FLOOR = 2
ROUNDING = 3  # written by the certificate: what rounding may hide from it
EFFORT = 4  # written by the certificate: the velocities that cancel, in units of the data's
UNIT = 5  # written by the certificate: the size of the data
REST = 6  # written by the certificate: velocities below this times ``ROOT`` count as zero

# Rows of ``ContactWorkspace.labels``, by what they are indexed with.
NORMAL = 0  # contact: its normal unknown
TANGENT = 1  # contact: its tangential unknown, -1 for none
PRESCRIBED = 2  # contact: the mode the caller prescribes, OPEN for none
TRIAL_MODE = 3  # contact: the mode under trial
SOURCE = 4  # unknown: its row in the original data
EQUATION = 5  # equation of the trial: the unknown it belongs to
PIVOT_ROW = 6  # equation: the tableau row that holds its unknown, -1 for none
ROW_LABEL = 7  # tableau row: the variable it holds
COLUMN_LABEL = 8  # tableau column: the variable it holds
PLACE = 9  # variable: its row, or minus its column
ORDER = 10  # place in the elimination: the equation that has it
SPAN = 11  # the same: how many columns its row of the factor has
BASE_MODE = 12  # contact: the mode in the combination that is varied
LABELS = 13

# Rows of ``ContactWorkspace.vectors``, by what they are indexed with.
CONE = 0  # contact: friction coefficient of the scaled problem
SLOPE = 1  # contact: tangential over normal impulse where sliding is prescribed, else zero
SCALE = 2  # unknown: impulse per unit of it
OFFSET = 3  # unknown: scaled free velocity
LEAN = 4  # equation: tangential over normal impulse at a slipping contact, else zero
WEIGHT = 5  # equation: length of the impulse per unit of its unknown
POINT = 6  # equation: its unknown, in units of impulse
IMPULSE = 7  # row of the data: the impulse under trial
VELOCITY = 8  # row of the data: the velocity it gives
RESIDUAL = 9  # the three residuals of the trial
ITERATE = 10  # unknown: iterate of an iterative solver
STEP = 11  # unknown or equation: a correction
SPEED = 12  # unknown or equation: scaled velocity
EQUATIONS = 13  # unknown: what the iterate leaves of the equations
PROGRESS = 14  # an iterative solver's own numbers
ROOT = 15  # row of the data: root of its diagonal, velocity per unit of scaled impulse
SETTINGS = 16  # TOLERANCE and SKEWED, which the caller may choose, and what goes with them
SHARERS = 17  # equation: how many rows share it
BEFORE = 18  # equation: its unknown before the last refinement
VECTORS = 19

REST_TOLERANCE = 1e-10
"""Velocities below this, relative to the data and to what cancels in them, count as zero."""

# Matrices of ``ContactWorkspace.squares``.
MATRIX = 0  # the scaled problem
BASIS = 1  # free directions of the equations, one a row
EDGES = 2  # cone edges in terms of the basis; velocities that the basis causes
DUAL = 3  # dictionary of the least-norm split
SQUARES = 4


class ContactWorkspace(Bundle):
    """Buffers of the contact kernels for up to ``capacity`` contacts (d = 2).

    Attributes
    ----------
    counters : (8,) int64
        ``ITERATIONS``, ``SUCCEEDED`` (solver code) and ``LAST_FALLBACKS`` of the last solve;
        ``SOLVES``, ``FALLBACKS``, ``FAILURES`` and ``SHORTCUTS`` (solves answered by the
        warm-started modes) accumulated over all solves. The names are module constants.
    labels, vectors, squares : int64, float64, float64
        Lists and matrices of the solvers; the module's constants name them. Row ``SETTINGS`` of
        ``vectors`` is the caller's: ``TOLERANCE`` is the largest residual that is certified,
        1e-9 unless changed; ``SKEWED`` is not zero if the matrix may be asymmetric, as in a
        general complementarity problem; ``FLOOR`` is the smallest size of the data that
        residuals are set against, zero unless changed.
    tableau : float64
        The dictionary that is pivoted.
    solvers : (1,) int64
        Address of the machine code that tries the solvers in turn, shared by all workspaces.
    eliminations : (any,) int64
        Addresses of the programs that solve small systems, by size; zero where there is none.
    lower_half : float64
        The matrix of a small system.
    """

    counters: Integers = array("counters", of=int)
    labels: Integers = array("labels", "places", of=int)
    vectors: Floats = array("vectors", "entries")
    squares: Floats = array("squares", "unknowns", "width")
    tableau: Floats = array("pairs", "pairs + 2")
    solvers: Integers = array(1, of=int, address=True)
    eliminations: Integers = array("sizes", of=int, address=True)
    lower_half: Floats = array("half")


def allocate_contact_workspace(capacity: int, solvers: Integers) -> ContactWorkspace:
    """Allocate the buffers; see :func:`~heelstrike.contact.solvers.search.contact_workspace`."""
    contacts = max(int(capacity), 1)
    unknowns = 2 * contacts
    pairs = 4 * contacts
    vectors = np.zeros((VECTORS, max(unknowns, 8)))
    vectors[SETTINGS, TOLERANCE] = 1e-9
    return ContactWorkspace(
        counters=np.zeros(COUNTERS, np.int64),
        labels=np.zeros((LABELS, 2 * pairs + 2), np.int64),
        vectors=vectors,
        squares=np.zeros((SQUARES, unknowns, unknowns + 2)),
        tableau=np.zeros((pairs, pairs + 2)),
        solvers=solvers,
        eliminations=elimination_programs(),
        lower_half=np.zeros(LARGEST * (LARGEST + 1) // 2),
    )
