"""Random numbers that compiled and plain Python code draw alike, from a seed.

L'Ecuyer's combined generator: two linear congruential ones of 31 bits, whose products fit into 64
(P. L'Ecuyer, *Efficient and portable combined random number generators*, 1988).
"""

from __future__ import annotations

import math

import numpy as np

from heelstrike.compiler.bundle import Bundle, array
from heelstrike.compiler.compilation import kernel
from heelstrike.errors import ControllerError
from heelstrike.robot.model import Integers

FIRST = 2147483563
SECOND = 2147483399


def seeded(seed: int) -> list[int]:
    """Return what a generator begins with.

    Raises
    ------
    ControllerError
        If the seed is not a whole number from 0 on.
    """
    if isinstance(seed, bool) or not isinstance(seed, int | np.integer) or seed < 0:
        raise ControllerError(f"a seed is a whole number from 0 on, got {seed!r}")
    one, two = np.random.SeedSequence(int(seed)).generate_state(2).tolist()
    return [1 + one % (FIRST - 1), 1 + two % (SECOND - 1)]


UNSEEDED = tuple(seeded(0))


@kernel
def uniform(seeds: Integers) -> float:
    """Draw a number between 0 and 1, neither of the two; `seeds` (2,) changes."""
    if seeds[0] == 0:  # which no generator comes to
        seeds[0], seeds[1] = UNSEEDED
    seeds[0] = 40014 * seeds[0] % FIRST
    seeds[1] = 40692 * seeds[1] % SECOND
    mixed = (seeds[0] - seeds[1]) % (FIRST - 1)
    return (mixed + 0.5) / (FIRST - 1)


@kernel
def normal(seeds: Integers) -> float:
    """Draw a number of the standard normal distribution (Box and Muller)."""
    radius = math.sqrt(-2.0 * math.log(uniform(seeds)))
    return radius * math.cos(2.0 * math.pi * uniform(seeds))


class RandomNumbers(Bundle):
    """A generator of random numbers, for the memory of a law.

    Kept with the memory: a simulation that is restored draws what it would have drawn. All zeros,
    as a memory begins, are the seed 0; others come from :meth:`seeded`.

    Examples
    --------
    >>> from heelstrike.control import RandomNumbers
    >>> RandomNumbers.seeded(1).uniform() == RandomNumbers.seeded(1).uniform()
    True
    """

    seeds: Integers = array(2, of=int)
    """Its state."""

    @classmethod
    def seeded(cls, seed: int) -> RandomNumbers:
        """Return a generator that begins with a seed.

        Parameters
        ----------
        seed : int
            A whole number from 0 on.

        Returns
        -------
        RandomNumbers
            The generator.

        Raises
        ------
        ControllerError
            If the seed is none.
        """
        return cls(seeds=np.array(seeded(seed)))

    @kernel
    def uniform(self) -> float:
        """Draw a number between 0 and 1, neither of the two."""
        return uniform(self.seeds)

    @kernel
    def normal(self) -> float:
        """Draw a number of the standard normal distribution."""
        return normal(self.seeds)
