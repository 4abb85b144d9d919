"""A summary whose every figure can be worked out on paper, and the page that a person reads."""

from __future__ import annotations

import dataclasses
import io

import numpy as np
import pytest
from synthetic_runs import liftoff, make_run, touchdown

import heelstrike as hs
from heelstrike.analysis.summary import GaitFigures, Summary, summarize
from heelstrike.gait import ClearanceProfile, Footing, Phase
from heelstrike.gait.gait import actuated_joints, fingerprint
from heelstrike.gait.margins import Margins
from heelstrike.sim import Certificates, RunStatus, SolverCount, Timing

MASS, G = 75.0, 9.81


def standing_still() -> hs.Gait:
    """Return a gait whose joints stay where they are when bravo7 stands straight."""
    robot = hs.load_robot("bravo7")
    none, ends = np.zeros(6), np.array([0.0, 0.8])
    margins = Margins(*np.zeros(len(dataclasses.fields(Margins))).tolist())
    return hs.Gait(
        robot=robot.name,
        fingerprint=fingerprint(robot),
        joint_names=actuated_joints(robot),
        step_length=0.25,
        phases=(Phase(contacts={0: Footing.FLAT}, breakpoints=ends, pieces=np.zeros((1, 4, 6))),),
        mirror_joint=np.array([3, 4, 5, 0, 1, 2]),
        mirror_sign=np.ones(6),
        mirror_offset=none,
        initial_state=robot.reference_state(),
        cost=90.5,
        friction=0.75,
        clearance=0.03,
        clearance_profile=ClearanceProfile.PARABOLA,
        touchdown_impulse=np.zeros(3),
        margins=margins,
    )


def carried() -> hs.Run:
    """Make a run of five rows, 0.1 s apart: bravo7 stands on its right foot and is carried along.

    In the fourth row the left foot pushes as well. The left leg is off its gait.
    """
    robot = hs.load_robot("bravo7")
    time = 0.1 * np.arange(5)
    q = np.tile(robot.model.reference, (5, 1))
    q[:, 0] = 0.5 * time  # m: the whole robot by 0.2 m in all
    q[:, 6] = 0.03  # rad, left hip
    q[:, 7] = -0.04  # rad, left knee
    v = np.zeros((5, 9))
    v[:, 3] = 3.0  # rad/s, right hip
    torque = np.zeros((5, 6))
    torque[:, 0] = [2.0, 2.0, -2.0, -1.0, 9.0]  # N m, right hip; the last row acts on nothing
    force = np.zeros((5, 4, 2))
    force[:, 0, 0] = [300.0, 100.0, 40.0, 10.0, 200.0]  # N, right heel
    force[:, 1, 0] = [100.0, 300.0, 360.0, 390.0, 200.0]  # right toe
    force[1, :2, 1] = [30.0, -90.0]
    force[3, 2:, 0] = 100.0  # left foot
    force[3, 2:, 1] = 40.0
    slip = np.zeros((5, 4))
    slip[:, 0] = [0.1, -0.2, 0.3, 0.0, 7.0]  # m/s
    slip[:, 1] = [0.0, 0.0, 0.0, 0.1, 7.0]
    slip[:, 3] = [5.0, 5.0, 5.0, 0.0, 5.0]  # in the air
    return make_run(
        robot,
        time,
        position=q,
        velocity=v,
        torque=torque,
        force=force,
        ground=hs.Ground(friction=0.5),
        slip_velocity=slip,
        status=RunStatus.FELL,
        message="the robot fell",
        events=[touchdown(0.3, 2), liftoff(0.34, 2)],
        certificates=Certificates(1e-5, 2e-12, 3e-12, 4e-12, 0.75),
        solver=SolverCount("lemke", 10, 7, 2, 1, 6, 3),
        saturations=4,
        timing=Timing(compile_s=0.5, wall_s=0.2),
    )


def test_every_figure_by_hand() -> None:
    expected = {
        "robot": "bravo7",
        "status": "fell",
        "message": "the robot fell",
        "first_cause": "slipped at 0.000 s (right foot)",
        "steps": 1,
        "distance_m": 0.2,
        "duration_s": 0.4,
        "gait": {"step_length_m": 0.25, "step_duration_s": 0.8, "cost_N2m2s": 90.5},
        "tracking_rms_rad": 0.05 / np.sqrt(6.0),  # 3-4-5, over six joints
        "tracking_max_rad": 0.04,
        # Lever rule between heel and toe, 0.1 m behind and ahead of the ankle.
        "zmp_min_m": -0.05,
        "zmp_max_m": 0.08,
        "zmp_limits_m": [-0.1, 0.1],
        "zmp_margin_min_m": 0.02,
        "friction_use_max": 80.0 / (0.5 * 200.0),
        "slip_max_m": 0.01 + 0.02 + 0.03,
        "penetration_max_m": 1e-5,
        "complementarity_max": 2e-12,
        "solver": {
            "name": "lemke",
            "solves": 10,
            "shortcuts": 7,
            "fallbacks": 2,
            "failures": 1,
            "combinations": 6,
            "relaxed": 3,
        },
        "torque_cost_N2m2s": 0.1 * (4.0 + 4.0 + 4.0 + 1.0),
        "cost_of_transport": 0.1 * 3.0 * (2.0 + 2.0 + 2.0 + 1.0) / (MASS * G * 0.2),
        "cost_of_transport_positive": 0.1 * 3.0 * (2.0 + 2.0) / (MASS * G * 0.2),
        "double_support_fraction": 0.25,
        "saturations": 4,
        "compile_s": 0.5,
        "wall_s": 0.2,
        "real_time_factor": 2.0,
        "energy_gain_J": 0.75,
        "doubt": "",
    }
    found = summarize(carried(), gait=standing_still()).to_dict()
    assert found.keys() == expected.keys()
    for name, value in expected.items():
        if isinstance(value, float | list):
            value = pytest.approx(value, rel=1e-9)
        assert found[name] == value, name


