"""What a report asks of a run, in the plane or in space."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar

from matplotlib.figure import Figure

from heelstrike.analysis.diagnosis.changes import Tried
from heelstrike.analysis.diagnosis.measures import Measure
from heelstrike.errors import ViewError
from heelstrike.robot.model import Floats
from heelstrike.sim.run import AnyRun, Run
from heelstrike.view.page.verdict import Verdict

if TYPE_CHECKING:
    from heelstrike.gait.gait import Gait

BEFORE = 0.1
"""How long before the first cause of a fall (s) a film begins."""


class Account(ABC):
    """What a report says of one run.

    Attributes
    ----------
    run : Run or SpatialRun
        The run.
    verdict : Verdict
        What it comes to.
    captions : mapping of str to str
        Figures by their names, and what they show, in the order of a report.
    measured : str
        Caption of its figures in numbers.
    withstands : str
        Where the report of a good run says what it withstands; empty where it does not.
    not_tried : str
        Why nothing was tried beside it; empty where nothing ever is.
    """

    captions: ClassVar[Mapping[str, str]]
    measured: ClassVar[str]
    withstands: ClassVar[str] = ""
    not_tried: ClassVar[str] = ""

    run: Any
    verdict: Verdict

    @abstractmethod
    def film(self, room: int) -> dict[str, Any]:
        """Return what the script of the film shows, as JSON has it, in about so many bytes."""

    @abstractmethod
    def measures(self) -> tuple[Measure, ...]:
        """Measure the run."""

    @abstractmethod
    def summary(self) -> dict[str, str]:
        """Return label and value of the lines of its summary."""

    @abstractmethod
    def plot(self, what: str) -> Figure:
        """Draw one of its figures.

        Raises
        ------
        ViewError
            If there is nothing of the kind on its robot.
        """

    @abstractmethod
    def certificates(self) -> dict[str, str]:
        """Return the worst values of its certificates, label by label."""

    @abstractmethod
    def provenance(self, command: str) -> dict[str, str]:
        """Say where it comes from, label by label."""

    @abstractmethod
    def script(self) -> str:
        """Return the script that draws its film."""

    @abstractmethod
    def center_of_mass(self) -> Floats:
        """Where its centre of mass is in each row, (nt, 2) or (nt, 3), in m."""

    def coordinates(self) -> Floats:
        """Positions in each row that may be subtracted, (nt, any), in m and rad."""
        positions: Floats = self.run.position
        return positions

    def touchdowns(self) -> list[float] | None:
        """When its steps touch down (s); None where steps are not counted."""
        return None

    def middle(self) -> float:
        """Return when a film begins in which nothing goes wrong (s)."""
        return float(0.5 * (self.run.time[0] + self.run.time[-1]))

    def shown(self) -> float:
        """When the first picture of its film is (s): before what went wrong, or in its middle."""
        if self.verdict.fall is None:
            return self.middle()
        return max(float(self.run.time[0]), self.verdict.fall.time - BEFORE)


def account_of(
    name: str, run: AnyRun, gait: Gait | None = None, tried: Sequence[Tried] = ()
) -> Account:
    """Return the account of a run.

    Parameters
    ----------
    name : str
        Its name in the report.
    run : Run or SpatialRun
        The run.
    gait : Gait, optional
        The gait that it followed.
    tried : sequence of Tried
        What was tried beside it.

    Raises
    ------
    ViewError
        If it is no run, has no rows, or is in space and has a gait or tried runs.
    """
    if not isinstance(run, AnyRun):
        raise ViewError(f"a report is of runs, got {run!r}; load_run reads one from its file")
    if not len(run.time):
        raise ViewError(f"there is nothing to report of {name}: no rows ({run.message})")
    if isinstance(run, Run):
        from heelstrike.view.report.plane import InPlane

        return InPlane(run, gait, tried)
    from heelstrike.view.report.space import InSpace

    if gait is not None:
        raise ViewError(f"gaits are for robots in the plane, and {name} is in space: leave it out")
    if tried:
        raise ViewError(f"nothing is tried beside runs in space, and {name} is one: leave it out")
    in_space: Any = run
    return InSpace(in_space)
