"""How many contacts were avoidable, and how much of what was possible a controller reached: for JSON and the page."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from qpsafe.sim.campaign.limit.row import Limit
from qpsafe.sim.campaign.report.html import Html, element, joined, table
from qpsafe.sim.campaign.report.measures import percent
from qpsafe.sim.campaign.report.statistics import share

CLEARLY = 0.02  # a contact that is avoidable by more is clearly so [m]
METHOD = (
    "The best motion with foresight was searched for from the first detection on: same state, same joint limits, "
    "people's motion known in advance, off furniture, floor and the robot itself. It is a lower bound of what is "
    "possible."
)


class LimitMeasure(NamedTuple):
    """What is made of the limits of a controller's contacts.

    Attributes:
        name: In JSON.
        title: For tables.
        unit: As shown; JSON is in SI.
        meaning: Its definition in a line.
        value: Of the limits.
        scale: Shown value over the SI value.
    """

    name: str
    title: str
    unit: str
    meaning: str
    value: Callable[[Sequence[Limit]], float | None]
    scale: float = 1.0

    @property
    def heading(self) -> str:
        """Over its column, with the unit."""
        return self.title if self.unit == "trials" else f"{self.title} [{self.unit}]"

    def shown(self, said: dict[str, Any]) -> str:
        """The value of a summary in its unit as shown; a dash if there is none."""
        value = said[self.name]
        return "-" if value is None else f"{value:,}" if isinstance(value, int) else f"{self.scale * value:.0f}"


def _count(hit: Callable[[Limit], bool]) -> Callable[[Sequence[Limit]], int]:
    return lambda limits: sum(map(hit, limits))


def _median(name: str) -> Callable[[Sequence[Limit]], float | None]:
    def value(limits: Sequence[Limit]) -> float | None:
        values: NDArray[np.float64] = np.array([getattr(item, name) for item in limits], dtype=float)
        values = values[np.isfinite(values)]
        return float(np.quantile(values, 0.5, method="inverted_cdf")) if len(values) else None

    return value


MEASURES = (
    LimitMeasure(
        "looked_at", "contacts looked at", "trials", "contacts of the controller whose limit was searched", len
    ),
    LimitMeasure(
        "unseen", "nobody seen before", "trials", "of these: nobody was detected before the contact",
        _count(lambda item: not item.seen),
    ),
    LimitMeasure(
        "avoidable", "avoidable", "trials", "of these: a motion without contact was found",
        _count(lambda item: item.avoidable),
    ),
    LimitMeasure(
        "clearly_avoidable", "by more than 20 mm", "trials", "of these: one that keeps more than 20 mm",
        _count(lambda item: item.avoidable and item.limit > CLEARLY),
    ),
    LimitMeasure(
        "unavoidable", "surely not", "trials",
        "seen before, and no motion avoids it: it came before one could move the arm, or was with the base",
        _count(lambda item: item.seen and item.fixed <= 0.0),
    ),
    LimitMeasure(
        "limit_median", "limit, median", "mm", "largest smallest distance found, median over those seen before",
        _median("limit"), 1e3,
    ),
    LimitMeasure(
        "distance_median", "distance, median", "mm",
        "the controller's own smallest distance, median over all looked at", _median("distance"), 1e3,
    ),
    LimitMeasure(
        "reached_median", "limit reached, median", "%",
        "of the distance that could be gained over no control, how much the controller gained; median",
        _median("reached"), 1e2,
    ),
)  # fmt: skip


def limits_summary(limits: Sequence[Limit]) -> dict[str, Any]:
    """For JSON: every measure by its name, and the limits of the share of avoidable contacts at 95 %."""
    found: dict[str, Any] = {measure.name: measure.value(limits) for measure in MEASURES}
    if limits:
        counted = share(np.array([item.avoidable for item in limits]))
        found["avoidable_interval"] = [counted.low, counted.high]
    return found


def limits_section(found: dict[str, Any], contacts: dict[str, int]) -> Html:
    """Of the page.

    Args:
        found: Summaries by controller.
        contacts: How many contacts each controller has.
    """
    lines = []
    for name, said in found.items():
        cells: list[Any] = [m.shown(said) for m in MEASURES]
        cells[0] = joined((cells[0], element("small", f"of {contacts[name]:,}")))
        low, high = said["avoidable_interval"]
        cells[2] = joined((cells[2], element("small", f"{percent(low)} to {percent(high)} %")))
        lines.append([name, *cells])
    meanings = [(m.title, m.name, m.unit, m.meaning) for m in MEASURES]
    more = table(("measure", "in JSON", "shown in", "definition"), meanings, range(4))
    return joined(
        (
            element("h2", "What was possible"),
            element("p", METHOD),
            table(["contacts of", *(m.heading for m in MEASURES)], lines),
            element("details", element("summary", "Definitions"), more),
        )
    )
