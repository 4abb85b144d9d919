"""Ground in space: a plane of any slope, and boxes on it that stand still.

Contact points meet the nearest face of all of them, and two walls beside it. Only points of the
robot are looked at: edges of a box do not meet edges of the robot.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from heelstrike.arguments import check_fields, takes
from heelstrike.compiler.bundle import Bundle, array, number
from heelstrike.compiler.compilation import kernel
from heelstrike.contact.ground import Ground
from heelstrike.contact.spatial.cones import Triple
from heelstrike.contact.spatial.workspace import Floats
from heelstrike.dynamics.spatial.algebra import dot, less, sum_of, times, vector
from heelstrike.errors import SimulationError
from heelstrike.field_texts import dataclass

ON_THE_FACE = 1e-12
"""Distance (m) from a box below which the direction to it says nothing about its face."""

COVERED = 1e-9
"""Distance (m) up to which a face that touches something lies on it."""

DOWNWARDS, UNDER = -0.5, 1e-3
"""Vertical part of the normal of a face on which a box stands, and how far (m) at most the box goes
on into what it stands on, so that a point that is in the floor meets the walls of the box, not its
bottom."""

BESIDE = 1e-6
"""Depth (m) below the rim of a face from which on a point meets it as a wall."""


OF_LENGTH_ONE = 1e-15
"""How far the length of a normal is from one by rounding: it stays as it is then, in files too."""


class SpatialGroundModel(Bundle):
    """The ground in space as the kernels see it; boxes come after the plane."""

    normal: Floats = array(3)
    """Upward unit normal of the plane."""
    height: float = number(float)
    """Distance of the plane from the origin, along its normal (m)."""
    center: Floats = array("boxes", 3)
    """Middle of each box (m), that of a box which goes on into what it stands on."""
    rotation: Floats = array("boxes", 9)
    """Its axes in the world, row by row."""
    half: Floats = array("boxes", 3)
    """Half its lengths along them (m), lengthened likewise."""
    exposed: Floats = array("boxes", 6)
    """1 of what can be touched of their faces, 0 of what lies wholly on the plane or within another
    box: those at the upper end of each axis, then at the lower ends."""
    friction: Floats = array("boxes + 1")
    restitution: Floats = array("boxes + 1")
    """friction, restitution: Of the plane, then of each box."""


@dataclass(frozen=True)
class Box:
    """A box that stands still on the ground.

    Raises
    ------
    SimulationError
        If a number cannot be.
    """

    center: ArrayLike
    """(3,) Its middle, in m."""
    size: ArrayLike
    """(3,) Its lengths along its own axes, in m."""
    yaw: float = 0.0
    """How far it is turned about the vertical, in rad."""
    pitch: float = 0.0
    """How far it is then turned about its own y axis, in rad: a ramp."""
    friction: float | None = None
    restitution: float | None = None
    """friction, restitution: Its own; those of the ground by default."""

    def __post_init__(self) -> None:
        check_fields(self, SimulationError)
        for name, least in (("center", -np.inf), ("size", 0.0)):
            values = np.array(getattr(self, name), dtype=np.float64)
            if values.shape != (3,) or not np.all(np.isfinite(values) & (values > least)):
                raise SimulationError(f"{name} of a box must be three numbers, got {values}")
            object.__setattr__(self, name, tuple(values.tolist()))
        for name in ("yaw", "pitch", "friction", "restitution"):
            value = getattr(self, name)
            if value is not None and not math.isfinite(value):
                raise SimulationError(f"{name} of a box must be a finite number, got {value}")


@dataclass(frozen=True, eq=False)
class SpatialGround:
    """Rigid ground for robots in space.

    Raises
    ------
    SimulationError
        If a coefficient is out of range, or the normal does not point up.

    Examples
    --------
    >>> SpatialGround(friction=0.6, normal=(0.1, 0.0, 1.0)).friction
    0.6
    """

    friction: float = 0.75
    """Coulomb's coefficient μ ≥ 0."""
    restitution: float = 0.0
    """Newton's coefficient of restitution, 0 to 1."""
    normal: ArrayLike = (0.0, 0.0, 1.0)
    """(3,) What is perpendicular to the plane, of any length; it points up."""
    height: float = 0.0
    """Where the plane meets the z axis, in m."""
    boxes: tuple[Box, ...] = ()
    """What stands on it."""
    _model: SpatialGroundModel = field(init=False, repr=False)

    def __post_init__(self) -> None:
        check_fields(self, SimulationError)
        normal = np.array(self.normal, dtype=np.float64)
        if normal.shape != (3,) or not np.all(np.isfinite(normal)) or not normal[2] > 0.0:
            raise SimulationError(
                f"normal must be three numbers, the last positive, got {self.normal!r}"
            )
        if not math.isfinite(self.height):
            raise SimulationError(f"height of the ground must be finite, got {self.height}")
        if abs(np.linalg.norm(normal) - 1.0) > OF_LENGTH_ONE:
            normal /= np.max(np.abs(normal))
            normal /= np.linalg.norm(normal)
        boxes = tuple(self.boxes)
        for each in boxes:
            if not isinstance(each, Box):
                raise SimulationError(f"boxes must be Box(center=..., size=...), got {each!r}")
        friction, restitution = [self.friction], [self.restitution]
        for each in boxes:
            friction.append(self.friction if each.friction is None else each.friction)
            bounces = self.restitution if each.restitution is None else each.restitution
            restitution.append(bounces)
        for name, values, most in (
            ("friction", friction, np.inf), ("restitution", restitution, 1.0)
        ):  # fmt: skip
            for value in values:
                if not 0.0 <= value <= most or not np.isfinite(value):
                    raise SimulationError(f"{name} of the ground cannot be {value}")
        height = float(normal[2] * self.height)
        center, rotation, half, exposed = _laid(boxes, normal, height)
        model = SpatialGroundModel(
            normal=normal,
            height=height,
            center=center,
            rotation=rotation,
            half=half,
            exposed=exposed,
            friction=np.array(friction, dtype=float),
            restitution=np.array(restitution, dtype=float),
        )
        object.__setattr__(self, "boxes", boxes)
        object.__setattr__(self, "normal", tuple(normal.tolist()))
        object.__setattr__(self, "_model", model)

    @classmethod
    @takes(SimulationError)
    def stairs(
        cls, *, rise: float, tread: float, count: int, width: float = 2.0, start: float = 0.0,
        friction: float = 0.75, restitution: float = 0.0,
    ) -> SpatialGround:  # fmt: skip
        """Flat ground with stairs that lead up along x.

        Parameters
        ----------
        rise, tread : float
            Height and depth of a step (m).
        count : int
            Number of steps.
        width : float
            How wide they are (m), half of it to each side of y = 0.
        start : float
            Where the first one rises (m).
        friction, restitution : float
            As for the class.

        Returns
        -------
        SpatialGround
            The stairs.

        Raises
        ------
        SimulationError
            If a number is impossible.
        """
        if count < 1 or not (rise > 0.0 and tread > 0.0 and width > 0.0):
            raise SimulationError(
                f"stairs need count ≥ 1 and positive lengths; got count={count}, rise={rise}, "
                f"tread={tread}, width={width}"
            )
        boxes = tuple(
            Box(
                center=(start + 0.5 * (step + count) * tread, 0.0, (step + 0.5) * rise),
                size=((count - step) * tread, width, rise),
            )
            for step in range(count)
        )
        return cls(friction=friction, restitution=restitution, boxes=boxes)

    @classmethod
    def of_plane(cls, ground: Ground) -> SpatialGround:
        """Return the ground of the plane, the same for all y.

        Parameters
        ----------
        ground : Ground
            Level or sloping ground without a profile.

        Returns
        -------
        SpatialGround
            A plane with the same slope along x.

        Raises
        ------
        SimulationError
            If it is no plane.
        """
        if ground.profile is not None or ground.shape is not None:
            raise SimulationError(
                "ground with a profile or a shape is for robots in the plane; for robots in space "
                "SpatialGround has planes and boxes"
            )
        model = ground.model()
        return cls(
            friction=float(model.friction[0]),
            restitution=float(model.restitution[0]),
            normal=(-math.sin(ground.slope), 0.0, math.cos(ground.slope)),
        )

    def model(self) -> SpatialGroundModel:
        """Return the arrays that the kernels use."""
        return self._model

    def numbers(self) -> dict[str, Floats]:
        """Return the ground as arrays that :meth:`of_numbers` makes it of.

        What a box has from the ground is NaN.
        """

        def column(name: str, *length: int) -> Floats:
            values = [getattr(box, name) for box in self.boxes]
            return np.array(values, dtype=np.float64).reshape(-1, *length)  # None becomes NaN

        return {
            **{name: np.array(float(getattr(self, name))) for name in SCALARS},
            "normal": np.array(self.normal),
            **{f"box_{name}": column(name, *length) for name, length in OF_A_BOX.items()},
        }

    @classmethod
    def of_numbers(cls, numbers: Mapping[str, NDArray[Any]]) -> SpatialGround:
        """Make the ground of :meth:`numbers`.

        Parameters
        ----------
        numbers : mapping of str to array
            What that returned.

        Returns
        -------
        SpatialGround
            The ground.

        Raises
        ------
        SimulationError
            If a number cannot be.
        """
        columns = [numbers[f"box_{name}"].tolist() for name in OF_A_BOX]
        boxes = []
        for values in zip(*columns, strict=True):
            box = dict(zip(OF_A_BOX, values, strict=True))
            for name in ("friction", "restitution"):
                box[name] = None if math.isnan(box[name]) else box[name]
            boxes.append(Box(**box))
        scalars = {name: float(numbers[name]) for name in SCALARS}
        return cls(normal=numbers["normal"], boxes=tuple(boxes), **scalars)


