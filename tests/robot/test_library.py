"""Built-in robots, and loading by name or path: what works, and what an error says."""

from __future__ import annotations

import os
import random
import re
import subprocess
import sys
import warnings
from pathlib import Path

import mujoco
import numpy as np
import pytest

import heelstrike.robot.library as library
from heelstrike.errors import RobotError
from heelstrike.robot import (
    FindingKind,
    RobotWarning,
    builtin_robots,
    inspect_robot,
    load_robot,
    read_mjcf,
)

FILES = Path(library.__file__).parent
PENDULUM = (
    '<mujoco model="pendulum"><worldbody><body><joint axis="0 1 0"/><geom size="0.1"/></body>'
    "</worldbody></mujoco>"
)


PASSIVE = ("compass_gait", "kneed_walker", "rimless_wheel")
POINT_FEET = ("rabbit", "rabbit_optimtraj")
ACTUATED = tuple(name for name in builtin_robots() if name not in PASSIVE)


def standing_heights(name: str) -> np.ndarray:
    """Height of the lowest point of every contact disc in the reference configuration."""
    robot = load_robot(name)
    origin = np.zeros((robot.nv, 2))
    for i, parent in enumerate(robot.model.parent):
        origin[i] = robot.model.offset[i] + (origin[parent] if parent >= 0 else 0.0)
    height = (origin[robot.model.contact_link] + robot.model.contact_position)[:, 1]
    return height - robot.model.contact_radius


@pytest.mark.parametrize("name", builtin_robots())
def test_a_built_in_robot_loads_without_a_word(name: str) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        robot = load_robot(name)
    assert robot.name == name
    assert robot.feet


@pytest.mark.parametrize("folders", [".", ["here", "there"]])
def test_a_built_in_robot_needs_no_packages(folders: str | list[str]) -> None:
    """A user who names folders of packages means a file of theirs."""
    with pytest.raises(RobotError, match=r"'bravo7' is built in.*leave out package_path"):
        load_robot("bravo7", package_path=folders)
    assert load_robot("bravo7", package_path=()).name == "bravo7"


@pytest.mark.parametrize("name", ACTUATED)
def test_a_built_in_robot_is_a_complete_biped(name: str) -> None:
    robot = load_robot(name)
    assert robot.floating
    assert robot.mirror is not None
    assert len(robot.feet) == 2
    assert {len(foot.contacts) for foot in robot.feet} == {1 if name in POINT_FEET else 2}
    # Every joint of the legs has a motor and a range.
    np.testing.assert_array_equal(robot.model.actuator_joint, np.arange(3, robot.nv))
    assert np.all(np.isfinite(robot.model.torque_upper))
    assert np.all(np.isfinite(robot.model.lower[3:]) & np.isfinite(robot.model.upper[3:]))


@pytest.mark.parametrize("name", builtin_robots())
def test_a_built_in_file_names_its_source(name: str) -> None:
    text = (FILES / f"{name}.xml").read_text(encoding="utf-8")
    comment = text[: text.index("-->")]
    assert comment.startswith(f"<!--\n  {name}: ")
    assert re.search(r"Numbers from |From the paper: |After ", comment)
    assert max(map(len, comment.splitlines())) <= 100


@pytest.mark.parametrize("name", builtin_robots())
def test_a_built_in_file_runs_in_mujoco_and_stands_on_its_floor(name: str) -> None:
    """In the reference configuration the soles are on z = 0, and MuJoCo's gravity rests on them."""
    model = mujoco.MjModel.from_xml_path(str(FILES / f"{name}.xml"))
    data = mujoco.MjData(model)
    for _ in range(2):
        mujoco.mj_step(model, data)
    assert data.ncon > 0
    height = standing_heights(name)
    if name == "rimless_wheel":  # stands on two of its spokes
        height = np.sort(height)[:2]
    np.testing.assert_allclose(height, 0.0, atol=1e-15)


