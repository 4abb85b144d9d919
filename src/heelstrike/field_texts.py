"""What is said of the fields of a class: strings beneath them, from which its docstring follows.

A field of a dataclass or of a bundle is declared once, and the string beneath it says what it is,
where editors and documentation tools look for it. The docstring of the class says what the class is
for; a section of its attributes is composed of the fields when somebody reads it::

    @dataclass(frozen=True)
    class Leg:
        '''A leg.'''

        length: float
        '''From hip to sole (m).'''
        force: Floats
        '''(n, 2) On the foot, in world axes (N).'''
        lower: float
        upper: float
        '''lower, upper: Range of the knee (rad).'''

What is said of several fields begins with their names, what is said of arrays with their shapes.
A declaration may know more than its type: shape, unit, and a label for those who read data, which
its text begins with, or is.
"""

from __future__ import annotations

import ast
import dataclasses
import inspect
import re
import textwrap
from collections.abc import Iterator, Mapping
from functools import lru_cache, partial
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from dataclasses import dataclass as dataclass
else:

    def dataclass(kind: Any = None, /, **options: Any) -> Any:
        """Make a dataclass as the standard library does, with its fields in its docstring.

        What a field is declared to be, beyond its type, is its metadata ``"declared"``.
        """
        if kind is None:
            return partial(dataclass, **options)
        purpose = kind.__doc__
        made = dataclasses.dataclass(kind, **options)
        told = {each.name: each.metadata.get("declared") for each in dataclasses.fields(made)}
        made.__doc__ = purpose and FieldTexts(purpose, {k: v for k, v in told.items() if v})
        return made


_TITLE = "Attributes\n----------\n"
_SECTION = re.compile(r"\n\n(?=[A-Z][\w ]+\n---)")
_NAMES = re.compile(r"(\w+(?:, \w+)+):\s+")
_SHAPES = re.compile(
    r"(\((?:[\w +.]+,[\w +.,]*)?\)(?:(?:, | and )\((?:[\w +.]+,[\w +.,]*)?\))*)\s+"
)
_NUMBERS = {"Floats": "float", "Integers": "int", "NDArray[Any]": "array", "ArrayLike": "array"}
_ARRAY = re.compile(r"NDArray\[np\.([a-z]+)\d*_?\]")


class FieldTexts:
    """The docstring of a class: its purpose, and what is said of its fields.

    Parameters
    ----------
    purpose : str
        What the class itself says.
    declared : mapping of str to object
        Fields whose declarations know more than their types: ``dimensions``, ``label``, ``unit``.
    """

    def __init__(self, purpose: str, declared: Mapping[str, Any]) -> None:
        self.purpose = inspect.cleandoc(purpose)
        self.declared = declared

    def __get__(self, _: object, kind: type) -> str:
        told = "\n".join(map(str, described(kind)))
        if not told:
            return self.purpose
        if _TITLE in self.purpose:  # what is no field stands there: properties
            return self.purpose.replace(_TITLE, f"{_TITLE}{told}\n", 1)
        place = _SECTION.search(self.purpose)
        end = place.start() if place else len(self.purpose)
        return f"{self.purpose[:end]}\n\n{_TITLE}{told}{self.purpose[end:]}"


class Description(NamedTuple):
    """What is said of a field, or of several at once: an entry of a docstring."""

    names: tuple[str, ...]
    kind: str
    text: str

    def __str__(self) -> str:
        plain = "\n\n" not in self.text and "\n " not in self.text  # one paragraph, no list
        text = textwrap.fill(self.text, 96, break_on_hyphens=False) if plain else self.text
        head = f"{', '.join(self.names)} : {self.kind}"
        return f"{head}\n{textwrap.indent(text, '    ')}".rstrip()


def described(kind: type) -> list[Description]:
    """Return what is said of the public fields of a class.

    Parameters
    ----------
    kind : type
        A dataclass, or a class of bundles.

    Returns
    -------
    list of Description
        In the order of its fields, those of its bases first; none of a class whose source is not
        known.
    """
    own = (_own(base) for base in reversed(kind.__mro__) if "__doc__" in vars(base))
    found = {name: each for told in own for each in told for name in each.names}
    return list(dict.fromkeys(found.values()))


@lru_cache
def _own(kind: type) -> tuple[Description, ...]:
    """Read what a class says of the fields that it declares itself."""
    docstring = vars(kind)["__doc__"]
    if not isinstance(docstring, FieldTexts):
        return ()
    kinds: dict[str, str] = {}
    labels: dict[str, str] = {}
    units: dict[str, str] = {}
    found: dict[str, Description] = {}
    for name, annotation, text in _declarations(kind):
        about = docstring.declared.get(name)
        together, text = _parted(_NAMES, text)
        shapes, text = _parted(_SHAPES, text)
        names = tuple(together.split(", ")) if together else (name,)
        kinds[name] = _kind(annotation, getattr(about, "dimensions", ()))
        labels[name] = getattr(about, "label", "")
        units[name] = getattr(about, "unit", "").strip("1")
        several, label, unit = (_joined(names, told) for told in (kinds, labels, units))
        sentences = [label and f"{label[0].upper()}{label[1:]}.", text, unit and f"[{unit}]"]
        kind_told = f"{shapes} {several}".lstrip()
        told = Description(names, kind_told, " ".join(filter(None, sentences)))
        found |= dict.fromkeys(names, told)
    return tuple(dict.fromkeys(found[name] for name in kinds))


def _declarations(kind: type) -> Iterator[tuple[str, str, str]]:
    """Yield names, annotations and texts of the public fields that a class declares itself."""
    try:
        tree = ast.parse(textwrap.dedent(inspect.getsource(kind))).body[0]
    except (OSError, TypeError):  # made where no source is kept
        return
    body: list[Any] = getattr(tree, "body", [])
    for field, below in zip(body, [*body[1:], None], strict=True):
        if not isinstance(field, ast.AnnAssign) or not isinstance(field.target, ast.Name):
            continue
        said = isinstance(below, ast.Expr) and isinstance(below.value, ast.Constant)
        name, annotation = field.target.id, ast.unparse(field.annotation)
        if not name.startswith("_") and (said or "ClassVar" not in annotation):
            yield name, annotation, inspect.cleandoc(below.value.value) if said else ""


def _joined(names: tuple[str, ...], told: Mapping[str, str]) -> str:
    """Return what is told of several fields, each thing once."""
    return "; ".join(dict.fromkeys(told[name] for name in names if told[name]))


def _parted(begins: re.Pattern[str], text: str) -> tuple[str, str]:
    """Part what a text begins with from the rest."""
    match = begins.match(text)
    return (match[1], text[match.end() :]) if match else ("", text)


def _kind(annotation: str, dimensions: tuple[str | int, ...]) -> str:
    """Return the type of a field as docstrings tell it: ``(nv, 2) float``."""
    number, *missing = annotation.split(" | None")
    array = _ARRAY.fullmatch(number)
    number = array[1] if array else _NUMBERS.get(number, annotation)
    number += " or None" if missing and number != annotation else ""
    if not dimensions:
        return number
    return f"({', '.join(map(str, dimensions))}{',' * (len(dimensions) == 1)}) {number}"
