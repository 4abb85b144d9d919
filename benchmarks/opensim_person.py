"""Inverse kinematics and dynamics of OpenSim's planar walker, beside OpenSim's own results.

Run, from the top folder::

    python benchmarks/opensim_person.py FOLDER

FOLDER holds six files of opensim-org/opensim-models: ``subject01.osim`` of
``Models/Gait10dof18musc``; ``subject01_walk.trc`` and ``subject01_walk_grf.mot`` of
``Pipelines/Gait10dof18musc/ExperimentalData``; and of its ``OutputReference``,
``IK/walk_Setup_IK.xml``, ``IK/subject01_walk_IK.mot`` and ``ID/Results/subject01_walk_ID.sto``.
The recording has no licence: it is fetched by who wants it, and lies outside this folder. Nothing
is fetched here.

The robot is the one of the file: masses, places and markers. Its knees have centres that move with
their angles; here they are slides beside a hinge, and one coordinate moves all three. Each row of
markers is fitted by weighted least squares with the weights of the set-up file; coordinates are
filtered at 6 Hz as there (Butterworth's filter of third order, forwards and back), and splines
through them give the accelerations. Forces act on the feet as measured, unfiltered.
"""

from __future__ import annotations

import sys
import time
import xml.etree.ElementTree as ET
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rich.console import Console
from scipy.interpolate import CubicSpline, make_interp_spline
from scipy.signal import butter, filtfilt
from table import Table

import heelstrike as hs
from heelstrike import dynamics
from heelstrike.gait.recordings.table import read_table
from heelstrike.gait.recordings.trc import points_of_trc

SIDES = ("r", "l")
CUTOFF, ORDER = 6.0, 3
"""Of the filter of the coordinates: frequency (Hz) and order."""
MOST, SMALL = 30, 1e-10
"""Gauss and Newton's steps, and the change (m, rad) that ends them."""
Curve = Callable[[np.ndarray, int], np.ndarray]
"""Of a coordinate and an order, to a joint's position or its derivative."""


@dataclass(frozen=True)
class Walker:
    """OpenSim's model: a robot whose joints follow fewer coordinates."""

    robot: hs.Robot
    names: tuple[str, ...]
    """Coordinates, as OpenSim calls them."""
    follows: np.ndarray
    """(nq,) Which coordinate each joint follows."""
    curves: tuple[Curve, ...]
    """How."""
    markers: dict[str, tuple[str, np.ndarray]]
    """Link, and place on it, of every marker."""

    def joints(self, p: np.ndarray, order: int = 0) -> np.ndarray:
        """Joints' positions at coordinates (..., n), or derivatives by the one each follows."""
        columns = [
            curve(p[..., k], order) for k, curve in zip(self.follows, self.curves, strict=True)
        ]
        return np.stack(columns, axis=-1)

    def gathered(self, along: np.ndarray) -> np.ndarray:
        """Sum what belongs to joints, (..., nq), by the coordinate that they follow."""
        total = np.zeros((*along.shape[:-1], len(self.names)))
        np.add.at(total, (..., self.follows), along)
        return total


def straight(sense: float) -> Curve:
    """Return the curve of a joint that is a coordinate, or its opposite."""
    return lambda p, order: sense * (p if order == 0 else np.full(np.shape(p), float(order == 1)))


def numbers(text: str | None) -> np.ndarray:
    """Read numbers that stand in an element."""
    return np.array((text or "").split(), dtype=np.float64)


