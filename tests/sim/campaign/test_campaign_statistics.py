"""Statistics against other implementations and known tables, by coverage, and by what must not change them."""

from __future__ import annotations

import numpy as np
import pytest
from amounts import some
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from qpsafe.errors import ConfigurationError
from qpsafe.sim.campaign.report.resamples import Ranks, unit_of
from qpsafe.sim.campaign.report.statistics import (
    MEAN,
    MEDIAN,
    Bootstrap,
    Statistic,
    holm,
    mcnemar,
    share,
)

P10, P95 = Statistic(0.1), Statistic(0.95)
ALL = (MEAN, MEDIAN, P10, P95)
booleans = st.lists(st.tuples(st.booleans(), st.booleans()), min_size=1, max_size=60)


def happened(count: int, trials: int) -> np.ndarray:
    return np.arange(trials) < count


# Shares


@given(trials=st.integers(1, 400), part=st.floats(0.0, 1.0))
def test_a_share_has_scipys_exact_limits(trials: int, part: float) -> None:
    count = round(part * trials)
    found, limits = share(happened(count, trials)), stats.binomtest(count, trials).proportion_ci(0.95, "exact")
    assert (found.hits, found.trials, found.value) == (count, trials, count / trials)
    assert found.low == pytest.approx(limits.low, abs=1e-12)
    assert found.high == pytest.approx(limits.high, abs=1e-12)
    assert found.low <= found.value <= found.high
    assert (found.below is None) == (count > 0)


def test_none_of_many_is_below_three_over_their_number() -> None:
    for trials in (30, 300, 30_000):
        found = share(happened(0, trials))
        assert found.below == 3.0 / trials
        assert found.below_exact is not None
        assert (1.0 - found.below_exact) ** trials == pytest.approx(0.05, rel=1e-9)  # what exactness means
        assert found.below_exact < found.below < 1.06 * found.below_exact
    assert share([False]).below == 1.0


# McNemar


def test_mcnemar_gives_known_p_values() -> None:
    # 8 against 1 discordant pairs: 2 (C(9,0) + C(9,1)) / 2^9
    found = mcnemar([True] * 8 + [False] + [True] * 5, [False] * 8 + [True] + [True] * 5)
    assert (found.only_first, found.only_second) == (8, 1)
    assert found.p == pytest.approx(20 / 512, rel=1e-12)
    assert mcnemar([True, False], [True, False]).p == 1.0  # nothing differs
    assert mcnemar([True] * 5, [False] * 5).p == pytest.approx(2 / 32, rel=1e-12)


@given(booleans)
def test_mcnemar_swaps_with_the_pair_and_forgets_the_order_of_trials(pairs: list[tuple[bool, bool]]) -> None:
    a, b = np.array(pairs).T
    found, swapped = mcnemar(a, b), mcnemar(b, a)
    assert (found.only_first, found.only_second) == (swapped.only_second, swapped.only_first)
    assert found.p == swapped.p
    order = np.random.default_rng(len(pairs)).permutation(len(pairs))
    assert mcnemar(a[order], b[order]) == found
    both = np.concatenate([a, np.ones(7, dtype=bool)]), np.concatenate([b, np.ones(7, dtype=bool)])
    assert mcnemar(*both) == found  # trials that are the same for both say nothing


def test_mcnemar_rejects_one_in_twenty_at_most_where_nothing_differs() -> None:
    rng = np.random.default_rng(1)
    p = [mcnemar(*(rng.uniform(size=(2, 60)) < 0.3)).p for _ in range(400)]
    assert np.mean(np.array(p) < 0.05) <= 0.05 + 3.0 * np.sqrt(0.05 * 0.95 / 400)
    assert np.mean(np.array(p) < 0.5) > 0.2  # nor does it never reject


def test_trials_that_do_not_pair_are_refused() -> None:
    with pytest.raises(ConfigurationError, match="the same trials"):
        mcnemar([True], [True, False])


# Bootstrap


def boot(values: dict[str, np.ndarray], resamples: int = 2000, seed: int = 0) -> Bootstrap:
    return Bootstrap(values, dict.fromkeys(values, ALL), resamples, seed)


