"""What is made of a controller's rows: shares of trials and figures, each with its definition and its unit as shown."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from qpsafe.sim.campaign.report.statistics import MEAN, MEDIAN, Array, Statistic
from qpsafe.sim.campaign.trials.harm import harm
from qpsafe.sim.campaign.trials.rows import Columns


class ShareMeasure(NamedTuple):
    """In how many trials something happened.

    Attributes:
        name: In JSON.
        title: Short, for tables.
        meaning: Its definition in a line.
        hits: Rows of a controller -> whether it happened, one truth value a trial.
        compared: Whether controllers are compared by it.
    """

    name: str
    title: str
    meaning: str
    hits: Callable[[Columns], NDArray[np.bool_]]
    compared: bool = False

    @property
    def heading(self) -> str:
        """Over its column."""
        return self.title

    def cells(self, found: dict[str, Any]) -> tuple[str, str]:
        """Value and limits of a controller of a summary, as shown."""
        count = found[self.name]
        none = found["none_of_n"].get(self.name)
        low, high = found["intervals"][self.name]
        limits = (
            f"{percent(low)} to {percent(high)} %" if none is None else f"below {100 * none['rule_of_three']:.2g} %"
        )
        return f"{count:,} ({percent(count / found['trials'])} %)", limits

    def difference(self, item: dict[str, Any]) -> tuple[str, str]:
        """Difference of a comparison of a summary, and how many trials make it, as shown."""
        return (
            f"{percent(item['difference'], True)} %",
            f"+{item['only_controller']:,}, -{item['only_reference']:,} trials",
        )


class FigureMeasure(NamedTuple):
    """A mean or a quantile over all trials.

    Attributes:
        name: In JSON.
        title: Short, for tables.
        unit: As shown; JSON is in SI.
        scale: Shown value over the SI value.
        digits: Shown behind the point.
        meaning: Its definition in a line.
        values: Rows of a controller -> one finite value a trial, SI.
        item: Which statistic of them.
        compared: Whether controllers are compared by it.
    """

    name: str
    title: str
    unit: str
    scale: float
    digits: int
    meaning: str
    values: Callable[[Columns], Array]
    item: Statistic
    compared: bool = False

    @property
    def heading(self) -> str:
        """Over its column, with the unit."""
        return self.title if self.unit == "1" else f"{self.title} [{self.unit}]"

    def cells(self, found: dict[str, Any]) -> tuple[str, str]:
        """Value and limits of a controller of a summary, as shown."""
        return self.shown(found[self.name]), self._limits(found["intervals"][self.name])

    def difference(self, item: dict[str, Any]) -> tuple[str, str]:
        """Difference of a comparison of a summary and its limits, as shown."""
        return self.shown(item["difference"], True), self._limits(item["interval"])

    def _limits(self, interval: Sequence[float | None]) -> str:
        known = [self.shown(limit) for limit in interval if limit is not None and limit == limit]  # no NaN
        return " to ".join(known) or "no limits"

    def shown(self, value: float, signed: bool = False) -> str:
        """A value in its unit as shown, without the unit."""
        return f"{self.scale * value + 0.0:{'+' if signed else ''}.{self.digits}f}"


def _column(name: str) -> Callable[[Columns], NDArray[Any]]:
    return lambda rows: rows[name]


def _or_zero(name: str) -> Callable[[Columns], Array]:
    """A column, zero where it does not apply."""
    return lambda rows: np.nan_to_num(rows[name].astype(float), nan=0.0)


SHARES = (
    ShareMeasure("contacts", "contacts", "the robot touched a person or what they carry", _column("contact"), True),
    ShareMeasure(
        "moving", "moving", "contacts in which the robot's touching point moved (> 1 mm/s)", _column("moving"), True
    ),
    ShareMeasure(
        "towards", "towards", "contacts in which it moved towards the person (> 0.1 m/s)", _column("towards"), True
    ),
    ShareMeasure(
        "clamped", "clamped", "contacts of a part with furniture, floor or robot right behind it", _column("clamped")
    ),
    ShareMeasure(
        "over_limit",
        "over limit",
        "contacts whose energy exceeds the limit of the touched region",
        lambda rows: np.nan_to_num(rows["energy_share"], nan=0.0) > 1.0,
        True,
    ),
    ShareMeasure(
        "unseen",
        "unseen",
        "contacts of a part that lay farther than 0.3 m from every point seen",
        lambda rows: rows["contact"] & ~rows["near_seen"],
    ),
    ShareMeasure(
        "late_sight",
        "seen late",
        "trials in which whoever first came nearer than S_p had not been seen by then",
        lambda rows: ~rows["sight_in_time"],
    ),
    ShareMeasure("furniture", "furniture", "the robot touched furniture or the floor", _column("furniture"), True),
    ShareMeasure("self", "self", "the robot touched itself", _column("self")),
)

FIGURES = (
    FigureMeasure(
        "distance_median", "distance, median", "mm", 1e3, 0, "smallest distance of a trial: half of them keep less",
        _column("distance"), MEDIAN, True,
    ),
    FigureMeasure(
        "distance_p10", "distance, 10 %", "mm", 1e3, 0, "smallest distance of a trial: a tenth of them keep less",
        _column("distance"), Statistic(0.1), True,
    ),
    FigureMeasure(
        "harm_mean", "harm, mean", "1", 1.0, 4, "s/(1 + s) + ¼ exp(-d/0.1 m): s energy over its limit, d distance >= 0",
        lambda rows: harm(rows["energy_share"], rows["distance"]), MEAN, True,
    ),
    FigureMeasure(
        "energy_mean", "energy, mean", "J", 1.0, 3, "energy of the first contact, 0 without one",
        _or_zero("energy"), MEAN, True,
    ),
    FigureMeasure(
        "energy_p95", "energy, 95 %", "J", 1.0, 2, "energy of the first contact, 0 without one: 95 % have less",
        _or_zero("energy"), Statistic(0.95), True,
    ),
    FigureMeasure(
        "force_p95", "force, 95 %", "N", 1.0, 0, "force of the first contact, 0 without one: 95 % have less",
        _or_zero("force"), Statistic(0.95),
    ),
    FigureMeasure(
        "closing_p95", "closing, 95 %", "m/s", 1.0, 2, "closing speed at first contact, 0 without one: 95 % have less",
        _or_zero("closing_speed"), Statistic(0.95),
    ),
    FigureMeasure(
        "under_sp_mean", "under S_p", "s", 1.0, 2, "time below the separation S_p while the robot moved, mean",
        _column("under_sp"), MEAN,
    ),
    FigureMeasure(
        "progress_mean", "progress", "%", 1e2, 1, "path time done over path time that is done without people, mean",
        _column("progress"), MEAN,
    ),
    FigureMeasure(
        "lost_time_mean", "lost time", "s", 1.0, 2, "path time that is done without people less path time done, mean",
        _column("lost_time"), MEAN, True,
    ),
    FigureMeasure("stops_mean", "stops", "1", 1.0, 2, "stops in a trial, mean", _column("stops"), MEAN),
    FigureMeasure(
        "suspensions_mean", "suspensions", "1", 1.0, 2, "suspensions of the work in a trial, mean",
        _column("suspensions"), MEAN, True,
    ),
    FigureMeasure(
        "path_error_p95", "path error, 95 %", "mm", 1e3, 1, "largest distance off the path in work: 95 % have less",
        _or_zero("path_error"), Statistic(0.95),
    ),
    FigureMeasure(
        "reversals_mean", "reversals", "1", 1.0, 1, "turns of joints' speeds in a trial, the path's own too, mean",
        _column("reversals"), MEAN,
    ),
)  # fmt: skip


MEASURES: dict[str, ShareMeasure | FigureMeasure] = {measure.name: measure for measure in (*SHARES, *FIGURES)}


def percent(share: float, signed: bool = False) -> str:
    """A share in percent, to three digits or a tenth."""
    return f"{100.0 * share + 0.0:{'+' if signed else ''}.1f}"
