"""Images of bundles: everything as it was, and nothing believed that does not fit."""

from __future__ import annotations

import numpy as np
import pytest

import heelstrike as hs
from heelstrike.compiler.bundle import Bundle, array, cell
from heelstrike.sim.image import Camera


class Clockwork(Bundle):
    ticks: int = cell(int)
    wheel: np.ndarray = array("teeth")
    plan: np.ndarray = array(2, "teeth", of=int)
    nothing: np.ndarray = array("none")


def clockwork() -> Clockwork:
    made = Clockwork.allocate(teeth=3, none=0)
    made.ticks, made.wheel[:], made.plan[:] = 5, [1.0, np.nan, -0.0], [[1, 2, 3], [4, 5, 6]]
    return made


def test_what_was_taken_is_put_back_bit_by_bit() -> None:
    work, other = clockwork(), clockwork()
    camera = Camera([("one.", work), ("two.", other)])
    before = [values.tobytes() for _, values in (*work.storage(), *other.storage())]
    image = camera.take()
    work.ticks, work.wheel[:], other.plan[:] = 6, 0.0, 0
    camera.put_back(image)
    assert [values.tobytes() for _, values in (*work.storage(), *other.storage())] == before
    assert image.by_name()["two.plan"].tolist()[1] == [4, 5, 6]


def test_arrays_that_were_set_since_count() -> None:
    work = clockwork()
    camera = Camera([("", work)])
    image = camera.take()
    arrays = image.by_name()
    assert camera.image_of(arrays, image) is image
    arrays["wheel"] = np.array([7.0, 8.0, 9.0])
    camera.put_back(camera.image_of(arrays, image))
    assert work.wheel.tolist() == [7.0, 8.0, 9.0]


@pytest.mark.parametrize(
    "wrong", [None, np.zeros(4), np.zeros(3, dtype=np.int64), np.zeros((1, 3))]
)
def test_what_does_not_fit_is_refused(wrong: np.ndarray | None) -> None:
    work = clockwork()
    camera = Camera([("", work)])
    image = camera.take()
    arrays = image.by_name() | {"wheel": wrong}
    with pytest.raises(ValueError, match="wheel"):
        camera.image_of(arrays, image)  # type: ignore[arg-type]
    del arrays["wheel"], arrays["nothing"]
    with pytest.raises(ValueError, match="wheel"):
        camera.image_of(arrays, None)  # type: ignore[arg-type]


@pytest.fixture
def walker() -> hs.Simulation:
    robot = hs.load_robot("compass_gait")
    simulation = hs.Simulation(robot, state=robot.reference_state(), stop_when_fallen=False)
    simulation.advance(0.02)
    return simulation


def test_a_snapshot_may_be_changed_before_it_is_taken_up(walker: hs.Simulation) -> None:
    snapshot = walker.snapshot()
    snapshot.arrays["memory.v"][:] = 0.5  # in its place
    snapshot.arrays["memory.q"] = snapshot.arrays["memory.q"] + 0.25  # or by another
    expected = snapshot.arrays["memory.q"].copy()
    walker.advance(0.03)
    walker.restore(snapshot)
    assert np.all(walker.state.v == 0.5)
    assert np.array_equal(walker.state.q, expected)
    assert walker.time == snapshot.time


def test_a_snapshot_stays_what_it_is(walker: hs.Simulation) -> None:
    snapshot = walker.snapshot()
    kept = {name: values.copy() for name, values in snapshot.arrays.items()}
    walker.advance(0.05)
    walker.restore(snapshot)
    walker.advance(0.04)
    for name, values in snapshot.arrays.items():
        assert np.array_equal(values, kept[name], equal_nan=values.dtype.kind == "f"), name


def test_another_ground_and_pushes_are_taken_up_too(walker: hs.Simulation) -> None:
    flat = walker.snapshot()
    walker.ground = hs.Ground(friction=0.25, slope=-0.3)
    link = walker.robot.link_names[0]
    walker.apply(hs.Push(link, force=(10.0, 0.0), start=0.02, duration=0.1))
    pushed = walker.snapshot()
    walker.restore(flat)
    assert walker.ground.slope == 0.0
    assert not flat.part("push")["force"].size
    walker.restore(pushed)
    assert (walker.ground.slope, walker.ground.friction) == (-0.3, 0.25)
    assert walker.snapshot().part("push")["force"].tolist() == [[10.0, 0.0]]
