"""Robot files spoilt at random: does one crash the process, hang, or eat the machine.

    python benchmarks/robot_file_fuzzing.py [--seconds 300] [--seed 1] [--reader heelstrike]

The built-in robots in MJCF and URDF, and files that use what else MJCF has (includes, replicas,
attached models, meshes, tendons …), are changed at several places at once: numbers replaced,
attributes and elements lost, repeated, moved and exchanged between files, bytes of meshes flipped.
A worker process has them read. What the process bears in which heelstrike's parser runs, a crash,
a hang and want of memory, is counted as borne. `--reader mujoco` gives the files to MuJoCo's parser
alone: what it dies of is what that process is for.

Ends with 1 if a file killed the worker, ran longer than `LONGEST` seconds without being borne,
took more than `MOST_MEMORY` or raised anything but a RobotError. Such files are kept. Needs Linux.
"""

from __future__ import annotations

import argparse
import faulthandler
import itertools
import json
import os
import queue
import random
import resource
import struct
import subprocess
import sys
import tempfile
import threading
import time
import warnings
from collections import Counter
from copy import deepcopy
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

LONGEST = 10.0
"""Seconds for one file, imports apart."""

MOST_MEMORY = 2 * 2**30
"""Bytes of address space that a worker may add to what it has after its imports."""

NUMBERS = (
    *("nan", "inf", "-inf", "-1", "0", "1", "1e308", "1e-308", "-0", "", "abc", "9" * 400),
    *("1000", "100000", "2147483647", "2147483648", "-2147483648", "4294967296", "1e10", "0.5"),
    *("1 2 3 4 5 6 7", "1,5", "0x10", "auto", "true", "false", "10 10 10", "mesh", "hinge"),
)

