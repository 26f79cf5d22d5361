"""What runs of the third experiment show: screws, contacts, what people cost in time; were promises kept?"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from qpsafe.sim.experiments.pick_place.experiment import PickRun
from qpsafe.sim.experiments.shared.report import Check, all_kept
from qpsafe.text.json_text import plain
from qpsafe.text.words import counted

STANDSTILL = 1e-3  # a robot that moves slower than this stands still [m/s]


@dataclass(frozen=True)
class PickFigures:
    """Figures of one run.

    Attributes:
        seed: Of the people.
        finished: Whether all cycles were done in time.
        delivered, missed, lost: Screws that came to rest in the box, grips of nothing, screws that came to rest
            elsewhere or are elsewhere at the end.
        taken, placed: Screws that people took out of the box and put into the support.
        duration: Of all cycles [s].
        cycle_times: From one release to the next [s].
        nearest: Smallest distance robot-person [m]; +inf without people.
        nearest_moving: The same while the robot moves faster than 1 mm/s.
        contacts: Ticks with a contact robot-person while the robot moves faster than 1 mm/s.
        touched: Ticks with a contact robot-person at all.
        clearance: Smallest distance robot-furniture [m].
        suspensions: How often the path was suspended.
        waiting: Time in which the path's clock did not run at full speed for danger's sake [s].
        danger: Largest CDF_n.
        unusual: Ticks with a message.
    """

    seed: int
    finished: bool
    delivered: int
    missed: int
    lost: int
    taken: int
    placed: int
    duration: float
    cycle_times: tuple[float, ...]
    nearest: float
    nearest_moving: float
    contacts: int
    touched: int
    clearance: float
    suspensions: int
    waiting: float
    danger: float
    unusual: int


def figures(run: PickRun, seed: int = 0) -> PickFigures:
    """Measure a run."""
    log, moving = run.log, run.motion > STANDSTILL
    touching = ~(log.person_distance > 0.0)  # NaN counts as contact
    times = run.cycle_times
    lost = run.count("lost") + sum(place == "elsewhere" for place in run.screws)
    return PickFigures(
        seed=seed,
        finished=run.finished,
        delivered=run.count("delivered"),
        missed=run.count("miss", "empty"),
        lost=lost,
        taken=run.count("take"),
        placed=run.count("place"),
        duration=float(times.sum()),
        cycle_times=tuple(times.tolist()),
        nearest=float(log.person_distance.min()),
        nearest_moving=float(log.person_distance[moving].min(initial=math.inf)),
        contacts=int((touching & moving).sum()),
        touched=int(touching.sum()),
        clearance=float(run.clearance.min()),
        suspensions=int((np.diff((log.phase == "suspended").astype(int), prepend=0) == 1).sum()),
        waiting=float((log.phase != "following").sum() * log.dt),
        danger=float(np.nanmax(log.cdf_n)),
        unusual=len({tick for tick, _ in log.messages}),
    )


def cost(found: PickFigures, alone: PickFigures) -> float:
    """What people cost per cycle [s]."""
    return (found.duration - alone.duration) / max(len(found.cycle_times), 1)


def spread(values: Sequence[float]) -> dict[str, float]:
    """Median, quartiles, smallest and largest."""
    array: NDArray[np.float64] = np.asarray(values, dtype=float)
    names = ("smallest", "quartile_1", "median", "quartile_3", "largest")
    return {name: float(np.quantile(array, q)) for name, q in zip(names, (0.0, 0.25, 0.5, 0.75, 1.0), strict=True)}


def promises(runs: Sequence[PickFigures], alone: PickFigures, cycles: int) -> list[Check]:
    """What the third experiment is to show, over all runs and the one without people.

    Args:
        runs: Figures of every seed.
        alone: Those of the run without people.
        cycles: How many a run was to do.
    """
    every = [*runs, alone]
    unfinished = sum(not item.finished for item in every)
    delivered = min(item.delivered for item in runs)
    wrong = sum(item.missed + item.lost for item in every)
    contacts, nearest = sum(item.contacts for item in runs), min(item.nearest_moving for item in runs)
    strikes = min(item.clearance for item in every)
    return [
        Check(
            f"{counted(cycles, 'cycle')} done",
            f"{len(every) - unfinished} of {counted(len(every), 'run')}",
            "all",
            unfinished == 0,
        ),
        Check("screws delivered, in the worst run", str(delivered), str(cycles), delivered == cycles),
        Check("screws missed or lost", str(wrong), "0", wrong == 0),
        Check(
            "ticks with robot-person contact faster than 1 mm/s",
            f"{contacts} (nearest {nearest:.3f} m)",
            "0",
            contacts == 0 and nearest > 0.0,
        ),
        Check("smallest distance robot-furniture", f"{1e3 * strikes:.1f} mm", "> 0", strikes > 0.0),
    ]


def to_dict(runs: Sequence[PickFigures], alone: PickFigures, checks: Sequence[Check]) -> dict[str, Any]:
    """For JSON.

    Args:
        runs: Figures of every seed.
        alone: Those of the run without people.
        checks: What was promised and measured.
    """
    costs = [cost(item, alone) for item in runs]
    return {
        "runs": [plain(asdict(item)) | {"cost_per_cycle": c} for item, c in zip(runs, costs, strict=True)],
        "without_people": plain(asdict(alone)),
        "cost_per_cycle": spread(costs),
        "duration": spread([item.duration for item in runs]),
        "checks": [check._asdict() for check in checks],
        "kept": all_kept(checks),
    }