@given(st.lists(st.floats(-1e3, 1e3), min_size=1, max_size=30), st.floats(0.01, 1.0))
def test_a_quantile_is_numpys_order_statistic_in_every_resample(values: list[float], quantile: float) -> None:
    data, item = np.array(values), Statistic(quantile)
    made = Bootstrap({"x": data}, {"x": (item, MEAN)}, resamples=7, seed=3)
    drawn = np.random.default_rng(3).integers(len(data), size=(7, len(data)))
    expected = np.quantile(data[drawn], quantile, axis=1, method="inverted_cdf")
    np.testing.assert_array_equal(made.drawn["x", item], expected)
    np.testing.assert_allclose(made.drawn["x", MEAN], data[drawn].mean(axis=1), atol=1e-10)
    assert made.estimate("x", item).value == np.quantile(data, quantile, method="inverted_cdf")


@pytest.mark.parametrize("quantile", [0.001, 0.1, 0.5, 0.95, 1.0])
def test_quantiles_of_many_trials_are_found_in_a_window_of_ranks_and_outside(quantile: float) -> None:
    data = np.random.default_rng(1).gamma(2.0, size=5000).round(2)  # with ties
    drawn = np.random.default_rng(9).integers(5000, size=(40, 5000))
    expected = np.quantile(data[drawn], quantile, axis=1, method="inverted_cdf")
    ranks = Ranks(data, quantile)
    assert ranks.window.stop - ranks.window.start < 600
    weights = np.array([np.bincount(line, minlength=5000) for line in drawn], dtype=float).T
    np.testing.assert_array_equal(ranks.quantiles(weights, ranks.before @ weights), expected)
    lopsided = np.zeros((5000, 2))
    lopsided[data.argmin(), 0] = lopsided[data.argmax(), 1] = 5000.0
    assert ranks.quantiles(lopsided, ranks.before @ lopsided).tolist() == [data.min(), data.max()]


def test_limits_agree_with_scipys_paired_percentile_bootstrap() -> None:
    rng = np.random.default_rng(5)
    base = rng.gamma(2.0, size=80)
    a, b = base + 0.3 * rng.normal(size=80), base - 0.2 + 0.3 * rng.normal(size=80)
    found = boot({"a": a, "b": b}, 10_000).difference("a", "b", MEAN)
    theirs = stats.bootstrap(
        (a, b), lambda x, y, axis: x.mean(axis) - y.mean(axis), paired=True, method="percentile", n_resamples=10_000,
        rng=np.random.default_rng(6),
    ).confidence_interval  # fmt: skip
    spread = (a - b).std() / np.sqrt(80)
    assert found.value == pytest.approx((a - b).mean(), rel=1e-12)
    assert found.low == pytest.approx(theirs.low, abs=0.1 * spread)
    assert found.high == pytest.approx(theirs.high, abs=0.1 * spread)
    unpaired = found.high - found.low < 0.5 * 2 * 1.96 * np.sqrt((a.var() + b.var()) / 80)
    assert unpaired  # pairing takes out what the trials share


def test_means_do_not_depend_on_the_order_of_summation() -> None:
    """Nor, then, on how many threads multiply matrices: the report is the same byte for byte."""
    rng = np.random.default_rng(8)
    for trials in (1, 2, 7, 1000, 30_000):
        for scale in (1e-12, 1.0, 3.7e5):
            x = scale * rng.gamma(0.3, size=trials)
            whole = np.rint(x / unit_of(x))
            weights = rng.multinomial(trials, np.full(trials, 1.0 / trials)).astype(float)
            sums = {float(weights[order] @ whole[order]) for order in (rng.permutation(trials) for _ in range(20))}
            assert len(sums) == 1
            assert max(sums) < 2.0**53
            assert sums.pop() * unit_of(x) == pytest.approx(weights @ x, rel=1e-9)
    for same in (0.0, 1e-310, 0.3, -7.1):  # nothing to estimate: limits that hold the value
        value, low, high, _ = Bootstrap({"x": np.full(6, same)}, {"x": (MEAN,)}, 9).estimate("x", MEAN)
        assert low == value == high == pytest.approx(same, rel=1e-12)


