"""Sums of products whose rounding errors are kept and added in the end.

What a product or a sum of two numbers loses to rounding is a number itself, and can be computed
(Dekker, Numer. Math. 18, 1971; Knuth, The Art of Computer Programming, vol. 2, section 4.2.2). A
sum of products with these added has an error as if it had been computed in twice the precision and
rounded once (Ogita, Rump and Oishi, SIAM J. Sci. Comput. 26, 2005).
"""

from __future__ import annotations

from heelstrike.compiler.compilation import kernel

UNIT_ROUNDOFF = 2.0**-53
"""Largest relative error of one operation."""

SPLITTER = 2.0**27 + 1.0


@kernel
def sum_error(first: float, second: float, total: float) -> float:
    """What ``total``, the rounded sum of two numbers, lacks to their sum."""
    part = total - first
    return (first - (total - part)) + (second - part)


@kernel
def product_error(first: float, second: float, product: float) -> float:
    """What ``product``, the rounded product of two numbers, lacks to their product.

    The numbers must be below 1e292 and their product above 1e-270, or zero.
    """
    large = SPLITTER * first
    first_high = large - (large - first)
    first_low = first - first_high
    large = SPLITTER * second
    second_high = large - (large - second)
    second_low = second - second_high
    rest = first_high * second_high - product
    return ((rest + first_high * second_low) + first_low * second_high) + first_low * second_low