def test_bravo7_has_the_numbers_of_its_source() -> None:
    """reference: Winter's tables for 75 kg and 1.8 m; foot and soles from the paper."""
    robot = load_robot("bravo7")
    model = robot.model
    assert (robot.nq, robot.nv, robot.nu, robot.nc) == (9, 9, 6, 4)
    assert robot.total_mass == pytest.approx(75.0, abs=1e-12)
    legs = ("hip", "knee", "ankle")
    assert robot.joint_names == (
        *("root_x", "root_z", "root_pitch"),
        *(f"right_{joint}" for joint in legs),
        *(f"left_{joint}" for joint in legs),
    )
    np.testing.assert_allclose(model.mass[2:6], [50.85, 7.5, 3.4875, 1.0875])
    np.testing.assert_allclose(model.inertia[2:6], [3.1777, 0.1522, 0.0624, 0.0184])
    height = [0.3155, -0.191, -0.1917, -0.0351]
    np.testing.assert_allclose(model.center_of_mass[2:6], [[0.0, h] for h in height], atol=1e-15)
    np.testing.assert_allclose(
        model.offset[2:6], [[0, 0.9538], [0, 0], [0, -0.441], [0, -0.4428]], atol=1e-15
    )
    np.testing.assert_allclose(
        model.contact_position, [[-0.1, -0.07], [0.1, -0.07]] * 2, atol=1e-15
    )
    np.testing.assert_array_equal(model.axis[2:, 0], 1.0)


def test_spring_flamingo_has_the_numbers_of_its_source() -> None:
    """dojo-sim/ContactImplicitMPC.jl, src/dynamics/flamingo/model.jl."""
    robot = load_robot("spring_flamingo")
    model = robot.model
    np.testing.assert_allclose(model.mass[2:6], [12.0, 0.4598, 0.306, 0.3466])
    np.testing.assert_allclose(model.inertia[2:6], [0.10, 0.01256, 0.00952, 0.0015])
    np.testing.assert_allclose(
        model.center_of_mass[2:6], [[0, 0.2], [0, -0.42 / 2], [0, -0.45 / 2], [0.06, 0]], atol=1e-15
    )
    np.testing.assert_allclose(model.offset[3:6], [[0, 0], [0, -0.42], [0, -0.45]], atol=1e-15)
    np.testing.assert_allclose(
        model.contact_position, [[-0.0525, 0.0], [0.1725, 0.0]] * 2, atol=1e-15
    )


@pytest.mark.parametrize(
    ("name", "mass", "inertia", "center", "length", "contacts"),
    [
        (
            "human7",
            (50.85, 7.5, 3.4875, 1.0875),
            (3.1777, 0.1522, 0.0624, 0.0184),
            ((0, 0.3155), (0, -0.191), (0, -0.1917), (0.0768, -0.0351)),
            (0.4410, 0.4428),
            ((-0.06, -0.07), (0.15, -0.07)),
        ),
        (
            "geyer7",
            (53.5, 8.5, 3.5, 1.25),
            (3.0, 0.15, 0.05, 0.005),
            # From the knee, the ankle and the toe point to the upper joints of the links.
            ((0, 0.35), (0, 0.30 - 0.5), (0, 0.30 - 0.5), (0.16 - 0.14, 0)),
            (0.5, 0.5),
            ((0.16 - 0.20, 0), (0.16, 0)),
        ),
        (
            "rabbit",
            (12.0, 6.8, 3.2),
            (1.33, 0.47, 0.20),
            ((0, 0.24), (0, -0.11), (0, -0.24)),
            (0.4,),
            ((0, -0.4),),
        ),
        (
            "rabbit_optimtraj",
            (20.0, 6.8, 3.2),
            (2.22, 1.08, 0.93),
            # The torso's centre is 0.2 m below its upper end.
            ((0, 0.625 - 0.2), (0, -0.163), (0, -0.128)),
            (0.4,),
            ((0, -0.4),),
        ),
    ],
)
def test_a_biped_has_the_numbers_of_its_source(
    name: str,
    mass: tuple[float, ...],
    inertia: tuple[float, ...],
    center: tuple[tuple[float, float], ...],
    length: tuple[float, ...],
    contacts: tuple[tuple[float, float], ...],
) -> None:
    """The tables of the sources, which each file repeats and names."""
    model = load_robot(name).model
    last = 2 + len(mass)
    np.testing.assert_array_equal(model.mass[2:last], mass)
    np.testing.assert_allclose(model.inertia[2:last], inertia, rtol=1e-14)
    np.testing.assert_allclose(model.center_of_mass[2:last], center, atol=1e-15)
    np.testing.assert_allclose(
        model.offset[3:last], [(0, 0), *((0, -one) for one in length)], atol=1e-15
    )
    np.testing.assert_allclose(model.contact_position, contacts * 2, atol=1e-15)
    np.testing.assert_array_equal(model.contact_radius, 0.0)


