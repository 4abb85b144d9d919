"""What is said of fields stands with them, once, and readers of docstrings find it."""

from __future__ import annotations

import ast
import dataclasses
import inspect
import re
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import heelstrike as hs
from heelstrike.compiler.bundle import Bundle, array, cell, extent, number
from heelstrike.field_texts import dataclass, described

Floats = NDArray[np.float64]
HOME = Path(hs.__file__).parent
STILL = (
    "analysis/stability", "control/balance/constrained.py", "control/gait_lqr", "sim/contacts",
    "sim/controller/stance.py", "sim/controller/tied.py", "sim/event_driven", "sim/memory.py",
    "sim/time_stepping",
)  # fmt: skip
"""Where classes still repeat their fields."""
SOURCES = [
    path for path in sorted(HOME.rglob("*.py"))
    if not path.relative_to(HOME).as_posix().startswith(STILL)
]  # fmt: skip


@dataclass(frozen=True)
class Limb:
    """A limb.

    It is attached to the trunk.

    Attributes
    ----------
    length : float
        Found by measuring.

    Raises
    ------
    ValueError
        Never.
    """

    name: str
    force: Floats
    """(n, 2) On the foot, in world axes,
    whoever asks (N)."""
    lower: float
    upper: float = 1.0
    """lower, upper: Range of the knee (rad)."""
    ends: Floats | None = None
    """(2,) Where it ends, (x, z)."""
    _hidden: int = 0
    """Of no interest."""

    @property
    def length(self) -> float:
        return 1.0


@dataclass(frozen=True, slots=True)
class Arm(Limb):
    """An arm."""

    hands: int = 1
    """How many."""


class Link(Bundle):
    """A link."""

    axes: int = extent()
    mass: float = number(float, unit="kg")
    """Its own."""
    place: Floats = array("axes", 2, unit="m", label="where it is")
    turns: int = cell(int, label="turns")
    """Counted from the start."""
    low: Floats = array("axes", unit="N")
    high: float = number(float, unit="N m")
    """low, high: Bounds."""


def test_a_docstring_is_composed_of_the_fields() -> None:
    assert inspect.getdoc(Limb) == (
        "A limb.\n\nIt is attached to the trunk.\n\nAttributes\n----------\n"
        "name : str\n"
        "force : (n, 2) float\n    On the foot, in world axes, whoever asks (N).\n"
        "lower, upper : float\n    Range of the knee (rad).\n"
        "ends : (2,) float or None\n    Where it ends, (x, z).\n"
        "length : float\n    Found by measuring.\n\n"
        "Raises\n------\nValueError\n    Never."
    )


def test_a_dataclass_is_what_the_standard_one_is() -> None:
    assert dataclasses.is_dataclass(Limb)
    assert [each.name for each in dataclasses.fields(Arm)][-1] == "hands"
    limb = Limb("leg", np.zeros((1, 2)), -1.0)
    assert dataclasses.replace(limb, lower=-2.0).lower == -2.0
    with pytest.raises(dataclasses.FrozenInstanceError):
        limb.lower = 0.0  # type: ignore[misc]


def test_fields_of_bases_come_first() -> None:
    names = [name for told in described(Arm) for name in told.names]
    assert names == ["name", "force", "lower", "upper", "ends", "hands"]
    assert (inspect.getdoc(Arm) or "").startswith("An arm.\n\nAttributes\n----------\nname : str\n")


def test_declarations_tell_shapes_units_and_labels() -> None:
    assert inspect.getdoc(Link) == (
        "A link.\n\nAttributes\n----------\n"
        "axes : int\n"
        "mass : float\n    Its own. [kg]\n"
        "place : (axes, 2) float\n    Where it is. [m]\n"
        "turns : int\n    Turns. Counted from the start.\n"
        "low, high : (axes,) float; float\n    Bounds. [N; N m]"
    )


def test_a_class_made_where_no_source_is_kept_says_its_purpose() -> None:
    made = dataclass(type("Made", (), {"__doc__": "Made.", "__annotations__": {"a": "int"}}))
    assert made.__doc__ == "Made."
    assert made(a=1).a == 1


def test_an_instance_tells_what_its_class_does() -> None:
    assert hs.Push("trunk", force=(1.0, 0.0), start=0.0, duration=0.1).__doc__ == hs.Push.__doc__


def _of_fields(path: Path) -> list[tuple[str, str]]:
    """Classes of a file with the fields that their own docstrings say something of."""
    found = []
    for kind in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if not isinstance(kind, ast.ClassDef):
            continue
        marks = map(ast.unparse, [*kind.decorator_list, *kind.bases])
        if not any("dataclass" in mark or mark == "Bundle" for mark in marks):
            continue
        own = [s.target.id for s in kind.body
               if isinstance(s, ast.AnnAssign) and isinstance(s.target, ast.Name)]  # fmt: skip
        text = ast.get_docstring(kind) or ""
        heads = re.findall(r"^(\w+(?:, \w+)*) : ", text, re.MULTILINE)
        found += [(kind.name, name) for head in heads for name in head.split(", ") if name in own]
    return found


def test_no_docstring_repeats_a_field() -> None:
    repeated = {path.relative_to(HOME).as_posix(): _of_fields(path) for path in SOURCES}
    assert {place: found for place, found in repeated.items() if found} == {}
