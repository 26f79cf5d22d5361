"""The 0-1 programs on HiGHS: least spots for a probability, eq. (13), and the best choice of a number of spots.

y_i = 1 for a chosen node. Only y must be whole: the best z is then 0 or 1 by itself, or can be made so.

(13): pairs that the same nodes detect are one pattern k of weight w_k; z_k says whether it is detected,

    min sum y    s.t.  sum w_k z_k >= P_thr P,     z_k <= sum of y_i over nodes that detect k,   0 <= z_k <= 1.

The best n_spots nodes for f of `qpsafe.placement.coverage`: z_d says whether detection d is the one that counts for
its case,

    max sum v_d z_d    s.t.  sum y <= n_spots,     z_d <= y of its node,   sum of z_d over a case <= 1,   z_d >= 0;

where every v is 1, patterns take the place of pairs as in (13).
"""

from __future__ import annotations

import time
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from qpsafe.errors import ConfigurationError
from qpsafe.placement.coverage import Caps, Worth, detected_pairs, greedy, progress_of
from qpsafe.placement.knapsack import check_spots
from qpsafe.placement.sample import Sample
from qpsafe.text.words import counted

Array = NDArray[np.float64]

#: Programmes with more detections than this are left to greedy and its bound.
MOST_DETECTIONS = 300_000


class Solution(NamedTuple):
    """A choice of nodes and how good it is known to be.

    Attributes:
        chosen: The nodes, in ascending order.
        value: Number of spots (13), or f of the choice.
        bound: No choice is better than this.
        method: "HiGHS", "greedy" or "sorting".
        seconds: Taken.
    """

    chosen: NDArray[np.intp]
    value: float
    bound: float
    method: str
    seconds: float

    @property
    def gap(self) -> float:
        """Optimality gap |value - bound| / value; 0 is a proven optimum."""
        return abs(self.value - self.bound) / self.value if self.value > 0.0 else 0.0


def least_spots(sample: Sample, probability: float, *, time_limit: float = 30.0, exact: bool = True) -> Solution:
    """Eq. (13): the fewest nodes that detect at least a share of the pairs.

    Args:
        sample: Who detects what.
        probability: P_thr, above 0 and at most 1.
        time_limit: For HiGHS [s]; the best choice found by then, or by greedy, is returned with its gap.
        exact: False: greedy only.

    Raises:
        ConfigurationError: The probability is none, or all nodes together do not reach it.
    """
    if not 0.0 < probability <= 1.0:
        raise ConfigurationError("placement", "probability", probability, "above 0 and at most 1")
    start = time.perf_counter()
    first = greedy(sample.nodes, sample.node, detected_pairs(sample))
    needed = int(np.ceil(probability * sample.pairs - 1e-9))
    reached = np.flatnonzero(first.value >= needed - 0.5)
    if not len(reached):
        share = first.value[-1] / sample.pairs
        nodes, pairs = counted(sample.nodes, "node"), counted(sample.pairs, "pair")
        expected = f"at most {share:.4f}, what all {nodes} together detect of {pairs}"
        raise ConfigurationError("placement", "probability", probability, expected)
    count = int(reached[0])
    bound = int(np.flatnonzero(first.bound >= needed - 0.5)[0])
    best = Solution(np.sort(first.order[:count]), count, bound, "greedy", 0.0)
    if exact and bound < count and time_limit > 0.0 and len(sample.node) <= MOST_DETECTIONS:
        rows, weights = patterns(sample)
        k, n = rows.shape
        found, dual = _milp(
            np.append(np.ones(n), np.zeros(k)),
            [
                _detected_only_by_chosen(rows),
                (np.append(np.zeros(n), weights)[None], needed - 0.5, np.inf),
                (
                    np.append(np.ones(n), np.zeros(k))[None],
                    0.0,
                    count - 1.0,
                ),  # better than greedy, or prove it cannot be
            ],
            n,
            time_limit,
            infeasible=float(count),
        )
        bound = max(bound, min(count, int(np.ceil(dual - 1e-6))))
        if found is not None:
            best = Solution(found, len(found), bound, "HiGHS", 0.0)
        else:
            best = best._replace(bound=bound)
    return best._replace(seconds=time.perf_counter() - start)


