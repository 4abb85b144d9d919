"""A law of a user, found by the name of its module or file: its code is run."""

from __future__ import annotations

import importlib
import importlib.util
import inspect
import sys
import traceback
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

from heelstrike.compiler.bundle import Bundle
from heelstrike.errors import ControllerError
from heelstrike.gait import Gait
from heelstrike.robot import Robot
from heelstrike.robot.spatial.robot import SpatialRobot
from heelstrike.sim import Controller
from heelstrike.sim.controller.law import ControllerFunction, Law

FACTORY = "a class, or a function, of (robot, gait) that returns a controller"


Making = Callable[[Any, Gait | None], Law | Controller]
"""Makes a controller of a robot and its gait; of a robot in space, which has none, of it alone."""


def own_law(words: str) -> tuple[Making, str]:
    """Load what makes a controller of a robot and its gait. Its module or file is run.

    Parameters
    ----------
    words : str
        ``module:name`` of a module that can be imported, from the folder one is in too, or
        ``file.py:name``. The name is that of a class or function that takes a robot and its gait,
        or of a controller that is ready.

    Returns
    -------
    making : callable
        Takes a robot and its gait, returns the controller. What goes wrong in it is told as a
        ``ControllerError``.
    file : str
        Whose code was run.

    Raises
    ------
    ControllerError
        If there is no such module, file or name, running it fails, or it makes no controllers.
    """
    place, _, name = words.rpartition(":")
    if not place or not name:
        raise ControllerError(
            f"{words!r} names no law: it is MODULE:NAME or FILE.py:NAME, the name that of {FACTORY}"
        )
    module = _file(Path(place)) if place.endswith(".py") else _module(place)
    if not hasattr(module, name):
        public = [each for each in vars(module) if not each.startswith("_")]
        own = [each for each in public if _defined_there(getattr(module, each), module)]
        raise ControllerError(
            f"{place} has no {name!r}; there are {', '.join(own or public) or 'no names in it'}"
        )
    return _making(words, getattr(module, name)), str(module.__file__)


def _file(path: Path) -> ModuleType:
    """Run a file as a module of its own; what lies beside it can be imported by it."""
    if not path.is_file():
        raise ControllerError(f"there is no file {path}")
    name = path.stem if path.stem not in sys.modules else f"own_law_{path.stem}"
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    _look_in(path.parent)
    sys.modules[name] = module  # where annotations of classes are looked up
    try:
        spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:
        del sys.modules[name]
        raise ControllerError(f"{path} cannot be run: {_told(error)}") from error
    return module


def _module(name: str) -> ModuleType:
    """Import a module that is installed, or lies in the folder one is in."""
    _look_in(Path.cwd())
    try:
        return importlib.import_module(name)
    except (Exception, SystemExit) as error:
        missing = error.name if isinstance(error, ModuleNotFoundError) else None
        if missing is not None and f"{name}.".startswith(f"{missing}."):
            raise ControllerError(
                f"there is no module {name!r}, neither installed nor in {Path.cwd()}; a file is "
                "FILE.py:NAME"
            ) from error
        raise ControllerError(f"module {name!r} cannot be imported: {_told(error)}") from error


def _look_in(folder: Path) -> None:
    """Let modules be found in a folder, after all others: none of them is shadowed."""
    place = str(folder.resolve())
    if place not in sys.path:
        sys.path.append(place)


def _making(words: str, made: Any) -> Making:
    """Return what makes controllers, of whatever the name stands for."""
    if isinstance(made, ControllerFunction):
        if made.parameters is not Bundle:
            raise ControllerError(
                f"{words} is a function under @controller that takes parameters: name a function "
                f"of (robot, gait) that returns {made.name}(parameters)"
            )
        return lambda robot, gait: made()  # noqa: ARG005 - it needs neither
    if not isinstance(made, type) and _controls(made):
        return lambda robot, gait: made  # noqa: ARG005 - ready as it is
    if not callable(made):
        raise ControllerError(f"{words} is of type {type(made).__name__}: it must be {FACTORY}")

    def make(robot: Robot | SpatialRobot, gait: Gait | None) -> Law | Controller:
        given = (robot,) if gait is None else (robot, gait)
        try:
            inspect.signature(made).bind(*given)
        except TypeError as error:
            raise ControllerError(
                f"{words} is called with a robot{' and its gait' if gait is not None else ''}, "
                f"which it does not take: {error}"
            ) from error
        try:
            controller: Law | Controller = made(*given)
        except Exception as error:
            raise ControllerError(
                f"{words} makes no controller for robot {robot.name!r}: {_told(error)}"
            ) from error
        if not _controls(controller):
            raise ControllerError(
                f"{words} returned a {type(controller).__name__}, not a controller: an object with "
                "torque(t, state, contacts), or a law"
            )
        return controller

    return make


def _controls(made: object) -> bool:
    return isinstance(made, Law) or callable(getattr(made, "torque", None))


def _defined_there(made: object, module: ModuleType) -> bool:
    return getattr(made, "__module__", None) == module.__name__ and callable(made)


def _told(error: BaseException) -> str:
    """Say what was raised, and where."""
    if isinstance(error, SyntaxError):
        return f"SyntaxError: {error.msg} (line {error.lineno})"
    last = traceback.extract_tb(error.__traceback__)[-1]
    return f"{type(error).__name__}: {error} ({last.filename}, line {last.lineno})"
