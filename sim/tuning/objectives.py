"""What is minimised, and what no values may do: harm, work lost, and the constraints.

Harm is h of `qpsafe.sim.campaign.trials.harm`. Work lost is the path time that is done where nobody comes less what
was done [s]. Both are means over encounters.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from qpsafe.sim.campaign.trials.harm import harm

#: How often joints may turn round, against the present values on the same encounters: times, plus.
CHATTER, CHATTER_LAGGED = (1.25, 2.0), (1.5, 2.0)


class Outcome(NamedTuple):
    """What counts of an encounter.

    Attributes:
        harm: h.
        lost: Path time lost [s].
        contact: With somebody.
        furniture: With furniture or the floor.
        itself: Of the robot's own links.
        excess: Of the reference over a limit, 0 for none.
        bad: Ticks that the controller called bad.
        reversals: Turns of the joints' commanded speeds.
    """

    harm: float
    lost: float
    contact: bool
    furniture: bool
    itself: bool
    excess: float
    bad: int
    reversals: int

    @classmethod
    def of(cls, row: Mapping[str, Any]) -> Outcome:
        """Of a campaign's row."""
        return cls(
            float(harm(row["energy_share"], row["distance"])), float(row["lost_time"]), bool(row["contact"]),
            bool(row["furniture"]), bool(row["self"]), float(row["limit_excess"]), int(row["bad_ticks"]),
            int(row["reversals"]),
        )  # fmt: skip


class Score(NamedTuple):
    """Values on some encounters.

    Attributes:
        harm, lost: Objectives, means; estimated for all encounters where only some were played.
        constraints: By name; kept where <= 0.
    """

    harm: float
    lost: float
    constraints: dict[str, float]

    @property
    def violation(self) -> float:
        """Sum of what is not kept; 0 where all is."""
        return sum(value for value in self.constraints.values() if value > 0.0)


#: Outcomes of the runs of some values: without lag, and with each servo lag by its ticks.
Played = dict[int, list[Outcome]]


def score(mine: Played, reference: Played) -> Score:
    """Judge runs by those of the present values in the same encounters.

    Both meet the same people, so their difference needs few encounters: where only the first ones were played, an
    objective is the present values' own mean over all encounters plus the mean difference over the first ones.

    Args:
        mine: The first encounters, without lag (key 0) at least.
        reference: All encounters, of the present values.
    """
    plain, beside = mine[0], reference[0][: len(mine[0])]
    constraints = {
        "limits": max(outcome.excess for runs in mine.values() for outcome in runs),
        "bad ticks": float(_more(plain, beside, "bad")),
        "furniture": _more(plain, beside, "furniture") / len(plain),
        "self": _more(plain, beside, "itself") / len(plain),
        "chatter": _chatter(plain, beside, CHATTER),
    }
    for lag, runs in mine.items():
        if lag:
            # no more than the present values with this lag, or without any
            same = reference[lag][: len(runs)]
            constraints[f"lag {lag}"] = _chatter(runs, same, CHATTER_LAGGED)
    return Score(_paired(plain, reference[0], "harm"), _paired(plain, reference[0], "lost"), constraints)


def mean(runs: Sequence[Outcome], key: str) -> float:
    """Over encounters."""
    return math.fsum(getattr(outcome, key) for outcome in runs) / len(runs)


def _paired(mine: Sequence[Outcome], reference: Sequence[Outcome], key: str) -> float:
    return mean(reference, key) + mean(mine, key) - mean(reference[: len(mine)], key)


def _more(mine: Sequence[Outcome], reference: Sequence[Outcome], key: str) -> float:
    return sum(getattr(outcome, key) for outcome in mine) - sum(getattr(outcome, key) for outcome in reference)


def _chatter(mine: Sequence[Outcome], reference: Sequence[Outcome], allowed: tuple[float, float]) -> float:
    """Reversals above what is allowed, as a share of that."""
    most = allowed[0] * mean(reference, "reversals") + allowed[1]
    return mean(mine, "reversals") / most - 1.0
