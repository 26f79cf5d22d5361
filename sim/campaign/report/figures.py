"""Figures of a campaign: harm against cycle time, distributions, kinds of contact; inline SVG for the page."""

from __future__ import annotations

import io
import re
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from qpsafe.sim.campaign.trials.rows import CLASSES, Columns
from qpsafe.sim.drawing.plots import STYLE, plain

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

#: Of the controllers that always are there; others take what is left.
COLOURS = {
    "none": "#8a8a8a",
    "stop": "#111111",
    "stop_perfect_sight": "#9c6b30",
    "nullspace": "#c98a00",
    "weighted": "#8e44ad",
    "strict": "#2a8c3c",
    "paper": "#17a2a2",
    "default": "#0b5fa5",
}
_OTHERS = ("#c0392b", "#e377c2", "#6b8e23", "#ff7f0e", "#4b3fa8", "#00695c")
#: Of kinds of contact, from harmless to worst.
_KINDS = dict(zip(CLASSES[1:], ("#c9d3dc", "#8fbf9f", "#f2cf66", "#d9534f", "#6d1f4f"), strict=True))
_SVG = {"svg.fonttype": "none", "svg.hashsalt": "qpsafe"}  # text stays text; the same figure is the same file
_POINTS = np.linspace(0.0, 1.0, 401)  # of a distribution's curve


def colours(names: Iterable[str]) -> dict[str, str]:
    """A colour for each controller, in their order."""
    spare = iter(_OTHERS * 10)
    return {name: COLOURS.get(name) or next(spare) for name in names}


def harm_figure(controllers: dict[str, dict[str, Any]]) -> Figure:
    """Harm against cycle time, with confidence boxes: contacts, and contacts above the energy limit.

    Args:
        controllers: Of a summary.
    """
    figure, axes = panels(1, 2, 7.6, 3.7)
    for axis, (name, label) in zip(axes, _HARMS, strict=True):
        for who, colour in colours(controllers).items():
            _box(axis, controllers[who], name, colour, plain(who))
        axis.set(xlabel="cycle time / undisturbed cycle time", ylabel=label)
        axis.set_ylim(0.0, None)
        axis.margins(x=0.08)
    legend_below(figure, axes[0], 4)
    return figure


_HARMS = (("contacts", "trials with contact [%]"), ("over_limit", "with contact above the energy limit [%]"))


def _box(axis: Axes, found: dict[str, Any], name: str, colour: str, label: str) -> None:
    """A controller as a point with its box; a cycle takes 1/progress of its undisturbed time."""
    from matplotlib.patches import Rectangle

    least, most = found["intervals"]["progress_mean"]
    if least <= 0.0 or found["progress_mean"] <= 0.0:
        return  # its cycle has no end
    low, high = (100.0 * limit for limit in found["intervals"][name])
    x, y = 1.0 / found["progress_mean"], 100.0 * found[name] / found["trials"]
    if not least > 0.0:  # NaN: so few trials that there are none
        least = most = found["progress_mean"]
    size = 1.0 / least - 1.0 / most, high - low
    axis.add_patch(Rectangle((1.0 / most, low), *size, facecolor=colour, alpha=0.22, linewidth=0))
    axis.add_patch(Rectangle((1.0 / most, low), *size, fill=False, edgecolor=colour, linewidth=0.8))
    axis.plot([x], [y], "o", color=colour, markersize=4, label=label, clip_on=False, zorder=3)


def distance_figure(rows: dict[str, Columns]) -> Figure:
    """How the smallest distance of a trial is distributed.

    Args:
        rows: Of each controller.
    """
    figure, (axis,) = panels(1, 1, 7.6, 3.4)
    for name, colour in colours(rows).items():
        levels = np.quantile(1e3 * rows[name]["distance"], _POINTS, method="inverted_cdf")
        axis.plot(levels, 100.0 * _POINTS, color=colour, linewidth=1.3, label=plain(name), drawstyle="steps-post")
    axis.axvline(0.0, color="#c0392b", linewidth=0.8)
    axis.set(xlabel="smallest distance of a trial [mm]; contact at 0", ylabel="share of trials with less [%]")
    axis.set_ylim(0.0, 100.0)
    axis.set_xlim(-50.0, max(float(np.quantile(1e3 * mine["distance"], 0.95)) for mine in rows.values()) + 50.0)
    legend_below(figure, axis, 4)
    return figure


