"""What a scene is, and the random scene of a seed.

``random_scene(seed)`` depends on the seed alone. In words, each scene draws:

- a **tree** of 1 to 14 links; three of four float (a trunk with x, z and pitch and up to thirteen
  links on it), the others hang from the world. A link's parent is one of the three before it. Six
  of seven joints are hinges of either sense, the others slides. Links are 0.1 to 0.45 m long; a
  link weighs 0.2 to 8 kg (log-uniform), its radius of gyration is 0.2 to 0.4 of its length, its
  centre of mass lies around its middle. One joint in five has armature.
- **contacts**: every link on which no other hangs ends in a point, a disc of 2 to 8 cm or a flat
  sole of two points, other links in one case of four; the trunk may have one above. Ten at most.
- **joint forces**, scaled by the least inertia that a joint feels in the initial pose, so that no
  rate exceeds what a step of 1 ms resolves: dampers (half of the joints, up to 20/s), springs
  (a third, up to 20 rad/s), dry friction (a quarter), stops (two of five, 0.1 to 1.5 rad, or a
  tenth of that in m, either side of the pose), motors (four of five).
- a **control**: none (35 %), springs and dampers about a nearby pose (45 %, up to 25 rad/s and
  25/s) or constant torques (20 %). A third of the scenes have one or two **pushes** of up to half
  the robot's weight for 50 to 300 ms.
- a **ground**: flat (30 %), slope up to 0.4 rad (20 %), stairs up or down (20 %), or a polyline of
  five to nine corners whose segments rise by up to 0.9 rad, concave corners among them (30 %).
  Friction is zero (10 %), up to 1 (65 %), up to 3 (15 %), or another on every segment (10 %); there
  is restitution of 0.1 to 0.9 in a third of the scenes, which methods that know none leave out.
- a **start**: a third rest on the ground with their lowest contact, the others fall from up to
  0.3 m, links turning at about 1 rad/s and the trunk moving at up to 1 m/s. Nothing penetrates, no
  joint is beyond its stops.

One scene in ten is **degenerate on purpose** and says so in its `kind`: `twin points` (two contacts
of one link a micron apart), `in a corner` (its only contact, a disc, touches both sides of a
concave corner), `on a corner` (the same on a convex corner), `flat fall` (a long sole of four
points that falls without turning), `at a stop` (joints that begin at their stops), `light toe` (a
last link of 10 g), `wedged` (a rod that slides on its end under high friction: near Painlevé's
paradox).
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

import heelstrike as hs
from heelstrike.control.joint_feedback import JointFeedback
from heelstrike.sim import Push
from scenes.mechanics import Poses, Tree
from scenes.terrain import Terrain
from scenes.ties.description import Ties

Array = NDArray[Any]
Pair = tuple[float, float]

DEGENERATE = (
    "twin points", "in a corner", "on a corner", "flat fall", "at a stop", "light toe", "wedged",
)  # fmt: skip
"""The kinds of scenes that are special on purpose."""

MOST_CONTACTS = 10
GRAVITY = 9.81
SALT = 20_260_801
"""Stands beside every seed, so that other generators with the same seeds draw other numbers."""


@dataclass(frozen=True)
class Link:
    """A link and the joint that moves it; the words are those of `RobotBuilder`.

    `parent` is the index of another link, -1 for the world; `slide` the direction of a slide, None
    for a hinge; `motor` the greatest torque, None for none.
    """

    name: str
    parent: int
    at: Pair
    slide: Pair | None = None
    sense: int = 1
    mass: float = 1.0
    inertia: float = 0.1
    center_of_mass: Pair = (0.0, 0.0)
    reference: float = 0.0
    armature: float = 0.0
    damping: float = 0.0
    stiffness: float = 0.0
    rest: float = 0.0
    dry_friction: float = 0.0
    limits: Pair = (-np.inf, np.inf)
    motor: float | None = None


@dataclass(frozen=True)
class Contact:
    """A contact disc, or point, on a link."""

    link: int
    at: Pair
    radius: float = 0.0


@dataclass(frozen=True)
class Shove:
    """A push on a link."""

    link: int
    point: Pair
    force: Pair
    start: float
    duration: float


@dataclass(frozen=True)
class Scene:
    """Everything about a scene but the simulation method.

    Attributes
    ----------
    seed : int
    kind : str
        ``ordinary``, or what is degenerate on purpose.
    floating : bool
        Whether the first link is a trunk that moves freely.
    links : tuple of Link
        Of a floating robot the first is the trunk, whose joint numbers do not count.
    corners, friction, restitution : arrays
        The ground, as a polyline.
    q, v : dict of str to float
        Initial coordinates and velocities by joint; a trunk has ``root_x``, ``root_z`` and
        ``root_pitch``.
    kp, kd, target, torque : dict of str to float
        Control of the motors: ``torque + kp (target − q) − kd v``.
    ties : Ties
        Closed loops, coupled joints, brakes and latches (:mod:`scenes.ties.scene`).
    """

    seed: int
    kind: str
    floating: bool
    links: tuple[Link, ...]
    contacts: tuple[Contact, ...]
    corners: Array
    friction: Array
    restitution: Array
    q: dict[str, float] = field(default_factory=dict)
    v: dict[str, float] = field(default_factory=dict)
    kp: dict[str, float] = field(default_factory=dict)
    kd: dict[str, float] = field(default_factory=dict)
    target: dict[str, float] = field(default_factory=dict)
    torque: dict[str, float] = field(default_factory=dict)
    shoves: tuple[Shove, ...] = ()
    ties: Ties = field(default_factory=Ties)

    def robot(self) -> hs.Robot:
        """Build the robot."""
        builder = hs.RobotBuilder(f"scene {self.seed}", gravity=GRAVITY)
        for i, link in enumerate(self.links):
            numbers: dict[str, Any] = {
                "mass": link.mass, "inertia": link.inertia, "center_of_mass": link.center_of_mass,
            }  # fmt: skip
            if self.floating and i == 0:
                builder.floating_base(link.name, link.at, **numbers)
                continue
            names = ("armature", "damping", "stiffness", "rest", "dry_friction", "reference")
            numbers |= {name: getattr(link, name) for name in names}
            numbers |= {"limits": link.limits, "at": link.at}
            if link.motor is not None:
                numbers["torque"] = link.motor
            parent = None if link.parent < 0 else self.links[link.parent].name
            if link.slide is None:
                builder.hinge(link.name, parent, sense=link.sense, **numbers)
            else:
                builder.slide(link.name, parent, direction=link.slide, **numbers)
        for contact in self.contacts:
            link = self.links[contact.link]
            builder.contact(link.name, contact.at, radius=contact.radius)
        self.ties.add_to(builder, tuple(link.name for link in self.links))
        return builder.build()

    def state(self, robot: hs.Robot) -> hs.State:
        """Initial state in the order of a robot's coordinates."""
        return hs.State(self.ordered(self.q, robot), self.ordered(self.v, robot))

    @staticmethod
    def ordered(values: dict[str, float], robot: hs.Robot) -> Array:
        """Values by joint as an array in the order of a robot's coordinates."""
        return np.array([values[name] for name in robot.joint_names])

    def controller(self, robot: hs.Robot) -> JointFeedback | None:
        """Return the controller, None where there is no motor or nothing to do."""
        if robot.nu == 0 or not (self.kp or self.torque):
            return None

        def driven(values: dict[str, float]) -> Array:
            return np.array([values.get(name, 0.0) for name in robot.actuator_names])

        return JointFeedback(
            robot,
            driven(self.target),
            torque=driven(self.torque),
            kp=driven(self.kp),
            kd=driven(self.kd),
        )

    def ground(self, *, restitution: bool) -> hs.Ground:
        """Return the ground, with its restitution or without."""
        bounce = self.restitution if restitution else 0.0
        return hs.Ground(friction=self.friction, restitution=bounce, profile=self.corners)

    def terrain(self) -> Terrain:
        """Return the ground as the judges see it."""
        return Terrain(self.corners, self.friction, self.restitution)

    def pushes(self, since: float = 0.0) -> tuple[Push, ...]:
        """Return the pushes for a run that begins at a time `since`."""
        return tuple(
            Push(
                self.links[one.link].name,
                force=one.force,
                start=one.start - since,
                duration=one.duration,
                point=one.point,
            )
            for one in self.shoves
        )


