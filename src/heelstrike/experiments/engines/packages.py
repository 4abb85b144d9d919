"""Which other engines there are, and which of them this machine can be asked to compare with."""

from __future__ import annotations

import importlib
import importlib.util
from collections.abc import Mapping, Sequence
from importlib.metadata import PackageNotFoundError, version
from types import ModuleType

from heelstrike.experiments.engines.peer import Engine, InvalidRunError
from heelstrike.field_texts import dataclass


@dataclass(frozen=True)
class Package:
    """Where an engine comes from."""

    title: str
    """Its name."""
    module: str
    distribution: str
    """module, distribution: What is imported, and what is installed."""
    adapter: str | None
    """Module of this package that asks it to simulate and has an `Engine` named ``ENGINE``; None if
    there is none."""
    elsewhere: bool = False
    """Whether it is imported in a process without this package: by the system's Python, say."""
    raced: bool = True
    """Whether its steps are timed beside ours: not where their loop is in Python."""


PACKAGES = {
    "mujoco": Package("MuJoCo", "mujoco", "mujoco", "mujoco_peer"),
    "drake": Package("Drake", "pydrake", "drake", "drake_peer"),
    "bullet": Package("Bullet", "pybullet", "pybullet", "bullet_peer"),
    "dart": Package("DART", "dartpy", "dartpy", "dart_peer"),
    "pinocchio": Package("Pinocchio", "pinocchio", "pin", "pinocchio_peer"),
    "pinocchio_contact": Package(
        "Pinocchio's solvers", "pinocchio", "pin", "pinocchio_contact_peer", raced=False
    ),
    "physx": Package("PhysX", "sapien", "sapien", "physx_peer", raced=False),
    "simbody": Package(
        "Simbody", "opensim", "opensim", "simbody_peer", elsewhere=True, raced=False
    ),
    "newton": Package("Newton", "newton", "newton", "newton_peer", raced=False),
    "genesis": Package(
        "Genesis", "genesis", "genesis-world", "genesis_peer", elsewhere=True, raced=False
    ),
    "ode": Package("ODE", "ode", "python3-pyode", "ode_peer", elsewhere=True, raced=False),
    "siconos": Package(
        "Siconos", "siconos", "python3-siconos", "siconos_peer", elsewhere=True, raced=False
    ),
}
PARTS_OF_STEPS = ("pinocchio",)
"""Engines without a loop of their own: a part of a step is timed, never compared with a step."""

NOT_INSTALLED = "not installed"


def peers(*, load: bool = True) -> dict[str, str]:
    """Engines by name, each with its version or why it is not compared with.

    Parameters
    ----------
    load : bool
        Whether those that this process can have are loaded, to see that they can be.

    Returns
    -------
    dict
        Versions, or reasons, by the names of engines.
    """
    return {name: _state(package, load) for name, package in PACKAGES.items()}


def _state(package: Package, load: bool) -> str:
    if package.elsewhere:
        return _state_elsewhere(package)
    if importlib.util.find_spec(package.module) is None:
        return NOT_INSTALLED
    try:
        found = version(package.distribution)
    except PackageNotFoundError:
        found = "unknown version"
    if package.adapter is None:
        return f"{found}, but there is no adapter for it"
    if not load:
        return found
    try:
        _adapter(package)
    except Exception as error:  # whatever a broken installation raises
        return f"{found}, but it cannot be loaded: {type(error).__name__}: {error}"
    return found


def _state_elsewhere(package: Package) -> str:
    from heelstrike.experiments.engines.served import version_elsewhere

    found = version_elsewhere(package.module)
    if found:
        return found
    if package.distribution.startswith("python3-"):
        return f"{NOT_INSTALLED}: Debian has it as {package.distribution}"
    return f"{NOT_INSTALLED}: pip install {package.distribution}"


def compared(found: dict[str, str]) -> list[str]:
    """Names of the peers that can be run.

    Parameters
    ----------
    found : dict
        What :func:`peers` returned.

    Returns
    -------
    list of str
        Their names.
    """
    return [
        name
        for name, state in found.items()
        if PACKAGES[name].adapter and not state.startswith(NOT_INSTALLED) and ", but " not in state
    ]


def refuse_absent(name: str, versions: Mapping[str, str]) -> None:
    """Refuse an engine that cannot be compared here.

    Parameters
    ----------
    name : str
        Its name.
    versions : mapping of str to str
        What :func:`peers` says of the engines.

    Raises
    ------
    InvalidRunError
        That says why.
    """
    if not compared({name: versions[name]}):
        raise InvalidRunError(f"{PACKAGES[name].title} is {versions[name]}")


def raced(found: dict[str, str]) -> list[str]:
    """Names of the peers whose steps can be timed beside ours.

    Parameters
    ----------
    found : dict
        What :func:`peers` returned.

    Returns
    -------
    list of str
        Their names.
    """
    return [name for name in compared(found) if PACKAGES[name].raced]


def simulators(names: Sequence[str] | None = None) -> dict[str, Engine]:
    """Load engines that simulate.

    Parameters
    ----------
    names : sequence of str, optional
        Names of engines that can be loaded, by default of all that can.

    Returns
    -------
    dict
        Engines by name, without those that have no loop of their own.
    """
    names = compared(peers()) if names is None else names
    return {name: _adapter(PACKAGES[name]).ENGINE for name in names if name not in PARTS_OF_STEPS}


def _adapter(package: Package) -> ModuleType:
    return importlib.import_module(f"heelstrike.experiments.engines.{package.adapter}")
