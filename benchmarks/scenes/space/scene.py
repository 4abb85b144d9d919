"""What a scene in space is, and the random scene of a seed.

``random_space_scene(seed)`` depends on the seed alone. In words, each scene draws:

- a **tree** of 1 to 8 bodies; three of four float, the others hang from the world. A body's parent
  is one of the three before it. Joints are hinges about any axis (five of eight), slides, balls,
  or a hinge in a slide. Bodies are 0.1 to 0.4 m long and weigh 0.3 to 6 kg (log-uniform), their
  tensor of inertia is that of four masses about the middle and of a small ball. One joint in five
  has armature.
- **contacts**: bodies on which no other hangs end in a sphere, a capsule, a box (eight points) or
  a disc that stands on its rim; others in one case of four. At most 24 points.
- **joint forces**: dampers (half of the joints, and all balls: forces of gyration act as at the
  beginning of a step, and what spins at 100 rad/s gains energy by them), springs (a third), dry
  friction (a quarter), stops (two of five, either side of the pose; balls, too), all small enough
  for a step of 1 ms.
- **motors** on hinges and slides (three of five), which give constant torques in a third of the
  scenes and hold the pose by springs and dampers in another third. A third of the scenes have one
  or two **pushes** of up to half the weight for 50 to 300 ms.
- a **ground**: level (40 %), sloping up to 0.4 rad any way (30 %), or with one to four boxes on it,
  turned, pitched or set as stairs (30 %); there spheres take the place of discs. Friction is zero
  (10 %), up to 1, or up to 2 (15 %); there is restitution of 0.1 to 0.9 in a third of the scenes.
- a **start**: a third rest on the ground with their lowest point, the others fall from up to 0.3 m,
  turned at random, at about 1 rad/s and 1 m/s. Nothing penetrates, no joint is beyond its stops.

One scene in ten is **degenerate on purpose** and says so in its `kind`: ``flat fall`` (a box that
falls without turning), ``twin points`` (two spheres a micron apart), ``at a stop`` (joints that
begin at their stops), ``light toe`` (a last body of 20 g), ``upright rod`` (a thin rod that stands
on its end).
"""

from __future__ import annotations

import tempfile
import warnings
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import heelstrike as hs
from heelstrike.robot import RobotWarning
from scenes.space.ground import Block, Terrain
from scenes.space.mechanics import SpatialPoses, SpatialTree

Array = NDArray[Any]
Triple = tuple[float, float, float]
Four = tuple[float, float, float, float]

DEGENERATE = ("flat fall", "twin points", "at a stop", "light toe", "upright rod")
MOST_CONTACTS = 24
GRAVITY = 9.81
SALT = 20_261_128
"""Stands beside every seed, so that other generators with the same seeds draw other numbers."""


@dataclass(frozen=True)
class Joint:
    """A joint of a body, in the words of MJCF; `range` has one number for a ball."""

    name: str
    kind: str
    axis: Triple = (0.0, 0.0, 1.0)
    armature: float = 0.0
    damping: float = 0.0
    stiffness: float = 0.0
    rest: float = 0.0
    friction: float = 0.0
    range: tuple[float, float] | None = None
    motor: float = 0.0
    """Greatest torque, zero for none."""


