"""What a walk leaves in a directory, written so that nothing is lost when something fails.

The gait is saved before it is simulated, the run before anything is drawn from it, and every file
on its own: one that cannot be made does not take the others with it.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from heelstrike.field_texts import dataclass
from heelstrike.gait import Gait
from heelstrike.sim import Run
from heelstrike.view.figures import FIGURES
from heelstrike.whole_file import write_whole

OF_MOTORS = ("tracking", "velocities", "torque")
"""Figures of what motors move, of which there are none on a passive walker."""


@dataclass(frozen=True)
class Saved:
    """A file that was written, or what kept it from being written."""

    path: Path
    """The file."""
    error: Exception | None = None
    """What went wrong, if anything."""


class Results:
    """The directory of a walk.

    Parameters
    ----------
    directory : Path
        Created if it does not exist.

    Raises
    ------
    OSError
        If the directory cannot be created.
    """

    def __init__(self, directory: Path) -> None:
        directory.mkdir(parents=True, exist_ok=True)
        self.directory = directory
        self.saved: list[Saved] = []
        """Every file tried so far, the last one last."""

    @property
    def written(self) -> tuple[Path, ...]:
        """Files that are there, whole."""
        return tuple(each.path for each in self.saved if each.error is None)

    def save_gait(self, gait: Gait | None) -> tuple[Path, ...]:
        """Write gait.json, and remove the results of an earlier walk, which belong to another.

        Of a walk without a gait nothing is written yet, and an earlier gait goes, too.
        """
        path = self.directory / "gait.json"
        if gait is None:
            path.unlink(missing_ok=True)
        else:
            gait.save(path)
            self.saved.append(Saved(path))
        pictures = ("walk.mp4", "walk.gif", *(f"{figure}.png" for figure in FIGURES))
        for stale in ("run.nc", "summary.json", *pictures):
            (self.directory / stale).unlink(missing_ok=True)
        return self.written

    def save_run(
        self,
        run: Run,
        gait: Gait | None,
        *,
        figures: bool = True,
        animation: str | None = "mp4",
        progress: Callable[[float], None] | None = None,
    ) -> tuple[Saved, ...]:
        """Write run.nc, summary.json, a PNG for every figure, and an animation.

        Parameters
        ----------
        run : Run
            The run.
        gait : Gait or None
            The gait it followed, if it did.
        figures : bool
            Whether to draw figures.
        animation : str, optional
            Kind of animation, "mp4" or "gif"; None for none.
        progress : callable, optional
            Called with the fraction of the files that is done.

        Returns
        -------
        tuple of Saved
            Every file, in the order of writing, with what went wrong.
        """
        tasks: dict[str, Callable[[Path], object]] = {
            "run.nc": run.save,
            "summary.json": lambda path: write_whole(path, run.summary(gait=gait).to_json() + "\n"),
        }
        shown = [each for each in FIGURES if run.robot.nu or each not in OF_MOTORS]
        for figure in shown if figures else ():
            tasks[f"{figure}.png"] = _drawing(run, gait, figure)
        if animation is not None:
            tasks[f"walk.{animation}"] = run.animate
        first = len(self.saved)
        for done, (name, write) in enumerate(tasks.items(), start=1):
            path, error = self.directory / name, None
            try:
                write(path)
            except Exception as caught:  # whatever it is, the other files are still wanted
                error = caught
            self.saved.append(Saved(path, error))
            if progress is not None:
                progress(done / len(tasks))
        return tuple(self.saved[first:])


def _drawing(run: Run, gait: Gait | None, figure: str) -> Callable[[Path], object]:
    return lambda path: run.plot(figure, gait=gait, path=path)
