"""The report: JSON that keeps its contract and agrees with the rows, one whole page, faults that are found."""

from __future__ import annotations

import json
import math
import re
import shlex
from collections import Counter
from collections.abc import Callable
from html.parser import HTMLParser
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import made_up_trials
import numpy as np
import pytest

from qpsafe.errors import ConfigurationError
from qpsafe.sim.campaign.plan import CONTROLLERS, Plan
from qpsafe.sim.campaign.report.comparisons import pairs
from qpsafe.sim.campaign.report.findings import findings
from qpsafe.sim.campaign.report.html import Html, element, page
from qpsafe.sim.campaign.report.measures import FIGURES, SHARES
from qpsafe.sim.campaign.report.page import report_page, show_command
from qpsafe.sim.campaign.report.summary import summary
from qpsafe.sim.campaign.runner import Results, run_campaign
from qpsafe.sim.campaign.trials.rows import COLUMNS, of_controller
from qpsafe.text.json_text import json_text

pytestmark = pytest.mark.long

PLAN = Plan(trials=60, seed=5)
FLAT = (
    "trials", "contacts", "moving", "towards", "furniture", "self", "distance_median", "distance_p10", "lost_time_mean",
    "suspensions_mean", "energy_p95",
)  # fmt: skip


def played(plan: Plan, change: Callable[[dict[str, Any]], object] = lambda row: None) -> Results:
    """Made-up trials, every row changed in place."""

    def trial(plan: Plan, number: int) -> list[dict[str, Any]]:
        rows = made_up_trials.run(plan, number)
        for row in rows:
            change(row)
        return rows

    return run_campaign(plan, trial=trial)


@pytest.fixture(scope="module")
def results() -> Results:
    return played(PLAN)


@pytest.fixture(scope="module")
def found(results: Results) -> dict[str, Any]:
    return summary(results)


@pytest.fixture(scope="module")
def text(results: Results, found: dict[str, Any]) -> str:
    return report_page(results, found)


# JSON


def test_the_contract_is_kept_in_json_that_every_reader_reads(found: dict[str, Any]) -> None:
    def refused(word: str) -> float:
        raise AssertionError(word)

    read = json.loads(json_text(found), parse_constant=refused)
    assert list(read["controllers"]) == list(CONTROLLERS)
    for controller in read["controllers"].values():
        assert set(FLAT) <= controller.keys()
        assert all(isinstance(controller[key], int) for key in FLAT[:6])
        assert all(isinstance(controller[key], float) for key in FLAT[6:])
        assert set(controller["intervals"]) == {m.name for m in (*SHARES, *FIGURES)}
        for key, (low, high) in controller["intervals"].items():
            value = controller[key] / controller["trials"] if isinstance(controller[key], int) else controller[key]
            assert low <= value <= high, key
    assert read["seeds"] == [5, 64]
    assert read["engine"]["all_controllers_s_per_process_s"] > 0.0


def test_figures_are_those_of_the_rows(results: Results, found: dict[str, Any]) -> None:
    rows = [row for k in range(60) for row in made_up_trials.run(PLAN, k)]
    for name, controller in found["controllers"].items():
        mine = [row for row in rows if row["controller"] == name]
        assert controller["contacts"] == sum(row["contact"] for row in mine) == sum(controller["classes"].values())
        assert controller["contacts"] == sum(controller["regions"].values()) == sum(controller["seen"].values())
        assert controller["contacts"] == sum(motion["contacts"] for motion in controller["motions"].values())
        assert controller["towards"] == sum(row["towards"] for row in mine)
        assert controller["unseen"] == sum(row["contact"] and not row["near_seen"] for row in mine)
        assert controller["over_limit"] == sum(row["energy_share"] > 1.0 for row in mine)
        distances = sorted(row["distance"] for row in mine)
        assert controller["distance_median"] == distances[29]  # at least half are no larger
        assert controller["distance_p10"] == distances[5]
        assert controller["lost_time_mean"] == pytest.approx(np.mean([row["lost_time"] for row in mine]))
        energies = sorted(row["energy"] if row["contact"] else 0.0 for row in mine)
        assert controller["energy_p95"] == energies[56]
        worst = found["worst"][name]
        assert [case["search"] for case in worst] == sorted((row["search"] for row in mine), reverse=True)[:10]


def test_who_is_compared_with_whom() -> None:
    assert pairs(["none", "stop", "strict", "default"]) == [
        ("none", "stop"), ("strict", "stop"), ("default", "stop"), ("none", "default"), ("strict", "default"),
    ]  # fmt: skip
    assert pairs(["none", "strict"]) == []


