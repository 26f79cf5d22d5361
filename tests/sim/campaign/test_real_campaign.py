"""A small campaign with real trials, from seeds to findings; and a controller that goes for people is found out."""

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from qpsafe.laws.hierarchical import HierarchicalLaw
from qpsafe.laws.problem import LawProblem, LawResult
from qpsafe.sim.campaign.plan import Plan
from qpsafe.sim.campaign.report.summary import summary
from qpsafe.sim.campaign.rows import of_controller
from qpsafe.sim.campaign.runner import Results, run_campaign

TRIALS = 6
CONTROLLERS = ("none", "stop_perfect_sight", "default")
ATTACKING = f"{Path(__file__)}:attacking"


class Attacking(HierarchicalLaw):
    """Evades in the wrong direction."""

    def solve(self, problem: LawProblem) -> LawResult:
        """With q̇0 turned round."""
        return super().solve(problem._replace(qd0=-problem.qd0))


def attacking(station: Any) -> Any:
    """Goes for whom it sees."""
    return station.controller(Attacking())


@pytest.fixture(scope="module")
def results() -> Results:
    return run_campaign(Plan(trials=TRIALS, controllers=CONTROLLERS, seed=500))


def test_a_small_campaign_is_plausible(results: Results) -> None:
    found = summary(results)
    assert found["findings"] == []
    assert list(found["controllers"]) == list(CONTROLLERS)
    assert [found["controllers"][name]["trials"] for name in CONTROLLERS] == [TRIALS] * 3
    rows = {name: of_controller(results.columns, name) for name in CONTROLLERS}
    none, stop, default = (rows[name] for name in CONTROLLERS)
    assert none["lost_time"] == pytest.approx(0.0, abs=1e-9)
    assert (none["suspensions"] == 0).all()
    assert default["lost_time"].mean() > 0.0
    assert not stop["towards"].any()  # it sees everybody
    for mine in rows.values():
        assert ((mine["distance"] <= 0.0) == mine["contact"]).all()
        assert ((mine["contact_class"] != "none") == mine["contact"]).all()
        assert np.isfinite(mine["distance"]).all()
        assert (mine["limit_excess"] == 0.0).all()
        assert (mine["bad_ticks"] == 0).all()
    # whom nobody approaches, in the same encounter, the robots meet alike before they see anybody
    assert set(none["motion"]) == {"hold", "line", "pick"}


def test_the_same_seeds_give_the_same_rows_alone_or_with_others(results: Results) -> None:
    alone = run_campaign(Plan(trials=3, controllers=("default",), seed=500)).columns
    together = of_controller(results.columns, "default")
    for key, values in alone.items():
        assert values.tobytes() == together[key][:3].astype(values.dtype).tobytes(), key


def test_a_controller_that_moves_towards_people_touches_them_moving() -> None:
    """Nobody else moves towards people in the same encounters, and it hits them far harder."""
    found = run_campaign(Plan(trials=8, controllers=("none", ATTACKING, "default"), seed=900, motions=("hold",)))
    none, attacking, default = (of_controller(found.columns, name) for name in found.plan.controllers)
    assert attacking["towards"].any()
    assert not none["towards"].any()
    assert not default["towards"].any()
    assert np.nanmax(attacking["energy"]) > 10.0 * np.nanmax((none["energy"], default["energy"]))


@pytest.mark.slow
def test_a_controller_that_moves_towards_people_is_caught() -> None:
    """By the report: worse than no control at all, with a p-value."""
    plan = Plan(trials=24, controllers=("none", ATTACKING, "default"), seed=900, motions=("hold",))
    played = run_campaign(plan)
    assert any("worse than no control" in text for text in summary(played)["findings"])
    two = ("none", "default")  # of the same trials
    kept = np.isin(played.columns["controller"], two)
    columns = {key: values[kept] for key, values in played.columns.items()}
    good = dataclasses.replace(played, plan=dataclasses.replace(plan, controllers=two), columns=columns)
    assert summary(good)["findings"] == []
