"""Drake's side of a comparison: a MultibodyPlant with point contact, run by its Simulator."""

from __future__ import annotations

import logging
import warnings
from typing import Any

import numpy as np
from pydrake import geometry, math, polynomial, trajectories
from pydrake.multibody import plant as plants
from pydrake.multibody import tree
from pydrake.systems import analysis, framework, primitives

from heelstrike.experiments.engines.links import links
from heelstrike.experiments.engines.peer import Engine, Peer
from heelstrike.experiments.engines.scenario import Scenario
from heelstrike.robot.model import Floats

FASTEST = "tamsi" if hasattr(plants.DiscreteContactApproximation, "kTamsi") else "lagged"
"""Drake calls TAMSI deprecated; it is several times as fast as what is to take its place."""


class DrakePeer(Peer):
    """A scenario in Drake. Springs and dampers are elements of its plant, within its solver.

    Parameters
    ----------
    scenario : Scenario
    step : float
        Seconds.
    approximation : str
        Of contact in discrete steps: ``"tamsi"``, ``"sap"``, ``"similar"``, ``"lagged"``.
    stiffness, dissipation : float or None
        Of the contact points, in N/m and s/m; None for Drake's estimates.
    stiction : float or None
        Speed up to which friction sticks, in m/s; None for the default of 1e-4.
    near_rigid : float or None
        Where SAP takes a contact for rigid and softens it, in units of what the step resolves;
        None for the default of 1.
    """

    settling = 1.0
    bounces = False

    def __init__(
        self,
        scenario: Scenario,
        step: float,
        *,
        approximation: str = FASTEST,
        stiffness: float | None = None,
        dissipation: float | None = None,
        stiction: float | None = None,
        near_rigid: float | None = None,
    ) -> None:
        super().__init__(scenario, step)
        config = plants.MultibodyPlantConfig(
            time_step=step,
            contact_model="point",
            discrete_contact_approximation=approximation,
            use_sampled_output_ports=False,  # they cost time and nobody reads them
        )
        if stiction is not None:
            config.stiction_tolerance = stiction
        if near_rigid is not None:
            config.sap_near_rigid_threshold = near_rigid
        material = geometry.ProximityProperties()
        geometry.AddContactMaterial(
            properties=material,
            friction=plants.CoulombFriction(scenario.friction, scenario.friction),
            point_stiffness=stiffness,
            dissipation=dissipation,
        )
        logging.getLogger("drake").setLevel(logging.ERROR)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of the deprecated approximation
            self._simulator, self._plant, self._source, self._own = _simulator(
                scenario, self.commands, config, material
            )
        self._context = self._plant.GetMyMutableContextFromRoot(
            self._simulator.get_mutable_context()
        )
        self._forces = np.zeros((scenario.robot.nc, 2))
        self._watched = False

    def place(self, q: Floats, v: Floats) -> None:
        """Put the robot somewhere, at time 0."""
        self._simulator.get_mutable_context().SetTime(0.0)
        self._plant.SetPositions(self._context, q)
        self._plant.SetVelocities(self._context, v)
        self._simulator.Initialize()

    def simulate(self, steps: int) -> None:
        """Simulate some steps in one call."""
        if self._watched:
            self._forces = self._forces_now()  # which is kept, and costs nothing twice
        self._simulator.AdvanceTo((self.done + steps) * self.step)

    def coordinates(self) -> tuple[Floats, Floats]:
        """Where it is now."""
        return self._plant.GetPositions(self._context), self._plant.GetVelocities(self._context)

    def hold(self, torque: Floats) -> None:
        """Apply torques from now on."""
        if self._source is not None:
            context = self._source.GetMyMutableContextFromRoot(
                self._simulator.get_mutable_context()
            )
            self._source.get_mutable_source_value(context).SetFromVector(torque)

    def record(self, steps: int) -> Floats:
        """Simulate some steps one by one, and tell what happened in each."""
        self._watched = True
        return super().record(steps)

    def forces(self) -> Floats:
        """Forces on the contact points in the last step."""
        return self._forces

    def _forces_now(self) -> Floats:
        """Forces on the contact points in the step that follows: Drake tells them beforehand."""
        found = np.zeros((self.scenario.robot.nc, 2))
        results = self._plant.get_contact_results_output_port().Eval(self._context)
        for i in range(results.num_point_pair_contacts()):
            one = results.point_pair_contact_info(i)
            pair, force = one.point_pair(), one.contact_force()
            # It acts on the second of the two.
            own, sign = (pair.id_B, 1.0) if pair.id_B in self._own else (pair.id_A, -1.0)
            found[self._own[own]] += sign * force[2], sign * force[0]
        return found

    def contacts(self) -> list[tuple[float, float]]:
        """Force and depth of each contact now."""
        found = self._plant.get_contact_results_output_port().Eval(self._context)
        each = map(found.point_pair_contact_info, range(found.num_point_pair_contacts()))
        return [(abs(float(one.contact_force()[2])), float(one.point_pair().depth)) for one in each]


