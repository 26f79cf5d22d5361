"""A small campaign with real trials, from seeds to findings; and a controller that goes for people is found out."""

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from amounts import some

import qpsafe.sim
from qpsafe.laws.hierarchical import HierarchicalLaw
from qpsafe.laws.problem import LawProblem, LawResult
from qpsafe.sim.campaign.plan import Plan
from qpsafe.sim.campaign.report.summary import summary
from qpsafe.sim.campaign.runner import Results, run_campaign
from qpsafe.sim.campaign.trials.rows import of_controller

pytestmark = pytest.mark.long

TRIALS = some(3, of=6)  # of each motion as many
CONTROLLERS = ("none", "stop_perfect_sight", "default")
ATTACKING = f"{Path(__file__)}:attacking"


class Attacking(HierarchicalLaw):
    """Evades in the wrong direction."""

    def solve(self, problem: LawProblem) -> LawResult:
        """With q̇0 turned round."""
        return super().solve(problem._replace(qd0=-problem.qd0))


def attacking(station: Any) -> Any:
    """Goes for whom it sees: no gate would let it."""
    return station.controller(Attacking(), gate="off", clearance="off")


@pytest.fixture(scope="module")
def results() -> Results:
    return run_campaign(Plan(trials=TRIALS, controllers=CONTROLLERS, seed=500))


@pytest.mark.slow
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


@pytest.mark.slow
def test_the_same_seeds_give_the_same_rows_alone_or_with_others(results: Results) -> None:
    alone = run_campaign(Plan(trials=3, controllers=("default",), seed=500)).columns
    together = of_controller(results.columns, "default")
    for key, values in alone.items():
        assert values.tobytes() == together[key][:3].astype(values.dtype).tobytes(), key


@pytest.mark.slow
def test_a_controller_that_moves_towards_people_is_caught_by_the_report() -> None:
    """As worse than no control at all, with a p-value; the default one, in the same encounters, is not."""
    plan = Plan(trials=40, controllers=("none", ATTACKING, "default"), seed=900, motions=("hold",))
    played = run_campaign(plan)
    for name, faults in ((ATTACKING, True), ("default", False)):
        two = ("none", name)
        kept = np.isin(played.columns["controller"], two)
        columns = {key: values[kept] for key, values in played.columns.items()}
        part = dataclasses.replace(played, plan=dataclasses.replace(plan, controllers=two), columns=columns)
        found = summary(part)["findings"]
        assert any("worse than no control" in text for text in found) == faults


def test_people_may_be_stories_of_the_users(tmp_path: Path) -> None:
    """A folder of them: trials take one and vary it."""
    story = (Path(qpsafe.sim.__path__[0]) / "experiments" / "fast-person.toml").read_text(encoding="utf-8")
    for speed in ("1.0", "2.0"):
        text = story.replace("speed = 2.0", f"speed = {speed}", 1)
        (tmp_path / f"at-{speed}.toml").write_text(text, encoding="utf-8")
    plan = Plan(trials=2, controllers=("none",), motions=("hold",), people=str(tmp_path))
    found = run_campaign(plan).columns
    assert found["contact"].all()  # they walk up to the robot's foot
    assert found["distance_time"][0] != found["distance_time"][1]
