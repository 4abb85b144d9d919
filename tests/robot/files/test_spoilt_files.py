"""500 spoilt files: each is refused in words, or its robot is what the file says, or it warns.

Half are MJCF, half URDF, made from the built-in robots by slips of the hand, bad copies and
malice. A robot that comes back without a word must be the unspoilt one, or equal what an
independent reading of the spoilt file says (`robot_file_truth`): numbers may be changed, and then
the robot shows it.
"""

from __future__ import annotations

import os
import random
import re
import warnings
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import numpy as np
import pytest
from robot_file_truth import differences

from heelstrike.errors import RobotError
from heelstrike.robot import Robot, RobotWarning, builtin_robots, inspect_robot, load_robot
from heelstrike.robot.library import NO_CONTACTS, NO_MOTORS

LONGEST = 5.0  # seconds of processor time
EACH = 28  # files of each robot and format: 10 * 2 * 28 = 560

NUMBERS = ("nan", "inf", "-inf", "-1", "0", "1e308", "1e400", "-0", "", "abc", "9" * 400)
MORE_NUMBERS = ("1,5", "1_0", "0x10", "1e-320", "1 2 3 4 5 6 7", "٣", "1.5.2", "--1", "1e", "+2")
PATHS = ("../../../../etc/passwd", "/dev/zero", "/dev/stdin", "http://x/y", "\\\\x\\y", "x" * 5000)

Draw = random.Random
Spoil = Callable[[str, Draw], str]


def _tree(text: str) -> Element:
    return ElementTree.fromstring(text)


def _text(root: Element) -> str:
    return ElementTree.tostring(root, encoding="unicode")


def _attributes(root: Element) -> list[tuple[Element, str]]:
    return [(element, name) for element in root.iter() for name in element.attrib]


def _parents(root: Element) -> list[tuple[Element, Element]]:
    return [(parent, child) for parent in root.iter() for child in parent]


def _is_number(text: str) -> bool:
    return bool(re.fullmatch(r"[-+.\deE ]+", text))


# Slips of the hand: what comes of them is checked.


def change_number(text: str, draw: Draw) -> str:
    root = _tree(text)
    numeric = [(e, name) for e, name in _attributes(root) if _is_number(e.attrib[name])]
    element, name = draw.choice(numeric)
    words = element.attrib[name].split()
    words[draw.randrange(len(words))] = draw.choice((*NUMBERS, *MORE_NUMBERS))
    element.set(name, " ".join(words))
    return _text(root)


def scale_number(text: str, draw: Draw) -> str:
    root = _tree(text)
    numeric = [(e, name) for e, name in _attributes(root) if _is_number(e.attrib[name])]
    element, name = draw.choice(numeric)
    factor = draw.choice((1000.0, 0.001, -1.0, 57.3, 1.01))
    element.set(name, " ".join(repr(factor * float(word)) for word in element.attrib[name].split()))
    return _text(root)


def lose_attribute(text: str, draw: Draw) -> str:
    root = _tree(text)
    element, name = draw.choice(_attributes(root))
    del element.attrib[name]
    return _text(root)


def misspell_attribute(text: str, draw: Draw) -> str:
    root = _tree(text)
    element, name = draw.choice(_attributes(root))
    element.set(_misspelt(name, draw), element.attrib.pop(name))
    return _text(root)


def misspell_tag(text: str, draw: Draw) -> str:
    root = _tree(text)
    element = draw.choice(list(root.iter()))
    element.tag = _misspelt(element.tag, draw)
    return _text(root)


def _misspelt(word: str, draw: Draw) -> str:
    place = draw.randrange(len(word))
    return draw.choice((word[:place] + word[place + 1 :], word + "s", word.upper())) or "x"


def lose_element(text: str, draw: Draw) -> str:
    root = _tree(text)
    parent, child = draw.choice(_parents(root))
    parent.remove(child)
    return _text(root)


