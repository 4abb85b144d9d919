"""MuJoCo's side of a comparison: the same robot, contacts, law of control and step."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import Any

import mujoco
import numpy as np
from mujoco import rollout

from heelstrike.dynamics import contact_positions
from heelstrike.experiments.engines.peer import Engine, InvalidRunError, Peer
from heelstrike.experiments.engines.scenario import Scenario
from heelstrike.robot import State
from heelstrike.robot.model import Floats

KIND = mujoco.mjtState.mjSTATE_FULLPHYSICS


class MuJoCoPeer(Peer):
    """A scenario in MuJoCo, which reads the robot from its file and runs in its own `rollout`.

    Parameters
    ----------
    scenario : Scenario
    step : float
        Seconds.
    integrator : str
        ``"euler"``, ``"implicitfast"``, ``"rk4"``, or another that it knows.
    stiff : float or None
        Time constant of the contacts in steps (MuJoCo wants at least 2) with the hardest impedance
        it allows, elliptic cones and sharper friction; None for its defaults.
    tolerance : float or None
        Tolerance of its contact solver; None for the default.
    impratio : float or None
        How much harder friction is than the normal direction; None for 1, or 10 if `stiff`.
    elliptic : bool
        Whether cones are elliptic; they are if `stiff`.
    noslip : int
        Iterations of its solver that takes slip away after the others.
    """

    settling = 3.0

    def __init__(
        self,
        scenario: Scenario,
        step: float,
        *,
        integrator: str = "euler",
        stiff: float | None = None,
        tolerance: float | None = None,
        impratio: float | None = None,
        elliptic: bool = False,
        noslip: int = 0,
    ) -> None:
        super().__init__(scenario, step)
        spec = _spec(scenario)
        spec.option.timestep = step
        spec.option.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator.upper()}")
        if tolerance is not None:
            spec.option.tolerance = tolerance
            spec.option.iterations = 200
        if stiff is not None:
            spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
            spec.option.impratio = 10.0
            for geom in spec.geoms:
                geom.solref = stiff * step, 1.0
                geom.solimp = 0.9999, 0.9999, 1e-3, 0.5, 2.0
        if elliptic:
            spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
        if impratio is not None:
            spec.option.impratio = impratio
        spec.option.noslip_iterations = noslip
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        self.zero = np.zeros(self.model.nq)
        self._contact_of = _contacts(self.model, scenario)
        self._states, self._none = self._room(1, self.steps)

    def _room(self, runs: int, steps: int) -> tuple[Floats, Floats]:
        """Room for the states and the (no) measurements of runs, which `rollout` returns."""
        size = mujoco.mj_stateSize(self.model, KIND)
        return np.zeros((runs, steps, size)), np.zeros((runs, steps, self.model.nsensordata))

    def _packed(self) -> Floats:
        packed = np.zeros((1, self._states.shape[2]))
        mujoco.mj_getState(self.model, self.data, packed[0], KIND)
        return packed

    def place(self, q: Floats, v: Floats) -> None:
        """Put the robot somewhere, at time 0."""
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[:] = q
        self.data.qvel[:] = v

    def simulate(self, steps: int) -> None:
        """Simulate some steps: several in one `rollout`."""
        if steps == 1:
            self.data.ctrl[:] = self.commands[min(self.done, len(self.commands) - 1)]
            mujoco.mj_step(self.model, self.data)
            return
        varying = len(self.commands) > 1
        control = self.commands[self.done : self.done + steps] if varying else self.commands
        if steps > self._states.shape[1]:
            self._states, self._none = self._room(1, steps)
        states, none = self._states[:, :steps], self._none[:, :steps]
        now = self._packed()
        rollout.rollout(
            self.model, self.data, now, control[None], nstep=steps, state=states, sensordata=none
        )
        mujoco.mj_setState(self.model, self.data, states[0, -1], KIND)

    def coordinates(self) -> tuple[Floats, Floats]:
        """Where it is now."""
        return self.data.qpos, self.data.qvel

    def contacts(self) -> list[tuple[float, float]]:
        """Force and depth of each contact in the last step."""
        force = np.zeros((self.data.ncon, 6))
        for i in range(self.data.ncon):
            mujoco.mj_contactForce(self.model, self.data, i, force[i])
        return [(f[0], -contact.dist) for f, contact in zip(force, self.data.contact, strict=True)]

    def hold(self, torque: Floats) -> None:
        """Apply torques from now on."""
        self.commands = np.array(torque, dtype=np.float64)[None]

    def forces(self) -> Floats:
        """Forces on the contact points in the last step."""
        found = np.zeros((self.scenario.robot.nc, 2))
        force = np.zeros(6)
        for i, contact in enumerate(self.data.contact[: self.data.ncon]):
            mujoco.mj_contactForce(self.model, self.data, i, force)
            world = force[:3] @ contact.frame.reshape(3, 3)
            # It acts on the second of the two, of which the ground, a plane, is the first.
            found[self._contact_of[int(contact.geom[1])]] += world[2], world[0]
        return found

    def batch_work(self, starts: Sequence[State], threads: int) -> Callable[[], float]:
        """Return what simulates from several states on threads and returns the seconds it took."""
        packed = []
        for start in starts:
            self.place(start.q, start.v)
            packed.append(self._packed())
        data = [mujoco.MjData(self.model) for _ in range(threads)]
        out, none = self._room(len(starts), self.steps)
        run = partial(
            rollout.rollout, self.model, data, np.concatenate(packed), self.commands[None],
            nstep=self.steps, state=out, sensordata=none, persistent_pool=True,
        )  # fmt: skip

        def work() -> float:
            begin = perf_counter()
            run()
            return perf_counter() - begin

        return work


def _spec(scenario: Scenario) -> Any:
    if scenario.robot.model.latches:
        raise InvalidRunError("its joints have latches, which this engine is not told")
    if scenario.robot.model.brakes:
        raise InvalidRunError("its joints have brakes, which this engine is not told")
    if np.any(scenario.robot.model.friction_scale != 1.0):
        raise InvalidRunError("its points have friction scales, which this engine is not told")
    with tempfile.TemporaryDirectory() as folder:
        file = scenario.robot.save(Path(folder) / "robot.xml")
        spec = mujoco.MjSpec.from_file(str(file))
    feedback, limits = scenario.feedback, scenario.robot.model
    for i, actuator in enumerate(spec.actuators):
        if feedback is not None:
            actuator.biastype = mujoco.mjtBias.mjBIAS_AFFINE
            actuator.biasprm[:3] = 0.0, -feedback.parameters.kp[i], -feedback.parameters.kd[i]
        actuator.ctrllimited = 0
        actuator.forcelimited = int(np.isfinite(limits.torque_upper[i]))
        if actuator.forcelimited:
            actuator.forcerange = limits.torque_lower[i], limits.torque_upper[i]
    for geom in list(spec.geoms):
        if not geom.contype and not geom.conaffinity:
            spec.delete(geom)  # bones, which are only looked at
        else:
            geom.friction = scenario.friction, 0.0, 0.0
    return spec


def _contacts(model: Any, scenario: Scenario) -> dict[int, int]:
    """Our index of the contact point of each geom that touches the ground.

    They are found by where they are when all joints are somewhere of their own.
    """
    robot = scenario.robot
    q = robot.model.reference + 0.1 * np.arange(1.0, robot.nq + 1.0)
    data = mujoco.MjData(model)
    data.qpos[:] = q
    mujoco.mj_kinematics(model, data)
    ours = contact_positions(robot, q)
    found = {}
    for geom in range(model.ngeom):
        if model.geom_bodyid[geom]:
            apart = np.hypot(*(ours - data.geom_xpos[geom][[0, 2]]).T)
            found[geom] = int(np.argmin(apart))
    return found


ENGINE = Engine(
    label="MuJoCo Euler",
    note="in its own loop, rollout, with its controls handed over",
    peer=MuJoCoPeer,
)