@dataclass(frozen=True)
class Shape:
    """What of a body touches the ground: a geom of MJCF."""

    kind: str
    size: tuple[float, ...]
    at: Triple
    turn: Four = (1.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Body:
    """A body and the joints that move it, in order; none float freely."""

    name: str
    parent: int
    at: Triple
    turn: Four
    joints: tuple[Joint, ...]
    mass: float
    center: Triple
    inertia: tuple[float, ...]
    """xx, yy, zz, xy, xz, yz."""
    shapes: tuple[Shape, ...] = ()


@dataclass(frozen=True)
class Shove:
    """A push on a body."""

    body: str
    point: Triple
    force: Triple
    start: float
    duration: float


@dataclass(frozen=True)
class BoxOnGround:
    """A box, in the words of `heelstrike.Box`."""

    center: Triple
    size: Triple
    yaw: float = 0.0
    pitch: float = 0.0


@dataclass(frozen=True)
class SpaceScene:
    """Everything about a scene but the way through time; joints and velocities go by their names.

    Of a floating robot the first body moves freely, and its place and turn are in `q`.
    """

    seed: int
    kind: str
    floating: bool
    bodies: tuple[Body, ...]
    normal: Triple
    friction: float
    restitution: float
    boxes: tuple[BoxOnGround, ...] = ()
    q: dict[str, float] = field(default_factory=dict)
    v: dict[str, float] = field(default_factory=dict)
    torque: dict[str, float] = field(default_factory=dict)
    kp: float = 0.0
    kd: float = 0.0
    """kp, kd: Of the motors that hold the pose; zero where they do not."""
    shoves: tuple[Shove, ...] = ()

    def mjcf(self) -> str:
        """Return the robot's file."""
        children: dict[int, list[int]] = {}
        for i, body in enumerate(self.bodies):
            children.setdefault(body.parent, []).append(i)

        def text(i: int) -> str:
            body = self.bodies[i]
            free = '<freejoint name="root"/>' if self.floating and i == 0 else ""
            return (
                f'<body name="{body.name}" pos="{_words(body.at)}" quat="{_words(body.turn)}">'
                + free
                + "".join(map(_joint, body.joints))
                + f'<inertial pos="{_words(body.center)}" mass="{body.mass!r}" '
                f'fullinertia="{_words(body.inertia)}"/>'
                + "".join(map(_shape, body.shapes))
                + "".join(text(child) for child in children.get(i, []))
                + "</body>"
            )

        motors = "".join(
            f'<motor name="{joint.name}" joint="{joint.name}" ctrllimited="true" '
            f'ctrlrange="{-joint.motor!r} {joint.motor!r}"/>'
            for body in self.bodies
            for joint in body.joints
            if joint.motor
        )
        return (
            f'<mujoco model="space{self.seed}"><compiler angle="radian" autolimits="true"/>'
            f'<option gravity="0 0 {-GRAVITY}"/><worldbody>'
            + "".join(text(i) for i in children[-1])
            + f"</worldbody><actuator>{motors}</actuator></mujoco>"
        )

    def robot(self) -> Any:
        """Read the robot."""
        with warnings.catch_warnings(), tempfile.TemporaryDirectory() as folder:
            warnings.simplefilter("ignore", RobotWarning)
            path = Path(folder) / "robot.xml"
            path.write_text(self.mjcf(), encoding="utf-8")
            return hs.load_robot(path, dimension=3)

    def ground(self) -> hs.SpatialGround:
        """Lay the ground."""
        boxes = tuple(
            hs.Box(center=one.center, size=one.size, yaw=one.yaw, pitch=one.pitch)
            for one in self.boxes
        )
        return hs.SpatialGround(
            friction=self.friction, restitution=self.restitution, normal=self.normal, boxes=boxes
        )

    def terrain(self) -> Terrain:
        """Return the ground as the judge measures it."""
        return Terrain(np.array(self.normal), 0.0, tuple(map(_block, self.boxes)))

    def state(self, robot: Any) -> hs.State:
        """Return where it begins."""
        state: hs.State = robot.state(self.q, self.v)
        return state

    def controller(self, robot: Any) -> Any:
        """Return what moves the joints."""
        if not robot.nu:
            return None
        hold = hs.HoldPosture(
            robot, kp=self.kp, kd=self.kd, posture=self.state(robot).q, gravity=False
        )
        return hold if self.kp else Constant([self.torque[name] for name in robot.actuator_names])

    def pushes(self) -> tuple[hs.Push, ...]:
        """Return what pushes."""
        return tuple(
            hs.Push(one.body, force=one.force, start=one.start, duration=one.duration,
                    point=one.point)
            for one in self.shoves
        )  # fmt: skip


class Constant:
    """Constant torques."""

    def __init__(self, torque: list[float]) -> None:
        self._torque = np.array(torque)

    def torque(self, t: float, state: Any, contacts: Any) -> Array:  # noqa: ARG002
        """Return them."""
        return self._torque


def _words(values: Any) -> str:
    return " ".join(repr(float(value)) for value in np.ravel(values))


def _joint(joint: Joint) -> str:
    text = f'<joint name="{joint.name}" type="{joint.kind}"'
    if joint.kind != "ball":
        text += f' axis="{_words(joint.axis)}"'
        if joint.stiffness:
            text += f' springref="{joint.rest!r}"'
    if joint.range is not None:
        text += f' range="{_words(joint.range)}"'
    numbers = {
        "armature": joint.armature, "damping": joint.damping, "stiffness": joint.stiffness,
        "frictionloss": joint.friction,
    }  # fmt: skip
    return text + "".join(f' {name}="{value!r}"' for name, value in numbers.items() if value) + "/>"


def _shape(shape: Shape) -> str:
    return (
        f'<geom type="{shape.kind}" size="{_words(shape.size)}" pos="{_words(shape.at)}" '
        f'quat="{_words(shape.turn)}"/>'
    )


def _block(box: BoxOnGround) -> Block:
    c, s = np.cos(box.yaw), np.sin(box.yaw)
    a, b = np.cos(box.pitch), np.sin(box.pitch)
    axes = np.array([[c * a, s * a, -b], [-s, c, 0.0], [c * b, s * b, a]])
    return Block(np.array(box.center), axes, 0.5 * np.array(box.size))


class _Draw:
    """Random numbers of a scene."""

    def __init__(self, seed: int) -> None:
        self.of = np.random.default_rng([SALT, seed])

    def chance(self, share: float) -> bool:
        return bool(self.of.random() < share)

    def between(self, low: float, high: float) -> float:
        return float(self.of.uniform(low, high))

    def unit(self, size: int) -> tuple[float, ...]:
        vector = self.of.normal(size=size)
        return tuple((vector / np.linalg.norm(vector)).tolist())

    def vector(self, scale: float) -> Triple:
        x, y, z = (scale * self.of.normal(size=3)).tolist()
        return x, y, z


def random_space_scene(seed: int) -> SpaceScene:
    """Draw the scene of a seed."""
    draw = _Draw(seed)
    kind = str(draw.of.choice(DEGENERATE)) if draw.chance(0.1) else "ordinary"
    scene = _lone(draw, seed, kind) if kind in ("flat fall", "upright rod") else None
    if scene is None:
        scene = _tree(draw, seed, kind)
    return _placed(draw, _acted_upon(draw, _grounded(draw, scene)))


def _inertia(draw: _Draw, mass: float, length: float) -> tuple[float, ...]:
    """Tensor of four equal masses about a place, so that it is a possible one."""
    points = 0.35 * length * draw.of.normal(size=(4, 3))
    points -= points.mean(axis=0)
    tensor = sum(0.25 * mass * (p @ p * np.eye(3) - np.outer(p, p)) for p in points)
    tensor = tensor + 0.03 * mass * length**2 * np.eye(3)
    return tuple(float(tensor[i, j]) for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)))


