"""Every public name says what it takes, returns and raises, and takes nothing that it ignores.

Public are the names of ``heelstrike`` and of the ``__all__`` of its packages, with the public
methods of their classes. Docstrings are numpydoc: a section for the parameters, one entry a
parameter or several that are described together, and sections for what is returned and raised. What
takes nothing and returns something may say so in its summary alone.
"""

from __future__ import annotations

import ast
import enum
import inspect
import re
import textwrap
import typing
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np
import pytest
import synthetic_runs
from public_names import public_names

import heelstrike
from heelstrike import errors
from heelstrike.field_texts import described
from heelstrike.robot import read_mjcf

SECTIONS = {
    "", "Parameters", "Attributes", "Returns", "Yields", "Raises", "Warns", "See Also", "Notes",
    "References", "Examples",
}  # fmt: skip
ERRORS = {name for name, value in vars(errors).items() if inspect.isclass(value)}


def callables() -> Iterator[tuple[str, Callable[..., Any]]]:
    """Public functions, and public methods of public classes that are written here.

    A method that fulfils the contract of a public base class is described there.
    """
    for name, value in PUBLIC.items():
        if inspect.isfunction(value):
            yield name, value
        elif inspect.isclass(value):
            bases = [base for base in value.__mro__[1:] if base in PUBLIC.values()]
            for member, method in vars(value).items():
                function = getattr(method, "__func__", method)
                if member.startswith("_") or not inspect.isfunction(function):
                    continue
                if any(member in vars(base) for base in bases):
                    assert function.__doc__, function
                elif function.__module__.startswith("heelstrike"):
                    yield f"{name}.{member}", function


PUBLIC = public_names()
FUNCTIONS = dict(callables())
CLASSES = {name: value for name, value in PUBLIC.items() if inspect.isclass(value)}


def sections(docstring: str) -> dict[str, list[str]]:
    """Lines of a numpydoc docstring by section; what comes before all under no name."""
    found: dict[str, list[str]] = {"": []}
    current = ""
    lines = inspect.cleandoc(docstring).split("\n")
    for line, below in zip(lines, [*lines[1:], ""], strict=True):
        if re.fullmatch("-{3,}", below) and len(below) == len(line):
            current = line
            found[current] = []
        elif not re.fullmatch("-{3,}", line):
            found[current].append(line)
    return found


def entries(lines: list[str]) -> list[str]:
    """Names that a section describes, several before one colon apart."""
    heads = [line.partition(" : ")[0] for line in lines if line[:1].strip()]
    return [name.strip().lstrip("*") for head in heads for name in head.split(",")]


def parameters(function: Callable[..., Any]) -> list[str]:
    """Names of the parameters, but for the object itself."""
    return [name for name in inspect.signature(function).parameters if name not in ("self", "cls")]


def takes_any(function: Callable[..., Any]) -> bool:
    """Whether a function or a constructor takes keywords by any name."""
    return any(p.kind is p.VAR_KEYWORD for p in inspect.signature(function).parameters.values())


def raised(function: Callable[..., Any]) -> set[str]:
    """Names of the errors that a function raises in its own lines."""
    tree = ast.parse(textwrap.dedent(inspect.getsource(function)))
    calls = (node.exc for node in ast.walk(tree) if isinstance(node, ast.Raise))
    return {ast.unparse(call.func) for call in calls if isinstance(call, ast.Call)} & ERRORS


def gaps(function: Callable[..., Any]) -> list[str]:
    """What the docstring of a function lacks, or has too much of."""
    documented = sections(inspect.getdoc(function) or "")
    described = entries(documented.get("Parameters", []))
    taken = parameters(function)
    found = [f"there is no section {name!r}" for name in documented.keys() - SECTIONS]
    found += [f"{name} is not described" for name in taken if name not in described]
    found += [f"{name} is described but not taken" for name in described if name not in taken]
    found += [f"{name} is described twice" for name in described if described.count(name) > 1]
    returned = inspect.signature(function).return_annotation not in (None, "None", "NoReturn")
    if taken and returned and not {"Returns", "Yields"} & documented.keys():
        found.append("what it returns is not described")
    if "Returns" in documented and not returned:
        found.append("it returns nothing")
    told = " ".join(documented.get("Raises", []))
    found += [f"{error} is not described" for error in raised(function) if error not in told]
    return found


def test_functions_describe_what_they_take_return_and_raise() -> None:
    found = {name: gaps(function) for name, function in FUNCTIONS.items()}
    assert {name: missing for name, missing in found.items() if missing} == {}


def test_classes_describe_what_they_are_made_of() -> None:
    found = {name: gaps_of_a_class(kind) for name, kind in CLASSES.items()}
    assert {name: missing for name, missing in found.items() if missing} == {}


def gaps_of_a_class(kind: Any) -> list[str]:
    """What the docstring of a class lacks, or has too much of."""
    documented = sections(kind.__doc__ or "")
    found = [] if kind.__doc__ else ["it has none"]
    found += [f"there is no section {name!r}" for name in documented.keys() - SECTIONS]
    described = entries(documented.get("Parameters", []) + documented.get("Attributes", []))
    if issubclass(kind, (enum.Enum, BaseException)) or getattr(kind, "_is_protocol", False):
        return found
    if typing.is_typeddict(kind):
        apart = set(described) ^ set(kind.__annotations__)
        return found + [f"{name} is described or declared, not both" for name in apart]
    if "declared" in dir(kind):  # a bundle is made of what it declares
        taken = [name for name in inspect.get_annotations(kind) if not name.startswith("_")]
    else:
        taken = [name for name in parameters(kind) if not name.startswith("_")]
    found += [f"{name} is not described" for name in taken if name not in described]
    known = {*taken, *inspect.get_annotations(kind), *dir(kind), *_set_by(kind)}
    found += [f"{name} is described but not there" for name in described if name not in known]
    found += [f"{name} is described twice" for name in described if described.count(name) > 1]
    return found


