"""Partial derivatives of the equations of a motion under contact, for implicit differentiation.

A motion with the acceleration a under given forces p of contact points and l of loops lacks the
generalised force

    r(q, v, a, p, l) = A a + H − passive − Jᵀ p − Lᵀ l

but for that of its motors, and under a velocity (or acceleration) x the points and loops go at

    s(q, v, x) = J x + t J̇ v,   with L the same.

Whatever a method solves - accelerations under contact with x = a and t = 1, velocities at the end
of a step with t = 0, and h/2 for its loops - is made of r and s; so are its derivatives, with those
of r and s at fixed a, p, l, x. The tape of the kernel is differentiated
(:mod:`heelstrike.compiler.recordings.tangents`) and compiled once for a robot's structure.
"""

from __future__ import annotations

import threading
from collections.abc import Sequence
from typing import Any
from weakref import WeakKeyDictionary, ref

import numpy as np

from heelstrike.compiler.bundle import Bundle, array
from heelstrike.compiler.compilation import kernel
from heelstrike.compiler.recordings.recording import Program, is_structural
from heelstrike.compiler.straight_line import play, straight_line_code
from heelstrike.compiler.words import copy_words
from heelstrike.contact.workspace import Floats
from heelstrike.dynamics.frames import into_frame
from heelstrike.dynamics.kernels import (
    factorize,
    forward_kinematics,
    inverse_dynamics,
    link_velocities,
    mass_matrix,
    passive_force,
    point_position,
)
from heelstrike.dynamics.loops import LoopRows, count_rows, find_rows
from heelstrike.dynamics.places import bias_at, place_of, write_point_rows
from heelstrike.dynamics.workspace import Workspace
from heelstrike.errors import SimulationError
from heelstrike.robot.model import Integers, Model

DYNAMIC = (
    "mass", "inertia", "center_of_mass", "armature", "damping", "stiffness", "rest", "gravity"
)  # fmt: skip
"""Numbers of a robot that say how heavy, stiff or damped it is: they are in r alone."""


FRICTION = "friction"
"""The ground's coefficient."""


class Balance(Bundle):
    """A motion under forces, and what is found of it."""

    q: Floats = array("nq")
    v: Floats = array("nv")
    acceleration: Floats = array("nv")
    """q, v, acceleration: The motion."""
    going: Floats = array("nv")
    """The velocity or acceleration x of the points and loops that are looked at."""
    ahead: Floats = array(2)
    """The time t of points, and of loops."""
    normal: Floats = array("nc", "components")
    """Of the ground at every contact point, in world axes; it stays."""
    push: Floats = array("nc", "components")
    pull: Floats = array("loop_rows")
    """push, pull: Forces of contact points (normal, tangent) and of loops."""
    added: Floats = array("nv")
    """What is added to the diagonal of the mass matrix."""
    point: Floats = array("nc", "components")
    """Where the contact points are."""
    matrix: Floats = array("nv", "nv")
    factor: Floats = array("nv", "nv")
    """matrix, factor: The mass matrix, with what is added, and its factor."""
    passive: Floats = array("nv")
    """Force of springs and dampers; scratch."""
    lacking: Floats = array("nv")
    """The force r."""
    rows: Floats = array("2 nc", "nv")
    """Jacobian of the contact points (normal, tangent)."""
    along: Floats = array("2 nc")
    loop_along: Floats = array("loop_rows")
    """along, loop_along: The s of points and loops."""


class Partials(Bundle):
    """Derivatives of r and s, which leave all else as it is."""

    lacking_by_q: Floats = array("nv", "nq")
    lacking_by_v: Floats = array("nv", "nv")
    along_by_q: Floats = array("2 nc", "nq")
    along_by_v: Floats = array("2 nc", "nv")
    loop_along_by_q: Floats = array("loop_rows", "nq")
    loop_along_by_v: Floats = array("loop_rows", "nv")
    """By position and velocity."""
    lacking_by_numbers: Floats = array("nv", "numbers")
    """By numbers of the robot."""


