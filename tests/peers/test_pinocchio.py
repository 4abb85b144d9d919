"""Every query against Pinocchio, on all built-in robots and 200 random trees of 2 to 30 joints.

Pinocchio's model is built here from the arrays of ours, joint by joint in three dimensions, so
that only the algorithms are compared; the reading of files is MuJoCo's test. Install it (package
``pin``) to run this. Both sides add a few hundred products, hence 1e-10 relative to the largest
entry.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from robot_cases import MANY, NAMED, RobotCase

from heelstrike import dynamics
from heelstrike.robot import Robot

pin = pytest.importorskip("pinocchio")

TOLERANCE = 1e-10


def space(vector: np.ndarray) -> np.ndarray:
    """Put a vector of the plane (x, z) into space."""
    return np.array([vector[0], 0.0, vector[1]])


def model_of(robot: Robot) -> Any:
    ours = robot.model
    model = pin.Model()
    for i in range(robot.nv):
        turn, x, z = ours.axis[i]
        joint = (
            pin.JointModelRevoluteUnaligned(np.array([0.0, turn, 0.0]))
            if turn
            else pin.JointModelPrismaticUnaligned(space(np.array([x, z])))
        )
        placement = pin.SE3(np.eye(3), space(ours.offset[i]))
        index = model.addJoint(int(ours.parent[i]) + 1, joint, placement, f"joint{i}")
        inertia = np.diag([1.0, ours.inertia[i], 1.0])  # x and z play no part in the plane
        body = pin.Inertia(float(ours.mass[i]), space(ours.center_of_mass[i]), inertia)
        model.appendBodyToJoint(index, body, pin.SE3.Identity())
    model.gravity.linear = space(ours.gravity)
    model.armature = ours.armature.copy()
    return model


def error(ours: Any, theirs: Any) -> float:
    ours, theirs = np.asarray(ours), np.asarray(theirs)
    assert ours.shape == theirs.shape
    return float(np.abs(ours - theirs).max(initial=0.0) / np.abs(theirs).max(initial=1.0))


@pytest.mark.parametrize("case", [*NAMED, *MANY], ids=lambda case: case.name)
def test_queries(case: RobotCase) -> None:
    robot = case.robot()
    n = robot.nv
    model = model_of(robot)
    data = model.createData()
    worst: dict[str, float] = {}

    def check(name: str, ours: Any, theirs: Any) -> None:
        worst[name] = max(worst.get(name, 0.0), error(ours, theirs))

    local = np.array([0.1, -0.2])
    for q, v in case.states(3):
        at = q - robot.model.reference
        a = np.cos(np.arange(n) + q[0])
        force = 20.0 * np.sin(np.arange(n) + 1.0)
        mass = np.array(pin.crba(model, data, at))
        mass = np.triu(mass) + np.triu(mass, 1).T
        check("mass matrix", dynamics.mass_matrix(robot, q), mass)
        bias = pin.nonLinearEffects(model, data, at, v).copy()
        gravity = pin.computeGeneralizedGravity(model, data, at).copy()
        check("bias force", dynamics.bias_force(robot, q, v), bias)
        check("gravity force", dynamics.gravity_force(robot, q), gravity)
        coriolis = pin.computeCoriolisMatrix(model, data, at, v) @ v
        check("coriolis force", dynamics.coriolis_force(robot, q, v), coriolis)
        inverse = pin.rnea(model, data, at, v, a).copy()
        check("inverse dynamics", dynamics.inverse_dynamics(robot, q, v, a), inverse)
        forward = pin.aba(model, data, at, v, force).copy()
        if case.name != "rimless_wheel":
            # Its inertia about the hub is 1e-12 kg m², which Pinocchio's sums round off: the
            # angular acceleration loses its digits there, not in MuJoCo and not here.
            check("forward dynamics", dynamics.forward_dynamics(robot, q, v, force), forward)

        pin.centerOfMass(model, data, at, v, 0.0 * a)
        check("centre of mass", dynamics.center_of_mass(robot, q), data.com[0][::2])
        speed = dynamics.center_of_mass_velocity(robot, q, v)
        check("centre of mass velocity", speed, data.vcom[0][::2])
        drift = dynamics.center_of_mass_bias_acceleration(robot, q, v)
        check("centre of mass bias", drift, data.acom[0][::2])
        rows = pin.jacobianCenterOfMass(model, data, at)
        check("centre of mass Jacobian", dynamics.center_of_mass_jacobian(robot, q), rows[::2])
        matrix = pin.computeCentroidalMap(model, data, at)
        check("momentum matrix", dynamics.momentum_matrix(robot, q), matrix[[0, 2, 4]])
        momentum = pin.computeCentroidalMomentum(model, data, at, v)
        planar = np.append(momentum.linear[::2], momentum.angular[1])
        check("momentum", dynamics.momentum(robot, q, v), planar)
        check("angular momentum", dynamics.angular_momentum(robot, q, v), planar[2])

        rotors = 0.5 * float(robot.model.armature @ v**2)
        # Some versions of Pinocchio count the motors' rotors, others do not.
        model.armature[:] = 0.0
        pin.computeKineticEnergy(model, data, at, v)
        model.armature = robot.model.armature.copy()
        check("kinetic energy", dynamics.kinetic_energy(robot, q, v) - rotors, data.kinetic_energy)
        pin.computePotentialEnergy(model, data, at)
        springs = 0.5 * float(robot.model.stiffness @ (q - robot.model.rest) ** 2)
        height = dynamics.potential_energy(robot, q) - springs
        check("potential energy", height, data.potential_energy)

        pin.forwardKinematics(model, data, at, v, 0.0 * a)
        pin.computeJointJacobians(model, data, at)
        poses = dynamics.link_poses(robot, q)
        velocities = dynamics.link_velocities(robot, q, v)
        for link in range(n):
            placement = data.oMi[link + 1]
            turn, origin = placement.rotation, placement.translation
            check("origin", poses.origin[link], origin[::2])
            angle = poses.angle[link]
            check("angle", [np.sin(angle), np.cos(angle)], [turn[0, 2], turn[0, 0]])
            axes = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
            motion = pin.getVelocity(model, data, link + 1, axes)
            check("link velocity", velocities.origin[link], motion.linear[::2])
            check("angular velocity", velocities.angular[link], motion.angular[1])
            arm = turn @ space(local)
            rows = pin.getJointJacobian(model, data, link + 1, axes)
            point = rows[:3] - np.cross(np.eye(3), arm) @ rows[3:]
            jacobian = dynamics.point_jacobian(robot, q, link, local)
            check("Jacobian", jacobian, np.stack((point[0], point[2], rows[4])))
            acceleration = pin.getClassicalAcceleration(model, data, link + 1, axes)
            w = motion.angular
            at_point = (
                acceleration.linear
                + np.cross(acceleration.angular, arm)
                + np.cross(w, np.cross(w, arm))
            )
            drift = dynamics.point_bias_acceleration(robot, q, v, link, local)
            check("Jacobian bias", drift, [at_point[0], at_point[2], acceleration.angular[1]])
            position = dynamics.point_position(robot, q, link, local)
            check("position", position, (origin + arm)[::2])
            moved = dynamics.point_velocity(robot, q, v, link, local)
            through = motion.linear + np.cross(w, arm)
            check("velocity", moved, [through[0], through[2], w[1]])
    assert max(worst.values()) <= TOLERANCE, worst
