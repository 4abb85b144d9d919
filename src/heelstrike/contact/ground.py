"""The ground: a rigid polyline with friction and restitution on every segment, or a smooth curve.

A smooth curve (:mod:`heelstrike.contact.ground_shape`) is ground of one segment, whose line it is.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from typing import Any
from weakref import WeakValueDictionary

import numpy as np
from numpy.typing import ArrayLike, NDArray

from heelstrike.arguments import check_fields, takes
from heelstrike.compiler.bundle import Bundle, array, number, part
from heelstrike.compiler.compilation import dissolved_kernel, kernel
from heelstrike.contact.ground_shape import (
    GroundShape,
    curvature_of_shape,
    distance_to_shape,
    height_of_shape,
)
from heelstrike.errors import SimulationError
from heelstrike.field_texts import dataclass
from heelstrike.notebook import ShownInNotebooks
from heelstrike.robot.model import Floats
from heelstrike.tolerances import STRAIGHT_GROUND

# Features further from a disc's centre than this (m) are not looked for: a robot that far from
# every one of them is in free flight, and the distance to the ground below it will do.
REACH = 0.25


UPRIGHT = 1e-3
"""Least rise of the normal that counts in how far the nearest segment may be: steeper faces are
looked for within `REACH` in any case."""

DRAWN, MOST_DRAWN = 0.02, 2000
"""Distance (m) of the places of a smooth curve that a drawing joins, and how many at most."""

AT_THE_CORNER = 1e-12
"""Distance (m) of a centre from a corner up to which there is no way from one to the other."""


_SHAPES: WeakValueDictionary[str, GroundShape] = WeakValueDictionary()
"""Shapes of grounds that there are, as they are written: so a snapshot finds its ground again."""


class GroundModel(Bundle):
    """The ground as the kernels see it."""

    vertices: Floats = array("segments + 1", "axes")
    """Corners of the profile (x, z) in metres, x never decreasing; the end segments go on for
    ever."""
    normal: Floats = array("segments", "axes")
    """Upward unit normal of each segment."""
    friction: Floats = array("segments")
    restitution: Floats = array("segments")
    """friction, restitution: Coefficients of each segment."""
    concave: int = number(int)
    """Whether there is a corner in which a point can touch two faces."""
    curved: int = number(int)
    """Whether it is a smooth curve: then of one segment."""
    shape: Bundle = part(Bundle, address=True)
    shape_code: int = number(int)
    """shape, shape_code: The numbers of the curve, and where its machine code is."""


@dataclass(frozen=True, eq=False)
class Ground(ShownInNotebooks):
    """Rigid ground.

    Raises
    ------
    SimulationError
        If a coefficient is out of range or the profile is no polyline from left to right.

    Examples
    --------
    >>> Ground(friction=0.6, slope=0.1).height(2.0).round(4)
    np.float64(0.2007)
    """

    friction: ArrayLike = 0.75
    """Float or (ns,) array. Coulomb friction coefficient μ ≥ 0, one for all or one a segment."""
    restitution: ArrayLike = 0.0
    """Float or (ns,) array. Newton's coefficient of restitution, 0 (plastic, the paper's choice) to
    1."""
    slope: float = 0.0
    """Inclination in rad of ground without a profile; positive climbs along +x."""
    profile: ArrayLike | None = None
    """(ns + 1, 2) Corners (x, z) of the ground in metres, from left to right; two corners with the
    same x make a vertical step. The first and last segments go on forever. See also :meth:`stairs`
    and :meth:`rough`."""
    shape: GroundShape | None = None
    """A smooth curve in the place of slope and profile, perhaps of a class of one's own."""
    _model: GroundModel = field(init=False, repr=False)

    def __post_init__(self) -> None:
        check_fields(self, SimulationError)
        if not abs(self.slope) < 0.5 * np.pi:
            raise SimulationError(f"the slope must lie within ±π/2 rad, got {self.slope}")
        numbers, code = Bundle(), 0
        if self.shape is not None:
            self._check_shape(self.shape)
            numbers = self.shape.parameters()
            code = self.shape.code(numbers)
            vertices = _chord(self.shape)
        elif self.profile is None:
            vertices = np.array([[0.0, 0.0], [1.0, np.tan(self.slope)]])
        elif self.slope != 0.0:
            raise SimulationError("give the ground either a slope or a profile, not both")
        else:
            vertices = _polyline(self.profile)
        segments = len(vertices) - 1
        friction = _coefficients("friction coefficient", self.friction, segments, np.inf)
        restitution = _coefficients("restitution", self.restitution, segments, 1.0)
        normal = _normals(vertices)
        model = GroundModel(
            curved=int(self.shape is not None),
            shape=numbers,
            shape_code=code,
            vertices=vertices,
            normal=normal,
            concave=int(np.any(_turn(normal[:-1].T, normal[1:].T) > STRAIGHT_GROUND)),
            friction=friction,
            restitution=restitution,
        )
        object.__setattr__(self, "_model", model)

    def _check_shape(self, shape: GroundShape) -> None:
        if not isinstance(shape, GroundShape):
            raise SimulationError(
                f"shape must be a GroundShape(...), got {shape!r}; for corners use profile="
            )
        if self.slope != 0.0 or self.profile is not None:
            raise SimulationError("give the ground a shape, or a slope or a profile, not both")
        _SHAPES[repr(shape)] = shape

    @classmethod
    @takes(SimulationError)
    def stairs(
        cls,
        *,
        rise: float,
        tread: float,
        count: int,
        start: float = 0.0,
        friction: ArrayLike = 0.75,
        restitution: ArrayLike = 0.0,
    ) -> Ground:
        """Flat ground with `count` steps from x = `start` on; a negative `rise` leads down.

        Parameters
        ----------
        rise, tread : float
            Height and depth of a step (m); a negative height leads down.
        count : int
            Number of steps.
        start : float
            Where the first one rises (m).
        friction, restitution : float or array
            As for the class.

        Returns
        -------
        Ground
            The stairs.

        Raises
        ------
        SimulationError
            If a number is impossible.
        """
        if count < 1 or not tread > 0.0 or not np.isfinite(rise):
            raise SimulationError(
                f"stairs need count ≥ 1, tread > 0 and a finite rise; "
                f"got count={count}, tread={tread}, rise={rise}"
            )
        corners = [(start - 1.0, 0.0)]
        for step in range(count):
            x = start + step * tread
            corners += [(x, step * rise), (x, (step + 1) * rise)]
        corners.append((start + count * tread, count * rise))
        return cls(friction=friction, restitution=restitution, profile=np.array(corners))

    @classmethod
    @takes(SimulationError)
    def rough(
        cls,
        *,
        amplitude: float,
        seed: int,
        spacing: float = 0.1,
        length: float = 100.0,
        start: float = 0.5,
        friction: ArrayLike = 0.75,
        restitution: ArrayLike = 0.0,
    ) -> Ground:
        """Flat ground with corners at random heights within ±`amplitude` from `start` on.

        Parameters
        ----------
        amplitude : float
            Greatest height or depth of a corner (m).
        seed : int
            Of the random heights; the same seed gives the same ground.
        spacing : float
            Distance between corners (m).
        length : float
            How far it is rough (m).
        start : float
            Where it begins to be rough (m): in front of the feet of most robots.
        friction, restitution : float or array
            As for the class.

        Returns
        -------
        Ground
            The rough ground.

        Raises
        ------
        SimulationError
            If a number is impossible.
        """
        if not (amplitude >= 0.0 and spacing > 0.0 and length > 0.0):
            raise SimulationError("rough ground needs amplitude ≥ 0, spacing > 0 and length > 0")
        if seed < 0 or not np.isfinite(start):
            raise SimulationError(
                f"rough ground needs a seed from 0 on and a finite start, got {seed} and {start:g}"
            )
        x = np.arange(start, start + length, spacing)
        z = np.random.default_rng(seed).uniform(-amplitude, amplitude, len(x))
        z[0] = z[-1] = 0.0
        ends = [[start - 1.0, 0.0]], np.column_stack((x, z)), [[x[-1] + 1.0, 0.0]]
        return cls(friction=friction, restitution=restitution, profile=np.concatenate(ends))

    def numbers(self) -> dict[str, NDArray[Any]]:
        """Return the ground as arrays that :meth:`of_numbers` makes it of.

        Of a smooth one there is its shape as it is written, which is a text.
        """
        shape = {} if self.shape is None else {"shape": np.array(repr(self.shape))}
        return shape | {
            "corner": self._model.vertices,
            "friction": self._model.friction,
            "restitution": self._model.restitution,
            "slope": np.array(self.slope),
            "has_profile": np.array(self.profile is not None, dtype=np.float64),
        }

    @classmethod
    def of_numbers(cls, numbers: Mapping[str, NDArray[Any]]) -> Ground:
        """Make the ground of :meth:`numbers`.

        Parameters
        ----------
        numbers : mapping of str to array
            What that returned.

        Returns
        -------
        Ground
            The ground.

        Raises
        ------
        SimulationError
            If it has a shape that nobody here has made: of numbers alone none is made.
        """
        told = str(numbers.get("shape", ""))
        if told not in _SHAPES and told:
            raise SimulationError(f"this was on ground of the shape {told}: give that ground again")
        return cls(
            shape=_SHAPES.get(told),
            friction=_one_if_equal(numbers["friction"]),
            restitution=_one_if_equal(numbers["restitution"]),
            slope=float(numbers["slope"]),
            profile=numbers["corner"] if numbers["has_profile"] else None,
        )

    def model(self) -> GroundModel:
        """Return the arrays that the kernels use."""
        return self._model

    @takes(SimulationError)
    def height(self, x: ArrayLike) -> Floats:
        """Height of the ground at x, in metres; on a vertical step, that of its right side.

        Parameters
        ----------
        x : array
            Where (m), of any shape.

        Returns
        -------
        array of the same shape
            Heights (m).
        """
        x = np.asarray(x, dtype=np.float64)
        if self.shape is not None:
            of_shape = [self.shape.at(each)[0] for each in x.reshape(-1).tolist()]
            return np.array(of_shape, dtype=np.float64).reshape(x.shape)
        vertices = self._model.vertices
        segment = np.searchsorted(vertices[1:-1, 0], x, side="right")
        left, right = vertices[segment], vertices[segment + 1]
        run = right[..., 0] - left[..., 0]
        slope = (right[..., 1] - left[..., 1]) / np.where(run > 0.0, run, np.inf)
        height: Floats = left[..., 1] + slope * (x - left[..., 0])
        return height

    def outline(self, left: float, right: float) -> Floats:
        """Return the surface between two places, to be drawn.

        Parameters
        ----------
        left, right : float
            The places x (m), the left one first.

        Returns
        -------
        (n, 2) float
            Corners (x, z) in m; of a smooth curve so many places that it looks like one.
        """
        if self.shape is not None:
            places = min(max(int((right - left) / DRAWN), 2), MOST_DRAWN)
            x = np.linspace(left, right, places)
            return np.column_stack((x, self.height(x)))
        corners = self._model.vertices
        inside = corners[(corners[:, 0] > left) & (corners[:, 0] < right)]
        ends = np.array([[x, float(self.height(x))] for x in (left, right)])
        return np.concatenate((ends[:1], inside, ends[1:]))


