"""Where in a step of the smooth motion an event function changes its sign.

The event functions of a contact point are positive while it keeps its mode: the gap of an open
point; the normal force of a closed one; the speed of a sliding one; what is left to the friction
limit of a sticking one.
"""

from __future__ import annotations

import math

from heelstrike.compiler.compilation import dissolved_kernel, kernel
from heelstrike.compiler.words import copy_words
from heelstrike.robot.model import Floats, Integers
from heelstrike.sim.contacts.faces import center_of, nearest_face
from heelstrike.sim.event_driven.dormand_prince import interpolate
from heelstrike.sim.event_driven.phase import Integration, Modes, Samples
from heelstrike.sim.event_driven.smooth.dynamics import evaluate, look
from heelstrike.sim.event_driven.smooth.faces import has_corners

NO_EVENT = 2.0
"""A fraction of a step beyond its end."""

SAMPLES = 4
"""Places in a step, evenly spaced, at which the event functions are looked at."""

EVENT_TIME = 1e-12
"""Seconds to which events are located: what 1 m/s is wrong by then is rounding of a robot's metre
times some thousands, and times of hours have still digits for it."""

TOGETHER = 1e-10
"""Points nearer to the ground than this (m) share an impact: a hundred times what 1 m/s makes of
``EVENT_TIME``, and less than the tolerance of a step."""

# How far an event function must be below zero to count: m, m/s, and a fraction of the weight.
GAP_NOISE = 1e-13
CORNER_NOISE = 1e-11
SPEED_NOISE = 1e-12
FORCE_NOISE = 1e-10
# A root is kept off the ends of its interval by this part of what it is located to, so that both
# ends move; one that is followed back from where it is negative is located to this part of that.
INSIDE, FINER = 0.4, 0.1
# A rate takes 4/27 of itself away from a cubic at the most; this is a little more.
TAKEN_AWAY = 0.15
# Where a point that has just left the ground is looked for: at this part of the way to the first
# sample, and so on, until that is less than this (s); and one that rises no further from it than
# this (m), until that is less than this (s).
EARLIER = 0.25
SOONEST = 1e-8
LOW, SOON = 1e-5, 1e-6
# How many faces and corners a point may pass between two samples; part of the way to the first
# sample after which it is told over which it is; a radius with which corners are faces, too.
MOST_FACES = 64
AT_ONCE = 1e-3
A_DISC = 1.0


@kernel
def copy_events(value: Floats, rate: Floats, kept_value: Floats, kept_rate: Floats) -> None:
    """Keep event functions and their rates."""
    copy_words(value, kept_value)
    copy_words(rate, kept_rate)


@kernel
def evaluate_within(part: float, length: float, with_forces: bool, within: Integration) -> None:
    """Event functions at a fraction of the step, with forces or only those that need none."""
    scene, memory, phase, step = within.scene, within.memory, within.phase, within.step
    samples, state = step.samples, step.samples.state
    interpolate(part, step.begin, step.dense, state)
    if with_forces:
        time = step.time + part * length
        evaluate(scene, time, state, within.control, memory, phase, samples.slope)
    else:
        look(
            state, scene.model, scene.ground, memory.equations.tree, memory.rows, phase.modes,
            memory.surface, phase.watch,
        )  # fmt: skip


@kernel
def look_at_sample(function: int, part: float, length: float, within: Integration) -> None:
    """Let the sample of an event function be that at a fraction of the step."""
    evaluate_within(part, length, False, within)
    watch, samples = within.phase.watch, within.step.samples
    samples.sample[function] = watch.value[function]
    samples.sample_rate[function] = watch.rate[function]


@kernel
def is_geometric(function: int, modes: Modes) -> bool:
    """Whether an event function needs no forces: a gap, or the speed of what slides."""
    contact = function // 2
    if contact >= modes.watched:
        return True
    slides = function % 2 == 1 and modes.slide[contact] != 0
    return bool(modes.closed[contact] == 0 or slides)


