"""Robot files made to hurt: to crash the parser, to run forever, to fill the memory.

What a file costs is judged by the work it makes, not by time: calls of Python functions are
counted, and the parser must not have been asked where a file is refused beforehand. The faults are
those that MuJoCo's parser was seen to have: a model that joins itself crashes it, replicas of
replicas and millions of keyframes never end, textures take any memory.
"""

from __future__ import annotations

import os
import sys
import warnings
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from types import FrameType
from typing import Any

import mujoco
import numpy as np
import pytest
from typer.testing import CliRunner

from heelstrike.cli.main import app
from heelstrike.errors import RobotError
from heelstrike.reader_process import READER
from heelstrike.robot import RobotWarning, builtin_robots, load_robot
from heelstrike.robot.files import reading
from heelstrike.robot.files.mjcf import planar_robot
from heelstrike.robot.files.mujoco_file import parse
from heelstrike.robot.files.options import Options
from heelstrike.robot.files.robot_json import robot_entries

MOST_CALLS = 1_000_000  # of Python functions; a robot of the library takes 5000
WORLD = (
    '<worldbody><body name="b" pos="0 0 1"><joint name="j" axis="0 1 0"/>'
    '<geom name="g" size="0.1"/></body></worldbody>'
)
PLAIN = f"<mujoco>{WORLD}</mujoco>"
INERTIAL = (
    '<inertial><mass value="1"/>'
    '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
)

Files = dict[str, str]


def mjcf(sections: str, world: str = WORLD) -> Files:
    """Return the files of a robot with something more."""
    return {"robot.xml": f"<mujoco>{sections}{world}</mujoco>"}


def urdf(links: int, joints: list[tuple[int, int]], more: str = "") -> Files:
    """Return a URDF of equal links; joints are pairs of numbers of links."""
    parts = [f'<link name="l{k}">{INERTIAL}</link>' for k in range(links)]
    parts += [
        f'<joint name="j{k}" type="continuous"><parent link="l{a}"/><child link="l{b}"/>'
        '<axis xyz="0 1 0"/></joint>'
        for k, (a, b) in enumerate(joints)
    ]
    return {"robot.urdf": f'<robot name="r">{"".join(parts)}{more}</robot>'}


def chain(length: int, file: Callable[[int], str], last: str) -> Files:
    """Return files of which each names the next; the first is the robot."""
    files = {f"c{k}.xml": file(k) for k in range(1, length)} | {f"c{length}.xml": last}
    return {"robot.xml": file(0), **files}


def world(inside: str) -> str:
    return f"<worldbody>{inside}</worldbody>"


def bodies(count: int, inside: str = "") -> str:
    """Return a chain of bodies with something in the last."""
    body = '<body><joint axis="0 1 0"/><geom size="0.1"/>'
    return world(body * count + inside + "</body>" * count)


def self_attached(times: int) -> str:
    """Return bodies each of which holds the one before twice."""
    pairs = "".join(
        f'<body name="b{k + 1}"><attach body="b{k}" prefix="x{k}"/>'
        f'<attach body="b{k}" prefix="y{k}"/></body>'
        for k in range(times)
    )
    return WORLD.replace('name="b"', 'name="b0"').replace("</worldbody>", f"{pairs}</worldbody>")


def replicas(count: int, inside: str) -> str:
    return f'<replicate count="{count}">{inside}</replicate>'


def mesh_link(file: str) -> str:
    """Return a link of a URDF that is weighed by its mesh."""
    shape = f'<geometry><mesh filename="{file}"/></geometry>'
    asked = '<mujoco><compiler inertiafromgeom="true"/></mujoco>'
    return f'<link name="x"><collision>{shape}</collision></link>{asked}'


