"""Gaits as another processor, or another version of the optimiser, might have found them.

No test and no figure may depend on the last digits of a gait; ``pytest --perturb-gaits 1e-12``
shows that they do not.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from typing import Any

import numpy as np


def perturb_gaits(size: float) -> None:
    """Have every gait that this process designs perturbed by `size`, relative to its numbers."""
    from heelstrike.gait import design

    design.designed_gait = perturbed(design.designed_gait, size)


def perturbed(designed: Callable[..., Any], size: float) -> Callable[..., Any]:
    """Have a gait made from perturbed unknowns: the same ones for the same unknowns, always.

    Its duration and length, the last two, are what was asked for and stay so; and its equations
    hold to rounding, as they do for every gait that is found.
    """

    def perturbed_gait(program: Any, unknowns: Any, *others: Any, **options: Any) -> Any:
        seed = hashlib.sha256(np.asarray(unknowns).tobytes()).digest()
        draw = np.random.default_rng(list(seed))
        factor = 1.0 + size * draw.standard_normal(len(unknowns))
        factor[-2:] = 1.0
        return designed(program, program.polished(unknowns * factor), *others, **options)

    return perturbed_gait