def random_scene(seed: int) -> Scene:
    """Return the scene of a seed; see the module for what is drawn."""
    draw = np.random.default_rng([SALT, seed])
    kind = str(draw.choice(DEGENERATE)) if draw.random() < 0.1 else "ordinary"
    floating = bool(draw.random() < 0.75) or kind not in ("ordinary", "at a stop", "light toe")
    if kind == "flat fall":
        return _flat_fall(draw, seed)
    if kind == "wedged":
        return _wedged(draw, seed)
    links = _tree(draw, kind)
    contacts = _contacts(draw, links, floating=floating, kind=kind)
    corners, friction, restitution = _ground(draw, kind)
    scene = Scene(seed, kind, floating, links, contacts, corners, friction, restitution)
    scene = _start(draw, scene)
    scene = _joint_forces(draw, scene)
    return _pushed(draw, _controlled(draw, scene))


def least_inertias(scene: Scene) -> dict[str, float]:
    """Inertia that each joint feels in the initial pose while all others are free to move."""
    robot = scene.robot()
    pose = Poses(Tree(robot.model), scene.ordered(scene.q, robot)[None])
    inertia = 1.0 / np.diag(np.linalg.inv(pose.mass_matrix()[0]))
    return dict(zip(robot.joint_names, inertia.tolist(), strict=True))