def repeat_element(text: str, draw: Draw) -> str:
    root = _tree(text)
    parent, child = draw.choice(_parents(root))
    parent.insert(draw.randrange(len(parent) + 1), child)
    return _text(root)


def move_element(text: str, draw: Draw) -> str:
    root = _tree(text)
    parent, child = draw.choice(_parents(root))
    parent.remove(child)
    draw.choice(list(root.iter())).append(child)
    return _text(root)


def swap_values(text: str, draw: Draw) -> str:
    root = _tree(text)
    (one, a), (other, b) = draw.choice(_attributes(root)), draw.choice(_attributes(root))
    one.attrib[a], other.attrib[b] = other.attrib[b], one.attrib[a]
    return _text(root)


def lose_line(text: str, draw: Draw) -> str:
    lines = text.split("\n")
    del lines[draw.randrange(len(lines))]
    return "\n".join(lines)


def insert_letters(text: str, draw: Draw) -> str:
    place = draw.randrange(len(text))
    return (
        text[:place] + draw.choice(('"', "<", ">", "/", "&", "é", "0", " ", "]]>")) + text[place:]
    )


HAND: tuple[Spoil, ...] = (
    *(change_number, change_number, scale_number, lose_attribute, misspell_attribute),
    *(misspell_tag, lose_element, repeat_element, move_element, swap_values),
    *(lose_line, insert_letters),
)


# What must be refused, whatever else.


def truncate(text: str, draw: Draw) -> str:
    return text[: draw.randrange(text.rindex("</"))]


def negative_mass(text: str, draw: Draw) -> str:
    masses = list(re.finditer(r'(?<=mass=")|(?<=<mass value=")', text))
    place = draw.choice(masses).start()
    return f"{text[:place]}-{text[place:]}"


def not_a_number(text: str, draw: Draw) -> str:
    what = r'(?:<mass value|<inertia [^>]*iyy|mass|diaginertia|damping|range|upper|axis|xyz)="'
    place = draw.choice(list(re.finditer(what, text))).end()
    end = re.compile(r'[ "]').search(text, place)
    assert end is not None
    return text[:place] + draw.choice(("nan", "NaN", "-nan")) + text[end.start() :]


def name_twice(text: str, draw: Draw) -> str:
    root = _tree(text)
    kind = draw.choice(("link", "joint") if root.tag == "robot" else ("body", "joint"))
    named = [element for element in root.iter(kind) if "name" in element.attrib]
    if len(named) < 2:
        named = [element for element in root.iter("joint") if "name" in element.attrib]
    one, other = draw.sample(named, 2)
    one.set("name", other.attrib["name"])
    return _text(root)


def cycle(text: str, draw: Draw) -> str:
    if "<mujoco" in text and "<robot" not in text:
        return text.replace("<worldbody", '<include file="spoilt.xml"/><worldbody')
    root = _tree(text)
    joints = list(root.iterfind("joint"))
    joint = draw.choice(joints)
    below = joint.find("child")
    above = joint.find("parent")
    assert above is not None
    assert below is not None
    above.set("link", below.attrib["link"])
    return _text(root)


def entity(text: str, draw: Draw) -> str:
    body = draw.choice(('SYSTEM "file:///etc/passwd"', '"&b;&b;&b;&b;"'))
    return f"<!DOCTYPE r [<!ENTITY b 'x'><!ENTITY a {body}>]>" + text.replace(
        'name="', 'name="&a;', 1
    )


def deep(text: str, draw: Draw) -> str:
    number = draw.choice((401, 5000, 100_000))
    tag = draw.choice(("body", "link", "frame"))
    end = text.rindex("</")
    return f"{text[:end]}{f'<{tag}>' * number}{f'</{tag}>' * number}{text[end:]}"


