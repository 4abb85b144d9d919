"""What a MuJoCo file can say that heelstrike does not simulate."""

from __future__ import annotations

import numpy as np

from heelstrike.robot.files.links import is_modelled
from heelstrike.robot.files.mujoco_file import MujocoFile
from heelstrike.robot.warning import warn

TENDON_FORCES = (
    "tendon_stiffness",
    "tendon_damping",
    "tendon_frictionloss",
    "tendon_armature",
    "tendon_limited",
)


def warn_of_unmodelled(file: MujocoFile) -> None:
    """Warn of every part of the file that would act in MuJoCo and does not act here."""
    held = {"equality constraints other than connect and joint": _holds(file)}
    tell_of_left_out(file, held | acting_parts(file))
    _warn_of_fixed_root(file)


def acting_parts(file: MujocoFile) -> dict[str, bool]:
    """Parts of a file that are not simulated, equality constraints apart, and whether each acts."""
    model = file.model
    return {
        "tendons": any(np.any(file.field(name)) for name in TENDON_FORCES),
        "nonlinear springs or dampers": _any(file, "jnt_stiffnesspoly")
        or _any(file, "dof_dampingpoly")
        or _any(file, "actuator_dampingpoly"),
        "plastic springs": _any(file, "jnt_springyield"),
        "gravity compensation": _any(file, "body_gravcomp"),
        "air (density, viscosity, wind)": bool(
            model.opt.density or model.opt.viscosity or np.any(model.opt.wind)
        ),
        "flexible bodies": file.flexible,
        "moving platforms (mocap bodies)": model.nmocap > 0,
        "plugins": model.nplugin > 0,
    }


def tell_of_left_out(file: MujocoFile, acting: dict[str, bool]) -> None:
    """Warn of the parts of a file that act."""
    found = [what for what, acts in acting.items() if acts]
    if found:
        warn(f"{file.source}: not simulated and left out: {', '.join(found)}.")


def _warn_of_fixed_root(file: MujocoFile) -> None:
    """Warn of a URDF whose trunk MuJoCo fixes to the world, because nothing lets it float."""
    if not file.is_urdf:
        return
    children = {child.get("link") for child in file.xml.iterfind("joint/child")}
    moving = {file.name("body", one.body) for one in file.coordinates}
    for link in file.xml.iterfind("link"):
        mass = link.find("inertial/mass")
        if link.get("name") not in children | moving and mass is not None:
            warn(
                f"{file.source}: link {link.get('name')!r} is fixed to the world, for no joint "
                "moves it. If the robot floats, load it with floating=True, or put it on a link "
                "'world' by a planar joint with the axis (0, 1, 0)."
            )


def _holds(file: MujocoFile) -> bool:
    """Whether an equality constraint acts that is neither a closed loop nor a coupled joint."""
    if file.disabled("equality"):
        return False
    return not all(is_modelled(file, one) for one in range(file.model.neq))


def _any(file: MujocoFile, name: str) -> bool:
    return bool(np.any(file.field(name)))
