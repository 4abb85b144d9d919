"""MuJoCo's side of a comparison: the same robot, contacts, law of control and step."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any

import mujoco
import numpy as np
from mujoco import rollout
from numpy.typing import NDArray

from heelstrike.experiments.benchmark.peer import Engine, Peer, Setting, Touching
from heelstrike.experiments.benchmark.scenarios import FRICTION, Scenario
from heelstrike.experiments.benchmark.stopwatch import Work
from heelstrike.robot import State

Floats = NDArray[np.float64]

KIND = mujoco.mjtState.mjSTATE_FULLPHYSICS


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


class MuJoCoPeer(Peer):
    """A scenario in MuJoCo, which reads the robot from its file and runs in its own `rollout`."""

    settling = 3.0

    def __init__(self, scenario: Scenario, options: Options) -> None:
        super().__init__(scenario, options.step)
        self.model = _model(scenario, options)
        self.data = mujoco.MjData(self.model)
        self._step = 0
        self._make_room(self.steps)

    def _make_room(self, steps: int) -> None:
        """Make room for the states of so many steps, which `rollout` returns."""
        self._states = np.zeros((1, steps, mujoco.mj_stateSize(self.model, KIND)))
        self._none = np.zeros((1, steps, self.model.nsensordata))

    def _packed(self, state: State) -> Floats:
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[:] = state.q
        self.data.qvel[:] = state.v
        packed = np.zeros((1, mujoco.mj_stateSize(self.model, KIND)))
        mujoco.mj_getState(self.model, self.data, packed[0], KIND)
        return packed

    def restart(self) -> None:
        """Go back to `start`, at time 0."""
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[:] = self.start.q
        self.data.qvel[:] = self.start.v
        self._step = 0

    def advance(self, steps: int) -> None:
        """Simulate some steps: several in one `rollout`."""
        if steps == 1:
            self.data.ctrl[:] = self.command(self._step)
            mujoco.mj_step(self.model, self.data)
        else:
            now = np.zeros((1, self._states.shape[2]))
            mujoco.mj_getState(self.model, self.data, now[0], KIND)
            varying = len(self.commands) > 1
            control = self.commands[self._step : self._step + steps] if varying else self.commands
            if steps > self._states.shape[1]:
                self._make_room(steps)
            states = self._states[:, :steps]
            rollout.rollout(
                self.model,
                self.data,
                now,
                control[None],
                nstep=steps,
                state=states,
                sensordata=self._none[:, :steps],
            )
            mujoco.mj_setState(self.model, self.data, states[0, -1], KIND)
        self._step += steps

    def state(self) -> State:
        """Where it is now."""
        return State(self.data.qpos.copy(), self.data.qvel.copy())

    def touching(self) -> Touching:
        """How it touched the ground in the last step."""
        force, total = np.zeros(6), 0.0
        for i in range(self.data.ncon):
            mujoco.mj_contactForce(self.model, self.data, i, force)
            total += force[0]
        depth = max((-contact.dist for contact in self.data.contact), default=0.0)
        return Touching(self.data.ncon, total, depth)

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
                self.commands[None],
                nstep=self.steps,
                state=out,
                sensordata=none,
                persistent_pool=True,
            )
            return perf_counter() - begin

        return work


def _model(scenario: Scenario, options: Options) -> Any:
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
            geom.friction = FRICTION, 0.0, 0.0
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


def _settings(quick: bool) -> Iterator[Setting]:
    small = (1e-3, 1e-4) if quick else (2e-3, 1e-3, 5e-4, 2e-4, 1e-4, 5e-5, 2e-5, 1e-5, 5e-6)
    # The settings that came nearest in a search over time constants from 2 to 10 steps, friction
    # impedance ratios from 1 to 1000, both cones, and direct stiffness of the contacts.
    ways: list[tuple[str, float | None]] = [("euler", None), ("euler", 5.0), ("rk4", 2.0)]
    if not quick:
        ways += [("euler", 2.0), ("euler", 10.0), ("implicitfast", 5.0), ("rk4", None)]
    for integrator, stiff in ways:
        for step in small:
            if stiff is None and step < 5e-5:
                continue  # softness is all of the error long before
            tolerance = None if stiff is None else 1e-10
            options = Options(step=step, integrator=integrator, stiff=stiff, tolerance=tolerance)
            yield Setting(
                options.label,
                f"h {step:.0e} s",
                lambda scenario, options=options: MuJoCoPeer(scenario, options),  # type: ignore[misc]
            )


ENGINE = Engine(
    label="MuJoCo Euler",
    note="in its own loop, rollout, with its controls handed over",
    peer=lambda scenario, step: MuJoCoPeer(scenario, Options(step=step)),
    settings=_settings,
)
