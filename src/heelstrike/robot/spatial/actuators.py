"""From the actuators of a file to torques at the joints of a robot in space."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from heelstrike.robot.files.actuators import Actuators, read_actuators
from heelstrike.robot.files.flattening import Coordinate
from heelstrike.robot.files.mujoco_file import MujocoFile
from heelstrike.robot.files.posture import joint_name
from heelstrike.robot.spatial.model import HINGE, SLIDE
from heelstrike.robot.warning import warn


def read_spatial_actuators(file: MujocoFile) -> Actuators:
    """Read the actuators of hinges and slides; `joint` of what is returned counts velocities.

    Warns
    -----
    RobotWarning
        Of motors on ball and free joints, which are left out.
    """
    model = file.model
    single = np.flatnonzero(np.isin(model.jnt_type, (HINGE, SLIDE))).tolist()
    coordinates = tuple(
        Coordinate(
            joint_name(model, joint),
            int(model.jnt_bodyid[joint]),
            int(model.jnt_type[joint]) == HINGE,
            np.array(file.pose.xaxis[joint]),
            np.array(file.pose.xanchor[joint]),
            float(file.pose.qpos[model.jnt_qposadr[joint]]),
            joint,
        )
        for joint in single
    )
    found = read_actuators(replace(file, coordinates=coordinates))
    velocity = np.asarray(model.jnt_dofadr)[single].astype(np.int64)
    joints = range(model.njnt)
    several = {
        file.name("actuator", actuator)
        for actuator in range(model.nu)
        if int(model.actuator_trnid[actuator, 0]) in joints
        and int(model.actuator_trnid[actuator, 0]) not in single
    }
    if several:
        warn(
            f"{file.source}: motors on ball and free joints are left out: "
            f"{', '.join(sorted(several))}. Motors here drive hinges and slides."
        )
    at_velocities = np.zeros((2, int(model.nv)))
    at_velocities[:, velocity] = found.armature, found.damping
    armature, damping = at_velocities
    return replace(found, joint=velocity[found.joint], armature=armature, damping=damping)