def test_compass_gait_has_the_numbers_of_its_source() -> None:
    """Goswami, Thuilot and Espiau 1998: m = 5 kg, mh = 10 kg, a = b = 0.5 m."""
    robot = load_robot("compass_gait")
    assert (robot.nq, robot.nu, robot.floating) == (4, 0, False)
    np.testing.assert_array_equal(robot.model.mass, [0, 10, 5, 5])
    np.testing.assert_array_equal(robot.model.center_of_mass[2:], [[0, -0.5]] * 2)
    np.testing.assert_array_equal(robot.model.contact_position, [[0, -1]] * 2)
    assert robot.model.inertia.max() <= 1e-12


def test_kneed_walker_has_the_numbers_of_its_source() -> None:
    """Chen 2007: m_h = m_t = 0.5 kg, m_s = 0.05 kg; a_1 = 0.375, b_1 = 0.125, a_2 = 0.175 m …"""
    model = load_robot("kneed_walker").model
    np.testing.assert_array_equal(model.mass, [0, 0.5, 0.5, 0.05, 0.5, 0.05])
    below = [-0.325, -0.125, -0.325, -0.125]  # b_2 = 0.325 m, and b_1
    np.testing.assert_allclose(model.center_of_mass[2:, 1], below, rtol=1e-15)
    np.testing.assert_allclose(model.offset[[3, 5], 1], -0.5, rtol=1e-15)
    np.testing.assert_allclose(model.contact_position, [[0, -0.5]] * 2, rtol=1e-15)
    assert model.inertia.max() <= 1e-12
    assert (model.latch_joint.tolist(), model.latch_release.tolist()) == ([3, 5], [5, 3])


def test_rimless_wheel_is_a_point_mass_on_eight_spokes() -> None:
    robot = load_robot("rimless_wheel")
    assert (robot.nq, robot.nu, robot.nc) == (3, 0, 8)
    np.testing.assert_array_equal(robot.model.mass, [0, 0, 1])
    tips = robot.model.contact_position
    np.testing.assert_allclose(np.hypot(*tips.T), 1.0, rtol=1e-15)
    # Angles from straight down; two spokes frame the vertical at plus and minus 22.5 degrees.
    angle = np.sort(np.arctan2(tips[:, 0], -tips[:, 1]))
    np.testing.assert_allclose(np.degrees(angle), np.arange(-157.5, 180, 45), atol=1e-12)


def test_walker2d_moves_as_gymnasiums() -> None:
    """Every number that acts on the motion, on the same coordinates, to round-off.

    The files say the same in different words (capsules between their ends or about their middle),
    so that products of a few numbers differ in the last digit. The reference height alone differs:
    theirs hovers. Contact: theirs lets all links touch the floor, ours the feet.
    """
    gymnasium = pytest.importorskip("gymnasium")
    path = Path(gymnasium.__file__).parent / "envs" / "mujoco" / "assets" / "walker2d_v5.xml"
    theirs, ours = mujoco.MjModel.from_xml_path(str(path)), load_robot("walker2d")
    reread = mujoco.MjModel.from_xml_path(str(FILES / "walker2d.xml"))
    draw = np.random.default_rng(0)
    data, other = mujoco.MjData(theirs), mujoco.MjData(reread)
    for one in (theirs, reread):
        one.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    for _ in range(100):
        q, v, control = draw.normal(size=9), draw.normal(size=9), draw.uniform(-1, 1, size=6)
        for model, state in ((theirs, data), (reread, other)):
            state.qpos[:], state.qvel[:], state.ctrl[:] = q, v, control
            mujoco.mj_forward(model, state)
        scale = np.abs(data.qacc).max()
        np.testing.assert_allclose(other.qacc, data.qacc, atol=1e-11 * scale)
        for there, here in (("foot_geom", "right_sole"), ("foot_left_geom", "left_sole")):
            np.testing.assert_allclose(
                other.geom(here).xpos[::2], data.geom(there).xpos[::2], atol=1e-14
            )
    known = read_mjcf(path)
    for field in ("mass", "inertia", "armature", "damping", "lower", "upper", "torque_upper"):
        np.testing.assert_allclose(
            getattr(ours.model, field), getattr(known.model, field), rtol=1e-13, err_msg=field
        )
    feet = [i for foot in known.feet for i in foot.contacts]
    np.testing.assert_allclose(ours.model.contact_radius, known.model.contact_radius[feet])
    np.testing.assert_allclose(
        ours.model.contact_position, known.model.contact_position[feet], atol=1e-14
    )
    assert ours.total_mass == pytest.approx(23.7, abs=0.05)