def huge(text: str, draw: Draw) -> str:
    root = "robot" if "<robot" in text else "mujoco"
    end = text.rindex("</")
    more = {
        "mujoco": (
            '<size nuserdata="1000000000"/>',
            '<asset><hfield name="h" nrow="99999" ncol="99999" size="1 1 1 1"/></asset>',
            '<worldbody><replicate count="99999"><geom size="1"/></replicate></worldbody>',
            "<worldbody>" + '<body><joint/><geom size="1"/></body>' * 20_000 + "</worldbody>",
        ),
        "robot": (
            '<link name="l"/>' * 40_000,
            '<mujoco><size nuser_body="100000000"/></mujoco>',
            " " * 2**24,
        ),
    }
    return text[:end] + draw.choice(more[root]) + text[end:]


def hostile_path(text: str, draw: Draw) -> str:
    path = draw.choice(PATHS)
    if "<robot" in text:
        mesh = f'<collision><geometry><mesh filename="{path}"/></geometry></collision>'
        return text.replace("</link>", mesh + "</link>", 1) if "</link>" in text else text
    tag = draw.choice(("include", "model", "mesh", "texture"))
    if tag == "include":
        return text.replace("<worldbody", f'<include file="{path}"/><worldbody', 1)
    more = ' type="2d"' if tag == "texture" else ""
    asset = f'<asset><{tag} name="t" file="{path}"{more}/></asset>'
    return text.replace("<worldbody", f"{asset}<worldbody", 1)


MALICE: tuple[Spoil, ...] = (
    *(truncate, truncate, negative_mass, not_a_number, name_twice, cycle, entity, deep, huge),
    hostile_path,
)


# Whole files in other units: no place contradicts another, but they must not pass unnoticed.


def millimetres(text: str, draw: Draw) -> str:
    return _scaled(text, {"xyz": 1e3, "pos": 1e3, "fromto": 1e3, "size": 1e3, "radius": 1e3})


def grams(text: str, draw: Draw) -> str:
    return _scaled(text, {"mass": 1e3, "value": 1e3})


def square_millimetres(text: str, draw: Draw) -> str:
    moments = dict.fromkeys(("diaginertia", "ixx", "iyy", "izz"), 1e6)
    return _scaled(text, moments)


def degrees(text: str, draw: Draw) -> str:
    ranges = dict.fromkeys(("range", "lower", "upper"), 180.0 / np.pi)
    return _scaled(text, ranges)


UNITS: tuple[Spoil, ...] = (millimetres, grams, square_millimetres, degrees)


def _scaled(text: str, factors: dict[str, float]) -> str:
    root = _tree(text)
    for element, name in _attributes(root):
        if name in factors and element.tag != "axis":
            values = [factors[name] * float(word) for word in element.attrib[name].split()]
            element.set(name, " ".join(map(repr, values)))
    return _text(root)


def seconds_spent() -> float:
    """Computing time of this process and those it started: what others do is not in it."""
    return sum(os.times()[:4])


def outcome(path: Path) -> tuple[Robot | None, list[str], float]:
    """Robot if there is one, warnings, and the seconds of computing it took."""
    began = seconds_spent()
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            robot = load_robot(path)
        except RobotError:
            robot = None
    assert all(one.category is RobotWarning for one in caught), [str(one) for one in caught]
    said = [str(one.message) for one in caught]
    plain = (NO_MOTORS, NO_CONTACTS)  # true of sound robots too
    told = [words for words in said if not any(each in words for each in plain)]
    return robot, told, seconds_spent() - began


def same(robot: Robot, other: Robot) -> bool:
    """Whether two robots are one, in numbers and names."""
    names = ("joint_names", "link_names", "actuator_names", "contact_names", "contact_friction")
    return all(getattr(robot, name) == getattr(other, name) for name in names) and all(
        np.array_equal(values, getattr(other.model, field))
        for field, values in robot.model.members().items()
    )