def _least_inertia(inertia: tuple[float, ...]) -> float:
    xx, yy, zz, xy, xz, yz = inertia
    return float(np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])[0])


def _new_joint(draw: _Draw, name: str, kind: str, mass: float, inertia: float) -> Joint:
    """Draw a joint whose forces change what it moves by no more than a step of 1 ms resolves."""
    moved = mass if kind == "slide" else inertia
    ball = kind == "ball"
    limit = None
    if draw.chance(0.4):
        reach = 0.1 if kind == "slide" else 1.0
        low, high = -reach * draw.between(0.1, 1.5), reach * draw.between(0.1, 1.5)
        limit = (0.0, high) if ball else (low, high)
    axis = draw.unit(3)
    return Joint(
        name, kind, (axis[0], axis[1], axis[2]),
        armature=draw.between(0.1, 1.0) * moved if draw.chance(0.2) else 0.0,
        damping=draw.between(2.0, 20.0) * moved if ball or draw.chance(0.5) else 0.0,
        stiffness=draw.between(1.0, 20.0) ** 2 * moved if draw.chance(1 / 3) else 0.0,
        rest=0.0 if ball else draw.between(-0.5, 0.5),
        friction=draw.between(0.1, 3.0) * (mass if kind == "slide" else 0.1 * mass)
        if draw.chance(0.25) and not ball else 0.0,
        range=limit,
        motor=draw.between(1.0, 10.0) * mass if not ball and draw.chance(0.6) else 0.0,
    )  # fmt: skip