class PartialsAlong(Bundle):
    """Motions under forces at many instants, and what is found of them, as of one of them."""

    q: Floats = array("samples", "nq")
    v: Floats = array("samples", "nv")
    acceleration: Floats = array("samples", "nv")
    push: Floats = array("samples", "nc", "components")
    """q, v, acceleration, push: The motions, whose points are looked at as they accelerate."""
    along: Floats = array("samples", "2 nc")
    along_by_q: Floats = array("samples", "2 nc", "nq")
    along_by_v: Floats = array("samples", "2 nc", "nv")
    """along, along_by_q, along_by_v: Accelerations of the contact points (normal, tangent), and
    their derivatives."""
    rows: Floats = array("samples", "2 nc", "nv")
    """Jacobians of the contact points."""
    matrix: Floats = array("samples", "nv", "nv")
    """Mass matrices."""
    lacking_by_q: Floats = array("samples", "nv", "nq")
    lacking_by_v: Floats = array("samples", "nv", "nv")
    lacking_by_numbers: Floats = array("samples", "nv", "numbers")
    """Derivatives of the lacking forces."""


@kernel
def find_balance(
    model: Model, dated: Integers, tree: Workspace, loops: LoopRows, balance: Balance
) -> None:
    """Write what a motion lacks and how its points and loops go, with its Jacobians and factor.

    Where ``dated[0]`` is zero, J̇ v is left out.
    """
    forward_kinematics(model, balance.q, tree)
    link_velocities(model, balance.v, tree)
    mass_matrix(model, tree, balance.matrix)
    for i in range(model.nv):
        balance.matrix[i, i] += balance.added[i]
    factorize(model, balance.matrix, balance.factor)
    inverse_dynamics(model, balance.acceleration, tree, balance.lacking)
    passive_force(model, balance.q, balance.v, balance.passive)
    for i in range(model.nv):
        balance.lacking[i] -= balance.passive[i]
    for contact in range(model.nc):
        balance_point(model, dated, tree, contact, balance)
    if loops.bias.shape[0] > 0:
        find_rows(model, balance.q, balance.v, tree, loops)
        for row in range(loops.bias.shape[0]):
            balance.loop_along[row] = balance.ahead[1] * loops.bias[row]
            for j in range(model.nv):
                balance.loop_along[row] += loops.jacobian[row, j] * balance.going[j]
                balance.lacking[j] -= loops.jacobian[row, j] * balance.pull[row]


@kernel
def balance_point(
    model: Model, dated: Integers, tree: Workspace, contact: int, balance: Balance
) -> None:
    """Add what the force on a contact point does, and write how the point goes.

    A disc touches where its normal says, and turns about its centre.
    """
    link, first = model.contact_link[contact], 2 * contact
    point, normal, rows = balance.point[contact], balance.normal[contact], balance.rows
    point_position(tree, link, model.contact_position[contact], point)
    bias = 0.0, 0.0
    if dated[0] == 1:
        bias = into_frame(normal, bias_at(tree, link, place_of(tree, point)))
    for axis in range(2):
        point[axis] -= model.contact_radius[contact] * normal[axis]
    write_point_rows(model, tree, link, point, normal, first, rows)
    for k in range(2):
        balance.along[first + k] = balance.ahead[0] * bias[k]
        for j in range(model.nv):
            balance.along[first + k] += rows[first + k, j] * balance.going[j]
            balance.lacking[j] -= rows[first + k, j] * balance.push[contact, k]


def allocate_balance(model: Model, numbers: Sequence[str] = ()) -> tuple[Balance, Partials]:
    """Allocate a motion and its derivatives, those by some `numbers` of the robot too."""
    extents = {
        **model.extents, "components": 2, "loop_rows": count_rows(model),
        "numbers": sum(getattr(model, name).size for name in numbers),
    }  # fmt: skip
    return Balance.allocate(extents), Partials.allocate(extents)


def allocate_along(model: Model, samples: int, numbers: Sequence[str] = ()) -> PartialsAlong:
    """Allocate motions at many instants, and what is found of them."""
    size = sum(getattr(model, name).size for name in numbers)
    extents = {**model.extents, "components": 2, "numbers": size, "samples": samples}
    return PartialsAlong.allocate(extents)