def test_comparisons_are_corrected_together_and_agree_with_the_counts(found: dict[str, Any]) -> None:
    said, items = found["statistics"], found["comparisons"]
    measures = sum(m.compared for m in (*SHARES, *FIGURES))
    assert said["comparisons"] == len(items) == len(pairs(list(found["controllers"]))) * measures
    assert said["resamples"] >= 100 * len(items)
    assert all(item["p"] <= item["p_holm"] <= min(len(items) * item["p"], 1.0) for item in items)
    assert min(item["p_holm"] for item in items) < 0.05
    for item in items:
        a, b = (found["controllers"][item[key]] for key in ("controller", "reference"))
        if item["only_controller"] is None:
            assert item["difference"] == pytest.approx(a[item["measure"]] - b[item["measure"]], abs=1e-12)
        else:
            assert item["only_controller"] - item["only_reference"] == a[item["measure"]] - b[item["measure"]]
            assert 60 * item["difference"] == pytest.approx(a[item["measure"]] - b[item["measure"]])


@pytest.mark.slow
@pytest.mark.parametrize("controllers", [("default",), ("none", "strict"), ("stop", "default")])
def test_few_controllers_and_a_single_trial_make_a_report(controllers: tuple[str, ...]) -> None:
    made = played(Plan(trials=1, controllers=controllers))
    found = summary(made)
    assert list(found["controllers"]) == list(controllers)
    assert "default" not in controllers or "--controller default" in report_page(made, found)


def test_more_resamples_may_be_asked_for(results: Results) -> None:
    few, more = summary(results), summary(results, resamples=3 * summary(results)["statistics"]["resamples"])
    assert more["statistics"]["resamples"] == 3 * few["statistics"]["resamples"]
    for name, found in few["controllers"].items():
        assert more["controllers"][name]["contacts"] == found["contacts"]


def test_harm_is_the_blow_and_how_near_it_came(results: Results) -> None:
    found = summary(results)["controllers"]
    for name in PLAN.controllers:
        rows, total = of_controller(results.columns, name), 0.0
        for share, distance in zip(rows["energy_share"].tolist(), rows["distance"].tolist(), strict=True):
            blow = share / (1.0 + share) if share == share else 0.0
            total += blow + 0.25 * math.exp(-max(distance, 0.0) / 0.1)
        assert found[name]["harm_mean"] == pytest.approx(total / len(rows["trial"]), rel=1e-5)


def test_no_trial_makes_none(results: Results) -> None:
    empty = {name: values[:0] for name, values in results.columns.items()}
    with pytest.raises(ConfigurationError, match="at least one"):
        summary(Results(PLAN, empty, 0.0, None, {}))


@pytest.mark.slow
def test_nobody_who_touches_makes_a_report() -> None:
    """Nothing to divide by, nothing to draw."""
    quiet = {"contact": False, "contact_class": "none", "contact_region": "", "near_seen": False, "progress": 0.0}
    quiet |= {"moving": False, "towards": False, "clamped": False} | dict.fromkeys(
        ("energy", "energy_share"), float("nan")
    )
    made = played(Plan(trials=12, controllers=("none", "stop")), lambda row: row.update(quiet))
    found = summary(made)
    assert found["controllers"]["stop"]["none_of_n"]["contacts"]["rule_of_three"] == 0.25
    assert "0 (0.0 %)" in report_page(made, found)


# Faults


def faults(change: Callable[[dict[str, Any]], object], trials: int = 20) -> list[str]:
    made = played(Plan(trials=trials, controllers=("none", "default")), change)
    return findings({name: of_controller(made.columns, name) for name in made.plan.controllers})


@pytest.mark.slow
def test_a_controller_that_moves_towards_people_is_found_in_twenty_trials() -> None:
    def broken(row: dict[str, Any]) -> None:
        if row["controller"] == "default":
            row |= {"contact": True, "moving": True, "towards": True, "contact_class": "towards", "energy_share": 3.0}

    said = faults(broken)
    assert all("default is worse than no control" in line for line in said)
    assert any("moved towards the person" in line for line in said)
    assert any("exceeds the limit" in line for line in said)
    made = played(Plan(trials=20, controllers=("none", "stop", "default")), broken)
    found = summary(made)
    counts = [line.partition(" (p =")[0] for line in said]
    assert set(counts) <= {line.partition(" (p =")[0] for line in found["findings"]}
    assert "moved towards the person" in report_page(made, found)


