"""The whole question of section III answered: how many spots, where, and how well on pairs nobody optimised for."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from qpsafe.placement.candidates import Candidates
from qpsafe.placement.coverage import Caps, Worth, detected_pairs, greedy, progress_of, seen_by_links
from qpsafe.placement.knapsack import cheapest_order, check_spots, cost
from qpsafe.placement.milp import Solution, best_choice, least_spots
from qpsafe.placement.objective import Objective
from qpsafe.placement.sample import Sample
from qpsafe.placement.statistics import clopper_pearson
from qpsafe.text.words import counted

Array = NDArray[np.float64]


class Curve(NamedTuple):
    """Fig. 9 for one order of the nodes, with the first 0, 1, ..., n of them.

    Attributes:
        order: (n,).
        counts: Detected pairs, on the sample that was optimised for and on the independent one, (2, n + 1).
        nearest: Pairs of which a point close to the person's nearest one is detected, likewise.
        cost: Cost (11) per pair and node on both [1/m], (2, n + 1).
        cost_error: Its standard error, (2, n + 1).
        danger: Share of the danger measured on both: the largest SDF that any node sees, summed over pairs, of the
            largest there is, (2, n + 1).
    """

    order: NDArray[np.intp]
    counts: NDArray[np.int64]
    nearest: NDArray[np.int64]
    cost: Array
    cost_error: Array
    danger: Array


class Judgement(NamedTuple):
    """How good a choice is on a sample.

    Attributes:
        probability: Of detection.
        low, high: Its Clopper-Pearson limits, 95 %.
        danger: Share of the danger measured.
        cost: (11) per pair and node [1/m].
        nearest: Probability that a point close to the person's nearest one is detected.
        nearest_low, nearest_high: Its limits, likewise.
    """

    probability: float
    low: float
    high: float
    danger: float
    cost: float
    nearest: float
    nearest_low: float
    nearest_high: float


@dataclass(frozen=True)
class Placement:
    """One optimised choice of nodes.

    Attributes:
        objective: One of `Objective`, or "probability" for (13).
        solution: The choice, its value and bound.
        flattered: Judged on the sample it was optimised for.
        fair: Judged on the independent sample.
    """

    objective: str
    solution: Solution
    flattered: Judgement
    fair: Judgement


@dataclass(frozen=True)
class Study:
    """Everything found.

    Attributes:
        candidates: The nodes.
        samples: The one optimised for, and the independent one.
        curves: Of all objectives.
        placements: The choices asked for, by objective.
        wanted: The objective whose choice is the answer.
    """

    candidates: Candidates
    samples: tuple[Sample, Sample]
    curves: dict[str, Curve]
    placements: dict[str, Placement]
    wanted: str

    @property
    def answer(self) -> Placement:
        """The choice asked for."""
        return self.placements[self.wanted]


def study(
    candidates: Candidates,
    samples: tuple[Sample, Sample],
    objective: Objective,
    *,
    spots: int = 20,
    probability: float | None = None,
    caps: Caps | None = None,
    time_limit: float = 30.0,
    exact: bool = True,
    progress: Callable[[str], None] | None = None,
) -> Study:
    """Optimise on the first sample, judge on the second.

    Args:
        candidates: The nodes.
        samples: The one to optimise for, and an independent one.
        objective: What the answer is to be best at. With a probability: what has it, `nearest` or else detection.
        spots: How many there are.
        probability: Find the fewest spots that reach it instead, eq. (13).
        caps: How many spots of a kind there may be; ignored by the curves and by (13).
        time_limit: For each 0-1 program [s].
        exact: False: greedy only.
        progress: Called with the name of what comes next.

    Raises:
        ConfigurationError: All nodes together do not reach the probability; no spots, or more than nodes.
    """
    say = progress or (lambda _: None)
    first = samples[0]
    check_spots(spots, first.nodes, caps)
    say("curves")
    links, n = candidates.links, first.nodes
    close = first.nearest()
    worths: dict[str, tuple[Sample, Worth | None]] = {
        "detection": (first, None),
        "nearest": (close, None),
        "danger": (first, seen_by_links(first, links, first.danger)),
        "evasion": (first, seen_by_links(first, links, first.torque)),
    }
    orders = {"cost": cheapest_order(first)}
    for name, (seen, worth) in worths.items():
        orders[name] = greedy(n, seen.node, worth or detected_pairs(seen)).order
    curves = {name: _curve(order, samples) for name, order in orders.items()}
    best = np.sort(cheapest_order(first, caps)[:spots])
    value = float(first.sums()[best].sum())
    solutions = {"cost": Solution(best, value, value, "sorting", 0.0)}
    for name, (seen, worth) in worths.items():
        asked = name == objective.value and probability is None
        say(f"{counted(spots, 'spot')}, {name}")
        solutions[name] = best_choice(seen, spots, worth, caps, time_limit=time_limit, exact=exact and asked)
    if probability is not None:
        say("least spots")
        seen = close if objective is Objective.nearest else first
        solutions["probability"] = least_spots(seen, probability, time_limit=time_limit, exact=exact)
    placements = {
        name: Placement(name, found, *(judge(sample, found.chosen) for sample in samples))
        for name, found in solutions.items()
    }
    return Study(candidates, samples, curves, placements, "probability" if probability is not None else objective.value)


def _curve(order: NDArray[np.intp], samples: tuple[Sample, Sample]) -> Curve:
    costs = [cost(sample, order) for sample in samples]
    counts, nearest = (
        [progress_of(s.nodes, s.node, detected_pairs(s), order) for s in seen]
        for seen in (samples, [sample.nearest() for sample in samples])
    )
    danger = [
        progress_of(s.nodes, s.node, Worth(s.pair.astype(np.int64), s.pairs, s.danger), order) / s.peak.sum()
        for s in samples
    ]
    return Curve(
        order,
        np.stack(counts).astype(np.int64),
        np.stack(nearest).astype(np.int64),
        np.stack([value for value, _ in costs]),
        np.stack([error for _, error in costs]),
        np.stack(danger),
    )


def judge(sample: Sample, chosen: NDArray[np.intp]) -> Judgement:
    """How good some nodes are on a sample."""
    seen = sample.seen_by(chosen)
    shares = []
    for count in (int((seen > 0.0).sum()), int((sample.nearest().seen_by(chosen) > 0.0).sum())):
        low, high = clopper_pearson(count, sample.pairs)
        shares.append((count / sample.pairs, float(low), float(high)))
    danger = float(seen.sum() / sample.peak.sum())
    return Judgement(*shares[0], danger, float(cost(sample, chosen)[0][-1]), *shares[1])


def to_dict(result: Study) -> dict[str, Any]:
    """For JSON."""
    names = result.candidates.nodes.names
    found: dict[str, Any] = {
        "nodes": len(names),
        "spacing": result.candidates.spacing,
        "pairs": result.samples[0].pairs,
        "wanted": result.wanted,
        "sensor": result.candidates.sensor.name,
        "detected_by_all_nodes": [judge(s, np.arange(s.nodes)).probability for s in result.samples],
        "rays": [
            {
                "on_robot": None if result.candidates.sensor.is_array else s.on_robot / (s.pairs * s.nodes),
                "too_near": s.too_near / (s.pairs * s.nodes),
                "detections_per_pair": len(s.node) / s.pairs,
            }
            for s in result.samples
        ],
        "placements": {},
        "curves": {},
    }
    for key, item in result.placements.items():
        found["placements"][key] = {
            "spots": [names[i] for i in item.solution.chosen],
            "value": item.solution.value,
            "bound": item.solution.bound,
            "gap": item.solution.gap,
            "method": item.solution.method,
            "seconds": item.solution.seconds,
            "optimised_sample": item.flattered._asdict(),
            "independent_sample": item.fair._asdict(),
        }
    for key, curve in result.curves.items():
        pairs = result.samples[1].pairs
        low, high = clopper_pearson(curve.counts[1], pairs)
        found["curves"][key] = {
            "order": [names[i] for i in curve.order],
            "probability": (curve.counts / [[s.pairs] for s in result.samples]).tolist(),
            "confidence": [low.tolist(), high.tolist()],
            "nearest": (curve.nearest / [[s.pairs] for s in result.samples]).tolist(),
            "nearest_confidence": [side.tolist() for side in clopper_pearson(curve.nearest[1], pairs)],
            "cost": curve.cost.tolist(),
            "cost_error": curve.cost_error.tolist(),
            "danger": curve.danger.tolist(),
        }
    return found