class MadeFor:
    """Zeros and ones of a robot's model, which code is made for: it is wrong where they are others.

    Parameters
    ----------
    model : Model
        The model.
    numbers : tuple of str
        Numbers by which the code differentiates, which it is not made for.
    """

    def __init__(self, model: Model, numbers: tuple[str, ...]) -> None:
        floats = ((name, each) for name, each in model.storage() if each.dtype == np.float64)
        self._kept = [
            (name, each, chosen, each[chosen])
            for name, each in floats
            if name not in numbers and (chosen := is_structural(each)).any()
        ]

    @property
    def changed(self) -> str:
        """Name of a number that has become another one; nothing if there is none."""
        for name, numbers, chosen, before in self._kept:
            if not (numbers[chosen] == before).all():
                return name
        return ""


_known: WeakKeyDictionary[Model, dict[tuple[bool, tuple[str, ...]], tuple[MadeFor, int]]] = (
    WeakKeyDictionary()
)


def partial_program(model: Model, *, dated: bool, numbers: tuple[str, ...] = ()) -> int:
    """Return the address of code that finds a balance and its partial derivatives.

    :func:`~heelstrike.compiler.straight_line.play` calls it with the arguments of
    :func:`find_balance` and :class:`Partials`.

    Parameters
    ----------
    model : Model
        The robot. Those of the same structure share the code.
    dated : bool
        Whether J̇ v of contact points is wanted.
    numbers : tuple of str
        Of `DYNAMIC`, by which r is differentiated.
    """
    programs = _known.setdefault(model, {})
    made_for, program = programs.get((dated, numbers), (None, 0))
    if made_for is None or made_for.changed:
        made_for, program = MadeFor(model, numbers), _compiled(model, dated, numbers)
        programs[dated, numbers] = made_for, program
    return program


def _compiled(model: Model, dated: bool, numbers: tuple[str, ...]) -> int:
    balance, partials = allocate_balance(model, numbers)
    tree = Workspace.allocate({**model.extents, "components": 2})
    names = ["lacking"]
    names += ["along"] if model.nc else []
    names += ["loop_along"] if count_rows(model) else []
    derivatives: dict[str, tuple[str, tuple[str, ...]]] = {
        f"partials.{name}_by_{x}": (f"balance.{name}", (f"balance.{x}",))
        for name in names
        for x in "qv"
    }
    if numbers:
        by = tuple(f"model.{name}" for name in numbers)
        derivatives["partials.lacking_by_numbers"] = "balance.lacking", by
    hidden = ("balance.passive", "balance.point", *(f"tree.{n}" for n in tree.members()))
    program = Program(
        find_balance,
        {
            "model": model, "dated": np.array([int(dated)]), "tree": tree,
            "loops": LoopRows.allocate(nv=model.nv, loop_rows=count_rows(model)),
            "balance": balance, "partials": partials,
        },
        scratch=hidden,
        derivatives=derivatives,
    )  # fmt: skip
    (address,) = straight_line_code([program], known={"tree.zero": np.zeros(model.nv)})
    return address


@kernel
def find_partials(
    model: Model, program: int, dated: Integers, tree: Workspace, loops: LoopRows,
    balance: Balance, partials: Partials,
) -> None:  # fmt: skip
    """Find a balance and its partial derivatives."""
    play(program, (model, dated, tree, loops, balance, partials))


@kernel
def find_partials_along(
    model: Model, program: int, dated: Integers, tree: Workspace, loops: LoopRows,
    balance: Balance, partials: Partials, found: PartialsAlong,
) -> None:  # fmt: skip
    """Find partial derivatives at many instants."""
    for i in range(found.q.shape[0]):
        copy_words(found.q[i], balance.q)
        copy_words(found.v[i], balance.v)
        copy_words(found.acceleration[i], balance.acceleration)
        copy_words(found.acceleration[i], balance.going)
        copy_words(found.push[i], balance.push)
        find_partials(model, program, dated, tree, loops, balance, partials)
        copy_words(balance.along, found.along[i])
        copy_words(balance.rows, found.rows[i])
        copy_words(balance.matrix, found.matrix[i])
        copy_words(partials.along_by_q, found.along_by_q[i])
        copy_words(partials.along_by_v, found.along_by_v[i])
        copy_words(partials.lacking_by_q, found.lacking_by_q[i])
        copy_words(partials.lacking_by_v, found.lacking_by_v[i])
        copy_words(partials.lacking_by_numbers, found.lacking_by_numbers[i])


