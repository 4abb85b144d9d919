"""A simulation at one instant, exactly, to be taken up again."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from heelstrike.arguments import takes
from heelstrike.array_file import DAMAGED, read_arrays, write_arrays
from heelstrike.errors import RunFileError, SimulationError
from heelstrike.field_texts import dataclass
from heelstrike.robot.state import State
from heelstrike.sim.image import Image

_IDENTITY = "identity"
_FORMAT = 12


@dataclass(frozen=True, eq=False)
class Snapshot:
    """Everything that the further course of a simulation depends on.

    Made by :meth:`heelstrike.Simulation.snapshot`, taken up by
    :meth:`heelstrike.Simulation.restore` or as the `state` of a new simulation.
    """

    arrays: dict[str, NDArray[Any]]
    """State, time, memory of the controller, contact modes and all else, by name."""
    identity: Mapping[str, str]
    """Robot, method and controller it was taken of; it fits no other."""
    taken: Image | None = field(default=None, repr=False)
    """Where it was taken in this process, what most of these arrays are views of."""

    @classmethod
    def pictured(
        cls, told: dict[str, NDArray[Any]], identity: Mapping[str, str], taken: Image
    ) -> Snapshot:
        """Return one of an image, whose arrays get their names when they are asked for.

        Most snapshots are put back as they are.

        Parameters
        ----------
        told : dict
            Arrays that are not on the image, by name.
        identity : mapping
            Robot, method and controller.
        taken : Image
            The image.

        Returns
        -------
        Snapshot
            The snapshot.
        """
        made = cls.__new__(cls)
        made.__dict__.update(_told=told, identity=identity, taken=taken)
        return made

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            """Name the arrays of an image."""
            if name != "arrays" or "_told" not in self.__dict__:
                raise AttributeError(f"a snapshot has no attribute {name!r}")
            arrays = self.__dict__["_told"] | self.taken.by_name()
            return self.__dict__.setdefault("arrays", arrays)

    @property
    def beside(self) -> Mapping[str, NDArray[Any]]:
        """Arrays among which those are that are on no image: time, ground, pushes, controller."""
        return self.arrays if self.is_named else self.__dict__["_told"]

    @property
    def is_named(self) -> bool:
        """Whether it holds arrays by name, and somebody may have put others in their places."""
        return "arrays" in self.__dict__

    @property
    def time(self) -> float:
        """When it was taken, in s."""
        return float(self.beside["time"])

    def at(self, time: float) -> Snapshot:
        """Return the same as of another time.

        Parameters
        ----------
        time : float
            The time, in s.

        Returns
        -------
        Snapshot
            A snapshot; this one stays what it is.
        """
        now = {"time": np.array(time)}
        if self.is_named or self.taken is None:
            return Snapshot(self.arrays | now, self.identity, self.taken)
        return Snapshot.pictured({**self.beside, **now}, self.identity, self.taken)

    @property
    def state(self) -> State:
        """Position and velocity of the robot; of ``run.final``, perhaps one step before its time.

        Where the end of a run cut a step short, it goes on from the beginning of that step.
        """
        return State(self.arrays["memory.q"], self.arrays["memory.v"])

    def moved(self, state: State) -> Snapshot:
        """Return the same instant with the robot in a slightly other state.

        What the methods decided of the contacts stays as it is: points that stand must stand, where
        they do, in the other state too.

        Parameters
        ----------
        state : State
            Position and velocity.

        Returns
        -------
        Snapshot
            A snapshot; this one stays what it is.
        """
        q, v = np.array(state.q, dtype=np.float64), np.array(state.v, dtype=np.float64)
        arrays = self.arrays | {"memory.q": q, "memory.v": v}
        if "work.step.begin" in arrays:  # where an event-driven step begins
            arrays["work.step.begin"] = np.concatenate((q, v))
        return Snapshot(arrays, self.identity)

    def part(self, name: str) -> dict[str, NDArray[Any]]:
        """Return the arrays whose names begin so, without that beginning.

        Parameters
        ----------
        name : str
            Name of the part.

        Returns
        -------
        dict
            Its arrays by name.
        """
        begin = f"{name}."
        return {
            key.removeprefix(begin): value
            for key, value in self.arrays.items()
            if key.startswith(begin)
        }

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write it to a file of arrays, by custom ``.npz``; nothing in it can be executed.

        Parameters
        ----------
        path : str or path
            The file; an existing one is replaced. It appears whole or not at all.

        Returns
        -------
        Path
            The file.

        Raises
        ------
        WriteError
            If it cannot be written.
        """
        identity = json.dumps({"format": _FORMAT, **self.identity})
        return write_arrays(path, {_IDENTITY: identity, **self.arrays})


@takes(RunFileError)
def load_snapshot(path: str | os.PathLike[str]) -> Snapshot:
    """Read a snapshot that was saved with :meth:`Snapshot.save`.

    Parameters
    ----------
    path : str or path
        The file.

    Returns
    -------
    Snapshot
        The snapshot.

    Raises
    ------
    SimulationError
        If there is no such file, or it is none of a simulation, or damaged.
    """
    what = "a snapshot of a simulation"
    arrays = read_arrays(path, what, SimulationError)
    try:
        identity = json.loads(str(arrays.pop(_IDENTITY)))
        layout = identity.pop("format")
    except DAMAGED as error:
        raise SimulationError(f"{path}: not {what}, or damaged") from error
    if layout != _FORMAT:
        raise SimulationError(
            f"{path}: written in layout {layout}, this version of heelstrike reads {_FORMAT}"
        )
    return Snapshot(arrays, identity)