def _new_shape(draw: _Draw, kind: str, at: Triple) -> Shape:
    size = {
        "sphere": (draw.between(0.01, 0.08),),
        "capsule": (draw.between(0.01, 0.04), draw.between(0.03, 0.12)),
        "box": tuple(draw.between(0.03, 0.12) for _ in range(3)),
        "cylinder": (draw.between(0.04, 0.12), draw.between(0.005, 0.02)),
    }[kind]
    w, x, y, z = draw.unit(4)
    return Shape(kind, size, at, (w, x, y, z))


def _tree(draw: _Draw, seed: int, kind: str) -> SpaceScene:
    count, floating = int(draw.of.integers(1, 9)), draw.chance(0.75)
    bodies: list[Body] = []
    lengths: list[float] = []
    for i in range(count):
        parent = -1 if i == 0 else int(draw.of.integers(max(0, i - 3), i))
        length = draw.between(0.1, 0.4)
        mass = float(np.exp(draw.between(np.log(0.3), np.log(6.0))))
        if kind == "light toe" and i == count - 1 and i > 0:
            mass = 0.02
        inertia = _inertia(draw, mass, length)
        names = draw.of.choice(
            ["hinge", "slide", "ball", "slide hinge"], p=[0.625, 0.125, 0.125, 0.125]
        ).split()
        joints = [
            _new_joint(draw, f"joint{i}{'ab'[k]}", each, mass, _least_inertia(inertia))
            for k, each in enumerate(names)
        ]
        w, x, y, z = draw.unit(4)
        at = draw.unit(3)
        reach = 0.0 if parent < 0 else lengths[parent]
        bodies.append(Body(
            f"body{i}", parent, (reach * at[0], reach * at[1], reach * at[2]), (w, x, y, z),
            () if floating and i == 0 else tuple(joints), mass, draw.vector(0.3 * length), inertia,
        ))  # fmt: skip
        lengths.append(length)
    last = {body.parent for body in bodies}
    points = 0
    for i in reversed(range(count)):
        if i in last and not draw.chance(0.25):
            continue
        shape = str(draw.of.choice(["sphere", "capsule", "box", "cylinder"]))
        points += {"sphere": 1, "capsule": 2, "box": 8, "cylinder": 2}[shape]
        if points > MOST_CONTACTS:
            break
        x, y, z = draw.unit(3)
        at = lengths[i] * x, lengths[i] * y, lengths[i] * z
        shapes = [_new_shape(draw, shape, at)]
        if kind == "twin points" and i == count - 1:
            shapes = [Shape("sphere", (0.02,), (at[0] + e, at[1], at[2])) for e in (0.0, 1e-6)]
        bodies[i] = replace(bodies[i], shapes=tuple(shapes))
    return SpaceScene(seed, kind, floating, tuple(bodies), (0.0, 0.0, 1.0), 0.5, 0.0)


def _lone(draw: _Draw, seed: int, kind: str) -> SpaceScene:
    """A single body that falls flat, or a rod that stands on its end."""
    half = (0.02, 0.02, draw.between(0.2, 0.5)) if kind == "upright rod" else tuple(
        draw.between(0.05, 0.2) for _ in range(3)
    )  # fmt: skip
    mass = draw.between(0.5, 5.0)
    square = np.array(half) ** 2
    moments = tuple(float(mass / 3.0 * (square.sum() - each)) for each in square)
    body = Body(
        "body0", -1, (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), (), mass, (0.0, 0.0, 0.0),
        (*moments, 0.0, 0.0, 0.0), (Shape("box", half, (0.0, 0.0, 0.0)),),
    )  # fmt: skip
    return SpaceScene(seed, kind, True, (body,), (0.0, 0.0, 1.0), 0.5, 0.0)