def best_choice(
    sample: Sample,
    spots: int,
    worth: Worth | None = None,
    caps: Caps | None = None,
    *,
    time_limit: float = 30.0,
    exact: bool = True,
) -> Solution:
    """The nodes, `spots` of them, of the largest f (see `qpsafe.placement.coverage`).

    Args:
        sample: Who detects what.
        spots: How many.
        worth: What f counts; by default detected pairs.
        caps: How many nodes of a kind may be chosen.
        time_limit: For HiGHS [s]; the best choice found by then, or by greedy, is returned with its gap.
        exact: False: greedy only.

    Raises:
        ConfigurationError: No spots, or more than there are nodes or caps allow.
    """
    check_spots(spots, sample.nodes, caps)
    start = time.perf_counter()
    counted = detected_pairs(sample) if worth is None else worth
    first = greedy(sample.nodes, sample.node, counted, caps)
    best = Solution(np.sort(first.order[:spots]), float(first.value[spots]), float(first.bound[spots]), "greedy", 0.0)
    if exact and best.gap > 1e-9 and time_limit > 0.0 and len(sample.node) <= MOST_DETECTIONS:
        n = sample.nodes
        if worth is None:
            rows, v = patterns(sample)
            limits = [_detected_only_by_chosen(rows)]
        else:
            v = worth.value
            limits = [_counted_only_if_chosen(sample), _counted_once(sample.nodes, worth)]
        d = len(v)
        limits.append((np.append(np.ones(n), np.zeros(d))[None], 0.0, float(spots)))
        kinds = caps or Caps.none(n)
        for kind, most in enumerate(kinds.most):
            limits.append((np.append(kinds.kind == kind, np.zeros(d))[None], 0.0, float(most)))
        found, dual = _milp(np.append(np.zeros(n), -v), limits, n, time_limit)
        best = best._replace(bound=max(best.value, min(best.bound, -dual)))
        if found is not None:
            value = float(progress_of(n, sample.node, counted, found)[-1])
            if value > best.value:
                best = Solution(found, value, max(best.bound, value), "HiGHS", 0.0)
    return best._replace(seconds=time.perf_counter() - start)


def patterns(sample: Sample) -> tuple[Any, Array]:
    """Who detects a pair: different rows (k, n), sparse 0 and 1, and how many pairs have each (k,).

    Pairs that nobody detects are left out.
    """
    from scipy.sparse import csr_array

    bits = np.zeros((sample.pairs, -(-sample.nodes // 8)), np.uint8)
    np.bitwise_or.at(bits, (sample.pair, sample.node // 8), (128 >> (sample.node % 8)).astype(np.uint8))
    unique, counts = np.unique(bits, axis=0, return_counts=True)
    seen = unique.any(axis=1)
    table = np.unpackbits(unique[seen], axis=1, count=sample.nodes)
    return csr_array(table.astype(float)), counts[seen].astype(float)


Limit = tuple[Any, Any, Any]  # matrix, lower, upper


def _detected_only_by_chosen(rows: Any) -> Limit:
    from scipy.sparse import eye_array, hstack

    return hstack([rows, -eye_array(rows.shape[0])]).tocsr(), 0.0, np.inf


def _counted_only_if_chosen(sample: Sample) -> Limit:
    from scipy.sparse import csr_array, eye_array, hstack

    d = len(sample.node)
    own = csr_array((np.ones(d), (np.arange(d), sample.node)), shape=(d, sample.nodes))
    return hstack([own, -eye_array(d)]).tocsr(), 0.0, np.inf


def _counted_once(n: int, worth: Worth) -> Limit:
    from scipy.sparse import csr_array

    used, row = np.unique(worth.case, return_inverse=True)
    d = len(worth.case)
    return csr_array((np.ones(d), (row, n + np.arange(d))), shape=(len(used), n + d)), -np.inf, 1.0


def _milp(
    objective: Array, limits: list[Limit], n: int, time_limit: float, infeasible: float = -np.inf
) -> tuple[NDArray[np.intp] | None, float]:
    """Minimise with HiGHS over the first n variables 0 or 1 and the rest in [0, 1].

    Returns:
        The nodes chosen, None if none were found, and a lower bound of the objective: `infeasible` if there is no
        choice at all.
    """
    from scipy.optimize import Bounds, LinearConstraint, milp

    result = milp(
        objective,
        integrality=np.append(np.ones(n), np.zeros(len(objective) - n)),
        bounds=Bounds(0.0, 1.0),
        constraints=[LinearConstraint(*limit) for limit in limits],
        options={"time_limit": time_limit, "mip_rel_gap": 0.0},
    )
    if result.status == 2:
        return None, infeasible
    dual = -np.inf if result.mip_dual_bound is None else float(result.mip_dual_bound)
    found = None if result.x is None else np.flatnonzero(result.x[:n] > 0.5)
    return found, dual
