"""What counts as touching, as one place, one instant, at rest, or zero: each decision has a name.

A tolerance stands here if more than one room decides by it, or if another decision might be taken
for it. Those of one algorithm alone stand with it, under names that nothing else has.

Positions are metres from a world origin that is not far: rounding makes 1e-15 of them, and sums
along a leg some 1e-14.
"""

from __future__ import annotations

# Gaps.

CLOSED_GAP = 1e-9
"""Gap (m) of a point that a method, a bridge or a gait has brought to the ground. Solving for it
leaves 1e-12 at worst, and what falls so far takes 1e-5 s: no step notices."""

STANDING_GAP = 1e-6
"""Gap (m) of a point that stands, in a state or run that comes from outside. More than methods of
any order leave at their tolerances, less than soles are flat."""

LEVEL_SOLE = 1e-4
"""Difference (m) of height up to which contact points of a foot are equally high. Files of robots
are written in tenths of a millimetre."""

LEVEL_GROUND = 1e-6
"""Sine of the slope up to which ground of a file counts as level: over a foot, less than
:data:`STANDING_GAP`."""

STRAIGHT_GROUND = 1e-9
"""Sine of the turn from one segment of the ground to the next, up to which there is no corner. A
disc of a metre that rests on both would be no deeper than :data:`CLOSED_GAP`."""

# Places.

ONE_POINT = 1e-9
"""Distance (m) of two points of a robot that are one. Files give places to a micrometre at most;
poses that are computed of them differ by rounding."""

NO_BONE = 1e-6
"""Distance (m) of joints between which nothing is drawn or written: no link is so short, and a
drawing has a pixel a millimetre."""

MIRRORED_PLACE = 1e-5
"""Distance (m) of a place on the left from the mirror image of that on the right: files that people
write round to a tenth of a millimetre, and programs that write them to a hundredth."""

ON_A_LINE = 1e-9
"""Distance (m) of points of an outline from a line that they are on."""

# Instants.

SAME_ROW = 1e-9
"""Difference (s) of two times of rows and events that are one instant. Rounding makes 1e-12 of
hours; no method has shorter steps that are recorded."""

# Speeds and numbers.

STANDING_SPEED = 1e-6
"""Speed (m/s) of a point that stands, in a state that comes from outside: in a second it goes no
further than :data:`STANDING_GAP`."""

NO_PIVOT = 1e-11
"""Pivots below this, relative to their matrix or their diagonal, are zero. Elimination of some
twenty rows rounds to 1e-14 of the matrix, and rows that are less than a thousand times as
independent as that say nothing."""

NOTICEABLE_ENERGY = 1e-9
"""Energy that an impact makes, as a part of what goes through its contacts, from which on it is
told of: rounding of a certified solve makes less."""
