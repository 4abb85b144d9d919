"""What is known of simulators without running them: the paper's columns of Table 1, and ours."""

from __future__ import annotations

from heelstrike.field_texts import dataclass


@dataclass(frozen=True)
class Facts:
    """A simulator in words."""

    languages: str
    """In which it is programmed by whoever uses it."""
    engine: str
    """What moves the bodies."""
    graphics: str
    """What draws them."""
    licence: str
    systems: str
    """Operating systems."""
    open_source: str
    documentation: str
    """licence, open_source, documentation: As they publish them."""
    contact: str
    """Model of contact."""
    friction: str
    """Whether Coulomb's law is exact."""
    restitution: str
    """Whether a coefficient of restitution is taken."""
    certificate: str
    """What a step says of its own error."""
    read: str
    """Where licence and systems were read."""


FACTS: dict[str, Facts] = {
    "heelstrike": Facts(
        "Python", "own, three methods", "Matplotlib, browser", "Apache-2.0",
        "Linux, macOS, Windows", "yes", "yes",
        "hard, complementarity; or compliant", "exact", "yes",
        "residuals of every solve, from its data",
        "pyproject.toml",
    ),
    "mujoco": Facts(
        "C, C++, Python", "own", "OpenGL", "Apache-2.0", "Linux, macOS, Windows", "yes", "yes",
        "soft constraints, a convex problem", "regularised: it creeps", "by damping",
        "residual of the solver",
        "LICENSE and metadata of the wheel",
    ),
    "drake": Facts(
        "C++, Python", "own", "browser, VTK", "BSD-3", "Linux, macOS", "yes", "yes",
        "compliant points, implicit", "regularised below a speed", "by dissipation", "convergence",
        "doc/drake/LICENSE.TXT and classifiers of the wheel; its parts have licences of their own",
    ),
    "drake_sap": Facts(
        "C++, Python", "own", "browser, VTK", "BSD-3", "Linux, macOS", "yes", "yes",
        "compliant points, a convex problem", "regularised", "by dissipation", "convergence",
        "doc/drake/LICENSE.TXT and classifiers of the wheel; its parts have licences of their own",
    ),
    "bullet": Facts(
        "C++, Python", "own", "OpenGL", "zlib", "Linux, macOS, Windows", "yes", "yes",
        "hard, sequential impulses", "cone, as far as iterations go", "yes", "none",
        "LICENSE.txt and classifiers of the wheel",
    ),
    "dart": Facts(
        "C++, Python", "own", "OpenSceneGraph", "BSD-2", "Linux, macOS, Windows", "yes",
        "yes",
        "hard, complementarity with bounded forces", "pyramid", "yes", "none",
        "LICENSE and classifiers of the wheel",
    ),
    "ode": Facts(
        "C, C++, Python", "own", "drawstuff", "LGPL or BSD", "Linux, macOS, Windows", "yes", "yes",
        "hard, complementarity with bounded forces", "pyramid", "yes", "none",
        "Debian's copyright files of python3-pyode (LGPL-2+ or BSD-3) and libode8 (LGPL-2.1+ or "
        "BSD-3)",
    ),
    "simbody": Facts(
        "C++; Python, MATLAB, Java by OpenSim", "own", "OpenGL, OpenSim", "Apache-2.0",
        "Linux, macOS, Windows", "yes", "yes",
        "compliant, exponential springs", "regularised, anchored springs", "by damping",
        "error control",
        "metadata of the opensim wheel",
    ),
    "physx": Facts(
        "C++; Python by SAPIEN", "own", "Vulkan", "BSD-3; SAPIEN MIT", "Linux, Windows", "yes",
        "yes", "hard, Gauss-Seidel, single precision", "cone, as far as iterations go", "yes",
        "none",
        "metadata of the sapien wheel; LICENSE.md of github.com/NVIDIA-Omniverse/PhysX",
    ),
    "newton": Facts(
        "Python", "several; here Steel, its own", "OpenGL, browser", "Apache-2.0",
        "Linux, macOS, Windows", "yes", "yes",
        "hard, Gauss-Seidel, single precision", "cone, as far as iterations go", "yes", "none",
        "metadata and README of the newton wheel",
    ),
    "genesis": Facts(
        "Python", "own", "OpenGL, ray tracing", "Apache-2.0", "Linux, macOS, Windows", "yes",
        "yes",
        "soft constraints, a convex problem", "regularised pyramid: it creeps", "by damping",
        "none",
        "LICENSE, METADATA and README of the genesis-world wheel",
    ),
    "siconos": Facts(
        "C++, Python", "own", "VTK", "Apache-2.0", "Linux, macOS", "yes", "yes",
        "hard, Moreau-Jean", "exact", "yes", "residual of the solver",
        "Debian's copyright file of python3-siconos",
    ),
    "pgs": Facts(
        "C++, Python", "none (solvers only)", "browser", "BSD-2", "Linux, macOS, Windows",
        "yes", "yes",
        "hard, Gauss-Seidel", "cone, as far as iterations go", "no", "residuals of the solver",
        "LICENSE of the pin wheel, whose metadata say BSD-3",
    ),
    "admm": Facts(
        "C++, Python", "none (solvers only)", "browser", "BSD-2", "Linux, macOS, Windows",
        "yes", "yes",
        "hard, alternating directions", "cone, to a tolerance", "no", "residuals of the solver",
        "LICENSE of the pin wheel, whose metadata say BSD-3",
    ),
}  # fmt: skip
"""By the names of rows. Of November 2026, from the projects' own pages and licences."""
