"""The rows of the comparison: engines by the names that commands know, and what stands for others.

Of a row it is known which adapter it is, what is set for it beyond the engine's defaults because
the row is about that (a solver, say), and among what its best settings are sought.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field
from typing import Any

from heelstrike.errors import SimulationError
from heelstrike.field_texts import dataclass
from heelstrike.wording import meant


@dataclass(frozen=True)
class Entry:
    """A row of the comparison."""

    title: str
    """What tables call it."""
    package: str
    """Name of its engine in `heelstrike.experiments.engines`."""
    given: Mapping[str, Any] = field(default_factory=dict)
    """Settings of the adapter that make it this row."""
    choices: Mapping[str, tuple[Any, ...]] = field(default_factory=dict)
    """Settings that are tried by the search for the best, and their values, beside the default."""
    advice: str = ""
    """What its maintainers advise for contact, and where."""
    bounces: bool = True
    """Whether it takes a coefficient of restitution."""
    exact: Mapping[str, Any] = field(default_factory=dict)
    """Settings with which it flies as exactly as it can, where its steps are not all of its
    error."""


ENTRIES: dict[str, Entry] = {
    "mujoco": Entry(
        "MuJoCo", "mujoco",
        bounces=False,
        choices={
            "stiff": (2.0, 4.0),
            "integrator": ("implicitfast", "rk4"),
            "elliptic": (True,),
            "impratio": (10.0, 100.0),
            "noslip": (10,),
            "tolerance": (1e-10,),
        },
        advice=(
            "solref and solimp set how hard contacts are, impratio and elliptic cones how little "
            "they slip (mujoco.readthedocs.io, Modeling, Contact parameters; Preventing slip)"
        ),
    ),
    "drake": Entry(
        "Drake TAMSI", "drake", {"approximation": "tamsi"},
        bounces=False,
        choices={
            "stiffness": (1e5, 1e6, 1e7),
            "dissipation": (1.0, 10.0, 50.0),
            "stiction": (1e-3, 1e-5),
        },
        advice=(
            "stiffness and dissipation are properties of the geometries, stiction's tolerance of "
            "the plant (drake.mit.edu, Contact modeling in Drake)"
        ),
    ),
    "drake_sap": Entry(
        "Drake SAP", "drake", {"approximation": "sap"},
        bounces=False,
        choices={
            "stiffness": (1e5, 1e6, 1e7),
            "dissipation": (1.0, 10.0, 50.0),
            "near_rigid": (0.1, 0.0),
        },
        advice=(
            "SAP softens what a step cannot resolve: near_rigid_threshold (drake.mit.edu, "
            "MultibodyPlantConfig)"
        ),
    ),
    "bullet": Entry(
        "Bullet", "bullet",
        choices={
            "numSolverIterations": (200, 1000),
            "contactERP": (0.2, 0.8),
            "contactSlop": (0.0, 1e-5),
            "solverResidualThreshold": (1e-12,),
            "enableConeFriction": (0,),
        },
        advice=(
            "iterations and ERP, the share of an error that a step corrects (Bullet User Manual; "
            "PyBullet Quickstart, setPhysicsEngineParameter)"
        ),
    ),
    "dart": Entry("DART", "dart", choices={"split": (True,), "detector": ("FCL", "BULLET", "ODE")}),
    "ode": Entry(
        "ODE", "ode",
        choices={
            "erp": (0.1, 0.5, 0.8),
            "cfm": (0.0, 1e-8),
            "solver": ("quick",),
        },
        advice=(
            "ERP of 0.1 to 0.8, CFM (softness) of 1e-9 to 1, the exact solver `dWorldStep` for "
            "accuracy (ode.org, ODE Manual, chapter 3)"
        ),
    ),
    "simbody": Entry(
        "Simbody", "simbody",
        bounces=False,
        choices={
            "elasticity": (1e5, 1e6),
            "grip": (1e3,),
            "viscosity": (2.0, 5.0),
            "shape": ((0.0065905, 0.5336, 4000.0), (0.0065905, 0.5336, 10000.0)),
            "accuracy": (1e-5,),
        },
        advice="parameters of ExponentialContactForce (opensim-org, ExponentialContactForce)",
        exact={"accuracy": 1e-11},
    ),
    "physx": Entry(
        "PhysX", "physx",
        choices={
            "positions": (50, 255),
            "velocities": (0, 10),
            "offset": (1e-3, 1e-4),
            "tgs": (False,),
        },
        advice="iterations up to 255 for articulations (PhysX 5 documentation, Best Practices)",
    ),
    "newton": Entry(
        "Newton Steel", "newton",
        choices={
            "iterations": (50, 200),
            "baumgarte": (0.05, 0.8),
            "beta": (0.0,),
            "warm": (True,),
            "cfm": (0.0,),
        },
        advice=(
            "iterations, Baumgarte's part and friction by patches or by points (newton, "
            "docstring of SolverSteel)"
        ),
    ),
    "genesis": Entry(
        "Genesis", "genesis",
        bounces=False,
        choices={
            "constraint_timeconst": (0.005, 0.0),
            "friction_cone": ("elliptic",),
            "noslip_iterations": (5,),
            "iterations": (100,),
            "integrator": ("implicitfast", "Euler"),
        },
        advice=(
            "the elliptic cone, which Genesis pairs with its resolution 'signorini' and an "
            "impratio of 100, where contacts slide or must not creep; five iterations of noslip "
            "where slip is a problem; a time constant of two steps or more (genesis-world, "
            "docstrings of RigidOptions, friction_cone and contact_resolution)"
        ),
    ),
    "siconos": Entry(
        "Siconos", "siconos",
        choices={"theta": (0.75, 1.0), "solver": ("nsgs",), "tolerance": (1e-12,)},
    ),
    "pgs": Entry(
        "Pinocchio PGS", "pinocchio_contact", {"solver": "pgs"},
        bounces=False,
        choices={"tolerance": (1e-9, 1e-12), "iterations": (10000,)},
    ),
    "admm": Entry(
        "Pinocchio ADMM", "pinocchio_contact", {"solver": "admm"},
        bounces=False,
        choices={"tolerance": (1e-9, 1e-12), "iterations": (10000,)},
    ),
}  # fmt: skip
"""Rows that are simulated, in the order of the table."""

ABSENT: dict[str, str] = {
    "Vortex": "commercial, no package for this platform; no free engine is of its kind",
    "RaiSim": "needs a licence file of its maker; DART and Siconos solve the same contact problem",
    "CoppeliaSim (V-REP)": (
        "no package for Python; of its engines Bullet, ODE and MuJoCo have rows, "
        "Newton Dynamics and Vortex none"
    ),
    "Webots": "no package; its engine is a fork of ODE, which has a row",
    "Gazebo": (
        "its physics library is C++ alone in Debian (libignition-physics-dev); its engines DART, "
        "Bullet and ODE have rows"
    ),
    "OpenHRP/Choreonoid": "no package for Python; its engine is its own",
}
"""Simulators of the paper's Table 1 and others that are not run here, and why."""


def entries_called(names: Sequence[str] | str) -> dict[str, Entry]:
    """Return rows by their names.

    Parameters
    ----------
    names : sequence of str or str
        Their names; ``"all"`` is all of `ENTRIES`.

    Returns
    -------
    dict
        Rows by name, in the order asked for.

    Raises
    ------
    SimulationError
        If there is none of a name.
    """
    asked = [names] if isinstance(names, str) else list(names)
    if asked == ["all"]:
        return dict(ENTRIES)
    found = {}
    for name in asked:
        if name not in ENTRIES:
            guess = meant(name, {each: repr(each) for each in ENTRIES})
            raise SimulationError(
                f"there is no engine {name!r}.{guess} There are {', '.join(ENTRIES)}, and 'all'."
            )
        found[name] = ENTRIES[name]
    return found
