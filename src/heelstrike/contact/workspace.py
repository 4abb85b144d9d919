"""The contact problem, its answer, and the memory of the solvers, reused by every solve.

Rows of a problem go contact by contact, normal before tangent: n0 t0 n1 t1 ... Of these the solvers
make *unknowns*, the rows that can carry an impulse, scaled; and for given modes *equations*, the
unknowns whose velocity vanishes.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from heelstrike.compiler.bundle import Bundle, array, cell, part

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


class ContactProblem(Bundle):
    """A contact problem of up to nc contacts.

    Attributes
    ----------
    count : int
        Number of contacts; the leading blocks of the arrays are used.
    delassus : (2 nc, 2 nc) float
        Delassus matrix, symmetric.
    free : (2 nc,) float
        Free velocity (or acceleration), the free term b.
    friction : (nc,) float
        Friction coefficient of each contact: 1 for an interval, zero for lines and half-lines.
    bound : (nc,) float
        Largest tangential impulse of each interval.
    set : (nc,) int
        Where its impulses may lie; see :mod:`heelstrike.contact.sets`.
    """

    count: int = cell(int)
    delassus: Floats = array("2 nc", "2 nc")
    free: Floats = array("2 nc")
    friction: Floats = array("nc")
    bound: Floats = array("nc")
    set: Integers = array("nc", of=int)


class ContactAnswer(Bundle):
    """What contacts do, and the impulses that make them.

    Attributes
    ----------
    mode : (nc,) int
        Contact modes.
    impulse, velocity : (2 nc,) float
    residual : (3,) float
        Complementarity, cone and penetration, relative (see ``Certificate``).
    rest : float
        Velocities below this times the yardstick's ``root`` count as zero.
    """

    mode: Integers = array("nc", of=int)
    impulse: Floats = array("2 nc")
    velocity: Floats = array("2 nc")
    residual: Floats = array(3)
    rest: float = cell(float)


class Settings(Bundle):
    """What the caller may choose.

    Attributes
    ----------
    tolerance : float
        Largest residual that is certified, 1e-9 unless changed.
    floor : float
        Smallest size of the data that residuals are set against, zero unless changed.
    amendments : int
        How often the modes of the answer are amended before a solver is asked; zero where they are
        no guess.
    patient : int
        Not zero if an answer that is certified, and not clean, is compared with those of all
        solvers, as where contacts jam, and one that is a little sharper is quite another.
    skewed : int
        Not zero if the matrix may be asymmetric, as in a general complementarity problem.
    """

    tolerance: float = cell(float)
    floor: float = cell(float)
    amendments: int = cell(int)
    patient: int = cell(int)
    skewed: int = cell(int)


class Tally(Bundle):
    """Counts: the first three of the last solve, the others of all until the caller clears them.

    Attributes
    ----------
    iterations, solver, last_fallbacks : int
        Iterations of all solvers; code of the one that succeeded; how many failed before it.
    solves, shortcuts, fallbacks, failures, combinations, relaxed : int
        ``shortcuts`` are the solves answered by the modes that were guessed; ``combinations`` those
        that went on to the last resort; ``relaxed`` those that ask for less than a problem without
        a solution did, which the caller counts.
    """

    iterations: int = cell(int)
    solver: int = cell(int)
    last_fallbacks: int = cell(int)
    solves: int = cell(int)
    shortcuts: int = cell(int)
    fallbacks: int = cell(int)
    failures: int = cell(int)
    combinations: int = cell(int)
    relaxed: int = cell(int)


class Yardstick(Bundle):
    """What a certificate measures with, and found out about rounding.

    Attributes
    ----------
    slope : (nc,) float
        Tangential over normal impulse where sliding is prescribed, else zero.
    root : (2 nc,) float
        Root of the diagonal of each row: velocity per unit of scaled impulse.
    unit : float
        Size of the data.
    effort : float
        The velocities that cancel, in units of the data's.
    rounding : float
        What rounding may hide from it.
    """

    slope: Floats = array("nc")
    root: Floats = array("2 nc")
    unit: float = cell(float)
    effort: float = cell(float)
    rounding: float = cell(float)


class StickingRows(Bundle):
    """The rows that shall have no velocity, where all contacts stick or are open.

    Attributes
    ----------
    row : (2 nc,) int
        Row of the problem of each equation.
    equation : (2 nc,) int
        Equation of each row of the problem, -1 for none.
    sharers : (2 nc,) float
        How many rows share each equation.
    pulled : (nc,) int
        Whether each contact would have pulled in an attempt before.
    x, pivot : (2 nc,) float
        Solution; pivots, and a right side.
    order : (2 nc,) int
        The equation that has each place in the elimination.
    span : (2 nc,) int
        How many columns the row of the factor in each place has.
    factor, square : (2 nc, 2 nc) float
    lower_half : (any,) float
        Matrix of a small system.
    spare : (2 nc,) float
        Solution in the order of the elimination.
    programs : (any,) int
        Addresses of the programs that solve small systems, by size; zero where there is none.
    """

    row: Integers = array("2 nc", of=int)
    equation: Integers = array("2 nc", of=int)
    sharers: Floats = array("2 nc")
    pulled: Integers = array("nc", of=int)
    x: Floats = array("2 nc")
    pivot: Floats = array("2 nc")
    order: Integers = array("2 nc", of=int)
    span: Integers = array("2 nc", of=int)
    factor: Floats = array("2 nc", "2 nc")
    square: Floats = array("2 nc", "2 nc")
    lower_half: Floats = array("half")
    spare: Floats = array("2 nc")
    programs: Integers = array("sizes", of=int, address=True)


class ReducedProblem(Bundle):
    """The scaled problem that the solvers work on.

    Attributes
    ----------
    unknowns : int
    normal, tangent : (nc,) int
        Unknowns of each contact; the tangential one is -1 where there is none.
    prescribed : (nc,) int
        The mode the caller prescribes, ``OPEN`` for none.
    set : (nc,) int
        Where the impulses of each contact may lie.
    cone : (nc,) float
        Friction coefficient of the scaled problem.
    source : (2 nc,) int
        Row of the problem of each unknown.
    scale, offset : (2 nc,) float
        Impulse per unit of each unknown; scaled free velocity.
    matrix : (2 nc, 2 nc) float
    """

    unknowns: int = cell(int)
    normal: Integers = array("nc", of=int)
    tangent: Integers = array("nc", of=int)
    prescribed: Integers = array("nc", of=int)
    set: Integers = array("nc", of=int)
    cone: Floats = array("nc")
    source: Integers = array("2 nc", of=int)
    scale: Floats = array("2 nc")
    offset: Floats = array("2 nc")
    matrix: Floats = array("2 nc", "2 nc")


class Dictionary(Bundle):
    """Basic variables in terms of the others, with whose names go to and fro.

    Attributes
    ----------
    status : int
        How the last pivots on it ended.
    tableau : (pairs, pairs + 2) float
        Constant and coefficients of each basic variable.
    row_label, column_label : (pairs,), (pairs + 2,) int
        The variable that each row and column holds.
    place : (2 pairs + 1,) int
        Row of each variable, or minus its column.
    """

    status: int = cell(int)
    tableau: Floats = array("pairs", "pairs + 2")
    row_label: Integers = array("pairs", of=int)
    column_label: Integers = array("pairs + 2", of=int)
    place: Integers = array("2 pairs + 1", of=int)


class Equations(Bundle):
    """The equations of the modes under trial, their solution, and along what it is free.

    Attributes
    ----------
    size : int
        Number of equations.
    unknown : (2 nc,) int
        The unknown that each belongs to.
    lean : (2 nc,) float
        Tangential over normal impulse at a slipping contact, else zero.
    weight : (2 nc,) float
        Length of the impulse per unit of its unknown.
    point, before : (2 nc,) float
        Its unknown, in units of impulse; the same before the last refinement.
    tableau : (2 nc, 2 nc + 1) float
        Constant and coefficients, which elimination turns into the solution.
    pivot_row : (2 nc,) int
        The row that holds the unknown of each equation, -1 for none: it is free.
    taken : (2 nc,) int
        Whether each row has been pivoted on.
    basis : (2 nc, 2 nc) float
        Free directions, one a row.
    moves : (2 nc,) int
        Whether each free direction changes a velocity.
    image : (2 nc, 2 nc) float
        The velocities it causes.
    edge : (2 nc, 2 nc + 2) float
        Edges of the cones in terms of the free directions.
    step : (2 nc,) float
        A step along them; also scaled velocities.
    dual : Dictionary
        Of the least-norm split.
    """

    size: int = cell(int)
    unknown: Integers = array("2 nc", of=int)
    lean: Floats = array("2 nc")
    weight: Floats = array("2 nc")
    point: Floats = array("2 nc")
    before: Floats = array("2 nc")
    tableau: Floats = array("2 nc", "2 nc + 1")
    pivot_row: Integers = array("2 nc", of=int)
    taken: Integers = array("2 nc", of=int)
    basis: Floats = array("2 nc", "2 nc")
    moves: Integers = array("2 nc", of=int)
    image: Floats = array("2 nc", "2 nc")
    edge: Floats = array("2 nc", "2 nc + 2")
    step: Floats = array("2 nc")
    dual: Dictionary = part(Dictionary)


class Iteration(Bundle):
    """An iterate of the reduced problem.

    Attributes
    ----------
    number : int
        Iterations so far.
    x, speed : (2 nc,) float
        Unknowns and their scaled velocities.
    value, slope : (2 nc,), (2 nc, 2 nc) float
        What is left of the equations, and their Jacobian.
    step, square : (2 nc,), (2 nc, 2 nc) float
        Newton's step, and the matrix it is solved with.
    """

    number: int = cell(int)
    x: Floats = array("2 nc")
    speed: Floats = array("2 nc")
    value: Floats = array("2 nc")
    slope: Floats = array("2 nc", "2 nc")
    step: Floats = array("2 nc")
    square: Floats = array("2 nc", "2 nc")


class Combinations(Bundle):
    """How far the combinations of modes have been tried.

    Attributes
    ----------
    base : (nc,) int
        Modes of the combination that is varied.
    place : int
        Number of the next combination, or of the next change of the base.
    tried, starts : int
        Combinations tried; bases started from.
    least : float
        Residual of the base.
    """

    base: Integers = array("nc", of=int)
    place: int = cell(int)
    tried: int = cell(int)
    starts: int = cell(int)
    least: float = cell(float)


class ContactWorkspace(Bundle):
    """Buffers of the contact kernels for up to nc contacts (d = 2).

    Attributes
    ----------
    settings, tally : Settings, Tally
        What the caller may choose and read.
    yardstick, sticking, reduced, equations, lemke, iteration, combinations
        Memory of the certificate and of each way to solve.
    trial : ContactAnswer
        Modes under trial, and their answer.
    solvers : (1,) int64
        Address of the machine code that tries the solvers in turn, shared by all workspaces.
    """

    settings: Settings = part(Settings)
    tally: Tally = part(Tally)
    yardstick: Yardstick = part(Yardstick)
    sticking: StickingRows = part(StickingRows)
    reduced: ReducedProblem = part(ReducedProblem)
    equations: Equations = part(Equations)
    lemke: Dictionary = part(Dictionary)
    iteration: Iteration = part(Iteration)
    combinations: Combinations = part(Combinations)
    trial: ContactAnswer = part(ContactAnswer)
    solvers: Integers = array(1, of=int, address=True)
