"""Newton's side of a comparison: an articulation in its joints' coordinates, in its solver Steel.

Of Newton's solvers it is the one that is its own, simulates in the coordinates of the joints, and
tells the forces of hard contacts. It computes in single precision, here on the processor.
"""

from __future__ import annotations

from contextlib import nullcontext
from typing import Any

import newton
import numpy as np
import warp as wp

from heelstrike.dynamics import contact_positions
from heelstrike.experiments.engines.links import links, space
from heelstrike.experiments.engines.peer import Engine, Peer
from heelstrike.experiments.engines.scenario import Scenario
from heelstrike.robot.model import Floats

wp.config.quiet = True

LEAST_SPHERE = 1e-4
"""Least radius of a contact point, in m: its spheres have some size."""
LEAST_BODY = 1e-6
"""Mass (kg) and inertia (kg m²) of what has none: a millionth of the lightest link."""


class NewtonPeer(Peer):
    """A scenario in Newton.

    Parameters
    ----------
    scenario : Scenario
    step : float
        Seconds.
    iterations : int
        Sweeps of its Gauss-Seidel solver.
    baumgarte : float
        Part of a penetration that is taken back in a step.
    cfm : float
        What is added to the diagonal of its contact problem.
    beta : float or None
        Part of the slip that persistent patches of friction take back in a step; 0 for friction
        point by point, None for its default.
    warm : bool
        Whether a step begins with the impulses of the one before.
    """

    float32 = True

    def __init__(
        self,
        scenario: Scenario,
        step: float,
        *,
        iterations: int = 12,
        baumgarte: float = 0.2,
        cfm: float = 1e-6,
        beta: float | None = None,
        warm: bool = False,
    ) -> None:
        super().__init__(scenario, step)
        with wp.ScopedDevice("cpu"):
            self._model = self._build()
            self._solver = newton.solvers.SolverSteel(
                self._model, iterations=iterations, baumgarte=baumgarte, cfm=cfm,
                friction_anchor_beta=beta, contact_warmstart=warm, enable_joint_limits=True,
                restitution_velocity_threshold=0.0 if scenario.restitution else 0.5,
            )  # fmt: skip
            self._states = self._model.state(), self._model.state()
            self._control = self._model.control()
            self._pipeline = newton.CollisionPipeline(self._model, broad_phase="explicit")
            self._contacts = self._pipeline.contacts()
            self._told = self._solver.observables({"contact_f"}, contacts=self._contacts)
        # Views of its arrays, which are in this process's memory.
        self._rows = [(each.joint_q.numpy(), each.joint_qd.numpy()) for each in self._states]
        self._motors = self._control.joint_f.numpy()
        self._force = np.zeros(scenario.robot.nv)
        self._damping = scenario.robot.model.damping
        self._now = 0
        self._graphs: list[Any] = []
        self._loaded = False

    def _build(self) -> Any:
        scenario = self.scenario
        robot = scenario.robot
        builder = newton.ModelBuilder(gravity=tuple(space(robot.model.gravity)))
        newton.solvers.SolverSteel.register_custom_attributes(builder)
        surface = {"mu": scenario.friction, "restitution": scenario.restitution, "density": 0.0}
        cfg = newton.ModelBuilder.ShapeConfig(**surface)
        joints = []
        self._point: dict[int, int] = {}
        for link in links(robot, least_radius=LEAST_SPHERE):
            inertia = max(link.inertia, LEAST_BODY)
            body = builder.add_link(
                mass=max(link.mass, LEAST_BODY), com=wp.vec3(*link.center),
                inertia=wp.mat33(inertia * np.eye(3)), lock_inertia=True, label=link.name,
            )  # fmt: skip
            add = builder.add_joint_revolute if link.hinge else builder.add_joint_prismatic
            joints.append(
                add(
                    link.parent, body, axis=wp.vec3(*link.axis),
                    parent_xform=wp.transform(wp.vec3(*link.place), wp.quat_identity()),
                    child_xform=wp.transform(), armature=link.armature, friction=0.0,
                    limit_lower=link.lower, limit_upper=link.upper, target_ke=0.0, target_kd=0.0,
                    damping=0.0,
                )
            )  # fmt: skip
            for (center, radius), contact in zip(link.points, link.contacts, strict=True):
                shape = builder.add_shape_sphere(
                    body, xform=wp.transform(wp.vec3(*center), wp.quat_identity()), radius=radius,
                    cfg=newton.ModelBuilder.ShapeConfig(**surface, collision_group=-1),
                )  # fmt: skip
                self._point[shape] = contact
        builder.add_articulation(joints)
        builder.add_ground_plane(cfg=cfg)
        return builder.finalize()

    def place(self, q: Floats, v: Floats) -> None:
        """Put the robot somewhere, at time 0."""
        if not self._graphs:
            self._capture()
        self._now = 0
        state = self._states[0]
        self._rows[0][0][:], self._rows[0][1][:] = q, v
        newton.eval_fk(self._model, state.joint_q, state.joint_qd, state)
        self._solver.reset(state)

    def _capture(self) -> None:
        """Record a step from one state to the other and one back: each is replayed by one call.

        The first step, which is not recorded, loads the kernels.
        """
        for now, after in ((0, 1), (0, 1), (1, 0)):
            with wp.ScopedCapture(device="cpu") if self._loaded else nullcontext() as recorded:
                self._pipeline.collide(self._states[now], self._contacts)
                self._solver.step(
                    self._states[now], self._states[after], self._control, self._contacts,
                    self.step, observables=self._told,
                )  # fmt: skip
            if recorded is not None:
                self._graphs.append(recorded.graph)
            self._loaded = True

    def simulate(self, steps: int) -> None:
        """Simulate some steps, each with a call from Python."""
        for k in range(steps):
            self.hold_by_law(k)
            self._motors[:] = self._force - self._damping * self._rows[self._now][1]
            wp.capture_launch(self._graphs[self._now])
            self._now = 1 - self._now

    def coordinates(self) -> tuple[Floats, Floats]:
        """Where it is now."""
        q, v = self._rows[self._now]
        return q.astype(np.float64), v.astype(np.float64)

    def hold(self, torque: Floats) -> None:
        """Apply torques from now on."""
        self._force[self.scenario.robot.model.actuator_joint] = torque

    def forces(self) -> Floats:
        """Forces on the contact points in the last step."""
        found = np.zeros((self.scenario.robot.nc, 2))
        for contact, force in self._pressed():
            found[contact] += force[2], force[0]
        return found

    def contacts(self) -> list[tuple[float, float]]:
        """Force and depth of each contact in the last step."""
        robot = self.scenario.robot
        height = contact_positions(robot, self.coordinates()[0] + self.zero)[:, 1]
        depth = robot.model.contact_radius - height
        return [(float(force[2]), float(depth[contact])) for contact, force in self._pressed()]

    def _pressed(self) -> list[tuple[int, Any]]:
        """Contact points, and the forces on the robot there (N)."""
        told = self._contacts
        count = int(told.rigid_contact_count.numpy()[0])
        force = self._told.contact_f.numpy()[:count, :3]
        sides = told.rigid_contact_shape0.numpy()[:count], told.rigid_contact_shape1.numpy()[:count]
        found = []
        for k in range(count):
            first = int(sides[0][k]) in self._point
            shape = int(sides[0 if first else 1][k])
            if np.any(force[k]):
                found.append((self._point[shape], force[k] if first else -force[k]))
        return found


ENGINE = Engine(
    label="Newton Steel",
    note="through warp on the processor, two calls from Python a step",
    peer=NewtonPeer,
)
