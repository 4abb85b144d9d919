"""animate(): a run as a film."""

from __future__ import annotations

import io
import os
from pathlib import Path

import numpy as np

from heelstrike.arguments import takes
from heelstrike.errors import ViewError
from heelstrike.sim.run import Run
from heelstrike.sim.spatial.run import SpatialRun
from heelstrike.view.film import Film
from heelstrike.view.mp4 import write_mp4
from heelstrike.view.spatial.film import SpatialFilm
from heelstrike.view.style import styled, view_errors
from heelstrike.whole_file import check_target, whole_file

GIF_COLORS = 64


@takes(ViewError)
def animate(
    run: Run | SpatialRun,
    path: str | os.PathLike[str],
    *,
    fps: float = 30.0,
    speed: float = 1.0,
    size: tuple[int, int] = (960, 540),
) -> Path:
    """Write a film of a run: robot, ground, contact forces, zero moment point.

    The forces are means from frame to frame, so that an impact, which lasts one step, is seen with
    its impulse.

    Parameters
    ----------
    run : Run or SpatialRun
        The run.
    path : str or path
        File to write, .mp4 or .gif.
    fps : float
        Frames a second. A GIF takes the nearest rate of 100/n.
    speed : float
        Simulated seconds that pass in a second of the film: 0.25 is slow motion.
    size : (int, int)
        Width and height in pixels; MP4 asks for even numbers and gets them, rounded down.

    Returns
    -------
    Path
        The file. It appears whole or not at all.

    Raises
    ------
    ViewError
        If the run is empty, an option is out of range, or the file cannot be written.
    """
    target = Path(path)
    with view_errors():
        check_target(target)
    kind = target.suffix.lower()
    if kind not in (".mp4", ".gif"):
        raise ViewError(f"cannot write {target}: the name of an animation ends in .mp4 or .gif")
    if not len(run.time):
        raise ViewError(f"there is nothing to animate: the run has no rows ({run.message})")
    if not 1.0 <= fps <= 240.0:
        raise ViewError(f"fps must lie between 1 and 240, got {fps}")
    if not 1e-4 <= speed <= 1e3:
        raise ViewError(f"speed must lie between 0.0001 and 1000, got {speed}")
    width, height = (int(n) - int(n) % 2 for n in size)
    if not (64 <= width <= 8192 and 64 <= height <= 8192):
        raise ViewError(f"the size of an animation is 64 to 8192 pixels each way, got {size}")
    if kind == ".gif":
        fps = 100.0 / max(2, round(100.0 / fps))  # the format counts hundredths of a second
    with styled(), view_errors():
        film: Film | SpatialFilm
        if isinstance(run, SpatialRun):
            film = SpatialFilm(run, (width, height), fps, speed)
        else:
            film = Film(run, (width, height), fps, speed)
        with whole_file(target) as beside:
            if kind == ".mp4":
                write_mp4(map(film.draw, range(len(film))), film.size, fps, beside)
            else:
                _write_gif(film, beside, fps)
    return target


def _write_gif(film: Film | SpatialFilm, path: Path, fps: float) -> None:
    from PIL import Image

    def picture(index: int) -> Image.Image:
        return Image.fromarray(np.asarray(film.draw(index))).convert("RGB")

    palette = picture(len(film) // 2).quantize(GIF_COLORS)
    plain = Image.Dither.NONE
    pictures = (picture(i).quantize(palette=palette, dither=plain) for i in range(len(film)))
    first = next(pictures)
    content = io.BytesIO()  # what writes into a file itself does not say why it cannot
    first.save(
        content,
        format="GIF",
        save_all=True,
        append_images=pictures,
        duration=round(1000.0 / fps),
        loop=0,
    )
    path.write_bytes(content.getbuffer())
