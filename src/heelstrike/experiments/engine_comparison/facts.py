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


FACTS: dict[str, Facts] = {
    "heelstrike": Facts(
        "Python", "own, three methods", "Matplotlib, browser", "Apache-2.0",
        "Linux, macOS, Windows", "yes", "yes",
        "hard, complementarity; or compliant", "exact", "yes",
        "residuals of every solve, from its data",
    ),
    "mujoco": Facts(
        "C, C++, Python", "own", "OpenGL", "Apache-2.0", "Linux, macOS, Windows", "yes", "yes",
        "soft constraints, a convex problem", "regularised: it creeps", "by damping",
        "residual of the solver",
    ),
    "drake": Facts(
        "C++, Python", "own", "browser, VTK", "BSD-3", "Linux, macOS", "yes", "yes",
        "compliant points, implicit", "regularised below a speed", "by dissipation", "convergence",
    ),
    "drake_sap": Facts(
        "C++, Python", "own", "browser, VTK", "BSD-3", "Linux, macOS", "yes", "yes",
        "compliant points, a convex problem", "regularised", "by dissipation", "convergence",
    ),
    "bullet": Facts(
        "C++, Python", "own", "OpenGL", "zlib", "Linux, macOS, Windows", "yes", "yes",
        "hard, sequential impulses", "cone, as far as iterations go", "yes", "none",
    ),
    "dart": Facts(
        "C++, Python", "own", "OpenSceneGraph", "BSD-2", "Linux, macOS", "yes", "yes",
        "hard, boxed complementarity", "pyramid", "yes", "none",
    ),
    "ode": Facts(
        "C, C++, Python", "own", "drawstuff", "LGPL or BSD", "Linux, macOS, Windows", "yes", "yes",
        "hard, boxed complementarity", "pyramid", "yes", "none",
    ),
    "simbody": Facts(
        "C++; Python, MATLAB, Java by OpenSim", "own", "OpenGL, OpenSim", "Apache-2.0",
        "Linux, macOS, Windows", "yes", "yes",
        "compliant, exponential springs", "regularised, anchored springs", "by damping",
        "error control",
    ),
    "physx": Facts(
        "C++; Python by SAPIEN", "own", "Vulkan", "BSD-3; SAPIEN MIT", "Linux, Windows", "yes",
        "yes", "hard, Gauss-Seidel, single precision", "cone, as far as iterations go", "yes",
        "none",
    ),
    "siconos": Facts(
        "C++, Python", "own", "VTK", "Apache-2.0", "Linux, macOS", "yes", "yes",
        "hard, Moreau-Jean", "exact", "yes", "residual of the solver",
    ),
    "pgs": Facts(
        "C++, Python", "none: solvers", "browser", "BSD-2", "Linux, macOS, Windows", "yes", "yes",
        "hard, Gauss-Seidel", "cone, as far as iterations go", "no", "residuals of the solver",
    ),
    "admm": Facts(
        "C++, Python", "none: solvers", "browser", "BSD-2", "Linux, macOS, Windows", "yes", "yes",
        "hard, alternating directions", "cone, to a tolerance", "no", "residuals of the solver",
    ),
}  # fmt: skip
"""By the names of rows. Of November 2026, from the projects' own pages and licences."""