RICH = (
    """<mujoco model="rich">
  <compiler angle="radian" autolimits="true" boundmass="1e-6" meshdir="." eulerseq="zyx"/>
  <option timestep="0.001" integrator="implicit" gravity="0 0 -9.81"><flag contact="enable"/>
    </option>
  <size memory="1M" nuser_geom="2"/>
  <visual><global offwidth="640"/><map znear="0.01"/></visual>
  <statistic extent="2" center="0 0 1"/>
  <default>
    <geom condim="3" friction="0.8 0.1 0.1"/>
    <joint damping="0.1" armature="0.01"/>
    <default class="leg"><geom type="capsule" size="0.03"/><motor ctrlrange="-50 50"/></default>
  </default>
  <asset>
    <texture name="sky" type="skybox" builtin="gradient" width="32" height="32" rgb1="1 1 1"/>
    <texture name="grid" type="2d" builtin="checker" width="16" height="16"/>
    <material name="grid" texture="grid" texrepeat="2 2"/>
    <mesh name="tetra" vertex="0 0 0 1 0 0 0 1 0 0 0 1" scale="0.1 0.1 0.1"/>
    <mesh name="ball" builtin="sphere" params="2"/>
    <mesh name="stl" file="part.stl"/>
    <mesh name="obj" file="part.obj"/>
    <hfield name="hills" nrow="4" ncol="4" size="1 1 0.1 0.1"
      elevation="0 1 2 3 4 5 6 7 8 9 0 1 2 3 4 5"/>
  </asset>
  <worldbody>
    <light pos="0 0 3" dir="0 0 -1"/><camera name="eye" pos="0 -3 1" xyaxes="1 0 0 0 0 1"/>
    <geom name="floor" type="plane" size="5 5 0.1" material="grid"/>
    <geom name="terrain" type="hfield" hfield="hills" pos="9 0 0"/>
    <replicate count="3" offset="0.5 0 0" sep="-"><geom type="sphere" size="0.1" pos="0 3 0"/>
      </replicate>
    <body name="trunk" pos="0 0 1" childclass="leg">
      <joint name="x" type="slide" axis="1 0 0"/><joint name="z" type="slide" axis="0 0 1"/>
      <joint name="pitch" axis="0 1 0" ref="0.1" springref="0.2" stiffness="1"/>
      <inertial pos="0 0 0" mass="10" diaginertia="1 1 1"/>
      <geom name="trunk" type="mesh" mesh="stl"/><site name="hip" pos="0 0 -0.1"/>
      <frame pos="0 0 0.1" euler="0 0.1 0"><geom type="ellipsoid" size="0.1 0.1 0.2" mass="1"/>
        </frame>
      <body name="thigh" pos="0 0.1 0" euler="0 0.2 0">
        <joint name="hip" axis="0 1 0" range="-1 1" solreflimit="0.01 1" frictionloss="0.1"/>
        <geom name="thigh" fromto="0 0 0 0 0 -0.4"/><geom type="mesh" mesh="tetra" mass="0.1"/>
        <body name="shank" pos="0 0 -0.4">
          <joint name="knee" axis="0 1 0" range="-2 0" actuatorfrcrange="-40 40"/>
          <geom fromto="0 0 0 0 0 -0.4" user="1 2"/>
            <geom type="box" size="0.1 0.05 0.02" pos="0 0 -0.4"/>
          <site name="foot" pos="0 0 -0.4" size="0.01"/>
        </body>
      </body>
      <body name="arm" pos="0 -0.1 0.2" gravcomp="0.5"><joint name="arm" axis="0 1 0"/>
        <geom type="cylinder" size="0.02 0.1" density="500"/><geom type="mesh" mesh="obj"/></body>
      <attach body="thigh" prefix="other_"/>
    </body>
    <body name="target" mocap="true" pos="1 0 0">
      <geom type="box" size="0.1 0.1 0.1" contype="0"/></body>
  </worldbody>
  <contact><exclude body1="trunk" body2="thigh"/><pair geom1="floor" geom2="thigh" condim="3"/>
    </contact>
  <equality>
    <joint joint1="hip" joint2="knee" polycoef="0 1 0 0 0"/>
    <connect body1="shank" body2="arm" anchor="0 0 0"/>
      <weld body1="arm" body2="target" relpose="0 0 0 1 0 0 0"/>
    <tendon tendon1="rope" polycoef="1 0 0 0 0"/>
  </equality>
  <tendon>
    <spatial name="rope" range="0 2" width="0.01" stiffness="10" springlength="0.3">
      <site site="hip"/><geom geom="thigh"/><site site="foot"/></spatial>
    <fixed name="both"><joint joint="hip" coef="1"/><joint joint="knee" coef="-1"/></fixed>
  </tendon>
  <actuator>
    <motor name="hip" joint="hip" gear="10" class="leg"/>
      <position name="knee" joint="knee" kp="100" forcerange="-9 9"/>
    <general name="arm" joint="arm" dyntype="filter" dynprm="0.1" gainprm="3" biastype="affine"
      biasprm="0 -3 0"/>
    <velocity tendon="both" kv="2"/><muscle tendon="rope" lengthrange="0.1 1"/>
    <motor joint="arm" nsample="4" delay="0.01"/>
  </actuator>
  <sensor><jointpos joint="hip"/><framepos objtype="site" objname="foot"/><user dim="3"/>
    <touch site="foot"/></sensor>
  <keyframe><key name="home" qpos="0 0 1 0 0 0 0 0"/></keyframe>
  <custom><numeric name="speed_limit:hip" data="3"/><text name="note" data="hello"/>
    <tuple name="pair"><element objtype="body" objname="trunk"/></tuple></custom>
  <extension><plugin plugin="mujoco.pid"/></extension>
</mujoco>""",
    """<mujoco model="joined">
  <asset><model name="child" file="child.xml"/></asset>
  <include file="sub/defaults.xml"/>
  <worldbody>
    <include file="sub/floor.xml"/>
    <body name="trunk" pos="0 0 1"><joint axis="1 0 0" type="slide"/><joint axis="0 1 0"/>
      <geom type="box" size="0.1 0.1 0.3"/>
      <attach model="child" body="leg" prefix="left_"/>
      <frame pos="0 0.2 0"><attach model="child" body="leg" prefix="right_"/></frame>
    </body>
    <replicate count="4" euler="0 0 0.5"><body pos="3 0 0"><geom size="0.1"/>
      <replicate count="2" offset="0 0 1"><geom size="0.2"/></replicate></body></replicate>
  </worldbody>
</mujoco>""",
)
PARTS = {
    "child.xml": '<mujoco><worldbody><body name="leg"><joint name="hip" axis="0 1 0"/>'
    '<geom type="capsule" fromto="0 0 0 0 0 -0.5" size="0.04"/></body></worldbody>'
    '<actuator><motor joint="hip" gear="5"/></actuator></mujoco>',
    "sub/defaults.xml": "<mujocoinclude><default><geom density='700'/></default></mujocoinclude>",
    "sub/floor.xml": "<mujocoinclude><geom type='plane' size='3 3 1'/></mujocoinclude>",
}