class Differentiated:
    """The equations of a robot, differentiated wherever they are looked at.

    Parameters
    ----------
    model : Model
        The robot.
    numbers : tuple of str
        Of `DYNAMIC`, by which r is differentiated too.

    Notes
    -----
    Code is made for what is 0, 1 or -1 in the model. Other numbers may be written into it at any
    time; looks refuse a model in which one of these has become another.
    """

    def __init__(self, model: Model, numbers: tuple[str, ...] = ()) -> None:
        self._model, self.made_for = ref(model), MadeFor(model, numbers)
        self._program = partial_program(model, dated=True, numbers=numbers)
        self.balance, self.partials = allocate_balance(model, numbers)
        self._tree = Workspace.allocate({**model.extents, "components": 2})
        self.loops = LoopRows.allocate(nv=model.nv, loop_rows=count_rows(model))
        self._dated = np.array([1])

    def place(self, q: Floats, v: Floats, normal: Any) -> None:
        """Put the robot into a state, with a normal (2,) of the ground under all its points."""
        self.balance.q[:], self.balance.v[:], self.balance.normal[:] = q, v, normal

    def look(
        self, *, ahead: float, going: Floats | float = 0.0, acceleration: Floats | float = 0.0,
        push: Floats | float = 0.0, pull: Floats | float = 0.0,
    ) -> None:  # fmt: skip
        """Find r, s and their derivatives, of a motion under forces; see the module.

        Raises
        ------
        SimulationError
            If the model is another one than code was made for.
        """
        self._check()
        balance = self.balance
        balance.ahead[:], balance.going[:], balance.acceleration[:] = ahead, going, acceleration
        balance.push[:], balance.pull[:] = push, pull
        model: Any = self._model()
        find_partials(
            model, self._program, self._dated, self._tree, self.loops, balance,
            self.partials,
        )  # fmt: skip

    def look_along(self, found: PartialsAlong, normal: Any) -> None:
        """Find derivatives at many instants, with one normal (2,) of the ground; see there.

        Raises
        ------
        SimulationError
            If the model is another one than code was made for.
        """
        self._check()
        self.balance.normal[:], self.balance.ahead[:], self.balance.pull[:] = normal, 1.0, 0.0
        model: Any = self._model()
        find_partials_along(
            model, self._program, self._dated, self._tree, self.loops, self.balance,
            self.partials, found,
        )  # fmt: skip

    def _check(self) -> None:
        changed = self.made_for.changed
        if changed:
            raise SimulationError(
                f"some {changed} of the robot was 0, 1 or -1 when its equations were "
                "differentiated, and is another number now: the code is made for what it was. "
                "Differentiate the equations of the changed model again"
            )


_kept = threading.local()
"""Of each thread its own: what is found is there until the next look."""


def differentiated(model: Model, numbers: tuple[str, ...] = ()) -> Differentiated:
    """Return the equations of a robot, which are those that were returned before."""
    if not hasattr(_kept, "equations"):
        _kept.equations = WeakKeyDictionary()
    known = _kept.equations.setdefault(model, {})
    if numbers not in known or known[numbers].made_for.changed:
        known[numbers] = Differentiated(model, numbers)
    found: Differentiated = known[numbers]
    return found


def chosen_numbers(names: Sequence[str]) -> tuple[tuple[str, ...], bool]:
    """Tell numbers of the robot from the ground's friction, among names of both.

    Raises
    ------
    SimulationError
        If there is no such number, or one is named twice.
    """
    known = (*DYNAMIC, FRICTION)
    wrong = [name for name in names if name not in known]
    if wrong or len(set(names)) < len(names):
        raise SimulationError(
            f"derivatives exist with respect to {', '.join(known)}, each named once; got "
            f"{', '.join(names)}"
        )
    return tuple(name for name in names if name != FRICTION), FRICTION in names


def columns_of(model: Model, names: Sequence[str]) -> dict[str, slice]:
    """Return which columns are derivatives by which numbers: those of friction are last."""
    dynamic, rubs = chosen_numbers(names)
    sizes = [getattr(model, name).size for name in dynamic] + [1] * rubs
    ends = np.cumsum(sizes, dtype=int).tolist()
    named = [*dynamic, *([FRICTION] * rubs)]
    return {
        name: slice(end - size, end) for name, size, end in zip(named, sizes, ends, strict=True)
    }