BALL = '<geom size="1"/>'
CLASS = '<default class="c"/>'
TEXTURE = '<texture type="2d" builtin="flat" width="9999" height="9999"/>'
TERRAIN = '<hfield nrow="9999" ncol="9999" size="1 1 1 1"/>'
ENTITIES = "".join(f'<!ENTITY e{k} "{f"&e{k - 1};" * 10}">' for k in range(1, 12))
MODELS = (
    '<mujoco model="m{0}"><asset><model name="a" file="c{1}.xml"/><model name="b" file="c{1}.xml"/>'
    '</asset><worldbody><attach model="a" prefix="a{0}"/><attach model="b" prefix="b{0}"/>'
    "</worldbody></mujoco>"
)

# Name, files (the first is the robot), what the message says.
REFUSED: dict[str, tuple[Files, str]] = {
    "includes itself": (mjcf('<include file="robot.xml"/>'), "includes itself"),
    "includes itself by a detour": (mjcf('<include file="./robot.xml"/>'), "includes itself"),
    "includes itself in capitals": (mjcf('<INCLUDE file="robot.xml"/>'), "includes itself"),
    "two include each other": (
        {
            **mjcf('<include file="a/part.xml"/>'),
            "a/part.xml": '<mujoco><include file="back.xml"/></mujoco>',
            "a/back.xml": '<mujoco><include file="part.xml"/></mujoco>',
        },
        "part.xml includes itself",
    ),
    "a chain of thousands": (
        chain(3000, lambda k: f'<mujoco><include file="c{k + 1}.xml"/></mujoco>', PLAIN),
        "include one another in a chain",
    ),
    "each includes two": (
        chain(
            19,
            lambda k: "<mujoco>" + f'<include file="c{k + 1}.xml"/>' * 2 + "</mujoco>",
            "<mujoco><option/></mujoco>",
        ),
        "made of more than 500 files",
    ),
    "includes elements again and again": (
        {**mjcf('<include file="many.xml"/>' * 9), "many.xml": f"<x>{'<option/>' * 5000}</x>"},
        "more than 20000 elements",
    ),
    "includes much again and again": (
        {
            **mjcf('<include file="big.xml"/>' * 4),
            "big.xml": "<mujoco><option/><custom><text data='{}'/></custom></mujoco>".format(
                "x" * 5_000_000
            ),
        },
        "larger than 16 MB",
    ),
    "bad file in a subfolder": (
        {
            **mjcf('<include file="a/one.xml"/>'),
            "a/one.xml": '<mujoco><include file="b/two.xml"/></mujoco>',
            "a/b/two.xml": "<!DOCTYPE x []><mujoco><option/></mujoco>",
        },
        "two.xml: line 1: a document type",
    ),
    "includes what is not there": (mjcf('<include file="gone.xml"/>'), "'gone.xml', which is not"),
    "includes nothing": (mjcf("<include/>"), "must name a file"),
    "includes with content": (mjcf('<include file="x.xml"><option/></include>'), "hold nothing"),
    "includes an empty file": (
        {**mjcf('<include file="a.xml"/>'), "a.xml": "<mujoco/>"},
        "has nothing in it",
    ),
    "includes a secret": (
        mjcf('<include file="../../../../../../../../etc/passwd"/>'),
        "robot.xml",
    ),
    "joins itself": (mjcf('<asset><model name="m" file="robot.xml"/></asset>'), "includes itself"),
    "each joins two": (
        chain(19, lambda k: MODELS.format(k, k + 1), PLAIN),
        "made of more than 500 files",
    ),
    "joins what is no model": (
        {**mjcf('<asset><model name="m" file="a.urdf"/></asset>'), "a.urdf": "<robot name='r'/>"},
        "no MJCF file",
    ),
    "replica of thousands in an included file": (
        {
            **mjcf("", world(replicas(999, '<include file="a.xml"/>'))),
            "a.xml": f"<mujoco>{replicas(99, BALL)}</mujoco>",
        },
        "Lower the count of <replicate>",
    ),
    "replicas of replicas": (
        mjcf("", world(replicas(60, replicas(60, replicas(60, BALL))))),
        "Lower the count of <replicate>",
    ),
    "composite": (mjcf("", world('<composite type="cable" count="9999 9 1"/>')), "<composite>"),
    "entities": (
        {"robot.xml": f'<!DOCTYPE r [<!ENTITY e0 "ha">{ENTITIES}]><mujoco model="&e11;"/>'},
        "entity declaration",
    ),
    "outer entity": (
        {"robot.xml": f'<!DOCTYPE r SYSTEM "file:///etc/passwd">{PLAIN}'},
        "document type",
    ),
    "elements": (mjcf("", world("<site/>" * 30_000)), "20000 elements"),
    "deep": (mjcf("", bodies(5000)), "more than 400 elements inside"),
    "corners that are no numbers": (
        mjcf("<asset><mesh name='m' vertex='{}'/></asset>".format("nan " * 300_000)),
        "not a finite number",
    ),
    "mesh that is not there": (
        mjcf('<asset><mesh file="gone.stl"/></asset>', WORLD.replace('size="0.1"', 'mesh="gone"')),
        "'gone.stl'",
    ),
    "mesh without end": (mjcf('<asset><mesh file="/dev/zero"/></asset>'), "/dev/zero"),
    "capitals": ({"robot.xml": "<MUJOCO/>"}, "begins with <MUJOCO>"),
    "bytes": ({"robot.xml": "\x01\x02\x03" * 1000}, "not well-formed XML"),
    "zeros": ({"robot.xml": "\0" * 1000}, "not a text file"),
    "urdf: is attached to itself": (urdf(2, [(1, 1)]), "'l1' is attached to itself"),
    "urdf: a circle": (urdf(4, [(0, 1), (2, 3), (3, 2)]), "is attached to itself"),
    "urdf: two parents": (urdf(3, [(0, 2), (1, 2)]), "the second that moves link 'l2'"),
    "urdf: no such link": (urdf(2, [(0, 7)]), "no link of that name"),
    "urdf: long chain": (
        urdf(1200, [(k, k + 1) for k in range(1199)]),
        "more than 1000 joints",
    ),
    "urdf: macros": (urdf(1, [], '<xacro:include filename="/dev/zero"/>'), "macro of xacro"),
    "urdf: mesh that is not there": (
        urdf(1, [], mesh_link("package://a/b.stl")),
        "no <inertial>",
    ),
    "urdf: path of thousands": (
        urdf(1, [], mesh_link("a/" * 100_000)),
        "is not where the file says",
    ),
}


