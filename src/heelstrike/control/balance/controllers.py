"""The controllers that keep their balance, as a user makes them."""

from __future__ import annotations

from math import exp, sqrt
from typing import Any

import numpy as np

from heelstrike.control.balance.footsteps import Planning
from heelstrike.control.balance.law import keep_balance
from heelstrike.control.balance.numbers import Legs, Parameters, Weights
from heelstrike.control.balance.reference import reference_of
from heelstrike.control.balance.tasks import CONTACT_ROWS
from heelstrike.errors import ControllerError
from heelstrike.gait.gait import Gait
from heelstrike.gait.sole import leg, sole, standing_height
from heelstrike.robot.robot import Robot
from heelstrike.sim.controller.law import Law

LEG = 0.9538
"""Standing height of the robot that the numbers below were found with, bravo7 (m)."""


class FootstepFeedback(Law):
    """Walk."""

    def __init__(self, robot: Robot, gait: Gait, *, adapts=True, length=None, friction=0.6, **numbers) -> None:
        gait.check_joints(robot)
        feet = [sole(robot, foot) for foot in range(2)]
        scale = standing_height(robot, feet[0]) / LEG
        pace = sqrt(scale)
        weight = float(-robot.model.mass.sum() * robot.model.gravity[1])
        half = feet[0].half_length
        margin = numbers.pop("margin", 0.01)
        reference = reference_of(robot, gait)
        T = gait.step_duration
        planning = dict(
            heel=-half + margin, toe=half - margin, shortest=-0.5 * scale, longest=0.65 * scale,
            earliest=0.4 * T, latest=1.29 * T, soon=0.12 * pace, acceleration=60.0, hurry=3.5,
            foothold_weight=1.0, time_weight=0.3 * scale, capture_weight=30.0)
        weights = dict(pressure=1e6, height=1.0, swing=1.0, pitch=1.0, angle=0.05, posture=1e-3,
                       knee=1.0, torque=1e-7)
        rest = dict(
            adapts=int(adapts), length=gait.step_length if length is None else length,
            kp=150.0 / scale, kd=25.0 / pace, foot_kp=400.0 / scale, foot_kd=40.0 / pace,
            joint_kp=150.0 / scale, joint_kd=25.0 / pace, friction=friction, least_force=0.15 * weight,
            weight=weight, touchdown=0.4, settling=0.02 * T, calm=0.02 * scale, alarmed=0.08 * scale,
            calming=1.0 * pace, crouch=0.03 * scale, lift=0.03 * scale, knee=0.10, straight_knee=-0.25, knee_kp=900.0/scale, slow=0.15 * pace,
            fast=1.0 * pace, haste=0.1*pace, search=0.1 * pace, smoothing=0.01 * pace)
        for name, value in numbers.items():
            for group in (planning, weights, rest):
                if name in group: group[name] = value; break
            else: raise ControllerError(name)
        parameters = Parameters(reference=reference, planning=Planning(**planning),
            weights=Weights(**weights), legs=_legs(robot, gait, feet), **rest)
        sizes = {"n": robot.nu, "m": CONTACT_ROWS + 2 * robot.nu + 3}
        super().__init__(keep_balance, parameters, robot=robot,
            memory={"stance": gait.stance_foot, "landed": 1, "rate": 1.0 / T, **sizes})
        self.gait = gait


def _legs(robot, gait, feet) -> Legs:
    model = robot.model
    chains = [leg(robot, foot) for foot in feet]
    actuators = model.actuator_joint.tolist()
    knees = [actuators.index(chain[1]) for chain in chains]
    thigh, shank = model.offset[chains[0][1]], model.offset[chains[0][0]]
    angle = np.arctan2(shank[0], -shank[1]) - np.arctan2(thigh[0], -thigh[1])
    straight, bend = [], []
    for foot, chain in enumerate(chains):
        sign = model.axis[chain[1], 0]
        s = model.reference[chain[1]] + angle / sign  # rotation about +y turns down towards −x
        straight.append(s)
        middle = gait.in_step(np.linspace(0, gait.step_duration, 20))
        mean = 0.5 * (middle + gait.mirrored(middle)).mean(0)[knees[foot]]
        bend.append(1.0 if mean > s else -1.0)
    return Legs(point=np.array([f.point for f in feet]), angle=np.array([f.angle for f in feet]),
        hip=np.array([c[-1] for c in chains]), knee=np.array(knees), straight=np.array(straight),
        bend=np.array(bend), length=float(np.hypot(*thigh) + np.hypot(*shank)))