def energy_figure(rows: dict[str, Columns]) -> Figure:
    """How often the energy of a contact exceeds a value, in joules and in shares of the touched region's limit.

    Args:
        rows: Of each controller.
    """
    from matplotlib.ticker import LogLocator

    figure, axes = panels(1, 2, 7.6, 3.4)
    labels = ("energy of the contact [J]", "energy / limit of the touched region")
    for axis, key, label in zip(axes, ("energy", "energy_share"), labels, strict=True):
        for name, colour in colours(rows).items():
            trials = len(rows[name][key])
            rising = np.sort(rows[name][key][rows[name][key] > 0.0])
            chosen = np.unique((_POINTS * (len(rising) - 1)).astype(int)) if len(rising) else np.zeros(0, dtype=int)
            heights = [100.0 * (len(rising) - k) / trials for k in chosen]
            axis.plot(rising[chosen], heights, color=colour, linewidth=1.3, label=plain(name), drawstyle="steps-pre")
        axis.set(xlabel=label, ylabel="share of trials with as much [%]")
        if any((mine[key] > 0.0).any() for mine in rows.values()):
            axis.set(xscale="log", yscale="log")
            for scale, labelled in ((axis.xaxis, (1.0,)), (axis.yaxis, (1.0, 2.0, 5.0))):
                scale.set_major_locator(LogLocator(subs=labelled))
                scale.set_major_formatter("{x:g}")
                scale.set_minor_formatter("")
    axes[1].axvline(1.0, color="#c0392b", linewidth=0.8)
    legend_below(figure, axes[0], 4)
    return figure


def kinds_figure(controllers: dict[str, dict[str, Any]]) -> Figure:
    """Contacts by what the robot did at the time, and by whether the touched part had been seen, stacked.

    Args:
        controllers: Of a summary.
    """
    names = list(controllers)
    figure, axes = panels(1, 2, 7.6, 1.3 + 0.28 * len(names))
    parts = (
        (axes[0], "classes", _KINDS, "robot, one tick before"),
        (axes[1], "seen", {"seen": "#7fb3d5", "unseen": "#5d4a66"}, "touched part"),
    )
    for axis, key, palette, title in parts:
        left = np.zeros(len(names))
        for kind, colour in palette.items():
            width = np.array([100.0 * controllers[n][key][kind] / controllers[n]["trials"] for n in names])
            axis.barh(range(len(names)), width, left=left, color=colour, label=kind, height=0.72)
            left += width
        axis.set_yticks(range(len(names)), [plain(name) for name in names] if axis is axes[0] else [])
        axis.invert_yaxis()
        axis.grid(axis="y", visible=False)
        axis.set(xlabel="trials with contact [%]")
        axis.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3, title=title, frameon=False)
    return figure


def panels(rows: int, columns: int, width: float, height: float) -> tuple[Figure, Sequence[Axes]]:
    """A figure that no window system knows of, in the style of all others.

    Args:
        rows: Of axes.
        columns: Of axes.
        width: [inch].
        height: [inch].
    """
    import matplotlib
    from matplotlib.figure import Figure

    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(width, height), layout="constrained")
        return figure, figure.subplots(rows, columns, squeeze=False).ravel().tolist()


def legend_below(figure: Figure, axis: Axes, columns: int) -> None:
    """A legend under a figure.

    Args:
        figure: Whose.
        axis: Whose curves and points.
        columns: Of the legend.
    """
    figure.legend(*axis.get_legend_handles_labels(), loc="outside lower center", ncols=columns, frameon=False)


def svg(figure: Figure, name: str) -> str:
    """A figure as an element of a page.

    Args:
        figure: The figure.
        name: Prefix that keeps its ids apart from those of other figures on the page.
    """
    import matplotlib

    text = io.StringIO()
    with matplotlib.rc_context(_SVG):
        figure.savefig(text, format="svg", metadata={"Date": None, "Creator": None, "Format": None, "Type": None})
    found = text.getvalue()
    found = found[found.index("<svg") :]
    found = re.sub(
        r'<svg [^>]*?viewBox="([^"]*)"[^>]*>', rf'<svg viewBox="\1" role="img" aria-label="{name}">', found, count=1
    )
    found = re.sub(r"\s*<metadata>.*?</metadata>", "", found, flags=re.DOTALL)
    return re.sub(r'(\bid="|url\(#|href="#)', rf"\g<1>{name}-", found)