def test_gymnasiums_walker() -> None:
    gymnasium = pytest.importorskip("gymnasium")
    path = Path(gymnasium.__file__).parent / "envs" / "mujoco" / "assets" / "walker2d_v5.xml"
    robot = load_robot(path)
    assert (robot.nq, robot.nu, robot.floating) == (9, 6, True)
    assert robot.total_mass == pytest.approx(23.7, abs=0.05)
    assert [foot.name for foot in robot.feet] == ["foot", "foot_left"]
    np.testing.assert_allclose(robot.model.contact_radius[list(robot.feet[0].contacts)], 0.06)
    np.testing.assert_array_equal(robot.model.torque_upper, 100.0)
    np.testing.assert_array_equal(robot.model.armature, [0, 0, 0, *[0.01] * 6])
    np.testing.assert_array_equal(robot.model.damping, [0, 0, 0, *[0.1] * 6])
    assert robot.mirror is not None
    np.testing.assert_array_equal(robot.mirror.joint, [0, 1, 2, 6, 7, 8, 3, 4, 5])


def test_the_old_walkers_unequal_feet_are_found(tmp_path: Path) -> None:
    """The slip of the older walker2d.xml, unnoticed for years: friction 0.9 and 1.9.

    Friction is the ground's here, so that the robot is its own mirror image; a look finds it.
    """
    gymnasium = pytest.importorskip("gymnasium")
    path = Path(gymnasium.__file__).parent / "envs" / "mujoco" / "assets" / "walker2d_v5.xml"
    old = tmp_path / "old.xml"
    old.write_text(path.read_text("utf-8").replace('friction="1.9"', 'friction="0.9"', 1), "utf-8")
    assert load_robot(old).mirror is not None
    found = [one for one in inspect_robot(old).findings if one.kind is FindingKind.FRICTION]
    assert [one.message for one in found] == ["foot 0.9, foot_left 1.9."]


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("bravo8", "no robot called 'bravo8'.*Did you mean 'bravo7'.*spring_flamingo"),
        ("zzz", "no robot called 'zzz'.*Built in are bravo7"),
        ("", "no robot called ''"),
        ("nowhere/robot.xml", "there is no such file"),
        ("../library/bravo7", "no robot called"),
    ],
)
def test_an_unknown_robot(name: str, words: str) -> None:
    with pytest.raises(RobotError, match=words):
        load_robot(name)


@pytest.mark.parametrize("thing", [None, 7, b"bravo7", ["bravo7"]])
def test_what_is_no_name(thing: object) -> None:
    with pytest.raises(RobotError, match=type(thing).__name__):
        load_robot(thing)  # type: ignore[arg-type]


def test_loading_by_path(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "Härte test.xml"
    path.write_text(PENDULUM, encoding="utf-8")
    for given in (path, str(path)):
        robot = load_robot(given)
        assert robot.name == "pendulum"
        assert robot.source == str(path)
    monkeypatch.chdir(tmp_path)
    assert load_robot(path.name).name == "pendulum"
    path.write_text(PENDULUM.replace('model="pendulum"', ""), encoding="utf-8")
    assert load_robot(path).name == "Härte test"


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("", "empty"),
        (" \n\t", "empty"),
        ("\0\0\0", "not a text file"),
        (b"\xff\xfe\xfa", "UTF-8"),
        ("<mujoco>", "not well-formed XML: no element found at line 1, column 9"),
        ("walk this way", "not well-formed XML: syntax error at line 1, column 1"),
        ("<svg/>", "begins with <svg>"),
        (PENDULUM.replace('size="0.1"', 'size="-0.1"'), "MuJoCo's parser cannot read"),
        (PENDULUM.replace("joint", "jiont"), "jiont"),
        (PENDULUM.replace("geom ", 'geom mass="-3" '), "MuJoCo's parser cannot read"),
        ('<!DOCTYPE x [<!ENTITY a "b">]>' + PENDULUM, "entity"),
        (PENDULUM.replace("<mujoco", '<mujoco><include file="gone.xml"/></mujoco><mujoco'), ""),
        ('<mujoco><include file="gone.xml"/></mujoco>', "gone.xml"),
        ('<mujoco><include file="."/></mujoco>', "not a regular file"),
        (
            PENDULUM.replace("<body>", '<replicate count="300000"><body>').replace(
                "</body>", "</body></replicate>"
            ),
            "copies",
        ),
        ("<mujoco><worldbody>" + "<body>" * 5000, "more than 400 elements inside"),
        (" " * 2**24 + PENDULUM, "larger than 16 MB"),
    ],
    ids=range(17),
)
def test_a_bad_file_is_named_with_its_fault(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, content: str | bytes, words: str
) -> None:
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "robot.xml"
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    with pytest.raises(RobotError) as caught:
        load_robot(path)
    assert str(path) in str(caught.value)
    assert words in str(caught.value)
    assert [entry.name for entry in tmp_path.iterdir()] == [
        "robot.xml"
    ]  # MuJoCo left no log behind