def _chord(shape: GroundShape) -> Floats:
    """Two places of a smooth curve: the ends of the one segment that it stands for."""
    ends = np.array([[x, shape.at(x)[0]] for x in (0.0, 1.0)])
    if not np.all(np.isfinite(ends)):
        raise SimulationError(
            f"the height of ground shape {type(shape).__name__} must be finite everywhere, and "
            f"is {ends[0, 1]:g} m at x = 0, {ends[1, 1]:g} m at x = 1 m"
        )
    return ends


def _one_if_equal(values: Floats) -> Floats | float:
    return float(values[0]) if len(values) and np.all(values == values[0]) else values


def _polyline(profile: ArrayLike) -> Floats:
    vertices = np.array(profile, dtype=np.float64)
    if vertices.ndim != 2 or vertices.shape[1] != 2 or len(vertices) < 2:
        raise SimulationError(
            f"a ground profile is an array of at least two corners (x, z), got shape "
            f"{vertices.shape}"
        )
    endless = np.flatnonzero(~np.isfinite(vertices).all(axis=1))
    if endless.size:
        raise SimulationError(
            f"a ground profile must be finite everywhere; corner {endless[0]} is "
            f"{vertices[endless[0]].tolist()}"
        )
    steps = np.diff(vertices, axis=0)
    if np.any(steps[:, 0] < 0.0) or np.any(np.all(steps == 0.0, axis=1)):
        corner = int(np.flatnonzero((steps[:, 0] < 0.0) | np.all(steps == 0.0, axis=1))[0])
        raise SimulationError(
            f"a ground profile runs from left to right without repeating a corner; "
            f"corner {corner + 1} at {vertices[corner + 1].tolist()} does not"
        )
    if steps[0, 0] == 0.0 or steps[-1, 0] == 0.0:
        raise SimulationError("the first and last segment of a ground profile cannot be vertical")
    return vertices


