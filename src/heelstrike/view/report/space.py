"""What a report says of a run in space."""

from __future__ import annotations

from typing import Any

from matplotlib.figure import Figure

from heelstrike.analysis.diagnosis.measures import Measure
from heelstrike.analysis.spatial.measures import measures_in_space
from heelstrike.analysis.spatial.motion import centroidal_motion
from heelstrike.analysis.spatial.summary import summarize_in_space
from heelstrike.robot.model import Floats
from heelstrike.robot.spatial.model import SLIDE
from heelstrike.sim.spatial.run import SpatialRun
from heelstrike.view.report.account import Account
from heelstrike.view.spatial.figures import plot_in_space
from heelstrike.view.spatial.page import (
    certificates_in_space,
    contents_within,
    drawing_script,
    provenance_in_space,
)
from heelstrike.view.spatial.verdict import judge_in_space


class InSpace(Account):
    """What a report says of a run in space."""

    captions = {  # noqa: RUF012 - a mapping that nobody changes
        "zmp": "Zero moment point, and how far it is inside the support polygon",
        "forces": "Forces of the ground on the robot",
        "torque": "Joint torques",
        "gap": "Heights of the contact points",
    }
    measured = "The run in figures"

    def __init__(self, run: SpatialRun) -> None:
        self.run = run
        self.verdict = judge_in_space(run)

    def film(self, room: int) -> dict[str, Any]:
        """Return what the script of the film shows."""
        return contents_within(self.run, room)

    def measures(self) -> tuple[Measure, ...]:
        """Measure the run."""
        return measures_in_space(self.run)

    def summary(self) -> dict[str, str]:
        """Return label and value of the lines of its summary."""
        return dict(summarize_in_space(self.run).lines())

    def plot(self, what: str) -> Figure:
        """Draw one of its figures."""
        return plot_in_space(self.run, what)

    def certificates(self) -> dict[str, str]:
        """Return the worst values of its certificates."""
        return certificates_in_space(self.run)

    def provenance(self, command: str) -> dict[str, str]:
        """Say where it comes from."""
        return provenance_in_space(self.run, command)

    def script(self) -> str:
        """Return the script that draws its film."""
        return drawing_script()

    def coordinates(self) -> Floats:
        """Positions of hinges and slides: q and −q of a quaternion are one orientation."""
        model = self.run.robot.model
        plain = model.joint_kind >= SLIDE
        positions: Floats = self.run.position[:, model.first_position[plain]]
        return positions

    def center_of_mass(self) -> Floats:
        """Where its centre of mass is."""
        return centroidal_motion(self.run).center_of_mass
