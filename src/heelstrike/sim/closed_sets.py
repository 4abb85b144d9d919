"""The closed sets of a simulation: how it ends, what can happen, how time is stepped."""

from __future__ import annotations

import enum


class RunStatus(enum.Enum):
    """How a run ended; ``run.message`` says it in words, with the time.

    ``COMPLETED``, ``FELL``
        The time is up; the centre of mass sank below half its first height.
    ``STOPPED``
        The controller ended it, for a reason of its own: see :class:`~heelstrike.EndOfRun`.
    ``DIVERGED``
        The state stopped being finite.
    ``SOLVER_FAILED``
        No contact forces or impulses could be certified. An event-driven run tries bridges first.
    ``CONTROLLER_FAILED``, ``INTERRUPTED``
        The controller raised, or asked for what is no number; somebody pressed Ctrl-C.
    """

    COMPLETED = "completed"
    FELL = "fell"
    STOPPED = "stopped"
    DIVERGED = "diverged"
    INTERRUPTED = "interrupted"
    SOLVER_FAILED = "solver_failed"
    CONTROLLER_FAILED = "controller_failed"


class OnError(enum.StrEnum):
    """How an error in a controller is reported; the run ends and keeps its data.

    ``WARN``, ``STOP``
        A warning tells of it, with its traceback; nothing but status and message does.
    ``RAISE``
        It is raised.
    """

    WARN = "warn"
    STOP = "stop"
    RAISE = "raise"


class EventKind(enum.IntEnum):
    """What happened at a contact point.

    ``TOUCHDOWN`` and ``LIFTOFF``
        It met the ground, with the impulse that took; it left the ground.
    ``SLIP``, ``STICK``, ``SLIP_REVERSAL``
        It began to slide; it came to rest; it slides the other way.
    ``IMPACT``
        It was on the ground and received an impulse from an impact elsewhere.
    ``ZENO``
        Its ever smaller bounces have come to an end, and it stays on the ground. Bounces shorter
        than 1e-8 s are not followed, nor what restitution is in those shorter than 1e-6 s.
    ``PAINLEVE``
        No contact force, or several, agreed with the laws of motion and friction. With an impulse:
        the velocity jumped without a collision. Without: one of the solutions was chosen.
    ``ENERGY_GAIN``
        Newton's restitution with friction made energy in an impact (Kane's paradox), by the point
        with the largest impulse; ``run.certificates.energy_gain`` is how much. Under
        ``TimeStepping(bounded_restitution=True)`` it would have, and was scaled back.
    ``JOINT_STOP``
        A joint reached the end of its range, with the impulse that took, or was pressed against it
        by an impact elsewhere (or, held by a latch, pulled off it: the impulse is negative then);
        the event's `contact` is the index of the joint.
    ``JOINT_SLIP``, ``JOINT_STICK``
        A joint with dry friction broke away, or turned round; it came to rest. The event's
        `contact` is the index of the joint.
    ``BRIDGE``
        Contact events piled up without time moving on, or no forces agreed with the laws: a short
        time is bridged by impulses at its beginning, which are told of by events of their own. The
        event's `impulse` is the length of the bridge (s) and how far its end may be wrong (the
        largest error of a coordinate or velocity), its `contact` zero. On compliant ground: torques
        of a controller that switches to and fro were held, for that long in all until the next
        sample, and velocities may be wrong by so much.
    ``WEDGED``
        It is in the ground, by so little as rounding and turning explain, and neither it nor a
        joint can be pushed out without the other being pressed in: from here on they are left where
        they are until that ends. Or friction between two faces of the ground lets nothing out of a
        corner, so that it does not bounce either.
    ``JOINT_RELEASE``
        A latch let go of a joint, whose index the event's `contact` is.
    ``JOINT_BRAKE``
        A brake that was put on took hold of a joint, whose index the event's `contact` is, with the
        impulse on its coordinate (N m s, N s of a slide) that it took.
    ``CONSTRAINT_HOLDS``, ``CONSTRAINT_LETS_GO``
        A constraint from outside came to hold, as a cable that becomes taut, with its impulse; or
        it let go. The event's `contact` is its place among the robot's constraints.
    ``UNCERTIFIED``
        Of a robot in space: a step went on although its contact problem is solved to 1e-6 only, not
        to 1e-9. It happens at no point; the event's `contact` is −1, as that of ``ENERGY_GAIN`` is
        there. ``JOINT_SLIP`` and ``JOINT_STICK`` have the index of the velocity there.
    """

    TOUCHDOWN = 0
    LIFTOFF = 1
    SLIP = 2
    STICK = 3
    SLIP_REVERSAL = 4
    IMPACT = 5
    ZENO = 6
    PAINLEVE = 7
    ENERGY_GAIN = 8
    JOINT_STOP = 9
    JOINT_SLIP = 10
    JOINT_STICK = 11
    BRIDGE = 12
    WEDGED = 13
    JOINT_RELEASE = 14
    JOINT_BRAKE = 15
    CONSTRAINT_HOLDS = 16
    CONSTRAINT_LETS_GO = 17
    UNCERTIFIED = 18

    @property
    def of_joint(self) -> bool:
        """Whether it happens to a joint, and not to a contact point."""
        return self.name.startswith("JOINT_")

    @property
    def of_constraint(self) -> bool:
        """Whether it happens to a constraint from outside."""
        return self.name.startswith("CONSTRAINT_")


class Scheme(enum.IntEnum):
    """How :class:`~heelstrike.sim.time_stepping.method.TimeStepping` discretises time.

    ``GAP_LINEARISED``
        Semi-implicit Euler; the gap at the end of the step, linearised, may not be negative
        (Stewart and Trinkle 1996; Anitescu and Potra 1997).
    ``PAPER_EXPLICIT``
        The paper's eq. 23-26 as printed: positions move with the old velocity, forces are those
        at the old position, vertices are active when their gap is not positive.
    ``PAPER_SYMPLECTIC``
        The paper's text below eq. 23: positions move with the old velocity, then the new velocity
        is computed at the new position, where the vertices whose gap is not positive are active.
    ``MOREAU_JEAN``
        Moreau's scheme with Newton's restitution: points whose gap is foreseen to close within
        half a step get ``v_n⁺ + e v_n ≥ 0``; positions move with the mean velocity, and joint
        springs and dampers act as in the middle of the step, to first order (Moreau 1988; Jean
        1999; θ = γ = 1/2). Gravity, Coriolis forces and motors act as at its beginning: a pendulum
        that swings with ω gains (ω h)²/2 of its energy a step.
    ``LINEARLY_IMPLICIT``
        ``GAP_LINEARISED`` with joint springs, dampers and controller gains at the end of the step,
        to first order (Anitescu and Potra 2002, the paper's [17]).
    ``IMPACT_RESOLVED``
        ``GAP_LINEARISED``, but a contact that closes within a step is an impact within that step,
        of all contacts that touch, with Newton's restitution: positions arrive as there, velocities
        are those behind the impact.
    """

    GAP_LINEARISED = 0
    PAPER_EXPLICIT = 1
    PAPER_SYMPLECTIC = 2
    MOREAU_JEAN = 3
    LINEARLY_IMPLICIT = 4
    IMPACT_RESOLVED = 5

    @property
    def label(self) -> str:
        """Its name in prose and on the command line: ``moreau-jean``."""
        return self.name.lower().replace("_", "-")