def _tree(draw: np.random.Generator, kind: str) -> tuple[Link, ...]:
    count = int(draw.integers(1, 15))
    if kind in ("light toe", "at a stop"):
        count = max(count, 3)
    links: list[Link] = []
    lengths: list[float] = []
    for i in range(count):
        parent = -1 if i == 0 else int(draw.integers(max(0, i - 3), i))
        length = float(draw.uniform(0.1, 0.45))
        mass = float(np.exp(draw.uniform(np.log(0.2), np.log(8.0))))
        if kind == "light toe" and i == count - 1:
            mass = 0.01
        gyration = draw.uniform(0.2, 0.4) * length
        at = (0.0, 0.0)
        if parent >= 0:
            end = -lengths[parent] * (1.0 if draw.random() < 0.8 else draw.uniform(0.0, 1.0))
            at = (float(draw.uniform(-0.03, 0.03)), float(end))
        slide = None
        if draw.random() < 1.0 / 7.0:
            turn = draw.uniform(-np.pi, np.pi)
            slide = (float(np.sin(turn)), float(np.cos(turn)))
        links.append(
            Link(
                name=f"link{i}",
                parent=parent,
                at=at,
                slide=slide,
                sense=int(draw.choice((-1, 1))),
                mass=mass,
                inertia=float(mass * gyration**2),
                center_of_mass=(
                    float(draw.uniform(-0.1, 0.1) * length),
                    float(-draw.uniform(0.35, 0.65) * length),
                ),
                reference=float(draw.choice((0.0, draw.uniform(-0.4, 0.4)))),
                armature=float(mass * gyration**2 * draw.uniform(0.0, 2.0))
                if draw.random() < 0.2
                else 0.0,
            )
        )
        lengths.append(length)
    return tuple(links)


