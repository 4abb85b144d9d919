"""Options that a command declares together: the fields of a dataclass, each one an option."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Sequence
from dataclasses import is_dataclass
from typing import Any, TypeVar, get_type_hints

_Result = TypeVar("_Result")


def grouped(command: Callable[..., _Result]) -> Callable[..., _Result]:
    """Give a command the fields of its arguments that are dataclasses, as options in their place.

    It is called with the dataclasses that are made of what was given.
    """
    own = inspect.signature(command, eval_str=True).parameters
    groups: dict[str, Any] = {
        name: each.annotation for name, each in own.items() if is_dataclass(each.annotation)
    }
    options: list[inspect.Parameter] = []
    for name, parameter in own.items():
        options += _fields(groups[name]) if name in groups else [parameter]

    @functools.wraps(command)
    def calling(**given: Any) -> _Result:
        for name, group in groups.items():
            fields = group.__dataclass_fields__
            given[name] = group(**{field: given.pop(field) for field in fields if field in given})
        return command(**given)

    return declared(calling, options)


def declared(
    command: Callable[..., _Result], options: Sequence[inspect.Parameter]
) -> Callable[..., _Result]:
    """Say which options a command has."""
    command.__signature__ = inspect.Signature(options)  # type: ignore[attr-defined]
    command.__annotations__ = {each.name: each.annotation for each in options}
    return command


def _fields(group: type) -> list[inspect.Parameter]:
    return [
        inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=getattr(group, name),
                          annotation=annotation)
        for name, annotation in get_type_hints(group, include_extras=True).items()
    ]  # fmt: skip
