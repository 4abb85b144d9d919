"""What the reference says of functions that Python makes while it imports: as Python knows them.

The documentation reads sources, where such a function is a decorated body or the result of a call.
Those that say by ``__signature__`` how they are called are shown with it, and with the docstring
that they were given.
"""

from __future__ import annotations

import importlib
import inspect
from typing import Any

import griffe


class MadeFunctions(griffe.Extension):
    """Put functions in the place of what the sources say of them."""

    def on_package(self, *, pkg: griffe.Module, **_: Any) -> None:
        """Look through all modules of a package that has been read."""
        if pkg.path == "heelstrike":
            self._look_through(pkg.modules["dynamics"])

    def _look_through(self, module: griffe.Module) -> None:
        for inner in module.modules.values():
            if not inner.is_alias:
                self._look_through(inner)
        self._replace(module, vars(importlib.import_module(module.path)))

    def _replace(self, place: griffe.Module | griffe.Class, values: dict[str, Any]) -> None:
        for name, member in list(place.members.items()):
            value = values.get(name)
            if member.is_alias:
                continue
            if member.is_class:
                self._replace(member, vars(value))
            elif inspect.isfunction(value) and "__signature__" in vars(value):
                made = function(name, value, member)
                place.set_member(name, made)


def function(name: str, value: Any, member: griffe.Object) -> griffe.Function:
    """Return a function as it is called, and documented, in the place where it is made."""
    signature = inspect.signature(value)
    parameters = [
        griffe.Parameter(
            each.name,
            annotation=_words(each.annotation),
            kind=griffe.ParameterKind[each.kind.name.lower()],
            default=None if each.default is each.empty else repr(each.default),
        )
        for each in signature.parameters.values()
    ]
    return griffe.Function(
        name,
        parameters=griffe.Parameters(*parameters),
        returns=_words(signature.return_annotation),
        docstring=griffe.Docstring(inspect.getdoc(value) or "", parser="numpy"),
        lineno=member.lineno,
        endlineno=member.endlineno,
    )


def _words(annotation: Any) -> str | None:
    return None if annotation is inspect.Signature.empty else str(annotation)
