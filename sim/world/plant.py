"""The robot as a dynamic plant under gravity, with the joint servo that a controller's references drive.

The servo is a computed-torque law: with the error e = q_ref - q and the joint-space inertia M(q),

    tau = M(q) (omega^2 e + 2 zeta omega de/dt) + bias(q, dq/dt) - passive(q, dq/dt),

clipped to the actuators' limits, evaluated at every physics step. Seen from a reference, every joint is then a
second-order system of natural frequency omega, whatever the arm's pose; feed-forward of the reference's acceleration is
left out, as position and velocity are all that an IRC5 receives.

A reference (q_ref, dq_ref) applied at time t is followed along q_ref + dq_ref (time - t) until the next one comes, for
one control period at most: after that the servo holds its end. So 250 Hz references make no staircase at 1 kHz.
"""

from __future__ import annotations

import math
from collections import deque
from typing import Any

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from qpsafe.errors import ConfigurationError, QpsafeError
from qpsafe.sim.world.scene import Scene

Array = NDArray[np.float64]


class SimulationFailedError(QpsafeError, RuntimeError):
    """MuJoCo warned that the simulation is not valid any more.

    Attributes:
        time: When [s].
        warning: MuJoCo's name of the warning, e.g. "BADQACC".
        count: How often it was raised since the last reset.
    """

    def __init__(self, time: float, warning: str, count: int) -> None:
        self.time = time
        self.warning = warning
        self.count = count
        super().__init__(f"simulation failed at t = {time:.4f} s: MuJoCo warning {warning} ({count}x)")