def _contacts(
    draw: np.random.Generator, links: tuple[Link, ...], *, floating: bool, kind: str
) -> tuple[Contact, ...]:
    carried = {link.parent for link in links}
    contacts: list[Contact] = []
    if floating and draw.random() < 0.5:
        contacts.append(Contact(0, (0.0, float(draw.uniform(0.0, 0.1)))))
    for i in reversed(range(len(links))):
        if (i in carried and draw.random() > 0.25) or len(contacts) + 2 > MOST_CONTACTS:
            continue
        # Its centre of mass is about half way down.
        x, z = links[i].center_of_mass[0], 2.0 * links[i].center_of_mass[1]
        shape = draw.choice(("point", "disc", "sole"))
        if kind in ("in a corner", "on a corner") and i == len(links) - 1:
            shape = "disc"
        if shape == "sole":
            heel, toe = draw.uniform(0.02, 0.08), draw.uniform(0.05, 0.15)
            contacts += [Contact(i, (x - heel, z)), Contact(i, (x + toe, z))]
        else:
            radius = float(draw.uniform(0.02, 0.08)) if shape == "disc" else 0.0
            contacts.append(Contact(i, (x, z), radius))
            if kind == "twin points":
                contacts.append(Contact(i, (x + 1e-6, z), radius))
    if kind in ("in a corner", "on a corner"):  # nothing else shall touch first
        return tuple(one for one in contacts if one.link == len(links) - 1)
    return tuple(contacts[:MOST_CONTACTS])