def write(files: Files, folder: Path) -> Path:
    """Write files and return the path of the first."""
    for name, text in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    return folder / next(iter(files))


@pytest.fixture
def bounded() -> Iterator[None]:
    """Fail a test that calls more than `MOST_CALLS` Python functions."""
    left = MOST_CALLS

    def count(_frame: FrameType, event: str, _argument: object) -> None:
        nonlocal left
        left -= event in ("call", "c_call")
        assert left > 0, "too much work"

    sys.setprofile(count)
    yield
    sys.setprofile(None)


@pytest.fixture
def unasked(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fail a test that lets MuJoCo's parser see a file."""

    def parser(*_: object, **__: object) -> None:
        raise AssertionError("the parser was asked")

    monkeypatch.setattr(mujoco.MjModel, "from_xml_string", parser)
    monkeypatch.setattr(mujoco.MjModel, "from_xml_path", parser)
    monkeypatch.setattr(mujoco.MjSpec, "from_string", parser)
    monkeypatch.setattr(mujoco.MjSpec, "from_file", parser)


@pytest.mark.usefixtures("unasked", "bounded")
@pytest.mark.parametrize("case", REFUSED)
def test_what_would_hurt_is_refused_before_it_is_parsed(case: str, tmp_path: Path) -> None:
    files, words = REFUSED[case]
    path = write(files, tmp_path)
    with pytest.raises(RobotError) as caught:
        planar_robot(path, Options())
    message = str(caught.value)
    assert words in message
    assert str(path) in message
    assert len(message) < 1000


@pytest.mark.usefixtures("unasked", "bounded")
@pytest.mark.parametrize("ending", [".xml", ".urdf"])
def test_a_gigantic_file_is_not_read(ending: str, tmp_path: Path) -> None:
    path = tmp_path / f"robot{ending}"
    with path.open("wb") as file:
        file.truncate(2**36)  # sparse: takes no place on the disk
    with pytest.raises(RobotError, match="larger than 16 MB"):
        planar_robot(path, Options())


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="pipes with names are a matter of POSIX")
@pytest.mark.usefixtures("unasked", "bounded")
@pytest.mark.parametrize(
    "text",
    [
        None,
        mjcf('<include file="pipe.xml"/>')["robot.xml"],
        mjcf('<include file="../folder/pipe.xml"/>')["robot.xml"],
        mjcf('<asset><mesh name="m" file="pipe.xml" content_type="model/stl"/></asset>')[
            "robot.xml"
        ],
        mjcf('<asset><model name="m" file="pipe.xml"/></asset>')["robot.xml"],
        mjcf('<include file="loop.xml"/>')["robot.xml"],
        mjcf('<include file="circle/circle/circle/robot.xml"/>')["robot.xml"],
        mjcf('<include file="circle"/>')["robot.xml"],
        mjcf('<include file="/proc/self/mem"/>')["robot.xml"],
    ],
)
def test_pipes_and_links_in_circles_do_not_hold_it_up(text: str | None, tmp_path: Path) -> None:
    folder = tmp_path / "folder"
    folder.mkdir()
    os.mkfifo(folder / "pipe.xml")
    (folder / "loop.xml").symlink_to("loop.xml")
    (folder / "circle").symlink_to(".")
    path = folder / ("pipe.xml" if text is None else "robot.xml")
    if text is not None:
        path.write_text(text)
    with pytest.raises(RobotError, match="folder"):
        planar_robot(path, Options())


