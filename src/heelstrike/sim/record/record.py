"""Rows and events of a run, as compiled loops fill them."""

from __future__ import annotations

from heelstrike.compiler.bundle import Bundle, array, cell
from heelstrike.robot.model import Floats, Integers
from heelstrike.robot.robot import Robot


class Record(Bundle):
    """Rows of a run, filled by the compiled loop, one row an instant.

    Forces and torques of a row are those decided at its instant and acting over the step that
    follows. `rows` and `events` are the numbers of rows used.
    """

    rows: int = cell(int)
    events: int = cell(int)
    time: Floats = array("nt")
    q: Floats = array("nt", "nq")
    v: Floats = array("nt", "nv")
    torque: Floats = array("nt", "nu")
    stop_torque: Floats = array("nt", "nv")
    friction_torque: Floats = array("nt", "nv")
    point: Floats = array("nt", "nc", "axes")
    normal: Floats = array("nt", "nc", "axes")
    gap: Floats = array("nt", "nc")
    force: Floats = array("nt", "nc", "components")
    slip: Floats = array("nt", "nc")
    residual: Floats = array("nt", 3)
    event_time: Floats = array("ne")
    event_kind: Integers = array("ne", of=int)
    event_contact: Integers = array("ne", of=int)
    event_impulse: Floats = array("ne", "components")


def allocate_record(robot: Robot, rows: int, events: int) -> Record:
    """Allocate a record of `rows` instants and `events` events."""
    return Record.allocate(
        nt=rows, ne=events, nq=robot.nq, nv=robot.nv, nu=robot.nu, nc=robot.nc, axes=2, components=2
    )