def walker(path: Path) -> Walker:
    """Read the model."""
    model = ET.parse(path).getroot().find("Model")
    bodies = {each.get("name"): each for each in model.find("BodySet/objects")}
    joints = {each.get("name"): each for each in model.find("JointSet/objects")}

    def place(joint: str, frame: int = 0) -> np.ndarray:
        """Place of a joint on its parent, or of the parent's frame on its child, in the plane."""
        frames = joints[joint].findall("frames/PhysicalOffsetFrame")
        return numbers(frames[frame].findtext("translation"))[:2]

    def inertial(*parts: tuple[str, np.ndarray]) -> dict[str, object]:
        """Mass, centre and inertia of bodies that are one."""
        masses = np.array([float(bodies[name].findtext("mass")) for name, _ in parts])
        centers = np.array(
            [at + numbers(bodies[name].findtext("mass_center"))[:2] for name, at in parts]
        )
        turned = [numbers(bodies[name].findtext("inertia"))[2] for name, _ in parts]
        center = masses @ centers / masses.sum()
        inertia = sum(turned) + masses @ ((centers - center) ** 2).sum(axis=1)
        return {
            "mass": masses.sum(), "center_of_mass": tuple(center), "inertia": float(inertia)
        }  # fmt: skip

    zero = np.zeros(2)
    gravity = -numbers(model.findtext("gravity"))[1]
    body = hs.RobotBuilder("gait10dof", gravity=float(gravity))
    body.floating_base("pelvis", (0.0, 0.0), **inertial(("pelvis", zero)))
    names = ["pelvis_tx", "pelvis_ty", "pelvis_tilt"]
    follows, curves = [0, 1, 2], [straight(1.0), straight(1.0), straight(-1.0)]

    def turned(name: str) -> None:
        """Add a coordinate that turns a hinge."""
        names.append(name)
        follows.append(len(names) - 1)
        curves.append(straight(1.0))

    body.hinge("back", "pelvis", at=tuple(place("back")), link="torso", sense=-1,
               **inertial(("torso", zero)))  # fmt: skip
    turned("lumbar_extension")
    toes: dict[str, np.ndarray] = {}
    for side in SIDES:
        body.hinge(f"hip_{side}", "pelvis", at=tuple(place(f"hip_{side}")), link=f"femur_{side}",
                   sense=-1, **inertial((f"femur_{side}", zero)))  # fmt: skip
        turned(f"hip_flexion_{side}")
        upper = f"femur_{side}"
        axes = joints[f"knee_{side}"].findall("SpatialTransform/TransformAxis")
        for number, direction in ((1, (1.0, 0.0)), (2, (0.0, 1.0))):
            axis = next(each for each in axes if each.get("name") == f"translation{number}")
            scaled = axis.find("MultiplierFunction")
            knots = scaled.find("function/SimmSpline")
            spline = CubicSpline(
                numbers(knots.findtext("x")), numbers(knots.findtext("y")), bc_type="natural"
            )
            scale = float(scaled.findtext("scale"))
            upper = body.slide(f"knee_{side}_{number}", upper, direction=direction)
            follows.append(len(names))
            curves.append(lambda p, order, s=spline, c=scale: c * s(p, order))
        body.hinge(f"knee_{side}", upper, link=f"tibia_{side}", sense=-1,
                   **inertial((f"tibia_{side}", zero)))  # fmt: skip
        turned(f"knee_angle_{side}")
        heel = place(f"subtalar_{side}") - place(f"subtalar_{side}", 1)
        toes[side] = heel
        front = heel + place(f"mtp_{side}") - place(f"mtp_{side}", 1)
        body.hinge(
            f"ankle_{side}", f"tibia_{side}", at=tuple(place(f"ankle_{side}")),
            link=f"talus_{side}", sense=-1,
            **inertial((f"talus_{side}", zero), (f"calcn_{side}", heel), (f"toes_{side}", front)),
        )  # fmt: skip
        turned(f"ankle_angle_{side}")
        body.contact(f"talus_{side}", tuple(heel))
    markers = {}
    for each in model.find("MarkerSet/objects"):
        link = each.findtext("socket_parent_frame").rpartition("/")[2]
        at = numbers(each.findtext("location"))[:2]
        if link.startswith("calcn"):
            link, at = link.replace("calcn", "talus"), at + toes[link[-1]]
        markers[each.get("name")] = (link, at)
    return Walker(body.build(), tuple(names), np.array(follows), tuple(curves), markers)


def weights(path: Path) -> dict[str, float]:
    """Read which markers count, and how much."""
    return {
        each.get("name"): float(each.findtext("weight"))
        for each in ET.parse(path).getroot().iter("IKMarkerTask")
        if each.findtext("apply") == "true"
    }


def fitted(
    walker: Walker, seen: dict[str, np.ndarray], weight: dict[str, float], begin: np.ndarray
) -> np.ndarray:
    """Coordinates (n,) at which the markers of one instant are nearest, from others near by."""
    p = begin.copy()
    for _ in range(MOST):
        q, slope = walker.joints(p), walker.joints(p, 1)
        rows, missing = [], []
        for name, target in seen.items():
            link, local = walker.markers[name]
            root = np.sqrt(weight[name])
            place = dynamics.point_position(walker.robot, q, link, local)
            jacobian = dynamics.point_jacobian(walker.robot, q, link, local)[:2]
            rows.append(root * walker.gathered(jacobian * slope))
            missing.append(root * (target - place))
        step = np.linalg.lstsq(np.concatenate(rows), np.concatenate(missing), rcond=None)[0]
        p = p + step
        if np.abs(step).max() < SMALL:
            return p
    sys.exit("the markers of an instant were not fitted")