def _normals(vertices: Floats) -> Floats:
    run, rise = np.diff(vertices, axis=0).T
    return np.ascontiguousarray(np.column_stack((-rise, run)) / np.hypot(run, rise)[:, None])


def _turn(first: Floats, second: Floats) -> Floats:
    """Sine of the angle from one direction to another, positive where the ground turns upwards."""
    turn: Floats = first[0] * second[1] - first[1] * second[0]
    return turn


def _coefficients(name: str, value: ArrayLike, segments: int, highest: float) -> Floats:
    coefficients = np.asarray(value, dtype=np.float64)
    if coefficients.ndim > 1 or coefficients.size not in (1, segments):
        raise SimulationError(
            f"the {name} must be one number or one for each of the {segments} segments of the "
            f"ground, got shape {coefficients.shape}"
        )
    if not np.all((coefficients >= 0.0) & (coefficients <= highest) & np.isfinite(coefficients)):
        limits = "≥ 0" if highest == np.inf else f"in [0, {highest:g}]"
        raise SimulationError(f"the {name} of the ground must be {limits}, got {value!r}")
    return np.broadcast_to(coefficients, (segments,)).copy()


@kernel
def segment_below(ground: GroundModel, x: float) -> int:
    """Index of the segment under x; the right one at a corner."""
    low = 0
    high = ground.friction.shape[0]
    while high - low > 1:
        middle = (low + high) // 2
        if ground.vertices[middle, 0] <= x:
            low = middle
        else:
            high = middle
    return low


