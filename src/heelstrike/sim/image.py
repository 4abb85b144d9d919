"""What is in the bundles of a simulation, in one piece: taken and put back at once."""

from __future__ import annotations

import math
import operator
from collections.abc import Iterable, Mapping
from functools import cache, cached_property
from typing import Any, NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray

from heelstrike.compiler.bundle import Bundle, address_of_array
from heelstrike.compiler.bundle_type import WORD_BYTES
from heelstrike.compiler.compilation import loop_for
from heelstrike.compiler.mold import Layout, written_to
from heelstrike.compiler.words import copy_between
from heelstrike.robot.model import Integers

Arrays = dict[str, NDArray[Any]]


class Form(NamedTuple):
    """What bundles consist of: the same for all that were cast in the same molds."""

    layout: Layout
    """Names, shapes and kinds of their arrays."""
    names: tuple[str, ...]
    ends: list[int]
    """names, ends: The names, and where each array ends among the words of all."""


class Image:
    """What was in some bundles.

    Parameters
    ----------
    form : Form
        What they consist of.
    words : (n,) int
        All that was in them, one array after the other.
    """

    def __init__(self, form: Form, words: Integers) -> None:
        self.form, self.words = form, words

    @cached_property
    def arrays(self) -> tuple[NDArray[Any], ...]:
        """The same words as arrays."""
        begins = (0, *self.form.ends)
        return tuple(
            np.ndarray(shape, kind, self.words, WORD_BYTES * begin)
            for (_, shape, kind), begin in zip(self.form.layout, begins, strict=False)
        )

    def by_name(self) -> Arrays:
        """Return its arrays by their names."""
        return dict(zip(self.form.names, self.arrays, strict=True))


class Camera:
    """Takes images of bundles, and puts back what is on them.

    Parameters
    ----------
    bundles : iterable of str and Bundle
        What the names of the arrays of each begin with, and the bundle. Arrays that are read only
        are not its own, and not on the image.
    """

    def __init__(self, bundles: Iterable[tuple[str, Bundle]]) -> None:
        prefixes, self._bundles = zip(*bundles, strict=True)
        layouts, places = zip(*map(written_to, self._bundles), strict=True)
        self._places = np.concatenate(places)
        self._form = _together(prefixes, layouts)

    def take(self) -> Image:
        """Take an image."""
        image = self._empty()
        _copy()(self._places, address_of_array(image.words), 1)
        return image

    def put_back(self, image: Image) -> None:
        """Let everything be as it was."""
        _copy()(self._places, address_of_array(image.words), 0)

    def fits(self, image: Image) -> bool:
        """Whether an image is one of such bundles, taken in this process."""
        return image.form is self._form

    def image_of(self, arrays: Mapping[str, NDArray[Any]], taken: Image | None) -> Image:
        """Return an image of arrays by name, which may be those of an image that was taken.

        Raises
        ------
        ValueError
            If something is missing, or of another shape or kind. Empty arrays may be missing.
        """
        given = tuple(map(arrays.get, self._form.names))
        if taken is not None and self.fits(taken) and all(map(operator.is_, given, taken.arrays)):
            return taken
        image = self._empty()
        for name, mine, its in zip(self._form.names, image.arrays, given, strict=True):
            if mine.size == 0:
                continue
            if its is None or its.shape != mine.shape or its.dtype != mine.dtype:
                raise ValueError(f"{name} is missing, or of another shape")
            mine[...] = its
        return image

    def _empty(self) -> Image:
        return Image(self._form, np.empty(self._form.ends[-1], dtype=np.int64))


def _together(prefixes: tuple[str, ...], layouts: tuple[Layout, ...]) -> Form:
    """Return layouts as one."""
    of = prefixes, tuple(map(id, layouts))
    if of not in _KNOWN:
        each = list(zip(prefixes, layouts, strict=True))
        layout = tuple(
            (prefix + name, shape, kind) for prefix, all_of in each for name, shape, kind in all_of
        )
        ends = np.cumsum([math.prod(shape) for _, shape, _ in layout]).tolist()
        _KNOWN[of] = Form(layout, tuple(name for name, _, _ in layout), ends), layouts
    return _KNOWN[of][0]


_KNOWN: dict[Any, tuple[Form, Any]] = {}
"""By prefixes and layouts, which are kept: their ids must stay theirs."""


@cache
def _copy() -> Any:
    def copy_all(places: Integers, address: int, outwards: int) -> int:
        """Copy arrays, by address and words, one after the other to an address, or back."""
        for i in range(places.shape[0]):
            if outwards == 1:
                copy_between(places[i, 0], address, places[i, 1])
            else:
                copy_between(address, places[i, 0], places[i, 1])
            address += WORD_BYTES * places[i, 1]
        return 0

    return loop_for(types.int64(types.int64[:, ::1], types.int64, types.int64), copy_all)
