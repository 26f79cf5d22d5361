"""How fast encounters are simulated on this machine: by the engine, and by MuJoCo with the controller in a loop."""

from __future__ import annotations

from statistics import median
from time import process_time
from typing import NamedTuple

import numpy as np

from qpsafe.sim.campaign.plan import Plan
from qpsafe.sim.campaign.trials.closest import closest
from qpsafe.sim.campaign.trials.in_mujoco import reference
from qpsafe.sim.campaign.trials.meeting import meeting
from qpsafe.sim.campaign.trials.servo import DT
from qpsafe.sim.campaign.trials.trial import recorded

LOOP = 250  # ticks of the MuJoCo loop in a block


class Speed(NamedTuple):
    """Simulated seconds a second of processor time of one core, medians over encounters that take turns.

    Attributes:
        engine: People, rays of all spots, the whole tick and true distances, for encounters that are planned already.
        planned: The same, with planning what people do.
        mujoco: MuJoCo's rays, distances and dynamics, and the controller, in a Python loop; NaN if it was not timed.
    """

    engine: float
    planned: float
    mujoco: float

    @property
    def ratio(self) -> float:
        """Engine over MuJoCo."""
        return self.engine / self.mujoco


def engine_speed(plan: Plan | None = None, trials: int = 9, *, mujoco: bool = False) -> Speed:
    """Time the default controller in the first encounters of a plan; what is compiled, or made once, is ready before.

    Args:
        plan: Of the campaign; the default one if None.
        trials: How many encounters.
        mujoco: Whether to time MuJoCo too, in turn with the engine.
    """
    plan = Plan() if plan is None else plan
    for trial in range(len(plan.motions)):
        met = meeting(plan, trial)
        recorded(plan, met, "default")
    engine, planned, loop = [], [], []
    for trial in range(trials):
        begin = process_time()
        met = meeting(plan, trial)
        ready = process_time()
        simulated = DT * len(met.tracks)
        tracks = met.story.track(np.arange(0.0, simulated - 0.5 * DT, DT))
        run = recorded(plan, met._replace(tracks=tracks), "default")
        closest(met.station, run.q, tracks, 1.0)
        end = process_time()
        engine.append(simulated / (end - ready))
        planned.append(simulated / (end - begin))  # tracks twice: what planning takes is a little less
        if mujoco:
            begin = process_time()
            reference(met, "default", dynamics=True, ticks=0)
            ready = process_time()
            reference(met, "default", dynamics=True, ticks=LOOP)
            loop.append(DT * LOOP / (process_time() - ready - (ready - begin)))
    return Speed(median(engine), median(planned), median(loop) if loop else float("nan"))