@pytest.mark.parametrize("ending", [".xml", ".urdf"])
@pytest.mark.parametrize("name", builtin_robots())
def test_spoilt_files(name: str, ending: str, tmp_path: Path) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RobotWarning)  # URDF has no armature
        path = load_robot(name).save(tmp_path / f"sound{ending}")
    text = path.read_text(encoding="utf-8")
    sound, _, _ = outcome(path)
    assert sound is not None
    assert differences(sound, text) == []
    draw = random.Random(f"{name}{ending}")
    spoilt_path = tmp_path / f"spoilt{ending}"
    slips = [HAND[k % len(HAND)] for k in range(EACH - 6)] + draw.sample(MALICE, 6)
    refused = 0
    for number, slip in enumerate(slips):
        spoilt = slip(text, draw)
        spoilt_path.write_text(spoilt, encoding="utf-8", errors="surrogatepass")
        case = f"{name}{ending}, {number}: {slip.__name__}"
        robot, said, seconds = outcome(spoilt_path)
        assert seconds < LONGEST, case
        refused += robot is None
        if slip in MALICE:
            left_out = slip in (hostile_path, huge) and robot and (said or same(robot, sound))
            assert robot is None or left_out, case
        if robot is None:
            continue
        assert robot.total_mass > 0.0, case
        for field, values in robot.model.members().items():
            assert not np.any(np.isnan(values)), (case, field)
        if not said and not same(robot, sound):
            assert differences(robot, spoilt) == [], case
    assert 6 <= refused < EACH


def _without_root(text: str) -> str:
    """Fix the trunk to the world, for floating=True to free it."""
    root = _tree(text)
    for parent, child in _parents(root):
        if child.tag == "joint" and child.get("name", "").startswith("root_"):
            parent.remove(child)
    for link in root.findall("link"):
        if link.get("name") == "world" or link.get("name", "").endswith(("_root_x", "_root_z")):
            root.remove(link)
    return _text(root)


@pytest.mark.parametrize("ending", [".xml", ".urdf"])
@pytest.mark.parametrize("way", ["floating", "projected", "inspected"])
def test_spoilt_files_on_other_ways_in(way: str, ending: str, tmp_path: Path) -> None:
    """Files edited before they are compiled, or only looked at: words, never a traceback."""
    text = load_robot("bravo7").save(tmp_path / f"sound{ending}").read_text("utf-8")
    if way == "floating":
        text = _without_root(text)
    path = tmp_path / f"spoilt{ending}"
    options: dict[str, bool] = {} if way == "inspected" else {way: True}
    enter: Callable[..., object] = inspect_robot if way == "inspected" else load_robot
    path.write_text(text, encoding="utf-8")
    enter(path, **options)
    draw = random.Random(f"{way}{ending}")
    accepted = 0
    for slip in (*HAND, *HAND, *MALICE):
        path.write_text(slip(text, draw), encoding="utf-8", errors="surrogatepass")
        began = seconds_spent()
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            warnings.simplefilter("ignore", RobotWarning)
            try:
                enter(path, **options)
            except RobotError:
                continue
            finally:
                assert seconds_spent() - began < LONGEST, slip.__name__
        accepted += 1
    assert accepted > 0


def test_a_file_without_a_robot_is_refused_on_all_ways(tmp_path: Path) -> None:
    path = tmp_path / "robot.xml"
    path.write_text("<mujoco/>")
    for options in ({}, {"projected": True}, {"floating": True}):
        with pytest.raises(RobotError, match=r"robot\.xml"):
            load_robot(path, **options)


@pytest.mark.parametrize("spoil", UNITS, ids=lambda spoil: spoil.__name__)
@pytest.mark.parametrize("ending", [".xml", ".urdf"])
@pytest.mark.parametrize("name", ["bravo7", "spring_flamingo", "walker2d"])
def test_other_units_do_not_pass_unnoticed(
    name: str, ending: str, spoil: Spoil, tmp_path: Path
) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RobotWarning)
        path = load_robot(name).save(tmp_path / f"robot{ending}")
    path.write_text(spoil(path.read_text("utf-8"), random.Random(0)), encoding="utf-8")
    robot, said, _ = outcome(path)
    assert robot is not None
    assert any("unlikely" in words for words in said), said
