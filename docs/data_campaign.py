"""Write docs/data/speed.json and docs/data/worst.json on an idle machine: python docs/data_campaign.py [TRIALS].

How fast encounters are simulated, by one process and two; and for every controller the search for its worst encounter,
beside as many random ones. The campaign itself is `qpsafe campaign --seed 1000000 --out FOLDER`, its report.json the
file docs/data/campaign.json.
"""

from __future__ import annotations

import sys
from pathlib import Path
from time import perf_counter

from qpsafe.sim.campaign.plan import CONTROLLERS, Plan
from qpsafe.sim.campaign.runner import run_campaign
from qpsafe.sim.campaign.speed import engine_speed
from qpsafe.sim.campaign.worst.cases import find_worst
from qpsafe.text.json_text import json_text

DATA = Path(__file__).resolve().parent / "data"
SEED = 2_000_000  # nothing was tuned on these
SLOW = ("stop", "stop_perfect_sight", "scaling", "barrier")  # played tick by tick: a third of the trials


def rate(workers: int, trials: int = 240) -> float:
    """Trials of the default controller a second, the first quarter not counted: processes start meanwhile."""
    times: dict[int, float] = {}
    plan = Plan(trials=trials, controllers=("default",), seed=SEED)
    run_campaign(plan, workers=workers, progress=lambda done, _: times.setdefault(done, perf_counter()))
    first = min(done for done in times if done >= trials // 4)
    return (trials - first) / (times[trials] - times[first])


def main() -> None:
    """Measure, search, and write as soon as there is something to write."""
    one, two = rate(1), rate(2)
    speed = engine_speed(Plan(seed=SEED), mujoco=True)
    figures = {**speed._asdict(), "ratio": speed.ratio, "trials_a_second": one, "two_workers": two / one}
    (DATA / "speed.json").write_text(json_text(figures) + "\n", encoding="utf-8")
    print(figures, flush=True)
    budget, table = int(sys.argv[1]) if len(sys.argv) > 1 else 1000, {}
    for name in CONTROLLERS:
        trials = budget // 3 if name in SLOW else budget
        found = find_worst(Plan(seed=SEED), name, trials, workers=2)
        table[name] = {
            "budget": trials, "searched": len(found.searched), "random": len(found.random), "new": len(found.new),
            "worst": found.worst.harm, "worst_random": found.worst_random.harm, "sentence": found.sentence,
        }  # fmt: skip
        print(name, found.sentence, flush=True)
        (DATA / "worst.json").write_text(json_text(table) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
