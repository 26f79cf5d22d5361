"""Random encounters through the campaign's engine and through MuJoCo, compared tick by tick; writes JSON.

    python benchmarks/engine_against_mujoco.py --trials 200 --out docs/data/engine.json

Up to the first reading that one of the two has and the other has not (a ray that grazes an edge), joint references are
compared; readings where both hit, and distances where robot and people are apart, are compared at every tick up to
there. With --dynamics the robot of the reference is moved by torques, and only how far it is off is told.
"""

from __future__ import annotations

import argparse
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from qpsafe.text.json_text import json_text

EVERY = 5  # ticks between two distances


def compared(
    trial: int, dynamics: bool = False, ticks: int | None = None, controller: str = "default"
) -> dict[str, Any]:
    """Differences in one trial; trials are those of a campaign whose first seed is 0."""
    from qpsafe.sim.campaign.plan import Plan
    from qpsafe.sim.campaign.trials.closest import closest
    from qpsafe.sim.campaign.trials.in_mujoco import reference
    from qpsafe.sim.campaign.trials.meeting import meeting
    from qpsafe.sim.campaign.trials.senses import Senses
    from qpsafe.sim.campaign.trials.trial import recorded

    plan = Plan(controllers=(controller,))
    met = meeting(plan, trial)
    run, other = (
        recorded(plan, met, controller),
        reference(met, controller, dynamics=dynamics, every=EVERY, ticks=ticks),
    )
    count = len(other.q)
    if dynamics:
        near = closest(met.station, run.q, met.tracks).distance[:count:EVERY]
        off = float(np.abs(run.q[:count] - other.q).max())
        return {"trial": trial, "ticks": count, "joints": off, "contact": bool(near.min() <= 0.0),
                "contact_there": bool(other.distance.min() <= 0.0)}  # fmt: skip
    senses = Senses(met.station, met.tracks, "ideal", 0)
    found = np.array([senses.distances(run.q[k], k) for k in range(count)])
    hit, seen = np.isfinite(found), np.isfinite(other.readings)
    grazed = np.flatnonzero((hit != seen).any(axis=1))
    last = int(grazed[0]) if len(grazed) else count
    both = (hit & seen)[:last]
    apart = np.abs(found[:last][both] - other.readings[:last][both])
    graze = apart > 1e-6  # another surface was met first
    near = closest(met.station, run.q, met.tracks, 1.0).distance[:last:EVERY]
    there = other.distance[: len(near)]
    far = np.isfinite(near) & np.isfinite(there) & (near > 0.0)
    return {
        "trial": trial,
        "ticks": count,
        "compared": last,
        "hits": int(both.sum()),
        "grazes": int((hit != seen)[: last + 1].sum()) + int(graze.sum()),
        "readings": float(apart[~graze].max(initial=0.0)),
        "references": float(np.abs(run.reference_q[:last] - other.reference_q[:last]).max(initial=0.0)),
        "distances": float(np.abs(near[far] - there[far]).max(initial=0.0)),
        "signs": int(((near <= 0.0) != (there <= 0.0)).sum()),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--trials", type=int, default=200)
    parser.add_argument("--dynamics", action="store_true", help="move the reference's robot by torques")
    parser.add_argument("--controller", default="default", help="of both, by name")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--out", type=Path, default=Path("engine.json"))
    given = parser.parse_args()
    with ProcessPoolExecutor(given.workers) as pool:
        rows = list(
            pool.map(
                partial(compared, dynamics=given.dynamics, controller=given.controller),
                range(given.trials),
                chunksize=4,
            )
        )
    if given.dynamics:
        contacts = {"both": 0, "engine": 0, "mujoco": 0}
        for row in rows:
            key = {(True, True): "both", (True, False): "engine", (False, True): "mujoco"}
            if (row["contact"], row["contact_there"]) in key:
                contacts[key[row["contact"], row["contact_there"]]] += 1
        table = {"trials": len(rows), "joints_max": max(row["joints"] for row in rows),
                 "joints_median": float(np.median([row["joints"] for row in rows])), "contacts": contacts}  # fmt: skip
    else:
        sums = {key: sum(row[key] for row in rows) for key in ("ticks", "compared", "hits", "grazes", "signs")}
        worst = {key: max(row[key] for row in rows) for key in ("readings", "references", "distances")}
        table = {"trials": len(rows)} | sums | worst
    given.out.parent.mkdir(parents=True, exist_ok=True)
    given.out.write_text(json_text(table) + "\n", encoding="utf-8")
    print(json_text(table))


if __name__ == "__main__":
    main()