HARMLESS = {
    "textures": '<asset><texture name="t" type="2d" file="/dev/zero"/>'
    + '<texture type="2d" builtin="flat" width="100" height="100"/>' * 400
    + '<material name="m" texture="t"/></asset>',
    "memory": '<size memory="60G" njmax="2000000000" nkey="10000" nuser_geom="10000"/>',
    "keyframes": f"<keyframe>{'<key/>' * 100}</keyframe>",
    "sensors": '<sensor><user name="u" dim="2000000000"/></sensor>',
    "numbers": "<custom><numeric name='n' size='10000'/><text name='t' data='x'/></custom>",
    "flexible": '<deformable><flex name="f" body="b" vertex="x" dim="2000000000"/></deformable>',
    "terrain": '<asset><hfield name="h" nrow="8000" ncol="8000" size="1 1 1 1"/></asset>',
    "muscle ranges": '<compiler><lengthrange mode="all" inttotal="1e300"/></compiler>'
    '<tendon><fixed name="f"><joint joint="j" coef="1"/></fixed></tendon>',
    "user data": "<custom/><tendon><fixed name='f' user='{}'>".format("1 " * 500_000)
    + '<joint joint="j" coef="1"/></fixed></tendon>',
}


def seen(path: Path) -> mujoco.MjModel:
    """Return what MuJoCo made of a file for heelstrike."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RobotWarning)
        return parse(path).model


def same_motion(one: mujoco.MjModel, other: mujoco.MjModel) -> bool:
    """Whether bodies, joints, geoms, meshes and actuators are equal, to the last bit."""
    kinds = ("body_", "jnt_", "dof_", "geom_", "qpos", "mesh_vert", "actuator_", "pair_", "eq_")
    apart = ("bvhadr", "bvhnum", "matid", "user", "pathadr")
    names = [n for n in dir(one) if n.startswith(kinds) and not n.endswith(apart)]
    assert len(names) > 60
    return all(np.array_equal(getattr(one, name), getattr(other, name)) for name in names)


@pytest.mark.parametrize("case", HARMLESS)
def test_what_plays_no_part_in_motion_costs_nothing(
    case: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = write(mjcf(HARMLESS[case]), tmp_path)
    sizes = []
    ask = mujoco.MjSpec.from_string

    def asked(text: str, **files: object) -> mujoco.MjSpec:
        sizes.append(len(text))
        return ask(text, **files)

    monkeypatch.setattr(mujoco.MjSpec, "from_string", asked)
    model = seen(path)
    assert max(sizes) < 2000
    assert model.narena < 2**26
    assert model.nbuffer < 2**20
    assert same_motion(model, seen(write({"plain.xml": PLAIN}, tmp_path)))


def test_muscles_are_not_simulated_to_be_refused(tmp_path: Path) -> None:
    compiler = '<compiler><lengthrange mode="all" inttotal="1e9"/></compiler>'
    path = write(mjcf(f'{compiler}<actuator><muscle joint="j"/></actuator>'), tmp_path)
    with pytest.raises(RobotError, match="is a muscle"):
        load_robot(path)


def test_flexible_bodies_are_left_out_with_a_warning(tmp_path: Path) -> None:
    with pytest.warns(RobotWarning, match="flexible bodies"):
        load_robot(write(mjcf(HARMLESS["flexible"]), tmp_path))


NESTED: Files = {
    "robot.xml": """<mujoco model="m"><compiler angle="radian" meshdir="meshes"/>
