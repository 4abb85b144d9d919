"""SDF and xacro files spoilt at random: is one a wrong robot in silence, a traceback, a wait.

    python benchmarks/sdf_fuzzing.py [--files 500] [--seed 1]

The built-in robots as SDF, and some of several frames and joints, are changed in one to three
places: numbers replaced, elements lost, repeated, misspelt, moved to another parent. A file that
loads without a warning about the change is judged by Drake's reading of the same file: mass matrix
and bias force. Every tenth file is xacro; what it expands to is judged by Pinocchio.

Ends with 1 if a robot is not Drake's and nobody said so, if anything but a RobotError is raised, or
if a file takes more than `LONGEST` seconds of processor time. Needs `pip install drake pin xacro`.
"""

from __future__ import annotations

import argparse
import logging
import os
import random
import sys
import tempfile
import warnings
from collections import Counter
from copy import deepcopy
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import numpy as np
from corpus.__main__ import difference
from corpus.peers import ROOT, Drake, Refused, peer_of

from heelstrike.errors import RobotError
from heelstrike.robot import Robot, builtin_robots, load_robot
from heelstrike.robot.files.ros.xacro import expanded

LONGEST = 2.0
TOLERANCE = 1e-9
DRAKE = "{drake.mit.edu}"

NUMBERS = (
    *("nan", "inf", "-inf", "-1", "0", "1", "1e308", "1e-308", "", "abc", "9" * 400, "1_0", "0x10"),
    *("0.5", "-0.25", "1e10", "1e16", "1 2 3", "0 0 0", "0 1 0", "1,5", "true", "world", "trunk"),
    *("0.1 0.2 0.3 0 0 0", "0 0 0 0 0.4 0", "0 0 0 0.3 0 0", "½", "1e-3"),
)
WORDS = ("revolute", "continuous", "prismatic", "fixed", "ball", "universal", "screw", "hinge", "")

RICH = """<sdf version="1.7"><model name="rich"><pose>0 0 0.1 0 0 0</pose>
  <link name="base"><pose>0 0 1 0 0 0</pose><inertial><mass>4</mass><inertia><ixx>0.2</ixx>
    <iyy>0.3</iyy><izz>0.25</izz></inertia></inertial></link>
  <joint name="rail" type="prismatic"><parent>world</parent><child>base</child>
    <axis><xyz>1 0 0</xyz><limit><effort>5</effort></limit></axis></joint>
  <link name="arm"><pose relative_to="base">0.1 0 -0.2 0 0.3 0</pose><inertial>
    <pose>0 0 -0.1 0 0.2 0</pose><mass>1</mass><inertia><ixx>0.02</ixx><iyy>0.03</iyy>
    <izz>0.02</izz><ixz>0.001</ixz></inertia></inertial></link>
  <joint name="swing" type="revolute"><parent>base</parent><child>arm</child>
    <pose>0 0 0.05 0 0 0</pose><axis><xyz expressed_in="__model__">0 1 0</xyz><limit>
    <lower>-1</lower><upper>2</upper><effort>0</effort></limit><dynamics><damping>0.1</damping>
    <spring_stiffness>3</spring_stiffness></dynamics></axis></joint>
  <frame name="wrist" attached_to="arm"><pose>0 0 -0.3 0 0 0</pose></frame>
  <link name="hand"><pose relative_to="wrist">0 0 -0.1 0 0 0</pose><inertial><mass>0.5</mass>
    <inertia><ixx>0.01</ixx><iyy>0.01</iyy><izz>0.01</izz></inertia></inertial></link>
  <joint name="flap" type="continuous"><parent>wrist</parent><child>hand</child>
    <axis><xyz>0 -1 0</xyz><limit><effort>2</effort></limit></axis></joint>
</model></sdf>"""

MACROS = """<robot name="leg" xmlns:xacro="http://www.ros.org/wiki/xacro">
<xacro:arg name="mass" default="1.5"/><xacro:property name="length" value="${0.2 + 0.25}"/>
<xacro:macro name="limb" params="name mass above">
  <link name="${name}"><inertial><origin xyz="0 0 ${-length/2}"/><mass value="${mass}"/>
    <inertia ixx="${mass/10}" iyy="${mass/12}" izz="${mass/15}" ixy="0" ixz="0" iyz="0"/>
    </inertial></link>
  <joint name="${name}_joint" type="revolute"><parent link="${above}"/><child link="${name}"/>
    <origin xyz="0 0 ${-length}"/><axis xyz="0 1 0"/><dynamics damping="0.1"/>
    <limit lower="-1" upper="${pi/2}" effort="9" velocity="4"/></joint>
</xacro:macro>
<link name="world"/><xacro:limb name="thigh" mass="$(arg mass)" above="world"/>
<xacro:limb name="shin" mass="${1.2 * length}" above="thigh"/></robot>"""


def sources(folder: Path) -> list[str]:
    """Return the texts that are spoilt."""
    texts = [RICH]
    for name in builtin_robots():
        path = folder / f"{name}.sdf"
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            load_robot(name).save(path)
        texts.append(path.read_text(encoding="utf-8"))
    return texts


