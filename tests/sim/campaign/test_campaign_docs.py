"""Tables of the documentation are made from definitions and from the committed JSON: no number in them is by hand."""

from __future__ import annotations

import importlib.util
import re
from pathlib import Path
from typing import Any

import made_up_trials
import pytest

from qpsafe.errors import ConfigurationError
from qpsafe.sim.campaign.limit.row import Limit
from qpsafe.sim.campaign.plan import Plan, parse_plan
from qpsafe.sim.campaign.report.limits import limits_summary
from qpsafe.sim.campaign.report.markdown import asked, filled
from qpsafe.sim.campaign.report.measures import MEASURES
from qpsafe.sim.campaign.report.summary import summary
from qpsafe.sim.campaign.runner import run_campaign
from qpsafe.sim.campaign.trials.rows import COLUMNS
from qpsafe.text.toml_text import TomlText

DOCS = Path(__file__).resolve().parents[3] / "docs"
PAGE = DOCS / "explanation" / "campaign.md"


def script() -> Any:
    """docs/campaign_tables.py."""
    spec = importlib.util.spec_from_file_location("campaign_tables", DOCS / "campaign_tables.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


TABLES = script()
DEFINED = {"columns", "measures", "limits"}


@pytest.fixture(scope="module")
def found() -> dict[str, Any]:
    made = run_campaign(Plan(trials=40, controllers=("none", "stop", "default")), trial=made_up_trials.run)
    return summary(made)


@pytest.mark.parametrize("page", TABLES.PAGES, ids=lambda page: page.name)
def test_tables_are_what_definitions_and_the_committed_campaign_make(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    assert text == TABLES.made(text, TABLES.PAGES[page]), "run: python docs/campaign_tables.py"


def test_the_page_defines_everything_and_quotes_a_campaign_if_there_is_one() -> None:
    here = set(asked(PAGE.read_text(encoding="utf-8")))
    assert here >= DEFINED
    assert here - DEFINED
    text = PAGE.read_text(encoding="utf-8")
    for name in (*(column.name for column in COLUMNS), *MEASURES):
        assert f"`{name}`" in text


def test_a_number_that_is_not_in_the_summary_is_noticed(found: dict[str, Any]) -> None:
    marks = "<!-- campaign: contacts, distance_median -->\n<!-- campaign: end -->\n\n"
    marks += "<!-- campaign: less stop: contacts, energy_p95 -->\n<!-- campaign: end -->\n"
    text = filled(marks, found)
    assert filled(text, found) == text
    assert asked(text) == ["contacts, distance_median", "less stop: contacts, energy_p95"]
    for name, controller in found["controllers"].items():
        (first, *_) = re.findall(rf"^\| `{name}` \|.*$", text, re.MULTILINE)
        assert f"| {controller['contacts']} (" in first
        assert f"| {1e3 * controller['distance_median']:.0f}<br>" in first
    rows = [match.span() for match in re.finditer(r"^\| `.*$", text, re.MULTILINE)]
    numbers = [match.span() for row in rows for match in re.compile(r"\d+").finditer(text, *row)]
    assert len(numbers) > 30
    for begin, end in numbers:
        changed = text[:begin] + str(int(text[begin:end]) + 1) + text[end:]
        assert filled(changed, found) != changed


def test_what_was_possible_is_told_where_it_was_searched(found: dict[str, Any]) -> None:
    mark = "<!-- campaign: possible -->\n<!-- campaign: end -->\n"
    with pytest.raises(ConfigurationError, match="possible"):
        filled(mark, found)
    limit = Limit(3, 3, "hold", "default", 1.5, -0.06, -0.09, 0.0432, 0.05, True, True, True, 0.25, 800)
    text = filled(mark, found | {"limits": {"default": limits_summary([limit, limit._replace(seen=False)])}})
    assert "| `default` | 2 | 1 | 2 | 2 | 0 | 43 | -60 | 25 |" in text


def test_what_the_page_says_of_the_tables_is_so() -> None:
    text = " ".join(PAGE.read_text(encoding="utf-8").split())
    data = TABLES.measured("campaign")["controllers"]
    ours, stop = data["default"], data["stop"]
    for words, value, low, high in (
        ("by a quarter", 1.0 - ours["contacts"] / stop["contacts"], 0.22, 0.28),
        ("twice as often as the stop is", ours["moving"] / stop["moving"], 1.75, 2.25),
        ("more than four times what it costs the stop", ours["lost_time_mean"] / stop["lost_time_mean"], 4.0, 4.9),
        ("left again about three times", ours["suspensions_mean"], 2.5, 3.5),
        ("Two thirds of the contacts", ours["unseen"] / ours["contacts"], 0.62, 0.71),
        ("Half as many contacts exceed", ours["over_limit"] / stop["over_limit"], 0.4, 0.6),
    ):
        assert words in text
        assert low <= value <= high, words
    assert 2 * stop["moving"] < stop["contacts"]
    assert stop["furniture"] == 0 < ours["furniture"]
    assert ours["energy_mean"] < stop["energy_mean"]


@pytest.mark.parametrize(
    "what", ["bravery", "contacts, bravery", "less nobody: contacts", "less stop: progress_mean", ""]
)
def test_what_there_is_not_cannot_be_asked(what: str, found: dict[str, Any]) -> None:
    with pytest.raises(ConfigurationError, match="comment"):
        filled(f"<!-- campaign: {what} -->\n<!-- campaign: end -->", found)
    with pytest.raises(ConfigurationError):
        filled("<!-- campaign: contacts -->\n<!-- campaign: end -->", None)


def test_the_plan_on_the_page_is_one() -> None:
    page = DOCS / "how-to" / "campaign.md"
    (text,) = re.findall(r"```toml\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL)
    plan = parse_plan(TomlText(text, page))
    assert plan == Plan(controllers=("none", "stop", "default"), sensor="sharp", lag=0.02, trials=5000, seed=100_000)