def tetrahedron_stl() -> bytes:
    """Return a small binary STL."""
    corners = ((0.0, 0.0, 0.0), (0.1, 0.0, 0.0), (0.0, 0.1, 0.0), (0.0, 0.0, 0.1))
    faces = itertools.combinations(corners, 3)
    facets = [struct.pack("<12fH", 0, 0, 1, *(x for p in face for x in p), 0) for face in faces]
    return b"part".ljust(80) + struct.pack("<I", len(facets)) + b"".join(facets)


TETRAHEDRON_OBJ = b"v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nv 0 0 0.1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"


def seeds(directory: Path) -> list[str]:
    """Texts to spoil: every built-in robot as MJCF and as URDF, and the rich files."""
    from heelstrike.robot import builtin_robots, load_robot

    texts = []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for name in builtin_robots():
            for ending in (".xml", ".urdf"):
                path = load_robot(name).save(directory / f"{name}{ending}")
                texts.append(path.read_text("utf-8"))
    return [*texts, *RICH * 4]


def spoilt(text: str, others: list[str], draw: random.Random) -> str:
    """Return a text with one to eight things wrong."""
    root = ElementTree.fromstring(text)
    for _ in range(draw.choice((1, 1, 2, 3, 5, 8))):
        _spoil(root, others, draw)
    return ElementTree.tostring(root, encoding="unicode")


def _spoil(root: Element, others: list[str], draw: random.Random) -> None:
    attributes = [(element, name) for element in root.iter() for name in element.attrib]
    pairs = [(parent, child) for parent in root.iter() for child in parent]
    if not pairs or not attributes:
        return
    parent, child = draw.choice(pairs)
    element, name = draw.choice(attributes)
    other = ElementTree.fromstring(draw.choice(others))
    match draw.randrange(9):
        case 0 | 1 | 2:
            words = element.attrib[name].split() or [""]
            words[draw.randrange(len(words))] = draw.choice(NUMBERS)
            element.set(name, " ".join(words))
        case 3:
            del element.attrib[name]
        case 4:
            parent.remove(child)
        case 5:
            if sum(1 for _ in root.iter()) < 2000:
                parent.insert(draw.randrange(len(parent) + 1), deepcopy(child))
        case 6:
            parent.remove(child)
            draw.choice(list(root.iter())).append(child)
        case 7:  # an attribute, as it is or with a number, that another file has there
            twins = list(other.iter(element.tag))
            if twins and (donor := draw.choice(twins)).attrib:
                taken = draw.choice(list(donor.attrib))
                element.set(taken, draw.choice((donor.attrib[taken], draw.choice(NUMBERS))))
        case 8:  # an element of another file, beside its like
            donor = draw.choice([e for e in other.iter() if e is not other] or [other])
            places = [p for p, c in pairs if c.tag == donor.tag] or [parent]
            draw.choice(places).append(donor)


def spoilt_bytes(data: bytes, draw: random.Random) -> bytes:
    """Return the bytes of a mesh, some flipped, lost or repeated."""
    changed = bytearray(data)
    for _ in range(draw.choice((0, 1, 2, 20))):
        place = draw.randrange(len(changed))
        match draw.randrange(3):
            case 0:
                changed[place] = draw.randrange(256)
            case 1:
                del changed[place : place + draw.randrange(1, 60)]
            case 2:
                changed[place:place] = changed[place : place + draw.randrange(1, 200)]
        if not changed:
            return b"\0"
    return bytes(changed)


def write_case(directory: Path, texts: list[str], seed: int) -> Path:
    """Write the spoilt file of a seed and the parts that it names; return its path."""
    draw = random.Random(seed)
    text = draw.choice(texts)
    (directory / "sub").mkdir(exist_ok=True)
    for name, part in PARTS.items():
        changed = spoilt(part, texts, draw) if draw.random() < 0.3 else part
        (directory / name).write_text(changed, encoding="utf-8", errors="surrogatepass")
    (directory / "part.stl").write_bytes(spoilt_bytes(tetrahedron_stl(), draw))
    (directory / "part.obj").write_bytes(spoilt_bytes(TETRAHEDRON_OBJ, draw))
    for left in directory.glob("spoilt.*"):
        left.unlink()
    path = directory / ("spoilt.urdf" if "<robot" in text else "spoilt.xml")
    path.write_text(spoilt(text, texts, draw), encoding="utf-8", errors="surrogatepass")
    return path


