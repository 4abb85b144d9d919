"""Small mechanisms with textbook motion, as robots."""

from __future__ import annotations

import numpy as np

from heelstrike.robot import Robot, RobotBuilder
from heelstrike.robot.files.reading import read_mjcf

PLANAR = """
  <joint name="x" type="slide" axis="1 0 0"/>
  <joint name="z" type="slide" axis="0 0 1"/>
  <joint name="pitch" type="hinge" axis="0 1 0"/>
"""


def _robot(name: str, body: str, gravity: float = 9.81) -> Robot:
    return read_mjcf(
        f"""<mujoco model="{name}">
          <compiler angle="radian" balanceinertia="false"/>
          <option gravity="0 0 {-gravity}"/>
          <worldbody>
            <geom name="ground" type="plane" size="1 1 1"/>
            {body}
          </worldbody>
        </mujoco>"""
    )


def point(mass: float = 1.0, gravity: float = 9.81) -> Robot:
    """Point mass with coordinates x, z: a sphere too small to matter."""
    return _robot(
        "point",
        f"""<body name="point">
          <joint name="x" type="slide" axis="1 0 0"/>
          <joint name="z" type="slide" axis="0 0 1"/>
          <inertial pos="0 0 0" mass="{mass}" diaginertia="1 1 1"/>
          <geom type="sphere" size="1e-12"/>
        </body>""",
        gravity,
    )


def block(
    width: float = 0.1,
    height: float = 0.1,
    mass: float = 1.0,
    inertia: float | None = None,
    gravity: float = 9.81,
) -> Robot:
    """Box with coordinates x, z of its centre and its pitch; a point at each lower corner."""
    if inertia is None:
        inertia = mass * (width**2 + height**2) / 12.0
    return _robot(
        "block",
        f"""<body name="block">
          {PLANAR}
          <inertial pos="0 0 0" mass="{mass}" diaginertia="{inertia} {inertia} {inertia}"/>
          <geom type="box" size="{0.5 * width} 0.5 {0.5 * height}"/>
        </body>""",
        gravity,
    )


def disc(
    radius: float = 0.2, mass: float = 1.0, inertia: float | None = None, gravity: float = 9.81
) -> Robot:
    """Homogeneous disc with coordinates x, z of its centre and its pitch."""
    if inertia is None:
        inertia = 0.5 * mass * radius**2
    return _robot(
        "disc",
        f"""<body name="disc">
          {PLANAR}
          <inertial pos="0 0 0" mass="{mass}" diaginertia="{inertia} {inertia} {inertia}"/>
          <geom type="sphere" size="{radius}"/>
        </body>""",
        gravity,
    )


def rod(length: float = 1.0, mass: float = 1.0, gravity: float = 9.81) -> Robot:
    """Uniform rod, upright at zero pitch, with a point at its lower end."""
    inertia = mass * length**2 / 12.0
    return _robot(
        "rod",
        f"""<body name="rod">
          {PLANAR}
          <inertial pos="0 0 0" mass="{mass}" diaginertia="{inertia} {inertia} 0.01"/>
          <geom type="sphere" size="1e-12" pos="0 0 {-0.5 * length}"/>
        </body>""",
        gravity,
    )


def rimless_wheel(spokes: int = 8, inertia: float = 0.0, gravity: float = 9.81) -> Robot:
    """Hub of 1 kg with massless spokes of 1 m; at zero pitch two of them frame the vertical.

    MuJoCo's parser wants a positive moment of inertia; 0 stands for the smallest that it takes.
    """
    inertia = max(inertia, 1e-12)
    tips = "".join(
        f'<geom type="sphere" size="1e-12" pos="{np.sin(angle)} 0 {-np.cos(angle)}"/>'
        for angle in 2.0 * np.pi / spokes * (np.arange(spokes) + 0.5)
    )
    return _robot(
        "rimless_wheel",
        f"""<body name="wheel">
          {PLANAR}
          <inertial pos="0 0 0" mass="1" diaginertia="{inertia} {inertia} {inertia}"/>
          {tips}
        </body>""",
        gravity,
    )


