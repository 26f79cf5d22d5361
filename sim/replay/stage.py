"""The scene of a recorded run, put tick by tick into the states that were recorded; in the place of a plant."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from qpsafe.sim.recording.run_file import FPS, RunFile, RunFileError
from qpsafe.sim.replay.settings import Experiment


class Stage:
    """What a film or a viewer needs of a plant: the scene, its data and q.

    Attributes:
        scene: Of the run's experiment.
        data: The state shown last.
    """

    def __init__(self, run: RunFile, experiment: Experiment) -> None:
        """Prepare.

        Raises:
            RunFileError: The run holds no states, or those of another scene.
        """
        self.scene = experiment.scene
        self.data: Any = self.scene.make_data()
        try:
            self._qpos, self._mocap = run.arrays["state_qpos"], run.arrays["state_mocap"]
        except KeyError:
            raise RunFileError(f"{run.path}: it holds no states to look at") from None
        shapes = self._qpos.shape[1:], self._mocap.shape[1:]
        if shapes != ((self.scene.model.nq,), (self.scene.model.nmocap, 7)):
            raise RunFileError(f"{run.path}: its states do not fit the scene: {shapes}")
        self._every = max(round(1.0 / (FPS * run.header["dt"])), 1)

    @property
    def q(self) -> NDArray[np.float64]:
        """Joint positions, (n,) [rad]."""
        return self.data.qpos[self.scene.q_addresses]

    def show(self, k: int) -> bool:
        """Take the state of tick k, if one was recorded."""
        index, rest = divmod(k, self._every)
        if rest or index >= len(self._qpos):
            return False
        self.data.qpos[:] = self._qpos[index]
        self.data.mocap_pos[:], self.data.mocap_quat[:] = self._mocap[index, :, :3], self._mocap[index, :, 3:]
        mujoco.mj_kinematics(self.scene.model, self.data)
        return True
