"""The cube thrown in several engines: from where a toss was first measured, freely, to its end.

Every engine has the same cube, floor, step and start, and numbers of its own that are fitted: the
coefficient of friction, and what it has to say how a corner bounces.
"""

from __future__ import annotations

import logging
import tempfile
import warnings
from abc import ABC, abstractmethod
from collections.abc import Sequence
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

import heelstrike as hs
from tosses.reading import HALF_WIDTH, INERTIA, MASS, RATE, Floats, Toss

SUBSTEPS = 6
"""Steps between two samples, of 1.13 ms."""

STEP = 1.0 / (RATE * SUBSTEPS)
GRAVITY = 9.81

CUBE = f"""<mujoco model="cube"><option gravity="0 0 {-GRAVITY}" timestep="{STEP!r}"/>
<worldbody>%s<body name="cube"><freejoint/>
<inertial pos="0 0 0" mass="{MASS}" diaginertia="{INERTIA} {INERTIA} {INERTIA}"/>
<geom type="box" size="{HALF_WIDTH} {HALF_WIDTH} {HALF_WIDTH}" mass="0" %s/></body></worldbody>
</mujoco>"""


def matrix_of(quaternion: Floats) -> Floats:
    """Return the rotation of a unit quaternion, real part first."""
    w, (x, y, z) = quaternion[0], quaternion[1:]
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + 2.0 * (w * cross + cross @ cross)


class Engine(ABC):
    """A cube and a floor in an engine.

    Attributes
    ----------
    names : tuple of str
        What is fitted, friction first.
    grid : tuple of tuple of float
        Values from which the fit begins, of each.
    limits : tuple of (float, float)
        Between which it stays.
    """

    names: ClassVar[tuple[str, ...]]
    grid: ClassVar[tuple[tuple[float, ...], ...]]
    limits: ClassVar[tuple[tuple[float, float], ...]]

    @abstractmethod
    def thrown(self, tosses: Sequence[Toss], numbers: Sequence[float]) -> list[Floats]:
        """Roll tosses out freely.

        Parameters
        ----------
        tosses : sequence of Toss
            From whose first samples.
        numbers : sequence of float
            Values of `names`.

        Returns
        -------
        list of (n, 3) float
            The cube's centre at each sample of each toss (m), the first one included.
        """


class Heelstrike(Engine):
    """Ours: hard contact, Newton's restitution."""

    names = ("friction", "restitution")
    grid = ((0.1, 0.14, 0.18, 0.22, 0.26), (0.0, 0.1, 0.2, 0.3))
    limits = ((0.0, 2.0), (0.0, 1.0))

    def __init__(self) -> None:
        with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of a robot without motors
            file = Path(folder, "cube.xml")
            file.write_text(CUBE % ("", ""), encoding="utf-8")
            self._robot = hs.load_robot(file, dimension=3)
        self._method = hs.TimeStepping(step=STEP)
        self.uncertified = 0
        self.steps = 0

    def thrown(self, tosses: Sequence[Toss], numbers: Sequence[float]) -> list[Floats]:
        """Roll tosses out freely."""
        ground = hs.SpatialGround(friction=numbers[0], restitution=numbers[1])
        found = []
        for toss in tosses:
            begin = hs.State(
                np.concatenate([toss.position[0], toss.quaternion[0]]),
                np.concatenate([toss.velocity[0], toss.spin[0]]),
            )
            run = hs.simulate(
                self._robot, state=begin, ground=ground, method=self._method,
                duration=(len(toss.position) - 1) / RATE, record_every=SUBSTEPS,
                stop_when_fallen=False,
            )  # fmt: skip
            if not run.completed:
                raise RuntimeError(f"toss {toss.number}: {run.message}")
            self.uncertified += run.certificates.uncertified
            self.steps += run.steps
            found.append(run.position[:, :3])
        return found


class MuJoCo(Engine):
    """MuJoCo: elliptic cones, soft contact with a time constant and a damping ratio."""

    names = ("friction", "damping ratio", "time constant (s)")
    grid = ((0.1, 0.14, 0.18, 0.22, 0.26), (0.3, 0.6, 1.0), (2.0 * STEP, 0.005, 0.02))
    limits = ((1e-5, 2.0), (0.05, 5.0), (2.0 * STEP, 0.1))

    def __init__(self) -> None:
        import mujoco

        floor = '<geom type="plane" size="0 0 1" condim="3"/>'
        text = (CUBE % (floor, 'condim="3"')).replace("<option ", '<option cone="elliptic" ')
        self._step = mujoco.mj_step
        self._model = mujoco.MjModel.from_xml_string(text)
        self._data = mujoco.MjData(self._model)
        self._reset = mujoco.mj_resetData

    def thrown(self, tosses: Sequence[Toss], numbers: Sequence[float]) -> list[Floats]:
        """Roll tosses out freely."""
        model, data = self._model, self._data
        model.geom_friction[:, 0] = numbers[0]
        model.geom_solref[:] = numbers[2], numbers[1]
        found = []
        for toss in tosses:
            self._reset(model, data)
            data.qpos[:3], data.qpos[3:] = toss.position[0], toss.quaternion[0]
            data.qvel[:3], data.qvel[3:] = toss.velocity[0], toss.spin[0]
            path = np.empty((len(toss.position), 3))
            path[0] = toss.position[0]
            for row in range(1, len(path)):
                self._step(model, data, nstep=SUBSTEPS)
                path[row] = data.qpos[:3]
            found.append(path)
        return found


