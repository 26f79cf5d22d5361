"""Plausible random rows of trials, for trying what comes after trials: files, executors, statistics, the report.

No robot and nobody is simulated: a controller has a probability of contact and a price, and trials share their luck.
"""

from __future__ import annotations

import os
import re
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from qpsafe.sim.campaign.plan import Plan

#: Controller -> probability of contact, of moving then, towards then; work lost [s]; what evasion adds to distance [m].
MANNERS = {
    "none": (0.45, 0.8, 0.10, 0.0, 0.00),
    "stop": (0.30, 0.1, 0.02, 1.9, 0.01),
    "stop_perfect_sight": (0.05, 0.1, 0.02, 2.4, 0.05),
    "nullspace": (0.20, 0.6, 0.01, 3.6, 0.03),
    "weighted": (0.19, 0.6, 0.01, 3.5, 0.03),
    "strict": (0.18, 0.6, 0.00, 3.7, 0.04),
    "paper": (0.18, 0.6, 0.00, 3.6, 0.04),
    "default": (0.15, 0.5, 0.00, 3.2, 0.05),
}
#: Options of a command that plays some of them.
FEW = ["--trials", "12", "--workers", "1", "--controllers", "none,stop,default"]
PARTS = ("torso", "head", "upper_arm", "forearm", "hand", "thigh")
LIMITS = {"torso": 1.6, "head": 0.11, "upper_arm": 1.5, "forearm": 1.3, "hand": 0.49, "thigh": 1.9}


def run(plan: Plan, trial: int) -> list[dict[str, Any]]:
    """Rows of all controllers, from the trial's seed alone."""
    luck, unseen = np.random.default_rng(plan.seed_of(trial)).uniform(size=2)
    return [row(plan, trial, name, luck, unseen > 0.9) for name in plan.controllers]


def run_and_die_once(plan: Plan, trial: int) -> list[dict[str, Any]]:
    """The same; the first process that plays trial 5 with a mark there dies of it."""
    mark = Path(os.environ["MADE_UP_MARK"])
    if trial == 5 and mark.exists():
        mark.unlink()
        os._exit(1)
    return run(plan, trial)


def run_and_die(plan: Plan, trial: int) -> list[dict[str, Any]]:
    """The same; no process survives trial 5."""
    if trial == 5:
        os._exit(1)
    return run(plan, trial)


def run_slowly(plan: Plan, trial: int) -> list[dict[str, Any]]:
    """The same, as if it were work."""
    time.sleep(0.02)
    return run(plan, trial)


def row(plan: Plan, trial: int, name: str, luck: float, unseen: bool) -> dict[str, Any]:
    """A row.

    Args:
        plan: Of the campaign.
        trial: Its number.
        name: Of the controller.
        luck: Of the trial, shared by its controllers, 0 to 1.
        unseen: Whether nobody could see them coming.
    """
    from qpsafe.sim.campaign.trials.rows import COLUMNS

    rng = np.random.default_rng((plan.seed_of(trial), sum(map(ord, name))))
    chance, moves, approaches, lost, added = MANNERS.get(name, MANNERS["default"])
    share = 0.8 * luck + 0.2 * float(rng.uniform())  # mostly the people's doing
    contact, near = bool(share < chance), max(share - chance, 0.0)
    moving = contact and bool(rng.uniform() < moves)
    towards = moving and bool(rng.uniform() < approaches / moves)
    clamped = contact and bool(rng.uniform() < 0.03)
    kind = "towards" if towards else str(rng.choice(("away", "sideways"))) if moving else "rest"
    nan = float("nan")
    values: dict[str, Any] = {
        column.name: {int: 0, float: nan, bool: False, str: ""}[column.kind] for column in COLUMNS
    }
    simulated = float(rng.uniform(6.0, 9.0))
    distance = -float(rng.uniform(0.0, 0.02)) if contact else 0.5 * near + added * near + 1e-3
    lost = min(float(rng.gamma(2.0, lost / 2.0)) if lost else 0.0, simulated)
    values |= {
        "trial": trial,
        "seed": plan.seed_of(trial),
        "motion": plan.motions[trial % len(plan.motions)],
        "controller": name,
        "sensor": "perfect" if "perfect" in name else plan.sensor,
        "simulated": simulated,
        "contact_class": ("clamped" if clamped else kind) if contact else "none",
        "contact": contact,
        "moving": moving,
        "towards": towards,
        "clamped": clamped,
        "distance": distance,
        "distance_time": float(rng.uniform(2.0, 5.0)),
        "under_sp": float(rng.gamma(2.0, 0.2)),
        "lost_time": lost,
        "progress": 1.0 - lost / simulated,
        "stops": int(rng.poisson(1.2)),
        "suspensions": int(rng.poisson(3.0)) if added > 0.02 else 0,
        "path_error": float(rng.gamma(2.0, 0.002)),
        "reversals": int(rng.poisson(5.0)),
        "furniture": bool(added > 0.02 and rng.uniform() < 0.03),
        "furniture_distance": float(rng.uniform(0.005, 0.2)),
        "self_distance": float(rng.uniform(0.02, 0.3)),
        "limit_excess": 0.0,
        "sight_in_time": not unseen,
        "near_seen": contact and bool(rng.uniform() < 0.6),
    }
    if not unseen:
        values |= {"first_sight": float(rng.uniform(0.5, 3.0)), "first_sight_distance": float(rng.uniform(0.2, 0.8))}
    if contact:
        part = str(rng.choice(PARTS))
        speed = 0.2 + float(rng.gamma(3.0, 0.2))
        energy = 0.5 * 2.0 * speed**2 * (0.5 if added else 1.0)
        values |= {
            "contact_time": values["distance_time"],
            "contact_region": part,
            "contact_frame": "link_4",
            "robot_speed": float(rng.uniform(0.1, 0.6)) if moving else 0.0,
            "towards_speed": float(rng.uniform(0.1, 0.4)) if towards else 0.0,
            "closing_speed": speed,
            "energy": energy,
            "energy_limit": LIMITS[part],
            "energy_share": energy / LIMITS[part],
            "force": 100.0 * speed,
            "force_limit": 140.0,
        }
    values["search"] = values["energy_share"] if contact else -max(distance, 0.0)
    return values


def without_times(report: str) -> str:
    """A report, HTML or JSON, without what differs between two runs of the same trials."""
    return re.sub(r'"engine": \{.*?\}|<p class="soft" id="times">.*?</p>', "", report, flags=re.DOTALL)