def test_limits_that_are_passed_and_bad_commands_are_found_and_nothing_else_is() -> None:
    assert faults(lambda row: None) == []
    assert faults(lambda row: None, 300) == []

    def excess(row: dict[str, Any]) -> None:
        row["limit_excess"] = 0.02 if row["controller"] == "default" and row["trial"] == 3 else 1e-12

    assert faults(excess) == ["default passes a joint limit in 1 trial, by 2 %"]
    assert faults(lambda row: row.update(bad_ticks=int(row["trial"] < 2 and row["controller"] == "none"))) == [
        "none gives a bad command in 2 trials"
    ]
    for wild in (float("nan"), float("inf")):
        said = faults(lambda row, wild=wild: row.update(limit_excess=wild if row["trial"] < 2 else 0.02))  # type: ignore[misc]
        whole = "passes a joint limit in 20 trials, by 2 %, in 2 trials by a command that is no number"
        assert said == [f"{name} {whole}" for name in ("none", "default")]
        assert faults(lambda row, wild=wild: row.update(limit_excess=wild), 1) == [  # type: ignore[misc]
            f"{name} passes a joint limit in 1 trial, in 1 trial by a command that is no number"
            for name in ("none", "default")
        ]


@pytest.mark.parametrize("name", ["progress", "lost_time", "under_sp", "distance"])
def test_a_figure_that_is_no_number_where_it_always_applies_is_named_and_not_taken_for_none(name: str) -> None:
    made = played(Plan(trials=3, controllers=("none", "stop")), lambda row: row.update({name: float("nan")}))
    with pytest.raises(ConfigurationError, match=rf"values\['none {name}"):
        summary(made)


# The page


class Reader(HTMLParser):
    """Checks that elements are closed in order; keeps what could be fetched, names, and texts."""

    VOID = ("meta", "wbr")

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.links: list[str] = []
        self.ids: list[str] = []
        self.seen: Counter[str] = Counter()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.seen[tag] += 1
        self.ids += [value or "" for name, value in attrs if name == "id"]
        self.links += [value or "" for name, value in attrs if name in ("href", "src", "xlink:href", "action")]
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


def test_the_page_is_whole_and_needs_no_network(text: str, tmp_path: Path) -> None:
    reader = Reader()
    reader.feed(text)
    assert not reader.open
    assert all(link.startswith("#") for link in reader.links)
    assert not re.findall(r"url\((?!#)|@import|<script|<link|<img|<iframe", text)
    assert len(set(reader.ids)) == len(reader.ids)
    pointed = set(re.findall(r"url\(#([^)]+)\)", text)) | {link[1:] for link in reader.links}
    assert pointed <= set(reader.ids)
    assert reader.seen["svg"] == reader.seen["figure"] == 4
    assert 'name="viewport"' in text
    assert "@media print" in text
    for image in re.findall(r"<svg.*?</svg>", text, re.DOTALL):
        ElementTree.fromstring(image.replace("xlink:href", "href"))  # well-formed


def test_the_page_has_every_measure_every_column_and_every_figure(text: str, found: dict[str, Any]) -> None:
    plain = re.sub(r"\s+", " ", re.sub(r"<[^>]+>", " ", re.sub(r"<svg.*?</svg>", "", text, flags=re.DOTALL)))
    for measure in (*SHARES, *FIGURES):
        assert f" {measure.name} " in plain
        assert element("i", measure.meaning)[3:-4] in plain
    for column in COLUMNS:
        assert element("i", column.meaning)[3:-4] in plain
    for name, controller in found["controllers"].items():
        assert f"{controller['contacts']} ({100 * controller['contacts'] / 60:.1f} %)" in plain
        for measure in FIGURES:
            assert measure.shown(controller[measure.name]) in plain
        for case in found["worst"][name]:
            assert show_command(PLAN, case["trial"], name) in plain
    for words in found["statistics"]["methods"]:
        assert element("i", words)[3:-4] in plain
    assert "nan" not in plain.lower().split()


@pytest.mark.slow
def test_the_same_rows_make_the_same_report_but_for_times(text: str, found: dict[str, Any]) -> None:
    again = played(PLAN)
    numbers = summary(again)
    page = report_page(again, numbers)
    assert text.count('id="times"') == 1
    times = re.compile(r'<p class="soft" id="times">.*?</p>')
    assert times.sub("", page) == times.sub("", text)
    assert json_text(numbers | {"engine": None}) == json_text(found | {"engine": None})


def test_the_command_to_replay_says_the_plan() -> None:
    plan = Plan(seed=7, sensor="sharp", lag=0.02, trials=4, controllers=("stop",))
    words = shlex.split(show_command(plan, 3, "stop"))
    assert words == shlex.split("qpsafe campaign show 3 --controller stop --sensor sharp --lag 0.02 --seed 7")
    assert show_command(Plan(), 3, "stop") == "qpsafe campaign show 3 --controller stop"


def test_what_stands_in_names_is_text() -> None:
    hostile = "<b>&\"'[red]"
    shown = page(hostile, element("p", hostile, title=hostile), Html("<hr>"))
    assert "<b>" not in shown
    assert "<hr>" in shown
    assert shown.count("&lt;b&gt;&amp;") == 3
