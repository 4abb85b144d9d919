"""The contact problem, its answer, and the memory of the solvers, reused by every solve.

Rows of a problem go contact by contact, normal before tangent: n0 t0 n1 t1 ... What has no friction
may do without a tangent, so that every contact tells its first row. Of the rows the solvers make
*unknowns*, those that can carry an impulse, scaled; and for given modes *equations*, the unknowns
whose velocity vanishes.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from heelstrike.compiler.bundle import Bundle, array, cell, part

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


PROGRAM_ROWS = 12
"""Rows and columns that a matrix has room for if straight-line code shall read it."""


class ContactProblem(Bundle):
    """A contact problem of up to `capacity` contacts."""

    count: int = cell(int)
    """Number of contacts; the leading blocks of the arrays are used."""
    first: Integers = array("capacity + 1", of=int)
    """Row that each contact begins with; after the last, how many rows there are."""
    delassus: Floats = array("room", "room")
    """Delassus matrix, symmetric; as a rule there is room for two rows of each contact."""
    free: Floats = array("2 capacity")
    """Free velocity (or acceleration), the free term b."""
    friction: Floats = array("capacity")
    """Friction coefficient of each contact: 1 for an interval, zero for lines and half-lines."""
    bound: Floats = array("capacity")
    """Largest tangential impulse of each interval."""
    set: Integers = array("capacity", of=int)
    """Where its impulses may lie; see :mod:`heelstrike.contact.sets`."""


def contact_problem(contacts: int, **given: Any) -> ContactProblem:
    """Allocate a problem of so many contacts, each with a normal and a tangent."""
    first = 2 * np.arange(contacts + 1)
    usual = {"capacity": contacts, "room": 2 * contacts, "first": first}
    return ContactProblem.allocate(**usual | given)


class ContactAnswer(Bundle):
    """What contacts do, and the impulses that make them."""

    mode: Integers = array("capacity", of=int)
    """Contact modes."""
    impulse: Floats = array("2 capacity")
    velocity: Floats = array("2 capacity")
    residual: Floats = array(3)
    """Complementarity, cone and penetration, relative (see ``Certificate``)."""
    rest: float = cell(float)
    """Velocities below this times the scaling's ``root`` count as zero."""


class Settings(Bundle):
    """What the caller may choose."""

    tolerance: float = cell(float)
    """Largest residual that is certified, 1e-9 unless changed."""
    floor: float = cell(float)
    """Smallest size of the data that residuals are set against, zero unless changed."""
    corrections: int = cell(int)
    """How often the modes of the answer are corrected before a solver is asked; zero where they are
    no guess."""
    patient: int = cell(int)
    """Not zero if an answer that is certified, and not clean, is compared with those of all
    solvers, as where contacts jam, and one that is a little sharper is quite another."""
    skewed: int = cell(int)
    """Not zero if the matrix may be asymmetric, as in a general complementarity problem."""


class Tally(Bundle):
    """Counts: the first three of the last solve, the others of all until the caller clears them."""

    iterations: int = cell(int)
    solver: int = cell(int)
    last_fallbacks: int = cell(int)
    """iterations, solver, last_fallbacks: Iterations of all solvers; code of the one that
    succeeded; how many failed before it."""
    solves: int = cell(int)
    shortcuts: int = cell(int)
    fallbacks: int = cell(int)
    failures: int = cell(int)
    combinations: int = cell(int)
    relaxed: int = cell(int)
    """solves, shortcuts, fallbacks, failures, combinations, relaxed: ``shortcuts`` are the solves
    answered by the modes that were guessed; ``combinations`` those that went on to the last resort;
    ``relaxed`` those that ask for less than a problem without a solution did, which the caller
    counts."""


class Scaling(Bundle):
    """What a certificate measures with, and found out about rounding."""

    slope: Floats = array("capacity")
    """Tangential over normal impulse where sliding is prescribed, else zero."""
    root: Floats = array("2 capacity")
    """Root of the diagonal of each row: velocity per unit of scaled impulse."""
    unit: float = cell(float)
    """Size of the data."""
    effort: float = cell(float)
    """The velocities that cancel, in units of the data's."""
    rounding: float = cell(float)
    """What rounding may hide from it."""
    size: Floats = array(4)
    """What the programs measure with; see :mod:`heelstrike.contact.cone_certificate`."""
    held: Floats = array("most_stops")
    """1 for the stops whose velocity counts among the fastest, 0 for the others."""
    programs: Integers = array("cones", "stops", of=int, address=True)
    """Addresses of the programs that certify few contacts and stops, by their numbers; zero where
    there is none."""


class StickingRows(Bundle):
    """The rows that shall have no velocity: of what presses, and of what sticks."""

    row: Integers = array("2 capacity", of=int)
    """Row of the problem of each equation."""
    equation: Integers = array("2 capacity", of=int)
    """Equation of each row of the problem, -1 for none."""
    sharers: Floats = array("2 capacity")
    """How many rows share each equation."""
    edge: Floats = array("2 capacity")
    """Tangential over normal impulse where the contact of an equation slips, else zero."""
    pulled: Integers = array("capacity", of=int)
    """Whether each contact would have pulled in an attempt before."""
    x: Floats = array("2 capacity")
    pivot: Floats = array("2 capacity")
    """x, pivot: Solution; pivots, and a right side."""
    order: Integers = array("2 capacity", of=int)
    """The equation that has each place in the elimination; rows that share friction."""
    span: Integers = array("2 capacity", of=int)
    """How many columns the row of the factor in each place has."""
    factor: Floats = array("2 capacity", "2 capacity")
    square: Floats = array("2 capacity", "2 capacity")
    lower_half: Floats = array("half")
    """Matrix of a small system."""
    spare: Floats = array("2 capacity")
    """Solution in the order of the elimination; diagonals; edges of cones."""
    programs: Integers = array("sizes", of=int, address=True)
    """Addresses of the programs that solve small systems, by size; zero where there is none."""
    margin: Floats = array(1)
    """The least that a pivot has above what makes it good."""
    standing: Integers = array("codes", "stops", of=int, address=True)
    """Addresses of the programs for contacts that all stick, by their code and the number of stops;
    zero where there is none."""


