"""Few trials, or few in which two controllers differ: chance alone is found significant as seldom as p-values say."""

from __future__ import annotations

import itertools
from typing import Any

import made_up_trials
import numpy as np
import pytest
from amounts import some
from hypothesis import given
from hypothesis import strategies as st

from qpsafe.sim.campaign.plan import Plan
from qpsafe.sim.campaign.report.figures import harm_figure, svg
from qpsafe.sim.campaign.report.page import LEVEL, _compared
from qpsafe.sim.campaign.report.statistics import LEAST, MEAN, MEDIAN, Bootstrap, Statistic
from qpsafe.sim.campaign.report.summary import summary
from qpsafe.sim.campaign.report.swaps import FEW, few, least_p, swapped_p
from qpsafe.sim.campaign.runner import run_campaign
from qpsafe.sim.tuning.judge import LEAST as LEAST_JUDGED
from qpsafe.sim.tuning.judge import compared, sentence

ITEMS = (MEAN, MEDIAN, Statistic(0.1), Statistic(0.95))
values = st.sampled_from((0.0, 0.1, 0.2, 0.3, 1e3, -7.25)) | st.floats(-1e3, 1e3)


def p_of(first: np.ndarray, second: np.ndarray, item: Statistic, resamples: int = 400) -> float:
    made = Bootstrap({"a": first, "b": second}, {"a": (item,), "b": (item,)}, resamples)
    found = made.difference("a", "b", item).p
    assert found is not None
    return found


def alike(rng: np.random.Generator, trials: int, differ: int) -> tuple[np.ndarray, np.ndarray]:
    """Two controllers without any difference but chance, of which so many trials know, some of them by a lot."""
    shared = rng.gamma(2.0, size=trials)
    own = np.zeros((2, trials))
    own[:, rng.choice(trials, differ, replace=False)] = rng.standard_t(3, size=(2, differ)).round(1)
    return shared + own[0], shared + own[1]


@pytest.mark.parametrize("item", ITEMS, ids=str)
@pytest.mark.parametrize("trials", [*range(1, 13)])
def test_chance_is_rejected_no_more_often_than_a_level_says(trials: int, item: Statistic) -> None:
    rng, draws = np.random.default_rng((trials, 1)), some(60, 600)
    p = np.array([swapped_p(*alike(rng, trials, trials), item.quantile, 2**12) for _ in range(draws)])
    for level in (0.001, 0.05, 0.2, 0.5):
        assert (p <= level).mean() <= level + 3.5 * np.sqrt(level * (1.0 - level) / draws), level
    assert p.min() >= 2.0 ** (1 - trials)


@pytest.mark.parametrize(("trials", "differ"), [(12, 3), (49, 49), (60, 8), (200, 5), (200, 7), (200, 12)])
def test_nor_where_few_of_many_trials_differ(trials: int, differ: int) -> None:
    rng, draws = np.random.default_rng(trials + differ), some(80, 600)
    pairs = [alike(rng, trials, differ) for _ in range(draws)]
    for item in (MEAN, MEDIAN) if draws > 80 else (MEAN,):
        p = np.array([p_of(*pair, item) for pair in pairs])
        assert (p < 0.05).mean() <= 0.05 + 3.5 * np.sqrt(0.05 * 0.95 / draws)


@given(st.lists(st.tuples(values, values), min_size=1, max_size=8), st.sampled_from(ITEMS))
def test_it_is_the_share_of_all_ways_to_swap(pairs: list[tuple[float, float]], item: Statistic) -> None:
    """Counted one by one; the same for the pair turned round, and for trials in another order."""
    a, b = np.array(pairs).T
    seen, ways = abs(item.of(a) - item.of(b)), 0
    swaps = list(itertools.product((False, True), repeat=len(pairs)))
    for swap in swaps:
        one, other = np.where(swap, b, a), np.where(swap, a, b)
        ways += abs(item.of(one) - item.of(other)) >= seen - 1e-8 * max(np.abs(pairs).max(), 1e-300)
    found = swapped_p(a, b, item.quantile, 2**8)
    assert found == pytest.approx(ways / len(swaps), abs=1e-12)
    assert swapped_p(b, a, item.quantile, 2**8) == found
    assert swapped_p(a[::-1], b[::-1], item.quantile, 2**8) == found
    assert found >= least_p(a, b)


@given(st.integers(1, FEW - 1), st.integers(0, 2**32))
def test_random_swaps_are_never_surer_than_their_number(trials: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    a = rng.normal(size=trials)
    assert few(a, a + 9.0, None)
    found = swapped_p(a, a + 9.0, None, 99)  # all trials go the same way
    if trials <= 6:
        assert found == 2.0 ** (1 - trials)
    else:
        assert 0.01 <= found <= 0.1


@pytest.mark.parametrize("trials", [1, 2, LEAST - 1, LEAST])
def test_so_few_trials_have_neither_limits_nor_anything_significant(trials: int) -> None:
    """Whatever the rows: no p-value below one swap in all, no limits of no width, no bold figure."""
    plan = Plan(trials=trials, controllers=("none", "stop", "default"))

    def far_apart(plan: Plan, trial: int) -> list[dict[str, Any]]:
        rows = made_up_trials.run(plan, trial)
        for k, row in enumerate(rows):
            row |= {"lost_time": 3.0 * k, "distance": 0.1 + k, "contact": False, "suspensions": 2 * k}
        return rows

    made = run_campaign(plan, trial=far_apart)
    found = summary(made)
    assert all(item["p"] >= 2.0 ** (1 - trials) for item in found["comparisons"])
    assert all(item["p_holm"] >= LEVEL for item in found["comparisons"])
    text = _compared(found, "stop") + svg(harm_figure(found["controllers"]), "harm")
    assert "nan" not in text
    assert "<strong>" not in text
    assert ("no limits" in text) == (trials < LEAST)
    for item in found["comparisons"]:
        assert np.isnan(item["interval"]).all() == (trials < LEAST)


@pytest.mark.parametrize("encounters", [1, 2, 6, 11, 12, LEAST_JUDGED - 1, LEAST_JUDGED])
def test_so_few_encounters_never_make_tuned_values_worth_it(encounters: int) -> None:
    plan = Plan(trials=encounters, controllers=("default",))
    present = run_campaign(plan, trial=made_up_trials.run).columns
    for key, value in (("furniture", False), ("self", False), ("limit_excess", 0.0)):
        present[key][:] = value
    tuned = present | {"lost_time": present["lost_time"] - 5.0, "distance": present["distance"] + 1.0}
    found = compared(present, tuned, plan.seed)
    p = found.means["lost"].difference.p
    assert p is not None
    assert p >= 2.0 ** (1 - encounters)
    enough = encounters >= LEAST_JUDGED
    assert (found.worth, found.dominates, found.enough) == (enough,) * 3
    assert sentence(found).startswith("Too few encounters to compare") == (not enough)
    fault = compared(present, tuned | {"limit_excess": np.full(encounters, np.nan)}, plan.seed)
    assert fault.new_faults == ["limits"]
    assert sentence(fault).startswith("Do not take the tuned values")