def test_without_a_gait_there_is_nothing_to_track() -> None:
    found = summarize(carried()).to_dict()
    assert found["gait"] is None
    assert found["tracking_rms_rad"] is None
    assert found["tracking_max_rad"] is None
    assert found["zmp_max_m"] == pytest.approx(0.08)


def figures() -> Summary:
    """Return a page of made-up figures, no two alike."""
    return Summary(
        robot="bravo7",
        status="completed",
        message="completed at t = 7 s",
        first_cause="",
        steps=10,
        distance_m=3.0123456,
        duration_s=7.0,
        gait=GaitFigures(0.3, 0.7, 84.76543),
        tracking_rms_rad=0.0012345,
        tracking_max_rad=0.0234567,
        zmp_min_m=-0.0567891,
        zmp_max_m=0.0765432,
        zmp_limits_m=(-0.1, 0.12),
        zmp_margin_min_m=0.0234,
        friction_use_max=0.3456789,
        slip_max_m=1.234e-5,
        penetration_max_m=5.678e-8,
        complementarity_max=3.21e-13,
        solver=SolverCount("lemke", 7001, 6990, 3, 2),
        torque_cost_N2m2s=850.0,
        cost_of_transport=0.2345678,
        cost_of_transport_positive=0.1234567,
        double_support_fraction=0.01,
        saturations=4,
        compile_s=0.98765,
        wall_s=0.17654,
        real_time_factor=39.6543,
    )


SOLVED = "7001, 2 not certified, 3 needed another solver"
PAGE = f"""\
bravo7: completed at t = 7 s
status                 completed
steps                  10
distance               3.012 m in 7 s (0.43 m/s)
gait                   0.3 m in 0.7 s a step, torque cost 84.77 N²m²s
joint tracking error   0.00123 rad rms, 0.0235 rad at most
zero moment point      -0.0568 … 0.0765 m (sole -0.1 … 0.12 m)
friction use           0.346 of the cone
slip                   1.2e-05 m
penetration            5.7e-08 m
contact problems       {SOLVED}; complementarity residual 3.2e-13
cost of transport      0.235 (0.123 by positive work alone)
torques at their limit 4
computing time         0.177 s (39.7 × real time), compilation 0.988 s"""


def lines(page: str) -> list[str]:
    return [" ".join(line.split()) for line in page.splitlines()]


def test_the_page_a_person_reads() -> None:
    assert lines(str(figures())) == lines(PAGE)
    figures_begin = len("torques at their limit  ")
    for line in str(figures()).splitlines()[1:]:  # in one column
        assert line[figures_begin - 2 : figures_begin] == "  "
        assert line[figures_begin] != " "


def test_what_is_not_there_is_a_dash() -> None:
    nan = float("nan")
    page = str(
        dataclasses.replace(
            figures(),
            gait=None,
            duration_s=0.0,
            zmp_min_m=nan,
            zmp_max_m=nan,
            friction_use_max=float("inf"),
            solver=SolverCount("lemke", 5, 0, 0, 0),
        )
    )
    assert lines(page)[3:6] == [
        "distance 3.012 m in 0 s (– m/s)",
        "zero moment point – … – m (sole -0.1 … 0.12 m)",
        "friction use – of the cone",
    ]
    assert "contact problems 5, all certified; complementarity residual 3.2e-13" in lines(page)


def test_a_person_reads_how_many_problems_are_certified_and_not_by_which_way() -> None:
    assert str(SolverCount("lemke", 9, 9, 0, 0)) == "9, all certified"
    assert str(SolverCount("lemke", 0, 0, 0, 0)) == "none"


def test_what_is_seldom_is_told_where_it_is() -> None:
    counts = SolverCount("lemke", 9, 5, 3, 2, 4, 6)
    assert str(counts) == (
        "9, 2 not certified, 3 needed another solver, 4 by trying combinations of contact modes, "
        "6 steps with a wedged point or an impact left as it was"
    )
    made = dataclasses.replace(figures(), energy_gain_J=1.25)
    line = "energy created by impacts 1.25 J (Newton's restitution with friction)"
    assert line in lines(str(made))
    assert line.split(" 1.25")[0] not in str(figures())


def test_a_windows_console_can_print_it() -> None:
    """Its letters are those of code page 1252."""
    page = str(figures())
    assert page.encode("cp1252").decode("cp1252") == page
    assert "0.0765" in page


@pytest.mark.parametrize(("status", "colour"), [("completed", "green"), ("fell", "red")])
def test_a_terminal_shows_the_same_page_and_how_it_ended(status: str, colour: str) -> None:
    from rich.console import Console

    summary = dataclasses.replace(figures(), status=status)
    table = summary.__rich__()
    assert table.title == "bravo7: completed at t = 7 s"
    assert table.title_style == f"bold {colour}"
    console = Console(width=200, record=True, file=io.StringIO())
    console.print(table)
    text = console.export_text()
    for line in lines(str(summary))[1:]:
        assert line.split(" ")[0] in text