def _grounded(draw: _Draw, scene: SpaceScene) -> SpaceScene:
    what = draw.of.random()
    normal, boxes = (0.0, 0.0, 1.0), ()
    if what > 0.7:
        boxes = _stairs(draw) if draw.chance(0.4) else tuple(
            BoxOnGround(
                (draw.between(-0.6, 0.6), draw.between(-0.6, 0.6), draw.between(0.0, 0.15)),
                (draw.between(0.2, 1.0), draw.between(0.2, 1.0), draw.between(0.1, 0.4)),
                yaw=draw.between(-np.pi, np.pi),
                pitch=draw.between(-0.4, 0.4) if draw.chance(0.5) else 0.0,
            )
            for _ in range(int(draw.of.integers(1, 4)))
        )  # fmt: skip
    elif what > 0.4:
        tilt, way = draw.between(0.0, 0.4), draw.between(-np.pi, np.pi)
        normal = (
            float(np.sin(tilt) * np.cos(way)), float(np.sin(tilt) * np.sin(way)),
            float(np.cos(tilt)),
        )  # fmt: skip
    rough = draw.of.random()
    friction = (
        0.0 if rough < 0.1 else draw.between(1.0, 2.0) if rough > 0.85 else draw.between(0, 1)
    )
    restitution = draw.between(0.1, 0.9) if draw.chance(1 / 3) else 0.0
    bodies = tuple(map(_without_discs, scene.bodies)) if boxes else scene.bodies
    return replace(
        scene, bodies=bodies, normal=normal, boxes=boxes, friction=friction, restitution=restitution
    )


def _without_discs(body: Body) -> Body:
    """Have a sphere for each disc: at edges of boxes the rim of a disc is met only nearly."""
    return replace(body, shapes=tuple(
        Shape("sphere", one.size[:1], one.at) if one.kind == "cylinder" else one
        for one in body.shapes
    ))  # fmt: skip


def _stairs(draw: _Draw) -> tuple[BoxOnGround, ...]:
    """Steps that lead up along x, each a box to the end of the stairs."""
    rise, tread, count = (
        draw.between(0.03, 0.15),
        draw.between(0.2, 0.4),
        int(draw.of.integers(2, 5)),
    )
    start = draw.between(-0.6, 0.2)
    return tuple(
        BoxOnGround(
            (start + 0.5 * (k + count) * tread, 0.0, (k + 0.5) * rise),
            ((count - k) * tread, 3.0, rise),
        )
        for k in range(count)
    )


def _acted_upon(draw: _Draw, scene: SpaceScene) -> SpaceScene:
    """Draw what motors do, and pushes."""
    weight = GRAVITY * sum(body.mass for body in scene.bodies)
    least = min((body.mass for body in scene.bodies), default=1.0)
    how = draw.of.random()
    torque = {
        joint.name: draw.between(-0.5, 0.5) * joint.motor if how < 1 / 3 else 0.0
        for body in scene.bodies for joint in body.joints if joint.motor
    }  # fmt: skip
    held = how > 2 / 3
    inertia = min((_least_inertia(body.inertia) for body in scene.bodies), default=1e-3)
    shoves = []
    for _ in range(int(draw.of.integers(1, 3)) if draw.chance(1 / 3) else 0):
        body = scene.bodies[int(draw.of.integers(len(scene.bodies)))]
        x, y, z = draw.unit(3)
        size = draw.between(0.05, 0.5) * min(weight, 20.0 * GRAVITY * least)
        shoves.append(Shove(
            body.name, draw.vector(0.05), (size * x, size * y, size * z), draw.between(0.0, 0.7),
            draw.between(0.05, 0.3),
        ))  # fmt: skip
    return replace(
        scene, torque=torque, shoves=tuple(shoves),
        kp=min(draw.between(1.0, 20.0) ** 2 * inertia, 200.0) if held else 0.0,
        kd=min(draw.between(0.0, 20.0) * inertia, 5.0) if held else 0.0,
    )  # fmt: skip