@kernel
def ground_height(ground: GroundModel, x: float) -> float:
    """Height of the ground at x."""
    if ground.curved == 1:
        return height_of_shape(ground.shape_code, ground.shape, x, ground.normal[0])
    segment = segment_below(ground, x)
    slope = -ground.normal[segment, 0] / ground.normal[segment, 1]
    return ground.vertices[segment, 1] + slope * (x - ground.vertices[segment, 0])


@kernel
def line_contact(ground: GroundModel, segment: int, x: float, z: float, normal: Floats) -> float:
    """Signed distance to the line through a segment, or to the curve; writes its upward normal."""
    if ground.curved == 1:
        return distance_to_shape(ground.shape_code, ground.shape, x, z, normal)
    normal[0] = ground.normal[segment, 0]
    normal[1] = ground.normal[segment, 1]
    return (x - ground.vertices[segment, 0]) * normal[0] + (
        z - ground.vertices[segment, 1]
    ) * normal[1]


@kernel
def path_curvature(ground: GroundModel, x: float, distance: float, normal: Floats) -> float:
    """Curvature (1/m) of the way of a place that keeps its distance from a smooth ground.

    Positive where it goes over a hill: what makes a gap grow by its product with the square of the
    speed along the ground. `x` is where the place is, `normal` that of the ground beneath it.
    """
    foot = x - distance * normal[0]
    bend = curvature_of_shape(ground.shape_code, ground.shape, foot, normal)
    return -bend / (1.0 - bend * distance)


@dissolved_kernel
def ground_contact(
    ground: GroundModel, x: float, z: float, radius: float, normal: Floats
) -> tuple[float, float, float]:
    """Gap, friction and restitution between a disc and the nearest feature of the ground.

    Parameters
    ----------
    x, z : float
        World position of the disc's centre.
    radius : float
        Radius of the disc.
    normal : (2,) float
        Receives the ground's outward normal; the tangent is (normal z, −normal x).
    """
    if ground.friction.shape[0] == 1:
        distance = line_contact(ground, 0, x, z, normal)
        return distance - radius, ground.friction[0], ground.restitution[0]
    return profile_contact(ground, x, z, radius, normal)


@kernel
def profile_contact(
    ground: GroundModel, x: float, z: float, radius: float, normal: Floats
) -> tuple[float, float, float]:
    """Like :func:`ground_contact`, of ground with corners."""
    gap, owner = nearest_segment(ground, x, z, radius, normal)
    return gap, ground.friction[owner], ground.restitution[owner]


