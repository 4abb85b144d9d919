"""Numbers and memory of the controllers that keep their balance."""

from __future__ import annotations

from heelstrike.compiler.bundle import Bundle, array, cell, number, part
from heelstrike.control.balance.constrained import Constrained
from heelstrike.control.balance.footsteps import Plan, Planning
from heelstrike.control.balance.reference import Reference
from heelstrike.control.quadratic.program import Program
from heelstrike.robot.model import Floats, Integers
from heelstrike.sim.controller.stance_clock import StanceClock


class Weights(Bundle):
    """How much tasks count against each other, by the square of what is missed."""

    pressure: float = number(float)
    """Centre of pressure (1/m²)."""
    height: float = number(float)
    swing: float = number(float)
    """height, swing: Accelerations of hip and swing foot (s⁴/m²)."""
    pitch: float = number(float)
    angle: float = number(float)
    posture: float = number(float)
    """pitch, angle, posture: Those of trunk, swing foot and joints (s⁴/rad²)."""
    torque: float = number(float)
    """Torques (1/(N m)²)."""


class Legs(Bundle):
    """What a whole-body controller knows of the legs."""

    point: Floats = array(2, 2)
    """Middle of each sole in the axes of its link (m)."""
    angle: Floats = array(2)
    """Angle of its link as the foot lies flat (rad)."""
    hip: Integers = array(2, of=int)
    """Link of each thigh, whose origin is the hip."""
    knee: Integers = array(2, of=int)
    """Actuator of each knee."""
    straight: Floats = array(2)
    bend: Floats = array(2)
    """straight, bend: Where a knee is straight (rad), and the sign in which it bends."""
    length: float = number(float)
    """From hip to ankle with a straight knee (m)."""


class Parameters(Bundle):
    """Numbers of the law."""

    reference: Reference = part(Reference)
    planning: Planning = part(Planning)
    weights: Weights = part(Weights)
    legs: Legs = part(Legs)
    """The gait, how landings are planned, how much tasks count, the legs."""
    constrained: Integers = array(2, of=int, address=True)
    """Addresses of the straight-line code of the robot on each foot, zero where there is none."""
    adapts: int = number(int)
    """Whether foothold and time are adapted; otherwise they are the gait's."""
    speed: float = number(float)
    """That is wanted (m/s); zero to stop and stand."""
    kp: float = number(float)
    kd: float = number(float)
    """kp, kd: Gains of hip and trunk (1/s², 1/s)."""
    foot_kp: float = number(float)
    foot_kd: float = number(float)
    """foot_kp, foot_kd: Gains of the swing foot's height and angle."""
    joint_kp: float = number(float)
    joint_kd: float = number(float)
    """joint_kp, joint_kd: Gains of the posture."""
    knee_kp: float = number(float)
    """How hard a knee is kept from straightening too far (1/s²)."""
    friction: float = number(float)
    """That the ground is believed to have."""
    least_force: float = number(float)
    """Least normal force on the stance foot (N)."""
    weight: float = number(float)
    """Of the robot (N)."""
    touchdown: float = number(float)
    """Phase from which on a contact of the swing foot is a touchdown."""
    landing: float = number(float)
    """A foot that touches without coming flat counts as landed after this time (s)."""
    calm: float = number(float)
    alarmed: float = number(float)
    """calm, alarmed: Errors of the capture point at the end of the step (m) up to which the gait is
    followed, and from which on balance is all that counts."""
    calming: float = number(float)
    """Time in which an alarm fades, evenly (s)."""
    believed: float = number(float)
    """Part of the slope between two footholds by which the estimate follows it."""
    flat: float = number(float)
    """Points of the stance foot less than this above the ground touch it (m)."""
    crouch: float = number(float)
    lift: float = number(float)
    """crouch, lift: How much lower the hip, how much higher the swing foot is when alarmed (m)."""
    away: float = number(float)
    """How far a swing foot that has hit a wall is taken back, and how much higher than there the
    ground behind it is taken to be (m)."""
    most_raised: float = number(float)
    """How high that ground is taken to be at most (m)."""
    bent_knee: float = number(float)
    straight_knee: float = number(float)
    """bent_knee, straight_knee: How far a knee stays bent when alarmed, and otherwise (rad)."""
    slow: float = number(float)
    fast: float = number(float)
    """slow, fast: Speeds at which a late foot looks for the ground (m/s), first and after
    `search`."""
    haste: float = number(float)
    """The swing foot is not brought to its foothold in less than this (s)."""
    search: float = number(float)
    smoothing: float = number(float)
    """search, smoothing: That time, and the one in which the reference's clock follows new plans
    (s)."""
    hold: float = number(float)
    """A robot that stands takes a step if its capture point is farther from the middle of its sole
    than this (m)."""


class Memory(StanceClock):
    """What the law remembers."""

    time: float = cell(float)
    """Of the last call (s)."""
    stands: int = cell(int)
    """Whether the robot stands on both feet."""
    phase: float = cell(float)
    rate: float = cell(float)
    """phase, rate: Where in the step the reference is, and how fast it moves (1/s)."""
    raised: float = cell(float)
    """How much higher the swing foot is held, because it has hit something (m)."""
    lifting: int = cell(int)
    """Whether the swing foot is lifted clear of a wall that it has hit."""
    back: float = cell(float)
    top: float = cell(float)
    until: float = cell(float)
    """back, top, until: Where it is held meanwhile, or as the robot stands (m), up to which height
    (m), and until when at the latest (s)."""
    late: float = cell(float)
    """For how long the swing foot has looked for the ground (s)."""
    alarm: float = cell(float)
    """From 0, the gait is followed, to 1, balance is all that counts."""
    slope: float = cell(float)
    """Tangent of the ground's inclination, by the last footholds."""
    steps: int = cell(int)
    """Touchdowns so far."""
    sole: Floats = array(2)
    swing: Floats = array(2)
    mass: Floats = array(2)
    """sole, swing, mass: Middle of the stance and of the swing sole, and centre of mass (m)."""
    speed: Floats = array(2)
    """Velocity of the swing sole (m/s)."""
    rear: Floats = array(2)
    """Where the sole was that stood before (m)."""
    plan: Plan = part(Plan)
    on: Constrained = part(Constrained)
    program: Program = part(Program)
    """The landing that is planned, the robot on its foot, and the last quadratic programme."""
    relaxed: int = cell(int)
    unsolved: int = cell(int)
    """relaxed, unsolved: Programmes that gave up rows, and those that were not solved."""


class Log(Bundle):
    """What the law tells of itself."""

    phase: float = cell(float, label="Phase of the step")
    alarm: float = cell(float, label="Alarm")
    """From 0, the gait is followed, to 1, balance is all that counts."""
    capture_point: float = cell(float, unit="m", label="Capture point before the stance sole")
    foothold: float = cell(float, unit="m", label="Planned foothold before the stance sole")
    pressure: float = cell(float, unit="m", label="Wanted centre of pressure")
    remaining: float = cell(float, unit="s", label="Time until the landing")
    slope: float = cell(float, label="Estimated slope")
    relaxed: int = cell(int, label="Levels of rows given up")
    """By the quadratic programme."""