class Bullet(Engine):
    """Bullet: its box on its plane, with a coefficient of restitution."""

    names = ("friction", "restitution")
    grid = ((0.1, 0.14, 0.18, 0.22, 0.26), (0.0, 0.1, 0.2, 0.3))
    limits = ((0.0, 2.0), (0.0, 1.0))

    def __init__(self) -> None:
        import pybullet

        self._bullet = pybullet
        self._client = pybullet.connect(pybullet.DIRECT)

    def thrown(self, tosses: Sequence[Toss], numbers: Sequence[float]) -> list[Floats]:
        """Roll tosses out freely."""
        bullet, to = self._bullet, {"physicsClientId": self._client}
        found = []
        for toss in tosses:
            bullet.resetSimulation(**to)  # which forgets the contacts of the toss before
            bullet.setGravity(0.0, 0.0, -GRAVITY, **to)
            bullet.setTimeStep(STEP, **to)
            # Both coefficients are multiplied by those of the floor.
            plane = bullet.createCollisionShape(bullet.GEOM_PLANE, **to)
            floor = bullet.createMultiBody(0.0, plane, **to)
            bullet.changeDynamics(floor, -1, lateralFriction=1.0, restitution=1.0, **to)
            box = bullet.createCollisionShape(bullet.GEOM_BOX, halfExtents=3 * [HALF_WIDTH], **to)
            turned = np.roll(toss.quaternion[0], -1)  # real part last
            cube = bullet.createMultiBody(MASS, box, -1, toss.position[0], turned, **to)
            bullet.changeDynamics(
                cube, -1, lateralFriction=numbers[0], restitution=numbers[1], linearDamping=0.0,
                angularDamping=0.0, localInertiaDiagonal=3 * [INERTIA], **to,
            )  # fmt: skip
            spin = matrix_of(toss.quaternion[0]) @ toss.spin[0]
            bullet.resetBaseVelocity(cube, toss.velocity[0], spin, **to)
            path = np.empty((len(toss.position), 3))
            path[0] = toss.position[0]
            for row in range(1, len(path)):
                for _ in range(SUBSTEPS):
                    bullet.stepSimulation(**to)
                path[row] = bullet.getBasePositionAndOrientation(cube, **to)[0]
            found.append(path)
        return found


class Drake(Engine):
    """Drake: SAP with a stiffness and a dissipation of its corners, which are small spheres."""

    names = ("friction", "dissipation (s/m)", "stiffness (N/m)")
    grid = ((0.1, 0.14, 0.18, 0.22, 0.26), (0.5, 2.0, 8.0), (3e3, 3e4))
    limits = ((0.0, 2.0), (0.0, 50.0), (1e3, 1e6))
    radius = 1e-4

    def __init__(self) -> None:
        logging.getLogger("drake").setLevel(logging.ERROR)

    def _world(self, numbers: Sequence[float]) -> tuple[Any, Any, Any]:
        from pydrake import geometry, math
        from pydrake.multibody import plant as plants
        from pydrake.multibody import tree
        from pydrake.systems import analysis, framework

        builder = framework.DiagramBuilder()
        config = plants.MultibodyPlantConfig(
            time_step=STEP, contact_model="point", discrete_contact_approximation="similar",
            use_sampled_output_ports=False,
        )  # fmt: skip
        plant, _ = plants.AddMultibodyPlant(config, builder)
        plant.mutable_gravity_field().set_gravity_vector([0.0, 0.0, -GRAVITY])
        friction = plants.CoulombFriction(numbers[0], numbers[0])
        material, floor = geometry.ProximityProperties(), geometry.ProximityProperties()
        geometry.AddContactMaterial(
            properties=material, friction=friction, point_stiffness=numbers[2],
            dissipation=numbers[1],
        )  # fmt: skip
        geometry.AddContactMaterial(
            properties=floor, friction=friction, point_stiffness=1e12, dissipation=0.0
        )
        about = tree.RotationalInertia(INERTIA, INERTIA, INERTIA)
        inertia = tree.SpatialInertia.MakeFromCentralInertia(MASS, np.zeros(3), about)
        body = plant.AddRigidBody("cube", inertia)
        inner = HALF_WIDTH - self.radius
        signs = (-inner, inner)
        corners = [(x, y, z) for x in signs for y in signs for z in signs]
        for i, corner in enumerate(corners):
            plant.RegisterCollisionGeometry(
                body, math.RigidTransform(np.array(corner)), geometry.Sphere(self.radius),
                f"corner {i}", material,
            )  # fmt: skip
        plant.RegisterCollisionGeometry(
            plant.world_body(), math.RigidTransform(), geometry.HalfSpace(), "floor", floor
        )
        plant.Finalize()
        simulator = analysis.Simulator(builder.Build())
        context = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
        return simulator, plant, context

    def thrown(self, tosses: Sequence[Toss], numbers: Sequence[float]) -> list[Floats]:
        """Roll tosses out freely."""
        simulator, plant, context = self._world(numbers)
        found = []
        for toss in tosses:
            spin = matrix_of(toss.quaternion[0]) @ toss.spin[0]
            simulator.get_mutable_context().SetTime(0.0)
            plant.SetPositions(context, np.concatenate([toss.quaternion[0], toss.position[0]]))
            plant.SetVelocities(context, np.concatenate([spin, toss.velocity[0]]))
            simulator.Initialize()
            path = np.empty((len(toss.position), 3))
            path[0] = toss.position[0]
            for row in range(1, len(path)):
                simulator.AdvanceTo(row / RATE)
                path[row] = plant.GetPositions(context)[4:]
            found.append(path)
        return found


ENGINES: dict[str, type[Engine]] = {
    "heelstrike": Heelstrike, "mujoco": MuJoCo, "drake": Drake, "bullet": Bullet
}  # fmt: skip
"""By their names on the command line."""
