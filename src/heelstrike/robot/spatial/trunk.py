"""What moves though a file does not say so, and what does not although it does.

The trunk of a URDF is meant to move freely; joints that move no mass cannot.
"""

from __future__ import annotations

from typing import Any

from heelstrike.errors import RobotError
from heelstrike.wording import some_of

SHOWN = 6  # how many joints a message lists before it counts the rest

ROOT = "root"
"""Name of the free joint that a trunk gets."""


def free_trunk(spec: Any, held: bool, *, floating: bool, label: str) -> list[str]:
    """Give the trunk of a parsed file a free joint, in the place of its own if it has some.

    A URDF has no other way than to leave the joint of its trunk out; whoever means a fixed one puts
    it on a link ``world``.

    Parameters
    ----------
    spec : mujoco.MjSpec
        The parsed file, which is changed.
    held : bool
        Whether the file says that a trunk without joints is fixed.
    floating : bool
        Whether the user wants the trunk to move freely.
    label : str
        What to call the file in messages.

    Returns
    -------
    list of str
        What the user should know.

    Raises
    ------
    RobotError
        If the user wants a trunk to move freely, and it is not clear which.
    """
    import mujoco

    free = mujoco.mjtJoint.mjJNT_FREE
    top = [body for body in spec.worldbody.bodies if not body.mocap]
    if any(joint.type == free for body in top for joint in body.joints):
        return []
    if not floating:
        if held or len(top) != 1 or top[0].joints:
            return []
        top[0].add_freejoint(name=_unused(spec))
        return [
            f"nothing holds {top[0].name or 'the trunk'}, so that it moves freely. Whoever wants "
            "it fixed puts it on a link 'world' by a fixed joint."
        ]
    able = [body for body in top if _moves(body)] if len(top) > 1 else top
    if len(able) != 1:
        raise RobotError(
            f"{label}: floating=True lets the one body move freely that the file fixes to the "
            f"world; here are {len(able)} such bodies. Give the trunk a <freejoint/> in the file."
        )
    names = [joint.name for joint in able[0].joints]
    for joint in list(able[0].joints):
        spec.delete(joint)
    able[0].add_freejoint(name=_unused(spec))
    if not names:
        return []
    return [f"{able[0].name or 'the trunk'} moves freely, in the place of {', '.join(names)}."]


def _moves(body: Any) -> bool:
    """Whether a body or one that depends on it has a joint."""
    return bool(body.joints) or any(_moves(child) for child in body.bodies)


def _unused(spec: Any) -> str:
    """Return a name for a joint that no joint of the file has."""
    name, taken = ROOT, {joint.name for joint in spec.joints}
    while name in taken:
        name += "_"
    return name


def weld(spec: Any, joints: list[str]) -> list[str]:
    """Take joints out of a parsed file, and what makes them follow others.

    Parameters
    ----------
    spec : mujoco.MjSpec
        The parsed file, which is changed.
    joints : list of str
        Names of the joints.

    Returns
    -------
    list of str
        What the user should know.
    """
    for one in list(spec.equalities):
        if one.name1 in joints or one.name2 in joints:
            spec.delete(one)
    for joint in list(spec.joints):
        if joint.name in joints:
            spec.delete(joint)
    if not joints:
        return []
    number = f"{len(joints)} joints move" if len(joints) > 1 else "1 joint moves"
    return [
        f"{number} no mass, so that nothing resists: {some_of(joints, SHOWN)}. They are taken for "
        "fixed ones; whoever wants them to move gives their links mass and moments of inertia."
    ]