def _ground(draw: np.random.Generator, kind: str) -> tuple[Array, Array, Array]:
    shape = str(draw.choice(("flat", "slope", "stairs", "polyline"), p=(0.3, 0.2, 0.2, 0.3)))
    if kind == "in a corner":
        left, right = draw.uniform(0.2, 0.9, size=2)
        corners = np.array([[-1.0, np.tan(left)], [0.0, 0.0], [1.0, np.tan(right)]])
    elif kind == "on a corner":
        left, right = draw.uniform(0.05, 0.5, size=2)
        corners = np.array([[-1.0, -np.tan(left)], [0.0, 0.0], [1.0, -np.tan(right)]])
    elif shape == "flat":
        corners = np.array([[0.0, 0.0], [1.0, 0.0]])
    elif shape == "slope":
        corners = np.array([[0.0, 0.0], [1.0, np.tan(draw.uniform(-0.4, 0.4))]])
    elif shape == "stairs":
        rise = draw.uniform(0.04, 0.2) * draw.choice((-1.0, 1.0))
        tread = draw.uniform(0.2, 0.5)
        steps = int(draw.integers(1, 5))
        first = draw.uniform(-1.0, 0.3)
        points = [(first - 1.0, 0.0)]
        for k in range(steps):
            x = first + k * tread
            points += [(x, k * rise), (x, (k + 1) * rise)]
        points.append((first + steps * tread, steps * rise))
        corners = np.array(points)
    else:
        number = int(draw.integers(5, 10))
        run = draw.uniform(0.1, 0.5, size=number - 1)
        rise = run * np.tan(draw.uniform(-0.9, 0.9, size=number - 1))
        corners = np.zeros((number, 2))
        corners[1:] = np.cumsum(np.stack((run, rise), axis=1), axis=0)
        corners -= corners[number // 2]
    segments = len(corners) - 1
    how = draw.random()
    if how < 0.1:
        friction = np.zeros(segments)
    elif how < 0.75:
        friction = np.full(segments, draw.uniform(0.0, 1.0))
    elif how < 0.9:
        friction = np.full(segments, draw.uniform(1.0, 3.0))
    else:
        friction = draw.uniform(0.0, 1.5, size=segments)
    bounce = draw.uniform(0.1, 0.9) if draw.random() < 1.0 / 3.0 else 0.0
    return corners, friction, np.full(segments, bounce)


def _start(draw: np.random.Generator, scene: Scene) -> Scene:
    """Turn the links, set them in motion, and put the robot on the ground or above it."""
    q, v = {}, {}
    rests = bool(draw.random() < 1.0 / 3.0) or scene.kind in ("in a corner", "on a corner")
    links = list(scene.links)
    if scene.floating:
        q |= {"root_x": 0.0, "root_z": 0.0, "root_pitch": float(draw.uniform(-0.5, 0.5))}
        v |= {
            "root_x": float(draw.uniform(-1.0, 1.0)),
            "root_z": float(draw.uniform(-0.5, 0.5)),
            "root_pitch": float(draw.normal()),
        }
    for link in links[1 if scene.floating else 0 :]:
        reach = 0.1 if link.slide else 0.8
        q[link.name] = float(link.reference + draw.uniform(-reach, reach))
        v[link.name] = float(draw.normal() * (0.2 if link.slide else 1.0))
    if rests:
        v = dict.fromkeys(v, 0.0)
    drop = 0.0 if rests else float(draw.uniform(0.0, 0.3))
    return placed(replace(scene, q=q, v=v), drop)


def placed(scene: Scene, drop: float) -> Scene:
    """Move the robot up or down until its lowest contact is `drop` above the ground (m).

    From above, by the distance that is left each time: this arrives without ever going through.
    """
    terrain = scene.terrain()
    robot = scene.robot()
    poses = Poses(Tree(robot.model), scene.ordered(scene.q, robot)[None])
    model = robot.model
    center = poses.points(model.contact_link, model.contact_position)[0]
    radius = model.contact_radius
    if scene.kind in ("in a corner", "on a corner") and scene.floating:
        # The last disc in the line that halves the corner, so that it meets both sides at once.
        middle = terrain.normal.sum(axis=0)
        last = int(np.argmax(radius))
        goal = middle * (radius[last] / (terrain.normal[0] @ middle))
        if scene.kind == "on a corner":
            goal = middle / np.linalg.norm(middle) * radius[last]
        aside = float(goal[0] - center[last, 0])
        center = center + np.array([aside, 0.0])
        scene = replace(scene, q=scene.q | {"root_x": scene.q["root_x"] + aside})
    height = 10.0 + float(np.max(np.abs(center)))
    center = center + np.array([0.0, height])
    for _ in range(500):
        gap = float(np.min(terrain.measure(center).distance - radius))
        if abs(gap - drop) < 1e-13:
            break
        center = center - np.array([0.0, gap - drop])
        height -= gap - drop
    height += 1e-12
    if scene.floating:
        return replace(scene, q=scene.q | {"root_z": scene.q["root_z"] + height})
    root = scene.links[0]
    root = replace(root, at=(root.at[0], root.at[1] + height))
    return replace(scene, links=(root, *scene.links[1:]))


def _joint_forces(draw: np.random.Generator, scene: Scene) -> Scene:
    inertia = least_inertias(scene)
    links = list(scene.links)
    for i in range(1 if scene.floating else 0, len(links)):
        link = links[i]
        felt, now = inertia[link.name], scene.q[link.name]
        unit = 0.1 if link.slide else 1.0
        numbers: dict[str, Any] = {}
        if draw.random() < 0.5:
            numbers["damping"] = float(felt * draw.uniform(0.0, 20.0))
        if draw.random() < 1.0 / 3.0:
            numbers["stiffness"] = float(felt * draw.uniform(1.0, 20.0) ** 2)
            numbers["rest"] = float(now + unit * draw.uniform(-0.5, 0.5))
        if draw.random() < 0.25:
            numbers["dry_friction"] = float(felt * draw.uniform(1.0, 60.0) * unit)
        if draw.random() < 0.4 or scene.kind == "at a stop":
            low, high = now - unit * draw.uniform(0.1, 1.5), now + unit * draw.uniform(0.1, 1.5)
            if scene.kind == "at a stop" and (draw.random() < 0.7 or i == len(links) - 1):
                low, high = (now, high) if draw.random() < 0.5 else (low, now)
            numbers["limits"] = (float(low), float(high))
        if draw.random() < 0.8:
            numbers["motor"] = float(felt * unit * draw.uniform(50.0, 500.0))
        links[i] = replace(link, **numbers)
    v = scene.v
    if scene.kind == "at a stop":
        v = dict.fromkeys(v, 0.0)
    return replace(scene, links=tuple(links), v=v)


def _controlled(draw: np.random.Generator, scene: Scene) -> Scene:
    how = draw.random()
    driven = [link for link in scene.links if link.motor is not None]
    if how < 0.35 or not driven:
        return scene
    inertia = least_inertias(scene)
    if how < 0.55:
        torque = {link.name: float(draw.uniform(-0.2, 0.2) * (link.motor or 0)) for link in driven}
        return replace(scene, torque=torque)
    kp, kd, target = {}, {}, {}
    for link in driven:
        reach = 0.05 if link.slide else 0.5
        kp[link.name] = float(inertia[link.name] * draw.uniform(2.0, 25.0) ** 2)
        kd[link.name] = float(inertia[link.name] * draw.uniform(1.0, 25.0))
        target[link.name] = float(scene.q[link.name] + draw.uniform(-reach, reach))
    return replace(scene, kp=kp, kd=kd, target=target)


def _pushed(draw: np.random.Generator, scene: Scene) -> Scene:
    if draw.random() > 1.0 / 3.0:
        return scene
    weight = GRAVITY * sum(link.mass for link in scene.links)
    shoves = []
    for _ in range(int(draw.integers(1, 3))):
        angle = draw.uniform(-np.pi, np.pi)
        size = weight * draw.uniform(0.05, 0.5)
        link = int(draw.integers(len(scene.links)))
        shoves.append(
            Shove(
                link,
                scene.links[link].center_of_mass,
                (float(size * np.cos(angle)), float(size * np.sin(angle))),
                float(draw.uniform(0.01, 0.6)),
                float(draw.uniform(0.05, 0.3)),
            )
        )
    return replace(scene, shoves=tuple(shoves))


def _flat_fall(draw: np.random.Generator, seed: int) -> Scene:
    """A plank of four points that falls flat; some carry a pendulum."""
    length = float(draw.uniform(0.2, 0.8))
    mass = float(draw.uniform(0.5, 10.0))
    links = [Link("link0", -1, (0.0, 0.0), mass=mass, inertia=mass * length**2 / 12.0)]
    if draw.random() < 0.5:
        links.append(
            Link("link1", 0, (0.0, 0.05), mass=1.0, inertia=0.01, center_of_mass=(0.0, -0.2))
        )
    contacts = tuple(Contact(0, (s * length / 2, -0.05)) for s in (-1.0, -0.3, 0.3, 1.0))
    bounce = float(draw.choice((0.0, draw.uniform(0.1, 0.9))))
    names = ["root_x", "root_z", "root_pitch"] + [link.name for link in links[1:]]
    scene = Scene(
        seed, "flat fall", True, tuple(links), contacts,
        np.array([[0.0, 0.0], [1.0, 0.0]]), np.array([draw.uniform(0.0, 1.0)]), np.array([bounce]),
        q=dict.fromkeys(names, 0.0),
        v=dict.fromkeys(names, 0.0) | {"root_x": float(draw.choice((0.0, draw.uniform(-1, 1))))},
    )  # fmt: skip
    return placed(scene, float(draw.choice((0.0, draw.uniform(0.0, 0.3)))))


def _wedged(draw: np.random.Generator, seed: int) -> Scene:
    """A rod that slides on its end under friction high enough to wedge it."""
    length, lean = float(draw.uniform(0.3, 1.0)), float(draw.uniform(0.3, 1.2))
    links = (Link("link0", -1, (0.0, 0.0), mass=1.0, inertia=length**2 / 12.0),)
    names = ("root_x", "root_z", "root_pitch")
    scene = Scene(
        seed, "wedged", True, links,
        (Contact(0, (0.0, -length / 2)), Contact(0, (0.0, length / 2))),
        np.array([[0.0, 0.0], [1.0, 0.0]]), np.array([draw.uniform(1.0, 3.0)]), np.array([0.0]),
        q=dict.fromkeys(names, 0.0) | {"root_pitch": lean},
        v=dict(zip(names, (float(draw.uniform(-2.0, 2.0)), 0.0, 0.0), strict=True)),
    )  # fmt: skip
    return placed(scene, 0.0)
