"""Scenes with closed forms, for all engines and for us.

A slope is gravity that leans; the ground is level. Each scene says what is measured at its end, and
what the closed form gives.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from heelstrike.experiments.engine_comparison.entries import Entry
from heelstrike.experiments.engines.peer import InvalidRunError
from heelstrike.experiments.engines.scenario import Scenario
from heelstrike.experiments.engines.served import PATIENCE, served
from heelstrike.field_texts import dataclass
from heelstrike.reader_process import ReaderProcess
from heelstrike.robot import Robot, RobotBuilder, State, load_robot
from heelstrike.robot.model import Floats
from heelstrike.sim.method import Method

GRAVITY = 9.81
FRICTION = 0.75
HALF = 0.1
"""Half the edge of the cube, in m."""
RADIUS = 0.1
"""Of the disc and the ball, in m."""
LEANING = math.atan(FRICTION)
"""Slope (rad) at which a cube is about to slide."""
APART = 0.05
"""How far from that the slopes below and above are, in rad."""


@dataclass(frozen=True, eq=False)
class Scene:
    """Something to simulate whose end is known."""

    name: str
    """What tables call it."""
    scenario: Scenario
    """What is simulated."""
    measured: Callable[[Floats, Floats], float]
    """Takes position and velocity of the end, returns what is measured."""
    exact: float
    """The same by the closed form."""
    unit: str
    """Its unit."""
    source: str
    """The closed form, in words."""


def cube() -> Robot:
    """Return a cube of 2 kg with an edge of 0.2 m, which touches the ground by its corners."""
    builder = RobotBuilder("cube", gravity=GRAVITY)
    inertia = 2.0 * (2.0 * HALF) ** 2 / 6.0
    body = builder.floating_base("body", (0.0, HALF), mass=2.0, inertia=inertia)
    for x in (-HALF, HALF):
        for z in (-HALF, HALF):
            builder.contact(body, at=(x, z))
    return builder.build()


def disc(share: float = 0.5) -> Robot:
    """Return a disc of 1 kg and a radius of 0.1 m.

    Parameters
    ----------
    share : float
        Its moment of inertia, in mass times the square of its radius; 0.5 is that of a full disc.
    """
    builder = RobotBuilder("disc", gravity=GRAVITY)
    body = builder.floating_base("body", (0.0, RADIUS), mass=1.0, inertia=share * RADIUS**2)
    builder.contact(body, at=(0.0, 0.0), radius=RADIUS)
    return builder.build()


def leaning(robot: Robot, angle: float) -> Robot:
    """Return a robot whose gravity leans forward by an angle (rad): its ground is a slope.

    Parameters
    ----------
    robot : Robot
        The robot.
    angle : float
        How far the slope descends along +x.
    """
    gravity = GRAVITY * np.array([math.sin(angle), -math.cos(angle)])
    return replace(robot, model=robot.model.replaced(gravity=gravity))


def scenes() -> tuple[Scene, ...]:
    """Return all scenes."""
    return (
        *(_on_slope(name, angle) for name, angle in _SLOPES),
        _launched(),
        _on_a_corner(),
        _rocking(),
        *(_bouncing(restitution) for restitution in (0.9, 0.5, 0.0)),
        _rolling(),
        *(_slipping(share) for share in (0.5, 1.0)),
        _rimless(),
        _rimless_beside_its_cycle(),
    )


_SLOPES = (
    ("cube below the angle of friction", LEANING - APART),
    ("cube at the angle of friction", LEANING),
    ("cube above the angle of friction", LEANING + APART),
)


def _on_slope(name: str, angle: float) -> Scene:
    robot = leaning(cube(), angle)
    duration = 1.0
    pull = max(0.0, math.sin(angle) - FRICTION * math.cos(angle)) * GRAVITY
    start = robot.reference_state()
    return Scene(
        name, Scenario(name, robot, start, duration, friction=FRICTION),
        lambda q, _: float(q[0]), 0.5 * pull * duration**2, "m",
        f"it slides by ½ g (sin β − μ cos β) t² in t = {duration:g} s"
        if pull > 1e-9
        else "it stays",
    )  # fmt: skip


def _launched() -> Scene:
    robot, speed = cube(), 6.0
    name = "cube launched flat"
    start = State(robot.model.reference, np.array([speed, 0.0, 0.0]))
    return Scene(
        name, Scenario(name, robot, start, 1.0, friction=FRICTION),
        lambda q, _: float(q[0]), speed**2 / (2.0 * FRICTION * GRAVITY), "m",
        "it stops after v² / (2 μ g)",
    )  # fmt: skip


def _turning(body: Robot, arm: float) -> tuple[float, float]:
    """Return m g R / I and m R² / I of a body that turns about a point at a distance R (m)."""
    mass, inertia = float(body.model.mass.sum()), float(body.model.inertia.sum())
    about = inertia + mass * arm**2
    return mass * GRAVITY * arm / about, mass * arm**2 / about


def _on_a_corner() -> Scene:
    """A cube that is thrown turning, and lands on a corner right below its centre."""
    robot, arm = cube(), math.sqrt(2.0) * HALF
    pull, share = _turning(robot, arm)
    speed, rate, falling = 1.0, 2.0, 0.1
    q = robot.model.reference + np.array(
        [0.0, arm - HALF + 0.5 * GRAVITY * falling**2, 0.25 * math.pi - rate * falling]
    )
    # Angular momentum about the corner is kept: I ω + m R v = (I + m R²) ω⁺.
    after = (1.0 - share) * rate + share * speed / arm
    name = "cube thrown onto a corner"
    return Scene(
        name,
        Scenario(
            name, robot, State(q, np.array([speed, 0.0, rate])), falling + 0.08, friction=FRICTION
        ),
        lambda q, v: _upright_rate(float(q[2]) - 0.25 * math.pi, float(v[2]), pull),
        after, "rad/s",
        "rate ω when it is upright on its corner. The landing conserves the angular momentum "
        "about the corner; then ½ I ω² + m g R cos φ is constant",
    )  # fmt: skip


def _upright_rate(lean: float, rate: float, pull: float) -> float:
    """Rate at which an inverted pendulum, now at a lean (rad), was or will be upright."""
    return math.sqrt(max(0.0, rate**2 - 2.0 * pull * (1.0 - math.cos(lean))))


ROCKING_HEIGHT = 0.5
"""Half the height of the block, in m; half its width is `HALF`."""
TILT = 0.12
"""Angle (rad) at which the block is let go, of 0.197 at which it would stand on its corner."""


def _rocking() -> Scene:
    """A slender block that rocks from corner to corner."""
    corner, arm = math.atan(HALF / ROCKING_HEIGHT), math.hypot(HALF, ROCKING_HEIGHT)
    builder = RobotBuilder("block", gravity=GRAVITY)
    body = builder.floating_base(
        "body", (0.0, ROCKING_HEIGHT), mass=2.0, inertia=2.0 * arm**2 / 3.0
    )
    for x in (-HALF, HALF):
        builder.contact(body, at=(x, -ROCKING_HEIGHT))
    robot = builder.build()
    pull, share = _turning(robot, arm)
    kept = 1.0 - 2.0 * share * math.sin(corner) ** 2
    landing = math.sqrt(2.0 * pull * (math.cos(corner - TILT) - math.cos(corner)))
    # It leans forward on its front corner, which stays where it is.
    q = np.array(
        [
            HALF - arm * math.sin(corner - TILT), arm * math.cos(corner - TILT), TILT
        ]
    )  # fmt: skip
    name = "block that rocks"
    return Scene(
        name, Scenario(name, robot, State(q, np.zeros(3)), 0.75, friction=FRICTION),
        lambda q, v: math.sqrt(
            max(
                0.0,
                float(v[2]) ** 2
                + 2.0 * pull * (math.cos(corner - abs(float(q[2]))) - math.cos(corner)),
            )
        ),
        kept * landing, "rad/s",
        "rate after its first landing: the rate before it, times 1 − 2 m R² sin² α / I "
        "(Housner 1963)",
    )  # fmt: skip


def _bouncing(restitution: float) -> Scene:
    robot, height, duration = disc(), 0.5, 0.8
    name = f"ball bouncing, e = {restitution:g}"
    q = robot.model.reference + np.array([0.0, height, 0.0])
    return Scene(
        name,
        Scenario(
            name, robot, State(q, np.zeros(3)), duration, friction=FRICTION,
            restitution=restitution,
        ),
        lambda q, _: float(q[1]) - RADIUS, _height(height, restitution, duration), "m",
        f"height after {duration:g} s; every bounce leaves e times the speed",
    )  # fmt: skip


def _height(height: float, restitution: float, time: float) -> float:
    """Height of a ball that was dropped, some time later."""
    fall = math.sqrt(2.0 * height / GRAVITY)
    if time < fall:
        return height - 0.5 * GRAVITY * time**2
    left, speed = time - fall, restitution * GRAVITY * fall
    while speed > 0.0:
        flight = 2.0 * speed / GRAVITY
        if left < flight:
            return speed * left - 0.5 * GRAVITY * left**2
        left, speed = left - flight, restitution * speed
        if flight < 1e-9:
            break
    return 0.0


def _rolling() -> Scene:
    robot, speed, duration = disc(), 1.0, 2.0
    name = "disc rolling"
    v = np.array([speed, 0.0, speed / RADIUS])
    return Scene(
        name, Scenario(name, robot, State(robot.model.reference, v), duration, friction=FRICTION),
        lambda q, _: float(q[0]), speed * duration, "m",
        "nothing slows it down",
    )  # fmt: skip


def _slipping(share: float) -> Scene:
    robot, speed, duration = disc(share), 3.0, 1.0
    name = f"disc slipping, then rolling, I = {share:g} m r²"
    v = np.array([speed, 0.0, 0.0])
    until = speed / (FRICTION * GRAVITY * (1.0 + 1.0 / share))
    slowed = speed - FRICTION * GRAVITY * until
    way = 0.5 * (speed + slowed) * until + slowed * (duration - until)
    return Scene(
        name, Scenario(name, robot, State(robot.model.reference, v), duration, friction=FRICTION),
        lambda q, _: float(q[0]), way, "m",
        "friction slows it down until v = ω r, after v / (μ g (1 + m r² / I))",
    )  # fmt: skip


SPOKES = 8
DESCENT = math.radians(8.0)


def _wheel() -> tuple[Robot, float, float, float]:
    """Return a rimless wheel on its slope, and three numbers of its walk.

    They are the share m / (m + I), the part of ω² that a landing keeps, and ω² just after a landing
    on the walk that repeats. The library's wheel has 1e-6 kg m² about its hub, which is in the
    formulas here.
    """
    half = math.pi / SPOKES
    robot = leaning(load_robot("rimless_wheel"), DESCENT)
    mass, inertia = float(robot.model.mass.sum()), float(robot.model.inertia.sum())
    kept = ((mass * math.cos(2.0 * half) + inertia) / (mass + inertia)) ** 2
    share = mass / (mass + inertia)
    gained = 4.0 * share * GRAVITY * math.sin(half) * math.sin(DESCENT)
    return robot, share, kept, gained * kept / (1.0 - kept)


def _landed(robot: Robot, rate: float) -> State:
    """Return a wheel that has just landed on a spoke, turning at a rate (rad/s)."""
    lean = -math.pi / SPOKES
    return robot.state(
        {"root_x": math.sin(lean), "root_z": math.cos(lean), "root_pitch": 0.0},
        {
            "root_x": math.cos(lean) * rate,
            "root_z": -math.sin(lean) * rate,
            "root_pitch": rate,
        },
    )


def _rimless() -> Scene:
    """A rimless wheel on its walk that repeats, whose speed has a closed form."""
    robot, share, kept, squared = _wheel()
    name = "rimless wheel on its limit cycle"
    return Scene(
        name, Scenario(name, robot, _landed(robot, math.sqrt(squared)), 4.0, friction=FRICTION),
        partial(_landing_rate, half=math.pi / SPOKES, share=share),
        math.sqrt(squared / kept), "rad/s",
        "rate just before a landing: ω² = 4 g sin α sin γ / (r (1 − cos² 2α)) (Coleman 1998)",
    )  # fmt: skip


FASTER = 1.2
"""How many times faster than on its limit cycle a wheel is pushed off."""
LANDINGS, BACK = 2, 1.2
"""How often that wheel lands, and in how many seconds."""


def _rimless_beside_its_cycle() -> Scene:
    """A rimless wheel that comes back to its limit cycle: its Floquet multiplier."""
    robot, share, kept, squared = _wheel()
    half = math.pi / SPOKES
    start = _landed(robot, FASTER * math.sqrt(squared))

    def multiplier(q: Floats, v: Floats) -> float:
        before = _landing_rate(q, v, half, share) ** 2
        beside = (kept * before - squared) / (squared * (FASTER**2 - 1.0))
        return math.copysign(abs(beside) ** (1.0 / (LANDINGS + 1)), beside)

    name = "rimless wheel beside its limit cycle"
    return Scene(
        name, Scenario(name, robot, start, BACK, friction=FRICTION), multiplier, kept, "",
        "the Floquet multiplier of ω², cos² 2α (McGeer 1990). It is measured by what remains of a "
        f"disturbance after {LANDINGS} landings",
    )  # fmt: skip


def _landing_rate(q: Floats, v: Floats, half: float, share: float) -> float:
    """Rate at which a wheel of spokes of 1 m that turns about the lowest will land on the next.

    `share` is its mass in that with its moment of inertia.
    """
    lean = float(q[2]) % (2.0 * half) - half
    down = share * GRAVITY * (math.cos(lean + DESCENT) - math.cos(half + DESCENT))
    return math.sqrt(max(0.0, float(v[2]) ** 2 + 2.0 * down))


def scene_error(
    scene: Scene,
    entry: Entry,
    step: float,
    given: Mapping[str, Any],
    process: ReaderProcess | None = None,
    patience: float = PATIENCE,
) -> tuple[float, float]:
    """Simulate a scene in an engine.

    Parameters
    ----------
    scene : Scene
        The scene.
    entry : Entry
        The engine's row.
    step : float
        Seconds.
    given : mapping
        Settings of the engine.
    process : ReaderProcess, optional
        Where the engine has been before.
    patience : float
        Seconds that it may take before it counts as hung.

    Returns
    -------
    error : float
        What is measured less what the closed form gives.
    seconds : float
        Computing time.

    Raises
    ------
    InvalidRunError
        If the engine is missing, ends, hangs or refuses, or takes no restitution.
    """
    if scene.scenario.restitution and not entry.bounces:
        raise InvalidRunError("takes no coefficient of restitution")
    peer = served(entry.package, scene.scenario, step, process=process, patience=patience, **given)
    try:
        peer.restart()
        rows = peer.record(peer.steps)
    finally:
        peer.close()
    nq = scene.scenario.robot.nq
    end = rows[-1]
    found = scene.measured(end[:nq], end[nq : nq + scene.scenario.robot.nv])
    return found - scene.exact, peer.seconds


def our_scene_error(scene: Scene, method: Method) -> tuple[float, float]:
    """Simulate a scene by a method of ours; return error and time as of :func:`scene_error`.

    Parameters
    ----------
    scene : Scene
        The scene.
    method : Method
        The simulation method.
    """
    run = scene.scenario.run(method)
    return scene.measured(run.position[-1], run.velocity[-1]) - scene.exact, run.timing.wall_s
