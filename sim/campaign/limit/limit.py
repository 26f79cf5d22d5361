"""What a controller could have reached in a trial: the best motion with foresight from its first detection on.

A lower bound of what is possible: a motion that was found, with the same arm, the same state and the same limits, by
somebody who knows in advance how everybody will move. Better ones may exist.
"""

from __future__ import annotations

from math import inf, nan
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from qpsafe.sim.campaign.limit.escape import Escape
from qpsafe.sim.campaign.limit.row import Limit
from qpsafe.sim.campaign.limit.search import EVALUATIONS, best_way
from qpsafe.sim.campaign.trials.meeting import meeting
from qpsafe.sim.campaign.trials.servo import DT
from qpsafe.sim.campaign.trials.sight import first_seen
from qpsafe.sim.campaign.trials.trial import recorded
from qpsafe.text.given import whole

if TYPE_CHECKING:
    from qpsafe.sim.campaign.plan import Plan
    from qpsafe.sim.campaign.trials.meeting import Case, Meeting
    from qpsafe.sim.campaign.trials.recording import Recording

Array = NDArray[np.float64]

ALONE = "none"  # the controller that does nothing about people
AFTER = (0, 25, 50, 100, 200, 400, 800)  # ticks after the first detection at which the run's own positions are goals
LEAST = 1e-3  # a limit that is no better than no control by so much has no share [m]


class Best(NamedTuple):
    """A limit and the motion that reaches it.

    Attributes:
        limit: In numbers.
        motion: Measured q and q̇, reference q and q̇ (4, T, n) [rad, rad/s]; None where there is none.
        run: The controller's.
    """

    limit: Limit
    motion: Array | None
    run: Recording


def limit_of(plan: Plan, what: int | Case, controller: str, evaluations: int = EVALUATIONS) -> Best:
    """The best motion with foresight in a trial. Deterministic: the same plan and trial give the same motion.

    Args:
        plan: The campaign.
        what: Number of a trial from 0, or a case that the search for the worst has found.
        controller: Whose state at first detection it begins in.
        evaluations: Motions to try.

    Raises:
        MissingExtraError: cma is not installed.
        ConfigurationError: No number of motions.
    """
    evaluations = whole("limit_of", "evaluations", evaluations, "a whole number >= 1", 1)
    met = meeting(plan, what)
    run, alone = recorded(plan, met, controller), recorded(plan, met, ALONE)
    first, end = _first_sight(run, met), len(run.q) - 1
    ever = first <= end
    escape = Escape(met.station, met.tracks, run, min(first, end), plan.lag)
    own, other = escape.people.smallest(run.q), escape.people.smallest(alone.q)
    contact, in_time = own <= 0.0, ever and escape.before > 0.0
    limit, reached, motion, tried = nan, nan, None, 0
    if in_time:
        goals = [run.q[min(first + k, end)] for k in AFTER]
        way, tried = best_way(escape, goals, met.seed, evaluations)
        motions = [escape.motion(way.goals, way.since), _whole(run)]
        if escape.begins(_whole(alone)):
            motions.append(_whole(alone))
        worth = [escape.distance(one) for one in motions]
        best = int(np.argmax(worth))
        if worth[best] > -inf:
            limit, motion = worth[best], motions[best]
        if limit - other > LEAST:
            reached = (own - other) / (limit - other)
    return Best(
        Limit(
            trial=met.trial, seed=met.seed, motion=met.station.motion, controller=controller,
            first_sight=first * DT if ever else nan, distance=own, alone=other, limit=limit,
            fixed=escape.fixed if ever else nan, contact=contact, seen=in_time or not contact,
            avoidable=contact and limit > 0.0, reached=reached, evaluations=tried,
        ),
        motion, run,
    )  # fmt: skip


def _whole(run: Recording) -> Array:
    return np.array((run.q, run.qd, run.reference_q, run.reference_qd))


def _first_sight(run: Recording, met: Meeting) -> int:
    """The first tick at which anybody is seen; the number of ticks if nobody ever is."""
    owners = [k for k, person in enumerate(met.story.persons) if person.board is not None]
    return min(first_seen(run.points, met.tracks, owners))
