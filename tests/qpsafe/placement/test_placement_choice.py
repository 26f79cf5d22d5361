"""Choosing nodes: (10) and (13) against brute force on 12 nodes, bounds, caps, curves, Clopper-Pearson."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from amounts import first, some
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import binom

from qpsafe.errors import ConfigurationError
from qpsafe.placement.coverage import Caps, Worth, detected_pairs, greedy, progress_of, seen_by_links
from qpsafe.placement.knapsack import cheapest_order, cost
from qpsafe.placement.milp import best_choice, least_spots
from qpsafe.placement.sample import Detections, Sample
from qpsafe.placement.statistics import clopper_pearson
from qpsafe.placement.study import judge

NODES, PAIRS = 12, 40


def sample_of(seed: int, nodes: int = NODES, pairs: int = PAIRS, density: float = 0.15) -> Sample:
    """Random detections; some pairs are seen by nobody."""
    rng = np.random.default_rng(seed)
    seen = rng.random((pairs, nodes)) < density * rng.uniform(0.2, 2.0, nodes)
    danger = rng.uniform(1.0, 10.0, int(seen.sum()))
    which = np.nonzero(seen)[1]
    best = np.zeros(pairs)
    np.maximum.at(best, np.nonzero(seen)[0], danger)
    torque, peak = rng.uniform(0, 1, len(danger)), best + rng.uniform(0.1, 1, pairs)
    part = Detections(seen.sum(axis=1), which, danger, torque, peak, rng.random(len(danger)) < 0.4)
    return Sample.collect(nodes, [part])


def table(sample: Sample) -> np.ndarray:
    """Q of every pair and node, eq. (9), (P, n)."""
    Q = np.zeros((sample.pairs, sample.nodes))
    Q[sample.pair, sample.node] = sample.danger
    return Q


def literal_cost(sample: Sample, chosen: tuple[int, ...]) -> float:
    """Eqs. (11), (12) as they are written."""
    Q, y = table(sample), np.zeros(sample.nodes)
    y[list(chosen)] = 1.0
    return sum(float((sample.peak - y[i] * Q[:, i]).sum()) for i in range(sample.nodes))


@pytest.mark.parametrize("seed", first(1, range(3)))
def test_10_agrees_with_brute_force(seed: int) -> None:
    sample = sample_of(seed)
    order = cheapest_order(sample)
    values, _ = cost(sample, order)
    for k in range(NODES + 1):
        best = min(literal_cost(sample, chosen) for chosen in combinations(range(NODES), k))
        assert literal_cost(sample, tuple(order[:k])) == pytest.approx(best, rel=1e-12)
        assert values[k] * sample.pairs * NODES == pytest.approx(best, rel=1e-12)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("share", [0.5, 0.8, 1.0])
def test_13_agrees_with_brute_force(seed: int, share: float) -> None:
    sample = sample_of(seed)
    Q = table(sample)
    probability = share * float((Q > 0).any(axis=1).mean())
    needed = np.ceil(probability * sample.pairs - 1e-9)

    def enough(chosen: tuple[int, ...]) -> bool:
        return int((Q[:, chosen] > 0).any(axis=1).sum()) >= needed

    fewest = next(k for k in range(NODES + 1) if any(enough(chosen) for chosen in combinations(range(NODES), k)))
    found = least_spots(sample, probability)
    assert enough(tuple(found.chosen))
    assert (len(found.chosen), found.value, found.gap) == (fewest, fewest, 0.0)
    quick = least_spots(sample, probability, exact=False)
    assert quick.bound <= fewest <= quick.value
    assert enough(tuple(quick.chosen))


@pytest.mark.parametrize("seed", first(1, range(3)))
@pytest.mark.parametrize("kind", ["detection", "danger", "torque"])
@pytest.mark.parametrize("capped", [False, True])
def test_best_choice_agrees_with_brute_force(seed: int, kind: str, capped: bool) -> None:
    sample = sample_of(seed)
    links = np.arange(NODES) % 3
    worth = None if kind == "detection" else seen_by_links(sample, links, getattr(sample, kind))
    counted = worth or detected_pairs(sample)
    caps = Caps(links, np.array([2, 1, 2])) if capped else None

    def allowed(chosen: tuple[int, ...]) -> bool:
        return caps is None or (np.bincount(links[list(chosen)], minlength=3) <= caps.most).all()

    def f(chosen: tuple[int, ...]) -> float:
        best = np.zeros(counted.cases)
        mine = np.isin(sample.node, chosen)
        np.maximum.at(best, counted.case[mine], counted.value[mine])
        return float(best.sum())

    best = max(f(chosen) for chosen in combinations(range(NODES), 4) if allowed(chosen))
    found = best_choice(sample, 4, worth, caps)
    assert allowed(tuple(found.chosen))
    assert len(found.chosen) <= 4
    assert f(tuple(found.chosen)) == pytest.approx(best, rel=1e-9)
    assert found.value == pytest.approx(best, rel=1e-9)
    assert found.gap < 1e-6
    quick = greedy(NODES, sample.node, counted, caps)
    assert quick.value[4] <= best * (1.0 + 1e-12) <= quick.bound[4] * (1.0 + 1e-9)
    assert quick.value[4] >= (0.5 if capped else 1.0 - 1.0 / np.e) * best


@given(st.integers(0, 10_000))
@settings(max_examples=some(10, of=25), deadline=None)
def test_curves_are_monotone_and_end_where_all_nodes_do(seed: int) -> None:
    sample = sample_of(seed, nodes=9, pairs=24)
    Q = table(sample)
    worth = detected_pairs(sample)
    found = greedy(9, sample.node, worth)
    assert sorted(found.order) == list(range(9))
    assert (np.diff(found.value) >= 0).all()
    assert (np.diff(np.diff(found.value)) <= 1e-9).all()  # each node adds less than the one before
    assert found.value[-1] == (Q > 0).any(axis=1).sum() == found.bound[-1]
    for order in (found.order, np.arange(9)[::-1]):
        steps = progress_of(9, sample.node, worth, order)
        assert steps == pytest.approx([(Q[:, order[:k]] > 0).any(axis=1).sum() for k in range(10)])
        danger = progress_of(9, sample.node, Worth(worth.case, worth.cases, sample.danger), order)
        assert danger == pytest.approx([Q[:, order[:k]].max(axis=1, initial=0.0).sum() for k in range(10)])


def test_a_second_node_that_sees_the_same_pays_for_cost_and_for_nothing_else() -> None:
    """Nodes 0 and 1 see pair 0 alike, node 2 sees pair 1 with less danger."""
    part = Detections(
        np.array([2, 1]),
        np.array([0, 1, 2]),
        np.array([5.0, 5.0, 1.0]),
        np.ones(3),
        np.array([6.0, 6.0]),
        np.ones(3) > 0,
    )
    sample = Sample.collect(3, [part])
    links = np.zeros(3, dtype=np.int64)
    assert set(cheapest_order(sample)[:2]) == {0, 1}
    for worth in (detected_pairs(sample), seen_by_links(sample, links, sample.danger)):
        assert set(greedy(3, sample.node, worth).order[:2]) == {0, 2}
    apart = seen_by_links(sample, np.array([0, 1, 1]), sample.danger)  # each link evades by its own danger vector
    assert set(greedy(3, sample.node, apart).order[:2]) == {0, 1}


def test_the_nearest_part_is_seen_where_a_near_detection_is() -> None:
    sample = sample_of(8)
    close = sample.nearest()
    seen = np.zeros((PAIRS, NODES), dtype=bool)
    seen[sample.pair[sample.near], sample.node[sample.near]] = True
    assert 0 < seen.sum() < len(sample.node)
    assert (table(close) == np.where(seen, table(sample), 0.0)).all()
    order = greedy(NODES, close.node, detected_pairs(close)).order
    for k in range(NODES + 1):
        assert ((close.seen_by(order[:k]) > 0) == seen[:, order[:k]].any(axis=1)).all()
        judged = judge(sample, order[:k])
        assert judged.nearest == pytest.approx(seen[:, order[:k]].any(axis=1).mean())
        assert judged.nearest_low <= judged.nearest <= judged.probability


def test_the_standard_error_of_the_cost_is_that_of_the_mean_over_pairs() -> None:
    sample = sample_of(5)
    chosen = np.array([3, 7, 1])
    per_pair = sample.peak - table(sample)[:, chosen].sum(axis=1) / NODES
    mean, error = cost(sample, chosen)
    assert mean[-1] == pytest.approx(per_pair.mean())
    assert error[-1] == pytest.approx(per_pair.std() / np.sqrt(sample.pairs))


def test_parts_of_a_sample_put_together_are_the_sample() -> None:
    whole = sample_of(6)
    cut = int(whole.first[17])
    own = (whole.node, whole.danger, whole.torque)
    parts = [
        Detections(np.diff(whole.first)[a:b], *(x[c:d] for x in own), whole.peak[a:b], whole.near[c:d], 2, 3)
        for a, b, c, d in ((0, 17, 0, cut), (17, PAIRS, cut, len(whole.node)))
    ]
    again = Sample.collect(NODES, parts)
    for key in ("first", "node", "danger", "torque", "peak", "near"):
        np.testing.assert_array_equal(getattr(again, key), getattr(whole, key))
    assert (again.on_robot, again.too_near) == (4, 6)


@pytest.mark.parametrize(("k", "n"), [(0, 10), (3, 10), (10, 10), (89, 100), (2670, 3000)])
def test_clopper_pearson_are_the_probabilities_at_which_the_tails_are_2_5_percent(k: int, n: int) -> None:
    low, high = clopper_pearson(k, n)
    assert float(low) <= k / n <= float(high)
    if k > 0:
        assert binom.sf(k - 1, n, float(low)) == pytest.approx(0.025, rel=1e-6)
    else:
        assert float(low) == 0.0
    if k < n:
        assert binom.cdf(k, n, float(high)) == pytest.approx(0.025, rel=1e-6)
    else:
        assert float(high) == 1.0


@pytest.mark.parametrize("spots", [0, -1, NODES + 1])
def test_a_number_of_spots_that_cannot_be(spots: int) -> None:
    with pytest.raises(ConfigurationError, match=f"spots = {spots}: expected 1 to {NODES}"):
        best_choice(sample_of(0), spots)


@pytest.mark.parametrize("probability", [0.0, -0.1, 1.1, float("nan")])
def test_a_probability_that_is_none(probability: float) -> None:
    with pytest.raises(ConfigurationError, match="above 0 and at most 1"):
        least_spots(sample_of(0), probability)


def test_a_probability_out_of_reach_says_what_is_in_reach() -> None:
    sample = sample_of(1, density=0.03)
    reach = float((table(sample) > 0).any(axis=1).mean())
    assert reach < 0.9
    with pytest.raises(ConfigurationError, match=f"at most {reach:.4f}"):
        least_spots(sample, 0.95)


def test_more_spots_than_the_regions_take() -> None:
    caps = Caps(np.zeros(NODES, dtype=np.int64), np.array([3]))
    with pytest.raises(ConfigurationError, match="at most 3"):
        best_choice(sample_of(0), 4, None, caps)
