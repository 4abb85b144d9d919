"""Pictures into an MP4 file, by ffmpeg."""

from __future__ import annotations

import subprocess
import tempfile
from collections.abc import Iterable
from contextlib import suppress
from fractions import Fraction
from pathlib import Path

from heelstrike.errors import ViewError


def write_mp4(
    pictures: Iterable[memoryview], size: tuple[int, int], fps: float, path: Path
) -> None:
    """Encode pictures of four bytes (red, green, blue, opacity) a pixel.

    Parameters
    ----------
    pictures : iterable of memoryview
        One after the other; each is used before the next is asked for.
    size : (int, int)
        Width and height in pixels, even numbers.
    fps : float
        Pictures a second.
    path : Path
        File to write.

    Raises
    ------
    ViewError
        If there is no ffmpeg, or none that runs.
    OSError
        If ffmpeg cannot write the file.
    """
    ffmpeg = _ffmpeg()
    rate = str(Fraction(fps).limit_denominator())
    given = ["-f", "rawvideo", "-pix_fmt", "rgba", "-s", f"{size[0]}x{size[1]}", "-r", rate]
    wanted = ["-an", "-c:v", "libx264", "-pix_fmt", "yuv420p", "-preset", "veryfast", "-crf", "21"]
    command = [ffmpeg, "-v", "error", "-y", *given, "-i", "-", *wanted]
    command += ["-movflags", "+faststart", str(path)]
    with tempfile.TemporaryFile() as said:
        try:
            process = subprocess.Popen(
                command,
                stdin=subprocess.PIPE,
                stdout=subprocess.DEVNULL,
                stderr=said,
                creationflags=getattr(subprocess, "CREATE_NO_WINDOW", 0),
            )
        except OSError as error:  # moved, no program, or not for this processor
            raise _no_ffmpeg(f"{ffmpeg} does not run: {error.strerror or error}") from error
        try:
            with suppress(BrokenPipeError), process.stdin as pipe:  # type: ignore[union-attr]
                for picture in pictures:
                    pipe.write(picture)
            # How it ended is the only word on whether the film is whole: a disk can fill up with
            # the very last bytes.
            code = process.wait()
        finally:
            process.kill()
            process.wait()
        said.seek(0)
        words = said.read().decode("utf-8", "replace").split("\n")
    if code != 0 or any(words):
        why = next(filter(None, reversed(words)), "it did not say why")
        raise OSError(f"ffmpeg gave up (exit {code}): {why}")


def _ffmpeg() -> str:
    try:
        import imageio_ffmpeg

        return str(imageio_ffmpeg.get_ffmpeg_exe())
    except (ImportError, RuntimeError, OSError) as error:
        raise _no_ffmpeg(str(error)) from error


def _no_ffmpeg(reason: str) -> ViewError:
    """Return the error that says how to do without ffmpeg, or to get one."""
    return ViewError(
        f"an MP4 is written by ffmpeg, and there is none that runs ({reason}). Install one: pip "
        "install --force-reinstall imageio-ffmpeg; or set IMAGEIO_FFMPEG_EXE to the path of yours. "
        "Without one write a .gif (heelstrike walk --animation gif), or a page that any browser "
        "plays (run.save_html(), heelstrike walk --html)"
    )