SCALARS = ("friction", "restitution", "height")
OF_A_BOX: dict[str, tuple[int, ...]] = {
    "center": (3,), "size": (3,), "yaw": (), "pitch": (), "friction": (), "restitution": ()
}  # fmt: skip
"""Numbers of a ground, and shapes of those of a box."""


def _axes(box: Box) -> Floats:
    """Axes of a box in the world, one a row."""
    c, s = math.cos(box.yaw), math.sin(box.yaw)
    a, b = math.cos(box.pitch), math.sin(box.pitch)
    return np.array([c * a, s * a, -b, -s, c, 0.0, c * b, s * b, a])


def _corners(center: Floats, axes: Floats, half: Floats, face: int) -> Floats:
    """Corners (4, 3) of a face of a box; the faces at the upper ends of its axes come first."""
    own = np.empty((4, 3))
    own[:, face % 3] = 1.0 if face < 3 else -1.0
    own[:, [k for k in range(3) if k != face % 3]] = [
        (i, j) for i in (-1.0, 1.0) for j in (-1.0, 1.0)
    ]
    return center + (own * half) @ axes


def _laid(boxes: tuple[Box, ...], normal: Floats, height: float) -> tuple[Floats, ...]:
    """Return middles, axes and half lengths of boxes, and which of their faces can be touched.

    All corners of the others, (boxes, 6), lie in one other thing. What stands on it goes on into
    it.
    """
    exposed = np.ones((len(boxes), 6))
    axes = np.array([_axes(each) for each in boxes], dtype=float).reshape(-1, 3, 3)
    center = np.array([each.center for each in boxes], dtype=float).reshape(-1, 3)
    half = 0.5 * np.array([each.size for each in boxes], dtype=float).reshape(-1, 3)

    def covered(box: int, corners: Floats, way: Floats, most: float) -> float:
        """How far corners that go some way stay in one other thing; -1 if they are in none."""
        farthest = -1.0
        if np.all(corners @ normal <= height + COVERED):
            farthest = most if way @ normal <= 0.0 else 0.0
        for other in range(len(boxes)):
            own, along = (corners - center[other]) @ axes[other].T, axes[other] @ way
            if other == box or not np.all(np.abs(own) <= half[other] + COVERED):
                continue
            room = half[other] + COVERED - own * np.sign(along)
            moving = np.abs(along) > 0.0
            far = np.min(room[:, moving] / np.abs(along[moving]), initial=most)
            farthest = max(farthest, float(far))
        return farthest

    def reach_down(box: int, corners: Floats, way: Floats) -> float:
        """How far a box goes on into what it stands on, thing by thing."""
        reach = 0.0
        while reach < UNDER:
            more = covered(box, corners + reach * way, way, UNDER - reach)
            if more <= COVERED:
                break
            reach += more
        return reach

    longer, moved = half.copy(), center.copy()
    for box in range(len(boxes)):
        for face in range(6):
            corners = _corners(center[box], axes[box], half[box], face)
            outwards = axes[box, face % 3] * (1.0 if face < 3 else -1.0)
            if covered(box, corners, outwards, UNDER) < 0.0:
                continue
            exposed[box, face] = 0.0
            reach = reach_down(box, corners, outwards) if outwards[2] < DOWNWARDS else 0.0
            longer[box, face % 3] += 0.5 * reach
            moved[box] += 0.5 * reach * outwards
        if not exposed[box].any():  # nothing can touch it
            exposed[box] = 1.0
            longer[box], moved[box] = half[box], center[box]
    return moved, axes.reshape(-1, 9), longer, exposed