def kinematics(walker: Walker, folder: Path, begin: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Times, and coordinates (n, 10) fitted to all rows of markers."""
    instants, names, position = points_of_trc(folder / "subject01_walk.trc")
    weight = weights(folder / "walk_Setup_IK.xml")
    used = [name for name in names if name in weight and name in walker.markers]
    p, found = begin, []
    for places in position:
        seen = {name: places[names.index(name), :2] for name in used}
        seen = {name: each for name, each in seen.items() if np.isfinite(each).all()}
        p = fitted(walker, seen, weight, p)
        found.append(p)
    return instants, np.array(found)


def moments(walker: Walker, folder: Path, instants: np.ndarray, p: np.ndarray) -> np.ndarray:
    """Generalised forces (n, 10) of OpenSim's coordinates that the motion takes."""
    rate = (len(instants) - 1) / (instants[-1] - instants[0])
    smooth = filtfilt(*butter(ORDER, CUTOFF / (0.5 * rate)), p, axis=0)
    spline = make_interp_spline(instants, smooth, k=5)
    p, u, du = (spline(instants, order) for order in range(3))
    q, slope, bend = (walker.joints(p, order) for order in range(3))
    along, faster = u[:, walker.follows], du[:, walker.follows]
    v, a = slope * along, slope * faster + bend * along**2
    table = read_table(folder / "subject01_walk_grf.mot")
    clock = table.begin + table.time()
    found = []
    for i, instant in enumerate(instants):
        needed = dynamics.inverse_dynamics(walker.robot, q[i], v[i], a[i])
        poses = dynamics.link_poses(walker.robot, q[i])
        for side, plate in (("r", ""), ("l", "1_")):
            columns = [f"{plate}ground_{kind}" for kind in
                       ("force_vx", "force_vy", "force_px", "force_py", "torque_z")]  # fmt: skip
            fx, fy, px, py, moment = (
                np.interp(instant, clock, table.values[:, table.column(name)]) for name in columns
            )
            link = walker.robot.link_names.index(f"talus_{side}")
            away, turn = np.array([px, py]) - poses.origin[link], poses.angle[link]
            # Rotation about +y, which turns x towards -z.
            cosine, sine = np.cos(turn), np.sin(turn)
            local = np.array([cosine * away[0] - sine * away[1], sine * away[0] + cosine * away[1]])
            rows = dynamics.point_jacobian(walker.robot, q[i], link, local)
            needed = needed - rows.T @ np.array([fx, fy, -moment])
        found.append(walker.gathered(needed * slope[i]))
    return np.array(found)


def reference(path: Path, names: list[str]) -> tuple[np.ndarray, np.ndarray]:
    """Times and columns of a table of OpenSim."""
    table = read_table(path)
    return table.begin + table.time(), table.values[:, [table.column(name) for name in names]]


def main() -> None:
    """Print the table."""
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    folder = Path(sys.argv[1])
    spent = time.process_time()
    own = walker(folder / "subject01.osim")
    clock, told = reference(folder / "subject01_walk_IK.mot", list(own.names))
    told[:, 2:] = np.deg2rad(told[:, 2:])
    instants, p = kinematics(own, folder, told[0])
    kinds = ["force" if k in (0, 1) else "moment" for k in range(len(own.names))]
    asked = [f"{name}_{kind}" for name, kind in zip(own.names, kinds, strict=True)]
    when, wanted = reference(folder / "subject01_walk_ID.sto", asked)
    exerted = moments(own, folder, instants, p)
    spent = time.process_time() - spent
    body = []
    for k, name in enumerate(own.names):
        away = p[:, k] - np.interp(instants, clock, told[:, k])
        away = np.rad2deg(away) if k > 1 else 1e3 * away
        lacks = exerted[:, k] - np.interp(instants, when, wanted[:, k])
        inner = slice(len(instants) // 20, -(len(instants) // 20))
        body.append([
            name, f"{np.sqrt((away**2).mean()):.4f} {'deg' if k > 1 else 'mm'}",
            f"{np.sqrt((lacks**2).mean()):.3f}", f"{np.sqrt((lacks[inner] ** 2).mean()):.3f}",
            f"{np.abs(wanted[:, k]).max():.0f} {'N m' if k > 1 else 'N'}",
        ])  # fmt: skip
    head = ["coordinate", "kinematics, rms", "forces, rms", "without the ends", "largest"]
    title = f"OpenSim's planar walker: {len(instants)} rows, {spent:.0f} s of processor"
    Console(width=120).print(Table(title, head, body))


if __name__ == "__main__":
    main()
