"""Films of runs."""

from __future__ import annotations

import sys
from pathlib import Path

import imageio_ffmpeg
import numpy as np
import pytest
import walking
from PIL import Image
from synthetic_runs import make_run, pendulum

import heelstrike as hs
from heelstrike.view import ViewError, animate
from heelstrike.view.film import frames

# 8-bit red, green, blue of what is drawn.
LEFT_LEG = (213, 94, 0)
RIGHT_LEG = (0, 114, 178)
FORCE = (0, 158, 115)
ZERO_MOMENT_POINT = (204, 121, 167)


def share(picture: np.ndarray, color: tuple[int, int, int]) -> float:
    """Share of the pixels that have nearly a colour."""
    near = np.abs(picture[..., :3].astype(int) - color).max(axis=-1) < 25
    return float(near.mean())


def read(path: Path) -> tuple[np.ndarray, dict[str, object]]:
    """Frames (n, height, width, 3) of a film, and what its file says of it."""
    reader = imageio_ffmpeg.read_frames(str(path))
    meta = next(reader)
    width, height = meta["size"]
    pictures = [np.frombuffer(f, dtype=np.uint8).reshape(height, width, 3) for f in reader]
    return np.array(pictures), meta


def test_mp4(tmp_path: Path) -> None:
    run = walking.walk(steps=2)
    path = animate(run, tmp_path / "walk.mp4")
    pictures, meta = read(path)
    assert meta["size"] == (960, 540)
    assert meta["fps"] == 30.0
    assert str(meta["pix_fmt"]).startswith("yuv420p")  # what every player plays
    assert len(pictures) == 43  # 1.4 s and the first one
    for color in (LEFT_LEG, RIGHT_LEG, FORCE, ZERO_MOMENT_POINT):
        assert share(pictures[10], color) > 1e-4, color
    # The robot moves on; the camera keeps it in the middle.
    assert np.abs(pictures[10].astype(int) - pictures[20]).mean() > 0.5
    for picture in pictures:
        near = np.abs(picture.astype(int) - (34, 34, 34)).max(axis=-1) < 40  # the trunk
        column = np.flatnonzero(near[100:200].any(axis=0))
        assert 380 < column.mean() < 580


def test_gif(tmp_path: Path) -> None:
    path = animate(walking.walk(steps=1), tmp_path / "walk.gif", fps=20, size=(480, 270))
    with Image.open(path) as film:
        assert film.size == (480, 270)
        assert film.n_frames == 15
        assert film.info["duration"] == 50
        film.seek(7)
        picture = np.asarray(film.convert("RGB"))
    for color in (LEFT_LEG, RIGHT_LEG, FORCE):
        assert share(picture, color) > 1e-4


def test_slow_motion_has_more_frames(tmp_path: Path) -> None:
    path = animate(walking.walk(steps=1), tmp_path / "slow.mp4", speed=0.5, size=(320, 180))
    assert imageio_ffmpeg.count_frames_and_secs(str(path))[0] == 43


def test_frames_carry_the_impulses_between_them() -> None:
    """Mean forces times the time between frames add up to the run's impulses, impacts included."""
    run = walking.walk(steps=2)
    seen = frames(run, 1.0 / 30.0)
    elapsed = np.diff(run.time[seen.row])[:, None, None]
    last = seen.row[-1]
    held = np.diff(run.time)[:last, None, None]
    np.testing.assert_allclose(
        (seen.force[1:] * elapsed).sum(axis=0), (run.world_force[:last] * held).sum(axis=0)
    )
    assert np.nanmax(np.abs(seen.pressure[:, 1])) < 1e-6  # on the ground
    inside = np.isfinite(seen.pressure[:, 0])
    assert inside.all()


def test_frames_are_at_equal_times() -> None:
    run = walking.walk(steps=2)
    seen = frames(run, 0.1)
    np.testing.assert_allclose(seen.time, np.arange(15) * 0.1, atol=1e-9)
    np.testing.assert_allclose(run.time[seen.row], seen.time, atol=1e-9)


@pytest.mark.parametrize("kind", ["fall", "one row", "pendulum", "stairs", "slow motion"])
def test_unusual_runs(kind: str, tmp_path: Path) -> None:
    robot, speed = walking.bravo7(), 1.0
    if kind == "fall":
        run = hs.simulate(
            robot, state=hs.State(robot.model.reference, np.full(robot.nv, 0.4)), duration=3.0
        )
    elif kind == "one row":
        run = make_run(robot, [0.0])
    elif kind == "pendulum":
        run = hs.simulate(pendulum(), state=hs.State([1.0], [0.0]), duration=0.3)
    elif kind == "stairs":
        ground = hs.Ground.stairs(rise=-0.1, tread=0.3, count=3, start=0.1)
        run = hs.simulate(robot, state=robot.reference_state(), duration=0.3, ground=ground)
    else:
        run, speed = hs.simulate(robot, state=robot.reference_state(), duration=5e-3), 1e-3
    path = animate(run, tmp_path / "film.mp4", size=(320, 180), speed=speed)
    pictures, _ = read(path)
    assert len(pictures) >= 1
    assert share(pictures[-1], (34, 34, 34)) > 1e-3  # something dark is there: trunk or rod


def test_bad_requests(tmp_path: Path) -> None:
    run = walking.walk(steps=1)
    for name, options, message in (
        ("walk.avi", {}, r"\.mp4 or \.gif"),
        ("nowhere/walk.mp4", {}, "no folder"),
        ("walk.mp4", {"fps": 0.0}, "fps must lie between"),
        ("walk.mp4", {"speed": -1.0}, "speed must lie between"),
        ("walk.mp4", {"size": (10, 10)}, "64 to 8192 pixels"),
    ):
        with pytest.raises(ViewError, match=message):
            animate(run, tmp_path / name, **options)  # type: ignore[arg-type]
    with pytest.raises(ViewError, match="no rows"):
        animate(make_run(walking.bravo7(), np.zeros(0)), tmp_path / "walk.mp4")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("lack", ["package", "program", "moved", "no program"])
def test_without_ffmpeg_the_ways_out_are_named(
    lack: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def missing() -> str:
        raise RuntimeError("No ffmpeg exe could be found")

    out, empty = tmp_path / "out", tmp_path / "empty"
    out.mkdir()
    empty.write_bytes(b"")
    empty.chmod(0o755)
    if lack == "package":
        monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    elif lack == "program":
        monkeypatch.setattr("imageio_ffmpeg.get_ffmpeg_exe", missing)
    else:
        place = tmp_path / "nowhere" if lack == "moved" else empty
        monkeypatch.setenv("IMAGEIO_FFMPEG_EXE", str(place))
    run = walking.walk(steps=1)
    ways_out = "pip install .*imageio-ffmpeg.*IMAGEIO_FFMPEG_EXE.*gif.*save_html"
    with pytest.raises(ViewError, match=ways_out):
        animate(run, out / "walk.mp4", size=(64, 64))
    assert not list(out.iterdir())
    animate(run, out / "walk.gif", size=(64, 64))  # the advice is good
    run.save_html(out / "walk.html")
