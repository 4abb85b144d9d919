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
    """How much tasks count against each other, by the square of what is missed.

    Attributes
    ----------
    pressure : float
        Centre of pressure (1/m²).
    height, swing : float
        Accelerations of hip and swing foot (s⁴/m²).
    pitch, angle, posture : float
        Those of trunk, swing foot and joints (s⁴/rad²).
    torque : float
        Torques (1/(N m)²).
    """

    pressure: float = number(float)
    height: float = number(float)
    swing: float = number(float)
    pitch: float = number(float)
    angle: float = number(float)
    posture: float = number(float)
    torque: float = number(float)


class Legs(Bundle):
    """What a whole-body controller knows of the legs.

    Attributes
    ----------
    point : (2, 2) float
        Middle of each sole in the axes of its link (m).
    angle : (2,) float
        Angle of its link as the foot lies flat (rad).
    hip : (2,) int
        Link of each thigh, whose origin is the hip.
    knee : (2,) int
        Actuator of each knee.
    straight, bend : (2,) float
        Where a knee is straight (rad), and the sign in which it bends.
    length : float
        From hip to ankle with a straight knee (m).
    """

    point: Floats = array(2, 2)
    angle: Floats = array(2)
    hip: Integers = array(2, of=int)
    knee: Integers = array(2, of=int)
    straight: Floats = array(2)
    bend: Floats = array(2)
    length: float = number(float)


class Parameters(Bundle):
    """Numbers of the law.

    Attributes
    ----------
    reference : Reference
    planning : Planning
    weights : Weights
    legs : Legs
        The gait, how landings are planned, how much tasks count, the legs.
    adapts : int
        Whether foothold and time are adapted; otherwise they are the gait's.
    speed : float
        That is wanted (m/s); zero to stop and stand.
    kp, kd : float
        Gains of hip and trunk (1/s², 1/s).
    foot_kp, foot_kd : float
        Gains of the swing foot's height and angle.
    joint_kp, joint_kd : float
        Gains of the posture.
    knee_kp : float
        How hard a knee is kept from straightening too far (1/s²).
    friction : float
        That the ground is believed to have.
    least_force : float
        Least normal force on the stance foot (N).
    weight : float
        Of the robot (N).
    touchdown : float
        Phase from which on a contact of the swing foot is a touchdown.
    landing : float
        A foot that touches without coming flat counts as landed after this time (s).
    calm, alarmed : float
        Errors of the capture point at the end of the step (m) up to which the gait is followed,
        and from which on balance is all that counts.
    calming : float
        Time in which an alarm fades, evenly (s).
    believed : float
        Part of the slope between two footholds by which the estimate follows it.
    flat : float
        Points of the stance foot less than this above the ground touch it (m).
    crouch, lift : float
        How much lower the hip, how much higher the swing foot is when alarmed (m).
    away : float
        How far a swing foot that has hit a wall is taken back, and how much higher than there the
        ground behind it is taken to be (m).
    most_raised : float
        How high that ground is taken to be at most (m).
    bent_knee, straight_knee : float
        How far a knee stays bent when alarmed, and otherwise (rad).
    slow, fast : float
        Speeds at which a late foot looks for the ground (m/s), first and after `search`.
    haste : float
        The swing foot is not brought to its foothold in less than this (s).
    search, smoothing : float
        That time, and the one in which the reference's clock follows new plans (s).
    hold : float
        A robot that stands takes a step if its capture point is farther from the middle of its sole
        than this (m).
    """

    reference: Reference = part(Reference)
    planning: Planning = part(Planning)
    weights: Weights = part(Weights)
    legs: Legs = part(Legs)
    adapts: int = number(int)
    speed: float = number(float)
    kp: float = number(float)
    kd: float = number(float)
    foot_kp: float = number(float)
    foot_kd: float = number(float)
    joint_kp: float = number(float)
    joint_kd: float = number(float)
    knee_kp: float = number(float)
    friction: float = number(float)
    least_force: float = number(float)
    weight: float = number(float)
    touchdown: float = number(float)
    landing: float = number(float)
    calm: float = number(float)
    alarmed: float = number(float)
    calming: float = number(float)
    believed: float = number(float)
    flat: float = number(float)
    crouch: float = number(float)
    lift: float = number(float)
    away: float = number(float)
    most_raised: float = number(float)
    bent_knee: float = number(float)
    straight_knee: float = number(float)
    slow: float = number(float)
    fast: float = number(float)
    haste: float = number(float)
    search: float = number(float)
    smoothing: float = number(float)
    hold: float = number(float)


class Memory(StanceClock):
    """What the law remembers.

    Attributes
    ----------
    time : float
        Of the last call (s).
    stands : int
        Whether the robot stands on both feet.
    phase, rate : float
        Where in the step the reference is, and how fast it moves (1/s).
    raised : float
        How much higher the swing foot is held, because it has hit something (m).
    lifting : int
        Whether the swing foot is lifted clear of a wall that it has hit.
    back, top, until : float
        Where it is held meanwhile, or as the robot stands (m), up to which height (m), and until
        when at the latest (s).
    late : float
        For how long the swing foot has looked for the ground (s).
    alarm : float
        From 0, the gait is followed, to 1, balance is all that counts.
    slope : float
        Tangent of the ground's inclination, by the last footholds.
    steps : int
        Touchdowns so far.
    sole, swing, mass : (2,) float
        Middle of the stance and of the swing sole, and centre of mass (m).
    speed : (2,) float
        Velocity of the swing sole (m/s).
    rear : (2,) float
        Where the sole was that stood before (m).
    plan : Plan
    on : Constrained
    program : Program
        The landing that is planned, the robot on its foot, and the last quadratic programme.
    relaxed, unsolved : int
        Programmes that gave up rows, and those that were not solved.
    """

    time: float = cell(float)
    stands: int = cell(int)
    phase: float = cell(float)
    rate: float = cell(float)
    raised: float = cell(float)
    lifting: int = cell(int)
    back: float = cell(float)
    top: float = cell(float)
    until: float = cell(float)
    late: float = cell(float)
    alarm: float = cell(float)
    slope: float = cell(float)
    steps: int = cell(int)
    sole: Floats = array(2)
    swing: Floats = array(2)
    mass: Floats = array(2)
    speed: Floats = array(2)
    rear: Floats = array(2)
    plan: Plan = part(Plan)
    on: Constrained = part(Constrained)
    program: Program = part(Program)
    relaxed: int = cell(int)
    unsolved: int = cell(int)


class Log(Bundle):
    """What the law tells of itself.

    Attributes
    ----------
    phase : float
        Where in the step the reference is.
    alarm : float
        From 0, the gait is followed, to 1, balance is all that counts.
    capture_point, foothold, pressure : float
        Capture point, planned foothold and wanted centre of pressure from the stance sole (m).
    remaining : float
        Time until the landing that is planned (s).
    slope : float
        Of the ground, as estimated.
    relaxed : int
        Levels of rows that the quadratic programme had to give up.
    """

    phase: float = cell(float, label="Phase of the step")
    alarm: float = cell(float, label="Alarm")
    capture_point: float = cell(float, unit="m", label="Capture point before the stance sole")
    foothold: float = cell(float, unit="m", label="Planned foothold before the stance sole")
    pressure: float = cell(float, unit="m", label="Wanted centre of pressure")
    remaining: float = cell(float, unit="s", label="Time until the landing")
    slope: float = cell(float, label="Estimated slope")
    relaxed: int = cell(int, label="Levels of rows given up")
