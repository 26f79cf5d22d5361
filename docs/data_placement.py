"""Write docs/data/place-encounters.json: is the part of people that is nearest seen, as they come to a robot at work?

`qpsafe place` draws people who stand around. Here they come as in a campaign (no seed of which is used to judge
controllers), and the robot works as if nobody were there: python docs/data_placement.py.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

import qpsafe
from qpsafe.ranging.sensor import RangeSensor
from qpsafe.sensing.skin.spots import SpotArray, detected_points, load_spots, rays_in_world
from qpsafe.sim.campaign.plan import Plan
from qpsafe.sim.campaign.trials.closest import closest
from qpsafe.sim.campaign.trials.meeting import meeting
from qpsafe.sim.campaign.trials.trial import recorded
from qpsafe.sim.engine.spot_rays import SpotReader
from qpsafe.sim.engine.spot_table import SpotTable
from qpsafe.text.json_text import json_text

FILE = Path(__file__).resolve().parent / "data" / "place-encounters.json"
ROBOT, TRIALS, SEED = "irb140", 90, 987_654_321
NEAR, EVERY, MOST = 0.5, 25, 8  # instants with somebody this near [m], at least so many ticks apart, of one encounter
WITHIN = (0.1, 0.3)  # of a seen point [m]; the campaign calls a touched part seen within 0.3 m


def spots_of(sensors: list[RangeSensor]) -> SpotArray:
    """Zones as spots, each with its cone."""
    frames = [sensor.mount for sensor in sensors for _ in sensor.directions]
    return SpotArray(
        names=tuple(frames),
        links=np.zeros(len(frames), dtype=np.int64),
        frames=tuple(frames),
        positions=np.concatenate([np.tile(sensor.pose[:3, 3], (len(sensor), 1)) for sensor in sensors]),
        directions=np.concatenate([sensor.directions @ sensor.pose[:3, :3].T for sensor in sensors]),
        range_min=np.concatenate([np.full(len(sensor), sensor.range_min) for sensor in sensors]),
        range_max=np.concatenate([np.full(len(sensor), sensor.range_max) for sensor in sensors]),
        field_of_view=np.concatenate([2.0 * sensor.half_angle for sensor in sensors]),
    )


def misses(sets: Mapping[str, SpotArray], trials: int = TRIALS) -> tuple[dict[str, Any], list[str]]:
    """How far the nearest part of people is from the points that are seen of them.

    Args:
        sets: Sensors by name.
        trials: Encounters.

    Returns:
        Of each set that distance at every instant (m,) [m], +inf where nobody is seen; and the parts (m,).
    """
    robot = qpsafe.load_robot(ROBOT)
    plan = Plan(robot=ROBOT, trials=trials, seed=SEED, controllers=("none",))
    mounts = {name: spots.mounting(robot) for name, spots in sets.items()}
    found: dict[str, list[float]] = {name: [] for name in sets}
    parts: list[str] = []
    for trial in range(trials):
        met = meeting(plan, trial)
        run = recorded(plan, met, "none")
        near = closest(met.station, run.q, met.tracks, 2.0 * NEAR)
        ticks = np.flatnonzero(near.distance < NEAR)[::EVERY]
        readers = {
            name: SpotReader(met.station.world, SpotTable.of(met.station.scene, spots)) for name, spots in sets.items()
        }
        for k in ticks[:: -(-len(ticks) // MOST) or 1]:
            poses, people = robot.at(run.q[k]).body_poses(), met.tracks.row(k)
            names, segment = met.tracks.names, int(near.segment[k])
            parts.append(names[segment] if segment < len(names) else "board")
            for name, reader in readers.items():
                distances, hits = reader.read(poses, people)
                seen = hits >= len(met.station.world.names)
                origins, directions = rays_in_world(poses, *mounts[name])
                points = detected_points(origins[seen], directions[seen], distances[seen])
                away = np.linalg.norm(points - near.on_person[k], axis=1)
                found[name].append(float(away.min(initial=np.inf)))
    return {name: np.array(values) for name, values in found.items()}, parts


def main() -> None:
    """Measure the bundled sensors."""
    robot = qpsafe.load_robot(ROBOT)
    spots, arrays = load_spots(robot), qpsafe.load_range_sensors(robot)
    assert spots is not None
    found, parts = misses({"spots": spots, "vl53l5cx": spots_of(arrays)})
    hands = np.array(parts) == "hand"
    report: dict[str, Any] = {"robot": ROBOT, "trials": TRIALS, "seed": SEED, "instants": len(parts)}
    report |= {"hands": int(hands.sum()), "within": list(WITHIN)}
    for name, away in found.items():
        # no limits: instants of one encounter are not independent of each other
        report[name] = {
            what: [round(float((away[chosen] <= within).mean()), 4) for within in WITHIN]
            for what, chosen in (("all", np.ones(len(away), dtype=bool)), ("hand", hands))
        }
    FILE.write_text(json_text(report, indent=1) + "\n", encoding="utf-8")
    print(json_text(report), file=sys.stderr)


if __name__ == "__main__":
    main()
