"""Tables of a documentation page, made from definitions and from a summary: no number in them is written by hand.

A table stands between two comments, the first of which says what is in it:

    <!-- campaign: columns -->                  what a row holds
    <!-- campaign: measures -->                 what is made of rows
    <!-- campaign: limits -->                   what is made of limits
    <!-- campaign: possible -->                 limits of the controllers for whom they were searched
    <!-- campaign: contacts, energy_p95 -->     controllers by these measures, with limits
    <!-- campaign: less stop: contacts -->      differences to a reference
    <!-- campaign: end -->
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from typing import Any

from qpsafe.errors import ConfigurationError
from qpsafe.sim.campaign.report.limits import MEASURES as LIMITS
from qpsafe.sim.campaign.report.measures import FIGURES, MEASURES, SHARES
from qpsafe.sim.campaign.trials.rows import COLUMNS

_TABLE = re.compile(r"<!-- campaign: (?!end)(.*?) -->\n.*?<!-- campaign: end -->", re.DOTALL)


def filled(text: str, found: dict[str, Any] | None = None) -> str:
    """A page with all its tables made anew.

    Args:
        text: Of the page.
        found: A summary; None if there is none.

    Raises:
        ConfigurationError: A comment asks for something that does not exist.
    """
    return _TABLE.sub(
        lambda mark: f"<!-- campaign: {mark[1]} -->\n\n{_table(mark[1], found)}\n\n<!-- campaign: end -->", text
    )


def asked(text: str) -> list[str]:
    """What the comments of a page ask for."""
    return [mark[1] for mark in _TABLE.finditer(text)]


def _table(what: str, found: dict[str, Any] | None) -> str:
    if what == "columns":
        return _lines(("column", "unit", "definition"), [(f"`{c.name}`", c.unit, c.meaning) for c in COLUMNS])
    if what == "measures":
        shares = [(m.title, f"`{m.name}`", "trials", m.meaning) for m in SHARES]
        figures = [(m.title, f"`{m.name}`", m.unit, m.meaning) for m in FIGURES]
        return _lines(("measure", "in JSON", "unit shown", "definition"), shares + figures)
    if what == "limits":
        return _lines(
            ("measure", "in JSON", "unit shown", "definition"),
            [(m.title, f"`{m.name}`", m.unit, m.meaning) for m in LIMITS],
        )
    if what == "possible" and found is not None and "limits" in found:
        rows = [[f"`{who}`", *(m.shown(said) for m in LIMITS)] for who, said in found["limits"].items()]
        return _lines(["contacts of", *(m.heading for m in LIMITS)], rows)
    less, _, names = what.rpartition(": ")
    unknown = [name for name in names.split(", ") if name not in MEASURES]
    if found is None or unknown or (less and less.removeprefix("less ") not in found["references"]):
        raise ConfigurationError("campaign: table", "comment", what, "columns, measures, or measures of a summary")
    measures = [MEASURES[name] for name in names.split(", ")]
    heads = ["controller", *(m.heading for m in measures)]
    if not less:
        rows = [
            [f"`{who}`", *("<br>".join(m.cells(one)) for m in measures)] for who, one in found["controllers"].items()
        ]
        return _lines(heads, rows)
    items = {
        (item["controller"], item["measure"]): item
        for item in found["comparisons"]
        if item["reference"] == less.removeprefix("less ")
    }
    try:
        cells = [
            [f"`{who}`", *(_difference(items[who, name]) for name in names.split(", "))]
            for who in dict.fromkeys(controller for controller, _ in items)
        ]
    except KeyError as missing:
        raise ConfigurationError(
            "campaign: table", "comment", what, f"a measure that is compared, not {missing}"
        ) from None
    return _lines(heads, cells)


def _difference(item: dict[str, Any]) -> str:
    value, limits = MEASURES[item["measure"]].difference(item)
    return f"{value}<br>{limits}<br>p = {item['p_holm']:.2g}"


def _lines(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = [heads, ["---"] * len(heads), *rows]
    return "\n".join(re.sub(r" {2,}\|", " |", f"| {' | '.join(line)} |") for line in lines)