def _placed(draw: _Draw, scene: SpaceScene) -> SpaceScene:
    """Draw where the robot begins: on the ground with its lowest point, or above it."""
    q: dict[str, float] = {}
    v: dict[str, float] = {}
    still = scene.kind in ("flat fall", "upright rod")
    if scene.floating:
        unit = (1.0, 0.0, 0.0, 0.0) if still else draw.unit(4)
        q = dict(zip(("root_x", "root_y"), (draw.of.uniform(-0.3, 0.3, 2)).tolist(), strict=True))
        q |= {f"root_q{name}": part for name, part in zip("wxyz", unit, strict=True)}
        size = 0.0 if still else 1.0
        for name, part in zip(
            ("vx", "vy", "vz"), (0.5 * draw.of.normal(size=3)).tolist(), strict=True
        ):
            v[f"root_{name}"] = 0.0 if scene.kind == "upright rod" else part
        for name in ("wx", "wy", "wz"):
            v[f"root_{name}"] = size * float(draw.of.normal())
    for body in scene.bodies:
        for joint in body.joints:
            if joint.kind == "ball":
                turned = 0.5 * draw.of.normal(size=3)
                most = 0.9 * joint.range[1] if joint.range else np.inf
                angle = float(np.linalg.norm(turned))
                turned = turned * min(1.0, most / max(angle, 1e-9))
                angle = float(np.linalg.norm(turned))
                sine = 0.5 * np.sinc(0.5 * angle / np.pi)
                parts = (float(np.cos(0.5 * angle)), *(sine * turned).tolist())
                q |= {f"{joint.name}_q{n}": part for n, part in zip("wxyz", parts, strict=True)}
                v |= {f"{joint.name}_w{n}": float(draw.of.normal()) for n in "xyz"}
                continue
            reach = 0.1 if joint.kind == "slide" else 1.0
            low, high = joint.range or (-reach, reach)
            at = draw.between(max(low, -reach), min(high, reach))
            if scene.kind == "at a stop" and joint.range:
                at = draw.of.choice([low, high])
            q[joint.name] = float(at)
            v[joint.name] = reach * float(draw.of.normal())
    placed = replace(scene, q=q, v=v)
    rests = draw.chance(1 / 3)
    height = 0.0 if rests or scene.kind == "upright rod" else draw.between(0.0, 0.3)
    return _lifted(placed, height)


def lowest_gap(scene: SpaceScene, robot: Any, q: Array) -> float:
    """Least distance of the contact points to the ground; infinite without any."""
    model = robot.model
    poses = SpatialPoses(SpatialTree(model), q[None])
    return float(np.min(gaps_of(scene.terrain(), poses, model)[0], initial=np.inf))


def gaps_of(terrain: Terrain, poses: SpatialPoses, model: Any) -> tuple[Array, Array, Array]:
    """Distance (f, T, nc) of contact points to the plane and each box, ways away, and points."""
    center = poses.points(model.contact_link, model.contact_position)
    straight, away = terrain.distances(center)
    axis = np.einsum(
        "tpij,pj->tpi", poses.rotation[:, model.contact_link], np.asarray(model.contact_axis)
    )
    down = np.einsum("tpi,ftpi->ftp", axis, away)[..., None] * axis - away
    length = np.linalg.norm(down, axis=-1, keepdims=True)
    down = np.where(length > 1e-12, down / np.where(length > 1e-12, length, 1.0), 0.0)
    rim, radius = model.contact_rim[:, None], model.contact_radius[:, None]
    point = center + rim * down - radius * away
    found = [terrain.distances(each) for each in point]
    # A sphere is as near as its middle less its radius, a rim as its lowest point.
    round_one = model.contact_rim == 0.0
    gap = np.stack([gaps[f] for f, (gaps, _) in enumerate(found)])
    normal = np.stack([ways[f] for f, (_, ways) in enumerate(found)])
    gap = np.where(round_one, straight - model.contact_radius, gap)
    return gap, np.where(round_one[:, None], away, normal), point