def test_what_is_no_robot_file(tmp_path: Path) -> None:
    (tmp_path / "robots.xml").mkdir()
    with pytest.raises(RobotError, match="directory"):
        load_robot(tmp_path / "robots.xml")
    (tmp_path / "robot.txt").write_text(PENDULUM)
    with pytest.raises(RobotError, match=r"expected an MJCF file \(.xml\), a URDF file"):
        load_robot(tmp_path / "robot.txt")
    with pytest.raises(RobotError):
        load_robot("a\0b.xml")
    with pytest.raises(RobotError):
        load_robot("x" * 5000 + ".xml")
    with pytest.raises(RobotError):
        load_robot("x" * 5000)


def test_an_include_chain_is_screened(tmp_path: Path) -> None:
    (tmp_path / "part.xml").write_text("<!DOCTYPE x []><mujocoinclude/>")
    (tmp_path / "robot.xml").write_text(
        PENDULUM.replace("<worldbody>", '<include file="part.xml"/><worldbody>')
    )
    with pytest.raises(RobotError, match=r"robot.xml: included .*part.xml.*entity"):
        load_robot(tmp_path / "robot.xml")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no named pipes")
def test_a_pipe_does_not_hang(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.xml")
    (tmp_path / "robot.xml").write_text('<mujoco><include file="pipe.xml"/></mujoco>')
    for name in ("pipe.xml", "robot.xml"):
        with pytest.raises(RobotError, match="not a regular file"):
            load_robot(tmp_path / name)


def test_every_cut_of_a_file_is_refused_or_warned() -> None:
    """Half a robot never loads in silence as a whole one, nor ends in another kind of error."""
    text = (FILES / "bravo7.xml").read_text(encoding="utf-8")
    body = text.index("<mujoco")
    for cut in range(body, text.rindex("</mujoco>"), 97):
        with pytest.raises(RobotError):
            read_mjcf(text[:cut])


def _mutated(text: str, draw: random.Random) -> str:
    """Spoil a file as a slip of the hand, a bad copy or malice would."""
    attributes = list(re.finditer(r'(\w+)="([^"]*)"', text))
    lines = text.split("\n")
    slip = draw.randrange(6)
    if slip == 0 or not attributes:
        return text[: draw.randrange(len(text) + 1)]
    if slip == 1:
        lines.insert(draw.randrange(len(lines)), draw.choice(lines))
        return "\n".join(lines)
    if slip == 2:
        del lines[draw.randrange(len(lines))]
        return "\n".join(lines)
    here, other = draw.choice(attributes), draw.choice(attributes)
    if slip == 3:
        return text[: here.start()] + text[here.end() :]
    values = ["nan", "inf", "-1", "0", "1e308", "-0", "", "abc", "9" * 400, "../../x", "é", "1 2"]
    value = other.group(2) if slip == 4 else draw.choice(values)
    return text[: here.start(2)] + value + text[here.end(2) :]


@pytest.mark.parametrize("name", builtin_robots())
def test_a_spoilt_file_is_refused_or_gives_a_sound_robot(name: str) -> None:
    text = re.sub(r"<!--.*?-->", "", (FILES / f"{name}.xml").read_text("utf-8"), flags=re.DOTALL)
    draw = random.Random(name)
    refused = 0
    for _ in range(150):
        spoilt = text
        for _ in range(draw.randint(1, 2)):
            spoilt = _mutated(spoilt, draw)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RobotWarning)
            try:
                robot = read_mjcf(spoilt)
            except RobotError:
                refused += 1
                continue
        assert robot.total_mass > 0.0
        for field, values in robot.model.members().items():
            assert not np.any(np.isnan(values)), field
    assert 0 < refused < 150


def test_importing_the_robots_does_not_import_mujoco() -> None:
    code = "import sys, heelstrike.robot; print('mujoco' in sys.modules)"
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60
    )
    assert done.stdout.strip() == "False"