class Plant:
    """The robot of a scene, moved by torques.

    Attributes:
        scene: The scene.
        data: Its state; the geom poses in it are those of the present `q` after every call.
        period: Control period [s].
        lag: Delay between `apply` and the servo's using it [s].
        rejected: References that were not applied since the last reset because they were not finite or misshapen.
        torque: Torques of the last physics step, (n,) [N m].
        torque_limits: Lower and upper limits of the torques, (n, 2) [N m].
        saturated: Physics steps with a torque at its limit since the last reset.
    """

    def __init__(
        self,
        scene: Scene,
        *,
        lag: float = 0.0,
        period: float = 0.004,
        omega: float = 100.0,
        zeta: float = 1.0,
        q: ArrayLike | None = None,
    ) -> None:
        """Make the plant and put it at rest.

        Args:
            scene: From `build_scene`.
            lag: Control lag, rounded to whole physics steps; 0.010 to 0.020 for EGM [s].
            period: Control period, a whole number of physics steps [s].
            omega: Natural frequency of the servo [rad/s].
            zeta: Its damping ratio.
            q: Where it starts, (n,) [rad]; default the robot's home.

        Raises:
            ConfigurationError: A value is out of range, or its motors are too weak to hold the robot where it starts.
        """
        step = scene.model.opt.timestep
        self._substeps = round(period / step) if math.isfinite(period) else 0
        if not (self._substeps >= 1 and abs(self._substeps * step - period) < 1e-9):
            raise ConfigurationError("Plant", "period", period, f"a whole number of physics steps of {step} s")
        if not 0.0 <= lag <= 1.0:
            raise ConfigurationError("Plant", "lag", lag, "0 to 1 s")
        if not 0.0 < omega * step <= 0.3:  # above, the sampled servo loses its damping
            raise ConfigurationError("Plant", "omega", omega, f"above 0 and at most {0.3 / step:g} rad/s")
        if not 0.0 < zeta <= 2.0:
            raise ConfigurationError("Plant", "zeta", zeta, "above 0, at most 2")
        self.scene, self.period = scene, period
        self._lag_steps = round(lag / step)
        self.lag = self._lag_steps * step
        self._stiffness, self._damping = omega**2, 2.0 * zeta * omega
        model, motors = scene.model, scene.actuators
        if not (model.actuator_ctrllimited[motors].all() and (model.actuator_gear[motors, 0] == 1.0).all()):
            expected = "motors with gear 1 and a ctrlrange in N m"
            raise ConfigurationError(scene.robot.model_path, "actuator", scene.robot.joint_names, expected)
        self.torque_limits = scene.model.actuator_ctrlrange[scene.actuators].copy()
        self.data: Any = mujoco.MjData(scene.model)
        self._acceleration, self._force = np.zeros((2, scene.model.nv))
        self.reset(scene.robot.home if q is None else q)
        self._check_strength()

    def reset(self, q: ArrayLike) -> None:
        """Put the robot at rest at q, (n,) [rad], at time 0, and hold it there.

        Raises:
            ConfigurationError: q is misshapen or not finite.
        """
        q = self.scene.robot.joint_vector(q, "q").copy()
        if not np.isfinite(q).all():
            raise ConfigurationError("Plant.reset", "q", q, "finite numbers [rad]")
        mujoco.mj_resetData(self.scene.model, self.data)
        self.data.qpos[self.scene.q_addresses] = q
        mujoco.mj_forward(self.scene.model, self.data)
        self.rejected = self.saturated = 0
        self.torque = np.zeros_like(q)
        # The reference now: start, velocity and physics steps since then; and those on their way through the lag.
        self._reference: tuple[Array, Array] = (q, np.zeros_like(q))
        self._age = 0
        self._steps = 0
        self._pending: deque[tuple[int, Array, Array]] = deque()

    def _check_strength(self) -> None:
        """Refuse a robot that would sink where it starts, whatever it is told."""
        held = np.abs(self.data.qfrc_bias - self.data.qfrc_passive)[self.scene.v_addresses]
        most = np.abs(self.torque_limits).min(axis=1)
        for name, needed, limit in zip(self.scene.robot.joint_names, held, most, strict=True):
            if needed > limit * (1.0 + 1e-9):
                found = f"{limit:.3g} N m"
                expected = f"at least {needed:.3g} N m, which hold it in the posture where it starts"
                raise ConfigurationError(self.scene.robot.model_path, f"torque of joint {name}", found, expected)

    @property
    def q(self) -> Array:
        """Measured joint positions, (n,) [rad]; a copy."""
        return self.data.qpos[self.scene.q_addresses]

    @property
    def qd(self) -> Array:
        """Measured joint velocities, (n,) [rad/s]; a copy."""
        return self.data.qvel[self.scene.v_addresses]

    @property
    def time(self) -> float:
        """Simulated time since the last reset [s]."""
        return float(self.data.time)

    @property
    def reference(self) -> tuple[Array, Array]:
        """What the servo follows at this moment: position and velocity, (n,) each [rad, rad/s]."""
        q, qd = self._reference
        if self._age < self._substeps:
            return q + qd * (self._age * self.scene.model.opt.timestep), qd
        return q + qd * self.period, np.zeros_like(qd)

    def apply(self, q_ref: ArrayLike, qd_ref: ArrayLike) -> bool:
        """Give the servo a new reference, valid from now on (plus the lag).

        Args:
            q_ref: Position now, (n,) [rad].
            qd_ref: Velocity from now on, (n,) [rad/s].

        Returns:
            Whether it was accepted. One that is misshapen or not finite is counted in `rejected` and not applied.
        """
        try:
            q, qd = np.array(q_ref, dtype=np.float64), np.array(qd_ref, dtype=np.float64)
        except (TypeError, ValueError):
            q = qd = np.empty(0)
        n = self.scene.robot.nq
        if q.shape != (n,) or qd.shape != (n,) or not (np.isfinite(q).all() and np.isfinite(qd).all()):
            self.rejected += 1
            return False
        self._pending.append((self._steps + self._lag_steps, q, qd))
        return True

    def advance(self, duration: float | None = None) -> None:
        """Simulate one control period, or `duration` rounded to whole physics steps [s].

        Raises:
            SimulationFailedError: MuJoCo raised a warning.
        """
        model, data = self.scene.model, self.data
        steps = self._substeps if duration is None else round(duration / model.opt.timestep)
        for _ in range(steps):
            while self._pending and self._pending[0][0] <= self._steps:
                due, q, qd = self._pending.popleft()
                self._reference, self._age = (q, qd), self._steps - due
            mujoco.mj_step1(model, data)
            self._servo()
            mujoco.mj_step2(model, data)
            self._steps += 1
            self._age += 1
        counts = data.warning.number
        if counts.any():
            index = int(np.flatnonzero(counts)[0])
            name = mujoco.mjtWarning(index).name.removeprefix("mjWARN_")
            raise SimulationFailedError(self.time, name, int(counts[index]))
        mujoco.mj_kinematics(model, data)

    def _servo(self) -> None:
        """Torques for the present state (after mj_step1) into `data.ctrl`."""
        scene, data = self.scene, self.data
        q_ref, qd_ref = self.reference
        error = q_ref - data.qpos[scene.q_addresses]
        error_rate = qd_ref - data.qvel[scene.v_addresses]
        self._acceleration[scene.v_addresses] = self._stiffness * error + self._damping * error_rate
        mujoco.mj_mulM(scene.model, data, self._force, self._acceleration)
        wanted = (self._force + data.qfrc_bias - data.qfrc_passive)[scene.v_addresses]
        low, high = self.torque_limits.T
        # Bad states give bad torques; MuJoCo's own check then ends the run, so nothing is hidden by the clip.
        self.torque = np.clip(wanted, low, high)
        self.saturated += int(((self.torque <= low) | (self.torque >= high)).any())
        data.ctrl[scene.actuators] = self.torque
