"""Orientation of a frame: the paper's low-priority task."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from qpsafe.tasks.clik import Clik
from qpsafe.tasks.rotation import euler_difference, euler_zyx, euler_zyx_rates, log3
from qpsafe.tasks.task import PoseTask, Task
from qpsafe.tasks.trajectory import Sample, Trajectory
from qpsafe.text.given import one_of

if TYPE_CHECKING:
    from qpsafe.robot.state import RobotState

Form = Literal["rotation vector", "euler"]


class OrientationTask(PoseTask):
    """Keep the orientation of a frame on its trajectory [rad].

    - ``"rotation vector"``: e = log(R_d Rᵀ) in world axes, without a singular orientation below half a turn.
    - ``"euler"``: e = differences of the paper's Euler angles φ, θ, ψ about z, y', x''; singular at θ = ±pi/2, where
      the Jacobian grows without bound. For comparison with the paper.

    Args:
        frame: Frame whose orientation is controlled.
        trajectory: Where it should be.
        gain: K_L [1/s]; the paper used 10.
        form: How the error is expressed.

    Raises:
        ConfigurationError: Unknown form, or a bad gain.
    """

    fixed = PoseTask.fixed | {"form"}
    rows = (3, 4, 5)
    name = "orientation"

    def __init__(self, frame: str, trajectory: Trajectory, gain: float = 10.0, form: Form = "rotation vector") -> None:
        one_of("OrientationTask", "form", form, get_args(Form))
        super().__init__(frame, trajectory, gain)
        self.form = form

    def error(self, value: NDArray[np.float64], sample: Sample) -> NDArray[np.float64]:
        """log(R_d Rᵀ), or differences of Euler angles, (3,) [rad]."""
        if self.form == "euler":
            return euler_difference(euler_zyx(sample.pose[:3, :3]), euler_zyx(value[:3, :3]))
        return log3(sample.pose[:3, :3] @ value[:3, :3].T)

    def jacobian(self, state: RobotState) -> NDArray[np.float64]:
        """Of the angular velocity, or of the Euler angles: E(φ)⁻¹ J_ω, (3, n)."""
        J = super().jacobian(state)
        return euler_zyx_rates(state.rotation(self.frame)) @ J if self.form == "euler" else J

    def velocity(self, error: NDArray[np.float64], sample: Sample) -> NDArray[np.float64]:
        """ω_d + K e, or E(φ_d)⁻¹ ω_d + K e, (3,)."""
        if self.form == "euler":
            return euler_zyx_rates(sample.pose[:3, :3]) @ sample.twist[3:] + self.gain * error
        return super().velocity(error, sample)

    @property
    def plain(self) -> bool:
        """See `PoseTask.plain`."""
        return type(self).clik is OrientationTask.clik and self.form == "rotation vector"

    def clik(self, state: RobotState, sample: Sample) -> Clik:
        """See `Task.clik`."""
        return Task.clik(self, state, sample) if self.form == "euler" else self.compiled_clik(state, sample)