def work(reader: str, first: int, directory: Path) -> None:
    """Read case after case and tell of each; for the worker process."""
    import mujoco

    from heelstrike.errors import RobotError
    from heelstrike.reader_process import ReadingError
    from heelstrike.robot import inspect_robot, load_robot

    texts = seeds(directory)
    os.environ["HEELSTRIKE_KEEP_ROBOTS"] = "0"
    used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (used + MOST_MEMORY,) * 2)
    for number in itertools.count(first):
        path = write_case(directory, texts, number)
        print(json.dumps({"case": number}), flush=True)
        faulthandler.dump_traceback_later(10.0 * LONGEST)
        began = time.perf_counter()
        outcome = "loaded"
        options = ({}, {"floating": True}, {"projected": True})[number % 3]
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                if reader == "mujoco":
                    mujoco.MjData(mujoco.MjModel.from_xml_path(str(path)))
                elif number % 4:
                    load_robot(path, **options)
                else:
                    inspect_robot(path, **options)
        except RobotError as error:
            outcome = "refused"
            if isinstance(error.__cause__, ReadingError):  # of a kind: our reader raised it
                outcome = str(error)[:300] if error.__cause__.kind else "borne"
        except Exception as error:  # what a person would see as a traceback
            plain = reader == "mujoco" and isinstance(
                error, ValueError | RuntimeError | MemoryError
            )
            outcome = "refused" if plain else f"{type(error).__name__}: {error}"[:300]
        seconds = time.perf_counter() - began
        print(json.dumps({"done": number, "outcome": outcome, "seconds": seconds}), flush=True)


def main() -> int:
    """Keep a worker busy; start another when one dies."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=300.0, help="how long")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--reader", choices=("heelstrike", "mujoco"), default="heelstrike")
    parser.add_argument("--keep", type=Path, default=Path("spoilt"), help="where bad files go")
    parser.add_argument("--work", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.work:
        work(options.reader, options.seed, options.work)
        return 0
    number = options.seed * 10_000_000
    end = time.monotonic() + options.seconds
    counts: Counter[str] = Counter()
    found: Counter[str] = Counter()
    longest = 0.0
    with tempfile.TemporaryDirectory() as folder:
        directory = Path(folder)
        while time.monotonic() < end:
            program = [sys.executable, __file__, "--seed", str(number), "--work", folder]
            with (directory / "stderr.txt").open("w") as stderr:
                worker = subprocess.Popen(
                    [*program, "--reader", options.reader],
                    stdout=subprocess.PIPE,
                    stderr=stderr,
                    text=True,
                    preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_CORE, (0, 0)),
                )
            lines = _lines(worker)
            bad = ""
            while not bad and time.monotonic() < end:
                line = _within(12.0 * LONGEST, lines)
                told = json.loads(line) if line else {}
                if "case" in told:
                    number = told["case"]
                elif "done" in told:
                    counts[told["outcome"].partition(":")[0]] += 1
                    longest = max(longest, told["seconds"])
                    if told["outcome"] not in ("loaded", "refused", "borne"):
                        bad = told["outcome"]
                    elif told["seconds"] > LONGEST and told["outcome"] != "borne":
                        bad = f"{told['seconds']:.0f} s"
                else:
                    bad = f"exit {worker.wait()}" if _over(worker) else "hangs"
            worker.kill()
            worker.wait()
            if bad:
                found[bad.splitlines()[0][:100]] += 1
                _keep(directory, options.keep / str(number), bad)
            number += 1
    print(f"{sum(counts.values())} files: {dict(counts)}; longest {longest:.2f} s")
    for what, times in found.most_common():
        print(f"{times:5d} x {what}")
    return 1 if found else 0


def _lines(worker: subprocess.Popen[str]) -> queue.Queue[str]:
    """Lines that a worker prints, as they come; an empty one when there are no more."""
    lines: queue.Queue[str] = queue.Queue()

    def listen() -> None:
        assert worker.stdout is not None
        for line in worker.stdout:
            lines.put(line)
        lines.put("")

    threading.Thread(target=listen, daemon=True).start()
    return lines


def _within(seconds: float, lines: queue.Queue[str]) -> str:
    try:
        return lines.get(timeout=seconds)
    except queue.Empty:
        return ""


def _over(worker: subprocess.Popen[str]) -> bool:
    try:
        worker.wait(timeout=1.0)
    except subprocess.TimeoutExpired:
        return False
    return True


def _keep(source: Path, target: Path, why: str) -> None:
    (target / "sub").mkdir(parents=True, exist_ok=True)
    for name in ("spoilt.xml", "spoilt.urdf", "part.stl", "part.obj", "stderr.txt", *PARTS):
        if (source / name).is_file():
            (target / name).write_bytes((source / name).read_bytes())
    (target / "why.txt").write_text(why)


if __name__ == "__main__":
    sys.exit(main())
