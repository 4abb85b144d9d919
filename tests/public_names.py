"""The public names of the package, for the tests that go through all of them."""

from __future__ import annotations

import importlib
import pkgutil
from typing import Any

import heelstrike


def public_names() -> dict[str, Any]:
    """Public objects, each by the shortest of its names."""
    packages = ["heelstrike"] + [
        module.name
        for module in pkgutil.walk_packages(heelstrike.__path__, "heelstrike.")
        if module.ispkg
    ]
    found: dict[int, tuple[str, Any]] = {}
    for package in packages:
        module = importlib.import_module(package)
        names = heelstrike._HOME if package == "heelstrike" else getattr(module, "__all__", ())
        for name in names:
            value = getattr(module, name)
            found.setdefault(id(value), (f"{package}.{name}", value))
    return dict(found.values())
