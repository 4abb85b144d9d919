"""The diagrams of the pages: ``python docs/diagrams.py`` draws them again, into docs/images.

Robots, motions and events in them are those of the package, not drawn by hand. Their ground is
white; ``site.css`` inverts them on dark pages.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, FancyArrowPatch, FancyBboxPatch

import heelstrike as hs
from heelstrike import dynamics
from heelstrike.sim import EventKind
from heelstrike.view.drawing import skeleton
from heelstrike.view.style import (
    BLUE,
    GREEN,
    GREY,
    INK,
    PURPLE,
    SKY,
    VERMILION,
    new_figure,
    save_figure,
    styled,
)

IMAGES = Path(__file__).resolve().parent / "images"

Point = Sequence[float]


def bare(axes: Axes, title: str, x: Point, z: Point) -> None:
    """Show a drawing to scale, without axes."""
    axes.set(xlim=x, ylim=z, aspect="equal")
    axes.axis("off")
    axes.text(x[0], z[1], title, va="top", fontsize=11)


def arrow(
    axes: Axes, start: Point, end: Point, color: str, *, both: bool = False, bend: float = 0.0
) -> None:
    """Draw an arrow, with a head at both ends or bent if asked for."""
    axes.add_patch(
        FancyArrowPatch(
            tuple(start), tuple(end), color=color, arrowstyle="<|-|>" if both else "-|>",
            mutation_scale=11, linewidth=1.6, shrinkA=0, shrinkB=0, zorder=5,
            connectionstyle=f"arc3,rad={bend}",
        )
    )  # fmt: skip


def turn(axes: Axes, center: Point, radius: float, start: float, end: float, color: str) -> None:
    """Draw an arrow along an arc; angles in rad from x, counter-clockwise as drawn."""
    angle = np.linspace(start, end, 40)
    x, z = center[0] + radius * np.cos(angle), center[1] + radius * np.sin(angle)
    axes.plot(x, z, color=color, zorder=5)
    arrow(axes, (x[-4], z[-4]), (x[-1], z[-1]), color)


def word(axes: Axes, at: Point, text: str, color: str = INK, align: str = "center") -> None:
    """Write a word into a drawing."""
    axes.text(*at, text, color=color, ha=align, va="center", zorder=6)


def ground(axes: Axes, left: float, right: float, slope: float = 0.0) -> None:
    """Draw a line of ground through the origin, hatched below."""
    fall = np.tan(slope)
    x = np.array([left, right])
    axes.plot(x, fall * x, color=INK, linewidth=1.6, zorder=2)
    for at in np.linspace(left, right, round(16 * (right - left)) + 1)[1:]:
        axes.plot(
            [at, at - 0.03], [fall * at, fall * at - 0.035], color=GREY, linewidth=0.7, zorder=1
        )


def stick(axes: Axes, robot: hs.Robot, q: np.ndarray, shift: Point = (0.0, 0.0)) -> None:
    """Draw a robot in a posture."""
    bones = skeleton(robot)
    poses = dynamics.link_poses(robot, q)
    segments = bones.segments(poses.origin + np.asarray(shift), poses.angle)
    axes.add_collection(bones.drawn(segments))


def frames() -> Figure:
    """World frame, a link that turns, zero and sense of the joints."""
    figure = new_figure(8.6, 3.2)
    world, link, zero, bent = figure.subplots(1, 4, width_ratios=(1.0, 1.0, 0.75, 0.95))

    bare(world, "World frame", (-0.35, 1.25), (-0.75, 1.25))
    arrow(world, (0, 0), (0.9, 0), INK)
    word(world, (1.15, 0), "x\nforward")
    arrow(world, (0, 0), (0, 0.9), INK)
    word(world, (0, 1.05), "z  up")
    world.add_patch(Circle((0, 0), 0.07, fill=False, color=INK, linewidth=1.6))
    diagonal = 0.07 / np.sqrt(2.0)
    for sign in (1, -1):
        x = [-diagonal, diagonal]
        world.plot(x, [sign * -diagonal, sign * diagonal], color=INK)
    word(world, (0.42, -0.22), "y  left, into the page")
    turn(world, (0, 0), 0.5, 1.35, 0.25, VERMILION)
    word(world, (0.62, 0.5), "positive\nrotation", VERMILION, "left")
    arrow(world, (0.9, -0.3), (0.9, -0.65), GREY)
    word(world, (1.05, -0.5), "g", GREY)

    bare(link, "A link turned by θ", (-0.35, 1.25), (-0.75, 1.25))
    theta = 0.6
    cos, sin = np.cos(theta), np.sin(theta)
    for end in ((0.9, 0.0), (0.0, 0.9)):
        link.plot([0, end[0]], [0, end[1]], color=GREY, linestyle=":")
    arrow(link, (0, 0), (0.9 * cos, -0.9 * sin), BLUE)
    word(link, (1.0 * cos, -1.05 * sin), "link x", BLUE)
    arrow(link, (0, 0), (0.9 * sin, 0.9 * cos), BLUE)
    word(link, (1.05 * sin, 1.02 * cos), "link z", BLUE)
    turn(link, (0, 0), 0.45, 0.0, -theta, VERMILION)
    word(link, (0.58, -0.17), "θ", VERMILION)
    turn(link, (0, 0), 0.45, np.pi / 2, np.pi / 2 - theta, VERMILION)
    word(link, (0.16, 0.58), "θ", VERMILION)

    robot = hs.load_robot("bravo7")
    reference = robot.reference_state()
    bare(zero, "All joints at zero", (-0.4, 0.4), (-0.1, 1.85))
    ground(zero, -0.4, 0.4)
    stick(zero, robot, reference.q)
    bare(bent, "Positive angles", (-0.85, 0.55), (-0.1, 1.85))
    ground(bent, -0.85, 0.55)
    turned = {"root_pitch": 0.2, "right_hip": 0.3, "right_knee": 0.5, "right_ankle": 0.3,
              "left_hip": -0.2}  # fmt: skip
    q = robot.state(turned).q
    stick(bent, robot, q)
    whole = 0.0
    for joint, link in (("hip", "thigh"), ("knee", "shank"), ("ankle", "foot")):
        at = dynamics.point_position(robot, q, f"right_{link}", (0.0, 0.0))
        before = turned["root_pitch"] + whole
        whole += turned[f"right_{joint}"]
        along = -np.pi / 2 - before  # where the link would point at zero
        far = 0.2 if joint == "ankle" else 0.34
        ahead = at + far * np.array([np.cos(along), np.sin(along)])
        bent.plot(*np.array([at, ahead]).T, color=GREY, linestyle=":", zorder=4)
        turn(bent, at, 0.8 * far, along, along - turned[f"right_{joint}"], VERMILION)
        above = 0.14 if joint == "ankle" else 0.08
        word(bent, (at[0] - 0.1, at[1] + above), joint, VERMILION, "right")
    hip = dynamics.point_position(robot, q, "trunk", (0.0, 0.0))
    bent.plot([hip[0], hip[0]], [hip[1], hip[1] + 0.75], color=GREY, linestyle=":", zorder=4)
    turn(bent, hip, 0.66, np.pi / 2, np.pi / 2 - turned["root_pitch"], VERMILION)
    word(bent, (hip[0] - 0.05, hip[1] + 0.66), "pitch", VERMILION, "right")
    return figure


def contact_frame() -> Figure:
    """Gap, normal and tangent of a contact point; force, cone and zero moment point of a foot."""
    figure = new_figure(9.0, 3.2)
    point, foot = figure.subplots(1, 2)
    slope = -0.25
    normal = np.array([-np.sin(slope), np.cos(slope)])
    tangent = np.array([np.cos(slope), np.sin(slope)])
    bare(point, "A contact point above a slope", (-0.75, 0.85), (-0.3, 0.75))
    ground(point, -0.75, 0.85, slope)
    center, radius = 0.38 * normal, 0.17
    point.add_patch(Circle(tuple(center), radius, fill=False, color=BLUE, linewidth=1.8))
    point.plot(*center, "o", color=BLUE, markersize=4)
    word(point, center + np.array([0.2, 0.02]), "disc fixed to a link", BLUE, "left")
    arrow(point, (0, 0), (0.38 - radius) * normal, VERMILION, both=True)
    word(point, (-0.12, 0.12), "gap > 0", VERMILION, "right")
    arrow(point, -0.45 * tangent, -0.45 * tangent + 0.4 * normal, INK)
    word(point, -0.45 * tangent + 0.46 * normal, "normal")
    arrow(point, -0.45 * tangent, -0.08 * tangent, INK)
    word(point, -0.2 * tangent - 0.1 * normal, "tangent")

    bare(foot, "Contact force on a foot", (-0.6, 0.85), (-0.2, 0.75))
    ground(foot, -0.6, 0.85)
    foot.plot([-0.3, 0.3, 0.02, -0.3], [0, 0, 0.22, 0], color=BLUE, linewidth=1.8, zorder=3)
    word(foot, (-0.36, 0.06), "heel", BLUE, "right")
    word(foot, (0.36, 0.06), "toe", BLUE, "left")
    at = np.array([0.12, 0.0])
    for side in (-1, 1):
        foot.plot([at[0], at[0] + side * 0.75 * 0.6], [0, 0.6], color=GREY, linestyle="--")
    word(foot, (at[0] + 0.42, 0.44), "friction cone\nμ = 0.75", GREY, "left")
    force, up, along = (np.array(each) for each in ((0.17, 0.55), (0.0, 0.55), (0.17, 0.0)))
    arrow(foot, at, at + force, GREEN)
    word(foot, at + 1.1 * force, "force", GREEN)
    arrow(foot, at, at + up, INK)
    word(foot, at + 1.1 * up, "normal part", INK, "right")
    arrow(foot, at, at + along, INK)
    foot.plot(*at, "D", color=PURPLE, zorder=7)
    word(foot, (0.12, -0.12), "zero moment point, between heel and toe")
    return figure


def falling_ball(method: object) -> hs.Run:
    """Drop a ball that is 4 cm above the ground."""
    build = hs.RobotBuilder("ball")
    ball = build.floating_base("ball", (0.0, 0.09), mass=1.0, inertia=0.001)
    build.contact(ball, at=(0.0, 0.0), radius=0.05)
    robot = build.build()
    return hs.simulate(
        robot, state=robot.reference_state(), duration=0.16, method=method,
        ground=hs.Ground(friction=0.5), stop_when_fallen=False,
    )  # fmt: skip


def methods() -> Figure:
    """The same landing, step by step, under each method."""
    step = 0.02
    soft = hs.HuntCrossley(stiffness=2e4)
    shown: dict[str, tuple[hs.Run, str]] = {
        "Time stepping": (
            falling_ball(hs.TimeStepping(step=step)),
            "impulses over a step\nend at a gap of zero",
        ),
        "Event-driven": (
            falling_ball(hs.EventDriven()),
            "integrates up to the event,\nthen changes velocities",
        ),
        "Compliant": (
            falling_ball(hs.Compliant(law=soft, step=1e-3)),
            "a spring and damper give way\n(softened here, to be seen)",
        ),
    }
    figure = new_figure(9.0, 3.0)
    for axes, (name, (run, text)) in zip(
        figure.subplots(1, 3, sharey=True), shown.items(), strict=True
    ):
        gap = 1e3 * run.gap[:, 0]
        axes.axhspan(-8, 0, color="#EEEEEA", zorder=0)
        axes.plot(1e3 * run.time, gap, color=BLUE, marker="o" if len(gap) < 30 else "", ms=4)
        if name == "Event-driven":
            (first,) = [e for e in run.events if e.kind is EventKind.TOUCHDOWN][:1]
            axes.plot(1e3 * first.time, 0.0, "D", color=VERMILION, zorder=6)
            axes.annotate(
                "touchdown", (1e3 * first.time, 0.0), (1e3 * first.time + 8, 11), color=VERMILION,
                arrowprops={"arrowstyle": "-", "color": VERMILION},
            )  # fmt: skip
        axes.set_title(name, loc="left")
        axes.set(xlabel="time (ms)", ylim=(-8, 44), xlim=(0, 160))
        axes.text(155, 40, text, ha="right", va="top")
        axes.text(4, -6.4, "ground", color=GREY)
    figure.axes[0].set_ylabel("gap (mm)")
    return figure


def events() -> Figure:
    """A ball that bounces, slides and rolls, with the events of its run."""
    build = hs.RobotBuilder("ball")
    body = build.floating_base("ball", (0.0, 0.3), mass=1.0, inertia=0.001)
    build.contact(body, at=(0.0, 0.0), radius=0.05)
    robot = build.build()
    state = hs.State(robot.reference_state().q, [2.0, 0.0, 0.0])
    run = hs.simulate(
        robot, state=state, duration=1.5, method=hs.EventDriven(),
        ground=hs.Ground(friction=0.05, restitution=0.5), stop_when_fallen=False,
    )  # fmt: skip
    figure = new_figure(9.0, 3.6)
    height, slip = figure.subplots(2, 1, sharex=True)
    height.plot(run.time, 1e3 * run.gap[:, 0], color=BLUE)
    height.set(ylabel="gap (mm)", xlim=(0, 1.5), ylim=(0, 265))
    slip.plot(run.time, run.slip_velocity[:, 0], color=PURPLE)
    slip.set(ylabel="sliding\nspeed (m/s)", xlabel="time (s)")
    named: dict[EventKind, tuple[float, str]] = {}
    for event in run.events:
        named.setdefault(event.kind, (event.time, event.kind.name))
        height.axvline(event.time, color=GREY, linewidth=0.7, zorder=0)
    for i, (time, name) in enumerate(named.values()):
        for axes in (height, slip):
            axes.axvline(time, color=VERMILION, linewidth=1.2, zorder=1)
        height.annotate(name, (time, 250 - 38 * (i % 4)), (time + 0.012, 250 - 38 * (i % 4)),
                        color=VERMILION, va="top", annotation_clip=False)  # fmt: skip
    return figure


def gait_phases() -> Figure:
    """One step of bravo7 from touchdown to touchdown, and which foot stands."""
    robot = hs.load_robot("bravo7")
    gait = hs.optimize_gait(robot, step_length=0.30, step_duration=0.70, friction=0.75)
    run = hs.simulate(
        robot, hs.ComputedTorque(robot, gait), state=gait.initial_state,
        duration=2.0 * gait.step_duration, method=hs.EventDriven(),
        ground=hs.Ground(friction=0.75),
    )  # fmt: skip
    figure = new_figure(10.0, 3.7)
    robots, bars = figure.subplots(2, 1, height_ratios=(4.2, 1.0))
    phases = (0.0, 0.25, 0.5, 0.75, 1.0)
    bare(robots, "", (-0.8, 5.6), (-0.1, 2.25))
    ground(robots, -0.8, 5.6)
    words = (
        "touchdown:\nthe feet swap roles", "the swing foot\nlifts",
        "mid-swing:\nclearance", "the swing foot\ndescends", "touchdown:\nthe mirror image",
    )  # fmt: skip
    for i, (phase, text) in enumerate(zip(phases, words, strict=True)):
        row = int(np.searchsorted(run.time, phase * gait.step_duration))
        stick(robots, robot, run.position[row], (1.25 * i - run.position[row, 0], 0.0))
        word(robots, (1.25 * i, 1.95), f"σ = {phase:g}\n{text}")
    for i, foot in enumerate(robot.feet):
        down = np.abs(run.contact_force[:, list(foot.contacts), 0]).sum(axis=1) > 1e-6
        color = (BLUE, VERMILION)[i]
        name = robot.link_names[foot.link].replace("_", " ")
        start = None
        for t, on in zip(run.time, down, strict=True):
            if on and start is None:
                start = t
            elif not on and start is not None:
                bars.barh(name, t - start, left=start, color=color, height=0.6)
                start = None
        if start is not None:
            bars.barh(name, run.time[-1] - start, left=start, color=color, height=0.6)
    bars.axvline(gait.step_duration, color=INK, linewidth=1.0)
    bars.set(xlim=(0, run.time[-1]), xlabel="time (s); a bar where a foot presses the ground")
    bars.grid(visible=False)
    return figure


def footstep_feedback() -> Figure:
    """Capture point, centre of pressure and the planned foothold."""
    figure = new_figure(8.0, 3.4)
    axes = figure.subplots()
    bare(axes, "", (-0.45, 1.5), (-0.42, 1.15))
    ground(axes, -0.45, 1.5)
    mass = np.array([0.18, 0.9])
    axes.plot([0.0, mass[0]], [0.0, mass[1]], color=GREY, linewidth=2.5)
    axes.plot(*mass, "o", color=INK, markersize=14)
    word(axes, (mass[0] + 0.08, mass[1] + 0.06), "centre of mass x, speed ẋ", INK, "left")
    arrow(axes, (mass[0] + 0.05, mass[1]), (mass[0] + 0.3, mass[1]), INK)
    axes.plot([-0.12, 0.12], [0.015, 0.015], color=BLUE, linewidth=5, solid_capstyle="butt")
    axes.plot([0.88, 1.12], [0.015, 0.015], color=VERMILION, linewidth=5, solid_capstyle="butt")
    word(axes, (-0.14, 0.08), "stance sole", BLUE, "right")
    word(axes, (1.14, 0.08), "next foothold u", VERMILION, "left")
    for x, name, color, depth in (
        (0.06, "p  centre of pressure", INK, -0.12),
        (0.42, "ξ = x + ẋ/ω  capture point now", GREEN, -0.22),
        (0.93, "ξ(T) at the landing", GREEN, -0.12),
    ):
        axes.plot(x, 0.0, "D", color=color, zorder=7)
        axes.plot([x, x], [0, depth + 0.04], color=color, linewidth=0.8)
        word(axes, (x, depth), name, color)
    arrow(axes, (0.44, 0.05), (0.91, 0.05), GREEN, bend=-0.25)
    word(axes, (0.7, 0.27), "moves away from p as e^(ω t)", GREEN)
    word(axes, (0.6, -0.36), "The plan chooses p, u and the time T, so that ξ(T) is where the gait"
         " wants it on the next foot.")  # fmt: skip
    return figure


def step() -> Figure:
    """One turn of the loop that all methods share."""
    figure = new_figure(9.5, 2.3)
    axes = figure.subplots()
    axes.set(xlim=(-0.1, 10.0), ylim=(-0.75, 1.35))
    axes.axis("off")
    parts = (
        ("prepare", "places, Jacobians,\nmass matrix, gaps"),
        ("ask", "the controller\nwrites torques"),
        ("decide", "contact problem,\ncertificate"),
        ("report", "a row of\nthe record"),
        ("move", "q and v at the\nnext instant"),
    )
    for i, (name, text) in enumerate(parts):
        left = 2.0 * i
        axes.add_patch(
            FancyBboxPatch(
                (left + 0.1, 0.05), 1.5, 1.05, boxstyle="round,pad=0.08", facecolor="white",
                edgecolor=BLUE, linewidth=1.6,
            )
        )  # fmt: skip
        axes.text(left + 0.85, 0.88, name, ha="center", va="center", color=BLUE, weight="bold")
        axes.text(left + 0.85, 0.38, text, ha="center", va="center", fontsize=9)
        if i + 1 < len(parts):
            arrow(axes, (left + 1.7, 0.57), (left + 2.0, 0.57), INK)
    axes.plot([8.85, 8.85, 0.85, 0.85], [-0.05, -0.45, -0.45, -0.05], color=INK)
    arrow(axes, (0.85, -0.3), (0.85, -0.04), INK)
    axes.text(4.85, -0.62, "next instant", ha="center", va="center")
    return figure


def saltation() -> Figure:
    """A disturbed motion meets an event later, and spends the time between under the other rate."""
    figure = new_figure(7.5, 3.2)
    axes = figure.subplots()
    after, late = 0.6, 0.5  # the rate after the event; how late the disturbed motion meets it
    time = np.array([-2.0, 0.0, 2.0])
    axes.plot(time, [2.0, 0.0, 1.2], color=BLUE, label="periodic motion")
    axes.plot([-2.0, late, 2.0], [2.5, 0.0, after * (2.0 - late)], color=VERMILION,
              label="disturbed motion")  # fmt: skip
    axes.axhline(0.0, color=GREY, linewidth=1.0, linestyle="--")
    axes.text(-1.95, 0.08, "event: g = 0", color=GREY)
    arrow(axes, (0.0, -0.22), (late, -0.22), INK, both=True)
    axes.text(0.5 * late, -0.42, "δt", ha="center", va="center")
    arrow(axes, (-1.5, 1.5), (-1.5, 2.0), INK, both=True)
    axes.text(-1.57, 1.45, "error e", va="center", ha="right")
    arrow(axes, (1.6, after * 1.6), (1.6, after * (1.6 - late)), INK, both=True)
    axes.text(1.57, 0.98, "error S e", va="bottom", ha="right")
    axes.text(-0.85, 0.62, "rate f⁻", color=BLUE, ha="right")
    axes.text(0.75, 0.62, "rate f⁺", color=BLUE)
    axes.set(xlabel="time", ylabel="a coordinate", xlim=(-2, 2.2), ylim=(-0.6, 2.6), xticks=[],
             yticks=[])  # fmt: skip
    axes.legend(loc="upper right")
    return figure


def virtual_constraint() -> Figure:
    """The phase of a robot on point feet: the angle of its stance leg."""
    robot = hs.load_robot("rabbit")
    gait = hs.optimize_gait(
        robot, step_length=0.21, step_duration=0.58, clearance=0.02, friction=0.6
    )
    figure = new_figure(8.5, 3.4)
    leg, joints = figure.subplots(1, 2, width_ratios=(0.8, 1.2))
    phased = hs.PhasedGait.from_gait(robot, gait)
    zero = hs.zero_dynamics(phased)
    run = hs.simulate(
        robot, hs.VirtualConstraints(phased, kp=400.0, kd=40.0), state=zero.initial_state,
        duration=0.95 * zero.period, method=hs.EventDriven(rtol=1e-8),
    )  # fmt: skip
    row = int(0.88 * len(run.time))
    bare(leg, "Phase θ", (-0.5, 0.6), (-0.1, 1.6))
    ground(leg, -0.5, 0.6)
    q = run.position[row]
    shift = (-q[0], 0.0)
    stick(leg, robot, q, shift)
    places = dynamics.contact_positions(robot, q) + np.asarray(shift)
    standing = places[int(np.argmin(places[:, 1]))]
    hip = np.array([0.0, q[1]])
    leg.plot(*np.array([standing, hip]).T, color=GREEN, linestyle="--", zorder=6)
    leg.plot([standing[0]] * 2, [standing[1], standing[1] + 0.75], color=GREY, linestyle=":")
    lean = float(np.arctan2(*(hip - standing)))
    turn(leg, standing, 0.6, np.pi / 2, np.pi / 2 - lean, GREEN)
    word(leg, (standing[0] - 0.12, 0.55), "θ", GREEN)
    word(leg, (standing[0] + 0.06, -0.06), "stance foot", INK)
    angles = np.arctan2(run.position[:, 0] - standing[0] - q[0], run.position[:, 1] - standing[1])
    for j, name in enumerate(robot.actuator_names):
        joints.plot(angles, run.position[:, 3 + j], color=(BLUE, SKY, VERMILION, PURPLE)[j],
                    label=name.replace("_", " "))  # fmt: skip
    joints.set(xlabel="phase θ (rad)", ylabel="joint (rad)")
    joints.set_title("Joints follow q = h(θ), not time", loc="left")
    joints.legend(loc="upper left")
    return figure


DIAGRAMS: tuple[Callable[[], Figure], ...] = (
    frames, contact_frame, methods, events, gait_phases, footstep_feedback, step, saltation,
    virtual_constraint,
)  # fmt: skip


def main() -> None:
    """Draw all diagrams."""
    os.environ["SOURCE_DATE_EPOCH"] = "0"  # the same picture is the same file
    for diagram in DIAGRAMS:
        with styled():
            figure = diagram()
        print(save_figure(figure, IMAGES / f"{diagram.__name__}.svg"))


if __name__ == "__main__":
    main()