def spoilt(text: str, draw: random.Random) -> tuple[str, str]:
    """Return a text changed in some places, and what was done."""
    root = ElementTree.fromstring(text)
    done = []
    for _ in range(draw.choice((1, 1, 1, 2, 3))):
        parents = {child: parent for parent in root.iter() for child in parent}
        if not parents:
            break  # all is lost
        element = draw.choice(list(parents))
        parent = parents[element]
        kind = draw.choice(("text", "text", "text", "lost", "twice", "tag", "attribute", "moved"))
        if kind == "text":
            element = draw.choice([e for e in parents if not len(e)])
            if element.attrib and not (element.text or "").strip():
                name = draw.choice(list(element.attrib))
                element.set(name, _other(element.get(name, ""), draw))
                done.append(f"{name} of <{element.tag}>: {element.get(name)!r}")
                continue
            element.text = _other(element.text or "", draw)
        elif kind == "lost":
            parent.remove(element)
        elif kind == "twice":
            parent.append(deepcopy(element))
        elif kind == "tag":
            element.tag = element.tag[:-1] + draw.choice("aeiounst")
        elif kind == "attribute" and element.attrib:
            name = draw.choice(list(element.attrib))
            element.set(name, draw.choice((*WORDS, *element.attrib.values(), "x")))
        elif kind == "moved":
            other = draw.choice(list(root.iter()))
            if other is not element and element not in set(_above(other, parents)):
                parent.remove(element)
                other.append(element)
        done.append(f"{kind} of <{element.tag}>: {(element.text or '').strip()[:30]!r}")
    ElementTree.register_namespace("drake", "drake.mit.edu")
    ElementTree.register_namespace("xacro", "http://www.ros.org/wiki/xacro")
    return ElementTree.tostring(root, encoding="unicode"), "; ".join(done)


def _other(text: str, draw: random.Random) -> str:
    """Another text: one number of several, or all of it."""
    words = text.split()
    if len(words) > 1 and draw.random() < 0.6:
        words[draw.randrange(len(words))] = draw.choice(NUMBERS)
        return " ".join(words)
    return draw.choice(NUMBERS)


def _above(element: Element, parents: dict[Element, Element]) -> list[Element]:
    way = [element]
    while way[-1] in parents:
        way.append(parents[way[-1]])
    return way


def judged(robot: Robot, path: Path, text: str) -> str:
    """Return what Drake (of xacro, Pinocchio) says of a robot that loads."""
    forward, floating = np.array([1.0, 0.0, 0.0]), ROOT[0] in robot.joint_names
    try:
        if path.suffix == ".xacro":
            peer = peer_of(path, expanded(path, {}, (), str(path)), forward, floating)
        else:
            peer = Drake(path, text, "sdf", forward, floating)
        worst = difference(robot, peer)
    except Refused as refused:
        return f"Drake refuses: {' '.join(str(refused).split())[:110]}"
    except (RuntimeError, ValueError) as error:
        return f"Drake fails: {' '.join(str(error).split())[:110]}"
    return "equal" if worst <= TOLERANCE else f"DIFFERS by {worst:.2g}"


def main() -> int:
    """Spoil files and read them; return 1 if one is read wrongly in silence."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--files", type=int, default=500)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    logging.getLogger("drake").setLevel(logging.CRITICAL)
    counts: Counter[str] = Counter()
    slowest = 0.0
    bad = 0
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        texts = sources(folder)
        for number in range(given.files):
            draw = random.Random(f"{given.seed}/{number}")
            kind = "xacro" if number % 10 == 9 else "sdf"
            text, done = spoilt(MACROS if kind == "xacro" else draw.choice(texts), draw)
            path = folder / f"spoilt.{kind}"
            path.write_text(text, encoding="utf-8")
            start = _seconds()
            with warnings.catch_warnings(record=True) as caught:
                warnings.simplefilter("always")
                try:
                    robot = load_robot(path, xacro=kind == "xacro")
                    verdict = ""
                except RobotError as error:
                    verdict = "refused" if str(error) else "TRACEBACK without a word"
                except Exception as error:
                    verdict = f"TRACEBACK {error!r}"
            seconds = _seconds() - start
            slowest = max(slowest, seconds)
            if not verdict:
                said = [str(one.message) for one in caught]
                verdict = judged(robot, path, text)
                if verdict != "equal" and any(_tells(words) for words in said):
                    verdict = "another robot, and said"
            if verdict.startswith(("TRACEBACK", "DIFFERS", "Drake")) or seconds > LONGEST:
                print(f"{number}: {verdict} [{seconds:.1f}s] {done}", flush=True)
                bad += not verdict.startswith("Drake")
            counts[verdict.split(":")[0].split(" by")[0]] += 1
    print(dict(counts), f"slowest {slowest:.2f} s")
    return int(bad > 0)


def _seconds() -> float:
    """Processor time of this process and of those that it started."""
    return sum(os.times()[:4])


def _tells(words: str) -> bool:
    """Whether a warning speaks of something that a parser may take otherwise."""
    return "left and right differ" not in words and "gaits and walking" not in words


if __name__ == "__main__":
    sys.exit(main())
