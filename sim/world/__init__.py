"""The world in MuJoCo: scene, plant, sensors, true distances."""
