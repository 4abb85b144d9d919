"""animate(): a run as a film."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

from heelstrike.errors import ViewError
from heelstrike.sim.run import Run
from heelstrike.view.film import Film
from heelstrike.view.style import checked_target, styled

GIF_COLORS = 64


def animate(
    run: Run,
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
    run : Run
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
    target = checked_target(path)
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
    with styled():
        film = Film(run, (width, height), fps, speed)
        # Written beside the target first, so that a failure leaves an older film alone.
        name = str(target.with_name(f".part-{os.getpid()}-{target.name}"))
        try:
            write = _write_mp4 if kind == ".mp4" else _write_gif
            write(film, name, fps)
            if not Path(name).stat().st_size:
                raise ViewError(f"cannot write {target}: ffmpeg left an empty file")
            Path(name).replace(target)
        except OSError as error:
            raise ViewError(f"cannot write {target}: {error}") from error
        finally:
            Path(name).unlink(missing_ok=True)
    return target


def _write_mp4(film: Film, name: str, fps: float) -> None:
    import imageio_ffmpeg

    try:
        writer = imageio_ffmpeg.write_frames(
            name,
            film.size,
            pix_fmt_in="rgba",
            pix_fmt_out="yuv420p",
            fps=fps,
            codec="libx264",
            quality=None,
            macro_block_size=1,
            ffmpeg_log_level="error",
            output_params=["-preset", "veryfast", "-crf", "21", "-movflags", "+faststart"],
        )
        writer.send(None)
    except RuntimeError as error:
        raise ViewError(f"no ffmpeg to write MP4 with ({error}); a .gif needs none") from error
    try:
        for index in range(len(film)):
            writer.send(film.draw(index))
    finally:
        writer.close()


def _write_gif(film: Film, name: str, fps: float) -> None:
    from PIL import Image

    def picture(index: int) -> Image.Image:
        return Image.fromarray(np.asarray(film.draw(index))).convert("RGB")

    palette = picture(len(film) // 2).quantize(GIF_COLORS)
    plain = Image.Dither.NONE
    pictures = (picture(i).quantize(palette=palette, dither=plain) for i in range(len(film)))
    first = next(pictures)
    first.save(name, save_all=True, append_images=pictures, duration=round(1000.0 / fps), loop=0)
