"""What the reference says of classes with fields: their docstrings, as Python composes them."""

from __future__ import annotations

import dataclasses
import importlib
import inspect
from typing import Any

import griffe

OURS, STANDARD = "heelstrike.field_texts.dataclass", "dataclasses.dataclass"


class Fields(griffe.Extension):
    """Put the docstring that a class composes of its fields in the place of theirs."""

    def on_package(self, *, pkg: griffe.Module, **_: Any) -> None:
        """Look through all modules of a package that has been read."""
        if pkg.path == "heelstrike":
            self._look_through(pkg)

    def _look_through(self, place: griffe.Module | griffe.Class) -> None:
        for name, member in list(place.members.items()):
            if member.is_alias:
                if getattr(member, "target_path", "") == OURS:  # Griffe knows the standard one
                    place.set_member(name, griffe.Alias(name, STANDARD, parent=place))
            elif member.is_module or member.is_class:
                self._look_through(member)
        told = [each for each in place.attributes.values() if each.docstring]
        if place.is_class and place.docstring and told:
            try:
                value = importlib.import_module(place.module.path)
            except ImportError:  # an engine that is not installed: no page shows its classes
                return
            for part in place.path.removeprefix(f"{place.module.path}.").split("."):
                value = getattr(value, part)
            if "Attributes\n-----" in (inspect.getdoc(value) or ""):
                place.docstring.value = inspect.getdoc(value)
                for each in told:
                    each.docstring = None
            if dataclasses.is_dataclass(value):
                place.labels.add("dataclass")