class ReducedProblem(Bundle):
    """The scaled problem that the solvers work on."""

    unknowns: int = cell(int)
    normal: Integers = array("capacity", of=int)
    tangent: Integers = array("capacity", of=int)
    """normal, tangent: Unknowns of each contact; the tangential one is -1 where there is none."""
    prescribed: Integers = array("capacity", of=int)
    """The mode the caller prescribes, ``OPEN`` for none."""
    set: Integers = array("capacity", of=int)
    """Where the impulses of each contact may lie."""
    cone: Floats = array("capacity")
    """Friction coefficient of the scaled problem."""
    source: Integers = array("2 capacity", of=int)
    """Row of the problem of each unknown."""
    scale: Floats = array("2 capacity")
    offset: Floats = array("2 capacity")
    """scale, offset: Impulse per unit of each unknown; scaled free velocity."""
    matrix: Floats = array("2 capacity", "2 capacity")


class Dictionary(Bundle):
    """Basic variables in terms of the others, with whose names go to and fro."""

    status: int = cell(int)
    """How the last pivots on it ended."""
    tableau: Floats = array("pairs", "pairs + 2")
    """Constant and coefficients of each basic variable."""
    row_label: Integers = array("pairs", of=int)
    column_label: Integers = array("pairs + 2", of=int)
    """row_label, column_label: The variable that each row and column holds."""
    place: Integers = array("2 pairs + 1", of=int)
    """Row of each variable, or minus its column."""


class Equations(Bundle):
    """The equations of the modes under trial, their solution, and along what it is free."""

    size: int = cell(int)
    """Number of equations."""
    unknown: Integers = array("2 capacity", of=int)
    """The unknown that each belongs to."""
    friction_ratio: Floats = array("2 capacity")
    """Tangential over normal impulse at a slipping contact, else zero."""
    weight: Floats = array("2 capacity")
    """Length of the impulse per unit of its unknown."""
    point: Floats = array("2 capacity")
    before: Floats = array("2 capacity")
    """point, before: Its unknown, in units of impulse; the same before the last refinement."""
    tableau: Floats = array("2 capacity", "2 capacity + 1")
    """Constant and coefficients, which elimination turns into the solution."""
    pivot_row: Integers = array("2 capacity", of=int)
    """The row that holds the unknown of each equation, -1 for none: it is free."""
    taken: Integers = array("2 capacity", of=int)
    """Whether each row has been pivoted on."""
    basis: Floats = array("2 capacity", "2 capacity")
    """Free directions, one a row."""
    moves: Integers = array("2 capacity", of=int)
    """Whether each free direction changes a velocity."""
    image: Floats = array("2 capacity", "2 capacity")
    """The velocities it causes."""
    edge: Floats = array("2 capacity", "2 capacity + 2")
    """Edges of the cones in terms of the free directions."""
    step: Floats = array("2 capacity")
    """A step along them; also scaled velocities."""
    dual: Dictionary = part(Dictionary)
    """Of the least-norm split."""


class Iteration(Bundle):
    """An iterate of the reduced problem."""

    number: int = cell(int)
    """Iterations so far."""
    x: Floats = array("2 capacity")
    speed: Floats = array("2 capacity")
    """x, speed: Unknowns and their scaled velocities."""
    value: Floats = array("2 capacity")
    slope: Floats = array("2 capacity", "2 capacity")
    """value, slope: What is left of the equations, and their Jacobian."""
    step: Floats = array("2 capacity")
    square: Floats = array("2 capacity", "2 capacity")
    """step, square: Newton's step, and the matrix it is solved with."""


class Combinations(Bundle):
    """How far the combinations of modes have been tried."""

    base: Integers = array("capacity", of=int)
    """Modes of the combination that is varied."""
    place: int = cell(int)
    """Number of the next combination, or of the next change of the base."""
    tried: int = cell(int)
    starts: int = cell(int)
    """tried, starts: Combinations tried; bases started from."""
    least: float = cell(float)
    """Residual of the base."""


class ContactWorkspace(Bundle):
    """Buffers of the contact kernels for up to `capacity` contacts (d = 2)."""

    settings: Settings = part(Settings)
    tally: Tally = part(Tally)
    """settings, tally: What the caller may choose and read."""
    scaling: Scaling = part(Scaling)
    sticking: StickingRows = part(StickingRows)
    reduced: ReducedProblem = part(ReducedProblem)
    equations: Equations = part(Equations)
    lemke: Dictionary = part(Dictionary)
    iteration: Iteration = part(Iteration)
    combinations: Combinations = part(Combinations)
    """scaling, sticking, reduced, equations, lemke, iteration, combinations: Memory of the
    certificate and of each way to solve."""
    trial: ContactAnswer = part(ContactAnswer)
    """Modes under trial, and their answer."""
    solvers: Integers = array(1, of=int, address=True)
    """Address of the machine code that tries the solvers in turn, shared by all workspaces."""