def compass_gait(gravity: float = 9.8, radius: float = 1e-12) -> Robot:
    """Two legs of 1 m with 5 kg at their middle and 10 kg at the hip, point masses.

    Feet are points, or round: discs of a radius whose lowest points are 1 m from the hip.

    Coordinates are the hip's x and z and the two leg angles, positive when the foot is behind.
    """
    tiny = "1e-12 1e-12 1e-12"
    legs = "".join(
        f"""<body name="{side}_leg">
          <joint name="{side}_hip" type="hinge" axis="0 1 0"/>
          <inertial pos="0 0 -0.5" mass="5" diaginertia="{tiny}"/>
          <geom type="sphere" size="{radius}" pos="0 0 {radius - 1.0}"/>
        </body>"""
        for side in ("left", "right")
    )
    return _robot(
        "compass_gait",
        f"""<body name="hip">
          <joint name="x" type="slide" axis="1 0 0"/>
          <joint name="z" type="slide" axis="0 0 1"/>
          <inertial pos="0 0 0" mass="10" diaginertia="{tiny}"/>
          {legs}
        </body>""",
        gravity,
    )


def four_bar(damping: float = 0.0) -> Robot:
    """Crank, coupler and rocker; the loop is closed between the last two."""
    build = RobotBuilder("four_bar")
    crank = build.hinge(
        "crank", None, mass=1.0, inertia=0.02, center_of_mass=(0, 0.1), damping=damping
    )
    coupler = build.hinge(
        "coupler", crank, at=(0, 0.2), mass=1.5, inertia=0.08, center_of_mass=(0.3, 0.15)
    )
    rocker = build.hinge(
        "rocker", None, at=(0.5, 0), mass=1.2, inertia=0.05, center_of_mass=(0, 0.2)
    )
    build.loop(coupler, rocker, at=(0.5, 0.3))
    return build.build()


def geared(polynomial: tuple[float, ...] = (0.0, 2.0)) -> Robot:
    """Two pendulums side by side, the rear of which follows the front."""
    build = RobotBuilder("geared")
    for name, x in (("front", 0.5), ("rear", 0.0)):
        build.hinge(name, None, at=(x, 0), mass=1.0, inertia=0.01, center_of_mass=(0, -0.3))
    build.couple("rear", "front", polynomial)
    return build.build()


def braked(mass: float = 2.0, length: float = 0.8, inertia: float = 0.05) -> Robot:
    """Pendulum with a brake."""
    build = RobotBuilder("pendulum")
    build.hinge("swing", None, mass=mass, inertia=inertia, center_of_mass=(0.0, -length))
    build.brake("swing")
    return build.build()


def parallel_ankles(sides: tuple[str, ...] = ("right", "left"), dry_friction: float = 0.0) -> Robot:
    """Biped whose ankles are driven from the shank, by a lever and a rod."""
    build = RobotBuilder("parallel_ankles")
    trunk = build.floating_base("trunk", (0, 0.85), mass=20, inertia=1, center_of_mass=(0, 0.2))
    for side in sides:
        thigh = build.hinge(
            f"{side}_hip", trunk, mass=5, inertia=0.07, center_of_mass=(0, -0.2), torque=200,
            dry_friction=dry_friction,
        )  # fmt: skip
        shank = build.hinge(
            f"{side}_knee", thigh, at=(0, -0.4), mass=3, inertia=0.04, center_of_mass=(0, -0.2),
            torque=200, limits=(0.0, 2.0),
        )  # fmt: skip
        foot = build.hinge(
            f"{side}_ankle", shank, at=(0, -0.4), mass=1, inertia=5e-3, center_of_mass=(0.02, -0.03)
        )
        lever = build.hinge(
            f"{side}_motor", shank, at=(0, -0.15), mass=0.3, inertia=1e-3,
            center_of_mass=(-0.02, 0), torque=80,
        )  # fmt: skip
        rod = build.hinge(
            f"{side}_rod", lever, at=(-0.05, 0), mass=0.2, inertia=1e-3, center_of_mass=(0, -0.12)
        )
        build.loop(rod, foot, at=(0, -0.25))
        build.sole(foot, heel=(-0.07, -0.05), toe=(0.15, -0.05))
    return build.build()
