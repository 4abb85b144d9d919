"""What a report says of a run in the plane."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from matplotlib.figure import Figure

from heelstrike.analysis.diagnosis.changes import Tried
from heelstrike.analysis.diagnosis.measures import Measure, measures
from heelstrike.analysis.motion import run_motion
from heelstrike.analysis.summary import summarize
from heelstrike.analysis.support import step_times, walking_steps
from heelstrike.robot.model import Floats
from heelstrike.sim.run import Run
from heelstrike.view.figures import plot
from heelstrike.view.page.markup import shipped
from heelstrike.view.page.page import certificates, contents
from heelstrike.view.page.provenance import provenance
from heelstrike.view.page.verdict import judge
from heelstrike.view.report.account import Account

if TYPE_CHECKING:
    from heelstrike.gait.gait import Gait


class InPlane(Account):
    """What a report says of a run in the plane, and of the gait that it followed."""

    captions = {  # noqa: RUF012 - a mapping that nobody changes
        "snapshots": "The robot at equal times of its middle step, with the forces of the ground",
        "tracking": "Joint positions and their references",
        "velocities": "Joint velocities and their references",
        "zmp": "Zero moment point of the stance foot, within its sole",
        "friction": "Tangential forces within the friction cones",
        "forces": "Forces of the ground on the feet",
        "torque": "Joint torques and their limits",
        "gaps": "Heights of the contact points",
        "energy": "Energy, and the work that changed it",
    }
    measured = "The walk in figures"
    withstands = "What the walk withstands is below."
    not_tried = (
        "Pushes, slopes and changes need the controller, which a run does not hold: "
        "“heelstrike report ROBOT” tries them, and heelstrike.experiments.what_if does in Python."
    )

    def __init__(self, run: Run, gait: Gait | None, tried: Sequence[Tried]) -> None:
        self.run = run
        self.gait = gait
        self.verdict = judge(run, gait, tried=tried)

    def film(self, room: int) -> dict[str, Any]:  # noqa: ARG002 - planar runs take little
        """Return what the script of the film shows."""
        return contents(self.run, self.gait)

    def measures(self) -> tuple[Measure, ...]:
        """Measure the walk."""
        return measures(self.run, self.gait)

    def summary(self) -> dict[str, str]:
        """Return label and value of the lines of its summary."""
        return dict(summarize(self.run, gait=self.gait).lines())

    def plot(self, what: str) -> Figure:
        """Draw one of its figures."""
        return plot(self.run, what, gait=self.gait)

    def certificates(self) -> dict[str, str]:
        """Return the worst values of its certificates."""
        return certificates(self.run)

    def provenance(self, command: str) -> dict[str, str]:
        """Say where it comes from."""
        return provenance(self.run, self.gait, command=command)

    def script(self) -> str:
        """Return the script that draws its film."""
        return "".join(map(shipped, ("drawing.js", "recording.js")))

    def center_of_mass(self) -> Floats:
        """Where its centre of mass is."""
        return run_motion(self.run).center_of_mass

    def touchdowns(self) -> list[float]:
        """When its steps touch down."""
        return [step.touchdown for step in walking_steps(self.run)]

    def middle(self) -> float:
        """Return the middle of its middle step."""
        landings = step_times(self.run)
        if len(landings) < 2:
            return super().middle()
        step = (len(landings) - 1) // 2
        return float(0.5 * (landings[step] + landings[step + 1]))
