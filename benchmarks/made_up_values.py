"""Values played without a robot, for tests: outcomes that are functions of the values and of the encounter alone."""

from __future__ import annotations

import math

import numpy as np

from qpsafe.sim.tuning.objectives import Outcome, harm
from qpsafe.sim.tuning.play import Piece
from qpsafe.sim.tuning.values import Values


def play(piece: Piece) -> list[list[Outcome]]:
    """For each encounter the outcome of each of the values."""
    return [
        [outcome(piece.plan.seed_of(k), piece.plan.lag, values) for values in piece.values] for k in piece.encounters
    ]


def outcome(seed: int, lag: float, values: Values) -> Outcome:
    """Little Δ costs time, much costs harm; M/D is best at 0.03 s; a fast way back touches furniture."""
    hard, weight = np.random.default_rng(seed).random(2).tolist()
    late = math.log(values.mass[0] / values.damping[0] / 0.03)
    distance = 0.25 - 0.2 * hard - 0.1 * math.log(values.delta / 11.5) - 0.03 * late * late
    share = max(-distance, 0.0) * 20.0 * weight
    lost = 3.0 * weight * (11.5 / values.delta) ** 2 * (1.0 + 0.1 * late * late) * (0.5 + values.dwell)
    return Outcome(
        harm(share, distance), lost, distance <= 0.0, values.speed > 0.9 and hard > 0.5, False, 0.0, 0,
        round(20.0 * hard + 200.0 * lag / values.damping[0]),
    )  # fmt: skip