@kernel
def box_axis(ground: SpatialGroundModel, box: int, k: int) -> Triple:
    """Axis of a box, of unit length, in the world."""
    r = ground.rotation
    return r[box, 3 * k], r[box, 3 * k + 1], r[box, 3 * k + 2]


@kernel
def distance_to_box(ground: SpatialGroundModel, box: int, point: Triple) -> tuple[float, Triple]:
    """Signed distance of a point to a box, and the direction away from it."""
    apart = less(point, vector(ground.center, box))
    deepest, face, side = -math.inf, 0, 1.0
    square = 0.0
    away = (0.0, 0.0, 0.0)
    for k in range(3):
        own = dot(box_axis(ground, box, k), apart)
        beyond = abs(own) - ground.half[box, k]
        far = -abs(own) - ground.half[box, k]
        upper = ground.exposed[box, k] > 0.0
        lower = ground.exposed[box, 3 + k] > 0.0
        near_one, far_one = (upper, lower) if own >= 0.0 else (lower, upper)
        if near_one and beyond > deepest:
            deepest, face, side = beyond, k, (1.0 if own >= 0.0 else -1.0)
        elif not near_one and far_one and far > deepest:
            deepest, face, side = far, k, (-1.0 if own >= 0.0 else 1.0)
        if beyond > 0.0:
            square += beyond * beyond
            signed = beyond if own >= 0.0 else -beyond
            away = sum_of(away, times(box_axis(ground, box, k), signed))
    distance = math.sqrt(square)
    if distance > ON_THE_FACE:
        return distance, (away[0] / distance, away[1] / distance, away[2] / distance)
    return deepest, times(box_axis(ground, box, face), side)


@kernel
def distance_to_face(ground: SpatialGroundModel, face: int, point: Triple) -> tuple[float, Triple]:
    """Signed distance to the plane, which is face 0, or to a box; and the direction away."""
    if face > 0:
        return distance_to_box(ground, face - 1, point)
    n = ground.normal[0], ground.normal[1], ground.normal[2]
    return n[0] * point[0] + n[1] * point[1] + n[2] * point[2] - ground.height, n


@kernel
def is_beside(ground: SpatialGroundModel, box: int, point: Triple) -> bool:
    """Whether a point is before or behind one exposed face of a box, or in it, and not at its rim.

    Points on the top of a box do not stumble over the rim of the next one.
    """
    apart = less(point, vector(ground.center, box))
    shallow = 0
    for k in range(3):
        own = dot(box_axis(ground, box, k), apart)
        beyond = abs(own) - ground.half[box, k]
        seen = ground.exposed[box, k if own >= 0.0 else 3 + k] > 0.0
        if not seen and beyond > BESIDE:
            return False
        shallow += seen and beyond > -BESIDE
    return shallow <= 1
