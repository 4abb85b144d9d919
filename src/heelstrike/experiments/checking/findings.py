"""What is wrong with a motion: ranges, motors, soles, friction, clearance, landings."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from heelstrike.contact.ground import Ground
from heelstrike.contact.queries.inverse_dynamics import contact_inverse_dynamics
from heelstrike.dynamics import contact_positions
from heelstrike.experiments.checking.stance import Placed
from heelstrike.field_texts import dataclass
from heelstrike.robot.robot import Robot

EVERY = 2
"""Instants between two of which forces are computed."""
ENDS = 3
"""Instants at either end of a phase at which no forces are computed: accelerations jump there."""
AT_THE_ENDS = 0.1
"""Part of a phase at either end in which a foot may be near the ground."""
IN_THE_GROUND = 1e-3
"""How deep in the ground (m) a swing foot is no matter of rounding."""
HARD = 0.3
"""Speed (m/s) of a foot that lands hard."""


ORDER = (
    "degrees", "range", "scuff", "speed", "zero moment point", "friction", "torque", "impact",
    "walk", "tolerances",
)  # fmt: skip
"""Causes in the order in which one brings about another."""


@dataclass(frozen=True)
class Finding:
    """Something wrong with a motion, or close to a limit."""

    cause: str
    """What: one of `ORDER`."""
    used: float
    """Share of what is allowed; above 1 it is too much."""
    time: float
    """When, in s."""
    message: str
    """In words."""
    advice: str
    """What to change."""

    @property
    def broken(self) -> bool:
        """Whether it is too much."""
        return self.used > 1.0


def find(robot: Robot, placed: Placed, ground: Ground) -> Iterator[Finding]:
    """Find what is wrong with a motion, without simulating it.

    Parameters
    ----------
    robot : Robot
        The robot.
    placed : Placed
        Its motion with the trunk.
    ground : Ground
        Level ground.
    """
    yield from _ranges(robot, placed)
    yield from _swings(robot, placed)
    yield from _forces(robot, placed, ground)


def _ranges(robot: Robot, placed: Placed) -> Iterator[Finding]:
    model = robot.model
    for joint in model.actuator_joint.tolist():
        low, high = float(model.lower[joint]), float(model.upper[joint])
        name = robot.joint_names[joint].replace("_", " ")
        if np.isfinite(low) and np.isfinite(high):
            half, middle = 0.5 * (high - low), 0.5 * (high + low)
            share = np.abs(placed.q[:, joint] - middle) / half
            row = int(share.argmax())
            yield Finding(
                "range", float(share[row]), float(placed.time[row]),
                f"{name} at {placed.q[row, joint]:.3g}, of {low:.3g} to {high:.3g}",
                f"keep {name} within its range",
            )  # fmt: skip
        fastest = float(min(model.speed_limit[joint], model.no_load_speed[joint]))
        if np.isfinite(fastest):
            share = np.abs(placed.v[:, joint]) / fastest
            row = int(share.argmax())
            yield Finding(
                "speed", float(share[row]), float(placed.time[row]),
                f"{name} at {abs(placed.v[row, joint]):.3g} of {fastest:.3g} rad/s",
                f"let {name} move slower: longer steps in time, or less lift",
            )  # fmt: skip


def _swings(robot: Robot, placed: Placed) -> Iterator[Finding]:
    deepest, at = np.inf, 0
    for _, first, last in placed.phases:
        margin = int(AT_THE_ENDS * (last - first))
        inside = placed.clearance[first + margin : last + 1 - margin]
        if len(inside) and inside.min() < deepest:
            deepest, at = float(inside.min()), first + margin + int(inside.argmin())
    if np.isfinite(deepest):
        used = 2.0 if deepest < -IN_THE_GROUND else (0.9 if deepest < IN_THE_GROUND else 0.5)
        yield Finding(
            "scuff", used, float(placed.time[at]),
            f"the swing foot is {1e3 * deepest:.3g} mm above the ground in mid-swing",
            "lift the swing foot higher: bend its knee more",
        )  # fmt: skip
    fastest, when = 0.0, 0.0
    for (foot, first, last), (following, _, _) in zip(
        placed.phases, placed.phases[1:], strict=False
    ):
        if last - first < 2 or foot == following:
            continue
        contacts = list(robot.feet[following].contacts)
        heights = [contact_positions(robot, placed.q[row])[contacts, 1].min()
                   for row in (last - 1, last)]  # fmt: skip
        speed = float(heights[0] - heights[1]) / float(placed.time[last] - placed.time[last - 1])
        if speed > fastest:
            fastest, when = speed, float(placed.time[last])
    if fastest > 0.0:
        yield Finding(
            "impact", 0.9 * fastest / HARD if fastest < HARD else 0.95, when,
            f"a foot lands at {fastest:.2g} m/s", "slow the foot down before it lands",
        )  # fmt: skip


def _forces(robot: Robot, placed: Placed, ground: Ground) -> Iterator[Finding]:
    """Find what the ground and the motors would have to do."""
    model = robot.model
    worst: dict[str, Finding] = {}
    friction = float(ground.model().friction[0])
    inside = [
        row for _, first, last in placed.phases for row in range(first + ENDS, last + 1 - ENDS)
    ]
    for row in inside[::EVERY]:
        foot, time = int(placed.stance[row]), float(placed.time[row])
        contacts = list(robot.feet[foot].contacts)
        found = contact_inverse_dynamics(
            robot, placed.q[row], placed.v[row], placed.acceleration[row], contacts=contacts,
            ground=ground,
        )  # fmt: skip
        force, x = (
            found.contact_force[contacts],
            contact_positions(robot, placed.q[row])[contacts, 0],
        )
        normal = float(force[:, 0].sum())
        name = robot.feet[foot].name.replace("_", " ")
        if normal <= 0.0:
            pulled = f"the ground would have to pull the {name}"
            advice = "move slower: nothing holds the robot down"
            candidates = [Finding("zero moment point", 9.0, time, pulled, advice)]
        else:
            half, middle = 0.5 * float(np.ptp(x)), 0.5 * float(x.max() + x.min())
            zmp = float(force[:, 0] @ x) / normal - middle
            end = "toe" if zmp > 0.0 else "heel"
            tangent = abs(float(force[:, 1].sum()))
            most = friction * normal
            use = tangent / most if most > 0.0 else (np.inf if tangent > 0.0 else 0.0)
            candidates = [
                Finding("zero moment point", abs(zmp) / half, time,
                        f"the zero moment point is {1e3 * abs(zmp):.3g} mm from the middle of the "
                        f"{name}, towards its {end}; the sole ends at {1e3 * half:.3g} mm",
                        f"move the centre of mass {'back' if zmp > 0.0 else 'forwards'} over the "
                        "stance foot, or walk slower"),
                Finding("friction", use, time,
                        f"the {name} needs a friction of {use * friction:.2g} of {friction:.2g}",
                        "take shorter or slower steps"),
            ]  # fmt: skip
        for i, motor in enumerate(robot.actuator_names):
            torque = float(found.torque[i])
            bound = float(model.torque_upper[i] if torque > 0.0 else -model.torque_lower[i])
            line = _line(robot, i, torque, float(placed.v[row, model.actuator_joint[i]]))
            bound = min(bound, line)
            if np.isfinite(bound):
                share = abs(torque) / bound if bound > 0.0 else np.inf
                candidates.append(
                    Finding("torque", share, time,
                            f"{motor.replace('_', ' ')} needs {abs(torque):.3g} of {bound:.3g} N m",
                            f"a stronger motor at {motor.replace('_', ' ')}, or slower steps")
                )  # fmt: skip
        for each in candidates:
            if each.cause not in worst or each.used > worst[each.cause].used:
                worst[each.cause] = each
    yield from worst.values()


def _line(robot: Robot, motor: int, torque: float, speed: float) -> float:
    """Torque (N m) that the speed-torque line of a motor leaves; infinite without one."""
    joint = int(robot.model.actuator_joint[motor])
    stall = float(robot.model.stall_torque[joint])
    if not np.isfinite(stall):
        return np.inf
    return stall * (1.0 - np.sign(torque) * speed / float(robot.model.no_load_speed[joint]))
