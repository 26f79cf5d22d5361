"""The world in MuJoCo: scene, person, servo plant, simulated spots, experiments, recording, plots and video."""

from qpsafe.extras import require

require("sim", "the simulation", "mujoco", "matplotlib")