<include file="sub/assets.xml"/><worldbody><include file="sub/body.xml"/></worldbody>
</mujoco>""",
    "sub/assets.xml": '<mujocoinclude><asset><mesh file="part.obj"/></asset><default>'
    '<default class="k"><joint damping="0.3"/></default></default>'
    '<include file="deep/more.xml"/></mujocoinclude>',
    # Sought from the folder for meshes, not from this one.
    "sub/deep/more.xml": '<x><asset><mesh name="o" file="../sub/deep/part.obj"/></asset>'
    '<option gravity="0 0 -5"/></x>',
    "sub/body.xml": '<x><body childclass="k" pos="0 0 1"><joint name="j" axis="0 1 0"/>'
    '<geom type="mesh" mesh="part"/><include file="sub/leg.xml"/></body></x>',
    "sub/leg.xml": '<x><body pos="0.1 0 -1"><joint name="k" axis="0 1 0"/>'
    '<geom type="mesh" mesh="o"/></body></x>',
    "meshes/part.obj": "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n",
    "sub/deep/part.obj": "v 0 0 0\nv 2 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n",
}


@pytest.mark.parametrize("place", [".", "sub", "/"])
def test_includes_in_subfolders_are_what_they_are_to_mujoco(
    place: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = write(NESTED, tmp_path)
    theirs = mujoco.MjModel.from_xml_path(str(path))
    assert theirs.njnt == 2
    assert theirs.nmesh == 2
    monkeypatch.chdir(tmp_path / place)
    assert same_motion(seen(path), theirs)
    assert same_motion(seen(Path(os.path.relpath(path))), theirs)


def test_joined_models_are_what_they_are_to_mujoco(tmp_path: Path) -> None:
    files = mjcf(
        '<asset><model name="leg" file="parts/leg.xml"/></asset>',
        '<worldbody><body name="trunk"><joint axis="1 0 0" type="slide"/><geom size="0.1"/>'
        '<attach model="leg" body="thigh" prefix="left_"/>'
        '<frame pos="0.1 0 0"><attach model="leg" body="thigh" prefix="right_"/></frame>'
        "</body></worldbody>",
    )
    files["parts/leg.xml"] = (
        '<mujoco><worldbody><body name="thigh" pos="0 0 -0.2"><joint name="hip" axis="0 1 0"/>'
        '<geom type="box" size="0.1 0.1 0.3"/></body></worldbody>'
        '<actuator><motor name="hip" joint="hip" gear="7"/></actuator></mujoco>'
    )
    path = write(files, tmp_path)
    theirs = mujoco.MjModel.from_xml_path(str(path))
    assert theirs.nu == 2
    assert same_motion(seen(path), theirs)


@pytest.mark.parametrize("name", builtin_robots())
def test_our_own_files_are_read_here(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    robot = load_robot(name)
    monkeypatch.setenv("HEELSTRIKE_KEEP_ROBOTS", "0")

    def start(*_: object, **__: object) -> bytes:
        raise AssertionError("a process was asked")

    monkeypatch.setattr(READER, "ask", start)
    assert robot_entries(load_robot(name)) == robot_entries(robot)
    with pytest.raises(AssertionError, match="was asked"):
        load_robot(robot.save(tmp_path / "robot.xml"))


def test_a_line_of_the_parser_is_a_line_of_the_file(tmp_path: Path) -> None:
    """Also where parts of the file were taken out, or brought in, before it."""
    lines = [
        "<mujoco>",
        "<asset>",
        "  <texture",
        '     type="2d" builtin="flat" width="9" height="9"/></asset>',
        '<include file="part.xml"/>',
        "<!-- a",
        "comment -->",
        "<worldbody>",
        "  <body>",
        '    <joint axis="0 1 0"',
        '      range="1"/><geom size="1"/></body></worldbody></mujoco>',
    ]
    part = "<x>\n\n\n<option/>\n\n\n</x>"
    path = write({"robot.xml": "\n".join(lines), "part.xml": part}, tmp_path)
    with pytest.raises(RobotError, match=r"'range' does not have enough data.*line 10\b"):
        load_robot(path)


# What crashes the parser


ENDLESS = '<mujoco model="m"><asset><model name="m" file="model0.xml"/></asset></mujoco>'


HEAVY: dict[str, Files] = {
    # What the parser multiplies out until there is no memory, or no stack, left.
    "attaches its own bodies": mjcf("", self_attached(40)),
    "activations": mjcf(
        '<actuator><general joint="j" dyntype="user" actdim="2000000000"/></actuator>'
    ),
}


@pytest.fixture
def little_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let a file have 256 MiB."""
    ask = READER.ask
    monkeypatch.setattr(READER, "ask", partial(ask, memory=2**28))


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="memory is bounded on Linux only")
@pytest.mark.usefixtures("little_memory")
@pytest.mark.parametrize("case", HEAVY)
def test_what_fills_the_memory_is_an_error_in_words(case: str, tmp_path: Path) -> None:
    path = write(HEAVY[case], tmp_path)
    with pytest.raises(
        RobotError, match=r"more than 0\.25 GiB of memory.*lower the count"
    ) as caught:
        load_robot(path)
    assert str(path) in str(caught.value)
    assert load_robot(write({"plain.xml": PLAIN}, tmp_path)).nv == 1  # and the next file is read


