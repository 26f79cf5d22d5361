"""The world in MuJoCo: scene, person, servo plant, simulated spots, experiments, recording, plots and video."""