def _lifted(scene: SpaceScene, height: float) -> SpaceScene:
    """Lift a robot until nothing is in the ground; one that hangs from the world at its root."""
    robot = scene.robot()
    first = scene.bodies[0]
    for _ in range(60):
        least = lowest_gap(scene, robot, scene.state(robot).q)
        if np.isinf(least) or 0.0 <= least < 1e-9:
            break
        # On a slope or beside a box the way up is longer than the gap.
        rise = -least if least > 0.0 else max(-1.5 * least, 1e-6)
        if least > 0.0 and (scene.boxes or not scene.floating):
            break  # it may hang over something else
        rise = rise / scene.normal[2] if least > 0.0 else rise
        if scene.floating:
            scene = replace(scene, q=scene.q | {"root_z": scene.q.get("root_z", 0.0) + rise})
        else:
            x, y, z = first.at
            first = replace(first, at=(x, y, z + rise))
            scene = replace(scene, bodies=(first, *scene.bodies[1:]))
            robot = scene.robot()
    if scene.floating:
        return replace(scene, q=scene.q | {"root_z": scene.q.get("root_z", 0.0) + height})
    x, y, z = first.at
    return replace(scene, bodies=(replace(first, at=(x, y, z + height)), *scene.bodies[1:]))


def mirrored(scene: SpaceScene) -> SpaceScene:
    """Return the scene as a mirror at y = 0 shows it; hinges and slides keep their coordinates."""

    def flip(vector: Any) -> Any:
        return (vector[0], -vector[1], vector[2])

    def flip_axis(joint: Joint) -> Joint:
        x, y, z = joint.axis
        return replace(joint, axis=(x, -y, z) if joint.kind == "slide" else (-x, y, -z))

    def flip_turn(turn: Four) -> Four:
        return (turn[0], -turn[1], turn[2], -turn[3])

    bodies = tuple(
        replace(
            body, at=flip(body.at), turn=flip_turn(body.turn), center=flip(body.center),
            inertia=(*body.inertia[:3], -body.inertia[3], body.inertia[4], -body.inertia[5]),
            joints=tuple(map(flip_axis, body.joints)),
            shapes=tuple(
                replace(one, at=flip(one.at), turn=flip_turn(one.turn)) for one in body.shapes
            ),
        )
        for body in scene.bodies
    )  # fmt: skip
    return replace(
        scene,
        bodies=bodies,
        normal=flip(scene.normal),
        boxes=tuple(replace(one, center=flip(one.center), yaw=-one.yaw) for one in scene.boxes),
        q=mirrored_numbers(scene.q),
        v=mirrored_numbers(scene.v),
        shoves=tuple(
            replace(one, point=flip(one.point), force=flip(one.force)) for one in scene.shoves
        ),
    )


FLIPPED = ("_y", "_vy", "_qx", "_qz", "_wx", "_wz")


def mirrored_numbers(numbers: dict[str, float]) -> dict[str, float]:
    """Return positions or velocities by their names as the mirror shows them."""
    return {name: -value if name.endswith(FLIPPED) else value for name, value in numbers.items()}


def renumbered(scene: SpaceScene) -> SpaceScene:
    """Return the scene with its bodies in another order, parents first, and so its contacts."""
    draw = np.random.default_rng([scene.seed, 1])
    order: list[int] = [0]
    while len(order) < len(scene.bodies):
        ready = [
            i for i, body in enumerate(scene.bodies) if i not in order and body.parent in order
        ]
        order.append(int(draw.choice(ready)))
    place = {old: new for new, old in enumerate(order)}
    bodies = tuple(
        replace(scene.bodies[old], parent=place.get(scene.bodies[old].parent, -1),
                shapes=scene.bodies[old].shapes[::-1])
        for old in order
    )  # fmt: skip
    return replace(scene, bodies=bodies)