def _simulator(
    scenario: Scenario, commands: Floats, config: Any, material: Any
) -> tuple[Any, Any, Any, dict[Any, int]]:
    """Return simulator, plant, source of the commands, and contact points by their geometries."""
    model = scenario.robot.model
    builder = framework.DiagramBuilder()
    plant, scene = plants.AddMultibodyPlant(config, builder)
    plant.mutable_gravity_field().set_gravity_vector([model.gravity[0], 0.0, model.gravity[1]])
    bodies, points = _add_robot(plant, scenario, material)
    plant.RegisterCollisionGeometry(
        plant.world_body(), math.RigidTransform(), geometry.HalfSpace(), "ground", material
    )
    plant.Finalize()
    # The points of two feet may be in the same place: they meet the ground only.
    own = geometry.GeometrySet(
        [shape for body in bodies for shape in plant.GetCollisionGeometriesForBody(body)]
    )
    scene.collision_filter_manager().Apply(geometry.CollisionFilterDeclaration().ExcludeWithin(own))
    source = None
    if scenario.robot.nu:
        source = builder.AddSystem(_commands(scenario, commands))
        port = plant.get_actuation_input_port(tree.default_model_instance())
        builder.Connect(source.get_output_port(), port)
    return analysis.Simulator(builder.Build()), plant, source, points


def _add_robot(plant: Any, scenario: Scenario, material: Any) -> tuple[list[Any], dict[Any, int]]:
    """Add links, joints, contact points, actuators, springs and dampers.

    Return the bodies, and contact points by their geometries.
    """
    robot, feedback = scenario.robot, scenario.feedback
    model = robot.model
    pose = math.RigidTransform
    damping = model.damping.copy()
    if feedback is not None:
        damping[model.actuator_joint] += feedback.parameters.kd
    bodies: list[Any] = []
    joints: list[Any] = []
    points: dict[Any, int] = {}
    for i, link in enumerate(links(robot)):
        inertia = tree.SpatialInertia.Zero()
        if link.mass or link.inertia:
            about = tree.RotationalInertia(link.inertia, link.inertia, link.inertia)
            inertia = tree.SpatialInertia.MakeFromCentralInertia(link.mass, link.center, about)
        body = plant.AddRigidBody(link.name, inertia)
        parent = bodies[link.parent] if link.parent >= 0 else plant.world_body()
        frame = plant.AddFrame(
            tree.FixedOffsetFrame(f"{link.name}_joint", parent.body_frame(), pose(link.place))
        )
        kind = tree.RevoluteJoint if link.hinge else tree.PrismaticJoint
        joint = kind(
            robot.joint_names[i],
            frame,
            body.body_frame(),
            link.axis,
            link.lower,
            link.upper,
            float(damping[i]),
        )
        bodies.append(body)
        joints.append(plant.AddJoint(joint))
        for number, ((center, radius), contact) in enumerate(
            zip(link.points, link.contacts, strict=True)
        ):
            shape = plant.RegisterCollisionGeometry(
                body, pose(center), geometry.Sphere(radius), f"{link.name}_{number}", material
            )
            points[shape] = contact
    for i, driven in enumerate(model.actuator_joint):
        actuator = plant.AddJointActuator(robot.actuator_names[i], joints[driven])
        actuator.set_default_rotor_inertia(float(model.armature[driven]))
        actuator.set_default_gear_ratio(1.0)
        if feedback is not None:
            spring = tree.RevoluteSpring if model.axis[driven, 0] else tree.PrismaticSpring
            rest = float(-model.reference[driven])
            plant.AddForceElement(spring(joints[driven], rest, float(feedback.parameters.kp[i])))
    return bodies, points


def _commands(scenario: Scenario, commands: Floats) -> Any:
    """Source of the commands of the actuators, as polynomials of time."""
    feedback = scenario.feedback
    if feedback is None or len(commands) == 1:  # they never change
        return primitives.ConstantVectorSource(commands[0])
    law = feedback.parameters
    pieces = [
        np.array([[polynomial.Polynomial(row)] for row in piece]) for piece in law.coefficients
    ]
    breaks = [*law.begins, 2.0 * max(scenario.duration, law.begins[-1])]
    return primitives.TrajectorySource(trajectories.PiecewisePolynomial(pieces, breaks))


ENGINE = Engine(
    label=f"Drake {FASTEST.upper() if FASTEST == 'tamsi' else FASTEST}",
    note="in its own loop, AdvanceTo; springs and dampers in its plant, torques without limits",
    peer=DrakePeer,
)