@kernel
def noise(function: int, modes: Modes, weight: float, samples: Samples) -> float:
    """How far an event function may be below zero without meaning it."""
    if function >= 2 * modes.watched:
        return CORNER_NOISE
    if modes.closed[function // 2] == 0:
        # An event is found to a time, and so a gap to what it closes in that time.
        speed = max(abs(samples.before_rate[function]), abs(samples.sample_rate[function]))
        return max(GAP_NOISE, EVENT_TIME * speed)
    return SPEED_NOISE if is_geometric(function, modes) else FORCE_NOISE * weight


@kernel
def find_root(
    function: int, turn: float, bracket: tuple[float, float, float, float], length: float,
    within: Integration,
) -> float:  # fmt: skip
    """Fraction of the step at which an event function first changes sign, or turns round.

    In the bracket (low, its value, high, its value) it is positive at `low` and negative at `high`;
    with `turn` not zero these are `turn` times its rate, which takes forces if it is that of a
    speed. Regula falsi that halves the interval every third time. An event function that is zero at
    `low`, where its phase begins, is first followed back from `high` to where it is positive.
    """
    watch = within.phase.watch
    low, low_value, high, high_value = bracket
    with_forces = (function % 2 == 1 and turn != 0.0) or not is_geometric(
        function, within.phase.modes
    )
    width = EVENT_TIME / length
    going_back = low_value <= 0.0
    for attempt in range(200):
        if high - low <= (FINER * width if going_back else width):
            break
        part = low + 0.5 * (high - low)
        if attempt % 3 != 2 and not going_back:
            part = high - high_value * (high - low) / (high_value - low_value)
            part = min(max(part, low + INSIDE * width), high - INSIDE * width)
        evaluate_within(part, length, with_forces, within)
        value = turn * watch.rate[function] if turn != 0.0 else watch.value[function]
        if value > 0.0:
            low = part
            low_value = value
            going_back = False
        else:
            high = part
            high_value = value
    return low if going_back else high


@kernel
def just_left(function: int, modes: Modes, samples: Samples) -> bool:
    """Whether it is the gap of an open contact still on the ground, or rising close above it."""
    contact = function // 2
    if contact >= modes.watched or function % 2 == 1 or modes.closed[contact] == 1:
        return False
    rises = samples.before_rate[function] >= 0.0
    return bool(samples.before[function] <= (LOW if rises else TOGETHER))


@kernel
def is_sliding_speed(function: int, modes: Modes) -> bool:
    """Whether it is the speed of what slides, whose rate is known."""
    contact = function // 2
    if contact >= modes.watched or function % 2 == 0 or modes.slide[contact] == 0:
        return False
    return bool(modes.group[contact] == contact)


@kernel
def may_dip(function: int, span: float, samples: Samples) -> bool:
    """Whether a function that falls at one sample and rises at the next may vanish between them.

    A convex one is nowhere below both tangents; it is given twice that depth.
    """
    before, rate = samples.before[function], samples.before_rate[function]
    value, later_rate = samples.sample[function], samples.sample_rate[function]
    where = (before - value + later_rate * span) / (later_rate - rate)
    if not 0.0 <= where <= span:
        return True
    return bool(2.0 * (before + rate * where) <= min(before, value))


@dissolved_kernel
def may_cross(function: int, span: float, modes: Modes, samples: Samples) -> bool:
    """Whether a function that is positive at two samples may pass zero between them.

    A gap has to fall by all that it is at the lower of its ends. A cubic falls by less than a sixth
    of what its rates at both ends would make of it in the whole time between them: one that has
    more left than all of that is not asked where it is lowest.
    """
    before, value = samples.before[function], samples.sample[function]
    if not (before > 0.0 and value > 0.0):
        return True
    contact = function // 2
    if contact >= modes.watched:
        return False
    rate, later_rate = samples.before_rate[function], samples.sample_rate[function]
    if function % 2 == 1:
        return bool(modes.slide[contact] != 0 and rate < 0.0 and later_rate > 0.0)
    if modes.closed[contact] == 1:
        return False
    return not min(before, value) > span * (max(-rate, 0.0) + max(later_rate, 0.0))


@kernel
def lowest_place(before: float, rate: float, value: float, later_rate: float) -> float:
    """Fraction of an interval at which the cubic through values and rates is lowest, if below zero.

    Rates are per interval. Returns ``NO_EVENT`` where it stays above zero.
    """
    down = max(-rate, 0.0) + max(later_rate, 0.0)
    if min(before, value) > TAKEN_AWAY * down:
        return NO_EVENT
    third = rate + later_rate - 2.0 * (value - before)
    second = value - before - rate - third
    root = second * second - 3.0 * third * rate
    if not root > 0.0 or (second <= 0.0 and third <= 0.0):
        return NO_EVENT
    root = math.sqrt(root)
    part = -rate / (second + root) if second > 0.0 else (root - second) / (3.0 * third)
    if not 0.0 < part < 1.0:
        return NO_EVENT
    lowest = before + part * (rate + part * (second + part * third))
    return part if lowest < -TOGETHER else NO_EVENT


@kernel
def crossing(function: int, low: float, high: float, length: float, within: Integration) -> float:
    """Fraction of the step at which an event function passes zero, between two samples of it.

    Of a point that has just left the ground the gap is zero but for rounding: it cannot come back
    before it turned round. If it got no higher than noise until then, it ends there, at rest.
    """
    modes, watch, step = within.phase.modes, within.phase.watch, within.step
    samples = step.samples
    before, begin = samples.before[function], low
    value, end = samples.sample[function], high
    rate, later_rate = samples.before_rate[function], samples.sample_rate[function]
    is_gap = function < 2 * modes.watched
    is_gap = is_gap and function % 2 == 0 and modes.closed[function // 2] == 0
    dips = rate < 0.0 and later_rate > 0.0 and value >= 0.0
    if dips and not is_gap:
        span = length * (high - low)
        dips = is_sliding_speed(function, modes) and may_dip(function, span, samples)
    if dips:
        # An open point came down and went up again, or what slides was slower: how near to zero?
        bracket = low, -rate, high, -later_rate
        end = find_root(function, -1.0, bracket, length, within)
        value = watch.value[function]
    least = noise(function, modes, watch.force_scale, samples)
    if is_gap and rate >= 0.0 and later_rate >= 0.0 and before <= least:
        # It rises: it is no nearer than before, but for the error of the dense output.
        least = step.absolute + step.relative
    if is_gap and not dips and value >= -least:
        # It may have been lower in between, and be on its way up at both ends.
        span = (high - low) * length
        dip = lowest_place(before, span * rate, value, span * later_rate)
        if dip < NO_EVENT:
            end = low + dip * (high - low)
            evaluate_within(end, length, False, within)
            value = watch.value[function]
    # What is below zero from the beginning tells nothing new until it falls further.
    if not value < -least - max(-before, 0.0):
        return NO_EVENT
    if is_gap and rate > 0.0 and later_rate < 0.0 and before <= least:
        bracket = low, rate, high, later_rate
        begin = find_root(function, 1.0, bracket, length, within)
        before = watch.value[function]
        if before <= least:
            return begin
    bracket = begin, before, end, value
    return find_root(function, 0.0, bracket, length, within)


@kernel
def may_turn(
    function: int, span: float, radius: Floats, closed: Integers, samples: Samples
) -> bool:
    """Whether a point might have been in the ground between two samples, over another face.

    No gap changes faster than the point moves, or the centre of a disc; and a disc goes through
    nothing while it moves by less than a quarter of its radius.
    """
    contact = function // 2
    if function % 2 == 1 or contact >= radius.shape[0] or closed[contact] == 1:
        return False
    speed = samples.before_rate[function + 1] + samples.sample_rate[function + 1]
    way = samples.before[function] + samples.sample[function]
    return bool(way <= span * speed and span * speed > 0.5 * radius[contact])


@kernel
def face_within(part: float, length: float, point: int, within: Integration) -> int:
    """Face, or corner, of the ground that an open point is nearest to at a fraction of the step."""
    evaluate_within(part, length, False, within)
    x, z = center_of(within.scene.model, within.memory.rows, point)
    return int(nearest_face(within.scene.ground, x, z, A_DISC))


@kernel
def next_kink(
    point: int, low: float, high: float, length: float, within: Integration
) -> tuple[float, float]:
    """Fractions of the step between which another face is the nearest, or twice the last of it."""
    face = face_within(low, length, point, within)
    if face_within(high, length, point, within) == face:
        return high, high
    while high - low > EVENT_TIME / length:
        part = low + 0.5 * (high - low)
        if face_within(part, length, point, within) == face:
            low = part
        else:
            high = part
    return low, high


@kernel
def crossing_by_faces(
    function: int, low: float, high: float, length: float, within: Integration
) -> float:
    """Fraction of the step at which an open point reaches ground whose nearest face changes.

    Its gap has kinks there, and is smooth in between. That of a point in the ground can be deepest
    at one, as in a thin wall that it would go through. Where it begins on the ground, as on a
    corner, a moment later tells over which face.
    """
    watch, samples = within.phase.watch, within.step.samples
    before, before_rate = samples.before[function], samples.before_rate[function]
    value, rate = samples.sample[function], samples.sample_rate[function]
    root, begin = NO_EVENT, low
    for _ in range(MOST_FACES):
        if begin == 0.0 and before <= TOGETHER:
            end = beyond = AT_ONCE * high
        else:
            end, beyond = next_kink(function // 2, begin, high, length, within)
        if end == high:
            break
        look_at_sample(function, end, length, within)
        root = crossing(function, begin, end, length, within)
        if root != NO_EVENT:
            break
        evaluate_within(beyond, length, False, within)
        samples.before[function] = watch.value[function]
        samples.before_rate[function] = watch.rate[function]
        begin = beyond
    samples.sample[function], samples.sample_rate[function] = value, rate
    if root == NO_EVENT:
        root = crossing(function, begin, high, length, within)
    samples.before[function], samples.before_rate[function] = before, before_rate
    return root


@kernel
def early_crossing(function: int, high: float, length: float, within: Integration) -> float:
    """Fraction of the step at which a point that has just left the ground is back there at once.

    It may have come back, and risen again, long before the first sample. Nothing happens so soon
    but on a scale of its own: it is looked for at ever smaller parts of the way there.
    """
    samples = within.step.samples
    value, rate = samples.sample[function], samples.sample_rate[function]
    soonest = SOONEST if samples.before[function] <= TOGETHER else SOON
    root = NO_EVENT
    part = high
    while root == NO_EVENT and part * length > soonest:
        part *= EARLIER
        look_at_sample(function, part, length, within)
        root = crossing(function, 0.0, part, length, within)
    samples.sample[function], samples.sample_rate[function] = value, rate
    return root


@kernel
def first_event(length: float, within: Integration) -> float:
    """Fraction of the step just taken at which the first event happens, or ``NO_EVENT``.

    The event functions that vanish there are marked in ``watch.fired``. ``samples.before`` and
    ``samples.before_rate`` must hold the event functions at the start of the step.
    """
    model, modes, watch = within.scene.model, within.phase.modes, within.phase.watch
    samples, radius = within.step.samples, model.contact_radius
    sample, sample_rate = samples.sample, samples.sample_rate
    functions, corners = 2 * modes.watched, has_corners(within.scene.ground)
    if corners:
        functions += model.nc
    together = min(EVENT_TIME / length, 0.5)  # there are steps shorter than that near poles
    low = 0.0
    for k in range(1, SAMPLES + 1):
        high = k / SAMPLES
        if k < SAMPLES:
            evaluate_within(high, length, True, within)
            copy_events(watch.value, watch.rate, sample, sample_rate)
        else:
            copy_events(samples.end_value, samples.end_rate, sample, sample_rate)
        first = NO_EVENT
        for i in range(functions):
            watch.fired[i] = 0
            span, root = (high - low) * length, NO_EVENT
            if corners and may_turn(i, span, radius, modes.closed, samples):
                root = crossing_by_faces(i, low, high, length, within)
            elif may_cross(i, span, modes, samples):
                root = crossing(i, low, high, length, within)
            if k == 1 and root == NO_EVENT and just_left(i, modes, samples):
                root = early_crossing(i, high, length, within)
            if root < first - together:
                for j in range(i):
                    watch.fired[j] = 0
                first = root
            if root < NO_EVENT and root <= first + together:
                watch.fired[i] = 1
        if first < NO_EVENT:
            return first
        copy_events(sample, sample_rate, samples.before, samples.before_rate)
        low = high
    return NO_EVENT