@kernel
def nearest_segment(
    ground: GroundModel, x: float, z: float, radius: float, normal: Floats
) -> tuple[float, int]:
    """Gap between a disc and the nearest feature of the ground, and the segment it is of.

    Of a place in the ground that is nearest to a concave corner it is the face that it is deeper
    under: there are two ways to go, and no face whose normal points from it to the corner.
    """
    below = segment_below(ground, x)
    distance = line_contact(ground, below, x, z, normal)
    segments = ground.friction.shape[0]
    # Nothing nearer than the ground straight below or above can lie further away in x.
    inside = distance < 0.0
    reach = min(abs(distance) / max(normal[1], UPRIGHT), REACH + radius)
    first = below
    while first > 0 and ground.vertices[first, 0] >= x - reach:
        first -= 1
    nearest = np.inf
    owner = below
    corner = 0
    for segment in range(first, segments):
        ax = ground.vertices[segment, 0]
        az = ground.vertices[segment, 1]
        if segment > below and ax > x + reach:
            break
        run = ground.vertices[segment + 1, 0] - ax
        rise = ground.vertices[segment + 1, 1] - az
        along = ((x - ax) * run + (z - az) * rise) / (run * run + rise * rise)
        on_corner = (along < 0.0 and segment > 0) or (along > 1.0 and segment < segments - 1)
        if on_corner:
            along = min(max(along, 0.0), 1.0)
        dx = x - ax - along * run
        dz = z - az - along * rise
        squared = dx * dx + dz * dz
        if squared < nearest:
            nearest = squared
            owner = segment
            corner = (segment if along == 0.0 else segment + 1) if on_corner else 0
            separation = np.sqrt(squared)
            if on_corner and separation > AT_THE_CORNER:
                sign = -1.0 if inside else 1.0
                normal[0] = sign * dx / separation
                normal[1] = sign * dz / separation
            else:
                line_contact(ground, segment, x, z, normal)
    if inside and corner > 0 and turn_at(ground, corner) > STRAIGHT_GROUND:
        right = line_contact(ground, corner, x, z, normal)
        left = line_contact(ground, corner - 1, x, z, normal)
        if right < left:
            left = line_contact(ground, corner, x, z, normal)
            corner += 1
        return left - radius, corner - 1
    separation = np.sqrt(nearest)
    return (-separation if inside else separation) - radius, owner


@kernel
def turn_at(ground: GroundModel, corner: int) -> float:
    """Sine of the angle that the ground turns upwards by at an inner corner."""
    before, after = ground.normal[corner - 1], ground.normal[corner]
    return before[0] * after[1] - before[1] * after[0]


@kernel
def faces_it(ground: GroundModel, own: int, segment: int, x: float, z: float) -> bool:
    """Whether a segment may be the other face of a concave corner about a place on its own face.

    The neighbour of its own face may if the corner between them is concave; the line through it is
    below the own face, then. Others may from outside only, and within reach.
    """
    if abs(segment - own) == 1:
        return turn_at(ground, max(own, segment)) > STRAIGHT_GROUND
    begin, normal = ground.vertices[segment], ground.normal[segment]
    outside = (x - begin[0]) * normal[0] + (z - begin[1]) * normal[1] >= 0.0
    return outside and begin[0] <= x + REACH and ground.vertices[segment + 1, 0] >= x - REACH


@kernel
def is_off_far_end(ground: GroundModel, own: int, neighbour: int, x: float, z: float) -> bool:
    """Whether a place has left its own face over the end that is not the neighbour's.

    A disc that pivots there has gone past what the line through the neighbour bounds.
    """
    begin, end = ground.vertices[own], ground.vertices[own + 1]
    run, rise = end[0] - begin[0], end[1] - begin[1]
    if neighbour < own:
        return own < ground.friction.shape[0] - 1 and (x - end[0]) * run + (z - end[1]) * rise > 0.0
    return own > 0 and (x - begin[0]) * run + (z - begin[1]) * rise < 0.0


@kernel
def second_contact(
    ground: GroundModel, x: float, z: float, radius: float, normal: Floats
) -> tuple[float, float, float]:
    """Gap, friction and restitution between a disc and the second face of a concave corner.

    The first is the one that :func:`ground_contact` finds. The gap is infinite where there is no
    second. Arguments are those of that kernel.
    """
    _, own = nearest_segment(ground, x, z, radius, normal)
    segments = ground.friction.shape[0]
    nearest = np.inf
    owner = own
    for segment in range(segments):
        if segment == own or not faces_it(ground, own, segment, x, z):
            continue
        begin, end = ground.vertices[segment], ground.vertices[segment + 1]
        run, rise = end[0] - begin[0], end[1] - begin[1]
        along = ((x - begin[0]) * run + (z - begin[1]) * rise) / (run * run + rise * rise)
        joined = abs(segment - own) == 1 and not is_off_far_end(ground, own, segment, x, z)
        before = along < 0.0 and segment > 0 and not (joined and segment > own)
        behind = along > 1.0 and segment < segments - 1 and not (joined and segment < own)
        if before or behind:
            corner = segment + 1 if behind else segment
            dx, dz = x - ground.vertices[corner, 0], z - ground.vertices[corner, 1]
            distance = np.sqrt(dx * dx + dz * dz)
            if AT_THE_CORNER < distance < nearest and turn_at(ground, corner) < 0.0:
                nearest, owner = distance, segment
                normal[0], normal[1] = dx / distance, dz / distance
        else:
            face = ground.normal[segment]
            distance = (x - begin[0]) * face[0] + (z - begin[1]) * face[1]
            if distance < nearest:
                nearest, owner = distance, segment
                normal[0], normal[1] = face[0], face[1]
    return nearest - radius, ground.friction[owner], ground.restitution[owner]