def test_a_crash_of_the_parser_is_an_error_in_words(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(reading, "_JOB", _job(tmp_path, "import os; os.abort()"))
    with pytest.raises(RobotError, match=r"robot\.xml: the parser crashes on this file.*or leave"):
        load_robot(write(mjcf(""), tmp_path))


def test_a_parser_that_does_not_end_is_stopped(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(reading, "_JOB", _job(tmp_path, "import time; time.sleep(3600)"))
    monkeypatch.setattr(reading, "LONGEST", 2.0)
    with pytest.raises(RobotError, match=r"robot\.xml: the parser has not finished.* after 2 s"):
        load_robot(write(mjcf(""), tmp_path))


def _job(folder: Path, program: str) -> str:
    """Return a reader that does something else."""
    path = folder / "reader.py"
    path.write_text(f"def answer(order):\n    {program}\n")
    return f"{path}:answer"


@pytest.mark.parametrize("case", ["plain", "include", "links"])
def test_what_was_read_is_kept_until_a_file_changes(
    case: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A file that is read, one that is included, and one that was sought and was not there."""
    files = {
        "plain": mjcf(""),
        "include": {**mjcf('<include file="part.xml"/>'), "part.xml": "<x><option/></x>"},
        "links": urdf(2, [(0, 1)]),
    }[case]
    path = write(files, tmp_path)
    asked = []
    ask = READER.ask

    def counted(*order: Any, **how: Any) -> bytes:
        asked.append(order)
        return ask(*order, **how)

    monkeypatch.setattr(READER, "ask", counted)
    with warnings.catch_warnings(record=True) as first:
        warnings.simplefilter("always")
        one = load_robot(path, floating=case == "links")
    with warnings.catch_warnings(record=True) as second:
        warnings.simplefilter("always")
        other = load_robot(path, floating=case == "links")
    assert len(asked) == 1
    assert list(map(str, map(_message, first))) == list(map(str, map(_message, second)))
    assert robot_entries(one) == robot_entries(other)
    changed = tmp_path / list(files)[-1]
    changed.write_text(changed.read_text() + "\n")
    load_robot(path, floating=case == "links")
    assert len(asked) == 2


def _message(one: warnings.WarningMessage) -> str:
    return str(one.message)


def test_a_mesh_that_came_later_is_read(tmp_path: Path) -> None:
    """What was sought and not found counts, too."""
    shape = '<geometry><mesh filename="foot.obj"/></geometry>'
    link = f'<link name="x">{INERTIAL}<collision>{shape}</collision></link>'
    joint = (
        '<joint name="k" type="continuous"><parent link="l0"/><child link="x"/>'
        '<axis xyz="0 1 0"/></joint>'
    )
    path = write(urdf(1, [], link + joint), tmp_path)
    with pytest.warns(RobotWarning, match="are not where the file says"):
        assert load_robot(path, floating=True).nc == 0
    (tmp_path / "foot.obj").write_text(NESTED["meshes/part.obj"])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RobotWarning)
        assert load_robot(path, floating=True).nc > 0


def test_a_damaged_answer_is_asked_for_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HEELSTRIKE_KEEP_ROBOTS", str(tmp_path / "kept"))
    path = write(mjcf(""), tmp_path)
    robot = load_robot(path)
    (kept,) = (tmp_path / "kept").iterdir()
    kept.write_bytes(kept.read_bytes().replace(b'"mass"', b'"moss"'))
    assert robot_entries(load_robot(path)) == robot_entries(robot)


# Much, but not too much: the work grows no faster than the file.


def many(**numbers: int) -> Files:
    """Return a robot of one link with many geoms, and much ground."""
    moving = "".join(
        f'<geom size="0.1" pos="{1e-3 * k:g} 0 0"/>' for k in range(numbers.get("moving", 1))
    )
    ground = '<geom size="0.1" contype="2" conaffinity="2"/>' * numbers.get("ground", 0)
    world = WORLD.replace('<geom name="g" size="0.1"/>', moving)
    return mjcf("", world.replace("<worldbody>", f"<worldbody>{ground}"))


@pytest.mark.usefixtures("bounded")
def test_geoms_that_never_touch_the_ground_are_not_compared_one_by_one(tmp_path: Path) -> None:
    with pytest.warns(RobotWarning, match="fixed geoms"):
        robot = planar_robot(write(many(moving=3000, ground=3000), tmp_path), Options())
    assert robot.nc == 0


@pytest.mark.usefixtures("bounded")
def test_contact_points_are_not_compared_one_by_one(tmp_path: Path) -> None:
    with pytest.raises(RobotError, match="5000 contact points, and heelstrike takes up to 2000"):
        planar_robot(write(many(moving=5000), tmp_path), Options())


# On the command line


@pytest.mark.parametrize(
    ("command", "case"),
    [
        ("inspect", "includes itself"),
        ("inspect", "joins itself"),
        ("inspect", "urdf: a circle"),
        ("walk", "entities"),
        ("walk", "replicas of replicas"),
    ],
)
def test_the_command_line_refuses_in_words(command: str, case: str, tmp_path: Path) -> None:
    files, words = REFUSED[case]
    path = write(files, tmp_path)
    result = CliRunner().invoke(app, [command, str(path)])
    assert result.exit_code == 2
    assert words in result.output.replace("\n", " ")
    assert "Traceback" not in result.output
