"""How soon a walker is in high danger, with approach velocities and without: python benchmarks/walkers_seen.py [FILE].

Somebody walks straight at the robot of the first experiment; from the first reading to CDF_n > Δ(1-ε). And what the
estimate makes of the noise of twenty Sharp sensors before something at rest.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

import qpsafe
from qpsafe.sensing.sensing import DistanceSensing
from qpsafe.sensing.sharp import SharpConverter
from qpsafe.sim.experiments.fast_person import at_speed
from qpsafe.sim.experiments.fixed.experiment import FixedExperiment
from qpsafe.sim.world.sharp import SharpModel, SharpSensors
from qpsafe.text.json_text import json_text


def delay(speed: float, velocities: bool) -> float:
    """From the first reading until danger is high [s].

    Args:
        speed: Of the walker [m/s].
        velocities: Whether approach velocities are estimated.
    """
    rules = qpsafe.SensingRules(velocities=velocities)
    story = at_speed(speed)
    log = FixedExperiment(qpsafe.load_robot("irb140"), story=story, duration=story.duration, rules=rules).run()
    high = qpsafe.Activation().suspend_above
    return float(log.time[np.argmax(log.cdf_n > high)] - log.time[np.argmax(np.isfinite(log.distances).any(axis=1))])


def noise(distance: float, unit: int) -> float:
    """Largest estimate of any of twenty noisy sensors before something at rest, once filters have settled [m/s].

    Args:
        distance: To it [m].
        unit: Seed of the sensors.
    """
    robot = qpsafe.load_robot("irb140")
    spots = qpsafe.load_spots(robot)
    assert spots is not None
    state, wire = robot.at(robot.home), robot.wire(robot.home, np.zeros(robot.nq))
    sensors, sensing = SharpSensors(len(spots), SharpModel(), unit), DistanceSensing(robot, spots, 0.004)
    converter = SharpConverter([fit.curve for fit in sensors.identified(spots.names)], np.array(spots.range_max))
    largest = 0.0
    for k in range(1000):
        sensing.update(state, wire, converter.distances(sensors.sample(np.full(len(spots), distance))))
        if k > 150:
            largest = max(largest, float(np.abs(sensing.memory[-1][:, 2]).max()))
    return largest


def main() -> None:
    """Measure, print and write."""
    walkers = {f"{v:.1f}": {"at_rest": delay(v, False), "estimate": delay(v, True)} for v in (1.6, 2.0)}
    still = {f"{d:.2f}": max(noise(d, unit) for unit in range(5)) for d in (0.5, 0.78)}
    found = {"walkers": walkers, "still": still}
    print(found)
    if len(sys.argv) > 1:
        Path(sys.argv[1]).write_text(json_text(found) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
