"""Figures of a tuning: all trials with the front, and what matters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from qpsafe.sim.campaign.report.figures import legend_below, panels
from qpsafe.sim.drawing.plots import plain

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_STOPPED, _REFUSED, _WHOLE, _FRONT, _CHOSEN = "#c9d3dc", "#f2b8a0", "#7fb3d5", "#0b5fa5", "#2a8c3c"


def front_figure(said: Mapping[str, Any]) -> Figure:
    """Harm against work lost, less the present values': every trial, the finals, the front and the chosen values.

    Trials and finals met different people, so each is shown against the present values among the same ones.

    Args:
        said: A result, see `qpsafe.sim.tuning.result`.
    """
    figure, (axis,) = panels(1, 1, 7.6, 4.6)
    start, finals = said["trials"][0], said["finals"]
    trials, best = said["trials"], said["front"]
    now, finalists = (start, []) if finals is None else (finals["finalists"][0], finals["finalists"][1:])
    counted = [t for t in trials if t["whole"] and t["violation"] == 0.0]
    kinds = (
        ("stopped early", _STOPPED, [t for t in trials if not t["whole"]]),
        ("a constraint not kept", _REFUSED, [t for t in trials if t["whole"] and t not in counted]),
        ("all encounters", _WHOLE, counted),
    )
    for label, colour, mine in kinds:
        if not mine:
            continue
        axis.plot(*_places(mine, start), "o", color=colour, markersize=3.5, label=label)
    for there in finalists:
        (x0, x1), (y0, y1) = zip(_place(trials[there["number"]], start), _place(there, now), strict=True)
        axis.plot((x0, x1), (y0, y1), ":", color=_FRONT, linewidth=0.8)
    if finalists:
        axis.plot(*_places(finalists, now), "s", color=_FRONT, markersize=4.5, label="the same among new people")
    axis.plot(*_places(best, now), "-", color=_FRONT, linewidth=1.2, label="front")
    axis.plot(*_places([now], now), "X", color="#c0392b", markersize=9, label="present values")
    axis.plot(*_places([said["chosen"]], now), "*", color=_CHOSEN, markersize=13, label="chosen")
    axis.set(xlabel="work lost an encounter, less the present values' [s]", ylabel="harm, less the present values'")
    (xs, ys), (more_xs, more_ys) = _places(counted, start), _places([*best, *finalists], now)
    axis.set_xlim(*_room([0.0, *xs, *more_xs]))  # early stops far outside are not shown
    axis.set_ylim(*_room([0.0, *ys, *more_ys]))
    legend_below(figure, axis, 3)
    return figure


def sensitivity_figure(shares: Mapping[str, Mapping[str, float]]) -> Figure:
    """Bars of the coordinates' shares in each objective.

    Args:
        shares: See `qpsafe.sim.tuning.sensitivity`.
    """
    names = list(shares["harm"])
    names.sort(key=lambda name: -max(found[name] for found in shares.values()))
    figure, axes = panels(1, 2, 7.6, 1.1 + 0.24 * len(names))
    for axis, (key, title) in zip(axes, (("harm", "harm"), ("lost", "work lost")), strict=True):
        axis.barh(range(len(names)), [100.0 * shares[key][name] for name in names], color=_FRONT, height=0.7)
        axis.set_yticks(range(len(names)), [plain(name) for name in names] if axis is axes[0] else [])
        axis.invert_yaxis()
        axis.grid(axis="y", visible=False)
        axis.set(xlabel="share [%]", title=title)
    return figure


def _room(values: Sequence[float]) -> tuple[float, float]:
    """Limits of an axis that shows values."""
    low, high = min(values), max(values)
    room = 0.08 * (high - low) or 1e-3
    return low - room, high + room


def _place(point: Mapping[str, Any], start: Mapping[str, Any]) -> tuple[float, float]:
    return point["lost"] - start["lost"], point["harm"] - start["harm"]


def _places(points: Sequence[Mapping[str, Any]], start: Mapping[str, Any]) -> tuple[list[float], list[float]]:
    places = [_place(point, start) for point in points]
    return [x for x, _ in places], [y for _, y in places]
