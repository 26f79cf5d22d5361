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
    """Harm against work lost: every trial, the front, the present values and the chosen ones.

    Args:
        said: A result, see `qpsafe.sim.tuning.result`.
    """
    figure, (axis,) = panels(1, 1, 7.6, 4.6)
    trials, best = said["trials"], said["front"]
    counted = [t for t in trials if t["whole"] and t["violation"] == 0.0]
    kinds = (
        ("stopped early", _STOPPED, [t for t in trials if not t["whole"]]),
        ("a constraint not kept", _REFUSED, [t for t in trials if t["whole"] and t not in counted]),
        ("all encounters", _WHOLE, counted),
    )
    for label, colour, mine in kinds:
        axis.plot(*_places(mine), "o", color=colour, markersize=3.5, label=label)
    axis.plot(*_places(best), "o-", color=_FRONT, markersize=4.5, linewidth=1.0, label="front")
    axis.plot(*_places([said["present"]]), "X", color="#c0392b", markersize=9, label="present values")
    axis.plot(*_places([said["chosen"]]), "*", color=_CHOSEN, markersize=13, label="chosen")
    axis.set(xlabel="work lost an encounter [s]", ylabel="harm")
    shown = [*best, said["present"], *counted]
    for limits, values in ((axis.set_xlim, _places(shown)[0]), (axis.set_ylim, _places(shown)[1])):
        room = 0.08 * (max(values) - min(values)) or 0.1 * max(values[0], 1e-3)
        limits(min(values) - room, max(values) + room)  # early stops far outside are not shown
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


def _places(points: Sequence[Mapping[str, Any]]) -> tuple[list[float], list[float]]:
    return [p["lost"] for p in points], [p["harm"] for p in points]