def test_every_field_has_a_text_or_a_type_that_says_it_all() -> None:
    types = {kind.rpartition(".")[2] for kind in CLASSES} | {"Path", "BaseException", "Exception"}
    silent = [
        (name, each.names)
        for name, kind in CLASSES.items()
        for each in described(kind)
        if not each.text and not types & set(re.findall(r"\w+", each.kind))
    ]
    assert silent == []


def _set_by(kind: type) -> set[str]:
    """Names of the attributes that a constructor sets."""
    tree = ast.parse(textwrap.dedent(inspect.getsource(kind)))
    return {
        node.attr
        for node in ast.walk(tree)
        if isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store)
    }


def test_properties_are_described() -> None:
    silent = [
        f"{name}.{member}"
        for name, kind in CLASSES.items()
        for member, value in vars(kind).items()
        if isinstance(value, property) and not member.startswith("_") and not value.__doc__
        and member not in entries(sections(kind.__doc__ or "").get("Attributes", []))
    ]  # fmt: skip
    assert silent == []


# Keywords that are handed on


TAKES_ANY = {name for name, function in FUNCTIONS.items() if takes_any(function)}
TAKES_ANY -= {"heelstrike.Bundle.allocate"}  # takes all extents of a robot, whichever it needs
BUNDLES = [kind for kind in CLASSES.values() if "declared" in dir(kind)]


def _members(bundle: Any) -> dict[str, Any]:
    return {name: getattr(bundle, name) for name in type(bundle).declared}


@pytest.fixture
def calls() -> dict[str, Callable[..., Any]]:
    """Calls, right but for what is added to them, of all that take keywords by any name."""
    robot = synthetic_runs.box()
    in_space = heelstrike.load_robot("bravo7", dimension=3)
    run = synthetic_runs.make_run(robot, np.linspace(0.0, 0.1, 3))

    def in_space_run() -> Any:
        return heelstrike.simulate(in_space, state=in_space.reference_state(), duration=0.002)

    based = heelstrike.RobotBuilder("made up")
    trunk = based.floating_base("trunk", mass=1.0, inertia=1.0)
    bare = heelstrike.RobotBuilder("nothing yet")
    return {
        "heelstrike.GaitFamily.at": heelstrike.GaitFamily(
            robot, {"speed": np.array([0.4])}, {}, {}, {}
        ).at,
        "heelstrike.gait_family": partial(heelstrike.gait_family, robot, speed=[0.4]),
        "heelstrike.load_robot": partial(heelstrike.load_robot, "bravo7"),
        "heelstrike.inspect_robot": partial(heelstrike.inspect_robot, robot),
        "heelstrike.robot.read_mjcf": partial(read_mjcf, "<mujoco/>"),
        "heelstrike.simulate": partial(
            heelstrike.simulate, robot, state=robot.reference_state(), duration=0.0
        ),
        "heelstrike.robot.Model.made": partial(type(robot.model).made, **_members(robot.model)),
        "heelstrike.robot.SpatialModel.made": partial(
            type(in_space.model).made, **_members(in_space.model)
        ),
        "heelstrike.Bundle.replaced": robot.model.replaced,
        "heelstrike.Run.plot": partial(run.plot, "torque"),
        "heelstrike.Run.animate": partial(run.animate, "film.gif"),
        "heelstrike.Run.save_html": partial(run.save_html, "run.html"),
        "heelstrike.Run.save_report": partial(run.save_report, "run.html"),
        "heelstrike.Run.summary": run.summary,
        "heelstrike.sim.spatial.SpatialRun.plot": lambda **how: in_space_run().plot("gap", **how),
        "heelstrike.sim.spatial.SpatialRun.animate": (
            lambda **how: in_space_run().animate("film.gif", **how)
        ),
        "heelstrike.sim.spatial.SpatialRun.save_html": (
            lambda **how: in_space_run().save_html("run.html", **how)
        ),
        "heelstrike.RobotBuilder.floating_base": partial(bare.floating_base, "trunk"),
        "heelstrike.RobotBuilder.hinge": partial(based.hinge, "hip", trunk),
        "heelstrike.RobotBuilder.slide": partial(based.slide, "leg", trunk, direction=(0, -1)),
    }


@pytest.mark.parametrize("name", sorted(TAKES_ANY))
def test_no_keyword_is_swallowed(name: str, calls: dict[str, Callable[..., Any]]) -> None:
    with pytest.raises((TypeError, errors.HeelstrikeError), match="no_such_option"):
        calls[name](no_such_option=1)


def test_no_bundle_takes_a_member_that_it_has_not() -> None:
    model = synthetic_runs.box().model
    with pytest.raises(TypeError, match="no_such_option"):
        type(model)(**_members(model), no_such_option=1)
    with pytest.raises(TypeError, match="no_such_option"):
        heelstrike.Bundle.allocate(no_such_option=np.zeros(2))
    assert {kind.__init__ for kind in BUNDLES} <= {type(model).__init__}
