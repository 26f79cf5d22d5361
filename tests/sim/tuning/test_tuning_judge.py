"""The judgement: paired, in words, and honest where nothing is better."""

from __future__ import annotations

import made_up_trials
import numpy as np
import pytest

from qpsafe.sim.campaign.plan import Plan
from qpsafe.sim.campaign.trials.harm import harm
from qpsafe.sim.campaign.trials.rows import Columns, columns_of
from qpsafe.sim.tuning.judge import Judged, compared, sentence

PLAN = Plan(trials=200, controllers=("default",))
ROWS = columns_of([row for k in range(200) for row in made_up_trials.run(PLAN, k)])
ROWS["furniture"][:] = ROWS["self"][:] = False
ROWS["limit_excess"][:] = 0.0


def changed(**by: object) -> Columns:
    return {key: np.asarray(by.get(key, values)) for key, values in ROWS.items()}


def judged(**by: object) -> Judged:
    return compared(ROWS, changed(**by), 8_000_000)


def test_the_same_rows_are_as_good_and_said_to_be() -> None:
    found = judged()
    for mean in found.means.values():
        assert mean.difference.value == 0.0
        assert mean.difference.p == 1.0
    assert not found.dominates
    assert not found.worth
    assert sentence(found).startswith("The present values were already as good")


def test_means_are_those_of_the_rows() -> None:
    pairs = zip(ROWS["energy_share"], ROWS["distance"], strict=True)
    found = judged(lost_time=ROWS["lost_time"] - 0.25)
    assert found.means["harm"].present == pytest.approx(np.mean([harm(*pair) for pair in pairs]))
    assert found.means["lost"].difference.value == pytest.approx(-0.25)
    assert found.counts["contacts"] == (ROWS["contact"].sum(),) * 2


def test_better_in_both_better_in_one_and_a_trade_are_told_apart() -> None:
    near, quick = ROWS["distance"] + 0.05, ROWS["lost_time"] - 0.25
    both, one = judged(distance=near, lost_time=quick), judged(lost_time=quick)
    assert both.dominates
    assert sentence(both).startswith("The tuned values are better in both")
    assert one.worth
    assert not one.dominates
    assert sentence(one).startswith("The tuned values are better in work lost, and not surely worse")
    trade = judged(distance=near, lost_time=ROWS["lost_time"] + 0.25)
    assert not trade.worth
    assert "trade" in sentence(trade)
    noise = np.random.default_rng(3).normal(0.0, 0.05, len(ROWS["distance"]))
    maybe = next(
        found
        for found in (judged(distance=ROWS["distance"] + sign * noise, lost_time=quick) for sign in (1.0, -1.0))
        if found.means["harm"].difference.value > 0.0
    )
    assert not maybe.worse("harm")
    assert not maybe.worth
    assert sentence(maybe).startswith("The tuned values are better in work lost, and may do more harm;")
    worse = judged(distance=ROWS["distance"] - 0.05)
    assert not worse.worth
    assert sentence(worse).startswith("The present values were already as good")


@pytest.mark.parametrize("what", ["furniture", "self", "limit_excess"])
def test_a_new_fault_is_never_worth_it(what: str) -> None:
    fault = ROWS[what].copy()
    fault[7] = True
    found = judged(distance=ROWS["distance"] + 0.05, lost_time=ROWS["lost_time"] - 0.25, **{what: fault})
    assert len(found.new_faults) == 1
    assert not found.dominates
    assert not found.worth
    assert sentence(found).startswith("Do not take the tuned values")


def test_json_has_every_figure() -> None:
    said = judged(distance=ROWS["distance"] + 0.05).to_dict()
    assert said["encounters"] == 200
    assert set(said["means"]) == {"harm", "lost", "reversals"}
    assert {"present", "tuned", "value", "low", "high", "p"} == set(said["means"]["harm"])
    assert {"contacts", "towards", "furniture", "self"} <= set(said["shares"])