@pytest.mark.parametrize("item", ALL, ids=str)
def test_a_difference_changes_its_sign_with_the_pair(item: Statistic) -> None:
    rng = np.random.default_rng(2)
    made = boot({"a": rng.normal(size=50), "b": rng.normal(size=50)})
    there, back = made.difference("a", "b", item), made.difference("b", "a", item)
    assert back.value == -there.value
    assert (back.low, back.high) == pytest.approx((-there.high, -there.low), abs=1e-12)
    assert back.p == there.p


def test_the_same_controller_does_not_differ_from_itself_and_a_shift_shifts() -> None:
    x = np.random.default_rng(3).normal(size=60)
    made = boot({"x": x, "same": x.copy(), "up": x + 2.0})
    for item in ALL:
        assert made.difference("x", "same", item) == (0.0, 0.0, 0.0, 1.0)
        moved, here = made.estimate("up", item), made.estimate("x", item)
        assert [m - 2.0 for m in moved[:3]] == pytest.approx(here[:3], abs=1e-12)
        shift = made.difference("up", "x", item)
        assert shift[:3] == pytest.approx((2.0, 2.0, 2.0), abs=1e-9)
        assert shift.p == 2.0 / 2001.0  # as small as it can be


def test_blocks_of_resamples_change_nothing_and_seeds_do(monkeypatch: pytest.MonkeyPatch) -> None:
    x = np.random.default_rng(4).normal(size=30)
    whole, done = boot({"x": x}, 100), []
    monkeypatch.setattr("qpsafe.sim.campaign.report.resamples._BLOCK", 300)
    parts = Bootstrap({"x": x}, {"x": ALL}, 100, progress=done.append)
    assert done == list(range(10, 101, 10))
    for item in ALL:
        np.testing.assert_allclose(parts.drawn["x", item], whole.drawn["x", item], rtol=1e-12)
        assert not np.array_equal(boot({"x": x}, 100, seed=1).drawn["x", item], whole.drawn["x", item])


@pytest.mark.parametrize("item", [MEAN, MEDIAN], ids=str)
def test_limits_hold_the_truth_about_as_often_as_they_say(item: Statistic) -> None:
    """95 %, less what a percentile bootstrap of 60 trials lacks."""
    rng, count = np.random.default_rng(7), some(120, of=300)
    hits, rejected = 0, 0
    for k in range(count):
        shared = rng.gamma(2.0, size=60)
        a, b = shared + rng.normal(size=60), shared + rng.normal(size=60)
        found = Bootstrap({"a": a, "b": b}, {"a": (item,), "b": (item,)}, 300, seed=k).difference("a", "b", item)
        hits += found.low <= 0.0 <= found.high
        rejected += (found.p or 1.0) < 0.05
    assert 0.90 <= hits / count <= 0.995
    assert rejected / count <= 0.10


def test_columns_that_cannot_be_resampled_are_refused() -> None:
    for values in ({"x": np.array([1.0, np.nan])}, {"x": np.zeros(0)}, {"x": np.zeros(2), "y": np.zeros(3)}):
        with pytest.raises(ConfigurationError):
            boot(values)


# Holm


def test_holm_gives_known_adjusted_values() -> None:
    np.testing.assert_allclose(holm([0.01, 0.04, 0.03, 0.005]), [0.03, 0.06, 0.06, 0.02])
    assert holm([]).tolist() == []
    assert holm([0.7, 0.8]).tolist() == [1.0, 1.0]


@given(st.lists(st.floats(0.0, 1.0), min_size=1, max_size=20))
def test_holm_is_between_nothing_and_bonferroni_and_follows_the_order(p: list[float]) -> None:
    adjusted, values = holm(p), np.array(p)
    assert (adjusted >= values).all()
    assert (adjusted <= np.minimum(values * len(p), 1.0) + 1e-15).all()
    assert (np.diff(adjusted[np.argsort(values, kind="stable")]) >= 0.0).all()
    order = np.random.default_rng(len(p)).permutation(len(p))
    np.testing.assert_allclose(np.sort(holm(values[order])), np.sort(adjusted), rtol=1e-12)
