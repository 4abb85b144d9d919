"""MuJoCo's side of a comparison: the same robot, contacts, law of control and step."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any

import mujoco
import numpy as np
from mujoco import rollout
from numpy.typing import NDArray

from heelstrike.experiments.benchmark.own import InvalidRunError
from heelstrike.experiments.benchmark.scenarios import FRICTION, Scenario
from heelstrike.experiments.benchmark.stopwatch import Work
from heelstrike.robot import State

Floats = NDArray[np.float64]

SINKING = 0.01
"""How far a standing robot may sink into MuJoCo's soft ground, in m."""


@dataclass(frozen=True, kw_only=True)
class Options:
    """How MuJoCo is asked to simulate.

    Attributes
    ----------
    step : float
        Seconds.
    integrator : str
        ``"euler"``, ``"implicitfast"``, ``"rk4"``, or another that it knows.
    stiff : float or None
        Time constant of the contacts in steps (MuJoCo wants at least 2) with the hardest impedance
        it allows, elliptic cones and sharper friction; None for its defaults.
    tolerance : float or None
        Tolerance of its contact solver; None for the default.
    """

    step: float
    integrator: str = "euler"
    stiff: float | None = None
    tolerance: float | None = None

    @property
    def label(self) -> str:
        """Name in tables and figures."""
        if self.stiff is None:
            return f"MuJoCo {self.integrator}, default contacts"
        return f"MuJoCo {self.integrator}, contacts stiff to {self.stiff:g} steps"


class MuJoCoPeer:
    """A scenario in MuJoCo."""

    def __init__(self, scenario: Scenario, options: Options) -> None:
        self._scenario = scenario
        self._options = options
        self.model = _model(scenario, options)
        self.data = mujoco.MjData(self.model)
        self.steps = round(scenario.duration / options.step)
        self._start = self._packed(scenario.state)
        self._control = self._controls()
        self._states = np.zeros((1, self.steps, self._start.shape[1]))
        self._none = np.zeros((1, self.steps, self.model.nsensordata))

    def _packed(self, state: State) -> Floats:
        kind = mujoco.mjtState.mjSTATE_FULLPHYSICS
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[:] = state.q
        self.data.qvel[:] = state.v
        packed = np.zeros((1, mujoco.mj_stateSize(self.model, kind)))
        mujoco.mj_getState(self.model, self.data, packed[0], kind)
        return packed

    def _controls(self) -> Floats:
        feedback = self._scenario.feedback
        if feedback is None:
            return np.zeros((1, 1, self.model.nu))
        if feedback.coefficients.shape[2] == 1:
            return feedback.command([0.0])[None]  # it never changes
        return feedback.command(self._options.step * np.arange(self.steps))[None]

    def settle(self, seconds: float) -> None:
        """Let it sink in first: start from where it is after a while."""
        steps = round(seconds / self._options.step)
        states, _ = rollout.rollout(
            self.model, self.data, self._start, self._control[:, :1], nstep=steps
        )
        self._start = np.ascontiguousarray(states[:, -1])

    def run(self) -> float:
        """Simulate; return the seconds it took."""
        begin = perf_counter()
        rollout.rollout(
            self.model,
            self.data,
            self._start,
            self._control,
            nstep=self.steps,
            state=self._states,
            sensordata=self._none,
        )
        return perf_counter() - begin

    @property
    def work(self) -> Work:
        """The same, to be timed."""
        return self.run

    def batch_work(self, starts: Sequence[State], threads: int) -> Work:
        """Work that simulates from several states on several threads."""
        states = np.concatenate([self._packed(start) for start in starts])
        data = [mujoco.MjData(self.model) for _ in range(threads)]
        out = np.zeros((len(starts), self.steps, states.shape[1]))
        none = np.zeros((len(starts), self.steps, self.model.nsensordata))

        def work() -> float:
            begin = perf_counter()
            rollout.rollout(
                self.model,
                data,
                states,
                self._control,
                nstep=self.steps,
                state=out,
                sensordata=none,
                persistent_pool=True,
            )
            return perf_counter() - begin

        return work

    def final_position(self) -> Floats:
        """Generalised positions at the end of the last run, (nq,)."""
        position: Floats = self._states[0, -1, 1 : 1 + self.model.nq].copy()
        return position

    def check(self) -> dict[str, float]:
        """Step through once, looking at contacts and forces.

        Raises
        ------
        InvalidRunError
            If something that stands does not stand as it should.
        """
        kind = mujoco.mjtState.mjSTATE_FULLPHYSICS
        model, data = self.model, self.data
        mujoco.mj_setState(model, data, self._start[0], kind)
        active, deepest, carried = [], 0.0, 0.0
        force = np.zeros(6)
        for k in range(self.steps):
            data.ctrl[:] = self._control[0, min(k, self._control.shape[1] - 1)]
            mujoco.mj_step(model, data)
            active.append(data.ncon)
            deepest = max([deepest, *(-contact.dist for contact in data.contact)])
        carried = 0.0
        for i in range(data.ncon):
            mujoco.mj_contactForce(model, data, i, force)
            carried += force[0]
        scenario = self._scenario
        carried /= scenario.robot.weight
        found = {
            "penetration_m": float(deepest),
            "active_contacts": float(np.mean(active)),
            "steps": float(self.steps),
        }
        if not np.all(np.isfinite(data.qpos)):
            raise InvalidRunError("MuJoCo's state is not finite")
        if scenario.contacts is not None:
            found["weight_carried"] = float(carried)
            if set(active) != {scenario.contacts}:
                raise InvalidRunError(
                    f"{min(active)} to {max(active)} contacts are active in MuJoCo"
                )
            if abs(carried - 1.0) > 1e-2 or deepest > SINKING:
                raise InvalidRunError(
                    f"in MuJoCo the ground carries {carried:.3f} of the weight and the robot sinks "
                    f"{1e3 * deepest:.1f} mm"
                )
        return found


def _model(scenario: Scenario, options: Options) -> Any:
    with tempfile.TemporaryDirectory() as folder:
        file = scenario.robot.save(Path(folder) / "robot.xml")
        spec = mujoco.MjSpec.from_file(str(file))
    feedback, limits = scenario.feedback, scenario.robot.model
    for i, actuator in enumerate(spec.actuators):
        if feedback is not None:
            actuator.biastype = mujoco.mjtBias.mjBIAS_AFFINE
            actuator.biasprm[:3] = 0.0, -feedback.kp[i], -feedback.kd[i]
        actuator.ctrllimited = 0
        actuator.forcelimited = int(np.isfinite(limits.torque_upper[i]))
        if actuator.forcelimited:
            actuator.forcerange = limits.torque_lower[i], limits.torque_upper[i]
    for geom in spec.geoms:
        geom.friction = FRICTION, 0.0, 0.0
    return configured(spec, options)


def configured(spec: Any, options: Options) -> Any:
    """Compile a specification with the given options."""
    spec.option.timestep = options.step
    spec.option.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{options.integrator.upper()}")
    if options.tolerance is not None:
        spec.option.tolerance = options.tolerance
        spec.option.iterations = 200
    if options.stiff is not None:
        spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
        spec.option.impratio = 10.0
        for geom in spec.geoms:
            geom.solref = options.stiff * options.step, 1.0
            geom.solimp = 0.9999, 0.9999, 1e-3, 0.5, 2.0
    return spec.compile()
