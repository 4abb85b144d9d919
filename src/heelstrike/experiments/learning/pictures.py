"""Pictures of a robot on its ground, as arrays, and in the browser."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from heelstrike.contact.ground import Ground
from heelstrike.dynamics import link_poses
from heelstrike.robot.robot import Robot
from heelstrike.robot.state import State
from heelstrike.view.drawing import body, extent
from heelstrike.view.style import styled

if TYPE_CHECKING:
    from heelstrike.experiments.learning.course import Course

DPI = 100
MARGIN = 1.3
"""Height of the picture over that of the robot as it stands."""


class Camera:
    """Takes pictures of a robot, which it follows along the ground.

    Parameters
    ----------
    robot : Robot
        The robot.
    ground : Ground
        What it stands on.
    size : (int, int)
        Width and height in pixels.
    """

    def __init__(self, robot: Robot, ground: Ground, size: tuple[int, int] = (480, 480)) -> None:
        self._robot, self._ground, self._body = robot, ground, body(robot)
        low, high = extent(self._segments(robot.reference_state()))
        self._height = MARGIN * float(max(high[1] - low[1], high[0] - low[0]))
        self._size = size

    def picture(self, state: State) -> NDArray[np.uint8]:
        """Return a picture, (height, width, 3).

        Parameters
        ----------
        state : State
            Where the robot is.

        Returns
        -------
        (height, width, 3) uint8
            Its pixels.
        """
        width, height = self._size
        half = 0.5 * self._height * width / height
        x = float(state.q[0])
        floor = float(self._ground.height(x)) - 0.1 * self._height
        with styled():
            figure = Figure(figsize=(width / DPI, height / DPI), dpi=DPI)
            canvas: Any = FigureCanvasAgg(figure)
            axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
            axes.set_axis_off()
            axes.set(xlim=(x - half, x + half), ylim=(floor, floor + self._height))
            outline = self._ground.outline(x - half, x + half)
            axes.fill_between(outline[:, 0], outline[:, 1], floor, color="0.85")
            drawn = self._body.drawn(np.zeros((0, 2, 2)), height / 540.0)
            axes.add_collection(drawn, autolim=False)
            self._body.move(drawn, self._segments(state))
            canvas.draw()
            pixels: NDArray[np.uint8] = np.asarray(canvas.buffer_rgba())[..., :3].copy()
        return pixels

    def _segments(self, state: State) -> NDArray[np.float64]:
        poses = link_poses(self._robot, state.q)
        return self._body.segments(poses.origin, poses.angle)


class Screen:
    """Shows the first lane of a course in the browser, in real time.

    Parameters
    ----------
    course : Course
        The lanes.

    Raises
    ------
    ViewError
        If the package that serves the page is not installed.
    """

    def __init__(self, course: Course) -> None:
        from heelstrike.view.live.display import Display  # with it come servers and browsers

        self._course, self._time = course, np.inf
        self._display = Display(course.robot)

    @property
    def url(self) -> str:
        """Address of the page."""
        return self._display.url

    def show(self) -> None:
        """Show the lane as it is now, when its time has come."""
        batch = self._course.batch
        time = float(batch.time[0])
        if time == 0.0 or time < self._time:  # another episode
            self._display.begin(batch.lane(0).ground, str(batch.method))
        self._time = time
        residual = max(
            batch.complementarity.item(0), batch.cone.item(0), batch.non_penetration.item(0)
        )
        self._display.show(
            time, self._course.state_of(0), force=batch.contact_force[0], torque=batch.torque[0],
            residual=residual,
        )  # fmt: skip

    def close(self) -> None:
        """End the view."""
        self._display.close()
