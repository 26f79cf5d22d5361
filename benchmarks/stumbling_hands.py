"""How fast the hands of those who stumble are, in the room: python benchmarks/stumbling_hands.py [FILE.json]."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

import qpsafe
from qpsafe.sim.campaign.people import EncounterModel
from qpsafe.sim.campaign.people.floor_plan import FloorPlan
from qpsafe.text.json_text import json_text

SEEDS, DT = 3000, 0.01


def peaks() -> list[float]:
    """Of every stumble of random encounters, the largest speed of a hand [m/s]."""
    model, robot = EncounterModel.load(), qpsafe.load_robot("irb140")
    x, y, z = (float(value) for value in robot.pose("tcp", robot.home)[:3, 3])
    plan, found = FloorPlan(-0.55, (x, y, z), 0.81), []
    for seed in range(SEEDS):
        draw = model.random(seed)
        if "stumble" not in model.kinds(draw):
            continue
        story = model.encounter(draw, plan)
        times = np.arange(0.0, story.duration, DT)
        for actor, table in zip(story.people, story.table.person, strict=True):
            if any(step.do == "stumble" for step in table.step):
                hands = actor.poses_at(times).ends[:, [10, 16], 1]
                found.append(float(np.linalg.norm(np.diff(hands, axis=0), axis=-1).max() / DT))
    return found


def main() -> None:
    """Print and write it."""
    speeds = peaks()
    found = {"stumbles": len(speeds), "median": float(np.median(speeds))}
    found |= {"p95": float(np.percentile(speeds, 95)), "fastest": max(speeds)}
    print(found)
    if len(sys.argv) > 1:
        Path(sys.argv[1]).write_text(json_text(found) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
