"""The contact problem of an instant: the motion without contact, and what is asked of contacts."""

from __future__ import annotations

from heelstrike.compiler.compilation import dissolved_kernel, kernel
from heelstrike.contact.modes import OPEN, SLIDING_BACKWARD, SLIDING_FORWARD, SOLVED, STICK
from heelstrike.contact.problem import solve_contact_kernel
from heelstrike.contact.workspace import ContactWorkspace
from heelstrike.dynamics.kernels import passive_force
from heelstrike.robot.model import Floats, Integers, Model
from heelstrike.sim.contacts.candidates import part_of
from heelstrike.sim.contacts.dry_friction import add_dry_force
from heelstrike.sim.contacts.geometry import solve_mass_matrix
from heelstrike.sim.contacts.latches import hold
from heelstrike.sim.contacts.loops import rows_of
from heelstrike.sim.contacts.rows import Rows
from heelstrike.sim.event_driven.phase import HeldRows, Phase
from heelstrike.sim.memory import Assembly, Equations, Loops
from heelstrike.sim.push import Pushes, add_pushes


@dissolved_kernel
def free_acceleration(
    model: Model, state: Floats, torque: Floats, rows: Rows, slide: Integers, breakaway: Floats,
    pushes: Pushes, equations: Equations, force: Floats,
) -> None:  # fmt: skip
    """Acceleration without contact, A⁻¹ (B Γ + passive + pushes − H), into ``equations.rate``.

    The equations of the state have been evaluated. Dry friction of the joints that move is one of
    the passive forces. What is multiplied by A⁻¹ goes to `force`.
    """
    rate = equations.rate
    passive_force(model, state[: model.nq], state[model.nq :], force)
    add_pushes(model, equations.tree, pushes, force)
    for i in range(model.nu):
        force[model.actuator_joint[i]] += torque[i]
    add_dry_force(slide, breakaway, rows, force)
    for i in range(model.nv):
        force[i] -= equations.bias[i]
        rate[i] = force[i]
    solve_mass_matrix(model, equations, rate)


@dissolved_kernel
def hold_row(place: int, row: int, ratio: float, size: int, held: HeldRows) -> int:
    """List a row of a candidate after the `size` that are held; return how many there are then.

    `ratio` is the friction that its force brings along.
    """
    held.place[size], held.row[size], held.friction_ratio[size] = place, row, ratio
    return size + 1


@kernel
def tell_parts(count: int, watched: int, assembly: Assembly, values: Floats, told: Floats) -> None:
    """Tell the normal and tangential parts of numbers of the candidates' rows by their entries.

    Those of other entries are zero.
    """
    for entry in range(watched):
        told[entry, 0], told[entry, 1] = 0.0, 0.0
    for place in range(count):
        its = told[assembly.candidate[place]]
        its[0], its[1] = part_of(place, assembly.problem.first, values)


@kernel
def pose_problem(
    count: int, total: int, accelerations: bool, sets: Integers, friction: Floats, guess: Integers,
    slide: Integers, stop: Integers, held: Integers, assembly: Assembly,
) -> None:  # fmt: skip
    """Pose the contact problem of the candidates at the level of accelerations or velocities.

    These are `count` contacts and, up to `total`, the rows of the loops, whose sets are there.
    Matrix, free term and bounds are there, too. Of accelerations, points that slide are prescribed
    to go on doing so: their friction is known. Sets, friction and modes to begin with are written.
    """
    problem, mode = assembly.problem, assembly.answer.mode
    for place in range(count):
        contact = assembly.candidate[place]
        problem.set[place] = sets[contact]
        problem.friction[place] = friction[contact]
        mode[place] = STICK
        if accelerations:
            if slide[contact] > 0:
                mode[place] = SLIDING_FORWARD
            elif slide[contact] < 0:
                mode[place] = SLIDING_BACKWARD
            elif guess[contact] < SLIDING_FORWARD:
                mode[place] = guess[contact]
    hold(count, stop, held, assembly.candidate, problem.set)
    problem.count = total
    for place in range(count, total):
        mode[place] = STICK


@kernel
def solve_candidates(
    count: int, loops: Loops, accelerations: bool, friction: Floats, guess: Integers, rows: Rows,
    slide: Integers, solvers: Integers, assembly: Assembly, solver: ContactWorkspace,
) -> int:  # fmt: skip
    """Pose the contact problem of the candidates and solve it; return the solver's status.

    Forces or impulses and modes go to ``assembly.answer``.
    """
    total = count + rows_of(loops)
    pose_problem(
        count, total, accelerations, rows.set, friction, guess, slide, rows.latch_stop, loops.held,
        assembly,
    )  # fmt: skip
    return int(solve_contact_kernel(solvers, assembly.problem, solver, assembly.answer))


@kernel
def share_redundant(
    count: int, loops: Loops, friction: Floats, guess: Integers, rows: Rows, phase: Phase,
    assembly: Assembly, solver: ContactWorkspace,
) -> None:  # fmt: skip
    """Find forces within their limits where the equations leave open who carries what.

    A biped that stands on stuck joints, or a table on four legs: the equations of motion have many
    solutions, and the one at hand may leave a friction cone or pull at a contact that others
    relieve. While the contact problem says that everything stays as it is, its forces stand, and no
    limit is reached.
    """
    modes, watch = phase.modes, phase.watch
    short = False
    for place in range(count):
        contact = assembly.candidate[place]
        short = short or watch.value[2 * contact] < 0.0
        short = short or (modes.holder[contact] == 1 and watch.value[2 * contact + 1] < 0.0)
    if not short:
        return
    status = solve_candidates(
        count, loops, True, friction, guess, rows, modes.slide, phase.forces.solvers, assembly,
        solver,
    )  # fmt: skip
    if status != SOLVED:
        return
    for place in range(count):
        contact = assembly.candidate[place]
        found = assembly.answer.mode[place]
        if found == OPEN:
            return
        if found != STICK and modes.slide[contact] == 0 and friction[contact] > 0.0:
            return
    for place in range(count):
        contact = assembly.candidate[place]
        force = phase.forces.force[contact]
        force[0], force[1] = part_of(place, assembly.problem.first, assembly.answer.impulse)
        if watch.value[2 * contact] < 0.0:
            watch.value[2 * contact] = 1.0
        if modes.holder[contact] == 1 and watch.value[2 * contact + 1] < 0.0:
            watch.value[2 * contact + 1] = 1.0


@kernel
def slides(count: int, friction: Floats, slide: Integers, candidate: Integers) -> bool:
    """Whether any of the candidates slides with friction."""
    for place in range(count):
        contact = candidate[place]
        if slide[contact] != 0 and friction[contact] > 0.0:
            return True
    return False
