"""`qpsafe campaign limit`: what was possible in a trial, a case, or the contacts of a folder."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from made_up_trials import FEW

from qpsafe.sim.campaign.limit.row import Limit
from qpsafe.sim.campaign.limit.search import EVALUATIONS
from qpsafe.sim.campaign.plan import Plan
from qpsafe.sim.campaign.worst.cases import Encounter

pytestmark = pytest.mark.long

Campaign = Callable[..., Any]


def found_limit(plan: Plan, what: Any, controller: str, evaluations: int) -> Limit:
    """Made up; trial 0 is avoidable, the others are not."""
    trial = what if isinstance(what, int) else -1
    best = 0.04 if trial == 0 else -0.01
    return Limit(
        trial, plan.seed_of(trial), "hold", controller, 1.5, -0.06, -0.09, best, 0.05, True, True, best > 0.0,
        0.03 / (best + 0.09), evaluations,
    )  # fmt: skip


def test_the_limit_of_a_trial_or_a_case(campaign: Campaign, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    asked: list[tuple[Any, ...]] = []

    class Module:
        @staticmethod
        def limit_of(*what: Any) -> Any:
            asked.append(what)
            return SimpleNamespace(limit=found_limit(*what))

    monkeypatch.setitem(sys.modules, "qpsafe.sim.campaign.limit.limit", Module)  # type: ignore[arg-type]
    shown = campaign("limit", "0", "--seed", "9", "--motions", "hold", "--controller", "stop")
    assert shown.exit_code == 0, shown.output
    for words in ("best motion found, with foresight 40", "avoidable, by 40 mm at least", "stop gained 23 %", "1.50 s"):
        assert words in " ".join(shown.output.split())
    table = {
        "plan": Plan(seed=3, lag=0.02).to_dict(),
        "controller": "strict",
        "cases": [{"motion": "hold", "u": [0.5] * 42}],
    }
    (tmp_path / "worst.json").write_text(json.dumps(table))
    told = json.loads(campaign("limit", "worst.json#0", "--evaluations", "300", "--json").stdout)
    assert told["avoidable"] is False
    assert "no proof" in told["sentence"]
    (plan, trial, controller, tries), (other, said, name, few) = asked
    assert (plan.seed, plan.motions, trial, controller, tries) == (9, ("hold",), 0, "stop", EVALUATIONS)
    assert (other.lag, said, name, few) == (0.02, Encounter("hold", (0.5,) * 42), "strict", 300)


@pytest.mark.usefixtures("plain_page")
def test_the_limits_of_a_folder_go_into_its_report(
    campaign: Campaign, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr("qpsafe.sim.campaign.limit.folder._limit", found_limit)
    campaign(*FEW, "--trials", "40", "--out", "kept")
    shown = campaign("limit", "kept", "--workers", "1")
    assert shown.exit_code == 0, shown.output
    assert "qpsafe campaign report kept" in " ".join(shown.output.split())
    told = json.loads(campaign("limit", "kept", "--workers", "1", "--controller", "default", "--json").stdout)
    report = json.loads(campaign("report", "kept", "--json").stdout)
    assert report["limits"] == {"default": {k: v for k, v in told.items() if k not in ("controller", "trials")}}
    assert told["looked_at"] == len(told["trials"]) == report["controllers"]["default"]["contacts"]
    assert '"limits": {' in (tmp_path / "kept" / "report.html").read_text(encoding="utf-8")


@pytest.mark.usefixtures("plain_page")
def test_ctrl_c_says_that_limits_are_kept(campaign: Campaign, monkeypatch: pytest.MonkeyPatch) -> None:
    def stops(*_: Any) -> Limit:
        raise KeyboardInterrupt

    monkeypatch.setattr("qpsafe.sim.campaign.limit.folder._limit", stops)
    campaign(*FEW, "--trials", "40", "--out", "kept")
    stopped = campaign("limit", "kept", "--workers", "1")
    assert "what was found is kept in kept: the same command goes on there" in " ".join(stopped.output.split())
